//! The opponent without a name: a smooth function of one variable.
//!
//! What it is: the test of every name. Where a polynomial in one variable predicts held-out rows clearly better than the
//! named effects, the verdict is `unattributed`; and where nothing predicts a residual that is large and coloured, it says so.
//! What can go wrong: a variable that stands for the channel itself would always win; such variables are left out.
//! Units: evidence in nats.
//! Reference: discrepancy modelling, Ebers et al. 2022 (arXiv 2203.05164); specification `closing-the-loop.md`, step 7.

use crate::context::{Context, DIFFERENCES, Relation, Target};
use crate::diagnose::{Candidate, FEWEST_SAMPLES, NEEDED_EVIDENCE, NEEDED_REDUCTION, net_gain, shares};
use crate::effects::unknown::{Unknown, variables};
use crate::effects::{Effect, Instance, quantisation};
use crate::heldout::{self, Held};
use crate::hypothesis::{Declared, Fit, Placed, Rows, fit};
use crate::moment::best_moment;
use crate::residual::whiteness;

/// The opponent without a name: a smooth function of one variable on one channel, or on all speed channels alike. It wins where
/// it predicts held-out rows clearly better than whatever was named there, significantly, and names elsewhere are not the
/// larger part of what was found. Gives the channels on which it won.
pub(crate) fn opponent(
    context: &Context,
    declared: Declared<'_>,
    start: &Fit,
    folds: &[Vec<bool>],
    before: &[Held],
    best: &Candidate,
    named: &[Held],
) -> Option<Vec<usize>> {
    let mut champion: Option<(f64, Vec<usize>)> = None;
    for group in groups(context) {
        let (i, target) = (group[0], &context.targets[group[0]]);
        let on_group = |f: &Fit, shares: &[f64]| -> f64 {
            group.iter().map(|k| shares[*k] * (f.targets[*k].loglik.mean - start.targets[*k].loglik.mean)).sum()
        };
        for variable in variables(context) {
            if is_load(context, target, &variable) {
                continue;
            }
            let Some(fitted) = correction(context, declared, start, &group, &variable) else { continue };
            let shares = shares(context, [&fitted, &best.fit].into_iter());
            let candidate = Candidate { evidence: net_gain(context, &fitted, start, &shares), fit: fitted };
            let elsewhere = net_of_group(&best.fit, start, &shares, &group);
            let better = on_group(&candidate.fit, &shares) - on_group(&best.fit, &shares);
            if candidate.evidence < 2.0 * NEEDED_EVIDENCE || better < NEEDED_EVIDENCE || elsewhere > candidate.evidence {
                continue;
            }
            let held = heldout::errors_around_newest(context, declared, &candidate.fit, folds, before).with;
            let gain = (before[i].rms / held[i].rms).ln();
            let rival = (before[i].rms / named[i].rms).ln();
            // a name that depends on the same variable has found the dependence; only its form may be rough
            let same = best
                .fit
                .placed
                .iter()
                .any(|p| p.instance.touches(target.name) && p.effect.about().depends_on.contains(&variable.as_str()));
            if same && best.evidence > candidate.evidence {
                continue;
            }
            let margin = if same { std::f64::consts::LN_2 } else { 0.15 };
            let clearly = gain > (1.0 / (1.0 - NEEDED_REDUCTION)).ln() && (best.fit.placed.is_empty() || gain > rival + margin);
            if clearly && champion.as_ref().is_none_or(|c| gain > c.0) {
                champion = Some((gain, group.clone()));
            }
        }
    }
    champion.map(|c| c.1)
}

/// Channels that a correction without a name is tried on: each alone, and the speed channels together, which see one rotor.
fn groups(context: &Context) -> Vec<Vec<usize>> {
    let asked = |k: &usize| {
        let relation = context.targets[*k].relation;
        !relation.is_evidence() && relation != Relation::SpeedAlone
    };
    let (speeds, mut out): (Vec<usize>, Vec<usize>) =
        (0..context.targets.len()).filter(asked).partition(|k| context.targets[*k].relation == Relation::SpeedFromPulse);
    out.sort_unstable();
    std::iter::once(speeds).chain(out.into_iter().map(|k| vec![k])).filter(|g| !g.is_empty()).collect()
}

/// A smooth function of a variable, in one of its forms, added to the channels of a group.
pub(crate) fn correction(context: &Context, declared: Declared<'_>, start: &Fit, group: &[usize], form: &str) -> Option<Fit> {
    let names: Vec<&str> = group.iter().map(|k| context.targets[*k].name).collect();
    let instance = Instance::new(&names, form);
    let shape = Unknown.shapes(context, &instance).iter().map(|s| s.range.0).collect();
    fit(context, declared, &[Placed { effect: &Unknown, instance, shape }], Some(start), Rows::All)
}

/// Evidence of a fit over the start on the channels that are not of a group.
fn net_of_group(best: &Fit, start: &Fit, shares: &[f64], group: &[usize]) -> f64 {
    (0..shares.len())
        .filter(|k| !group.contains(k))
        .map(|k| shares[k] * (best.targets[k].loglik.mean - start.targets[k].loglik.mean))
        .sum()
}

/// Whether a variable stands for the channel itself or for the load, which its relation holds already. (The departure of
/// thrust from its polynomial in the speed is still a question; current and voltage follow the load with their own lags.)
pub(crate) fn is_load(context: &Context, target: &Target, name: &str) -> bool {
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
const LEFT_OVER: (f64, f64) = (1.3, 1e-6);

/// Channels that are noisier than on the day of a declared model by more than days differ.
pub(crate) fn noisier(context: &Context) -> Option<Vec<usize>> {
    let judged = |t: &Target| !t.relation.is_evidence() && t.rows.len() >= FEWEST_SAMPLES.0;
    let noisy = (0..context.targets.len()).filter(|k| judged(&context.targets[*k]) && context.targets[*k].noisier().is_some());
    Some(noisy.collect::<Vec<usize>>()).filter(|channels| !channels.is_empty())
}

/// Where no name and no smooth function won although a residual is large and coloured, something is there all the same: on these
/// channels.
pub(crate) fn nameless(context: &Context, declared: Declared<'_>, start: &Fit) -> Option<Vec<usize>> {
    let residuals = heldout::residuals(context, declared, start);
    let excess = |i: usize| {
        let target = &context.targets[i];
        let mut news = vec![0.0; context.len()];
        target.rows.iter().zip(&residuals[i]).for_each(|(row, v)| news[*row] = target.news(*row, *v).powi(2));
        let once = if context.against_model { best_moment(&context.t, &news) } else { 0.0 };
        (news.iter().sum::<f64>() - once) / (residuals[i].len() as f64 * target.noise.rms.powi(2))
    };
    let left_over = |i: usize| {
        let (r, target) = (&residuals[i], &context.targets[i]);
        let t: Vec<f64> = target.rows.iter().map(|row| context.t[*row]).collect();
        r.len() >= FEWEST_SAMPLES.0 && excess(i) > LEFT_OVER.0.powi(2) && whiteness(&t, r) < LEFT_OVER.1
    };
    let loud = groups(context).into_iter().filter(|g| g.iter().any(|i| left_over(*i)));
    loud.max_by(|a, b| excess(a[0]).total_cmp(&excess(b[0])))
}

/// Share of what a channel shows above its noise that the names must take away to be believed.
const NEEDED_SHARE: f64 = 0.85;

/// The same against a declared model, whose own forms are known: what is left there is the names' own, whose forms are right to a sixth.
const NEEDED_AGAINST_MODEL: f64 = 0.97;

/// Part of the rows that what is left may be in while the rest is explained, against a declared model: a form that is right for a run
/// need not be for the moment in which its rotor starts.
const FEW_ROWS: f64 = 0.02;

/// Whether the named effects are the cause of most of what they were named for: on one channel that they touch they take away
/// most of the squared residual above the noise. A part of a large residual is what any flexible term can have.
pub(crate) fn explains(context: &Context, declared: Declared<'_>, start: &Fit, fit: &Fit) -> bool {
    let scatters = |t: &Target| fit.placed.iter().any(|p| p.effect.scatters() && p.instance.touches(t.name));
    if !context.against_model && context.targets.iter().any(scatters) {
        return true;
    }
    let before = heldout::residuals(context, declared, start);
    let after = heldout::residuals(context, declared, fit);
    let touches = |name: &str| fit.placed.iter().any(|p| p.instance.touches(name));
    let enough = |i: usize, calm_only: bool| {
        let target = &context.targets[i];
        let counts = |j: &usize| !calm_only || !target.unsettled[*j];
        let news = |r: &[f64], j: usize| target.news(target.rows[j], r[j]).powi(2);
        let rows = (0..target.rows.len()).filter(counts).map(|j| (news(&before[i], j), news(&after[i], j)));
        let mut rows: Vec<(f64, f64)> = rows.collect();
        if context.against_model {
            rows.sort_by(|a, b| b.1.total_cmp(&a.1));
            rows.drain(..(FEW_ROWS * rows.len() as f64) as usize);
        }
        let n = rows.len().max(1) as f64;
        let (b, a) = rows.iter().fold((0.0, 0.0), |s, row| (s.0 + row.0 / n, s.1 + row.1 / n));
        // rounding to coarse steps cannot be taken away whole
        let rounding = quantisation::step(target).map_or(0.0, |step| step * step / 12.0);
        let floor = target.noise.rms.powi(2).max(rounding);
        let needed = if context.against_model { NEEDED_AGAINST_MODEL } else { NEEDED_SHARE };
        // between jumps only what stood out there can have been explained there
        !calm_only && (b < 1.5 * floor || a < 2.25 * floor) || b > 1.5 * floor && (b - a) > needed * (b - floor)
    };
    if context.against_model {
        // the floor of every channel is known: what the names leave of the news on any of them has another cause
        let judged = context.targets.iter().filter(|t| !t.relation.is_evidence());
        // an error of one speed sensor is told by what the others read
        let told_by = |name: &'static str| {
            let difference = DIFFERENCES.iter().find(|d| d.0 == name && touches(d.1));
            context.target(difference.map_or(name, |d| d.1))
        };
        return judged.filter(|t| !scatters(t)).filter_map(|t| told_by(t.name)).all(|i| enough(i, false));
    }
    let mut touched = context.targets.iter().enumerate().filter(|(_, t)| touches(t.name));
    touched.any(|(i, t)| enough(i, false) || !t.unsettled.is_empty() && enough(i, true))
}
