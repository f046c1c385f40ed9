//! Record and replay of the pins' traffic.
//!
//! What it is: everything that reaches the rig board in a native run, millisecond by millisecond (edges, conversions, bytes of the line),
//! in a file; and the firmware alone on such a file, without plant, ESC or host. The same firmware gives the same telemetry to
//! the byte; another firmware shows what it would have done with the same pins.
//! What can go wrong: a file that is no record or is cut off is refused with the byte at which that shows.
//! Units: ticks of 84 MHz modulo 2^32; 12-bit codes.
//! Reference: postcard wire format 1.0; house rule 1 (ticks without I/O).

use super::board::{Board, Wires};
use super::firmware_config;
use crate::bench::Millisecond;
use crate::scenario::Scenario;
use firmware_rig::AdcBlock;
use frame::rig::{ADC_CHANNELS, CAPTURE_CHANNELS};
use frame::units::Ticks;
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// First bytes of a record.
const MAGIC: &[u8; 15] = b"quadrig pins 3\n";

/// Why a record was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PinsError {
    /// The file cannot be read or written.
    #[error("{}: cannot be read or written ({source}); expected a file: check name and folder", file.display())]
    File {
        /// Which.
        file: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// The file is no record.
    #[error("{}: byte {at}: {expected}", file.display())]
    Damaged {
        /// Which.
        file: PathBuf,
        /// Where it shows.
        at: usize,
        /// What was expected.
        expected: &'static str,
    },
}

/// What reached the board in one millisecond.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Traffic {
    edges: [Vec<u32>; CAPTURE_CHANNELS],
    /// Sum, sum of squares, count, lowest, highest.
    adc: [(u32, u64, u16, u16, u16); ADC_CHANNELS],
    /// Bytes of the ESC's telemetry, and edges of the back-EMF meter.
    esc: Vec<u16>,
    back_emf: Vec<u32>,
    /// What the host sent.
    line: Vec<u8>,
    reset: bool,
}

/// A record in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct PinRecord {
    scenario: String,
    traffic: Vec<Traffic>,
}

impl PinRecord {
    pub(super) fn new(scenario: &Scenario) -> Self {
        Self { scenario: toml::to_string(scenario).unwrap_or_default(), traffic: Vec::new() }
    }

    pub(super) fn take(&mut self, gathered: &Millisecond, line: &[u8], reset: bool) {
        let adc = gathered.adc.map(|b| (b.sum, b.sum_sq, b.count, b.min, b.max));
        let Millisecond { edges, esc, back_emf, .. } = gathered.clone();
        self.traffic.push(Traffic { edges, adc, esc, back_emf, line: line.to_vec(), reset });
    }

    /// Milliseconds that it covers.
    #[must_use]
    pub fn len(&self) -> usize {
        self.traffic.len()
    }

    /// Whether it covers nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.traffic.is_empty()
    }

    /// The scenario that was recorded, as its file.
    #[must_use]
    pub fn scenario(&self) -> &str {
        &self.scenario
    }

    /// Writes the record.
    ///
    /// # Errors
    /// What the writer says.
    pub fn write(&self, out: &mut impl Write) -> std::io::Result<()> {
        let mut put = |value: postcard::Result<Vec<u8>>| out.write_all(&value.map_err(std::io::Error::other)?);
        put(Ok(MAGIC.to_vec()))?;
        put(postcard::to_allocvec(&self.scenario))?;
        for traffic in &self.traffic {
            put(postcard::to_allocvec(traffic))?;
        }
        Ok(())
    }

    /// Reads a record.
    ///
    /// # Errors
    /// [`PinsError::File`], [`PinsError::Damaged`].
    pub fn read(file: &Path) -> Result<Self, PinsError> {
        let mut bytes = Vec::new();
        let mut open = std::fs::File::open(file).map_err(|source| PinsError::File { file: file.to_owned(), source })?;
        open.read_to_end(&mut bytes).map_err(|source| PinsError::File { file: file.to_owned(), source })?;
        let damaged = |at, expected| PinsError::Damaged { file: file.to_owned(), at, expected };
        let rest =
            bytes.strip_prefix(MAGIC).ok_or_else(|| damaged(0, "expected the line \"quadrig pins 3\" of a record of pins"))?;
        let place = |rest: &[u8]| bytes.len() - rest.len();
        let (scenario, mut rest) =
            postcard::take_from_bytes::<String>(rest).map_err(|_| damaged(MAGIC.len(), "expected the scenario"))?;
        let mut traffic = Vec::new();
        while !rest.is_empty() {
            let (one, left) = postcard::take_from_bytes::<Traffic>(rest)
                .map_err(|_| damaged(place(rest), "expected one more millisecond of pins; the record is cut off or damaged"))?;
            traffic.push(one);
            rest = left;
        }
        Ok(Self { scenario, traffic })
    }

    /// The firmware of `scenario` alone on these pins: every byte that it sends.
    #[must_use]
    pub fn replay(&self, scenario: &Scenario, progress: &mut dyn FnMut(f64)) -> Vec<u8> {
        let mut board = Board::new(firmware_config(scenario));
        let mut sent = Vec::new();
        let mut gathered = Millisecond::default();
        for (i, one) in self.traffic.iter().enumerate() {
            let now = Ticks::from_ms(i as u64 + 1);
            gathered.edges.clone_from(&one.edges);
            gathered.esc.clone_from(&one.esc);
            gathered.back_emf.clone_from(&one.back_emf);
            gathered.adc = one.adc.map(|(sum, sum_sq, count, min, max)| AdcBlock { sum, sum_sq, count, min, max });
            board.pass(now, &gathered, &one.line, Wires::SOUND, one.reset);
            if !one.reset {
                sent.append(&mut board.sent());
            }
            if i % 1000 == 0 {
                progress(i as f64 / self.traffic.len() as f64);
            }
        }
        progress(1.0);
        sent
    }
}
