//! A log made ready for questions: consensus speed, gap-free regressors, targets, noise.
//!
//! What it is: everything that a relation may be predicted from, on every row, computed once a log.
//! What can go wrong: a regressor with gaps is bridged linearly in time; targets keep only their own samples; single-row speed
//! drop-outs are replaced in the consensus (the rule stands in `model.toml`), never in a target.
//! Units: SI, rev/min, us; regressors of the polynomials are rpm/1000 and (pulse - 1000)/1000.
//! Reference: specification `formats.md` (primary relations), `closing-the-loop.md` step 2.

use crate::log::board;
use crate::log::{Log, MODELLED};
use crate::numeric::order::usual_step;
use crate::signal::bad::{self, SetAside};
use crate::signal::consensus::{self, Consensus};
use crate::signal::noise;
use crate::signal::start;
use crate::signal::stretches::{self, CALM_US, STILL_US, bridge};
use powers::{Values, powers_of};
use std::borrow::Cow;
use std::sync::OnceLock;

mod facts;
pub(crate) mod glitches;
pub(crate) mod lattice;
pub mod powers;
mod relation;
mod states;
mod steadied;
mod target;

pub(crate) use crate::log::STANDSTILL;
#[cfg(test)]
pub(crate) use facts::Remembered;
pub(crate) use facts::{Coast, Draw, Facts, Question, Rail, SawTooth};
pub use relation::{DIFFERENCES, Relation, is_contrast, unit_of};
pub(crate) use target::NOISIER;
pub use target::Target;

/// Time after which a rotor of this size has arrived at its new speed, s: five time constants of 0.05 s.
const ARRIVED: f64 = 0.25;

/// Efficiency of ESC and motor at work: 0.65 to 0.85 for motors of this size.
const EFFICIENCY: f64 = 0.75;

/// A log made ready.
#[derive(Debug, Clone)]
pub struct Context {
    /// Name of the log.
    pub name: String,
    /// Time, s.
    pub t: Vec<f64>,
    /// Time is a row index.
    pub time_is_row: bool,
    /// Command, us, bridged over gaps.
    pub pulse: Option<Vec<f64>>,
    /// Consensus speed, rev/min, on every row; empty when no speed was measured.
    pub rpm: Vec<f64>,
    /// Standard deviation of the consensus speed beyond that of its sensors where it was bridged, rev/min; empty where it was measured throughout.
    pub rpm_sd: Vec<f64>,
    /// Rows on which no sensor read the speed while the rotor went from one to another, in order.
    pub(crate) unread: Vec<usize>,
    /// Rows for which no command is known, in order ([`start::uncommanded`]).
    pub(crate) uncommanded: Vec<usize>,
    /// Speed on the rows that tell where the motor starts, rev/min; NaN elsewhere ([`states::told`]).
    pub(crate) told: Vec<f64>,
    /// Rows before which the log did not see the rotor, in order, and its speed there, rev/min: after gaps in time.
    pub(crate) starts: Vec<(usize, f64)>,
    /// How it was made.
    pub consensus: Consensus,
    /// Samples that were set aside as bad ones: they are missing everywhere else.
    pub set_aside: Vec<SetAside>,
    /// Measured current, A, bridged.
    pub current: Option<Vec<f64>>,
    /// Measured voltage, V, bridged.
    pub voltage: Option<Vec<f64>>,
    /// Measured temperature, degC, bridged.
    pub temperature: Option<Vec<f64>>,
    /// Measured torque, N.m, bridged.
    pub torque: Option<Vec<f64>>,
    /// Further numeric columns, bridged.
    pub covariates: Vec<(String, Vec<f64>)>,
    /// Pulse at which the motor starts, us (midpoint between standing and turning).
    pub start_pulse_us: f64,
    /// Targets in the order of [`MODELLED`], then evidence channels.
    pub targets: Vec<Target>,
    /// Steady stretches as row ranges `[from, to)`.
    pub steady: Vec<(usize, usize)>,
    /// Stretches without a jump of the load, ramps included: where the noise is read off.
    pub calm: Vec<(usize, usize)>,
    /// Rows at the head of the steady stretches in which the rotor still approaches its new speed; empty without a command or a speed.
    pub(crate) settling: Vec<bool>,
    /// Command from which on the supply was at its current limit, us: rows of it are left out ([`Self::leave_out_from`]).
    pub(crate) limited_from: Option<f64>,
    /// What is sought may have set in before the run: a declared model stands as it is, and a constant departure from it is news.
    pub(crate) against_model: bool,
    /// Logarithm of the density of a declared model's air over that of ISO 2533 air at 20 degC; 0 where none is declared, and where an effect
    /// of the model speaks of the density by itself.
    pub(crate) air: f64,
    /// Torque that a declared model expects on every row, N.m, with what is known of its error: no sensor's noise is in it. Empty without one.
    pub(crate) expected_torque: Vec<f64>,
    /// Speed that it expects of the first speed channel, rev/min, likewise.
    pub(crate) expected_speed: Vec<f64>,
    /// Powers 0 to 3 of the scaled pulse above the starting pulse (0 below it), and of the scaled speed.
    powers: [OnceLock<Vec<Values>>; 2],
    /// What effects ask again and again.
    pub(crate) facts: Facts,
}

impl Context {
    /// Prepares a log, its bad samples set aside. `start_pulse_us` is taken from a model where one is given.
    #[must_use]
    pub fn new(log: &Log, start_pulse_us: Option<f64>) -> Self {
        let aside = bad::found(log);
        let mut context = Self::of_clean(&bad::without(log, &aside), start_pulse_us);
        context.leave_aside(aside);
        context
    }

    /// Leaves the rows of a log from a command on out of what hangs on a supply that holds its voltage: speed, current and the voltage itself; names
    /// these channels. A channel on which too little would be left keeps them.
    pub(crate) fn leave_out_from(&mut self, log: &Log, command_us: f64) -> Vec<&'static str> {
        let Some(pulse) = &self.pulse else { return Vec::new() };
        let counts = |row: usize| pulse[row] <= command_us - CALM_US;
        let follows = |t: &Target| matches!(t.relation, Relation::SpeedFromPulse | Relation::Current | Relation::Voltage);
        let fewer = |t: &Target| {
            let new = target::of(log, self, t.name, &counts)
                .filter(|new| new.rows.len() >= t.relation.degree() + target::FEWEST_BEYOND)?;
            Some(Target { unclaimed: glitches::unclaimed(self, &new), ..new })
        };
        let new: Vec<Option<Target>> = self.targets.iter().map(|t| follows(t).then(|| fewer(t)).flatten()).collect();
        let left_out = new.iter().flatten().map(|t| t.name).collect();
        self.targets.iter_mut().zip(new).for_each(|(target, new)| *target = new.unwrap_or_else(|| target.clone()));
        self.limited_from = Some(command_us);
        left_out
    }

    /// Remembers which samples are missing because they were bad ones.
    pub(crate) fn leave_aside(&mut self, aside: Vec<SetAside>) {
        for target in &mut self.targets {
            target.aside = aside.iter().filter(|a| a.channel == target.name && !a.recurs).flat_map(SetAside::span).collect();
            target.aside.sort_unstable();
        }
        self.set_aside = aside;
    }

    /// Prepares a log without bad samples.
    #[must_use]
    pub(crate) fn of_clean(log: &Log, start_pulse_us: Option<f64>) -> Self {
        let mut context = Self::bare(log, start_pulse_us);
        let bridged = |name: &str| log.column(name).filter(|c| c.iter().any(|v| v.is_finite())).map(|c| bridge(&log.t, c));
        context.current = bridged("current_a");
        context.voltage = bridged("voltage_v");
        context.temperature = bridged("temp_c");
        context.torque = bridged("torque_nm");
        context.covariates = log
            .columns
            .iter()
            .filter(|c| {
                let name = c.name.as_str();
                !MODELLED.contains(&name)
                    && !["pulse_us", "temp_c", "thrust_rms_n"].contains(&name)
                    && !board::is_of_marks(name)
                    && !board::is_of_the_board(name)
            })
            .filter(|c| c.values.iter().any(|v| v.is_finite()))
            .map(|c| (c.name.clone(), bridge(&log.t, &c.values)))
            .collect();
        context.targets = target::all(log, &context);
        let unclaimed: Vec<Vec<usize>> = context.targets.iter().map(|t| glitches::unclaimed(&context, t)).collect();
        context.targets.iter_mut().zip(unclaimed).for_each(|(target, rows)| target.unclaimed = rows);
        context
    }

    /// Whether a rotor whose motor is off still turns at a row.
    pub(crate) fn runs_down(&self, row: usize) -> bool {
        let off = self.pulse.as_ref().is_some_and(|p| p[row] < self.start_pulse_us);
        off && self.rpm.get(row).is_some_and(|r| *r > STANDSTILL)
    }

    /// What every declared relation needs and no more: command, consensus speed, steady stretches. No targets; see [`Context::declared`].
    #[must_use]
    pub fn bare(log: &Log, start_pulse_us: Option<f64>) -> Self {
        let pulse = log.column("pulse_us").filter(|c| c.iter().any(|v| v.is_finite())).map(|c| bridge(&log.t, c));
        let consensus::Fused { rpm, sd: rpm_sd, unread, how: consensus } = consensus::of(log);
        let steady = stretches::steady(&log.t, pulse.as_deref(), &rpm, STILL_US);
        let calm = stretches::steady(&log.t, pulse.as_deref(), &rpm, CALM_US);
        let settling = if pulse.is_some() { stretches::settling(&log.t, &rpm, &steady) } else { Vec::new() };
        let uncommanded = log.column("pulse_us").map(start::uncommanded).unwrap_or_default();
        let told = states::told(log, &rpm, &uncommanded);
        let start = start_pulse_us.unwrap_or_else(|| start::start_pulse(&log.t, pulse.as_deref(), &told));
        Self {
            name: log.name.clone(),
            t: log.t.clone(),
            time_is_row: log.time_is_row(),
            starts: if log.time_is_row() { Vec::new() } else { states::known(&log.t, &rpm, pulse.as_deref(), start, &settling) },
            pulse,
            rpm,
            rpm_sd,
            unread,
            uncommanded,
            told,
            consensus,
            set_aside: Vec::new(),
            current: None,
            voltage: None,
            temperature: None,
            torque: None,
            covariates: Vec::new(),
            start_pulse_us: start,
            targets: Vec::new(),
            steady,
            calm,
            against_model: false,
            air: 0.0,
            limited_from: None,
            settling,
            expected_torque: Vec::new(),
            expected_speed: Vec::new(),
            powers: Default::default(),
            facts: Facts::default(),
        }
    }

    /// Names of the targets that a log has, in order.
    #[must_use]
    pub fn declared_names(log: &Log) -> Vec<&'static str> {
        let modelled = MODELLED.into_iter().chain(["thrust_rms_n"]).filter(|name| log.column(name).is_some());
        modelled.chain(target::differing(log)).collect()
    }

    /// One target of a log; `None` where it has no sample or nothing to be predicted from.
    #[must_use]
    pub fn declared(&self, log: &Log, name: &'static str) -> Option<Target> {
        match DIFFERENCES.iter().find(|d| d.1 == name) {
            Some((channel, name)) => target::difference(self, name, log.column(channel)?),
            None => target::of(log, self, name, &|_| true),
        }
    }

    /// Columns of the declared polynomial of a relation, from order 0 up (at least as many as it has terms).
    #[must_use]
    pub fn powers(&self, relation: Relation) -> &[Values] {
        let kind = usize::from(relation != Relation::SpeedFromPulse);
        self.powers[kind].get_or_init(|| powers_of(self, [Relation::SpeedFromPulse, Relation::Current][kind]))
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// Whether there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// Index of a target by its channel name.
    #[must_use]
    pub fn target(&self, name: &str) -> Option<usize> {
        self.targets.iter().position(|t| t.name == name)
    }

    /// Indices of the targets with this relation.
    pub fn with_relation(&self, relation: Relation) -> impl Iterator<Item = usize> + '_ {
        self.targets.iter().enumerate().filter(move |(_, t)| t.relation == relation).map(|(i, _)| i)
    }

    /// The regressor of a relation on every row, scaled; `None` where the log lacks it.
    #[must_use]
    pub fn regressor(&self, relation: Relation) -> Option<Vec<f64>> {
        match relation {
            Relation::SpeedFromPulse => self.pulse.as_ref().map(|p| p.iter().map(|v| (v - 1000.0) / 1000.0).collect()),
            Relation::SpeedAlone | Relation::Voltage => Some(vec![0.0; self.len()]),
            _ => (!self.rpm.is_empty()).then(|| self.rpm.iter().map(|v| v / 1000.0).collect()),
        }
    }

    /// Supply current on every row, A: as measured, or, where it was not, from the shaft power at three quarters efficiency.
    /// The flag says that it was measured.
    #[must_use]
    pub fn draw(&self) -> Option<(Cow<'_, [f64]>, bool)> {
        if let Some(current) = &self.current {
            return Some((Cow::Borrowed(current), true));
        }
        let (torque, voltage) = (self.torque.as_ref()?, self.voltage.as_ref()?);
        if self.rpm.is_empty() {
            return None;
        }
        let omega = |rpm: f64| rpm * std::f64::consts::TAU / 60.0;
        let estimate = (0..self.len()).map(|i| torque[i] * omega(self.rpm[i]) / (EFFICIENCY * voltage[i].max(1.0))).collect();
        Some((Cow::Owned(estimate), false))
    }

    /// Where the noise is read off.
    fn stretches(&self) -> noise::Stretches<'_> {
        noise::Stretches { calm: &self.calm, held: &self.steady }
    }

    /// Median time step, s.
    #[must_use]
    pub fn step(&self) -> f64 {
        *self.facts.step.get_or_init(|| usual_step(&self.t))
    }

    /// Whether each row stands for a level of its own: the command jumps at most rows, and they lie farther apart than a rotor takes to
    /// arrive. What a lag, a filter or a delay does within a level is not in such a table.
    #[must_use]
    pub fn is_table(&self) -> bool {
        let Some(pulse) = self.pulse.as_ref().filter(|_| !self.time_is_row && self.step() > ARRIVED) else { return false };
        pulse.windows(2).filter(|w| (w[1] - w[0]).abs() > CALM_US).count() * 2 > pulse.len()
    }

    /// Length of the run, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.t.last().unwrap_or(&0.0) - self.t.first().unwrap_or(&0.0)
    }
}
