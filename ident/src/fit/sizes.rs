//! How large an effect is, for a fit that sees a part of the run.
//!
//! What it is: a normal prior on the amplitudes that an effect has on a target. Its middle is nothing; over the run's rows it makes what the
//! effect adds as large, in the mean square, as all rows together found it. Rows that show the effect outweigh it at once; where
//! a fold shows next to nothing of it, it adds no more than what was found.
//! What can go wrong: the size is one figure a target: of a change that is large on a few rows little is left for them.
//! Units: those of the amplitudes; precision in weights of one row.
//! Reference: Zellner 1986, "On assessing prior distributions and Bayesian regression analysis with g-prior distributions"; its scale from the
//! run itself, George & Foster 2000, Biometrika 87:731.

use crate::channel::Target;
use crate::effects::design::{Label, TargetDesign};
use crate::fit::TargetFit;
use crate::numeric::solve::Normal;
use nalgebra::{DMatrix, DVector};

/// What all rows say of how large each effect is on one target.
pub(crate) struct Sizes {
    /// The amplitudes of an effect, and how surely they are about nothing.
    of_effects: Vec<(Vec<Label>, DMatrix<f64>)>,
}

impl Sizes {
    /// From the `whole` fit of the target; `design` is that of the part.
    pub(crate) fn of(target: &Target, design: &TargetDesign, whole: &TargetFit) -> Self {
        let of = |label: Label| match label {
            Label::Effect { effect, .. } => Some(effect),
            Label::Base(_) => None,
        };
        let mut effects: Vec<usize> = design.columns.iter().filter_map(|c| of(c.label)).collect();
        effects.sort_unstable();
        effects.dedup();
        let left = whole.left.iter().map(|r| r * r).sum::<f64>() / whole.left.len().max(1) as f64;
        let scale = left.max(target.least_scale());
        let of_effect = |effect: usize| {
            let columns: Vec<_> = design.columns.iter().filter(|c| of(c.label) == Some(effect)).collect();
            let labels: Vec<Label> = columns.iter().map(|c| c.label).collect();
            let found = |label: &Label| whole.labels.iter().position(|l| l == label).map(|at| whole.coefficients[at]);
            let found = DVector::from_vec(labels.iter().map(found).collect::<Option<Vec<f64>>>()?);
            let product =
                |i: usize, j: usize| target.rows.iter().map(|row| columns[i].values[*row] * columns[j].values[*row]).sum();
            let square = DMatrix::from_fn(labels.len(), labels.len(), product);
            let added = found.dot(&(&square * &found));
            (added > 0.0).then(|| (labels, square * (scale * found.len() as f64 / added)))
        };
        Self { of_effects: effects.into_iter().filter_map(of_effect).collect() }
    }

    /// Adds it to the equations of a design with the same amplitudes.
    pub(crate) fn tell(&self, design: &TargetDesign, normal: &mut Normal) {
        for (labels, precision) in &self.of_effects {
            let column = |label: &Label| design.columns.iter().position(|c| c.label == *label);
            let Some(columns) = labels.iter().map(column).collect::<Option<Vec<usize>>>() else { continue };
            normal.tell(&columns, &DVector::zeros(columns.len()), precision);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::channel::Context;
    use crate::effects::placed::Placed;
    use crate::effects::{Instance, by_id};
    use crate::fit::{Designs, Fit, Rows, fit};
    use crate::log::{Column, Log};
    use crate::model::Declared;

    /// A rotor on levels of the command that loses 30 rev/min at full throttle from 40 s on, read to 3 rev/min.
    fn context() -> Context {
        let wave = |i: usize, k: f64| (k * (i * i) as f64).sin();
        let rows = 2000;
        let t: Vec<f64> = (0..rows).map(|i| 0.05 * i as f64).collect();
        // up to 58 s levels around half throttle alone follow the change
        let pulse: Vec<f64> = (0..rows)
            .map(|i| match i / 40 {
                20..29 => 1490.0 + 5.0 * (i / 40 % 3) as f64,
                level => 1150.0 + (level * 7 % 18) as f64 * 50.0,
            })
            .collect();
        let turns = |i: usize| {
            let u = (pulse[i] - 1050.0) / 950.0;
            // for half a second the rotor is late
            let lost = if t[i] < 40.0 { 0.0 } else { 30.0 * u * u - 20.0 * f64::exp(2.0 * (40.0 - t[i])) };
            7000.0 * u - 1200.0 * u * u - lost + 3.0 * wave(i, 0.7)
        };
        let rpm: Vec<f64> = (0..rows).map(turns).collect();
        let thrust = rpm.iter().enumerate().map(|(i, r)| 1e-7 * r * r + 0.01 * wave(i, 1.3)).collect();
        let columns = [("pulse_us", pulse.clone()), ("rpm", rpm), ("thrust_n", thrust)];
        let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
        Context::new(&Log { t, columns, ..Log::default() }, Some(1050.0))
    }

    fn damaged(context: &Context) -> (Vec<Placed>, Fit) {
        let effect = by_id("blade_damage").expect("in the library");
        let placed = vec![Placed { effect, instance: Instance::new(&["thrust_n", "rpm"], ""), shape: vec![40.0] }];
        let whole = fit(context, Declared::default(), &placed, None, Rows::All).expect("a fit");
        (placed, whole)
    }

    /// What the effect adds to the speed at full throttle, by a fit of the rows to keep.
    fn at_full_throttle(context: &Context, keep: &dyn Fn(f64) -> bool, sized: bool) -> f64 {
        let (placed, whole) = damaged(context);
        let speed = context.target("rpm").expect("a speed");
        let keep: Vec<bool> = context.t.iter().map(|t| keep(*t)).collect();
        let mut designs = Designs::new(context, Declared::default(), &placed);
        let fit = designs.fit_part(speed, Rows::Where(&keep), sized.then_some(&whole)).expect("a fit");
        let of = |amplitude| {
            let label = crate::effects::design::Label::Effect { effect: 0, amplitude };
            fit.labels.iter().position(|l| *l == label).map_or(0.0, |at| fit.coefficients[at])
        };
        let pulse = context.pulse.as_ref().expect("a command").iter().copied().fold(0.0, f64::max);
        let u = (pulse - context.start_pulse_us) / 1000.0;
        of(4) * u + of(5) * u * u
    }

    #[test]
    fn what_a_part_does_not_show_is_no_larger_than_what_was_found() {
        let context = context();
        let part = |t: f64| t < 43.0;
        let [free, sized] = [false, true].map(|sized| at_full_throttle(&context, &part, sized));
        assert!(free.abs() > 100.0 && sized.abs() < 60.0, "{free} {sized}");
    }

    #[test]
    fn rows_that_show_an_effect_outweigh_its_size() {
        let context = context();
        let part = |t: f64| !(60.0..70.0).contains(&t);
        let [free, sized] = [false, true].map(|sized| at_full_throttle(&context, &part, sized));
        assert!((free + 30.0).abs() < 3.0 && (sized - free).abs() < 0.05 * free.abs(), "{free} {sized}");
    }
}
