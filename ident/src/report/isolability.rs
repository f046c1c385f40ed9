//! The page of the isolability matrix.
//!
//! What it is: the answer, the matrix as a grid and, for a file of its own, as a drawing, the sizes as a table, the groups with the run that would split them; and the matrix as CSV.
//! What can go wrong: nothing.
//! Units: noise floors, and each cause's own.
//! Reference: docs/isolability.md; isolability matrix, Krysander & Frisk 2008, IEEE Trans. SMC-A 38:1183.

use super::sheet::Sheet;
use super::style::{COLOURS, DRAWING};
use super::svg::escape;
use crate::isolability::{Apart, Isolability, Standing, short};
use std::fmt::Write;

/// Width of the drawing in its own units, as of every figure.
const WIDTH: f64 = 560.0;
/// Room for the names of the rows.
const LEFT: f64 = 240.0;
const TOP: f64 = 84.0;
/// Height of a row: a line of a phone's letters.
const ROW: f64 = 19.0;

/// The page; `from` is what else is known of where it comes from, the digest of its log for instance.
#[must_use]
pub fn isolability(found: &Isolability, from: &[(&str, String)]) -> Sheet {
    let mut sheet = Sheet::told(&format!("Which causes can {} tell apart?", found.run), &found.summary());
    sheet.soft(&format!("{} - {}", found.run, found.length()));
    if !found.found.is_empty() {
        sheet.say(&format!(
            "The log as it is holds {}. They stay in it, each beside every cause but itself.",
            found.found.join(", ")
        ));
    }
    sheet.section("The matrix");
    sheet.say("A row is a cause that is there, a column what it could be taken for. Columns have the numbers of the rows.");
    sheet.with_file("matrix", &isolability_csv(found), |sheet| sheet.html_part(&gridded(found)));
    sheet.section("From which size on");
    sheet.say("Size is the root mean square of what the declared model cannot take up, in noise floors of the channel. From it on the search names the cause, right to a factor of about two.");
    let head = [
        "cause",
        "channel",
        "on this run",
        "named from, floors",
        "parameter at that size",
        "beside the model",
        "told later from",
    ];
    let rows: Vec<Vec<String>> = (0..found.causes.len()).map(|k| row(found, k)).collect();
    sheet.chosen("sizes", &head, &rows, |k| found.standing(k) == Standing::Alike);
    groups(&mut sheet, found);
    rest(&mut sheet, found);
    sheet.section("Noise floors");
    let floors: Vec<Vec<String>> =
        found.channels.iter().map(|(name, floor, unit)| vec![name.clone(), short(*floor), (*unit).to_owned()]).collect();
    sheet.data("floors", &["channel", "noise floor", "unit"], &floors, None);
    sheet.comes_from(from);
    sheet
}

/// The look of the matrix: a name beside its cells, on a phone above them.
const GRID: &str = "<style>
.matrix{display:grid;grid-template-columns:max-content repeat(var(--n),minmax(0,1fr));gap:2px;align-items:center;max-width:64rem;margin:.6rem 0;font-size:.9rem}
.matrix span{padding-right:.5rem;white-space:nowrap}.matrix b{font-weight:400;font-size:.8rem;text-align:center;color:var(--soft);overflow:visible;white-space:nowrap;width:0;justify-self:center;display:flex;justify-content:center}
.matrix i,.look i{display:block;print-color-adjust:exact;-webkit-print-color-adjust:exact}.look{display:flex;flex-wrap:wrap;gap:.2rem 1.2rem;font-size:.9rem}.look span{display:flex;align-items:center;gap:.4rem}.look i{width:.9rem}
i.l0{height:.35rem;background:var(--c)}i.l1{height:.7rem;background:var(--f)}i.l2{height:1.1rem;background:var(--b)}i.l3{height:.15rem;background:var(--d);opacity:.4}
@media screen and (max-width:700px){.matrix{grid-template-columns:repeat(var(--n),minmax(0,1fr));gap:1px}.matrix span{grid-column:1/-1;padding-top:.5rem}.matrix .corner{display:none}}
</style>
";

/// The matrix as a grid of the page's own letters, which keep their size whatever its width.
fn gridded(found: &Isolability) -> String {
    let shown = judged(found);
    let mut out = format!("{GRID}<p class=\"look\">");
    for (look, (_, _, text)) in LOOKS.iter().enumerate() {
        let _ = write!(out, "<span><i class=\"l{look}\"></i>{text}</span>");
    }
    let _ = write!(out, "</p>\n<div class=\"matrix\" style=\"--n:{}\"><span class=\"corner\"></span>", shown.len().max(1));
    for k in &shown {
        let number = if is_numbered(*k) { (k + 1).to_string() } else { String::new() };
        let _ = write!(out, "<b>{number}</b>");
    }
    for k in &shown {
        let cause = &found.causes[*k];
        let _ = write!(out, "\n<span>{} {}</span>", k + 1, escape(&cause.name));
        for other in &shown {
            match cell(found, *k, *other) {
                Some((look, text)) => {
                    let rival = escape(&found.causes[*other].name);
                    let _ = write!(out, "<i class=\"l{look}\" title=\"{} for {rival}: {text}\"></i>", escape(&cause.name));
                }
                None => out += "<i></i>",
            }
        }
    }
    out + "</div>\n"
}

/// Whether the column of a cause has its number above it: every fifth, which the eye counts from.
fn is_numbered(k: usize) -> bool {
    k == 0 || (k + 1).is_multiple_of(5)
}

fn row(found: &Isolability, k: usize) -> Vec<String> {
    let cause = &found.causes[k];
    let later: Vec<String> = found
        .later(cause)
        .into_iter()
        .map(|(name, at)| at.map_or_else(|| format!("{name} (never)"), |at| format!("{name} ({})", short(at))))
        .collect();
    let seen = cause.seen.as_ref().map_or_else(|| "-".to_owned(), |s| short(s.floors));
    let parameter = if cause.seen.is_some() { cause.in_words() } else { format!("tried to {}", cause.in_words()) };
    vec![
        format!("{} {}", k + 1, cause.name),
        cause.main.clone(),
        found.standing(k).word().to_owned(),
        seen,
        parameter,
        format!("{:.1} %", 100.0 * cause.free),
        later.join(", "),
    ]
}

fn groups(sheet: &mut Sheet, found: &Isolability) {
    if found.groups.is_empty() {
        return;
    }
    sheet.section("Causes that stay alike");
    for group in &found.groups {
        sheet.warn(&format!("{}: this run cannot say which of them it is.", found.members(group)));
        if let Some(next) = &group.next {
            if !next.separates {
                sheet.say(&format!("No run would: {}.", next.why));
                continue;
            }
            let steps: Vec<String> = next.schedule.iter().map(|s| format!("{} us for {} s", s.pulse_us, s.hold_s)).collect();
            sheet.say(&format!("A run that would: {}.", next.why));
            sheet.say(&format!("Its schedule: {}.", steps.join(", ")));
        }
    }
}

fn rest(sheet: &mut Sheet, found: &Isolability) {
    sheet.section("What is not judged");
    let unjudged = found.names(Standing::Unjudged);
    if !unjudged.is_empty() {
        sheet.say(&format!("At no size tried does the search fit these with values that make sense; the readings must show them first, or their parts are tied to each other in a way that only the rig knows: {}.", unjudged.join(", ")));
    }
    sheet.say(&format!("The channels of this log cannot hold, or do not show: {}.", found.not_offered.join(", ")));
    sheet.say(
        "One cause at a time, beside what the log holds already, and exactly as the library describes it. A real one is rougher.",
    );
}

/// The matrix as a file of its own, with its own style: light, dark and print.
#[must_use]
pub fn isolability_svg(found: &Isolability) -> String {
    let head = format!("<style>{COLOURS}{DRAWING}</style><rect class=\"paper\" width=\"100%\" height=\"100%\"/>");
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{}\n", drawn(found, &head))
}

/// The rows and columns that are drawn: causes that are judged.
fn judged(found: &Isolability) -> Vec<usize> {
    (0..found.causes.len()).filter(|k| found.causes[*k].sensible).collect()
}

fn drawn(found: &Isolability, head: &str) -> String {
    let shown = judged(found);
    let n = shown.len().max(1) as f64;
    let (cell, height) = ((WIDTH - LEFT - 6.0) / n, TOP + ROW * n + 10.0);
    let title = "Which cause can be taken for which";
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"fig\" viewBox=\"0 0 {WIDTH} {height:.0}\" role=\"img\" aria-label=\"{title}\">{head}<text class=\"title\" x=\"10\" y=\"18\">{title}</text>"
    );
    legend(&mut out);
    for (at, k) in shown.iter().enumerate() {
        let (x, y) = (LEFT + (at as f64 + 0.5) * cell, TOP + (at as f64 + 0.5) * ROW);
        let name = escape(&found.causes[*k].name);
        let _ = write!(
            out,
            "<text class=\"tick\" text-anchor=\"end\" x=\"{:.1}\" y=\"{:.1}\">{name} {}</text>",
            LEFT - 6.0,
            y + 5.0,
            k + 1
        );
        if is_numbered(*k) {
            let _ =
                write!(out, "<text class=\"tick\" text-anchor=\"middle\" x=\"{x:.1}\" y=\"{:.1}\">{}</text>", TOP - 5.0, k + 1);
        }
        for (column, other) in shown.iter().enumerate() {
            draw_cell(&mut out, found, (*k, *other), (LEFT + column as f64 * cell, TOP + at as f64 * ROW, cell));
        }
    }
    out + "</svg>"
}

/// Class and share of a cell's height: likeness is told by both, for eyes and printers without colour.
const LOOKS: [(&str, f64, &str); 4] = [
    ("c", 0.3, "told apart once it is named"),
    ("f", 0.6, "told apart when larger"),
    ("b", 1.0, "alike at any size"),
    ("d", 0.12, "no common channel"),
];

fn legend(out: &mut String) {
    for (k, (class, share, text)) in LOOKS.iter().enumerate() {
        let (x, y) = (10.0 + 268.0 * (k % 2) as f64, 38.0 + 19.0 * (k / 2) as f64);
        let tall = 14.0 * share;
        let _ = write!(
            out,
            "<rect class=\"{class} col\" x=\"{x}\" y=\"{:.1}\" width=\"12\" height=\"{tall:.1}\"/><text class=\"tick\" x=\"{}\" y=\"{:.1}\">{text}</text>",
            y - 5.0 - 0.5 * tall,
            x + 18.0,
            y
        );
    }
}

/// How a cause looks beside another, and the size that says so; nothing for one name.
fn cell(found: &Isolability, k: usize, other: usize) -> Option<(usize, String)> {
    let cause = &found.causes[k];
    let named = cause.seen.as_ref().map_or(f64::INFINITY, |s| s.floors);
    Some(match &cause.apart[other] {
        Apart::SameName => return None,
        Apart::Elsewhere => (3, "no common channel".to_owned()),
        Apart::From(size) if size.floors <= named * std::f64::consts::SQRT_2 && named.is_finite() => {
            (0, format!("from {} floors", short(named)))
        }
        Apart::From(size) => (1, format!("from {} floors", short(size.floors))),
        Apart::Never => (2, format!("not up to {} floors", short(cause.tried.floors))),
    })
}

fn draw_cell(out: &mut String, found: &Isolability, (k, other): (usize, usize), (x, y, cell_width): (f64, f64, f64)) {
    let (cause, rival) = (&found.causes[k], &found.causes[other]);
    let Some((look, text)) = cell(found, k, other) else { return };
    let (class, share, _) = LOOKS[look];
    let tall = (ROW - 3.0) * share;
    // what cannot meet is there to complete the grid, and no more
    let faint = if look == 3 { " opacity=\"0.35\"" } else { "" };
    let _ = write!(
        out,
        "<rect class=\"{class} col\" x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{tall:.1}\"{faint}><title>{} for {}: {text}</title></rect>",
        x + 0.08 * cell_width,
        y + 0.5 * (ROW - tall),
        0.84 * cell_width,
        escape(&cause.name),
        escape(&rival.name)
    );
}

/// The matrix as CSV: sizes in noise floors; `never`, `elsewhere` (no common channel), `same` (one name).
#[must_use]
pub fn isolability_csv(found: &Isolability) -> String {
    let names: Vec<&str> = found.causes.iter().map(|c| c.name.as_str()).collect();
    let mut out = format!("cause,channel,standing,named_from_floors,parameter,value,unit,beside_model,{}\n", names.join(","));
    for (k, cause) in found.causes.iter().enumerate() {
        let shown = cause.seen.as_ref().unwrap_or(&cause.tried);
        let seen = cause.seen.as_ref().map_or_else(|| "never".to_owned(), |s| format!("{:.4}", s.floors));
        let _ = write!(
            out,
            "{},{},{},{seen},{},{:.6e},{},{:.4}",
            cause.name,
            cause.main,
            found.standing(k).word(),
            shown.quantity.name,
            shown.quantity.value,
            shown.quantity.unit,
            cause.free
        );
        for apart in &cause.apart {
            let _ = match apart {
                Apart::SameName => write!(out, ",same"),
                Apart::Elsewhere => write!(out, ",elsewhere"),
                Apart::From(size) => write!(out, ",{:.4}", size.floors),
                Apart::Never => write!(out, ",never"),
            };
        }
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::isolability::isolability as ask;
    use crate::log::{Column, Log};

    /// A staircase with thrust of the square of its speed.
    fn staircase() -> Log {
        let n = 600;
        let level = |i: usize| 1.0 + ((i / 60) % 10) as f64;
        let ripple = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 1009) as f64 / 504.5 - 1.0;
        let column = |name: &str, values: Vec<f64>| Column { name: name.into(), values };
        let columns = vec![
            column("pulse_us", (0..n).map(|i| 1000.0 + 80.0 * level(i)).collect()),
            column("rpm", (0..n).map(|i| 600.0 * level(i) + ripple(i, 0)).collect()),
            column("thrust_n", (0..n).map(|i| 0.1 * level(i).powi(2) + 0.01 * ripple(i, 1)).collect()),
        ];
        Log { name: "stairs.csv".into(), t: (0..n).map(|i| 0.05 * i as f64).collect(), columns, ..Log::default() }
    }

    #[test]
    fn the_page_has_the_matrix_in_letters_of_its_own_and_where_it_comes_from() {
        let found = ask(&staircase(), &mut |_| {}).unwrap();
        let html = isolability(&found, &[("log", "stairs.csv".to_owned()), ("SHA-256", "abc".to_owned())]).html();
        let names = judged(&found).len();
        assert!(names > 3 && html.matches("<span>").count() == names + LOOKS.len(), "{names}");
        assert!(html.contains("class=\"told\"") && html.contains(&format!("--n:{names}")) && html.contains("class=\"stack\""));
        assert!(html.contains("download=\"matrix.csv\"") && html.contains("download=\"sizes.csv\""));
        assert!(html.contains(&format!("quadrig {}", env!("CARGO_PKG_VERSION"))) && html.contains(">abc</td>"));
        assert!(isolability_svg(&found).contains("<svg"));
    }
}
