//! What a rig can do: sample rate, thrust for its speed and its power, voltage, current.
//!
//! What it is: a look at a log for a wrong unit or swapped columns, and at what its head says of propeller and air.
//! What can go wrong: beyond what any rig does the file is refused with the likely reason; what is only unusual is said. A column that the user
//! vouches for, in the head of the log (`vouched = ["voltage_v"]`) or by mapping it, is never refused, and said all the same.
//! Units: SI; thrust coefficient in N/(rev/min)^2.
//! Reference: T = C_T rho n^2 D^4 with C_T 0.02 to 0.2 and D 0.02 to 2 m spans 1e-12 to 1.1e-3 N/(rev/min)^2; static thrust for electrical power:
//! 0.01 to 0.5 N/W from a 46 mm to a 1 m propeller at load (UIUC and maker's tables). A disc needs T^1.5/sqrt(2 rho A) of power at the least
//! (momentum theory; a duct up to 0.7 of it); propellers need 1.3 to 4 times as much, and their C_T is 0.02 to 0.2.

use super::{Disc, Gaps, Log, Place, ReadError, SPEED, head::line_of, short, trimmed};
use crate::numeric::digits::significant;
use crate::numeric::order::median;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

mod similar;

/// Key in a log's head: the columns whose values are right although no rig is known to do that.
pub(crate) const VOUCHED: &str = "vouched";

/// Key of the head that holds the density of the air.
pub(super) const AIR: &str = "air_density_kg_m3";
/// Below this speed, rev/min, a rotor counts as standing: slower than any brushless motor runs without position sensors.
pub(crate) const STANDSTILL: f64 = 100.0;
/// N, W, A, V, rev/min below which a meter's own error may be all there is.
const FAINT: f64 = 0.5;
/// Diameter of the largest propeller on a test stand, m.
const LARGEST_M: f64 = 3.5;

/// One doubt: column, what is odd with the likely reason, and whether no rig does it.
pub(crate) struct Doubt {
    pub(crate) column: &'static str,
    pub(crate) what: String,
    pub(crate) never: bool,
}

/// Everything that is odd about a log.
pub(crate) fn doubts(log: &Log) -> impl Iterator<Item = Doubt> {
    [
        head(log),
        rate(log),
        thinned(log),
        backwards(log),
        still(log),
        speed(log),
        supply(log),
        reversed(log),
        twisted(log),
        heat(log),
        pushed(log),
        swapped(log),
        thrust(log),
        disc(log),
        torque(log),
        similar::similar(log),
    ]
    .into_iter()
    .flatten()
}

impl Log {
    /// What is unusual about it, a line for each column: perhaps a wrong unit, perhaps a rare rig.
    #[must_use]
    pub fn in_doubt(&self) -> Vec<String> {
        doubts(self).map(|d| format!("{}: in doubt: {}", d.column, d.what)).collect()
    }

    /// Refuses what no rig does, unless the head vouches for it. A reader of raw codes does not ask: what it reads may be the wrong scale
    /// that it is there to mend.
    ///
    /// # Errors
    /// [`ReadError::Content`] with file and column, at the line of the header; of a key of the head at its own line.
    pub fn refuse_absurd(&self, path: &Path) -> Result<(), ReadError> {
        let vouched = self.meta.get(VOUCHED).and_then(toml::Value::as_array);
        let vouched = |column: &str| vouched.is_some_and(|all| all.iter().any(|v| v.as_str() == Some(column)));
        match doubts(self).find(|d| d.never && !vouched(d.column)) {
            None => Ok(()),
            Some(Doubt { column, what, .. }) => {
                let way_out = format!("if it is right, say so in the head: # {VOUCHED} = [\"{column}\"]");
                let expected = match column {
                    "t_s" if is_thinned(self) => format!("a row at every tick: use the whole log ({way_out})"),
                    _ => format!("what a rig can do, in the unit of the column's name ({way_out})"),
                };
                let file = path.display().to_string();
                if let Some((line, value)) = line_of(path, column).zip(self.meta.get(column)) {
                    let found = format!("{column} = {}: {what}", short(&value.to_string()));
                    let expected = expected.replace("the column's", "the key's");
                    return Err(Place { file: &file, line }.refuse(None, found, expected));
                }
                Err(Place { file: &file, line: head_of(path).len() + 1 }.refuse(Some(column), what, expected))
            }
        }
    }
}

/// The comment lines before a log's header.
pub(super) fn head_of(path: &Path) -> Vec<String> {
    let Ok(file) = File::open(path) else { return Vec::new() };
    BufReader::new(file).lines().map_while(Result::ok).take_while(|line| line.starts_with(['#', '\u{feff}'])).collect()
}

fn doubt(column: &'static str, never: bool, what: String) -> Option<Doubt> {
    Some(Doubt { column, what, never })
}

/// Median of a column over rows, where it has samples.
fn typical(log: &Log, name: &str, rows: &[usize]) -> Option<f64> {
    let values = log.column(name)?;
    let mut present: Vec<f64> = rows.iter().map(|i| values[*i]).filter(|v| v.is_finite()).collect();
    (present.len() >= 3).then(|| median(&mut present))
}

/// Value that one sample in a hundred exceeds.
fn high(values: &[f64]) -> Option<f64> {
    let mut present: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    present.sort_unstable_by(f64::total_cmp);
    present.get((present.len() * 99 / 100).min(present.len().saturating_sub(1))).copied()
}

fn rotor(log: &Log) -> Option<&[f64]> {
    SPEED.into_iter().find_map(|s| log.column(s))
}

/// The speed that is told first, and what it typically reads over rows.
fn turning(log: &Log, rows: &[usize]) -> Option<(&'static str, f64)> {
    let name = SPEED.into_iter().find(|s| log.column(s).is_some())?;
    Some((name, typical(log, name, rows)?))
}

/// Rows of the upper load: speed, or else thrust, or else current above 70 % of its highest. And rows at rest.
fn loaded(log: &Log) -> (Vec<usize>, Vec<usize>) {
    let Some(load) = rotor(log).or_else(|| log.column("thrust_n")).or_else(|| log.column("current_a")) else {
        return (Vec::new(), Vec::new());
    };
    let top = high(load).unwrap_or(0.0);
    let rows = |of: &dyn Fn(f64) -> bool| (0..load.len()).filter(|i| of(load[*i])).collect::<Vec<_>>();
    if top > 0.0 { (rows(&|v| v > 0.7 * top), rows(&|v| v <= 0.02 * top)) } else { (Vec::new(), Vec::new()) }
}

fn rate(log: &Log) -> Option<Doubt> {
    let mut steps: Vec<f64> = log.t.windows(2).map(|w| w[1] - w[0]).collect();
    // a stated rate is the user's word for the clock
    if log.time_is_row() || steps.len() < 10 || log.meta.contains_key("sample_hz") {
        return None;
    }
    let (step, whole) = (median(&mut steps), log.t[log.t.len() - 1] - log.t[0]);
    let apart = significant(step, 4);
    let said = |likely: &str| format!("rows {apart} s apart, {whole:.0} s in all: {likely}");
    match step {
        s if s > 60.0 || (s >= 2.0 && whole > 6.0 * 3600.0) => doubt("t_s", true, said(&units_of(s))),
        s if s > 10.0 => doubt("t_s", false, said(&units_of(s))),
        s if s < 1e-5 => doubt("t_s", true, said("seconds, read as milliseconds or microseconds?")),
        s if s < 1e-4 => doubt("t_s", false, said("a unit too small?")),
        _ => None,
    }
}

/// Single rows of an even clock that are missing, a fifth and more, where nobody states a rate.
fn thinned(log: &Log) -> Option<Doubt> {
    let gaps = Gaps::of(log).filter(|gaps| gaps.dropped && !log.meta.contains_key("sample_hz"))?;
    doubt("t_s", true, gaps.to_string())
}

/// Whether that is said of a log.
pub(crate) fn is_thinned(log: &Log) -> bool {
    thinned(log).is_some()
}

/// The units in which rows so far apart are a usual clock, with the seconds that they mean.
pub(crate) fn units_of(step: f64) -> String {
    let said = |unit: &str, factor: f64| format!("{unit} (a row each {} s)", trimmed(step * factor, 6));
    match step {
        s if s >= 2000.0 => said("microseconds", 1e-6) + "?",
        s if s >= 500.0 => format!("{} or {}?", said("microseconds", 1e-6), said("milliseconds", 1e-3)),
        s if s >= 1.0 => said("milliseconds", 1e-3) + "?",
        _ => "seconds?".to_owned(),
    }
}

fn speed(log: &Log) -> Option<Doubt> {
    let name = SPEED.into_iter().find(|s| log.column(s).is_some())?;
    let top = high(rotor(log)?)?;
    let (rows, _) = loaded(log);
    let current = typical(log, "current_a", &rows).unwrap_or(0.0);
    match top {
        v if v > 300_000.0 => doubt(name, true, format!("{v:.0} rev/min: electrical turns?")),
        v if v > 60_000.0 => doubt(name, false, format!("{v:.0} rev/min: electrical turns?")),
        v if v > 0.0 && v < 200.0 && current > 0.5 => {
            // a rotor that lifts something turns faster than that
            let lifts = typical(log, "thrust_n", &rows).is_some_and(|n| n > FAINT);
            doubt(name, v < 60.0 || lifts && v < STANDSTILL, format!("{v:.1} rev/min at {current:.1} A: rev/s, or thousands?"))
        }
        _ => None,
    }
}

/// A current that lifts something while no sensor sees the rotor turn.
fn still(log: &Log) -> Option<Doubt> {
    let mut speeds = SPEED.into_iter().filter_map(|s| Some((s, high(log.column(s)?)?)));
    let (name, first) = speeds.next()?;
    let top = speeds.fold(first, |top, (_, v)| top.max(v));
    let current = log.column("current_a").and_then(high).filter(|i| *i > 2.0 * FAINT)?;
    if top.abs() >= 1.0 {
        return None;
    }
    let thrust = log.column("thrust_n").and_then(high).filter(|n| *n > FAINT);
    let lifts = thrust.map_or_else(String::new, |n| format!(" and {n:.1} N"));
    let what = format!("0 rev/min on every sensor at {current:.1} A{lifts}: sensors without signal, or a blocked rotor?");
    // a rotor that is blocked draws a current, and lifts nothing
    doubt(name, thrust.is_some(), what)
}

fn supply(log: &Log) -> Option<Doubt> {
    if let Some(top) = log.column("voltage_v").and_then(high) {
        if top > 1000.0 {
            return doubt("voltage_v", true, format!("{top:.0} V: millivolts?"));
        }
        if top > 130.0 {
            return doubt("voltage_v", top > 500.0, format!("{top:.0} V: hundredths of a volt?"));
        }
    }
    let top = log.column("current_a").and_then(high)?;
    (top > 400.0).then(|| Doubt { column: "current_a", what: format!("{top:.0} A: milliamperes?"), never: top > 1000.0 })
}

/// A supply falls a little under load; a current rises from next to nothing.
fn swapped(log: &Log) -> Option<Doubt> {
    let (load, rest) = loaded(log);
    let of = |name| Some((typical(log, name, &rest)?, typical(log, name, &load)?));
    let ((v_rest, v_load), (i_rest, i_load)) = (of("voltage_v")?, of("current_a")?);
    let odd = v_load > 0.5 && v_rest.abs() < 0.2 * v_load && i_rest > 0.6 * i_load && i_load > 2.0;
    let what = format!("{v_rest:.2} V and {i_rest:.2} A at rest, {v_load:.2} V and {i_load:.2} A under load: columns swapped?");
    odd.then_some(Doubt { column: "voltage_v", what, never: true })
}

fn thrust(log: &Log) -> Option<Doubt> {
    let (rows, _) = loaded(log);
    let thrust = typical(log, "thrust_n", &rows)?;
    if thrust <= 0.0 {
        return None;
    }
    if let Some((_, n)) = turning(log, &rows) {
        let k = thrust / (n * n);
        let said = |likely: &str| format!("{thrust:.3} N at {n:.0} rev/min: {likely}");
        if k > 1.1e-3 {
            return doubt("thrust_n", true, said("grams? speed in rev/s or rad/s?"));
        }
        if k < 1e-12 {
            return doubt("thrust_n", true, said("kilograms? electrical turns?"));
        }
    }
    let power = typical(log, "voltage_v", &rows)? * typical(log, "current_a", &rows)?;
    // next to nothing of both is a meter's own error
    if power <= 0.0 || (power < FAINT && thrust < FAINT) {
        return None;
    }
    let per_watt = thrust / power;
    let said = |likely: &str| format!("{thrust:.3} N for {power:.1} W: {likely}");
    match per_watt {
        p if p > 12.0 => doubt("thrust_n", true, said("millinewtons? kiloamperes or kilovolts?")),
        p if p > 1.5 => doubt("thrust_n", true, said("grams?")),
        p if p > 0.6 => doubt("thrust_n", false, said("grams? a current of another unit?")),
        p if p < 0.001 => doubt("thrust_n", true, said("kilograms? columns swapped?")),
        p if p < 0.008 => doubt("thrust_n", false, said("kilograms?")),
        _ => None,
    }
}

/// What the head says of propeller and air.
fn head(log: &Log) -> Option<Doubt> {
    let known = Disc::of(log);
    if let Some(air) = known.density_kg_m3.filter(|air| !(0.1..=10.0).contains(air)) {
        return doubt(AIR, true, format!("air of {} kg/m^3: g/l, or a pressure of another unit?", trimmed(air, 6)));
    }
    let size = known.diameter_m.filter(|d| *d > LARGEST_M)?;
    if log.meta.contains_key("diameter_m") {
        return doubt("diameter_m", true, format!("a propeller of {size:.2} m: millimetres, or inches?"));
    }
    doubt(
        "propeller",
        true,
        format!("a propeller of {size:.2} m: a name in millimetres? it is read in inches (diameter_m says it in metres)"),
    )
}

/// Channels that no rig reverses: a rotor turns one way, and a supply gives.
fn reversed(log: &Log) -> Option<Doubt> {
    let (rows, _) = loaded(log);
    let negative = |name: &'static str| typical(log, name, &rows).filter(|v| *v < -FAINT).map(|v| (name, v));
    let (name, value) = SPEED.into_iter().chain(["voltage_v", "current_a"]).find_map(negative)?;
    doubt(name, true, format!("{} under load: the sign, or wires that are swapped?", trimmed(value, 3)))
}

/// What a column typically reads where it is far from zero: of its largest readings, whatever their sign.
fn far(log: &Log, name: &str) -> Option<f64> {
    let values = log.column(name)?;
    let top = high(&values.iter().map(|v| v.abs()).collect::<Vec<f64>>())?;
    let rows: Vec<usize> = (0..values.len()).filter(|i| values[*i].abs() > 0.7 * top).collect();
    typical(log, name, &rows)
}

/// A speed that is below 0 throughout: no load tells when the rotor turns, where that is the load.
fn backwards(log: &Log) -> Option<Doubt> {
    let negative = |name: &'static str| far(log, name).filter(|v| *v < -FAINT).map(|v| (name, v));
    let (name, value) = SPEED.into_iter().find_map(negative)?;
    doubt(
        name,
        true,
        format!("{} rev/min at the most: the sign? A rotor's speed reads above 0, whichever way it turns", trimmed(value, 1)),
    )
}

/// A torque below 0: which sign it has is the way the rotor turns.
fn twisted(log: &Log) -> Option<Doubt> {
    let (rows, rest) = loaded(log);
    let torque = typical(log, "torque_nm", &rows).filter(|v| *v < 0.0)?;
    let zero = typical(log, "torque_nm", &rest).unwrap_or(0.0);
    let turned = torque < zero && (torque - zero).abs() > 3.0 * zero.abs();
    let what = format!(
        "{} N.m under load: the sign, or a rotor that turns the other way round? What holds the rotor reads above 0",
        trimmed(torque, 4)
    );
    turned.then_some(Doubt { column: "torque_nm", what, never: false })
}

/// A temperature that nothing on a rig has.
fn heat(log: &Log) -> Option<Doubt> {
    let rows: Vec<usize> = (0..log.len()).collect();
    let temperature = typical(log, "temp_c", &rows)?;
    let said = |likely: &str| format!("{} degrees Celsius: {likely}", trimmed(temperature, 1));
    match temperature {
        t if t > 200.0 => doubt("temp_c", true, said("kelvin? tenths of a degree?")),
        t if t > 130.0 => doubt("temp_c", false, said("Fahrenheit?")),
        t if t < -90.0 => doubt("temp_c", true, said("a sensor without signal, or an offset of another unit?")),
        t if t < -40.0 => doubt("temp_c", false, said("a sensor without signal?")),
        _ => None,
    }
}

/// Thrust of the other sign: a load cell that is mounted the other way round, or a rotor that blows at it.
fn pushed(log: &Log) -> Option<Doubt> {
    let (rows, rest) = loaded(log);
    let thrust = typical(log, "thrust_n", &rows).filter(|v| *v < 0.0)?;
    let zero = typical(log, "thrust_n", &rest).unwrap_or(0.0);
    // a zero that is off by more than the rotor lifts is a tare, and no sign
    let turned = thrust < zero && (thrust - zero).abs() > 3.0 * zero.abs();
    let what = format!(
        "{} N under load: the sign, or a load cell the other way round? A rotor that lifts reads above 0",
        trimmed(thrust, 3)
    );
    turned.then_some(Doubt { column: "thrust_n", what, never: thrust < -FAINT })
}

/// What an actuator disc can do, and a propeller does.
fn disc(log: &Log) -> Option<Doubt> {
    let (rows, _) = loaded(log);
    let known = Disc::of(log);
    let (diameter, area, air) = (known.diameter_m?, known.area_m2()?, known.density_kg_m3?);
    let (name, rpm) = turning(log, &rows)?;
    let (thrust, n) = (typical(log, "thrust_n", &rows)?, rpm / 60.0);
    if thrust <= 0.0 || n <= 0.0 {
        return None;
    }
    let c_t = thrust / (air * n * n * diameter.powi(4));
    let said = |likely: &str| format!("a thrust coefficient of {} at {:.2} m: {likely}", trimmed(c_t, 4), diameter);
    match c_t {
        c if c > 1.0 => return doubt(name, true, said("speed in rad/s or rev/s? thrust in grams?")),
        c if c > 0.4 => return doubt(name, false, said("speed or thrust of another unit? another propeller?")),
        c if c < 0.001 => return doubt(name, true, said("electrical turns? thrust in kilograms?")),
        c if c < 0.01 => return doubt(name, false, said("electrical turns? thrust in kilograms? another propeller?")),
        _ => {}
    }
    let shaft = typical(log, "torque_nm", &rows)? * n * std::f64::consts::TAU;
    if shaft <= 0.0 || (shaft < FAINT && thrust < FAINT) {
        return None;
    }
    let merit = thrust.powf(1.5) / ((2.0 * air * area).sqrt() * shaft);
    let said = |likely: &str| {
        format!("a figure of merit of {} at {:.2} m, and an ideal disc has 1: {likely}", trimmed(merit, 3), diameter)
    };
    match merit {
        m if m > 2.0 => doubt("thrust_n", true, said("thrust or torque of another unit?")),
        m if m > 1.0 => doubt("thrust_n", false, said("thrust or torque of another unit? another propeller?")),
        m if m < 0.03 => doubt("thrust_n", true, said("thrust in kilograms? torque of another unit?")),
        m if m < 0.1 => doubt("thrust_n", false, said("thrust in kilograms or pounds? torque of another unit?")),
        _ => None,
    }
}

fn torque(log: &Log) -> Option<Doubt> {
    let (rows, _) = loaded(log);
    let (torque, (_, n)) = (typical(log, "torque_nm", &rows)?, turning(log, &rows)?);
    let power = typical(log, "voltage_v", &rows)? * typical(log, "current_a", &rows)?;
    let shaft = torque * n * std::f64::consts::TAU / 60.0;
    if power <= 0.0 || torque <= 0.0 || (power < FAINT && shaft < FAINT) {
        return None;
    }
    let said = |likely: &str| format!("{shaft:.1} W at the shaft of {power:.1} W from the supply: {likely}");
    match shaft / power {
        p if p > 5.0 => doubt("torque_nm", true, said("N.cm or N.mm? columns swapped?")),
        p if p > 1.1 => doubt("torque_nm", false, said("torque of another unit, or a gain that is off?")),
        p if p < 0.01 => doubt("torque_nm", true, said("columns swapped?")),
        p if p < 0.1 => doubt("torque_nm", false, said("torque of another unit?")),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A staircase of a small rig, with one column in another unit.
    fn rig(head: &str, of: impl Fn(f64, f64, f64, f64) -> [f64; 4]) -> Result<Log, String> {
        let mut text = format!("# quadrig-log 1\n{head}t_s,rpm,thrust_n,voltage_v,current_a\n");
        for row in 0..400 {
            let rpm = 1000.0 * f64::from(row / 80);
            let values = of(rpm, 1.7e-7 * rpm * rpm, 12.0 - 1e-4 * rpm, 2e-10 * rpm.powi(3));
            let values: Vec<String> = values.iter().map(|v| format!("{v:.4}")).collect();
            text += &format!("{},{}\n", 0.1 * f64::from(row), values.join(","));
        }
        let folder = tempfile::TempDir::new().expect("a folder");
        let path = folder.path().join("rig.csv");
        std::fs::write(&path, text).expect("written");
        let log = Log::read(&path).map_err(|e| e.to_string())?;
        log.refuse_absurd(&path).map_err(|e| e.to_string())?;
        Ok(log)
    }

    #[test]
    fn a_current_a_thousand_times_too_small_is_refused() {
        for (column, of) in [("current", [1.0, 1e-3]), ("voltage", [1e-3, 1.0])] {
            let found = rig("", |n, t, u, i| [n, t, of[0] * u, of[1] * i]).expect_err(column);
            assert!(found.contains("thrust_n") && found.contains("kilo"), "{column}: {found}");
        }
    }

    /// A speed in rev/s is no rotor that stands: it lifts.
    #[test]
    fn a_rotor_that_lifts_something_does_not_stand() {
        let per_second = |n: f64| n / 60.0;
        let found = rig("", |n, t, u, i| [1.4 * per_second(n), 3.0 * t, u, i]).expect_err("rev/s");
        assert!(found.contains("rpm") && found.contains("93.3 rev/min at 9.1 A: rev/s, or thousands?"), "{found}");
        let grams = rig("", |n, t, u, i| [n, 102.0 * t, u, i]).expect_err("grams");
        assert!(grams.contains("grams?") && !grams.contains("kilo"), "{grams}");
    }

    #[test]
    fn thrust_of_the_other_sign_and_a_rotor_that_nobody_sees_are_refused() {
        let turned = rig("", |n, t, u, i| [n, -t, u, i]).expect_err("a sign");
        assert!(turned.contains("thrust_n") && turned.contains("the other way round?"), "{turned}");
        let unseen = rig("", |_, t, u, i| [0.0, t, u, i]).expect_err("no tachometer");
        assert!(unseen.contains("0 rev/min on every sensor at 12.8 A and 2.7 N: sensors without signal"), "{unseen}");
        let blocked = rig("", |_, _, u, i| [0.0, 0.0, u, i]).expect("a rotor may be blocked");
        assert!(blocked.in_doubt().iter().any(|d| d.contains("a blocked rotor?")), "{:?}", blocked.in_doubt());
    }

    /// Every fifth row gone: refused where nobody states a rate, and taken where the head vouches for the time.
    #[test]
    fn a_fifth_of_an_even_clock_is_missed() {
        let of = |head: &str, keep: &dyn Fn(usize) -> bool| {
            let row = |n: usize| format!("{},{},{}\n", trimmed(0.1 * n as f64, 1), n / 80 * 1000, n / 80);
            let rows: String = (0..400).filter(|n| keep(*n)).map(row).collect();
            let folder = tempfile::TempDir::new().expect("a folder");
            let path = folder.path().join("rig.csv");
            std::fs::write(&path, format!("# quadrig-log 1\n{head}t_s,rpm,thrust_n\n{rows}")).expect("written");
            Log::read(&path).and_then(|log| log.refuse_absurd(&path)).map_err(|e| e.to_string())
        };
        let fifth = of("", &|n| n % 5 != 3).expect_err("every fifth row is gone");
        assert!(fifth.contains("rig.csv:2: column t_s: 20 % of the time has no row"), "{fifth}");
        assert!(fifth.contains("expected a row at every tick: use the whole log"), "{fifth}");
        of("# vouched = [\"t_s\"]\n", &|n| n % 5 != 3).expect("vouched for");
        of("", &|n| n % 9 != 3).expect("one of nine");
        of("", &|n| !(100..180).contains(&n)).expect("a pause");
        of("# sample_hz = 8\n", &|n| n % 5 != 3).expect("eight rows a second by a clock of ten ticks");
    }

    /// A run with a torque and a temperature: what either does to the log, and what is said.
    #[test]
    fn speeds_below_0_kelvin_and_a_torque_of_the_other_sign_are_told() {
        let of = |speed: f64, torque: f64, degrees: f64| {
            let row = |k: i32| {
                let rpm = 1000.0 * f64::from(k / 80);
                let (thrust, torque) = (1.7e-7 * rpm * rpm, torque * 2.5e-9 * rpm * rpm);
                format!("{},{},{thrust:.5},{torque:.6},{degrees}\n", 0.1 * f64::from(k), speed * rpm)
            };
            let rows: String = (0..400).map(row).collect();
            let head = "# quadrig-log 1\nt_s,rpm_beam,thrust_n,torque_nm,temp_c\n";
            let log = Log::parse("rig.csv", (head.to_owned() + &rows).as_bytes()).expect("a log");
            doubts(&log).map(|d| (d.column, d.never, d.what)).collect::<Vec<_>>()
        };
        assert_eq!(of(1.0, 1.0, 15.0), []);
        let backwards = of(-1.0, 1.0, 15.0);
        assert!(matches!(&backwards[..], [("rpm_beam", true, what), ..] if what.contains("the sign?")), "{backwards:?}");
        let twisted = of(1.0, -1.0, 15.0);
        assert!(matches!(&twisted[..], [("torque_nm", false, what)] if what.contains("the other way round?")), "{twisted:?}");
        for (degrees, never, likely) in [
            (288.15, true, "kelvin?"),
            (150.0, false, "Fahrenheit?"),
            (-385.0, true, "an offset"),
            (-60.0, false, "without signal"),
        ] {
            let found = of(1.0, 1.0, degrees);
            assert!(matches!(&found[..], [("temp_c", n, what)] if *n == never && what.contains(likely)), "{degrees}: {found:?}");
        }
    }

    /// 2 N at 4000 rev/min of an 11 inch propeller: C_T is 0.06.
    #[test]
    fn what_no_disc_does_is_told() {
        const HEAD: &str = "# propeller = \"11x4.7\"\n# air_density_kg_m3 = 1.2\n";
        rig(HEAD, |n, t, u, i| [n, t, u, i]).expect("a propeller");
        let rad_s = rig(HEAD, |n, t, u, i| [n / 9.5493, t, u, i]).expect_err("rad/s");
        assert!(rad_s.contains("rad/s"), "{rad_s}");
        let electrical = rig(HEAD, |n, t, u, i| [7.0 * n, t, u, i]).expect("odd");
        assert!(electrical.in_doubt().iter().any(|d| d.contains("electrical turns?")), "{:?}", electrical.in_doubt());
        for (head, said) in [
            ("# air_density_kg_m3 = 0.001225\n", "0.001225 kg/m^3"),
            ("# motor = \"A\"\n# air_density_kg_m3 = \"banana\"\n", "rig.csv:3: air_density_kg_m3 = \"banana\"; expected"),
            ("# motor = \"A\"\n# propeller = \"279x119\"\n", "rig.csv:3: propeller = \"279x119\": a propeller of 7.09 m"),
            ("# air_density_kg_m3 = 1e9\n", "rig.csv:2: air_density_kg_m3 = 1000000000.0: air of"),
            ("# diameter_m = 280\n", "rig.csv:2: diameter_m = 280: a propeller of 280.00 m: millimetres, or inches?"),
        ] {
            let found = rig(head, |n, t, u, i| [n, t, u, i]).expect_err(head);
            assert!(found.contains(said), "{found}");
        }
        let reversed = rig("", |n, t, u, i| [n, t, -u, i]).expect_err("a sign");
        assert!(reversed.contains("voltage_v") && reversed.contains("sign"), "{reversed}");
    }

    /// The same rig with a torque: 2.7 N for 17 W at the shaft have a merit of 0.67.
    #[test]
    fn no_propeller_beats_an_ideal_disc() {
        let of = |times: f64| {
            let row = |k: i32| {
                let rpm = 1000.0 * f64::from(k / 80);
                let (thrust, torque) = (times * 1.7e-7 * rpm * rpm, 2.5e-9 * rpm * rpm);
                format!("{},{rpm},{thrust:.5},{torque:.6}\n", 0.1 * f64::from(k))
            };
            let rows: String = (0..400).map(row).collect();
            let head = "# quadrig-log 1\n# propeller = \"11x4.7\"\n# air_density_kg_m3 = 1.2\nt_s,rpm,thrust_n,torque_nm\n";
            let log = Log::parse("rig.csv", (head.to_owned() + &rows).as_bytes()).expect("a log");
            disc(&log).map(|doubt| (doubt.never, doubt.what))
        };
        assert_eq!(of(1.0), None);
        assert!(of(1.8).is_some_and(|(never, what)| !never && what.contains("an ideal disc has 1")), "{:?}", of(1.8));
        assert!(of(2.5).is_some_and(|(never, _)| never) && of(0.06).is_some_and(|(never, _)| !never), "{:?}", of(0.06));
    }

    #[test]
    fn a_rounding_error_of_the_clock_is_not_told() {
        let t = (0..3200).map(|i| 0.1 + 7.0 * f64::from(i) + 1e-11 * f64::from(i % 2)).collect();
        let found = rate(&Log { t, ..Log::default() }).expect("a doubt");
        assert!(found.never && found.what.starts_with("rows 7 s apart, 22393 s in all: milliseconds"), "{}", found.what);
    }

    #[test]
    fn a_unit_that_no_rig_reaches_is_refused_and_may_be_vouched_for() {
        rig("", |n, t, u, i| [n, t, u, i]).expect("a rig");
        let grams = rig("", |n, t, u, i| [n, 1000.0 * t / 9.80665, u, i]).expect_err("grams");
        assert!(grams.contains("rig.csv:2") && grams.contains("thrust_n") && grams.contains("grams?"), "{grams}");
        let millivolts = rig("", |n, t, u, i| [n, t, 1000.0 * u, i]).expect_err("millivolts");
        assert!(millivolts.contains("voltage_v") && millivolts.contains("millivolts?"), "{millivolts}");
        let swapped = rig("", |n, t, u, i| [n, t, i + 0.05, u]).expect_err("swapped");
        assert!(swapped.contains("columns swapped?"), "{swapped}");
        let vouched =
            rig("# vouched = [\"voltage_v\", \"thrust_n\"]\n", |n, t, u, i| [n, t, 1000.0 * u, i]).expect("vouched for");
        assert!(vouched.in_doubt().iter().any(|d| d.contains("voltage_v: in doubt")), "{:?}", vouched.in_doubt());
    }
}
