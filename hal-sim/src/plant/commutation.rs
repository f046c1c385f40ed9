//! Loss of commutation.
//!
//! What it is: a surge of winding current beyond what the ESC's zero-crossing detection follows makes it lose the rotor's angle;
//! it lets the motor coast for a while and then drives again.
//! What can go wrong: a limit below the steady current would stutter without end; it is only judged against the current's rise
//! above its own mean of the last tenth of a second.
//! Units: A, s.
//! Reference: Hendershot & Miller 2010, *Design of Brushless Permanent-Magnet Machines*, section 9.5 (sensorless commutation).

/// Parameters. The default ESC never loses the rotor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Commutation {
    /// Surge of winding current above its mean of the last tenth of a second that is too much, A.
    pub surge_a: f64,
    /// How long the motor then coasts, s.
    pub coast_s: f64,
}

impl Default for Commutation {
    fn default() -> Self {
        Self { surge_a: f64::INFINITY, coast_s: 0.0 }
    }
}

/// Time over which the current is averaged, s.
const MEAN_S: f64 = 0.1;

/// State.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CommutationState {
    mean_a: f64,
    coast_s: f64,
}

impl CommutationState {
    /// One step with `current_a` in the winding; whether the motor is driven.
    pub fn step(&mut self, commutation: &Commutation, current_a: f64, dt_s: f64) -> bool {
        if commutation.surge_a == f64::INFINITY {
            return true;
        }
        if self.coast_s > 0.0 {
            self.coast_s -= dt_s;
            return self.coast_s <= 0.0;
        }
        if current_a > self.mean_a + commutation.surge_a {
            self.coast_s = commutation.coast_s;
            // the restart is soft: its own surge counts as known
            self.mean_a = current_a;
            return false;
        }
        self.mean_a += (current_a - self.mean_a) * (dt_s / MEAN_S).min(1.0);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surge_makes_it_coast_once() {
        let c = Commutation { surge_a: 3.0, coast_s: 0.05 };
        let mut s = CommutationState::default();
        assert!((0..1000).all(|_| s.step(&c, 2.0, 1e-3)));
        let driven: Vec<bool> = (0..200).map(|_| s.step(&c, 6.0, 1e-3)).collect();
        let off = driven.iter().filter(|d| !**d).count();
        assert!((49..=52).contains(&off), "{off}");
        assert!(!driven[0] && driven[199]);
        assert!((0..100).all(|_| CommutationState::default().step(&Commutation::default(), 99.0, 1e-3)));
    }
}
