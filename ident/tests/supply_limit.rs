//! A table of levels whose supply comes to its current limit.
//!
//! What it is: eleven levels, a row each, of a rig on a laboratory supply: below the limit a lead costs voltage, at the limit the voltage gives way.
//! What can go wrong: a case that is named and should not be, or the other way round, fails with the verdict in its message.
//! Units: SI, rev/min, us.
//! Reference: constant-current mode of laboratory supplies.

use ident::close::{Closed, close};
use ident::log::{Column, Log};
use ident::report::{Origin, closed_loop};
use ident::verdict::Kind;

/// The table with a supply that gives so much, A.
fn table(limit: f64) -> Log {
    let pulse: Vec<f64> = (0..11).map(|k| 1050.0 + 95.0 * f64::from(k)).collect();
    let top = 20_000.0;
    // by how much less than its command the rotor turns: what the limit leaves
    let wanted: Vec<f64> = pulse.iter().map(|p| top * ((p - 950.0) / 1050.0).powf(0.8)).collect();
    let draw = |rpm: f64| 0.3 + 16.0 * (rpm / top).powi(3);
    let share = |rpm: f64| (limit / draw(rpm)).min(1.0);
    let rpm: Vec<f64> = wanted.iter().map(|w| w * share(*w).powf(0.6)).collect();
    let current: Vec<f64> = wanted.iter().map(|w| draw(*w).min(limit)).collect();
    let voltage: Vec<f64> = wanted.iter().zip(&current).map(|(w, a)| (11.2 - 0.03 * a) * share(*w)).collect();
    let thrust = rpm.iter().map(|r| 1.5e-8 * r * r).collect();
    let columns = [("pulse_us", pulse), ("rpm", rpm), ("thrust_n", thrust), ("current_a", current), ("voltage_v", voltage)];
    let columns = columns.into_iter().map(|(name, values)| Column { name: name.into(), values }).collect();
    Log { name: "table.csv".into(), t: (0..11).map(|k| 1.8 * f64::from(k)).collect(), columns, ..Log::default() }
}

fn limits(closed: &Closed) -> Vec<(f64, [f64; 2])> {
    let named = closed.verdict.effects.iter().filter(|e| e.id == "current_limit");
    named.map(|e| (e.parameters[0].value, e.parameters[0].ci95)).collect()
}

#[test]
fn a_limit_that_both_meters_show_is_named_on_eleven_rows() {
    let closed = close(&table(11.0), None, &[], &mut |_| {}).expect("a log");
    assert_eq!(closed.verdict.verdict, Kind::Attributed, "{:?}", closed.verdict.effects);
    let [(limit, [low, high])] = limits(&closed)[..] else { panic!("{:?}", closed.verdict.effects) };
    assert!((limit - 11.0).abs() < 0.01 && low < 11.0 && 11.0 < high, "{limit}, {low} to {high}");
    // it changes no prediction, and nothing beside it is told to have no name
    assert!(closed.model.effects.iter().all(|e| e.placed.effect.id() != "current_limit"));
    assert!(closed.verdict.effects.iter().all(|e| !e.is_without_correction()), "{:?}", closed.verdict.effects);
    assert_eq!(closed.verdict.guessed_floors, Some(11));
    // the levels at the limit say nothing of the lead, nor of the speed that the motor is driven to; thrust at a speed is what it is
    let rows = |name: &str| closed.context.targets[closed.context.target(name).expect(name)].rows.len();
    assert!(
        rows("rpm") < 10 && rows("rpm") == rows("voltage_v") && rows("thrust_n") == 11,
        "{} {}",
        rows("rpm"),
        rows("thrust_n")
    );
    let said = &closed.verdict.effects.iter().find(|e| e.id == "current_limit").expect("a limit").evidence;
    assert!(said.contains("left out") && said.contains("speed by up to") && said.contains("voltage by up to"), "{said}");
    let lead = closed.verdict.effects.iter().find(|e| e.id == "supply_sag").expect("30 mohm");
    assert!((lead.parameters[0].value - 0.03).abs() < 0.001, "{:?}", lead.parameters);
    assert!(closed.verdict.channels["rpm"].after.heldout_rms < 100.0, "{:?}", closed.verdict.channels["rpm"]);
}

/// Its card shows what both meters read, at the limit too.
#[test]
fn a_limit_has_its_figure() {
    let log = table(11.0);
    let closed = close(&log, None, &[], &mut |_| {}).expect("a log");
    let page = closed_loop(&log, &closed, Origin::default());
    let card = page.split("id=\"effect-current-limit\"").nth(1).and_then(|rest| rest.split("</article>").next()).expect("a card");
    let dots = card.split("class=\"a dots few\"").nth(1).and_then(|rest| rest.split('/').next()).expect("readings");
    assert_eq!(dots.matches('M').count(), 11, "{dots}");
    assert!(card.contains("Current as measured, against the command") && card.contains("Voltage as measured"), "{card}");
}

#[test]
fn a_supply_below_its_limit_has_none() {
    let closed = close(&table(40.0), None, &[], &mut |_| {}).expect("a log");
    assert!(limits(&closed).is_empty(), "{:?}", closed.verdict.effects);
}
