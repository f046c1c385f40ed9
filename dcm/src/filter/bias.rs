//! Gyro bias.
//!
//! What it is: the bias and one number for how little is known of it. At rest the filtered rate is the bias; in motion the
//! turns that correct tilt and heading are what the bias has caused, seen through the averaged attitude.
//! What can go wrong: a bias beyond the limit is cut to it; heading errors of a disturbed field reach the bias about the
//! vertical only, and with a small gain.
//! Units: rad/s; ignorance is 1 at the start and shrinks.
//! Reference: Laidig & Seel 2023, section 3.3, with scalar gains in the place of a Kalman filter.

use super::state::Words;
use crate::config::BiasConfig;
use crate::{Mat3, Vec3};

/// The state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bias {
    /// The bias, rad/s.
    pub(super) value: Vec3,
    /// 1 at the start.
    pub(super) ignorance: f32,
    /// Averaged rotation body to earth.
    pub(super) attitude: Mat3,
}

impl Bias {
    pub(super) fn new(value: Vec3) -> Self {
        Self { value, ignorance: 1.0, attitude: Mat3::identity() }
    }

    /// Whether rest or motion has shown it.
    pub(super) fn trusted(&self, config: &BiasConfig) -> bool {
        self.ignorance < config.trusted
    }

    /// Takes the filtered rate of a body at rest.
    pub(super) fn at_rest(&mut self, rate: &Vec3, dt: f32, config: &BiasConfig) {
        let weight = self.ignorance * dt;
        let k = weight / (weight + config.rest_weight);
        self.value += (rate - self.value) * k;
        self.ignorance *= 1.0 - k;
        self.limit(config);
    }

    /// Time passes.
    pub(super) fn age(&mut self, dt: f32, moving: bool, config: &BiasConfig) {
        if moving {
            self.ignorance *= 1.0 - dt / config.motion_tau;
        }
        self.ignorance = (self.ignorance + config.forgetting * dt).min(1.0);
    }

    /// The averaged attitude follows.
    pub(super) fn follow(&mut self, attitude: &Mat3, dt: f32, config: &BiasConfig) {
        self.attitude += (attitude - self.attitude) * (dt / config.lag).min(1.0);
    }

    /// Takes the turn about the earth's horizontal axes that corrected the tilt over `dt`, in motion.
    pub(super) fn take_tilt(&mut self, turn: &Vec3, dt: f32, config: &BiasConfig) {
        let most = config.limit * dt;
        let gain = config.tilt_gain * (1.0 + config.tilt_boost * self.ignorance);
        let (x, y) = (turn.x.clamp(-most, most) * gain, turn.y.clamp(-most, most) * gain);
        self.value -= self.attitude.row(0).transpose() * x + self.attitude.row(1).transpose() * y;
        self.limit(config);
    }

    /// Takes the heading error that was found over `dt`, in motion.
    pub(super) fn take_heading(&mut self, error: f32, dt: f32, config: &BiasConfig) {
        let gain = config.heading_gain * (1.0 + config.heading_boost * self.ignorance);
        self.value -= self.attitude.row(2).transpose() * (error.clamp(-0.2, 0.2) * gain * dt);
        self.limit(config);
    }

    fn limit(&mut self, config: &BiasConfig) {
        self.value = self.value.map(|b| b.clamp(-config.limit, config.limit));
    }
}

impl Words for Bias {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        self.value.words(visit);
        visit(&mut self.ignorance);
        self.attitude.words(visit);
    }
}
