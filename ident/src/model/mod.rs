//! The powerplant model, `model.toml`: declared polynomials, added effects, and how the consensus speed is made.
//!
//! What it is: complete enough to predict every measured channel of any run of the rig, by its relations or from the command.
//! What can go wrong: a file that does not say what it must is refused with its place.
//! Units: in the key of each number; polynomials in krpm (rev/min / 1000) or kus ((pulse - 1000 us) / 1000).
//! Reference: specification `formats.md`, "Powerplant model".

mod against;
pub mod course;
pub mod leftover;
pub mod simulate;

use crate::channel::{Context, Relation, Target, unit_of};
use crate::effects::design::{Label, TargetDesign, Told};
use crate::effects::placed::Placed;
use crate::effects::rotor::air_density;
use crate::effects::steps::Steps;
use crate::effects::{self, Estimate, Stage};
use crate::log::Log;
use crate::log::board;
use crate::model::course::Course;
use crate::model::leftover::Leftover;
use crate::numeric::digits;
use crate::verdict::TOLD_BY_THE_BOARD;
use toml::{Table, Value};

mod discrepancy;
pub(crate) mod ending;
mod place;
mod reach;
mod read;
mod run;
pub(crate) mod scope;
mod supply;

pub use discrepancy::beside;
pub use reach::Reach;
pub(crate) use reach::shape_errors;
pub use scope::{FittedTo, RunLevel};

/// First key of the format.
pub const FORMAT: &str = "quadrig-model 1";
/// First key of the model of a flying vehicle.
pub const OF_FLIGHT: &str = "quadrig-flight-model 1";
/// First key of the model of an inertial unit.
pub const OF_INERTIAL: &str = "quadrig-inertial 1";

/// Declared polynomial of one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Polynomial {
    /// Channel.
    pub channel: String,
    /// Coefficients from order 0 up, in the channel's unit per power of the scaled regressor.
    pub coefficients: Vec<f64>,
    /// Their standard errors.
    pub errors: Vec<f64>,
}

/// An effect in the model, with the values of its parameters.
#[derive(Debug, Clone)]
pub struct AddedEffect {
    /// The effect, its channels and form, its shapes.
    pub placed: Placed,
    /// Amplitudes in the order of [`crate::effects::Effect::amplitudes`], one list a channel.
    pub amplitudes: Vec<(String, Vec<f64>)>,
    /// What was estimated, for the reader.
    pub estimates: Vec<Estimate>,
    /// For each channel the polynomial that stands for it on another run, in the order of the declared coefficients; empty where it acts there.
    pub mean: Vec<(String, Vec<f64>)>,
    /// What its run has shown of it, channel by channel: how far it is believed beyond (`reach.rs`).
    pub reach: Vec<Reach>,
    /// Standard errors of its shapes, in their order; empty where they are not known.
    pub shape_errors: Vec<f64>,
}

/// A model.
#[derive(Debug, Clone, Default)]
pub struct Model {
    /// Log that it was identified from.
    pub source: String,
    /// The runs that it was fitted to; a model that names none stands as it is on every run.
    pub runs: Vec<FittedTo>,
    /// What belongs to each of them, where the model was fitted to several; empty where it was fitted to one.
    pub own: Vec<RunLevel>,
    /// Motor, propeller, ... as the log states them.
    pub meta: Table,
    /// Pulse at which the motor starts, us.
    pub start_pulse_us: f64,
    /// Highest pulse that its runs held, us, where they have a command: what lies above is computed, not measured.
    pub highest_pulse_us: Option<f64>,
    /// Whether its runs saw the rotor stand still: what force and torque read then is the zero of the day, and no thrust.
    pub stood: bool,
    /// Channels of the consensus speed.
    pub consensus: Vec<String>,
    /// Share of the fluctuations of their speed within a level that is the sensor's own error; it is taken off.
    pub sensor_share: f64,
    /// Declared polynomials.
    pub polynomials: Vec<Polynomial>,
    /// Added effects.
    pub effects: Vec<AddedEffect>,
    /// Density of the air over that of ISO 2533 air at 20 degC, the mean of the run that the model was identified from, where its log tells.
    pub air: Option<f64>,
    /// For each channel that follows the supply the voltage of the model's own run by load (`supply.rs`).
    pub supply: Vec<(String, Vec<(f64, f64)>)>,
    /// For each channel what the model leaves over of the run that it was identified from, where that is known.
    pub leftovers: Vec<(String, Leftover)>,
    /// What it is off by on that run while the load is on its way, row for row.
    pub course: Option<Course>,
    /// SHA-256 of the file that holds these two ([`beside`]), as the model's own file states it.
    pub beside: Option<String>,
}

/// What the effects are added to.
#[derive(Debug, Clone, Copy, Default)]
pub struct Declared<'a> {
    /// A model that stands as it is; `None` is the thesis baseline, refitted.
    pub model: Option<&'a Model>,
}

/// Why a model was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The file could not be read.
    #[error("{file}: cannot be read ({source}); expected a model of `quadrig identify` or `close-loop`: check name and folder")]
    Io {
        /// The file.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not TOML.
    #[error("{file}: {message}")]
    Syntax {
        /// The file with line and column.
        file: String,
        /// First line of what the parser says.
        message: String,
    },
    /// A key is missing or wrong.
    #[error("{file}: key {key}: {found}; expected {expected}")]
    Key {
        /// The file with line and column.
        file: String,
        /// Path of the key.
        key: String,
        /// What stands there.
        found: String,
        /// What should.
        expected: String,
    },
    /// The file beside it belongs to another model.
    #[error(
        "{model}: key discrepancy_sha256: {file} does not belong to this model (its SHA-256 is {found}); expected the whole file that was written with it: copy both together, or take that one away"
    )]
    Pair {
        /// The model's file with line and column.
        model: String,
        /// The file beside it.
        file: String,
        /// Its digest.
        found: String,
    },
}

/// The highest pulse of a log that as many rows as a level needs have reached.
fn highest_held(log: &Log) -> Option<f64> {
    let mut pulses: Vec<f64> = log.column("pulse_us")?.iter().copied().filter(|v| v.is_finite()).collect();
    pulses.sort_unstable_by(f64::total_cmp);
    pulses.get(pulses.len().saturating_sub(crate::plateau::SHORTEST)).copied()
}

/// Whether as many rows as a level needs have a rotor that stands still.
pub(crate) fn stood(context: &Context) -> bool {
    context.rpm.iter().filter(|speed| **speed == 0.0).nth(crate::plateau::SHORTEST - 1).is_some()
}

fn slug(unit: &str) -> String {
    let mut out = String::new();
    for c in unit.chars() {
        match c {
            'a'..='z' | '0'..='9' => out.push(c),
            'A'..='Z' => out.push(c.to_ascii_lowercase()),
            '/' => out.push_str("_per_"),
            _ => {}
        }
    }
    out.trim_matches('_').to_owned()
}

fn keyed(name: &str, unit: &str) -> String {
    let slug = slug(unit);
    if slug.is_empty() || slug == "1" { name.to_owned() } else { format!("{name}_{slug}") }
}

fn coefficient_key(channel: &str, order: usize) -> String {
    let unit = slug(unit_of(channel));
    let per = load_unit(channel);
    match order {
        0 => format!("c0_{unit}"),
        1 => format!("c1_{unit}_per_{per}"),
        n => format!("c{n}_{unit}_per_{per}{n}"),
    }
}

/// Keys of what is left over of a channel: scatter by class of row, and the curve's loads and errors.
fn leftover_keys(channel: &str) -> [String; 3] {
    let unit = slug(unit_of(channel));
    [format!("left_scatter_{unit}"), format!("left_at_{}", load_unit(channel)), format!("left_{unit}")]
}

/// Key of a model whose runs saw the rotor stand still.
pub(crate) const STOOD: &str = "stood";

/// Unit of the load that a channel's polynomial is of.
fn load_unit(channel: &str) -> &'static str {
    if channel.starts_with("rpm") { "kus" } else { "krpm" }
}

impl Model {
    /// A log made ready for the model: the rotor starts where the model says, and of its sensor's error as much is taken off.
    #[must_use]
    pub fn context(&self, log: &Log) -> Context {
        let mut context = Context::new(log, Some(self.start_pulse_us));
        context.steady_speed(self.sensor_share);
        context
    }

    /// The model of a log with these polynomials and no effect.
    #[must_use]
    pub fn of(context: &Context, log: &Log, polynomials: Vec<Polynomial>) -> Self {
        Self {
            source: log.name.clone(),
            meta: log.meta.iter().filter(|(k, _)| !board::is_evidence(k)).map(|(k, v)| (k.clone(), v.clone())).collect(),
            start_pulse_us: context.start_pulse_us,
            highest_pulse_us: highest_held(log),
            stood: stood(context),
            consensus: context.consensus.channels.clone(),
            sensor_share: context.consensus.sensor_share,
            polynomials,
            ..Self::default()
        }
    }

    /// The model, with the air of its own run and what it leaves over of each target of it. A declared model keeps the air of the day that
    /// its polynomials are of.
    pub(crate) fn leaving(mut self, context: &Context, left: Vec<Leftover>, course: Option<Course>) -> Self {
        if !context.against_model {
            self.air = air_density::of_run(context);
        }
        self.leftovers = context.targets.iter().map(|t| t.name.to_owned()).zip(left).collect();
        self.course = course;
        self
    }

    /// The runs that it is of, in words: each by its name.
    #[must_use]
    pub fn runs_in_words(&self) -> String {
        match &self.runs[..] {
            [] | [_] => self.source.clone(),
            [all @ .., last] => {
                let all: Vec<&str> = all.iter().map(|run| run.name.as_str()).collect();
                format!("{} and {}", all.join(", "), last.name)
            }
        }
    }

    /// Its effects that a board told (`close/marks.rs`): no prediction holds them, so no fit and no comparison of runs does.
    pub fn told_by_the_board(&self) -> impl Iterator<Item = &AddedEffect> {
        self.effects.iter().filter(|e| e.placed.instance.form == TOLD_BY_THE_BOARD)
    }

    fn placed(&self) -> Vec<Placed> {
        self.effects.iter().map(|e| e.placed.clone()).collect()
    }

    /// Prediction of one channel by its primary relation, on every row; `None` where the model does not know the channel. Speed and current
    /// follow the voltage that was measured, where the model knows that of its own run.
    #[must_use]
    pub fn predict(&self, context: &Context, channel: &'static str) -> Option<Vec<f64>> {
        let target = context.targets.iter().find(|t| t.name == channel)?;
        self.predict_at_the_supply_of(context, target).or_else(|| self.predict_at_its_own_supply(context, channel))
    }

    /// The same at the voltage of the model's own run.
    #[must_use]
    pub fn predict_at_its_own_supply(&self, context: &Context, channel: &'static str) -> Option<Vec<f64>> {
        let target = context.targets.iter().find(|t| t.name == channel)?;
        let (design, coefficients) = self.design(context, target, &self.placed())?;
        let mut out = design.predict(&coefficients, context.len());
        if let Some(excess) = self.excess(context, target, (&design, &coefficients)) {
            out.iter_mut().zip(excess).for_each(|(o, e)| *o -= e);
        }
        Some(out)
    }

    fn design(&self, context: &Context, target: &Target, placed: &[Placed]) -> Option<(TargetDesign, Vec<f64>)> {
        let polynomial = self.polynomials.iter().find(|p| p.channel == target.name)?;
        // a speed goes with the command: where none was logged nothing is said of it
        if target.relation == Relation::SpeedAlone && polynomial.coefficients.len() > 1 {
            return None;
        }
        let base =
            polynomial.coefficients.iter().enumerate().map(|(k, c)| Told { label: Label::Base(k), value: *c, stands: true });
        let of_effect = |(effect, added): (usize, &AddedEffect)| {
            let stands = !added.placed.is_tare();
            let own = added.amplitudes.iter().find(|(channel, _)| channel == target.name).map(|(_, values)| values.clone());
            let own = own.unwrap_or_default().into_iter().enumerate();
            own.map(|(amplitude, value)| Told { label: Label::Effect { effect, amplitude }, value, stands }).collect::<Vec<_>>()
        };
        let told = base.chain(self.effects.iter().enumerate().flat_map(of_effect)).collect();
        let baseline = TargetDesign::baseline(context, target.name, target.relation);
        let design = Steps::default().apply(context, placed, TargetDesign { told, ..baseline });
        let coefficients = design.coefficients(|_| true);
        Some((design, coefficients))
    }

    /// The model as the known part of a design, for `--model`: nothing of it is refitted.
    #[must_use]
    pub fn pinned(&self, context: &Context, target: &Target) -> TargetDesign {
        match self.design(context, target, &self.placed()) {
            Some((design, coefficients)) => {
                let excess = self.excess(context, target, (&design, &coefficients));
                let mut design = design.pinned(&coefficients);
                design.fixed.iter_mut().zip(excess.into_iter().flatten()).for_each(|(f, excess)| *f -= excess);
                design.fixed.iter_mut().zip(&target.known).for_each(|(f, known)| *f += known);
                design.rotor = self.rotor(context, target).into();
                design
            }
            None => TargetDesign::baseline(context, target.name, target.relation),
        }
    }

    /// The effects by which a rotor follows what drives it. One speed sensor alone may be what is late itself.
    fn rotor(&self, context: &Context, target: &Target) -> Vec<Placed> {
        let known = |c: &&'static str| self.polynomials.iter().any(|p| p.channel == **c);
        let speeds: Vec<&'static str> = effects::speeds(context).into_iter().filter(known).collect();
        let of_rotor = |p: &Placed| {
            let turns = p.stage() == Stage::Output && speeds.len() > 1 && speeds.iter().all(|c| p.instance.touches(c));
            turns && p.instance.touches(target.name) && p.effect.amplitudes(&p.instance).is_empty()
        };
        self.effects.iter().map(|e| e.placed.clone()).filter(of_rotor).collect()
    }

    /// All of it in one text, what it was off by on its own run included; as files: [`Model::files`].
    #[must_use]
    pub fn to_toml(&self) -> String {
        self.text(true, None)
    }

    /// The text of the model's file: `whole`, or with the digest of the file beside it.
    fn text(&self, whole: bool, digest: Option<&str>) -> String {
        let mut root = Table::new();
        root.insert("format".into(), FORMAT.into());
        if let Some(digest) = digest {
            root.insert(discrepancy::DIGEST.into(), digest.into());
        }
        root.insert("source".into(), self.source.clone().into());
        root.insert("start_pulse_us".into(), digits::plain(self.start_pulse_us).into());
        if let Some(pulse) = self.highest_pulse_us {
            root.insert("highest_pulse_us".into(), digits::plain(pulse).into());
        }
        if self.stood {
            root.insert(STOOD.into(), true.into());
        }
        if !self.meta.is_empty() {
            root.insert("rig".into(), Value::Table(self.meta.clone()));
        }
        if let Some(air) = self.air {
            root.insert("air_density_ratio".into(), digits::plain(air).into());
        }
        let runs = run::tables(&self.runs, &self.own);
        if !runs.is_empty() {
            root.insert("run".into(), runs.into());
        }
        let mut consensus = Table::new();
        consensus.insert(
            "rule".into(),
            "median of the channels without their drop-outs; where none reads, what the command makes of the rotor, moved to the readings around".into(),
        );
        consensus.insert("channels".into(), self.consensus.clone().into());
        if self.sensor_share > 0.0 {
            consensus.insert("sensor_share".into(), digits::plain(self.sensor_share).into());
        }
        root.insert("consensus".into(), consensus.into());
        let mut channels = Table::new();
        for p in &self.polynomials {
            let mut t = Table::new();
            let has_pulse = p.coefficients.len() > 1;
            t.insert("relation".into(), relation_text(&p.channel, has_pulse).into());
            for (k, (c, e)) in p.coefficients.iter().zip(&p.errors).enumerate() {
                t.insert(coefficient_key(&p.channel, k), digits::of_value(*c, *e).into());
                t.insert(format!("{}_se", coefficient_key(&p.channel, k)), digits::of_error(*e).into());
            }
            if let Some((_, left)) = self.leftovers.iter().find(|(channel, _)| whole && *channel == p.channel) {
                t.extend(discrepancy::channel_keys(&p.channel, left));
            }
            supply::insert(&mut t, &p.channel, &self.supply);
            channels.insert(p.channel.clone(), t.into());
        }
        root.insert("channel".into(), channels.into());
        let list: Vec<Value> = self.effects.iter().map(|e| Value::Table(e.to_table(&self.source))).collect();
        if !list.is_empty() {
            root.insert("effect".into(), list.into());
        }
        ending::framed(&format!(
            "# Powerplant model. Regressors: krpm = rpm / 1000, kus = (pulse_us - 1000) / 1000; *_se are standard errors.\n# An effect of scope rig acts on every run. One of scope run or event acts on the runs listed here; on_another_run is what is added to the\n# channel's polynomial elsewhere, and what an event left behind acts there from the start.\n# `seen` is how little and how much an effect adds to a channel on its own run: beyond that, another run gets it as far as its errors allow.\n{root}{}",
            self.course.as_ref().filter(|_| whole).map(Course::to_toml).unwrap_or_default()
        ))
    }
}

/// Where an effect's numbers are kept: `shape.<name_unit>`, `amplitude.<channel>.<name_unit>`.
impl AddedEffect {
    /// Standard error of one of its shapes or amplitudes, as its parameters have it; not a number where none of them is this one.
    fn error_of(&self, value: f64) -> f64 {
        let same = |e: &&Estimate| (e.value - value).abs() <= read::SAME_NUMBER * value.abs();
        let known = self.estimates.iter().filter(same).map(|e| e.se).filter(|se| se.is_finite() && *se > 0.0);
        // of two that are alike the one that keeps more digits
        known.fold(f64::NAN, f64::min)
    }

    fn to_table(&self, source: &str) -> Table {
        let mut t = Table::new();
        let p = &self.placed;
        t.insert("id".into(), p.effect.id().into());
        t.insert("channels".into(), p.instance.channels.clone().into());
        if !p.instance.form.is_empty() {
            t.insert("form".into(), p.instance.form.clone().into());
        }
        t.insert("equation".into(), p.effect.about().equation.into());
        t.insert("scope".into(), p.effect.scope(&p.instance).word().into());
        t.insert("run".into(), source.into());
        let written = |v: &f64| digits::of_value(*v, self.error_of(*v));
        t.insert("shape".into(), Value::Array(p.shape.iter().map(|v| written(v).into()).collect()));
        if !self.shape_errors.is_empty() {
            t.insert("shape_se".into(), self.shape_errors.iter().map(|se| digits::of_error(*se)).collect::<Vec<_>>().into());
        }
        if !self.reach.is_empty() {
            t.insert("seen".into(), Value::Table(self.reach.iter().map(Reach::to_table).collect()));
        }
        let mut amplitude = Table::new();
        let names = p.effect.amplitudes(&p.instance);
        for (channel, values) in &self.amplitudes {
            let per: Table = names
                .iter()
                .zip(values)
                .filter(|(_, v)| **v != 0.0)
                .map(|(a, v)| (keyed(a.name, a.unit), written(v).into()))
                .collect();
            if !per.is_empty() {
                amplitude.insert(channel.clone(), per.into());
            }
        }
        t.insert("amplitude".into(), amplitude.into());
        let of_channel = |(channel, mean): &(String, Vec<f64>)| {
            let coefficients =
                mean.iter().enumerate().map(|(k, c)| (coefficient_key(channel, k), digits::plain(*c).into())).collect();
            (channel.clone(), Value::Table(coefficients))
        };
        if !self.mean.is_empty() {
            t.insert("on_another_run".into(), Value::Table(self.mean.iter().map(of_channel).collect()));
        }
        let mut parameters = Table::new();
        for e in &self.estimates {
            parameters.insert(keyed(&e.name, &e.unit), digits::of_value(e.value, e.se).into());
            parameters.insert(format!("{}_se", keyed(&e.name, &e.unit)), digits::of_error(e.se).into());
        }
        t.insert("parameter".into(), parameters.into());
        t
    }
}

fn relation_text(channel: &str, has_pulse: bool) -> &'static str {
    match Relation::of(channel, has_pulse) {
        Some(Relation::SpeedFromPulse) => "rpm(pulse), cubic above start_pulse_us, 0 below",
        Some(Relation::SpeedAlone) => "constant (no command was logged)",
        Some(Relation::Voltage) => "constant",
        Some(Relation::Current) => "current(rpm), cubic in the consensus speed",
        Some(Relation::Torque) => "torque(rpm), quadratic in the consensus speed",
        Some(Relation::Thrust) => "thrust(rpm), quadratic in the consensus speed",
        Some(Relation::SpeedDifference) => "one speed channel less the consensus: a constant and its own gain",
        Some(Relation::ThrustRms) => "rms of the strain about its mean, quadratic in the consensus speed",
        None => "none",
    }
}
