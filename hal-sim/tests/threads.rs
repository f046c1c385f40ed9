//! One thread or two, an idle or a loaded machine: the same bytes.

use hal_sim::scenario::Schedule;
use hal_sim::{Scenario, run};

fn telemetry(seed: u64) -> Vec<u8> {
    let scenario = Scenario {
        seed,
        schedule: Schedule::UpDown { step_us: 500.0, hold_s: 3.0, top_us: 2000.0 },
        ..Scenario::demo(seed, Some("bearing_friction")).unwrap_or_else(|e| panic!("{e}"))
    };
    run(&scenario, None, &mut |_| ()).unwrap_or_else(|e| panic!("{e}")).telemetry
}

#[test]
fn two_runs_side_by_side_are_the_runs_one_after_the_other() {
    let alone = [telemetry(1), telemetry(2)];
    assert_ne!(alone[0], alone[1]);
    let spin = &std::sync::atomic::AtomicBool::new(true);
    let side_by_side = std::thread::scope(|scope| {
        // two more threads do nothing but load the machine
        for _ in 0..2 {
            scope.spawn(|| {
                while spin.load(std::sync::atomic::Ordering::Relaxed) {
                    std::hint::spin_loop()
                }
            });
        }
        let both = [1, 2].map(|seed| scope.spawn(move || telemetry(seed)));
        let both = both.map(|t| t.join().expect("the run ends"));
        spin.store(false, std::sync::atomic::Ordering::Relaxed);
        both
    });
    assert_eq!(side_by_side, alone);
}
