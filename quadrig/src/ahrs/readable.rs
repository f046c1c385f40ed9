//! What the sensors of an IMU can read.
//!
//! What it is: a cell that no such sensor reads, and a recording whose time, gravity or field is of another unit, each with the likely one.
//! What can go wrong: a recording in deg/s that turns slowly, a field in mG: both look like what they should be.
//! Units: s, rad/s, m/s^2, uT.
//! Reference: specification `formats.md`, "Attitude log"; data sheets of MPU-6000, ITG-3200, ADXL345, HMC5883L for the ranges.

use super::imu_log::Row;
use dcm::Vec3;

/// Most that a cell of gyro, accelerometer and magnetometer may hold. The widest ranges of such sensors are 70 rad/s and 320 m/s^2; a magnet
/// beside the sensor gives some thousand uT.
const MOST: [f64; 3] = [100.0, 1000.0, 100_000.0];
/// Longest time between two rows of an IMU, s.
const APART_S: f64 = 1.0;
/// Rows below which nothing is said about gravity and field.
const ENOUGH: usize = 10;
/// Where the middle length of the specific force lies in any recording on earth, m/s^2; in the hand of a runner it is 14.7.
const GRAVITY: [f32; 2] = [5.0, 20.0];
/// Strongest field in the middle of a recording, uT; that of the earth is at most 66.
const FIELD: f32 = 1000.0;

/// Refuses what is no reading of the given sensor; a missing one is not a number.
pub(super) fn cell(sensor: usize, value: f64) -> Result<(), String> {
    let most = MOST.get(sensor).copied().unwrap_or(f64::INFINITY);
    if value.is_nan() || value.abs() <= most {
        return Ok(());
    }
    let (unit, likely) = match sensor {
        0 if value.abs() < 1e5 => ("rad/s", format!("is it in deg/s? {value} deg/s are {:.4} rad/s", value.to_radians())),
        0 => ("rad/s", "is the file damaged?".to_owned()),
        1 => ("m/s^2", "is it in mg? A thousand are 9.80665 m/s^2".to_owned()),
        _ => ("uT", "is it in nT? A thousand are 1 uT".to_owned()),
    };
    Err(format!("{value:?} is more than such a sensor reads; expected {unit}, {most} at most: {likely}"))
}

/// Refuses a recording that is of other units as a whole.
pub(super) fn whole(rows: &[Row]) -> Result<(), String> {
    let steps = rows.windows(2).map(|w| (w[1].t - w[0].t) as f32).collect();
    if let Some(apart) = middle(steps).map(f64::from).filter(|apart| *apart > APART_S) {
        let (unit, times) = match apart {
            a if a <= 1e3 => ("milliseconds", 1e3),
            a if a <= 1e6 => ("microseconds", 1e6),
            _ => ("nanoseconds", 1e9),
        };
        let expected = format!("expected seconds, rows at most {APART_S} s apart: these look like {unit}: divide t_s by {times}");
        return Err(format!("column t_s: rows {apart} s apart, which is no IMU's; {expected}"));
    }
    if let Some(force) = norm(rows, |row| row.accel).filter(|force| !(GRAVITY[0]..=GRAVITY[1]).contains(force)) {
        let likely = match force {
            f if (0.5..=1.5).contains(&f) => "these look like g: multiply them by 9.80665",
            f if (500.0..=1500.0).contains(&f) => "these look like mg: multiply them by 0.00980665",
            _ => "are they in g, or in mg, or counts? Without an accelerometer leave the fields empty",
        };
        let expected = "expected m/s^2, about 9.8 at rest";
        return Err(format!("columns ax,ay,az: {force:.3} long in the middle of the recording; {expected}: {likely}"));
    }
    if let Some(field) = norm(rows, |row| row.mag).filter(|field| *field > FIELD) {
        let expected =
            "expected uT, 25 to 65 of the earth's field: are they in nT (divide by 1000), in mG (divide by 10), or counts?";
        return Err(format!("columns mx,my,mz: {field:.0} long in the middle of the recording; {expected}"));
    }
    Ok(())
}

/// Middle length of a sensor's readings, where there are enough.
fn norm(rows: &[Row], of: fn(&Row) -> Option<Vec3>) -> Option<f32> {
    let lengths: Vec<f32> = rows.iter().filter_map(of).map(|v| v.norm()).collect();
    if lengths.len() < ENOUGH { None } else { middle(lengths) }
}

fn middle(mut values: Vec<f32>) -> Option<f32> {
    let half = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(half, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(step: f64, accel: f32, mag: f32) -> Vec<Row> {
        let row = |n: i32| Row {
            t: f64::from(n) * step,
            gyro: Some([0.0; 3].into()),
            accel: Some([0.0, 0.0, accel].into()),
            mag: Some([mag, 0.0, 0.0].into()),
        };
        (0..20).map(row).collect()
    }

    #[test]
    fn a_recording_of_other_units_is_known() {
        for (step, accel, mag) in [(0.0035, 9.8, 44.0), (1.0, -9.8, 0.0), (0.02, 14.0, 400.0), (0.01, 9.8, 999.0)] {
            whole(&rows(step, accel, mag)).expect("an IMU's");
        }
        for (step, accel, mag, wanted) in [
            (5.0, 9.8, 44.0, "rows 5 s apart"),
            (5.0, 9.8, 44.0, "milliseconds: divide t_s by 1000"),
            (5000.0, 9.8, 44.0, "microseconds: divide t_s by 1000000"),
            (5e6, 9.8, 44.0, "nanoseconds"),
            (0.01, 1.0, 44.0, "look like g"),
            (0.01, 1000.0, 44.0, "look like mg"),
            (0.01, 0.0, 44.0, "leave the fields empty"),
            (0.01, 21.0, 44.0, "expected m/s^2"),
            (0.01, 9.8, 44_000.0, "in nT"),
        ] {
            let said = whole(&rows(step, accel, mag)).expect_err("of other units");
            assert!(said.contains(wanted) && said.contains("expected"), "{said}");
        }
        let few = rows(0.01, 1.0, 44.0);
        whole(&few[..5]).expect("too few to say");
    }

    #[test]
    fn a_cell_is_within_the_range_of_such_sensors() {
        for (sensor, value) in [(0, 100.0), (1, -1000.0), (2, 4900.0), (0, f64::NAN)] {
            cell(sensor, value).expect("a reading");
        }
        for (sensor, value, wanted) in [(0, -250.0, "deg/s are -4.3633 rad/s"), (1, 9806.65, "in mg"), (2, 1e6, "in nT")] {
            let said = cell(sensor, value).expect_err("no reading");
            assert!(said.contains(wanted) && said.contains("expected"), "{said}");
        }
    }
}
