//! The loop on flights, through the command line.
//!
//! What it is: a flight of the independent generator with one hidden effect is closed, the effect comes out, its model predicts another flight; a
//! clean flight has nothing; the two recorded flights of one vehicle show the same effects, and a broken speed channel among them is refused.
//! What can go wrong: without the recorded data that part says so.
//! Units: those of the flight log.
//! Reference: specification `flight.md`, "The loop on flights".

use quadrig_tests::flights::scenario::{CLEAN, Scenario, hidden};
use quadrig_tests::{call, data, root};
use serde_json::Value;
use std::path::Path;

/// The first seed of the tuning half that hides one effect alone.
fn hides(id: &str) -> Scenario {
    Scenario::new((0..4000).step_by(2).find(|s| hidden(*s) == [id]).unwrap_or_else(|| panic!("{id}")))
}

fn closed(at: &Path, log: &str, more: &[&str]) -> Value {
    let words = [&["--quiet", "close-loop", log, "-o", "out", "--json"], more].concat();
    serde_json::from_str(&call(at, &words).succeeded().out).expect("JSON")
}

fn named(v: &Value) -> Vec<&str> {
    let all = v["effects"].as_array().expect("effects").iter().filter_map(|e| e["id"].as_str());
    all.filter(|id| *id != "unknown").collect()
}

/// Root mean square of what a prediction leaves of the channels that were written beside it.
fn left(at: &Path, predicted: &str, seen: &str, column: &str) -> f64 {
    let read = |name: &str| -> Vec<f64> {
        let text = std::fs::read_to_string(at.join(name)).expect("a file");
        let mut lines = text.lines().filter(|l| !l.starts_with('#'));
        let k = lines.next().expect("a header").split(',').position(|n| n == column).unwrap_or_else(|| panic!("{column}"));
        lines.map(|l| l.split(',').nth(k).and_then(|c| c.parse().ok()).unwrap_or(f64::NAN)).collect()
    };
    let squares: Vec<f64> =
        read(predicted).iter().zip(read(seen)).map(|(p, s)| (p - s).powi(2)).filter(|v| v.is_finite()).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// The figure of each card is of the channel of which its text tells the error; the rotors' speeds are in one figure; titles are words.
fn shows_what_its_text_tells(page: &str, v: &Value) {
    for (k, e) in v["effects"].as_array().expect("effects").iter().enumerate() {
        let of = e["channels"][0].as_str().expect("a channel").replace('_', "-");
        let figure = format!("<figure id=\"effect-{}-", k + 1);
        let drawn = page.split(&figure).nth(1).unwrap_or_else(|| panic!("effect {} has a figure", k + 1));
        assert!(drawn.split('"').next().is_some_and(|id| id.contains(&of)), "{of}: {}", &drawn[..40]);
        assert!(e["id"] == "unknown" || drawn.contains(">without it</text>"), "{of}");
    }
    assert!(page.contains("<figure id=\"rotors-measured\">") && page.contains("Speed left over, every rotor"));
    let titles = page.split("<figcaption>").skip(1).filter_map(|t| t.split("</figcaption>").next());
    let raw: Vec<&str> = titles.filter(|t| t.contains('_') || t.starts_with("Speed of rotor")).collect();
    assert!(raw.is_empty(), "{raw:?}");
}

#[test]
fn a_hidden_drag_is_named_and_its_model_predicts_another_flight() {
    let s = hides("rotor_drag");
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    for (k, name) in ["run.csv", "other.csv"].iter().enumerate() {
        std::fs::write(at.join(name), s.log(k)).expect("a file");
    }
    let v = closed(at, "run.csv", &["--validate", "other.csv"]);
    assert_eq!(
        (v["format"].as_str(), v["verdict"].as_str(), named(&v)),
        (Some("quadrig-verdict 2"), Some("attributed"), vec!["rotor_drag"])
    );
    let other = &v["validation"][0]["channels"]["acc_x"];
    let (before, after) = (other["before"].as_f64().expect("a number"), other["after"].as_f64().expect("a number"));
    assert!(after < 0.6 * before, "{before} {after}");
    // anyone can recompute the figures
    call(at, &["--quiet", "predict", "out/model.toml", "run.csv", "-o", "pred.csv"]).succeeded();
    for (column, seen) in
        [("acc_x", "out/channels.csv"), ("ang_acc_y", "out/channels.csv"), ("rpm_2", "run.csv"), ("voltage_v", "run.csv")]
    {
        let claimed = v["channels"][column]["after"]["rms"].as_f64().expect("a number");
        let again = left(at, "pred.csv", seen, column);
        assert!((again / claimed - 1.0).abs() < 0.02, "{column}: {claimed} {again}");
    }
    let page = std::fs::read_to_string(at.join("out/report.html")).expect("a page");
    assert!(page.contains("rotor_drag") && page.contains("What this flight can show"));
    shows_what_its_text_tells(&page, &v);
    // against its own model nothing is new; an input does not lie where the results go
    std::fs::rename(at.join("out/model.toml"), at.join("model.toml")).expect("moved");
    let again = closed(at, "run.csv", &["--model", "model.toml"]);
    assert!(named(&again).is_empty(), "{again}");
}

/// A flight of the simulator, with its ground run and its coasting down: the rotors' one lag comes out, no channel gets worse, nothing is added
/// beneath a noise floor, what is said to be left without a term is what a fit without it leaves, and a constant supply is no channel.
#[test]
fn a_simulated_flight_is_made_worse_nowhere() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let mission = root().join("examples/flight/square.toml");
    call(at, &["--quiet", "fly", mission.to_str().expect("a plain name"), "-o", "fly"]).succeeded();
    let v = closed(at, "fly/flight.csv", &[]);
    let number = |v: &Value| v.as_f64().expect("a number");
    for (name, c) in v["channels"].as_object().expect("channels").iter().filter(|(_, c)| c["not_predicted"].is_null()) {
        let [before, after] = ["before", "after"].map(|k| number(&c[k]["heldout_rms"]));
        assert!(after <= 1.02 * before, "{name}: {before} {after}");
        if name.starts_with("rpm_") {
            assert!(before < 100.0 && after < 10.0, "{name}: {before} {after}");
        }
    }
    assert!(
        v["channels"]["voltage_v"]["not_predicted"].as_str().is_some_and(|why| why.contains("throughout")),
        "{}",
        v["channels"]
    );
    let effects = v["effects"].as_array().expect("effects");
    for e in effects.iter().filter(|e| e["id"] == "unknown") {
        let c = &v["channels"][e["channels"][0].as_str().expect("a channel")];
        assert!(number(&c["before"]["heldout_rms"]) > number(&c["noise_floor_rms"]), "{e}");
    }
    let lag = effects.iter().find(|e| e["id"] == "spinup_lag").expect("the lag");
    for name in ["tau_up", "tau_down"] {
        let p = lag["parameters"].as_array().expect("parameters").iter().find(|p| p["name"] == name).expect("a time");
        assert!((0.03..0.05).contains(&number(&p["value"])), "{p}");
    }
    let of = &v["channels"][lag["channels"][0].as_str().expect("a channel")];
    let without = number(&of["after"]["heldout_rms"]) / (1.0 - number(&lag["heldout_error_reduction"]));
    let before = number(&of["before"]["heldout_rms"]);
    assert!((without / before - 1.0).abs() < 0.1, "without the lag alone the declared model is left: {without} {before}");
}

#[test]
fn a_clean_flight_has_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("run.csv"), Scenario::new(CLEAN).log(0)).expect("a file");
    let v = closed(folder.path(), "run.csv", &[]);
    assert_eq!((v["verdict"].as_str(), named(&v).len()), (Some("none"), 0), "{v}");
}

/// A gyro that is 55 ms late: everything that the rotors do is late in it, and so is the attitude's turning. Named, with its delay, and no channel
/// gets worse by it.
#[test]
fn a_late_gyro_is_named_and_makes_no_channel_worse() {
    assert_eq!(hidden(110), ["channel_delay"]);
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("run.csv"), Scenario::new(110).log(0)).expect("a file");
    let v = closed(folder.path(), "run.csv", &[]);
    assert_eq!((v["verdict"].as_str(), named(&v)), (Some("attributed"), vec!["channel_delay"]), "{v}");
    let delay = &v["effects"][0]["parameters"][0];
    let [low, high] = [0, 1].map(|k| delay["ci95"][k].as_f64().expect("a bound"));
    assert!(low > 0.050 && high < 0.060, "{delay}");
    for channel in ["ang_acc_x", "ang_acc_y", "ang_acc_z", "gyro_x", "gyro_y", "gyro_z"] {
        let [before, after] = ["before", "after"].map(|k| v["channels"][channel][k]["heldout_rms"].as_f64().expect("a number"));
        assert!(after < 0.9 * before, "{channel}: {before} {after}");
    }
}

/// Wash from below, whose answer by the controller passes for a late gyro; a swinging load and a tether, which pass for lift from moving.
#[test]
fn what_the_library_does_not_know_is_told_without_a_name() {
    for (seed, hides) in [(96206, "unknown_wash"), (96246, "unknown_slung"), (96076, "unknown_tether")] {
        assert_eq!(hidden(seed), [hides]);
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("run.csv"), Scenario::new(seed).log(0)).expect("a file");
        let v = closed(folder.path(), "run.csv", &[]);
        assert_eq!((v["verdict"].as_str(), named(&v)), (Some("unattributed"), vec![]), "{hides}: {v}");
    }
}

/// What the tool cannot use is refused with one line.
#[test]
fn what_is_no_usable_flight_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    std::fs::write(at.join("a.csv"), "# quadrig-flight 1\nt_s,pulse_us_1,rpm_1\n0,1500,4000\n0.1,1500,4000\n").expect("a file");
    call(at, &["close-loop", "a.csv", "-o", "out"]).refused(&["a.csv", "specific force"]);
    let rows: String = (0..50).map(|i| format!("{},1500,4000,0,0,-9.8\n", 0.01 * f64::from(i))).collect();
    std::fs::write(at.join("b.csv"), format!("# quadrig-flight 1\nt_s,pulse_us_1,rpm_1,acc_x,acc_y,acc_z\n{rows}"))
        .expect("a file");
    call(at, &["close-loop", "b.csv", "-o", "out"]).refused(&["b.csv", "in the air"]);
    std::fs::write(
        at.join("c.csv"),
        format!("# quadrig-flight 1\n# layout = \"star\"\nt_s,pulse_us_1,rpm_1,acc_x,acc_y,acc_z\n{rows}"),
    )
    .expect("a file");
    call(at, &["close-loop", "c.csv", "-o", "out"]).refused(&["layout", "star"]);
    std::fs::write(at.join("m.toml"), "format = \"quadrig-flight-model 1\"\nsource = 3\n").expect("a file");
    call(at, &["predict", "m.toml", "b.csv", "-o", "p.csv"]).refused(&["m.toml:2"]);
    assert!(!at.join("out").exists());
}

/// A speed channel that reads nothing is named, with what to do; without it the pulses speak.
#[test]
fn a_silent_speed_channel_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let text = Scenario::new(CLEAN).log(0);
    let header = text.lines().find(|l| l.starts_with("t_s")).expect("a header");
    let column = header.split(',').position(|n| n == "rpm_2").expect("rpm_2");
    let row = |line: &str| {
        if line.starts_with('#') || line.starts_with("t_s") {
            return line.to_owned();
        }
        line.split(',').enumerate().map(|(k, cell)| if k == column { "0" } else { cell }).collect::<Vec<_>>().join(",")
    };
    std::fs::write(at.join("dead.csv"), text.lines().map(row).collect::<Vec<_>>().join("\n") + "\n").expect("a file");
    call(at, &["close-loop", "dead.csv", "-o", "out"]).refused(&["dead.csv: column rpm_2: reads nothing", "take the column out"]);
    std::fs::write(at.join("run.csv"), text).expect("a file");
    call(at, &["--quiet", "close-loop", "run.csv", "--validate", "dead.csv", "-o", "out"]).refused(&["dead.csv: column rpm_2"]);
    // a log of another kind to validate on is told for what it is
    std::fs::write(at.join("rig.csv"), "# quadrig-log 1\nt_s,rpm,thrust_n\n0,0,0\n1,100,1\n").expect("a file");
    std::fs::write(at.join("unit.csv"), "t_s,gx,gy,gz,ax,ay,az\n0,0,0,0,0,0,9.8\n").expect("a file");
    for (name, kind) in [("rig.csv", "a rig log"), ("unit.csv", "an attitude log")] {
        call(at, &["close-loop", "run.csv", "--validate", name, "-o", "out"])
            .refused(&[&format!("{name}:1:1: {kind}, and the run is a flight"), "another flight of the same vehicle"]);
    }
    assert!(!at.join("out").exists());
}

/// The recorded brushless flights: one vehicle, two flights, the same effects of about the same size.
#[test]
fn two_flights_of_one_vehicle_show_the_same() {
    let Some(data) = data("recorded flights") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    for name in ["brushless-eckart00", "brushless-eckart22"] {
        let source = data.join(format!("rig/crazyflie-flights/{name}.csv"));
        let source = source.to_str().expect("a plain name");
        let out = format!("{name}.csv");
        call(at, &["--quiet", "import", source, "-o", &out, "--meta", "mass_kg=0.037", "--meta", "arm_m=0.046"]).succeeded();
    }
    let slow = closed(at, "brushless-eckart00.csv", &[]);
    let fast = closed(at, "brushless-eckart22.csv", &[]);
    for id in ["spinup_lag", "rotor_drag", "lever_arm", "hub_moment"] {
        assert!(named(&slow).contains(&id) && named(&fast).contains(&id), "{id}: {:?} {:?}", named(&slow), named(&fast));
    }
    let value = |v: &Value, id: &str, parameter: &str| -> f64 {
        let effect = v["effects"].as_array().expect("effects").iter().find(|e| e["id"] == id).expect("an effect").clone();
        let list = effect["parameters"].as_array().expect("parameters").clone();
        list.iter().find(|p| p["name"] == parameter).and_then(|p| p["value"].as_f64()).expect("a value")
    };
    // what is known of them: force across falls by some 0.34 1/s (flight.md), which is 0.0126 N/(m/s) at 37 g
    for v in [&slow, &fast] {
        let drag = value(v, "rotor_drag", "coefficient");
        assert!((0.0105..0.0145).contains(&drag), "{drag}");
        assert!((0.03..0.06).contains(&value(v, "spinup_lag", "tau_up")));
    }
    assert!((value(&slow, "lever_arm", "arm_z") / value(&fast, "lever_arm", "arm_z") - 1.0).abs() < 0.5);
}

/// A speed channel that reads half, or stands still, is named and not believed: force and moments are predicted as without the fault.
#[test]
fn a_broken_speed_channel_is_refused() {
    let Some(data) = data("recorded flights") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let source = data.join("rig/crazyflie-flights/brushless-eckart22.csv");
    let source = source.to_str().expect("a plain name");
    call(at, &["--quiet", "import", source, "-o", "whole.csv", "--meta", "mass_kg=0.037", "--meta", "arm_m=0.046"]).succeeded();
    let whole = closed(at, "whole.csv", &[]);
    let text = std::fs::read_to_string(at.join("whole.csv")).expect("a file");
    let header = text.lines().find(|l| l.starts_with("t_s")).expect("a header");
    let column = header.split(',').position(|n| n == "rpm_3").expect("rpm_3");
    let broken = |change: &dyn Fn(f64, f64) -> f64| -> String {
        let row = |line: &str| {
            if line.starts_with('#') || line.starts_with("t_s") {
                return line.to_owned();
            }
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            let (t, v): (f64, f64) = (cells[0].parse().expect("a time"), cells[column].parse().expect("a speed"));
            cells[column] = format!("{}", change(t, v));
            cells.join(",")
        };
        text.lines().map(row).collect::<Vec<_>>().join("\n") + "\n"
    };
    let halved = broken(&|_, v| 0.5 * v);
    let stuck = broken(&|t, v| if t > 2.0 { 15_337.0 } else { v });
    for (name, content) in [("halved.csv", halved), ("stuck.csv", stuck)] {
        std::fs::write(at.join(name), content).expect("a file");
        let v = closed(at, name, &[]);
        assert!(named(&v).contains(&"dead_rotor_speed"), "{name}: {:?}", named(&v));
        for channel in ["acc_z", "ang_acc_x"] {
            let error = |v: &Value| v["channels"][channel]["after"]["heldout_rms"].as_f64().expect("a number");
            assert!(error(&v) < 1.25 * error(&whole), "{name} {channel}: {} {}", error(&v), error(&whole));
        }
    }
}
