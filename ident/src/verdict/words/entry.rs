//! What an entry of a verdict says of itself: its parameters in clauses, and what kind of name it is.
//!
//! What it is: sizes for an effect's own clause, told only as far as their intervals support them.
//! What can go wrong: a size that its interval does not support is left out.
//! Units: as the parameters state.
//! Reference: GUM, clause 7.2.6 (digits of a result).

use super::{DISAGREE, OTHERWISE, POSITIVE, SURE, meter, parameter_of, sized};
use crate::verdict::BY_READINGS;
use crate::verdict::OF_THE_SUPPLY;
use crate::verdict::TOLD_BY_THE_BOARD;
use crate::verdict::{EffectEntry, Parameter};

/// Parameters that are no sizes.
const NO_SIZE: [&str; 4] = ["t0", "t1", "peak_time", "phase"];
/// Width of an interval, as a share of its value, from which on one value is true of no run: one that a reader would miss by a fifth.
const OF_NO_RUN: f64 = 0.4;

impl EffectEntry {
    /// Whether it tells of a few readings alone: of no cause that a rig has, and not worth a headline beside one.
    #[must_use]
    pub fn is_of_single_readings(&self) -> bool {
        self.id == "glitch_rows"
    }

    /// A parameter.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&Parameter> {
        self.parameters.iter().find(|p| p.name == name)
    }

    /// `with` the size of a parameter, or `without` where the run does not show it.
    #[must_use]
    pub fn tell(&self, name: &str, with: impl Fn(&str) -> String, without: &str) -> String {
        self.parameter(name).and_then(sized).map_or_else(|| without.to_owned(), |v| with(&v))
    }

    /// The same in another unit that means as much: `V` (each ampere) for `ohm`; `%` for a share.
    #[must_use]
    pub fn tell_in(&self, name: &str, unit: &str, with: impl Fn(&str) -> String, without: &str) -> String {
        self.tell_times(name, if unit == "%" { 100.0 } else { 1.0 }, unit, with, without)
    }

    /// The size of a parameter without its sign in words of its own, in a unit that means as much; `word` is the one for up or the one for down.
    #[must_use]
    pub fn tell_signed(
        &self,
        name: &str,
        (factor, unit): (f64, &str),
        [up, down]: [&str; 2],
        with: impl Fn(&str, &str) -> String,
        without: &str,
    ) -> String {
        let rises = self.parameter(name).is_none_or(|p| p.value >= 0.0);
        let (sign, word) = if rises { (factor, up) } else { (-factor, down) };
        self.tell_times(name, sign, unit, |size| with(word, size), without)
    }

    /// The same times a factor.
    #[must_use]
    pub fn tell_times(&self, name: &str, factor: f64, unit: &str, with: impl Fn(&str) -> String, without: &str) -> String {
        let scaled = self.parameter(name).map(|p| Parameter {
            name: p.name.clone(),
            value: factor * p.value,
            unit: unit.to_owned(),
            ci95: p.ci95.map(|v| factor * v),
        });
        scaled.as_ref().and_then(sized).map_or_else(|| without.to_owned(), |v| with(&v))
    }

    /// The length of a vector, `NAME_x` to `NAME_z`, with its interval carried along.
    #[must_use]
    pub fn tell_length(&self, name: &str, unit: &str, with: impl Fn(&str) -> String, without: &str) -> String {
        let axes = ["x", "y", "z"].map(|axis| format!("{name}_{axis}"));
        self.tell_length_of(&axes.each_ref().map(String::as_str), unit, with, without)
    }

    /// The length of a vector from the parameters that are its axes.
    #[must_use]
    pub fn tell_length_of(&self, axes: &[&str], unit: &str, with: impl Fn(&str) -> String, without: &str) -> String {
        let axes: Vec<&Parameter> = axes.iter().filter_map(|axis| self.parameter(axis)).collect();
        let length = axes.iter().map(|p| p.value * p.value).sum::<f64>().sqrt();
        let half = axes.iter().map(|p| (p.value / length * 0.5 * (p.ci95[1] - p.ci95[0])).powi(2)).sum::<f64>().sqrt();
        let whole = Parameter { name: String::new(), value: length, unit: unit.to_owned(), ci95: [length - half, length + half] };
        sized(&whole).map_or_else(|| without.to_owned(), |v| with(&v))
    }

    /// The meter of its first channel: "the load cell". Where a speed is late, the other channels are those that are ahead of it.
    #[must_use]
    pub fn meter(&self) -> String {
        let speeds: Vec<&String> = self
            .channels
            .iter()
            .filter(|c| c.starts_with("rpm") && crate::channel::DIFFERENCES.iter().all(|d| d.1 != **c))
            .collect();
        match speeds.as_slice() {
            [] => {}
            [one] => return meter(one),
            _ => return "every speed sensor".to_owned(),
        }
        // of one amplifier for both cells of a stand the one that measures thrust is the one that is known
        let known = self.channels.iter().find(|c| *c == "thrust_n").or(self.channels.first());
        known.map_or_else(|| "a meter".to_owned(), |c| meter(c))
    }

    /// Unit of its first channel.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        self.channels.first().map_or("", |c| crate::channel::unit_of(c))
    }

    /// Whether the readings themselves show it, so that no prediction changes.
    #[must_use]
    pub fn is_read_off(&self) -> bool {
        [TOLD_BY_THE_BOARD, OF_THE_SUPPLY, BY_READINGS].iter().any(|form| self.equation.ends_with(&format!("[{form}]")))
    }

    /// Whether it began within the run, and did not end.
    #[must_use]
    pub fn has_begun(&self) -> bool {
        self.parameter("t0").is_some() && self.parameter("t1").is_none() && !self.is_since_before()
    }

    /// Of an effect of several sizes none of which is well known how many may each be zero, where most of them may, and how many it has. Instants
    /// and times are no sizes.
    #[must_use]
    pub fn open_sizes(&self) -> Option<(usize, usize)> {
        let sizes: Vec<&Parameter> = self.parameters.iter().filter(|p| !POSITIVE.contains(&p.unit.as_str())).collect();
        let open = sizes.iter().filter(|p| p.ci95[0] <= 0.0 && p.ci95[1] >= 0.0).count();
        let known = sizes.iter().any(|p| sized(p).is_some());
        (self.id != "unknown" && !known && open > 1 && 2 * open > sizes.len()).then_some((open, sizes.len()))
    }

    /// The sizes whose interval holds zero. When something happened, and where in its row a reading lies, is no size.
    pub fn may_be_zero(&self) -> impl Iterator<Item = &Parameter> {
        self.sizes().filter(|p| p.ci95[0] <= 0.0 && p.ci95[1] >= 0.0)
    }

    fn sizes(&self) -> impl Iterator<Item = &Parameter> {
        self.parameters.iter().filter(|p| self.id != "unknown" && !NO_SIZE.contains(&p.name.as_str()))
    }

    /// The probability that words tell: where every size may be zero they are not surer than the intervals.
    #[must_use]
    pub fn told_probability(&self) -> f64 {
        let open = self.sizes().next().is_some() && self.sizes().count() == self.may_be_zero().count();
        if open { self.probability.min(SURE - 1e-3) } else { self.probability }
    }

    /// How the runs that share it stand to each other, where they do not agree: what is known of it besides, how they differ, and their sizes.
    #[must_use]
    pub(crate) fn apart(&self) -> Option<(&str, &'static str, &str)> {
        [DISAGREE, OTHERWISE].into_iter().find_map(|how| {
            let (known, rest) = self.evidence.split_once(&format!("; {how}:"))?;
            Some((known, how, rest.trim()))
        })
    }

    /// The sizes of the runs that share it, where they differ so much that one value is true of none: "0.08 to 0.2 ohm for the resistance".
    #[must_use]
    pub(crate) fn of_no_run(&self) -> Option<&str> {
        let (_, _, alone) = self.apart().filter(|(_, how, _)| *how == DISAGREE)?;
        let wide = |p: &Parameter| p.ci95[1] - p.ci95[0] > OF_NO_RUN * p.value.abs();
        self.parameters.iter().any(|p| alone.ends_with(&parameter_of(&self.id, &p.name)) && wide(p)).then_some(())?;
        alone.strip_prefix("alone they have ")
    }

    /// Whether it was there before the run began.
    #[must_use]
    pub fn is_since_before(&self) -> bool {
        self.equation.contains("since before the run")
    }
}
