//! `quadrig close-loop` on several runs of one rig: what the rig has is shared, what one run has is dated, and each run is predicted whole by
//! a fit to the others.
//!
//! What it is: simulated rigs with two hidden effects on other schedules, one of them with a slipped zero or at another supply voltage; the
//! recorded lever rig; the command's files and refusals.
//! What can go wrong: a rig that is simulated well is easier than a real one: the recorded runs are the judge.
//! Reference: specification `formats.md`, "Scope" and `across_runs_rms`; `closing-the-loop.md`, "Real measurements".

use ident::close::{close, validation};
use ident::log::Log;
use ident::model::Model;
use ident::several::{Outcome, Run, close_each, close_together};
use ident::verdict::EffectEntry;
use ident::verdict::Scope;
use quadrig_tests::{call, data, files};
use std::path::Path;
use tempfile::TempDir;

const LEAD_OHM: f64 = 0.05;
const LEAD: &str = "[[effect]]\nid = \"supply_sag\"\nresistance_ohm = 0.05\n";
const SLOW_CELL: &str = "[[effect]]\nid = \"channel_filter\"\ntau_s = 0.3\n";
const SLIPPED: &str = "[[effect]]\nid = \"tare_shift\"\noffset_n = 0.15\nt0_s = 40.0\n";
const ONE_SENSOR: &str = "[sensors]\nfitted = [\"opto\"]\n";

/// A run of the simulated rig, every one on another schedule.
fn flown(folder: &Path, number: u32, supply: &str, effects: &str) -> Log {
    let (step, top) = (80 + 20 * number, (1800 + 60 * number).min(2000));
    let schedule = format!("schedule = {{ kind = \"up_down\", step_us = {step}, hold_s = 4, top_us = {top} }}\n");
    let text = format!("seed = {}\n{schedule}{supply}{ONE_SENSOR}{effects}", 20 + number);
    let name = format!("r{number}");
    std::fs::write(folder.join(format!("{name}.toml")), text).unwrap();
    call(folder, &["--quiet", "sim", &format!("{name}.toml"), "-o", &format!("{name}.csv")]).succeeded();
    Log::read(&folder.join(format!("{name}.csv"))).unwrap()
}

fn together(logs: Vec<Log>) -> (Vec<Run>, Outcome) {
    let runs = close_each(logs, &|_| {}).unwrap();
    let outcome = close_together(&runs, &mut |_| {});
    (runs, outcome)
}

fn entry<'o>(outcome: &'o Outcome, id: &str) -> &'o EffectEntry {
    let effects = &outcome.verdict.effects;
    effects
        .iter()
        .find(|e| e.id == id)
        .unwrap_or_else(|| panic!("no {id} among {:?}", effects.iter().map(|e| &e.id).collect::<Vec<_>>()))
}

#[test]
fn what_the_rig_has_is_shared_and_what_one_run_has_is_dated() {
    let folder = TempDir::new().unwrap();
    let both = format!("{LEAD}{SLOW_CELL}");
    let logs: Vec<Log> =
        (1..=3).map(|n| flown(folder.path(), n, "", &if n == 2 { format!("{both}{SLIPPED}") } else { both.clone() })).collect();
    let (runs, outcome) = together(logs);

    for id in ["supply_sag", "channel_filter"] {
        let e = entry(&outcome, id);
        assert_eq!(e.scope, Scope::Rig, "{id}");
        assert!(e.probability > 0.9 && e.evidence.contains("3 of 3 runs"), "{id}: {}", e.evidence);
    }
    let ohm = &entry(&outcome, "supply_sag").parameters[0];
    assert!(ohm.ci95[0] < LEAD_OHM && LEAD_OHM < ohm.ci95[1] && ohm.ci95[1] - ohm.ci95[0] < 0.01, "{ohm:?}");
    let slip = entry(&outcome, "tare_shift");
    assert!(slip.scope == Scope::Event && slip.evidence.contains("r2.csv alone"), "{slip:?}");
    assert_eq!(slip.run.as_deref(), Some("r2.csv"));

    // nothing gets worse, and most goes
    let v = &outcome.verdict;
    assert_eq!(v.runs.len(), 3);
    for run in &v.runs {
        assert!(run.channels.values().all(|b| b.after < 1.05 * b.before), "{run:?}");
    }
    for (channel, factor) in [("thrust_n", 3.0), ("voltage_v", 5.0)] {
        let of = |b: &ident::verdict::BeforeAfter| (b.before / b.after).ln();
        let logs: Vec<f64> = v.runs.iter().filter_map(|r| r.channels.get(channel)).map(of).collect();
        let times = (logs.iter().sum::<f64>() / logs.len() as f64).exp();
        assert!(times > factor, "{channel}: {times} on an average run");
        // over all runs the root of the mean square
        let c = &v.channels[channel];
        let squares = v.runs.iter().map(|r| r.channels[channel].after.powi(2)).sum::<f64>();
        let across = c.after.across_runs_rms.unwrap();
        assert!((across / (squares / v.runs.len() as f64).sqrt() - 1.0).abs() < 1e-9, "{channel}: {across}");
    }

    // the file knows the event on its own run only: the run itself is predicted with it, a fresh run without
    let model = Model::parse("model.toml", &outcome.model.to_toml()).unwrap();
    assert_eq!(model.to_toml(), outcome.model.to_toml(), "the file reads back as it was");
    let fresh = flown(folder.path(), 4, "", &both);
    let error = |log: &Log| validation(log, &outcome.declared, &model).channels["thrust_n"];
    let on_its_run = error(&runs[1].log);
    assert!(on_its_run.after < 0.05, "{on_its_run:?}: a slip of 0.15 N would leave more");
    let elsewhere = error(&fresh);
    assert!(elsewhere.after < 0.05 && elsewhere.before > 3.0 * elsewhere.after, "{elsewhere:?}");
}

/// A lead that was exchanged between runs has a size of its own on each; nothing else is named in its place.
#[test]
fn what_differs_from_run_to_run_is_of_each_run() {
    let folder = TempDir::new().unwrap();
    let lead = |ohm: f64| format!("[[effect]]\nid = \"supply_sag\"\nresistance_ohm = {ohm}\n");
    let logs = [0.08, 0.08, 0.2].iter().zip(1..).map(|(ohm, n)| flown(folder.path(), n, "", &lead(*ohm))).collect();
    let (_, outcome) = together(logs);
    let effects = &outcome.verdict.effects;
    let leads: Vec<&EffectEntry> = effects.iter().filter(|e| e.id == "supply_sag").collect();
    let ohm = |e: &EffectEntry| e.parameters.iter().find(|p| p.name == "resistance").map_or(f64::NAN, |p| p.value);
    let ohms: Vec<(Option<&str>, f64)> = leads.iter().map(|e| (e.run.as_deref(), (100.0 * ohm(e)).round() / 100.0)).collect();
    assert_eq!(ohms, [(Some("r1.csv"), 0.08), (Some("r2.csv"), 0.08), (Some("r3.csv"), 0.2)], "{effects:?}");
    assert!(leads.iter().all(|e| e.scope == Scope::Run));
    assert!(!effects.iter().any(|e| e.id == "battery_discharge"), "{effects:?}");
}

/// Leads that differ by less than that stay one cause: how they differ is told in the unit of the value, what one for all of them leaves goes with
/// the load, and what a run alone says of its rotor is its own word.
#[test]
fn leads_that_differ_a_little_are_told_apart_beside_their_mean() {
    let folder = TempDir::new().unwrap();
    let lead = |ohm: f64| format!("[[effect]]\nid = \"supply_sag\"\nresistance_ohm = {ohm}\n");
    let logs =
        [0.05, 0.065, 0.08, 0.09, 0.105].iter().zip(1..).map(|(ohm, n)| flown(folder.path(), n, "", &lead(*ohm))).collect();
    let (_, outcome) = together(logs);
    let sag = entry(&outcome, "supply_sag");
    assert!(sag.run.is_none() && sag.evidence.contains("the runs disagree: alone they have"), "{}", sag.evidence);
    assert!(sag.evidence.contains(" mohm for the resistance"), "{}", sag.evidence);
    let left = outcome.verdict.unexplained.iter().find(|u| u.channel == "voltage_v").expect("one lead for all is not enough");
    assert!(left.depends_on.iter().any(|v| ["pulse_us", "rpm_opto", "current_a"].contains(&v.as_str())), "{left:?}");
    let of = |id: &str| outcome.model.effects.iter().position(|e| e.placed.effect.id() == id).expect("named");
    let lags = &outcome.alone[of("spinup_lag")];
    let friction = |run: &Vec<ident::effects::Estimate>| run.iter().find(|e| e.name == "friction").map(|e| e.value.to_bits());
    let own: std::collections::BTreeSet<Option<u64>> = lags.iter().map(friction).collect();
    assert!(own.len() == 5 && !own.contains(&None), "{lags:?}");
}

#[test]
fn runs_at_other_supply_voltages_are_one_rig() {
    let folder = TempDir::new().unwrap();
    let supply = |volts: f64| format!("supply = {{ kind = \"bench\", voltage_v = {volts} }}\n");
    let logs: Vec<Log> = (1..=3).map(|n| flown(folder.path(), n, &supply(10.0 + f64::from(n)), "")).collect();
    let (_, outcome) = together(logs);
    let exponent = |channel: &str| {
        let of = outcome.verdict.effects.iter().find(|e| e.id == "supply_voltage" && e.channels.iter().any(|c| c == channel));
        of.unwrap_or_else(|| panic!("{channel} does not follow the supply")).parameters[0].value
    };
    let speed = exponent("rpm_opto");
    assert!((0.6..1.05).contains(&speed), "V = k omega + R I: {speed}");
    let c = &outcome.verdict.channels["rpm_opto"];
    assert!(c.before.heldout_rms > 2.0 * c.after.heldout_rms, "{c:?}");
    // one run alone cannot tell
    let alone = close(&flown(folder.path(), 5, &supply(12.0), ""), None, &[], &mut |_| {}).unwrap();
    assert!(alone.verdict.effects.iter().all(|e| e.id != "supply_voltage"));
}

/// A torque that one run alone has is not predicted, and is said to be so; it moves no other figure to another channel.
#[test]
fn a_channel_of_one_run_is_said_to_be_of_one_run() {
    let folder = TempDir::new().unwrap();
    let logs: Vec<Log> = (1..=3).map(|n| flown(folder.path(), n, "", LEAD)).collect();
    let has_torque = |log: &Log| log.columns.iter().any(|c| c.name == "torque_nm");
    assert!(logs.iter().all(has_torque));
    let without = |mut log: Log| {
        log.columns.retain(|c| c.name != "torque_nm");
        log
    };
    let whole = together(logs.clone()).1.verdict;
    let mut logs = logs.into_iter();
    let (first, others) = (logs.next().unwrap(), logs.map(without));
    let v = together(std::iter::once(first).chain(others).collect()).1.verdict;
    assert_eq!(v.channels.not_predicted.get("torque_nm").map(String::as_str), Some("no second run measured it"));
    assert!(v.runs.iter().all(|r| !r.channels.contains_key("torque_nm")));
    for (run, as_whole) in v.runs.iter().zip(&whole.runs) {
        for (channel, b) in &run.channels {
            let same = as_whole.channels[channel];
            assert!((b.before / same.before - 1.0).abs() < 0.1, "{} {channel}: {b:?} {same:?}", run.run);
        }
    }
}

#[test]
fn the_command_writes_the_rig_and_each_run_and_refuses_what_is_no_set_of_runs() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    (1..=2).for_each(|n| drop(flown(at, n, "", LEAD)));
    call(at, &["--quiet", "close-loop", "r1.csv", "r2.csv", "-o", "out"]).succeeded();
    let verdict: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(at.join("out/verdict.json")).unwrap()).unwrap();
    assert_eq!(verdict["runs"].as_array().map(Vec::len), Some(2));
    assert!(verdict["channels"]["voltage_v"]["after"]["across_runs_rms"].is_f64());
    let page = std::fs::read_to_string(at.join("out/report.html")).unwrap();
    for card in page.split("<article class=\"card").skip(1) {
        let card = card.split("</article>").next().unwrap();
        assert!(card.contains("<svg"), "a card without its figure: {card}");
    }
    let left = page.split("id=\"what-is-left\"").nth(1).and_then(|p| p.split("<h2").next()).unwrap();
    let of_a_run = ["whole run, r1", "whole run, r2"].iter().any(|caption| left.contains(caption));
    assert!(left.contains("<svg") && of_a_run, "what is left has the figure of the run on which it is loudest: {left}");
    let beside = page.split("<summary>Constants and fits, run by run").nth(1).and_then(|p| p.split("</details>").next()).unwrap();
    assert!(beside.contains("k_T, N.s2") && beside.contains(">r2<") && beside.contains("\u{b1}"), "{beside}");
    let fit = beside.split("<figure id=\"runs-thrust").nth(1).and_then(|p| p.split("</figure>").next()).unwrap();
    assert!(fit.contains(">r1</text>") && fit.contains(">r2</text>"), "a line a run: {fit}");
    for said in ["The supply lead drops", "Each run, predicted by the others", "runs/r1/report.html", "runs/r2/report.html"] {
        assert!(page.contains(said), "the page does not say {said}");
    }
    assert!(at.join("out/runs/r2/verdict.json").is_file() && at.join("out/model.toml").is_file());

    let of_another = std::fs::read_to_string(at.join("r2.csv")).unwrap().replacen("motor = \"570KV\"", "motor = \"1000KV\"", 1);
    std::fs::write(at.join("other.csv"), of_another).unwrap();
    std::fs::write(at.join("imu.csv"), "t_s,gx,gy,gz,ax,ay,az\n0,0,0,0,0,0,9.8\n").unwrap();
    for (words, said) in [
        (&["close-loop", "r1.csv", "r1.csv"][..], "are the same log"),
        (&["close-loop", "r1.csv", "imu.csv"], "imu.csv: no log of a rig"),
        (&["close-loop", "r1.csv", "nothing.csv"], "nothing.csv"),
        (&["close-loop", "r1.csv", "other.csv"], "r1.csv and other.csv are of different rigs: motor \"570KV\" and \"1000KV\""),
        (&["close-loop", "r1.csv", "--validate", "other.csv"], "are of different rigs"),
        (&["close-loop", "other.csv", "--model", "out/model.toml"], "out/model.toml and other.csv are of different rigs"),
    ] {
        let refused = call(at, words);
        let _ = refused.refused(&[said]);
    }
}

/// A log without a command stands first: what a command makes of the speed is known from the others, and nothing is said of it on this one.
#[test]
fn a_speed_without_a_command_takes_no_part() {
    let folder = TempDir::new().unwrap();
    let mut logs: Vec<Log> = (1..=3).map(|n| flown(folder.path(), n, "", LEAD)).collect();
    logs[0].columns.retain(|c| c.name != "pulse_us");
    let (_, outcome) = together(logs.clone());
    let speed = &outcome.verdict.channels["rpm_opto"];
    assert!(speed.after.heldout_rms < 100.0, "{} rev/min of a run by the other", speed.after.heldout_rms);
    let own = validation(&logs[0], &outcome.declared, &outcome.model);
    assert!(!own.channels.contains_key("rpm_opto") && own.channels.contains_key("thrust_n"), "{:?}", own.channels.keys());

    let (_, outcome) = together(logs.drain(..2).collect());
    assert!(
        outcome.verdict.channels.not_predicted["rpm_opto"].ends_with("on 1 of 2 runs"),
        "{:?}",
        outcome.verdict.channels.not_predicted
    );
}

/// Three of these runs: a delay of the load cell joined for what a clock that runs apart explains better beside the others.
#[test]
fn no_name_of_several_runs_stands_below_its_rival() {
    let Some(data) = data("the recorded lever rig, three runs together") else { return };
    let logs = files(&data.join("rig/lever-rig-10x45/tidy"), |name| name.starts_with("robbe11.") && name.ends_with(".csv"));
    assert_eq!(logs.len(), 3);
    let logs = logs.iter().map(|f| ident::log::import::import(f, &[]).unwrap().0).collect();
    let (_, outcome) = together(logs);
    let v = &outcome.verdict;
    let changes: Vec<_> = v.alternatives.iter().filter_map(|a| a.change.as_ref()).collect();
    assert!(!changes.is_empty(), "nothing stands against any name");
    for change in changes {
        let standing = &v.effects[change.place];
        assert!(change.probability <= standing.probability, "{} {} / {change:?}", standing.id, standing.probability);
    }
}

/// Four runs of one rig at four supply voltages, that nobody here made: every error falls on a run that took no part, by three times on
/// average, and none grows.
#[test]
fn the_recorded_lever_rig_predicts_each_of_its_runs_from_the_others() {
    let Some(data) = data("the recorded lever rig, four runs together") else { return };
    let logs = files(&data.join("rig/lever-rig-10x45/tidy"), |name| name.ends_with(".csv"));
    let logs = logs.iter().map(|f| ident::log::import::import(f, &[]).unwrap().0).collect();
    let (_, outcome) = together(logs);
    let pairs: Vec<_> = outcome.verdict.runs.iter().flat_map(|r| r.channels.values()).collect();
    let factor = f64::exp(pairs.iter().map(|b| (b.before / b.after).ln()).sum::<f64>() / pairs.len() as f64);
    println!("{} predictions, {factor:.2} times smaller", pairs.len());
    assert!(pairs.len() == 16 && factor > 3.0, "{factor}");
    assert!(pairs.iter().all(|b| b.after < 1.05 * b.before));
    for id in ["channel_filter", "supply_sag", "spinup_lag"] {
        assert_eq!(entry(&outcome, id).scope, Scope::Rig);
    }
}
