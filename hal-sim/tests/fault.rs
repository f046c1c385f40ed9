//! A thousand seeded faults at the pins, flown natively.

use hal_sim::fault::campaign::{Failure, Survived, fly, fly_defenceless};
use hal_sim::fault::{Mishap, Plan, REACTION_MS};
use std::collections::BTreeMap;

const RUNS: u64 = 1012; // 44 of each of the 23 kinds

#[test]
fn every_fault_ends_in_minimum_throttle_latched_and_named() {
    let workers = std::thread::available_parallelism().map_or(1, |n| n.get() as u64);
    let results: Vec<_> = std::thread::scope(|scope| {
        let handles: Vec<_> = (0..workers)
            .map(|worker| {
                scope.spawn(move || (worker..RUNS).step_by(workers as usize).map(|seed| fly(Plan::of(seed))).collect::<Vec<_>>())
            })
            .collect();
        handles.into_iter().flat_map(|h| h.join().expect("no run panics")).collect()
    });
    let failures: Vec<String> = results.iter().filter_map(|r| r.as_ref().err().map(ToString::to_string)).collect();
    assert!(failures.is_empty(), "{} of {RUNS}: {:#?}", failures.len(), &failures[..failures.len().min(5)]);
    let mut kinds: BTreeMap<String, Vec<&Survived>> = BTreeMap::new();
    for run in results.iter().flatten() {
        let kind = match run.plan.mishap {
            Mishap::LateTick { .. } => "control tick late".to_owned(),
            other => other.words(),
        };
        kinds.entry(kind).or_default().push(run);
    }
    assert_eq!(kinds.len(), Mishap::all().len());
    for (kind, runs) in kinds {
        let worst = runs.iter().map(|r| r.last_live_ms).fold(0.0, f64::max);
        println!("{:>4} x {kind}: last live pulse at most {worst:.0} ms after the fault", runs.len());
        assert_eq!(runs.len() as u64, RUNS / Mishap::all().len() as u64);
    }
    println!("{RUNS} schedules, reaction within {REACTION_MS} ms of detection in every one");
}

/// The campaign can fail: without the one protection that answers it, every kind of mishap is found out, and not because the
/// rig never ran.
#[test]
fn without_its_protection_no_kind_of_fault_passes() {
    for seed in 0..Mishap::all().len() as u64 {
        let plan = Plan::of(seed);
        fly(plan).unwrap_or_else(|failure| panic!("with its protection it passes: {failure}"));
        match fly_defenceless(plan) {
            Ok(survived) => panic!("nobody missed the protection: {survived:?}"),
            Err(Failure::NeverRan { .. }) => panic!("{plan:?} never ran"),
            Err(failure) => println!("{}: {failure}", plan.mishap.words()),
        }
    }
}
