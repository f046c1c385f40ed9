//! Pulses from a file.
//!
//! What it is: a CSV table with `t_s` and columns `pulse_us_1`, `pulse_us_2`, ...; each value holds until the next row. Other columns
//! and lines that begin with `#` are passed over, so that the log of a flight can be flown again.
//! What can go wrong: a table without such a column, a time that does not rise, or a pulse out of its range is refused with file, line and
//! column. An empty field keeps the pulse before it.
//! Units: s, us.
//! Reference: specification `flight.md`, "Missions".

use crate::scenario::{ScenarioError, text_of};
use std::path::Path;

/// Pulses over time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PulseTable {
    t_s: Vec<f64>,
    /// Rotor (from 0) and its pulses, one a row.
    columns: Vec<(usize, Vec<f64>)>,
}

/// A field of the table: where it stands and what it says.
struct Field<'a> {
    line: usize,
    column: usize,
    text: &'a str,
}

/// The fields of a line with the columns at which they begin, from 1.
fn fields(line: usize, text: &str) -> Vec<Field<'_>> {
    let mut column = 1;
    text.split(',')
        .map(|text| {
            let field = Field { line, column, text: text.trim() };
            column += text.chars().count() + 1;
            field
        })
        .collect()
}

impl Field<'_> {
    fn refuse(&self, file: &Path, expected: &str) -> ScenarioError {
        let reason = format!("expected {expected}, found {:?}", self.text.chars().take(40).collect::<String>());
        ScenarioError::Refused { file: file.to_owned(), line: self.line, column: self.column, reason }
    }

    fn number(&self, file: &Path, expected: &str, ok: impl Fn(f64) -> bool) -> Result<f64, ScenarioError> {
        self.text.parse::<f64>().ok().filter(|v| ok(*v)).ok_or_else(|| self.refuse(file, expected))
    }
}

impl PulseTable {
    /// Reads a table for an airframe with `rotors` of them.
    ///
    /// # Errors
    /// [`ScenarioError::Unreadable`], or [`ScenarioError::Refused`] with line and column.
    pub fn load(file: &Path, rotors: usize) -> Result<Self, ScenarioError> {
        Self::parse(&text_of(file)?, file, rotors)
    }

    fn parse(text: &str, file: &Path, rotors: usize) -> Result<Self, ScenarioError> {
        let wanted = text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty() && !l.starts_with('#'));
        let mut lines = wanted.map(|(i, l)| fields(i + 1, l.trim_end_matches('\r')));
        let header = lines.next().unwrap_or_else(|| fields(1, ""));
        if header[0].text != "t_s" {
            return Err(header[0].refuse(file, "a header that begins with t_s"));
        }
        let mut table = Self::default();
        let mut places = Vec::new();
        for (place, name) in header.iter().enumerate() {
            let Some(number) = name.text.strip_prefix("pulse_us_") else { continue };
            let rotor = number.parse::<usize>().ok().filter(|r| (1..=rotors).contains(r));
            let rotor = rotor.ok_or_else(|| name.refuse(file, &format!("pulse_us_1 to pulse_us_{rotors}")))?;
            if table.columns.iter().any(|(r, _)| *r == rotor - 1) {
                return Err(name.refuse(file, "each column once"));
            }
            table.columns.push((rotor - 1, Vec::new()));
            places.push(place);
        }
        if places.is_empty() {
            return Err(header[0].refuse(file, "a column pulse_us_1 beside it"));
        }
        for row in lines {
            if row.len() != header.len() {
                return Err(row[row.len() - 1].refuse(file, &format!("{} fields as in the header", header.len())));
            }
            let last = table.t_s.last().copied().unwrap_or(f64::NEG_INFINITY);
            table.t_s.push(row[0].number(file, "a time after that of the row before", |t| t.is_finite() && t > last)?);
            for (place, (_, pulses)) in places.iter().zip(&mut table.columns) {
                let field = &row[*place];
                let before = pulses.last().copied().filter(|_| field.text.is_empty());
                let read = || field.number(file, "a pulse from 1000 to 2000 us", |p| (1000.0..=2000.0).contains(&p));
                pulses.push(before.map_or_else(read, Ok)?);
            }
        }
        if table.t_s.is_empty() { Err(header[0].refuse(file, "a row under the header")) } else { Ok(table) }
    }

    /// Pulse of a rotor (from 0) at a time, us; `None` of a rotor without a column. Before the first row that of the first.
    #[must_use]
    pub fn pulse_us(&self, rotor: usize, t_s: f64) -> Option<f64> {
        let (_, pulses) = self.columns.iter().find(|(r, _)| *r == rotor)?;
        let row = self.t_s.partition_point(|t| *t <= t_s + 1.0e-9).max(1) - 1;
        pulses.get(row).copied()
    }

    /// Time of the last row, s.
    #[must_use]
    pub fn length_s(&self) -> f64 {
        self.t_s.last().copied().unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<PulseTable, String> {
        PulseTable::parse(text, Path::new("p.csv"), 4).map_err(|e| e.to_string())
    }

    #[test]
    fn a_value_holds_until_the_next_row() {
        let table = parse("# quadrig-flight 1\nt_s,pulse_us_3,rpm_1\n0,1500,3\n1.5,,4\n2,1600,\n").unwrap();
        assert_eq!([-1.0, 0.0, 1.9, 2.0, 9.0].map(|t| table.pulse_us(2, t)), [1500.0, 1500.0, 1500.0, 1600.0, 1600.0].map(Some));
        assert_eq!((table.pulse_us(0, 0.0), table.length_s()), (None, 2.0));
    }

    #[test]
    fn refusals_name_the_place() {
        for (text, start, word) in [
            ("", "p.csv:1:1: ", "t_s"),
            ("t_s,rpm_1\n0,1\n", "p.csv:1:1: ", "pulse_us_1"),
            ("t_s,pulse_us_5\n", "p.csv:1:5: ", "pulse_us_4"),
            ("t_s,pulse_us_1,pulse_us_1\n", "p.csv:1:16: ", "once"),
            ("t_s,pulse_us_1\n0,1500\n0,1500\n", "p.csv:3:1: ", "after"),
            ("t_s,pulse_us_1\n0,2500\n", "p.csv:2:3: ", "1000 to 2000"),
            ("t_s,pulse_us_1\n0,NaN\n", "p.csv:2:3: ", "1000 to 2000"),
            ("t_s,pulse_us_1\n0,\n", "p.csv:2:3: ", "1000 to 2000"),
            ("t_s,pulse_us_1\n0\n", "p.csv:2:1: ", "2 fields"),
            ("t_s,pulse_us_1\n", "p.csv:1:1: ", "a row"),
        ] {
            let said = parse(text).unwrap_err();
            assert!(said.starts_with(start) && said.contains(word), "{text:?}: {said}");
        }
    }
}
