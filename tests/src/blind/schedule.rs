//! Schedules: the command over time.
//!
//! What it is: staircases, up and down, ramps, random levels with random holds, repeated visits; always from rest, always from the
//! lowest to the highest level of the rig's range, so that another schedule never asks for an extrapolation.
//! What can go wrong: a schedule longer than the run is cut by stretching its holds to the run's length.
//! Units: s, us.
//! Reference: the thesis' staircase (21 levels, 50 us); the others are what tells time, speed and heat apart.

use super::chance::Chance;

/// What a schedule looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// Upward staircase.
    Stairs,
    /// Up and down again.
    UpDown,
    /// Ramp up, hold, ramp down.
    Ramp,
    /// Random levels and holds.
    Random,
    /// Some levels, visited again and again.
    Visits,
}

impl Shape {
    /// All shapes.
    pub const ALL: [Self; 5] = [Self::Stairs, Self::UpDown, Self::Ramp, Self::Random, Self::Visits];

    /// Name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Stairs => "stairs",
            Self::UpDown => "up-down",
            Self::Ramp => "ramp",
            Self::Random => "random",
            Self::Visits => "visits",
        }
    }
}

/// A command over time: straight lines between points, steps where two points share a time.
#[derive(Debug, Clone)]
pub struct Schedule {
    /// Its shape.
    pub shape: Shape,
    /// (time, pulse), in order.
    points: Vec<(f64, f64)>,
    /// Length, s.
    pub duration: f64,
}

impl Schedule {
    /// Draws a schedule of a shape and a length over `low..high` us.
    #[must_use]
    pub fn draw(shape: Shape, duration: f64, low: f64, high: f64, c: &mut Chance) -> Self {
        let rest = c.between(1.5, 5.0);
        let mut s = Self { shape, points: vec![(0.0, 1000.0), (rest, 1000.0)], duration };
        let span = duration - rest;
        match shape {
            Shape::Stairs | Shape::UpDown => {
                let n = c.of(&[11usize, 16, 21]);
                let mut levels: Vec<f64> = (0..n).map(|i| (low + (high - low) * i as f64 / (n - 1) as f64).round()).collect();
                if shape == Shape::UpDown {
                    let down: Vec<f64> = levels.iter().rev().skip(1).copied().collect();
                    levels.extend(down);
                }
                let hold = span / levels.len() as f64;
                for (i, l) in levels.iter().enumerate() {
                    s.hold(*l, rest + hold * (i + 1) as f64);
                }
            }
            Shape::Ramp => {
                let cycles = c.of(&[1usize, 1, 2, 3]);
                let each = span / cycles as f64;
                for k in 0..cycles {
                    let from = rest + each * k as f64;
                    let (up, top) = (c.between(0.3, 0.5) * each, c.between(0.05, 0.2) * each);
                    s.points.push((from, low));
                    s.points.push((from + up, high));
                    s.points.push((from + up + top, high));
                    s.points.push((from + each, low));
                }
            }
            Shape::Random | Shape::Visits => {
                let few: Vec<f64> = (0..c.of(&[6usize, 8, 10])).map(|_| c.between(low, high).round()).collect();
                let mut left = vec![low, high];
                let mut now = rest;
                let mean = (span / c.between(15.0, 60.0)).clamp(3.0, 20.0);
                let even = c.happens(0.4);
                while now < duration {
                    now += if even { mean } else { c.log_between(0.4 * mean, 2.0 * mean) };
                    let level = match left.pop() {
                        Some(l) => l,
                        None if shape == Shape::Random => c.between(low, high).round(),
                        None => {
                            if c.happens(0.2) {
                                c.of(&[low, high])
                            } else {
                                c.of(&few)
                            }
                        }
                    };
                    s.hold(level, now);
                }
            }
        }
        s
    }

    /// Moves every change to the nearest multiple of `step`, s.
    pub fn align(&mut self, step: f64) {
        self.points.iter_mut().for_each(|p| p.0 = (p.0 / step).round() * step);
    }

    /// Moves every jump to the middle of the interval of rows, `hz` a second, in which it lies: where a reader of the log has to put it.
    pub fn as_logged(&mut self, hz: f64) {
        for k in 1..self.points.len() {
            let [a, b] = [self.points[k - 1], self.points[k]];
            if (a.0, a.1 == b.1) == (b.0, false) {
                let middle = ((a.0 * hz).floor() + 0.5) / hz;
                (self.points[k - 1].0, self.points[k].0) = (middle, middle);
            }
        }
    }

    fn hold(&mut self, level: f64, until: f64) {
        let from = self.points.last().map_or(0.0, |p| p.0);
        self.points.push((from, level));
        self.points.push((until, level));
    }

    /// Pulse at evenly spaced instants `k h`, to a tenth of a microsecond.
    #[must_use]
    pub fn sampled(&self, h: f64, n: usize) -> Vec<f64> {
        let mut at = 0;
        (0..n)
            .map(|k| {
                let t = k as f64 * h + 1e-9;
                while at + 1 < self.points.len() && self.points[at + 1].0 <= t {
                    at += 1;
                }
                let (t0, p0) = self.points[at];
                let p = match self.points.get(at + 1) {
                    Some((t1, p1)) if *t1 > t0 => p0 + (p1 - p0) * (t - t0) / (t1 - t0),
                    _ => p0,
                };
                (p * 10.0).round() / 10.0
            })
            .collect()
    }
}
