//! What a channel reads at rest: its zero, taken off wherever a figure needs one.
//!
//! What it is: the readings of the levels at rest, on a straight line between two of them, held before the first and after the last. Between
//! readings a zero wanders as a random walk does; how fast, its own changes tell.
//! What can go wrong: a log without a level at rest has no zero, and none is guessed.
//! Units: the channel's; s.
//! Reference: Beharie 2013, section 5.7.3; variance of a Brownian bridge, u (1 - u) times that of the whole step.

use super::power::{Valued, at_rest};
use crate::log::Log;
use crate::plateau::Plateau;

/// What one channel reads at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Zero {
    /// Middle of each level at rest in s, its reading and the error of that, in order.
    readings: Vec<(f64, Valued)>,
    /// Variance that the zero gathers in a second.
    wander: f64,
}

impl Zero {
    /// Of a channel of a log; `None` where no level is at rest.
    #[must_use]
    pub fn of(log: &Log, plateaus: &[Plateau], speed: &[Option<Valued>], channel: &str) -> Option<Self> {
        let resting = plateaus.iter().zip(at_rest(speed)).filter(|(_, rests)| *rests);
        let mut readings: Vec<(f64, Valued)> = resting.filter_map(|(p, _)| Some((p.middle_s(), p.of(log, channel)?))).collect();
        readings.sort_by(|a, b| a.0.total_cmp(&b.0));
        let steps = readings.windows(2).filter(|w| w[1].0 > w[0].0);
        // a change within two standard errors is no wandering
        let rates: Vec<f64> = steps
            .map(|w| {
                let ((before, a), (after, b)) = (w[0], w[1]);
                let (step, chance) = ((b.0 - a.0).powi(2), a.1.powi(2) + b.1.powi(2));
                if step > 4.0 * chance { (step - chance) / (after - before) } else { 0.0 }
            })
            .collect();
        let wander = if rates.is_empty() { 0.0 } else { rates.iter().sum::<f64>() / rates.len() as f64 };
        (!readings.is_empty()).then_some(Self { readings, wander })
    }

    /// The zero at an instant, and its standard error.
    #[must_use]
    pub fn at(&self, t_s: f64) -> Valued {
        let after = self.readings.partition_point(|(t, _)| *t <= t_s);
        let held = |(t, (v, se)): (f64, Valued)| (v, (se * se + self.wander * (t_s - t).abs()).sqrt());
        let (Some(before), Some(next)) = (after.checked_sub(1).map(|k| self.readings[k]), self.readings.get(after)) else {
            return held(self.readings[after.min(self.readings.len() - 1)]);
        };
        let whole = next.0 - before.0;
        let u = (t_s - before.0) / whole;
        let bridge = self.wander * whole * u * (1.0 - u);
        let ((a, a_se), (b, b_se)) = (before.1, next.1);
        (a + u * (b - a), (((1.0 - u) * a_se).powi(2) + (u * b_se).powi(2) + bridge).sqrt())
    }

    /// A reading less the zero of its instant.
    #[must_use]
    pub fn off(zero: Option<&Self>, t_s: f64, (v, se): Valued) -> Valued {
        zero.map_or((v, se), |zero| {
            let (z, z_se) = zero.at(t_s);
            (v - z, se.hypot(z_se))
        })
    }

    /// Lowest and highest reading.
    #[must_use]
    pub fn range(&self) -> (f64, f64) {
        let readings = self.readings.iter().map(|(_, (v, _))| *v);
        (readings.clone().fold(f64::INFINITY, f64::min), readings.fold(f64::NEG_INFINITY, f64::max))
    }

    /// What is taken off, in words: "0.085 N read at rest".
    #[must_use]
    pub fn words(&self, unit: &str) -> String {
        let (low, high) = self.range();
        match self.readings.len() {
            1 => format!("{low:.4} {unit}, read at rest"),
            n => format!("{low:.4} to {high:.4} {unit}, read on {n} levels at rest and on a line between them"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    fn zero(readings: &[(f64, f64)]) -> Option<Zero> {
        let log = Log { columns: vec![Column { name: "thrust_n".into(), values: vec![0.0] }], ..Log::default() };
        let plateau =
            |t: f64, v: f64| Plateau { from_s: t, to_s: t, first: 0, rows: 9, settling_s: 0.0, means: vec![Some((v, 0.01))] };
        let mut plateaus: Vec<Plateau> = readings.iter().map(|(t, v)| plateau(*t, *v)).collect();
        let mut speed = vec![Some((0.0, 1.0)); plateaus.len()];
        plateaus.push(plateau(5.0, 9.0));
        speed.push(Some((8000.0, 1.0)));
        Zero::of(&log, &plateaus, &speed, "thrust_n")
    }

    #[test]
    fn it_is_the_reading_at_rest_and_a_line_between_two() {
        let one = zero(&[(0.0, 0.2)]).expect("a level at rest");
        assert_eq!(one.at(50.0), (0.2, 0.01));
        let two = zero(&[(0.0, 0.0), (100.0, 0.2)]).expect("two");
        assert_eq!(two.at(0.0).0, 0.0);
        assert!((two.at(25.0).0 - 0.05).abs() < 1e-12 && two.at(50.0).1 > 0.05, "{:?}", two.at(50.0));
        assert!((two.at(100.0).0 - 0.2).abs() < 1e-12 && (two.at(100.0).1 - 0.01).abs() < 1e-9);
        assert_eq!(Zero::off(Some(&two), 100.0, (1.2, 0.0)).0, 1.0);
        assert!(zero(&[]).is_none());
    }
}
