//! The opponent without a name: a smooth function of one variable.
//!
//! What it is: the test of every name. Where a polynomial in one variable predicts held-out rows of a channel clearly better than what was
//! named there, those names go; and where nothing predicts a residual that is large and coloured, it says so.
//! What can go wrong: a variable that stands for the channel itself would always win; such variables are left out.
//! Units: evidence in nats.
//! Reference: discrepancy modelling, Ebers et al. 2022 (arXiv 2203.05164); specification `closing-the-loop.md`, step 7.

use crate::attribution::choose::NEEDED_REDUCTION;
use crate::attribution::evidence::{Candidate, net_gain, shares};
use crate::attribution::moment::best_moment;
use crate::attribution::round::FEWEST_SAMPLES;
use crate::channel::lattice;
use crate::channel::{Context, DIFFERENCES, Relation, Target};
use crate::effects::NEEDED_EVIDENCE;
use crate::effects::placed::Placed;
use crate::effects::unknown::{Unknown, variables};
use crate::effects::{Effect, Instance};
use crate::fit::heldout::{self, Held};
use crate::fit::{Designs, Fit, Rows};
use crate::log::MODELLED;
use crate::model::Declared;
use crate::signal::residual::whiteness;

/// Where a smooth function of one variable, without a name, predicts held-out rows clearly better, and significantly, than whatever was named
/// there: channels one by one, the speed channels as one. What was named elsewhere has no part in it. Channels that no name touches are asked
/// only where nothing is named at all.
pub(crate) fn contested(
    context: &Context,
    declared: Declared<'_>,
    start: &Fit,
    folds: &[Vec<bool>],
    before: &[Held],
    best: &Candidate,
    named: &[Held],
) -> Vec<Contested> {
    let touched =
        |group: &[usize]| group.iter().any(|k| best.fit.placed.iter().any(|p| p.instance.touches(context.targets[*k].name)));
    let asked = groups(context).into_iter().filter(|g| best.fit.placed.is_empty() || touched(g));
    let by = |group: &Vec<usize>| by_variable(context, declared, start, folds, before, best, named, group);
    asked.filter_map(|group| Some(Contested { variable: by(&group)?, group })).collect()
}

/// Channels on which a function without a name predicts better than what was named there.
pub(crate) struct Contested {
    pub(crate) group: Vec<usize>,
    /// Of which variable.
    pub(crate) variable: String,
}

/// The variable by which a group is contested.
#[allow(clippy::too_many_arguments)] // what a search stands on, what it found, and where
fn by_variable(
    context: &Context,
    declared: Declared<'_>,
    start: &Fit,
    folds: &[Vec<bool>],
    before: &[Held],
    best: &Candidate,
    named: &[Held],
    group: &[usize],
) -> Option<String> {
    let (i, target) = (group[0], &context.targets[group[0]]);
    let on_group = |f: &Fit, shares: &[f64]| -> f64 {
        group.iter().map(|k| shares[*k] * (f.targets[*k].loglik.mean - start.targets[*k].loglik.mean)).sum()
    };
    let wins = |variable: &String| {
        let fitted = correction(context, declared, start, group, variable)?;
        let shares = shares(context, [&fitted, &best.fit].into_iter());
        let candidate = Candidate { evidence: net_gain(context, &fitted, start, &shares), fit: fitted };
        let better = on_group(&candidate.fit, &shares) - on_group(&best.fit, &shares);
        if candidate.evidence < 2.0 * NEEDED_EVIDENCE || better < NEEDED_EVIDENCE {
            return None;
        }
        let held = heldout::errors_around_newest(context, declared, &candidate.fit, folds, before).with;
        let gain = (before[i].rms / held[i].rms).ln();
        let rival = (before[i].rms / named[i].rms).ln();
        // a name that depends on the same variable has found the dependence; only its form may be rough
        let placed = &best.fit.placed;
        let same =
            placed.iter().any(|p| p.instance.touches(target.name) && p.effect.about().depends_on.contains(&variable.as_str()));
        if same && best.evidence > candidate.evidence {
            return None;
        }
        let margin = if same { std::f64::consts::LN_2 } else { 0.15 };
        let clearly = gain > (1.0 / (1.0 - NEEDED_REDUCTION)).ln() && (placed.is_empty() || gain > rival + margin);
        clearly.then_some(())
    };
    variables(context).into_iter().find(|v| !is_load(context, target, v) && wins(v).is_some())
}

/// Channels that a correction without a name is tried on: each alone, and the speed channels together, which see one rotor.
pub(crate) fn groups(context: &Context) -> Vec<Vec<usize>> {
    let asked = |k: &usize| {
        let relation = context.targets[*k].relation;
        !relation.is_evidence() && relation != Relation::SpeedAlone
    };
    let (speeds, mut out): (Vec<usize>, Vec<usize>) =
        (0..context.targets.len()).filter(asked).partition(|k| context.targets[*k].relation == Relation::SpeedFromPulse);
    out.sort_unstable();
    std::iter::once(speeds).chain(out.into_iter().map(|k| vec![k])).filter(|g| !g.is_empty()).collect()
}

/// A smooth function of a variable, in one of its forms, added to the channels of a group beside what is placed already. The other channels
/// stay as they are.
pub(crate) fn correction(context: &Context, declared: Declared<'_>, base: &Fit, group: &[usize], form: &str) -> Option<Fit> {
    let names: Vec<&str> = group.iter().map(|k| context.targets[*k].name).collect();
    let instance = Instance::new(&names, form);
    let shape = Unknown.shapes(context, &instance).iter().map(|s| s.range.0).collect();
    let mut placed = base.placed.clone();
    placed.push(Placed { effect: &Unknown, instance, shape });
    let mut targets = base.targets.clone();
    let mut designs = Designs::new(context, declared, &placed);
    for k in group {
        targets[*k] = designs.fit(*k, Rows::All)?;
    }
    Some(Fit { placed, targets })
}

/// Whether a variable stands for the channel itself or for the load, which its relation holds already. (The departure of thrust from its polynomial
/// in the speed is still a question; current and voltage follow the load with their own lags.) A second meter of a channel stands for what the
/// first one does: no channel is asked over another one.
pub(crate) fn is_load(context: &Context, target: &Target, name: &str) -> bool {
    let held: &[&str] = match target.relation {
        Relation::Torque | Relation::Thrust | Relation::Current => &["pulse_us", "current_a", "voltage_v"],
        _ => &["pulse_us", "current_a", "voltage_v", "rpm"],
    };
    let second = || MODELLED.iter().any(|of| is_second_meter(context, of, name));
    held.contains(&name) || second() || twin(context, target, name)
}

/// Whether a column is a second meter of what a channel measures, such as `esc_voltage_v` beside `voltage_v`. Where both read the same the
/// quantity itself moves: one meter is no cause of the other's reading.
pub(crate) fn is_second_meter(context: &Context, channel: &str, column: &str) -> bool {
    let quantity = channel.split('_').next().unwrap_or(channel);
    let same = column.split('_').any(|word| word == quantity);
    same && column != channel && context.covariates.iter().any(|c| c.0 == column)
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

/// Whether what is left on a channel is large and coloured: something is there, named or not.
pub(crate) fn left_over(context: &Context, target: &Target, residual: &[f64]) -> bool {
    let t: Vec<f64> = target.rows.iter().map(|row| context.t[*row]).collect();
    residual.len() >= FEWEST_SAMPLES.0
        && excess(context, target, residual) > LEFT_OVER.0.powi(2)
        && whiteness(&t, residual) < LEFT_OVER.1
}

/// Mean square of what is news on a channel, in squared noise floors.
fn excess(context: &Context, target: &Target, residual: &[f64]) -> f64 {
    let mut news = vec![0.0; context.len()];
    target.rows.iter().zip(residual).for_each(|(row, v)| news[*row] = target.news(*row, *v).powi(2));
    let once = if context.against_model { best_moment(&context.t, &news) } else { 0.0 };
    (news.iter().sum::<f64>() - once) / (residual.len() as f64 * target.noise.rms.powi(2))
}

/// Share of what a channel shows above its noise that the names must take away to be believed.
const NEEDED_SHARE: f64 = 0.85;

/// The same against a declared model, whose own forms are known: what is left there is the names' own, whose forms are right to a sixth.
const NEEDED_AGAINST_MODEL: f64 = 0.97;

/// Part of the rows that what is left may be in while the rest is explained, against a declared model: a form that is right for a run
/// need not be for the moment in which its rotor starts.
const FEW_ROWS: f64 = 0.02;

/// Whether effects are the cause of most of what they were named for: those of a fit at some positions, which share channels. On one channel
/// that they touch they take away most of the squared residual above the noise; against a declared model on every one, whose floor is known.
/// A part of a large residual is what any flexible term can have.
pub(crate) fn explains(context: &Context, declared: Declared<'_>, start: &Fit, fit: &Fit, names: &[usize]) -> bool {
    let touches = |name: &str| names.iter().any(|k| fit.placed[*k].instance.touches(name));
    let scatters = |t: &Target| names.iter().map(|k| &fit.placed[*k]).any(|p| p.effect.scatters() && p.instance.touches(t.name));
    if !context.against_model && context.targets.iter().any(scatters) {
        return true;
    }
    let (before, after) = (heldout::residuals(context, declared, start), heldout::residuals(context, declared, fit));
    let enough = |i: usize, calm_only: bool| takes_most(context, &context.targets[i], (&before[i], &after[i]), calm_only);
    if context.against_model {
        let judged = context.targets.iter().filter(|t| !t.relation.is_evidence() && touches(t.name) && !scatters(t));
        return judged.filter_map(|t| told_by(context, t.name, &touches)).all(|i| enough(i, false));
    }
    let mut touched = context.targets.iter().enumerate().filter(|(_, t)| touches(t.name));
    touched.any(|(i, t)| enough(i, false) || !t.unsettled.is_empty() && enough(i, true))
}

/// Against a declared model: the channels on which the names leave news, of those that the verdict speaks of.
pub(crate) fn news_left(context: &Context, declared: Declared<'_>, start: &Fit, fit: &Fit) -> Vec<usize> {
    let touches = |name: &str| fit.placed.iter().any(|p| p.instance.touches(name));
    let scatters = |t: &Target| fit.placed.iter().any(|p| p.effect.scatters() && p.instance.touches(t.name));
    let (before, after) = (heldout::residuals(context, declared, start), heldout::residuals(context, declared, fit));
    let left = |i: &usize| {
        let t = &context.targets[*i];
        !t.relation.is_evidence()
            && !scatters(t)
            && told_by(context, t.name, &touches)
                .is_some_and(|k| !takes_most(context, &context.targets[k], (&before[k], &after[k]), false))
    };
    (0..context.targets.len()).filter(left).collect()
}

/// The target that tells of a channel: an error of one speed sensor is told by what the others read.
fn told_by(context: &Context, name: &'static str, touches: &dyn Fn(&str) -> bool) -> Option<usize> {
    let difference = DIFFERENCES.iter().find(|d| d.0 == name && touches(d.1));
    context.target(difference.map_or(name, |d| d.1))
}

/// Whether what stood out of the noise of a channel before is mostly gone after.
fn takes_most(context: &Context, target: &Target, (before, after): (&[f64], &[f64]), calm_only: bool) -> bool {
    let counts = |j: &usize| !calm_only || !target.unsettled[*j];
    let news = |r: &[f64], j: usize| target.news(target.rows[j], r[j]).powi(2);
    let rows = (0..target.rows.len()).filter(counts).map(|j| (news(before, j), news(after, j)));
    let mut rows: Vec<(f64, f64)> = rows.collect();
    if context.against_model {
        rows.sort_by(|a, b| b.1.total_cmp(&a.1));
        rows.drain(..(FEW_ROWS * rows.len() as f64) as usize);
    }
    let n = rows.len().max(1) as f64;
    let (b, a) = rows.iter().fold((0.0, 0.0), |s, row| (s.0 + row.0 / n, s.1 + row.1 / n));
    // rounding to coarse steps cannot be taken away whole
    let rounding = lattice::step(target).map_or(0.0, |step| step * step / 12.0);
    let floor = target.noise.rms.powi(2).max(rounding);
    let needed = if context.against_model { NEEDED_AGAINST_MODEL } else { NEEDED_SHARE };
    // between jumps only what stood out there can have been explained there
    !calm_only && (b < 1.5 * floor || a < 2.25 * floor) || b > 1.5 * floor && (b - a) > needed * (b - floor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Column, Log};

    #[test]
    fn a_second_meter_stands_for_the_first() {
        let wave = |k: f64| (0..200).map(|i| 10.0 + (k * f64::from(i)).sin()).collect::<Vec<f64>>();
        let columns =
            ["rpm", "torque_nm", "current_a", "voltage_v", "esc_voltage_v", "esc_current_a", "board_temp_c", "torque_raw"];
        let column = |(k, name): (usize, &&str)| Column { name: (*name).to_owned(), values: wave(0.1 + 0.037 * k as f64) };
        let columns = columns.iter().enumerate().map(column).collect();
        let t = (0..200).map(|i| 0.1 * f64::from(i)).collect();
        let context = Context::new(&Log { name: "two.csv".into(), t, columns, ..Log::default() }, None);
        let held = |channel: &str, name: &str| {
            let target = &context.targets[context.target(channel).unwrap_or_else(|| panic!("{channel}"))];
            is_load(&context, target, name)
        };
        assert!(held("voltage_v", "esc_voltage_v") && held("torque_nm", "torque_raw"), "of the channel itself");
        assert!(held("torque_nm", "esc_current_a") && held("voltage_v", "torque_raw"), "of the load");
        assert!(!held("voltage_v", "board_temp_c") && !held("current_a", "board_temp_c"));
        assert!(!is_second_meter(&context, "rpm_hall", "rpm"), "the consensus is no column of its own");
    }
}
