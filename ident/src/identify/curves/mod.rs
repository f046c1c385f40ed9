//! Fits over plateaus: curves with bands, physical constants, time constants, each with an error that holds.
//!
//! What it is: the relations of section 5.7.3 through the means of the plateaus, weighted by their errors, robust to a plateau that
//! does not belong, with covariance and order selection; k_T, k_Q, KV, R, I0; spin-up times from the steps.
//! What can go wrong: too few plateaus or a missing channel leave a fit out; nothing is guessed.
//! Units: krpm and kus as regressors of curves; SI in constants.
//! Reference: specification `identification.md`, item 3; Beharie 2013, Figures 5.76 to 5.79.

mod curve;
mod declared;
mod motor;
pub mod power;
mod spin;
mod square;
pub mod surface;
mod zero;

pub(crate) use declared::declared;

pub use curve::{Curve, Order, Point};
pub use motor::{Motor, lacks, motor};
pub use spin::{Spin, spin};
pub use square::square_law;
pub use zero::Zero;

use crate::log::{Log, SPEED};
use crate::plateau::Plateau;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A value with its standard error and the half width of its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Standard error.
    pub se: f64,
    /// Half width of the 95 % interval, by Student's t where few plateaus speak.
    pub half: f64,
}

impl Estimate {
    /// Whether the 95 % interval holds a value.
    #[must_use]
    pub fn holds(&self, truth: f64) -> bool {
        (self.value - truth).abs() <= self.half
    }
}

/// A relation that the thesis fits.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// Short name, `thrust(rpm)`.
    pub name: &'static str,
    /// Column of the ordinate.
    pub y: String,
    /// Column of the abscissa: `rpm` for the consensus, or `pulse_us`.
    pub x: &'static str,
    /// Declared degree.
    pub degree: usize,
    /// The curve at that degree.
    pub curve: Curve,
    /// What other degrees would give.
    pub orders: Vec<Order>,
}

/// Scale of an abscissa: krpm and kus.
#[must_use]
pub fn scaled(x: &str, value: f64) -> f64 {
    if x == "pulse_us" { (value - 1000.0) / 1000.0 } else { value / 1000.0 }
}

/// Speed at each plateau, and its error: the mean over the speed channels that were measured, weighted by their errors.
#[must_use]
pub fn speeds(log: &Log, plateaus: &[Plateau], channels: &[String]) -> Vec<Option<(f64, f64)>> {
    let used: Vec<usize> = log
        .columns
        .iter()
        .enumerate()
        .filter(|(_, c)| SPEED.contains(&c.name.as_str()) && (channels.is_empty() || channels.contains(&c.name)))
        .map(|(i, _)| i)
        .collect();
    plateaus
        .iter()
        .map(|p| {
            let means: Vec<(f64, f64)> = used.iter().filter_map(|i| p.means[*i]).collect();
            // channels of one rotor share its own fluctuation: the mean of the errors, not their combination
            let n = means.len() as f64;
            (n > 0.0).then(|| (means.iter().map(|m| m.0).sum::<f64>() / n, means.iter().map(|m| m.1).sum::<f64>() / n))
        })
        .collect()
}

/// The relations of section 5.7.3 that a log has.
#[must_use]
pub fn relations(log: &Log, plateaus: &[Plateau], speed: &[Option<(f64, f64)>]) -> Vec<Fitted> {
    const WANTED: [(&str, &str, &str, usize); 6] = [
        ("rpm(pulse)", "rpm", "pulse_us", 3),
        ("thrust(rpm)", "thrust_n", "rpm", 2),
        ("torque(rpm)", "torque_nm", "rpm", 2),
        ("current(rpm)", "current_a", "rpm", 3),
        ("thrust(pulse)", "thrust_n", "pulse_us", 3),
        ("torque(pulse)", "torque_nm", "pulse_us", 3),
    ];
    WANTED
        .iter()
        .filter_map(|(name, y, x, degree)| {
            let value = |channel: &str, k: usize| {
                if channel == "rpm" { speed[k] } else { plateaus[k].of(log, channel) }
            };
            // a resting rotor says nothing of a curve over the command
            let turning = |k: usize| *x != "pulse_us" || speed.get(k).copied().flatten().is_none_or(|(v, _)| v > 1.0);
            let points: Vec<Point> = (0..plateaus.len())
                .filter(|k| turning(*k))
                .filter_map(|k| {
                    let ((x_value, x_error), (y_value, y_error)) = (value(x, k)?, value(y, k)?);
                    Some(Point { x: scaled(x, x_value), x_error: x_error / 1000.0, y: y_value, y_error })
                })
                .collect();
            let curve = Curve::fit(&points, *degree)?;
            let orders = Order::compare(&points, 4);
            Some(Fitted { name, y: (*y).to_owned(), x, degree: *degree, curve, orders })
        })
        .collect()
}

/// Where the zero of a law comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Origin {
    /// The law has none.
    Without,
    /// The levels at rest: their lowest and highest reading, and the unit.
    Read((f64, f64), &'static str),
    /// No level is at rest: readings are taken as they are.
    Unread,
}

/// How well a law describes its levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Law {
    /// Scatter of the levels about it over what their errors promise, squared, for each degree of freedom; 1 where both agree.
    pub chi2: f64,
    /// Levels less coefficients.
    pub freedom: usize,
    /// Whether chance alone could make them scatter so (p of 0.01 and more), and no more than a fifth of them was left out.
    pub holds: bool,
    /// Levels that were left out: far off in the light of the others.
    pub left_out: usize,
    /// Where its zero comes from.
    pub origin: Origin,
}

/// Probability below which a law is said not to hold.
const HOLDS: f64 = 0.01;
/// One in this many levels may be a stray one.
const STRAY: usize = 5;

impl Law {
    /// Of a reduced chi-squared.
    #[must_use]
    pub fn of(chi2: f64, freedom: usize) -> Self {
        let freely = freedom.max(1) as f64;
        let holds = ChiSquared::new(freely).is_ok_and(|law| law.sf(chi2 * freely) >= HOLDS);
        Self { chi2, freedom, holds, left_out: 0, origin: Origin::Without }
    }

    /// The same where some levels were left out. More than a fifth of all are no stray ones: something else acts on them.
    fn without(self, left_out: usize, all: usize) -> Self {
        Self { holds: self.holds && STRAY * left_out <= all, left_out, ..self }
    }

    /// In words.
    #[must_use]
    pub fn words(&self) -> String {
        let law =
            if self.holds { "the law holds" } else { "the law does not hold, the interval is widened to what the levels show" };
        let left_out = match self.left_out {
            0 => String::new(),
            1 => ", 1 level left out".to_owned(),
            n => format!(", {n} levels left out"),
        };
        let zero = match self.origin {
            Origin::Without => String::new(),
            Origin::Read((low, high), unit) if low == high => format!("; zero {low:.4} {unit}, read at rest"),
            Origin::Read((low, high), unit) => format!("; zero {low:.4} to {high:.4} {unit}, read at rest"),
            Origin::Unread => "; no level is at rest, so that the zero is taken as 0".to_owned(),
        };
        format!("chi2/dof {}, dof {}{left_out}, {law}{zero}", ratio(self.chi2), self.freedom)
    }
}

/// A chi-squared for each degree of freedom, to the digits that say something.
#[must_use]
pub fn ratio(chi2: f64) -> String {
    if chi2 < 100.0 { format!("{chi2:.2}") } else { format!("{chi2:.0}") }
}

/// Thrust coefficient C_T = T/(rho n^2 D^4) of a k_T, n in revolutions a second (UIUC's definition).
#[must_use]
pub fn thrust_coefficient(k_thrust: f64, diameter_m: f64, density: f64) -> f64 {
    k_thrust * std::f64::consts::TAU.powi(2) / (density * diameter_m.powi(4))
}
