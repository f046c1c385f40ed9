//! Betaflight: lines for its command line.
//!
//! What it is: thrust_linear, so that thrust follows the demand as a straight line as well as that one number can make it; poles, KV, idle.
//! What can go wrong: KV and poles stand in no model but in the head of its log, where that told them.
//! Units: Betaflight's: per cent, hundredths of a per cent.
//! Reference: betaflight/src/main/flight/pid.c, `pidApplyThrustLinearization`: x (1 + L (1 - x)^2), x the demand, L = thrust_linear/100;
//! betaflight/src/main/flight/mixer.c: that share of the range above the idle is the signal.

use super::{Battery, Powerplant, comments, full, off, untold};

const DEFINED: [&str; 4] = [
    "keys: https://betaflight.com/docs/development/Cli",
    "curve: https://github.com/betaflight/betaflight/blob/4.5-maintenance/src/main/flight/pid.c",
    "idle: https://github.com/betaflight/betaflight/blob/4.5-maintenance/src/main/flight/mixer.c",
    "battery: https://github.com/betaflight/betaflight/blob/4.5-maintenance/src/main/cli/settings.c",
];
/// Hundredths of a volt of a cell, highest and lowest (Betaflight's own defaults, for lithium polymer).
const CELL_CV: [u32; 2] = [430, 330];
/// Largest value of the key.
const MOST: u32 = 150;
/// Largest idle that its key takes, hundredths of a per cent.
const MOST_IDLE: f64 = 2000.0;

/// Largest capacity that its key takes, mAh.
const MOST_MAH: u32 = 20_000;

/// Share of the range above the idle that a demand is given.
fn given(demand: f64, linear: f64) -> f64 {
    demand * (1.0 + linear * (1.0 - demand).powi(2))
}

/// Demand that is given this share: what Betaflight takes for the share of thrust.
fn demand(wanted: f64, linear: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if given(middle, linear) < wanted { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// KV that a motor's name states, as "570KV".
fn stated_kv(name: &str) -> Option<u32> {
    let upper = name.to_ascii_uppercase();
    let digits = upper[..upper.find("KV")?].trim_end();
    let start = digits.rfind(|c: char| !c.is_ascii_digit()).map_or(0, |k| k + 1);
    digits[start..].parse().ok()
}

/// The lines.
pub(super) fn text(plant: &Powerplant, battery: Battery) -> String {
    let idle_value = (1e4 * plant.begins()).round().min(MOST_IDLE);
    let idle = 1e-4 * idle_value;
    let square_error = |per_cent: u32| -> f64 {
        let linear = f64::from(per_cent) / 100.0;
        let signal = |demand: f64| idle + (1.0 - idle) * given(demand, linear);
        plant.points.iter().map(|p| (plant.share(signal(p.signal)) - p.signal).powi(2)).sum()
    };
    // given(x) rises all the way up to L of 3, and the key ends long before
    let best = (0..=MOST).min_by(|a, b| square_error(*a).total_cmp(&square_error(*b))).unwrap_or(0);
    let linear = f64::from(best) / 100.0;
    let mut head = vec![plant.title(), full(plant)];
    head.extend(DEFINED.map(str::to_owned));
    head.push(format!(
        "signal = idle + (1 - idle) x (1 + L (1 - x)^2), x the share of full thrust, L = thrust_linear/100, idle = dshot_idle_value/10000; {}",
        off(plant.off_percent(|u| demand(((u - idle) / (1.0 - idle)).max(0.0), linear)))
    ));
    let kv = plant.named[0].as_deref().and_then(stated_kv);
    let lacks = [
        kv.is_none().then(|| "motor_kv: the log's head names no KV".to_owned()),
        plant.pole_pairs.is_none().then(|| "motor_poles: the log's head tells no pole_pairs".to_owned()),
        battery
            .cells
            .is_none()
            .then(|| "force_battery_cell_count, vbat_max_cell_voltage, vbat_min_cell_voltage: the battery that will fly is not known (--cells)".to_owned()),
        battery.no_capacity("bat_capacity"),
        battery
            .capacity_mah
            .filter(|c| *c > MOST_MAH)
            .map(|c| format!("bat_capacity: {c} mAh are more than the {MOST_MAH} that the key takes")),
        Some("vbat_sag_compensation: how much of the sag is made up for is the pilot's choice".to_owned()),
    ];
    head.extend(untold(lacks.into_iter().flatten().chain(plant.beside())));
    let mut out = comments("#", &head);
    if let Some(capacity) = battery.capacity_mah.filter(|c| *c <= MOST_MAH) {
        out += &format!("set bat_capacity = {capacity}\n");
    }
    out += &format!("set dshot_idle_value = {idle_value:.0}\n");
    if let Some(cells) = battery.cells {
        out += &format!("set force_battery_cell_count = {cells}\n");
    }
    if let Some(kv) = kv {
        out += &format!("set motor_kv = {kv}\n");
    }
    if let Some(pairs) = plant.pole_pairs {
        out += &format!("set motor_poles = {}\n", 2 * pairs);
    }
    out += &format!("set thrust_linear = {best}\n");
    if battery.cells.is_some() {
        let [most, least] = CELL_CV;
        out += &format!("set vbat_max_cell_voltage = {most}\nset vbat_min_cell_voltage = {least}\n");
    }
    out + "save\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_demand_is_the_inverse_of_what_it_is_given() {
        for k in 0..=20 {
            let x = f64::from(k) / 20.0;
            assert!((demand(given(x, 0.7), 0.7) - x).abs() < 1e-9, "{x}");
        }
    }

    #[test]
    fn a_name_may_state_a_kv() {
        assert_eq!(["570KV", "F40 2400 kv", "F60", "KV"].map(stated_kv), [Some(570), Some(2400), None, None]);
    }
}
