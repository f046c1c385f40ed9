//! The thirty-six motor-propeller pairs of the thesis.
//!
//! What it is: six motors by six propellers on 11.5 V, what each gives at a throttle, and the figures that the thesis states with
//! what the catalogue makes of them.
//! What can go wrong: 1200 KV does not start 12x4.5; that pair has no result, here as in the thesis.
//! Units: SI; throttle 0..1; duty in per cent of the 20 ms period (5 to 10).
//! Reference: errata, "1.8, 6.1, abstract" and "Figures that the text states"; Beharie 2013 Table 9.

use crate::plant::motor::MOTORS;
use crate::plant::{PlantState, Powerplant, Propeller, RigPlant};
use crate::scenario::{NoiseSection, Scenario};

/// One pair, by the names that a scenario file uses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pair {
    /// Motor.
    pub motor: String,
    /// Propeller.
    pub propeller: &'static str,
}

/// All thirty-six, motor by motor.
pub fn pairs() -> impl Iterator<Item = Pair> {
    MOTORS.iter().flat_map(|(kv, _)| Propeller::names().map(move |propeller| Pair { motor: format!("{kv}KV"), propeller }))
}

impl Pair {
    /// The scenario of this pair on the thesis' supply, everything else as by default.
    #[must_use]
    pub fn scenario(&self) -> Scenario {
        Scenario {
            name: format!("{} with {}", self.motor, self.propeller),
            motor: self.motor.clone(),
            propeller: self.propeller.to_owned(),
            ..Scenario::default()
        }
    }

    /// Where the pair settles at `throttle` (0..1) in still air; `None` where the motor does not turn the propeller.
    #[must_use]
    pub fn settled(&self, throttle: f64) -> Option<PlantState> {
        let still = Scenario { noise: NoiseSection { gust: 0.0, ..NoiseSection::default() }, ..self.scenario() };
        let mut plant = RigPlant::new(still.parts().plant, 1);
        let state = (0..40_000).map(|_| plant.advance(1.0e-4, 1000.0 + 1000.0 * throttle)).last()?;
        (state.rpm > 0.0).then_some(state)
    }
}

/// Throttle of a duty cycle in per cent of the period: 5 % is off, 10 % is full (errata, "pulse").
#[must_use]
pub fn throttle_of_duty(percent: f64) -> f64 {
    (percent - 5.0) / 5.0
}

/// A figure that the thesis states and what the catalogue gives for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// What it is.
    pub what: String,
    /// Stated value.
    pub stated: f64,
    /// Value of the catalogue.
    pub ours: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// Why it need not be met, where it contradicts another figure or is exempt.
    pub exempt: Option<&'static str>,
}

impl Figure {
    /// Relative deviation.
    #[must_use]
    pub fn off(&self) -> f64 {
        self.ours / self.stated - 1.0
    }
}

/// Table 9 for the 570 KV motor as the errata give it: propeller, thrust N, current A, printed efficiency N/A, resultant N and
/// minutes on one, two and three batteries.
const TABLE_9: [(&str, [f64; 7]); 6] = [
    ("9x4.7", [3.004, 6.85, 0.4, 0.5, 9.6, 19.3, 28.9]),
    ("10x4.5", [4.129, 5.24, 0.8, 5.0, 12.6, 25.2, 37.8]),
    ("11x4.5", [5.679, 7.67, 0.7, 11.2, 8.6, 17.2, 25.8]),
    ("11x4.7", [5.779, 7.33, 0.8, 11.6, 9.0, 18.0, 27.0]),
    ("12x4.5", [5.754, 9.43, 0.6, 11.5, 7.0, 14.0, 21.0]),
    ("9x4.5x3", [4.004, 4.25, 0.9, 4.5, 15.5, 31.1, 46.6]),
];
/// Mass of the quadrotor, kg, battery, A.h, and gravity, m/s^2 (Table 8).
const MODEL: (f64, f64, f64) = (1.174, 4.4, 9.806_65);
/// Why the 9x4.7 row of Table 9 is exempt.
const IMPOSSIBLE: &str = "less thrust at more current than 10x4.5 on the same motor: no first-principles propeller gives that";

/// Every stated figure of the powerplants (errata, end).
#[must_use]
pub fn powerplant_figures() -> Vec<Figure> {
    let pair = |motor: &str, propeller: &'static str| Pair { motor: motor.to_owned(), propeller };
    let at = |p: &Pair, throttle: f64| p.settled(throttle).unwrap_or_default();
    let mut all = Vec::new();
    let mut say = |what: String, stated: f64, ours: f64, unit, exempt| all.push(Figure { what, stated, ours, unit, exempt });

    for (propeller, row) in TABLE_9 {
        let full = at(&pair("570KV", propeller), 1.0);
        let (mass, charge, g) = MODEL;
        let minutes = charge * 60.0 / (4.0 * full.current_a);
        let name = |what: &str| format!("570KV {propeller} {what}");
        let exempt = (propeller == "9x4.7").then_some(IMPOSSIBLE);
        say(name("thrust"), row[0], full.thrust_n, "N", exempt);
        say(name("current"), row[1], full.current_a, "A", exempt);
        let rounded = "printed with one digit; the unrounded T/I is met";
        say(name("efficiency"), row[0] / row[1], full.thrust_n / full.current_a, "N/A", exempt);
        say(name("efficiency as printed"), row[2], full.thrust_n / full.current_a, "N/A", exempt.or(Some(rounded)));
        say(name("resultant"), row[3], 4.0 * full.thrust_n - mass * g, "N", exempt);
        for n in 1..=3 {
            say(name(&format!("minutes on {n}")), row[3 + n], n as f64 * minutes, "min", exempt);
        }
    }

    let best = pair("570KV", "11x4.7");
    let duty = |percent: f64| at(&best, throttle_of_duty(percent));
    say("hover speed at 8.36 % duty".into(), 4100.0, duty(8.36).rpm, "rev/min", None);
    say("hover thrust at 8.36 % duty".into(), 2.879, duty(8.36).thrust_n, "N", None);
    let full = at(&best, 1.0);
    let w = full.rpm * core::f64::consts::TAU / 60.0;
    say("k_T of 11x4.7".into(), 1.56e-5, full.thrust_n / (w * w), "N.s^2", None);
    let slope = (duty(8.46).thrust_n - duty(8.26).thrust_n) / 0.2;
    let climb = "contradicts thrust, k_T and KV: with each 5 % off they give 1.444 at least (docs/scenario.md)";
    say("dT/dduty at hover".into(), 1.36, slope, "N/%", Some(climb));

    let grams = |s: PlantState| s.thrust_n * 1000.0 / 9.806_65;
    let strongest = at(&pair("1000KV", "11x4.5"), 1.0);
    say("1000KV 11x4.5 thrust".into(), 675.0, grams(strongest), "g", None);
    say("1000KV 11x4.5 current".into(), 15.64, strongest.current_a, "A", None);
    say("1000KV net load-cell reading".into(), 684.0, grams(strongest), "g", Some("contradicts the 675 g of the same text"));
    let weakest = at(&pair("390KV", "9x4.7"), 1.0);
    say("390KV 9x4.7 thrust".into(), 171.0, grams(weakest), "g", None);
    say("390KV 9x4.7 current".into(), 1.61, weakest.current_a, "A", None);
    let (low, high) =
        pairs().filter_map(|p| p.settled(1.0)).map(grams).fold((f64::MAX, 0.0f64), |(l, h), g| (l.min(g), h.max(g)));
    say("lowest full-throttle thrust of all pairs".into(), 171.0, low, "g", None);
    say("highest full-throttle thrust of all pairs".into(), 675.0, high, "g", None);
    all
}
