//! `quadrig log`: records from the rig board.
//!
//! What it is: samples become rows of a rig log as they arrive ([`Recorder`]); on a terminal, a live line.
//! What can go wrong: damaged frames are counted and cost themselves alone; an unplugged port is waited for, and what arrived stays; a
//! full disk is handled by [`crate::spool`]; a board that sends no calibration is refused, because raw codes alone are no log.
//! Units: as in the log.
//! Reference: specification `formats.md`, "Rig log" and "Command line".

mod columns;
mod inquiry;
mod recorder;

pub(crate) use recorder::Recorder;

use crate::Failure;
use crate::board::{Board, Heard};
use crate::end::Ended;
use crate::port::PortArgs;
use frame::message::Command;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::mpsc::TryRecvError;
use std::time::{Duration, Instant};

/// How long the board may take to say who it is.
const CALIBRATION_TIME: Duration = Duration::from_secs(3);
/// Time between two questions for it.
const ASK_AGAIN: Duration = Duration::from_millis(500);

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    port: PortArgs,
    /// Log to write.
    #[arg(short, long)]
    output: PathBuf,
    /// Stop after so many seconds of the board's time; without it, record until the port is gone or Ctrl-D or Ctrl-C is typed.
    #[arg(long)]
    seconds: Option<f64>,
    /// How long an unplugged port is waited for, s.
    #[arg(long, default_value_t = 5.0)]
    wait: f64,
    #[command(flatten)]
    rig: Rig,
}

/// What only the operator knows of a rig, and how much of it is recorded.
#[derive(clap::Args, Debug, Clone, Default)]
pub(crate) struct Rig {
    /// Motor, for the log's head.
    #[arg(long)]
    motor: Option<String>,
    /// Propeller, for the log's head.
    #[arg(long)]
    propeller: Option<String>,
    /// Record the raw codes as well (columns `raw_*`), so that a better calibration can be replayed with `quadrig recalibrate`.
    #[arg(long)]
    raw: bool,
}

impl Rig {
    /// A recorder into `target`; `more` joins the head of the log.
    pub(crate) fn recorder(&self, target: &std::path::Path, more: &[(&str, String)], quiet: bool) -> Result<Recorder, Failure> {
        let named = [("motor", &self.motor), ("propeller", &self.propeller)];
        let own = named.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value.clone()?)));
        let head = own.chain(more.iter().map(|(key, value)| ((*key).to_owned(), value.clone())));
        Recorder::new(target, head.map(|(key, value)| (key, toml::Value::String(value))).collect(), self.raw, quiet)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let mut board = Board::open(&args.port)?;
    let mut recorder = args.rig.recorder(&args.output, &[], quiet)?;
    let signals = Ended::watch()?;
    let begun = board.now();
    let mut asked: Option<Duration> = None;
    let end = std::io::stdin().is_terminal().then(crate::rig::lines);
    let ended = loop {
        if !recorder.knows_its_board() && asked.is_none_or(|at| board.now() > at + ASK_AGAIN) {
            let _ = board.send(Command::Identify); // a port that is gone shows in the next read
            asked = Some(board.now());
        }
        if let Some(question) = recorder.question(board.now()) {
            let _ = board.send(question);
        }
        match board.hear() {
            Heard::Messages(messages) => messages.iter().for_each(|m| recorder.take(&m.message)),
            Heard::Gone => {
                let gone = Instant::now();
                let mut back = false;
                while !back && gone.elapsed().as_secs_f64() < args.wait {
                    std::thread::sleep(Duration::from_millis(50));
                    back = board.reopen();
                }
                if !back {
                    break Err(board.gone());
                }
                let _ = board.send(Command::Identify); // the board may be another one, or tared anew
            }
        }
        if !recorder.knows_its_board() && board.now() > begun + CALIBRATION_TIME {
            recorder.discard();
            let cause = match board.stats().foreign {
                0 => "is it a rig board at 2000000 baud?",
                _ => "its frames are of another version than this program's: flash the board with the image of the same release",
            };
            return Err(format!("{}: no calibration from the board; {cause}", board.name()).into());
        }
        let enough = args.seconds.is_some_and(|s| recorder.seconds() >= s);
        let typed_end = end.as_ref().is_some_and(|end| matches!(end.try_recv(), Err(TryRecvError::Disconnected)));
        if enough || typed_end || signals.now() {
            break Ok(());
        }
    };
    let rows = recorder.rows;
    recorder.finish(&board, quiet)?;
    ended.map_err(|e| format!("{e}; the {rows} rows that arrived are in {}", args.output.display()).into())
}
