//! Faults that a scenario schedules, and what the board and the host make of them.

use frame::Event;
use frame::rig::{Fault, RigState};
use hal_sim::{RunRecord, Scenario, run};
use std::path::Path;

/// A short staircase with faults.
fn fly(faults: &str) -> RunRecord {
    let text = format!("schedule = {{ kind = \"staircase\", step_us = 300, hold_s = 5, top_us = 1600 }}\n{faults}");
    let scenario = Scenario::parse(&text, Path::new("fault.toml")).unwrap_or_else(|e| panic!("{e}"));
    run(&scenario, None, &mut |_| ()).unwrap_or_else(|e| panic!("{e}"))
}

fn latched(record: &RunRecord) -> Option<(Fault, f64)> {
    let start = record.start.as_s();
    record.events.iter().find_map(|e| match e {
        Event::Faults { faults, at } => {
            let known = [Fault::LinkLost, Fault::LoadCellOverload, Fault::UnderVoltage, Fault::OverCurrent, Fault::AdcLost];
            known.into_iter().find(|f| faults.contains(*f)).map(|f| (f, at.as_s() - start))
        }
        _ => None,
    })
}

#[test]
fn a_healthy_run_latches_nothing() {
    assert_eq!(latched(&fly("")), None);
}

#[test]
fn a_lost_link_stops_the_rotor_within_its_time_out() {
    let record = fly("[[fault]]\nid = \"link_lost\"\nfrom_s = 9\nuntil_s = 14\n");
    let (fault, at) = latched(&record).expect("a fault");
    // the host pings five times a second and the board waits for one
    assert!(fault == Fault::LinkLost && (9.8..10.1).contains(&at), "{fault:?} at {at}");
    let last = record.truth.last().expect("a run");
    assert!(last.plant.rpm == 0.0 && last.pulse_us == 1000.0, "{last:?}");
    assert!(record.truth.iter().any(|t| t.plant.rpm > 1000.0));
    assert!((record.samples.len() as f64 - 190.0).abs() < 4.0, "recorded to the end: {}", record.samples.len());
}

#[test]
fn telemetry_is_dropped_and_corrupted_and_counted() {
    let record = fly("[[fault]]\nid = \"telemetry_dropped\"\nprobability = 0.5\nfrom_s = 5\nuntil_s = 10\n");
    assert!((15..35).contains(&record.link.missing), "{:?}", record.link);
    let record = fly("[[fault]]\nid = \"telemetry_corrupted\"\nprobability = 0.005\nfrom_s = 5\nuntil_s = 10\n");
    assert!(record.link.damaged > 5, "{:?}", record.link);
    assert!(record.samples.windows(2).all(|w| w[0].at < w[1].at), "nothing damaged gets through");
    assert_eq!(latched(&record), None);
}

#[test]
fn after_a_brown_out_the_board_is_disarmed() {
    let record = fly("[[fault]]\nid = \"brown_out\"\nfrom_s = 9\nuntil_s = 9.5\n");
    let after = |s: &&frame::rig::RigSample| s.at.as_s() - record.start.as_s() > 9.7;
    assert!(record.samples.iter().filter(after).count() > 50);
    assert!(record.samples.iter().filter(after).all(|s| s.state == RigState::Disarmed && s.pulse.as_us() == 1000.0));
    assert_eq!(record.truth.last().expect("a run").plant.rpm, 0.0);
}

#[test]
fn a_pin_at_its_rail_is_an_overload_or_a_lost_converter() {
    for (channel, high) in [(0, true), (0, false), (2, true), (3, false)] {
        let record =
            fly(&format!("[[fault]]\nid = \"adc_stuck\"\nchannel = {channel}\nhigh = {high}\nfrom_s = 9\nuntil_s = 12\n"));
        let events = record.events.iter().filter(|e| matches!(e, Event::Faults { .. })).count();
        assert!(events > 0, "channel {channel} {high}: {:?}", record.events);
        assert_eq!(record.truth.last().expect("a run").plant.rpm, 0.0, "channel {channel}");
    }
}
