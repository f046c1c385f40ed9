//! Hard iron, found while the body turns.
//!
//! What it is: m = C^T m_E + h with m_E constant gives C m - mean(C m) = (C - mean(C)) h; three normal equations with
//! forgetting are solved for h.
//! What can go wrong: without turning nothing is learnt and nothing changes; a field that changes with place looks like hard
//! iron for a while, hence the dead zone.
//! Units: uT, s.
//! Reference: the same idea from rates: Troni & Whitcomb, IEEE/ASME T. Mechatronics 24(4), 2019.

use super::state::Words;
use crate::config::IronConfig;
use crate::linear::{inverse, square};
use crate::trig::root;
use crate::{Mat3, Vec3};

/// Readings between two solutions.
const SOLVE_EVERY: f32 = 64.0;

/// The state.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Iron {
    attitude: Mat3,
    field: Vec3,
    age: f32,
    /// Information, s: upper triangle xx, xy, xz, yy, yz, zz.
    information: Mat3,
    evidence: Vec3,
    count: f32,
    /// The estimate, uT, body axes.
    pub(super) found: Vec3,
}

impl Iron {
    /// What is taken from the readings, uT.
    pub(super) fn applied(&self, config: &IronConfig) -> Vec3 {
        let square = square(&self.found);
        let least = config.dead_zone;
        if square <= least * least {
            return Vec3::zeros();
        }
        let long = root(square);
        self.found * ((long - least).min(config.limit) / long)
    }

    /// The earth frame turned by `turn` since the last reading.
    pub(super) fn turned(&mut self, turn: &Vec3) {
        for mut column in self.attitude.column_iter_mut() {
            let c = column.clone_owned();
            column += turn.cross(&c);
        }
        self.field += turn.cross(&self.field);
    }

    /// Takes a reading in body axes that stands for `dt` seconds, with the attitude of its time.
    pub(super) fn take(&mut self, attitude: &Mat3, reading: &Vec3, dt: f32, config: &IronConfig) {
        self.age = (self.age + dt).min(config.lag);
        let k = (dt / self.age).min(1.0);
        let seen = attitude * reading;
        self.attitude += (attitude - self.attitude) * k;
        self.field += (seen - self.field) * k;

        let turned = attitude - self.attitude;
        let change = seen - self.field;
        let keep = (1.0 - dt / config.memory).max(0.0);
        let (a, b, c) = (turned.column(0), turned.column(1), turned.column(2));
        let (xy, xz, yz) = (a.dot(&b) * dt, a.dot(&c) * dt, b.dot(&c) * dt);
        let new = Mat3::new(a.dot(&a) * dt, xy, xz, xy, b.dot(&b) * dt, yz, xz, yz, c.dot(&c) * dt);
        self.information = self.information * keep + new;
        self.evidence = self.evidence * keep + Vec3::new(a.dot(&change), b.dot(&change), c.dot(&change)) * dt;

        self.count += 1.0;
        if self.count >= SOLVE_EVERY {
            self.count = 0.0;
            if let Some(inverse) = inverse(&(self.information + Mat3::identity())) {
                self.found = inverse * self.evidence;
            }
        }
    }

    /// Forgets everything, for instance after a new calibration.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }
}

impl Words for Iron {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        self.attitude.words(visit);
        self.field.words(visit);
        visit(&mut self.age);
        self.information.words(visit);
        self.evidence.words(visit);
        visit(&mut self.count);
        self.found.words(visit);
    }
}
