//! What `--help` of each command teaches beside its options: units, an example, the page that explains it.
//!
//! What it is: one entry a command, put behind clap's own help; man pages and tests walk the same.
//! What can go wrong: a command without an entry, an example that is no call, a page that is not there: the test beside it fails.
//! Units: said in each entry.
//! Reference: clap, `Command::after_help`.

use clap::Command;
use ident::report::WIDEST;
use std::any::TypeId;

/// What is taught of one command.
struct Entry {
    /// Words after `quadrig`.
    path: &'static str,
    units: &'static str,
    example: &'static str,
    /// In the source tree.
    page: &'static str,
}

const fn entry(path: &'static str, units: &'static str, example: &'static str, page: &'static str) -> Entry {
    Entry { path, units, example, page }
}

const US_S: &str = "pulses in us (1000 to 2000; duty in per cent is us / 200), times in s";
const LOG: &str = "those of the log's column names: s, us, rev/min, N, N.m, A, V, degC";

const ENTRIES: [Entry; 45] = [
    entry("demo", LOG, "demo --seed 7 --effect supply_sag -o out/demo", "docs/book/tutorials/without-hardware.md"),
    entry("sim", LOG, "sim examples/thin-lead.toml -o out/run.csv", "docs/scenario.md"),
    entry("runs", "hold in s", "runs -o out/runs --hold 30", "docs/scenario.md"),
    entry(
        "import",
        "those of the export's own heads, converted to the log's",
        "import export.csv -o out/run.csv --map thrust_n=Load*0.00980665",
        "docs/book/how-to/import.md",
    ),
    entry(
        "identify",
        LOG,
        "identify out/run.csv -o out/model.toml --report out/run.html --table out/plateaus.csv",
        "docs/identification.md",
    ),
    entry(
        "plateaus",
        "the channel's unit per sample; samples",
        "plateaus out/run.csv --channel rpm_beam -o out/plateaus",
        "docs/identification.md",
    ),
    entry("close-loop", LOG, "close-loop out/run.csv -o out/closed", "docs/loop.md"),
    entry("batch", LOG, "batch out/runs -o out/batch", "docs/book/how-to/batch.md"),
    entry("history", LOG, "history day1.csv day2.csv day3.csv -o out/history", "docs/book/how-to/history.md"),
    entry("select", "N, A, kg, A.h, min", "select --motor 570KV --thrust 19.62 -o out/select.html", "docs/identification.md"),
    entry(
        "beam",
        "mm, g, GPa, MPa, kg/m^3, V, rev/min",
        "beam --length 115 --load 800 --speeds 1000,2500 -o out/beam.html",
        "docs/identification.md",
    ),
    entry(
        "calibrate",
        "g, kg, N, N.m, A, V, C for a rig's channel, as each value says; rad/s, m/s^2, uT of the IMU board",
        "calibrate loadcell -i run.csv --points \"0 g, 200 g, 500 g\" -o cal.toml",
        "docs/calibration.md",
    ),
    entry("recalibrate", LOG, "recalibrate run.csv --with cal.toml -o new.csv", "docs/calibration.md"),
    entry(
        "ahrs",
        "rad/s, m/s^2, uT in; degrees and a unit quaternion out",
        "ahrs readings.csv attitude.csv --earth enu",
        "docs/ahrs.md",
    ),
    entry("loop", LOG, "loop examples/sagging-lead.toml --auto -o out/loop", "docs/loop.md"),
    entry(
        "fly",
        "m, s, us, N, kg, degrees",
        "fly examples/flight/takeoff.toml --model out/closed/model.toml -o out/flight",
        "docs/mission.md",
    ),
    entry("flash", "none", "flash rig", "docs/wiring.md"),
    entry("measured", LOG, "measured ../shared/data -o docs", "docs/measured.md"),
    entry(
        "isolability",
        "sizes in noise floors of a cause's main channel (root mean square), and in the unit of its own parameter (ohm, N, N/s, s, ...)",
        "isolability examples/sagging-lead.toml -o out/isolability",
        "docs/isolability.md",
    ),
    entry("step", "in the heads of the columns", "step residual out/run.csv", "docs/loop.md"),
    entry("log", LOG, "log --port sim --seconds 10 -o out/recorded.csv", "docs/view.md"),
    entry("rig", US_S, "rig --port sim --assist run --hold 5 -o out/rig.csv", "docs/view.md"),
    entry("rig identify", "MHz", "rig --port sim identify", "docs/rig.md"),
    entry("rig status", LOG, "rig --port sim status", "docs/rig.md"),
    entry("rig view", LOG, "rig --port sim view", "docs/view.md"),
    entry("rig arm", US_S, "rig --port sim arm -o out/rig.csv", "docs/view.md"),
    entry("rig calibrate", US_S, "rig --port /dev/ttyACM0 calibrate --esc-is-unpowered", "docs/calibration.md"),
    entry("rig run", US_S, "rig --port sim --assist run examples/schedule/constant.toml -o out/rig.csv", "docs/schedule.md"),
    entry("rig set", US_S, "rig --port /dev/ttyACM0 set 1200 --hold 5", "docs/rig.md"),
    entry("rig stop", "none", "rig --port sim stop", "docs/rig.md"),
    entry("rig tare", "none", "rig --port sim tare", "docs/rig.md"),
    entry("rig clear", "none", "rig --port sim clear", "docs/rig.md"),
    entry(
        "rig configure",
        "of a setting: log-ms and link-ms in ms, speed-limit in rev/min, current-limit in A, voltage-limit in V, slew in ns for each ms; of a file in its keys",
        "rig --port sim configure examples/rig/thesis.toml",
        "docs/configuration.md",
    ),
    entry("rig burst", "Hz, and the channel's own", "rig --port sim burst thrust -o out/burst.csv", "docs/rig.md"),
    entry("rig save", "none", "rig --port sim save", "docs/configuration.md"),
    entry("imu", "as the board prints them: degrees, rad/s, m/s^2, uT", "imu --port sim once", "docs/ahrs.md"),
    entry("virtual", "s of the board's time", "virtual examples/sagging-lead.toml --link /tmp/rig", "docs/virtual.md"),
    entry("effects", "on the pages", "effects -o docs/effects", "docs/effects/README.md"),
    entry("predict", LOG, "predict out/closed/model.toml out/run.csv -o out/pred.csv", "docs/loop.md"),
    entry("export", "the peer's: see the page", "export out/model.toml --to px4 -o out/motors.params", "docs/export.md"),
    entry("completions", "none", "completions bash", "README.md"),
    entry("man", "none", "man -o out/man", "README.md"),
    // `help` of the groups themselves is clap's own
    entry("", LOG, "demo", "README.md"),
    entry("help", "none", "help sim", "README.md"),
    entry("rig help", "none", "rig help run", "README.md"),
];

impl Entry {
    fn text(&self) -> String {
        format!("Units: {}.\n\nExample:\n  quadrig {}\n\nExplained in {}.", self.units, self.example, self.page)
    }
}

/// The command line with what it teaches.
pub(crate) fn taught(command: Command) -> Command {
    let command = command.max_term_width(WIDEST);
    let wanted = ENTRIES.iter().filter(|e| e.path.split(' ').next_back() != Some("help"));
    wanted.fold(command, |command, entry| {
        let path: Vec<&str> = entry.path.split(' ').filter(|word| !word.is_empty()).collect();
        descend(command, &path, entry)
    })
}

fn descend(command: Command, path: &[&'static str], entry: &Entry) -> Command {
    match path {
        // a number below 0 is a value of an option that takes numbers, which says what it takes
        [] => command.after_help(entry.text()).mut_args(|arg| {
            let taken = arg.get_value_parser().type_id();
            let is_number =
                [TypeId::of::<f64>(), TypeId::of::<u64>(), TypeId::of::<u32>(), TypeId::of::<usize>()].map(|id| taken == id);
            if is_number.contains(&true) { arg.allow_negative_numbers(true) } else { arg }
        }),
        [first, rest @ ..] => command.mut_subcommand(*first, |inner| descend(inner, rest, entry)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cli;
    use clap::CommandFactory;
    use std::path::Path;

    /// Every command with its path, groups included, clap's own `help` excepted.
    fn walked(command: &Command, path: &str) -> Vec<(String, Command)> {
        let inner = command.get_subcommands().filter(|c| c.get_name() != "help").flat_map(|c| {
            let path = if path.is_empty() { c.get_name().to_owned() } else { format!("{path} {}", c.get_name()) };
            walked(c, &path)
        });
        std::iter::once((path.to_owned(), command.clone())).chain(inner).collect()
    }

    fn root() -> &'static Path {
        Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace")
    }

    #[test]
    fn every_command_says_its_units_an_example_and_a_page() {
        let commands = walked(&taught(Cli::command()), "");
        assert!(commands.len() > 35, "{}", commands.len());
        for (path, command) in &commands {
            let text = command.get_after_help().unwrap_or_else(|| panic!("quadrig {path} teaches nothing")).to_string();
            let units = text.strip_prefix("Units: ").unwrap_or_else(|| panic!("quadrig {path} says no units"));
            assert!(units.find('.').is_some_and(|end| end >= 3), "quadrig {path}: {text}");
            let example =
                text.lines().skip_while(|l| *l != "Example:").nth(1).unwrap_or_else(|| panic!("quadrig {path}: no example"));
            assert!(example.trim().starts_with("quadrig "), "quadrig {path}: {example}");
            if !path.is_empty() {
                let last = path.split(' ').next_back().expect("a word");
                assert!(
                    example.split_whitespace().any(|word| word == last),
                    "quadrig {path}: its example is of another command: {example}"
                );
            }
            let page = text.split("Explained in ").nth(1).and_then(|t| t.strip_suffix('.')).expect("a page");
            assert!(root().join(page).is_file(), "quadrig {path}: {page} is not there");
            assert!(
                command.get_about().is_some_and(|about| !about.to_string().is_empty()),
                "quadrig {path} does not say what it does"
            );
        }
        // and no entry is of a command that is gone
        for entry in &ENTRIES {
            let is_help = entry.path.split(' ').next_back() == Some("help");
            assert!(is_help || commands.iter().any(|(path, _)| path == entry.path), "no command {}", entry.path);
        }
    }

    #[test]
    fn every_example_is_a_call() {
        for entry in &ENTRIES {
            let mut words = vec!["quadrig".to_owned()];
            for (n, part) in entry.example.split('"').enumerate() {
                if n % 2 == 1 {
                    words.push(part.to_owned());
                } else {
                    words.extend(part.split_whitespace().map(str::to_owned));
                }
            }
            let taken = taught(Cli::command()).try_get_matches_from(&words);
            let help = taken.as_ref().is_err_and(|e| e.kind() == clap::error::ErrorKind::DisplayHelp);
            assert!(taken.is_ok() || help, "{}: {}", entry.example, taken.expect_err("refused"));
            for file in words.iter().filter(|w| w.starts_with("examples/")) {
                assert!(root().join(file).is_file(), "{}: {file} is not there", entry.example);
            }
        }
    }

    /// Help fits into the columns that every other output fits into.
    #[test]
    fn help_fits_a_terminal() {
        for (path, command) in walked(&taught(Cli::command()), "") {
            let mut command = command.max_term_width(WIDEST).term_width(WIDEST);
            let text = command.render_long_help().to_string();
            let wide: Vec<&str> = text.lines().filter(|l| l.chars().count() > WIDEST).collect();
            // a word that is longer than a line stands as it is
            assert!(wide.iter().all(|l| l.split_whitespace().count() == 1), "quadrig {path}: {wide:?}");
        }
    }

    /// Every option says what it is; one that takes a number says in which unit.
    #[test]
    fn every_option_says_what_it_is() {
        const UNITS: [&str; 27] = [
            " s.",
            " s,",
            " s;",
            ", s",
            "seconds",
            "us",
            "mm",
            "kg",
            ", N",
            ", m;",
            ", min",
            "A.h",
            "GPa",
            "MPa",
            "degrees",
            "Hz",
            ", V",
            ", g",
            "per cent",
            "noise floors",
            "imes",
            "a number",
            "unit",
            "kg/m^3",
            "rev/min",
            "factor",
            "gain",
        ];
        for (path, command) in walked(&taught(Cli::command()), "") {
            for arg in command.get_arguments().filter(|a| !["help", "version"].contains(&a.get_id().as_str())) {
                let help = arg.get_help().map(|h| h.to_string()).unwrap_or_default();
                assert!(help.len() > 3, "quadrig {path}: {} says nothing", arg.get_id());
                let number = arg.get_value_parser().type_id() == TypeId::of::<f64>();
                let said = format!("{}.", help.trim_end_matches('.')).to_lowercase();
                let unit = UNITS.iter().any(|unit| said.contains(&unit.to_lowercase()));
                assert!(!number || unit, "quadrig {path}: {} has no unit: {help}", arg.get_id());
            }
        }
    }
}
