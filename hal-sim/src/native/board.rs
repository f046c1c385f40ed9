//! The board of a native run.
//!
//! What it is: the firmware's console with what stands around it on a desk: the pulse timer's register, the flash, the resets. One call a
//! control tick; native run, fault campaign and virtual boards use this one.
//! What can go wrong: more captures in a millisecond than the board's queue holds are lost and told, as there.
//! Units: ticks of 84 MHz.
//! Reference: house rules 1 (ticks without I/O) and 12 (one shell, many hosts).

use super::sectors::Sectors;
use crate::bench::{CONVERSION_HZ, Listens, Millisecond};
use esc_pwm::dshot::{Frame, Throttle};
use firmware_rig::burst;
use firmware_rig::queue::CAPACITY;
use firmware_rig::{Beside, Config, Conversions, Delivered, Rig, RigConfig, RigConsole, Start};
use frame::message::{ClockNews, Crash, CrashCause, Event, SettingsNews, Trial};
use frame::units::{PulseWidth, Ticks};

/// Reset cause after power-on: power-on, brown-out and pin flags (RM0090 section 7.3.21).
pub const POWER_ON: u8 = 0x0E;
/// Reset cause of the watchdog: its own flag and the pin's.
pub const WATCHDOG: u8 = 0x24;
/// Reset cause of a panic: software's flag and the pin's.
pub const SOFTWARE: u8 = 0x14;
/// Reset cause of the reset key: the pin's flag alone.
pub const PIN: u8 = 0x04;
/// The crystal of a board on a desk, Hz.
const CRYSTAL: ClockNews = ClockNews { crystal_hz: 8_000_000, measured_hz: 8_000_000 };
/// A crystal that does not oscillate.
const NO_CRYSTAL: ClockNews = ClockNews { crystal_hz: 0, measured_hz: 0 };
/// Ticks that the self-test's trial holds up.
const LATE_TICKS: u32 = 8;

/// What the board's pins show beside captures and conversions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wires {
    /// The stop loop is open.
    pub stop_open: bool,
    /// The board's own supply is too low.
    pub brown_out: bool,
}

impl Wires {
    /// The stop loop closed, the supply in order.
    pub const SOUND: Self = Self { stop_open: false, brown_out: false };
}

/// The board with its pulse timer and its flash.
pub struct Board {
    console: RigConsole,
    factory: Config,
    flash: Flash,
    clock: ClockNews,
    stored: Option<SettingsNews>,
    pulse: PulseWidth,
    /// Its frame asks the ESC for telemetry.
    asks: bool,
    late: u32,
    /// Memory of a burst.
    burst: Vec<u16>,
}

/// The settings' sectors and what was found in them.
#[derive(Clone)]
struct Flash {
    /// `None` while they are erased: most boards of a campaign never store anything.
    sectors: Option<Sectors>,
    found: Option<RigConfig>,
    news: SettingsNews,
    /// Saves so far.
    saves: u32,
}

impl Flash {
    const ERASED: Self = Self { sectors: None, found: None, news: SettingsNews::Absent, saves: 0 };

    fn holding(mut sectors: Sectors) -> Self {
        let (found, news) = settings_store::load(&mut sectors, Sectors::RANGE);
        Self { sectors: Some(sectors), found, news, saves: 0 }
    }

    fn save(&mut self, settings: &RigConfig) -> SettingsNews {
        let mut sectors = self.sectors.take().unwrap_or_default();
        let told = settings_store::save(&mut sectors, Sectors::RANGE, settings);
        *self = Self { saves: self.saves + 1, ..Self::holding(sectors) };
        told
    }
}

impl Board {
    /// A board that is switched on, with nothing in its flash.
    #[must_use]
    pub fn new(factory: Config) -> Self {
        Self::start(Ticks(0), factory, Flash::ERASED, CRYSTAL, POWER_ON, None)
    }

    /// A board whose crystal cannot be trusted when it is switched on: it runs from its internal oscillator.
    #[must_use]
    pub fn without_crystal(factory: Config) -> Self {
        Self::start(Ticks(0), factory, Flash::ERASED, NO_CRYSTAL, POWER_ON, None)
    }

    /// A board that is switched on, with `sectors` in the place of its own.
    #[must_use]
    pub fn with_flash(factory: Config, sectors: Sectors) -> Self {
        Self::start(Ticks(0), factory, Flash::holding(sectors), CRYSTAL, POWER_ON, None)
    }

    fn start(now: Ticks, factory: Config, flash: Flash, clock: ClockNews, reset_cause: u8, ended: Option<Event>) -> Self {
        let start = Start { reset_cause, clock, stored: flash.found, news: flash.news, ended };
        let console = RigConsole::start(now, factory.clone(), &start);
        Self { console, factory, flash, clock, stored: None, pulse: PulseWidth::MIN, asks: false, late: 0, burst: Vec::new() }
    }

    /// The same board after a reset of the given cause: its flash is what it was.
    #[must_use]
    pub fn after_reset(&self, now: Ticks, reset_cause: u8) -> Self {
        Self::start(now, self.factory.clone(), self.flash.clone(), self.clock, reset_cause, None)
    }

    /// The same board after the last resort has reset it, which tells what `ended` the program.
    #[must_use]
    pub fn after_end(&self, now: Ticks, ended: Event) -> Self {
        let failed = matches!(ended, Event::Crashed(Crash { cause: CrashCause::ClockFailed, .. }));
        let clock = if failed { NO_CRYSTAL } else { self.clock };
        Self::start(now, self.factory.clone(), self.flash.clone(), clock, SOFTWARE, Some(ended))
    }

    /// The portable firmware, for reading.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        self.console.rig()
    }

    /// What the timer's compare register holds: the pulse of the next frame.
    #[must_use]
    pub fn pulse(&self) -> PulseWidth {
        self.pulse
    }

    /// The DShot frame that the next millisecond carries; `None` while the ESC is told by pulses.
    #[must_use]
    pub fn frame(&self) -> Option<Frame> {
        let digital = self.rig().config().output.is_digital();
        digital.then(|| Frame { throttle: Throttle::of(self.pulse), telemetry: self.asks })
    }

    /// Takes the bytes that arrived on the line.
    pub fn hear(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.console.hear(*byte));
    }

    /// The analogue channel of which every single conversion is wanted: give it to [`Millisecond::watched`].
    #[must_use]
    pub fn wanted(&self) -> Option<usize> {
        self.console.wanted()
    }

    /// What of the cross-checks it listens to: give it to [`crate::Bench::listen`].
    #[must_use]
    pub fn listens(&self) -> Listens {
        let config = self.rig().config();
        Listens { esc: config.esc_telemetry.is_some(), back_emf: config.back_emf > 0 }
    }

    /// The millisecond that ends at `now`: two looks for a stop, and the control tick.
    pub fn millisecond(&mut self, now: Ticks, gathered: &Millisecond, wires: Wires) {
        if self.late > 0 {
            self.late -= 1;
            return;
        }
        for _ in 0..2 {
            if self.console.look(wires.stop_open).minimum {
                self.pulse = PulseWidth::MIN;
            }
        }
        let fitted = self.console.rig().fitted();
        let seen = |channel: usize| if fitted >> channel & 1 == 0 { &[][..] } else { gathered.edges[channel].as_slice() };
        let listens = self.listens();
        let turns: &[u32] = if listens.back_emf { &gathered.back_emf } else { &[] };
        let delivered = Delivered {
            now,
            edges: core::array::from_fn(|n| &seen(n)[..seen(n).len().min(CAPACITY)]),
            over_capture: core::array::from_fn(|n| seen(n).len() > CAPACITY),
            adc: &gathered.adc,
            beside: Beside {
                esc: if listens.esc { &gathered.esc } else { &[] },
                back_emf: &turns[..turns.len().min(CAPACITY)],
                over_capture: turns.len() > CAPACITY,
            },
            brown_out: wires.brown_out,
            paused: false, // the flash of a desk takes no time
            stored: self.stored.take(),
            vitals: None,
        };
        let wanted = self.console.wanted();
        let orders = self.console.tick(&delivered, |pulse, ask| (self.pulse, self.asks) = (pulse, ask));
        if wanted.is_some() {
            self.burst.resize(burst::LENGTH, 0);
        }
        let codes = (wanted == gathered.watched).then_some(gathered.codes.as_slice());
        self.console.record(now, &Conversions { codes, rate_hz: CONVERSION_HZ }, &mut self.burst);
        if orders.store {
            self.stored = Some(self.flash.save(&self.console.rig().settings()));
        }
        match orders.trial {
            Some(Trial::Late) => self.late = LATE_TICKS,
            Some(Trial::Hang) => *self = self.after_reset(now, WATCHDOG),
            Some(Trial::Panic) => *self = self.after_reset(now, SOFTWARE),
            None => {}
        }
    }

    /// The bytes of the host, then the tick; while the board's supply is gone (`dark`) it is in reset.
    pub(super) fn pass(&mut self, now: Ticks, gathered: &Millisecond, bytes: &[u8], wires: Wires, dark: bool) {
        if dark {
            *self = self.after_reset(now, POWER_ON);
        } else {
            self.hear(bytes);
            self.millisecond(now, gathered, wires);
        }
    }

    /// The settings' sectors, once something was stored in them, and how often that was.
    #[must_use]
    pub fn flash(&self) -> (Option<&Sectors>, u32) {
        (self.flash.sectors.as_ref(), self.flash.saves)
    }

    /// Takes the bytes that the board has sent.
    #[must_use]
    pub fn sent(&mut self) -> Vec<u8> {
        let bytes = self.console.queued().to_vec();
        self.console.sent();
        bytes
    }
}
