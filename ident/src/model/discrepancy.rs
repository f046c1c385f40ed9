//! What a model was off by on its own run, in the file beside it: `model.discrepancy.toml`.
//!
//! What it is: by load, by kind of row, and row for row on the way: what only the program needs, when another run is held against the model.
//! `model.toml` states the SHA-256 of the file beside it, so that two that do not belong together are not taken for a pair.
//! What can go wrong: without the file the model predicts as ever, and says that it goes without ([`Model::goes_without`]); another one's is refused.
//! Units: in the key of each number.
//! Reference: specification `formats.md`, "Powerplant model".

use super::read::{Refusal, course, leftover, no_channel, only, place_of, refusal, table_of, within};
use super::{Model, ModelError, leftover_keys};
use crate::log::digest_of;
use crate::model::course::Course;
use crate::model::leftover::Leftover;
use crate::numeric::digits;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Significant digits: a scatter is known to a few per cent at best, and errors are of the size of the noise.
const DIGITS: usize = 6;
/// First key of the format.
const FORMAT: &str = "quadrig-discrepancy 1";
/// Key of the model's file by which it knows the one beside it.
pub(super) const DIGEST: &str = "discrepancy_sha256";
/// What stands above.
const HEAD: &str = "# What the model beside this file was off by on its own run, noise included. For the program, which knows by it what is new on another run;\n# predictions do without. left_*: where the load is held, and about that the scatter, rms, in each third of the loads, up to 0.25, 0.5, 1, 2\n# and 4 s after a jump of the load, later, while it moves evenly, and while the rotor runs down.\n";

/// Where the file beside a model lies: `model.discrepancy.toml` beside `model.toml`.
#[must_use]
pub fn beside(model: &Path) -> PathBuf {
    model.with_extension("discrepancy.toml")
}

/// The keys of a channel.
pub(super) fn channel_keys(channel: &str, left: &Leftover) -> [(String, Value); 3] {
    let [scatter, at, error] = leftover_keys(channel);
    let kept = |v: f64| digits::significant(v, DIGITS);
    let parts: Vec<Value> =
        left.scatter.iter().map(|part| part.iter().map(|v| Value::from(kept(*v))).collect::<Vec<_>>().into()).collect();
    // what is nothing to the last digit is nothing
    let whole = |v: f64| if v.abs() < f64::MIN_POSITIVE.sqrt() { 0.0 } else { kept(v) };
    [
        (scatter, parts.into()),
        (at, left.curve.iter().map(|p| digits::plain(p.0)).collect::<Vec<f64>>().into()),
        (error, left.curve.iter().map(|p| whole(p.1)).collect::<Vec<f64>>().into()),
    ]
}

/// What the file holds: what each channel had left over, and its course.
type Parts = (Vec<(String, Leftover)>, Option<Course>);

impl Model {
    /// The texts of its files: `model.toml`, and of the one [`beside`] it where the model knows what it was off by.
    #[must_use]
    pub fn files(&self) -> (String, Option<String>) {
        if self.leftovers.is_empty() && self.course.is_none() {
            return (self.text(false, None), None);
        }
        let text = self.discrepancy();
        (self.text(false, Some(&digest_of(&text))), Some(text))
    }

    fn discrepancy(&self) -> String {
        let mut root = Table::new();
        root.insert("format".into(), FORMAT.into());
        root.insert("source".into(), self.source.clone().into());
        let of = |(channel, left): &(String, Leftover)| {
            (channel.clone(), Value::Table(channel_keys(channel, left).into_iter().collect()))
        };
        root.insert("channel".into(), Value::Table(self.leftovers.iter().map(of).collect()));
        format!("{HEAD}{root}{}", self.course.as_ref().map(Course::to_toml).unwrap_or_default())
    }

    /// Whether the file that stood beside it is not there.
    #[must_use]
    pub fn goes_without(&self) -> bool {
        self.beside.is_some() && self.leftovers.is_empty() && self.course.is_none()
    }

    /// Takes what the file beside it holds, if it is there and belongs to it; `text` is that of the model's file.
    pub(super) fn complete(mut self, path: &Path, text: &str) -> Result<Self, ModelError> {
        let Some(expected) = &self.beside else { return Ok(self) };
        let beside = beside(path);
        let file = beside.display().to_string();
        let held = match std::fs::read_to_string(&beside) {
            Ok(held) => held,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(self),
            Err(source) => return Err(ModelError::Io { file, source }),
        };
        let found = digest_of(&held);
        if found != *expected {
            let (line, column) = super::place::of_key(text, DIGEST);
            return Err(ModelError::Pair { model: format!("{}:{line}:{column}", path.display()), file, found });
        }
        let root = table_of(&file, &held)?;
        (self.leftovers, self.course) = self.parts(&root).map_err(|refusal| place_of(&file, &held, refusal))?;
        Ok(self)
    }

    fn parts(&self, root: &Table) -> Result<Parts, Refusal> {
        if root.get("format").and_then(Value::as_str) != Some(FORMAT) {
            return Err(refusal("format", root.get("format"), &format!("'{FORMAT}'")));
        }
        only(root, &["format", "source", "channel", "course"])?;
        let none = Table::new();
        let channels = match root.get("channel") {
            None => &none,
            Some(value) => value.as_table().ok_or_else(|| refusal("channel", Some(value), "one table for each channel"))?,
        };
        let mut left = Vec::new();
        for (name, value) in channels {
            let place = format!("channel.{name}");
            if !self.polynomials.iter().any(|p| p.channel == *name) {
                return Err(no_channel(&place, name));
            }
            let keys = leftover_keys(name);
            let table = value.as_table().ok_or_else(|| refusal(&place, Some(value), "a table of lists"))?;
            only(table, &keys.each_ref().map(String::as_str)).map_err(|refusal| within(&place, refusal))?;
            let of_channel = leftover(name, value).map_err(|refusal| within(&place, refusal))?;
            left.extend(of_channel.map(|l| (name.clone(), l)));
        }
        let way = root.get("course").map(course).transpose().map_err(|refusal| within("course", refusal))?;
        Ok((left, way))
    }
}
