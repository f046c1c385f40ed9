//! A rig with its board, and nobody at it.
//!
//! What it is: bench, board, pulse timer and line in steps of a millisecond, with the faults of the scenario. A host says bytes and hears bytes; hands
//! switch the ESC's supply, open the stop loop, hang masses, pull plugs. [`super::Session`] plays a host at it; a virtual board puts it
//! behind a port.
//! What can go wrong: nothing here fails; a line that loses bytes loses them without a word.
//! Units: ms since power-up of the board; V, N, N.m.
//! Reference: specification `rig.md`, "The operator's side" (virtual board) and "The simulator" (faults at any time).

use super::board::{Board, PIN, Wires};
use super::stuck;
use crate::bench::{Bench, Millisecond, Truth};
use crate::noise::{Source, Stream};
use crate::plant::Powerplant;
use crate::scenario::{FaultKind, Scenario, ScheduledFault};
use crate::sensor::{EdgeDetail, EscWire};
use frame::message::Beep;
use frame::rig::{ADC_CHANNELS, CAPTURE_CHANNELS};
use frame::units::{PulseWidth, Ticks};

/// Plugs that a hand can pull: the capture channels, then the analogue ones, then the ESC's telemetry and the back-EMF meter.
pub const PLUGS: usize = CAPTURE_CHANNELS + ADC_CHANNELS + 2;

/// Frame of the pulse timer, ms.
const FRAME_MS: u64 = 20;
/// Longest pulse, ms: what began with a frame has ended then.
const PULSE_MS: u64 = 2;

/// A rig on a desk.
pub struct RigDesk {
    bench: Bench,
    board: Board,
    gathered: Millisecond,
    frame_pulse: PulseWidth,
    ms: u64,
    faults: Vec<ScheduledFault>,
    line: Stream,
    wires: Wires,
    switched_on: bool,
    dark: bool,
    unplugged: [bool; PLUGS],
    run_from: Option<Ticks>,
}

impl RigDesk {
    /// The rig of `scenario` before `board`, the ESC without power. `plant` takes the place of the scenario's own powerplant. The scenario's
    /// schedule is the host's affair.
    #[must_use]
    pub fn new(scenario: &Scenario, plant: Option<Box<dyn Powerplant>>, board: Board) -> Self {
        Self {
            bench: Bench::new(scenario, plant, EdgeDetail::Captured),
            board,
            gathered: Millisecond::default(),
            frame_pulse: PulseWidth::MIN,
            ms: 0,
            faults: scenario.faults.clone(),
            line: Stream::new(scenario.seed, Source::Line, 0),
            wires: Wires::SOUND,
            switched_on: false,
            dark: false,
            unplugged: [false; PLUGS],
            run_from: None,
        }
    }

    /// Milliseconds since power-up.
    #[must_use]
    pub fn ms(&self) -> u64 {
        self.ms
    }

    /// What is really there.
    #[must_use]
    pub fn truth(&self) -> Truth {
        self.bench.truth()
    }

    /// The board.
    #[must_use]
    pub fn board(&self) -> &Board {
        &self.board
    }

    /// What reached the board's peripherals in the last millisecond, and whether its supply was gone.
    pub(super) fn pins(&self) -> (&Millisecond, bool) {
        (&self.gathered, self.dark)
    }

    /// Time since [`RigDesk::start_run`], s; negative before.
    #[must_use]
    pub fn run_s(&self) -> f64 {
        self.run_from.map_or(-1.0, |start| Ticks::from_ms(self.ms).as_s() - start.as_s())
    }

    /// The run begins now: from here effects and faults count their time.
    pub fn start_run(&mut self) {
        self.run_from = Some(Ticks::from_ms(self.ms));
        self.bench.start_run();
    }

    /// The ESC's next beep pattern that has ended.
    pub fn beep(&mut self) -> Option<Beep> {
        self.bench.beep().map(|(_, beep)| beep)
    }

    /// The switch of the ESC's supply.
    pub fn power(&mut self, on: bool) {
        self.switched_on = on;
        self.bench.set_power(on && !self.dark);
    }

    /// Whether that switch is on.
    #[must_use]
    pub fn is_powered(&self) -> bool {
        self.switched_on
    }

    /// Opens the stop loop, or closes it.
    pub fn open_stop_loop(&mut self, open: bool) {
        self.wires.stop_open = open;
    }

    /// Hangs a mass on the load cell; it pulls the beam down. 0 takes it off.
    pub fn hang(&mut self, mass_g: f64) {
        self.bench.hang(mass_g);
    }

    /// Twists the torque arm from outside, N.m. 0 lets it go.
    pub fn twist(&mut self, torque_nm: f64) {
        self.bench.twist(torque_nm);
    }

    /// Draws a current through the shunt with a load of one's own, A. 0 takes it off.
    pub fn draw(&mut self, current_a: f64) {
        self.bench.draw(current_a);
    }

    /// Sets the bench supply, V. A battery takes no notice.
    pub fn set_supply(&mut self, voltage_v: f64) {
        self.bench.set_supply(voltage_v);
    }

    /// Pulls a plug (capture channels first, then analogue ones, the ESC's telemetry, the back-EMF meter), or puts it back: an open capture input gives no edges, an open analogue input
    /// reads zero.
    pub fn unplug(&mut self, plug: usize, out: bool) {
        if let Some(unplugged) = self.unplugged.get_mut(plug) {
            *unplugged = out;
        }
    }

    /// Presses the board's reset key. What the host's bytes have said is gone, the flash is not.
    pub fn press_reset(&mut self) {
        self.board = self.board.after_reset(Ticks::from_ms(self.ms), PIN);
    }

    /// A fault of a kind that is on now.
    fn on(&self, wanted: impl Fn(&FaultKind) -> bool) -> Option<FaultKind> {
        if self.faults.is_empty() {
            return None;
        }
        let run_s = self.run_s();
        self.faults.iter().find(|f| f.is_on(run_s) && wanted(&f.kind)).map(|f| f.kind)
    }

    /// The plant's next millisecond. The timer takes a new pulse at the start of a frame; the pulse has ended 2 ms later at the latest.
    /// A DShot frame goes out in each millisecond, with what the tick before it gave.
    pub fn turn(&mut self) {
        self.ms += 1;
        let dark = self.on(|k| matches!(k, FaultKind::BrownOut)).is_some();
        if dark != self.dark {
            self.dark = dark;
            self.bench.set_power(self.switched_on && !dark);
        }
        let frame = self.board.frame();
        match self.ms % FRAME_MS {
            _ if frame.is_some() => self.frame_pulse = PulseWidth::MIN,
            0 => self.frame_pulse = self.board.pulse(),
            PULSE_MS if !dark => {
                let began_ns = (self.ms - PULSE_MS) * 1_000_000;
                self.bench.pulse(began_ns + u64::from(self.frame_pulse.0), self.frame_pulse.0);
            }
            _ => {}
        }
        self.gathered.watched = self.board.wanted();
        let listens = self.board.listens();
        self.bench.listen(listens);
        if listens.esc {
            self.bench.set_esc_wire(self.esc_wire());
        }
        self.bench.millisecond(&mut self.gathered);
        if let Some(frame) = frame.filter(|_| !dark) {
            self.bench.frame(self.ms * 1_000_000, frame.word()); // it ends just before the next tick
        }
        self.disturb();
    }

    /// What becomes of the line of the ESC's telemetry now.
    fn esc_wire(&self) -> EscWire {
        let [.., telemetry, _] = self.unplugged;
        let wire = |kind: &FaultKind| match *kind {
            FaultKind::EscTelemetryCut => Some(EscWire::Cut),
            FaultKind::EscTelemetryNoisy { probability } => Some(EscWire::Noisy { probability }),
            FaultKind::EscTelemetryBaud { baud } => Some(EscWire::Baud(baud)),
            _ => None,
        };
        let faulty = self.on(|kind| wire(kind).is_some()).and_then(|kind| wire(&kind));
        if telemetry { EscWire::Cut } else { faulty.unwrap_or_default() }
    }

    /// Stuck pins and pulled plugs.
    fn disturb(&mut self) {
        let run_s = if self.faults.is_empty() { -1.0 } else { self.run_s() };
        for fault in self.faults.iter().filter(|f| f.is_on(run_s)) {
            if let FaultKind::AdcStuck { channel, high } = fault.kind
                && let Some(block) = self.gathered.adc.get_mut(usize::from(channel))
            {
                *block = stuck(block.count, high);
            }
        }
        let (captures, analogue) = self.unplugged.split_at(CAPTURE_CHANNELS);
        for (edges, _) in self.gathered.edges.iter_mut().zip(captures).filter(|(_, out)| **out) {
            edges.clear();
        }
        for (block, _) in self.gathered.adc.iter_mut().zip(analogue).filter(|(_, out)| **out) {
            *block = stuck(block.count, false);
        }
        let [.., meter] = self.unplugged;
        if meter || self.on(|kind| matches!(kind, FaultKind::BackEmfCut)).is_some() {
            self.gathered.back_emf.clear();
        }
        if self.gathered.watched.is_some_and(|channel| analogue.get(channel) == Some(&true)) {
            self.gathered.codes.fill(0);
        }
    }

    /// What of the host's bytes reaches the board.
    #[must_use]
    pub fn let_through<'b>(&self, said: &'b [u8]) -> &'b [u8] {
        if self.on(|k| matches!(k, FaultKind::LinkLost)).is_some() { &[] } else { said }
    }

    /// The board's tick, with what reached it of the host's bytes; gives what reaches the host.
    #[must_use]
    pub fn tick(&mut self, heard: &[u8]) -> Vec<u8> {
        self.board.pass(Ticks::from_ms(self.ms), &self.gathered, heard, self.wires, self.dark);
        if self.dark {
            return Vec::new();
        }
        let mut sent = self.board.sent();
        if sent.is_empty() {
            return sent;
        }
        let dropped = self.on(|k| matches!(k, FaultKind::TelemetryDropped { .. }));
        let corrupted = self.on(|k| matches!(k, FaultKind::TelemetryCorrupted { .. }));
        if let Some(FaultKind::TelemetryDropped { probability }) = dropped
            && self.line.uniform() < probability
        {
            sent.clear();
        }
        if let Some(FaultKind::TelemetryCorrupted { probability }) = corrupted {
            for byte in &mut sent {
                if self.line.uniform() < probability {
                    *byte ^= 1 << ((self.line.uniform() * 8.0) as u32).min(7);
                }
            }
        }
        sent
    }
}
