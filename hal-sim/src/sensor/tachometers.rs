//! The four speed sensors on one rotor.
//!
//! What it is: the rotor's angle of each step goes in, edges with their place in the step come out; the encoder may slip or be off.
//! What can go wrong: a change of geometry in the midst of a run; only the sensors that it changes notice.
//! Units: revolutions, revolutions a second.
//! Reference: Beharie 2013 section 5.4; see [`super::edge`].

use super::channel::Channel;
use super::edge::{EdgeDetail, Geometry};
use crate::noise::{Source, Stream};
use crate::plant::powerplant::STEPS_PER_MS;
use frame::rig::CAPTURE_CHANNELS;

/// The four sensors on one rotor.
#[derive(Debug, Clone)]
pub struct Tachometers {
    channels: [Option<Channel>; CAPTURE_CHANNELS],
    geometry: Geometry,
    detail: EdgeDetail,
    seed: u64,
    /// Revolutions that the encoder has fallen behind the rotor.
    behind: f64,
    coupled: bool,
}

impl Tachometers {
    /// Sensors at rotor angle `angle_rev` (0..1).
    #[must_use]
    pub fn new(geometry: &Geometry, detail: EdgeDetail, seed: u64, angle_rev: f64) -> Self {
        let channels = core::array::from_fn(|i| {
            Channel::new(i, geometry, detail, seed, angle_rev, Stream::new(seed, Source::Edge, i as u64))
        });
        Self { channels, geometry: *geometry, detail, seed, behind: 0.0, coupled: true }
    }

    /// Goes on with another geometry from rotor angle `angle_rev`; only the sensors that it changes notice.
    pub fn refit(&mut self, geometry: &Geometry, angle_rev: f64) {
        if *geometry == self.geometry {
            return;
        }
        let fresh = Self::new(geometry, self.detail, self.seed, angle_rev);
        for (i, (old, mut new)) in self.channels.iter_mut().zip(fresh.channels).enumerate() {
            let behind = if i == 3 { self.behind } else { 0.0 };
            if let (Some(old), Some(new)) = (old.as_ref(), new.as_mut()) {
                let stream = old.stream.clone();
                if let Some(mut rebuilt) = Channel::new(i, geometry, self.detail, self.seed, angle_rev - behind, stream) {
                    rebuilt.level = old.level;
                    *new = rebuilt;
                }
            }
            *old = new;
        }
        self.geometry = *geometry;
    }

    /// Couples the encoder to the shaft or takes it off.
    pub fn couple(&mut self, coupled: bool) {
        self.coupled = coupled;
    }

    /// Level of a pin now (meaningful with [`EdgeDetail::Pins`]).
    #[must_use]
    pub fn level(&self, channel: usize) -> bool {
        self.channels.get(channel).and_then(Option::as_ref).is_some_and(|c| c.level)
    }

    /// Revolutions that the encoder falls behind in a step.
    fn lost(&self, from: f64, to: f64, rev_s: f64) -> f64 {
        if !self.coupled {
            return to - from;
        }
        let onset = self.geometry.slip_onset_rpm / 60.0;
        if rev_s > onset { (to - from) * self.geometry.slip * (1.0 - onset / rev_s) } else { 0.0 }
    }

    /// Steps between the angles of `turned` (one more of them than of the speeds `rev_s`), channel by channel: calls
    /// `edge(channel, rising, step, fraction of the step)` with the same numbers as [`Tachometers::step`].
    pub fn block(
        &mut self,
        turned: &[f64; STEPS_PER_MS + 1],
        rev_s: &[f64; STEPS_PER_MS],
        mut edge: impl FnMut(u8, bool, usize, f64),
    ) {
        let ([first, after @ ..], [.., last]) = (turned, turned);
        if last <= first {
            return;
        }
        let turns = turned.windows(2).all(|pair| pair[0] < pair[1]);
        let slips = !self.coupled || (self.geometry.slip != 0.0 && self.geometry.slip_onset_rpm.is_finite());
        for i in 0..CAPTURE_CHANNELS {
            let follows = i == 3 && slips;
            let mut behind = if i == 3 { self.behind } else { 0.0 };
            if !follows && self.channels[i].as_ref().is_none_or(|c| c.idle(last - behind)) {
                continue;
            }
            if turns
                && !follows
                && behind == 0.0
                && let Some(channel) = &mut self.channels[i]
            {
                // one mark after the other: the step of each is found by counting, which no branch has to foresee
                while let Some(at) = channel.single().filter(|at| at <= last) {
                    let step = after.iter().map(|to| usize::from(*to < at)).sum::<usize>();
                    if let Some((at, Some(rising))) = channel.pass(after[step], rev_s[step]) {
                        edge(i as u8, rising, step, share_of_step(at, turned[step], after[step]));
                    }
                }
                if channel.idle(*last) {
                    continue;
                }
            }
            for (step, (pair, speed)) in turned.windows(2).zip(rev_s).enumerate() {
                let (from, to) = (pair[0], pair[1]);
                if to <= from {
                    continue;
                }
                let start = from - behind;
                if follows {
                    behind += self.lost(from, to, *speed);
                }
                let end = to - behind;
                let Some(channel) = &mut self.channels[i] else { continue };
                if channel.idle(end) {
                    continue;
                }
                while let Some((at, rising)) = channel.pass(end, *speed) {
                    if let Some(rising) = rising {
                        edge(i as u8, rising, step, share_of_step(at, start, end));
                    }
                }
                if !follows && channel.idle(last - behind) {
                    break;
                }
            }
            if follows {
                self.behind = behind;
            }
        }
    }

    /// The rotor moved from `from` to `to` revolutions in one step at `rev_s` revolutions a second: calls `edge(channel, rising,
    /// fraction of the step)`.
    #[inline]
    pub fn step(&mut self, from: f64, to: f64, rev_s: f64, mut edge: impl FnMut(u8, bool, f64)) {
        if to <= from {
            return;
        }
        let lost = self.lost(from, to, rev_s);
        for (i, channel) in self.channels.iter_mut().enumerate() {
            let Some(channel) = channel else { continue };
            let (mut start, mut end) = (from, to);
            if i == 3 {
                start -= self.behind;
                self.behind += lost;
                end -= self.behind;
            }
            if channel.idle(end) {
                continue;
            }
            while let Some((at, rising)) = channel.pass(end, rev_s) {
                if let Some(rising) = rising {
                    edge(i as u8, rising, share_of_step(at, start, end));
                }
            }
        }
    }
}

/// Where in a step from `start` to `end` the angle `at` was passed, 0..1.
fn share_of_step(at: f64, start: f64, end: f64) -> f64 {
    if end > start { ((at - start) / (end - start)).clamp(0.0, 1.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::edge::ENCODER_PRESCALER;

    #[test]
    fn a_block_is_its_steps() {
        let slipping = Geometry { slip_onset_rpm: 500.0, slip: 0.1, ..Geometry::default() };
        let ringing = Geometry { double: [0.2; 4], miss: [0.1; 4], ..Geometry::default() };
        for (geometry, detail) in [
            (Geometry::default(), EdgeDetail::Captured),
            (Geometry::default(), EdgeDetail::Pins),
            (slipping, EdgeDetail::Captured),
            (ringing, EdgeDetail::Captured),
        ] {
            let (mut one, mut ten) = (Tachometers::new(&geometry, detail, 5, 0.3), Tachometers::new(&geometry, detail, 5, 0.3));
            let mut at = 0.3;
            for ms in 0..2000 {
                let speed = [0.0, 3.0, 90.0, 20.0][ms / 500];
                if ms == 1200 || ms == 1300 {
                    one.couple(ms == 1300);
                    ten.couple(ms == 1300);
                }
                let mut turned = [at; 11];
                let mut want: [Vec<(bool, usize, f64)>; 4] = Default::default();
                for step in 0..10 {
                    turned[step + 1] = turned[step] + speed * 1e-4;
                    one.step(turned[step], turned[step + 1], speed, |c, rising, f| want[usize::from(c)].push((rising, step, f)));
                }
                at = turned[10];
                let mut got: [Vec<(bool, usize, f64)>; 4] = Default::default();
                ten.block(&turned, &[speed; 10], |c, rising, step, f| got[usize::from(c)].push((rising, step, f)));
                assert_eq!(got, want, "{ms} ms");
            }
        }
    }

    /// Turns at a constant rate and gives every edge as (channel, rising, revolution).
    fn turn(geometry: &Geometry, detail: EdgeDetail, revolutions: f64) -> Vec<(u8, bool, f64)> {
        let mut t = Tachometers::new(geometry, detail, 9, 0.4);
        let step = 0.0071;
        let speed = step / 1.0e-4; // 4260 rev/min
        let mut out = Vec::new();
        let mut at = 0.4;
        while at < 0.4 + revolutions {
            t.step(at, at + step, speed, |channel, rising, fraction| out.push((channel, rising, at + fraction * step)));
            at += step;
        }
        out
    }

    #[test]
    fn a_revolution_has_the_marks_of_its_geometry() {
        let edges = turn(&Geometry::default(), EdgeDetail::Captured, 1000.0);
        for (channel, marks) in Geometry::default().marks().into_iter().enumerate() {
            let n = edges.iter().filter(|e| usize::from(e.0) == channel).count();
            assert!(n.abs_diff(1000 * usize::from(marks)) <= 1, "{channel}: {n}");
        }
        assert!(edges.iter().all(|e| e.1));
    }

    #[test]
    fn pins_alternate_and_the_encoder_shows_all_its_steps() {
        let edges = turn(&Geometry::default(), EdgeDetail::Pins, 100.0);
        for channel in 0..4 {
            let own: Vec<_> = edges.iter().filter(|e| e.0 == channel).collect();
            assert!(own.windows(2).all(|w| w[0].1 != w[1].1 && w[0].2 <= w[1].2), "{channel}");
            if channel == 3 {
                assert!(own.len().abs_diff(20_000) <= 2, "{}", own.len());
            }
        }
    }

    #[test]
    fn every_fourth_edge_of_the_pin_is_what_the_prescaler_captures() {
        let quiet = Geometry { jitter_deg: [0.0; 4], ..Geometry::default() };
        let pin: Vec<f64> = turn(&quiet, EdgeDetail::Pins, 5.0).iter().filter(|e| e.0 == 3 && e.1).map(|e| e.2).collect();
        let captured: Vec<f64> = turn(&quiet, EdgeDetail::Captured, 5.0).iter().filter(|e| e.0 == 3).map(|e| e.2).collect();
        let first = pin.iter().position(|e| (e - captured[0]).abs() < 1e-9).expect("the captured edge is one of the pin's");
        for (a, b) in captured.iter().zip(pin.iter().skip(first).step_by(ENCODER_PRESCALER)) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn a_missed_mark_and_a_crooked_magnet_show() {
        let g = Geometry { miss: [0.2, 0.0, 0.0, 0.0], magnet_error_deg: 10.0, jitter_deg: [0.0; 4], ..Geometry::default() };
        for detail in [EdgeDetail::Captured, EdgeDetail::Pins] {
            let edges = turn(&g, detail, 2000.0);
            let beam = edges.iter().filter(|e| e.0 == 0 && e.1).count();
            assert!((3000..3400).contains(&beam), "{beam}");
            let hall: Vec<f64> = edges.iter().filter(|e| e.0 == 2 && e.1).map(|e| e.2).collect();
            let gap = hall[1] - hall[0];
            assert!((gap - 0.5).abs() > 0.02, "{gap}");
        }
    }

    #[test]
    fn second_pulses_a_blind_blade_and_a_twisting_one() {
        let quiet = Geometry { jitter_deg: [0.0; 4], ..Geometry::default() };
        let count = |g: &Geometry, detail, channel: u8| turn(g, detail, 1000.0).iter().filter(|e| e.0 == channel && e.1).count();
        for detail in [EdgeDetail::Captured, EdgeDetail::Pins] {
            let ringing = Geometry { double: [0.1, 0.0, 0.0, 0.0], ..quiet };
            assert!((2150..2250).contains(&count(&ringing, detail, 0)), "{}", count(&ringing, detail, 0));
            // onset 3550 rev/min at 4260: 0.2 of the way to twice the onset
            let twisting = Geometry { twist_onset_rpm: 3550.0, twist: 0.5, ..quiet };
            assert!((2150..2250).contains(&count(&twisting, detail, 0)), "{}", count(&twisting, detail, 0));
            for (factor, beam) in [(0.5, 1000), (0.0, 0), (2.0, 4000)] {
                let odd = Geometry { factor: [factor, 1.0, 1.0, 1.0], ..quiet };
                assert!(count(&odd, detail, 0).abs_diff(beam) <= 2, "{factor}: {}", count(&odd, detail, 0));
                assert!(count(&odd, detail, 1).abs_diff(1000) <= 1);
            }
            let ringing: Vec<_> = turn(&ringing, detail, 300.0).into_iter().filter(|e| e.0 == 0).collect();
            assert!(ringing.windows(2).all(|w| w[0].2 <= w[1].2), "in order");
            assert!(detail == EdgeDetail::Captured || ringing.windows(2).all(|w| w[0].1 != w[1].1), "alternating");
        }
    }

    #[test]
    fn a_slipping_coupling_and_one_that_is_taken_off() {
        let g = Geometry { slip_onset_rpm: 2130.0, slip: 0.1, ..Geometry::default() };
        let encoder = |edges: &[(u8, bool, f64)]| edges.iter().filter(|e| e.0 == 3).count();
        // half of the speed is above the onset, and a tenth of that is lost
        let n = encoder(&turn(&g, EdgeDetail::Captured, 1000.0));
        assert!(n.abs_diff(23_750) <= 2, "{n}");
        let mut t = Tachometers::new(&Geometry::default(), EdgeDetail::Captured, 9, 0.0);
        let mut counts = [0u32; 4];
        t.couple(false);
        for i in 0..100_000 {
            let at = 0.001 * f64::from(i);
            if i == 50_000 {
                t.couple(true);
            }
            t.step(at, at + 0.001, 10.0, |channel, _, _| counts[usize::from(channel)] += 1);
        }
        assert!(counts[3].abs_diff(1250) <= 1 && counts[2].abs_diff(200) <= 1, "{counts:?}");
    }

    #[test]
    fn a_change_in_the_midst_leaves_no_hole_and_no_jump() {
        let mut t = Tachometers::new(&Geometry::default(), EdgeDetail::Pins, 9, 0.0);
        let mut edges: [Vec<(bool, f64)>; 4] = Default::default();
        for i in 0..100_000 {
            let at = 0.001 * f64::from(i);
            if i == 50_000 {
                t.refit(&Geometry { magnet_error_deg: 12.0, ..Geometry::default() }, at);
            }
            t.step(at, at + 0.001, 10.0, |channel, rising, f| edges[usize::from(channel)].push((rising, at + 0.001 * f)));
        }
        for (channel, own) in edges.iter().enumerate() {
            assert!(own.windows(2).all(|w| w[0].1 <= w[1].1), "{channel}");
            let doubled = own.windows(2).filter(|w| w[0].0 == w[1].0).count();
            assert_eq!(doubled, 0, "channel {channel}");
        }
        assert!(edges[1].len().abs_diff(200) <= 2);
        let hall: Vec<f64> = edges[2].iter().filter(|e| e.0).map(|e| e.1).collect();
        let gap = |i: usize| (hall[i + 1] - hall[i] - 0.5).abs();
        assert!(gap(10) < 0.01 && gap(150) > 0.02, "{} {}", gap(10), gap(150));
    }
}
