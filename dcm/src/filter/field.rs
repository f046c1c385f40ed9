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

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: FieldConfig = crate::Config::DEFAULT.field;

    fn shape(level: f32, down: f32) -> Shape {
        Shape { level, down }
    }

    /// A field that is known and believed.
    fn believed() -> Field {
        Field { now: shape(20.0, 43.0), reference: shape(20.0, 43.0), good_time: 1.0, ..Field::new() }
    }

    /// Half of the norm more or less is allowed here: the ends themselves are outside.
    #[test]
    fn the_norm_may_differ_by_its_share() {
        let near = |level: f32| shape(level, 0.0).is_near(&shape(2.0, 0.0), 0.5, 0.1);
        assert_eq!([1.0, 1.01, 2.0, 2.99, 3.0].map(near), [false, true, true, true, false]);
    }

    /// The same for the sine of the dip, up to a right angle.
    #[test]
    fn the_dip_may_differ_by_its_angle() {
        let near = |degrees: f32, sine: f32| {
            let (down, level) = crate::trig::sin_cos(degrees.to_radians());
            shape(5.0 * level, 5.0 * down).is_near(&shape(5.0, 0.0), 0.1, sine)
        };
        assert_eq!([-31.0, -29.0, 0.0, 29.0, 31.0].map(|degrees| near(degrees, 0.5)), [false, true, true, true, false]);
        assert!(!shape(0.0, 5.0).is_near(&shape(5.0, 0.0), 0.1, 1.0), "a right angle is no less than a right angle");
    }

    /// The first field is taken as it is; a later one by the share that its time is of time and smoothing together.
    #[test]
    fn a_field_is_smoothed_from_the_second_on() {
        let mut field = Field::new();
        field.take(&CONFIG, &shape(20.0, 40.0), CONFIG.smoothing, false, false);
        assert_eq!(field.now, shape(20.0, 40.0));
        field.take(&CONFIG, &shape(30.0, 60.0), CONFIG.smoothing, false, false);
        assert_eq!(field.now, shape(25.0, 50.0), "as long as the smoothing: half");
    }

    /// The reference follows with its own time constant what is believed, and what is not yet believed not at all.
    #[test]
    fn the_reference_follows_a_field_that_is_believed() {
        for (good_time, share) in [(1.0, 0.1 / CONFIG.reference_tau), (0.0, 0.0)] {
            let mut field = Field { now: shape(21.0, 43.0), good_time, ..believed() };
            field.take(&CONFIG, &shape(21.0, 43.0), 0.1, false, false);
            assert!((field.reference.level - (20.0 + share)).abs() < 1e-5, "{good_time}: {:?}", field.reference);
        }
    }

    #[test]
    fn a_field_that_has_agreed_for_long_enough_is_not_disturbed() {
        let agreed = |good_time: f32| Field { good_time, ..Field::new() }.disturbed(&CONFIG);
        assert!(agreed(0.9 * CONFIG.settle) && !agreed(CONFIG.settle));
    }

    #[test]
    fn no_field_has_no_dip_that_is_not_a_number() {
        let gone = Field { now: shape(0.0, 0.0), ..believed() };
        let (norm, dip) = gone.against();
        assert!((norm + 1.0).abs() < 1e-6 && dip.is_finite(), "{norm} {dip}");
    }

    /// Ten seconds of freezing are given back in five, and no more than that.
    #[test]
    fn freezing_is_given_back_twice_as_fast() {
        let mut field = Field { good_time: 0.0, ..believed() };
        assert!((0..100).all(|_| field.belief(&CONFIG, 0.1, false) == 0.0), "frozen for ten seconds");
        field.good_time = 1.0;
        for (seconds, left) in [(2, 6.0f32), (2, 2.0), (2, 0.0), (2, 0.0)] {
            assert!((0..10 * seconds).all(|_| field.belief(&CONFIG, 0.1, false) == 1.0), "believed");
            assert!((field.frozen - left).abs() < 1e-3 && field.frozen >= 0.0, "{} {left}", field.frozen);
        }
    }
}
