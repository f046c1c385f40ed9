//! `quadrig effects`: the library's pages.
//!
//! What it is: one page and one figure an effect, and the index, written from the library; those on a flight in a folder of their own.
//! What can go wrong: a folder that cannot be written, or that holds pages changed by hand.
//! Units: on the pages.
//! Reference: specification `closing-the-loop.md`, step 5.

use crate::Failure;
use crate::apart::Paths;
use crate::folder::Folder;
use ident::report::almanac::{Page, almanac};
use std::path::PathBuf;

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder of the pages.
    #[arg(short, long, default_value = "docs/effects")]
    output: PathBuf,
}

impl Args {
    /// What it reads and writes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        Paths::default().fills("-o", [&self.output])
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let mut folder = Folder::new(&args.output, "effects")?;
    let count = add(&mut folder, "", almanac()) + add(&mut folder, "airframe/", ident::report::flight_almanac::almanac());
    folder.write()?;
    if !quiet {
        say!("{count} pages in {} and {}", args.output.display(), args.output.join("airframe").display());
    }
    Ok(())
}

/// Adds pages, their figures and their index; the number of pages.
fn add(folder: &mut Folder, within: &str, (pages, index): (Vec<Page>, String)) -> usize {
    folder.add(format!("{within}README.md"), index);
    let count = pages.len();
    for page in pages {
        if !page.figure.is_empty() {
            folder.add(format!("{within}{}.svg", page.figure.id), page.figure.file());
        }
        folder.add(format!("{within}{}.md", page.id), page.text);
    }
    count
}
