//! Whether a channel has settled, and what it reads then.
//!
//! What it is: the samples of a stretch of time, their mean and its standard error; or why they are no reading.
//! What can go wrong: too short a stretch, a flagged sample, a reading that still moves, a mean that is not known well enough.
//! Units: counts, s.
//! Reference: batch means, Law & Kelton 1979: noise whose values hang together has the error of its batches' means, not of its samples'.

use std::fmt;

/// Length of a reading, s.
pub(super) const LENGTH_S: f64 = 2.0;
/// Fewest samples in it.
pub(super) const FEWEST: usize = 8;
/// Batches in which its scatter is looked at.
const BATCHES: usize = 8;
/// Most counts that a settled reading moves by, beside what its noise makes of none: 0.012 % of the converter's range.
const MOVES: f64 = 0.5;
/// Standard errors that noise alone makes a resting reading move by.
const BY_CHANCE: f64 = 4.0;
/// Largest standard error of a reading, counts: 0.05 % of the converter's range.
const LARGEST: f64 = 2.0;

/// Counts between which a channel is read: the converter's range without a hundredth at each end, where an amplifier has its rail.
const INSIDE: (f64, f64) = (41.0, 4054.0);

/// One sample of a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    /// Time, s.
    pub(super) t: f64,
    /// Mean of its conversions, counts.
    pub(super) counts: f64,
    /// What its board says of it.
    pub(super) flag: Option<&'static str>,
}

/// A settled reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Reading {
    /// Its mean, counts.
    pub(super) counts: f64,
    /// Standard error of that.
    pub(super) sigma: f64,
}

/// Why a stretch is no reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Unusable {
    /// Too little of it.
    Short {
        /// Samples there are.
        samples: usize,
        /// Time from the first to the last, s.
        seconds: f64,
    },
    /// The board flagged a sample.
    Flagged {
        /// As what.
        words: &'static str,
        /// Its counts.
        counts: f64,
    },
    /// It stands at an end of the converter's range, or at a rail of an amplifier that ends there.
    AtAnEnd {
        /// Its counts.
        counts: f64,
    },
    /// It moves.
    Moving {
        /// From beginning to end, counts.
        by: f64,
        /// Length of the stretch, s.
        seconds: f64,
    },
    /// It scatters.
    Scattering {
        /// Standard error of the mean, counts.
        sigma: f64,
    },
}

impl fmt::Display for Unusable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Short { samples, seconds } => {
                write!(f, "{samples} samples in {seconds:.1} s; expected at least {FEWEST} in {LENGTH_S} s")
            }
            Self::Flagged { words, counts } => {
                write!(f, "the channel is {words} ({counts:.0} counts); expected a reading inside its range")
            }
            Self::AtAnEnd { counts } => {
                write!(
                    f,
                    "the channel is at an end of its range ({counts:.0} counts); expected {:.0} to {:.0}",
                    INSIDE.0, INSIDE.1
                )
            }
            Self::Moving { by, seconds } => {
                write!(
                    f,
                    "not settled: it moves by {by:+.1} counts in {seconds:.1} s; expected less than {MOVES} beside its noise"
                )
            }
            Self::Scattering { sigma } => {
                write!(
                    f,
                    "not settled: its mean is known to {sigma:.1} counts only, something swings; expected {LARGEST} or better"
                )
            }
        }
    }
}

/// The reading of a stretch.
///
/// # Errors
/// [`Unusable`].
pub(super) fn reading(samples: &[Sample]) -> Result<Reading, Unusable> {
    if let Some((words, counts)) = samples.iter().find_map(|s| Some((s.flag?, s.counts))) {
        return Err(Unusable::Flagged { words, counts });
    }
    let seconds = samples.last().map_or(0.0, |last| last.t) - samples.first().map_or(0.0, |first| first.t);
    // the first sample is the mean of the time before its stamp
    let whole = seconds * samples.len() as f64 / (samples.len().max(2) - 1) as f64;
    if samples.len() < FEWEST || whole < 0.999 * LENGTH_S {
        return Err(Unusable::Short { samples: samples.len(), seconds });
    }
    let mean = |part: &[Sample]| part.iter().map(|s| s.counts).sum::<f64>() / part.len() as f64;
    let batches: Vec<f64> =
        (0..BATCHES).map(|b| mean(&samples[b * samples.len() / BATCHES..(b + 1) * samples.len() / BATCHES])).collect();
    let n = BATCHES as f64;
    let middle = batches.iter().sum::<f64>() / n;
    let at = |b: usize| (b as f64 + 0.5) / n - 0.5;
    let slope = batches.iter().enumerate().map(|(b, v)| at(b) * (v - middle)).sum::<f64>()
        / (0..BATCHES).map(|b| at(b).powi(2)).sum::<f64>();
    let square: f64 = batches.iter().enumerate().map(|(b, v)| (v - middle - slope * at(b)).powi(2)).sum();
    let scatter = (square / (n - 2.0)).sqrt();
    let sigma = scatter / n.sqrt();
    if slope.abs() > MOVES + BY_CHANCE * sigma * 12.0f64.sqrt() {
        return Err(Unusable::Moving { by: slope, seconds });
    }
    if sigma > LARGEST {
        return Err(Unusable::Scattering { sigma });
    }
    let counts = mean(samples);
    if !(INSIDE.0..=INSIDE.1).contains(&counts) {
        return Err(Unusable::AtAnEnd { counts });
    }
    Ok(Reading { counts, sigma })
}

impl Unusable {
    /// No patience helps there.
    pub(super) fn stays(self) -> bool {
        matches!(self, Self::Flagged { .. } | Self::AtAnEnd { .. })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Samples at 10 Hz of a curve, with noise of `noise` counts.
    pub(in super::super) fn samples(seconds: f64, noise: f64, seed: u64, curve: impl Fn(f64) -> f64) -> Vec<Sample> {
        let mut seed = seed;
        let mut normal = || {
            (0..12).fold(-6.0, |sum, _| {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                sum + (seed >> 40) as f64 / f64::from(1 << 24)
            })
        };
        (1..=(seconds * 10.0) as usize)
            .map(|k| Sample { t: 0.1 * k as f64, counts: curve(0.1 * k as f64) + noise * normal(), flag: None })
            .collect()
    }

    /// A resting channel is a reading; of many, its error is what it says.
    #[test]
    fn a_resting_channel_reads_its_mean_and_knows_its_error() {
        let (mut within, mut refused) = (0, 0);
        for seed in 0..1000 {
            match reading(&samples(2.0, 1.0, seed, |_| 1500.0)) {
                Ok(Reading { counts, sigma }) => within += usize::from((counts - 1500.0).abs() < sigma),
                Err(_) => refused += 1,
            }
        }
        // Student's t with six degrees of freedom: 64 %; batches of two and three samples differ a little
        assert!((560..=720).contains(&within) && refused < 30, "{within} within one standard error, {refused} refused");
    }

    #[test]
    fn what_moves_swings_or_is_flagged_is_none() {
        let creep = reading(&samples(2.0, 0.3, 1, |t| 1500.0 + 4.0 * t));
        assert!(matches!(creep, Err(Unusable::Moving { by, .. }) if (by - 8.0).abs() < 1.5), "{creep:?}");
        let settling = reading(&samples(2.0, 0.3, 1, |t| 1500.0 + 300.0 * (-t / 0.5).exp()));
        assert!(settling.is_err(), "{settling:?}");
        let swinging = reading(&samples(2.0, 0.3, 1, |t| 1500.0 + 40.0 * (6.0 * t).sin()));
        assert!(swinging.is_err(), "{swinging:?}");
        let mut clipped = samples(2.0, 0.3, 1, |_| 4095.0);
        clipped[13].flag = Some("saturated");
        let said = reading(&clipped).expect_err("flagged").to_string();
        assert!(said.contains("saturated (409"), "{said}");
        for end in [31.9, 4080.0] {
            let said = reading(&samples(2.0, 0.3, 1, |_| end)).expect_err("an amplifier's rail").to_string();
            assert!(said.contains("at an end of its range"), "{said}");
        }
        assert!(matches!(reading(&samples(1.5, 0.3, 1, |_| 1500.0)), Err(Unusable::Short { samples: 15, .. })));
        assert!(matches!(reading(&[]), Err(Unusable::Short { samples: 0, .. })));
    }
}
