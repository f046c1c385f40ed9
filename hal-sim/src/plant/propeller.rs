//! Fixed-pitch propeller at rest in still air.
//!
//! What it is: thrust and torque by the square law, scaled with the density of the air; the propellers of the thesis.
//! What can go wrong: stall and blade flex are effects of their own, not part of this law.
//! Units: SI; coefficients in N.s^2 and N.m.s^2 at the reference density.
//! Reference: Beharie 2013 section 2.3; hover figure and Table 9 as corrected in the errata.

use super::air::SEA_LEVEL_DENSITY;

/// Parameters of one propeller.
#[derive(Debug, Clone, PartialEq)]
pub struct Propeller {
    /// Name, diameter x pitch in inches.
    pub name: String,
    /// Number of blades.
    pub blades: u32,
    /// Thrust coefficient, N.s^2: thrust = k_T w^2.
    pub thrust_coefficient: f64,
    /// Torque coefficient, N.m.s^2: drag torque = k_Q w^2.
    pub torque_coefficient: f64,
    /// Density for which the coefficients hold, kg/m^3.
    pub reference_density: f64,
    /// Inertia about the shaft, kg.m^2.
    pub inertia_kgm2: f64,
}

/// Name, blades, full-throttle thrust N and current A on the 570 KV motor at 11.5 V (errata, Table 9), diameter m, mass kg (assumed).
///
/// The 9x4.7 row is left out: less thrust at more current than 10x4.5 on the same motor cannot come from this law. That propeller
/// takes its coefficients from 171 g at 1.61 A on the 390 KV motor instead (errata, "extremes").
const TABLE_9: [(&str, u32, f64, f64, f64, f64); 5] = [
    ("10x4.5", 2, 4.129, 5.24, 0.254, 0.011),
    ("11x4.5", 2, 5.679, 7.67, 0.2794, 0.014),
    ("11x4.7", 2, 5.779, 7.33, 0.2794, 0.014),
    ("12x4.5", 2, 5.754, 9.43, 0.3048, 0.017),
    ("9x4.5x3", 3, 4.004, 4.25, 0.2286, 0.013),
];

/// The propeller whose row in Table 9 cannot be.
const SMALLEST: &str = "9x4.7";

impl Propeller {
    /// A propeller of the thesis by its name ("11x4.7"), with coefficients from one stated figure and the constants of the motor
    /// that it was measured on.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        if name == SMALLEST {
            return Self::fitted(name, 2, "390KV", (0.171 * 9.806_65, 1.61), (0.2286, 0.010));
        }
        let &(name, blades, thrust, current, diameter, mass) = TABLE_9.iter().find(|row| row.0 == name)?;
        Self::fitted(name, blades, "570KV", (thrust, current), (diameter, mass))
    }

    /// Coefficients from thrust and current at full throttle and 11.5 V.
    fn fitted(name: &str, blades: u32, motor: &str, full: (f64, f64), size: (f64, f64)) -> Option<Self> {
        let ((thrust, current), (diameter, mass)) = (full, size);
        let motor = super::motor::Motor::named(motor)?;
        let k = motor.torque_constant();
        let speed = (11.5 - motor.resistance_ohm * current) / k;
        Some(Self {
            name: name.to_owned(),
            blades,
            thrust_coefficient: thrust / (speed * speed),
            torque_coefficient: k * (current - motor.no_load_current_a) / (speed * speed),
            reference_density: SEA_LEVEL_DENSITY,
            // A tapered blade has about 0.6 of the inertia of a uniform rod.
            inertia_kgm2: 0.6 * mass * diameter * diameter / 12.0,
        })
    }

    /// Names of the propellers that [`Propeller::named`] knows.
    pub fn names() -> impl Iterator<Item = &'static str> {
        TABLE_9.iter().map(|row| row.0).chain([SMALLEST])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hover_coefficient_of_the_errata_comes_out() {
        let p = Propeller::named("11x4.7").unwrap();
        assert!((p.thrust_coefficient - 1.56e-5).abs() < 0.02e-5, "{}", p.thrust_coefficient);
    }
}
