//! `quantisation`: a channel resolves only coarse steps.
//!
//! What it is: the reading is the nearest multiple of `step`; the departure from the truth is a saw-tooth of the truth. Where noise comes after the
//! rounding no reading lies on the grid, but all gather about it ([`beneath_noise`]).
//! What can go wrong: noise as large as the step smears the saw-tooth out, and nothing is offered then.
//! Units: the channel's.
//! Reference: Widrow & Kollar 2008, *Quantization Noise*.

use crate::channel::lattice::{lattice, step};
use crate::channel::{Context, STANDSTILL, Target, unit_of};
use crate::effects::design::TargetDesign;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage};
use crate::numeric::solve::Normal;

mod beneath_noise;

use beneath_noise::{Grid, levels, mean, rounds};

/// See the module.
pub(crate) struct Quantisation;

impl Effect for Quantisation {
    fn id(&self) -> &'static str {
        "quantisation"
    }

    fn about(&self) -> About {
        About {
            title: "A channel resolves only coarse steps",
            equation: "reading = step * round(truth / step), beneath the noise offset + step * round((truth + zero - offset) / step)",
            source: "Widrow & Kollar 2008, Quantization Noise",
            depends_on: &["reading"],
            signature: "all readings are multiples of one step, or gather about the lines of a grid; the residual is a saw-tooth of the reading",
            look_alikes: &["sample_hold", "throttle_quantisation"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            found.meter(),
            found.tell_in("step", found.unit(), |v| format!("shows only steps of {v}"), "shows only coarse steps"),
        )
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let beneath = |t: &Target| beneath_noise::grid(context, t).is_some();
        let unseen = if context.against_model { BENEATH } else { BY_LEVELS };
        let seen = |t: &Target| {
            let form = if step(t).is_some() { Some("") } else { beneath(t).then_some(unseen) };
            form.map(|form| Instance::new(&[t.name], form))
        };
        context.targets.iter().filter(|t| rounds(t)).filter_map(seen).collect()
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        // read off the values, not fitted
        let target = context.targets.iter().find(|t| instance.touches(t.name));
        let of = |name, found| Shape { name, unit: "channel", range: (found, found), starts: vec![found] };
        if instance.form.is_empty() {
            return vec![of("step", target.and_then(step).unwrap_or(0.0))];
        }
        let (step, offset) = target.and_then(|t| beneath_noise::grid(context, t)).map_or((0.0, 0.0), |g| (g.step, g.offset));
        // a relation that is fitted to these readings has their zero
        if instance.form == BY_LEVELS {
            return vec![of("step", step), of("offset", offset)];
        }
        // by how much the zero is another one than the model's: a level that falls on the wrong side of an edge is off by a whole step
        let zero = Shape {
            name: "zero",
            unit: "channel",
            range: (-0.5 * step, 0.5 * step),
            starts: (-20..21).map(|k| step * f64::from(k) / 41.0).collect(),
        };
        vec![of("step", step), of("offset", offset), zero]
    }

    fn seen(&self, context: &Context, instance: &Instance) -> f64 {
        if !instance.form.is_empty() {
            return 0.0;
        }
        // of readings without steps each lies a quarter of a step from the next multiple, on average
        let target = context.targets.iter().find(|t| instance.touches(t.name));
        target.and_then(|t| Some(t.y.len() as f64 * (0.25 / lattice(t)?.departure.max(0.01)).ln())).unwrap_or(0.0)
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "depth", unit: "1" }]
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let Some(target) = context.targets.iter().find(|t| instance.touches(t.name)) else { return };
        if let [step, offset, zero @ ..] = shape {
            if *step <= 0.0 {
                return;
            }
            let zero = zero.first().copied().unwrap_or(0.0);
            // a declared model knows the truth but for the zero of the day; an edge is as sharp as that is known
            let grid = Grid { step: *step, offset: *offset };
            let Some(truth) = design.known().or_else(|| within_lines(context, target, design, &grid)) else { return };
            let edge = EDGE * target.noise.rms / step;
            let read = |v: &f64| step * round((v + zero - offset) / step, edge) + offset;
            design.add(position, 0, truth.iter().map(|v| read(v) - v).collect());
        } else if let [step] = shape
            && *step > 0.0
            && let Some(truth) = within_steps(context, target, design, *step)
        {
            design.add(position, 0, truth.iter().map(|v| step * (v / step).round() - v).collect());
        }
    }

    /// Step and offset are read off: no likelihood knows their errors.
    fn report(&self, context: &Context, instance: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        let noise = context.targets.iter().find(|t| instance.touches(t.name)).map_or(f64::NAN, |t| t.noise.rms);
        let of_levels = noise / (context.steady.len().max(1) as f64).sqrt();
        for e in fitted.iter_mut().filter(|_| instance.form == BY_LEVELS) {
            match e.name.as_str() {
                "step" => e.se = 1e-3 * e.value,
                "offset" => e.se = of_levels,
                _ => {}
            }
        }
        fitted
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        fitted.iter().any(|e| e.name == "depth" && e.value > 0.2 && e.value < 1.5)
    }
}

/// Part of the noise within which a truth is known where noise comes after the rounding: a level within that of an edge may be on either side.
const EDGE: f64 = 0.3;

/// Widths of an edge from which on a level is on one side of it: there the way across is done to one part in 400.
const CLEAR: f64 = 3.0;

/// The nearest whole number, or on an edge of some width what lies between the two.
fn round(v: f64, edge: f64) -> f64 {
    let whole = v.floor();
    whole + 0.5 * (1.0 + ((v - whole - 0.5) / edge).tanh())
}

/// Form in which noise comes after the rounding, so that no reading lies on the grid.
const BENEATH: &str = "beneath the noise";
/// The same where no declared model knows the truth: the run's own levels say where it lies.
const BY_LEVELS: &str = "beneath the noise by its levels";

/// The truth as the relation's own columns give it, moved until each reading is its rounding wherever they can.
fn within_steps(context: &Context, target: &Target, design: &TargetDesign, step: f64) -> Option<Vec<f64>> {
    let stride = target.y.len().div_ceil(SAMPLES).max(1);
    let rows = || target.rows.iter().step_by(stride);
    let samples = Samples {
        columns: rows().flat_map(|i| design.columns.iter().map(|c| c.values[*i])).collect(),
        known: rows().map(|i| design.fixed.get(*i).copied().unwrap_or(0.0)).collect(),
        readings: target.y.iter().copied().step_by(stride).collect(),
    };
    Some(design.predict(&samples.moved_into(0.5 * step, design.columns.len(), PROJECTIONS)?, context.len()))
}

/// The same where noise comes after the rounding: each level is a sample, and reads the line of the grid that it lies by.
fn within_lines(context: &Context, target: &Target, design: &TargetDesign, grid: &Grid) -> Option<Vec<f64>> {
    let mut samples = Samples::default();
    for (rows, readings) in levels(context, target) {
        let of_rows = |values: &[f64]| rows.iter().filter_map(|row| values.get(*row)).sum::<f64>() / rows.len() as f64;
        samples.columns.extend(design.columns.iter().map(|c| of_rows(&c.values)));
        samples.known.push(of_rows(&design.fixed));
        samples.readings.push(grid.line(mean(readings)));
    }
    // on an edge a level would read what lies between two lines
    let half = (0.5 * grid.step - CLEAR * EDGE * target.noise.rms).max(0.0);
    Some(design.predict(&samples.moved_into(half, design.columns.len(), OF_LEVELS)?, context.len()))
}

/// What says where the truth lies.
#[derive(Default)]
struct Samples {
    /// The columns of all samples one after the other, sample by sample.
    columns: Vec<f64>,
    /// What is known of each without them.
    known: Vec<f64>,
    /// What each reads.
    readings: Vec<f64>,
}

impl Samples {
    /// Coefficients of the columns, with which each reading is the rounding of the truth wherever they can: the readings are replaced by what is nearest to
    /// the fit within `half` of them, half a step, and the fit is made again.
    ///
    /// Reference: projections onto convex sets, Combettes 1993, Proceedings of the IEEE 81:182.
    fn moved_into(&self, half: f64, width: usize, rounds: usize) -> Option<Vec<f64>> {
        if width == 0 {
            return Some(Vec::new());
        }
        let mut normal = Normal::new(width);
        self.columns.chunks_exact(width).for_each(|row| normal.add(row, 0.0, 1.0));
        let factor = normal.factor()?;
        let mut nearest = self.readings.clone();
        let mut coefficients = Vec::new();
        let mut projections = vec![0.0; width];
        for _ in 0..rounds {
            projections.fill(0.0);
            for (row, (y, known)) in self.columns.chunks_exact(width).zip(nearest.iter().zip(&self.known)) {
                projections.iter_mut().zip(row).for_each(|(p, v)| *p += v * (y - known));
            }
            coefficients = factor.solve(&projections)?;
            let mut moved = 0.0_f64;
            let samples = self.columns.chunks_exact(width).zip(&self.known).zip(self.readings.iter().zip(&mut nearest));
            for ((row, known), (y, z)) in samples {
                let truth = row.iter().zip(&coefficients).fold(0.0, |sum, (v, c)| sum + c * v) + known;
                let next = truth.clamp(y - half, y + half);
                moved = moved.max((next - *z).abs());
                *z = next;
            }
            if moved < 2e-3 * half {
                break;
            }
        }
        Some(coefficients)
    }
}

/// Samples that say where the truth lies.
const SAMPLES: usize = 1000;
/// Most rounds of moving the truth into the steps.
const PROJECTIONS: usize = 30;
/// The same where a sample is a level: a run has some tens of them.
const OF_LEVELS: usize = 1000;

/// Share of readings that repeat the one before where rounding makes three times the error of what noise there is: noise of a tenth of a step
/// crosses an edge on every ninth row (the mean distance of two readings, 1.13 standard deviations, over the step).
const COARSE: f64 = 0.89;
/// Fewest steps that a run shows, and fewest readings.
const SHOWN: (f64, usize) = (8.0, 100);

/// What a channel's own readings show, whatever its model says: that it resolves steps three times as coarse as its noise, as an instance and its
/// estimates.
pub(crate) fn by_readings(context: &Context, target: &Target) -> Option<(Instance, Vec<Estimate>)> {
    let turns = |row: usize| context.rpm.get(row).is_none_or(|r| *r > STANDSTILL);
    let live: Vec<f64> = target.y.iter().zip(&target.rows).filter(|(_, row)| turns(**row)).map(|(y, _)| *y).collect();
    let step = lattice(target)?.step;
    let repeats = live.windows(2).filter(|w| (w[0] - w[1]).abs() < 0.5 * step).count() as f64 / live.len().max(1) as f64;
    let (low, high) = live.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| (low.min(*y), high.max(*y)));
    let shown = live.len() >= SHOWN.1 && high - low > SHOWN.0 * step;
    let unit = unit_of(target.name).to_owned();
    let estimate = Estimate { name: "step".to_owned(), unit, value: step, se: 1e-3 * step };
    (shown && repeats > COARSE).then(|| (Instance::new(&[target.name], ""), vec![estimate]))
}
