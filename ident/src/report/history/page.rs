//! A rig's history as one page.
//!
//! What it is: what changed as its heading, control charts of what moved and of the constants, each change in numbers; folded away every other
//! measure and the values run by run; at the end the logs with their digests.
//! What can go wrong: nothing; a measure without a run before the change has no chart.
//! Units: on the axes.
//! Reference: Tufte, "The Visual Display of Quantitative Information" (small multiples).

use super::chart::chart;
use super::{MOVED, bracketed, foremost, why_no_change};
use crate::history::{Change, Entry, History, Name, fewest_judged, gap, in_doubt, sentence, summary};
use crate::report::sheet::Sheet;
use crate::verdict::words::{probability, upper, with_interval};

/// Charts that stand above the fold.
const ABOVE: usize = 9;

/// The page.
#[must_use]
pub fn page(history: &History) -> String {
    let mut sheet = Sheet::told("A rig's history", &heading(history));
    sheet.soft(&span(history));
    in_doubt(history).iter().for_each(|doubt| sheet.warn(&format!("{}.", upper(doubt))));
    let shown = charted(history);
    let (above, below) = shown.split_at(shown.len().min(ABOVE));
    sheet.section("Control charts");
    sheet.say(&key(history));
    if let Some(why) = why_no_change(history) {
        sheet.say(why);
    }
    sheet.multiples(above.iter().filter_map(|m| chart(history, *m)).collect());
    for change in &history.changes {
        of_change(&mut sheet, history, change);
    }
    sheet.section("More");
    if !below.is_empty() {
        sheet.fold("Every other measure", |sheet| sheet.multiples(below.iter().filter_map(|m| chart(history, *m)).collect()));
    }
    sheet.fold("Constants run by run", |sheet| table(sheet, history));
    origin(&mut sheet, history);
    sheet.html()
}

/// The program, and the logs with their digests.
fn origin(sheet: &mut Sheet, history: &History) {
    sheet.comes_from(&[("runs", history.runs.len().to_string())]);
    let row = |(k, run): (usize, &Entry)| vec![history.label(k), run.run.clone(), run.sha256.clone()];
    sheet.data("logs", &["run", "log", "SHA-256"], &history.runs.iter().enumerate().map(row).collect::<Vec<_>>(), None);
}

/// What changed first, then over how many runs.
fn heading(history: &History) -> String {
    if history.changes.is_empty() {
        return summary(history);
    }
    history.changes.iter().map(|c| sentence(history, c)).collect::<Vec<_>>().join(" ")
}

fn span(history: &History) -> String {
    let n = history.runs.len();
    let order = if history.dated { "in the order of their days" } else { "in the order of their names or as they were given" };
    format!("{n} runs, {} to {}, {order}.", history.label(0), history.label(n - 1))
}

fn key(history: &History) -> String {
    let fewest = fewest_judged();
    if history.changes.is_empty() && history.runs.len() < fewest {
        return format!(
            "A ring is a run with its 95 % interval, the line the centre of all: their mean, of what is compared by its quotient the geometric mean. There are no limits: of fewer than {fewest} runs none can lie more than three of their own standard deviations from their mean."
        );
    }
    let before = if history.changes.is_empty() { "all runs" } else { "the runs before the first change" };
    format!(
        "A ring is a run with its 95 % interval. The line and the band are centre and limits (three standard deviations) of {before}. Orange lies outside, or is the level since a change; a dashed line is a change."
    )
}

/// Measures with a chart: what moved and the constants first, then all others that vary.
fn charted(history: &History) -> Vec<usize> {
    let mut out = foremost(history, usize::MAX);
    let varies = |m: &usize| {
        let series = history.series(*m);
        let mut values = series.iter().flatten().map(|v| v.value);
        values.next().is_some_and(|first| values.any(|v| (v - first).abs() > 1e-9 * first.abs()))
    };
    let rest: Vec<usize> = (0..history.measures.len()).filter(|m| !out.contains(m)).filter(varies).collect();
    out.extend(rest);
    out
}

/// A change in numbers.
fn of_change(sheet: &mut Sheet, history: &History, change: &Change) {
    sheet.section(&upper(&gap(history, change)));
    sheet.say(&format!(
        "Probability that something changed: {}. That it lies in this gap: {}.",
        probability(change.probability),
        probability(change.gap_probability)
    ));
    let row = |m: &crate::history::Moved| {
        let [by, low, high] = with_interval(m.by, m.ci95);
        vec![upper(&m.words), by, format!("{low} to {high}"), m.unit.clone()]
    };
    let rows: Vec<Vec<String>> = change.moved.iter().map(row).collect();
    sheet.data("moved", &["moved", "by", "95 % interval", "unit"], &rows, None);
    names(sheet, &change.names);
}

/// What a change may be called, each with its probability; the file has the odds behind it too.
fn names(sheet: &mut Sheet, names: &[Name]) {
    if names.is_empty() {
        return;
    }
    let row = |n: &Name| vec![upper(&n.title), probability(n.probability), n.id.clone()];
    let raw = |n: &Name| vec![n.title.clone(), n.probability.to_string(), n.score.to_string(), n.id.clone()];
    let raw: Vec<Vec<String>> = names.iter().map(raw).collect();
    let head = ["name", "probability", "log_odds_nats", "effect"];
    sheet.data("names", &["name", "probability", "effect"], &names.iter().map(row).collect::<Vec<_>>(), Some((&head, &raw)));
}

fn table(sheet: &mut Sheet, history: &History) {
    sheet.say("In brackets: half of the 95 % interval, in units of the last digit.");
    let shown = foremost(history, MOVED);
    let head: Vec<String> = std::iter::once("run".to_owned())
        .chain(shown.iter().map(|m| format!("{}, {}", history.measures[*m].name, history.measures[*m].unit)))
        .collect();
    let row = |k: usize| {
        let values = shown.iter().map(|m| history.runs[k].values[*m].map_or_else(|| "-".to_owned(), bracketed));
        std::iter::once(history.label(k)).chain(values).collect()
    };
    let rows: Vec<Vec<String>> = (0..history.runs.len()).map(row).collect();
    sheet.data("run-by-run", &head.iter().map(String::as_str).collect::<Vec<_>>(), &rows, None);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::tests::stepped;

    #[test]
    fn the_heading_is_what_changed_and_every_measure_has_a_chart() {
        let history = stepped(12, 7);
        let html = page(&history);
        assert!(
            html.contains("<h1>Between run 7 and run 8: the measure 0 went from 5.1 to 14.4 N"),
            "{}",
            &html[html.find("<h1>").unwrap_or(0)..]
        );
        assert_eq!(html.matches("<svg").count(), 4);
        assert!(html.contains("12 runs, run 1 to run 12") && !html.contains("http://www.example"));
        let quiet = page(&stepped(12, 12));
        assert!(
            quiet.contains("<h1>Nothing changed over 12 runs")
                && quiet.contains(super::super::NO_CHANGE)
                && !html.contains(super::super::NO_CHANGE)
        );
        assert!(page(&stepped(4, 4)).contains("the geometric mean"));
    }

    /// What a reader sees is a probability; the odds behind it stand in the file alone.
    #[test]
    fn a_name_has_its_probability() {
        let mut history = stepped(12, 7);
        let name = |title: &str, score: f64, probability: f64| Name {
            id: title.replace(' ', "_"),
            title: title.to_owned(),
            words: title.to_owned(),
            score,
            probability,
        };
        history.changes[0].names = vec![name("one cause", 2.5, 0.71), name("its rival", 1.5, 0.26)];
        let html = page(&history);
        assert!(
            html.contains("<td>One cause</td><td data-of=\"probability\">0.71</td>") || html.contains("<td>0.71</td>"),
            "{html}"
        );
        assert!(html.contains("Less likely (0.26): its rival."), "{html}");
        assert!(!html.contains("evidence, nats") && html.contains("name,probability,log_odds_nats,effect"));
    }

    #[test]
    fn the_page_says_where_it_comes_from() {
        let mut history = stepped(12, 7);
        history.runs[3].sha256 = "5eed".into();
        let html = page(&history);
        let (_, end) = html.split_once("Where this comes from").expect("a section of its own");
        for said in [&format!("quadrig {}", env!("CARGO_PKG_VERSION")), "<td>12</td>", "3.csv", "5eed"] {
            assert!(end.contains(said), "{said}");
        }
    }
}
