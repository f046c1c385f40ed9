//! What the README tells people to type is typed here.
//!
//! What it is: every line of the README's `sh` blocks that calls the command line is run, in order, in a folder that looks like a
//! fresh clone; what it writes lands there and not in the work tree.
//! What can go wrong: a command that was renamed, an option that went, a file that does not exist. A block that needs a board
//! carries `sh hardware` and is not run.
//! Units: none.
//! Reference: `README.md`; CommonMark, fenced code blocks.

use quadrig_tests::{cargo_words, quadrig, root};
use std::path::Path;
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// How the README calls the command line.
const CALL: &str = "cargo run --release -- ";

/// The command lines of the blocks whose first word is `sh` and that need no board; a line that ends in a backslash goes on.
fn commands(markdown: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    let (mut fenced, mut wanted, mut goes_on) = (false, false, false);
    for line in markdown.lines().map(str::trim) {
        if let Some(info) = line.strip_prefix("```") {
            let mut words = info.split_whitespace();
            wanted = !fenced && words.next() == Some("sh") && !words.any(|w| w == "hardware");
            (fenced, goes_on) = (!fenced, false);
            continue;
        }
        let line = line.strip_prefix("$ ").unwrap_or(line);
        if !wanted || line.is_empty() || line.starts_with('#') {
            continue;
        }
        let (part, more) = line.strip_suffix('\\').map_or((line, false), |part| (part.trim_end(), true));
        match found.last_mut() {
            Some(last) if goes_on => *last += &format!(" {part}"),
            _ => found.push(part.to_owned()),
        }
        goes_on = more;
    }
    found
}

/// A folder with links to everything in the workspace but the build output and what git ignores.
fn clone_like() -> TempDir {
    let folder = TempDir::new().unwrap();
    for entry in std::fs::read_dir(root()).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name();
        if !["target", "report", "out", ".git"].iter().any(|skipped| name == *skipped) {
            link(&entry.path(), &folder.path().join(name));
        }
    }
    folder
}

#[cfg(unix)]
fn link(from: &Path, to: &Path) {
    std::os::unix::fs::symlink(from, to).unwrap();
}

#[cfg(not(unix))]
fn link(from: &Path, to: &Path) {
    if from.is_file() {
        std::fs::copy(from, to).unwrap();
    }
}

#[test]
fn every_command_of_the_readme_runs() {
    let markdown = std::fs::read_to_string(root().join("README.md")).expect("the project has a README.md");
    let commands: Vec<String> = commands(&markdown).into_iter().filter(|line| line.starts_with(CALL)).collect();
    assert!(!commands.is_empty(), "README.md shows no line `{CALL}...` in a block marked sh");
    let folder = clone_like();
    for command in commands {
        println!("{command}");
        // the very words, with the built program in the place of cargo, so that every line does not wait for cargo
        let line = command.replace(CALL, "\"$QUADRIG\" ");
        let done = Command::new("sh")
            .args(["-c", &line])
            .env("QUADRIG", quadrig())
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .output()
            .expect("a shell");
        assert!(done.status.success(), "`{command}`: {}\n{}", done.status, String::from_utf8_lossy(&done.stderr));
    }
    names_what_it_hides_and_nothing_else(folder.path(), &markdown);
}

/// The verdict of the README's own example: what its scenario hides, and beside it what every rig has.
fn names_what_it_hides_and_nothing_else(folder: &Path, markdown: &str) {
    const EVERY_RIG: [&str; 2] = ["rotor_inertia", "spinup_lag"];
    let verdict = std::fs::read_to_string(folder.join("out/closed/verdict.json")).expect("close-loop writes its verdict");
    let verdict: serde_json::Value = serde_json::from_str(&verdict).expect("JSON");
    let scenario = markdown.lines().find_map(|l| l.split("-- sim ").nth(1)?.split(' ').next()).expect("a line that simulates");
    let scenario: toml::Table = std::fs::read_to_string(root().join(scenario)).expect("the scenario").parse().expect("TOML");
    let ids = |list: Vec<&str>| -> std::collections::BTreeSet<String> { list.into_iter().map(str::to_owned).collect() };
    let hidden = ids(scenario["effect"].as_array().expect("effects").iter().filter_map(|e| e["id"].as_str()).collect());
    let named = ids(verdict["effects"].as_array().expect("effects").iter().filter_map(|e| e["id"].as_str()).collect());
    // a meter that averages over a row of a tenth of a second is every logger's
    let within_a_row = |id: &str| {
        let found = verdict["effects"].as_array().expect("effects").iter().find(|e| e["id"] == id);
        let window = found.and_then(|e| e["parameters"].as_array()?.iter().find(|p| p["name"] == "window")?["value"].as_f64());
        window.is_some_and(|s| s <= 0.1)
    };
    let own: std::collections::BTreeSet<String> =
        named.into_iter().filter(|id| !EVERY_RIG.contains(&id.as_str()) && !within_a_row(id)).collect();
    assert_eq!(own, hidden, "{verdict:#}");
    assert_eq!(verdict["verdict"], "attributed");
}

/// Every command of the program has its row in the README.
#[test]
fn every_command_stands_in_the_readme() {
    let markdown = std::fs::read_to_string(root().join("README.md")).expect("the project has a README.md");
    let rows: Vec<&str> = markdown.lines().filter(|line| line.starts_with("| `")).collect();
    let help = quadrig_tests::call(root(), &["--help"]).succeeded().out;
    let listed = help.lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| !l.is_empty());
    let names: Vec<&str> =
        listed.filter(|l| l.starts_with("  ") && !l.starts_with("   ")).filter_map(|l| l.split_whitespace().next()).collect();
    assert!(names.len() > 25, "{names:?}");
    for name in names.iter().filter(|name| **name != "help") {
        let told = rows
            .iter()
            .any(|row| row.split('`').skip(1).step_by(2).any(|code| code.split([' ', '\\', '|']).next() == Some(name)));
        assert!(told, "README.md has no row for `{name}`");
    }
}

/// In the workspace `cargo run` finds the command line among all programs, as every line of the README takes for granted.
#[test]
fn cargo_run_is_the_command_line() {
    let done = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["run", "--quiet", "--release"])
        .args(cargo_words())
        .args(["--", "--version"])
        .current_dir(root())
        .stdin(Stdio::null())
        .output()
        .expect("cargo runs");
    let out = String::from_utf8_lossy(&done.stdout);
    assert!(done.status.success() && out.starts_with("quadrig "), "{out}{}", String::from_utf8_lossy(&done.stderr));
}

#[test]
fn commands_are_found_in_sh_blocks_only() {
    let markdown = "text cargo run --release -- no\n\n```sh\n# a comment\n$ cargo run --release -- demo\ncargo run --release -- sim a.toml \\\n  -o b.csv\n\ncargo xtask test\n```\n\
                    ```text\ncargo run --release -- no\n```\n  ```sh hardware\n  cargo run --release -- log --port P\n  ```\n```sh run\ncargo run --release -- beam\n```\n";
    let wanted = [
        "cargo run --release -- demo",
        "cargo run --release -- sim a.toml -o b.csv",
        "cargo xtask test",
        "cargo run --release -- beam",
    ];
    assert_eq!(commands(markdown), wanted);
}

/// `CONTRIBUTING.md` names commands of the project's own tasks and files: every one is there.
#[test]
fn what_contributing_names_is_there() {
    let text = std::fs::read_to_string(root().join("CONTRIBUTING.md")).expect("the project has a CONTRIBUTING.md");
    let tasks = std::fs::read_to_string(root().join("xtask/src/main.rs")).expect("the tasks");
    let named = text.split("cargo xtask ").skip(1).filter_map(|rest| rest.split(['`', '\n']).next());
    let mut seen = 0;
    for command in named {
        let mut words = command.split_whitespace();
        let (task, flag) = (words.next().unwrap_or(""), words.next());
        assert!(tasks.contains(&format!("[\"{task}\"")), "no task {task}");
        assert!(flag.is_none_or(|f| !f.starts_with("--") || tasks.contains(f)), "no {command}");
        seen += 1;
    }
    assert!(seen >= 8, "{seen}");
    let links = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    for link in links {
        assert!(root().join(link).is_file(), "no file {link}");
    }
    let folders = text.split('`').filter(|w| w.ends_with('/') && !w.contains(' '));
    for folder in folders {
        assert!(root().join(folder).is_dir(), "no folder {folder}");
    }
}

/// The excerpt of a report is what the program prints of that log today, but for lines that are left out.
#[test]
fn the_excerpt_is_a_report() {
    let Some(data) = quadrig_tests::data("the run of the README's excerpt") else { return };
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let excerpt = readme.split("## What it finds on measured data").nth(1).and_then(|t| t.split("```text\n").nth(1)).unwrap();
    let excerpt = excerpt.split("```").next().unwrap();
    let folder = TempDir::new().unwrap();
    let name = excerpt.lines().find_map(|l| l.strip_suffix(".csv")).expect("the log's name");
    let source = data.join(format!("rig/spitz-esc-test/original/{name}.csv"));
    let at = folder.path();
    let out = format!("{name}.csv");
    quadrig_tests::call(at, &["--quiet", "import", source.to_str().unwrap(), "-o", &out]).succeeded();
    let said = quadrig_tests::call(at, &["close-loop", &out, "-o", "closed"]).succeeded().out;
    let mut lines = said.lines();
    for line in excerpt.lines().filter(|l| !l.is_empty()) {
        assert!(lines.any(|l| l == line), "the README says {line:?}, the program does not:\n{said}");
    }
}
