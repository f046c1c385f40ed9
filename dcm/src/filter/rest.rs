//! Rest.
//!
//! What it is: a body rests when rate and specific force have stayed near their own low-pass for a while.
//! What can go wrong: a slow steady turn about the vertical looks like rest; once the bias is trusted a rate that differs
//! from it by more than the limit is motion. Before, up to the largest bias, it cannot be told.
//! Units: rad/s, m/s^2, s.
//! Reference: Laidig & Seel 2023, section 3.4; dlaidig/vqf pull request 23 for the offset of cheap gyros.

use super::lowpass::LowPass;
use super::state::{Words, flag};
use crate::Vec3;
use crate::config::{BiasConfig, RestConfig};
use crate::linear::square;

/// The state.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Rest {
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
    /// Takes a rate; `trusted` is the bias where it is.
    pub(super) fn rate(&mut self, rate: &Vec3, dt: f32, config: &RestConfig, bias: &BiasConfig, trusted: Option<&Vec3>) {
        self.rate.step(rate, dt, config.filter_tau);
        let away = rate - self.rate.x;
        let slow = match trusted {
            Some(bias) => square(&(self.rate.x - bias)) < config.known_rate * config.known_rate,
            None => self.rate.x.iter().all(|w| w.abs() < bias.limit),
        };
        if square(&away) > config.rate * config.rate || !slow {
            self.moved();
        }
    }

    /// Takes a specific force; rest is counted here.
    pub(super) fn force(&mut self, force: &Vec3, dt: f32, config: &RestConfig) {
        self.force.step(force, dt, config.filter_tau);
        if square(&(force - self.force.x)) > config.force * config.force {
            self.moved();
            return;
        }
        self.quiet += dt;
        if self.quiet >= config.time {
            self.quiet = config.time;
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
