//! `reynolds_thrust`: the thrust coefficient depends on the Reynolds number.
//!
//! What it is: the declared quadratic times (rpm / 1000)^exponent, its zero aside: C_T ~ Re^exponent, Re ~ rpm.
//! What can go wrong: over a narrow range of speeds the polynomial bends as well; the standard error then says so.
//! Units: 1.
//! Reference: Deters, Ananda & Selig 2014 (AIAA 2014-2151), Reynolds number effects on small propellers.

use crate::channel::Context;
use crate::effects::design::{Label, TargetDesign};
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, present};
use crate::verdict::Parameter;
use crate::verdict::words::sized;
use std::sync::Arc;

/// See the module.
pub(crate) struct ReynoldsThrust;

impl Effect for ReynoldsThrust {
    fn id(&self) -> &'static str {
        "reynolds_thrust"
    }

    fn about(&self) -> About {
        About {
            title: "Thrust coefficient depends on the Reynolds number",
            equation: "thrust_n = zero + (k1 rpm + k2 rpm^2) (rpm / 1000)^exponent",
            source: "Deters, Ananda & Selig 2014, AIAA 2014-2151",
            depends_on: &["rpm"],
            signature: "thrust(rpm) follows a power other than two from standstill to full speed; torque(rpm) holds",
            look_alikes: &["blade_flex", "torque_crosstalk"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let exponent = found.parameter("exponent");
        let size = exponent.map(|p| Parameter { value: p.value.abs(), ci95: p.ci95.map(f64::abs), ..p.clone() });
        let does = match (exponent, size.as_ref().and_then(sized)) {
            (Some(p), Some(v)) => {
                let how = if p.value > 0.0 { "faster" } else { "slower" };
                format!("grows {how} with the speed than declared, by the speed to the power of {v}")
            }
            _ => "follows another power of the speed, as small propellers do".to_owned(),
        };
        Clause::new("the thrust", does)
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Input
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        if present(context, &["thrust_n"]).is_empty() { Vec::new() } else { vec![Instance::new(&["thrust_n"], "")] }
    }

    fn shapes(&self, _: &Context, _: &Instance) -> Vec<Shape> {
        vec![Shape {
            name: "exponent",
            unit: "1",
            range: (-1.2, 1.5),
            starts: vec![-0.7, -0.4, -0.2, -0.1, -0.05, -0.02, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0],
        }]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        Vec::new()
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], _: usize, design: &mut TargetDesign) {
        let [exponent] = shape else { return };
        let factor: Vec<f64> = context
            .rpm
            .iter()
            .map(|r| (r.max(0.0) / 1000.0).powf(*exponent))
            .map(|f| if f.is_finite() { f } else { 0.0 })
            .collect();
        for column in &mut design.columns {
            if let Label::Base(1 | 2) = column.label {
                Arc::make_mut(&mut column.values).iter_mut().zip(&factor).for_each(|(v, f)| *v *= f);
            }
        }
        design.fixed.iter_mut().zip(&factor).for_each(|(v, f)| *v *= f);
    }

    fn judges_shape_errors(&self) -> bool {
        true
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        fitted.iter().all(|e| e.value.abs() > 3.0 * e.se)
    }
}
