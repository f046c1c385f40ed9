//! A second of rest, or of motion.
//!
//! What it is: means of rate, specific force and field over a second, with the scatter of the readings, and whether the second half
//! says the same as the first.
//! What can go wrong: a slow steady turn scatters no more than rest does; about a level axis the force gives it away, about the
//! vertical the field does from some 6 deg/s on, and slower ones without a field are not seen.
//! Units: rad/s, m/s^2, uT; readings.
//! Reference: Laidig & Seel 2023, section 3.4, for the limit of the rate; a converter's step has a standard deviation of step/sqrt(12).

use crate::ahrs::{M_S2_PER_LSB, RAD_S_PER_LSB};
use dcm::calibration::{CalibrationError, GyroZero};
use dcm::{Measurement, Vec3};
use libm::sqrtf;

/// Readings of a half: half a second.
const HALF: u32 = 100;
/// Largest standard deviation of a gyro at rest, rad/s: 1 deg/s.
const GYRO_NOISE: f32 = 0.0175;
/// Largest standard deviation of an accelerometer at rest, m/s^2.
const ACCEL_NOISE: f32 = 0.25;
/// Largest change of the force between the halves, m/s^2: 0.3 degrees of tilt.
const FORCE_MOVED: f32 = 0.05;
/// Largest change of the field between the halves, uT.
const FIELD_MOVED: f32 = 1.0;
/// Standard deviation of what a converter's step hides, in steps: 1/sqrt(12).
const STEP: f32 = 0.288_675;

/// Means over a second of rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Still {
    /// Rate, rad/s.
    pub(crate) rate: Vec3,
    /// Its standard error.
    pub(crate) rate_sigma: Vec3,
    /// Standard deviation of a rate, the largest axis.
    pub(crate) rate_noise: f32,
    /// Specific force, m/s^2.
    pub(crate) force: Vec3,
    /// Its standard error, the largest axis.
    pub(crate) force_sigma: f32,
    /// Field, uT; `None` without a magnetometer.
    pub(crate) field: Option<Vec3>,
    /// Rates in the mean.
    pub(crate) readings: u32,
}

/// What a second showed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Second {
    /// Rest.
    Rest(Still),
    /// Motion, with the scatter of the rate, rad/s.
    Motion(f32),
}

/// Collects a second.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Watch {
    rate: GyroZero,
    force: [GyroZero; 2],
    field: [(Vec3, u32); 2],
}

impl Watch {
    /// Takes one instant; gives the second when it is full, and begins anew.
    pub(crate) fn take(&mut self, read: &Measurement) -> Option<Second> {
        let [first, second] = &mut self.force;
        let half = usize::from(first.count() >= HALF);
        if let Some(rate) = &read.gyro {
            self.rate.add(rate);
        }
        if let Some(force) = &read.accel {
            if half == 0 { first.add(force) } else { second.add(force) }
        }
        if let (Some(field), Some((sum, count))) = (&read.mag, self.field.get_mut(half)) {
            *sum += field;
            *count += 1;
        }
        if self.rate.count() < 2 * HALF || second.count() < HALF {
            return None;
        }
        Some(core::mem::take(self).judge())
    }

    /// Rates so far.
    pub(crate) fn readings(&self) -> u32 {
        self.rate.count()
    }

    fn judge(&self) -> Second {
        let (rate, sigma) = match self.rate.finish(GYRO_NOISE) {
            Ok(found) => found,
            Err(CalibrationError::Moving { scatter }) => return Second::Motion(scatter),
            Err(_) => return Second::Motion(0.0),
        };
        let noise = sigma.max() * sqrtf(self.rate.count() as f32);
        let [Ok((a, a_sigma)), Ok((b, b_sigma))] = self.force.map(|half| half.finish(ACCEL_NOISE)) else {
            return Second::Motion(noise);
        };
        let means = self.field.map(|(sum, count)| (count > 0).then(|| sum / count as f32));
        let field = match means {
            [Some(a), Some(b)] if (a - b).abs().max() > FIELD_MOVED => return Second::Motion(noise),
            [Some(a), Some(b)] => Some((a + b) / 2.0),
            _ => None,
        };
        if (a - b).abs().max() > FORCE_MOVED {
            return Second::Motion(noise);
        }
        let readings = self.rate.count();
        let half = a_sigma.max().max(b_sigma.max()) * sqrtf(HALF as f32);
        Second::Rest(Still {
            rate,
            rate_sigma: sigma.map(|s| error_of_mean(s * sqrtf(readings as f32), readings, RAD_S_PER_LSB)),
            rate_noise: noise,
            force: (a + b) / 2.0,
            force_sigma: error_of_mean(half, 2 * HALF, M_S2_PER_LSB),
            field,
            readings,
        })
    }
}

/// Standard error of a mean of readings with a converter's step: noise below half a step averages nothing out.
fn error_of_mean(deviation: f32, readings: u32, step: f32) -> f32 {
    if deviation < step / 2.0 { STEP * step } else { deviation / sqrtf(readings as f32) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn second(rate: impl Fn(u32) -> f32, force: impl Fn(u32) -> f32, field: impl Fn(u32) -> f32) -> Second {
        let mut watch = Watch::default();
        for k in 0..200 {
            let read = Measurement {
                gyro: Some(Vec3::new(rate(k), 0.0, 0.0)),
                accel: Some(Vec3::new(0.0, force(k), -9.8)),
                mag: (k % 3 == 0).then(|| Vec3::new(20.0, 0.0, field(k))),
            };
            if let Some(second) = watch.take(&read) {
                assert_eq!((k, watch), (199, Watch::default()));
                return second;
            }
        }
        panic!("no second in 200 readings")
    }

    #[test]
    fn rest_is_rest_with_any_offset() {
        let Second::Rest(still) = second(|k| 0.5 + if k.is_multiple_of(2) { 0.01 } else { -0.01 }, |_| 0.3, |_| 43.0) else {
            panic!()
        };
        assert!((still.rate.x - 0.5).abs() < 1e-6 && (still.rate_sigma.x - 0.01 / 200f32.sqrt()).abs() < 1e-5);
        assert!((still.rate_sigma.y - 0.288_675 * RAD_S_PER_LSB).abs() < 1e-8, "no noise, no average: {}", still.rate_sigma.y);
        assert_eq!(still.field.map(|f| f.z), Some(43.0));
    }

    #[test]
    fn every_kind_of_motion_is_seen() {
        let shaken = |k: u32| if k.is_multiple_of(2) { 0.03 } else { -0.03 };
        assert!(matches!(second(shaken, |_| 0.0, |_| 43.0), Second::Motion(s) if s > 0.02));
        assert!(matches!(second(|_| 0.0, |k| k as f32 * 1e-3, |_| 43.0), Second::Motion(_)), "a slow tilt");
        assert!(matches!(second(|_| 0.0, |_| 0.0, |k| k as f32 * 0.02), Second::Motion(_)), "a slow turn about the vertical");
    }

    /// How many instants a second takes where only every so many bring a rate or a force.
    fn instants(rates: u32, forces: u32) -> u32 {
        let mut watch = Watch::default();
        let full = |k: &u32| {
            let gyro = k.is_multiple_of(rates).then(Vec3::zeros);
            let accel = k.is_multiple_of(forces).then(|| Vec3::new(0.0, 0.0, -9.8));
            watch.take(&Measurement { gyro, accel, mag: None }).is_some()
        };
        (1..1_000).find(full).unwrap_or(0)
    }

    #[test]
    fn a_second_has_two_hundred_rates_and_as_many_forces() {
        assert_eq!([instants(1, 1), instants(2, 1), instants(1, 2)], [200, 400, 400]);
    }

    #[test]
    fn the_noise_of_a_second_is_that_of_a_reading() {
        let rate = |k: u32| if k.is_multiple_of(2) { 0.01 } else { -0.01 };
        let Second::Rest(still) = second(rate, |_| 0.0, |_| 43.0) else { panic!() };
        assert!((still.rate_noise - 0.01).abs() < 1e-4, "{}", still.rate_noise);
    }

    #[test]
    fn rates_are_counted() {
        let mut watch = Watch::default();
        for k in 1..5 {
            watch.take(&Measurement { gyro: Some(Vec3::zeros()), ..Measurement::default() });
            assert_eq!(watch.readings(), k);
        }
    }

    /// From half a step on noise averages out; below, the step hides it.
    #[test]
    fn half_a_step_of_noise_averages_out() {
        assert_eq!([error_of_mean(0.5, 100, 1.0), error_of_mean(0.49, 100, 1.0)], [0.05, STEP]);
    }

    /// What has changed by as much as is allowed is still rest.
    #[test]
    fn the_halves_may_differ_by_so_much() {
        let halves = |by: f32| move |k: u32| if k < 100 { 0.0 } else { by };
        let rests = |force: f32, field: f32| matches!(second(|_| 0.0, halves(force), halves(field)), Second::Rest(_));
        assert_eq!([rests(FORCE_MOVED, FIELD_MOVED), rests(0.051, 0.0), rests(0.0, 1.01)], [true, false, false]);
    }

    #[test]
    fn rest_without_a_magnetometer_has_no_field() {
        let mut watch = Watch::default();
        let read = Measurement { gyro: Some(Vec3::zeros()), accel: Some(Vec3::new(0.0, 0.0, -9.8)), mag: None };
        let found = (0..200).find_map(|_| watch.take(&read));
        assert!(matches!(found, Some(Second::Rest(Still { field: None, .. }))), "{found:?}");
    }
}
