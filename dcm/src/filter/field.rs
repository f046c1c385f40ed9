//! Whether the magnetic field is believed.
//!
//! What it is: norm and dip of the field against a reference that follows slowly; a field that differs is a disturbance until
//! it has held for a while in motion, then it is the new reference.
//! What can go wrong: a body that rests beside iron cannot know it; hence new references need motion.
//! Units: uT, rad, s.
//! Reference: Laidig & Seel 2023, section 3.5.

use super::state::Words;
use crate::columns::lesser;
use crate::config::FieldConfig;
use crate::trig::{angle, root};

/// A field in the plane of its meridian.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Shape {
    /// Horizontal part, uT.
    pub(super) level: f32,
    /// Vertical part, uT, positive downwards.
    pub(super) down: f32,
}

impl Shape {
    /// Square of the norm, uT^2.
    pub(super) fn square(&self) -> f32 {
        self.level * self.level + self.down * self.down
    }

    #[inline(never)]
    fn follow(&mut self, other: &Self, k: f32) {
        self.level += k * (other.level - self.level);
        self.down += k * (other.down - self.down);
    }

    /// Whether norm and dip agree: the sine of the angle between the two from their cross product.
    #[inline(never)]
    fn is_near(&self, reference: &Self, norm: f32, dip: f32) -> bool {
        let (own, wanted) = (self.square(), reference.square());
        let (low, high) = (1.0 - norm, 1.0 + norm);
        let cross = self.level * reference.down - self.down * reference.level;
        own > low * low * wanted && own < high * high * wanted && cross * cross < dip * dip * own * wanted
    }
}

impl Words for Shape {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        visit(&mut self.level);
        visit(&mut self.down);
    }
}

/// The state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Field {
    /// Smoothed, as it is now.
    pub(super) now: Shape,
    /// What it should be; zero while it is not known.
    pub(super) reference: Shape,
    candidate: Shape,
    candidate_time: f32,
    good_time: f32,
    /// Time of freezing that was used up, s.
    frozen: f32,
}

impl Field {
    /// Nothing known.
    #[inline]
    pub(super) fn new() -> Self {
        let none = Shape::default();
        let (candidate_time, good_time, frozen) = (0.0, 0.0, 0.0);
        Self { now: none, reference: none, candidate: none, candidate_time, good_time, frozen }
    }

    /// Whether a reference was found. (One without a horizontal part would be of no use.)
    pub(super) fn known(&self) -> bool {
        self.reference.level > 0.0
    }

    /// Whether it differs from the reference, or has not agreed with it for long enough.
    pub(super) fn disturbed(&self, config: &FieldConfig) -> bool {
        self.good_time < config.settle
    }

    /// Whether it differs from a reference that is known: what it says then is not learnt from.
    pub(super) fn refused(&self, config: &FieldConfig) -> bool {
        self.known() && self.disturbed(config)
    }

    /// Norm, as a share, and dip, rad, against the reference; 0 while none is known.
    pub(super) fn against(&self) -> (f32, f32) {
        if !self.known() {
            return (0.0, 0.0);
        }
        let (now, reference) = (root(self.now.square()), root(self.reference.square()));
        let dip = |shape: &Shape, norm| if norm > 0.0 { angle(shape.down, shape.level, norm) } else { 0.0 };
        (now / reference - 1.0, dip(&self.now, now) - dip(&self.reference, reference))
    }

    /// A magnet is there: whatever was agreed upon has to hold anew.
    pub(super) fn doubt(&mut self) {
        self.good_time = 0.0;
        self.candidate_time = 0.0;
    }

    /// Takes a field that stands for `dt` seconds; `turning` says that the body turns fast, `magnet` that a magnet was there. Says whether
    /// this field has held for long enough to become the reference, and the heading so far may be another one's.
    #[inline]
    pub(super) fn take(&mut self, config: &FieldConfig, shape: &Shape, dt: f32, turning: bool, magnet: bool) -> bool {
        let smooth = if self.now.level > 0.0 { dt / (dt + config.smoothing) } else { 1.0 };
        self.now.follow(shape, smooth);
        let slow = dt / config.reference_tau;

        if self.now.is_near(&self.reference, config.norm, config.dip) {
            self.good_time += dt;
            if !self.disturbed(config) {
                self.reference.follow(&self.now, slow);
            }
        } else {
            self.good_time = 0.0;
        }

        if !self.now.is_near(&self.candidate, config.norm, config.dip) {
            self.candidate_time = 0.0;
            self.candidate = self.now;
            return false;
        }
        self.candidate.follow(&self.now, slow);
        if turning {
            self.candidate_time += dt;
        }
        let wait = if self.known() { config.new_time } else { config.first_time };
        let first = !self.known();
        let taken = self.disturbed(config) && self.candidate_time >= wait;
        if taken {
            self.reference = self.candidate;
            self.good_time = config.settle;
        }
        taken && (magnet || !first)
    }

    /// Factor on the heading correction: 1 believed, 0 frozen, less than 1 after a long time of freezing. `hold` allows to freeze
    /// while there is no reference.
    #[inline]
    pub(super) fn belief(&mut self, config: &FieldConfig, dt: f32, hold: bool) -> f32 {
        if !self.disturbed(config) {
            self.frozen = -lesser(config.doubt * dt - self.frozen, 0.0);
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
    }
}
