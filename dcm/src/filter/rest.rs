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
use crate::columns::{Column, plus, square};
use crate::config::RestConfig;

/// The state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rest {
    config: RestConfig,
    /// Filtered rate, rad/s, the bias still in it.
    pub(super) rate: LowPass,
    /// Filtered specific force, body axes, m/s^2.
    pub(super) force: LowPass,
    pub(super) quiet: f32,
    /// The body rests.
    pub(super) now: bool,
    /// It has rested since the start.
    pub(super) ever: bool,
}

impl Rest {
    /// Nothing known.
    #[inline(never)]
    pub(super) fn new(config: RestConfig) -> Self {
        Self { config, rate: LowPass::default(), force: LowPass::default(), quiet: 0.0, now: false, ever: false }
    }

    /// Begins anew.
    pub(super) fn restart(&mut self) {
        self.rate.age = 0.0;
        self.force.age = 0.0;
        self.moved();
    }

    /// Takes a rate.
    pub(super) fn rate(&mut self, rate: &Column, dt: f32, bias: &Bias) {
        self.rate.step(rate, dt, self.config.filter_tau);
        let mean = self.rate.value();
        let away = plus(rate, mean, -1.0);
        let slow = if bias.trusted() {
            square(&plus(mean, &bias.value, -1.0)) < self.config.known_rate * self.config.known_rate
        } else {
            mean.iter().all(|w| w.abs() < bias.config.limit)
        };
        if square(&away) > self.config.rate * self.config.rate || !slow {
            self.moved();
        }
    }

    /// Takes a specific force; rest is counted here.
    pub(super) fn force(&mut self, force: &Column, dt: f32) {
        self.force.step(force, dt, self.config.filter_tau);
        if square(&plus(force, self.force.value(), -1.0)) > self.config.force * self.config.force {
            self.moved();
            return;
        }
        self.quiet += dt;
        if self.quiet >= self.config.time {
            self.quiet = self.config.time;
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
