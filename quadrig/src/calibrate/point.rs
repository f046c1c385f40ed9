//! The known values of a calibration, as they are given.
//!
//! What it is: `VALUE[ UNIT][@FROM..TO]` between commas, the times in seconds of the recording.
//! What can go wrong: a value or a time that is none, and times for some of the points only.
//! Units: s; the channel's own.
//! Reference: `quadrig calibrate --help`.

use super::channel::Channel;

/// A known value.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Point {
    /// As it was said.
    pub(super) said: String,
    /// In the channel's unit.
    pub(super) value: f64,
    /// When it stood there, s.
    pub(super) window: Option<(f64, f64)>,
}

/// The points of a list.
pub(super) fn list(channel: Channel, text: &str, arm_m: f64) -> Result<Vec<Point>, String> {
    let points: Vec<Point> = text.split(',').map(|part| point(channel, part, arm_m)).collect::<Result<_, _>>()?;
    let timed = points.iter().filter(|p| p.window.is_some()).count();
    if timed > 0 && timed < points.len() {
        return Err(format!("--points {text:?}: expected a time for all of the points or for none"));
    }
    Ok(points)
}

/// One point.
pub(super) fn point(channel: Channel, text: &str, arm_m: f64) -> Result<Point, String> {
    let (said, window) = match text.split_once('@') {
        None => (text, None),
        Some((said, window)) => {
            let times = window.split_once("..").and_then(|(a, b)| Some((a.trim().parse().ok()?, b.trim().parse().ok()?)));
            let times = times.filter(|(a, b): &(f64, f64)| a < b);
            (said, Some(times.ok_or_else(|| format!("{text:?}: expected seconds as in 200 g@12..18"))?))
        }
    };
    Ok(Point { said: said.trim().to_owned(), value: channel.value(said, arm_m)?, window })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_with_and_without_times() {
        let points = list(Channel::Current, "0 A, 5.02 A, 0", 0.1).expect("a list");
        assert_eq!(
            points.iter().map(|p| (p.said.as_str(), p.value)).collect::<Vec<_>>(),
            [("0 A", 0.0), ("5.02 A", 5.02), ("0", 0.0)]
        );
        let points = list(Channel::Voltage, "9.0@1..2.5,12 V@10 .. 20", 0.1).expect("a list");
        assert_eq!(points.iter().map(|p| p.window).collect::<Vec<_>>(), [Some((1.0, 2.5)), Some((10.0, 20.0))]);
        for nonsense in ["", "0, ", "0@3..2", "0@3", "0@1..2, 5", "5 g", "5@nan..2"] {
            assert!(list(Channel::Current, nonsense, 0.1).is_err(), "{nonsense}");
        }
    }
}
