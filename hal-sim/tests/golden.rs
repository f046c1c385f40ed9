//! The same seed gives the same bytes, in debug and in release, on any machine.
//!
//! The first digests cover every edge, conversion and beep of a scripted session on the bench, without the firmware. When one changes,
//! the physics changed. The last covers every value of the log of a whole run: firmware, codec and conversion. Say what changed in the
//! commit that changes `golden.txt`.

use hal_sim::scenario::Schedule;
use hal_sim::{Bench, EdgeDetail, Millisecond, Scenario, run};

/// FNV-1a, 64 bits.
struct Digest(u64);

impl Digest {
    fn word(&mut self, word: u64) {
        for byte in word.to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

fn session(effect: &str) -> u64 {
    let mut bench = Bench::new(&Scenario::demo(11, Some(effect)).unwrap(), None, EdgeDetail::Captured);
    let mut digest = Digest(0xcbf2_9ce4_8422_2325);
    let mut gathered = Millisecond::default();
    for ms in 0..9_000u64 {
        if ms == 100 {
            bench.set_power(true);
        }
        if ms == 4_000 {
            bench.start_run();
        }
        if ms % 20 == 2 {
            let width = if ms < 4_000 { 1_000_000 } else { 1_000_000 + (ms as u32 - 4_000) / 1000 * 200_000 };
            bench.pulse(ms * 1_000_000, width);
        }
        bench.millisecond(&mut gathered);
        for edges in &gathered.edges {
            edges.iter().for_each(|e| digest.word(u64::from(*e)));
        }
        for block in &gathered.adc {
            digest.word(u64::from(block.sum));
            digest.word(block.sum_sq);
        }
        while let Some((at, beep)) = bench.beep() {
            digest.word(at ^ u64::from(format!("{beep:?}").len() as u32));
        }
    }
    assert!(bench.truth().plant.rpm > 4000.0, "the rotor turned: {:?}", bench.truth());
    digest.0
}

/// A run with its firmware: rest, 1000, 1500 and 2000 us, rest.
fn flight() -> u64 {
    let schedule = Schedule::Staircase { step_us: 500.0, hold_s: 1.0, top_us: 2000.0 };
    let scenario = Scenario { schedule, rest_s: 0.5, ..Scenario::demo(12, Some("creep")).unwrap() };
    let record = run(&scenario, None, &mut |_| ()).unwrap_or_else(|e| panic!("{e}"));
    let mut digest = Digest(0xcbf2_9ce4_8422_2325);
    for row in record.converted() {
        digest.word(row.t_s.to_bits());
        digest.word(row.pulse_us.to_bits());
        row.rpm.iter().chain(&row.adc).chain([&row.thrust_rms_n]).for_each(|v| digest.word(v.map_or(0, f64::to_bits)));
    }
    assert!(record.samples.len() > 35, "{} samples", record.samples.len());
    digest.0
}

#[test]
fn the_digest_is_the_committed_one() {
    let mut got: String =
        ["zero_drift", "beam_resonance", "battery_discharge"].iter().map(|e| format!("{e} {:016x}\n", session(e))).collect();
    got += &format!("flight {:016x}\n", flight());
    assert_eq!(got, include_str!("golden.txt"), "got:\n{got}");
}

/// The emulated board's way through the bench meets the same rotor as the native one.
#[test]
fn stepping_to_instants_and_stepping_by_milliseconds_agree() {
    let scenario = Scenario::demo(5, None).unwrap();
    let mut native = Bench::new(&scenario, None, EdgeDetail::Captured);
    let mut pins = Bench::new(&scenario, None, EdgeDetail::Pins);
    native.set_power(true);
    pins.set_power(true);
    let mut gathered = Millisecond::default();
    let (mut captured, mut risen) = ([0usize; 4], [0usize; 4]);
    for ms in 0..6_000u64 {
        if ms % 20 == 2 {
            let width = if ms < 4_000 { 1_000_000 } else { 1_600_000 };
            native.pulse(ms * 1_000_000, width);
            pins.pulse(ms * 1_000_000, width);
        }
        native.millisecond(&mut gathered);
        for (n, e) in captured.iter_mut().zip(&gathered.edges) {
            *n += e.len();
        }
        let until = (ms + 1) * 1_000_000;
        let mut at = ms * 1_000_000;
        while at < until {
            at = (at + 37_000).min(until);
            pins.advance_to(at);
            while let Some(edge) = pins.edge_until(at) {
                assert!(edge.at_ns <= at && edge.at_ns + 200_000 > at, "{edge:?} at {at}");
                risen[usize::from(edge.channel)] += usize::from(edge.rising);
            }
            assert!(pins.next_edge_ns().is_none_or(|next| next > at && next <= pins.horizon_ns()));
        }
        assert_eq!(pins.truth(), native.truth());
    }
    risen[3] /= 4;
    assert!(captured[0] > 50, "{captured:?}");
    for (c, r) in captured.iter().zip(risen) {
        assert!(c.abs_diff(r) <= 1, "{captured:?} {risen:?}");
    }
    let v = pins.voltages();
    let code = f64::from(pins.convert(3)) * 3.3 / 4096.0;
    assert!((v[3] - 11.5 / 6.0).abs() < 0.05 && (code - v[3]).abs() < 0.01, "{v:?}");
}
