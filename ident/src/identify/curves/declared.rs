//! The declared relation of one channel over all its rows.
//!
//! What it is: the thesis' polynomial as weighted least squares, in blocks, so that a long log does not stand in memory as powers.
//! What can go wrong: fewer samples than coefficients and three more leave the relation out.
//! Units: the channel's, per power of rpm/1000 or (pulse - 1000 us)/1000.
//! Reference: Beharie 2013, section 5.7.3; specification `formats.md`, "primary relations".

use crate::channel::{Context, Relation, Target};
use crate::model::Polynomial;
use crate::numeric::solve::Normal;
use crate::signal::colour::effective_share;

/// A declared relation with its quality.
pub(crate) struct DeclaredFit {
    /// The polynomial.
    pub(crate) polynomial: Polynomial,
    /// Root mean square residual.
    pub(crate) rms: f64,
    /// Share of the variance that is explained.
    pub(crate) r2: f64,
}

/// Fits the declared polynomial of a target.
pub(crate) fn declared(context: &Context, target: &Target) -> Option<DeclaredFit> {
    let terms = target.relation.degree() + 1;
    let n = target.rows.len();
    if n < terms + 3 {
        return None;
    }
    let x = |j: usize| abscissa(context, target.relation, target.rows[j]);
    // a row below the starting pulse is predicted as zero and teaches no coefficient
    let point = |j: usize| x(j).map_or((0.0, 0.0, 0.0), |x| (x, target.y[j], 1.0 / target.levelled[j]));
    let mut normal = Normal::of_polynomial(target.relation.degree(), (0..n).map(point));
    for power in 0..terms {
        if let Some((sd, most)) = target.relation.known(power) {
            normal.expect(power, sd, most, 1.0);
        }
    }
    let solution = normal.solve()?;
    let predicted = |x: f64| solution.coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c);
    let mut residual: Vec<f64> = (0..n).map(|j| target.y[j] - x(j).map_or(0.0, predicted)).collect();
    let left: f64 = residual.iter().map(|r| r * r).sum();
    let mean = target.y.iter().sum::<f64>() / n as f64;
    let total: f64 = target.y.iter().map(|y| (y - mean).powi(2)).sum();
    residual.iter_mut().zip(&target.floored).for_each(|(r, v)| *r /= v.sqrt());
    let chi: f64 = residual.iter().map(|r| r * r).sum();
    let widen = (chi / n as f64).max(0.01) / effective_share(&residual);
    let errors = (0..terms).map(|k| (solution.inverse[(k, k)] * widen).max(0.0).sqrt()).collect();
    Some(DeclaredFit {
        polynomial: Polynomial { channel: target.name.to_owned(), coefficients: solution.coefficients, errors },
        rms: (left / n as f64).sqrt(),
        r2: 1.0 - left / total.max(1e-300),
    })
}

/// Scaled regressor of a relation on a row; `None` where the motor's command is below its starting pulse.
fn abscissa(context: &Context, relation: Relation, row: usize) -> Option<f64> {
    match relation {
        Relation::SpeedFromPulse => {
            let pulse = context.pulse.as_ref()?[row];
            (pulse >= context.start_pulse_us).then_some((pulse - 1000.0) / 1000.0)
        }
        Relation::SpeedAlone | Relation::Voltage => Some(0.0),
        Relation::Torque | Relation::Current | Relation::Thrust | Relation::ThrustRms | Relation::SpeedDifference => {
            context.rpm.get(row).map(|rpm| rpm / 1000.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{Rows, design, fit_target};
    use crate::log::{Column, Log};
    use crate::model::Declared;

    /// In blocks as the engine fits whole columns, over more than one block, with a standing rotor and missing samples.
    #[test]
    fn as_the_engine_fits_it() {
        let n = 9000;
        let pulse: Vec<f64> = (0..n).map(|i| 1000.0 + f64::from(i / 500) * 50.0).collect();
        let noise = |i: usize| ((i * 7919) % 1013) as f64 / 1013.0 - 0.5;
        let speed = |i: usize, p: f64| if p < 1040.0 { 0.0 } else { 500.0 + 5.0 * (p - 1000.0) + 20.0 * noise(i * i) };
        let rpm: Vec<f64> = pulse.iter().enumerate().map(|(i, p)| speed(i, *p)).collect();
        let thrust: Vec<f64> =
            rpm.iter().enumerate().map(|(i, r)| if i % 97 == 5 { f64::NAN } else { 1e-7 * r * r + 0.02 * noise(i) }).collect();
        let columns = [("pulse_us", pulse), ("rpm", rpm.clone()), ("thrust_n", thrust)];
        let log = Log {
            t: (0..n).map(|i| f64::from(i) * 0.1).collect(),
            columns: columns.into_iter().map(|(name, values)| Column { name: name.into(), values }).collect(),
            ..Log::default()
        };
        let context = Context::new(&log, None);
        for name in ["rpm", "thrust_n"] {
            let target = context.declared(&log, name).unwrap();
            let ours = declared(&context, &target).unwrap();
            let theirs = fit_target(&target, &design(&context, Declared::default(), &[], &target), Rows::All).unwrap();
            for (k, (a, b)) in ours.polynomial.coefficients.iter().zip(&theirs.coefficients).enumerate() {
                let error = theirs.covariance[(k, k)].sqrt();
                assert!((a - b).abs() < 1e-6 * error.max(1e-9), "{name} {k}: {a} {b} +- {error}");
                assert!((ours.polynomial.errors[k] / error - 1.0).abs() < 1e-6, "{name} {k}");
            }
        }
    }
}
