//! How likely counts are by chance.
//!
//! What it is: the upper tail of the binomial distribution, and where it speaks against chance.
//! What can go wrong: nothing; counts and shares out of range are no evidence.
//! Units: none.
//! Reference: binomial test, Clopper & Pearson 1934.

use statrs::distribution::{Binomial, DiscreteCDF};

/// Probability below which it is no chance that so many are at one kind of place.
const CHANCE: f64 = 1e-3;

/// Whether more of `n` are at places of a kind, `share` of all, than chance brings there.
pub(crate) fn gathers(hits: usize, n: usize, share: f64) -> bool {
    let above = |d: Binomial| hits > 0 && d.sf(hits as u64 - 1) < CHANCE;
    Binomial::new(share, n as u64).is_ok_and(above)
}

#[cfg(test)]
mod tests {
    use super::gathers;

    /// Three of three at one place of ten come about once in a thousand, by 0.1^3; two of two do more often.
    #[test]
    fn few_gather_where_places_are_rare() {
        assert!(gathers(3, 3, 0.0999));
        assert!(!gathers(2, 2, 0.0999));
        assert!(!gathers(300, 300, 1.0));
        assert!(!gathers(0, 3, 0.0) && !gathers(1, 3, f64::NAN));
    }
}
