//! The cantilever that carries motor and propeller.
//!
//! What it is: the beam's first bending mode, integrated in time, under the static thrust and the rotating force of an
//! unbalanced propeller at a height above the beam.
//! What can go wrong: a mode faster than a tenth of the step rate would be misrepresented; the exact step transition keeps
//! it stable all the same.
//! Units: newton at the tip (spring force, which is what the gauges see), Hz, kg.m.
//! Reference: Beharie 2013 section 5.7.1 and Table 7; errata "beam (Table 7)": 115 mm, 244 g at the tip, 41.9 Hz.

use core::f64::consts::TAU;

/// Parameters of the beam and of what shakes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beam {
    /// Natural frequency of the first mode, Hz.
    pub natural_frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Length from clamp to thrust axis, m.
    pub length_m: f64,
    /// Height of the propeller plane above the beam, m.
    pub height_m: f64,
    /// Unbalance of propeller and rotor, kg.m.
    pub unbalance_kgm: f64,
}

impl Default for Beam {
    /// The beam of Table 7 with a well balanced propeller (0.02 g.mm).
    fn default() -> Self {
        Self { natural_frequency_hz: 41.9, damping_ratio: 0.02, length_m: 0.115, height_m: 0.06, unbalance_kgm: 2.0e-8 }
    }
}

impl Beam {
    /// Natural frequency of a steel cantilever with a tip mass, Hz (Beharie 2013 section 5.5 with Table 7's section).
    #[must_use]
    pub fn steel(length_m: f64, tip_mass_kg: f64) -> f64 {
        let (b, h, e, density) = (0.020, 0.003, 200.0e9, 7850.0);
        let stiffness = 3.0 * e * (b * h * h * h / 12.0) / (length_m * length_m * length_m);
        let mass = tip_mass_kg + 33.0 / 140.0 * density * b * h * length_m;
        (stiffness / mass).sqrt() / TAU
    }

    /// Tip force that bends the beam as much as the rotating force does at rotor angle `cosine`, N.
    ///
    /// The force U w^2 lies in the propeller plane; its part along the beam acts at the height as a moment M, and a tip
    /// moment M deflects a cantilever as a tip force 3 M / (2 L) does.
    #[must_use]
    pub fn shaking_n(&self, speed_rad_s: f64, cosine: f64) -> f64 {
        1.5 * self.height_m / self.length_m * self.unbalance_kgm * speed_rad_s * speed_rad_s * cosine
    }
}

/// State of the first mode with its exact transition over one step of constant force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeamMode {
    force_n: f64,
    rate: f64,
    a: [[f64; 2]; 2],
    b: [f64; 2],
}

impl BeamMode {
    /// At rest, for steps of `dt_s`.
    #[must_use]
    pub fn new(beam: &Beam, dt_s: f64) -> Self {
        let w = TAU * beam.natural_frequency_hz;
        let z = beam.damping_ratio.clamp(0.0, 0.999);
        let wd = w * (1.0 - z * z).sqrt();
        let e = libm::exp(-z * w * dt_s);
        let (s, c) = (libm::sin(wd * dt_s), libm::cos(wd * dt_s));
        let r = z * w / wd;
        let a = [[e * (c + r * s), e * s / wd], [-e * w * w / wd * s, e * (c - r * s)]];
        // A constant force F has the equilibrium (F, 0): x' = F + A (x - F).
        let b = [1.0 - a[0][0], -a[1][0]];
        Self { force_n: 0.0, rate: 0.0, a, b }
    }

    /// Goes on from here with another beam.
    pub fn refit(&mut self, beam: &Beam, dt_s: f64) {
        *self = Self { force_n: self.force_n, rate: self.rate, ..Self::new(beam, dt_s) };
    }

    /// One step under a tip force; gives the spring force that the gauges see, N.
    #[inline]
    pub fn step(&mut self, force_n: f64) -> f64 {
        let (x, v) = (self.force_n, self.rate);
        self.force_n = self.a[0][0] * x + self.a[0][1] * v + self.b[0] * force_n;
        self.rate = self.a[1][0] * x + self.a[1][1] * v + self.b[1] * force_n;
        self.force_n
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_7_gives_the_frequency_of_the_errata() {
        let f = Beam::steel(0.115, 0.244);
        assert!((f - 41.9).abs() < 0.3, "{f}");
    }

    #[test]
    fn amplification_at_resonance_is_one_over_twice_the_damping() {
        let beam = Beam { damping_ratio: 0.02, ..Beam::default() };
        let dt = 1.0e-4;
        for (ratio, want) in [(1.0, 25.0), (0.1, 1.0 / 0.99), (2.0, 1.0 / 3.0)] {
            let mut mode = BeamMode::new(&beam, dt);
            let w = TAU * beam.natural_frequency_hz * ratio;
            let mut peak: f64 = 0.0;
            for i in 0..60_000 {
                let y = mode.step(libm::sin(w * dt * f64::from(i)));
                if i > 40_000 {
                    peak = peak.max(y.abs());
                }
            }
            assert!((peak / want - 1.0).abs() < 0.02, "{ratio}: {peak} for {want}");
        }
    }

    #[test]
    fn a_constant_force_settles_to_itself() {
        let mut mode = BeamMode::new(&Beam::default(), 1.0e-4);
        let mut y = 0.0;
        for _ in 0..30_000 {
            y = mode.step(2.0);
        }
        assert!((y - 2.0).abs() < 1e-6);
    }
}
