//! The rival of every name that follows time: a curve that bends more than the declared one.
//!
//! What it is: on a run that climbs level by level time, heat and charge rise with the load, so that what a declared polynomial misses
//! looks like any of them. Where further powers of the load explain a residual better than such a newcomer, it is not named.
//! What can go wrong: an effect that on this schedule is nothing but a curve is not found.
//! Units: evidence in nats.
//! Reference: confounding on a plain upward staircase, specification `closing-the-loop.md`, step 4.

use crate::context::{Context, Relation};
use crate::diagnose::{Candidate, net_gain, shares};
use crate::effects::{Instance, unknown};
use crate::hypothesis::{Declared, Fit, Placed, Rows, fit};

/// Order of the polynomial in the load.
const ORDER: usize = 6;
/// What an effect follows that is no function of the load.
const OF_TIME: [&str; 5] = ["t_s", "heat", "charge", "temp_c", "time_since_step"];

/// Whether a curve that bends more explains what the newest effect of a candidate does, and better.
pub(crate) fn explains_better(context: &Context, declared: Declared<'_>, best: &Fit, candidate: &Candidate) -> bool {
    let Some(newest) = candidate.fit.placed.last() else { return false };
    if !newest.effect.about().depends_on.iter().all(|v| OF_TIME.contains(v)) || context.time_is_row {
        return false;
    }
    let touched = |speeds: bool| -> Vec<&str> {
        let relations =
            if speeds { [Relation::SpeedFromPulse; 3] } else { [Relation::Thrust, Relation::Torque, Relation::Current] };
        let of_kind = |name: &&str| context.target(name).is_some_and(|k| relations.contains(&context.targets[k].relation));
        newest.instance.channels.iter().map(String::as_str).filter(of_kind).collect()
    };
    let mut placed = best.placed.clone();
    for (speeds, load) in [(true, "pulse_us"), (false, "rpm")] {
        let channels = touched(speeds);
        if channels.is_empty() {
            continue;
        }
        let effect = &unknown::Unknown;
        let instance = Instance::new(&channels, &unknown::form(load, ORDER));
        let Some(shape) = unknown::whole(context, load) else { return false };
        placed.push(Placed { effect, instance, shape });
    }
    if placed.len() == best.placed.len() {
        return false;
    }
    let Some(bent) = fit(context, declared, &placed, Some(best), Rows::All) else { return false };
    let shares = shares(context, [&bent, &candidate.fit].into_iter());
    net_gain(context, &bent, best, &shares) > net_gain(context, &candidate.fit, best, &shares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::by_id;
    use crate::log::{Column, Log};

    /// A staircase of twelve levels that only climbs; what the thrust holds beyond its square law, of speed (rev/min) and time (s).
    fn drift_against_bend(added: impl Fn(f64, f64) -> f64) -> bool {
        let t: Vec<f64> = (0..1200).map(|i| 0.1 * f64::from(i)).collect();
        let pulse: Vec<f64> = (0..1200).map(|i| 1150.0 + 60.0 * f64::from(i / 100)).collect();
        let wave = |i: usize, k: f64| (k * (i * i) as f64).sin();
        let rpm: Vec<f64> = pulse.iter().enumerate().map(|(i, p)| 7.0 * (p - 1000.0) + 2.0 * wave(i, 0.7)).collect();
        let of_row = |i: usize| 1.5e-7 * rpm[i] * rpm[i] + added(rpm[i], t[i]) + 0.01 * wave(i, 1.3);
        let thrust = (0..1200).map(of_row).collect();
        let columns = [("pulse_us", pulse.clone()), ("rpm", rpm.clone()), ("thrust_n", thrust)];
        let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
        let context = Context::new(&Log { t: t.clone(), columns, ..Log::default() }, None);
        let declared = Declared::default();
        let start = fit(&context, declared, &[], None, Rows::All).expect("a fit");
        let effect = by_id("zero_drift").expect("in the library");
        let placed = [Placed { effect, instance: Instance::new(&["thrust_n"], ""), shape: Vec::new() }];
        let fitted = fit(&context, declared, &placed, Some(&start), Rows::All).expect("a fit");
        explains_better(&context, declared, &start, &Candidate { fit: fitted, evidence: 0.0 })
    }

    #[test]
    fn what_follows_time_gives_way_to_a_curve_that_explains_it_and_stands_against_one_that_does_not() {
        assert!(drift_against_bend(|rpm, _| 0.05 * (6.0 * rpm / 5600.0).sin()));
        assert!(!drift_against_bend(|_, t| 2e-3 * t));
    }
}
