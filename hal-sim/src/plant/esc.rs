//! Electronic speed controller: start-up dialogue, throttle range, loss of signal.
//!
//! What it is: what the ESC of Appendix C does between power-on and "ready", its beeps as events, and the throttle that it
//! passes on to the motor, limited by its protections. It takes pulses or DShot frames: the form that it hears first after power-on,
//! until its power is cut. Frames have no throttle range and no programming mode.
//! What can go wrong: no signal (it beeps without end), a throttle that is neither low nor high at power-on (the same), a
//! failed self-test (twenty beeps), maximum throttle held for 6 s (programming mode until power is cut). A frame with a wrong checksum is
//! none. When frames cease the motor stops, and only frames of throttle 0 make it ready again.
//! Units: pulse width in ns, time in ns, throttle 0..1.
//! Reference: Beharie 2013 Appendix C (start-up, throttle range, protections B and D) and Figure 3.10. Tone lengths are assumed. Frames:
//! BLHeli_S manual ("DShot", arming at zero throttle, loss of signal).

use super::esc_guard::{Guard, GuardState};
use super::esc_program::{Menu, Outcome, Settings};
use esc_pwm::dshot::{Frame, Throttle};
use frame::message::Beep;
use std::collections::VecDeque;

/// One millisecond in nanoseconds.
const MS: u64 = 1_000_000;
/// Power-on to the end of the self-test.
const SELF_TEST: u64 = 500 * MS;
/// Length of the long beep, of a pair of beeps and of the pause before "1-2-3".
const TONE: u64 = 700 * MS;
/// One short beep with its pause.
const SHORT: u64 = 250 * MS;
/// Without a pulse for this long the signal counts as absent.
const NO_PULSE: u64 = 100 * MS;
/// Loss of signal for this long reduces the output (protection B).
const SIGNAL_LOST: u64 = 1000 * MS;
/// Output after loss of signal (protection B).
const LOST_THROTTLE: f64 = 0.2;
/// Without a frame for this long the motor stops, and the signal counts as absent (assumed).
const FRAMES_LOST: u64 = 250 * MS;
/// Shortest pulse that counts as maximum throttle, ns.
const OPEN_NS: u32 = 1_900_000;
/// Maximum held this long after its two beeps opens the programming mode.
const PROGRAMMING: u64 = 6000 * MS;

/// Parameters of one ESC.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Esc {
    /// Stored pulse of zero throttle, ns.
    pub range_min_ns: u32,
    /// Stored pulse of full throttle, ns.
    pub range_max_ns: u32,
    /// Fails its self-test (protection D).
    pub self_test_fails: bool,
    /// Protections A and C.
    pub guard: Guard,
}

impl Default for Esc {
    fn default() -> Self {
        Self { range_min_ns: 1_000_000, range_max_ns: 2_000_000, self_test_fails: false, guard: Guard::default() }
    }
}

/// Where the ESC stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EscState {
    /// No power.
    Off,
    /// Self-test after power-on.
    SelfTest,
    /// Beeping for want of a signal.
    NoSignal,
    /// Minimum seen: long beep sounds.
    Long,
    /// Counting its cells.
    Cells,
    /// Before "1-2-3".
    Ready,
    /// Throttle goes to the motor.
    Running,
    /// Maximum seen at power-on: two beeps sound.
    Double,
    /// Maximum stored, waiting for minimum.
    WaitMinimum,
    /// Programming mode; only cutting the power ends it.
    Programming,
    /// Self-test failed.
    Failed,
}

/// What the ESC heard last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Heard {
    /// A pulse of so many nanoseconds.
    Pulse(u32),
    /// A frame.
    Frame(Throttle),
}

/// The ESC's dialogue.
#[derive(Debug, Clone, PartialEq)]
pub struct EscDialogue {
    esc: Esc,
    cells: u8,
    state: EscState,
    since: u64,
    now: u64,
    heard: Heard,
    heard_at: Option<u64>,
    /// The form that it has heard first since power-on: frames, or pulses.
    digital: Option<bool>,
    beeps: VecDeque<(u64, Beep)>,
    guard: GuardState,
    allowed: f64,
    settings: Settings,
    menu: Menu,
}

impl EscDialogue {
    /// Unpowered, on a supply of `cells` cells.
    #[must_use]
    pub fn new(esc: Esc, cells: u8) -> Self {
        Self {
            guard: GuardState::new(&esc.guard),
            allowed: 1.0,
            settings: Settings::default(),
            menu: Menu::default(),
            esc,
            cells,
            state: EscState::Off,
            since: 0,
            now: 0,
            heard: Heard::Pulse(0),
            heard_at: None,
            digital: None,
            beeps: VecDeque::new(),
        }
    }

    /// Where it stands.
    #[must_use]
    pub fn state(&self) -> EscState {
        self.state
    }

    /// The throttle range in force; a calibration changes it and it survives a power cycle.
    #[must_use]
    pub fn range_ns(&self) -> (u32, u32) {
        (self.esc.range_min_ns, self.esc.range_max_ns)
    }

    /// Goes on with another ESC's properties; the stored range stays.
    pub fn refit(&mut self, esc: Esc) {
        let (low, high) = self.range_ns();
        self.esc = Esc { range_min_ns: low, range_max_ns: high, ..esc };
    }

    /// What the programming mode has stored; it survives a power cycle, as the range does.
    #[must_use]
    pub fn settings(&self) -> Settings {
        self.settings
    }

    /// Item and option of the programming mode that sound now.
    #[must_use]
    pub fn programming(&self) -> Option<(super::esc_program::Item, Option<u8>)> {
        (self.state == EscState::Programming).then(|| self.menu.sounding())
    }

    /// Temperature of the ESC, degC.
    #[must_use]
    pub fn temperature_c(&self) -> f64 {
        self.guard.temperature_c
    }

    /// What stands at the ESC's terminals for `dt_s`: protections A and C.
    pub fn feel(&mut self, voltage_v: f64, current_a: f64, dt_s: f64) {
        let closed = self.is_min();
        let running = self.state == EscState::Running;
        let volts = if running { voltage_v } else { f64::INFINITY };
        self.allowed = self.guard.step(&self.esc.guard, self.cells, volts, current_a, closed, dt_s);
    }

    /// Connects or cuts the power.
    pub fn set_power(&mut self, on: bool) {
        if on && self.state == EscState::Off {
            self.digital = None;
            self.enter(EscState::SelfTest);
        } else if !on {
            self.enter(EscState::Off);
        }
    }

    /// Goes on as an ESC that was switched on and ready before: only its board has just started.
    pub fn set_ready(&mut self) {
        self.enter(EscState::Running);
    }

    /// A pulse of `width_ns` ended at `at_ns`. Widths outside 0.8..2.2 ms are no pulses.
    pub fn pulse(&mut self, at_ns: u64, width_ns: u32) {
        if (800_000..=2_200_000).contains(&width_ns) {
            self.hear(at_ns, Heard::Pulse(width_ns));
        }
    }

    /// A DShot frame of 16 bits ended at `at_ns`. What does not check is no frame, and special commands are none to this ESC.
    pub fn frame(&mut self, at_ns: u64, word: u16) {
        if let Some(frame) = Frame::from_word(word) {
            self.hear(at_ns, Heard::Frame(frame.throttle));
        }
    }

    /// Takes what is of the form that it has recognised; without power it recognises none.
    fn hear(&mut self, at_ns: u64, heard: Heard) {
        let digital = matches!(heard, Heard::Frame(_));
        if self.powered() && *self.digital.get_or_insert(digital) != digital {
            return;
        }
        (self.heard, self.heard_at) = (heard, Some(at_ns));
    }

    /// The next beep pattern that has ended, with the time of its end, ns.
    pub fn beep(&mut self) -> Option<(u64, Beep)> {
        self.beeps.pop_front()
    }

    fn enter(&mut self, state: EscState) {
        self.state = state;
        self.since = self.now;
    }

    fn sound(&mut self, beep: Beep) {
        self.beeps.push_back((self.now, beep));
    }

    fn silence(&self) -> u64 {
        self.heard_at.map_or(u64::MAX, |at| self.now.saturating_sub(at))
    }

    fn is_heard(&self) -> bool {
        self.silence() < NO_PULSE
    }

    fn is_min(&self) -> bool {
        let low = match self.heard {
            Heard::Pulse(ns) => ns <= self.esc.range_min_ns.saturating_add(30_000),
            Heard::Frame(throttle) => throttle == Throttle::STOP,
        };
        self.is_heard() && low
    }

    /// The pulse that is heard now, ns; `None` of frames.
    fn pulse_ns(&self) -> Option<u32> {
        match self.heard {
            Heard::Pulse(ns) if self.is_heard() => Some(ns),
            _ => None,
        }
    }

    fn is_max(&self) -> bool {
        self.pulse_ns().is_some_and(|ns| ns >= OPEN_NS)
    }

    /// Steps the dialogue to `now_ns` (call it at least every few milliseconds).
    pub fn advance_to(&mut self, now_ns: u64) {
        self.now = now_ns;
        let age = now_ns.saturating_sub(self.since);
        match self.state {
            EscState::Running if matches!(self.heard, Heard::Frame(_)) && self.silence() >= FRAMES_LOST => {
                self.enter(EscState::NoSignal);
            }
            EscState::Off | EscState::Running => {}
            EscState::Programming => {
                let (closed, open) = (self.is_min(), self.is_max());
                if self.menu.step(&mut self.settings, now_ns, closed, open) == Outcome::Leaves {
                    self.enter(EscState::SelfTest);
                }
                self.esc.guard.cutoff = self.settings.cutoff();
                self.esc.guard.cutoff_v_per_cell = self.settings.cutoff_v_per_cell();
            }
            EscState::SelfTest if age >= SELF_TEST => {
                if self.esc.self_test_fails {
                    self.enter(EscState::Failed);
                } else if self.is_min() {
                    self.enter(EscState::Long);
                } else if self.is_max() {
                    self.enter(EscState::Double);
                } else {
                    self.enter(EscState::NoSignal);
                    self.sound(Beep::NoSignal);
                }
            }
            EscState::NoSignal => {
                if self.is_min() {
                    self.enter(EscState::Long);
                } else if age >= 1000 * MS {
                    self.sound(Beep::NoSignal);
                    self.since = now_ns;
                }
            }
            EscState::Long if age >= TONE => {
                self.sound(Beep::Long);
                self.enter(EscState::Cells);
            }
            EscState::Cells if age >= SHORT * (u64::from(self.cells) + 1) => {
                self.sound(Beep::Cells(self.cells));
                self.enter(EscState::Ready);
            }
            EscState::Ready if age >= TONE => {
                self.sound(Beep::Ready);
                self.enter(EscState::Running);
            }
            EscState::Double if age >= TONE => {
                if let Heard::Pulse(ns) = self.heard {
                    self.esc.range_max_ns = ns;
                }
                self.sound(Beep::Double);
                self.enter(EscState::WaitMinimum);
            }
            EscState::WaitMinimum => {
                if let Some(ns) = self.pulse_ns().filter(|ns| *ns <= 1_200_000) {
                    self.esc.range_min_ns = ns;
                    self.enter(EscState::Long);
                } else if age >= PROGRAMMING {
                    self.sound(Beep::Programming);
                    self.enter(EscState::Programming);
                    self.menu = Menu::open(now_ns);
                }
            }
            EscState::Failed if age >= 20 * SHORT / 2 => {
                self.sound(Beep::SelfTestFailed);
                self.since = now_ns;
            }
            _ => {}
        }
    }

    /// Pulse that the output stage follows now, us; 1000 whenever the motor is not to turn.
    ///
    /// After a second without pulses it is 20 % of the range (protection B); in between the last pulse holds. Without frames the motor
    /// stops.
    #[must_use]
    pub fn output_us(&self) -> f64 {
        if self.state != EscState::Running {
            return 1000.0;
        }
        let throttle = match self.heard {
            Heard::Frame(throttle) => (throttle.pulse().as_us() - 1000.0) / 1000.0,
            Heard::Pulse(_) if self.silence() > SIGNAL_LOST => LOST_THROTTLE,
            Heard::Pulse(ns) => {
                let (low, high) = (f64::from(self.esc.range_min_ns), f64::from(self.esc.range_max_ns));
                ((f64::from(ns) - low) / (high - low)).clamp(0.0, 1.0)
            }
        };
        1000.0 + 1000.0 * throttle.min(self.allowed)
    }

    /// Whether power is connected.
    #[must_use]
    pub fn powered(&self) -> bool {
        self.state != EscState::Off
    }
}

#[cfg(test)]
mod tests;
