//! A run predicted from its command alone.
//!
//! What it is: rpm from the pulse, everything else from that rpm, voltage from that current, until they agree.
//! What can go wrong: a model identified without a command predicts no speed from one.
//! Units: as the channels.
//! Reference: specification `formats.md`, `predict --from command`.

use crate::context::{Context, Relation};
use crate::log::{Column, Log, SPEED};
use crate::model::Model;

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
    // speed, then what hangs on it, then what hangs on current, and speed again where it hangs on the charge
    for _ in 0..3 {
        for speed_pass in [true, false] {
            let context = Context::new(&log, Some(model.start_pulse_us));
            let names: Vec<&'static str> =
                context.targets.iter().map(|t| t.name).filter(|n| SPEED.contains(n) == speed_pass).collect();
            for name in names {
                if let Some(values) = model.predict(&context, name)
                    && let Some(column) = log.columns.iter_mut().find(|c| c.name == name)
                {
                    column.values = values;
                }
            }
        }
    }
    log
}
