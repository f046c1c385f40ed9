//! What other attitude filters cost in the harness of ours, and what the best of them reaches.
//!
//! What it is: builds the images of `firmware-ahrs/peers`, a workspace of its own with the peers pinned, all for speed; reads flash and
//! static RAM from the ELF files, counts instructions on the emulated board, and prints each figure over the image without a filter,
//! after those of our own cost images. And runs `xtask/vqf`, a Rust port of VQF over every variant of the benchmark.
//!
//! What can go wrong: a peer that does not build for the board, or no network when it was never fetched.
//!
//! Units: bytes; instructions of one update, mean over 20 s at 200 Hz with the magnetometer at 75 Hz.
//!
//! Reference: `docs/ahrs.md`, "Cost"; `firmware-ahrs/src/cost/body.rs`.

use crate::image::{self, measure};
use crate::place::{BOARD, Place};
use crate::run::{Failure, cargo, output, run};
use std::path::Path;

/// Images and what they hold.
const PEERS: [(&str, &str); 6] = [
    ("ahrs-madgwick", "ahrs 0.8.0, Madgwick"),
    ("fusion", "fusion-ahrs 1.0.1"),
    ("uf-mahony", "uf-ahrs 0.2.2, Mahony"),
    ("uf-madgwick", "uf-ahrs 0.2.2, Madgwick"),
    ("uf-vqf", "uf-ahrs 0.2.2, VQF"),
    ("vqf-rs", "vqf-rs 0.3.0, VQF"),
];
/// As in `firmware-ahrs/src/cost/body.rs`.
const UPDATES: f64 = 4000.0;

/// Builds, counts and prints the table.
pub(crate) fn peers(place: &Place) -> Result<(), Failure> {
    image::build(place)?;
    let ours =
        [("cost-dcm", "ours", size_of::<dcm::Dcm<dcm::Standard>>()), ("cost-classic", "the thesis'", size_of::<dcm::Classic>())];
    let own = over_empty(place, &place.images(), "cost-empty", &ours.map(|(name, ..)| name))?;
    let target = place.root.join("target/peers");
    let mut build = cargo(place, &["build", "--release", "--locked", "--target", BOARD, "--target-dir"]);
    build.env("CARGO_INCREMENTAL", "0");
    run(build.arg(&target).current_dir(place.root.join("firmware-ahrs/peers")))?;
    let others = over_empty(place, &target.join(BOARD).join("release"), "empty", &PEERS.map(|(name, _)| name))?;
    println!("{:<26} {:>12} {:>8} {:>8}", "filter", "instructions", "flash", "RAM");
    for ((_, title, ram), cost) in ours.iter().zip(own) {
        println!("{title:<26} {:>12.0} {:>8} {ram:>8}", cost.instructions, cost.flash);
    }
    for ((_, title), cost) in PEERS.iter().zip(others) {
        println!("{title:<26} {:>12.0} {:>8} {:>8}", cost.instructions, cost.flash, cost.ram);
    }
    Ok(())
}

/// What an image takes more than the one without a filter.
struct Cost {
    instructions: f64,
    flash: u64,
    ram: u64,
}

fn over_empty(place: &Place, images: &Path, empty: &str, names: &[&str]) -> Result<Vec<Cost>, Failure> {
    let mut count = cargo(place, &["test", "--release", "--workspace", "--features", "quadrig-tests/emulated"]);
    count.args(["--ignore-rust-version", "--test", "boards", "--", "emulated_ahrs_cost::", "--ignored", "--nocapture"]);
    count.env("QUADRIG_FW_DIR", images).env("QUADRIG_COST_IMAGES", [&[empty], names].concat().join(" "));
    let counted = output(&mut count)?;
    let count = |name: &str| {
        let line = counted.lines().find_map(|line| line.strip_prefix("image ")?.strip_prefix(name)?.strip_prefix(' '));
        line.and_then(|n| n.parse::<f64>().ok()).ok_or_else(|| Failure(format!("no count of {name}")))
    };
    let (base, none) = (measure(&images.join(empty))?, count(empty)?);
    let cost = |name: &&str| {
        let size = measure(&images.join(name))?;
        Ok(Cost { instructions: (count(name)? - none) / UPDATES, flash: size.flash - base.flash, ram: size.ram - base.ram })
    };
    names.iter().map(cost).collect()
}

/// A Rust port of VQF over every variant of the benchmark.
pub(crate) fn vqf(place: &Place) -> Result<(), Failure> {
    let target = place.root.join("target/vqf");
    let mut program = cargo(place, &["run", "--release", "--locked", "--target-dir"]);
    run(program.arg(target).arg("--").arg(place.data().join("ahrs/broad")).current_dir(place.root.join("xtask/vqf")))
}
