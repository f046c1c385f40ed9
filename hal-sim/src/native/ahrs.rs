//! The native run of the IMU board: the portable sampler and tick over the simulated bus.
//!
//! What it is: identify and configure the chips, then every 5 ms one read of what is due, one [`Ahrs::tick`] and its telemetry through
//! the codec: what the flash image does, without the image.
//! What can go wrong: a chip that is absent, unplugged or held is what it is to the firmware; the run itself cannot fail.
//! Units: ns since power-up; ticks of 84 MHz.
//! Reference: specification `ahrs.md`, "Board"; house rule 1.

use crate::clock::VirtualClock;
use crate::imu::{Aboard, Body, BusFault, ChipKind, Errors, Hidden, I2cBus, Motion, Served};
use firmware_ahrs::{Ahrs, AhrsConfig, Inputs, Sampler, TICK_HZ};
use frame::message::{Hello, Message};
use frame::units::Ticks;
use frame::wire::{Encoder, MAX_WIRE};
use frame::{ImuSample, wire};

/// Time between two ticks, ns.
pub(super) const TICK_NS: u64 = 1_000_000_000 / TICK_HZ as u64;
/// Core clock that the board's greeting names, Hz.
pub(super) const CORE_HZ: u32 = 168_000_000;

/// What is on the bus and around it.
#[derive(Debug, Clone, PartialEq)]
pub struct ImuRig {
    /// How the body moves.
    pub motion: Motion,
    /// The vehicle that it rides on instead.
    pub aboard: Option<Aboard>,
    /// Chips that are fitted.
    pub fitted: Vec<ChipKind>,
    /// Their errors.
    pub errors: Errors,
    /// What acts on sensors and room and is not declared.
    pub hidden: Hidden,
    /// What goes wrong on the bus.
    pub fault: BusFault,
}

impl Default for ImuRig {
    /// Three ideal chips at rest.
    fn default() -> Self {
        Self {
            motion: Motion::LEVEL,
            aboard: None,
            fitted: ChipKind::ALL.to_vec(),
            errors: Errors::default(),
            hidden: Hidden::default(),
            fault: BusFault::None,
        }
    }
}

impl ImuRig {
    /// What the chips sit on.
    #[must_use]
    pub fn body(&self) -> Body {
        self.aboard.clone().map_or(Body::Alone(self.motion), Body::Aboard)
    }
}

/// What a run leaves behind.
#[derive(Debug, Clone, PartialEq)]
pub struct ImuRun {
    /// Every byte that the board sent.
    pub telemetry: Vec<u8>,
    /// Its greeting.
    pub hello: Hello,
    /// Its samples.
    pub samples: Vec<ImuSample>,
    /// What each chip handed out, in the order of [`ChipKind::ALL`].
    pub served: [Vec<Served>; 3],
    /// Clocks that a chip which held the data line has seen.
    pub clocks_seen: u32,
}

/// Runs the board for `milliseconds` after power-up.
///
/// # Errors
/// [`wire::EncodeError`] where a message does not fit its frame.
pub fn run(rig: &ImuRig, milliseconds: u64) -> Result<ImuRun, wire::EncodeError> {
    fly(rig, milliseconds, &mut |_| ())
}

/// The same; `progress` hears the share that is done.
///
/// # Errors
/// [`wire::EncodeError`] where a message does not fit its frame.
pub fn fly(rig: &ImuRig, milliseconds: u64, progress: &mut dyn FnMut(f64)) -> Result<ImuRun, wire::EncodeError> {
    let ticks: Vec<u64> = (1..).map(|k| k * TICK_NS).take_while(|at| *at < milliseconds * 1_000_000).collect();
    ticked(rig, &ticks, progress)
}

/// The same with ticks at given instants, ns since power-up.
///
/// # Errors
/// [`wire::EncodeError`] where a message does not fit its frame.
pub fn run_at(rig: &ImuRig, ticks: &[u64]) -> Result<ImuRun, wire::EncodeError> {
    ticked(rig, ticks, &mut |_| ())
}

fn ticked(rig: &ImuRig, ticks: &[u64], progress: &mut dyn FnMut(f64)) -> Result<ImuRun, wire::EncodeError> {
    let clock = VirtualClock::default();
    let bus = I2cBus::new(clock.clone(), &rig.fitted, rig.body(), &rig.errors, rig.fault).with(&rig.hidden);
    let mut sampler = Sampler::new(bus);
    let mut ahrs = Ahrs::new(AhrsConfig::default());
    let hello = Ahrs::hello(CORE_HZ, 0, sampler.alive());
    let mut line = Line::default();
    line.tell(clock.ticks(), &Message::Hello(hello))?;
    let mut samples = Vec::new();
    for (n, at) in ticks.iter().enumerate() {
        if n % 1000 == 0 {
            progress(n as f64 / ticks.len() as f64);
        }
        clock.advance_to(*at);
        let now = clock.ticks();
        let readings = sampler.read();
        if let Some(sample) = ahrs.tick(&Inputs { now, readings }).sample {
            line.tell(now, &Message::Imu(sample))?;
            samples.push(sample);
        }
    }
    let bus = sampler.release();
    let served = bus.served().map(<[Served]>::to_vec);
    Ok(ImuRun { telemetry: line.sent, hello, samples, served, clocks_seen: bus.clocks_seen() })
}

/// The serial line.
#[derive(Default)]
struct Line {
    encoder: Encoder,
    sent: Vec<u8>,
}

impl Line {
    fn tell(&mut self, now: Ticks, message: &Message) -> Result<(), wire::EncodeError> {
        let mut frame = [0; MAX_WIRE];
        let length = self.encoder.encode(now, message, &mut frame)?;
        self.sent.extend(frame.iter().take(length));
        Ok(())
    }
}
