//! `blade_flex`: blades untwist and bend under load at high speed.
//!
//! What it is: above an onset speed thrust falls short of its square law by the factor (onset / rpm)^exponent, torque likewise
//! with `torque_ratio` times the exponent.
//! What can go wrong: an onset below the slowest speed of the run is a changed exponent (`reynolds_thrust`), not a bend.
//! Units: rev/min, 1; internally A/krpm3 for the lighter load.
//! Reference: aeroelastic washout of light propellers, Brandt & Selig 2011 (AIAA 2011-1255), static data at high speed.

use crate::channel::{Context, Relation};
use crate::effects::design::TargetDesign;
use crate::effects::tachometer::speed_channel::expected;
use crate::effects::{
    About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, geometric, present, speeds,
};

/// See the module.
pub(crate) struct BladeFlex;

impl Effect for BladeFlex {
    fn id(&self) -> &'static str {
        "blade_flex"
    }

    fn about(&self) -> About {
        About {
            title: "Blades flex at high speed",
            equation: "thrust_n *= (onset / rpm)^exponent and torque_nm *= (onset / rpm)^(torque_ratio exponent) above onset; smooth: thrust_n *= 1 - (1 - 2^-exponent) (rpm / onset - 1)^2",
            source: "Brandt & Selig 2011, AIAA 2011-1255",
            depends_on: &["rpm"],
            signature: "thrust and torque fall short of the square law above one speed, whenever that speed is visited",
            look_alikes: &["stall", "reynolds_thrust", "amplifier_saturation"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new("the blades", found.tell("onset", |v| format!("bend above {v}"), "bend at high speed"))
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Gain
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let mut out = with_and_without_load(context);
        let smooth: Vec<Instance> = out.iter().map(|i| Instance { form: SMOOTH.into(), ..i.clone() }).collect();
        out.extend(smooth);
        out
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        let mut out = vec![
            upper_speeds(context, 10),
            Shape { name: "exponent", unit: "1", range: (0.0, 3.0), starts: vec![0.03, 0.1, 0.4] },
        ];
        if instance.touches("torque_nm") {
            out.push(Shape { name: "torque_ratio", unit: "1", range: (-0.5, 3.0), starts: vec![0.7] });
        }
        out
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "current_loss", unit: "A/krpm3" }, Amplitude { name: "speed_gain", unit: "1" }]
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let [onset, exponent, rest @ ..] = shape else { return };
        let ratio = rest.first().copied().unwrap_or(1.0);
        let smooth = instance.form == SMOOTH;
        let exponent = if design.relation == Relation::Torque { exponent * ratio } else { *exponent };
        // the same loss at twice the onset as that of the power, without its corner
        let loss = 1.0 - 0.5_f64.powf(exponent);
        let factor = |speed: f64| match speed / onset {
            over if over <= 1.0 => 1.0,
            over if smooth => 1.0 - loss * (over - 1.0).powi(2),
            over => over.powf(-exponent),
        };
        match design.relation {
            Relation::Thrust | Relation::Torque => {
                let factor: Vec<f64> = context.rpm.iter().map(|r| factor(*r)).collect();
                design.scale(&factor);
            }
            // a lighter load: less current, more speed
            Relation::Current => {
                let column = context.rpm.iter().map(|r| (r / 1000.0).powi(3) * (factor(*r) - 1.0)).collect();
                design.add(position, 0, column);
            }
            _ => design.add(position, 1, expected(context).iter().map(|r| r * (1.0 - factor(*r))).collect()),
        }
    }

    fn judges_shape_errors(&self) -> bool {
        true
    }

    fn report(&self, _: &Context, _: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        for onset in fitted.iter_mut().filter(|e| e.name == "onset") {
            onset.se = onset.se.hypot(FORM * onset.value);
        }
        fitted
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        // both fall short: a torque that grows where thrust falls is a stall. A noisy torque meter leaves that to the lighter load,
        // which draws less and turns faster
        let beyond = |name: &str, errors: f64| fitted.iter().find(|e| e.name == name).map(|e| e.value > errors * e.se);
        let lighter = ["current_loss", "speed_gain"].iter().all(|name| beyond(name, 3.0) == Some(true));
        let ratio = beyond("torque_ratio", if lighter { 0.0 } else { 2.0 }).unwrap_or(true);
        // a lighter load draws no more, and at the same torque turns faster by half of what the torque falls short by, at the most
        let of = |name: &str| fitted.iter().find(|e| e.name == name);
        let most = of("torque_ratio").map_or(1.0, |e| e.value + 2.0 * e.se) / 2.0;
        let draws_more = of("current_loss").is_some_and(|e| e.value < -2.0 * e.se);
        let runs_away = of("speed_gain").is_some_and(|e| e.value - 2.0 * e.se > most);
        ratio && !draws_more && !runs_away && fitted.iter().any(|e| e.name == "exponent" && e.value > 3.0 * e.se)
    }
}

/// Standard error of the onset, as a share of it, that stands for the form. Losses that go with the excess of the speed to a power of 1.2 to 2.5, on
/// runs to 1.3 and 1.6 times the onset: the form that fits better has it within a tenth in eight of ten.
const FORM: f64 = 0.1;

/// Form that sets in without a corner.
const SMOOTH: &str = "smooth";

/// A speed above which something sets in: from a fifth of the top speed up, where rows above it are left to show it.
pub(crate) fn upper_speeds(context: &Context, count: usize) -> Shape {
    let top = context.rpm.iter().copied().fold(1.0, f64::max);
    Shape { name: "onset", unit: "rpm", range: (0.1 * top, 0.98 * top), starts: geometric(0.3 * top, 0.94 * top, count) }
}

/// Instances of an effect on the load: thrust and torque with current and speed, which follow the torque, and without them.
pub(crate) fn with_and_without_load(context: &Context) -> Vec<Instance> {
    let blades = present(context, &["thrust_n", "torque_nm"]);
    if blades.first() != Some(&"thrust_n") {
        return Vec::new();
    }
    let mut all = present(context, &["thrust_n", "torque_nm", "current_a"]);
    all.extend(speeds(context));
    let mut out = vec![Instance::new(&blades, "")];
    if blades.len() == 2 && all.len() > 2 {
        out.push(Instance::new(&all, ""));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Log;

    #[test]
    fn a_lighter_load_speaks_for_a_torque_that_is_too_noisy_to_tell() {
        let context = Context::bare(&Log { t: vec![0.0, 1.0], ..Log::default() }, Some(1000.0));
        let judged = |ratio: (f64, f64), loss: f64, gain: f64| {
            let of = |name: &str, value: f64, se: f64| Estimate { name: name.into(), unit: "1".into(), value, se };
            let load = [("current_loss", loss), ("speed_gain", gain)].map(|(name, value)| of(name, value, 0.01));
            let fitted: Vec<Estimate> =
                [of("exponent", 0.2, 0.03), of("torque_ratio", ratio.0, ratio.1)].into_iter().chain(load).collect();
            BladeFlex.plausible(&context, &Instance::new(&["thrust_n"], ""), &fitted)
        };
        assert!(judged((0.3, 0.05), 0.0, 0.0), "the torque alone tells");
        assert!(judged((0.3, 0.2), 0.05, 0.05), "the load tells");
        assert!(!judged((0.3, 0.2), 0.05, 0.02) && !judged((0.3, 0.2), -0.05, 0.05), "neither does");
        assert!(!judged((-0.3, 0.2), 0.05, 0.05), "a torque that grows where thrust falls is a stall");
        assert!(!judged((0.3, 0.05), -0.05, 0.05), "a lighter load draws no more current");
        assert!(!judged((0.3, 0.05), 0.05, 0.3), "nor does it turn faster by all that its torque falls short by");
    }
}
