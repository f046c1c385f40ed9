//! Speed from edges: exact to the tick, across the wrap of the timer, with verdicts that tell the truth.

use firmware_rig::Config;
use firmware_rig::bank::CaptureBank;
use frame::rig::{CaptureCode, CaptureVerdict};
use frame::units::Ticks;
use proptest::prelude::*;

const MS: u64 = 84_000;

/// Four sensors on one rotor at constant speed, a tick a millisecond.
struct Rotor {
    bank: CaptureBank,
    config: Config,
    now: u64,
    /// Ticks a revolution of the next steps; 0 stands still.
    revolution: u64,
    /// Time of the last mark of each channel.
    last: [u64; 4],
    /// Channels that give edges.
    alive: [bool; 4],
    /// Scale of the period of each channel in parts per 1000.
    skew: [u64; 4],
}

impl Rotor {
    fn new(start: u64) -> Self {
        Self::with(Config::thesis_570kv(), start)
    }

    fn with(config: Config, start: u64) -> Self {
        let bank = CaptureBank::new(&config);
        Self { bank, config, now: start, revolution: 0, last: [start; 4], alive: [true; 4], skew: [1000; 4] }
    }

    fn run(&mut self, ms: u64) {
        for _ in 0..ms {
            self.now += MS;
            let mut edges: [Vec<u32>; 4] = Default::default();
            for (c, list) in edges.iter_mut().enumerate() {
                let marks = u64::from(self.config.marks[c]);
                let period = (self.revolution * self.skew[c] / 1000).checked_div(marks).unwrap_or(0);
                if period == 0 {
                    self.last[c] = self.now;
                    continue;
                }
                while self.last[c] + period <= self.now {
                    self.last[c] += period;
                    if self.alive[c] {
                        list.push(self.last[c] as u32);
                    }
                }
            }
            self.bank.take(Ticks(self.now), &edges.each_ref().map(Vec::as_slice), &[false; 4]);
        }
    }

    fn sample(&mut self) -> [CaptureCode; 4] {
        self.bank.sample(Ticks(self.now))
    }

    fn rpm(&self, channel: usize, code: &CaptureCode) -> Option<f64> {
        self.config.calibration().speed(channel, code)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// At any speed and any phase of the 32-bit timer: each channel spans whole revolutions, the shortest of at least 50 ms,
    /// exactly.
    #[test]
    fn spans_are_exact_and_shortest(rpm in 120u64..11_000, start in (u64::from(u32::MAX) - 400_000_000)..u64::from(u32::MAX)) {
        let mut rotor = Rotor::new(start);
        rotor.revolution = 84_000_000 * 60 / rpm / 50 * 50; // divisible by every mark count
        rotor.run(2500);
        let codes = rotor.sample();
        for (c, code) in codes.iter().enumerate() {
            let marks = u64::from(rotor.config.marks[c]);
            prop_assert_eq!(code.verdict, CaptureVerdict::Nominal);
            prop_assert_eq!(u64::from(code.edges) % marks, 0);
            let turns = u64::from(code.edges) / marks;
            prop_assert_eq!(u64::from(code.span), turns * rotor.revolution);
            prop_assert!(u64::from(code.span) >= 50 * MS);
            prop_assert!(turns == 1 || (turns - 1) * rotor.revolution < 50 * MS, "{} turns are not the shortest", turns);
        }
    }

    /// Garbage edges never panic, and never give a reading of zero span.
    #[test]
    fn garbage_is_survived(edges in proptest::collection::vec(any::<u32>(), 0..200), over in any::<[bool; 4]>(), steps in proptest::collection::vec(0u64..200_000_000, 1..30)) {
        let config = Config::thesis_570kv();
        let mut bank = CaptureBank::new(&config);
        let mut now = 0;
        for (i, step) in steps.iter().enumerate() {
            now += step;
            let part: Vec<u32> = edges.iter().skip(i * 7).take(11).copied().collect();
            bank.take(Ticks(now), &[&part, &part, &[], &part], &over);
            for (c, code) in bank.sample(Ticks(now)).iter().enumerate() {
                let speed = config.calibration().speed(c, code);
                prop_assert!(speed.is_none_or(f64::is_finite));
            }
        }
    }
}

#[test]
fn a_constant_speed_is_read_by_all_four() {
    let mut rotor = Rotor::new(0);
    rotor.revolution = 84_000_000 * 60 / 4000;
    rotor.run(500);
    let codes = rotor.sample();
    for (c, code) in codes.iter().enumerate() {
        assert_eq!(rotor.rpm(c, code), Some(4000.0), "channel {c}");
    }
}

/// The board's own speed, by which it judges limits and silence: of any number of marks, blade by blade.
#[test]
fn the_board_itself_reads_a_propeller_of_any_number_of_blades() {
    for blades in 1..=6u16 {
        let config = Config { marks: [blades, 0, 0, 0], ..Config::thesis_570kv() };
        let mut rotor = Rotor::with(config, 0);
        rotor.revolution = 84_000_000 * 60 / 4000 / 60 * 60;
        rotor.run(500);
        let channel = &rotor.bank.channels()[0];
        assert_eq!(channel.speed().map(|v| v.0), Some(4000.0), "{blades} blades");
        assert_eq!(channel.revolution(), Some(rotor.revolution), "{blades} blades");
        let now = Ticks(rotor.now);
        assert_eq!(rotor.bank.consensus(now).map(|v| v.0), Some(4000.0), "{blades} blades");
        assert_eq!(rotor.bank.judged_speed(now).map(|v| v.0.round()), Some(4000.0), "{blades} blades");
        // three of its periods and the margin: silent for a blade longer, it does not turn any more
        let period = rotor.revolution / u64::from(blades);
        let silent = 3 * period + 20 * MS;
        let turns = |after: u64| channel.is_turning(Ticks(rotor.last[0] + after));
        assert!(turns(silent) && !turns(silent + u64::from(blades)), "{blades} blades");
    }
}

/// What is left of a burst of noise is no mark: the time from it to the next mark is no speed by which a limit is judged.
#[test]
fn an_edge_that_is_left_of_an_over_capture_makes_no_overspeed() {
    let config = Config { marks: [0, 1, 0, 0], ..Config::thesis_570kv() };
    let mut bank = CaptureBank::new(&config);
    let period = 15 * MS; // 4000 rev/min
    let mut highest = 0.0f32;
    for ms in 1..400u64 {
        let mut edges: Vec<u32> = if (ms * MS).is_multiple_of(period) { vec![(ms * MS) as u32] } else { vec![] };
        let noise = ms == 205; // 5 ms before a mark
        if noise {
            edges = vec![(ms * MS) as u32];
        }
        bank.take(Ticks(ms * MS), &[&[], &edges, &[], &[]], &[false, noise, false, false]);
        highest = highest.max(bank.judged_speed(Ticks(ms * MS)).map_or(0.0, |v| v.0));
    }
    assert!((3999.0..4001.0).contains(&highest), "{highest} rev/min");
    assert!(bank.judged_speed(Ticks(391 * MS)).is_some(), "a reading later it is judged again");
}

/// The turn of the 32-bit counter, edge by edge: one mark a revolution, the last edge before the turn, on it and after it at every
/// place near the turn, and the span of each reading against 64-bit time.
#[test]
fn the_turn_of_the_counter_edge_by_edge() {
    const TURN: u64 = 1 << 32;
    let period = 60 * MS; // longer than the 50 ms of a reading: each edge gives one of a single period
    for shift in [0, 1, 2, 63, 64, period / 2, period - 2, period - 1] {
        let mut bank = CaptureBank::new(&Config::thesis_570kv());
        let first = TURN - 4 * period + shift;
        bank.take(Ticks(first - MS), &[&[], &[(first - MS) as u32], &[], &[]], &[false; 4]); // the first capture is dropped
        for n in 0..9 {
            let at = first + n * period;
            // the tick comes at once or a little later; the counter may turn between edge and tick
            for late in [0, 1, MS / 2] {
                let mut copy = bank.clone();
                copy.take(Ticks(at + late), &[&[], &[at as u32], &[], &[]], &[false; 4]);
                let code = copy.sample(Ticks(at + late))[1];
                if n == 0 {
                    assert_eq!(code.verdict, CaptureVerdict::Stopped, "one edge is no speed");
                    continue;
                }
                assert_eq!((code.edges, code.span), (1, period as u32), "edge {n} at turn {:+}", at as i64 - TURN as i64);
                assert_eq!(code.verdict, CaptureVerdict::Nominal);
                assert!(copy.channels()[1].is_turning(Ticks(at + late)));
            }
            bank.take(Ticks(at), &[&[], &[at as u32], &[], &[]], &[false; 4]);
        }
    }
}

/// A silence of a whole turn of the counter and a little more is not taken for that little.
#[test]
fn a_silence_longer_than_the_counter_is_no_short_period() {
    let mut bank = CaptureBank::new(&Config::thesis_570kv());
    let period = 60 * MS;
    let opto = |bank: &mut CaptureBank, at: u64| bank.take(Ticks(at), &[&[], &[at as u32], &[], &[]], &[false; 4]);
    for n in 1..6 {
        opto(&mut bank, n * period);
    }
    let silent_until = 5 * period + (1 << 32) + period;
    for ms in (5 * period / MS)..(silent_until / MS) {
        bank.take(Ticks(ms * MS), &[&[]; 4], &[false; 4]);
    }
    assert_eq!(bank.sample(Ticks(silent_until))[1].verdict, CaptureVerdict::Stopped);
    opto(&mut bank, silent_until);
    let code = bank.sample(Ticks(silent_until))[1];
    assert_eq!((code.verdict, code.edges), (CaptureVerdict::Stopped, 0), "one edge after a long silence is no speed");
    opto(&mut bank, silent_until + 2 * period);
    assert_eq!(bank.sample(Ticks(silent_until + 2 * period))[1].span, 2 * period as u32);
}

/// Spikes right behind an edge are rejected, the reading is that of the marks, and the number of spikes is known. What comes so far behind
/// that a mark could be there is no spike and is told.
#[test]
fn edges_that_no_rotor_can_give_are_rejected() {
    let run = |behind: u64| {
        let mut bank = CaptureBank::new(&Config::thesis_570kv());
        let period = 60 * MS / 4; // 4000 rev/min, one mark
        for n in 1..40u64 {
            let at = n * period;
            let edges = [at as u32, (at + behind) as u32];
            bank.take(Ticks(at + MS), &[&[], if n % 3 == 0 { &edges } else { &edges[..1] }, &[], &[]], &[false; 4]);
        }
        let code = bank.sample(Ticks(39 * period + MS))[1];
        (code, bank.channels()[1].rejected(), Config::thesis_570kv().calibration().speed(1, &code))
    };
    let (code, rejected, rpm) = run(MS / 10);
    assert_eq!((code.verdict, rejected, rpm), (CaptureVerdict::Nominal, 13, Some(4000.0)));
    let (code, rejected, _) = run(MS);
    assert_eq!((code.verdict, rejected), (CaptureVerdict::Doubled, 0));
}

#[test]
fn the_first_capture_is_dropped() {
    let config = Config::thesis_570kv();
    let mut bank = CaptureBank::new(&config);
    // The timer's own match at 0, then one revolution of 60 ms on the opto channel.
    bank.take(Ticks(MS), &[&[], &[0], &[], &[]], &[false; 4]);
    bank.take(Ticks(55 * MS), &[&[], &[55 * MS as u32], &[], &[]], &[false; 4]);
    assert_eq!(bank.sample(Ticks(55 * MS))[1].verdict, CaptureVerdict::Stopped, "one edge is no speed");
    bank.take(Ticks(115 * MS), &[&[], &[115 * MS as u32], &[], &[]], &[false; 4]);
    let code = bank.sample(Ticks(115 * MS))[1];
    assert_eq!((code.edges, code.span), (1, 60 * MS as u32));
}

/// Specification: a lost channel within three expected periods plus 20 ms.
#[test]
fn a_dead_channel_is_lost_and_the_others_are_not() {
    for (channel, marks) in [(0, 2), (1, 1), (2, 2), (3, 25)] {
        let mut rotor = Rotor::new(0);
        rotor.revolution = 84_000_000 * 60 / 3000; // 20 ms
        rotor.run(400);
        rotor.alive[channel] = false;
        rotor.run((3 * 20u64).div_ceil(marks) + 20 + 21 / marks); // within a period of the last edge, and three more
        let codes = rotor.sample();
        for (c, code) in codes.iter().enumerate() {
            let expected = if c == channel { CaptureVerdict::Lost } else { CaptureVerdict::Nominal };
            assert_eq!(code.verdict, expected, "channel {c} when {channel} died");
        }
        rotor.run(2000);
        let codes = rotor.sample();
        assert_eq!(codes[channel].verdict, CaptureVerdict::Lost, "it stays lost while the rotor turns");
        assert_eq!(rotor.rpm(channel, &codes[channel]), None, "and claims no speed of zero");
        rotor.alive[channel] = true;
        rotor.run(500);
        let codes = rotor.sample();
        assert_eq!(rotor.rpm(channel, &codes[channel]), Some(3000.0), "the gap is not counted as a slow revolution");
    }
}

/// Specification: zero after max(0.25 s, 3 expected periods).
#[test]
fn a_standing_rotor_is_zero_after_the_time_out() {
    let mut rotor = Rotor::new(0);
    rotor.revolution = 84_000_000 * 60 / 3000;
    rotor.run(400);
    rotor.revolution = 0;
    rotor.run(200);
    assert!(rotor.sample().iter().all(|c| c.verdict == CaptureVerdict::Lost), "not known to stand yet");
    rotor.run(75);
    let codes = rotor.sample();
    for (c, code) in codes.iter().enumerate() {
        assert_eq!(code.verdict, CaptureVerdict::Stopped, "channel {c}");
        assert_eq!(rotor.rpm(c, code), Some(0.0));
    }
    assert!(!rotor.bank.is_turning());
}

#[test]
fn a_disagreeing_channel_is_flagged_in_the_second_sample() {
    let mut rotor = Rotor::new(0);
    rotor.revolution = 84_000_000 * 60 / 3000;
    rotor.skew[2] = 980; // hall reads 2 % fast
    for _ in 0..2 {
        rotor.run(400);
        assert!(rotor.sample().iter().all(|c| c.verdict == CaptureVerdict::Nominal), "once may be chance");
    }
    rotor.run(100);
    let codes = rotor.sample();
    assert_eq!(codes.map(|c| c.verdict == CaptureVerdict::Disagrees), [false, false, true, false]);
    assert!(rotor.rpm(2, &codes[2]).is_some_and(|rpm| rpm > 3050.0), "its number is still told");
    assert_eq!(rotor.bank.flagged(), 1);
    rotor.skew[2] = 1000;
    rotor.run(200);
    rotor.sample();
    rotor.run(100);
    assert_eq!(rotor.sample()[2].verdict, CaptureVerdict::Nominal);
}

/// A rotor that coasts down is no disagreement, although each channel's revolution ends at another time.
#[test]
fn coasting_down_is_no_disagreement() {
    for log_ms in [10, 100, 300] {
        let mut rotor = Rotor::new(0);
        rotor.revolution = 84_000_000 * 60 / 6000;
        rotor.run(400);
        rotor.sample();
        for ms in 1..=900 {
            rotor.revolution += rotor.revolution / 400; // time constant 0.4 s
            rotor.run(1);
            if ms % log_ms == 0 {
                let codes = rotor.sample();
                assert!(codes.iter().all(|c| c.verdict == CaptureVerdict::Nominal), "{ms} ms: {codes:?}");
            }
        }
        rotor.revolution = 0;
        rotor.run(60);
        rotor.sample();
        assert!(rotor.bank.flagged() > 0, "the encoder falls silent first");
        rotor.run(400);
        assert_eq!(rotor.bank.flagged(), 0, "all lost is a rotor that stops");
    }
}

#[test]
fn half_a_percent_is_no_disagreement() {
    let mut rotor = Rotor::new(0);
    rotor.revolution = 84_000_000 * 60 / 3000;
    rotor.skew[0] = 995;
    for _ in 0..5 {
        rotor.run(300);
        assert!(rotor.sample().iter().all(|c| c.verdict == CaptureVerdict::Nominal));
    }
}

#[test]
fn an_over_capture_is_told_and_never_bridged() {
    let config = Config::thesis_570kv();
    let mut bank = CaptureBank::new(&config);
    let period = 84_000_000 * 60 / 3000; // opto: one mark
    let edge = |bank: &mut CaptureBank, i: u64, over| {
        let at = i * period;
        bank.take(Ticks(at), &[&[], &[at as u32], &[], &[]], &[false, over, false, false]);
        Ticks(at)
    };
    for i in 1..20 {
        edge(&mut bank, i, false);
    }
    // Two revolutions passed, one capture was overwritten.
    let at = edge(&mut bank, 21, true);
    assert_eq!(bank.sample(at)[1].verdict, CaptureVerdict::OverCapture);
    assert_eq!(config.calibration().speed(1, &bank.sample(at)[1]), None);
    for i in 22..26 {
        edge(&mut bank, i, false);
    }
    let at = edge(&mut bank, 26, false);
    let first = bank.sample(at)[1];
    assert_eq!(first.verdict, CaptureVerdict::OverCapture, "the interval that had it says so");
    let code = bank.sample(at)[1];
    assert_eq!((code.verdict, code.span), (CaptureVerdict::Nominal, 3 * period as u32));

    edge(&mut bank, 27, true);
    let later = Ticks(27 * period + 11_000 * MS);
    bank.take(later, &[&[]; 4], &[false; 4]);
    assert_eq!(bank.sample(later)[1].verdict, CaptureVerdict::OverCapture, "told");
    assert_eq!(bank.sample(later)[1].verdict, CaptureVerdict::Stopped, "and over when the rotor stands");
}

/// Below 300 rev/min a one-mark channel reads zero between its marks: channels are then not judged against each other, while
/// a channel that dies at speed is.
#[test]
fn slow_rotors_raise_no_disagreement() {
    let mut rotor = Rotor::new(0);
    rotor.revolution = 84_000_000 * 60 / 1000;
    rotor.run(600);
    rotor.sample();
    while rotor.revolution < 84_000_000 * 60 / 120 {
        rotor.revolution += rotor.revolution / 800; // down to half a second a revolution, twice the time-out
        rotor.run(1);
    }
    for k in 0..30 {
        rotor.run(100);
        rotor.sample();
        assert_eq!(rotor.bank.flagged(), 0, "{k}");
    }
    rotor.revolution = 84_000_000 * 60 / 1000;
    rotor.run(1000);
    rotor.alive = [true, false, false, true];
    rotor.run(400);
    rotor.sample();
    assert_eq!(rotor.bank.flagged(), 2);
}
