//! The BROAD trials, as recorded and in their stress variants, beside VQF.
//!
//! What it is: our default over each variant; mean errors beside VQF's defaults as published with the data; and the targets: no figure of
//! a variant above VQF's, and those of the trials as recorded.
//! What can go wrong: a target that is missed is named; a trial without VQF's figure is a failure.
//! Units: degrees.
//! Reference: README of the data (`ahrs`).

use super::published::{OFFLINE, Published, VQF};
use super::score::Score;
use super::trial::Trial;
use super::variant::Variant;
use super::{margin, scores, worst};
use crate::run::Failure;
use dcm::{Classic, ClassicConfig, Config, Dcm};

/// Mean total error that the default must not exceed on the shared trials, degrees.
const TOTAL: f64 = 2.0;
/// Mean inclination error that it must not exceed, degrees.
const INCLINATION: f64 = 0.70;

/// Prints the tables; gives the targets that are missed. `listed` names variants whose trials are printed too.
pub(super) fn broad(trials: &[Trial], table: &Published, listed: &[&str]) -> Result<Vec<String>, Failure> {
    let names: Vec<&str> = trials.iter().map(|t| t.name.as_str()).collect();
    let (mut missed, mut margins, mut ahead) = (Vec::new(), vec![margin::head("BROAD")], Vec::new());
    println!("{:<9} {:>29} {:>29}", "variant", "ours: total heading incl.", "VQF: total heading incl.");
    for variant in Variant::ALL {
        let ours = scores(trials, variant, || Box::new(Dcm::new(Config::DEFAULT)));
        let mine = Score::mean(ours.iter());
        if table.has(variant.name()) {
            let vqf = table.scores(VQF, variant.name(), &names)?;
            let theirs = Score::mean(vqf.iter());
            println!("{:<9} {} {}", variant.name(), three(&mine), three(&theirs));
            if mine.total > theirs.total || mine.heading > theirs.heading || mine.inclination > theirs.inclination {
                missed.push(format!("{}: {mine:.3?}, VQF {theirs:.3?}", variant.name()));
            }
            margins.push(margin::row(variant.name(), &ours, &vqf));
            ahead.extend(table.ahead(variant.name(), &names, &mine).iter().map(|a| format!("{}: {a}", variant.name())));
        } else {
            println!("{:<9} {} {:>29}", variant.name(), three(&mine), "not published: --vqf");
        }
        if variant == Variant::Base || listed.contains(&variant.name()) {
            for (name, s) in names.iter().zip(&ours) {
                println!("    {name:<48} {:>6.2} {:>6.2} {:>6.2}", s.total, s.heading, s.inclination);
            }
        }
        if variant == Variant::Base {
            missed.extend(names.iter().zip(&ours).filter_map(|(n, s)| worst::grown("BROAD", worst::BROAD, n, s.total)));
            if mine.total > TOTAL || mine.inclination > INCLINATION {
                missed.push(format!("base: {:.3} and {:.3}, targets {TOTAL} and {INCLINATION}", mine.total, mine.inclination));
            }
        }
    }
    for (name, config) in [("classic, Razor gains", ClassicConfig::RAZOR), ("classic, tuned gains", ClassicConfig::TUNED)] {
        let s = scores(trials, Variant::Base, || Box::new(Classic::new(config)));
        println!("{name}: {}", three(&Score::mean(s.iter())));
    }
    let offline = table.scores(OFFLINE, Variant::Base.name(), &names)?;
    println!("bound: VQF offline over the whole recording {}", three(&Score::mean(offline.iter())));
    println!("{}", margins.join("\n"));
    super::print_ahead("BROAD", &ahead);
    Ok(missed)
}

fn three(s: &Score) -> String {
    format!("{:>13.2} {:>7.2} {:>7.3}", s.total, s.heading, s.inclination)
}
