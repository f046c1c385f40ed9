//! The same pins for the flash image and for the native tick: equal telemetry, and the instructions that a tick takes.
//!
//! What it is: edges of the four speed sensors from the simulated bench and constant codes at the five ADC pins, driven into the
//! emulated board at exact instants, and the same edges given to `Rig::tick` on the host.
//! What can go wrong: an edge within a microsecond of a sample may fall before it on one side and behind it on the other; such
//! samples are counted apart. When an edge came is what the board's own counter read at that instant, checked against the script.
//! Build the image first: `cargo xtask image`

use firmware_rig::{AdcBlock, Beside, Config, Inputs, Rig};
use frame::message::Message;
use frame::rig::{ADC_CHANNELS, CAPTURE_CHANNELS, CAPTURE_NAMES, CaptureVerdict, RigSample};
use frame::units::Ticks;
use frame::wire::Decoder;
use hal_sim::emulated::{GeneralTimer, Machine, Pins, World, firmware, run};
use hal_sim::{Bench, Edge, EdgeDetail, Scenario};
use quadrig_tests::budget::judge_tick;

const MS: u64 = 1_000_000;
/// Edges begin here, ns after power-up: the capture timer has long started.
const FIRST: u64 = 50 * MS;
/// Codes of the five ADC pins.
const CODES: [u16; ADC_CHANNELS] = [1830, 2048, 512, 2380, 800];
/// ADC1 inputs of the same.
const ADC_INPUTS: [u8; ADC_CHANNELS] = [10, 11, 12, 13, 14];
/// Edges of channel 3 that the timer's prescaler makes one capture of.
const PRESCALER: usize = 4;

/// Edges of a rotor that spins up from rest to half throttle, `ms` of them, the first at [`FIRST`].
fn edges(ms: u64) -> Vec<Edge> {
    let mut bench = Bench::new(&Scenario::default(), None, EdgeDetail::Pins);
    bench.set_power(true);
    let spin_up = 4_500;
    for t in 0..spin_up + ms {
        if t % 20 == 2 {
            bench.pulse(t * MS, if t < spin_up { 1_000_000 } else { 1_500_000 });
        }
        bench.advance_to((t + 1) * MS);
    }
    let end = (spin_up + ms) * MS;
    let mut all = Vec::new();
    while let Some(edge) = bench.edge_until(end) {
        all.push(Edge { at_ns: edge.at_ns - spin_up * MS + FIRST, ..edge });
    }
    assert!(ms == 0 || all.len() > 1000, "{} edges", all.len());
    all
}

/// Drives a script of edges and remembers when each really came.
struct Script {
    /// The edges, their ticks as the board's counter read at each.
    edges: Vec<Edge>,
    next: usize,
    ready: bool,
}

impl World for Script {
    fn wake(&mut self, now_ns: u64, pins: &mut Pins<'_>) -> u64 {
        if !self.ready {
            self.ready = true;
            for (input, code) in ADC_INPUTS.iter().zip(CODES) {
                pins.set_adc(*input, f64::from(code));
            }
            pins.drive(hal_sim::emulated::Port::B, 12, false); // the stop loop is closed
        }
        while let Some(edge) = self.edges.get_mut(self.next).filter(|e| e.at_ns <= now_ns) {
            pins.drive_timer(GeneralTimer::Tim2, edge.channel + 1, edge.rising);
            edge.at_ns = now_ns;
            edge.at_ticks = u64::from(pins.counter(GeneralTimer::Tim2));
            self.next += 1;
        }
        self.edges.get(self.next).map_or(u64::MAX, |e| e.at_ns)
    }
}

/// The image on a script for `ms`: its samples, the edges as driven, instructions.
fn image(script: Vec<Edge>, ms: u64) -> (Vec<RigSample>, Vec<Edge>, u64) {
    let elf = firmware("firmware-rig").unwrap_or_else(|e| panic!("{e}"));
    let machine = Machine::new().unwrap_or_else(|e| panic!("{e}"));
    let world = Script { edges: script, next: 0, ready: false };
    let (outcome, _) = run(&elf, machine, world, ms * MS).unwrap_or_else(|e| panic!("{e}"));
    let mut decoder = Decoder::default();
    let mut samples = Vec::new();
    for byte in &outcome.telemetry {
        if let Some(Message::Rig(sample)) = decoder.push::<Message>(*byte).map(|r| r.message) {
            samples.push(sample);
        }
    }
    (samples, outcome.world.edges, outcome.instructions)
}

/// What the capture unit latches: rising edges, every fourth of the encoder counted from `phase`.
fn captures(edges: &[Edge], phase: usize) -> [Vec<u64>; CAPTURE_CHANNELS] {
    core::array::from_fn(|channel| {
        let rising = edges.iter().filter(|e| usize::from(e.channel) == channel && e.rising);
        let ticks = rising.map(|e| e.at_ticks);
        if channel == 3 { ticks.skip(phase).step_by(PRESCALER).collect() } else { ticks.collect() }
    })
}

/// `Rig::tick` on the host, with ticks at the image's own instants where those are known.
fn native(samples: &[RigSample], captures: &[Vec<u64>; CAPTURE_CHANNELS]) -> Vec<RigSample> {
    const TICK: u64 = 84_000;
    let mut rig = Rig::new(Config::thesis_570kv());
    let mut next = [0usize; CAPTURE_CHANNELS];
    let mut out = Vec::new();
    let Some(first) = samples.first() else { return out };
    // ticks are taken a little early, so that each sample's own tick is the first not before it is due
    let begin = first.at.0 - 100 * TICK - 200;
    let mut times = vec![begin];
    let mut from = begin;
    for sample in samples {
        times.extend((1..100).map(|j| from + j * TICK));
        times.push(sample.at.0);
        from = sample.at.0;
    }
    for now in times {
        let taken: [Vec<u32>; CAPTURE_CHANNELS] = core::array::from_fn(|c| {
            let mut taken = Vec::new();
            while let Some(at) = captures[c].get(next[c]).filter(|at| **at <= now) {
                taken.push(*at as u32);
                next[c] += 1;
            }
            taken
        });
        let adc = CODES.map(|code| {
            let (wide, count) = (u32::from(code), 8);
            AdcBlock { sum: wide * count, sum_sq: u64::from(wide * wide) * u64::from(count), count: 8, min: code, max: code }
        });
        let outputs = rig.tick(&Inputs {
            now: Ticks(now),
            edges: core::array::from_fn(|c| taken[c].as_slice()),
            over_capture: [false; CAPTURE_CHANNELS],
            adc: &adc,
            beside: Beside::UNWIRED,
            command: None,
            line: Default::default(),
            stop_input: false,
            brown_out: false,
            paused: false,
        });
        out.extend(outputs.sample);
    }
    out
}

/// Whether an edge of the channel lies within a microsecond of the sample.
fn doubtful(sample: &RigSample, captures: &[u64]) -> bool {
    let near = captures.partition_point(|at| *at + 84 < sample.at.0);
    captures.get(near).is_some_and(|at| *at < sample.at.0 + 84)
}

#[test]
fn the_image_and_the_native_tick_tell_the_same_of_the_same_pins() {
    let (samples, edges, _) = image(edges(1_900), 2_000);
    assert!(samples.len() >= 15, "{} samples", samples.len());
    // the counter runs at 84 MHz and nothing else: one start explains every edge to the tick
    let starts = edges.iter().map(|e| e.at_ns as f64 - e.at_ticks as f64 / 0.084);
    let (first, last) = starts.fold((f64::MAX, f64::MIN), |(low, high), s| (low.min(s), high.max(s)));
    println!("the timer started {first:.1} to {last:.1} ns after power-up, from {} edges", edges.len());
    assert!(last - first <= 1.0 / 0.084 + 1.0, "one tick and the rounding to ns");
    let compare = |phase: usize| {
        let captures = captures(&edges, phase);
        let native = native(&samples, &captures);
        assert_eq!(native.len(), samples.len());
        let (mut equal, mut apart, mut doubt) = ([0; CAPTURE_CHANNELS], [0; CAPTURE_CHANNELS], 0);
        for (a, b) in samples.iter().zip(&native) {
            assert_eq!((a.at, a.pulse, a.state, a.faults), (b.at, b.pulse, b.state, b.faults));
            for channel in 0..CAPTURE_CHANNELS {
                if a.rpm[channel] == b.rpm[channel] {
                    equal[channel] += 1;
                } else if doubtful(a, &captures[channel]) {
                    doubt += 1;
                } else {
                    apart[channel] += 1;
                }
            }
        }
        (equal, apart, doubt, native)
    };
    let (equal, apart, doubt, native) = (0..PRESCALER).map(compare).min_by_key(|c| c.1[3]).expect("four phases");
    for (channel, name) in CAPTURE_NAMES.iter().enumerate() {
        println!("{name}: {} readings bit-equal, {} apart", equal[channel], apart[channel]);
    }
    println!("{doubt} readings with an edge within a microsecond of the sample differ");
    assert_eq!(apart, [0; CAPTURE_CHANNELS]);
    assert!(doubt <= samples.len() / 5 && equal.iter().all(|n| *n + doubt >= samples.len()), "{equal:?} {doubt}");
    assert!(samples.iter().filter(|s| s.rpm[0].verdict == CaptureVerdict::Nominal).count() > 10, "the rotor was seen");

    // conversions: the codes are equal, their number is the converter's own pace
    let mut worst = 0.0f64;
    for (a, b) in samples.iter().zip(&native) {
        for (channel, code) in CODES.iter().enumerate() {
            let mean = |s: &RigSample| f64::from(s.adc[channel].sum) / f64::from(s.adc[channel].count);
            assert_eq!((mean(b), a.adc[channel].verdict), (f64::from(*code), b.adc[channel].verdict), "channel {channel}");
            worst = worst.max((mean(a) - mean(b)).abs());
        }
    }
    let counts: Vec<u16> = samples.iter().map(|s| s.adc[0].count).collect();
    println!("conversions a sample {counts:?}, means apart by {worst} counts at most");
    // the first sample holds conversions from before the pins were set
    assert!(worst <= 40.0, "{worst}");
    let settled = samples.iter().skip(1).flat_map(|s| (0..ADC_CHANNELS).map(move |c| (s.adc[c], CODES[c])));
    for (code, pin) in settled {
        assert_eq!(code.sum, u32::from(pin) * u32::from(code.count));
    }
}

/// Instructions a tick between two lengths of the same run, which is exact: the emulator repeats itself to the instruction.
#[test]
fn instructions_per_tick_stay_in_their_budget() {
    let per_tick = |script: fn(u64) -> Vec<Edge>| {
        let count = |ms: u64| image(script(1_000), ms).2;
        (count(900) - count(400)) as f64 / 500.0
    };
    for (key, script) in [("at_rest", (|_| Vec::new()) as fn(u64) -> Vec<Edge>), ("turning", edges)] {
        let measured = per_tick(script);
        judge_tick("rig", key, measured, 168_000.0);
    }
}
