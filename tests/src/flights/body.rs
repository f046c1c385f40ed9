//! The generator's own rigid body.
//!
//! What it is: position and velocity in earth axes, attitude as a rotation matrix that is turned by the exact rotation of a step, rate in body
//! axes; one midpoint step at a time.
//! What can go wrong: the matrix is made orthonormal again after each step.
//! Units: SI; earth NED, body FRD.
//! Reference: Rodrigues 1840 (finite rotations); midpoint rule, order 2.

use super::{G, V, add, cross, length, times};

/// Rows of the rotation from body to earth.
pub type R = [V; 3];

/// A state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Place, m.
    pub place: V,
    /// Velocity, m/s.
    pub velocity: V,
    /// Body to earth.
    pub turn: R,
    /// Rate, rad/s.
    pub rate: V,
}

impl State {
    /// At rest at a place, nose to the north.
    #[must_use]
    pub fn still(place: V) -> Self {
        Self { place, velocity: [0.0; 3], turn: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], rate: [0.0; 3] }
    }
}

/// A vector of the body in earth axes.
#[must_use]
pub fn to_earth(r: &R, v: V) -> V {
    r.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// A vector of the earth in body axes.
#[must_use]
pub fn to_body(r: &R, v: V) -> V {
    std::array::from_fn(|j| r[0][j] * v[0] + r[1][j] * v[1] + r[2][j] * v[2])
}

/// Product of two rotations.
#[must_use]
pub fn product(a: &R, b: &R) -> R {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j]))
}

/// Rotation by a vector (axis times angle).
#[must_use]
pub fn rotation(v: V) -> R {
    let angle = length(v);
    let (s, c) = if angle < 1e-9 { (1.0, 0.5) } else { (angle.sin() / angle, (1.0 - angle.cos()) / (angle * angle)) };
    let k: R = [[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]];
    let square = product(&k, &k);
    std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j)) + s * k[i][j] + c * square[i][j]))
}

/// Vector of a rotation, for angles below half a turn.
#[must_use]
pub fn vector(r: &R) -> V {
    let cosine = (0.5 * (r[0][0] + r[1][1] + r[2][2] - 1.0)).clamp(-1.0, 1.0);
    let angle = cosine.acos();
    let scale = if angle < 1e-7 { 0.5 } else { 0.5 * angle / angle.sin() };
    times(scale, [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]])
}

/// Quaternion w, x, y, z of a rotation.
#[must_use]
pub fn quaternion(r: &R) -> [f64; 4] {
    let v = vector(r);
    let angle = length(v);
    let scale = if angle < 1e-9 { 0.5 } else { (0.5 * angle).sin() / angle };
    [(0.5 * angle).cos(), scale * v[0], scale * v[1], scale * v[2]]
}

/// Force without weight, N, and moment, N.m, in body axes.
pub type Load = (V, V);

/// Angular acceleration under a moment, with the angular momentum of what turns inside.
#[must_use]
pub fn angular(inertia: V, rate: V, moment: V, inner: f64) -> V {
    let momentum = [inertia[0] * rate[0], inertia[1] * rate[1], inertia[2] * rate[2] + inner];
    let gyration = cross(rate, momentum);
    std::array::from_fn(|k| (moment[k] - gyration[k]) / inertia[k])
}

/// The state after `dt`; `load` tells what acts, `inner` is the angular momentum of the rotors about z.
pub fn step(s: &State, dt: f64, mass: f64, inertia: V, inner: f64, load: &mut dyn FnMut(&State) -> Load) -> State {
    let slope = |at: &State, (force, moment): Load| -> (V, V) {
        let pull = add(times(1.0 / mass, to_earth(&at.turn, force)), [0.0, 0.0, G]);
        (pull, angular(inertia, at.rate, moment, inner))
    };
    let moved = |at: &State, pull: V, turning: V, dt: f64| State {
        place: add(s.place, times(dt, at.velocity)),
        velocity: add(s.velocity, times(dt, pull)),
        turn: product(&s.turn, &rotation(times(dt, at.rate))),
        rate: add(s.rate, times(dt, turning)),
    };
    let first = slope(s, load(s));
    let middle = moved(s, first.0, first.1, 0.5 * dt);
    let second = slope(&middle, load(&middle));
    let mut out = moved(&middle, second.0, second.1, dt);
    orthonormal(&mut out.turn);
    out
}

fn orthonormal(r: &mut R) {
    let unit = |v: V| times(1.0 / length(v), v);
    let x = unit(r[0]);
    let along = r[1][0] * x[0] + r[1][1] * x[1] + r[1][2] * x[2];
    let y = unit(add(r[1], times(-along, x)));
    *r = [x, y, cross(x, y)];
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A free body keeps its angular momentum in earth axes and its energy; it falls by g t^2 / 2.
    #[test]
    fn a_free_body_keeps_what_it_has() {
        let inertia = [0.01, 0.014, 0.019];
        let mut s = State { rate: [3.0, -2.0, 1.0], ..State::still([0.0; 3]) };
        let momentum = |s: &State| to_earth(&s.turn, [0, 1, 2].map(|k| inertia[k] * s.rate[k]));
        let energy = |s: &State| (0..3).map(|k| inertia[k] * s.rate[k] * s.rate[k]).sum::<f64>();
        let (m0, e0) = (momentum(&s), energy(&s));
        for _ in 0..2000 {
            s = step(&s, 1e-3, 0.7, inertia, 0.0, &mut |_| ([0.0; 3], [0.0; 3]));
        }
        let m1 = momentum(&s);
        assert!((0..3).all(|k| (m1[k] - m0[k]).abs() < 1e-4 * length(m0)), "{m0:?} {m1:?}");
        assert!((energy(&s) / e0 - 1.0).abs() < 1e-4);
        assert!((s.place[2] - 0.5 * G * 4.0).abs() < 1e-6);
    }

    #[test]
    fn rotations_go_there_and_back() {
        let v = [0.3, -1.1, 0.7];
        let r = rotation(v);
        assert!((0..3).all(|k| (vector(&r)[k] - v[k]).abs() < 1e-9));
        let q = quaternion(&r);
        assert!((q.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-12);
        let back = to_body(&r, to_earth(&r, v));
        assert!((0..3).all(|k| (back[k] - v[k]).abs() < 1e-12));
    }
}
