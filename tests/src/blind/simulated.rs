//! Scenarios from the simulator's truth side: the real firmware, first-principles effects, edges of real sensors.
//!
//! What it is: seed -> a rig of the catalogue, a schedule, an effect of the simulator (or none, or one that the library does not
//! know). The simulated rig has dynamics of its own (its rotor, its meters), which the static baseline lacks: the loop is closed on a
//! healthy run of the same rig first, and its model is what the run that hides the effect is held against (`close-loop --model`). Both
//! go through `quadrig sim`; only their logs reach the tool.
//! What can go wrong: a run that the firmware stops (a protection, a fault) is recorded as `stopped`.
//! Units: sizes in noise floors: what the effect changes of a run that is the same in all else, row for row, a cubic of the pulse
//! taken out (the declared curves absorb that), on the channel where most is left.
//! Reference: specification `closing-the-loop.md`, "Blind trials".

use super::chance::Chance;
use super::fit::left_over;
use super::scenario::CLEAN;
use super::score::Line;
use crate::quadrig;
use hal_sim::Scenario;
use hal_sim::effect::{self, UNKNOWN};
use hal_sim::scenario::{Schedule, Step};
use ident::log::Log;
use ident::model::Model;
use ident::verdict::{EffectEntry, Kind, Verdict};
use std::path::Path;
use std::process::{Command, Stdio};

/// Rigs: motor, propeller, supply that the pair stays within.
const RIGS: [(&str, &str); 4] = [("570KV", "11x4.7"), ("690KV", "10x4.5"), ("490KV", "11x4.5"), ("390KV", "12x4.5")];

/// What a seed hides: an effect of the simulator's catalogue, or nothing.
#[must_use]
pub fn hidden(seed: u64) -> Option<&'static str> {
    let catalogue = effect::catalogue();
    (seed < CLEAN).then(|| catalogue[(seed / 2) as usize % catalogue.len()].id)
}

/// The rig and its schedule, healthy.
fn healthy(seed: u64) -> Scenario {
    let mut k = Chance::new(seed, 700);
    let (motor, propeller) = k.of(&RIGS);
    let (low, high) = (1100.0, k.of(&[1850.0, 2000.0]));
    let schedule = match k.of(&[0u8, 1, 2]) {
        0 => Schedule::UpDown { step_us: k.of(&[50.0, 100.0]), hold_s: k.between(3.0, 6.0), top_us: high },
        1 => Schedule::Staircase { step_us: 50.0, hold_s: k.between(5.0, 10.0), top_us: high },
        _ => {
            let mut steps =
                vec![Step { pulse_us: low, hold_s: 5.0, ramp: false }, Step { pulse_us: high, hold_s: 5.0, ramp: false }];
            for _ in 0..k.of(&[25, 35, 45]) {
                let pulse_us = k.between(low, high).round();
                steps.push(Step { pulse_us, hold_s: k.log_between(2.0, 9.0), ramp: k.happens(0.15) });
            }
            Schedule::Steps { steps }
        }
    };
    let mut rig = Scenario { seed, motor: motor.into(), propeller: propeller.into(), schedule, ..Scenario::default() };
    rig.log.rate_hz = k.of(&[10, 20, 20, 50]);
    rig
}

/// Flies a scenario through the command line.
fn fly(rig: &Scenario, folder: &Path, name: &str) -> Result<Log, String> {
    let (scenario, log) = (folder.join(format!("{name}.toml")), folder.join(format!("{name}.csv")));
    std::fs::write(&scenario, toml::to_string(rig).map_err(|e| e.to_string())?).map_err(|e| e.to_string())?;
    let out = Command::new(quadrig())
        .args(["--quiet", "sim"])
        .arg(&scenario)
        .arg("-o")
        .arg(&log)
        .stdin(Stdio::null())
        .output()
        .map_err(|e| e.to_string())?;
    if !out.status.success() {
        return Err(String::from_utf8_lossy(&out.stderr).trim().replace([',', '\n'], ";"));
    }
    let bytes = std::fs::read(&log).map_err(|e| e.to_string())?;
    Log::parse(name, &bytes[..]).map_err(|e| e.to_string())
}

/// What a seed flies: the rig on an earlier day, the run in question, and that run without the effect.
fn flights(seed: u64) -> [(Scenario, &'static str); 3] {
    let first = healthy(seed);
    let twin = Scenario { seed: seed.wrapping_add(7_919), ..first.clone() };
    let mut second = twin.clone();
    if let Some(entry) = hidden(seed).and_then(effect::find) {
        second.effects.push(entry.draw(seed, second.run_s()).into());
    }
    [(first, "healthy"), (second, "run"), (twin, "twin")]
}

/// Writes scenarios and logs of a seed into a folder.
///
/// # Errors
/// What the simulator refused.
pub fn dump(seed: u64, folder: &Path) -> Result<(), String> {
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    flights(seed).iter().try_for_each(|(rig, name)| fly(rig, folder, name).map(|_| ()))
}

/// Runs the tool on a seed.
///
/// # Panics
/// When the system gives no temporary folder.
#[must_use]
pub fn score(seed: u64) -> Line {
    let id = hidden(seed);
    let flights = flights(seed);
    let first = &flights[0].0;
    let kind = match id {
        None => "clean",
        Some(id) if UNKNOWN.contains(&id) => "unknown",
        Some(_) => "one",
    };
    let shape = match first.schedule {
        Schedule::Staircase { .. } => "stairs",
        Schedule::UpDown { .. } => "up-down",
        Schedule::Steps { .. } => "random",
        Schedule::Chirp(_) | Schedule::Replay(_) | Schedule::File { .. } => "other",
    };
    let mut line = Line {
        seed,
        kind: kind.to_owned(),
        truth: id.unwrap_or_default().to_owned(),
        schedule: shape.to_owned(),
        hz: f64::from(first.log.rate_hz),
        ..Line::empty()
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let logs = flights.each_ref().map(|(rig, name)| fly(rig, folder.path(), name));
    let [before, log, twin] = match logs {
        [Ok(a), Ok(b), Ok(c)] => [a, b, c],
        [Err(why), ..] | [_, Err(why), _] | [.., Err(why)] => {
            line.verdict = "stopped".into();
            line.named = why;
            return line;
        }
    };
    line.rows = log.t.len();
    let started = std::time::Instant::now();
    let closed = |log: &Log, model: Option<&Model>| ident::close::close(log, model, &[], &mut |_| {}).map_err(|e| e.to_string());
    let outcome = std::panic::catch_unwind(|| -> Result<(Verdict, Verdict), String> {
        let own = closed(&before, None)?;
        // what is written down and read back, as the command line does it
        let model = Model::parse("model.toml", &own.model.to_toml()).map_err(|e| e.to_string())?;
        Ok((own.verdict, closed(&log, Some(&model))?.verdict))
    });
    line.seconds = 0.5 * started.elapsed().as_secs_f64();
    match outcome {
        Ok(Ok((own, v))) => {
            if id.is_some() {
                (line.size, line.shown) = size(&log, &twin, &own);
                line.sizes = format!("{:.2}", line.size);
            }
            judge(id, kind, &own, &v, &mut line);
        }
        Ok(Err(why)) => {
            line.verdict = "refused".into();
            line.named = why.replace([',', '\n'], ";");
        }
        Err(_) => line.verdict = "panic".into(),
    }
    line
}

/// Above this pulse every rig of the campaign turns, us: while it stops, a moment's difference is a large one.
const DRIVEN_US: f64 = 1090.0;

/// Largest size of what a run has beyond its twin, and the channel that shows it.
fn size(log: &Log, twin: &Log, healthy: &Verdict) -> (f64, String) {
    let of = |name: &'static str| -> Option<(f64, String)> {
        let (with, without) = (log.column(name)?, twin.column(name)?);
        let pulse = log.column("pulse_us")?;
        let driven = |i: &usize| pulse[*i] > DRIVEN_US && (with[*i] - without[*i]).is_finite();
        let rows: Vec<usize> = (0..with.len().min(without.len())).filter(driven).collect();
        let (pulse, changed): (Vec<f64>, Vec<f64>) = rows.iter().map(|i| (pulse[*i] - 1000.0, with[*i] - without[*i])).unzip();
        let floor = healthy.channels.get(name)?.noise_floor_rms;
        Some((left_over(&pulse, &changed, 3) / floor, name.to_owned()))
    };
    log.measured().filter_map(of).filter(|s| s.0.is_finite()).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
}

/// The load cell is tared anew before every run: a zero that is another one than on the healthy day is true, and not what is hidden.
fn is_own_tare(entry: &EffectEntry) -> bool {
    entry.id == "tare_shift" && entry.equation.contains("since before the run")
}

fn judge(id: Option<&str>, kind: &str, own: &Verdict, v: &Verdict, line: &mut Line) {
    let standing: Vec<&str> = own.effects.iter().map(|e| e.id.as_str()).collect();
    let own_tare = v.effects.iter().any(is_own_tare);
    let named: Vec<String> = v.effects.iter().filter(|e| !is_own_tare(e) && e.id != "unknown").map(|e| e.id.clone()).collect();
    let without_tare =
        |ids: &[String]| -> Vec<String> { ids.iter().filter(|i| !own_tare || *i != "tare_shift").cloned().collect() };
    let others: Vec<Vec<String>> = v.alternatives.iter().map(|a| without_tare(&a.ids)).take(2).collect();
    line.verdict = format!("{:?}", v.verdict).to_lowercase();
    line.named = named.join("+");
    line.probability = v.effects.first().map_or(f64::NAN, |e| e.probability);
    line.alternatives = format!("healthy:{}", standing.join("+"));
    let hit = |ids: &[String]| id.is_some_and(|id| ids.iter().any(|i| i == id));
    let silent = v.effects.iter().all(is_own_tare);
    (line.first, line.top3, line.exact) = match kind {
        "one" => {
            let first = named.first().is_some_and(|n| Some(n.as_str()) == id);
            (first, hit(&named) || others.iter().any(|o| hit(o)), first && named.len() == 1)
        }
        "unknown" => {
            let recognised = v.verdict == Kind::Unattributed;
            (recognised, recognised, false)
        }
        _ => (silent, silent, silent),
    };
}
