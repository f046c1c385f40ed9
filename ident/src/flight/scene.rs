//! What acts on the vehicle, row by row, as the hypothesis has it.
//!
//! What it is: the rotors' speeds and shares of thrust and torque, the air's velocity, the cushion of the ground, how late a sensor is. Terms
//! that change what goes into the equations change this; the columns follow from it.
//! What can go wrong: nothing; a quantity that the log lacks is absent here too.
//! Units: SI; rad/s.
//! Reference: Beharie 2013, Eq. 2.29 to 2.35 as corrected in the errata.

use super::record::{Axes, Record};
use crate::numeric::solve::Normal;
use nalgebra::Vector3;

/// Power of the command by which a refused speed is replaced.
const DEGREE: i32 = 2;

/// What a broken speed channel reads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Broken {
    /// The speed times this, from an instant on.
    Factor(f64, f64),
    /// Nothing that has to do with the speed, between two rows.
    Refused(usize, usize),
}

/// Place of the accelerometer among the sensors that may be late.
pub const FORCE: usize = 0;
/// Place of the gyro.
pub const GYRO: usize = 1;
/// Place of the rotors' speeds.
pub const SPEED: usize = 2;

/// The scene.
#[derive(Debug, Clone)]
pub struct Scene<'r> {
    /// The flight.
    pub record: &'r Record,
    /// What drives each rotor: speed, rad/s, or where none was measured its command.
    pub drive: Vec<Vec<f64>>,
    /// Factor of each rotor's thrust and torque: its value, and from which time on.
    pub gain: Vec<[f64; 2]>,
    /// Velocity through the air in body axes, m/s; `None` where the log has no velocity.
    pub air: Option<Axes>,
    /// Factor of the thrust, a value a row; empty for one.
    pub cushion: Vec<f64>,
    /// By how much specific force, gyro and the rotors' speeds are late, s.
    pub late: [f64; 3],
    /// Time constants of the rotors on the way up and down, s.
    pub lag: Option<Lag>,
    /// What is wrong with a rotor's speed channel.
    pub broken: Vec<Option<Broken>>,
}

impl<'r> Scene<'r> {
    /// As the declared model has it.
    #[must_use]
    pub fn declared(record: &'r Record) -> Self {
        let rotors = record.rotors();
        Self {
            record,
            drive: record.drive().to_vec(),
            gain: vec![[1.0, f64::NEG_INFINITY]; rotors],
            air: record.velocity.clone(),
            cushion: Vec::new(),
            late: [0.0; 3],
            lag: None,
            broken: vec![None; rotors],
        }
    }

    /// Gives a rotor whose speed is refused the one of its command, by the curve of the others and with their lag. Asked when all that acts is known.
    pub fn complete(&mut self) {
        for rotor in 0..self.broken.len() {
            if let Some(Broken::Refused(from, to)) = self.broken[rotor] {
                self.replace(rotor, from, to);
            }
        }
    }

    fn replace(&mut self, refused: usize, from: usize, to: usize) {
        let record = self.record;
        // what each power of the command adds to a speed, through the lag
        let powers = |command: &Vec<f64>| -> Vec<Vec<f64>> {
            let follows = self.lag.map(|lag| Follows::of(&record.t, command, &lag));
            let power = |k: i32| -> Vec<f64> { command.iter().map(|u| u.powi(k)).collect() };
            (0..=DEGREE).map(|k| follows.as_ref().map_or_else(|| power(k), |f| f.of_rows(&power(k)))).collect()
        };
        let commands: Vec<Vec<Vec<f64>>> = record.command.iter().map(powers).collect();
        let at = |rotor: usize, row: usize| -> Vec<f64> { commands[rotor].iter().map(|power| power[row]).collect() };
        let mut normal = Normal::new(DEGREE as usize + 1);
        for rotor in 0..commands.len() {
            for row in (0..record.len()).filter(|r| record.flying[*r] && (rotor != refused || !(from..to).contains(r))) {
                let (u, w) = (at(rotor, row), record.speed[rotor][row]);
                if u.iter().all(|u| u.is_finite()) && w.is_finite() {
                    normal.add(&u, w, 1.0);
                }
            }
        }
        let Some(curve) = normal.solve() else { return };
        for row in from..to {
            self.drive[refused][row] = at(refused, row).iter().zip(&curve.coefficients).map(|(p, c)| p * c).sum();
        }
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.record.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.record.is_empty()
    }

    /// Share of thrust and torque of a rotor at a row.
    #[must_use]
    pub fn share(&self, rotor: usize, row: usize) -> f64 {
        let [gain, from] = self.gain[rotor];
        let own = if self.record.t[row] >= from { gain } else { 1.0 };
        own * self.cushion.get(row).copied().unwrap_or(1.0)
    }

    /// Sum over the rotors of a weight times the `power` of what drives them times their share.
    #[must_use]
    pub fn thrusts(&self, weight: impl Fn(usize) -> f64, power: i32) -> Vec<f64> {
        let mut out = vec![0.0; self.len()];
        for (i, drive) in self.drive.iter().enumerate() {
            let weight = weight(i);
            if weight != 0.0 {
                let plain = self.gain[i][0] == 1.0 && self.cushion.is_empty();
                for (row, (o, d)) in out.iter_mut().zip(drive).enumerate() {
                    *o += weight * d.powi(power) * if plain { 1.0 } else { self.share(i, row) };
                }
            }
        }
        out
    }

    /// Sum of what drives the rotors, each times a weight.
    #[must_use]
    pub fn drives(&self, weight: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut out = vec![0.0; self.len()];
        for (i, drive) in self.drive.iter().enumerate() {
            let weight = weight(i);
            out.iter_mut().zip(drive).for_each(|(o, d)| *o += weight * d);
        }
        out
    }

    /// Velocity through the air at a row; nothing where it is not known.
    #[must_use]
    pub fn air_at(&self, row: usize) -> Vector3<f64> {
        at(self.air.as_ref(), row)
    }

    /// Rate at a row.
    #[must_use]
    pub fn rate_at(&self, row: usize) -> Vector3<f64> {
        at(self.record.rate.as_ref(), row)
    }
}

fn at(of: Option<&Axes>, row: usize) -> Vector3<f64> {
    of.map_or_else(Vector3::zeros, |v| Vector3::new(v[0][row], v[1][row], v[2][row]))
}

/// A value `by` seconds earlier, through the cubic B-spline of four rows.
///
/// Straight lines between rows would smooth half a row's delay and leave a whole one as noisy as it is: a delay would then be found for its smoothing.
/// These weights have the same noise within a tenth wherever they lie. So what is not late goes through them too. Rows without a value have no weight.
#[must_use]
pub fn delayed(t: &[f64], values: &[f64], by: f64) -> Vec<f64> {
    let last = t.len().saturating_sub(1);
    if last == 0 {
        return values.to_vec();
    }
    let mut k = 0;
    t.iter()
        .map(|now| {
            let wanted = now - by;
            while k + 1 < last && t[k + 1] <= wanted {
                k += 1;
            }
            let f = ((wanted - t[k]) / (t[k + 1] - t[k])).clamp(0.0, 1.0);
            let g = 1.0 - f;
            let weights = [g * g * g, 3.0 * f * f * (f - 2.0) + 4.0, 3.0 * g * g * (g - 2.0) + 4.0, f * f * f];
            let (mut sum, mut weight) = (0.0, 0.0);
            for (w, i) in weights.into_iter().zip([k.saturating_sub(1), k, k + 1, (k + 2).min(last)]) {
                if values[i].is_finite() {
                    sum += w * values[i];
                    weight += w;
                }
            }
            if weight > 0.0 { sum / weight } else { f64::NAN }
        })
        .collect()
}

/// How late the rotors follow their commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lag {
    /// Time constant on the way up, s.
    pub up: f64,
    /// Time constant on the way down, s.
    pub down: f64,
    /// Share of the time between two rows for which the command of the later one holds already: a controller's pulse jumps somewhere between them.
    pub phase: f64,
}

/// How a rotor follows its command, row by row. Whether it is on its way up or down is the command's to say, so that what a rotor settles at, or
/// any part of that, follows by the same rows.
#[derive(Debug, Clone)]
pub struct Follows {
    /// Shares of the distance to the target that are left after the two parts of the time to the next row; one where nothing is known of the
    /// command.
    left: Vec<[f64; 2]>,
}

impl Follows {
    /// For a command.
    #[must_use]
    pub fn of(t: &[f64], command: &[f64], lag: &Lag) -> Self {
        let mut state = command.first().copied().unwrap_or(0.0);
        let mut part = |goal: f64, dt: f64| {
            let tau = if goal > state { lag.up } else { lag.down };
            let left = (-dt / tau.max(1e-6)).exp();
            state = goal + (state - goal) * left;
            left
        };
        let row = |i: usize| match [command[i], command[i + 1], t[i + 1] - t[i]] {
            [now, next, dt] if now.is_finite() && next.is_finite() => {
                [part(now, dt * (1.0 - lag.phase)), part(next, dt * lag.phase)]
            }
            _ => [1.0; 2],
        };
        Self { left: (0..command.len().saturating_sub(1)).map(row).collect() }
    }

    /// What follows `target`.
    #[must_use]
    pub fn of_rows(&self, target: &[f64]) -> Vec<f64> {
        let [out] = self.side_by_side(&[target]);
        out
    }

    /// The same of several targets at once: each waits for its own row before alone, so that many take hardly longer than one.
    #[must_use]
    pub fn side_by_side<const N: usize, T: AsRef<[f64]>>(&self, targets: &[T; N]) -> [Vec<f64>; N] {
        let targets = targets.each_ref().map(AsRef::as_ref);
        let mut out = targets.map(|target| {
            let mut out = Vec::with_capacity(target.len());
            out.extend(target.first());
            out
        });
        let mut state = targets.map(|target| target.first().copied().unwrap_or(0.0));
        for (i, left) in self.left.iter().enumerate() {
            for n in 0..N {
                let ends = [targets[n][i], targets[n][i + 1]];
                if ends.iter().all(|e| e.is_finite()) {
                    for (left, goal) in left.iter().zip(ends) {
                        state[n] = goal + (state[n] - goal) * left;
                    }
                }
                out[n].push(state[n]);
            }
        }
        out
    }
}

/// A command as a rotor follows it.
#[must_use]
pub fn followed(t: &[f64], command: &[f64], lag: &Lag) -> Vec<f64> {
    Follows::of(t, command, lag).of_rows(command)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_late_is_what_was() {
        let t: Vec<f64> = (0..100).map(|i| 0.01 * f64::from(i)).collect();
        let v: Vec<f64> = t.iter().map(|t| 5.0 * t).collect();
        for by in [0.013, -0.013, 0.0] {
            let late = delayed(&t, &v, by);
            (3..96).for_each(|i| assert!((late[i] - 5.0 * (t[i] - by)).abs() < 1e-9, "{by} {i}"));
        }
    }

    /// Noise comes out as large from a delay of half a row as from one of a whole row, so that no delay is found for its smoothing.
    #[test]
    fn no_delay_smooths_more_than_another() {
        let t: Vec<f64> = (0..40).map(|i| 0.01 * f64::from(i)).collect();
        let one: Vec<f64> = (0..40).map(|i| f64::from(u8::from(i == 20))).collect();
        let power = |by: f64| delayed(&t, &one, by).iter().map(|v| v * v).sum::<f64>();
        let all: Vec<f64> = (0..=10).map(|k| power(0.001 * f64::from(k))).collect();
        assert!(all.iter().all(|p| (p / all[0] - 1.0).abs() < 0.1), "{all:?}");
    }

    #[test]
    fn a_rotor_follows() {
        let t: Vec<f64> = (0..1000).map(|i| 0.001 * f64::from(i)).collect();
        let aim: Vec<f64> = t.iter().map(|t| if *t < 0.0005 || *t >= 0.5 { 0.0 } else { 1.0 }).collect();
        let lag = Lag { up: 0.05, down: 0.1, phase: 0.5 };
        let seen = followed(&t, &aim, &lag);
        assert!((seen[50] - (1.0 - (-1.0f64).exp())).abs() < 0.01, "{}", seen[50]);
        assert!((seen[599] / seen[499] - (-1.0f64).exp()).abs() < 0.01, "{}", seen[599]);
        // what it settles at, a curve of the command, is reached in the same time: the lag is the rotor's, not the command's
        let settles: Vec<f64> = aim.iter().map(|a| 10.0 * a * a).collect();
        let turns = Follows::of(&t, &aim, &lag).of_rows(&settles);
        assert!(turns.iter().zip(&seen).all(|(w, u)| (w - 10.0 * u).abs() < 1e-9));
    }

    /// A command that came right after the row before has driven for the whole row, one that came right before its own row not at all.
    #[test]
    fn a_command_jumps_within_its_row() {
        let first = |phase: f64| followed(&[0.0, 0.02], &[0.0, 1.0], &Lag { up: 0.1, down: 0.1, phase })[1];
        assert!((first(1.0) - (1.0 - (-0.2f64).exp())).abs() < 1e-12 && first(0.0) == 0.0);
        assert!((first(0.25) - (1.0 - (-0.05f64).exp())).abs() < 1e-12);
    }
}
