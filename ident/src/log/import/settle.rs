//! Columns whose header does not say all: time stamps, quantities without a unit, electrical turns.
//!
//! What it is: what the values allow is taken and said; where they leave a doubt the column is refused with the likely unit.
//! What can go wrong: a time, a thrust or a torque without a unit is never guessed; electrical turns need the pole pairs.
//! Units: the contract's.
//! Reference: DShot commands 48 to 2047 (Betaflight wiki); 16-bit commands of the Crazyflie.

use super::Report;
use super::clock::{over_midnight, since_1970};
use super::table::{Field, Reading};
use crate::log::plausible::units_of;
use crate::log::{Place, ReadError, trimmed};
use crate::numeric::order::median;

/// Settles every column.
pub(super) fn settle(
    place: &Place<'_>,
    fields: &mut Vec<Field>,
    pole_pairs: Option<f64>,
    report: &mut Report,
) -> Result<(), ReadError> {
    // a wheel that counts electrical turns is needed only where nothing else tells the speed
    let other_speed =
        fields.iter().any(|f| f.name.starts_with("rpm") && !matches!(f.reading, Reading::Electrical(_)) && reads(&f.values));
    if other_speed && pole_pairs.is_none() {
        fields.retain(|f| {
            let goes = matches!(f.reading, Reading::Electrical(_));
            report.add(
                &f.name,
                format!("column '{}': electrical turns without --pole-pairs; another speed reads: left out", f.cell),
                usize::from(goes),
            );
            !goes
        });
    }
    let dry = fields.iter().any(|f| f.name == "t_s" && f.stamps.0 == 0);
    for field in fields.iter_mut() {
        match field.reading {
            Reading::Stamp => stamps(place, field, report)?,
            Reading::Electrical(factor) => {
                let Some(pairs) = pole_pairs else {
                    let expected = "--pole-pairs N (a motor with 14 magnets has 7), or another speed";
                    return Err(place.refuse(Some(&field.cell), "electrical turns and no pole pairs", expected));
                };
                scale(field, factor / pairs, 0.0);
                report.add(
                    &field.name,
                    format!("column '{}': electrical turns, times {factor} over {pairs} pole pairs", field.cell),
                    1,
                );
            }
            Reading::Unitless(what) => unitless(place, field, what, report)?,
            // milliseconds of a day, as VESC Tool counts them
            Reading::Number(..) if dry && field.name == "t_s" && field.cell == "ms_today" => over_midnight(&mut field.values),
            Reading::Number(..) => {}
        }
        if field.name == "pulse_us" {
            no_pulse(place, field, report)?;
        }
    }
    Ok(())
}

/// A pulse that no ESC takes is none: kept as missing, unless most are.
fn no_pulse(place: &Place<'_>, field: &mut Field, report: &mut Report) -> Result<(), ReadError> {
    let odd = |v: &f64| v.is_finite() && !(500.0..=2500.0).contains(v);
    let (count, wrong) =
        (field.values.iter().filter(|v| odd(v)).count(), field.values.iter().filter(|v| odd(v) && **v != 0.0).count());
    let most = field.values.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
    if 2 * wrong > field.values.iter().filter(|v| v.is_finite()).count() {
        let found = format!("pulses up to {most} us: per cent, DShot or another unit?");
        return Err(place.refuse(Some(&field.cell), found, "500 to 2500 us, or --map 'pulse_us=COLUMN*FACTOR+OFFSET'"));
    }
    field.values.iter_mut().filter(|v| odd(v)).for_each(|v| *v = f64::NAN);
    report.add("pulse_us", "no pulse (0, or outside 500 to 2500 us): kept as missing", count);
    Ok(())
}

fn reads(values: &[f64]) -> bool {
    values.iter().any(|v| v.is_finite() && *v != 0.0)
}

fn scale(field: &mut Field, factor: f64, offset: f64) {
    field.values.iter_mut().for_each(|v| *v = *v * factor + offset);
}

/// Dates and times of day, counts since 1970; a bare number has no unit.
fn stamps(place: &Place<'_>, field: &mut Field, report: &mut Report) -> Result<(), ReadError> {
    let present: Vec<f64> = field.values.iter().copied().filter(|v| v.is_finite()).collect();
    let (count, dated) = field.stamps;
    if count > 0 {
        if count < present.len() {
            return Err(place.refuse(Some(&field.cell), "numbers among dates or times of day", "one form of time in every row"));
        }
        let what = if dated { "date and time of day" } else { "time of day (a step back by half a day is midnight)" };
        report.add("t_s", format!("column '{}': {what}, as seconds since the first row", field.cell), 1);
        if !dated {
            over_midnight(&mut field.values);
        }
        let first = present.first().copied().unwrap_or(0.0);
        field.values.iter_mut().for_each(|t| *t = ((*t - first) * 1e6).round() / 1e6);
        return Ok(());
    }
    let first = present.first().copied().unwrap_or(0.0);
    if let Some((factor, unit)) = since_1970(first) {
        report.add("t_s", format!("column '{}': {unit} since 1970 by its size, as seconds since the first row", field.cell), 1);
        field.values.iter_mut().for_each(|t| *t = ((*t - first) * factor * 1e6).round() / 1e6);
        return Ok(());
    }
    let mut steps: Vec<f64> = field.values.windows(2).map(|w| w[1] - w[0]).filter(|s| *s > 0.0).collect();
    let step = if steps.is_empty() { 0.0 } else { median(&mut steps) };
    let factors: &[&str] = match step {
        s if s >= 2000.0 => &["*0.000001"],
        // a row each second in milliseconds, or a thousand rows a second in microseconds
        s if s >= 500.0 => &["*0.000001", "*0.001"],
        s if s >= 1.0 => &["*0.001"],
        _ => &[""],
    };
    let maps: Vec<String> = factors.iter().map(|factor| format!("'t_s={}{factor}'", field.cell)).collect();
    Err(place.refuse(
        Some(&field.cell),
        format!("a time without a unit, rows {} apart: {}", trimmed(step, 4), units_of(step)),
        format!("the unit in the header, such as 'Time (s)', or --map {}", maps.join(" or ")),
    ))
}

/// Whether all present values but strays lie in a range.
fn within(values: &[f64], low: f64, high: f64) -> bool {
    let (mut count, mut inside) = (0, 0);
    for v in values.iter().filter(|v| v.is_finite()) {
        count += 1;
        inside += usize::from((low..=high).contains(v));
    }
    count > 0 && inside == count
}

fn unitless(place: &Place<'_>, field: &mut Field, what: &'static str, report: &mut Report) -> Result<(), ReadError> {
    let most = field.values.iter().copied().filter(|v| v.is_finite()).map(f64::abs).fold(0.0, f64::max);
    if most == 0.0 && what != "temp_c" {
        return Ok(()); // nothing there: whatever its unit
    }
    let least = |low: f64| within(&field.values, low, f64::INFINITY);
    let pulse = |values: &[f64]| values.iter().all(|v| v.is_nan() || *v == 0.0 || (500.0..=2500.0).contains(v)) && most >= 800.0;
    // what is taken: factor, offset and unit; or what is likely, with a factor to try
    let taken: Result<(f64, f64, &str), (&str, &str)> = match what {
        "pwm" if most > 2600.0 && most <= 65_535.0 && least(0.0) => {
            Ok((1000.0 / 65_535.0, 1000.0, "16 bits, as 1000 to 2000 us"))
        }
        "pulse_us" | "pwm" if pulse(&field.values) => Ok((1.0, 0.0, "us, by its size")),
        "pulse_us" | "pwm" => Err(match most {
            m if m <= 1.0 => ("a share of full throttle?", "*1000+1000"),
            m if m <= 100.0 => ("per cent?", "*10+1000"),
            m if m <= 255.0 => ("8 bits?", "*3.9216+1000"),
            m if m <= 2047.0 => ("DShot 0 to 2047?", "*0.5+976"),
            _ => ("counts?", "*FACTOR+OFFSET"),
        }),
        "duty" if most <= 1.0 => Ok((1000.0, 1000.0, "duty of one, as 1000 to 2000 us")),
        "duty" if most <= 100.0 => Ok((10.0, 1000.0, "duty in per cent, as 1000 to 2000 us")),
        "duty" => Err(("counts?", "*FACTOR+1000")),
        "voltage_v" => match most {
            m if (1.0..=130.0).contains(&m) && least(-1.0) => Ok((1.0, 0.0, "V, by its size")),
            m if m > 13_000.0 || (m > 2500.0) => Err(("millivolts?", "*0.001")),
            m if m > 130.0 => Err(("hundredths of a volt?", "*0.01")),
            _ => Err(("volts?", "")),
        },
        "current_a" if most <= 500.0 => Ok((1.0, 0.0, "A, by its size")),
        "current_a" => Err(("milliamperes?", "*0.001")),
        "temp_c" if within(&field.values, -60.0, 250.0) => Ok((1.0, 0.0, "degC, by its size")),
        "temp_c" => Err(("kelvin?", "*1+-273.15")),
        "charge_esc_mah" => Ok((1.0, 0.0, "mAh")),
        "thrust_n" => Err(if most > 100.0 { ("grams?", "*0.00980665") } else { ("newtons? kilograms?", "*FACTOR") }),
        "torque_nm" => Err(if most > 20.0 { ("N.mm or N.cm?", "*FACTOR") } else { ("N.m?", "") }),
        _ => Err(if most > 500.0 { ("rev/min?", "") } else { ("rev/s or rad/s?", "*FACTOR") }),
    };
    match taken {
        Ok((factor, offset, unit)) => {
            scale(field, factor, offset);
            report.add(&field.name, format!("column '{}' has no unit: taken as {unit}", field.cell), 1);
            Ok(())
        }
        Err((likely, factor)) => Err(place.refuse(
            Some(&field.cell),
            format!("no unit, values up to {most}: {likely}"),
            format!("the unit in the header in brackets, or --map '{}={}{factor}'", field.name, field.cell),
        )),
    }
}
