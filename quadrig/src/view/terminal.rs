//! The terminal itself.
//!
//! What it is: raw mode and the alternate screen while it lives, given back whatever ends the program; keys that wait; drawing at most
//! twenty times a second.
//! What can go wrong: a terminal that goes away (a lost ssh connection) is told once; the session ends then as by a signal.
//! Units: s.
//! Reference: crate ratatui, `init` and `restore` (its panic hook gives the terminal back too).

use super::draw::{Ink, draw};
use super::screen::Screen;
use crate::Failure;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyEvent};
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Time between two pictures.
const PICTURE: Duration = Duration::from_millis(50);

/// Whether a person sits at a terminal: keyboard and screen are one.
pub(crate) fn is_there() -> bool {
    std::io::stdin().is_terminal() && std::io::stdout().is_terminal()
}

/// Asks before a key is waited for: a wait at a terminal that is gone would never end. An error where it is gone.
#[cfg(unix)]
fn is_gone() -> Result<bool, Failure> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let stdin = std::io::stdin();
    let mut ends = [PollFd::new(&stdin, PollFlags::IN)];
    let asked = poll(&mut ends, Some(&Timespec { tv_sec: 0, tv_nsec: 0 }));
    if asked.is_ok() && ends.iter().any(|end| end.revents().intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL)) {
        return Err("the terminal is gone; expected it to stay: what was recorded is kept".into());
    }
    Ok(false)
}

/// The same where the system tells by itself.
#[cfg(not(unix))]
fn is_gone() -> Result<bool, Failure> {
    Ok(false)
}

/// The terminal in the hands of the view.
pub(crate) struct Terminal {
    /// Until it is given back.
    terminal: Option<DefaultTerminal>,
    ink: Ink,
    drawn: Option<Instant>,
}

impl Terminal {
    /// Takes the terminal over.
    pub(crate) fn take() -> Result<Self, Failure> {
        let terminal =
            ratatui::try_init().map_err(|e| format!("the terminal cannot be taken over ({e}); expected one, or --plain"))?;
        Ok(Self { terminal: Some(terminal), ink: Ink::of_environment(), drawn: None })
    }

    /// Keys that were pressed since the last time. A terminal that is gone presses none more and says so.
    pub(crate) fn keys(&mut self) -> Result<Vec<KeyEvent>, Failure> {
        let mut keys = Vec::new();
        while !is_gone()? && event::poll(Duration::ZERO)? {
            match event::read()? {
                Event::Key(key) => keys.push(key),
                Event::Resize(..) => self.drawn = None,
                _ => {}
            }
        }
        Ok(keys)
    }

    /// Draws, when it is time for a picture or `now`.
    pub(crate) fn show(&mut self, screen: &Screen, now: bool) -> Result<(), Failure> {
        if !now && self.drawn.is_some_and(|at| at.elapsed() < PICTURE) {
            return Ok(());
        }
        let ink = self.ink;
        if let Some(terminal) = &mut self.terminal {
            terminal.draw(|frame| draw(frame, screen, ink))?;
        }
        self.drawn = Some(Instant::now());
        Ok(())
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        if ratatui::try_restore().is_err() {
            // It is gone: there is nothing to give back, and nobody to tell. Its own end would try to, and panic before the motor is stopped.
            std::mem::forget(self.terminal.take());
        }
    }
}
