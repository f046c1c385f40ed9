//! Recorded flights as flight logs: the frames that the importer says are those of the data.
//!
//! What it is: each Crazyflie flight is imported; the rate of change of its attitude is held against its gyro, that of its velocity against its
//! accelerometer, axis by axis. A sign or an order that is wrong in any of them shows.
//! What can go wrong: without the recorded data the test says so.
//! Units: as the flight log.
//! Reference: specification `flight.md`, "Flight log"; the data set's own description of its columns.

use ident::log::Log;
use ident::log::flight_log;
use quadrig_tests::{call, data};

const G: f64 = 9.806_65;

fn rows<const N: usize>(log: &Log, names: [&str; N]) -> Vec<[f64; N]> {
    let columns = names.map(|name| log.column(name).unwrap_or_else(|| panic!("{name}")));
    (0..log.len()).map(|i| columns.map(|c| c[i])).collect()
}

/// Slope of `a` on `b` through their means, and their correlation.
fn related(a: &[f64], b: &[f64]) -> (f64, f64) {
    let n = a.len() as f64;
    let (ma, mb) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
    let of = |f: &dyn Fn(f64, f64) -> f64| a.iter().zip(b).map(|(x, y)| f(x - ma, y - mb)).sum::<f64>();
    let (aa, bb, ab) = (of(&|x, _| x * x), of(&|_, y| y * y), of(&|x, y| x * y));
    (ab / bb, ab / (aa * bb).sqrt())
}

/// A vector in body axes as the earth has it.
fn to_earth([w, x, y, z]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ];
    rows.map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum())
}

/// Twice the vector part of the turn from one attitude to another, body axes.
fn turned([a, b, c, d]: [f64; 4], [w, x, y, z]: [f64; 4]) -> [f64; 3] {
    let scalar = a * w + b * x + c * y + d * z;
    [a * x - b * w - c * z + d * y, a * y + b * z - c * w - d * x, a * z - b * y + c * x - d * w]
        .map(|v| 2.0 * v * scalar.signum())
}

#[test]
fn the_frames_of_the_recorded_flights_are_ours() {
    let Some(data) = data("recorded flights") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    for name in ["brushless-eckart00", "brushless-eckart22", "brushed-jana01-first20s"] {
        let source = data.join(format!("rig/crazyflie-flights/{name}.csv"));
        let mass = if name.starts_with("brushed") { "mass_kg=0.0347" } else { "mass_kg=0.037" };
        let said = call(at, &["import", source.to_str().expect("a plain name"), "-o", "flight.csv", "--meta", mass]).succeeded();
        assert!(said.out.contains("forward-right-down") && said.out.contains("its x is taken for north"), "{}", said.out);
        let log = flight_log::read(&at.join("flight.csv")).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((flight_log::rotors(&log), log.meta["mass_kg"].is_float()), (4, true));
        let (q, gyro) = (rows(&log, ["qw", "qx", "qy", "qz"]), rows(&log, ["gyro_x", "gyro_y", "gyro_z"]));
        let (v, f) = (rows(&log, ["vel_x", "vel_y", "vel_z"]), rows(&log, ["acc_x", "acc_y", "acc_z"]));
        // over spans of some 50 ms without a gap, beside the means of what was sensed in them
        let span = 25;
        let mut pairs = [const { (Vec::new(), Vec::new()) }; 6];
        for i in (0..log.len() - span).step_by(5) {
            let dt = log.t[i + span] - log.t[i];
            if dt > 0.08 {
                continue;
            }
            let mean = |of: &dyn Fn(usize) -> [f64; 3]| -> [f64; 3] {
                let sum = (i..i + span).map(of).fold([0.0; 3], |s, x| [s[0] + x[0], s[1] + x[1], s[2] + x[2]]);
                sum.map(|s| s / span as f64)
            };
            let (rate, force) = (mean(&|k| gyro[k]), mean(&|k| to_earth(q[k], f[k])));
            let turn = turned(q[i], q[i + span]);
            for axis in 0..3 {
                pairs[axis].0.push(turn[axis] / dt);
                pairs[axis].1.push(rate[axis]);
                pairs[3 + axis].0.push((v[i + span][axis] - v[i][axis]) / dt);
                pairs[3 + axis].1.push(force[axis] + if axis == 2 { G } else { 0.0 });
            }
        }
        for (axis, (change, sensed)) in pairs.iter().enumerate() {
            let (slope, correlation) = related(change, sensed);
            println!("{name} {} axis {}: slope {slope:.3}, correlation {correlation:.3}", ["gyro", "force"][axis / 3], axis % 3);
            assert!((0.7..1.3).contains(&slope) && correlation > 0.7, "{name} {axis}: {slope} {correlation}");
        }
    }
}

#[test]
fn poses_and_commands_alone_are_flights_too() {
    let Some(data) = data("recorded flights") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    for (name, rotors, column) in
        [("crazyflie-flights/brushless-eckart00.mocap.csv", 0, "qw"), ("arpl-crazyflie-flights/log10-10to20s.csv", 4, "gyro_x")]
    {
        let source = data.join("rig").join(name);
        call(at, &["import", source.to_str().expect("a plain name"), "-o", "flight.csv"]).succeeded();
        let log = flight_log::read(&at.join("flight.csv")).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((flight_log::rotors(&log), log.column(column).is_some()), (rotors, true), "{name}");
        assert!(log.len() > 600);
    }
    std::fs::write(at.join("rig.csv"), "t_s,pulse_us,rpm,thrust_n\n0,1000,0,0\n1,1500,3000,1\n").expect("a file");
    call(at, &["import", "rig.csv", "-o", "never.csv", "--meta", "mass_kg=1"]).refused(&["mass_kg", "no flight"]);
}

/// A flight of the generator, and the places of its rotors.
fn generated() -> (Log, Vec<[f64; 3]>) {
    use quadrig_tests::flights::scenario::{CLEAN, Scenario};
    let s = Scenario::new(CLEAN + 2);
    let mut log = flight_log::parse("flight.csv", s.log(0).as_bytes()).unwrap_or_else(|e| panic!("{e}"));
    if log.column("current_a").is_none() {
        let values = vec![3.0; log.len()];
        log.columns.push(ident::log::Column { name: "current_a".into(), values });
    }
    (log, s.vehicle.hubs.iter().map(|h| [h.x, h.y, h.turns]).collect())
}

/// Largest difference of two columns where both are known, and the share of rows where the second is.
fn apart(a: &[f64], b: &[f64]) -> (f64, f64) {
    let known: Vec<f64> = a.iter().zip(b).map(|(x, y)| (x - y).abs()).filter(|d| d.is_finite()).collect();
    (known.iter().copied().fold(0.0, f64::max), known.len() as f64 / a.len() as f64)
}

#[test]
fn a_ulog_holds_the_flight_that_was_written() {
    let (log, places) = generated();
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let bytes = quadrig_tests::recorders::ulog(&log, &places);
    std::fs::write(at.join("flight.ulg"), &bytes).expect("a file");
    let said = call(at, &["import", "flight.ulg", "-o", "flight.csv", "--meta", "mass_kg=1.0"]).succeeded();
    assert!(said.out.contains("not turned") && said.out.contains("CA_ROTOR"), "{}", said.out);
    let seen = flight_log::read(&at.join("flight.csv")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(seen.len(), log.len());
    // floats of four bytes; what is sampled more seldom is on straight lines
    for (name, most) in [
        ("gyro_y", 1e-5),
        ("acc_z", 1e-4),
        ("rpm_3", 0.6),
        ("pulse_us_2", 1e-3),
        ("vel_x", 0.2),
        ("qw", 0.02),
        ("voltage_v", 0.3),
    ] {
        let (difference, share) = apart(log.column(name).expect(name), seen.column(name).expect(name));
        assert!(difference <= most && share > 0.95, "{name}: {difference} on {share}");
    }
    let vehicle = ident::flight::vehicle::Vehicle::of(&seen).expect("a vehicle");
    assert!(vehicle.rotors.iter().zip(&places).all(|(r, p)| (r.x - p[0]).abs() < 1e-6 && r.turns == p[2]));
    // one rotor as a rig: the ESC's own voltage, its own time stamps
    let said = call(at, &["import", "flight.ulg", "--rotor", "3", "--motor", "M", "-o", "rotor.csv"]).succeeded();
    assert!(said.out.contains("rotor 3 of a flight as a rig: no thrust, no torque"), "{}", said.out);
    let rotor = Log::read(&at.join("rotor.csv")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(rotor.columns.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["pulse_us", "rpm", "voltage_v"]);
    for (ours, theirs, most) in [("rpm", "rpm_3", 0.6), ("pulse_us", "pulse_us_3", 1e-3)] {
        let (difference, share) = apart(log.column(theirs).expect(theirs), rotor.column(ours).expect(ours));
        assert!(difference <= most && share > 0.95, "{ours}: {difference} on {share}");
    }
    assert!(rotor.column("voltage_v").expect("a voltage").iter().all(|v| (v - 11.1).abs() < 1e-3));
    call(at, &["import", "flight.ulg", "--rotor", "9", "-o", "never.csv"]).refused(&["flight.ulg", "no speed of rotor 9"]);
    std::fs::write(at.join("cut.ulg"), &bytes[..bytes.len() / 2]).expect("a file");
    let said = call(at, &["import", "cut.ulg", "-o", "cut.csv"]).succeeded();
    assert!(said.out.contains("breaks off"), "{}", said.out);
    std::fs::write(at.join("head.ulg"), &bytes[..40]).expect("a file");
    call(at, &["import", "head.ulg", "-o", "never.csv"]).refused(&["head.ulg"]);
    assert!(!at.join("never.csv").exists());
}

#[test]
fn a_blackbox_log_holds_the_flight_that_was_written() {
    let (log, _) = generated();
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let bytes = quadrig_tests::recorders::blackbox(&log);
    std::fs::write(at.join("flight.bbl"), &bytes).expect("a file");
    let said = call(at, &["import", "flight.bbl", "-o", "flight.csv"]).succeeded();
    assert!(said.out.contains("forward-left-up") && said.out.contains("propellers turning in"), "{}", said.out);
    let seen = flight_log::read(&at.join("flight.csv")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(seen.len(), log.len());
    // half a step of each: a degree a second, 1/2048 g, a hundred electrical turns a minute over seven, DShot's 2000
    for (name, most) in [
        ("gyro_x", 0.0088),
        ("gyro_z", 0.0088),
        ("acc_y", 0.0025),
        ("acc_z", 0.0025),
        ("rpm_1", 7.2),
        ("pulse_us_4", 0.26),
        ("voltage_v", 0.0051),
    ] {
        let (difference, share) = apart(log.column(name).expect(name), seen.column(name).expect(name));
        assert!(difference <= most && share > 0.99, "{name}: {difference} on {share}");
    }
    call(at, &["import", "flight.bbl", "--rotor", "2", "-o", "rotor.csv"]).succeeded();
    let rotor = Log::read(&at.join("rotor.csv")).unwrap_or_else(|e| panic!("{e}"));
    let names: Vec<&str> = rotor.columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["pulse_us", "rpm", "voltage_v", "current_of_all_a"]);
    assert!(apart(log.column("rpm_2").expect("a speed"), rotor.column("rpm").expect("a speed")).0 <= 7.2);
    let text = String::from_utf8_lossy(&bytes);
    let text = text.split("H motorOutput").next().expect("headers").replace("Data version:2", "Data version:9");
    std::fs::write(at.join("old.bbl"), text).expect("a file");
    call(at, &["import", "old.bbl", "-o", "never.csv"]).refused(&["old.bbl", "Betaflight"]);
}

/// A file that is called a recording and is none is told to be damaged; nobody is sent to make a CSV of it.
#[test]
fn a_damaged_recording_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let noise: Vec<u8> = (0..4000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    for (ending, name) in [("ulg", "PX4 log"), ("bbl", "Betaflight Blackbox log")] {
        for (file, bytes, word) in [("empty", &[][..], "is empty"), ("noise", &noise, "does not begin as one")] {
            let file = format!("{file}.{ending}");
            std::fs::write(at.join(&file), bytes).expect("a file");
            for words in [&["import", &file, "-o", "never.csv"][..], &["close-loop", &file]] {
                let said = call(at, words).refused(&[&file, name, word]);
                assert!(!said.err.contains("CSV"), "{}", said.err);
            }
        }
    }
    assert!(!at.join("never.csv").exists());
}
