//! The board of a native run.
//!
//! What it is: firmware, codec and the timer that makes the pulses; one call a control tick.
//! What can go wrong: a message that does not fit its frame.
//! Units: ticks of 84 MHz.
//! Reference: house rule 1 (ticks without I/O).

use super::SimError;
use crate::bench::Millisecond;
use firmware_rig::{Config, Inputs, Rig};
use frame::message::{Command, Message};
use frame::units::{PulseWidth, Ticks};
use frame::wire::{Decoder, Encoder, MAX_WIRE};
/// The board's side: firmware, codec and the timer that makes the pulses.
pub(super) struct Board {
    pub(super) rig: Rig,
    pub(super) encoder: Encoder,
    pub(super) decoder: Decoder,
    pub(super) pulse: PulseWidth,
    pub(super) sent: Vec<u8>,
}

impl Board {
    pub(super) fn new(config: Config) -> Self {
        Self {
            rig: Rig::new(config),
            encoder: Encoder::default(),
            decoder: Decoder::default(),
            pulse: PulseWidth::MIN,
            sent: Vec::new(),
        }
    }

    /// Starts again, as after a loss of its supply. The sequence of its frames begins anew as well.
    pub(super) fn reset(&mut self, config: Config) {
        *self = Self::new(config);
    }

    /// One control tick with what the peripherals gathered; what it has to tell goes onto the line.
    pub(super) fn tick(&mut self, now: Ticks, gathered: &Millisecond, command: Option<Command>) -> Result<(), SimError> {
        let outputs = self.rig.tick(&Inputs {
            now,
            edges: core::array::from_fn(|i| gathered.edges[i].as_slice()),
            over_capture: [false; 4],
            adc: gathered.adc,
            command,
            line: Default::default(),
            stop_input: false,
            brown_out: false,
            paused: false,
        });
        self.pulse = outputs.pulse;
        if let Some(Command::Identify) = command {
            self.tell(now, &Message::Hello(self.rig.hello(0)))?;
        }
        if let Some(Command::Identify | Command::Tare) = command {
            self.tell(now, &Message::Calibration(self.rig.calibration()))?;
        }
        if let Some(sample) = outputs.sample {
            self.tell(now, &Message::Rig(sample))?;
        }
        if let Some(event) = outputs.event {
            self.tell(now, &Message::Event(event))?;
        }
        Ok(())
    }

    fn tell(&mut self, now: Ticks, message: &Message) -> Result<(), SimError> {
        let mut frame = [0; MAX_WIRE];
        let length = self.encoder.encode(now, message, &mut frame).map_err(|_| SimError::Codec)?;
        self.sent.extend_from_slice(&frame[..length]);
        Ok(())
    }

    /// Takes the bytes that the host sent; at most one command is in them.
    pub(super) fn hear(&mut self, bytes: &[u8]) -> Option<Command> {
        let mut command = None;
        for byte in bytes {
            if let Some(received) = self.decoder.push(*byte) {
                command = Some(received.message);
            }
        }
        command
    }
}
