//! `air_density`: thrust and torque scale with the density of the air.
//!
//! What it is: factor (density / 1.2041 kg/m3)^exponent, density from temp_c and, where it is logged, pressure_hpa or pressure_pa;
//! current and speed follow the torque with sizes of their own.
//! What can go wrong: a motor that warms a thermometer nearby is not warm air; torque tells it from a thermal zero.
//! Units: 1; internally A/krpm3 and 1 for current and speed.
//! Reference: ideal gas, ISO 2533 (287.05 J/(kg.K)); thrust and torque proportional to density, Beharie 2013, Eq. 2.17-2.18.

use crate::channel::{Context, Relation};
use crate::effects::design::TargetDesign;
use crate::effects::tachometer::speed_channel::expected;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage};

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
            equation: "thrust_n, torque_nm *= (density / reference)^exponent, density = p / (287.05 T), reference = 1.2041 kg/m3 or that of the declared model's own run",
            source: "ISO 2533; Beharie 2013, Eq. 2.17-2.18",
            depends_on: &["temp_c", "pressure_hpa"],
            signature: "thrust and torque at a speed fall together as the air gets warmer or thinner",
            look_alikes: &["thermal_zero", "blade_damage", "gain_change"],
        }
    }

    fn said(&self, _: &EffectEntry) -> Clause {
        Clause::new("the air's density", "changes what the propeller delivers")
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Gain
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let density = context.facts.density.get_or_init(|| log_density(context));
        let (lo, hi) = density.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        if hi - lo < LEAST_SPREAD && !(context.against_model && (hi - context.air).max(context.air - lo) > LEAST_SPREAD) {
            return Vec::new();
        }
        let mut out = crate::effects::rotor::blade_flex::with_and_without_load(context);
        if context.against_model {
            out.iter_mut().for_each(|instance| instance.form = BENT.to_owned());
        }
        out
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        let exponent = Shape { name: "exponent", unit: "1", range: (0.1, 3.0), starts: vec![0.3, 0.6, 1.0, 1.5] };
        if instance.form != BENT {
            return vec![exponent];
        }
        // known, not fitted: it stands in the model with the rest, so that a prediction needs no other day's log
        let air = context.air;
        vec![exponent, Shape { name: "reference", unit: "1", range: (air, air), starts: vec![air] }]
    }

    fn amplitudes(&self, instance: &Instance) -> Vec<Amplitude> {
        let mut out = vec![Amplitude { name: "current_gain", unit: "A/krpm3" }, Amplitude { name: "speed_loss", unit: "1" }];
        if instance.form == BENT {
            out.push(Amplitude { name: "current_bend", unit: "A/krpm4" });
            out.push(Amplitude { name: "speed_bend", unit: "1/krpm" });
        }
        out
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let [exponent, reference @ ..] = shape else { return };
        let bent = instance.form == BENT;
        let reference = reference.first().copied().unwrap_or(0.0);
        let density = context.facts.density.get_or_init(|| log_density(context));
        let density: Vec<f64> = density.iter().map(|d| d - reference).collect();
        match design.relation {
            Relation::Thrust | Relation::Torque => {
                let factor: Vec<f64> = density.iter().map(|d| (exponent * d).exp()).collect();
                design.scale(&factor);
            }
            Relation::Current => {
                let power = |n| density.iter().zip(&context.rpm).map(|(d, r)| exponent * d * (r / 1000.0).powi(n)).collect();
                design.add(position, 0, power(3));
                if bent {
                    design.add(position, 2, power(4));
                }
            }
            _ => {
                let expected = expected(context);
                design.add(position, 1, density.iter().zip(expected).map(|(d, r)| -exponent * d * r).collect());
                if bent {
                    design.add(position, 3, density.iter().zip(expected).map(|(d, r)| -exponent * d * r * r / 1000.0).collect());
                }
            }
        }
    }

    fn judges_shape_errors(&self) -> bool {
        true
    }

    fn plausible(&self, _: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        fitted.iter().any(|e| e.name == "exponent" && e.value > 3.0 * e.se)
    }
}

/// Form against a declared model, whose curves do not hold the rest of what denser air does to speed and current.
const BENT: &str = "beside a bend";

/// Mean density of a run's air over that of ISO 2533 air at 20 degC, where its log tells.
pub(crate) fn of_run(context: &Context) -> Option<f64> {
    let density = log_density(context);
    let known = density.iter().any(|d| *d != 0.0);
    known.then(|| (density.iter().sum::<f64>() / density.len() as f64).exp())
}

/// Logarithm of the density over that of ISO 2533 air at 20 degC, on every row; zero where nothing says what it is.
fn log_density(context: &Context) -> Vec<f64> {
    let pressure = ["pressure_hpa", "pressure_pa"].iter().zip([1013.25, 101_325.0]).find_map(|(name, standard)| {
        let column = &context.covariates.iter().find(|c| c.0 == *name)?.1;
        Some(column.iter().map(|p| (p / standard).max(0.1)).collect::<Vec<f64>>())
    });
    let temperature = crate::effects::load_cell::thermal_zero::warmth(context);
    let pressure = pressure.map(|p| crate::effects::load_cell::thermal_zero::smoothed(&p));
    (0..context.len())
        .map(|i| {
            let p = pressure.as_ref().map_or(0.0, |p| p[i].ln());
            p - temperature.map_or(0.0, |t| ((t[i] + 273.15) / 293.15).max(0.1).ln())
        })
        .collect()
}
