//! The book, read by tests: its pages, their fenced blocks and their prose.
//!
//! What it is: finders and splitters of Markdown as far as the book uses it; no test of its own.
//! What can go wrong: Markdown that the book does not use so far (tables in HTML, indented code) would count as prose.
//! Units: words a sentence.
//! Reference: `docs/SUMMARY.md`; CommonMark, "Fenced code blocks".

use crate::root;
use std::path::PathBuf;

/// One page of the book.
#[derive(Debug)]
pub struct Page {
    /// Where it lies below `docs/`, with forward slashes.
    pub name: String,
    /// Its Markdown.
    pub text: String,
}

/// A fenced block of a page.
#[derive(Debug, PartialEq)]
pub struct Block {
    /// The words behind the fence.
    pub kind: String,
    /// What stands between the fences.
    pub lines: Vec<String>,
    /// The first of these lines, counted from 1 in the page.
    pub line: usize,
}

/// Every Markdown file below `docs/` but the table of contents, in the order of their names.
///
/// # Panics
/// When `docs/` cannot be read.
#[must_use]
pub fn pages() -> Vec<Page> {
    let docs = root().join("docs");
    let (mut folders, mut found) = (vec![docs.clone()], Vec::<PathBuf>::new());
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder of docs/") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") && !path.ends_with("SUMMARY.md") {
                found.push(path);
            }
        }
    }
    found.sort();
    let name = |path: &PathBuf| path.strip_prefix(&docs).expect("below docs").to_string_lossy().replace('\\', "/");
    found.iter().map(|p| Page { name: name(p), text: std::fs::read_to_string(p).expect("a page") }).collect()
}

/// The fenced blocks of a page; a block inside a list is taken as it stands there, its indent taken off.
///
/// # Panics
/// When a fence is never closed.
#[must_use]
pub fn blocks(markdown: &str) -> Vec<Block> {
    let mut found: Vec<Block> = Vec::new();
    let mut indent = None;
    for (number, line) in markdown.lines().enumerate() {
        let bare = line.trim_start();
        match (bare.strip_prefix("```"), indent) {
            (Some(words), None) => {
                found.push(Block { kind: words.trim().to_owned(), lines: Vec::new(), line: number + 2 });
                indent = Some(line.len() - bare.len());
            }
            (Some(_), Some(_)) => indent = None,
            (None, Some(n)) => found.last_mut().expect("a block").lines.push(line.get(n..).unwrap_or_default().to_owned()),
            (None, None) => {}
        }
    }
    assert!(indent.is_none(), "a fence is never closed: {:?}", found.last());
    found
}

/// The sentences of a page's prose: paragraphs and list entries, without headings, tables, fenced blocks and comments. What stands
/// between backquotes counts as one word, of a link its text, of a picture nothing. The end of a paragraph or entry ends a sentence.
#[must_use]
pub fn sentences(markdown: &str) -> Vec<String> {
    let (mut parts, mut fenced) = (vec![String::new()], false);
    for line in markdown.lines().map(str::trim) {
        let fence = line.starts_with("```");
        fenced ^= fence;
        let (entry, rest) = entry(line);
        if fence || line.is_empty() || line.starts_with(['|', '#']) || line.starts_with("<!--") || entry {
            parts.push(String::new());
        }
        if !fence && !fenced && !line.starts_with(['|', '#']) && !line.starts_with("<!--") {
            let part = parts.last_mut().expect("one");
            part.push(' ');
            part.push_str(rest);
        }
    }
    parts.iter().flat_map(|part| split(&spoken(part))).collect()
}

/// Whether a line begins an entry of a list, and what follows its sign.
fn entry(line: &str) -> (bool, &str) {
    let number = line.split_once(". ").filter(|(n, _)| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()));
    let sign = line.strip_prefix("- ").or_else(|| line.strip_prefix("* ")).or(number.map(|(_, rest)| rest));
    sign.map_or((false, line), |rest| (true, rest))
}

/// A paragraph as it is read aloud: code is one word, a link is its text, a picture is nothing.
fn spoken(part: &str) -> String {
    let code: String = part.split('`').enumerate().map(|(n, piece)| if n % 2 == 1 { "code" } else { piece }).collect();
    let (mut out, mut rest) = (String::new(), code.as_str());
    while let Some((before, link)) = rest.split_once('[') {
        let Some((text, target)) = link.split_once("](") else { break };
        let picture = before.ends_with('!');
        out.push_str(before.trim_end_matches('!'));
        out.push_str(if picture { "" } else { text });
        rest = target.split_once(')').map_or("", |(_, rest)| rest);
    }
    out + rest
}

/// Splits a paragraph behind each full stop, question or exclamation mark that a space follows; only what holds a word is kept.
fn split(part: &str) -> Vec<String> {
    let mut found = vec![String::new()];
    for word in part.split_whitespace() {
        let last = found.last_mut().expect("one");
        last.push_str(word);
        last.push(' ');
        if word.trim_end_matches(['"', ')', '*', '_']).ends_with(['.', '?', '!']) {
            found.push(String::new());
        }
    }
    found.retain(|sentence| words(sentence) > 0);
    found
}

/// How many words a sentence has; a sign by itself is none.
#[must_use]
pub fn words(sentence: &str) -> usize {
    sentence.split_whitespace().filter(|word| word.chars().any(char::is_alphanumeric)).count()
}
