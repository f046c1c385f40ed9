//! A whole schedule, ready to be played.
//!
//! What it is: the segments of all parts in one list, the host's jobs by segment, and where each part begins.
//! What can go wrong: a plan of nothing cannot be made.
//! Units: as in the segments.
//! Reference: specification `rig.md`, "The operator's side".

use crate::error::ScheduleError;
use crate::job::Job;
use crate::part::Part;
use crate::{file, next};
use frame::schedule::Segment;
use frame::units::PulseWidth;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A part's place in a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// What it is.
    pub title: String,
    /// Number of its first segment.
    pub first: u32,
}

/// A schedule.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plan {
    /// Its name.
    pub name: String,
    segments: Vec<Segment>,
    jobs: BTreeMap<u32, Job>,
    places: Vec<Place>,
}

impl Plan {
    /// Parts one after the other.
    #[must_use]
    pub fn new(name: impl Into<String>, parts: Vec<Part>) -> Self {
        let mut plan = Self { name: name.into(), ..Self::default() };
        for part in parts {
            let first = plan.segments.len() as u32;
            plan.places.push(Place { title: part.title, first });
            plan.jobs.extend(part.job.map(|job| (first, job)));
            plan.segments.extend(part.segments);
        }
        plan
    }

    /// Reads a schedule: a file of parts (TOML), or the next experiment of a verdict (JSON).
    ///
    /// # Errors
    /// [`ScheduleError`], with file, line and column.
    pub fn read(path: &Path) -> Result<Self, ScheduleError> {
        let text = ScheduleError::text_of(path)?;
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json")) {
            next::parse(&text, path)
        } else {
            file::parse(&text, path)
        }
    }

    /// The files that the schedule at `path` names: the logs whose pulses it replays. One that is no schedule names none; [`Plan::read`] refuses it.
    #[must_use]
    pub fn files(path: &Path) -> Vec<PathBuf> {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        file::named(&text).into_iter().map(|file| path.parent().unwrap_or(Path::new("")).join(file)).collect()
    }

    /// Reads the next experiment of a verdict.
    ///
    /// # Errors
    /// [`ScheduleError`], with file, line and column.
    pub fn next_experiment(path: &Path) -> Result<Self, ScheduleError> {
        next::parse(&ScheduleError::text_of(path)?, path)
    }

    /// Reads a schedule from `text`; `path` names it in errors, and files that it names are looked for beside it.
    ///
    /// # Errors
    /// [`ScheduleError`], with file, line and column.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ScheduleError> {
        file::parse(text, path)
    }

    /// The segments.
    #[must_use]
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// The host's job while a segment is played.
    #[must_use]
    pub fn job(&self, segment: u32) -> Option<&Job> {
        self.jobs.get(&segment)
    }

    /// The parts, in order.
    #[must_use]
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// The part that a segment belongs to, counted from 0.
    #[must_use]
    pub fn part_of(&self, segment: u32) -> usize {
        self.places.partition_point(|place| place.first <= segment).saturating_sub(1)
    }

    /// How long it takes, s; at most, where the host may end a part before its time.
    #[must_use]
    pub fn longest_s(&self) -> f64 {
        self.segments.iter().map(|segment| f64::from(segment.length_ms)).sum::<f64>() * 1e-3
    }

    /// Highest pulse that it can give.
    #[must_use]
    pub fn highest(&self) -> PulseWidth {
        self.segments.iter().map(Segment::highest).max().unwrap_or(PulseWidth::MIN)
    }

    /// One line for people: parts, length, highest pulse.
    #[must_use]
    pub fn summary(&self) -> String {
        let s = self.longest_s();
        let time = if s < 120.0 { format!("{s:.1} s") } else { format!("{:.1} min", s / 60.0) };
        let most = if self.jobs.is_empty() { "" } else { "at most " };
        format!("{}: {} parts, {most}{time}, up to {} us", self.name, self.places.len(), self.highest().as_us())
    }
}
