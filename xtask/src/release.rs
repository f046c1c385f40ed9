//! What a lab takes away: flash images, the command line, the book, and what they are.
//!
//! What it is: builds everything anew in a folder of its own and puts it into one folder: both images as ELF and as Intel HEX, the program of
//! this host, the book, the notes of this version, and the SHA-256 of every file. The images hold no path of this machine; the program holds
//! one, that of its source tree, for `quadrig flash`.
//!
//! What can go wrong: changes that are not committed (the notes then say so); a build that is not the same twice: `--twice` builds again
//! elsewhere and names the file that differs.
//!
//! Units: bytes.
//!
//! Reference: Intel Hexadecimal Object File Format, 1988; ELF, program headers; `-C remap-path-prefix`, The rustc book.

use crate::image::{self, PACKAGES};
use crate::place::{BOARD, Place};
use crate::run::{Failure, cargo, output, run};
use crate::{book, folder, setup};
use ihex::Record;
use object::LittleEndian;
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader, ProgramHeader};
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const VERSION: &str = env!("CARGO_PKG_VERSION");
const NOTES: &str = "CHANGELOG.md";
/// Data bytes of a HEX record: what every loader takes.
const RECORD_BYTES: usize = 16;
/// Name of the file of digests, in the form that `sha256sum --check` reads.
const DIGESTS: &str = "SHA256SUMS";

/// Makes the release; with `twice` it is built again elsewhere, and both have to be the same.
pub(crate) fn release(place: &Place, twice: bool) -> Result<(), Failure> {
    let notes = notes(&fs::read_to_string(place.root.join(NOTES))?)?;
    setup::target(place)?;
    book::book(place)?;
    let commit = commit(place)?;
    let target = place.root.join("target");
    let done = target.join(format!("quadrig-{VERSION}"));
    let part = target.join(format!("quadrig-{VERSION}.part"));
    if part.exists() {
        fs::remove_dir_all(&part)?;
    }
    fs::create_dir_all(&part)?;
    built(place, &target.join("ship"), &part)?;
    if twice {
        let again = target.join("ship-again.part");
        fs::create_dir_all(&again)?;
        built(place, &target.join("ship-again"), &again)?;
        let differing = differing(&digests(&part)?, &digests(&again)?);
        fs::remove_dir_all(&again)?;
        if !differing.is_empty() {
            return Err(Failure(format!("built twice, not the same: {}", differing.join(", "))));
        }
        println!("built twice: the same bytes");
    }
    folder::copy(&target.join("book"), &part.join("book"))?;
    let digests = digests(&part)?;
    fs::write(part.join("NOTES.md"), said(&notes, &commit, &sizes(&part, &digests)?))?;
    fs::write(part.join(DIGESTS), digests.iter().map(|(name, digest)| format!("{digest}  {name}\n")).collect::<String>())?;
    if done.exists() {
        fs::remove_dir_all(&done)?;
    }
    fs::rename(&part, &done)?;
    println!("{}", done.display());
    Ok(())
}

/// Builds images and program in a folder and copies them.
fn built(place: &Place, target: &Path, into: &Path) -> Result<(), Failure> {
    run(image::images_in(place, &target.join("fw")).env("CARGO_ENCODED_RUSTFLAGS", nameless(place)?))?;
    for package in PACKAGES {
        let elf = fs::read(target.join("fw").join(BOARD).join("release").join(package))?;
        fs::write(into.join(format!("{package}.elf")), &elf)?;
        let text = hex(&elf).map_err(|error| Failure(format!("{package}: {error}")))?;
        fs::write(into.join(format!("{package}.hex")), text)?;
    }
    let mut host = cargo(place, &["build", "--release", "-p", "quadrig", "--target-dir"]);
    host.arg(target.join("host")).env("CARGO_INCREMENTAL", "0").env("CARGO_ENCODED_RUSTFLAGS", nameless(place)?);
    run(&mut host)?;
    let program = format!("quadrig{}", std::env::consts::EXE_SUFFIX);
    fs::copy(target.join("host/release").join(&program), into.join(program))?;
    Ok(())
}

/// Flags that give the places of this machine the same names everywhere.
fn nameless(place: &Place) -> Result<String, Failure> {
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| std::env::home_dir().map(|home| home.join(".cargo")));
    let home = home.ok_or_else(|| Failure("no home folder: set CARGO_HOME".to_owned()))?;
    let flag = |from: &Path, to: &str| format!("--remap-path-prefix={}={to}", from.display());
    Ok([flag(&place.root, "quadrig"), flag(&home, "cargo")].join("\u{1f}"))
}

/// The commit that is built, and whether the tree holds more than it.
fn commit(place: &Place) -> Result<String, Failure> {
    let git = |words: &[&str]| output(Command::new("git").args(words).current_dir(&place.root));
    let more = if git(&["status", "--porcelain"])?.is_empty() { "" } else { ", with changes that are not committed" };
    Ok(format!("{}{more}", git(&["rev-parse", "HEAD"])?))
}

/// What the changelog says of this version.
fn notes(changelog: &str) -> Result<String, Failure> {
    let of_this = |line: &&str| line.strip_prefix("## ").is_some_and(|rest| rest.split_whitespace().next() == Some(VERSION));
    let mut lines = changelog.lines().skip_while(|line| !of_this(line));
    lines.next().ok_or_else(|| Failure(format!("{NOTES}: no section \"## {VERSION}\"; say there what is new")))?;
    Ok(lines.take_while(|line| !line.starts_with("## ")).collect::<Vec<_>>().join("\n").trim().to_owned())
}

/// An image as Intel HEX: what its loadable segments put at which address of the flash.
fn hex(elf: &[u8]) -> Result<String, Failure> {
    let header = FileHeader32::<LittleEndian>::parse(elf)?;
    let endian = header.endian()?;
    let mut records = Vec::new();
    let mut upper = None;
    for segment in header.program_headers(endian, elf)?.iter().filter(|segment| segment.p_type(endian) == PT_LOAD) {
        let bytes = segment.data(endian, elf).map_err(|()| Failure("a segment lies outside of the file".to_owned()))?;
        let mut address = segment.p_paddr(endian);
        let mut rest = bytes;
        while !rest.is_empty() {
            if upper != Some(address >> 16) {
                upper = Some(address >> 16);
                records.push(Record::ExtendedLinearAddress((address >> 16) as u16));
            }
            // a record does not cross a boundary of 64 KiB
            let (value, others) = rest.split_at(rest.len().min(RECORD_BYTES).min(0x1_0000 - (address as usize & 0xffff)));
            records.push(Record::Data { offset: address as u16, value: value.to_vec() });
            address += value.len() as u32;
            rest = others;
        }
    }
    records.push(Record::EndOfFile);
    Ok(ihex::create_object_file_representation(&records)?)
}

/// The SHA-256 of every file of a folder, by name.
fn digests(folder: &Path) -> Result<Vec<(String, String)>, Failure> {
    let mut out = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next)? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let name = path.strip_prefix(folder)?.display().to_string();
            let digest = Sha256::digest(fs::read(&path)?);
            out.push((name, digest.iter().map(|byte| format!("{byte:02x}")).collect()));
        }
    }
    out.sort();
    Ok(out)
}

/// Names of the files that are not in both, or not the same in both.
fn differing(one: &[(String, String)], other: &[(String, String)]) -> Vec<String> {
    let only = one.iter().filter(|file| !other.contains(file));
    let only_other = other.iter().filter(|file| !one.contains(file));
    let names: BTreeSet<String> = only.chain(only_other).map(|(name, _)| name.clone()).collect();
    names.into_iter().collect()
}

/// A row for each file but the book's: bytes and digest, and for an image what it takes of the chip.
fn sizes(folder: &Path, digests: &[(String, String)]) -> Result<String, Failure> {
    let mut out = "| file | bytes | flash | SRAM | SHA-256 |\n|---|---|---|---|---|\n".to_owned();
    for (name, digest) in digests.iter().filter(|(name, _)| !name.starts_with("book")) {
        let path = folder.join(name);
        let bytes = fs::metadata(&path)?.len();
        let of_chip = if name.ends_with(".elf") {
            let size = image::measure(&path)?;
            format!("{} | {}", size.flash, size.ram)
        } else {
            "- | -".to_owned()
        };
        out += &format!("| {name} | {bytes} | {of_chip} | `{digest}` |\n");
    }
    Ok(out)
}

/// The notes of a release.
fn said(notes: &str, commit: &str, sizes: &str) -> String {
    format!(
        "# Quadrig {VERSION}\n\n{notes}\n\n## Files\n\n{sizes}\nBuilt from commit {commit}, for {}. `sha256sum --check {DIGESTS}` says whether all \
         is as it was built. How to flash an image: `book/how-to/flash.html`.\n",
        std::env::consts::ARCH.to_owned() + "-" + std::env::consts::OS
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ELF file for a board of 32 bits with one segment that is loaded and one that is not.
    fn elf(address: u32, bytes: &[u8]) -> Vec<u8> {
        let mut out = vec![0x7f, b'E', b'L', b'F', 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        let half = |out: &mut Vec<u8>, values: &[u16]| values.iter().for_each(|v| out.extend(v.to_le_bytes()));
        let word = |out: &mut Vec<u8>, values: &[u32]| values.iter().for_each(|v| out.extend(v.to_le_bytes()));
        half(&mut out, &[2, 40]);
        word(&mut out, &[1, address, 52, 0, 0]);
        half(&mut out, &[52, 32, 2, 0, 0, 0]);
        let long = bytes.len() as u32;
        // type, offset, address where it runs, address where it is stored, bytes in the file, in memory, flags, alignment
        word(&mut out, &[PT_LOAD.0, 52 + 64, 0x2000_0000, address, long, long, 4, 1]);
        word(&mut out, &[0x6474_e551, 52 + 64, 0, 0, long, long, 4, 1]);
        out.extend(bytes);
        out
    }

    #[test]
    fn a_hex_file_says_what_lies_where_in_the_flash() {
        let bytes: Vec<u8> = (0..40).collect();
        let text = hex(&elf(0x0800_fff8, &bytes)).expect("an image");
        assert!(text.ends_with(":00000001FF\n") && !text.contains("\n\n"), "{text}");
        let mut upper = 0;
        let mut read = std::collections::BTreeMap::new();
        for record in ihex::Reader::new(&text) {
            match record.expect("a record") {
                Record::ExtendedLinearAddress(value) => upper = u32::from(value) << 16,
                Record::Data { offset, value } => {
                    assert!(usize::from(offset) + value.len() <= 0x1_0000, "{offset:#x}");
                    read.extend(value.iter().zip(upper + u32::from(offset)..).map(|(byte, at)| (at, *byte)));
                }
                Record::EndOfFile => {}
                other => panic!("{other:?}"),
            }
        }
        assert!(read.into_iter().eq((0x0800_fff8..).zip(bytes)));
    }

    #[test]
    fn the_notes_are_those_of_this_version() {
        let text = format!("# Changelog\n\n## 99.0.0\n\nnot this\n\n## {VERSION} (2026)\n\n- this\n\n## 0.0.1\n\n- nor this\n");
        assert_eq!(notes(&text).unwrap(), "- this");
        assert!(notes("# Changelog\n").unwrap_err().to_string().contains(VERSION));
    }

    #[test]
    fn what_differs_is_named_once() {
        let file = |name: &str, digest: &str| (name.to_owned(), digest.to_owned());
        let one = [file("a", "1"), file("b", "2")];
        assert!(differing(&one, &one).is_empty());
        assert_eq!(differing(&one, &[file("a", "1"), file("b", "3"), file("c", "4")]), ["b", "c"]);
    }
}
