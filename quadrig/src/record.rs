//! `quadrig log`: records from the rig board.
//!
//! What it is: samples become rows of a rig log as they arrive ([`Recorder`]); on a terminal, in the view.
//! What can go wrong: damaged frames are counted and cost themselves alone; an unplugged port is waited for, and what arrived stays; a
//! full disk is handled by [`crate::spool`]; a board that sends no calibration is refused, because raw codes alone are no log.
//! Units: as in the log.
//! Reference: specification `formats.md`, "Rig log" and "Command line".

mod columns;
mod inquiry;
mod recorder;

pub(crate) use recorder::Recorder;

use crate::Failure;
use crate::apart::Paths;
use crate::board::Board;
use crate::end::Ended;
use crate::port::PortArgs;
use crate::rig::overseer::{self, Overseer};
use crate::rig::seat::{News, Seat};
use crate::rig::stage::Stage;
use crate::view;
use crate::view::keys::Wish;
use frame::message::{Command, Event, Message};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
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
    #[arg(long, value_parser = crate::number::positive(1e7, "seconds"))]
    seconds: Option<f64>,
    /// How long an unplugged port is waited for, s.
    #[arg(long, default_value_t = 5.0, value_parser = crate::number::from(0.0, 86_400.0, "seconds"))]
    wait: f64,
    /// No terminal view.
    #[arg(long)]
    plain: bool,
    #[command(flatten)]
    under: overseer::Args,
    #[command(flatten)]
    rig: Rig,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        self.port.paths(Paths::default()).reads(&self.under.model).writes("-o", [&self.output])
    }
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
    /// What feeds it, for the log's head.
    #[arg(long)]
    supply: Option<String>,
    /// Day of the run, YYYY-MM-DD, with THH:MM:SS behind it where the time is known, for the log's head.
    #[arg(long, value_parser = crate::open::day_of_run)]
    date: Option<String>,
    /// Record the raw codes as well (columns `raw_*`), so that a better calibration can be replayed with `quadrig recalibrate`.
    #[arg(long)]
    raw: bool,
}

impl Rig {
    /// A recorder into `target`; `more` joins the head of the log.
    pub(crate) fn recorder(&self, target: &Path, more: &[(&str, String)]) -> Result<Recorder, Failure> {
        let named = [("motor", &self.motor), ("propeller", &self.propeller), ("supply", &self.supply), ("date", &self.date)];
        let own = named.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value.clone()?)));
        let head = own.chain(more.iter().map(|(key, value)| ((*key).to_owned(), value.clone())));
        Recorder::new(target, head.map(|(key, value)| (key, toml::Value::String(value))).collect(), self.raw)
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let board = Board::open(&args.port)?;
    let overseer = Overseer::new(&args.under, board.is_virtual())?;
    let recorder = args.rig.recorder(&args.output, &[])?;
    let mut seat = Seat::listening(board, recorder)?;
    let view = !quiet && !args.plain && view::is_there();
    let ended = if view { in_view(&mut seat, overseer, args) } else { line_by_line(&mut seat, overseer, args) };
    let rows = seat.rows();
    let (recorder, board) = seat.rise();
    match ended {
        Err(Ending::Nobody(why)) => {
            recorder.into_iter().for_each(Recorder::discard);
            Err(why)
        }
        ended => {
            recorder.map_or(Ok(()), |recorder| recorder.finish(&board, quiet))?;
            let arrived = |e: Failure| format!("{e}; the {rows} rows that arrived are in {}", args.output.display());
            ended.map_err(|e| arrived(e.into()).into())
        }
    }
}

/// Why a recording ends before its time.
enum Ending {
    /// No board was heard.
    Nobody(Failure),
    /// The port is gone, or the terminal.
    Gone(Failure),
    /// The run left its model.
    Left(String),
}

impl From<Failure> for Ending {
    fn from(why: Failure) -> Self {
        Self::Gone(why)
    }
}

impl From<Ending> for Failure {
    fn from(ending: Ending) -> Self {
        match ending {
            Ending::Nobody(why) | Ending::Gone(why) => why,
            Ending::Left(words) => format!("{words}; the motor was stopped").into(),
        }
    }
}

/// What every recording watches: that the board says who it is, that the port comes back, that it is enough.
struct Vigil {
    begun: Duration,
    asked: Duration,
    signals: Ended,
    gone: Option<Instant>,
}

impl Vigil {
    fn new(seat: &Seat) -> Result<Self, Failure> {
        Ok(Self { begun: seat.now(), asked: seat.now(), signals: Ended::watch()?, gone: None })
    }

    /// Looks around; `true` when it is enough.
    fn look(&mut self, seat: &mut Seat, args: &Args) -> Result<bool, Ending> {
        if !seat.knows_its_board() {
            if seat.now() > self.begun + CALIBRATION_TIME {
                let cause = match seat.board.stats().foreign {
                    0 => "is it a rig board at 2000000 baud?",
                    _ => {
                        "its frames are of another version than this program's: flash the board with the image of the same release"
                    }
                };
                return Err(Ending::Nobody(
                    format!("{}: no calibration from the board; expected one within 3 s: {cause}", seat.board.name()).into(),
                ));
            }
            if seat.now() > self.asked + ASK_AGAIN {
                self.asked = seat.now();
                seat.ask(Command::Identify);
            }
        }
        self.gone = if seat.is_gone() { self.gone.or_else(|| Some(Instant::now())) } else { None };
        if self.gone.is_some_and(|since| since.elapsed().as_secs_f64() > args.wait) {
            return Err(Ending::Gone(seat.board.gone().into()));
        }
        Ok(self.signals.now() || args.seconds.is_some_and(|s| seat.seconds() >= s))
    }
}

/// Records, and says what has to be said.
fn line_by_line(seat: &mut Seat, mut overseer: Option<Overseer>, args: &Args) -> Result<(), Ending> {
    let end = std::io::stdin().is_terminal().then(crate::rig::lines);
    let mut vigil = Vigil::new(seat)?;
    loop {
        for news in seat.turn()? {
            if let (Some(overseer), News::Board(message)) = (&mut overseer, &news) {
                overseer.take(message);
            }
            match news {
                News::Board(Message::Event(Event::Faults { faults, .. })) => {
                    let words: Vec<&str> = faults.iter().map(frame::Fault::words).collect();
                    note!("latched: {}", words.join(", "));
                }
                News::Recording(words) => note!("{words}"),
                _ => {}
            }
        }
        if let Some(departure) = overseer.as_mut().and_then(Overseer::look) {
            let words = overseer::words(&departure);
            if overseer.as_ref().is_some_and(|o| o.under.stops) {
                seat.stop();
                return Err(Ending::Left(words));
            }
            note!("{words}");
        }
        let typed_end = end.as_ref().is_some_and(|end| matches!(end.try_recv(), Err(TryRecvError::Disconnected)));
        if vigil.look(seat, args)? || typed_end {
            return Ok(());
        }
    }
}

/// Records, and shows everything on the terminal.
fn in_view(seat: &mut Seat, overseer: Option<Overseer>, args: &Args) -> Result<(), Ending> {
    let mut stage = Stage::new(seat, None, overseer)?;
    let mut vigil = Vigil::new(seat)?;
    loop {
        for news in seat.turn()? {
            stage.take(seat, &news);
        }
        if let Some(words) = stage.look(seat) {
            return Err(Ending::Left(words));
        }
        if stage.wishes(seat)?.contains(&Wish::Quit) || vigil.look(seat, args)? {
            return Ok(());
        }
        stage.show()?;
    }
}
