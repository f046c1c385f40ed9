//! `quadrig imu`: says one user command to the IMU board and prints its answers.
//!
//! What it is: the words that a person types at the board (`docs/ahrs.md`, "At the board"), sent as a frame; a calibration that ends by
//! itself is followed to its end.
//! What can go wrong: words that are no command, a board that does not answer, a refusal: one line each, exit status 1.
//! Units: as the board prints them.
//! Reference: specification `ahrs.md`, "Board".

mod words;

use crate::Failure;
use crate::board::{Board, Heard};
use crate::port::PortArgs;
use firmware_ahrs::line;
use frame::message::SettingsNews;
use frame::{Command, Event, ImuCommand, ImuFormat, ImuReport, ImuSensor, Message};
use std::cell::RefCell;
use std::time::Duration;
use words::WORDS;

/// Speed of the IMU board's line (pin table of the board).
const BAUD: u32 = 460_800;
/// How long an answer may take: the longest waits for the erase of a flash sector.
const ANSWER: Duration = Duration::from_secs(5);

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    port: PortArgs,
    /// Longest calibration that is followed, s.
    #[arg(long, default_value_t = 300.0, value_parser = crate::number::positive(86_400.0, "seconds"))]
    patience: f64,
    #[arg(required = true, help = WORDS)]
    words: Vec<String>,
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let typed = args.words.join(" ").to_lowercase();
    let command = line::command(&typed).ok_or_else(|| {
        format!(
            "{typed:?} is no command of the IMU board; expected words that it knows: {} (`quadrig imu --help`)",
            words::known(&typed)
        )
    })?;
    let next =
        words::next(&command, args.port.is_virtual(), args.port.is_virtual() && args.port.flash.is_none()).filter(|_| !quiet);
    let mut board = Board::at(args.port.open(BAUD, true)?);
    let text_wanted = command == Command::Imu(ImuCommand::Format(ImuFormat::Text));
    if !text_wanted {
        // whatever mode it is in: its answers are to be frames; the answer to this is not waited for
        board.send(Command::Imu(ImuCommand::Format(ImuFormat::Binary)))?;
        listen(&mut board, ANSWER, |m| matches!(m, Message::Event(Event::Accepted)))?;
    }
    board.send(command)?;
    if text_wanted {
        next.iter().for_each(|next| note!("{next}"));
        return Ok(()); // it answers in text
    }
    let refusal = RefCell::new(None);
    let show = |message: &Message| {
        let sample = matches!(message, Message::Imu(_) | Message::ImuValues(_) | Message::TestAccel(_));
        if let (false, Some(line)) = (quiet || (sample && command != Command::Imu(ImuCommand::Once)), words::line(message)) {
            words::columns(message).iter().for_each(|columns| note!("{columns}"));
            crate::say::text(&line);
        }
        if matches!(message, Message::Event(Event::Accepted | Event::Settings(SettingsNews::Saved))) {
            next.iter().for_each(|next| note!("{next}"));
        }
        words::in_force(message).iter().filter(|_| !quiet).for_each(|told| note!("{told}"));
        if let Some(why) = words::refusal(&command, message) {
            refusal.replace(Some(why));
        }
    };
    let ended = listen(&mut board, ANSWER, |m| {
        show(m);
        answers(&command, m)
    })?;
    let follows = matches!(command, Command::Imu(ImuCommand::Calibrate(ImuSensor::Gyro | ImuSensor::Accel)));
    if follows && ended && refusal.borrow().is_none() {
        let patience = Duration::from_secs_f64(args.patience);
        let ended = hear(&mut board, patience, |m| {
            show(m);
            matches!(m, Message::ImuReport(ImuReport::Calibrated(_) | ImuReport::Refused { .. }))
        })?;
        if !ended {
            let expected = "expected it done within --patience: the board goes on, \"cancel\" gives it up";
            return Err(format!("\"{typed}\" has not ended in {} s; {expected}", args.patience).into());
        }
    }
    refusal.into_inner().map_or(Ok(()), |why| Err(why.into()))
}

/// Whether a message ends the answer to a command.
fn answers(command: &Command, message: &Message) -> bool {
    match (command, message) {
        (_, Message::Event(Event::Refused(_))) => true,
        (Command::Identify, m) => matches!(m, Message::Hello(_)),
        (Command::Imu(ImuCommand::Once), m) => matches!(m, Message::Imu(_) | Message::ImuValues(_)),
        (Command::Imu(ImuCommand::Save | ImuCommand::Load), m) => matches!(m, Message::Event(Event::Settings(_))),
        (Command::Imu(ImuCommand::Errors | ImuCommand::Finish), m) => matches!(m, Message::ImuReport(_)),
        (_, m) => matches!(m, Message::Event(Event::Accepted)),
    }
}

/// Hears messages until one is the last; silence is refused.
fn listen(board: &mut Board, patience: Duration, last: impl FnMut(&Message) -> bool) -> Result<bool, Failure> {
    match hear(board, patience, last)? {
        true => Ok(true),
        false => Err(format!(
            "no answer from the board; expected one in {} s: is it powered, and an IMU board?",
            patience.as_secs_f64()
        )
        .into()),
    }
}

/// Whether one of the messages of so long a time is the last.
fn hear(board: &mut Board, patience: Duration, mut last: impl FnMut(&Message) -> bool) -> Result<bool, Failure> {
    let until = board.now() + patience;
    while board.now() < until {
        match board.hear() {
            Heard::Gone => return Err(board.gone().into()),
            Heard::Messages(messages) => {
                if messages.iter().any(|received| last(&received.message)) {
                    return Ok(true);
                }
            }
        }
    }
    Ok(false)
}
