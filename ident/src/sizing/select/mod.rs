//! Selection: which motor, propeller and how many batteries.
//!
//! What it is: the arithmetic of Tables 8 and 9 for any set of motor-propeller pairs (printed figures, measured or simulated runs),
//! and filters for required thrust, model mass and endurance.
//! What can go wrong: a pair without a result stays in the list as one and passes no filter; a malformed table is refused with
//! file, line and column.
//! Units: newtons and amperes of one motor; kilograms of the whole machine; minutes.
//! Reference: Beharie 2013, Eq. 2.91 (resultant = 4 T - m g), 5.59 (endurance) and 6.1 (efficiency), Tables 8 and 9.

mod levels;
mod pairs;
mod why;

pub use levels::{LEVELS, read_levels};
pub use pairs::{from_log, read_table, thesis};
pub use why::{is_repeated, misses, why};

use crate::log::quantity::{Ampere, AmpereHour, GRAVITY, Kilogram, Minute, Newton};
use serde::Serialize;

/// Rotors of a quadrotor.
const ROTORS: f64 = 4.0;

/// What one motor with one propeller reaches at full throttle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pair {
    /// Motor, such as `570KV`.
    pub motor: String,
    /// Propeller, such as `11x4.7`.
    pub propeller: String,
    /// Thrust and current at full throttle; `None` for a pair that gave no result.
    pub maximum: Option<Maximum>,
    /// The thrust reading stopped following the speed before full throttle (a clipped load cell, or a stall): the maximum is a lower
    /// bound.
    pub clipped: bool,
    /// Thrust and current at each level of the run, where one was measured: the endurance in hover comes from it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<Maximum>,
    /// Why it gave no result, where that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub without: Option<String>,
    /// Where the figures come from.
    pub source: String,
}

/// Thrust with the current at which it was reached.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Maximum {
    /// Thrust of one motor.
    pub thrust_n: Newton,
    /// Current of one motor.
    pub current_a: Ampere,
}

/// The machine that is to fly.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Airframe {
    /// Mass without a battery.
    pub bare_kg: Kilogram,
    /// Mass of one battery.
    pub battery_kg: Kilogram,
    /// Charge of one battery.
    pub capacity_ah: AmpereHour,
}

impl Default for Airframe {
    /// Table 8 of the thesis.
    fn default() -> Self {
        Self { bare_kg: Kilogram(0.774), battery_kg: Kilogram(0.4), capacity_ah: AmpereHour(4.4) }
    }
}

impl Airframe {
    /// Mass with this many batteries (Table 8).
    #[must_use]
    pub fn mass(&self, batteries: u32) -> Kilogram {
        Kilogram(self.bare_kg.0 + f64::from(batteries) * self.battery_kg.0)
    }

    /// Charge of this many batteries side by side (Table 8).
    #[must_use]
    pub fn charge(&self, batteries: u32) -> AmpereHour {
        AmpereHour(f64::from(batteries) * self.capacity_ah.0)
    }

    /// Endurance at a current of each motor (Eq. 5.59).
    #[must_use]
    pub fn endurance(&self, batteries: u32, each: Ampere) -> Minute {
        Minute(self.charge(batteries).0 * 60.0 / (ROTORS * each.0))
    }
}

/// One pair on one machine: a row of Table 9.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The pair.
    pub pair: Pair,
    /// Thrust for each ampere at full throttle, N per A (Eq. 6.1).
    pub efficiency_n_per_a: f64,
    /// Thrust of all four motors.
    pub total_thrust_n: Newton,
    /// Largest mass that can hover.
    pub hover_mass_kg: Kilogram,
    /// With one battery, two, ...
    pub with_batteries: Vec<WithBatteries>,
}

/// What a pair gives with some batteries on board.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WithBatteries {
    /// How many.
    pub batteries: u32,
    /// Mass of the machine.
    pub mass_kg: Kilogram,
    /// Thrust that is left above the weight at full throttle (Eq. 2.91).
    pub resultant_n: Newton,
    /// Endurance at full throttle, the worst case (Table 9).
    pub full_throttle_min: Minute,
    /// Endurance in hover, where the levels of the run say at what current it hovers.
    pub hover_min: Option<Minute>,
}

/// The row of a pair; `None` where the pair gave no result.
#[must_use]
pub fn row(pair: &Pair, airframe: &Airframe, batteries: u32) -> Option<Row> {
    let Maximum { thrust_n, current_a } = pair.maximum?;
    let total = Newton(ROTORS * thrust_n.0);
    let with_batteries = (1..=batteries)
        .map(|n| {
            let mass = airframe.mass(n);
            let each = Newton(mass.0 * GRAVITY / ROTORS);
            WithBatteries {
                batteries: n,
                mass_kg: mass,
                resultant_n: Newton(total.0 - Newton::weight_of(mass).0),
                full_throttle_min: airframe.endurance(n, current_a),
                hover_min: current_at(&pair.levels, each).map(|i| airframe.endurance(n, i)),
            }
        })
        .collect();
    Some(Row {
        pair: pair.clone(),
        efficiency_n_per_a: thrust_n.0 / current_a.0,
        total_thrust_n: total,
        hover_mass_kg: total.carries(),
        with_batteries,
    })
}

/// Current at which a motor gives a thrust, by linear interpolation between the levels of its run.
#[must_use]
pub fn current_at(levels: &[Maximum], thrust: Newton) -> Option<Ampere> {
    let mut sorted = levels.to_vec();
    sorted.sort_by(|a, b| a.thrust_n.0.total_cmp(&b.thrust_n.0));
    sorted.windows(2).find(|w| w[0].thrust_n <= thrust && thrust <= w[1].thrust_n && w[0].thrust_n < w[1].thrust_n).map(|w| {
        let u = (thrust.0 - w[0].thrust_n.0) / (w[1].thrust_n.0 - w[0].thrust_n.0);
        Ampere(w[0].current_a.0 + u * (w[1].current_a.0 - w[0].current_a.0))
    })
}

/// What a pair must do to be chosen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Need {
    /// Least thrust of all four motors together (section 6.1: 19.62 N).
    pub total_thrust_n: Newton,
    /// Batteries on board.
    pub batteries: u32,
    /// Least endurance at full throttle.
    pub full_throttle_min: Minute,
    /// Least thrust above the weight.
    pub resultant_n: Newton,
}

impl Default for Need {
    /// Section 6.1: 2 kg x 9.81 in total, one battery, any endurance, able to hover.
    fn default() -> Self {
        Self { total_thrust_n: Newton(19.62), batteries: 1, full_throttle_min: Minute(0.0), resultant_n: Newton(0.0) }
    }
}

/// The rows that meet a need, the most efficient first: the thesis' way to the 570 KV motor with the 11x4.7 propeller.
#[must_use]
pub fn choose<'r>(rows: &'r [Row], need: &Need) -> Vec<&'r Row> {
    let mut out: Vec<&Row> = rows.iter().filter(|r| meets(r, need)).collect();
    out.sort_by(|a, b| b.efficiency_n_per_a.total_cmp(&a.efficiency_n_per_a));
    out
}

fn meets(row: &Row, need: &Need) -> bool {
    row.total_thrust_n >= need.total_thrust_n
        && row
            .with_batteries
            .iter()
            .find(|w| w.batteries == need.batteries)
            .is_some_and(|w| w.full_throttle_min >= need.full_throttle_min && w.resultant_n >= need.resultant_n)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows() -> Vec<Row> {
        thesis().iter().filter_map(|p| row(p, &Airframe::default(), 3)).collect()
    }

    #[test]
    fn table_8_comes_out() {
        let a = Airframe::default();
        let printed = [(0.774, 0.0), (1.174, 4.4), (1.574, 8.8), (1.974, 13.2)];
        for (n, (mass, charge)) in (0..).zip(printed) {
            assert!((a.mass(n).0 - mass).abs() < 1e-12 && (a.charge(n).0 - charge).abs() < 1e-12);
        }
    }

    /// Beharie 2013, Table 9, as printed; the errata recover the maxima that it implies.
    #[test]
    fn the_six_570_kv_rows_of_table_9_come_out_to_the_printed_digit() {
        let printed = [
            ("9x4.7", ["0.4", "0.5", "9.6", "19.3", "28.9"]),
            ("10x4.5", ["0.8", "5.0", "12.6", "25.2", "37.8"]),
            ("11x4.5", ["0.7", "11.2", "8.6", "17.2", "25.8"]),
            ("11x4.7", ["0.8", "11.6", "9.0", "18.0", "27.0"]),
            ("12x4.5", ["0.6", "11.5", "7.0", "14.0", "21.0"]),
            ("9x4.5x3", ["0.9", "4.5", "15.5", "31.1", "46.6"]),
        ];
        let rows = rows();
        for (propeller, want) in printed {
            let row = rows.iter().find(|r| r.pair.motor == "570KV" && r.pair.propeller == propeller).unwrap();
            let w = &row.with_batteries;
            let got = [
                row.efficiency_n_per_a,
                w[0].resultant_n.0,
                w[0].full_throttle_min.0,
                w[1].full_throttle_min.0,
                w[2].full_throttle_min.0,
            ]
            .map(|v| format!("{v:.1}"));
            assert_eq!(got, want, "{propeller}");
        }
    }

    #[test]
    fn the_thesis_choice_is_the_best_570_kv_pair_that_meets_its_need() {
        let rows: Vec<Row> = rows().into_iter().filter(|r| r.pair.motor == "570KV").collect();
        let chosen = choose(&rows, &Need::default());
        let names: Vec<&str> = chosen.iter().map(|r| r.pair.propeller.as_str()).collect();
        assert_eq!(names, ["11x4.7", "11x4.5", "12x4.5"], "only three 570 KV pairs give 19.62 N");
        let patient = Need { full_throttle_min: Minute(8.8), ..Need::default() };
        assert_eq!(choose(&rows, &patient).len(), 1);
        let heavy = Need { total_thrust_n: Newton(25.5), ..Need::default() };
        assert!(choose(&rows, &heavy).is_empty(), "no 570 KV pair carries 1.3 kg twice (errata 6.1)");
    }

    #[test]
    fn a_pair_without_a_result_has_no_row() {
        let all = thesis();
        let none: Vec<&Pair> = all.iter().filter(|p| p.maximum.is_none()).collect();
        assert_eq!(none.len(), 1);
        assert_eq!((none[0].motor.as_str(), none[0].propeller.as_str()), ("1200KV", "12x4.5"));
        assert!(row(none[0], &Airframe::default(), 3).is_none());
    }

    #[test]
    fn hover_current_lies_between_the_levels() {
        let at = |t, i| Maximum { thrust_n: Newton(t), current_a: Ampere(i) };
        let levels = [at(0.0, 0.0), at(4.0, 4.0), at(2.0, 1.0)];
        assert_eq!(current_at(&levels, Newton(3.0)), Some(Ampere(2.5)));
        assert_eq!(current_at(&levels, Newton(5.0)), None);
    }
}
