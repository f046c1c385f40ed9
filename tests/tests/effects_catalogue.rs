//! What the simulator hides, against what the specification names and what the library of the identification knows.
//!
//! What it is: the ids of `closing-the-loop.md` outside the inertial and flight ones are all in the simulator, each in a file of its
//! own that can be scheduled; at least six more are of the simulator's own, and the library has never heard of them.
//! What can go wrong: an effect that is renamed on one side only shows here.
//! Reference: specification `closing-the-loop.md`, "Effects that the library starts with".

use hal_sim::Scenario;
use hal_sim::effect::{UNKNOWN, catalogue};
use std::collections::BTreeSet;
use std::path::Path;

/// Supply and ESC, motor and propeller, load cell, speed sensors, timing and acquisition.
const SPECIFIED: &str = "supply_sag battery_discharge current_limit thermal_derate throttle_quantisation \
    spinup_lag bearing_friction reynolds_thrust air_density blade_flex blade_damage stall \
    zero_drift thermal_zero creep hysteresis gain_change beam_resonance torque_crosstalk amplifier_saturation tare_shift \
    missed_pulses double_pulses alternating_period blade_twist encoder_drag coupling_slip \
    channel_delay channel_filter sample_hold clock_drift quantisation glitch_rows";

fn simulated() -> BTreeSet<&'static str> {
    catalogue().iter().map(|e| e.id).collect()
}

fn known() -> BTreeSet<&'static str> {
    ident::effects::library().iter().map(|e| e.id()).collect()
}

#[test]
fn every_effect_that_the_specification_names_is_simulated() {
    let simulated = simulated();
    let missing: Vec<&str> = SPECIFIED.split_whitespace().filter(|id| !simulated.contains(id)).collect();
    assert_eq!(missing, [""; 0], "named by the specification, not in the simulator");
    let missing: Vec<&str> = SPECIFIED.split_whitespace().filter(|id| !known().contains(id)).collect();
    assert_eq!(missing, [""; 0], "named by the specification, not in the library");
}

/// Whatever else the library knows, the simulator has as well, or is by itself: without any effect a rotor has inertia and a motor follows its
/// supply.
#[test]
fn what_the_library_knows_is_simulated() {
    let rest: Vec<&str> = known().difference(&simulated()).copied().collect();
    assert_eq!(rest, ["rotor_inertia", "supply_voltage"]);
}

#[test]
fn at_least_six_effects_are_unknown_to_the_library() {
    let own: BTreeSet<&str> = simulated().difference(&known()).copied().collect();
    println!("unknown to the library: {own:?}");
    assert!(own.len() >= 6);
    assert_eq!(own, UNKNOWN.into_iter().collect());
}

/// One file each, and a scenario file takes each with a window.
#[test]
fn each_has_its_file_and_its_window() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../hal-sim/src/effect");
    for entry in catalogue() {
        let file = folder.join(format!("{}.rs", entry.id));
        let text = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        assert!(text.contains(&format!("\"{}\"", entry.id)), "{} names its id", file.display());
        assert_eq!(text.matches("impl Effect for").count(), 1, "{} holds one effect", file.display());
        let scenario = Scenario::demo(4, Some(entry.id)).unwrap_or_else(|e| panic!("{e}"));
        let text = toml::to_string(&scenario).expect("a scenario is a TOML table");
        let windowed =
            text.replacen(&format!("id = \"{}\"", entry.id), &format!("id = \"{}\"\nfrom_s = 12.5\nuntil_s = 40.0", entry.id), 1);
        let read = Scenario::parse(&windowed, Path::new("window.toml")).unwrap_or_else(|e| panic!("{}: {e}", entry.id));
        let effect = read.effects.first().expect("the effect");
        let open = [12.0, 13.0, 39.9, 40.1].map(|s| effect.is_open(s));
        assert_eq!(open, [false, true, true, false], "{}", entry.id);
    }
}
