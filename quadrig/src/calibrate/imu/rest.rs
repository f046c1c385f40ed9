//! Stretches of rest in a recording.
//!
//! What it is: stretches of at least a second whose readings stay near their mean, cut into pieces of one second.
//! What can go wrong: a slow steady turn looks like rest to the gyro; the accelerometer's change between pieces then shows it.
//! Units: s, rad/s, m/s^2, uT.
//! Reference: Laidig & Seel 2023, section 3.4, for the thresholds.

use crate::ahrs::imu_log::{ImuLog, Row};
use dcm::Vec3;

/// Largest standard deviation of a gyro at rest, rad/s: 1 deg/s.
pub(super) const GYRO_NOISE: f32 = 0.0175;
/// Largest distance of a specific force from the mean of its piece, m/s^2.
const FORCE: f32 = 0.5;
/// Largest distance of a rate from the mean of its piece, rad/s: 2 deg/s.
const RATE: f32 = 0.035;
/// Length of a piece, s.
const PIECE: f64 = 1.0;

/// A piece of rest.
#[derive(Debug, Clone)]
pub(super) struct Rest {
    /// Its rates.
    pub(super) rates: Vec<Vec3>,
    /// Mean specific force.
    pub(super) force: Vec3,
    /// Standard error of that mean, the largest axis.
    pub(super) force_sigma: f32,
    /// Mean field.
    pub(super) field: Option<Vec3>,
}

/// Every piece of rest, in order.
pub(super) fn find(log: &ImuLog) -> Vec<Rest> {
    let mut rests = Vec::new();
    let mut rows = log.rows.as_slice();
    while let Some(first) = rows.first() {
        let n = rows.partition_point(|r| r.t < first.t + PIECE);
        let (piece, tail) = rows.split_at(n.max(1));
        rows = tail;
        if tail.is_empty() {
            break; // shorter than a piece
        }
        rests.extend(rest(piece));
    }
    rests
}

/// Length of a vector.
pub(super) fn length(v: &Vec3) -> f32 {
    v.dot(v).sqrt()
}

fn mean(values: &[Vec3]) -> Vec3 {
    values.iter().sum::<Vec3>() / values.len() as f32
}

fn rest(piece: &[Row]) -> Option<Rest> {
    let rates: Vec<Vec3> = piece.iter().filter_map(|r| r.gyro).collect();
    let forces: Vec<Vec3> = piece.iter().filter_map(|r| r.accel).collect();
    let fields: Vec<Vec3> = piece.iter().filter_map(|r| r.mag).collect();
    if rates.len() < 10 || forces.len() < 10 {
        return None;
    }
    let (rate, force) = (mean(&rates), mean(&forces));
    let still = rates.iter().all(|w| length(&(w - rate)) < RATE) && forces.iter().all(|f| length(&(f - force)) < FORCE);
    let scatter = (forces.iter().map(|f| length(&(f - force)).powi(2)).sum::<f32>() / 3.0 / forces.len() as f32).sqrt();
    still.then(|| Rest {
        rates,
        force,
        force_sigma: scatter / (forces.len() as f32).sqrt(),
        field: (!fields.is_empty()).then(|| mean(&fields)),
    })
}
