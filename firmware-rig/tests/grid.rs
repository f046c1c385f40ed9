//! The grid of the samples: a tick that comes some cycles early or late, as interrupts make it, moves no sample by a whole tick.

use firmware_rig::{AdcBlock, Beside, Config, Inputs, LineNews, Rig};
use frame::units::Ticks;

#[test]
fn ticks_that_jitter_by_interrupts_leave_the_samples_evenly_spaced() {
    let mut rig = Rig::new(Config::thesis_570kv());
    let mut taken = Vec::new();
    for n in 0..2_000u64 {
        // the first tick is served in the middle of what the others take
        let late = if n == 0 { 200 } else { n * 7919 % 400 };
        let inputs = Inputs {
            now: Ticks(n * 84_000 + late),
            edges: [&[]; 4],
            over_capture: [false; 4],
            adc: &[AdcBlock::default(); 5],
            beside: Beside::UNWIRED,
            command: None,
            line: LineNews::default(),
            stop_input: false,
            brown_out: false,
            paused: false,
        };
        taken.extend(rig.tick(&inputs).sample.map(|_| n));
    }
    let steps: Vec<u64> = taken.windows(2).map(|w| w[1] - w[0]).collect();
    assert!(steps.len() > 10, "{taken:?}");
    assert!(steps.iter().all(|step| *step == steps[0]), "{steps:?}");
}
