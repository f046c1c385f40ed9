//! The body that the chips sit on: one that moves in closed form, or one that flies.
//!
//! What it is: [`Body`] is what a chip asks; [`Aboard`] is the place of the board in a vehicle, into which the flight writes what is felt
//! there, one entry a millisecond, and from which any number of chips read.
//! What can go wrong: before the first entry the board lies level at rest; an instant that the flight has not come to has the last entry.
//! Units: as [`Motion`]; ns since power-up of the board.
//! Reference: specification `flight.md`, "Missions"; errata 4.3 (specific force).

use super::motion::Motion;
use std::collections::VecDeque;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// What is felt at the board at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Felt {
    /// Rotation body to earth.
    pub attitude: [[f64; 3]; 3],
    /// Rate, body axes, rad/s.
    pub rate: [f64; 3],
    /// Specific force, body axes, g.
    pub force: [f64; 3],
    /// Place, earth NED, m.
    pub place: [f64; 3],
}

impl Felt {
    /// Level, at rest, nose to the north.
    pub const LEVEL: Self = Self {
        attitude: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        rate: [0.0; 3],
        force: [0.0, 0.0, -1.0],
        place: [0.0; 3],
    };

    /// A share of the way to another. Attitudes a millisecond apart lie on a straight line within the square of their angle.
    fn towards(&self, other: &Self, share: f64) -> Self {
        let line = |a: [f64; 3], b: [f64; 3]| core::array::from_fn(|i| a[i] + share * (b[i] - a[i]));
        Self {
            attitude: core::array::from_fn(|r| line(self.attitude[r], other.attitude[r])),
            rate: line(self.rate, other.rate),
            force: line(self.force, other.force),
            place: line(self.place, other.place),
        }
    }
}

/// The entries, one a millisecond.
#[derive(Debug, Default)]
struct Track {
    /// Millisecond of the first.
    first: u64,
    felt: VecDeque<Felt>,
    /// Entries that are kept; all, where the board comes later.
    kept: usize,
}

/// A board in a vehicle.
#[derive(Debug, Clone)]
pub struct Aboard {
    field: [f64; 3],
    track: Arc<RwLock<Track>>,
}

impl Aboard {
    /// A board in a field (earth NED, gauss) that reads as the flight goes.
    #[must_use]
    pub fn live(field: [f64; 3]) -> Self {
        Self { field, track: Arc::new(RwLock::new(Track { kept: 2, ..Track::default() })) }
    }

    /// The same, for a board that is run over the flight afterwards.
    #[must_use]
    pub fn recorded(field: [f64; 3]) -> Self {
        Self { field, track: Arc::new(RwLock::new(Track { kept: usize::MAX, ..Track::default() })) }
    }

    fn reading(&self) -> RwLockReadGuard<'_, Track> {
        self.track.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn writing(&self) -> RwLockWriteGuard<'_, Track> {
        self.track.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// What is felt in the next millisecond.
    pub fn feel(&self, felt: Felt) {
        let mut track = self.writing();
        track.felt.push_back(felt);
        if track.felt.len() > track.kept {
            track.felt.pop_front();
            track.first += 1;
        }
    }

    /// What is felt at an instant: on the straight line between two entries, the n-th of which (from 1) is of the end of millisecond n.
    #[must_use]
    pub fn at(&self, at_ns: u64) -> Felt {
        let track = self.reading();
        let Some(last) = track.felt.len().checked_sub(1) else { return Felt::LEVEL };
        let since = at_ns.saturating_sub(1_000_000 * (track.first + 1));
        let before = ((since / 1_000_000) as usize).min(last);
        let share = if before == last { 0.0 } else { (since % 1_000_000) as f64 * 1.0e-6 };
        track.felt[before].towards(&track.felt[(before + 1).min(last)], share)
    }
}

impl PartialEq for Aboard {
    /// The same board, not one that feels the same.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.track, &other.track)
    }
}

/// What a chip sits on.
#[derive(Debug, Clone, PartialEq)]
pub enum Body {
    /// Moves in closed form.
    Alone(Motion),
    /// Flies.
    Aboard(Aboard),
}

impl From<Motion> for Body {
    fn from(motion: Motion) -> Self {
        Self::Alone(motion)
    }
}

impl From<Aboard> for Body {
    fn from(aboard: Aboard) -> Self {
        Self::Aboard(aboard)
    }
}

/// A vector in earth axes as a body of this attitude has it.
fn to_body(attitude: &[[f64; 3]; 3], earth: [f64; 3]) -> [f64; 3] {
    core::array::from_fn(|j| (0..3).map(|i| attitude[i][j] * earth[i]).sum())
}

impl Body {
    /// Rate, body axes, rad/s.
    #[must_use]
    pub fn rate(&self, at_ns: u64) -> [f64; 3] {
        match self {
            Self::Alone(motion) => motion.rate(at_ns),
            Self::Aboard(aboard) => aboard.at(at_ns).rate,
        }
    }

    /// Specific force at the board, body axes, g.
    #[must_use]
    pub fn force(&self, at_ns: u64) -> [f64; 3] {
        match self {
            Self::Alone(motion) => motion.force(at_ns),
            Self::Aboard(aboard) => aboard.at(at_ns).force,
        }
    }

    /// Field in body axes, gauss.
    #[must_use]
    pub fn magnetic(&self, at_ns: u64) -> [f64; 3] {
        match self {
            Self::Alone(motion) => motion.magnetic(at_ns),
            Self::Aboard(aboard) => to_body(&aboard.at(at_ns).attitude, aboard.field),
        }
    }

    /// A vector in earth axes as the body has it.
    #[must_use]
    pub fn to_body(&self, at_ns: u64, earth: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Alone(motion) => motion.to_body(at_ns, earth),
            Self::Aboard(aboard) => to_body(&aboard.at(at_ns).attitude, earth),
        }
    }

    /// Where it is, earth NED, m.
    #[must_use]
    pub fn place(&self, at_ns: u64) -> [f64; 3] {
        match self {
            Self::Alone(motion) => motion.place(at_ns),
            Self::Aboard(aboard) => aboard.at(at_ns).place,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(north: f64) -> Felt {
        Felt { place: [north, 0.0, 0.0], ..Felt::LEVEL }
    }

    #[test]
    fn a_live_board_has_the_last_millisecond_and_a_recorded_one_each() {
        for (aboard, first, between) in [(Aboard::live([0.2, 0.0, 0.4]), 4.0, 4.0), (Aboard::recorded([0.2, 0.0, 0.4]), 1.0, 2.5)]
        {
            assert_eq!(aboard.at(5_000_000), Felt::LEVEL);
            (1..=5).for_each(|ms| aboard.feel(at(f64::from(ms))));
            let body = Body::from(aboard);
            let places = [0, 2_500_000, 4_000_000, 5_000_000, 99_000_000].map(|ns| body.place(ns)[0]);
            assert_eq!(places, [first, between, 4.0, 5.0, 5.0]);
        }
    }

    /// A quarter turn to the right: north is to the left of the body.
    #[test]
    fn the_field_turns_with_the_body() {
        let aboard = Aboard::live([0.2, 0.0, 0.4]);
        aboard.feel(Felt { attitude: [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], ..Felt::LEVEL });
        assert_eq!(Body::from(aboard).magnetic(0), [0.0, -0.2, 0.4]);
    }
}
