//! One size of an effect in two readings of it.
//!
//! What it is: what a speed sensor reads beyond the others shows a fault of it far more sharply than the sensor's own channel does, beside whose
//! cubic a departure at the top is all but free. What the contrast says of an amplitude goes into the equations of the channel.
//! What can go wrong: rows without the effect leave the contrast without a say; then the channel's own rows decide, as they would alone.
//! Units: those of the amplitudes; precision in weights of one row.
//! Reference: partitioned least squares, Frisch & Waugh 1933, Econometrica 1:387.

use crate::channel::{Context, DIFFERENCES, Relation, Target};
use crate::effects::design::{Label, TargetDesign};
use crate::effects::placed::Placed;
use crate::numeric::solve::{Normal, Solution};
use nalgebra::{DMatrix, DVector};

/// What the fit of a contrast says of the amplitudes of its effects.
pub(crate) struct Agreed {
    /// Each with its value.
    amplitudes: Vec<(Label, f64)>,
    covariance: DMatrix<f64>,
}

impl Agreed {
    /// From the solution of a contrast on so many samples, whose variances have this least scale.
    pub(crate) fn of(contrast: &TargetDesign, solution: &Solution, samples: usize, least_scale: f64) -> Self {
        let of_effect = |j: &usize| matches!(contrast.columns[*j].label, Label::Effect { .. });
        let chosen: Vec<usize> = (0..contrast.columns.len()).filter(of_effect).collect();
        let scale = (solution.rss / samples as f64).max(least_scale);
        Self {
            amplitudes: chosen.iter().map(|j| (contrast.columns[*j].label, solution.coefficients[*j])).collect(),
            covariance: solution.inverse.select_rows(&chosen).select_columns(&chosen) * scale,
        }
    }

    /// Adds it to the equations of a design with the same amplitudes.
    pub(crate) fn tell(&self, design: &TargetDesign, normal: &mut Normal) {
        let column = |label: Label| design.columns.iter().position(|c| c.label == label);
        let shared = self.amplitudes.iter().enumerate().filter_map(|(k, (label, value))| Some((k, column(*label)?, *value)));
        let shared: Vec<(usize, usize, f64)> = shared.collect();
        let own: Vec<usize> = shared.iter().map(|s| s.0).collect();
        let Some(precision) = self.covariance.select_rows(&own).select_columns(&own).cholesky().map(|c| c.inverse()) else {
            return;
        };
        let values = DVector::from_iterator(shared.len(), shared.iter().map(|s| s.2));
        normal.tell(&shared.iter().map(|s| s.1).collect::<Vec<_>>(), &values, &precision);
    }
}

/// The position of the contrast whose amplitudes a target shares, if one of the effects acts on both.
pub(crate) fn contrast_of(context: &Context, placed: &[Placed], target: &Target) -> Option<usize> {
    let (_, name) = DIFFERENCES.iter().find(|d| d.0 == target.name && target.relation == Relation::SpeedFromPulse)?;
    let on_both = |p: &Placed| p.instance.touches(name) && !p.effect.amplitudes(&p.instance).is_empty();
    placed.iter().any(|p| p.instance.touches(target.name) && on_both(p)).then(|| context.target(name)).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{Instance, by_id};
    use crate::fit::{Designs, Rows, design, fit_target};
    use crate::log::{Column, Log};
    use crate::model::Declared;

    /// Three speed sensors of a rotor whose speed wanders; the coupling of one slips above 4 500 rev/min.
    fn context() -> Context {
        let wave = |i: usize, k: f64| (k * (i * i) as f64).sin();
        let rows = 2400;
        let pulse: Vec<f64> = (0..rows).map(|i| 1100.0 + (i / 40 * 7 % 20) as f64 * 45.0).collect();
        let turns = |i: usize| 7000.0 * ((pulse[i] - 1000.0) / 1000.0).powf(0.8) + 40.0 * wave(i / 40, 0.37) + 6.0 * wave(i, 0.9);
        let rpm: Vec<f64> = (0..rows).map(turns).collect();
        let read = |k: f64| rpm.iter().enumerate().map(|(i, r)| r + 2.0 * wave(i, k)).collect::<Vec<f64>>();
        let slips = read(1.7).iter().map(|r| r - 0.02 * (r - 4500.0).max(0.0)).collect();
        let columns = [("pulse_us", pulse.clone()), ("rpm_beam", read(1.1)), ("rpm_opto", read(1.3)), ("rpm_encoder", slips)];
        let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
        Context::new(&Log { t: (0..rows).map(|i| 0.05 * i as f64).collect(), columns, ..Log::default() }, Some(1050.0))
    }

    #[test]
    fn a_fault_has_the_size_that_the_contrast_shows() {
        let context = context();
        let effect = by_id("coupling_slip").expect("in the library");
        let placed =
            [Placed { effect, instance: Instance::new(&["rpm_encoder", "rpm_encoder_difference"], ""), shape: vec![4500.0] }];
        let channel = context.target("rpm_encoder").expect("a sensor");
        // the upper levels are left out, as in a fold
        let keep: Vec<bool> = context.rpm.iter().map(|r| *r < 5600.0).collect();
        let slope = |fit: &crate::fit::TargetFit| {
            let of = |amplitude| fit.labels.iter().position(|l| *l == Label::Effect { effect: 0, amplitude });
            let [slope, bend] = [of(0), of(1)].map(|at| at.map_or(0.0, |at| fit.coefficients[at]));
            // a thousand above the onset
            slope + bend * 1000.0 / 4500.0
        };
        let together = Designs::new(&context, Declared::default(), &placed).fit(channel, Rows::Where(&keep)).expect("a fit");
        assert!((slope(&together) + 0.02).abs() < 0.003, "{}", slope(&together));
        let target = &context.targets[channel];
        let plain = design(&context, Declared::default(), &placed, target);
        let alone = fit_target(target, &plain, Rows::Where(&keep)).expect("a fit");
        assert!((slope(&alone) + 0.02).abs() > 0.02, "the channel by itself does not know it: {}", slope(&alone));
        // a sensor that the fault does not touch shares nothing
        assert!(contrast_of(&context, &placed, &context.targets[0]).is_none());
    }
}
