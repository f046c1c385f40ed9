//! Whether the heading's error grows while the field is undisturbed.
//!
//! What it is: the field is looked at in earth axes, with the true attitude. It is undisturbed where norm and dip are near the trial's
//! medians, by what the filter itself takes for equal. At the end of such a stretch the heading may be off by no more than at its beginning,
//! or than the field's own heading has been off in it: a room turns a field without changing norm and dip. Within it, too, but for a
//! little: what a gyro's unknown offset adds before it is learnt, times the averaging time of the field.
//! What can go wrong: a trial without a stretch that is long enough says nothing.
//! Units: s, degrees, uT.
//! Reference: `docs/ahrs.md`.

use super::score::{Error, run, turned};
use super::trial::{Sample, Trial};
use dcm::{Config, Dcm};

/// Least length of a stretch, s.
const LEAST: f64 = 10.0;
/// Time over which the heading's error and the field's own heading are averaged, and the beginning of a stretch, s.
const AVERAGE: f64 = 2.0;
/// Longest time without a true attitude within a stretch, s.
const GAP: f64 = 0.5;

/// Time after which the gyro's offset is known well enough for the heading not to drift, s.
const LEARNT: f64 = 30.0;
/// Largest growth within a stretch, degrees: what averages of two seconds, and the room's north, are uncertain by.
const MOST: f64 = 2.0;
/// The same from the start on: what was left when the offset was taken off beforehand is not known yet.
const MOST_AT_START: f64 = 4.0;

/// Says of a set of trials whether a heading's error grew; those in which it did are missed targets. Where the gyro's offset was left in,
/// the start is not asked.
pub(super) fn line(set: &str, trials: &[&Trial], left_in: bool, missed: &mut Vec<String>) -> String {
    let limits = [(0.0, MOST_AT_START), (LEARNT, MOST)];
    let asked = &limits[usize::from(left_in)..];
    let of = |(from, limit): &(f64, f64)| {
        let found: Vec<(&str, Growth)> =
            trials.iter().filter_map(|t| Some((t.name.as_str(), growth(&t.samples, *from)?))).collect();
        let grown = |g: &Growth| g.at_end > 0.0 || g.within > *limit;
        let say = |(name, g): &(&str, Growth)| {
            format!(
                "{set}, {name}: the heading's error grew by {:.1} in an undisturbed field, {:.1} within it",
                g.at_end, g.within
            )
        };
        missed.extend(found.iter().filter(|(_, g)| grown(g)).map(say));
        let most = |of: fn(&Growth) -> f64| {
            let all = found.iter().map(|(name, g)| (*name, of(g)));
            all.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or(("none", f64::NEG_INFINITY))
        };
        let ((last, at_end), (name, within)) = (most(|g| g.at_end), most(|g| g.within));
        format!(
            "{set}, from {from} s on: undisturbed for {LEAST} s and more in {} trials; the heading's error grew from beginning to end by \
             {at_end:.1} at most, limit 0 ({last}), within by {within:.1}, limit {limit} ({name})",
            found.len()
        )
    };
    asked.iter().map(of).collect::<Vec<_>>().join("\n")
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

/// By how much a heading's error is beyond what it was at the beginning, and beyond what the field's own heading was off until then, degrees.
#[derive(Debug, Clone, Copy)]
struct Growth {
    /// At the end of a stretch.
    at_end: f64,
    /// Anywhere in it.
    within: f64,
}

/// The most of each in the undisturbed stretches that begin after `from`; none where there is none.
fn growth(samples: &[Sample], from: f64) -> Option<Growth> {
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
    stretches
        .filter(|s| s.first().is_some_and(calm))
        .filter_map(grown)
        .reduce(|a, b| Growth { at_end: a.at_end.max(b.at_end), within: a.within.max(b.within) })
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

/// The growth in one stretch.
fn grown(stretch: &[Seen]) -> Option<Growth> {
    let (first, last) = (stretch.first()?, stretch.last()?);
    if last.t - first.t < LEAST {
        return None;
    }
    let beginning: Vec<f64> = stretch.iter().take_while(|s| s.t <= first.t + AVERAGE).map(|s| s.error).collect();
    let beginning = beginning.iter().sum::<f64>() / beginning.len() as f64;
    let (mut error, mut off) = (beginning, first.off);
    let (mut bound, mut most) = (beginning.abs().max(off.abs()), f64::NEG_INFINITY);
    for pair in stretch.windows(2) {
        let k = ((pair[1].t - pair[0].t) / AVERAGE).min(1.0);
        off += (pair[1].off - off) * k;
        bound = bound.max(off.abs());
        error += (pair[1].error - error) * k;
        if pair[1].t >= first.t + AVERAGE {
            most = most.max(error.abs() - bound);
        }
    }
    Some(Growth { at_end: error.abs() - bound, within: most })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stretch(error: impl Fn(f64) -> f64, off: f64) -> Vec<Seen> {
        (0..1200).map(|i| f64::from(i) * 0.01).map(|t| Seen { t, norm: 50.0, dip: -1.1, off, error: error(t) }).collect()
    }

    #[test]
    fn a_heading_that_runs_away_has_grown_and_one_that_follows_the_field_has_not() {
        let most = |s: &[Seen]| grown(s).map(|g| (g.at_end, g.within)).expect("twelve seconds");
        let (at_end, within) = most(&stretch(|t| t, 0.0));
        assert!((within - 9.0).abs() < 0.3, "a mean of two seconds, less the second that the beginning is off: {within}");
        assert!((at_end - within).abs() < 1e-9, "{at_end}");
        for none in [stretch(|t| t, 15.0), stretch(|t| 12.0 - t, 0.0)] {
            let (at_end, within) = most(&none);
            assert!(at_end < 0.0 && within < 0.0, "{at_end} {within}");
        }
        assert!(grown(&stretch(|t| t, 0.0)[..900]).is_none(), "nine seconds are too short");
    }

    /// One that comes back before the stretch ends has grown too, and a field that is off later is no excuse.
    #[test]
    fn growth_is_looked_for_everywhere_in_a_stretch() {
        let there_and_back = stretch(|t| if t < 6.0 { 2.0 * t } else { 2.0 * (12.0 - t) }, 0.0);
        let back = grown(&there_and_back).expect("twelve seconds");
        assert!(back.within > 5.0 && back.at_end < back.within - 5.0, "{back:?}");
        let mut excused_too_late = stretch(|t| if t < 6.0 { 2.0 * t } else { 0.0 }, 0.0);
        excused_too_late.iter_mut().filter(|s| s.t > 8.0).for_each(|s| s.off = 15.0);
        assert!(grown(&excused_too_late).expect("twelve seconds").within > 5.0);
    }
}
