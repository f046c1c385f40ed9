//! Edges of the four speed sensors.
//!
//! What it is: beam (one mark a blade), reflective (one tab), hall (two magnets), encoder (100 steps), each with the angles of
//! its real geometry; an edge falls where the rotor angle passes a mark, interpolated within the step.
//! What can go wrong: see [`super::tachometers`], which makes the edges.
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
    /// Probability that a mark is seen twice.
    pub double: [f64; CAPTURE_CHANNELS],
    /// How far behind its mark a second edge stands, deg; less than the width of the narrowest mark (10.8 deg; encoder 1.8 deg).
    pub ring_deg: f64,
    /// Speed above which the twisting blade cuts the beam a second time, rev/min.
    pub twist_onset_rpm: f64,
    /// Probability of the second cut at twice that speed.
    pub twist: f64,
    /// Speed above which the encoder's coupling slips, rev/min.
    pub slip_onset_rpm: f64,
    /// Share of the excess of speed that the coupling does not pass on.
    pub slip: f64,
    /// Pulses that come out for each mark: 1; a whole fraction (1/2: one blade of two), 0 for none, or 2.
    pub factor: [f64; CAPTURE_CHANNELS],
}

impl Default for Geometry {
    fn default() -> Self {
        Self {
            fitted: [true; CAPTURE_CHANNELS],
            blades: 2,
            magnet_error_deg: 0.0,
            jitter_deg: [0.12, 0.12, 0.12, 0.05],
            miss: [0.0; CAPTURE_CHANNELS],
            double: [0.0; CAPTURE_CHANNELS],
            ring_deg: 4.0,
            twist_onset_rpm: f64::INFINITY,
            twist: 0.0,
            slip_onset_rpm: f64::INFINITY,
            slip: 0.0,
            factor: [1.0; CAPTURE_CHANNELS],
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
    pub(super) fn marks_of(&self, channel: usize, seed: u64) -> Vec<(f64, f64)> {
        let marks: Vec<(f64, f64)> = match channel {
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
        };
        if self.factor[channel] < 2.0 {
            return marks;
        }
        // each mark a second time in the middle of the gap, half as wide
        let half = 0.5 / marks.len() as f64;
        marks.into_iter().flat_map(|(at, width)| [(at, 0.5 * width), (at + half, 0.5 * width)]).collect()
    }
}
