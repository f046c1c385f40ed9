//! What the IMU board answers, for a person at a terminal.
//!
//! What it is: the board's own lines, but for those that are short because a board has little room: each refusal with what to do, positions and
//! counts with their names, and what comes next.
//! What can go wrong: nothing; a message without words of its own is told in the board's.
//! Units: said at each line.
//! Reference: docs/ahrs.md, "At the board".

use firmware_ahrs::text::{self, name};
use frame::{Command, Event, ImuCommand, ImuErrors, ImuFormat, ImuRefusal, ImuReport, ImuSensor, Message};

/// Ticks of the board's timer in a millisecond.
const TICKS_PER_MS: f64 = 84_000.0;
/// Positions of the accelerometer's calibration.
const POSITIONS: [&str; 6] = ["+x up", "-x up", "+y up", "-y up", "+z up", "-z up"];
/// Sensors, by their bits.
const SENSORS: [&str; 4] = ["gyro", "accel", "mag", "test accel"];

/// What the board understands.
pub(super) const WORDS: &str = "identify; format text|binary; send raw|calibrated|both; stream on|off; once; calibrate gyro|accel|mag|align; finish; cancel; save; load; reset; errors";

/// What stands in the place of words that are no command: all that begins alike, or everything.
pub(super) fn known(typed: &str) -> String {
    let first = typed.split_whitespace().next().unwrap_or_default();
    WORDS
        .split("; ")
        .find(|w| w.split(' ').next() == Some(first))
        .map_or_else(|| WORDS.to_owned(), |alike| format!("\"{alike}\""))
}

fn position(index: u8) -> String {
    POSITIONS.get(usize::from(index)).map_or_else(|| format!("number {index}"), |name| (*name).to_owned())
}

/// The line of a message; nothing for a refusal, which is told once, at the end.
pub(super) fn line(message: &Message) -> Option<String> {
    match message {
        Message::Event(Event::Refused(_)) | Message::ImuReport(ImuReport::Refused { .. }) => None,
        Message::ImuReport(ImuReport::Taken { sensor: ImuSensor::Accel, index, count }) => {
            Some(format!("accel: {} taken, {count} of {} positions\n", position(*index), POSITIONS.len()))
        }
        Message::ImuReport(ImuReport::Taken { sensor, count, .. }) => {
            Some(format!("{}: {count} attitudes taken\n", name(*sensor)))
        }
        Message::ImuReport(ImuReport::Errors(e)) => Some(errors(e)),
        other => text::line(other).map(|line| line.to_string()),
    }
}

/// Columns of a sample; nothing for what is none.
pub(super) fn columns(message: &Message) -> Option<&'static str> {
    match message {
        Message::Imu(_) => Some("raw: time s; gyro, accel, mag x y z as read, - without a new reading; roll, pitch, yaw deg"),
        Message::ImuValues(_) => {
            Some("cal: time s; gyro rad/s, accel m/s^2, mag uT x y z, - without a new reading; roll, pitch, yaw deg")
        }
        _ => None,
    }
}

fn errors(e: &ImuErrors) -> String {
    let listed = |bits: u8| {
        let names: Vec<&str> =
            SENSORS.iter().enumerate().filter(|(bit, _)| bits >> bit & 1 != 0).map(|(_, name)| *name).collect();
        if names.is_empty() { "none".to_owned() } else { names.join(", ") }
    };
    let counted = |counts: &[u16]| {
        let each: Vec<String> = SENSORS.iter().zip(counts).map(|(name, n)| format!("{name} {n}")).collect();
        each.join(", ")
    };
    let [low, high] = e.tick_span.map(|ticks| f64::from(ticks) / TICKS_PER_MS);
    let rows = [
        ("sensors alive", listed(e.alive)),
        ("failed reads", counted(&e.lost)),
        ("at an end of the range", counted(&e.saturated)),
        ("stuck at one reading", listed(e.stuck)),
        ("unusable for the filter", e.unusable.to_string()),
        ("damaged frames heard", e.damaged.to_string()),
        ("lines that are no command", e.unknown.to_string()),
        ("time between ticks, ms", format!("{low:.4} to {high:.4}")),
        ("longest tick, core cycles", e.tick_cycles.to_string()),
    ];
    rows.iter().map(|(what, told)| format!("{what:<27}{told}\n")).collect()
}

/// What a refusal means for what was asked, and what to do.
pub(super) fn refusal(command: &Command, message: &Message) -> Option<String> {
    match message {
        Message::Event(Event::Refused(reasons)) => Some(match command {
            Command::Imu(ImuCommand::Finish) => "the board refuses: it collects nothing that could be finished, or computes still; expected \"calibrate mag\" or \"calibrate align\" before \"finish\" (gyro and accel end by themselves)".to_owned(),
            Command::Imu(ImuCommand::Calibrate(_) | ImuCommand::Save | ImuCommand::Load) => "the board refuses: it is busy with a calibration or with its flash; expected it idle: say it again in some seconds".to_owned(),
            _ => format!("the board refuses: {}; expected an IMU board: \"identify\" says what it is", reasons.words().collect::<Vec<_>>().join("; ")),
        }),
        Message::ImuReport(ImuReport::Refused { sensor, why }) => Some(format!("the board refuses {}: {}", name(*sensor), refused(*sensor, why))),
        _ => None,
    }
}

fn refused(sensor: ImuSensor, why: &ImuRefusal) -> String {
    let again = format!("say \"calibrate {}\" again", name(sensor));
    match why {
        ImuRefusal::TooFew { found, needed } if sensor == ImuSensor::Alignment => {
            format!("it rested in {found} attitudes; expected {needed} or more, a second of rest in each: {again}")
        }
        ImuRefusal::TooFew { found, needed } => {
            format!("{found} readings; expected {needed} or more: {again}, and wait longer before \"finish\"")
        }
        ImuRefusal::Moving { scatter } => {
            format!("it moves, its rate scatters by {scatter:.4} rad/s; expected it at rest: put it down, {again}")
        }
        ImuRefusal::Coverage { found } => {
            format!(
                "it saw {:.0} % of the directions; expected all of them: {again}, and turn it further",
                100.0 * found.clamp(0.0, 1.0)
            )
        }
        ImuRefusal::Position { index } => {
            format!("no rest was seen with {}; expected rest in each of {}: {again}", position(*index), POSITIONS.join(", "))
        }
        ImuRefusal::NoFit => format!("its readings determine nothing; expected other attitudes for each of them: {again}"),
    }
}

/// What holds of a calibration from now on.
pub(super) fn in_force(message: &Message) -> Option<String> {
    let Message::ImuReport(ImuReport::Calibrated(c)) = message else { return None };
    let unit = match c.sensor {
        ImuSensor::Gyro => "rad/s",
        ImuSensor::Accel => "m/s^2",
        ImuSensor::Mag => "uT",
        ImuSensor::Alignment => "rad",
    };
    Some(format!("offset and residual in {unit}; it is in force now, \"save\" keeps it over a reset"))
}

/// What a person does next, where an answer does not say it. `virtual_one`: the board ends with this call, and `forgets`: so does its flash.
pub(super) fn next(command: &Command, virtual_one: bool, forgets: bool) -> Option<String> {
    let turned = |how: &str| match virtual_one {
        true => {
            format!("{how}, then \"finish\"; but this virtual board ends with this call: `quadrig virtual` runs one that stays")
        }
        false => format!("{how}, then say \"finish\""),
    };
    match command {
        Command::Imu(ImuCommand::Calibrate(ImuSensor::Accel)) => {
            Some(format!("rest it for a second in each position, in any order: {}", POSITIONS.join(", ")))
        }
        Command::Imu(ImuCommand::Calibrate(ImuSensor::Gyro)) => Some("leave it at rest".to_owned()),
        Command::Imu(ImuCommand::Calibrate(ImuSensor::Mag)) => Some(turned("turn it into every direction")),
        Command::Imu(ImuCommand::Calibrate(ImuSensor::Alignment)) => Some(turned("rest it in eight attitudes or more")),
        Command::Imu(ImuCommand::Save) => {
            forgets.then(|| "a virtual board forgets it when this call ends: --flash FILE keeps it".to_owned())
        }
        Command::Imu(ImuCommand::Stream(true)) => {
            Some("it sends 200 samples a second; this command shows none of them".to_owned())
        }
        Command::Imu(ImuCommand::Format(ImuFormat::Text)) => {
            Some("sent; the board answers in text from now on, which this command does not read".to_owned())
        }
        Command::Imu(ImuCommand::Factory) => Some("the stored settings stay until \"save\"".to_owned()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use esc_pwm::Refusals;

    /// Each refusal says what was expected and names the command that helps, once.
    #[test]
    fn a_refusal_says_what_to_do() {
        let wrong = Message::Event(Event::Refused(Refusals(Refusals::WRONG_STATE)));
        let of = |asked: ImuCommand| refusal(&Command::Imu(asked), &wrong).expect("a refusal");
        assert!(of(ImuCommand::Finish).contains("\"calibrate mag\" or \"calibrate align\" before \"finish\""));
        assert!(of(ImuCommand::Save).contains("say it again in some seconds"));
        let sensors = [ImuSensor::Gyro, ImuSensor::Accel, ImuSensor::Mag, ImuSensor::Alignment];
        let reasons = [
            ImuRefusal::TooFew { found: 3, needed: 800 },
            ImuRefusal::Moving { scatter: 0.2 },
            ImuRefusal::Coverage { found: 0.4 },
            ImuRefusal::Position { index: 3 },
            ImuRefusal::NoFit,
        ];
        for (sensor, why) in sensors.iter().flat_map(|s| reasons.map(|why| (*s, why))) {
            let message = Message::ImuReport(ImuReport::Refused { sensor, why });
            let said = refusal(&Command::Imu(ImuCommand::Finish), &message).expect("a refusal");
            let again = format!("\"calibrate {}\" again", name(sensor));
            assert!(said.contains("expected ") && said.contains(&again) && line(&message).is_none(), "{said}");
        }
        let missing = refused(ImuSensor::Accel, &ImuRefusal::Position { index: 3 });
        assert!(missing.contains("no rest was seen with -y up"), "{missing}");
        assert!(line(&wrong).is_none() && refusal(&Command::Ping, &Message::Event(Event::Accepted)).is_none());
    }

    #[test]
    fn counts_have_their_names() {
        let e = ImuErrors { alive: 5, lost: [1, 0, 2, 0], stuck: 0, tick_span: [420_000, 462_000], ..ImuErrors::default() };
        let said = line(&Message::ImuReport(ImuReport::Errors(e))).expect("lines");
        for told in [
            "alive              gyro, mag\n",
            "gyro 1, accel 0, mag 2, test accel 0\n",
            "5.0000 to 5.5000\n",
            "reading       none\n",
        ] {
            assert!(said.contains(told), "{told}: {said}");
        }
        let taken = Message::ImuReport(ImuReport::Taken { sensor: ImuSensor::Accel, index: 5, count: 1 });
        assert_eq!(line(&taken).as_deref(), Some("accel: -z up taken, 1 of 6 positions\n"));
    }

    #[test]
    fn words_that_are_no_command_are_told_their_likes() {
        assert_eq!(known("calibrate foo"), "\"calibrate gyro|accel|mag|align\"");
        assert_eq!(known("dance"), WORDS);
    }
}
