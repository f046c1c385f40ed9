//! The page of several runs of one rig.
//!
//! What it is: the page that every closed loop has, on what the runs share; then each run, predicted by a fit to the others, with a link to its
//! own page, and each parameter run by run.
//! What can go wrong: a run that cannot tell of an effect has no value of it.
//! Units: as told.
//! Reference: specification `formats.md`, `across_runs_rms`.

use super::closed::{self as parts, Origin, Page, Vocabulary, pair};
use super::figure::Figure;
use super::page::{SPEEDS, cards, is_drawn_together, over_runs, rest, speeds};
use super::svg::escape;
use crate::close::Closed;
use crate::effects::{EffectEntry, Estimate};
use crate::several::{Outcome, Run};
use crate::verdict::{BeforeAfter, Channel, Channels, Figures, Unexplained, Validation};
use crate::words::digits;

/// The report of several runs as one self-contained page; `links` are the pages of the runs, in their order.
#[must_use]
pub fn several(runs: &[Run], outcome: &Outcome, links: &[String]) -> String {
    let v = &outcome.verdict;
    let alone: Vec<Closed> = (0..runs.len()).map(|run| of_run(runs, outcome, run)).collect();
    let first = outcome.shown.as_ref().map_or(0, |shown| shown.run);
    let own = |u: &&Unexplained| !is_drawn_together(&alone[first], u);
    let page = Page {
        verdict: v,
        words: Vocabulary::RIG,
        news: false,
        origin: Origin::of_several(&runs.iter().map(|r| &r.log).collect::<Vec<_>>()),
        declared: "Before: the declared baseline, one set of static curves for all runs, one constant a channel and run. After: the same with every effect of the rig that is named above. The error is that of a run predicted by a fit to the other runs, as a geometric mean over the runs.".to_owned(),
        hero: outcome.shown.as_ref().map(|shown| over_runs(v, shown)).unwrap_or_default(),
        cards: cards_of(&alone, runs, outcome),
        left: v.unexplained.iter().filter(own).filter_map(|u| left_of(&alone, runs, u)).collect(),
        parameters: parameters(outcome),
        speeds: (SPEEDS, speeds(&runs[first].log, &alone[first]).into_iter().map(|figure| named(figure, &runs[first])).collect()),
    };
    let mut sheet = parts::begin(&page);
    for (run, of) in v.runs.iter().enumerate() {
        sheet.fold(&of.run, |sheet| {
            if let Some(link) = links.get(run) {
                sheet.html_part(&format!("<p><a href=\"{}\">The run alone</a>, with its own verdict.</p>\n", escape(link)));
            }
            sheet.html_part(&parts::bars(&channels(v, outcome, run, of), &[], pair(v)));
        });
    }
    sheet.html()
}

/// One run under the models of all.
fn of_run(runs: &[Run], outcome: &Outcome, run: usize) -> Closed {
    let log = &runs[run].log;
    Closed {
        context: outcome.contexts[run].clone(),
        diagnosis: runs[run].closed.diagnosis.clone(),
        declared: outcome.declared.on(log).into_owned(),
        model: outcome.model.on(log).into_owned(),
        verdict: outcome.verdict.clone(),
    }
}

/// The figure, with the run that it is of.
fn named(mut figure: Figure, run: &Run) -> Figure {
    figure.title = format!("{}, {}", figure.title, run.log.name);
    figure
}

/// Figures of each effect, of the run that the figure that convinces most is of; what happened on another run alone is shown on that one.
fn cards_of(alone: &[Closed], runs: &[Run], outcome: &Outcome) -> Vec<Vec<Figure>> {
    let first = outcome.shown.as_ref().map_or(0, |shown| shown.run);
    let order = std::iter::once(first).chain((0..runs.len()).filter(|run| *run != first));
    let mut out = vec![Vec::new(); outcome.verdict.effects.len()];
    for run in order.filter(|_| !runs.is_empty()) {
        // what is of one run alone is shown on that one
        let mut one = alone[run].clone();
        let shown = |e: &EffectEntry| e.run.as_ref().is_none_or(|of| *of == runs[run].log.name);
        let places: Vec<usize> = (0..out.len()).filter(|k| shown(&one.verdict.effects[*k])).collect();
        one.verdict.effects.retain(shown);
        for (k, figures) in places.into_iter().zip(cards(&one)) {
            if out[k].is_empty() {
                out[k] = figures.into_iter().map(|figure| named(figure, &runs[run])).collect();
            }
        }
    }
    out
}

/// The figure of what is left on a channel, of the run on which it is loudest.
fn left_of(alone: &[Closed], runs: &[Run], u: &Unexplained) -> Option<Figure> {
    let loudest = runs.iter().position(|run| u.looks_like.contains(&run.log.name));
    loudest.into_iter().chain(0..runs.len()).find_map(|run| Some(named(rest(&alone[run], u)?, &runs[run])))
}

/// Each parameter of the rig's effects as all runs share it, and as each run alone has it.
fn parameters(outcome: &Outcome) -> Vec<Vec<String>> {
    let value = |e: &Estimate| digits(e.value, if e.se.is_finite() && e.se > 0.0 { e.se } else { 0.005 * e.value.abs() });
    let head = ["parameter", "unit", "all runs"].into_iter().chain(outcome.verdict.runs.iter().map(|r| r.run.as_str()));
    let mut rows = vec![head.map(str::to_owned).collect()];
    for (added, alone) in outcome.model.effects.iter().zip(&outcome.alone) {
        let context = &outcome.contexts[0];
        let reported = added.placed.effect.report(context, &added.placed.instance, added.estimates.clone());
        for e in reported.iter().filter(|e| e.name != "phase") {
            let effect = added.placed.effect;
            let of = format!("{}: {}", effect.about().title, (Vocabulary::RIG.parameter)(effect.id(), &e.name));
            let mut row = vec![of, e.unit.clone(), value(e)];
            for run in alone {
                let run = added.placed.effect.report(context, &added.placed.instance, run.clone());
                row.push(run.iter().find(|own| own.name == e.name).map_or_else(|| "-".to_owned(), value));
            }
            rows.push(row);
        }
    }
    rows
}

/// The channels of one run, as the bars have them.
fn channels(v: &crate::verdict::Verdict, outcome: &Outcome, run: usize, of: &Validation) -> Channels {
    let mut out = Channels::default();
    let context = &outcome.contexts[run];
    for (name, BeforeAfter { before, after }) in &of.channels {
        let (Some(whole), Some(target)) = (v.channels.get(name), context.target(name)) else { continue };
        let figures = |rms: f64| Figures { rms, heldout_rms: rms, across_runs_rms: Some(rms), whiteness_p: 1.0 };
        let floor = context.targets[target].noise.rms;
        let channel =
            Channel { unit: whole.unit.clone(), noise_floor_rms: floor, before: figures(*before), after: figures(*after) };
        out.predicted.insert(name.clone(), channel);
    }
    out
}
