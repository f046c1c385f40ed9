//! The table of levels that `identify --table` writes, read again.
//!
//! What it is: `plateau,from_s,to_s,rows` and each figure with its standard error; thrust is less its zero already.
//! What can go wrong: another header, a number that is none, a line that is cut off: refused with file, line and column.
//! Units: s, N, A, and those of the columns' names.
//! Reference: [`crate::identify::curves::csv`].

use crate::log::{Column, Lines, Log, ReadError, short};
use crate::plateau::Plateau;
use std::io::BufRead;

/// How the header begins.
pub const LEVELS: [&str; 4] = ["plateau", "from_s", "to_s", "rows"];

/// The levels of a table, and a log without rows that holds their columns; `file` is the table's name for messages, `name` the log's.
///
/// # Errors
/// [`ReadError`] with file, line and column.
pub fn read_levels(file: &str, name: &str, source: impl BufRead) -> Result<(Log, Vec<Plateau>), ReadError> {
    let mut lines = Lines::new(file, source);
    let mut head: Vec<String> = Vec::new();
    let mut plateaus = Vec::new();
    while let Some(line) = lines.next_line()? {
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let (place, cells) = (lines.place(), line.split(',').map(str::trim).collect::<Vec<_>>());
        if head.is_empty() {
            let wanted = ["thrust_n", "current_a"].iter().find(|c| !cells.contains(c));
            if let Some(missing) = wanted {
                return Err(place.refuse(Some(missing), "no such column", "the table as `identify --table` writes it"));
            }
            head = cells.into_iter().map(str::to_owned).collect();
            continue;
        }
        if cells.len() != head.len() {
            let found = format!("{} fields", cells.len());
            return Err(place.refuse(None, found, format!("{} as in the header", head.len())));
        }
        let number = |k: usize| match cells[k] {
            "" => Ok(None),
            text => match text.parse::<f64>() {
                Ok(v) if v.is_finite() => Ok(Some(v)),
                _ => Err(place.refuse(Some(&head[k]), format!("'{}'", short(text)), "a number, or nothing")),
            },
        };
        let values = (0..head.len()).map(number).collect::<Result<Vec<_>, _>>()?;
        let at = |k: usize| values[k].unwrap_or(f64::NAN);
        let means = (LEVELS.len()..head.len()).step_by(2).map(|k| Some((values[k]?, values.get(k + 1).copied().flatten()?)));
        let (from_s, to_s, rows) = (at(1), at(2), at(3) as usize);
        plateaus.push(Plateau { from_s, to_s, first: 0, rows, settling_s: 0.0, means: means.collect() });
    }
    let columns = head.iter().skip(LEVELS.len()).step_by(2).map(|c| Column { name: c.clone(), values: Vec::new() }).collect();
    Ok((Log { name: name.to_owned(), columns, ..Log::default() }, plateaus))
}

#[cfg(test)]
mod tests {
    use super::super::from_log;
    use super::*;

    #[test]
    fn the_level_with_most_thrust_is_the_maximum() {
        let head = "plateau,from_s,to_s,rows,thrust_n,thrust_n_se,current_a,current_a_se\n";
        let text = format!("{head}1,0.1,1,9,0.02,0.01,0.1,0.1\n2,1.1,2,9,5.1,0.02,9,0.1\n3,2.1,3,9,,,4,0.1\n");
        let (log, plateaus) = read_levels("o/p.csv", "p.csv", text.as_bytes()).expect("a table");
        let pair = from_log(&log, &plateaus);
        let most = pair.maximum.expect("a level");
        assert_eq!((most.thrust_n.0, most.current_a.0, pair.levels.len()), (5.1, 9.0, 2));
        for (text, wanted) in [
            (format!("{head}1,0,1,9,x,0,1,0\n"), "p.csv:2: column thrust_n: 'x'; expected a number, or nothing"),
            (format!("{head}1,0,1,9\n"), "p.csv:2: 4 fields; expected 8 as in the header"),
            ("plateau,from_s,to_s,rows,rpm,rpm_se\n".to_owned(), "p.csv:1: column thrust_n: no such column"),
        ] {
            let told = read_levels("p.csv", "p.csv", text.as_bytes()).unwrap_err().to_string();
            assert!(told.contains(wanted), "{told}");
        }
    }
}
