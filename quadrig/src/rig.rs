//! `quadrig rig`: talks to the rig board.
//!
//! What it is: one command a call (`identify`, `status`, `stop`, `tare`, `clear`, `set`, `configure`, `burst`, `save`), and two sessions that keep the
//! link alive (`arm`, `calibrate`, `run`): there the operator types what the ESC beeps, and more commands.
//! What can go wrong: a refused command names every reason; a session that ends, for whatever reason, stops the motor first.
//! Units: us of pulse, s.
//! Reference: specification `rig.md`, "Acquisition"; Beharie 2013, Fig. 3.10.

mod burst;
pub(crate) mod configure;
pub(crate) mod date;
pub(crate) mod file;
mod status;

use crate::Failure;
use crate::board::{Board, Heard};
use crate::end::Ended;
use crate::port::PortArgs;
use crate::record::{self, Recorder};
use clap::Subcommand;
use frame::message::{Beep, BoardId, Command, Event, Hello, Message, Setting};
use frame::rig::{ADC_NAMES, CAPTURE_NAMES, Fault, RigState};
use frame::units::PulseWidth;
use schedule::{Plan, Player};
use std::io::BufRead;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;
use virtual_board::{Hand, sound};

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    port: PortArgs,
    #[command(subcommand)]
    order: Order,
}

#[derive(Subcommand)]
enum Order {
    /// Firmware, board, reset cause.
    Identify,
    /// What the board reads, how it is calibrated, and how it is: jitter, cycles, stack, encoder, line.
    Status,
    /// Arms, then obeys typed lines: long, cells N, ready, set US, run, stop, tare, quit.
    Arm,
    /// Throttle-range calibration with the ESC unpowered; type double, long, cells N, ready as the ESC beeps.
    Calibrate {
        /// I have disconnected the ESC's battery and taken the propeller off.
        #[arg(long)]
        esc_is_unpowered: bool,
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
        #[arg(long, default_value_t = 50.0)]
        step: f64,
        /// Hold of each level, s.
        #[arg(long, default_value_t = 30.0)]
        hold: f64,
        /// Highest level, us.
        #[arg(long, default_value_t = 2000.0)]
        top: f64,
        /// Come down again.
        #[arg(long)]
        down: bool,
        /// How often.
        #[arg(long, default_value_t = 1)]
        visits: u16,
        /// Log to write.
        #[arg(short, long)]
        output: Option<PathBuf>,
        #[command(flatten)]
        rig: record::Rig,
    },
    /// Sets the pulse of an armed rig and holds it for a while.
    Set {
        /// Pulse, us.
        us: f64,
        /// How long, s; then minimum again.
        #[arg(long, default_value_t = 0.0)]
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
        Err(format!("{us} us: a pulse is 1000 to 2000 us").into())
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let mut board = Board::open(&args.port)?;
    let assistant = args.port.assist.then(Assistant::default);
    let silent = |_: &Message| {};
    let done = |what: &str| {
        if !quiet {
            println!("{what}");
        }
    };
    match &args.order {
        Order::Identify => identify(&mut board),
        Order::Status => status::run(&mut board),
        Order::Stop => board.obey(Command::Stop, silent).map(|()| done("stopped: minimum throttle, latched until cleared")),
        Order::Tare => board.obey(Command::Tare, silent).map(|()| done("tared")),
        Order::Clear => board.obey(Command::ClearFaults, silent).map(|()| done("cleared")),
        Order::Set { us, hold } => {
            board.obey(Command::SetPulse(pulse(*us)?), silent)?;
            let until = board.now() + Duration::from_secs_f64(hold.clamp(0.0, 3600.0));
            let mut session = Session {
                player: None,
                recorder: None,
                assistant: None,
                quiet,
                state: RigState::Running,
                finished: false,
                faulted: None,
            };
            while board.now() < until && session.faulted.is_none() {
                session.turn(&mut board)?;
            }
            session.verdict()?;
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
        Order::Configure { .. } => Err("rig configure takes a file, or --read [-o FILE], or a setting with its value".into()),
        Order::Burst(args) => burst::run(&mut board, args, quiet),
        Order::Save => configure::save(&mut board).map(|()| done("saved, and read back the same")),
        Order::Arm => session(&mut board, Command::Arm, Course::Typed, None, assistant, quiet),
        Order::Calibrate { esc_is_unpowered: false } => {
            Err("the board will give MAXIMUM pulses: disconnect the ESC's battery, take the propeller off, and say --esc-is-unpowered".into())
        }
        Order::Calibrate { .. } => {
            session(&mut board, Command::CalibrateRange { confirm: Command::CALIBRATE_CONFIRM }, Course::Typed, None, assistant, quiet)
        }
        Order::Run { schedule: None, next: None, step, hold, top, down, visits, output, rig } => {
            let height = if *step > 0.0 && *step <= 1000.0 { PulseWidth((step * 1000.0).round() as u32) } else { return Err(format!("{step} us: a step is above 0 and up to 1000 us").into()) };
            if !(*hold > 0.0 && *hold < 86_400.0) {
                return Err(format!("{hold} s: a level is held for more than 0 and less than 86400 s").into());
            }
            let run = Command::RunVisits { step: height, hold_ms: (hold * 1000.0) as u32, top: pulse(*top)?, down: *down, visits: *visits };
            let way = if *down { "up and down" } else { "up" };
            let words = format!("staircase {way} in steps of {step} us to {top} us, {hold} s each, {visits} times");
            let recorder = output.as_ref().map(|o| rig.recorder(o, &[("schedule", words)], quiet)).transpose()?;
            session(&mut board, Command::Arm, Course::Known(run), recorder, assistant, quiet)
        }
        Order::Run { schedule, next, output, rig, .. } => {
            let plan = match (schedule, next) {
                (_, Some(verdict)) => Plan::next_experiment(verdict)?,
                (file, None) => Plan::read(file.as_deref().unwrap_or(Path::new("")))?,
            };
            done(&plan.summary());
            let head = [("schedule", plan.name.clone())];
            let recorder = output.as_ref().map(|o| rig.recorder(o, &head, quiet)).transpose()?;
            session(&mut board, Command::Arm, Course::Played(Box::new(Player::new(plan))), recorder, assistant, quiet)
        }
    }
}

fn identify(board: &mut Board) -> Result<(), Failure> {
    let hello = board.ask(Command::Identify, |_| {}, |m| if let Message::Hello(hello) = m { Some(*hello) } else { None })?;
    let [major, minor, patch] = hello.firmware;
    println!("{:?} board, firmware {major}.{minor}.{patch}, core {} MHz", hello.board, hello.core_hz / 1_000_000);
    println!("last reset: {}", reset_cause(hello.reset_cause));
    if hello.board == BoardId::Rig {
        println!("fitted: {}; configuration {:08x}", fitted(&hello), hello.config);
    }
    Ok(())
}

/// The channels that a board has, by their names in a log.
pub(super) fn fitted(hello: &Hello) -> String {
    let named = |mask: u8, names: &[&'static str]| -> Vec<&'static str> {
        names.iter().enumerate().filter(|(n, _)| mask >> n & 1 == 1).map(|(_, name)| *name).collect()
    };
    [named(hello.present, &CAPTURE_NAMES), named(hello.analogue, &ADC_NAMES)].concat().join(", ")
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

/// Whether the word names a file rather than a setting.
fn is_file(word: &str) -> bool {
    word.ends_with(".toml") || word.contains(std::path::MAIN_SEPARATOR)
}

fn setting(key: &str, value: Option<f64>) -> Result<Setting, Failure> {
    if key == "factory" {
        return Ok(Setting::Factory);
    }
    let value = value.ok_or_else(|| format!("{key}: a value is needed"))?;
    let whole = |most: f64| {
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
        "speed-limit" => Setting::SpeedLimit(value as f32),
        "current-limit" => Setting::CurrentLimit(value as f32),
        "voltage-limit" => Setting::VoltageLimit(value as f32),
        _ => {
            return Err(format!(
                "{key}: no such setting; there are log-ms, link-ms, slew, speed-limit, current-limit, voltage-limit, factory"
            )
            .into());
        }
    })
}

/// What is run once the rig is armed.
enum Course {
    /// What the operator types.
    Typed,
    /// A schedule that the board knows.
    Known(Command),
    /// A schedule that is sent.
    Played(Box<Player>),
}

/// A conversation that keeps the link alive.
struct Session {
    player: Option<Player>,
    recorder: Option<Recorder>,
    assistant: Option<Assistant>,
    quiet: bool,
    state: RigState,
    finished: bool,
    faulted: Option<String>,
}

impl Session {
    fn take(&mut self, message: &Message) {
        if let Some(recorder) = &mut self.recorder {
            recorder.take(message);
        }
        if let Some(player) = &mut self.player {
            player.take(message);
        }
        match message {
            Message::Event(Event::State { to, .. }) => {
                self.state = *to;
                if !self.quiet {
                    println!("{}", esc_pwm::arming::message(*to));
                }
            }
            Message::Event(Event::Faults { faults, .. }) => {
                let words: Vec<&str> = faults.iter().filter(|f| *f != Fault::OperatorStop).map(Fault::words).collect();
                if !words.is_empty() {
                    self.faulted = Some(words.join(", "));
                }
            }
            Message::Event(Event::StopLoop { open: true, .. }) => {
                eprintln!("stop loop open: let the key go, check plug and wire")
            }
            Message::Event(Event::ScheduleDone { .. }) => self.finished = true,
            _ => {}
        }
    }

    /// Hears what arrived and keeps the link alive.
    fn turn(&mut self, board: &mut Board) -> Result<(), Failure> {
        match board.hear() {
            Heard::Messages(messages) => messages.iter().for_each(|m| self.take(&m.message)),
            Heard::Gone => {
                return Err(format!("{}; the board stops the motor by itself within its link time-out", board.gone()).into());
            }
        }
        while let Some(beep) = board.beep() {
            if !self.quiet {
                println!("the ESC: {}   ({})", sound::heard(beep), sound::meaning(beep));
            }
            if self.assistant.is_some() {
                board.send(Command::Beep(beep))?;
            }
        }
        if let Some(assistant) = &mut self.assistant {
            assistant.help(board, self.state)?;
        }
        while let Some(command) = self.player.as_mut().and_then(|player| player.command(board.now().as_millis() as u64)) {
            board.send(command)?;
        }
        if let Some(why) = self.player.as_ref().and_then(Player::failure) {
            return Err(format!("the schedule was not played to its end: {why}").into());
        }
        let now = board.now();
        if let Some(question) = self.recorder.as_mut().and_then(|recorder| recorder.question(now)) {
            board.send(question)?;
        }
        board.keep_alive()
    }

    fn verdict(&self) -> Result<(), Failure> {
        self.faulted.as_ref().map_or(Ok(()), |words| Err(format!("the rig stopped itself: {words}").into()))
    }
}

/// Hands and ears at a virtual board's bench: switches the ESC on where that is due, and passes on what it beeps.
#[derive(Default)]
struct Assistant {
    /// Since when the board waits for the ESC to be powered.
    waits: Option<Duration>,
}

/// How long the assistant takes to the switch.
const TO_THE_SWITCH: Duration = Duration::from_millis(300);

impl Assistant {
    fn help(&mut self, board: &mut Board, state: RigState) -> Result<(), Failure> {
        if !matches!(state, RigState::ArmHoldMin | RigState::CalibrateHoldMax) {
            self.waits = None;
        } else if board.now() >= *self.waits.get_or_insert(board.now()) + TO_THE_SWITCH && !board.is_powered() {
            board.hand(&Hand::Power(true))?;
        }
        Ok(())
    }
}

/// What a typed line means.
enum Typed {
    /// A command for the board.
    Command(Command),
    /// A hand at a virtual board's bench.
    Hand(Hand),
    /// The end.
    End,
}

/// What a typed line asks for; `hands` where there is a bench to lay hands on.
fn typed(line: &str, hands: bool) -> Result<Typed, Failure> {
    let mut words = line.split_whitespace();
    let (word, value) = (words.next().unwrap_or(""), words.next());
    let number = || value.and_then(|v| v.parse::<f64>().ok()).ok_or_else(|| format!("{line:?}: a number is needed"));
    Ok(Typed::Command(match word {
        "" => Command::Ping,
        "long" => Command::Beep(Beep::Long),
        "cells" => Command::Beep(Beep::Cells(number()?.clamp(0.0, 255.0) as u8)),
        "ready" => Command::Beep(Beep::Ready),
        "double" => Command::Beep(Beep::Double),
        "programming" => Command::Beep(Beep::Programming),
        "nosignal" => Command::Beep(Beep::NoSignal),
        "selftest" => Command::Beep(Beep::SelfTestFailed),
        "set" => Command::SetPulse(pulse(number()?)?),
        "run" => Command::RunSchedule,
        "tare" => Command::Tare,
        "stop" => Command::Stop,
        "quit" => return Ok(Typed::End),
        "bench" if hands => {
            let words = line.trim_start().strip_prefix("bench").unwrap_or("");
            return Ok(Typed::Hand(Hand::parse(words.trim())?));
        }
        _ => {
            let bench = if hands { ", or bench and what a hand does there (bench power on)" } else { "" };
            return Err(format!(
                "{word:?}: type long, cells N, ready, double, programming, nosignal, selftest, set US, run, tare, stop or quit{bench}"
            )
            .into());
        }
    }))
}

/// Starts with `first`, obeys typed lines, runs `schedule` once armed, and stops at the end.
fn session(
    board: &mut Board,
    first: Command,
    course: Course,
    recorder: Option<Recorder>,
    assistant: Option<Assistant>,
    quiet: bool,
) -> Result<(), Failure> {
    let (mut schedule, player) = match course {
        Course::Typed => (None, None),
        Course::Known(command) => (Some(command), None),
        Course::Played(player) => (Some(Command::RunSchedule), Some(*player)),
    };
    let ended = Ended::watch()?;
    let mut session = Session { player, recorder, assistant, quiet, state: RigState::Disarmed, finished: false, faulted: None };
    // who it is and how its codes are meant, for the log
    let known = board.ask(
        Command::Identify,
        |_| {},
        |m| {
            session.take(m);
            matches!(m, Message::Calibration(_)).then_some(())
        },
    );
    if let Err(refusal) = known.and_then(|()| board.obey(first, |m| session.take(m))) {
        if let Some(recorder) = session.recorder {
            recorder.discard();
        }
        return Err(refusal);
    }
    let input = lines();
    let running = schedule.is_some();
    let talk = (|| -> Result<(), Failure> {
        loop {
            session.turn(board)?;
            if ended.now() || session.faulted.is_some() || (running && session.finished) {
                return Ok(());
            }
            if session.state == RigState::Armed
                && session.player.as_ref().is_none_or(Player::is_ready)
                && let Some(run) = schedule.take()
            {
                board.obey(run, |m| session.take(m))?;
            }
            match input.try_recv() {
                Ok(line) => match typed(&line, board.is_virtual()) {
                    Ok(Typed::Command(command @ (Command::Beep(_) | Command::Ping))) => board.send(command)?,
                    Ok(Typed::Command(Command::Stop) | Typed::End) => return Ok(()),
                    Ok(Typed::Command(command)) => {
                        if let Err(refusal) = board.obey(command, |m| session.take(m)) {
                            eprintln!("{refusal}");
                        }
                    }
                    Ok(Typed::Hand(hand)) => match board.hand(&hand) {
                        Ok(()) if quiet => {}
                        Ok(()) => println!("{}", hand.words()),
                        Err(why) => eprintln!("{why}"),
                    },
                    Err(mistake) => eprintln!("{mistake}"),
                },
                Err(TryRecvError::Disconnected) if !running => return Ok(()),
                Err(_) => {}
            }
        }
    })();
    // whatever ended the talk: the motor is stopped before anything else is done
    let stopped = board.obey(Command::Stop, |m| session.take(m));
    let Session { recorder, faulted, .. } = session;
    let recorded = recorder.map_or(Ok(()), |r| r.finish(board, quiet));
    talk?;
    if let Some(words) = faulted {
        return Err(format!("the rig stopped itself: {words}").into());
    }
    stopped?;
    recorded
}
