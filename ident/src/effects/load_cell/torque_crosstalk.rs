//! `torque_crosstalk`: the thrust cell reads part of the torque.
//!
//! What it is: thrust_n += coefficient * torque_nm: beam and arm are not quite at right angles.
//! What can go wrong: torque is itself nearly quadratic in the speed, and the thrust polynomial takes that part: only torque's
//! departures from it (gusts, spin-up, damage, friction on the arm) show, so that the standard error is large on a quiet run. The
//! torque's own sensor noise never reached the thrust cell: left in the column it would make the coefficient too small, so the
//! measured departures are first shrunk by the share of them that is real. Against a declared model it may set in: a gain that changes looks
//! alike where the load is held, and only jumps, whose torque also turns the rotor faster, tell. There the torque is the model's, free of noise; what
//! is written down reads the measured one.
//! Units: N/(N.m).
//! Reference: cross-axis sensitivity of multi-component balances, Barlow, Rae & Pope 1999, *Low-Speed Wind Tunnel Testing*, ch. 7;
//! regression calibration, Carroll et al. 2006, *Measurement Error in Nonlinear Models*, ch. 4.

use crate::channel::{Context, Relation, Target};
use crate::effects::design::TargetDesign;
use crate::effects::load_cell::tare_shift::{coarse_onset, step};
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, present};
use crate::numeric::solve::Normal;

/// See the module.
pub(crate) struct TorqueCrosstalk;

impl Effect for TorqueCrosstalk {
    fn id(&self) -> &'static str {
        "torque_crosstalk"
    }

    fn about(&self) -> About {
        About {
            title: "The thrust cell reads part of the torque",
            equation: "thrust_n += coefficient * torque_nm, for t >= t0 where it sets in",
            source: "Barlow, Rae & Pope 1999, Low-Speed Wind Tunnel Testing, chapter 7",
            depends_on: &["torque_nm"],
            signature: "the thrust residual repeats what torque does beyond its own polynomial",
            look_alikes: &["blade_damage", "channel_filter", "reynolds_thrust"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the thrust cell",
            found.tell(
                "coefficient",
                |v| format!("reads {v} of the torque").replace("N/(N.m)", "N per N.m"),
                "reads a part of the torque",
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
        if present(context, &["thrust_n", "torque_nm"]).len() < 2 {
            return Vec::new();
        }
        let forms: &[&str] = if context.against_model && !context.time_is_row { &["", SETS_IN] } else { &[""] };
        forms.iter().map(|form| Instance::new(&["thrust_n"], form)).collect()
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        if instance.form == SETS_IN { vec![coarse_onset(context)] } else { Vec::new() }
    }

    fn seen(&self, _: &Context, instance: &Instance) -> f64 {
        if instance.form == SETS_IN { -RARE } else { 0.0 }
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "coefficient", unit: "N/(N.m)" }]
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        if let [t0] = shape {
            let measured = context.torque.as_deref().unwrap_or_default();
            let torque = if context.expected_torque.is_empty() { measured } else { &context.expected_torque };
            if torque.len() == context.len() {
                design.add(position, 0, step(context, *t0).iter().zip(torque).map(|(s, q)| s * q).collect());
            }
        } else if let Some(torque) = context.facts.torque.get_or_init(|| acting_torque(context)) {
            design.add(position, 0, torque.clone());
        }
    }

    fn report(&self, context: &Context, instance: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        if instance.form == SETS_IN {
            return fitted;
        }
        for e in fitted.iter_mut().filter(|e| e.name == "coefficient") {
            e.se += farthest(context, e.value) / 1.96;
        }
        fitted
    }

    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        let top =
            |name: &str| context.target(name).map_or(0.0, |k| context.targets[k].y.iter().fold(0.0, |a: f64, v| a.max(v.abs())));
        let ratio = top("thrust_n") / top("torque_nm").max(1e-9);
        // a wake or an error of the speed shakes both in the ratio of the readings themselves; and a cell that reads more of
        // the torque than of the thrust is another instrument
        let credible = |c: f64| c.abs() < MOST_OF_THE_THRUST * (ratio - c);
        // a declared model does not absorb the course with the speed, and a gain of the cell has that too: what the torque does
        // beyond it must show the coefficient by itself
        let by_itself = |c: f64| !context.against_model || farthest(context, c) < c.abs();
        if instance.form == SETS_IN {
            let of = |e: &Estimate| e.value.abs() > 4.0 * e.se && credible(e.value);
            return fitted.iter().filter(|e| e.name == "coefficient").all(of);
        }
        let known = |e: &Estimate| e.value.abs() > 4.0 * e.se && by_itself(e.value);
        fitted.iter().all(|e| known(e) && credible(e.value) && is_seen_between_jumps(context, e.value))
    }
}

/// Form of a cell that reads the torque from an instant on.
const SETS_IN: &str = "sets in";

/// Evidence, nats, against a beam and an arm that move against each other during a run: a gain that changes is the simpler cause of what both explain.
const RARE: f64 = 3.0;

/// How far the direct and the reverse regression of thrust on torque lie from a coefficient.
fn farthest(context: &Context, coefficient: f64) -> f64 {
    bounds(context).map_or(0.0, |b| b.map(|b| (coefficient - b).abs()).into_iter().fold(0.0, f64::max))
}

/// Largest torque share for the thrust that is left once it is taken away.
const MOST_OF_THE_THRUST: f64 = 2.0;
/// Bands of speed in which the scatter of torque and thrust is compared.
const BANDS: usize = 12;
/// Fewest samples of a band.
const FEWEST: usize = 20;
/// Share of the torque's scatter that must be found in the thrust before the rest is called the sensor's own.
const NEEDED_AGREEMENT: f64 = 0.3;

/// The torque that acted, as far as it can be told: its course with the speed, and of its departures the share that is real.
///
/// With departures q of the torque that are real, thrust scatters by c q beside its own noise, and torque by q beside its sensor's:
/// the covariance is c var(q), and what the thrust scatters beyond its noise at rest is c^2 var(q). The two give c and, in each band of
/// speed, var(q) over the torque's variance.
fn acting_torque(context: &Context) -> Option<Vec<f64>> {
    let torque = context.torque.as_ref()?;
    let [thrust_target, target] = ["thrust_n", "torque_nm"].map(|name| context.target(name).map(|k| &context.targets[k]));
    let (thrust_target, target) = (thrust_target?, target?);
    let powers = context.powers(Relation::Torque).get(..=Relation::Torque.degree())?;
    let columns: Vec<Vec<f64>> = powers.iter().map(|p| target.rows.iter().map(|i| p[*i]).collect()).collect();
    let course = Normal::of_columns(&columns, &target.y, &vec![1.0; target.y.len()]).solve()?.coefficients;
    let expected: Vec<f64> = (0..context.len()).map(|i| powers.iter().zip(&course).map(|(p, c)| p[i] * c).sum()).collect();
    let fastest = context.rpm.iter().fold(1e-9, |a: f64, v| a.max(*v));
    let band = |i: usize| ((context.rpm[i] / fastest * BANDS as f64).max(0.0) as usize).min(BANDS - 1);
    let scatter = scatter(context, thrust_target, target, band);
    let sum = |f: &dyn Fn(&Scatter) -> f64| scatter.iter().map(f).sum::<f64>();
    let excess = sum(&|s| s.thrust - thrust_target.noise.a * s.samples);
    let (both, own) = (sum(&|s| s.both), sum(&|s| s.torque));
    if excess <= 0.0 || both * both <= NEEDED_AGREEMENT * excess * own {
        return Some(torque.clone());
    }
    let coefficient = excess / both;
    let real = |s: &Scatter| if s.samples < FEWEST as f64 { 1.0 } else { (s.both / (coefficient * s.torque)).clamp(0.0, 1.0) };
    let real: Vec<f64> = scatter.iter().map(real).collect();
    Some((0..context.len()).map(|i| expected[i] + real[band(i)] * (torque[i] - expected[i])).collect())
}

/// The bounds of the coefficient by the scatter alone: as if the torque sensor had the noise that it has at rest, and as if the load cell
/// had. Which of the two grows noisier as the rotor turns cannot be told, so the coefficient is somewhere between (Frisch 1934, Statistical
/// Confluence Analysis).
fn bounds(context: &Context) -> Option<[f64; 2]> {
    let [thrust, torque] = ["thrust_n", "torque_nm"].map(|name| context.target(name).map(|k| &context.targets[k]));
    let (thrust, torque) = (thrust?, torque?);
    let all = scatter(context, thrust, torque, |_| 0)[0];
    let direct = all.both / (all.torque - torque.noise.a * all.samples);
    let reverse = (all.thrust - thrust.noise.a * all.samples) / all.both;
    (direct.is_finite() && reverse.is_finite() && direct * reverse > 0.0).then_some([direct, reverse])
}

/// Standard errors by which the coefficient must show where the load holds still, and the share of itself that must.
const SEEN: (f64, f64) = (4.0, 0.3);

/// Whether thrust follows torque also where the load holds still: right after a jump each meter has a lag of its own, and torque holds what
/// turns the rotor faster. Either sample by sample or, for departures that last, beside the course of time.
fn is_seen_between_jumps(context: &Context, coefficient: f64) -> bool {
    let [Some(thrust), Some(torque)] = ["thrust_n", "torque_nm"].map(|name| context.target(name).map(|k| &context.targets[k]))
    else {
        return false;
    };
    let seen = |value: f64, se: f64| value / coefficient > SEEN.1 && value.abs() > SEEN.0 * se;
    let all = scatter(context, thrust, torque, |_| 0)[0];
    if all.torque > 0.0 && seen(all.both / all.torque, 1.5 * (all.thrust / all.torque / all.samples.max(1.0)).sqrt()) {
        return true;
    }
    let Some(readings) = &context.torque else { return false };
    let mut settled = vec![false; context.len()];
    context.calm.iter().for_each(|stretch| settled[settled_rows(stretch)].fill(true));
    let span = context.duration().max(1e-9);
    let mut normal = Normal::new(6);
    let mut rows = 0.0;
    for (i, y) in thrust.rows.iter().zip(&thrust.y).filter(|(i, _)| settled[**i] && !context.runs_down(**i)) {
        let (n, t) = (context.rpm[*i] / 1000.0, context.t[*i] / span);
        normal.add(&[readings[*i], 1.0, n, n * n, t, t * t], *y, 1.0);
        rows += 1.0;
    }
    let freedom = rows - 6.0;
    normal
        .solve()
        .is_some_and(|s| freedom > 10.0 && seen(s.coefficients[0], (s.inverse[(0, 0)] * s.rss / freedom).max(0.0).sqrt()))
}

/// Rows of a stretch without the part that belongs to settling.
fn settled_rows((from, to): &(usize, usize)) -> std::ops::Range<usize> {
    (from + 2 + (to - from) / 10).min(*to)..*to
}

/// Sums of squared second differences, a sixth of them each: variances times samples.
#[derive(Debug, Clone, Copy, Default)]
struct Scatter {
    thrust: f64,
    torque: f64,
    both: f64,
    samples: f64,
}

/// How thrust and torque scatter about their own course, alone and together, in each band of speed.
fn scatter(context: &Context, thrust: &Target, torque: &Target, band: impl Fn(usize) -> usize) -> [Scatter; BANDS] {
    let mut rows = vec![[f64::NAN; 2]; context.len()];
    for (k, target) in [thrust, torque].into_iter().enumerate() {
        // while a rotor runs down both go with its speed
        target.rows.iter().zip(&target.y).filter(|(i, _)| !context.runs_down(**i)).for_each(|(i, y)| rows[*i][k] = *y);
    }
    let mut out = [Scatter::default(); BANDS];
    for stretch in &context.calm {
        let settled = settled_rows(stretch);
        let from = settled.start;
        for (k, w) in rows[settled].windows(3).enumerate() {
            let [t, q] = [0, 1].map(|c| w[0][c] - 2.0 * w[1][c] + w[2][c]);
            if t.is_finite() && q.is_finite() {
                let s = &mut out[band(from + k + 1)];
                s.thrust += t * t / 6.0;
                s.torque += q * q / 6.0;
                s.both += t * q / 6.0;
                s.samples += 1.0;
            }
        }
    }
    out
}
