//! Hands and ears at a virtual board's bench.
//!
//! What it is: switches the ESC on where that is due; what it beeps is passed on by the seat.
//! What can go wrong: nothing at a virtual bench; there is none at a real one.
//! Units: time of the port.
//! Reference: Beharie 2013, Fig. 3.10 (connect the battery once minimum, or maximum, is there).

use crate::Failure;
use crate::board::Board;
use frame::rig::RigState;
use std::time::Duration;
use virtual_board::Hand;

/// How long the assistant takes to the switch.
const TO_THE_SWITCH: Duration = Duration::from_millis(300);

/// The assistant.
#[derive(Debug, Default)]
pub(crate) struct Assistant {
    /// Since when the board waits for the ESC to be powered.
    waits: Option<Duration>,
}

impl Assistant {
    /// Looks at the board's state and does what is due.
    pub(crate) fn help(&mut self, board: &mut Board, state: RigState) -> Result<(), Failure> {
        if !matches!(state, RigState::ArmHoldMin | RigState::CalibrateHoldMax) {
            self.waits = None;
        } else if board.now() >= *self.waits.get_or_insert(board.now()) + TO_THE_SWITCH && !board.is_powered() {
            board.hand(&Hand::Power(true))?;
        }
        Ok(())
    }
}
