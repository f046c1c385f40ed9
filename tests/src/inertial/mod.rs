//! Simulated recordings of an inertial unit with one hidden cause, written without the tracer's code.
//!
//! What it is: a hand that turns and carries a sensor, the room's field, and what is wrong with sensor or room, each computed from
//! its own physics (a dipole at a place, a metal case at a temperature that climbs, a motor that shakes the board); quantised
//! readings as rows of an attitude log.
//! What can go wrong: a seed whose motion happens to show nothing of the cause is still counted.
//! Units: s, rad/s, m/s^2, uT, degC; earth axes north, east, down; body axes with +z down when level.
//! Reference: specification `closing-the-loop.md`, "Inertial" and "What counts as proof".

mod ask;
mod body;
mod cause;
mod coverage;
pub mod hidden;
mod score;

pub use ask::{Answer, ask};
pub use cause::{CAUSES, Cause, UNKNOWN};
pub use coverage::Coverage;
pub use score::{Tally, judged, right, wilson};

use body::Body;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt::Write;

/// Seeds from here on judge; below they are for tuning.
pub const JUDGING: u64 = 1_000;

/// Rate of the rows, Hz.
const RATE: f64 = 200.0;
/// Length, s.
const LENGTH_S: f64 = 90.0;

type V = [f64; 3];

/// What the hidden cause is, beside the log.
#[derive(Debug, Clone)]
pub struct Simulated {
    /// The log's text.
    pub csv: String,
    /// Parameters of the cause under the names and in the units of a verdict.
    pub truth: Vec<(String, f64)>,
}

/// A recording with a cause of a size (1 small, 2 middle, 3 large) or none.
#[must_use]
pub fn simulate(cause: Cause, size: usize, seed: u64) -> Simulated {
    let mut chance = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(0x9E37_79B9).wrapping_add(cause as u64 * 131 + size as u64));
    let body = Body::draw(&mut chance, LENGTH_S, cause == Cause::LinearAcceleration, cause == Cause::StationaryMagnet);
    let mut fault = cause::Fault::draw(cause, size, LENGTH_S, &mut chance);
    let dip: f64 = chance.random_range(0.9..1.2);
    let strength: f64 = chance.random_range(42.0..52.0);
    let earth = [strength * dip.cos(), 0.0, strength * dip.sin()];
    let gyro_offset: V = std::array::from_fn(|_| chance.random_range(-0.02..0.02));
    let warm = cause == Cause::GyroTemperature;
    let mut csv = String::from("t_s,gx,gy,gz,ax,ay,az,mx,my,mz");
    csv.push_str(if warm { ",temp_c\n" } else { "\n" });
    let mut held = [0.0; 3];
    for n in 0..(RATE * LENGTH_S) as usize {
        let t = n as f64 / RATE;
        let state = body.at(t);
        let truth = cause::Truth {
            t,
            rate: state.rate,
            force: body::to_body(&state.attitude, std::array::from_fn(|k| state.acceleration[k] - [0.0, 0.0, 9.81][k])),
            field: body::to_body(&state.attitude, earth),
            place: state.place,
            attitude: state.attitude,
            before: body.at((t - 0.03).max(0.0)).attitude,
            earth,
        };
        let mut seen = fault.seen(&truth);
        let mut normal = || -> f64 { (0..12).map(|_| chance.random_range(-0.5..0.5)).sum() };
        for (k, offset) in gyro_offset.iter().enumerate() {
            seen.gyro[k] += offset + 0.0015 * normal();
            seen.accel[k] += 0.04 * normal();
            seen.mag[k] += 0.25 * normal();
        }
        if n % 3 == 0 {
            held = seen.mag.map(|m| (m / 0.1).round() * 0.1);
        }
        let _ = write!(csv, "{t:.4}");
        for g in seen.gyro {
            let _ = write!(csv, ",{:.6}", (g / 0.001).round() * 0.001);
        }
        for a in seen.accel {
            let _ = write!(csv, ",{:.4}", (a / 0.012).round() * 0.012);
        }
        for m in held {
            let _ = write!(csv, ",{m:.2}");
        }
        if warm {
            let _ = write!(csv, ",{:.2}", seen.celsius);
        }
        csv.push('\n');
    }
    Simulated { csv, truth: fault.truth() }
}
