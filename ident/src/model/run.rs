//! The runs that a model was fitted to, and what belongs to each: `[[run]]`.
//!
//! What it is: name, digest, rows and date of each log; of several runs the constants of each channel that stand on it, in
//! `[run.channel.<name>]`, and its own drifts and events, in `[[run.effect]]`.
//! What can go wrong: what a table does not say as it must is refused with its place.
//! Units: in the key of each number.
//! Reference: specification `formats.md`, "Scope".

use super::read::{Refusal, finite, no_channel, only, refusal, within};
use super::{AddedEffect, FittedTo, RunLevel, coefficient_key};
use crate::channel::Relation;
use crate::numeric::digits;
use toml::{Table, Value};

/// Keys of `[[run]]`.
const KEYS: [&str; 6] = ["log", "sha256", "rows", "date", "channel", "effect"];

/// One table a run.
pub(super) fn tables(runs: &[FittedTo], own: &[RunLevel]) -> Vec<Value> {
    let table = |(k, run): (usize, &FittedTo)| {
        let mut t = Table::new();
        t.insert("log".into(), run.name.clone().into());
        t.insert("sha256".into(), run.sha256.clone().into());
        t.insert("rows".into(), (run.rows as i64).into());
        if let Some(date) = &run.date {
            t.insert("date".into(), date.clone().into());
        }
        if let Some(own) = own.get(k) {
            let of_channel = |(channel, values): &(String, Vec<f64>)| {
                let all = values.iter().enumerate().map(|(i, v)| (coefficient_key(channel, i), Value::from(digits::plain(*v))));
                (channel.clone(), Value::Table(all.collect()))
            };
            t.insert("channel".into(), Value::Table(own.polynomials.iter().map(of_channel).collect()));
            if !own.effects.is_empty() {
                t.insert(
                    "effect".into(),
                    own.effects.iter().map(|e| Value::Table(e.to_table(&run.name))).collect::<Vec<_>>().into(),
                );
            }
        }
        Value::Table(t)
    };
    runs.iter().enumerate().map(table).collect()
}

/// The runs, and what belongs to each; the second list is empty where no run has anything of its own.
pub(super) fn read(value: Option<&Value>) -> Result<(Vec<FittedTo>, Vec<RunLevel>), Refusal> {
    let Some(list) = value else { return Ok(Default::default()) };
    let list = list.as_array().ok_or_else(|| refusal("run", Some(list), "a list of tables, [[run]]"))?;
    let of = |(i, value): (usize, &Value)| {
        let whole = fitted_to(value).and_then(|run| Ok((run, level(value)?)));
        whole.map_err(|refusal| within(&format!("run[{i}]"), refusal))
    };
    let (runs, own): (Vec<FittedTo>, Vec<RunLevel>) =
        list.iter().enumerate().map(of).collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
    let any = own.iter().any(|o| !o.polynomials.is_empty() || !o.effects.is_empty());
    Ok((runs, if any { own } else { Vec::new() }))
}

/// A run that the model was fitted to.
fn fitted_to(value: &Value) -> Result<FittedTo, Refusal> {
    let text = |key: &str| value.get(key).and_then(Value::as_str).map(str::to_owned);
    let wanted = |key: &str, expected: &str| refusal(key, value.get(key), expected);
    only(value.as_table().ok_or_else(|| refusal("", Some(value), "a table, [[run]]"))?, &KEYS)?;
    let is_digest = |d: &String| d.len() == 64 && d.bytes().all(|b| b.is_ascii_hexdigit());
    Ok(FittedTo {
        name: text("log").ok_or_else(|| wanted("log", "the name of a log"))?,
        sha256: text("sha256").filter(is_digest).ok_or_else(|| wanted("sha256", "64 hexadecimal digits, as sha256sum prints"))?,
        rows: value
            .get("rows")
            .and_then(Value::as_integer)
            .and_then(|n| usize::try_from(n).ok())
            .ok_or_else(|| wanted("rows", "a number of rows"))?,
        date: text("date"),
    })
}

/// What belongs to it.
fn level(value: &Value) -> Result<RunLevel, Refusal> {
    let mut out = RunLevel::default();
    if let Some(channels) = value.get("channel") {
        let table = channels.as_table().ok_or_else(|| refusal("channel", Some(channels), "one table for each channel"))?;
        for (name, own) in table {
            let place = format!("channel.{name}");
            let relation = Relation::of(name, true).ok_or_else(|| no_channel(&place, name))?;
            let own = own.as_table().filter(|t| (1..=relation.degree() + 1).contains(&t.len()));
            let own = own.ok_or_else(|| {
                refusal(&place, table.get(name), &format!("a table of up to {} coefficients", relation.degree() + 1))
            })?;
            let of = |k: usize| {
                let key = coefficient_key(name, k);
                let value = own.get(&key);
                value.and_then(finite).ok_or_else(|| {
                    refusal(&format!("{place}.{key}"), value, "a finite number in the unit that its key ends with")
                })
            };
            out.polynomials.push((name.clone(), (0..own.len()).map(of).collect::<Result<_, _>>()?));
        }
    }
    if let Some(effects) = value.get("effect") {
        let list = effects.as_array().ok_or_else(|| refusal("effect", Some(effects), "a list of tables, [[run.effect]]"))?;
        for (i, value) in list.iter().enumerate() {
            let own = AddedEffect::from_table(value).map_err(|refusal| within(&format!("effect[{i}]"), refusal))?;
            out.effects.push(own);
        }
    }
    Ok(out)
}
