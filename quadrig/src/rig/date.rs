//! Days as dates.
//!
//! What it is: the number of days since 1970-01-01 as `YYYY-MM-DD` and back.
//! What can go wrong: a text that is no date, or lies outside 1970 to 2149, gives nothing.
//! Units: days.
//! Reference: Hinnant, "chrono-compatible low-level date algorithms", `days_from_civil`.

use std::path::PathBuf;
use std::time::SystemTime;

/// Seconds of a day.
const DAY_S: u64 = 86_400;

fn seconds() -> u64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs()
}

/// Today, UTC.
pub(crate) fn today() -> u16 {
    u16::try_from(seconds() / DAY_S).unwrap_or(u16::MAX)
}

/// Name of a log that begins now: `rig-YYYY-MM-DD-HHMMSS.csv`, UTC.
pub(crate) fn file_of_now() -> PathBuf {
    let s = seconds();
    let (day, s) = (today(), s % DAY_S);
    format!("rig-{}-{:02}{:02}{:02}.csv", text(day), s / 3600, s / 60 % 60, s % 60).into()
}

/// A day as `YYYY-MM-DD`.
pub(crate) fn text(day: u16) -> String {
    let z = u32::from(day) + 719_468;
    let (era, doe) = (z / 146_097, z % 146_097);
    let yoe = (doe - doe / 1_460 + doe / 36_524 - doe / 146_096) / 365;
    let doy = doe - (365 * yoe + yoe / 4 - yoe / 100);
    let mp = (5 * doy + 2) / 153;
    let (d, m) = (doy - (153 * mp + 2) / 5 + 1, if mp < 10 { mp + 3 } else { mp - 9 });
    format!("{:04}-{m:02}-{d:02}", era * 400 + yoe + u32::from(m <= 2))
}

/// The day of `YYYY-MM-DD`.
pub(crate) fn day(text: &str) -> Option<u16> {
    let mut parts = text.split('-').map(|part| part.parse::<u32>().ok());
    let (Some(Some(y)), Some(Some(m)), Some(Some(d)), None) = (parts.next(), parts.next(), parts.next(), parts.next()) else {
        return None;
    };
    if !(1970..=2149).contains(&y) || !(1..=12).contains(&m) || !(1..=31).contains(&d) {
        return None;
    }
    let y = y - u32::from(m <= 2);
    let (era, yoe) = (y / 400, y % 400);
    let doy = (153 * ((m + 9) % 12) + 2) / 5 + d - 1;
    let doe = yoe * 365 + yoe / 4 - yoe / 100 + doy;
    let day = u16::try_from((era * 146_097 + doe).checked_sub(719_468)?).ok()?;
    (self::text(day) == text).then_some(day) // no 31st of February
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_day_comes_back() {
        assert_eq!((text(0), text(20_781)), ("1970-01-01".to_owned(), "2026-11-24".to_owned()));
        assert!((0..=u16::MAX).all(|d| day(&text(d)) == Some(d)));
        for nonsense in ["", "2026-02-30", "2026-13-01", "26-01-01", "2026-1-1", "yesterday", "1969-12-31", "2300-01-01"] {
            assert_eq!(day(nonsense), None, "{nonsense}");
        }
    }
}
