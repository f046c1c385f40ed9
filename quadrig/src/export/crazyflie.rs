//! Crazyflie: a C header in the manner of the firmware's platform defaults.
//!
//! What it is: thrust of one motor as a cubic of the voltage at the motor (signal times supply), its ends, and torque over thrust.
//! What can go wrong: a model without voltage cannot say it: refused.
//! Units: N, V, m.
//! Reference: crazyflie-firmware, `platform_defaults_*.h` and "PWM to thrust".

use super::{Battery, Powerplant, comments, full, off, untold};
use nalgebra::{DMatrix, DVector};

const DEFINED: [&str; 2] = [
    "keys: https://github.com/bitcraze/crazyflie-firmware/tree/master/src/platform/interface",
    "curve: https://www.bitcraze.io/documentation/repository/crazyflie-firmware/master/functional-areas/pwm-to-thrust/",
];

/// Volts of a cell, low and critical (the firmware's own, for its one cell).
const CELL_V: [f64; 2] = [3.2, 3.0];

/// The header.
pub(super) fn text(plant: &Powerplant, battery: Battery) -> Result<String, &'static str> {
    let lacks = "the model predicts no voltage; expected one identified from a log with voltage_v";
    let turning: Vec<(f64, f64)> = plant
        .points
        .iter()
        .filter(|p| p.thrust_n > 0.0)
        .map(|p| Some((p.signal * p.voltage_v?, p.thrust_n)))
        .collect::<Option<_>>()
        .ok_or(lacks)?;
    let powers = DMatrix::from_fn(turning.len(), 4, |row, order| turning[row].0.powi(order as i32));
    let thrust = DVector::from_iterator(turning.len(), turning.iter().map(|p| p.1));
    let solved = powers.svd(true, true).solve(&thrust, 1e-12).map_err(|_| lacks)?;
    let supply = plant.supply_v().ok_or(lacks)?;
    let least = turning.first().map_or(0.0, |p| p.1);
    let curve = |u: f64| {
        // the firmware gives no thrust below the least
        let voltage = plant.points.iter().find(|p| p.signal >= u - 1e-9).and_then(|p| p.voltage_v).unwrap_or(supply) * u;
        let thrust: f64 = (0..4).map(|k| solved[k] * voltage.powi(k as i32)).sum();
        if u <= plant.begins() { 0.0 } else { thrust / plant.full_n() }
    };
    let (_, arm) = plant.quotients();
    let mut head = vec![plant.title(), full(plant)];
    head.extend(DEFINED.map(str::to_owned));
    head.push(format!("thrust = sum of VMOTOR2THRUSTn v^n, v = signal times supply; {}", off(plant.off_percent(curve))));
    let no_torque = arm.is_none().then(|| "THRUST2TORQUE: the model predicts no torque".to_owned());
    let no_battery = battery.cells.is_none().then(|| {
        "DEFAULT_BAT_LOW_VOLTAGE, DEFAULT_BAT_CRITICAL_LOW_VOLTAGE: the battery that will fly is not known (--cells)".to_owned()
    });
    let capacity = battery.no_capacity("capacity").or(battery
        .capacity_mah
        .map(|c| format!("capacity of the battery that will fly {c} mAh: the firmware has no key for it")));
    head.extend(untold(no_torque.into_iter().chain(no_battery).chain(capacity).chain(plant.beside())));
    let mut out = comments("//", &head) + "#pragma once\n";
    for (k, c) in solved.iter().enumerate() {
        out += &format!("#define VMOTOR2THRUST{k} {c:.9e}f\n");
    }
    out += &format!("#define THRUST_MIN {least:.6}f\n#define THRUST_MAX {:.6}f\n", plant.full_n());
    if let Some(arm) = arm {
        out += &format!("#define THRUST2TORQUE {arm:.6}f\n");
    }
    if let Some(cells) = battery.cells.map(f64::from) {
        for (name, volts) in ["DEFAULT_BAT_LOW_VOLTAGE", "DEFAULT_BAT_CRITICAL_LOW_VOLTAGE"].iter().zip(CELL_V) {
            out += &format!("#define {name} {:.1}f\n", cells * volts);
        }
    }
    Ok(out)
}
