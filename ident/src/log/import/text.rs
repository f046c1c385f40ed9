//! The bytes of an export as text: UTF-8, UTF-16 or Windows-1252.
//!
//! What it is: the first step of an import; the encoding is told by the bytes alone, and said where it is not UTF-8.
//! What can go wrong: a spreadsheet, a packed or a binary file, and a recording of a flight controller, is refused with what to do; a line longer than [`MAX_LINE`] is refused without
//! being read to its end; UTF-8 with damaged bytes is no Windows-1252.
//! Units: none.
//! Reference: encoding.spec.whatwg.org (crate encoding_rs); Unicode 15, section 23.8 (byte order mark).

use crate::log::{MAX_LINE, Place, ReadError};
use encoding_rs::{Encoding, UTF_16BE, UTF_16LE, WINDOWS_1252};
use std::io::Read;
use std::path::Path;

/// A file as text.
#[derive(Debug)]
pub(super) struct Text {
    /// Without the byte order mark; every line ends with a line feed.
    pub(super) content: String,
    /// Whether the file ended with one.
    pub(super) whole: bool,
    /// What is to be said of its encoding.
    pub(super) note: Option<String>,
}

/// A flight controller's own recording: how its file's name ends, how the file begins, what it is, and how it comes whole.
struct Recording {
    endings: &'static [&'static str],
    magic: &'static [u8],
    name: &'static str,
    whole: &'static str,
}

const RECORDINGS: [Recording; 2] = [
    Recording {
        endings: &["ulg", "ulog"],
        magic: &super::ulog::MAGIC,
        name: "PX4 log (ULog)",
        whole: "copy it from the card once more",
    },
    Recording {
        endings: &["bbl", "bfl"],
        magic: super::blackbox::MAGIC,
        name: "Betaflight Blackbox log",
        whole: "save it from the flash or the card once more",
    },
];

const SPREADSHEET: &str = "a CSV file: open it in the spreadsheet program and save the sheet as 'CSV UTF-8', then import that";

/// How files begin that are no text, what they are and what to do.
const BINARY: [(&[u8], &str, &str); 7] = [
    (b"PK\x03\x04", "a zip file, such as a spreadsheet (.xlsx, .ods)", SPREADSHEET),
    (b"\xD0\xCF\x11\xE0", "an old spreadsheet (.xls)", SPREADSHEET),
    (b"\x1F\x8B", "a packed file (.gz)", "the unpacked file (gunzip)"),
    (b"%PDF", "a PDF", "the table's own file as CSV"),
    (b"MATLAB 5.0", "a MATLAB file", "CSV (writetable)"),
    (b"\x89HDF", "an HDF5 file", "CSV"),
    (b"PAR1", "a Parquet file", "CSV"),
];

/// Reads a file as text; `file` is the name for messages.
pub(super) fn read(file: &str, mut source: impl Read) -> Result<Text, ReadError> {
    let failed = |source| ReadError::Io { file: file.to_owned(), source };
    let mut bytes = Vec::new();
    let (mut line, mut length) = (1, 0);
    loop {
        let from = bytes.len();
        (&mut source).take(1 << 16).read_to_end(&mut bytes).map_err(failed)?;
        if bytes.len() == from {
            break;
        }
        if from == 0 {
            no_recording(file, &bytes)?;
            no_binary(file, &bytes)?;
        }
        for b in &bytes[from..] {
            length += 1;
            if *b == b'\n' {
                (line, length) = (line + 1, 0);
            } else if length > MAX_LINE {
                let found = format!("a line longer than {MAX_LINE} bytes");
                return Err(Place { file, line }.refuse(None, found, "a text file with one short line a sample"));
            }
        }
    }
    if bytes.is_empty() {
        no_recording(file, &bytes)?;
    }
    let (encoding, mark) = encoding(&bytes);
    if encoding == encoding_rs::UTF_8 {
        return of_bytes(file, bytes, mark).map(lines);
    }
    let (content, damaged) = encoding.decode_without_bom_handling(&bytes[mark..]);
    if damaged {
        return Err(Place { file, line: 1 }.refuse(None, format!("damaged {}", encoding.name()), "a CSV text file in UTF-8"));
    }
    Ok(lines(Text { content: content.into_owned(), whole: true, note: Some(format!("text in {}", encoding.name())) }))
}

/// One kind of line end, so that records and lines count alike.
fn lines(text: Text) -> Text {
    let mut content = text.content;
    if content.contains('\r') {
        content = content.replace("\r\n", "\n").replace('\r', "\n");
    }
    let whole = content.is_empty() || content.ends_with('\n');
    if !whole {
        content.push('\n');
    }
    Text { content, whole, ..text }
}

/// A recording is imported as a flight before it comes here, and a file that is called one but does not begin as one is damaged.
fn no_recording(file: &str, head: &[u8]) -> Result<(), ReadError> {
    let place = Place { file, line: 1 };
    let ending = Path::new(file).extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    for r in &RECORDINGS {
        if head.starts_with(r.magic) {
            let expected = "a flight log: make one with `quadrig import FILE -o flight.csv`, and take that";
            return Err(place.refuse(None, format!("a {}", r.name), expected));
        }
        if r.endings.contains(&ending.as_str()) {
            let what = if head.is_empty() { "is empty" } else { "does not begin as one" };
            return Err(place.refuse(
                None,
                format!("by its name a {}, but it {what}", r.name),
                format!("the file as the board wrote it: {}", r.whole),
            ));
        }
    }
    Ok(())
}

fn no_binary(file: &str, head: &[u8]) -> Result<(), ReadError> {
    let known = BINARY.iter().find(|(magic, ..)| head.starts_with(magic));
    known.map_or(Ok(()), |(_, found, expected)| Err(Place { file, line: 1 }.refuse(None, *found, *expected)))
}

/// The encoding that a mark or the zero bytes of every other place tell, and the length of the mark.
fn encoding(bytes: &[u8]) -> (&'static Encoding, usize) {
    if let Some(known) = Encoding::for_bom(bytes) {
        return known;
    }
    let head = &bytes[..bytes.len().min(512) & !1];
    let zeros = |odd: usize| head.iter().skip(odd).step_by(2).filter(|b| **b == 0).count();
    match (zeros(0), zeros(1)) {
        (0, n) if 4 * n > head.len() => (UTF_16LE, 0),
        (n, 0) if 4 * n > head.len() => (UTF_16BE, 0),
        _ => (encoding_rs::UTF_8, 0),
    }
}

/// UTF-8, or else Windows-1252 where nothing in the file is UTF-8 beyond ASCII.
fn of_bytes(file: &str, mut bytes: Vec<u8>, mark: usize) -> Result<Text, ReadError> {
    bytes.drain(..mark);
    let refuse = |at: usize, bytes: &[u8], what: &str| {
        let line = 1 + bytes[..at].iter().filter(|b| **b == b'\n').count();
        Err(Place { file, line }.refuse(None, what, "a CSV text file in UTF-8"))
    };
    if let Some(at) = bytes.iter().position(|b| *b == 0) {
        return refuse(at, &bytes, "a zero byte: a binary or damaged file");
    }
    match String::from_utf8(bytes) {
        Ok(content) => Ok(Text { content, whole: true, note: None }),
        Err(e) => {
            let at = e.utf8_error().valid_up_to();
            let bytes = e.into_bytes();
            // bytes that Windows-1252 leaves open, or letters that are UTF-8 elsewhere in the file
            let open = bytes.iter().any(|b| [0x81, 0x8D, 0x8F, 0x90, 0x9D].contains(b));
            if mark > 0 || open || !bytes[..at].is_ascii() {
                return refuse(at, &bytes, "bytes that are not UTF-8");
            }
            let (content, _) = WINDOWS_1252.decode_without_bom_handling(&bytes);
            Ok(Text { content: content.into_owned(), whole: true, note: Some("text in windows-1252 (not UTF-8)".to_owned()) })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A recording of a flight controller is told for what it is by its name or its first bytes; nobody is sent to a spreadsheet.
    #[test]
    fn recordings_are_told_for_what_they_are() {
        for (file, bytes, words) in [
            ("f.ulg", &b""[..], ["f.ulg:1: by its name a PX4 log (ULog), but it is empty", "copy it from the card"]),
            (
                "F.ULG",
                b"\x00\x81\x02\xffno log",
                ["F.ULG:1: by its name a PX4 log (ULog), but it does not begin as one", "copy it"],
            ),
            ("f.bbl", b"\x99\x01", ["f.bbl:1: by its name a Betaflight Blackbox log, but it does not begin as one", "save it"]),
            ("f.bfl", b"", ["f.bfl:1: by its name a Betaflight Blackbox log, but it is empty", "save it"]),
            ("f.bin", &super::super::ulog::MAGIC, ["f.bin:1: a PX4 log (ULog)", "quadrig import"]),
            ("f.txt", super::super::blackbox::MAGIC, ["f.txt:1: a Betaflight Blackbox log", "quadrig import"]),
        ] {
            let said = read(file, bytes).unwrap_err().to_string();
            assert!(words.iter().all(|w| said.contains(w)) && !said.contains("CSV"), "{said}");
        }
        assert!(read("f.csv", &b"t_s,rpm\n0,1\n"[..]).is_ok());
    }
}
