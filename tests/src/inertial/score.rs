//! What the verdicts on simulated recordings are worth.
//!
//! What it is: counts with Wilson's intervals; a sensor that was not touched is free to be named only for what it has.
//! What can go wrong: few seeds give wide intervals, which are printed.
//! Units: shares.
//! Reference: Wilson, Journal of the American Statistical Association 22, 1927.

use super::Cause;

/// Wilson's 95 % interval of a share.
#[must_use]
pub fn wilson(hits: usize, of: usize) -> (f64, f64) {
    let (n, z) = (of as f64, 1.96f64);
    if of == 0 {
        return (0.0, 1.0);
    }
    let p = hits as f64 / n;
    let middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    ((middle - half).max(0.0), (middle + half).min(1.0))
}

/// Whether a verdict is right: `ids` are those of its effects, the first one counting.
#[must_use]
pub fn judged(cause: Cause, verdict: &str, ids: &[&str]) -> bool {
    right(cause.id(), verdict, ids)
}

/// The same for a hidden cause by its id: empty for none, `unknown` for one that the library lacks.
#[must_use]
pub fn right(hidden: &str, verdict: &str, ids: &[&str]) -> bool {
    match hidden {
        "" => verdict == "none",
        "unknown" => matches!(verdict, "unattributed" | "ambiguous"),
        known => ids.first() == Some(&known) && verdict != "unattributed",
    }
}

/// Hits among tries.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tally {
    /// Right ones.
    pub hits: usize,
    /// All.
    pub of: usize,
}

impl Tally {
    /// Adds one.
    pub fn add(&mut self, hit: bool) {
        self.hits += usize::from(hit);
        self.of += 1;
    }
}

impl std::fmt::Display for Tally {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (lo, hi) = wilson(self.hits, self.of);
        write!(f, "{} of {} ({:.0} to {:.0} %)", self.hits, self.of, 100.0 * lo, 100.0 * hi)
    }
}
