//! The book's pages: all of them are in its contents, their links lead somewhere, and they are written in short sentences.
//!
//! What it is: checks on the Markdown itself; `cargo xtask book` checks the built site, headings included.
//! What can go wrong: a page that nobody can reach, a link outside `docs/` (dead in the built book), a page whose sentences are long
//! on average, a commit's digest where a reader expects what holds now.
//! Units: words a sentence.
//! Reference: `docs/SUMMARY.md`.

use quadrig_tests::book::{Block, Page, blocks, pages, sentences, words};
use quadrig_tests::root;
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

/// The most words that a page's sentences may have on average.
const MOST_WORDS: f64 = 25.0;

fn read(file: &str) -> String {
    std::fs::read_to_string(root().join(file)).unwrap_or_else(|e| panic!("{file}: {e}"))
}

/// The targets of a page's links and pictures, fenced blocks left out.
fn links(markdown: &str) -> Vec<String> {
    let mut fenced = false;
    let open = markdown.lines().filter(|line| {
        let fence = line.trim_start().starts_with("```");
        fenced ^= fence;
        !fence && !fenced
    });
    let text = open.collect::<Vec<_>>().join("\n");
    let plain: String = text.split('`').step_by(2).collect();
    plain.split("](").skip(1).filter_map(|piece| piece.split_once(')')).map(|(target, _)| target.to_owned()).collect()
}

/// A path without `..`; `None` where it leads out of `docs/`.
fn inside(page: &str, target: &str) -> Option<PathBuf> {
    let mut path = PathBuf::new();
    for part in Path::new(page).parent().unwrap_or(Path::new("")).join(target).components() {
        match part {
            Component::ParentDir if !path.pop() => return None,
            Component::ParentDir | Component::CurDir => {}
            other => path.push(other),
        }
    }
    Some(path)
}

#[test]
fn every_page_is_in_the_contents_once() {
    let listed = links(&read("docs/SUMMARY.md"));
    let once: BTreeSet<&str> = listed.iter().map(String::as_str).collect();
    assert_eq!(once.len(), listed.len(), "a page stands twice in docs/SUMMARY.md");
    let there: Vec<Page> = pages();
    let there: BTreeSet<&str> = there.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(once, there, "left: docs/SUMMARY.md, right: the pages below docs/");
}

/// A page that names a test program names one that cargo builds, and modules that are in it.
#[test]
fn every_test_that_a_page_names_is_there() {
    let contributing = ("CONTRIBUTING.md".to_owned(), read("CONTRIBUTING.md"));
    let all = pages().into_iter().map(|p| (format!("docs/{}", p.name), read(&format!("docs/{}", p.name)))).chain([contributing]);
    let (mut wrong, mut asked) = (Vec::new(), 0);
    for (page, text) in all {
        for line in text.lines().filter(|line| line.contains("cargo test") && line.contains("--test ")) {
            let words: Vec<&str> = line.split(['`', ' ', ')']).filter(|w| !w.is_empty()).collect();
            let after = |flag: &str| words.windows(2).filter(|w| w[0] == flag).map(|w| w[1]).collect::<Vec<_>>();
            // of the whole workspace it is one of the integration tests'
            let package = after("-p").first().map_or("tests".to_owned(), |p| p.replace("quadrig-tests", "tests"));
            let programs = after("--test");
            asked += programs.len();
            let is_there = |program: &&str| root().join(format!("{package}/tests/{program}.rs")).is_file();
            let merged = |program: &&str| package != "tests" || ["suite", "boards"].contains(program);
            wrong.extend(programs.iter().filter(|p| !is_there(p) || !merged(p)).map(|p| format!("{page}: --test {p}")));
            let modules = words.iter().filter_map(|w| w.strip_suffix("::")).filter(|_| package == "tests");
            wrong.extend(modules.filter(|m| !is_there(m)).map(|m| format!("{page}: {m}::")));
        }
    }
    assert!(asked > 10, "{asked} test programs are named");
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn every_link_leads_to_a_file_of_the_book() {
    let dead: Vec<String> = pages()
        .iter()
        .flat_map(|page| links(&page.text).into_iter().map(|target| (page.name.clone(), target)))
        .filter(|(page, target)| {
            let file = target.split('#').next().unwrap_or_default();
            let elsewhere = file.is_empty() || file.starts_with("https://") || file.starts_with("http://");
            !elsewhere && inside(page, file).is_none_or(|path| !root().join("docs").join(path).is_file())
        })
        .map(|(page, target)| format!("{page}: {target}"))
        .collect();
    assert!(dead.is_empty(), "links that lead to no file below docs/:\n{}", dead.join("\n"));
}

#[test]
fn sentences_are_short_on_average() {
    let mut all = pages();
    all.extend(["README.md", "ARCHITECTURE.md"].map(|name| Page { name: name.to_owned(), text: read(name) }));
    let mut long = Vec::new();
    for page in &all {
        let sentences = sentences(&page.text);
        let total: usize = sentences.iter().map(|s| words(s)).sum();
        let mean = total as f64 / sentences.len().max(1) as f64;
        if mean > MOST_WORDS {
            let longest = sentences.iter().max_by_key(|s| words(s)).expect("a sentence");
            long.push(format!("{}: {mean:.1} words a sentence; the longest has {}: {longest}", page.name, words(longest)));
        }
    }
    assert!(long.is_empty(), "more than {MOST_WORDS} words a sentence on average:\n{}", long.join("\n"));
}

/// Something that looks like the abbreviated digest of a commit: seven to forty hexadecimal digits, letters and figures among them.
fn digest(text: &str) -> Option<&str> {
    text.split(|c: char| !c.is_ascii_alphanumeric()).find(|word| {
        let hex = word.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b));
        let both = word.bytes().any(|b| b.is_ascii_digit()) && word.bytes().any(|b| b.is_ascii_alphabetic());
        (7..=40).contains(&word.len()) && hex && both && !power_of_ten(word)
    })
}

/// `1000000e12` is a number.
fn power_of_ten(word: &str) -> bool {
    word.split_once('e').is_some_and(|(a, b)| !a.is_empty() && [a, b].iter().all(|p| p.bytes().all(|c| c.is_ascii_digit())))
}

#[test]
fn no_page_names_a_commit() {
    let found: Vec<String> = pages()
        .iter()
        .flat_map(|page| {
            let prose = sentences(&page.text).into_iter();
            let tables = page.text.lines().filter(|line| line.starts_with(['|', '#'])).map(str::to_owned);
            prose.chain(tables).filter_map(|s| digest(&s).map(|d| format!("{}: {d}", page.name))).collect::<Vec<_>>()
        })
        .collect();
    assert!(found.is_empty(), "a page says what holds now; the history keeps its commits:\n{}", found.join("\n"));
}

#[test]
fn markdown_is_read_as_it_is_meant() {
    let page = "# No words here\n\nOne [two three](four.md) `five six`. Seven!\nEight (nine.)\n\n- ten\n- eleven ![no](no.svg)\n\n| no | no |\n\n```sh x\nno `no`\n```\n  ```text\n  kept\n    more\n  ```\n1. twelve\n";
    let said = ["One two three code. ", "Seven! ", "Eight (nine.) ", "ten ", "eleven ", "twelve "];
    assert_eq!(sentences(page), said);
    assert_eq!(words("Eight (nine.) - +- "), 2);
    assert_eq!(links(page), ["four.md", "no.svg"]);
    let block = |kind: &str, lines: &[&str], line| Block {
        kind: kind.to_owned(),
        lines: lines.iter().map(|l| (*l).to_owned()).collect(),
        line,
    };
    assert_eq!(blocks(page), [block("sh x", &["no `no`"], 12), block("text", &["kept", "  more"], 15)]);
    assert_eq!(inside("a/b.md", "../c.md"), Some(PathBuf::from("c.md")));
    assert_eq!(inside("b.md", "../README.md"), None);
    assert_eq!(digest("the engine of commit de34de5."), Some("de34de5"));
    assert_eq!(digest("1000000e12 deadbeef 2000046 2b8c90"), None);
}
