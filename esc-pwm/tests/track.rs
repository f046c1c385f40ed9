//! A host's schedule as the board plays it: exact, ahead of time, and never beyond what was agreed.

use esc_pwm::PulseWidth;
use esc_pwm::Refusals;
use esc_pwm::segment::{FASTEST_MILLIHERTZ, Segment, Shape, Steer};
use esc_pwm::track::{AHEAD_MS, Played, TRACK, Track};
use proptest::prelude::*;

fn us(us: u32) -> PulseWidth {
    PulseWidth::from_us(us)
}

fn segment(pulse: u32, length_ms: u32, shape: Shape) -> Segment {
    Segment { pulse: us(pulse), length_ms, shape }
}

fn hold(pulse: u32, length_ms: u32) -> Segment {
    segment(pulse, length_ms, Shape::Hold)
}

/// Segments that a host sends at once.
const BATCH: usize = 8;

/// Sends the whole list by batches.
fn loaded(list: &[Segment]) -> Track {
    let mut track = Track::new();
    for (n, part) in list.chunks(BATCH).enumerate() {
        track.take((n * BATCH) as u32, part, (n + 1) * BATCH >= list.len()).unwrap();
    }
    track
}

#[test]
fn it_plays_what_was_sent() {
    let line = |from: Option<u32>| Shape::Line { from: from.map(us) };
    let mut track = loaded(&[
        segment(1400, 100, line(None)),
        hold(1200, 50),
        segment(1300, 100, line(None)),
        segment(1500, 100, line(Some(1100))),
        segment(1500, 1000, Shape::Chirp { amplitude: us(100), from_millihertz: 1000, to_millihertz: 1000 }),
    ]);
    assert!(track.check().is_empty());
    track.start();
    for (ms, pulse) in
        [(0, 1000), (50, 1200), (100, 1200), (150, 1200), (200, 1250), (250, 1100), (300, 1300), (350, 1500), (600, 1600)]
    {
        assert_eq!(track.at(ms), Played::Pulse(us(pulse)), "{ms} ms");
    }
    assert_eq!(track.playing(), Some((4, 350)));
    assert_eq!(track.at(1_350), Played::Over);
    track.start();
    assert_eq!(track.at(150), Played::Pulse(us(1200)), "what fits can be played again");
}

#[test]
fn gaps_impossible_segments_and_too_much_are_refused() {
    let refused = Err(Refusals(Refusals::OUT_OF_RANGE));
    let mut track = Track::new();
    assert_eq!(track.check(), Refusals(Refusals::EMPTY_SCHEDULE));
    assert_eq!(track.take(1, &[hold(1500, 1)], true), refused, "a gap");
    assert_eq!(track.take(u32::MAX, &[hold(1500, 1), hold(1500, 1)], true), refused, "numbers that do not exist");
    for bad in [
        hold(999, 10),
        hold(1500, 0),
        segment(1500, 10, Shape::Line { from: Some(us(2001)) }),
        segment(1900, 10, Shape::Chirp { amplitude: us(200), from_millihertz: 0, to_millihertz: 10 }),
        segment(1500, 10, Shape::Chirp { amplitude: us(100), from_millihertz: 0, to_millihertz: u32::MAX }),
        segment(1500, 10, Shape::Steered { low: us(1100), high: us(1400) }),
        segment(1500, 10, Shape::Steered { low: us(1100), high: us(2100) }),
    ] {
        assert_eq!(track.take(0, &[bad], true), refused, "{bad:?}");
    }
    let mut full = loaded(&[hold(1100, 10); TRACK]);
    assert_eq!((full.room(), full.next()), (0, TRACK as u32));
    assert_eq!(full.take(TRACK as u32, &[hold(1100, 10)], true), refused, "full");
    full.take(0, &[hold(1300, 1)], true).unwrap();
    assert_eq!(full.next(), 1, "number 0 begins anew");
}

/// Every pulse that a segment gives may lie at an end of the range, none beyond; its frequency at the fastest.
#[test]
fn a_segment_may_reach_its_bounds() {
    let chirp =
        |amplitude, from_millihertz, to_millihertz| Shape::Chirp { amplitude: us(amplitude), from_millihertz, to_millihertz };
    let line = |from| Shape::Line { from: Some(us(from)) };
    let steered = |low, high| Shape::Steered { low: us(low), high: us(high) };
    let fastest = FASTEST_MILLIHERTZ;
    for (possible, pulse, shape) in [
        (true, 1000, Shape::Hold),
        (true, 2000, Shape::Hold),
        (false, 2001, Shape::Hold),
        (false, 999, Shape::Line { from: None }),
        (true, 1500, line(1000)),
        (false, 1500, line(999)),
        (false, 2001, line(1500)),
        (true, 1500, chirp(500, fastest, fastest)),
        (false, 1600, chirp(401, 0, 0)),
        (false, 1400, chirp(401, 0, 0)),
        (false, 1500, chirp(10, fastest + 1, 0)),
        (false, 1500, chirp(10, 0, fastest + 1)),
        (true, 1000, steered(1000, 2000)),
        (true, 2000, steered(1000, 2000)),
        (false, 1500, steered(999, 2000)),
        (false, 1500, steered(1000, 2001)),
        (false, 1199, steered(1200, 1400)),
        (false, 1401, steered(1200, 1400)),
    ] {
        assert_eq!(segment(pulse, 1, shape).is_possible(), possible, "{pulse} us, {shape:?}");
        assert!(!segment(pulse, 0, shape).is_possible(), "it takes no time");
    }
}

/// Whoever plans a run sees its highest pulse before anything turns.
#[test]
fn a_segment_tells_its_highest_pulse() {
    let chirp = Shape::Chirp { amplitude: us(100), from_millihertz: 10, to_millihertz: 20 };
    for (shape, highest) in [
        (Shape::Hold, 1400),
        (Shape::Line { from: None }, 1400),
        (Shape::Line { from: Some(us(1200)) }, 1400),
        (Shape::Line { from: Some(us(1600)) }, 1600),
        (chirp, 1500),
        (Shape::Steered { low: us(1200), high: us(1700) }, 1700),
    ] {
        assert_eq!(segment(1400, 10, shape).highest(), us(highest), "{shape:?}");
    }
}

/// Step by step: each step is the last until the next one comes, in order and once; number 0 begins anew.
#[test]
fn a_schedule_grows_step_by_step() {
    let refused = Err(Refusals(Refusals::OUT_OF_RANGE));
    let mut track = Track::new();
    assert_eq!(track.append_last(1, hold(1200, 10)), refused, "a gap");
    assert_eq!(track.append_last(0, hold(2100, 10)), refused, "impossible");
    track.append_last(0, hold(1100, 10)).unwrap();
    track.append_last(1, hold(1200, 10)).unwrap();
    assert_eq!(track.append_last(1, hold(1300, 10)), refused, "it is there");
    assert_eq!(track.append_last(3, hold(1300, 10)), refused, "a gap");
    track.append_last(2, hold(1300, 10)).unwrap();
    assert!(track.check().is_empty());
    track.start();
    assert_eq!(
        [5, 15, 25, 30].map(|ms| track.at(ms)),
        [Played::Pulse(us(1100)), Played::Pulse(us(1200)), Played::Pulse(us(1300)), Played::Over]
    );
    assert_eq!(track.append_last(3, hold(1400, 10)), refused, "it is being played, and was whole");
    track.stop();
    track.append_last(0, hold(1500, 10)).unwrap();
    assert_eq!(track.next(), 1, "a new one");
}

/// A track that was stopped gives no pulse, and can be begun again or replaced.
#[test]
fn a_stopped_track_gives_nothing() {
    let mut track = loaded(&[hold(1100, 600)]);
    track.start();
    assert_eq!(track.at(10), Played::Pulse(us(1100)));
    track.stop();
    assert_eq!((track.playing(), track.at(20)), (None, Played::Over));
    track.start();
    assert_eq!((track.playing(), track.at(20)), (Some((0, 0)), Played::Pulse(us(1100))));
}

/// What is agreed to be there ahead is enough; a millisecond less is not, unless it is all.
#[test]
fn a_stream_may_begin_with_what_was_agreed() {
    let begun = |length_ms, last| {
        let mut track = Track::new();
        track.take(0, &[hold(1200, length_ms)], last).unwrap();
        track.check()
    };
    assert_eq!(begun(AHEAD_MS as u32, false), Refusals::default());
    assert_eq!(begun(AHEAD_MS as u32 - 1, false), Refusals(Refusals::SHORT_STREAM));
    assert_eq!(begun(1, true), Refusals::default());
}

#[test]
fn what_is_there_already_is_not_taken_twice() {
    let mut track = loaded(&[hold(1100, 600), hold(1200, 10)]);
    track.start();
    track.take(0, &[hold(1900, 600), hold(1900, 10)], true).unwrap();
    assert_eq!((track.at(0), track.next()), (Played::Pulse(us(1100)), 2), "a frame that was sent again while it is played");
    assert!(track.take(2, &[hold(1300, 10)], true).is_err(), "the schedule has ended already");
}

#[test]
fn a_longer_schedule_is_streamed_and_runs_dry_when_it_is_not() {
    let pulse = |n: u32| 1100 + n % 500;
    let mut track = Track::new();
    let mut sent = 0u32;
    let mut send = |track: &mut Track, end: u32| {
        while track.room() >= BATCH as u16 && sent < end {
            let part: Vec<Segment> = (sent..(sent + BATCH as u32).min(end)).map(|n| hold(pulse(n), 10)).collect();
            track.take(sent, &part, false).unwrap();
            sent += part.len() as u32;
        }
    };
    send(&mut track, AHEAD_MS as u32 / 10 - 2);
    assert_eq!(track.check(), Refusals(Refusals::SHORT_STREAM), "too little to begin with");
    send(&mut track, 1000);
    assert!(track.check().is_empty());
    track.start();
    for ms in 0..10_000 {
        assert_eq!(track.at(ms), Played::Pulse(us(pulse(ms as u32 / 10))), "{ms} ms");
        send(&mut track, 1000);
    }
    assert_eq!(track.at(10_000), Played::Dry, "the end was never sent");
    track.stop();
    assert_eq!(track.check(), Refusals(Refusals::EMPTY_SCHEDULE), "its beginning is gone");
}

#[test]
fn the_host_steers_within_the_bounds_of_the_schedule_and_nowhere_else() {
    let bounds = Shape::Steered { low: us(1200), high: us(1400) };
    let mut track = loaded(&[segment(1300, 1000, bounds), segment(1500, 100, Shape::Line { from: None }), hold(1500, 100)]);
    let elsewhere = Err(Refusals(Refusals::WRONG_STATE));
    assert_eq!(track.steer(0, Steer::GoOn, 0), elsewhere, "not started");
    track.start();
    assert_eq!(track.at(5), Played::Pulse(us(1300)));
    assert_eq!(track.steer(1, Steer::GoOn, 5), elsewhere);
    assert_eq!(track.steer(0, Steer::Pulse(us(1401)), 5), Err(Refusals(Refusals::OUT_OF_RANGE)));
    track.steer(0, Steer::Pulse(us(1400)), 5).unwrap();
    assert_eq!(track.at(500), Played::Pulse(us(1400)));
    track.steer(0, Steer::GoOn, 500).unwrap();
    assert_eq!(track.at(550), Played::Pulse(us(1450)), "on from where the host had moved it");
    assert_eq!(track.playing(), Some((1, 500)));
    assert_eq!(track.at(600), Played::Pulse(us(1500)));
    assert_eq!(track.steer(2, Steer::GoOn, 600), elsewhere, "a segment that is not steered");
    assert_eq!(track.at(700), Played::Over);
}

fn any_segment() -> impl Strategy<Value = Segment> {
    let pulse = || (990_000u32..2_010_000).prop_map(PulseWidth);
    let shape = prop_oneof![
        Just(Shape::Hold),
        proptest::option::of(pulse()).prop_map(|from| Shape::Line { from }),
        (0u32..500_000, 0u32..150_000, 0u32..150_000).prop_map(|(a, from_millihertz, to_millihertz)| Shape::Chirp {
            amplitude: PulseWidth(a),
            from_millihertz,
            to_millihertz
        }),
        (pulse(), pulse()).prop_map(|(low, high)| Shape::Steered { low, high }),
    ];
    (pulse(), 0u32..300, shape).prop_map(|(pulse, length_ms, shape)| Segment { pulse, length_ms, shape })
}

proptest! {
    /// Whatever is sent and asked: the pulse stays within 1000 to 2000 us, and within the bounds of a steered segment.
    #[test]
    fn no_pulse_leaves_its_range(
        batches in proptest::collection::vec((0u32..40, proptest::collection::vec(any_segment(), 1..8), any::<bool>()), 1..20),
        asks in proptest::collection::vec((0u64..400, 0u32..20, proptest::option::of(900_000u32..2_100_000)), 1..60),
    ) {
        let mut track = Track::new();
        for (first, list, last) in batches {
            let _ = track.take(first, &list, last);
        }
        track.start();
        let mut ms = 0;
        for (wait, number, pulse) in asks {
            ms += wait;
            if let Played::Pulse(pulse) = track.at(ms) {
                prop_assert_eq!(pulse, pulse.clamped());
            }
            let _ = track.steer(number, pulse.map_or(Steer::GoOn, |ns| Steer::Pulse(PulseWidth(ns))), ms);
        }
    }

    /// The pulse of a time does not depend on how often was asked before.
    #[test]
    fn late_ticks_change_nothing(list in proptest::collection::vec((1_000_000u32..=2_000_000, 1u32..50, any::<bool>()), 1..100), at in 0u64..2000) {
        let list: Vec<Segment> = list.into_iter().map(|(ns, length_ms, line)| {
            let shape = if line { Shape::Line { from: None } } else { Shape::Hold };
            Segment { pulse: PulseWidth(ns), length_ms, shape }
        }).collect();
        let (mut often, mut once) = (loaded(&list), loaded(&list));
        often.start();
        once.start();
        (0..at).for_each(|ms| { often.at(ms); });
        prop_assert_eq!(often.at(at), once.at(at));
    }
}
