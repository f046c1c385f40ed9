//! Days of a board's record.
//!
//! What it is: days as a board keeps them, 16 bits from 1970-01-01 on; today, and the name of a log that begins now.
//! What can go wrong: a text that is no date, or lies outside 1970 to 2149-06-06, gives nothing.
//! Units: days.
//! Reference: [`ident::log::date`].

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
    ident::log::date::text(i64::from(day))
}

/// The day of `YYYY-MM-DD`.
pub(crate) fn day(text: &str) -> Option<u16> {
    ident::log::date::day(text).and_then(|day| u16::try_from(day).ok())
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
