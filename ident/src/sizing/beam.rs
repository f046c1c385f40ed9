//! Design of the load cell's cantilever: signal, strength, and the speeds at which it rings.
//!
//! What it is: bridge output, bending stress, deflection, limits and first natural frequency of a rectangular beam with a mass at
//! its tip, and the rotor speeds that excite it.
//! What can go wrong: a schedule that crosses the resonance: said as a [`Crossing`] with its speed and cause.
//! Units: SI; rev/min for speeds.
//! Reference: Beharie 2013, Eq. 5.53 to 5.56 and Table 7, corrected (errata: 24 = 12 K with K = 2; y = h/2 left in 5.54);
//! first mode by Rayleigh's method with 33/140 of the beam's mass at the tip.

use crate::log::quantity::{Density, Hertz, Kilogram, Metre, Newton, Pascal, RevPerMin, Volt};
use serde::Serialize;
use std::f64::consts::TAU;

/// A beam with its bridge and what hangs on it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Beam {
    /// Width.
    pub width_m: Metre,
    /// Height, in the direction of bending.
    pub height_m: Metre,
    /// Length from the gauges' clamp to the thrust axis.
    pub length_m: Metre,
    /// Young's modulus.
    pub modulus_pa: Pascal,
    /// Density of the material.
    pub density_kg_m3: Density,
    /// Yield strength.
    pub yield_pa: Pascal,
    /// Yield strength over permitted stress.
    pub safety: f64,
    /// Gauge factor K.
    pub gauge_factor: f64,
    /// Excitation of the full bridge.
    pub excitation_v: Volt,
    /// Gain of the amplifier.
    pub gain: f64,
    /// Load at the tip.
    pub load_n: Newton,
    /// Mass at the tip: motor, tachometer, propeller.
    pub tip_kg: Kilogram,
}

impl Default for Beam {
    /// Table 7 with the length and tip mass of the errata: 115 mm, 244 g, K = 2.1 of the KFG gauge, gain 1000.
    fn default() -> Self {
        Self {
            width_m: Metre(0.020),
            height_m: Metre(0.003),
            length_m: Metre(0.115),
            modulus_pa: Pascal(200e9),
            density_kg_m3: Density(7850.0),
            yield_pa: Pascal(250e6),
            safety: 2.0,
            gauge_factor: 2.1,
            excitation_v: Volt(11.5),
            gain: 1000.0,
            load_n: Newton::weight_of(Kilogram(0.8)),
            tip_kg: Kilogram(0.244),
        }
    }
}

impl Beam {
    /// Bending stress at the clamp, 6 F L/(b h^2) (Eq. 5.56).
    #[must_use]
    pub fn stress(&self) -> Pascal {
        Pascal(6.0 * self.load_n.0 * self.length_m.0 / (self.width_m.0 * self.height_m.0.powi(2)))
    }

    /// Strain at the gauges.
    #[must_use]
    pub fn strain(&self) -> f64 {
        self.stress().0 / self.modulus_pa.0
    }

    /// Output of the full bridge ahead of the amplifier, K eps V (Eq. 5.53: K F L y/(I E) V).
    #[must_use]
    pub fn bridge_output(&self) -> Volt {
        let inertia = self.width_m.0 * self.height_m.0.powi(3) / 12.0;
        let y = self.height_m.0 / 2.0;
        Volt(self.gauge_factor * self.load_n.0 * self.length_m.0 * y / (inertia * self.modulus_pa.0) * self.excitation_v.0)
    }

    /// Output of the amplifier, 6 K F L G V/(b h^2 E) (Eq. 5.55 corrected).
    #[must_use]
    pub fn amplified(&self) -> Volt {
        Volt(self.bridge_output().0 * self.gain)
    }

    /// Deflection of the tip under the load, F L^3/(3 E I).
    #[must_use]
    pub fn deflection(&self) -> Metre {
        Metre(self.load_n.0 / self.stiffness())
    }

    /// Stiffness at the tip, N/m.
    #[must_use]
    pub fn stiffness(&self) -> f64 {
        3.0 * self.modulus_pa.0 * self.width_m.0 * self.height_m.0.powi(3) / 12.0 / self.length_m.0.powi(3)
    }

    /// Mass of the beam itself.
    #[must_use]
    pub fn own_mass(&self) -> Kilogram {
        Kilogram(self.density_kg_m3.0 * self.width_m.0 * self.height_m.0 * self.length_m.0)
    }

    /// First natural frequency with the mass at the tip.
    #[must_use]
    pub fn natural_frequency(&self) -> Hertz {
        let mass = self.tip_kg.0 + 33.0 / 140.0 * self.own_mass().0;
        Hertz((self.stiffness() / mass).sqrt() / TAU)
    }

    /// Yield strength over stress.
    #[must_use]
    pub fn safety_reached(&self) -> f64 {
        self.yield_pa.0 / self.stress().0
    }

    /// Longest beam that carries the load with the safety factor (Eq. 5.56 solved for L).
    #[must_use]
    pub fn longest(&self) -> Metre {
        Metre(self.yield_pa.0 / self.safety * self.width_m.0 * self.height_m.0.powi(2) / (6.0 * self.load_n.0))
    }

    /// Largest load that the beam carries with the safety factor (Eq. 5.56 solved for F).
    #[must_use]
    pub fn strongest(&self) -> Newton {
        Newton(self.yield_pa.0 / self.safety * self.width_m.0 * self.height_m.0.powi(2) / (6.0 * self.length_m.0))
    }

    /// Speeds at which the rotor excites the first mode: once a revolution (unbalance), and once a blade.
    #[must_use]
    pub fn resonances(&self, blades: u32) -> Vec<Crossing> {
        let f = self.natural_frequency();
        [(1, "unbalance, once a revolution"), (blades, "blade pass")]
            .into_iter()
            .filter(|(times, _)| *times > 0)
            .map(|(times, cause)| Crossing { speed_rpm: f.as_speed(times), cause, dwells: Vec::new() })
            .collect()
    }

    /// The resonances that a run over `speeds` meets: crossed on the way to the highest, and which levels stand within `near` of one.
    #[must_use]
    pub fn crossings(&self, blades: u32, speeds: &[RevPerMin], near: f64) -> Vec<Crossing> {
        let top = speeds.iter().map(|s| s.0).fold(0.0, f64::max);
        let mut met = self.resonances(blades);
        met.retain_mut(|c| {
            c.dwells = speeds.iter().copied().filter(|s| (s.0 / c.speed_rpm.0 - 1.0).abs() <= near).collect();
            c.dwells.sort_by(|a, b| a.0.total_cmp(&b.0));
            c.dwells.dedup_by(|a, b| (a.0 - b.0).abs() < 1.0);
            c.speed_rpm.0 <= top || !c.dwells.is_empty()
        });
        met
    }
}

/// A speed at which the beam rings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Crossing {
    /// The speed.
    pub speed_rpm: RevPerMin,
    /// What excites it.
    pub cause: &'static str,
    /// Levels of the schedule that stand near it.
    pub dwells: Vec<RevPerMin>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f64, wanted: f64, share: f64) {
        assert!((value / wanted - 1.0).abs() < share, "{value} for {wanted}");
    }

    /// Errata, "beam (Table 7)".
    #[test]
    fn the_figures_of_the_errata_come_out() {
        let beam = Beam::default();
        near(beam.stress().0, 30e6, 0.01);
        near(beam.strain(), 150e-6, 0.01);
        near(beam.bridge_output().0, 3.63e-3, 0.003);
        near(Beam { gauge_factor: 2.0, ..beam }.bridge_output().0, 3.46e-3, 0.003);
        near(beam.deflection().0, 0.44e-3, 0.01);
        near(beam.natural_frequency().0, 41.9, 0.002);
        let speeds: Vec<f64> = beam.resonances(2).iter().map(|c| c.speed_rpm.0).collect();
        near(speeds[0], 2510.0, 0.002);
        near(speeds[1], 1255.0, 0.002);
    }

    /// Eq. 5.55 as corrected and Eq. 5.53 are one equation; as printed (12 F L/(b h^2 E)) it holds for K = 2 only.
    #[test]
    fn the_printed_equation_holds_for_a_gauge_factor_of_two_only() {
        let printed = |b: &Beam| {
            12.0 * b.load_n.0 * b.length_m.0 / (b.width_m.0 * b.height_m.0.powi(2) * b.modulus_pa.0) * b.excitation_v.0 * b.gain
        };
        let beam = Beam { gauge_factor: 2.0, ..Beam::default() };
        near(beam.amplified().0, printed(&beam), 1e-12);
        let kfg = Beam::default();
        assert!((kfg.amplified().0 / printed(&kfg) - 1.05).abs() < 1e-9);
    }

    /// Errata 5.5.2.1: which limits belong together.
    #[test]
    fn limits_of_equation_5_56() {
        let beam = Beam::default();
        near(beam.longest().0, 0.478, 0.002);
        near(Beam { height_m: Metre(0.002), ..beam }.longest().0, 0.212, 0.003);
        near(Beam { load_n: Newton::weight_of(Kilogram(1.25)), ..beam }.longest().0, 0.306, 0.002);
        near(Beam { length_m: Metre(0.45), ..beam }.strongest().carries().0, 0.85, 0.002);
        near(beam.safety_reached(), 250.0 / 30.08, 0.001);
    }

    #[test]
    fn a_schedule_that_stays_below_is_not_warned_of() {
        let beam = Beam::default();
        let at = |v: &[f64]| v.iter().map(|s| RevPerMin(*s)).collect::<Vec<_>>();
        assert!(beam.crossings(2, &at(&[500.0, 1000.0]), 0.05).is_empty());
        let through = beam.crossings(2, &at(&[1000.0, 2000.0, 3000.0]), 0.05);
        assert_eq!(through.len(), 2);
        assert!(through.iter().all(|c| c.dwells.is_empty()));
        let dwelling = beam.crossings(2, &at(&[1000.0, 2480.0]), 0.05);
        assert_eq!(dwelling[0].dwells, at(&[2480.0]), "a level just below the resonance rings although it is never crossed");
    }
}
