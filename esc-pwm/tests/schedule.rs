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
