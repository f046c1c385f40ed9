//! A figure as SVG text: lines, bands, marked stretches, points with read-outs, bars.
//!
//! What it is: layers over one pair of axes, drawn for a page (whose style sheet colours them) or as a file of its own.
//! What can go wrong: layers without finite points leave nothing behind; long lines are thinned to what the eye can see.
//! Units: whatever the caller's labels say.
//! Reference: SVG 1.1. Read-outs are plain CSS (`:hover`, `:focus`), so that they work on paper's screen, on a phone's tap and
//! without a script; each also stands in a `<title>` for readers that speak.

use super::style::COLOURS;
use super::svg::{escape, label, line_path, short_label, span, ticks};
use std::fmt::Write;

/// Dots up to which each is drawn large: a table of levels is no cloud.
const FEW_DOTS: usize = 80;

/// Width of the drawing in its own units: two figures side by side on a desk, one on a phone.
const WIDTH: f64 = 560.0;
const LEFT: f64 = 80.0;
/// The same where the letters of a phone are large.
const LEFT_CAPTIONED: f64 = 100.0;
const RIGHT: f64 = 24.0;
const TOP: f64 = 48.0;
/// Height of a further row of the legend.
const ROW: f64 = 17.0;
/// The same for larger letters.
const ROW_CAPTIONED: f64 = 24.0;
/// What a caption beside the drawing saves at its upper edge.
const NO_TITLE: f64 = 20.0;
const BOTTOM: f64 = 46.0;
/// Least room between the names of two categories.
const BETWEEN: f64 = 8.0;

/// One layer, first drawn at the bottom.
#[derive(Debug, Clone)]
pub enum Layer {
    /// A line; a value that is not finite lifts the pen.
    Line {
        /// Name in the legend, empty for none.
        name: String,
        /// Class of the style sheet: `a` to `f`.
        class: &'static str,
        /// Abscissa.
        x: Vec<f64>,
        /// Ordinate.
        y: Vec<f64>,
    },
    /// A cloud of dots.
    Dots {
        /// Name in the legend.
        name: String,
        /// Class.
        class: &'static str,
        /// Abscissa.
        x: Vec<f64>,
        /// Ordinate.
        y: Vec<f64>,
    },
    /// A band between two curves.
    Band {
        /// Name in the legend.
        name: String,
        /// Class.
        class: &'static str,
        /// Abscissa, rising.
        x: Vec<f64>,
        /// Lower edge.
        lower: Vec<f64>,
        /// Upper edge.
        upper: Vec<f64>,
    },
    /// Points that a reader can ask: ring, error bar, and a text that appears under the pointer.
    Marks {
        /// Name in the legend.
        name: String,
        /// Class.
        class: &'static str,
        /// The points.
        marks: Vec<Mark>,
    },
    /// Stretches of the abscissa that are shaded: plateaus.
    Spans {
        /// Name in the legend.
        name: String,
        /// From and to.
        ranges: Vec<(f64, f64)>,
    },
    /// Upright columns beside each other in each category, from zero.
    Columns {
        /// Name in the legend.
        name: String,
        /// Class.
        class: &'static str,
        /// Place among the columns of a category, and how many places there are.
        place: (usize, usize),
        /// Category, height and read-out.
        values: Vec<(usize, f64, String)>,
    },
    /// An upright line with a word beside it.
    Rule {
        /// Where.
        x: f64,
        /// The word.
        text: String,
    },
    /// A level line with a word on it.
    Level {
        /// Where.
        y: f64,
        /// The word.
        text: String,
    },
}

/// A point with a read-out.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// Abscissa.
    pub x: f64,
    /// Ordinate.
    pub y: f64,
    /// Half length of the error bar, 0 for none.
    pub error: f64,
    /// What the read-out says.
    pub text: String,
}

/// A figure over two axes.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// File name without its ending, and anchor on the page.
    pub id: String,
    /// Heading.
    pub title: String,
    /// Label of the abscissa.
    pub x_label: String,
    /// Label of the ordinate.
    pub y_label: String,
    /// What is drawn.
    pub layers: Vec<Layer>,
    /// Height in the drawing's units, 0 for 330.
    pub height: f64,
    /// Names of the categories of [`Layer::Columns`]; empty for an axis of numbers.
    pub categories: Vec<String>,
    /// The page says the title beside the drawing, which has room for the larger letters of a phone.
    pub captioned: bool,
}

struct Frame {
    x: (f64, f64),
    y: (f64, f64),
    /// Left edge of the axes.
    left: f64,
    /// Upper edge of the axes, under the legend's rows.
    top: f64,
    /// Height under the axes, the categories' rows included.
    bottom: f64,
    height: f64,
}

impl Frame {
    fn px(&self, x: f64) -> f64 {
        self.left + (x - self.x.0) / (self.x.1 - self.x.0) * (WIDTH - self.left - RIGHT)
    }

    fn py(&self, y: f64) -> f64 {
        self.height - self.bottom - (y - self.y.0) / (self.y.1 - self.y.0) * (self.height - self.top - self.bottom)
    }
}

impl Figure {
    /// The figure as an `<svg>` element that takes its colours from the page.
    #[must_use]
    pub fn svg(&self) -> String {
        self.draw("")
    }

    /// The figure as a file of its own, with its own style: light, dark and print.
    #[must_use]
    pub fn file(&self) -> String {
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{}\n",
            self.draw(&format!(
                "<style>{COLOURS}{}</style><rect class=\"paper\" width=\"100%\" height=\"100%\"/>",
                super::style::DRAWING
            ))
        )
    }

    /// Whether any layer has something to show.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.layers.iter().any(|l| match l {
            Layer::Line { x, y, .. } | Layer::Dots { x, y, .. } => x.iter().zip(y).any(|(x, y)| x.is_finite() && y.is_finite()),
            Layer::Marks { marks, .. } => marks.iter().any(|m| m.x.is_finite() && m.y.is_finite()),
            Layer::Columns { values, .. } => !values.is_empty(),
            Layer::Band { .. } | Layer::Spans { .. } | Layer::Rule { .. } | Layer::Level { .. } => false,
        })
    }

    fn frame(&self) -> Frame {
        let mut xs: Vec<f64> = Vec::new();
        let mut ys: Vec<f64> = Vec::new();
        // the extremes as they are: a level line must not push the others together
        let ends = |v: &[f64]| -> [f64; 2] {
            let finite = v.iter().copied().filter(|v| v.is_finite());
            finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(v), hi.max(v)])
        };
        for layer in &self.layers {
            match layer {
                Layer::Line { x, y, .. } | Layer::Dots { x, y, .. }
                    if x.iter().zip(y).any(|(x, y)| x.is_finite() && y.is_finite()) =>
                {
                    xs.extend(ends(x));
                    ys.extend(ends(y));
                }
                Layer::Band { x, lower, upper, .. } if !x.is_empty() => {
                    xs.extend(ends(x));
                    ys.extend(ends(lower));
                    ys.extend(ends(upper));
                }
                Layer::Marks { marks, .. } => {
                    for m in marks {
                        xs.push(m.x);
                        ys.extend([m.y - m.error, m.y + m.error]);
                    }
                }
                Layer::Columns { values, .. } => {
                    ys.push(0.0);
                    ys.extend(values.iter().map(|v| v.1));
                }
                Layer::Level { y, .. } => ys.push(*y),
                _ => {}
            }
        }
        if !self.categories.is_empty() {
            xs = vec![-0.5, self.categories.len() as f64 - 0.5];
        }
        let (x, y) = (span(xs.iter().filter(|v| v.is_finite())), span(ys.iter().filter(|v| v.is_finite())));
        let pointed = self.layers.iter().any(|l| matches!(l, Layer::Marks { .. })) && self.categories.is_empty();
        let side = if pointed { 0.03 * (x.1 - x.0) } else { 0.0 };
        let x = (x.0 - side, x.1 + side);
        let margin = 0.05 * (y.1 - y.0);
        let height = if self.height > 0.0 { self.height } else { 330.0 };
        // columns stand on the axis, points have room above it
        let stands = self.layers.iter().any(|l| matches!(l, Layer::Columns { .. }));
        let low = if stands { y.0 } else { y.0 - margin };
        let rows = self.entries().last().map_or(0, |e| e.row);
        let legend = self.row() * rows as f64;
        let left = if self.captioned { LEFT_CAPTIONED } else { LEFT };
        let further = self.row() * (self.name_rows(left) - 1) as f64;
        Frame { x, y: (low, y.1 + margin), left, top: TOP + legend, bottom: BOTTOM + further, height: height + legend + further }
    }

    /// Height of a row of the legend.
    fn row(&self) -> f64 {
        if self.captioned { ROW_CAPTIONED } else { ROW }
    }

    /// Rows that the names of the categories take, so that none runs into the next.
    fn name_rows(&self, left: f64) -> usize {
        let place = (WIDTH - left - RIGHT) / self.categories.len().max(1) as f64;
        let wide = |name: &String| if self.captioned { on_a_phone(name) } else { 8.0 * name.chars().count() as f64 };
        let widest = self.categories.iter().map(wide).fold(0.0, f64::max);
        (((widest + BETWEEN) / place).ceil() as usize).clamp(1, self.categories.len().max(1))
    }

    /// Label of a tick among those that stand on its axis.
    fn tick(&self, v: f64, all: &[f64], wide: f64) -> String {
        match all {
            [a, b, ..] if self.captioned => short_label(v, b - a),
            _ => label(v, wide),
        }
    }

    fn draw(&self, head: &str) -> String {
        let f = self.frame();
        let t = escape(&self.title);
        let (from, title) = if self.captioned {
            (NO_TITLE, String::new())
        } else {
            (0.0, format!("<text class=\"title\" x=\"10\" y=\"18\">{t}</text>"))
        };
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"fig\" viewBox=\"0 {from} {WIDTH} {}\" role=\"img\" aria-label=\"{t}\">{head}{title}",
            f.height - from
        );
        self.axes(&mut out, &f);
        for layer in &self.layers {
            draw_layer(&mut out, layer, &f);
        }
        self.legend(&mut out);
        // read-outs last, so that nothing covers them
        for layer in &self.layers {
            match layer {
                Layer::Marks { class, marks, .. } => {
                    marks.iter().filter(|m| m.x.is_finite() && m.y.is_finite()).for_each(|m| mark(&mut out, class, m, &f));
                }
                Layer::Columns { class, place: (k, of), values, .. } => {
                    for (slot, value, text) in values.iter().filter(|v| v.1.is_finite()) {
                        let x = *slot as f64 + 0.8 * ((*k as f64 + 0.5) / (*of).max(1) as f64 - 0.5);
                        let point = Mark { x, y: *value, error: 0.0, text: text.clone() };
                        mark(&mut out, &format!("{class} over"), &point, &f);
                    }
                }
                _ => {}
            }
        }
        out + "</svg>"
    }

    fn axes(&self, out: &mut String, f: &Frame) {
        let (floor, right) = (f.height - f.bottom, WIDTH - RIGHT);
        let left = f.left;
        let under = floor + if self.captioned { 18.0 } else { 16.0 };
        let rows = self.name_rows(left);
        for (k, name) in self.categories.iter().enumerate() {
            let _ = write!(
                out,
                "<text class=\"tick\" text-anchor=\"middle\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                f.px(k as f64),
                under + self.row() * (k % rows) as f64,
                escape(name)
            );
        }
        let numbers =
            if self.categories.is_empty() { ticks(f.x.0, f.x.1, if self.captioned { 5 } else { 6 }) } else { Vec::new() };
        for &v in &numbers {
            let x = f.px(v);
            let _ = write!(
                out,
                "<line class=\"grid\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{:.1}\" y2=\"{floor:.1}\"/><text class=\"tick\" text-anchor=\"middle\" x=\"{x:.1}\" y=\"{:.1}\">{}</text>",
                f.top,
                under,
                self.tick(v, &numbers, f.x.1 - f.x.0)
            );
        }
        let numbers = ticks(f.y.0, f.y.1, 5);
        for &v in &numbers {
            let y = f.py(v);
            let _ = write!(
                out,
                "<line class=\"grid\" x1=\"{left}\" x2=\"{right:.1}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/><text class=\"tick\" text-anchor=\"end\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                left - 6.0,
                y + 4.0,
                self.tick(v, &numbers, f.y.1 - f.y.0)
            );
        }
        let _ = write!(
            out,
            "<text class=\"axis\" text-anchor=\"middle\" x=\"{:.1}\" y=\"{:.1}\">{}</text><text class=\"axis\" text-anchor=\"middle\" transform=\"translate(16 {:.1}) rotate(-90)\">{}</text>",
            (left + right) / 2.0,
            f.height - 8.0,
            escape(&self.x_label),
            (f.top + floor) / 2.0,
            self.upright(f.height)
        );
    }

    /// The ordinate's label, on two lines where the larger letters of a phone are longer than the drawing is high.
    fn upright(&self, height: f64) -> String {
        let middle = self.y_label.len() / 2;
        let gap = |(at, _): &(usize, char)| at.abs_diff(middle);
        let space = self.y_label.char_indices().filter(|(_, c)| *c == ' ').min_by_key(gap);
        match space.filter(|_| self.captioned && on_a_phone(&self.y_label) > height - NO_TITLE) {
            Some((at, _)) => {
                let (first, rest) = self.y_label.split_at(at);
                format!("<tspan x=\"0\">{}</tspan><tspan x=\"0\" dy=\"1.05em\">{}</tspan>", escape(first), escape(rest.trim()))
            }
            None => escape(&self.y_label),
        }
    }

    /// The legend's entries, laid out in as many rows as they need.
    fn entries(&self) -> Vec<Entry<'_>> {
        let mut out: Vec<Entry<'_>> = Vec::new();
        let first = if self.captioned { 10.0 } else { LEFT };
        let (mut at, mut row) = (first, 0);
        for layer in &self.layers {
            let (name, class, key) = match layer {
                Layer::Line { name, class, .. } => (name, *class, "key"),
                Layer::Dots { name, class: "b", .. } => (name, "b", "square"),
                Layer::Dots { name, class, .. } | Layer::Marks { name, class, .. } => (name, *class, "spot"),
                Layer::Columns { name, class, .. } => (name, *class, "col"),
                Layer::Band { name, class, .. } => (name, *class, "patch"),
                Layer::Spans { name, .. } => (name, "span", "patch"),
                Layer::Rule { .. } | Layer::Level { .. } => continue,
            };
            if name.is_empty() {
                continue;
            }
            let wide = 21.0 + if self.captioned { on_a_phone(name) } else { 8.8 * name.chars().count() as f64 };
            if at > first && at + wide > WIDTH {
                (at, row) = (first, row + 1);
            }
            out.push(Entry { name, class, key, at, row });
            at += wide + 12.0;
        }
        out
    }

    fn legend(&self, out: &mut String) {
        for Entry { name, class, key, at, row } in self.entries() {
            let y = 34.0 + self.row() * row as f64;
            let _ = match key {
                "key" => {
                    write!(out, "<line class=\"{class} key\" x1=\"{at:.1}\" x2=\"{:.1}\" y1=\"{y}\" y2=\"{y}\"/>", at + 16.0)
                }
                // as the dots of this class are drawn
                "square" => {
                    write!(out, "<rect class=\"{class} spot\" x=\"{:.1}\" y=\"{}\" width=\"8\" height=\"8\"/>", at + 4.0, y - 4.0)
                }
                "spot" => write!(out, "<circle class=\"{class} spot\" cx=\"{:.1}\" cy=\"{y}\" r=\"4\"/>", at + 8.0),
                "col" => {
                    write!(
                        out,
                        "<rect class=\"{class} col\" x=\"{:.1}\" y=\"{}\" width=\"11\" height=\"11\"/>",
                        at + 4.0,
                        y - 6.0
                    )
                }
                _ => write!(out, "<rect class=\"{class} patch\" x=\"{at:.1}\" y=\"{}\" width=\"16\" height=\"11\"/>", y - 6.0),
            };
            let _ = write!(out, "<text class=\"tick\" x=\"{:.1}\" y=\"{}\">{}</text>", at + 21.0, y + 4.0, escape(name));
        }
    }
}

/// Width of a word in the larger letters of a phone, by what letters are narrow and wide.
fn on_a_phone(word: &str) -> f64 {
    let em = |c: char| match c {
        'f' | 'i' | 'j' | 'l' | 'r' | 't' | ' ' | ',' | '.' | '(' | ')' => 0.38,
        'm' | 'w' | 'M' | 'W' => 0.97,
        _ => 0.63,
    };
    20.0 * word.chars().map(em).sum::<f64>()
}

/// One entry of the legend.
struct Entry<'f> {
    name: &'f str,
    class: &'static str,
    key: &'static str,
    at: f64,
    row: usize,
}

fn draw_layer(out: &mut String, layer: &Layer, f: &Frame) {
    let (px, py) = (|x: f64| f.px(x), |y: f64| f.py(y));
    match layer {
        Layer::Line { class, x, y, .. } => {
            let _ = write!(out, "<path class=\"{class}\" d=\"{}\"/>", line_path(x, y, f.x, &px, &py));
        }
        Layer::Dots { class, x, y, .. } => {
            let stride = x.len().div_ceil(2500).max(1);
            let there = x.iter().zip(y).filter(|(x, y)| x.is_finite() && y.is_finite()).count();
            let few = if there <= FEW_DOTS { " few" } else { "" };
            let _ = write!(out, "<path class=\"{class} dots{few}\" d=\"");
            for (x, y) in x.iter().zip(y).step_by(stride).filter(|(x, y)| x.is_finite() && y.is_finite()) {
                let _ = write!(out, "M{:.1} {:.1}h.01", px(*x), py(*y));
            }
            out.push_str("\"/>");
        }
        Layer::Band { class, x, lower, upper, .. } => {
            let _ = write!(out, "<path class=\"{class} band\" d=\"");
            let ring = x.iter().zip(upper).chain(x.iter().zip(lower).rev());
            for (k, (x, y)) in ring.filter(|(x, y)| x.is_finite() && y.is_finite()).enumerate() {
                let _ = write!(out, "{}{:.1} {:.1}", if k == 0 { 'M' } else { 'L' }, px(*x), py(*y));
            }
            out.push_str("Z\"/>");
        }
        Layer::Spans { ranges, .. } => {
            for (from, to) in ranges {
                let (a, b) = (px(*from), px(*to));
                let _ = write!(
                    out,
                    "<rect class=\"span\" x=\"{a:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>",
                    f.top,
                    (b - a).max(0.5),
                    f.height - f.top - f.bottom
                );
            }
        }
        Layer::Rule { x, text } if (f.x.0..=f.x.1).contains(x) => {
            let at = px(*x);
            let _ = write!(
                out,
                "<line class=\"rule\" x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{:.1}\" y2=\"{:.1}\"/><text class=\"tick\" transform=\"translate({:.1} {:.1}) rotate(-90)\">{}</text>",
                f.top,
                f.height - f.bottom,
                at - 4.0,
                f.height - f.bottom - 6.0,
                escape(text)
            );
        }
        Layer::Level { y, text } => {
            let at = py(*y);
            let _ = write!(
                out,
                "<line class=\"rule\" x1=\"{:.1}\" x2=\"{:.1}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/><text class=\"tick\" text-anchor=\"end\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                f.left,
                WIDTH - RIGHT,
                WIDTH - RIGHT - 4.0,
                at - 5.0,
                escape(text)
            );
        }
        Layer::Columns { class, place: (k, of), values, .. } => {
            let wide = (px(1.0) - px(0.0)) * 0.8 / (*of).max(1) as f64;
            for (slot, value, _) in values.iter().filter(|v| v.1.is_finite()) {
                let x = px(*slot as f64) + wide * (*k as f64 - *of as f64 / 2.0);
                let (a, b) = (py(value.max(0.0)), py(value.min(0.0)));
                let _ = write!(
                    out,
                    "<rect class=\"{class} col\" x=\"{x:.1}\" y=\"{a:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>",
                    (wide - 1.0).max(0.5),
                    (b - a).max(0.0)
                );
            }
        }
        Layer::Marks { class, marks, .. } => {
            for m in marks.iter().filter(|m| m.x.is_finite() && m.y.is_finite()) {
                let (x, y) = (px(m.x), py(m.y));
                if m.error > 0.0 {
                    let _ = write!(
                        out,
                        "<line class=\"{class} bar\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{:.1}\" y2=\"{:.1}\"/>",
                        py(m.y - m.error),
                        py(m.y + m.error)
                    );
                }
                let _ = write!(out, "<circle class=\"{class} ring\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.6\"/>");
            }
        }
        Layer::Rule { .. } => {}
    }
}

/// What a pointer meets: an unseen disc, a bold ring and the read-out, which keeps inside the drawing. It stands above every ring.
fn mark(out: &mut String, class: &str, m: &Mark, f: &Frame) {
    let (x, y) = (f.px(m.x), f.py(m.y));
    let text = escape(&m.text);
    let width = 7.4 * m.text.chars().count() as f64 + 14.0;
    let left = (x - width / 2.0).clamp(2.0, (WIDTH - width - 2.0).max(2.0));
    let top = if y - 34.0 > TOP - 20.0 { y - 34.0 } else { y + 12.0 };
    let _ = write!(out, "<g class=\"pt {class}\" tabindex=\"0\"><title>{text}</title>");
    let _ = write!(
        out,
        "<circle class=\"hit\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"12\"/><circle class=\"ring\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.6\"/><g class=\"tip\"><rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"23\" rx=\"4\"/><text x=\"{:.1}\" y=\"{:.1}\">{text}</text></g></g>",
        left + 7.0,
        top + 16.0
    );
}

#[cfg(test)]
mod tests;
