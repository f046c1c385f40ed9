//! Files that are written whole or not at all.
//!
//! What it is: a temporary file in the same folder, synced, then renamed; a link stays a link, and the file behind it is replaced.
//! What can go wrong: what is no regular file (a device, a pipe, a folder) is refused and stays what it is. One missing folder is made,
//! no more: a longer path that is not there is a typing error.
//! Units: none.
//! Reference: specification `formats.md` ("nothing half-written").

use std::fs::Metadata;
use std::io::{Error, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// What lies at a place that is no regular file, in words.
#[must_use]
pub fn no_regular_file(found: &Metadata) -> Option<&'static str> {
    let kind = found.file_type();
    match () {
        () if kind.is_file() => None,
        () if kind.is_dir() => Some("a folder"),
        () if kind.is_symlink() => Some("a link that leads nowhere"),
        () if is_pipe(found) => Some("a pipe"),
        () => Some("a device"),
    }
}

#[cfg(unix)]
fn is_pipe(found: &Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt;
    found.file_type().is_fifo() || found.file_type().is_socket()
}

#[cfg(not(unix))]
fn is_pipe(_: &Metadata) -> bool {
    false
}

/// What lies at a path, links followed; of a link that leads nowhere the link itself. Nothing where nothing lies.
#[must_use]
pub fn what_lies_at(path: &Path) -> Option<Metadata> {
    std::fs::metadata(path).or_else(|_| path.symlink_metadata()).ok()
}

/// The folder that a path lies in.
#[must_use]
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Where a file is to be written: links followed, and a missing folder made.
///
/// # Errors
/// What is no regular file, and what the system says.
pub fn place_of(path: &Path) -> std::io::Result<PathBuf> {
    if let Some(found) = what_lies_at(path) {
        return match no_regular_file(&found) {
            Some(kind) => Err(Error::new(ErrorKind::InvalidInput, format!("{kind}, no regular file"))),
            None if path.is_symlink() => path.canonicalize(),
            None => Ok(path.to_owned()),
        };
    }
    let folder = folder_of(path);
    if !folder.exists() {
        std::fs::create_dir(folder).or_else(|e| if e.kind() == ErrorKind::AlreadyExists { Ok(()) } else { Err(e) })?;
    }
    Ok(path.to_owned())
}

/// Writes a file whole or not at all: temporary file in the same folder, sync, rename.
///
/// # Errors
/// As [`place_of`].
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> std::io::Result<()> {
    let path = place_of(path)?;
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666)); // as any other file: the umask decides
    // the name of the temporary file would tell nobody anything
    let mut file = builder.tempfile_in(folder_of(&path)).map_err(|e| std::io::Error::from(e.kind()))?;
    {
        let mut buffered = std::io::BufWriter::new(file.as_file_mut());
        fill(&mut buffered)?;
        buffered.flush()?;
    }
    file.as_file().sync_all()?;
    file.persist(&path).map_err(|e| e.error)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(path: &Path) -> std::io::Result<()> {
        write_whole(path, |out| out.write_all(b"new"))
    }

    #[test]
    fn one_missing_folder_is_made() {
        let at = tempfile::tempdir().expect("a folder");
        written(&at.path().join("out/a")).expect("one folder is missing");
        assert_eq!(std::fs::read_to_string(at.path().join("out/a")).expect("a file"), "new");
        assert!(written(&at.path().join("no/such/a")).is_err());
        assert!(!at.path().join("no").exists());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link_and_a_special_file_itself() {
        let at = tempfile::tempdir().expect("a folder");
        let path = |name: &str| at.path().join(name);
        std::fs::write(path("there"), "old").expect("a file");
        for (to, link) in [("there", "link"), ("/dev/null", "device"), ("nowhere", "dangling")] {
            std::os::unix::fs::symlink(to, path(link)).expect("a link");
        }
        written(&path("link")).expect("a regular file is behind it");
        assert!(path("link").is_symlink() && std::fs::read_to_string(path("there")).expect("a file") == "new");
        for name in ["device", "dangling", "."] {
            let why = written(&path(name)).expect_err("to be refused").to_string();
            assert!(why.contains("no regular file"), "{why}");
        }
        assert!(path("device").is_symlink() && path("dangling").is_symlink());
    }
}
