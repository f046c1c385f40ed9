//! Where a page comes from: program, log, rig, and of a demonstration what was hidden.
//!
//! What it is: a short table, and the judgement of the names where the truth is known.
//! What can go wrong: what the log does not state is not told.
//! Units: none.
//! Reference: specification `report.md`.

use super::cards::{is_shown, value};
use super::vocabulary::Vocabulary;
use crate::effects::by_id;
use crate::log::date;
use crate::log::{Gaps, Log, digest_of};
use crate::model::FittedTo;
use crate::report::sheet::Sheet;
use crate::report::svg::escape;
use crate::verdict::words::{list, lower, upper};
use crate::verdict::{EffectEntry, Kin, Parameter, Verdict};
use std::collections::BTreeMap;

/// What was hidden in a simulated rig.
#[derive(Debug, Clone, PartialEq)]
pub struct Hidden {
    /// Seed that repeats it.
    pub seed: u64,
    /// Identifier of the effect.
    pub id: String,
    /// Its parameters with units, as text.
    pub parameters: Vec<String>,
}

impl Hidden {
    /// What is true and what is false of the names, a sentence each.
    #[must_use]
    pub fn judged(&self, verdict: &Verdict) -> Vec<String> {
        let named: Vec<&EffectEntry> = verdict.effects.iter().filter(|e| e.id != "unknown").collect();
        let found = named.iter().any(|e| e.id == self.id);
        let mut out = vec![format!("hidden was {}: {}", self.id, if found { "found" } else { "NOT FOUND" })];
        if !self.parameters.is_empty() {
            out.push(format!("hidden with {}", self.parameters.join(", ")));
        }
        let of_it = named.iter().find(|e| e.id == self.id);
        out.extend(of_it.and_then(|e| as_found(e)));
        let missed = of_it.iter().flat_map(|e| &e.parameters).filter(|p| self.misses(p));
        let missed: Vec<String> = missed.map(|p| p.name.clone()).collect();
        if !missed.is_empty() {
            out.push(format!("what was hidden lies outside the interval of {}", list(&missed)));
        }
        if found {
            out.push(format!("named, and true: {}", self.id));
        }
        let told = |kin: Kin| -> Vec<String> {
            let mut ids: Vec<String> = named.iter().filter(|e| e.id != self.id && e.kin == kin).map(|e| e.id.clone()).collect();
            ids.dedup();
            ids
        };
        for (kin, what) in [
            (Kin::OfEvery, "true of every rig, the simulated one too"),
            (Kin::WithinRow, "where in its row a reading lies, no effect that anybody hides"),
            (Kin::Own, "named, and false (nobody hid it)"),
        ] {
            let ids = told(kin);
            if !ids.is_empty() {
                out.push(format!("{what}: {}", list(&ids)));
            }
        }
        out
    }

    /// Whether the interval of a parameter lies beside what was hidden, where that is known in the same unit.
    fn misses(&self, p: &Parameter) -> bool {
        let hidden = self.parameters.iter().find_map(|text| text.split_once(" = ").filter(|(name, _)| *name == p.name));
        let Some((value, unit)) = hidden.map(|(_, said)| said.split_once(' ').unwrap_or((said, ""))) else { return false };
        let same = unit == p.unit || (unit.is_empty() && p.unit == "1");
        value.parse::<f64>().is_ok_and(|v| same && !(p.ci95[0]..=p.ci95[1]).contains(&v))
    }
}

/// What the identifiers of what was hidden and of what was named stand for.
fn meanings(hidden: &Hidden, verdict: &Verdict) -> String {
    let mut ids: Vec<&str> = std::iter::once(hidden.id.as_str()).chain(verdict.effects.iter().map(|e| e.id.as_str())).collect();
    ids.sort_unstable();
    ids.dedup();
    let of = |id: &str| by_id(id).map(|effect| format!("{id} is \"{}\"", lower(effect.about().title)));
    ids.into_iter().filter_map(of).collect::<Vec<_>>().join("; ")
}

/// The sizes with which an effect was found.
fn as_found(e: &EffectEntry) -> Option<String> {
    let size = |p: &Parameter| {
        let [v, interval, unit] = value(p);
        format!("{} = {} (95 %: {interval})", p.name, format!("{v} {unit}").trim_end())
    };
    let sizes: Vec<String> = e.parameters.iter().filter(|p| is_shown(Vocabulary::RIG, e, p)).map(size).collect();
    (!sizes.is_empty()).then(|| format!("found with {}", sizes.join(", ")))
}

/// Where a run comes from.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Origin {
    /// The log: name, digest, rows, date.
    pub log: FittedTo,
    /// Its length, s, where time is time.
    pub seconds: Option<f64>,
    /// What the log states of the rig, by key.
    pub states: BTreeMap<String, String>,
    /// The declared model's file, where one was given.
    pub model: Option<String>,
    /// The other runs that the model was held against.
    pub validated: Vec<FittedTo>,
    /// What was hidden, of a demonstration.
    pub hidden: Option<Hidden>,
    /// Whether it is of a rig, which has a motor, a propeller and a supply.
    pub of_a_rig: bool,
    /// What the logs lack in time, a sentence each.
    pub lacks: Vec<String>,
    /// What is unusual in the logs' values, a sentence each.
    pub doubts: Vec<String>,
    /// The other logs, where the page is of several runs.
    pub others: Vec<FittedTo>,
}

/// What a log states of its rig, in the order in which it is told.
const STATED: [&str; 12] =
    ["motor", "esc", "propeller", "blades", "supply", "date", "board", "firmware", "schedule", "sample_hz", "source", "note"];

impl Origin {
    /// Of a rig's log.
    #[must_use]
    pub fn of(log: &Log) -> Self {
        let text = |v: &toml::Value| v.as_str().map_or_else(|| v.to_string(), str::to_owned);
        let short = |v: &toml::Value| !v.is_table() && !v.is_array();
        let states = log
            .meta
            .iter()
            .filter(|(k, v)| STATED.contains(&k.as_str()) && short(v))
            .map(|(k, v)| (k.clone(), text(v)))
            .collect();
        let seconds = log.t.first().zip(log.t.last()).map(|(a, b)| b - a).filter(|_| !log.time_is_row());
        let lacks = Gaps::of(log).map(|gaps| format!("{}: {gaps}", log.name)).into_iter().collect();
        let timeless =
            log.time_is_row().then(|| "no time column: rows are counted, and no effect of time is looked for".to_owned());
        let doubts = timeless.into_iter().chain(log.in_doubt()).map(|doubt| format!("{}: {doubt}", log.name)).collect();
        Self { log: FittedTo::of(log), seconds, states, of_a_rig: true, lacks, doubts, ..Self::default() }
    }

    /// Of several logs of one rig: what they all state.
    pub(crate) fn of_several(logs: &[&Log]) -> Self {
        let all: Vec<Self> = logs.iter().map(|log| Self::of(log)).collect();
        let mut of_all = all.iter();
        let Some(first) = of_all.next() else { return Self::default() };
        let mut out = first.clone();
        for other in of_all {
            out.states.retain(|key, value| other.states.get(key) == Some(value));
            out.seconds = out.seconds.zip(other.seconds).map(|(a, b)| a + b);
            out.others.push(other.log.clone());
            out.lacks.extend(other.lacks.iter().cloned());
            out.doubts.extend(other.doubts.iter().cloned());
        }
        out
    }

    /// Of a recording that is known by its text.
    #[must_use]
    pub fn of_text(name: &str, text: &str, rows: usize, seconds: Option<f64>) -> Self {
        let log = FittedTo { name: name.to_owned(), sha256: digest_of(text), rows, date: None };
        Self { log, seconds, ..Self::default() }
    }

    /// Every log.
    fn logs(&self) -> impl Iterator<Item = &FittedTo> {
        std::iter::once(&self.log).chain(&self.others)
    }

    /// The line under the sentence: log, rig, date, rows.
    pub(super) fn line(&self) -> String {
        let mut parts: Vec<String> = vec![match self.others.len() {
            0 => self.log.name.clone(),
            _ => list(&self.logs().map(|l| l.name.clone()).collect::<Vec<_>>()),
        }];
        parts.extend(["motor", "propeller", "supply"].iter().filter_map(|k| self.states.get(*k).cloned()));
        parts.extend(self.log.date.clone().or_else(|| self.day_by_name()));
        parts.push(match self.seconds {
            Some(s) => format!("{} rows in {s:.0} s", self.logs().map(|l| l.rows).sum::<usize>()),
            None => format!("{} rows", self.logs().map(|l| l.rows).sum::<usize>()),
        });
        parts.join(" - ")
    }

    /// The day of a single log by its file name, where its head states none.
    fn day_by_name(&self) -> Option<String> {
        let name = self.others.is_empty().then(|| date::in_name(&self.log.name))?;
        name.map(|day| format!("{day}, by its file name"))
    }

    /// The command that writes the page again.
    pub(super) fn command(&self) -> String {
        let model = self.model.as_ref().map(|m| format!(" --model {m}")).unwrap_or_default();
        let validated: String = self.validated.iter().map(|run| format!(" --validate {}", run.name)).collect();
        match &self.hidden {
            Some(h) => format!("quadrig demo --seed {} --effect {}", h.seed, h.id),
            None => {
                let logs: Vec<&str> = self.logs().map(|l| l.name.as_str()).collect();
                format!("quadrig close-loop {}{model}{validated} -o out", logs.join(" "))
            }
        }
    }
}

/// The section.
pub(super) fn provenance(sheet: &mut Sheet, origin: &Origin, verdict: &Verdict) {
    if let Some(hidden) = &origin.hidden {
        sheet.section("What was hidden");
        let lines: Vec<String> = hidden.judged(verdict).iter().map(|l| format!("<li>{}.</li>", escape(&upper(l)))).collect();
        sheet.html_part(&format!("<ul>{}</ul>\n", lines.concat()));
        sheet.soft(&format!("Here {}.", meanings(hidden, verdict)));
    }
    sheet.section("Where this comes from");
    let mut rows = vec![vec!["program".to_owned(), format!("quadrig {}", env!("CARGO_PKG_VERSION"))]];
    let mut row = |name: &str, value: String| {
        if !value.is_empty() {
            rows.push(vec![name.to_owned(), value]);
        }
    };
    for log in origin.logs() {
        row("log", log.name.clone());
        if let Some(day) = date::in_name(&log.name).filter(|_| log.date.is_none()) {
            row("date", format!("{day}, by its file name"));
        }
        row("SHA-256", log.sha256.clone());
        row("rows", log.rows.to_string());
    }
    for key in STATED {
        let label = if key == "sample_hz" { "samples in a second".to_owned() } else { key.replace('_', " ") };
        row(&label, origin.states.get(key).cloned().unwrap_or_default());
    }
    for key in ["motor", "propeller", "supply", "date"] {
        let named = key == "date" && origin.logs().any(|log| date::in_name(&log.name).is_some());
        if !origin.states.contains_key(key) && !named && (origin.of_a_rig || key == "date") {
            row(key, "not stated in the log".to_owned());
        }
    }
    for run in &origin.validated {
        row("held against", run.name.clone());
        row("SHA-256", run.sha256.clone());
    }
    row("declared model", origin.model.clone().unwrap_or_default());
    row("seed", origin.hidden.as_ref().map_or_else(String::new, |h| h.seed.to_string()));
    row("again", origin.command());
    let rows: Vec<Vec<String>> = rows.into_iter().map(|r| vec![upper(&r[0]), r[1].clone()]).collect();
    sheet.data("provenance", &["what", "value"], &rows, None);
}
