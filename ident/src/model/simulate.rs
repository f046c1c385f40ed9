//! A run predicted from its command alone.
//!
//! What it is: rpm from the pulse, everything else from that rpm, voltage from that current, until they agree.
//! What can go wrong: a model identified without a command predicts no speed from one; a speed that answers to its own load
//! more than one to one may not settle, and the last pass then stands.
//! Units: as the channels.
//! Reference: specification `formats.md`, `predict --from command`.

use crate::channel::{Context, Relation};
use crate::log::{Column, Log, SPEED};
use crate::model::Model;

/// Most passes from speed to current and back.
const MOST_PASSES: usize = 24;
/// Change between two passes, as a share of a channel's largest value, at which they agree.
const CONVERGED: f64 = 1.0e-6;

/// Predicts every channel of the model along a command; `covariates` (temperature and others) are taken as given.
#[must_use]
pub fn from_command(model: &Model, name: &str, t: &[f64], pulse_us: &[f64], covariates: &[Column]) -> Log {
    let mut log = Log { name: name.to_owned(), t: t.to_vec(), ..Log::default() };
    log.columns.push(Column { name: "pulse_us".into(), values: pulse_us.to_vec() });
    for p in model.polynomials.iter().filter(|p| Relation::of(&p.channel, true) != Some(Relation::SpeedDifference)) {
        // a current at the same power from no voltage at all has no end: the supply starts where no load has it
        let start = if p.channel == "voltage_v" { p.coefficients.first().copied().unwrap_or(0.0) } else { 0.0 };
        log.columns.push(Column { name: p.channel.clone(), values: vec![start; t.len()] });
    }
    log.columns.extend(
        covariates.iter().filter(|c| !model.polynomials.iter().any(|p| p.channel == c.name) && c.name != "pulse_us").cloned(),
    );
    // speed, then what hangs on it, then what hangs on current, and speed again where it hangs on the charge or on itself: until
    // nothing moves; from the third pass on half the way only, where a speed that answers to its own load would swing
    for pass in 0..MOST_PASSES {
        let share = if pass < 2 { 1.0 } else { 0.5 };
        let mut moved = 0.0_f64;
        for speed_pass in [true, false] {
            let mut context = Context::new(&log, Some(model.start_pulse_us));
            // nothing was measured: a rotor begins where its command has it
            context.starts.clear();
            let names: Vec<&'static str> =
                context.targets.iter().map(|t| t.name).filter(|n| SPEED.contains(n) == speed_pass).collect();
            for name in names {
                if let Some(values) = model.predict_at_its_own_supply(&context, name)
                    && let Some(column) = log.columns.iter_mut().find(|c| c.name == name)
                {
                    let scale = values.iter().fold(0.0_f64, |m, v| m.max(v.abs())).max(f64::MIN_POSITIVE);
                    for (old, new) in column.values.iter_mut().zip(values) {
                        moved = moved.max((new - *old).abs() / scale);
                        *old += share * (new - *old);
                    }
                }
            }
        }
        if moved < CONVERGED {
            break;
        }
    }
    log
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lead_at_full_load_leaves_the_motor_its_voltage() {
        let text = r#"
            format = "quadrig-model 1"
            source = "lead.csv"
            start_pulse_us = 1000.0
            [consensus]
            channels = ["rpm"]
            [channel.rpm]
            c0_rev_per_min = 0.0
            c1_rev_per_min_per_kus = 19000.0
            c2_rev_per_min_per_kus2 = 0.0
            c3_rev_per_min_per_kus3 = 0.0
            [channel.current_a]
            c0_a = 0.0
            c1_a_per_krpm = 0.0
            c2_a_per_krpm2 = 0.0
            c3_a_per_krpm3 = 0.005
            [channel.voltage_v]
            c0_v = 16.0
            [[effect]]
            id = "supply_sag"
            form = "same_power"
            channels = ["voltage_v", "current_a"]
            scope = "rig"
            shape = [1.33, 15.8]
            [effect.amplitude.voltage_v]
            resistance_ohm = 0.0411
        "#;
        let model = Model::parse("m.toml", text).expect("a model");
        let t: Vec<f64> = (0..200).map(|i| 0.1 * f64::from(i)).collect();
        let run = from_command(&model, "full", &t, &vec![2000.0; t.len()], &[]);
        let last = |name: &str| run.column(name).and_then(|v| v.last().copied()).expect("a prediction");
        let (current, voltage) = (last("current_a"), last("voltage_v"));
        // of the two states that obey both equations it is the one that a loaded supply goes to
        assert!((voltage - (16.0 - 0.0411 * current)).abs() < 1e-3, "{voltage} V at {current} A");
        assert!((30.0..50.0).contains(&current), "{current} A at {voltage} V");
    }
}
