//! The rig's configuration: immutable, with its units.
//!
//! What it is: clocks, marks, analogue scales, limits and times of one rig, and the [`Calibration`] that follows from them.
//! What can go wrong: a log period out of 1 to 1000 ms is brought into that range by [`Config::log_period`].
//! Units: on each field.
//! Reference: errata "Figures that the text states"; Beharie 2013, Tables 6-8 and Eq. 5.57.

use crate::rig_config::{Answers, Calibrated, EscTelemetry};
use crate::strain::StrainChannel;
use esc_pwm::{ArmingTimes, Bounds, EscOutput, Limits, Slew, ThrottleCurve};
use frame::calibration::{AdcScale, Calibration};
use frame::rig::{ADC_CHANNELS, CAPTURE_CHANNELS};
use frame::units::{Ampere, Newton, PulseWidth, RevPerMin, Ticks, Volt};
use serde::{Deserialize, Serialize};

/// The converter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Converter {
    /// Reference.
    pub reference: Volt,
    /// Resolution, bits.
    pub bits: u8,
}

impl Converter {
    /// Counts in a volt.
    #[must_use]
    pub fn counts_per_volt(&self) -> f32 {
        (1u32 << self.bits.min(31)) as f32 / self.reference.0
    }

    /// Highest code.
    #[must_use]
    pub const fn top(&self) -> u16 {
        if self.bits >= 16 { u16::MAX } else { (1 << self.bits) - 1 }
    }
}

/// Torque by the force on a lever arm (Beharie 2013, Eq. 5.57).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TorqueChannel {
    /// Arm, m.
    pub arm_m: f32,
    /// Volts at the converter for one newton on the arm.
    pub volts_per_newton: f32,
    /// Volts at the converter without load.
    pub zero: Volt,
}

/// Current by a shunt: I = V/(R G) (errata 5.59).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CurrentChannel {
    /// Shunt, ohm.
    pub shunt_ohm: f32,
    /// Amplifier gain.
    pub gain: f32,
    /// Volts at the converter without current: a live zero, so that a broken wire shows.
    pub zero: Volt,
}

/// The supply's divider.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct VoltageChannel {
    /// Volts at the converter over volts of the supply.
    pub divider: f32,
    /// Volts at the converter without a supply: a bias makes it a live zero, so that a broken wire shows.
    pub zero: Volt,
}

/// A sensor of temperature with a linear output.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TemperatureChannel {
    /// Volts at 0 degC.
    pub zero: Volt,
    /// Volts a kelvin.
    pub volts_per_kelvin: f32,
}

/// How often and how long for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CaptureTimes {
    /// Shortest span of a speed reading.
    pub span: Ticks,
    /// Silence after which the rotor stands, at least.
    pub stop: Ticks,
    /// Added to three expected periods before a channel counts as lost.
    pub lost_margin: Ticks,
}

/// Everything that is fixed while the rig runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Config {
    /// Core clock, Hz.
    pub core_hz: u32,
    /// Capture timer, Hz.
    pub timer_hz: u32,
    /// Equal marks a revolution seen by each capture channel, after its prescaler; 0 where none is fitted.
    pub marks: [u16; CAPTURE_CHANNELS],
    /// Times of the speed measurement.
    pub capture: CaptureTimes,
    /// Time between two samples.
    pub log_period: Ticks,
    /// Converter of all five channels.
    pub converter: Converter,
    /// Load cell.
    pub strain: StrainChannel,
    /// Scales that were calibrated, in place of the design's.
    pub calibrated: [Option<Calibrated>; ADC_CHANNELS],
    /// Analogue channels that are fitted. What is not fitted is not read, not judged and raises no fault.
    pub fitted: [bool; ADC_CHANNELS],
    /// Torque arm.
    pub torque: TorqueChannel,
    /// Shunt.
    pub current: CurrentChannel,
    /// Supply.
    pub voltage: VoltageChannel,
    /// Temperature.
    pub temperature: TemperatureChannel,
    /// Channels whose low end of range is a fault rather than a reading of zero.
    pub live_zero: [bool; ADC_CHANNELS],
    /// Supply above which the ESC counts as powered.
    pub powered: Volt,
    /// Protections.
    pub limits: Limits,
    /// Time-outs of the arming machine.
    pub times: ArmingTimes,
    /// Which beeps the ESC gives.
    pub answers: Answers,
    /// Highest pulse of a run.
    pub highest: PulseWidth,
    /// Slew limit.
    pub slew: Slew,
    /// Throttle curve.
    pub curve: ThrottleCurve,
    /// In which form the ESC is told its throttle.
    pub output: EscOutput,
    /// Telemetry of the ESC, where it is fitted.
    pub esc_telemetry: Option<EscTelemetry>,
    /// Pole pairs by which the back-EMF meter counts; 0 where none is fitted.
    pub back_emf: u16,
}

impl Config {
    /// Volts at the converter over volts of the supply: 50 kOhm over 10 kOhm, 19.8 V full scale.
    const SUPPLY_DIVIDER: f32 = 1.0 / 6.0;

    /// The thesis' rig with its 570 KV motor on an 11.5 V supply.
    #[must_use]
    pub fn thesis_570kv() -> Self {
        let strain = StrainChannel::THESIS;
        let margin = strain.beam.load_at(strain.beam.yield_pa / 2.0); // safety factor 2 (Table 7)
        Self {
            core_hz: 168_000_000,
            timer_hz: Ticks::HZ,
            marks: [2, 1, 2, 25], // two blades, one tab, two magnets, 100 steps with the capture prescaler at 4
            capture: CaptureTimes { span: Ticks::from_ms(50), stop: Ticks::from_ms(250), lost_margin: Ticks::from_ms(20) },
            log_period: Ticks::from_ms(100),
            converter: Converter { reference: Volt(3.3), bits: 12 },
            strain,
            calibrated: [None; ADC_CHANNELS],
            fitted: [true; ADC_CHANNELS],
            torque: TorqueChannel { arm_m: 0.1, volts_per_newton: 0.25, zero: Volt(1.65) },
            current: CurrentChannel { shunt_ohm: 0.001, gain: 50.0, zero: Volt(0.2) },
            voltage: VoltageChannel { divider: Self::SUPPLY_DIVIDER, zero: Volt(0.0) },
            temperature: TemperatureChannel { zero: Volt(0.5), volts_per_kelvin: 0.01 }, // TMP36
            live_zero: [true, true, true, false, true],
            powered: Volt(1.0),
            limits: Limits {
                // encoder's highest (Beharie 2013, Appendix C); with the revolution it is read over (6 ms at 10 000 rev/min) and the
                // tick: within 20 ms of the cause
                speed: Bounds { high: Some(RevPerMin(10_000.0)), ms: 12, ..Bounds::NONE },
                thrust: Bounds { low: Some(Newton(-margin.0)), high: Some(margin), ..Bounds::NONE },
                torque: Bounds::NONE,
                current: Bounds { high: Some(Ampere(30.0)), ..Bounds::NONE },
                voltage: Bounds { low: Some(Volt(9.0)), ..Bounds::NONE }, // 3 V a cell
                temperature: Bounds::NONE,
                idle_current: Ampere(1.0),
                disagreeing: 1,
                link_ms: 1000,
                stall_ms: 5,
                idle_ms: 5,
                analogue_ms: 100,
                sensor_ms: 500,
                lost_ms: 50,
            },
            times: ArmingTimes::default(),
            answers: Answers::LongCellsReady,
            highest: PulseWidth::MAX,
            slew: Slew { ns_per_ms: 10_000 }, // full range in 0.1 s: a step stays a step to a motor of 50 ms
            curve: ThrottleCurve::Linear,
            output: EscOutput::Pwm,
            esc_telemetry: None,
            back_emf: 0,
        }
    }

    /// Time between samples, brought into 1 to 1000 Hz.
    #[must_use]
    pub fn log_period(&self) -> Ticks {
        let ms = u64::from(self.timer_hz / 1000);
        Ticks(self.log_period.0.max(ms).min(1000 * ms)) // not clamp(): it can panic
    }

    /// Sampling time of the converter, cycles of its clock: short enough for 1024 conversions of each channel in a log period
    /// of 10 ms or more with a margin (see `docs/rig.md`), long enough that a second's sum still fits.
    #[must_use]
    pub fn sampling_cycles(&self) -> u16 {
        if self.log_period().0 < u64::from(self.ticks_per_ms()) * 40 { 15 } else { 56 }
    }

    /// Ticks of the capture timer in a millisecond.
    #[must_use]
    pub const fn ticks_per_ms(&self) -> u32 {
        let ticks = self.timer_hz / 1000;
        if ticks == 0 { 1 } else { ticks }
    }

    /// Scales of raw codes, before any tare: the calibrated ones, the design's where there is none.
    #[must_use]
    pub fn calibration(&self) -> Calibration {
        let mut whole = self.design();
        for (scale, calibrated) in whole.adc.iter_mut().zip(&self.calibrated) {
            *scale = calibrated.map_or(*scale, |c| c.scale);
        }
        whole
    }

    /// Scales of raw codes as designed.
    ///
    /// Thrust is zero at the load cell's own zero; the motor's weight reads as negative thrust until the operator tares.
    #[must_use]
    pub fn design(&self) -> Calibration {
        let per_volt = self.converter.counts_per_volt();
        let s = &self.strain;
        let sign = if s.down_is_positive { -1.0 } else { 1.0 };
        let scale =
            |zero_v: f32, volts_per_unit: f32| AdcScale { zero: zero_v * per_volt, gain: 1.0 / (volts_per_unit * per_volt) };
        let adc = [
            scale(s.zero.0 * s.divider, sign * s.volts_per_newton() * s.divider),
            scale(self.torque.zero.0, self.torque.volts_per_newton / self.torque.arm_m),
            scale(self.current.zero.0, self.current.shunt_ohm * self.current.gain),
            scale(self.voltage.zero.0, self.voltage.divider),
            scale(self.temperature.zero.0, self.temperature.volts_per_kelvin),
        ];
        let pole_pairs = [self.esc_telemetry.map_or(0, |esc| esc.pole_pairs), self.back_emf];
        Calibration { timer_hz: self.timer_hz, marks: self.marks, adc, pole_pairs }
    }

    /// Largest load either way that the strain channel can express, for the operator's information.
    #[must_use]
    pub fn load_range(&self) -> (Newton, Newton) {
        let scale = self.calibration().adc[0];
        let (a, b) = ((0.0 - scale.zero) * scale.gain, (f32::from(self.converter.top()) - scale.zero) * scale.gain);
        if a < b { (Newton(a), Newton(b)) } else { (Newton(b), Newton(a)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errata, row "signal after the amplifier".
    #[test]
    fn the_thesis_signal() {
        let config = Config::thesis_570kv();
        let calibration = config.calibration();
        let per_gram = 0.009_806_65 / calibration.adc[0].gain.abs();
        assert!((per_gram - 2.68).abs() < 0.01, "{per_gram} counts a gram");
        let newtons = |amplifier_v: f32| {
            let counts = amplifier_v * 0.5 / 3.3 * 4096.0;
            (counts - calibration.adc[0].zero) * calibration.adc[0].gain
        };
        let grams = |v| newtons(v) / 0.009_806_65;
        assert!((grams(0.40) - 440.0).abs() < 2.0, "thrust of full throttle: {}", grams(0.40));
        assert!((grams(3.35) + 244.0).abs() < 2.0, "motor's weight: {}", grams(3.35));
        let (low, high) = config.load_range();
        assert!(low.0 < -2.4 && high.0 > 4.3, "{low} to {high}");
    }

    #[test]
    fn scales_of_the_other_channels() {
        let calibration = Config::thesis_570kv().calibration();
        let at = |channel: usize, volts: f32| {
            let scale = calibration.adc[channel];
            (volts / 3.3 * 4096.0 - scale.zero) * scale.gain
        };
        assert!((at(1, 1.65 + 0.25) - 0.1).abs() < 1e-4, "one newton on 0.1 m");
        assert!((at(2, 0.2 + 0.5) - 10.0).abs() < 1e-3, "10 A through 1 mOhm, gain 50");
        assert!((at(3, 11.5 / 6.0) - 11.5).abs() < 1e-3);
        assert!((at(4, 0.75) - 25.0).abs() < 1e-3, "TMP36: 750 mV at 25 degC");
    }

    /// The beam may carry half of what bends it for good (Table 7), up and down.
    #[test]
    fn the_thrust_limit_is_half_the_yield_of_the_beam() {
        let config = Config::thesis_570kv();
        let beam = config.strain.beam;
        let thrust = config.limits.thrust;
        let (low, high) = (thrust.low.unwrap(), thrust.high.unwrap());
        assert_eq!(low.0, -high.0);
        assert!((beam.stress(high) / beam.yield_pa - 0.5).abs() < 1e-6, "{high}");
    }

    /// What is told as the range is what the lowest and the highest code say, whichever way the gauges are glued.
    #[test]
    fn the_load_range_ends_at_the_converter_s_ends() {
        let config = Config::thesis_570kv();
        for down_is_positive in [true, false] {
            let config = Config { strain: StrainChannel { down_is_positive, ..config.strain }, ..config.clone() };
            let scale = config.calibration().adc[0];
            let of = |code: f32| (code - scale.zero) * scale.gain;
            let ends = if down_is_positive { (of(4095.0), of(0.0)) } else { (of(0.0), of(4095.0)) };
            let (low, high) = config.load_range();
            assert_eq!((low.0, high.0), ends);
            assert!(low.0 < 0.0 && high.0 > 0.0, "{low} to {high}");
        }
    }

    /// From 40 ms on there is time for the long sampling.
    #[test]
    fn fast_logs_sample_shortly() {
        let with = |ms| Config { log_period: Ticks::from_ms(ms), ..Config::thesis_570kv() }.sampling_cycles();
        assert_eq!([with(1), with(10), with(39), with(40), with(100), with(1000)], [15, 15, 15, 56, 56, 56]);
    }

    #[test]
    fn log_rates_are_one_to_a_thousand() {
        let with = |ms| Config { log_period: Ticks::from_ms(ms), ..Config::thesis_570kv() }.log_period().as_ms();
        assert_eq!([with(0), with(1), with(100), with(1000), with(5000)], [1, 1, 100, 1000, 1000]);
    }
}
