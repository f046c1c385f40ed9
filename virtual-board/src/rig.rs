//! The rig board, natively.
//!
//! What it is: [`RigDesk`] with the settings in a file and hands at the bench. The board is as it left the factory until somebody configures it, whatever
//! rig the scenario puts before it. The run's time, by which effects and faults count, begins with the first pulse above minimum.
//! What can go wrong: see [`BoardError`].
//! Units: ms.
//! Reference: specification `rig.md`, "The operator's side".

use crate::board::{BoardError, Kind, VirtualBoard};
use crate::flash_file::FlashFile;
use crate::hand::Hand;
use firmware_rig::Config;
use frame::message::Beep;
use frame::units::PulseWidth;
use hal_sim::native::{Board, RigDesk};
use hal_sim::{Scenario, Truth};

/// The board.
pub struct RigBoard {
    desk: RigDesk,
    file: Option<FlashFile>,
    begun: bool,
}

impl RigBoard {
    /// The rig of a scenario before a board.
    #[must_use]
    pub fn new(scenario: &Scenario, mut file: Option<FlashFile>) -> Self {
        let factory = Config::thesis_570kv();
        let board = match file.as_mut().and_then(FlashFile::take) {
            Some(sectors) => Board::with_flash(factory, sectors),
            None => Board::new(factory),
        };
        Self { desk: RigDesk::new(scenario, None, board), file, begun: false }
    }

    /// What the pulse timer holds: the pulse of the next frame.
    #[must_use]
    pub fn pulse(&self) -> PulseWidth {
        self.desk.board().pulse()
    }
}

impl VirtualBoard for RigBoard {
    fn kind(&self) -> Kind {
        Kind::Rig
    }

    fn millisecond(&mut self, said: &[u8]) -> Result<Vec<u8>, BoardError> {
        self.desk.turn();
        let heard = self.desk.let_through(said);
        let sent = self.desk.tick(heard);
        if !self.begun && self.pulse().is_live() {
            self.begun = true;
            self.desk.start_run();
        }
        if let (Some(file), (Some(sectors), saves)) = (&mut self.file, self.desk.board().flash()) {
            file.keep(sectors.bytes(), saves)?;
        }
        Ok(sent)
    }

    fn ms(&self) -> u64 {
        self.desk.ms()
    }

    fn beep(&mut self) -> Option<Beep> {
        self.desk.beep()
    }

    fn hand(&mut self, hand: &Hand) -> Result<(), &'static str> {
        match *hand {
            Hand::Power(on) => self.desk.power(on),
            Hand::StopLoop { open } => self.desk.open_stop_loop(open),
            Hand::Hang(mass_g) => self.desk.hang(mass_g),
            Hand::Twist(torque_nm) => self.desk.twist(torque_nm),
            Hand::Draw(current_a) => self.desk.draw(current_a),
            Hand::Supply(voltage_v) => self.desk.set_supply(voltage_v),
            Hand::Plug { plug, out } => self.desk.unplug(plug, out),
            Hand::Reset => self.desk.press_reset(),
        }
        Ok(())
    }

    fn is_powered(&self) -> bool {
        self.desk.is_powered()
    }

    fn meters(&self) -> Option<Truth> {
        Some(self.desk.truth())
    }
}
