//! Measures that differ from run to run by more than their own intervals allow.
//!
//! What it is: the scatter of a measure's values about their mean against their standard errors, chi-squared if these were all. It says that days
//! differ, or that something changed; not which.
//! What can go wrong: errors that are told too small make runs differ that do not.
//! Units: the measure's.
//! Reference: heterogeneity test, Cochran 1954, Biometrics 10:101.

use super::measure::{Scale, Value};
use super::{FEWEST, History};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Chance that one of all measures is said to differ where none does.
const CHANCE: f64 = 0.05;

/// Standard errors on either side of a value between which it lies in 95 of 100.
const SURE: f64 = 1.96;

/// A measure that differs: its place, and the runs whose values are surely the lowest and the highest, their errors counted against them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Differs {
    pub(super) measure: usize,
    pub(super) low: Value,
    pub(super) high: Value,
}

/// Those that differ: gains first, then those whose scatter is the largest beside their errors.
pub(super) fn differing(history: &History) -> Vec<Differs> {
    let asked: Vec<usize> = (0..history.measures.len()).filter(|m| history.measures[*m].asked).collect();
    let chance = CHANCE / asked.len().max(1) as f64;
    let mut out: Vec<(bool, f64, Differs)> = Vec::new();
    for m in asked {
        let own: Vec<Value> = history.series(m).into_iter().flatten().collect();
        let Some(times) = scatter(&own, history.measures[m].scale, chance) else { continue };
        let most = |v: &Value| v.value + SURE * v.se;
        let least = |v: &Value| v.value - SURE * v.se;
        let low = own.iter().min_by(|a, b| most(a).total_cmp(&most(b)));
        if let (Some(low), Some(high)) = (low, own.iter().max_by(|a, b| least(a).total_cmp(&least(b)))) {
            let differs = Differs { measure: m, low: *low, high: *high };
            out.push((!history.measures[m].name.ends_with(" gain"), times, differs));
        }
    }
    out.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
    out.into_iter().map(|o| o.2).collect()
}

/// Mean square of the values about their mean over what their errors make of it; nothing where that is no rarer than `chance`.
fn scatter(own: &[Value], scale: Scale, chance: f64) -> Option<f64> {
    let own: Vec<Value> = own.iter().map(|v| v.compared(scale)).collect();
    if own.len() < FEWEST {
        return None;
    }
    let weights: f64 = own.iter().map(|v| v.se.powi(-2)).sum();
    let mean = own.iter().map(|v| v.value * v.se.powi(-2)).sum::<f64>() / weights;
    let squares: f64 = own.iter().map(|v| ((v.value - mean) / v.se).powi(2)).sum();
    let freedom = (own.len() - 1) as f64;
    let law = ChiSquared::new(freedom).ok()?;
    (squares.is_finite() && law.sf(squares) < chance).then_some(squares / freedom)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[f64]) -> Vec<Value> {
        values.iter().map(|v| Value { value: *v, se: 1.0 }).collect()
    }

    #[test]
    fn values_that_their_errors_explain_do_not_differ() {
        assert_eq!(scatter(&of(&[0.0, 1.0, -1.0]), Scale::Linear, 0.05), None);
        assert_eq!(scatter(&of(&[-6.0, 5.0]), Scale::Linear, 0.05), None, "two runs are no history");
        let times = scatter(&of(&[-6.0, 5.0, 0.0]), Scale::Linear, 0.001).unwrap();
        assert!((times - 30.3).abs() < 0.1, "{times}");
        // a quotient is judged as one
        assert!(scatter(&of(&[100.0, 104.0, 98.0]), Scale::Log, 0.01).is_some());
    }
}
