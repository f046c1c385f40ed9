//! `blade_damage`: a blade loses a piece, or picks something up, during the run.
//!
//! What it is: from t0 on thrust and torque at a speed change by constant factors; current and speed follow the load.
//! What can go wrong: without torque, current or speed to break with it, it looks like a load cell whose gain changed.
//! Units: 1, s; internally N/krpm2, N.m/krpm2, A/krpm3, A/krpm4, rev/min/kus, rev/min/kus2.
//! Reference: thrust and torque coefficients, Beharie 2013, Eq. 2.17-2.18; step at an unknown instant, Basseville & Nikiforov 1993.

use crate::channel::{Context, Relation};
use crate::effects::design::TargetDesign;
use crate::effects::{
    About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, load_channels, throttle,
};

/// See the module.
pub(crate) struct BladeDamage;

impl Effect for BladeDamage {
    fn id(&self) -> &'static str {
        "blade_damage"
    }

    fn about(&self) -> About {
        About {
            title: "Blade damage: thrust and torque coefficients step",
            equation: "thrust_n += thrust_step rpm^2, torque_nm += torque_step rpm^2, current and rpm(pulse) with the load, for t >= t0",
            source: "Beharie 2013, Eq. 2.17-2.18; Basseville & Nikiforov 1993, section 2.2",
            depends_on: &["t_s", "rpm"],
            signature: "thrust, torque, current and speed all change at one instant, in proportion to the load",
            look_alikes: &["gain_change", "bearing_friction", "air_density"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        let since = found.tell("t0", |t| format!(" from {t} on"), "");
        let with = |word: &str, v: &str| format!("{word} {v} of the thrust{since}");
        let without = format!("changes the thrust{since}");
        Clause::new("a damaged blade", found.tell_signed("thrust_change", (100.0, "%"), ["adds", "takes"], with, &without))
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Event
    }

    fn leaves_behind(&self, _: &Instance) -> bool {
        true
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let channels = load_channels(context, true);
        if context.time_is_row || channels.first() != Some(&"thrust_n") || channels.len() < 2 {
            return Vec::new();
        }
        vec![Instance::new(&channels, "")]
    }

    fn shapes(&self, context: &Context, _: &Instance) -> Vec<Shape> {
        vec![crate::effects::load_cell::tare_shift::onset_or_before(context)]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![
            Amplitude { name: "thrust_step", unit: "N/krpm2" },
            Amplitude { name: "torque_step", unit: "N.m/krpm2" },
            Amplitude { name: "current_step", unit: "A/krpm3" },
            Amplitude { name: "current_loss", unit: "A/krpm4" },
            Amplitude { name: "speed_step", unit: "rev/min/kus" },
            Amplitude { name: "speed_bend", unit: "rev/min/kus2" },
        ]
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let [t0] = shape else { return };
        let after = crate::effects::load_cell::tare_shift::step(context, *t0);
        let power = |n: i32| -> Vec<f64> { after.iter().zip(&context.rpm).map(|(s, r)| s * (r / 1000.0).powi(n)).collect() };
        match design.relation {
            Relation::Thrust => design.add(position, 0, power(2)),
            Relation::Torque => design.add(position, 1, power(2)),
            Relation::Current => {
                design.add(position, 2, power(3));
                design.add(position, 3, power(4));
            }
            Relation::SpeedFromPulse => {
                let u = throttle(context);
                design.add(position, 4, after.iter().zip(&u).map(|(s, u)| s * u).collect());
                design.add(position, 5, after.iter().zip(&u).map(|(s, u)| s * u * u).collect());
            }
            _ => {}
        }
    }

    fn report(&self, context: &Context, _: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        let Some(t0) = fitted.iter().find(|e| e.name == "t0").map(|e| e.value) else { return fitted };
        let square: Vec<f64> = crate::effects::load_cell::tare_shift::step(context, t0)
            .iter()
            .zip(&context.rpm)
            .map(|(s, r)| s * (r / 1000.0).powi(2))
            .collect();
        for (name, channel, relative) in
            [("torque_step", "torque_nm", "torque_change"), ("thrust_step", "thrust_n", "thrust_change")]
        {
            if let Some(e) = fitted.iter().find(|e| e.name == name).and_then(|e| relative_to_rest(context, channel, &square, e)) {
                fitted.insert(0, Estimate { name: relative.into(), ..e });
            }
        }
        fitted
    }

    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        // damage is a change of the thrust coefficient first of all, and a load that grows slows the rotor down
        let sure = |name: &str| fitted.iter().find(|e| e.name == name).is_none_or(|e| e.value.abs() > 3.0 * e.se);
        let reported = self.report(context, instance, fitted.to_vec());
        let of_a_blade = |e: &Estimate| !e.name.ends_with("_change") || e.value.abs() < MOST;
        sure("thrust_step") && (!instance.touches("torque_nm") || sure("torque_step")) && reported.iter().all(of_a_blade)
    }
}

/// Largest relative change of a coefficient that still is that of a damaged blade: with less than a fifth left, or nearly twice as much, it is
/// another propeller.
const MOST: f64 = 0.8;

/// The share by which a term `amplitude * column` changes what a channel would read without it, over the rows where the
/// column is not zero; the reading at standstill is no part of either.
pub(crate) fn relative_to_rest(context: &Context, channel: &str, column: &[f64], amplitude: &Estimate) -> Option<Estimate> {
    let target = &context.targets[context.target(channel)?];
    let (mut zero, mut rows, mut reading, mut term) = (0.0, 0.0, 0.0, 0.0);
    for (i, y) in target.rows.iter().zip(&target.y) {
        if context.rpm.get(*i).is_some_and(|r| *r < STANDSTILL) {
            zero += y;
            rows += 1.0;
        }
    }
    let zero = if rows > 0.0 { zero / rows } else { 0.0 };
    for (i, y) in target.rows.iter().zip(&target.y).filter(|(i, _)| column[**i] != 0.0) {
        reading += y - zero;
        term += column[*i];
    }
    let rest = reading - amplitude.value * term;
    let scale = term / rest;
    scale.is_finite().then(|| Estimate {
        name: amplitude.name.clone(),
        unit: "1".into(),
        value: amplitude.value * scale,
        se: (amplitude.se * scale * (1.0 + amplitude.value * scale)).abs(),
    })
}

pub(crate) use crate::channel::STANDSTILL;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Column, Log};

    #[test]
    fn a_blade_that_changes_by_more_than_a_blade_can_is_none() {
        let t: Vec<f64> = (0..400).map(|i| 0.1 * f64::from(i)).collect();
        let rpm: Vec<f64> = (0..400).map(|i| 2000.0 + 1000.0 * f64::from(i / 50 % 4)).collect();
        let thrust = |share: f64| -> Vec<f64> {
            let of_row = |(r, t): (&f64, &f64)| 1.5e-7 * r * r * if *t < 20.0 { 1.0 } else { 1.0 + share };
            rpm.iter().zip(&t).map(of_row).collect()
        };
        for (share, stands) in [(-0.1, true), (0.05, true), (-0.95, false), (8.0, false)] {
            let columns = [("rpm", rpm.clone()), ("thrust_n", thrust(share))];
            let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
            let context = Context::new(&Log { t: t.clone(), columns, ..Log::default() }, None);
            let estimate = |name: &str, value: f64| Estimate { name: name.into(), unit: "1".into(), value, se: 1e-6 };
            let fitted = [estimate("t0", 20.0), estimate("thrust_step", 0.15 * share)];
            assert_eq!(BladeDamage.plausible(&context, &Instance::new(&["thrust_n"], ""), &fitted), stands, "{share}");
        }
    }
}
