//! `cargo xtask ahrs-bench`: the attitude filter on measured motion with optical truth.
//!
//! What it is: the filter's one default over every shared BROAD trial and stress variant and over the shared trials of the phones, beside
//! the classic filter and the published figures of VQF, and a check of the targets.
//! What can go wrong: a target that is missed is a failure; so is missing data.
//! Units: degrees.
//! Reference: specification `ahrs.md`; README of the data; `docs/ahrs.md`.

mod ablation;
mod calm;
mod constants;
mod groups;
pub(crate) mod phones;
mod plots;
mod scan;
pub(crate) mod score;
mod sets;
pub(crate) mod trial;
pub(crate) mod variant;

use crate::place::Place;
use crate::run::Failure;
use dcm::{Classic, ClassicConfig, Config, Dcm};
use score::{Score, run};
use sets::Sets;
use trial::Trial;
use variant::Variant;

/// Mean total error that the default must not exceed on the shared trials, degrees.
const TOTAL: f64 = 2.0;
/// Mean inclination error that it must not exceed, degrees.
const INCLINATION: f64 = 0.70;

/// Runs it all.
pub(crate) fn bench(place: &Place, words: &[&str]) -> Result<(), Failure> {
    let folder = place.data().join("ahrs");
    let trials = trial::trials(&folder.join("broad"))?;
    let second = place.data().join("ahrs-phones");
    if let ["--scan"] = words {
        return scan::scan(&Sets::read(&trials, &second)?);
    }
    if let ["--ablation"] = words {
        ablation::ablation(&Sets::read(&trials, &second)?);
        return Ok(());
    }
    if let ["--plots", target] = words {
        let walks = phones::phones(&second.join("data"), phones::Gyro::Own)?;
        return plots::plots(std::path::Path::new(target), &trials, &walks);
    }
    if let Some(word) = words.iter().find(|w| **w != "phones" && Variant::ALL.iter().all(|v| v.name() != **w)) {
        let names = Variant::ALL.map(Variant::name).join(", ");
        return Err(Failure(format!("{word}: no variant; whose trials are to be listed is one of {names}, phones")));
    }
    let peers = folder.join("peers-shared.csv");
    let mut missed = Vec::new();
    println!("{:<9} {:>29} {:>29}", "variant", "ours: total heading incl.", "VQF: total heading incl.");
    for variant in Variant::ALL {
        let ours: Vec<Score> = scores(&trials, variant, || Box::new(Dcm::new(Config::DEFAULT)));
        let vqf: Vec<Score> = trial::peer(&peers, variant.name(), "vqf", "default")?
            .iter()
            .map(|(_, [total, heading, inclination])| Score { total: *total, heading: *heading, inclination: *inclination })
            .collect();
        if variant != Variant::Worst && vqf.len() != trials.len() {
            let (found, name) = (vqf.len(), variant.name());
            return Err(Failure(format!(
                "{}: {found} rows of VQF's default on {name}, {} trials",
                peers.display(),
                trials.len()
            )));
        }
        let (mine, theirs) = (Score::mean(ours.iter()), Score::mean(vqf.iter()));
        let three = |s: &Score| format!("{:>13.2} {:>7.2} {:>7.3}", s.total, s.heading, s.inclination);
        let published = if vqf.is_empty() { "not published: --vqf".to_owned() } else { three(&theirs) };
        println!("{:<9} {} {published:>29}", variant.name(), three(&mine));
        if variant == Variant::Base || words.contains(&variant.name()) {
            for (t, s) in trials.iter().zip(&ours) {
                println!("    {:<48} {:>6.2} {:>6.2} {:>6.2}", t.name, s.total, s.heading, s.inclination);
            }
        }
        if variant == Variant::Base && (mine.total > TOTAL || mine.inclination > INCLINATION) {
            missed.push(format!("base: {:.3} and {:.3}, targets {TOTAL} and {INCLINATION}", mine.total, mine.inclination));
        }
        // no comparison holds where nothing is published
        let worse = mine.total > theirs.total || mine.heading > theirs.heading || mine.inclination > theirs.inclination;
        if worse {
            missed.push(format!("{}: {mine:.3?}, VQF {theirs:.3?}", variant.name()));
        }
    }
    for (name, config) in [("classic, Razor gains", ClassicConfig::RAZOR), ("classic, tuned gains", ClassicConfig::TUNED)] {
        let s = scores(&trials, Variant::Base, || Box::new(Classic::new(config)));
        let s = Score::mean(s.iter());
        println!("{name}: {:.2} {:.2} {:.2}", s.total, s.heading, s.inclination);
    }
    println!("\n{}", calm::line("BROAD", trials.iter().map(|t| (t, 0.0)), &mut missed));
    missed.extend(groups::groups(&second, words.contains(&"phones"))?);
    if missed.is_empty() { Ok(()) } else { Err(Failure(format!("targets missed: {}", missed.join("; ")))) }
}

/// What a thread gave; its panic goes on here, so that no trial is missing from a mean.
fn joined<T>(handle: std::thread::ScopedJoinHandle<'_, T>) -> T {
    handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

fn scores(trials: &[Trial], variant: Variant, new: impl Fn() -> Box<dyn score::Filter> + Sync) -> Vec<Score> {
    std::thread::scope(|scope| {
        let handles: Vec<_> = trials.iter().map(|t| scope.spawn(|| run(new().as_mut(), &variant.of(t), |_| {}))).collect();
        handles.into_iter().map(joined).collect()
    })
}
