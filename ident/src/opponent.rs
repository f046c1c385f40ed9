//! The opponent without a name: a smooth function of one variable.
//!
//! What it is: the test of every name. Where a polynomial in one variable predicts held-out rows clearly better than the
//! named effects, the verdict is `unattributed`; and where nothing predicts a residual that is large and coloured, it says so.
//! What can go wrong: a variable that stands for the channel itself would always win; such variables are left out.
//! Units: evidence in nats.
//! Reference: discrepancy modelling, Ebers et al. 2022 (arXiv 2203.05164); specification `closing-the-loop.md`, step 7.

use crate::context::{Context, Relation, Target};
use crate::diagnose::{Candidate, FEWEST_SAMPLES, NEEDED_EVIDENCE, NEEDED_REDUCTION, net_gain, shares};
use crate::effects::unknown::{Unknown, variables};
use crate::effects::{Effect, Instance};
use crate::heldout::{self, Held};
use crate::hypothesis::{Declared, Fit, Placed, Rows, fit};
use crate::residual::whiteness;

/// The opponent without a name: a smooth function of one variable on one channel. It wins where it predicts held-out rows
/// clearly better than whatever was named there, and significantly.
pub(crate) fn opponent(
    context: &Context,
    declared: Declared<'_>,
    start: &Fit,
    folds: &[Vec<bool>],
    before: &[Held],
    best: &Candidate,
    named: &[Held],
) -> Option<(Candidate, Vec<Held>)> {
    let mut champion: Option<(f64, Candidate, Vec<Held>)> = None;
    for (i, target) in context.targets.iter().enumerate() {
        if target.relation.is_evidence() || target.relation == Relation::SpeedAlone {
            continue;
        }
        for variable in variables(context) {
            if is_load(context, target, &variable) {
                continue;
            }
            let instance = Instance::new(&[target.name], &variable);
            let shape = Unknown.shapes(context, &instance).iter().map(|s| s.range.0).collect();
            let Some(fitted) = fit(context, declared, &[Placed { effect: &Unknown, instance, shape }], Some(start), Rows::All)
            else {
                continue;
            };
            let shares = shares(context, [&fitted, &best.fit].into_iter());
            let candidate = Candidate { evidence: net_gain(context, &fitted, start, &shares), fit: fitted };
            if candidate.evidence < 2.0 * NEEDED_EVIDENCE {
                continue;
            }
            let held = heldout::errors_after_newest(context, declared, &candidate.fit, folds, before);
            let gain = (before[i].rms / held[i].rms).ln();
            let rival = (before[i].rms / named[i].rms).ln();
            // a name that depends on the same variable has found the dependence; only its form may be rough
            let same = best
                .fit
                .placed
                .iter()
                .any(|p| p.instance.touches(target.name) && p.effect.about().depends_on.contains(&variable.as_str()));
            let margin = if same { std::f64::consts::LN_2 } else { 0.15 };
            let clearly = gain > (1.0 / (1.0 - NEEDED_REDUCTION)).ln() && (best.fit.placed.is_empty() || gain > rival + margin);
            if clearly && champion.as_ref().is_none_or(|c| gain > c.0) {
                champion = Some((gain, candidate, held));
            }
        }
    }
    // names that explain more of the run as a whole stay
    champion.filter(|(_, c, _)| c.evidence > best.evidence).map(|(_, c, h)| (c, h))
}

/// Whether a variable stands for the channel itself or for the load, which its relation holds already. (The departure of
/// thrust from its polynomial in the speed is still a question; current and voltage follow the load with their own lags.)
fn is_load(context: &Context, target: &Target, name: &str) -> bool {
    let held = match target.relation {
        Relation::Torque | Relation::Thrust | Relation::Current => ["pulse_us", "current_a", "voltage_v"].contains(&name),
        _ => ["pulse_us", "current_a", "voltage_v", "rpm"].contains(&name),
    };
    held || twin(context, target, name)
}

/// Whether a column repeats the target in other units: squared correlation above 0.98 on its rows.
fn twin(context: &Context, target: &Target, name: &str) -> bool {
    let Some((_, values)) = context.covariates.iter().find(|c| c.0 == name) else { return false };
    let n = target.rows.len() as f64;
    let (mx, my) = (target.rows.iter().map(|i| values[*i]).sum::<f64>() / n, target.y.iter().sum::<f64>() / n);
    let (mut sxx, mut sxy, mut syy) = (0.0, 0.0, 0.0);
    for (i, y) in target.rows.iter().zip(&target.y) {
        let (dx, dy) = (values[*i] - mx, y - my);
        sxx += dx * dx;
        sxy += dx * dy;
        syy += dy * dy;
    }
    sxy * sxy > 0.98 * sxx * syy
}

/// Residual over noise floor, and whiteness, beyond which something is there even if nothing that we try predicts it.
const LEFT_OVER: (f64, f64) = (1.15, 1e-6);

/// Where no name and no smooth function won although a residual is large and coloured, something is there all the same: the
/// smooth function that predicts held-out rows best stands for it, however little that is.
pub(crate) fn nameless(
    context: &Context,
    declared: Declared<'_>,
    start: &Fit,
    best: &Fit,
    folds: &[Vec<bool>],
    before: &[Held],
) -> Option<(Candidate, Vec<Held>)> {
    let residuals = heldout::residuals(context, declared, best);
    let (i, target) = context
        .targets
        .iter()
        .enumerate()
        .filter(|(i, target)| {
            let r = &residuals[*i];
            let rms = (r.iter().map(|v| v * v).sum::<f64>() / r.len().max(1) as f64).sqrt();
            let t: Vec<f64> = target.rows.iter().map(|row| context.t[*row]).collect();
            let asked = !target.relation.is_evidence() && target.relation != Relation::SpeedAlone;
            asked && r.len() >= FEWEST_SAMPLES.0 && rms > LEFT_OVER.0 * target.noise.rms && whiteness(&t, r) < LEFT_OVER.1
        })
        .max_by(|a, b| {
            let excess = |i: usize| {
                residuals[i].iter().map(|v| v * v).sum::<f64>()
                    / (residuals[i].len() as f64 * context.targets[i].noise.rms.powi(2))
            };
            excess(a.0).total_cmp(&excess(b.0))
        })?;
    variables(context)
        .into_iter()
        .filter(|v| !is_load(context, target, v))
        .filter_map(|variable| {
            let instance = Instance::new(&[target.name], &variable);
            let shape = Unknown.shapes(context, &instance).iter().map(|s| s.range.0).collect();
            fit(context, declared, &[Placed { effect: &Unknown, instance, shape }], Some(start), Rows::All)
        })
        .map(|f| {
            let held = heldout::errors_after_newest(context, declared, &f, folds, before);
            (Candidate { evidence: f.targets[i].loglik.mean - start.targets[i].loglik.mean, fit: f }, held)
        })
        .min_by(|a, b| a.1[i].rms.total_cmp(&b.1[i].rms))
}
