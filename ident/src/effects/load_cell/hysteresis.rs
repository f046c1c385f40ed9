//! `hysteresis`: the load cell reads differently on the way down.
//!
//! What it is: thrust_n += width * (direction / 2) * 4 f (1 - f), f the share of the full load, direction -1 going up and +1 coming down; or a play whose
//! elements change sides one after the other.
//! What can go wrong: needs a schedule that comes back (one that only climbs makes it a suspect); drift over an up-down sweep looks alike.
//! Units: N, at mid range.
//! Reference: OIML R 60 (load cells), hysteresis error.

use crate::channel::Context;
use crate::effects::design::TargetDesign;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Instance, Scope, Shape, Stage, present};

/// See the module.
pub(crate) struct Hysteresis;

impl Effect for Hysteresis {
    fn id(&self) -> &'static str {
        "hysteresis"
    }

    fn about(&self) -> About {
        About {
            title: "Hysteresis of the load cell",
            equation: "thrust_n += width * direction / 2 * 4 f (1 - f), f = (rpm / rpm_max)^2; or, as play: thrust_n += width * sum of the lags of play elements with slacks up to `slack` / their largest sum",
            source: "OIML R 60",
            depends_on: &["direction", "thrust_n"],
            signature: "the thrust residual of the way up and of the way down bend apart in the middle and meet at the ends",
            look_alikes: &["creep", "zero_drift"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the load cell",
            found.tell_signed(
                "width",
                (1.0, found.unit()),
                ["more", "less"],
                |word, v| format!("reads up to {v} {word} on the way down than up"),
                "reads otherwise on the way up than down",
            ),
        )
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        if comes_back(context) { forms(context) } else { Vec::new() }
    }

    /// A run that only climbs shows one side of it, which is a bend of the cell's curve.
    fn suspects(&self, context: &Context) -> Vec<Instance> {
        if comes_back(context) { Vec::new() } else { forms(context) }
    }

    fn shapes(&self, _: &Context, instance: &Instance) -> Vec<Shape> {
        if instance.form == PLAY {
            vec![Shape { name: "slack", unit: "1", range: (0.005, 0.4), starts: vec![0.02, 0.05, 0.1, 0.2] }]
        } else {
            Vec::new()
        }
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "width", unit: "N" }]
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        if let [slack] = shape {
            design.add(position, 0, play(context, *slack));
            return;
        }
        let top = context.rpm.iter().copied().fold(1.0, f64::max);
        let values = direction(context)
            .iter()
            .zip(&context.rpm)
            .map(|(d, rpm)| {
                let f = (rpm / top).powi(2).clamp(0.0, 1.0);
                0.5 * d * 4.0 * f * (1.0 - f)
            })
            .collect();
        design.add(position, 0, values);
    }
}

/// Whether a twentieth of the run is on the way up, and as much on the way down.
fn comes_back(context: &Context) -> bool {
    let direction = direction(context);
    let (up, down) = (direction.iter().filter(|d| **d < 0.0).count(), direction.iter().filter(|d| **d > 0.0).count());
    up.min(down) * 20 >= context.len()
}

fn forms(context: &Context) -> Vec<Instance> {
    if present(context, &["thrust_n"]).is_empty() {
        return Vec::new();
    }
    vec![Instance::new(&["thrust_n"], ""), Instance::new(&["thrust_n"], PLAY)]
}

/// Form in which the reading changes sides gradually: play elements in parallel.
const PLAY: &str = "play";

/// Elements of the play, with slacks of one to this many parts of the largest.
const ELEMENTS: usize = 4;

/// Half the sum of the lags of the play elements over their largest sum: -1/2 on the way up, 1/2 on the way down, and in
/// between after a reversal. The load is taken as the square of the speed.
fn play(context: &Context, slack: f64) -> Vec<f64> {
    let top = context.rpm.iter().copied().fold(1.0, f64::max);
    let slacks: Vec<f64> = (1..=ELEMENTS).map(|k| slack * k as f64 / ELEMENTS as f64).collect();
    let opening = 2.0 * slacks.iter().sum::<f64>();
    let mut elements = [0.0; ELEMENTS];
    context
        .rpm
        .iter()
        .map(|rpm| {
            let load = (rpm / top).powi(2);
            let lag: f64 = elements
                .iter_mut()
                .zip(&slacks)
                .map(|(element, slack)| {
                    *element = f64::clamp(*element, load - slack, load + slack);
                    *element - load
                })
                .sum();
            lag / opening
        })
        .collect()
}

/// -1 while the last step of the load went up, +1 while it went down, 0 before any.
pub(crate) fn direction(context: &Context) -> Vec<f64> {
    let (signal, threshold): (&[f64], f64) = match &context.pulse {
        Some(p) => (p, 2.0),
        None => (&context.rpm, 0.02 * context.rpm.iter().copied().fold(0.0, f64::max)),
    };
    let mut out = Vec::with_capacity(signal.len());
    let (mut anchor, mut state) = (signal.first().copied().unwrap_or(0.0), 0.0);
    for v in signal {
        if *v > anchor + threshold {
            state = -1.0;
            anchor = *v;
        } else if *v < anchor - threshold {
            state = 1.0;
            anchor = *v;
        }
        out.push(state);
    }
    out
}
