//! The library: one file an effect, one line each in [`library`].
//!
//! What it is: physical effects in compact form, each saying which channels it touches and how it changes their columns.
//! What can go wrong: an effect is offered only where the log has what it needs ([`Effect::instances`] is empty otherwise).
//! Units: stated on each parameter.
//! Reference: specification `closing-the-loop.md`, list of effects.

pub(crate) mod acquisition;
pub mod design;
pub(crate) mod load_cell;
pub(crate) mod operator;
pub mod placed;
pub(crate) mod reported;
pub(crate) mod rotor;
pub(crate) mod steps;
pub(crate) mod supply;
pub(crate) mod tachometer;
pub(crate) mod unknown;

use crate::channel::{Context, DIFFERENCES, Relation};
use crate::effects::design::TargetDesign;
use crate::log::SPEED;
use crate::verdict::Kin;
pub(crate) use crate::verdict::words::Clause;
pub(crate) use crate::verdict::{EffectEntry, Scope};
pub(crate) use load_cell::tare_shift::BEFORE;
pub(crate) use supply::current_limit::CurrentLimit;

/// Net evidence, nats, that an effect must bring beyond its penalty: a library of about fifty instances then raises a false
/// alarm in about one clean run of a hundred.
pub(crate) const NEEDED_EVIDENCE: f64 = 7.0;

/// Where in the causal chain an effect acts; effects are applied in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// On what goes into the relation.
    Input,
    /// On the relation itself: a factor.
    Gain,
    /// A further term.
    Term,
    /// On the reading: filter, delay.
    Output,
    /// On what the meter gives out: it holds a value that its filter has made.
    Hold,
    /// On single readings, after all that the meter does.
    Readings,
}

/// What an effect is, for reports and documentation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct About {
    /// Name of the effect in plain words.
    pub title: &'static str,
    /// Equation as it stands in verdicts.
    pub equation: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// Variables that it depends on, by column name.
    pub depends_on: &'static [&'static str],
    /// What it looks like in the residual.
    pub signature: &'static str,
    /// Effects that it is easily taken for.
    pub look_alikes: &'static [&'static str],
}

/// One way in which an effect may be present in this log: which channels it touches, in which form.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Instance {
    /// Channels, the first of which is the one that figures are quoted for.
    pub channels: Vec<String>,
    /// Form of the equation, empty where there is only one.
    pub form: String,
}

impl Instance {
    pub(crate) fn new(channels: &[&str], form: &str) -> Self {
        Self { channels: channels.iter().map(|c| (*c).to_owned()).collect(), form: form.to_owned() }
    }

    /// Whether this instance touches a channel.
    #[must_use]
    pub fn touches(&self, channel: &str) -> bool {
        self.channels.iter().any(|c| c == channel)
    }
}

/// A parameter that enters the equation non-linearly.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Name, a contract of the verdict file.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Plausible range.
    pub range: (f64, f64),
    /// Values at which the search starts.
    pub starts: Vec<f64>,
}

impl Shape {
    /// Whether it is a size, that may have either sign; an instant, an onset or a time constant is none.
    #[must_use]
    pub fn is_size(&self) -> bool {
        self.range.1 > 0.0 && self.range.0 == -self.range.1
    }

    /// Whether it is an instant of the run, by the names that all effects give one.
    #[must_use]
    pub fn is_instant(&self) -> bool {
        ["t0", "t1", "peak_time"].contains(&self.name)
    }

    /// Whether it only places something within a row: it may lie on a bound without making the effect implausible.
    #[must_use]
    pub fn is_nuisance(&self) -> bool {
        self.name == "phase"
    }
}

/// A parameter that multiplies a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Amplitude {
    /// Name, a contract of the verdict file.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
}

/// An estimated parameter as it is reported.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Value.
    pub value: f64,
    /// Standard error.
    pub se: f64,
}

/// One physical effect.
pub trait Effect: Sync {
    /// Identifier, a contract of the verdict file.
    fn id(&self) -> &'static str;
    /// What it is.
    fn about(&self) -> About;
    /// What it does here, in the words of a lab, with its size.
    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::titled(self.about().title, found)
    }
    /// Whether every rig has it (a rotor takes time): it is told apart from what this rig has.
    fn is_of_every_rig(&self) -> bool {
        false
    }
    /// Whether it only says where in its row a reading lies: every logger has that, and no meter is late by it.
    fn is_within_a_row(&self, _context: &Context, _fitted: &[Estimate]) -> bool {
        false
    }
    /// Whether every run has it, this small: a cell that is tared anew before each run.
    fn is_of_every_run(&self, _context: &Context, _instance: &Instance, _fitted: &[Estimate]) -> bool {
        false
    }
    /// Whose it is, as it was fitted.
    fn kin(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> Kin {
        match self.is_of_every_rig() || self.is_of_every_run(context, instance, fitted) {
            true => Kin::OfEvery,
            false if self.is_within_a_row(context, fitted) => Kin::WithinRow,
            false => Kin::Own,
        }
    }
    /// What it belongs to.
    fn scope(&self, instance: &Instance) -> Scope;
    /// Whether what an event left behind holds for later runs of the rig: a damaged blade does, a zero that slipped is set anew.
    fn leaves_behind(&self, _instance: &Instance) -> bool {
        false
    }
    /// Where it acts.
    fn stage(&self) -> Stage;
    /// The same for one of its forms.
    fn stage_of(&self, instance: &Instance) -> Stage {
        let _ = instance;
        self.stage()
    }
    /// The ways in which this log could hold it; none where the log lacks what it needs.
    fn instances(&self, context: &Context) -> Vec<Instance>;
    /// The ways in which several runs of one rig could hold it, each with the shapes to start from: for effects that show between runs only.
    fn among(&self, _runs: &[&Context]) -> Vec<(Instance, Vec<f64>)> {
        Vec::new()
    }
    /// The ways in which this log may hold it without being able to show it: never named, but listed with an unknown cause where
    /// they explain it (`attribution/suspects.rs`).
    fn suspects(&self, _context: &Context) -> Vec<Instance> {
        Vec::new()
    }
    /// Non-linear parameters with ranges and starts for this log.
    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape>;
    /// What is known of the shapes before any run: the logarithm of their density, nats, up to a constant. It decides where a run says
    /// nothing of a shape.
    fn prior(&self, _context: &Context, _instance: &Instance, _shape: &[f64]) -> f64 {
        0.0
    }
    /// How many of its shapes a run has to pay for: not those that are taken, nor those of which all that is known was known before.
    fn priced(&self, context: &Context, instance: &Instance) -> usize {
        self.shapes(context, instance).len()
    }
    /// Linear parameters.
    fn amplitudes(&self, instance: &Instance) -> Vec<Amplitude>;
    /// Changes the design of one target that this instance touches.
    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign);
    /// The shapes where only the rows of `keep` may teach: those that are read off the log instead of fitted are read off these.
    fn taught(&self, _context: &Context, _instance: &Instance, shape: &[f64], _keep: &[bool]) -> Vec<f64> {
        shape.to_vec()
    }
    /// Parameters as they are reported, from those that were fitted (shapes first, then amplitudes).
    fn report(&self, _context: &Context, _instance: &Instance, fitted: Vec<Estimate>) -> Vec<Estimate> {
        fitted
    }
    /// Effects that strike the same single rows of a channel, so that one of them must answer for all.
    fn never_beside(&self) -> &'static [&'static str] {
        &[]
    }
    /// Evidence, nats, that the readings themselves show, whatever the model says of them.
    fn seen(&self, _context: &Context, _instance: &Instance) -> f64 {
        0.0
    }
    /// Whether it says how a channel follows the supply's voltage: one that is said twice is followed twice.
    fn follows_supply(&self, _instance: &Instance, _channel: &str) -> bool {
        false
    }
    /// Whether it adds nothing to its channel, whose own curve over the command holds it already: what a sensor reads beside the others shows it alone.
    fn shows_beside_others_alone(&self) -> bool {
        false
    }
    /// Whether it says something of the scatter of the thrust, not only of its mean.
    fn scatters(&self) -> bool {
        false
    }
    /// Whether what it takes away, and what it adds, may go on beyond what its run has shown. What only moves a reading in time gives a channel no
    /// value that the channel does not have, however large the step.
    fn runs_on(&self, _instance: &Instance) -> [bool; 2] {
        [true, true]
    }
    /// Whether several runs have a form of their own for what it says of one.
    fn is_of_one_run(&self, _instance: &Instance) -> bool {
        false
    }
    /// Whether single rows are its nature.
    fn is_of_moments(&self, _instance: &Instance) -> bool {
        false
    }
    /// Whether [`Self::plausible`] asks for the standard errors of the shapes: they cost several fits, and are not a number where
    /// nobody asks.
    fn judges_shape_errors(&self) -> bool {
        false
    }
    /// Whether the estimate makes physical sense (a negative resistance does not).
    fn plausible(&self, _context: &Context, _instance: &Instance, _fitted: &[Estimate]) -> bool {
        true
    }
}

/// Every effect that can be named.
#[must_use]
pub fn library() -> &'static [&'static dyn Effect] {
    &[
        &supply::supply_sag::SupplySag,
        &supply::supply_voltage::SupplyVoltage,
        &supply::battery_discharge::BatteryDischarge,
        &supply::battery_relaxation::BatteryRelaxation,
        &rotor::spinup_lag::SpinupLag,
        &rotor::rotor_inertia::RotorInertia,
        &load_cell::zero_drift::ZeroDrift,
        &load_cell::thermal_zero::ThermalZero,
        &load_cell::tare_shift::TareShift,
        &load_cell::gain_change::GainChange,
        &load_cell::creep::Creep,
        &load_cell::hysteresis::Hysteresis,
        &load_cell::beam_resonance::BeamResonance,
        &acquisition::channel_filter::ChannelFilter,
        &acquisition::channel_delay::ChannelDelay,
        &rotor::blade_damage::BladeDamage,
        &rotor::bearing_friction::BearingFriction,
        &tachometer::encoder_drag::EncoderDrag,
        &rotor::blade_flex::BladeFlex,
        &rotor::reynolds_thrust::ReynoldsThrust,
        &rotor::air_density::AirDensity,
        &rotor::stall::Stall,
        &load_cell::amplifier_saturation::AmplifierSaturation,
        &supply::current_limit::CurrentLimit,
        &supply::thermal_derate::ThermalDerate,
        &load_cell::torque_crosstalk::TorqueCrosstalk,
        &acquisition::clock_drift::ClockDrift,
        &acquisition::sample_hold::SampleHold,
        &acquisition::quantisation::Quantisation,
        &acquisition::throttle_quantisation::ThrottleQuantisation,
        &acquisition::glitch_rows::GlitchRows,
        &tachometer::blade_twist::BladeTwist,
        &tachometer::coupling_slip::CouplingSlip,
        &tachometer::missed_pulses::MissedPulses,
        &tachometer::double_pulses::DoublePulses,
        &tachometer::alternating_period::AlternatingPeriod,
        &tachometer::dead_rotor_speed::DeadRotorSpeed,
    ]
}

/// The effect with this identifier, the empirical correction included.
#[must_use]
pub fn by_id(id: &str) -> Option<&'static dyn Effect> {
    if id == "unknown" {
        return Some(&unknown::Unknown);
    }
    library().iter().copied().find(|e| e.id() == id)
}

/// Channels of the log among `names`.
fn present<'a>(context: &Context, names: &[&'a str]) -> Vec<&'a str> {
    names.iter().copied().filter(|n| context.target(n).is_some()).collect()
}

/// The one instance of an effect of time on the thrust; none where there is no thrust or no time, or where each load has one time.
fn thrust_over_time(context: &Context) -> Vec<Instance> {
    if context.time_is_row || present(context, &["thrust_n"]).is_empty() || !repeats_loads(context) {
        Vec::new()
    } else {
        vec![Instance::new(&["thrust_n"], "")]
    }
}

/// Share of the highest speed within which two rows have the same load.
const SAME_LOAD: f64 = 0.01;

/// Whether most loads are seen more than once. In a sweep of one reading a level time is a function of the load, and what bends over the
/// one bends over the other.
fn repeats_loads(context: &Context) -> bool {
    let mut speeds = context.rpm.clone();
    speeds.sort_unstable_by(f64::total_cmp);
    let same = SAME_LOAD * speeds.last().copied().unwrap_or(0.0);
    let alone = |k: usize| {
        let far = |j: usize| speeds.get(j).is_none_or(|v| (v - speeds[k]).abs() > same);
        (k == 0 || far(k - 1)) && far(k + 1)
    };
    2 * (0..speeds.len()).filter(|k| alone(*k)).count() <= speeds.len()
}

/// The sets of meters that may be slow or late together: each alone, the two of the load cell, and each speed sensor beside
/// its difference from the others (alone where there are only two). A single one is told from the rotor itself by what is a
/// function of its speed: see [`every_speed`].
fn meters<'a>(context: &Context) -> Vec<Vec<&'a str>> {
    if context.time_is_row {
        return Vec::new();
    }
    let mut sets: Vec<Vec<&str>> =
        present(context, &["thrust_n", "torque_nm", "current_a", "voltage_v"]).into_iter().map(|c| vec![c]).collect();
    let both = present(context, &["thrust_n", "torque_nm"]);
    if both.len() == 2 {
        sets.push(both);
    }
    let speeds = speeds(context);
    if speeds.len() > 1 {
        for channel in speeds {
            let difference = DIFFERENCES.iter().find(|d| d.0 == channel).map(|d| d.1).filter(|d| context.target(d).is_some());
            sets.push(std::iter::once(channel).chain(difference).collect());
        }
    }
    sets
}

/// All speed channels together with all that is a function of the speed: what is slow or late in the speed is ahead in them. One alone is so, and
/// several are so together: a speed is the mean over some turns or over a while, the middle of which has passed.
fn every_speed<'a>(context: &Context) -> Option<Vec<&'a str>> {
    let functions = present(context, &["thrust_n", "torque_nm", "current_a"]);
    let read = |name: &&&str| context.consensus.channels.iter().any(|c| c == **name);
    let speeds: Vec<&str> = SPEED.iter().filter(read).copied().collect();
    let asked = !context.time_is_row && !speeds.is_empty() && !functions.is_empty();
    asked.then(|| speeds.into_iter().chain(functions).collect())
}

/// The same of one speed channel alone that the command predicts: what several have in common may be the rotor's own lag.
fn lone_speed<'a>(context: &Context) -> Option<Vec<&'a str>> {
    every_speed(context).filter(|_| speeds(context).len() == 1)
}

/// Whether an instance holds the speed channel as its meter, and this relation is a function of its reading.
fn reads_meter(instance: &Instance, relation: Relation) -> bool {
    let of_speed = matches!(relation, Relation::Thrust | Relation::Torque | Relation::Current);
    of_speed && instance.channels.iter().any(|c| c.starts_with("rpm"))
}

/// What a meter makes of its channel: every column passes through it. The difference of a speed channel from the consensus is
/// what the meter changes of the consensus.
fn through_meter(context: &Context, design: &mut TargetDesign, meter: impl Fn(&[&[f64]]) -> Vec<Vec<f64>>) {
    if design.relation != Relation::SpeedDifference {
        design.map_together(meter);
        return;
    }
    let changed = meter(&[&context.rpm]).concat();
    design.fixed.resize(context.len(), 0.0);
    design.fixed.iter_mut().zip(changed.iter().zip(&context.rpm)).for_each(|(f, (c, r))| *f += c - r);
}

/// Speed channels of the log.
pub(crate) fn speeds(context: &Context) -> Vec<&'static str> {
    context.targets.iter().filter(|t| t.relation == Relation::SpeedFromPulse).map(|t| t.name).collect()
}

/// Whether the time constant of a slow cause lies on the lower end of its range: what is as quick is another cause.
fn is_too_quick(shapes: &[Shape], fitted: &[Estimate]) -> bool {
    let least = shapes.iter().find(|s| s.name == "tau").map_or(0.0, |s| s.range.0 * 1.001);
    fitted.iter().any(|e| e.name == "tau" && e.value <= least)
}

fn geometric(from: f64, to: f64, n: usize) -> Vec<f64> {
    let (from, to) = (from.max(1e-9), to.max(from * 1.0001));
    (0..n).map(|k| from * (to / from).powf(k as f64 / (n.max(2) - 1) as f64)).collect()
}

/// Channels that feel the rotor's load: thrust where asked for, torque, current and every speed.
fn load_channels(context: &Context, with_thrust: bool) -> Vec<&'static str> {
    let names: &[&'static str] = if with_thrust { &["thrust_n", "torque_nm", "current_a"] } else { &["torque_nm", "current_a"] };
    let mut out = present(context, names);
    out.extend(speeds(context));
    out
}

/// Throttle above the starting pulse, kus, 0 below it.
fn throttle(context: &Context) -> Vec<f64> {
    context
        .pulse
        .as_ref()
        .map_or_else(|| vec![0.0; context.len()], |p| p.iter().map(|p| (p - context.start_pulse_us).max(0.0) / 1000.0).collect())
}
