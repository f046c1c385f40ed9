//! `quadrig calibrate`.
//!
//! What it is: the IMU board's sensors from a recording ([`imu`]); the rig board's analogue channels from known values, in a recording
//! ([`recording`]) or live over the line, step by step ([`guided`]), or in the terminal view ([`scaling`]). A rig's scale is a straight line with its standard errors and residuals.
//! What can go wrong: a point that is saturated, or has not settled, is refused; so is a line that is far from the channel's design. Nothing
//! is stored or written then.
//! Units: as stated on each sensor.
//! Reference: specification `ahrs.md`, "Calibration"; `rig.md`, "Partial rigs are normal"; Beharie 2013, Eq. 5.34-5.36 with the errata.

mod channel;
mod found;
mod guided;
mod imu;
mod line;
mod point;
mod recording;
pub(crate) mod scaling;
mod settle;
mod settling;

use crate::Failure;
use crate::apart::Paths;
use crate::port::PortArgs;
use crate::rig::date;
use channel::Channel;
use clap::error::ErrorKind;
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Sensors of the IMU board, or one channel of the rig board.
    #[arg(value_enum, required = true, num_args = 1..)]
    what: Vec<What>,
    /// The recording: of the IMU board `t_s,gx,gy,gz,ax,ay,az[,mx,my,mz]`, of the rig a log (best with --raw).
    #[arg(short, long)]
    input: Option<PathBuf>,
    /// Where the calibration goes (TOML).
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// The rig board: calibrate live, or store there what a recording gave.
    #[command(flatten)]
    port: PortArgs,
    /// Known values of a rig's channel in order: `0 g, 200 g, 500 g`; of a recording with or without the time of each, `200 g@12..18`.
    #[arg(long)]
    points: Option<String>,
    /// Arm at which masses for the torque hang, m; the configured arm without it.
    #[arg(long, value_parser = crate::number::positive(10.0, "m"))]
    arm: Option<f64>,
    /// Day of the calibration; today without it.
    #[arg(long, value_name = "YYYY-MM-DD")]
    date: Option<String>,
    /// Store without asking.
    #[arg(long)]
    yes: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum What {
    /// IMU: zero from the stretches of rest.
    Gyro,
    /// IMU: offset and gain from rest with each axis up and down.
    Accel,
    /// IMU: hard and soft iron from readings in all directions.
    Mag,
    /// IMU: magnetometer axes from rest in many attitudes; needs `mag` too, or readings without iron.
    Align,
    /// Rig: thrust by masses on the load cell.
    #[value(alias = "thrust")]
    Loadcell,
    /// Rig: torque by masses on the arm.
    Torque,
    /// Rig: current by two points or more against a meter.
    Current,
    /// Rig: supply voltage by two points or more against a meter.
    Voltage,
    /// Rig: temperature by two points or more against a thermometer.
    Temperature,
}

impl What {
    fn sensor(self) -> Option<imu::Sensor> {
        match self {
            Self::Gyro => Some(imu::Sensor::Gyro),
            Self::Accel => Some(imu::Sensor::Accel),
            Self::Mag => Some(imu::Sensor::Mag),
            Self::Align => Some(imu::Sensor::Align),
            _ => None,
        }
    }

    fn channel(self) -> Option<Channel> {
        match self {
            Self::Loadcell => Some(Channel::Thrust),
            Self::Torque => Some(Channel::Torque),
            Self::Current => Some(Channel::Current),
            Self::Voltage => Some(Channel::Voltage),
            Self::Temperature => Some(Channel::Temperature),
            _ => None,
        }
    }
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        self.port.paths(Paths::default()).reads(&self.input).writes("-o", &self.output)
    }
}

/// The command line is not one that means something.
fn usage(words: &str) -> ! {
    clap::Error::raw(ErrorKind::MissingRequiredArgument, format!("{words}\n")).exit()
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let sensors: Vec<imu::Sensor> = args.what.iter().filter_map(|what| what.sensor()).collect();
    let channels: Vec<Channel> = args.what.iter().filter_map(|what| what.channel()).collect();
    match (sensors.as_slice(), channels.as_slice()) {
        (sensors, []) => match (&args.input, &args.output) {
            (Some(input), Some(output)) => imu::run(sensors, input, output, quiet),
            _ => usage("the IMU board's sensors need -i RECORDING and -o FILE"),
        },
        ([], [channel]) => {
            let day = day(args.date.as_deref())?;
            match (&args.input, args.port.is_given(), &args.points) {
                (Some(input), _, Some(points)) => recording::run(*channel, input, points, day, args, quiet),
                (Some(_), _, None) => usage("a recording needs --points, such as \"0 g, 200 g, 500 g\""),
                (None, true, points) => guided::run(*channel, points.as_deref(), day, args, quiet),
                (None, false, _) => usage("a rig's channel needs -i RECORDING, or --port of the board"),
            }
        }
        _ => usage("one channel of the rig board at a time, and no sensor of the IMU board with it"),
    }
}

/// The day that is said, or today's by the clock.
fn day(said: Option<&str>) -> Result<u16, Failure> {
    match said {
        Some(text) => date::day(text).ok_or_else(|| format!("--date {text}: expected a date as 2026-01-31").into()),
        None => Ok(date::today()),
    }
}
