//! Days as dates.
//!
//! What it is: a number of days as `YYYY-MM-DD` and back; the day of a log, from the key `date` of its head or from the name that this
//! program's recorder gives it (`rig-YYYY-MM-DD-HHMMSS.csv`).
//! What can go wrong: a text that is no date gives nothing; the time at which a file was written is not asked, for copies change it.
//! Units: days since 1970-01-01.
//! Reference: Hinnant, "chrono-compatible low-level date algorithms", `days_from_civil` and `civil_from_days`.

use crate::log::Log;

/// The day of a log, with the time of day as a share.
#[must_use]
pub fn of_log(log: &Log) -> Option<f64> {
    let told = match log.meta.get("date") {
        Some(toml::Value::String(text)) => Some(text.clone()),
        Some(toml::Value::Datetime(date)) => Some(date.to_string()),
        _ => None,
    };
    let recorded = || log.name.strip_prefix("rig-").and_then(|rest| rest.get(..17)).map(str::to_owned);
    // what is no date, as that of a simulated run, leaves the name to say it
    told.as_deref().and_then(with_time).or_else(|| with_time(&recorded()?))
}

/// The day, and the time where it is there, that a file's name carries: `Log_2019-11-09_181347.csv` is of `2019-11-09 18:13:47`. Only a hint:
/// names are given by people.
#[must_use]
pub fn in_name(name: &str) -> Option<String> {
    let starts = name.char_indices().map(|(at, _)| at);
    let number = |c: Option<&str>| c.is_some_and(|c| c.chars().all(|c| c.is_ascii_digit()));
    let of = |at: usize| {
        let date = name.get(at..at + 10).filter(|text| day(text).is_some())?;
        // no part of a longer number
        let before = name[..at].chars().next_back();
        let behind = name[at + 10..].chars().next();
        if [before, behind].into_iter().flatten().any(|c| c.is_ascii_digit()) {
            return None;
        }
        let clock = name.get(at + 11..at + 17).filter(|text| number(Some(text)));
        let clock = clock.filter(|c| c[..2] < *"24" && c[2..4] < *"60" && c[4..] < *"60");
        Some(clock.map_or_else(|| date.to_owned(), |c| format!("{date} {}:{}:{}", &c[..2], &c[2..4], &c[4..])))
    };
    starts.filter_map(of).next()
}

/// `YYYY-MM-DD`, with a time of day behind a `T`, a space or a dash where there is one: `HH:MM`, `HH:MM:SS` or `HHMMSS`.
fn with_time(text: &str) -> Option<f64> {
    let (date, rest) = (text.get(..10)?, text.get(10..)?);
    let digits: String = rest.chars().filter(char::is_ascii_digit).take(6).collect();
    let of = |from: usize| digits.get(from..from + 2).and_then(|v| v.parse::<f64>().ok()).unwrap_or(0.0);
    Some(day(date)? as f64 + (of(0) + of(2) / 60.0 + of(4) / 3600.0) / 24.0)
}

/// The day of `YYYY-MM-DD`; nothing for a 31st of February.
#[must_use]
pub fn day(text: &str) -> Option<i64> {
    let mut parts = text.split('-').map(|part| part.parse::<i64>().ok());
    let (Some(Some(y)), Some(Some(m)), Some(Some(d)), None) = (parts.next(), parts.next(), parts.next(), parts.next()) else {
        return None;
    };
    if !(1..=12).contains(&m) || !(1..=31).contains(&d) {
        return None;
    }
    let y = y - i64::from(m <= 2);
    let (era, yoe) = (y.div_euclid(400), y.rem_euclid(400));
    let doy = (153 * ((m + 9) % 12) + 2) / 5 + d - 1;
    let day = era * 146_097 + yoe * 365 + yoe / 4 - yoe / 100 + doy - 719_468;
    (self::text(day) == text).then_some(day)
}

/// A day as `YYYY-MM-DD`.
#[must_use]
pub fn text(day: i64) -> String {
    let z = day + 719_468;
    let (era, doe) = (z.div_euclid(146_097), z.rem_euclid(146_097));
    let yoe = (doe - doe / 1_460 + doe / 36_524 - doe / 146_096) / 365;
    let doy = doe - (365 * yoe + yoe / 4 - yoe / 100);
    let mp = (5 * doy + 2) / 153;
    let (d, m) = (doy - (153 * mp + 2) / 5 + 1, if mp < 10 { mp + 3 } else { mp - 9 });
    format!("{:04}-{m:02}-{d:02}", era * 400 + yoe + i64::from(m <= 2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_day_comes_back() {
        assert_eq!((text(0), text(20_781)), ("1970-01-01".to_owned(), "2026-11-24".to_owned()));
        assert!((-1000..=200_000).all(|d| day(&text(d)) == Some(d)));
        for nonsense in ["", "2026-02-30", "2026-13-01", "26-01-01", "2026-1-1", "yesterday", "12.03.2026"] {
            assert_eq!(day(nonsense), None, "{nonsense}");
        }
    }

    #[test]
    fn a_time_of_day_is_a_share_of_it() {
        let of = |text: &str| with_time(text).map(|d| d - 20_524.0);
        assert_eq!(of("2026-03-12"), Some(0.0));
        assert_eq!(of("2026-03-12T12:00"), Some(0.5));
        assert_eq!(of("2026-03-12-060000"), Some(0.25));
        assert_eq!(of("2026-02-30T12:00"), None);
    }

    #[test]
    fn a_name_may_carry_a_day() {
        for (name, said) in [
            ("Log_2019-11-09_181347.csv", Some("2019-11-09 18:13:47")),
            ("StepsTestV2_2023-12-14_112823.csv", Some("2023-12-14 11:28:23")),
            ("day 2026-03-12.csv", Some("2026-03-12")),
            ("2026-03-12_996100.csv", Some("2026-03-12")),
            ("2026-02-30.csv", None),
            ("12026-03-12.csv", None),
            ("run.csv", None),
        ] {
            assert_eq!(in_name(name).as_deref(), said, "{name}");
        }
    }

    #[test]
    fn the_head_is_asked_first_and_then_the_recorder_s_name() {
        let mut log = Log { name: "rig-2026-03-13-180000.csv".into(), ..Log::default() };
        let told = |log: &Log| of_log(log).map(|d| text(d.floor() as i64));
        assert_eq!(told(&log).as_deref(), Some("2026-03-13"));
        log.meta.insert("date".into(), toml::Value::String("2026-03-12".into()));
        assert_eq!(told(&log).as_deref(), Some("2026-03-12"));
        log = Log { name: "2026-03-13.csv".into(), ..Log::default() };
        assert_eq!(told(&log), None);
    }
}
