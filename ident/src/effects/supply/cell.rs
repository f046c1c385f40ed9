//! Open-circuit voltage of a lithium-polymer cell over its state of charge, and what a run's first readings say of the pack.
//!
//! What it is: the common table, whose steps of 10 mV are smoothed, straight between its points and beyond its ends. How many cells a pack has, and
//! how full it is when a run begins, follow from the voltage that it has without a current.
//! What can go wrong: cells of another chemistry have another curve. Nobody drives a rig beyond the knee at a tenth of the charge: there the line goes
//! on as above it, and an empty pack loses no more. A pack that begins below 3.6 V a cell is counted as a smaller, fuller one.
//! Units: V; charge 0 (empty) to 1 (full).
//! Reference: discharge tables of lithium-polymer packs; Chen & Rincon-Mora 2006, IEEE Trans. Energy Conversion 21:504, Fig. 8, has the same course.

use crate::channel::Context;
use crate::effects::supply::battery_discharge::straight;
use crate::numeric::order::median;

/// Voltage at twentieths of the charge, from empty to full, V: the mean of each point of the table and its neighbours (1/4, 1/2, 1/4),
/// taken three times.
const TABLE: [f64; 21] = [
    3.65, 3.67, 3.69, 3.71, 3.73, 3.75, 3.769, 3.787, 3.803, 3.82, 3.837, 3.856, 3.88, 3.912, 3.947, 3.985, 4.027, 4.07, 4.113,
    4.155, 4.2,
];
/// Most that a full cell has, V: one that may be charged to 4.35 V.
const FULLEST_V: f64 = 4.36;
/// Share of a run's rows, and rows, that tell how it begins.
const FIRST: (usize, usize) = (100, 3);

/// Voltage of a cell at a state of charge, V.
pub(super) fn volts(charge: f64) -> f64 {
    let steps = TABLE.len() - 1;
    let at = charge * steps as f64;
    let below = (at.max(0.0) as usize).min(steps - 1);
    TABLE[below] + (at - below as f64) * (TABLE[below + 1] - TABLE[below])
}

/// State of charge of a cell that has a voltage.
fn charge_at(volts: f64) -> f64 {
    let steps = TABLE.len() - 1;
    let below = TABLE.partition_point(|v| *v <= volts).clamp(1, steps) - 1;
    (below as f64 + (volts - TABLE[below]) / (TABLE[below + 1] - TABLE[below])) / steps as f64
}

/// A pack as a run begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pack {
    /// Cells in series.
    pub(super) cells: f64,
    /// State of charge.
    pub(super) begins: f64,
}

impl Pack {
    /// One full cell: where nothing is known of the voltage.
    pub(super) const FULL: Self = Self { cells: 1.0, begins: 1.0 };

    /// One with an open-circuit voltage.
    pub(super) fn with(open_v: f64) -> Self {
        let cells = (open_v / FULLEST_V).ceil().max(1.0);
        Self { cells, begins: charge_at(open_v / cells) }
    }

    /// That of a run, from its first readings, less what their current takes; `None` of a run without a voltage or a current.
    pub(super) fn of(context: &Context) -> Option<Self> {
        let told = context.facts.pack.get_or_init(|| {
            let (measured, (current, _)) = (context.voltage.as_ref()?, context.draw()?);
            let ohm = straight(context).map_or(0.0, |[_, ohm, _]| (-ohm).max(0.0));
            let first = (measured.len() / FIRST.0).max(FIRST.1).min(measured.len());
            let mut open: Vec<f64> = measured[..first].iter().zip(current.iter()).map(|(v, i)| v + ohm * i).collect();
            let pack = Self::with(median(&mut open));
            Some([pack.cells, pack.begins])
        });
        told.map(|[cells, begins]| Self { cells, begins })
    }

    /// What the pack has lost of its open-circuit voltage after a charge, V, if it holds `capacity` of it.
    pub(super) fn lost(&self, drawn_ah: f64, capacity_ah: f64) -> f64 {
        self.cells * (volts(self.begins) - volts((self.begins - drawn_ah / capacity_ah).max(self.begins.min(0.0))))
    }

    /// The same as a share of what it had.
    pub(super) fn share_lost(&self, drawn_ah: f64, capacity_ah: f64) -> f64 {
        self.lost(drawn_ah, capacity_ah) / (self.cells * volts(self.begins))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_voltage_and_its_charge_belong_together() {
        for charge in [0.02, 0.33, 0.5, 0.87, 1.0, 1.08] {
            assert!((charge_at(volts(charge)) - charge).abs() < 1e-12, "{charge}");
        }
        assert!((volts(0.6) - 3.88).abs() < 1e-12 && (volts(0.625) - 3.896).abs() < 1e-12);
    }

    #[test]
    fn cells_are_counted() {
        for (open, cells, begins) in
            [(12.6, 3.0, 1.0), (25.2, 6.0, 1.0), (23.1, 6.0, 0.55), (16.4, 4.0, 0.85), (4.35, 1.0, 1.15), (14.8, 4.0, 0.12)]
        {
            let pack = Pack::with(open);
            assert_eq!(pack.cells, cells, "{open} V");
            assert!((pack.begins - begins).abs() < 0.06, "{open} V: {pack:?}");
        }
    }

    #[test]
    fn a_full_pack_loses_more_of_the_same_charge_than_a_half_empty_one() {
        let [full, half] = [25.2, 23.02].map(Pack::with);
        assert!((full.lost(0.5, 1.0) - 6.0 * 0.363).abs() < 1e-9, "{full:?}");
        assert!(half.lost(0.2, 1.0) < 0.5 * full.lost(0.2, 1.0));
        assert_eq!(full.lost(0.0, 1.0), 0.0);
        assert_eq!(half.lost(0.9, 1.0), half.lost(2.0, 1.0), "an empty pack loses no more");
    }
}
