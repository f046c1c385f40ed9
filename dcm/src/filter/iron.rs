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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::columns::ZERO;

    const CONFIG: IronConfig = crate::Config::DEFAULT.iron;

    fn near(a: &Column, b: &Column, far: f32) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < far)
    }

    /// What is longer than the dead zone is shortened by it, up to the limit, and taken off.
    #[test]
    fn what_is_beyond_the_dead_zone_is_taken_off() {
        let taken = |found: Column, dead_zone: f32, limit: f32| {
            Iron { found, ..Iron::default() }.taken_from(&[1.0, 2.0, 3.0], dead_zone, limit)
        };
        assert!(near(&taken([0.0, 12.0, 16.0], 5.0, 100.0), &[1.0, 2.0 - 9.0, 3.0 - 12.0], 1e-5), "15 of 20");
        assert!(near(&taken([0.0, 12.0, 16.0], 5.0, 10.0), &[1.0, 2.0 - 6.0, 3.0 - 8.0], 1e-5), "10 at most");
        assert_eq!(taken([0.0, 3.0, 0.0], 5.0, 100.0), [1.0, 2.0, 3.0], "within the dead zone");
        assert_eq!(taken([0.0; 3], 0.0, 100.0), [1.0, 2.0, 3.0], "nothing was found");
    }

    /// An offset that solves the equations is kept by a step, and any other comes to it.
    #[test]
    fn the_solution_of_the_equations_is_where_the_steps_end() {
        let (doubt, known) = (0.1, [3.0f32, -4.0, 5.0]);
        let [a, b, c] = [[2.0f32, 0.5, -0.3], [0.5, 1.5, 0.4], [-0.3, 0.4, 1.0]];
        let mut right = add_scaled(&ZERO, &known, doubt);
        for (column, offset) in [a, b, c].iter().zip(known) {
            right = add_scaled(&right, column, offset);
        }
        let mut iron = Iron { equations: [a, b, c, right], found: known, ..Iron::default() };
        iron.solve(doubt);
        assert!(near(&iron.found, &known, 1e-5), "{:?}", iron.found);
        iron.found = ZERO;
        (0..50).for_each(|_| iron.solve(doubt));
        assert!(near(&iron.found, &known, 1e-4), "{:?}", iron.found);
    }

    /// Evidence from before counts no more.
    #[test]
    fn what_was_forgotten_does_not_come_back() {
        let mut iron = Iron { equations: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [9.0; 3]], ..Iron::default() };
        iron.clear();
        iron.take(&CONFIG, &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], &[20.0, 0.0, 43.0], 0.05);
        assert_eq!(iron.found, ZERO);
    }
}
