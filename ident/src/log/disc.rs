//! What a log says of the propeller's disc and of the air.
//!
//! What it is: diameter and density, from the head or from columns, and what they make of thrust and torque.
//! What can go wrong: a name that tells no diameter, air that nobody measured: what needs them is not known.
//! Units: m, kg/m^3.
//! Reference: dry air as an ideal gas (ISO 2533).

use super::Log;
use std::f64::consts::PI;

/// Specific gas constant of dry air, J/(kg.K) (ISO 2533).
const AIR_GAS: f64 = 287.05;
/// Metres in an inch.
const INCH_M: f64 = 0.0254;

/// What is known of propeller and air beside the log's channels.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Disc {
    /// Diameter of the propeller, m.
    pub diameter_m: Option<f64>,
    /// Density of the air, kg/m^3.
    pub density_kg_m3: Option<f64>,
}

impl Disc {
    /// As the log tells: `diameter_m` or the number before the x of `propeller` (inches); `air_density_kg_m3` in the head, or temperature and
    /// pressure in columns or in the head (`temp_c`, `pressure_hpa`, `pressure_pa`).
    #[must_use]
    pub fn of(log: &Log) -> Self {
        let number = |key: &str| log.meta.get(key).and_then(|v| v.as_float().or_else(|| v.as_integer().map(|n| n as f64)));
        let positive = |v: &f64| v.is_finite() && *v > 0.0;
        let inches = || {
            let name = log.meta.get("propeller")?.as_str()?;
            let (diameter, pitch) = name.trim().split_once(['x', 'X'])?;
            // "11x4.7", "9x4.5x3": a name that only happens to hold an x has no numbers about it
            pitch.trim().starts_with(|c: char| c.is_ascii_digit()).then_some(())?;
            diameter.trim().parse::<f64>().ok().map(|d| d * INCH_M)
        };
        let mean = |name: &str| {
            let there: Vec<f64> = log.column(name)?.iter().copied().filter(|v| v.is_finite()).collect();
            (!there.is_empty()).then(|| there.iter().sum::<f64>() / there.len() as f64)
        };
        let told = |name: &str| mean(name).or_else(|| number(name));
        let gas = || {
            let pressure_pa = told("pressure_pa").or_else(|| told("pressure_hpa").map(|p| 100.0 * p))?;
            Some(pressure_pa / (AIR_GAS * (told("temp_c")? + 273.15)))
        };
        Self {
            diameter_m: number("diameter_m").or_else(inches).filter(positive),
            density_kg_m3: number("air_density_kg_m3").or_else(gas).filter(positive),
        }
    }

    /// What is not known, and how to say it; nothing where both are.
    #[must_use]
    pub fn lacks(&self) -> Vec<&'static str> {
        let diameter = self
            .diameter_m
            .is_none()
            .then_some("diameter of the propeller: not known (head: propeller = \"11x4.7\" in inches, or diameter_m)");
        let density = self.density_kg_m3.is_none().then_some(
            "density of the air: not known (head: air_density_kg_m3, or temp_c with pressure_hpa, in the head or as columns; or `identify --air`)",
        );
        diameter.into_iter().chain(density).collect()
    }

    /// Area that the propeller sweeps, m^2.
    #[must_use]
    pub fn area_m2(&self) -> Option<f64> {
        self.diameter_m.map(|d| PI * d * d / 4.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(head: &str) -> Log {
        Log::parse("run.csv", format!("# quadrig-log 1\n{head}t_s,rpm,temp_c,pressure_hpa\n0,1,20,1013.25\n").as_bytes())
            .expect("a log")
    }

    #[test]
    fn what_the_log_tells_of_propeller_and_air() {
        let found = |head: &str| Disc::of(&log(head));
        let disc = found("# propeller = \"11x4.7\"\n");
        assert!((disc.diameter_m.expect("11 inches") - 0.2794).abs() < 1e-9);
        assert!((disc.density_kg_m3.expect("temperature and pressure") - 1.2041).abs() < 1e-3);
        assert_eq!(found("# propeller = \"9x4.5x3\"\n").diameter_m.map(|d| (1e4 * d).round()), Some(2286.0));
        assert_eq!(found("# propeller = \"T7056\"\n").diameter_m, None);
        assert_eq!(found("# propeller = \"xoar\"\n").diameter_m, None);
        assert_eq!(found("# propeller = \"T7056\"\n# diameter_m = 0.1778\n").diameter_m, Some(0.1778));
        assert_eq!(found("# air_density_kg_m3 = 1.1\n").density_kg_m3, Some(1.1));
        let mut warm = log("");
        warm.columns.retain(|c| c.name != "pressure_hpa");
        assert_eq!(Disc::of(&warm).density_kg_m3, None, "a temperature alone is no density");
        assert_eq!(Disc::of(&warm).lacks().len(), 2);
    }
}
