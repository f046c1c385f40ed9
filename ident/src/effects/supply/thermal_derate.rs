//! `thermal_derate`: speed controller or winding heats up and the rotor slows down.
//!
//! What it is: heat follows current_a^2 by a first-order lag of `tau`; speed at a pulse falls by `derate` times the heat.
//! What can go wrong: a battery that empties looks alike while the load only rises; heat comes back down, charge does not.
//! Units: s, 1/A2.
//! Reference: first-order thermal model of a winding, tau = R_th C_th; Hanselman 2006, *Brushless Permanent Magnet Motor Design*.

use crate::channel::{Context, Relation};
use crate::effects::design::TargetDesign;
use crate::effects::tachometer::speed_channel::expected;
use crate::effects::{
    About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, geometric, is_too_quick, present,
    speeds,
};

/// See the module.
pub(crate) struct ThermalDerate;

/// Form in which the winding's resistance rises: the loss of speed is that of the drop over it, which grows with the torque.
const WINDING: &str = "winding";

/// Twice the drop over the winding as a share of the supply at full speed: about a quarter on motors of this size.
const DROP: f64 = 0.5;

/// Standard error of `tau`, as a share of it, that stands for the form: neither a loss of speed in proportion to the heat nor one
/// with the drop of [`DROP`] is the rotor's own, and the way back of a heat that was bent looks slower or quicker. On tuning runs
/// of the blind campaign the error is a tenth.
const FORM: f64 = 0.1;

impl Effect for ThermalDerate {
    fn id(&self) -> &'static str {
        "thermal_derate"
    }

    fn about(&self) -> About {
        About {
            title: "Speed falls as controller or winding heats up",
            equation: "rpm(pulse) *= 1 - derate heat (controller), or 1 - derate heat (rpm/top) / (1 + rpm/top / 2) with current_a += current_rise heat rpm^4 (winding); tau d(heat)/dt = current_a^2 - heat",
            source: "first-order thermal model, Hanselman 2006",
            depends_on: &["heat"],
            signature: "after a step to high current the speed sags slowly, and recovers while the current is low; thrust(rpm) holds",
            look_alikes: &["battery_discharge", "bearing_friction", "spinup_lag"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the motor",
            found.tell("tau", |v| format!("slows down as it heats up, within {v}"), "slows down as it heats up"),
        )
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let channels = speeds(context);
        if context.time_is_row || channels.is_empty() || context.pulse.is_none() {
            return Vec::new();
        }
        // a warm winding costs current too
        let with_current: Vec<&str> = channels.iter().copied().chain(present(context, &["current_a"])).collect();
        vec![Instance::new(&channels, "controller"), Instance::new(&with_current, WINDING)]
    }

    fn shapes(&self, context: &Context, _: &Instance) -> Vec<Shape> {
        let (lo, hi) = ((20.0 * context.step()).max(2.0), (2.0 * context.duration()).max(10.0));
        vec![Shape { name: "tau", unit: "s", range: (0.5 * lo, 1.5 * hi), starts: geometric(lo, hi, 10) }]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "derate", unit: "1/A2" }, Amplitude { name: "current_rise", unit: "1/A.krpm4" }]
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let [tau] = shape else { return };
        let heat = heat(context, *tau);
        if design.relation == Relation::Current {
            // the drop over the winding grows by heat times the motor's current, and is paid by the supply once more
            let column = heat.iter().zip(&context.rpm).map(|(h, r)| h * (r / 1000.0).powi(4)).collect();
            design.add(position, 1, column);
            return;
        }
        let expected = expected(context);
        let top = expected.iter().copied().fold(1.0, f64::max);
        let winding = instance.form == WINDING;
        let column = expected
            .iter()
            .zip(&heat)
            .map(|(speed, heat)| {
                let share = speed / top;
                -heat * speed * if winding { share / (1.0 + DROP * share) } else { 1.0 }
            })
            .collect();
        design.add(position, 0, column);
    }

    fn report(&self, _: &Context, _: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        for tau in fitted.iter_mut().filter(|e| e.name == "tau") {
            tau.se = tau.se.hypot(FORM * tau.value);
        }
        fitted
    }

    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        if is_too_quick(&self.shapes(context, instance), fitted) {
            return false;
        }
        let top = load(context).iter().copied().fold(0.0, f64::max);
        let costs = fitted.iter().filter(|e| e.name == "current_rise").all(|e| e.value > -3.0 * e.se);
        costs && fitted.iter().any(|e| e.name == "derate" && e.value > 3.0 * e.se && e.value * top * top < 0.8)
    }
}

/// Supply current, A; where it was not measured, the cube of the speed as a share of the top speed, so that the size of the
/// effect is that at full load.
fn load(context: &Context) -> Vec<f64> {
    if let Some(current) = &context.current {
        return current.clone();
    }
    let expected = expected(context);
    let top = expected.iter().copied().fold(1.0, f64::max);
    expected.iter().map(|n| (n / top).powi(3)).collect()
}

/// Heat: the square of the current through a first-order lag, from cold.
fn heat(context: &Context, tau: f64) -> Vec<f64> {
    let load = load(context);
    let mut heat = 0.0;
    (0..context.len())
        .map(|i| {
            if i > 0 {
                let e = (-(context.t[i] - context.t[i - 1]) / tau).exp();
                heat = e * heat + (1.0 - e) * load[i - 1] * load[i - 1];
            }
            heat
        })
        .collect()
}
