//! How far the runs of one rig agree on a value that they share.
//!
//! What it is: the scatter of what each run alone says about what all say together. It is a part of the error of the shared value, and where
//! it is larger than the runs' own errors allow, the runs disagree.
//! What can go wrong: a run that cannot tell of an effect has no value, and takes no part.
//! Units: as the parameters.
//! Reference: random effects, DerSimonian & Laird 1986, Controlled Clinical Trials 7:177; moments without weights, Hedges & Olkin 1985, chapter 9.

use super::FEWEST;
use crate::effects::Estimate;

/// Standard errors between a run's own value and the shared one from which on they disagree: one in 370 such pairs lies so far apart by chance.
const APART: f64 = 3.0;

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
        let apart = |(v, se): &(f64, f64)| (v - e.value).abs() > APART * se.hypot(if e.se.is_finite() { e.se } else { 0.0 });
        let ends = own.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], (v, _)| [a.min(*v), b.max(*v)]);
        (own.len() >= FEWEST && own.iter().any(apart)).then(|| (e.name.clone(), ends))
    })
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
