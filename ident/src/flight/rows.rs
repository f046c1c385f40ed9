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
use crate::attribution::columns::channel::rms;
use crate::attribution::columns::conclude::WORSE;
use crate::attribution::columns::validate::{Fold, folds};
use crate::attribution::columns::{Conclusion, Design, Fit, Kept, Library, Placed, Problem};

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
    /// Over left-out rows, without each term, by place.
    pub(super) without: Vec<f64>,
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
        let without: Vec<Side> = (0..told.concluded.fit.placed.len()).map(|k| Side::without(told, &library, k)).collect();
        let one = |channel: &usize| {
            let target = flight.channels.targets[*channel];
            let at = rows.channels.position(target)?;
            let seen = &rows.channels.channels[at];
            let error = |predicted: &[f64]| rms(&seen.y.iter().zip(predicted).map(|(y, p)| y - p).collect::<Vec<f64>>());
            let held = |side: &Side| error(&side.held_out(&seen.t, at));
            let floor = told.problem.channels[*channel].floor.max(flight.windows.floor_of_row(&flight.record.logged(target)));
            let before = [error(&sides[0].whole(at, seen.len())), held(&sides[0])];
            let after = [error(&written[at]), held(&sides[1])];
            Some(By { channel: *channel, floor, before, after, without: without.iter().map(held).collect() })
        };
        Self { of: wanted.iter().filter_map(one).collect() }
    }

    /// The term without which a channel that all of them together make worse is predicted best, if one is.
    pub(super) fn makes_worse(&self, kept: &[Kept]) -> Option<usize> {
        let touches =
            |k: usize, c: usize| kept.iter().any(|kept| kept.place == k && kept.channels.iter().any(|(own, _)| *own == c));
        self.of.iter().filter(|by| by.after[1] > (1.0 + WORSE) * by.before[1]).find_map(|by| {
            let open = (0..by.without.len()).filter(|k| touches(*k, by.channel) && by.without[*k] < by.after[1]);
            open.min_by(|a, b| by.without[*a].total_cmp(&by.without[*b]))
        })
    }

    /// A term with what it removes from the channels that it changes, of these as it is told by row.
    pub(super) fn told_by_row(&self, kept: &Kept) -> Kept {
        let removed = |(c, by_window): &(usize, f64)| {
            let by_row =
                self.of.iter().find(|by| by.channel == *c).and_then(|by| Some(1.0 - by.after[1] / by.without.get(kept.place)?));
            (*c, by_row.filter(|share| share.is_finite()).unwrap_or(*by_window))
        };
        let mut channels: Vec<(usize, f64)> = kept.channels.iter().map(removed).collect();
        channels.sort_by(|a, b| b.1.total_cmp(&a.1));
        Kept { channels, ..kept.clone() }
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

    /// The hypothesis without the term at `place`, with the weighting that is fair to it.
    fn without(told: &Told<'_>, library: &FlightLibrary<'_>, place: usize) -> Self {
        let fit = &told.concluded.fit;
        let placed: Vec<Placed> = fit.placed.iter().enumerate().filter(|(k, _)| *k != place).map(|(_, p)| p.clone()).collect();
        let noise = told.concluded.weighting_without.get(place).unwrap_or(&fit.noise);
        let folds = folds(&told.problem, &placed, noise, false).unwrap_or_default();
        let design = library.design(&placed);
        // every row lies in a block
        let amplitudes = vec![f64::NAN; design.columns.len()];
        Self { folds: folds.into_iter().map(|f| (f, design.clone())).collect(), design, amplitudes }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Two terms on two speeds; the second makes one of them worse.
    #[test]
    fn a_term_that_makes_a_speed_worse_goes_and_what_it_removes_is_told_by_row() {
        let by = |channel, after, without: [f64; 2]| By {
            channel,
            floor: 1.0,
            before: [100.0; 2],
            after: [after; 2],
            without: without.to_vec(),
        };
        let kept = |place, on: &[usize]| Kept {
            place,
            probability: 1.0,
            lead: 9.0,
            channels: on.iter().map(|c| (*c, 0.9)).collect(),
            rivals: Vec::new(),
        };
        let rows = Rows { of: vec![by(4, 50.0, [100.0, 50.0]), by(5, 150.0, [160.0, 90.0])] };
        assert_eq!(rows.makes_worse(&[kept(0, &[4, 5]), kept(1, &[5])]), Some(1));
        // one that does not touch it is not blamed, nor is a channel within the two per cent
        assert_eq!(rows.makes_worse(&[kept(0, &[4, 5]), kept(1, &[4])]), None);
        assert_eq!(Rows { of: vec![by(5, 101.9, [160.0, 90.0])] }.makes_worse(&[kept(1, &[5])]), None);
        let told = rows.told_by_row(&kept(0, &[5, 4, 7]));
        assert_eq!(told.channels, [(7, 0.9), (4, 0.5), (5, 1.0 - 150.0 / 160.0)]);
    }
}
