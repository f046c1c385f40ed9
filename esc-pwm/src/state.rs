//! Where the arming machine stands.
//!
//! What it is: the states of the machine of [`crate::arming`], by name.
//! What can go wrong: nothing; which pulse a state gives is [`crate::pulse_for`]'s business.
//! Units: none.
//! Reference: Beharie 2013, Fig. 3.10 and Appendix C.

/// Where the arming machine stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum State {
    /// Minimum pulses; nothing asked for. The state after every reset.
    #[default]
    Disarmed,
    /// Minimum pulses; waiting for the ESC to be powered and its long beep.
    ArmHoldMin,
    /// Minimum pulses; the long beep was heard, waiting for the cell-count beeps.
    ArmCells,
    /// Minimum pulses; waiting for the "1-2-3".
    ArmReady,
    /// Armed and ready to run, still at minimum throttle.
    Armed,
    /// Throttle follows the schedule or the manual setting.
    Running,
    /// Range calibration: maximum pulses towards an ESC that is known to be unpowered, waiting for two beeps.
    CalibrateHoldMax,
    /// Range calibration: minimum pulses, waiting for long beep, cell beeps and ready.
    CalibrateHoldMin,
    /// The ESC entered its programming mode: minimum pulses until the operator has cut its power.
    ProgrammingEscape,
    /// A latched fault: minimum pulses until the operator clears it.
    Faulted,
}

impl State {
    /// Its name for people.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Disarmed => "disarmed",
            Self::ArmHoldMin => "arming: waiting for the long beep",
            Self::ArmCells => "arming: waiting for the cell beeps",
            Self::ArmReady => "arming: waiting for do re mi",
            Self::Armed => "armed",
            Self::Running => "running",
            Self::CalibrateHoldMax => "range calibration: maximum pulses",
            Self::CalibrateHoldMin => "range calibration: minimum pulses",
            Self::ProgrammingEscape => "leaving the ESC's programming",
            Self::Faulted => "stopped by a fault",
        }
    }
}
