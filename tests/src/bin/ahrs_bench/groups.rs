//! The phones' trials, group by group, beside VQF.
//!
//! What it is: our default over the second set, with the gyro's bias taken off beforehand and with it left in; mean errors of each
//! group beside VQF's defaults as published with the data; and the targets: no group worse in total or inclination, with any one trial
//! left out too; total at most 0.9 of VQF's over all.
//! What can go wrong: a target that is missed is named; a trial without VQF's figure is a failure.
//! Units: degrees.
//! Reference: README of the data (`ahrs-phones`), `peers.csv`, alignment A.

use super::phones::{Gyro, Phone, phones};
use super::published::{OFFLINE, Published, VQF};
use super::score::{Score, run};
use super::trial::Trial;
use super::{calm, margin, worst};
use crate::run::Failure;
use dcm::{Config, Dcm};
use std::path::Path;

/// Largest share of VQF's total error, over all trials.
const SHARE: f64 = 0.9;
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
    let table = Published::phones(&folder.join("peers.csv"))?;
    let mut missed = Vec::new();
    for (gyro, name) in [(Gyro::Own, "own"), (Gyro::Raw, "raw")] {
        let trials = phones(&folder.join("data"), gyro)?;
        let names: Vec<&str> = trials.iter().map(|p| p.trial.name.as_str()).collect();
        let ours: Vec<Score> = trials.iter().map(|p| run(&mut Dcm::new(Config::DEFAULT), &p.trial.samples, |_| {})).collect();
        let vqf = table.scores(VQF, name, &names)?;
        println!("\nphones, gyro's bias {}", if gyro == Gyro::Own { "taken off beforehand" } else { "left in" });
        println!("{:<9} {:>3} {:>29} {:>29}", "group", "n", "ours: total heading incl.", "VQF: total heading incl.");
        let (mut margins, mut ahead) = (vec![margin::head(&format!("phones {name}"))], Vec::new());
        for (group, member) in GROUPS {
            let of = |scores: &[Score]| trials.iter().zip(scores).filter(|(p, _)| member(p)).map(|(_, s)| *s).collect::<Vec<_>>();
            let (each, others) = (of(&ours), of(&vqf));
            let (mine, theirs) = (Score::mean(each.iter()), Score::mean(others.iter()));
            let members: Vec<&str> = trials.iter().filter(|p| member(p)).map(|p| p.trial.name.as_str()).collect();
            println!("{group:<9} {:>3} {} {}", members.len(), three(&mine), three(&theirs));
            if mine.total > theirs.total || mine.inclination > theirs.inclination {
                missed.push(format!("phones {name}, {group}: {mine:.3?}, VQF {theirs:.3?}"));
            }
            if group == "all" && mine.total > SHARE * theirs.total {
                missed.push(format!("phones {name}: total {:.3}, more than {SHARE} of VQF's {:.3}", mine.total, theirs.total));
            }
            margins.push(margin::row(group, &each, &others));
            missed.extend(margin::hanging(&format!("phones {name}, {group}"), &members, &each, &others));
            ahead.extend(table.ahead(name, &members, &mine).iter().map(|a| format!("{group}: {a}")));
        }
        let known = if gyro == Gyro::Own { worst::OWN } else { worst::RAW };
        let walks: Vec<&Trial> = trials.iter().map(|p| &p.trial).collect();
        println!("{}", calm::line(&format!("phones {name}"), &walks, gyro == Gyro::Raw, &mut missed));
        missed.extend(names.iter().zip(&ours).filter_map(|(n, s)| worst::grown(&format!("phones {name}"), known, n, s.total)));
        if gyro == Gyro::Own {
            let offline = table.scores(OFFLINE, name, &names)?;
            println!("bound: VQF offline over the whole recording {}", three(&Score::mean(offline.iter())));
        }
        println!("{}", margins.join("\n"));
        super::print_ahead(&format!("phones {name}"), &ahead);
        if list {
            for ((trial, mine), theirs) in names.iter().zip(&ours).zip(&vqf) {
                println!("    {trial:<42} {} {}", three(mine), three(theirs));
            }
        }
    }
    Ok(missed)
}

fn three(s: &Score) -> String {
    format!("{:>13.2} {:>7.2} {:>7.2}", s.total, s.heading, s.inclination)
}
