//! The scorer of histories: one rig through the tool, one line of figures.
//!
//! What it is: the texts of the logs go in, changes come out and are compared with the truth.
//! What can go wrong: a refusal or a panic of the tool counts as a failure of the rig.
//! Units: as in `life`; time in s.
//! Reference: docs/history.md.

use super::life::{Fate, Life};
use crate::blind::resume::fields;
use ident::history::{Change, History, Kind, named};
use ident::log::Log;

/// Header of the file of results.
pub const HEADER: &str = "seed,kind,truth,size,runs,first,found,right,held,extra,moved,names,named,seconds";

/// The figures of one rig.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Seed.
    pub seed: u64,
    /// `change`, `drift` or `none`.
    pub kind: String,
    /// The effect.
    pub truth: String,
    /// Its size.
    pub size: f64,
    /// Runs.
    pub runs: usize,
    /// First run that has it.
    pub first: usize,
    /// First runs of what was found, joined by `|`; `d` before that of a drift; `refused` or `panic`.
    pub found: String,
    /// A change was found in this very gap; of a drift, a drift.
    pub right: bool,
    /// The 95 % interval of its gap holds the true one.
    pub held: bool,
    /// Changes that are none.
    pub extra: usize,
    /// The measures that moved most.
    pub moved: String,
    /// Names of the true change, the likeliest first, with their scores.
    pub names: String,
    /// The first name is right; of a drift, the gain of thrust drifts most.
    pub named: bool,
    /// Time that the tool took, s.
    pub seconds: f64,
}

crate::blind::resume::is_line!(Line, HEADER);

impl Line {
    /// As a line of the file.
    #[must_use]
    pub fn csv(&self) -> String {
        let b = u8::from;
        format!(
            "{},{},{},{:.4},{},{},{},{},{},{},{},{},{},{:.1}",
            self.seed,
            self.kind,
            self.truth,
            self.size,
            self.runs,
            self.first,
            self.found,
            b(self.right),
            b(self.held),
            self.extra,
            self.moved,
            self.names,
            b(self.named),
            self.seconds
        )
    }

    /// From a line of the file; nothing for a line that was cut short.
    #[must_use]
    pub fn parse(line: &str) -> Option<Self> {
        let f = fields(line, HEADER)?;
        let s = |i: usize| f[i].to_owned();
        Some(Self {
            seed: f[0].parse().ok()?,
            kind: s(1),
            truth: s(2),
            size: f[3].parse().ok()?,
            runs: f[4].parse().ok()?,
            first: f[5].parse().ok()?,
            found: s(6),
            right: f[7] == "1",
            held: f[8] == "1",
            extra: f[9].parse().ok()?,
            moved: s(10),
            names: s(11),
            named: f[12] == "1",
            seconds: f[13].parse().ok()?,
        })
    }
}

/// One rig.
#[must_use]
pub fn score(seed: u64) -> Line {
    let life = Life::new(seed);
    let (kind, first) = match life.fate {
        Fate::None => ("none", 0),
        Fate::Change { first } => ("change", first),
        Fate::Drift { .. } => ("drift", 0),
    };
    let size = if let Fate::Drift { rate } = life.fate { rate } else { life.size };
    let mut line = Line {
        seed,
        kind: kind.into(),
        truth: life.change.as_ref().map_or_else(String::new, |e| e.id.to_owned()),
        size,
        runs: life.days.len(),
        first,
        found: String::new(),
        right: false,
        held: false,
        extra: 0,
        moved: String::new(),
        names: String::new(),
        named: false,
        seconds: 0.0,
    };
    let read = |k| Log::parse(&format!("run{:02}.csv", k + 1), life.log(k).as_bytes()).map_err(|e| e.to_string());
    let logs: Result<Vec<Log>, String> = (0..life.days.len()).map(read).collect();
    let start = std::time::Instant::now();
    let asked = std::panic::catch_unwind(|| {
        let logs = logs?;
        let (mut history, order) = History::of(&logs, &|_| {}).map_err(|e| e.to_string())?;
        named(&mut history, &order.iter().map(|k| &logs[*k]).collect::<Vec<_>>(), &|_| {});
        Ok::<History, String>(history)
    });
    line.seconds = start.elapsed().as_secs_f64();
    match asked {
        Ok(Ok(history)) => judge(&mut line, &history),
        Ok(Err(why)) => line.found = format!("refused {}", why.replace(',', ";")),
        Err(_) => line.found = "panic".into(),
    }
    line
}

fn judge(line: &mut Line, history: &History) {
    let said = |c: &Change| format!("{}{}", if c.kind == Kind::Drift { "d" } else { "" }, c.first);
    line.found = history.changes.iter().map(said).collect::<Vec<_>>().join("|");
    let is_it = |c: &&Change| match line.kind.as_str() {
        "change" => c.kind == Kind::Step && (c.between[0]..=c.between[1]).contains(&line.first),
        "drift" => c.kind == Kind::Drift,
        _ => false,
    };
    let it = history.changes.iter().find(is_it);
    line.held = it.is_some();
    line.right = it.is_some_and(|c| line.kind == "drift" || c.first == line.first);
    line.extra = history.changes.len() - usize::from(line.held);
    // what was found elsewhere is looked at as well
    let Some(shown) = it.or_else(|| history.changes.first()) else { return };
    let moved = shown.moved.iter().take(4).map(|m| format!("{} {:.0}", m.name, m.evidence));
    line.moved = moved.collect::<Vec<_>>().join("|");
    line.names = shown.names.iter().map(|n| format!("{} {:.1}", n.id, n.score)).collect::<Vec<_>>().join("|");
    line.named = it.is_some()
        && match line.kind.as_str() {
            "drift" => shown.moved.first().is_some_and(|m| m.name.starts_with("thrust_n gain")),
            _ => shown.names.first().is_some_and(|n| n.id == line.truth),
        };
}
