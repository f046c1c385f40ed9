//! The air at the rotor.
//!
//! What it is: density from temperature and pressure, and the standard atmosphere.
//! What can go wrong: temperatures at or below absolute zero are the scenario's to refuse.
//! Units: degC, Pa, kg/m^3, m.
//! Reference: ISO 2533:1975 (dry air, troposphere).

/// Specific gas constant of dry air, J/(kg.K), ISO 2533.
const GAS_CONSTANT: f64 = 287.052_87;
/// Sea-level density, kg/m^3, ISO 2533.
pub const SEA_LEVEL_DENSITY: f64 = 1.225;
/// Zero of the Celsius scale, K.
const ZERO_CELSIUS: f64 = 273.15;

/// State of the air.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Air {
    /// Temperature, degC.
    pub temperature_c: f64,
    /// Pressure, Pa.
    pub pressure_pa: f64,
}

impl Air {
    /// Density, kg/m^3.
    #[must_use]
    pub fn density(&self) -> f64 {
        self.pressure_pa / (GAS_CONSTANT * (self.temperature_c + ZERO_CELSIUS))
    }

    /// The standard atmosphere at `altitude_m`, up to 11 km.
    #[must_use]
    pub fn standard(altitude_m: f64) -> Self {
        let kelvin = 288.15 - 0.0065 * altitude_m;
        Self { temperature_c: kelvin - ZERO_CELSIUS, pressure_pa: 101_325.0 * libm::pow(kelvin / 288.15, 5.255_88) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_atmosphere_matches_its_table() {
        assert!((Air::standard(0.0).density() - SEA_LEVEL_DENSITY).abs() < 1e-4);
        // ISO 2533 table: 0.909 25 kg/m^3 and 70 121 Pa at 3000 m
        let high = Air::standard(3000.0);
        assert!((high.density() - 0.909_25).abs() < 2e-4, "{}", high.density());
        assert!((high.pressure_pa - 70_121.0).abs() < 40.0, "{}", high.pressure_pa);
    }
}
