//! Earth frames.
//!
//! What it is: the choice of earth axes, and the fixed turn from the filter's north-east-down into each.
//! What can go wrong: nothing; all three are right-handed.
//! Units: none.
//! Reference: specification `ahrs.md`, "Attitude": yaw is the compass heading in NED, the angle of body x counter-clockwise
//! from east in ENU.

use crate::Mat3;

/// Earth axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Earth {
    /// North, east, down.
    #[default]
    Ned,
    /// East, north, up.
    Enu,
    /// North, west, up.
    Nwu,
}

impl Earth {
    /// A rotation body to NED as a rotation from the same body axes to this frame.
    #[must_use]
    pub fn from_ned(self, ned: &Mat3) -> Mat3 {
        let (n, e, d) = (ned.row(0), ned.row(1), ned.row(2));
        match self {
            Self::Ned => *ned,
            Self::Enu => Mat3::from_rows(&[e.clone_owned(), n.clone_owned(), -d]),
            Self::Nwu => Mat3::from_rows(&[n.clone_owned(), -e, -d]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Euler, Vec3, euler_of, matrix_of};

    /// A body with axes forward, left, up that points 30 degrees east of north: in ENU its x axis lies 60 degrees from east.
    #[test]
    fn yaw_is_a_compass_heading_in_ned_and_counts_from_east_in_enu() {
        let frd = matrix_of(&Euler { roll: 0.0, pitch: 0.0, yaw: 30f32.to_radians() });
        assert!((euler_of(&Earth::Ned.from_ned(&frd)).yaw.to_degrees() - 30.0).abs() < 1e-3);
        let flu = frd * Mat3::from_diagonal(&Vec3::new(1.0, -1.0, -1.0));
        let enu = euler_of(&Earth::Enu.from_ned(&flu));
        assert!((enu.yaw.to_degrees() - 60.0).abs() < 1e-3 && enu.roll.abs() < 1e-6, "{enu:?}");
        let nwu = euler_of(&Earth::Nwu.from_ned(&flu));
        assert!((nwu.yaw.to_degrees() + 30.0).abs() < 1e-3 && nwu.roll.abs() < 1e-6, "{nwu:?}");
    }

    #[test]
    fn every_frame_is_right_handed() {
        for earth in [Earth::Ned, Earth::Enu, Earth::Nwu] {
            assert!((crate::linear::determinant(&earth.from_ned(&Mat3::identity())) - 1.0).abs() < 1e-6);
        }
    }
}
