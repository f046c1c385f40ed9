//! What the operator may configure and the board remembers.
//!
//! What it is: [`RigConfig`], how it changes the [`Config`], and its form in flash and on the line (postcard, sealed by `settings-store`).
//! What can go wrong: a value out of its range is refused and changes nothing; a stored form of another version, length or
//! checksum is refused as damaged, and factory settings stay in force.
//! Units: on each field.
//! Reference: specification `rig.md`, "Partial rigs are normal", "ESC dialogue is data".

use crate::config::{Config, CurrentChannel, TemperatureChannel, TorqueChannel, VoltageChannel};
use crate::strain::StrainChannel;
use esc_pwm::{Bounds, EscOutput, Slew, ThrottleCurve};
use frame::calibration::AdcScale;
use frame::message::Setting;
use frame::rig::{ADC_CHANNELS, CAPTURE_CHANNELS};
use frame::units::{Ampere, Celsius, Newton, NewtonMetre, PulseWidth, RevPerMin, Ticks, Volt};
use frame::wire::checksum;
use serde::{Deserialize, Serialize};
use settings_store::Stored;

/// A value out of its range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutOfRange;

/// Bytes that the line carries in a second: 2 Mbaud at ten bits a byte.
pub const LINE_BYTES_S: u32 = 200_000;
/// Longest frame of a sample without its channels; of a capture channel that is fitted, or not; of an analogue channel likewise.
const FRAME_BYTES: u32 = 34;
const CAPTURE_BYTES: [u32; 2] = [4, 9];
const ADC_BYTES: [u32; 2] = [4, 10];
/// What the ESC's telemetry and the back-EMF meter add where they are fitted; a byte each, among those of the frame, says that they are not.
const ESC_BYTES: u32 = 17;
const BACK_EMF_BYTES: u32 = 9;
/// Most pole pairs of a motor.
pub const MOST_POLE_PAIRS: u16 = 100;

/// Limits of every channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ChannelLimits {
    /// Rotor speed.
    pub speed: Bounds<RevPerMin>,
    /// Load on the cell, untared.
    pub thrust: Bounds<Newton>,
    /// Torque, untared.
    pub torque: Bounds<NewtonMetre>,
    /// Current.
    pub current: Bounds<Ampere>,
    /// Supply.
    pub voltage: Bounds<Volt>,
    /// Temperature.
    pub temperature: Bounds<Celsius>,
}

/// Which beeps an ESC gives on its way to readiness.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Answers {
    /// A long beep, the cells, "1-2-3" (Beharie 2013, Appendix C).
    LongCellsReady,
    /// A long beep and a last tone; no cells (BLHeli and its relatives).
    LongReady,
    /// Nothing: it is ready once minimum was held for so long towards its supply.
    Silent {
        /// How long, ms; from the instant at which the supply reads on, where it is measured.
        hold_ms: u16,
    },
}

/// How to talk to an ESC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct EscProfile {
    /// What it answers.
    pub answers: Answers,
    /// Highest pulse that a run may give; minimum throttle is always 1000 us.
    pub highest: PulseWidth,
    /// Longest wait for the operator to power the ESC and its first answer, ms.
    pub hold_min_ms: u32,
    /// Longest wait for the cells, ms.
    pub cells_ms: u32,
    /// Longest wait for readiness, ms.
    pub ready_ms: u32,
}

/// A channel's scale as it was calibrated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Calibrated {
    /// Counts to value.
    pub scale: AdcScale,
    /// Standard error of the scale's zero, counts; 0 where it is not known.
    pub zero_sigma: f32,
    /// Standard error of its gain, the channel's unit per count; 0 where it is not known.
    pub gain_sigma: f32,
    /// Root mean square of the residuals, in the channel's unit; 0 for two points.
    pub residual: f32,
    /// Largest residual.
    pub worst: f32,
    /// Points used.
    pub points: u8,
    /// Day of the calibration, counted from 1970-01-01; 0 where it is not known.
    pub day: u16,
}

/// The ESC's serial telemetry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct EscTelemetry {
    /// Pole pairs of the motor: the ESC counts electrical turns.
    pub pole_pairs: u16,
    /// The ESC sends a frame only when it is asked for one, by a DShot frame; otherwise by itself.
    pub asked: bool,
}

/// Everything that can be configured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RigConfig {
    /// Time between two samples, milliseconds.
    pub log_period_ms: u16,
    /// Marks a revolution of the capture channels; 0 where none is fitted.
    pub marks: [u16; CAPTURE_CHANNELS],
    /// Analogue channels that are fitted.
    pub fitted: [bool; ADC_CHANNELS],
    /// Analogue channels whose zero is alive: the low end of their range is a fault.
    pub live_zero: [bool; ADC_CHANNELS],
    /// Throttle curve by five points.
    pub curve: Option<[PulseWidth; 5]>,
    /// Most change of pulse in a millisecond, nanoseconds.
    pub slew_ns_per_ms: u32,
    /// Longest silence of the host while armed, milliseconds.
    pub link_ms: u16,
    /// The ESC.
    pub esc: EscProfile,
    /// Load cell.
    pub strain: StrainChannel,
    /// Torque arm.
    pub torque: TorqueChannel,
    /// Shunt.
    pub current: CurrentChannel,
    /// Supply.
    pub voltage: VoltageChannel,
    /// Temperature.
    pub temperature: TemperatureChannel,
    /// Limits.
    pub limits: ChannelLimits,
    /// Scales that were calibrated, in place of the design's.
    pub calibrated: [Option<Calibrated>; ADC_CHANNELS],
    /// In which form the ESC is told its throttle.
    pub output: EscOutput,
    /// Telemetry of the ESC, where it is fitted.
    pub esc_telemetry: Option<EscTelemetry>,
    /// Pole pairs by which the back-EMF meter counts; 0 where none is fitted.
    pub back_emf: u16,
}

impl RigConfig {
    /// What `config` says.
    #[must_use]
    pub fn of(config: &Config) -> Self {
        let limits = &config.limits;
        Self {
            log_period_ms: config.log_period().as_ms() as u16,
            marks: config.marks,
            fitted: config.fitted,
            live_zero: config.live_zero,
            curve: match config.curve {
                ThrottleCurve::Linear => None,
                ThrottleCurve::Points(points) => Some(points),
            },
            slew_ns_per_ms: config.slew.ns_per_ms,
            link_ms: limits.link_ms as u16,
            esc: EscProfile {
                answers: config.answers,
                highest: config.highest,
                hold_min_ms: config.times.hold_min_ms,
                cells_ms: config.times.cells_ms,
                ready_ms: config.times.ready_ms,
            },
            strain: config.strain,
            torque: config.torque,
            current: config.current,
            voltage: config.voltage,
            temperature: config.temperature,
            limits: ChannelLimits {
                speed: limits.speed,
                thrust: limits.thrust,
                torque: limits.torque,
                current: limits.current,
                voltage: limits.voltage,
                temperature: limits.temperature,
            },
            calibrated: config.calibrated,
            output: config.output,
            esc_telemetry: config.esc_telemetry,
            back_emf: config.back_emf,
        }
    }

    /// These settings with one changed.
    ///
    /// # Errors
    /// [`OutOfRange`]; nothing is changed then.
    pub fn with(mut self, setting: &Setting, factory: &Self) -> Result<Self, OutOfRange> {
        match *setting {
            Setting::LogPeriodMs(ms) => self.log_period_ms = ms,
            Setting::Marks(marks) => self.marks = marks,
            Setting::Curve(curve) => self.curve = curve,
            Setting::SlewNsPerMs(slew) => self.slew_ns_per_ms = slew,
            Setting::SpeedLimit(rpm) => self.limits.speed.high = Some(RevPerMin(rpm)),
            Setting::CurrentLimit(ampere) => self.limits.current.high = Some(Ampere(ampere)),
            Setting::VoltageLimit(volt) => self.limits.voltage.low = Some(Volt(volt)),
            Setting::LinkMs(ms) => self.link_ms = ms,
            Setting::Factory => self = *factory,
        }
        if self.in_range() { Ok(self) } else { Err(OutOfRange) }
    }

    /// Longest frame of a sample, bytes on the line.
    #[must_use]
    pub fn sample_bytes(&self) -> u32 {
        let [absent, present] = CAPTURE_BYTES;
        let captures: u32 = self.marks.iter().map(|m| if *m > 0 { present } else { absent }).sum();
        let [absent, present] = ADC_BYTES;
        let analogue: u32 = self.fitted.iter().map(|f| if *f { present } else { absent }).sum();
        let esc = if self.esc_telemetry.is_some() { ESC_BYTES } else { 0 };
        let back_emf = if self.back_emf > 0 { BACK_EMF_BYTES } else { 0 };
        FRAME_BYTES + captures + analogue + esc + back_emf
    }

    /// Whether every value is possible. A NaN is in no range.
    #[must_use]
    pub fn in_range(&self) -> bool {
        let rising = |points: &[PulseWidth; 5]| {
            let [a, b, c, d, e] = points;
            a <= b && b <= c && c <= d && d <= e && points.iter().all(|p| *p == p.clamped())
        };
        (1..=1000).contains(&self.log_period_ms)
            && self.marks.iter().all(|m| *m <= 100)
            && (self.marks.iter().any(|m| *m > 0) || self.fitted.iter().any(|f| *f))
            && self.curve.as_ref().is_none_or(rising)
            && (10..=1_000_000).contains(&self.slew_ns_per_ms)
            && (200..=5000).contains(&self.link_ms)
            && self.esc.in_range()
            && self.analogue_in_range()
            && self.limits.in_range()
            && self.calibrated.iter().flatten().all(Calibrated::in_range)
            && self.esc_telemetry.is_none_or(|esc| esc.in_range(self.output))
            && self.back_emf <= MOST_POLE_PAIRS
    }

    fn analogue_in_range(&self) -> bool {
        let s = &self.strain;
        let lengths = [s.beam.length_m, s.beam.width_m, s.beam.height_m];
        let volts = [s.zero.0, self.torque.zero.0, self.current.zero.0, self.voltage.zero.0, self.temperature.zero.0];
        lengths.iter().all(|m| (1e-4..=10.0).contains(m))
            && [s.beam.modulus_pa, s.beam.yield_pa].iter().all(|pa| (1e6..=1e12).contains(pa))
            && (1.0..=1e5).contains(&s.beam.density)
            && (0.1..=1000.0).contains(&s.gauge_factor)
            && (0.1..=60.0).contains(&s.excitation.0)
            && (1.0..=1000.0).contains(&s.gain)
            && (1e-3..=1.0).contains(&s.divider)
            && volts.iter().all(|v| (0.0..=60.0).contains(v))
            && (1e-3..=10.0).contains(&self.torque.arm_m)
            && size_within(self.torque.volts_per_newton, 1e-4, 1e3)
            && (1e-6..=10.0).contains(&self.current.shunt_ohm)
            && (1.0..=1000.0).contains(&self.current.gain)
            && (1e-3..=1.0).contains(&self.voltage.divider)
            && size_within(self.temperature.volts_per_kelvin, 1e-5, 1.0)
    }

    /// `config` with these settings in force.
    #[must_use]
    pub fn apply(&self, config: &Config) -> Config {
        let mut config = config.clone();
        config.log_period = Ticks(u64::from(config.ticks_per_ms()) * u64::from(self.log_period_ms));
        config.marks = self.marks;
        config.fitted = self.fitted;
        config.live_zero = self.live_zero;
        config.curve = self.curve.map_or(ThrottleCurve::Linear, ThrottleCurve::Points);
        config.slew = Slew { ns_per_ms: self.slew_ns_per_ms };
        config.answers = self.esc.answers;
        config.highest = self.esc.highest;
        config.times.hold_min_ms = self.esc.hold_min_ms;
        config.times.cells_ms = self.esc.cells_ms;
        config.times.ready_ms = self.esc.ready_ms;
        config.strain = self.strain;
        config.torque = self.torque;
        config.current = self.current;
        config.voltage = self.voltage;
        config.temperature = self.temperature;
        config.limits.speed = self.limits.speed;
        config.limits.thrust = self.limits.thrust;
        config.limits.torque = self.limits.torque;
        config.limits.current = self.limits.current;
        config.limits.voltage = self.limits.voltage;
        config.limits.temperature = self.limits.temperature;
        config.limits.link_ms = u32::from(self.link_ms);
        config.calibrated = self.calibrated;
        config.output = self.output;
        config.esc_telemetry = self.esc_telemetry;
        config.back_emf = self.back_emf;
        config
    }

    /// CRC-32 of the stored content: what a log's head names.
    #[must_use]
    pub fn digest(&self) -> u32 {
        let mut content = [0; crate::transfer::LONGEST];
        let used = self.write(&mut content).unwrap_or(0);
        checksum(content.get(..used).unwrap_or(&[]))
    }
}

/// Whether a number lies between two sizes, on either side of zero.
fn size_within(number: f32, least: f32, most: f32) -> bool {
    (least..=most).contains(&libm::fabsf(number))
}

impl EscTelemetry {
    /// Only a frame can ask: pulses have no way to.
    fn in_range(&self, output: EscOutput) -> bool {
        (1..=MOST_POLE_PAIRS).contains(&self.pole_pairs) && (output.is_digital() || !self.asked)
    }
}

impl EscProfile {
    fn in_range(&self) -> bool {
        let answers = match self.answers {
            Answers::Silent { hold_ms } => hold_ms >= 2000 && u32::from(hold_ms) < self.hold_min_ms,
            Answers::LongCellsReady | Answers::LongReady => true,
        };
        let times = [self.hold_min_ms, self.cells_ms, self.ready_ms];
        answers
            && (PulseWidth::from_us(1100)..=PulseWidth::MAX).contains(&self.highest)
            && times.iter().all(|ms| (1000..=600_000).contains(ms))
    }
}

impl ChannelLimits {
    fn in_range(&self) -> bool {
        let bounds = |low: Option<f32>, high: Option<f32>, ms: u16, most: f32, longest: u16| {
            let possible = |limit: Option<f32>| limit.is_none_or(|v| size_within(v, 0.0, most));
            let ordered = low.zip(high).is_none_or(|(low, high)| low < high);
            possible(low) && possible(high) && ordered && (1..=longest).contains(&ms)
        };
        let Self { speed, thrust, torque, current, voltage, temperature } = self;
        bounds(speed.low.map(|v| v.0), speed.high.map(|v| v.0), speed.ms, 30_000.0, 10_000)
            && bounds(thrust.low.map(|v| v.0), thrust.high.map(|v| v.0), thrust.ms, 10_000.0, 1_000)
            && bounds(torque.low.map(|v| v.0), torque.high.map(|v| v.0), torque.ms, 1_000.0, 10_000)
            && bounds(current.low.map(|v| v.0), current.high.map(|v| v.0), current.ms, 1_000.0, 1_000)
            && bounds(voltage.low.map(|v| v.0), voltage.high.map(|v| v.0), voltage.ms, 100.0, 1_000)
            && bounds(temperature.low.map(|v| v.0), temperature.high.map(|v| v.0), temperature.ms, 500.0, 60_000)
    }
}

impl Calibrated {
    fn in_range(&self) -> bool {
        let errors = [self.zero_sigma, self.gain_sigma, self.residual, self.worst];
        [self.scale.zero, self.scale.gain].iter().all(|n| n.is_finite())
            && self.scale.gain != 0.0
            && errors.iter().all(|n| n.is_finite() && *n >= 0.0)
    }
}

impl Stored for RigConfig {
    const VERSION: u8 = 5;

    fn write(&self, content: &mut [u8]) -> Option<usize> {
        Some(postcard::to_slice(self, content).ok()?.len())
    }

    fn read(content: &[u8]) -> Option<Self> {
        postcard::from_bytes::<Self>(content).ok().filter(Self::in_range)
    }
}

#[cfg(test)]
mod tests;
