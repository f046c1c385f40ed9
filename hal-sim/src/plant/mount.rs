//! The joints of the rig: the motor's mount on the beam and the bearing of the torque arm.
//!
//! What it is: a mount that works loose with the revolutions that shake it and so tilts the thrust axis and softens the beam, and
//! dry friction in the torque arm's bearing.
//! What can go wrong: nothing here fails; the tilt stays below its end stop.
//! Units: deg, revolutions, N.m, 1.
//! Reference: Junker 1969, self-loosening of bolted joints under transverse vibration (preload falls with the number of cycles);
//! Jenkins element for dry friction.

/// Parameters. The default joints are tight and free.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mount {
    /// Tilt of the loose mount against its end stop, deg.
    pub tilt_deg: f64,
    /// Revolutions in which 63 % of the preload is lost.
    pub life_rev: f64,
    /// Moment that the torque arm's bearing holds back before it slips, N.m.
    pub arm_friction_nm: f64,
}

/// State of the joints.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MountState {
    loose: f64,
    torque_nm: f64,
    stuck_nm: f64,
}

impl MountState {
    /// `revolutions` more have shaken the mount.
    pub fn shake(&mut self, mount: &Mount, revolutions: f64) {
        if mount.tilt_deg != 0.0 {
            self.loose += (1.0 - self.loose) * (revolutions / mount.life_rev).min(1.0);
        }
    }

    /// Lift and torque about the beam's own axes when the rotor gives `thrust_n` and `torque_nm` about its own.
    #[must_use]
    pub fn tilted(&self, mount: &Mount, thrust_n: f64, torque_nm: f64, length_m: f64) -> (f64, f64) {
        if self.loose == 0.0 {
            return (thrust_n, torque_nm);
        }
        let (s, c) =
            (libm::sin((mount.tilt_deg * self.loose).to_radians()), libm::cos((mount.tilt_deg * self.loose).to_radians()));
        (thrust_n * c + torque_nm * s / length_m, torque_nm * c - thrust_n * s * length_m)
    }

    /// What the torque arm passes on of `torque_nm`.
    pub fn arm(&mut self, mount: &Mount, torque_nm: f64) -> f64 {
        if mount.arm_friction_nm == 0.0 {
            return torque_nm;
        }
        self.stuck_nm = (self.stuck_nm + torque_nm - self.torque_nm).clamp(-mount.arm_friction_nm, mount.arm_friction_nm);
        self.torque_nm = torque_nm;
        torque_nm - self.stuck_nm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mount_works_loose_and_tilts() {
        let mount = Mount { tilt_deg: 5.0, life_rev: 1000.0, ..Mount::default() };
        let mut s = MountState::default();
        assert_eq!(s.tilted(&mount, 5.0, 0.1, 0.115), (5.0, 0.1));
        for _ in 0..100_000 {
            s.shake(&mount, 0.1);
        }
        let (lift, torque) = s.tilted(&mount, 5.0, 0.1, 0.115);
        assert!((lift - (5.0 * 0.996_195 + 0.1 * 0.087_156 / 0.115)).abs() < 1e-3, "{lift}");
        assert!((torque - (0.1 * 0.996_195 - 5.0 * 0.087_156 * 0.115)).abs() < 1e-3, "{torque}");
    }

    #[test]
    fn the_arm_sticks_both_ways() {
        let mount = Mount { arm_friction_nm: 0.01, ..Mount::default() };
        let mut s = MountState::default();
        let up: Vec<f64> = (0..=10).map(|i| s.arm(&mount, 0.01 * f64::from(i))).collect();
        let down: Vec<f64> = (0..=10).rev().map(|i| s.arm(&mount, 0.01 * f64::from(i))).collect();
        assert!((up[10] - 0.09).abs() < 1e-12 && (down[5] - up[5] - 0.02).abs() < 1e-12);
    }
}
