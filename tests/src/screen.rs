//! A program on a terminal of a given size, with fingers on its keys and eyes on its screen.
//!
//! What it is: a pseudo-terminal whose screen is kept by a terminal emulator (crate vt100), so that a test reads what a person would.
//! What can go wrong: words that never come; the panic shows the screen.
//! Units: characters; real time.
//! Reference: ECMA-48.

use crate::quadrig;
use rustix::fs::{Mode, OFlags, open};
use rustix::termios::{Winsize, tcsetwinsize};
use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use virtual_board::Cable;

/// A program and its terminal.
pub struct Screen {
    child: Child,
    cable: Cable,
    parser: vt100::Parser,
}

impl Screen {
    /// Starts the command line on a terminal of so many columns and rows.
    ///
    /// # Panics
    /// When the system gives no pseudo-terminal.
    #[must_use]
    pub fn start(folder: &Path, words: &[&str], size: (u16, u16)) -> Self {
        let mut command = Command::new(quadrig());
        command.args(words);
        Self::with(command, folder, size)
    }

    /// Starts a command.
    ///
    /// # Panics
    /// When the system gives no pseudo-terminal, or the command cannot be started.
    #[must_use]
    pub fn with(mut command: Command, folder: &Path, (columns, rows): (u16, u16)) -> Self {
        let (cable, name) = Cable::new().expect("a pseudo-terminal");
        let end = || File::from(open(name.as_str(), OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).expect("its other end"));
        tcsetwinsize(end(), Winsize { ws_row: rows, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 }).expect("a size");
        let child = command
            .current_dir(folder)
            .env("TERM", "xterm-256color")
            .env("LC_ALL", "C.UTF-8")
            .env_remove("NO_COLOR")
            .stdin(Stdio::from(end()))
            .stdout(Stdio::from(end()))
            .stderr(Stdio::from(end()))
            .spawn()
            .expect("it starts");
        Self { child, cable, parser: vt100::Parser::new(rows, columns, 0) }
    }

    /// What stands on the screen now.
    #[must_use]
    pub fn text(&mut self) -> String {
        let mut bytes = [0; 65_536];
        loop {
            let heard = self.cable.hear(&mut bytes);
            if heard == 0 {
                return self.parser.screen().contents();
            }
            self.parser.process(&bytes[..heard]);
        }
    }

    /// Waits until `words` stand on the screen.
    ///
    /// # Panics
    /// When they do not come within twenty seconds.
    #[track_caller]
    pub fn until(&mut self, words: &str) -> String {
        self.until_within(words, Duration::from_secs(20))
    }

    /// The same, for as long as it may take.
    ///
    /// # Panics
    /// When they do not come in that time.
    #[track_caller]
    pub fn until_within(&mut self, words: &str, patience: Duration) -> String {
        let begun = Instant::now();
        loop {
            let text = self.text();
            if text.contains(words) {
                return text;
            }
            assert!(begun.elapsed() < patience, "no {words:?} on\n{text}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Presses keys, one after the other.
    pub fn press(&mut self, keys: &str) {
        self.cable.say(keys.as_bytes());
    }

    /// Sends a signal, by its name.
    ///
    /// # Panics
    /// When there is no `kill`.
    pub fn signal(&self, name: &str) {
        let sent = Command::new("kill").args([&format!("-{name}"), &self.child.id().to_string()]).status();
        assert!(sent.expect("kill").success());
    }

    /// The terminal goes away, as with an ssh connection that breaks, and the program ends.
    ///
    /// # Panics
    /// When it does not end within ten seconds.
    #[track_caller]
    pub fn hang_up(mut self) {
        self.cable = Cable::new().expect("a pseudo-terminal").0;
        let begun = Instant::now();
        while self.child.try_wait().expect("a child").is_none() {
            assert!(begun.elapsed() < Duration::from_secs(10), "it does not end");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits for the end; gives the status, and what was said after the screen was given back.
    ///
    /// # Panics
    /// When it does not end within twenty seconds.
    #[track_caller]
    pub fn end(mut self) -> (ExitStatus, String) {
        let begun = Instant::now();
        loop {
            let text = self.text(); // a full terminal would hold it up
            if let Some(status) = self.child.try_wait().expect("a child") {
                let rest = self.text();
                assert!(!self.parser.screen().alternate_screen(), "the terminal was given back");
                return (status, rest);
            }
            assert!(begun.elapsed() < Duration::from_secs(20), "it does not end:\n{text}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.child.kill(); // a test that fails leaves no program behind
        let _ = self.child.wait();
    }
}
