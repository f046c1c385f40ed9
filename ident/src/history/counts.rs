//! Rows that were counted in each run: one rate for all runs, or two, split at a gap.
//!
//! What it is: the marginal likelihood of counts with a rate before the gap and one after it, over that with one rate. A day's own rate scatters
//! about the rig's; by how much is not known and is summed over.
//! What can go wrong: rows of one burst are not independent; they look like days that scatter much.
//! Units: evidence in nats; rates a row.
//! Reference: gamma-Poisson (negative binomial) counts, Greenwood & Yule 1920, J. R. Stat. Soc. 83:255.

use super::measure::Value;
use statrs::function::gamma::ln_gamma;

/// Steps of the logarithm of a rate, from a tenth of a row a run to every row.
const RATES: usize = 40;
/// Least rate, rows a run.
const LEAST: f64 = 0.1;
/// How days scatter: shapes of their gamma distribution, from one in which a few days have all of it to one in which all days are alike.
const SHAPES: [f64; 2] = [0.02, 1000.0];
/// Steps between them.
const STEPS: usize = 16;

/// What was counted in a run, and of how many rows: a half was added to each count, and the error is the count's root.
fn counted(value: Value) -> [f64; 2] {
    let rows = (value.value / value.se).powi(2);
    [(rows - 0.5).round().max(0.0), 100.0 * rows / value.value]
}

/// Evidence for a step at each gap, the first after the first run; nothing where no run has a count.
pub(super) fn steps(values: &[Option<Value>]) -> Option<Vec<f64>> {
    let runs: Vec<Option<[f64; 2]>> = values.iter().map(|v| v.map(counted)).collect();
    let known: Vec<f64> = runs.iter().flatten().map(|[_, rows]| *rows).collect();
    if known.is_empty() {
        return None;
    }
    let from = LEAST * known.len() as f64 / known.iter().sum::<f64>();
    let log = |k: usize, steps: usize, [from, to]: [f64; 2]| from * (to / from).powf(k as f64 / (steps - 1) as f64);
    let n = runs.len();
    // logarithms of what each scatter of the days brings, for one rate and for two at each gap
    let (mut alone, mut split) = (Vec::new(), vec![Vec::new(); n - 1]);
    for shape in (0..STEPS).map(|k| log(k, STEPS, SHAPES)) {
        let of_rate = |k: usize| sums(&runs, log(k, RATES, [from, 1.0]), shape);
        let rates: Vec<Vec<f64>> = (0..RATES).map(of_rate).collect();
        alone.push(log_mean(rates.iter().map(|sum| sum[n])));
        for gap in 1..n {
            let before = log_mean(rates.iter().map(|sum| sum[gap]));
            split[gap - 1].push(before + log_mean(rates.iter().map(|sum| sum[n] - sum[gap])));
        }
    }
    let alone = log_mean(alone.into_iter());
    Some(split.into_iter().map(|gap| log_mean(gap.into_iter()) - alone).collect())
}

/// Log likelihood of the first runs at a rate, from none of them to all.
fn sums(runs: &[Option<[f64; 2]>], rate: f64, shape: f64) -> Vec<f64> {
    let of = |[count, rows]: [f64; 2]| {
        let mean = rate * rows;
        ln_gamma(count + shape) - ln_gamma(shape) - ln_gamma(count + 1.0)
            + shape * (shape / (shape + mean)).ln()
            + count * (mean / (shape + mean)).ln()
    };
    let mut sum = 0.0;
    let so_far = runs.iter().map(|run| {
        sum += run.map_or(0.0, of);
        sum
    });
    std::iter::once(0.0).chain(so_far).collect()
}

/// Logarithm of the mean of exponentials.
pub(super) fn log_mean(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    let top = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !top.is_finite() {
        return top;
    }
    top + (values.iter().map(|v| (v - top).exp()).sum::<f64>() / values.len() as f64).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As measures have it: per cent of three thousand rows, a half added.
    fn of(counts: &[u32]) -> Vec<Option<Value>> {
        let value = |k: &u32| {
            let rows = f64::from(*k) + 0.5;
            Some(Value { value: 100.0 * rows / 3000.0, se: 100.0 * rows.sqrt() / 3000.0 })
        };
        counts.iter().map(value).collect()
    }

    #[test]
    fn a_value_gives_its_count_back() {
        for k in [0, 1, 7, 400] {
            let [count, rows] = counted(of(&[k])[0].expect("a value"));
            assert!(count == f64::from(k) && (rows - 3000.0).abs() < 1e-6, "{count} of {rows}");
        }
    }

    /// None in six runs and five in each of twelve is a change; one burst on one day, and days that scatter, are none.
    #[test]
    fn few_rows_in_every_run_are_a_change_and_one_burst_is_none() {
        let missed = steps(&of(&[0, 0, 0, 0, 0, 0, 7, 3, 5, 7, 7, 5, 3, 1, 8, 5, 6, 6])).expect("counts");
        assert!(missed[5] > 12.0 && missed.iter().all(|e| *e <= missed[5]), "{missed:?}");
        let burst = steps(&of(&[0, 0, 0, 0, 0, 0, 60, 0, 0, 0, 0, 0])).expect("counts");
        assert!(burst.iter().all(|e| *e < 3.0), "{burst:?}");
        let rare = steps(&of(&[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 635, 908, 0, 0, 0])).expect("counts");
        assert!(rare.iter().all(|e| *e < 5.0), "{rare:?}");
        let days = steps(&of(&[3, 9, 1, 0, 14, 2, 7, 1, 11, 0, 4, 8])).expect("counts");
        assert!(days.iter().all(|e| *e < 1.0), "{days:?}");
    }
}
