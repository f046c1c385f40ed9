//! A schedule file.
//!
//! What it is: TOML with a list of `[[part]]` tables; each has a `kind` and that kind's keys.
//! What can go wrong: an unknown kind or key, a missing key, a value out of its range: one line with file, line and column.
//! Units: each key says its own.
//! Reference: `docs/schedule.md` lists every kind and key.

use crate::error::ScheduleError;
use crate::job::{Channel, Job, Otherwise};
use crate::part::{self, Part};
use crate::plan::Plan;
use crate::replay::{Replay, replay};
use crate::table::{Keys, Refused, number, pulse};
use frame::schedule::FASTEST_MILLIHERTZ;
use frame::units::PulseWidth;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// What may be wrong: here, or in a file that this one names.
enum Wrong {
    Here(Refused),
    There(ScheduleError),
}

impl From<Refused> for Wrong {
    fn from(refused: Refused) -> Self {
        Self::Here(refused)
    }
}

/// Reads a schedule from its text.
pub(crate) fn parse(text: &str, path: &Path) -> Result<Plan, ScheduleError> {
    let here = |(span, reason): Refused| ScheduleError::at(path, text, span.start, reason);
    let table = DeTable::parse(text).map_err(|error| here((error.span().unwrap_or(0..0), error.message().replace('\n', " "))))?;
    whole(table.get_ref(), path).map_err(|wrong| match wrong {
        Wrong::Here(refused) => here(refused),
        Wrong::There(error) => error,
    })
}

/// The files that the parts of a schedule name; of what is no schedule none.
pub(crate) fn named(text: &str) -> Vec<String> {
    let Ok(table) = text.parse::<toml::Table>() else { return Vec::new() };
    let parts = table.get("part").and_then(toml::Value::as_array).into_iter().flatten();
    parts.filter_map(|part| Some(part.get("file")?.as_str()?.to_owned())).collect()
}

fn whole(table: &DeTable<'_>, path: &Path) -> Result<Plan, Wrong> {
    let mut keys = Keys::new(table, "a schedule", 0..0);
    let stem = path.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let name = keys.text_if("name")?.map_or(stem, str::to_owned);
    let list = keys.list("part")?;
    keys.finish()?;
    let mut parts = Vec::new();
    for entry in list {
        let Some(table) = entry.get_ref().as_table() else {
            return Err((entry.span(), "expected a table: [[part]]".to_owned()).into());
        };
        parts.push(one(table, entry, path)?);
    }
    Ok(Plan::new(name, parts))
}

/// Kinds of part, and their names in messages.
const KINDS: [(&str, &str); 12] = [
    ("hold", "a hold"),
    ("staircase", "a staircase"),
    ("steps", "a list of steps"),
    ("ramp", "a ramp"),
    ("step", "a step"),
    ("chirp", "a chirp"),
    ("visits", "a part of visits"),
    ("settle", "a wait until settled"),
    ("replay", "a replay"),
    ("endurance", "an endurance run"),
    ("thrust", "a constant thrust"),
    ("speed", "a constant speed"),
];

fn one(table: &DeTable<'_>, entry: &Spanned<DeValue<'_>>, path: &Path) -> Result<Part, Wrong> {
    let kinds = || KINDS.map(|(kind, _)| kind).join(", ");
    let mut keys = Keys::new(table, "a part", entry.span());
    let kind = keys.text("kind")?;
    let place = keys.place_of("kind");
    let Some((kind, what)) = KINDS.into_iter().find(|(name, _)| *name == kind) else {
        return Err((place, format!("no kind of part is called {kind:?}; expected one of {}", kinds())).into());
    };
    let mut keys = Keys::new(table, what, place);
    keys.value("kind");
    let part = match kind {
        "hold" => part::hold(keys.pulse("pulse_us")?, keys.time("hold_s")?),
        "staircase" => staircase(&mut keys)?,
        "steps" => steps(&mut keys)?,
        "ramp" => part::ramp(keys.pulse_if("from_us")?, keys.pulse("to_us")?, keys.time("length_s")?),
        "step" => step(&mut keys)?,
        "chirp" => chirp(&mut keys)?,
        "visits" => visits(&mut keys)?,
        "settle" => settle(&mut keys)?,
        "endurance" => endurance(&mut keys)?,
        "thrust" => kept(&mut keys, Channel::Thrust, "thrust_n", 1000.0)?,
        "speed" => kept(&mut keys, Channel::Speed, "speed_rpm", 30_000.0)?,
        _ => {
            let (file, what) = replayed(&mut keys)?;
            keys.finish()?;
            let file = path.parent().unwrap_or(Path::new("")).join(file);
            return replay(&file, &what).map_err(Wrong::There);
        }
    };
    keys.finish()?;
    Ok(part)
}

fn staircase(keys: &mut Keys<'_>) -> Result<Part, Refused> {
    let from = keys.pulse_if("from_us")?.unwrap_or(PulseWidth::MIN);
    let top = keys.pulse_if("top_us")?.unwrap_or(PulseWidth::MAX);
    let step = pulse(keys.number("step_us", 0.001, 1000.0)?);
    if top <= from || step.0 > top.0 - from.0 {
        let place = keys.place_of("top_us");
        return Err((
            place,
            format!("top_us: expected at least one step of {} us above {} us, found {}", step.as_us(), from.as_us(), top.as_us()),
        ));
    }
    let (hold_ms, down, visits) = (keys.time("hold_s")?, keys.flag("down")?, keys.times("visits", 1000.0)?);
    Ok(part::staircase(&part::Staircase { from, step, top, hold_ms, down, visits }))
}

fn steps(keys: &mut Keys<'_>) -> Result<Part, Refused> {
    let mut list = Vec::new();
    for entry in keys.list("steps")? {
        let table = entry.get_ref().as_table();
        let table = table.ok_or_else(|| (entry.span(), "expected a step: { pulse_us, hold_s, ramp }".to_owned()))?;
        let mut step = Keys::new(table, "a step of the list", entry.span());
        list.push(((step.pulse("pulse_us")?, step.time("hold_s")?), step.flag("ramp")?));
        step.finish()?;
    }
    Ok(part::steps(&list))
}

fn step(keys: &mut Keys<'_>) -> Result<Part, Refused> {
    let (before, after, hold) = (keys.pulse("before_us")?, keys.pulse("after_us")?, keys.time("hold_s")?);
    let mut part = part::steps(&[((before, hold), false), ((after, hold), false)]);
    part.title = format!("step from {} to {} us", before.as_us(), after.as_us());
    Ok(part)
}

fn chirp(keys: &mut Keys<'_>) -> Result<Part, Refused> {
    let centre = keys.pulse("centre_us")?;
    let room = (centre.as_us() - 1000.0).min(2000.0 - centre.as_us());
    let amplitude = pulse(keys.number("amplitude_us", 0.0, room)?);
    let fastest = f64::from(FASTEST_MILLIHERTZ) / 1e3;
    let mhz = |hz: f64| (hz * 1e3).round() as u32;
    let (from, to) = (keys.number("from_hz", 0.0, fastest)?, keys.number("to_hz", 0.0, fastest)?);
    Ok(part::chirp(centre, amplitude, mhz(from), mhz(to), keys.time("length_s")?))
}

fn visits(keys: &mut Keys<'_>) -> Result<Part, Refused> {
    let levels = keys.list("levels_us")?;
    let hold = keys.time("hold_s")?;
    let mut list = Vec::new();
    for entry in levels {
        let us = number(entry, "levels_us")?;
        if !(1000.0..=2000.0).contains(&us) {
            return Err((entry.span(), format!("levels_us: expected a pulse from 1000 to 2000 us, found {us}")));
        }
        list.push((pulse(us), hold));
    }
    let between = keys.pulse_if("between_us")?.map(|us| Ok::<_, Refused>((us, keys.time_if("between_s")?.unwrap_or(hold))));
    let between = between.transpose()?;
    if between.is_none() && keys.time_if("between_s")?.is_some() {
        return Err((
            keys.place_of("between_s"),
            "between_s: expected between_us beside it, the level that it is held at".to_owned(),
        ));
    }
    Ok(part::visits(&list, between, keys.times("times", 1000.0)?))
}

fn settle(keys: &mut Keys<'_>) -> Result<Part, Refused> {
    let pulse = keys.pulse("pulse_us")?;
    let name = keys.text_if("channel")?.unwrap_or("rpm");
    let Some((_, channel)) = Channel::NAMES.into_iter().find(|(n, _)| *n == name) else {
        let there = Channel::NAMES.map(|(n, _)| n).join(", ");
        return Err((keys.place_of("channel"), format!("channel: expected one of {there}, found {name:?}")));
    };
    let within = keys.number_if("within_percent", 0.001, 50.0)?.unwrap_or(0.5) / 100.0;
    let over_s = keys.number_if("over_s", 0.2, 3600.0)?.unwrap_or(2.0);
    let at_most = keys.time("at_most_s")?;
    if f64::from(at_most) * 1e-3 <= over_s {
        return Err((keys.place_of("at_most_s"), format!("at_most_s: expected more than over_s, {over_s} s")));
    }
    let otherwise = match keys.text_if("otherwise")?.unwrap_or("go-on") {
        "go-on" => Otherwise::GoOn,
        "stop" => Otherwise::Stop,
        other => return Err((keys.place_of("otherwise"), format!("otherwise: expected \"go-on\" or \"stop\", found {other:?}"))),
    };
    let title = format!("{} us until {} has settled", pulse.as_us(), channel.name());
    Ok(part::watched(title, pulse, at_most, Job::Settle { channel, within, over_s, otherwise }))
}

fn endurance(keys: &mut Keys<'_>) -> Result<Part, Refused> {
    let (pulse, length) = (keys.pulse("pulse_us")?, keys.time("length_s")?);
    let title = format!("endurance at {} us", pulse.as_us());
    Ok(match keys.number_if("until_voltage_v", 0.1, 100.0)? {
        None => Part { title, ..part::hold(pulse, length) },
        Some(value) => part::watched(title, pulse, length, Job::Below { channel: Channel::Voltage, value }),
    })
}

fn kept(keys: &mut Keys<'_>, channel: Channel, key: &'static str, most: f64) -> Result<Part, Refused> {
    let value = keys.number(key, 0.001, most)?;
    let (low, high) = (keys.pulse_if("low_us")?.unwrap_or(PulseWidth::MIN), keys.pulse("high_us")?);
    let start = keys.pulse("start_us")?;
    if !(low..=high).contains(&start) {
        let place = keys.place_of("start_us");
        return Err((
            place,
            format!("start_us: expected a pulse from {} to {} us, found {}", low.as_us(), high.as_us(), start.as_us()),
        ));
    }
    let title = format!("{} kept at {value}", channel.name());
    Ok(part::kept(title, start, (low, high), keys.time("length_s")?, Job::Keep { channel, value }))
}

fn replayed<'t>(keys: &mut Keys<'t>) -> Result<(&'t str, Replay), Refused> {
    let file = keys.text("file")?;
    let whole = Replay::default();
    let from_s = keys.number_if("from_s", -1e9, 1e9)?.unwrap_or(whole.from_s);
    let until_s = keys.number_if("until_s", -1e9, 1e9)?.unwrap_or(whole.until_s);
    if until_s <= from_s {
        return Err((keys.place_of("until_s"), format!("until_s: expected a time after {from_s}, found {until_s}")));
    }
    let column = keys.text_if("column")?.map_or(whole.column, str::to_owned);
    Ok((file, Replay { column, from_s, until_s }))
}
