//! Instructions of one update of the attitude filter, counted, against `budgets/ahrs.toml`.
//!
//! Build the images first: `cargo xtask image`

use hal_sim::emulated::cost::instructions;

/// As in `firmware-ahrs/src/cost/body.rs`.
const UPDATES: f64 = 4000.0;

fn budget(filter: &str) -> f64 {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../budgets/ahrs.toml")).unwrap();
    let mut lines = text.lines().skip_while(|l| *l != format!("[{filter}]"));
    let line = lines.find(|l| l.starts_with("instructions")).unwrap_or_else(|| panic!("no [{filter}] instructions"));
    line.split('=').nth(1).unwrap().trim().parse().unwrap()
}

/// Instructions until they sleep of the images in `QUADRIG_COST_IMAGES`.
#[test]
#[ignore = "a part of `cargo xtask ahrs-peers`, which names the images"]
fn instructions_of_the_images_that_are_named() {
    for name in std::env::var("QUADRIG_COST_IMAGES").unwrap().split(' ') {
        println!("image {name} {}", instructions(name, 2000).unwrap_or_else(|error| panic!("{error}")));
    }
}

#[test]
fn an_update_keeps_its_budget() {
    let count = |name: &str| instructions(name, 400).unwrap_or_else(|error| panic!("{error}"));
    let empty = count("cost-empty");
    for filter in ["dcm", "classic"] {
        let update = (count(&format!("cost-{filter}")) - empty) as f64 / UPDATES;
        println!("{filter}: {update:.0} instructions an update (accelerometer and gyro at 200 Hz, magnetometer at 75 Hz)");
        assert!(update <= budget(filter), "{filter}: {update:.0} instructions, the budget is {}", budget(filter));
        assert!(update > 100.0, "nothing was counted");
    }
}
