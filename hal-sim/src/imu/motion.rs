//! A body that turns at a constant rate while it is shaken along a line.
//!
//! What it is: attitude, specific force and magnetic field in body axes at any instant, in closed form.
//! What can go wrong: nothing here fails; the rate is constant in body axes, so nothing integrates and nothing drifts.
//! Units: rad, rad/s, m, Hz, gauss; g (9.80665 m/s^2) for specific force; ns since power-up; earth frame NED, body frame FRD.
//! Reference: Rodrigues' rotation formula; errata 4.3 (specific force f = a - g); rigid-body acceleration
//! a_p = a_0 + w x (w x r) (Goldstein, *Classical Mechanics*, section 4.10).

use core::f64::consts::TAU;

/// Standard gravity, m/s^2 (CGPM 1901).
const G: f64 = 9.806_65;

/// How the body moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Roll, pitch and yaw at time 0, rad; the body turns from there.
    pub start: [f64; 3],
    /// Constant rate in body axes, rad/s.
    pub rate: [f64; 3],
    /// Magnetic field, earth NED, gauss.
    pub field: [f64; 3],
    /// Amplitude of the shaking, earth NED, m.
    pub shake_m: [f64; 3],
    /// Its frequency, Hz.
    pub shake_hz: f64,
    /// Place of the accelerometer from the centre of rotation, body axes, m.
    pub lever_m: [f64; 3],
}

type Matrix = [[f64; 3]; 3];

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

impl Motion {
    /// Level, at rest, body x to magnetic north, in the field of central Europe.
    pub const LEVEL: Self =
        Self { start: [0.0; 3], rate: [0.0; 3], field: [0.2, 0.0, 0.44], shake_m: [0.0; 3], shake_hz: 0.0, lever_m: [0.0; 3] };

    /// Rotation body to earth at a time, R = Rz Ry Rx exp(rate t).
    #[must_use]
    pub fn attitude(&self, at_ns: u64) -> [[f64; 3]; 3] {
        let [(sf, cf), (st, ct), (sp, cp)] = self.start.map(libm::sincos);
        let first = [
            [ct * cp, sf * st * cp - cf * sp, cf * st * cp + sf * sp],
            [ct * sp, sf * st * sp + cf * cp, cf * st * sp - sf * cp],
            [-st, sf * ct, cf * ct],
        ];
        let speed = self.rate.iter().map(|w| w * w).sum::<f64>().sqrt();
        if speed == 0.0 {
            return first;
        }
        let [x, y, z] = self.rate.map(|w| w / speed);
        let (s, c) = libm::sincos(speed * at_ns as f64 * 1e-9);
        let u: Matrix = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
        let uu = product(&u, &u);
        let turn =
            core::array::from_fn(|i| core::array::from_fn(|j| f64::from(u8::from(i == j)) + s * u[i][j] + (1.0 - c) * uu[i][j]));
        product(&first, &turn)
    }

    fn to_body(self, at_ns: u64, earth: [f64; 3]) -> [f64; 3] {
        let r = self.attitude(at_ns);
        core::array::from_fn(|j| (0..3).map(|i| r[i][j] * earth[i]).sum())
    }

    /// Specific force at the accelerometer in body axes, g: at rest it points up.
    #[must_use]
    pub fn force(&self, at_ns: u64) -> [f64; 3] {
        let w = TAU * self.shake_hz;
        let swing = -w * w * libm::sin(w * at_ns as f64 * 1e-9) / G;
        let [x, y, z] = self.shake_m.map(|m| m * swing);
        let body = self.to_body(at_ns, [x, y, z - 1.0]);
        let inward = cross(self.rate, cross(self.rate, self.lever_m));
        core::array::from_fn(|i| body[i] + inward[i] / G)
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

    const OBLIQUE: Motion = Motion { start: [0.3, -0.4, 1.9], rate: [0.35, -0.2, 0.33], ..Motion::LEVEL };

    /// The rate is what turns the attitude: (R(t+h) - R(t-h))/2h = R [w]x, and R stays a rotation.
    #[test]
    fn the_attitude_turns_at_the_rate() {
        let (at, h) = (1_700_000_000u64, 1_000_000u64);
        let (before, now, after) = (OBLIQUE.attitude(at - h), OBLIQUE.attitude(at), OBLIQUE.attitude(at + h));
        let [x, y, z] = OBLIQUE.rate;
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
        let moved = Motion { shake_m: [0.01, -0.02, 0.005], shake_hz: 3.0, lever_m: [0.05, 0.02, -0.03], ..OBLIQUE };
        let place = |at: u64| -> [f64; 3] {
            let r = moved.attitude(at);
            let s = libm::sin(TAU * moved.shake_hz * at as f64 * 1e-9);
            core::array::from_fn(|i| moved.shake_m[i] * s + (0..3).map(|j| r[i][j] * moved.lever_m[j]).sum::<f64>())
        };
        let h = 1_000_000u64;
        for at in [40_000_000u64, 611_000_000, 1_234_000_000] {
            let (a, b, c) = (place(at - h), place(at), place(at + h));
            let second: [f64; 3] = core::array::from_fn(|i| (a[i] - 2.0 * b[i] + c[i]) / (h as f64 * 1e-9).powi(2) / G);
            let want = moved.to_body(at, [second[0], second[1], second[2] - 1.0]);
            let got = moved.force(at);
            assert!((0..3).all(|i| (got[i] - want[i]).abs() < 1e-4), "{got:?} {want:?}");
        }
        assert_eq!(Motion::LEVEL.force(0), [0.0, 0.0, -1.0], "at rest it points up, which is -z of FRD");
    }
}
