//! The pulses of a log, flight or run, as a schedule.
//!
//! What it is: the column of a CSV log with a time column `t_s`; each row's pulse is held until the next row's time.
//! What can go wrong: a missing column, a time that does not rise and a pulse beyond 1000 to 2000 us are refused with line and column. An
//! empty cell holds the pulse before it.
//! Units: s, us; rows are brought to whole milliseconds without drift.
//! Reference: specification `formats.md`, "Rig log"; `flight.md`, "Flight log".

use crate::error::ScheduleError;
use crate::part::{Part, raw};
use crate::table;
use frame::schedule::{Segment, Shape};
use frame::units::PulseWidth;
use std::path::Path;

/// What of a log is replayed.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    /// The column with the pulses; `pulse_us` of a rig's log, `pulse_us_1` and on of a flight's.
    pub column: String,
    /// Begin and end in the log's own time, s.
    pub from_s: f64,
    /// End.
    pub until_s: f64,
}

impl Default for Replay {
    /// The whole of a rig's log.
    fn default() -> Self {
        Self { column: "pulse_us".to_owned(), from_s: f64::NEG_INFINITY, until_s: f64::INFINITY }
    }
}

/// One row: the instant in ms from the first one that is replayed, and the pulse.
type Row = (u64, PulseWidth);

/// The part of a schedule that replays a log.
///
/// # Errors
/// [`ScheduleError`] with line and column of the log.
pub fn replay(path: &Path, what: &Replay) -> Result<Part, ScheduleError> {
    let text = ScheduleError::text_of(path)?;
    let rows = rows(&text, path, what)?;
    let last = rows.len().checked_sub(2).map_or(1, |before| rows[before + 1].0 - rows[before].0);
    let mut segments: Vec<Segment> = Vec::new();
    for (n, (at, pulse)) in rows.iter().enumerate() {
        let length_ms = rows.get(n + 1).map_or(last, |next| next.0 - at) as u32;
        match segments.last_mut() {
            Some(before) if before.pulse == *pulse => before.length_ms += length_ms,
            _ => segments.push(Segment { pulse: *pulse, length_ms, shape: Shape::Hold }),
        }
    }
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    Ok(raw(format!("replay of {} of {name}", what.column), segments))
}

/// The rows that are replayed, no two at one millisecond.
fn rows(text: &str, path: &Path, what: &Replay) -> Result<Vec<Row>, ScheduleError> {
    let refuse = |line: usize, column: usize, reason: String| ScheduleError::Refused {
        file: path.to_owned(),
        line: line + 1,
        column,
        reason,
    };
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.starts_with('#') && !line.trim().is_empty());
    let (head_line, head) = lines.next().ok_or_else(|| refuse(0, 1, "expected a log with a line of column names".to_owned()))?;
    let names: Vec<&str> = head.split(',').map(str::trim).collect();
    let find = |name: &str| {
        let there = names.iter().filter(|n| n.starts_with("pulse_us")).copied().collect::<Vec<_>>().join(", ");
        let there = if there.is_empty() { "it has no pulses".to_owned() } else { format!("its pulses are {there}") };
        names
            .iter()
            .position(|n| *n == name)
            .ok_or_else(|| refuse(head_line, 1, format!("no column {name:?}; expected a column of pulses; {there}")))
    };
    let (time, pulse) = (find("t_s")?, find(&what.column)?);
    let mut rows: Vec<Row> = Vec::new();
    let (mut first_s, mut before_s, mut held) = (None, f64::NEG_INFINITY, None);
    for (n, line) in lines {
        let cell = |column: usize| {
            let cells: Vec<&str> = line.split(',').collect();
            let place = cells.iter().take(column).map(|c| c.chars().count() + 1).sum::<usize>() + 1;
            (cells.get(column).map_or("", |c| c.trim()).to_owned(), place)
        };
        let (t, place) = cell(time);
        let t_s: f64 = t.parse().map_err(|_| refuse(n, place, format!("t_s: expected a time, found {t:?}")))?;
        if !(t_s > before_s && t_s.is_finite()) {
            return Err(refuse(n, place, format!("t_s: expected a time after {before_s}, found {t_s}")));
        }
        before_s = t_s;
        let (us, place) = cell(pulse);
        if !us.is_empty() {
            let number: f64 =
                us.parse().map_err(|_| refuse(n, place, format!("{}: expected a pulse, found {us:?}", what.column)))?;
            if !(1000.0..=2000.0).contains(&number) {
                return Err(refuse(n, place, format!("{}: expected a pulse from 1000 to 2000 us, found {number}", what.column)));
            }
            held = Some(table::pulse(number));
        }
        if !(what.from_s..=what.until_s).contains(&t_s) {
            continue;
        }
        let Some(pulse) = held else { continue };
        let at = ((t_s - *first_s.get_or_insert(t_s)) * 1000.0).round() as u64;
        match rows.last_mut() {
            Some(before) if before.0 == at => before.1 = pulse, // faster than a millisecond: the latest counts
            _ => rows.push((at, pulse)),
        }
    }
    if rows.is_empty() {
        return Err(refuse(
            head_line,
            1,
            format!(
                "no pulse of {:?} lies in the time that is asked for; expected from_s and until_s within the log",
                what.column
            ),
        ));
    }
    Ok(rows)
}
