//! Who flies: a controller that knows the vehicle and none of what is hidden.
//!
//! What it is: place to tilt, tilt to rate, rate to moment, each with a share of the past; commands pass a filter, so that they are smooth.
//! What can go wrong: a vehicle that a hidden effect makes hard to fly is flown less exactly.
//! Units: SI.
//! Reference: Mellinger & Kumar, ICRA 2011 (thrust along the wanted force).

use super::body::{R, State, product, to_body, vector};
use super::route::Wanted;
use super::vehicle::Vehicle;
use super::{G, V, add, cross, length, times};

/// Gains: place, velocity, sum of place; tilt, rate, sum of rate.
const PLACE: [f64; 3] = [2.2, 2.6, 0.6];
const TILT: [f64; 3] = [5.0, 12.0, 10.0];
/// Time constant of the commands' filter, s.
const FILTER_S: f64 = 0.012;

/// The pilot.
#[derive(Debug, Clone)]
pub struct Pilot {
    place_sum: V,
    rate_sum: V,
    command: Vec<f64>,
}

impl Pilot {
    /// Over a vehicle that hovers.
    #[must_use]
    pub fn new(vehicle: &Vehicle) -> Self {
        Self { place_sum: [0.0; 3], rate_sum: [0.0; 3], command: vec![vehicle.command(vehicle.hover()); vehicle.hubs.len()] }
    }

    /// The commands after `dt`; `felt` is the rate as a noisy gyro has it.
    pub fn fly(&mut self, vehicle: &Vehicle, s: &State, felt: V, wanted: &Wanted, dt: f64) -> &[f64] {
        let off: V = std::array::from_fn(|k| wanted.place[k] - s.place[k]);
        self.place_sum = std::array::from_fn(|k| (self.place_sum[k] + dt * off[k]).clamp(-1.0, 1.0));
        let pull: V = std::array::from_fn(|k| {
            let v = wanted.velocity[k] - s.velocity[k];
            wanted.pull[k] + PLACE[0] * off[k] + PLACE[1] * v + PLACE[2] * self.place_sum[k]
        });
        let level = length([pull[0], pull[1], 0.0]);
        let bound = (6.0 / level.max(6.0)).min(1.0);
        let force = [bound * pull[0], bound * pull[1], pull[2].clamp(-5.0, 4.0) - G];
        let down = times(-1.0 / length(force), force);
        let nose = [wanted.heading.cos(), wanted.heading.sin(), 0.0];
        let right = cross(down, nose);
        let right = times(1.0 / length(right), right);
        let forward = cross(right, down);
        let aim: R = std::array::from_fn(|i| [forward[i], right[i], down[i]]);
        let transposed: R = std::array::from_fn(|i| std::array::from_fn(|j| s.turn[j][i]));
        let error = vector(&product(&transposed, &aim));
        let rate = times(TILT[0], error);
        let lag: V = std::array::from_fn(|k| rate[k] - felt[k]);
        self.rate_sum = std::array::from_fn(|k| (self.rate_sum[k] + dt * lag[k]).clamp(-3.0, 3.0));
        let angular: V = std::array::from_fn(|k| TILT[1] * lag[k] + TILT[2] * self.rate_sum[k]);
        let momentum: V = std::array::from_fn(|k| vehicle.inertia[k] * s.rate[k]);
        let moment = add(std::array::from_fn(|k| vehicle.inertia[k] * angular[k]), cross(s.rate, momentum));
        let thrust = -vehicle.mass * to_body(&s.turn, force)[2];
        self.mixed(vehicle, thrust.max(0.2 * vehicle.mass * G), moment, dt);
        &self.command
    }

    /// Thrust and moments on the rotors, and through the filter.
    fn mixed(&mut self, vehicle: &Vehicle, thrust: f64, moment: V, dt: f64) {
        let n = vehicle.hubs.len() as f64;
        let square = |of: &dyn Fn(usize) -> f64| (0..vehicle.hubs.len()).map(|i| of(i).powi(2)).sum::<f64>();
        let (xx, yy) = (square(&|i| vehicle.hubs[i].x), square(&|i| vehicle.hubs[i].y));
        let torque = vehicle.kq / vehicle.kt;
        let keep = (-dt / FILTER_S).exp();
        for (i, hub) in vehicle.hubs.iter().enumerate() {
            let lift = thrust / n - moment[0] * hub.y / yy + moment[1] * hub.x / xx - hub.turns * moment[2] / (n * torque);
            let lift = lift.clamp(0.15 * thrust / n, 2.2 * vehicle.mass * G / n);
            let command = vehicle.command((lift / vehicle.kt).sqrt()).clamp(0.05, 0.98);
            self.command[i] = command + keep * (self.command[i] - command);
        }
    }
}
