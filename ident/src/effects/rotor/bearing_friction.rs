//! `bearing_friction`: something starts to rub on the rotor.
//!
//! What it is: from t0 on the motor carries an extra torque constant + viscous * omega: the supply pays for it at once, the
//! speed at a pulse falls, and the torque arm sees the share that is not carried by the arm itself.
//! What can go wrong: without a measured current the size is known only as far as the torque arm sees it; friction that was
//! there from the start belongs to the baseline.
//! Units: N.m, N.m.s/rad, s, 1; internally rev/min for the loss of speed.
//! Reference: errata to Beharie 2013, Eq. 2.22-2.24 (friction costs current, not frame torque); power balance of a
//! brushless motor with winding loss R Q^2/Kt^2, Drela 2007, *First-Order DC Electric Motor Model*.

use crate::channel::{Context, Relation};
use crate::effects::design::TargetDesign;
use crate::effects::rotor::blade_damage::STANDSTILL;
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, load_channels};
use crate::numeric::solve::Normal;

/// See the module.
pub(crate) struct BearingFriction;

impl Effect for BearingFriction {
    fn id(&self) -> &'static str {
        "bearing_friction"
    }

    fn about(&self) -> About {
        About {
            title: "Friction sets in on the rotor",
            equation: "Q_f = constant + viscous omega for t >= t0; current_a += Q_f (omega + 2 rho Q) / V, torque_nm += share Q_f, rpm(pulse) falls",
            source: "errata to Beharie 2013, Eq. 2.22-2.24; Drela 2007, First-Order DC Electric Motor Model",
            depends_on: &["t_s", "rpm"],
            signature: "from one instant on more current and less speed at the same pulse; thrust(rpm) holds",
            look_alikes: &["encoder_drag", "blade_damage", "thermal_derate"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new("friction", found.tell("t0", |t| format!("sets in on the rotor at {t}"), "sets in on the rotor"))
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
        let channels = load_channels(context, false);
        if context.time_is_row || context.rpm.is_empty() || channels.len() < 2 {
            return Vec::new();
        }
        vec![Instance::new(&channels, CONSTANT), Instance::new(&channels, "constant_and_viscous")]
    }

    fn shapes(&self, context: &Context, _: &Instance) -> Vec<Shape> {
        vec![crate::effects::load_cell::tare_shift::onset_or_before(context)]
    }

    fn amplitudes(&self, instance: &Instance) -> Vec<Amplitude> {
        if instance.form == CONSTANT { AMPLITUDES[..3].to_vec() } else { AMPLITUDES.to_vec() }
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let [t0] = shape else { return };
        drag(context, &crate::effects::load_cell::tare_shift::step(context, *t0), instance.form != CONSTANT, position, design);
    }

    fn report(&self, context: &Context, _: &Instance, fitted: Vec<Estimate>) -> Vec<Estimate> {
        with_share(context, fitted)
    }

    fn plausible(&self, context: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        let t0 = fitted.iter().find(|e| e.name == "t0").map_or(0.0, |e| e.value);
        let turned = context.t.iter().zip(&context.rpm).filter(|(t, r)| **t < t0 && **r > STANDSTILL).count();
        // friction sets in on a rotor that has turned without it, in this run or when its model was made
        let turned_before = turned * 20 > context.len() || context.against_model && context.t.first().is_some_and(|t| t0 <= *t);
        brakes(fitted) && costs(context, fitted) && turned_before
    }
}

/// Standard errors by which a torque must stand out where a meter sees it.
pub(crate) const SEEN: f64 = 4.0;
/// Share of the drag that an arm may read with the wrong sign: its own curve with the speed is not exact.
const UNSEEN: f64 = 0.05;

/// Share of a drag (at 300 rad/s) by which one of its two terms may fall below nothing, where the other takes more than all of it: the forms
/// are not exact.
const TRADED: f64 = 0.25;

/// Drag is paid for: a measured current shows it. Where none was measured the torque arm, or a modest loss of speed, will do.
pub(crate) fn costs(context: &Context, fitted: &[Estimate]) -> bool {
    let largest = |names: [&str; 2]| {
        let of = |e: &Estimate| if e.se > 0.0 { e.value / e.se } else { 0.0 };
        fitted.iter().filter(|e| names.contains(&e.name.as_str())).map(of).fold(f64::NEG_INFINITY, f64::max)
    };
    let top = context.rpm.iter().copied().fold(0.0, f64::max);
    let modest = fitted.iter().filter(|e| e.name == "speed_loss").all(|e| e.value < 0.5 * top);
    modest && (context.current.is_none() || largest(["constant", "viscous"]) > SEEN)
}

/// Form of a drag that does not grow with speed.
pub(crate) const CONSTANT: &str = "constant";

/// Amplitudes of a dragging torque, for this effect and `encoder_drag`; the first three are those of a constant drag.
pub(crate) const AMPLITUDES: [Amplitude; 6] = [
    Amplitude { name: "constant", unit: "N.m" },
    Amplitude { name: "arm_constant", unit: "N.m" },
    Amplitude { name: "speed_loss", unit: "rev/min" },
    Amplitude { name: "viscous", unit: "N.m.s/rad" },
    Amplitude { name: "arm_viscous", unit: "N.m.s/rad" },
    Amplitude { name: "speed_loss_viscous", unit: "rev/min.s/rad" },
];

/// Adds the columns of an extra torque on the rotor that acts where `on` is 1.
pub(crate) fn drag(context: &Context, on: &[f64], viscous: bool, position: usize, design: &mut TargetDesign) {
    let rho = winding(context);
    let load = |i: usize| context.torque.as_ref().map_or(0.0, |q| q[i].max(0.0));
    let volts = |i: usize| volts(context, i);
    let omega = |i: usize| context.rpm[i] * OMEGA;
    let (first, per_torque): (usize, &dyn Fn(usize) -> f64) = match design.relation {
        Relation::Torque => (1, &|_| 1.0),
        // V dI = dQ (omega + 2 rho Q)
        Relation::Current => (0, &|i| (omega(i) + 2.0 * rho * load(i)) / volts(i)),
        // d(omega) (1 + 2 rho Q / omega) = -rho dQ at a given share of the supply voltage
        Relation::SpeedFromPulse => (2, &|i| -1.0 / (1.0 + 2.0 * rho * load(i) / omega(i))),
        _ => return,
    };
    let turning = STANDSTILL.min(TURNING * context.rpm.iter().copied().fold(0.0, f64::max));
    let column: Vec<f64> =
        (0..context.len()).map(|i| if context.rpm[i] > turning { on[i] * per_torque(i) } else { 0.0 }).collect();
    if viscous {
        design.add(position, first + 3, column.iter().enumerate().map(|(i, v)| v * omega(i)).collect());
    }
    design.add(position, first, column);
}

/// Share of the highest speed from which on a rotor turns, also below [`STANDSTILL`]: that of the starting pulse.
pub(crate) const TURNING: f64 = 0.01;

/// rad/s in a rev/min.
pub(crate) const OMEGA: f64 = std::f64::consts::TAU / 60.0;

/// Supply voltage, V; three lithium cells where it was not measured.
pub(crate) fn volts(context: &Context, i: usize) -> f64 {
    context.voltage.as_ref().map_or(12.0, |v| v[i].max(1.0))
}

/// rho = R/Kt^2 of the winding, W/(N.m)^2, from the run's own balance of electrical and mechanical power; zero, which leaves
/// the winding out, where torque or current was not measured.
pub(crate) fn winding(context: &Context) -> f64 {
    *context.facts.winding.get_or_init(|| balanced(context))
}

fn balanced(context: &Context) -> f64 {
    let (Some(torque), Some(current)) = (&context.torque, &context.current) else { return 0.0 };
    let n = context.len();
    let mut normal = Normal::new(2);
    for i in (0..n).step_by((n / 1000).max(1)).filter(|i| context.rpm[*i] > STANDSTILL) {
        let omega = context.rpm[i] * OMEGA;
        normal.add(&[omega, torque[i] * torque[i]], volts(context, i) * current[i] - torque[i] * omega, 1.0);
    }
    normal.solve().map_or(0.0, |s| s.coefficients[1].max(0.0))
}

/// Relative error of a torque that is inferred from the power balance: with everything measured, where the winding's share is
/// itself an estimate; with a voltage that is assumed; and with the winding left out.
const BALANCE: [f64; 3] = [0.04, 0.1, 0.4];

fn balance(context: &Context) -> f64 {
    match (&context.torque, &context.voltage) {
        (Some(_), Some(_)) => BALANCE[0],
        (Some(_), None) => BALANCE[1],
        _ => BALANCE[2],
    }
}

/// Adds the share of the drag that the torque arm sees. Where no current was measured only the arm's part is known: the drag
/// itself is left out.
pub(crate) fn with_share(context: &Context, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
    for e in fitted.iter_mut().filter(|e| e.name == "constant" || e.name == "viscous") {
        e.se = e.se.hypot(balance(context) * e.value);
    }
    let find = |name: &str| fitted.iter().find(|e| e.name == name).cloned();
    match (find("constant"), find("arm_constant")) {
        (Some(whole), Some(arm)) if whole.value != 0.0 => {
            let share = arm.value / whole.value;
            let se = (arm.se / whole.value).hypot(share * whole.se / whole.value);
            fitted.push(Estimate { name: "share".into(), unit: "1".into(), value: share, se });
        }
        _ => {}
    }
    fitted
}

/// Friction takes: current rises, the rotor slows down, and the arm sees nothing that pushes; nor does drag fall with speed by more than
/// a quarter of itself.
pub(crate) fn brakes(fitted: &[Estimate]) -> bool {
    let value = |name: &str| fitted.iter().find(|e| e.name == name);
    // at 300 rad/s; a missing term is none
    let sum = |a: &str, b: &str| value(a).map(|a| a.value + 300.0 * value(b).map_or(0.0, |b| b.value));
    let unseen = UNSEEN * value("constant").map_or(0.0, |e| e.value.abs());
    let of_drag = TRADED * sum("constant", "viscous").unwrap_or(0.0);
    let of_loss = TRADED * sum("speed_loss", "speed_loss_viscous").unwrap_or(0.0);
    let traded = |name: &str| match name {
        "constant" => of_drag,
        "viscous" => of_drag / 300.0,
        "speed_loss" => of_loss,
        "speed_loss_viscous" => of_loss / 300.0,
        "arm_constant" => unseen,
        _ => 0.0,
    };
    let some = |name: &str| value(name).is_none_or(|e| e.value > -2.0 * e.se - traded(name).max(0.0));
    sum("constant", "viscous").is_none_or(|v| v > 0.0)
        && sum("speed_loss", "speed_loss_viscous").is_none_or(|v| v > 0.0)
        && AMPLITUDES.iter().all(|a| some(a.name))
}
