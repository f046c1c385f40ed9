//! The scorer: one trial through the tool, one line of figures.
//!
//! What it is: only the text of the logs goes in; the verdict comes out and is compared with the truth.
//! What can go wrong: a refused log or a panic of the tool counts as a failure, with its reason in the line.
//! Units: sizes in noise floors, time in s.
//! Reference: specification `closing-the-loop.md`, "Blind trials"; `flight.md`, "The loop on flights".

use super::scenario::{Scenario, Trial};
use crate::blind::resume::fields;
use ident::flight::{Closed, close, told};
use ident::log::flight_log;
use ident::verdict::{Kind, Validation, Verdict};

/// Header of the file of results.
pub const HEADER: &str = "seed,kind,truth,size,shown,hz,seconds_flown,verdict,named,probability,first,exact,noticed,false_names,after_told,before_told,covered,alternatives,seconds";
/// Channels that show at least this share of an effect's size count for the errors on the other flight.
const SHOWS: f64 = 0.3;

/// The figures of one trial.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Line {
    /// Seed.
    pub seed: u64,
    /// `clean`, `one`, `two`, `unknown`.
    pub kind: String,
    /// True identifiers, joined by `+`.
    pub truth: String,
    /// Smallest size.
    pub size: f64,
    /// Channels that show the effects most, joined by `+`.
    pub shown: String,
    /// Rows a second.
    pub hz: usize,
    /// Length of the flight, s.
    pub flown: f64,
    /// Verdict, or `refused` or `panic`.
    pub verdict: String,
    /// Identifiers of the best hypothesis, joined by `+`.
    pub named: String,
    /// Probability of its first effect.
    pub probability: f64,
    /// A true identifier stands first (clean: nothing is named; unknown: nothing is named and something is told).
    pub first: bool,
    /// The named set is the true set.
    pub exact: bool,
    /// What an unknown effect left was told on the channel that shows it, with or without a name beside it.
    pub noticed: bool,
    /// Names that are not true.
    pub wrong: usize,
    /// Error on the other flight over that of a fit that was told the names; worst channel that shows the effect.
    pub after_told: f64,
    /// The same before.
    pub before_told: f64,
    /// `id.name:1` or `:0` for shared parameters, joined by `+`.
    pub covered: String,
    /// Other hypotheses.
    pub alternatives: String,
    /// Time of the tool, s.
    pub seconds: f64,
}

crate::blind::resume::is_line!(Line, HEADER);

impl Line {
    /// As a line of the file.
    #[must_use]
    pub fn csv(&self) -> String {
        let b = u8::from;
        format!(
            "{},{},{},{:.3},{},{},{:.1},{},{},{:.4},{},{},{},{},{:.4},{:.4},{},{},{:.2}",
            self.seed,
            self.kind,
            self.truth,
            self.size,
            self.shown,
            self.hz,
            self.flown,
            self.verdict,
            self.named,
            self.probability,
            b(self.first),
            b(self.exact),
            b(self.noticed),
            self.wrong,
            self.after_told,
            self.before_told,
            self.covered,
            self.alternatives,
            self.seconds
        )
    }

    /// From a line of the file; nothing for one that was cut short.
    #[must_use]
    pub fn parse(line: &str) -> Option<Self> {
        let f = fields(line, HEADER)?;
        let s = |i: usize| f[i].to_owned();
        Some(Self {
            seed: f[0].parse().ok()?,
            kind: s(1),
            truth: s(2),
            size: f[3].parse().ok()?,
            shown: s(4),
            hz: f[5].parse().ok()?,
            flown: f[6].parse().ok()?,
            verdict: s(7),
            named: s(8),
            probability: f[9].parse().ok()?,
            first: f[10] == "1",
            exact: f[11] == "1",
            noticed: f[12] == "1",
            wrong: f[13].parse().ok()?,
            after_told: f[14].parse().ok()?,
            before_told: f[15].parse().ok()?,
            covered: s(16),
            alternatives: s(17),
            seconds: f[18].parse().ok()?,
        })
    }
}

/// Runs the tool on a seed.
#[must_use]
pub fn score(seed: u64) -> Line {
    let s = Scenario::new(seed);
    let texts = [s.log(0), s.log(1)];
    let started = std::time::Instant::now();
    let outcome = std::panic::catch_unwind(|| -> Result<Closed, String> {
        let log = flight_log::parse("run.csv", texts[0].as_bytes()).map_err(|e| e.to_string())?;
        let other = flight_log::parse("other.csv", texts[1].as_bytes()).map_err(|e| e.to_string())?;
        close(&log, None, std::slice::from_ref(&other), &mut |_| {}).map_err(|e| e.to_string())
    });
    let mut line = Line {
        seed,
        kind: s.trial.name().to_owned(),
        truth: s.ids().join("+"),
        size: s.sizes.iter().map(|v| v.1).fold(f64::INFINITY, f64::min),
        shown: s.sizes.iter().map(|v| v.0.clone()).collect::<Vec<_>>().join("+"),
        hz: s.instruments.hz,
        flown: s.tracks[0].states.len() as f64 * super::world::STEP_S,
        probability: f64::NAN,
        after_told: f64::NAN,
        before_told: f64::NAN,
        seconds: started.elapsed().as_secs_f64(),
        ..Line::default()
    };
    match outcome {
        Ok(Ok(closed)) => {
            judge(&s, &closed.verdict, &mut line);
            compare(&s, &closed.verdict, &texts, &mut line);
        }
        Ok(Err(why)) => {
            line.verdict = "refused".into();
            line.named = why.replace([',', '\n'], ";");
        }
        Err(_) => line.verdict = "panic".into(),
    }
    line
}

/// `acc_0` as the log has it: `acc_x`.
fn column(shown: &str) -> String {
    match shown.rsplit_once('_') {
        Some((head @ ("acc" | "ang_acc" | "gyro" | "mag"), axis)) => {
            format!("{head}_{}", ["x", "y", "z"][axis.parse::<usize>().unwrap_or(0).min(2)])
        }
        _ => shown.to_owned(),
    }
}

fn judge(s: &Scenario, v: &Verdict, line: &mut Line) {
    let ids = s.ids();
    line.verdict = format!("{:?}", v.verdict).to_lowercase();
    line.named = v.effects.iter().map(|e| e.id.as_str()).collect::<Vec<_>>().join("+");
    let named: Vec<&str> = v.effects.iter().map(|e| e.id.as_str()).filter(|id| *id != "unknown").collect();
    line.probability = v.effects.first().map_or(f64::NAN, |e| e.probability);
    line.alternatives = v.alternatives.iter().take(4).map(|a| a.ids.join("+")).collect::<Vec<_>>().join("|");
    let same = named.len() == ids.len() && ids.iter().all(|i| named.contains(i));
    line.exact = same;
    line.wrong = named.iter().filter(|n| !ids.contains(n)).count();
    let shown: Vec<String> = s.sizes.iter().map(|z| column(&z.0)).collect();
    let told = |c: &String| {
        v.unexplained.iter().any(|u| u.channel == *c) || v.effects.iter().any(|e| e.id == "unknown" && e.channels.contains(c))
    };
    line.noticed = shown.iter().all(told);
    line.first = match s.trial {
        Trial::Clean => named.is_empty(),
        Trial::Unknown => v.verdict == Kind::Unattributed,
        Trial::One | Trial::Two => named.first().is_some_and(|n| ids.contains(n)),
    };
    line.covered = covered(s, v).join("+");
}

/// Parameters that generator and library have in common, and whether their interval holds the truth.
fn covered(s: &Scenario, v: &Verdict) -> Vec<String> {
    let mut out = Vec::new();
    for c in &s.causes {
        let Some(entry) = v.effects.iter().find(|e| e.id == c.id) else { continue };
        let level = (c.along[0].powi(2) + c.along[1].powi(2)).sqrt().max(1e-9);
        let truth: Vec<(&str, f64)> = match c.id {
            "wind" => vec![("north", c.strength * c.along[0] / level), ("east", c.strength * c.along[1] / level)],
            "mass_offset" => vec![("offset_x", c.strength * c.along[0] / level), ("offset_y", c.strength * c.along[1] / level)],
            "lever_arm" => {
                vec![("arm_x", c.strength * c.along[0]), ("arm_y", c.strength * c.along[1]), ("arm_z", c.strength * c.along[2])]
            }
            "rotor_gain" => vec![("thrust_change", -c.strength)],
            "spinup_lag" => vec![("tau_up", c.strength), ("tau_down", c.strength * c.other)],
            "channel_delay" => vec![("delay", c.strength)],
            "dead_rotor_speed" if c.strength > 0.0 => vec![("factor", c.strength)],
            "gyro_bias" => vec![("bias_x", c.strength * c.along[0]), ("bias_y", c.strength * c.along[1])],
            "accelerometer_bias" => vec![("bias_x", c.strength * c.along[0]), ("bias_y", c.strength * c.along[1])],
            _ => Vec::new(),
        };
        for (name, value) in truth {
            let Some(p) = entry.parameters.iter().find(|p| p.name == name) else { continue };
            let inside = p.ci95[0] <= value && value <= p.ci95[1];
            out.push(format!(
                "{}.{name}:{}:{value:.4e}:{:.4e}:{:.2e}",
                c.id,
                u8::from(inside),
                p.value,
                0.5 * (p.ci95[1] - p.ci95[0])
            ));
        }
    }
    out
}

/// Errors on the other flight, against those of a fit that was told the names.
fn compare(s: &Scenario, v: &Verdict, texts: &[String; 2], line: &mut Line) {
    if !matches!(s.trial, Trial::One | Trial::Two) {
        return;
    }
    let [Ok(log), Ok(other)] = [0, 1].map(|k| flight_log::parse(["run.csv", "other.csv"][k], texts[k].as_bytes())) else {
        return;
    };
    let Ok(oracle) = told(&log, &s.ids(), std::slice::from_ref(&other)) else { return };
    let (Some(found), Some(known)) = (v.validation.first(), oracle.verdict.validation.first()) else { return };
    let shown = shows(s);
    let of = |list: &Validation, channel: &str| list.channels.get(channel).copied();
    let ratios = shown.iter().filter_map(|c| {
        let (a, b) = (of(found, c)?, of(known, c)?);
        Some((a.after / b.after, a.before / b.after))
    });
    (line.after_told, line.before_told) = ratios.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::NAN, f64::NAN));
}

/// Channels on which the hidden effects show.
fn shows(s: &Scenario) -> Vec<String> {
    let all = super::size::sizes(&s.vehicle, &s.causes_of(1), &s.instruments, &s.tracks[1]);
    let top = all.first().map_or(0.0, |a| a.1);
    all.iter().filter(|a| a.1 >= SHOWS * top).map(|a| column(&a.0)).collect()
}
