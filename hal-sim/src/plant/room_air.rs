//! The air of the room that the rotor itself sets moving.
//!
//! What it is: the wake comes back to the rotor's inlet as a draught that follows the induced velocity with the time that the
//! room takes to turn over; axial inflow takes lift from the blades and, less so, torque.
//! What can go wrong: nothing a run could notice; the draught stays a share of the induced velocity.
//! Units: m/s, s, 1.
//! Reference: momentum theory, Leishman 2006, *Principles of Helicopter Aerodynamics*, 2.3 (induced velocity) and 3.3 (thrust falls
//! linearly with inflow: dC_T = -sigma a/4 d lambda).

use core::f64::consts::TAU;

/// Parameters. The default room is large.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoomAir {
    /// Draught at the inlet as a share of the induced velocity; 0 for a large room.
    pub share: f64,
    /// Turn-over time of the room, s.
    pub tau_s: f64,
    /// Radius of the rotor, m.
    pub radius_m: f64,
}

impl Default for RoomAir {
    fn default() -> Self {
        Self { share: 0.0, tau_s: 30.0, radius_m: 0.1397 }
    }
}

/// Slope of thrust with the inflow ratio, relative: a/4 sigma over C_T with a = 5.7, sigma = 0.07, C_T = 0.0105.
const THRUST_SLOPE: f64 = 9.5;
/// The same of torque: induced and profile parts cancel in part.
const TORQUE_SLOPE: f64 = 3.0;

/// State: the draught, m/s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Draught(f64);

impl Draught {
    /// One step with `thrust_n` at `speed` rad/s in air of `density`; gives the factors on thrust and torque.
    pub fn step(&mut self, room: &RoomAir, thrust_n: f64, speed: f64, density: f64, dt_s: f64) -> (f64, f64) {
        if room.share == 0.0 {
            return (1.0, 1.0);
        }
        let area = 0.5 * TAU * room.radius_m * room.radius_m;
        let induced = (thrust_n.max(0.0) / (2.0 * density * area)).sqrt();
        self.0 += (room.share * induced - self.0) * (dt_s / room.tau_s).min(1.0);
        let ratio = self.0 / (speed * room.radius_m).max(5.0);
        ((1.0 - THRUST_SLOPE * ratio).max(0.3), (1.0 - TORQUE_SLOPE * ratio).max(0.3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_draught_builds_up_to_its_share_of_the_induced_velocity() {
        let room = RoomAir { share: 0.1, tau_s: 2.0, ..RoomAir::default() };
        let mut d = Draught::default();
        let factors = (0..20_000).map(|_| d.step(&room, 5.8, 610.0, 1.225, 1e-3)).last().unwrap();
        // 5.8 N on 0.0613 m^2: 6.2 m/s induced
        assert!((d.0 - 0.621).abs() < 0.005, "{}", d.0);
        assert!((factors.0 - (1.0 - 9.5 * d.0 / (610.0 * 0.1397))).abs() < 1e-9);
        assert!(factors.1 > factors.0);
        assert_eq!(Draught::default().step(&RoomAir::default(), 5.8, 610.0, 1.225, 1e-3), (1.0, 1.0));
    }
}
