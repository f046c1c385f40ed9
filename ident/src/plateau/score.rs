//! How well a detector of plateaus did, against the truth.
//!
//! What it is: the share of true plateaus that were found, the error of the means in standard errors, and the plateaus that are none.
//! What can go wrong: nothing; an empty truth scores nothing.
//! Units: shares; standard errors.
//! Reference: specification `identification.md`, items 1 and 2.

/// A true plateau: its rows, settling included, and the settled value of every row of the scored channel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Truth {
    /// First row at this level.
    pub from: usize,
    /// First row that has certainly settled: what a detector must cover is counted from here. A simulator's truth, whose settling is
    /// short, counts every row.
    pub settled: usize,
    /// Row after the last.
    pub to: usize,
}

/// A found plateau: its rows, the mean of the scored channel and its standard error.
#[derive(Debug, Clone, Copy)]
pub struct Found {
    /// First row.
    pub from: usize,
    /// Row after the last.
    pub to: usize,
    /// Mean.
    pub mean: f64,
    /// Standard error.
    pub se: f64,
}

/// The score.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Score {
    /// True plateaus.
    pub truths: usize,
    /// Those of them that one found plateau covers by at least a third of the settled rows, without reaching into another level.
    pub found: usize,
    /// Found with a mean within three standard errors of the truth.
    pub within: usize,
    /// Found plateaus that lie across levels, or are a second piece of one.
    pub wrong: usize,
    /// Sum of squared errors of the means of what was found.
    pub squares: f64,
}

impl Score {
    /// Scores one run; `level` is the settled, noiseless value of the channel on each row.
    #[must_use]
    pub fn of(truths: &[Truth], level: &[f64], found: &[Found]) -> Self {
        let mut score = Self { truths: truths.len(), ..Self::default() };
        let mut taken = vec![false; truths.len()];
        for f in found {
            // the rows of a step itself, one on either side, belong to nobody
            let inside = truths.iter().position(|t| f.from + 1 >= t.from && f.to <= t.to + 1);
            match inside {
                Some(k)
                    if !taken[k]
                        && 3 * (f.to.min(truths[k].to).saturating_sub(f.from.max(truths[k].settled)))
                            >= truths[k].to - truths[k].settled =>
                {
                    taken[k] = true;
                    score.found += 1;
                    let rows = &level[f.from..f.to];
                    let error = f.mean - rows.iter().sum::<f64>() / rows.len() as f64;
                    score.within += usize::from(error.abs() <= 3.0 * f.se);
                    score.squares += if error.is_finite() { error * error } else { 0.0 };
                }
                _ => score.wrong += 1,
            }
        }
        score
    }

    /// Adds another run's.
    pub fn add(&mut self, other: Self) {
        self.truths += other.truths;
        self.found += other.found;
        self.within += other.within;
        self.wrong += other.wrong;
        self.squares += other.squares;
    }

    /// Share of the true plateaus that were found with a mean within three standard errors.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.within as f64 / self.truths.max(1) as f64
    }

    /// Root mean square error of the means of what was found.
    #[must_use]
    pub fn rms(&self) -> f64 {
        (self.squares / self.found.max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_and_bridges_are_wrong() {
        let truths = [Truth { from: 0, settled: 0, to: 100 }, Truth { from: 100, settled: 100, to: 200 }];
        let level: Vec<f64> = (0..200).map(|i| if i < 100 { 1.0 } else { 2.0 }).collect();
        let at = |from, to, mean| Found { from, to, mean, se: 0.01 };
        let s = Score::of(&truths, &level, &[at(5, 60, 1.0), at(62, 99, 1.0), at(90, 150, 1.5), at(110, 200, 2.1)]);
        assert_eq!((s.found, s.within, s.wrong), (2, 1, 2));
    }
}
