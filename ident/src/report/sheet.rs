//! A page made of headings, tables and figures, and the same figures as files.
//!
//! What it is: one self-contained HTML page (no network, no script) whose parts are kept so that each figure can be written alone.
//! What can go wrong: what the system says while files are written; each file appears whole or not at all.
//! Units: none.
//! Reference: specification `identification.md`, item 5.

use super::figure::Figure;
use super::number;
use super::style::{COLOURS, DRAWING, PAGE};
use super::svg::escape;
use crate::log::write_whole;
use crate::verdict::Channels;
use std::path::{Path, PathBuf};

/// A page under construction.
#[derive(Debug, Clone, Default)]
pub struct Sheet {
    title: String,
    body: String,
    figures: Vec<Figure>,
}

impl Sheet {
    /// An empty page with a heading.
    #[must_use]
    pub fn new(title: &str) -> Self {
        Self { title: title.to_owned(), body: format!("<h1>{}</h1>\n", escape(title)), figures: Vec::new() }
    }

    /// A section's heading.
    pub fn section(&mut self, heading: &str) {
        self.body += &format!("<h2>{}</h2>\n", escape(heading));
    }

    /// A paragraph.
    pub fn say(&mut self, text: &str) {
        self.body += &format!("<p>{}</p>\n", escape(text));
    }

    /// A paragraph that must not be overlooked.
    pub fn warn(&mut self, text: &str) {
        self.body += &format!("<p class=\"warn\">{}</p>\n", escape(text));
    }

    /// The section that every verdict's page begins with: the error of each channel before and after.
    pub fn errors(&mut self, channels: &Channels) {
        self.section("Error before and after");
        let rows: Vec<Vec<String>> = channels
            .iter()
            .map(|(name, c)| {
                let (b, a) = (c.before.heldout_rms, c.after.heldout_rms);
                let factor = format!("{:.2}", b / a.max(1e-300));
                let figures =
                    [number(c.noise_floor_rms), number(b), number(a), factor, number(c.before.rms), number(c.after.rms)];
                [name.clone(), c.unit.clone()].into_iter().chain(figures).collect()
            })
            .collect();
        let head = ["channel", "unit", "noise floor", "held-out before", "held-out after", "factor", "rms before", "rms after"];
        self.table(&head, &rows, |_| false);
    }

    /// A table; `chosen` rows stand out.
    pub fn table(&mut self, header: &[&str], rows: &[Vec<String>], chosen: impl Fn(usize) -> bool) {
        let texts: Vec<bool> =
            (0..header.len()).map(|k| k > 0 && rows.iter().any(|r| r.get(k).is_some_and(|c| c.chars().count() > 34))).collect();
        let class = |k: usize| if texts.get(k) == Some(&true) { " class=\"text\"" } else { "" };
        self.body += "<div class=\"wide\"><table><thead><tr>";
        for (k, cell) in header.iter().enumerate() {
            self.body += &format!("<th{}>{}</th>", class(k), escape(cell));
        }
        self.body += "</tr></thead><tbody>";
        for (i, row) in rows.iter().enumerate() {
            self.body += if chosen(i) { "<tr class=\"chosen\">" } else { "<tr>" };
            for (k, cell) in row.iter().enumerate() {
                self.body += &format!("<td{}>{}</td>", class(k), escape(cell));
            }
            self.body += "</tr>";
        }
        self.body += "</tbody></table></div>\n";
    }

    /// Figures side by side where the page is wide enough; those with nothing to show are left out.
    pub fn figures(&mut self, figures: Vec<Figure>) {
        let figures: Vec<Figure> = figures.into_iter().filter(|f| !f.is_empty()).collect();
        if figures.is_empty() {
            return;
        }
        self.body += "<div class=\"figs\">\n";
        for f in figures {
            self.body += &format!("<figure id=\"{}\">{}</figure>\n", escape(&f.id), f.svg());
            self.figures.push(f);
        }
        self.body += "</div>\n";
    }

    /// A drawing of its own kind, as wide as the text.
    pub(crate) fn drawing(&mut self, id: &str, svg: &str) {
        self.body += &format!("<figure id=\"{}\" style=\"max-width:48rem\">{svg}</figure>\n", escape(id));
    }

    /// The page.
    #[must_use]
    pub fn html(&self) -> String {
        format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>{}</title><style>{COLOURS}{DRAWING}{PAGE}</style></head><body>\n{}</body></html>\n",
            escape(&self.title),
            self.body
        )
    }

    /// The figures on the page.
    #[must_use]
    pub fn drawn(&self) -> &[Figure] {
        &self.figures
    }
}

/// Writes each figure as `ID.svg` into a folder, which is made where it is missing.
///
/// # Errors
/// What the system says, with the file.
pub fn write_figures(folder: &Path, figures: &[Figure]) -> Result<Vec<PathBuf>, (PathBuf, std::io::Error)> {
    std::fs::create_dir_all(folder).map_err(|e| (folder.to_owned(), e))?;
    let mut out = Vec::new();
    for f in figures {
        let path = folder.join(format!("{}.svg", f.id));
        write_whole(&path, |sink| sink.write_all(f.file().as_bytes())).map_err(|e| (path.clone(), e))?;
        out.push(path);
    }
    Ok(out)
}
