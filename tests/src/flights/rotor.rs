//! A rotor in moving air, from blade elements and momentum.
//!
//! What it is: lift of blades of one pitch with the inflow that momentum theory asks for; drag of their profiles averaged over the turn.
//! What can go wrong: momentum theory has no solution in a fast descent along the axis; the search then stays at its last value.
//! Units: SI; `across` and `up` are the rotor's own speed through the air.
//! Reference: Leishman, *Principles of Helicopter Aerodynamics*, 2006, sections 2.14 and 3.3; Glauert 1926.

use super::AIR;

/// What a rotor is beside its static law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blades {
    /// Radius, m.
    pub radius: f64,
    /// Thrust over speed squared at rest.
    pub kt: f64,
    /// Lift that the own inflow takes at rest, as a share of what is left.
    pub inflow: f64,
}

impl Blades {
    /// Thrust and induced speed at a rotor speed `w`, N and m/s; `near` is the induced speed that the ground takes off, as a share of it.
    #[must_use]
    pub fn thrust(&self, w: f64, across: f64, up: f64, near: f64, from: f64) -> (f64, f64) {
        let disc = std::f64::consts::PI * self.radius * self.radius;
        let at_rest = (self.kt / (2.0 * AIR * disc)).sqrt(); // induced speed over w
        let (lift, taken) = (self.kt * (1.0 + self.inflow), self.kt * self.inflow / at_rest);
        let advance = across / (w * self.radius).max(1e-6);
        let blade = |v: f64| lift * w * w * (1.0 + 1.5 * advance * advance) - taken * w * (v * (1.0 - near) + up);
        let momentum = |v: f64| 2.0 * AIR * disc * v * (across * across + (v + up) * (v + up)).sqrt();
        let mut v = if from > 0.0 { from } else { at_rest * w };
        for _ in 0..6 {
            let f = blade(v) - momentum(v);
            let slope = (blade(v + 1e-4) - momentum(v + 1e-4) - f) / 1e-4;
            if slope.abs() > 1e-12 {
                v = (v - f / slope).clamp(0.05 * at_rest * w, 3.0 * at_rest * w);
            }
        }
        (blade(v), v)
    }

    /// Force against the motion across, over the profile drag's size: the mean over the turn of a blade's drag times its direction.
    #[must_use]
    pub fn drag(&self, w: f64, across: f64) -> f64 {
        const TURN: usize = 12;
        const SPAN: usize = 6;
        let mut sum = 0.0;
        for a in 0..TURN {
            let sine = (std::f64::consts::TAU * (a as f64 + 0.5) / TURN as f64).sin();
            for r in 0..SPAN {
                let at = self.radius * (r as f64 + 0.5) / SPAN as f64;
                let meets = w * at + across * sine;
                sum += meets * meets.abs() * sine;
            }
        }
        sum / (TURN * SPAN) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BLADES: Blades = Blades { radius: 0.1, kt: 1e-6, inflow: 1.0 };

    /// At rest the static law holds; across the air thrust grows, in a climb it falls; near the ground it grows.
    #[test]
    fn the_rotor_does_what_rotors_do() {
        let at = |across, up, near| BLADES.thrust(1000.0, across, up, near, 0.0).0;
        assert!((at(0.0, 0.0, 0.0) - 1.0).abs() < 1e-6);
        assert!(at(4.0, 0.0, 0.0) > 1.02 && at(0.0, 1.0, 0.0) < 0.95 && at(0.0, -0.5, 0.0) > 1.02 && at(0.0, 0.0, 0.1) > 1.01);
    }

    /// Small advance ratios: the mean of (w r + v sin)^2 sin is w r v; over the span w v R / 2.
    #[test]
    fn profile_drag_is_in_proportion_to_both_speeds() {
        let got = BLADES.drag(1000.0, 1.0);
        assert!((got / (1000.0 * 0.1 / 2.0) - 1.0).abs() < 0.01, "{got}");
        assert!((BLADES.drag(1000.0, 2.0) / got - 2.0).abs() < 0.02);
    }
}
