//! The day of a run, as its log's head tells it.
//!
//! What it is: the key `date` of the head, or the day in the name that this program's recorder gives a log (`rig-YYYY-MM-DD-HHMMSS.csv`).
//! What can go wrong: a text that is no date gives nothing; the time at which a file was written is not asked, for copies change it.
//! Units: days since 1970-01-01.
//! Reference: Hinnant, "chrono-compatible low-level date algorithms", `days_from_civil`.

use crate::log::Log;

/// The day of a log.
#[must_use]
pub fn day_of(log: &Log) -> Option<f64> {
    let told = match log.meta.get("date") {
        Some(toml::Value::String(text)) => Some(text.clone()),
        Some(toml::Value::Datetime(date)) => Some(date.to_string()),
        _ => None,
    };
    let recorded = || log.name.strip_prefix("rig-").and_then(|rest| rest.get(..17)).map(str::to_owned);
    parse(&told.or_else(recorded)?)
}

/// `YYYY-MM-DD`, with a time of day behind a `T`, a space or a dash where there is one: `HH:MM`, `HH:MM:SS` or `HHMMSS`.
fn parse(text: &str) -> Option<f64> {
    let (date, rest) = (text.get(..10)?, text.get(10..)?);
    let mut parts = date.split('-');
    let (y, m, d) = (parts.next()?, parts.next()?, parts.next()?);
    if y.len() != 4 || m.len() != 2 || d.len() != 2 {
        return None;
    }
    let (y, m, d): (i64, i64, i64) = (y.parse().ok()?, m.parse().ok()?, d.parse().ok()?);
    if !(1..=12).contains(&m) || !(1..=31).contains(&d) {
        return None;
    }
    let days = days_from_civil(y, m, d);
    let digits: String = rest.chars().filter(char::is_ascii_digit).take(6).collect();
    let of = |from: usize| digits.get(from..from + 2).and_then(|v| v.parse::<f64>().ok()).unwrap_or(0.0);
    Some(days as f64 + (of(0) + of(2) / 60.0 + of(4) / 3600.0) / 24.0)
}

fn days_from_civil(y: i64, m: i64, d: i64) -> i64 {
    let y = if m <= 2 { y - 1 } else { y };
    let era = y.div_euclid(400);
    let yoe = y.rem_euclid(400);
    let doy = (153 * ((m + 9) % 12) + 2) / 5 + d - 1;
    era * 146_097 + yoe * 365 + yoe / 4 - yoe / 100 + doy - 719_468
}

/// A day as `YYYY-MM-DD`.
#[must_use]
pub fn text_of(day: f64) -> String {
    let z = day.floor() as i64 + 719_468;
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
    fn a_date_comes_back_and_nonsense_is_none() {
        for text in ["1970-01-01", "2000-02-29", "2026-03-12", "2026-12-31"] {
            assert_eq!(text_of(parse(text).expect("a date")), text);
        }
        assert_eq!(parse("2026-03-12T12:00"), parse("2026-03-12").map(|d| d + 0.5));
        assert_eq!(parse("2026-03-12-060000"), parse("2026-03-12").map(|d| d + 0.25));
        for text in ["", "yesterday", "12.03.2026", "2026-13-01", "2026-3-12"] {
            assert_eq!(parse(text), None, "{text}");
        }
    }

    #[test]
    fn the_head_is_asked_first_and_then_the_recorder_s_name() {
        let mut log = Log { name: "rig-2026-03-13-180000.csv".into(), ..Log::default() };
        assert_eq!(day_of(&log).map(text_of).as_deref(), Some("2026-03-13"));
        log.meta.insert("date".into(), toml::Value::String("2026-03-12".into()));
        assert_eq!(day_of(&log).map(text_of).as_deref(), Some("2026-03-12"));
        log = Log { name: "2026-03-13.csv".into(), ..Log::default() };
        assert_eq!(day_of(&log), None);
    }
}
