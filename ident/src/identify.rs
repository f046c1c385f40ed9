//! Identification: plateaus, declared fits, physical constants, quality.
//!
//! What it is: the thesis' static powerplant with standard errors, and what a designer reads from it.
//! What can go wrong: a log in which no channel can be predicted from another is refused.
//! Units: as stated on each figure.
//! Reference: specification `identification.md`, items 1 to 3.

use crate::close::CloseError;
use crate::context::{Context, Relation, unit_of};
use crate::heldout::residuals;
use crate::hypothesis::{Declared, Rows, fit};
use crate::log::Log;
use crate::model::Model;
use crate::plateau::{Plateau, plateaus};
use crate::solve::Normal;

/// Quality of one fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    /// Channel.
    pub channel: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Root mean square residual.
    pub rms: f64,
    /// Noise floor inside steady stretches.
    pub noise_floor: f64,
    /// Share of the variance that is explained.
    pub r2: f64,
}

/// A physical constant.
#[derive(Debug, Clone, PartialEq)]
pub struct Constant {
    /// Symbol.
    pub name: &'static str,
    /// Value.
    pub value: f64,
    /// Standard error.
    pub se: f64,
    /// Unit.
    pub unit: &'static str,
}

/// What identification gives.
#[derive(Debug, Clone)]
pub struct Identified {
    /// Model with declared fits and no effect.
    pub model: Model,
    /// Plateaus.
    pub plateaus: Vec<Plateau>,
    /// Column names of their means.
    pub columns: Vec<String>,
    /// Quality of each fit.
    pub quality: Vec<Quality>,
    /// k_T, k_Q where they can be had.
    pub constants: Vec<Constant>,
}

/// Identifies a log.
///
/// # Errors
/// [`CloseError::NoRelation`] where nothing can be fitted.
pub fn identify(log: &Log) -> Result<Identified, CloseError> {
    let context = Context::new(log, None);
    let refused = || CloseError::NoRelation { run: log.name.clone() };
    if !context.targets.iter().any(|t| t.relation.degree() > 0 && t.rows.len() > 8) {
        return Err(refused());
    }
    let fitted = fit(&context, Declared::default(), &[], None, Rows::All).ok_or_else(refused)?;
    let model = Model::from_fit(&context, log, Declared::default(), &fitted);
    let quality = context
        .targets
        .iter()
        .zip(residuals(&context, Declared::default(), &fitted))
        .map(|(t, r)| {
            let n = r.len().max(1) as f64;
            let mean = t.y.iter().sum::<f64>() / n;
            let total: f64 = t.y.iter().map(|y| (y - mean).powi(2)).sum();
            let left: f64 = r.iter().map(|v| v * v).sum();
            Quality {
                channel: t.name,
                unit: unit_of(t.name),
                rms: (left / n).sqrt(),
                noise_floor: t.noise.rms,
                r2: 1.0 - left / total.max(1e-300),
            }
        })
        .collect();
    let constants = [("k_T", Relation::Thrust, "N.s2"), ("k_Q", Relation::Torque, "N.m.s2")]
        .into_iter()
        .filter_map(|(name, relation, unit)| square_law(&context, relation).map(|(value, se)| Constant { name, value, se, unit }))
        .collect();
    Ok(Identified {
        model,
        plateaus: plateaus(&context, log),
        columns: log.columns.iter().map(|c| c.name.clone()).collect(),
        quality,
        constants,
    })
}

/// Coefficient of omega^2 with a free zero, and its standard error.
fn square_law(context: &Context, relation: Relation) -> Option<(f64, f64)> {
    let target = &context.targets[context.with_relation(relation).next()?];
    let mut normal = Normal::new(2);
    for (i, y) in target.rows.iter().zip(&target.y) {
        let omega = context.rpm[*i] * std::f64::consts::TAU / 60.0;
        normal.add(&[1.0, omega * omega], *y, 1.0);
    }
    let s = normal.solve()?;
    let variance = s.rss / (normal.count.saturating_sub(2)).max(1) as f64;
    Some((s.coefficients[1], (s.inverse[(1, 1)] * variance).sqrt()))
}
