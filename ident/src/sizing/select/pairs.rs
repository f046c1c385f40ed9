//! Where the pairs come from: the thesis' figures, a table of one's own, or a run.
//!
//! What it is: a small CSV reader (`motor,propeller,thrust_n,current_a`), and the maximum over the plateaus of a log.
//! What can go wrong: a wrong header, a number that is none, a thrust without a current: refused with file, line and column.
//! Units: N, A.
//! Reference: `thesis.csv` beside this file; errata, "Table 9 agrees with itself".

use super::{Maximum, Pair};
use crate::identify::curves::{Zero, speeds};
use crate::log::quantity::{Ampere, Newton};
use crate::log::{Lines, Log, Place, ReadError, SPEED, short};
use crate::plateau::Plateau;
use std::io::BufRead;

/// The header of a table of pairs.
const HEADER: [&str; 4] = ["motor", "propeller", "thrust_n", "current_a"];

/// Least and largest thrust, N, and current, A, of a pair: a meter's last digit, and a hundred motors that carry a person.
const READ: [f64; 2] = [1e-3, 1e5];

/// Why a line of a table has no result, as far as the table tells.
const NO_FIGURES: &str = "its line states neither thrust nor current";
/// The same of the thesis' one pair without.
const NOT_STARTED: &str = "the thesis states none; simulated, this motor does not start this propeller";

/// The figures that the thesis states.
///
/// # Panics
/// Never: the table is part of the program and read by a test.
#[must_use]
pub fn thesis() -> Vec<Pair> {
    let mut pairs = read_table("thesis.csv", include_str!("thesis.csv").as_bytes()).unwrap_or_default().pairs;
    pairs.iter_mut().filter(|p| p.without.is_some()).for_each(|p| p.without = Some(NOT_STARTED.to_owned()));
    pairs
}

/// Pairs of a table, and why lines of it hold none.
#[derive(Debug, Default)]
pub struct Table {
    /// The pairs, in the order of the lines.
    pub pairs: Vec<Pair>,
    /// What each line that was left out has wrong.
    pub left_out: Vec<ReadError>,
}

/// Reads a table of pairs; `file` is the name for messages. A line that holds no pair is left out: it costs no other line.
///
/// # Errors
/// [`ReadError`] with file, line and column where the header is another one or no line holds a pair.
pub fn read_table(file: &str, source: impl BufRead) -> Result<Table, ReadError> {
    let mut lines = Lines::new(file, source);
    let mut header = false;
    let mut table = Table::default();
    let mut places: Vec<usize> = Vec::new();
    while let Some(line) = lines.next_line()? {
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let place = lines.place();
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        if !header {
            if cells != HEADER {
                return Err(place.refuse(None, format!("header '{}'", short(&line)), format!("'{}'", HEADER.join(","))));
            }
            header = true;
            continue;
        }
        match pair(&cells, file, &place, &table.pairs, &places) {
            Ok(pair) => {
                places.push(place.line);
                table.pairs.push(pair);
            }
            Err(why) => table.left_out.push(why),
        }
    }
    if table.pairs.is_empty() {
        let none = || lines.place().refuse(None, "no pair", format!("'{}' and one line for each pair", HEADER.join(",")));
        return Err(table.left_out.into_iter().next().unwrap_or_else(none));
    }
    Ok(table)
}

/// The pair of one line; `places` are the lines of those that were read before.
fn pair(cells: &[&str], file: &str, place: &Place<'_>, known: &[Pair], places: &[usize]) -> Result<Pair, ReadError> {
    let [motor, propeller, thrust, current] = *cells else {
        return Err(place.refuse(None, format!("{} fields", cells.len()), "4 as in the header"));
    };
    if let Some((column, _)) = HEADER.iter().zip([motor, propeller]).find(|(_, name)| name.is_empty()) {
        return Err(place.refuse(Some(column), "an empty field", "a name: the choice names each pair"));
    }
    let same = known.iter().zip(places).find(|(p, _)| p.motor == motor && p.propeller == propeller);
    if let Some((_, line)) = same {
        let found = format!("'{motor}' with '{propeller}' stands on line {line}, too");
        return Err(place.refuse(None, found, "each pair once: take one line out, or give them names of their own"));
    }
    let maximum = maximum(thrust, current, place)?;
    Ok(Pair {
        motor: motor.to_owned(),
        propeller: propeller.to_owned(),
        maximum,
        clipped: false,
        levels: Vec::new(),
        without: maximum.is_none().then(|| NO_FIGURES.to_owned()),
        source: file.to_owned(),
    })
}

fn maximum(thrust: &str, current: &str, place: &Place<'_>) -> Result<Option<Maximum>, ReadError> {
    if thrust.is_empty() && current.is_empty() {
        return Ok(None);
    }
    let positive = |text: &str, column: &str| match text.parse::<f64>() {
        Ok(v) if (READ[0]..=READ[1]).contains(&v) => Ok(v),
        Ok(v) if v > 0.0 => Err(place.refuse(
            Some(column),
            format!("'{}'", short(text)),
            format!("a number that a sensor can read ({} to {}), in the unit of the column's name", READ[0], READ[1]),
        )),
        _ => Err(place.refuse(
            Some(column),
            format!("'{}'", short(text)),
            "a positive number (both fields empty for a pair without a result)",
        )),
    };
    Ok(Some(Maximum { thrust_n: Newton(positive(thrust, HEADER[2])?), current_a: Ampere(positive(current, HEADER[3])?) }))
}

/// The pair that a run measured: its plateaus, thrust less what it reads at rest, the one with most thrust, names from the log's metadata.
#[must_use]
pub fn from_log(log: &Log, plateaus: &[Plateau]) -> Pair {
    let told = |key: &str| log.meta.get(key).and_then(toml::Value::as_str).filter(|n| !n.trim().is_empty()).map(str::to_owned);
    // a run that names neither is told from others by its file
    let (motor, propeller) = match [told("motor"), told("propeller")] {
        [None, None] => (log.name.clone(), UNNAMED.to_owned()),
        [motor, propeller] => (
            motor.unwrap_or_else(|| format!("motor of {}", log.name)),
            propeller.unwrap_or_else(|| format!("propeller of {}", log.name)),
        ),
    };
    let index = |name: &str| log.columns.iter().position(|c| c.name == name);
    let zero = Zero::of(log, plateaus, &speeds(log, plateaus, &[]), "thrust_n");
    let levels: Vec<Maximum> = match (index("thrust_n"), index("current_a")) {
        (Some(t), Some(i)) => plateaus
            .iter()
            .filter_map(|p| {
                let thrust = Zero::off(zero.as_ref(), p.middle_s(), p.means.get(t).copied().flatten()?);
                Some((thrust.0, p.means.get(i).copied().flatten()?.0))
            })
            .map(|(thrust, current)| Maximum { thrust_n: Newton(thrust), current_a: Ampere(current) })
            .collect(),
        _ => Vec::new(),
    };
    let maximum = levels.iter().copied().filter(|m| m.current_a.0 > 0.0 && m.thrust_n.0 > 0.0);
    Pair {
        motor,
        propeller,
        clipped: clipped(log, plateaus),
        maximum: maximum.max_by(|a, b| a.thrust_n.0.total_cmp(&b.thrust_n.0)),
        levels,
        without: None,
        source: log.name.clone(),
    }
}

impl Pair {
    /// The pair's name, and why it gave no result where that is known.
    #[must_use]
    pub fn without_result(&self) -> String {
        self.without.as_ref().map_or_else(|| self.name(), |why| format!("{} ({why})", self.name()))
    }

    /// Motor and propeller in words; a run that names neither is called by its file.
    #[must_use]
    pub fn name(&self) -> String {
        if self.propeller == UNNAMED { self.motor.clone() } else { format!("{} with {}", self.motor, self.propeller) }
    }
}

/// What stands for the propeller of a run that names neither motor nor propeller.
const UNNAMED: &str = "not named";

/// Share of the rise that the square of the speed asks for, below which a thrust reading no longer follows.
const FOLLOWS: f64 = 0.5;

/// Whether thrust rises from the last but one speed level to the last by less than half of what the square of the speed asks for, three
/// standard errors aside.
fn clipped(log: &Log, plateaus: &[Plateau]) -> bool {
    let Some(speed) = SPEED.into_iter().find(|s| log.column(s).is_some()) else { return false };
    let mut levels: Vec<[(f64, f64); 2]> =
        plateaus.iter().filter_map(|p| Some([p.of(log, speed)?, p.of(log, "thrust_n")?])).collect();
    levels.sort_by(|a, b| a[0].0.total_cmp(&b[0].0));
    let [.., [(slow, _), (before, before_se)], [(fast, _), (after, after_se)]] = levels[..] else { return false };
    let asked = before * ((fast / slow).powi(2) - 1.0);
    let unsure = 3.0 * before_se.hypot(after_se);
    before > 0.0 && asked > 2.0 * unsure && after - before + unsure < FOLLOWS * asked
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    #[test]
    fn the_thesis_table_reads() {
        assert_eq!(thesis().len(), 9);
    }

    /// A load cell that ends at 4 N is seen; one that does not, and one whose last two levels hardly differ in speed, are not.
    #[test]
    fn a_clipped_load_cell_is_seen() {
        let names = ["rpm", "thrust_n", "current_a"];
        let log = |speeds: &[f64], end: f64| -> (Log, Vec<Plateau>) {
            let columns = names.iter().map(|n| Column { name: (*n).into(), values: vec![0.0] }).collect();
            let plateau = |rpm: &f64| {
                let thrust = (1e-7 * rpm * rpm).min(end);
                Plateau {
                    from_s: 0.0,
                    to_s: 1.0,
                    first: 0,
                    rows: 1,
                    settling_s: 0.0,
                    means: vec![Some((*rpm, 1.0)), Some((thrust, 0.002)), Some((rpm / 1000.0, 0.01))],
                }
            };
            (Log { columns, ..Log::default() }, speeds.iter().map(plateau).collect())
        };
        for (speeds, end, wanted) in [
            (&[5000.0, 6000.0, 6800.0, 7500.0][..], 4.0, true),
            (&[5000.0, 6000.0, 6300.0, 6600.0][..], 4.0, true),
            (&[5000.0, 6000.0, 6800.0, 7500.0][..], 9.0, false),
            (&[5000.0, 6000.0, 6005.0][..], 3.6, false),
        ] {
            let (log, plateaus) = log(speeds, end);
            assert_eq!(from_log(&log, &plateaus).clipped, wanted, "{speeds:?} {end}");
        }
    }

    #[test]
    fn faults_name_their_place() {
        let head = "motor,propeller,thrust_n,current_a\n";
        for (text, wanted) in [
            (String::new(), "p.csv:1: no pair"),
            ("a,b\n".to_owned(), "p.csv:1: header 'a,b'; expected 'motor,propeller,thrust_n,current_a'"),
            (format!("{head}m,p,1\n"), "p.csv:2: 3 fields"),
            (format!("{head}m,p,1,\n"), "p.csv:2: column current_a: ''; expected a positive number"),
            (format!("{head}m,p,-1,2\n"), "p.csv:2: column thrust_n: '-1'"),
            (format!("{head}m,p,1e16,2\n"), "p.csv:2: column thrust_n: '1e16'; expected a number that a sensor can read"),
            (format!("{head}m,p,1,1e30\n"), "p.csv:2: column current_a: '1e30'; expected a number that a sensor can read"),
            (format!("{head}m,p,1,1e-300\n"), "p.csv:2: column current_a: '1e-300'; expected a number that a sensor can read"),
            (format!("{head},p,9,3\n"), "p.csv:2: column motor: an empty field; expected a name"),
            (format!("{head}m,,9,3\n"), "p.csv:2: column propeller: an empty field; expected a name"),
        ] {
            let message = read_table("p.csv", text.as_bytes()).unwrap_err().to_string();
            assert!(message.contains(wanted), "{message:?} lacks {wanted:?}");
        }
    }

    /// What is wrong with one line costs no other one, and is told.
    #[test]
    fn a_line_without_a_pair_is_left_out_alone() {
        let text = "motor,propeller,thrust_n,current_a\nm,p,1,2\nm,p,3,4\nm,q,x,2\nn,q,1\nn,p,3,4\n";
        let table = read_table("p.csv", text.as_bytes()).unwrap();
        assert_eq!(table.pairs.iter().map(Pair::name).collect::<Vec<_>>(), ["m with p", "n with p"]);
        let told: Vec<String> = table.left_out.iter().map(ToString::to_string).collect();
        let wanted = [
            "p.csv:3: 'm' with 'p' stands on line 2, too; expected each pair once",
            "p.csv:4: column thrust_n: 'x'",
            "p.csv:5: 3 fields",
        ];
        assert_eq!(told.len(), wanted.len());
        assert!(told.iter().zip(wanted).all(|(told, wanted)| told.starts_with(wanted)), "{told:?}");
    }
}
