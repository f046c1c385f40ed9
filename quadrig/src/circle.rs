//! `quadrig loop`: the whole circle in simulation.
//!
//! What it is: fly a scenario, close the loop on its log, with `--auto` fly the experiments that the tool asks for until the
//! verdict is stable, then put the corrected model in the plant's place and judge what the same schedule leaves.
//! What can go wrong: a scenario that is refused, a firmware that stops a run; a question that the allowed runs do not settle is
//! reported as open.
//! Units: as the log states.
//! Reference: specification `closing-the-loop.md`, step 9.

use crate::Failure;
use crate::apart::Paths;
use crate::close_loop::{model_files, results};
use crate::folder::Folder;
use crate::kind::{SCENARIO, instead};
use crate::progress::Bar;
use crate::sim::{fly, fly_model};
use hal_sim::Scenario;
use hal_sim::scenario::{Schedule, Step};
use ident::close::circle::{Circle, circle};
use ident::close::close;
use ident::log::Log;
use ident::report::{Origin, Vocabulary, terminal};
use ident::several::runs::{Run, Standing, model, next, rival, standings};
use ident::verdict::{Kind, NextExperiment};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The scenario file.
    scenario: PathBuf,
    /// Flies the tool's own next experiments until the verdict is stable.
    #[arg(long)]
    auto: bool,
    /// Most runs beyond the first.
    #[arg(long, default_value_t = 4, value_parser = crate::number::whole::<usize>(0, 1000, "runs"))]
    extra_runs: usize,
    /// Leaves out the last step, the flight of the corrected model.
    #[arg(long)]
    no_circle: bool,
    /// Folder for the runs, their reports, the corrected model and loop.json.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// The account of the loop on stdout and nothing else.
    #[arg(long)]
    json: bool,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().reads([&self.scenario]).fills("-o", &self.output)
    }
}

/// How the hypotheses stood after each run.
struct Round {
    /// Schedule and why it was flown.
    why: String,
    verdict: Kind,
    standings: Vec<(Vec<String>, f64)>,
    open: bool,
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let scenario = Scenario::load(&args.scenario).map_err(|why| instead(&args.scenario, SCENARIO, why))?;
    args.paths().reads_too(scenario.schedule.files(&args.scenario)).check()?;
    let folder = args.output.as_deref().map(|path| Folder::new(path, "loop")).transpose()?;
    let silent = quiet || args.json;
    let say = |line: String| {
        if !silent {
            say!("{line}");
        }
    };
    let (mut runs, mut rounds): (Vec<Run>, Vec<Round>) = (Vec::new(), Vec::new());
    let mut wanted: Option<NextExperiment> = None;
    let standing = loop {
        let number = runs.len() + 1;
        let flown = scenario_of(&scenario, number, wanted.as_ref());
        let why = wanted.as_ref().map_or_else(|| "the scenario's own schedule".to_owned(), |w| w.why.clone());
        say(format!("run {number}: {why}"));
        let log = fly(&flown, None, &format!("run-{number}.csv"), "flying", quiet)?;
        let closed = {
            let bar = Bar::new("searching", quiet);
            close(&log, None, &[], &mut |share| bar.set(share))?
        };
        say(format!("\n{}", terminal(&closed.verdict, Vocabulary::RIG, false)));
        runs.push(Run { log, closed });
        let standing = standings(&runs);
        let open = question(&runs, &standing);
        rounds.push(Round {
            why,
            verdict: runs[number - 1].closed.verdict.verdict,
            standings: standing.iter().map(|s| (s.ids.clone(), s.probability)).collect(),
            open: open.is_some(),
        });
        say(account(&standing, runs.len()));
        let may_fly = args.auto && number <= args.extra_runs;
        let proposed = open.filter(|_| may_fly).and_then(|against| next(&runs, &standing[0], against));
        wanted = proposed.filter(|next| next.separates);
        if wanted.is_none() {
            break standing;
        }
    };
    let closes = if args.no_circle { None } else { Some(close_circle(&scenario, &runs, &standing, quiet)?) };
    let report = json!({
        "format": "quadrig-loop 1",
        "scenario": args.scenario.file_name().map(|n| n.to_string_lossy()),
        "verdict": last_word(&runs, &standing),
        "effects": named(&runs, &standing),
        "extra_runs": runs.len() - 1,
        "rounds": rounds.iter().map(round_json).collect::<Vec<_>>(),
        "circle": closes.as_ref().map(circle_json),
        "hidden": scenario.effects.iter().map(|e| e.id()).collect::<Vec<_>>(),
    });
    if let Some(mut folder) = folder {
        for (k, run) in runs.iter().enumerate() {
            let own = format!("run-{}", k + 1);
            let files = results(&run.log, &run.closed, Origin::of(&run.log))?;
            folder.extend(files.into_iter().map(|(name, bytes)| (format!("{own}/{name}"), bytes)));
            let mut text = Vec::new();
            run.log.write_to(&mut text)?;
            folder.add(format!("{own}/run.csv"), text);
        }
        folder.extend(model_files(&corrected(&runs, &standing)));
        folder.add("loop.json", serde_json::to_string_pretty(&report)? + "\n");
        folder.write()?;
    }
    if args.json {
        say!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        closes.iter().for_each(|c| say(circle_table(c)));
        say(conclusion(&runs, &standing, &scenario));
    }
    Ok(())
}

/// The scenario of a run: the same rig with fresh noise, on the schedule that was asked for.
fn scenario_of(scenario: &Scenario, number: usize, wanted: Option<&NextExperiment>) -> Scenario {
    let Some(wanted) = wanted else { return scenario.clone() };
    let steps = wanted.schedule.iter().map(|s| Step { pulse_us: s.pulse_us, hold_s: s.hold_s, ramp: false }).collect();
    Scenario {
        seed: scenario.seed.wrapping_add(1_000_000 * number as u64),
        schedule: Schedule::Steps { steps },
        ..scenario.clone()
    }
}

/// What still stands against the leader: on one run the run's own verdict says whether anything does.
fn question<'s>(runs: &[Run], standing: &'s [Standing]) -> Option<&'s Standing> {
    match runs {
        [only] => (only.closed.verdict.verdict == Kind::Ambiguous).then(|| standing.get(1)).flatten(),
        _ => rival(standing),
    }
}

fn last_word(runs: &[Run], standing: &[Standing]) -> Kind {
    match (standing.first(), runs) {
        (None, [first, ..]) => first.closed.verdict.verdict,
        (_, [only]) => only.closed.verdict.verdict,
        _ if rival(standing).is_some() => Kind::Ambiguous,
        _ => Kind::Attributed,
    }
}

/// What the loop ends with: the leader's names, and what the board told on the first run, which no comparison of runs holds.
fn named(runs: &[Run], standing: &[Standing]) -> Vec<String> {
    let told = runs[0].closed.model.told_by_the_board().map(|e| e.placed.effect.id().to_owned());
    standing.first().into_iter().flat_map(|leader| leader.ids.iter().cloned()).chain(told).collect()
}

/// The model that the loop ends with: the leader as it was fitted to the first run, and what the board told on it.
fn corrected(runs: &[Run], standing: &[Standing]) -> ident::model::Model {
    let first = &runs[0].closed.model;
    let Some(leader) = standing.first().filter(|_| runs.len() > 1) else { return first.clone() };
    let mut model = model(runs, leader, 0);
    model.effects.extend(first.told_by_the_board().cloned());
    model
}

fn close_circle(scenario: &Scenario, runs: &[Run], standing: &[Standing], quiet: bool) -> Result<Circle, Failure> {
    let model = corrected(runs, standing);
    let again: Log = fly_model(scenario, &model, &runs[0].log, "again.csv", quiet)?;
    Ok(circle(&again, &model))
}

fn round_json(round: &Round) -> Value {
    let standings: Vec<Value> = round.standings.iter().map(|(ids, p)| json!({"ids": ids, "probability": p})).collect();
    json!({"why": round.why, "verdict": round.verdict, "open": round.open, "standings": standings})
}

fn circle_json(circle: &Circle) -> Value {
    let channels: serde_json::Map<String, Value> = circle
        .channels
        .iter()
        .map(|c| {
            let figures = json!({"unit": c.unit, "samples": c.samples, "rms": c.rms, "noise_floor_rms": c.noise_floor, "whiteness_p": c.whiteness_p});
            (c.channel.clone(), figures)
        })
        .collect();
    json!({"closes": circle.closes(), "left": circle.left(), "channels": channels})
}

fn account(standing: &[Standing], runs: usize) -> String {
    if runs < 2 || standing.is_empty() {
        return String::new();
    }
    let mut out = format!("{runs} runs together, each hypothesis judged by how its fit to one run predicts the others:\n");
    for s in standing.iter().take(4) {
        out += &format!("  {:>6.3}  {}\n", s.probability, s.ids.join(" + "));
    }
    out
}

fn circle_table(circle: &Circle) -> String {
    let mut out =
        String::from("the corrected model as the plant, same schedule, rows at which a static relation makes a claim:\n");
    out += &format!("{:<12} {:>11} {:>11} {:>11}  unit\n", "residual", "rms", "noise floor", "whiteness p");
    for c in &circle.channels {
        out += &format!("{:<12} {:>11.5} {:>11.5} {:>11.4}  {}\n", c.channel, c.rms, c.noise_floor, c.whiteness_p, c.unit);
    }
    if circle.closes() {
        out += "the circle closes: the search finds nothing beyond the model\n";
    } else {
        out += &format!("the circle does not close: the search still finds {}\n", circle.left().join(" + "));
    }
    out
}

fn conclusion(runs: &[Run], standing: &[Standing], scenario: &Scenario) -> String {
    let ids = named(runs, standing).join(" + ");
    let word = match last_word(runs, standing) {
        Kind::Attributed => format!("the model lacks {ids}"),
        Kind::Ambiguous => format!("still open: {ids}, or what looks the same on these runs"),
        Kind::Unattributed => "something is left over that no known effect explains".to_owned(),
        Kind::None => "nothing significant is left over".to_owned(),
    };
    let hidden: Vec<&str> = scenario.effects.iter().map(|e| e.id()).collect();
    let hidden = if hidden.is_empty() { "nothing".to_owned() } else { hidden.join(" + ") };
    format!("after {} extra runs: {word}\nhidden was {hidden}", runs.len() - 1)
}
