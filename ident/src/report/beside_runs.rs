//! Constants and fits of several runs, run beside run.
//!
//! What it is: what `identify` says of each run alone: its constants in one table, and each relation that two runs or more have in one figure.
//! What can go wrong: a run without plateaus has no row and no line.
//! Units: as told.
//! Reference: `identify`; specification `identification.md`.

use super::closed::thinned;
use super::figure::{Figure, Layer};
use super::run::{self, CLASSES};
use super::sheet::Sheet;
use crate::identify::{Identified, identify};
use crate::log::Log;
use crate::verdict::words;

/// The fold of the page; nothing where no run has a constant.
pub(super) fn beside_runs(sheet: &mut Sheet, runs: &[(&str, &Log)]) {
    let found: Vec<(&str, Identified)> = runs.iter().filter_map(|(name, log)| Some((*name, identify(log).ok()?))).collect();
    // one run may show what another does not
    let mut known: Vec<(&str, &str)> = Vec::new();
    for (symbol, unit) in found.iter().flat_map(|(_, f)| &f.constants).map(|c| (c.name, c.unit)) {
        if !known.iter().any(|(other, _)| *other == symbol) {
            known.push((symbol, unit));
        }
    }
    if known.is_empty() {
        return;
    }
    sheet.fold("Constants and fits, run by run", |sheet| {
        sheet.say("Each run alone, as identify has it: value and half of the 95 % interval.");
        let head: Vec<String> = known.iter().map(|(name, unit)| format!("{name}, {unit}")).collect();
        let head: Vec<&str> = std::iter::once("run").chain(head.iter().map(String::as_str)).collect();
        let row = |(name, found): &(&str, Identified)| {
            let cell = |symbol: &str| {
                let of = found.constants.iter().find(|c| c.name == symbol);
                of.map_or_else(
                    || "-".to_owned(),
                    |c| format!("{} \u{b1} {}", words::digits(c.value, c.half), words::digits(c.half, 0.1 * c.half)),
                )
            };
            std::iter::once((*name).to_owned()).chain(known.iter().map(|(symbol, _)| cell(symbol))).collect()
        };
        let rows: Vec<Vec<String>> = found.iter().map(row).collect();
        sheet.data("constants-run-by-run", &head, &rows, None);
        sheet.figures(relations(&found).into_iter().map(thinned).collect());
    });
}

/// A relation's curves of all runs that have it, as many as there are colours.
fn relations(found: &[(&str, Identified)]) -> Vec<Figure> {
    let mut out: Vec<Figure> = Vec::new();
    for f in found.iter().flat_map(|(_, of)| &of.curves) {
        let (id, title) = (format!("runs-{}", run::anchor_of(f)), words::upper(&run::over(f)));
        if out.iter().any(|figure| figure.id == id) {
            continue;
        }
        let with: Vec<_> =
            found.iter().filter_map(|(name, of)| Some((*name, of.curves.iter().find(|c| c.name == f.name)?))).collect();
        let layer = |((name, f), class): (&(&str, &crate::identify::curves::Fitted), &'static str)| {
            let (x, y) = run::line(f);
            Layer::Line { name: (*name).to_owned(), class, x, y }
        };
        if with.len() > 1 {
            let [x_label, y_label] = run::axes(f);
            let drawn = with.len().min(CLASSES.len());
            let of = if with.len() > drawn { format!(", {drawn} of {} runs", with.len()) } else { String::new() };
            let layers = with.iter().zip(CLASSES).map(layer).collect();
            out.push(Figure { id, title: format!("{title}{of}"), x_label, y_label, layers, ..Figure::default() });
        }
    }
    out
}
