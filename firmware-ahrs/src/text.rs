//! Messages as lines of text, for a person at a terminal.
//!
//! What it is: one line for each message of the board. Samples: `raw` or `cal`, time in s, three rates, three forces, three fields
//! (words, or rad/s, m/s^2, uT; `-` where there is no new reading), roll, pitch and yaw in degrees.
//! What can go wrong: a line that does not fit is left out; a number too large for its digits rests at its end.
//! Units: said at each line.
//! Reference: specification `ahrs.md`, "Board": output mode text or binary.

use core::fmt::{self, Display, Formatter, Write};
use dcm::{Mat3, euler_of};
use frame::message::{ClockNews, CrashCause, SettingsNews};
use frame::{Event, ImuReport, ImuSensor, Message, Ticks};
use heapless::String;

/// Longest line, bytes.
pub const LINE: usize = 240;

/// A number with so many digits after the point. Formatting floats with the core library would cost 10 KB.
struct Number(f32, usize);

impl Display for Number {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self(value, digits) = *self;
        if value.is_nan() {
            return f.write_str("-");
        }
        let scale = (0..digits).fold(1u32, |scale, _| scale * 10);
        let n = (value.abs() * scale as f32 + 0.5) as u32;
        let sign = if value < 0.0 && n > 0 { "-" } else { "" };
        write!(f, "{sign}{}.{:0digits$}", n / scale, n % scale)
    }
}

/// Three of them.
struct Three<'a>(&'a [f32; 3], usize);

impl Display for Three<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.0.map(|v| Number(v, self.1));
        write!(f, "{x},{y},{z}")
    }
}

/// Three words, or a dash where they are old.
struct Words(Option<[i16; 3]>);

impl Display for Words {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some([x, y, z]) => write!(f, "{x},{y},{z}"),
            None => f.write_str("-,-,-"),
        }
    }
}

/// Seconds with three digits.
struct Seconds(Ticks);

impl Display for Seconds {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let ms = self.0.as_ms() as u32; // for 49 days
        write!(f, "{}.{:03}", ms / 1000, ms % 1000)
    }
}

/// Roll, pitch and yaw of a quaternion, degrees; dashes before the filter has started.
struct Angles([i32; 4]);

impl Display for Angles {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if self.0 == [0; 4] {
            return f.write_str("-,-,-");
        }
        let [w, x, y, z] = self.0.map(|q| q as f32 / 1_073_741_824.0);
        let m = Mat3::new(
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        );
        let e = euler_of(&m);
        Three(&[e.roll, e.pitch, e.yaw].map(f32::to_degrees), 2).fmt(f)
    }
}

/// The word for a sensor, as commands say it.
#[must_use]
pub fn name(sensor: ImuSensor) -> &'static str {
    match sensor {
        ImuSensor::Gyro => "gyro",
        ImuSensor::Accel => "accel",
        ImuSensor::Mag => "mag",
        ImuSensor::Alignment => "align",
    }
}

/// The line of a message, its end included; `None` for a message that this board does not send or that does not fit.
#[must_use]
pub fn line(message: &Message) -> Option<String<LINE>> {
    let mut out = String::new();
    write_line(&mut out, message).ok()?;
    out.push('\n').ok()?;
    Some(out)
}

fn write_line(out: &mut String<LINE>, message: &Message) -> fmt::Result {
    match message {
        Message::Hello(hello) => {
            let [major, minor, patch] = hello.firmware;
            write!(out, "imu board, firmware {major}.{minor}.{patch}, sensors")?;
            let names = ["gyro", "accel", "mag", "test"];
            names.iter().enumerate().filter(|(bit, _)| hello.present >> bit & 1 != 0).try_for_each(|(_, n)| write!(out, " {n}"))
        }
        Message::Imu(s) => {
            let of = |bit: u8, words| Words((s.fresh & bit != 0).then_some(words));
            let (gyro, accel, mag) = (of(crate::GYRO, s.gyro), of(crate::ACCEL, s.accel), of(crate::MAG, s.mag));
            write!(out, "raw,{},{gyro},{accel},{mag},{}", Seconds(s.at), Angles(s.quaternion_q30))
        }
        Message::ImuValues(v) => {
            let (gyro, accel, mag) = (Three(&v.gyro, 4), Three(&v.accel, 3), Three(&v.mag, 2));
            write!(out, "cal,{},{gyro},{accel},{mag},{}", Seconds(v.at), Angles(v.quaternion_q30))
        }
        Message::TestAccel(t) => write!(out, "test,{},{}", Seconds(t.at), Words(Some(t.words))),
        Message::Event(Event::Accepted) => out.write_str("ok"),
        Message::Event(Event::Refused(reasons)) => {
            out.write_str("refused:")?;
            reasons.words().try_for_each(|word| write!(out, " {word};"))
        }
        Message::Event(Event::Settings(news)) => out.write_str(match news {
            SettingsNews::Absent => "settings: none stored, as from the factory",
            SettingsNews::Loaded => "settings: loaded",
            SettingsNews::Damaged => "settings: stored ones are damaged or stale, as from the factory",
            SettingsNews::Saved => "settings: saved",
            SettingsNews::Failed => "settings: could not be saved",
        }),
        Message::Event(Event::Clock(clock)) => match clock {
            ClockNews { crystal_hz: 0, measured_hz: 0 } => {
                out.write_str("clock: internal oscillator, the crystal does not start")
            }
            ClockNews { crystal_hz: 0, measured_hz } => {
                write!(
                    out,
                    "clock: internal oscillator, the crystal of about {} kHz is none of the known ones",
                    measured_hz / 1000
                )
            }
            ClockNews { crystal_hz, .. } => write!(out, "clock: crystal of {} kHz", crystal_hz / 1000),
        },
        Message::Event(Event::Crashed(crash)) => {
            write!(out, "crashed before the reset: {} at {:08x}", cause(crash.cause), crash.pc)?;
            write!(out, ", called from {:08x}, status {:08x}", crash.lr, crash.status)
        }
        Message::Event(Event::Panicked { line, file }) => {
            let used = file.iter().position(|byte| *byte == 0).unwrap_or(file.len());
            let name = file.get(..used).and_then(|name| core::str::from_utf8(name).ok()).unwrap_or("?");
            write!(out, "panicked before the reset: {name}, line {line}")
        }
        Message::ImuReport(report) => write_report(out, report),
        _ => Err(fmt::Error),
    }
}

fn cause(cause: CrashCause) -> &'static str {
    match cause {
        CrashCause::HardFault => "hard fault",
        CrashCause::ClockFailed => "the crystal failed",
        CrashCause::NonMaskable => "non-maskable interrupt",
        CrashCause::Unexpected(_) => "unexpected interrupt",
    }
}

fn write_report(out: &mut String<LINE>, report: &ImuReport) -> fmt::Result {
    match report {
        ImuReport::Taken { sensor, index, count } => write!(out, "{}: taken {index}, {count} so far", name(*sensor)),
        ImuReport::Calibrated(c) => {
            write!(out, "{}: offset {} +- {}", name(c.sensor), Three(&c.offset, 5), Three(&c.sigma, 5))?;
            write!(out, ", gain {}, residual {}", Three(&c.gain, 4), Number(c.residual, 5))?;
            write!(out, ", coverage {}, readings {}", Number(c.coverage, 2), c.readings)
        }
        ImuReport::Refused { sensor, why } => {
            use frame::ImuRefusal as R;
            write!(out, "{}: refused, ", name(*sensor))?;
            match why {
                R::TooFew { found, needed } => write!(out, "{found} readings, {needed} are needed"),
                R::Moving { scatter } => write!(out, "it moves, scatter {} rad/s", Number(*scatter, 4)),
                R::Coverage { found } => write!(out, "coverage {}: turn it into every direction", Number(*found, 2)),
                R::Position { index } => write!(out, "no rest in position {index} of +x -x +y -y +z -z up, from 0"),
                R::NoFit => out.write_str("no fit"),
            }
        }
        ImuReport::Errors(e) => {
            let ([g, a, m, t], [sg, sa, sm], [low, high]) = (e.lost, e.saturated, e.tick_span);
            write!(out, "errors: alive {}, lost {g},{a},{m},{t}, saturated {sg},{sa},{sm}, stuck {}", e.alive, e.stuck)?;
            write!(out, ", unusable {}", e.unusable)?;
            write!(out, ", damaged {}, unknown {}, tick span {low},{high}, tick cycles {}", e.damaged, e.unknown, e.tick_cycles)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use frame::{ImuErrors, ImuSample, ImuValues};
    extern crate std;
    use std::string::ToString;

    #[test]
    fn numbers_have_their_digits_and_their_sign() {
        let text = [(1.0, 3), (-0.0004, 3), (-0.0006, 3), (12.3456, 2), (f32::NAN, 2), (-7.0, 1), (1e20, 2)];
        let text = text.map(|(v, d)| Number(v, d).to_string());
        assert_eq!(text, ["1.000", "0.000", "-0.001", "12.35", "-", "-7.0", "42949672.95"]);
    }

    #[test]
    fn a_sample_is_one_line() {
        let half = (0.5f32.sqrt() * 1_073_741_824.0) as i32;
        let sample = ImuSample {
            at: Ticks::from_ms(12_034),
            gyro: [1, -2, 3],
            accel: [0, 0, -256],
            fresh: 3,
            quaternion_q30: [half, 0, 0, half],
            ..ImuSample::default()
        };
        assert_eq!(line(&Message::Imu(sample)).unwrap(), "raw,12.034,1,-2,3,0,0,-256,-,-,-,0.00,0.00,90.00\n");
        let values = ImuValues { gyro: [0.1, 0.0, -0.25], accel: [f32::NAN; 3], mag: [20.0, 0.0, 43.5], ..ImuValues::default() };
        let wanted = "cal,0.000,0.1000,0.0000,-0.2500,-,-,-,20.00,0.00,43.50,-,-,-\n";
        assert_eq!(line(&Message::ImuValues(values)).unwrap(), wanted);
    }

    #[test]
    fn what_the_board_found_at_its_start_is_told_in_words() {
        let told = |event| line(&Message::Event(event)).unwrap();
        let clock = |crystal_hz, measured_hz| told(Event::Clock(ClockNews { crystal_hz, measured_hz }));
        assert_eq!(clock(12_000_000, 11_900_000), "clock: crystal of 12000 kHz\n");
        assert_eq!(clock(0, 0), "clock: internal oscillator, the crystal does not start\n");
        assert!(clock(0, 16_100_000).contains("about 16100 kHz"));
        let crash = frame::message::Crash { cause: CrashCause::ClockFailed, pc: 0x0800_1234, lr: 0x0800_4321, status: 0 };
        let words = "crashed before the reset: the crystal failed at 08001234, called from 08004321, status 00000000\n";
        assert_eq!(told(Event::Crashed(crash)), words);
        let mut file = [0; 24];
        file[..11].copy_from_slice(b"src/main.rs");
        assert_eq!(told(Event::Panicked { line: 9, file }), "panicked before the reset: src/main.rs, line 9\n");
    }

    #[test]
    fn the_longest_lines_fit() {
        let errors = ImuErrors {
            alive: 255,
            lost: [u16::MAX; 4],
            saturated: [u16::MAX; 3],
            stuck: 7,
            unusable: u16::MAX,
            damaged: u16::MAX,
            unknown: u16::MAX,
            tick_span: [u32::MAX; 2],
            tick_cycles: u32::MAX,
        };
        assert!(line(&Message::ImuReport(ImuReport::Errors(errors))).is_some());
        let all = frame::ImuCalibrated {
            sensor: ImuSensor::Alignment,
            offset: [-1000.0; 3],
            sigma: [1000.0; 3],
            gain: [-100.0; 3],
            residual: 1000.0,
            coverage: 1.0,
            readings: u16::MAX,
        };
        assert!(line(&Message::ImuReport(ImuReport::Calibrated(all))).is_some());
        assert!(line(&Message::Event(Event::Refused(frame::Refusals(u16::MAX)))).is_none_or(|l| l.len() <= LINE));
        assert_eq!(line(&Message::Health(frame::message::Health::default())), None);
    }

    /// Roll, pitch and yaw that a raw line ends with.
    fn told(e: &dcm::Euler) -> [f32; 3] {
        let q = dcm::quaternion_of(&dcm::matrix_of(e)).map(|q| (q * 1_073_741_824.0) as i32);
        let line = line(&Message::Imu(ImuSample { quaternion_q30: q, ..ImuSample::default() })).unwrap();
        let mut last = line.trim().rsplit(',').map(|word| word.parse().unwrap());
        let [yaw, pitch, roll] = [(); 3].map(|()| last.next().unwrap());
        [roll, pitch, yaw]
    }

    #[test]
    fn the_angles_of_a_line_are_those_of_the_attitude() {
        for [roll, pitch, yaw] in [[10.0, 20.0, 30.0], [-100.0, -50.0, 170.0], [75.0, 5.0, -120.0], [-20.0, 70.0, 0.0]] {
            let found =
                told(&dcm::Euler { roll: f32::to_radians(roll), pitch: f32::to_radians(pitch), yaw: f32::to_radians(yaw) });
            let known = [roll, pitch, yaw];
            assert!(found.iter().zip(known).all(|(a, b)| (a - b).abs() < 0.02), "{found:?} {known:?}");
        }
        // at the pole roll is none of its own: yaw less roll, or both together
        for (pitch, yaw) in [(90.0f32, 20.0), (-90.0, 60.0)] {
            let found = told(&dcm::Euler { roll: 20f32.to_radians(), pitch: pitch.to_radians(), yaw: 40f32.to_radians() });
            assert!(found[0] == 0.0 && (found[1] - pitch).abs() < 0.05 && (found[2] - yaw).abs() < 0.05, "{found:?}");
        }
    }

    #[test]
    fn answers_are_told_in_words() {
        let hello = frame::Hello { present: 0b1010, firmware: [1, 2, 3], ..crate::Ahrs::hello(168_000_000, 0, 0) };
        assert_eq!(line(&Message::Hello(hello)).unwrap(), "imu board, firmware 1.2.3, sensors accel test\n");
        let test = frame::TestAccel { at: Ticks::from_ms(2_005), words: [1, -2, 3] };
        assert_eq!(line(&Message::TestAccel(test)).unwrap(), "test,2.005,1,-2,3\n");
        assert_eq!(line(&Message::Event(Event::Accepted)).unwrap(), "ok\n");
        let refused = line(&Message::Event(Event::Refused(frame::Refusals(frame::Refusals::WRONG_STATE)))).unwrap();
        assert!(refused.starts_with("refused: ") && refused.ends_with(";\n"), "{refused}");
        assert_eq!(line(&Message::Event(Event::Settings(SettingsNews::Saved))).unwrap(), "settings: saved\n");
        for (sensor, name) in
            [(ImuSensor::Gyro, "gyro"), (ImuSensor::Accel, "accel"), (ImuSensor::Mag, "mag"), (ImuSensor::Alignment, "align")]
        {
            let report = ImuReport::Taken { sensor, index: 2, count: 3 };
            assert_eq!(line(&Message::ImuReport(report)).unwrap().as_str(), std::format!("{name}: taken 2, 3 so far\n"));
        }
    }
}
