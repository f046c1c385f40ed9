//! The airframe's effects as pages, written from the library itself.
//!
//! What it is: for each effect its equation with source, its parameters, what it changes in the channels of a standard flight, and what looks
//! alike there.
//! What can go wrong: a page speaks of the standard flight; on another one the verdict computes its own angles.
//! Units: changes in noise floors of their channel, so that channels can be drawn together.
//! Reference: specification `closing-the-loop.md`, step 5.

use crate::attribution::columns::evidence::White;
use crate::attribution::columns::fit::difference;
use crate::attribution::columns::{Column, Fit, Library, Noise, Owner, Placed, Prior, Problem, fit};
use crate::flight::columns::Flight;
use crate::flight::effects::{AirframeEffect, library};
use crate::flight::library::{FlightLibrary, Kind};
use crate::flight::record::Record;
use crate::flight::standard::standard_flight;
use crate::numeric::digits::number;
use crate::report::almanac::{Page, looks_alike};
use crate::report::{Figure, Layer};
use crate::verdict::words::plain;
use std::fmt::Write;

/// Channels that a figure holds at most.
const DRAWN: usize = 6;

/// What one form of an effect changes at its usual size, a column over the channels.
struct Signature {
    effect: &'static dyn AirframeEffect,
    placed: Placed,
    column: Column,
}

/// Every page, and the index.
///
/// # Panics
/// Never: the standard flight can be read and fitted, which a test shows.
#[must_use]
pub fn almanac() -> (Vec<Page>, String) {
    let flight = Flight::of(Record::of(&standard_flight()).expect("a flight"));
    let causes = FlightLibrary::new(&flight);
    let problem = Problem { channels: &flight.channels.channels, library: &causes };
    let declared = fit(&problem, &[], None, 0).expect("the declared model");
    let floors: Vec<Noise> = problem.channels.iter().map(Noise::floor).collect();
    let white = White::new(problem.channels, &floors, &declared.design);
    let all: Vec<Signature> = (0..causes.kinds.len()).filter_map(|k| signature(&problem, &causes, &declared, k)).collect();
    let pages = library().iter().map(|e| page(*e, &flight, &all, &white)).collect();
    let mut index = String::from(
        "# Effects on a flight\n\nWritten by `quadrig effects` from the library itself. What `close-loop` asks of a flight log; the rig's are [here](../README.md). Each page has the equation with its source, the parameters with their bounds, what the effect changes on a standard flight, and what looks alike there.\n\n| id | what | depends on |\n| --- | --- | --- |\n",
    );
    for effect in library() {
        let about = effect.about();
        let depends = if about.depends_on.is_empty() { "-".to_owned() } else { about.depends_on.join(", ") };
        let _ = writeln!(index, "| [{}]({}.md) | {} | {depends} |", effect.id(), effect.id(), about.title);
    }
    (pages, index)
}

fn signature(problem: &Problem<'_>, causes: &FlightLibrary<'_>, declared: &Fit, candidate: usize) -> Option<Signature> {
    let Kind::Effect(effect, _) = &causes.kinds[candidate] else { return None };
    let own = &causes.candidates()[candidate];
    let shape = own.starts[own.starts.len() / 2].clone();
    let placed = Placed { candidate, shape };
    let needed = own.needs.first().and_then(|id| causes.find(id, ""));
    let base: Vec<Placed> = needed.map(|candidate| Placed { candidate, shape: Vec::new() }).into_iter().collect();
    let design = problem.library.design(&[base.as_slice(), std::slice::from_ref(&placed)].concat());
    let usual = |c: &Column| if c.prior.mean == 0.0 { c.prior.sd } else { c.prior.mean };
    let mut amplitudes = declared.amplitudes.clone();
    amplitudes.extend(design.columns[amplitudes.len()..].iter().map(usual));
    // beside what it needs, with the usual size of that
    let before = problem.library.design(&base);
    let mut rest = before.clone();
    rest.columns.extend(design.columns[before.columns.len()..].iter().map(|c| Column { parts: Vec::new(), ..c.clone() }));
    let parts = difference(problem.channels, &amplitudes, &rest, &design, 1.0);
    let column = Column { owner: Owner::Term(0), name: "change", prior: Prior::about_zero(1.0), parts };
    let changes = column.parts.iter().any(|(_, v)| v.iter().any(|x| x.abs() > 0.0));
    changes.then_some(Signature { effect: *effect, placed, column })
}

fn page(effect: &'static dyn AirframeEffect, flight: &Flight, all: &[Signature], white: &White) -> Page {
    let (about, id) = (effect.about(), effect.id());
    let depends = if about.depends_on.is_empty() { "nothing".to_owned() } else { about.depends_on.join(", ") };
    let mut text = format!(
        "# {id}\n\n{}.\n\n```text\n{}\n```\n\nSource: {}\n\nIn the residual: {}.\n\nDepends on: {depends}.\n",
        about.title,
        about.equation,
        about.source,
        plain(about.signature)
    );
    text.push_str("\n## Parameters\n\nBounds are those of the standard flight.\n\n| parameter | unit | from | to |\n| --- | --- | --- | --- |\n");
    let own: Vec<&Signature> = all.iter().filter(|s| s.effect.id() == id).collect();
    for (name, unit, bounds) in parameters(effect, flight) {
        let (lo, hi) = bounds.map_or(("fitted".to_owned(), String::new()), |(a, b)| (number(a), number(b)));
        let _ = writeln!(text, "| {name} | {unit} | {lo} | {hi} |");
    }
    let alike = library().iter().filter(|other| other.id() != id).filter_map(|other| {
        let theirs = all.iter().filter(|s| s.effect.id() == other.id());
        let pairs = theirs.flat_map(|t| own.iter().map(move |o| white.cosine(&o.column, &t.column).abs()));
        pairs.max_by(f64::total_cmp).map(|c| (c, other.id()))
    });
    text.push_str(&looks_alike("flight, with the declared model's columns taken out", alike, about.look_alikes));
    match own.first() {
        Some(s) => {
            let form = flight_form(effect, flight, s);
            let _ = write!(
                text,
                "\n## Signature\n\n![what {id} changes in each channel]({id}.svg)\n\nChange of each channel at the effect's usual size{form}, in noise floors of the channel.\n"
            );
        }
        None => text.push_str("\n## Signature\n\nThe standard flight cannot hold it.\n"),
    }
    Page { id, text, figure: figure(id, flight, own.first().copied()) }
}

/// Name, unit and bounds of a parameter.
type Listed = (String, String, Option<(f64, f64)>);

/// Each parameter of an effect, shapes first.
fn parameters(effect: &'static dyn AirframeEffect, flight: &Flight) -> Vec<Listed> {
    let mut out: Vec<Listed> = Vec::new();
    for form in effect.forms(flight) {
        let own: Vec<(&'static str, crate::flight::effects::Told)> =
            form.shapes.iter().map(|s| (s.name, crate::flight::effects::Told { value: s.range.0, se: 0.0 })).collect();
        let found = crate::flight::effects::Found { flight, form: &form, own, others: Vec::new() };
        for p in effect.report(&found) {
            let bounds = form.shapes.iter().find(|s| s.name == p.name).map(|s| s.range);
            if !out.iter().any(|(name, ..)| *name == p.name) {
                out.push((p.name, p.unit, bounds));
            }
        }
    }
    out
}

/// In which form and at which shapes a signature is drawn.
fn flight_form(effect: &'static dyn AirframeEffect, flight: &Flight, s: &Signature) -> String {
    let forms = effect.forms(flight);
    let Some(form) = forms.iter().find(|f| f.shapes.len() == s.placed.shape.len()) else { return String::new() };
    let at: Vec<String> =
        form.shapes.iter().zip(&s.placed.shape).map(|(p, v)| format!("{} = {} {}", p.name, number(*v), p.unit)).collect();
    let name = if form.name.is_empty() { String::new() } else { format!(" ({})", form.name) };
    if at.is_empty() { name } else { format!("{name}, at {}", at.join(", ")) }
}

fn figure(id: &str, flight: &Flight, signature: Option<&Signature>) -> Figure {
    const CLASSES: [&str; DRAWN] = ["a", "b", "c", "d", "e", "f"];
    let channels = &flight.channels.channels;
    let mut parts: Vec<(usize, Vec<f64>)> = signature
        .iter()
        .flat_map(|s| s.column.parts.iter().map(|(c, v)| (*c, v.iter().map(|x| x / channels[*c].floor).collect())))
        .collect();
    let size = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>();
    parts.sort_by(|a, b| size(&b.1).total_cmp(&size(&a.1)));
    let line = |((c, y), class): ((usize, Vec<f64>), &&'static str)| Layer::Line {
        name: channels[c].name.clone(),
        class,
        x: flight.windows.t.clone(),
        y,
    };
    Figure {
        id: id.to_owned(),
        title: format!("{id} on the standard flight"),
        x_label: "time, s".into(),
        y_label: "change, noise floors".into(),
        layers: parts.into_iter().zip(&CLASSES).map(line).collect(),
        ..Figure::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_has_a_page_and_shows_on_the_standard_flight() {
        let (pages, index) = almanac();
        assert_eq!(pages.len(), library().len());
        for page in &pages {
            assert!(page.text.contains("## Parameters") && index.contains(&format!("[{}]", page.id)), "{}", page.id);
            assert!(!page.figure.is_empty(), "{} changes nothing on the standard flight", page.id);
        }
    }

    #[test]
    fn an_effect_looks_like_itself() {
        let flight = Flight::of(Record::of(&standard_flight()).unwrap());
        let causes = FlightLibrary::new(&flight);
        let problem = Problem { channels: &flight.channels.channels, library: &causes };
        let declared = fit(&problem, &[], None, 0).unwrap();
        let drag = signature(&problem, &causes, &declared, causes.find("rotor_drag", "").unwrap()).unwrap();
        let floors: Vec<Noise> = problem.channels.iter().map(Noise::floor).collect();
        let white = White::new(problem.channels, &floors, &declared.design);
        assert!((white.cosine(&drag.column, &drag.column) - 1.0).abs() < 1e-9);
    }
}
