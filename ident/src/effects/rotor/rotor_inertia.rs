//! `rotor_inertia`: speeding the rotor up costs torque and current.
//!
//! What it is: torque_nm += inertia * domega/dt, current_a += power_gain * omega * domega/dt. The supply pays for the power that goes into the
//! rotor: J omega domega/dt = V dI. The acceleration is that of the measured speed, or what a rotor has that is off its command's speed.
//! Most controllers let no current flow back (forms `one_way`): a rotor that falls faster than air and friction alone brake it, domega/dt below
//! -(coast_drag omega^2 + coast_friction), takes what one takes that stands. So does one whose motor is off by its command.
//! What can go wrong: shows only in transients; a lag between the channels looks alike, and so does, with the other sign, a current that a turning
//! rotor draws beyond its curve: a negative inertia is refused, but against a declared model, whose rotor may have been heavier.
//! Units: kg.m2, A.s3/rad2.
//! Reference: errata to Beharie 2013, Eq. 2.21 (Q = k_Q w^2 + J dw/dt); first-order rotor, section 5.7.3 (dw/dt = (goal - w)/tau).

use crate::channel::{Coast, Context, Relation, STANDSTILL};
use crate::effects::design::{Label, TargetDesign};
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, operator, present};
use crate::numeric::order::{median, usual_step};
use crate::numeric::solve::Normal;
use crate::signal::drive::{Drive, acceleration_of_rows};
use std::borrow::Cow;
use std::sync::Arc;

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

    /// A rotor that coasts takes what one takes that stands, and no less.
    fn runs_on(&self, instance: &Instance) -> [bool; 2] {
        [!is_one_way(instance), true]
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        if context.time_is_row || context.rpm.is_empty() {
            return Vec::new();
        }
        let (torque, current) = (present(context, &["torque_nm"]), present(context, &["current_a"]));
        let both = present(context, &["torque_nm", "current_a"]);
        // of two forms that a run cannot tell apart the first one stands: no current below that of a motor at rest is claimed
        // where the speed steps between rows, meters that average over a row see the step in the row in which it ends
        let over = operator::commands_abruptly(context).then_some([OVER_THE_ROW_ONE_WAY, OVER_THE_ROW]);
        let of_command = driven(context).is_some().then_some([DRIVEN_ONE_WAY, DRIVEN]);
        let of_all: Vec<&str> = [Some([ONE_WAY, ""]), over].into_iter().flatten().flatten().collect();
        let of_torque: Vec<&str> = of_all.iter().copied().filter(|form| !form.ends_with(ONE_WAY)).collect();
        let of_current: Vec<&str> = of_all.iter().copied().chain(of_command.into_iter().flatten()).collect();
        let of_both = if current.is_empty() { &of_torque } else { &of_all };
        let sets = [(&both, of_both), (&torque, &of_torque), (&current, &of_current)];
        let of_any = sets.into_iter().flat_map(|(set, forms)| forms.iter().map(move |form| Instance::new(set, form)));
        let mut out: Vec<Instance> = Vec::new();
        for instance in of_any.filter(|i| !i.channels.is_empty()) {
            if !out.contains(&instance) {
                out.push(instance);
            }
        }
        out
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        if !is_one_way(instance) {
            return Vec::new();
        }
        let known = balance(context);
        let drags = known.map_or_else(|| vec![3e-4, 1e-3, 3e-3, 1e-2, 3e-2], |b| vec![b.drag, 0.4 * b.drag, 2.5 * b.drag]);
        vec![
            Shape { name: COAST_DRAG, unit: "1/rad", range: COAST, starts: drags },
            Shape { name: COAST_FRICTION, unit: "rad/s2", range: FRICTION, starts: vec![known.map_or(0.0, |b| b.friction)] },
        ]
    }

    fn prior(&self, context: &Context, _: &Instance, shape: &[f64]) -> f64 {
        let ([drag, friction], Some(known)) = (shape, balance(context)) else { return 0.0 };
        let of_drag = (drag / known.drag).max(f64::MIN_POSITIVE).ln() / ABOUT_BALANCE;
        let of_friction = (friction - known.friction) / (ABOUT_BALANCE * known.friction.max(LEAST_FRICTION * known.at_top));
        -0.5 * (of_drag.powi(2) + of_friction.powi(2))
    }

    /// A run on which nothing coasts says nothing of it.
    fn priced(&self, context: &Context, instance: &Instance) -> usize {
        usize::from(is_one_way(instance) && balance(context).is_none_or(|known| known.shown))
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        vec![Amplitude { name: "inertia", unit: "kg.m2" }, Amplitude { name: "power_gain", unit: "A.s3/rad2" }]
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let mut of_row = match instance.form.as_str() {
            OVER_THE_ROW | OVER_THE_ROW_ONE_WAY => acceleration_of_rows(&context.t, &context.rpm, usual_step(&context.t)),
            DRIVEN | DRIVEN_ONE_WAY => driven(context).cloned().unwrap_or_else(|| acceleration(context)),
            _ => acceleration(context),
        };
        let of_power = design.relation == Relation::Current;
        if of_power {
            let omega: Vec<f64> = context.rpm.iter().map(|rpm| rpm * std::f64::consts::TAU / 60.0).collect();
            let coasts: Vec<bool> = match shape {
                [drag, friction] => {
                    let falls = |row: usize| of_row[row] < -(drag * omega[row].powi(2) + friction);
                    (0..omega.len()).map(|row| falls(row) || context.runs_down(row)).collect()
                }
                _ => vec![false; omega.len()],
            };
            of_row.iter_mut().zip(&omega).zip(&coasts).for_each(|((a, w), coasts)| *a *= if *coasts { 0.0 } else { *w });
            stand_still(design, &context.rpm, &coasts);
        }
        design.add(position, usize::from(of_power), of_row);
    }

    /// Speeding up takes, it does not give. Against a model it is a difference of two inertias.
    /// What one takes that stands is no inertia where none is seen on the way up.
    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        let seen = !is_one_way(instance) || fitted.iter().any(|e| e.name == "power_gain" && e.value > 3.0 * e.se);
        let mut taken = fitted.iter().filter(|e| ![COAST_DRAG, COAST_FRICTION].contains(&e.name.as_str()));
        seen && (context.against_model || taken.clone().all(|e| e.value > -2.0 * e.se) && taken.any(|e| e.value > 0.0))
    }
}

/// Form of meters that average over each row.
const OVER_THE_ROW: &str = "over_the_row";
/// Form of a rotor that is on its way to where its command sends it: a reading within a row's step knows how far it is off.
const DRIVEN: &str = "driven";
/// The three with a controller that lets no current flow back.
const ONE_WAY: &str = "one_way";
const OVER_THE_ROW_ONE_WAY: &str = "over_the_row_one_way";
const DRIVEN_ONE_WAY: &str = "driven_one_way";
/// Their parameters, of no other form.
const COAST_DRAG: &str = "coast_drag";
const COAST_FRICTION: &str = "coast_friction";
/// Deceleration of a rotor that nothing drives over the square of its speed, 1/rad: its torque's factor over its inertia. From a disc of
/// a boat's screw to a bare blade of a toy.
const COAST: (f64, f64) = (1e-4, 0.1);
/// What friction and the motor's losses add to that, rad/s^2: up to that of a toy's rotor, which stands within a tenth of a second.
const FRICTION: (f64, f64) = (0.0, 5000.0);

/// Standard deviation of the logarithm of a coasting rotor's drag about its balance: the winding's share in the two is not the same, and the
/// efficiency of motors of this size goes from 0.65 to 0.85. Of the friction likewise, but no better than a part of the whole at full speed.
const ABOUT_BALANCE: f64 = 0.27;
const LEAST_FRICTION: f64 = 0.02;

/// rad/s of the unit in which a curve is solved for.
const KILO: f64 = 1000.0;
/// Parts of the range of speeds at which the balance is taken.
const PARTS: usize = 8;

/// Where no current is left of a rotor that slows down: what its speed draws, over what its acceleration adds to that, by the held rows and those
/// on the way up. A run that never coasts tells a coasting rotor so, and no other way.
fn balance(context: &Context) -> Option<Coast> {
    let found = || {
        let target = context.targets.iter().find(|t| t.relation == Relation::Current)?;
        let rate = driven(context).map_or_else(|| Cow::Owned(acceleration(context)), Cow::Borrowed);
        let omega = |row: usize| context.rpm[row] * std::f64::consts::TAU / 60.0;
        let mut held = vec![false; context.len()];
        context.steady.iter().for_each(|(from, to)| held[*from..*to].fill(true));
        // held rows and those on the way up, together: a run of ramps holds next to no speed
        let terms = target.relation.degree() + 1;
        let mut normal = Normal::new(terms + 1);
        for (row, y) in target.rows.iter().zip(&target.y).filter(|(row, _)| held[**row] || rate[**row] > 0.0) {
            let mut columns: Vec<f64> = (0..terms).map(|k| (omega(*row) / KILO).powi(k as i32)).collect();
            columns.push(rate[*row] * omega(*row) / KILO);
            normal.add(&columns, *y, 1.0);
        }
        let mut curve = normal.solve()?.coefficients;
        let gain = curve.pop().filter(|gain| *gain > 0.0)? / KILO;
        let drawn = |omega: f64| curve.iter().rev().fold(0.0, |sum, c| sum * omega / KILO + c);
        let top = target.rows.iter().map(|i| omega(*i)).fold(0.0, f64::max);
        let at = |omega: f64| (drawn(omega) - drawn(0.0)) / (omega * gain);
        let speeds = (1..=PARTS).map(|k| top * k as f64 / PARTS as f64);
        let line = Normal::of_polynomial(1, speeds.map(|w| (w * w, at(w), 1.0))).solve()?.coefficients;
        // what falls with the speed is no friction
        let (drag, friction) = if line[0] > 0.0 { (line[1], line[0]) } else { (at(top) / top.powi(2), 0.0) };
        let friction = friction.min(FRICTION.1);
        let least = |row: usize| (drag * omega(row).powi(2) + friction) * (-2.0 * ABOUT_BALANCE).exp();
        let shown = (0..context.len()).any(|row| context.rpm[row] > STANDSTILL && rate[row] < -least(row));
        // of what a run does not show no more is claimed than is beyond doubt
        let sure = if shown { 1.0 } else { (2.0 * ABOUT_BALANCE).exp() };
        let coast = Coast { drag: sure * drag, friction: sure * friction, at_top: sure * at(top), shown };
        (COAST.0..COAST.1).contains(&coast.drag).then_some(coast)
    };
    *context.facts.balance.get_or_init(found)
}

fn is_one_way(instance: &Instance) -> bool {
    instance.form.ends_with(ONE_WAY)
}

/// Makes some rows of the current those of a rotor that stands.
fn stand_still(design: &mut TargetDesign, rpm: &[f64], rows: &[bool]) {
    if !rows.contains(&true) {
        return;
    }
    for column in design.columns.iter_mut().filter(|c| c.label != Label::Base(0)) {
        Arc::make_mut(&mut column.values).iter_mut().zip(rows).filter(|(_, stands)| **stands).for_each(|(v, _)| *v = 0.0);
    }
    let standing = design.fixed.iter().zip(rpm).min_by(|a, b| a.1.total_cmp(b.1)).map(|(fixed, _)| *fixed);
    if let Some(standing) = standing {
        design.fixed.iter_mut().zip(rows).filter(|(_, stands)| **stands).for_each(|(v, _)| *v = standing);
    }
}

/// Acceleration by the command, rad/s^2. Without one, by the levels that the speed settles on.
fn driven(context: &Context) -> Option<&Vec<f64>> {
    let of_levels = || {
        let command = context.pulse.clone().or_else(|| settles_on(context))?;
        Some(Drive::of_command(&context.t, &command, &context.rpm)?.acceleration(&context.rpm))
    };
    context.facts.driven.get_or_init(of_levels).as_ref()
}

/// For each row the speed on which the rotor comes to rest next, rev/min; nothing where it seldom does.
fn settles_on(context: &Context) -> Option<Vec<f64>> {
    let mut out = Vec::with_capacity(context.rpm.len());
    for (from, to) in &context.steady {
        let level = median(&mut context.rpm[*from..*to].to_vec());
        out.resize(*to, level);
    }
    let last = *out.last()?;
    out.resize(context.rpm.len(), last);
    Some(out)
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

    /// A run that only climbs says where a coasting rotor draws nothing, and claims it beyond doubt only.
    #[test]
    fn a_climb_tells_how_a_rotor_coasts() {
        let (draw, gain, tau) = (4e-8, 1e-5, 0.15);
        let t: Vec<f64> = (0..2000).map(|i| 0.05 * f64::from(i)).collect();
        let pulse: Vec<f64> = (0..2000).map(|i| 1000.0 + 100.0 * f64::from(i / 200)).collect();
        let (mut rpm, mut current) = (Vec::new(), Vec::new());
        let mut speed = 0.0_f64;
        for (i, p) in pulse.iter().enumerate() {
            let goal = 7.5 * (p - 1000.0);
            let omega = std::f64::consts::TAU / 60.0;
            let power = speed * omega * (goal - speed) * omega / tau;
            rpm.push(speed);
            current.push(0.05 + draw * (speed * omega).powi(3) + gain * power + 0.01 * (0.7 * (i * i) as f64).sin());
            speed = goal + (speed - goal) * f64::exp(-0.05 / tau);
        }
        let columns = [("pulse_us", pulse), ("rpm", rpm), ("current_a", current)];
        let columns = columns.into_iter().map(|(name, values)| Column { name: name.into(), values }).collect();
        let context = Context::new(&Log { t, columns, ..Log::default() }, Some(1050.0));
        let found = balance(&context).expect("a climb tells it").drag;
        let beyond = (found / (draw / gain)).ln() - 2.0 * ABOUT_BALANCE;
        assert!(beyond.abs() < 0.2, "{found} for {}", draw / gain);
        let [of_one_way, _] = &RotorInertia.shapes(&context, &Instance::new(&["current_a"], DRIVEN_ONE_WAY))[..] else {
            panic!()
        };
        assert_eq!(of_one_way.starts.first(), Some(&found));
        // nothing coasts on it: the shape costs nothing, and of two forms that it cannot tell the one that gives nothing back comes first
        let instances = RotorInertia.instances(&context);
        let [first, ..] = &instances[..] else { panic!() };
        assert!(is_one_way(first) && RotorInertia.priced(&context, first) == 0, "{instances:?}");
    }

    /// A motor that is off draws nothing, although its rotor has hardly slowed down yet.
    #[test]
    fn a_motor_that_is_off_draws_what_one_draws_that_stands() {
        let t: Vec<f64> = (0..60).map(|i| 0.1 * f64::from(i)).collect();
        let pulse: Vec<f64> = (0..60).map(|i| if i < 40 { 1800.0 } else { 1000.0 }).collect();
        let rpm: Vec<f64> = (0..60).map(|i| 6000.0 - 20.0 * f64::from((i - 39).max(0))).collect();
        let current = pulse.iter().map(|p| if *p > 1100.0 { 20.0 } else { 0.2 }).collect();
        let columns = [("pulse_us", pulse), ("rpm", rpm), ("current_a", current)];
        let columns = columns.map(|(name, values)| Column { name: name.into(), values }).to_vec();
        let context = Context::new(&Log { t, columns, ..Log::default() }, Some(1100.0));
        let instance = Instance::new(&["current_a"], ONE_WAY);
        let mut design = TargetDesign::baseline(&context, "current_a", Relation::Current);
        RotorInertia.apply(&context, &instance, &[1e-3, 50.0], 0, &mut design);
        let of_speed = |row: usize| design.columns.iter().filter(|c| c.label != Label::Base(0)).all(|c| c.values[row] == 0.0);
        assert!(of_speed(41) && !of_speed(38), "{:?}", design.columns);
    }

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
