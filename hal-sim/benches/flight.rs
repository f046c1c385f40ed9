//! How long a flight takes: `cargo bench -p hal-sim --bench flight`.
//!
//! What it is: six minutes of free flight in gusts, controller and the IMU board's firmware natively aboard, from take-off to landing; the same
//! time under pulses alone, without a board. The throughput that is printed counts simulated milliseconds of the flight: one million a second
//! ("1.0 Melem/s") is 1 000 times real time.
//! What can go wrong: another process on the same core.
//! Units: simulated milliseconds.
//! Reference: specification `flight.md`, "Missions"; docs/speed.md.
#![allow(missing_docs)] // criterion's macros make an undocumented function

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use hal_sim::mission::{AirframeFile, Catalogue, Mission, catalogue_plants, fly_whole};
use hal_sim::plant::air::SEA_LEVEL_DENSITY;
use std::hint::black_box;
use std::path::Path;

/// Six minutes in the air, ms.
const FLIGHT_MS: u64 = 360_000;

fn mission(text: &str) -> Mission {
    Mission::parse(text, Path::new("bench.toml")).unwrap_or_else(|e| panic!("{e}"))
}

fn fly(mission: &Mission, airframe: &AirframeFile) -> usize {
    let plants = catalogue_plants(airframe);
    let flight = fly_whole(mission, airframe, plants, &Catalogue(airframe), SEA_LEVEL_DENSITY, &mut |_| ());
    black_box(flight).map_or(0, |f| f.rows.len())
}

fn flights(c: &mut Criterion) {
    let airframe = AirframeFile::default();
    let gusts = "[wind]\ngust_m_s = 1.0\ngust_length_m = 10.0\n";
    let steered = mission(&format!(
        "duration_s = 360\n[start]\nspun_up = false\n{gusts}[controller]\nway = [{{ at_s = 1, up_m = 0 }}, {{ at_s = 4, up_m = 2 }}, \
         {{ at_s = 120, up_m = 2 }}, {{ at_s = 130, up_m = 2, north_m = 5 }}, {{ at_s = 345, up_m = 2, north_m = 5 }}, \
         {{ at_s = 351, up_m = -1, north_m = 5 }}]\n"
    ));
    let free = mission(&format!(
        "duration_s = 360\n[start]\nheight_m = 3000\n{gusts}[[command]]\nrotors = [1, 2, 3, 4]\nsteps = [{{ pulse_us = 1684, hold_s = 1 }}]\n"
    ));
    let mut group = c.benchmark_group("flight");
    group.sample_size(10).sampling_mode(SamplingMode::Flat).throughput(Throughput::Elements(FLIGHT_MS));
    group.bench_function("controller and IMU board", |b| b.iter(|| fly(&steered, &airframe)));
    group.bench_function("pulses alone", |b| b.iter(|| fly(&free, &airframe)));
    group.finish();
}

criterion_group!(benches, flights);
criterion_main!(benches);
