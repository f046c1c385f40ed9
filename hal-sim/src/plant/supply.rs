//! What feeds the ESC: a bench supply or a lithium-polymer battery.
//!
//! What it is: open-circuit voltage as a function of charge drawn, and the resistance up to the ESC's terminals.
//! What can go wrong: a battery drawn beyond its capacity stays at its lowest voltage.
//! Units: V, A, ohm, A.h.
//! Reference: Beharie 2013 Table 8 (4400 mAh three-cell packs); cell curve after a typical 1 C discharge.

/// Kind of source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Source {
    /// Constant voltage.
    Bench {
        /// Set voltage, V.
        voltage_v: f64,
    },
    /// Battery of cells in series.
    LiPo {
        /// Cells in series.
        cells: u32,
        /// Charge from full to empty, A.h.
        capacity_ah: f64,
        /// State of charge at power-on, 0..1.
        charge: f64,
    },
}

/// Source, its resistance, and the charge drawn so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Supply {
    /// What it is.
    pub source: Source,
    /// Internal and wiring resistance, ohm.
    pub resistance_ohm: f64,
    /// Charge drawn, A.s.
    pub drawn_as: f64,
}

/// Open-circuit voltage of one cell at equal steps of charge from empty to full, V.
const CELL_V: [f64; 11] = [3.27, 3.69, 3.77, 3.80, 3.84, 3.88, 3.95, 4.02, 4.08, 4.15, 4.20];

impl Supply {
    /// A fresh supply.
    #[must_use]
    pub fn new(source: Source, resistance_ohm: f64) -> Self {
        Self { source, resistance_ohm, drawn_as: 0.0 }
    }

    /// Sets a bench supply's voltage, V; a battery has no knob.
    pub fn set(&mut self, volts: f64) {
        if let Source::Bench { voltage_v } = &mut self.source {
            *voltage_v = volts;
        }
    }

    /// Voltage without load, V.
    #[must_use]
    pub fn open_circuit_v(&self) -> f64 {
        match self.source {
            Source::Bench { voltage_v } => voltage_v,
            Source::LiPo { cells, capacity_ah, charge } => {
                let left = (charge - self.drawn_as / (3600.0 * capacity_ah)).clamp(0.0, 1.0);
                let position = left * (CELL_V.len() - 1) as f64;
                let i = (position as usize).min(CELL_V.len() - 2);
                let fraction = position - i as f64;
                f64::from(cells) * (CELL_V[i] + fraction * (CELL_V[i + 1] - CELL_V[i]))
            }
        }
    }

    /// Cells that an ESC counts from the voltage, 4.3 V each at most.
    #[must_use]
    pub fn cells(&self) -> u8 {
        (self.open_circuit_v() / 4.3) as u8 + 1
    }

    /// Takes `current_a` for `dt_s`.
    pub fn draw(&mut self, current_a: f64, dt_s: f64) {
        self.drawn_as += current_a * dt_s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_battery_falls_with_charge_and_stops_at_empty() {
        let mut s = Supply::new(Source::LiPo { cells: 3, capacity_ah: 1.0, charge: 1.0 }, 0.0);
        assert!((s.open_circuit_v() - 12.6).abs() < 1e-12);
        assert_eq!(s.cells(), 3);
        s.draw(1.0, 1800.0);
        assert!((s.open_circuit_v() - 3.0 * 3.88).abs() < 1e-9);
        s.draw(10.0, 3600.0);
        assert!((s.open_circuit_v() - 3.0 * 3.27).abs() < 1e-12);
    }

    #[test]
    fn a_bench_supply_holds() {
        let mut s = Supply::new(Source::Bench { voltage_v: 11.5 }, 0.0);
        s.draw(20.0, 3600.0);
        assert_eq!(s.open_circuit_v(), 11.5);
        assert_eq!(s.cells(), 3);
    }
}
