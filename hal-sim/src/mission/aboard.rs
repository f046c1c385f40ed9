//! The IMU board in a flight.
//!
//! What it is: the board's firmware, natively, on the vehicle: every millisecond the vehicle writes what is felt at the board, vibration
//! included, every 5 ms the sampler reads the chips over the bus and [`Ahrs::tick`] takes the words.
//! What can go wrong: a chip that is off the bus is what it is to the firmware; before the filter has started there is no attitude.
//! Units: s of the flight (negative before it); SI.
//! Reference: specification `flight.md`, "Missions"; `ahrs.md`.

use super::sections::{Chips, ImuSection};
use crate::clock::VirtualClock;
use crate::flight::attitude::from_quaternion;
use crate::flight::vibration::Shaking;
use crate::flight::{Airframe, G, Motion, Rotation, Vector, Vehicle, Vibration};
use crate::imu::{Aboard, BusFault, ChipKind, Errors, Felt, I2cBus};
use crate::native::ahrs::ImuRig;
use crate::plant::PlantState;
use firmware_ahrs::{ACCEL, Ahrs, AhrsConfig, GYRO, Inputs, MAG, Sampler, TICK_HZ};

/// Milliseconds between two ticks of the board.
const TICK_MS: u64 = 1000 / TICK_HZ as u64;
/// Gauss in a microtesla.
const GAUSS_PER_UT: f64 = 0.01;
/// What a calibration leaves of the errors of accelerometer and magnetometer (assumed).
const LEFT_BY_CALIBRATION: f64 = 0.05;

/// What the board says at one of its ticks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Time of the flight, s.
    pub t_s: f64,
    /// Attitude, body to earth; `None` before the filter has started.
    pub attitude: Option<Rotation>,
    /// Rate without the bias that the filter has found, body axes, rad/s; the last one where the gyro gave none.
    pub rate: Vector,
    /// Sensors that answer, as the board's `alive`.
    pub alive: u8,
}

impl Seen {
    /// What the board has lost that a flight needs, in words.
    #[must_use]
    pub fn lost(&self) -> Option<&'static str> {
        [(GYRO, "gyro"), (ACCEL, "accelerometer"), (MAG, "magnetometer")]
            .into_iter()
            .find(|(bit, _)| self.alive & bit == 0)
            .map(|(_, name)| name)
    }
}

/// The board on its vehicle.
#[derive(Debug)]
pub(super) struct Board {
    aboard: Aboard,
    /// Where all that is felt is kept for a board that comes later.
    kept: Option<Aboard>,
    clock: VirtualClock,
    sampler: Sampler<I2cBus>,
    ahrs: Ahrs,
    vibration: Vibration,
    lever: Vector,
    milliseconds: u64,
    rest_ms: u64,
    rate: Vector,
}

/// The magnetic field, gauss.
fn field(section: &ImuSection) -> [f64; 3] {
    section.field_ut.map(|ut| ut * GAUSS_PER_UT)
}

/// The board of a mission, for a run over the flight that `kept` will have seen: natively or the flash image.
pub(super) fn rig(section: &ImuSection, seed: u64, fault: BusFault) -> ImuRig {
    let aboard = Some(Aboard::recorded(field(section)));
    ImuRig { aboard, errors: errors(section.chips, seed), fault, ..ImuRig::default() }
}

/// Errors of the chips as the mission wants them.
fn errors(chips: Chips, seed: u64) -> Errors {
    let mut errors = match chips {
        Chips::Ideal => Errors { seed, ..Errors::default() },
        Chips::Drawn | Chips::Calibrated => Errors::drawn(seed),
    };
    if chips == Chips::Calibrated {
        for (i, chip) in errors.chips.iter_mut().enumerate() {
            let left = |value: f64, ideal: f64| ideal + LEFT_BY_CALIBRATION * (value - ideal);
            chip.matrix =
                core::array::from_fn(|r| core::array::from_fn(|c| left(chip.matrix[r][c], f64::from(u8::from(r == c)))));
            // the gyro's bias is the filter's to find
            if i > 0 {
                chip.bias = chip.bias.map(|b| left(b, 0.0));
                chip.bias_per_k = chip.bias_per_k.map(|b| left(b, 0.0));
            }
        }
    }
    errors
}

impl Board {
    /// A board that powers up before the flight, with the chips and the fault that `section` and `fault` say.
    pub(super) fn new(
        section: &ImuSection,
        airframe: &Airframe,
        blades: u32,
        seed: u64,
        fault: BusFault,
        kept: Option<Aboard>,
    ) -> Self {
        let clock = VirtualClock::default();
        let aboard = Aboard::live(field(section));
        let bus = I2cBus::new(clock.clone(), &ChipKind::ALL, aboard.clone(), &errors(section.chips, seed), fault);
        let shaking = Shaking { imbalance_gmm: section.imbalance_gmm, blade_pass: section.blade_pass, blades };
        Self {
            aboard,
            kept,
            sampler: Sampler::new(bus),
            clock,
            ahrs: Ahrs::new(AhrsConfig::default()),
            vibration: Vibration::new(airframe, shaking, seed),
            lever: Vector::from(section.lever_m),
            milliseconds: 0,
            rest_ms: (section.rest_s * 1000.0).round() as u64,
            rate: Vector::zeros(),
        }
    }

    /// The time before the flight, at rest in the attitude that it begins with, rotors as they turn then.
    pub(super) fn rest(&mut self, motion: &Motion, rotors: &[PlantState]) -> Vec<Seen> {
        let held = motion.attitude.inverse() * Vector::new(0.0, 0.0, -G);
        let still = Motion { rate: Vector::zeros(), ..*motion };
        (0..self.rest_ms).filter_map(|_| self.feel(&still, held, Vector::zeros(), rotors)).collect()
    }

    /// The next millisecond of the flight.
    pub(super) fn millisecond(&mut self, vehicle: &Vehicle) -> Option<Seen> {
        let (force, angular) = vehicle.felt();
        self.feel(vehicle.motion(), force, angular, vehicle.rotors())
    }

    fn feel(&mut self, motion: &Motion, force: Vector, angular: Vector, rotors: &[PlantState]) -> Option<Seen> {
        let (shaken, jitter) = self.vibration.step(rotors, 1.0e-3);
        let rate = motion.rate + jitter;
        let carried = angular.cross(&self.lever) + motion.rate.cross(&motion.rate.cross(&self.lever));
        let matrix = motion.attitude.to_rotation_matrix();
        let felt = Felt {
            attitude: core::array::from_fn(|r| core::array::from_fn(|c| matrix[(r, c)])),
            rate: rate.into(),
            force: ((force + carried + shaken) / G).into(),
            place: motion.place.into(),
        };
        self.aboard.feel(felt);
        self.kept.iter().for_each(|kept| kept.feel(felt));
        self.milliseconds += 1;
        self.clock.advance_to(self.milliseconds * 1_000_000);
        self.milliseconds.is_multiple_of(TICK_MS).then(|| self.tick())
    }

    fn tick(&mut self) -> Seen {
        let now = self.clock.ticks();
        let readings = self.sampler.read();
        let out = self.ahrs.tick(&Inputs { now, readings });
        let filter = self.ahrs.filter();
        if let Some(rate) = out.calibrated.gyro {
            let unbiased = rate - filter.bias();
            self.rate = Vector::new(f64::from(unbiased.x), f64::from(unbiased.y), f64::from(unbiased.z));
        }
        let attitude = filter.is_started().then(|| from_quaternion(filter.quaternion().map(f64::from)));
        let t_s = (self.milliseconds as f64 - self.rest_ms as f64) * 1.0e-3;
        Seen { t_s, attitude, rate: self.rate, alive: readings.alive & !out.stuck }
    }
}

/// Angle between what the board says and the truth: that of the vertical, and that of the heading about it, rad.
#[must_use]
pub fn apart(seen: &Rotation, truth: &Rotation) -> (f64, f64) {
    let turned = seen * truth.inverse();
    let down = turned * Vector::z();
    let north = turned * Vector::x();
    (libm::acos(down.z.clamp(-1.0, 1.0)), libm::atan2(north.y, north.x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::attitude::from_euler;

    #[test]
    fn tilt_and_heading_apart() {
        let truth = from_euler([0.4, -0.7, 2.0]);
        let (tilt, heading) = apart(&(from_euler([0.0, 0.0, 0.1]) * truth), &truth);
        assert!(tilt < 1e-7 && (heading - 0.1).abs() < 1e-9);
        let (tilt, heading) = apart(&(from_euler([0.05, 0.0, 0.0]) * truth), &truth);
        assert!((tilt - 0.05).abs() < 1e-9 && heading.abs() < 1e-9);
    }
}
