//! A folder of results that is there whole or not at all.
//!
//! What it is: files that are gathered in memory, written into a folder beside the wanted one, which then takes its place at once: what lies
//! in it is of one run.
//! What can go wrong: a folder that holds anything but earlier results of the same command is left as it is and refused.
//! Units: none.
//! Reference: specification `formats.md`: outputs are written whole or not at all.

use crate::Failure;
use crate::trouble::unwritten;
use ident::report::Figure;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The last part of a path, as a page tells it.
pub(crate) fn name_of(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// Files to be written.
pub(crate) struct Folder<'a> {
    path: &'a Path,
    /// Names that earlier results may have.
    known: fn(&str) -> bool,
    files: Vec<(String, Vec<u8>)>,
}

impl<'a> Folder<'a> {
    /// A folder at `path` that may hold nothing but files of earlier results, whose names are `known`.
    pub(crate) fn new(path: &'a Path, known: fn(&str) -> bool) -> Result<Self, Failure> {
        let folder = Self { path, known, files: Vec::new() };
        folder.is_ours()?;
        Ok(folder)
    }

    /// A folder at `path` that may hold nothing but files of the names that are added.
    pub(crate) fn of_added(path: &'a Path) -> Self {
        Self { path, known: |_| false, files: Vec::new() }
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
    pub(crate) fn write(self) -> Result<(), Failure> {
        self.is_ours()?;
        self.place().map_err(|e| unwritten(self.path)(e).into())
    }

    /// Nothing in the folder is anyone else's.
    fn is_ours(&self) -> Result<(), Failure> {
        if !self.path.exists() {
            return Ok(());
        }
        let refuse = |e: io::Error| format!("{}: {e}; expected a folder", self.path.display());
        for entry in fs::read_dir(self.path).map_err(refuse)? {
            let name = entry.map_err(refuse)?.file_name();
            let name = name.to_string_lossy();
            let added = || self.files.iter().any(|(own, _)| own.split('/').next() == Some(&name));
            if !(self.known)(&name) && !added() {
                let expected = "expected a new folder, or one of earlier results of this command";
                return Err(format!(
                    "{}: holds {name}, which would be mixed up with these results; {expected}",
                    self.path.display()
                )
                .into());
            }
        }
        Ok(())
    }

    fn place(&self) -> io::Result<()> {
        let target = fs::canonicalize(self.path).unwrap_or_else(|_| self.path.to_owned());
        let parent = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        fs::create_dir_all(parent)?;
        let workshop = tempfile::Builder::new().prefix(".quadrig-").tempdir_in(parent)?;
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
pub(crate) fn figures(path: &Path, figures: &[Figure]) -> Result<(), Failure> {
    let mut folder = Folder::of_added(path);
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

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .expect("a folder")
            .map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    fn written(path: &Path, files: &[(&str, &str)]) -> Result<(), Failure> {
        let mut folder = Folder::new(path, |name| ["a", "b", "c"].contains(&name))?;
        files.iter().for_each(|(name, text)| folder.add(*name, *text));
        folder.write()
    }

    #[test]
    fn what_lies_in_it_is_of_one_run() {
        let at = tempfile::tempdir().expect("a folder");
        let path = at.path().join("deep/out");
        written(&path, &[("a", "1"), ("b", "1")]).expect("it is new");
        written(&path, &[("b", "2"), ("c/within", "2")]).expect("it holds earlier results");
        assert_eq!(names(&path), ["b", "c"], "nothing of the run before is left");
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
        assert!(why.contains("notes.txt") && why.contains("expected a new folder"), "{why}");
        assert_eq!(
            (names(&path), fs::read_to_string(path.join("a")).expect("a file").as_str()),
            (vec!["a".to_owned(), "notes.txt".to_owned()], "1")
        );
        fs::write(at.path().join("file"), "").expect("a file");
        assert!(written(&at.path().join("file"), &[]).expect_err("no folder").to_string().contains("expected a folder"));
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
        assert_eq!(names(&at.path().join("there")), ["a"]);
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
