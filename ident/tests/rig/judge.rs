//! Three detectors on one run: ours, and the binary shift algorithm published and mended.

#![allow(dead_code, unreachable_pub)] // each user takes a part of it

use super::rig::{Run, Trouble};
use ident::plateau::score::{Score, Truth};
use ident::plateau::shift::{Form, Settings, filters};
use ident::plateau::study::{self, Known};

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

/// Scores of speed and thrust.
pub fn judge(run: &Run, who: Detector) -> [Score; 2] {
    let channels = [("rpm", &run.rpm), ("thrust_n", &run.thrust)].map(|(name, level)| {
        let truths: Vec<Truth> = run.truths.clone();
        let known = Known { errors: vec![0.0; truths.len()], truths, level: level.clone() };
        (run.log.column(name).expect("the channel"), known)
    });
    let rpm = channels[0].0;
    let (ranges, form) = match who {
        Detector::Ours => (study::ours(&run.log, true), None),
        Detector::Mended => (filters(rpm, &Settings::default()).stretches(), Some(Form::Mended)),
        Detector::Published => {
            let best = study::best(&study::threshold_study(rpm, &channels[0].1, Form::Published)).expect("a grid");
            let settings = Settings {
                form: Form::Published,
                threshold: Some(best.threshold),
                offset: Some(best.offset),
                ..Settings::default()
            };
            (filters(rpm, &settings).stretches(), Some(Form::Published))
        }
    };
    channels.map(|(values, known)| known.score(values, &ranges, form))
}
