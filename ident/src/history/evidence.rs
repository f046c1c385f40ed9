//! One series of values: one level for all runs, or a departure from it.
//!
//! What it is: the marginal likelihood of a series with a level, with what the day explains and with a departure of a given form (a step at a
//! gap, a straight line over time), over that without the departure. How runs scatter beyond their own errors is not known and is summed over.
//! What can go wrong: the scatter has a floor, so that values that agree by chance do not make a small step certain.
//! Units: logarithms are nats; sizes in standard deviations of a run about its level.
//! Reference: Bayes factors for nested normal models, Kass & Raftery 1995, JASA 90:773.

use super::measure::Value;
use nalgebra::{DMatrix, DVector};

/// Prior standard deviations of a departure, over that of a run.
const SIZES: [f64; 5] = [2.0, 6.0, 20.0, 60.0, 200.0];
/// Steps of the scatter between runs.
const SCATTERS: usize = 16;
/// Least scatter between runs over the spread of the series and over the runs' own errors.
const LEAST: [f64; 2] = [0.004, 0.3];
/// Prior standard deviation of the level, over the spread of the series.
const LEVEL: f64 = 30.0;

/// A series of a measure.
#[derive(Debug, Clone)]
pub(super) struct Series {
    /// Values less their mean, on the scale on which they are compared.
    y: Vec<f64>,
    /// Their variances.
    variance: Vec<f64>,
    /// Their mean, on that scale.
    pub(super) level: f64,
    /// Runs that have them.
    pub(super) at: Vec<usize>,
    /// What the day explains, in standard deviations, one column each.
    beside: Vec<Vec<f64>>,
    /// Spread of the values.
    spread: f64,
}

/// The series at one scatter between runs.
struct Scattered<'s> {
    series: &'s Series,
    weights: Vec<f64>,
    base: Vec<Vec<f64>>,
    inverse: DMatrix<f64>,
    sums: DVector<f64>,
    /// Standard deviation of a run.
    sd: f64,
    /// Marginal likelihood without a departure.
    alone: f64,
}

/// A departure as it was fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Departure {
    /// Evidence for it, nats.
    pub(super) evidence: f64,
    /// Its size.
    pub(super) size: f64,
    /// Its standard error.
    pub(super) se: f64,
    /// Standard deviation of a run about its level.
    pub(super) sd: f64,
}

impl Series {
    /// From one value a run, and what the day explains; nothing where fewer than three runs have one or all are the same.
    pub(super) fn of(values: &[Option<Value>], beside: &[Vec<f64>], least: f64) -> Option<Self> {
        let at: Vec<usize> = (0..values.len()).filter(|k| values[*k].is_some()).collect();
        if at.len() < super::FEWEST {
            return None;
        }
        let own: Vec<Value> = at.iter().filter_map(|k| values[*k]).collect();
        let n = own.len() as f64;
        let mean = own.iter().map(|v| v.value).sum::<f64>() / n;
        let y: Vec<f64> = own.iter().map(|v| v.value - mean).collect();
        let spread = (y.iter().map(|v| v * v).sum::<f64>() / n).sqrt();
        let variance: Vec<f64> = own.iter().map(|v| v.se * v.se + least * least).collect();
        let picked = |c: &Vec<f64>| standard(&at.iter().map(|k| c[*k]).collect::<Vec<f64>>());
        let beside = beside.iter().filter_map(picked).collect();
        (spread > 0.0).then_some(Self { y, variance, level: mean, at, beside, spread })
    }

    fn scattered(&self, tau: f64) -> Option<Scattered<'_>> {
        let weights: Vec<f64> = self.variance.iter().map(|v| 1.0 / (v + tau * tau)).collect();
        let mut base = vec![vec![1.0; self.y.len()]];
        base.extend(self.beside.iter().cloned());
        let k = base.len();
        let prior = |j: usize| if j == 0 { LEVEL * self.spread } else { self.spread };
        let gram = DMatrix::from_fn(k, k, |i, j| {
            let own = weighted(&weights, &base[i], &base[j]);
            if i == j { own + prior(i).powi(-2) } else { own }
        });
        let sums = DVector::from_fn(k, |j, _| weighted(&weights, &base[j], &self.y));
        let inverse = gram.cholesky()?;
        let determinant: f64 = inverse.l().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
        let inverse = inverse.inverse();
        let priors: f64 = (0..k).map(|j| 2.0 * prior(j).ln()).sum();
        let left = weighted(&weights, &self.y, &self.y) - (sums.transpose() * &inverse * &sums)[0];
        let logs: f64 = weights.iter().map(|w| w.ln()).sum();
        let sd = (self.y.len() as f64 / weights.iter().sum::<f64>()).sqrt();
        Some(Scattered { series: self, alone: 0.5 * (logs - determinant - priors - left), weights, base, inverse, sums, sd })
    }

    /// Scatters between runs that are summed over.
    fn scatters(&self) -> impl Iterator<Item = f64> + '_ {
        let own = (self.variance.iter().sum::<f64>() / self.variance.len() as f64).sqrt();
        let from = (LEAST[0] * self.spread).max(LEAST[1] * own);
        let to = (2.0 * self.spread).max(2.0 * from);
        (0..SCATTERS).map(move |k| from * (to / from).powf(k as f64 / (SCATTERS - 1) as f64))
    }

    /// Each form of a departure against none. A form has one number for each run of the history.
    pub(super) fn departures(&self, forms: &[Vec<f64>]) -> Vec<Departure> {
        let all: Vec<Scattered<'_>> = self.scatters().filter_map(|tau| self.scattered(tau)).collect();
        let top = all.iter().map(|s| s.alone).fold(f64::NEG_INFINITY, f64::max);
        let whole: f64 = all.iter().map(|s| (s.alone - top).exp()).sum();
        forms.iter().map(|form| departure(&all, top, whole, &self.at.iter().map(|k| form[*k]).collect::<Vec<f64>>())).collect()
    }
}

fn departure(all: &[Scattered<'_>], top: f64, whole: f64, form: &[f64]) -> Departure {
    let none = Departure { evidence: 0.0, size: 0.0, se: f64::INFINITY, sd: f64::NAN };
    if form.iter().all(|v| (v - form[0]).abs() < 1e-12) {
        return none;
    }
    // logarithms of what each scatter and each prior size bring
    let mut terms: Vec<f64> = Vec::new();
    let mut best = (f64::NEG_INFINITY, none);
    for s in all {
        let (information, pull) = s.of(form);
        for size in SIZES {
            let prior = (size * s.sd).powi(2);
            let gained = -0.5 * (1.0 + prior * information).ln() + 0.5 * pull * pull * prior / (1.0 + prior * information);
            let term = s.alone + gained - (SIZES.len() as f64).ln();
            if term > best.0 {
                let se = information.recip().sqrt();
                best = (term, Departure { evidence: 0.0, size: pull / information, se, sd: s.sd });
            }
            terms.push(term);
        }
    }
    let most = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = terms.iter().map(|t| (t - most).exp()).sum();
    let evidence = most - top + (sum / whole).ln();
    if evidence.is_finite() { Departure { evidence, ..best.1 } } else { none }
}

impl Scattered<'_> {
    /// Information on a form's size beside the level and the day, and the pull of the values on it.
    fn of(&self, form: &[f64]) -> (f64, f64) {
        let c = DVector::from_fn(self.base.len(), |j, _| weighted(&self.weights, &self.base[j], form));
        let inside = &self.inverse * &c;
        let information = weighted(&self.weights, form, form) - c.dot(&inside);
        let pull = weighted(&self.weights, form, &self.series.y) - self.sums.dot(&inside);
        (information.max(1e-300), pull)
    }
}

fn weighted(weights: &[f64], a: &[f64], b: &[f64]) -> f64 {
    weights.iter().zip(a).zip(b).map(|((w, a), b)| w * a * b).sum()
}

/// A column less its mean, in standard deviations; nothing where it does not vary.
fn standard(column: &[f64]) -> Option<Vec<f64>> {
    let n = column.len() as f64;
    let mean = column.iter().sum::<f64>() / n;
    let sd = (column.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    (sd.is_finite() && sd > 1e-9 * (1.0 + mean.abs())).then(|| column.iter().map(|v| (v - mean) / sd).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise of unit variance, always the same.
    pub(super) fn noise(n: usize, seed: u64) -> Vec<f64> {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..n).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect()
    }

    fn step(n: usize, gap: usize) -> Vec<f64> {
        (0..n).map(|k| f64::from(u8::from(k >= gap))).collect()
    }

    fn series(y: &[f64], beside: &[Vec<f64>]) -> Series {
        let values: Vec<Option<Value>> = y.iter().map(|v| Some(Value { value: *v, se: 0.1 })).collect();
        Series::of(&values, beside, 0.0).expect("values that differ")
    }

    #[test]
    fn a_step_has_evidence_at_its_gap_and_noise_has_none() {
        let quiet = noise(20, 3);
        let forms: Vec<Vec<f64>> = (1..20).map(|gap| step(20, gap)).collect();
        let none = series(&quiet, &[]).departures(&forms);
        assert!(none.iter().all(|d| d.evidence < 3.0), "{none:?}");
        let stepped: Vec<f64> = quiet.iter().enumerate().map(|(k, v)| v + if k >= 12 { 6.0 } else { 0.0 }).collect();
        let found = series(&stepped, &[]).departures(&forms);
        let best = (0..19).max_by(|a, b| found[*a].evidence.total_cmp(&found[*b].evidence)).expect("gaps");
        assert_eq!(best + 1, 12);
        assert!(found[best].evidence > 15.0 && (found[best].size - 6.0).abs() < 2.0 * found[best].se, "{:?}", found[best]);
    }

    #[test]
    fn what_the_day_explains_is_no_change() {
        let day: Vec<f64> = (0..20).map(|k| if k >= 12 { 3.0 + f64::from(k % 3) } else { f64::from(k % 4) - 1.0 }).collect();
        let y: Vec<f64> = noise(20, 5).iter().zip(&day).map(|(v, d)| 0.2 * v + 2.0 * d).collect();
        let forms = vec![step(20, 12)];
        let blind = series(&y, &[]).departures(&forms)[0].evidence;
        let told = series(&y, &[day]).departures(&forms)[0].evidence;
        assert!(blind > 8.0 && told < 2.0, "{blind} without the day, {told} with it");
    }
}
