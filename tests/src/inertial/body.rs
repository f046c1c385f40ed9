//! A hand that turns and carries a sensor.
//!
//! What it is: attitude as three angles that swing, with rests at both ends and in between; place as a swing that starts and
//! ends at zero speed. Rates and accelerations are differences of attitude and place over a tenth of a millisecond.
//! What can go wrong: nothing; every function is smooth but for the ramps into and out of rest, which last half a second.
//! Units: s, rad, m; earth axes north, east, down.
//! Reference: rotation by yaw, pitch, roll, R = Rz Ry Rx.

use super::V;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// Body to earth.
pub(super) type Attitude = [[f64; 3]; 3];

/// Where it is and how it moves at an instant.
pub(super) struct State {
    pub(super) attitude: Attitude,
    /// Body axes.
    pub(super) rate: V,
    /// Earth axes.
    pub(super) acceleration: V,
    pub(super) place: V,
}

/// A motion.
pub(super) struct Body {
    /// For each angle: offset, two amplitudes, two frequencies, two phases.
    angles: [[f64; 7]; 3],
    /// For each direction: amplitude, frequency, phase.
    carried: [[f64; 3]; 3],
    /// Walks along a slow path of this size as well.
    walk: f64,
    /// Rests: from, to.
    rests: Vec<(f64, f64)>,
}

/// Half of the interval over which motion is differentiated, s.
const H: f64 = 1e-4;

/// Earth axes to body axes.
pub(super) fn to_body(attitude: &Attitude, v: V) -> V {
    std::array::from_fn(|j| (0..3).map(|i| attitude[i][j] * v[i]).sum())
}

impl Body {
    pub(super) fn draw(chance: &mut ChaCha8Rng, length: f64, shaken: bool, walks: bool) -> Self {
        let angles = std::array::from_fn(|k| {
            let big = [1.2, 0.9, 2.5][k];
            [
                chance.random_range(-0.5..0.5),
                chance.random_range(0.6..1.0) * big,
                chance.random_range(0.2..0.4) * big,
                chance.random_range(0.08..0.2),
                chance.random_range(0.25..0.5),
                chance.random_range(0.0..TAU),
                chance.random_range(0.0..TAU),
            ]
        });
        let carried = std::array::from_fn(|_| {
            let reach = if shaken { 1.0 } else { 0.0 };
            [reach, chance.random_range(0.5..1.6), chance.random_range(0.0..TAU)]
        });
        let mut rests = vec![(-1.0, chance.random_range(5.0..9.0))];
        for k in 0..chance.random_range(1..4) {
            // one in each third, so that none overlap
            let from = 14.0 + (length - 28.0) / 3.0 * (f64::from(k) + chance.random_range(0.0..0.6));
            rests.push((from, from + chance.random_range(4.0..7.0)));
        }
        rests.push((length - chance.random_range(4.0..8.0), length + 1.0));
        Self { angles, carried, walk: if walks { 1.0 } else { 0.0 }, rests }
    }

    /// A clock that stands still in rests, s: the motion runs on it.
    fn clock(&self, t: f64) -> f64 {
        // time lost in each rest, with ramps of half a second at both sides
        let lost = |(from, to): &(f64, f64)| {
            let ramp = |x: f64| {
                let s = (x / 0.5).clamp(0.0, 1.0);
                // integral of the smooth step 3 s^2 - 2 s^3
                0.5 * (s.powi(3) - 0.5 * s.powi(4)) + (x - 0.5).max(0.0)
            };
            ramp(t - from) - ramp(t - to)
        };
        t - self.rests.iter().map(lost).sum::<f64>()
    }

    fn attitude(&self, t: f64) -> Attitude {
        let c = self.clock(t);
        let [x, y, z] = self.angles.map(|[o, a, b, f, g, p, q]| o + a * (TAU * f * c + p).sin() + b * (TAU * g * c + q).sin());
        let ((sx, cx), (sy, cy), (sz, cz)) = (x.sin_cos(), y.sin_cos(), z.sin_cos());
        [
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ]
    }

    fn place(&self, t: f64) -> V {
        let c = self.clock(t);
        std::array::from_fn(|k| {
            let [reach, f, p] = self.carried[k];
            let w = TAU * f;
            // one metre a second squared of amplitude, whatever the frequency
            reach * ((w * c + p).sin() - p.sin()) / (w * w)
                + self.walk * [0.9, 0.6, 0.2][k] * (TAU * 0.045 * (c + 3.0 * k as f64)).sin()
        })
    }

    pub(super) fn at(&self, t: f64) -> State {
        let (a, b) = (self.attitude(t - H), self.attitude(t + H));
        let now = self.attitude(t);
        // R^T dR/dt is the cross product with the rate
        let turn = |i: usize, j: usize| -> f64 { (0..3).map(|k| now[k][i] * (b[k][j] - a[k][j])).sum::<f64>() / (2.0 * H) };
        let rate = [turn(2, 1), turn(0, 2), turn(1, 0)];
        let wide = 20.0 * H;
        let (p, q, r) = (self.place(t - wide), self.place(t), self.place(t + wide));
        let acceleration = std::array::from_fn(|k| (p[k] - 2.0 * q[k] + r[k]) / (wide * wide));
        State { attitude: now, rate, acceleration, place: q }
    }
}
