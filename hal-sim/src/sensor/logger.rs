//! A logger with its own clock between the load cell and the converter.
//!
//! What it is: thrust and torque pass through a recorder that plays them back, later and later as its clock runs slow.
//! What can go wrong: nothing is known before the recording began; the first value then stands.
//! Units: s, V.
//! Reference: frequency tolerance of free-running oscillators, specification `closing-the-loop.md`, `clock_drift`.

use std::collections::VecDeque;

/// The recorder of strain and torque pins.
#[derive(Debug, Clone, Default)]
pub struct Logger {
    tape: VecDeque<[f64; 2]>,
    before: [f64; 2],
}

impl Logger {
    /// Records `now` (one step of `dt_s`) and gives what was there `late_s` ago, between the steps by a straight line.
    pub fn pass(&mut self, now: [f64; 2], late_s: f64, dt_s: f64) -> [f64; 2] {
        if late_s <= 0.0 {
            self.before = now;
            return now;
        }
        if self.tape.is_empty() {
            self.tape.push_back(self.before);
        }
        self.tape.push_back(now);
        let back = late_s / dt_s;
        let whole = back as usize;
        // a lag that shrinks again leaves tape that is too old
        while self.tape.len() > whole + 2 {
            self.tape.pop_front();
        }
        let newest = self.tape.len() - 1;
        let at = |back: usize| self.tape[newest.saturating_sub(back)];
        let (newer, older) = (at(whole), at(whole + 1));
        let part = back - whole as f64;
        core::array::from_fn(|i| newer[i] + part * (older[i] - newer[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_falls_behind_by_its_rate() {
        let mut l = Logger::default();
        let (dt, rate) = (1.0e-3, 0.01);
        for i in 0..50_000 {
            let t = dt * f64::from(i);
            let [a, b] = l.pass([t, 2.0 * t], rate * t, dt);
            assert!((a - (t - rate * t)).abs() < 1e-6 && (b - 2.0 * a).abs() < 1e-9, "{t} {a}");
        }
        assert!(l.tape.len() < 600);
        assert_eq!(l.pass([1.0, 2.0], 0.0, dt), [1.0, 2.0]);
    }
}
