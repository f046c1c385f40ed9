//! Short names for several runs, so that a sentence can name one.
//!
//! What it is: the verdict on several runs as people read it: each log's name without what all of them share.
//! What can go wrong: names that share nothing, or of which next to nothing would be left, lose their ending alone.
//! Units: none.
//! Reference: none.

use crate::verdict::Verdict;
use std::borrow::Cow;

/// Fewest letters that tell a run.
const FEWEST: usize = 4;
/// What may stand between the parts of a name.
const BETWEEN: [char; 5] = ['_', '-', '.', ' ', '/'];

/// The names without their common beginning, which ends at a separator, and without their ending.
fn short(names: &[&str]) -> Vec<String> {
    let stems: Vec<&str> =
        names.iter().map(|n| n.rsplit_once('.').filter(|(stem, _)| !stem.is_empty()).map_or(*n, |(stem, _)| stem)).collect();
    let shared = stems.iter().skip(1).fold(stems.first().map_or(0, |s| s.len()), |most, stem| {
        stems[0]
            .char_indices()
            .zip(stem.chars())
            .find(|((_, a), b)| a != b)
            .map_or(most.min(stem.len()), |((at, _), _)| most.min(at))
    });
    let cut = stems.first().and_then(|first| first.get(..shared)?.rfind(BETWEEN)).map_or(0, |at| at + 1);
    let short = |of: usize| -> Vec<String> { stems.iter().map(|s| s[of..].to_owned()).collect() };
    let cut = if short(cut).iter().all(|s| s.chars().count() >= FEWEST) { cut } else { 0 };
    // two logs of one name in two folders keep what tells them apart
    let out = short(cut);
    let mut sorted = out.clone();
    sorted.sort_unstable();
    sorted.dedup();
    if sorted.len() == names.len() { out } else { names.iter().map(|n| (*n).to_owned()).collect() }
}

impl Verdict {
    /// The verdict with short names for the runs, where there are several: for people; the file has them whole.
    #[must_use]
    pub(crate) fn briefly(&self) -> Cow<'_, Self> {
        if self.runs.len() < 2 {
            return Cow::Borrowed(self);
        }
        let names: Vec<&str> = self.runs.iter().map(|r| r.run.as_str()).collect();
        let mut pairs: Vec<(&str, String)> = names.iter().copied().zip(short(&names)).collect();
        // a name that holds another one is told first
        pairs.sort_by_key(|(name, _)| std::cmp::Reverse(name.len()));
        let told = |text: &mut String| pairs.iter().for_each(|(name, short)| *text = text.replace(name, short));
        let mut out = self.clone();
        out.runs.iter_mut().for_each(|r| told(&mut r.run));
        out.unexplained.iter_mut().for_each(|u| told(&mut u.looks_like));
        for e in &mut out.effects {
            told(&mut e.evidence);
            e.run.iter_mut().for_each(told);
        }
        Cow::Owned(out)
    }
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn runs_are_told_by_what_they_do_not_share() {
        for (names, said) in [
            (["Steps_2023-12-17_153333.csv", "Steps_2024-02-06_131025.csv"], ["2023-12-17_153333", "2024-02-06_131025"]),
            (["day1.csv", "day2.csv"], ["day1", "day2"]),
            (["run_1.csv", "run_2.csv"], ["run_1", "run_2"]),
            (["a/run.csv", "b/run.csv"], ["a/run", "b/run"]),
            (["run.csv", "run.csv"], ["run.csv", "run.csv"]),
        ] {
            assert_eq!(short(&names), said, "{names:?}");
        }
    }
}
