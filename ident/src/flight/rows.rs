//! Channels that are told row by row, as they were logged: rotors' speeds and the voltage.
//!
//! What it is: errors of the declared and of the corrected model on every row, and on rows whose block took no part in the fit.
//! What can go wrong: rows of which an input is missing make no claim.
//! Units: those of the channels.
//! Reference: specification `formats.md` (`predict` writes those predictions).

use super::columns::Flight;
use super::library::FlightLibrary;
use super::model::FlightModel;
use super::predict::{columns, is_by_row, over_windows};
use crate::attribution::channel::rms;
use crate::attribution::validate::{Fold, folds};
use crate::attribution::{Conclusion, Design, Fit, Library, Placed, Problem};

/// What the account knows.
pub(super) struct Told<'t> {
    pub(super) flight: &'t Flight,
    pub(super) library: &'t FlightLibrary<'t>,
    pub(super) problem: Problem<'t>,
    pub(super) concluded: &'t Conclusion,
}

/// Figures of one channel by rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct By {
    /// Channel among those of the windows.
    pub(super) channel: usize,
    /// Noise floor of a row.
    pub(super) floor: f64,
    /// Over all rows and over left-out rows, declared model.
    pub(super) before: [f64; 2],
    /// The same, corrected model.
    pub(super) after: [f64; 2],
}

/// All such channels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rows {
    pub(super) of: Vec<By>,
}

impl Rows {
    /// Of a conclusion; `corrected` is the model that is written.
    pub(super) fn of(told: &Told<'_>, corrected: &FlightModel) -> Self {
        let flight = told.flight;
        let wanted: Vec<usize> = (0..flight.channels.targets.len()).filter(|c| is_by_row(flight.channels.targets[*c])).collect();
        if wanted.is_empty() {
            return Self { of: Vec::new() };
        }
        let rows = flight.by_row();
        let library = told.library.on(&rows);
        let written = over_windows(&rows, &columns(corrected, &library, true));
        let sides = [&told.concluded.declared, &told.concluded.fit].map(|fit| Side::of(told, &library, fit));
        let one = |channel: &usize| {
            let target = flight.channels.targets[*channel];
            let at = rows.channels.position(target)?;
            let seen = &rows.channels.channels[at];
            let error = |predicted: &[f64]| rms(&seen.y.iter().zip(predicted).map(|(y, p)| y - p).collect::<Vec<f64>>());
            let held = |side: &Side| error(&side.held_out(&seen.t, at));
            let floor = told.problem.channels[*channel].floor.max(flight.windows.floor_of_row(&flight.record.logged(target)));
            let before = [error(&sides[0].whole(at, seen.len())), held(&sides[0])];
            Some(By { channel: *channel, floor, before, after: [error(&written[at]), held(&sides[1])] })
        };
        Self { of: wanted.iter().filter_map(one).collect() }
    }
}

/// One model on all rows, with the fits that left a block out.
struct Side {
    design: Design,
    amplitudes: Vec<f64>,
    folds: Vec<(Fold, Design)>,
}

impl Side {
    fn of(told: &Told<'_>, library: &FlightLibrary<'_>, fit: &Fit) -> Self {
        let made = |placed: &[Placed]| library.design(placed);
        let folds = folds(&told.problem, &fit.placed, &fit.noise, true).unwrap_or_default();
        let folds = folds.into_iter().map(|f| (f.clone(), made(&f.placed))).collect();
        Self { design: made(&fit.placed), amplitudes: fit.amplitudes.clone(), folds }
    }

    fn whole(&self, channel: usize, n: usize) -> Vec<f64> {
        self.design.predict(&self.amplitudes, channel, n)
    }

    /// Each row by the fit that did not see its block.
    fn held_out(&self, t: &[f64], channel: usize) -> Vec<f64> {
        let mut out = self.whole(channel, t.len());
        for (fold, design) in &self.folds {
            let predicted = design.predict(&fold.amplitudes, channel, t.len());
            (0..t.len()).filter(|row| fold.holds(t[*row])).for_each(|row| out[row] = predicted[row]);
        }
        out
    }
}
