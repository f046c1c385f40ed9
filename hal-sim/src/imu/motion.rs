//! A body that turns at a constant rate, rocks about an axis of its own, rests at times, is shaken along a line and carried about.
//!
//! What it is: attitude, rate, specific force and magnetic field in body axes at any instant, in closed form.
//! What can go wrong: nothing here fails; attitudes are products of rotations of known angles, so nothing integrates and nothing drifts.
//! Units: rad, rad/s, m, Hz, gauss; g (9.80665 m/s^2) for specific force; ns since power-up; earth frame NED, body frame FRD.
//! Reference: Rodrigues' rotation formula; errata 4.3 (specific force f = a - g); rigid-body acceleration
//! a_p = a_0 + w x (w x r) (Goldstein, *Classical Mechanics*, section 4.10).

use core::f64::consts::TAU;

/// Standard gravity, m/s^2 (CGPM 1901).
pub(super) const G: f64 = 9.806_65;

/// How the body moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Roll, pitch and yaw at time 0, rad; the body turns from there.
    pub start: [f64; 3],
    /// Constant rate about axes that rock along, rad/s.
    pub rate: [f64; 3],
    /// Axis and amplitude of the rocking, body axes, rad.
    pub rock: [f64; 3],
    /// Its frequency, Hz.
    pub rock_hz: f64,
    /// Magnetic field, earth NED, gauss.
    pub field: [f64; 3],
    /// Amplitude of the shaking, earth NED, m.
    pub shake_m: [f64; 3],
    /// Its frequency, Hz.
    pub shake_hz: f64,
    /// Place of the accelerometer from the centre of rotation, body axes, m.
    pub lever_m: [f64; 3],
    /// Turning and rocking pause this long at the beginning of each period, s, and so often, s; 0 for never.
    pub pause_s: [f64; 2],
    /// Half widths of a slow round through the room, earth NED, m: an ellipse that goes up and down twice.
    pub walk_m: [f64; 3],
    /// Rounds in a second, Hz.
    pub walk_hz: f64,
}

/// Time in which turning begins and ends, s.
const RAMP_S: f64 = 1.0;

type Matrix = [[f64; 3]; 3];

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Rotation by `angle` about the unit vector `axis`.
fn turn([x, y, z]: [f64; 3], angle: f64) -> Matrix {
    let (s, c) = libm::sincos(angle);
    let u: Matrix = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    let uu = product(&u, &u);
    core::array::from_fn(|i| core::array::from_fn(|j| f64::from(u8::from(i == j)) + s * u[i][j] + (1.0 - c) * uu[i][j]))
}

/// Length of a vector, and the vector at length one; `None` of one that has none.
fn length_and_axis(v: [f64; 3]) -> Option<(f64, [f64; 3])> {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    (length > 0.0).then(|| (length, v.map(|x| x / length)))
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

impl Motion {
    /// Level, at rest, body x to magnetic north, in the field of central Europe.
    pub const LEVEL: Self = Self {
        start: [0.0; 3],
        rate: [0.0; 3],
        rock: [0.0; 3],
        rock_hz: 0.0,
        field: [0.2, 0.0, 0.44],
        shake_m: [0.0; 3],
        shake_hz: 0.0,
        lever_m: [0.0; 3],
        pause_s: [0.0; 2],
        walk_m: [0.0; 3],
        walk_hz: 0.0,
    };

    /// The clock of turning and rocking, which stands still in pauses: its time, s, its pace and the change of that, 1/s.
    fn clock(&self, at_ns: u64) -> [f64; 3] {
        let t = at_ns as f64 * 1e-9;
        let [rest, every] = self.pause_s;
        if rest <= 0.0 || every <= rest + 2.0 * RAMP_S {
            return [t, 1.0, 0.0];
        }
        // a smooth step of the pace, 3 s^2 - 2 s^3, at either end of each period's motion
        let step = |x: f64| {
            let s = (x / RAMP_S).clamp(0.0, 1.0);
            let within = RAMP_S * (s * s * s - 0.5 * s * s * s * s) + (x - RAMP_S).max(0.0);
            [within, s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / RAMP_S]
        };
        let periods = libm::floor(t / every);
        let now = t - periods * every;
        let (up, down) = (step(now - rest), step(now - every + RAMP_S));
        [periods * (every - rest - RAMP_S) + up[0] - down[0], up[1] - down[1], up[2] - down[2]]
    }

    /// Rotation body to earth at a time, R = Rz Ry Rx exp(rate t) exp(rock sin(2 pi f t)).
    #[must_use]
    pub fn attitude(&self, at_ns: u64) -> [[f64; 3]; 3] {
        let [(sf, cf), (st, ct), (sp, cp)] = self.start.map(libm::sincos);
        let mut attitude = [
            [ct * cp, sf * st * cp - cf * sp, cf * st * cp + sf * sp],
            [ct * sp, sf * st * sp + cf * cp, cf * st * sp - sf * cp],
            [-st, sf * ct, cf * ct],
        ];
        if let Some((speed, axis)) = length_and_axis(self.rate) {
            attitude = product(&attitude, &turn(axis, speed * self.clock(at_ns)[0]));
        }
        if let Some((_, rocked)) = self.rocked(at_ns) {
            attitude = product(&attitude, &rocked);
        }
        attitude
    }

    /// Phase of the rocking, rad, and the rotation by which it has turned the body.
    fn rocked(&self, at_ns: u64) -> Option<(f64, Matrix)> {
        let (amplitude, axis) = length_and_axis(self.rock)?;
        let phase = TAU * self.rock_hz * self.clock(at_ns)[0];
        Some((phase, turn(axis, amplitude * libm::sin(phase))))
    }

    /// The constant rate as seen in body axes, the rate of the rocking and the change of both paces, rad/s and rad/s^2.
    fn rates(&self, at_ns: u64) -> [[f64; 3]; 3] {
        let [_, pace, change] = self.clock(at_ns);
        let Some((phase, rocked)) = self.rocked(at_ns) else {
            return [self.rate.map(|r| r * pace), [0.0; 3], self.rate.map(|r| r * change)];
        };
        let w = TAU * self.rock_hz;
        let steady: [f64; 3] = core::array::from_fn(|j| (0..3).map(|i| rocked[i][j] * self.rate[i]).sum());
        let (s, c) = libm::sincos(phase);
        let swing = w * c * change - w * w * s * pace * pace;
        let changes = core::array::from_fn(|i| self.rock[i] * swing + steady[i] * change);
        [steady.map(|r| r * pace), self.rock.map(|a| a * w * c * pace), changes]
    }

    /// Where the centre of rotation is, earth NED, m, from the middle of shaking and walk.
    #[must_use]
    pub fn place(&self, at_ns: u64) -> [f64; 3] {
        let t = at_ns as f64 * 1e-9;
        let shaken = libm::sin(TAU * self.shake_hz * t);
        let round = self.round(t);
        core::array::from_fn(|i| self.shake_m[i] * shaken + self.walk_m[i] * round[i].0)
    }

    /// Each direction's share of the round, and its second derivative, 1/s^2.
    fn round(&self, t: f64) -> [(f64, f64); 3] {
        let w = TAU * self.walk_hz;
        let (s, c) = libm::sincos(w * t);
        [(s, -w * w * s), (c, -w * w * c), (2.0 * s * c, -8.0 * w * w * s * c)]
    }

    /// Rate of the body, body axes, rad/s.
    #[must_use]
    pub fn rate(&self, at_ns: u64) -> [f64; 3] {
        let [steady, rocking, _] = self.rates(at_ns);
        core::array::from_fn(|i| steady[i] + rocking[i])
    }

    /// A vector in earth axes as the body has it.
    #[must_use]
    pub fn to_body(&self, at_ns: u64, earth: [f64; 3]) -> [f64; 3] {
        let r = self.attitude(at_ns);
        core::array::from_fn(|j| (0..3).map(|i| r[i][j] * earth[i]).sum())
    }

    /// Specific force at the accelerometer in body axes, g: at rest it points up.
    #[must_use]
    pub fn force(&self, at_ns: u64) -> [f64; 3] {
        let w = TAU * self.shake_hz;
        let swing = -w * w * libm::sin(w * at_ns as f64 * 1e-9) / G;
        let round = self.round(at_ns as f64 * 1e-9);
        let [x, y, z] = core::array::from_fn(|i| self.shake_m[i] * swing + self.walk_m[i] * round[i].1 / G);
        let body = self.to_body(at_ns, [x, y, z - 1.0]);
        let [steady, rocking, change] = self.rates(at_ns);
        let rate: [f64; 3] = core::array::from_fn(|i| steady[i] + rocking[i]);
        let carried = cross(steady, rocking); // the steady rate's own change in axes that rock
        let angular: [f64; 3] = core::array::from_fn(|i| change[i] + carried[i]);
        let (inward, along) = (cross(rate, cross(rate, self.lever_m)), cross(angular, self.lever_m));
        core::array::from_fn(|i| body[i] + (inward[i] + along[i]) / G)
    }

    /// Field in body axes, gauss.
    #[must_use]
    pub fn magnetic(&self, at_ns: u64) -> [f64; 3] {
        self.to_body(at_ns, self.field)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OBLIQUE: Motion =
        Motion { start: [0.3, -0.4, 1.9], rate: [0.35, -0.2, 0.33], rock: [0.2, 0.5, -0.1], rock_hz: 0.8, ..Motion::LEVEL };

    /// The rate is what turns the attitude: (R(t+h) - R(t-h))/2h = R [w]x, and R stays a rotation.
    #[test]
    fn the_attitude_turns_at_the_rate() {
        let pausing = Motion { pause_s: [1.0, 5.0], ..OBLIQUE };
        assert_eq!(pausing.rate(5_500_000_000), [0.0; 3], "a pause");
        for (body, at) in [(OBLIQUE, 1_700_000_000u64), (pausing, 1_700_000_000), (pausing, 9_300_000_000)] {
            turns_at_its_rate(&body, at);
        }
    }

    fn turns_at_its_rate(body: &Motion, at: u64) {
        let h = 10_000u64;
        let (before, now, after) = (body.attitude(at - h), body.attitude(at), body.attitude(at + h));
        let [x, y, z] = body.rate(at);
        let turned = product(&now, &[[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]);
        for i in 0..3 {
            for j in 0..3 {
                let slope = (after[i][j] - before[i][j]) / (2.0 * h as f64 * 1e-9);
                assert!((slope - turned[i][j]).abs() < 1e-7, "{slope} {}", turned[i][j]);
                let own: f64 = (0..3).map(|k| now[k][i] * now[k][j]).sum();
                assert!((own - f64::from(u8::from(i == j))).abs() < 1e-12);
            }
        }
    }

    /// The force is the second difference of the accelerometer's place, less gravity.
    #[test]
    fn the_force_is_the_acceleration_of_the_accelerometer_less_gravity() {
        let moved = Motion {
            shake_m: [0.01, -0.02, 0.005],
            shake_hz: 3.0,
            lever_m: [0.05, 0.02, -0.03],
            pause_s: [0.2, 4.0],
            walk_m: [0.5, 0.3, 0.1],
            walk_hz: 0.2,
            ..OBLIQUE
        };
        let place = |at: u64| -> [f64; 3] {
            let (r, centre) = (moved.attitude(at), moved.place(at));
            core::array::from_fn(|i| centre[i] + (0..3).map(|j| r[i][j] * moved.lever_m[j]).sum::<f64>())
        };
        let h = 1_000_000u64;
        // at rest, speeding up, under way, slowing down, and all of it in the second period
        for at in [40_000_000u64, 611_000_000, 1_734_000_000, 3_500_000_000, 4_100_000_000, 4_900_000_000] {
            let (a, b, c) = (place(at - h), place(at), place(at + h));
            let second: [f64; 3] = core::array::from_fn(|i| (a[i] - 2.0 * b[i] + c[i]) / (h as f64 * 1e-9).powi(2) / G);
            let want = moved.to_body(at, [second[0], second[1], second[2] - 1.0]);
            let got = moved.force(at);
            assert!((0..3).all(|i| (got[i] - want[i]).abs() < 1e-4), "{got:?} {want:?}");
        }
        assert_eq!(Motion::LEVEL.force(0), [0.0, 0.0, -1.0], "at rest it points up, which is -z of FRD");
    }
}
