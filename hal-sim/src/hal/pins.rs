//! The rig behind its board's pins.
//!
//! What it is: the bench, and what the board's peripherals do by themselves while the program computes or waits: the pulse train, the scan
//! of the converter, the watchdog. Whoever looks at a pin brings all of it up to the clock first, in the order of time.
//! What can go wrong: after a reset by the watchdog, and before the first program, the chip does not drive the pulse pin and nothing
//! converts, until a new program starts its peripherals; what the old one still holds has no effect. The pin then floats: the board's
//! pull-down holds it low; on a board without one ([`RigPins::leave_out_pull_down`]) it follows what its neighbours couple into it.
//! Units: ns since power-up.
//! Reference: specification `rig.md`, "The simulator"; RM0090 sections 7.3.21 (reset flags) and 8.3 (pins float after a reset).

use super::adc::Scan;
use super::pwm::Train;
use crate::bench::{Bench, Truth};
use crate::clock::VirtualClock;
use crate::scenario::Scenario;
use crate::sensor::EdgeDetail;
use frame::message::Beep;
use std::cell::{RefCell, RefMut};
use std::rc::Rc;

/// Flags of RCC_CSR, shifted down by 24: pin, power-on and brown-out after power-up; pin and watchdog after the dog has bitten.
const POWERED_UP: u8 = 0x0E;
const WATCHDOG: u8 = 0x24;

/// Time from one coupled pulse to the next, ns: that of a neighbour's pulse train.
const COUPLED_NS: u64 = 20_000_000;

/// The rig at its board's pins; clones are the same rig.
#[derive(Clone)]
pub struct RigPins {
    clock: VirtualClock,
    behind: Rc<RefCell<Behind>>,
}

/// The bench and the peripherals that run by themselves.
pub(super) struct Behind {
    pub(super) bench: Bench,
    pub(super) train: Option<Train>,
    pub(super) scan: Option<Scan>,
    /// When the watchdog bites unless it is fed.
    pub(super) deadline_ns: Option<u64>,
    bitten_ns: Option<u64>,
    /// Pulses that a floating pin picks up: width and start of the next, ns. `None` where a resistor pulls it down.
    picked_up: Option<(u32, u64)>,
    reset_cause: u8,
    /// Programs that were reset; a peripheral of an earlier one is none any more.
    pub(super) life: u32,
}

impl RigPins {
    /// The rig of a scenario on `clock`, its ESC without power.
    #[must_use]
    pub fn new(clock: VirtualClock, scenario: &Scenario) -> Self {
        let behind = Behind {
            bench: Bench::new(scenario, None, EdgeDetail::Captured),
            train: None,
            scan: None,
            deadline_ns: None,
            bitten_ns: None,
            picked_up: None,
            reset_cause: POWERED_UP,
            life: 0,
        };
        Self { clock, behind: Rc::new(RefCell::new(behind)) }
    }

    /// The clock of everything.
    #[must_use]
    pub fn clock(&self) -> &VirtualClock {
        &self.clock
    }

    /// Everything behind the pins, as it is now.
    pub(super) fn now(&self) -> RefMut<'_, Behind> {
        let mut behind = self.behind.borrow_mut();
        behind.pass(self.clock.now_ns());
        behind
    }

    /// Leaves the pull-down out of the pulse pin: while nothing drives it, it follows a neighbour that couples pulses of `width_us` into
    /// it every 20 ms, the worst that a floating wire can do.
    pub fn leave_out_pull_down(&self, width_us: u32) {
        let mut behind = self.now();
        behind.picked_up = Some((width_us * 1000, self.clock.now_ns()));
    }

    /// The operator's switch: connects or cuts the ESC's power.
    pub fn set_power(&self, on: bool) {
        self.now().bench.set_power(on);
    }

    /// The run starts now: from here the effects of the scenario count their time.
    pub fn start_run(&self) {
        self.now().bench.start_run();
    }

    /// The next beep pattern that has ended.
    #[must_use]
    pub fn beep(&self) -> Option<Beep> {
        self.now().bench.beep().map(|(_, beep)| beep)
    }

    /// What is really there.
    #[must_use]
    pub fn truth(&self) -> Truth {
        self.now().bench.truth()
    }

    /// When the watchdog has reset the board since the last call, ns.
    #[must_use]
    pub fn take_reset(&self) -> Option<u64> {
        self.now().bitten_ns.take()
    }

    /// Why the board was reset, as its program reads it.
    #[must_use]
    pub fn reset_cause(&self) -> u8 {
        self.now().reset_cause
    }
}

impl Behind {
    fn pass(&mut self, now_ns: u64) {
        if let Some(at_ns) = self.deadline_ns
            && at_ns <= now_ns
        {
            self.run(at_ns);
            (self.train, self.scan, self.deadline_ns) = (None, None, None);
            (self.bitten_ns, self.reset_cause) = (Some(at_ns), WATCHDOG);
            self.life += 1;
        }
        self.run(now_ns);
    }

    /// Pulses and conversions until `until_ns`, each at its instant.
    fn run(&mut self, until_ns: u64) {
        while let Some((end_ns, width_ns)) = self.train.as_mut().and_then(|train| train.next_pulse(until_ns)) {
            self.convert(end_ns);
            self.bench.advance_to(end_ns);
            self.bench.pulse(end_ns, width_ns);
        }
        self.pick_up(until_ns);
        self.convert(until_ns);
        self.bench.advance_to(until_ns);
    }

    /// What a floating pin gives the ESC.
    fn pick_up(&mut self, until_ns: u64) {
        let Some((width_ns, mut start_ns)) = self.picked_up else { return };
        while start_ns + u64::from(width_ns) <= until_ns {
            if self.train.is_none() {
                self.bench.advance_to(start_ns + u64::from(width_ns));
                self.bench.pulse(start_ns + u64::from(width_ns), width_ns);
            }
            start_ns += COUPLED_NS;
        }
        self.picked_up = Some((width_ns, start_ns));
    }

    fn convert(&mut self, until_ns: u64) {
        let Some(scan) = &mut self.scan else { return };
        while scan.next_ns() <= until_ns {
            self.bench.advance_to(scan.next_ns());
            scan.take(|channel| self.bench.convert(channel));
        }
    }
}
