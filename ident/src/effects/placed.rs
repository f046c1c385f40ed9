//! An effect placed in a hypothesis.
//!
//! What it is: which effect, on which channels, in which form, with which shapes.
//! What can go wrong: nothing; whether it makes sense the fit asks.
//! Units: those of the shapes.
//! Reference: none needed.

use super::acquisition::sample_hold::BENEATH;
use super::{BEFORE, Effect, EffectEntry, Instance, Stage};
use crate::channel::Context;

/// An effect placed in a hypothesis.
#[derive(Clone)]
pub struct Placed {
    /// The effect.
    pub effect: &'static dyn Effect,
    /// Which channels, which form.
    pub instance: Instance,
    /// Values of its shape parameters.
    pub shape: Vec<f64>,
}

impl Placed {
    /// Whether an entry of a verdict tells of it.
    pub(crate) fn is_told_by(&self, e: &EffectEntry) -> bool {
        self.effect.id() == e.id && e.channels.iter().all(|c| self.instance.touches(c))
    }

    /// Whether it is the same effect, in the same form on the same channels, whatever its shapes.
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        self.effect.id() == other.effect.id() && self.instance == other.instance
    }

    /// What is known of its shapes before any run, nats.
    pub(crate) fn prior(&self, context: &Context) -> f64 {
        self.effect.prior(context, &self.instance, &self.shape)
    }

    /// Where it acts in the causal chain.
    pub(crate) fn stage(&self) -> Stage {
        self.effect.stage_of(&self.instance)
    }

    /// Whether the readings show it by themselves: a hold whose values repeat.
    pub(crate) fn is_read_off(&self) -> bool {
        self.effect.id() == "sample_hold" && self.instance.form != BENEATH
    }

    /// Whether it is a zero that is older than the run: a load cell is tared anew before every run.
    pub(crate) fn is_tare(&self) -> bool {
        self.effect.id() == "tare_shift" && self.instance.form == BEFORE
    }
}

impl std::fmt::Debug for Placed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {:?} {} {:?}", self.effect.id(), self.instance.channels, self.instance.form, self.shape)
    }
}

/// Whether an effect has a name.
pub(crate) fn is_named(placed: &Placed) -> bool {
    placed.effect.id() != "unknown"
}
