//! `air_density`: thrust and torque scale with the density of the air.
//!
//! What it is: factor (density / 1.2041 kg/m3)^exponent, density from temp_c and, where it is logged, pressure_hpa or pressure_pa;
//! current and speed follow the torque with sizes of their own.
//! What can go wrong: a motor that warms a thermometer nearby is not warm air; torque tells it from a thermal zero.
//! Units: 1; internally A/krpm3 and 1 for current and speed.
//! Reference: ideal gas, ISO 2533 (287.05 J/(kg.K)); thrust and torque proportional to density, Beharie 2013, Eq. 2.17-2.18.

use super::speed_channel::expected;
use super::{About, Amplitude, Effect, Estimate, Instance, Shape, Stage};
use crate::context::{Context, Relation};
use crate::design::TargetDesign;

/// See the module.
pub(crate) struct AirDensity;

/// Least spread of the logarithm of density that can tell anything: half a kelvin, or 2 hPa.
const LEAST_SPREAD: f64 = 0.0018;

impl Effect for AirDensity {
    fn id(&self) -> &'static str {
        "air_density"
    }

    fn about(&self) -> About {
        About {
            title: "Density of the air changes",
            equation: "thrust_n, torque_nm *= (density / 1.2041)^exponent, density = p / (287.05 T)",
            source: "ISO 2533; Beharie 2013, Eq. 2.17-2.18",
            depends_on: &["temp_c", "pressure_hpa"],
            signature: "thrust and torque at a speed fall together as the air gets warmer or thinner",
            look_alikes: &["thermal_zero", "blade_damage", "gain_change"],
        }
    }

    fn stage(&self) -> Stage {
        Stage::Gain
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let density = context.facts.density.get_or_init(|| log_density(context));
        let (lo, hi) = density.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        if hi - lo < LEAST_SPREAD { Vec::new() } else { super::blade_flex::with_and_without_load(context) }
    }

    fn shapes(&self, _: &Context, _: &Instance) -> Vec<Shape> {
        vec![Shape { name: "exponent", unit: "1", range: (0.1, 3.0), starts: vec![0.3, 0.6, 1.0, 1.5] }]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "current_gain", unit: "A/krpm3" }, Amplitude { name: "speed_loss", unit: "1" }]
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let [exponent] = shape else { return };
        let density = context.facts.density.get_or_init(|| log_density(context));
        match design.relation {
            Relation::Thrust | Relation::Torque => {
                let factor: Vec<f64> = density.iter().map(|d| (exponent * d).exp()).collect();
                design.scale(&factor);
            }
            Relation::Current => {
                design.add(
                    position,
                    0,
                    density.iter().zip(&context.rpm).map(|(d, r)| exponent * d * (r / 1000.0).powi(3)).collect(),
                );
            }
            _ => design.add(position, 1, density.iter().zip(expected(context)).map(|(d, r)| -exponent * d * r).collect()),
        }
    }

    fn judges_shape_errors(&self) -> bool {
        true
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        fitted.iter().any(|e| e.name == "exponent" && e.value > 3.0 * e.se)
    }
}

/// Logarithm of the density over that of ISO 2533 air at 20 degC, on every row; zero where nothing says what it is.
fn log_density(context: &Context) -> Vec<f64> {
    let pressure = ["pressure_hpa", "pressure_pa"].iter().zip([1013.25, 101_325.0]).find_map(|(name, standard)| {
        let column = &context.covariates.iter().find(|c| c.0 == *name)?.1;
        Some(column.iter().map(|p| (p / standard).max(0.1)).collect::<Vec<f64>>())
    });
    let temperature = super::thermal_zero::warmth(context);
    let pressure = pressure.map(|p| super::thermal_zero::smoothed(&p));
    (0..context.len())
        .map(|i| {
            let p = pressure.as_ref().map_or(0.0, |p| p[i].ln());
            p - temperature.map_or(0.0, |t| ((t[i] + 273.15) / 293.15).max(0.1).ln())
        })
        .collect()
}
