//! One speed sensor on the rotor.
//!
//! What it is: the marks of one disc in the order of passing, the angle at which the next is seen, and what makes of a mark no edge or two.
//! What can go wrong: jitter never puts an edge before the one ahead of it; a mark that is missed gives no edge at all.
//! Units: revolutions.
//! Reference: Beharie 2013 section 5.4; see [`super::edge`].

use super::edge::{ENCODER_PRESCALER, EdgeDetail, Geometry};
use crate::noise::Stream;
use std::collections::VecDeque;

/// Sensor and where it stands.
#[derive(Debug, Clone)]
pub(super) struct Channel {
    marks: Vec<(f64, bool)>,
    next: usize,
    turn: f64,
    threshold: f64,
    jitter: f64,
    miss: f64,
    double: f64,
    ring: f64,
    twist: (f64, f64),
    every: u32,
    count: u32,
    pins: bool,
    pub(super) level: bool,
    /// Edges of a second pulse that are still to come.
    extra: VecDeque<(f64, bool)>,
    pub(super) stream: Stream,
}

impl Channel {
    /// Sensor `i` at `angle_rev`, which has made `level` so far.
    pub(super) fn new(
        i: usize,
        geometry: &Geometry,
        detail: EdgeDetail,
        seed: u64,
        angle_rev: f64,
        stream: Stream,
    ) -> Option<Self> {
        if !geometry.fitted[i] || geometry.factor[i] <= 0.0 {
            return None;
        }
        let mut marks: Vec<(f64, bool)> = Vec::new();
        for (j, (at, width)) in geometry.marks_of(i, seed).into_iter().enumerate() {
            match detail {
                EdgeDetail::Captured if i == 3 && j % ENCODER_PRESCALER != 0 => {}
                EdgeDetail::Captured => marks.push((at, true)),
                EdgeDetail::Pins => marks.extend([(at, true), (at + width, false)]),
            }
        }
        let whole = angle_rev.floor();
        let part = angle_rev - whole;
        let next = marks.iter().position(|m| m.0 > part).unwrap_or(0);
        let turn = if marks[next].0 > part { whole } else { whole + 1.0 };
        let twist = if i == 0 { (geometry.twist_onset_rpm / 60.0, geometry.twist) } else { (f64::INFINITY, 0.0) };
        let mut channel = Self {
            level: detail == EdgeDetail::Pins && !marks[next].1,
            marks,
            next,
            turn,
            threshold: angle_rev,
            jitter: geometry.jitter_deg[i] / 360.0,
            miss: geometry.miss[i],
            double: geometry.double[i],
            ring: (geometry.ring_deg / 360.0).min(if i == 3 { 0.004 } else { 0.028 }),
            twist,
            every: (1.0 / geometry.factor[i] + 0.5).max(1.0) as u32,
            count: 0,
            pins: detail == EdgeDetail::Pins,
            extra: VecDeque::new(),
            stream,
        };
        channel.schedule();
        Some(channel)
    }

    fn schedule(&mut self) {
        let (at, _) = self.marks[self.next];
        let wanted = self.turn + at + self.jitter * self.stream.normal();
        self.threshold = wanted.max(self.threshold + 1.0e-6);
    }

    /// Probability that the mark at this speed gives a second pulse.
    fn doubled(&self, rev_s: f64) -> f64 {
        let (onset, at_twice) = self.twist;
        if rev_s > onset { self.double + at_twice * (rev_s / onset - 1.0) } else { self.double }
    }

    fn advance(&mut self, rev_s: f64) -> Option<bool> {
        let rising = self.marks[self.next].1;
        let at = self.threshold;
        self.next += 1;
        if self.next == self.marks.len() {
            self.next = 0;
            self.turn += 1.0;
        }
        self.schedule();
        if rising && self.every > 1 {
            self.count = (self.count + 1) % self.every;
            if self.count != 0 {
                return None;
            }
        }
        if rising && self.miss > 0.0 && self.stream.uniform() < self.miss {
            return None;
        }
        if self.pins && rising == self.level {
            return None; // the fall after a mark that was not seen
        }
        let doubled = self.doubled(rev_s);
        if rising && doubled > 0.0 && self.stream.uniform() < doubled {
            if self.pins {
                self.extra.push_back((at + 0.5 * self.ring, false));
            }
            self.extra.push_back((at + self.ring, true));
        }
        self.level = rising;
        Some(rising)
    }

    /// Whether nothing happens up to `to`.
    #[inline]
    pub(super) fn idle(&self, to: f64) -> bool {
        self.threshold > to && self.extra.is_empty()
    }

    /// Angle at which the next mark is seen, when it is all that can happen: no mark of this sensor gives a second pulse.
    #[inline]
    pub(super) fn single(&self) -> Option<f64> {
        (self.double <= 0.0 && self.twist.1 <= 0.0 && self.extra.is_empty()).then_some(self.threshold)
    }

    /// The next edge at or before `to`, as (angle, rising); `None` inside where a mark gives no edge.
    pub(super) fn pass(&mut self, to: f64, rev_s: f64) -> Option<(f64, Option<bool>)> {
        if let Some(&(at, rising)) = self.extra.front()
            && at < self.threshold
        {
            if at > to {
                return None;
            }
            self.extra.pop_front();
            self.level = rising;
            return Some((at, Some(rising)));
        }
        if self.threshold > to {
            return None;
        }
        let at = self.threshold;
        self.extra.clear(); // a second pulse does not outlast its mark
        Some((at, self.advance(rev_s)))
    }
}
