//! The published tables of blind flights.
//!
//! What it is: lines of results in, Markdown out, rates with Wilson intervals beside the aims.
//! What can go wrong: an empty bin has no rate and says so.
//! Units: percent; noise floors.
//! Reference: Wilson 1927; specification `flight.md`, "The loop on flights".

use super::score::Line;
use crate::blind::tally::Rate;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Largest error after over that of the true form.
const AFTER: f64 = 1.15;

/// All tables.
#[must_use]
pub fn markdown(lines: &[Line]) -> String {
    let of = |kind: &'static str| lines.iter().filter(move |l| l.kind == kind);
    let quantile = |mut v: Vec<f64>, q: f64| {
        v.retain(|x| x.is_finite());
        v.sort_by(f64::total_cmp);
        v.get(((v.len().saturating_sub(1)) as f64 * q).round() as usize).copied().unwrap_or(f64::NAN)
    };
    let after = |kind: &'static str| of(kind).map(|l| l.after_told).collect::<Vec<f64>>();
    let covers = |l: &Line| l.covered.split('+').filter_map(|c| c.split(':').nth(1)).map(|c| c == "1").collect::<Vec<bool>>();
    let all: Vec<bool> = lines.iter().flat_map(covers).collect();
    let mut out =
        String::from("| blind flights, effects of three noise floors and above | reached | aim |\n| --- | --- | --- |\n");
    let mut row = |what: &str, reached: String, aim: &str| {
        let _ = writeln!(out, "| {what} | {reached} | {aim} |");
    };
    row("one effect: named first", Rate::over(of("one"), |l| l.first).text(), "90 %");
    row("one effect: the named set is the true one", Rate::over(of("one"), |l| l.exact).text(), "");
    row("two effects: one of them named first", Rate::over(of("two"), |l| l.first).text(), "");
    row("two effects: the named set is the true one", Rate::over(of("two"), |l| l.exact).text(), "");
    row("unknown effect: nothing named, and told", Rate::over(of("unknown"), |l| l.first).text(), "90 %");
    row("unknown effect: told on the channel that shows it", Rate::over(of("unknown"), |l| l.noticed).text(), "");
    row("clean flights on which something is named", Rate::over(of("clean"), |l| !l.first).text(), "2 %");
    row("clean flights whose verdict is not `none`", Rate::over(of("clean"), |l| l.verdict != "none").text(), "");
    row(
        "error on another flight over that of the true form, 90th percentile",
        format!("{:.3}", quantile(after("one"), 0.9)),
        "1.15",
    );
    row(
        "the same at most 1.15",
        Rate::over(of("one").filter(|l| l.after_told.is_finite()), |l| l.after_told <= AFTER).text(),
        "90 %",
    );
    row(
        "declared model's error over that of the true form, median",
        format!("{:.2}", quantile(of("one").map(|l| l.before_told).collect(), 0.5)),
        "",
    );
    row("95 % intervals that hold the truth", Rate::over(all.iter(), |c| **c).text(), "90 to 98 %");
    row(
        "time a flight, median and worst, s",
        format!(
            "{:.1}, {:.1}",
            quantile(lines.iter().map(|l| l.seconds).collect(), 0.5),
            quantile(lines.iter().map(|l| l.seconds).collect(), 1.0)
        ),
        "",
    );
    row(
        "refused, or a panic",
        lines.iter().filter(|l| matches!(l.verdict.as_str(), "refused" | "panic")).count().to_string(),
        "0",
    );
    out + &by_effect(lines)
}

fn by_effect(lines: &[Line]) -> String {
    let mut by: BTreeMap<&str, Vec<&Line>> = BTreeMap::new();
    for l in lines.iter().filter(|l| l.kind == "one" || l.kind == "unknown") {
        by.entry(if l.truth.contains("wind") { "wind" } else { l.truth.as_str() }).or_default().push(l);
    }
    let mut out = "\n| hidden | trials | right first | named instead or beside |\n| --- | --- | --- | --- |\n".to_owned();
    for (id, own) in by {
        let mut others: BTreeMap<&str, usize> = BTreeMap::new();
        for l in &own {
            let wrong = l.named.split('+').filter(|n| !n.is_empty() && *n != "unknown" && !l.truth.split('+').any(|t| t == *n));
            wrong.for_each(|n| *others.entry(n).or_default() += 1);
        }
        let list: Vec<String> = others.iter().map(|(n, k)| format!("{n} ({k})")).collect();
        let right = own.iter().filter(|l| l.first).count();
        let _ =
            writeln!(out, "| {id} | {} | {right} | {} |", own.len(), if list.is_empty() { "-".into() } else { list.join(", ") });
    }
    out
}

/// Trials that failed, a line each.
#[must_use]
pub fn failures(lines: &[Line]) -> String {
    let failed = lines.iter().filter(|l| !l.first || l.wrong > 0 || l.after_told > AFTER);
    let mut out = "\n| seed | kind | truth | size | shown | verdict | named | after/true form |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n".to_owned();
    for l in failed {
        let _ = writeln!(
            out,
            "| {} | {} | {} | {:.1} | {} | {} | {} | {:.2} |",
            l.seed, l.kind, l.truth, l.size, l.shown, l.verdict, l.named, l.after_told
        );
    }
    out
}
