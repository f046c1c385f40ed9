//! One tick of the IMU board.
//!
//! What it is: readings and a timestamp in, a telemetry sample with raw words and attitude out, and the physical values before
//! and after the calibration, which the filter runs on. It reads no clock and no register; the RTIC task, the tests and the
//! emulated board call it alike.
//!
//! What can go wrong: a missing reading repeats the last word and clears its `fresh` bit; a magnetometer overflow counts as
//! missing; a saturated gyro or accelerometer is passed on, flagged in [`Outputs::saturated`], and not shown to the filter
//! where it would mislead it (accelerometer); words that never change are flagged in [`Outputs::stuck`] (see [`crate::stuck`]).
//!
//! Units: counts and ticks in; counts, ticks and 2^-30 quaternion units out; rad/s, m/s^2, uT towards the filter.
//!
//! Reference: specification `ahrs.md`, "Board"; Beharie 2013 Eq. 4.1-4.7 with errata.

use crate::sampler::Readings;
use crate::stuck::Watch;
use crate::{ACCEL, GYRO, MAG, Mounting, TICK_HZ, chips};
use dcm::calibration::Calibration;
use dcm::{Dcm, Measurement, STANDARD_GRAVITY, Standard, Step, Vec3};
use frame::message::BoardId;
use frame::{Hello, ImuSample, Ticks};
use imu_sensors::{adxl345, hmc5883l, itg3200};

/// Configuration of the board; nothing here changes while it runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AhrsConfig {
    /// How the gyro sits on the body.
    pub gyro: Mounting,
    /// How the accelerometer sits on the body.
    pub accel: Mounting,
    /// How the magnetometer sits on the body.
    pub mag: Mounting,
}

impl Default for AhrsConfig {
    fn default() -> Self {
        Self { gyro: Mounting::FLAT, accel: Mounting::FLAT, mag: Mounting::FLAT }
    }
}

/// What a tick takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Inputs {
    /// When the gyro was read.
    pub now: Ticks,
    /// What the sampler found.
    pub readings: Readings,
}

/// What a tick gives.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outputs {
    /// To be sent; `None` while none of the three sensors lives, because there is nothing to say.
    pub sample: Option<ImuSample>,
    /// Physical values as read, body axes.
    pub read: Measurement,
    /// The same calibrated: what the filter took.
    pub calibrated: Measurement,
    /// Sensors at the end of their range: bits as in [`ImuSample::fresh`].
    pub saturated: u8,
    /// Sensors that answer with the same words for ever: bits as in [`ImuSample::fresh`].
    pub stuck: u8,
    /// What the filter used of this tick.
    pub filter: Step,
}

/// The IMU board's state.
#[derive(Debug, Clone, PartialEq)]
pub struct Ahrs {
    config: AhrsConfig,
    filter: Dcm<Standard>,
    calibration: Calibration,
    last: ImuSample,
    before: Option<Ticks>,
    watches: Watches,
}

/// One watch a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Watches {
    gyro: Watch,
    accel: Watch,
    mag: Watch,
}

impl Watches {
    /// Takes the fresh readings; gives the sensors that are stuck. One without a reading stays as it was.
    fn take(&mut self, readings: &Readings) -> u8 {
        let Self { gyro, accel, mag } = self;
        readings.gyro.iter().for_each(|reading| gyro.take(&reading.rate));
        readings.accel.iter().for_each(|words| accel.take(words));
        readings.mag.iter().for_each(|words| mag.take(words));
        [(GYRO, gyro), (ACCEL, accel), (MAG, mag)].into_iter().filter(|(_, w)| w.is_stuck()).fold(0, |bits, (bit, _)| bits | bit)
    }
}

impl Ahrs {
    /// A board that has seen nothing yet.
    #[must_use]
    pub fn new(config: AhrsConfig) -> Self {
        let (calibration, watches) = (Calibration::default(), Watches::default());
        Self { config, filter: Dcm::new(Standard), calibration, last: ImuSample::default(), before: None, watches }
    }

    /// The calibration in force.
    #[must_use]
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// Puts another calibration in force. The filter's bias moves with the gyro's zero, and what it knew of the field goes where
    /// the magnetometer's part changed.
    pub fn calibrate(&mut self, calibration: &Calibration) {
        let before = core::mem::replace(&mut self.calibration, *calibration);
        let moved = calibration.gyro_offset - before.gyro_offset;
        if moved != Vec3::zeros() {
            let sigma = self.filter.quality().bias_sigma;
            self.filter.set_bias(self.filter.bias() - moved, sigma);
        }
        if (calibration.mag_offset, calibration.mag_matrix) != (before.mag_offset, before.mag_matrix) {
            self.filter.forget_field();
        }
    }

    /// The first message after reset and the answer to `Identify`. `present` as found by the sampler.
    #[must_use]
    pub const fn hello(core_hz: u32, reset_cause: u8, present: u8) -> Hello {
        Hello { board: BoardId::Ahrs, firmware: FIRMWARE, core_hz, reset_cause, present, analogue: 0, config: 0 }
    }

    /// The attitude filter, for reading.
    #[must_use]
    pub fn filter(&self) -> &Dcm<Standard> {
        &self.filter
    }

    /// Takes one instant.
    pub fn tick(&mut self, inputs: &Inputs) -> Outputs {
        let Readings { gyro, accel, mag, alive, .. } = inputs.readings;
        let stuck = self.watches.take(&inputs.readings);
        let mut saturated = 0;
        let mut measured = Measurement::default();
        let sample = &mut self.last;
        sample.at = inputs.now;
        sample.alive = alive;
        sample.fresh = 0;

        if let Some(reading) = gyro {
            sample.gyro = self.config.gyro.to_body(reading.rate);
            sample.temperature = reading.temperature;
            sample.fresh |= GYRO;
            measured.gyro = Some(scaled(&sample.gyro, RAD_S_PER_LSB));
            if reading.saturated() {
                saturated |= GYRO;
            }
        }
        if let Some(words) = accel {
            sample.accel = self.config.accel.to_body(words);
            sample.fresh |= ACCEL;
            if chips::ACCEL.range.saturated(&words) {
                saturated |= ACCEL;
            } else {
                measured.accel = Some(scaled(&sample.accel, M_S2_PER_LSB));
            }
        }
        match mag {
            Some(words) if hmc5883l::overflowed(&words) => saturated |= MAG,
            Some(words) => {
                sample.mag = self.config.mag.to_body(words);
                sample.fresh |= MAG;
                measured.mag = Some(scaled(&sample.mag, UT_PER_GAUSS / chips::MAG.range.lsb_per_gauss()));
            }
            None => {}
        }

        let since = self.before.map_or(NOMINAL, |before| inputs.now.since(before));
        self.before = Some(inputs.now);
        let calibrated = Measurement {
            gyro: measured.gyro.map(|w| self.calibration.gyro(&w)),
            accel: measured.accel.map(|f| self.calibration.accel(&f)),
            mag: measured.mag.map(|m| self.calibration.mag(&m)),
        };
        let filter = self.filter.update(since.as_s() as f32, &calibrated);
        sample.quaternion_q30 =
            if self.filter.is_started() { self.filter.quaternion().map(|q| (q * Q30) as i32) } else { [0; 4] };
        let lives = alive & (GYRO | ACCEL | MAG) != 0;
        Outputs { sample: lives.then_some(*sample), read: measured, calibrated, saturated, stuck, filter }
    }
}

/// Time between ticks, for the first of them.
const NOMINAL: Ticks = Ticks::from_ms(1000 / TICK_HZ as u64);
/// 2^30, the scale of the quaternion on the wire.
const Q30: f32 = 1_073_741_824.0;
/// Gyro scale in rad/s per count.
pub(crate) const RAD_S_PER_LSB: f32 = core::f32::consts::PI / 180.0 / itg3200::LSB_PER_DEG_S;
/// Accelerometer scale in m/s^2 per count.
pub(crate) const M_S2_PER_LSB: f32 = STANDARD_GRAVITY / adxl345::LSB_PER_G;
/// Microtesla in a gauss.
const UT_PER_GAUSS: f32 = 100.0;
/// Version of this package.
const FIRMWARE: [u8; 3] =
    frame::version::of([env!("CARGO_PKG_VERSION_MAJOR"), env!("CARGO_PKG_VERSION_MINOR"), env!("CARGO_PKG_VERSION_PATCH")]);

fn scaled(words: &[i16; 3], scale: f32) -> Vec3 {
    Vec3::from(words.map(|w| f32::from(w) * scale))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GyroReading;

    const ALL: u8 = GYRO | ACCEL | MAG;

    /// Level and pointing to magnetic north, chips mounted flat: gravity reaction along chip +z, field down along chip -z.
    fn level(now: Ticks) -> Inputs {
        let readings = Readings {
            gyro: Some(GyroReading { temperature: -13_200, rate: [0; 3] }),
            accel: Some([0, 0, 256]),
            mag: Some([218, 0, -470]),
            alive: ALL,
            ..Readings::default()
        };
        Inputs { now, readings }
    }

    #[test]
    fn level_is_the_unit_quaternion() {
        let mut ahrs = Ahrs::new(AhrsConfig::default());
        let out = ahrs.tick(&level(Ticks(0)));
        let sample = out.sample.unwrap();
        assert_eq!((sample.fresh, sample.alive, out.saturated), (ALL, ALL, 0));
        assert_eq!((sample.accel, sample.mag), ([0, 0, -256], [218, 0, 470]));
        let [w, rest @ ..] = sample.quaternion_q30;
        assert!((w - (1 << 30)).abs() < 1000 && rest.iter().all(|q| q.abs() < 1000), "{w} {rest:?}");
    }

    #[test]
    fn one_second_of_yaw_rate_is_yaw_and_turns_right() {
        let mut ahrs = Ahrs::new(AhrsConfig::default());
        for k in 0..=200u64 {
            let mut i = level(Ticks::from_ms(5 * k));
            i.readings.mag = None;
            // -30 deg/s about chip z (up) is +30 deg/s about body z (down)
            i.readings.gyro = Some(GyroReading { temperature: 0, rate: [0, 0, -431] });
            ahrs.tick(&i);
        }
        let e = ahrs.filter().euler();
        assert!((e.yaw.to_degrees() - 29.98).abs() < 0.1, "{}", e.yaw.to_degrees());
        assert!(e.roll.abs() < 1e-3 && e.pitch.abs() < 1e-3);
    }

    #[test]
    fn missing_words_repeat_and_are_not_fresh() {
        let mut ahrs = Ahrs::new(AhrsConfig::default());
        ahrs.tick(&level(Ticks(0)));
        let gone = Readings { alive: GYRO, ..Readings::default() };
        let sample = ahrs.tick(&Inputs { now: Ticks::from_ms(5), readings: gone }).sample.unwrap();
        assert_eq!((sample.fresh, sample.alive), (0, GYRO));
        assert_eq!((sample.accel, sample.mag), ([0, 0, -256], [218, 0, 470]));
        assert_eq!(ahrs.tick(&Inputs::default()).sample, None, "nothing lives: nothing to say");
    }

    #[test]
    fn saturation_is_flagged_and_misleads_nobody() {
        let mut ahrs = Ahrs::new(AhrsConfig::default());
        ahrs.tick(&level(Ticks(0)));
        let mut i = level(Ticks::from_ms(5));
        i.readings.accel = Some([4095, 0, 256]);
        i.readings.mag = Some([-4096, 0, -470]);
        i.readings.gyro = Some(GyroReading { temperature: 0, rate: [i16::MAX, 0, 0] });
        let out = ahrs.tick(&i);
        assert_eq!(out.saturated, ALL);
        assert!(!out.filter.accel_used && !out.filter.mag_used && out.filter.gyro_used);
        let sample = out.sample.unwrap();
        assert_eq!(sample.accel, [4095, 0, -256], "the raw word travels");
        assert_eq!((sample.mag, sample.fresh), ([218, 0, 470], GYRO | ACCEL));
    }

    #[test]
    fn a_sensor_that_never_changes_is_named_and_the_others_are_not() {
        let mut ahrs = Ahrs::new(AhrsConfig::default());
        let mut found = 0;
        for k in 0..u64::from(crate::stuck::STUCK_AFTER) {
            let mut i = level(Ticks::from_ms(5 * k));
            let noise = (k % 3) as i16;
            i.readings.gyro = Some(GyroReading { temperature: noise, rate: [5, 0, 0] });
            i.readings.accel = Some([noise, 0, 256]);
            // a reading in two or three, as the chip gives them
            i.readings.mag = (k % 2 == 0).then_some([218 + noise, 0, -470]);
            found = ahrs.tick(&i).stuck;
        }
        assert_eq!(found, GYRO, "its temperature moves, its rates do not");
        let mut i = level(Ticks::from_ms(1_005));
        i.readings.gyro = Some(GyroReading { temperature: 0, rate: [5, 1, 0] });
        assert_eq!(ahrs.tick(&i).stuck, 0);
        // no reading is no news
        let gone = Readings { alive: ALL, ..Readings::default() };
        assert_eq!(ahrs.tick(&Inputs { now: Ticks::from_ms(1_010), readings: gone }).stuck, 0);
    }

    #[test]
    fn the_version_is_the_package_version() {
        assert_eq!(Ahrs::hello(168_000_000, 4, ALL).firmware, [0, 1, 0]);
    }

    #[test]
    fn the_filter_runs_on_calibrated_values_and_the_words_stay_raw() {
        let mut ahrs = Ahrs::new(AhrsConfig::default());
        let mut calibration = Calibration { gyro_offset: Vec3::new(0.1, 0.0, 0.0), ..Calibration::default() };
        calibration.mag_matrix.m11 = 2.0;
        ahrs.calibrate(&calibration);
        let out = ahrs.tick(&level(Ticks(0)));
        assert_eq!((out.read.gyro, out.calibrated.gyro), (Some(Vec3::zeros()), Some(Vec3::new(-0.1, 0.0, 0.0))));
        assert_eq!(out.calibrated.mag.unwrap().x, 2.0 * out.read.mag.unwrap().x);
        assert_eq!(out.sample.unwrap().mag, [218, 0, 470]);
    }

    /// A board at rest for so many seconds.
    fn rested(seconds: u64) -> Ahrs {
        let mut ahrs = Ahrs::new(AhrsConfig::default());
        (0..200 * seconds).for_each(|k| {
            ahrs.tick(&level(Ticks::from_ms(5 * k)));
        });
        ahrs
    }

    /// What the gyro shows at rest is its zero and the filter's bias together: a new zero moves the bias by as much.
    #[test]
    fn a_new_zero_of_the_gyro_moves_the_bias() {
        let mut ahrs = Ahrs::new(AhrsConfig::default());
        for zero in [Vec3::new(0.02, -0.03, 0.05), Vec3::new(0.05, 0.01, 0.04), Vec3::zeros()] {
            ahrs.calibrate(&Calibration { gyro_offset: zero, ..Calibration::default() });
            let sum = ahrs.filter().bias() + zero;
            assert!(sum.abs().max() < 1e-6, "{sum}");
        }
    }

    #[test]
    fn only_a_new_magnetometer_calibration_makes_the_heading_start_anew() {
        let mut ahrs = rested(20);
        assert!(!ahrs.filter().flags().startup);
        let mut calibration = Calibration { gyro_offset: Vec3::new(0.01, 0.0, 0.0), ..Calibration::default() };
        ahrs.calibrate(&calibration);
        assert!(!ahrs.filter().flags().startup, "the gyro's says nothing of the field");
        calibration.mag_offset.x = 1.0;
        ahrs.calibrate(&calibration);
        assert!(ahrs.filter().flags().startup);
    }

    #[test]
    fn one_sensor_that_lives_is_something_to_say() {
        let said = |alive: u8| {
            let readings = Readings { alive, ..Readings::default() };
            Ahrs::new(AhrsConfig::default()).tick(&Inputs { now: Ticks(0), readings }).sample.is_some()
        };
        assert_eq!([GYRO, ACCEL, MAG, 0, crate::TEST_ACCEL].map(said), [true, true, true, false, false]);
    }

    #[test]
    fn as_many_ticks_as_are_named_are_a_second() {
        assert_eq!(NOMINAL.0 * u64::from(TICK_HZ), Ticks::from_ms(1000).0);
    }
}
