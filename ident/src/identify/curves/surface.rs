//! Thrust over throttle and supply voltage, with bands.
//!
//! What it is: each plateau gives the share of the supply that its controller passed on, d = (Kt w + R (k_Q w^2 + f) / Kt) / V; a cubic of d
//! over the pulse and the same balance solved for the speed give thrust at any voltage, thrust over the speed being the
//! propeller's own, on the zero that was read at rest.
//! What can go wrong: without motor constants (torque, current, voltage, a level at full throttle) nothing says what another voltage would do.
//! Units: us, V, N; half widths of 95 % bands.
//! Reference: Beharie 2013, Eq. 5.11 corrected (rpm = KV (V - I R)); errors by the delta method.

use super::curve::{Curve, Point};
use super::motor::Motor;
use super::{Estimate, Zero, scaled};
use crate::log::Log;
use crate::plateau::Plateau;
use std::f64::consts::TAU;

/// Voltages beside the one that was measured, as shares of it.
const SHARES: [f64; 5] = [0.8, 0.9, 1.0, 1.1, 1.2];
/// Pulses of the surface.
const PULSES: usize = 21;

/// Thrust over pulse and voltage.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    /// Pulses, us.
    pub pulses: Vec<f64>,
    /// Voltages, V.
    pub voltages: Vec<f64>,
    /// Thrust and half width of its 95 % band for each voltage, each pulse.
    pub thrust: Vec<Vec<(f64, f64)>>,
    /// Lowest and highest voltage of the plateaus: what lies beyond is computed, not measured.
    pub measured: (f64, f64),
}

/// What the balance of a level needs.
#[derive(Clone, Copy)]
struct Balance {
    kt: f64,
    resistance: f64,
    friction: f64,
    k_torque: f64,
}

impl Balance {
    fn of(kv: f64, resistance: f64, no_load: f64, k_torque: f64) -> Self {
        let kt = 60.0 / (TAU * kv);
        Self { kt, resistance, friction: kt * no_load, k_torque }
    }

    /// Voltage at the motor of a speed, rev/min.
    fn voltage(&self, rpm: f64) -> f64 {
        let w = rpm * TAU / 60.0;
        self.kt * w + self.resistance * (self.k_torque * w * w + self.friction) / self.kt
    }

    /// Speed of a voltage, rev/min; 0 where it does not start.
    fn rpm(&self, voltage: f64) -> f64 {
        let a = self.resistance * self.k_torque / self.kt;
        let free = voltage - self.resistance * self.friction / self.kt;
        if free <= 0.0 {
            return 0.0;
        }
        let w =
            if a * free < 1e-12 { free / self.kt } else { (-self.kt + (self.kt * self.kt + 4.0 * a * free).sqrt()) / (2.0 * a) };
        w * 60.0 / TAU
    }
}

/// A level: pulse, supply, speed, each with its error.
struct Level {
    pulse: f64,
    voltage: (f64, f64),
    rpm: (f64, f64),
}

/// Share of the supply over the pulse.
fn passed(levels: &[Level], balance: &Balance) -> Option<Curve> {
    let points: Vec<Point> = levels
        .iter()
        .map(|l| {
            let share = balance.voltage(l.rpm.0) / l.voltage.0;
            let slope = (balance.voltage(1.001 * l.rpm.0) - balance.voltage(l.rpm.0)) / (0.001 * l.rpm.0);
            let error = (slope * l.rpm.1 / l.voltage.0).hypot(share * l.voltage.1 / l.voltage.0);
            Point { x: scaled("pulse_us", l.pulse), x_error: 0.0, y: share, y_error: error.max(1e-6) }
        })
        .collect();
    Curve::fit(&points, 3)
}

/// Thrust over the speed on its zero: a quadratic, as the declared relation.
fn thrusts(log: &Log, plateaus: &[Plateau], speed: &[Option<(f64, f64)>], zero: Option<&Zero>) -> Option<Curve> {
    let points: Vec<Point> = plateaus
        .iter()
        .zip(speed)
        .filter_map(|(p, rpm)| {
            let (rpm, (y, y_error)) = ((*rpm)?, Zero::off(zero, p.middle_s(), p.of(log, "thrust_n")?));
            Some(Point { x: scaled("rpm", rpm.0), x_error: rpm.1 / 1000.0, y, y_error })
        })
        .collect();
    Curve::fit(&points, 2)
}

/// The surface; or why there is none.
///
/// # Errors
/// What is missing, in words.
pub fn surface(
    log: &Log,
    plateaus: &[Plateau],
    speed: &[Option<(f64, f64)>],
    motor: Option<&Motor>,
    k_torque: Option<Estimate>,
    zero: Option<&Zero>,
) -> Result<Surface, String> {
    let motor =
        motor.ok_or_else(|| format!("not known, for the motor's constants are not: {}", super::lacks(log, plateaus, speed)))?;
    let thrust = thrusts(log, plateaus, speed, zero).ok_or("not known: too few levels with a thrust and a speed")?;
    let k_torque = k_torque.ok_or("not known: no torque over the speed")?;
    let levels: Vec<Level> = plateaus
        .iter()
        .zip(speed)
        .filter_map(|(p, rpm)| {
            let rpm = rpm.filter(|v| v.0 > 1.0)?;
            Some(Level { pulse: p.of(log, "pulse_us")?.0, voltage: p.of(log, "voltage_v").filter(|v| v.0 > 0.0)?, rpm })
        })
        .collect();
    let centre = Balance::of(motor.kv.value, motor.resistance.value, motor.no_load.value, k_torque.value);
    let share = passed(&levels, &centre).ok_or("not known: too few levels with a pulse, a speed and a voltage")?;
    let voltages = levels.iter().map(|l| l.voltage.0);
    let measured = (voltages.clone().fold(f64::INFINITY, f64::min), voltages.fold(0.0, f64::max));
    let nominal = 0.5 * (measured.0 + measured.1);
    let (low, high) = share.range();
    let pulses: Vec<f64> = (0..PULSES).map(|k| 1000.0 + 1000.0 * (low + (high - low) * k as f64 / (PULSES - 1) as f64)).collect();
    let at = |balance: &Balance, share: f64, v: f64| thrust.at(scaled("rpm", balance.rpm(share * v)));
    // each constant one half width away, the levels' shares with it
    let moved: Vec<(Balance, Curve)> = [
        Balance::of(motor.kv.value + motor.kv.half, motor.resistance.value, motor.no_load.value, k_torque.value),
        Balance::of(motor.kv.value, motor.resistance.value + motor.resistance.half, motor.no_load.value, k_torque.value),
        Balance::of(motor.kv.value, motor.resistance.value, motor.no_load.value + motor.no_load.half, k_torque.value),
        Balance::of(motor.kv.value, motor.resistance.value, motor.no_load.value, k_torque.value + k_torque.half),
    ]
    .into_iter()
    .filter_map(|balance| Some((balance, passed(&levels, &balance)?)))
    .collect();
    let point = |pulse: f64, v: f64| {
        let x = scaled("pulse_us", pulse);
        let value = at(&centre, share.at(x), v);
        let of_share = at(&centre, share.at(x) + share.prediction(x), v) - value;
        let of_thrust = thrust.band(scaled("rpm", centre.rpm(share.at(x) * v)));
        let of_constants = moved.iter().map(|(balance, share)| (at(balance, share.at(x), v) - value).powi(2)).sum::<f64>();
        (value, (of_share.powi(2) + of_thrust.powi(2) + of_constants).sqrt())
    };
    let voltages: Vec<f64> = SHARES.iter().map(|s| s * nominal).collect();
    let thrust = voltages.iter().map(|v| pulses.iter().map(|pulse| point(*pulse, *v)).collect()).collect();
    Ok(Surface { pulses, voltages, thrust, measured })
}

impl Surface {
    /// Whether a voltage lies within what was measured, a hundredth aside.
    #[must_use]
    pub fn is_measured(&self, voltage: f64) -> bool {
        (0.99 * self.measured.0..=1.01 * self.measured.1).contains(&voltage)
    }

    /// As CSV.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut out = String::from("pulse_us,throttle_percent,voltage_v,thrust_n,thrust_n_low,thrust_n_high,measured\n");
        for (v, row) in self.voltages.iter().zip(&self.thrust) {
            for (pulse, (thrust, half)) in self.pulses.iter().zip(row) {
                let measured = if self.is_measured(*v) { "yes" } else { "computed" };
                let throttle = (pulse - 1000.0) / 10.0;
                out += &format!(
                    "{pulse:.1},{throttle:.2},{v:.3},{thrust:.5},{:.5},{:.5},{measured}\n",
                    thrust - half,
                    thrust + half
                );
            }
        }
        out
    }
}
