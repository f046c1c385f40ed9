//! What a hypothesis predicts: columns with amplitudes.
//!
//! What it is: every prediction is a sum of columns, each over one or more channels with one amplitude and its physical prior. What a
//! hypothesis may add is of this one kind, with a name or without.
//! What can go wrong: nothing; columns that no channel bears out keep their prior.
//! Units: a column is in the unit of its channel for an amplitude of one.
//! Reference: separable least squares, Golub & Pereyra 1973; the plan of `attribution`.

use std::sync::Arc;

/// One value a reading of a channel.
pub type Values = Arc<Vec<f64>>;

/// To whom a column belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Owner {
    /// The declared model.
    Declared,
    /// The term at this place of the hypothesis.
    Term(usize),
}

/// What is known of an amplitude before the log is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Expected value.
    pub mean: f64,
    /// Standard deviation; 0 where the amplitude is known.
    pub sd: f64,
    /// The sign that physics asks for; 0 for either.
    pub sign: f64,
}

impl Prior {
    /// About nothing, with a usual size.
    #[must_use]
    pub const fn about_zero(sd: f64) -> Self {
        Self { mean: 0.0, sd, sign: 0.0 }
    }

    /// Of one sign, with a usual size.
    #[must_use]
    pub const fn positive(sd: f64) -> Self {
        Self { mean: 0.0, sd, sign: 1.0 }
    }
}

/// One column.
#[derive(Debug, Clone)]
pub struct Column {
    /// To whom it belongs.
    pub owner: Owner,
    /// Name of its amplitude.
    pub name: &'static str,
    /// What is known of the amplitude.
    pub prior: Prior,
    /// Channels that it touches, each with its values.
    pub parts: Vec<(usize, Values)>,
}

impl Column {
    /// Whether the amplitude is known beforehand.
    #[must_use]
    pub fn is_given(&self) -> bool {
        self.prior.sd == 0.0
    }
}

/// All columns of a hypothesis, those of the declared model first.
#[derive(Debug, Clone, Default)]
pub struct Design {
    /// The columns.
    pub columns: Vec<Column>,
}

impl Design {
    /// The prediction of a channel of `n` readings.
    #[must_use]
    pub fn predict(&self, amplitudes: &[f64], channel: usize, n: usize) -> Vec<f64> {
        let mut out = vec![0.0; n];
        for (column, amplitude) in self.columns.iter().zip(amplitudes) {
            for (_, values) in column.parts.iter().filter(|(c, _)| *c == channel) {
                out.iter_mut().zip(values.iter()).for_each(|(o, v)| *o += amplitude * v);
            }
        }
        out
    }

    /// The same columns at `rows` of each channel alone.
    #[must_use]
    pub fn at(&self, rows: &[Vec<usize>]) -> Self {
        let pick = |channel: usize, values: &Values| Arc::new(rows[channel].iter().map(|i| values[*i]).collect());
        let column = |c: &Column| Column { parts: c.parts.iter().map(|(ch, v)| (*ch, pick(*ch, v))).collect(), ..c.clone() };
        Self { columns: self.columns.iter().map(column).collect() }
    }
}
