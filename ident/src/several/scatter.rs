//! How far the runs of one rig agree on a value that they share.
//!
//! What it is: the scatter of what each run alone says about what all say together. It is a part of the error of the shared value, and where
//! it is larger than the runs' own errors allow, the runs disagree.
//! What can go wrong: a run that cannot tell of an effect has no value, and takes no part.
//! Units: as the parameters.
//! Reference: random effects, DerSimonian & Laird 1986, Controlled Clinical Trials 7:177; moments without weights, Hedges & Olkin 1985, chapter 9;
//! heterogeneity test, Cochran 1954, Biometrics 10:101.

use super::FEWEST;
use crate::effects::Estimate;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Chance that runs which have one value are said to disagree on it: that of three standard errors.
const CHANCE: f64 = 0.0027;

/// The error of a shared value is no smaller than the scatter of the runs leaves it: the variance of the runs about it, less that of their own
/// errors, over their number.
pub(super) fn widened(shared: &mut [Estimate], alone: &[Vec<Estimate>]) {
    for e in shared {
        let own = of_runs(e, alone);
        if own.len() < FEWEST {
            continue;
        }
        let runs = own.len() as f64;
        let square = own.iter().map(|(v, se)| (v - e.value).powi(2) - se * se).sum::<f64>() / runs;
        let scatter = (square.max(0.0) / runs).sqrt();
        e.se = if e.se.is_finite() { e.se.max(scatter) } else { e.se };
    }
}

/// The first parameter on which the runs disagree, with the least and the largest value that a run alone has.
pub(crate) fn disagreement(shared: &[Estimate], alone: &[Vec<Estimate>]) -> Option<(String, [f64; 2])> {
    shared.iter().filter(|e| e.name != "phase").find_map(|e| {
        let own = of_runs(e, alone);
        let ends = own.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], (v, _)| [a.min(*v), b.max(*v)]);
        are_apart(e.value, &own).then(|| (e.name.clone(), ends))
    })
}

/// Whether the runs lie about the shared value further than their own errors explain. The shared value's error takes no part: it is the
/// scatter that is asked about.
fn are_apart(shared: f64, own: &[(f64, f64)]) -> bool {
    let known: Vec<&(f64, f64)> = own.iter().filter(|(_, se)| *se > 0.0).collect();
    let squares: f64 = known.iter().map(|(v, se)| ((v - shared) / se).powi(2)).sum();
    known.len() >= FEWEST && ChiSquared::new((known.len() - 1) as f64).is_ok_and(|law| law.sf(squares) < CHANCE)
}

/// What the runs alone say of a value: each with its error, which is nothing where it is not known.
fn of_runs(e: &Estimate, alone: &[Vec<Estimate>]) -> Vec<(f64, f64)> {
    let of = |run: &Vec<Estimate>| run.iter().find(|own| own.name == e.name).map(|own| (own.value, own.se));
    let known = |(v, se): (f64, f64)| (v, if se.is_finite() { se } else { 0.0 });
    alone.iter().filter_map(of).filter(|(v, _)| v.is_finite()).map(known).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(value: f64, se: f64) -> Estimate {
        Estimate { name: "exponent".into(), unit: "1".into(), value, se }
    }

    /// Two runs that each say 0.7, and together 0.62 to a hundredth.
    #[test]
    fn an_interval_that_no_run_lies_in_is_widened_and_told() {
        let runs = [vec![estimate(0.710, 0.005)], vec![estimate(0.698, 0.006)]];
        let mut shared = [estimate(0.618, 0.007)];
        let told = disagreement(&shared, &runs).expect("they disagree");
        assert_eq!(told, ("exponent".to_owned(), [0.698, 0.710]));
        widened(&mut shared, &runs);
        let half = 1.96 * shared[0].se;
        assert!(shared[0].value + half > 0.710 && half < 0.3, "{half}");
    }

    /// Three leads of 0.06 to 0.1 ohm, each known to 2 mohm. Their scatter is the shared value's own error, and no excuse for it.
    #[test]
    fn three_leads_that_lie_apart_disagree_about_their_mean() {
        let runs = [0.06, 0.08, 0.10].map(|r| vec![estimate(r, 0.002)]);
        let mut shared = [estimate(0.08, 0.001)];
        widened(&mut shared, &runs);
        assert!(shared[0].se > 0.009, "{}", shared[0].se);
        assert_eq!(disagreement(&shared, &runs), Some(("exponent".to_owned(), [0.06, 0.10])));
        // as far apart, and no better known than that
        let vague = [0.06, 0.08, 0.10].map(|r| vec![estimate(r, 0.02)]);
        assert_eq!(disagreement(&shared, &vague), None);
        let unknown = [0.06, 0.08, 0.10].map(|r| vec![estimate(r, f64::INFINITY)]);
        assert_eq!(disagreement(&shared, &unknown), None);
    }

    #[test]
    fn runs_that_agree_leave_the_interval_as_it_is() {
        let runs = [vec![estimate(0.61, 0.02)], vec![estimate(0.63, 0.02)], Vec::new()];
        let mut shared = [estimate(0.618, 0.007)];
        assert_eq!(disagreement(&shared, &runs), None);
        widened(&mut shared, &runs);
        assert_eq!(shared[0].se, 0.007);
        widened(&mut shared, &[vec![estimate(0.9, 0.001)], Vec::new()]);
        assert_eq!(shared[0].se, 0.007, "one run has no scatter");
    }
}
