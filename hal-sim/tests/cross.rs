//! The ESC's telemetry and the back-EMF meter in native runs: they agree with what is really there, and what happens to their lines stops nothing.

use esc_pwm::EscOutput;
use firmware_rig::{Config, EscTelemetry};
use frame::Converted;
use frame::esc::EscVerdict;
use frame::message::Message;
use frame::rig::{CaptureVerdict, FaultSet, RigSample};
use frame::units::Ticks;
use frame::wire::Decoder;
use hal_sim::native::{Board, RigDesk};
use hal_sim::scenario::{EscSection, FaultKind, Schedule, ScheduledFault, SensorSection};
use hal_sim::{RunRecord, Scenario, Truth, run};

fn scenario(faults: &[(f64, f64, FaultKind)]) -> Scenario {
    let sensors = SensorSection { esc_telemetry: true, back_emf: true, ..SensorSection::default() };
    Scenario {
        schedule: Schedule::Staircase { step_us: 250.0, hold_s: 2.0, top_us: 2000.0 },
        rest_s: 1.0,
        sensors,
        faults: faults
            .iter()
            .map(|(from_s, until_s, kind)| ScheduledFault { from_s: *from_s, until_s: *until_s, kind: *kind })
            .collect(),
        ..Scenario::default()
    }
}

fn flown(faults: &[(f64, f64, FaultKind)]) -> RunRecord {
    run(&scenario(faults), None, &mut |_| ()).unwrap_or_else(|e| panic!("{e}"))
}

/// The rows of a run in a window of its time.
fn rows(record: &RunRecord, from_s: f64, until_s: f64) -> Vec<(RigSample, Converted, Truth)> {
    let all = record.samples.iter().zip(record.converted()).zip(&record.truth);
    all.filter(|((_, row), _)| (from_s..until_s).contains(&row.t_s)).map(|((s, row), t)| (*s, row, *t)).collect()
}

#[test]
fn both_agree_with_the_plant_on_every_plateau() {
    let record = flown(&[]);
    let mut turning = 0;
    for plateau in 0..5 {
        let end = 1.0 + 2.0 * f64::from(plateau + 1);
        for (sample, row, truth) in rows(&record, end - 0.8, end) {
            let plant = truth.plant;
            let [rpm, current, voltage, temperature, _] = row.esc.map(|v| v.unwrap_or_else(|| panic!("{:?}", sample.esc)));
            assert!((rpm - plant.rpm).abs() < 12.0 + 0.005 * plant.rpm, "{rpm} of {}", plant.rpm);
            // what an ESC's own sensors are off by: 3 % and 0.25 A, 0.5 % of the voltage
            assert!(
                (current - 0.25 - 1.03 * plant.current_a).abs() < 0.06 + 0.02 * plant.current_a,
                "{current} of {}",
                plant.current_a
            );
            assert!((voltage - 0.995 * plant.voltage_v).abs() < 0.02, "{voltage} of {}", plant.voltage_v);
            assert!((10.0..60.0).contains(&temperature), "{temperature}");
            let meter = sample.back_emf.expect("fitted");
            if plant.rpm > 1000.0 {
                turning += 1;
                let speed = row.rpm_bemf.unwrap_or_else(|| panic!("{meter:?}"));
                assert!((speed / plant.rpm - 1.0).abs() < 2e-3, "{speed} of {}", plant.rpm);
                assert_eq!(meter.verdict, CaptureVerdict::Nominal);
            } else {
                assert_eq!((meter.verdict, row.rpm_bemf), (CaptureVerdict::Stopped, Some(0.0)));
            }
        }
    }
    assert!(turning > 25, "{turning} rows");
    let drawn = |row: &Converted| row.esc[4].unwrap_or(0.0);
    let all: Vec<Converted> = record.converted().collect();
    let charge_as: f64 = record.truth.iter().map(|t| 0.1 * t.plant.current_a).sum();
    let told = drawn(all.last().expect("rows"));
    assert!(told > 5.0 && (told - charge_as / 3.6).abs() < 3.0, "{told} mAh of {}", charge_as / 3.6);
}

/// What happens to the lines, one after the other in one run: told where it happens, gone behind it, and the run goes on to its end.
#[test]
fn nothing_that_happens_to_their_lines_stops_a_run() {
    let faults = [
        (3.0, 4.0, FaultKind::EscTelemetryCut),
        (5.0, 6.0, FaultKind::EscTelemetryNoisy { probability: 1.0 }),
        (7.0, 8.0, FaultKind::EscTelemetryBaud { baud: 57_600 }),
        (9.0, 10.0, FaultKind::BackEmfCut),
    ];
    let record = flown(&faults);
    assert!(record.samples.iter().all(|s| s.faults == FaultSet::NONE), "no fault is latched");
    let end = record.converted().last().expect("rows").t_s;
    assert!(end > scenario(&faults).run_s() - 0.2, "the run goes on to {end} s");
    let told = |from: f64, until: f64| -> Vec<EscVerdict> {
        rows(&record, from, until).iter().map(|(s, ..)| s.esc.expect("fitted").verdict).collect()
    };
    let all = |verdicts: Vec<EscVerdict>, wanted| assert!(verdicts.iter().all(|v| *v == wanted), "{wanted:?}: {verdicts:?}");
    all(told(3.35, 4.0), EscVerdict::Silent);
    all(told(5.35, 6.0), EscVerdict::Garbled);
    all(told(7.35, 8.0), EscVerdict::Garbled);
    for sound in [(2.0, 3.0), (4.15, 5.0), (6.15, 7.0), (8.15, 11.0)] {
        all(told(sound.0, sound.1), EscVerdict::Nominal);
    }
    let silent = rows(&record, 9.2, 10.0);
    assert!(
        silent.iter().all(|(s, row, _)| s.back_emf.is_some_and(|c| c.verdict == CaptureVerdict::Lost) && row.rpm_bemf.is_none())
    );
    // a voltage that is told is one of a frame that was good
    for (sample, row, truth) in rows(&record, 1.0, 11.0) {
        let voltage = row.esc[2];
        assert!(voltage.is_none_or(|v| (v - 0.995 * truth.plant.voltage_v).abs() < 0.6), "{voltage:?} in {:?}", sample.esc);
    }
}

/// An ESC that sends only when it is asked: by the telemetry bit of a DShot frame it is, by pulses nobody asks.
#[test]
fn an_esc_that_has_to_be_asked_is_asked_by_frames() {
    let esc = EscSection { telemetry_asked: true, ..EscSection::default() };
    let scenario = Scenario { esc, ..Scenario::default() };
    for (output, answers) in [(EscOutput::DShot600, true), (EscOutput::Pwm, false)] {
        let esc_telemetry = Some(EscTelemetry { pole_pairs: 11, asked: true });
        let config = Config { output, esc_telemetry, log_period: Ticks::from_ms(20), ..Config::thesis_570kv() };
        let mut desk = RigDesk::new(&scenario, None, Board::new(config));
        desk.power(true);
        let (mut decoder, mut samples, mut asked) = (Decoder::default(), Vec::new(), 0);
        for _ in 0..2_000 {
            desk.turn();
            asked += usize::from(desk.board().frame().is_some_and(|frame| frame.telemetry));
            for byte in desk.tick(&[]) {
                if let Some(Message::Rig(sample)) = decoder.push::<Message>(byte).map(|r| r.message) {
                    samples.push(sample);
                }
            }
        }
        assert_eq!(asked, if answers { 100 } else { 0 }, "a frame in twenty");
        let last: Vec<_> = samples.iter().rev().take(20).map(|s| s.esc.expect("fitted")).collect();
        let wanted = if answers { EscVerdict::Nominal } else { EscVerdict::Silent };
        assert!(last.iter().all(|code| code.verdict == wanted && (code.age_ms <= 25) == answers), "{output:?}: {last:?}");
    }
}

#[test]
fn what_nobody_listens_to_changes_nothing() {
    let bare = Scenario { sensors: SensorSection::default(), ..scenario(&[]) };
    let (without, with) = (run(&bare, None, &mut |_| ()).expect("it runs"), flown(&[]));
    assert!(without.samples.iter().all(|s| s.esc.is_none() && s.back_emf.is_none()));
    for (a, b) in without.samples.iter().zip(&with.samples) {
        assert_eq!((a.rpm, a.adc, a.pulse), (b.rpm, b.adc, b.pulse), "{:?}", a.at);
    }
}
