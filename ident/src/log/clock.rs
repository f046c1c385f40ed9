//! Time stamps that cannot be what they say, with the likely reason.
//!
//! What it is: rows that are shuffled, rows that were dropped, seconds that are milliseconds, judged by the log's own time and by the
//! `sample_hz` of its head.
//! What can go wrong: uneven sampling is allowed: a log without `sample_hz` is judged by its order and its length alone ([`super::Gaps`] tells what it lacks),
//! a hole that the recorder has told (`no sample for ...`, a reset) counts as told, and one on both sides of which the motor stands as a pause.
//! Units: s.
//! Reference: specification `formats.md`, "Rig log".

use super::gaps::standing;
use super::{Lines, Log, Place, ReadError, trimmed};
use std::io::BufRead;

/// Share of rows that step back from which on they are shuffled rather than a clock that was set.
const SHUFFLED: f64 = 0.2;
/// Share of missing rows, and of holes among the steps, from which on rows were dropped.
const DROPPED: [f64; 2] = [0.1, 0.08];
/// Share of missing rows in holes that nobody told of, under load: a recorder that is stopped while the motor stands leaves none.
const UNTOLD: f64 = 0.19;
/// Holes that a logger leaves where its line fails for seconds, each of less than a tenth of the run: gaps, which the engine takes.
const PAUSES: usize = 3;
/// Rows below which no rate is judged.
const ENOUGH: usize = 20;
/// Share of the step that the stated rate promises below which it is no step of that rate: a log that is recorded faster says so.
const TOO_CLOSE: f64 = 0.2;
/// Step between whole numbers from which on they are no milliseconds: a row each two seconds.
const MICROSECONDS: f64 = 2000.0;
/// Step between whole numbers, s, and length of a run with such steps, s, above which they are no seconds.
const NO_SECONDS: [f64; 2] = [5.0, 10_800.0];

/// Rows in a row whose clock may have leapt, and how much longer than a usual step the way there is.
const LEAP: (usize, f64) = (3, 3.0);

/// Why time steps back at `place`: the rest of the file says whether it is one row, another run, or every other row. Each row before has its line.
pub(super) fn stepped_back<R: BufRead>(
    value: f64,
    log: &Log,
    lines: &[usize],
    place: &Place<'_>,
    rest: &mut Lines<'_, R>,
) -> Result<ReadError, ReadError> {
    let (mut last, mut rows, mut back) = (value, log.len() + 1, 1);
    let mut next = None;
    let mut line = String::new();
    while rest.read_into(&mut line)? {
        let Some(t) = first_field(&line) else { continue };
        rows += 1;
        next = next.or(Some(t));
        back += usize::from(t < last);
        last = t;
    }
    let before = log.t.last().copied().unwrap_or(value);
    let start = log.t.first().copied().unwrap_or(value);
    let shuffled = back >= 3 && back as f64 >= SHUFFLED * rows as f64;
    if let Some((ahead, usual)) = leapt_ahead(value, next, &log.t).filter(|_| !shuffled) {
        let (line, odd) = (lines.get(ahead).copied().unwrap_or(place.line), log.t.get(ahead).copied().unwrap_or(value));
        return Ok(Place { file: place.file, line }.refuse(
            Some("t_s"),
            format!("{odd} leaps ahead, after {usual}; line {} goes on at {value}", place.line),
            "strictly increasing time; a glitch of the clock: take the row out, or mend its time",
        ));
    }
    let reason = if shuffled {
        format!("strictly increasing time; {back} of {rows} rows step back: the rows look shuffled, sort them by t_s")
    } else if back == 1 && log.len() >= ENOUGH && value - start < 0.1 * (before - start) {
        "strictly increasing time; a second run, or a clock that began anew: give each run a file of its own".to_owned()
    } else {
        let rows = if back == 1 { "one row steps".to_owned() } else { format!("{back} of {rows} rows step") };
        format!("strictly increasing time; {rows} back (`quadrig import` repairs it by a stated rule)")
    };
    Ok(place.refuse(Some("t_s"), format!("{value} steps back from {before}"), reason))
}

/// The row before `value` from which on the clock had leapt ahead, and the time before that: `value` and the `next` row go on from there as if
/// nothing had been.
fn leapt_ahead(value: f64, next: Option<f64>, t: &[f64]) -> Option<(usize, f64)> {
    let ahead = t.partition_point(|earlier| *earlier < value);
    let (before, odd) = (*t.get(ahead.checked_sub(1)?)?, *t.get(ahead)?);
    let mut steps: Vec<f64> = t.get(..ahead)?.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_unstable_by(f64::total_cmp);
    let usual = LEAP.1 * steps.get(steps.len() / 2)?;
    let rows = t.len() - ahead;
    let goes_on = value - before <= usual * (rows + 1) as f64 && next.is_none_or(|next| value < next && next < odd);
    (rows <= LEAP.0 && odd - before > usual && goes_on).then_some((ahead, before))
}

/// The time stamp of a row.
pub(super) fn first_field(line: &str) -> Option<f64> {
    line.split(',').next()?.trim().parse().ok()
}

/// Refuses time stamps that contradict the log's own rate, or that are no seconds. Each row has its line.
pub(super) fn check(log: &Log, file: &str, lines: &[usize]) -> Result<(), ReadError> {
    let place = Place { file, line: lines.first().copied().unwrap_or(1) };
    if log.time_is_row() || log.len() < 3 {
        return Ok(());
    }
    let mut steps: Vec<f64> = log.t.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    let middle = steps[steps.len() / 2];
    let stated = log.meta.get("sample_hz").and_then(|v| v.as_float().or_else(|| v.as_integer().map(|n| n as f64)));
    let refuse = |found: String, expected: String| Err(place.refuse(Some("t_s"), found, expected));
    match stated {
        Some(hz) => {
            for (times, unit) in [(1e3, "milliseconds"), (1e6, "microseconds")] {
                if (0.8 * times..1.25 * times).contains(&(middle * hz)) {
                    let found = format!("rows {} s apart, where sample_hz says {} s", number(middle), number(1.0 / hz));
                    return refuse(found, format!("seconds; these look like {unit}: divide t_s by {times}"));
                }
            }
            if middle * hz < TOO_CLOSE {
                let found = format!("rows {} s apart, where sample_hz says {} s", number(middle), number(1.0 / hz));
                return refuse(found, format!("seconds; {}: multiply t_s, or mend sample_hz", coarser(middle * hz)));
            }
            if let Some((found, row)) = dropped(log, hz) {
                let why = "rows were dropped (a bad line, a filter, a thinned export)";
                let way_out = "use the whole log, or take sample_hz out of its head and say there that the rows are right: # vouched = [\"t_s\"]";
                let before = Place { file, line: lines.get(row).copied().unwrap_or(place.line) };
                return Err(before.refuse(Some("t_s"), found, format!("a row each {} s; {why}: {way_out}", number(1.0 / hz))));
            }
        }
        None if no_seconds(log, middle) => {
            let found = format!("whole numbers, {} apart, up to {}", number(middle), number(log.t[log.len() - 1]));
            let way_out = format!("if they are seconds, say so in the head: # sample_hz = {}", number(1.0 / middle));
            let (unit, times) = if middle >= MICROSECONDS { ("microseconds", 1_000_000) } else { ("milliseconds", 1000) };
            return refuse(found, format!("seconds; these look like {unit}: divide t_s by {times} ({way_out})"));
        }
        None => {}
    }
    Ok(())
}

/// The unit in which rows would be as far apart as they should.
fn coarser(share: f64) -> String {
    let near = |times: f64| (0.8..1.25).contains(&(share * times));
    match [("minutes", 60.0), ("hours", 3600.0)].into_iter().find(|(_, times)| near(*times)) {
        Some((unit, times)) => format!("these look like {unit} ({times:.0} s each)"),
        None => "these look like another unit, or like another rate".to_owned(),
    }
}

/// Whole numbers so far apart, or so long, that no run was recorded like that.
fn no_seconds(log: &Log, middle: f64) -> bool {
    let length = log.t[log.len() - 1] - log.t[0];
    log.t.iter().all(|t| t.fract() == 0.0) && (middle >= NO_SECONDS[0] || length >= NO_SECONDS[1])
}

/// What is missing of the rows that the rate promises, if it is much, and the row before the first hole.
fn dropped(log: &Log, hz: f64) -> Option<(String, usize)> {
    if log.len() < ENOUGH {
        return None;
    }
    let steps: Vec<f64> = log.t.windows(2).map(|w| w[1] - w[0]).collect();
    let missed = |step: &f64| ((step * hz).round() - 1.0).max(0.0);
    let holes: Vec<f64> = steps.iter().map(missed).filter(|missing| *missing >= 1.0).collect();
    let missing: f64 = holes.iter().sum();
    let promised = missing + log.len() as f64;
    // a clock that is coarser than its rows makes long steps too, but over the whole run as many rows as the rate promises
    let absent = steps.iter().sum::<f64>() * hz + 1.0 - log.len() as f64;
    let scattered = missing.min(absent) >= DROPPED[0] * promised && holes.len() as f64 >= DROPPED[1] * steps.len() as f64;
    let told = log.events.iter().any(|event| event.contains("no sample for") || event.contains("was reset"));
    let stands = standing(log);
    let paused = |i: usize| stands.as_ref().is_some_and(|stands| stands[i] && stands[i + 1]);
    let under_load: Vec<f64> = steps
        .iter()
        .enumerate()
        .filter(|(i, _)| !paused(*i))
        .map(|(_, step)| missed(step))
        .filter(|missing| *missing >= 1.0)
        .collect();
    let gaps = under_load.len() <= PAUSES && under_load.iter().all(|missing| *missing < DROPPED[0] * promised);
    let counts = if gaps { 0.0 } else { under_load.iter().sum() };
    let untold = absent.min(counts) >= UNTOLD * promised && !told;
    (scattered || untold).then(|| {
        let holes = if holes.len() == 1 { "one hole".to_owned() } else { format!("{} holes", holes.len()) };
        let first = steps.iter().position(|step| missed(step) >= 1.0).unwrap_or(0);
        let after = number(log.t[first]);
        let found = format!(
            "{missing} of the {promised} rows are missing that sample_hz = {} promises, in {holes}, from {after} s on",
            number(hz)
        );
        (found, first)
    })
}

fn number(value: f64) -> String {
    trimmed(value, 6)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A log at 10 rows a second of which `keep` keeps some rows, with times multiplied by `scale`.
    fn log(head: &str, scale: f64, keep: impl Fn(usize) -> bool) -> Result<Log, String> {
        let rows: String =
            (0..300).filter(|n| keep(*n)).map(|n| format!("{},1000,{n}\n", trimmed(0.1 * n as f64 * scale, 3))).collect();
        let text = format!("# quadrig-log 1\n{head}t_s,pulse_us,rpm\n{rows}");
        Log::parse("run.csv", text.as_bytes()).map_err(|e| e.to_string())
    }

    const RATE: &str = "# sample_hz = 10.0\n";

    #[test]
    fn dropped_rows_are_refused_where_a_rate_is_stated() {
        let fifth = log(RATE, 1.0, |n| n % 5 != 3).expect_err("every fifth row is gone");
        assert!(fifth.contains("column t_s: 60 of the 300 rows are missing"), "{fifth}");
        assert!(fifth.contains("in 60 holes, from 0.2 s on; expected a row each 0.1 s; rows were dropped"), "{fifth}");
        let block = log(RATE, 1.0, |n| !(100..160).contains(&n)).expect_err("a fifth is gone");
        assert!(block.contains("60 of the 300 rows are missing") && block.contains("one hole"), "{block}");
        // three lines of head, and the hole is after the hundredth row
        assert!(block.starts_with("run.csv:103: "), "{block}");
        let thinned = log(RATE, 1.0, |n| n % 2 == 0).expect_err("every other row is gone");
        assert!(thinned.contains("149 of the 299 rows"), "{thinned}");
        // blocks of seconds, none of them large
        let blocks = log(RATE, 1.0, |n| n % 50 < 38 || n > 290).expect_err("a fifth is gone in blocks");
        assert!(blocks.contains("63 of the 300 rows are missing"), "{blocks}");
        // a line that failed for seconds, three times
        log(RATE, 1.0, |n| n % 100 < 79 || n > 299).expect("gaps of a logger");
        // a recorder that was stopped while the motor stood
        let rows: String = (0..300)
            .filter(|n| !(100..180).contains(n))
            .map(|n| {
                let rpm = if (80..=200).contains(&n) { 0 } else { 4000 };
                format!("{},1000,{rpm}\n", trimmed(0.1 * f64::from(n), 3))
            })
            .collect();
        let text = format!("# quadrig-log 1\n{RATE}t_s,pulse_us,rpm\n{rows}");
        Log::parse("run.csv", text.as_bytes()).expect("a pause");
        // what the line loses now and then, a hole that the recorder has told, and a log that states no rate
        log(RATE, 1.0, |n| n % 50 != 3).expect("a few rows");
        log(&format!("{RATE}# event = \"16.000 s: no sample for 6.1 s before this one\"\n"), 1.0, |n| !(100..160).contains(&n))
            .expect("it is told");
        log("", 1.0, |n| n % 5 != 3).expect("uneven sampling is allowed");
    }

    /// Times of eight rows a second by a clock that ticks ten times: no row is missing.
    #[test]
    fn a_coarse_clock_drops_no_rows() {
        let rows: String = (0..300).map(|n| format!("{:.1},1000,{n}\n", (f64::from(n) / 0.8).floor() / 10.0)).collect();
        let text = format!("# quadrig-log 1\n# sample_hz = 8.0\nt_s,pulse_us,rpm\n{rows}");
        Log::parse("run.csv", text.as_bytes()).expect("all rows are there");
    }

    #[test]
    fn milliseconds_are_no_seconds() {
        let stated = log(RATE, 1000.0, |_| true).expect_err("milliseconds");
        assert!(stated.contains("rows 100 s apart, where sample_hz says 0.1 s; expected seconds"), "{stated}");
        assert!(stated.contains("these look like milliseconds: divide t_s by 1000"), "{stated}");
        assert!(
            log(RATE, 1e6, |_| true).expect_err("microseconds").contains("these look like microseconds: divide t_s by 1000000")
        );
        let minutes = log(RATE, 1.0 / 60.0, |_| true).expect_err("minutes");
        assert!(minutes.contains("these look like minutes (60 s each)"), "{minutes}");
        let micro = log("", 1e6, |_| true).expect_err("microseconds");
        assert!(micro.contains("these look like microseconds: divide t_s by 1000000"), "{micro}");
        let twice = log("# sample_hz = 10.0\n# sample_hz = 20.0\n", 1.0, |_| true).expect_err("a key twice");
        assert!(twice.contains("run.csv:3: column sample_hz: it stands twice in the head"), "{twice}");
        let whole = log("", 1000.0, |_| true).expect_err("milliseconds");
        assert!(whole.contains("whole numbers, 100 apart, up to 29900") && whole.contains("# sample_hz = 0.01"), "{whole}");
        log("# sample_hz = 0.01\n", 1000.0, |_| true).expect("it says that rows are 100 s apart");
        assert!(
            log("# sample_hz = \"ten\"\n", 1.0, |_| true)
                .expect_err("a word")
                .contains("run.csv:2: sample_hz = \"ten\"; expected a number")
        );
        assert!(
            log("# sample_hz = 0\n", 1.0, |_| true)
                .expect_err("none")
                .contains("run.csv:2: sample_hz = 0; expected a number of rows")
        );
        log("# time = \"row\"\n", 10_000.0, |_| true).expect("a table without time");
    }

    #[test]
    fn steps_back_say_why() {
        let text = |times: &[f64]| {
            let rows: String = times.iter().map(|t| format!("{},1000,1\n", trimmed(*t, 3))).collect();
            let text = format!("# quadrig-log 1\nt_s,pulse_us,rpm\n{rows}");
            Log::parse("run.csv", text.as_bytes()).expect_err("it steps back").to_string()
        };
        let shuffled: Vec<f64> = (0..60).map(|n| f64::from(n * 37 % 60) / 10.0).collect();
        assert!(text(&shuffled).contains("rows look shuffled, sort them by t_s"), "{}", text(&shuffled));
        let twice: Vec<f64> = (0..40).chain(0..40).map(|n| f64::from(n) / 10.0).collect();
        assert!(
            text(&twice).contains("run.csv:43: column t_s: 0 steps back from 3.9") && text(&twice).contains("a second run"),
            "{}",
            text(&twice)
        );
        // the clock leaps for a row or two: the row that leaps is told, not the one that is right again
        for (leaps, times) in [(1, [999_999.0; 2]), (2, [999_999.0, 999_999.1])] {
            let odd = |n: usize| if (25..25 + leaps).contains(&n) { times[n - 25] } else { n as f64 / 10.0 };
            let said = text(&(0..60).map(odd).collect::<Vec<f64>>());
            let found = format!("run.csv:28: column t_s: 999999 leaps ahead, after 2.4; line {} goes on at 2.", 28 + leaps);
            assert!(said.contains(&found) && said.contains("expected") && said.contains("take the row out"), "{said}");
        }
        // the row that steps back is the odd one where time goes on behind it
        let late: Vec<f64> = (0..60).map(|n| if n == 25 { 2.35 } else { f64::from(n) / 10.0 }).collect();
        assert!(text(&late).contains("run.csv:28: column t_s: 2.35 steps back from 2.4"), "{}", text(&late));
        let once: Vec<f64> = (0..40).map(|n| if n == 20 { 1.95 } else { f64::from(n) / 10.0 }).chain([3.85]).collect();
        assert!(text(&once).contains("one row steps back (`quadrig import`"), "{}", text(&once));
    }
}
