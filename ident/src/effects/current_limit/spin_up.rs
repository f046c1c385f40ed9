//! The limit while the rotor speeds up.
//!
//! What it is: a rotor that is to turn faster draws several times what its speed needs. Where the limit is reached there only, no level shows it:
//! what the limit leaves beyond the draw of the speed is all that turns the rotor faster, d(rpm^2)/dt = top^2 / store (limit - draw(rpm)) /
//! draw(top) efficiency(rpm), until it is where the declared model expects it; meanwhile the current stands at the limit. The winding takes
//! R i^2 of what comes in: efficiency = 2 u / (u + sqrt(u^2 + 1)) with u = K omega / sqrt(4 R V limit).
//! What can go wrong: where no torque was measured the winding is left out, and the time constant is a mean.
//! Units: rev/min, A, s.
//! Reference: energy balance of a rotor; Beharie 2013, Eq. 5.11 as corrected (the draw at a speed).

use super::super::{Shape, bearing_friction};
use crate::context::{Context, Relation};
use crate::solve::Normal;

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
/// Share of the expected speed below which a rotor is held back.
const BEHIND: f64 = 0.98;

/// Current that a speed draws where it is held: second and third power of krpm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Draw {
    powers: [f64; 2],
    /// Highest speed, krpm.
    top: f64,
    /// Square of the speed at which the winding takes most, by the current, krpm^2/A.
    lossy: f64,
}

impl Draw {
    /// As the run shows it where the rotor has arrived; `None` where it shows none.
    pub(super) fn of(context: &Context) -> Option<Self> {
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
        let omega = 1000.0 * bearing_friction::OMEGA;
        let lossy = 4.0 * bearing_friction::winding(context) * bearing_friction::volts(context, 0) / (omega * omega);
        let draw = Self { powers, top, lossy };
        (draw.at(top) > 0.0).then_some(draw)
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

/// Limit and time constant.
pub(super) fn shapes(draw: &Draw) -> Vec<Shape> {
    let most = draw.at(draw.top);
    vec![
        Shape { name: "limit", unit: "A", range: (0.3 * most, 5.0 * most), starts: LIMITS.map(|k| k * most).to_vec() },
        Shape { name: "store", unit: "s", range: (0.01, 3.0), starts: STORES.to_vec() },
        Shape { name: "arrival", unit: "s", range: (1e-3, 1.0), starts: ARRIVALS.to_vec() },
    ]
}

/// A limit and the rotor that it holds back.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limit<'d> {
    pub(super) draw: &'d Draw,
    /// A.
    pub(super) limit: f64,
    /// s.
    pub(super) store: f64,
    /// s.
    pub(super) arrival: f64,
}

impl Limit<'_> {
    /// What the rotor makes of an expected speed, rev/min.
    pub(super) fn of(&self, t: &[f64], expected: &[f64]) -> Vec<f64> {
        let gain = self.draw.top.powi(2) / (self.store * self.draw.at(self.draw.top));
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
                let energy = speed.powi(2) + dt * gain * power;
                speed = energy.max(0.0).sqrt().min(free);
            }
            last = (*t, expected);
            out.push(1000.0 * speed);
        }
        out
    }
}

/// Rows in which a rotor is held back.
pub(super) fn held_back(expected: &[f64], limited: &[f64]) -> Vec<bool> {
    expected.iter().zip(limited).map(|(expected, limited)| *limited < BEHIND * expected).collect()
}

#[cfg(test)]
mod tests {
    use super::{Draw, Limit, held_back};

    #[test]
    fn a_rotor_under_a_limit_is_late_and_arrives_where_the_limit_lets_it() {
        let draw = Draw { powers: [0.0, 0.04], top: 5.0, lossy: 0.0 };
        let t: Vec<f64> = (0..200).map(|i| 0.02 * f64::from(i)).collect();
        let expected: Vec<f64> = t.iter().map(|t| if *t < 1.0 { 1000.0 } else { 5000.0 }).collect();
        // more than the 5 A that the top speed draws: it arrives
        let under = |limit: f64| Limit { draw: &draw, limit, store: 0.2, arrival: 0.01 }.of(&t, &expected);
        let late = under(8.0);
        let back = held_back(&expected, &late);
        assert!(back[..50].iter().all(|b| !b) && back[50] && back[52] && !back[199], "{late:?}");
        assert!((late[199] - 5000.0).abs() < 1.0);
        // 2.56 A are the draw of 4000 rev/min
        let short = under(2.56);
        assert!((short[199] - 4000.0).abs() < 20.0, "{}", short[199]);
        // the first row at the limit: 5^2 / 0.2 * (8 - 0.04) / 5 * 0.02 s on top of 1
        assert!((late[50] / 1000.0 - (1.0_f64 + 3.98).sqrt()).abs() < 0.05, "{}", late[50]);
    }
}
