//! The limit while the rotor speeds up.
//!
//! What it is: a rotor that is to turn faster draws several times what its speed needs. Where the limit is reached there only, no level shows it:
//! what the limit leaves beyond the draw of the speed is all that turns the rotor faster, d(rpm^2)/dt = gain (limit - draw(rpm)) efficiency(rpm),
//! until it is where the declared model expects it. The winding takes R i^2 of what comes in:
//! efficiency = 2 u / (u + sqrt(u^2 + 1)) with u = K omega / sqrt(4 R V limit). Draw and winding are those of the run that the limit was found on.
//! What can go wrong: where no torque was measured the winding is left out, and the time constant is a mean.
//! Units: rev/min, A, s.
//! Reference: energy balance of a rotor; Beharie 2013, Eq. 5.11 as corrected (the draw at a speed).

use crate::channel::Draw;
use crate::channel::{Context, Relation};
use crate::effects::Shape;
use crate::effects::rotor::bearing_friction;
use crate::numeric::order::median;
use crate::numeric::solve::Normal;

/// Form of an instance against a declared model, which knows how the rotor speeds up without a limit.
pub(super) const SPIN_UP: &str = "while the rotor speeds up";

/// Limits that are tried, over the largest draw of a level.
const LIMITS: [f64; 8] = [0.7, 0.85, 1.0, 1.15, 1.35, 1.6, 2.0, 2.6];
/// Times that are tried in which that draw brings the energy of the top speed, s.
const STORES: [f64; 5] = [0.04, 0.08, 0.16, 0.32, 0.64];
/// Times that are tried in which it comes to the expected speed once the limit lets it, s.
const ARRIVALS: [f64; 2] = [0.02, 0.08];
/// Parts of a row in which the speed is followed.
const PARTS: usize = 4;
/// Speed below which a motor is driven without looking at its rotor, krpm.
const SLOW: f64 = 0.1;
/// Faster than any propeller of the kind, krpm.
const FASTEST: f64 = 100.0;

impl Draw {
    /// As the run shows it where the rotor has arrived, and the highest speed there, krpm; `None` where it shows none.
    pub(super) fn of(context: &Context) -> Option<(Self, f64)> {
        let target = context.targets.iter().find(|t| t.relation == Relation::Current)?;
        let mut held = vec![false; context.len()];
        context.steady.iter().for_each(|(from, to)| held[*from..*to].fill(true));
        context.settling.iter().zip(&mut held).filter(|(settling, _)| **settling).for_each(|(_, held)| *held = false);
        let mut normal = Normal::new(2);
        let mut top = 0.0_f64;
        for (row, current) in target.rows.iter().zip(&target.y).filter(|(row, _)| held[**row]) {
            let speed = context.rpm.get(*row)? / 1000.0;
            normal.add(&[speed.powi(2), speed.powi(3)], *current, 1.0);
            top = top.max(speed);
        }
        let solution = normal.solve()?;
        let powers = [*solution.coefficients.first()?, *solution.coefficients.get(1)?];
        let volts = median(&mut context.voltage.clone().unwrap_or_else(|| vec![bearing_friction::volts(context, 0)]));
        let omega = 1000.0 * bearing_friction::OMEGA;
        let draw = Self { powers, lossy: 4.0 * bearing_friction::winding(context) * volts / (omega * omega) };
        (draw.at(top) > 0.0).then_some((draw, top))
    }

    fn at(&self, krpm: f64) -> f64 {
        self.powers[0] * krpm.powi(2) + self.powers[1] * krpm.powi(3)
    }

    /// Share of what comes in at a current that turns the rotor.
    fn efficiency(&self, krpm: f64, current: f64) -> f64 {
        let u = krpm.max(SLOW) / (self.lossy * current).sqrt().max(1e-9);
        2.0 * u / (u + (u * u + 1.0).sqrt())
    }
}

/// What is sought, and what the run says of its draw. A log that shows no draw has the names.
pub(super) fn shapes(draw: Option<&(Draw, f64)>) -> Vec<Shape> {
    let (draw, top) = draw.copied().unwrap_or((Draw { powers: [0.0, 1.0], lossy: 0.0 }, 1.0));
    let most = draw.at(top);
    let gain = |store: f64| top * top / (store * most);
    let told = |name, unit, value: f64| Shape { name, unit, range: (value, value), starts: vec![value] };
    vec![
        Shape { name: "limit", unit: "A", range: (0.3 * most, 5.0 * most), starts: LIMITS.map(|k| k * most).to_vec() },
        Shape { name: "gain", unit: "krpm2/A/s", range: (gain(3.0), gain(0.01)), starts: STORES.map(gain).to_vec() },
        Shape { name: "arrival", unit: "s", range: (1e-3, 1.0), starts: ARRIVALS.to_vec() },
        told("draw_square", "A/krpm2", draw.powers[0]),
        told("draw_cube", "A/krpm3", draw.powers[1]),
        told("winding_square", "krpm2/A", draw.lossy),
    ]
}

/// A limit and the rotor that it holds back.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limit {
    /// A.
    limit: f64,
    /// krpm^2 a second for an ampere.
    gain: f64,
    /// s.
    arrival: f64,
    draw: Draw,
}

impl Limit {
    /// Of the values of [`shapes`].
    pub(super) fn of_shape(shape: &[f64]) -> Option<Self> {
        let [limit, gain, arrival, square, cube, lossy] = *shape else { return None };
        Some(Self { limit, gain, arrival, draw: Draw { powers: [square, cube], lossy } })
    }

    /// The speed that draws the limit, krpm: faster it does not become.
    fn most(&self) -> f64 {
        let (mut low, mut high) = (0.0, FASTEST);
        while high - low > 1e-3 {
            let middle = 0.5 * (low + high);
            *(if self.draw.at(middle) < self.limit { &mut low } else { &mut high }) = middle;
        }
        high
    }

    /// What the rotor makes of an expected speed, rev/min.
    pub(super) fn of(&self, t: &[f64], expected: &[f64]) -> Vec<f64> {
        let most = self.most();
        let (mut speed, mut last) = (f64::INFINITY, (f64::NAN, f64::NAN));
        let mut out = Vec::with_capacity(expected.len());
        for (t, expected) in t.iter().zip(expected) {
            let expected = (expected / 1000.0).max(0.0);
            if speed.is_infinite() {
                (speed, last) = (expected, (*t, expected));
            }
            let (dt, rise) = ((t - last.0) / PARTS as f64, (expected - last.1) / PARTS as f64);
            let left = (-dt / self.arrival).exp();
            for part in 0..PARTS {
                let before = last.1 + rise * part as f64;
                let free = before + rise - (before - speed) * left;
                let power = (self.limit - self.draw.at(speed)) * self.draw.efficiency(speed, self.limit);
                let driven = (speed.powi(2) + dt * self.gain * power).max(0.0).sqrt();
                speed = if speed < most { driven.min(most) } else { driven.max(most) }.min(free);
            }
            last = (*t, expected);
            out.push(1000.0 * speed);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::{Draw, Limit};

    /// A top speed of 5000 rev/min draws 5 A, which brings its energy in that many seconds.
    fn under(limit: f64, store: f64) -> Limit {
        Limit { limit, gain: 5.0 / store, arrival: 0.01, draw: Draw { powers: [0.0, 0.04], lossy: 0.0 } }
    }

    #[test]
    fn a_rotor_under_a_limit_is_late_and_arrives_where_the_limit_lets_it() {
        let t: Vec<f64> = (0..200).map(|i| 0.02 * f64::from(i)).collect();
        let expected: Vec<f64> = t.iter().map(|t| if *t < 1.0 { 1000.0 } else { 5000.0 }).collect();
        // more than the 5 A that the top speed draws: it arrives
        let late = under(8.0, 0.2).of(&t, &expected);
        assert!(late[..50].iter().all(|v| (v - 1000.0).abs() < 1e-9) && late[52] < 4500.0, "{late:?}");
        assert!((late[199] - 5000.0).abs() < 1.0);
        // 2.56 A are the draw of 4000 rev/min
        let short = under(2.56, 0.2).of(&t, &expected);
        assert!((short[199] - 4000.0).abs() < 20.0, "{}", short[199]);
        // the first row at the limit: 5^2 / 0.2 * (8 - 0.04) / 5 * 0.02 s on top of 1
        assert!((late[50] / 1000.0 - (1.0_f64 + 3.98).sqrt()).abs() < 0.05, "{}", late[50]);
    }

    #[test]
    fn rows_far_apart_do_not_make_it_ring() {
        let t: Vec<f64> = (0..40).map(|i| 0.5 * f64::from(i)).collect();
        let expected: Vec<f64> = t.iter().map(|t| if *t < 5.0 { 1000.0 } else { 5000.0 }).collect();
        let held = under(2.56, 0.04).of(&t, &expected);
        assert!(held[12..].iter().all(|v| (v - 4000.0).abs() < 20.0), "{held:?}");
        // one limit is one limit on a run that does not reach the top
        let slow: Vec<f64> = expected.iter().map(|v| v.min(3000.0)).collect();
        assert_eq!(under(2.56, 0.04).of(&t, &slow), slow);
    }
}
