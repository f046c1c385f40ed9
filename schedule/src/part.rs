//! The parts that a schedule is made of, each as segments of a board.
//!
//! What it is: one function a kind of part; what a file says and what a program builds come from here.
//! What can go wrong: nothing; ranges are checked where the numbers are read, and once more by the board.
//! Units: pulses as they are, milliseconds.
//! Reference: specification `rig.md`, "ESC pulse and arming" (schedules) and "The operator's side"; Beharie 2013, section 3.2.6.

use crate::job::Job;
use frame::schedule::{Segment, Shape};
use frame::units::PulseWidth;

/// A part of a schedule.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// What it is, for people.
    pub title: String,
    /// Its segments.
    pub segments: Vec<Segment>,
    /// What the host does while its only segment is played.
    pub job: Option<Job>,
}

impl Part {
    fn plain(title: impl Into<String>, segments: Vec<Segment>) -> Self {
        Self { title: title.into(), segments, job: None }
    }
}

/// A level and how long it is held, milliseconds.
pub type Level = (PulseWidth, u32);

fn level((pulse, length_ms): Level) -> Segment {
    Segment { pulse, length_ms, shape: Shape::Hold }
}

/// One level.
#[must_use]
pub fn hold(pulse: PulseWidth, length_ms: u32) -> Part {
    Part::plain(format!("hold {} us", pulse.as_us()), vec![level((pulse, length_ms))])
}

/// Levels of equal height and equal hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Staircase {
    /// Lowest level.
    pub from: PulseWidth,
    /// Height of a step; not 0.
    pub step: PulseWidth,
    /// Highest level, as far as whole steps reach it.
    pub top: PulseWidth,
    /// Hold of each level, milliseconds.
    pub hold_ms: u32,
    /// Down again by the same levels.
    pub down: bool,
    /// How often the whole of it.
    pub visits: u32,
}

/// A staircase.
#[must_use]
pub fn staircase(s: &Staircase) -> Part {
    let up: Vec<u32> = (s.from.0..=s.top.0).step_by(s.step.0.max(1) as usize).collect();
    let down = up.iter().rev().skip(1).filter(|_| s.down);
    let once: Vec<Segment> = up.iter().chain(down).map(|ns| level((PulseWidth(*ns), s.hold_ms))).collect();
    let title = format!("staircase {} to {} us{}", s.from.as_us(), s.top.as_us(), if s.down { " and down" } else { "" });
    Part::plain(title, std::iter::repeat_n(once, s.visits.max(1) as usize).flatten().collect())
}

/// Levels one after the other; a level that ramps is reached linearly during its hold.
#[must_use]
pub fn steps(list: &[(Level, bool)]) -> Part {
    let segments = list.iter().map(|(l, ramp)| {
        let shape = if *ramp { Shape::Line { from: None } } else { Shape::Hold };
        Segment { shape, ..level(*l) }
    });
    Part::plain(format!("{} steps", list.len()), segments.collect())
}

/// A straight line; without `from` from where the part before ended.
#[must_use]
pub fn ramp(from: Option<PulseWidth>, to: PulseWidth, length_ms: u32) -> Part {
    Part::plain(format!("ramp to {} us", to.as_us()), vec![Segment { pulse: to, length_ms, shape: Shape::Line { from } }])
}

/// A sine whose frequency moves linearly, millihertz.
#[must_use]
pub fn chirp(centre: PulseWidth, amplitude: PulseWidth, from_millihertz: u32, to_millihertz: u32, length_ms: u32) -> Part {
    let shape = Shape::Chirp { amplitude, from_millihertz, to_millihertz };
    let title = format!(
        "chirp about {} us, {} to {} Hz",
        centre.as_us(),
        f64::from(from_millihertz) / 1e3,
        f64::from(to_millihertz) / 1e3
    );
    Part::plain(title, vec![Segment { pulse: centre, length_ms, shape }])
}

/// The same levels again and again; with `between`, that level before each of them.
#[must_use]
pub fn visits(levels: &[Level], between: Option<Level>, times: u32) -> Part {
    let once: Vec<Segment> = levels.iter().flat_map(|l| between.into_iter().chain([*l])).map(level).collect();
    let title = format!("{} levels, {times} visits", levels.len());
    Part::plain(title, std::iter::repeat_n(once, times as usize).flatten().chain(between.map(level)).collect())
}

/// A level that lasts at most so long, while the host does its job.
#[must_use]
pub fn watched(title: impl Into<String>, pulse: PulseWidth, at_most_ms: u32, job: Job) -> Part {
    let shape = Shape::Steered { low: pulse, high: pulse };
    Part { title: title.into(), segments: vec![Segment { pulse, length_ms: at_most_ms, shape }], job: Some(job) }
}

/// A level that the host moves between two bounds.
#[must_use]
pub fn kept(title: impl Into<String>, start: PulseWidth, bounds: (PulseWidth, PulseWidth), length_ms: u32, job: Job) -> Part {
    let (low, high) = bounds;
    let segment = Segment { pulse: start, length_ms, shape: Shape::Steered { low, high } };
    Part { title: title.into(), segments: vec![segment], job: Some(job) }
}

/// Segments as they are.
#[must_use]
pub fn raw(title: impl Into<String>, segments: Vec<Segment>) -> Part {
    Part::plain(title, segments)
}
