use super::*;
use frame::units::PulseWidth;

/// Runs for `ms` with a pulse every 20 ms (none where `pulse_ns` is 0) and gives the beeps.
fn run(esc: &mut EscDialogue, from_ms: u64, ms: u64, pulse_ns: u32) -> Vec<Beep> {
    let mut out = Vec::new();
    for t in from_ms..from_ms + ms {
        if t % 20 == 0 && pulse_ns > 0 {
            esc.pulse(t * MS, pulse_ns);
        }
        esc.advance_to(t * MS);
        out.extend(esc.beep().map(|b| b.1));
    }
    out
}

#[test]
fn a_normal_start_gives_its_three_patterns_and_then_follows_the_pulse() {
    let mut esc = EscDialogue::new(Esc::default(), 3);
    run(&mut esc, 0, 100, 1_000_000);
    esc.set_power(true);
    assert_eq!(run(&mut esc, 100, 5000, 1_000_000), [Beep::Long, Beep::Cells(3), Beep::Ready]);
    assert_eq!(esc.output_us(), 1000.0);
    run(&mut esc, 5100, 40, 1_500_000);
    assert_eq!(esc.output_us(), 1500.0);
    run(&mut esc, 5140, 900, 0);
    assert_eq!(esc.output_us(), 1500.0, "speed holds for a second");
    run(&mut esc, 6040, 200, 0);
    assert_eq!(esc.output_us(), 1200.0, "then 20 %");
    run(&mut esc, 6240, 40, 1_000_000);
    assert_eq!(esc.output_us(), 1000.0, "and recovers");
}

#[test]
fn without_signal_or_at_half_throttle_it_never_runs() {
    for pulse in [0, 1_500_000] {
        let mut esc = EscDialogue::new(Esc::default(), 3);
        esc.set_power(true);
        let beeps = run(&mut esc, 0, 5000, pulse);
        assert!(beeps.len() >= 4 && beeps.iter().all(|b| *b == Beep::NoSignal), "{beeps:?}");
        assert_eq!(esc.output_us(), 1000.0);
    }
}

#[test]
fn range_calibration_stores_and_programming_mode_traps() {
    let mut esc = EscDialogue::new(Esc::default(), 3);
    run(&mut esc, 0, 100, 1_950_000);
    esc.set_power(true);
    assert_eq!(run(&mut esc, 100, 2000, 1_950_000), [Beep::Double]);
    assert_eq!(run(&mut esc, 2100, 4000, 1_050_000), [Beep::Long, Beep::Cells(3), Beep::Ready]);
    assert_eq!(esc.range_ns(), (1_050_000, 1_950_000));
    run(&mut esc, 6100, 40, 1_500_000);
    assert_eq!(esc.output_us(), 1500.0);

    let mut esc = EscDialogue::new(Esc::default(), 3);
    run(&mut esc, 0, 100, 2_000_000);
    esc.set_power(true);
    assert_eq!(run(&mut esc, 100, 9000, 2_000_000), [Beep::Double, Beep::Programming]);
    assert!(run(&mut esc, 9100, 5000, 1_000_000).is_empty());
    assert_eq!(esc.output_us(), 1000.0);
}

#[test]
fn a_failed_self_test_never_runs() {
    let mut esc = EscDialogue::new(Esc { self_test_fails: true, ..Esc::default() }, 3);
    run(&mut esc, 0, 100, 1_000_000);
    esc.set_power(true);
    let beeps = run(&mut esc, 100, 6000, 1_000_000);
    assert!(!beeps.is_empty() && beeps.iter().all(|b| *b == Beep::SelfTestFailed));
    assert_eq!(esc.output_us(), 1000.0);
}

/// Up to "ready" with a pulse of minimum, on a supply that stands.
fn ready() -> EscDialogue {
    let mut esc = EscDialogue::new(Esc::default(), 3);
    run(&mut esc, 0, 100, 1_000_000);
    esc.set_power(true);
    run(&mut esc, 100, 5000, 1_000_000);
    assert_eq!(esc.state(), EscState::Running);
    esc
}

#[test]
fn low_voltage_and_heat_limit_the_output() {
    let mut esc = ready();
    run(&mut esc, 5100, 40, 2_000_000);
    (0..3000).for_each(|_| esc.feel(8.0, 7.0, 1e-3));
    assert_eq!(esc.output_us(), 1500.0, "protection A leaves half");
    (0..100).for_each(|_| esc.feel(11.0, 7.0, 1e-3));
    assert_eq!(esc.output_us(), 1500.0, "until the throttle is closed");
    run(&mut esc, 5140, 40, 1_000_000);
    esc.feel(11.0, 0.1, 1e-3);
    run(&mut esc, 5180, 40, 2_000_000);
    assert_eq!(esc.output_us(), 2000.0);
    (0..300_000).for_each(|_| esc.feel(11.0, 30.0, 1e-3));
    assert!(esc.temperature_c() > 200.0);
    assert_eq!(esc.output_us(), 1350.0, "protection C leaves 35 %");
    (0..300_000).for_each(|_| esc.feel(11.0, 3.0, 1e-3));
    assert_eq!(esc.output_us(), 2000.0, "and gives it back");
}

#[test]
fn what_is_programmed_outlives_the_power() {
    let mut esc = EscDialogue::new(Esc::default(), 3);
    run(&mut esc, 0, 100, 2_000_000);
    esc.set_power(true);
    let beeps = run(&mut esc, 100, 9_000, 2_000_000);
    assert_eq!(beeps, [Beep::Double, Beep::Programming]);
    let mut at = 9_100;
    // hold maximum until the cut-off mode sounds, close for its second option, open to store
    while esc.programming().map(|p| p.0) != Some(super::super::esc_program::Item::CutOffMode) {
        run(&mut esc, at, 100, 2_000_000);
        at += 100;
    }
    run(&mut esc, at, 4_000, 1_000_000);
    run(&mut esc, at + 4_000, 500, 2_000_000);
    esc.set_power(false);
    assert_eq!(esc.settings().cutoff(), super::super::esc_guard::CutOff::CutOff);
    run(&mut esc, at + 4_500, 500, 1_000_000);
    esc.set_power(true);
    run(&mut esc, at + 5_000, 6_000, 1_000_000);
    run(&mut esc, at + 11_000, 40, 1_800_000);
    assert_eq!(esc.output_us(), 1800.0);
    (0..5000).for_each(|_| esc.feel(8.0, 1.0, 1e-3));
    assert_eq!(esc.output_us(), 1000.0, "it cuts off now");
}

/// Runs for `ms` with a frame of this throttle each millisecond and gives the beeps.
fn send(esc: &mut EscDialogue, from_ms: u64, ms: u64, throttle: Throttle) -> Vec<Beep> {
    let word = Frame { throttle, telemetry: false }.word();
    let mut out = Vec::new();
    for t in from_ms..from_ms + ms {
        esc.frame(t * MS, word);
        esc.advance_to(t * MS);
        out.extend(esc.beep().map(|b| b.1));
    }
    out
}

fn half() -> Throttle {
    Throttle::of(PulseWidth::from_us(1500))
}

/// Up to "ready" with frames of throttle 0.
fn ready_for_frames() -> EscDialogue {
    let mut esc = EscDialogue::new(Esc::default(), 3);
    send(&mut esc, 0, 100, Throttle::STOP);
    esc.set_power(true);
    assert_eq!(send(&mut esc, 100, 5000, Throttle::STOP), [Beep::Long, Beep::Cells(3), Beep::Ready]);
    esc
}

#[test]
fn frames_of_zero_make_it_ready_and_nothing_else_does() {
    let mut esc = ready_for_frames();
    assert_eq!(esc.output_us(), 1000.0);
    send(&mut esc, 5100, 5, half());
    assert!((esc.output_us() - 1500.0).abs() < 0.26, "one step of the throttle is 0.5 us: {}", esc.output_us());
    send(&mut esc, 5105, 5, Throttle::STOP);
    assert_eq!(esc.output_us(), 1000.0);
    for throttle in [Throttle::LOWEST, half(), Throttle::HIGHEST] {
        let mut esc = EscDialogue::new(Esc::default(), 3);
        esc.set_power(true);
        let beeps = send(&mut esc, 0, 9000, throttle);
        assert!(beeps.len() >= 4 && beeps.iter().all(|b| *b == Beep::NoSignal), "{throttle:?}: {beeps:?}");
        assert_eq!((esc.output_us(), esc.range_ns()), (1000.0, (1_000_000, 2_000_000)), "no range to be stored");
    }
}

#[test]
fn a_frame_that_does_not_check_is_none() {
    let mut esc = ready_for_frames();
    send(&mut esc, 5100, 5, half());
    let word = Frame { throttle: Throttle::HIGHEST, telemetry: false }.word();
    let running = esc.output_us();
    for t in 5105..5300 {
        esc.frame(t * MS, word ^ 1 << (t % 16));
        esc.advance_to(t * MS);
        assert_eq!(esc.output_us(), running, "the last good one holds, {t} ms");
    }
    (5300..5400).for_each(|t| {
        esc.frame(t * MS, word ^ 1);
        esc.advance_to(t * MS);
    });
    assert_eq!((esc.output_us(), esc.state()), (1000.0, EscState::NoSignal), "and does not count as signal");
}

#[test]
fn without_frames_the_motor_stops_and_zero_alone_makes_it_ready_again() {
    let mut esc = ready_for_frames();
    send(&mut esc, 5100, 5, half());
    (5105..5350).for_each(|t| esc.advance_to(t * MS));
    assert!(esc.output_us() > 1400.0, "a gap of a reset does not stop it");
    (5350..5360).for_each(|t| esc.advance_to(t * MS));
    assert_eq!(esc.output_us(), 1000.0);
    assert!(send(&mut esc, 5360, 2000, half()).iter().all(|b| *b == Beep::NoSignal));
    assert_eq!(esc.output_us(), 1000.0, "throttle is no way out");
    assert_eq!(send(&mut esc, 7360, 5000, Throttle::STOP).last(), Some(&Beep::Ready));
    send(&mut esc, 12_360, 5, half());
    assert!(esc.output_us() > 1400.0);
}

#[test]
fn the_form_that_it_heard_first_holds_until_its_power_is_cut() {
    let mut esc = ready_for_frames();
    run(&mut esc, 5100, 100, 1_800_000);
    assert_eq!(esc.output_us(), 1000.0, "pulses are nothing to it now");
    let mut esc = ready();
    send(&mut esc, 5100, 10, Throttle::HIGHEST);
    assert_eq!(esc.output_us(), 1000.0, "nor frames to one that heard pulses");
    esc.set_power(false);
    esc.set_power(true);
    send(&mut esc, 5110, 5000, Throttle::STOP);
    send(&mut esc, 10_110, 5, half());
    assert!(esc.output_us() > 1400.0);
}
