//! Malformed input of every kind, in one table: logs, models, scenarios, missions, schedules, configurations, calibrations, arguments, outputs.
//!
//! What it is: each case is a call that must end with status 1 and one line, which says where, what, and what was expected; what lay in the
//! folder before lies there after, byte for byte, and nothing else.
//! What can go wrong: a fault that is accepted, a place that is wrong, an input that is written over, a file that is left behind.
//! Units: as the columns and keys state.
//! Reference: specification `formats.md`; docs/errors.md.

use quadrig_tests::bench::{Bench, HEAD, good_log};
use std::collections::BTreeMap;
use std::path::Path;

/// One malformed input, and a call that meets it.
struct Case {
    name: &'static str,
    /// The file that is wrong, and what stands in it; none where the call itself is.
    file: Option<(&'static str, Vec<u8>)>,
    words: &'static str,
    /// What the line must hold beside what was expected.
    said: &'static [&'static str],
}

fn with(
    name: &'static str,
    file: &'static str,
    text: impl Into<Vec<u8>>,
    words: &'static str,
    said: &'static [&'static str],
) -> Case {
    Case { name, file: Some((file, text.into())), words, said }
}

fn alone(name: &'static str, words: &'static str, said: &'static [&'static str]) -> Case {
    Case { name, file: None, words, said }
}

/// Files of another kind than the command takes: each refusal names what takes or makes them.
fn kinds() -> Vec<Case> {
    const ATTITUDE: &str = "t_s,qw,qx,qy,qz,roll_deg,pitch_deg,yaw_deg\n0.005,1,0,0,0,0,0,0\n0.010,1,0,0,0,0,0,0\n";
    const OF_ANOTHER: &str = "t_s,gyro.x,gyro.y,gyro.z,acc.x,acc.y,acc.z\n0,0,0,0,0,0,1\n0.01,0,0,0,0,0,1\n";
    const READINGS: &str = "t_s,gx,gy,gz,ax,ay,az\n0.005,0,0,0,0,0,-9.8\n0.010,0,0,0,0,0,-9.8\n";
    const FLIGHT: &str = "# quadrig-flight 1\nt_s,pulse_us_1,rpm_1\n0.0,1500,4000\n0.1,1500,4000\n";
    const INERTIAL: &str = "format = \"quadrig-inertial 1\"\nsource = \"run.csv\"\nspan_s = [0.0, 1.0]\nsensor = []\n";
    const OF_A_FLIGHT: &str = "format = \"quadrig-flight-model 1\"\n";
    let seconds: String = (0..400).map(|n| format!("{},{},{}\n", 1000 * n, 1000 + n, 10 * n)).collect();
    let bare = format!("Time,ESC signal (us),Motor Optical Speed (RPM)\n{seconds}");
    let named = format!("Time (s),ESC signal (us),Motor Optical Speed (RPM)\n{seconds}");
    vec![
        with(
            "an attitude to close the loop on",
            "bad.csv",
            ATTITUDE,
            "close-loop bad.csv -o out",
            &["bad.csv:1:1", "--readings READINGS"],
        ),
        with(
            "a model to close the loop on",
            "bad.toml",
            "format = \"quadrig-model 1\"\nsource = \"run.csv\"\n\n[channel.thrust_n]\nrelation = \"thrust(rpm), quadratic\"\n",
            "close-loop bad.toml -o out",
            &["bad.toml:1:1: a model", "`--model`"],
        ),
        with(
            "a scenario to identify",
            "bad.toml",
            "schedule = { kind = \"steps\", steps = [{ pulse_us = 1300, hold_s = 5 }] }\n",
            "identify bad.toml -o out.toml",
            &["bad.toml:1:1: a TOML file", "`quadrig sim SCENARIO.toml -o LOG`"],
        ),
        with(
            "a scenario to import",
            "bad.toml",
            "seed = 3\nname = \"x\"\n",
            "import bad.toml -o out.csv",
            &["bad.toml:1:1: a TOML file"],
        ),
        with(
            "a verdict to close the loop on",
            "bad.json",
            "{\n  \"format\": \"quadrig-verdict 2\",\n  \"run\": \"run.csv\"\n}\n",
            "close-loop bad.json -o out",
            &["bad.json:1:1: a verdict"],
        ),
        with(
            "a page to identify",
            "bad.html",
            "<!doctype html>\n<html><p>a, b</p></html>\n",
            "identify bad.html -o out.toml",
            &["bad.html:1:1: a web page"],
        ),
        alone(
            "a log to configure a board",
            "rig --port sim --speed 0 configure good.csv",
            &["good.csv:1:1: a log; expected a board's configuration"],
        ),
        with(
            "an export to configure a board",
            "bad",
            "Time (s),Thrust (N),Speed\n0,1,2\n",
            "rig --port sim --speed 0 configure bad",
            &["bad:1:1: a table of values"],
        ),
        alone(
            "a log in the place of a schedule",
            "rig --port sim --speed 0 run good.csv -o out.csv",
            &["good.csv:1:1: a log; expected a schedule", "--next takes a verdict"],
        ),
        alone(
            "a model in the place of a schedule",
            "rig --port sim --speed 0 run model.toml -o out.csv",
            &["model.toml:1:1: a model; expected a schedule"],
        ),
        with(
            "a verdict in the place of a calibration",
            "bad.json",
            "{\n  \"format\": \"quadrig-verdict 2\"\n}\n",
            "recalibrate good.csv --with bad.json -o out.csv",
            &["bad.json:1:1: a verdict; expected a file of `quadrig calibrate`"],
        ),
        alone(
            "a folder of runs that is not there",
            "batch nowhere -o out",
            &["nowhere: no folder of this name is there; expected a folder"],
        ),
        alone(
            "a run in the place of a folder",
            "batch good.csv -o out",
            &["good.csv: no folder of this name is there", "`quadrig close-loop`"],
        ),
        with("an attitude to identify", "bad.csv", ATTITUDE, IDENTIFY, &["bad.csv:1:1", "--readings READINGS"]),
        with("an attitude to filter", "bad.csv", ATTITUDE, "ahrs bad.csv out.csv", &["bad.csv:1:", "--readings READINGS"]),
        with("readings to identify", "bad.csv", READINGS, IDENTIFY, &["bad.csv:1:1: readings of an IMU", "`quadrig close-loop`"]),
        with(
            "another program's flight",
            "bad.csv",
            OF_ANOTHER,
            "close-loop bad.csv -o out",
            &["bad.csv:1:1: a flight", "`quadrig import"],
        ),
        with("a flight to identify", "bad.csv", FLIGHT, IDENTIFY, &["bad.csv:1", "a flight: `quadrig close-loop` takes it"]),
        with(
            "a flight to step through",
            "bad.csv",
            FLIGHT,
            "step residual bad.csv",
            &["a flight: `quadrig close-loop` takes it"],
        ),
        with(
            "a flight's model to export",
            "bad.toml",
            OF_A_FLIGHT,
            "export bad.toml --to px4 -o out",
            &["bad.toml:1", "`quadrig predict`", "for another flight"],
        ),
        with(
            "an attitude's model to export",
            "bad.toml",
            INERTIAL,
            "export bad.toml --to px4 -o out",
            &["bad.toml:1", "for its own recording"],
        ),
        with(
            "a time of a thousand",
            "bad.csv",
            bare,
            "import bad.csv -o out.csv",
            &[
                "rows 1000 apart: microseconds (a row each 0.001 s) or milliseconds (a row each 1 s)?",
                "--map 't_s=Time*0.000001'",
            ],
        ),
        with(
            "seconds of a thousand",
            "bad.csv",
            named,
            "import bad.csv -o out.csv",
            &["rows 1000 s apart", "*0.000001 microseconds"],
        ),
    ]
}

/// The good log, its rows changed.
fn rows(change: impl Fn(Vec<String>) -> Vec<String>) -> String {
    let text = good_log();
    let lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let (head, rows) = lines.split_at(HEAD);
    [head.to_vec(), change(rows.to_vec())].concat().join("\n") + "\n"
}

fn row(n: usize, change: impl Fn(&str) -> String) -> String {
    rows(|mut rows| {
        rows[n] = change(&rows[n]);
        rows
    })
}

fn times(change: impl Fn(f64) -> String) -> String {
    let changed = |row: &String| {
        let (t, rest) = row.split_once(',').expect("a row has commas");
        format!("{},{rest}", change(t.parse().expect("a time")))
    };
    rows(|rows| rows.iter().map(changed).collect())
}

const IDENTIFY: &str = "identify bad.csv -o out.toml";

fn logs() -> Vec<Case> {
    let head = |from: &str, to: &str| good_log().replacen(from, to, 1);
    let shuffled = rows(|rows| (0..rows.len()).map(|n| rows[n * 131 % rows.len()].clone()).collect());
    let twice = rows(|rows| [rows.clone(), rows].concat());
    vec![
        with(
            "line ends of carriage returns",
            "bad.csv",
            good_log().replace('\n', "\r"),
            IDENTIFY,
            &["bad.csv:1: lines that end with a carriage return alone"],
        ),
        with("shuffled rows", "bad.csv", shuffled, IDENTIFY, &["bad.csv:8: column t_s", "rows look shuffled, sort them by t_s"]),
        with("two runs in one", "bad.csv", twice, IDENTIFY, &["bad.csv:424: column t_s: 0 steps back from 41.9", "a second run"]),
        with(
            "every fifth row dropped",
            "bad.csv",
            rows(|rows| rows.into_iter().enumerate().filter(|(n, _)| n % 5 != 2).map(|(_, r)| r).collect()),
            IDENTIFY,
            &["bad.csv:5: column t_s: 84 of the 420 rows are missing", "rows were dropped"],
        ),
        with(
            "a fifth of the rows dropped",
            "bad.csv",
            rows(|rows| rows.into_iter().enumerate().filter(|(n, _)| n * 7919 % 97 >= 20).map(|(_, r)| r).collect()),
            "close-loop bad.csv -o out",
            &["bad.csv:7: column t_s", "rows are missing that sample_hz = 10 promises"],
        ),
        with(
            "the third fifth dropped",
            "bad.csv",
            rows(|rows| [&rows[..168], &rows[252..]].concat()),
            "plateaus bad.csv",
            &["bad.csv:171: column t_s: 84 of the 420 rows", "in one hole"],
        ),
        with(
            "thinned without a word",
            "bad.csv",
            rows(|rows| rows.into_iter().step_by(2).collect()),
            "step residual bad.csv",
            &["bad.csv:4: column t_s: 209 of the 419 rows"],
        ),
        with(
            "milliseconds",
            "bad.csv",
            times(|t| format!("{:.0}", 1000.0 * t)),
            IDENTIFY,
            &["bad.csv:4: column t_s: rows 100 s apart", "these look like milliseconds: divide t_s by 1000"],
        ),
        with(
            "microseconds",
            "bad.csv",
            times(|t| format!("{:.0}", 1e6 * t)),
            "predict model.toml bad.csv -o out.csv",
            &["these look like microseconds"],
        ),
        with(
            "milliseconds without a rate",
            "bad.csv",
            times(|t| format!("{:.0}", 1000.0 * t)).replace("# sample_hz = 10.0\n", ""),
            IDENTIFY,
            &["bad.csv:3: column t_s: whole numbers, 100 apart", "milliseconds"],
        ),
        with("a rate in words", "bad.csv", head("10.0", "\"ten\""), IDENTIFY, &["bad.csv:1: sample_hz = \"ten\""]),
        with(
            "semicolons",
            "bad.csv",
            good_log().replace(',', ";"),
            IDENTIFY,
            &["bad.csv:3: semicolons between the columns", "`quadrig import`"],
        ),
        with("tabs", "bad.csv", good_log().replace(',', "\t"), IDENTIFY, &["bad.csv:3: tabs between the columns"]),
        with("decimal commas", "bad.csv", good_log().replace('.', ","), IDENTIFY, &["bad.csv:4: ", "decimal points"]),
        with("bytes", "bad.csv", (0..=255_u8).cycle().take(4096).collect::<Vec<u8>>(), IDENTIFY, &["bad.csv"]),
        with("nothing", "bad.csv", "", IDENTIFY, &["bad.csv"]),
        with("no rows", "bad.csv", rows(|_| Vec::new()), IDENTIFY, &["bad.csv:", "no data rows"]),
        with("another version", "bad.csv", head("log 1", "log 9"), IDENTIFY, &["bad.csv:1: '# quadrig-log 9'"]),
        with(
            "time is not first",
            "bad.csv",
            head("t_s,pulse_us", "pulse_us,t_s"),
            IDENTIFY,
            &["bad.csv:3: column pulse_us: not the time column"],
        ),
        with("a column twice", "bad.csv", head("current_a", "rpm"), IDENTIFY, &["bad.csv:3: column rpm: it stands twice"]),
        with("a column without a name", "bad.csv", head("current_a", ""), IDENTIFY, &["bad.csv:3: column 5 has no name"]),
        with(
            "grams",
            "bad.csv",
            head("thrust_n", "thrust_g"),
            IDENTIFY,
            &["bad.csv:3: column thrust_g", "thrust_n; convert the values"],
        ),
        with(
            "milliamperes",
            "bad.csv",
            head("current_a", "current_ma"),
            IDENTIFY,
            &["bad.csv:3: column current_ma", "current_a"],
        ),
        with(
            "pulses in ms",
            "bad.csv",
            row(100, |row| row.replacen(",1200.0,", ",1.2,", 1).replacen(",1350.0,", ",1.35,", 1)),
            IDENTIFY,
            &["bad.csv:104: column pulse_us: 1.2", "500 to 2500 us"],
        ),
        with(
            "not a number",
            "bad.csv",
            row(50, |row| row.replacen(",1000.0,", ",NaN,", 1)),
            IDENTIFY,
            &["bad.csv:54: column pulse_us: 'NaN'"],
        ),
        with(
            "a column whose name has no end",
            "bad.csv",
            head("current_a", &"x".repeat(66_000)),
            IDENTIFY,
            &["bad.csv:3: column xxx", "a name of 66000 characters", "200 at most"],
        ),
        with(
            "an export's column whose name has no end",
            "bad.csv",
            good_log().lines().skip(2).map(|line| line.replace("current_a", &"x".repeat(66_000)) + "\n").collect::<String>(),
            IDENTIFY,
            &["bad.csv:1: column xxx", "a name of 66000 characters"],
        ),
        with(
            "a number whose digits have no end",
            "bad.csv",
            row(60, |row| {
                let fields = row.split(',').enumerate();
                let long = |(k, field): (usize, &str)| if k == 1 { "9".repeat(100_000) } else { field.to_owned() };
                fields.map(long).collect::<Vec<String>>().join(",")
            }),
            IDENTIFY,
            &["bad.csv:64: column pulse_us: '99999", "999...'"],
        ),
        with("a word", "bad.csv", row(60, |row| format!("{}x", row)), IDENTIFY, &["bad.csv:64: column voltage_v: '"]),
        with(
            "a row cut short",
            "bad.csv",
            row(70, |row| row[..row.len() - 8].to_owned()),
            IDENTIFY,
            &["bad.csv:74: column voltage_v: the row ends before it"],
        ),
        with("a field too many", "bad.csv", row(70, |row| format!("{row},1")), IDENTIFY, &["bad.csv:74: 7 fields"]),
        with(
            "a time without a value",
            "bad.csv",
            row(80, |row| row[row.find(',').expect("a comma")..].to_owned()),
            IDENTIFY,
            &["bad.csv:84: column t_s: an empty field"],
        ),
        with(
            "a time twice",
            "bad.csv",
            row(80, |row| row.replacen("8.0,", "7.9,", 1)),
            IDENTIFY,
            &["bad.csv:84: column t_s: 7.9 repeats the row before"],
        ),
        with(
            "a time that steps back",
            "bad.csv",
            row(80, |row| row.replacen("8.0,", "7.0,", 1)),
            IDENTIFY,
            &["bad.csv:84: column t_s: 7 steps back from 7.9", "one row steps back"],
        ),
        with("two rows", "bad.csv", rows(|rows| rows[..2].to_vec()), IDENTIFY, &["bad.csv", "more than 8 common samples"]),
        with(
            "channels without values",
            "bad.csv",
            rows(|rows| rows.iter().map(|r| format!("{},,,,,", r.split(',').next().expect("a time"))).collect()),
            IDENTIFY,
            &["bad.csv"],
        ),
        alone("a log that is not there", "close-loop nowhere.csv", &["nowhere.csv: cannot be read", "check name and folder"]),
        alone("a folder in the place of a log", "identify . -o out.toml", &[".: "]),
        with(
            "an attitude log in the place of a rig log",
            "bad.csv",
            "t_s,gx,gy,gz,ax,ay,az\n0,0,0,0,0,0,9.8\n",
            IDENTIFY,
            &["bad.csv"],
        ),
        alone("a rig log in the place of an attitude log", "ahrs good.csv out.csv", &["good.csv:3: ", "gx,gy,gz"]),
        with(
            "an attitude log without its accelerometer",
            "bad.csv",
            "t_s,gx,gy,gz,ax,ay\n0,0,0,0,0,0\n",
            "ahrs bad.csv out.csv",
            &["bad.csv:1: ", "ax,ay,az"],
        ),
        with(
            "attitude times that step back",
            "bad.csv",
            "t_s,gx,gy,gz,ax,ay,az\n0,0,0,0,0,0,9.8\n1,0,0,0,0,0,9.8\n0.5,0,0,0,0,0,9.8\n",
            "ahrs bad.csv out.csv",
            &["bad.csv:4: column t_s: 0.5 does not come after 1"],
        ),
        with(
            "a table of pairs with a word",
            "bad.csv",
            "motor,propeller,thrust_n,current_a\nA,B,x,1\n",
            "select bad.csv",
            &["bad.csv:2: column thrust_n: 'x'"],
        ),
    ]
}

fn models() -> Vec<Case> {
    const PREDICT: &str = "predict bad.toml good.csv -o out.csv";
    vec![
        alone(
            "a log in the place of a model",
            "predict good.csv good.csv -o out.csv",
            &["good.csv:1:1: a log", "a model written by `quadrig identify`"],
        ),
        alone("a log to export", "export good.csv --to px4 -o out", &["good.csv:1:1: a log; expected a model", "identify"]),
        alone("a log to predict from", "predict full/notes.csv good.csv -o out.csv", &["full/notes.csv:1:1: a table of values"]),
        alone("a log for a watch", "log --port sim --speed 0 --model good.csv -o out.csv", &["good.csv:1:1: a log"]),
        alone("a model that is not there", "close-loop good.csv --model nowhere.toml", &["nowhere.toml: cannot be read"]),
        with("a model of another format", "bad.toml", "format = \"mine 1\"\n", PREDICT, &["bad.toml"]),
        with("a model cut short", "bad.toml", "format = \"quadrig-model 1\"\n[channel.rpm", PREDICT, &["bad.toml:2"]),
        with(
            "a flight that is no flight",
            "bad.toml",
            "duration_s = 2\n",
            "fly bad.toml --model good.csv",
            &["good.csv:1:1: a log"],
        ),
    ]
}

fn scenarios() -> Vec<Case> {
    const SIM: &str = "sim bad.toml -o out.csv";
    let case = |name, text: &str, said| with(name, "bad.toml", text, SIM, said);
    vec![
        case("no TOML", "seed = \n", &["bad.toml:1:8: "]),
        case("a key that is none", "seed = 1\nmoter = \"570KV\"\n", &["bad.toml:2:1: unknown field `moter`", "`motor`"]),
        case("a key twice", "seed = 1\nseed = 2\n", &["bad.toml:2:1: duplicate key"]),
        case("a seed below 0", "\nseed = -1\n", &["bad.toml:2:8: seed: ", "a whole number from 0"]),
        case("a motor that is none", "motor = \"571KV\"\n", &["bad.toml:1:9: motor: ", "570KV"]),
        case("a rate that does not divide", "[log]\nrate_hz = 7\n", &["bad.toml:2:11: rate_hz: ", "divides 1000, found 7"]),
        case(
            "a hold below 0",
            "[schedule]\nkind = \"staircase\"\nstep_us = 50\nhold_s = -3\ntop_us = 2000\n",
            &["bad.toml:4:10: hold_s: ", "found -3"],
        ),
        case(
            "a hold without an end",
            "[schedule]\nkind = \"steps\"\nsteps = [\n  { pulse_us = 1200, hold_s = 5 },\n  { pulse_us = 1500, hold_s = 1e9 },\n]\n",
            &["bad.toml:5:31: hold_s: ", "up to 86400 s"],
        ),
        case(
            "a pulse in per cent",
            "[schedule]\nkind = \"steps\"\nsteps = [\n  { pulse_us = 1200, hold_s = 5 },\n  { pulse_us = 7.5, hold_s = 5 },\n]\n",
            &["bad.toml:5:16: pulse_us: ", "1000 to 2000 us, found 7.5"],
        ),
        case("no steps", "[schedule]\nkind = \"steps\"\nsteps = []\n", &["bad.toml:3:9: steps: ", "at least one step"]),
        case(
            "a schedule of no kind",
            "[schedule]\nkind = \"stairs\"\n",
            &["bad.toml:2:8: kind: unknown variant `stairs`", "`staircase`"],
        ),
        case(
            "a schedule without its step",
            "seed = 1\n[schedule]\nkind = \"staircase\"\nhold_s = 3\ntop_us = 2000\n",
            &["bad.toml:2:1: missing field `step_us`"],
        ),
        case(
            "a schedule file that is not there",
            "schedule = { kind = \"file\", file = \"nowhere.toml\" }\n",
            &["nowhere.toml: cannot be read"],
        ),
        case(
            "an effect that is none",
            "seed = 1\n[[effect]]\nid = \"gremlin\"\n",
            &["bad.toml:3:6: id: unknown variant `gremlin`", "`supply_sag`"],
        ),
        case(
            "an effect without its size",
            "\n[[effect]]\nid = \"supply_sag\"\n",
            &["bad.toml:2:1: missing field `resistance_ohm`"],
        ),
        case(
            "an effect with a word for its size",
            "[[effect]]\nid = \"supply_sag\"\nresistance_ohm = \"much\"\n",
            &["bad.toml:3:18: resistance_ohm: ", "a number"],
        ),
        case(
            "no cells",
            "[supply]\nkind = \"lipo\"\ncells = 0\ncapacity_ah = 4\nresistance_ohm = 0.01\n",
            &["bad.toml:3:9: cells: ", "1 to 14"],
        ),
        case(
            "a lead of less than nothing",
            "[[effect]]\nid = \"supply_sag\"\nresistance_ohm = -0.08\n",
            &["bad.toml:3:18: resistance_ohm: ", "from 0 to 100 ohm, found -0.08"],
        ),
        case(
            "a blade that lost more than all",
            "[[effect]]\nid = \"blade_damage\"\nthrust_change = -1.5\ntorque_change = 0.1\nt0_s = 3\n",
            &["bad.toml:3:17: thrust_change: ", "above -1 (all of it) to 10, found -1.5"],
        ),
        case(
            "a blade that breaks after the run",
            "[[effect]]\nid = \"blade_damage\"\nthrust_change = -0.1\ntorque_change = 0.1\nt0_s = 4000\n",
            &["bad.toml:5:8: t0_s: ", "within the run, before 332 s, found 4000"],
        ),
        case("a rest that is no number", "rest_s = nan\n", &["bad.toml:1:10: rest_s: "]),
        case(
            "a run that the firmware stops",
            "[schedule]\nkind = \"steps\"\nsteps = [{ pulse_us = 2000, hold_s = 5 }]\n[[effect]]\nid = \"supply_sag\"\nresistance_ohm = 3.0\n",
            &["the rig stopped itself while it was running", "under-voltage"],
        ),
        with(
            "a scenario of the other board",
            "bad.toml",
            "[imu]\n",
            "isolability bad.toml",
            &["bad.toml: describes the IMU board"],
        ),
        alone(
            "a model to simulate",
            "sim model.toml -o out.csv",
            &["model.toml:1:1: a model (quadrig-model", "docs/scenario.md"],
        ),
        alone("a model to loop", "loop model.toml -o out", &["model.toml:1:1: a model"]),
        alone("a model for a virtual board", "virtual model.toml --seconds 1", &["model.toml:1:1: a model"]),
        alone("a model to isolate causes of", "isolability model.toml -o out", &["model.toml:1:1: a model"]),
        alone("a model to fly", "fly model.toml -o out", &["model.toml:1:1: a model", "`--model`"]),
        with(
            "a scenario of bytes",
            "bad.toml",
            [0xFF_u8, 0xFE, 0x00, 0x81],
            SIM,
            &["bad.toml:1:1: bytes that are no text", "TOML"],
        ),
        alone("a scenario that is not there", "loop nowhere.toml", &["nowhere.toml: cannot be read"]),
        with(
            "a board's configuration",
            "bad.toml",
            std::fs::read(quadrig_tests::root().join("examples/rig/thesis.toml")).expect("a preset"),
            SIM,
            &["bad.toml:1:1: the configuration of a board", "examples/thin-lead.toml"],
        ),
        alone("a log in the place of pins", "sim empty.toml --replay good.csv -o out.csv", &["good.csv", "quadrig pins"]),
    ]
}

/// Another kind than was wanted, in plain words: no type of the program's own.
fn plain_words() -> Vec<Case> {
    const SIM: &str = "sim bad.toml -o out.csv";
    const CONFIGURE: &str = "rig --port sim --speed 0 configure bad.toml";
    const NEXT: &str = "rig --port sim --speed 0 run --next bad.json -o out.csv";
    let web = "<!doctype html><html><head><title>404</title></head><body>Not Found</body></html>\n";
    vec![
        with("a supply that is a number", "bad.toml", "supply = 12\n", SIM, &["bad.toml:1:10: supply: ", "expected a table"]),
        with("an ESC that is a word", "bad.toml", "esc = \"x\"\n", SIM, &["bad.toml:1:7: esc: a text", "expected a table"]),
        with(
            "a controller that is a number",
            "bad.toml",
            "duration_s = 2\ncontroller = 5\n",
            "fly bad.toml -o out",
            &["bad.toml:2:14: controller: ", "expected a table"],
        ),
        with(
            "a limit that is a number",
            "bad.toml",
            "[limits]\nspeed_rpm = 5\n",
            CONFIGURE,
            &["bad.toml:2:13: ", "expected a table"],
        ),
        with("a rate that is a word", "bad.toml", "rate_hz = \"x\"\n", CONFIGURE, &["bad.toml:1:11: ", "expected a"]),
        with(
            "a step above the whole range",
            "bad.toml",
            "[schedule]\nkind = \"staircase\"\nstep_us = 50000\nhold_s = 3\ntop_us = 2000\n",
            SIM,
            &["bad.toml:3:11: step_us: ", "above 0 and up to 1000 us, found 50000"],
        ),
        with(
            "a fault that ends before it begins",
            "bad.toml",
            "[[fault]]\nid = \"link_lost\"\nfrom_s = 5\nuntil_s = 3\n",
            SIM,
            &["bad.toml:4:11: until_s: ", "after from_s = 5, found 3"],
        ),
        with(
            "an unknown key with a list",
            "bad.toml",
            "duration_s = 2\n[wind]\nmean_m_s = [3, 0, 0]\n[[command]]\nrotors = [1, 2, 3, 4]\nsteps = [{ pulse_us = 1700, hold_s = 2 }]\n",
            "fly bad.toml -o out",
            &["bad.toml:3:1: unknown field `mean_m_s`"],
        ),
        alone(
            "a model in the place of a verdict",
            "rig --port sim --speed 0 run --next model.toml -o out.csv",
            &["model.toml:1:", "no verdict, which is JSON", "verdict.json of `quadrig close-loop"],
        ),
        with(
            "a verdict cut short",
            "bad.json",
            "{\"next_experiment\": {",
            NEXT,
            &["bad.json:1:", "ends in the midst", "cut short?"],
        ),
        with("a verdict with a comma too many", "bad.json", "{\"a\": 1,,}", NEXT, &["bad.json:1:", "no JSON from here on"]),
        with(
            "a verdict with a word for its schedule",
            "bad.json",
            "{\"next_experiment\": {\"why\": \"x\", \"schedule\": \"y\"}}",
            NEXT,
            &["bad.json:1:", "expected a list in brackets"],
        ),
        alone(
            "a mapping for a rig log",
            "identify good.csv -o out.toml --map thrust_n=x",
            &["good.csv is a rig log", "no --map"],
        ),
        with("a web page", "bad.csv", web, IDENTIFY, &["bad.csv:1:1: a web page", "was a link saved"]),
        with("a web page for a scenario", "bad.toml", web, SIM, &["bad.toml:1:1: a web page", "a description in TOML"]),
        alone("a folder for pairs", "select full", &["full: is a folder", "rig logs, exports or tables", "full/*.csv"]),
        alone("a staircase that is never climbed", "rig --port sim --speed 0 run --step 0 -o out.csv", &["--step 0: "]),
        with(
            "a pair twice",
            "bad.csv",
            "motor,propeller,thrust_n,current_a\nA,B,3,1\nA,B,4,1\n",
            "select bad.csv",
            &["bad.csv:3: 'A' with 'B' stands on line 2, too", "each pair once"],
        ),
    ]
}

/// Readings that no rig has.
fn impossible() -> Vec<Case> {
    let column = |k: usize, of: &dyn Fn(&str) -> String| {
        let changed = |row: &String| {
            let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
            cells[k] = of(&cells[k]);
            cells.join(",")
        };
        rows(|rows| rows.iter().map(changed).collect())
    };
    let turned = column(3, &|thrust| format!("{:.4}", -thrust.parse::<f64>().expect("a number")));
    let unseen = column(2, &|_| "0".to_owned());
    let holed = rows(|mut rows| {
        rows.drain(200..300);
        rows
    });
    // an export of another program: rows of an even clock are gone here and there
    let thinned: String = good_log()
        .lines()
        .skip(2)
        .enumerate()
        .filter(|(n, _)| *n == 0 || (n * n + n / 7) % 4 != 3)
        .map(|(_, line)| line.replacen("t_s", "Time (s)", 1) + "\n")
        .collect();
    vec![
        with("thrust of the other sign", "bad.csv", turned, IDENTIFY, &["bad.csv:3: column thrust_n: ", "the other way round?"]),
        with("a rotor that no sensor sees", "bad.csv", unseen, IDENTIFY, &["column rpm: 0 rev/min on every sensor", "A"]),
        with(
            "a thrust without measure",
            "bad.csv",
            row(80, |row| {
                let mut cells: Vec<&str> = row.split(',').collect();
                cells[3] = "1e308";
                cells.join(",")
            }),
            IDENTIFY,
            &["bad.csv:84: column thrust_n: '1e308'", "a number that a sensor can read"],
        ),
        with(
            "no rows a second",
            "bad.csv",
            good_log().replacen("sample_hz = 10.0", "sample_hz = 0", 1),
            IDENTIFY,
            &["bad.csv:1: sample_hz = 0", "above 0"],
        ),
        with(
            "a hole in the midst",
            "bad.csv",
            holed,
            IDENTIFY,
            &["bad.csv:203: column t_s: 100 of the ", "in one hole, from 19.9 s on"],
        ),
        with(
            "an export with a quarter of its rows gone",
            "bad.csv",
            thinned,
            IDENTIFY,
            &["bad.csv: t_s: ", "use the whole export"],
        ),
    ]
}

fn missions() -> Vec<Case> {
    let case = |name, text: &str, said| with(name, "bad.toml", text, "fly bad.toml -o out", said);
    vec![
        case("a mission with a key that is none", "nme = \"x\"\n", &["bad.toml:1:1: unknown field `nme`", "`name`"]),
        case("a mission that ends before it begins", "duration_s = -1\n", &["bad.toml:1:14: duration_s: "]),
        case(
            "a fifth rotor",
            "duration_s = 2\n[[command]]\nrotors = [1, 5]\nsteps = [{ pulse_us = 1700, hold_s = 1 }]\n",
            &["bad.toml:3:14: ", "a rotor from 1 to 4, found 5"],
        ),
        case(
            "a pulse out of range",
            "duration_s = 2\n[[command]]\nrotors = [1]\nsteps = [\n  { pulse_us = 1700, hold_s = 1 },\n  { pulse_us = 170, hold_s = 1 },\n]\n",
            &["bad.toml:6:16: pulse_us: ", "found 170"],
        ),
        case(
            "an airframe in the place of its file",
            "duration_s = 2\n\n[airframe]\narm_m = 0.3\n",
            &["bad.toml:3:1: airframe: a table", "the name of a file, in quotes"],
        ),
        case("an airframe that is not there", "airframe = \"nowhere.toml\"\n", &["nowhere.toml: cannot be read"]),
        case("pulses that are not there", "pulses = \"nowhere.csv\"\n", &["nowhere.csv: cannot be read"]),
    ]
}

fn schedules() -> Vec<Case> {
    let case = |name, text: &str, said| with(name, "bad.toml", text, "rig --port sim --speed 0 run bad.toml -o out.csv", said);
    vec![
        case(
            "a schedule with a pulse out of range",
            "[[part]]\nkind = \"hold\"\npulse_us = 2500\nhold_s = 1\n",
            &["bad.toml:3:12: pulse_us: ", "found 2500"],
        ),
        case("a part of no kind", "[[part]]\nkind = \"hld\"\n", &["bad.toml:2:8: ", "\"hld\"", "hold, staircase"]),
        case(
            "a part with a key that is none",
            "[[part]]\nkind = \"hold\"\npulse_us = 1500\nhold_s = 1\nhld = 2\n",
            &["bad.toml:5:1: ", "\"hld\"", "hold_s"],
        ),
        case(
            "a part without its hold",
            "[[part]]\nkind = \"hold\"\npulse_us = 1500\n",
            &["bad.toml:2:8: a hold: expected hold_s"],
        ),
        case("a schedule of no parts", "name = \"x\"\n", &["bad.toml:1:1: ", "part"]),
        alone(
            "a schedule that is not there",
            "rig --port sim --speed 0 run nowhere.toml -o out.csv",
            &["nowhere.toml: cannot be read"],
        ),
        with(
            "a verdict that proposes nothing",
            "bad.json",
            "{}",
            "rig --port sim --speed 0 run --next bad.json -o out.csv",
            &["bad.json:1:1: ", "no next experiment"],
        ),
    ]
}

fn boards() -> Vec<Case> {
    vec![
        alone("no port", "rig status", &["--port with the serial port of the board"]),
        alone("a port that is not there", "rig --port /dev/nothing status", &["/dev/nothing", "or sim for a virtual board"]),
        alone("a pulse for no ESC", "rig --port sim --speed 0 set 5000", &["US 5000: ", "a pulse in us from 1000 to 2000"]),
        alone(
            "a pulse before arming",
            "rig --port sim --speed 0 set 1500",
            &["the board refuses: not in this state", "`quadrig rig status`"],
        ),
        alone(
            "a configuration that is not there",
            "rig --port sim --speed 0 configure nowhere.csv",
            &["nowhere.csv: no such setting, nor a file", "log-ms"],
        ),
        alone("a setting without its value", "rig --port sim --speed 0 configure slew", &["slew: no value", "log-ms 100"]),
        alone("a setting that is none", "rig --port sim --speed 0 configure colour 5", &["colour: no such setting", "log-ms"]),
        with(
            "a configuration with a key that is none",
            "bad.toml",
            "rate_hz = 10\nfoo = 1\n",
            "rig --port sim --speed 0 configure bad.toml",
            &["bad.toml:2:1: unknown field `foo`", "`rate_hz`"],
        ),
        with(
            "an ESC of no kind",
            "bad.toml",
            "[esc]\noutput = \"x\"\n",
            "rig --port sim --speed 0 configure bad.toml",
            &["bad.toml:2:10: ", "`pwm`"],
        ),
        alone(
            "a range calibration without a word",
            "rig --port sim --speed 0 calibrate",
            &["MAXIMUM pulses", "--esc-is-unpowered"],
        ),
        alone(
            "a word that the IMU board does not know",
            "imu --port sim --speed 0 dance",
            &["\"dance\" is no command", "`quadrig imu --help`"],
        ),
        alone(
            "a virtual board's option at a serial port",
            "log --port /dev/nothing --assist -o out.csv",
            &["--assist belongs to a virtual board", "--port sim"],
        ),
        with(
            "a recording that was cut off",
            "out.csv.part",
            "# quadrig-log 1\n",
            "log --port sim --speed 0 --seconds 1 -o out.csv",
            &["out.csv.part: left by a recording that was cut off"],
        ),
        alone("values that are none", "calibrate loadcell -i good.csv --points 0_x -o out.toml", &["\"0_x\"", "200 g"]),
        alone("a log without codes", "recalibrate good.csv --with model.toml -o out.csv", &["model.toml"]),
    ]
}

fn arguments() -> Vec<Case> {
    vec![
        alone("a beam without width", "beam --width 0", &["--width 0", "a positive number"]),
        alone("a beam of no number", "beam --modulus nan", &["--modulus nan: ", "a positive number of GPa"]),
        alone("a motor that nobody measured", "select --motor 1KV", &["--motor 1KV", "570KV"]),
        alone("a battery without charge", "select --capacity 0", &["--capacity 0", "a positive number"]),
        alone("a battery in mAh", "select --capacity 4400", &["--capacity 4400: expected A.h", "4400 mAh are 4.4 A.h"]),
        alone("a frame in grams", "select --bare 774", &["--bare 774: expected kg", "774 g are 0.774 kg"]),
        alone("a declination beyond the pole", "ahrs good.csv out.csv --declination 700", &["--declination 700", "-180 to 180"]),
        alone("a channel that is none", "plateaus good.csv --channel thrust", &["no column thrust", "thrust_n"]),
        alone("a thrust that is none", "select --thrust nan", &["--thrust nan: expected N from 0"]),
        alone("a thrust without an end", "select --thrust inf", &["--thrust inf: expected N from 0"]),
        alone("a time that is none", "select --minutes nan", &["--minutes nan: expected minutes"]),
        alone("a charge that is none", "select --capacity nan", &["--capacity nan: expected a positive number of A.h"]),
        alone(
            "a charge in words",
            "export model.toml --to px4 --capacity nan -o out",
            &["--capacity nan: ", "mAh, a whole number"],
        ),
        alone(
            "an end that never comes",
            "log --port sim --seconds nan -o out.csv",
            &["--seconds nan: ", "a positive number of seconds"],
        ),
        alone("an end before the beginning", "log --port sim --seconds -3 -o out.csv", &["--seconds -3: "]),
        alone("a wait that is none", "log --port sim --wait nan -o out.csv", &["--wait nan: expected seconds from 0"]),
        alone("a departure that is none", "log --port sim --model model.toml --stop-at nan -o out.csv", &["--stop-at nan: "]),
        alone("a threshold that is none", "plateaus good.csv --threshold nan", &["--threshold nan: ", "unit per sample"]),
        alone("a threshold without an end", "plateaus good.csv --threshold inf", &["--threshold inf: "]),
        alone("a threshold of nothing", "plateaus good.csv --threshold 0", &["--threshold 0: "]),
        alone("an offset beyond all logs", "plateaus good.csv --offset 99999999", &["--offset 99999999: ", "samples"]),
        alone("an offset beyond this log", "plateaus good.csv --offset 420", &["--offset 420: ", "the 420 rows of good.csv"]),
        alone("a speed that is none", "beam --speeds nan", &["--speeds nan: expected rev/min"]),
        alone("a speed below 0", "beam --speeds -1000", &["--speeds -1000: expected rev/min from 0"]),
        alone("a speed in words", "beam --speeds 1000,abc", &["--speeds abc: expected rev/min"]),
        alone("a nearness that is none", "beam --near nan", &["--near nan: expected per cent from 0 to 100"]),
        alone("a density that is none", "identify good.csv -o out.toml --air nan", &["--air nan: expected a density"]),
        alone("a pulse that is none", "rig --port sim --speed 0 set nan", &["US nan: "]),
        alone("a board that stands still", "virtual --speed nan", &["--speed nan: ", "times the clock"]),
        alone("an arm in mm", "calibrate torque -i good.csv --points 0 --arm 185 -o out.toml", &["--arm 185: ", "m, 10 at most"]),
        with(
            "one rotor of a stand",
            "bad.csv",
            good_log(),
            "import bad.csv --rotor 1 -o out.csv",
            &["--rotor 1: bad.csv is no PX4 ULog", "leave --rotor away"],
        ),
        alone("data that are not there", "measured nowhere -o out", &["nowhere", "no such folder"]),
        alone(
            "from a command that was not logged",
            "predict model.toml no-command.csv -o out.csv --from command",
            &["no-command.csv: no column pulse_us"],
        ),
    ]
}

/// A call whose page has a longer name than any disk takes: what is written before it shows.
fn unwritable() -> &'static str {
    Box::leak(format!("identify good.csv -o out.toml --report {}.html", "x".repeat(300)).into_boxed_str())
}

/// Recordings of an IMU that none has made, for each command that reads such.
fn attitudes() -> Vec<Case> {
    const GOOD: &str = "0.01,0,0,0,0,9.8,20,0,40";
    const HEADER: &str = "t_s,gx,gy,gz,ax,ay,az,mx,my,mz\n";
    const AHRS: &str = "ahrs bad.csv out.csv";
    const CLOSE: &str = "close-loop bad.csv -o out";
    const CALIBRATE: &str = "calibrate gyro -i bad.csv -o out.toml";
    let log = |step: f64, cells: &str| -> String {
        let rows: String = (0..40).map(|n| format!("{},{cells}\n", f64::from(n) * step)).collect();
        HEADER.to_owned() + &rows
    };
    let one = |cells: &str| {
        let mut lines: Vec<String> = log(0.005, GOOD).lines().map(str::to_owned).collect();
        lines[20] = format!("0.095,{cells}");
        lines.join("\n") + "\n"
    };
    let kinds: [(&'static str, String, &'static [&'static str]); 11] = [
        ("milliseconds", log(5.0, GOOD), &["column t_s: rows 5 s apart", "milliseconds: divide t_s by 1000"]),
        ("microseconds", log(5000.0, GOOD), &["column t_s: rows 5000 s apart", "microseconds"]),
        ("a rate that is none", one("nan,0,0,0,0,9.8,20,0,40"), &["bad.csv:21: column gx: \"nan\""]),
        ("a force that is none", one("0,0,0,0,NaN,9.8,20,0,40"), &["bad.csv:21: column ay: \"NaN\"", "an empty field"]),
        ("a rate without an end", one("0,0,inf,0,0,9.8,20,0,40"), &["bad.csv:21: column gz: \"inf\""]),
        ("degrees a second", one("0,250,0,0,0,9.8,20,0,40"), &["bad.csv:21: column gy: 250", "deg/s are 4.3633 rad/s"]),
        ("a force beyond all", one("0,0,0,0,0,9806,20,0,40"), &["bad.csv:21: column az: 9806", "mg"]),
        ("forces in g", log(0.005, "0,0,0,0,0,1,20,0,40"), &["columns ax,ay,az: 1.000 long", "multiply them by 9.80665"]),
        ("forces in mg", log(0.005, "0,0,0,0,0,999,20,0,40"), &["columns ax,ay,az: 999.000 long", "look like mg"]),
        ("no gravity", log(0.005, "0,0,0,0,0,0,20,0,40"), &["columns ax,ay,az: 0.000 long", "9.8 at rest"]),
        ("a field in nT", log(0.005, "0,0,0,0,0,9.8,20000,0,40000"), &["columns mx,my,mz: 44721 long", "nT"]),
    ];
    let each =
        |(name, text, said)| [AHRS, CLOSE, CALIBRATE].map(|words| with(name, "bad.csv", String::clone(&text), words, said));
    kinds.into_iter().flat_map(each).collect()
}

fn outputs() -> Vec<Case> {
    vec![
        alone("identify over its log", "identify good.csv -o good.csv", &["good.csv: is an input of this command"]),
        alone("by another name", "identify good.csv -o ./full/../good.csv", &["good.csv: is an input of this command"]),
        alone("predict over its model", "predict model.toml good.csv -o model.toml", &["model.toml: is an input"]),
        alone("import over its export", "import good.csv -o good.csv", &["good.csv: is an input"]),
        alone("sim over its scenario", "sim empty.toml -o empty.toml", &["empty.toml: is an input"]),
        alone(
            "predict over the file beside its model",
            "predict model.toml good.csv -o model.discrepancy.toml",
            &["model.discrepancy.toml: is an input"],
        ),
        alone("sim over its model", "sim empty.toml --model model.toml -o model.toml", &["model.toml: is an input"]),
        alone("sim over its schedule", "sim on-file.toml -o plan.toml", &["plan.toml: is an input"]),
        alone("a page over the log", "identify good.csv -o out.toml --report good.csv", &["good.csv: is an input", "--report"]),
        alone("a page over the pairs", "select good.csv -o good.csv", &["good.csv: is an input"]),
        alone("a page over the run", "beam --run good.csv -o good.csv", &["good.csv: is an input"]),
        alone("an attitude over its readings", "ahrs good.csv good.csv", &["good.csv: is an input"]),
        alone("recalibrated in place", "recalibrate good.csv --with model.toml -o good.csv", &["good.csv: is an input"]),
        alone(
            "a recording over its schedule",
            "rig --port sim --speed 0 run plan.toml -o plan.toml",
            &["plan.toml: is an input"],
        ),
        alone("a recording over its board", "log --port sim:empty.toml --speed 0 -o empty.toml", &["empty.toml: is an input"]),
        alone(
            "two outputs in one file",
            "sim empty.toml -o out.csv --truth out.csv",
            &["out.csv: stands for -o and for --truth"],
        ),
        alone(
            "results among their inputs",
            "close-loop good.csv -o .",
            &["good.csv: is an input and lies in the folder of the results"],
        ),
        alone("results among the notes of somebody", "close-loop good.csv -o full", &["full: holds notes.csv"]),
        alone("a demonstration among notes", "demo --seed 1 -o full", &["full: holds notes.csv"]),
        alone("isolability among notes", "isolability good.csv -o full", &["full: holds notes.csv"]),
        alone("a loop among notes", "loop empty.toml -o full", &["full: holds notes.csv"]),
        alone("a flight among notes", "fly short.toml -o full", &["full: holds notes.csv"]),
        alone("runs among notes", "runs -o full", &["full: holds notes.csv"]),
        alone("detectors among notes", "plateaus good.csv -o full", &["full: holds notes.csv"]),
        alone("pages of effects among notes", "effects -o full", &["full: holds notes.csv"]),
        alone("figures among notes", "select --svg full", &["full: holds notes.csv"]),
        alone("a batch among notes", "batch . -o full", &["full: holds notes.csv, which no `quadrig batch` wrote"]),
        alone("a batch over a table", "batch . -o listed", &["listed: holds manifest.csv, which no `quadrig batch` wrote"]),
        alone("a batch over another table", "batch . -o caused", &["caused: holds effects.csv, which no `quadrig batch`"]),
        alone(
            "a batch over a result",
            "batch . -o kept-runs",
            &["kept-runs: holds runs/good.csv.json, which no `quadrig batch`"],
        ),
        alone("recorded sets over a page", "measured data -o told", &["told: holds measured.md, which no `quadrig measured`"]),
        alone(
            "recorded sets among notes",
            "measured data -o paged",
            &["paged: holds measured/notes.txt, which no `quadrig measured`"],
        ),
        alone("a page that cannot be written", unwritable(), &["html: cannot be written", "expected a folder"]),
        alone(
            "a demonstration over a recording",
            "demo --seed 1 -o kept",
            &["kept: holds run.csv, which no `quadrig demo` wrote", "name another one"],
        ),
        alone(
            "results over a model",
            "close-loop good.csv -o models",
            &["models: holds model.toml, which no `quadrig close-loop`"],
        ),
        alone("a flight over a flight", "fly short.toml -o flown", &["flown: holds flight.csv, which no `quadrig fly` wrote"]),
        alone("figures over figures", "identify good.csv -o out.toml --svg drawn", &["drawn: holds thrust.svg, which no"]),
        alone("a folder that is a file", "close-loop good.csv -o model.toml", &["model.toml: ", "a folder"]),
        alone(
            "two folders that are not there",
            "identify good.csv -o absent/deep/out.toml",
            &["absent/deep/out.toml: cannot be written (absent is not there)"],
        ),
        alone("the same of a folder", "close-loop good.csv -o absent/deep/out", &["(absent is not there)"]),
        alone("a folder in a file", "identify good.csv -o model.toml/out.toml", &["model.toml is no folder"]),
        alone(
            "a folder in the place of a file",
            "identify good.csv -o full",
            &["full: is a folder, which stays as it is", "for -o"],
        ),
        alone("a device for a model", "identify good.csv -o /dev/full", &["/dev/full: is a device, which stays as it is"]),
        alone(
            "a device for a page",
            "identify good.csv -o out.toml --report /dev/null",
            &["/dev/null: is a device", "for --report"],
        ),
        alone("a device for an export", "export model.toml --to px4 -o /dev/null", &["/dev/null: is a device"]),
        alone("a device for a recording", "log --port sim --speed 0 --seconds 1 -o /dev/null", &["/dev/null: is a device"]),
        alone("a device for figures", "select --svg /dev/null", &["/dev/null: is no folder; expected a folder for --svg"]),
        alone("a file for a batch", "batch . -o good.csv", &["good.csv: is no folder; expected a folder for -o"]),
        alone("a device for a run", "sim short.toml -o /dev/null", &["/dev/null: is a device"]),
        alone(
            "a device without an end",
            "identify /dev/zero -o out.toml",
            &["/dev/zero: is a device, which can be read only once"],
        ),
        alone("a device in the place of a log", "step residual /dev/zero", &["/dev/zero: is a device"]),
    ]
}

/// Everything in a folder, with its bytes.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        if path.is_dir() {
            found.extend(contents(&path).into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
        } else {
            found.insert(name, std::fs::read(&path).expect("a file"));
        }
    }
    found
}

/// A pipe gives its bytes once, and an input is looked at before it is read; a link to a device stays one.
#[cfg(unix)]
#[test]
fn pipes_and_links_to_devices_are_left_alone() {
    let bench = Bench::new();
    let made = std::process::Command::new("mkfifo").arg(bench.path("pipe.csv")).status().expect("mkfifo");
    assert!(made.success());
    for words in [vec!["identify", "pipe.csv", "-o", "out.toml"], vec!["import", "pipe.csv", "-o", "out.csv"]] {
        bench
            .call(&words)
            .refused(&["pipe.csv: is a pipe, which can be read only once", "expected a file: save it to one first"]);
    }
    bench.call(&["identify", "good.csv", "-o", "pipe.csv"]).refused(&["pipe.csv: is a pipe, which stays as it is"]);
    std::os::unix::fs::symlink("/dev/null", bench.path("link.toml")).expect("a link");
    bench.call(&["identify", "good.csv", "-o", "link.toml"]).refused(&["link.toml: is a device"]);
    assert!(bench.path("link.toml").is_symlink());
    assert_eq!(bench.names(), ["good.csv", "link.toml", "model.toml", "pipe.csv"]);
}

/// One missing folder is made, whatever the command and its option; a link to a file leads on to it.
#[test]
fn a_missing_folder_of_an_output_is_made() {
    let bench = Bench::new();
    std::fs::write(bench.path("run.toml"), "schedule = { kind = \"steps\", steps = [{ pulse_us = 1300, hold_s = 2 }] }\n")
        .expect("a scenario");
    for (words, files) in [
        ("sim run.toml -o a/run.csv --truth b/truth.csv", vec!["a/run.csv", "b/truth.csv"]),
        (
            "identify good.csv -o c/model.toml --report d/page.html --svg e/figures",
            vec!["c/model.toml", "d/page.html", "e/figures"],
        ),
        ("predict model.toml good.csv -o f/pred.csv", vec!["f/pred.csv"]),
        ("export model.toml --to csv -o g/table.csv", vec!["g/table.csv"]),
        ("log --port sim --speed 0 --seconds 1 -o h/log.csv", vec!["h/log.csv"]),
    ] {
        bench.call(&words.split(' ').collect::<Vec<_>>()).succeeded();
        assert!(files.iter().all(|file| bench.path(file).exists()), "{words}");
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("a/run.csv", bench.path("link.csv")).expect("a link");
        bench.call(&["export", "model.toml", "--to", "csv", "-o", "link.csv"]).succeeded();
        let read = |name: &str| std::fs::read(bench.path(name)).expect("a file");
        assert!(bench.path("link.csv").is_symlink() && read("a/run.csv") == read("g/table.csv"));
    }
}

/// Where one of several outputs cannot be written the model is not there, and what is there is said.
#[test]
fn what_is_written_before_a_refusal_is_said() {
    let bench = Bench::new();
    let words = format!("identify good.csv -o out.toml --table out.csv --report {}.html", "x".repeat(300));
    let said = bench.call(&words.split(' ').collect::<Vec<_>>());
    said.refused(&["html: cannot be written", "written already: out.csv"]);
    assert_eq!(bench.names(), ["good.csv", "model.toml", "out.csv"]);
}

#[test]
fn malformed_input_is_refused_in_one_line_that_teaches() {
    let bench = Bench::new();
    let write = |name: &str, bytes: &[u8]| std::fs::write(bench.path(name), bytes).expect("a file");
    std::fs::create_dir(bench.path("full")).expect("a folder");
    write("full/notes.csv", b"mine,yours,ours\n1,2,3\n");
    std::fs::create_dir_all(bench.path("data/rig")).expect("a folder");
    for name in [
        "kept/run.csv",
        "models/model.toml",
        "flown/flight.csv",
        "drawn/thrust.svg",
        "listed/manifest.csv",
        "caused/effects.csv",
        "kept-runs/runs/good.csv.json",
        "told/measured.md",
        "paged/measured/notes.txt",
    ] {
        std::fs::create_dir_all(bench.path(name).parent().expect("a folder")).expect("a folder");
        write(name, b"mine");
    }
    write("empty.toml", b"");
    write("short.toml", b"duration_s = 1\n");
    write("plan.toml", b"[[part]]\nkind = \"hold\"\npulse_us = 1200\nhold_s = 1\n");
    write("on-file.toml", b"schedule = { kind = \"file\", file = \"plan.toml\" }\n");
    let without_command = |line: &str| match line.split(',').collect::<Vec<_>>()[..] {
        [t, _, ref rest @ ..] if !line.starts_with('#') => format!("{t},{}\n", rest.join(",")),
        _ => format!("{line}\n"),
    };
    write("no-command.csv", good_log().lines().map(without_command).collect::<String>().as_bytes());
    let lists = [logs(), kinds(), models(), scenarios(), missions(), schedules(), boards(), arguments(), outputs(), attitudes()];
    let cases: Vec<Case> = lists.into_iter().chain([plain_words(), impossible()]).flatten().collect();
    assert!(cases.len() >= 70, "{} cases", cases.len());
    let mut wrong = Vec::new();
    for case in &cases {
        if let Some((file, bytes)) = &case.file {
            write(file, bytes);
        }
        let before = contents(bench.folder());
        let words: Vec<&str> = case.words.split(' ').collect();
        let said = bench.call(&words);
        let lacks: Vec<&str> = case.said.iter().chain(&["expected"]).copied().filter(|text| !said.err.contains(text)).collect();
        if said.status != Some(1) || said.err.lines().count() != 1 || !said.out.is_empty() || !lacks.is_empty() {
            wrong.push(format!(
                "{}: `quadrig {}`: status {:?}, lacks {lacks:?}\n  {}{}",
                case.name, case.words, said.status, said.err, said.out
            ));
        }
        for leaked in ["f64", "u32", "struct ", "enum ", "os error"] {
            if said.err.contains(leaked)
                && !["read", "written"].iter().any(|done| said.err.contains(&format!("cannot be {done}")))
            {
                wrong.push(format!("{}: `quadrig {}` says {leaked}: {}", case.name, case.words, said.err));
            }
        }
        if contents(bench.folder()) != before {
            wrong.push(format!("{}: `quadrig {}` changed the folder", case.name, case.words));
        }
        if let Some((file, _)) = &case.file {
            std::fs::remove_file(bench.path(file)).expect("it is there");
        }
    }
    assert!(wrong.is_empty(), "{} of {} cases:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
}
