//! The curve of a channel that all runs share: what each run is laid beside.
//!
//! What it is: the declared polynomial through the samples of all runs, each run with the same weight.
//! What can go wrong: a channel that fewer than [`FEWEST`] runs have is left out.
//! Units: regressors as in [`crate::channel`]; the channel's.
//! Reference: specification `formats.md`, primary relations.

use super::FEWEST;
use crate::channel::{Context, Relation, STANDSTILL, Target};
use crate::log::SPEED;
use crate::numeric::solve::Normal;

/// Share of a run's samples that lie below what counts as its top.
const TOP: f64 = 0.98;
/// Fewest samples of a channel of a run.
pub(super) const SAMPLES: usize = 40;

/// The shared curve of one channel.
#[derive(Debug, Clone)]
pub(super) struct Curve {
    /// Channel.
    pub(super) channel: &'static str,
    /// What it is predicted from.
    pub(super) relation: Relation,
    /// Polynomial, constant first; the constant is of the runs and not used.
    coefficients: Vec<f64>,
    /// Top of the regressor.
    pub(super) top: f64,
    /// Share of the channel's range that is reached at the top.
    pub(super) full: f64,
}

impl Curve {
    /// Above its constant, at a value of the regressor.
    pub(super) fn at(&self, x: f64) -> f64 {
        x * self.coefficients.iter().skip(1).rev().fold(0.0, |sum, c| sum * x + c)
    }
}

/// Places in a target's rows that a static curve speaks of.
pub(super) fn usable<'t>(context: &'t Context, target: &'t Target) -> impl Iterator<Item = usize> + 't {
    let speed = target.relation == Relation::SpeedFromPulse;
    let turns = move |row: usize| {
        let driven = context.pulse.as_ref().is_none_or(|p| p[row] >= context.start_pulse_us);
        !speed || driven && context.rpm[row] > STANDSTILL
    };
    (0..target.rows.len()).filter(move |k| target.claims(target.rows[*k]) && target.y[*k].is_finite() && turns(target.rows[*k]))
}

/// Channels whose curve is asked for: thrust, torque, current over speed, and the first speed over the command.
pub(super) fn curves(contexts: &[Context]) -> Vec<Curve> {
    let speed = SPEED.into_iter().find(|name| contexts.iter().filter(|c| c.target(name).is_some()).count() >= FEWEST);
    let over_speed = ["thrust_n", "torque_nm", "current_a"];
    over_speed.into_iter().chain(speed).filter_map(|channel| curve(contexts, channel)).collect()
}

fn curve(contexts: &[Context], channel: &'static str) -> Option<Curve> {
    let mut normal: Option<(Normal, Relation)> = None;
    let mut tops = Vec::new();
    for context in contexts {
        let Some(target) = context.target(channel).map(|k| &context.targets[k]) else { continue };
        if !matches!(target.relation, Relation::Thrust | Relation::Torque | Relation::Current | Relation::SpeedFromPulse) {
            continue;
        }
        let Some(x) = context.regressor(target.relation) else { continue };
        let rows: Vec<usize> = usable(context, target).collect();
        if rows.len() < SAMPLES {
            continue;
        }
        let mut sorted: Vec<f64> = rows.iter().map(|k| x[target.rows[*k]]).collect();
        sorted.sort_by(f64::total_cmp);
        tops.push(sorted[((sorted.len() - 1) as f64 * TOP) as usize]);
        let weight = 1.0 / rows.len() as f64;
        let points = rows.iter().map(|k| (x[target.rows[*k]], target.y[*k], weight));
        let own = Normal::of_polynomial(target.relation.degree(), points);
        match &mut normal {
            Some((all, _)) => all.absorb(&own),
            None => normal = Some((own, target.relation)),
        }
    }
    if tops.len() < FEWEST {
        return None;
    }
    tops.sort_by(f64::total_cmp);
    let (normal, relation) = normal?;
    let mut out = Curve { channel, relation, coefficients: normal.solve()?.coefficients, top: tops[tops.len() / 2], full: 0.0 };
    out.full = out.at(out.top);
    (out.top > 0.0 && out.full.abs() > 0.0).then_some(out)
}
