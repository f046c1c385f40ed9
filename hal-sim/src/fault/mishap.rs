//! What goes wrong, and where.
//!
//! What it is: every kind with its place; [`Mishap::all`] is the list that a campaign goes through.
//! What can go wrong: nothing here fails; whether a rig has the place is settled by the plan, which fits what is missing.
//! Units: ms.
//! Reference: specification `rig.md`, "The simulator" (faults) and "On a real bench".

/// A kind of mishap. Channels: 0 beam, 1 reflective, 2 hall, 3 encoder; 0 strain, 1 torque, 2 current, 3 voltage, 4 temperature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are the channels of the type's own line, and ends of a range")]
pub enum Mishap {
    /// Nothing: a healthy rig raises no fault.
    Nothing,
    /// A capture line sticks at its level: the sensor is gone, or its wire.
    StuckLine { channel: u8 },
    /// A sensor gives edges that come from no mark.
    Stray { channel: u8 },
    /// A sensor overlooks one mark in four to six.
    Misses { channel: u8 },
    /// A sensor sees one mark in three or four twice.
    Doubles { channel: u8 },
    /// The second of two marks is not opposite the first.
    Uneven { channel: u8 },
    /// A sensor reads a few per cent high or low: another disc than the configuration says.
    Skewed { channel: u8 },
    /// A sensor reads a speed beyond the limit.
    Fast { channel: u8 },
    /// The edges of a sensor come faster than any rotor gives them.
    Screams { channel: u8 },
    /// An edge is overwritten before it was read.
    Overwritten { channel: u8 },
    /// A capture input that is not fitted picks up edges.
    FloatingLine { channel: u8 },
    /// Two sensors overlook marks.
    TwoMiss { a: u8, b: u8 },
    /// Two sensors read off, one high and one low.
    TwoSkewed { a: u8, b: u8 },
    /// Two sensors read a speed beyond the limit.
    TwoFast { a: u8, b: u8 },
    /// An ADC pin sits at an end of its range.
    Saturated { channel: u8, high: bool },
    /// An analogue wire opens and closes, each time for less than a limit's time.
    Contact { channel: u8 },
    /// An analogue input that is not fitted floats.
    FloatingInput { channel: u8 },
    /// The converter delivers nothing any more.
    NoConversions,
    /// The converter delivers nothing for less than a limit's time, as after an overrun.
    Gap,
    /// The load cell is pushed beyond its range.
    Overload { up: bool },
    /// The torque arm is twisted beyond its limit.
    Twist { up: bool },
    /// The current exceeds its limit.
    OverCurrent,
    /// The ESC's supply leaves its limits.
    Supply { high: bool },
    /// The temperature leaves its limits.
    Temperature { high: bool },
    /// The throttle drives the rotor beyond its limit of speed.
    Overspeed,
    /// The ESC's battery comes off.
    PowerCut,
    /// The ESC's pulse wire comes off.
    PulseWire,
    /// Every frame of the host arrives damaged.
    CorruptFrames,
    /// One frame of the host arrives damaged.
    OneCorrupt,
    /// Random bytes on the host's line.
    Garbage,
    /// Of every frame of the host only one half arrives, the front one or the back one.
    Partial { front: bool },
    /// The board hears what it says itself.
    Echo,
    /// A frame of the host arrives a second time.
    Replay,
    /// The host falls silent.
    Silence,
    /// The host is silent for a little less than it may.
    LateHost,
    /// The host asks for something.
    Asked(Request),
    /// The host's schedule ends before its end.
    StreamDry,
    /// The ESC beeps that it has no signal.
    EscNoSignal,
    /// The ESC beeps that its self-test failed.
    EscFails,
    /// The board's own supply falls below the voltage detector's level, but not below the reset level.
    SupplyDip,
    /// The board's own supply falls below the reset level and comes back.
    PowerLoss,
    /// The reset key.
    ResetKey,
    /// The control task comes late once.
    LateTick { ms: u8 },
    /// The control task does not come any more.
    Hang,
    /// The program panics.
    Panic,
    /// The processor takes a hard fault.
    HardFault,
    /// The crystal stops.
    CrystalFails,
    /// The board's supply is lost while settings are being stored.
    SaveCut,
    /// The stop loop opens and stays open: the key, its wire or its plug.
    StopOpen,
    /// The stop loop opens for a millisecond.
    StopBlink,
    /// The stop loop is open when the board is switched on.
    StopHeld,
    /// The crystal is dead, or another, when the board is switched on.
    CrystalDead,
    /// The ESC never gets power.
    EscMute,
    /// While maximum is held, a sensor sees the rotor turn.
    RotorTurns { channel: u8 },
    /// While maximum is held, the current is above idle.
    NotIdle,
    /// The ESC takes its maximum, and nobody passes its beeps on.
    Unheard,
    /// The supply's sense wire is off from the start, and the range calibration is asked for.
    OpenSense,
}

/// What a host asks for at the wrong time, or at the right one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Request {
    /// Stop.
    Stop,
    /// Minimum throttle by the manual setting.
    Minimum,
    /// Arm.
    Arm,
    /// The range calibration, confirmed.
    Calibrate,
    /// The self-test's panic, confirmed.
    TryPanic,
    /// The self-test's hang, confirmed.
    TryHang,
    /// The self-test's late tick, confirmed.
    TryLate,
    /// Another setting.
    Configure,
    /// A configuration that was never sent.
    Apply,
    /// The settings into flash.
    Save,
    /// The tare.
    Tare,
    /// Faults cleared that are not there.
    Clear,
    /// A schedule that was never sent.
    Schedule,
    /// A pulse beyond 2000 us.
    TooHigh,
}

impl Request {
    /// Every one.
    pub const ALL: [Self; 14] = [
        Self::Stop,
        Self::Minimum,
        Self::Arm,
        Self::Calibrate,
        Self::TryPanic,
        Self::TryHang,
        Self::TryLate,
        Self::Configure,
        Self::Apply,
        Self::Save,
        Self::Tare,
        Self::Clear,
        Self::Schedule,
        Self::TooHigh,
    ];
}

/// Pairs of capture channels.
const PAIRS: [(u8, u8); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];

impl Mishap {
    /// Every kind at every place once.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let mut list = vec![Self::Nothing];
        for channel in 0..4 {
            list.extend([Self::StuckLine { channel }, Self::Stray { channel }, Self::Misses { channel }]);
            list.extend([Self::Doubles { channel }, Self::Skewed { channel }, Self::Fast { channel }]);
            list.extend([Self::Screams { channel }, Self::Overwritten { channel }, Self::FloatingLine { channel }]);
            list.push(Self::RotorTurns { channel });
        }
        list.extend([0, 2].map(|channel| Self::Uneven { channel }));
        for (a, b) in PAIRS {
            list.extend([Self::TwoMiss { a, b }, Self::TwoSkewed { a, b }, Self::TwoFast { a, b }]);
        }
        for channel in 0..5 {
            list.extend([true, false].map(|high| Self::Saturated { channel, high }));
            list.extend([Self::Contact { channel }, Self::FloatingInput { channel }]);
        }
        for end in [true, false] {
            list.extend([Self::Overload { up: end }, Self::Twist { up: end }, Self::Supply { high: end }]);
            list.extend([Self::Temperature { high: end }, Self::Partial { front: end }]);
        }
        list.extend(Request::ALL.map(Self::Asked));
        list.extend([Self::NoConversions, Self::Gap, Self::OverCurrent, Self::Overspeed, Self::PowerCut, Self::PulseWire]);
        list.extend([Self::CorruptFrames, Self::OneCorrupt, Self::Garbage, Self::Echo, Self::Replay, Self::Silence]);
        list.extend([Self::LateHost, Self::StreamDry, Self::EscNoSignal, Self::EscFails, Self::SupplyDip, Self::PowerLoss]);
        list.extend([Self::ResetKey, Self::LateTick { ms: 7 }, Self::Hang, Self::Panic, Self::HardFault, Self::CrystalFails]);
        list.extend([Self::SaveCut, Self::StopOpen, Self::StopBlink, Self::StopHeld, Self::CrystalDead, Self::EscMute]);
        list.extend([Self::NotIdle, Self::Unheard, Self::OpenSense]);
        list
    }

    /// Capture channels that it is about, a bit each.
    #[must_use]
    pub const fn lines(self) -> u8 {
        match self {
            Self::StuckLine { channel }
            | Self::Stray { channel }
            | Self::Misses { channel }
            | Self::Doubles { channel }
            | Self::Uneven { channel }
            | Self::Skewed { channel }
            | Self::Fast { channel }
            | Self::Screams { channel }
            | Self::Overwritten { channel }
            | Self::FloatingLine { channel }
            | Self::RotorTurns { channel } => 1 << channel,
            Self::TwoMiss { a, b } | Self::TwoSkewed { a, b } | Self::TwoFast { a, b } => 1 << a | 1 << b,
            _ => 0,
        }
    }

    /// Whether the pins of the emulated board can show it. The encoder's steps pass a prescaler there: a step that is missing is no mark.
    #[must_use]
    pub const fn on_image(self) -> bool {
        match self {
            Self::Misses { channel } => channel != 3,
            Self::TwoMiss { b, .. } => b != 3,
            Self::Stray { .. }
            | Self::Doubles { .. }
            | Self::Uneven { .. }
            | Self::PowerLoss
            | Self::Panic
            | Self::SaveCut
            | Self::Unheard => false,
            _ => true,
        }
    }

    /// Whether it ends in a reset of the board.
    #[must_use]
    pub const fn resets(self) -> bool {
        matches!(
            self,
            Self::PowerLoss | Self::ResetKey | Self::Hang | Self::Panic | Self::HardFault | Self::CrystalFails | Self::SaveCut
        )
    }
}
