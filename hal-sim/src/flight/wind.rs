//! Wind: a steady part and gusts.
//!
//! What it is: Dryden turbulence at one place, carried past by the mean wind: along it a first-order filter of white noise, across it
//! and upwards the second-order one. One intensity and one length for all three axes (as above 600 m in the standard).
//! What can go wrong: nothing; without a mean wind the gusts are carried by their own intensity, or they would stand still.
//! Units: m/s, m; earth NED, an air mass that moves north has a positive first component.
//! Reference: MIL-F-8785C, 3.7.1.2 (Dryden form); the specification `flight.md`.

use super::Vector;
use crate::noise::{Source, Stream};

/// Interval at which the gusts move on, s.
pub const INTERVAL_S: f64 = 1.0e-3;

/// What blows.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Blowing {
    /// Mean wind, earth NED, m/s.
    pub steady: [f64; 3],
    /// Standard deviation of the gusts along each axis, m/s; 0 for none.
    pub gust_m_s: f64,
    /// Length of the turbulence, m.
    pub gust_length_m: f64,
}

/// Wind in time.
#[derive(Debug, Clone)]
pub struct Wind {
    steady: Vector,
    /// Unit vectors along the mean wind, across it and down.
    axes: [Vector; 3],
    streams: [Stream; 3],
    keep: f64,
    kick: [f64; 3],
    follow: f64,
    first: [f64; 3],
    second: [f64; 3],
    gusty: bool,
}

impl Wind {
    /// The wind of `blowing`; the gusts begin as if they had always blown.
    #[must_use]
    pub fn new(blowing: &Blowing, seed: u64) -> Self {
        let steady = Vector::from(blowing.steady);
        let gusty = blowing.gust_m_s > 0.0;
        let carried = steady.norm().max(blowing.gust_m_s);
        let tau_s = if gusty { blowing.gust_length_m / carried } else { 1.0 };
        let keep = libm::exp(-INTERVAL_S / tau_s);
        // across: (1 + sqrt(3) T s)/(1 + T s)^2 of a noise whose first-order image has half the wanted variance
        let sigma = blowing.gust_m_s;
        let stationary = [sigma, sigma * core::f64::consts::FRAC_1_SQRT_2, sigma * core::f64::consts::FRAC_1_SQRT_2];
        let mut streams = [0, 1, 2].map(|axis| Stream::new(seed, Source::Wind, axis));
        let first: [f64; 3] = core::array::from_fn(|i| stationary[i] * streams[i].normal());
        // of variance s^2 the first, the second has s^2/2 and shares s^2/2 with it: given the first, half of it and a variance of s^2/4
        let mut own = [3, 4, 5].map(|axis| Stream::new(seed, Source::Wind, axis));
        let second = core::array::from_fn(|i| 0.5 * (first[i] + stationary[i] * own[i].normal()));
        Self {
            steady,
            axes: axes_of(&steady),
            keep,
            kick: stationary.map(|s| s * (1.0 - keep * keep).sqrt()),
            follow: 1.0 - keep,
            first,
            second,
            streams,
            gusty,
        }
    }

    /// Moves on by [`INTERVAL_S`]; the wind then, earth NED, m/s.
    pub fn advance(&mut self) -> Vector {
        if !self.gusty {
            return self.steady;
        }
        let sqrt3 = 3.0_f64.sqrt();
        let mut wind = self.steady;
        for (i, axis) in self.axes.iter().enumerate() {
            let before = self.first[i];
            self.first[i] = self.keep * before + self.kick[i] * self.streams[i].normal();
            self.second[i] += self.follow * (0.5 * (before + self.first[i]) - self.second[i]);
            let along = if i == 0 { self.first[0] } else { sqrt3 * self.first[i] + (1.0 - sqrt3) * self.second[i] };
            wind += axis * along;
        }
        wind
    }
}

/// Along the level part of the wind (north where there is none), across it, and down.
fn axes_of(steady: &Vector) -> [Vector; 3] {
    let level = Vector::new(steady.x, steady.y, 0.0);
    let along = if level.norm() > 0.0 { level / level.norm() } else { Vector::x() };
    [along, Vector::z().cross(&along), Vector::z()]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Standard deviation along each axis, and the correlation over one time constant of the part along the wind: 1/e.
    #[test]
    fn gusts_have_the_wanted_size_and_memory() {
        let blowing = Blowing { steady: [0.0, 4.0, 0.0], gust_m_s: 1.5, gust_length_m: 2.0 };
        let mut wind = Wind::new(&blowing, 3);
        let gusts: Vec<Vector> = (0..2_000_000).map(|_| wind.advance() - Vector::new(0.0, 4.0, 0.0)).collect();
        let n = gusts.len() as f64;
        for axis in 0..3 {
            let variance = gusts.iter().map(|g| g[axis] * g[axis]).sum::<f64>() / n;
            assert!((variance.sqrt() / 1.5 - 1.0).abs() < 0.04, "axis {axis}: {}", variance.sqrt());
        }
        let lag = 500; // 2 m at 4 m/s
        let kept = gusts.windows(lag + 1).map(|w| w[0].y * w[lag].y).sum::<f64>() / (n * 1.5 * 1.5);
        assert!((kept - (-1.0f64).exp()).abs() < 0.06, "{kept}");
    }

    /// At the start, over many seeds: what gusts have that have always blown, and the filter's second state too (half the variance of its first).
    #[test]
    fn gusts_begin_as_if_they_had_always_blown() {
        let blowing = Blowing { steady: [4.0, 0.0, 0.0], gust_m_s: 1.5, gust_length_m: 2.0 };
        let winds: Vec<Wind> = (0..8_000).map(|seed| Wind::new(&blowing, seed)).collect();
        let share = |of: &dyn Fn(&Wind) -> f64| winds.iter().map(|w| of(w).powi(2)).sum::<f64>() / (winds.len() as f64 * 2.25);
        for axis in 1..3 {
            let (first, second) = (share(&|w| w.first[axis]), share(&|w| w.second[axis]));
            assert!((first - 0.5).abs() < 0.03 && (second - 0.25).abs() < 0.015, "{first} {second}");
            let begins = share(&|w| (w.clone().advance() - Vector::new(4.0, 0.0, 0.0))[axis]);
            assert!((begins - 1.0).abs() < 0.06, "{begins}");
        }
    }

    #[test]
    fn the_same_seed_blows_the_same_and_a_calm_is_calm() {
        let blowing = Blowing { steady: [1.0, 0.0, 0.0], gust_m_s: 1.0, gust_length_m: 20.0 };
        let blow = |seed| -> Vec<Vector> {
            let mut wind = Wind::new(&blowing, seed);
            (0..100).map(|_| wind.advance()).collect()
        };
        assert_eq!(blow(1), blow(1));
        assert_ne!(blow(1), blow(2));
        let calm = Wind::new(&Blowing { gust_m_s: 0.0, ..blowing }, 1).advance();
        assert_eq!(calm, Vector::new(1.0, 0.0, 0.0));
    }
}
