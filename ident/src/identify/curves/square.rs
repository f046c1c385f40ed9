//! Thrust and torque by the square of the speed: k_T and k_Q.
//!
//! What it is: the slope over omega^2 on the zero that was read at rest, whose error is one more unknown; without a level at rest through the
//! origin. Levels that stand far out by a robust measure are left out.
//! What can go wrong: the square is not the law of a rotor at every speed: then the interval is as wide as the levels' own quotients ask for.
//! Units: SI; omega^2 in 1e5 rad^2/s^2 within, so that the numbers are of order one.
//! Reference: Beharie 2013, Figure 5.78; Bonferroni (the farthest of n levels).

use super::power::{TOO_SMALL, Valued};
use super::{Curve, Estimate, Law, Origin, Point, STRAY, Zero};
use crate::log::Log;
use crate::numeric::order::median;
use crate::numeric::solve::Normal;
use crate::plateau::Plateau;
use statrs::distribution::{ContinuousCDF, Normal as Gauss, StudentsT};
use std::f64::consts::TAU;

/// Scale of omega^2.
const SCALE: f64 = 1e5;

/// A turning level: omega^2 and the channel on its zero.
struct Level {
    x: Valued,
    y: Valued,
    /// Standard error of the zero at its time.
    zero: f64,
}

impl Level {
    fn quotient(&self) -> f64 {
        self.y.0 / self.x.0
    }

    /// Standard error of the quotient: of both readings and of the zero.
    fn error(&self, slope: f64) -> f64 {
        self.y.1.hypot(slope * self.x.1).hypot(self.zero) / self.x.0
    }
}

/// Coefficient of omega^2: k_T for thrust, k_Q for torque, and how well the law describes the levels.
///
/// Where the square is not the law the interval reaches to every level's own quotient, their errors aside. Where no level is at rest it reaches
/// to the slope with a free zero as well. A table's rows have no errors of their own: their quotients count as they are.
#[must_use]
pub fn square_law(
    log: &Log,
    plateaus: &[Plateau],
    speed: &[Option<Valued>],
    channel: &str,
    zero: Option<&Zero>,
) -> Option<(Estimate, Law)> {
    let (levels, shared) = turning(log, plateaus, speed, channel, zero);
    let (outliers, slope) = strays(&levels)?;
    let kept: Vec<&Level> = levels.iter().enumerate().filter(|(k, _)| !outliers.contains(k)).map(|(_, level)| level).collect();
    let fitted = Line::fit(&kept, slope, zero.map_or(Zeroed::Origin, |_| Zeroed::Read(shared)))?;
    let unit = if channel == "thrust_n" { "N" } else { "N.m" };
    let origin = zero.map_or(Origin::Unread, |zero| Origin::Read(zero.range(), unit));
    let law = Law { origin, ..Law::of(fitted.chi2, fitted.freedom).without(outliers.len(), levels.len()) };
    let on_zero = if law.holds { fitted } else { Line::fit(&kept, slope, Zeroed::Origin)? };
    let mut k = on_zero.estimate();
    let table = plateaus.iter().all(|p| p.rows == 1);
    let all = STRAY * outliers.len() > levels.len();
    let middle = median(&mut levels.iter().map(|l| l.x.0).collect::<Vec<_>>());
    // at low speeds a zero that is a little off decides the quotient
    let counts = |(i, level): &(usize, &Level)| all && level.x.0 > middle || !outliers.contains(i);
    let errors = if table { 0.0 } else { farthest(law.holds, kept.len()) };
    let off = |level: &Level| (level.quotient() - k.value).abs() - errors * level.error(slope);
    let mut wide = levels.iter().enumerate().filter(counts).map(|(_, level)| off(level)).fold(k.half, f64::max);
    if zero.is_none() {
        let free = Line::fit(&kept, slope, Zeroed::Free).map(|line| line.estimate());
        wide = free.map_or(wide, |free| wide.max((free.value - k.value).abs() + free.half));
    }
    k.se *= wide / k.half.max(f64::MIN_POSITIVE);
    k.half = wide;
    for v in [&mut k.value, &mut k.se, &mut k.half] {
        *v /= SCALE;
    }
    Some((k, law))
}

/// Standard errors that a level may be off by chance: one of them at a time, or the farthest of `n` where the law holds.
fn farthest(holds: bool, n: usize) -> f64 {
    let tail = if holds { 0.025 / n as f64 } else { 0.025 };
    Gauss::standard().inverse_cdf(1.0 - tail)
}

/// The levels whose quotient says more than its own error, on their zero; and the usual error of the zero.
fn turning(log: &Log, plateaus: &[Plateau], speed: &[Option<Valued>], channel: &str, zero: Option<&Zero>) -> (Vec<Level>, f64) {
    let mut shared = Vec::new();
    let mut levels: Vec<Level> = Vec::new();
    for (p, s) in plateaus.iter().zip(speed) {
        let (Some((rpm, rpm_error)), Some((y, error))) = (*s, p.of(log, channel)) else { continue };
        let omega = rpm * TAU / 60.0;
        let (z, z_error) = zero.map_or((0.0, 0.0), |zero| zero.at(p.middle_s()));
        shared.push(z_error);
        let x = (omega * omega / SCALE, 2.0 * omega * rpm_error * TAU / 60.0 / SCALE);
        levels.push(Level { x, y: (y - z, error), zero: z_error });
    }
    let top = levels.iter().map(|l| l.x.0).fold(0.0, f64::max);
    levels.retain(|l| l.x.0 > TOO_SMALL * top);
    (levels, if shared.is_empty() { 0.0 } else { median(&mut shared) })
}

/// Levels whose quotient does not belong to the others', and the usual quotient.
fn strays(levels: &[Level]) -> Option<(Vec<usize>, f64)> {
    let usual = median(&mut levels.iter().map(Level::quotient).collect::<Vec<_>>());
    let point = |l: &Level| Point { x: l.x.0, x_error: 0.0, y: l.quotient(), y_error: l.error(usual) };
    let curve = Curve::fit(&levels.iter().map(point).collect::<Vec<_>>(), 0)?;
    Some((curve.outliers.clone(), curve.coefficients[0]))
}

/// Where a line meets rest.
#[derive(Clone, Copy)]
enum Zeroed {
    /// At nothing.
    Origin,
    /// At nothing, give or take a standard error.
    Read(f64),
    /// Anywhere.
    Free,
}

/// A line through levels.
struct Line {
    slope: f64,
    variance: f64,
    chi2: f64,
    freedom: usize,
}

impl Line {
    fn fit(levels: &[&Level], slope: f64, zeroed: Zeroed) -> Option<Self> {
        let variances: Vec<f64> = levels.iter().map(|l| l.y.1.powi(2) + (slope * l.x.1).powi(2)).collect();
        // none counts more than ten usual ones, and readings without noise have their digits
        let top = levels.iter().map(|l| l.y.0.abs()).fold(0.0, f64::max);
        let least = (0.1 * median(&mut variances.clone())).max((1e-9 * top).powi(2)).max(f64::MIN_POSITIVE);
        let weights: Vec<f64> = variances.iter().map(|v| 1.0 / v.max(least)).collect();
        let unknowns = if matches!(zeroed, Zeroed::Origin) { 1 } else { 2 };
        let mut normal = Normal::new(unknowns);
        for (l, w) in levels.iter().zip(&weights) {
            normal.add(&[l.x.0, 1.0][..unknowns], l.y.0, *w);
        }
        let prior = match zeroed {
            Zeroed::Read(se) => Some(1.0 / se.powi(2).max(0.01 * least)),
            _ => None,
        };
        if let Some(weight) = prior {
            normal.add(&[0.0, 1.0], 0.0, weight);
        }
        let solved = normal.solve()?;
        let (slope, offset) = (solved.coefficients[0], solved.coefficients.get(1).copied().unwrap_or(0.0));
        let left: f64 = levels.iter().zip(&weights).map(|(l, w)| w * (l.y.0 - offset - slope * l.x.0).powi(2)).sum();
        let rss = left + prior.map_or(0.0, |weight| weight * offset * offset);
        let freedom = (levels.len() + usize::from(prior.is_some())).checked_sub(unknowns).filter(|f| *f > 0)?;
        let chi2 = rss / freedom as f64;
        Some(Self { slope, variance: solved.inverse[(0, 0)] * chi2.max(1e-12), chi2, freedom })
    }

    fn estimate(&self) -> Estimate {
        let quantile = StudentsT::new(0.0, 1.0, self.freedom as f64).map_or(1.96, |t| t.inverse_cdf(0.975));
        let se = self.variance.max(0.0).sqrt();
        Estimate { value: self.slope, se, half: quantile * se }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    /// Levels of thrust `of` a speed in rev/min; the mean of each has an error of 2 mN.
    fn law(speeds: &[f64], of: impl Fn(f64) -> f64) -> (Estimate, Law, Vec<f64>) {
        let log = Log { columns: vec![Column { name: "thrust_n".into(), values: vec![0.0] }], ..Log::default() };
        let level = |(k, rpm): (usize, &f64)| Plateau {
            from_s: k as f64,
            to_s: k as f64,
            first: 0,
            rows: 50,
            settling_s: 0.0,
            means: vec![Some((of(*rpm) + 0.002 * (k as f64 * 2.4).sin(), 0.002))],
        };
        let plateaus: Vec<Plateau> = speeds.iter().enumerate().map(level).collect();
        let speed: Vec<Option<Valued>> = speeds.iter().map(|rpm| Some((*rpm, 0.5))).collect();
        let zero = Zero::of(&log, &plateaus, &speed, "thrust_n");
        let (k, law) = square_law(&log, &plateaus, &speed, "thrust_n", zero.as_ref()).expect("a law");
        let turning = plateaus.iter().zip(speeds).filter(|(_, rpm)| **rpm > 1000.0);
        let quotient = |(p, rpm): (&Plateau, &f64)| {
            Zero::off(zero.as_ref(), p.middle_s(), p.means[0].expect("a mean")).0 / (rpm * TAU / 60.0).powi(2)
        };
        (k, law, turning.map(quotient).collect())
    }

    const K: f64 = 1.5e-5;

    fn square(rpm: f64) -> f64 {
        K * (rpm * TAU / 60.0).powi(2)
    }

    #[test]
    fn the_zero_is_what_is_read_at_rest() {
        let speeds: Vec<f64> = (0..12).map(|k| 600.0 * f64::from(k)).collect();
        let (k, law, _) = law(&speeds, |rpm| 0.3 + square(rpm));
        assert!(law.holds && k.holds(K) && k.half < 0.01 * K, "{k:?} {law:?}");
        assert!(law.words().contains("zero 0.3") && law.words().contains("read at rest"), "{}", law.words());
    }

    /// A rotor whose thrust grows faster than the square: the line through all levels would meet rest far below what is read there.
    #[test]
    fn where_the_square_is_no_law_every_quotient_lies_within() {
        let speeds: Vec<f64> = (0..12).map(|k| 600.0 * f64::from(k)).collect();
        let (k, law, quotients) = law(&speeds, |rpm| square(rpm) * (0.8 + rpm / 30_000.0));
        assert!(!law.holds, "{law:?}");
        for q in &quotients[1..] {
            assert!((q - k.value).abs() <= k.half * 1.05, "{q} of {k:?}");
        }
    }

    /// Without a level at rest a zero is not guessed: both the origin and a free zero lie within, and so does every quotient.
    #[test]
    fn without_a_level_at_rest_the_interval_holds_the_levels_own_quotients() {
        let speeds: Vec<f64> = (0..12).map(|k| 2700.0 + 350.0 * f64::from(k)).collect();
        let (k, law, quotients) = law(&speeds, |rpm| square(rpm) * (0.96 + rpm / 170_000.0));
        // but for what the mean of a level may be off by chance, most of a quotient at the lowest speed
        let by_chance = 3.0 * 0.002 / (2700.0 * TAU / 60.0).powi(2);
        assert!(quotients.iter().all(|q| (q - k.value).abs() <= k.half + by_chance), "{quotients:?} {k:?}");
        assert!(law.words().contains("no level is at rest"), "{}", law.words());
    }
}
