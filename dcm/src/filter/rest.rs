//! Rest.
//!
//! What it is: a body rests when rate and specific force have stayed near their own low-pass for a while.
//! What can go wrong: a slow steady turn about the vertical looks like rest; once the bias is trusted a rate that differs
//! from it by more than the limit is motion. Before, up to the largest bias, it cannot be told.
//! Units: rad/s, m/s^2, s.
//! Reference: Laidig & Seel 2023, section 3.4; dlaidig/vqf pull request 23 for the offset of cheap gyros.

use super::bias::Bias;
use super::lowpass::LowPass;
use super::state::{Words, flag};
use crate::columns::{Column, add_scaled, clamp, square};
use crate::config::{Config, RestConfig};

/// The state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rest {
    /// Filtered rate, rad/s, the bias still in it.
    pub(super) rate: LowPass<3>,
    /// Filtered specific force, body axes, m/s^2.
    pub(super) force: LowPass<3>,
    pub(super) quiet: f32,
    /// The body rests.
    pub(super) now: bool,
    /// It has rested since the start.
    pub(super) ever: bool,
}

impl Rest {
    /// Nothing known.
    #[inline]
    pub(super) fn new() -> Self {
        Self { rate: LowPass::new(), force: LowPass::new(), quiet: 0.0, now: false, ever: false }
    }

    /// Begins anew.
    pub(super) fn restart(&mut self) {
        self.rate.age = 0.0;
        self.force.age = 0.0;
        self.moved();
    }

    /// Takes a rate.
    #[inline]
    pub(super) fn rate(&mut self, config: &Config, rate: &Column, dt: f32, bias: &Bias) {
        let away = self.rate.step(rate, dt, config.rest.filter_tau, config.rest.filter_tau);
        let mut mean = *self.rate.value();
        let fast = if bias.trusted(&config.bias) {
            square(&add_scaled(&mean, &bias.value, -1.0)) >= config.rest.known_rate * config.rest.known_rate
        } else {
            clamp(&mut mean, config.bias.limit)
        };
        if away > config.rest.rate * config.rest.rate || fast {
            self.moved();
        }
    }

    /// Takes a specific force; rest is counted here.
    #[inline]
    pub(super) fn force(&mut self, config: &RestConfig, force: &Column, dt: f32) {
        let away = self.force.step(force, dt, config.filter_tau, config.filter_tau);
        if away > config.force * config.force {
            self.moved();
            return;
        }
        self.quiet += dt;
        if self.quiet >= config.time {
            self.now = true;
        }
    }

    fn moved(&mut self) {
        self.quiet = 0.0;
        self.now = false;
    }
}

impl Words for Rest {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        self.rate.words(visit);
        self.force.words(visit);
        visit(&mut self.quiet);
        flag(&mut self.now, visit);
        flag(&mut self.ever, visit);
    }
}
