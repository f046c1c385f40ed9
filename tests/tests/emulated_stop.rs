//! The stop on the flash image, at every phase: by key and by command, so and so long before the start of a pulse.

use frame::message::Command;
use hal_sim::Scenario;
use hal_sim::emulated::rig::{Action, Heard, Operator, rig};

/// Time from one reset to the next, ms: it is the reset that ends a stop, as clearing it would cost 2 s of minimum pulses before the
/// next calibration.
const CYCLE_MS: u64 = 510;
/// When the ESC's supply goes on and off in a cycle, ms: maximum needs a supply that was seen on, and off after that, each for 0.1 s. The
/// board starts within 40 ms.
const ON: u64 = 5;
const OFF: u64 = 150;
/// When maximum pulses are asked for in a cycle, the stop ordered, and the reset key pressed, ms.
const ASK: u64 = 270;
const STOP: u64 = 390;
const RESET: u64 = 500;

/// How long before a pulse each stop comes, ns: from just above 1 ms over a whole half tick (the board looks twice a
/// millisecond, so half a millisecond holds every phase), and two that come from further away.
const BEFORE: [(bool, u64); 12] = [
    (true, 1_000_001),
    (true, 1_070_000),
    (true, 1_140_000),
    (true, 1_210_000),
    (true, 1_280_000),
    (true, 1_350_000),
    (true, 1_430_000),
    (true, 7_770_000),
    (false, 1_000_001),
    (false, 1_170_000),
    (false, 1_340_000),
    (false, 13_330_000),
];

/// Brings the rig into the range calibration, the state with the highest pulses, and stops it again and again.
#[derive(Debug, Default)]
struct Sweep;

impl Operator for Sweep {
    fn millisecond(&mut self, ms: u64, _: &[Heard], actions: &mut Vec<Action>) {
        let Some((key, ns)) = BEFORE.get((ms / CYCLE_MS) as usize).copied() else { return };
        match ms % CYCLE_MS {
            ON => actions.push(Action::Power(true)),
            OFF => actions.push(Action::Power(false)),
            ASK => actions.push(Action::Send(Command::CalibrateRange { confirm: Command::CALIBRATE_CONFIRM })),
            STOP => actions.push(Action::StopBeforePulse { key, ns }),
            RESET => actions.push(Action::Reset), // and lets the key go
            _ => {}
        }
    }
}

#[test]
fn the_first_pulse_that_starts_a_millisecond_after_a_stop_is_minimum() {
    let begun = std::time::Instant::now();
    let cycles = BEFORE.len() as u64;
    let run = rig(&Scenario::default(), Sweep, cycles * CYCLE_MS).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(run.stops.len(), BEFORE.len(), "every stop came");
    for ((stop, (key, before)), cycle) in run.stops.iter().zip(BEFORE).zip(0u64..) {
        let inside = |at: u64| (cycle * CYCLE_MS..(cycle + 1) * CYCLE_MS).contains(&(at / 1_000_000));
        let pulses = run.pulses.iter().filter(|p| inside(p.at_ns));
        let live = pulses.clone().filter(|p| p.at_ns < *stop && p.width_ns == 2_000_000).count();
        assert!(live >= 4, "{live} maximum pulses before the stop");
        assert!(pulses.clone().filter(|p| p.at_ns > stop + 1_000_000).count() >= 3, "the train goes on");
        let next = pulses.clone().find(|p| p.at_ns > *stop).expect("pulses never cease");
        let after = next.at_ns - stop;
        println!(
            "{} {:.3} ms before a pulse: {} us",
            if key { "key" } else { "command" },
            after as f64 * 1e-6,
            next.width_ns / 1000
        );
        assert!(after.abs_diff(before) < 5_000, "the stop came {after} ns before a pulse, ordered {before}");
        assert!(pulses.filter(|p| p.at_ns > stop + 1_000_000).all(|p| p.width_ns == 1_000_000), "cycle {cycle}");
    }
    println!("{:.1} s simulated in {:.1} s", run.outcome.now_ns as f64 * 1e-9, begun.elapsed().as_secs_f64());
}
