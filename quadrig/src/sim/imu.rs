//! `quadrig sim` of the IMU board.
//!
//! What it is: the portable firmware on a moving body; its telemetry, decoded, becomes an attitude log, on request with the true attitude in
//! a side file and the sensors' readings in a third, which `quadrig ahrs` and `quadrig calibrate` read.
//! What can go wrong: no sensor answers, so that there is nothing to log; then nothing is written.
//! Units: s since power-up of the board; a unit quaternion and degrees; rad/s, m/s^2, uT.
//! Reference: docs/scenario.md, "The IMU board"; specification `formats.md`, "Attitude log".

use super::Args;
use crate::Failure;
use crate::ahrs;
use crate::progress::Bar;
use crate::replace::put;
use dcm::{Mat3, STANDARD_GRAVITY};
use firmware_ahrs::{ACCEL, GYRO, GyroReading, MAG, chips};
use frame::ImuSample;
use hal_sim::imu::Motion;
use hal_sim::native::ahrs::fly;
use hal_sim::scenario::ImuScenario;
use imu_sensors::{adxl345, itg3200};
use std::fmt::Write;

const HEADER: &str = "t_s,qw,qx,qy,qz,roll_deg,pitch_deg,yaw_deg";
/// 2^30, the scale of the quaternion on the wire.
const Q30: f64 = 1_073_741_824.0;
/// Microtesla in a gauss.
const UT_PER_GAUSS: f32 = 100.0;

/// Runs the board and writes what was asked for.
pub(super) fn run(args: &Args, scenario: &ImuScenario, quiet: bool) -> Result<(), Failure> {
    let of_the_rig = [("--model", args.model.is_some()), ("--pins", args.pins.is_some()), ("--replay", args.replay.is_some())];
    for (flag, given) in of_the_rig.into_iter().chain([("--live", args.live)]) {
        if given {
            return Err(format!(
                "{}: describes the IMU board; expected a scenario of the rig with {flag}",
                args.scenario.display()
            )
            .into());
        }
    }
    let rig = scenario.rig();
    let bar = Bar::new("flying", quiet || scenario.milliseconds() < 60_000);
    let run = fly(&rig, scenario.milliseconds(), &mut |share| bar.set(share)).map_err(|_| "a message did not fit its frame")?;
    drop(bar);
    if run.samples.is_empty() {
        return Err("no sensor of the board answered; no log was written; expected one sensor at least without a fault".into());
    }
    if let Some(path) = &args.truth {
        put(path, &truth(&run.samples, &rig.motion))?;
    }
    if let Some(path) = &args.readings {
        put(path, &readings(&run.samples))?;
    }
    put(&args.output, &attitudes(&run.samples))?;
    if !quiet {
        let last = run.samples.last().map_or(0.0, |s| s.at.as_s());
        say!("{}: {} samples over {last:.1} s", args.output.display(), run.samples.len());
    }
    Ok(())
}

fn time(sample: &ImuSample) -> String {
    format!("{:.6}", sample.at.as_s())
}

/// The attitude that the board sent; empty fields before its filter has started.
fn attitudes(samples: &[ImuSample]) -> String {
    let mut out = format!("{HEADER}\n");
    for sample in samples {
        let quaternion = sample.quaternion_q30.map(|q| f64::from(q) / Q30);
        let started = quaternion.iter().any(|q| *q != 0.0);
        ahrs::line(&mut out, &time(sample), started.then(|| matrix(quaternion)));
    }
    out
}

/// Rotation of a quaternion, body to earth (Diebel 2006, Eq. 125).
fn matrix([w, x, y, z]: [f64; 4]) -> Mat3 {
    let rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ];
    single(rows)
}

fn single(rows: [[f64; 3]; 3]) -> Mat3 {
    let [[a, b, c], [d, e, f], [g, h, i]] = rows.map(|row| row.map(|x| x as f32));
    Mat3::new(a, b, c, d, e, f, g, h, i)
}

/// The true attitude at the instants of the samples.
fn truth(samples: &[ImuSample], motion: &Motion) -> String {
    let mut out = format!("{HEADER}\n");
    for sample in samples {
        let at_ns = sample.at.0 * 1000 / 84;
        ahrs::line(&mut out, &time(sample), Some(single(motion.attitude(at_ns))));
    }
    out
}

/// What the sensors gave, nominally scaled, body axes; a field is empty where a sensor gave nothing new.
fn readings(samples: &[ImuSample]) -> String {
    let mut out = String::from("t_s,gx,gy,gz,ax,ay,az,mx,my,mz,temp_c\n");
    for sample in samples {
        out.push_str(&time(sample));
        let sensors = [
            (GYRO, sample.gyro, (1.0 / itg3200::LSB_PER_DEG_S).to_radians()),
            (ACCEL, sample.accel, STANDARD_GRAVITY / adxl345::LSB_PER_G),
            (MAG, sample.mag, UT_PER_GAUSS / chips::MAG.range.lsb_per_gauss()),
        ];
        for (bit, words, unit) in sensors {
            for word in words {
                out.push(',');
                if sample.fresh & bit != 0 {
                    let _ = write!(out, "{:.6}", f32::from(word) * unit); // a string takes everything
                }
            }
        }
        out.push(',');
        if sample.fresh & GYRO != 0 {
            let _ = write!(out, "{:.3}", GyroReading { temperature: sample.temperature, rate: sample.gyro }.celsius());
        }
        out.push('\n');
    }
    out
}
