//! What stops a motor, and what speaks against starting it.
//!
//! What it is: [`Fault`] and a set of them ([`FaultSet`]); [`Refusals`], every reason why a command was not obeyed.
//! What can go wrong: nothing; both are bits, and each bit has its words.
//! Units: none.
//! Reference: Beharie 2013, section 3.2 and Appendix C.

/// What stopped the motor. Bits of a [`FaultSet`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Fault {
    /// The operator's stop: command or stop input.
    OperatorStop = 0,
    /// Nothing was heard from the host for the link time-out.
    LinkLost = 1,
    /// Rotor speed above the configured limit.
    Overspeed = 2,
    /// Current above the configured limit.
    OverCurrent = 3,
    /// Supply below the configured limit.
    UnderVoltage = 4,
    /// Load cell beyond its yield margin.
    LoadCellOverload = 5,
    /// RPM channels disagree.
    SensorDisagreement = 6,
    /// The control task missed its deadline.
    ControlStalled = 7,
    /// The ESC did not answer as the arming table expects.
    ArmingTimeout = 8,
    /// The ESC reported a failed self-test (twenty short beeps).
    EscSelfTest = 9,
    /// Conversion data missing or damaged.
    AdcLost = 10,
    /// A speed channel fell silent, or its line is stuck, while the others see the rotor turn.
    SensorLost = 11,
    /// Damaged frames keep coming from the host.
    LinkCorrupt = 12,
    /// A command frame came a second time.
    CommandReplayed = 13,
    /// The board's own supply fell below the voltage detector's level.
    BrownOut = 14,
    /// The crystal is silent, failed, or is none that the firmware knows: the board runs from its internal oscillator. Stands until a
    /// reset finds a good crystal.
    ClockFailed = 15,
    /// The rotor turned while it had to stand: during the range calibration.
    RotorTurned = 16,
    /// Rotor speed or current below its lower limit although the throttle is open.
    BelowLimit = 17,
    /// Supply above the configured limit.
    OverVoltage = 18,
    /// Torque beyond a configured limit.
    TorqueLimit = 19,
    /// Temperature beyond a configured limit.
    TemperatureLimit = 20,
    /// The host's schedule was played to the end of what had arrived, and more was to come.
    StreamDry = 21,
}

impl Fault {
    /// Every fault, in the order of its bit.
    pub const ALL: [Self; 22] = [
        Self::OperatorStop,
        Self::LinkLost,
        Self::Overspeed,
        Self::OverCurrent,
        Self::UnderVoltage,
        Self::LoadCellOverload,
        Self::SensorDisagreement,
        Self::ControlStalled,
        Self::ArmingTimeout,
        Self::EscSelfTest,
        Self::AdcLost,
        Self::SensorLost,
        Self::LinkCorrupt,
        Self::CommandReplayed,
        Self::BrownOut,
        Self::ClockFailed,
        Self::RotorTurned,
        Self::BelowLimit,
        Self::OverVoltage,
        Self::TorqueLimit,
        Self::TemperatureLimit,
        Self::StreamDry,
    ];

    /// The fault in words, for people.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::OperatorStop => "operator's stop",
            Self::LinkLost => "link lost",
            Self::Overspeed => "overspeed",
            Self::OverCurrent => "over-current",
            Self::UnderVoltage => "under-voltage",
            Self::LoadCellOverload => "load cell overloaded",
            Self::SensorDisagreement => "speed sensors disagree",
            Self::ControlStalled => "control task stalled",
            Self::ArmingTimeout => "ESC did not answer",
            Self::EscSelfTest => "ESC self-test failed",
            Self::AdcLost => "conversions lost",
            Self::SensorLost => "speed sensor lost",
            Self::LinkCorrupt => "link corrupt",
            Self::CommandReplayed => "command replayed",
            Self::BrownOut => "brown-out",
            Self::ClockFailed => "crystal failed",
            Self::RotorTurned => "the rotor turned while it had to stand",
            Self::BelowLimit => "speed or current below its limit",
            Self::OverVoltage => "over-voltage",
            Self::TorqueLimit => "torque beyond its limit",
            Self::TemperatureLimit => "temperature beyond its limit",
            Self::StreamDry => "schedule ran dry",
        }
    }
}

/// A set of latched [`Fault`]s.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FaultSet(pub u32);

impl FaultSet {
    /// No fault.
    pub const NONE: Self = Self(0);

    /// The set with `fault` in it as well.
    #[must_use]
    pub const fn with(self, fault: Fault) -> Self {
        Self(self.0 | (1 << fault as u8))
    }

    /// Whether `fault` is in the set.
    #[must_use]
    pub const fn contains(self, fault: Fault) -> bool {
        self.0 & (1 << fault as u8) != 0
    }

    /// Whether nothing is latched.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The faults in the set, in the order of their bits.
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL.into_iter().filter(move |fault| self.contains(*fault))
    }
}

/// The names of its faults, as people read them.
impl core::fmt::Display for FaultSet {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if self.is_empty() {
            return f.write_str("no fault");
        }
        listed(f, self.iter().map(Fault::words))
    }
}

/// Words with a comma between them.
fn listed<'w>(f: &mut core::fmt::Formatter<'_>, words: impl Iterator<Item = &'w str>) -> core::fmt::Result {
    words.enumerate().try_for_each(|(n, words)| {
        f.write_str(if n > 0 { ", " } else { "" })?;
        f.write_str(words)
    })
}

/// All reasons why a command was refused. Bits, so that a refusal lists every one of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Refusals(pub u16);

/// Every reason, as people read it.
impl core::fmt::Display for Refusals {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        listed(f, self.words())
    }
}

impl Refusals {
    /// The command does not belong to this state.
    pub const WRONG_STATE: u16 = 1;
    /// A fault is latched.
    pub const FAULT_LATCHED: u16 = 1 << 1;
    /// The throttle setting is not at minimum.
    pub const THROTTLE_NOT_LOW: u16 = 1 << 2;
    /// No low-throttle interval has passed since the last run.
    pub const NO_LOW_INTERVAL: u16 = 1 << 3;
    /// The ESC is powered, or might be, where it must not be.
    pub const ESC_POWERED: u16 = 1 << 4;
    /// The command's own confirmation is missing.
    pub const NOT_CONFIRMED: u16 = 1 << 5;
    /// A value is out of its range.
    pub const OUT_OF_RANGE: u16 = 1 << 6;
    /// The schedule holds no step.
    pub const EMPTY_SCHEDULE: u16 = 1 << 7;
    /// The rotor turns although it should stand.
    pub const ROTOR_TURNING: u16 = 1 << 8;
    /// The frame is not newer than the last one of the host.
    pub const REPLAYED: u16 = 1 << 9;
    /// The settings could not be stored.
    pub const NOT_STORED: u16 = 1 << 10;
    /// The supply reads off, but it was never seen on since the reset: an unplugged wire reads the same.
    pub const SUPPLY_UNPROVEN: u16 = 1 << 11;
    /// Nothing is fitted that would see the rotor turn.
    pub const NO_WITNESS: u16 = 1 << 12;
    /// The stop loop is open: the key is pressed, or the loop broken or unplugged.
    pub const STOP_OPEN: u16 = 1 << 13;
    /// Of a schedule that is still to be sent too little is there to begin with.
    pub const SHORT_STREAM: u16 = 1 << 14;
    /// The ESC is told its throttle as numbers: it has no throttle range.
    pub const NO_RANGE: u16 = 1 << 15;

    /// Every reason and its words, for people.
    pub const WORDS: [(u16, &'static str); 16] = [
        (Self::WRONG_STATE, "not in this state"),
        (Self::FAULT_LATCHED, "a fault is latched: clear it first"),
        (Self::THROTTLE_NOT_LOW, "throttle is not at minimum"),
        (Self::NO_LOW_INTERVAL, "no low-throttle interval since the last run"),
        (Self::ESC_POWERED, "the ESC is powered"),
        (Self::NOT_CONFIRMED, "confirmation is missing"),
        (Self::OUT_OF_RANGE, "a value is out of range"),
        (Self::EMPTY_SCHEDULE, "the schedule is empty"),
        (Self::ROTOR_TURNING, "the rotor turns"),
        (Self::REPLAYED, "the frame is not newer than the last one"),
        (Self::NOT_STORED, "the settings could not be stored"),
        (Self::SUPPLY_UNPROVEN, "the supply reads off but was never seen on: switch the ESC on and off once, then ask again"),
        (Self::NO_WITNESS, "neither a speed sensor nor the current is fitted: nothing would see the rotor turn"),
        (Self::STOP_OPEN, "the stop loop is open: let the key go, check plug and wire"),
        (Self::SHORT_STREAM, "too little of the schedule is there to begin with"),
        (Self::NO_RANGE, "DShot has no throttle range to calibrate"),
    ];

    /// The reasons in words.
    pub fn words(self) -> impl Iterator<Item = &'static str> {
        Self::WORDS.into_iter().filter(move |(bit, _)| self.0 & bit != 0).map(|(_, words)| words)
    }

    /// Nothing speaks against it.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Adds `reason` when `present`.
    #[must_use]
    pub const fn with_if(self, reason: u16, present: bool) -> Self {
        if present { Self(self.0 | reason) } else { self }
    }
}
