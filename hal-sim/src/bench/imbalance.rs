//! The force of a rotor whose mass is not on its axis.
//!
//! What it is: a force that turns with the rotor and grows with the square of its speed, ten steps at once with their angles.
//! What can go wrong: angles must not be negative, nor reach 2^51 revolutions.
//! Units: N, rev, rev/s; rev/min of the powerplant.
//! Reference: F = m r w^2 along the beam's axis, Beharie 2013 section 5.7.1.

use super::STEP_S;
use core::f64::consts::TAU;
use multiversion::multiversion;

/// Steps that go side by side: three vectors of four.
pub(super) const TOGETHER: usize = 12;

/// Speeds that a powerplant may give, rev/min; with any other the rotor rests.
pub(super) const SPEEDS: core::ops::Range<f64> = 0.0..1.0e6;

/// Ten steps of the rotor as sensors and beam feel them. What is beyond the ten fills the last vector and is left there.
#[derive(Debug, Default)]
pub(super) struct Whirl {
    /// Speed in each step, rev/s.
    pub(super) rev_s: [f64; TOGETHER],
    /// Angle before the first step and after each, rev.
    pub(super) turned: [f64; TOGETHER + 1],
    /// Force of the unbalance after each step, N.
    pub(super) force_n: [f64; TOGETHER],
}

impl Whirl {
    /// Goes on from `angle_rev` with the speeds `rpm`.
    #[inline]
    pub(super) fn turn(&mut self, angle_rev: f64, rpm: &[f64]) {
        for (rev_s, rpm) in self.rev_s.iter_mut().zip(rpm) {
            *rev_s = if SPEEDS.contains(rpm) { *rpm } else { 0.0 } / 60.0;
        }
        let mut angle = angle_rev;
        self.turned[0] = angle;
        for (turned, rev_s) in self.turned[1..].iter_mut().zip(&self.rev_s) {
            angle += rev_s * STEP_S;
            *turned = angle;
        }
    }

    /// The force of the unbalance in each step.
    #[inline]
    pub(super) fn shake(&mut self, shake_n: f64, heavy_spot_rev: f64) {
        shake(&mut self.force_n, &self.rev_s, &self.turned[1..], shake_n, heavy_spot_rev);
    }
}

/// The force of the unbalance in each step. Slices of no fixed length, so that the steps go side by side, in vectors as wide as the
/// processor has them: chosen as it runs, with the same numbers for all.
#[multiversion(targets("x86_64+avx2"))]
fn shake(force_n: &mut [f64], rev_s: &[f64], turned: &[f64], shake_n: f64, heavy_spot_rev: f64) {
    for ((force, speed), turn) in force_n.iter_mut().zip(rev_s).zip(turned) {
        *force = shake_n * speed * speed * turn_cosine(turn + heavy_spot_rev);
    }
}

/// 2^52: a double of this size has no fraction.
const ROUNDING: f64 = 4_503_599_627_370_496.0;

/// cos(2 pi turn), to 1e-10: the Taylor series of the nearest half turn. `libm::cos` costs as much as the rest of a step.
#[inline]
pub(super) fn turn_cosine(turn: f64) -> f64 {
    // angles are not negative and below 2^51: adding 2^52 leaves no fraction, so this is the floor, and it goes two at a time
    let nearest = (turn + ROUNDING) - ROUNDING;
    let part = turn - if nearest > turn { nearest - 1.0 } else { nearest };
    let near = (part - 0.5).abs(); // 0.5 at the heavy spot, 0 opposite
    let (distance, sign) = if near > 0.25 { (0.5 - near, 1.0) } else { (near, -1.0) };
    let y = TAU * TAU * distance * distance;
    // pairs of terms side by side (Estrin): half the time of Horner's chain
    let (y2, y4) = (y * y, y * y * y * y);
    let low = (1.0 - y * 0.5) + y2 * (1.0 / 24.0 - y * (1.0 / 720.0));
    let high = (1.0 / 40_320.0 - y * (1.0 / 3_628_800.0)) + y2 * (1.0 / 479_001_600.0 - y * (1.0 / 87_178_291_200.0));
    sign * (low + y4 * (high + y4 * (1.0 / 20_922_789_888_000.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cosine_of_a_turn_is_that_of_the_library() {
        for i in 0..6000 {
            let turn = f64::from(i) * 1.37e-3;
            assert!((turn_cosine(turn) - libm::cos(TAU * turn)).abs() < 1e-10, "{turn}");
        }
    }
}
