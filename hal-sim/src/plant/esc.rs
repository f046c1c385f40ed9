//! Electronic speed controller: start-up dialogue, throttle range, loss of signal.
//!
//! What it is: what the ESC of Appendix C does between power-on and "ready", its beeps as events, and the throttle that it
//! passes on to the motor, limited by its protections.
//! What can go wrong: no signal (it beeps without end), a throttle that is neither low nor high at power-on (the same), a
//! failed self-test (twenty beeps), maximum throttle held for 6 s (programming mode until power is cut).
//! Units: pulse width in ns, time in ns, throttle 0..1.
//! Reference: Beharie 2013 Appendix C (start-up, throttle range, protections B and D) and Figure 3.10. Tone lengths are assumed.

use super::esc_guard::{Guard, GuardState};
use super::esc_program::{Menu, Outcome, Settings};
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

/// The ESC's dialogue.
#[derive(Debug, Clone, PartialEq)]
pub struct EscDialogue {
    esc: Esc,
    cells: u8,
    state: EscState,
    since: u64,
    now: u64,
    pulse_ns: u32,
    pulse_at: Option<u64>,
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
            pulse_ns: 0,
            pulse_at: None,
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
            self.enter(EscState::SelfTest);
        } else if !on {
            self.enter(EscState::Off);
        }
    }

    /// A pulse of `width_ns` ended at `at_ns`. Widths outside 0.8..2.2 ms are no pulses.
    pub fn pulse(&mut self, at_ns: u64, width_ns: u32) {
        if (800_000..=2_200_000).contains(&width_ns) {
            self.pulse_ns = width_ns;
            self.pulse_at = Some(at_ns);
        }
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
        self.pulse_at.map_or(u64::MAX, |at| self.now.saturating_sub(at))
    }

    fn heard(&self) -> bool {
        self.silence() < NO_PULSE
    }

    fn is_min(&self) -> bool {
        self.heard() && self.pulse_ns <= self.esc.range_min_ns.saturating_add(30_000)
    }

    /// Steps the dialogue to `now_ns` (call it at least every few milliseconds).
    pub fn advance_to(&mut self, now_ns: u64) {
        self.now = now_ns;
        let age = now_ns.saturating_sub(self.since);
        match self.state {
            EscState::Off | EscState::Running => {}
            EscState::Programming => {
                let (closed, open) = (self.is_min(), self.heard() && self.pulse_ns >= 1_900_000);
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
                } else if self.heard() && self.pulse_ns >= 1_900_000 {
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
                self.esc.range_max_ns = self.pulse_ns;
                self.sound(Beep::Double);
                self.enter(EscState::WaitMinimum);
            }
            EscState::WaitMinimum => {
                if self.heard() && self.pulse_ns <= 1_200_000 {
                    self.esc.range_min_ns = self.pulse_ns;
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
    /// After a second without signal it is 20 % of the range (protection B). In between the last pulse holds.
    #[must_use]
    pub fn output_us(&self) -> f64 {
        if self.state != EscState::Running {
            return 1000.0;
        }
        let throttle = if self.silence() > SIGNAL_LOST {
            LOST_THROTTLE
        } else {
            let (low, high) = (f64::from(self.esc.range_min_ns), f64::from(self.esc.range_max_ns));
            ((f64::from(self.pulse_ns) - low) / (high - low)).clamp(0.0, 1.0)
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
mod tests {
    use super::*;

    /// Runs for `ms` with a pulse every 20 ms (none where `pulse_ns` is 0) and gives the beeps.
    fn run(esc: &mut EscDialogue, from_ms: u64, ms: u64, pulse_ns: u32) -> Vec<Beep> {
        let mut out = Vec::new();
        for t in from_ms..from_ms + ms {
            if t % 20 == 0 && pulse_ns > 0 {
                esc.pulse(t * MS, pulse_ns);
            }
            esc.advance_to(t * MS);
            out.extend(esc.beep().map(|b| b.1));
        }
        out
    }

    #[test]
    fn a_normal_start_gives_its_three_patterns_and_then_follows_the_pulse() {
        let mut esc = EscDialogue::new(Esc::default(), 3);
        run(&mut esc, 0, 100, 1_000_000);
        esc.set_power(true);
        assert_eq!(run(&mut esc, 100, 5000, 1_000_000), [Beep::Long, Beep::Cells(3), Beep::Ready]);
        assert_eq!(esc.output_us(), 1000.0);
        run(&mut esc, 5100, 40, 1_500_000);
        assert_eq!(esc.output_us(), 1500.0);
        run(&mut esc, 5140, 900, 0);
        assert_eq!(esc.output_us(), 1500.0, "speed holds for a second");
        run(&mut esc, 6040, 200, 0);
        assert_eq!(esc.output_us(), 1200.0, "then 20 %");
        run(&mut esc, 6240, 40, 1_000_000);
        assert_eq!(esc.output_us(), 1000.0, "and recovers");
    }

    #[test]
    fn without_signal_or_at_half_throttle_it_never_runs() {
        for pulse in [0, 1_500_000] {
            let mut esc = EscDialogue::new(Esc::default(), 3);
            esc.set_power(true);
            let beeps = run(&mut esc, 0, 5000, pulse);
            assert!(beeps.len() >= 4 && beeps.iter().all(|b| *b == Beep::NoSignal), "{beeps:?}");
            assert_eq!(esc.output_us(), 1000.0);
        }
    }

    #[test]
    fn range_calibration_stores_and_programming_mode_traps() {
        let mut esc = EscDialogue::new(Esc::default(), 3);
        run(&mut esc, 0, 100, 1_950_000);
        esc.set_power(true);
        assert_eq!(run(&mut esc, 100, 2000, 1_950_000), [Beep::Double]);
        assert_eq!(run(&mut esc, 2100, 4000, 1_050_000), [Beep::Long, Beep::Cells(3), Beep::Ready]);
        assert_eq!(esc.range_ns(), (1_050_000, 1_950_000));
        run(&mut esc, 6100, 40, 1_500_000);
        assert_eq!(esc.output_us(), 1500.0);

        let mut esc = EscDialogue::new(Esc::default(), 3);
        run(&mut esc, 0, 100, 2_000_000);
        esc.set_power(true);
        assert_eq!(run(&mut esc, 100, 9000, 2_000_000), [Beep::Double, Beep::Programming]);
        assert!(run(&mut esc, 9100, 5000, 1_000_000).is_empty());
        assert_eq!(esc.output_us(), 1000.0);
    }

    #[test]
    fn a_failed_self_test_never_runs() {
        let mut esc = EscDialogue::new(Esc { self_test_fails: true, ..Esc::default() }, 3);
        run(&mut esc, 0, 100, 1_000_000);
        esc.set_power(true);
        let beeps = run(&mut esc, 100, 6000, 1_000_000);
        assert!(!beeps.is_empty() && beeps.iter().all(|b| *b == Beep::SelfTestFailed));
        assert_eq!(esc.output_us(), 1000.0);
    }

    /// Up to "ready" with a pulse of minimum, on a supply that stands.
    fn ready() -> EscDialogue {
        let mut esc = EscDialogue::new(Esc::default(), 3);
        run(&mut esc, 0, 100, 1_000_000);
        esc.set_power(true);
        run(&mut esc, 100, 5000, 1_000_000);
        assert_eq!(esc.state(), EscState::Running);
        esc
    }

    #[test]
    fn low_voltage_and_heat_limit_the_output() {
        let mut esc = ready();
        run(&mut esc, 5100, 40, 2_000_000);
        (0..3000).for_each(|_| esc.feel(8.0, 7.0, 1e-3));
        assert_eq!(esc.output_us(), 1500.0, "protection A leaves half");
        (0..100).for_each(|_| esc.feel(11.0, 7.0, 1e-3));
        assert_eq!(esc.output_us(), 1500.0, "until the throttle is closed");
        run(&mut esc, 5140, 40, 1_000_000);
        esc.feel(11.0, 0.1, 1e-3);
        run(&mut esc, 5180, 40, 2_000_000);
        assert_eq!(esc.output_us(), 2000.0);
        (0..300_000).for_each(|_| esc.feel(11.0, 30.0, 1e-3));
        assert!(esc.temperature_c() > 200.0);
        assert_eq!(esc.output_us(), 1350.0, "protection C leaves 35 %");
        (0..300_000).for_each(|_| esc.feel(11.0, 3.0, 1e-3));
        assert_eq!(esc.output_us(), 2000.0, "and gives it back");
    }

    #[test]
    fn what_is_programmed_outlives_the_power() {
        let mut esc = EscDialogue::new(Esc::default(), 3);
        run(&mut esc, 0, 100, 2_000_000);
        esc.set_power(true);
        let beeps = run(&mut esc, 100, 9_000, 2_000_000);
        assert_eq!(beeps, [Beep::Double, Beep::Programming]);
        let mut at = 9_100;
        // hold maximum until the cut-off mode sounds, close for its second option, open to store
        while esc.programming().map(|p| p.0) != Some(super::super::esc_program::Item::CutOffMode) {
            run(&mut esc, at, 100, 2_000_000);
            at += 100;
        }
        run(&mut esc, at, 4_000, 1_000_000);
        run(&mut esc, at + 4_000, 500, 2_000_000);
        esc.set_power(false);
        assert_eq!(esc.settings().cutoff(), super::super::esc_guard::CutOff::CutOff);
        run(&mut esc, at + 4_500, 500, 1_000_000);
        esc.set_power(true);
        run(&mut esc, at + 5_000, 6_000, 1_000_000);
        run(&mut esc, at + 11_000, 40, 1_800_000);
        assert_eq!(esc.output_us(), 1800.0);
        (0..5000).for_each(|_| esc.feel(8.0, 1.0, 1e-3));
        assert_eq!(esc.output_us(), 1000.0, "it cuts off now");
    }
}
