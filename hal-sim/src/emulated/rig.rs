//! The motor rig on the emulator: the flash image against the same bench as the native run.
//!
//! What it is: a [`World`] in which the image's pulses or DShot frames drive the bench's ESC, the bench's sensors drive the capture pins at
//! exact instants and set the ADC codes, and an [`Operator`] talks to the board over its serial line.
//! What can go wrong: a pin that is not switched to its timer carries nothing, here as on the board. The first two pulses of a
//! train are noticed at most 0.1 ms after their edge (the bench's step), the others within a microsecond; every width is exact.
//! Units: ns since power-up of the board; counts; ns of pulse.
//! Reference: pin table in `firmware-rig/src/board/mod.rs`, written down here again on purpose.

mod hand;
mod run;

pub use hand::{Action, Heard, Operator};
pub use run::{RigRun, rig, rig_from, rig_on};

use super::harm::Harm;
use super::machine::{GeneralTimer, Pins, Port, PulseTrain, World};
use super::pulse::SeenFrame;
use crate::bench::{Bench, Listens, STEP_NS, Truth};
use crate::fault::{Mishap, Plan, by_hand};
use crate::native::PLUGS;
use crate::scenario::Scenario;
use crate::sensor::EdgeDetail;
use crate::sensor::adc::{CODES, REFERENCE_V};
use frame::message::{Command, Message};
use frame::rig::{ADC_CHANNELS, CAPTURE_CHANNELS};
use frame::units::Ticks;
use frame::wire::{Decoder, Encoder, MAX_WIRE};

/// Capture channels: pin of port A with AF1, and channel of TIM2.
const CAPTURE_PINS: [(u8, u8); CAPTURE_CHANNELS] = [(0, 1), (1, 2), (2, 3), (3, 4)];
/// Alternate function of TIM2 on those pins.
const CAPTURE_FUNCTION: u8 = 1;
/// ADC1 inputs of strain, torque, current, voltage, temperature.
const ADC_INPUTS: [u8; ADC_CHANNELS] = [10, 11, 12, 13, 14];
/// ESC pulse: pin of port A with AF2, TIM3 channel 1.
const PULSE_PIN: (u8, u8) = (6, 2);
/// Stop loop: pin of port B, closed to ground while the rig may run.
const STOP_PIN: u8 = 12;
/// ESC telemetry: pin of port B with AF7, USART3. Back-EMF meter: pin of port A with AF1, TIM1 channel 4.
const ESC_PIN: (u8, u8) = (11, 7);
const METER_PIN: (u8, u8) = (11, 1);
/// Plugs of the two, behind the analogue channels.
const ESC_PLUG: usize = CAPTURE_CHANNELS + ADC_CHANNELS;
const METER_PLUG: usize = ESC_PLUG + 1;
/// Encoder's channel B: pin of port A.
const ENCODER_B_PIN: u8 = 7;
/// The capture channel of the encoder.
const ENCODER: u8 = 3;
/// Noise of a conversion, counts rms (STM32F405 datasheet: total unadjusted error +-2 LSB typical).
const CONVERSION_NOISE: f64 = 1.2;
/// Board supply below the voltage detector's highest level and above the reset level, mV.
const DIP_MV: u32 = 2600;
/// Longest slot of a DShot frame, ns: a reload register of 16 bits at 84 MHz.
const SLOT_NS: u64 = 781_000;
/// Time from one DShot frame to the next, ns.
const FRAME_NS: u64 = MS;
/// How finely the start of a pulse is looked for, ns.
const LOOK_NS: u64 = 1000;
const MS: u64 = 1_000_000;
/// Time between two changes of an input that screams, ns: 2.5 rising edges in a microsecond, which come faster than they can be served.
const SCREAM_NS: u64 = 200;

/// How long an input of a plan screams, ms: each of its edges costs the emulator time.
const SCREAM_MS: u64 = 150;

/// One pulse seen on the ESC pin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SeenPulse {
    /// When its rising edge was noticed, ns.
    pub at_ns: u64,
    /// Its width, ns.
    pub width_ns: u64,
    /// Time to the next one as the timer stands, ns.
    pub period_ns: u64,
}

/// Rig, bench and operator around the board.
pub struct RigWorld<O> {
    bench: Bench,
    operator: O,
    decoder: Decoder,
    encoder: Encoder,
    read: usize,
    next_ms: u64,
    connected: bool,
    stop_open: bool,
    unplugged: bool,
    resets: Vec<u64>,
    running_pulse: Option<PulseTrain>,
    pulses: Vec<SeenPulse>,
    frames: Vec<SeenFrame>,
    garbles: bool,
    /// The pulse's pin had its function at the last look.
    muxed: bool,
    truth: Vec<(u64, Truth)>,
    messages: Vec<(Ticks, Message)>,
    harm: Option<Harm>,
    backwards: bool,
    last_frame: Vec<u8>,
    /// When the start of a pulse is looked for next, apart from the bench's steps.
    rise_at: u64,
    /// Pulses of this train so far.
    train: u32,
    /// An input that screams: channel, until when, and its next edge.
    scream: Option<(u8, u64, u64)>,
    /// A stop to come: when, and by key or by these bytes.
    stop_at: Option<(u64, Option<Vec<u8>>)>,
    stops: Vec<u64>,
    /// When the control tick is given back, ms.
    tick_back: Option<u64>,
    plugs_out: [bool; PLUGS],
    /// Stores to the flash that the operator knows of.
    stores: u32,
}

impl<O: Operator> RigWorld<O> {
    fn new(scenario: &Scenario, operator: O) -> Self {
        Self {
            bench: Bench::new(scenario, None, EdgeDetail::Pins),
            operator,
            decoder: Decoder::default(),
            encoder: Encoder::default(),
            read: 0,
            next_ms: 0,
            connected: false,
            stop_open: false,
            unplugged: false,
            resets: Vec::new(),
            running_pulse: None,
            pulses: Vec::new(),
            frames: Vec::new(),
            garbles: false,
            muxed: false,
            truth: Vec::new(),
            messages: Vec::new(),
            harm: None,
            backwards: false,
            last_frame: Vec::new(),
            rise_at: u64::MAX,
            train: 0,
            scream: None,
            stop_at: None,
            stops: Vec::new(),
            tick_back: None,
            plugs_out: [false; PLUGS],
            stores: 0,
        }
    }

    /// Passes frames and pulses for the ESC from the pin to the bench when they have ended.
    fn watch_pulse(&mut self, now_ns: u64, pins: &mut Pins<'_>) {
        let muxed = pins.alternate(Port::A, PULSE_PIN.0) == Some(PULSE_PIN.1);
        // a frame that ends with a reset is heard when the pin has lost its function already
        let was = std::mem::replace(&mut self.muxed, muxed);
        for frame in pins.frames().into_iter().filter(|_| muxed || was) {
            if let Some(word) = frame.word {
                let garbled = if self.garbles { word ^ 1 << (self.frames.len() % 16) } else { word };
                self.bench.frame(frame.ended_ns, garbled);
            }
            self.frames.push(frame);
        }
        // a slot of a frame is none
        let train = pins.pulses(GeneralTimer::Tim3, 1).filter(|train| muxed && train.high && train.period_ns > SLOT_NS);
        match (train, self.running_pulse) {
            (Some(train), None) => {
                self.running_pulse = Some(train);
                self.pulses.push(SeenPulse { at_ns: now_ns, width_ns: train.width_ns, period_ns: train.period_ns });
                self.train += 1;
                // the first was noticed by the bench's step: look for the next from a step before it is due
                let early = if self.train < 3 { STEP_NS } else { LOOK_NS };
                self.rise_at = now_ns + train.period_ns - early;
            }
            (None, Some(train)) => {
                self.running_pulse = None;
                if !self.suffers(Mishap::PulseWire) {
                    self.bench.pulse(now_ns, train.width_ns as u32);
                }
            }
            _ => {}
        }
    }

    /// Looks for the start of a pulse every microsecond from just before it is due; gives up where none comes.
    fn await_pulse(&mut self, now_ns: u64, pins: &mut Pins<'_>) {
        if now_ns < self.rise_at || self.running_pulse.is_some() {
            return;
        }
        let due = self.rise_at;
        self.watch_pulse(now_ns, pins);
        if self.running_pulse.is_none() {
            let last = self.pulses.last().map_or(0, |p| p.at_ns + p.period_ns);
            (self.rise_at, self.train) = if now_ns > last + STEP_NS { (u64::MAX, 0) } else { (due + LOOK_NS, self.train) };
        }
    }

    /// A stop that was ordered for this instant.
    fn stop_when_due(&mut self, now_ns: u64, pins: &mut Pins<'_>) {
        if self.stop_at.as_ref().is_none_or(|(at, _)| now_ns < *at) {
            return;
        }
        match self.stop_at.take() {
            Some((_, Some(bytes))) => pins.say(&bytes),
            _ => {
                self.stop_open = true;
                pins.drive(Port::B, STOP_PIN, true);
            }
        }
        self.stops.push(now_ns);
    }

    /// Drives every edge that is due.
    fn drive_edges(&mut self, now_ns: u64, pins: &mut Pins<'_>) {
        while let Some(edge) = self.bench.edge_until(now_ns) {
            let (_, channel) = CAPTURE_PINS[usize::from(edge.channel)];
            let stuck = self.plugs_out[usize::from(edge.channel)];
            let stuck = stuck || self.harm.as_mut().is_some_and(|harm| harm.hides(edge.channel, edge.rising));
            if self.connected && edge.channel == ENCODER {
                pins.drive(Port::A, ENCODER_B_PIN, edge.rising == self.backwards); // B is 90 deg behind A, or ahead of it
            }
            if self.connected && !stuck {
                pins.drive_timer(GeneralTimer::Tim2, channel, edge.rising);
            }
        }
    }

    /// Edges of a speed that a sensor reads in the place of the rotor's.
    fn drive_trains(&mut self, now_ns: u64, pins: &mut Pins<'_>) {
        let rpm = self.bench.truth().plant.rpm;
        let Some(harm) = &mut self.harm else { return };
        while let Some((channel, high)) = harm.train_edge(now_ns, rpm) {
            let (_, input) = CAPTURE_PINS[usize::from(channel)];
            pins.drive_timer(GeneralTimer::Tim2, input, high);
        }
    }

    /// Whether this goes wrong now.
    fn suffers(&self, mishap: Mishap) -> bool {
        self.harm.as_ref().is_some_and(|harm| harm.mishap() == mishap)
    }

    /// A plan's mishap comes: what is done to the board itself, to the bench and to the line.
    fn strike(&mut self, ms: u64, plan: &Plan, pins: &mut Pins<'_>) {
        self.harm = Some(Harm::new(plan, ms));
        match plan.mishap {
            Mishap::SupplyDip => pins.set_supply(DIP_MV),
            Mishap::Replay => pins.say(&self.last_frame),
            Mishap::StopOpen | Mishap::StopBlink => self.stop_open = true, // driven with the next millisecond
            Mishap::StopHeld => {
                self.unplugged = true;
                pins.release(Port::B, STOP_PIN);
            }
            Mishap::Hang => pins.hold_tick(true),
            Mishap::LateTick { ms: late } => {
                pins.hold_tick(true);
                self.tick_back = Some(ms + u64::from(late));
            }
            Mishap::ResetKey => self.reset(ms, pins),
            Mishap::HardFault => pins.fail_access(),
            Mishap::CrystalFails => pins.fail_crystal(),
            Mishap::Gap => pins.overrun_adc(), // the next tick starts the scan anew
            Mishap::Screams { channel } => self.scream = Some((channel, (ms + SCREAM_MS) * MS, ms * MS)),
            Mishap::Overwritten { channel } => self.scream = Some((channel, (ms + 1) * MS, ms * MS)),
            Mishap::FloatingLine { channel } => self.scream = Some((channel, (ms + SCREAM_MS / 4) * MS, ms * MS)),
            _ => by_hand(plan, &mut self.bench),
        }
    }

    /// Changes of the back-EMF meter's output that are due.
    fn drive_meter(&mut self, now_ns: u64, pins: &mut Pins<'_>) {
        while let Some(edge) = self.bench.turn_until(now_ns) {
            if !self.plugs_out[METER_PLUG] {
                pins.drive_meter(edge.rising);
            }
        }
    }

    /// What the ESC has said since the last millisecond, and what of the cross-checks the image listens to now.
    fn pass_on_telemetry(&mut self, now_ns: u64, pins: &mut Pins<'_>) {
        let words: Vec<u16> = std::iter::from_fn(|| self.bench.esc_word(now_ns)).collect();
        if !self.plugs_out[ESC_PLUG] {
            pins.say_to_esc_port(&words);
        }
        let esc = pins.esc_port_listens() && pins.alternate(Port::B, ESC_PIN.0) == Some(ESC_PIN.1);
        let back_emf = pins.meter_listens() && pins.alternate(Port::A, METER_PIN.0) == Some(METER_PIN.1);
        self.bench.listen(Listens { esc, back_emf });
    }

    /// Edges of the input that screams.
    fn drive_scream(&mut self, now_ns: u64, pins: &mut Pins<'_>) {
        let Some((channel, until, next)) = self.scream.filter(|(_, _, next)| *next <= now_ns) else { return };
        let high = (next / SCREAM_NS).is_multiple_of(2);
        pins.drive_timer(GeneralTimer::Tim2, channel + 1, high);
        self.scream = (next < until).then_some((channel, until, next + SCREAM_NS));
    }

    fn reset(&mut self, ms: u64, pins: &mut Pins<'_>) {
        pins.press_reset();
        self.connected = false;
        self.stop_open = false;
        self.running_pulse = None;
        self.resets.push(ms * MS);
    }

    /// Once the image has switched its capture pins to the timer, their levels reach it.
    fn connect(&mut self, pins: &mut Pins<'_>) {
        let muxed = CAPTURE_PINS.iter().all(|(pin, _)| pins.alternate(Port::A, *pin) == Some(CAPTURE_FUNCTION));
        if muxed && !self.connected {
            for (n, (_, channel)) in CAPTURE_PINS.iter().enumerate() {
                pins.drive_timer(GeneralTimer::Tim2, *channel, self.bench.level(n));
            }
        }
        self.connected = muxed;
    }

    fn converse(&mut self, ms: u64, pins: &mut Pins<'_>) {
        let mut heard = Vec::new();
        let bytes = pins.heard();
        for byte in &bytes[self.read.min(bytes.len())..] {
            if let Some(received) = self.decoder.push::<Message>(*byte) {
                if self.operator.keeps_record() {
                    self.messages.push((received.at, received.message));
                }
                heard.push(Heard::Board(received.message));
            }
        }
        let mut say = Vec::new();
        self.operator.line(&bytes[self.read.min(bytes.len())..], &mut say);
        if let Some(harm) = &mut self.harm {
            say.extend(harm.noise(&bytes[self.read.min(bytes.len())..]));
        }
        self.read = bytes.len();
        pins.say(&say);
        while let Some((_, beep)) = self.bench.beep() {
            heard.push(Heard::Esc(beep));
        }
        let mut actions = Vec::new();
        self.operator.millisecond(ms, &heard, &mut actions);
        if let Some(plan) = self.operator.strikes() {
            self.strike(ms, &plan, pins);
        }
        for action in actions {
            match action {
                Action::Send(command) => {
                    let mut wire = [0; MAX_WIRE];
                    if let Ok(used) = self.encoder.encode(Ticks::from_ms(ms), &command, &mut wire) {
                        self.last_frame = wire[..used].to_vec();
                        let bytes = wire[..used].to_vec();
                        let bytes = match &mut self.harm {
                            Some(harm) => harm.line(bytes),
                            None => bytes,
                        };
                        pins.say(&bytes);
                    }
                }
                Action::GarbleFrames(garbles) => self.garbles = garbles,
                Action::Backwards(backwards) => self.backwards = backwards,
                Action::Mishap(mishap) => self.strike(ms, &Plan { mishap, ..Plan::factory(mishap) }, pins),
                Action::EscReady => self.bench.esc_is_ready(),
                Action::Power(on) => self.bench.set_power(on),
                Action::StopKey(pressed) => {
                    self.stop_open = pressed;
                    pins.drive(Port::B, STOP_PIN, pressed);
                }
                Action::UnplugStop => {
                    self.unplugged = true;
                    pins.release(Port::B, STOP_PIN);
                }
                Action::StopBeforePulse { key, ns } => {
                    let mut wire = [0; MAX_WIRE];
                    let used = self.encoder.encode(Ticks::from_ms(ms), &Command::Stop, &mut wire).unwrap_or(0);
                    let bytes = (!key).then(|| wire[..used].to_vec());
                    let pulse = self.pulses.last().map(|p| (p.at_ns, p.period_ns));
                    let frame = self.frames.last().map(|f| (f.at_ns, FRAME_NS));
                    let (last, period) = pulse.max(frame).unwrap_or((ms * MS, 20 * MS));
                    let mut start = last + period;
                    while start < ns + (ms + 1) * MS {
                        start += period;
                    }
                    self.stop_at = Some((start - ns, bytes));
                }
                Action::FailAtStore(nth) => pins.fail_at_store(nth),
                Action::FailCrystal => pins.fail_crystal(),
                Action::OverrunAdc => pins.overrun_adc(),
                Action::Scream { channel, ms: long } => self.scream = Some((channel, (ms + long) * MS, ms * MS)),
                Action::FailAccess => pins.fail_access(),
                Action::Reset => self.reset(ms, pins),
                Action::StartRun => self.bench.start_run(),
                Action::Hang(mass_g) => self.bench.hang(mass_g),
                Action::Twist(torque_nm) => self.bench.twist(torque_nm),
                Action::Draw(current_a) => self.bench.draw(current_a),
                Action::Supply(voltage_v) => self.bench.set_supply(voltage_v),
                Action::EscWire(wire) => self.bench.set_esc_wire(wire),
                Action::Plug { plug, out } => {
                    if let Some(is_out) = self.plugs_out.get_mut(plug) {
                        *is_out = out;
                    }
                }
            }
        }
    }
}

impl<O: Operator> World for RigWorld<O> {
    fn wake(&mut self, now_ns: u64, pins: &mut Pins<'_>) -> u64 {
        self.drive_edges(now_ns, pins);
        self.drive_trains(now_ns, pins);
        self.drive_meter(now_ns, pins);
        self.drive_scream(now_ns, pins);
        self.stop_when_due(now_ns, pins);
        self.await_pulse(now_ns, pins);
        if now_ns >= self.bench.horizon_ns() {
            self.watch_pulse(now_ns, pins);
            for (n, input) in ADC_INPUTS.iter().enumerate() {
                let counts = match self.harm.as_ref().and_then(|harm| harm.counts(n)) {
                    Some(counts) => counts,
                    None if self.plugs_out[CAPTURE_CHANNELS + n] => -400.0, // pulled down
                    None => self.bench.voltages()[n] * (CODES / REFERENCE_V),
                };
                pins.set_adc(*input, counts);
            }
            pins.set_adc_noise(CONVERSION_NOISE);
            if now_ns >= self.next_ms * MS {
                if !self.unplugged {
                    pins.drive(Port::B, STOP_PIN, self.stop_open); // again and again: a reset of the part forgets it
                }
                if self.tick_back.take_if(|at| self.next_ms >= *at).is_some() {
                    pins.hold_tick(false);
                }
                if let Some(harm) = &mut self.harm {
                    harm.millisecond(self.next_ms);
                    pins.stop_adc(harm.converter_rests());
                    self.stop_open &= !harm.stop_closes();
                }
                self.connect(pins);
                self.pass_on_telemetry(now_ns, pins);
                if pins.has_failed() {
                    self.read = pins.heard().len(); // a board without a supply says nothing
                    self.reset(self.next_ms, pins);
                }
                self.converse(self.next_ms, pins);
                let truth = self.bench.truth();
                self.operator.see(&truth);
                let (sectors, stores) = pins.settings();
                if stores != self.stores {
                    self.stores = stores;
                    self.operator.stored(sectors);
                }
                if self.operator.keeps_record() {
                    self.truth.push((now_ns, truth));
                }
                self.next_ms += 1;
            }
            self.bench.advance_to(now_ns + STEP_NS);
        }
        let rise = if self.running_pulse.is_none() { self.rise_at } else { u64::MAX };
        let stop = self.stop_at.as_ref().map_or(u64::MAX, |(at, _)| *at);
        let next = |at: Option<u64>| at.unwrap_or(u64::MAX);
        let edge = next(self.bench.next_edge_ns()).min(next(self.bench.next_turn_ns()));
        let scream = self.scream.map_or(u64::MAX, |(_, _, next)| next);
        let train = self.harm.as_ref().map_or(u64::MAX, Harm::next_train);
        self.bench.horizon_ns().min(edge).min(rise).min(stop).min(scream).min(train)
    }

    fn is_over(&self) -> bool {
        self.operator.is_over()
    }
}
