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
        log.columns.push(Column { name: p.channel.clone(), values: vec![0.0; t.len()] });
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
