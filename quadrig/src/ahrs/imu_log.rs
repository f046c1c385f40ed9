//! The attitude log's input.
//!
//! What it is: a CSV with a time and the readings of up to three sensors, columns by name in any order.
//! What can go wrong: no time, no sensor, a sensor with some of its three columns, a word that is no number, time that stands
//! still, what no IMU reads ([`readable`]): refused with file, line and column. An empty field is a missing reading, and so is `nan` of a
//! magnetometer, which recorders write between its readings.
//! Units: s, rad/s, m/s^2, uT.
//! Reference: specification `formats.md`, "Attitude log".

use super::{number, readable};
use crate::Failure;
use crate::trouble::unread;
use dcm::Vec3;
use ident::log::short;
use std::path::Path;

/// One row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Row {
    /// Time, s.
    pub(crate) t: f64,
    /// Rates, rad/s.
    pub(crate) gyro: Option<Vec3>,
    /// Specific force, m/s^2.
    pub(crate) accel: Option<Vec3>,
    /// Field, uT.
    pub(crate) mag: Option<Vec3>,
}

/// A recording.
#[derive(Debug)]
pub(crate) struct ImuLog {
    text: String,
    times: Vec<(u32, u32)>,
    /// Its rows.
    pub(crate) rows: Vec<Row>,
}

const SENSORS: [[&str; 3]; 3] = [["gx", "gy", "gz"], ["ax", "ay", "az"], ["mx", "my", "mz"]];

/// The place of the magnetometer among them.
const MAG: usize = 2;

/// Where the columns are.
struct Columns {
    time: usize,
    sensors: [Option<[usize; 3]>; 3],
    last: usize,
}

impl Columns {
    fn of(header: &str) -> Result<Self, String> {
        let names: Vec<&str> = header.trim_end_matches('\r').split(',').map(str::trim).collect();
        let find = |name: &str| -> Result<Option<usize>, String> {
            let mut places = names.iter().enumerate().filter(|(_, n)| **n == name).map(|(i, _)| i);
            let first = places.next();
            if places.next().is_some() {
                Err(format!("column {name}: it stands twice; expected each column once"))
            } else {
                Ok(first)
            }
        };
        if crate::kind::is_attitude_alone(&names) {
            return Err(crate::kind::ATTITUDE_ALONE.to_owned());
        }
        let time = find("t_s")?.ok_or("no column t_s; expected t_s,gx,gy,gz,ax,ay,az[,mx,my,mz]")?;
        let mut sensors = [None; 3];
        for (slot, axes) in sensors.iter_mut().zip(SENSORS) {
            let found = [find(axes[0])?, find(axes[1])?, find(axes[2])?];
            *slot = match found {
                [Some(x), Some(y), Some(z)] => Some([x, y, z]),
                [None, None, None] => None,
                _ => return Err(format!("some of the columns are missing; expected all of {}", axes.join(","))),
            };
        }
        if sensors[0].is_none() || sensors[1].is_none() {
            return Err("no attitude log; expected columns t_s, gx,gy,gz (rad/s) and ax,ay,az (m/s^2), and mx,my,mz (uT) where there are any".to_owned());
        }
        let last = sensors.iter().flatten().flatten().copied().chain([time]).max().unwrap_or(0);
        Ok(Self { time, sensors, last })
    }
}

impl ImuLog {
    /// Reads a file.
    pub(crate) fn read(path: &Path) -> Result<Self, Failure> {
        let text = std::fs::read_to_string(path).map_err(unread(&path))?;
        let (times, rows) = parse(&text).map_err(|(line, what)| format!("{}:{line}: {what}", path.display()))?;
        Ok(Self { text, times, rows })
    }

    /// The file's text.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// A further column by its name, where the log has it; an empty field is not a number.
    pub(crate) fn column(&self, name: &str) -> Option<Vec<f64>> {
        let mut lines = self.text.lines().filter(|l| !l.starts_with('#') && !l.trim().is_empty());
        let place = lines.next()?.split(',').position(|n| n.trim() == name)?;
        Some(lines.map(|l| l.split(',').nth(place).and_then(|w| w.trim().parse().ok()).unwrap_or(f64::NAN)).collect())
    }

    /// Rows with the time since the row before; the first takes the second's.
    pub(crate) fn steps(&self) -> impl Iterator<Item = (&Row, f32)> {
        let first = match self.rows.as_slice() {
            [a, b, ..] => a.t - (b.t - a.t),
            _ => -0.01,
        };
        let before = std::iter::once(first).chain(self.rows.iter().map(|r| r.t));
        self.rows.iter().zip(before).map(|(row, before)| (row, (row.t - before) as f32))
    }

    /// The time of a row as it was written.
    pub(crate) fn time_text(&self, row: usize) -> &str {
        let (from, to) = self.times[row];
        &self.text[from as usize..to as usize]
    }
}

type Parsed = (Vec<(u32, u32)>, Vec<Row>);

fn parse(text: &str) -> Result<Parsed, (usize, String)> {
    if u32::try_from(text.len()).is_err() {
        return Err((1, "longer than 4 GB; expected less: cut it".to_owned()));
    }
    let mut lines = text.lines().enumerate().filter(|(_, l)| !l.starts_with('#') && !l.trim().is_empty());
    let (n, header) = lines.next().ok_or((1, "empty file; expected t_s,gx,gy,gz,ax,ay,az[,mx,my,mz]".to_owned()))?;
    let columns = Columns::of(header).map_err(|what| (n + 1, what))?;
    let estimate = text.len() / header.len().max(40);
    let (mut times, mut rows) = (Vec::with_capacity(estimate), Vec::<Row>::with_capacity(estimate));
    let mut fields = vec![(0usize, 0usize); columns.last + 1];
    for (n, line) in lines {
        let fail = |what: String| (n + 1, what);
        let count = split(line.as_bytes(), &mut fields);
        if count < fields.len() {
            return Err(fail(format!("{count} fields, expected at least {}", fields.len())));
        }
        let word = |at: usize| line[fields[at].0..fields[at].1].trim();
        let time = word(columns.time);
        let t = number::parse(time.as_bytes()).filter(|t| t.is_finite());
        let t = t.ok_or_else(|| fail(format!("column t_s: {:?} is no time; expected seconds", short(time))))?;
        if let Some(before) = rows.last().filter(|r| r.t >= t) {
            return Err(fail(format!(
                "column t_s: {} does not come after {}; expected strictly increasing time: sort the rows, or cut the run there",
                short(time),
                before.t
            )));
        }
        let mut sensors = [None; 3];
        for (sensor, ((slot, place), names)) in sensors.iter_mut().zip(columns.sensors).zip(SENSORS).enumerate() {
            let Some(place) = place else { continue };
            let mut v = [0.0f32; 3];
            for ((v, at), name) in v.iter_mut().zip(place).zip(names) {
                let value = reading(word(at), sensor == MAG).ok_or_else(|| {
                    fail(format!(
                        "column {name}: {:?} is no number; expected one, or an empty field for a missing reading",
                        short(word(at))
                    ))
                })?;
                readable::cell(sensor, value).map_err(|what| fail(format!("column {name}: {what}")))?;
                *v = value as f32;
            }
            *slot = v.iter().all(|c| c.is_finite()).then(|| Vec3::from(v));
        }
        let from = time.as_ptr() as usize - text.as_ptr() as usize;
        times.push((from as u32, (from + time.len()) as u32));
        let [gyro, accel, mag] = sensors;
        rows.push(Row { t, gyro, accel, mag });
    }
    if rows.is_empty() {
        return Err((n + 1, "no rows after the header; expected at least one".to_owned()));
    }
    readable::whole(&rows).map_err(|what| (n + 2, what))?;
    Ok((times, rows))
}

/// Where the first fields of a line lie, from and to; gives how many there are, at most as many as asked for.
fn split(line: &[u8], fields: &mut [(usize, usize)]) -> usize {
    let (mut from, mut count) = (0, 0);
    for (at, byte) in line.iter().enumerate() {
        if *byte == b',' {
            fields[count] = (from, at);
            (from, count) = (at + 1, count + 1);
            if count == fields.len() {
                return count;
            }
        }
    }
    fields[count] = (from, line.len());
    count + 1
}

/// A reading; empty is a missing one, and `nan` of a sensor that gives fewer readings than there are rows.
fn reading(field: &str, is_slower: bool) -> Option<f64> {
    if field.is_empty() {
        return Some(f64::NAN);
    }
    number::parse(field.as_bytes()).filter(|v| v.is_finite() || (is_slower && v.is_nan()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_come_in_any_order_and_others_are_ignored() {
        let (_, rows) = parse("az,ay,ax,extra,gx,gy,gz,t_s\n3,2,1,x,4,5,6,0.5\n3,,1,y,4,5,6,1.0\n").unwrap();
        assert_eq!(rows[0], Row { t: 0.5, gyro: Some([4., 5., 6.].into()), accel: Some([1., 2., 3.].into()), mag: None });
        assert_eq!(rows[1].accel, None, "an empty field is a missing reading");
        let (_, rows) = parse("t_s,gx,gy,gz,ax,ay,az,mx,my,mz\n0,0,0,0,0,0,9.8,nan,nan,nan\n").unwrap();
        assert_eq!(rows[0].mag, None, "a magnetometer is slower");
    }

    #[test]
    fn what_cannot_be_taken_is_named_with_its_line_and_column() {
        let head = "t_s,gx,gy,gz,ax,ay,az\n";
        for (text, line, wanted) in [
            (String::new(), 1, "empty file"),
            ("gx,gy,gz,ax,ay,az\n".into(), 1, "no column t_s"),
            ("t_s,gx,gy,ax,ay,az\n".into(), 1, "gx,gy,gz"),
            ("t_s,gx,gy,gz\n0,0,0,0\n".into(), 1, "ax,ay,az"),
            ("t_s,gx,gx,gy,gz,ax,ay,az\n".into(), 1, "column gx: it stands twice"),
            (head.into(), 1, "no rows"),
            (format!("{head}0,1,2,3,4,5,six\n"), 2, "column az: \"six\""),
            (format!("{head}0,1,2,3,4,5,inf\n"), 2, "column az: \"inf\""),
            (format!("{head}0,1,2,nan,4,5,6\n"), 2, "column gz: \"nan\""),
            (format!("{head}0,1,2,3,NaN,5,6\n"), 2, "column ax: \"NaN\""),
            (
                format!("{head}0,1,2,1e39,4,5,6\n"),
                2,
                "column gz: 1e39 is more than such a sensor reads; expected rad/s, 100 at most: is the file damaged?",
            ),
            (format!("{head}0,1,2,250,4,5,6\n"), 2, "column gz: 250.0 is more than such a sensor reads; expected rad/s"),
            (format!("{head}0,1,2,{},4,5,6\n", "x".repeat(5000)), 2, "xxx...\""),
            (format!("{head}0,0,0,0,0,0,9.8\n5,0,0,0,0,0,9.8\n10,0,0,0,0,0,9.8\n"), 2, "column t_s: rows 5 s apart"),
            (format!("{head}0,1,2,3,4,5\n"), 2, "6 fields, expected at least 7"),
            (format!("{head}1,0,0,0,0,0,9\n1,0,0,0,0,0,9\n"), 3, "does not come after"),
            (format!("{head}nan,0,0,0,0,0,9\n"), 2, "column t_s"),
        ] {
            let (n, what) = parse(&text).unwrap_err();
            assert!(n == line && what.contains(wanted), "{text:?}: {n} {what}");
        }
    }
}
