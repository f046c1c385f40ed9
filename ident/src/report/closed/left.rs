//! What is left beside the names, each with its figure, and what would settle what is open.
//!
//! What it is: `unexplained` of the verdict as a table and pictures; the next experiment with its schedule as a file.
//! What can go wrong: nothing; a verdict that leaves nothing says so.
//! Units: the channels' and noise floors.
//! Reference: specification `formats.md`, "Verdict" (`unexplained`, `next_experiment`).

use super::page::Page;
use super::sentence::{floors_left, goes_beyond_noise, instead, size_left, without};
use super::state::EXPLAINED;
use super::vocabulary::Vocabulary;
use crate::attribution::unexplained::BEHIND_STEPS;
use crate::report::figure::Figure;
use crate::report::sheet::{Sheet, data_uri};
use crate::report::svg::escape;
use crate::verdict::words::{channel, channels, heading, list, lower, over_time, plain, probability, rms, upper, vector};
use crate::verdict::{Alternative, EffectEntry, ScheduleStep, Unexplained, Verdict};

/// What is left.
pub(super) fn left(sheet: &mut Sheet, page: &Page<'_>) {
    let v = page.verdict;
    sheet.section("What is left");
    perhaps_also(v, page.words).iter().for_each(|said| sheet.say(said));
    if v.unexplained.is_empty() {
        let above = v.channels.iter().filter_map(|(name, c)| {
            let floors = c.after.heldout_rms / c.noise_floor_rms;
            (floors > EXPLAINED).then(|| format!("{} at {floors:.1} noise floors", channel(name)))
        });
        let above: Vec<String> = above.collect();
        match (above.is_empty(), goes_beyond_noise(v)) {
            (false, _) => sheet.say(&format!("Little: {}.", list(&above))),
            (true, true) => sheet.say("Little: on no channel more than a trace beyond its noise."),
            (true, false) => sheet.say("Nothing: no channel is left with more than its noise."),
        }
        return;
    }
    // a channel that has no model has nothing left over: its whole reading is
    let with_model = |u: &&Unexplained| !v.channels.not_predicted.contains_key(&u.channel);
    let mut told: Vec<&Unexplained> = v.unexplained.iter().filter(with_model).collect();
    told.sort_by(|a, b| floors_left(v, b).total_cmp(&floors_left(v, a)));
    let shared = shared(v);
    let rows: Vec<Vec<String>> = alike(v, &told, shared.as_deref());
    if rows.is_empty() {
        sheet.say("Nothing on a channel that has a model.");
        return;
    }
    let raw = |u: &Unexplained| {
        let figures = v.channels.get(&u.channel).map(|c| (c.after.heldout_rms.to_string(), c.unit.clone())).unwrap_or_default();
        let floors = floors_left(v, u).to_string();
        vec![u.channel.clone(), floors, figures.0, figures.1, u.looks_like.clone(), u.depends_on.join(" ")]
    };
    let raw: Vec<Vec<String>> = told.iter().copied().map(raw).collect();
    let raw_head = ["channel", "over_floor", "size", "unit", "looks_like", "depends_on"];
    sheet.data("unexplained", &["channel", "noise floors", "size", "looks like", "goes with"], &rows, Some((&raw_head, &raw)));
    shared.iter().for_each(|said| sheet.say(&format!("Of all of them: {said}.")));
    let untold = v.effects.iter().filter(|e| e.is_without_correction());
    untold.for_each(|e| sheet.say(&format!("{}.", upper(&plain(&e.evidence)))));
    // a figure of rows that the fit saw says nothing of those that it did not see
    let seen: Vec<String> = v.unexplained.iter().filter(with_model).filter_map(|u| beyond_what_was_seen(v, &u.channel)).collect();
    if !seen.is_empty() {
        sheet.say(&format!("The figures show all rows, which the fit saw. Rows that are left out are missed by far more ({}): the others do not tell what lies between or beyond them.", seen.join("; ")));
    }
    // what the convincing figure shows is not drawn again
    let shown = |f: &Figure| page.hero.iter().any(|h| h.title == f.title);
    let (above, here): (Vec<&Figure>, Vec<&Figure>) = page.left.iter().partition(|f| shown(f));
    above.iter().for_each(|f| sheet.say(&format!("Drawn at the head of this page: {}.", f.title)));
    sheet.figures(here.into_iter().cloned().collect());
}

/// What was tried beside the names and is not sure enough to be one.
fn perhaps_also(v: &Verdict, words: Vocabulary) -> Vec<String> {
    let best: Vec<&EffectEntry> = v.effects.iter().filter(|e| e.id != "unknown").collect();
    let beside = |other: &&Alternative| other.change.is_none() && without(&best, &other.ids).is_empty();
    let said = |other: &Alternative| {
        let more = instead(&best, &other.ids);
        let clauses: Vec<String> = more.iter().map(|id| words.of_another(id, None).with("")).collect();
        let also = if best.is_empty() { "" } else { " as well" };
        let p = probability(other.probability);
        (!more.is_empty()).then(|| format!("Not sure enough for a name: {}{also} (probability {p}).", list(&clauses)))
    };
    v.alternatives.iter().filter(beside).filter_map(said).collect()
}

/// What is said of every remainder alike, behind what each looks like: it is told once.
pub(super) fn shared(v: &Verdict) -> Option<String> {
    let mut tails = v.unexplained.iter().map(|u| u.looks_like.split_once("; ").map(|(_, tail)| tail));
    let first = tails.next()??;
    (v.unexplained.len() > 1 && tails.all(|tail| tail == Some(first))).then(|| first.to_owned())
}

/// What a term without a name was fitted over, where left-out rows bear it out: cards, sentence and what is left say the same.
pub(super) fn goes_with(e: &EffectEntry) -> &[String] {
    if e.id == "unknown" && e.heldout_error_reduction > 0.0 { &e.depends_on } else { &[] }
}

/// The same of all such terms, of all channels or of one.
pub(super) fn fitted_over<'v>(v: &'v Verdict, on: Option<&'v str>) -> impl Iterator<Item = &'v String> {
    let of = move |e: &&EffectEntry| on.is_none_or(|on| e.channels.iter().any(|c| c == on));
    v.effects.iter().filter(of).flat_map(goes_with)
}

/// What a remainder looks like, without what is said of all, and what it seems to go with, behind what was fitted on its channel.
pub(super) fn looks_and_goes(v: &Verdict, u: &Unexplained, shared: Option<&str>) -> (String, String) {
    let (looks, beyond) = looks_and_goes_beyond(v, u, shared);
    let mut fitted: Vec<String> = fitted_over(v, Some(&u.channel)).map(|name| channel(name)).collect();
    fitted.dedup();
    let goes = if fitted.is_empty() { beyond } else { format!("{} (fitted without a name); beyond it {beyond}", list(&fitted)) };
    (looks, goes)
}

/// The same of what is left behind what was fitted.
fn looks_and_goes_beyond(v: &Verdict, u: &Unexplained, shared: Option<&str>) -> (String, String) {
    let own =
        shared.and_then(|tail| u.looks_like.strip_suffix(tail)).map_or(u.looks_like.as_str(), |own| own.trim_end_matches("; "));
    let (goes, looks): (Vec<&str>, Vec<&str>) = own.split("; ").partition(|part| part.starts_with("goes with "));
    let further = u.depends_on.iter().filter(|name| fitted_over(v, Some(&u.channel)).all(|fitted| fitted != *name));
    let seen: Vec<String> = further.map(|d| channel(d)).collect();
    let goes = match (seen.as_slice(), goes.first()) {
        ([], Some(part)) => part.trim_start_matches("goes with ").to_owned(),
        // what it looks like says so
        ([], None) if own.contains("grows with the load") => "the load".to_owned(),
        ([], None) if own.contains(BEHIND_STEPS) => "the steps".to_owned(),
        ([], None) if !u.depends_on.is_empty() => format!("{} still", channels(&u.depends_on)),
        ([], None) => "nothing in the log".to_owned(),
        (with, _) => with.join(", "),
    };
    (over_time(&looks.join("; ")), goes)
}

/// A row for each remainder; the axes of a vector that look alike share one.
fn alike(v: &Verdict, told: &[&Unexplained], shared: Option<&str>) -> Vec<Vec<String>> {
    let mut groups: Vec<Vec<&Unexplained>> = Vec::new();
    let same = |a: &Unexplained, b: &Unexplained| {
        let is_axis = vector(&a.channel) != channel(&a.channel);
        is_axis && vector(&a.channel) == vector(&b.channel) && looks_and_goes(v, a, shared) == looks_and_goes(v, b, shared)
    };
    for u in told {
        match groups.iter_mut().find(|g| g.first().is_some_and(|first| same(first, u))) {
            Some(group) => group.push(u),
            None => groups.push(vec![u]),
        }
    }
    let row = |group: &Vec<&Unexplained>| {
        let first = group.first()?;
        let (looks, goes) = looks_and_goes(v, first, shared);
        let (up_to, name) = match group.len() {
            1 => ("", heading(&first.channel)),
            _ => ("up to ", upper(&channels(&group.iter().map(|u| u.channel.clone()).collect::<Vec<_>>()))),
        };
        let largest = |of: fn(&Verdict, &Unexplained) -> f64| group.iter().copied().max_by(|a, b| of(v, a).total_cmp(&of(v, b)));
        let size = largest(rms_left).map(|u| size_told(v, u)).unwrap_or_default();
        let floors = largest(floors_left).map_or(0.0, |u| floors_left(v, u));
        Some(vec![name, format!("{up_to}{floors:.1}"), format!("{up_to}{size}"), looks, goes])
    };
    groups.iter().filter_map(row).collect()
}

/// The error that is left, in the channel's unit.
fn rms_left(v: &Verdict, u: &Unexplained) -> f64 {
    v.channels.get(&u.channel).map_or(0.0, |c| c.after.heldout_rms)
}

/// Times the error on rows that the fit saw from which on that on rows it did not see is told apart.
const BEYOND: f64 = 2.0;

/// The error on the rows that the fit saw, where rows that it did not see are missed by much more: these lie between or beyond its levels. Of
/// several runs each is predicted whole, so that no level of it is left out.
pub(super) fn fitted(v: &Verdict, name: &str) -> Option<f64> {
    let after = v.channels.get(name).filter(|_| v.runs.is_empty())?.after;
    (after.heldout_rms > BEYOND * after.rms).then_some(after.rms)
}

/// The error that is left, with unit, and that on the rows of the fit where it is much smaller.
pub(super) fn size_told(v: &Verdict, u: &Unexplained) -> String {
    let size = size_left(v, u);
    match fitted(v, &u.channel).zip(v.channels.get(&u.channel)) {
        Some((seen, c)) => format!("{size} ({} where fitted)", rms(seen, &c.unit)),
        None => size,
    }
}

/// The errors of a channel whose left-out rows are missed by much more than those that the fit saw.
fn beyond_what_was_seen(v: &Verdict, name: &str) -> Option<String> {
    let c = v.channels.get(name)?;
    let [out, seen] = [c.after.heldout_rms, c.after.rms].map(|error| rms(error, &c.unit));
    (c.after.heldout_rms > BEYOND * c.after.rms).then(|| format!("{}: {out} for {seen}", channel(name)))
}

/// A text in which causes and columns are told in words.
pub(super) fn in_words(words: Vocabulary, text: &str) -> String {
    let word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut out = String::new();
    let mut rest = text;
    while let Some(from) = rest.find(word) {
        let (before, at) = rest.split_at(from);
        let (name, after) = at.split_at(at.find(|c| !word(c)).unwrap_or(at.len()));
        out += before;
        // a cause whose identifier is a plain word is said by it
        let cause = (words.about)(name).filter(|_| name.contains('_'));
        out += &cause.map_or_else(|| plain(name), |about| format!("\"{}\"", lower(about.title)));
        rest = after;
    }
    out + rest
}

/// The run that would tell what is open.
pub(super) fn settle(sheet: &mut Sheet, page: &Page<'_>) {
    let Some(next) = &page.verdict.next_experiment else { return };
    sheet.section("What would settle it");
    sheet.say(&format!("{}.", upper(&in_words(page.words, next.why.trim_end_matches('.')))));
    if !next.separates {
        let noun = page.words.noun;
        sheet.say(&format!("No run is proposed. A sensor that this log lacks, or the {noun} with one part exchanged, may tell."));
    }
    if next.schedule.is_empty() || !next.separates {
        return;
    }
    let row = |s: &ScheduleStep| vec![s.pulse_us.to_string(), s.hold_s.to_string()];
    let (cycle, times) = next.cycle();
    if times > 1 {
        sheet.say(&format!("{times} times:"));
    }
    let [rows, raw]: [Vec<Vec<String>>; 2] = [cycle, &next.schedule].map(|steps| steps.iter().map(row).collect());
    sheet.data("next-experiment", &["pulse, us", "hold, s"], &rows, Some((&["pulse_us", "hold_s"], &raw)));
    let steps: Vec<String> =
        next.schedule.iter().map(|s| format!("  {{ pulse_us = {}, hold_s = {} }},\n", s.pulse_us, s.hold_s)).collect();
    let file = format!("name = \"what would settle it\"\n\n[[part]]\nkind = \"steps\"\nsteps = [\n{}]\n", steps.concat());
    sheet.html_part(&format!(
        "<p><a download=\"next.toml\" href=\"{}\">Download the schedule</a>, or fly it from the verdict: <code>{}</code></p>\n",
        data_uri("application/toml", &file),
        escape("quadrig rig run --port PORT --next verdict.json -o next.csv")
    ));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::closed::vocabulary::{bare_entry, bare_verdict};

    fn left(channel: &str, looks_like: &str) -> Unexplained {
        Unexplained { channel: channel.into(), over_floor: 4.0, depends_on: Vec::new(), looks_like: looks_like.into() }
    }

    /// What was tried beside the names is told; what would stand in the place of one is told on its card.
    #[test]
    fn what_may_be_there_as_well_is_told() {
        let of = |ids: &[&str], probability: f64| {
            let ids = ids.iter().map(|id| (*id).to_owned()).collect();
            Alternative { ids, probability, change: None }
        };
        let alternatives = vec![of(&["supply_sag", "creep"], 0.1), of(&["battery_discharge"], 0.2)];
        let v = Verdict { effects: vec![bare_entry("supply_sag")], alternatives, ..bare_verdict(Vec::new()) };
        let said = perhaps_also(&v, Vocabulary::RIG);
        assert!(said.len() == 1 && said[0].contains("creeps") && said[0].ends_with(" as well (probability 0.10)."), "{said:?}");
        let nothing_named = Verdict { effects: Vec::new(), ..v };
        assert!(perhaps_also(&nothing_named, Vocabulary::RIG).iter().all(|s| !s.contains("as well")), "nothing stands beside it");
    }

    /// What is true of every remainder of an attitude log is told once, and its axes that look alike share a row.
    #[test]
    fn what_is_said_of_all_is_said_once() {
        let of = |name: &str, when: &str| left(name, &format!("more than noise, {when}; the attitude is off"));
        let v = bare_verdict(vec![
            of("ax", "over the whole run"),
            of("ay", "over the whole run"),
            of("az", "mostly from 4.0 to 5.0 s"),
        ]);
        let shared = shared(&v);
        assert_eq!(shared.as_deref(), Some("the attitude is off"));
        let rows = alike(&v, &v.unexplained.iter().collect::<Vec<_>>(), shared.as_deref());
        let told: Vec<[&str; 3]> = rows.iter().map(|r| [r[0].as_str(), r[1].as_str(), r[3].as_str()]).collect();
        assert_eq!(
            told,
            [
                ["Specific force (x and y)", "up to 4.0", "more than noise, over the whole run"],
                ["Specific force (z)", "4.0", "more than noise, mostly from 4.0 to 5.0 s"]
            ]
        );
        assert_eq!(super::shared(&bare_verdict(vec![left("ax", "slow"), left("ay", "slow; a tail")])), None);
    }

    #[test]
    fn a_memory_is_a_time_constant() {
        let v = bare_verdict(Vec::new());
        let said = looks_and_goes(&v, &left("acc_x", "slow, within 2.0 s; goes with time"), None).0;
        assert_eq!(said, "slow, with a time constant of 2.0 s");
    }

    /// What a short table cannot prove it says as far as it goes, where a reader looks for it.
    #[test]
    fn what_it_seems_to_go_with_stands_in_its_column() {
        let v = bare_verdict(Vec::new());
        let short = left("voltage_v", "over several rows; goes with current, as far as 36 rows can show");
        let said = looks_and_goes(&v, &short, None);
        assert_eq!(said, ("over several rows".to_owned(), "current, as far as 36 rows can show".to_owned()));
        assert_eq!(looks_and_goes(&v, &left("voltage_v", "slow"), None).1, "nothing in the log");
    }

    /// What a card says that something goes with is not told as going with nothing in the next section.
    #[test]
    fn what_was_fitted_without_a_name_is_told_of_what_is_left_too() {
        let channels = vec!["current_a".to_owned()];
        let depends_on = vec!["pulse_us".into()];
        let term = EffectEntry { channels, depends_on, heldout_error_reduction: 0.2, ..bare_entry("unknown") };
        let v = Verdict { effects: vec![term], ..bare_verdict(Vec::new()) };
        let goes = |u: &Unexplained| looks_and_goes(&v, u, None).1;
        let of = |depends_on: &[&str]| Unexplained {
            depends_on: depends_on.iter().map(|name| (*name).to_owned()).collect(),
            ..left("current_a", "slow")
        };
        assert_eq!(goes(&of(&[])), "pulse (fitted without a name); beyond it nothing in the log");
        assert_eq!(goes(&of(&["pulse_us", "voltage_v"])), "pulse (fitted without a name); beyond it voltage");
        assert_eq!(goes(&of(&["pulse_us"])), "pulse (fitted without a name); beyond it pulse still");
        assert_eq!(goes(&left("thrust_n", "slow")), "nothing in the log");
    }
}
