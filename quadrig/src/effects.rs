//! `quadrig effects`: the library's pages.
//!
//! What it is: one page and one figure an effect, and the index, written from the library; those on a flight in a folder of their own.
//! What can go wrong: a folder that cannot be written.
//! Units: on the pages.
//! Reference: specification `closing-the-loop.md`, step 5.

use crate::Failure;
use ident::almanac::{Page, almanac};
use ident::log::write_whole;
use ident::report::write_figures;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder of the pages.
    #[arg(short, long, default_value = "docs/effects")]
    output: PathBuf,
}

/// Runs the command.
pub(crate) fn run(args: &Args, quiet: bool) -> Result<(), Failure> {
    let airframe = args.output.join("airframe");
    let count = write(&args.output, almanac())? + write(&airframe, ident::flight::almanac())?;
    if !quiet {
        println!("{count} pages in {} and {}", args.output.display(), airframe.display());
    }
    Ok(())
}

/// Writes pages, their figures and their index into a folder; the number of pages.
fn write(folder: &Path, (pages, index): (Vec<Page>, String)) -> Result<usize, Failure> {
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let write = |name: String, text: &str| {
        let file = folder.join(name);
        write_whole(&file, |out| out.write_all(text.as_bytes())).map_err(|e| format!("{}: {e}", file.display()))
    };
    for page in &pages {
        write(format!("{}.md", page.id), &page.text)?;
    }
    write("README.md".to_owned(), &index)?;
    let drawn: Vec<_> = pages.iter().map(|p| p.figure.clone()).filter(|f| !f.is_empty()).collect();
    write_figures(folder, &drawn).map_err(|(path, e)| format!("{}: {e}", path.display()))?;
    Ok(pages.len())
}
