//! The loop itself: log in, verdict and corrected model out.
//!
//! What it is: `diagnose` put into the contract's words, with figures before and after, intervals and evidence.
//! What can go wrong: a log with no relation to test is refused.
//! Units: as the channels state.
//! Reference: specification `closing-the-loop.md`, steps 1 to 8.

pub mod circle;
pub mod inspect;
pub(crate) mod marks;
mod read_off;
pub(crate) mod supply_limit;
pub mod told;
pub mod watch;

use crate::attribution::conclude::{Quoted, quoted};
use crate::attribution::correction::without_correction;
use crate::attribution::diagnose::Diagnosis;
use crate::attribution::long::diagnose_any;
use crate::attribution::rivals::{Rival, UNEXPLAINED};
use crate::attribution::unexplained::{LOUD, Left, unexplained};
use crate::channel::{Context, DIFFERENCES, Relation, STANDSTILL, Target, is_contrast, unit_of};
use crate::effects::Estimate;
use crate::effects::placed::Placed;
use crate::effects::placed::is_named;
use crate::effects::reported::parameter;
use crate::effects::unknown::Words;
use crate::fit::heldout;
use crate::fit::search::refine;
use crate::fit::{Fit, Rows, anywhere_in_a_row};
use crate::identify::CloseError;
use crate::identify::is_table;
use crate::log::Log;
use crate::log::sparse;
use crate::model::Declared;
use crate::model::course;
use crate::model::leftover;
use crate::model::{FittedTo, Model};
use crate::signal::bad;
use crate::signal::residual::whiteness;
use crate::verdict::words::worth;
use crate::verdict::{
    Alternative, BeforeAfter, Change, Channel, Channels, EffectEntry, FORMAT, Figures, Kind, Validation, Verdict,
};

/// Everything that closing the loop on one log gives.
#[derive(Debug, Clone)]
pub struct Closed {
    /// The log made ready.
    pub context: Context,
    /// What the search found.
    pub diagnosis: Diagnosis,
    /// Declared model.
    pub declared: Model,
    /// Corrected model.
    pub model: Model,
    /// The contract's words.
    pub verdict: Verdict,
}

/// Closes the loop on a log. Channels with too few samples are left out, and the verdict names them.
///
/// # Errors
/// [`CloseError`] when no channel can be fitted.
pub fn close(log: &Log, model: Option<&Model>, validate: &[Log], progress: &mut dyn FnMut(f64)) -> Result<Closed, CloseError> {
    let whole = log;
    let left_out = sparse::left_out(log);
    let log = &*sparse::without(log, &left_out);
    let aside = bad::found(log);
    let log = &*bad::without(log, &aside);
    let mut context = Context::of_clean(log, model.map(|m| m.start_pulse_us));
    context.leave_aside(aside);
    context.steady_speed(model.map_or_else(|| context.sensor_share(), |m| m.sensor_share));
    let model = model.map(|m| m.on(whole));
    let declared = Declared { model: model.as_deref() };
    let limit = if model.is_none() { supply_limit::found(log, &context) } else { None };
    let at_limit = limit.as_ref().map(|limit| context.leave_out_from(log, limit.begins_us())).unwrap_or_default();
    context.against(declared);
    let refused = || CloseError::NoRelation { run: log.name.clone() };
    if !context.targets.iter().any(|t| t.relation.degree() > 0 && t.rows.len() > sparse::TOO_FEW) {
        return Err(refused());
    }
    let found = diagnose_any(log, &context, declared, progress).ok_or_else(refused)?;
    let mut diagnosis = found.diagnosis;
    let marks = marks::told(log, &context, declared);
    let channels = channels(&context, declared, &diagnosis);
    let left_over = unexplained(&context, declared, &diagnosis.best.fit, &channels);
    if diagnosis.best.fit.placed.is_empty() && marks.is_empty() {
        tell_of(&context, &left_over, &mut diagnosis);
    }
    let fit = &diagnosis.best.fit;
    let estimates = found.estimates.unwrap_or_else(|| diagnosis.estimates.clone());
    let estimates: Vec<Vec<Estimate>> = (0..fit.placed.len()).map(|k| estimates.get(k).cloned().unwrap_or_default()).collect();
    let runs = vec![FittedTo::of(whole)];
    let left = |model: Model, fit: &Fit| {
        let residuals = heldout::residuals(&context, declared, fit);
        Model { runs: runs.clone(), ..model }.leaving(
            &context,
            leftover::of(&context, &residuals),
            course::of(&context, &residuals),
        )
    };
    let before_model = left(Model::from_fit(&context, log, declared, &diagnosis.declared), &diagnosis.declared);
    // the declared relations take the speed as it was read
    let before_model = Model { sensor_share: model.as_ref().map_or(0.0, |m| m.sensor_share), ..before_model };
    let after_model = Model::of_estimates(&context, log, declared, fit, estimates.clone()).believing(&diagnosis.inclusion);
    let mut after_model = left(after_model, fit).supplied_by(&context);
    let mut verdict = Verdict {
        format: FORMAT,
        run: log.name.clone(),
        verdict: kind(&diagnosis),
        channels,
        effects: entries(&context, &diagnosis, estimates),
        unexplained: left_over.into_iter().map(|l| l.told).collect(),
        alternatives: Vec::new(),
        next_experiment: None,
        left_out,
        set_aside: context.set_aside.clone(),
        at_rest: never_turned(&context),
        held: never_moved(&context),
        sensor_share: Some(context.consensus.sensor_share).filter(|share| *share > 0.0),
        guessed_floors: is_table(&context, log).then(|| log.len()),
        validation: validate.iter().map(|other| validation(other, &before_model, &after_model)).collect(),
        runs: Vec::new(),
    };
    verdict.alternatives = alternatives(&diagnosis, &verdict.effects);
    marks::tell(&mut verdict, &mut after_model, &marks);
    read_off::tell(&mut verdict, &context);
    if let Some(limit) = &limit {
        supply_limit::tell(&mut verdict, limit, &supply_limit::missed(log, &context, &before_model, &at_limit));
    }
    if verdict.verdict == Kind::Ambiguous {
        verdict.next_experiment =
            crate::experiment::next(found.searched.as_ref().unwrap_or(&context), declared, &after_model, &diagnosis);
    }
    Ok(Closed { context, diagnosis, declared: before_model, model: after_model, verdict })
}

/// Whether the motor stood throughout, by its speed, or by its command where no speed was measured.
fn never_turned(context: &Context) -> bool {
    let turns = context.rpm.iter().any(|rpm| *rpm > STANDSTILL);
    let driven = context.pulse.as_ref().is_some_and(|p| p.iter().any(|p| *p > context.start_pulse_us));
    if context.rpm.is_empty() { context.pulse.is_some() && !driven } else { !turns }
}

/// Widest span of a command that stays where it is, us: a converter's rounding.
const ROUNDING_US: f64 = 1.0;

/// Whether the command stayed where it was throughout, with the motor on.
fn never_moved(context: &Context) -> bool {
    let Some(pulse) = context.pulse.as_ref().filter(|_| !never_turned(context)) else { return false };
    let known = || pulse.iter().copied().filter(|p| p.is_finite());
    known().next().is_some() && known().fold(f64::MIN, f64::max) - known().fold(f64::MAX, f64::min) <= ROUNDING_US
}

/// Where nothing stands and something loud is left all the same, on a channel or on what one speed sensor reads beyond the others, it is told.
/// What a declared model was off by on its own day is no news.
fn tell_of(context: &Context, left: &[Left], diagnosis: &mut Diagnosis) {
    let of_contrast = |name: &str| DIFFERENCES.iter().find(|d| d.1 == name).and_then(|d| context.target(d.0));
    let is_news = |l: &&Left| {
        let (held, floor) = (diagnosis.heldout_after[l.target], context.targets[l.target].noise.rms);
        l.told.over_floor > LOUD && (!context.against_model || held.rms > LOUD * floor)
    };
    let loudest = left.iter().filter(is_news).max_by(|a, b| a.told.over_floor.total_cmp(&b.told.over_floor));
    if let Some(loudest) = loudest {
        let channel = of_contrast(context.targets[loudest.target].name).unwrap_or(loudest.target);
        diagnosis.best.fit = without_correction(context, &diagnosis.best.fit, &[channel]);
        diagnosis.heldout_without.push(diagnosis.heldout_after.clone());
        diagnosis.inclusion.push(UNEXPLAINED);
        (diagnosis.unknown, diagnosis.probability) = (true, UNEXPLAINED);
    }
}

fn kind(diagnosis: &Diagnosis) -> Kind {
    if diagnosis.best.fit.placed.is_empty() {
        Kind::None
    } else if diagnosis.unknown {
        Kind::Unattributed
    } else if diagnosis.ambiguous() {
        Kind::Ambiguous
    } else {
        Kind::Attributed
    }
}

fn channels(context: &Context, declared: Declared<'_>, d: &Diagnosis) -> Channels {
    let figures = |fit: &Fit, held: &[heldout::Held]| -> Vec<Figures> {
        heldout::residuals(context, declared, fit)
            .iter()
            .zip(held)
            .zip(&context.targets)
            .enumerate()
            .map(|(i, ((r, held), target))| {
                let judged = |k: &usize| target.claims(target.rows[*k]);
                let r: Vec<f64> = (0..r.len()).filter(judged).map(|k| target.as_it_stands(target.rows[k], r[k])).collect();
                let t: Vec<f64> = target.rows.iter().filter(|i| target.claims(**i)).map(|i| context.t[*i]).collect();
                let rms = (r.iter().map(|v| v * v).sum::<f64>() / r.len().max(1) as f64).sqrt();
                let is_known = held.claimed.is_finite() || target.relation.is_evidence();
                let heldout_rms = if is_known { held.claimed } else { of_its_own(context, declared, fit, i) };
                Figures { rms, heldout_rms, across_runs_rms: None, whiteness_p: whiteness(&t, &r) }
            })
            .collect()
    };
    let (before, after) = (figures(&d.declared, &d.heldout_before), figures(&d.best.fit, &d.heldout_after));
    let mut out = Channels::default();
    for (t, (before, after)) in
        context.targets.iter().zip(before.into_iter().zip(after)).filter(|(t, _)| !t.relation.is_evidence())
    {
        if t.relation == Relation::SpeedAlone {
            out.not_predicted.insert(t.name.to_owned(), NO_COMMAND.to_owned());
        } else {
            let unit = unit_of(t.name).to_owned();
            out.predicted.insert(t.name.to_owned(), Channel { unit, noise_floor_rms: t.noise.rms, before, after });
        }
    }
    out
}

/// Why a speed has no prediction.
pub(crate) const NO_COMMAND: &str = "no command was logged";

/// Held-out error of a channel that was measured in one of the five blocks of the run only, so that no fold predicts it: its own time is
/// cut into five. Not a number where even that leaves too little; what the fit saw never stands in its place.
fn of_its_own(context: &Context, declared: Declared<'_>, fit: &Fit, i: usize) -> f64 {
    let target = &context.targets[i];
    let (Some(first), Some(last)) = (target.rows.first(), target.rows.last()) else { return f64::NAN };
    let (from, span) = (context.t[*first], (context.t[*last] - context.t[*first]).max(1e-9));
    let block = |t: f64| ((t - from) / span * 5.0).floor().clamp(0.0, 4.0);
    let folds: Vec<Vec<bool>> = (0..5).map(|k| context.t.iter().map(|t| block(*t) == f64::from(k)).collect()).collect();
    let wanted: Vec<bool> = (0..context.targets.len()).map(|k| k == i).collect();
    let shapes = |keep: &[bool]| refine(context, declared, &fit.placed, Rows::Where(keep), heldout::EVALUATIONS);
    heldout::pooled(context, declared, &folds, &wanted, fit, &shapes)[i].map_or(f64::NAN, |held| held.claimed)
}

/// One entry an effect, the one that helps most first, what has no name last.
fn entries(context: &Context, d: &Diagnosis, estimates: Vec<Vec<Estimate>>) -> Vec<EffectEntry> {
    let mut out: Vec<(f64, EffectEntry)> = d
        .best
        .fit
        .placed
        .iter()
        .zip(estimates)
        .enumerate()
        .map(|(k, (p, estimates))| {
            let estimates = anywhere_in_a_row(context, p.effect.report(context, &p.instance, estimates));
            let shapes = p.effect.shapes(context, &p.instance);
            let Quoted { channel: first, of_news, reduction } = quoted(context, p, &d.heldout_after, &d.heldout_without[k]);
            let mut channels: Vec<String> = p.instance.channels.iter().filter(|c| !is_contrast(c)).cloned().collect();
            if let Some(at) = channels.iter().position(|c| *c == first) {
                channels.swap(0, at);
            }
            let Words { depends_on, equation, mut evidence } = words(p, &first, reduction);
            if let Some((target, times)) = noisier(context, p) {
                evidence =
                    format!("{} scatters {times:.1} times as much as on the day of the declared model; {evidence}", target.name);
            }
            let entry = EffectEntry {
                kin: p.effect.kin(context, &p.instance, &estimates),
                id: p.effect.id().to_owned(),
                scope: p.effect.scope(&p.instance),
                run: None,
                depends_on,
                equation,
                probability: d.inclusion[k],
                parameters: estimates.iter().map(|e| parameter(e, &shapes, &first)).collect(),
                heldout_error_reduction: reduction,
                evidence,
                channels,
            };
            (of_news, entry)
        })
        .collect();
    let nameless = |e: &EffectEntry| e.id == "unknown";
    out.sort_by(|a, b| nameless(&a.1).cmp(&nameless(&b.1)).then(b.0.total_cmp(&a.0)));
    out.into_iter().map(|(_, entry)| entry).collect()
}

/// The other hypotheses; of one that differs from the best in one place what it changes there.
fn alternatives(d: &Diagnosis, effects: &[EffectEntry]) -> Vec<Alternative> {
    let placed = d.best.fit.placed.iter().zip(&d.inclusion);
    let named: Vec<(&Placed, f64)> = placed.filter(|(p, _)| is_named(p)).map(|(p, inclusion)| (p, *inclusion)).collect();
    let of = |r: &Rival| Alternative {
        ids: r.ids.clone(),
        probability: r.probability,
        change: change(&named, r, d.probability, effects),
    };
    d.rivals.iter().map(of).collect()
}

/// What a hypothesis changes in one place of the best one, which has such names, each with its probability, and the probability `whole`.
fn change(named: &[(&Placed, f64)], rival: &Rival, whole: f64, effects: &[EffectEntry]) -> Option<Change> {
    if rival.ids.len() != named.len() {
        return None;
    }
    let mut differing = (0..named.len()).filter(|k| rival.ids[*k] != named[*k].0.effect.id());
    let (Some(k), None) = (differing.next(), differing.next()) else { return None };
    let (own, probability) = named[k];
    let instead = rival.fit.placed.iter().rev().find(|p| p.effect.id() == rival.ids[k])?;
    // that of the whole hypothesis is the product over its names; in the place of one of them the others count no more
    let in_its_place = (rival.probability * probability / whole.max(f64::MIN_POSITIVE)).min(1.0 - probability);
    Some(Change {
        place: effects.iter().position(|e| own.is_told_by(e))?,
        id: rival.ids[k].clone(),
        channels: instead.instance.channels.iter().filter(|c| !is_contrast(c)).cloned().collect(),
        probability: in_its_place,
    })
}

/// The channel of an unexplained dependence that has grown noisier by most, and by how much.
fn noisier<'c>(context: &'c Context, placed: &Placed) -> Option<(&'c Target, f64)> {
    let touched = context.targets.iter().filter(|t| placed.effect.id() == "unknown" && placed.instance.touches(t.name));
    touched.filter_map(|t| Some((t, t.noisier()?))).max_by(|a, b| a.1.total_cmp(&b.1))
}

/// What is said of an effect that removes such a share of the held-out error of its first channel.
fn words(placed: &Placed, first: &str, reduction: f64) -> Words {
    let (about, form) = (placed.effect.about(), &placed.instance.form);
    if placed.effect.id() == "unknown" {
        return Words::of(form, first, 1.0 - reduction);
    }
    Words {
        depends_on: about.depends_on.iter().map(|v| (*v).to_owned()).collect(),
        equation: if form.is_empty() { about.equation.to_owned() } else { format!("{} [{form}]", about.equation) },
        evidence: format!("{}{}", about.signature, worth(first, reduction)),
    }
}

/// Both models on another run of the same rig, as far as they carry over.
#[must_use]
pub fn validation(other: &Log, before: &Model, after: &Model) -> Validation {
    let (before, after) = (&*before.on(other), &*after.on(other));
    let [as_read, context] = [before, after].map(|model| model.context(other));
    let error = |model: &Model, context: &Context, name: &'static str| -> Option<f64> {
        let prediction = model.predict(context, name)?;
        let target = &context.targets[context.target(name)?];
        let judged = target.rows.iter().zip(&target.y).filter(|(i, _)| target.claims(**i));
        let (sum, n) = judged.fold((0.0, 0.0), |(s, n), (i, y)| (s + (y - prediction[*i]).powi(2), n + 1.0));
        Some((sum / n).sqrt())
    };
    let channels = context
        .targets
        .iter()
        .filter(|t| !t.relation.is_evidence())
        .filter_map(|t| {
            let (before, after) = (error(before, &as_read, t.name)?, error(after, &context, t.name)?);
            Some((t.name.to_owned(), BeforeAfter { before, after }))
        })
        .collect();
    Validation { run: other.name.clone(), channels }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Shape;
    use crate::effects::{self, Instance};
    use crate::log::Column;

    #[test]
    fn an_unknown_error_is_no_sharp_value() {
        let shapes = [Shape { name: "tau", unit: "s", range: (0.5, 9.0), starts: vec![1.0] }];
        let of = |name: &str, value: f64, se: f64| {
            parameter(&Estimate { name: name.to_owned(), unit: "s".to_owned(), value, se }, &shapes, "").ci95
        };
        assert_eq!(of("tau", 1.0, 1.0), [0.0, 2.96], "no time constant is below zero");
        for unknown in [f64::NAN, f64::INFINITY] {
            assert_eq!(of("tau", 2.0, unknown), [0.5, 9.0]);
            assert_eq!(of("rate", -2.0, unknown), [-4.0, 0.0]);
        }
        assert_eq!(of("tau", 2.0, 1.0), [2.0 - 1.96, 2.0 + 1.96]);
    }

    #[test]
    fn what_takes_nothing_away_is_not_told_as_support() {
        let instance = Instance::new(&["thrust_n"], "");
        let effect = effects::by_id("quantisation").expect("in the library");
        let placed = Placed { effect, instance, shape: vec![0.01] };
        let said = |reduction: f64| words(&placed, "thrust_n", reduction).evidence;
        assert!(said(0.5).ends_with("without it the held-out error of thrust_n is 2.00 times as large"), "{}", said(0.5));
        for none in [0.0, -0.1] {
            assert!(said(none).ends_with("the held-out error of thrust_n is no smaller with it"), "{}", said(none));
        }
    }

    /// A torque meter that was switched on for the last tenth of a run: on five levels, the last of them with an error that a fit which
    /// sees it takes away.
    #[test]
    fn what_the_fit_saw_is_never_called_held_out() {
        let t: Vec<f64> = (0..1000).map(|i| 0.1 * f64::from(i)).collect();
        let pulse: Vec<f64> = (0..1000).map(|i| 1100.0 + 20.0 * f64::from(i % 500 / 20)).collect();
        let wave = |i: usize, k: f64| (k * (i * i) as f64).sin();
        let rpm: Vec<f64> = pulse.iter().enumerate().map(|(i, p)| 7.0 * (p - 1000.0) + 4.0 * wave(i, 0.7)).collect();
        let thrust = rpm.iter().enumerate().map(|(i, r)| 1e-7 * r * r + 0.01 * wave(i, 1.3)).collect();
        let torque = |(i, r): (usize, &f64)| if i < 900 { f64::NAN } else { 2e-9 * r * r + 1e-4 * wave(i, 2.9) };
        let torque = rpm.iter().enumerate().map(torque).collect();
        let columns = [("pulse_us", pulse), ("rpm", rpm), ("thrust_n", thrust), ("torque_nm", torque)];
        let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
        let log = Log { name: "late.csv".to_owned(), t, columns, ..Log::default() };
        let closed = close(&log, None, &[], &mut |_| {}).expect("a log");
        let torque = &closed.verdict.channels["torque_nm"];
        for figures in [torque.before, torque.after] {
            let (held, seen) = (figures.heldout_rms, figures.rms);
            assert!(held.is_finite() && held > 1.001 * seen && held < 3.0 * seen, "{held} held out, {seen} seen");
        }
    }

    #[test]
    fn a_motor_that_never_turned_is_told() {
        let t: Vec<f64> = (0..400).map(|i| 0.1 * f64::from(i)).collect();
        let wave = |k: f64| (0..400).map(|i| 0.01 * (k * f64::from(i * i)).sin()).collect::<Vec<f64>>();
        let run = |rpm: f64| {
            let speeds: Vec<f64> = (0..400).map(|i| rpm * f64::from(i / 40)).collect();
            let pulses: Vec<f64> = speeds.iter().map(|v| 1000.0 + v / 7.0).collect();
            let columns = [("pulse_us", pulses), ("rpm", speeds), ("thrust_n", wave(0.7)), ("current_a", wave(1.3))];
            let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
            Log { name: "rest.csv".to_owned(), t: t.clone(), columns, ..Log::default() }
        };
        let at_rest = |rpm: f64| close(&run(rpm), None, &[], &mut |_| {}).expect("a log").verdict.at_rest;
        assert!(at_rest(0.0) && !at_rest(500.0));
    }

    /// A command that stays where it is shows nothing of what follows it; one that moves does.
    #[test]
    fn a_command_that_never_moved_is_told() {
        let t: Vec<f64> = (0..400).map(|i| 0.1 * f64::from(i)).collect();
        let wave = |at: f64, k: f64| (0..400).map(|i| at + 0.01 * (k * f64::from(i * i)).sin()).collect::<Vec<f64>>();
        let run = |step: f64, rpm: f64| {
            let pulses = (0..400).map(|i| 1500.0 + step * f64::from(i / 40)).collect();
            let speeds = (0..400).map(|i| rpm * (1.0 + 0.002 * step * f64::from(i / 40))).collect();
            let columns = [("pulse_us", pulses), ("rpm", speeds), ("thrust_n", wave(1.5, 0.7)), ("current_a", wave(2.0, 1.3))];
            let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
            Log { name: "held.csv".to_owned(), t: t.clone(), columns, ..Log::default() }
        };
        let told = |step: f64, rpm: f64| close(&run(step, rpm), None, &[], &mut |_| {}).expect("a log").verdict;
        let [held, moved, rest] = [told(0.0, 3000.0), told(40.0, 3000.0), told(0.0, 0.0)];
        assert!(held.held && !held.at_rest && !moved.held && !rest.held && rest.at_rest);
    }
}
