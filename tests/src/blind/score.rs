//! The scorer: one scenario through the tool, one line of figures.
//!
//! What it is: only the text of the logs goes in; the verdict comes out and is compared with the truth.
//! What can go wrong: a refused log or a panic of the tool counts as a failure of the run, with its reason in the line.
//! Units: sizes in noise floors, time in s.
//! Reference: specification `closing-the-loop.md`, "Blind trials"; `formats.md`, "Verdict".

use super::rig::{Rig, poly};
use super::run::{Run, consensus};
use super::scenario::{Hidden, Scenario};
use crate::blind::resume::fields;
use ident::log::Log;
use ident::verdict::{Kind, Verdict};

/// Header of the file of results.
pub const HEADER: &str = "seed,kind,truth,size,sizes,shown,schedule,hz,rows,verdict,named,probability,first,top3,exact,after_ratio,before_ratio,told_ratio,coverage,alternatives,seconds";

/// The figures of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Seed.
    pub seed: u64,
    /// `clean`, `one`, `two`, `unknown`.
    pub kind: String,
    /// True identifiers, joined by `+`.
    pub truth: String,
    /// Smallest size.
    pub size: f64,
    /// All sizes, joined by `+`.
    pub sizes: String,
    /// Channels that show the effects most.
    pub shown: String,
    /// Shape of the schedule.
    pub schedule: String,
    /// Sampling, Hz.
    pub hz: f64,
    /// Rows.
    pub rows: usize,
    /// Verdict, or `refused` or `panic`.
    pub verdict: String,
    /// Identifiers of the best hypothesis, joined by `+`.
    pub named: String,
    /// Probability of its first effect being there.
    pub probability: f64,
    /// A true identifier stands first (or the unknown was recognised, or the clean run called none).
    pub first: bool,
    /// The true set, or the true effect, is among the first three hypotheses.
    pub top3: bool,
    /// The named set is the true set.
    pub exact: bool,
    /// Error after on the other run over the noise that was really added there; worst affected channel; NaN where chance rules.
    pub after_ratio: f64,
    /// The same before.
    pub before_ratio: f64,
    /// Error after on the other run over that of a fit that was told which effects act; worst affected channel; NaN as above.
    pub told_ratio: f64,
    /// `name:1` or `name:0` for every shared parameter, joined by `+`.
    pub coverage: String,
    /// The other hypotheses, joined by `|`.
    pub alternatives: String,
    /// Time that the tool took, s.
    pub seconds: f64,
}

crate::blind::resume::is_line!(Line, HEADER);

impl Line {
    /// A run of which nothing is known yet.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            seed: 0,
            kind: String::new(),
            truth: String::new(),
            size: 0.0,
            sizes: String::new(),
            shown: String::new(),
            schedule: String::new(),
            hz: 0.0,
            rows: 0,
            verdict: String::new(),
            named: String::new(),
            probability: f64::NAN,
            first: false,
            top3: false,
            exact: false,
            after_ratio: f64::NAN,
            before_ratio: f64::NAN,
            told_ratio: f64::NAN,
            coverage: String::new(),
            alternatives: String::new(),
            seconds: 0.0,
        }
    }

    /// As a line of the file.
    #[must_use]
    pub fn csv(&self) -> String {
        let b = u8::from;
        format!(
            "{},{},{},{:.3},{},{},{},{},{},{},{},{:.4},{},{},{},{:.4},{:.4},{:.4},{},{},{:.2}",
            self.seed,
            self.kind,
            self.truth,
            self.size,
            self.sizes,
            self.shown,
            self.schedule,
            self.hz,
            self.rows,
            self.verdict,
            self.named,
            self.probability,
            b(self.first),
            b(self.top3),
            b(self.exact),
            self.after_ratio,
            self.before_ratio,
            self.told_ratio,
            self.coverage,
            self.alternatives,
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
            sizes: s(4),
            shown: s(5),
            schedule: s(6),
            hz: f[7].parse().ok()?,
            rows: f[8].parse().ok()?,
            verdict: s(9),
            named: s(10),
            probability: f[11].parse().ok()?,
            first: f[12] == "1",
            top3: f[13] == "1",
            exact: f[14] == "1",
            after_ratio: f[15].parse().ok()?,
            before_ratio: f[16].parse().ok()?,
            told_ratio: f[17].parse().ok()?,
            coverage: s(18),
            alternatives: s(19),
            seconds: f[20].parse().ok()?,
        })
    }
}

/// Runs the tool on a seed.
#[must_use]
pub fn score(seed: u64) -> Line {
    let s = Scenario::new(seed);
    let (run, other) = (s.run(0), s.run(1));
    let texts = [super::write::text(&s.rig, &run), super::write::text(&s.rig, &other)];
    let started = std::time::Instant::now();
    let outcome = std::panic::catch_unwind(|| -> Result<Verdict, String> {
        let log = Log::parse("run.csv", texts[0].as_bytes()).map_err(|e| e.to_string())?;
        let validate = Log::parse("other.csv", texts[1].as_bytes()).map_err(|e| e.to_string())?;
        let closed = ident::close::close(&log, None, std::slice::from_ref(&validate), &mut |_| {}).map_err(|e| e.to_string())?;
        Ok(closed.verdict)
    });
    let seconds = started.elapsed().as_secs_f64();
    let ids = s.hidden.ids();
    let mut line = Line {
        seed,
        kind: s.hidden.name().to_owned(),
        truth: ids.join("+"),
        size: s.smallest(),
        sizes: s.sizes.iter().map(|v| format!("{v:.2}")).collect::<Vec<_>>().join("+"),
        shown: s.shown.join("+"),
        schedule: s.schedules[0].shape.name().to_owned(),
        hz: s.rig.hz,
        rows: run.t.len(),
        seconds,
        ..Line::empty()
    };
    match outcome {
        Ok(Ok(v)) => {
            judge(&s, &v, &other, &mut line);
            line.told_ratio = over_told(&s, &v, &texts);
        }
        Ok(Err(why)) => {
            line.verdict = "refused".into();
            line.named = why.replace([',', '\n'], ";");
        }
        Err(_) => line.verdict = "panic".into(),
    }
    line
}

fn judge(s: &Scenario, v: &Verdict, other: &Run, line: &mut Line) {
    let ids = s.hidden.ids();
    let all: Vec<&str> = v.effects.iter().map(|e| e.id.as_str()).collect();
    line.verdict = format!("{:?}", v.verdict).to_lowercase();
    line.named = all.join("+");
    // what has no name stands beside the names and is none of them
    let named: Vec<&str> = all.into_iter().filter(|id| *id != "unknown").collect();
    line.probability = v.effects.first().map_or(f64::NAN, |e| e.probability);
    line.alternatives = v.alternatives.iter().map(|a| a.ids.join("+")).collect::<Vec<_>>().join("|");
    let same = |set: &[&str]| set.len() == ids.len() && ids.iter().all(|i| set.contains(i));
    line.exact = same(&named);
    // a choice between names that are all wrong recognises nothing
    let recognised = v.verdict == Kind::Unattributed;
    (line.first, line.top3) = match s.hidden {
        Hidden::Clean => (v.verdict == Kind::None, v.verdict == Kind::None),
        Hidden::Unknown(_) => (recognised, recognised),
        Hidden::One(id) => {
            let third = v.alternatives.iter().take(2).any(|a| a.ids.iter().any(|i| i == id));
            (named.first() == Some(&id), named.contains(&id) || third)
        }
        Hidden::Two(..) => {
            let third = v.alternatives.iter().take(2).any(|a| same(&a.ids.iter().map(String::as_str).collect::<Vec<_>>()));
            (named.first().is_some_and(|n| ids.contains(n)), line.exact || third)
        }
    };
    let mut covered = Vec::new();
    for e in &s.effects {
        let Some(entry) = v.effects.iter().find(|n| n.id == e.id) else { continue };
        for (name, value) in e.truth(&s.rig) {
            let Some(p) = entry.parameters.iter().find(|p| p.name == name) else { continue };
            let inside = p.ci95[0] <= value && value <= p.ci95[1];
            covered.push(format!(
                "{}.{name}:{}:{value:.4e}:{:.4e}:{:.2e}",
                e.id,
                u8::from(inside),
                p.value,
                0.5 * (p.ci95[1] - p.ci95[0])
            ));
        }
    }
    line.coverage = covered.join("+");
    if s.effects.iter().any(super::effect::Effect::by_chance) {
        return;
    }
    let floor = realised(&s.rig, other);
    let Some(validation) = v.validation.first() else { return };
    let shown = floor.iter().filter(|(channel, _)| shows(s, channel));
    let ratios =
        shown.filter_map(|(channel, noise)| validation.channels.get(*channel).map(|c| (c.after / noise, c.before / noise)));
    (line.after_ratio, line.before_ratio) = ratios.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::NAN, f64::NAN));
}

/// Whether a channel is one of those that the effects act on most.
fn shows(s: &Scenario, channel: &str) -> bool {
    s.shown.contains(&channel)
        || s.effects.is_empty()
        || (channel.starts_with("rpm") && s.shown.iter().any(|c| c.starts_with("rpm")))
}

/// Error after on the other run over that of a fit that was told the true effects: what was lost by not knowing them.
fn over_told(s: &Scenario, v: &Verdict, texts: &[String; 2]) -> f64 {
    let known = matches!(s.hidden, Hidden::One(_) | Hidden::Two(..));
    if !known || s.effects.iter().any(super::effect::Effect::by_chance) {
        return f64::NAN;
    }
    let logs = [0, 1].map(|k| Log::parse("run.csv", texts[k].as_bytes()).ok());
    let ([Some(log), Some(other)], Some(found)) = (&logs, v.validation.first()) else { return f64::NAN };
    let Some(told) = ident::close::told::told(log, &s.hidden.ids(), other) else { return f64::NAN };
    let shown = found.channels.iter().filter(|(name, _)| shows(s, name));
    let ratios = shown.filter_map(|(name, c)| told.channels.get(name).map(|t| c.after / t.after));
    ratios.max_by(f64::total_cmp).unwrap_or(f64::NAN)
}

/// Rms of the noise that was really added to each channel's primary relation.
fn realised(rig: &Rig, run: &Run) -> Vec<(&'static str, f64)> {
    let rows = run.t.len();
    let quiet: Vec<(&'static str, Vec<f64>)> = run.quiet.iter().map(|(n, y)| (*n, y.clone())).collect();
    let seen: Vec<f64> = (0..rows).map(|r| consensus(&run.columns, r)).collect();
    let real: Vec<f64> = (0..rows).map(|r| consensus(&quiet, r)).collect();
    run.columns
        .iter()
        .filter_map(|(name, y)| {
            let q = run.quiet.get(name)?;
            let slope: &dyn Fn(f64) -> f64 = match *name {
                "thrust_n" => &|n| slope(&rig.thrust, n),
                "torque_nm" => &|n| slope(&rig.torque, n),
                "current_a" => &|n| slope(&rig.current, n),
                "voltage_v" => &|_| 0.0,
                c if c.starts_with("rpm") => {
                    // the wander is part of what the pulse cannot predict
                    let e: Vec<f64> = (0..rows)
                        .filter(|r| y[*r].is_finite())
                        .map(|r| (y[r] - q[r]).powi(2) + (rig.wander * q[r]).powi(2))
                        .collect();
                    return Some((*name, (e.iter().sum::<f64>() / e.len() as f64).sqrt()));
                }
                _ => return None,
            };
            let e: Vec<f64> = (0..rows)
                .filter(|r| y[*r].is_finite() && seen[*r].is_finite())
                .map(|r| (y[r] - q[r] - slope(real[r]) * (seen[r] - real[r])).powi(2))
                .collect();
            Some((*name, (e.iter().sum::<f64>() / e.len() as f64).sqrt()))
        })
        .collect()
}

fn slope(c: &[f64], n: f64) -> f64 {
    (poly(c, n / 1000.0 + 0.001) - poly(c, n / 1000.0 - 0.001)) / 2.0
}
