//! Three detectors on one run: ours, and the binary shift algorithm published and mended.

#![allow(dead_code, unreachable_pub)] // each user takes a part of it

use super::rig::{Run, Trouble};
use ident::context::Context;
use ident::log::Log;
use ident::plateau::score::{Found, Score};
use ident::plateau::{means_over, plateaus};
use ident::shift::{Form, Settings, filters};

/// The troubles that the specification lists, one by one and together.
pub const TROUBLES: [(&str, Trouble); 9] = {
    const NONE: Trouble = Trouble {
        resonance: false,
        erratic: false,
        missing: false,
        drift: false,
        up_down: false,
        no_command: false,
        spoilt: false,
    };
    [
        ("none", NONE),
        ("resonance", Trouble { resonance: true, ..NONE }),
        ("erratic steps", Trouble { erratic: true, ..NONE }),
        ("missing samples", Trouble { missing: true, ..NONE }),
        ("drift", Trouble { drift: true, ..NONE }),
        ("up and down", Trouble { up_down: true, ..NONE }),
        ("all of these", Trouble { resonance: true, erratic: true, missing: true, drift: true, up_down: true, ..NONE }),
        ("none, no command", Trouble { no_command: true, ..NONE }),
        (
            "all, no command",
            Trouble { resonance: true, erratic: true, missing: true, drift: true, up_down: true, no_command: true, ..NONE },
        ),
    ]
};

/// Who is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detector {
    /// The detector of this project.
    Ours,
    /// The binary shift algorithm as published, with the threshold and offset that score best on the run: more than the trial and
    /// error of section 5.7.4 can reach, because the truth chooses.
    Published,
    /// Its mended form, automatic.
    Mended,
}

/// Row ranges that a detector finds.
pub fn ranges(log: &Log, who: Detector) -> Vec<(usize, usize)> {
    let rpm = log.column("rpm").expect("a speed");
    match who {
        Detector::Ours => plateaus(&Context::new(log, None), log).iter().map(|p| (p.first, p.first + p.rows)).collect(),
        Detector::Published => unreachable!("tried by hand in `judge`"),
        Detector::Mended => filters(rpm, &Settings { form: Form::Mended, ..Settings::default() }).stretches(),
    }
}

/// Scores of speed and thrust. All detectors are given the same error of the mean, so that only where they look differs; the
/// published one averages as the thesis does, missing samples included.
pub fn judge(run: &Run, who: Detector) -> [Score; 2] {
    if who != Detector::Published {
        return score(run, who, &ranges(&run.log, who));
    }
    by_hand(run).0
}

/// The published algorithm with every threshold and offset of a grid: the best score, its threshold and offset.
pub fn by_hand(run: &Run) -> ([Score; 2], f64, usize) {
    let rpm = run.log.column("rpm").expect("a speed");
    let mut best: Option<([Score; 2], f64, usize)> = None;
    for threshold in [0.7, 4.0, 7.0, 10.0, 15.0, 25.0, 45.0, 90.0] {
        for offset in [1, 3, 6, 12] {
            let settings =
                Settings { form: Form::Published, threshold: Some(threshold), offset: Some(offset), ..Settings::default() };
            let found = filters(rpm, &settings).stretches();
            let s = score(run, Detector::Published, &found);
            let merit = |s: &[Score; 2]| s[0].within as f64 + 0.01 * s[0].found as f64 - 0.2 * s[0].wrong as f64;
            if best.as_ref().is_none_or(|b| merit(&s) > merit(&b.0)) {
                best = Some((s, threshold, offset));
            }
        }
    }
    best.expect("a grid")
}

fn score(run: &Run, who: Detector, ranges: &[(usize, usize)]) -> [Score; 2] {
    [("rpm", &run.rpm), ("thrust_n", &run.thrust)].map(|(name, truth)| {
        let values = run.log.column(name).expect("the channel");
        let found: Vec<Found> = ranges
            .iter()
            .zip(means_over(values, ranges))
            .map(|((from, to), m)| {
                let (mean, se) = m.unwrap_or((f64::NAN, f64::NAN));
                let mean = match who {
                    Detector::Published => ident::shift::means(values, &[(*from, *to)], Form::Published)[0],
                    _ => mean,
                };
                // a standing rotor reads exactly zero
                Found { from: *from, to: *to, mean, se: se.max(1e-9) }
            })
            .collect();
        Score::of(&run.truths, truth, &found)
    })
}
