//! What is known of each run of a rig.
//!
//! What it is: a measure (name, unit, how it is compared) and its value with a standard error.
//! What can go wrong: a value that is a rate or a size is compared by its logarithm, and must be above zero.
//! Units: stated on each.
//! Reference: none.

use serde::Serialize;

/// How values are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// By their difference.
    Linear,
    /// By their quotient: noise floors, steps of the last digit.
    Log,
    /// Shares of rows that were counted, by their square roots: those scatter alike whatever the share (Bartlett 1936, J. R. Stat. Soc. Suppl.
    /// 3:68), and a share of nothing is known as well as any other.
    Count,
}

impl Scale {
    /// A value from the scale on which it is compared back to the measure's own unit.
    #[must_use]
    pub fn back(self, compared: f64) -> f64 {
        match self {
            Self::Linear => compared,
            Self::Log => compared.exp(),
            Self::Count => compared.max(0.0).powi(2),
        }
    }
}

/// Something that each run tells of its rig.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measure {
    /// Name: `thrust_n gain`, `k_T`.
    pub name: String,
    /// In words: "gain of thrust".
    pub words: String,
    /// Unit.
    pub unit: String,
    /// How its values are compared.
    pub scale: Scale,
    /// Channel that it is of; empty for a constant of several.
    pub channel: String,
    /// Whether it is how two channels differ: it speaks for neither of them alone.
    #[serde(skip)]
    pub of_two: bool,
    /// Whether a change of it counts. What is made up of others is shown and does not.
    pub asked: bool,
    /// Whether it is about the surroundings of a day, which explain others and are no part of the rig.
    pub of_day: bool,
}

/// A value with its standard error, in the measure's unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Value {
    /// The value.
    pub value: f64,
    /// Standard error.
    pub se: f64,
}

impl Value {
    /// Value and standard error on the scale on which a measure is compared.
    #[must_use]
    pub fn compared(self, scale: Scale) -> Self {
        match scale {
            Scale::Linear => self,
            Scale::Log => {
                let v = self.value.max(f64::MIN_POSITIVE);
                Self { value: v.ln(), se: self.se / v }
            }
            Scale::Count => {
                let root = self.value.max(f64::MIN_POSITIVE).sqrt();
                Self { value: root, se: self.se / (2.0 * root) }
            }
        }
    }

    /// Half the width of the 95 % interval.
    #[must_use]
    pub fn half(self) -> f64 {
        1.96 * self.se
    }
}
