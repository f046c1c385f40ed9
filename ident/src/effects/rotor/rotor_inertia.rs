//! `rotor_inertia`: speeding the rotor up costs torque and current.
//!
//! What it is: torque_nm += inertia * domega/dt, current_a += power_gain * omega * domega/dt. The supply pays for the power that goes into the
//! rotor: J omega domega/dt = V dI. The acceleration is that of the measured speed, or what a rotor has that is off its command's speed.
//! What can go wrong: shows only in transients; a lag between the channels looks alike, and so does, with the other sign, a current that a turning
//! rotor draws beyond its curve: a negative inertia is refused, but against a declared model, whose rotor may have been heavier.
//! Units: kg.m2, A.s3/rad2.
//! Reference: errata to Beharie 2013, Eq. 2.21 (Q = k_Q w^2 + J dw/dt); first-order rotor, section 5.7.3 (dw/dt = (goal - w)/tau).

use crate::channel::{Context, Relation};
use crate::effects::design::TargetDesign;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, operator, present};
use crate::numeric::order::usual_step;
use crate::signal::drive::{Drive, acceleration_of_rows};

/// See the module.
pub(crate) struct RotorInertia;

impl Effect for RotorInertia {
    fn id(&self) -> &'static str {
        "rotor_inertia"
    }

    fn about(&self) -> About {
        About {
            title: "Accelerating the rotor takes torque and current",
            equation: "torque_nm += inertia * d(omega)/dt, current_a += power_gain * omega * d(omega)/dt",
            source: "Beharie 2013, Eq. 2.21 as corrected; power into the rotor over the voltage",
            depends_on: &["rpm_rate"],
            signature: "spikes of torque and current at each step, with the sign of the step; thrust(rpm) holds",
            look_alikes: &["channel_delay", "channel_filter"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the rotor",
            found.tell("inertia", |v| format!("takes torque to speed up (inertia {v})"), "takes torque to speed up"),
        )
    }

    fn is_of_every_rig(&self) -> bool {
        true
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        if context.time_is_row || context.rpm.is_empty() {
            return Vec::new();
        }
        let (torque, current) = (present(context, &["torque_nm"]), present(context, &["current_a"]));
        let both = present(context, &["torque_nm", "current_a"]);
        // where the speed steps between rows, meters that average over a row see the step in the row in which it ends
        let forms: &[&str] = if operator::commands_abruptly(context) { &["", OVER_THE_ROW] } else { &[""] };
        let of_any =
            [&both, &torque, &current].into_iter().flat_map(|set| forms.iter().map(move |form| Instance::new(set, form)));
        let of_current = (!current.is_empty() && driven(context).is_some()).then(|| Instance::new(&current, DRIVEN));
        let mut out: Vec<Instance> = Vec::new();
        for instance in of_any.chain(of_current).filter(|i| !i.channels.is_empty()) {
            if !out.contains(&instance) {
                out.push(instance);
            }
        }
        out
    }

    fn shapes(&self, _: &Context, _: &Instance) -> Vec<Shape> {
        Vec::new()
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "inertia", unit: "kg.m2" }, Amplitude { name: "power_gain", unit: "A.s3/rad2" }]
    }

    fn apply(&self, context: &Context, instance: &Instance, _: &[f64], position: usize, design: &mut TargetDesign) {
        let mut of_row = match instance.form.as_str() {
            OVER_THE_ROW => acceleration_of_rows(&context.t, &context.rpm, usual_step(&context.t)),
            DRIVEN => driven(context).cloned().unwrap_or_else(|| acceleration(context)),
            _ => acceleration(context),
        };
        let of_power = design.relation == Relation::Current;
        if of_power {
            of_row.iter_mut().zip(&context.rpm).for_each(|(a, rpm)| *a *= rpm * std::f64::consts::TAU / 60.0);
        }
        design.add(position, usize::from(of_power), of_row);
    }

    /// Speeding up takes, it does not give. Against a model it is a difference of two inertias.
    fn plausible(&self, context: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        context.against_model || fitted.iter().all(|e| e.value > -2.0 * e.se) && fitted.iter().any(|e| e.value > 0.0)
    }
}

/// Form of meters that average over each row.
const OVER_THE_ROW: &str = "over_the_row";
/// Form of a rotor that is on its way to where its command sends it: a reading within a row's step knows how far it is off.
const DRIVEN: &str = "driven";

/// Acceleration by the command, rad/s^2; nothing without a command.
fn driven(context: &Context) -> Option<&Vec<f64>> {
    let of_command = || Some(Drive::of_command(&context.t, context.pulse.as_deref()?, &context.rpm)?.acceleration(&context.rpm));
    context.facts.driven.get_or_init(of_command).as_ref()
}

/// Angular acceleration by central differences of the consensus speed, rad/s^2.
///
/// The difference spans half a usual interval of the log at least: of two rows that follow each other at once, as a logger writes them that is
/// asked by hand, a reading's own error would make any acceleration.
pub(crate) fn acceleration(context: &Context) -> Vec<f64> {
    let (t, rpm) = (&context.t, &context.rpm);
    let least = 0.5 * usual_step(t);
    let last = t.len().saturating_sub(1);
    (0..t.len())
        .map(|i| {
            let (mut a, mut b) = (i.saturating_sub(1), (i + 1).min(last));
            while t[b] - t[a] < least && (a > 0 || b < last) {
                (a, b) = (a.saturating_sub(1), (b + 1).min(last));
            }
            if t[b] > t[a] { (rpm[b] - rpm[a]) / (t[b] - t[a]) * std::f64::consts::TAU / 60.0 } else { 0.0 }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Column, Log};

    #[test]
    fn two_rows_at_once_make_no_acceleration() {
        let t = vec![0.0, 1.0, 2.0, 2.00004, 3.0, 4.0, 5.0];
        let rpm: Vec<f64> = t.iter().enumerate().map(|(i, t)| 600.0 * t + if i == 3 { 50.0 } else { 0.0 }).collect();
        let log = Log { t, columns: vec![Column { name: "rpm".into(), values: rpm }], ..Log::default() };
        let found = acceleration(&Context::new(&log, Some(1000.0)));
        let steady = 600.0 * std::f64::consts::TAU / 60.0;
        assert!(found.iter().all(|a| (a - steady).abs() < 0.1 * steady), "{found:?}");
    }
}
