//! The last minutes of a channel.
//!
//! What it is: means of a second each, the newest last.
//! What can go wrong: a clock that begins anew begins a new trend.
//! Units: s of the board's time; the channel's.
//! Reference: specification `rig.md`, "The operator's side": every channel with its bar and trend.

use std::collections::VecDeque;

/// Seconds that are kept: more than any terminal is wide.
const KEPT: usize = 400;

/// Means of the seconds.
#[derive(Debug, Clone, Default)]
pub(crate) struct Trend {
    seconds: VecDeque<(u64, f64, u32)>,
}

impl Trend {
    /// Takes a value at a time.
    pub(crate) fn take(&mut self, t_s: f64, value: f64) {
        let second = t_s.max(0.0) as u64;
        match self.seconds.back_mut() {
            Some((last, mean, n)) if *last == second => {
                *n += 1;
                *mean += (value - *mean) / f64::from(*n);
            }
            Some((last, ..)) if *last > second => {
                self.seconds.clear();
                self.seconds.push_back((second, value, 1));
            }
            _ => self.seconds.push_back((second, value, 1)),
        }
        if self.seconds.len() > KEPT {
            self.seconds.pop_front();
        }
    }

    /// The last `width` seconds, oldest first; `None` where nothing was read.
    pub(crate) fn last(&self, width: usize) -> Vec<Option<f64>> {
        let Some((newest, ..)) = self.seconds.back() else { return vec![None; width] };
        let from = (newest + 1).saturating_sub(width as u64);
        let mut out = vec![None; width];
        for (second, mean, _) in self.seconds.iter().filter(|(second, ..)| *second >= from) {
            let place = width as u64 - (newest + 1 - second);
            if let Some(cell) = out.get_mut(place as usize) {
                *cell = Some(*mean);
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_is_the_mean_of_a_second_and_a_gap_stays_one() {
        let mut trend = Trend::default();
        for (t, v) in [(0.1, 1.0), (0.9, 3.0), (1.5, 4.0), (4.2, 5.0)] {
            trend.take(t, v);
        }
        assert_eq!(trend.last(6), [None, Some(2.0), Some(4.0), None, None, Some(5.0)]);
        assert_eq!(trend.last(2), [None, Some(5.0)]);
        trend.take(0.2, 9.0);
        assert_eq!(trend.last(2), [None, Some(9.0)], "the board was reset");
        assert_eq!(Trend::default().last(2), [None, None]);
    }
}
