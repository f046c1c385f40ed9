//! Second-order low-pass that single precision survives.
//!
//! What it is: a Butterworth filter in state-variable form; the coefficients of the direct form lie near 1e-6, where f32
//! loses them. Until two time constants have passed it averages instead, so that it starts without a transient.
//! What can go wrong: a step longer than the time constant is cut to it.
//! Units: those of its input; s.
//! Reference: x'' tau^2 + 2 x' tau + 2 x = 2 z, cut-off sqrt(2)/(2 pi tau), damping 1/sqrt(2).

use super::state::Words;
use crate::Vec3;

/// The state.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct LowPass {
    /// Filtered value.
    pub(super) x: Vec3,
    /// Its rate times tau; while it starts, the first of two running means.
    pub(super) v: Vec3,
    age: f32,
}

impl LowPass {
    /// Takes one value that stands for `dt` seconds.
    #[inline(never)]
    pub(super) fn step(&mut self, z: &Vec3, dt: f32, tau: f32) {
        let start = 2.0 * tau;
        if self.age < start {
            self.age += dt;
            let k = (dt / self.age).min(1.0);
            self.v += (z - self.v) * k;
            self.x += (self.v - self.x) * k;
            if self.age >= start {
                self.v = (self.v - self.x) * 0.5; // x' = (mean - x)/age, times tau
            }
        } else {
            let k = (dt / tau).min(1.0);
            self.v += (z - self.x - self.v) * (2.0 * k);
            self.x += self.v * k;
        }
    }
}

impl LowPass {
    /// Whether the first averages still fill.
    pub(super) fn starting(&self, tau: f32) -> bool {
        self.age < 2.0 * tau
    }
}

impl Words for LowPass {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        self.x.words(visit);
        self.v.words(visit);
        visit(&mut self.age);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_starts_at_the_mean_and_then_has_its_time_constant() {
        let (dt, tau) = (0.0035, 3.0);
        let mut filter = LowPass::default();
        filter.step(&Vec3::x(), dt, tau);
        assert!((filter.x.x - 1.0).abs() < 1e-6, "the first value at once");
        for _ in 0..4000 {
            filter.step(&Vec3::x(), dt, tau);
        }
        // step response at t = tau of the damped pair: 1 - e^-1 (cos 1 + sin 1) = 0.4917
        for _ in 0..(tau / dt) as u32 {
            filter.step(&Vec3::zeros(), dt, tau);
        }
        assert!((filter.x.x - 0.5083).abs() < 2e-3, "{}", filter.x.x);
    }
}
