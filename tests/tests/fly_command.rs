//! `quadrig fly` as its user meets it: the missions of the thesis, an identified model in the air, refusals, folders whole or not at all.

use quadrig_tests::{call, root};
use std::path::Path;

fn columns(file: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = std::fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let names: Vec<String> = lines.next().expect("a header").split(',').map(str::to_owned).collect();
    let mut values = vec![Vec::new(); names.len()];
    for line in lines {
        line.split(',').zip(&mut values).for_each(|(text, column)| column.push(text.parse().unwrap_or(f64::NAN)));
    }
    (names, values)
}

fn column(file: &Path, name: &str) -> Vec<f64> {
    let (names, mut values) = columns(file);
    values.swap_remove(names.iter().position(|n| n == name).unwrap_or_else(|| panic!("{name} in {names:?}")))
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut names: Vec<String> = entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

fn json(folder: &Path, words: &[&str]) -> serde_json::Value {
    let said = call(folder, words).succeeded();
    serde_json::from_str(&said.out).unwrap_or_else(|e| panic!("{e}: {}", said.out))
}

/// 7.4.1 to 7.4.4 with the tolerances of docs/mission.md; the states and a flight log that reads back.
#[test]
fn the_missions_of_the_thesis() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let fly = |name: &str| {
        let mission = root().join(format!("examples/flight/{name}.toml"));
        let out = json(at, &["fly", mission.to_str().expect("a plain name"), "-o", &format!("out/{name}"), "--json"]);
        println!("{name}: {out}");
        out
    };
    let number = |v: &serde_json::Value, path: &str| v.pointer(path).and_then(serde_json::Value::as_f64).expect("a number");
    let near = |what: &str, ours: f64, stated: f64, tolerance: f64| {
        assert!((ours / stated - 1.0).abs() <= tolerance, "{what}: {ours}, stated {stated}");
    };

    let takeoff = fly("takeoff");
    near("hover speed", number(&takeoff, "/hover/rpm"), 4100.0, 0.005);
    near("hover thrust", number(&takeoff, "/hover/thrust_n"), 2.879, 0.005);
    near("hover pulse", number(&takeoff, "/hover/pulse_us"), 1672.0, 0.01);
    near("minutes at full throttle", number(&takeoff, "/hover/minutes_full"), 9.0, 0.02);
    near("climb, what docs/mission.md says", number(&takeoff, "/highest_m"), 45.9, 0.02);
    assert_eq!(number(&takeoff, "/steepest_deg"), 0.0);
    assert!(number(&fly("hover"), "/end/velocity_m_s/2") > 0.0, "at 8.36 % the catalogue sinks");
    let excited = fly("excitation");
    assert!(number(&excited, "/touched_s") > 20.0 && number(&excited, "/end/place_m/0") < -100.0);
    let states = at.join("out/excitation/states.csv");
    let (t, q, r, roll) =
        (column(&states, "t_s"), column(&states, "q_rad_s"), column(&states, "r_rad_s"), column(&states, "roll_rad"));
    let soon = t.iter().position(|t| *t >= 2.0).expect("two seconds");
    near("pitch rate, deg/s", q[soon].to_degrees(), 2.3, 0.08);
    assert!((0.02..0.2).contains(&r[soon].to_degrees()) && roll[soon].abs() < 2e-4, "{} {}", r[soon], roll[soon]);
    let landed = fly("landing");
    let told = std::fs::read_to_string(at.join("out/landing/flight.html")).expect("the page");
    assert!(told.contains(
        "<h1>It touched the ground after 16.7 s, at 4.7 m/s downwards.</h1>\n<p class=\"lead\">At the most it was 63.0 m high"
    ));
    assert!(number(&landed, "/touched_m_s") > 4.0 && number(&landed, "/touched_s") < 30.0);

    assert_eq!(names(&at.join("out")), ["excitation", "hover", "landing", "takeoff"], "nothing else is left");
    for name in names(&at.join("out")) {
        let folder = at.join("out").join(&name);
        let log = ident::log::flight_log::read(&folder.join("flight.csv")).unwrap_or_else(|e| panic!("{e}"));
        // the supply is never read as nothing: before the first step it has not been read
        let supply = log.column("voltage_v").expect("a supply");
        assert!(supply.iter().all(|v| v.is_nan() || *v > 5.0) && supply[1..].iter().all(|v| v.is_finite()), "{:?}", &supply[..3]);
        let (header, states) = columns(&folder.join("states.csv"));
        assert_eq!((header.len(), log.len(), ident::log::flight_log::rotors(&log)), (17, states[0].len(), 4));
        assert_eq!(log.meta["layout"].as_str(), Some("plus"));
        let page = std::fs::read_to_string(folder.join("flight.html")).expect("the page");
        for id in ["pulses", "thrust", "path-from-above", "path-from-the-east-side", "place", "velocity", "angles", "rates"] {
            assert!(page.contains(&format!("<figure id=\"{id}\">")), "{id}");
        }
        let fetched = page.matches("http").count() - page.matches("xmlns=\"http://www.w3.org/2000/svg\"").count();
        // its one script copies tables
        let scripts = page.matches("<script").count();
        assert!(!page.contains("NaN") && scripts == 1 && page.contains("<script>if(navigator.clipboard)") && fetched == 0);
        let digest = ident::log::digest(&std::fs::read(root().join(format!("examples/flight/{name}.toml"))).expect("a mission"));
        assert!(page.contains(&digest) && page.contains("download=\"summary.csv\"") && page.contains("class=\"told\""));
        assert!(page.contains("<td class=\"text\">thrust to weight 2.01"), "the summary is on the page");
        let apart = log.column("pos_z").expect("a height").iter().zip(&states[3]).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f64::max) < 1e-4);
    }
}

/// The controller on the board's attitude flies the square, on the catalogue and on an identified model; board and controller are in the
/// summary, on the page and in a file; a lost magnetometer and a dead rotor end as they should.
#[test]
fn the_square() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let square = root().join("examples/flight/square.toml");
    let square = square.to_str().expect("a plain name");
    call(at, &["--quiet", "demo", "--seed", "3", "-o", "demo"]).succeeded();
    for model in [&[][..], &["--model", "demo/model.toml"]] {
        let out = json(at, &[&["fly", square, "-o", "out", "--json"][..], model].concat());
        println!("{} {} {}", out["powerplant"], out["ahrs"], out["events"]);
        assert_eq!(
            (out["events"].as_array().map(Vec::len), out["events"][0]["what"].as_str()),
            (Some(1), Some("landed, motors off"))
        );
        let most = |what: &str| out["ahrs"][what][0].as_f64().expect("a number");
        assert!(most("tilt_deg") < 3.0 && most("heading_deg") < 3.0);
        let states = at.join("out/states.csv");
        let [t, north, east, down] = ["t_s", "north_m", "east_m", "down_m"].map(|name| column(&states, name));
        let hover: Vec<usize> = (0..t.len()).filter(|i| (8.0..68.0).contains(&t[*i])).collect();
        let off = hover.iter().map(|i| north[*i].hypot(east[*i]).hypot(down[*i] + 2.0)).fold(0.0, f64::max);
        println!("hover off by {off:.3} m");
        assert!(hover.len() > 2_900 && off < 0.5, "{} {off}", hover.len());
        let (header, said) = columns(&at.join("out/attitude.csv"));
        assert_eq!(header.join(","), "t_s,qw,qx,qy,qz,roll_deg,pitch_deg,yaw_deg");
        assert!(said[0][0] < -290.0 && said[5].iter().all(|roll| roll.abs() < 15.0), "from its power-up on, 200 rows a second");
        let page = std::fs::read_to_string(at.join("out/flight.html")).expect("the page");
        assert!(
            page.contains("<h1>After 10")
                && page.contains(" s it landed and the motors went off.</h1>\n<p class=\"lead\">At the most it was 2.")
        );
        assert!(page.contains("The board was off by up to "));
        assert!(["board-error", "board-roll", "wind"].iter().all(|id| page.contains(&format!("<figure id=\"{id}\">"))));
    }
    let text = std::fs::read_to_string(square).expect("the mission");
    for (name, failure, words) in [
        ("magnetometer", "chip = \"magnetometer\"", &["controlled descent: the magnetometer is lost", "landed, motors off"][..]),
        ("rotor", "rotor = 2", &["motors off: the vehicle does not follow"]),
    ] {
        std::fs::write(at.join(format!("{name}.toml")), format!("{text}\n[[failure]]\nat_s = 30\n{failure}\n")).expect("a file");
        let said = call(at, &["fly", &format!("{name}.toml")]).succeeded();
        assert!(words.iter().all(|w| said.out.contains(w)), "{}", said.out);
    }
    std::fs::write(at.join("brick.toml"), "hub_kg = 4.0\n").expect("a file");
    std::fs::write(at.join("heavy.toml"), format!("airframe = \"brick.toml\"\n{text}")).expect("a file");
    call(at, &["fly", "heavy.toml", "-o", "never"]).refused(&["cannot hover"]);
    assert!(!at.join("never").exists());
}

/// A fall from 20 m that nobody asked to end on the ground: the touch is told with the time and the speed of a fall with drag (2.30 s, 13.9 m/s),
/// in words, as a line and in the JSON; what comes after is no flight that keeps its height.
#[test]
fn a_crash_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let drop =
        "duration_s = 6\n[start]\nheight_m = 20\n[[command]]\nrotors = [1, 2, 3, 4]\nsteps = [{ pulse_us = 1000, hold_s = 6 }]\n";
    std::fs::write(at.join("drop.toml"), drop).expect("a file");
    let said = call(at, &["fly", "drop.toml", "-o", "out"]).succeeded().out;
    for words in
        ["first after 2.3 s, at 13.9 m/s downwards", "After 6.0 s it is on the ground.", "ground    touched after 2.30 s at 13.9"]
    {
        assert!(said.contains(words), "{said}");
    }
    assert!(!said.contains("keeps its height"), "{said}");
    let page = std::fs::read_to_string(at.join("out/flight.html")).expect("the page");
    assert!(page.contains("first after 2.3 s"));
    let out = json(at, &["fly", "drop.toml", "--json"]);
    // it bounces, and the bounces are told too
    assert!(out["touches"].as_array().is_some_and(|touches| !touches.is_empty()), "{out}");
    assert_eq!((&out["touched_s"], &out["touched_m_s"]), (&out["touches"][0]["t_s"], &out["touches"][0]["down_m_s"]));
    // a take-off touches nothing
    std::fs::write(at.join("up.toml"), "duration_s = 2\n[start]\nspun_up = false\n[[command]]\nrotors = [1, 2, 3, 4]\nsteps = [{ pulse_us = 1750, hold_s = 2 }]\n")
        .expect("a file");
    let out = json(at, &["fly", "up.toml", "--json"]);
    assert_eq!((out["touches"].as_array().map(Vec::len), out["touched_s"].is_null()), (Some(0), true), "{out}");
}

/// The hover that is told is that of the air at the ground of the mission.
#[test]
fn the_hover_is_told_for_the_ground_of_the_mission() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let hover = |air: &str| {
        std::fs::write(at.join("m.toml"), format!("duration_s = 0.1\n[air]\n{air}\n")).expect("a file");
        let out = json(at, &["fly", "m.toml", "--json"]);
        ["pulse_us", "thrust_to_weight", "minutes"].map(|key| out["hover"][key].as_f64().expect("a number"))
    };
    let (sea, high, warm) = (hover(""), hover("ground_altitude_m = 4000"), hover("temperature_offset_k = 40"));
    println!("{sea:?} {high:?} {warm:?}");
    // two thirds of the density
    assert!(high[0] > sea[0] + 60.0 && high[2] < sea[2], "{high:?}");
    assert!((0.62..0.80).contains(&(high[1] / sea[1])), "{high:?}");
    assert!(warm[0] > sea[0] + 10.0 && warm[1] < 0.95 * sea[1], "{warm:?}");
}

/// How long a flight is, is said before it begins.
#[test]
fn a_long_flight_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    std::fs::write(at.join("long.toml"), "duration_s = 700\nlog_hz = 1\n").expect("a file");
    let said = call(at, &["fly", "long.toml"]).succeeded();
    assert!(said.err.contains("long.toml: up to 700 s of flight, 700 rows"), "{}", said.err);
    assert_eq!(call(at, &["--quiet", "fly", "long.toml"]).succeeded().err, "");
}

/// Steps and a ramp as a scenario of the rig and as a mission have them.
const STEPS: &str = "[{ pulse_us = 1000, hold_s = 2 }, { pulse_us = 1300, hold_s = 4 }, { pulse_us = 1700, hold_s = 4 }, \
    { pulse_us = 1900, hold_s = 4 }, { pulse_us = 1400, hold_s = 4, ramp = true }, { pulse_us = 1400, hold_s = 3 }]";

/// A rig with a sagging lead and a slow load cell: its model flies with the sag and the lag, without the load cell, and gives in the air what
/// the same model in the plant's place gives on the rig.
#[test]
fn the_same_schedule_in_flight_and_on_the_rig() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let write = |name: &str, text: String| std::fs::write(at.join(name), text).expect("a file");
    let sag = "[[effect]]\nid = \"supply_sag\"\nresistance_ohm = 0.08\n[[effect]]\nid = \"channel_filter\"\ntau_s = 0.3\n";
    let up_down = "schedule = { kind = \"up_down\", step_us = 50, hold_s = 4, top_us = 2000 }";
    write("rig.toml", format!("seed = 1\n{up_down}\n{sag}"));
    write("again.toml", format!("seed = 2\nrest_s = 1.0\nschedule = {{ kind = \"steps\", steps = {STEPS} }}\n{sag}"));
    // so heavy that it stays where the air is that of the rig
    write("heavy.toml", "hub_kg = 100.0\n".to_owned());
    let mission = "airframe = \"heavy.toml\"\nduration_s = 21.0\n[start]\nheight_m = 0.002\nspun_up = false\n[[command]]\nrotors = [1, 2, 3, 4]\n";
    write("mission.toml", format!("{mission}steps = {STEPS}\n"));
    call(at, &["--quiet", "sim", "rig.toml", "-o", "rig.csv"]).succeeded();
    call(at, &["--quiet", "close-loop", "rig.csv", "-o", "closed"]).succeeded();
    call(at, &["--quiet", "sim", "again.toml", "--model", "closed/model.toml", "-o", "again.csv"]).succeeded();
    let said = call(at, &["fly", "mission.toml", "--model", "closed/model.toml", "-o", "flown"]).succeeded();
    println!("{}", said.out);
    let [flies, stays] = ["effects in flight: ", "of the rig alone: "].map(|words| {
        let from = said.out.find(words).expect("both lists") + words.len();
        said.out[from..].split([';', '\n']).next().expect("a list").to_owned()
    });
    assert!(
        flies.contains("supply_sag") && flies.contains("spinup_lag") && stays.contains("channel_filter"),
        "{flies} | {stays}"
    );

    let (t, thrust) = (column(&at.join("flown/flight.csv"), "t_s"), column(&at.join("flown/flight.csv"), "thrust_n_1"));
    let rpm = column(&at.join("flown/flight.csv"), "rpm_1");
    let log = at.join("again.csv");
    let (rig_t, rig_thrust, rig_rpm) = (column(&log, "t_s"), column(&log, "thrust_n"), column(&log, "rpm_encoder"));
    // the rig rests for a second first, and its load cell is the model's: late by the lag that the vehicle does not have
    let rest = 1.0;
    let mut compared = 0;
    for i in 0..rig_t.len() {
        // a step shows in the thrust before the encoder has seen it
        let now = rig_t[i] - rest;
        let starts = (2.0..2.3).contains(&now);
        let held = !starts && (0..25).all(|k| i >= k && (rig_rpm[i] - rig_rpm[i - k]).abs() < 3.0);
        if !held || !(0.5..20.9).contains(&now) {
            continue;
        }
        let row = t.partition_point(|t| *t < now);
        assert!((thrust[row] - rig_thrust[i]).abs() < 0.03 + 0.003 * rig_thrust[i], "{now} s: {} {}", thrust[row], rig_thrust[i]);
        assert!((rpm[row] - rig_rpm[i]).abs() < 5.0 + 0.002 * rig_rpm[i], "{now} s: {} {}", rpm[row], rig_rpm[i]);
        compared += 1;
    }
    assert!(compared > 40, "{compared} rows held");
    // and on the way: 63 % of the step to 1300 us and to 1700 us comes at the same time within a row of the rig
    for step_s in [2.0, 6.0] {
        let crossing = |t: &[f64], rpm: &[f64], from: f64| {
            let value = |s: f64| rpm[t.partition_point(|t| *t < from + s).min(t.len() - 1)];
            let there = value(-0.2) + 0.63 * (value(3.0) - value(-0.2));
            t.iter().zip(rpm).find(|(t, v)| **t > from && **v > there).map_or(f64::NAN, |(t, _)| t - from)
        };
        let (air, rig) = (crossing(&t, &rpm, step_s), crossing(&rig_t, &rig_rpm, step_s + rest));
        println!("step at {step_s} s: 63 % after {air:.3} s in flight, in the row that ends {rig:.3} s after it on the rig");
        assert!(air > 0.01 && air < rig + 0.02 && rig < air + 0.15, "{air} {rig}");
    }
}

/// The log of a flight is a table of pulses: flown again, it is the same flight.
#[test]
fn a_flight_flies_again_from_its_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let write = |name: &str, text: &str| std::fs::write(at.join(name), text).expect("a file");
    let steps = |r: &str, steps: &str| format!("[[command]]\nrotors = {r}\nsteps = {steps}\n");
    let same = "duration_s = 3\nlog_hz = 1000\n[wind]\ngust_m_s = 1\n[start]\nheight_m = 20\n";
    let first = steps("[1, 2, 3]", "[{ pulse_us = 1690, hold_s = 3 }]")
        + &steps(
            "[4]",
            "[{ pulse_us = 1690, hold_s = 1 }, { pulse_us = 1700, hold_s = 0.5, ramp = true }, { pulse_us = 1690, hold_s = 9 }]",
        );
    write("first.toml", &format!("{same}{first}"));
    write("again.toml", &format!("pulses = \"first/flight.csv\"\n{same}"));
    let states = |name: &str| {
        call(at, &["--quiet", "fly", &format!("{name}.toml"), "-o", name]).succeeded();
        std::fs::read(at.join(name).join("states.csv")).expect("the states")
    };
    let (once, twice) = (states("first"), states("again"));
    // the log has the pulse of the millisecond before each row, so the flights are a millisecond apart where the pulses move
    let rate = |name: &str| column(&at.join(name).join("states.csv"), "q_rad_s");
    let apart = rate("first").iter().zip(rate("again")).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 2e-3 && once.len().abs_diff(twice.len()) < 200, "{apart}");
    assert_eq!(states("first"), once, "the same file gives the same bytes, in a folder of earlier results too");
    call(at, &["fly", "again.toml", "-o", "first"]).refused(&["first/flight.csv", "is an input"]);
    assert_eq!(std::fs::read(at.join("first/states.csv")).expect("untouched"), once);
}

#[test]
fn refusals_write_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let write = |name: &str, text: &str| std::fs::write(at.join(name), text).expect("a file");
    write("m.toml", "duration_s = 1\n");
    write("typo.toml", "duration_s = 1\n[wind]\nspeed = 3\n");
    write("frame.toml", "airframe = \"a.toml\"\n");
    write("a.toml", "arm_m = 0.3\nhub_kg = -1\n");
    write("table.toml", "pulses = \"p.csv\"\n");
    write("p.csv", "t_s,pulse_us_1\n0,1500\n1,2500\n");
    write("notes.txt", "kept");
    call(at, &["fly", "typo.toml", "-o", "out"]).refused(&["typo.toml:3:1: ", "speed"]);
    call(at, &["fly", "frame.toml", "-o", "out"]).refused(&["a.toml:2:10: ", "above 0"]);
    call(at, &["fly", "table.toml", "-o", "out"]).refused(&["p.csv:3:3: ", "1000 to 2000"]);
    call(at, &["fly", "none.toml", "-o", "out"]).refused(&["none.toml"]);
    call(at, &["fly", "m.toml", "--model", "m.toml", "-o", "out"]).refused(&["m.toml", "format"]);
    write("flown.toml", "format = \"quadrig-flight-model 1\"\n");
    write("unit.toml", "format = \"quadrig-inertial 1\"\n");
    call(at, &["fly", "m.toml", "--model", "flown.toml", "-o", "out"])
        .refused(&["flown.toml:1:1: a model of a flight", "expected a rig's model"]);
    call(at, &["fly", "m.toml", "--model", "unit.toml", "-o", "out"])
        .refused(&["unit.toml:1:1: a model of an inertial unit", "expected a rig's model"]);
    for (name, text, words) in [
        ("deep", "[start]\nheight_m = -5\n", ["deep.toml:2:12: ", "from 0 to 5000"]),
        ("endless", "duration_s = 1e9\n", ["endless.toml:1:14: ", "at most 86400 s"]),
    ] {
        write(&format!("{name}.toml"), text);
        call(at, &["fly", &format!("{name}.toml"), "-o", "out"]).refused(&words);
    }
    // a model of a log without a command, and one of a log without a thrust
    let rows: String = (0..12).map(|i| format!("{i},{},{}\n", 500 * i, 0.04 * f64::from(i * i))).collect();
    write("still.csv", &format!("# quadrig-log 1\nt_s,rpm,thrust_n\n{rows}"));
    let rows: String = (0..12).map(|i| format!("{i},{},{},{}\n", 1000 + 50 * i, 300 * i, 0.1 * f64::from(i))).collect();
    write("spin.csv", &format!("# quadrig-log 1\nt_s,pulse_us,rpm,current_a\n{rows}"));
    for (name, word) in [("still", "no speed from a command"), ("spin", "no thrust")] {
        call(at, &["--quiet", "identify", &format!("{name}.csv"), "-o", &format!("{name}.toml")]).succeeded();
        call(at, &["fly", "m.toml", "--model", &format!("{name}.toml"), "-o", "out"]).refused(&[name, word]);
    }
    // a model whose thrust has no end, changed by hand
    write("run.toml", "schedule = { kind = \"staircase\", step_us = 250, hold_s = 2, top_us = 2000 }\n");
    call(at, &["--quiet", "sim", "run.toml", "-o", "run.csv"]).succeeded();
    call(at, &["--quiet", "identify", "run.csv", "-o", "sound.toml"]).succeeded();
    let sound = std::fs::read_to_string(at.join("sound.toml")).expect("a model");
    let changed = |change: &dyn Fn(&str, &str) -> Option<String>| -> String {
        let mut table = String::new();
        let lines = sound.lines().filter(|l| !l.starts_with("discrepancy_sha256")).filter_map(|line| {
            if line.starts_with('[') {
                line.clone_into(&mut table);
            }
            change(&table, line)
        });
        lines.collect::<Vec<_>>().join("\n")
    };
    let without = |is_gone: &dyn Fn(&str) -> bool| changed(&|table, line| (!is_gone(table)).then(|| line.to_owned()));
    let of_thrust = |table: &str| table == "[channel.thrust_n]";
    let huge = |table: &str, line: &str| {
        let is_square = of_thrust(table) && line.starts_with("c2_n_per_krpm2 =");
        Some(if is_square { "c2_n_per_krpm2 = 1e200" } else { line }.to_owned())
    };
    write("huge.toml", &changed(&huge));
    call(at, &["fly", "m.toml", "--model", "huge.toml", "-o", "out"]).refused(&[
        "huge.toml:",
        "key channel.thrust_n.c2_n_per_krpm2",
        "what a rig can have, 1e7 at most",
    ]);
    // nothing of the catalogue stands in for what a model does not predict
    write("no-thrust.toml", &without(&of_thrust));
    write("no-speed.toml", &without(&|table| table.starts_with("[channel.rpm_") && !table.ends_with("_difference]")));
    for (name, word) in [("no-thrust", "predicts no thrust"), ("no-speed", "predicts no speed")] {
        let said = call(at, &["--quiet", "sim", "run.toml", "--model", &format!("{name}.toml"), "-o", "again.csv"]);
        assert!(said.status == Some(1) && said.err.contains(word) && !at.join("again.csv").exists(), "{name}: {}", said.err);
    }
    assert!(!at.join("out").exists());
    // a folder of somebody's files, and one that an input lies in
    call(at, &["fly", "m.toml", "-o", "."]).refused(&["m.toml", "is an input"]);
    std::fs::create_dir(at.join("full")).expect("a folder");
    std::fs::write(at.join("full/notes.txt"), "kept").expect("a file");
    call(at, &["fly", "m.toml", "-o", "full"]).refused(&["full", "notes.txt"]);
    call(at, &["fly", "m.toml", "-o", "notes.txt"]).refused(&["notes.txt"]);
    assert_eq!(
        (names(&at.join("full")), std::fs::read_to_string(at.join("notes.txt")).expect("there")),
        (vec!["notes.txt".to_owned()], "kept".to_owned())
    );
}
