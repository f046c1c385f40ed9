//! Prints how many times faster than real time a native run is:
//! `cargo run --release -p hal-sim --example speed [RUNS [HOLD_S [EFFECT ...]]]`.
//!
//! The run is the thesis' own: 21 levels of 30 s (or of `HOLD_S`), four speed sensors, five analogue channels, 1 kHz tick, plant at
//! 10 kHz. The best of several runs is what the code can do; the others are what the machine was doing besides.

use hal_sim::scenario::Schedule;
use hal_sim::{Scenario, run};
use std::time::Instant;

fn main() {
    let mut args = std::env::args().skip(1);
    let runs: u32 = args.next().and_then(|n| n.parse().ok()).unwrap_or(5);
    let hold_s: f64 = args.next().and_then(|s| s.parse().ok()).unwrap_or(30.0);
    let named: Vec<String> = args.collect();
    let hidden = if named.is_empty() {
        vec!["", "beam_resonance", "battery_discharge"]
    } else {
        named.iter().map(String::as_str).collect()
    };
    let schedule = Schedule::Staircase { step_us: 50.0, hold_s, top_us: 2000.0 };
    for effect in hidden {
        let demo = match Scenario::demo(1, (effect != "none" && !effect.is_empty()).then_some(effect)) {
            Ok(demo) => demo,
            Err(error) => return eprintln!("{error}"),
        };
        let scenario = Scenario { schedule: schedule.clone(), ..demo };
        let mut best = (0.0, 0.0, f64::INFINITY);
        for _ in 0..runs {
            let begin = Instant::now();
            match run(&scenario, None, &mut |_| ()) {
                Ok(record) => {
                    let simulated = record.samples.last().map_or(0.0, |s| s.at.as_s());
                    let wall = begin.elapsed().as_secs_f64();
                    if wall < best.2 {
                        best = (simulated, simulated / wall, wall);
                    }
                }
                Err(error) => println!("{}: {error}", scenario.name),
            }
        }
        println!("{}: {:.1} s in {:.3} s at best of {runs}, {:.0} times real time", scenario.name, best.0, best.2, best.1);
    }
}
