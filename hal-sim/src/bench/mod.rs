//! The bench: ESC, powerplant, beam and sensors on one clock.
//!
//! What it is: the rig as its board meets it. Pulses or frames go in with the time of their end; edges, pin voltages and beeps come out.
//! The native run takes it a millisecond at a time ([`Bench::millisecond`]); an emulated board takes it to any instant
//! ([`Bench::advance_to`]) and asks for edges and voltages.
//! What can go wrong: nothing here fails; a powerplant that gives a NaN or a negative speed is taken as a resting rotor.
//! Units: ns since power-up of the board for every time; V at the pins.
//! Reference: specification `rig.md`, "The simulator"; house rule 7 (the simulator owns the only clock).
//!
//! For a driver with its own clock:
//!
//! ```
//! use hal_sim::{Bench, EdgeDetail, Scenario};
//! let mut bench = Bench::new(&Scenario::demo(1, None).unwrap(), None, EdgeDetail::Pins);
//! bench.set_power(true);
//! bench.pulse(1_000_000, 1_000_000); // a pulse of 1 ms ended at t = 1 ms
//! bench.advance_to(5_000_000);
//! while let Some(edge) = bench.edge_until(5_000_000) { /* drive the pin at edge.at_ns */ }
//! let wake = bench.next_edge_ns().unwrap_or(bench.horizon_ns()); // the next instant worth stopping at
//! let strain_v = bench.voltages()[0];
//! let beep = bench.beep();
//! # let _ = (wake, strain_v, beep);
//! ```

mod gives;
mod imbalance;
mod steps;

pub use gives::{CONVERSION_HZ, Listens, Millisecond, Truth};

use crate::effect::{Levers, Scheduled, fitted, open};
use crate::noise::{Source, Stream};
use crate::parts::BenchParts;
use crate::plant::beam::BeamMode;
use crate::plant::bridge::BridgeState;
use crate::plant::mount::MountState;
use crate::plant::powerplant::STEPS_PER_MS;
use crate::plant::{BackEmf, Beam, EscDialogue, EscState, Mount, PlantBlock, Powerplant, RigPlant};
use crate::sensor::back_emf::BackEmfState;
use crate::sensor::{
    AnalogFront, BackEmfMeter, Comparator, Converter, Edge, EdgeDetail, EscTelemetry, EscWire, Geometry, Logger, Tachometers,
};
use esc_pwm::dshot::Frame;
use frame::calibration::Calibration;
use frame::message::Beep;
use frame::rig::ADC_CHANNELS;
use frame::units::Ticks;
use imbalance::Whirl;
use std::collections::VecDeque;

/// Integration step, ns.
pub const STEP_NS: u64 = 100_000;
/// Integration step, s.
pub const STEP_S: f64 = 1.0e-4;
/// Standard gravity, m/s^2.
const G: f64 = 9.806_65;

/// A rig before a run.
#[derive(Debug, Clone)]
pub struct Setup {
    /// What it is built of.
    pub parts: BenchParts,
    /// What it does beside; 128 at the most.
    pub effects: Vec<Scheduled>,
    /// Of everything that is drawn.
    pub seed: u64,
}

/// The rig.
pub struct Bench {
    esc: EscDialogue,
    plant: Box<dyn Powerplant>,
    base: BenchParts,
    effects: Vec<Scheduled>,
    open: u128,
    seed: u64,
    levers: Levers,
    beam: Beam,
    mode: BeamMode,
    bridge: BridgeState,
    mount: Mount,
    joints: MountState,
    rigid: bool,
    shake_n: f64,
    logger: Logger,
    recorded: bool,
    front: AnalogFront,
    converter: Converter,
    geometry: Geometry,
    tachometers: Tachometers,
    meter: BackEmfState,
    metered_rev: f64,
    steps: u64,
    run_start_steps: Option<u64>,
    angle_rev: f64,
    heavy_spot_rev: f64,
    /// What the plant did in the last millisecond at once; its place is kept, for clearing it costs as much as a step.
    turned: PlantBlock,
    /// How that turned the rotor.
    whirl: Whirl,
    strain_v: [f64; STEPS_PER_MS],
    torque_v: f64,
    /// What a load of one's own changes at the current's pin, V.
    drawn_v: f64,
    output_us: f64,
    edges: VecDeque<Edge>,
    listens: Listens,
    telemetry: EscTelemetry,
    comparator: Comparator,
    /// What the windings gave as this millisecond began.
    emf: Option<BackEmf>,
    /// Changes of its output.
    turns: VecDeque<Edge>,
    truth: Truth,
    /// What hands put on the load cell (as lift, N) and on the torque arm, N.m.
    by_hand: (f64, f64),
}

impl Bench {
    /// A bench at rest without ESC power. `plant` takes the place of the rig's own powerplant; effects on the
    /// powerplant then have nothing to act on, those on the load cell and the sensors still do.
    #[must_use]
    pub fn new(setup: impl Into<Setup>, plant: Option<Box<dyn Powerplant>>, detail: EdgeDetail) -> Self {
        let Setup { parts: base, effects, seed } = setup.into();
        let open = open(&effects, -1.0);
        let parts = fitted(&base, &effects, open);
        let mut phase = Stream::new(seed, Source::Phase, 0);
        let angle_rev = phase.uniform();
        let cells = parts.plant.supply.cells();
        let pole_pairs = parts.plant.motor.pole_pairs;
        let front = AnalogFront::new(&parts.bridge);
        let plant = plant.unwrap_or_else(|| Box::new(RigPlant::new(parts.plant, seed)));
        Self {
            esc: EscDialogue::new(parts.esc, cells),
            plant,
            base,
            effects,
            open,
            seed,
            levers: Levers { seed, ..Levers::default() },
            mode: BeamMode::new(&parts.beam, STEP_S),
            beam: parts.beam,
            bridge: BridgeState::new(parts.bridge, STEP_S),
            rigid: parts.mount == Mount::default(),
            mount: parts.mount,
            joints: MountState::default(),
            shake_n: 0.0,
            logger: Logger::default(),
            recorded: false,
            converter: Converter::new(&front, parts.noise, seed),
            tachometers: Tachometers::new(&parts.geometry, detail, seed, angle_rev),
            geometry: parts.geometry,
            meter: BackEmfState::new(BackEmfMeter::default()),
            metered_rev: angle_rev,
            steps: 0,
            run_start_steps: None,
            angle_rev,
            heavy_spot_rev: phase.uniform(),
            turned: PlantBlock::default(),
            whirl: Whirl::default(),
            strain_v: [front.zero_v[0]; STEPS_PER_MS],
            torque_v: front.zero_v[1],
            drawn_v: 0.0,
            front,
            output_us: 1000.0,
            edges: VecDeque::new(),
            listens: Listens::default(),
            telemetry: EscTelemetry::new(parts.esc_errors, pole_pairs, parts.telemetry_asked, seed),
            comparator: Comparator::new(BackEmfMeter::default(), seed),
            emf: None,
            turns: VecDeque::new(),
            truth: Truth::default(),
            by_hand: (0.0, 0.0),
        }
    }

    /// Puts the parts of the effects whose windows are open now in the place of those so far. All states go on.
    fn refit(&mut self) {
        let parts = fitted(&self.base, &self.effects, self.open);
        self.esc.refit(parts.esc);
        self.plant.refit(&parts.plant);
        self.mode.refit(&parts.beam, STEP_S);
        self.beam = parts.beam;
        self.bridge.refit(parts.bridge, STEP_S);
        self.rigid = parts.mount == Mount::default();
        self.mount = parts.mount;
        self.tachometers.refit(&parts.geometry, self.angle_rev);
        self.geometry = parts.geometry;
    }

    /// Voltages at the pins without noise.
    fn pins_v(&self) -> [f64; ADC_CHANNELS] {
        let strain_v = self.strain_v[((self.steps + STEPS_PER_MS as u64 - 1) % STEPS_PER_MS as u64) as usize];
        let mut pins = self.front.pins(strain_v, &self.truth.plant);
        pins[1] = self.torque_v;
        pins[2] += self.drawn_v;
        for (pin, spike) in pins.iter_mut().zip(self.levers.spike_v) {
            *pin += spike;
        }
        pins
    }

    /// The operator's switch: connects or cuts the ESC's power.
    pub fn set_power(&mut self, on: bool) {
        self.esc.set_power(on);
    }

    /// The ESC was switched on and ready before the board started.
    pub fn esc_is_ready(&mut self) {
        self.esc.set_ready();
    }

    /// Hangs a mass on the load cell, gram; it pulls the beam down. 0 takes it off.
    pub fn hang(&mut self, mass_g: f64) {
        self.by_hand.0 = -mass_g * 1.0e-3 * G;
    }

    /// Twists the torque arm from outside, N.m. 0 lets it go.
    pub fn twist(&mut self, torque_nm: f64) {
        self.by_hand.1 = torque_nm;
    }

    /// Draws a current through the shunt with a load of one's own, A. 0 takes it off.
    pub fn draw(&mut self, current_a: f64) {
        self.drawn_v = self.front.volts_of(current_a);
    }

    /// Sets the bench supply, V. A battery takes no notice.
    pub fn set_supply(&mut self, voltage_v: f64) {
        self.base.plant.supply.set(voltage_v);
        self.refit();
    }

    /// The run starts now: from here the effects count their time.
    pub fn start_run(&mut self) {
        self.run_start_steps = Some(self.steps);
    }

    /// A pulse of `width_ns` on the ESC pin ended at `at_ns`.
    pub fn pulse(&mut self, at_ns: u64, width_ns: u32) {
        self.esc.pulse(at_ns, width_ns);
    }

    /// A DShot frame of 16 bits on the ESC pin ended at `at_ns`. One that asks for telemetry is answered within the next millisecond.
    pub fn frame(&mut self, at_ns: u64, word: u16) {
        self.esc.frame(at_ns, word);
        if Frame::from_word(word).is_some_and(|frame| frame.telemetry) {
            self.telemetry.ask();
        }
    }

    /// Integrates until [`Bench::horizon_ns`] is at least `at_ns`. The look-ahead is less than one step of 0.1 ms.
    pub fn advance_to(&mut self, at_ns: u64) {
        while self.horizon_ns() < at_ns {
            if self.steps.is_multiple_of(STEPS_PER_MS as u64) {
                self.each_millisecond();
                self.converter.renew();
            }
            self.step();
        }
    }

    /// Time up to which everything is integrated, ns.
    #[must_use]
    pub fn horizon_ns(&self) -> u64 {
        self.steps * STEP_NS
    }

    /// Time of the earliest edge that was not fetched yet; `None` when there is none before [`Bench::horizon_ns`].
    #[must_use]
    pub fn next_edge_ns(&self) -> Option<u64> {
        self.edges.front().map(|e| e.at_ns)
    }

    /// Fetches the earliest edge if it is due at or before `at_ns`.
    pub fn edge_until(&mut self, at_ns: u64) -> Option<Edge> {
        if self.next_edge_ns()? <= at_ns { self.edges.pop_front() } else { None }
    }

    /// What the board's wires to the cross-checks are good for from here on. Nothing, before it is called.
    pub fn listen(&mut self, listens: Listens) {
        self.listens = listens;
    }

    /// Something becomes of the line of the ESC's telemetry.
    pub fn set_esc_wire(&mut self, wire: EscWire) {
        self.telemetry.set_wire(wire);
    }

    /// The next byte of the ESC's telemetry that has ended by `until_ns`, marked where it came with an error of the line.
    pub fn esc_word(&mut self, until_ns: u64) -> Option<u16> {
        self.telemetry.word(until_ns)
    }

    /// Time of the earliest change of the back-EMF meter's output that was not fetched yet.
    #[must_use]
    pub fn next_turn_ns(&self) -> Option<u64> {
        self.turns.front().map(|e| e.at_ns)
    }

    /// Fetches it if it is due at or before `at_ns`.
    pub fn turn_until(&mut self, at_ns: u64) -> Option<Edge> {
        if self.next_turn_ns()? <= at_ns { self.turns.pop_front() } else { None }
    }

    /// Level of a capture pin after the edges made so far (with [`EdgeDetail::Pins`]); for set-up after a reset.
    #[must_use]
    pub fn level(&self, channel: usize) -> bool {
        self.tachometers.level(channel)
    }

    /// Voltages at the pins of strain, torque, current, voltage and temperature, noise of the wires included, V.
    #[must_use]
    pub fn voltages(&self) -> [f64; ADC_CHANNELS] {
        let pins = self.pins_v();
        core::array::from_fn(|i| pins[i] + self.converter.offset_v(i))
    }

    /// One conversion of an ADC channel now, with its own noise, 12 bits. Each call draws new noise.
    pub fn convert(&mut self, channel: usize) -> u16 {
        let pins = self.pins_v();
        self.converter.convert(channel, pins[channel])
    }

    /// The next beep pattern that has ended, with the time of its end, ns.
    pub fn beep(&mut self) -> Option<(u64, Beep)> {
        self.esc.beep()
    }

    /// Where the ESC stands.
    #[must_use]
    pub fn esc_state(&self) -> EscState {
        self.esc.state()
    }

    /// What is really there now.
    #[must_use]
    pub fn truth(&self) -> Truth {
        self.truth
    }

    /// The calibration that fits this bench exactly.
    #[must_use]
    pub fn calibration(&self) -> Calibration {
        Calibration {
            timer_hz: Ticks::HZ,
            marks: self.geometry.marks(),
            adc: self.front.scales(),
            pole_pairs: [self.base.plant.motor.pole_pairs as u16; 2],
        }
    }
}
