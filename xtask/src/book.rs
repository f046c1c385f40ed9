//! The book.
//!
//! What it is: `docs/` as a site by mdBook, and a check that every link of every page that came out leads somewhere.
//!
//! What can go wrong: mdBook cannot be had or finds fault with the book; a link to a page, a figure or a heading that is not
//! there. All of them are listed, a line each.
//!
//! Units: none.
//!
//! Reference: `docs/book/book.toml`, `docs/SUMMARY.md`; HTML Living Standard, "URLs" and "The `id` attribute".

use crate::place::Place;
use crate::run::{Failure, run};
use crate::setup;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};
use std::process::Command;

/// Builds the book and checks it.
pub(crate) fn book(place: &Place) -> Result<(), Failure> {
    let mdbook = setup::mdbook(place)?;
    run(Command::new(mdbook).args(["build", "docs/book"]).current_dir(&place.root))?;
    let site = place.root.join("target/book");
    let pages = Pages::read(&site)?;
    let dead = pages.dead();
    println!(
        "{} pages, {} links, {} lead nowhere",
        pages.links.len(),
        pages.links.values().map(Vec::len).sum::<usize>(),
        dead.len()
    );
    if dead.is_empty() { Ok(()) } else { Err(Failure(format!("links that lead nowhere:\n{}", dead.join("\n")))) }
}

/// Every page of a site: what it links to, and what can be linked to on it.
#[derive(Debug)]
struct Pages {
    site: PathBuf,
    links: BTreeMap<PathBuf, Vec<String>>,
    anchors: BTreeMap<PathBuf, BTreeSet<String>>,
}

impl Pages {
    fn read(site: &Path) -> Result<Self, Failure> {
        let mut pages = Self { site: site.to_owned(), links: BTreeMap::new(), anchors: BTreeMap::new() };
        let mut folders = vec![site.to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder)? {
                let path = entry?.path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|e| e == "html") && !path.ends_with("404.html") {
                    let text = std::fs::read_to_string(&path)?;
                    let both = ["href", "src"].iter().flat_map(|name| values(&text, name));
                    pages.links.insert(path.clone(), both.collect());
                    pages.anchors.insert(path, values(&text, "id").collect());
                }
            }
        }
        Ok(pages)
    }

    /// The links that lead nowhere, a line each.
    fn dead(&self) -> Vec<String> {
        let mut dead = Vec::new();
        for (page, links) in &self.links {
            let shown = page.strip_prefix(&self.site).unwrap_or(page).display();
            dead.extend(links.iter().filter(|link| !self.leads(page, link)).map(|link| format!("{shown}: {link}")));
        }
        dead
    }

    fn leads(&self, page: &Path, link: &str) -> bool {
        if ["http://", "https://", "mailto:", "data:"].iter().any(|scheme| link.starts_with(scheme)) {
            return true;
        }
        let (file, anchor) = link.split_once('#').map_or((link, None), |(file, anchor)| (file, Some(anchor)));
        let mut target = if file.is_empty() { page.to_owned() } else { plain(&page.parent().unwrap_or(page).join(file)) };
        if target.is_dir() {
            target.push("index.html");
        }
        let inside = target.starts_with(&self.site) && target.is_file();
        inside && anchor.is_none_or(|a| a.is_empty() || self.anchors.get(&target).is_some_and(|known| known.contains(a)))
    }
}

/// The values of an attribute in a page.
fn values<'a>(html: &'a str, name: &str) -> impl Iterator<Item = String> + use<'a> {
    let start = format!(" {name}=\"");
    let pieces: Vec<&str> = html.split(start.as_str()).skip(1).collect();
    pieces.into_iter().filter_map(|piece| piece.split_once('"')).map(|(value, _)| value.replace("&amp;", "&"))
}

/// A path without `.` and `..`.
fn plain(path: &Path) -> PathBuf {
    path.components().fold(PathBuf::new(), |mut plain, part| {
        match part {
            Component::ParentDir => {
                plain.pop();
            }
            Component::CurDir => {}
            other => plain.push(other),
        }
        plain
    })
}

#[cfg(test)]
mod tests {
    use super::{Pages, plain, values};
    use std::collections::{BTreeMap, BTreeSet};
    use std::path::{Path, PathBuf};

    #[test]
    fn attributes_are_read() {
        let html = "<a href=\"a.html#x\">a</a> <img src=\"b.svg\"> <h2 id=\"x\">x</h2> <a class=\"c\" href=\"d?e&amp;f\">";
        assert_eq!(values(html, "href").collect::<Vec<_>>(), ["a.html#x", "d?e&f"]);
        assert_eq!(values(html, "id").collect::<Vec<_>>(), ["x"]);
    }

    #[test]
    fn a_path_is_made_plain() {
        assert_eq!(plain(Path::new("/a/b/../c/./d")), PathBuf::from("/a/c/d"));
    }

    #[test]
    fn dead_links_are_told() {
        let site = Path::new(env!("CARGO_MANIFEST_DIR")).to_owned();
        let page = site.join("Cargo.toml"); // a file that exists stands for a page
        let links = ["#here", "#gone", "Cargo.toml#here", "src/main.rs", "src/gone.rs", "../Cargo.toml", "https://x.invalid"];
        let pages = Pages {
            site,
            links: BTreeMap::from([(page.clone(), links.map(str::to_owned).to_vec())]),
            anchors: BTreeMap::from([(page, BTreeSet::from(["here".to_owned()]))]),
        };
        assert_eq!(pages.dead(), ["Cargo.toml: #gone", "Cargo.toml: src/gone.rs", "Cargo.toml: ../Cargo.toml"]);
    }
}
