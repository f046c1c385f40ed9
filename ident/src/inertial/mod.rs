//! Closing the loop on an inertial unit: what the predicted field, gravity and rate leave over, and why.
//!
//! What it is: the declared model says that the field is constant in earth axes, that the accelerometer feels gravity and a
//! constant offset alone, and that the gyro's offset is constant. The attitude comes from gyro and accelerometer without the
//! magnetometer, so that the field has no part in its own prediction. What each of the three sensors leaves over is traced to a cause
//! of its own library (`effects/`), scored on stretches of the run that took no part in the fit.
//! What can go wrong: a log without rest shows no gyro offset, one without turning no hard iron (nothing is named then); the
//! attitude itself is off by some tenths of a degree, and what is smaller than that is not named.
//! Units: s, rad/s, m/s^2 (specific force), uT; earth axes north, east, down.
//! Reference: specification `closing-the-loop.md`, "Inertial", and `formats.md`, "Verdict".

mod account;
mod effects;
mod field;
mod force;
mod least;
mod model;
mod noise;
mod rate;
mod search;
mod shown;
mod smooth;
mod trace;
mod unknown;
mod vibration;

pub use account::{Closed, Sensor};
pub use model::{Added, FORMAT as MODEL_FORMAT, InertialModel, Part, Predicted};

use nalgebra::{Matrix3, Vector3};

/// A recording of an inertial unit, row by row; a missing reading is not a number.
#[derive(Debug, Clone, Default)]
pub struct Recording {
    /// Name of the log.
    pub name: String,
    /// Times, s, strictly increasing.
    pub t: Vec<f64>,
    /// Rates, rad/s.
    pub gyro: Vec<Vector3<f64>>,
    /// Specific force, m/s^2.
    pub accel: Vec<Vector3<f64>>,
    /// Field, uT; empty without magnetometer.
    pub mag: Vec<Vector3<f64>>,
    /// Temperature, degC; empty where the log has none.
    pub temperature: Vec<f64>,
    /// Current of the motors beside it, A; empty where the log has none.
    pub current: Vec<f64>,
}

/// What an attitude filter that saw gyro and accelerometer alone says of a recording, row by row.
#[derive(Debug, Clone, Default)]
pub struct Attitude {
    /// Body to earth; not a number before it has started.
    pub to_earth: Vec<Matrix3<f64>>,
    /// The body rests.
    pub rest: Vec<bool>,
}

/// A filter: rates in, attitude out. It is asked again with rates from which a found error of the gyro was taken.
pub type Filter<'f> = dyn Fn(&[Vector3<f64>]) -> Attitude + 'f;

/// Shortest log, s: below it nothing can be left out and predicted.
pub const SHORTEST_S: f64 = 20.0;

/// Why a recording cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InertialError {
    /// Too short.
    #[error("{name}: {seconds:.1} s long; expected at least {SHORTEST_S} s, to leave stretches out and predict them")]
    Short {
        /// Log.
        name: String,
        /// Its length.
        seconds: f64,
    },
    /// The filter never started.
    #[error("{name}: no attitude; expected usable readings in columns ax,ay,az")]
    NoAttitude {
        /// Log.
        name: String,
    },
    /// A model file that cannot be taken.
    #[error("{file}: {reason}; expected a model written by `quadrig close-loop` on an attitude log")]
    Model {
        /// File and line.
        file: String,
        /// What is wrong.
        reason: String,
    },
    /// Another recording than the model's.
    #[error("{name}: not the recording of the model; expected {source_name}: heading and drift are that recording's own")]
    Other {
        /// Log.
        name: String,
        /// Log of the model.
        source_name: String,
    },
}

/// First and last time of a recording, s.
fn span(recording: &Recording) -> [f64; 2] {
    [recording.t.first(), recording.t.last()].map(|t| t.copied().unwrap_or(0.0))
}

/// Residual, cause, and error before and after.
///
/// # Errors
/// A log that is too short, or on which the filter never starts.
pub fn close(recording: &Recording, filter: &Filter<'_>, progress: &mut dyn FnMut(f64)) -> Result<Closed, InertialError> {
    let seconds = recording.t.last().copied().unwrap_or(0.0) - recording.t.first().copied().unwrap_or(0.0);
    if seconds < SHORTEST_S {
        return Err(InertialError::Short { name: recording.name.clone(), seconds });
    }
    let attitude = filter(&recording.gyro);
    if !attitude.to_earth.iter().any(|m| m.m11.is_finite()) {
        return Err(InertialError::NoAttitude { name: recording.name.clone() });
    }
    progress(0.1);
    let (rate, corrected) = rate::trace_rate(recording, &attitude);
    let attitude = match &corrected {
        Some(rates) => filter(rates),
        None => attitude,
    };
    progress(0.2);
    let force = force::trace_force(recording, &attitude);
    progress(0.5);
    let field = field::trace_field(recording, &attitude);
    progress(1.0);
    Ok(account::account(recording, [rate, force, field].into_iter().flatten().collect()))
}
