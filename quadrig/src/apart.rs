//! What a command reads and what it writes, kept apart.
//!
//! What it is: every command names its files before it begins ([`Paths`]); an output in the place of an input, or of another output, is
//! refused, and nothing has been read or written yet. So is an input that can be read only once, an output that is no regular file, and one that
//! cannot be written: a file is made where it will be made, and is gone at once.
//! What can go wrong: files that lie in the same place under two names (a link of either kind, `./`) are the same file; hard links are told on Unix
//! alone.
//! Units: none.
//! Reference: specification `formats.md`: no command writes over one of its own inputs.

use crate::Failure;
use crate::trouble::unwritten;
use ident::log::{folder_of, no_regular_file, what_lies_at};
use ident::model::beside;
use std::borrow::Cow;
use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

/// The files and folders of one call.
#[derive(Default)]
pub(crate) struct Paths<'a> {
    inputs: Vec<Cow<'a, Path>>,
    files: Vec<(&'static str, &'a Path)>,
    folders: Vec<(&'static str, &'a Path)>,
    kept: Vec<(&'static str, &'a Path)>,
}

impl<'a> Paths<'a> {
    /// Files that are read.
    pub(crate) fn reads<T: AsRef<Path> + ?Sized + 'a>(mut self, files: impl IntoIterator<Item = &'a T>) -> Self {
        self.inputs.extend(files.into_iter().map(|file| Cow::Borrowed(file.as_ref())));
        self
    }

    /// Files that an input names, and that are read with it.
    pub(crate) fn reads_too(mut self, files: impl IntoIterator<Item = PathBuf>) -> Self {
        self.inputs.extend(files.into_iter().map(Cow::Owned));
        self
    }

    /// A file that is written, under the name of its option.
    pub(crate) fn writes(mut self, option: &'static str, file: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        self.files.extend(file.into_iter().map(|f| (option, f.as_path())));
        self
    }

    /// A folder whose files are replaced.
    pub(crate) fn fills(mut self, option: &'static str, folder: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        self.folders.extend(folder.into_iter().map(|f| (option, f.as_path())));
        self
    }

    /// A folder to whose files others are added.
    pub(crate) fn adds_to(mut self, option: &'static str, folder: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        self.kept.extend(folder.into_iter().map(|f| (option, f.as_path())));
        self
    }

    /// Refuses what cannot be read twice, what cannot be written, and an output in the place of an input or of another output.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        self.inputs.iter().try_for_each(|input| is_readable_again(input))?;
        self.folders.iter().chain(&self.kept).try_for_each(|(option, folder)| is_folder(option, folder))?;
        self.are_apart()?;
        self.files.iter().try_for_each(|(option, file)| is_regular(option, file))?;
        self.files.iter().chain(&self.folders).chain(&self.kept).try_for_each(|(_, output)| has_folder(output))?;
        self.files.iter().chain(&self.folders).try_for_each(|(_, output)| takes_files(output, folder_of(&led(output))))?;
        self.kept.iter().try_for_each(|(_, folder)| takes_files(folder, folder))
    }

    fn are_apart(&self) -> Result<(), Failure> {
        for (option, folder) in &self.kept {
            if self.inputs.iter().any(|input| is_same(input, folder)) {
                let expected = format!("expected another folder for {option}");
                return Err(format!("{}: is an input of this command; {expected}", folder.display()).into());
            }
        }
        for (n, (option, file)) in self.files.iter().enumerate() {
            // a model is read with the file beside it
            if self.inputs.iter().any(|input| is_same(input, file) || is_same(&beside(input), file)) {
                return Err(format!("{}: is an input of this command; expected another file for {option}", file.display()).into());
            }
            if let Some((other, _)) = self.files[..n].iter().find(|(_, other)| is_same(other, file)) {
                return Err(format!("{}: stands for {other} and for {option}; expected a file for each", file.display()).into());
            }
        }
        for (n, (option, folder)) in self.folders.iter().enumerate() {
            let lies_in = |path: &Path| place(path).zip(place(folder)).is_some_and(|(path, folder)| path.starts_with(folder));
            if let Some(input) = self.inputs.iter().find(|input| lies_in(input)) {
                let expected = format!("expected another folder for {option}");
                return Err(format!("{}: is an input and lies in the folder of the results; {expected}", input.display()).into());
            }
            let others = self.files.iter().chain(&self.folders[..n]);
            if let Some((other, path)) = others.into_iter().find(|(_, path)| lies_in(path)) {
                let expected = format!("expected another place for {other}");
                return Err(format!(
                    "{}: lies in the folder of {option}, which is replaced as a whole; {expected}",
                    path.display()
                )
                .into());
            }
        }
        Ok(())
    }
}

/// A pipe or a device gives its bytes once, and an input is looked at before it is read.
pub(crate) fn is_readable_again(input: &Path) -> Result<(), Failure> {
    let kind = std::fs::metadata(input).ok().filter(|found| !found.is_dir()).as_ref().and_then(no_regular_file);
    kind.map_or(Ok(()), |kind| {
        Err(format!("{}: is {kind}, which can be read only once; expected a file: save it to one first", input.display()).into())
    })
}

fn is_regular(option: &str, file: &Path) -> Result<(), Failure> {
    if file == Path::new("-") {
        return Err(format!("-: expected the name of a file for {option}: nothing is written to standard output").into());
    }
    what_lies_at(file).as_ref().and_then(no_regular_file).map_or(Ok(()), |kind| {
        Err(format!("{}: is {kind}, which stays as it is; expected the name of a regular file for {option}", file.display())
            .into())
    })
}

fn is_folder(option: &str, folder: &Path) -> Result<(), Failure> {
    if what_lies_at(folder).is_some_and(|found| !found.is_dir()) {
        return Err(format!("{}: is no folder; expected a folder for {option}", folder.display()).into());
    }
    Ok(())
}

/// One missing folder of an output is made, and no more: a longer path that is not there is a typing error.
fn has_folder(output: &Path) -> Result<(), Failure> {
    let folder = folder_of(output);
    let lacks = |folder: &Path, why: &str| -> Result<(), Failure> {
        let expected = "expected a folder that is there (one that is missing before the name is made)";
        Err(format!("{}: cannot be written ({} {why}); {expected}", output.display(), folder.display()).into())
    };
    match (folder.is_dir(), folder.exists()) {
        (true, _) => Ok(()),
        (_, true) => lacks(folder, "is no folder"),
        _ if folder_of(folder).is_dir() => Ok(()),
        _ => lacks(folder_of(folder), "is not there"),
    }
}

/// Where an output leads, links followed, if it is there.
fn led(output: &Path) -> PathBuf {
    output.canonicalize().unwrap_or_else(|_| output.to_owned())
}

/// Refuses an output in a folder that takes no files: asked before the work, by a file that is gone at once. Of a folder that is missing, the one that
/// it will be made in is asked.
fn takes_files(output: &Path, folder: &Path) -> Result<(), Failure> {
    let Some(there) = folder.ancestors().map(|f| if f == Path::new("") { Path::new(".") } else { f }).find(|f| f.is_dir()) else {
        return Ok(());
    };
    let why = match tempfile::tempfile_in(there) {
        Ok(_) => return Ok(()),
        Err(e) if e.kind() == ErrorKind::NotFound => Error::other(format!("{} takes no files", there.display())),
        // the name of that file would tell nobody anything
        Err(e) => e.kind().into(),
    };
    Err(unwritten(output)(why).into())
}

fn is_same(a: &Path, b: &Path) -> bool {
    place(a).zip(place(b)).is_some_and(|(a, b)| a == b) || is_one_file(a, b)
}

/// Whether two names are hard links to one file.
#[cfg(unix)]
fn is_one_file(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let of = |path: &Path| std::fs::metadata(path).ok().map(|found| (found.dev(), found.ino()));
    of(a).zip(of(b)).is_some_and(|(a, b)| a == b)
}

#[cfg(not(unix))]
fn is_one_file(_: &Path, _: &Path) -> bool {
    false
}

/// Where a path leads, links followed; the last parts need not be there yet.
fn place(path: &Path) -> Option<PathBuf> {
    if let Ok(there) = path.canonicalize() {
        return Some(there);
    }
    let parent = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Some(place_of_folder(parent)?.join(path.file_name()?))
}

fn place_of_folder(folder: &Path) -> Option<PathBuf> {
    if folder == Path::new(".") { std::env::current_dir().ok() } else { place(folder) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn one_folder_may_be_missing() {
        let at = tempfile::tempdir().expect("a folder");
        let path = |name: &str| at.path().join(name);
        fs::write(path("file"), "").expect("a file");
        let checked =
            |path: PathBuf| [Paths::default().writes("-o", [&path]).check(), Paths::default().fills("-o", [&path]).check()];
        checked(path("out/run.csv")).into_iter().for_each(|c| c.expect("one is made"));
        for (name, why) in [("no/such/run.csv", "no is not there"), ("file/run.csv", "file is no folder")] {
            for checked in checked(path(name)) {
                let said = checked.expect_err("to be refused").to_string();
                assert!(said.contains(why) && said.contains("expected a folder"), "{said}");
            }
        }
    }

    /// Not even the superuser makes a file in the kernel's own folder: it is said before the work, without the name of a temporary file.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_that_takes_no_files_is_refused_before_the_work() {
        for output in ["/proc/x", "/proc/x/y"].map(PathBuf::from) {
            for paths in [Paths::default().writes("-o", [&output]), Paths::default().fills("-o", [&output])] {
                let said = paths.check().expect_err("to be refused").to_string();
                assert!(said.starts_with(&format!("{}: cannot be written (", output.display())), "{said}");
                assert!(said.contains("expected a folder that is there") && !said.contains("tmp"), "{said}");
            }
        }
        let kept = Paths::default().adds_to("-o", [&PathBuf::from("/proc")]).check();
        assert!(kept.expect_err("to be refused").to_string().starts_with("/proc: cannot be written ("));
        let at = tempfile::tempdir().expect("a folder");
        let new = at.path().join("out");
        Paths::default().writes("-o", [&new]).check().expect("it takes files");
        assert_eq!(fs::read_dir(at.path()).expect("a folder").count(), 0, "and nothing is left there");
    }

    /// Where a folder is wanted and a file stands, that is what is said.
    #[test]
    fn a_file_in_the_place_of_a_folder_is_told_as_one() {
        let at = tempfile::tempdir().expect("a folder");
        let run = at.path().join("run.csv");
        fs::write(&run, "").expect("a file");
        let said = Paths::default().reads([&run]).fills("-o", [&run]).check().expect_err("to be refused").to_string();
        assert!(said.contains("run.csv: is no folder; expected a folder for -o"), "{said}");
    }

    #[test]
    fn one_place_has_many_names() {
        let at = tempfile::tempdir().expect("a folder");
        let path = |name: &str| at.path().join(name);
        fs::create_dir(path("in")).expect("a folder");
        fs::write(path("in/run.csv"), "").expect("a file");
        let (run, round, new) = (path("in/run.csv"), path("in/../in/run.csv"), path("in/new.csv"));
        let refusal = |paths: Paths| paths.check().expect_err("to be refused").to_string();
        assert!(refusal(Paths::default().reads([&run]).writes("-o", [&round])).contains("is an input of this command"));
        let (model, second) = (path("model.toml"), path("in/../model.discrepancy.toml"));
        assert!(refusal(Paths::default().reads([&model]).writes("-o", [&second])).contains("is an input of this command"));
        let twice = Paths::default().writes("-o", [&new]).writes("--truth", [&path("in/./new.csv")]).check();
        assert!(twice.expect_err("to be refused").to_string().contains("for -o and for --truth"));
        let (inside, outside, deep) = (path("in"), path("out"), path("out/a/b.csv"));
        assert!(refusal(Paths::default().reads([&run]).fills("-o", [&inside])).contains("lies in the folder of the results"));
        assert!(refusal(Paths::default().writes("--page", [&deep]).fills("-o", [&outside])).contains("replaced as a whole"));
        Paths::default().reads([&run]).writes("-o", [&new]).fills("--svg", [&outside]).check().expect("all apart");
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(&run, path("link.csv")).expect("a link");
            assert!(refusal(Paths::default().reads([&run]).writes("-o", [&path("link.csv")])).contains("is an input"));
            fs::hard_link(&run, path("second.csv")).expect("a link");
            let second = path("second.csv");
            let said = refusal(Paths::default().reads([&run]).writes("-o", [&second]));
            assert!(said.contains("second.csv: is an input of this command; expected another file for -o"), "{said}");
            let twice = refusal(Paths::default().writes("-o", [&run]).writes("--truth", [&second]));
            assert!(twice.contains("for -o and for --truth"), "{twice}");
        }
    }
}
