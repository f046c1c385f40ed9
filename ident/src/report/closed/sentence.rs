//! The one sentence that heads page and terminal.
//!
//! What it is: what was found, in words that a lab uses, with sizes; how much of the error it takes; what is left.
//! What can go wrong: it must never claim more than the verdict. Each kind of verdict has its own wording, and what is not sure says so.
//! Units: each size carries its own.
//! Reference: specification `formats.md`, "Verdict".

use super::cards::{is_shown, value};
use super::contest::{Rival, is_beaten, rivals};
use super::left::{fitted, fitted_over};
use super::lost;
use super::vocabulary::Vocabulary;
use crate::attribution::rivals::beyond;
use crate::attribution::unexplained::{BEHIND_ONE, BEHIND_STEPS, LOUD, ON_THE_WAY};
use crate::verdict::words::{Clause, adverb, channel, counted, heading, list, over_time, rms, upper, upper_bound, vector};
use crate::verdict::{Alternative, Channel, EffectEntry, Kin, Kind, Parameter, Unexplained, Verdict};

/// Most effects that the sentence names; the cards have all.
const MOST: usize = 2;
/// Share of its channel's error below which an effect is a smaller cause.
const SMALL: f64 = 0.02;
/// Share of the first alternative's probability from which on a further one is put beside it.
const CLOSE: f64 = 0.5;
/// Least share of what a channel had left over that is worth a figure in the sentence.
const TELLING: f64 = 0.1;
/// Shares that lie within so much of each other are told as one.
const ALIKE: f64 = 0.1;
/// Share from which on all is explained but the noise.
const ALL: f64 = 0.995;
/// Channels without a model up to which each is told with its reason.
const MOST_BARE: usize = 2;
/// Words of a head above which the share that an open question leaves explained is told in fewest words.
const LONGEST: usize = 60;
/// Letters of a head of two lines, 1400 px wide: it is set in letters of some 15 px, in lines of 1024 px.
const HEAD: usize = 130;
/// Share of a channel's error below which most of it is still there.
const HALF: f64 = 0.5;
/// Noise floors up to which what is left is not worth a word.
const QUIET: f64 = 1.5;

/// What stands in a sentence that tells a share.
pub(super) const PER_CENT: &str = " % of what ";

/// The sentence. `news`: the loop was closed against a declared model, so that what was found is new since then.
#[must_use]
pub fn sentence(verdict: &Verdict, words: Vocabulary, news: bool) -> String {
    let said = match verdict.verdict {
        Kind::Attributed => attributed(verdict, words, news),
        Kind::Ambiguous => ambiguous(verdict, words, news),
        Kind::Unattributed => unattributed(verdict, news),
        Kind::None => none(verdict, news),
    };
    let said = match still(verdict) {
        Some(still) if verdict.verdict == Kind::None => still.to_owned(),
        Some(still) => format!("{still} {said}"),
        None => said,
    };
    std::iter::once(said).chain(without_a_model(verdict)).collect::<Vec<_>>().join(" ")
}

/// That nothing moved, so that a model which fits has explained nothing.
fn still(verdict: &Verdict) -> Option<&'static str> {
    let said = "Nothing moved: the command stayed where it was. This run shows nothing of how the powerplant follows it.";
    match (verdict.at_rest, verdict.held) {
        (true, _) => Some("Nothing moved: the motor never turned. This run shows nothing of the powerplant."),
        (false, true) => Some(said),
        _ => None,
    }
}

/// That some channels have no model. Where they are many, the state of the channels says why.
fn without_a_model(verdict: &Verdict) -> Vec<String> {
    let bare = &verdict.channels.not_predicted;
    if bare.len() > MOST_BARE {
        return vec![format!("{} channels have no model: why is told below.", bare.len())];
    }
    let of = |(name, reason): (&String, &String)| match reason.contains(':') {
        true => format!("{} has no model ({reason}).", heading(name)),
        false => format!("{} has no model: {reason}.", heading(name)),
    };
    bare.iter().map(of).collect()
}

/// Effects in the order in which they are told: what removes most first, what a few readings hold last.
pub(crate) fn order(v: &Verdict, words: Vocabulary) -> Vec<usize> {
    let mut order: Vec<usize> = (0..v.effects.len()).collect();
    let removed = |k: &usize| {
        let e = &v.effects[*k];
        if words.by_floors { floors_removed(v, e) } else { e.heldout_error_reduction }
    };
    let of_readings = |k: &usize| v.effects[*k].is_of_single_readings();
    order.sort_by(|a, b| of_readings(a).cmp(&of_readings(b)).then(removed(b).total_cmp(&removed(a))).then(a.cmp(b)));
    order
}

/// By how many noise floors the error of an effect's first channel is larger without it.
fn floors_removed(v: &Verdict, e: &EffectEntry) -> f64 {
    let Some(c) = e.channels.first().and_then(|name| v.channels.get(name)) else { return 0.0 };
    let without = c.after.heldout_rms / (1.0 - e.heldout_error_reduction).max(1e-9);
    (without - c.after.heldout_rms) / c.noise_floor_rms.max(f64::MIN_POSITIVE)
}

/// The effects with a name: those of this rig, and those of every rig.
fn named(verdict: &Verdict, words: Vocabulary) -> (Vec<&EffectEntry>, Vec<&EffectEntry>) {
    let all = order(verdict, words).into_iter().map(|k| &verdict.effects[k]).filter(|e| e.id != "unknown");
    all.partition(|e| e.kin == Kin::Own)
}

fn attributed(verdict: &Verdict, words: Vocabulary, news: bool) -> String {
    let (own, common) = named(verdict, words);
    let noun = words.noun;
    // where in its row a reading lies is no news
    let common: Vec<&EffectEntry> = common.into_iter().filter(|e| e.kin != Kin::WithinRow).collect();
    if own.is_empty() && common.is_empty() {
        let said = since(news, &format!("nothing of this {noun}'s own was named."));
        return [said, left(verdict)].into_iter().filter(|s| !s.is_empty()).collect::<Vec<_>>().join(" ");
    }
    let all = if own.is_empty() { &common } else { &own };
    let told = headed(verdict, &likely(verdict, words, all));
    let Some(first) = told.first().or(all.first()) else { return String::new() };
    if told.is_empty() && beaten(verdict, words, first) {
        return contested(verdict, words, news, &[*first]);
    }
    let told = if told.is_empty() { vec![*first] } else { told };
    let more = causes(all).saturating_sub(told.len());
    let clauses = by_subject(verdict, &told, words);
    let nothing = since(news, &format!("nothing of this {noun}'s own was named."));
    let every = format!("What every {noun} has: {}.", joined_lower(&clauses));
    let rest = unnamed_rest(verdict, words).map(|_| left(verdict));
    let out = match (own.is_empty(), &rest) {
        (true, Some(rest)) => format!("{nothing} {rest} {every}"),
        (true, None) => format!("{nothing} {every}"),
        (false, _) => headlong(&clauses, news),
    };
    let explained = explained(verdict, &told, false, news);
    // what says that more is told below has said so
    let more = if explained.as_ref().is_some_and(|e| e.says_more) { 0 } else { more };
    let last = if rest.is_some() { String::new() } else { left(verdict) };
    [out, explained.map(|e| e.said).unwrap_or_default(), below(more, true, false), last]
        .into_iter()
        .filter(|s| !s.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

/// Of some causes those that the sentence may name. What takes next to nothing, or is of sizes that may be nothing, stands on its card alone, unless
/// there is nothing else; no name stands above a likelier one.
fn likely<'v>(verdict: &Verdict, words: Vocabulary, all: &[&'v EffectEntry]) -> Vec<&'v EffectEntry> {
    let known = |e: &EffectEntry| !e.is_of_single_readings() && e.open_sizes().is_none();
    let large = |e: &&&EffectEntry| ((e.heldout_error_reduction >= SMALL || shown_by_readings(e)) && known(e)) || all.len() == 1;
    all.iter().filter(large).filter(|e| !beaten(verdict, words, e)).copied().collect()
}

/// The cause of this rig that the sentence begins with.
pub(super) fn begins_with(verdict: &Verdict, words: Vocabulary) -> Option<&EffectEntry> {
    let own: Vec<&EffectEntry> = named(verdict, words).0.into_iter().filter(|e| !e.is_of_single_readings()).collect();
    likely(verdict, words, &own).first().or(own.first()).copied()
}

/// Clauses as a sentence that two lines of a head hold, and as many as that has no room for in a second one.
fn headlong(clauses: &[String], news: bool) -> String {
    let head = |n: usize| format!("{}.", since(news, &joined_lower(&clauses[..n])));
    let fits = (1..=clauses.len()).rev().find(|n| head(*n).chars().count() <= HEAD).unwrap_or(1.min(clauses.len()));
    let rest = joined_lower(&clauses[fits..]);
    match (rest.is_empty(), news) {
        (true, _) => head(fits),
        (false, true) => format!("{} New as well: {rest}.", head(fits)),
        (false, false) => format!("{} Beside that, {rest}.", head(fits)),
    }
}

/// Of the causes, largest first, those that the sentence names. What explains most of a quantity that the largest are not on has no other place
/// where a reader would miss it.
fn headed<'v>(verdict: &Verdict, likely: &[&'v EffectEntry]) -> Vec<&'v EffectEntry> {
    let (first, rest) = likely.split_at(MOST.min(likely.len()));
    let on = |e: &EffectEntry| e.channels.iter().map(|name| whole(verdict, name)).collect::<Vec<_>>();
    let taken: Vec<String> = first.iter().flat_map(|e| on(e)).collect();
    let is_apart = |e: &&&EffectEntry| {
        shown_by_readings(e) || e.heldout_error_reduction > HALF && !on(e).iter().any(|quantity| taken.contains(quantity))
    };
    first.iter().chain(rest.iter().find(is_apart)).copied().collect()
}

/// Whether the readings of whole levels show it, so that no error tells how much it matters.
fn shown_by_readings(e: &EffectEntry) -> bool {
    e.is_read_off() && !e.is_of_single_readings()
}

/// How many causes there are: single readings are none.
fn causes(all: &[&EffectEntry]) -> usize {
    all.iter().filter(|e| !e.is_of_single_readings()).count()
}

/// The position of an effect among those of the verdict.
fn place(verdict: &Verdict, e: &EffectEntry) -> usize {
    verdict.effects.iter().position(|other| std::ptr::eq(other, e)).unwrap_or(usize::MAX)
}

/// Whether something else is likelier than an effect.
fn beaten(verdict: &Verdict, words: Vocabulary, e: &EffectEntry) -> bool {
    is_beaten(verdict, words, place(verdict, e))
}

/// What an effect does, with its size, and the sizes of the runs where one value is true of none.
fn sized_clause(verdict: &Verdict, words: Vocabulary, e: &EffectEntry) -> Clause {
    let clause = bounded_clause(verdict, words, e);
    let does = match e.of_no_run() {
        Some(alone) => {
            format!("{} on average, and the runs disagree ({})", clause.does, alone.split(" for ").next().unwrap_or(alone))
        }
        None => clause.does,
    };
    Clause { does, ..clause }
}

/// What an effect does, with its size, or with a bound where the run shows no more.
fn bounded_clause(verdict: &Verdict, words: Vocabulary, e: &EffectEntry) -> Clause {
    let clause = lost::said(verdict, words, e);
    if (words.clause)(e).does.contains(|c: char| c.is_ascii_digit()) {
        return clause;
    }
    // an interval of both signs says no more than the card does
    let tells = |p: &&Parameter| upper_bound(p).is_some() || p.ci95[0] * p.ci95[1] > 0.0;
    let asked = |p: &&Parameter| is_shown(words, e, p) && counted(p).is_none() && tells(p);
    let bound = e.parameters.iter().find(asked).map(|p| {
        let name = (words.parameter)(&e.id, &p.name);
        let [_, interval, unit] = value(p);
        // a name that ends in "up" is no place to go on with "up to"
        let colon = if interval.starts_with("up to") { ":" } else { "" };
        format!("{} ({name}{colon} {})", clause.does, format!("{interval} {unit}").trim_end())
    });
    Clause { does: bound.unwrap_or(clause.does), ..clause }
}

/// A clause for each effect; what differs from run to run is one clause with a part for each.
fn by_subject(verdict: &Verdict, told: &[&EffectEntry], words: Vocabulary) -> Vec<String> {
    let mut out: Vec<(&EffectEntry, Vec<String>)> = Vec::new();
    for e in told {
        match out.iter_mut().find(|(first, _)| first.run.is_some() && e.run.is_some() && first.id == e.id) {
            Some((_, parts)) => parts.push(sized_clause(verdict, words, e).does),
            None => out.push((e, vec![sized_clause(verdict, words, e).does])),
        }
    }
    out.iter().map(|(e, parts)| Clause::new(words.said(e).who, list(parts)).with(adverb(e.told_probability()))).collect()
}

fn ambiguous(verdict: &Verdict, words: Vocabulary, news: bool) -> String {
    let best: Vec<&EffectEntry> = verdict.effects.iter().filter(|e| e.id != "unknown").collect();
    // what the first alternative does without is what the question is about
    let disputed: Vec<&EffectEntry> = match verdict.alternatives.first() {
        Some(Alternative { change: Some(change), .. }) => verdict.effects.get(change.place).into_iter().collect(),
        Some(other) => without(&best, &other.ids),
        None => best,
    };
    // where in its row a reading lies is no news, and no question that a reader has
    if disputed.iter().any(|e| e.kin != Kin::WithinRow) {
        return contested(verdict, words, news, &disputed);
    }
    // what is named stands, and the question is what there is beside it
    let said = attributed(verdict, words, news);
    match as_well(verdict, words).filter(|_| disputed.is_empty()) {
        Some(more) => format!("{said} Perhaps {more}: {}.", doubt(verdict)),
        None => said,
    }
}

/// What the likeliest alternative has beside all that is named, as a clause.
fn as_well(verdict: &Verdict, words: Vocabulary) -> Option<String> {
    let best: Vec<&EffectEntry> = verdict.effects.iter().filter(|e| e.id != "unknown").collect();
    let more = instead(&best, &verdict.alternatives.first()?.ids);
    let clauses: Vec<String> = more.iter().map(|id| words.of_another(id, None).with("")).collect();
    (!clauses.is_empty()).then(|| format!("{} as well", list(&clauses)))
}

/// The sentence where a question is open: what could stand in the place of some effects, the likeliest first, and the largest sure cause.
fn contested(verdict: &Verdict, words: Vocabulary, news: bool, disputed: &[&EffectEntry]) -> String {
    let (own, common) = named(verdict, words);
    let question = question(verdict, words, disputed);
    let all = if own.is_empty() { &common } else { &own };
    let sure = all.iter().copied().filter(|e| !disputed.iter().any(|d| std::ptr::eq(*d, *e)));
    // what takes most comes first, be it sure or open
    let removed = |all: &[&EffectEntry]| all.iter().map(|e| e.heldout_error_reduction).fold(0.0, f64::max);
    let sure: Vec<&EffectEntry> = sure.filter(|e| !beaten(verdict, words, e)).take(MOST - 1).collect();
    let told = sure.len() + all.iter().filter(|e| disputed.iter().any(|d| std::ptr::eq(*d, **e))).count();
    let said: Vec<String> = sure.iter().map(|e| sized_clause(verdict, words, e).with(adverb(e.told_probability()))).collect();
    let out = if sure.is_empty() {
        format!("{}.", since(news, &question))
    } else if removed(&sure) > removed(disputed) {
        format!("{}. {}.", since(news, &joined_lower(&said)), upper(&question))
    } else {
        format!("{}. Beside that, {}.", since(news, &question), joined_lower(&said))
    };
    let nameless = verdict.effects.iter().any(|e| e.id == "unknown" && !e.is_without_correction());
    // what takes more than the question does is no smaller cause
    let is_told = |e: &EffectEntry| sure.iter().chain(disputed).any(|d| std::ptr::eq(*d, e));
    let larger = all.iter().any(|e| !is_told(e) && e.heldout_error_reduction > removed(disputed));
    let below = below(causes(all).saturating_sub(told), !larger, nameless);
    let joined = |parts: [String; 3]| parts.into_iter().filter(|s| !s.is_empty()).collect::<Vec<_>>().join(" ");
    let asked: Vec<&EffectEntry> = sure.iter().chain(disputed).copied().collect();
    let Some(explained) = explained(verdict, &asked, true, news) else { return joined([out, below, left(verdict)]) };
    // what says that more is told below has said so
    let rest = if explained.says_more { String::new() } else { below.clone() };
    let said = joined([format!("{out} {}", explained.said), rest, left(verdict)]);
    if said.split_whitespace().count() <= LONGEST {
        return said;
    }
    joined([format!("{out} {}", explained.brief), below, left(verdict)])
}

/// What is asked of some effects: each way in which it may be, the likeliest first.
fn question(verdict: &Verdict, words: Vocabulary, disputed: &[&EffectEntry]) -> String {
    let doubt = doubt(verdict);
    let best = disputed.iter().map(|e| e.probability).fold(0.0, f64::max);
    let mut ways = vec![Rival {
        ids: Vec::new(),
        said: list(&disputed.iter().map(|e| sized_clause(verdict, words, e).with("")).collect::<Vec<_>>()),
        probability: best,
    }];
    if let Some(first) = disputed.first() {
        let against = rivals(verdict, words, place(verdict, first));
        let none = Rival::none(verdict, words, first, &against);
        // that it has no cause of its own is a way where nothing is likelier
        let stands = against.iter().map(|r| r.probability).fold(best, f64::max) < none.probability;
        ways.extend(against.into_iter().chain(stands.then_some(none)));
    }
    ways.retain(|way| !way.said.is_empty());
    ways.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    ways.dedup_by(|a, b| a.said == b.said);
    match ways.as_slice() {
        [] => "the causes named below are not sure on this run".to_owned(),
        [one] => format!("perhaps {}: {doubt}", one.said),
        // words and figures must agree
        [first, second, ..] if second.probability < CLOSE * first.probability => {
            format!("perhaps {}, or, less likely, {}: {doubt}", first.said, second.said)
        }
        [first, second, ..] => format!("either {}, or {}: {doubt}", first.said, second.said),
    }
}

/// That the question is open, and what may settle it.
fn doubt(verdict: &Verdict) -> &'static str {
    match &verdict.next_experiment {
        Some(next) if next.separates => "this run cannot tell, the run proposed below may",
        Some(_) => "this run cannot tell, nor can any schedule that was tried",
        None if verdict.runs.len() > 1 => "these runs cannot tell",
        None => "this run cannot tell",
    }
}

/// What the cards have beside what the sentence tells: further causes, all of them smaller or not, and what has no name.
fn below(more: usize, smaller: bool, nameless: bool) -> String {
    let causes = match (more, smaller) {
        (0, _) => None,
        (1, true) => Some("a smaller cause".to_owned()),
        (1, false) => Some("one more cause".to_owned()),
        (n, true) => Some(format!("{n} smaller causes")),
        (n, false) => Some(format!("{n} more causes")),
    };
    let parts: Vec<String> = causes.into_iter().chain(nameless.then(|| "what has no name".to_owned())).collect();
    if parts.is_empty() {
        return String::new();
    }
    let verb = if parts.len() == 1 && more < 2 { "is" } else { "are" };
    format!("{} {verb} told below.", upper(&list(&parts)))
}

fn unattributed(verdict: &Verdict, news: bool) -> String {
    let corrections: Vec<&EffectEntry> = verdict.effects.iter().filter(|e| e.id == "unknown").collect();
    let mut on: Vec<String> = corrections.iter().flat_map(|e| e.channels.clone()).collect();
    if on.is_empty() {
        on = verdict.unexplained.iter().map(|u| u.channel.clone()).collect();
    }
    let elsewhere = loudest(verdict).filter(|u| !on.iter().any(|c| quantity(c) == quantity(&u.channel)));
    on = on.iter().map(|c| channel(c)).collect();
    on.dedup();
    let mut goes: Vec<String> = fitted_over(verdict, None).map(|v| channel(v)).collect();
    goes.dedup();
    // what is largest stands first, also where it was on another channel that a curve helped
    if let Some(loudest) = elsewhere {
        let fitted = match goes.is_empty() {
            true => "Nothing that was tried predicts it, so nothing was added to the model.".to_owned(),
            false => format!("A smooth term without a name was fitted on {}; it goes with {}.", list(&on), list(&goes)),
        };
        let first = since(news, "no known effect explains what the model leaves over.");
        let beyond = beyond_the_fit(verdict, loudest);
        return format!(
            "{first} Most is left on {}: {}.{beyond} {fitted}",
            channel(&loudest.channel),
            size_and_looks(verdict, loudest)
        );
    }
    let place = if on.is_empty() { String::new() } else { format!(" on {}", list(&on)) };
    let mut out = since(news, &format!("something is left{place} that no known effect explains."));
    if goes.is_empty() {
        out += " Nothing that was tried predicts it, so nothing was added to the model.";
    } else {
        out += &format!(" It goes with {}; a smooth term without a name was fitted.", list(&goes));
    }
    let left = left(verdict);
    if left.is_empty() { out } else { format!("{out} {left}") }
}

fn none(verdict: &Verdict, news: bool) -> String {
    let quiet = verdict.unexplained.is_empty();
    match (news, quiet) {
        (true, true) => "The declared model still explains the run: no channel is left with more than its noise.".to_owned(),
        (false, true) if verdict.guessed_floors.is_some() => {
            "As far as guessed noise floors tell, the declared model explains the run: no channel is left with more.".to_owned()
        }
        (false, true) => "The declared model explains the run: no channel is left with more than its noise.".to_owned(),
        (true, false) => {
            let most = largest(verdict).map(|l| format!(", most on {}: {}", l.on, l.size)).unwrap_or_default();
            format!("Nothing has changed since the model was made; the same errors remain{most}.")
        }
        (false, false) => format!("No name was found for what the declared model leaves over. {}", left(verdict)),
    }
}

/// What was found; against a declared model it is new since then.
fn since(news: bool, found: &str) -> String {
    match news {
        // a size is told as if it were the whole
        true if found.contains(|c: char| c.is_ascii_digit()) => {
            format!("New since the declared model, on top of what it has: {found}")
        }
        true => format!("New since the declared model: {found}"),
        false => upper(found),
    }
}

/// Clauses as one sentence.
fn joined_lower(clauses: &[String]) -> String {
    match clauses {
        [] => String::new(),
        [one] => one.clone(),
        [rest @ .., last] => format!("{}, and {last}", rest.join(", ")),
    }
}

/// Effects of the best hypothesis that another one lacks.
pub(super) fn without<'e>(best: &[&'e EffectEntry], ids: &[String]) -> Vec<&'e EffectEntry> {
    let mut ids: Vec<&String> = ids.iter().collect();
    let mut out = Vec::new();
    for e in best {
        match ids.iter().position(|id| **id == e.id) {
            Some(at) => drop(ids.remove(at)),
            None => out.push(*e),
        }
    }
    out
}

/// Identifiers of a hypothesis that the best one lacks.
pub(super) fn instead(best: &[&EffectEntry], ids: &[String]) -> Vec<String> {
    beyond(ids, &best.iter().map(|e| e.id.clone()).collect::<Vec<_>>())
}

/// What a channel is a part of: a vector of which it is an axis, the speed that several sensors read.
pub(super) fn whole(verdict: &Verdict, name: &str) -> String {
    let sensors = verdict.channels.keys().filter(|c| quantity(c) == "rpm").count();
    if quantity(name) == "rpm" && sensors > 1 { "the speeds".to_owned() } else { vector(name) }
}

/// Share of what such a whole had left over its noise that is gone, as squares over all its channels.
fn share(verdict: &Verdict, name: &str) -> Option<f64> {
    let of = |c: &Channel, rms: f64| (rms * rms - c.noise_floor_rms * c.noise_floor_rms).max(0.0);
    let named = whole(verdict, name);
    let axes = verdict.channels.iter().filter(|(other, _)| whole(verdict, other) == named).map(|(_, c)| c);
    let (before, after) = axes.fold((0.0, 0.0), |(b, a), c| (b + of(c, c.before.heldout_rms), a + of(c, c.after.heldout_rms)));
    (before > 0.0 && after.is_finite()).then(|| (1.0 - after / before).max(0.0))
}

/// A sentence on what is explained.
struct Explained {
    said: String,
    /// The same in fewest words, where a sentence is long already.
    brief: String,
    /// Whether it speaks of effects beside those of the sentence before.
    says_more: bool,
}

/// Whether what a whole had left over was plain to see, and most of it is gone.
fn was_plain_and_is_gone(verdict: &Verdict, name: &str) -> bool {
    let floors = verdict.channels.get(name).map_or(0.0, |c| c.before.heldout_rms / c.noise_floor_rms);
    floors > LOUD && share(verdict, name).is_some_and(|s| s > HALF)
}

/// How much the effects explain of what their first channels had left over; against a declared model also of the others on which most is gone, for all of
/// that is new. Nothing where that is not worth a figure. `open`: which of them are there is a question.
fn explained(verdict: &Verdict, told: &[&EffectEntry], open: bool, news: bool) -> Option<Explained> {
    let further =
        told.iter().filter(|_| news).flat_map(|e| e.channels.iter().skip(1)).filter(|c| was_plain_and_is_gone(verdict, c));
    let mut on: Vec<&str> = told.iter().filter_map(|e| e.channels.first()).chain(further).map(String::as_str).collect();
    on.sort_unstable();
    on.dedup_by_key(|c| whole(verdict, c));
    let told_of = |c| Some((c, share(verdict, c).filter(|s| *s >= TELLING)?));
    let shares: Vec<(&str, f64)> = on.into_iter().filter_map(told_of).collect();
    let is_told = |c: &String| shares.iter().any(|s| whole(verdict, s.0) == whole(verdict, c));
    let least = shares.iter().map(|s| s.1).min_by(f64::total_cmp)?;
    let most = shares.iter().map(|s| s.1).fold(least, f64::max);
    // what else was added on these channels has its part in the figure
    let beside = |e: &&EffectEntry| !told.iter().any(|t| std::ptr::eq(*t, *e)) && e.channels.iter().any(is_told);
    let others = verdict.effects.iter().any(|e| beside(&e));
    let nameless = verdict.effects.iter().filter(beside).any(|e| e.id == "unknown");
    let subject = match (others, told.len()) {
        (true, _) if nameless => "With all that is told below the model explains",
        (true, _) => "With all that is named below the model explains",
        (false, _) if open => "The model as it is now explains",
        (false, 1) => "That explains",
        (false, _) => "Together they explain",
    };
    // nothing is all as long as something is told of what is left
    let rest = verdict.unexplained.iter().any(|u| is_told(&u.channel));
    let per_cent = |share: f64| match share {
        s if s >= ALL && !rest => "all".to_owned(),
        s => format!("{:.0} %", (100.0 * s).min(99.0)),
    };
    // a noise floor may hold a part of what is named: all is what stood above it
    let over = |share: &str| if share == "all" { "above its noise floor" } else { "over" };
    let names: Vec<String> = shares.iter().map(|s| whole(verdict, s.0)).collect();
    let but: String = worse(verdict, &is_told).collect();
    let of_each: Vec<String> = shares.iter().map(|s| format!("{} for {}", per_cent(s.1), whole(verdict, s.0))).collect();
    let brief = format!("Explained: {}.{but}", list(&of_each));
    if most - least <= ALIKE {
        let mean = shares.iter().map(|s| s.1).sum::<f64>() / shares.len() as f64;
        let said = format!("{subject} {} of what {} had left {}.{but}", per_cent(mean), list(&names), over(&per_cent(mean)));
        return Some(Explained { said, brief, says_more: others });
    }
    let parts: Vec<String> = shares
        .iter()
        .map(|s| format!("{0} of what {1} had left {2}", per_cent(s.1), whole(verdict, s.0), over(&per_cent(s.1))))
        .collect();
    let short: Vec<String> = std::iter::once(parts[0].clone())
        .chain(shares[1..].iter().map(|s| format!("{} for {}", per_cent(s.1), whole(verdict, s.0))))
        .collect();
    Some(Explained { said: format!("{subject} {}.{but}", list(&short)), brief, says_more: others })
}

/// The channels of what a share is told of that are predicted worse for all that: the share of the whole does not show it.
fn worse<'v>(verdict: &'v Verdict, is_told: &'v dyn Fn(&String) -> bool) -> impl Iterator<Item = String> + 'v {
    let grows = |c: &Channel| 100.0 * (c.after.heldout_rms / c.before.heldout_rms - 1.0);
    let worse = verdict.channels.iter().filter(|(name, _)| is_told(name)).map(move |(name, c)| (name, grows(c)));
    worse.filter(|(_, more)| *more >= 0.5).map(|(name, more)| format!(" {} is predicted {more:.0} % worse.", heading(name)))
}

/// What is worth a word among what is left; a channel without a model is told by itself.
fn loud(verdict: &Verdict) -> impl Iterator<Item = &Unexplained> {
    let modelled = |u: &&Unexplained| !verdict.channels.not_predicted.contains_key(&u.channel);
    verdict.unexplained.iter().filter(|u| floors_left(verdict, u) > LOUD).filter(modelled)
}

/// Whether anything is left that is more than noise, loud or not.
pub(super) fn goes_beyond_noise(verdict: &Verdict) -> bool {
    !verdict.unexplained.is_empty() || verdict.channels.values().any(|c| c.after.heldout_rms > QUIET * c.noise_floor_rms)
}

/// The quantity that a channel measures: several sensors of one speed are one.
pub(super) fn quantity(name: &str) -> &str {
    if name.starts_with("rpm") && !name.starts_with("rpm_esc") { "rpm" } else { name }
}

/// What is loudest among what is left: where the load is held, if something is left there. When in its row a reading of a step lies is not known, and
/// every rig has a rest there.
pub(crate) fn loudest(verdict: &Verdict) -> Option<&Unexplained> {
    let most = |a: &&Unexplained, b: &&Unexplained| floors_left(verdict, a).total_cmp(&floors_left(verdict, b));
    loud(verdict).filter(|u| !is_of_steps(u)).max_by(most).or_else(|| loud(verdict).max_by(most))
}

/// Whether what is left lies where the load changes.
pub(super) fn is_of_steps(u: &Unexplained) -> bool {
    [BEHIND_STEPS, BEHIND_ONE, ON_THE_WAY].iter().any(|said| u.looks_like.contains(said))
}

/// What is loudest where the load is held, on a run of which no cause of its own is named: nothing that is named is what its reader looks for.
pub(crate) fn unnamed_rest(verdict: &Verdict, words: Vocabulary) -> Option<&Unexplained> {
    let has_names = matches!(verdict.verdict, Kind::Attributed | Kind::Ambiguous) && !verdict.effects.is_empty();
    let none_is_own = has_names && named(verdict, words).0.is_empty();
    loudest(verdict).filter(|u| none_is_own && !is_of_steps(u))
}

/// The error that is left on a channel, with unit: the one that the state of the channels tells.
pub(super) fn size_left(verdict: &Verdict, u: &Unexplained) -> String {
    let of = verdict.channels.get(&u.channel);
    of.map_or_else(|| format!("{:.1} times the noise", u.over_floor), |c| rms(c.after.heldout_rms, &c.unit))
}

/// The unit of a channel on which something is left.
fn unit_left<'v>(verdict: &'v Verdict, u: &Unexplained) -> &'v str {
    verdict.channels.get(&u.channel).map_or("", |c| c.unit.as_str())
}

/// What is left on the rows of the fit, where rows that it did not see are missed by much more; else empty.
fn beyond_the_fit(verdict: &Verdict, u: &Unexplained) -> String {
    let on_its_own = |seen| {
        format!(" On the rows of the fit it is {}: levels are missed that the fit did not see.", rms(seen, unit_left(verdict, u)))
    };
    fitted(verdict, &u.channel).map(on_its_own).unwrap_or_default()
}

/// The same in noise floors: of several runs that of all of them, as the state of the channels tells it.
pub(super) fn floors_left(verdict: &Verdict, u: &Unexplained) -> f64 {
    verdict.channels.get(&u.channel).map_or(u.over_floor, |c| c.after.heldout_rms / c.noise_floor_rms)
}

/// The remainder that the sentence tells.
struct Largest<'v> {
    /// The channel, or the speeds where several sensors are left with something.
    on: String,
    /// Its size, with unit.
    size: String,
    /// What it looks like is told of the sensor whose size is told.
    told: &'v Unexplained,
}

/// The loudest remainder.
fn largest(verdict: &Verdict) -> Option<Largest<'_>> {
    let loudest = loudest(verdict)?;
    let what = quantity(&loudest.channel);
    let sensors = loud(verdict).filter(|u| quantity(&u.channel) == what && verdict.channels.contains_key(&u.channel)).count();
    let on = if sensors > 1 { "the speeds".to_owned() } else { channel(&loudest.channel) };
    let of = |u: &&Unexplained| verdict.channels.get(&u.channel).map_or(0.0, |c| c.after.heldout_rms);
    let largest = loud(verdict).filter(|u| sensors > 1 && quantity(&u.channel) == what).max_by(|a, b| of(a).total_cmp(&of(b)));
    let told = largest.unwrap_or(loudest);
    let up_to = if largest.is_some() { "up to " } else { "" };
    Some(Largest { on, size: format!("{up_to}{} rms", size_left(verdict, told)), told })
}

/// What a remainder looks like, in its first words; the section on what is left has all.
fn looks(u: &Unexplained) -> String {
    let first = u.looks_like.split(';').next().unwrap_or_default();
    let first = first.strip_prefix("loudest on ").and_then(|rest| Some(rest.split_once(": ")?.1)).unwrap_or(first);
    let seems = u.looks_like.split("; ").find(|part| part.starts_with("goes with ")).filter(|_| u.depends_on.is_empty());
    let first = over_time(first)
        .replace("in one stretch", "mostly in one stretch")
        .replace("while the load is on its way", "as the load changes");
    seems.map_or(first.clone(), |seems| format!("{first}; it {seems}"))
}

fn size_and_looks(verdict: &Verdict, u: &Unexplained) -> String {
    format!("{} rms ({})", size_left(verdict, u), looks(u))
}

fn left(verdict: &Verdict) -> String {
    let Some(Largest { on, size, told }) = largest(verdict) else {
        let said = if goes_beyond_noise(verdict) { "Little is left beyond the noise." } else { "What is left is noise." };
        return said.to_owned();
    };
    let what = quantity(&told.channel);
    // what is left on the other channels stands beside their bars
    let unknown = if share(verdict, &told.channel).is_none_or(|s| s < HALF) { " No known effect explains it." } else { "" };
    let beyond = beyond_the_fit(verdict, told);
    let louder = |u: &Unexplained| floors_left(verdict, u) > floors_left(verdict, told);
    match loud(verdict).any(|u| quantity(&u.channel) != what) {
        false => format!("On {on} {size} is left ({}).{beyond}{unknown}", looks(told)),
        true if !is_of_steps(told) && loud(verdict).any(|u| quantity(&u.channel) != what && louder(u)) => {
            format!("Where the load is held, most is left on {on}: {size} ({}).{beyond}{unknown}", looks(told))
        }
        true => format!("Most is left on {on}: {size} ({}).{beyond}{unknown}", looks(told)),
    }
}
