//! VQF on the variants of the attitude benchmark.
//!
//! What it is: the Rust port of VQF, in double precision and with its defaults, over the same trials, variants and score as
//! `cargo xtask ahrs-bench`; where VQF's own figures are published, the port's stand for the variants' definitions.
//! What can go wrong: missing or damaged data: one line says which.
//! Units: degrees.
//! Reference: Laidig & Seel, VQF, Information Fusion 91 (2023); `tests/src/bin/ahrs_bench/`.
#![allow(dead_code)] // the shared modules hold more than is used here

#[path = "../../../tests/src/bin/ahrs_bench"]
mod ahrs_bench {
    pub(crate) mod score;
    pub(crate) mod trial;
    pub(crate) mod variant;
}

mod run {
    /// Why it ended: one line.
    #[derive(Debug)]
    pub(crate) struct Failure(pub(crate) String);
}

use ahrs_bench::score::{Score, errors};
use ahrs_bench::trial::{self, Sample};
use ahrs_bench::variant::Variant;
use vqf_rs::VQF;

fn main() {
    let folder = std::env::args().nth(1).unwrap_or_default();
    let trials = trial::trials(std::path::Path::new(&folder)).unwrap_or_else(|failure| {
        eprintln!("vqf-accuracy: {}", failure.0);
        std::process::exit(1)
    });
    println!("vqf-rs 0.3.0, defaults\n{:<9} {:>8} {:>8} {:>8}", "variant", "total", "heading", "incl.");
    for variant in Variant::ALL {
        let scores: Vec<Score> = trials.iter().map(|t| score(&variant.of(t))).collect();
        let mean = Score::mean(scores.iter());
        println!("{:<9} {:>8.2} {:>8.2} {:>8.2}", variant.name(), mean.total, mean.heading, mean.inclination);
    }
}

/// Every sample in, magnetometer readings that repeat included: what it is asked for is a constant rate.
fn score(samples: &[Sample]) -> Score {
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else { return Score::default() };
    let mut filter = VQF::new((last.t - first.t) / (samples.len() - 1) as f64, None, None, None);
    let (mut sum, mut n) = (Score::default(), 0.0);
    for s in samples {
        let wide = |v: [f32; 3]| v.map(f64::from);
        filter.update(wide(s.gyro), wide(s.accel), Some(wide(s.mag)));
        let Some(truth) = s.truth else { continue };
        let q = filter.quat_9d();
        let (heading, inclination, total) = errors([q.0, q.1, q.2, q.3], truth.q);
        sum.heading += heading * heading;
        sum.inclination += inclination * inclination;
        sum.total += total * total;
        n += 1.0;
    }
    let rms = |sum: f64| (sum / n).sqrt();
    Score { total: rms(sum.total), heading: rms(sum.heading), inclination: rms(sum.inclination) }
}
