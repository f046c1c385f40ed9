//! The phones' trials, group by group, beside VQF.
//!
//! What it is: our default over the second set, with the gyro's bias taken off beforehand and with it left in; mean errors of each
//! group beside VQF's defaults as published with the data; and the targets: no group worse in total or inclination, total at most
//! 0.9 of VQF's over all.
//! What can go wrong: a target that is missed is named; a trial without VQF's figure is a failure.
//! Units: degrees.
//! Reference: README of the data (`ahrs-phones`), `peers.csv`, alignment A.

use super::phones::{Gyro, Phone, phones};
use super::score::{Score, run};
use crate::run::Failure;
use dcm::{Config, Dcm};
use std::path::Path;

/// Largest share of VQF's total error, over all trials.
const SHARE: f64 = 0.9;
/// VQF over the whole recording, forwards and backwards: nothing that runs while the body moves need reach it.
const OFFLINE: &str = "vqf_offline";

/// Whether a trial is in it.
type Member = fn(&Phone) -> bool;

/// The groups, all first.
const GROUPS: [(&str, Member); 7] = [
    ("all", |_| true),
    ("clean", |p| !p.magnets && !p.running),
    ("running", |p| p.running),
    ("magnets", |p| p.magnets),
    ("Nexus 5", |p| p.device == "Nexus5"),
    ("iPhone 4S", |p| p.device == "iPhone4S"),
    ("iPhone 5", |p| p.device == "iPhone5"),
];

/// Prints both tables; gives the targets that are missed.
pub(super) fn groups(folder: &Path, list: bool) -> Result<Vec<String>, Failure> {
    let peers = folder.join("peers.csv");
    let mut missed = Vec::new();
    for (gyro, name) in [(Gyro::Own, "own"), (Gyro::Raw, "raw")] {
        let trials = phones(&folder.join("data"), gyro)?;
        let ours: Vec<Score> = trials.iter().map(|p| run(&mut Dcm::new(Config::DEFAULT), &p.trial.samples, |_| {})).collect();
        let vqf = published(&peers, "vqf", name, &trials)?;
        println!("\nphones, gyro's bias {}", if gyro == Gyro::Own { "taken off beforehand" } else { "left in" });
        println!("{:<9} {:>3} {:>29} {:>29}", "group", "n", "ours: total heading incl.", "VQF: total heading incl.");
        for (group, member) in GROUPS {
            let mean = |scores: &[Score]| Score::mean(trials.iter().zip(scores).filter(|(p, _)| member(p)).map(|(_, s)| s));
            let (mine, theirs) = (mean(&ours), mean(&vqf));
            let n = trials.iter().filter(|p| member(p)).count();
            println!("{group:<9} {n:>3} {} {}", three(&mine), three(&theirs));
            if mine.total > theirs.total || mine.inclination > theirs.inclination {
                missed.push(format!("phones {name}, {group}: {mine:.3?}, VQF {theirs:.3?}"));
            }
            if group == "all" && mine.total > SHARE * theirs.total {
                missed.push(format!("phones {name}: total {:.3}, more than {SHARE} of VQF's {:.3}", mine.total, theirs.total));
            }
        }
        if gyro == Gyro::Own {
            let offline = published(&peers, OFFLINE, name, &trials)?;
            println!("bound: VQF offline over the whole recording {}", three(&Score::mean(offline.iter())));
        }
        if list {
            for ((p, mine), theirs) in trials.iter().zip(&ours).zip(&vqf) {
                println!("    {:<42} {} {}", p.trial.name, three(mine), three(theirs));
            }
        }
    }
    Ok(missed)
}

fn three(s: &Score) -> String {
    format!("{:>13.2} {:>7.2} {:>7.2}", s.total, s.heading, s.inclination)
}

/// Another filter's errors of each trial, from the data's table: held readings, alignment A.
fn published(file: &Path, filter: &str, gyro: &str, trials: &[Phone]) -> Result<Vec<Score>, Failure> {
    let text = std::fs::read_to_string(file).map_err(|e| Failure(format!("{}: {e}", file.display())))?;
    let find = |p: &Phone| {
        let name = &p.trial.name;
        let found = text.lines().find_map(|line| row(line, name, filter, gyro));
        found.ok_or_else(|| Failure(format!("{}: no row of {filter} with held input, gyro {gyro}, for {name}", file.display())))
    };
    trials.iter().map(find).collect()
}

/// The scores in a line, where it is the one that is asked for.
fn row(line: &str, trial: &str, filter: &str, gyro: &str) -> Option<Score> {
    let f: Vec<&str> = line.split(',').collect();
    let &[name, _, _, _, algorithm, input, g, total, heading, inclination, ..] = f.as_slice() else { return None };
    if (name, algorithm, input, g) != (trial, filter, "held", gyro) {
        return None;
    }
    Some(Score { total: total.parse().ok()?, heading: heading.parse().ok()?, inclination: inclination.parse().ok()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_found_by_trial_filter_and_gyro() {
        let line = "T_Nexus5_NoDist_AR,Nexus5,ar,0,vqf,held,own,8.085,7.958,1.431,6.968,6.843,1.314";
        assert_eq!(
            row(line, "T_Nexus5_NoDist_AR", "vqf", "own"),
            Some(Score { total: 8.085, heading: 7.958, inclination: 1.431 })
        );
        for (trial, filter, gyro) in
            [("T_Nexus5_NoDist_A", "vqf", "own"), ("T_Nexus5_NoDist_AR", "vqf_rate", "own"), ("T_Nexus5_NoDist_AR", "vqf", "raw")]
        {
            assert_eq!(row(line, trial, filter, gyro), None);
        }
    }
}
