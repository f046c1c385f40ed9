//! `quadrig virtual`: a board without hardware behind a pseudo-terminal, for this program and for others.
//!
//! What it is: the board, held to the clock, whose port's name is the first line of the output. What is heard at the bench is printed; typed lines are
//! hands at it.
//! What can go wrong: a system without pseudo-terminals; a link whose place is taken; see [`virtual_board::BoardError`].
//! Units: s of the board's time.
//! Reference: specification `rig.md`, "The operator's side"; docs/virtual.md.

use crate::Failure;
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Scenario of the rig, or of the IMU board on its body; the demonstration rig without one.
    scenario: Option<PathBuf>,
    /// A name for the port that stays, as udev gives one: a link to it, while the board is on.
    #[arg(long)]
    link: Option<PathBuf>,
    /// The file in which the board keeps its settings.
    #[arg(long)]
    flash: Option<PathBuf>,
    /// The rig board's flash image in the emulator, in the place of the native firmware.
    #[arg(long, value_name = "ELF")]
    image: Option<PathBuf>,
    /// Times as fast as the clock.
    #[arg(long, default_value_t = 1.0, value_parser = crate::number::positive(1e6, "times the clock (other programs live by it)"))]
    speed: f64,
    /// Switch the board off after so many seconds of its time.
    #[arg(long, value_parser = crate::number::positive(1e7, "seconds"))]
    seconds: Option<f64>,
}

/// Runs the command.
#[cfg(not(unix))]
pub(crate) fn run(_: &Args, _: bool) -> Result<(), Failure> {
    Err("this system has no pseudo-terminals; expected --port sim, which needs none".into())
}

/// Runs the command.
#[cfg(unix)]
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    pty::run(args, quiet)
}

#[cfg(unix)]
mod pty {
    use super::{Args, Failure};
    use crate::end::Ended;
    use std::io::{IsTerminal, Write};
    use std::path::{Path, PathBuf};
    use std::sync::mpsc::{Receiver, TryRecvError};
    use virtual_board::{Cable, Hand, Order, Pace, VirtualBoard, sound};

    /// A link to the port, ours to take away.
    struct Link(Option<PathBuf>);

    impl Link {
        fn new(place: Option<&Path>, port: &str) -> Result<Self, Failure> {
            let Some(place) = place else { return Ok(Self(None)) };
            // what a board before left behind leads to a port; anything else is somebody's
            let left_behind = std::fs::read_link(place).is_ok_and(|port| port.starts_with("/dev"));
            if std::fs::symlink_metadata(place).is_ok() && !left_behind {
                return Err(format!(
                    "--link {}: something is there that is no link to a port; expected another name",
                    place.display()
                )
                .into());
            }
            let _ = std::fs::remove_file(place);
            std::os::unix::fs::symlink(port, place).map_err(|e| format!("--link {}: {e}", place.display()))?;
            Ok(Self(Some(place.to_owned())))
        }
    }

    impl Drop for Link {
        fn drop(&mut self) {
            if let Some(place) = &self.0 {
                let _ = std::fs::remove_file(place);
            }
        }
    }

    pub(super) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
        let ended = Ended::watch()?;
        let order = Order { scenario: args.scenario.clone(), imu: false, flash: args.flash.clone(), image: args.image.clone() };
        let mut board = crate::port::on(&order)?;
        let (mut cable, port) = Cable::new().map_err(|e| format!("no pseudo-terminal: {e}"))?;
        let _link = Link::new(args.link.as_deref(), &port)?;
        say!("{port}");
        if !quiet {
            say!("virtual {}; {}", board.kind().words(), help(&*board));
        }
        crate::say::out().flush()?;
        let typed = crate::rig::lines();
        let mut pace = Pace::new(args.speed);
        let last = args.seconds.map_or(u64::MAX, |s| (s * 1000.0) as u64);
        while !ended.now() && board.ms() < last {
            pace.wait(board.ms() + 1);
            let mut bytes = [0; 1024];
            let heard = cable.hear(&mut bytes);
            let sent = board.millisecond(&bytes[..heard])?;
            if !sent.is_empty() {
                cable.say(&sent);
            }
            while let Some(beep) = board.beep() {
                tell(&*board, &format!("the ESC: {}   ({})", sound::heard(beep), sound::meaning(beep)));
            }
            if !obey(&mut *board, &typed) {
                break;
            }
        }
        Ok(())
    }

    fn help(board: &dyn VirtualBoard) -> String {
        let meters = if board.meters().is_some() { "; meters (what is really there)" } else { "" };
        format!("type {}{meters}; quit", Hand::WORDS)
    }

    fn tell(board: &dyn VirtualBoard, what: &str) {
        let mut out = crate::say::out();
        let _ = writeln!(out, "{:>8.1} s  {what}", board.ms() as f64 * 1.0e-3).and_then(|()| out.flush()); // nobody listens: nothing is lost
    }

    /// Does what was typed; `false` for the end.
    fn obey(board: &mut dyn VirtualBoard, typed: &Receiver<String>) -> bool {
        let line = match typed.try_recv() {
            Ok(line) => line,
            // whoever started it without a keyboard ends it by a signal
            Err(TryRecvError::Disconnected) => return !std::io::stdin().is_terminal(),
            Err(TryRecvError::Empty) => return true,
        };
        match line.trim() {
            "" => {}
            "quit" => return false,
            "help" => tell(board, &help(board)),
            "meters" => tell(board, &meters(board)),
            words => match Hand::parse(words) {
                Ok(hand) => match board.hand(&hand) {
                    Ok(()) => tell(board, &hand.words()),
                    Err(why) => tell(board, why),
                },
                Err(mistake) => tell(board, &mistake),
            },
        }
        true
    }

    fn meters(board: &dyn VirtualBoard) -> String {
        board.meters().map_or_else(
            || "there is nothing to measure".to_owned(),
            |truth| {
                let plant = truth.plant;
                format!(
                    "{:.3} V, {:.3} A, {:.0} rev/min, {:.3} N of thrust, {:.4} N.m, {:.1} degC",
                    plant.voltage_v, plant.current_a, plant.rpm, plant.thrust_n, plant.torque_nm, plant.temp_c
                )
            },
        )
    }
}
