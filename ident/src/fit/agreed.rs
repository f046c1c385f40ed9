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

/// Least scale of a contrast's variances: a tenth of its noise's standard deviation, as in every fit.
const LEAST_SCALE: f64 = 0.01;

/// What the fit of a contrast says of the amplitudes of its effects.
pub(crate) struct Agreed {
    /// Each with its value.
    amplitudes: Vec<(Label, f64)>,
    covariance: DMatrix<f64>,
}

impl Agreed {
    /// From the solution of a contrast on so many samples.
    pub(crate) fn of(contrast: &TargetDesign, solution: &Solution, samples: usize) -> Self {
        let of_effect = |j: &usize| matches!(contrast.columns[*j].label, Label::Effect { .. });
        let chosen: Vec<usize> = (0..contrast.columns.len()).filter(of_effect).collect();
        let scale = (solution.rss / samples as f64).max(LEAST_SCALE);
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
