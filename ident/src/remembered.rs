//! Refinements that were made before.
//!
//! What it is: the shapes that a search over a group of effects ended at, kept for whoever asks the same again. A group that shares no channel
//! with a new effect is refined anew beside it from the same start, on the same rows, to the same end.
//! What can go wrong: nothing that a search made afresh would not show: what is kept is found by all that the search depends on.
//! Units: none.
//! Reference: memoisation, Michie 1968, Nature 218:19.

use crate::context::Context;
use crate::effects::Instance;
use crate::hypothesis::{Declared, Placed, Rows};
use std::collections::HashMap;
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::sync::{Mutex, PoisonError};

/// All that a refinement depends on beside the log itself.
#[derive(Debug, PartialEq, Eq, Hash)]
pub(crate) struct Question {
    group: Vec<(&'static str, Instance, Vec<u64>)>,
    /// Digest of the rows that may teach, of the readings, their variances and the declared model.
    ground: u64,
    scattering: bool,
    evaluations: usize,
}

impl Question {
    /// What the refinement of the effects at the positions of `group` asks, the channels that they move named.
    pub(crate) fn new(
        (context, declared): (&Context, Declared<'_>),
        placed: &[Placed],
        group: &[usize],
        moving: &[&str],
        rows: Rows<'_>,
        evaluations: usize,
    ) -> Self {
        let bits = |p: &Placed| p.shape.iter().map(|v| v.to_bits()).collect();
        let group = group.iter().map(|k| &placed[*k]).map(|p| (p.effect.id(), p.instance.clone(), bits(p))).collect();
        let mut digest = DefaultHasher::new();
        match rows {
            Rows::All => 1.hash(&mut digest),
            Rows::Every(n) => n.hash(&mut digest),
            Rows::Where(mask) => mask.hash(&mut digest),
        }
        for target in context.targets.iter().filter(|t| moving.contains(&t.name)) {
            let numbers = [&target.y, &target.levelled].into_iter().flatten();
            digest.write_u64(numbers.fold(0, |sum, v| (sum ^ v.to_bits()).rotate_left(5).wrapping_mul(0x517c_c1b7_2722_0a95)));
        }
        if let Some(model) = declared.model {
            format!("{:?} {:?}", model.polynomials, model.effects).hash(&mut digest);
        }
        Self { group, ground: digest.finish(), scattering: placed.iter().any(|p| p.effect.scatters()), evaluations }
    }
}

/// Refined shapes of the effects of a group, by what was asked.
#[derive(Debug, Default)]
pub(crate) struct Remembered(Mutex<HashMap<Question, Vec<Vec<f64>>>>);

impl Clone for Remembered {
    /// A log's copy is there to be changed: it remembers nothing.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Remembered {
    /// What was found, or what is found now.
    pub(crate) fn or_found(&self, question: Question, find: impl FnOnce() -> Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let known = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(shapes) = known().get(&question) {
            return shapes.clone();
        }
        let shapes = find();
        known().insert(question, shapes.clone());
        shapes
    }
}
