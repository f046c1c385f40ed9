//! `quadrig rig`: talks to the rig board.
//!
//! What it is: one command a call (`identify`, `status`, `stop`, `tare`, `clear`, `set`, `configure`, `burst`, `save`), and sessions that
//! keep the link alive (`view`, `arm`, `calibrate`, `run`): in the terminal view, or, without a terminal, line by line.
//! What can go wrong: a refused command names every reason; a session that ends, for whatever reason, stops the motor first.
//! Units: us of pulse, s.
//! Reference: specification `rig.md`, "Acquisition"; Beharie 2013, Fig. 3.10.

mod assistant;
mod burst;
pub(crate) mod configure;
pub(crate) mod date;
pub(crate) mod file;
pub(crate) mod overseer;
pub(crate) mod seat;
mod session;
pub(crate) mod stage;
mod status;
mod typed;

use crate::Failure;
use crate::apart::Paths;
use crate::board::Board;
use crate::kind::{instead, refuse_other};
use crate::port::PortArgs;
use crate::record;
use crate::view;
use assistant::Assistant;
use clap::Subcommand;
use frame::esc::{BACK_EMF_NAME, ESC_NAMES};
use frame::message::{BoardId, Command, Event, Hello, Message, Setting};
use frame::rig::{ADC_NAMES, CAPTURE_NAMES};
use frame::units::PulseWidth;
use overseer::Overseer;
use schedule::{Plan, Player};
use seat::{News, Seat};
use session::{Errand, hold, own_faults};
use std::io::{BufRead, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;
use std::time::Duration;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    port: PortArgs,
    /// No terminal view: lines, as where there is no terminal.
    #[arg(long, global = true)]
    plain: bool,
    #[command(subcommand)]
    order: Order,
}

/// What a session records, and what it is held against.
#[derive(clap::Args)]
struct Session {
    /// Log to write; rig-DATE-TIME.csv without it.
    #[arg(short, long)]
    output: Option<PathBuf>,
    #[command(flatten)]
    rig: record::Rig,
    #[command(flatten)]
    under: overseer::Args,
}

#[derive(Subcommand)]
enum Order {
    /// Firmware, board, reset cause.
    Identify,
    /// What the board reads, how it is calibrated, and how it is: jitter, cycles, stack, encoder, line.
    Status,
    /// The terminal view of a board: every channel, and keys for arming, throttle, tare, masses, throttle range. Records.
    View {
        #[command(flatten)]
        session: Session,
    },
    /// Arms and records: in the terminal view, or by typed lines (long, cells N, ready, set US, run, stop, tare, quit).
    Arm {
        #[command(flatten)]
        session: Session,
    },
    /// Throttle-range calibration with the ESC unpowered, in the terminal view, or by typed lines: double, long, cells N, ready as the ESC beeps.
    Calibrate {
        /// I have disconnected the ESC's battery and taken the propeller off.
        #[arg(long)]
        esc_is_unpowered: bool,
        #[command(flatten)]
        session: Session,
    },
    /// Arms, runs a schedule, and records it: a file of parts, a verdict's next experiment, or a staircase.
    Run {
        /// Schedule file (TOML); without it and --next, the staircase of the options below.
        #[arg(conflicts_with_all = ["next", "step", "hold", "top", "down", "visits"])]
        schedule: Option<PathBuf>,
        /// Verdict whose next experiment is run, as it is.
        #[arg(long, conflicts_with_all = ["step", "hold", "top", "down", "visits"])]
        next: Option<PathBuf>,
        /// Height of a step, us.
        #[arg(long, default_value_t = 50.0, value_parser = crate::number::positive(1000.0, "us"))]
        step: f64,
        /// Hold of each level, s.
        #[arg(long, default_value_t = 30.0, value_parser = crate::number::positive(86_399.0, "seconds"))]
        hold: f64,
        /// Highest level, us.
        #[arg(long, default_value_t = 2000.0, value_parser = crate::number::from(1000.0, 2000.0, "a pulse in us"))]
        top: f64,
        /// Come down again.
        #[arg(long)]
        down: bool,
        /// How often.
        #[arg(long, default_value_t = 1, value_parser = crate::number::whole::<u16>(1, 65_535, "visits"))]
        visits: u16,
        #[command(flatten)]
        session: Session,
    },
    /// Sets the pulse of an armed rig and holds it for a while.
    Set {
        /// Pulse, us.
        #[arg(value_parser = crate::number::from(1000.0, 2000.0, "a pulse in us"))]
        us: f64,
        /// How long, s; then minimum again.
        #[arg(long, default_value_t = 0.0, value_parser = crate::number::from(0.0, 3600.0, "seconds"))]
        hold: f64,
    },
    /// Minimum throttle, now.
    Stop,
    /// Takes the present load as zero.
    Tare,
    /// Clears the latched faults.
    Clear,
    /// Configures the board from a file and stores it; or reads what is in force; or changes one setting until the next reset.
    Configure {
        /// The file (TOML), or a setting: log-ms, speed-limit, current-limit, voltage-limit, slew, link-ms, factory.
        what: Option<String>,
        /// The setting's value (none for factory).
        #[arg(value_parser = crate::number::from(0.0, 1e9, "a number"))]
        value: Option<f64>,
        /// Read what is in force.
        #[arg(long)]
        read: bool,
        /// File to read into; standard output without it.
        #[arg(short, long)]
        output: Option<PathBuf>,
    },
    /// Records every conversion of one channel and shows the spectrum of what vibrates.
    Burst(burst::Args),
    /// Stores the configuration in force in the board's flash.
    Save,
}

/// Lines of standard input, from a thread of their own; disconnected at its end.
pub(crate) fn lines() -> Receiver<String> {
    let (sender, receiver) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
    });
    receiver
}

/// A pulse from its width; what an ESC does not understand is refused here already.
fn pulse(us: f64) -> Result<PulseWidth, Failure> {
    if (1000.0..=2000.0).contains(&us) {
        Ok(PulseWidth((us * 1000.0).round() as u32))
    } else {
        Err(format!("{us} us: expected a pulse from 1000 to 2000 us").into())
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let mut board = Board::open(&args.port)?;
    let view = args.view(quiet);
    let silent = |_: &Message| {};
    let done = |what: &str| {
        if !quiet {
            say!("{what}");
        }
    };
    match &args.order {
        Order::Identify => identify(&mut board),
        Order::Status => status::run(&mut board),
        Order::Stop => board.obey(Command::Stop, silent).map(|()| done("stopped: minimum throttle, latched until cleared")),
        Order::Tare => board.wait_for_a_reading().and_then(|()| board.obey(Command::Tare, silent)).map(|()| done("tared")),
        Order::Clear => board.obey(Command::ClearFaults, silent).map(|()| done("cleared")),
        Order::Set { us, hold } => {
            board.obey(Command::SetPulse(pulse(*us)?), silent)?;
            let until = board.now() + Duration::from_secs_f64(*hold);
            let mut seat = Seat::new(board, None, None)?;
            while seat.now() < until {
                for news in seat.turn()? {
                    match news {
                        News::Board(Message::Event(Event::Faults { faults, .. })) => {
                            if let Some(words) = own_faults(faults) {
                                return Err(format!("the rig stopped itself: {words}; expected a pulse within its limits: docs/rig.md lists the faults").into());
                            }
                        }
                        News::Gone(why) => return Err(format!("{why}; the board stops the motor by itself within its link time-out").into()),
                        _ => {}
                    }
                }
            }
            let mut board = seat.board;
            if *hold > 0.0 {
                board.obey(Command::SetPulse(PulseWidth::MIN), silent)?;
            }
            done("set");
            Ok(())
        }
        Order::Configure { read: true, what: None, output, .. } => configure::to_file(&mut board, output.as_deref()),
        Order::Configure { read: false, what: Some(path), value: None, output: None } if is_file(path) => {
            let digest = configure::from_file(&mut board, path.as_ref())?;
            done(&format!("in force and stored; CRC-32 {digest:08x}"));
            Ok(())
        }
        Order::Configure { read: false, what: Some(key), value, output: None } => {
            board.obey(Command::Configure(setting(key, *value)?), silent).map(|()| done("in force until the next reset; `save` keeps it"))
        }
        Order::Configure { .. } => Err("rig configure: expected a file, or --read [-o FILE], or a setting with its value".into()),
        Order::Burst(args) => burst::run(&mut board, args, quiet),
        Order::Save => configure::save(&mut board).map(|()| done("saved, and read back the same")),
        Order::View { .. } if !view => Err("rig view: expected a terminal; `quadrig log` needs none".into()),
        Order::View { session } => session.hold(board, args, Errand::default(), quiet),
        Order::Arm { session } => session.hold(board, args, Errand { first: Some(Command::Arm), ..Errand::default() }, quiet),
        Order::Calibrate { esc_is_unpowered: false, .. } => {
            Err("the board will give MAXIMUM pulses; expected --esc-is-unpowered: disconnect the ESC's battery and take the propeller off first".into())
        }
        Order::Calibrate { session, .. } => {
            let first = Some(Command::CalibrateRange { confirm: Command::CALIBRATE_CONFIRM });
            session.hold(board, args, Errand { first, ..Errand::default() }, quiet)
        }
        Order::Run { schedule: None, next: None, step, hold, top, down, visits, session } => {
            let height = PulseWidth((step * 1000.0).round() as u32);
            let run = Command::RunVisits { step: height, hold_ms: (hold * 1000.0) as u32, top: pulse(*top)?, down: *down, visits: *visits };
            let levels = 1.0 + ((*top - 1000.0) / *step).floor();
            let levels = if *down { 2.0 * levels - 1.0 } else { levels } * f64::from(*visits);
            let way = if *down { "up and down" } else { "up" };
            let words = format!("staircase {way} in steps of {step} us to {top} us, {hold} s each, {visits} times");
            let course = Some((words, levels * *hold));
            session.hold(board, args, Errand { first: Some(Command::Arm), run: Some(run), course, ..Errand::default() }, quiet)
        }
        Order::Run { schedule, next, session, .. } => {
            let plan = planned(schedule.as_deref(), next.as_deref())?;
            done(&plan.summary());
            let course = Some((plan.name.clone(), plan.longest_s()));
            let (first, run) = (Some(Command::Arm), Some(Command::RunSchedule));
            session.hold(board, args, Errand { first, run, course, player: Some(Player::new(plan)) }, quiet)
        }
    }
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        let paths = self.port.paths(Paths::default());
        match &self.order {
            Order::View { session } | Order::Arm { session } | Order::Calibrate { session, .. } => session.paths(paths),
            Order::Run { schedule, next, session, .. } => {
                let named = schedule.as_deref().map(Plan::files).unwrap_or_default();
                session.paths(paths.reads(schedule).reads_too(named).reads(next))
            }
            Order::Configure { output, .. } => paths.writes("-o", output),
            Order::Burst(args) => args.paths(paths),
            _ => paths,
        }
    }

    /// Whether a session is shown on the terminal.
    fn view(&self, quiet: bool) -> bool {
        !quiet && !self.plain && view::is_there()
    }
}

impl Session {
    fn paths<'a>(&'a self, paths: Paths<'a>) -> Paths<'a> {
        paths.reads(&self.under.model).writes("-o", &self.output)
    }

    /// Holds a session at a board.
    fn hold(&self, board: Board, args: &Args, errand: Errand, quiet: bool) -> Result<(), Failure> {
        let overseer = Overseer::new(&self.under, board.is_virtual())?;
        let file = self.output.clone().unwrap_or_else(date::file_of_now);
        let head: Vec<(&str, String)> = errand.course.iter().map(|(name, _)| ("schedule", name.clone())).collect();
        let recorder = self.rig.recorder(&file, &head)?;
        let seat = Seat::new(board, Some(recorder), args.port.assist.then(Assistant::default))?;
        let done = hold(seat, errand, overseer, args.view(quiet), quiet);
        if !quiet && file.is_file() {
            let _ = writeln!(std::io::stdout(), "recorded in {}", file.display()); // the terminal may be gone
        }
        done
    }
}

fn identify(board: &mut Board) -> Result<(), Failure> {
    let hello = board.ask(Command::Identify, |_| {}, |m| if let Message::Hello(hello) = m { Some(*hello) } else { None })?;
    let [major, minor, patch] = hello.firmware;
    say!("{} board, firmware {major}.{minor}.{patch}, core {} MHz", hello.board.words(), hello.core_hz / 1_000_000);
    say!("last reset: {}", reset_cause(hello.reset_cause));
    if hello.board == BoardId::Rig {
        say!("fitted: {}; configuration {:08x}", fitted(&hello), hello.config);
    }
    Ok(())
}

/// The channels that a board has, by their names in a log.
pub(super) fn fitted(hello: &Hello) -> String {
    let named = |mask: u8, names: &[&'static str]| -> Vec<&'static str> {
        names.iter().enumerate().filter(|(n, _)| mask >> n & 1 == 1).map(|(_, name)| *name).collect()
    };
    let cross = named(hello.present >> CAPTURE_NAMES.len(), &[ESC_NAMES[0], BACK_EMF_NAME]);
    [named(hello.present, &CAPTURE_NAMES), named(hello.analogue, &ADC_NAMES), cross].concat().join(", ")
}

/// Bits 31..24 of RCC_CSR in words (RM0090 section 7.3.21); power-on and brown-out set further flags, so the rarest is told first.
pub(super) fn reset_cause(flags: u8) -> &'static str {
    const NAMES: [(u8, &str); 7] = [
        (0x80, "low-power management"),
        (0x40, "window watchdog"),
        (0x20, "watchdog: the control task hung"),
        (0x10, "software: a panic, or a debugger"),
        (0x08, "power-on"),
        (0x02, "brown-out of the board's supply"),
        (0x04, "reset key"),
    ];
    NAMES.iter().find(|(bit, _)| flags & bit != 0).map_or("unknown", |(_, name)| name)
}

/// What is expected of a file.
const SCHEDULE: &str =
    "a schedule, such as examples/schedule/constant.toml: docs/schedule.md lists the keys; --next takes a verdict";

/// What is to be run: a schedule, or the next experiment of a verdict.
fn planned(schedule: Option<&Path>, next: Option<&Path>) -> Result<Plan, Failure> {
    let Some(verdict) = next else {
        let file = schedule.unwrap_or(Path::new(""));
        let is_json = file.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        if !is_json {
            refuse_other(file, SCHEDULE)?;
        }
        return Plan::read(file).map_err(|why| instead(file, SCHEDULE, why));
    };
    Ok(Plan::next_experiment(verdict)?)
}

/// Whether the word names a file rather than a setting.
fn is_file(word: &str) -> bool {
    word.ends_with(".toml") || word.contains(std::path::MAIN_SEPARATOR) || Path::new(word).is_file()
}

fn setting(key: &str, value: Option<f64>) -> Result<Setting, Failure> {
    if key == "factory" {
        return Ok(Setting::Factory);
    }
    let told = || value.ok_or_else(|| format!("{key}: no value; expected one after it, such as `configure log-ms 100`"));
    let whole = |most: f64| {
        let value = told()?;
        if value.fract() == 0.0 && (0.0..=most).contains(&value) {
            Ok(value)
        } else {
            Err(format!("{key} = {value}: expected a whole number up to {most}"))
        }
    };
    Ok(match key {
        "log-ms" => Setting::LogPeriodMs(whole(65_535.0)? as u16),
        "link-ms" => Setting::LinkMs(whole(65_535.0)? as u16),
        "slew" => Setting::SlewNsPerMs(whole(f64::from(u32::MAX))? as u32),
        "speed-limit" => Setting::SpeedLimit(told()? as f32),
        "current-limit" => Setting::CurrentLimit(told()? as f32),
        "voltage-limit" => Setting::VoltageLimit(told()? as f32),
        _ => {
            return Err(format!(
                "{key}: no such setting, nor a file; expected one of log-ms, link-ms, slew, speed-limit, current-limit, voltage-limit, factory"
            )
            .into());
        }
    })
}
