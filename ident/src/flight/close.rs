//! A flight's closed loop: verdict, corrected model, and what the page shows.
//!
//! What it is: the stages of the attribution on a flight, and their outcome in the words and figures of the verdict. Specific force, angular
//! acceleration, rate and field are told through the stated filter; speeds and voltage row by row, as logged.
//! What can go wrong: see [`FlightError`].
//! Units: those of the channels.
//! Reference: specification `formats.md`, "Verdict".

use super::columns::Flight;
use super::library::{FlightLibrary, Kind as Behind, OF_THE_DAY};
use super::model::{Added, Coefficient, FORMAT as MODEL_FORMAT, FlightModel};
use super::nameless::{COMMANDS, Variable};
use super::predict::{columns, is_own, over_windows, seen_by};
use super::record::Record;
use super::rows::{By, Rows, Told};
use super::{FlightError, SHORTEST_S, words};
use crate::attribution::columns::channel::rms;
use crate::attribution::columns::{
    self, Candidate, Column, Conclusion, HeldOut, Library, Owner, Placed, Problem, UNKNOWN, ask, conclude, conclude_told,
    parameters, posterior,
};
use crate::flight::effects::{Found, Told as Value};
use crate::log::Log;
use crate::signal::bad::SetAside;
use crate::signal::residual::whiteness;
use crate::verdict::{
    Alternative, BeforeAfter, Channel, Channels, EffectEntry, FORMAT, Figures, Kin, Kind, Parameter, Unexplained, Validation,
    Verdict,
};
use std::collections::BTreeMap;

/// A closed loop.
#[derive(Debug, Clone)]
pub struct Closed {
    /// The verdict.
    pub verdict: Verdict,
    /// The corrected model.
    pub model: FlightModel,
    /// Parameters of each effect of the model, as the verdict tells them.
    pub parameters: Vec<Vec<Parameter>>,
    /// The flight in its windows.
    pub flight: Flight,
    /// For each channel of the flight what the declared and the corrected model predict of its windows.
    pub predicted: Vec<[Vec<f64>; 2]>,
    /// For each channel what is left of windows that no fit saw: before, after, and without each effect of the verdict.
    pub held_out: HeldOut,
    /// What the flight can show: candidates as the first stage asked for them.
    pub asked: Vec<Shown>,
}

/// Whether a flight can show a cause.
#[derive(Debug, Clone, PartialEq)]
pub struct Shown {
    /// Its title, with its form.
    pub name: String,
    /// Share of its columns that nothing in the declared model spans.
    pub angle: f64,
    /// Signal over noise that it would have at its usual size.
    pub signal: f64,
    /// Whether that is enough to name it.
    pub enough: bool,
}

/// Residual, cause, and error before and after; against a `model` what is new since then; on `others` what the corrected model is worth.
///
/// # Errors
/// A log that cannot be used.
pub fn close(
    log: &Log,
    model: Option<&FlightModel>,
    others: &[Log],
    progress: &mut dyn FnMut(f64),
) -> Result<Closed, FlightError> {
    run(log, model, None, others, progress)
}

/// The same for somebody who knows the names: the yardstick of what not knowing them costs.
///
/// # Errors
/// As [`close`].
pub fn told(log: &Log, ids: &[&str], others: &[Log]) -> Result<Closed, FlightError> {
    run(log, None, Some(ids), others, &mut |_| {})
}

fn run(
    log: &Log,
    model: Option<&FlightModel>,
    names: Option<&[&str]>,
    others: &[Log],
    progress: &mut dyn FnMut(f64),
) -> Result<Closed, FlightError> {
    let flight = match model {
        Some(model) => seen_by(model, log)?,
        None => Flight::of(Record::of(log)?),
    };
    let seconds: f64 = flight.windows.bounds.iter().map(|(a, b)| flight.record.t[b - 1] - flight.record.t[*a]).sum();
    if seconds < SHORTEST_S {
        return Err(FlightError::Short { name: log.name.clone(), seconds });
    }
    let unfit = || FlightError::Unfit { name: log.name.clone(), seconds };
    if flight.channels.channels.is_empty() {
        return Err(unfit());
    }
    let library = match model {
        Some(model) => FlightLibrary::against(&flight, model, is_own(model, &flight)),
        None => FlightLibrary::new(&flight),
    };
    let problem = Problem { channels: &flight.channels.channels, library: &library };
    let (found, mut concluded) = match names {
        None => {
            let found = posterior(&problem, &mut |p| progress(0.8 * p)).ok_or_else(unfit)?;
            progress(0.8);
            let concluded = conclude(&problem, &found, &[]).ok_or_else(unfit)?;
            (found, concluded)
        }
        Some(ids) => {
            let found = columns::told(&problem, ids).ok_or_else(unfit)?;
            let concluded = conclude_told(&problem, &found).ok_or_else(unfit)?;
            (found, concluded)
        }
    };
    progress(0.9);
    let rows_of = |concluded: &Conclusion| {
        let whole = Whole { log, flight: &flight, library: &library, problem, concluded };
        Rows::of(&whole.told(), &whole.model(model).0)
    };
    let mut rows = rows_of(&concluded);
    // no name makes a channel worse that is told row by row either
    let mut barred = Vec::new();
    while let Some(place) = rows.makes_worse(&concluded.kept).filter(|_| names.is_none()) {
        barred.push(concluded.fit.placed[place].candidate);
        concluded = conclude(&problem, &found, &barred).ok_or_else(unfit)?;
        rows = rows_of(&concluded);
    }
    let whole = Whole { log, flight: &flight, library: &library, problem, concluded: &concluded };
    let (corrected, parameters) = whole.model(model);
    let mut verdict = whole.verdict(&rows, &parameters);
    for other in others {
        verdict.validation.push(validated(&whole.declared_model(&corrected), &corrected, other)?);
    }
    progress(1.0);
    let predicted = (0..flight.channels.channels.len()).map(|c| whole.both(c)).collect();
    let without = concluded.kept.iter().map(|k| concluded.held_out.without[k.place].clone()).collect();
    let held_out = HeldOut { without, ..concluded.held_out.clone() };
    let shown = found.asked.iter().filter(|a| a.joins.len() == 1).map(|a| Shown {
        name: words::title(&library.candidates()[a.joins[0].candidate]),
        angle: a.gain.angle,
        signal: a.gain.reach.sqrt(),
        enough: a.can_be_shown(),
    });
    let asked = shown.collect();
    Ok(Closed { verdict, model: corrected, parameters, predicted, held_out, asked, flight: flight.clone() })
}

/// Error of the declared and of the corrected model on another flight, one constant a channel apart.
fn validated(declared: &FlightModel, corrected: &FlightModel, log: &Log) -> Result<Validation, FlightError> {
    let flight = seen_by(corrected, log)?;
    let library = FlightLibrary::new(&flight);
    let of = |model: &FlightModel| over_windows(&flight, &columns(model, &library, is_own(model, &flight)));
    let (before, after) = (of(declared), of(corrected));
    let error = |c: usize, predicted: &[f64]| {
        let left: Vec<f64> = flight.channels.channels[c].y.iter().zip(predicted).map(|(y, p)| y - p).collect();
        let mean = left.iter().sum::<f64>() / left.len().max(1) as f64;
        rms(&left.iter().map(|v| v - mean).collect::<Vec<f64>>())
    };
    let channels = flight
        .channels
        .channels
        .iter()
        .enumerate()
        .map(|(c, channel)| (channel.name.clone(), BeforeAfter { before: error(c, &before[c]), after: error(c, &after[c]) }));
    Ok(Validation { run: log.name.clone(), channels: channels.collect() })
}

/// Whether a column is one whose amplitude the declared model has to find.
fn is_declared(column: &Column) -> bool {
    column.owner == Owner::Declared && !column.is_given()
}

/// Everything that the account is made of.
struct Whole<'w> {
    log: &'w Log,
    flight: &'w Flight,
    library: &'w FlightLibrary<'w>,
    problem: Problem<'w>,
    concluded: &'w Conclusion,
}

impl<'w> Whole<'w> {
    fn told(&self) -> Told<'w> {
        Told { flight: self.flight, library: self.library, problem: self.problem, concluded: self.concluded }
    }

    fn candidate(&self, placed: &Placed) -> &Candidate {
        &self.library.candidates()[placed.candidate]
    }

    /// Predictions of a channel's windows before and after.
    fn both(&self, channel: usize) -> [Vec<f64>; 2] {
        let c = self.concluded;
        [&c.declared, &c.fit].map(|f| f.predict(self.problem.channels, channel))
    }

    /// The corrected model, and the parameters of its effects as the verdict tells them.
    fn model(&self, against: Option<&FlightModel>) -> (FlightModel, Vec<Vec<Parameter>>) {
        let fit = &self.concluded.fit;
        let (values, covariance) = parameters(&self.problem, fit);
        let se = |i: usize| covariance[(i, i)].max(0.0).sqrt();
        let shapes: usize = fit.placed.iter().map(|p| p.shape.len()).sum();
        let amplitude =
            |i: usize| Coefficient { name: fit.design.columns[i].name.to_owned(), value: values[shapes + i], se: se(shapes + i) };
        let declared: Vec<Coefficient> =
            (0..fit.design.columns.len()).filter(|i| is_declared(&fit.design.columns[*i])).map(amplitude).collect();
        let mut effects = Vec::new();
        let mut told = Vec::new();
        let mut first = 0;
        for (place, placed) in fit.placed.iter().enumerate() {
            let candidate = self.candidate(placed);
            let shape =
                |k: usize| Coefficient { name: candidate.shapes[k].name.to_owned(), value: values[first + k], se: se(first + k) };
            let own: Vec<Coefficient> = (0..placed.shape.len()).map(shape).collect();
            first += placed.shape.len();
            let amplitudes: Vec<Coefficient> = fit.columns_of(place).map(amplitude).collect();
            let (scope, knots) = match &self.library.kinds[placed.candidate] {
                Behind::Effect(effect, form) => (effect.scope(form), Vec::new()),
                Behind::Nameless(n) => (n.scope(), n.knots().to_vec()),
            };
            told.push(self.parameters(placed, &own, &amplitudes, &declared));
            let (id, form) = (candidate.id.to_owned(), candidate.form.clone());
            effects.push(Added { id, form, scope, shape: own, amplitude: amplitudes, knots });
        }
        let t = &self.flight.record.t;
        let mut model = FlightModel {
            format: MODEL_FORMAT.to_owned(),
            source: self.log.name.clone(),
            span_s: [t[0], t[t.len() - 1]],
            vehicle: self.flight.record.vehicle.clone(),
            usual: self.flight.usual,
            declared,
            effect: effects,
        };
        if let Some(old) = against {
            // the columns that stood already, in the words of the model that brought them
            let of_the_day = model.declared.iter().find(|c| c.name == OF_THE_DAY).cloned();
            model.declared.clone_from(&old.declared);
            model
                .declared
                .iter_mut()
                .filter(|c| c.name == OF_THE_DAY)
                .for_each(|c| *c = of_the_day.clone().unwrap_or_else(|| c.clone()));
            model.effect.splice(0..0, old.effect.iter().cloned());
            told.splice(0..0, old.effect.iter().map(|_| Vec::new()));
        }
        (model, told)
    }

    /// The model without what was added to it now.
    fn declared_model(&self, corrected: &FlightModel) -> FlightModel {
        let fit = &self.concluded.declared;
        let columns = fit.design.columns.iter().enumerate().filter(|(_, c)| is_declared(c));
        let declared = if self.library.is_against() {
            corrected.declared.clone()
        } else {
            columns.map(|(i, c)| Coefficient { name: c.name.to_owned(), value: fit.amplitudes[i], se: 0.0 }).collect()
        };
        let new = self.concluded.fit.placed.len();
        let old = corrected.effect.len() - new;
        FlightModel { declared, effect: corrected.effect[..old].to_vec(), ..corrected.clone() }
    }

    fn parameters(
        &self,
        placed: &Placed,
        shape: &[Coefficient],
        amplitude: &[Coefficient],
        declared: &[Coefficient],
    ) -> Vec<Parameter> {
        let named = |c: &Coefficient, names: &mut dyn Iterator<Item = &'static str>| {
            (names.next().unwrap_or_default(), Value { value: c.value, se: c.se })
        };
        let fit = &self.concluded.fit;
        let place = fit.placed.iter().position(|p| p == placed).unwrap_or(0);
        match &self.library.kinds[placed.candidate] {
            Behind::Effect(effect, form) => {
                let mut names =
                    form.shapes.iter().map(|s| s.name).chain(fit.columns_of(place).map(|i| fit.design.columns[i].name));
                let own = shape.iter().chain(amplitude).map(|c| named(c, &mut names)).collect();
                let mut others = fit.design.columns.iter().map(|c| c.name);
                let others = declared.iter().map(|c| (others.next().unwrap_or_default(), c.value)).collect();
                effect.report(&Found { flight: self.flight, form, own, others })
            }
            Behind::Nameless(nameless) => nameless.parameters(amplitude),
        }
    }

    fn verdict(&self, rows: &Rows, parameters: &[Vec<Parameter>]) -> Verdict {
        let channels = self.channels(rows);
        let mut effects = self.effects(rows, parameters, parameters.len() - self.concluded.fit.placed.len());
        let unexplained = self.unexplained(&channels);
        let named = effects.iter().any(|e| e.id != UNKNOWN);
        let kind = match (named, effects.is_empty() && unexplained.is_empty()) {
            (true, _) if self.concluded.ambiguous => Kind::Ambiguous,
            (true, _) => Kind::Attributed,
            (false, true) => Kind::None,
            (false, false) => Kind::Unattributed,
        };
        if kind == Kind::Unattributed && effects.is_empty() {
            effects.push(words::no_correction(&unexplained));
        }
        let alternatives = self.concluded.alternatives.iter().map(|(terms, probability)| Alternative {
            ids: terms.iter().map(|t| self.library.candidates()[*t].id.to_owned()).collect(),
            probability: *probability,
            change: None,
        });
        let next_experiment = (kind == Kind::Ambiguous).then(|| self.next());
        let aside = self.flight.record.spikes.iter().map(|s| SetAside {
            channel: s.channel.clone(),
            row: s.row,
            rows: 1,
            t_s: self.flight.record.t[s.row],
            until_s: self.flight.record.t[s.row],
            value: s.value,
            expected: s.expected,
            recurs: false,
            silent: false,
            stuck: false,
            timeless: false,
            readings: vec![s.value],
        });
        Verdict {
            format: FORMAT,
            run: self.log.name.clone(),
            verdict: kind,
            alternatives: alternatives.collect(),
            set_aside: aside.collect(),
            guessed_floors: None,
            sensor_share: None,
            at_rest: false,
            held: false,
            left_out: Vec::new(),
            validation: Vec::new(),
            runs: Vec::new(),
            channels,
            effects,
            unexplained,
            next_experiment,
        }
    }

    fn channels(&self, rows: &Rows) -> Channels {
        let mut predicted = BTreeMap::new();
        let c = self.concluded;
        for (k, channel) in self.problem.channels.iter().enumerate() {
            let white = |of: &crate::attribution::columns::Fit| whiteness(&channel.t, &of.residual(self.problem.channels, k));
            let by_row = rows.of.iter().find(|r| r.channel == k);
            let figures = |e: crate::attribution::columns::conclude::Errors, row: Option<[f64; 2]>, whiteness_p: f64| {
                let [rms, heldout_rms] = row.unwrap_or([e.rms, e.held_out]);
                Figures { rms, heldout_rms, across_runs_rms: None, whiteness_p }
            };
            let entry = Channel {
                unit: channel.unit.to_owned(),
                noise_floor_rms: by_row.map_or(channel.floor, |r: &By| r.floor),
                before: figures(c.before[k], by_row.map(|r| r.before), white(&c.declared)),
                after: figures(c.after[k], by_row.map(|r| r.after), white(&c.fit)),
            };
            predicted.insert(channel.name.clone(), entry);
        }
        Channels { predicted, not_predicted: self.flight.channels.not_predicted.iter().cloned().collect() }
    }

    fn effects(&self, rows: &Rows, parameters: &[Vec<Parameter>], first: usize) -> Vec<EffectEntry> {
        let c = self.concluded;
        let entry = |k: &crate::attribution::columns::Kept| {
            let k = &rows.told_by_row(k);
            let placed = &c.fit.placed[k.place];
            let candidate = self.candidate(placed);
            let names: Vec<String> = k.channels.iter().map(|(ch, _)| self.problem.channels[*ch].name.clone()).collect();
            let (scope, depends_on, equation) = match &self.library.kinds[placed.candidate] {
                Behind::Effect(effect, form) => {
                    let about = effect.about();
                    let by_command = self.flight.record.speed.is_empty();
                    let variable =
                        |name: &&str| if by_command && *name == Variable::Drive.name() { COMMANDS } else { name }.to_owned();
                    (effect.scope(form), about.depends_on.iter().map(variable).collect(), about.equation.to_owned())
                }
                Behind::Nameless(n) => {
                    // its parameters are its heights
                    let told = |p: &Parameter| Value { value: p.value, se: (p.ci95[1] - p.ci95[0]) / (2.0 * 1.96) };
                    let heights: Vec<Value> = parameters[first + k.place].iter().map(told).collect();
                    (n.scope(), vec![n.depends_on()], n.equation(&heights))
                }
            };
            EffectEntry {
                kin: match &self.library.kinds[placed.candidate] {
                    Behind::Effect(effect, _) if effect.is_of_every_vehicle() => Kin::OfEvery,
                    _ => Kin::Own,
                },
                id: candidate.id.to_owned(),
                scope,
                run: None,
                channels: names,
                depends_on,
                equation,
                probability: k.probability,
                parameters: parameters[first + k.place].clone(),
                heldout_error_reduction: k.channels.first().map_or(0.0, |ch| ch.1),
                evidence: words::evidence(k, &self.library.kinds[placed.candidate], self.problem.channels),
            }
        };
        c.kept.iter().map(entry).collect()
    }

    /// What is left: loud, or above the floor and not white.
    fn unexplained(&self, channels: &Channels) -> Vec<Unexplained> {
        let c = self.concluded;
        let nameless = ask(&self.problem, &c.fit, &|_, candidate| !candidate.is_named());
        let goes_with = |channel: usize| -> Vec<String> {
            let hits =
                nameless.iter().filter(|a| a.score() > 0.0).filter_map(|a| match &self.library.kinds[a.joins[0].candidate] {
                    Behind::Nameless(n) if self.flight.channels.position(n.target) == Some(channel) => Some(n.depends_on()),
                    _ => None,
                });
            hits.take(3).collect()
        };
        let one = |k: usize| {
            let channel = &self.problem.channels[k];
            let figures = channels.get(&channel.name)?;
            let over_floor = figures.after.heldout_rms / figures.noise_floor_rms.max(f64::MIN_POSITIVE);
            let left = c.left.iter().find(|l| l.channel == k);
            // a pattern beneath the floor is none that a reader must see
            let patterned = left.is_some() && over_floor > 1.0;
            (patterned || over_floor > crate::attribution::columns::conclude::LOUD).then(|| Unexplained {
                channel: channel.name.clone(),
                over_floor,
                depends_on: goes_with(k),
                looks_like: words::looks_like(left.map_or(0.0, |l| l.memory_s)),
            })
        };
        (0..self.problem.channels.len()).filter_map(one).collect()
    }

    fn next(&self) -> crate::verdict::NextExperiment {
        let first = &self.concluded.kept[0];
        let name = |k: usize| words::name(&self.library.candidates()[k]);
        let rivals: Vec<String> = first.rivals.iter().flat_map(|r| r.0.iter().map(|k| name(*k))).take(2).collect();
        words::next(&name(self.concluded.fit.placed[first.place].candidate), &rivals, &self.flight.usual)
    }
}
