//! Whether the heading's error grows while the field is undisturbed.
//!
//! What it is: the field is looked at in earth axes, with the true attitude. It is undisturbed where norm and dip are near the trial's
//! medians, by what the filter itself takes for equal. At the end of such a stretch the heading may be off by no more than at its
//! beginning, or by what the field's own heading is off somewhere in it: a room turns a field without changing norm and dip.
//! What can go wrong: a trial without a stretch that is long enough says nothing.
//! Units: s, degrees, uT.
//! Reference: `docs/ahrs.md`.

use super::score::{Error, run, turned};
use super::trial::{Sample, Trial};
use dcm::{Config, Dcm};

/// Least length of a stretch, s.
const LEAST: f64 = 10.0;
/// Both ends of a stretch, over which the heading's error is averaged, and the average of the field's own heading, s.
const END: f64 = 2.0;
/// Longest time without a true attitude within a stretch, s.
const GAP: f64 = 0.5;

/// Largest growth that is none, degrees: what an average of two seconds is uncertain by.
const MOST: f64 = 1.0;

/// Says of a set of trials, each from a time on, whether a heading's error grew; those in which it did are missed targets.
pub(super) fn line<'a>(set: &str, trials: impl Iterator<Item = (&'a Trial, f64)>, missed: &mut Vec<String>) -> String {
    let found: Vec<(&str, f64)> = trials.filter_map(|(t, from)| Some((t.name.as_str(), growth(&t.samples, from)?))).collect();
    let grown = found.iter().filter(|(_, deg)| *deg > MOST);
    missed
        .extend(grown.map(|(name, deg)| format!("{set}, {name}: the heading's error grew by {deg:.1} in an undisturbed field")));
    let most = found.iter().map(|(_, deg)| *deg).fold(f64::NEG_INFINITY, f64::max);
    format!(
        "{set}: undisturbed for {LEAST} s and more in {} trials, growth of the heading's error at most {most:.1}",
        found.len()
    )
}

/// What the field is at an instant with a true attitude.
struct Seen {
    t: f64,
    norm: f64,
    dip: f64,
    /// How far its heading is from north.
    off: f64,
    /// The filter's error of heading.
    error: f64,
}

/// By how much the heading's error grew most in an undisturbed stretch that begins after `from`; none where there is none.
pub(super) fn growth(samples: &[Sample], from: f64) -> Option<f64> {
    let seen = seen(samples);
    let median = |of: fn(&Seen) -> f64| {
        let mut all: Vec<f64> = seen.iter().map(of).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    };
    let (norm, dip) = (median(|s| s.norm)?, median(|s| s.dip)?);
    let field = &Config::DEFAULT.field;
    let (share, angle) = (f64::from(field.norm), f64::from(field.dip));
    let calm = |s: &Seen| s.t >= from && (s.norm / norm - 1.0).abs() < share && (s.dip - dip).abs() < angle;
    let stretches = seen.chunk_by(|a, b| calm(a) == calm(b) && b.t - a.t <= GAP);
    stretches.filter(|s| s.first().is_some_and(calm)).filter_map(grown).max_by(f64::total_cmp)
}

fn seen(samples: &[Sample]) -> Vec<Seen> {
    let mut errors: Vec<Error> = Vec::new();
    run(&mut Dcm::new(Config::DEFAULT), samples, |e| errors.push(e));
    let with_truth = samples.iter().filter_map(|s| Some((s, s.truth?)));
    let one = |((s, truth), e): ((&Sample, super::trial::Truth), &Error)| {
        let [east, north, up] = turned(truth.q, s.mag.map(f64::from));
        let level = east.hypot(north);
        Seen { t: s.t, norm: level.hypot(up), dip: up.atan2(level), off: east.atan2(north).to_degrees(), error: e.heading }
    };
    with_truth.zip(&errors).map(one).collect()
}

fn grown(stretch: &[Seen]) -> Option<f64> {
    let (first, last) = (stretch.first()?, stretch.last()?);
    if last.t - first.t < LEAST {
        return None;
    }
    let mean = |from: f64, to: f64| {
        let of: Vec<f64> = stretch.iter().filter(|s| (from..=to).contains(&s.t)).map(|s| s.error).collect();
        (of.iter().sum::<f64>() / of.len() as f64).abs()
    };
    let (mut average, mut own) = (first.off, 0.0f64);
    for pair in stretch.windows(2) {
        average += (pair[1].off - average) * ((pair[1].t - pair[0].t) / END).min(1.0);
        own = own.max(average.abs());
    }
    Some(mean(last.t - END, last.t) - mean(first.t, first.t + END).max(own))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stretch(error: impl Fn(f64) -> f64, off: f64) -> Vec<Seen> {
        (0..1200).map(|i| f64::from(i) * 0.01).map(|t| Seen { t, norm: 50.0, dip: -1.1, off, error: error(t) }).collect()
    }

    #[test]
    fn a_heading_that_runs_away_has_grown_and_one_that_follows_the_field_has_not() {
        let away = grown(&stretch(|t| t, 0.0)).expect("twelve seconds");
        assert!((away - 10.0).abs() < 0.1, "{away}");
        assert!(grown(&stretch(|t| t, 15.0)).expect("twelve seconds") < 0.0);
        assert!(grown(&stretch(|t| 12.0 - t, 0.0)).expect("twelve seconds") < 0.0);
        assert!(grown(&stretch(|t| t, 0.0)[..900]).is_none(), "nine seconds are too short");
    }
}
