//! Second-order low-pass that single precision survives.
//!
//! What it is: a Butterworth filter in state-variable form; the coefficients of the direct form lie near 1e-6, where f32
//! loses them. Until two time constants have passed it averages instead, so that it starts without a transient.
//! What can go wrong: a step longer than the time constant is cut to it.
//! Units: those of its input; s.
//! Reference: x'' tau^2 + 2 x' tau + 2 x = 2 z, cut-off sqrt(2)/(2 pi tau), damping 1/sqrt(2).

use super::state::Words;
use crate::columns::lesser;

/// The state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LowPass<const N: usize> {
    /// Filtered value, and its rate times tau; while it starts, half the distance to the first of two running means.
    pub(super) state: [[f32; N]; 2],
    pub(super) age: f32,
}

impl<const N: usize> LowPass<N> {
    /// Nothing known.
    #[inline]
    pub(super) fn new() -> Self {
        Self { state: [[0.0; N]; 2], age: 0.0 }
    }

    /// Begins anew, as if it had been at `x` for an instant.
    #[inline]
    pub(super) fn restart(&mut self, x: [f32; N]) {
        self.state = [x, [0.0; N]];
        self.age = 1e-3;
    }

    /// Filtered value.
    pub(super) fn value(&self) -> &[f32; N] {
        let [x, _] = &self.state;
        x
    }

    /// Takes one value that stands for `dt` seconds; the square of its distance to the filtered one. `start` is the time constant
    /// that it starts with, which may not change.
    #[inline(never)]
    pub(super) fn step(&mut self, z: &[f32; N], dt: f32, tau: f32, start: f32) -> f32 {
        // running means, z - x - 2v the distance to the first; then x' tau = v, v' tau = 2 (z - x - v)
        let (lag, gain, keep, k) = if self.starting(start) {
            self.age += dt;
            let k = lesser(dt / self.age, 1.0);
            (2.0, k, 0.5 - 0.5 * k, k)
        } else {
            let k = lesser(dt / tau, 1.0);
            (1.0, 2.0 * k, 1.0, k)
        };
        let [x, v] = &mut self.state;
        let mut square = 0.0;
        for ((x, v), z) in x.iter_mut().zip(v).zip(z) {
            let slope = lag * *v;
            let next = slope + gain * (z - *x - slope);
            *x += k * next;
            *v = keep * next;
            square += (z - *x) * (z - *x);
        }
        square
    }

    /// Whether the first averages still fill.
    pub(super) fn starting(&self, tau: f32) -> bool {
        self.age < 2.0 * tau
    }
}

impl<const N: usize> Words for LowPass<N> {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        self.state.words(visit);
        visit(&mut self.age);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_starts_at_the_mean_and_then_has_its_time_constant() {
        let (dt, tau) = (0.0035, 3.0);
        let mut filter = LowPass::new();
        filter.step(&[1.0, 0.0, 0.0], dt, tau, tau);
        assert!((filter.value()[0] - 1.0).abs() < 1e-6, "the first value at once");
        for _ in 0..4000 {
            filter.step(&[1.0, 0.0, 0.0], dt, tau, tau);
        }
        // step response at t = tau of the damped pair: 1 - e^-1 (cos 1 + sin 1) = 0.4917
        for _ in 0..(tau / dt) as u32 {
            filter.step(&[0.0; 3], dt, tau, tau);
        }
        assert!((filter.value()[0] - 0.5083).abs() < 2e-3, "{}", filter.value()[0]);
    }

    #[test]
    fn it_has_started_after_two_time_constants() {
        let starting = |age: f32| LowPass::<3> { age, ..LowPass::new() }.starting(0.5);
        assert_eq!([0.5, 0.99, 1.0, 1.5].map(starting), [true, true, false, false]);
    }

    /// What a step gives back is the square of the distance to what it has become.
    #[test]
    fn a_step_gives_the_distance_that_is_left() {
        let mut filter = LowPass { state: [[10.0, -4.0, 0.0], [0.0; 3]], age: 9.0 };
        let square = filter.step(&[13.0, 0.0, 1.0], 0.1, 1.0, 1.0);
        let [x, y, z] = *filter.value();
        let known = (13.0 - x).powi(2) + y.powi(2) + (1.0 - z).powi(2);
        assert!((square - known).abs() < 1e-4 && known > 10.0, "{square} {known}");
    }
}
