//! Where a board is: at a serial port, or in this program.
//!
//! What it is: [`PortArgs`], the options of every command that speaks with a board, and [`Port`], bytes in both directions. A virtual board
//! (`sim[:SCENARIO.toml]`) moves on while it is read, held to the clock or faster; waiting for it is counted in its own time.
//! What can go wrong: no such port, a port that goes away, a scenario that is refused: one line each.
//! Units: bytes; baud; time since the port was opened.
//! Reference: specification `rig.md`, "The operator's side"; docs/virtual.md.

use crate::Failure;
use crate::apart::Paths;
use crate::kind::{SCENARIO, instead};
use frame::message::Beep;
use hal_sim::scenario::AnyScenario;
use serialport::SerialPort;
use std::io::{Error, ErrorKind, Read, Write};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use virtual_board::{BoardError, Hand, Kind, Order, Pace, VirtualBoard, switch_on};

/// Longest wait in one read.
const READ_TIME: Duration = Duration::from_millis(20);
/// Name of the virtual board's port.
const VIRTUAL: &str = "sim";

/// Which board, and how.
#[derive(clap::Args, Clone)]
pub(crate) struct PortArgs {
    /// Serial port of the board, or sim[:SCENARIO.toml] for a virtual one.
    #[arg(long, global = true, default_value = "", hide_default_value = true)]
    pub(crate) port: String,
    /// Virtual board: the file in which it keeps its settings, so that they survive between commands.
    #[arg(long, global = true, value_name = "FILE")]
    pub(crate) flash: Option<PathBuf>,
    /// Virtual board: the rig board's flash image in the emulator, in the place of the native firmware.
    #[arg(long, global = true, value_name = "ELF")]
    pub(crate) image: Option<PathBuf>,
    /// Virtual board: times as fast as the clock, 1 where it is not given; 0 for as fast as it goes.
    #[arg(long, global = true, value_name = "N", value_parser = crate::number::from(0.0, 1e6, "times the clock"))]
    pub(crate) speed: Option<f64>,
    /// Virtual board: an assistant at the bench switches the ESC on where that is due, and passes on what it beeps.
    #[arg(long, global = true)]
    pub(crate) assist: bool,
}

impl PortArgs {
    /// The files that a virtual board reads, with the schedule that its scenario names. A scenario that cannot be read is refused later, in its own
    /// words.
    pub(crate) fn paths<'a>(&'a self, paths: Paths<'a>) -> Paths<'a> {
        let scenario = self.scenario().flatten();
        let schedule = match scenario.as_deref().map(|path| (path, AnyScenario::load(path))) {
            Some((path, Ok(AnyScenario::Rig(scenario)))) => scenario.schedule.files(path),
            _ => Vec::new(),
        };
        paths.reads_too(scenario).reads_too(schedule).reads(&self.flash).reads(&self.image)
    }

    /// Whether it is a board in this program, which ends with the command.
    pub(crate) fn is_virtual(&self) -> bool {
        self.scenario().is_some()
    }

    /// Whether one was named.
    pub(crate) fn is_given(&self) -> bool {
        !self.port.is_empty()
    }

    /// The virtual board's scenario, if the port is one: `Some(None)` for the demonstration rig.
    fn scenario(&self) -> Option<Option<PathBuf>> {
        match self.port.strip_prefix(VIRTUAL)? {
            "" => Some(None),
            rest => rest.strip_prefix(':').map(|path| Some(path.into())),
        }
    }

    /// Opens the port; `imu` says which board a virtual one is where no scenario says it.
    pub(crate) fn open(&self, baud: u32, imu: bool) -> Result<Port, Failure> {
        let Some(scenario) = self.scenario() else {
            let virtual_only = [
                ("--flash", self.flash.is_some()),
                ("--image", self.image.is_some()),
                ("--speed", self.speed.is_some()),
                ("--assist", self.assist),
            ];
            if let Some((option, _)) = virtual_only.iter().find(|(_, given)| *given) {
                return Err(format!("{option} belongs to a virtual board; expected --port sim").into());
            }
            if self.port.is_empty() {
                return Err("no port; expected --port with the serial port of the board, or sim for a virtual one".into());
            }
            return Port::serial(&self.port, baud);
        };
        let speed = self.speed.unwrap_or(1.0);
        let order = Order { scenario, imu, flash: self.flash.clone(), image: self.image.clone() };
        let board = on(&order)?;
        if (board.kind() == Kind::Imu) != imu {
            let wanted = if imu { "this command speaks with the IMU board" } else { "this command speaks with the rig board" };
            return Err(format!("{}: a virtual {}; {wanted}", self.port, board.kind().words()).into());
        }
        Ok(Port::Virtual(Box::new(VirtualPort {
            board,
            stop_open: false,
            pace: Pace::new(speed),
            said: Vec::new(),
            sent: Vec::new(),
        })))
    }
}

/// Switches a virtual board on; a file that is no scenario is told as what it is.
pub(crate) fn on(order: &Order) -> Result<Box<dyn VirtualBoard>, Failure> {
    switch_on(order).map_err(|why| match (&order.scenario, why) {
        (Some(file), BoardError::Scenario(why)) => instead(file, SCENARIO, why),
        (_, why) => why.into(),
    })
}

/// A board in this program.
pub(crate) struct VirtualPort {
    board: Box<dyn VirtualBoard>,
    /// Hands have opened the stop loop.
    stop_open: bool,
    pace: Pace,
    said: Vec<u8>,
    sent: Vec<u8>,
}

impl VirtualPort {
    /// Lets the board go on until it has sent something, at most [`READ_TIME`].
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        let until = self.board.ms() + READ_TIME.as_millis() as u64;
        while self.sent.is_empty() && self.board.ms() < until {
            self.pace.wait(self.board.ms() + 1);
            self.sent = self.board.millisecond(&std::mem::take(&mut self.said)).map_err(Error::other)?;
        }
        if self.sent.is_empty() {
            return Err(ErrorKind::TimedOut.into());
        }
        let used = self.sent.len().min(bytes.len());
        bytes.iter_mut().zip(self.sent.drain(..used)).for_each(|(to, from)| *to = from);
        Ok(used)
    }
}

/// Bytes to and from a board.
pub(crate) enum Port {
    /// At a serial port: its name, speed and open end, and when it was opened.
    Serial { name: String, baud: u32, port: Box<dyn SerialPort>, opened: Instant },
    /// In this program.
    Virtual(Box<VirtualPort>),
}

impl Port {
    fn serial(name: &str, baud: u32) -> Result<Self, Failure> {
        let port = serialport::new(name, baud).timeout(READ_TIME).open().map_err(|e| {
            let known: Vec<String> = serialport::available_ports().unwrap_or_default().into_iter().map(|p| p.port_name).collect();
            let known =
                if known.is_empty() { "no serial port is there".to_owned() } else { format!("there are {}", known.join(", ")) };
            // what answers no question of a serial line is told as "no typewriter"
            let why = if e.description.contains("typewriter") { "it is no serial port".to_owned() } else { e.to_string() };
            format!("{name}: cannot be opened ({why}); expected a serial port ({known}), or sim for a virtual board")
        })?;
        Ok(Self::Serial { name: name.to_owned(), baud, port, opened: Instant::now() })
    }

    /// Its name, for people.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Serial { name, .. } => name.clone(),
            Self::Virtual(port) => format!("virtual {}", port.board.kind().words()),
        }
    }

    /// Time since it was opened: the clock's, or the virtual board's.
    pub(crate) fn now(&self) -> Duration {
        match self {
            Self::Serial { opened, .. } => opened.elapsed(),
            Self::Virtual(port) => Duration::from_millis(port.board.ms()),
        }
    }

    /// Sends bytes.
    pub(crate) fn write_all(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        match self {
            Self::Serial { port, .. } => port.write_all(bytes),
            Self::Virtual(port) => {
                port.said.extend_from_slice(bytes);
                Ok(())
            }
        }
    }

    /// What arrived; waits for [`READ_TIME`] at most.
    pub(crate) fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        match self {
            Self::Serial { port, .. } => port.read(bytes),
            Self::Virtual(port) => port.read(bytes),
        }
    }

    /// Opens the same port again after it went away.
    pub(crate) fn reopen(&mut self) -> bool {
        match self {
            Self::Serial { name, baud, port, .. } => {
                let opened = serialport::new(name.as_str(), *baud).timeout(READ_TIME).open();
                opened.map(|again| *port = again).is_ok()
            }
            Self::Virtual(_) => false,
        }
    }

    /// Whether the board is in this program.
    pub(crate) fn is_virtual(&self) -> bool {
        matches!(self, Self::Virtual(_))
    }

    /// The next beep pattern of a virtual board's ESC.
    pub(crate) fn beep(&mut self) -> Option<Beep> {
        match self {
            Self::Serial { .. } => None, // a person hears it
            Self::Virtual(port) => port.board.beep(),
        }
    }

    /// Lays a hand on a virtual board's bench.
    pub(crate) fn hand(&mut self, hand: &Hand) -> Result<(), Failure> {
        match self {
            Self::Serial { .. } => Err("hands are laid on a real bench by hand".into()),
            Self::Virtual(port) => {
                if let Hand::StopLoop { open } = hand {
                    port.stop_open = *open;
                }
                Ok(port.board.hand(hand)?)
            }
        }
    }

    /// Whether hands have opened a virtual board's stop loop.
    pub(crate) fn is_stopped(&self) -> bool {
        matches!(self, Self::Virtual(port) if port.stop_open)
    }

    /// Whether a virtual board's ESC has power.
    pub(crate) fn is_powered(&self) -> bool {
        matches!(self, Self::Virtual(port) if port.board.is_powered())
    }
}
