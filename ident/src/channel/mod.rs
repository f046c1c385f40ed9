//! A log made ready for questions: consensus speed, gap-free regressors, targets, noise.
//!
//! What it is: everything that a relation may be predicted from, on every row, computed once a log.
//! What can go wrong: a regressor with gaps is bridged linearly in time; targets keep only their own samples; single-row speed
//! drop-outs are replaced in the consensus (the rule stands in `model.toml`), never in a target.
//! Units: SI, rev/min, us; regressors of the polynomials are rpm/1000 and (pulse - 1000)/1000.
//! Reference: specification `formats.md` (primary relations), `closing-the-loop.md` step 2.

use crate::log::board;
use crate::log::{Log, MODELLED, SPEED};
use crate::numeric::order::median;
use crate::numeric::solve::Normal;
use crate::signal::bad::{self, SetAside};
use crate::signal::consensus::{self, Consensus};
use crate::signal::noise::{self, Noise};
use crate::signal::start::start_pulse;
use crate::signal::stretches::{self, CALM_US, FEWEST_OF_A_KIND, STILL_US, bridge};
use powers::{Values, powers_of};
use std::borrow::Cow;
use std::sync::OnceLock;

mod facts;
pub(crate) mod glitches;
pub(crate) mod lattice;
pub mod powers;

#[cfg(test)]
pub(crate) use facts::Remembered;
pub(crate) use facts::{Draw, Facts, Question, Rail, SawTooth};

/// Time after which a rotor of this size has arrived at its new speed, s: five time constants of 0.05 s.
const ARRIVED: f64 = 0.25;

/// Efficiency of ESC and motor at work: 0.65 to 0.85 for motors of this size.
const EFFICIENCY: f64 = 0.75;

/// What a target channel is predicted from, and by which polynomial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Relation {
    /// rpm from pulse: cubic above the starting pulse, 0 below.
    SpeedFromPulse,
    /// rpm without a command: its own mean (nothing to predict it from).
    SpeedAlone,
    /// voltage: a constant.
    Voltage,
    /// torque from rpm: quadratic.
    Torque,
    /// current from rpm: cubic.
    Current,
    /// thrust from rpm: quadratic.
    Thrust,
    /// rms of the strain from rpm: quadratic. Evidence only; no verdict speaks of it.
    ThrustRms,
    /// one speed channel less the consensus of at least three: a constant and the sensor's own gain (see [`GAIN_SD`]). Evidence only; no
    /// verdict speaks of it.
    SpeedDifference,
}

/// Standard deviation of the gain that a healthy speed sensor has of its own: 0.3 % (specification `closing-the-loop.md`, step 2).
const GAIN_SD: f64 = 0.003;
/// Largest such gain: three standard deviations.
const MOST_GAIN: f64 = 3.0 * GAIN_SD;

impl Relation {
    /// What is known before any run of the coefficient of a power of the regressor: its standard deviation about zero, and the most that it can
    /// be; `None` where nothing is. What a sensor reads beyond that is no gain of its own.
    #[must_use]
    pub fn known(self, power: usize) -> Option<(f64, f64)> {
        // a gain is a share, its coefficient is of krpm
        (self == Self::SpeedDifference && power == 1).then_some((1000.0 * GAIN_SD, 1000.0 * MOST_GAIN))
    }

    /// Degree of the declared polynomial.
    #[must_use]
    pub fn degree(self) -> usize {
        match self {
            Self::SpeedFromPulse | Self::Current => 3,
            Self::SpeedAlone | Self::Voltage => 0,
            Self::SpeedDifference => 1,
            Self::Torque | Self::Thrust | Self::ThrustRms => 2,
        }
    }

    /// The relation of a channel.
    #[must_use]
    pub fn of(channel: &str, has_pulse: bool) -> Option<Self> {
        Some(match channel {
            c if SPEED.contains(&c) && has_pulse => Self::SpeedFromPulse,
            c if SPEED.contains(&c) => Self::SpeedAlone,
            "voltage_v" => Self::Voltage,
            "torque_nm" => Self::Torque,
            "current_a" => Self::Current,
            "thrust_n" => Self::Thrust,
            "thrust_rms_n" => Self::ThrustRms,
            c if is_contrast(c) => Self::SpeedDifference,
            _ => return None,
        })
    }

    /// Whether the relation only bears witness: no verdict speaks of it.
    #[must_use]
    pub fn is_evidence(self) -> bool {
        matches!(self, Self::ThrustRms | Self::SpeedDifference)
    }
}

/// Speed channels and the names of their differences from the consensus.
pub const DIFFERENCES: [(&str, &str); 4] = [
    ("rpm_beam", "rpm_beam_difference"),
    ("rpm_opto", "rpm_opto_difference"),
    ("rpm_hall", "rpm_hall_difference"),
    ("rpm_encoder", "rpm_encoder_difference"),
];

/// Whether a channel is what one speed sensor reads beyond the others.
#[must_use]
pub fn is_contrast(channel: &str) -> bool {
    DIFFERENCES.iter().any(|d| d.1 == channel)
}

/// Unit of a modelled channel.
#[must_use]
pub fn unit_of(channel: &str) -> &'static str {
    match channel {
        c if c.starts_with("rpm") => "rev/min",
        "thrust_n" | "thrust_rms_n" => "N",
        "torque_nm" => "N.m",
        "current_a" => "A",
        "voltage_v" => "V",
        "temp_c" => "degC",
        "t_s" => "s",
        "pulse_us" => "us",
        "accx_g" | "accy_g" | "accz_g" | "vibration_g" | "vibration_a_g" => "g",
        _ => "",
    }
}

/// One measured channel as a target.
#[derive(Debug, Clone)]
pub struct Target {
    /// Column name.
    pub name: &'static str,
    /// What it is predicted from.
    pub relation: Relation,
    /// Rows that hold a sample.
    pub rows: Vec<usize>,
    /// The samples, one for each of `rows`.
    pub y: Vec<f64>,
    /// Noise as the data show it inside steady stretches.
    pub noise: Noise,
    /// Share of this target in a joint likelihood: four speed channels see one rotor.
    pub weight: f64,
    /// For each sample its variance for the weights of the least squares (see [`Noise::weight_variance`]).
    pub levelled: Vec<f64>,
    /// For each sample its variance in the likelihood of the scatter.
    pub floored: Vec<f64>,
    /// Rows about which no prediction makes a claim, in order: the channel's glitches. The log alone decides which.
    pub unclaimed: Vec<usize>,
    /// Rows whose samples were set aside as bad ones (see [`crate::signal::bad`]), in order.
    pub aside: Vec<usize>,
    /// Rows at which a speed is taken as it was read, in order: of a rotor that is told to turn and does not yet. They are no samples here: what is
    /// given is not predicted.
    pub given: Vec<usize>,
    /// Error that a declared model is known to make, on every row of the log; empty without one.
    pub known: Vec<f64>,
    /// Share of the noise in the scatter that it is known to leave about that, on every row of the log; empty without one.
    pub trust: Vec<f64>,
    /// Root mean square about the curve where the load was held on the day of a declared model; 0 without one.
    pub usual: f64,
    /// For each sample whether the load has just jumped; empty where too few have, or too few have not, to tell the two apart.
    pub unsettled: Vec<bool>,
}

/// Share of the mean variance in the weights of the least squares: a stretch with little noise must not outvote the others
/// where a polynomial misfits.
const LEVELLED: f64 = 0.5;
/// Share of the mean variance in the likelihood: enough to keep a standing rotor's silence from counting without bound.
const FLOORED: f64 = 0.05;

/// Times what a channel scattered on the day of a declared model from which on it is noisier than days differ: 2.6 times is seen where gusts
/// are taken for noise on one day and for the rotor's way on another.
const NOISIER: f64 = 4.0;

/// Samples beyond the degree of a polynomial that a fit needs: one for the constant, three to tell its noise.
const FEWEST_BEYOND: usize = 4;
/// Below this speed, rev/min, a rotor counts as standing: slower than any brushless motor runs without position sensors.
pub(crate) const STANDSTILL: f64 = 100.0;

/// Rows at which the rotor's speed is known by itself, whatever came before ([`Context::starts`]).
fn states(t: &[f64], rpm: &[f64], pulse: Option<&[f64]>, start_us: f64, settling: &[bool]) -> Vec<(usize, f64)> {
    let mut out = stretches::starts(t, rpm, settling.first() == Some(&true));
    if let Some(pulse) = pulse.filter(|_| !rpm.is_empty()) {
        let held_back = stretches::held_back(t, stretches::latest(t), |i| pulse[i] >= start_us, |i| rpm[i] < STANDSTILL);
        out.extend(held_back.into_iter().map(|i| (i, rpm[i])));
        out.sort_unstable_by_key(|(row, _)| *row);
        out.dedup_by_key(|(row, _)| *row);
    }
    out
}

impl Target {
    fn new(context: &Context, name: &'static str, relation: Relation, rows: Vec<usize>, y: Vec<f64>, noise: Noise) -> Self {
        let speed = |i: &usize| if context.rpm.is_empty() { 0.0 } else { context.rpm[*i] };
        let levelled = rows.iter().map(|i| noise.weight_variance(speed(i), LEVELLED)).collect();
        let floored = rows.iter().map(|i| noise.weight_variance(speed(i), FLOORED)).collect();
        let mut calm = vec![false; context.t.len()];
        context.calm.iter().for_each(|(a, b)| calm[*a..*b].fill(true));
        // no curve of a driven motor holds for speed, torque and current of a rotor whose motor is off and that still turns
        let driven = matches!(relation, Relation::SpeedFromPulse | Relation::Torque | Relation::Current);
        let mut unsettled: Vec<bool> = rows.iter().map(|i| !calm[*i] || driven && context.runs_down(*i)).collect();
        let jumps = unsettled.iter().filter(|u| **u).count();
        if jumps < FEWEST_OF_A_KIND || unsettled.len() - jumps < FEWEST_OF_A_KIND.max(unsettled.len() / 4) {
            unsettled.clear();
        }
        Self {
            name,
            relation,
            rows,
            y,
            noise,
            weight: 1.0,
            levelled,
            floored,
            unclaimed: Vec::new(),
            aside: Vec::new(),
            given: Vec::new(),
            known: Vec::new(),
            trust: Vec::new(),
            usual: 0.0,
            unsettled,
        }
    }

    /// Whether predictions of a row are to be judged.
    #[must_use]
    pub fn claims(&self, row: usize) -> bool {
        self.unclaimed.binary_search(&row).is_err() && self.aside.binary_search(&row).is_err()
    }

    /// A residual in the measure in which it is news: against a declared model less where that is known to be rough.
    #[must_use]
    pub fn news(&self, row: usize, residual: f64) -> f64 {
        residual * self.trust.get(row).copied().unwrap_or(1.0)
    }

    /// A residual against the declared model as it stands: what is known of its error belongs to it.
    #[must_use]
    pub fn as_it_stands(&self, row: usize, residual: f64) -> f64 {
        residual + self.known.get(row).copied().unwrap_or(0.0)
    }

    /// How many times what it scattered on the day of a declared model the channel does now, where that is more than days differ.
    #[must_use]
    pub fn noisier(&self) -> Option<f64> {
        let times = if self.usual > 0.0 { self.noise.rms / self.usual } else { 0.0 };
        (times > NOISIER).then_some(times)
    }

    /// The least scale of the variances that a fit may have: a tenth of the noise's standard deviation; what a declared model leaves over
    /// does not shrink because a run happens to agree with it.
    pub(crate) fn least_scale(&self) -> f64 {
        if self.trust.is_empty() { 0.01 } else { 1.0 }
    }

    /// Widens the variance of the samples whose speed was bridged by what the speed's own makes of it.
    fn allow_for_speed(&mut self, context: &Context) {
        let x = |row: usize| context.rpm[row] / 1000.0;
        let points = self.rows.iter().zip(&self.y).map(|(i, v)| (x(*i), *v, 1.0));
        let Some(fit) = Normal::of_polynomial(self.relation.degree(), points).solve() else { return };
        let slope = |x: f64| {
            let terms = fit.coefficients.iter().enumerate().skip(1);
            terms.map(|(k, c)| k as f64 * c * x.powi(k as i32 - 1)).sum::<f64>()
        };
        let of_speed = |row: usize| (slope(x(row)) * context.rpm_sd[row] / 1000.0).powi(2);
        for variances in [&mut self.levelled, &mut self.floored] {
            variances.iter_mut().zip(&self.rows).for_each(|(v, row)| *v += of_speed(*row));
        }
    }

    /// Takes the noise of single rows for samples that are means of `sizes[row]` rows each.
    pub(crate) fn weigh(&mut self, noise: Noise, rpm: &[f64], sizes: &[f64]) {
        let variance = |i: &usize, share| noise.weight_variance(rpm.get(*i).copied().unwrap_or(0.0), share) / sizes[*i];
        self.levelled = self.rows.iter().map(|i| variance(i, LEVELLED)).collect();
        self.floored = self.rows.iter().map(|i| variance(i, FLOORED)).collect();
        self.noise = noise;
    }
}

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
            let new = target(log, self, t.name, &counts).filter(|new| new.rows.len() >= t.relation.degree() + FEWEST_BEYOND)?;
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
        context.targets = targets(log, &context);
        let unclaimed: Vec<Vec<usize>> = context.targets.iter().map(|t| glitches::unclaimed(&context, t)).collect();
        context.targets.iter_mut().zip(unclaimed).for_each(|(target, rows)| target.unclaimed = rows);
        context
    }

    /// Whether a rotor whose motor is off still turns at a row.
    pub(crate) fn runs_down(&self, row: usize) -> bool {
        let off = self.pulse.as_ref().is_some_and(|p| p[row] < self.start_pulse_us);
        off && self.rpm.get(row).is_some_and(|r| *r > STANDSTILL)
    }

    /// Whether a rotor that is told to turn stands at a row.
    fn is_held_back(&self, row: usize) -> bool {
        let on = self.pulse.as_ref().is_some_and(|p| p[row] >= self.start_pulse_us);
        on && self.rpm.get(row).is_some_and(|r| *r < STANDSTILL)
    }

    /// What every declared relation needs and no more: command, consensus speed, steady stretches. No targets; see [`Context::declared`].
    #[must_use]
    pub fn bare(log: &Log, start_pulse_us: Option<f64>) -> Self {
        let pulse = log.column("pulse_us").filter(|c| c.iter().any(|v| v.is_finite())).map(|c| bridge(&log.t, c));
        let consensus::Fused { rpm, sd: rpm_sd, how: consensus } = consensus::of(log);
        let steady = stretches::steady(&log.t, pulse.as_deref(), &rpm, STILL_US);
        let calm = stretches::steady(&log.t, pulse.as_deref(), &rpm, CALM_US);
        let settling = if pulse.is_some() { stretches::settling(&log.t, &rpm, &steady) } else { Vec::new() };
        let start = start_pulse_us.unwrap_or_else(|| start_pulse(&log.t, pulse.as_deref(), &rpm));
        Self {
            name: log.name.clone(),
            t: log.t.clone(),
            time_is_row: log.time_is_row(),
            starts: if log.time_is_row() { Vec::new() } else { states(&log.t, &rpm, pulse.as_deref(), start, &settling) },
            pulse,
            rpm,
            rpm_sd,
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
        modelled.chain(differing(log)).collect()
    }

    /// One target of a log; `None` where it has no sample or nothing to be predicted from.
    #[must_use]
    pub fn declared(&self, log: &Log, name: &'static str) -> Option<Target> {
        match DIFFERENCES.iter().find(|d| d.1 == name) {
            Some((channel, name)) => difference(self, name, log.column(channel)?),
            None => target(log, self, name, &|_| true),
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
        *self.facts.step.get_or_init(|| {
            let mut d: Vec<f64> = self.t.windows(2).map(|w| w[1] - w[0]).collect();
            if d.is_empty() { 1.0 } else { median(&mut d) }
        })
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

/// A channel less its declared polynomial in the measured speed; others as they are.
fn less_speed(context: &Context, relation: Relation, rows: &[usize], y: &[f64]) -> Vec<f64> {
    let follows = matches!(relation, Relation::Thrust | Relation::Torque | Relation::Current);
    if !follows || context.rpm.is_empty() {
        return y.to_vec();
    }
    let x = |row: usize| context.rpm[row] / 1000.0;
    let points = rows.iter().zip(y).map(|(i, v)| (x(*i), *v, 1.0));
    let Some(solution) = Normal::of_polynomial(relation.degree(), points).solve() else { return y.to_vec() };
    let fitted = |x: f64| solution.coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c);
    rows.iter().zip(y).map(|(i, v)| v - fitted(x(*i))).collect()
}

fn targets(log: &Log, context: &Context) -> Vec<Target> {
    Context::declared_names(log).into_iter().filter_map(|name| context.declared(log, name)).collect()
}

/// A channel as a target, of the rows that count.
fn target(log: &Log, context: &Context, name: &'static str, counts: &dyn Fn(usize) -> bool) -> Option<Target> {
    let column = log.column(name)?;
    let relation = Relation::of(name, context.pulse.is_some())?;
    let needs_rpm = matches!(relation, Relation::Thrust | Relation::Torque | Relation::Current | Relation::ThrustRms);
    if needs_rpm && context.rpm.is_empty() {
        return None;
    }
    let given: Vec<usize> = match relation {
        Relation::SpeedFromPulse => context.starts.iter().map(|s| s.0).filter(|row| context.is_held_back(*row)).collect(),
        _ => Vec::new(),
    };
    let judged = |i: &usize| column[*i].is_finite() && counts(*i) && given.binary_search(i).is_err();
    let rows: Vec<usize> = (0..column.len()).filter(judged).collect();
    if rows.is_empty() {
        return None;
    }
    let y: Vec<f64> = rows.iter().map(|i| column[*i]).collect();
    let noise = noise::estimate(&rows, &y, &less_speed(context, relation, &rows, &y), &context.rpm, context.stretches());
    let speeds = SPEED.into_iter().filter(|s| log.column(s).is_some()).count().max(1);
    let weight = if matches!(relation, Relation::SpeedFromPulse | Relation::SpeedAlone) { 1.0 / speeds as f64 } else { 1.0 };
    let mut target = Target { weight, given, ..Target::new(context, name, relation, rows, y, noise) };
    if needs_rpm && !context.rpm_sd.is_empty() {
        target.allow_for_speed(context);
    }
    Some(target)
}

/// Speed channels that can be compared with the consensus: what all of them share (supply, load, lag) drops out. With fewer than
/// three channels nobody can be outvoted, and there are none.
fn differing(log: &Log) -> Vec<&'static str> {
    let measured = |channel: &str| log.column(channel).is_some_and(|c| c.iter().any(|v| v.is_finite()));
    let present: Vec<&'static str> =
        DIFFERENCES.into_iter().filter(|(c, _)| log.column(c).is_some()).map(|(_, name)| name).collect();
    if DIFFERENCES.iter().filter(|(c, _)| measured(c)).count() < 3 { Vec::new() } else { present }
}

/// One speed channel less the consensus.
fn difference(context: &Context, name: &'static str, column: &[f64]) -> Option<Target> {
    let rows: Vec<usize> = (0..column.len()).filter(|i| column[*i].is_finite()).collect();
    let y: Vec<f64> = rows.iter().map(|i| column[*i] - context.rpm[*i]).collect();
    let noise = noise::estimate(&rows, &y, &y, &context.rpm, context.stretches());
    let target = Target::new(context, name, Relation::SpeedDifference, rows, y, noise);
    (target.rows.len() > 8).then_some(target)
}
