//! A calibration file, as `quadrig calibrate` writes it.
//!
//! What it is: the sections `gyro`, `accel`, `mag` and `align`, each of which may be missing; a missing one changes nothing.
//! What can go wrong: another format, a section without its numbers, numbers that are not finite: one line with file, section and key.
//! Units: rad/s, m/s^2, uT.
//! Reference: `dcm::calibration`.

use crate::trouble::unread;
use dcm::calibration::Calibration;
use dcm::{Mat3, Vec3};
use std::path::Path;
use toml::{Table, Value};

const FORMAT: &str = "# quadrig-imu-calibration 1";

/// Reads a calibration.
pub(crate) fn read(path: &Path) -> Result<Calibration, String> {
    let text = std::fs::read_to_string(path).map_err(unread(&path))?;
    parse(&text).map_err(|e| format!("{}: {e}", path.display()))
}

fn parse(text: &str) -> Result<Calibration, String> {
    if text.lines().next() != Some(FORMAT) {
        return Err(format!("not a calibration; expected '{FORMAT}' on the first line (written by `quadrig calibrate`)"));
    }
    let table: Table = text.parse().map_err(|e: toml::de::Error| e.message().to_owned())?;
    let mut out = Calibration::default();
    let section = |name: &str| table.get(name).and_then(Value::as_table);
    if let Some(gyro) = section("gyro") {
        out.gyro_offset = vector(gyro, "gyro", "offset_rad_s")?;
    }
    if let Some(accel) = section("accel") {
        (out.accel_offset, out.accel_matrix) = (vector(accel, "accel", "offset_m_s2")?, matrix(accel, "accel")?);
    }
    if let Some(mag) = section("mag") {
        (out.mag_offset, out.mag_matrix) = (vector(mag, "mag", "offset_ut")?, matrix(mag, "mag")?);
    }
    if let Some(align) = section("align") {
        out.mag_matrix = matrix(align, "align")? * out.mag_matrix;
    }
    Ok(out)
}

fn three(value: Option<&Value>) -> Option<[f32; 3]> {
    let numbers: Vec<f32> =
        value?.as_array()?.iter().filter_map(Value::as_float).map(|v| v as f32).filter(|v| v.is_finite()).collect();
    numbers.try_into().ok()
}

fn vector(section: &Table, name: &str, key: &str) -> Result<Vec3, String> {
    let found = three(section.get(key)).ok_or_else(|| format!("{name}.{key}: expected three finite numbers"))?;
    Ok(Vec3::from(found))
}

fn matrix(section: &Table, name: &str) -> Result<Mat3, String> {
    let rows = section.get("matrix").and_then(Value::as_array);
    let rows: Vec<[f32; 3]> = rows.into_iter().flatten().filter_map(|r| three(Some(r))).collect();
    let [a, b, c] = rows[..] else { return Err(format!("{name}.matrix: expected three rows of three finite numbers")) };
    Ok(Mat3::new(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_that_are_there_are_taken() {
        let text = format!(
            "{FORMAT}\n[gyro]\noffset_rad_s = [0.1, 0.2, -0.3]\n[align]\nmatrix = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]\n"
        );
        let found = parse(&text).unwrap();
        assert_eq!(found.gyro(&Vec3::new(0.1, 0.2, -0.3)), Vec3::zeros());
        assert_eq!(found.mag(&Vec3::new(0.0, 0.0, 1.0)), Vec3::new(0.0, -1.0, 0.0));
        assert_eq!(found.accel(&Vec3::x()), Vec3::x());
    }

    #[test]
    fn faults_name_section_and_key() {
        assert!(parse("[gyro]\n").unwrap_err().contains("on the first line"));
        for (body, wanted) in [
            ("[gyro]\n", "gyro.offset_rad_s: expected three finite numbers"),
            ("[gyro]\noffset_rad_s = [0.1, nan, 0.2]\n", "gyro.offset_rad_s"),
            ("[mag]\noffset_ut = [1.0, 2.0, 3.0]\nmatrix = [[1.0, 0.0, 0.0]]\n", "mag.matrix: expected three rows"),
        ] {
            let message = parse(&format!("{FORMAT}\n{body}")).unwrap_err();
            assert!(message.contains(wanted), "{message}");
        }
    }
}
