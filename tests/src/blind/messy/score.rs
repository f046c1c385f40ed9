//! One messy run through the tool, one line of figures.
//!
//! What it is: only the logs' text goes in. Names are held against the rig's own effects and what is on top; the corrected model predicts
//! the second run, and its errors are held against those of the truth itself.
//! What can go wrong: a refused log or a panic of the tool is a verdict that collapsed.
//! Units: sizes in noise floors, time in s.
//! Reference: specification `closing-the-loop.md`, "What counts as proof".

use super::scenario::{Messy, Top};
use super::size::SHOWN;
use crate::blind::effect::Effect;
use crate::blind::resume::fields;
use crate::blind::rig::poly;
use crate::blind::run::Run;
use crate::blind::write::text;
use ident::close::{Closed, close};
use ident::log::Log;
use serde_json::Value;

/// Header of the file of results.
pub const HEADER: &str = "seed,top,own,own_sizes,on_top,on_top_sizes,verdict,named,own_shown,own_named,names,names_true,top_shown,top_first,unknown_shown,unknown_noticed,collapsed,ratios,rows,seconds";

/// The figures of one messy run. Flags are 0 or 1; what does not apply is 0 of 0.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Line {
    /// Seed.
    pub seed: u64,
    /// Kind of what is on top.
    pub top: String,
    /// The rig's own effects with their channels, joined by `+`, and their sizes.
    pub own: [String; 2],
    /// The same of what is on top.
    pub on_top: [String; 2],
    /// Verdict, or `refused` or `panic`.
    pub verdict: String,
    /// Names with their first channel and their probability, joined by `+`; a `!` before each that is not true.
    pub named: String,
    /// Own effects that the run shows, and how many of them are named.
    pub own_named: [usize; 2],
    /// Names, and how many of them are true.
    pub names: [usize; 2],
    /// Whether a listed effect on top shows, and whether it is the first name that is not the rig's own.
    pub top_first: [usize; 2],
    /// Whether an unknown effect shows, and whether it was noticed.
    pub noticed: [usize; 2],
    /// Whether nothing was named although an own effect shows.
    pub collapsed: bool,
    /// Error on the second run over that of the truth, `channel:ratio` joined by `+`.
    pub ratios: String,
    /// Rows of the first run.
    pub rows: usize,
    /// Time that the tool took, s.
    pub seconds: f64,
}

crate::blind::resume::is_line!(Line, HEADER);

impl Line {
    /// As a line of the file.
    #[must_use]
    pub fn csv(&self) -> String {
        let pair = |p: &[usize; 2]| format!("{},{}", p[0], p[1]);
        format!(
            "{},{},{},{},{},{},{},{},{},{},{},{},{},{:.2}",
            self.seed,
            self.top,
            self.own.join(","),
            self.on_top.join(","),
            self.verdict,
            self.named,
            pair(&self.own_named),
            pair(&self.names),
            pair(&self.top_first),
            pair(&self.noticed),
            u8::from(self.collapsed),
            self.ratios,
            self.rows,
            self.seconds
        )
    }

    /// From a line of the file; nothing for a line that was cut short.
    #[must_use]
    pub fn parse(line: &str) -> Option<Self> {
        let f = fields(line, HEADER)?;
        let s = |i: usize| f[i].to_owned();
        let pair = |i: usize| Some([f[i].parse().ok()?, f[i + 1].parse().ok()?]);
        Some(Self {
            seed: f[0].parse().ok()?,
            top: s(1),
            own: [s(2), s(3)],
            on_top: [s(4), s(5)],
            verdict: s(6),
            named: s(7),
            own_named: pair(8)?,
            names: pair(10)?,
            top_first: pair(12)?,
            noticed: pair(14)?,
            collapsed: f[16] == "1",
            ratios: s(17),
            rows: f[18].parse().ok()?,
            seconds: f[19].parse().ok()?,
        })
    }

    /// The errors on the second run over the truth's, by channel.
    pub fn errors(&self) -> impl Iterator<Item = (&str, f64)> {
        self.ratios.split('+').filter_map(|r| r.split_once(':')).filter_map(|(c, v)| Some((c, v.parse().ok()?)))
    }
}

/// One name of a verdict: identifier, channels and probability.
type Name = (String, Vec<String>, f64);

/// Runs the tool on a seed.
#[must_use]
pub fn score(seed: u64) -> Line {
    let m = Messy::new(seed);
    let logged = [m.run(0), m.run(1)];
    let started = std::time::Instant::now();
    let outcome = std::panic::catch_unwind(|| -> Result<(Closed, Log), String> {
        let read = |w: usize| Log::parse("run.csv", text(&m.rig, &logged[w].0).as_bytes()).map_err(|e| e.to_string());
        let (log, other) = (read(0)?, read(1)?);
        Ok((close(&log, None, &[], &mut |_| {}).map_err(|e| e.to_string())?, other))
    });
    let told = |range: &[Effect]| range.iter().map(|e| format!("{}@{}", e.id, e.channel)).collect::<Vec<_>>().join("+");
    let sized = |range: &[(f64, &str)]| range.iter().map(|s| format!("{:.2}", s.0)).collect::<Vec<_>>().join("+");
    let mut line = Line {
        seed,
        top: m.top.name().to_owned(),
        own: [told(&m.effects[..m.own]), sized(&m.sizes[..m.own])],
        on_top: [told(&m.effects[m.own..]), sized(&m.sizes[m.own..])],
        own_named: [shown(&m, 0..m.own).count(), 0],
        rows: logged[0].0.t.len(),
        seconds: started.elapsed().as_secs_f64(),
        ..Line::default()
    };
    match outcome {
        Ok(Ok((closed, other))) => {
            judge(&m, &serde_json::to_value(&closed.verdict).unwrap_or_default(), &mut line);
            line.ratios = ratios(&m, &closed, &other, &logged[1])
                .into_iter()
                .map(|(c, r)| format!("{c}:{r:.3}"))
                .collect::<Vec<_>>()
                .join("+");
        }
        Ok(Err(why)) => (line.verdict, line.named) = ("refused".into(), why.replace([',', '\n', '+'], ";")),
        Err(_) => line.verdict = "panic".into(),
    }
    line.collapsed = line.own_named[0] > 0 && line.names[0] == 0;
    line
}

/// The effects of a range that the run shows.
fn shown(m: &Messy, range: std::ops::Range<usize>) -> impl Iterator<Item = &Effect> {
    range.filter(|i| m.sizes[*i].0 >= SHOWN).map(|i| &m.effects[i])
}

/// Whether a name says what an effect is: the same cause, on its channel where it acts on one. A rotor that follows late and its inertia
/// are one cause.
fn says(name: &Name, e: &Effect) -> bool {
    const ROTOR: [&str; 2] = ["spinup_lag", "rotor_inertia"];
    let alike = name.0 == e.id || (ROTOR.contains(&name.0.as_str()) && ROTOR.contains(&e.id));
    let of_one =
        ["channel_filter", "channel_delay", "sample_hold", "quantisation", "glitch_rows", "missed_pulses", "double_pulses"];
    alike && (!of_one.contains(&e.id) || name.1.iter().any(|c| c == e.channel))
}

/// Holds a verdict, as the file says it, against the truth.
fn judge(m: &Messy, verdict: &Value, line: &mut Line) {
    let strings =
        |v: &Value| -> Vec<String> { v.as_array().into_iter().flatten().filter_map(|s| s.as_str().map(str::to_owned)).collect() };
    let entries: Vec<Name> = verdict["effects"]
        .as_array()
        .into_iter()
        .flatten()
        .map(|e| {
            (e["id"].as_str().unwrap_or_default().to_owned(), strings(&e["channels"]), e["probability"].as_f64().unwrap_or(0.0))
        })
        .collect();
    let names: Vec<&Name> = entries.iter().filter(|n| n.0 != "unknown").collect();
    let is_true = |n: &Name| m.effects.iter().any(|e| says(n, e));
    line.verdict = verdict["verdict"].as_str().unwrap_or_default().to_owned();
    let word =
        |n: &&Name| format!("{}{}@{}*{:.2}", if is_true(n) { "" } else { "!" }, n.0, n.1.first().map_or("", String::as_str), n.2);
    line.named = names.iter().map(word).collect::<Vec<_>>().join("+");
    line.own_named[1] = shown(m, 0..m.own).filter(|e| names.iter().any(|n| says(n, e))).count();
    line.names = [names.len(), names.iter().filter(|n| is_true(n)).count()];
    let own = |n: &Name| m.effects[..m.own].iter().any(|e| says(n, e));
    let first = names.iter().find(|n| !own(n));
    for (e, (_, channel)) in m.effects.iter().zip(&m.sizes).skip(m.own).filter(|(_, s)| s.0 >= SHOWN) {
        if e.id.starts_with("unknown_") {
            line.noticed = [1, usize::from(noticed(verdict, &entries, channel))];
        } else {
            line.top_first = [1, usize::from(first.is_some_and(|n| says(n, e)))];
        }
    }
    debug_assert!(m.top != Top::Nothing || line.top_first[0] == 0);
}

/// Whether a verdict says that something without a name is left on a channel. A verdict of format 1 can say so of the whole run only.
fn noticed(verdict: &Value, entries: &[Name], channel: &str) -> bool {
    let on = |said: &str| said.starts_with(channel) || (channel.starts_with("rpm") && said.starts_with("rpm"));
    let listed = verdict["unexplained"].as_array().into_iter().flatten();
    verdict["verdict"] == "unattributed"
        || listed.filter_map(|u| u["channel"].as_str()).any(on)
        || entries.iter().any(|n| n.0 == "unknown" && n.1.iter().any(|c| on(c)))
}

/// Error of the corrected model on the second run over that of the truth, on the samples that a probe did not make up, one constant a
/// channel apart. Runs that an unknown effect or pure chance acts on have no best, and a speed that no command asks for has no prediction.
fn ratios(m: &Messy, closed: &Closed, other: &Log, second: &(Run, Vec<Vec<bool>>)) -> Vec<(&'static str, f64)> {
    if matches!(m.top, Top::Unknown | Top::Both) || m.effects.iter().any(Effect::by_chance) {
        return Vec::new();
    }
    let context = closed.model.context(other);
    let model = closed.model.elsewhere();
    let (run, made_up) = second;
    let still = m.still(1);
    let of_channel = |(name, y): &(&'static str, Vec<f64>), made_up: &Vec<bool>| {
        if name.starts_with("rpm") && !m.dirt.command {
            return None;
        }
        let target = &context.targets[context.target(name)?];
        let prediction = model.predict(&context, name)?;
        let truth = truth(m, run, &still, name)?;
        let rows: Vec<usize> = (0..run.t.len())
            .filter(|r| y[*r].is_finite() && !made_up[*r] && target.claims(*r) && prediction[*r].is_finite())
            .collect();
        let error = |p: &[f64]| scatter(rows.iter().map(|r| y[*r] - p[*r]));
        let (got, best) = (error(&prediction), error(&truth));
        // a channel whose coarse step swallows all that happens has no error to compare
        (rows.len() > 20 && got > 0.0 && best > 0.0).then_some((*name, got / best))
    };
    run.columns.iter().zip(made_up).filter_map(|(c, made_up)| of_channel(c, made_up)).collect()
}

/// What the truth says of a channel: of a speed what the command asks for, of the others what follows from the speed as it is measured by
/// the sensors that do not drop out. `None` of a channel that stands for scatter itself (`thrust_rms_n`): it has no best.
fn truth(m: &Messy, run: &Run, still: &Run, name: &str) -> Option<Vec<f64>> {
    if name.starts_with("rpm") {
        return still.columns.iter().find(|c| c.0 == name).map(|c| c.1.clone());
    }
    let quiet = run.quiet.get(name)?;
    let curve: &[f64] = match name {
        "thrust_n" => &m.rig.thrust,
        "torque_nm" => &m.rig.torque,
        "current_a" => &m.rig.current,
        _ => return Some(quiet.clone()),
    };
    if m.effects.iter().any(|e| e.id == "channel_filter" && e.channel == name) {
        return Some(quiet.clone()); // the meter averages the speed's noise away
    }
    let dropping = |c: &str| m.dirt.drops.iter().any(|d| d.0 == c);
    let of = |n: f64| poly(curve, n / 1000.0);
    let at = |r: usize| {
        let seen = run.columns.iter().filter(|c| c.0.starts_with("rpm") && !dropping(c.0));
        let mut e: Vec<f64> = seen.map(|c| c.1[r] - run.quiet[c.0][r]).filter(|v| v.is_finite()).collect();
        e.sort_by(f64::total_cmp);
        let n = run.quiet.iter().find(|c| c.0.starts_with("rpm")).map_or(0.0, |c| c.1[r]);
        let off = if e.is_empty() { 0.0 } else { 0.5 * (e[(e.len() - 1) / 2] + e[e.len() / 2]) };
        quiet[r] + of(n + off) - of(n)
    };
    Some((0..run.t.len()).map(at).collect())
}

fn scatter(residual: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = residual.clone().count() as f64;
    let own = residual.clone().sum::<f64>() / n;
    (residual.map(|r| (r - own).powi(2)).sum::<f64>() / n).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_that_stands_for_scatter_has_no_best_and_ends_no_campaign() {
        assert!(score(15).csv().contains("thrust_n:")); // its log has thrust_rms_n too
    }

    #[test]
    fn a_line_comes_back_as_it_was() {
        let line = Line {
            seed: 7,
            top: "both".into(),
            own: ["supply_sag@voltage_v".into(), "12.00".into()],
            on_top: ["stall@thrust_n".into(), "4.00".into()],
            verdict: "attributed".into(),
            named: "supply_sag@voltage_v+!creep@thrust_n".into(),
            own_named: [1, 1],
            names: [2, 1],
            top_first: [1, 0],
            noticed: [0, 0],
            collapsed: false,
            ratios: "thrust_n:1.250+rpm_beam:2.000".into(),
            rows: 900,
            seconds: 0.5,
        };
        assert_eq!(line.csv().split(',').count(), HEADER.split(',').count());
        assert_eq!(Line::parse(&line.csv()), Some(line.clone()));
        assert_eq!(line.errors().collect::<Vec<_>>(), [("thrust_n", 1.25), ("rpm_beam", 2.0)]);
    }

    #[test]
    fn names_are_held_against_the_rig_and_what_is_on_top() {
        let mut m = Messy::new(2);
        let of = |id, channel| Effect { id, channel, strength: 1.0, sign: 1.0, b: 1.0, c: 0.0, t0: 0.0, form: 0 };
        m.effects = vec![of("supply_sag", "voltage_v"), of("channel_filter", "thrust_n"), of("stall", "thrust_n")];
        (m.own, m.sizes) = (2, vec![(20.0, "voltage_v"), (2.0, "thrust_n"), (5.0, "thrust_n")]);
        let verdict = serde_json::json!({"verdict": "attributed", "effects": [
            {"id": "supply_sag", "channels": ["voltage_v"], "probability": 0.9},
            {"id": "channel_filter", "channels": ["current_a"]},
            {"id": "stall", "channels": ["thrust_n", "torque_nm"]},
            {"id": "unknown", "channels": ["thrust_n"]}]});
        let mut line = Line { own_named: [1, 0], ..Line::default() };
        judge(&m, &verdict, &mut line);
        assert_eq!((line.own_named, line.names, line.top_first), ([1, 1], [3, 2], [1, 0]));
        assert_eq!(line.named, "supply_sag@voltage_v*0.90+!channel_filter@current_a*0.00+stall@thrust_n*0.00");
        let entries = [("unknown".to_owned(), vec!["thrust_n".to_owned()], 0.9)];
        assert!(noticed(&verdict, &entries, "thrust_n") && !noticed(&verdict, &entries, "voltage_v"));
        let listed = serde_json::json!({"verdict": "attributed", "unexplained": [{"channel": "rpm_beam - others"}]});
        assert!(noticed(&listed, &[], "rpm_beam") && !noticed(&listed, &[], "current_a"));
    }
}
