//! Channels with too few samples to be judged.
//!
//! What it is: which measured columns hold some samples but no more than [`TOO_FEW`], and the log as it is without them: a sensor that
//! answered three times in a run must not cost the verdict on all others.
//! What can go wrong: nothing is left out silently; the verdict names each such channel with its number of samples.
//! Units: samples.
//! Reference: specification `formats.md`, an empty field is a missing sample.

use crate::log::{Log, MODELLED};
use serde::Serialize;
use std::borrow::Cow;
use std::fmt;

/// Samples up to which nothing can be said of a channel: a cubic and the scatter about it need more.
pub const TOO_FEW: usize = 8;

/// A channel that was left out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// Its column.
    pub channel: String,
    /// How many samples it holds.
    pub samples: usize,
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = if self.samples == 1 { "" } else { "s" };
        let Self { channel, samples } = self;
        write!(f, "column {channel}: {samples} sample{plural}; expected more than {TOO_FEW}; the channel is left out")
    }
}

/// The measured channels of a log that hold a sample but at most [`TOO_FEW`]. A column without any sample is no channel, and a log
/// of that few rows has no channel that is better off.
#[must_use]
pub fn left_out(log: &Log) -> Vec<LeftOut> {
    if log.len() <= TOO_FEW {
        return Vec::new();
    }
    let judged = |name: &str| MODELLED.contains(&name) || name == "thrust_rms_n";
    let of =
        |c: &crate::log::Column| LeftOut { channel: c.name.clone(), samples: c.values.iter().filter(|v| v.is_finite()).count() };
    log.columns.iter().filter(|c| judged(&c.name)).map(of).filter(|l| (1..=TOO_FEW).contains(&l.samples)).collect()
}

/// The log without these channels.
#[must_use]
pub fn without<'l>(log: &'l Log, left_out: &[LeftOut]) -> Cow<'l, Log> {
    if left_out.is_empty() {
        return Cow::Borrowed(log);
    }
    let kept = log.columns.iter().filter(|c| left_out.iter().all(|l| l.channel != c.name));
    Cow::Owned(Log {
        name: log.name.clone(),
        meta: log.meta.clone(),
        events: log.events.clone(),
        t: log.t.clone(),
        columns: kept.cloned().collect(),
        sha256: log.sha256.clone(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    #[test]
    fn eight_samples_are_too_few_and_nine_are_not() {
        let column = |name: &str, samples: usize| Column {
            name: name.to_owned(),
            values: (0..30).map(|i| if i < samples { 1.0 } else { f64::NAN }).collect(),
        };
        let columns = vec![column("voltage_v", 8), column("thrust_n", 9), column("rpm_hall", 0), column("humidity", 2)];
        let log = Log { t: (0..30).map(f64::from).collect(), columns, ..Log::default() };
        let found = left_out(&log);
        assert_eq!(found, [LeftOut { channel: "voltage_v".into(), samples: 8 }]);
        assert!(without(&log, &found).column("voltage_v").is_none());
        assert_eq!(without(&log, &found).columns.len(), 3);
        assert_eq!(found[0].to_string(), "column voltage_v: 8 samples; expected more than 8; the channel is left out");
    }
}
