//! A pseudo-terminal in the place of a serial port.
//!
//! What it is: the master side, which the board holds; other programs open the other side by its name.
//! What can go wrong: a cable to which nobody listens loses what is said, as a serial line does.
//! Units: bytes.
//! Reference: POSIX.1-2024, `posix_openpt`.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::fs::File;
use std::io::{Read, Write};

/// The master side of a pseudo-terminal. No program that is started inherits it (it is opened close-on-exec): a port whose master
/// some child still holds never goes away.
#[derive(Debug)]
pub struct Cable {
    master: File,
}

impl Cable {
    /// A new pseudo-terminal in raw mode and the name of its other side.
    ///
    /// # Errors
    /// When the system gives none.
    pub fn new() -> std::io::Result<(Self, String)> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let name = ptsname(&master, Vec::new())?.to_string_lossy().into_owned();
        let slave = open(name.as_str(), OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        let mut terminal = tcgetattr(&slave)?;
        terminal.make_raw(); // or the line would echo what the board says before a program has opened it
        tcsetattr(&slave, OptionalActions::Now, &terminal)?;
        fcntl_setfl(&master, fcntl_getfl(&master)? | OFlags::NONBLOCK)?;
        Ok((Self { master: master.into() }, name))
    }

    /// Some program has the port open.
    #[must_use]
    pub fn is_open(&self) -> bool {
        let mut asked = [PollFd::new(&self.master, PollFlags::IN)];
        poll(&mut asked, Some(&Timespec::default())).is_ok() && !asked[0].revents().contains(PollFlags::HUP)
    }

    /// What the other side has sent.
    pub fn hear(&mut self, bytes: &mut [u8]) -> usize {
        self.master.read(bytes).unwrap_or(0) // nothing there, or nobody: both are silence
    }

    /// Sends bytes; `false` when they were lost, as on a cable to which nobody listens.
    pub fn say(&mut self, bytes: &[u8]) -> bool {
        self.is_open() && self.master.write_all(bytes).is_ok()
    }
}
