//! What stands against each name: its rivals, each with its probability, and what no rival has.
//!
//! What it is: the other hypotheses of a verdict sorted by the effect in whose place they put something, said in clauses.
//! What can go wrong: of a hypothesis that differs in several places only the names are known; it counts for every effect that it lacks.
//! Units: probabilities 0 to 1.
//! Reference: specification `formats.md`, "Verdict" (`alternatives`).

use super::sentence::{instead, without};
use super::vocabulary::Vocabulary;
use crate::verdict::words::{SURE, channel, list};
use crate::verdict::{Alternative, EffectEntry, Kin, Verdict};

/// What could stand in the place of an effect.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rival {
    /// Identifiers of what it is made of.
    pub(super) ids: Vec<String>,
    /// What it would do, as a clause.
    pub(super) said: String,
    /// Its probability, to be held against that of the effect.
    pub(super) probability: f64,
}

impl Rival {
    /// That an effect is none: what neither it nor its rivals have, but for the reserve.
    pub(super) fn none(v: &Verdict, words: Vocabulary, e: &EffectEntry, rivals: &[Self]) -> Self {
        let on = e.channels.first().map_or_else(String::new, |c| format!(" on {}", channel(c)));
        let probability = (open(e, rivals) - reserve(v, words)).max(0.0);
        Self { ids: Vec::new(), said: format!("what is left{on} has no cause of its own"), probability }
    }
}

/// The part of every probability that is kept for causes that the library lacks: what is open of the name of which least is, and no more than a
/// sure name may lack.
pub(super) fn reserve(v: &Verdict, words: Vocabulary) -> f64 {
    // what every rig has was not chosen among causes, and bears no part of it
    let chosen = |e: &EffectEntry| e.id != "unknown" && e.kin == Kin::Own && !e.is_of_single_readings();
    let named = v.effects.iter().enumerate().filter(|(_, e)| chosen(e));
    named.map(|(k, e)| open(e, &rivals(v, words, k))).fold(1.0 - SURE, f64::min)
}

/// The rivals of the effect at a position, the likeliest first, none twice.
pub(super) fn rivals(v: &Verdict, words: Vocabulary, place: usize) -> Vec<Rival> {
    let mut out: Vec<Rival> = Vec::new();
    for rival in v.alternatives.iter().filter_map(|a| rival(v, words, place, a)) {
        match out.iter_mut().find(|known| known.said == rival.said) {
            Some(known) => known.probability += rival.probability,
            None => out.push(rival),
        }
    }
    out.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    out
}

fn rival(v: &Verdict, words: Vocabulary, place: usize, other: &Alternative) -> Option<Rival> {
    let e = v.effects.get(place)?;
    if let Some(change) = &other.change {
        let beside = EffectEntry { channels: change.channels.clone(), ..e.clone() };
        // a name that stands beside it already is no other cause
        let there = |(k, o): (usize, &EffectEntry)| {
            k != place && o.id == change.id && change.channels.iter().any(|c| o.channels.contains(c))
        };
        let said = match v.effects.iter().enumerate().any(there) {
            true => "the causes beside it explain that alone".to_owned(),
            false => words.of_another(&change.id, Some(&beside)).with(""),
        };
        return (change.place == place).then(|| Rival { ids: vec![change.id.clone()], said, probability: change.probability });
    }
    let best: Vec<&EffectEntry> = v.effects.iter().filter(|e| e.id != "unknown").collect();
    if !without(&best, &other.ids).iter().any(|lacking| std::ptr::eq(*lacking, e)) {
        return None;
    }
    let ids = instead(&best, &other.ids);
    let clauses: Vec<String> = ids.iter().map(|id| words.of_another(id, Some(e)).with("")).collect();
    let said = if clauses.is_empty() { "nothing stands in its place".to_owned() } else { list(&clauses) };
    Some(Rival { ids, said, probability: other.probability })
}

/// The part of the probability that neither an effect nor its rivals have.
pub(super) fn open(e: &EffectEntry, rivals: &[Rival]) -> f64 {
    (1.0 - e.probability - rivals.iter().map(|r| r.probability).sum::<f64>()).max(0.0)
}

/// The likeliest that stands against an effect, that it is none included.
pub(super) fn likeliest(v: &Verdict, words: Vocabulary, place: usize) -> Option<Rival> {
    let e = v.effects.get(place)?;
    let rivals = rivals(v, words, place);
    let none = Rival::none(v, words, e, &rivals);
    rivals.into_iter().chain([none]).max_by(|a, b| a.probability.total_cmp(&b.probability))
}

/// Whether something else is likelier than an effect, so that it heads nothing.
pub(super) fn is_beaten(v: &Verdict, words: Vocabulary, place: usize) -> bool {
    let own = v.effects.get(place).map_or(0.0, |e| e.probability);
    likeliest(v, words, place).is_some_and(|other| other.probability > own)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::closed::vocabulary::{bare_entry, bare_verdict};
    use crate::verdict::Change;

    /// What every name leaves to causes that the library lacks stands against none of them; what every rig has bears no part of it.
    #[test]
    fn the_reserve_is_no_rival() {
        let named = |id: &str, kin: Kin, probability: f64| EffectEntry { kin, probability, ..bare_entry(id) };
        let effects =
            vec![named("supply_sag", Kin::Own, 0.88), named("creep", Kin::Own, 0.6), named("spinup_lag", Kin::OfEvery, 1.0)];
        let v = Verdict { effects, ..bare_verdict(Vec::new()) };
        let words = Vocabulary::RIG;
        assert!((reserve(&v, words) - 0.12).abs() < 1e-9, "{}", reserve(&v, words));
        let none = |k: usize| Rival::none(&v, words, &v.effects[k], &[]).probability;
        assert!(none(0) < 1e-9 && (none(1) - 0.28).abs() < 1e-9, "{} {}", none(0), none(1));
        assert!(!is_beaten(&v, words, 0) && !is_beaten(&v, words, 1));
    }

    /// What would be put in the place of a name and stands beside it already is no other cause.
    #[test]
    fn a_name_that_stands_beside_is_no_other_cause() {
        let on = |id: &str| EffectEntry { channels: vec!["voltage_v".into()], probability: 0.5, ..bare_entry(id) };
        let change = |id: &str| Change { place: 0, id: id.into(), channels: vec!["voltage_v".into()], probability: 0.3 };
        let of = |id: &str| Alternative { ids: vec![id.into()], probability: 0.3, change: Some(change(id)) };
        let effects = vec![on("battery_discharge"), on("supply_sag")];
        let v = Verdict { effects, alternatives: vec![of("supply_sag"), of("creep")], ..bare_verdict(Vec::new()) };
        let said: Vec<String> = rivals(&v, Vocabulary::RIG, 0).into_iter().map(|r| r.said).collect();
        assert!(said.iter().any(|s| s == "the causes beside it explain that alone"), "{said:?}");
        assert!(!said.iter().any(|s| s.contains("supply lead")), "{said:?}");
    }
}
