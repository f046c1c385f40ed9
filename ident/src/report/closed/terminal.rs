//! The verdict as a terminal shows it: the sentence first, then tables that fit into 100 columns.
//!
//! What it is: the same order as on the page, as text.
//! What can go wrong: a long word (a file's name) is wider than a line and stands alone on it.
//! Units: as told.
//! Reference: specification `report.md`.

use super::cards::{OPEN, alike, channels_of, is_shown, open_sizes, removed, that_it_is_there, value, why};
use super::cautions::cautions;
use super::contest::rivals;
use super::left::{in_words, looks_and_goes, shared, size_told};
use super::lost;
use super::sentence::{PER_CENT, floors_left, instead, order, sentence, without};
use super::state::{Rest, STAYS, factor, figures, is_as_before, named, word};
use super::vocabulary::Vocabulary;
use crate::channel::unit_of;
use crate::signal::bad::SetAside;
use crate::verdict::Scope;
use crate::verdict::words::{channel, list, plain, probability, signs, upper, upper_bound};
use crate::verdict::{Alternative, Channel, EffectEntry, Kin, Verdict};

/// Columns of the widest line.
pub const WIDEST: usize = 100;
/// Most lines about samples that were set aside; the verdict's file has them all.
const ASIDE: usize = 5;

/// The text.
#[must_use]
pub fn terminal(whole: &Verdict, words: Vocabulary, news: bool) -> String {
    let verdict = &*whole.briefly();
    let said = sentence(verdict, words, news);
    let mut out = format!("{}\n{}\n", wrapped(&said, 0), wrapped(&whose(whole), 0));
    out += &channels(verdict, is_as_before(verdict, news));
    if said.contains(PER_CENT) {
        out += "(per cent of the squared error above the noise floor: 75 % less is half the error)\n";
    }
    for caution in cautions(verdict) {
        out += &format!("{}\n", wrapped(&caution, 0));
    }
    for left_out in &verdict.left_out {
        out += &format!("{}\n", wrapped(&left_out.to_string(), 2));
    }
    let of = |k: &usize| &verdict.effects[*k];
    let (named, nameless): (Vec<usize>, Vec<usize>) = order(verdict, words).into_iter().partition(|k| of(k).id != "unknown");
    let (readings, named): (Vec<usize>, Vec<usize>) = named.into_iter().partition(|k| of(k).is_of_single_readings());
    let (own, common): (Vec<usize>, Vec<usize>) = named.into_iter().partition(|k| of(k).kin == Kin::Own);
    let noun = words.noun;
    let [this, every] = [format!("what this {noun} has"), format!("what every {noun} has")];
    for (heading, members) in [(this.as_str(), own), (every.as_str(), common), ("without a name", nameless)] {
        if !members.is_empty() {
            out += &format!("\n{heading}\n");
            alike(verdict, &members).iter().for_each(|group| out += &effect(verdict, words, group));
        }
    }
    out += &set_apart(verdict, words, &readings);
    out += &left(verdict);
    out += &set_aside(verdict);
    let all: Vec<String> = verdict.alternatives.iter().filter_map(|a| alternative(verdict, a)).collect();
    if !all.is_empty() {
        out += &format!("\n{}\n", wrapped(&format!("alternatives: {}", all.join("; ")), 2));
    }
    if let Some(next) = &verdict.next_experiment {
        let (cycle, times) = next.cycle();
        let steps: Vec<String> = cycle.iter().map(|s| format!("{} us {} s", s.pulse_us, s.hold_s)).collect();
        let often = if times > 1 { format!("{times} times ") } else { String::new() };
        out += &format!("\n{}\n", wrapped(&format!("what would settle it: {}", in_words(words, &next.why)), 2));
        if !steps.is_empty() && next.separates {
            out += &format!("  {}\n", wrapped(&format!("{often}{}", steps.join(", ")), 2));
        }
    }
    let took_no_part = verdict.validation.iter().map(|v| (v, format!("on {}, which took no part:", v.run)));
    let of_several = verdict.runs.iter().map(|v| (v, format!("{}, predicted by a fit to the others:", v.run)));
    for (v, heading) in of_several.chain(took_no_part) {
        out += &format!("\n{}\n", wrapped(&heading, 2));
        out += &format!("  {:<16}{:>18}{:>18}{:>10}\n", "rms error", "before", "after", "factor");
        for (name, b) in &v.channels {
            let unit = verdict.channels.get(name).map_or(unit_of(name), |c| c.unit.as_str());
            let [_, before, after] = figures(unit, b.before, b.before, b.after);
            out += &format!("  {:<16}{before:>18}{after:>18}{:>10}\n", channel(name), factor(b.before, b.after));
        }
    }
    out
}

/// By what another hypothesis differs: what it has, and what it does without; nothing where its names are the same.
fn alternative(verdict: &Verdict, other: &Alternative) -> Option<String> {
    if let Some(change) = &other.change {
        let place = verdict.effects.get(change.place)?;
        let on = channels_of(verdict, &[change.place]);
        return Some(format!("{} in the place of {} on {on} ({})", change.id, place.id, probability(change.probability)));
    }
    let best: Vec<&EffectEntry> = verdict.effects.iter().filter(|e| e.id != "unknown").collect();
    let more = instead(&best, &other.ids).join(" + ");
    let less = without(&best, &other.ids).iter().map(|e| e.id.as_str()).collect::<Vec<_>>().join(" + ");
    let said = match (more.is_empty(), less.is_empty()) {
        (false, false) => format!("{more} in the place of {less}"),
        (false, true) => format!("{more} as well"),
        (true, false) => format!("without {less}"),
        // the same names over again
        (true, true) => return None,
    };
    Some(format!("{said} ({})", probability(other.probability)))
}

/// The run, or the runs.
fn whose(verdict: &Verdict) -> String {
    let names: Vec<String> = verdict.runs.iter().map(|r| r.run.clone()).collect();
    match names.len() {
        0 => verdict.run.clone(),
        n => format!("{n} runs of one rig: {}", list(&names)),
    }
}

fn channels(verdict: &Verdict, known: bool) -> String {
    let error = if verdict.runs.is_empty() { "held-out error" } else { "across runs" };
    let (named, stays) = (named(verdict), lost::floors(verdict));
    let row = |(name, c): (&String, &Channel)| {
        let [floor, before, after] = figures(&c.unit, c.noise_floor_rms, c.before.heldout_rms, c.after.heldout_rms);
        let floors = [c.before, c.after].map(|f| f.heldout_rms / c.noise_floor_rms);
        let rest = Rest::on(verdict, name);
        let named = named.contains(&name.as_str());
        let times = factor(c.before.heldout_rms, c.after.heldout_rms);
        let state = if stays.iter().any(|s| s.0 == name) { STAYS } else { word(floors, rest, named, known) };
        [channel(name), floor, before, after, times, state.to_owned()]
    };
    let shown = lost::drawn(verdict);
    let head = [error, "noise floor", "before", "after", "factor", "state"].map(str::to_owned);
    let rows: Vec<[String; 6]> = std::iter::once(head).chain(shown.iter().map(row)).collect();
    let letters = |text: &str| text.chars().count();
    let longest = |k: usize| rows.iter().map(|r| letters(&r[k])).max().unwrap_or_default();
    let names = verdict.channels.not_predicted.keys();
    let first = names.map(|name| letters(&channel(name))).chain([longest(0), 15]).max().unwrap_or_default() + 1;
    // figures stand well apart where there is room, and never touch
    let room = WIDEST.saturating_sub(first + longest(5) + 2) / 4;
    let wide = |k: usize| (longest(k) + 1).max(room.min(if k == 4 { 9 } else { 16 }));
    let mut out = String::from("\n");
    for [name, floor, before, after, times, state] in &rows {
        let [a, b, c, d] = [1, 2, 3, 4].map(wide);
        out += &format!("{name:<first$}{floor:>a$}{before:>b$}{after:>c$}{times:>d$}  {state}\n");
    }
    for (name, reason) in &verdict.channels.not_predicted {
        out += &format!("{:<first$}not predicted: {reason}\n", channel(name));
    }
    lost::key(verdict).iter().for_each(|said| out += &format!("{}\n", wrapped(said, 0)));
    out
}

fn effect(verdict: &Verdict, words: Vocabulary, group: &[usize]) -> String {
    let Some(e) = group.first().map(|k| &verdict.effects[*k]) else { return String::new() };
    let p = match e.id.as_str() {
        "unknown" => that_it_is_there(e.probability),
        _ => format!("p {}", probability(e.probability)),
    };
    let since = if e.has_begun() && e.scope == Scope::Rig { " since one instant" } else { "" };
    let scope = words.scope_word(e.scope);
    let mut out = format!("{}\n", wrapped(&format!("  {} ({p}) on {}, {scope}{since}", e.id, channels_of(verdict, group)), 4));
    if e.id != "unknown" {
        out += &format!("    {}\n", wrapped(&lost::said(verdict, words, e).sentence(), 4));
        let against = group.first().and_then(|k| rivals(verdict, words, *k).into_iter().next());
        if let Some(rival) = against.filter(|r| r.probability >= OPEN) {
            let said = format!("or else: {} (p {})", plain(&rival.said), probability(rival.probability));
            out += &format!("    {}\n", wrapped(&said, 4));
        }
    }
    for parameter in e.parameters.iter().filter(|p| is_shown(words, e, p)) {
        let [v, interval, unit] = value(parameter);
        let name = &parameter.name;
        out += &match upper_bound(parameter) {
            Some(_) => format!("    {name} {v} {unit}  (95 %)\n"),
            None => format!("    {name} = {}  (95 %: {interval})\n", format!("{v} {unit}").trim_end()),
        };
    }
    for said in open_sizes(e).into_iter().chain(Some(removed(verdict, group))).filter(|said| !said.is_empty()) {
        out += &format!("    {}\n", wrapped(&said, 4));
    }
    out + &format!("    {}\n", wrapped(&format!("{}: {}", why(words, e), plain(signs(&e.evidence))), 4))
}

/// Single readings about which nothing is claimed, a line for each channel and run.
fn set_apart(verdict: &Verdict, words: Vocabulary, members: &[usize]) -> String {
    let Some(first) = members.first() else { return String::new() };
    let mut out = format!("\nreadings set apart ({})\n", verdict.effects[*first].id);
    members.iter().for_each(|k| out += &format!("  {}\n", wrapped(&words.said(&verdict.effects[*k]).sentence(), 4)));
    out
}

fn left(verdict: &Verdict) -> String {
    if verdict.unexplained.iter().all(|u| verdict.channels.not_predicted.contains_key(&u.channel)) {
        return String::new();
    }
    let mut out = String::from("\nwhat is left\n");
    let shared = shared(verdict);
    for u in verdict.unexplained.iter().filter(|u| !verdict.channels.not_predicted.contains_key(&u.channel)) {
        let (looks, goes) = looks_and_goes(verdict, u, shared.as_deref());
        // what it looks like says so
        let told = goes == "the load" && looks.contains("grows with the load") || goes == "the steps";
        let silent = goes == "nothing in the log" || told;
        let on = if silent { String::new() } else { format!(", goes with {goes}") };
        let of = [channel(&u.channel), size_told(verdict, u), format!("{:.1} noise floors", floors_left(verdict, u))];
        let [name, size, floors] = of;
        out += &format!("  {}\n", wrapped(&format!("{name}: {size}, {floors}, {looks}{on}"), 4));
    }
    shared.iter().for_each(|said| out += &format!("  {}\n", wrapped(&format!("of all of them: {said}"), 4)));
    out
}

/// The samples that took no part.
fn set_aside(verdict: &Verdict) -> String {
    // the longest first: they say most of the log
    let mut all: Vec<&SetAside> = verdict.set_aside.iter().collect();
    all.sort_by_key(|aside| std::cmp::Reverse(aside.rows));
    if all.is_empty() {
        return String::new();
    }
    let mut out = String::from("\nset aside\n");
    all.iter().take(ASIDE).for_each(|aside| out += &format!("  {}\n", wrapped(&upper(&aside.to_string()), 4)));
    if all.len() > ASIDE {
        let more = match all.len() - ASIDE {
            1 => "one more stretch".to_owned(),
            n => format!("{n} more stretches"),
        };
        out += &format!("  and {more} like these, listed in verdict.json and in the report\n");
    }
    out
}

/// Text in lines of at most [`WIDEST`] columns; further lines are set in by `indent`.
#[must_use]
pub fn wrapped(text: &str, indent: usize) -> String {
    let lead = text.len() - text.trim_start().len();
    let mut out = " ".repeat(lead);
    // the caller may have set in the first line by as much
    let mut column = lead.max(indent);
    for (k, word) in text.split_whitespace().enumerate() {
        let wide = word.chars().count();
        if k > 0 && column + 1 + wide > WIDEST {
            out += &format!("\n{}", " ".repeat(indent));
            column = indent;
        } else if k > 0 {
            out.push(' ');
            column += 1;
        }
        out += word;
        column += wide;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_broken_between_words() {
        let text = wrapped(&"twelve words ".repeat(40), 4);
        assert!(text.lines().all(|l| l.chars().count() <= WIDEST) && text.lines().count() > 4);
        assert!(text.lines().skip(1).all(|l| l.starts_with("    t") || l.starts_with("    w")));
    }
}
