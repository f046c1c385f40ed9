//! The page itself: the order of the questions.
//!
//! What it is: sentence, state, the figure that convinces most, cards, what is left, what would settle it; then the folds.
//! What can go wrong: nothing; each part leaves out what is not there.
//! Units: on the axes.
//! Reference: specification `report.md`.

use super::provenance::{Origin, provenance};
use super::sentence::{PER_CENT, unnamed_rest};
use super::vocabulary::Vocabulary;
use super::{cards, cautions, fold, left, sentence, state};
use crate::channel::unit_of;
use crate::report::figure::Figure;
use crate::report::sheet::Sheet;
use crate::verdict::words::{digits, heading, scaled};
use crate::verdict::{Kin, Kind, Validation, Verdict};

/// What a page is made of.
pub(crate) struct Page<'p> {
    /// The verdict.
    pub(crate) verdict: &'p Verdict,
    /// The words of its library.
    pub(crate) words: Vocabulary,
    /// Whether a declared model was given, so that what was found is new since then.
    pub(crate) news: bool,
    /// Where it comes from.
    pub(crate) origin: Origin,
    /// What the declared model is, in a paragraph.
    pub(crate) declared: String,
    /// The figures that convince most.
    pub(crate) hero: Vec<Figure>,
    /// Figures of each effect of the verdict, in its order.
    pub(crate) cards: Vec<Vec<Figure>>,
    /// Figures of what is left.
    pub(crate) left: Vec<Figure>,
    /// Single readings that were set apart.
    pub(crate) readings: Vec<Reading>,
    /// Of several runs: each parameter run by run, the head first.
    pub(crate) parameters: Vec<Vec<String>>,
    /// Figures of several speeds together, under a heading of their own.
    pub(crate) speeds: (&'static str, Vec<Figure>),
}

/// A single reading that was set apart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Reading {
    /// With several runs the one that it is of, else empty.
    pub(crate) run: String,
    /// Channel.
    pub(crate) channel: String,
    /// When, s, or its row where time is the row.
    pub(crate) t: f64,
    /// Whether time is the row.
    pub(crate) is_row: bool,
    /// What was read.
    pub(crate) value: f64,
    /// The median of it and its neighbours.
    pub(crate) expected: f64,
    /// Unit of both.
    pub(crate) unit: &'static str,
}

/// The page up to where the folds begin.
pub(crate) fn begin(page: &Page<'_>) -> Sheet {
    let v = page.verdict;
    let of_what = if v.runs.is_empty() { v.run.clone() } else { format!("{} runs of one rig", v.runs.len()) };
    let said = sentence(v, page.words, page.news);
    let declared = if page.news { "the one that was given" } else { page.words.declared };
    let mut sheet = Sheet::told(&format!("{of_what}: what the model lacks"), &said);
    sheet.soft(&page.origin.line());
    sheet.html_part(&state::state(v, declared, said.contains(PER_CENT), state::is_as_before(v, page.news)));
    match page.origin.lacks.as_slice() {
        [lack] => sheet.warn(&format!("{lack}.")),
        [lack, others @ ..] => {
            let runs =
                if others.len() == 1 { "One more run lacks".to_owned() } else { format!("{} more runs lack", others.len()) };
            sheet.warn(&format!("{lack}. {runs} rows, told under \"Rows that are missing\"."));
        }
        [] => {}
    }
    page.origin.doubts.iter().for_each(|doubt| sheet.warn(&format!("{doubt}{}", if doubt.ends_with('?') { "" } else { "." })));
    cautions::cautions(v).iter().for_each(|caution| sheet.warn(caution));
    for l in &v.left_out {
        sheet.warn(&format!("Left out: {l}."));
    }
    if !page.hero.is_empty() {
        let of_every = format!("What every {} has, where it shows most", page.words.noun);
        sheet.section(match v.verdict {
            _ if unnamed_rest(v, page.words).is_some() => "The channel on which most is left",
            // that a rotor takes time convinces nobody of anything
            Kind::Attributed if v.effects.iter().all(|e| e.id == "unknown" || e.kin != Kin::Own) => &of_every,
            Kind::Attributed | Kind::Ambiguous => "The figure that convinces most",
            Kind::Unattributed => "The channel on which most is left",
            Kind::None => "The loudest channel",
        });
        sheet.figures(page.hero.clone());
        if v.runs.is_empty() {
            sheet.soft(page.words.figures);
        }
    }
    cards::cards(&mut sheet, page);
    left::left(&mut sheet, page);
    left::settle(&mut sheet, page);
    let (heading, speeds) = &page.speeds;
    if !speeds.is_empty() {
        sheet.section(heading);
        sheet.figures(speeds.clone());
    }
    if !v.runs.is_empty() {
        sheet.section("Each run, predicted by the others");
        sheet.say("Predicted whole by a fit to the other runs, one constant a channel apart. Before and after, rms.");
        sheet.say("The probabilities above are those of all runs together. Each run is a witness of its own, and what they say adds up: a name that no run alone is sure of may be sure here.");
        runs(&mut sheet, v, &v.runs, "each-run");
    }
    if let [head, rows @ ..] = page.parameters.as_slice()
        && !rows.is_empty()
    {
        sheet.section("Each parameter, run by run");
        sheet
            .say("All runs together, then each run alone with the same effects. A value that a run alone does not know wanders.");
        let head: Vec<&str> = head.iter().map(String::as_str).collect();
        sheet.data("run-by-run", &head, rows, None);
    }
    if !v.validation.is_empty() {
        let noun = page.words.noun;
        sheet.section(&format!("On other runs of the {noun}"));
        sheet.say(&format!(
            "Predicted from this run's model alone: what belongs to the {noun} carries over. Before and after, rms."
        ));
        runs(&mut sheet, v, &v.validation, "other-runs");
    }
    provenance(&mut sheet, &page.origin, v);
    sheet.section("More");
    if page.origin.lacks.len() > 1 {
        sheet.fold("Rows that are missing", |sheet| page.origin.lacks.iter().for_each(|lack| sheet.say(&format!("{lack}."))));
    }
    fold::sureness(&mut sheet, page);
    sheet.fold("Every channel in numbers", |sheet| {
        sheet.say(&page.declared);
        fold::channels(sheet, v, page.words.held_out);
    });
    sheet
}

/// Before and after on runs of the rig, a column each run.
fn runs(sheet: &mut Sheet, v: &Verdict, list: &[Validation], name: &str) {
    let mut names: Vec<&String> = list.iter().flat_map(|r| r.channels.keys()).collect();
    names.sort_unstable();
    names.dedup();
    let head: Vec<String> = std::iter::once("channel".to_owned()).chain(list.iter().map(|r| r.run.clone())).collect();
    let rows: Vec<Vec<String>> = names
        .into_iter()
        .map(|channel| {
            let unit = v.channels.get(channel).map_or(unit_of(channel), |c| c.unit.as_str());
            let most = list.iter().filter_map(|r| r.channels.get(channel)).map(|b| b.before.max(b.after)).fold(0.0, f64::max);
            let (factor, unit) = scaled(most, unit);
            let unit = if unit == "rpm" { "rev/min" } else { unit };
            let cell = |r: &Validation| {
                r.channels.get(channel).map_or_else(String::new, |b| {
                    let [before, after] = [b.before, b.after].map(|v| digits(factor * v, 0.005 * (factor * v).abs()));
                    format!("{before} \u{2192} {after} ({})", state::factor(b.before, b.after))
                })
            };
            std::iter::once(format!("{}, {unit}", heading(channel))).chain(list.iter().map(cell)).collect()
        })
        .collect();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let raw_head = ["channel", "unit", "run", "before", "after"];
    let raw = list.iter().flat_map(|r| r.channels.iter().map(move |(name, b)| (r, name, b)));
    let raw: Vec<Vec<String>> = raw
        .map(|(r, name, b)| {
            vec![name.clone(), unit_of(name).to_owned(), r.run.clone(), b.before.to_string(), b.after.to_string()]
        })
        .collect();
    sheet.data(name, &head, &rows, Some((&raw_head, &raw)));
}
