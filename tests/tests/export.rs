//! A model exported to each peer and read back as that peer reads it.
//!
//! What it is: the built program on the model of a simulated run; each file's own formula gives thrust over the signal again, which is compared
//! with the model's polynomials, evaluated here from `model.toml`.
//! What can go wrong: a key that holds something else, a curve farther off than the file says, a figure that the model does not tell.
//! Units: N, s, us.
//! Reference: docs/export.md.

use quadrig_tests::{call, root};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

const PEERS: [&str; 6] = ["px4", "ardupilot", "betaflight", "crazyflie", "simulink", "csv"];

/// A folder with the model of a run, made once.
fn bench() -> PathBuf {
    static MADE: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = MADE.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let scenario = "seed = 3\n[schedule]\nkind = \"staircase\"\nstep_us = 50\nhold_s = 5\ntop_us = 2000\n";
        std::fs::write(folder.path().join("rig.toml"), scenario).expect("a scenario");
        call(folder.path(), &["--quiet", "sim", "rig.toml", "-o", "run.csv"]).succeeded();
        let log = std::fs::read_to_string(folder.path().join("run.csv")).expect("a log");
        std::fs::write(
            folder.path().join("run.csv"),
            log.replacen("# quadrig-log 1\n", "# quadrig-log 1\n# pole_pairs = 7\n", 1),
        )
        .expect("a log");
        call(folder.path(), &["--quiet", "identify", "run.csv", "-o", "model.toml"]).succeeded();
        folder
    });
    folder.path().to_owned()
}

/// The model's thrust over the signal, from its polynomials alone.
struct Model(toml::Table);

impl Model {
    fn read(path: &Path) -> Self {
        Self(std::fs::read_to_string(path).expect("a model").parse().expect("TOML"))
    }

    fn polynomial(&self, channel: &str) -> Vec<f64> {
        let table = self.0["channel"][channel].as_table().unwrap_or_else(|| panic!("{channel}"));
        let of = |k: usize| table.iter().find(|(key, _)| key.starts_with(&format!("c{k}_")) && !key.ends_with("_se"));
        (0..).map_while(of).map(|(_, v)| v.as_float().expect("a number")).collect()
    }

    fn rpm(&self, signal: f64) -> f64 {
        let start = self.0["start_pulse_us"].as_float().expect("a pulse");
        let speeds: Vec<&str> =
            self.0["consensus"]["channels"].as_array().expect("channels").iter().filter_map(|c| c.as_str()).collect();
        if 1000.0 + 1000.0 * signal <= start {
            return 0.0;
        }
        let each = speeds.iter().map(|c| value(&self.polynomial(c), signal)).collect::<Vec<f64>>();
        each.iter().sum::<f64>() / each.len() as f64
    }

    fn thrust(&self, signal: f64) -> f64 {
        let polynomial = self.polynomial("thrust_n");
        let rpm = self.rpm(signal);
        if rpm <= 0.0 { 0.0 } else { value(&polynomial, rpm / 1000.0) - polynomial[0] }
    }
}

fn value(polynomial: &[f64], x: f64) -> f64 {
    polynomial.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

fn exported(peer: &str, more: &[&str]) -> String {
    call(&bench(), &[&["export", "model.toml", "--to", peer], more].concat()).succeeded().out
}

/// The number after a mark in a text.
fn after(text: &str, mark: &str) -> f64 {
    let rest = text.split(mark).nth(1).unwrap_or_else(|| panic!("{mark} in\n{text}"));
    let number: String = rest.trim_start().chars().take_while(|c| c.is_ascii_digit() || ".-+e".contains(*c)).collect();
    number.parse().unwrap_or_else(|_| panic!("{mark} {number:?}"))
}

/// The peer's curve against the model's: within what the file says of itself, and within `most` per cent of full thrust.
#[track_caller]
fn compare(text: &str, most: f64, thrust: impl Fn(f64) -> f64) {
    let model = Model::read(&bench().join("model.toml"));
    let full = model.thrust(1.0);
    let said = after(text, "its curve is within");
    assert!((after(text, "full thrust") / full - 1.0).abs() < 0.01, "{} N, the model's {full}", after(text, "full thrust"));
    let worst = (0..=100)
        .map(|k| f64::from(k) / 100.0)
        .map(|u| (100.0 * (thrust(u) - model.thrust(u)).abs() / full, u))
        .fold((0.0, 0.0), |a: (f64, f64), b| if b.0 > a.0 { b } else { a });
    println!("within {:.2} % of full thrust at most (at {}), {said} said, {most} allowed", worst.0, worst.1);
    // a percent for the discrepancy of the run, which the export carries and the bare polynomials do not
    assert!(worst.0 <= said + 1.0 && said <= most, "{worst:?}, {said} said");
}

fn px4(text: &str) -> BTreeMap<String, f64> {
    text.lines()
        .filter(|l| !l.starts_with('#'))
        .map(|line| {
            let cells: Vec<&str> = line.split('\t').collect();
            assert_eq!((cells.len(), cells[0], cells[1]), (5, "1", "1"), "{line}");
            assert!(["6", "9"].contains(&cells[4]) && (cells[4] == "9" || cells[3].parse::<i64>().is_ok()), "{line}");
            (cells[2].to_owned(), cells[3].parse().expect("a number"))
        })
        .collect()
}

#[test]
fn px4_reads_it_back() {
    let text = exported("px4", &[]);
    let keys = px4(&text);
    let factor = keys["THR_MDL_FAC"];
    let full = keys["CA_ROTOR0_CT"];
    let [from, to] = ["PWM_MAIN_MIN1", "PWM_MAIN_MAX1"].map(|key| keys[key] / 1000.0 - 1.0);
    compare(&text, 5.0, |u| {
        let x = ((u - from) / (to - from)).clamp(0.0, 1.0);
        full * (factor * x * x + (1.0 - factor) * x)
    });
    // without thrust it turns, disarmed it stands
    let of = |u: f64| Model::read(&bench().join("model.toml")).rpm(u);
    assert!(of(from) > 0.0 && of(keys["PWM_MAIN_DIS4"] / 1000.0 - 1.0) == 0.0 && keys["PWM_MAIN_MIN4"] == keys["PWM_MAIN_MIN1"]);
    assert_eq!(
        (keys["CA_ROTOR_COUNT"], keys.contains_key("CA_ROTOR3_KM"), keys.contains_key("CA_ROTOR4_CT")),
        (4.0, true, false)
    );
    let model = Model::read(&bench().join("model.toml"));
    let torque = model.polynomial("torque_nm");
    let arm = (value(&torque, model.rpm(1.0) / 1000.0) - torque[0]) / model.thrust(1.0);
    assert!((keys["CA_ROTOR0_KM"] / arm - 1.0).abs() < 0.03, "{} m, the model's {arm}", keys["CA_ROTOR0_KM"]);
    // front right and rear left turn counter-clockwise, the others clockwise: yaw can be steered
    let turning = [0, 1, 2, 3].map(|k| keys[&format!("CA_ROTOR{k}_KM")] / keys["CA_ROTOR0_KM"]);
    assert_eq!(turning, [1.0, 1.0, -1.0, -1.0]);
    assert!(
        (after(&text, "motorConstant") / (full / (model.rpm(1.0) * std::f64::consts::TAU / 60.0).powi(2)) - 1.0).abs() < 0.02
    );
    // of other airframes it is not known which rotor turns which way, and nothing is made up
    let six = exported("px4", &["--rotors", "6"]);
    assert!(px4(&six)["CA_ROTOR_COUNT"] == 6.0 && !px4(&six).contains_key("CA_ROTOR0_KM"), "{six}");
    assert!((after(&six, "its size is") / arm - 1.0).abs() < 0.03, "{six}");
}

#[test]
fn ardupilot_reads_it_back() {
    let read = |text: &str| -> BTreeMap<String, f64> {
        let lines = text.lines().filter(|l| !l.starts_with('#')).filter_map(|l| l.split_once(','));
        lines.map(|(key, v)| (key.to_owned(), v.parse().expect("a number"))).collect()
    };
    let text = exported("ardupilot", &[]);
    let keys = read(&text);
    let (expo, from, to) = (keys["MOT_THST_EXPO"], keys["MOT_SPIN_MIN"], keys["MOT_SPIN_MAX"]);
    compare(&text, 5.0, |u| {
        let x = ((u - from) / (to - from)).clamp(0.0, 1.0);
        after(&text, "full thrust") * ((1.0 - expo) * x + expo * x * x)
    });
    // armed it turns, and below what flies: arming is refused where it is not
    let armed = keys["MOT_SPIN_ARM"];
    assert!(armed < from && Model::read(&bench().join("model.toml")).rpm(armed) > 0.0, "{armed}, {from}");
    assert!(!keys.contains_key("MOT_BAT_VOLT_MAX") && text.contains("not in this file: MOT_BAT_VOLT_MAX"), "{text}");
    let keys = read(&exported("ardupilot", &["--cells", "4"]));
    assert_eq!((keys["MOT_BAT_VOLT_MAX"], keys["MOT_BAT_VOLT_MIN"]), (16.8, 13.2));
}

#[test]
fn betaflight_reads_it_back() {
    let text = exported("betaflight", &[]);
    let set: BTreeMap<&str, f64> = text
        .lines()
        .filter_map(|l| l.strip_prefix("set ")?.split_once(" = "))
        .map(|(key, v)| (key, v.parse().expect("a number")))
        .collect();
    let linear = set["thrust_linear"] / 100.0;
    let idle = set["dshot_idle_value"] / 10_000.0;
    // the demand whose signal this is, by a fine search of its own
    let signal = |x: f64| idle + (1.0 - idle) * x * (1.0 + linear * (1.0 - x) * (1.0 - x));
    let demand = |u: f64| (0..=20_000).map(|k| f64::from(k) / 20_000.0).find(|x| signal(*x) >= u).unwrap_or(1.0);
    compare(&text, 10.0, |u| after(&text, "full thrust") * demand(u));
    assert_eq!((set["motor_kv"], set["motor_poles"]), (570.0, 14.0));
    assert!(text.ends_with("save\n") && (300.0..2000.0).contains(&set["dshot_idle_value"]), "{text}");
}

#[test]
fn crazyflie_reads_it_back() {
    let text = exported("crazyflie", &[]);
    let define = |name: &str| after(&text, &format!("#define {name} "));
    let coefficients: Vec<f64> = (0..4).map(|k| define(&format!("VMOTOR2THRUST{k}"))).collect();
    let least = define("THRUST_MIN");
    let supply = Model::read(&bench().join("model.toml")).polynomial("voltage_v")[0];
    let model = Model::read(&bench().join("model.toml"));
    compare(&text, 5.0, |u| if model.rpm(u) > 0.0 { value(&coefficients, u * supply) } else { 0.0 });
    assert!(least > 0.0 && least < 0.2 * define("THRUST_MAX") && define("THRUST2TORQUE") > 0.0);
    // a model without voltage cannot say it
    let log = std::fs::read_to_string(bench().join("run.csv")).expect("a log").replace("voltage_v", "other_v");
    std::fs::write(bench().join("no-voltage.csv"), log).expect("a log");
    call(&bench(), &["--quiet", "identify", "no-voltage.csv", "-o", "no-voltage.toml"]).succeeded();
    call(&bench(), &["export", "no-voltage.toml", "--to", "crazyflie", "-o", "x.h"]).refused(&[
        "no-voltage.toml",
        "no voltage",
        "expected",
    ]);
    assert!(!bench().join("x.h").exists());
}

#[test]
fn simulink_and_the_table_read_back() {
    let text = exported("simulink", &[]);
    let field = |name: &str| -> Vec<f64> {
        let line = text.lines().find(|l| l.starts_with(&format!("powerplant.{name} = "))).unwrap_or_else(|| panic!("{name}"));
        let inside = line.split('[').nth(1).and_then(|t| t.split(']').next()).unwrap_or_default();
        inside.split_whitespace().map(|v| v.parse().expect("a number")).collect()
    };
    let (signal, thrust) = (field("signal"), field("thrust_n"));
    assert_eq!((signal.len(), thrust.len(), field("torque_nm").len()), (101, 101, 101));
    compare(&text, 0.01, |u| thrust[(u * 100.0).round() as usize]);
    // identify holds no lag, and says so
    assert!(after(&text, "powerplant.tau_s =") == 0.0 && text.contains("the model holds no lag"), "{text}");
    let table = exported("csv", &[]);
    let rows: Vec<Vec<f64>> = table
        .lines()
        .filter(|l| !l.starts_with('#') && !l.starts_with("pulse_us"))
        .map(|l| l.split(',').map(|c| c.parse().expect("a number")).collect())
        .collect();
    assert!(table.contains("\npulse_us,signal,rpm,thrust_n,torque_nm,current_a,voltage_v\n") && rows.len() == 101);
    compare(&table, 0.01, |u| rows[(u * 100.0).round() as usize][3]);
    // the other columns, of both files, are the model's polynomials of the speed, and the supply its constant
    let model = Model::read(&bench().join("model.toml"));
    let [torque, current, supply] = ["torque_nm", "current_a", "voltage_v"].map(|channel| model.polynomial(channel));
    for k in 20..=100 {
        let krpm = model.rpm(f64::from(k) / 100.0) / 1000.0;
        let row = &rows[k as usize];
        let near = |found: f64, expected: f64, of: f64, what: &str| {
            assert!((found - expected).abs() <= 0.01 * of.abs(), "{what} at row {k}: {found}, the model's {expected}");
        };
        near(row[2] / 1000.0, krpm, krpm, "krpm");
        let torque = value(&torque, krpm) - torque[0]; // less what the cell reads at rest
        near(row[4], torque, torque, "torque");
        near(row[5], value(&current, krpm), value(&current, krpm), "current");
        near(row[6], supply[0], supply[0], "voltage");
        for (column, name) in ["pulse_us", "signal", "rpm", "thrust_n", "torque_nm", "current_a", "voltage_v"].iter().enumerate()
        {
            near(field(name)[k as usize], row[column], row[column], name);
        }
    }
}

/// A lag that the model holds is told as the model tells it; of one that holds none every file says so, and gives no number.
#[test]
fn a_lag_is_told_where_there_is_one() {
    let with_lag = std::fs::read_to_string(bench().join("model.toml")).expect("a model")
        + "\n[[effect]]\nid = \"spinup_lag\"\nchannels = [\"rpm_beam\", \"rpm_opto\", \"rpm_hall\", \"rpm_encoder\"]\nscope = \"rig\"\nshape = [0.08, 0.08, 0.0]\n[effect.amplitude]\n";
    std::fs::write(bench().join("lag.toml"), with_lag).expect("a model");
    let of = |model: &str, peer: &str| call(&bench(), &["export", model, "--to", peer]).succeeded().out;
    for peer in PEERS {
        let text = of("model.toml", peer);
        assert!(text.contains("the model holds no lag") && !text.contains("0.0010 s"), "{peer}: {text}");
        assert!(!of("lag.toml", peer).contains("no lag"), "{peer}");
    }
    assert!(!of("model.toml", "px4").contains("timeConstantUp"));
    for (peer, mark) in [
        ("px4", "timeConstantUp"),
        ("simulink", "powerplant.tau_s ="),
        ("csv", "time constant of the rotor"),
        ("ardupilot", "time constant of the rotor"),
    ] {
        let tau = after(&of("lag.toml", peer), mark);
        assert!((tau - 0.08).abs() < 0.004, "{peer}: {tau} s");
    }
}

/// Battery and delays as each peer has them; the cells are silently ignored by none.
#[test]
fn battery_and_delays_are_told() {
    let more = "\n[[effect]]\nid = \"supply_sag\"\nchannels = [\"voltage_v\"]\nscope = \"rig\"\nshape = []\n[effect.amplitude.voltage_v]\nresistance_ohm = 0.048\n[effect.parameter]\nresistance_ohm = 0.048\n\n[[effect]]\nid = \"channel_delay\"\nchannels = [\"thrust_n\"]\nscope = \"rig\"\nshape = [0.43]\n[effect.amplitude]\n";
    let model = std::fs::read_to_string(bench().join("model.toml")).expect("a model") + more;
    std::fs::write(bench().join("battery.toml"), model).expect("a model");
    let of =
        |peer: &str, more: &[&str]| call(&bench(), &[&["export", "battery.toml", "--to", peer], more].concat()).succeeded().out;
    for peer in PEERS {
        assert_ne!(of(peer, &["--cells", "4"]), of(peer, &[]), "{peer} tells the cells");
        assert!(of(peer, &[]).contains("(--cells)"), "{peer} says what it lacks");
    }
    let keys = px4(&of("px4", &["--cells", "4", "--rig-supply"]));
    assert_eq!((keys["BAT1_N_CELLS"], keys["BAT1_R_INTERNAL"]), (4.0, 0.012));
    // a bench supply's lead is no battery's resistance
    let bench_only = of("px4", &["--cells", "4"]);
    assert!(!px4(&bench_only).contains_key("BAT1_R_INTERNAL") && bench_only.contains("--rig-supply"), "{bench_only}");
    assert!(!px4(&of("px4", &[])).keys().any(|key| key.starts_with("BAT1")));
    let text = of("betaflight", &["--cells", "4"]);
    let set = |key: &str| after(&text, &format!("set {key} ="));
    assert_eq!(
        ["force_battery_cell_count", "vbat_max_cell_voltage", "vbat_min_cell_voltage"].map(set),
        [4.0, 430.0, 330.0],
        "{text}"
    );
    let text = of("crazyflie", &["--cells", "2"]);
    let define = |name: &str| after(&text, &format!("#define {name} "));
    assert_eq!(["DEFAULT_BAT_LOW_VOLTAGE", "DEFAULT_BAT_CRITICAL_LOW_VOLTAGE"].map(define), [6.4, 6.0], "{text}");
    let text = of("simulink", &["--cells", "3"]);
    let field = |name: &str| after(&text, &format!("powerplant.{name} ="));
    let supply = Model::read(&bench().join("model.toml")).polynomial("voltage_v")[0];
    assert_eq!(["cells", "lead_ohm", "latency_s", "meter_delay_s.thrust_n"].map(field), [3.0, 0.048, 0.0, 0.43], "{text}");
    assert!((field("supply_v") / supply - 1.0).abs() < 0.01, "{} V, the model's {supply}", field("supply_v"));
    let text = of("csv", &["--cells", "3"]);
    assert_eq!(after(&text, "battery that will fly:"), 3.0);
    assert_eq!(after(&text, "delay of the rig's meter of thrust_n"), 0.43);
    assert_eq!(after(&text, "resistance of the supply's lead"), 0.048);
}

/// A capacity is told by the caller alone, goes under the key of its peer, and a file without one says that it is not known.
#[test]
fn a_capacity_is_told_in_the_peers_own_key() {
    let told = |peer: &str| exported(peer, &["--capacity", "5200"]);
    for peer in PEERS {
        assert!(exported(peer, &[]).contains("not known (--capacity)"), "{peer} says what it lacks");
        assert!(!told(peer).contains("(--capacity)"), "{peer}");
    }
    assert_eq!(px4(&told("px4"))["BAT1_CAPACITY"], 5200.0);
    for (peer, key) in [
        ("ardupilot", "BATT_CAPACITY,"),
        ("betaflight", "set bat_capacity ="),
        ("crazyflie", "capacity of the battery that will fly"),
        ("simulink", "powerplant.capacity_mah ="),
        ("csv", "capacity of the battery that will fly:"),
    ] {
        assert_eq!(after(&told(peer), key), 5200.0, "{peer}");
    }
    assert!(exported("simulink", &[]).contains("powerplant.capacity_mah = [];"));
    // more than the key of Betaflight takes is not cut short in silence
    let large = exported("betaflight", &["--capacity", "25000"]);
    assert!(!large.contains("set bat_capacity") && large.contains("25000 mAh are more than the 20000"), "{large}");
    for wrong in ["0", "5.2", "lots"] {
        let said = call(&bench(), &["export", "model.toml", "--to", "px4", "--capacity", wrong]);
        assert!(said.status != Some(0) && said.err.contains("--capacity"), "{wrong}: {}", said.err);
    }
}

/// A latency of a rotor that coasts stands beside its lag.
#[test]
fn a_latency_is_told_where_there_is_one() {
    let coasting = "\n[[effect]]\nid = \"spinup_lag\"\nform = \"coasting\"\nchannels = [\"rpm_beam\", \"rpm_opto\", \"rpm_hall\", \"rpm_encoder\"]\nscope = \"rig\"\nshape = [0.04, 0.4, 0.1, 0.015]\n[effect.amplitude]\n";
    let model = std::fs::read_to_string(bench().join("model.toml")).expect("a model") + coasting;
    std::fs::write(bench().join("late.toml"), model).expect("a model");
    for (peer, mark) in [
        ("simulink", "powerplant.latency_s ="),
        ("csv", "latency of the rotor's answer"),
        ("px4", "latency of the rotor's answer"),
    ] {
        let text = call(&bench(), &["export", "late.toml", "--to", peer]).succeeded().out;
        assert_eq!(after(&text, mark), 0.015, "{peer}");
    }
}

/// A model of rows between which the command jumps holds the latency of those rows: every file tells it as theirs, and none as the rotor's.
#[test]
fn a_latency_of_rows_is_not_the_rotors() {
    let folder = bench();
    call(&folder, &["--quiet", "close-loop", "run.csv", "-o", "stepped"]).succeeded();
    let model = std::fs::read_to_string(folder.join("stepped/model.toml")).expect("a model");
    assert!(model.contains("form = \"coasting_of_steps\""), "{model}");
    let of_rows = after(&model, "latency_s =");
    for peer in PEERS {
        let text = call(&folder, &["export", "stepped/model.toml", "--to", peer]).succeeded().out;
        let told = after(&text, "latency of the log's rows");
        assert!((told - of_rows).abs() < 1e-4, "{peer}: {told} s, the model's {of_rows}");
        assert!(!text.contains("the model holds none") && !text.contains("latency of the rotor's answer"), "{peer}: {text}");
        if peer == "simulink" {
            let fields = ["latency_s", "log_latency_s"].map(|name| after(&text, &format!("powerplant.{name} =")));
            assert!(fields[0] == 0.0 && (fields[1] - of_rows).abs() < 1e-4, "{fields:?}");
        }
    }
}

/// A run that ends below full throttle: every file and the terminal say so, and what would be mostly computed is refused.
#[test]
fn what_is_computed_beyond_the_run_is_told() {
    let model = std::fs::read_to_string(bench().join("model.toml")).expect("a model");
    assert!(model.contains("\nhighest_pulse_us = 2000"), "{model}");
    for (name, us) in [("short.toml", "1800"), ("shorter.toml", "1400")] {
        let text = model.replace("\nhighest_pulse_us = 2000", &format!("\nhighest_pulse_us = {us}"));
        std::fs::write(bench().join(name), text).expect("a model");
    }
    for peer in PEERS {
        assert!(!exported(peer, &[]).contains("is computed"), "{peer}: the whole range was measured");
        let said = call(&bench(), &["export", "short.toml", "--to", peer]).succeeded();
        let told = "the run ends at 1800 us, ";
        assert!(
            said.out.contains(told) && said.out.contains("beyond is computed") && said.err.contains(told),
            "{peer}: {said:?}"
        );
        call(&bench(), &["export", "shorter.toml", "--to", peer, "-o", "x"]).refused(&[
            "shorter.toml: the run ends at 1400 us",
            "more than twice that",
            "--extrapolate",
        ]);
        assert!(!bench().join("x").exists());
        let said = call(&bench(), &["export", "shorter.toml", "--to", peer, "--extrapolate", "-o", "y"]).succeeded();
        assert!(said.out.contains("the run ends at 1400 us, "), "{peer}: {said:?}");
    }
}

/// A load cell that nobody tared: its zero is no thrust, whichever command made the model.
#[test]
fn the_zero_of_the_load_cell_is_no_thrust() {
    let folder = bench();
    let log = std::fs::read_to_string(folder.join("run.csv")).expect("a log");
    let column = log.lines().find(|l| l.starts_with("t_s,")).and_then(|h| h.split(',').position(|c| c == "thrust_n"));
    let column = column.expect("a thrust");
    let shifted = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if let Some(thrust) = cells.get_mut(column).filter(|_| !line.starts_with('#'))
            && let Ok(read) = thrust.parse::<f64>()
        {
            *thrust = (read - 2.4).to_string();
        }
        cells.join(",") + "\n"
    };
    std::fs::write(folder.join("untared.csv"), log.lines().map(shifted).collect::<String>()).expect("a log");
    call(&folder, &["--quiet", "identify", "untared.csv", "-o", "untared.toml"]).succeeded();
    let full = |model: &str| after(&call(&folder, &["export", model, "--to", "px4"]).succeeded().out, "full thrust");
    let (tared, untared) = (full("model.toml"), full("untared.toml"));
    assert!((untared / tared - 1.0).abs() < 1e-3, "{untared} N, tared {tared}");
}

/// Every file links to its peer's definition, twice gives the same bytes, and a file is written whole.
#[test]
fn every_peer_has_its_links() {
    let page = std::fs::read_to_string(root().join("docs/export.md")).expect("docs/export.md");
    for peer in PEERS {
        let text = exported(peer, &[]);
        let links: Vec<&str> =
            text.split_whitespace().filter(|w| w.starts_with("https://")).map(|w| w.trim_end_matches(',')).collect();
        assert!(!links.is_empty(), "{peer}");
        for link in links {
            assert!(page.contains(link), "docs/export.md lacks {link} of {peer}");
        }
        call(&bench(), &["--quiet", "export", "model.toml", "--to", peer, "-o", "out"]).succeeded();
        assert_eq!(std::fs::read_to_string(bench().join("out")).expect("a file"), text, "{peer}");
    }
    call(&bench(), &["export", "run.csv", "--to", "px4"]).refused(&["run.csv:", "expected"]);
    call(&bench(), &["export", "model.toml", "--to", "px4", "-o", "model.toml"]).refused(&["model.toml: is an input"]);
}

/// Each row is what the rotor settles at: torque and current of a rotor that has inertia climb with the pulse, without a spike where it starts.
#[test]
fn a_rotor_with_inertia_is_told_as_it_settles() {
    let folder = bench();
    call(&folder, &["--quiet", "close-loop", "run.csv", "-o", "closed"]).succeeded();
    let model = std::fs::read_to_string(folder.join("closed/model.toml")).expect("a model");
    assert!(model.contains("rotor_inertia"), "the run names the rotor's inertia");
    let table = call(&folder, &["export", "closed/model.toml", "--to", "csv"]).succeeded().out;
    let rows: Vec<Vec<f64>> = table
        .lines()
        .filter(|l| l.starts_with(|c: char| c.is_ascii_digit()))
        .map(|l| l.split(',').filter_map(|v| v.parse().ok()).collect())
        .collect();
    assert_eq!(rows.len(), 101, "{table}");
    for (column, name) in [(4, "torque"), (5, "current")] {
        let falls = rows.windows(2).find(|w| w[1][column] < w[0][column] - 1e-3 * rows[100][column]);
        assert!(falls.is_none(), "{name} falls: {falls:?}");
    }
}

/// The curve is that of the supply as the run began: how long it takes to work the curve out draws no charge.
#[test]
fn no_charge_is_drawn_while_the_curve_is_worked_out() {
    let folder = bench();
    let more = "\n[[effect]]\nid = \"battery_discharge\"\nchannels = [\"voltage_v\", \"current_a\", \"rpm_beam\", \"rpm_opto\", \"rpm_hall\", \"rpm_encoder\"]\nform = \"straight\"\nscope = \"rig\"\nshape = [0.06]\n[effect.amplitude.voltage_v]\nslope_v_per_ah = 1.1\n";
    let model = std::fs::read_to_string(folder.join("model.toml")).expect("a model");
    std::fs::write(folder.join("drawn.toml"), model + more).expect("a model");
    let thrusts = |model: &str| -> Vec<String> {
        let table = call(&folder, &["export", model, "--to", "csv"]).succeeded().out;
        let rows = table.lines().filter(|l| l.starts_with(|c: char| c.is_ascii_digit()));
        rows.map(|l| l.split(',').nth(3).unwrap_or_default().to_owned()).collect()
    };
    let (fresh, drawn) = (thrusts("model.toml"), thrusts("drawn.toml"));
    assert_eq!(fresh.len(), 101);
    assert_eq!(fresh, drawn);
    assert!(
        call(&folder, &["export", "drawn.toml", "--to", "px4"]).succeeded().out.contains("supply and motor as the run began")
    );
}
