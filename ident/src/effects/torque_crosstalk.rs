//! `torque_crosstalk`: the thrust cell reads part of the torque.
//!
//! What it is: thrust_n += coefficient * torque_nm: beam and arm are not quite at right angles.
//! What can go wrong: torque is itself nearly quadratic in the speed, and the thrust polynomial takes that part: only torque's
//! departures from it (spin-up, damage, friction on the arm) show, so that the standard error is large on a quiet run.
//! Units: N/(N.m).
//! Reference: cross-axis sensitivity of multi-component balances, Barlow, Rae & Pope 1999, *Low-Speed Wind Tunnel Testing*, ch. 7.

use super::{About, Amplitude, Effect, Estimate, Instance, Shape, Stage, present};
use crate::context::Context;
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct TorqueCrosstalk;

impl Effect for TorqueCrosstalk {
    fn id(&self) -> &'static str {
        "torque_crosstalk"
    }

    fn about(&self) -> About {
        About {
            title: "The thrust cell reads part of the torque",
            equation: "thrust_n += coefficient * torque_nm",
            source: "Barlow, Rae & Pope 1999, Low-Speed Wind Tunnel Testing, chapter 7",
            depends_on: &["torque_nm"],
            signature: "the thrust residual repeats what torque does beyond its own polynomial",
            look_alikes: &["blade_damage", "channel_filter", "reynolds_thrust"],
        }
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        if present(context, &["thrust_n", "torque_nm"]).len() == 2 { vec![Instance::new(&["thrust_n"], "")] } else { Vec::new() }
    }

    fn shapes(&self, _: &Context, _: &Instance) -> Vec<Shape> {
        Vec::new()
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "coefficient", unit: "N/(N.m)" }]
    }

    fn apply(&self, context: &Context, _: &Instance, _: &[f64], position: usize, design: &mut TargetDesign) {
        let Some(torque) = &context.torque else { return };
        design.add(position, 0, torque.clone());
    }

    fn plausible(&self, context: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        // a badly aligned cell reads some of the torque: a third of the thrust itself is something else (a wake that shakes both)
        let top =
            |name: &str| context.target(name).map_or(0.0, |k| context.targets[k].y.iter().fold(0.0, |a: f64, v| a.max(v.abs())));
        let most = 0.3 * top("thrust_n") / top("torque_nm").max(1e-9);
        fitted.iter().all(|e| e.value.abs() > 4.0 * e.se && e.value.abs() < most)
    }
}
