//! How large a hidden effect is: what the declared model, refitted, leaves over of a flight without noise, in noise floors.
//!
//! What it is: for each kind of channel the windows' means (slopes for angular acceleration) less the best multiples of the declared columns,
//! over what the instruments' noise and the vibration leave in such a window.
//! What can go wrong: nothing.
//! Units: noise floors.
//! Reference: specification `closing-the-loop.md`, "Blind trials" (sizes in the noise of what shows the effect).

use super::cause::Cause;
use super::sense::{Instruments, Row, rows, shaken_mean};
use super::vehicle::Vehicle;
use super::world::Track;

/// Length of a window, s.
const WINDOW_S: f64 = 0.04;

/// Size on each channel, the largest first.
#[must_use]
pub fn sizes(vehicle: &Vehicle, causes: &[Cause], i: &Instruments, track: &Track) -> Vec<(String, f64)> {
    let seen = rows(vehicle, causes, i, track);
    let n = ((WINDOW_S * i.hz as f64) as usize).max(4);
    let root = (n as f64).sqrt();
    let dt = 1.0 / i.hz as f64;
    let means = |of: &dyn Fn(&Row) -> f64| -> Vec<f64> {
        seen.chunks_exact(n).map(|c| c.iter().map(of).sum::<f64>() / n as f64).collect()
    };
    let change = |of: &dyn Fn(&Row) -> f64| -> Vec<f64> {
        seen.chunks_exact(n).map(|c| (of(&c[n - 1]) - of(&c[0])) / ((n - 1) as f64 * dt)).collect()
    };
    let square =
        |r: &Row, weight: &dyn Fn(usize) -> f64| -> f64 { r.speeds.iter().enumerate().map(|(k, w)| weight(k) * w * w).sum() };
    let one = |_: &Row| 1.0;
    let mut out = Vec::new();
    let mut add = |name: String, y: Vec<f64>, columns: Vec<Vec<f64>>, floor: f64| out.push((name, left(&columns, &y) / floor));
    for axis in 0..3 {
        let columns = if axis == 2 { vec![means(&|r| square(r, &|_| 1.0))] } else { Vec::new() };
        let shaken = means(&|r| shaken_mean(vehicle, causes, i, &track.speeds[r.step], axis, n));
        let shaken = shaken.iter().sum::<f64>() / shaken.len().max(1) as f64;
        let floor = (i.inertial[0].powi(2) / n as f64 + shaken).sqrt();
        add(format!("acc_{axis}"), means(&|r| r.force[axis]), columns, floor);
    }
    for axis in 0..3 {
        let lever = |k: usize| [-vehicle.hubs[k].y, vehicle.hubs[k].x, -vehicle.hubs[k].turns][axis];
        let product = |r: &Row| r.turns[(axis + 1) % 3] * r.turns[(axis + 2) % 3];
        let spin = |r: &Row| r.speeds.iter().enumerate().map(|(k, w)| vehicle.hubs[k].turns * w).sum::<f64>();
        let mut columns = vec![means(&|r| square(r, &lever)), means(&product)];
        columns.push(if axis == 2 { change(&spin) } else { means(&|r| spin(r) * r.turns[1 - axis]) });
        let floor = i.inertial[1] * (12.0 / (n as f64).powi(3)).sqrt() / dt;
        add(format!("ang_acc_{axis}"), change(&|r| r.turns[axis]), columns, floor);
        let excess = means(&|r| r.rate[axis] - r.turns[axis]);
        let floor = (i.inertial[1] / root).hypot(i.motion[2] * 1.4 / WINDOW_S);
        add(format!("gyro_{axis}"), excess, Vec::new(), floor);
    }
    for rotor in 0..vehicle.hubs.len() {
        let command = |r: &Row| track.commands[r.step][rotor];
        let columns = vec![means(&one), means(&command), means(&|r| command(r).powi(2))];
        let speeds = means(&|r| r.speeds[rotor]);
        let floor = i.speed * vehicle.hover() / root;
        add(format!("rpm_{}", rotor + 1), speeds, columns, floor);
    }
    let volts = i.supply[0] * vehicle.supply[0] / root;
    add("voltage_v".into(), means(&|r| track.voltage[r.step]), vec![means(&one)], volts);
    if i.has[0] {
        for axis in 0..3 {
            let turn = |r: &Row, e: usize| track.states[r.step].turn[e][axis];
            let columns = (0..3).map(|e| means(&|r| turn(r, e))).collect();
            add(format!("mag_{axis}"), means(&|r| r.field[axis]), columns, i.field / root);
        }
    }
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    out
}

/// Root mean square of what the best sum of columns leaves of `y`: columns made orthogonal one after the other.
fn left(columns: &[Vec<f64>], y: &[f64]) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut rest = y.to_vec();
    let mut done: Vec<Vec<f64>> = Vec::new();
    for column in columns {
        let mut own = column.clone();
        let size = dot(&own, &own);
        for other in &done {
            let share = dot(&own, other);
            own.iter_mut().zip(other).for_each(|(o, d)| *o -= share * d);
        }
        let norm = dot(&own, &own);
        if norm > 1e-12 * size.max(1e-300) {
            own.iter_mut().for_each(|o| *o /= norm.sqrt());
            let share = dot(&rest, &own);
            rest.iter_mut().zip(&own).for_each(|(r, o)| *r -= share * o);
            done.push(own);
        }
    }
    (dot(&rest, &rest) / y.len().max(1) as f64).sqrt()
}
