//! The IMU board on its body, and nobody at it.
//!
//! What it is: the firmware's console with what stands around it on the board: sampler and bus, the line in both directions, the flash, and the idle
//! loop, whose work is done between two ticks. One call a tick; a host says bytes and hears bytes.
//! What can go wrong: nothing here fails. Fits and flash take no time here: on the board an erase costs it a second of ticks.
//! Units: ns since power-up; bytes.
//! Reference: `firmware-ahrs/src/main.rs`, whose tasks this stands for; house rule 12 (one shell, many hosts).

use super::ahrs::{CORE_HZ, ImuRig, TICK_NS};
use super::board::POWER_ON;
use super::sectors::Sectors;
use crate::clock::VirtualClock;
use crate::imu::I2cBus;
use firmware_ahrs::console::Asked;
use firmware_ahrs::{Ahrs, AhrsConfig, CommandLine, Console, Done, Inputs, Job, Sampler, text};
use frame::message::ClockNews;
use frame::units::Ticks;
use frame::wire::{Encoder, MAX_WIRE};
use frame::{Event, ImuFormat, Message};

/// The crystal of a board on a desk, Hz.
const CRYSTAL: ClockNews = ClockNews { crystal_hz: 8_000_000, measured_hz: 8_000_000 };

/// The board's sending half.
#[derive(Debug, Default)]
struct Outgoing {
    encoder: Encoder,
    bytes: Vec<u8>,
    /// What went before is no whole frame: a zero ends it for the receiver.
    ragged: bool,
}

impl Outgoing {
    fn send(&mut self, now: Ticks, format: ImuFormat, message: &Message) {
        match format {
            ImuFormat::Binary => {
                if core::mem::take(&mut self.ragged) {
                    self.bytes.push(0);
                }
                let mut wire = [0; MAX_WIRE];
                if let Ok(used) = self.encoder.encode(now, message, &mut wire) {
                    self.bytes.extend(wire.iter().take(used));
                }
            }
            ImuFormat::Text => {
                self.ragged = true;
                self.bytes.extend(text::line(message).iter().flat_map(|line| line.bytes()));
            }
        }
    }
}

/// The IMU board on its body.
pub struct ImuDesk {
    clock: VirtualClock,
    sampler: Sampler<I2cBus>,
    console: Console,
    line: CommandLine,
    outgoing: Outgoing,
    sectors: Sectors,
    saves: u32,
    waiting: Option<Job>,
    ticks: u64,
}

impl ImuDesk {
    /// The board of `rig`, switched on with these sectors in its flash.
    #[must_use]
    pub fn new(rig: &ImuRig, mut sectors: Sectors) -> Self {
        let clock = VirtualClock::default();
        let bus = I2cBus::new(clock.clone(), &rig.fitted, rig.body(), &rig.errors, rig.fault).with(&rig.hidden).forgetful();
        let sampler = Sampler::new(bus);
        let hello = Ahrs::hello(CORE_HZ, POWER_ON, sampler.alive());
        let (found, news) = settings_store::load(&mut sectors, Sectors::RANGE);
        let console = Console::new(AhrsConfig::default(), hello, found);
        let mut outgoing = Outgoing { ragged: true, ..Outgoing::default() };
        let now = clock.ticks();
        console.greet(news, &mut |format, message| outgoing.send(now, format, message));
        console.announce(Event::Clock(CRYSTAL), &mut |format, message| outgoing.send(now, format, message));
        Self { clock, sampler, console, line: CommandLine::new(), outgoing, sectors, saves: 0, waiting: None, ticks: 0 }
    }

    /// Time since power-up, ns.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.ticks * TICK_NS
    }

    /// One tick of the sampling task, 5 ms after the one before, with the bytes that the host has said since; gives what reaches the host.
    #[must_use]
    pub fn tick(&mut self, heard: &[u8]) -> Vec<u8> {
        let done = self.waiting.take().map(|job| self.work(&job));
        self.ticks += 1;
        self.clock.advance_to(self.now_ns());
        let now = self.clock.ticks();
        let readings = self.sampler.read();
        heard.iter().for_each(|byte| self.line.take(*byte));
        let asked = Asked { heard: self.line.next_heard(), done, damaged: self.line.damaged(), cycles: 0 };
        let outgoing = &mut self.outgoing;
        let mut say = |format: ImuFormat, message: &Message| outgoing.send(now, format, message);
        self.waiting = self.console.tick(&Inputs { now, readings }, &asked, &mut say);
        core::mem::take(&mut outgoing.bytes)
    }

    /// What the idle loop does.
    fn work(&mut self, job: &Job) -> Done {
        self.saves += u32::from(matches!(job, Job::Save(_)));
        job.run(&mut self.sectors, Sectors::RANGE)
    }

    /// The settings' sectors, and how often something was stored in them.
    #[must_use]
    pub fn flash(&self) -> (&Sectors, u32) {
        (&self.sectors, self.saves)
    }
}
