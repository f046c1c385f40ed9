//! The figures that convince: a residual before and after, over time or over the variable that it depends on.
//!
//! What it is: traces of a channel, and the drawings made of them, thinned to what a pixel shows.
//! What can go wrong: a long gap lifts the pen; a trace without finite values gives an empty figure, which no page shows.
//! Units: the channel's.
//! Reference: component-plus-residual plots: Larsen & McCleary 1972, Technometrics 14:781.

use super::sentence::{begins_with, unnamed_rest, whole};
use super::vocabulary::Vocabulary;
use crate::numeric::order::median;
use crate::report::figure::{Figure, Layer, Mark};
use crate::verdict::words::{channel, heading, scaled};
use crate::verdict::{EffectEntry, Kind, Unexplained, Verdict};

/// Columns of pixels of a drawing.
const COLUMNS: usize = 440;
/// Most dots of a cloud.
const DOTS: usize = 1600;
/// Most read-outs of a layer.
const READ_OUTS: usize = 120;
/// What stands before and after in the figure of one effect.
pub(crate) const ALONE: [&str; 2] = ["without it", "with it"];
/// Parts of a run of which the most telling one is enlarged.
const PARTS: f64 = 12.0;
/// Times the size that all but one in two hundred readings keep beyond which a dot is off the scale.
const OFF: f64 = 3.0;
/// Times the error after that the error before must be for a figure to show the difference.
pub(crate) const SEEN: f64 = 1.02;
/// Usual steps from which on a gap lifts the pen.
const GAP: f64 = 5.0;

/// What a channel left over before and after.
#[derive(Debug, Clone, Default)]
pub(crate) struct Trace {
    /// Channel.
    pub(crate) channel: String,
    /// Unit.
    pub(crate) unit: String,
    /// Noise floor.
    pub(crate) floor: f64,
    /// Label of the time axis.
    pub(crate) time_label: String,
    /// Time.
    pub(crate) t: Vec<f64>,
    /// Measured less predicted, declared model.
    pub(crate) before: Vec<f64>,
    /// Measured less predicted, corrected model.
    pub(crate) after: Vec<f64>,
}

impl Trace {
    /// The same with another model's residual as what was before.
    pub(crate) fn with_before(&self, before: Vec<f64>) -> Self {
        Self { before, ..self.clone() }
    }

    fn band(&self, from: f64, to: f64) -> Option<Layer> {
        (self.floor > 0.0).then(|| Layer::Band {
            name: "noise floor".into(),
            class: "d",
            x: vec![from, to],
            lower: vec![-self.floor; 2],
            upper: vec![self.floor; 2],
        })
    }

    fn figure(&self, id: &str, title: String, x_label: String, layers: Vec<Layer>) -> Figure {
        let (layers, unit) = in_unit(layers, &self.unit);
        let y_label = if unit.is_empty() { "left over".into() } else { format!("left over, {unit}") };
        thinned(Figure {
            id: format!("{id}-{}", slug(&self.channel)),
            title,
            x_label,
            y_label,
            layers,
            height: 280.0,
            ..Figure::default()
        })
    }

    fn pair(&self, rows: std::ops::Range<usize>, names: [&'static str; 2]) -> Vec<Layer> {
        let t = &self.t[rows.clone()];
        let mut layers: Vec<Layer> = t.first().zip(t.last()).and_then(|(a, b)| self.band(*a, *b)).into_iter().collect();
        for ((name, class), y) in shown(names).zip([&self.before, &self.after]) {
            let (x, y) = lifted(t, &y[rows.clone()]);
            layers.push(Layer::Line { name: name.to_owned(), class, x, y });
        }
        layers
    }
}

/// The layers in a unit whose figures are short (mN.m for small torques), and that unit.
fn in_unit(mut layers: Vec<Layer>, unit: &str) -> (Vec<Layer>, String) {
    let values = |layer: &Layer| match layer {
        Layer::Line { y, .. } | Layer::Dots { y, .. } => {
            y.iter().filter(|v| v.is_finite()).fold(0.0, |most: f64, v| most.max(v.abs()))
        }
        _ => 0.0,
    };
    let (factor, unit) = scaled(layers.iter().map(values).fold(0.0, f64::max), unit);
    for layer in layers.iter_mut().filter(|_| factor != 1.0) {
        let lists = match layer {
            Layer::Line { y, .. } | Layer::Dots { y, .. } => vec![y],
            Layer::Band { lower, upper, .. } => vec![lower, upper],
            _ => Vec::new(),
        };
        lists.into_iter().flatten().for_each(|v| *v *= factor);
    }
    (layers, unit.to_owned())
}

/// An identifier from a channel's name.
pub(crate) fn slug(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect()
}

/// Over the whole run.
pub(crate) fn over_time(trace: &Trace, id: &str, names: [&'static str; 2]) -> Figure {
    let title = format!("{} left over, whole run", heading(&trace.channel));
    trace.figure(id, title, trace.time_label.clone(), trace.pair(0..trace.t.len(), names))
}

/// The part of the run in which most was taken away, enlarged.
pub(crate) fn enlarged(trace: &Trace, id: &str, names: [&'static str; 2]) -> Option<Figure> {
    let (first, last) = (trace.t.first()?, trace.t.last()?);
    part(trace, id, names, (last - first) / PARTS)
}

/// The same of a length of its own, in the unit of the time axis.
pub(crate) fn part(trace: &Trace, id: &str, names: [&'static str; 2], wide: f64) -> Option<Figure> {
    if trace.t.len() < 60 || wide <= 0.0 {
        return None;
    }
    let gone = |i: usize| {
        let d = trace.before[i].powi(2) - trace.after[i].powi(2);
        if d.is_finite() { d } else { 0.0 }
    };
    let (mut sum, mut from, mut best) = (0.0, 0, (0.0, 0..0));
    for i in 0..trace.t.len() {
        sum += gone(i);
        while trace.t[i] - trace.t[from] > wide {
            sum -= gone(from);
            from += 1;
        }
        if sum > best.0 {
            best = (sum, from..i + 1);
        }
    }
    let range = best.1;
    // a little before and after, so that the quiet beside it is seen
    let margin = range.len() / 6;
    let range = range.start.saturating_sub(margin)..(range.end + margin).min(trace.t.len());
    (range.len() > 8).then(|| {
        let title = format!("{} left over, where most was explained", heading(&trace.channel));
        trace.figure(&format!("{id}-enlarged"), title, trace.time_label.clone(), trace.pair(range, names))
    })
}

/// Whether a channel is of the quantity that the sentence begins with; where it begins with no cause, each is.
pub(crate) fn headed(verdict: &Verdict, words: Vocabulary) -> impl Fn(&str) -> bool {
    let told = begins_with(verdict, words);
    move |channel| {
        told.is_none_or(|e| {
            let of_first = |first: &String| whole(verdict, first) == whole(verdict, channel);
            e.channels.iter().any(|c| c == channel) && e.channels.first().is_some_and(of_first)
        })
    }
}

/// The channel that the sentence begins with, over time and enlarged; without names the loudest.
pub(crate) fn most(verdict: &Verdict, words: Vocabulary, traces: &[Trace]) -> Vec<Figure> {
    if let Some(rest) = unnamed_rest(verdict, words)
        && let Some(trace) = traces.iter().find(|t| t.channel == rest.channel)
    {
        return shown_most(trace, pair(verdict));
    }
    // of several sensors or axes of one quantity the one that shows most
    let headed = headed(verdict, words);
    let weight = |t: &&Trace| {
        verdict.channels.get(&t.channel).map_or(0.0, |c| match verdict.verdict {
            // a ratio of two figures beneath the floor tells nothing
            Kind::Attributed | Kind::Ambiguous => (c.before.heldout_rms - c.after.heldout_rms) / c.noise_floor_rms,
            Kind::Unattributed | Kind::None => c.after.heldout_rms / c.noise_floor_rms,
        })
    };
    let Some(trace) = traces.iter().filter(|t| headed(&t.channel)).max_by(|a, b| weight(a).total_cmp(&weight(b))) else {
        return Vec::new();
    };
    // what a name does not take off its channel cannot be seen there
    let seen = verdict.channels.get(&trace.channel).is_none_or(|c| c.before.heldout_rms > SEEN * c.after.heldout_rms);
    if !seen && matches!(verdict.verdict, Kind::Attributed | Kind::Ambiguous) {
        return Vec::new();
    }
    shown_most(trace, pair(verdict))
}

/// A trace as the figures that convince most: over the whole run, and the part in which most was taken away.
pub(crate) fn shown_most(trace: &Trace, names: [&'static str; 2]) -> Vec<Figure> {
    std::iter::once(over_time(trace, "most", names)).chain(enlarged(trace, "most", names)).collect()
}

/// Names of a pair of residuals: what stands after is corrected only by names. A second one that is empty is not drawn.
pub(crate) fn pair(verdict: &Verdict) -> [&'static str; 2] {
    let fitted = |e: &EffectEntry| e.heldout_error_reduction > 0.0;
    let nameless = verdict.effects.iter().any(|e| e.id == "unknown" && fitted(e));
    match verdict.effects.iter().any(|e| e.id != "unknown" && !e.is_read_off()) {
        true => ["declared, before", "corrected, after"],
        false if nameless => ["declared, before", "with a term without a name, after"],
        false => ["declared, nothing added", ""],
    }
}

/// The names that are drawn, with their classes.
fn shown(names: [&'static str; 2]) -> impl Iterator<Item = (&'static str, &'static str)> {
    names.into_iter().zip(["b", "a"]).filter(|(name, _)| !name.is_empty())
}

/// The channels of which something is left, over the whole run.
pub(crate) fn rest(verdict: &Verdict, traces: &[Trace]) -> Vec<Figure> {
    let trace = |u: &Unexplained| traces.iter().find(|t| t.channel == u.channel);
    verdict.unexplained.iter().filter_map(trace).map(|t| over_time(t, "left", pair(verdict))).collect()
}

/// Over a variable.
pub(crate) fn against(trace: &Trace, id: &str, (variable, unit): (&str, &str), x: &[f64], names: [&'static str; 2]) -> Figure {
    let ends =
        x.iter().copied().filter(|v| v.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    let mut layers: Vec<Layer> = if ends.0 < ends.1 { trace.band(ends.0, ends.1).into_iter().collect() } else { Vec::new() };
    // a single absurd reading would press all others into one line
    let scale = OFF * usual(&trace.before).max(usual(&trace.after)).max(trace.floor);
    let mut off = 0;
    for ((name, class), y) in shown(names).zip([&trace.before, &trace.after]) {
        let beyond = |v: &f64| v.abs() > scale && scale > 0.0;
        off = off.max(y.iter().filter(|v| beyond(v)).count());
        let y = y.iter().map(|v| if beyond(v) { f64::NAN } else { *v }).collect();
        layers.push(Layer::Dots { name: name.to_owned(), class, x: x.to_vec(), y });
    }
    let said = channel(variable);
    let off = if off == 0 { String::new() } else { format!(" ({off} off the scale)") };
    let title = format!("{} left over, against {said}{off}", heading(&trace.channel));
    let x_label = if unit.is_empty() { said } else { format!("{said}, {unit}") };
    trace.figure(&format!("{id}-against-{}", slug(variable)), title, x_label, layers)
}

/// Places along the abscissa of a figure of scatter, and fewest samples of one that is drawn.
const PLACES: usize = 48;
const FEWEST: usize = 6;

/// Root mean square of what is left, place by place along a variable: without an effect that scatters, with it, and as the effect has it. `told`
/// is that last one at a value of the variable.
pub(crate) fn scatter(trace: &Trace, id: &str, x_label: &str, x: &[f64], told: &dyn Fn(f64) -> f64) -> Figure {
    let ends =
        x.iter().copied().filter(|v| v.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    let floor = (trace.floor > 0.0).then(|| Layer::Band {
        name: "noise floor".into(),
        class: "d",
        x: vec![ends.0, ends.1],
        lower: vec![0.0; 2],
        upper: vec![trace.floor; 2],
    });
    let of = |name: &str, class, y: &[f64]| {
        let (x, y) = by_place(x, y, ends);
        Layer::Line { name: name.to_owned(), class, x, y }
    };
    let grid: Vec<f64> = (0..=240).map(|k| ends.0 + (ends.1 - ends.0) * f64::from(k) / 240.0).collect();
    let expected =
        Layer::Line { name: "scatter as found".into(), class: "c", y: grid.iter().map(|v| told(*v)).collect(), x: grid };
    let [without, with] = ALONE;
    let layers = floor.into_iter().chain([of(without, "b", &trace.before), of(with, "a", &trace.after), expected]);
    let title = format!("{} left over, rms about each speed", heading(&trace.channel));
    let mut figure = trace.figure(&format!("{id}-scatter"), title, x_label.to_owned(), layers.collect());
    figure.y_label = figure.y_label.replace("left over", "rms left over");
    figure
}

/// Root mean squares of values at places along a variable; a place with too few is left out.
fn by_place(x: &[f64], y: &[f64], ends: (f64, f64)) -> (Vec<f64>, Vec<f64>) {
    let wide = ((ends.1 - ends.0) / PLACES as f64).max(f64::MIN_POSITIVE);
    // sums of the variable and of squares, and how many
    let mut sums = vec![(0.0, 0.0, 0_usize); PLACES];
    for (x, y) in x.iter().zip(y).filter(|(x, y)| x.is_finite() && y.is_finite()) {
        let place = (((x - ends.0) / wide) as usize).min(PLACES - 1);
        let sum = &mut sums[place];
        *sum = (sum.0 + x, sum.1 + y * y, sum.2 + 1);
    }
    let told = sums.into_iter().filter(|s| s.2 >= FEWEST);
    told.map(|(x, squares, n)| (x / n as f64, (squares / n as f64).sqrt())).unzip()
}

/// Over the load of a residual whose way up and way down part: the two told apart, before; and both, after. `up` tells which way a row is on.
pub(crate) fn two_ways(trace: &Trace, id: &str, x_label: &str, x: &[f64], up: &[bool]) -> Figure {
    let way = |asked: bool| -> Vec<f64> {
        trace.before.iter().zip(up).map(|(v, up)| if *up == asked { *v } else { f64::NAN }).collect()
    };
    let ends =
        x.iter().copied().filter(|v| v.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    let mut layers: Vec<Layer> = trace.band(ends.0, ends.1).into_iter().collect();
    let [without, with] = ALONE;
    let clouds = [
        (format!("way up, {without}"), "b", way(true)),
        (format!("way down, {without}"), "c", way(false)),
        (with.to_owned(), "a", trace.after.clone()),
    ];
    layers.extend(clouds.map(|(name, class, y)| Layer::Dots { name, class, x: x.to_vec(), y }));
    let title = format!("{} left over on the way up and on the way down", heading(&trace.channel));
    trace.figure(&format!("{id}-two-ways"), title, x_label.to_owned(), layers)
}

/// Size that all but one in two hundred of the values keep.
fn usual(values: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = values.iter().filter(|v| v.is_finite()).map(|v| v.abs()).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    sizes.get((sizes.len() * 199 / 200).min(sizes.len().saturating_sub(1))).copied().unwrap_or(0.0)
}

/// Values over time, with a hole where samples are missing for long. A channel that is slower than the log has no sample on most rows: its samples
/// are joined.
pub(crate) fn lifted(t: &[f64], y: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let there: Vec<(f64, f64)> = t.iter().copied().zip(y.iter().copied()).filter(|p| p.1.is_finite()).collect();
    let mut steps: Vec<f64> = there.windows(2).map(|w| w[1].0 - w[0].0).collect();
    let usual = if steps.is_empty() { 0.0 } else { median(&mut steps) };
    let (mut x, mut out) = (Vec::with_capacity(there.len()), Vec::with_capacity(there.len()));
    for (i, (t, y)) in there.iter().enumerate() {
        if i > 0 && t - there[i - 1].0 > GAP * usual {
            x.push(there[i - 1].0);
            out.push(f64::NAN);
        }
        x.push(*t);
        out.push(*y);
    }
    (x, out)
}

/// Whether a variable moved, so that something can be drawn against it.
pub(crate) fn moves(x: &[f64]) -> bool {
    let finite = || x.iter().copied().filter(|v| v.is_finite());
    let (low, high) = finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    high - low > 1e-9 * high.abs().max(low.abs())
}

/// A figure whose lines and clouds hold no more points than its pixels show. A line that would fill its own noise as a block is told by the mean
/// of each column of pixels, before a band from the lowest to the highest.
pub(crate) fn thinned(mut figure: Figure) -> Figure {
    let mut bands = Vec::new();
    for layer in &mut figure.layers {
        match layer {
            Layer::Line { x, y, class, .. } => match columns(x, y).filter(|all| is_block(all)) {
                Some(all) => {
                    bands.extend(bands_of(&all, class));
                    (*x, *y) = all.iter().map(|c| (c.x, c.mean)).unzip();
                }
                None => (*x, *y) = line(x, y),
            },
            Layer::Dots { x, y, .. } => (*x, *y) = cloud(x, y),
            Layer::Marks { marks, .. } => *marks = apart(marks),
            _ => {}
        }
    }
    if !bands.is_empty() {
        figure.title += "; line: mean, band: lowest to highest";
        // behind every line, so that none is covered
        let first = figure.layers.iter().position(|l| matches!(l, Layer::Line { .. })).unwrap_or(0);
        figure.layers.splice(first..first, bands);
    }
    figure
}

/// What a line shows in one column of pixels; nothing finite where it has a hole.
#[derive(Debug, Clone, Copy)]
struct Column {
    x: f64,
    mean: f64,
    low: f64,
    high: f64,
}

/// The columns of a line that has several samples in each.
fn columns(x: &[f64], y: &[f64]) -> Option<Vec<Column>> {
    if x.len() <= 3 * COLUMNS {
        return None;
    }
    let (first, last) = (x[0], x[x.len() - 1]);
    let at = |v: f64| ((v - first) / (last - first) * COLUMNS as f64) as i64;
    let mut out = Vec::with_capacity(COLUMNS + 1);
    let mut i = 0;
    while i < x.len() {
        // a hole is a column of its own
        let hole = !y[i].is_finite();
        let ends = |k: &usize| at(x[*k]) != at(x[i]) || y[*k].is_finite() == hole;
        let end = (i + 1..x.len()).find(ends).unwrap_or(x.len());
        let values = &y[i..end];
        let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        out.push(Column { x: 0.5 * (x[i] + x[end - 1]), mean, low, high });
        i = end;
    }
    Some(out)
}

/// Whether columns mostly lie over their neighbours, so that a line through their extremes is a block.
fn is_block(all: &[Column]) -> bool {
    let (mut over, mut wide) = (0.0, 0.0);
    for pair in all.windows(2).filter(|p| p.iter().all(|c| c.mean.is_finite())) {
        over += (pair[0].high.min(pair[1].high) - pair[0].low.max(pair[1].low)).max(0.0);
        wide += 0.5 * (pair[0].high - pair[0].low + pair[1].high - pair[1].low);
    }
    over > 0.5 * wide
}

/// Bands over the columns, one for each stretch without a hole.
fn bands_of(all: &[Column], class: &'static str) -> Vec<Layer> {
    let band = |part: &[Column]| Layer::Band {
        name: String::new(),
        class,
        x: part.iter().map(|c| c.x).collect(),
        lower: part.iter().map(|c| c.low).collect(),
        upper: part.iter().map(|c| c.high).collect(),
    };
    all.split(|c| !c.mean.is_finite()).filter(|part| !part.is_empty()).map(band).collect()
}

/// A line with the two extremes of every column of pixels.
fn line(x: &[f64], y: &[f64]) -> (Vec<f64>, Vec<f64>) {
    if x.len() <= 3 * COLUMNS {
        return (x.to_vec(), y.to_vec());
    }
    let (first, last) = (x[0], x[x.len() - 1]);
    let column = |v: f64| ((v - first) / (last - first) * COLUMNS as f64) as i64;
    let (mut out_x, mut out_y) = (Vec::new(), Vec::new());
    let mut i = 0;
    while i < x.len() {
        let end = (i + 1..x.len()).find(|k| column(x[*k]) != column(x[i])).unwrap_or(x.len());
        let finite = || (i..end).filter(|k| y[*k].is_finite());
        let (low, high) = (finite().min_by(|a, b| y[*a].total_cmp(&y[*b])), finite().max_by(|a, b| y[*a].total_cmp(&y[*b])));
        if let (Some(a), Some(b)) = (low, high) {
            for k in if a == b { vec![a] } else { vec![a.min(b), a.max(b)] } {
                out_x.push(x[k]);
                out_y.push(y[k]);
            }
        }
        // a gap lifts the pen
        if !y[end - 1].is_finite() {
            out_x.push(x[end - 1]);
            out_y.push(f64::NAN);
        }
        i = end;
    }
    (out_x, out_y)
}

/// Read-outs that lie apart, of which there are no more than a finger can find.
fn apart(marks: &[Mark]) -> Vec<Mark> {
    if marks.len() <= READ_OUTS {
        return marks.to_vec();
    }
    let (x, y): (Vec<f64>, Vec<f64>) = marks.iter().map(|m| (m.x, m.y)).unzip();
    let (x, y) = cells(&x, &y, READ_OUTS);
    let kept = |m: &&Mark| x.iter().zip(&y).any(|(x, y)| *x == m.x && *y == m.y);
    let mut out: Vec<Mark> = marks.iter().filter(kept).cloned().collect();
    out.dedup_by(|a, b| a.x == b.x && a.y == b.y);
    out.truncate(2 * READ_OUTS);
    out
}

/// A cloud with one dot in every cell, of cells as small as the number of dots allows: what lies apart stays.
fn cloud(x: &[f64], y: &[f64]) -> (Vec<f64>, Vec<f64>) {
    cells(x, y, DOTS)
}

fn cells(x: &[f64], y: &[f64], most: usize) -> (Vec<f64>, Vec<f64>) {
    let points: Vec<(f64, f64)> =
        x.iter().copied().zip(y.iter().copied()).filter(|p| p.0.is_finite() && p.1.is_finite()).collect();
    if points.len() <= most {
        return points.into_iter().unzip();
    }
    let ends = |of: fn(&(f64, f64)) -> f64| {
        points.iter().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
    };
    let ((x0, x1), (y0, y1)) = (ends(|p| p.0), ends(|p| p.1));
    let mut cells = COLUMNS as f64;
    loop {
        let at = |v: f64, a: f64, b: f64, n: f64| ((v - a) / (b - a).max(f64::MIN_POSITIVE) * n) as u32;
        let mut seen = std::collections::BTreeSet::new();
        let kept: Vec<(f64, f64)> =
            points.iter().copied().filter(|p| seen.insert((at(p.0, x0, x1, cells), at(p.1, y0, y1, cells / 2.0)))).collect();
        if kept.len() <= most || cells < 6.0 {
            return kept.into_iter().unzip();
        }
        cells /= 1.25;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_what_stands_out() {
        let x: Vec<f64> = (0..600_000).map(f64::from).collect();
        let mut y: Vec<f64> = x.iter().map(|v| (v * 0.7).sin()).collect();
        y[123_456] = 50.0;
        let (lx, ly) = line(&x, &y);
        assert!(lx.len() <= 2 * COLUMNS + 2 && ly.contains(&50.0));
        let (cx, cy) = cloud(&x, &y);
        assert!(cx.len() <= DOTS && cy.contains(&50.0));
        assert_eq!(cloud(&x, &y), (cx, cy), "the same every time");
    }

    /// Noise of many rows is a band with its mean; what moves is a line; a hole parts the band.
    #[test]
    fn noise_is_no_block() {
        let x: Vec<f64> = (0..60_000).map(f64::from).collect();
        let noise: Vec<f64> = x.iter().map(|v| if (20e3..30e3).contains(v) { f64::NAN } else { (v * 0.7).sin() }).collect();
        let ramp: Vec<f64> = x.iter().map(|v| v * v).collect();
        let of = |y: &[f64]| {
            let layer = Layer::Line { name: "x".into(), class: "a", x: x.clone(), y: y.to_vec() };
            thinned(Figure { layers: vec![layer], ..Figure::default() })
        };
        let [Layer::Band { lower, upper, .. }, Layer::Band { .. }, Layer::Line { y, .. }] = &of(&noise).layers[..] else {
            panic!("two bands and a line")
        };
        // a column beside the hole may hold few samples
        let most = |out: usize| out <= 2;
        assert!(most(lower.iter().zip(upper).filter(|(l, u)| **l > -0.9 || **u < 0.9).count()));
        assert!(y.len() < 2 * COLUMNS && most(y.iter().filter(|v| v.is_finite() && v.abs() > 0.1).count()), "the mean");
        assert!(matches!(&of(&ramp).layers[..], [Layer::Line { .. }]));
    }

    #[test]
    fn an_absurd_reading_does_not_hide_the_others() {
        let x: Vec<f64> = (0..1000).map(f64::from).collect();
        let mut before: Vec<f64> = x.iter().map(|v| 0.5 * (v * 0.7).sin()).collect();
        before[3] = -12.0;
        let trace = Trace { channel: "voltage_v".into(), t: x.clone(), after: vec![0.0; 1000], before, ..Trace::default() };
        let figure = against(&trace, "x", ("charge", "Ah"), &x, ["before", "after"]);
        assert!(figure.title.ends_with("(1 off the scale)"), "{}", figure.title);
        let Some(Layer::Dots { y, .. }) = figure.layers.iter().find(|l| matches!(l, Layer::Dots { .. })) else { panic!("dots") };
        assert!(y.iter().all(|v| v.abs() < 1.0));
    }

    /// What scatters about one speed shows there, where its mean is nothing.
    #[test]
    fn scatter_is_seen_where_the_mean_is_none() {
        let x: Vec<f64> = (0..4800).map(|i| f64::from(i) / 4.8).collect();
        let at = |v: f64| if (500.0..540.0).contains(&v) { 2.0 } else { 0.5 };
        let before: Vec<f64> = x.iter().enumerate().map(|(i, v)| if i % 2 == 0 { at(*v) } else { -at(*v) }).collect();
        let channel = "thrust_n".to_owned();
        let trace = Trace { channel, floor: 0.5, t: x.clone(), after: before.clone(), before, ..Trace::default() };
        let figure = scatter(&trace, "x", "speed, rpm", &x, &at);
        let Some(Layer::Line { x, y, .. }) = figure.layers.iter().find(|l| matches!(l, Layer::Line { .. })) else {
            panic!("a line")
        };
        let peak = x.iter().zip(y).max_by(|a, b| a.1.total_cmp(b.1)).expect("places");
        assert!((500.0..545.0).contains(peak.0) && *peak.1 > 1.5, "{peak:?}");
        assert!(y.iter().filter(|v| **v < 0.6).count() > 40 && figure.y_label.starts_with("rms left over"));
    }

    #[test]
    fn the_way_up_is_told_from_the_way_down() {
        let x: Vec<f64> = (0..20).map(|i| f64::from(if i < 10 { i } else { 19 - i })).collect();
        let up: Vec<bool> = (0..20).map(|i| i < 10).collect();
        let before: Vec<f64> = up.iter().map(|up| if *up { -1.0 } else { 1.0 }).collect();
        let trace = Trace { channel: "thrust_n".into(), t: x.clone(), after: vec![0.0; 20], before, ..Trace::default() };
        let figure = two_ways(&trace, "x", "speed, rpm", &x, &up);
        let of = |word: &str| {
            figure.layers.iter().find_map(|l| match l {
                Layer::Dots { name, y, .. } if name.starts_with(word) => Some(y.clone()),
                _ => None,
            })
        };
        assert_eq!((of("way up"), of("way down")), (Some(vec![-1.0; 10]), Some(vec![1.0; 10])));
        assert_eq!(figure.x_label, "speed, rpm");
    }

    /// A magnetometer that is read on every third row: its samples are a line, and a long hole parts it.
    #[test]
    fn a_slower_channel_is_a_line() {
        let t: Vec<f64> = (0..1200).map(|i| 0.005 * f64::from(i)).collect();
        let slow = |i: &u32| i.is_multiple_of(3) && !(600..800).contains(i);
        let before: Vec<f64> = (0..1200).map(|i| if slow(&i) { 5.0 } else { f64::NAN }).collect();
        let trace = Trace { channel: "mag_x".into(), t, after: before.clone(), before, ..Trace::default() };
        let figure = over_time(&trace, "x", ["before", "after"]);
        let Some(Layer::Line { y, .. }) = figure.layers.first() else { panic!("a line") };
        assert_eq!((y.iter().filter(|v| v.is_finite()).count(), y.iter().filter(|v| !v.is_finite()).count()), (333, 1));
    }

    #[test]
    fn nothing_is_drawn_against_what_stands_still() {
        assert!(!moves(&[]) && !moves(&[0.0, 0.0, f64::NAN]) && !moves(&[4.2; 5]) && moves(&[0.0, 0.1]));
    }

    #[test]
    fn small_values_have_a_small_unit() {
        let t: Vec<f64> = (0..9).map(f64::from).collect();
        let trace = Trace {
            channel: "torque_nm".into(),
            unit: "N.m".into(),
            floor: 2e-4,
            t: t.clone(),
            before: vec![5e-4; 9],
            after: vec![0.0; 9],
            ..Trace::default()
        };
        let figure = over_time(&trace, "x", ["before", "after"]);
        assert_eq!(figure.y_label, "left over, mN.m");
        let [Layer::Band { upper, .. }, Layer::Line { y, .. }, ..] = figure.layers.as_slice() else {
            panic!("a band and a line")
        };
        assert!((upper[0] - 0.2).abs() < 1e-12 && (y[0] - 0.5).abs() < 1e-12);
        let large = Trace { before: vec![0.5; 9], ..trace };
        assert_eq!(over_time(&large, "x", ["before", "after"]).y_label, "left over, N.m");
    }

    #[test]
    fn the_enlarged_part_holds_what_was_explained() {
        let t: Vec<f64> = (0..1200).map(|i| 0.1 * f64::from(i)).collect();
        let before: Vec<f64> = (0..1200).map(|i| if (600..620).contains(&i) { 5.0 } else { 0.0 }).collect();
        let trace = Trace { channel: "thrust_n".into(), t, before, after: vec![0.0; 1200], ..Trace::default() };
        let figure = enlarged(&trace, "x", ["before", "after"]).expect("a part");
        let Some(Layer::Line { x, .. }) = figure.layers.first() else { panic!("a line") };
        assert!(x[0] <= 60.0 && x[x.len() - 1] >= 61.9 && x[x.len() - 1] - x[0] < 15.0);
    }
}
