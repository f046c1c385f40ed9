//! What a log says of a reading that is not nominal.
//!
//! What it is: a number and a few words for each verdict of either kind of channel. In a log the number stands in the column
//! `<channel>_flag`, which is empty where the reading is nominal, where the rotor stands, and where nothing is fitted.
//! What can go wrong: a number that this version does not know has no words; it still says "not nominal".
//! Units: none. Numbers and not words, because every field of a log is a number: any reader of such tables takes it.
//! Reference: specification `formats.md`, "Rig log".

use crate::esc::EscVerdict;
use crate::rig::{AdcVerdict, CaptureVerdict};

/// End of the name of a column of flags, after the name of its channel.
pub const FLAG_SUFFIX: &str = "_flag";

/// A reading that is not nominal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Flag {
    /// Number in a log.
    pub code: u8,
    /// The same in words, for people.
    pub words: &'static str,
}

impl Flag {
    const LOST: Self = Self { code: 2, words: "lost" };
    const OVERWRITTEN: Self = Self { code: 3, words: "edge overwritten" };
    const MISSED: Self = Self { code: 4, words: "mark missed" };
    const DOUBLED: Self = Self { code: 5, words: "mark seen twice" };
    const ALTERNATING: Self = Self { code: 6, words: "periods alternate" };
    const DISAGREES: Self = Self { code: 7, words: "disagrees" };
    const TWIST: Self = Self { code: 9, words: "blade twist" };
    const SATURATED: Self = Self { code: 11, words: "saturated" };
    const OPEN: Self = Self { code: 12, words: "open" };
    const MISSING: Self = Self { code: 13, words: "no conversion" };
    const SHORT: Self = Self { code: 14, words: "short" };
    const SILENT: Self = Self { code: 21, words: "nothing heard" };
    const GARBLED: Self = Self { code: 22, words: "no frame checks" };

    /// Every flag, by its number: those of speed sensors below 10, of analogue channels below 20, of the ESC's telemetry above.
    pub const ALL: [Self; 13] = [
        Self::LOST,
        Self::OVERWRITTEN,
        Self::MISSED,
        Self::DOUBLED,
        Self::ALTERNATING,
        Self::DISAGREES,
        Self::TWIST,
        Self::SATURATED,
        Self::OPEN,
        Self::MISSING,
        Self::SHORT,
        Self::SILENT,
        Self::GARBLED,
    ];

    /// The flag of a number; `None` of one that this version does not know.
    #[must_use]
    pub fn of(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|flag| flag.code == code)
    }
}

impl CaptureVerdict {
    /// What a log says of it; `None` of a nominal reading, of a rotor that stands, and of a channel that is not fitted.
    #[must_use]
    pub const fn flag(self) -> Option<Flag> {
        match self {
            Self::Nominal | Self::Stopped | Self::Absent => None,
            Self::Lost => Some(Flag::LOST),
            Self::OverCapture => Some(Flag::OVERWRITTEN),
            Self::Missed => Some(Flag::MISSED),
            Self::Doubled => Some(Flag::DOUBLED),
            Self::Alternating => Some(Flag::ALTERNATING),
            Self::Disagrees => Some(Flag::DISAGREES),
            Self::BladeTwist => Some(Flag::TWIST),
        }
    }
}

impl AdcVerdict {
    /// What a log says of it; `None` of a nominal reading and of a channel that is not fitted.
    #[must_use]
    pub const fn flag(self) -> Option<Flag> {
        match self {
            Self::Nominal | Self::Absent => None,
            Self::Saturated => Some(Flag::SATURATED),
            Self::Open => Some(Flag::OPEN),
            Self::Missing => Some(Flag::MISSING),
            Self::Short => Some(Flag::SHORT),
        }
    }
}

impl EscVerdict {
    /// What a log says of it; `None` of a frame that checked.
    #[must_use]
    pub const fn flag(self) -> Option<Flag> {
        match self {
            Self::Nominal => None,
            Self::Silent => Some(Flag::SILENT),
            Self::Garbled => Some(Flag::GARBLED),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A log is read years later: a number keeps its meaning, and no two verdicts share one.
    #[test]
    fn every_verdict_that_is_not_nominal_has_a_number_of_its_own() {
        assert!(Flag::ALL.windows(2).all(|w| w[0].code < w[1].code));
        assert!(Flag::ALL.iter().all(|flag| Flag::of(flag.code) == Some(*flag) && !flag.words.is_empty()));
        use {AdcVerdict as A, CaptureVerdict as C, EscVerdict as E};
        let captures = [C::Lost, C::OverCapture, C::Missed, C::Doubled, C::Alternating, C::Disagrees, C::BladeTwist];
        let analogue = [A::Saturated, A::Open, A::Missing, A::Short];
        let told = captures.iter().map(|v| v.flag()).chain(analogue.iter().map(|v| v.flag()));
        let told = told.chain([E::Silent, E::Garbled].iter().map(|v| v.flag()));
        assert!(told.eq(Flag::ALL.into_iter().map(Some)));
        assert!([C::Nominal, C::Stopped, C::Absent].iter().all(|v| v.flag().is_none()));
        assert!([A::Nominal, A::Absent].iter().all(|v| v.flag().is_none()) && E::Nominal.flag().is_none());
        assert_eq!(Flag::of(0), None);
    }
}
