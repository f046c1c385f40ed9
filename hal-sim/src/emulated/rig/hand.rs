//! Who sits at the host of the emulated rig: what they can do, and what they learn.
//!
//! What it is: actions of a hand or of the host, and the [`Operator`] that chooses them, millisecond by millisecond.
//! What can go wrong: nothing here; an action that the rig cannot take is ignored by the rig.
//! Units: on each item.
//! Reference: `docs/rig.md`.

use crate::bench::Truth;
use crate::fault::{Mishap, Plan};
use crate::sensor::EscWire;
use frame::message::{Beep, Command, Message};

/// What an operator does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action {
    /// Sends a command to the board.
    Send(Command),
    /// Throws the ESC's power switch.
    Power(bool),
    /// Opens the stop loop by its key (true), or closes it again.
    StopKey(bool),
    /// Unplugs the stop loop's wire, for good.
    UnplugStop,
    /// A stop by key or by command so many nanoseconds before a pulse or a frame starts: the next that is far enough away.
    StopBeforePulse {
        /// By key; otherwise a command whose first bit leaves the host at that instant.
        key: bool,
        /// Time before the start of the pulse, ns.
        ns: u64,
    },
    /// Presses the board's reset key.
    Reset,
    /// The board's supply fails at so many stores to its flash from now, and comes back a little later: a reset.
    FailAtStore(u32),
    /// The run of the schedule begins: effects count their time from here.
    StartRun,
    /// The crystal stops oscillating.
    FailCrystal,
    /// The DMA misses a conversion.
    OverrunAdc,
    /// An input of the capture timer (channel 0 to 3) gets an edge in every microsecond, for so many milliseconds.
    Scream {
        /// Channel, from 0.
        channel: u8,
        /// How long, ms.
        ms: u64,
    },
    /// The core's next look at the stop key's port ends in a bus error.
    FailAccess,
    /// Each DShot frame reaches the ESC with one bit turned over (true), or as it is again.
    GarbleFrames(bool),
    /// Something goes wrong at the pins, and stays so: as it would on the rig that leaves the factory.
    Mishap(Mishap),
    /// The ESC was on and ready before the board.
    EscReady,
    /// The rotor turns the other way round, as channel B of the encoder shows it.
    Backwards(bool),
    /// Hangs a mass on the load cell, gram; 0 takes it off.
    Hang(f64),
    /// Twists the torque arm, N.m; 0 lets it go.
    Twist(f64),
    /// Draws a current through the shunt with a load of one's own, A; 0 takes it off.
    Draw(f64),
    /// Sets the bench supply, V.
    Supply(f64),
    /// Something becomes of the line of the ESC's telemetry.
    EscWire(EscWire),
    /// Pulls a plug (capture channels first, then analogue ones, the ESC's telemetry, the back-EMF meter), or puts it back.
    Plug {
        /// Which.
        plug: usize,
        /// Out.
        out: bool,
    },
}

/// What an operator learns in a millisecond.
#[allow(clippy::large_enum_variant, reason = "looked at and dropped within the millisecond, never stored in numbers")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Heard {
    /// The board sent a message.
    Board(Message),
    /// The ESC beeped.
    Esc(Beep),
}

/// Who sits at the host.
pub trait Operator: Send {
    /// Called every millisecond; does something by pushing onto `actions`.
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>);

    /// Called every millisecond with the bytes that the board has sent since; what is pushed onto `say` goes to the board as it is.
    fn line(&mut self, _heard: &[u8], _say: &mut Vec<u8>) {}

    /// Called every millisecond with what is really there.
    fn see(&mut self, _truth: &Truth) {}

    /// Called after a millisecond in which the board stored something, with what its settings' sectors hold now.
    fn stored(&mut self, _sectors: &[u8]) {}

    /// Called every millisecond: a plan whose mishap comes now, and stays.
    fn strikes(&mut self) -> Option<Plan> {
        None
    }

    /// Whether messages and truth are kept for [`RigRun`]: whoever plays for hours has no room for them.
    fn keeps_record(&self) -> bool {
        true
    }

    /// Whether the board is switched off now, before its time.
    fn is_over(&self) -> bool {
        false
    }
}
