//! What may be wrong, from first principles.
//!
//! What it is: each cause changes what the three sensors see of the truth at an instant; sizes are in the sensors' own terms.
//! What can go wrong: nothing here fails.
//! Units: as the fields say.
//! Reference: field of a dipole, Jackson, *Classical Electrodynamics*, section 5.6; Newton's law of cooling.

use super::V;
use super::body::{Attitude, to_body};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// What is hidden in a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// Nothing.
    Clean,
    /// Something magnetic is stuck to the sensor during the run.
    HardIron,
    /// Iron beside the sensor, from the beginning.
    SoftIron,
    /// A magnet lies in the room.
    StationaryMagnet,
    /// The hand carries the sensor to and fro.
    LinearAcceleration,
    /// A motor shakes the board for a while.
    Vibration,
    /// The gyro's offset jumps.
    GyroBias,
    /// The gyro's offset follows the temperature.
    GyroTemperature,
    /// The magnetometer is late.
    ChannelDelay,
    /// Not in the library: the magnetometer clips.
    Clipped,
    /// Not in the library: bursts from a transmitter on one axis of the magnetometer.
    Bursts,
}

/// The known ones.
pub const CAUSES: [Cause; 8] = [
    Cause::HardIron,
    Cause::SoftIron,
    Cause::StationaryMagnet,
    Cause::LinearAcceleration,
    Cause::Vibration,
    Cause::GyroBias,
    Cause::GyroTemperature,
    Cause::ChannelDelay,
];

/// Those that the library does not know.
pub const UNKNOWN: [Cause; 2] = [Cause::Clipped, Cause::Bursts];

impl Cause {
    /// Name in a verdict; empty for none.
    #[must_use]
    pub fn id(self) -> &'static str {
        match self {
            Self::Clean => "",
            Self::HardIron => "hard_iron",
            Self::SoftIron => "soft_iron",
            Self::StationaryMagnet => "stationary_magnet",
            Self::LinearAcceleration => "linear_acceleration",
            Self::Vibration => "vibration",
            Self::GyroBias => "gyro_bias",
            Self::GyroTemperature => "gyro_temperature",
            Self::ChannelDelay => "channel_delay",
            Self::Clipped | Self::Bursts => "unknown",
        }
    }
}

/// The instant as it is.
pub(super) struct Truth {
    pub(super) t: f64,
    pub(super) rate: V,
    pub(super) force: V,
    pub(super) field: V,
    pub(super) place: V,
    pub(super) attitude: Attitude,
    /// Attitude 30 ms ago.
    pub(super) before: Attitude,
    pub(super) earth: V,
}

/// The instant as the sensors see it, but for noise.
pub(super) struct Seen {
    pub(super) gyro: V,
    pub(super) accel: V,
    pub(super) mag: V,
    pub(super) celsius: f64,
}

/// A cause with its numbers.
pub(super) struct Fault {
    cause: Cause,
    size: f64,
    vector: V,
    matrix: [V; 3],
    from: f64,
    frequency: f64,
    phase: f64,
    /// Bursts: when they start and how strong they are.
    bursts: Vec<(f64, f64)>,
}

fn direction(chance: &mut ChaCha8Rng) -> V {
    loop {
        let v: V = std::array::from_fn(|_| chance.random_range(-1.0..1.0));
        let n = v.iter().map(|c| c * c).sum::<f64>().sqrt();
        if (0.2..1.0).contains(&n) {
            return v.map(|c| c / n);
        }
    }
}

impl Fault {
    pub(super) fn draw(cause: Cause, size: usize, length: f64, chance: &mut ChaCha8Rng) -> Self {
        let step = (size.clamp(1, 3) - 1) as i32;
        let base = match cause {
            Cause::HardIron => 1.5 * 2f64.powi(step),
            Cause::SoftIron => 0.04 * 2f64.powi(step),
            Cause::StationaryMagnet => 6.0 * 2f64.powi(step),
            Cause::LinearAcceleration => 0.2 * 2f64.powi(step),
            Cause::Vibration => 0.25 * 2f64.powi(step),
            Cause::GyroBias => 0.002 * 3f64.powi(step),
            Cause::GyroTemperature => 2e-4 * 3f64.powi(step),
            Cause::ChannelDelay => 0.5 * 2f64.powi(step),
            Cause::Clipped => 0.85 - 0.12 * f64::from(step),
            Cause::Bursts => 8.0 * 2f64.powi(step),
            Cause::Clean => 0.0,
        };
        let vector = direction(chance);
        let matrix = std::array::from_fn(|_| std::array::from_fn(|_| chance.random_range(-1.0..1.0)));
        let from = chance.random_range(0.3..0.7) * length;
        let frequency = chance.random_range(25.0..90.0);
        let phase = chance.random_range(0.0..TAU);
        let bursts = (0..60).map(|_| (chance.random_range(0.0..length), chance.random_range(-1.0..1.0))).collect();
        Self { cause, size: base, vector, matrix, from, frequency, phase, bursts }
    }

    /// What a verdict should say of it: names, and values in its units. A stationary magnet and a hand have no such number: what the
    /// verdict gives of them depends on the run.
    pub(super) fn truth(&self) -> Vec<(String, f64)> {
        let axes = |name: &str| -> Vec<(String, f64)> {
            ["x", "y", "z"].iter().zip(self.vector).map(|(axis, v)| (format!("{name}_{axis}"), self.size * v)).collect()
        };
        match self.cause {
            Cause::HardIron => [axes("offset"), vec![("t0".to_owned(), self.from)]].concat(),
            Cause::GyroBias => [axes("step"), vec![("t0".to_owned(), self.from)]].concat(),
            Cause::GyroTemperature => axes("per_kelvin"),
            Cause::SoftIron => self.iron(),
            Cause::ChannelDelay => vec![("delay".to_owned(), 0.03 * self.size)],
            // forty of ninety seconds of a sinusoid, spread over three axes
            Cause::Vibration => {
                let rms = self.size * 1.73 * (0.5 * 40.0 / 90.0 / 3.0f64).sqrt();
                vec![("frequency".to_owned(), self.frequency), ("rms".to_owned(), rms)]
            }
            _ => Vec::new(),
        }
    }

    /// Soft iron without what is one with the size of the field.
    fn iron(&self) -> Vec<(String, f64)> {
        let common = 1.0 + self.size * (0..3).map(|k| self.matrix[k][k]).sum::<f64>() / 3.0;
        let names = ["x", "y", "z"];
        let entry = |i: usize, j: usize| {
            let own = if i == j { 1.0 } else { 0.0 };
            (format!("s_{}{}", names[i], names[j]), (own + self.size * self.matrix[i][j]) / common - own)
        };
        [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1), (0, 0), (1, 1)].map(|(i, j)| entry(i, j)).to_vec()
    }

    pub(super) fn seen(&mut self, truth: &Truth) -> Seen {
        let t = truth.t;
        let (mut gyro, mut accel, mut mag) = (truth.rate, truth.force, truth.field);
        let celsius = 22.0 + 14.0 * (1.0 - (-t / 35.0).exp());
        let later = if t >= self.from { 1.0 } else { 0.0 };
        match self.cause {
            Cause::Clean => {}
            Cause::HardIron => mag = std::array::from_fn(|k| mag[k] + later * self.size * self.vector[k]),
            Cause::SoftIron => {
                mag =
                    std::array::from_fn(|i| mag[i] + self.size * (0..3).map(|j| self.matrix[i][j] * truth.field[j]).sum::<f64>());
            }
            Cause::StationaryMagnet => {
                // a dipole half a metre under the path's middle, as strong as the size says at the nearest
                let away: V = std::array::from_fn(|k| truth.place[k] - [0.3, -0.2, 0.7][k]);
                let r = away.iter().map(|c| c * c).sum::<f64>().sqrt();
                let along: f64 = (0..3).map(|k| self.vector[k] * away[k] / r).sum();
                let strength = self.size * 0.5f64.powi(3) / r.powi(3);
                let dipole: V = std::array::from_fn(|k| strength * (3.0 * along * away[k] / r - self.vector[k]) / 2.0);
                let there = to_body(&truth.attitude, dipole);
                mag = std::array::from_fn(|k| mag[k] + there[k]);
            }
            // the hand's swing has one m/s^2 of amplitude; the size scales what it carries
            Cause::LinearAcceleration => {
                let still = to_body(&truth.attitude, [0.0, 0.0, -9.81]);
                accel = std::array::from_fn(|k| still[k] + 2.0 * self.size * (accel[k] - still[k]));
            }
            Cause::Vibration => {
                let runs = if (self.from - 20.0..self.from + 20.0).contains(&t) { 1.0 } else { 0.0 };
                // the motor's speed wanders by a percent
                let turned = TAU * self.frequency * (t + 0.01 / 1.3 * (1.3 * t).sin()) + self.phase;
                accel = std::array::from_fn(|k| accel[k] + runs * self.size * self.vector[k] * 1.73 * turned.sin());
            }
            Cause::GyroBias => gyro = std::array::from_fn(|k| gyro[k] + later * self.size * self.vector[k]),
            Cause::GyroTemperature => gyro = std::array::from_fn(|k| gyro[k] + self.size * self.vector[k] * (celsius - 22.0)),
            Cause::ChannelDelay => {
                // exactly the field of a moment ago, between now and 30 ms before
                let old = to_body(&truth.before, truth.earth);
                mag = std::array::from_fn(|k| mag[k] + self.size * (old[k] - mag[k]));
            }
            Cause::Clipped => {
                let most = self.size * truth.earth.iter().map(|c| c * c).sum::<f64>().sqrt();
                mag = mag.map(|m| m.clamp(-most, most));
            }
            Cause::Bursts => {
                let on: f64 = self.bursts.iter().filter(|(at, _)| (*at..at + 0.4).contains(&t)).map(|(_, s)| s).sum();
                mag[1] += self.size * on;
            }
        }
        Seen { gyro, accel, mag, celsius }
    }
}
