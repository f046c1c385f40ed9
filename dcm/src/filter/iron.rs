//! Hard iron, found while the body turns.
//!
//! What it is: m = C^T m_E + h with m_E constant gives C m - mean(C m) = (C - mean(C)) h; three normal equations with
//! forgetting are solved for h, one sweep of Gauss and Seidel a reading.
//! What can go wrong: without turning nothing is learnt and nothing changes; a field that changes with place looks like hard
//! iron for a while, hence the dead zone.
//! Units: uT, s.
//! Reference: the same idea from rates: Troni & Whitcomb, IEEE/ASME T. Mechatronics 24(4), 2019.

use super::state::Words;
use crate::columns::{Column, dot, follow, least, plus, square};
use crate::config::IronConfig;
use crate::trig::root;

/// The state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Iron {
    config: IronConfig,
    /// Averages in earth axes: the three columns of the attitude, and the field.
    pub(super) average: [Column; 4],
    age: f32,
    /// Normal equations of each component: three of information, s, and one of evidence, uT s.
    equations: [[f32; 4]; 3],
    /// The estimate, uT, body axes.
    pub(super) found: Column,
}

impl Iron {
    /// Nothing known.
    #[inline(never)]
    pub(super) fn new(config: IronConfig) -> Self {
        Self { config, average: const { [[0.0; 3]; 4] }, age: 0.0, equations: const { [[0.0; 4]; 3] }, found: [0.0; 3] }
    }

    /// A reading without what was found, uT.
    #[inline(never)]
    pub(super) fn taken_from(&self, reading: &Column) -> Column {
        let long = root(square(&self.found));
        let excess = long - self.config.dead_zone;
        let share = if excess > 0.0 { least(excess, self.config.limit) / long } else { 0.0 };
        plus(reading, &self.found, -share)
    }

    /// Takes a reading in earth axes that stands for `dt` seconds, with the attitude of its time.
    pub(super) fn take(&mut self, attitude: &[Column; 3], seen: &Column, dt: f32) {
        let keep = if self.age > 0.0 { 1.0 - least(dt / self.config.memory, 1.0) } else { 0.0 };
        self.age = least(self.age + dt, self.config.lag);
        let k = least(dt / self.age, 1.0);
        let [a, b, c] = *attitude;
        let mut change = [a, b, c, *seen];
        follow(&mut self.average, &mut change, k);

        // what differs from the average before differs 1 - k times as much from the one after
        let weight = dt * (1.0 - k) * (1.0 - k);
        for (equation, one) in self.equations.iter_mut().zip(&change) {
            for (sum, other) in equation.iter_mut().zip(&change) {
                *sum = *sum * keep + weight * dot(one, other);
            }
        }
        self.solve();
    }

    /// One step towards the solution.
    fn solve(&mut self) {
        let [[xx, xy, xz, x], [_, yy, yz, y], [_, _, zz, z]] = &self.equations;
        let [fx, fy, fz] = &mut self.found;
        *fx = (x - xy * *fy - xz * *fz) / (xx + 1.0);
        *fy = (y - xy * *fx - yz * *fz) / (yy + 1.0);
        *fz = (z - xz * *fx - yz * *fy) / (zz + 1.0);
    }

    /// Forgets everything, for instance after a new calibration.
    pub(super) fn clear(&mut self) {
        self.age = 0.0;
        self.found = [0.0; 3];
    }
}

impl Words for Iron {
    fn words(&mut self, visit: &mut dyn FnMut(&mut f32)) {
        self.average.words(visit);
        visit(&mut self.age);
        self.equations.words(visit);
        self.found.words(visit);
    }
}
