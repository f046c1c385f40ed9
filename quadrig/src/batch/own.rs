//! What lies in a batch's folder, told from what is somebody else's.
//!
//! What it is: a folder that batches fill, whole or interrupted, alone or in shares. Results are known by their form, runs' folders by their
//! lists, both tables by the list of their digests, or by their heads where none was written yet.
//! What can go wrong: a file that no batch wrote, or a table that was changed since: refused before anything is written.
//! Units: none.
//! Reference: `folder.rs`, which keeps folders that one run replaces as a whole.

use super::table;
use crate::Failure;
use crate::folder::{LIST, changed, first_line, foreign};
use crate::trouble::unread;
use ident::log::digest;
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::path::Path;

const COMMAND: &str = "batch";
/// How names begin that another share is just writing under, or was when it was cut off.
const UNFINISHED: [&str; 2] = [".tmp", ".quadrig-"];
/// States of a result.
const STATES: [&str; 3] = ["closed", "refused", "failed"];

/// Refuses a folder that holds what no batch wrote.
pub(super) fn refuse_others(output: &Path) -> Result<(), Failure> {
    if !output.exists() {
        return Ok(());
    }
    for name in names(output)? {
        let path = output.join(&name);
        match name.as_str() {
            "runs" if path.is_dir() => refuse_other_results(output, "runs/")?,
            LIST if is_listed(&path) => {}
            _ => match table::heads()?.iter().find(|(table, _)| *table == name) {
                Some((table, head)) if path.is_file() => refuse_other_table(output, table, head)?,
                _ => return Err(foreign(output, &name, COMMAND)),
            },
        }
    }
    Ok(())
}

/// Names in a folder, those excepted that are just being written.
fn names(folder: &Path) -> Result<Vec<String>, Failure> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(unread(folder))? {
        names.push(entry.map_err(unread(folder))?.file_name().to_string_lossy().into_owned());
    }
    names.retain(|name| !UNFINISHED.iter().any(|begin| name.starts_with(begin)));
    names.sort();
    Ok(names)
}

/// Whether a list of digests is a batch's.
fn is_listed(list: &Path) -> bool {
    fs::read_to_string(list).is_ok_and(|text| text.lines().next() == Some(&first_line(COMMAND)))
}

/// Every result and every run's folder within `within`.
fn refuse_other_results(output: &Path, within: &str) -> Result<(), Failure> {
    for name in names(&output.join(within))? {
        let inner = format!("{within}{name}");
        let path = output.join(&inner);
        // the list of a run's folder says what lies in it, and is asked again before that is replaced
        let list = path.join(LIST);
        let is_own = match path.is_dir() {
            true if !list.exists() => {
                refuse_other_results(output, &format!("{inner}/"))?;
                true
            }
            true => is_listed(&list),
            false => is_result(&path, inner.strip_prefix("runs/").unwrap_or(&inner)),
        };
        if !is_own {
            return Err(foreign(output, &inner, COMMAND));
        }
    }
    Ok(())
}

/// Whether a file is the result of a run, which says what it is of.
fn is_result(path: &Path, name: &str) -> bool {
    let read = fs::read_to_string(path).ok().and_then(|text| serde_json::from_str::<Value>(&text).ok());
    let Some((result, of)) = read.zip(name.strip_suffix(".json")) else { return false };
    let text = |key: &str| result.get(key).and_then(Value::as_str);
    text("file") == Some(of) && text("key").is_some() && text("state").is_some_and(|state| STATES.contains(&state))
}

/// A table is a batch's where its digest is on the list, or, before there is one, where it has the columns of one.
fn refuse_other_table(output: &Path, name: &str, head: &[u8]) -> Result<(), Failure> {
    let path = output.join(name);
    // the list after the table: another share writes them the other way round
    let bytes = fs::read(&path).map_err(unread(&path))?;
    let listed = of_table(output, name);
    match (listed.is_empty(), listed.contains(&digest(&bytes))) {
        (_, true) => Ok(()),
        (true, _) if bytes.starts_with(head) => Ok(()),
        (true, _) => Err(foreign(output, name, COMMAND)),
        (false, _) => Err(changed(output, name, COMMAND)),
    }
}

/// Digests of a table that batches have written here; shares that end together each add theirs.
fn of_table(output: &Path, name: &str) -> Vec<String> {
    let list = output.join(LIST);
    let text = fs::read_to_string(&list).ok().filter(|_| is_listed(&list)).unwrap_or_default();
    let of = |line: &str| line.split_once("  ").filter(|(_, of)| *of == name).map(|(digest, _)| digest.to_owned());
    text.lines().filter_map(of).collect()
}

/// Puts tables on the list, before they are written.
pub(super) fn list(output: &Path, tables: &[(&str, Vec<u8>)]) -> std::io::Result<()> {
    let missing = |(name, text): &(&str, Vec<u8>)| {
        let digest = digest(text);
        (!of_table(output, name).contains(&digest)).then(|| format!("{digest}  {name}\n"))
    };
    let lines: String = tables.iter().filter_map(missing).collect();
    if lines.is_empty() {
        return Ok(());
    }
    let path = output.join(LIST);
    let begun = fs::read_to_string(&path).unwrap_or_default();
    let head = if begun.is_empty() { format!("{}\n", first_line(COMMAND)) } else { String::new() };
    // a line that was cut off ends where the next begins
    let end = if begun.is_empty() || begun.ends_with('\n') { "" } else { "\n" };
    let mut file = fs::OpenOptions::new().append(true).create(true).open(&path)?;
    file.write_all(format!("{end}{head}{lines}").as_bytes())?;
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RESULT: &str = r#"{ "key": "k", "file": "day 2/good.csv", "state": "closed" }"#;

    fn refused(output: &Path) -> String {
        refuse_others(output).err().map(|why| why.to_string()).unwrap_or_default()
    }

    fn write(output: &Path, name: &str, text: &[u8]) {
        let path = output.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(path, text).expect("a file");
    }

    /// What a batch wrote that was cut off: results, a file half-written, a run's folder, tables without a list.
    #[test]
    fn an_interrupted_batch_goes_on() {
        let at = tempfile::tempdir().expect("a folder");
        let output = at.path().join("out");
        assert_eq!(refused(&output), "");
        write(&output, "runs/day 2/good.csv.json", RESULT.as_bytes());
        write(&output, "runs/day 2/.tmpA1b2C3", b"half");
        write(&output, &format!("runs/day 2/good.csv/{LIST}"), first_line(COMMAND).as_bytes());
        write(&output, "runs/day 2/good.csv/model.toml", b"of this run");
        for (name, head) in table::heads().expect("tables") {
            write(&output, name, &head);
        }
        assert_eq!(refused(&output), "");
    }

    #[test]
    fn what_no_batch_wrote_is_left_alone() {
        let at = tempfile::tempdir().expect("a folder");
        for (k, (name, text)) in [
            ("notes.txt", "mine"),
            ("manifest.csv", "file,verdict\na,b\n"),
            ("effects.csv", ""),
            ("runs", "no folder"),
            ("runs/good.csv.json", "{}"),
            ("runs/good.csv.json", RESULT),
            ("runs/day 2/notes.txt", "mine"),
            ("runs/good.csv/.quadrig.sha256", "# written by `quadrig close-loop`"),
            (LIST, "# mine"),
        ]
        .into_iter()
        .enumerate()
        {
            let output = at.path().join(k.to_string());
            write(&output, name, text.as_bytes());
            let said = refused(&output);
            assert!(said.contains("which no `quadrig batch` wrote; expected a new or an empty folder"), "{name}: {said}");
        }
    }

    /// Shares that write different tables one after the other know both; what was changed by hand is nobody's to replace.
    #[test]
    fn a_table_is_known_by_its_digest() {
        let at = tempfile::tempdir().expect("a folder");
        let output = at.path();
        for text in ["one", "two"] {
            list(output, &[("manifest.csv", text.as_bytes().to_vec())]).expect("a list");
        }
        for (text, is_known) in [("one", true), ("two", true), ("three", false)] {
            write(output, "manifest.csv", text.as_bytes());
            let said = refused(output);
            assert_eq!(said.is_empty(), is_known, "{text}: {said}");
            assert!(is_known || said.contains("manifest.csv was changed since `quadrig batch` wrote it"), "{said}");
        }
        // a line that was cut off
        write(output, LIST, format!("{}\nabc", first_line(COMMAND)).as_bytes());
        list(output, &[("manifest.csv", b"three".to_vec())]).expect("a list");
        assert_eq!(refused(output), "");
    }
}
