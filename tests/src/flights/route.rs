//! Where a flight goes: legs between points, each smooth, with turns, climbs and a pass near the ground.
//!
//! What it is: references of place and heading in time, drawn by a seed; every route holds a hover, fast and slow legs both ways, a climb and
//! a descent, turns of the nose, and a low pass.
//! What can go wrong: nothing.
//! Units: m, s, rad; earth NED.
//! Reference: smooth steps of the fifth order (minimum jerk).

use super::V;
use crate::blind::chance::Chance;
use std::f64::consts::PI;

/// A leg: from where the last one ended.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Leg {
    from: f64,
    seconds: f64,
    start: [f64; 4],
    end: [f64; 4],
}

/// A route.
#[derive(Debug, Clone, PartialEq)]
pub struct Route {
    legs: Vec<Leg>,
}

/// What is wanted at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    /// Place.
    pub place: V,
    /// Velocity.
    pub velocity: V,
    /// Acceleration.
    pub pull: V,
    /// Heading.
    pub heading: f64,
}

impl Route {
    /// Draws one for a vehicle with arms of `arm` metres: speeds up to some 4 m/s.
    #[must_use]
    pub fn draw(arm: f64, k: &mut Chance) -> Self {
        let high = k.between(0.8, 2.0) + 4.0 * arm;
        let mut out = Self { legs: Vec::new() };
        let mut at = [0.0, 0.0, -high, k.between(-PI, PI)];
        out.legs.push(Leg { from: 0.0, seconds: 2.0, start: at, end: at });
        let top = k.between(2.0, 4.5);
        let course = k.between(-PI, PI);
        for part in 0..k.between(9.0, 13.0) as usize {
            match part % 5 {
                0 | 2 => {
                    // there and back, at two speeds
                    let speed = if part % 5 == 0 { top } else { k.between(0.3, 0.7) * top };
                    let along = course + 0.5 * PI * part as f64 + 0.3 * k.normal();
                    let far = k.between(1.2, 2.2) * speed;
                    let home = at;
                    let there = [at[0] + far * along.cos(), at[1] + far * along.sin(), at[2], at[3]];
                    let seconds = (1.9 * far / speed).max(1.0);
                    out.go(&mut at, there, seconds);
                    out.go(&mut at, home, seconds * k.between(1.0, 1.3));
                }
                1 => {
                    let turned = [at[0], at[1], at[2], at[3] + k.sign() * k.between(0.5, 1.0) * PI];
                    out.go(&mut at, turned, k.between(1.5, 2.5));
                }
                3 => {
                    let climbed = [at[0], at[1], -high - k.between(1.0, 2.5), at[3]];
                    let back = [at[0], at[1], -high, at[3]];
                    let seconds = k.between(1.6, 2.6);
                    out.go(&mut at, climbed, seconds);
                    out.go(&mut at, back, seconds * k.between(1.0, 1.4));
                }
                _ => {
                    // low over the ground for a while
                    let low = -k.between(1.2, 2.0) * arm;
                    let down = [at[0], at[1], low, at[3]];
                    out.go(&mut at, down, k.between(1.8, 2.5));
                    let past = [at[0] + k.between(-0.5, 0.5), at[1] + k.between(-0.5, 0.5), low, at[3]];
                    out.go(&mut at, past, 2.0);
                    let up = [at[0], at[1], -high, at[3]];
                    out.go(&mut at, up, k.between(1.5, 2.5));
                }
            }
        }
        out
    }

    fn go(&mut self, at: &mut [f64; 4], end: [f64; 4], seconds: f64) {
        let from = self.seconds();
        self.legs.push(Leg { from, seconds, start: *at, end });
        *at = end;
    }

    /// How long it takes, s.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.legs.last().map_or(0.0, |l| l.from + l.seconds)
    }

    /// What is wanted at `t`.
    #[must_use]
    pub fn at(&self, t: f64) -> Wanted {
        let leg = self.legs.iter().rev().find(|l| t >= l.from).unwrap_or(&self.legs[0]);
        let s = ((t - leg.from) / leg.seconds).clamp(0.0, 1.0);
        let step = s * s * s * (10.0 + s * (6.0 * s - 15.0));
        let rate = 30.0 * s * s * (1.0 - s) * (1.0 - s) / leg.seconds;
        let bend = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (leg.seconds * leg.seconds);
        let way: V = std::array::from_fn(|k| leg.end[k] - leg.start[k]);
        Wanted {
            place: std::array::from_fn(|k| leg.start[k] + step * way[k]),
            velocity: way.map(|w| rate * w),
            pull: way.map(|w| bend * w),
            heading: leg.start[3] + step * (leg.end[3] - leg.start[3]),
        }
    }

    /// Where it begins, and the heading.
    #[must_use]
    pub fn begins(&self) -> (V, f64) {
        let first = self.at(0.0);
        (first.place, first.heading)
    }
}
