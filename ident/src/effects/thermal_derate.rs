//! `thermal_derate`: speed controller or winding heats up and the rotor slows down.
//!
//! What it is: heat follows current_a^2 by a first-order lag of `tau`; speed at a pulse falls by `derate` times the heat.
//! What can go wrong: a battery that empties looks alike while the load only rises; heat comes back down, charge does not.
//! Units: s, 1/A2.
//! Reference: first-order thermal model of a winding, tau = R_th C_th; Hanselman 2006, *Brushless Permanent Magnet Motor Design*.

use super::speed_channel::expected;
use super::{About, Amplitude, Effect, Estimate, Instance, Shape, Stage, geometric, speeds};
use crate::context::Context;
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct ThermalDerate;

/// Form in which the winding's resistance rises: the loss of speed is that of the drop over it, which grows with the torque.
const WINDING: &str = "winding";

/// Twice the drop over the winding as a share of the supply at full speed: about a quarter on motors of this size.
const DROP: f64 = 0.5;

impl Effect for ThermalDerate {
    fn id(&self) -> &'static str {
        "thermal_derate"
    }

    fn about(&self) -> About {
        About {
            title: "Speed falls as controller or winding heats up",
            equation: "rpm(pulse) *= 1 - derate heat (controller), or 1 - derate heat rpm/top (winding); tau d(heat)/dt = current_a^2 - heat",
            source: "first-order thermal model, Hanselman 2006",
            depends_on: &["heat"],
            signature: "after a step to high current the speed sags slowly, and recovers while the current is low; thrust(rpm) holds",
            look_alikes: &["battery_discharge", "bearing_friction", "spinup_lag"],
        }
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let channels = speeds(context);
        if context.time_is_row || channels.is_empty() || context.current.is_none() {
            Vec::new()
        } else {
            vec![Instance::new(&channels, "controller"), Instance::new(&channels, WINDING)]
        }
    }

    fn shapes(&self, context: &Context, _: &Instance) -> Vec<Shape> {
        let (lo, hi) = ((20.0 * context.step()).max(2.0), (2.0 * context.duration()).max(10.0));
        vec![Shape { name: "tau", unit: "s", range: (0.5 * lo, 1.5 * hi), starts: geometric(lo, hi, 10) }]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "derate", unit: "1/A2" }]
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let ([tau], Some(current)) = (shape, &context.current) else { return };
        let mut heat = 0.0;
        let expected = expected(context);
        let top = expected.iter().copied().fold(1.0, f64::max);
        let winding = instance.form == WINDING;
        let column = expected
            .iter()
            .enumerate()
            .map(|(i, speed)| {
                if i > 0 {
                    let e = (-(context.t[i] - context.t[i - 1]) / tau).exp();
                    heat = e * heat + (1.0 - e) * current[i - 1] * current[i - 1];
                }
                let share = speed / top;
                -heat * speed * if winding { share / (1.0 + DROP * share) } else { 1.0 }
            })
            .collect();
        design.add(position, 0, column);
    }

    fn plausible(&self, context: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        let top = context.current.as_ref().map_or(0.0, |c| c.iter().copied().fold(0.0, f64::max));
        fitted.iter().any(|e| e.name == "derate" && e.value > 3.0 * e.se && e.value * top * top < 0.8)
    }
}
