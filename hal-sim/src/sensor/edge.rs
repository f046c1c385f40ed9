//! Edges of the four speed sensors.
//!
//! What it is: beam (one mark a blade), reflective (one tab), hall (two magnets), encoder (100 steps), each with the angles of
//! its real geometry; an edge falls where the rotor angle passes a mark, interpolated within the step.
//! What can go wrong: jitter never puts an edge before the one ahead of it; a missed mark gives no edge at all.
//! Units: revolutions for angles, ticks of 84 MHz and ns for times.
//! Reference: Beharie 2013 section 5.4 and Appendix C (encoder: pulse width error +-25 deg electrical); errata "encoder".

use crate::noise::{Source, Stream};
use frame::rig::CAPTURE_CHANNELS;

/// Steps of the encoder disc (errata, "encoder").
pub const ENCODER_STEPS: usize = 100;
/// Input prescaler of the encoder's capture channel: every fourth rising edge is captured.
pub const ENCODER_PRESCALER: usize = 4;
/// Largest error of an encoder step, electrical degrees (Appendix C).
const ENCODER_ERROR_DEG: f64 = 25.0;

/// One edge at a capture pin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edge {
    /// Capture channel: 0 beam, 1 reflective, 2 hall, 3 encoder.
    pub channel: u8,
    /// Rising or falling.
    pub rising: bool,
    /// Time since the start of the simulation, ns.
    pub at_ns: u64,
    /// The same, ticks of 84 MHz.
    pub at_ticks: u64,
}

/// Which edges are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EdgeDetail {
    /// What a capture unit latches: rising edges, every fourth one of the encoder.
    Captured,
    /// What the pins show: rising and falling, all steps of the encoder (channel A).
    Pins,
}

/// Geometry of the four sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geometry {
    /// Which of the four are fitted.
    pub fitted: [bool; CAPTURE_CHANNELS],
    /// Blades that break the beam.
    pub blades: u32,
    /// Deviation of the second magnet from 180 degrees, deg.
    pub magnet_error_deg: f64,
    /// Standard deviation of the angle at which a mark is seen, mechanical degrees.
    pub jitter_deg: [f64; CAPTURE_CHANNELS],
    /// Probability that a mark is not seen.
    pub miss: [f64; CAPTURE_CHANNELS],
}

impl Default for Geometry {
    fn default() -> Self {
        Self {
            fitted: [true; CAPTURE_CHANNELS],
            blades: 2,
            magnet_error_deg: 0.0,
            jitter_deg: [0.12, 0.12, 0.12, 0.05],
            miss: [0.0; CAPTURE_CHANNELS],
        }
    }
}

impl Geometry {
    /// Captured marks a revolution.
    #[must_use]
    pub fn marks(&self) -> [u16; CAPTURE_CHANNELS] {
        let full = [self.blades as u16, 1, 2, (ENCODER_STEPS / ENCODER_PRESCALER) as u16];
        core::array::from_fn(|i| if self.fitted[i] { full[i] } else { 0 })
    }

    /// Rising angle and width of each mark of `channel`, revolutions, in the order of passing.
    fn marks_of(&self, channel: usize, seed: u64) -> Vec<(f64, f64)> {
        match channel {
            0 => (0..self.blades).map(|i| (f64::from(i) / f64::from(self.blades), 0.03)).collect(),
            1 => vec![(0.11, 0.10)],
            2 => vec![(0.23, 0.08), (0.73 + self.magnet_error_deg / 360.0, 0.08)],
            _ => {
                let mut disc = Stream::new(seed, Source::EncoderDisc, 0);
                let step = 1.0 / ENCODER_STEPS as f64;
                let error = ENCODER_ERROR_DEG / 360.0 * step;
                (0..ENCODER_STEPS)
                    .map(|i| {
                        let at = (i as f64 + 0.3) * step + disc.between(-error, error);
                        (at, 0.5 * step + disc.between(-error, error))
                    })
                    .collect()
            }
        }
    }
}

#[derive(Debug, Clone)]
struct Channel {
    marks: Vec<(f64, bool)>,
    next: usize,
    turn: f64,
    threshold: f64,
    jitter: f64,
    miss: f64,
    pins: bool,
    level: bool,
    stream: Stream,
}

impl Channel {
    fn schedule(&mut self) {
        let (at, _) = self.marks[self.next];
        let wanted = self.turn + at + self.jitter * self.stream.normal();
        self.threshold = wanted.max(self.threshold + 1.0e-6);
    }

    fn advance(&mut self) -> Option<bool> {
        let rising = self.marks[self.next].1;
        self.next += 1;
        if self.next == self.marks.len() {
            self.next = 0;
            self.turn += 1.0;
        }
        self.schedule();
        if rising && self.miss > 0.0 && self.stream.uniform() < self.miss {
            return None;
        }
        if self.pins && rising == self.level {
            return None; // the fall after a mark that was not seen
        }
        self.level = rising;
        Some(rising)
    }
}

/// The four sensors on one rotor.
#[derive(Debug, Clone)]
pub struct Tachometers {
    channels: [Option<Channel>; CAPTURE_CHANNELS],
}

impl Tachometers {
    /// Sensors at rotor angle `angle_rev` (0..1).
    #[must_use]
    pub fn new(geometry: &Geometry, detail: EdgeDetail, seed: u64, angle_rev: f64) -> Self {
        let channels = core::array::from_fn(|i| {
            if !geometry.fitted[i] {
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
            let next = marks.iter().position(|m| m.0 > angle_rev).unwrap_or(0);
            let turn = if marks[next].0 > angle_rev { 0.0 } else { 1.0 };
            let mut channel = Channel {
                level: detail == EdgeDetail::Pins && !marks[next].1,
                marks,
                next,
                turn,
                threshold: angle_rev,
                jitter: geometry.jitter_deg[i] / 360.0,
                miss: geometry.miss[i],
                pins: detail == EdgeDetail::Pins,
                stream: Stream::new(seed, Source::Edge, i as u64),
            };
            channel.schedule();
            Some(channel)
        });
        Self { channels }
    }

    /// Level of a pin now (meaningful with [`EdgeDetail::Pins`]).
    #[must_use]
    pub fn level(&self, channel: usize) -> bool {
        self.channels.get(channel).and_then(Option::as_ref).is_some_and(|c| c.level)
    }

    /// The rotor moved from `from` to `to` revolutions in one step: calls `edge(channel, rising, fraction of the step)`.
    #[inline]
    pub fn step(&mut self, from: f64, to: f64, mut edge: impl FnMut(u8, bool, f64)) {
        if to <= from {
            return;
        }
        for (i, channel) in self.channels.iter_mut().enumerate() {
            let Some(channel) = channel else { continue };
            while channel.threshold <= to {
                let fraction = ((channel.threshold - from) / (to - from)).clamp(0.0, 1.0);
                if let Some(rising) = channel.advance() {
                    edge(i as u8, rising, fraction);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turns at a constant rate and gives every edge as (channel, rising, revolution).
    fn turn(geometry: &Geometry, detail: EdgeDetail, revolutions: f64) -> Vec<(u8, bool, f64)> {
        let mut t = Tachometers::new(geometry, detail, 9, 0.4);
        let step = 0.0071;
        let mut out = Vec::new();
        let mut at = 0.4;
        while at < 0.4 + revolutions {
            t.step(at, at + step, |channel, rising, fraction| out.push((channel, rising, at + fraction * step)));
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
}
