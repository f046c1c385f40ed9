//! What a calibration found: the line, and every point's place on it.
//!
//! What it is: the fit of the points that were taken, refused where it is no scale of this channel; as a table for people, and as a file.
//! What can go wrong: values that are all the same, readings that are, a slope far from the design's: a value that was mistyped, or a mass that
//! was not hung on, becomes no calibration.
//! Units: the channel's own; counts.
//! Reference: Beharie 2013, Eq. 5.34-5.35.

use super::channel::Channel;
use super::line::{Known, Line, NoLine, line};
use super::point::Point;
use super::settle::Reading;
use crate::rig::date;
use firmware_rig::rig_config::Calibrated;
use std::fmt::Write;

/// First line of a file.
pub(crate) const FORMAT: &str = "# quadrig-rig-calibration 1";
/// Largest ratio between the slope that is found and the one before it.
const PLAUSIBLE: f64 = 4.0;
/// Share of the range from which on a residual is pointed at.
const WORTH_A_LOOK: f64 = 0.005;
/// Share from which on there is no line: a linear amplifier inside its range is ten times better.
const TOO_FAR: f64 = 0.03;

/// A point that was taken.
#[derive(Debug, Clone)]
pub(super) struct Taken {
    /// The known value.
    pub(super) point: Point,
    /// What the channel read.
    pub(super) reading: Reading,
}

impl Taken {
    fn known(&self) -> Known {
        Known { value: self.point.value, counts: self.reading.counts, sigma: self.reading.sigma }
    }
}

/// The scale that was found.
#[derive(Debug, Clone)]
pub(super) struct Found {
    channel: Channel,
    line: Line,
    taken: Vec<Taken>,
    before: Option<f64>,
    day: u16,
    arm_m: f64,
}

impl Found {
    /// The line through the points; `before` is the unit per count that was in force, where it is known.
    pub(super) fn of(channel: Channel, taken: Vec<Taken>, before: Option<f64>, day: u16, arm_m: f64) -> Result<Self, String> {
        let known: Vec<Known> = taken.iter().map(Taken::known).collect();
        let column = channel.column();
        let line = line(&known).map_err(|reason| match reason {
            NoLine::OneValue => format!("{column}: {} point(s) of one value; expected two different values or more", known.len()),
            NoLine::OneReading => {
                let counts = known.first().map_or(0.0, |k| k.counts);
                format!("{column}: every point reads {counts:.1} counts; is the channel connected, and were the values changed?")
            }
        })?;
        if let Some(before) = before {
            let ratio = line.gain / before;
            let signed = matches!(channel, Channel::Current | Channel::Voltage | Channel::Temperature);
            let size = if signed { ratio } else { ratio.abs() };
            if !(1.0 / PLAUSIBLE..=PLAUSIBLE).contains(&size) {
                return Err(format!(
                    "{column}: {:.6} {} a count, {ratio:.2} times the {before:.6} of the configuration; expected {:.2} to {PLAUSIBLE} times: \
                     a value mistyped, or a configuration of another channel?",
                    line.gain,
                    channel.unit(),
                    1.0 / PLAUSIBLE
                ));
            }
        }
        let found = Self { channel, line, taken, before, day, arm_m };
        // two points have none, and three values of two sizes hardly more
        match found.taken.iter().map(|t| (found.share(t), t)).max_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((share, worst)) if share > TOO_FAR => Err(format!(
                "{column}: {} is {:.1} % of the range off the line through all points; expected {:.0} %: is the channel saturated there, or the \
                 value mistyped?",
                worst.point.said,
                100.0 * share,
                100.0 * TOO_FAR
            )),
            _ => Ok(found),
        }
    }

    /// What a point is off by, as a share of the range of values.
    fn share(&self, taken: &Taken) -> f64 {
        self.line.residual_of(&taken.known()).abs() / self.range()
    }

    /// As the board takes it.
    pub(super) fn calibrated(&self) -> Calibrated {
        self.line.calibrated(self.day)
    }

    /// A table for people.
    pub(super) fn table(&self) -> String {
        let (unit, spoken) = (self.channel.unit(), self.channel.spoken(self.arm_m));
        let mut out = format!(
            "{:<14} {:>12} {:>10} {:>14} {:>14}\n",
            "point",
            "counts",
            "+-",
            format!("reads, {unit}"),
            format!("off by, {}", spoken.0)
        );
        for taken in &self.taken {
            let off = self.line.residual_of(&taken.known());
            let _ = writeln!(
                out,
                "{:<14} {:>12.3} {:>10.3} {:>14.5} {:>+14.3}",
                taken.point.said,
                taken.reading.counts,
                taken.reading.sigma,
                taken.point.value + off,
                off * spoken.1
            );
        }
        let Line { zero, gain, zero_sigma, gain_sigma, residual, worst, points } = self.line;
        let _ = writeln!(out, "{gain:.8} +- {gain_sigma:.2e} {unit} a count; zero at {zero:.3} +- {zero_sigma:.3} counts");
        if let Some(before) = self.before {
            let _ = writeln!(out, "before: {before:.8} {unit} a count, {:+.2} % from there", 100.0 * (gain / before - 1.0));
        }
        if points == 2 {
            out.push_str("two points: no residual to judge by\n");
        } else {
            let (residual, worst) = (residual * spoken.1, worst * spoken.1);
            let _ = writeln!(out, "residuals {residual:.3} {0} rms, {worst:.3} {0} at most, of {points} points", spoken.0);
        }
        for taken in self.doubtful() {
            let _ = writeln!(out, "look at {}: it is off by {:.1} % of the range", taken.point.said, 100.0 * self.share(taken));
        }
        out
    }

    fn range(&self) -> f64 {
        let values = || self.taken.iter().map(|t| t.point.value);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    }

    fn doubtful(&self) -> impl Iterator<Item = &Taken> {
        self.taken.iter().filter(|t| self.share(t) > WORTH_A_LOOK)
    }

    /// The file: the scale as a board's configuration writes it, the points as comments. `from` says what it was taken from.
    pub(super) fn toml(&self, from: &str) -> String {
        let mut out = format!("{FORMAT}\n# {} of {from}, {}\n", self.channel.column(), date::text(self.day));
        for line in self.table().lines() {
            let _ = writeln!(out, "# {line}");
        }
        out + &crate::rig::file::scale(self.channel.section(), &self.calibrated())
    }
}

#[cfg(test)]
mod tests {
    use super::super::point::list;
    use super::*;

    /// The thesis' load cell, Eq. 5.35: grams = 231.37 V - 531.81 after the amplifier, half of it at the converter.
    fn counts(grams: f64) -> f64 {
        (grams + 531.81) / 231.37 * 0.5 / 3.3 * 4096.0
    }

    fn found(points: &str, off: &[f64], before: Option<f64>) -> Result<Found, String> {
        let points = list(Channel::Thrust, points, 0.1).expect("a list");
        let read = |(point, off): (Point, &f64)| {
            let grams = -point.value / 9.806_65e-3;
            Taken { reading: Reading { counts: counts(grams) + off, sigma: 0.05 }, point }
        };
        Found::of(Channel::Thrust, points.into_iter().zip(off).map(read).collect(), before, 20_781, 0.1)
    }

    /// Both slope and offset come out (errata 5.34-5.35: the curves differ in both).
    #[test]
    fn the_thesis_load_cell_comes_out_with_slope_and_zero() {
        let found = found("0 g, 100 g, 300 g, 500 g", &[0.1, -0.1, -0.1, 0.1], Some(-0.003_66)).expect("a scale");
        let calibrated = found.calibrated();
        let grams_per_volt = -f64::from(calibrated.scale.gain) / 9.806_65e-3 * 4096.0 / 3.3 * 0.5;
        assert!((grams_per_volt - 231.37).abs() < 0.1, "{grams_per_volt}");
        assert!((f64::from(calibrated.scale.zero) - counts(0.0)).abs() < 0.2, "{}", calibrated.scale.zero);
        assert_eq!((calibrated.points, calibrated.day), (4, 20_781));
        let table = found.table();
        assert!(table.contains("residuals 0.0") && table.contains("of 4 points") && !table.contains("look at"), "{table}");
    }

    #[test]
    fn a_point_that_is_far_off_is_pointed_at() {
        let table = found("0 g, 100 g, 300 g, 500 g", &[0.0, 30.0, 0.0, 0.0], None).expect("a scale").table();
        assert!(table.contains("look at 100 g"), "{table}");
    }

    #[test]
    fn what_is_no_scale_of_the_channel_is_refused_in_one_line() {
        for (points, off, before, word) in [
            ("200 g", &[0.0][..], None, "two different values"),
            ("200 g, 200 g", &[0.0, 5.0], None, "two different values"),
            ("0 g, 0.0001 g", &[0.0, 0.0], None, "every point reads"),
            ("0 g, 500 g", &[0.0, -1100.0], Some(-0.003_66), "times the"),
            ("0 g, 100 g, 200 g, 500 g", &[0.0, 0.0, 0.0, -300.0], Some(-0.003_66), "of the range off the line"),
        ] {
            let said = found(points, off, before).expect_err(points);
            assert!(said.contains(word) && !said.contains('\n'), "{said}");
        }
    }

    #[test]
    fn the_file_is_one_that_a_configuration_takes() {
        let found = found("0 g, 250 g, 500 g", &[0.0, 0.2, 0.0], None).expect("a scale");
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("cal.toml");
        std::fs::write(&path, found.toml("rec.csv")).expect("a file");
        let scales = crate::rig::file::scales(&path).expect("scales");
        assert_eq!(scales, [Some(found.calibrated()), None, None, None, None]);
    }
}
