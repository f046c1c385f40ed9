//! Time stamps as other programs write them: dates, times of day, counts since 1970.
//!
//! What it is: a cell as seconds, and a whole column as seconds since its first row.
//! What can go wrong: a date that is not written year first is not read (day and month are in doubt): the time of day stands, and a step back
//! by more than half a day is midnight.
//! Units: s.
//! Reference: ISO 8601; Richards, "Mapping time", 1998 (days of a date).

/// A day, s.
const DAY_S: f64 = 86_400.0;
/// Days are counted from about the year 2000, so that fractions of a second keep their digits.
const ORIGIN: i64 = 730_500;

/// A stamp: seconds, and whether they count from a known day.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stamp {
    /// Seconds, of the day alone where no date was read.
    pub(super) seconds: f64,
    /// Whether a date was read.
    pub(super) dated: bool,
}

/// Seconds of `HH:MM:SS.fff`, `HH:MM:SS:fff`, `MM:SS.fff`, with a date before it and `AM` or `PM` after it where there is one.
pub(super) fn stamp(text: &str) -> Option<Stamp> {
    let text = text.trim();
    let (text, noon) = match text.to_ascii_lowercase().strip_suffix("m").map(str::to_owned) {
        Some(rest) if rest.ends_with(['a', 'p']) => (text[..rest.len() - 1].trim_end().to_owned(), rest.chars().last()),
        _ => (text.to_owned(), None),
    };
    let (date, time) = match text.split_once([' ', 'T']) {
        Some((date, time)) if !date.contains(':') => (Some(date), time.trim()),
        _ => (None, text.as_str()),
    };
    // a zone is the same on every row
    let time = time.trim_end_matches('Z');
    let time = time.rfind(['+', '-']).map_or(time, |at| &time[..at]);
    let mut parts: Vec<f64> = Vec::new();
    let pieces: Vec<&str> = time.split(':').collect();
    if !(2..=4).contains(&pieces.len()) {
        return None;
    }
    for (k, piece) in pieces.iter().enumerate() {
        let last = k + 1 == pieces.len() || k == 2;
        let text = if last { piece.replacen(',', ".", 1) } else { (*piece).to_owned() };
        if !text.starts_with(|c: char| c.is_ascii_digit()) || !text.bytes().all(|b| b.is_ascii_digit() || b == b'.') {
            return None;
        }
        parts.push(match k {
            // the fraction after a third colon
            3 => format!("0.{text}").parse().ok()?,
            _ => text.parse().ok()?,
        });
    }
    let mut of_day = match parts[..] {
        [minutes, seconds] => 60.0 * minutes + seconds,
        [hours, minutes, seconds] => 3600.0 * hours + 60.0 * minutes + seconds,
        [hours, minutes, seconds, fraction] => 3600.0 * hours + 60.0 * minutes + seconds + fraction,
        _ => return None,
    };
    match noon {
        Some('p') if of_day < DAY_S / 2.0 => of_day += DAY_S / 2.0,
        Some('a') if of_day >= DAY_S / 2.0 => of_day -= DAY_S / 2.0,
        _ => {}
    }
    let days = date.and_then(days);
    Some(Stamp { seconds: of_day + DAY_S * days.unwrap_or(0.0), dated: days.is_some() })
}

/// Days of a date that has its year first.
fn days(date: &str) -> Option<f64> {
    let parts: Vec<i64> = date.split(['-', '/', '.']).map(|p| p.parse().ok()).collect::<Option<_>>()?;
    let &[year, month, day] = parts.as_slice() else { return None };
    if year < 1000 || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    let (y, m) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    Some((365 * y + y.div_euclid(4) - y.div_euclid(100) + y.div_euclid(400) + (153 * m + 2) / 5 + day - ORIGIN) as f64)
}

/// Carries times of day over midnight.
pub(super) fn over_midnight(t: &mut [f64]) {
    let (mut days, mut last) = (0.0, f64::NAN);
    for v in t.iter_mut().filter(|v| v.is_finite()) {
        if *v < last - DAY_S / 2.0 {
            days += DAY_S;
        }
        last = *v;
        *v += days;
    }
}

/// Unit of a count since 1970 by its size: factor to seconds, and its name. Nothing below the year 2001.
pub(super) fn since_1970(value: f64) -> Option<(f64, &'static str)> {
    match value.abs() {
        v if v >= 1e18 => Some((1e-9, "ns")),
        v if v >= 1e15 => Some((1e-6, "us")),
        v if v >= 1e12 => Some((1e-3, "ms")),
        v if v >= 1e9 => Some((1.0, "s")),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_of_the_field() {
        let of = |text: &str| stamp(text).map(|s| ((1000.0 * s.seconds % 86_400_000.0).round() as i64, s.dated));
        let at = 1000 * (17 * 3600 + 14 * 60 + 8);
        for (text, wanted) in [
            ("2019-11-05 17:14:08:947", Some((at + 947, true))),
            ("2019-11-05T17:14:08.947Z", Some((at + 947, true))),
            ("2019/11/05 17:14:08,947+01:00", Some((at + 947, true))),
            ("17:14:08,947", Some((at + 947, false))),
            ("5:14:08.5 PM", Some((at + 500, false))),
            ("12:00:01 am", Some((1000, false))),
            ("05.11.2019 17:14:08", Some((at, false))),
            ("14:08.5", Some((848_500, false))),
            ("1:2:3:4:5", None),
            ("yesterday", None),
            ("12", None),
        ] {
            assert_eq!(of(text), wanted, "{text}");
        }
        assert_eq!(of("2019-11-06 00:00:00").unwrap().0, 0);
        let days = |text| stamp(text).unwrap().seconds / 86_400.0;
        assert_eq!(days("2020-03-01 00:00:00") - days("2020-02-28 00:00:00"), 2.0);
    }

    #[test]
    fn midnight_is_no_step_back() {
        let mut t = [86_399.5, f64::NAN, 0.5, 0.4, 1.0, 86_399.0, 1.0];
        over_midnight(&mut t);
        assert_eq!([t[0], t[2], t[3], t[5], t[6]], [86_399.5, 86_400.5, 86_400.4, 172_799.0, 172_801.0]);
    }
}
