//! What a schedule does not command: temperature, pressure and other covariates, as they would go on.
//!
//! What it is: each covariate of a run as a straight line in time and, where that halves what is left, a warming by the load that the
//! rig gives off again with one time constant; the same on a schedule that has not been flown.
//! What can go wrong: a straight line in time says nothing of another day; who compares predictions on it must know that no
//! schedule moves it.
//! Units: the covariate's; s, us.
//! Reference: lumped heat balance of one body, Incropera & DeWitt, section 5.1.

use crate::channel::Context;
use crate::log::Column;
use crate::numeric::solve::Normal;

/// Time constants of the warming that are tried, s.
const TIME_CONSTANTS: [f64; 6] = [5.0, 15.0, 50.0, 150.0, 500.0, 1500.0];

/// How one covariate went in a run.
struct Course {
    /// Value at the start and its slope per second.
    line: [f64; 2],
    /// Warming by full load and its time constant, s.
    warming: Option<(f64, f64)>,
}

/// The covariates of a run along a command that begins with the rig as cold as it was at the start of the run.
pub(crate) fn continued(context: &Context, t: &[f64], pulse_us: &[f64]) -> Vec<Column> {
    let named = context.temperature.iter().map(|v| ("temp_c", v)).chain(context.covariates.iter().map(|(n, v)| (n.as_str(), v)));
    named
        .map(|(name, values)| Column { name: name.to_owned(), values: course(context, values).along(context, t, pulse_us) })
        .collect()
}

fn course(context: &Context, values: &[f64]) -> Course {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    let still = Course { line: [mean, 0.0], warming: None };
    let (false, Some(first)) = (context.time_is_row, context.t.first()) else { return still };
    let weights = vec![1.0; values.len()];
    let ones = weights.clone();
    let time: Vec<f64> = context.t.iter().map(|t| t - first).collect();
    let Some(trend) = Normal::of_columns(&[ones.clone(), time.clone()], values, &weights).solve() else { return still };
    let pulse = context.pulse.as_deref().unwrap_or_default();
    let warmed = |tau: &f64| {
        let heat = heat(context, &time, pulse, *tau);
        let fitted = Normal::of_columns(&[ones.clone(), time.clone(), heat], values, &weights).solve()?;
        (fitted.coefficients[2] > 0.0).then_some((*tau, fitted))
    };
    let tried: &[f64] = if pulse.is_empty() { &[] } else { &TIME_CONSTANTS };
    let best = tried.iter().filter_map(warmed).min_by(|a, b| a.1.rss.total_cmp(&b.1.rss));
    match best {
        Some((tau, s)) if s.rss < 0.5 * trend.rss => {
            Course { line: [s.coefficients[0], s.coefficients[1]], warming: Some((s.coefficients[2], tau)) }
        }
        _ => Course { line: [trend.coefficients[0], trend.coefficients[1]], warming: None },
    }
}

impl Course {
    fn along(&self, context: &Context, t: &[f64], pulse_us: &[f64]) -> Vec<f64> {
        let warmth = match self.warming {
            Some((by, tau)) => heat(context, t, pulse_us, tau).into_iter().map(|h| by * h).collect(),
            None => vec![0.0; t.len()],
        };
        t.iter().zip(warmth).map(|(t, w)| self.line[0] + self.line[1] * t + w).collect()
    }
}

/// Heat that the load has left in the rig, 1 after long full load: the power of a propeller goes with the cube of the command above
/// the start of the motor.
fn heat(context: &Context, t: &[f64], pulse_us: &[f64], tau: f64) -> Vec<f64> {
    let load = |pulse: f64| ((pulse - context.start_pulse_us).max(0.0) / 1000.0).powi(3);
    let (mut held, mut last) = (0.0, 0);
    (0..t.len())
        .map(|i| {
            let share = 1.0 - (-(t[i] - t[last]) / tau).exp();
            held += share * (load(pulse_us[last]) - held);
            last = i;
            held
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Log;

    fn context(course: impl Fn(usize) -> f64) -> Context {
        let pulse: Vec<f64> = (0..900).map(|i| if i / 150 % 2 == 0 { 1000.0 } else { 1800.0 }).collect();
        let rpm = pulse.iter().map(|p| 7.0 * (p - 1000.0)).collect();
        let columns = [("pulse_us", pulse), ("rpm", rpm), ("temp_c", (0..900).map(course).collect())]
            .map(|(name, values)| Column { name: name.to_owned(), values });
        let log = Log { t: (0..900).map(|i| 0.1 * f64::from(i)).collect(), columns: columns.to_vec(), ..Log::default() };
        Context::new(&log, Some(1050.0))
    }

    #[test]
    fn a_trend_goes_on_and_no_command_moves_it() {
        let context = context(|i| 20.0 + 0.005 * i as f64);
        let t = [0.0, 50.0, 200.0];
        for pulse in [[1000.0; 3], [1900.0; 3]] {
            let columns = continued(&context, &t, &pulse);
            assert_eq!((columns.len(), columns[0].name.as_str()), (1, "temp_c"));
            for (value, expected) in columns[0].values.iter().zip([20.0, 22.5, 30.0]) {
                assert!((value - expected).abs() < 1e-6, "{value} for {expected}");
            }
        }
    }

    #[test]
    fn a_rig_that_warmed_with_its_load_warms_with_the_next_one() {
        let mut warm = 0.0;
        let rise: Vec<f64> = (0..900)
            .map(|i| {
                warm += (1.0 - (-0.1_f64 / 50.0).exp()) * (if i / 150 % 2 == 0 { 0.0 } else { 8.0 } - warm);
                20.0 + warm
            })
            .collect();
        let context = context(|i| rise[i]);
        let t: Vec<f64> = (0..3000).map(|i| 0.1 * f64::from(i)).collect();
        let last = |pulse: f64| *continued(&context, &t, &vec![pulse; t.len()])[0].values.last().expect("a row");
        assert!((last(1800.0) - 28.0).abs() < 0.2, "{}", last(1800.0));
        assert!((last(1000.0) - 20.0).abs() < 0.2, "{}", last(1000.0));
    }
}
