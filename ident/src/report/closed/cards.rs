//! One card an effect: what it does, how sure it is, what it removes, its parameters, what else it could be, and its figures.
//!
//! What it is: the cards in the order of what they remove; sure and unsure ones look different, and say so.
//! What can go wrong: an effect without a figure of its own (a board told it) has a card without one.
//! Units: as the parameters state.
//! Reference: specification `formats.md`, "Verdict" (`effects`, `alternatives`).

use super::contest::{Rival, reserve, rivals};
use super::left::goes_with;
use super::lost;
use super::page::{Page, Reading};
use super::sentence::{order, without};
use super::state::figures;
use super::vocabulary::Vocabulary;
use crate::attribution::columns::UNKNOWN;
use crate::attribution::rivals::UNEXPLAINED;
use crate::report::figure::Figure;
use crate::report::sheet::Sheet;
use crate::report::svg::escape;
use crate::verdict::words::{
    SURE, channel, channels, counted, curve, digits, heading, in_force, lower, plain, probability, scaled, scope, signs, sized,
    sureness, upper, upper_bound, with_interval,
};
use crate::verdict::{Alternative, EffectEntry, Kin, Parameter, Verdict};
use std::fmt::Write;

/// Probability from which on what no hypothesis has is told.
pub(super) const OPEN: f64 = 0.05;
/// Probability from which on a rival is told beside a name: below it its figure is zero to two digits.
const COUNTED: f64 = 0.005;

/// Share of an error below which a name takes next to nothing: the factor before over after is 1.00.
const LITTLE: f64 = 0.005;
/// Times the error before from which on an error without an effect is said to be larger.
const MORE: f64 = 1.02;

/// The cards: those of this rig, those of every rig, and corrections without a name.
pub(super) fn cards(sheet: &mut Sheet, page: &Page<'_>) {
    let v = page.verdict;
    let order = order(v, page.words);
    let group = |e: &EffectEntry| match e.id.as_str() {
        "unknown" => 2,
        _ if e.is_of_single_readings() => 3,
        _ if e.kin != Kin::Own => 1,
        _ => 0,
    };
    let noun = page.words.noun;
    for (k, (heading, lead)) in [
        (format!("What this {noun} has"), kept(page).unwrap_or_default()),
        (format!("What every {noun} has"), format!("A rotor has inertia and takes time, meters average or come late within a row, and no two clocks run alike. Every {noun} has these; one run need not show how much.")),
        ("Without a name".to_owned(), "What no known effect explains. Where a smooth function predicts rows it has not seen, it is added to the model; it names no cause.".to_owned()),
    ]
    .into_iter()
    .enumerate()
    {
        // of what nothing was added for, the section on what is left tells
        let told = |i: &usize| !v.effects[*i].is_without_correction();
        let members: Vec<usize> = order.iter().copied().filter(|i| group(&v.effects[*i]) == k).filter(told).collect();
        if members.is_empty() {
            continue;
        }
        sheet.section(&heading);
        if !lead.is_empty() {
            sheet.say(&lead);
        }
        for (place, group) in alike(v, &members).iter().enumerate() {
            let number = (k == 0).then_some(place + 1);
            card(sheet, page, group, number);
        }
    }
    let of_readings: Vec<usize> = order.iter().copied().filter(|i| group(&v.effects[*i]) == 3).collect();
    set_apart(sheet, page, &of_readings);
}

/// That a part of every probability is kept for causes that nobody has described: said once, for it stands against no name in particular.
fn kept(page: &Page<'_>) -> Option<String> {
    let most = reserve(page.verdict, page.words);
    if most < OPEN || page.verdict.effects.iter().all(|e| e.id == "unknown" || e.kin != Kin::Own || e.is_of_single_readings()) {
        return None;
    }
    Some(format!(
        "Of every probability a part is kept for causes that the library lacks, here {} or more: it stands against no name in particular.",
        probability(most)
    ))
}

/// Single readings that leave their neighbours and come back: one account of all channels and runs, and a table with each of them.
fn set_apart(sheet: &mut Sheet, page: &Page<'_>, members: &[usize]) {
    let (Some(first), v) = (members.first(), page.verdict) else { return };
    sheet.section("Readings set apart");
    let said: Vec<String> = members.iter().map(|k| page.words.said(&v.effects[*k]).with("")).collect();
    let id = &v.effects[*first].id;
    sheet.html_part(&format!("<p>{}. <code>{}</code></p>\n", escape(&upper(&said.join("; "))), escape(id)));
    let signature = (page.words.about)(id).map_or("", |about| about.signature);
    sheet.say(&format!("{}. Nothing is claimed about these rows, before or after.", upper(signature)));
    if page.readings.is_empty() {
        return;
    }
    let several = page.readings.iter().any(|r| !r.run.is_empty());
    let clock = if page.readings.iter().all(|r| r.is_row) { "row" } else { "time, s" };
    let cells = |r: &Reading| {
        let unit = if r.unit == "rpm" { "rev/min" } else { r.unit };
        let digits = |v: f64| digits(v, 0.005 * v.abs().max(r.expected.abs()));
        let of = [
            heading(&r.channel),
            digits_of_time(r),
            format!("{} {unit}", digits(r.value)),
            format!("{} {unit}", digits(r.expected)),
        ];
        (if several { vec![r.run.clone()] } else { Vec::new() }).into_iter().chain(of).collect::<Vec<String>>()
    };
    let rows: Vec<Vec<String>> = page.readings.iter().map(cells).collect();
    let raw: Vec<Vec<String>> = page
        .readings
        .iter()
        .map(|r| {
            let of = [r.t, r.value, r.expected].map(|v| v.to_string());
            [r.run.clone(), r.channel.clone()].into_iter().chain(of).chain([r.unit.to_owned()]).collect()
        })
        .collect();
    let head = ["run", "channel", clock, "reading", "its neighbours"];
    let raw_head = ["run", "channel", "t_s", "value", "neighbours", "unit"];
    sheet.data("readings-set-apart", &head[usize::from(!several)..], &rows, Some((&raw_head, &raw)));
}

/// When a reading was taken, as the log tells it.
fn digits_of_time(r: &Reading) -> String {
    if r.is_row { format!("{:.0}", r.t) } else { format!("{:.2}", r.t) }
}

/// Effects by their position, those without a name that are alike but for their channel together: the rotors of a vehicle, for instance.
pub(super) fn alike(v: &Verdict, members: &[usize]) -> Vec<Vec<usize>> {
    let mut out: Vec<Vec<usize>> = Vec::new();
    for k in members {
        let same = |group: &&mut Vec<usize>| group.first().is_some_and(|first| is_alike(v, &v.effects[*first], &v.effects[*k]));
        match out.iter_mut().find(same) {
            Some(group) => group.push(*k),
            None => out.push(vec![*k]),
        }
    }
    out
}

/// Whether all that is told of two effects without a name is the same, but for their channel.
fn is_alike(v: &Verdict, a: &EffectEntry, b: &EffectEntry) -> bool {
    let told = |e: &EffectEntry| {
        let of = e.channels.first().map(|c| channel(c)).unwrap_or_default();
        (removes(v, e).replace(&of, ""), that_it_is_there(e.probability))
    };
    let nameless = [a, b].iter().all(|e| e.id == "unknown");
    nameless && a.depends_on == b.depends_on && a.scope == b.scope && told(a) == told(b)
}

/// The channels of a group of effects.
pub(super) fn channels_of(v: &Verdict, group: &[usize]) -> String {
    channels(&group.iter().flat_map(|k| v.effects[*k].channels.clone()).collect::<Vec<_>>())
}

/// What the first of a group removes, and that the others do the same.
pub(super) fn removed(v: &Verdict, group: &[usize]) -> String {
    let first = group.first().map(|k| removes(v, &v.effects[*k])).unwrap_or_default();
    if group.len() > 1 { format!("{first} The others are alike.") } else { first }
}

fn card(sheet: &mut Sheet, page: &Page<'_>, group: &[usize], number: Option<usize>) {
    let Some(k) = group.first().copied() else { return };
    let (v, e) = (page.verdict, &page.verdict.effects[k]);
    let on = channels_of(v, group);
    let zero = zero_in(page.words, e);
    let told = e.told_probability() < e.probability;
    let there = open_sizes(e).is_some() || !zero.is_empty() && !told;
    // what has no name is sure of nothing but that something is there
    let nameless = e.id == "unknown";
    let sure = if nameless { "perhaps" } else { sureness(e.told_probability()) };
    let against = rivals(v, page.words, k);
    let chip = if nameless {
        format!("no name; {}", that_it_is_there(e.probability))
    } else {
        let none = Rival::none(v, page.words, e, &against).probability;
        contest(e, &if there { of_its_being(sure) } else { sure.to_owned() }, &against, none) + &zero
    };
    let rather = if nameless { None } else { leading(page, e, &against) };
    let title = match &rather {
        _ if nameless && goes_with(e).is_empty() => format!("Something on {on} that nothing in the log predicts."),
        _ if nameless => format!("Something on {on} that goes with {}.", channels(goes_with(e))),
        Some(both) => both.clone(),
        None => lost::said(v, page.words, e).sentence(),
    };
    let number = number.map(|n| format!("<span class=\"nr\">{n}</span> ")).unwrap_or_default();
    let mut html = format!(
        "<article class=\"card {sure}\" id=\"effect-{}\"><h3>{number}{}</h3>\n<p class=\"facts\"><span class=\"chip {sure}\">{}</span> <code>{}</code> on {}. {}</p>\n",
        anchor(v, k),
        escape(&title),
        escape(&chip),
        escape(&e.id),
        escape(&on),
        escape(&removed(v, group)),
    );
    // what has no name belongs to nothing that is known
    if e.id != "unknown" {
        let _ = writeln!(html, "<p class=\"soft\">{}.</p>", escape(&upper(&scope(e, page.words.noun))));
    }
    if rather.is_some() {
        let _ = writeln!(html, "<p class=\"soft\">The sizes are of the second: {}.</p>", escape(&page.words.said(e).with("")));
    }
    if let Some(open) = open_sizes(e) {
        let _ = writeln!(html, "<p class=\"soft\">{}</p>", escape(&open));
    }
    sheet.html_part(&html);
    let figures: Vec<Figure> = page.cards.get(k).cloned().unwrap_or_default();
    sheet.html_part("<div class=\"split\">\n");
    sheet.figures(figures);
    sheet.html_part("<div>\n");
    parameters(sheet, page.words, e);
    let mut html = format!("<p class=\"soft\">{}</p>\n", written(e));
    // how the sizes of the runs stand to each other, in a line of its own
    let apart = e.apart();
    let known = apart.map_or(e.evidence.as_str(), |(known, ..)| known);
    let _ = writeln!(html, "<p><b>{}:</b> {}.</p>", upper(why(page.words, e)), escape(&plain(signs(known))));
    if let Some((_, how, rest)) = apart {
        let (how, rest) = (escape(&upper(how)), escape(&plain(rest)));
        let _ = writeln!(html, "<p class=\"warn\"><b>{how}:</b> {rest}. The value above is of what they share.</p>");
    }
    if !nameless {
        let _ = writeln!(html, "<p><b>Could also be:</b> {}</p>", escape(&others(page, e, &against)));
    }
    if let Some(how) = settle(page, e) {
        let _ = writeln!(html, "<p><b>To settle it:</b> {}</p>", how);
    }
    sheet.html_part(&format!("{html}</div></div></article>\n"));
}

/// How sure it is that something is there whose size is open.
fn of_its_being(sure: &str) -> String {
    if sure == "sure" { "sure that it is there".to_owned() } else { format!("{sure} there") }
}

/// The title where a rival is likelier than the name that the model holds: both, the likelier first.
fn leading(page: &Page<'_>, e: &EffectEntry, against: &[Rival]) -> Option<String> {
    let rival = against.first().filter(|r| r.probability > e.probability && !r.ids.is_empty())?;
    let [theirs, own] = [rival.probability, e.probability].map(probability);
    let said = page.words.said(e).with("");
    Some(format!("{} ({theirs}), or {said} ({own}).", upper(&rival.said)))
}

/// What the evidence of an effect is called: how such a cause shows, or what else speaks for it.
pub(super) fn why(words: Vocabulary, e: &EffectEntry) -> &'static str {
    let signature = (words.about)(&e.id).map_or("", |about| about.signature);
    if !signature.is_empty() && e.evidence.contains(signature) { "shows as" } else { "why" }
}

/// How sure a name is, its probability, and what stands against it; `none`: that it has no cause of its own, or another set of names.
fn contest(e: &EffectEntry, sure: &str, against: &[Rival], none: f64) -> String {
    let p = equals(&probability(e.probability));
    // a name may be plain in thousands of rows, and change nothing that a reader would see
    let little = 0.0 < e.heldout_error_reduction && e.heldout_error_reduction < LITTLE;
    match against.first().filter(|r| r.probability >= COUNTED) {
        Some(rival) => format!("{sure}: p {p}, rival {}", equals(&probability(rival.probability))),
        None if none >= OPEN => format!("{sure}: p {p}, other names or none {}", equals(&probability(none))),
        None if e.of_no_run().is_some() => format!("{sure}: p {p}, no rival; its size differs from run to run"),
        None if little => format!("{sure}: p {p}, no rival; it takes next to nothing"),
        // the word is of what may be left of it, the figure of its being there
        None if e.told_probability() < e.probability => format!("{sure}: p {p}, no rival, yet every size may be zero"),
        None => format!("{sure}: p {p}, no rival"),
    }
}

/// Which sizes may be zero by their intervals, behind how sure a name is; where a sentence of its own counts them nothing.
fn zero_in(words: Vocabulary, e: &EffectEntry) -> String {
    if open_sizes(e).is_some() {
        return String::new();
    }
    let names: Vec<String> =
        e.may_be_zero().filter(|p| is_shown(words, e, p)).map(|p| (words.parameter)(&e.id, &p.name)).collect();
    match names.as_slice() {
        [] => String::new(),
        [one] => format!("; {one} may be zero"),
        [one, other] => format!("; {one} and {other} may each be zero"),
        more => format!("; {} of its {} sizes may each be zero", more.len(), e.parameters.len()),
    }
}

/// What the model holds of an effect: its formula, or of a curve without a name what it is.
fn written(e: &EffectEntry) -> String {
    if let Some(said) = curve(e) {
        return format!("Added: {}.", escape(&said));
    }
    let (equation, form) = in_force(e);
    let form = form.map(|form| format!(" ({})", escape(&form))).unwrap_or_default();
    format!("<code>{}</code>{form}", escape(&equation))
}

/// How sure it is that something without a name is there. What nothing in the library was tried against has no probability: rows that no fit
/// saw show it.
pub(super) fn that_it_is_there(p: f64) -> String {
    if p == UNEXPLAINED {
        "left-out rows show it".to_owned()
    } else if p < 0.5 {
        "other forms would do as well".to_owned()
    } else {
        format!("that something is there: p {}", equals(&probability(p)))
    }
}

/// Of an effect of several sizes most of which may be zero: that it is there is known, and they are not.
pub(super) fn open_sizes(e: &EffectEntry) -> Option<String> {
    let (open, all) = e.open_sizes()?;
    Some(format!("Left-out rows say that it is there. How large it is they do not: of its {all} sizes {open} may each be zero."))
}

fn equals(text: &str) -> String {
    if text.starts_with(['<', '>']) { text.to_owned() } else { format!("= {text}") }
}

/// An anchor of its own for each effect.
fn anchor(v: &Verdict, k: usize) -> String {
    let before = v.effects[..k].iter().filter(|e| e.id == v.effects[k].id).count();
    let id = v.effects[k].id.replace('_', "-");
    if before == 0 { id } else { format!("{id}-{}", before + 1) }
}

/// An effect's title as a part of a sentence.
fn title(page: &Page<'_>, id: &str) -> String {
    (page.words.about)(id).map_or_else(|| id.replace('_', " "), |about| lower(about.title))
}

/// What would be left on its first channel without it.
pub(super) fn removes(v: &Verdict, e: &EffectEntry) -> String {
    let (first, reduction) = (e.channels.first().map_or("", String::as_str), e.heldout_error_reduction);
    let Some(c) = v.channels.get(first) else { return String::new() };
    // what several runs are off by says nothing of one of them; the evidence does
    if e.run.is_some() {
        return String::new();
    }
    if e.is_without_correction() {
        return "No correction was fitted.".to_owned();
    }
    if e.is_read_off() {
        return "The readings themselves show it: the model has no term for it.".to_owned();
    }
    if reduction <= 0.0 || !c.after.heldout_rms.is_finite() {
        // one sensor's own curve over the command holds what it alone reads
        let beside = v.channels.keys().filter(|name| name.starts_with("rpm")).count() > 1 && first.starts_with("rpm");
        return if beside {
            format!("The other sensors show it: the curve of {} alone holds it already.", channel(first))
        } else {
            format!("It removes nothing of the error of {}.", channel(first))
        };
    }
    let without = c.after.heldout_rms / (1.0 - reduction).max(1e-9);
    // the other causes were fitted for a model that has it
    let more = without > MORE * c.before.heldout_rms && v.effects.len() > 1;
    let more = if more { " (more than before: the other causes fit only beside it)" } else { "" };
    let [_, without, with] = figures(&c.unit, c.noise_floor_rms, without, c.after.heldout_rms);
    format!("Without it the error of {} is {without}{more}, with it {with}.", channel(first))
}

/// A parameter's value and interval, with one digit more than the interval supports; what cannot be below zero and may be zero has a bound alone.
pub(super) fn value(p: &Parameter) -> [String; 3] {
    if let Some(bound) = upper_bound(p) {
        let (factor, unit) = scaled(bound, &p.unit);
        let bound = digits(factor * bound, 0.05 * factor * bound);
        return [format!("< {bound}"), format!("up to {bound}"), unit.to_owned()];
    }
    let unit_of = |unit: &str| match unit {
        "1" => String::new(),
        "rpm" => "rev/min".to_owned(),
        unit => unit.to_owned(),
    };
    if let Some(count) = counted(p) {
        return [count.clone(), format!("{count} to {count}"), unit_of(&p.unit)];
    }
    let (factor, unit) = scaled(p.value, &p.unit);
    let [v, low, high] = with_interval(factor * p.value, p.ci95.map(|v| factor * v));
    [v, format!("{low} to {high}"), unit_of(unit)]
}

/// Whether a reader asks for a parameter: not for what has no word, nor where in its row a step lies, nor since when what was there before the run.
pub(super) fn is_shown(words: Vocabulary, e: &EffectEntry, p: &Parameter) -> bool {
    !(words.parameter)(&e.id, &p.name).is_empty() && p.name != "phase" && !(p.name == "t0" && e.is_since_before())
}

fn parameters(sheet: &mut Sheet, words: Vocabulary, e: &EffectEntry) {
    let shown = |p: &&Parameter| is_shown(words, e, p);
    let rows: Vec<Vec<String>> = e
        .parameters
        .iter()
        .filter(shown)
        .map(|p| {
            let [v, interval, unit] = value(p);
            let note = if sized(p).is_some() { "" } else { " (not well known)" };
            vec![(words.parameter)(&e.id, &p.name) + note, v, interval, unit]
        })
        .collect();
    let raw: Vec<Vec<String>> = e
        .parameters
        .iter()
        .filter(shown)
        .map(|p| vec![p.name.clone(), p.value.to_string(), p.ci95[0].to_string(), p.ci95[1].to_string(), p.unit.clone()])
        .collect();
    if !rows.is_empty() {
        let head = &["parameter", "value", "95 % interval", "unit"];
        sheet.data(&format!("{}-parameters", e.id), head, &rows, Some((&["parameter", "value", "low", "high", "unit"], &raw)));
    }
}

/// The causes that an effect is easily taken for. What was told with a probability is told; what has no name is no cause.
fn taken_for<'a>(known: &'a [&'static str], against: &'a [Rival]) -> impl Iterator<Item = &'a str> {
    let told = |id: &str| against.iter().any(|r| r.ids.iter().any(|known| known == id));
    known.iter().copied().filter(move |id| *id != UNKNOWN && !told(id))
}

/// What would stand in its place, with probabilities, and what it is easily taken for.
fn others(page: &Page<'_>, e: &EffectEntry, against: &[Rival]) -> String {
    let counted = against.iter().filter(|r| r.probability >= COUNTED);
    let found: Vec<String> = counted.map(|r| format!("{} ({})", plain(&r.said), probability(r.probability))).collect();
    let known = (page.words.about)(&e.id).map(|a| a.look_alikes).unwrap_or_default();
    let alike: Vec<String> = taken_for(known, against).map(|id| in_short(&title(page, id)).to_owned()).collect();
    let alike = if alike.is_empty() { String::new() } else { format!(" Easily taken for: {}.", alike.join("; ")) };
    // what every name leaves to causes that the library lacks is said once, above the cards
    let none = Rival::none(page.verdict, page.words, e, against).probability;
    let none = if none >= OPEN {
        format!(" Further names together, or no cause of its own: {}.", probability(none))
    } else {
        String::new()
    };
    match (found.is_empty(), none.is_empty()) {
        (true, true) => return format!("no other name that was tried came close.{alike}"),
        (true, false) => return format!("no other single name came close.{none}{alike}"),
        (false, _) => {}
    }
    format!("{}.{none}{alike}", found.join("; "))
}

/// A title without what it says behind its colon.
fn in_short(title: &str) -> &str {
    title.split(": ").next().unwrap_or(title)
}

/// What would settle an effect that is not sure.
fn settle(page: &Page<'_>, e: &EffectEntry) -> Option<String> {
    if e.probability >= SURE {
        return None;
    }
    let v = page.verdict;
    let best: Vec<&EffectEntry> = v.effects.iter().filter(|e| e.id != "unknown").collect();
    let asked = |a: &Alternative| match &a.change {
        Some(change) => v.effects.get(change.place).is_some_and(|d| std::ptr::eq(d, e)),
        None => without(&best, &a.ids).iter().any(|d| std::ptr::eq(*d, e)),
    };
    if v.proposed().is_some() && v.alternatives.first().is_some_and(asked) {
        return Some("<a href=\"#what-would-settle-it\">the run that is proposed below</a>.".to_owned());
    }
    let noun = page.words.noun;
    // the other runs are here, and have been asked
    if v.runs.len() > 1 && e.run.is_none() {
        return Some(format!(
            "a run of another kind. The {} runs at hand leave it open, and one more like them hardly tells: change what the rivals differ in, the supply, the order of the levels or how long each is held.",
            v.runs.len()
        ));
    }
    // a rival that is of the rig as well is there again, too
    let place = v.effects.iter().position(|other| std::ptr::eq(other, e)).unwrap_or(usize::MAX);
    if rivals(v, page.words, place).first().is_some_and(|r| r.probability >= COUNTED && !r.ids.is_empty()) {
        return Some(
            "a run of another kind: change what the two differ in, the supply, the order of the levels or how long each is held."
                .to_owned(),
        );
    }
    if !v.validation.is_empty() && e.scope == crate::verdict::Scope::Rig {
        return Some(format!(
            "<a href=\"#on-other-runs-of-the-{noun}\">the other runs below</a>: what belongs to the {noun} is there again."
        ));
    }
    Some(match e.scope {
        crate::verdict::Scope::Rig => {
            format!("another run of this {noun}: what belongs to the {noun} is there again (<code>--validate OTHER.csv</code>).")
        }
        crate::verdict::Scope::Run => "the same schedule once more: what belongs to this run is another size then.".to_owned(),
        crate::verdict::Scope::Event => "the same schedule once more: what happened once is not there again.".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::closed::vocabulary::bare_entry;

    /// Words are no surer than the intervals beside them.
    #[test]
    fn a_title_is_told_in_short() {
        assert_eq!(in_short("slow meter: the channel is filtered"), "slow meter");
        assert_eq!(in_short("battery discharges during the run"), "battery discharges during the run");
    }

    /// A dependence without a name is no cause that another one could be taken for.
    #[test]
    fn what_has_no_name_is_no_cause() {
        assert_eq!(taken_for(&["unknown", "supply_sag"], &[]).collect::<Vec<_>>(), ["supply_sag"]);
        assert_eq!(taken_for(&["unknown"], &[]).count(), 0);
    }

    #[test]
    fn a_size_that_may_be_zero_is_told_beside_how_sure_a_name_is() {
        use crate::verdict::words::sureness;
        let size = |name: &str, ci95: [f64; 2]| Parameter { name: name.into(), value: 0.1, unit: "N".into(), ci95 };
        let told = |sizes: &[(&str, [f64; 2])]| {
            let parameters = sizes.iter().map(|(name, ci95)| size(name, *ci95)).collect();
            let e = EffectEntry { probability: 0.99, parameters, ..bare_entry("hysteresis") };
            (sureness(e.told_probability()), zero_in(Vocabulary::RIG, &e))
        };
        let (known, open) = ([0.05, 0.15], [-0.1, 0.3]);
        assert_eq!(told(&[("width", known)]), ("sure", String::new()));
        assert_eq!(told(&[("width", open)]), ("probably", "; width may be zero".to_owned()));
        assert_eq!(told(&[("width", known), ("slack", open)]), ("sure", "; play before it turns may be zero".to_owned()));
        assert_eq!(told(&[("width", known), ("t0", open)]), ("sure", String::new()));
    }

    /// A name that lacks a third of the certainty says to what: a rival, or names that nobody has thought of, or none.
    #[test]
    fn what_a_name_lacks_is_told() {
        let e = EffectEntry { probability: 0.63, ..bare_entry("creep") };
        let rival = |probability: f64| Rival { ids: vec!["stall".into()], said: "the blades stall".into(), probability };
        assert_eq!(contest(&e, "probably", &[rival(0.3)], 0.0), "probably: p = 0.63, rival = 0.30");
        assert_eq!(contest(&e, "probably", &[], 0.25), "probably: p = 0.63, other names or none = 0.25");
        assert_eq!(contest(&e, "probably", &[rival(0.001)], 0.0), "probably: p = 0.63, no rival");
        let little = EffectEntry { heldout_error_reduction: 0.004, ..e.clone() };
        assert_eq!(contest(&little, "sure", &[], 0.0), "sure: p = 0.63, no rival; it takes next to nothing");
        let more = EffectEntry { heldout_error_reduction: 0.006, ..e };
        assert_eq!(contest(&more, "sure", &[], 0.0), "sure: p = 0.63, no rival");
    }
}
