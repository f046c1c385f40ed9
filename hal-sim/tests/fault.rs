//! Seeded faults at the pins, flown natively: every kind at every place, drawn rigs and throttles.

use hal_sim::fault::flight::{fly, fly_defenceless};
use hal_sim::fault::{Answer, Mishap, Phase, Plan, Rule, Wrong, fly_all};
use std::collections::BTreeMap;

/// Schedules: at least fourteen of each kind.
const RUNS: u64 = 2100;

#[test]
fn every_fault_is_answered_as_the_specification_says() {
    let tally = fly_all(0..RUNS, |_| ());
    print!("{}", tally.table());
    let failures: Vec<String> = tally.failures.iter().map(ToString::to_string).collect();
    let mut kinds: BTreeMap<String, u64> = BTreeMap::new();
    for (mishap, row) in Mishap::all().iter().zip(&tally.rows).filter(|(_, row)| row.wrong > 0) {
        kinds.insert(mishap.words(), row.wrong);
    }
    failures.iter().for_each(|failure| println!("{failure}"));
    assert!(failures.is_empty(), "{} of {RUNS}: {kinds:#?}", tally.wrong());
    assert_eq!(tally.flown(), RUNS);
    let least = RUNS / Mishap::all().len() as u64;
    assert!(least >= 14 && tally.rows.iter().all(|row| row.flown >= least));
}

/// The campaign can fail: with a board that does not answer a kind of mishap, or stops for nothing, every kind is found out, and not
/// because the mishap was never reached.
#[test]
fn a_board_that_does_not_answer_is_found_out_for_every_kind() {
    let mut missed = Vec::new();
    for (seed, mishap) in (0..).zip(Mishap::all()) {
        // the first of its plans under which something must be seen
        let mut plans = (0..40).map(|n| Plan::with(seed + 1000 * n, mishap));
        let shows = |plan: &Plan| {
            let stops = matches!(Rule::of(plan, 3000.0, 3000.0).answer, Answer::Stops(_) | Answer::Ends);
            !stops || plan.phase.is_live() || plan.phase == Phase::Start
        };
        let plan = plans.find(shows).unwrap_or_else(|| panic!("{mishap:?}: no plan"));
        if let Err(failure) = fly(plan) {
            missed.push(format!("with its protection it passes: {failure}"));
        }
        match fly_defenceless(plan) {
            Ok(survived) => missed.push(format!("nobody missed the protection: {survived:?} in {}", plan.words())),
            Err(failure) if matches!(failure.wrong, Wrong::NeverReached(..)) => missed.push(failure.to_string()),
            Err(failure) => println!("{}: {}", mishap.words(), failure.wrong),
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
}
