//! What a battery does to the voltage, and what it does not do to the rest.
//!
//! What it is: a motor on a battery with a resistance that answers at once, one that answers late, and a charge that runs out, on random levels.
//! What can go wrong: a case whose effect the search misses fails with the verdict in its message.
//! Units: SI, rev/min, us.
//! Reference: Chen & Rincon-Mora 2006, IEEE Trans. Energy Conversion 21:504; specification `closing-the-loop.md`, "What counts as proof".

mod rig;

use ident::close::{Closed, close};
use ident::log::{Column, Log};
use rig::Chance;

const STEP: f64 = 0.05;

/// A battery and a day.
#[derive(Clone, Copy)]
struct Day {
    seed: u64,
    rows: usize,
    /// Resistance that answers late, ohm, and its time constant, s.
    late: (f64, f64),
    /// Voltage that an ampere hour takes, V/Ah.
    slope: f64,
    /// Charge of three full cells with the common table's open-circuit voltage, Ah; 0: they fall by `slope` instead.
    full_ah: f64,
    /// Share by which the current at a speed grows each second, for a reason that no battery has.
    drifts: f64,
}

const DAY: Day = Day { seed: 1, rows: 3000, late: (0.0, 1.0), slope: 0.0, full_ah: 0.0, drifts: 0.0 };

/// Open-circuit voltage of a lithium-polymer cell over its state of charge, V: the common table, twentieths from empty to full.
fn cell_v(charge: f64) -> f64 {
    const TABLE: [f64; 21] = [
        3.27, 3.61, 3.69, 3.71, 3.73, 3.75, 3.77, 3.79, 3.80, 3.82, 3.84, 3.85, 3.87, 3.91, 3.95, 3.98, 4.02, 4.08, 4.11, 4.15,
        4.20,
    ];
    let at = 20.0 * charge.clamp(0.0, 1.0);
    let below = (at as usize).min(19);
    TABLE[below] + (at - below as f64) * (TABLE[below + 1] - TABLE[below])
}

/// A log: the speed is held by the command, the current follows from the power.
fn log(day: &Day) -> Log {
    let mut chance = Chance::new(day.seed);
    let t: Vec<f64> = (0..day.rows).map(|i| STEP * i as f64).collect();
    let mut pulse = Vec::new();
    while pulse.len() < day.rows {
        let level = (1200.0 + 700.0 * chance.uniform()).round();
        pulse.extend(std::iter::repeat_n(level, (80.0 + 80.0 * chance.uniform()) as usize));
    }
    pulse.truncate(day.rows);
    let (mut late, mut charge) = (0.0, 0.0);
    let [mut rpm, mut current, mut voltage] = [const { Vec::new() }; 3];
    for i in 0..day.rows {
        let rests = if day.full_ah > 0.0 { 3.0 * cell_v(1.0 - charge / day.full_ah) } else { 12.4 - day.slope * charge };
        let open = rests - day.late.0 * late;
        let krpm = 6.0e-3 * (pulse[i] - 1000.0) * (1.0 - 0.5 * (12.4 - rests) / 12.4);
        let amps = (0.3 + 0.15 * krpm * krpm * krpm) * (12.4 / open) * (1.0 + day.drifts * t[i]);
        let kept = (-STEP / day.late.1).exp();
        late = kept * late + (1.0 - kept) * amps;
        charge += amps * STEP / 3600.0;
        rpm.push(1000.0 * krpm + 2.0 * chance.normal());
        current.push(amps + 0.02 * chance.normal());
        voltage.push(open - 0.03 * amps + 0.004 * chance.normal());
    }
    let columns = [("pulse_us", pulse), ("rpm", rpm), ("current_a", current), ("voltage_v", voltage)];
    let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
    Log { name: format!("battery-{}.csv", day.seed), t, columns, ..Log::default() }
}

fn names(closed: &Closed) -> Vec<&str> {
    let mut out: Vec<&str> = closed.verdict.effects.iter().map(|e| e.id.as_str()).collect();
    out.sort_unstable();
    out
}

/// A resistance that answers late stands beside the lead's own, each with its size, and is claimed of no battery that has none.
#[test]
fn a_battery_that_answers_late_leaves_the_lead_its_size() {
    let of = |late: (f64, f64)| close(&log(&Day { late, ..DAY }), None, &[], &mut |_| {}).expect("a verdict");
    let holds = |closed: &Closed, (id, name, truth): (&str, &str, f64)| {
        let found = closed.verdict.effects.iter().find(|e| e.id == id).unwrap_or_else(|| panic!("{:?}", names(closed)));
        let size = found.parameters.iter().find(|p| p.name == name).expect(name);
        assert!(size.ci95[0] < truth && truth < size.ci95[1], "{size:?} {truth}");
    };
    let at_once = of((0.0, 1.0));
    assert_eq!(names(&at_once), ["supply_sag"]);
    holds(&at_once, ("supply_sag", "resistance", 0.03));
    for late in [(0.04, 4.0), (0.015, 2.0)] {
        let closed = of(late);
        assert_eq!(names(&closed), ["battery_relaxation", "supply_sag"]);
        holds(&closed, ("supply_sag", "resistance", 0.03));
        holds(&closed, ("battery_relaxation", "resistance", late.0));
        holds(&closed, ("battery_relaxation", "tau", late.1));
        let voltage = &closed.verdict.channels["voltage_v"];
        assert!(voltage.after.heldout_rms < 0.05 * voltage.before.heldout_rms, "{voltage:?}");
    }
}

/// A voltmeter that is slow beside a lead is no battery: nothing of the drop comes at once.
#[test]
fn a_slow_voltmeter_is_no_battery() {
    let mut log = log(&DAY);
    let column = log.columns.iter_mut().find(|column| column.name == "voltage_v").expect("a voltage");
    let kept = (-STEP / 0.5_f64).exp();
    let mut state = column.values[0];
    for value in &mut column.values {
        state = kept * state + (1.0 - kept) * *value;
        *value = state;
    }
    let closed = close(&log, None, &[], &mut |_| {}).expect("a verdict");
    assert_eq!(names(&closed), ["channel_filter", "supply_sag"]);
}

/// A rig without a current sensor and a torque cell: a propeller's current goes with the cube of its speed, and so does what the lead takes.
#[test]
fn a_lead_shows_without_a_current() {
    let mut log = log(&DAY);
    log.columns.retain(|column| column.name != "current_a");
    let closed = close(&log, None, &[], &mut |_| {}).expect("a verdict");
    assert_eq!(names(&closed), ["supply_sag"]);
    let sag = &closed.verdict.effects[0].parameters[0];
    let truth = 0.03 * 0.15; // ohm times A for each (1000 rev/min)^3
    assert!(sag.name == "sag" && sag.unit == "V/krpm3" && (sag.value / truth - 1.0).abs() < 0.05, "{sag:?}");
    let voltage = &closed.verdict.channels["voltage_v"];
    assert!(voltage.after.heldout_rms < 1.2 * voltage.noise_floor_rms, "{voltage:?}");
}

/// A current that creeps up for another reason is not the battery's: a motor asks for no more than its voltage falls.
#[test]
fn a_battery_takes_no_more_current_than_its_voltage_falls() {
    let day = Day { slope: 1.5, drifts: 5e-4, ..DAY };
    let closed = close(&log(&day), None, &[], &mut |_| {}).expect("a verdict");
    let battery = closed.verdict.effects.iter().find(|e| e.id == "battery_discharge");
    let battery = battery.unwrap_or_else(|| panic!("{:?}", names(&closed)));
    let loss = battery.parameters.iter().find(|p| p.name == "speed_loss").map_or(0.0, |p| p.value);
    assert!(loss < 1.5 * day.slope / 12.4, "{loss}");
}

/// An open-circuit voltage is all but straight over the part of it that a run draws; what bends more is something else, and on a longer run
/// a parabola would be volts off.
#[test]
fn a_short_run_tells_of_no_curve() {
    let day = Day { seed: 2, late: (0.05, 12.0), slope: 3.0, rows: 900, ..DAY };
    let longer = log(&Day { seed: 3, rows: 6000, ..day });
    let closed = close(&log(&day), None, &[longer], &mut |_| {}).expect("a verdict");
    let voltage = closed.verdict.validation[0].channels["voltage_v"];
    assert!(voltage.after < 1.05 * voltage.before, "{:?} {voltage:?}", names(&closed));
}

/// From full to a third a cell's voltage falls fast at first and slowly later. Most of what a straight line leaves over goes with the curve.
#[test]
fn a_battery_that_starts_full_follows_its_curve() {
    let day = Day { seed: 4, full_ah: 0.3, ..DAY };
    let closed = close(&log(&day), None, &[], &mut |_| {}).expect("a verdict");
    let battery = closed.verdict.effects.iter().find(|e| e.id == "battery_discharge");
    let battery = battery.unwrap_or_else(|| panic!("{:?}", names(&closed)));
    let value = |name: &str| battery.parameters.iter().find(|p| p.name == name).map_or(0.0, |p| p.value);
    assert!((value("capacity") - day.full_ah).abs() < 0.2 * day.full_ah, "{battery:?}");
    let voltage = &closed.verdict.channels["voltage_v"];
    assert!(voltage.after.heldout_rms < 0.03, "{voltage:?}");
}
