//! PX4: a parameter file as QGroundControl writes and reads it.
//!
//! What it is: THR_MDL_FAC (thrust over signal), thrust and moment coefficients of each rotor, the output's range, cells and resistance of the
//! battery; the figures of Gazebo's motor model beside them as comments.
//! What can go wrong: a model without torque has no moment coefficient.
//! Units: PX4's: CT in N at full signal, KM in m.
//! Reference: PX4 parameter reference; QGroundControl, file format of parameters.

use super::curve::LEAD;
use super::{Battery, Powerplant, comments, full, off, untold};

const DEFINED: [&str; 3] = [
    "keys: https://docs.px4.io/main/en/advanced_config/parameter_reference.html",
    "battery: https://docs.px4.io/main/en/config/battery.html",
    "file: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/parameters.html",
];
/// Types of the file's last column (MAV_PARAM_TYPE).
const INT32: u32 = 6;
const REAL32: u32 = 9;

/// Which way the rotors of PX4's quad X turn, in its own order (front right, rear left, front left, rear right): seen from above, 1 for
/// counter-clockwise. With all of one sign the allocator could not turn the vehicle about its vertical axis.
fn turning(rotors: u32) -> Option<[f64; 4]> {
    (rotors == 4).then_some([1.0, 1.0, -1.0, -1.0])
}

/// The file.
pub(super) fn text(plant: &Powerplant, rotors: u32, battery: Battery) -> String {
    // a whole pulse, at which the rotor turns: what the autopilot gives without thrust keeps it turning
    let least_us = (1000.0 + 1000.0 * plant.begins()).round();
    let from = least_us / 1000.0 - 1.0;
    let factor = plant.square_share(from);
    let curve = |u: f64| {
        let x = ((u - from) / (1.0 - from)).max(0.0);
        (1.0 - factor) * x + factor * x * x
    };
    let (k_thrust, arm) = plant.quotients();
    let top_rad_s = plant.points.last().map_or(0.0, |p| p.rpm * std::f64::consts::TAU / 60.0);
    let mut head = vec!["Onboard parameters".to_owned(), String::new(), plant.title(), full(plant)];
    head.extend(DEFINED.map(str::to_owned));
    head.push(format!(
        "thrust = THR_MDL_FAC x^2 + (1 - THR_MDL_FAC) x, x the signal from PWM_MAIN_MINn to PWM_MAIN_MAXn; {}",
        off(plant.off_percent(curve))
    ));
    let moment = arm.map_or_else(|| "not known".to_owned(), |arm| format!("{arm:.6}"));
    head.push(format!(
        "Gazebo MulticopterMotorModel: motorConstant {k_thrust:.6e}, momentConstant {moment} (both least squares over the run's speeds), maxRotVelocity {top_rad_s:.1}{}",
        plant.lag_s.map_or_else(String::new, |lag_s| format!(", timeConstantUp {lag_s:.4}"))
    ));
    let no_moment = arm.is_none().then(|| "CA_ROTORn_KM: the model predicts no torque".to_owned());
    head.extend(arm.map(|_| match turning(rotors) {
        Some(signs) => format!(
            "CA_ROTORn_KM is positive for rotors that turn counter-clockwise: here those of PX4's quad X, rotors 1 to 4 {}: https://docs.px4.io/main/en/airframes/airframe_reference.html#quadrotor-x",
            signs.map(|s| if s > 0.0 { "counter-clockwise" } else { "clockwise" }).join(", ")
        ),
        None => format!(
            "CA_ROTORn_KM is left out: it is positive for rotors that turn counter-clockwise, and which of {rotors} do the airframe says (https://docs.px4.io/main/en/airframes/airframe_reference.html); its size is {:.6} m",
            arm.unwrap_or(0.0)
        ),
    }));
    let per_cell = battery.cells.zip(plant.lead_ohm).filter(|_| battery.of_the_rig);
    let per_cell = per_cell.map(|(cells, lead_ohm)| lead_ohm / f64::from(cells));
    head.extend(per_cell.map(|_| {
        "BAT1_R_INTERNAL: the resistance of the rig's supply and its lead, shared among the cells (--rig-supply)".to_owned()
    }));
    let no_battery = match (battery.cells, plant.lead_ohm) {
        (None, _) => Some("BAT1_N_CELLS, BAT1_R_INTERNAL: the battery that will fly is not known (--cells)"),
        (_, None) => Some("BAT1_R_INTERNAL: the model holds no resistance of the supply"),
        _ if !battery.of_the_rig => Some(
            "BAT1_R_INTERNAL: the resistance below is that of the rig's supply; where the rig ran on what will fly: --rig-supply",
        ),
        _ => None,
    };
    // what has a key is told by it
    let beside = plant.beside().into_iter().filter(|line| per_cell.is_none() || !line.starts_with(LEAD));
    head.extend(untold(
        no_moment.into_iter().chain(no_battery.map(str::to_owned)).chain(battery.no_capacity("BAT1_CAPACITY")).chain(beside),
    ));
    head.extend([String::new(), "Vehicle-Id Component-Id Name Value Type".to_owned()]);
    let line = |name: &str, value: &str, kind: u32| format!("1\t1\t{name}\t{value}\t{kind}\n");
    let mut out = comments("#", &head);
    if let Some(capacity) = battery.capacity_mah {
        out += &line("BAT1_CAPACITY", &format!("{capacity}.0"), REAL32);
    }
    if let Some(cells) = battery.cells {
        out += &line("BAT1_N_CELLS", &cells.to_string(), INT32);
    }
    if let Some(per_cell) = per_cell {
        out += &line("BAT1_R_INTERNAL", &format!("{per_cell:.6}"), REAL32);
    }
    out += &line("CA_ROTOR_COUNT", &rotors.to_string(), INT32);
    for k in 0..rotors {
        out += &line(&format!("CA_ROTOR{k}_CT"), &format!("{:.6}", plant.full_n()), REAL32);
        if let Some((arm, signs)) = arm.zip(turning(rotors)) {
            out += &line(&format!("CA_ROTOR{k}_KM"), &format!("{:.6}", signs[k as usize] * arm), REAL32);
        }
    }
    for k in 1..=rotors {
        out += &line(&format!("PWM_MAIN_DIS{k}"), "1000", INT32);
        out += &line(&format!("PWM_MAIN_MAX{k}"), "2000", INT32);
        out += &line(&format!("PWM_MAIN_MIN{k}"), &format!("{least_us:.0}"), INT32);
    }
    out + &line("THR_MDL_FAC", &format!("{factor:.6}"), REAL32)
}
