//! What feeds the ESC: a bench supply or a lithium-polymer battery.
//!
//! What it is: open-circuit voltage as a function of charge drawn, the resistance up to the ESC's terminals, and what of a battery answers late.
//! What can go wrong: a battery drawn beyond its capacity stays at its lowest voltage.
//! Units: V, A, ohm, A.h.
//! Reference: Beharie 2013 Table 8 (4400 mAh three-cell packs); cell curve after a typical 1 C discharge; Thevenin circuit with one
//! resistor-capacitor pair, Chen & Rincon-Mora 2006.

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

/// A resistor and a capacitor side by side in the battery: what they take of the voltage builds up and goes within seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Resistance, ohm.
    pub resistance_ohm: f64,
    /// Resistance times capacitance, s.
    pub tau_s: f64,
    /// Voltage over both, V.
    pub volts: f64,
}

impl Pair {
    /// A charge, A.s, flows evenly during `dt_s`.
    fn pass(&mut self, charge_as: f64, dt_s: f64) {
        if dt_s > 0.0 {
            let held = self.resistance_ohm * charge_as / dt_s;
            self.volts = held + (self.volts - held) * libm::exp(-dt_s / self.tau_s);
        }
    }
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
    /// What answers late.
    pub pair: Option<Pair>,
}

/// Open-circuit voltage of one cell at equal steps of charge from empty to full, V.
const CELL_V: [f64; 11] = [3.27, 3.69, 3.77, 3.80, 3.84, 3.88, 3.95, 4.02, 4.08, 4.15, 4.20];

impl Supply {
    /// A fresh supply.
    #[must_use]
    pub fn new(source: Source, resistance_ohm: f64) -> Self {
        Self { source, resistance_ohm, drawn_as: 0.0, pair: None }
    }

    /// Exchanges the parts; the charge drawn and what the pair holds stay. A pair that is new is empty.
    pub fn refit(&mut self, parts: Self) {
        let volts = self.pair.map_or(0.0, |pair| pair.volts);
        let pair = parts.pair.map(|pair| Pair { volts, ..pair });
        *self = Self { drawn_as: self.drawn_as, pair, ..parts };
    }

    /// Sets a bench supply's voltage, V; a battery has no knob.
    pub fn set(&mut self, volts: f64) {
        if let Source::Bench { voltage_v } = &mut self.source {
            *voltage_v = volts;
        }
    }

    /// Voltage without load, V; less what a load of before still holds.
    #[must_use]
    pub fn open_circuit_v(&self) -> f64 {
        let late = self.pair.map_or(0.0, |pair| pair.volts);
        let at_rest = match self.source {
            Source::Bench { voltage_v } => voltage_v,
            Source::LiPo { cells, capacity_ah, charge } => {
                let left = (charge - self.drawn_as / (3600.0 * capacity_ah)).clamp(0.0, 1.0);
                let position = left * (CELL_V.len() - 1) as f64;
                let i = (position as usize).min(CELL_V.len() - 2);
                let fraction = position - i as f64;
                f64::from(cells) * (CELL_V[i] + fraction * (CELL_V[i + 1] - CELL_V[i]))
            }
        };
        at_rest - late
    }

    /// Cells that an ESC counts from the voltage, 4.3 V each at most.
    #[must_use]
    pub fn cells(&self) -> u8 {
        (self.open_circuit_v() / 4.3) as u8 + 1
    }

    /// Takes a charge, A.s, evenly during `dt_s`.
    pub fn draw(&mut self, charge_as: f64, dt_s: f64) {
        self.drawn_as += charge_as;
        if let Some(pair) = &mut self.pair {
            pair.pass(charge_as, dt_s);
        }
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
        s.draw(1800.0, 1800.0);
        assert!((s.open_circuit_v() - 3.0 * 3.88).abs() < 1e-9);
        s.draw(36000.0, 3600.0);
        assert!((s.open_circuit_v() - 3.0 * 3.27).abs() < 1e-12);
    }

    #[test]
    fn a_pair_fills_and_empties_with_its_time_constant() {
        let mut s = Supply::new(Source::Bench { voltage_v: 12.0 }, 0.0);
        s.pair = Some(Pair { resistance_ohm: 0.05, tau_s: 4.0, volts: 0.0 });
        // 10 A in steps of any length
        (0..400).for_each(|_| s.draw(0.1, 0.01));
        let filled = 0.5 * (1.0 - (-1.0_f64).exp());
        assert!((12.0 - s.open_circuit_v() - filled).abs() < 1e-9);
        s.draw(0.0, 4.0);
        assert!((12.0 - s.open_circuit_v() - filled * (-1.0_f64).exp()).abs() < 1e-9);
    }

    /// Whatever is exchanged in mid-run, the voltage goes on from where it was.
    #[test]
    fn other_parts_keep_the_charge_and_what_the_pair_holds() {
        let pair = Pair { resistance_ohm: 0.05, tau_s: 4.0, volts: 0.0 };
        let fresh = Supply { pair: Some(pair), ..Supply::new(Source::LiPo { cells: 3, capacity_ah: 1.0, charge: 1.0 }, 0.0) };
        let mut s = fresh;
        s.draw(100.0, 10.0);
        let before = s;
        s.refit(fresh);
        assert_eq!(s, before);
        // without the pair its part is gone, and a new one begins empty
        s.refit(Supply { pair: None, ..fresh });
        assert!(s.open_circuit_v() > before.open_circuit_v() && s.drawn_as == 100.0);
        s.refit(fresh);
        assert_eq!(s.pair, Some(pair));
    }

    #[test]
    fn a_bench_supply_holds() {
        let mut s = Supply::new(Source::Bench { voltage_v: 11.5 }, 0.0);
        s.draw(72000.0, 3600.0);
        assert_eq!(s.open_circuit_v(), 11.5);
        assert_eq!(s.cells(), 3);
    }
}
