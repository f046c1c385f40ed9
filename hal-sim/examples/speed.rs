//! Prints how many times faster than real time a native run is: `cargo run --release -p hal-sim --example speed`.

use hal_sim::{Scenario, run};
use std::time::Instant;

fn main() {
    for effect in [None, Some("beam_resonance"), Some("battery_discharge")] {
        let scenario = Scenario::demo(1, effect).expect("the catalogue has this effect");
        let begin = Instant::now();
        match run(&scenario, None, &mut |_| ()) {
            Ok(record) => {
                let simulated = record.samples.last().map_or(0.0, |s| s.at.as_s());
                let wall = begin.elapsed().as_secs_f64();
                println!("{}: {simulated:.1} s in {wall:.3} s, {:.0} times real time", scenario.name, simulated / wall);
            }
            Err(error) => println!("{}: {error}", scenario.name),
        }
    }
}
