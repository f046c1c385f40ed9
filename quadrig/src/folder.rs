//! A folder of results that is there whole or not at all.
//!
//! What it is: files that are gathered in memory, written into a folder beside the wanted one, which then takes its place at once: what lies
//! in it is of one run. A list of what was written lies among them, with digests: a later run replaces what is on it, unchanged, and no more.
//! What can go wrong: a folder that holds a file which the same command did not write, or one that was changed since, is left as it is and
//! refused.
//! Units: none.
//! Reference: specification `formats.md`: outputs are written whole or not at all; sha256sum(1), whose format the list has.

use crate::Failure;
use crate::trouble::unwritten;
use ident::log::{Log, digest};
use ident::report::Figure;
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The list of what was written: `sha256sum -c` reads it.
pub(crate) const LIST: &str = ".quadrig.sha256";
/// What a folder must be that holds something else.
const EXPECTED: &str = "expected a new or an empty folder: name another one, or move this file away";

/// First line of the list of a command.
pub(crate) fn first_line(command: &str) -> String {
    format!("# written by `quadrig {command}`; what is not listed here, or has changed since, is never replaced")
}

/// Refusal of a folder with a file that is somebody else's.
pub(crate) fn foreign(folder: &Path, name: &str, command: &str) -> Failure {
    format!("{}: holds {name}, which no `quadrig {command}` wrote; {EXPECTED}", folder.display()).into()
}

/// Refusal of a folder with a file that is no longer what was written.
pub(crate) fn changed(folder: &Path, name: &str, command: &str) -> Failure {
    format!("{}: {name} was changed since `quadrig {command}` wrote it; {EXPECTED}", folder.display()).into()
}

/// The last part of a path, as a page tells it.
pub(crate) fn name_of(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// Gives runs whose files are named alike as much of their paths for a name as tells them apart.
pub(crate) fn tell_apart<'l>(logs: impl IntoIterator<Item = &'l mut Log>, paths: &[&Path]) {
    let mut logs: Vec<&mut Log> = logs.into_iter().collect();
    let names: Vec<String> = logs.iter().map(|log| log.name.clone()).collect();
    for (k, log) in logs.iter_mut().enumerate() {
        let alike = names.iter().zip(paths).filter(|(name, _)| **name == names[k]).map(|(_, path)| *path);
        let alike: Vec<&Path> = alike.collect();
        if let Some(path) = paths.get(k).filter(|_| alike.len() > 1) {
            log.name = end_of(path, parts_that_differ(&alike));
        }
    }
}

/// Fewest last parts by which every path of these is another; of one that stands twice as many as the longest has.
fn parts_that_differ(paths: &[&Path]) -> usize {
    let most = paths.iter().map(|path| path.components().count()).max().unwrap_or(1);
    let differ = |parts: &usize| {
        let mut ends: Vec<String> = paths.iter().map(|path| end_of(path, *parts)).collect();
        ends.sort_unstable();
        ends.windows(2).all(|pair| pair[0] != pair[1])
    };
    (1..most).find(differ).unwrap_or(most)
}

/// The last parts of a path.
fn end_of(path: &Path, parts: usize) -> String {
    let all: Vec<_> = path.components().collect();
    all[all.len().saturating_sub(parts)..].iter().collect::<PathBuf>().display().to_string()
}

/// Files to be written.
pub(crate) struct Folder<'a> {
    path: &'a Path,
    /// Whose results they are.
    command: &'static str,
    files: Vec<(String, Vec<u8>)>,
}

impl<'a> Folder<'a> {
    /// A folder at `path` that may hold nothing but what an earlier run of this command wrote.
    pub(crate) fn new(path: &'a Path, command: &'static str) -> Result<Self, Failure> {
        let folder = Self { path, command, files: Vec::new() };
        folder.is_ours()?;
        Ok(folder)
    }

    /// One more file; a name may begin with folders within this one.
    pub(crate) fn add(&mut self, name: impl Into<String>, bytes: impl Into<Vec<u8>>) {
        self.files.push((name.into(), bytes.into()));
    }

    /// More files.
    pub(crate) fn extend(&mut self, files: impl IntoIterator<Item = (String, Vec<u8>)>) {
        self.files.extend(files);
    }

    /// Writes them.
    pub(crate) fn write(mut self) -> Result<(), Failure> {
        self.is_ours()?;
        let list = self.list();
        self.add(LIST, list);
        self.place().map_err(|e| unwritten(self.path)(e).into())
    }

    fn list(&self) -> String {
        let lines: String = self.files.iter().map(|(name, bytes)| format!("{}  {name}\n", digest(bytes))).collect();
        format!("{}\n{lines}", first_line(self.command))
    }

    /// Names and digests of what an earlier run of this command wrote here.
    fn earlier(&self) -> BTreeMap<String, String> {
        let text = fs::read_to_string(self.path.join(LIST)).unwrap_or_default();
        let mut lines = text.lines();
        if lines.next() != Some(&first_line(self.command)) {
            return BTreeMap::new();
        }
        lines.filter_map(|line| line.split_once("  ").map(|(digest, name)| (name.to_owned(), digest.to_owned()))).collect()
    }

    /// Nothing in the folder is anyone else's.
    fn is_ours(&self) -> Result<(), Failure> {
        if !self.path.exists() {
            return Ok(());
        }
        let unread = |e: io::Error| format!("{}: {e}; expected a folder", self.path.display());
        let mut earlier = self.earlier();
        if !earlier.is_empty() {
            let list = fs::read(self.path.join(LIST)).map_err(unread)?;
            earlier.insert(LIST.to_owned(), digest(&list));
        }
        let mut open = vec![String::new()];
        while let Some(within) = open.pop() {
            for entry in fs::read_dir(self.path.join(&within)).map_err(unread)? {
                let entry = entry.map_err(unread)?;
                let name = format!("{within}{}", entry.file_name().to_string_lossy());
                let inner = format!("{name}/");
                if entry.file_type().map_err(unread)?.is_dir() && earlier.keys().any(|known| known.starts_with(&inner)) {
                    open.push(inner);
                    continue;
                }
                match earlier.get(&name) {
                    None => return Err(foreign(self.path, &name, self.command)),
                    Some(known) if *known != digest(&fs::read(entry.path()).map_err(unread)?) => {
                        return Err(changed(self.path, &name, self.command));
                    }
                    Some(_) => {}
                }
            }
        }
        Ok(())
    }

    fn place(&self) -> io::Result<()> {
        let target = fs::canonicalize(self.path).unwrap_or_else(|_| self.path.to_owned());
        let parent = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        fs::create_dir_all(parent)?;
        // the name of the temporary folder would tell nobody anything
        let workshop = tempfile::Builder::new().prefix(".quadrig-").tempdir_in(parent).map_err(|e| io::Error::from(e.kind()))?;
        let [new, old] = ["new", "old"].map(|name| workshop.path().join(name));
        fs::create_dir(&new)?;
        for (name, bytes) in &self.files {
            let path = new.join(name);
            if let Some(within) = path.parent() {
                fs::create_dir_all(within)?;
            }
            fs::write(&path, bytes)?;
            fs::File::open(&path)?.sync_all()?;
        }
        if !target.exists() {
            return fs::rename(&new, &target);
        }
        fs::set_permissions(&new, fs::metadata(&target)?.permissions())?;
        let stands_in = std::env::current_dir().is_ok_and(|here| here.starts_with(&target));
        if !stands_in && exchanged(&new, &target) {
            return Ok(());
        }
        // a folder that somebody stands in, or where another disk begins, stays itself
        fs::create_dir(&old)?;
        moved(&target, &old)?;
        moved(&new, &target).inspect_err(|_| {
            let _ = moved(&old, &target); // back to what was there
        })
    }
}

/// Figures into a folder of their own.
pub(crate) fn figures(mut folder: Folder, figures: &[Figure]) -> Result<(), Failure> {
    folder.extend(figures.iter().map(|figure| (format!("{}.svg", figure.id), figure.file().into_bytes())));
    folder.write()
}

/// Two folders change places at once, where the system can do that.
#[cfg(target_os = "linux")]
fn exchanged(new: &Path, target: &Path) -> bool {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    renameat_with(CWD, new, CWD, target, RenameFlags::EXCHANGE).is_ok()
}

#[cfg(not(target_os = "linux"))]
fn exchanged(_: &Path, _: &Path) -> bool {
    false
}

/// Moves everything in a folder into another.
fn moved(from: &Path, to: &Path) -> io::Result<()> {
    let entries: Vec<PathBuf> = fs::read_dir(from)?.map(|e| e.map(|e| e.path())).collect::<io::Result<_>>()?;
    entries.iter().try_for_each(|entry| entry.file_name().map_or(Ok(()), |name| fs::rename(entry, to.join(name))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_that_are_named_alike_have_more_of_their_paths() {
        let apart = |paths: &[&str]| -> Vec<String> {
            let paths: Vec<&Path> = paths.iter().map(Path::new).collect();
            let named = |path: &&Path| Log { name: name_of(path), ..Log::default() };
            let mut logs: Vec<Log> = paths.iter().map(named).collect();
            tell_apart(&mut logs, &paths);
            logs.into_iter().map(|log| log.name).collect()
        };
        assert_eq!(apart(&["calm/flight.csv", "gusty/flight.csv", "a/b.csv"]), ["calm/flight.csv", "gusty/flight.csv", "b.csv"]);
        assert_eq!(apart(&["1/out/run.csv", "2/out/run.csv"]), ["1/out/run.csv", "2/out/run.csv"]);
        assert_eq!(apart(&["run.csv", "other/run.csv"]), ["run.csv", "other/run.csv"]);
        assert_eq!(apart(&["run.csv", "run.csv"]), ["run.csv", "run.csv"]);
    }

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .expect("a folder")
            .map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    fn written(path: &Path, files: &[(&str, &str)]) -> Result<(), Failure> {
        let mut folder = Folder::new(path, "test")?;
        files.iter().for_each(|(name, text)| folder.add(*name, *text));
        folder.write()
    }

    #[test]
    fn what_lies_in_it_is_of_one_run() {
        let at = tempfile::tempdir().expect("a folder");
        let path = at.path().join("deep/out");
        written(&path, &[("a", "1"), ("b", "1")]).expect("it is new");
        written(&path, &[("b", "2"), ("c/within", "2")]).expect("it holds earlier results");
        assert_eq!(names(&path), [LIST, "b", "c"], "nothing of the run before is left");
        assert_eq!(fs::read_to_string(path.join("c/within")).expect("a file"), "2");
        assert_eq!(names(path.parent().expect("a parent")), ["out"], "and nothing beside it");
    }

    #[test]
    fn what_is_not_ours_is_left_alone() {
        let at = tempfile::tempdir().expect("a folder");
        let path = at.path().join("out");
        written(&path, &[("a", "1")]).expect("it is new");
        fs::write(path.join("notes.txt"), "mine").expect("a file");
        let why = written(&path, &[("a", "2")]).expect_err("it holds notes").to_string();
        assert!(why.contains("holds notes.txt") && why.contains("expected a new or an empty folder"), "{why}");
        assert_eq!(names(&path), [LIST, "a", "notes.txt"]);
        assert_eq!(fs::read_to_string(path.join("a")).expect("a file"), "1");
        fs::write(at.path().join("file"), "").expect("a file");
        assert!(written(&at.path().join("file"), &[]).expect_err("no folder").to_string().contains("expected a folder"));
    }

    /// A name says nothing: what counts is who wrote the file, and whether it is still the same.
    #[test]
    fn a_file_of_our_name_that_is_not_ours_is_left_alone() {
        let at = tempfile::tempdir().expect("a folder");
        let path = at.path().join("out");
        let refused = |command, path: &Path| Folder::new(path, command).err().map(|why| why.to_string()).unwrap_or_default();
        fs::create_dir(&path).expect("a folder");
        fs::write(path.join("a"), "a recording").expect("a file");
        assert!(refused("test", &path).contains("holds a, which no `quadrig test` wrote"), "{}", refused("test", &path));
        fs::remove_file(path.join("a")).expect("a file");
        written(&path, &[("a", "1"), ("c/within", "1")]).expect("it is empty");
        assert!(refused("other", &path).contains("which no `quadrig other` wrote"), "{}", refused("other", &path));
        fs::write(path.join("c/within"), "by hand").expect("a file");
        assert!(refused("test", &path).contains("c/within was changed since `quadrig test` wrote it"));
        assert!(written(&path, &[("a", "2")]).is_err());
        assert_eq!(fs::read_to_string(path.join("c/within")).expect("a file"), "by hand");
        fs::remove_file(path.join("c/within")).expect("a file");
        fs::create_dir(path.join("d")).expect("a folder");
        assert!(refused("test", &path).contains("holds d, which"), "a folder is somebody's");
        fs::remove_dir(path.join("d")).expect("a folder");
        written(&path, &[("b", "2")]).expect("what is left is ours");
        assert_eq!(names(&path), [LIST, "b"]);
    }

    /// A link to a folder stays a link, and the folder behind it gets the results.
    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link() {
        let at = tempfile::tempdir().expect("a folder");
        fs::create_dir(at.path().join("there")).expect("a folder");
        let link = at.path().join("link");
        std::os::unix::fs::symlink(at.path().join("there"), &link).expect("a link");
        written(&link, &[("a", "1")]).expect("it is empty");
        assert!(fs::symlink_metadata(&link).expect("the link").is_symlink());
        assert_eq!(names(&at.path().join("there")), [LIST, "a"]);
    }

    /// Where folders cannot change places their files do, and those that were there are gone.
    #[test]
    fn files_move_one_by_one_too() {
        let at = tempfile::tempdir().expect("a folder");
        let [from, to] = ["from", "to"].map(|name| at.path().join(name));
        for (folder, name) in [(&from, "a"), (&from, "b"), (&to, "c")] {
            fs::create_dir_all(folder).expect("a folder");
            fs::write(folder.join(name), name).expect("a file");
        }
        moved(&from, &to).expect("it moves");
        assert_eq!((names(&from), names(&to)), (vec![], vec!["a".to_owned(), "b".to_owned(), "c".to_owned()]));
    }
}
