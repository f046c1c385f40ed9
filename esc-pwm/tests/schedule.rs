//! Schedules: the thesis figures, impossible ones refused, and never a pulse out of range.

use esc_pwm::PulseWidth;
use esc_pwm::Refusals;
use esc_pwm::{Chirp, Schedule, Slew, Staircase, ThrottleCurve};
use proptest::prelude::*;

fn us(us: u32) -> PulseWidth {
    PulseWidth::from_us(us)
}

/// Beharie 2013, section 3.2.6 with the errata: 21 levels are 630 s.
#[test]
fn the_thesis_staircase() {
    let schedule = Schedule::Staircase(Staircase::THESIS);
    assert_eq!(Staircase::THESIS.levels(), 21);
    assert_eq!(schedule.pulse_at(0), Some(us(1000)));
    assert_eq!(schedule.pulse_at(29_999), Some(us(1000)));
    assert_eq!(schedule.pulse_at(30_000), Some(us(1050)));
    assert_eq!(schedule.pulse_at(629_999), Some(us(2000)));
    assert_eq!(schedule.pulse_at(630_000), None);
    assert!(schedule.check().is_empty());
}

#[test]
fn up_and_down_and_again() {
    let stairs = Staircase { step: us(250), hold_ms: 10, top: us(1500), down: true, visits: 2 };
    let schedule = Schedule::Staircase(stairs);
    let walked: Vec<u32> = (0..).map_while(|i| schedule.pulse_at(i * 10)).map(|p| p.0 / 1000).collect();
    assert_eq!(walked, [1000, 1250, 1500, 1250, 1000, 1000, 1250, 1500, 1250, 1000]);
}

#[test]
fn impossible_schedules_are_refused() {
    let stairs = |step, hold_ms, top| Schedule::Staircase(Staircase { step, hold_ms, top, down: false, visits: 1 });
    for bad in [
        stairs(us(0), 10, us(1500)),
        stairs(us(50), 0, us(1500)),
        stairs(us(50), 10, us(2001)),
        Schedule::Manual(us(900)),
        Schedule::Ramp { from: us(1000), to: us(1500), length_ms: 0 },
        Schedule::Chirp(Chirp {
            centre: us(1900),
            amplitude: us(200),
            from_millihertz: 100,
            to_millihertz: 1000,
            length_ms: 1000,
        }),
    ] {
        assert_eq!(bad.check(), Refusals(Refusals::OUT_OF_RANGE), "{bad:?}");
    }
}

/// Each number of each schedule at the ends of what is possible, and one beyond.
#[test]
fn each_bound_of_each_schedule() {
    let stairs = |step, top| Schedule::Staircase(Staircase { step: us(step), hold_ms: 1, top: us(top), down: false, visits: 1 });
    let ramp = |from, to| Schedule::Ramp { from: us(from), to: us(to), length_ms: 1 };
    let step = |before, after, hold_ms| Schedule::Step { before: us(before), after: us(after), hold_ms };
    let chirp = |centre, amplitude, from_millihertz, to_millihertz, length_ms| {
        let (centre, amplitude) = (us(centre), us(amplitude));
        Schedule::Chirp(Chirp { centre, amplitude, from_millihertz, to_millihertz, length_ms })
    };
    let fastest = esc_pwm::segment::FASTEST_MILLIHERTZ;
    for (possible, schedule) in [
        (true, Schedule::Manual(us(1000))),
        (true, Schedule::Manual(us(2000))),
        (false, Schedule::Manual(us(2001))),
        (true, stairs(1000, 2000)),
        (false, stairs(1001, 2000)),
        (false, stairs(50, 1049)),
        (false, stairs(50, 1000)),
        (true, ramp(1000, 2000)),
        (false, ramp(999, 2000)),
        (false, ramp(1000, 2001)),
        (true, step(1000, 2000, 1)),
        (false, step(999, 2000, 1)),
        (false, step(1000, 2001, 1)),
        (false, step(1000, 2000, 0)),
        (true, chirp(1500, 500, fastest, 0, 1)),
        (true, chirp(1500, 500, 0, fastest, 1)),
        (false, chirp(1500, 501, 0, fastest, 1)),
        (false, chirp(1400, 401, 0, 0, 1)),
        (false, chirp(1600, 401, 0, 0, 1)),
        (false, chirp(999, 0, 0, 0, 1)),
        (false, chirp(1500, 10, fastest + 1, 0, 1)),
        (false, chirp(1500, 10, 0, fastest + 1, 1)),
        (false, chirp(1500, 10, 10, 10, 0)),
    ] {
        assert_eq!(schedule.check().is_empty(), possible, "{schedule:?}");
    }
}

/// A step that does not divide the way ends below the top; down again every level but the highest comes twice.
#[test]
fn a_staircase_counts_its_levels() {
    let stairs = |step, top, down| Staircase { step: us(step), hold_ms: 10, top: us(top), down, visits: 0 };
    assert_eq!((stairs(300, 2000, false).increments(), stairs(300, 2000, false).levels()), (3, 4));
    assert_eq!(stairs(300, 2000, true).levels(), 7);
    assert_eq!(stairs(0, 2000, false).increments(), 0);
    let walked = |stairs: Staircase| (0..).map_while(|i| Schedule::Staircase(stairs).pulse_at(i * 10)).count();
    assert_eq!((walked(stairs(300, 2000, false)), walked(stairs(300, 2000, true))), (4, 7), "no visit is one");
    let levels = [0, 10, 20, 30, 40, 50, 60].map(|ms| Schedule::Staircase(stairs(300, 2000, true)).pulse_at(ms));
    assert_eq!(levels, [1000, 1300, 1600, 1900, 1600, 1300, 1000].map(|level| Some(us(level))));
}

#[test]
fn a_ramp_and_a_step_are_what_they_say() {
    let at = |schedule: Schedule, times: [u64; 4]| times.map(|ms| schedule.pulse_at(ms).map(|pulse| pulse.0 / 1000));
    let ramp = |from, to| Schedule::Ramp { from: us(from), to: us(to), length_ms: 400 };
    assert_eq!(at(ramp(1100, 1500), [0, 100, 399, 400]), [Some(1100), Some(1200), Some(1499), None]);
    assert_eq!(at(ramp(1500, 1100), [0, 100, 399, 400]), [Some(1500), Some(1400), Some(1101), None]);
    let step = Schedule::Step { before: us(1200), after: us(1600), hold_ms: 50 };
    assert_eq!(at(step, [0, 49, 50, 100]), [Some(1200), Some(1200), Some(1600), None]);
    assert_eq!(step.pulse_at(99), Some(us(1600)));
}

/// The pulse is the nearest nanosecond of the sine, on both sides of its middle.
#[test]
fn a_chirp_is_rounded_to_the_nearest() {
    let amplitude = PulseWidth(1000);
    let chirp = Chirp { centre: us(1500), amplitude, from_millihertz: 1000, to_millihertz: 1000, length_ms: 1000 };
    for ms in 0..1000 {
        let exact = 1000.0 * (std::f64::consts::TAU * ms as f64 / 1000.0).sin();
        let given = f64::from(Schedule::Chirp(chirp).pulse_at(ms).unwrap().0) - 1_500_000.0;
        assert!((given - exact).abs() < 0.51, "{ms} ms: {given} for {exact}");
    }
}

/// Half a turn apart the pulse is as far above the middle as below it, to the nanosecond.
#[test]
fn a_chirp_is_the_same_above_and_below_its_middle() {
    let chirp =
        Chirp { centre: us(1500), amplitude: PulseWidth(123_456), from_millihertz: 1000, to_millihertz: 1000, length_ms: 1000 };
    let off = |ms| i64::from(Schedule::Chirp(chirp).pulse_at(ms).unwrap().0) - 1_500_000;
    for ms in 1..500 {
        assert_eq!(off(ms), -off(ms + 500), "{ms} ms");
        assert!(off(ms) > 0);
    }
}

/// The throttle moves by what it may and no more, up and down; minimum is never waited for.
#[test]
fn the_slew_limit_is_used_in_full() {
    let slew = Slew { ns_per_ms: 1000 };
    assert_eq!(slew.toward(us(1500), us(1600), 5), us(1505));
    assert_eq!(slew.toward(us(1500), us(1400), 5), us(1495));
    assert_eq!(slew.toward(us(1500), us(1503), 5), us(1503));
    assert_eq!(slew.toward(us(1500), us(1497), 5), us(1497));
    for minimum in [PulseWidth::MIN, PulseWidth(0)] {
        assert_eq!(slew.toward(us(2000), minimum, 1), PulseWidth::MIN);
    }
    assert_eq!(Slew::NONE.toward(us(1000), us(2000), 1), us(2000));
}

#[test]
fn a_chirp_of_constant_frequency_is_a_sine() {
    let chirp = Chirp { centre: us(1500), amplitude: us(100), from_millihertz: 2000, to_millihertz: 2000, length_ms: 10_000 };
    let schedule = Schedule::Chirp(chirp);
    for k in 0..20 {
        let at = |ms: u64| i64::from(schedule.pulse_at(k * 500 + ms).unwrap().0);
        assert!((at(0) - 1_500_000).abs() <= 20, "zero crossing");
        assert!((at(125) - 1_600_000).abs() <= 20, "crest");
        assert!((at(375) - 1_400_000).abs() <= 20, "trough");
    }
    assert_eq!(schedule.pulse_at(10_000), None);
}

#[test]
fn five_point_curve() {
    let curve = ThrottleCurve::Points([us(1000), us(1100), us(1300), us(1600), us(2000)]);
    assert_eq!(curve.apply(us(1000)), us(1000));
    assert_eq!(curve.apply(us(1125)), us(1050));
    assert_eq!(curve.apply(us(1500)), us(1300));
    assert_eq!(curve.apply(us(2000)), us(2000));
    assert_eq!(ThrottleCurve::Points([us(1500); 5]).apply(PulseWidth::MIN), PulseWidth::MIN);
    assert_eq!(ThrottleCurve::Linear.apply(us(1777)), us(1777));
}

fn any_schedule() -> impl Strategy<Value = Schedule> {
    let pulse = || (1_000_000u32..=2_000_000).prop_map(PulseWidth);
    prop_oneof![
        pulse().prop_map(Schedule::Manual),
        (1u32..300_000, 1u32..100, pulse(), any::<bool>(), 0u16..4).prop_map(|(step, hold_ms, top, down, visits)| {
            Schedule::Staircase(Staircase { step: PulseWidth(step), hold_ms, top, down, visits })
        }),
        (pulse(), pulse(), 1u32..5000).prop_map(|(from, to, length_ms)| Schedule::Ramp { from, to, length_ms }),
        (pulse(), pulse(), 1u32..5000).prop_map(|(before, after, hold_ms)| Schedule::Step { before, after, hold_ms }),
        (1_400_000u32..1_600_000, 0u32..400_000, 0u32..50_000, 0u32..50_000, 1u32..100_000).prop_map(|(c, a, f, t, l)| {
            let (centre, amplitude) = (PulseWidth(c), PulseWidth(a));
            Schedule::Chirp(Chirp { centre, amplitude, from_millihertz: f, to_millihertz: t, length_ms: l })
        }),
    ]
}

proptest! {
    /// No schedule that passed its check ever leaves 1000 to 2000 us.
    #[test]
    fn within_range(schedule in any_schedule(), ms in 0u64..200_000) {
        if schedule.check().is_empty() && let Some(pulse) = schedule.pulse_at(ms) {
            prop_assert_eq!(pulse, pulse.clamped());
        }
    }

    #[test]
    fn slew_is_kept_except_to_minimum(now in 1_000_000u32..=2_000_000, to in 1_000_000u32..=2_000_000, rate in 0u32..5000, ms in 0u32..20) {
        let next = Slew { ns_per_ms: rate }.toward(PulseWidth(now), PulseWidth(to), ms);
        if to == 1_000_000 {
            prop_assert_eq!(next, PulseWidth::MIN);
        } else {
            prop_assert!(next.0.abs_diff(now) <= rate * ms);
            prop_assert!(next.0.abs_diff(to) <= now.abs_diff(to), "never away from the target");
        }
    }
}
