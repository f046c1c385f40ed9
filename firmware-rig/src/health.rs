//! How the board is, once a second.
//!
//! What it is: the spread of the ticks, and what the processor measures of itself, as one report.
//! What can go wrong: none of it is used for control; a counter that wraps is only a figure.
//! Units: core cycles, timer ticks, bytes.
//! Reference: specification `rig.md`, "jitter measured and reported".

use crate::esc_line::EscCounts;
use frame::message::Health;
use frame::units::Ticks;

/// What a processor measures of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Vitals {
    /// Most core cycles of a tick, since reset.
    pub tick_cycles: u32,
    /// Most core cycles of a capture interrupt, since reset.
    pub capture_cycles: u32,
    /// Bytes of stack that were never used.
    pub stack_free: u32,
    /// Bytes of stack in all.
    pub stack_size: u32,
    /// Encoder steps forwards and backwards since reset.
    pub steps: [u32; 2],
    /// Index marks of the encoder since reset.
    pub index: u16,
}

/// Collects what the next report tells.
#[derive(Debug, Clone, Default)]
pub(crate) struct HealthWatch {
    last: Option<Ticks>,
    span: Option<[u32; 2]>,
    next: Ticks,
    steps: [u32; 2],
}

impl HealthWatch {
    /// Notes a tick; a report once a second. Without `vitals` their figures are 0.
    pub(crate) fn tick(&mut self, now: Ticks, frames: [u16; 3], esc: EscCounts, vitals: Option<&Vitals>) -> Option<Health> {
        if let Some(last) = self.last.replace(now) {
            let span = now.since(last).0 as u32;
            self.span = Some(self.span.map_or([span; 2], |[low, high]| [low.min(span), high.max(span)]));
        }
        if now < self.next {
            return None;
        }
        self.next = Ticks(now.0 + Ticks::from_ms(1000).0);
        let vitals = vitals.copied().unwrap_or_default();
        let [[forward, backward], [f, b]] = [vitals.steps, core::mem::replace(&mut self.steps, vitals.steps)];
        Some(Health {
            tick_cycles: vitals.tick_cycles,
            capture_cycles: vitals.capture_cycles,
            stack_free: vitals.stack_free,
            stack_size: vitals.stack_size,
            tick_span: self.span.take().unwrap_or_default(),
            frames,
            steps: [forward.wrapping_sub(f) as u16, backward.wrapping_sub(b) as u16],
            index: vitals.index,
            esc: [esc.good, esc.damaged, esc.errors],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_reports_once_a_second_the_spread_of_the_ticks_and_the_steps_of_that_second() {
        let mut watch = HealthWatch::default();
        let mut reports = std::vec::Vec::new();
        for ms in 0..=2_000u32 {
            let late = if ms == 1_500 { 84 } else { 0 };
            let vitals = Vitals { steps: [3 * ms, 1], ..Vitals::default() };
            let esc = EscCounts { good: ms as u16, ..EscCounts::default() };
            reports.extend(watch.tick(Ticks(u64::from(ms) * 84_000 + late), [0; 3], esc, Some(&vitals)));
        }
        assert_eq!(reports.len(), 3);
        assert_eq!((reports[1].tick_span, reports[1].steps, reports[1].esc), ([84_000; 2], [3_000, 0], [1_000, 0, 0]));
        assert_eq!((reports[2].tick_span, reports[2].steps), ([83_916, 84_084], [3_000, 0]));
    }
}
