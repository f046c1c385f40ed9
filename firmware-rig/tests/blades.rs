//! Marks that stand unevenly, blades that twist, and what the bank makes of a channel that is bad now and then.

use firmware_rig::Config;
use firmware_rig::bank::CaptureBank;
use firmware_rig::capture::CaptureChannel;
use firmware_rig::config::CaptureTimes;
use frame::rig::{CaptureCode, CaptureVerdict, UNEVEN_PARTS};
use frame::units::Ticks;

const MS: u64 = 84_000;
const TURNS_A_MINUTE: u64 = 60 * 84_000_000;

/// A beam that two blades cross, and nothing else: its periods are given one by one.
struct Beam {
    bank: CaptureBank,
    now: u64,
}

impl Beam {
    fn new() -> Self {
        let config = Config { marks: [2, 0, 0, 0], ..Config::thesis_570kv() };
        let mut beam = Self { bank: CaptureBank::new(&config), now: 0 };
        beam.edge(MS); // the first capture is dropped
        beam.edge(60 * MS);
        beam
    }

    fn edge(&mut self, period: u64) {
        self.now += period;
        self.bank.take(Ticks(self.now), &[&[self.now as u32], &[], &[], &[]], &[false; 4]);
    }

    /// Turns at `rpm` with blades whose periods differ by `parts` of their mean, and gives a sample.
    fn turns(&mut self, rpm: u64, parts: u64, revolutions: u64) -> CaptureCode {
        let revolution = TURNS_A_MINUTE / rpm;
        let longer = revolution / 2 + revolution * parts / u64::from(UNEVEN_PARTS) / 4;
        for _ in 0..revolutions {
            self.edge(longer);
            self.edge(revolution - longer);
        }
        self.sample()
    }

    fn sample(&mut self) -> CaptureCode {
        self.bank.sample(Ticks(self.now))[0]
    }
}

#[test]
fn how_unevenly_two_blades_stand_is_told() {
    for parts in [1, 37, 150, 600] {
        let mut beam = Beam::new();
        let told = beam.turns(3000, parts, 20);
        assert_eq!((told.verdict, u64::from(told.uneven)), (CaptureVerdict::Nominal, parts));
    }
    let mut beam = Beam::new();
    assert_eq!(beam.turns(3000, 0, 20).uneven, 1, "even blades: known, and next to nothing");
    let far = beam.turns(3000, 2000, 20);
    assert_eq!((far.verdict, far.uneven), (CaptureVerdict::Alternating, 2000));
}

/// Half a part and more counts as a whole one.
#[test]
fn unevenness_is_rounded_to_the_nearest_part() {
    let told = |longer: u64| {
        let mut beam = Beam::new();
        for _ in 0..20 {
            beam.edge(1_000_000 + longer);
            beam.edge(1_000_000 - longer);
        }
        beam.sample().uneven
    };
    assert_eq!([told(2000), told(2020), told(2030), told(2080)], [40, 40, 41, 42]);
}

/// A slow reading is one revolution long. One odd revolution among four still shows, and five back it is forgotten.
#[test]
fn unevenness_is_that_of_four_revolutions_at_the_least() {
    let after = |even: usize| {
        let mut beam = Beam::new();
        let half = 30 * MS; // 1000 rev/min
        (0..8).for_each(|_| beam.edge(half));
        beam.edge(half * 9 / 10);
        beam.edge(half * 11 / 10);
        (0..2 * even).for_each(|_| beam.edge(half));
        let told = beam.sample();
        assert_eq!((told.verdict, told.edges), (CaptureVerdict::Nominal, 2));
        told.uneven
    };
    assert!(after(3) > 100, "{} parts", after(3));
    assert_eq!(after(5), 1);
}

#[test]
fn nothing_is_told_of_marks_that_were_missed() {
    let mut beam = Beam::new();
    (0..20).for_each(|_| beam.edge(10 * MS));
    beam.edge(20 * MS);
    (0..3).for_each(|_| beam.edge(10 * MS));
    let told = beam.sample();
    assert_eq!((told.verdict, told.uneven), (CaptureVerdict::Missed, 0));
}

/// Blades that were never opposite look the same at any speed. What comes with the speed is twist.
#[test]
fn a_blade_twists_where_the_pattern_changes_with_the_speed() {
    let mut beam = Beam::new();
    for _ in 0..30 {
        assert_eq!(beam.turns(2000, 300, 10).verdict, CaptureVerdict::Nominal, "glued unevenly");
    }
    assert_eq!(beam.turns(6000, 300, 20).verdict, CaptureVerdict::Nominal, "and no worse at speed");
    assert_eq!(beam.turns(6000, 480, 20).verdict, CaptureVerdict::Nominal, "within the tolerance");
    let twisted = beam.turns(6000, 520, 20);
    assert_eq!((twisted.verdict, twisted.uneven), (CaptureVerdict::BladeTwist, 520));
    assert_eq!(beam.turns(2000, 300, 10).verdict, CaptureVerdict::Nominal, "straight again when slow");
}

/// The first reading is rough: what is learnt goes to what the later ones say.
#[test]
fn straight_blades_are_learnt_from_many_readings() {
    for first in [0, 600] {
        let mut beam = Beam::new();
        beam.turns(2000, first, 10);
        (0..30).for_each(|_| _ = beam.turns(2000, 300, 10));
        assert_eq!(beam.turns(6000, 490, 20).verdict, CaptureVerdict::Nominal, "after {first} parts");
        assert_eq!(beam.turns(6000, 510, 20).verdict, CaptureVerdict::BladeTwist, "after {first} parts");
    }
}

/// A reading that tells nothing of the blades teaches nothing of them.
#[test]
fn missed_marks_teach_nothing_of_the_blades() {
    let mut beam = Beam::new();
    (0..30).for_each(|_| _ = beam.turns(2000, 300, 10));
    for _ in 0..30 {
        (0..8).for_each(|_| beam.edge(15 * MS));
        beam.edge(30 * MS);
        beam.edge(15 * MS);
        assert_eq!(beam.sample().verdict, CaptureVerdict::Missed);
    }
    assert_eq!(beam.turns(6000, 400, 20).verdict, CaptureVerdict::Nominal, "the learnt ones hold");
}

/// Blades that were never seen slow count as straight. At 4000 rev/min and more they are judged, and 2 % is no twist yet.
#[test]
fn where_twist_begins() {
    for (rpm, parts, expected) in [
        (6000, 200, CaptureVerdict::Nominal),
        (6000, 204, CaptureVerdict::BladeTwist),
        (4000, 300, CaptureVerdict::BladeTwist),
        (3990, 300, CaptureVerdict::Nominal),
    ] {
        let told = Beam::new().turns(rpm, parts, 20);
        assert_eq!((told.verdict, u64::from(told.uneven)), (expected, parts), "{rpm} rev/min");
    }
}

/// Four sensors on one rotor, each with a period of its own, edges told as they come.
struct Four {
    bank: CaptureBank,
    marks: [u64; 4],
    now: u64,
    /// Ticks a revolution by each of them.
    revolutions: [u64; 4],
    next: [u64; 4],
}

impl Four {
    fn new(revolutions: [u64; 4]) -> Self {
        let config = Config::thesis_570kv();
        Self { bank: CaptureBank::new(&config), marks: config.marks.map(u64::from), now: 0, revolutions, next: [MS; 4] }
    }

    fn at(rpm: u64) -> Self {
        Self::new([TURNS_A_MINUTE / rpm; 4])
    }

    /// Runs on until `until`, with one more edge of the hall sensor at `spike`.
    fn run_to(&mut self, until: u64, spike: Option<u64>) {
        while self.now < until {
            self.now = (self.now + MS).min(until);
            let mut edges: [Vec<u32>; 4] = Default::default();
            for (c, list) in edges.iter_mut().enumerate() {
                while self.next[c] <= self.now {
                    list.push(self.next[c] as u32);
                    self.next[c] += self.revolutions[c] / self.marks[c];
                }
            }
            if let Some(at) = spike.filter(|at| (self.now - MS..self.now).contains(at)) {
                edges[2].push(at as u32);
                edges[2].sort_unstable();
            }
            self.bank.take(Ticks(self.now), &edges.each_ref().map(Vec::as_slice), &[false; 4]);
        }
    }

    fn sample(&mut self) -> [CaptureVerdict; 4] {
        self.bank.sample(Ticks(self.now)).map(|code| code.verdict)
    }
}

/// A channel that failed once counts as bad for 0.3 s, in each tick, and is then trusted again.
#[test]
fn a_bad_channel_is_trusted_again_after_a_while() {
    let mut four = Four::at(3000);
    four.run_to(500 * MS, None);
    four.sample();
    assert_eq!(four.bank.flagged(), 0);
    four.run_to(1000 * MS, Some(963 * MS + MS / 2));
    assert_eq!(four.sample()[2], CaptureVerdict::Doubled);
    for ms in [1001, 1100, 1200, 1299] {
        assert_eq!(four.bank.flagged(), 1, "before {ms} ms");
        four.run_to(ms * MS, None);
        assert_eq!(four.bank.flagged(), 1, "{ms} ms");
        if ms > 1001 {
            assert_eq!(four.sample(), [CaptureVerdict::Nominal; 4], "{ms} ms");
        }
    }
    four.run_to(1300 * MS, None);
    four.sample();
    assert_eq!(four.bank.flagged(), 0);
}

/// Below 300 rev/min nobody is judged by the others, from there on everybody is.
#[test]
fn channels_are_judged_from_300_rev_min_on() {
    let flagged = |revolution: u64| {
        let mut four = Four::new([revolution, revolution, revolution * 49 / 50, revolution]);
        for second in 1..8 {
            four.run_to(second * 1000 * MS, None);
            four.sample();
        }
        assert_eq!(four.sample()[2], CaptureVerdict::Disagrees, "it is told at any speed");
        four.bank.flagged()
    };
    let slowest = TURNS_A_MINUTE / 300;
    assert_eq!([flagged(slowest - 50), flagged(slowest), flagged(slowest + 50), flagged(2 * slowest)], [1, 1, 0, 0]);
}

/// Two of four are enough for a limit, one alone is not: the second-fastest counts, whichever they are.
#[test]
fn a_limit_is_judged_by_the_second_fastest() {
    let revolution = TURNS_A_MINUTE / 4000;
    let parts = [100, 98, 96, 94];
    for order in [[0, 1, 2, 3], [3, 2, 1, 0], [1, 3, 0, 2], [2, 0, 3, 1], [3, 0, 1, 2], [0, 3, 2, 1]] {
        let mut four = Four::new(order.map(|place: usize| revolution * parts[place] / 100 / 50 * 50));
        four.run_to(500 * MS, None);
        let told = four.bank.judged_speed(Ticks(four.now)).map(|v| v.0);
        assert!(told.is_some_and(|rpm| (rpm - 4000.0 / 0.96).abs() < 1.0), "{order:?}: {told:?}");
    }
}

/// The encoder falls silent, and so do the others between their few marks: it is lost all the same.
#[test]
fn a_dead_encoder_is_lost_on_a_slow_rotor_too() {
    let mut four = Four::at(400); // 150 ms a revolution
    four.run_to(3001 * MS, None);
    four.next[3] = u64::MAX;
    let mark = 3001 * MS;
    assert_eq!(four.next[1], mark + 150 * MS, "all marks were there just now");
    four.run_to(mark + 30 * MS, None);
    assert_eq!(four.bank.lost(Ticks(four.now)), 0, "three periods and the margin are not over");
    four.run_to(mark + 60 * MS, None);
    assert_eq!(four.bank.lost(Ticks(four.now)), 1);
}

/// Silent for three expected periods and 20 ms, and a tick longer.
#[test]
fn a_channel_is_lost_a_tick_behind_its_time() {
    for (channel, periods_ms) in [(1, 60), (0, 30)] {
        let mut four = Four::at(3000);
        four.run_to(401 * MS, None);
        four.next[channel] = u64::MAX; // its last mark was at 401 ms
        let end = (401 + periods_ms + 20) * MS;
        four.run_to(end, None);
        assert_eq!([four.bank.lost(Ticks(end - MS)), four.bank.lost(Ticks(end)), four.bank.lost(Ticks(end + 1))], [0, 0, 1]);
    }
}

/// A channel with `marks` marks that has taken `edges`, at `now`.
fn channel(marks: u16, edges: &[u64], now: u64) -> CaptureChannel {
    let mut channel = CaptureChannel::new(marks, 84_000_000, Config::thesis_570kv().capture);
    let edges: Vec<u32> = [0].iter().chain(edges).map(|at| *at as u32).collect(); // the first is dropped
    channel.take(Ticks(now), &edges, false);
    channel
}

/// A silence that a turning rotor explains is a slow revolution. A tick more begins anew: what was missed is no slow speed.
#[test]
fn a_gap_is_bridged_as_far_as_a_rotor_explains_it() {
    let revolution = 60 * MS;
    let last = 6 * revolution;
    let edges: Vec<u64> = (1..=6).map(|n| n * revolution).collect();
    let patience = 3 * revolution + 20 * MS;
    let after = |gap: u64| {
        let mut channel = channel(1, &edges, last);
        channel.take(Ticks(last + gap), &[(last + gap) as u32], false);
        channel.revolution()
    };
    assert_eq!([after(revolution), after(patience), after(patience + 1)], [Some(revolution), Some(patience), None]);
}

/// The rotor stands after 0.25 s without an edge, to the tick.
#[test]
fn a_rotor_stands_a_tick_behind_the_time_out() {
    let edges: Vec<u64> = (1..=6).map(|n| n * 60 * MS).collect();
    let known = |silent: u64| {
        let mut channel = channel(1, &edges, 360 * MS);
        channel.take(Ticks(360 * MS + silent), &[], false);
        channel.speed().is_some()
    };
    assert!(known(250 * MS) && !known(250 * MS + 1));
}

/// An edge may be captured while the time is read, and is then a little later than it. Up to half a turn of the counter it is old.
#[test]
fn an_edge_behind_the_time_is_one_of_now() {
    let edges = [60 * MS, 120 * MS, 180 * MS];
    let turns = |now: u64| channel(1, &edges, now).is_turning(Ticks(now));
    assert!(turns(180 * MS - 5), "captured while the time was read");
    assert!(turns(180 * MS) && turns(181 * MS));
    let half = u64::from(u32::MAX / 2);
    assert!(!turns(180 * MS + half), "the oldest there is");
}

/// Two edges a whole turn of the counter apart look as one. No speed is told of them, rather than one without end.
#[test]
fn edges_a_whole_turn_of_the_counter_apart_are_no_speed() {
    let half = 1 << 31;
    let edges = [MS, MS + half, MS + 2 * half];
    let now = MS + 2 * half;
    assert_eq!(channel(2, &edges, now).latest_speed(Ticks(now)).map(|v| v.0), None);
    let times = CaptureTimes { span: Ticks(0), ..Config::thesis_570kv().capture };
    let mut channel = CaptureChannel::new(2, 84_000_000, times);
    channel.take(Ticks(now), &[0, edges[0] as u32, edges[1] as u32, edges[2] as u32], false);
    assert_eq!((channel.revolution(), channel.speed().map(|v| v.0)), (Some(0), None));
}

/// What a limit is judged by is known for a revolution: silence longer than that says that the rotor is slower.
#[test]
fn the_latest_speed_is_that_of_one_revolution_and_no_older() {
    let edges = [10 * MS, 30 * MS, 45 * MS];
    let channel = channel(1, &edges, 45 * MS);
    let told = |at: u64| channel.latest_speed(Ticks(at)).map(|v| v.0);
    assert_eq!([told(45 * MS), told(60 * MS), told(60 * MS + 1)], [Some(4000.0), Some(4000.0), None]);
}

/// A rotor that is turned by hand, more than the counter's turn a revolution: no speed at all, not one that is too high.
#[test]
fn an_encoder_that_is_turned_by_hand_tells_no_speed() {
    let mut channel = CaptureChannel::new(25, 84_000_000, Config::thesis_570kv().capture);
    for ms in (0..70_000).step_by(10) {
        let at = ms * MS;
        let edges: &[u32] = if ms % 2500 == 0 { &[at as u32] } else { &[] };
        channel.take(Ticks(at), edges, false);
        assert_eq!(channel.speed().map(|v| v.0), None, "{ms} ms");
    }
}

/// The shortest time between two marks is a sixteenth of a period at 20 000 rev/min, and it counts.
#[test]
fn what_is_too_close_to_be_a_mark() {
    for (marks, floor) in [(1, 15_750), (2, 7_875)] {
        let rejected = |gap: u64| channel(marks, &[MS, MS + gap], 2 * MS).rejected();
        assert_eq!([rejected(floor - 1), rejected(floor)], [1, 0], "{marks} marks");
    }
}

/// What stays within 1 % agrees. A place is sought where the difference is 1 % to the last bit.
#[test]
fn one_per_cent_to_the_last_bit_is_agreement() {
    let speed = |revolution: u64| TURNS_A_MINUTE as f32 / revolution as f32;
    let edge = (20_000..40_000u64).map(|n| n * 50).find_map(|middle| {
        let off = speed(middle) - 0.01 * speed(middle);
        let near = (TURNS_A_MINUTE as f32 / off) as u64 / 2 * 2;
        let other = [near - 2, near, near + 2].into_iter().find(|r| (speed(*r) - speed(middle)).abs() == 0.01 * speed(middle))?;
        Some((middle, other))
    });
    let (middle, other) = edge.expect("one of twenty thousand");
    let verdict = |hall: u64| {
        let mut four = Four::new([middle, middle, hall, middle]);
        for n in 1..6 {
            four.run_to(n * 300 * MS, None);
            four.sample();
        }
        four.sample()[2]
    };
    assert_eq!([verdict(other), verdict(other + 100)], [CaptureVerdict::Nominal, CaptureVerdict::Disagrees]);
}
