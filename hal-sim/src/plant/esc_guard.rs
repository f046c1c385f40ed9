//! The ESC's protections A and C.
//!
//! What it is: A, low voltage: the supply below the cut-off threshold reduces the output or cuts it off, until the throttle has been
//! closed; C, over heat: an ESC that its own current has warmed beyond 110 degC reduces its output, to not less than 35 %, and
//! gives it back as it cools.
//! What can go wrong: a threshold above the supply's resting voltage keeps the motor off.
//! Units: V a cell, A, degC, s; output 0..1.
//! Reference: Beharie 2013 Appendix C, "Protection"; errata, "ESC protection". Rates and thermal figures are assumed.

/// What protection A does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CutOff {
    /// The output falls to [`REDUCED`].
    #[default]
    Reduce,
    /// The output falls to nothing.
    CutOff,
}

/// Output that a low voltage leaves in the mode "reduce".
pub const REDUCED: f64 = 0.5;
/// Output that heat leaves at the least (errata).
pub const LEAST_WHEN_HOT: f64 = 0.35;
/// Temperature above which the output is reduced, degC (errata).
pub const HOT_C: f64 = 110.0;
/// Output that is taken for each kelvin beyond.
const TAKEN_PER_K: f64 = 0.05;
/// How long the voltage must be low, s.
const LOW_S: f64 = 0.1;
/// Rate at which protection A takes the output, 1/s.
const FALL_PER_S: f64 = 0.5;

/// Parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guard {
    /// Threshold of protection A, V a cell; 0 switches it off.
    pub cutoff_v_per_cell: f64,
    /// What protection A does.
    pub cutoff: CutOff,
    /// Temperature of the ESC's surroundings, degC.
    pub ambient_c: f64,
    /// Rise at a steady current, K/A^2.
    pub rise_k_per_a2: f64,
    /// Time constant of its temperature, s.
    pub tau_s: f64,
}

impl Default for Guard {
    /// "Medium" threshold of a lithium-polymer cell; 110 degC is reached at about 19 A for minutes.
    fn default() -> Self {
        Self { cutoff_v_per_cell: 2.85, cutoff: CutOff::Reduce, ambient_c: 23.0, rise_k_per_a2: 0.25, tau_s: 40.0 }
    }
}

/// State of both protections.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GuardState {
    /// Temperature of the ESC, degC.
    pub temperature_c: f64,
    low_s: f64,
    left: f64,
    tripped: bool,
}

impl GuardState {
    /// A cold ESC.
    #[must_use]
    pub fn new(guard: &Guard) -> Self {
        Self { temperature_c: guard.ambient_c, low_s: 0.0, left: 1.0, tripped: false }
    }

    /// One step on `cells` cells with `voltage_v` at the terminals and `current_a` through them; `closed` says that the throttle is
    /// at minimum. Gives the largest output allowed, 0..1.
    pub fn step(&mut self, guard: &Guard, cells: u8, voltage_v: f64, current_a: f64, closed: bool, dt_s: f64) -> f64 {
        let goal = guard.ambient_c + guard.rise_k_per_a2 * current_a * current_a;
        self.temperature_c += (goal - self.temperature_c) * (dt_s / guard.tau_s).min(1.0);
        let hot = (1.0 - TAKEN_PER_K * (self.temperature_c - HOT_C).max(0.0)).max(LEAST_WHEN_HOT);

        let low = voltage_v < guard.cutoff_v_per_cell * f64::from(cells);
        self.low_s = if low { self.low_s + dt_s } else { 0.0 };
        self.tripped = (low || !closed) && (self.tripped || self.low_s >= LOW_S);
        if self.tripped {
            let floor = if guard.cutoff == CutOff::Reduce { REDUCED } else { 0.0 };
            self.left = (self.left - FALL_PER_S * dt_s).max(floor);
        } else {
            self.left = 1.0;
        }
        hot.min(self.left)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(s: &mut GuardState, guard: &Guard, volts: f64, amps: f64, closed: bool, seconds: u32) -> f64 {
        (0..seconds * 1000).map(|_| s.step(guard, 3, volts, amps, closed, 1e-3)).last().unwrap()
    }

    #[test]
    fn a_low_voltage_reduces_or_cuts_off_until_the_throttle_is_closed() {
        for (cutoff, left) in [(CutOff::Reduce, REDUCED), (CutOff::CutOff, 0.0)] {
            let guard = Guard { cutoff, ..Guard::default() };
            let mut s = GuardState::new(&guard);
            assert_eq!(run(&mut s, &guard, 8.6, 1.0, false, 2), 1.0, "2.87 V a cell");
            assert_eq!(run(&mut s, &guard, 8.5, 1.0, false, 3), left);
            assert_eq!(run(&mut s, &guard, 11.0, 1.0, false, 3), left, "it holds while the throttle is open");
            assert_eq!(run(&mut s, &guard, 11.0, 1.0, true, 1), 1.0);
        }
    }

    #[test]
    fn heat_reduces_to_35_per_cent_at_the_least_and_is_given_back() {
        let guard = Guard::default();
        let mut s = GuardState::new(&guard);
        assert_eq!(run(&mut s, &guard, 11.5, 15.7, false, 600), 1.0, "{}", s.temperature_c);
        assert_eq!(run(&mut s, &guard, 11.5, 30.0, false, 600), LEAST_WHEN_HOT);
        assert_eq!(run(&mut s, &guard, 11.5, 5.0, false, 600), 1.0);
    }
}
