//! The load cell: cantilever beam, gauges, bridge and amplifier.
//!
//! What it is: bridge equations for one, two and four active gauges, bending of the beam, and the volts a newton gives.
//! What can go wrong: nothing here checks a design; a beam beyond its yield margin shows in [`Beam::load_at`].
//! Units: metre, pascal, newton, volt, strain (no unit).
//! Reference: Beharie 2013, Eq. 5.13, 5.26, 5.33, 5.47-5.56, Tables 6-7, all with the errata (E/4, E/2, E; K from configuration).

use frame::units::{Newton, Volt};
use serde::{Deserialize, Serialize};

/// Active gauges of the bridge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Bridge {
    /// One active gauge.
    Quarter,
    /// Two active gauges on opposite faces.
    Half,
    /// Four active gauges.
    Full,
}

impl Bridge {
    /// Bridge output over bridge input, exact, at `strain` with gauge factor `k`.
    #[must_use]
    pub fn ratio(self, k: f32, strain: f32) -> f32 {
        let x = k * strain; // dR/R
        match self {
            Self::Quarter => x / (4.0 + 2.0 * x),
            Self::Half => x / (2.0 - x * x / 2.0),
            Self::Full => x,
        }
    }
}

/// Trim resistance that balances a bridge of four gauges, ohm: products of opposite arms are equal,
/// SG1 (SG3 + pot2) = SG4 (SG2 + pot1) (Beharie 2013, Eq. 5.28 and 5.31 as corrected in the errata). A positive value belongs in
/// series with SG3 (pot2), a negative one, by its amount, in series with SG2 (pot1).
#[must_use]
pub fn balancing_trim(sg: [f32; 4]) -> f32 {
    let [sg1, sg2, sg3, sg4] = sg;
    let pot2 = sg4 * sg2 / sg1 - sg3;
    if pot2 >= 0.0 { pot2 } else { -(sg1 * sg3 / sg4 - sg2) }
}

/// A cantilever of rectangular section, loaded at its tip.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Beam {
    /// From the gauges to the load, m.
    pub length_m: f32,
    /// Width b, m.
    pub width_m: f32,
    /// Height h, m.
    pub height_m: f32,
    /// Young's modulus, Pa.
    pub modulus_pa: f32,
    /// Density, kg/m^3.
    pub density: f32,
    /// Yield stress, Pa.
    pub yield_pa: f32,
}

impl Beam {
    /// The thesis' steel beam (Beharie 2013, Table 7) at the length that its calibration slope implies (errata).
    pub const THESIS: Self =
        Self { length_m: 0.115, width_m: 0.020, height_m: 0.003, modulus_pa: 200e9, density: 7850.0, yield_pa: 250e6 };

    /// Bending stress at the gauges under `load`, Pa: sigma = 6 F L/(b h^2) (Beharie 2013, Eq. 5.53).
    #[must_use]
    pub fn stress(&self, load: Newton) -> f32 {
        6.0 * load.0 * self.length_m / (self.width_m * self.height_m * self.height_m)
    }

    /// Strain at the gauges under `load`.
    #[must_use]
    pub fn strain(&self, load: Newton) -> f32 {
        self.stress(load) / self.modulus_pa
    }

    /// Load that reaches `stress_pa` at the gauges (Beharie 2013, Eq. 5.56 turned round).
    #[must_use]
    pub fn load_at(&self, stress_pa: f32) -> Newton {
        Newton(stress_pa * self.width_m * self.height_m * self.height_m / (6.0 * self.length_m))
    }

    /// Second moment of area, m^4.
    #[must_use]
    pub fn second_moment(&self) -> f32 {
        self.width_m * self.height_m * self.height_m * self.height_m / 12.0
    }

    /// Tip stiffness 3 E I/L^3, N/m.
    #[must_use]
    pub fn stiffness(&self) -> f32 {
        3.0 * self.modulus_pa * self.second_moment() / (self.length_m * self.length_m * self.length_m)
    }

    /// Tip deflection under `load`, m.
    #[must_use]
    pub fn deflection(&self, load: Newton) -> f32 {
        load.0 / self.stiffness()
    }

    /// First natural frequency with `tip_kg` at the end, Hz; 33/140 of the beam's own mass counts (Rayleigh).
    #[must_use]
    pub fn first_mode(&self, tip_kg: f32) -> f32 {
        let own = self.density * self.width_m * self.height_m * self.length_m;
        libm::sqrtf(self.stiffness() / (tip_kg + own * 33.0 / 140.0)) / core::f32::consts::TAU
    }
}

/// Beam, gauges, amplifier and the divider before the converter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StrainChannel {
    /// The beam.
    pub beam: Beam,
    /// Gauges.
    pub bridge: Bridge,
    /// Gauge factor K.
    pub gauge_factor: f32,
    /// Bridge excitation.
    pub excitation: Volt,
    /// Amplifier gain, at most 1000.
    pub gain: f32,
    /// Amplifier output at zero load.
    pub zero: Volt,
    /// Volts at the converter over volts at the amplifier.
    pub divider: f32,
    /// Volts at the amplifier rise with a load that pushes down; thrust pulls up.
    pub down_is_positive: bool,
}

impl StrainChannel {
    /// The thesis' load cell: K = 2 and gain 1000 give its calibration slope of 231.37 g/V (Eq. 5.35 and errata).
    pub const THESIS: Self = Self {
        beam: Beam::THESIS,
        bridge: Bridge::Full,
        gauge_factor: 2.0,
        excitation: Volt(11.5),
        gain: 1000.0,
        zero: Volt(2.30),
        divider: 0.5,
        down_is_positive: true,
    };

    /// Bridge output under `load`, V. Full bridge: V = 6 K F L G Vin/(b h^2 E) before the gain G (errata 5.54-5.55).
    #[must_use]
    pub fn bridge_volts(&self, load: Newton) -> Volt {
        Volt(self.bridge.ratio(self.gauge_factor, self.beam.strain(load)) * self.excitation.0)
    }

    /// Change of amplifier output for one newton, V/N: the slope at zero.
    #[must_use]
    pub fn volts_per_newton(&self) -> f32 {
        let slope = match self.bridge {
            Bridge::Quarter => 0.25,
            Bridge::Half => 0.5,
            Bridge::Full => 1.0,
        };
        slope * self.gauge_factor * self.beam.strain(Newton(1.0)) * self.excitation.0 * self.gain
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f32, b: f32, relative: f32) {
        assert!((a - b).abs() <= relative * b.abs(), "{a} is not {b}");
    }

    /// Errata, worked examples of 5.26/5.50 and 5.52.
    #[test]
    fn bridges_at_five_percent() {
        close(Bridge::Half.ratio(2.0, 0.05), 0.050_125, 1e-4);
        close(Bridge::Full.ratio(2.0, 0.05), 0.1, 1e-6);
        close(Bridge::Quarter.ratio(2.0, 1e-6), 0.25 * 2.0 * 1e-6, 1e-4);
        close(Bridge::Quarter.ratio(2.0, 0.05), 0.1 / 4.2, 1e-6); // one arm of R + dR against R
        assert!((Bridge::Half.ratio(2.0, 0.05) - 0.025).abs() > 0.02, "the printed E/4 for a half bridge is wrong by two");
    }

    /// Errata 5.31: products of opposite arms, not sums, must be equal.
    #[test]
    fn a_trimmed_bridge_is_balanced() {
        for sg in [[120.0, 120.4, 119.8, 120.1], [120.3, 119.9, 120.2, 119.7], [350.0, 352.0, 349.0, 351.0]] {
            let [sg1, sg2, sg3, sg4] = sg;
            let trim = balancing_trim(sg);
            let (pot1, pot2) = if trim >= 0.0 { (0.0, trim) } else { (-trim, 0.0) };
            let (one, other) = (sg1 * (sg3 + pot2), sg4 * (sg2 + pot1));
            assert!((one / other - 1.0).abs() < 1e-6, "{sg:?}: {trim}");
            assert!(trim.abs() < 5.0, "{trim} ohm");
        }
        let (sg1, sg2, sg3, sg4) = (120.0f32, 130.0, 120.0, 120.0);
        let by_sums = sg4 + sg2 - sg1 - sg3; // as printed
        let error = (sg1 * (sg3 + by_sums) / (sg4 * sg2) - 1.0).abs();
        assert!(error < 1e-6, "for equal arms both agree");
        let (sg1, sg2, sg3, sg4) = (100.0f32, 130.0, 120.0, 110.0);
        let by_sums = sg4 + sg2 - sg1 - sg3;
        assert!((sg1 * (sg3 + by_sums) / (sg4 * sg2) - 1.0).abs() > 0.01, "the printed form leaves this one out of balance");
    }

    /// Errata, row "beam (Table 7)": 800 g at 115 mm.
    #[test]
    fn the_thesis_beam() {
        let load = Newton(0.8 * 9.806_65);
        let beam = Beam::THESIS;
        close(beam.stress(load), 30e6, 0.01);
        close(beam.strain(load), 150e-6, 0.01);
        close(beam.deflection(load), 0.44e-3, 0.01);
        close(beam.first_mode(0.244), 41.9, 0.01);
        close(StrainChannel::THESIS.bridge_volts(load).0, 3.46e-3, 0.003);
        let kfg = StrainChannel { gauge_factor: 2.1, ..StrainChannel::THESIS };
        close(kfg.bridge_volts(load).0, 3.63e-3, 0.003);
    }

    /// Errata 5.5.2.1: allowed lengths and masses at 125 MPa.
    #[test]
    fn overload_margin() {
        let long = Beam { length_m: 0.478, ..Beam::THESIS };
        close(long.load_at(125e6).0 / 9.806_65, 0.8, 0.005);
        let thin = Beam { length_m: 0.212, height_m: 0.002, ..Beam::THESIS };
        close(thin.load_at(125e6).0 / 9.806_65, 0.8, 0.005);
    }

    /// Eq. 5.35: 231.37 g a volt.
    #[test]
    fn the_calibration_slope() {
        let grams_per_volt = 1000.0 / 9.806_65 / StrainChannel::THESIS.volts_per_newton();
        close(grams_per_volt, 231.37, 0.001);
    }
}
