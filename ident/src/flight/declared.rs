//! The declared model of a flight.
//!
//! What it is: thrust k_T times the sum of the squared speeds along -z, reaction torque, a rigid body that turns. Each rotor's speed is a cubic of
//! its pulse above the one at which the motors start and nothing below, one for all with small differences. Voltage is a constant, the field a
//! constant in earth axes. No drag, no offset.
//! What can go wrong: without measured speeds thrust and moments go with command and its square.
//! Units: SI; rev/min for the speeds.
//! Reference: specification `flight.md`, "The loop on flights"; Beharie 2013, Eq. 2.25 to 2.35 as corrected in the errata.

use super::channels::Target;
use super::columns::{Flight, Sink};
use super::scene::{Broken, Follows, GYRO, SPEED, Scene, delayed};
use crate::attribution::columns::{Column, Owner, Prior};

/// Thrust coefficients lie this far from what carries the weight in the middle of the flight, as a share.
const THRUST: f64 = 0.5;
/// Difference of moments of inertia over the third: a flat body has -1, +1 and 0 about x, y and z.
const FLAT: [f64; 3] = [-1.0, 1.0, 0.0];
/// Standard deviation of that difference; where the inertia is known.
const FLATNESS: (f64, f64) = (0.4, 0.05);
/// Moment of inertia of a rotor over that of the body about a level axis.
const SPIN: f64 = 5e-3;
/// Reaction torque over thrust, in arms.
const YAW: f64 = 0.2;
/// Share by which rotors of one kind differ in speed at one pulse.
const OWN: f64 = 0.03;
/// Field of the earth, uT.
const FIELD_UT: f64 = 60.0;

/// The columns of the declared model, always as many.
#[must_use]
pub(super) fn declared(flight: &Flight, scene: &Scene<'_>) -> Vec<Column> {
    let mut sink = Sink::new(flight, scene, &[], Owner::Declared);
    thrust(&mut sink);
    if !flight.record.vehicle.rotors.is_empty() {
        turning(&mut sink);
    }
    speeds(&mut sink);
    if flight.record.voltage.is_some() {
        let volts = flight.usual.supply[0];
        sink.column("voltage", Prior { mean: volts, sd: 0.2 * volts, sign: 0.0 }).constant(Target::Voltage);
    }
    field(&mut sink);
    reading(&mut sink);
    sink.done()
}

/// Powers of the drive that make thrust: the square of a speed, command and its square where no speed is known.
fn powers(flight: &Flight) -> &'static [i32] {
    if flight.record.speed.is_empty() { &[2, 1] } else { &[2] }
}

fn thrust(sink: &mut Sink<'_>) {
    for power in powers(sink.flight) {
        let values = sink.scene.thrusts(|_| -1.0, *power);
        let (name, size) = thrust_of(sink.flight, *power);
        let mean = if *power == 2 { size } else { 0.0 };
        sink.column(name, Prior { mean, sd: THRUST * size, sign: 0.0 }).part(Target::Force(2), &values);
    }
}

/// Name and usual size of a thrust coefficient over the mass.
fn thrust_of(flight: &Flight, power: i32) -> (&'static str, f64) {
    if power == 2 { ("thrust", super::G / flight.usual.squares) } else { ("thrust_linear", super::G / flight.usual.sum) }
}

fn turning(sink: &mut Sink<'_>) {
    let (flight, scene) = (sink.flight, sink.scene);
    let rotors = flight.record.vehicle.rotors.clone();
    let usual = &flight.usual;
    let names = [["roll", "roll_linear"], ["pitch", "pitch_linear"], ["yaw", "yaw_linear"]];
    let coupling = ["roll_coupling", "pitch_coupling", "yaw_coupling"];
    for axis in 0..3 {
        let lever = |i: usize| match axis {
            0 => -rotors[i].y,
            1 => rotors[i].x,
            _ => -rotors[i].turns,
        };
        let reach = if axis == 2 { YAW * usual.turning } else { usual.turning / usual.arm };
        for (power, name) in powers(flight).iter().zip(names[axis]) {
            let size = reach / if *power == 2 { usual.squares } else { usual.sum };
            sink.column(name, Prior { mean: 0.0, sd: size, sign: 0.0 })
                .part(Target::Turning(axis), &scene.thrusts(lever, *power));
        }
        let product: Vec<f64> = (0..scene.len())
            .map(|row| {
                let w = scene.rate_at(row);
                w[(axis + 1) % 3] * w[(axis + 2) % 3]
            })
            .collect();
        let prior = match flight.record.vehicle.inertia_kgm2 {
            Some(i) => Prior { mean: (i[(axis + 1) % 3] - i[(axis + 2) % 3]) / i[axis], sd: FLATNESS.1, sign: 0.0 },
            None => Prior { mean: FLAT[axis], sd: FLATNESS.0, sign: 0.0 },
        };
        sink.column(coupling[axis], prior).said_by(GYRO, Target::Turning(axis), &product);
    }
    if flight.record.speed.is_empty() {
        return;
    }
    // the rotors' own angular momentum: a moment against its turning with the body, and against its change
    let spin = sink.behind(GYRO, SPEED, &scene.drives(|i| rotors[i].turns));
    let about = |axis: usize, sign: f64| -> Vec<f64> {
        spin.iter().enumerate().map(|(row, h)| sign * scene.rate_at(row)[axis] * h).collect()
    };
    let [roll, pitch] = [about(1, -1.0), about(0, 1.0)];
    sink.column("spin", Prior::positive(SPIN)).said_by(GYRO, Target::Turning(0), &roll).said_by(GYRO, Target::Turning(1), &pitch);
    let change: Vec<f64> = flight.windows.slope(&spin).iter().map(|s| -s).collect();
    sink.column("spin_up", Prior::positive(SPIN)).window(Target::Turning(2), change);
}

/// Each rotor's speed, rev/min, from its pulse: powers of the command about its middle, none where it turns no motor. The rotor follows what they
/// add up to with its lag, if it has one.
fn speeds(sink: &mut Sink<'_>) {
    let (flight, scene) = (sink.flight, sink.scene);
    if flight.record.speed.is_empty() || flight.record.command.is_empty() {
        return;
    }
    let usual = &flight.usual;
    let [middle, spread] = usual.command;
    let powers: Vec<[Vec<f64>; 4]> = (0..flight.record.rotors()).map(|i| powers_of(flight, scene, i)).collect();
    let slope = 0.7 * usual.rpm * spread / middle.max(spread);
    let priors = [(usual.rpm, 0.3 * usual.rpm), (slope, slope), (0.0, 0.3 * slope), (0.0, 0.1 * slope)];
    for (k, (name, (mean, sd))) in ["speed", "speed_1", "speed_2", "speed_3"].into_iter().zip(priors).enumerate() {
        sink.column(name, Prior { mean, sd, sign: 0.0 });
        for (i, own) in powers.iter().enumerate() {
            sink.part(Target::Speed(i), &own[k]);
        }
    }
    for (i, own) in powers.iter().enumerate() {
        sink.column("own", Prior::about_zero(OWN * usual.rpm)).part(Target::Speed(i), &own[0]);
        sink.column("own_1", Prior::about_zero(3.0 * OWN * slope)).part(Target::Speed(i), &own[1]);
    }
}

/// What a rotor's speed channel reads for each power of its command, 0 to 3, about the middle of all commands.
fn powers_of(flight: &Flight, scene: &Scene<'_>, rotor: usize) -> [Vec<f64>; 4] {
    let [middle, spread] = flight.usual.command;
    let command = &scene.record.command[rotor];
    let turns = |u: &f64| *u > flight.usual.start;
    let about: Vec<f64> = command.iter().map(|u| (u - middle) / spread).collect();
    let power = |of: fn(f64) -> f64| -> Vec<f64> {
        command.iter().zip(&about).map(|(u, x)| if turns(u) { of(*x) } else { 0.0 }).collect()
    };
    let settles = [power(|_| 1.0), power(|x| x), power(|x| x * x), power(|x| x * (x * x))];
    let mut out = match scene.lag {
        Some(lag) => Follows::of(&scene.record.t, command, &lag).side_by_side(&settles),
        None => settles,
    };
    for values in &mut out {
        match scene.broken[rotor] {
            Some(Broken::Factor(factor, from)) => {
                values.iter_mut().zip(&scene.record.t).filter(|(_, t)| **t >= from).for_each(|(v, _)| *v *= factor);
            }
            Some(Broken::Refused(a, b)) => values[a..b].fill(0.0),
            None => {}
        }
    }
    out
}

/// What a late gyro reads beside the attitude: what it reads now, less what it will read once the delay is over. Its amplitude is one; where the
/// gyro is not late it is nothing. The gyro's own readings say it, since an attitude's noise would pass for less of itself when it is shifted.
fn reading(sink: &mut Sink<'_>) {
    let (flight, late) = (sink.flight, sink.scene.late[GYRO]);
    let Some(rate) = flight.record.rate.as_ref().filter(|_| flight.record.to_earth.is_some()) else { return };
    sink.column("reading", Prior { mean: 1.0, sd: 0.0, sign: 0.0 });
    for (axis, rate) in rate.iter().enumerate() {
        let at = |late: f64| flight.windows.mean(&delayed(&flight.record.t, rate, late));
        let change: Vec<f64> = if late == 0.0 {
            vec![0.0; flight.windows.len()]
        } else {
            at(0.0).iter().zip(at(-late)).map(|(now, then)| now - then).collect()
        };
        sink.window(Target::Rate(axis), change);
    }
}

fn field(sink: &mut Sink<'_>) {
    let flight = sink.flight;
    let (Some(_), Some(to_earth)) = (&flight.record.field, &flight.record.to_earth) else { return };
    for (earth, name) in ["field_north", "field_east", "field_down"].into_iter().enumerate() {
        sink.column(name, Prior::about_zero(FIELD_UT));
        for axis in 0..3 {
            let values: Vec<f64> = to_earth.iter().map(|r| r[(earth, axis)]).collect();
            sink.part(Target::Field(axis), &values);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::Record;
    use super::super::standard::standard_flight;
    use super::*;

    /// What the rotors do, their own momentum too, is late in a late gyro; what the gyro itself says is late already; the attitude is not.
    #[test]
    fn a_late_gyro_is_late_in_all_that_the_rotors_do() {
        let flight = Flight::of(Record::of(&standard_flight()).unwrap());
        let columns = |late: f64| {
            let mut scene = Scene::declared(&flight.record);
            scene.late[GYRO] = late;
            declared(&flight, &scene)
        };
        // two windows of 40 ms
        let (now, late) = (columns(0.0), columns(0.08));
        let part = |of: &[Column], name: &str, target: Target| {
            let channel = flight.channels.position(target).unwrap();
            let column = of.iter().find(|c| c.name == name).unwrap();
            column.parts.iter().find(|p| p.0 == channel).map(|p| p.1.clone()).unwrap()
        };
        for (name, axis, windows) in
            [("roll", 0, 2), ("pitch", 1, 2), ("yaw", 2, 2), ("spin_up", 2, 2), ("roll_coupling", 0, 0), ("yaw_coupling", 2, 0)]
        {
            let [now, late] = [&now, &late].map(|of| part(of, name, Target::Turning(axis)));
            let size = now.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            assert!(size > 0.0 && (9..now.len()).all(|i| (late[i] - now[i - windows]).abs() < 1e-6 * size), "{name}");
        }
        let rate = &flight.record.rate.as_ref().unwrap()[0];
        let seen = flight.windows.mean(&delayed(&flight.record.t, rate, 0.0));
        let [now, late] = [&now, &late].map(|of| part(of, "reading", Target::Rate(0)));
        assert!(now.iter().all(|v| *v == 0.0));
        assert!((0..seen.len() - 9).all(|i| (late[i] - (seen[i] - seen[i + 2])).abs() < 1e-9));
    }

    #[test]
    fn a_flat_body_has_the_sum_of_its_level_inertias_about_z() {
        let inertia = [0.4, 0.6, 1.0];
        let ratio = |a: usize, b: usize, c: usize| (inertia[a] - inertia[b]) / inertia[c];
        assert!((ratio(1, 2, 0) - FLAT[0]).abs() < 0.01 && (ratio(2, 0, 1) - FLAT[1]).abs() < 0.01);
        assert!(ratio(0, 1, 2).abs() < 0.3);
    }
}
