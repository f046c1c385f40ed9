//! Gyro bias.
//!
//! What it is: the bias and its variance, one number for all axes. At rest the filtered rate is the bias; in motion the
//! turns that correct tilt and heading are what the bias has caused, seen through the averaged attitude.
//! What can go wrong: a bias beyond the limit is cut to it; heading errors of a disturbed field reach the bias about the
//! vertical only, and with a small gain.
//! Units: rad/s; the variance as a share of that at the start: 1 there, less with what is learnt.
//! Reference: Laidig & Seel 2023, section 3.3, with scalar gains in the place of a Kalman filter.

use super::state::Words;
use crate::columns::{Column, ZERO, clamp, dot, follow, lesser};
use crate::config::BiasConfig;

/// The state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bias {
    /// The bias, rad/s.
    pub(super) value: Column,
    /// Its variance, as a share of that at the start.
    pub(super) variance: f32,
    /// Averaged rotation body to earth.
    pub(super) attitude: [Column; 3],
}

impl Bias {
    /// Nothing known.
    #[inline]
    pub(super) fn new() -> Self {
        Self { value: ZERO, variance: 1.0, attitude: [[0.0; 3]; 3] }
    }

    /// Whether rest or motion has shown it.
    pub(super) fn trusted(&self, config: &BiasConfig) -> bool {
        self.variance < config.trusted
    }

    /// Takes the filtered rate of a body at rest.
    #[inline]
    pub(super) fn at_rest(&mut self, config: &BiasConfig, rate: &Column, dt: f32) {
        let weight = self.variance * dt;
        let k = weight / (weight + config.rest_weight);
        follow(core::slice::from_mut(&mut self.value), core::slice::from_mut(&mut rate.clone()), k);
        self.variance *= 1.0 - k;
        clamp(&mut self.value, config.limit);
    }

    /// Time passes.
    #[inline]
    pub(super) fn age(&mut self, config: &BiasConfig, dt: f32, moving: bool) {
        if moving {
            self.variance *= 1.0 - dt / config.motion_tau;
        }
        self.variance = lesser(self.variance + config.forgetting * dt, 1.0);
    }

    /// The averaged attitude follows.
    #[inline]
    pub(super) fn follow(&mut self, config: &BiasConfig, attitude: &[Column; 3], dt: f32) {
        follow(&mut self.attitude, &mut attitude.clone(), lesser(dt / config.lag, 1.0));
    }

    /// Takes the turn about the earth's horizontal axes that corrected the tilt over `dt`, in motion.
    #[inline]
    pub(super) fn take_tilt(&mut self, config: &BiasConfig, turn: &Column, dt: f32) {
        let gain = config.tilt_gain * (1.0 + config.tilt_boost * self.variance);
        self.correct(turn, config.limit * dt, gain, config.limit);
    }

    /// Takes the heading error that was found over `dt`, in motion.
    #[inline]
    pub(super) fn take_heading(&mut self, config: &BiasConfig, error: f32, dt: f32) {
        let gain = config.heading_gain * (1.0 + config.heading_boost * self.variance);
        self.correct(&[0.0, 0.0, error], 0.2, gain * dt, config.limit);
    }

    /// Takes off what has caused a turn in earth axes, of which `most` counts about an axis.
    #[inline(never)]
    fn correct(&mut self, turn: &Column, most: f32, gain: f32, limit: f32) {
        let mut turn = *turn;
        clamp(&mut turn, most);
        for (value, axis) in self.value.iter_mut().zip(&self.attitude) {
            *value -= gain * dot(axis, &turn);
        }
        clamp(&mut self.value, limit);
    }
}

impl Words for Bias {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        self.value.words(visit);
        visit(&mut self.variance);
        self.attitude.words(visit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: BiasConfig = crate::Config::DEFAULT.bias;
    const LEVEL: [Column; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    /// Of independent measurements the inverse variances add.
    #[test]
    fn rest_adds_information_in_proportion_to_its_time() {
        for variance in [1.0f32, 0.25, 0.01] {
            for dt in [0.005f32, 0.035, 2.0] {
                let mut bias = Bias { variance, ..Bias::new() };
                bias.at_rest(&CONFIG, &[0.1, 0.0, 0.0], dt);
                let known = 1.0 / variance + dt / CONFIG.rest_weight;
                assert!((1.0 / bias.variance / known - 1.0).abs() < 1e-5, "{variance} {dt}: {}", bias.variance);
                let [found, ..] = bias.value;
                assert!((found - 0.1 * (1.0 - bias.variance / variance)).abs() < 1e-6, "{variance} {dt}: {found}");
            }
        }
    }

    #[test]
    fn it_is_trusted_below_its_limit_and_not_at_it() {
        let bias = |variance: f32| Bias { variance, ..Bias::new() };
        assert!(bias(0.999 * CONFIG.trusted).trusted(&CONFIG) && !bias(CONFIG.trusted).trusted(&CONFIG));
    }

    /// A heading error grows the bias about the vertical by its gain; the boost counts by the share that is unknown.
    #[test]
    fn a_heading_error_counts_by_what_is_unknown() {
        for variance in [0.0f32, 0.5, 1.0] {
            let mut bias = Bias { variance, attitude: LEVEL, ..Bias::new() };
            bias.take_heading(&CONFIG, 0.1, 0.05);
            let known = -CONFIG.heading_gain * 0.1 * 0.05 * (1.0 + variance * CONFIG.heading_boost);
            let [x, y, z] = bias.value;
            assert!(x == 0.0 && y == 0.0 && (z / known - 1.0).abs() < 1e-5, "{variance}: {z} {known}");
        }
    }
}
