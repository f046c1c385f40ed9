//! The rooms of `ident/src` import one way.
//!
//! What it is: `lib.rs` states the rooms in the order of their dependencies; each source's paths from the crate's root, its unit tests apart, lead to
//! its own room or to one that stands above it there. `ARCHITECTURE.md` tells of the same rooms in the same order.
//! What can go wrong: a file that stands beside the rooms, a room that `lib.rs` does not state, an arrow that points down: each fails with its place.
//! Units: none.
//! Reference: `ARCHITECTURE.md`, "The rooms of `ident/src`".

use std::path::{Path, PathBuf};

/// Arrows that point down, each with its reason: room, imported room.
const ALLOWED: [(&str, &str); 0] = [];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The rooms in the order of `lib.rs`.
fn rooms() -> Vec<String> {
    let text = read(&root().join("lib.rs"));
    let of_line =
        |line: &str| Some(line.strip_prefix("pub ").unwrap_or(line).strip_prefix("mod ")?.strip_suffix(';')?.to_owned());
    text.lines().filter_map(of_line).collect()
}

/// Every Rust file below a folder, in order.
fn files(folder: &Path, out: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

/// A source without its comments, and without the unit tests, which stand last.
fn code(text: &str) -> String {
    let lines = text.lines().collect::<Vec<_>>();
    let tests = |k: usize| {
        lines[k] == "#[cfg(test)]" && lines.get(k + 1).is_some_and(|next| next.contains("mod ") && next.ends_with('{'))
    };
    let end = (0..lines.len()).find(|k| tests(*k)).unwrap_or(lines.len());
    let bare = |line: &&str| line.split("//").next().unwrap_or_default().to_owned() + "\n";
    lines[..end].iter().map(bare).collect()
}

/// The rooms that a code's paths from the crate's root lead to, with the line of each.
fn imported(code: &str) -> Vec<(usize, String)> {
    let name = |text: &str| text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let mut out = Vec::new();
    for (at, found) in code.match_indices("crate::") {
        let line = code[..at].lines().count().max(1);
        let behind = &code[at + found.len()..];
        let Some(list) = behind.strip_prefix('{') else {
            out.push((line, name(behind)));
            continue;
        };
        // a list of paths: the first name of each
        let (mut depth, mut starts) = (0, true);
        for (k, c) in list.char_indices() {
            match c {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => starts = true,
                c if c.is_whitespace() => {}
                _ if starts => {
                    out.push((line, name(&list[k..])));
                    starts = false;
                }
                _ => {}
            }
        }
    }
    out
}

/// What of the rooms a source in one of them imports that stands below it.
fn downward(rooms: &[String], room: &str, code: &str) -> Vec<(usize, String)> {
    let place = |name: &str| rooms.iter().position(|r| r == name);
    let own = place(room);
    let is_below = |other: &str| place(other) > own || place(other).is_none();
    imported(code).into_iter().filter(|(_, other)| is_below(other)).collect()
}

#[test]
fn every_module_stands_in_a_room() {
    let mut names: Vec<String> = std::fs::read_dir(root())
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .filter(|n| n != "lib.rs")
        .collect();
    names.sort();
    let mut stated = rooms();
    stated.sort();
    assert_eq!(names, stated, "what lies in ident/src, and the rooms that lib.rs states");
}

#[test]
fn imports_run_one_way() {
    let rooms = rooms();
    let mut sources = Vec::new();
    files(&root(), &mut sources);
    let (mut read_in, mut wrong) = (0, Vec::new());
    for path in sources.iter().filter(|p| p.file_name().is_some_and(|n| n != "tests.rs" && n != "lib.rs")) {
        let place = path.strip_prefix(root()).unwrap();
        let room = place.components().next().unwrap().as_os_str().to_str().unwrap();
        let code = code(&read(path));
        read_in += imported(&code).len();
        for (line, other) in downward(&rooms, room, &code) {
            if !ALLOWED.contains(&(room, other.as_str())) {
                wrong.push(format!("ident/src/{}:{line}: {room} imports {other}, which stands below it", place.display()));
            }
        }
    }
    assert!(read_in > 1000, "only {read_in} paths were read");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_page_tells_of_the_same_rooms() {
    let page = read(&root().join("../../ARCHITECTURE.md"));
    let part = page.split("**The rooms of `ident/src`**").nth(1).expect("the rooms of ident/src");
    let table = part.lines().skip_while(|l| !l.starts_with("| --- ")).skip(1).take_while(|l| l.starts_with('|'));
    let told: Vec<String> = table.filter_map(|l| Some(l.strip_prefix("| `")?.split("/`").next()?.to_owned())).collect();
    assert_eq!(told, rooms());
}

/// What the reader of sources makes of every kind of path.
#[test]
fn an_arrow_that_points_down_is_seen() {
    let rooms = ["low", "middle", "high"].map(str::to_owned);
    let text = "//! See [`crate::high`].\nuse crate::low::{A, B};\nuse crate::middle::C; // crate::high\n\nfn f() -> f64 {\n    crate::high::g()\n}\n\n#[cfg(test)]\nmod tests {\n    use crate::high::D;\n}\n";
    assert_eq!(downward(&rooms, "middle", &code(text)), [(6, "high".to_owned())]);
    let list = "use crate::{\n    low::{self, A},\n    high,\n};\n";
    assert_eq!(downward(&rooms, "middle", &code(list)), [(1, "high".to_owned())]);
    assert_eq!(downward(&rooms, "high", &code(list)), []);
    assert_eq!(downward(&rooms, "high", "use crate::elsewhere::A;\n"), [(1, "elsewhere".to_owned())]);
}
