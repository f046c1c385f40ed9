//! A table for spreadsheets and scripts.
//!
//! What it is: settled states over the pulse, a row each 10 us; comments at the head.
//! What can go wrong: a channel that the model lacks is an empty field.
//! Units: in the names of the columns.
//! Reference: RFC 4180.

use super::{Battery, Powerplant, comments, full, off};

/// The table.
pub(super) fn text(plant: &Powerplant, battery: Battery) -> String {
    let mut head = vec![plant.title(), full(plant), "file: https://www.rfc-editor.org/rfc/rfc4180".to_owned()];
    head.push(format!("linear between the rows; {}", off(plant.off_percent(|u| plant.share(u)))));
    head.extend(plant.beside());
    if plant.latency_s.is_none() && plant.row_latency_s.is_none() {
        head.push("latency of the rotor's answer: the model holds none".to_owned());
    }
    head.push(match battery.cells {
        Some(cells) => format!("battery that will fly: {cells} cells"),
        None => "battery that will fly: not known (--cells)".to_owned(),
    });
    head.push(match battery.capacity_mah {
        Some(capacity) => format!("capacity of the battery that will fly: {capacity} mAh"),
        None => "capacity of the battery that will fly: not known (--capacity)".to_owned(),
    });
    let mut out = comments("#", &head) + "pulse_us,signal,rpm,thrust_n,torque_nm,current_a,voltage_v\n";
    for p in &plant.points {
        let cell = |v: Option<f64>, digits: usize| v.map_or_else(String::new, |v| format!("{v:.digits$}"));
        out += &format!(
            "{:.1},{:.4},{:.3},{:.6},{},{},{}\n",
            1000.0 + 1000.0 * p.signal,
            p.signal,
            p.rpm,
            p.thrust_n,
            cell(p.torque_nm, 7),
            cell(p.current_a, 5),
            cell(p.voltage_v, 5)
        );
    }
    out
}
