//! Runs of the simulated IMU board with one hidden effect of the simulator.
//!
//! What it is: a calibrated board whose chips have the noise of their data sheets on a body that turns, rocks, pauses and is carried
//! about; what is hidden is drawn by the simulator from a seed. `quadrig sim` flies the scenario, and only the text of its
//! readings goes on.
//! What can go wrong: a refusal of the scenario is a panic with what was said: these are tests.
//! Units: those of scenario files.
//! Reference: `docs/scenario.md`, "The IMU board"; specification `closing-the-loop.md`, "What counts as proof".

use super::Simulated;
use crate::call;
use hal_sim::imu::{ImuEffectKind, ImuScheduled};
use hal_sim::scenario::{BodySection, ChipSection, ImuScenario, ImuSection};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// Length, s.
const LENGTH_S: f64 = 90.0;
/// Noise of a reading: 0.38 deg/s rms (PS-ITG-3200A rev 1.4), 0.75 LSB rms (ADXL345 rev E), 2 mG (HMC5883L), in deg/s, g and uT.
const NOISE: [f64; 3] = [0.38, 0.75 / 256.0, 0.2];

/// The scenario of a seed, with an effect or without.
///
/// # Panics
/// When the simulator has no effect of this id.
#[must_use]
pub fn scenario(id: Option<&str>, seed: u64) -> ImuScenario {
    let mut chance = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(0x2545_F491_4F6C_DD1D).wrapping_add(77));
    let mut within = |least: f64, most: f64| chance.random_range(least..most);
    let mut along = |size: f64| -> [f64; 3] {
        loop {
            let v = [within(-1.0, 1.0), within(-1.0, 1.0), within(-1.0, 1.0)];
            let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
            if (0.2..1.0).contains(&length) {
                return v.map(|x| x / length * size);
            }
        }
    };
    let (turning, rocking, bias) = (along(1.0), along(1.0), along(1.0));
    let (speed, swing) = (within(25.0, 50.0), within(30.0, 60.0));
    let (dip, strength) = (within(0.9, 1.2), within(42.0, 52.0));
    let body = BodySection {
        start_deg: [within(-60.0, 60.0), within(-60.0, 60.0), within(0.0, 360.0)],
        rate_deg_s: turning.map(|x| x * speed),
        rock_deg: rocking.map(|x| x * swing),
        rock_hz: within(0.1, 0.3),
        pause_s: [within(5.0, 7.0), within(20.0, 28.0)],
        walk_m: [0.9, 0.6, 0.2],
        // so slow that it feels less than 0.04 m/s^2, the attitude's own doubt
        walk_hz: within(0.02, 0.03),
        field_ut: [strength * dip.cos(), 0.0, strength * dip.sin()],
        ..BodySection::default()
    };
    let noisy = |k: usize| ChipSection { noise: Some(NOISE[k]), ..ChipSection::default() };
    let imu = ImuSection {
        duration_s: LENGTH_S,
        drawn_errors: false,
        start_c: Some(20.0),
        end_c: Some(32.0),
        body,
        gyro: ChipSection { bias: Some(bias), ..noisy(0) },
        accelerometer: noisy(1),
        magnetometer: noisy(2),
        ..ImuSection::default()
    };
    let draw = |id: &str| ImuEffectKind::draw(id, seed, LENGTH_S).unwrap_or_else(|| panic!("no effect {id:?} in the simulator"));
    let effects = id.map(|id| ImuScheduled { from_s: None, until_s: None, effect: draw(id) }).into_iter().collect();
    ImuScenario { name: id.unwrap_or("nothing hidden").to_owned(), seed, imu, effects, faults: Vec::new() }
}

/// Flies it in a folder of its own.
///
/// # Panics
/// When the simulator refuses.
#[must_use]
pub fn fly(folder: &Path, id: Option<&str>, seed: u64) -> Simulated {
    let scenario = scenario(id, seed);
    let text = toml::to_string(&scenario).expect("a scenario is a TOML table");
    std::fs::write(folder.join("imu.toml"), text).expect("the folder can be written");
    call(folder, &["--quiet", "sim", "imu.toml", "-o", "attitude.csv", "--readings", "readings.csv"]).succeeded();
    let csv = std::fs::read_to_string(folder.join("readings.csv")).expect("the readings");
    let named = scenario.effects.first().map(|e| e.effect.parameters()).unwrap_or_default();
    // a row's time is the gyro's: the magnetometer is read a little later on the same bus, and the log shows it late by so much less
    let after = |name: &str| if name == "delay" { lag_of_the_row(&scenario) } else { 0.0 };
    let truth = named.into_iter().map(|(name, value, _)| (name.to_owned(), value - after(name))).collect();
    Simulated { csv, truth }
}

/// Time from the gyro's burst to the magnetometer's in one row, s, as the simulated bus carries them.
fn lag_of_the_row(scenario: &ImuScenario) -> f64 {
    let run = hal_sim::native::ahrs::run(&scenario.rig(), 200).expect("every message fits its frame");
    let [gyro, _, mag] = &run.served;
    let field = mag.last().expect("a reading").at_ns;
    let row = gyro.iter().map(|s| s.at_ns).filter(|at| *at <= field).max().expect("a reading before it");
    (field - row) as f64 * 1e-9
}
