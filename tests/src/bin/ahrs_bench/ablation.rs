//! `cargo xtask ahrs-bench --ablation`: each mechanism of the filter switched off, on both sets.
//!
//! What it is: the default with one number at a value that takes its mechanism out, over every shared recording of both sets. The page
//! that is printed is `docs/ahrs-ablation.md`.
//! What can go wrong: missing data is a failure.
//! Units: degrees; changes in percent.
//! Reference: `docs/ahrs.md`, "How it works".

use super::score::Score;
use super::sets::{Errors, Sets};
use dcm::Config;

/// What is switched off, and how.
type Off = (&'static str, &'static str, fn(&mut Config));

/// Each mechanism.
const MECHANISMS: &[Off] = &[
    ("force is averaged in earth axes", "`tilt_tau` 0.3 s", |c| c.tilt_tau = 0.3),
    ("averaging of the force stretches with true acceleration", "`tilt_stretch` 0", |c| c.tilt_stretch = 0.0),
    ("the stretch shrinks at high rates", "`tilt_rate` without bound", |c| c.tilt_rate = 1e6),
    ("force is summed for 30 ms before it is used", "`tilt_window` 0", |c| c.tilt_window = 0.0),
    ("rest is recognised", "`rest.time` without end", |c| c.rest.time = 1e9),
    ("bias is learnt from the tilt while moving", "`bias.tilt_gain` 0", |c| c.bias.tilt_gain = 0.0),
    ("... faster while it is unknown", "`bias.tilt_boost` 0", |c| c.bias.tilt_boost = 0.0),
    ("bias is learnt from the heading while moving", "`bias.heading_gain` 0", |c| c.bias.heading_gain = 0.0),
    ("... faster while it is unknown", "`bias.heading_boost` 0", |c| c.bias.heading_boost = 0.0),
    ("motion makes the bias known", "`bias.motion_tau` without end", |c| c.bias.motion_tau = 1e9),
    ("corrections are seen through an averaged attitude", "`bias.lag` 0.02 s", |c| c.bias.lag = 0.02),
    ("the heading is averaged", "`heading_tau` 0.1 s", |c| c.heading_tau = 0.1),
    ("fields are averaged for 35 ms before they are used", "`field.window` 0", |c| c.field.window = 0.0),
    ("a field that differs is refused", "`field.norm`, `field.dip` without bound", |c| {
        c.field.norm = 1e9;
        c.field.dip = 10.0;
    }),
    ("... by its dip too", "`field.dip` without bound", |c| c.field.dip = 10.0),
    ("a field that no place has is a magnet's", "`field.strongest` without bound", |c| c.field.strongest = 1e9),
    ("a field is believed again after a while", "`field.settle` 0", |c| c.field.settle = 0.0),
    ("a new field is taken after a while", "`field.new_time` without end", |c| c.field.new_time = 1e9),
    ("a freeze ends", "`field.longest_freeze` without end", |c| c.field.longest_freeze = 1e9),
    ("hard iron is taken off", "`iron.dead_zone` without bound", |c| c.iron.dead_zone = 1e9),
    ("clipped forces are used too (what if they were left out)", "`accel_range` 2 g", |c| {
        c.accel_range = 2.0 * dcm::STANDARD_GRAVITY
    }),
];

/// Prints the page.
pub(super) fn ablation(sets: &Sets) {
    let whole = sets.errors(Config::DEFAULT);
    println!("{}", head(&whole));
    for (k, (what, how, off)) in MECHANISMS.iter().enumerate() {
        eprintln!("{} of {}: {how}", k + 1, MECHANISMS.len());
        let mut config = Config::DEFAULT;
        off(&mut config);
        println!("{}", row(what, how, &sets.errors(config), &whole));
    }
}

fn three(s: &Score) -> String {
    format!("{:.2} / {:.2} / {:.2}", s.total, s.heading, s.inclination)
}

fn head(whole: &Errors) -> String {
    format!(
        "# What each mechanism of the attitude filter is worth

Written by `cargo xtask ahrs-bench --ablation > docs/ahrs-ablation.md`. One mechanism is switched off at a time; everything else stays.
Mean errors in degrees, total / heading / inclination: BROAD over the eight published variants of the shared trials, phones over the shared
trials with the gyro's bias of the day taken off beforehand, and left in. In brackets the change of total and inclination.

| mechanism | switched off by | BROAD | phones | phones, bias left in |
| --- | --- | --- | --- | --- |
| the filter as it is | | {} | {} | {} |",
        three(&whole.broad),
        three(&whole.own),
        three(&whole.raw)
    )
}

fn row(what: &str, how: &str, now: &Errors, whole: &Errors) -> String {
    let [bt, bi, ot, oi, rt, ri] = now.against(whole).map(|share| format!("{:+.0} %", share * 100.0 + 0.0));
    let [broad, own, raw] = [&now.broad, &now.own, &now.raw].map(three);
    format!("| {what} | {how} | {broad} ({bt}, {bi}) | {own} ({ot}, {oi}) | {raw} ({rt}, {ri}) |")
}
