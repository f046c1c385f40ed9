//! The linear part of a hypothesis: for each target the columns whose weighted sum is the prediction.
//!
//! What it is: baseline polynomial columns, changed by each effect in causal order (regressor, gain, additive term, output).
//! What can go wrong: an effect that is asked for a channel that the log lacks leaves the design alone.
//! Units: each column is in the target's unit for a unit coefficient.
//! Reference: separable least squares, Golub & Pereyra 1973.

use crate::channel::powers::Values;
use crate::channel::{Context, Relation};
use crate::effects::placed::Placed;
use crate::numeric::solve::Normal;
use nalgebra::DMatrix;
use std::sync::Arc;

/// Covariance of the coefficients of a channel: the inverse of their equations, of weights that are `unit` over a variance, where the rows say so many
/// times less than their variances promise. What was known of a coefficient before any run is as sure as it was, however coloured the rows are
/// (Sherman & Morrison 1950).
pub(crate) fn covariance(
    relation: Relation,
    labels: impl Iterator<Item = Label>,
    inverse: DMatrix<f64>,
    (unit, times): (f64, f64),
) -> DMatrix<f64> {
    let mut out = inverse * times;
    for (k, label) in labels.enumerate() {
        if let Label::Base(power) = label
            && let Some((sd, _)) = relation.known(power)
        {
            let more = (1.0 - unit / times) / (sd * sd);
            let beside = out.column(k).into_owned();
            out -= &beside * beside.transpose() * (more / (1.0 + more * beside[k]));
        }
    }
    out
}

/// What a column's coefficient means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Label {
    /// Power of the regressor in the declared polynomial.
    Base(usize),
    /// Amplitude `amplitude` of the effect at position `effect` of the hypothesis.
    Effect {
        /// Position in the hypothesis.
        effect: usize,
        /// Position in that effect's list of amplitudes.
        amplitude: usize,
    },
}

/// A coefficient of a written model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Told {
    /// Of which column.
    pub(crate) label: Label,
    /// Its value.
    pub(crate) value: f64,
    /// Whether it belongs to what the channel measures, and not to the zero that it was tared to on the day.
    pub(crate) stands: bool,
}

/// One column over all rows of the log.
#[derive(Debug, Clone)]
pub struct Column {
    /// What its coefficient means.
    pub label: Label,
    /// One value a row; columns that no effect has changed are one piece of memory in all designs.
    pub values: Values,
}

/// Columns of one target.
#[derive(Debug, Clone)]
pub struct TargetDesign {
    /// Channel name.
    pub name: &'static str,
    /// Its relation.
    pub relation: Relation,
    /// Columns with free coefficients.
    pub columns: Vec<Column>,
    /// Known part of the prediction (a fixed `--model`); empty when there is none.
    pub fixed: Vec<f64>,
    /// Variance that an effect adds to the noise, one value a row; empty when there is none.
    pub extra_variance: Vec<f64>,
    /// Coefficients where a written model predicts; empty while they are sought.
    pub(crate) told: Vec<Told>,
    /// What [`Self::map_columns`] has made of which column, for the effect that is being applied: before and after.
    pub(crate) mapped: Vec<(Values, Values)>,
    /// Operators of a declared model that act on the rotor: what an effect does to the rotor goes through them, as the known part has.
    pub(crate) rotor: Arc<[Placed]>,
}

impl TargetDesign {
    /// The declared baseline of a target.
    #[must_use]
    pub fn baseline(context: &Context, name: &'static str, relation: Relation) -> Self {
        let columns = context
            .powers(relation)
            .iter()
            .take(relation.degree() + 1)
            .enumerate()
            .map(|(k, values)| Column { label: Label::Base(k), values: values.clone() })
            .collect();
        Self { columns, ..Self::empty(name, relation) }
    }

    /// A design without a column.
    pub(crate) fn empty(name: &'static str, relation: Relation) -> Self {
        Self {
            name,
            relation,
            columns: Vec::new(),
            fixed: Vec::new(),
            extra_variance: Vec::new(),
            told: Vec::new(),
            mapped: Vec::new(),
            rotor: Arc::default(),
        }
    }

    /// The same target with its baseline coefficients held at given values.
    #[must_use]
    pub fn pinned(mut self, coefficients: &[f64]) -> Self {
        self.fixed = self.predict(coefficients, self.columns.first().map_or(0, |c| c.values.len()));
        self.columns.clear();
        self
    }

    /// Adds to equations of the columns, of weights that are `unit` over a variance, what is known of the coefficients before any run.
    pub(crate) fn expect(&self, normal: &mut Normal, unit: f64) {
        for (k, column) in self.columns.iter().enumerate() {
            if let Label::Base(power) = column.label
                && let Some((sd, most)) = self.relation.known(power)
            {
                normal.expect(k, sd, most, unit);
            }
        }
    }

    /// What a declared model expects, or one that predicts makes of its columns so far but for the zeros of the day; `None` while coefficients are
    /// sought without a model.
    pub(crate) fn known(&self) -> Option<Vec<f64>> {
        let is_declared = !self.columns.iter().any(|c| matches!(c.label, Label::Base(_)));
        if is_declared && !self.fixed.is_empty() {
            return Some(self.fixed.clone());
        }
        let standing = self.told.iter().any(|t| t.stands).then(|| self.coefficients(|t| t.stands))?;
        Some(self.predict(&standing, self.columns.first()?.values.len()))
    }

    /// What was told of each column by those that count; zero for one of which nothing was.
    pub(crate) fn coefficients(&self, counts: impl Fn(&Told) -> bool) -> Vec<f64> {
        let told = |column: &Column| self.told.iter().find(|t| t.label == column.label && counts(t)).map_or(0.0, |t| t.value);
        self.columns.iter().map(told).collect()
    }

    /// Lets `change` act on every column and on the known part: for gains and output operators. At most once an effect, because what
    /// came of a column is kept: the same effect with the same shapes makes the same of it.
    pub fn map_columns(&mut self, change: impl Fn(&[f64]) -> Vec<f64>) {
        self.map_together(|columns| columns.iter().map(|c| change(c)).collect());
    }

    /// The same for an operator that is quicker on many columns than on one after the other.
    pub fn map_together(&mut self, change: impl Fn(&[&[f64]]) -> Vec<Vec<f64>>) {
        let is_known = |column: &Column| self.mapped.iter().any(|(before, _)| Arc::ptr_eq(before, &column.values));
        let new: Vec<Values> = self.columns.iter().filter(|c| !is_known(c)).map(|c| c.values.clone()).collect();
        let known_part = (!self.fixed.is_empty()).then_some(self.fixed.as_slice());
        let mut changed = change(&new.iter().map(|v| v.as_slice()).chain(known_part).collect::<Vec<&[f64]>>());
        if known_part.is_some() {
            self.fixed = changed.pop().unwrap_or_default();
        }
        let old = self.mapped.len();
        self.mapped.extend(new.into_iter().zip(changed.into_iter().map(Arc::new)));
        for column in &mut self.columns {
            if let Some(k) = self.mapped.iter().position(|(before, _)| Arc::ptr_eq(before, &column.values)) {
                let pair = self.mapped[k].clone();
                column.values = pair.1.clone();
                if k < old {
                    self.mapped.push(pair); // what was known stays known
                }
            }
        }
    }

    /// [`Self::map_columns`] for a factor on each row.
    pub fn scale(&mut self, factor: &[f64]) {
        self.map_columns(|column| column.iter().zip(factor).map(|(v, f)| v * f).collect());
    }

    /// Adds a column for an effect's amplitude.
    pub fn add(&mut self, effect: usize, amplitude: usize, values: Vec<f64>) {
        self.columns.push(Column { label: Label::Effect { effect, amplitude }, values: Arc::new(values) });
    }

    /// The prediction on every row.
    #[must_use]
    pub fn predict(&self, coefficients: &[f64], n: usize) -> Vec<f64> {
        let mut out = weighted_sum(&self.columns, coefficients, n);
        for (o, f) in out.iter_mut().zip(&self.fixed) {
            *o += f;
        }
        out
    }

    /// Variance of the prediction of a row, from the covariance of the coefficients.
    #[must_use]
    pub fn variance(&self, covariance: &DMatrix<f64>, row: usize) -> f64 {
        let values = || self.columns.iter().map(|c| c.values[row]).enumerate();
        values().map(|(i, x)| values().map(|(j, y)| x * covariance[(i, j)] * y).sum::<f64>()).sum::<f64>().max(0.0)
    }
}

fn weighted_sum(columns: &[Column], coefficients: &[f64], n: usize) -> Vec<f64> {
    let mut out = vec![0.0; n];
    for (column, c) in columns.iter().zip(coefficients) {
        for (o, v) in out.iter_mut().zip(column.values.iter()) {
            *o += c * v;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sensor's own gain and a factor that looks just like it: no more than the gain's prior leaves open, however little the rows say.
    #[test]
    fn what_was_known_stays_as_sure() {
        let (sd, most) = Relation::SpeedDifference.known(1).expect("a gain of its own");
        let labels = [Label::Base(0), Label::Base(1), Label::Effect { effect: 0, amplitude: 0 }];
        let mut normal = Normal::new(3);
        for row in 0..1000 {
            let x = 1.0 + 0.005 * f64::from(row);
            normal.add(&[1.0, x, x], 0.5 * x, 1.0);
        }
        normal.expect(1, sd, most, 1.0);
        let inverse = normal.solve().expect("a solution").inverse;
        let of = |times: f64| covariance(Relation::SpeedDifference, labels.into_iter(), inverse.clone(), (1.0, times));
        let (once, often) = (of(1.0), of(1000.0));
        for k in [1, 2] {
            let ratio = (often[(k, k)] / once[(k, k)]).sqrt();
            assert!((0.9..1.2).contains(&ratio), "{k}: {ratio} times");
        }
        assert!((often[(0, 0)] / once[(0, 0)] - 1000.0).abs() < 1.0, "what nothing was known of is as unsure as the rows");
    }
}
