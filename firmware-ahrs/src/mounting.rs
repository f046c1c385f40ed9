//! How the chips sit on the body.
//!
//! What it is: for each sensor, which chip axis, with which sign, points along body x, y and z.
//! What can go wrong: a left-handed or repeating choice would mirror the attitude; it is refused.
//! Units: counts in, counts out; the lowest word, whose negative does not exist, becomes the highest.
//! Reference: body axes FRD (x forward, y right, z down); Beharie 2013 Eq. E.1 with errata (sign of the mounting).

/// One chip axis with a sign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Axis {
    /// Along chip x.
    PosX,
    /// Against chip x.
    NegX,
    /// Along chip y.
    PosY,
    /// Against chip y.
    NegY,
    /// Along chip z.
    PosZ,
    /// Against chip z.
    NegZ,
}

impl Axis {
    const fn parts(self) -> (usize, i32) {
        match self {
            Self::PosX => (0, 1),
            Self::NegX => (0, -1),
            Self::PosY => (1, 1),
            Self::NegY => (1, -1),
            Self::PosZ => (2, 1),
            Self::NegZ => (2, -1),
        }
    }
}

/// Chip axes along body x, y and z; one of the 24 right-handed choices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Mounting([Axis; 3]);

impl Mounting {
    /// Chip x forward, chip y left, chip z up: the board lies flat, its parts on top.
    pub const FLAT: Self = Self([Axis::PosX, Axis::NegY, Axis::NegZ]);

    /// A mounting from the chip axes along body x, y and z; `None` when they repeat or are left-handed.
    #[must_use]
    pub const fn new(axes: [Axis; 3]) -> Option<Self> {
        let [(x, sx), (y, sy), (z, sz)] = [axes[0].parts(), axes[1].parts(), axes[2].parts()];
        if x == y || y == z || x == z {
            return None;
        }
        // an even permutation of three is a rotation of (0, 1, 2)
        let even = (x + 1) % 3 == y;
        let sign = sx * sy * sz * if even { 1 } else { -1 };
        if sign == 1 { Some(Self(axes)) } else { None }
    }

    /// Turns words in chip axes into words in body axes.
    #[must_use]
    pub fn to_body(&self, chip: [i16; 3]) -> [i16; 3] {
        self.0.map(|axis| {
            let (index, sign) = axis.parts();
            let word = chip.get(index).copied().unwrap_or(0);
            if sign < 0 { word.checked_neg().unwrap_or(i16::MAX) } else { word }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    const ALL: [Axis; 6] = [Axis::PosX, Axis::NegX, Axis::PosY, Axis::NegY, Axis::PosZ, Axis::NegZ];

    #[test]
    fn exactly_the_24_right_handed_mountings_exist() {
        let mut n = 0;
        for a in ALL {
            for b in ALL {
                for c in ALL {
                    let Some(m) = Mounting::new([a, b, c]) else { continue };
                    n += 1;
                    // columns e1 x e2 = e3 after the remap
                    let [x, y, z] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(|e| m.to_body(e));
                    let cross = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
                    assert_eq!(cross, z);
                }
            }
        }
        assert_eq!(n, 24);
    }

    #[test]
    fn flat_is_allowed_and_turns_y_and_z() {
        assert_eq!(Mounting::new([Axis::PosX, Axis::NegY, Axis::NegZ]), Some(Mounting::FLAT));
        assert_eq!(Mounting::FLAT.to_body([1, 2, 3]), [1, -2, -3]);
    }

    #[test]
    fn the_lowest_word_stays_at_the_rail() {
        assert_eq!(Mounting::FLAT.to_body([i16::MIN; 3]), [i16::MIN, i16::MAX, i16::MAX]);
    }

    #[test]
    fn a_board_turned_about_the_vertical_has_x_and_y_backwards() {
        let turned = Mounting::new([Axis::NegX, Axis::NegY, Axis::PosZ]).unwrap();
        assert_eq!(turned.to_body([1, 2, 3]), [-1, -2, 3]);
    }
}
