//! The rigs of a campaign: the presets and drawn subsets of channels, with drawn limits and rates.
//!
//! What it is: a configuration for each plan, and what a kind of mishap needs fitted, or not fitted.
//! What can go wrong: a configuration that the board would refuse is a mistake of this file; a test draws many.
//! Units: those of [`RigConfig`].
//! Reference: specification `rig.md`, "Partial rigs are normal"; `examples/rig/`.

use super::{Mishap, Request};
use crate::noise::Stream;
use crate::scenario::Scenario;
use esc_pwm::Bounds;
use firmware_rig::rig_config::Answers;
use firmware_rig::{Config, RigConfig};
use frame::units::{Ampere, Celsius, Newton, NewtonMetre, PulseWidth, RevPerMin, Volt};

/// Where a rig comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Preset {
    /// Everything fitted.
    Thesis,
    /// The beam alone.
    BeamOnly,
    /// The load cell alone.
    LoadCellOnly,
    /// Three blades, beam and reflective sensor, load cell and torque; an ESC that beeps no cells.
    ThreeBlade,
    /// Hall sensor, load cell, current and supply.
    HallOnly,
    /// A drawn subset.
    Drawn,
}

/// Marks of the thesis' sensors.
const MARKS: [u16; 4] = [2, 1, 2, 25];
/// Times between two samples, ms.
const LOGS: [u16; 8] = [10, 20, 50, 100, 100, 100, 200, 1000];

impl Preset {
    /// One of them: the thesis' rig and drawn ones more often.
    pub(super) fn draw(draw: &mut Stream) -> Self {
        match (draw.uniform() * 12.0) as u8 {
            0..=2 => Self::Thesis,
            3 => Self::BeamOnly,
            4 => Self::LoadCellOnly,
            5 => Self::ThreeBlade,
            6 => Self::HallOnly,
            _ => Self::Drawn,
        }
    }

    /// The scenario in front of it.
    #[must_use]
    pub fn scenario(self, seed: u64) -> Scenario {
        let propeller = if self == Self::ThreeBlade { "9x4.5x3" } else { "11x4.7" };
        Scenario { seed, propeller: propeller.to_owned(), ..Scenario::default() }
    }

    /// Its configuration, with limits drawn.
    pub(super) fn config(self, draw: &mut Stream) -> RigConfig {
        let mut config = RigConfig::of(&Config::thesis_570kv());
        let mut some = || draw.uniform() < 0.6;
        let [_, one, two, many] = MARKS;
        (config.marks, config.fitted) = match self {
            Self::Thesis => (MARKS, [true; 5]),
            Self::BeamOnly => ([2, 0, 0, 0], [false; 5]),
            Self::LoadCellOnly => ([0; 4], [true, false, false, false, false]),
            Self::ThreeBlade => ([3, one, 0, 0], [true, true, false, false, false]),
            Self::HallOnly => ([0, 0, two, 0], [true, false, true, true, false]),
            Self::Drawn => {
                let drawn = MARKS.map(|marks| if some() { marks } else { 0 });
                let fitted = [(); 5].map(|()| some());
                let empty = drawn == [0; 4] && fitted == [false; 5];
                (if empty { [0, 0, 0, many] } else { drawn }, fitted)
            }
        };
        config.live_zero = [true, true, true, false, true];
        if self == Self::ThreeBlade {
            config.esc.answers = Answers::LongReady;
            config.esc.highest = PulseWidth::from_us(1950);
        }
        let ms = |draw: &mut Stream, low: f64, high: f64| draw.log_between(low, high) as u16;
        config.log_period_ms = LOGS[((draw.uniform() * LOGS.len() as f64) as usize).min(LOGS.len() - 1)];
        config.link_ms = ms(draw, 700.0, 2500.0);
        let limits = &mut config.limits;
        limits.speed = Bounds { low: None, high: Some(RevPerMin(10_000.0)), ms: ms(draw, 5.0, 20.0) };
        limits.thrust.ms = ms(draw, 20.0, 300.0);
        limits.current.ms = ms(draw, 20.0, 300.0);
        limits.voltage.ms = ms(draw, 20.0, 300.0);
        if draw.uniform() < 0.5 {
            let (low, high) = (Some(NewtonMetre(-0.3)), Some(NewtonMetre(0.3)));
            limits.torque = Bounds { low, high, ms: ms(draw, 20.0, 300.0) };
        }
        if draw.uniform() < 0.5 {
            limits.voltage.high = Some(Volt(13.0));
        }
        if draw.uniform() < 0.5 {
            let (low, high) = (Some(Celsius(-10.0)), Some(Celsius(60.0)));
            limits.temperature = Bounds { low, high, ms: ms(draw, 50.0, 1500.0) };
        }
        config
    }
}

/// Fits what `mishap` needs, and takes off what it needs away. Says whether anything was changed.
pub(super) fn fit(mishap: Mishap, config: &mut RigConfig) -> bool {
    let before = *config;
    let lines = mishap.lines();
    let away = matches!(mishap, Mishap::FloatingLine { .. });
    for (n, (marks, full)) in config.marks.iter_mut().zip(MARKS).enumerate().filter(|(n, _)| lines >> n & 1 == 1) {
        match (away, n) {
            (true, _) => *marks = 0,
            (false, _) if *marks == 0 => *marks = full,
            _ => {}
        }
    }
    if let Mishap::Uneven { channel: 0 } = mishap {
        config.marks[0] = 2;
    }
    let limits = &mut config.limits;
    match mishap {
        Mishap::Saturated { channel, .. } | Mishap::Contact { channel } => config.fitted[usize::from(channel)] = true,
        Mishap::FloatingInput { channel } => config.fitted[usize::from(channel)] = false,
        Mishap::Asked(Request::Tare) => config.fitted[0] = true,
        Mishap::Overload { .. } => {
            // within what the amplifier can show between its rails
            config.fitted[0] = true;
            limits.thrust = Bounds { low: Some(Newton(-5.5)), high: Some(Newton(4.5)), ..limits.thrust };
        }
        Mishap::Twist { .. } => {
            config.fitted[1] = true;
            let (low, high) = (Some(NewtonMetre(-0.3)), Some(NewtonMetre(0.3)));
            limits.torque = Bounds { low, high, ..limits.torque };
        }
        Mishap::OverCurrent => {
            config.fitted[2] = true;
            limits.current.high = Some(Ampere(30.0));
        }
        Mishap::Supply { high: true } => limits.voltage.high = Some(Volt(13.0)),
        Mishap::Temperature { .. } => {
            config.fitted[4] = true;
            let (low, high) = (Some(Celsius(-10.0)), Some(Celsius(60.0)));
            limits.temperature = Bounds { low, high, ms: limits.temperature.ms.min(500) };
        }
        Mishap::NoConversions | Mishap::Gap if config.fitted == [false; 5] => config.fitted[0] = true,
        Mishap::Overspeed => {
            limits.speed.high = Some(RevPerMin(4000.0));
            limits.torque = Bounds::NONE; // what speeds the rotor up reacts on the arm
            if config.marks == [0; 4] {
                config.marks[2] = MARKS[2];
            }
        }
        Mishap::NotIdle => config.fitted[2] = true,
        Mishap::EscMute => config.esc.hold_min_ms = 1500,
        Mishap::Echo => config.log_period_ms = config.log_period_ms.min(100),
        _ => {}
    }
    // nothing at all is no rig
    if config.marks == [0; 4] && config.fitted == [false; 5] {
        match mishap {
            Mishap::FloatingInput { channel: 0 } => config.fitted[4] = true,
            _ => config.fitted[0] = true,
        }
    }
    *config != before
}

/// Fits what the range calibration needs: a measured supply, and somebody who sees the rotor turn.
pub(super) fn fit_calibration(config: &mut RigConfig) {
    config.fitted[3] = true;
    if config.marks == [0; 4] && !config.fitted[2] {
        config.marks[0] = MARKS[0];
    }
}

#[cfg(test)]
mod tests {
    use super::super::Plan;

    #[test]
    fn every_drawn_configuration_is_one_that_the_board_takes() {
        for seed in 0..20_000 {
            let plan = Plan::of(seed);
            assert!(plan.config.in_range(), "{plan:?}");
        }
    }
}
