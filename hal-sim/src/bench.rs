//! The bench: ESC, powerplant, beam and sensors on one clock.
//!
//! What it is: the rig as its board meets it. Pulses go in with the time of their end; edges, pin voltages and beeps come out.
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

use crate::effect::{Levers, Scheduled};
use crate::noise::{Source, Stream};
use crate::plant::beam::BeamMode;
use crate::plant::bridge::BridgeState;
use crate::plant::mount::MountState;
use crate::plant::powerplant::STEPS_PER_MS;
use crate::plant::{Beam, Bridge, Esc, EscDialogue, EscState, Mount, Parts, PlantBlock, PlantState, Powerplant, RigPlant};
use crate::scenario::Scenario;
use crate::sensor::back_emf::BackEmfState;
use crate::sensor::{AnalogFront, BackEmfMeter, Converter, Edge, EdgeDetail, Geometry, Logger, Tachometers};
use core::f64::consts::TAU;
use firmware_rig::AdcBlock;
use frame::calibration::Calibration;
use frame::message::Beep;
use frame::rig::{ADC_CHANNELS, CAPTURE_CHANNELS};
use frame::units::Ticks;
use std::collections::VecDeque;

/// Integration step, ns.
pub const STEP_NS: u64 = 100_000;
/// Integration step, s.
pub const STEP_S: f64 = 1.0e-4;
/// Speeds that a powerplant may give, rev/min; with any other the rotor rests.
const SPEEDS: core::ops::Range<f64> = 0.0..1.0e6;
/// Ticks of 84 MHz in a step.
const STEP_TICKS: u64 = 8_400;

/// Everything that a bench is built of. Effects may change it before the run.
#[derive(Debug, Clone, PartialEq)]
pub struct BenchParts {
    /// The powerplant's parts.
    pub plant: Parts,
    /// The ESC's dialogue.
    pub esc: Esc,
    /// Cantilever.
    pub beam: Beam,
    /// Bridge and amplifier.
    pub bridge: Bridge,
    /// Joints of motor and torque arm.
    pub mount: Mount,
    /// Speed sensors.
    pub geometry: Geometry,
    /// Standard deviation of the mean over 0.1 s of each analogue channel, in its unit.
    pub noise: [f64; ADC_CHANNELS],
}

/// What is really there at one instant, for judging what was measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Truth {
    /// Seconds since run start; negative before.
    pub run_s: f64,
    /// Pulse that the ESC follows, us.
    pub pulse_us: f64,
    /// Powerplant.
    pub plant: PlantState,
    /// Force that the gauges see, N.
    pub beam_n: f64,
    /// What the back-EMF meter shows, rev/min; the rig's board is not wired to it.
    pub back_emf_rpm: Option<f64>,
}

/// What the board's peripherals gathered in one millisecond.
#[derive(Debug, Clone, Default)]
pub struct Millisecond {
    /// Rising edges of each capture channel, ticks modulo 2^32.
    pub edges: [Vec<u32>; CAPTURE_CHANNELS],
    /// Conversions of each ADC channel.
    pub adc: [AdcBlock; ADC_CHANNELS],
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
    strain_v: [f64; STEPS_PER_MS],
    torque_v: f64,
    output_us: f64,
    edges: VecDeque<Edge>,
    truth: Truth,
}

impl Bench {
    /// A bench at rest without ESC power. `plant` takes the place of the scenario's own powerplant; effects on the
    /// powerplant then have nothing to act on, those on the load cell and the sensors still do.
    #[must_use]
    pub fn new(scenario: &Scenario, plant: Option<Box<dyn Powerplant>>, detail: EdgeDetail) -> Self {
        let base = scenario.parts();
        let effects = scenario.effects.clone();
        let open = open(&effects, -1.0);
        let parts = fitted(&base, &effects, open);
        let seed = scenario.seed;
        let mut phase = Stream::new(seed, Source::Phase, 0);
        let angle_rev = phase.uniform();
        let cells = parts.plant.supply.cells();
        let front = AnalogFront::new(&parts.bridge);
        let plant = plant.unwrap_or_else(|| Box::new(RigPlant::new(parts.plant, seed)));
        Self {
            esc: EscDialogue::new(parts.esc, cells),
            plant,
            base,
            effects,
            open,
            seed,
            levers: Levers::default(),
            mode: BeamMode::new(&parts.beam, STEP_S),
            beam: parts.beam,
            bridge: BridgeState::new(parts.bridge, STEP_S),
            mount: parts.mount,
            joints: MountState::default(),
            rigid: true,
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
            strain_v: [front.zero_v[0]; STEPS_PER_MS],
            torque_v: front.zero_v[1],
            front,
            output_us: 1000.0,
            edges: VecDeque::new(),
            truth: Truth::default(),
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
        self.mount = parts.mount;
        self.tachometers.refit(&parts.geometry, self.angle_rev);
        self.geometry = parts.geometry;
    }

    /// Voltages at the pins without noise.
    fn pins_v(&self) -> [f64; ADC_CHANNELS] {
        let strain_v = self.strain_v[((self.steps + STEPS_PER_MS as u64 - 1) % STEPS_PER_MS as u64) as usize];
        let mut pins = self.front.pins(strain_v, &self.truth.plant);
        pins[1] = self.torque_v;
        for (pin, spike) in pins.iter_mut().zip(self.levers.spike_v) {
            *pin += spike;
        }
        pins
    }

    /// The operator's switch: connects or cuts the ESC's power.
    pub fn set_power(&mut self, on: bool) {
        self.esc.set_power(on);
    }

    /// The run starts now: from here the effects count their time.
    pub fn start_run(&mut self) {
        self.run_start_steps = Some(self.steps);
    }

    /// A pulse of `width_ns` on the ESC pin ended at `at_ns`.
    pub fn pulse(&mut self, at_ns: u64, width_ns: u32) {
        self.esc.pulse(at_ns, width_ns);
    }

    /// Integrates until [`Bench::horizon_ns`] is at least `at_ns`. The look-ahead is less than one step of 0.1 ms.
    pub fn advance_to(&mut self, at_ns: u64) {
        while self.horizon_ns() < at_ns {
            if self.steps.is_multiple_of(STEPS_PER_MS as u64) {
                self.each_millisecond();
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
        Calibration { timer_hz: Ticks::HZ, marks: self.geometry.marks(), adc: self.front.scales() }
    }

    /// One millisecond of a native run. Call it at whole milliseconds only, and not together with [`Bench::advance_to`].
    pub fn millisecond(&mut self, out: &mut Millisecond) {
        for edges in &mut out.edges {
            edges.clear();
        }
        self.each_millisecond();
        if self.rigid && !self.recorded {
            self.block(out);
        } else {
            for _ in 0..STEPS_PER_MS {
                self.step();
            }
            while let Some(edge) = self.edges.pop_front() {
                if edge.rising {
                    out.edges[usize::from(edge.channel)].push(edge.at_ticks as u32);
                }
            }
        }
        // The board makes 61.8 conversions of each channel in a millisecond, a run here 8.5 for the sake of its speed: the noise of
        // its means is 2.7 times the board's (docs/rig.md, "Analogue channels").
        let count = 8 + ((self.steps / STEPS_PER_MS as u64) & 1) as u16;
        let pins_v = self.pins_v();
        if self.levers.spike_v[0] != 0.0 {
            self.strain_v.iter_mut().for_each(|v| *v += self.levers.spike_v[0]);
        }
        for (channel, block) in out.adc.iter_mut().enumerate() {
            *block = match channel {
                0 => self.converter.block(0, count, &self.strain_v),
                _ => self.converter.block(channel, count, &pins_v[channel..=channel]),
            };
        }
    }

    fn each_millisecond(&mut self) {
        self.esc.advance_to(self.horizon_ns());
        self.esc.feel(self.truth.plant.voltage_v, self.truth.plant.current_a, 1.0e-3);
        self.output_us = self.esc.output_us();
        self.converter.renew();
        let run_s = match self.run_start_steps {
            Some(start) => (self.steps - start) as f64 * STEP_S,
            None => -1.0,
        };
        let open = open(&self.effects, run_s);
        if open != self.open {
            self.open = open;
            self.refit();
        }
        self.levers = Levers { seed: self.seed, ..Levers::default() };
        self.levers.plant.run_s = run_s;
        if run_s >= 0.0 {
            for (i, effect) in self.effects.iter().enumerate() {
                if open & (1 << i) != 0 {
                    effect.act(run_s, &mut self.levers);
                }
            }
        }
        self.tachometers.couple(!self.levers.encoder_off);
        let unbalance = Beam { unbalance_kgm: self.beam.unbalance_kgm + self.levers.unbalance_kgm, ..self.beam };
        self.shake_n = unbalance.shaking_n(TAU, 1.0);
        self.rigid = self.mount == Mount::default();
        // the logger's clock may stand still again; its tape then runs out
        self.recorded |= self.levers.late_s > 0.0;
        self.plant.adjust(&self.levers.plant);
        self.truth.run_s = run_s;
        let turned = (self.metered_rev, self.angle_rev);
        self.meter.pass(turned, self.plant.back_emf(), self.steps as f64 * STEP_S, 1.0e-3);
        self.metered_rev = self.angle_rev;
        self.truth.back_emf_rpm = self.meter.rpm();
    }

    /// Ten steps at once, part by part instead of step by step: the same numbers, for what comes later in a step never acts on what
    /// comes earlier in the next. Only for stiff joints and no logger.
    fn block(&mut self, out: &mut Millisecond) {
        let mut plant = PlantBlock::default();
        self.plant.advance_block(STEP_S, self.output_us, &mut plant);
        if !plant.rpm.iter().all(|rpm| SPEEDS.contains(rpm)) {
            plant.rpm = plant.rpm.map(|rpm| if SPEEDS.contains(&rpm) { rpm } else { 0.0 });
        }
        plant.last.rpm = plant.rpm[STEPS_PER_MS - 1];
        if !self.esc.powered() {
            (plant.last.voltage_v, plant.last.current_a) = (0.0, 0.0);
        }

        let rev_s = plant.rpm.map(|rpm| rpm / 60.0);
        let mut turned = [self.angle_rev; STEPS_PER_MS + 1];
        for i in 0..STEPS_PER_MS {
            turned[i + 1] = turned[i] + rev_s[i] * STEP_S;
        }
        let start_ticks = self.steps * STEP_TICKS;
        self.tachometers.block(&turned, &rev_s, |channel, rising, step, fraction| {
            if rising {
                let ticks = start_ticks + step as u64 * STEP_TICKS + (fraction * STEP_TICKS as f64) as u64;
                out.edges[usize::from(channel)].push(ticks as u32);
            }
        });
        self.angle_rev = turned[STEPS_PER_MS];

        let mut pin = plant.thrust_n;
        shake(&mut pin, &rev_s, &turned[1..], self.shake_n, self.heavy_spot_rev);
        self.mode.block(&mut pin);
        let beam_n = pin[STEPS_PER_MS - 1];
        let l = &self.levers;
        let zero_n = plant.torque_nm.map(|torque_nm| l.strain_zero_n + l.torque_to_lift * torque_nm);
        self.bridge.block(&mut pin, &zero_n, l.strain_gain, &plant.temp_c);
        self.strain_v = pin;
        self.torque_v = self.front.torque_v(plant.torque_nm[STEPS_PER_MS - 1]);
        self.truth = Truth { pulse_us: self.output_us, plant: plant.last, beam_n, ..self.truth };
        self.steps += STEPS_PER_MS as u64;
    }

    /// One step; [`Bench::each_millisecond`] comes before the first of each millisecond.
    fn step(&mut self) {
        let place = (self.steps % STEPS_PER_MS as u64) as usize;
        let mut state = self.plant.advance(STEP_S, self.output_us);
        if !SPEEDS.contains(&state.rpm) {
            state.rpm = 0.0;
        }
        if !self.esc.powered() {
            (state.voltage_v, state.current_a) = (0.0, 0.0);
        }

        let speed_rev_s = state.rpm / 60.0;
        let from = self.angle_rev;
        let to = from + speed_rev_s * STEP_S;
        let (start_ns, start_ticks) = (self.steps * STEP_NS, self.steps * STEP_TICKS);
        let edges = &mut self.edges;
        let before = edges.len();
        self.tachometers.step(from, to, speed_rev_s, |channel, rising, fraction| {
            edges.push_back(Edge {
                channel,
                rising,
                at_ns: start_ns + (fraction * STEP_NS as f64) as u64,
                at_ticks: start_ticks + (fraction * STEP_TICKS as f64) as u64,
            });
        });
        if edges.len() > before + 1 {
            edges.make_contiguous()[before..].sort_by_key(|e| (e.at_ns, e.channel));
        }
        self.angle_rev = to;

        let (mut lift_n, mut torque_nm) = (state.thrust_n, state.torque_nm);
        if !self.rigid {
            self.joints.shake(&self.mount, to - from);
            (lift_n, torque_nm) = self.joints.tilted(&self.mount, lift_n, torque_nm, self.beam.length_m);
        }
        let force = lift_n + self.shake_n * speed_rev_s * speed_rev_s * turn_cosine(to + self.heavy_spot_rev);
        let beam_n = self.mode.step(force);
        let zero_n = self.levers.strain_zero_n + self.levers.torque_to_lift * torque_nm;
        let mut strain_v = self.bridge.step(beam_n, zero_n, self.levers.strain_gain, state.temp_c);
        if !self.rigid {
            torque_nm = self.joints.arm(&self.mount, torque_nm);
        }
        let mut torque_v = self.front.torque_v(torque_nm);
        if self.recorded {
            [strain_v, torque_v] = self.logger.pass([strain_v, torque_v], self.levers.late_s, STEP_S);
        }
        self.torque_v = torque_v;
        self.strain_v[place] = strain_v;
        self.truth = Truth { pulse_us: self.output_us, plant: state, beam_n, ..self.truth };
        self.steps += 1;
    }
}

/// Bits of the effects whose windows are open `run_s` into the run. A scenario holds at most 128 effects.
fn open(effects: &[Scheduled], run_s: f64) -> u128 {
    effects.iter().enumerate().filter(|(_, e)| e.is_open(run_s)).fold(0, |bits, (i, _)| bits | 1 << i)
}

/// The parts with the effects of `open` fitted.
fn fitted(base: &BenchParts, effects: &[Scheduled], open: u128) -> BenchParts {
    let mut parts = base.clone();
    for (_, effect) in effects.iter().enumerate().filter(|(i, _)| open & (1 << i) != 0) {
        effect.fit(&mut parts);
    }
    parts
}

/// Adds the force of the unbalance to each of `force_n`. Slices of no fixed length, so that the steps go side by side.
#[inline(never)]
fn shake(force_n: &mut [f64], rev_s: &[f64], turned: &[f64], shake_n: f64, heavy_spot_rev: f64) {
    for ((force, speed), turn) in force_n.iter_mut().zip(rev_s).zip(turned) {
        *force += shake_n * speed * speed * turn_cosine(turn + heavy_spot_rev);
    }
}

/// 2^52: a double of this size has no fraction.
const ROUNDING: f64 = 4_503_599_627_370_496.0;

/// cos(2 pi turn), to 1e-10: the Taylor series of the nearest half turn. `libm::cos` costs as much as the rest of a step.
#[inline]
fn turn_cosine(turn: f64) -> f64 {
    // angles are not negative and below 2^51: adding 2^52 leaves no fraction, so this is the floor, and it goes two at a time
    let nearest = (turn + ROUNDING) - ROUNDING;
    let part = turn - if nearest > turn { nearest - 1.0 } else { nearest };
    let near = (part - 0.5).abs(); // 0.5 at the heavy spot, 0 opposite
    let (distance, sign) = if near > 0.25 { (0.5 - near, 1.0) } else { (near, -1.0) };
    let y = TAU * TAU * distance * distance;
    // pairs of terms side by side (Estrin): half the time of Horner's chain
    let (y2, y4) = (y * y, y * y * y * y);
    let low = (1.0 - y * 0.5) + y2 * (1.0 / 24.0 - y * (1.0 / 720.0));
    let high = (1.0 / 40_320.0 - y * (1.0 / 3_628_800.0)) + y2 * (1.0 / 479_001_600.0 - y * (1.0 / 87_178_291_200.0));
    sign * (low + y4 * (high + y4 * (1.0 / 20_922_789_888_000.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cosine_of_a_turn_is_that_of_the_library() {
        for i in 0..6000 {
            let turn = f64::from(i) * 1.37e-3;
            assert!((turn_cosine(turn) - libm::cos(TAU * turn)).abs() < 1e-10, "{turn}");
        }
    }

    /// The native run's millisecond at once gives what the emulated board's steps give.
    #[test]
    fn a_millisecond_at_once_is_its_ten_steps() {
        for effect in
            [None, Some("beam_resonance"), Some("spinup_lag"), Some("clock_drift"), Some("loosening_mount"), Some("encoder_drag")]
        {
            let scenario = Scenario::demo(3, effect).unwrap_or_else(|e| panic!("{e}"));
            let bench = || {
                let mut bench = Bench::new(&scenario, None, EdgeDetail::Captured);
                bench.set_power(true);
                bench
            };
            let (mut fast, mut slow) = (bench(), bench());
            let mut out = Millisecond::default();
            for ms in 0..12_000u64 {
                let width = if ms < 5_000 { 1_000_000 } else { 1_700_000 };
                for bench in [&mut fast, &mut slow] {
                    if ms == 5_500 {
                        bench.start_run();
                    }
                    if ms % 20 == 2 {
                        bench.pulse(ms * 1_000_000, width);
                    }
                }
                fast.millisecond(&mut out);
                slow.advance_to((ms + 1) * 1_000_000);
                let mut edges: [Vec<u32>; CAPTURE_CHANNELS] = Default::default();
                while let Some(edge) = slow.edge_until(u64::MAX) {
                    edges[usize::from(edge.channel)].push(edge.at_ticks as u32);
                }
                assert_eq!(out.edges, edges, "{effect:?} {ms} ms");
                assert_eq!(fast.truth(), slow.truth(), "{effect:?} {ms} ms");
                assert_eq!(fast.voltages(), slow.voltages(), "{effect:?} {ms} ms");
            }
            assert!(fast.truth().plant.rpm > 1000.0);
        }
    }
}
