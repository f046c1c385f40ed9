//! A digital meter between the strain amplifier and the ADC.
//!
//! What it is: a conditioner that converts the amplifier's output at its own rate, rounds it, and gives it again after a
//! dead time: sample and hold, quantisation and delay. The rig has none unless an effect fits one.
//! What can go wrong: a delay is rounded to whole steps of the integration.
//! Units: s, V.
//! Reference: specification `closing-the-loop.md`, `sample_hold`, `quantisation`, `channel_delay`.

use std::collections::VecDeque;

/// Parameters; all zero is a piece of wire.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Meter {
    /// Time between two conversions, s.
    pub hold_s: f64,
    /// Step of its output, V.
    pub step_v: f64,
    /// Dead time, s.
    pub delay_s: f64,
}

/// State of the meter.
#[derive(Debug, Clone, PartialEq)]
pub struct MeterState {
    meter: Meter,
    wire: bool,
    steps: u64,
    hold_steps: u64,
    held_v: f64,
    line: VecDeque<f64>,
}

impl MeterState {
    /// Showing `start_v`, for steps of `dt_s`.
    #[must_use]
    pub fn new(meter: Meter, start_v: f64, dt_s: f64) -> Self {
        let steps = |s: f64| (s / dt_s + 0.5) as u64;
        let line = core::iter::repeat_n(start_v, steps(meter.delay_s) as usize).collect();
        let wire = meter == Meter::default();
        Self { meter, wire, steps: 0, hold_steps: steps(meter.hold_s).max(1), held_v: start_v, line }
    }

    /// Whether it passes on what it is given.
    #[must_use]
    pub fn is_wire(&self) -> bool {
        self.wire
    }

    /// One step with `input_v`; gives the output.
    #[inline]
    pub fn step(&mut self, input_v: f64) -> f64 {
        if self.wire {
            return input_v;
        }
        if self.steps.is_multiple_of(self.hold_steps) {
            self.held_v = input_v;
            if self.meter.step_v > 0.0 {
                self.held_v = (input_v / self.meter.step_v + 0.5).floor() * self.meter.step_v;
            }
        }
        self.steps += 1;
        self.line.push_back(self.held_v);
        self.line.pop_front().unwrap_or(self.held_v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn through(meter: Meter) -> Vec<f64> {
        let mut s = MeterState::new(meter, 0.0, 0.1);
        (1..=10).map(|i| s.step(f64::from(i))).collect()
    }

    #[test]
    fn wire_delay_hold_and_step() {
        assert_eq!(through(Meter::default())[..3], [1.0, 2.0, 3.0]);
        assert_eq!(through(Meter { delay_s: 0.3, ..Meter::default() })[..5], [0.0, 0.0, 0.0, 1.0, 2.0]);
        assert_eq!(through(Meter { hold_s: 0.4, ..Meter::default() })[..6], [1.0, 1.0, 1.0, 1.0, 5.0, 5.0]);
        assert_eq!(through(Meter { step_v: 4.0, ..Meter::default() })[..6], [0.0, 4.0, 4.0, 4.0, 4.0, 8.0]);
    }
}
