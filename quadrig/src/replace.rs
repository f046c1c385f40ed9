//! A file that takes the place of an earlier one of its name.
//!
//! What it is: what is computed is computed again and replaced: a model, a page, a simulated log, a record of pins, a table of the same columns.
//! Anything else that lies under the name of an output gets a second name first (`NAME-1`), and one line says so: a recording, a calibration, a
//! configuration, notes. Nothing is lost by a typing error.
//! What can go wrong: a folder in which the earlier file cannot be renamed; nothing is written then.
//! Units: none.
//! Reference: specification `formats.md` ("nothing half-written").

use crate::Failure;
use crate::kind::{is_computed, stamped};
use crate::spool::second_name;
use crate::trouble::unwritten;
use ident::log::{FORMAT, Log, write_whole};
use std::io::Write;
use std::path::Path;

/// Writes a file whole. What lies there and was not computed is kept under a second name, unless it is the same.
pub(crate) fn put(path: &Path, text: &str) -> Result<(), Failure> {
    let text = stamped(text);
    put_as(path, &text, |out| out.write_all(text.as_bytes()))
}

/// The same of a file that is too long for the memory: how it begins, and what writes all of it.
pub(crate) fn put_as(path: &Path, begins: &str, fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<(), Failure> {
    let kept = if is_computed(path, begins) { None } else { second_name(path)? };
    if let Err(why) = write_whole(path, fill) {
        kept.iter().for_each(|kept| back(kept, path));
        return Err(unwritten(path)(why).into());
    }
    let Some(kept) = kept else { return Ok(()) };
    if is_same(&kept, path) {
        let _ = std::fs::remove_file(&kept);
    } else {
        tell(path, &kept);
    }
    Ok(())
}

/// The same of a log.
pub(crate) fn put_log(path: &Path, log: &Log) -> Result<(), Failure> {
    put_as(path, &format!("# {FORMAT}"), |out| log.write_to(out))
}

/// Says where an earlier file is found from now on.
pub(crate) fn tell(path: &Path, kept: &Path) {
    note!("{}: there was an earlier file of this name; it is now {}", path.display(), kept.display());
}

/// Undoes a second name.
fn back(kept: &Path, path: &Path) {
    let _ = if path.exists() { std::fs::remove_file(kept) } else { std::fs::rename(kept, path) };
}

fn is_same(a: &Path, b: &Path) -> bool {
    let length = |path: &Path| std::fs::metadata(path).map(|found| found.len()).ok();
    length(a) == length(b) && std::fs::read(a).ok().zip(std::fs::read(b).ok()).is_some_and(|(a, b)| a == b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ident::log::Column;

    #[test]
    fn a_simulated_log_is_replaced() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.csv");
        for rpm in [1.0, 2.0] {
            let columns = ["thrust_n", "rpm"].map(|name| Column { name: name.into(), values: vec![rpm] });
            let mut log = Log { t: vec![0.0], columns: columns.into(), ..Log::default() };
            log.meta.insert("date".into(), toml::Value::String(crate::run_log::SIMULATED.to_owned()));
            put_log(&path, &log).expect("it is written");
        }
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1);
    }

    /// A model of a run as it is written.
    fn as_written(source: &str) -> String {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("model.toml");
        let head = format!("format = \"quadrig-model 1\"\nsource = {source:?}\nstart_pulse_us = 1060.0\n");
        let text = head
            + "[channel.thrust_n]\nrelation = \"polynomial of rpm/1000\"\nc0_n = 0.0\nc1_n_per_krpm = 0.1\nc2_n_per_krpm2 = 0.2\n";
        std::fs::write(&path, text).expect("a file");
        ident::model::Model::read(&path).expect("a model").files().0
    }

    /// Names of what lies in the folder after `earlier` lay at `out` and `text` was written there.
    fn after(earlier: &str, text: &str) -> Vec<String> {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("out"), earlier).expect("a file");
        put(&at("out"), text).expect("it is written");
        assert!(std::fs::read_to_string(at("out")).expect("a file").starts_with(text));
        if let Ok(kept) = std::fs::read_to_string(at("out-1")) {
            assert_eq!(kept, earlier);
        }
        let entries = std::fs::read_dir(folder.path()).expect("a folder");
        let mut names: Vec<String> = entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn what_was_computed_is_replaced_and_all_else_is_kept() {
        let written = as_written("a");
        let model = &*stamped(&written);
        let log = "# quadrig-log 1\nt_s,rpm\n0,1\n";
        let simulated = "# quadrig-log 1\n# date = \"simulated\"\nt_s,rpm\n0,1\n";
        let page = "<!doctype html><meta name=\"generator\" content=\"quadrig\"><title>a run</title>";
        for (earlier, text) in [
            ("", model),
            (model, as_written("b").as_str()),
            (&stamped(page), page.replace("a run", "another").as_str()),
            (simulated, log),
            ("run,k_t,k_q\na,1,2\n", "run,k_t,k_q\nb,1,2\n"),
            (log, log),
            ("notes\n", "notes\n"),
        ] {
            assert_eq!(after(earlier, text), ["out"], "{earlier}");
        }
        for (earlier, text) in [
            (log, simulated),
            ("Notes of the day\n", model),
            ("rest_s = 1.0\n", model),
            (model, simulated),
            ("# quadrig-calibration 1\n[calibrated.current]\nper_count = 0.016\n", "# quadrig-calibration 1\n"),
            (&stamped(page).replace("a run", "the best run"), page),
            (page, page.replace("a run", "another").as_str()),
            ("<!doctype html><title>my diary of runs by quadrig</title>", page),
            (&format!("{model}# tuned by hand\n"), model),
            (&model.replace("c1_n_per_krpm = 0.1", "c1_n_per_krpm = 0.3"), model),
            ("run,k_t,k_q\na,1,2\nthe best one\n", "run,k_t,k_q\nb,1,2\n"),
            ("# Onboard parameters\n1\t1\tA\t1\t6\n", "# Onboard parameters\n1\t1\tA\t2\t6\n"),
            ("t,thrust,torque\n0,1,2\n", "run,k_t,k_q\nb,1,2\n"),
        ] {
            assert_eq!(after(earlier, text), ["out", "out-1"], "{earlier}");
        }
    }
}
