//! `quadrig completions` and `quadrig man`: what a shell and `man` know of the command line.
//!
//! What it is: clap's own description, written as a shell's completions or as manual pages, one a command.
//! What can go wrong: a folder that holds other things.
//! Units: none.
//! Reference: clap_complete, clap_mangen; man(7).

use crate::apart::Paths;
use crate::folder::Folder;
use crate::{Cli, Failure, help};
use clap::CommandFactory;
use clap_complete::{Shell, generate};
use std::path::PathBuf;

/// Arguments of `completions`.
#[derive(clap::Args)]
pub(crate) struct Completions {
    /// The shell; what is printed goes where it looks for completions, such as ~/.local/share/bash-completion/completions/quadrig.
    #[arg(value_enum)]
    shell: Shell,
}

/// Arguments of `man`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder for quadrig.1 and a page for each command; replaced as a whole.
    #[arg(short, long)]
    output: PathBuf,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().fills("-o", [&self.output])
    }
}

/// Prints the completions of a shell.
pub(crate) fn completions(args: &Completions) -> Result<(), Failure> {
    let mut text = Vec::new();
    generate(args.shell, &mut help::taught(Cli::command()), "quadrig", &mut text);
    crate::say::text(&String::from_utf8_lossy(&text));
    Ok(())
}

/// Writes the manual pages.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let mut folder = Folder::new(&args.output, "man")?;
    let mut command = help::taught(Cli::command()).disable_help_subcommand(true);
    command.build();
    let count = add(&mut folder, &command)?;
    folder.write()?;
    if !quiet {
        say!("{}: {count} pages; man -l {}", args.output.display(), args.output.join("quadrig.1").display());
    }
    Ok(())
}

/// Adds the page of a command and of those within it; the number of pages.
fn add(folder: &mut Folder, command: &clap::Command) -> Result<usize, Failure> {
    let name = command.get_display_name().unwrap_or_else(|| command.get_name()).to_owned();
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone()).render(&mut page)?;
    folder.add(format!("{name}.1"), page);
    command.get_subcommands().try_fold(1, |count, inner| Ok(count + add(folder, inner)?))
}
