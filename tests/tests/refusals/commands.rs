//! The call itself: boards and ports, arguments, attitude logs, outputs.
//!
//! What it is: the cases of the table of refusals that meet an argument or a place.
//! What can go wrong: see `refusals.rs`.
//! Units: as the options state.
//! Reference: specification `formats.md`; `--help`.

use super::{Case, alone, with};
use quadrig_tests::bench::good_log;

pub(super) fn boards() -> Vec<Case> {
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
        alone("a device that is no port", "rig --port /dev/null status", &["/dev/null: cannot be opened (it is no serial port)"]),
        alone(
            "a log for the settings' sectors",
            "rig --port sim --speed 0 --flash good.csv status",
            &["good.csv: ", "expected the settings' sectors of a board"],
        ),
        with(
            "a thrust without its bridge",
            "bad.toml",
            "[thrust]\nlength_m = 0.1\n",
            "rig --port sim --speed 0 configure bad.toml",
            &["bad.toml:1:1: missing field", "docs/configuration.md"],
        ),
        with(
            "a scale without its zero",
            "bad.toml",
            "[calibrated.thrust]\nper_count = 0.1\n",
            "recalibrate good.csv --with bad.toml -o out.csv",
            &["bad.toml:1:1: missing field", "docs/calibration.md"],
        ),
        with(
            "a configuration of bytes",
            "bad.toml",
            [0xFF_u8, 0xFE, 0x00, 0x81],
            "rig --port sim --speed 0 configure bad.toml",
            &["bad.toml:1:1: bytes that are no text"],
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

pub(super) fn arguments() -> Vec<Case> {
    vec![
        alone("a beam without width", "beam --width 0", &["--width 0", "a positive number"]),
        alone("a beam of no number", "beam --modulus nan", &["--modulus nan: ", "a positive number of GPa"]),
        alone("a motor that nobody measured", "select --motor 1KV", &["--motor 1KV", "570KV"]),
        alone("a battery without charge", "select --capacity 0", &["--capacity 0", "a positive number"]),
        alone("a battery in mAh", "select --capacity 4400", &["--capacity 4400: expected A.h", "4400 mAh are 4.4 A.h"]),
        alone(
            "a battery to export in A.h",
            "export model.toml --to px4 --capacity 1.5",
            &["--capacity 1.5: expected mAh, a whole number from 100", "1.5 A.h are 1500 mAh"],
        ),
        alone("a whole battery to export in A.h", "export model.toml --to px4 --capacity 5", &["5 A.h are 5000 mAh"]),
        alone("a frame in grams", "select --bare 774", &["--bare 774: expected kg", "774 g are 0.774 kg"]),
        alone("a declination beyond the pole", "ahrs good.csv out.csv --declination 700", &["--declination 700", "-180 to 180"]),
        alone("a channel that is none", "plateaus good.csv --channel thrust", &["no column thrust", "thrust_n"]),
        alone("a thrust that is none", "select --thrust nan", &["--thrust nan: expected N from 0"]),
        alone(
            "a run that is to judge itself",
            "close-loop good.csv --validate good.csv -o out",
            &["--validate good.csv: it is the log itself", "another run of the rig"],
        ),
        alone("a seed below 0", "demo --seed -1 -o out", &["--seed -1: expected a seed, a whole number from 0"]),
        alone(
            "cells below 0",
            "export model.toml --to px4 --cells -3",
            &["--cells -3: expected cells, a whole number from 1 to 14"],
        ),
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
        alone(
            "an image that is not there",
            "flash rig --elf nowhere.elf",
            &["nowhere.elf: no such image", "`cargo xtask image`"],
        ),
        alone("a log in the place of an image", "flash ahrs --elf good.csv", &["good.csv: no image of a board", "an ELF file"]),
        alone("a history of one run", "history good.csv -o out", &["at least", "runs before and after it"]),
        alone("a history of nothing", "history nowhere -o out", &["nowhere: cannot be read"]),
        alone("a history of a folder without a run", "history models -o out", &["models: no file ends in .csv"]),
        with(
            "a history with a run that is none",
            "bad.csv",
            "x\n",
            "history good.csv bad.csv -o out",
            &["at least", "left out: bad.csv:1"],
        ),
        alone("a history among notes", "history good.csv -o full", &["full: holds notes.csv, which no `quadrig history`"]),
        with(
            "an export joined to one that stood still",
            "bad.csv",
            good_log().lines().skip(2).take(50).map(|l| l.replacen("t_s", "Time (s)", 1) + "\n").collect::<String>(),
            "import export.csv --with esc=bad.csv -o out.csv",
            &["export.csv and bad.csv: "],
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
pub(super) fn attitudes() -> Vec<Case> {
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

pub(super) fn outputs() -> Vec<Case> {
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
        alone("sim over the log that its schedule replays", "sim on-replay.toml -o good.csv", &["good.csv: is an input"]),
        alone("a record of truth over it", "sim on-replay.toml -o x.csv --truth good.csv", &["good.csv: is an input"]),
        alone("a recording over it", "rig --port sim --speed 0 run replay.toml -o good.csv", &["good.csv: is an input"]),
        alone(
            "one over what its board replays",
            "log --port sim:on-replay.toml --speed 0 --seconds 1 -o good.csv",
            &["good.csv: is an input"],
        ),
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
        #[cfg(target_os = "linux")]
        alone("a model that no folder takes", "identify good.csv -o /proc/x", &["/proc/x: cannot be written", "rights and room"]),
        #[cfg(target_os = "linux")]
        alone("results that none takes", "demo --seed 1 -o /proc/x", &["/proc/x: cannot be written (/proc takes no files)"]),
        alone(
            "one over its board's schedule",
            "log --port sim:on-file.toml --speed 0 --seconds 1 -o plan.toml",
            &["plan.toml: is an input"],
        ),
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
        alone("a folder that is a file", "close-loop good.csv -o model.toml", &["model.toml: is no folder; ", "a folder"]),
        alone("a folder that is the log", "close-loop good.csv -o good.csv", &["good.csv: is no folder; ", "a folder for -o"]),
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
