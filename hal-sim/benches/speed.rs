//! How long a simulated second takes: `cargo bench -p hal-sim`.
//!
//! What it is: the thesis run itself (21 levels of 30 s after the arming), firmware, codec, plant at 10 kHz, four speed sensors and five
//! analogue channels, ten times; then the plant and the bench alone. The throughput that is printed counts simulated milliseconds: one
//! million a second ("1.0 Melem/s") is 1 000 times real time.
//! What can go wrong: another process on the same core; the three figures are of the mean and its interval, so the highest throughput is
//! nearest to what the code can do, and `examples/speed.rs` tells the best run.
//! Units: simulated milliseconds.
//! Reference: docs/speed.md.
#![allow(missing_docs)] // criterion's macros make an undocumented function

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use hal_sim::native::Session;
use hal_sim::plant::{PlantBlock, Powerplant, RigPlant};
use hal_sim::scenario::Schedule;
use hal_sim::{Bench, EdgeDetail, Millisecond, Scenario};
use std::hint::black_box;

fn scenario(effect: Option<&str>) -> Scenario {
    let demo = Scenario::demo(1, effect).unwrap_or_else(|e| panic!("{e}"));
    Scenario { schedule: Schedule::Staircase { step_us: 50.0, hold_s: 30.0, top_us: 2000.0 }, ..demo }
}

/// Flies it; simulated milliseconds.
fn fly(scenario: &Scenario) -> u64 {
    let mut session = Session::new(scenario, None);
    while session.step().unwrap_or_else(|e| panic!("{e}")) {}
    let ms = (session.now_s() * 1000.0).round() as u64;
    black_box(session.finish()).map_or(0, |_| ms)
}

fn runs(c: &mut Criterion) {
    let mut group = c.benchmark_group("run");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    for effect in [None, Some("beam_resonance"), Some("battery_discharge")] {
        let scenario = scenario(effect);
        group.throughput(Throughput::Elements(fly(&scenario)));
        group.bench_function(effect.unwrap_or("healthy"), |b| b.iter(|| fly(&scenario)));
    }
    group.finish();
}

fn parts(c: &mut Criterion) {
    let mut group = c.benchmark_group("part");
    group.throughput(Throughput::Elements(1));
    let mut plant = RigPlant::new(scenario(None).parts().plant, 1);
    let mut block = PlantBlock::default();
    group.bench_function("plant", |b| b.iter(|| plant.advance_block(1.0e-4, black_box(1600.0), &mut block, &mut || ())));
    let mut bench = Bench::new(&scenario(None), None, EdgeDetail::Captured);
    bench.set_power(true);
    let (mut ms, mut gathered) = (0u64, Millisecond::default());
    group.bench_function("bench without firmware", |b| {
        b.iter(|| {
            if ms % 20 == 2 {
                bench.pulse(ms * 1_000_000, if ms < 5_000 { 1_000_000 } else { 1_600_000 });
            }
            bench.millisecond(&mut gathered);
            ms += 1;
        });
    });
    group.finish();
}

criterion_group!(speed, runs, parts);
criterion_main!(speed);
