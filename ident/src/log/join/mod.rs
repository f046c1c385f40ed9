//! Several loggers of one run, each with a clock of its own, on one clock.
//!
//! What it is: offset and drift of a second log's clock against the stand's, from what both saw (speed, current, voltage, thrust); then the
//! second log's channels on the stand's rows.
//! What can go wrong: logs that saw different runs, a run in which nothing changes, a schedule that repeats itself, a joint that would be
//! uncertain by more than [`LIMIT_S`]: refused with the reason. What a sensor reads late is in the offset: two clocks and two delays cannot be
//! told apart from the logs alone, so each channel's own offset is told beside.
//! Units: s, ppm.
//! Reference: local linear smoothing, Fan & Gijbels 1996; cluster-robust errors, Cameron & Miller, J. Human Resources 50 (2015).

mod coarse;
mod fine;
mod merge;
pub(crate) mod signal;

pub(crate) use merge::is_second_reading;
pub use merge::{LABELS, merge};

use crate::log::Log;
use fine::Fit;
use signal::{Pair, pairs};

/// Half width of the 95 % interval above which a joint is refused, s: at both ends of the overlap.
pub const LIMIT_S: f64 = 0.010;
/// Least correlation of a channel that both saw.
const ALIKE: f64 = 0.9;
/// Least ratio of what another alignment leaves to what the best one leaves.
const APART: f64 = 1.5;

/// Why two logs are not joined.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum JoinError {
    /// Time is a row index in one of them.
    #[error("{0}: no time column; expected a clock to be joined")]
    NoClock(String),
    /// No channel is in both with enough change.
    #[error("no channel that both hold changes: expected speed, current, voltage or thrust in both, over steps of the load")]
    NothingShared,
    /// The best alignment is a poor one.
    #[error(
        "{channel} of both logs is alike to {correlation:.2} at best; expected {ALIKE} or more (two different runs? one too short?)"
    )]
    Unlike {
        /// The channel that fits best.
        channel: &'static str,
        /// Its correlation.
        correlation: f64,
    },
    /// Two alignments do about equally well.
    #[error(
        "the logs fit at {0:.1} s and at {1:.1} s about as well (a schedule that repeats itself): expected one step that differs"
    )]
    Ambiguous(f64, f64),
    /// The joint is too uncertain.
    #[error("the joint would be uncertain by {half_ms:.0} ms at an end of the {overlap_s:.0} s that both saw; expected at most {:.0} ms (more steps of the load, a faster log)", 1e3 * LIMIT_S)]
    Unsure {
        /// Half width of the 95 % interval at the worse end.
        half_ms: f64,
        /// Length of the overlap.
        overlap_s: f64,
    },
}

/// What one channel alone says of the joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    /// Channel.
    pub channel: &'static str,
    /// Correlation of the two once joined.
    pub correlation: f64,
    /// How much later than the joint this channel of the second log is, and the half width of its 95 % interval, s.
    pub later_s: (f64, f64),
}

/// A joint of two clocks: stand time = other time + offset + drift * (other time - pivot).
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// What is added to the second clock at the pivot, s, and the half width of its 95 % interval.
    pub offset_s: (f64, f64),
    /// By how much the second clock is slow, ppm, and the half width of its 95 % interval.
    pub drift_ppm: (f64, f64),
    /// Where the offset holds, on the second clock, s: the middle of what both saw.
    pub pivot_s: f64,
    /// Half width of the 95 % interval at the worse end of the overlap, s.
    pub worst_s: f64,
    /// What both saw, on the stand's clock, s.
    pub overlap_s: (f64, f64),
    /// The channel that decided, and the others.
    pub seen: Vec<Seen>,
    /// Pieces of the overlap: time on the stand's clock, how much later the second log is there than the joint, standard error; s.
    pub pieces: Vec<[f64; 3]>,
}

impl Joint {
    /// Stand time of a time of the second clock.
    #[must_use]
    pub fn to_stand(&self, t: f64) -> f64 {
        t + self.offset_s.0 + 1e-6 * self.drift_ppm.0 * (t - self.pivot_s)
    }
}

/// Finds the joint of a second log's clock to the stand's.
///
/// # Errors
/// [`JoinError`].
pub fn align(stand: &Log, other: &Log) -> Result<Joint, JoinError> {
    for log in [stand, other] {
        if log.time_is_row() {
            return Err(JoinError::NoClock(log.name.clone()));
        }
    }
    let pairs = pairs(stand, other);
    if pairs.is_empty() {
        return Err(JoinError::NothingShared);
    }
    let lags = coarse::lags(&pairs);
    let mut fits: Vec<(usize, Fit)> = Vec::new();
    for lag in &lags {
        // the first channel that the alignment explains: speeds are filtered least, so they stand first
        let of = |k: usize| fine::fit(&pairs[k], *lag).map(|fit| (k, fit));
        let all: Vec<(usize, Fit)> = (0..pairs.len()).filter_map(of).collect();
        let good = all
            .iter()
            .find(|(_, f)| f.correlation >= ALIKE)
            .or_else(|| all.iter().max_by(|a, b| a.1.correlation.total_cmp(&b.1.correlation)));
        fits.extend(good.cloned());
    }
    fits.sort_by(|a, b| a.1.left().total_cmp(&b.1.left()));
    let Some((first, best)) = fits.first().cloned() else { return Err(JoinError::NothingShared) };
    if best.correlation < ALIKE {
        return Err(JoinError::Unlike { channel: pairs[first].channel, correlation: best.correlation });
    }
    let elsewhere = |f: &&(usize, Fit)| (f.1.at(f.1.pivot) - best.at(f.1.pivot)).abs() > 1.0;
    if let Some((_, second)) = fits.iter().skip(1).find(elsewhere)
        && second.left() < APART * best.left()
    {
        return Err(JoinError::Ambiguous(best.offset, second.offset));
    }
    let half = best.half_widths();
    if half.2 > LIMIT_S {
        let overlap_s = best.span.1 - best.span.0;
        return Err(JoinError::Unsure { half_ms: 1e3 * half.2, overlap_s });
    }
    Ok(joint(&pairs, first, &best))
}

fn joint(pairs: &[Pair], first: usize, best: &Fit) -> Joint {
    let (offset, drift, worst_s) = best.half_widths();
    let own = |pair: &Pair| -> Option<Seen> {
        let (correlation, later, half) = fine::later(pair, best)?;
        (correlation >= ALIKE).then_some(Seen { channel: pair.channel, correlation, later_s: (later, half) })
    };
    let deciding = Seen { channel: pairs[first].channel, correlation: best.correlation, later_s: (0.0, offset) };
    let rest = pairs.iter().enumerate().filter(|(k, _)| *k != first).filter_map(|(_, p)| own(p));
    Joint {
        offset_s: (best.offset, offset),
        drift_ppm: (1e6 * best.drift, 1e6 * drift),
        pivot_s: best.pivot,
        worst_s,
        overlap_s: (best.at(best.span.0), best.at(best.span.1)),
        seen: std::iter::once(deciding).chain(rest).collect(),
        pieces: best.pieces(),
    }
}
