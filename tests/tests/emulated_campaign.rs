//! The fault campaign on the flash image: a plan of each kind that the pins of the emulated board can show, under the native rules.

use hal_sim::emulated::pilot::{fly, fly_spared};
use hal_sim::fault::{Mishap, Phase, Plan, Rule, Wrong};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Longest time that a flight is watched after its mishap, ms: the emulator takes about as long as the board.
const WATCHED_MS: f64 = 900.0;
/// Latest mishap after its phase began, ms: the rotor has reached its speed.
const EARLY_MS: u64 = 520;
/// Schedules at the least.
const LEAST: usize = 100;

/// The first plan of a kind, from a seed of its own, that is not too long.
fn plan((n, mishap): (u64, Mishap)) -> Option<Plan> {
    let short = |plan: &Plan| {
        let slow = plan.phase == Phase::Start;
        let log = f64::from(plan.config.log_period_ms);
        slow || (Rule::of(plan, 2500.0, 2500.0).within_ms <= WATCHED_MS && log < 300.0)
    };
    let early = |plan: Plan| Plan { after_ms: plan.after_ms.min(EARLY_MS), ..plan };
    (0..500).map(|k| Plan::with(1000 * n + k, mishap)).find(short).map(early)
}

#[test]
fn the_image_answers_each_kind_of_fault_as_the_specification_says() {
    let plans: Vec<Plan> = (0..).zip(Mishap::all()).filter(|(_, mishap)| mishap.on_image()).filter_map(plan).collect();
    let there = Mishap::all().into_iter().filter(|mishap| mishap.on_image()).count();
    assert!(plans.len() >= LEAST && plans.len() == there, "{} plans of {there} kinds", plans.len());
    let next = AtomicUsize::new(0);
    let begun = Instant::now();
    let work = || {
        let mut told = Vec::new();
        while let Some(plan) = plans.get(next.fetch_add(1, Ordering::Relaxed)) {
            let begun = Instant::now();
            let flown = fly(plan).unwrap_or_else(|error| panic!("{error}"));
            told.push((plan, flown, begun.elapsed()));
        }
        told
    };
    let workers = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let mut told: Vec<_> = std::thread::scope(|scope| {
        let handles: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        handles.into_iter().flat_map(|handle| handle.join().expect("no flight panics")).collect()
    });
    told.sort_by_key(|(plan, ..)| Mishap::all().iter().position(|mishap| mishap.words() == plan.mishap.words()));
    let mut wrong = Vec::new();
    for (plan, flown, took) in &told {
        match flown {
            Ok(survived) if survived.stopped => println!(
                "{} {}: last pulse above minimum {:.1} ms after it, {:?} allowed ({took:.1?})",
                plan.mishap.words(),
                plan.phase.words(),
                survived.last_live_ms,
                survived.limit_ms
            ),
            Ok(_) => println!("{} {}: it goes on, or never began ({took:.1?})", plan.mishap.words(), plan.phase.words()),
            Err(failure) => wrong.push(failure.to_string()),
        }
    }
    println!("{} schedules on the image in {:.1} s", told.len(), begun.elapsed().as_secs_f64());
    assert!(wrong.is_empty(), "{} of {}: {wrong:#?}", wrong.len(), told.len());
}

/// The campaign can fail: a board to which nothing happened does not do what the mishap asks for.
#[test]
fn a_mishap_that_is_not_noticed_is_found_out() {
    let kinds = [
        Mishap::StuckLine { channel: 1 },
        Mishap::TwoFast { a: 0, b: 2 },
        Mishap::Skewed { channel: 0 },
        Mishap::Saturated { channel: 1, high: true },
        Mishap::HardFault,
        Mishap::StopOpen,
    ];
    for mishap in kinds {
        let plan = Plan::factory(mishap);
        let judged = fly_spared(&plan).unwrap_or_else(|error| panic!("{error}"));
        let failure = judged.expect_err(&mishap.words());
        assert!(!matches!(failure.wrong, Wrong::NeverReached(..)), "{failure}");
        println!("{}: {}", mishap.words(), failure.wrong);
    }
}
