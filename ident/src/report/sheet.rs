//! A page made of headings, tables and figures, and the same figures as files.
//!
//! What it is: one self-contained HTML page (no network, no script) whose parts are kept so that each figure can be written alone.
//! What can go wrong: what the system says while files are written; each file appears whole or not at all.
//! Units: none.
//! Reference: specification `identification.md`, item 5.

use super::closed::{LOOK, SCRIPT};
use super::figure::Figure;
use super::style::{COLOURS, DRAWING, PAGE};
use super::svg::escape;
use crate::log::write_whole;
use crate::numeric::digits::number;
use crate::verdict::Channels;
use crate::verdict::words::upper;
use std::path::{Path, PathBuf};

/// Letters of a word from which on four columns are too many for a phone.
const LONG: usize = 8;
/// Letters that a phone of 390 px has room for beside each other: 366 px at 7.9 px a letter.
const ROOM: usize = 46;
/// Letters that a column takes beyond its longest word (its padding), and that a column of text takes at least (9 rem).
const PADDING: usize = 2;
const TEXT: usize = 17;
/// Most cells of a wider table whose rows a phone shows one under the other; a longer one keeps its first column in view and scrolls.
const STACKED: usize = 600;
/// Most rows of a table on a closed loop's page.
const LONGEST: usize = 300;
/// Longest CSV that a page holds whole, bytes: a page has some six tables that grow with the run, and keeps to 3 MB.
const MOST_CSV: usize = 200_000;

/// A page under construction.
#[derive(Debug, Clone, Default)]
pub struct Sheet {
    title: String,
    body: String,
    figures: Vec<Figure>,
    /// A closed loop's page: its own look, and tables that can be copied.
    told: bool,
    /// Anchors that are taken.
    anchors: Vec<String>,
    /// Names of files that are taken.
    files: Vec<String>,
}

impl Sheet {
    /// An empty page with a heading.
    #[must_use]
    pub fn new(title: &str) -> Self {
        Self { title: title.to_owned(), body: format!("<h1>{}</h1>\n", escape(title)), ..Self::default() }
    }

    /// An empty page that begins with a sentence.
    #[must_use]
    pub fn told(title: &str, sentence: &str) -> Self {
        // what was found stands large, how much that is and what is left beneath
        let (found, rest) = sentence.split_once(". ").map_or((sentence, ""), |(found, rest)| (found, rest));
        let dot = if rest.is_empty() { "" } else { "." };
        let mut body = format!("<h1>{}{dot}</h1>\n", escape(found));
        if !rest.is_empty() {
            body += &format!("<p class=\"lead\">{}</p>\n", escape(rest));
        }
        Self { title: title.to_owned(), body, told: true, ..Self::default() }
    }

    /// A line in the second rank.
    pub fn soft(&mut self, text: &str) {
        self.body += &format!("<p class=\"soft\">{}</p>\n", escape(text));
    }

    /// Markup as it is.
    pub(crate) fn html_part(&mut self, markup: &str) {
        self.body += markup;
    }

    /// A part that is folded away until the reader opens it.
    pub(crate) fn fold(&mut self, heading: &str, fill: impl FnOnce(&mut Self)) {
        let anchor = self.anchor(heading);
        self.body += &format!("<details id=\"{anchor}\"><summary>{}</summary>\n", escape(heading));
        fill(self);
        self.body += "</details>\n";
    }

    /// A table that can be copied, and downloaded as CSV: `raw` with all digits where it is given, else what is seen. A very long one is cut, and
    /// so is its CSV where that is long.
    pub fn data(&mut self, name: &str, header: &[&str], rows: &[Vec<String>], raw: Option<(&[&str], &[Vec<String>])>) {
        let (head, lines) = raw.unwrap_or((header, rows));
        let (all, most) = (csv(head, lines), LONGEST.min(lines.len()));
        let (file, has) =
            if all.len() > MOST_CSV { (csv(head, &lines[..most]), "the CSV has no more") } else { (all, "the CSV has all") };
        self.with_file(name, &file, |sheet| sheet.table(header, &rows[..rows.len().min(LONGEST)], |_| false));
        if rows.len() > LONGEST {
            self.say(&format!("The first {LONGEST} of {} rows; {has}.", rows.len()));
        }
    }

    /// The same with rows that stand out.
    pub fn chosen(&mut self, name: &str, header: &[&str], rows: &[Vec<String>], chosen: impl Fn(usize) -> bool) {
        self.with_file(name, &csv(header, rows), |sheet| sheet.table(header, rows, chosen));
    }

    /// What `fill` writes, a table or what stands for one, with a file that holds it.
    pub(crate) fn with_file(&mut self, name: &str, csv: &str, fill: impl FnOnce(&mut Self)) {
        self.body += "<div class=\"tab\">";
        let from = self.body.len();
        fill(self);
        // what is no table has no rows to copy
        let copy = if self.body[from..].contains("<table") { "<button class=\"copy\" hidden>copy</button>" } else { "" };
        let (name, file) = (escape(&taken(&mut self.files, name)), data_uri("text/csv", csv));
        self.body += &format!("<p class=\"tools\"><a download=\"{name}.csv\" href=\"{file}\">CSV</a>{copy}</p></div>\n");
    }

    /// Where a page comes from: the program, then what else is known of it, files with their digests for instance.
    pub fn comes_from(&mut self, known: &[(&str, String)]) {
        self.section("Where this comes from");
        let program = ("program", format!("quadrig {}", env!("CARGO_PKG_VERSION")));
        let rows = std::iter::once(&program).chain(known).filter(|(_, value)| !value.is_empty());
        let rows: Vec<Vec<String>> = rows.map(|(what, value)| vec![upper(what), value.clone()]).collect();
        self.data("provenance", &["what", "value"], &rows, None);
    }

    /// A table that can be copied on a closed loop's page.
    pub(crate) fn listed(&mut self, name: &str, header: &[&str], rows: &[Vec<String>], raw: Option<(&[&str], &[Vec<String>])>) {
        if self.told {
            self.data(name, header, rows, raw);
        } else {
            self.table(header, rows, |_| false);
        }
    }

    /// An anchor that no other part has.
    fn anchor(&mut self, heading: &str) -> String {
        taken(&mut self.anchors, &super::closed::slug(heading))
    }

    /// A section's heading.
    pub fn section(&mut self, heading: &str) {
        let anchor = self.anchor(heading);
        let heading = escape(heading);
        self.body += &if self.told {
            format!("<h2 id=\"{anchor}\"><a href=\"#{anchor}\">{heading}</a></h2>\n")
        } else {
            format!("<h2 id=\"{anchor}\">{heading}</h2>\n")
        };
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
            (0..header.len()).map(|k| rows.iter().any(|r| r.get(k).is_some_and(|c| c.chars().count() > 34))).collect();
        let class = |k: usize| if texts.get(k) == Some(&true) { " class=\"text\"" } else { "" };
        let wide = |cell: &String| cell.split(' ').any(|word| word.chars().count() > LONG);
        // the first column has a line of its own on a phone, so that its title asks for no room
        let long = rows.iter().flatten().any(wide) || header.iter().skip(1).any(|name| wide(&(*name).to_owned()));
        let longest = |cell: &str| cell.split(' ').map(|word| word.chars().count()).max().unwrap_or(0);
        let asks = |k: usize| {
            let cells = rows.iter().filter_map(|r| r.get(k)).map(|c| longest(c));
            let word = cells.fold(longest(header[k]), usize::max);
            PADDING + if texts[k] { word.max(TEXT) } else { word }
        };
        let fits = (0..header.len()).map(asks).sum::<usize>() <= ROOM;
        // a phone shows so many columns as one table; of two the second breaks wherever it must
        let narrow = match header.len() {
            0..=2 => true,
            3 => fits,
            4 => !long,
            _ => false,
        };
        let stacked = self.told && !narrow && rows.len() * header.len() <= STACKED;
        self.body += &format!("<div class=\"wide\"><table{}><thead><tr>", if stacked { " class=\"stack\"" } else { "" });
        for (k, cell) in header.iter().enumerate() {
            self.body += &format!("<th{}>{}</th>", class(k), escape(cell));
        }
        self.body += "</tr></thead><tbody>";
        for (i, row) in rows.iter().enumerate() {
            self.body += if chosen(i) { "<tr class=\"chosen\">" } else { "<tr>" };
            for (k, cell) in row.iter().enumerate() {
                let of = if stacked && k > 0 { format!(" data-of=\"{}\"", escape(header[k])) } else { String::new() };
                let cell = if self.told { unbroken(cell) } else { escape(cell) };
                self.body += &format!("<td{}{of}>{cell}</td>", class(k));
            }
            self.body += "</tr>";
        }
        self.body += "</tbody></table></div>\n";
    }

    /// Figures side by side where the page is wide enough; those with nothing to show are left out.
    pub fn figures(&mut self, figures: Vec<Figure>) {
        self.in_grid("figs", figures);
    }

    /// Small figures, three side by side where the page is wide enough.
    pub(crate) fn multiples(&mut self, figures: Vec<Figure>) {
        self.in_grid("figs multiples", figures);
    }

    fn in_grid(&mut self, class: &str, figures: Vec<Figure>) {
        let figures: Vec<Figure> = figures.into_iter().filter(|f| !f.is_empty()).collect();
        if figures.is_empty() {
            return;
        }
        self.body += &format!("<div class=\"{class}\">\n");
        for f in figures {
            let id = escape(&f.id);
            self.body += &if self.told {
                // letters beside a drawing wrap and keep their size on a phone
                let drawn = Figure { captioned: true, ..f.clone() }.svg();
                format!("<figure id=\"{id}\"><figcaption>{}</figcaption>{drawn}</figure>\n", escape(&f.title))
            } else {
                format!("<figure id=\"{id}\">{}</figure>\n", f.svg())
            };
            self.figures.push(f);
        }
        self.body += "</div>\n";
    }

    /// The page.
    #[must_use]
    pub fn html(&self) -> String {
        format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"generator\" content=\"quadrig\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>{}</title><style>{COLOURS}{DRAWING}{PAGE}{}</style></head><body{}>\n{}{}</body></html>\n",
            escape(&self.title),
            if self.told { LOOK } else { "" },
            if self.told { " class=\"told\"" } else { "" },
            self.body,
            if self.told { SCRIPT } else { "" }
        )
    }

    /// The figures on the page.
    #[must_use]
    pub fn drawn(&self) -> &[Figure] {
        &self.figures
    }
}

/// A name that nothing else on the page has: with a number behind it where others had it before.
fn taken(names: &mut Vec<String>, name: &str) -> String {
    let before = names.iter().filter(|known| *known == name).count();
    names.push(name.to_owned());
    if before == 0 { name.to_owned() } else { format!("{name}-{}", before + 1) }
}

/// A cell in which no number with a sign breaks: browsers break lines after a hyphen.
fn unbroken(cell: &str) -> String {
    let word = |word: &str| {
        let signed = word.len() < 16 && word.contains('-') && word.contains(|c: char| c.is_ascii_digit());
        if signed { format!("<span class=\"n\">{}</span>", escape(word)) } else { escape(word) }
    };
    cell.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

/// Rows as CSV.
fn csv(head: &[&str], rows: &[Vec<String>]) -> String {
    let head: Vec<String> = head.iter().map(|h| (*h).to_owned()).collect();
    std::iter::once(&head).chain(rows).map(|row| csv_line(row)).collect()
}

/// A line of CSV.
fn csv_line(cells: &[String]) -> String {
    let quoted = |c: &String| {
        if c.contains([',', '"', '\n']) { format!("\"{}\"", c.replace('"', "\"\"")) } else { c.clone() }
    };
    cells.iter().map(quoted).collect::<Vec<_>>().join(",") + "\n"
}

/// Text as an address that holds it, so that a link downloads it without a network.
pub(crate) fn data_uri(kind: &str, text: &str) -> String {
    let mut out = format!("data:{kind};charset=utf-8,");
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || b",.-_:+()/=;".contains(&byte) {
            out.push(char::from(byte));
        } else {
            out += &format!("%{byte:02X}");
        }
    }
    out
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Four columns with names of runs are too wide for a phone.
    #[test]
    fn long_titles_of_columns_stack_on_a_phone() {
        let html = |titles: [&str; 4]| {
            let mut sheet = Sheet::told("a", "A page.");
            sheet.data(
                "runs",
                &titles,
                &[vec!["thrust, N".to_owned(), "0.3".to_owned(), "0.1".to_owned(), "0.2".to_owned()]],
                None,
            );
            sheet.html()
        };
        assert!(html(["channel", "05_171350", "07_174807", "09_181347"]).contains("class=\"stack\""));
        assert!(!html(["parameter", "value", "95 % interval", "unit"]).contains("class=\"stack\""));
    }

    /// Three columns stack on a phone where their words do not stand beside each other, and only there.
    #[test]
    fn three_columns_that_are_too_wide_stack_on_a_phone() {
        let html = |titles: [&str; 3], row: [&str; 3]| {
            let mut sheet = Sheet::told("a", "A page.");
            sheet.data("names", &titles, &[row.map(str::to_owned).to_vec()], None);
            sheet.html()
        };
        let names = ["Supply voltage sags with the current drawn", "0.67", "battery_discharge"];
        assert!(html(["name", "probability", "effect"], names).contains("class=\"stack\""));
        let digest = "0123456789abcdef".repeat(4);
        assert!(html(["run", "log", "SHA-256"], ["run 1", "run1.csv", &digest]).contains("class=\"stack\""));
        assert!(!html(["parameter", "value", "unit"], ["resistance", "0.0301(2)", "ohm"]).contains("class=\"stack\""));
    }

    #[test]
    fn no_two_files_of_a_page_have_one_name() {
        let rows = vec![vec!["1".to_owned()]];
        let mut sheet = Sheet::told("a", "A page.");
        (0..3).for_each(|_| sheet.data("filter-parameters", &["value"], &rows, None));
        let html = sheet.html();
        for name in ["filter-parameters.csv", "filter-parameters-2.csv", "filter-parameters-3.csv"] {
            assert_eq!(html.matches(&format!("download=\"{name}\"")).count(), 1, "{name}");
        }
    }

    #[test]
    fn a_very_long_table_is_cut_and_says_so() {
        let rows: Vec<Vec<String>> = (0..20_000).map(|k| vec![k.to_string(), "0.123456789".to_owned()]).collect();
        let mut sheet = Sheet::told("a", "A page.");
        sheet.data("levels", &["level", "value"], &rows, None);
        let html = sheet.html();
        assert!(html.contains("The first 300 of 20000 rows; the CSV has no more.") && html.len() < 200_000, "{}", html.len());
        let mut sheet = Sheet::told("a", "A page.");
        sheet.data("levels", &["level", "value"], &rows[..1000], None);
        assert!(sheet.html().contains("The first 300 of 1000 rows; the CSV has all."));
    }
}
