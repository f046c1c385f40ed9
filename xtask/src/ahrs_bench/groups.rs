//! The phones' trials, group by group, beside VQF.
//!
//! What it is: our default over the second set, with the gyro's bias taken off beforehand and with it left in; mean errors of each
//! group beside VQF's defaults as published with the data; and the targets: no group worse in total or inclination, total at most
//! 0.9 of VQF's over all.
//! What can go wrong: a target that is missed is named; a trial without VQF's figure is a failure.
//! Units: degrees.
//! Reference: README of the data (`ahrs-phones`), `peers.csv`, alignment A.

use super::calm;
use super::phones::{Gyro, Phone, phones};
use super::score::{Score, run};
use crate::run::Failure;
use dcm::{Config, Dcm};
use std::path::Path;

/// Largest share of VQF's total error, over all trials.
const SHARE: f64 = 0.9;
/// The five worst trials and their total errors, which may not grow by more than a tenth.
const WORST: [(&str, f64); 5] = [
    ("Thibaud_Nexus5_Dist_AR", 22.8),
    ("Thibaud_Nexus5_Dist_Texting", 14.2),
    ("Thibaud_iPhone5_Dist_BackPocket", 13.4),
    ("Thibaud_Nexus5_Dist_BackPocket", 11.9),
    ("Thibaud_iPhone5_Dist_AR", 11.7),
];
/// Time after which a bias that was left in is known well enough for the heading not to drift, s.
const LEARNT: f64 = 30.0;
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
        let from = if gyro == Gyro::Own { 0.0 } else { LEARNT };
        println!("{}", calm::line(&format!("phones {name}"), trials.iter().map(|p| (&p.trial, from)), &mut missed));
        if gyro == Gyro::Own {
            missed.extend(trials.iter().zip(&ours).filter_map(|(p, s)| grown(&p.trial.name, s.total)));
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

/// Says so where a trial's total error is beyond that of the worst, or of its own as one of them.
fn grown(name: &str, total: f64) -> Option<String> {
    let own = WORST.iter().find(|(worst, _)| *worst == name).or(WORST.last()).map_or(0.0, |w| w.1);
    (total > 1.1 * own).then(|| format!("phones own, {name}: total {total:.1}, a tenth more than {own}"))
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
    fn no_trial_may_become_one_of_the_worst() {
        assert!(grown("Thibaud_Nexus5_Dist_AR", 24.0).is_none() && grown("Thibaud_Nexus5_Dist_AR", 26.0).is_some());
        assert!(grown("another", 12.0).is_none() && grown("another", 13.0).is_some());
    }

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
