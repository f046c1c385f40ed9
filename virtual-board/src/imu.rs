//! The IMU board, natively.
//!
//! What it is: [`ImuDesk`] with the settings in a file; a tick every 5 ms.
//! What can go wrong: see [`BoardError`]. There is no bench to lay hands on: how the body moves stands in the scenario.
//! Units: ms.
//! Reference: specification `ahrs.md`, "Board".

use crate::board::{BoardError, Kind, VirtualBoard};
use crate::flash_file::FlashFile;
use crate::hand::Hand;
use frame::message::Beep;
use hal_sim::Truth;
use hal_sim::native::ImuDesk;
use hal_sim::scenario::ImuScenario;

/// Milliseconds between two ticks.
const TICK_MS: u64 = 5;

/// The board.
pub struct ImuBoard {
    desk: ImuDesk,
    file: Option<FlashFile>,
    ms: u64,
    said: Vec<u8>,
}

impl ImuBoard {
    /// The board on the body of a scenario.
    #[must_use]
    pub fn new(scenario: &ImuScenario, mut file: Option<FlashFile>) -> Self {
        let sectors = file.as_mut().and_then(FlashFile::take).unwrap_or_default();
        Self { desk: ImuDesk::new(&scenario.rig(), sectors), file, ms: 0, said: Vec::new() }
    }
}

impl VirtualBoard for ImuBoard {
    fn kind(&self) -> Kind {
        Kind::Imu
    }

    fn millisecond(&mut self, said: &[u8]) -> Result<Vec<u8>, BoardError> {
        self.ms += 1;
        self.said.extend_from_slice(said);
        if !self.ms.is_multiple_of(TICK_MS) {
            return Ok(Vec::new());
        }
        let sent = self.desk.tick(&std::mem::take(&mut self.said));
        if let Some(file) = &mut self.file {
            let (sectors, saves) = self.desk.flash();
            file.keep(sectors.bytes(), saves)?;
        }
        Ok(sent)
    }

    fn ms(&self) -> u64 {
        self.ms
    }

    fn beep(&mut self) -> Option<Beep> {
        None
    }

    fn hand(&mut self, _: &Hand) -> Result<(), &'static str> {
        Err("the IMU board stands alone: its scenario says how it moves")
    }

    fn is_powered(&self) -> bool {
        false
    }

    fn meters(&self) -> Option<Truth> {
        None
    }
}
