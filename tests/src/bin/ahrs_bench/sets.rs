//! Both sets of recordings, ready to be asked again and again.
//!
//! What it is: every shared BROAD trial in each of the eight variants of which VQF's figures are published, and every shared trial of the
//! phones with the gyro's bias taken off and left in; the mean errors of a configuration over each set.
//! What can go wrong: missing data is a failure.
//! Units: degrees.
//! Reference: `docs/ahrs.md`, "What was chosen on what".

use super::joined;
use super::phones::{Gyro, Phone, phones};
use super::score::{Score, run};
use super::trial::{Sample, Trial};
use super::variant::Variant;
use crate::run::Failure;
use dcm::{Config, Dcm};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The recordings of both sets.
pub(super) struct Sets {
    broad: Vec<Vec<Sample>>,
    own: Vec<Vec<Sample>>,
    raw: Vec<Vec<Sample>>,
}

/// Mean errors over each set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Errors {
    pub(super) broad: Score,
    /// The phones, the gyro's bias taken off beforehand.
    pub(super) own: Score,
    /// The phones, the bias left in.
    pub(super) raw: Score,
}

impl Errors {
    /// Total and inclination of BROAD, of the phones and of the phones with their bias, each as a change against `other`, as a share.
    pub(super) fn against(&self, other: &Self) -> [f64; 6] {
        let of = |e: &Self| [e.broad, e.own, e.raw].map(|s| [s.total, s.inclination]);
        let (now, then) = (of(self), of(other));
        std::array::from_fn(|i| now.as_flattened()[i] / then.as_flattened()[i] - 1.0)
    }
}

impl Sets {
    /// Reads the second set and makes the variants of the first.
    pub(super) fn read(trials: &[Trial], folder: &Path) -> Result<Self, Failure> {
        let published = Variant::ALL.into_iter().filter(|v| *v != Variant::Worst);
        let broad = published.flat_map(|v| trials.iter().map(move |t| v.of(t))).collect();
        let data = folder.join("data");
        let samples = |walks: Vec<Phone>| walks.into_iter().map(|p| p.trial.samples).collect();
        let [own, raw] = [phones(&data, Gyro::Own)?, phones(&data, Gyro::Raw)?].map(samples);
        Ok(Self { broad, own, raw })
    }

    /// The mean errors of a configuration.
    pub(super) fn errors(&self, config: Config) -> Errors {
        Errors { broad: mean(&self.broad, config), own: mean(&self.own, config), raw: mean(&self.raw, config) }
    }
}

/// Mean over recordings, each run from its start; as many at a time as the machine has cores.
fn mean(recordings: &[Vec<Sample>], config: Config) -> Score {
    let next = AtomicUsize::new(0);
    let mine = || next.fetch_add(1, Ordering::Relaxed);
    let one = |k: usize| recordings.get(k).map(|r| (k, run(&mut Dcm::new(config), r, |_| {})));
    let work = || std::iter::from_fn(|| one(mine())).collect::<Vec<_>>();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut scores: Vec<(usize, Score)> = std::thread::scope(|scope| {
        let handles: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        handles.into_iter().flat_map(joined).collect()
    });
    // the same sum, whoever ran which
    scores.sort_by_key(|(k, _)| *k);
    Score::mean(scores.iter().map(|(_, s)| s))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_shares_of_each_error() {
        let of = |total, inclination| Score { total, inclination, heading: 0.0 };
        let then = Errors { broad: of(2.0, 1.0), own: of(4.0, 2.0), raw: of(8.0, 2.0) };
        let now = Errors { broad: of(3.0, 1.0), own: of(4.0, 1.0), raw: of(8.0, 3.0) };
        assert_eq!(now.against(&then), [0.5, 0.0, 0.0, -0.5, 0.0, 0.5]);
    }
}
