//! Reading `model.toml`.
//!
//! What it is: every key that a prediction hangs on is read, and anything else in its table is refused: a misspelt amplitude or a
//! missing coefficient must not predict a zero.
//! What can go wrong: a file that does not say what it must is refused with its key, what stands there and what should.
//! Units: in the key of each number.
//! Reference: specification `formats.md`, "Powerplant model".

use super::{
    AddedEffect, FORMAT, Model, ModelError, Polynomial, STOOD, coefficient_key, discrepancy, ending, keyed, leftover_keys, place,
    reach, run, supply,
};
use crate::channel::{Context, Relation};
use crate::effects::placed::Placed;
use crate::effects::{self, Effect, Estimate, Instance};
use crate::log::{Log, odd_in_head, short};
use crate::model::course::{COURSE_KEYS, Course};
use crate::model::leftover::{CLASSES, Leftover, PARTS};
use std::path::Path;
use toml::{Table, Value};

/// Key, what stands there, what should.
pub(super) type Refusal = (String, String, String);

/// What is said of a file that is no text.
const NO_TEXT: &str =
    "bytes that are no text in UTF-8; expected a model written by `quadrig identify` or `close-loop`, which is TOML";
/// Longest pulse that a log holds, us.
const LONGEST_US: f64 = 2500.0;
/// Largest coefficient: of a speed over the command, whose range may be narrow, and of any other channel over the speed. And largest size of an effect.
const FARTHEST: [f64; 2] = [1e12, 1e7];
/// Largest resistance of a supply's lead, ohm, as a scenario takes it.
const RESISTANCE: f64 = 100.0;

/// Keys of the file.
const ROOT: [&str; 13] = [
    "format",
    discrepancy::DIGEST,
    "source",
    "start_pulse_us",
    "highest_pulse_us",
    STOOD,
    "air_density_ratio",
    "rig",
    "consensus",
    "run",
    "channel",
    "effect",
    "course",
];
/// Keys of `[[effect]]`.
const EFFECT: [&str; 12] = [
    "id",
    "channels",
    "form",
    "equation",
    "scope",
    "run",
    "shape",
    "shape_se",
    "amplitude",
    "seen",
    "on_another_run",
    "parameter",
];

impl Model {
    /// Reads a model, and the file [`super::beside`] it that belongs to it.
    ///
    /// # Errors
    /// [`ModelError`] with file and key.
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| match source.kind() {
            std::io::ErrorKind::InvalidData => ModelError::Syntax { file: format!("{file}:1:1"), message: NO_TEXT.to_owned() },
            _ => ModelError::Io { file: file.clone(), source },
        })?;
        Self::parse(&file, &text)?.complete(path, &text)
    }

    /// Parses the file's text alone; `file` is the name for messages.
    ///
    /// # Errors
    /// As [`Model::read`].
    pub fn parse(file: &str, text: &str) -> Result<Self, ModelError> {
        if let Some((line, column, words)) = ending::cut_short(text) {
            let message = format!("{words}; expected a model as `quadrig identify` or `close-loop` wrote it");
            return Err(ModelError::Syntax { file: format!("{file}:{line}:{column}"), message });
        }
        Self::from_table(&table_of(file, text)?).map_err(|refusal| place_of(file, text, refusal))
    }

    fn from_table(root: &Table) -> Result<Self, Refusal> {
        let format = root.get("format").and_then(Value::as_str);
        if format == Some(super::OF_FLIGHT) {
            return Err(refusal(
                "format",
                root.get("format"),
                &format!(
                    "'{FORMAT}', the model of a rig: `quadrig predict` and `close-loop --model` take that of a flight, for another flight"
                ),
            ));
        }
        if format == Some(super::OF_INERTIAL) {
            return Err(refusal(
                "format",
                root.get("format"),
                &format!(
                    "'{FORMAT}', the model of a rig: `quadrig predict` takes that of an attitude log, for its own recording"
                ),
            ));
        }
        if format != Some(FORMAT) {
            return Err(refusal("format", root.get("format"), &format!("'{FORMAT}'")));
        }
        only(root, &ROOT)?;
        let start = root.get("start_pulse_us");
        let mut model = Self {
            source: root.get("source").and_then(Value::as_str).unwrap_or_default().to_owned(),
            start_pulse_us: start
                .and_then(finite)
                .filter(|us| (0.0..=LONGEST_US).contains(us))
                .ok_or_else(|| refusal("start_pulse_us", start, &format!("a pulse from 0 to {LONGEST_US} us")))?,
            meta: root.get("rig").and_then(Value::as_table).cloned().unwrap_or_default(),
            ..Self::default()
        };
        if let Some((key, found, expected)) = odd_in_head(&model.meta) {
            return Err(within("rig", refusal(key, Some(found), expected)));
        }
        if let Some(pulse) = root.get("highest_pulse_us") {
            let highest = finite(pulse).filter(|us| *us > 0.0 && *us <= LONGEST_US);
            let wanted = || refusal("highest_pulse_us", Some(pulse), &format!("a pulse in us, above 0 and up to {LONGEST_US}"));
            model.highest_pulse_us = Some(highest.ok_or_else(wanted)?);
        }
        if let Some(stood) = root.get(STOOD) {
            model.stood = stood
                .as_bool()
                .ok_or_else(|| refusal(STOOD, Some(stood), "true or false: whether its runs saw the rotor stand still"))?;
        }
        if let Some(air) = root.get("air_density_ratio") {
            let ratio = finite(air).filter(|r| *r > 0.0);
            model.air = Some(ratio.ok_or_else(|| refusal("air_density_ratio", Some(air), "a finite number above zero"))?);
        }
        if let Some(consensus) = root.get("consensus") {
            let table = consensus
                .as_table()
                .ok_or_else(|| refusal("consensus", Some(consensus), "a table with rule, channels and sensor_share"))?;
            only(table, &["rule", "channels", "sensor_share"]).map_err(|refusal| within("consensus", refusal))?;
        }
        if let Some(channels) = root.get("consensus").and_then(|c| c.get("channels")) {
            model.consensus = strings(channels)
                .ok_or_else(|| refusal("consensus.channels", Some(channels), "a list of speed channels, such as [\"rpm\"]"))?;
        }
        if let Some(share) = root.get("consensus").and_then(|c| c.get("sensor_share")) {
            let known = finite(share).filter(|s| (0.0..=1.0).contains(s));
            model.sensor_share = known.ok_or_else(|| refusal("consensus.sensor_share", Some(share), "a share from 0 to 1"))?;
        }
        (model.runs, model.own) = run::read(root.get("run"))?;
        let channels = root.get("channel");
        let channels =
            channels.and_then(Value::as_table).ok_or_else(|| refusal("channel", channels, "one table for each channel"))?;
        for (name, value) in channels {
            let polynomial = polynomial(name, value).map_err(|refusal| within(&format!("channel.{name}"), refusal))?;
            model.polynomials.push(polynomial);
            let left = leftover(name, value).map_err(|refusal| within(&format!("channel.{name}"), refusal))?;
            model.leftovers.extend(left.map(|left| (name.clone(), left)));
            let by_load = supply::read(name, value).map_err(|refusal| within(&format!("channel.{name}"), refusal))?;
            model.supply.extend(by_load.map(|by_load| (name.clone(), by_load)));
        }
        let list = match root.get("effect") {
            None => [].as_slice(),
            Some(list) => list.as_array().ok_or_else(|| refusal("effect", Some(list), "a list of tables, [[effect]]"))?,
        };
        for (i, value) in list.iter().enumerate() {
            model.effects.push(AddedEffect::from_table(value).map_err(|refusal| within(&format!("effect[{i}]"), refusal))?);
        }
        if let Some(value) = root.get("course") {
            model.course = Some(course(value).map_err(|refusal| within("course", refusal))?);
        }
        if let Some(digest) = root.get(discrepancy::DIGEST) {
            let twice = !model.leftovers.is_empty() || model.course.is_some();
            let wanted = if twice { "no key, as the same stands in this file" } else { "64 hexadecimal digits" };
            let text = digest.as_str().filter(|d| !twice && d.len() == 64 && d.bytes().all(|b| b.is_ascii_hexdigit()));
            model.beside = Some(text.ok_or_else(|| refusal(discrepancy::DIGEST, Some(digest), wanted))?.to_owned());
        }
        Ok(model)
    }
}

/// The tables of a file's text.
pub(super) fn table_of(file: &str, text: &str) -> Result<Table, ModelError> {
    text.parse().map_err(|e: toml::de::Error| {
        let (line, column) = place::of_byte(text, e.span().map_or(0, |s| s.start));
        ModelError::Syntax {
            file: format!("{file}:{line}:{column}"),
            message: format!(
                "{}; expected a model written by `quadrig identify` or `close-loop`",
                e.message().lines().next().unwrap_or("not TOML")
            ),
        }
    })
}

/// A refusal with its place in the file.
pub(super) fn place_of(file: &str, text: &str, (key, found, expected): Refusal) -> ModelError {
    let (line, column) = place::of_key(text, &key);
    ModelError::Key { file: format!("{file}:{line}:{column}"), key, found, expected }
}

/// What the model is off by row for row: lists of finite numbers that are as long as they must be.
pub(super) fn course(value: &Value) -> Result<Course, Refusal> {
    let table = value.as_table().ok_or_else(|| refusal("", Some(value), "a table of lists"))?;
    let list = |key: &str, all: &dyn Fn(f64) -> bool, length: Option<usize>| -> Result<Vec<f64>, Refusal> {
        let numbers = table.get(key).and_then(Value::as_array);
        let numbers: Option<Vec<f64>> = numbers.and_then(|list| list.iter().map(|v| number(v).filter(|v| all(*v))).collect());
        let wanted = || match length {
            Some(n) => format!("a list of {n} numbers"),
            None => "a list of finite numbers, each larger than the one before".to_owned(),
        };
        let fits = |list: &Vec<f64>| length.map_or(list.is_sorted_by(|a, b| a < b), |n| list.len() == n);
        numbers.filter(fits).ok_or_else(|| refusal(key, table.get(key), &wanted()))
    };
    let finite = |v: f64| v.is_finite();
    let [changed, t] = [COURSE_KEYS[0], COURSE_KEYS[2]].map(|key| list(key, &finite, None));
    let (changed, t) = (changed?, t?);
    let pulse = list(COURSE_KEYS[1], &finite, Some(changed.len()))?;
    let mut errors = Vec::new();
    for key in table.keys().filter(|key| !COURSE_KEYS.contains(&key.as_str())) {
        if Relation::of(key, true).is_none() {
            return Err(no_channel("", key));
        }
        errors.push((key.clone(), list(key, &|v| !v.is_infinite(), Some(t.len()))?));
    }
    Ok(Course { commands: changed.into_iter().zip(pulse).collect(), t, errors })
}

fn polynomial(channel: &str, value: &Value) -> Result<Polynomial, Refusal> {
    let table = value.as_table().ok_or_else(|| refusal("", Some(value), "a table of coefficients"))?;
    let terms = |has_pulse| Relation::of(channel, has_pulse).map(|r| r.degree() + 1);
    let (Some(full), Some(alone)) = (terms(true), terms(false)) else { return Err(no_channel("", channel)) };
    let keys: Vec<String> = (0..full).map(|k| coefficient_key(channel, k)).collect();
    let left: Vec<String> = leftover_keys(channel).into_iter().chain(supply::keys(channel)).collect();
    let known = |key: &str| {
        key == "relation" || left.iter().any(|k| key == k) || keys.iter().any(|k| key == k || key.strip_suffix("_se") == Some(k))
    };
    if let Some((key, value)) = table.iter().find(|(key, _)| !known(key)) {
        return Err(refusal(
            key,
            Some(value),
            &format!("no key but relation, {}, each of them with _se, and {}", keys.join(", "), left.join(", ")),
        ));
    }
    // a speed without a command is a constant: the only relation with two degrees
    let highest = keys.iter().rposition(|k| table.contains_key(k)).map_or(0, |k| k + 1);
    let count = if highest == alone { alone } else { full };
    let farthest = FARTHEST[usize::from(!channel.starts_with("rpm"))];
    let read = |key: &String| {
        let value = table.get(key);
        let found =
            value.and_then(finite).ok_or_else(|| refusal(key, value, "a finite number in the unit that its key ends with"))?;
        within_reach(found, farthest).ok_or_else(|| refusal(key, value, &format!("what a rig can have, {farthest:e} at most")))
    };
    let coefficients = keys[..count].iter().map(read).collect::<Result<_, _>>()?;
    let error = |key: &String| {
        let key = format!("{key}_se");
        let value = table.get(&key).and_then(number).unwrap_or(0.0);
        if value < 0.0 { Err(refusal(&key, table.get(&key), "a standard error, not negative")) } else { Ok(value) }
    };
    let errors = keys[..count].iter().map(error).collect::<Result<_, _>>()?;
    Ok(Polynomial { channel: channel.to_owned(), coefficients, errors })
}

/// What the model leaves over of a channel of its own run: all three lists or none.
pub(super) fn leftover(channel: &str, value: &Value) -> Result<Option<Leftover>, Refusal> {
    let keys = leftover_keys(channel);
    if keys.iter().all(|key| value.get(key).is_none()) {
        return Ok(None);
    }
    let numbers = |value: &Value| -> Option<Vec<f64>> { value.as_array()?.iter().map(finite).collect() };
    let list = |key: &String| -> Option<Vec<f64>> { numbers(value.get(key)?) };
    let part =
        |value: &Value| -> Option<[f64; CLASSES]> { numbers(value).filter(|s| s.iter().all(|v| *v >= 0.0))?.try_into().ok() };
    let parts = |key: &String| -> Option<[[f64; CLASSES]; PARTS]> {
        value.get(key)?.as_array()?.iter().map(part).collect::<Option<Vec<_>>>()?.try_into().ok()
    };
    let refused = |key: &String, expected: &str| refusal(key, value.get(key), expected);
    let [scatter_key, at_key, error_key] = &keys;
    let scatter = parts(scatter_key)
        .ok_or_else(|| refused(scatter_key, &format!("{PARTS} lists of {CLASSES} finite numbers that are not negative")))?;
    let at = list(at_key).filter(|at| at.is_sorted_by(|a, b| a < b));
    let at = at.ok_or_else(|| refused(at_key, "a list of finite numbers, each larger than the one before"))?;
    let error = list(error_key).filter(|error| error.len() == at.len());
    let error = error.ok_or_else(|| refused(error_key, &format!("a list of {} finite numbers, as {at_key} has", at.len())))?;
    Ok(Some(Leftover { curve: at.into_iter().zip(error).collect(), scatter }))
}

impl AddedEffect {
    pub(super) fn from_table(value: &Value) -> Result<Self, Refusal> {
        only(value.as_table().ok_or_else(|| refusal("", Some(value), "a table, [[effect]]"))?, &EFFECT)?;
        let at = |k: &str| value.get(k);
        let id = at("id")
            .and_then(Value::as_str)
            .ok_or_else(|| refusal("id", at("id"), "the id of an effect: docs/effects lists them"))?;
        let effect = effects::by_id(id).ok_or_else(|| {
            let known: Vec<&str> = effects::library().iter().map(|e| e.id()).collect();
            refusal("id", at("id"), &format!("one of {}", known.join(", ")))
        })?;
        let channels = at("channels").and_then(strings).filter(|c| !c.is_empty());
        let channels = channels.ok_or_else(|| {
            refusal("channels", at("channels"), "a list of the channels that it acts on, such as [\"rpm\", \"thrust_n\"]")
        })?;
        if let Some(unknown) = channels.iter().find(|c| Relation::of(c, true).is_none()) {
            return Err(no_channel("channels", unknown));
        }
        let form = match at("form") {
            None => "",
            Some(form) => {
                form.as_str().ok_or_else(|| refusal("form", Some(form), "a text in quotes, the name of one of its forms"))?
            }
        };
        let instance = Instance { channels, form: form.to_owned() };
        let names = shape_names(effect, &instance);
        let wanted = || match names.len() {
            0 => "an empty list".to_owned(),
            n => format!("a list of {n} finite number{}: {}", if n == 1 { "" } else { "s" }, names.join(", ")),
        };
        let list = at("shape").and_then(Value::as_array).filter(|list| list.len() == names.len());
        let shape: Option<Vec<f64>> = list.and_then(|list| list.iter().map(finite).collect());
        let shape = shape.ok_or_else(|| refusal("shape", at("shape"), &wanted()))?;
        let amplitudes = amplitudes(effect, &instance, at("amplitude"))?;
        let errors =
            |value: &Value| -> Option<Vec<f64>> { value.as_array()?.iter().map(|v| finite(v).filter(|v| *v >= 0.0)).collect() };
        let shape_errors = match at("shape_se") {
            None => Vec::new(),
            Some(value) => errors(value)
                .filter(|list| list.len() == shape.len())
                .ok_or_else(|| refusal("shape_se", Some(value), &format!("{}, none negative", wanted())))?,
        };
        let count = effect.amplitudes(&instance).len();
        let reach = at("seen").map_or(Ok(Vec::new()), |value| reach::read(&instance, count, value))?;
        let estimates = match at("parameter") {
            None => Vec::new(),
            Some(value) => estimates(&held(effect, &instance, &shape, &amplitudes), value)?,
        };
        let scope = effect.scope(&instance).word();
        if at("scope").is_some_and(|s| s.as_str() != Some(scope)) {
            return Err(refusal("scope", at("scope"), &format!("'{scope}', which {id} has in this form")));
        }
        let mean = match at("on_another_run") {
            None => Vec::new(),
            Some(value) => means(&instance, value)?,
        };
        Ok(Self { placed: Placed { effect, instance, shape }, amplitudes, estimates, mean, reach, shape_errors })
    }
}

/// Names of the shape parameters that an effect has in this form: how many they are does not depend on a log.
pub(super) fn shape_names(effect: &'static dyn Effect, instance: &Instance) -> Vec<&'static str> {
    let two_rows = Log { t: vec![0.0, 1.0], ..Log::default() };
    effect.shapes(&Context::bare(&two_rows, Some(1000.0)), instance).iter().map(|s| s.name).collect()
}

/// Amplitudes of each channel; what the file leaves out is zero.
fn amplitudes(
    effect: &'static dyn Effect,
    instance: &Instance,
    value: Option<&Value>,
) -> Result<Vec<(String, Vec<f64>)>, Refusal> {
    let none = Table::new();
    let table = match value {
        None => &none,
        Some(value) => value.as_table().ok_or_else(|| refusal("amplitude", Some(value), "one table for each channel"))?,
    };
    if let Some((channel, value)) = table.iter().find(|(channel, _)| !instance.channels.contains(channel)) {
        return Err(refusal(
            &format!("amplitude.{channel}"),
            Some(value),
            &format!("one of the channels that it acts on: {}", instance.channels.join(", ")),
        ));
    }
    let keys: Vec<String> = effect.amplitudes(instance).iter().map(|a| keyed(a.name, a.unit)).collect();
    let mut out = Vec::new();
    for channel in &instance.channels {
        let mut values = vec![0.0; keys.len()];
        let place = |key: &str| format!("amplitude.{channel}{}{key}", if key.is_empty() { "" } else { "." });
        if let Some(own) = table.get(channel) {
            let own = own.as_table().ok_or_else(|| refusal(&place(""), Some(own), "a table of amplitudes"))?;
            for (key, value) in own {
                let known = keys.iter().position(|k| k == key).ok_or_else(|| {
                    let wanted = if keys.is_empty() { "no key".to_owned() } else { format!("a key of {}", keys.join(", ")) };
                    refusal(&place(key), Some(value), &wanted)
                })?;
                let found = finite(value)
                    .ok_or_else(|| refusal(&place(key), Some(value), "a finite number in the unit that its key ends with"))?;
                let size = if key.ends_with("_ohm") {
                    Some(found).filter(|ohm| (0.0..=RESISTANCE).contains(ohm)).ok_or(format!("from 0 to {RESISTANCE} ohm"))
                } else {
                    within_reach(found, FARTHEST[1]).ok_or(format!("{:e} at most", FARTHEST[1]))
                };
                values[known] =
                    size.map_err(|range| refusal(&place(key), Some(value), &format!("what a rig can have, {range}")))?;
            }
        }
        out.push((channel.clone(), values));
    }
    Ok(out)
}

/// The polynomials that stand for an effect on another run.
fn means(instance: &Instance, value: &Value) -> Result<Vec<(String, Vec<f64>)>, Refusal> {
    let table = value.as_table().ok_or_else(|| refusal("on_another_run", Some(value), "one table for each channel"))?;
    let of_channel = |(channel, own): (&String, &Value)| {
        let place = format!("on_another_run.{channel}");
        if !instance.channels.contains(channel) {
            return Err(refusal(
                &place,
                Some(own),
                &format!("one of the channels that it acts on: {}", instance.channels.join(", ")),
            ));
        }
        let table = own.as_table().ok_or_else(|| refusal(&place, Some(own), "a table of coefficients"))?;
        let of = |k: usize| -> Result<f64, Refusal> {
            let key = coefficient_key(channel, k);
            let value = table.get(&key);
            value
                .and_then(finite)
                .ok_or_else(|| refusal(&format!("{place}.{key}"), value, "a finite number in the unit that its key ends with"))
        };
        Ok((channel.clone(), (0..table.len()).map(of).collect::<Result<_, _>>()?))
    };
    table.iter().map(of_channel).collect()
}

/// A number that predictions use: its place in the effect's table, its name, its value.
struct Held {
    place: String,
    name: &'static str,
    value: f64,
}

/// The numbers of an effect, shapes first.
fn held(effect: &'static dyn Effect, instance: &Instance, shape: &[f64], amplitudes: &[(String, Vec<f64>)]) -> Vec<Held> {
    let shapes = shape_names(effect, instance).into_iter().zip(shape).enumerate();
    let mut out: Vec<Held> = shapes.map(|(k, (name, v))| Held { place: format!("shape[{k}]"), name, value: *v }).collect();
    for (channel, values) in amplitudes {
        let own = effect.amplitudes(instance).into_iter().zip(values);
        let of = |a: effects::Amplitude| format!("amplitude.{channel}.{}", keyed(a.name, a.unit));
        out.extend(own.map(|(a, v)| Held { place: of(a), name: a.name, value: *v }));
    }
    out
}

/// Share of a number by which two writings of it may differ.
pub(super) const SAME_NUMBER: f64 = 1e-6;

/// What was estimated, for the reader. No prediction hangs on it, so that it may not say another thing than what one does hang on.
fn estimates(held: &[Held], value: &Value) -> Result<Vec<Estimate>, Refusal> {
    let table = value.as_table().ok_or_else(|| refusal("parameter", Some(value), "a table of numbers"))?;
    let mut out = Vec::new();
    for (key, value) in table {
        let place = format!("parameter.{key}");
        let read = number(value).ok_or_else(|| {
            refusal(&place, Some(value), "a number: what was estimated, for the reader; a line that tells nothing may go")
        })?;
        let of = key.strip_suffix("_se").unwrap_or(key);
        let names = |h: &&Held| of.strip_prefix(h.name).is_some_and(|unit| unit.is_empty() || unit.starts_with('_'));
        let longest = held.iter().filter(names).map(|h| h.name.len()).max();
        let own: Vec<&Held> = held.iter().filter(names).filter(|h| Some(h.name.len()) == longest).collect();
        let Some(first) = own.first() else {
            let known: Vec<&str> = held.iter().map(|h| h.name).collect();
            return Err(refusal(&place, Some(value), &format!("a parameter of the effect: {}", known.join(", "))));
        };
        if of.len() < key.len() {
            continue;
        }
        let same = |h: &&Held| (h.value - read).abs() <= SAME_NUMBER * h.value.abs().max(read.abs());
        if !own.iter().any(same) {
            let wanted =
                format!("{}, as {} says, which predictions use: edit that one, and this line with it", first.value, first.place);
            return Err(refusal(&place, Some(value), &wanted));
        }
        let se = table.get(&format!("{key}_se")).and_then(number).unwrap_or(0.0);
        out.push(Estimate { name: key.clone(), unit: String::new(), value: read, se });
    }
    Ok(out)
}

/// Refuses a key that is none of these: what nothing reads must not look as if it counted.
pub(super) fn only(table: &Table, keys: &[&str]) -> Result<(), Refusal> {
    match table.iter().find(|(key, _)| !keys.contains(&key.as_str())) {
        Some((key, value)) => Err(refusal(key, Some(value), &format!("no key but {}", keys.join(", ")))),
        None => Ok(()),
    }
}

/// A number that is no farther from 0 than that.
fn within_reach(found: f64, farthest: f64) -> Option<f64> {
    Some(found).filter(|v| v.abs() <= farthest)
}

fn number(v: &Value) -> Option<f64> {
    v.as_float().or_else(|| v.as_integer().map(|i| i as f64))
}

pub(super) fn finite(v: &Value) -> Option<f64> {
    number(v).filter(|v| v.is_finite())
}

fn strings(v: &Value) -> Option<Vec<String>> {
    v.as_array()?.iter().map(|v| v.as_str().map(str::to_owned)).collect()
}

pub(super) fn refusal(key: &str, found: Option<&Value>, expected: &str) -> Refusal {
    let found = match found {
        None => "missing".to_owned(),
        Some(Value::Table(_)) => "a table".to_owned(),
        Some(value) => short(&value.to_string().replace('\n', " ")),
    };
    (key.to_owned(), found, expected.to_owned())
}

pub(super) fn no_channel(key: &str, name: &str) -> Refusal {
    let speeds = "rpm_beam, rpm_opto, rpm_hall, rpm_encoder, rpm";
    (key.to_owned(), format!("no channel '{name}'"), format!("{speeds}, thrust_n, torque_nm, current_a or voltage_v"))
}

pub(super) fn within(place: &str, (key, found, expected): Refusal) -> Refusal {
    (if key.is_empty() { place.to_owned() } else { format!("{place}.{key}") }, found, expected)
}
