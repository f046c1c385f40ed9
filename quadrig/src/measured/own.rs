//! What `quadrig measured` may replace.
//!
//! What it is: its summary page and its folder of pages and figures, each known by how it begins; what lies beside them is left alone.
//! What can go wrong: a page of the same name that somebody else wrote, a file of another kind among the pages: refused before any work.
//! Units: none.
//! Reference: `folder.rs`.

use super::page::BEGINNING;
use crate::Failure;
use crate::folder::foreign;
use crate::trouble::unread;
use std::io::Read;
use std::path::Path;

const COMMAND: &str = "measured";
/// Bytes that tell a figure.
const LOOKED_AT: u64 = 400;

/// Refuses a folder in which something would be replaced that is not this command's.
pub(super) fn refuse_others(output: &Path) -> Result<(), Failure> {
    let summary = output.join("measured.md");
    if summary.exists() && !beginning(&summary).starts_with(BEGINNING) {
        return Err(foreign(output, "measured.md", COMMAND));
    }
    let pages = output.join("measured");
    if !pages.exists() {
        return Ok(());
    }
    for entry in std::fs::read_dir(&pages).map_err(unread(&pages))? {
        let path = entry.map_err(unread(&pages))?.path();
        let name = crate::folder::name_of(&path);
        let text = beginning(&path);
        let is_own = match name.rsplit_once('.') {
            Some((stem, "md")) => text.lines().next() == Some(&format!("# {stem}")),
            Some((_, "svg")) => {
                text.lines().nth(1).is_some_and(|line| line.starts_with("<svg") && line.contains("class=\"fig\""))
            }
            _ => name.starts_with(".tmp"), // cut off while it was written
        };
        if !is_own {
            return Err(foreign(output, &format!("measured/{name}"), COMMAND));
        }
    }
    Ok(())
}

fn beginning(path: &Path) -> String {
    let mut bytes = Vec::new();
    // what cannot be read begins as nothing of ours does
    let _ = std::fs::File::open(path).map(|file| file.take(LOOKED_AT).read_to_end(&mut bytes));
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The project's own pages are this command's.
    #[test]
    fn what_it_wrote_it_replaces() {
        let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
        refuse_others(&docs).expect("pages of this command");
    }

    #[test]
    fn what_it_did_not_write_it_leaves_alone() {
        let at = tempfile::tempdir().expect("a folder");
        for (k, name) in ["measured.md", "measured/notes.txt", "measured/spitz-esc-test.md", "measured/a.svg"].iter().enumerate()
        {
            let output = at.path().join(k.to_string());
            std::fs::create_dir_all(output.join("measured")).expect("a folder");
            std::fs::write(output.join("notes.txt"), "beside").expect("a file");
            refuse_others(&output).expect("nothing is in the way");
            std::fs::write(output.join(name), "mine\n").expect("a file");
            let said = refuse_others(&output).expect_err("somebody's").to_string();
            assert!(said.contains(&format!("holds {name}, which no `quadrig measured` wrote")), "{said}");
        }
    }
}
