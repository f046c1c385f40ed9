//! Written pages say what the tool says today.
//!
//! What it is: the effects' pages and one set's page on recorded data are written again and compared byte for byte.
//! What can go wrong: the library or the search changed and nobody wrote the pages again; the message says how.
//! Units: none.
//! Reference: specification `closing-the-loop.md`, step 5 and "Real measurements".

use quadrig_tests::{call, data, root};
use std::path::Path;
use tempfile::TempDir;

/// Files of `fresh` that the committed folder lacks or holds otherwise.
fn stale(fresh: &Path, committed: &Path) -> Vec<String> {
    let mut out = Vec::new();
    for entry in std::fs::read_dir(fresh).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        if std::fs::read(committed.join(&name)).ok() != std::fs::read(&path).ok() {
            out.push(name);
        }
    }
    out.sort();
    out
}

#[test]
fn the_effects_pages_are_current() {
    let folder = TempDir::new().unwrap();
    call(folder.path(), &["--quiet", "effects", "-o", "fresh"]).succeeded();
    let (fresh, committed) = (folder.path().join("fresh"), root().join("docs/effects"));
    let stale = stale(&fresh, &committed);
    assert!(stale.is_empty(), "docs/effects is not what the library says: {stale:?}; run `quadrig effects`");
    let pages = std::fs::read_dir(&fresh).unwrap().count();
    assert!(pages > 2 * 30, "{pages} files");
    let gone: Vec<_> =
        std::fs::read_dir(&committed).unwrap().filter(|e| !fresh.join(e.as_ref().unwrap().file_name()).exists()).collect();
    assert!(gone.is_empty(), "docs/effects holds pages of effects that are no more: {gone:?}");
}

#[test]
fn a_page_on_recorded_data_is_current() {
    let Some(data) = data("the page on recorded data") else { return };
    let folder = TempDir::new().unwrap();
    let set = ["--set", "uiuc-static", "--set", "crazyflie-stand"];
    let words = [&["--quiet", "measured", data.to_str().expect("a plain name"), "-o", "docs"][..], &set].concat();
    call(folder.path(), &words).succeeded();
    let stale = stale(&folder.path().join("docs/measured"), &root().join("docs/measured"));
    assert!(stale.is_empty(), "docs/measured is not what the tool says: {stale:?}; run `quadrig measured DATA`");
    let said = call(folder.path(), &["measured", "no-such-folder"]).refused(&["no such folder"]);
    assert_eq!(said.status, Some(1));
}
