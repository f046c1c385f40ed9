//! `alternating_period`: two magnets that do not stand opposite each other.
//!
//! What it is: a sensor that times one of two unequal periods reads rpm (1 +- angle/180) by turns.
//! What can go wrong: which of the two it caught is known from the reading alone, so only readings with two clear values are
//! taken for it; a sensor that times whole turns shows nothing, and its board must tell ([`crate::close::marks`]).
//! Units: deg, deviation from 180.
//! Reference: Beharie 2013, section 5.7.1 (Hall sensor with two magnets).

use crate::channel::{Context, Relation};
use crate::effects::design::TargetDesign;
use crate::effects::tachometer::pulses::{HELD, against_the_others, held};
use crate::effects::tachometer::speed_channel::{difference, instances};
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage};

/// See the module.
pub(crate) struct AlternatingPeriod;

/// What is estimated.
pub(crate) const ANGLE: Amplitude = Amplitude { name: "angle", unit: "deg" };

/// Kurtosis of the difference below which it has two values: 1 for two points, 1.8 for a uniform, 3 for a normal distribution.
const TWO_VALUED: f64 = 1.7;

/// Smallest angle worth a name, deg: magnets are not glued on better. Two values tell it from sensors that merely disagree.
const LEAST: f64 = 0.1;

impl Effect for AlternatingPeriod {
    fn id(&self) -> &'static str {
        "alternating_period"
    }

    fn about(&self) -> About {
        About {
            title: "Unequal magnets: the period alternates",
            equation: "rpm_x = rpm (1 + angle/180) or rpm (1 - angle/180), by turns",
            source: "Beharie 2013, section 5.7.1",
            depends_on: &["rpm"],
            signature: "one speed channel jumps between two values about the others, in proportion to the speed",
            look_alikes: &["missed_pulses", "double_pulses"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the magnets",
            found.tell(
                "angle",
                |v| format!("sit {v} off, so that the period of {} alternates", found.meter()),
                &format!("sit unequally, so that the period of {} alternates", found.meter()),
            ),
        )
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn shows_beside_others_alone(&self) -> bool {
        true
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        instances(context, "")
            .into_iter()
            .filter(|i| {
                difference(context, i).is_some_and(|t| kurtosis(&usual(held(context, t).map(|s| s.1).collect())) < TWO_VALUED)
            })
            .collect()
    }

    fn shapes(&self, _: &Context, _: &Instance) -> Vec<Shape> {
        Vec::new()
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![ANGLE]
    }

    fn apply(&self, context: &Context, instance: &Instance, _: &[f64], position: usize, design: &mut TargetDesign) {
        let (Relation::SpeedDifference, Some(target)) = (design.relation, difference(context, instance)) else { return };
        let mut column = vec![0.0; context.len()];
        for (i, share) in held(context, target) {
            column[i] = (share - 1.0).signum() * context.rpm[i] / 180.0;
        }
        design.add(position, 0, column);
    }

    fn report(&self, context: &Context, instance: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        if let (Some(target), Some(angle)) = (difference(context, instance), fitted.first_mut()) {
            let departures = against_the_others(context, target, HELD);
            let mean = departures.iter().map(|d| d.0.abs()).sum::<f64>() / departures.len().max(1) as f64;
            angle.value = 180.0 * mean;
        }
        fitted
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        fitted.iter().all(|e| e.value > LEAST && e.value < 60.0)
    }
}

/// Values without those that lie farther beyond nine in ten of them than half as far as these lie apart: a lost mark is none of the two values.
fn usual(mut x: Vec<f64>) -> Vec<f64> {
    x.sort_unstable_by(f64::total_cmp);
    let [Some(low), Some(high)] = [x.get(x.len() / 20), x.get(x.len().saturating_sub(1 + x.len() / 20))].map(|v| v.copied())
    else {
        return x;
    };
    let beyond = 0.5 * (high - low);
    x.retain(|v| (low - beyond..=high + beyond).contains(v));
    x
}

fn kurtosis(x: &[f64]) -> f64 {
    let n = x.len() as f64;
    if n < 30.0 {
        return 3.0;
    }
    let mean = x.iter().sum::<f64>() / n;
    let moment = |k: i32| x.iter().map(|v| (v - mean).powi(k)).sum::<f64>() / n;
    let second = moment(2);
    if second > 0.0 { moment(4) / (second * second) } else { 3.0 }
}
