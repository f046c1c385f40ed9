//! `quadrig calibrate gyro|accel|mag|align`.
//!
//! What it is: sensor errors from a recording: gyro zero and six-position accelerometer from its stretches of rest, hard and soft
//! iron from the whole of it, the magnetometer's axes against the accelerometer's from the stretches of rest.
//! What can go wrong: what the recording does not show is refused, one line a sensor; nothing is written then.
//! Units: rad/s, m/s^2, uT in the recording and in the file.
//! Reference: specification `ahrs.md`, "Calibration"; `dcm::calibration`.

mod rest;

use crate::Failure;
use crate::ahrs::imu_log::ImuLog;
use crate::replace::put;
use dcm::calibration::{Calibration, CalibrationError, Collector, GyroZero, alignment, ellipsoid, six_positions};
use dcm::{Mat3, Vec3};
use rest::{Rest, length};
use std::fmt::Write;
use std::path::Path;

/// Which sensors.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Sensor {
    /// Zero from the stretches of rest.
    Gyro,
    /// Offset and gain from rest with each axis up and down.
    Accel,
    /// Hard and soft iron from readings in all directions.
    Mag,
    /// Magnetometer axes from rest in many attitudes; needs `mag` too, or readings without iron.
    Align,
}

impl Sensor {
    fn name(self) -> &'static str {
        match self {
            Self::Gyro => "gyro",
            Self::Accel => "accel",
            Self::Mag => "mag",
            Self::Align => "align",
        }
    }
}

/// The errors of `sensors` from the recording `input`, into `output`.
pub(super) fn run(sensors: &[Sensor], input: &Path, output: &Path, quiet: bool) -> Result<(), Failure> {
    let log = ImuLog::read(input)?;
    let rests = rest::find(&log);
    let mut calibration = Calibration::default();
    let mut text = format!("# quadrig-imu-calibration 1\nrecording = {:?}\n", input.display().to_string());
    for sensor in [Sensor::Gyro, Sensor::Accel, Sensor::Mag, Sensor::Align] {
        if !sensors.contains(&sensor) {
            continue;
        }
        let done = match sensor {
            Sensor::Gyro => gyro(&rests, &mut calibration),
            Sensor::Accel => accel(&rests, &mut calibration),
            Sensor::Mag => mag(&log, &mut calibration),
            Sensor::Align => align(&rests, &mut calibration),
        };
        let section = done.map_err(|e| format!("{}: {}: {e}", input.display(), sensor.name()))?;
        let _ = write!(text, "\n[{}]\n{section}", sensor.name());
    }
    put(output, &text)?;
    if !quiet {
        crate::say::text(&text);
    }
    Ok(())
}

/// What to do about a refusal.
fn explain(error: CalibrationError) -> String {
    match error {
        CalibrationError::TooFew { found, needed } => format!("{found} readings; expected at least {needed}: record longer"),
        CalibrationError::Moving { scatter } => format!("it moved (scatter {scatter:.4}); expected rest: leave it alone"),
        CalibrationError::Coverage { found } => {
            format!("{:.0} % of what is needed was seen; expected every direction: turn it further", 100.0 * found)
        }
        CalibrationError::Position { index } => {
            let axis = ["+x", "-x", "+y", "-y", "+z", "-z"].get(usize::from(index)).unwrap_or(&"?");
            format!("no rest with {axis} up; expected a rest in each of the six positions")
        }
        _ => "no fit; expected readings on an ellipsoid: is the sensor saturated, or iron moving about?".to_owned(),
    }
}

fn vector(name: &str, v: &Vec3) -> String {
    format!("{name} = [{:.6}, {:.6}, {:.6}]\n", v.x, v.y, v.z)
}

fn matrix(m: &Mat3) -> String {
    let rows: Vec<String> = m.row_iter().map(|r| format!("[{:.6}, {:.6}, {:.6}]", r[0], r[1], r[2])).collect();
    format!("matrix = [{}]\n", rows.join(", "))
}

fn gyro(rests: &[Rest], calibration: &mut Calibration) -> Result<String, String> {
    let mut zero = GyroZero::default();
    rests.iter().flat_map(|r| &r.rates).for_each(|w| zero.add(w));
    let (offset, sigma) = zero.finish(rest::GYRO_NOISE).map_err(explain)?;
    calibration.gyro_offset = offset;
    Ok(vector("offset_rad_s", &offset) + &vector("offset_sigma_rad_s", &sigma) + &format!("readings = {}\n", zero.count()))
}

fn accel(rests: &[Rest], calibration: &mut Calibration) -> Result<String, String> {
    let mut best: [Option<(&Rest, f32)>; 6] = [None; 6];
    for r in rests {
        let (axis, value) =
            r.force.iter().enumerate().fold((0, 0.0f32), |m: (usize, f32), (i, v)| if v.abs() > m.1.abs() { (i, *v) } else { m });
        let share = value.abs() / length(&r.force);
        let slot = &mut best[2 * axis + usize::from(value < 0.0)];
        if share > 0.95 && slot.is_none_or(|(_, s)| share > s) {
            *slot = Some((r, share));
        }
    }
    let mut readings = [Vec3::zeros(); 6];
    for (index, (slot, found)) in readings.iter_mut().zip(best).enumerate() {
        *slot = found.ok_or_else(|| explain(CalibrationError::Position { index: index as u8 }))?.0.force;
    }
    let noise = best.iter().flatten().map(|(r, _)| r.force_sigma).fold(0.0, f32::max);
    let found = six_positions(&readings, noise).map_err(explain)?;
    (calibration.accel_offset, calibration.accel_matrix) = (found.offset, found.matrix);
    let gain_sigma = format!("gain_sigma = [{:.6}, {:.6}, {:.6}]\n", found.gain_sigma.x, found.gain_sigma.y, found.gain_sigma.z);
    Ok(vector("offset_m_s2", &found.offset)
        + &vector("offset_sigma_m_s2", &found.offset_sigma)
        + &vector("gain", &found.gain)
        + &gain_sigma
        + &matrix(&found.matrix)
        + &format!("residual_m_s2 = {:.4}\n", found.residual))
}

fn mag(log: &ImuLog, calibration: &mut Calibration) -> Result<String, String> {
    let fields = || log.rows.iter().filter_map(|r| r.mag);
    let count = fields().count();
    if count == 0 {
        return Err("no readings of mx,my,mz; expected a recording with the magnetometer".to_owned());
    }
    let mean = fields().sum::<Vec3>() / count as f32;
    let size = (fields()
        .map(|m| {
            let d = m - mean;
            d.dot(&d)
        })
        .sum::<f32>()
        / count as f32)
        .sqrt();
    let mut store = Collector::new(size);
    fields().for_each(|m| {
        store.add(&m);
    });
    let found = ellipsoid(store.readings()).map_err(explain)?;
    (calibration.mag_offset, calibration.mag_matrix) = (found.offset, found.matrix);
    Ok(vector("offset_ut", &found.offset)
        + &vector("offset_sigma_ut", &found.offset_sigma)
        + &matrix(&found.matrix)
        + &format!(
            "norm_ut = {:.3}\nresidual_ut = {:.3}\ncoverage = {:.2}\nreadings = {}\n",
            found.norm,
            found.residual,
            found.coverage,
            store.readings().len()
        ))
}

fn align(rests: &[Rest], calibration: &mut Calibration) -> Result<String, String> {
    let pairs: Vec<(Vec3, Vec3)> =
        rests.iter().filter_map(|r| Some((calibration.accel(&r.force), calibration.mag(&r.field?)))).collect();
    let found = alignment(&pairs).map_err(explain)?;
    calibration.mag_matrix = found.matrix * calibration.mag_matrix;
    Ok(vector("angle_rad", &found.angle)
        + &vector("angle_sigma_rad", &found.sigma)
        + &matrix(&found.matrix)
        + &format!("residual_rad = {:.5}\nattitudes = {}\n", found.residual, pairs.len()))
}
