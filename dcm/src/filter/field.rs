//! Whether the magnetic field is believed.
//!
//! What it is: norm and dip of the field against a reference that follows slowly; a field that differs is a disturbance until
//! it has held for a while in motion, then it is the new reference.
//! What can go wrong: a body that rests beside iron cannot know it; hence new references need motion.
//! Units: uT, rad, s.
//! Reference: Laidig & Seel 2023, section 3.5.

use super::state::{Words, flag};
use crate::Vec3;
use crate::config::FieldConfig;
use crate::trig::root;
use libm::atan2f;

/// Norm and dip of a field.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Shape {
    /// Norm, uT.
    pub(super) norm: f32,
    /// Dip, rad, positive downwards.
    pub(super) dip: f32,
}

impl Shape {
    fn of(earth: &Vec3) -> Self {
        let level = earth.x * earth.x + earth.y * earth.y;
        Self { norm: root(level + earth.z * earth.z), dip: atan2f(earth.z, root(level)) }
    }

    fn follow(&mut self, other: &Self, k: f32) {
        self.norm += k * (other.norm - self.norm);
        self.dip += k * (other.dip - self.dip);
    }

    fn is_near(&self, reference: &Self, config: &FieldConfig) -> bool {
        (self.norm - reference.norm).abs() < config.norm * reference.norm && (self.dip - reference.dip).abs() < config.dip
    }
}

impl Words for Shape {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        visit(&mut self.norm);
        visit(&mut self.dip);
    }
}

/// The state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Field {
    /// Smoothed, as it is now.
    pub(super) now: Shape,
    /// What it should be; norm 0 while it is not known.
    pub(super) reference: Shape,
    candidate: Shape,
    candidate_time: f32,
    good_time: f32,
    /// Time of freezing that was used up, s.
    frozen: f32,
    /// It differs from the reference.
    pub(super) disturbed: bool,
}

impl Default for Field {
    fn default() -> Self {
        let none = Shape::default();
        Self { now: none, reference: none, candidate: none, candidate_time: 0.0, good_time: 0.0, frozen: 0.0, disturbed: true }
    }
}

impl Field {
    /// Whether a reference was found.
    pub(super) fn known(&self) -> bool {
        self.reference.norm > 0.0
    }

    /// Takes a field in earth axes that stands for `dt` seconds; `turning` says that the body turns fast.
    pub(super) fn take(&mut self, earth: &Vec3, dt: f32, turning: bool, config: &FieldConfig) {
        let shape = Shape::of(earth);
        let smooth = if self.now.norm > 0.0 { dt / (dt + config.smoothing) } else { 1.0 };
        self.now.follow(&shape, smooth);
        let slow = dt / config.reference_tau;

        if self.now.is_near(&self.reference, config) {
            self.good_time += dt;
            if self.good_time >= config.settle {
                self.disturbed = false;
                self.reference.follow(&self.now, slow);
            }
        } else {
            self.good_time = 0.0;
            self.disturbed = true;
        }

        if !self.now.is_near(&self.candidate, config) {
            self.candidate_time = 0.0;
            self.candidate = self.now;
            return;
        }
        self.candidate.follow(&self.now, slow);
        if turning {
            self.candidate_time += dt;
        }
        let wait = if self.known() { config.new_time } else { config.first_time };
        if self.disturbed && self.candidate_time >= wait {
            self.reference = self.candidate;
            self.disturbed = false;
            self.good_time = config.settle;
        }
    }

    /// Factor on the heading correction: 1 believed, 0 frozen, less than 1 after a long time of freezing. `hold` allows to freeze
    /// while there is no reference.
    pub(super) fn belief(&mut self, dt: f32, hold: bool, config: &FieldConfig) -> f32 {
        if !self.disturbed {
            self.frozen = (self.frozen - config.doubt * dt).max(0.0);
            return 1.0;
        }
        if !self.known() && !hold {
            return 1.0;
        }
        if self.frozen <= config.longest_freeze {
            self.frozen += dt;
            return 0.0;
        }
        1.0 / config.doubt
    }
}

impl Words for Field {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        self.now.words(visit);
        self.reference.words(visit);
        self.candidate.words(visit);
        visit(&mut self.candidate_time);
        visit(&mut self.good_time);
        visit(&mut self.frozen);
        flag(&mut self.disturbed, visit);
    }
}
