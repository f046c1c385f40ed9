//! `vibration`: a motor with an unbalanced rotor runs on the board.
//!
//! What it is: the board follows the unbalance m e against its own mass M: an acceleration m e/M w^2 that turns in the rotor's plane; the
//! motor spins up and down as a first-order lag.
//! What can go wrong: above half the rate of the readings the line shows as its image.
//! Units: kg.m, kg, Hz, s; body axes.
//! Reference: den Hartog, *Mechanical Vibrations*, section 2.4.

use super::{ImuEffect, ImuLevers, Instant, direction, dot};
use crate::noise::Stream;
use core::f64::consts::TAU;
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vibration {
    /// Unbalance of the rotor, kg.m.
    pub unbalance_kgm: f64,
    /// Mass that it moves, kg.
    pub mass_kg: f64,
    /// Direction of the rotor's axis.
    pub axis: [f64; 3],
    /// Revolutions in a second, Hz.
    pub speed_hz: f64,
    /// Time constant of its way there, s.
    pub spin_up_s: f64,
    /// When it is switched on, s.
    pub t0_s: f64,
}

impl ImuEffect for Vibration {
    const ID: &'static str = "vibration";
    const EQUATION: &'static str = "f += unbalance/mass w^2 (u cos + v sin), u and v across the axis, from t0";

    fn draw(stream: &mut Stream, run_s: f64) -> Self {
        let speed_hz = stream.between(25.0, 90.0);
        let amplitude = stream.log_between(0.4, 1.6); // m/s^2
        let mass_kg = stream.between(0.1, 0.3);
        Self {
            unbalance_kgm: amplitude * mass_kg / (TAU * speed_hz).powi(2),
            mass_kg,
            axis: direction(stream),
            speed_hz,
            spin_up_s: stream.between(0.1, 0.5),
            t0_s: run_s * stream.between(0.2, 0.6),
        }
    }

    fn act(&self, at: &Instant, levers: &mut ImuLevers) {
        let since = at.run_s - self.t0_s;
        if since < 0.0 {
            return;
        }
        let lag = libm::exp(-since / self.spin_up_s);
        let w = TAU * self.speed_hz * (1.0 - lag);
        let (s, c) = libm::sincos(TAU * self.speed_hz * (since - self.spin_up_s * (1.0 - lag)));
        let size = self.unbalance_kgm / self.mass_kg * w * w;
        // two directions across the axis
        let n = self.axis;
        let least = if n[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let along = dot(least, n);
        let u: [f64; 3] = core::array::from_fn(|i| least[i] - along * n[i]);
        let length = libm::sqrt(dot(u, u));
        let u = u.map(|x| x / length);
        let v = [n[1] * u[2] - n[2] * u[1], n[2] * u[0] - n[0] * u[2], n[0] * u[1] - n[1] * u[0]];
        for (i, sum) in levers.shaken.iter_mut().enumerate() {
            *sum += size * (u[i] * c + v[i] * s);
        }
    }

    fn parameters(&self) -> Vec<(&'static str, f64, &'static str)> {
        vec![("frequency", self.speed_hz, "Hz")]
    }
}
