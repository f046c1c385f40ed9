//! What has no name: a smooth function of one variable on one channel.
//!
//! What it is: straight lines between knots at the variable's own quantiles, each height with the channel's own scale as its prior.
//! What can go wrong: a variable that hardly moves makes columns that are one with each other and brings nothing.
//! Units: those of channel and variable.
//! Reference: additive models, Hastie & Tibshirani 1990.

use super::channels::Target;
use super::columns::{Flight, Sink};
use super::model::Coefficient;
use super::scene::Scene;
use crate::attribution::columns::channel::rms;
use crate::attribution::columns::{Candidate, Prior, UNKNOWN};
use crate::flight::effects::Told;
use crate::verdict::Parameter;
use crate::verdict::Scope;
use crate::verdict::words::{channel, digits};

/// A variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variable {
    /// Velocity through the air along a body axis.
    Air(usize),
    /// Speed through the air across the rotors.
    Across,
    /// Height.
    Height,
    /// Rate about an axis.
    Rate(usize),
    /// Sum of what drives the rotors.
    Drive,
    /// Time.
    Time,
}

/// All of them.
const VARIABLES: [Variable; 10] = [
    Variable::Air(0),
    Variable::Air(1),
    Variable::Air(2),
    Variable::Across,
    Variable::Height,
    Variable::Rate(0),
    Variable::Rate(1),
    Variable::Rate(2),
    Variable::Drive,
    Variable::Time,
];
/// Knots, as quantiles.
const KNOTS: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0];
/// Height of a knot as a share of the channel's own scatter.
const USUAL: f64 = 0.3;
const NAMES: [&str; 6] = ["at_0", "at_1", "at_2", "at_3", "at_4", "at_5"];

impl Variable {
    /// In words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Air(0) => "vel_forward",
            Self::Air(1) => "vel_right",
            Self::Air(_) => "vel_down",
            Self::Across => "speed_across",
            Self::Height => "height",
            Self::Rate(0) => "gyro_x",
            Self::Rate(1) => "gyro_y",
            Self::Rate(_) => "gyro_z",
            Self::Drive => "rpm",
            Self::Time => "t_s",
        }
    }

    /// What it is called at an axis; `by_command` where no speed of a rotor is known.
    pub(crate) fn label(self, by_command: bool) -> String {
        match self {
            Self::Drive if by_command => "sum of the rotors' commands, each 1 at full".to_owned(),
            Self::Drive => "speed of all rotors together".to_owned(),
            other => channel(other.name()),
        }
    }

    /// Its unit; `by_command` as with its label.
    pub(crate) fn unit(self, by_command: bool) -> &'static str {
        self.said(by_command).1
    }

    /// The one that an effect's variable means for a channel: of a vector the part along the channel's own axis.
    pub(crate) fn meant(name: &str, channel: &str) -> Option<Self> {
        let axis = ["_x", "_y", "_z"].iter().position(|end| channel.ends_with(end));
        match (name, axis) {
            ("vel", Some(2) | None) => Some(Self::Across),
            ("vel", Some(k)) => Some(Self::Air(k)),
            ("gyro", Some(k)) => Some(Self::Rate(k)),
            ("pos_z", _) => Some(Self::Height),
            (COMMANDS, _) => Some(Self::Drive),
            (name, _) => VARIABLES.into_iter().find(|v| v.name() == name && *v != Self::Time),
        }
    }

    /// What a value of it is, as people say it, and its unit; `by_command` where no speed of a rotor is known.
    fn said(self, by_command: bool) -> (&'static str, &'static str) {
        match self {
            Self::Air(0) => ("forward through the air", "m/s"),
            Self::Air(1) => ("to the right through the air", "m/s"),
            Self::Air(_) => ("down through the air", "m/s"),
            Self::Across => ("through the air across the rotors", "m/s"),
            Self::Height => ("of height", "m"),
            Self::Rate(0) => ("of turn rate (x)", "rad/s"),
            Self::Rate(1) => ("of turn rate (y)", "rad/s"),
            Self::Rate(_) => ("of turn rate (z)", "rad/s"),
            Self::Drive if by_command => ("of full, all commands together", ""),
            Self::Drive => ("of all rotors together", "rad/s"),
            Self::Time => ("of the log's time", "s"),
        }
    }

    /// Its values in each window; `None` where the flight lacks it.
    pub(crate) fn values(self, flight: &Flight, scene: &Scene<'_>) -> Option<Vec<f64>> {
        let windows = &flight.windows;
        match self {
            Self::Air(k) => scene.air.as_ref().map(|v| windows.mean(&v[k])),
            Self::Across => {
                let rows: Vec<f64> = (0..scene.len()).map(|i| scene.air_at(i).xy().norm()).collect();
                scene.air.as_ref().map(|_| windows.mean(&rows))
            }
            Self::Height => flight.record.height.as_ref().map(|h| windows.mean(h)),
            Self::Rate(k) => flight.record.rate.as_ref().map(|w| windows.mean(&w[k])),
            Self::Drive => Some(windows.mean(&scene.drives(|_| 1.0))),
            Self::Time => Some(windows.t.clone()),
        }
    }
}

/// A function that may be asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Nameless {
    /// On which channel.
    pub target: Target,
    /// Of which variable.
    pub variable: Variable,
    knots: Vec<f64>,
    size: f64,
    by_command: bool,
}

/// What drives the rotors where no speed was measured, as a verdict's variable.
pub(crate) const COMMANDS: &str = "commands";

/// Share of the range between the outer knots to which a knot is told: where straight lines meet is chosen, not measured.
const TOLD: f64 = 0.005;

impl Nameless {
    /// All that may be asked of a flight, each with its candidate.
    #[must_use]
    pub fn all(flight: &Flight) -> Vec<(Candidate, Self)> {
        let scene = Scene::declared(&flight.record);
        let known: Vec<(Variable, Vec<f64>)> = VARIABLES
            .iter()
            .filter_map(|v| Some((*v, v.values(flight, &scene).filter(|x| x.iter().all(|x| x.is_finite()))?)))
            .collect();
        let mut out = Vec::new();
        for (channel, target) in flight.channels.channels.iter().zip(&flight.channels.targets) {
            let mean = channel.y.iter().sum::<f64>() / channel.len() as f64;
            let size = USUAL * rms(&channel.y.iter().map(|y| y - mean).collect::<Vec<_>>()) + channel.floor;
            for (variable, values) in &known {
                let knots = knots(values);
                let apart = knots.windows(2).all(|w| w[1] > w[0]);
                if apart {
                    let form = format!("{} by {}", channel.name, variable.name());
                    let own =
                        Self { target: *target, variable: *variable, knots, size, by_command: flight.record.speed.is_empty() };
                    let (shapes, starts) = (Vec::new(), vec![Vec::new()]);
                    out.push((Candidate { id: UNKNOWN, form, shapes, starts, needs: Vec::new(), excludes: Vec::new() }, own));
                }
            }
        }
        // one variable a channel: what needs more than that has no readable equation
        let forms: Vec<(Target, String)> = out.iter().map(|(c, n)| (n.target, c.form.clone())).collect();
        for (candidate, own) in &mut out {
            candidate.excludes = forms
                .iter()
                .filter(|(t, f)| *t == own.target && *f != candidate.form)
                .map(|(_, f)| (UNKNOWN, f.clone()))
                .collect();
        }
        out
    }

    /// One that a model holds, by its form and its knots; `None` where the flight has no such channel.
    #[must_use]
    pub fn told(flight: &Flight, form: &str, knots: &[f64]) -> Option<Self> {
        let (channel, variable) = form.split_once(" by ")?;
        let target = *flight.channels.targets.iter().find(|t| t.name() == channel)?;
        let variable = *VARIABLES.iter().find(|v| v.name() == variable)?;
        let by_command = flight.record.speed.is_empty();
        (knots.len() == KNOTS.len()).then(|| Self { target, variable, knots: knots.to_vec(), size: 1.0, by_command })
    }

    /// Where its straight lines meet.
    #[must_use]
    pub fn knots(&self) -> &[f64] {
        &self.knots
    }

    /// Adds its columns.
    pub fn columns(&self, sink: &mut Sink<'_>) {
        let Some(values) = self.variable.values(sink.flight, sink.scene) else { return };
        for (k, name) in NAMES.into_iter().enumerate().take(self.knots.len()) {
            let heights = values.iter().map(|v| hat(&self.knots, k, *v)).collect();
            sink.column(name, Prior::about_zero(self.size)).window(self.target, heights);
        }
    }

    /// What it belongs to: the vehicle, but a course of time is its own flight's.
    #[must_use]
    pub fn scope(&self) -> Scope {
        if self.variable == Variable::Time { Scope::Run } else { Scope::Rig }
    }

    /// Its heights as parameters.
    #[must_use]
    pub fn parameters(&self, heights: &[Coefficient]) -> Vec<Parameter> {
        let one = |(knot, height): (&f64, &Coefficient)| Parameter {
            name: self.place(*knot),
            value: height.value,
            unit: self.target.unit().to_owned(),
            ci95: [height.value - 1.96 * height.se, height.value + 1.96 * height.se],
        };
        self.knots.iter().zip(heights).map(one).collect()
    }

    /// A knot to the digits that tell it from its neighbours.
    fn knot(&self, knot: f64) -> String {
        let range = self.knots.last().zip(self.knots.first()).map_or(0.0, |(last, first)| last - first);
        let places = (-(TOLD * range).max(f64::MIN_POSITIVE).log10()).ceil().clamp(0.0, 9.0) as usize;
        format!("{knot:.places$}")
    }

    /// Where a height stands: "at 1715.4 rad/s of all rotors together".
    fn place(&self, knot: f64) -> String {
        let (said, unit) = self.variable.said(self.by_command);
        let parts = ["at", &self.knot(knot), unit, said];
        parts.into_iter().filter(|p| !p.is_empty()).collect::<Vec<_>>().join(" ")
    }

    /// The variable that it goes with, as a verdict has it.
    #[must_use]
    pub fn depends_on(&self) -> String {
        let commands = self.variable == Variable::Drive && self.by_command;
        if commands { COMMANDS } else { self.variable.name() }.to_owned()
    }

    /// The function in words.
    #[must_use]
    pub fn equation(&self, heights: &[Told]) -> String {
        let point = |(x, y): (&f64, &Told)| format!("({}, {})", self.knot(*x), digits(y.value, y.se));
        let points: Vec<String> = self.knots.iter().zip(heights).map(point).collect();
        format!("{} += straight lines over {} through {}", self.target.name(), self.depends_on(), points.join(", "))
    }
}

fn knots(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    KNOTS.iter().map(|q| sorted.get((q * last as f64).round() as usize).copied().unwrap_or(0.0)).collect()
}

/// Height at `x` of the function that is 1 at knot `k`, 0 at the others, and level beyond the ends.
fn hat(knots: &[f64], k: usize, x: f64) -> f64 {
    let last = knots.len() - 1;
    let x = x.clamp(knots[0], knots[last]);
    let rising = k > 0 && x < knots[k];
    if rising {
        ((x - knots[k - 1]) / (knots[k] - knots[k - 1])).max(0.0)
    } else if k < last {
        ((knots[k + 1] - x) / (knots[k + 1] - knots[k])).clamp(0.0, 1.0)
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where the lines meet is told in words, with a unit, and to the digits that tell one from the next.
    #[test]
    fn knots_are_told_in_words() {
        let knots = [1_252.896_8, 1_715.356_6, 1_719.436_5, 1_722.151_6, 1_726.517_2, 1_809.392_4].to_vec();
        let own = |variable, knots: &[f64]| Nameless {
            target: Target::Voltage,
            variable,
            knots: knots.to_vec(),
            size: 1.0,
            by_command: false,
        };
        let drive = own(Variable::Drive, &knots);
        let names: Vec<String> = drive
            .parameters(&vec![Coefficient { name: String::new(), value: 0.1, se: 0.01 }; 6])
            .into_iter()
            .map(|p| p.name)
            .collect();
        assert_eq!(names[0], "at 1253 rad/s of all rotors together");
        assert_eq!(names[2], "at 1719 rad/s of all rotors together");
        let heights = vec![Told { value: 0.012_345_678, se: 0.001_2 }; 6];
        assert!(drive.equation(&heights).contains("(1253, 0.012), (1715, 0.012)"), "{}", drive.equation(&heights));
        assert_eq!(own(Variable::Height, &[0.0, 0.2, 0.4, 0.6, 0.8, 1.0]).place(0.2), "at 0.200 m of height");
    }

    #[test]
    fn hats_add_up_to_one() {
        let knots = [0.0, 1.0, 3.0];
        for x in [-1.0, 0.0, 0.4, 1.0, 2.2, 3.0, 9.0] {
            let sum: f64 = (0..3).map(|k| hat(&knots, k, x)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{x} {sum}");
        }
        assert!((hat(&knots, 1, 2.0) - 0.5).abs() < 1e-12 && hat(&knots, 2, 9.0) == 1.0);
    }
}
