//! What a board says of its own readings: flags, raw codes, events.
//!
//! What it is: a log that our board recorded carries the verdict of each channel (`<channel>_flag`, a number, empty where nominal), on
//! request the raw codes (`raw_*`), and what happened with its time (`event`). Here it is told apart from what was measured: none of it
//! explains a residual, and a speed that is flagged as wrong does not vote.
//! What can go wrong: a number that the head of the log does not explain is told as a number.
//! Units: s.
//! Reference: specification `formats.md`, "Rig log".

use crate::log::join::is_second_reading;
use crate::log::{Log, MODELLED};
use std::fmt;

/// Speed channels and the columns in which their board tells how far their two marks stand off their opposite places.
pub(crate) const UNEVEN: [(&str, &str); 4] = [
    ("rpm_beam", "uneven_beam_deg"),
    ("rpm_opto", "uneven_opto_deg"),
    ("rpm_hall", "uneven_hall_deg"),
    ("rpm_encoder", "uneven_encoder_deg"),
];

/// Whether a column tells of marks: it explains no residual.
pub(crate) fn is_of_marks(column: &str) -> bool {
    UNEVEN.iter().any(|(_, name)| *name == column)
}

/// End of the name of a column of flags.
const FLAG: &str = "_flag";
/// Beginning of the name of a column of raw codes.
const RAW: &str = "raw_";
/// Flags of a speed that is wrong: lost, an edge overwritten, a mark missed or seen twice, disagreement. Marks that stand unevenly and blades
/// that twist leave the time of a whole revolution as it is.
const WRONG: [f64; 5] = [2.0, 3.0, 4.0, 5.0, 7.0];

/// Speed, current, voltage and charge as an ESC tells them, speed of a back-EMF meter: second readings of what is measured already. As a
/// cause they would explain their own channel's residual by itself. The ESC's temperature is none of these.
const SECOND: [&str; 5] = ["rpm_esc", "current_esc_a", "voltage_esc_v", "charge_esc_mah", "rpm_bemf"];

/// Whether a column tells of the board's readings, or tells one of them again, and is none itself.
pub(crate) fn is_of_the_board(column: &str) -> bool {
    column.ends_with(FLAG) || column.starts_with(RAW) || SECOND.contains(&column) || is_second_reading(column)
}

/// Whether a key of a log's head belongs to the evidence of its recording, and not to the rig that a model is of.
pub(crate) fn is_evidence(key: &str) -> bool {
    key.starts_with("calibration_") || ["flags", "rig_config", "schedule", "timer_hz"].contains(&key)
}

/// The flags of a channel, a number a row.
#[must_use]
pub fn flags<'l>(log: &'l Log, channel: &str) -> Option<&'l [f64]> {
    log.columns.iter().find(|c| c.name.strip_suffix(FLAG) == Some(channel)).map(|c| c.values.as_slice())
}

/// Whether a flag says that the speed beside it is wrong.
pub(crate) fn is_wrong(flag: f64) -> bool {
    WRONG.contains(&flag)
}

/// What a board flagged on one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Flagged {
    /// Column.
    pub channel: String,
    /// Number of the flag, and its words where the head of the log has them.
    pub flag: u32,
    /// The same in words.
    pub words: String,
    /// Samples that carry it.
    pub samples: usize,
    /// Time of the first and of the last, s; rows where the log has no time.
    pub span_s: (f64, f64),
    /// Of a log without a time.
    pub timeless: bool,
}

impl fmt::Display for Flagged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { channel, words, samples, span_s: (from, to), .. } = self;
        match samples {
            1 if self.timeless => write!(f, "{channel}: {words} in row {from:.0}"),
            _ if self.timeless => write!(f, "{channel}: {words} in {samples} samples of rows {from:.0} to {to:.0}"),
            1 => write!(f, "{channel}: {words} in a sample at {from:.3} s"),
            _ => write!(f, "{channel}: {words} in {samples} samples from {from:.3} to {to:.3} s"),
        }
    }
}

/// Everything that the board of a log flagged, channel by channel, by the number of the flag.
#[must_use]
pub fn flagged(log: &Log) -> Vec<Flagged> {
    let mut all: Vec<Flagged> = Vec::new();
    let [telemetry, .., meter] = SECOND;
    for channel in MODELLED.into_iter().chain(["temp_c", telemetry, meter]) {
        let Some(flags) = flags(log, channel) else { continue };
        let begun = all.len();
        for (t, flag) in log.t.iter().zip(flags).filter(|(_, flag)| flag.is_finite()) {
            let number = *flag as u32;
            match all[begun..].iter_mut().find(|f| f.flag == number) {
                Some(known) => (known.samples, known.span_s.1) = (known.samples + 1, *t),
                None => all.push(Flagged {
                    channel: channel.to_owned(),
                    flag: number,
                    words: words(log, number),
                    samples: 1,
                    span_s: (*t, *t),
                    timeless: log.time_is_row(),
                }),
            }
        }
        all[begun..].sort_by_key(|f| f.flag);
    }
    all
}

/// Words of a flag from the head of the log.
fn words(log: &Log, flag: u32) -> String {
    let known = log.meta.get("flags").and_then(|table| table.get(flag.to_string())).and_then(toml::Value::as_str);
    known.map_or_else(|| format!("flag {flag}"), str::to_owned)
}

/// What the board told of a run, in lines for people: flags, then events.
#[must_use]
pub fn told(log: &Log) -> Vec<String> {
    flagged(log).iter().map(ToString::to_string).chain(log.events.iter().cloned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::Context;

    fn log() -> Log {
        let mut text = String::from(
            "# quadrig-log 1\n# flags = { 2 = \"lost\", 11 = \"saturated\" }\n# event = \"3.000 s: stopped\"\n\
             t_s,pulse_us,rpm_beam,rpm_hall,thrust_n,thrust_n_flag,rpm_beam_flag,raw_thrust_n_sum\n",
        );
        for n in 0..200 {
            let wrong = (60..90).contains(&n);
            let beam = if wrong { 6000 } else { 3000 };
            let flag = if wrong { "5" } else { "" };
            let clipped = if n == 7 { "11" } else { "" };
            text += &format!("{},1500,{beam},3000,2.0,{clipped},{flag},{}\n", f64::from(n) * 0.1, 1000 + n);
        }
        Log::parse("run.csv", text.as_bytes()).unwrap()
    }

    #[test]
    fn flags_and_codes_explain_nothing() {
        let context = Context::new(&log(), None);
        assert!(context.covariates.is_empty(), "{:?}", context.covariates.iter().map(|c| &c.0).collect::<Vec<_>>());
        assert!(!context.targets.iter().any(|t| is_of_the_board(t.name)));
    }

    /// What an ESC and a back-EMF meter say again is no cause; how warm the ESC is may be one. A flag on them is told.
    #[test]
    fn a_second_reading_explains_nothing() {
        let mut text = String::from("# quadrig-log 1\n# flags = { 21 = \"nothing heard\" }\n");
        text += "t_s,pulse_us,rpm_hall,rpm_esc,current_esc_a,voltage_esc_v,temp_esc_c,charge_esc_mah,rpm_bemf,rpm_esc_flag\n";
        for n in 0..200 {
            let flag = if n == 9 { "21" } else { "" };
            text += &format!("{},1500,3000,3005,{},11.4,{},{n},3001,{flag}\n", f64::from(n) * 0.1, n % 7, 30 + n / 50);
        }
        let log = Log::parse("run.csv", text.as_bytes()).unwrap();
        let context = Context::new(&log, None);
        assert_eq!(context.covariates.iter().map(|c| c.0.as_str()).collect::<Vec<_>>(), ["temp_esc_c"]);
        assert_eq!(context.targets.iter().map(|t| t.name).collect::<Vec<_>>(), ["rpm_hall"]);
        assert_eq!(told(&log), ["rpm_esc: nothing heard in a sample at 0.900 s"]);
    }

    /// Of two channels that disagree the board's word decides; without it the rows around do, and where they tell nothing both are kept.
    #[test]
    fn a_speed_that_the_board_flags_as_wrong_does_not_vote() {
        let rpm = Context::bare(&log(), None).rpm;
        assert!(rpm.iter().all(|rpm| (rpm - 3000.0).abs() < 1.0), "{rpm:?}");
        let mut silent = log();
        silent.columns.retain(|c| c.name != "rpm_beam_flag");
        assert!((Context::bare(&silent, None).rpm[75] - 3000.0).abs() < 1.0, "the rows around tell which is wrong");
        silent.t.drain(..60);
        silent.columns.iter_mut().for_each(|column| drop(column.values.drain(..60)));
        assert!(Context::bare(&silent, None).rpm[15] > 4000.0, "nothing tells before they first agree");
    }

    #[test]
    fn what_the_board_told_is_told() {
        assert_eq!(
            told(&log()),
            [
                "rpm_beam: flag 5 in 30 samples from 6.000 to 8.900 s",
                "thrust_n: saturated in a sample at 0.700 s",
                "3.000 s: stopped"
            ]
        );
    }
}
