//! A vehicle of the generator.
//!
//! What it is: mass, inertia, rotors, and how pulses become speeds, drawn so that sizes go together as they do on real ones.
//! What can go wrong: nothing.
//! Units: SI; rotors' places in body axes forward, right.
//! Reference: scaling of multirotors with their size; APC and Gemfan static tables for the tip speeds.

use super::G;
use crate::blind::chance::Chance;
use std::fmt::Write;

/// One rotor's place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hub {
    /// Forward, m.
    pub x: f64,
    /// Right, m.
    pub y: f64,
    /// +1 clockwise from above.
    pub turns: f64,
    /// Own share by which it turns faster at the same pulse.
    pub own: f64,
}

/// The vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct Vehicle {
    /// Mass, kg.
    pub mass: f64,
    /// Middle to rotor, m.
    pub arm: f64,
    /// Moments of inertia, kg.m^2.
    pub inertia: [f64; 3],
    /// Rotors.
    pub hubs: Vec<Hub>,
    /// How the layout is written in the log.
    pub layout: String,
    /// Whether the log tells the inertia.
    pub tells_inertia: bool,
    /// Radius of a rotor, m.
    pub radius: f64,
    /// Thrust over speed squared, N.s^2.
    pub kt: f64,
    /// Torque over speed squared, N.m.s^2.
    pub kq: f64,
    /// Inertia of a rotor, kg.m^2.
    pub spin: f64,
    /// Speed at full pulse, rad/s, and the linear share of the curve.
    pub top: [f64; 2],
    /// Voltage, V, and current in hover, A.
    pub supply: [f64; 2],
}

impl Vehicle {
    /// Draws one.
    #[must_use]
    pub fn draw(k: &mut Chance) -> Self {
        let mass = k.log_between(0.03, 2.0);
        let arm = 0.045 * (mass / 0.035).powf(1.0 / 2.6) * k.between(0.85, 1.2);
        let gyration = arm * k.between(0.42, 0.62);
        let about_x = mass * gyration * gyration;
        let inertia = [about_x, about_x * k.between(0.9, 1.25), about_x * k.between(1.6, 2.0)];
        let plus = k.happens(0.4);
        let (hubs, layout) = hubs(arm, plus, k);
        let radius = arm * k.between(0.45, 0.65);
        let hover = k.between(55.0, 85.0) / radius;
        let kt = mass * G / (4.0 * hover * hover);
        let reserve = k.between(1.35, 1.75);
        let volts = if mass < 0.1 { 3.8 } else { 11.4 * k.between(0.9, 1.3) };
        // power of hover by momentum theory, with a figure of merit and a motor
        let disc = 4.0 * std::f64::consts::PI * radius * radius;
        let power = (mass * G).powf(1.5) / (2.0 * super::AIR * disc).sqrt() / 0.4;
        Self {
            mass,
            arm,
            inertia,
            hubs,
            layout,
            tells_inertia: k.happens(0.5),
            radius,
            kt,
            kq: kt * radius * k.between(0.1, 0.16),
            spin: about_x * k.between(5e-4, 3e-3),
            top: [hover * reserve, k.between(1.0, 1.4)],
            supply: [volts, power / volts],
        }
    }

    /// Speed of a rotor at rest with its pulse, rad/s, for a command as a share of full.
    #[must_use]
    pub fn speed(&self, hub: usize, command: f64) -> f64 {
        let [top, bow] = self.top;
        top * (bow * command + (1.0 - bow) * command * command) * (1.0 + self.hubs[hub].own)
    }

    /// The command that gives a speed on a rotor without a share of its own.
    #[must_use]
    pub fn command(&self, speed: f64) -> f64 {
        let [top, bow] = self.top;
        let (a, b, c) = (1.0 - bow, bow, -speed / top);
        if a.abs() < 1e-9 { -c / b } else { (-b + (b * b - 4.0 * a * c).max(0.0).sqrt()) / (2.0 * a) }
    }

    /// Speed that carries the weight, rad/s.
    #[must_use]
    pub fn hover(&self) -> f64 {
        (self.mass * G / (self.hubs.len() as f64 * self.kt)).sqrt()
    }

    /// The head of a flight log.
    #[must_use]
    pub fn head(&self) -> String {
        let mut out = String::from("# quadrig-flight 1\n");
        let _ = writeln!(out, "# mass_kg = {:.5}\n# arm_m = {:.5}\n# layout = \"{}\"", self.mass, self.arm, self.layout);
        if self.tells_inertia {
            let [x, y, z] = self.inertia;
            let _ = writeln!(out, "# inertia_kgm2 = [{x:.6e}, {y:.6e}, {z:.6e}]");
        }
        out
    }
}

fn hubs(arm: f64, plus: bool, k: &mut Chance) -> (Vec<Hub>, String) {
    let d = arm * std::f64::consts::FRAC_1_SQRT_2;
    let (places, names) = if plus {
        ([(0.0, -arm), (-arm, 0.0), (0.0, arm), (arm, 0.0)], ["left", "rear", "right", "front"])
    } else {
        ([(d, d), (-d, d), (-d, -d), (d, -d)], ["front right", "rear right", "rear left", "front left"])
    };
    let first = k.sign();
    let turns = |i: usize| if i.is_multiple_of(2) { first } else { -first };
    let hub = |i: usize, k: &mut Chance| Hub { x: places[i].0, y: places[i].1, turns: turns(i), own: 0.004 * k.normal() };
    let list: Vec<String> = names.iter().enumerate().map(|(i, n)| format!("{} {n}", i + 1)).collect();
    let clockwise: Vec<String> = (0..4).filter(|i| turns(*i) > 0.0).map(|i| (i + 1).to_string()).collect();
    let layout = format!("{}: {}; {} clockwise", if plus { "plus" } else { "x" }, list.join(", "), clockwise.join(" and "));
    ((0..4).map(|i| hub(i, k)).collect(), layout)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_gives_its_speed_back() {
        let vehicle = Vehicle::draw(&mut Chance::new(4, 0));
        for share in [0.3, 0.5, 0.8] {
            let speed = vehicle.speed(0, share) / (1.0 + vehicle.hubs[0].own);
            assert!((vehicle.command(speed) - share).abs() < 1e-9);
        }
        let lift = 4.0 * vehicle.kt * vehicle.hover().powi(2);
        assert!((lift - vehicle.mass * G).abs() < 1e-9);
    }
}
