//! `quadrig ahrs`.
//!
//! What it is: the firmware's attitude filter over a recorded file.
//! What can go wrong: refused input gives one line with file, line and column; nothing is written then. Rows before the first
//! accelerometer reading have empty attitude fields.
//! Units: rad/s, m/s^2, uT in; degrees and a unit quaternion out.
//! Reference: specification `formats.md`, "Attitude log".

mod calibration;
pub(crate) mod imu_log;
mod number;
mod readable;
mod text;

use crate::Failure;
use crate::apart::Paths;
use crate::replace::put;
use dcm::calibration::Calibration;
use dcm::{Classic, ClassicConfig, Config, Dcm, Earth, Fresh, Mat3, Measurement, euler_of, quaternion_of};
use imu_log::{ImuLog, Row};
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// t_s,gx,gy,gz,ax,ay,az[,mx,my,mz], further columns ignored.
    input: PathBuf,
    /// t_s,qw,qx,qy,qz,roll_deg,pitch_deg,yaw_deg.
    output: PathBuf,
    /// Earth axes of the result.
    #[arg(long, value_enum, default_value_t = Axes::Ned)]
    earth: Axes,
    /// The filter: the board's, or the thesis' with tuned or Razor gains.
    #[arg(long, value_enum, default_value_t = Preset::Default)]
    preset: Preset,
    /// Corrects every reading first, with a file that `quadrig calibrate` wrote.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Magnetic declination, degrees, east positive.
    #[arg(long, default_value_t = 0.0, value_parser = crate::number::from(-180.0, 180.0, "degrees"))]
    declination: f64,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Axes {
    Ned,
    Enu,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Preset {
    Default,
    Classic,
    Razor,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads([&self.input]).reads(&self.calibration).writes("OUTPUT", [&self.output])
    }
}

/// Either filter.
enum Filter {
    Ours(Box<Dcm>),
    Classic(Classic),
}

impl Filter {
    fn new(preset: Preset, declination: f32) -> Self {
        let classic = |base| Self::Classic(Classic::new(ClassicConfig { declination, ..base }));
        match preset {
            Preset::Default => Self::Ours(Box::new(Dcm::new(Config { declination, ..Config::DEFAULT }))),
            Preset::Classic => classic(ClassicConfig::TUNED),
            Preset::Razor => classic(ClassicConfig::RAZOR),
        }
    }

    /// The attitude after a step, once there is one.
    fn step(&mut self, dt: f32, measured: &Measurement) -> Option<Mat3> {
        match self {
            Self::Ours(f) => {
                f.update(dt, measured);
                f.is_started().then(|| *f.matrix())
            }
            Self::Classic(f) => {
                f.update(dt, measured);
                f.is_started().then(|| *f.matrix())
            }
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let calibration = match &args.calibration {
        Some(path) => calibration::read(path)?,
        None => Calibration::default(),
    };
    let log = ImuLog::read(&args.input)?;
    let bar = crate::progress::Bar::new("attitude", quiet || log.rows.len() < 1_000_000);
    let earth = if args.earth == Axes::Enu { Earth::Enu } else { Earth::Ned };
    let mut filter = Filter::new(args.preset, (args.declination as f32).to_radians());
    let mut out = String::with_capacity(96 * log.rows.len() + 64);
    out.push_str("t_s,qw,qx,qy,qz,roll_deg,pitch_deg,yaw_deg\n");
    let (mut forces, mut fields) = (Fresh::default(), Fresh::default());
    for (n, (row, dt)) in log.steps().enumerate() {
        let (accel, mag) = (forces.take(dt, row.accel), fields.take(dt, row.mag));
        let measured = Measurement {
            gyro: row.gyro.map(|w| calibration.gyro(&w)),
            accel: accel.map(|f| calibration.accel(&f)),
            mag: mag.map(|m| calibration.mag(&m)),
        };
        let attitude = filter.step(dt, &measured);
        line(&mut out, log.time_text(n), attitude.map(|m| earth.from_ned(&m)));
        if n % 65_536 == 0 {
            bar.set(n as f64 / log.rows.len() as f64);
        }
    }
    put(&args.output, &out)?;
    if !quiet {
        let has = |name: &str, of: fn(&Row) -> bool| if log.rows.iter().any(of) { "" } else { name }.to_owned();
        let lacks = has(" without gyro", |r| r.gyro.is_some())
            + &has(" without accelerometer", |r| r.accel.is_some())
            + &has(" without magnetometer (heading relative)", |r| r.mag.is_some());
        say!("{} samples{lacks}, {}", log.rows.len(), args.output.display());
    }
    Ok(())
}

/// One row of an attitude log; empty fields where there is no attitude yet.
pub(crate) fn line(out: &mut String, time: &str, attitude: Option<Mat3>) {
    out.push_str(time);
    match attitude {
        None => out.push_str(",,,,,,,"),
        Some(matrix) => {
            let e = euler_of(&matrix);
            for q in quaternion_of(&matrix) {
                out.push(',');
                text::fixed::<8>(out, f64::from(q));
            }
            for angle in [e.roll, e.pitch, e.yaw] {
                out.push(',');
                // single precision's half turn lies a little beyond it
                text::fixed::<5>(out, f64::from(angle).to_degrees().clamp(-180.0, 180.0));
            }
        }
    }
    out.push('\n');
}
