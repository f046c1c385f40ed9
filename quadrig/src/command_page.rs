//! The page of the command line in the book.
//!
//! What it is: every command, argument and option as clap knows them, as one Markdown page. A test holds that the page in the
//! tree is this one; with `QUADRIG_BLESS=1` it writes it.
//! What can go wrong: a page that is not what the program says: the test names the command that mends it.
//! Units: as each option states.
//! Reference: `docs/book/reference/command-line.md`; clap's `Command` and `Arg`.

use clap::{Arg, ArgAction, Command, CommandFactory};
use std::fmt::Write as _;

/// Where the page lies.
const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/book/reference/command-line.md");
/// What stands above the commands.
const HEAD: &str = "# Command line\n\n\
    Every command, argument and option, written from the program itself. `quadrig COMMAND --help` says the same.\n\n\
    Every command takes `--quiet`: no progress, no tables, files and exit status only. \
    The exit status is 0 for a result of any kind, 1 for input that is refused, 2 for wrong usage.\n";

/// The page.
fn page() -> String {
    let mut quadrig = crate::Cli::command();
    quadrig.build();
    let mut out = HEAD.to_owned();
    for command in quadrig.get_subcommands().filter(|c| shown(c)) {
        describe(command, &format!("quadrig {}", command.get_name()), 2, &mut out);
    }
    out
}

/// clap's own `help` needs no words, nor what is hidden.
fn shown(command: &Command) -> bool {
    command.get_name() != "help" && !command.is_hide_set()
}

/// One command and what is below it.
fn describe(command: &Command, words: &str, level: usize, out: &mut String) {
    let _ = writeln!(out, "\n{} {words}\n", "#".repeat(level));
    if let Some(about) = command.get_long_about().or(command.get_about()) {
        let _ = writeln!(out, "{}\n", sentence(&about.to_string()));
    }
    let usage = command.clone().render_usage().to_string();
    let usage = usage.trim_start_matches("Usage: ").lines().map(str::trim).collect::<Vec<_>>().join("\n");
    let _ = writeln!(out, "```text\n{usage}\n```");
    let (places, options): (Vec<&Arg>, Vec<&Arg>) = command.get_arguments().filter(|a| told(a)).partition(|a| a.is_positional());
    let mut list = places.into_iter().chain(options).map(argument).collect::<Vec<_>>().join("\n");
    if !list.is_empty() {
        list.insert(0, '\n');
        let _ = writeln!(out, "{list}");
    }
    for text in [command.get_after_long_help().or(command.get_after_help())].into_iter().flatten() {
        let _ = writeln!(out, "\n```text\n{}\n```", text.to_string().trim_end());
    }
    for below in command.get_subcommands().filter(|c| shown(c)) {
        describe(below, &format!("{words} {}", below.get_name()), level + 1, out);
    }
}

/// What every command has is told at the head of the page.
fn told(argument: &Arg) -> bool {
    !argument.is_hide_set() && !["help", "quiet", "version"].contains(&argument.get_id().as_str())
}

/// One argument as an entry of a list.
fn argument(argument: &Arg) -> String {
    let takes = matches!(argument.get_action(), ArgAction::Set | ArgAction::Append);
    let value = argument.get_value_names().map(|names| names.iter().map(|n| format!("<{n}>")).collect::<Vec<_>>().join(" "));
    let value = value.filter(|_| takes).unwrap_or_default();
    let names = [argument.get_short().map(|s| format!("-{s}")), argument.get_long().map(|l| format!("--{l}"))];
    let names = names.into_iter().flatten().collect::<Vec<_>>().join(", ");
    let mut line = format!("- `{}`", format!("{names} {value}").trim());
    if let Some(help) = argument.get_long_help().or(argument.get_help()) {
        let _ = write!(line, ": {}", sentence(&help.to_string()));
    }
    let quoted = |values: Vec<String>| values.iter().map(|v| format!("`{v}`")).collect::<Vec<_>>().join(", ");
    let possible: Vec<String> =
        argument.get_possible_values().iter().filter(|v| !v.is_hide_set()).map(|v| v.get_name().to_owned()).collect();
    if takes && !possible.is_empty() {
        let _ = write!(line, " One of {}.", quoted(possible));
    }
    let default: Vec<String> = argument.get_default_values().iter().map(|v| v.to_string_lossy().into_owned()).collect();
    if takes && default.iter().any(|value| !value.is_empty()) {
        let _ = write!(line, " Default {}.", quoted(default));
    }
    line
}

/// A help text as one paragraph that ends in a full stop, its angle brackets kept from being tags.
fn sentence(text: &str) -> String {
    let mut text = text.split_whitespace().collect::<Vec<_>>().join(" ").replace('<', "&lt;").replace('|', "\\|");
    if !text.ends_with(['.', '!', '?', ':']) {
        text.push('.');
    }
    text
}

#[test]
fn the_page_of_the_command_line_is_what_the_program_says() {
    let wanted = page();
    if std::env::var_os("QUADRIG_BLESS").is_some() {
        std::fs::write(FILE, &wanted).expect("the page can be written");
    }
    let kept = std::fs::read_to_string(FILE).unwrap_or_default();
    let at = kept.lines().zip(wanted.lines()).find(|(a, b)| a != b);
    assert!(
        kept == wanted,
        "docs/book/reference/command-line.md: QUADRIG_BLESS=1 cargo test --release -p quadrig command_page; {at:?}"
    );
}
