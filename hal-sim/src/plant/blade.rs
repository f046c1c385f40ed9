//! What keeps a real blade from the square law.
//!
//! What it is: factors on thrust and torque from the blade's own bending, from the Reynolds number of its section, and from
//! a stall that begins at the tip.
//! What can go wrong: a resting rotor has no Reynolds number; the factor is 1 there.
//! Units: rev/min, 1.
//! Reference: Beharie 2013 section 2.4 (aero-elastic blades); Deters, Ananda & Selig 2014 for small propellers' thrust against
//! Reynolds number, a power of about 0.05 to 0.15; Leishman 2006, *Principles of Helicopter Aerodynamics*, 7.1 (stall).

/// Speed at which the coefficients of the catalogue hold, rev/min (hover, errata).
const REFERENCE_RPM: f64 = 4100.0;

/// Parameters. The default blade is rigid and keeps its coefficients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blade {
    /// Speed above which the blade bends, rev/min.
    pub flex_onset_rpm: f64,
    /// Loss of thrust at twice that speed, 0..1; torque loses half of it.
    pub flex_loss: f64,
    /// Exponent of the loss in the excess of speed.
    pub flex_exponent: f64,
    /// Exponent of the thrust coefficient in the Reynolds number.
    pub reynolds_exponent: f64,
    /// Speed above which the section at the tip stalls; the stall then moves inboard, rev/min.
    pub stall_onset_rpm: f64,
    /// Share of its lift that a stalled section loses.
    pub stall_loss: f64,
    /// Share by which the drag of a stalled section grows.
    pub stall_rise: f64,
}

impl Default for Blade {
    fn default() -> Self {
        Self {
            flex_onset_rpm: f64::INFINITY,
            flex_loss: 0.0,
            flex_exponent: 2.0,
            reynolds_exponent: 0.0,
            stall_onset_rpm: f64::INFINITY,
            stall_loss: 0.0,
            stall_rise: 0.0,
        }
    }
}

impl Blade {
    /// Factors on thrust and torque at `rpm`.
    #[must_use]
    pub fn factors(&self, rpm: f64) -> (f64, f64) {
        let (mut thrust, mut torque) = (1.0, 1.0);
        if rpm > self.flex_onset_rpm {
            let loss = self.flex_loss * libm::pow(rpm / self.flex_onset_rpm - 1.0, self.flex_exponent);
            thrust *= (1.0 - loss).max(0.0);
            torque *= (1.0 - 0.5 * loss).max(0.0);
        }
        if self.reynolds_exponent != 0.0 && rpm > 1.0 {
            thrust *= libm::pow(rpm / REFERENCE_RPM, self.reynolds_exponent);
        }
        if rpm > self.stall_onset_rpm {
            // A section stalls once its own speed exceeds that of the tip at the onset. Lift grows with the square of the radius
            // and its share of the torque with the cube, so the stalled outer part holds 1 - r^3 of one and 1 - r^4 of the other.
            let r = self.stall_onset_rpm / rpm;
            let r3 = r * r * r;
            thrust *= 1.0 - self.stall_loss * (1.0 - r3);
            torque *= 1.0 + self.stall_rise * (1.0 - r3 * r);
        }
        (thrust, torque)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rigid_blade_keeps_its_law_and_a_soft_one_falls_short() {
        assert_eq!(Blade::default().factors(5000.0), (1.0, 1.0));
        let soft = Blade { flex_onset_rpm: 3000.0, flex_loss: 0.2, flex_exponent: 2.0, ..Blade::default() };
        assert_eq!(soft.factors(3000.0), (1.0, 1.0));
        assert!((soft.factors(6000.0).0 - 0.8).abs() < 1e-12 && (soft.factors(6000.0).1 - 0.9).abs() < 1e-12);
        let small = Blade { reynolds_exponent: 0.1, ..Blade::default() };
        assert_eq!(small.factors(0.0), (1.0, 1.0));
        let stalled = Blade { stall_onset_rpm: 4000.0, stall_loss: 0.4, stall_rise: 0.5, ..Blade::default() };
        assert_eq!(stalled.factors(4000.0), (1.0, 1.0));
        let (thrust, torque) = stalled.factors(5000.0); // sections beyond 0.8 of the radius
        assert!((thrust - (1.0 - 0.4 * 0.488)).abs() < 1e-12 && (torque - (1.0 + 0.5 * 0.5904)).abs() < 1e-12);
        assert!(small.factors(2050.0).0 < 0.94 && (small.factors(4100.0).0 - 1.0).abs() < 1e-12);
    }
}
