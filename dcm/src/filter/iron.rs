//! Hard iron, found while the body turns.
//!
//! What it is: m = C^T m_E + h with m_E constant gives C m - mean(C m) = (C - mean(C)) h; three normal equations with
//! forgetting are solved for h, one sweep of Gauss and Seidel a reading.
//! What can go wrong: without turning nothing is learnt and nothing changes; a field that changes with place looks like hard
//! iron for a while, hence the dead zone.
//! Units: uT, s.
//! Reference: the same idea from rates: Troni & Whitcomb, IEEE/ASME T. Mechatronics 24(4), 2019.

use super::state::Words;
use crate::columns::{Column, add_scaled, follow, lesser, square, turn};
use crate::config::IronConfig;
use crate::trig::root;

/// The state.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Iron {
    /// Averages in earth axes: the three columns of the attitude, and the field.
    pub(super) average: [Column; 4],
    age: f32,
    /// Averages of the normal equations: three columns of information, and one of evidence, uT.
    equations: [Column; 4],
    /// The estimate, uT, body axes.
    pub(super) found: Column,
}

impl Iron {
    /// A reading without what was found, uT.
    #[inline(never)]
    pub(super) fn taken_from(&self, reading: &Column, dead_zone: f32, limit: f32) -> Column {
        let long = root(square(&self.found));
        let excess = long - dead_zone;
        let share = if excess > 0.0 { lesser(excess, limit) / long } else { 0.0 };
        add_scaled(reading, &self.found, -share)
    }

    /// Takes a reading in earth axes that stands for `dt` seconds, with the attitude of its time.
    #[inline]
    pub(super) fn take(&mut self, config: &IronConfig, attitude: &[Column; 3], seen: &Column, dt: f32) {
        let share = if self.age > 0.0 { lesser(dt / config.memory, 1.0) } else { 1.0 };
        self.age = lesser(self.age + dt, config.lag);
        let [a, b, c] = *attitude;
        let mut change = [a, b, c, *seen];
        follow(&mut self.average, &mut change, lesser(dt / self.age, 1.0));

        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz], _] = change;
        turn(&[[ax, bx, cx], [ay, by, cy], [az, bz, cz]], &mut change);
        follow(&mut self.equations, &mut change, share);
        self.solve(1.0 / config.memory);
    }

    /// One step towards the solution; `doubt` is the information that an offset of zero starts with.
    #[inline]
    fn solve(&mut self, doubt: f32) {
        let [[xx, xy, xz], [_, yy, yz], [.., zz], [x, y, z]] = &self.equations;
        let [fx, fy, fz] = &mut self.found;
        *fx = (x - xy * *fy - xz * *fz) / (xx + doubt);
        *fy = (y - xy * *fx - yz * *fz) / (yy + doubt);
        *fz = (z - xz * *fx - yz * *fy) / (zz + doubt);
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
