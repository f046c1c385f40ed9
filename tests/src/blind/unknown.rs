//! Effects that no library entry describes.
//!
//! What it is: eleven causes of the kind that a bench really has, chosen so that no combination of listed effects has their form.
//! What can go wrong: at a small size, or on a schedule that hides its form, one of them may be indistinguishable from a listed one.
//! Units: as the affected channel.
//! Reference: specification `closing-the-loop.md`, "or one that the library does not know".

use super::chance::Chance;
use super::effect::{Effect, Frame};
use super::rig::{Rig, poly};

/// Their names.
pub const UNKNOWN: [&str; 11] = [
    "unknown_tare_breathing",
    "unknown_humidity",
    "unknown_gain_walk",
    "unknown_torque_band",
    "unknown_rate_thrust",
    "unknown_mains_alias",
    "unknown_stick_slip",
    "unknown_shunt_heat",
    "unknown_esc_band",
    "unknown_telegraph",
    "unknown_hunting",
];

/// Draws the numbers of one.
pub(crate) fn draw(e: &mut Effect, rig: &Rig, f: Frame, k: &mut Chance) {
    match e.id {
        "unknown_tare_breathing" => e.b = k.between(0.08, 0.4) * f.duration,
        "unknown_gain_walk" => e.b = f.duration,
        "unknown_torque_band" => e.b = k.between(0.45, 0.8) * rig.top,
        "unknown_mains_alias" => e.b = k.log_between(1.5, 12.0),
        "unknown_shunt_heat" => {
            e.b = k.log_between(8.0, 50.0);
            e.channel = "current_a";
        }
        "unknown_esc_band" => e.b = k.between(1300.0, 1800.0),
        "unknown_telegraph" => e.b = f.duration / k.between(6.0, 14.0),
        "unknown_hunting" => e.b = k.log_between(3.0, 40.0),
        _ => {}
    }
}

/// Bounds of the strength.
pub(crate) fn range(id: &str) -> (f64, f64) {
    match id {
        "unknown_tare_breathing" | "unknown_mains_alias" | "unknown_telegraph" | "unknown_stick_slip" => (1e-4, 3.0),
        "unknown_humidity" => (1e-4, 0.5),
        "unknown_gain_walk" => (1e-4, 1.0),
        "unknown_torque_band" => (1e-6, 0.1),
        "unknown_rate_thrust" => (1e-7, 0.05),
        "unknown_esc_band" | "unknown_hunting" => (1e-5, 0.3),
        _ => (1e-3, 1.0),
    }
}

/// What one adds to the strain reading at one instant.
#[expect(clippy::too_many_arguments, reason = "one instant of the cell is just this")]
pub(crate) fn cell(
    e: &Effect,
    rig: &Rig,
    i: usize,
    t: f64,
    h: f64,
    n: &[f64],
    state: &mut [f64; 2],
    y: &mut f64,
    k: &mut Chance,
) {
    let a = e.signed();
    let full = poly(&rig.thrust, rig.top / 1000.0);
    match e.id {
        "unknown_tare_breathing" | "unknown_mains_alias" => *y += a * (std::f64::consts::TAU * t / e.b + e.t0).sin(),
        "unknown_gain_walk" => {
            state[0] += k.normal() * (h / e.b).sqrt();
            *y *= 1.0 + a * state[0];
        }
        "unknown_rate_thrust" => {
            let back = (0.5 / h).round() as usize;
            let rate = (n[i] - n[i.saturating_sub(back)]).abs() / 0.5;
            *y += a * rate;
        }
        // the cell sticks: its reading follows only once the load has gone further than the friction holds
        "unknown_stick_slip" => {
            let x = *y;
            if (x - state[0]).abs() > e.strength || x < 0.02 * full {
                state[0] = x;
            }
            *y = state[0];
        }
        "unknown_telegraph" => {
            if i == 0 || k.happens(h / e.b) {
                state[0] = if state[0] > 0.0 { -1.0 } else { 1.0 };
            }
            *y += 0.5 * a * (state[0] + 1.0);
        }
        _ => {}
    }
}
