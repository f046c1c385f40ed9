//! A log file that grows while it is recorded.
//!
//! What it is: whole lines go to `NAME.part` beside the target; at the end it is synced and renamed, so that the target is whole or
//! not there. An earlier file of the target's name is kept under another one.
//! What can go wrong: a full disk. What was written stays, cut at a line's end; what comes after is kept in memory and tried again
//! every second; what finds no room to the end goes to the folder for temporary files, and the message says where.
//! Units: bytes.
//! Reference: specification `formats.md` ("nothing half-written").

use crate::Failure;
use crate::trouble::unwritten;
use ident::log::{place_of, write_whole};
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Time between two attempts on a full disk.
const AGAIN: Duration = Duration::from_secs(1);

/// The file.
pub(crate) struct Spool {
    target: PathBuf,
    part: PathBuf,
    file: File,
    /// Bytes of whole lines that are in the file.
    written: u64,
    waiting: Vec<u8>,
    failed: Option<(Instant, std::io::Error)>,
}

impl Spool {
    /// Creates the part beside `target`, and the folder where it is not there yet.
    pub(crate) fn create(target: &Path) -> Result<Self, Failure> {
        let target = &place_of(target).map_err(unwritten(target))?;
        let mut name = target.file_name().ok_or("-o: expected the name of a file")?.to_owned();
        name.push(".part");
        let part = target.with_file_name(name);
        if std::fs::metadata(&part).is_ok_and(|found| found.len() > 0) {
            let expected = "it is a log: expected another name for it, or for the new one, before anything more is recorded here";
            return Err(format!("{}: left by a recording that was cut off; {expected}", part.display()).into());
        }
        let file = OpenOptions::new().write(true).create(true).truncate(true).open(&part);
        let file = file.map_err(|e| {
            format!("{}: cannot be written ({e}); expected a folder that is there, with rights and room", part.display())
        })?;
        Ok(Self { target: target.to_owned(), part, file, written: 0, waiting: Vec::new(), failed: None })
    }

    /// Adds whole lines. Gives a warning when they cannot be written now, once.
    pub(crate) fn add(&mut self, lines: &str) -> Option<String> {
        self.waiting.extend_from_slice(lines.as_bytes());
        if self.failed.as_ref().is_some_and(|(at, _)| at.elapsed() < AGAIN) {
            return None;
        }
        let news = self.failed.is_none();
        self.flush();
        let (_, error) = self.failed.as_ref().filter(|_| news)?;
        Some(format!("{}: cannot be written to ({error}); rows are kept in memory and tried again", self.part.display()))
    }

    /// Name of the target, for people.
    pub(crate) fn name(&self) -> String {
        self.target.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
    }

    /// Lines wait in memory: the disk takes none.
    pub(crate) fn waits(&self) -> bool {
        self.failed.is_some()
    }

    /// Tries to write what waits.
    fn flush(&mut self) {
        let tried = (|| {
            self.file.seek(SeekFrom::Start(self.written))?;
            self.file.write_all(&self.waiting)
        })();
        match tried {
            Ok(()) => {
                self.written += self.waiting.len() as u64;
                self.waiting.clear();
                self.failed = None;
            }
            Err(error) => {
                // what found room and is whole stays
                let found = self.file.metadata().map_or(self.written, |m| m.len()).saturating_sub(self.written) as usize;
                let kept = self.waiting[..found.min(self.waiting.len())].iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
                self.written += kept as u64;
                self.waiting.drain(..kept);
                let _ = self.file.set_len(self.written);
                self.failed = Some((Instant::now(), error));
            }
        }
    }

    /// Nothing worth keeping: the part goes.
    pub(crate) fn discard(self) {
        let _ = std::fs::remove_file(&self.part);
    }

    /// Syncs and renames; what happened in mid-run goes into the head. What found no room goes to the temporary folder.
    pub(crate) fn finish(mut self, quiet: bool) -> Result<(), Failure> {
        self.flush();
        let synced = self.file.sync_all();
        keep_earlier(&self.target, quiet).map_err(|why| format!("{why}; what was recorded is in {}", self.part.display()))?;
        // where there is no room for a second copy the events stay among the rows, where readers find them as well
        if synced.is_ok() && self.waiting.is_empty() && lifted(&self.part, &self.target).unwrap_or(false) {
            let _ = std::fs::remove_file(&self.part);
            return Ok(());
        }
        synced.and_then(|()| std::fs::rename(&self.part, &self.target)).map_err(|e| {
            format!("{}: cannot be renamed to {} ({e}); what was recorded is there", self.part.display(), self.target.display())
        })?;
        if self.waiting.is_empty() {
            return Ok(());
        }
        let rows = self.waiting.iter().filter(|b| **b == b'\n').count();
        let why = self.failed.take().map_or_else(String::new, |(_, e)| e.to_string());
        let rest = std::env::temp_dir().join(format!("quadrig-rest-{}.csv", std::process::id()));
        match std::fs::write(&rest, &self.waiting) {
            Ok(()) => Err(format!(
                "{}: no room for the last {rows} rows ({why}); they are in {}, without the head",
                self.target.display(),
                rest.display()
            )
            .into()),
            Err(e) => Err(format!(
                "{}: no room for the last {rows} rows ({why}), nor in {} ({e})",
                self.target.display(),
                rest.display()
            )
            .into()),
        }
    }
}

/// Gives an earlier recording at `target` a second name and says so: the new one may take its place.
fn keep_earlier(target: &Path, quiet: bool) -> Result<(), Failure> {
    if let Some(kept) = second_name(target)?.filter(|_| !quiet) {
        crate::replace::tell(target, &kept);
    }
    Ok(())
}

/// Gives what lies at `target` a second name, the first that is free of `NAME-1`, `NAME-2` and so on; where it is found from now on. Nothing where
/// nothing lies there.
pub(crate) fn second_name(target: &Path) -> Result<Option<PathBuf>, Failure> {
    if !std::fs::metadata(target).is_ok_and(|found| found.is_file() && found.len() > 0) {
        return Ok(None);
    }
    let kept = renamed(target).map_err(|e| {
        let expected = "expected a folder in which it can be renamed, or another name for the new one";
        format!("{}: what lies there cannot be kept under another name ({e}); {expected}", target.display())
    })?;
    Ok(Some(kept))
}

/// A link leaves no instant without either name; where the disk knows none the file is renamed.
fn renamed(target: &Path) -> std::io::Result<PathBuf> {
    let words = |part: Option<&std::ffi::OsStr>| part.map(|p| p.to_string_lossy().into_owned()).unwrap_or_default();
    let (stem, ending) = (words(target.file_stem()), words(target.extension()));
    for n in 1_u64.. {
        let name = if ending.is_empty() { format!("{stem}-{n}") } else { format!("{stem}-{n}.{ending}") };
        let second = target.with_file_name(name);
        if second.symlink_metadata().is_ok() {
            continue;
        }
        match std::fs::hard_link(target, &second) {
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(_) => return std::fs::rename(target, &second).map(|()| second),
            Ok(()) => return Ok(second),
        }
    }
    Err(std::io::ErrorKind::AlreadyExists.into())
}

/// Writes what is in `part` to `target` with the events from among its rows in the head; `false` when there are none.
fn lifted(part: &Path, target: &Path) -> std::io::Result<bool> {
    let lines = || -> std::io::Result<_> { Ok(BufReader::new(File::open(part)?).lines()) };
    let is_event = |line: &str| line.starts_with("# event = ");
    let mut events = Vec::new();
    for line in lines()? {
        let line = line?;
        if is_event(&line) {
            events.push(line);
        }
    }
    if events.is_empty() {
        return Ok(false);
    }
    write_whole(target, |out| {
        let mut events = Some(events);
        for line in lines()? {
            let line = line?;
            if is_event(&line) {
                continue;
            }
            if !line.starts_with('#') {
                for event in events.take().into_iter().flatten() {
                    writeln!(out, "{event}")?;
                }
            }
            writeln!(out, "{line}")?;
        }
        Ok(())
    })?;
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_cut_off_is_not_written_over() {
        let folder = tempfile::tempdir().expect("a folder");
        let target = folder.path().join("run.csv");
        std::fs::write(folder.path().join("run.csv.part"), "# quadrig-log 1\n").expect("a part");
        let Err(why) = Spool::create(&target) else { panic!("it was written over") };
        assert!(why.to_string().contains("run.csv.part: left by a recording that was cut off"), "{why}");
        std::fs::write(folder.path().join("run.csv.part"), "").expect("a part");
        Spool::create(&target).expect("there is nothing in it");
    }

    #[test]
    fn an_earlier_recording_keeps_its_rows() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        let text = |name: &str| std::fs::read_to_string(at(name)).expect("a file");
        for n in ["1", "2", "3"] {
            let mut spool = Spool::create(&at("run.csv")).expect("a part");
            assert_eq!(spool.add(&format!("# quadrig-log 1\nt_s\n{n}\n# event = \"1 s: x\"\n")), None);
            spool.finish(true).expect("it ends");
        }
        for (name, n) in [("run-1.csv", "1"), ("run-2.csv", "2"), ("run.csv", "3")] {
            assert!(text(name).ends_with(&format!("t_s\n{n}\n")), "{name}: {}", text(name));
        }
        std::fs::write(at("bare"), "old").expect("a file");
        keep_earlier(&at("bare"), true).expect("it is kept");
        assert_eq!(text("bare-1"), "old");
    }

    #[test]
    fn what_happened_in_mid_run_stands_in_the_head() {
        let folder = tempfile::tempdir().expect("a folder");
        let target = folder.path().join("run.csv");
        let mut spool = Spool::create(&target).expect("a part");
        for lines in
            ["# quadrig-log 1\n# a = 1\nt_s,b,c\n", "0,1,2\n", "# event = \"0.050 s: x\"\n1,1,2\n", "# event = \"1.500 s: y\"\n"]
        {
            assert_eq!(spool.add(lines), None);
        }
        spool.finish(true).expect("it ends");
        let text = std::fs::read_to_string(&target).expect("a log");
        assert_eq!(text, "# quadrig-log 1\n# a = 1\n# event = \"0.050 s: x\"\n# event = \"1.500 s: y\"\nt_s,b,c\n0,1,2\n1,1,2\n");
        assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 1, "and the part is gone");
    }
}
