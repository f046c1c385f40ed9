//! `cargo xtask ahrs-bench`: the attitude filter on measured motion with optical truth.
//!
//! What it is: the filter's one default over every shared BROAD trial and stress variant and over the shared trials of the phones, beside
//! the classic filter and the published figures of VQF, and a check of the targets.
//! What can go wrong: a target that is missed is a failure; so is missing data.
//! Units: degrees.
//! Reference: specification `ahrs.md`; README of the data; `docs/ahrs.md`.
#![forbid(unsafe_code)]

mod ablation;
mod broad;
mod calm;
mod constants;
mod groups;
mod margin;
mod phones;
mod plots;
mod published;
mod run;
mod scan;
mod score;
mod sets;
mod trial;
mod variant;
mod worst;

use published::Published;
use quadrig_tests::data;
use run::Failure;
use score::Score;
use sets::Sets;
use trial::Trial;
use variant::Variant;

fn main() -> std::process::ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match bench(&words.iter().map(String::as_str).collect::<Vec<_>>()) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("ahrs-bench: {failure}");
            std::process::ExitCode::FAILURE
        }
    }
}

/// Runs it all.
fn bench(words: &[&str]) -> Result<(), Failure> {
    let data = data("the attitude filter on recordings").ok_or_else(|| Failure("no recorded data (QUADRIG_DATA)".to_owned()))?;
    let folder = data.join("ahrs");
    let trials = trial::trials(&folder.join("broad"))?;
    let second = data.join("ahrs-phones");
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
    let table = Published::broad(&folder.join("peers-shared.csv"))?;
    let mut missed = broad::broad(&trials, &table, words)?;
    println!("\n{}", calm::line("BROAD", &trials.iter().collect::<Vec<_>>(), false, &mut missed));
    missed.extend(groups::groups(&second, words.contains(&"phones"))?);
    if missed.is_empty() { Ok(()) } else { Err(Failure(format!("targets missed: {}", missed.join("; ")))) }
}

/// Says which other filters are ahead of ours, group by group.
fn print_ahead(set: &str, ahead: &[String]) {
    println!(
        "\n{set}: online filters that are ahead of ours, whatever their tuning{}",
        if ahead.is_empty() { ": none" } else { "" }
    );
    for line in ahead {
        println!("    {line}");
    }
}

/// What a thread gave; its panic goes on here, so that no trial is missing from a mean.
fn joined<T>(handle: std::thread::ScopedJoinHandle<'_, T>) -> T {
    handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

fn scores(trials: &[Trial], variant: Variant, new: impl Fn() -> Box<dyn score::Filter> + Sync) -> Vec<Score> {
    std::thread::scope(|scope| {
        let handles: Vec<_> = trials.iter().map(|t| scope.spawn(|| score::run(new().as_mut(), &variant.of(t), |_| {}))).collect();
        handles.into_iter().map(joined).collect()
    })
}
