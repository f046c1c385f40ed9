//! The sections of a mission file about what is aboard: the IMU board, the controller and its way, what fails.
//!
//! What it is: one type a TOML table, each with its defaults.
//! What can go wrong: a value out of its range, a rotor that is not there, way points that do not follow each other are refused.
//! Units: each key carries its own.
//! Reference: `docs/mission.md`.

use crate::flight::Gains;
use crate::flight::Vector;
use crate::flight::autopilot::SetPoint;
use crate::imu::Motion;
use crate::number::not_negative;
use serde::{Deserialize, Deserializer, de::Error};
use toml::Spanned;

/// Errors of the board's chips.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Chips {
    /// None but the length of their words.
    Ideal,
    /// As the data sheets allow them, with what a calibration leaves of accelerometer and magnetometer: a twentieth.
    Calibrated,
    /// As the data sheets allow them.
    Drawn,
}

/// The IMU board.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImuSection {
    /// Errors of its chips, drawn from the mission's seed.
    pub chips: Chips,
    /// How long it has been on, at rest, when the flight begins, s.
    #[serde(deserialize_with = "not_negative")]
    pub rest_s: f64,
    /// Place of the board, body axes, m.
    pub lever_m: [f64; 3],
    /// Magnetic field, earth axes, uT.
    pub field_ut: [f64; 3],
    /// Imbalance of each rotor, g.mm.
    #[serde(deserialize_with = "not_negative")]
    pub imbalance_gmm: f64,
    /// Amplitude of the thrust at the pass of the blades, as a share of it.
    #[serde(deserialize_with = "not_negative")]
    pub blade_pass: f64,
}

impl Default for ImuSection {
    fn default() -> Self {
        Self {
            chips: Chips::Calibrated,
            rest_s: 120.0,
            lever_m: [0.0; 3],
            field_ut: Motion::LEVEL.field.map(|gauss| 100.0 * gauss),
            imbalance_gmm: 1.0,
            blade_pass: 0.02,
        }
    }
}

/// The controller.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ControllerSection {
    /// Its gains.
    pub gains: Gains,
    /// The way: places and when to be there.
    #[serde(deserialize_with = "way")]
    pub way: Vec<WayPoint>,
    /// What the positioning system is off by.
    pub positioning: PositioningSection,
}

/// A place on the way; between two of them the set point moves evenly.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WayPoint {
    /// When, s.
    pub at_s: f64,
    /// North of the start, m.
    #[serde(default)]
    pub north_m: f64,
    /// East of the start, m.
    #[serde(default)]
    pub east_m: f64,
    /// Above ground, m.
    pub up_m: f64,
    /// Heading, deg.
    #[serde(default)]
    pub heading_deg: f64,
}

/// The positioning system that tells the controller place and velocity: the truth with white noise.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PositioningSection {
    /// Readings a second.
    #[serde(deserialize_with = "rate")]
    pub rate_hz: u32,
    /// Standard deviation of the place along each axis, m.
    #[serde(deserialize_with = "not_negative")]
    pub place_m: f64,
    /// Standard deviation of the velocity along each axis, m/s.
    #[serde(deserialize_with = "not_negative")]
    pub velocity_m_s: f64,
}

impl Default for PositioningSection {
    fn default() -> Self {
        Self { rate_hz: 50, place_m: 0.02, velocity_m_s: 0.05 }
    }
}

/// Something that fails in flight and stays so: one rotor, which gets no pulse any more, or one chip of the IMU board, which leaves the bus.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailureSection {
    /// When, s.
    pub at_s: Spanned<f64>,
    /// Which rotor, from 1.
    pub rotor: Option<Spanned<usize>>,
    /// Which chip.
    pub chip: Option<crate::scenario::Field>,
}

impl FailureSection {
    /// Whether its time is one, and whether it is one thing that fails; else where and what was expected.
    pub(super) fn sound(&self) -> Result<(), (usize, &'static str)> {
        let begins = self.at_s.span().start;
        if !(self.at_s.get_ref().is_finite() && *self.at_s.get_ref() > 0.0) {
            return Err((begins, "expected a time above 0 s"));
        }
        if self.rotor.is_some() == self.chip.is_some() {
            return Err((begins, "expected either a rotor or a chip beside it"));
        }
        Ok(())
    }
}

impl ControllerSection {
    /// Where to be at a time; `None` before the first place and without one.
    #[must_use]
    pub fn set_point(&self, t_s: f64) -> Option<SetPoint> {
        let next = self.way.partition_point(|w| w.at_s <= t_s);
        let before = self.way.get(next.checked_sub(1)?)?;
        let after = self.way.get(next).unwrap_or(before);
        let place = |w: &WayPoint| Vector::new(w.north_m, w.east_m, -w.up_m);
        let span = after.at_s - before.at_s;
        let share = if span > 0.0 { (t_s - before.at_s) / span } else { 0.0 };
        let (from, to) = (place(before), place(after));
        let turn = (after.heading_deg - before.heading_deg).to_radians();
        Some(SetPoint {
            place: from + (to - from) * share,
            velocity: if span > 0.0 { (to - from) / span } else { Vector::zeros() },
            heading: before.heading_deg.to_radians() + share * turn,
        })
    }
}

fn way<'de, D: Deserializer<'de>>(d: D) -> Result<Vec<WayPoint>, D::Error> {
    let way = Vec::<WayPoint>::deserialize(d)?;
    if way.is_empty() {
        return Err(D::Error::custom("expected at least one place, found none"));
    }
    match way.windows(2).find(|w| w[1].at_s <= w[0].at_s) {
        Some(w) => Err(D::Error::custom(format!("expected a time after {} s, found {}", w[0].at_s, w[1].at_s))),
        None => Ok(way),
    }
}

fn rate<'de, D: Deserializer<'de>>(d: D) -> Result<u32, D::Error> {
    let rate = u32::deserialize(d)?;
    if rate > 0 && 1000 % rate == 0 {
        Ok(rate)
    } else {
        Err(D::Error::custom(format!("expected a rate from 1 to 1000 Hz that divides 1000, found {rate}")))
    }
}
