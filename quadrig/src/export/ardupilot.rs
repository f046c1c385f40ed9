//! ArduPilot: a parameter file.
//!
//! What it is: MOT_THST_EXPO with the signals at which the rotor turns and thrust begins and ends, the output's range, with the cells of a battery the voltages of
//! its compensation.
//! What can go wrong: without the battery that will fly its voltages are not known.
//! Units: ArduPilot's.
//! Reference: ArduCopter parameters (MOT_*); "Motor thrust scaling".

use super::{Battery, Powerplant, comments, full, off, untold};

const DEFINED: [&str; 3] = [
    "keys: https://ardupilot.org/copter/docs/parameters.html#mot-parameters",
    "battery: https://ardupilot.org/copter/docs/parameters.html#batt-parameters",
    "curve: https://ardupilot.org/copter/docs/motor-thrust-scaling.html",
];
/// Volts of a cell, full and empty (ArduPilot's own advice for lithium polymer).
const CELL_V: [f64; 2] = [4.2, 3.3];

/// How far MOT_SPIN_ARM stays below MOT_SPIN_MIN at the least, of the signal: arming is refused where it is above.
const APART: f64 = 0.002;

/// The file.
pub(super) fn text(plant: &Powerplant, battery: Battery) -> String {
    let from = plant.begins();
    // as the file rounds them
    let [from, expo] = [from, plant.square_share(from)].map(|v| (1e4 * v).round() / 1e4);
    // not on the edge at which the rotor starts
    let armed = (0.5 * (plant.turns + from)).min(from - APART).max(0.0);
    let curve = |u: f64| {
        let x = ((u - from) / (1.0 - from)).max(0.0);
        (1.0 - expo) * x + expo * x * x
    };
    let mut head = vec![plant.title(), full(plant)];
    head.extend(DEFINED.map(str::to_owned));
    head.push(format!(
        "thrust = (1 - MOT_THST_EXPO) x + MOT_THST_EXPO x^2, x from MOT_SPIN_MIN to MOT_SPIN_MAX of the signal; {}",
        off(plant.off_percent(curve))
    ));
    let no_battery = battery
        .cells
        .is_none()
        .then(|| "MOT_BAT_VOLT_MAX, MOT_BAT_VOLT_MIN: the battery that will fly is not known (--cells)".to_owned());
    let rotor_lag = plant.beside();
    head.extend(untold(no_battery.into_iter().chain(battery.no_capacity("BATT_CAPACITY")).chain(rotor_lag)));
    let mut out = comments("#", &head);
    if let Some(capacity) = battery.capacity_mah {
        out += &format!("BATT_CAPACITY,{capacity}\n");
    }
    if let Some(cells) = battery.cells {
        for (name, volts) in ["MOT_BAT_VOLT_MAX", "MOT_BAT_VOLT_MIN"].iter().zip(CELL_V) {
            out += &format!("{name},{:.2}\n", f64::from(cells) * volts);
        }
    }
    out + &format!(
        "MOT_PWM_MAX,2000\nMOT_PWM_MIN,1000\nMOT_SPIN_ARM,{armed:.4}\nMOT_SPIN_MAX,1.0000\nMOT_SPIN_MIN,{from:.4}\nMOT_THST_EXPO,{expo:.4}\n"
    )
}
