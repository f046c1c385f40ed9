//! One flight of a campaign: kind, time, rig and throttle, all drawn from a seed.
//!
//! What it is: [`Plan::of`]: kinds follow one another, so that any run of as many seeds as there are kinds holds each; all else is drawn.
//! What can go wrong: nothing here fails.
//! Units: ms, us.
//! Reference: specification `rig.md`, "The simulator" (faults at any time).

use super::rig::{Preset, fit, fit_calibration};
use super::{Mishap, Request};
use crate::noise::{Source, Stream};
use firmware_rig::RigConfig;

/// Where the rig stands when the mishap comes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Phase {
    /// It has just been switched on.
    Start,
    /// Disarmed.
    Resting,
    /// Waiting for the ESC's first answer.
    Arming,
    /// Armed, at minimum.
    Armed,
    /// Running at a steady level.
    Running,
    /// Running while the throttle changes.
    Moving,
    /// The range calibration holds maximum.
    Holding,
}

impl Phase {
    /// Its name.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Start => "at power-on",
            Self::Resting => "disarmed",
            Self::Arming => "while arming",
            Self::Armed => "armed",
            Self::Running => "at a level",
            Self::Moving => "under a moving throttle",
            Self::Holding => "while maximum is held",
        }
    }

    /// The throttle is open.
    #[must_use]
    pub const fn is_live(self) -> bool {
        matches!(self, Self::Running | Self::Moving | Self::Holding)
    }
}

/// What the throttle does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Course {
    /// One level by the manual setting.
    Level,
    /// Other levels by the manual setting.
    Steps,
    /// A straight line up.
    Ramp,
    /// A swept sine.
    Chirp,
    /// Segments of the host.
    Segments,
}

/// One run with one mishap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan {
    /// Seed of everything random in it.
    pub seed: u64,
    /// The mishap.
    pub mishap: Mishap,
    /// When it comes.
    pub phase: Phase,
    /// From the beginning of that phase to the mishap, ms.
    pub after_ms: u64,
    /// What the throttle does.
    pub course: Course,
    /// Level of the run, us.
    pub pulse_us: u32,
    /// Where the rig comes from.
    pub rig: Preset,
    /// What it is.
    pub config: RigConfig,
    /// The ESC is switched on and answers by its beeps; otherwise it was ready before the board.
    pub dialogue: bool,
    /// A share that the kind may use, 0..1.
    pub share: f64,
}

/// Phases in which a kind is flown.
fn phases(mishap: Mishap) -> &'static [Phase] {
    use Phase::{Armed, Arming, Holding, Moving, Resting, Running, Start};
    const ANYWHERE: &[Phase] = &[Resting, Arming, Armed, Running, Running, Moving, Moving, Holding];
    match mishap {
        Mishap::StopHeld | Mishap::CrystalDead | Mishap::EscMute | Mishap::OpenSense => &[Start],
        Mishap::SaveCut => &[Resting],
        Mishap::Echo => &[Resting, Armed, Running, Moving],
        Mishap::RotorTurns { .. } | Mishap::NotIdle | Mishap::Unheard => &[Holding],
        Mishap::Nothing | Mishap::FloatingLine { .. } | Mishap::FloatingInput { .. } => &[Armed, Running, Moving, Moving],
        Mishap::EscNoSignal | Mishap::EscFails => &[Arming, Armed, Running],
        Mishap::Asked(Request::Stop) => ANYWHERE,
        Mishap::Asked(_) => &[Running, Moving],
        Mishap::CorruptFrames
        | Mishap::OneCorrupt
        | Mishap::Garbage
        | Mishap::Partial { .. }
        | Mishap::Replay
        | Mishap::Silence
        | Mishap::LateHost
        | Mishap::SupplyDip
        | Mishap::PowerLoss
        | Mishap::ResetKey
        | Mishap::LateTick { .. }
        | Mishap::Hang
        | Mishap::Panic
        | Mishap::HardFault
        | Mishap::CrystalFails
        | Mishap::StopOpen
        | Mishap::StopBlink => ANYWHERE,
        Mishap::NoConversions | Mishap::Gap | Mishap::OverCurrent => &[Running, Moving, Holding],
        Mishap::Saturated { .. }
        | Mishap::Contact { .. }
        | Mishap::Overload { .. }
        | Mishap::Temperature { .. }
        | Mishap::StuckLine { .. }
        | Mishap::Overwritten { .. }
        | Mishap::TwoFast { .. } => &[Running, Running, Moving],
        _ => &[Running],
    }
}

impl Plan {
    /// The plan of a seed.
    #[must_use]
    pub fn of(seed: u64) -> Self {
        let kinds = Mishap::all();
        Self::with(seed, kinds[(seed % kinds.len() as u64) as usize])
    }

    /// The plan of a seed for a given kind.
    #[must_use]
    pub fn with(seed: u64, mishap: Mishap) -> Self {
        let mut draw = Stream::new(seed, Source::Phase, 77);
        let mishap = match mishap {
            Mishap::LateTick { .. } => Mishap::LateTick { ms: 6 + (draw.uniform() * 8.0) as u8 },
            other => other,
        };
        let list = phases(mishap);
        let phase = list[((draw.uniform() * list.len() as f64) as usize).min(list.len() - 1)];
        let mut rig = Preset::draw(&mut draw);
        let mut config = rig.config(&mut draw);
        let mut changed = fit(mishap, &mut config);
        if phase == Phase::Holding || mishap == Mishap::OpenSense {
            let before = config;
            fit_calibration(&mut config);
            changed |= config != before;
        }
        // three blades stay three
        if changed && (rig != Preset::ThreeBlade || config.marks[0] != 3) {
            rig = Preset::Drawn;
        }
        let moving = [Course::Steps, Course::Ramp, Course::Chirp, Course::Segments];
        let drawn = moving[((draw.uniform() * 4.0) as usize).min(3)];
        let course = match (phase, mishap) {
            (_, Mishap::StreamDry) => Course::Segments,
            // one that was sent is there
            (Phase::Moving, Mishap::Asked(Request::Schedule)) if drawn == Course::Segments => Course::Chirp,
            (Phase::Moving, _) => drawn,
            _ => Course::Level,
        };
        let (low, high) = if mishap == Mishap::Overspeed { (1180.0, 1280.0) } else { (1200.0, 1700.0) };
        let pulse_us = draw.between(low, high) as u32;
        let after_ms = match phase {
            Phase::Running | Phase::Moving => draw.between(520.0, 800.0),
            Phase::Start => 0.0,
            _ => draw.between(20.0, 250.0),
        } as u64;
        let dialogue = phase == Phase::Holding || mishap == Mishap::EscMute || draw.uniform() < 0.1;
        Self { seed, mishap, phase, after_ms, course, pulse_us, rig, config, dialogue, share: draw.uniform() }
    }

    /// The kind on the rig as the board leaves the factory, at a level where it can come there.
    #[must_use]
    pub fn factory(mishap: Mishap) -> Self {
        let mut config = RigConfig::of(&firmware_rig::Config::thesis_570kv());
        fit(mishap, &mut config);
        let list = phases(mishap);
        let phase = list.iter().copied().find(|phase| *phase == Phase::Running).unwrap_or(list[0]);
        Self { phase, config, rig: Preset::Thesis, ..Self::with(0, mishap) }
    }

    /// What it is, in a line.
    #[must_use]
    pub fn words(&self) -> String {
        let Self { seed, mishap, phase, after_ms, course, pulse_us, rig, config, .. } = self;
        let (marks, fitted) = (config.marks, config.fitted.map(u8::from));
        format!(
            "seed {seed}: {} {}, {after_ms} ms on, {course:?} of {pulse_us} us, {rig:?} rig with marks {marks:?} and inputs {fitted:?}",
            mishap.words(),
            phase.words()
        )
    }
}
