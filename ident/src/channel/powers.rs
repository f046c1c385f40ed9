//! Powers of what a channel is predicted from.
//!
//! What it is: the columns of the declared polynomials, made once a log and shared by all designs.
//! What can go wrong: a log without a command or a speed has columns of zeros beyond the constant.
//! Units: krpm or kus to the power.
//! Reference: specification `formats.md` (primary relations).

use super::{Context, Relation};
use std::sync::Arc;

/// One value a row of the log, in one piece of memory for all who hold it unchanged.
pub type Values = Arc<Vec<f64>>;

/// See [`Context::powers`]; a log without a command or a speed has columns of zeros beyond the constant.
pub(crate) fn powers_of(context: &Context, relation: Relation) -> Vec<Values> {
    let n = context.len();
    let x = context.regressor(relation).unwrap_or_else(|| vec![0.0; n]);
    let live = |i: usize| match (&context.pulse, relation) {
        (Some(p), Relation::SpeedFromPulse) => p[i] >= context.start_pulse_us,
        _ => true,
    };
    (0..=3).map(|k| Arc::new((0..n).map(|i| if live(i) { x[i].powi(k) } else { 0.0 }).collect())).collect()
}
