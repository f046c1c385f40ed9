//! Simulink: a MATLAB script that makes a structure of tables.
//!
//! What it is: settled states over the signal for one-dimensional lookup tables, the rotor's time constant for a first-order lag, latency, the
//! supply, meters that are late, quotients.
//! What can go wrong: a channel that the model lacks is an empty matrix, and a comment says so.
//! Units: in the names of the fields.
//! Reference: MathWorks, block "1-D Lookup Table"; "Transfer Fcn".

use super::curve::Point;
use super::{Battery, Powerplant, comments, full, off, untold};

const DEFINED: [&str; 3] = [
    "table: https://www.mathworks.com/help/simulink/slref/1dlookuptable.html",
    "lag: https://www.mathworks.com/help/simulink/slref/transferfcn.html, 1/(tau_s s + 1)",
    "latency and delays: https://www.mathworks.com/help/simulink/slref/transportdelay.html",
];

/// The script.
pub(super) fn text(plant: &Powerplant, battery: Battery) -> String {
    let mut head = vec![plant.title(), full(plant)];
    head.extend(DEFINED.map(str::to_owned));
    head.push(format!("linear between the points; {}", off(plant.off_percent(|u| plant.share(u)))));
    let (k_thrust, arm) = plant.quotients();
    let column = |of: fn(&Point) -> Option<f64>, digits: usize| {
        let values: Option<Vec<String>> = plant.points.iter().map(|p| of(p).map(|v| format!("{v:.digits$}"))).collect();
        values.map_or_else(|| "[]".to_owned(), |values| format!("[{}]", values.join(" ")))
    };
    type Of = fn(&Point) -> Option<f64>;
    let fields: [(&str, Of, usize); 7] = [
        ("signal", |p| Some(p.signal), 4),
        ("pulse_us", |p| Some(1000.0 + 1000.0 * p.signal), 1),
        ("rpm", |p| Some(p.rpm), 3),
        ("thrust_n", |p| Some(p.thrust_n), 6),
        ("torque_nm", |p| p.torque_nm, 7),
        ("current_a", |p| p.current_a, 5),
        ("voltage_v", |p| p.voltage_v, 5),
    ];
    let absent: Vec<String> = fields
        .iter()
        .filter(|(_, of, _)| plant.points.iter().any(|p| of(p).is_none()))
        .map(|(name, ..)| format!("{name}: the model does not predict it"))
        .collect();
    head.extend(untold(absent));
    if plant.lag_s.is_none() {
        head.push(plant.no_lag() + ": tau_s = 0, a first-order lag that passes its input");
    }
    if plant.latency_s.is_none() {
        let why = plant.of_the_rows().map_or_else(
            || "the model holds none; the answer begins with the command".to_owned(),
            |rows| format!("log_latency_s is the {rows}"),
        );
        head.push(format!("latency_s = 0: {why}"));
    }
    head.extend(battery.no_capacity("capacity_mah"));
    if battery.cells.is_none() {
        head.push("cells: the battery that will fly is not known (--cells)".to_owned());
    }
    let mut out = comments("%", &head) + "powerplant = struct();\n";
    for (name, of, digits) in fields {
        out += &format!("powerplant.{name} = {};\n", column(of, digits));
    }
    let tau = plant.lag_s.map_or_else(|| "0".to_owned(), |lag_s| format!("{lag_s:.5}"));
    out += &format!("powerplant.tau_s = {tau};\npowerplant.k_thrust_ns2 = {k_thrust:.6e};\n");
    out += &format!("powerplant.torque_per_thrust_m = {};\n", arm.map_or_else(|| "[]".to_owned(), |arm| format!("{arm:.6}")));
    let known = |v: Option<f64>| v.map_or_else(|| "[]".to_owned(), |v| format!("{v:.5}"));
    out += &format!("powerplant.latency_s = {:.5};\n", plant.latency_s.unwrap_or(0.0));
    out += &format!("powerplant.log_latency_s = {};\n", known(plant.row_latency_s));
    out += &format!("powerplant.supply_v = {};\n", known(plant.points.first().and_then(|p| p.voltage_v)));
    out += &format!("powerplant.lead_ohm = {};\n", known(plant.lead_ohm));
    out += &format!("powerplant.fall_v_per_ah = {};\n", known(plant.fall_v_per_ah));
    let told = |v: Option<u32>| v.map_or_else(|| "[]".to_owned(), |v| v.to_string());
    out += &format!("powerplant.cells = {};\npowerplant.capacity_mah = {};\n", told(battery.cells), told(battery.capacity_mah));
    out += "powerplant.meter_delay_s = struct();\n";
    plant.late.iter().for_each(|(channel, s)| out += &format!("powerplant.meter_delay_s.{channel} = {s:.5};\n"));
    out
}
