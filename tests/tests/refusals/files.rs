//! Files beside logs: of another kind, models, scenarios, missions, schedules.
//!
//! What it is: the cases of the table of refusals that meet such a file.
//! What can go wrong: see `refusals.rs`.
//! Units: as the keys state.
//! Reference: specification `formats.md`.

use super::{Case, IDENTIFY, alone, with};

/// Files of another kind than the command takes: each refusal names what takes or makes them.
pub(super) fn kinds() -> Vec<Case> {
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

pub(super) fn models() -> Vec<Case> {
    const PREDICT: &str = "predict bad.toml good.csv -o out.csv";
    let model = |name, head: &str, rest: &str, said| {
        let start = if rest.contains("start_pulse_us") { "" } else { "start_pulse_us = 1000.0\n" };
        with(name, "bad.toml", format!("format = \"quadrig-model 1\"\n{start}{head}{rest}"), PREDICT, said)
    };
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
            "a model that ends early",
            "bad.toml",
            "# Without a line `# end of the model` below, this file was cut short.\nformat = \"quadrig-model 1\"\nstart_pulse_us = 1000.0\n[channel.voltage_v]\nc0_v = 11.",
            PREDICT,
            &["bad.toml:5:11: the file ends early, after 'c0_v = 11.'", "copy it again whole"],
        ),
        with(
            "a model of bytes",
            "bad.toml",
            [0xFF_u8, 0xFE, 0x00, 0x81],
            PREDICT,
            &["bad.toml:1:1: bytes that are no text in UTF-8", "`quadrig identify`"],
        ),
        model(
            "a pulse of less than nothing",
            "highest_pulse_us = -5\n",
            "",
            &["bad.toml:3:1: key highest_pulse_us: -5; ", "up to 2500"],
        ),
        model(
            "a start beyond all pulses",
            "",
            "start_pulse_us = 5000.0\n",
            &["key start_pulse_us: 5000.0; ", "from 0 to 2500 us"],
        ),
        model(
            "a thrust that no rig has",
            "",
            "[channel.thrust_n]\nc0_n = 0.0\nc1_n_per_krpm = 0.0\nc2_n_per_krpm2 = 1e200\n",
            &["key channel.thrust_n.c2_n_per_krpm2: ", "1e7 at most"],
        ),
        model(
            "a lead that no rig has",
            "",
            "[channel.voltage_v]\nc0_v = 12.0\n[[effect]]\nid = \"supply_sag\"\nchannels = [\"voltage_v\"]\nscope = \"rig\"\nshape = []\n[effect.amplitude.voltage_v]\nresistance_ohm = -4e9\n",
            &["key effect[0].amplitude.voltage_v.resistance_ohm: -4000000000.0; ", "from 0 to 100 ohm"],
        ),
        model("a motor without poles", "", "[channel]\n[rig]\npole_pairs = -7\n", &["key rig.pole_pairs: -7; ", "from 1 to 100"]),
        with(
            "a flight that is no flight",
            "bad.toml",
            "duration_s = 2\n",
            "fly bad.toml --model good.csv",
            &["good.csv:1:1: a log"],
        ),
    ]
}

pub(super) fn scenarios() -> Vec<Case> {
    const SIM: &str = "sim bad.toml -o out.csv";
    let case = |name, text: &str, said| with(name, "bad.toml", text, SIM, said);
    vec![
        case("no TOML", "seed = \n", &["bad.toml:1:8: "]),
        case(
            "a key that is none",
            "seed = 1\nmoter = \"570KV\"\n",
            &["bad.toml:2:1: unknown field `moter`, did you mean `motor`? expected"],
        ),
        case(
            "a brace that nothing closes",
            "seed = 1\nschedule = { kind = \"up_down\", step_us = 50, hold_s = 5, top_us = 2000\n\n[[effect]]\nid = \"creep\"\n",
            &["bad.toml:2:71: an inline table that does not end on its line; expected `}`"],
        ),
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
            "an effect that is mistyped",
            "seed = 1\n[[effect]]\nid = \"suply_sag\"\n",
            &["bad.toml:3:6: id: unknown variant `suply_sag`, did you mean `supply_sag`? expected"],
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

/// Descriptions in TOML that another command takes: each refusal says what it is, and which one.
pub(super) fn descriptions() -> Vec<Case> {
    const MISSION: &str =
        "duration_s = 2\n[imu]\nchips = \"calibrated\"\n[[command]]\nrotors = [1]\nsteps = [{ pulse_us = 1700, hold_s = 2 }]\n";
    const SCENARIO: &str = "seed = 1\nmotor = \"570KV\"\n[[effect]]\nid = \"supply_sag\"\nresistance_ohm = 0.08\n";
    const PLAN: &str = "[[part]]\nkind = \"hold\"\npulse_us = 1200\nhold_s = 1\n";
    const RUN: &str = "rig --port sim --speed 0 run bad.toml -o out.csv";
    let mission = |name, words| {
        with(name, "bad.toml", MISSION, words, &["bad.toml:1:1: a mission, which `quadrig fly bad.toml`", "a scenario"])
    };
    vec![
        mission("a mission to simulate", "sim bad.toml -o out.csv"),
        mission("a mission to loop", "loop bad.toml -o out"),
        mission("a mission to isolate causes of", "isolability bad.toml -o out"),
        mission("a mission for a virtual board", "virtual bad.toml --seconds 1"),
        mission("a mission at a port", "log --port sim:bad.toml --speed 0 --seconds 1 -o out.csv"),
        with(
            "a mission to play",
            "bad.toml",
            MISSION,
            RUN,
            &["bad.toml:1:1: a mission, which `quadrig fly", "expected a schedule"],
        ),
        with(
            "a scenario to play",
            "bad.toml",
            SCENARIO,
            RUN,
            &["bad.toml:1:1: a scenario, which `quadrig sim", "expected a schedule"],
        ),
        with(
            "a scenario to fly",
            "bad.toml",
            SCENARIO,
            "fly bad.toml -o out",
            &["bad.toml:1:1: a scenario, which `quadrig sim bad.toml -o LOG` runs; expected a mission", "docs/mission.md"],
        ),
        with(
            "a schedule to simulate",
            "bad.toml",
            PLAN,
            "sim bad.toml -o out.csv",
            &["bad.toml:1:1: a schedule, which `quadrig rig run", "expected a scenario"],
        ),
    ]
}

pub(super) fn missions() -> Vec<Case> {
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

pub(super) fn schedules() -> Vec<Case> {
    let case = |name, text: &str, said| with(name, "bad.toml", text, "rig --port sim --speed 0 run bad.toml -o out.csv", said);
    vec![
        case(
            "a schedule with a pulse out of range",
            "[[part]]\nkind = \"hold\"\npulse_us = 2500\nhold_s = 1\n",
            &["bad.toml:3:12: pulse_us: ", "found 2500"],
        ),
        case(
            "a hold that is none",
            "[[part]]\nkind = \"hold\"\npulse_us = 1500\nhold_s = nan\n",
            &["bad.toml:4:10: hold_s: expected a number with an end, found nan"],
        ),
        case(
            "a pulse without an end",
            "[[part]]\nkind = \"hold\"\npulse_us = inf\nhold_s = 1\n",
            &["bad.toml:3:12: pulse_us: expected a number with an end, found inf"],
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
