//! What keeps a real blade from the square law.
//!
//! What it is: factors on thrust and torque from the blade's own bending and from the Reynolds number of its section.
//! What can go wrong: a resting rotor has no Reynolds number; the factor is 1 there.
//! Units: rev/min, 1.
//! Reference: Beharie 2013 section 2.4 (aero-elastic blades); Deters, Ananda & Selig 2014 for small propellers' thrust against
//! Reynolds number, a power of about 0.05 to 0.15.

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
}

impl Default for Blade {
    fn default() -> Self {
        Self { flex_onset_rpm: f64::INFINITY, flex_loss: 0.0, flex_exponent: 2.0, reynolds_exponent: 0.0 }
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
        assert!(small.factors(2050.0).0 < 0.94 && (small.factors(4100.0).0 - 1.0).abs() < 1e-12);
    }
}
