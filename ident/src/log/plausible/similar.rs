//! Electrical power beside what similar propellers take.
//!
//! What it is: T = C_T rho n^2 D^4 and P = C_P rho n^3 D^5 without the diameter: P = (C_P / C_T^1.25) T^1.25 n^0.5 rho^-0.25, whatever the size. Where
//! neither torque nor propeller is known, a wrong unit of the speed shows in nothing else.
//! What can go wrong: small brushed motors waste half of it, so that a thrust below 1 N says nothing of too much power.
//! Units: N, W, n in rev/s, kg/m^3.
//! Reference: similarity of propellers, McCormick 1995, Aerodynamics, Aeronautics and Flight Mechanics, section 6.5; what the recorded stands say is
//! counted by `a_speed_of_another_unit_shows_in_the_power_of_real_runs`.

use super::{Doubt, FAINT, doubt, loaded, turning, typical};
use crate::log::{Disc, Log, trimmed};

/// C_P / C_T^1.25 of usual propellers.
const USUAL: f64 = 0.84;
/// Part of the electrical power that reaches the shaft.
const EFFICIENCY: f64 = 0.75;
/// Density of ISO 2533 air, kg/m^3, where none is told.
const AIR: f64 = 1.2;
/// Thrust from which on no motor of the stands was a small brushed one, N.
const BEYOND_TOYS: f64 = 1.0;

/// Times the power of a usual propeller. A speed in rev/s makes it 7.7, one in rad/s 3.1 and electrical turns of seven pole pairs 0.38 times as
/// large, a thrust in kilograms 17 times. Each bound lies between these and one.
const BOUNDS: [f64; 3] = [0.55, 2.0, 5.0];

/// What the power says of the speed and the thrust.
pub(super) fn similar(log: &Log) -> Option<Doubt> {
    let known = Disc::of(log);
    if known.diameter_m.is_some() || log.column("torque_nm").is_some() {
        return None;
    }
    let (rows, _) = loaded(log);
    let (name, rpm) = turning(log, &rows).filter(|(_, rpm)| *rpm > 0.0)?;
    let thrust = typical(log, "thrust_n", &rows).filter(|thrust| *thrust > FAINT)?;
    let power = typical(log, "voltage_v", &rows)? * typical(log, "current_a", &rows)?;
    let air = known.density_kg_m3.unwrap_or(AIR);
    let shape = EFFICIENCY * power * air.powf(0.25) / (thrust.powf(1.25) * (rpm / 60.0).sqrt());
    let [few, many, most] = BOUNDS;
    let likely = match shape / USUAL {
        times if times <= 0.0 => return None,
        times if times > most => "rev/s? thrust in kilograms?",
        times if times > many && thrust > BEYOND_TOYS => "rad/s? the current of several motors?",
        times if times < few => "electrical turns?",
        _ => return None,
    };
    let times = trimmed(shape / USUAL, 2);
    let what =
        format!("{power:.0} W for {thrust:.2} N at {rpm:.0} rev/min, {times} times what propellers usually take: {likely}");
    doubt(name, false, what)
}

#[cfg(test)]
mod tests {
    use super::similar;
    use crate::log::Log;

    /// A ten inch propeller: 8.0 N and 132 W at 7 000 rev/min, at four levels.
    fn told(head: &str, speed: f64, thrust: f64, current: f64) -> Option<String> {
        let row = |k: i32| {
            let share = f64::from(k / 100) / 3.0;
            let (t, i) = (8.0 * share.powi(2), 11.0 * share.powi(3));
            format!("{},{},{},{},12\n", 0.05 * f64::from(k), speed * 7000.0 * share, thrust * t, current * i)
        };
        let rows: String = (0..400).map(row).collect();
        let text = format!("# quadrig-log 1\n{head}t_s,rpm,thrust_n,current_a,voltage_v\n{rows}");
        let log = Log::parse("rig.csv", text.as_bytes()).expect("a log");
        similar(&log).map(|d| format!("{}: {}", d.column, d.what))
    }

    #[test]
    fn a_speed_of_another_unit_shows_in_the_power() {
        assert_eq!(told("", 1.0, 1.0, 1.0), None);
        let rad_s = told("", std::f64::consts::TAU / 60.0, 1.0, 1.0).expect("rad/s");
        assert!(
            rad_s.starts_with("rpm: 132 W for 8.00 N at 733 rev/min, 2.")
                && rad_s.ends_with("rad/s? the current of several motors?"),
            "{rad_s}"
        );
        assert!(told("", 1.0 / 60.0, 1.0, 1.0).is_some_and(|d| d.contains("rev/s?")));
        assert!(told("", 7.0, 1.0, 1.0).is_some_and(|d| d.contains("electrical turns?")));
        assert!(told("", 1.0, 1.0 / 9.80665, 1.0).is_some_and(|d| d.contains("thrust in kilograms?")));
        assert!(told("", 1.0, 1.0, 4.0).is_some_and(|d| d.contains("several motors?")));
    }

    #[test]
    fn a_known_propeller_and_faint_thrust_say_nothing_here() {
        assert_eq!(told("# propeller = \"10x4.5\"\n", 1.0 / 60.0, 1.0, 1.0), None);
        assert_eq!(told("", 1.0 / 60.0, 0.05, 0.05), None);
    }
}
