//! What may be hidden in a flight.
//!
//! What it is: the listed effects, and some that no library entry describes, each with a strength, a direction and an instant of its own.
//! What can go wrong: strengths are scaled until the effect has its wanted size (`scenario`); a few have a size that their nature gives.
//! Units: stated at each.
//! Reference: specification `flight.md`, "The loop on flights".

use super::V;
use super::vehicle::Vehicle;
use crate::blind::chance::Chance;

/// Listed effects.
pub const LISTED: [&str; 21] = [
    "rotor_drag",
    "body_drag",
    "hub_moment",
    "translational_lift",
    "ground_effect",
    "wind",
    "supply_sag",
    "battery_discharge",
    "spinup_lag",
    "dead_rotor_speed",
    "rotor_gain",
    "mass_offset",
    "lever_arm",
    "vibration_rectification",
    "accelerometer_bias",
    "gyro_bias",
    "gyro_temperature",
    "g_sensitivity",
    "channel_delay",
    "current_induced_field",
    "hard_iron",
];

/// Effects that the library does not know.
pub const UNLISTED: [&str; 7] = [
    // a line to a point on the ground that pulls when it is tight
    "unknown_tether",
    // a load that swings below
    "unknown_slung",
    // all rotors lose thrust as they warm up
    "unknown_fade",
    // a force that comes and goes, in earth axes
    "unknown_gusts",
    // a side force from turning while moving
    "unknown_sideslip",
    // a moment about z in climbs
    "unknown_twist",
    // moments without order while it descends
    "unknown_wash",
];

/// One hidden effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Cause {
    /// Its name.
    pub id: &'static str,
    /// How strong; see `draw`.
    pub strength: f64,
    /// A rotor, or which group of sensors.
    pub which: usize,
    /// A direction of length one.
    pub along: V,
    /// When it sets in, s; before the flight where it is always there.
    pub t0: f64,
    /// A second number.
    pub other: f64,
}

impl Cause {
    /// Draws one with a usual strength for a vehicle and a flight of so many seconds.
    #[must_use]
    pub fn draw(id: &'static str, vehicle: &Vehicle, seconds: f64, k: &mut Chance) -> Self {
        let raw: V = [k.normal(), k.normal(), k.normal()];
        let along = super::times(1.0 / super::length(raw).max(1e-9), raw);
        let mut out = Self { id, strength: 1.0, which: k.of(&[0, 1, 2, 3]), along, t0: -1.0, other: 1.0 };
        match id {
            // 1/s: force over mass for each m/s
            "rotor_drag" => out.strength = k.log_between(0.1, 0.5),
            // 1/m
            "body_drag" => out.strength = k.log_between(0.01, 0.06),
            // rad/s^2 for each m/s
            "hub_moment" => out.strength = k.log_between(0.003, 0.03) * super::G / (0.3 * vehicle.arm),
            // share of the lift that inflow takes
            "translational_lift" => out.strength = k.log_between(0.5, 1.5),
            "ground_effect" => out.strength = k.log_between(0.6, 2.0),
            // m/s; the drag beside it is another cause
            "wind" => out.strength = k.log_between(1.5, 5.0),
            // shares of the voltage
            "supply_sag" => out.strength = k.log_between(0.02, 0.15),
            "battery_discharge" => out.strength = k.log_between(0.02, 0.12),
            // s
            "spinup_lag" => {
                out.strength = k.log_between(0.015, 0.07);
                out.other = k.log_between(0.7, 1.4);
            }
            "dead_rotor_speed" => {
                // a factor, or stuck (0)
                out.strength = k.of(&[0.5, 0.5, 2.0, 0.667, 0.0, 0.0]);
                out.t0 = if out.strength == 0.0 || k.happens(0.5) { k.between(0.2, 0.75) * seconds } else { -1.0 };
            }
            "rotor_gain" => {
                out.strength = k.log_between(0.03, 0.25);
                out.t0 = if k.happens(0.3) { k.between(0.25, 0.75) * seconds } else { -1.0 };
            }
            // m
            "mass_offset" => out.strength = k.log_between(0.01, 0.12) * vehicle.arm,
            "lever_arm" => out.strength = k.log_between(0.005, 0.05),
            // 1/(m/s^2)
            "vibration_rectification" => {
                out.strength = k.log_between(0.02, 0.3);
                out.other = k.between(1.2, 1.4);
            }
            "accelerometer_bias" => out.strength = k.log_between(0.02, 0.5),
            "gyro_bias" => out.strength = k.log_between(0.005, 0.1),
            "gyro_temperature" => out.strength = k.log_between(3e-4, 6e-3),
            "g_sensitivity" => out.strength = k.log_between(3e-4, 3e-3),
            // s
            "channel_delay" => {
                out.strength = k.log_between(0.004, 0.04);
                out.which = k.of(&[0, 1, 2]);
            }
            // uT for each ampere; uT
            "current_induced_field" => out.strength = k.log_between(1.0, 10.0) / vehicle.supply[1],
            "hard_iron" => out.strength = k.log_between(2.0, 20.0),
            // over the mass: 1/s^2; share; share; m/s^2; 1/rad; rad/s^2 for each m/s; rad/s^2
            "unknown_tether" => out.strength = k.log_between(0.2, 2.0),
            "unknown_slung" => out.strength = k.log_between(0.05, 0.2),
            "unknown_fade" => {
                out.strength = k.log_between(0.02, 0.1);
                out.other = k.between(0.1, 0.4) * seconds;
            }
            "unknown_gusts" => out.strength = k.log_between(0.1, 0.6),
            "unknown_sideslip" => out.strength = k.log_between(0.05, 0.4),
            "unknown_twist" => out.strength = k.log_between(0.3, 3.0),
            _ => out.strength = k.log_between(0.03, 0.2) * super::G / (0.3 * vehicle.arm),
        }
        out
    }

    /// Whether its size is given by its nature.
    #[must_use]
    pub fn has_its_size(&self) -> bool {
        matches!(self.id, "dead_rotor_speed" | "translational_lift" | "spinup_lag")
    }

    /// Strongest that is still plausible, as a multiple of what was drawn at first.
    #[must_use]
    pub fn room(&self) -> f64 {
        if matches!(self.id, "rotor_gain" | "supply_sag" | "battery_discharge" | "channel_delay" | "unknown_fade") {
            3.0
        } else {
            30.0
        }
    }
}
