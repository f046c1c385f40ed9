//! When an effect acts.
//!
//! What it is: an effect with an optional window of the run's own time. Outside of it the rig is built as if the effect were not
//! there; the rig's state (speed, charge, heat, creep) goes on through both ends.
//! What can go wrong: a window that ends before it begins never opens.
//! Units: s of the run's own time, which starts with the first logged sample.
//! Reference: specification `rig.md`, "Faults can be injected at any time".

use super::EffectKind;
use crate::parts::BenchParts;
use serde::{Deserialize, Serialize};

/// An effect and its window. Without a window it acts throughout, parts that it changes from power-on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scheduled {
    /// Begin, s; from power-on when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from_s: Option<f64>,
    /// End, s; never when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until_s: Option<f64>,
    /// The effect.
    #[serde(flatten)]
    pub effect: EffectKind,
}

impl From<EffectKind> for Scheduled {
    fn from(effect: EffectKind) -> Self {
        Self { from_s: None, until_s: None, effect }
    }
}

impl Scheduled {
    /// Whether the window is open `run_s` into the run (negative before it).
    #[must_use]
    pub fn is_open(&self, run_s: f64) -> bool {
        self.from_s.is_none_or(|from| run_s >= from) && self.until_s.is_none_or(|until| run_s < until)
    }
}

impl core::ops::Deref for Scheduled {
    type Target = EffectKind;
    fn deref(&self) -> &EffectKind {
        &self.effect
    }
}

/// Bits of the effects whose windows are open `run_s` into the run. A run holds at most 128 effects.
pub(crate) fn open(effects: &[Scheduled], run_s: f64) -> u128 {
    effects.iter().enumerate().filter(|(_, e)| e.is_open(run_s)).fold(0, |bits, (i, _)| bits | 1 << i)
}

/// The parts with the effects of `open` fitted.
pub(crate) fn fitted(base: &BenchParts, effects: &[Scheduled], open: u128) -> BenchParts {
    let mut parts = base.clone();
    for (_, effect) in effects.iter().enumerate().filter(|(i, _)| open & (1 << i) != 0) {
        effect.fit(&mut parts);
    }
    parts
}
