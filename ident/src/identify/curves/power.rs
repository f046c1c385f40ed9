//! What a designer asks of each level: power in and out, thrust for each watt, efficiencies, and the propeller's coefficients.
//!
//! What it is: quotients of plateau means with the standard errors that follow from theirs; thrust and torque less what they read at
//! rest, which is the zero of their channel.
//! What can go wrong: a channel that is missing, a propeller whose diameter is not known, air whose density is not: what needs them is not known
//! either, and is not guessed.
//! Units: SI; g for each W with standard gravity.
//! Reference: UIUC propeller data base (C_T = T/(rho n^2 D^4), C_P = P/(rho n^3 D^5), n in rev/s); Leishman 2006, "Principles of Helicopter
//! Aerodynamics", 2.8 (figure of merit = T^1.5 / (sqrt(2 rho A) P)).

use super::Zero;
pub use crate::log::Disc;
use crate::log::Log;
use crate::plateau::Plateau;
use std::f64::consts::TAU;

/// Standard gravity, m/s^2 (ISO 80000-3).
const STANDARD_GRAVITY: f64 = 9.806_65;
/// Share of the largest value below which a quotient says nothing but its own error.
pub(super) const TOO_SMALL: f64 = 0.02;

/// A value and its standard error.
pub type Valued = (f64, f64);

/// One figure of a level: its name, its unit, and what it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Asked {
    /// Name of the column of the table.
    pub name: &'static str,
    /// For people.
    pub heading: &'static str,
    /// Unit, empty for a number.
    pub unit: &'static str,
}

const fn asked(name: &'static str, heading: &'static str, unit: &'static str) -> Asked {
    Asked { name, heading, unit }
}

/// The figures of a level, in the order of [`Level::figures`].
pub const ASKED: [Asked; 14] = [
    asked("pulse_us", "pulse", "us"),
    asked("rpm", "speed", "rev/min"),
    asked("thrust_n", "thrust", "N"),
    asked("torque_nm", "torque", "N.m"),
    asked("current_a", "current", "A"),
    asked("voltage_v", "voltage", "V"),
    asked("electrical_w", "electrical power", "W"),
    asked("shaft_w", "shaft power", "W"),
    asked("g_per_w", "thrust for electrical power", "g/W"),
    asked("g_per_shaft_w", "thrust for shaft power", "g/W"),
    asked("motor_efficiency", "motor and controller efficiency", ""),
    asked("figure_of_merit", "figure of merit", ""),
    asked("c_t", "C_T", ""),
    asked("c_p", "C_P", ""),
];

/// A level with its figures; `None` is what is not known.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// Place among the plateaus, from 0.
    pub plateau: usize,
    /// Each of [`ASKED`].
    pub figures: [Option<Valued>; ASKED.len()],
}

impl Level {
    /// A figure by its name.
    #[must_use]
    pub fn of(&self, name: &str) -> Option<Valued> {
        self.figures[ASKED.iter().position(|a| a.name == name)?]
    }
}

/// A product of powers and its error, of what is measured independently.
fn product(constant: f64, factors: &[(Option<Valued>, f64)]) -> Option<Valued> {
    let (mut value, mut relative) = (constant, 0.0);
    for (factor, power) in factors {
        let (v, se) = (*factor)?;
        if v <= 0.0 {
            return None; // a quotient of a resting rotor
        }
        value *= v.powf(*power);
        relative += (power * se / v).powi(2);
    }
    Some((value, value * relative.sqrt()))
}

/// Which levels are at rest: no faster than a fiftieth of the fastest.
pub(super) fn at_rest(speed: &[Option<Valued>]) -> impl Iterator<Item = bool> {
    let top = speed.iter().flatten().map(|v| v.0).fold(0.0, f64::max);
    speed.iter().map(move |v| v.is_some_and(|v| v.0 <= TOO_SMALL * top))
}

/// The figures of every plateau; `zeros` are what thrust and torque read at rest, and are taken off.
#[must_use]
pub fn levels(log: &Log, plateaus: &[Plateau], speed: &[Option<Valued>], zeros: [Option<&Zero>; 2], disc: &Disc) -> Vec<Level> {
    let raw: Vec<[Option<Valued>; 6]> = plateaus
        .iter()
        .zip(speed)
        .map(|(p, rpm)| {
            let of = |name: &str| p.of(log, name);
            [
                of("pulse_us"),
                *rpm,
                of("thrust_n").map(|v| Zero::off(zeros[0], p.middle_s(), v)),
                of("torque_nm").map(|v| Zero::off(zeros[1], p.middle_s(), v)),
                of("current_a"),
                of("voltage_v"),
            ]
        })
        .collect();
    // near rest a quotient is noise over noise
    let top = |k: usize| raw.iter().filter_map(|r| r[k]).map(|v| v.0).fold(0.0, f64::max);
    let least = [0, 1, 2, 3, 4, 5].map(|k| TOO_SMALL * top(k));
    raw.iter().enumerate().map(|(plateau, raw)| Level { plateau, figures: figures(raw, &least, disc) }).collect()
}

fn figures(raw: &[Option<Valued>; 6], least: &[f64; 6], disc: &Disc) -> [Option<Valued>; ASKED.len()] {
    let loud = |k: usize| raw[k].filter(|v| v.0 > least[k]);
    let [_, rpm, thrust, torque, current, voltage] = [0, 1, 2, 3, 4, 5].map(loud);
    let exact = |v: Option<f64>| v.map(|v| (v, 0.0));
    let [rho, diameter] = [exact(disc.density_kg_m3), exact(disc.diameter_m)];
    let electrical = product(1.0, &[(voltage, 1.0), (current, 1.0)]);
    let shaft = product(TAU / 60.0, &[(rpm, 1.0), (torque, 1.0)]);
    let grams = 1000.0 / STANDARD_GRAVITY;
    let turns = 1.0 / 60.0_f64;
    [
        raw[0],
        raw[1],
        raw[2],
        raw[3],
        raw[4],
        raw[5],
        electrical,
        shaft,
        product(grams, &[(thrust, 1.0), (voltage, -1.0), (current, -1.0)]),
        product(grams * 60.0 / TAU, &[(thrust, 1.0), (rpm, -1.0), (torque, -1.0)]),
        product(TAU / 60.0, &[(rpm, 1.0), (torque, 1.0), (voltage, -1.0), (current, -1.0)]),
        product(
            60.0 / TAU / 2.0_f64.sqrt(),
            &[(thrust, 1.5), (rpm, -1.0), (torque, -1.0), (rho, -0.5), (exact(disc.area_m2()), -0.5)],
        ),
        product(turns.powi(-2), &[(thrust, 1.0), (rho, -1.0), (rpm, -2.0), (diameter, -4.0)]),
        product(TAU * turns.powi(-2), &[(torque, 1.0), (rho, -1.0), (rpm, -2.0), (diameter, -5.0)]),
    ]
}

/// What no propeller's level does, a line for each figure: the likely reason is another unit, another propeller, or a zero that is off.
#[must_use]
pub fn in_doubt(levels: &[Level]) -> Vec<String> {
    [("c_t", "thrust coefficient", 0.01, 0.4), ("figure_of_merit", "figure of merit", 0.1, 1.0)]
        .into_iter()
        .filter_map(|(name, what, low, high)| {
            let beyond = |v: &Valued| v.0 - 1.96 * v.1 > high || v.0 + 1.96 * v.1 < low;
            let all = levels.iter().filter_map(|l| Some((l.plateau, l.of(name)?))).filter(|(_, v)| beyond(v));
            let worst = all.clone().max_by(|(_, a), (_, b)| (a.0 / high).max(low / a.0).total_cmp(&(b.0 / high).max(low / b.0)))?;
            let (plateau, (v, _)) = worst;
            let more = match all.count() {
                1 => String::new(),
                n => format!(" ({n} levels in all)"),
            };
            Some(format!(
                "in doubt: a {what} of {v:.3} on plateau {}{more}, where propellers have {low} to {high}: thrust or torque of another unit, another propeller, or a zero that is off?",
                plateau + 1
            ))
        })
        .collect()
}

/// The table of plateaus as CSV: each figure and its standard error; an empty field is what is not known.
#[must_use]
pub fn csv(plateaus: &[Plateau], levels: &[Level]) -> String {
    let names: Vec<String> = ASKED.iter().map(|a| format!("{0},{0}_se", a.name)).collect();
    let mut out = format!("plateau,from_s,to_s,rows,{}\n", names.join(","));
    for level in levels {
        let p = &plateaus[level.plateau];
        let cell = |v: &Option<Valued>| v.map_or_else(|| ",".to_owned(), |(v, se)| format!("{},{}", digits(v), digits(se)));
        let cells: Vec<String> = level.figures.iter().map(cell).collect();
        out += &format!("{},{:.3},{:.3},{},{}\n", level.plateau + 1, p.from_s, p.to_s, p.rows, cells.join(","));
    }
    out
}

/// Seven digits: more than any plateau holds.
fn digits(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return "0".to_owned();
    }
    let places = (6 - value.abs().log10().floor() as i32).clamp(0, 15) as usize;
    let text = format!("{value:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;
    use std::f64::consts::PI;

    /// By hand: 8000 rev/min, 5 N, 0.08 N.m, 9 A at 11 V, 11 inches in air of 1.2 kg/m^3.
    #[test]
    fn figures_as_by_hand() {
        let names = ["pulse_us", "thrust_n", "torque_nm", "current_a", "voltage_v"];
        let log =
            Log { columns: names.iter().map(|n| Column { name: (*n).into(), values: vec![0.0] }).collect(), ..Log::default() };
        let plateau = Plateau {
            from_s: 1.0,
            to_s: 2.0,
            first: 0,
            rows: 10,
            settling_s: 0.0,
            means: vec![Some((1800.0, 0.0)), Some((5.1, 0.05)), Some((0.08, 0.0)), Some((9.0, 0.0)), Some((11.0, 0.0))],
        };
        let disc = Disc { diameter_m: Some(0.2794), density_kg_m3: Some(1.2) };
        let rest = Plateau { means: [1000.0, 0.1, 0.0, 0.0, 11.0].map(|v| Some((v, 0.0))).to_vec(), ..plateau.clone() };
        let speeds = [Some((8000.0, 0.0)), Some((0.0, 0.0))];
        let both = [plateau.clone(), rest];
        let zero = Zero::of(&log, &both, &speeds, "thrust_n");
        let found = levels(&log, &both, &speeds, [zero.as_ref(), None], &disc);
        let near = |name: &str, wanted: f64| {
            let (v, _) = found[0].of(name).unwrap_or_else(|| panic!("{name}"));
            assert!((v / wanted - 1.0).abs() < 1e-3, "{name}: {v}, by hand {wanted}");
        };
        near("electrical_w", 99.0);
        near("shaft_w", 67.02);
        near("motor_efficiency", 0.677);
        near("g_per_w", 5.150);
        near("g_per_shaft_w", 7.607);
        near("c_t", 5.0 / (1.2 * (8000.0_f64 / 60.0).powi(2) * 0.2794_f64.powi(4)));
        near("c_p", 67.02 / (1.2 * (8000.0_f64 / 60.0).powi(3) * 0.2794_f64.powi(5)));
        near("figure_of_merit", 5.0_f64.powf(1.5) / ((2.0 * 1.2 * PI * 0.1397 * 0.1397_f64).sqrt() * 67.02));
        let (g_per_w, se) = found[0].of("g_per_w").expect("known");
        assert!((se / g_per_w - 0.01).abs() < 1e-6, "one per cent of thrust is one per cent of it");
        // without a level at rest nothing is taken off
        let turning = levels(&log, std::slice::from_ref(&plateau), &speeds[..1], [None; 2], &disc);
        assert!(turning[0].of("g_per_w").is_some_and(|(v, _)| (v / 5.253 - 1.0).abs() < 1e-3), "{:?}", turning[0]);
        let unknown = levels(&log, std::slice::from_ref(&plateau), &[Some((8000.0, 0.0))], [None; 2], &Disc::default());
        assert_eq!(["c_t", "c_p", "figure_of_merit"].map(|n| unknown[0].of(n)), [None; 3]);
        let text = csv(&[plateau], &unknown);
        assert!(text.starts_with("plateau,from_s,to_s,rows,pulse_us,pulse_us_se,rpm,rpm_se,"), "{text}");
        assert!(text.ends_with(",,,,,,\n") && text.contains("\n1,1.000,2.000,10,1800,0,8000,0,5.1,0.05,"), "{text}");
    }
}
