//! A channel: what was measured, where, and how well at best.
//!
//! What it is: readings over time with the noise floor that the data themselves show.
//! What can go wrong: readings that are not finite are left out before a channel is made; a channel of fewer than [`FEWEST`] readings says nothing.
//! Units: the channel's own.
//! Reference: specification `closing-the-loop.md`, step 2.

/// Fewest readings of a channel: below them a memory and a scatter cannot be told apart.
pub const FEWEST: usize = 20;

/// One measured channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Name, as verdicts quote it.
    pub name: String,
    /// Unit of the readings.
    pub unit: &'static str,
    /// Times, s, rising.
    pub t: Vec<f64>,
    /// Readings, as long as the times.
    pub y: Vec<f64>,
    /// Noise floor: standard deviation of what no model predicts, from the data and not from a fit.
    pub floor: f64,
}

impl Channel {
    /// Number of readings.
    #[must_use]
    pub fn len(&self) -> usize {
        self.y.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.y.is_empty()
    }

    /// From the first to the last reading, s.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.t.last().unwrap_or(&0.0) - self.t.first().unwrap_or(&0.0)
    }

    /// The readings at `rows` alone.
    #[must_use]
    pub fn at(&self, rows: &[usize]) -> Self {
        let pick = |values: &[f64]| rows.iter().map(|i| values[*i]).collect();
        Self { t: pick(&self.t), y: pick(&self.y), ..self.clone() }
    }
}

/// Root mean square.
#[must_use]
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
