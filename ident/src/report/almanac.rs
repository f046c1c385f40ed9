//! The library as pages: one an effect, written from the effects themselves.
//!
//! What it is: equation, source, parameters with units and bounds, the change of every relation on a standard run as a figure, and
//! the effects that look alike there.
//! What can go wrong: a page speaks of the standard run: on another schedule bounds and look-alikes differ, and the verdict
//! computes its own.
//! Units: changes in noise floors of their channel, so that relations can be drawn together.
//! Reference: specification `closing-the-loop.md`, step 5; look-alikes by the angle between projected signatures (notes, item 7).

use crate::channel::Context;
use crate::effects::design::{Label, TargetDesign};
use crate::effects::placed::Placed;
use crate::effects::{Effect, Instance, library};
use crate::fit::design;
use crate::log::{Column, Log};
use crate::model::Declared;
use crate::numeric::digits::number;
use crate::numeric::solve::Normal;
use crate::report::{Figure, Layer};
use crate::verdict::words::plain;
use std::fmt::Write;

/// Root mean square, in noise floors, to which a linear amplitude is scaled on its most affected channel.
const SIZE: f64 = 10.0;
/// Cosine between projected signatures from which two effects look alike.
const ALIKE: f64 = 0.8;

/// A page and its figure.
#[derive(Debug, Clone)]
pub struct Page {
    /// Identifier of the effect, and name of the files.
    pub id: &'static str,
    /// Markdown.
    pub text: String,
    /// The signature.
    pub figure: Figure,
}

/// What one instance does to the standard run.
struct Signature {
    instance: Instance,
    shape: Vec<f64>,
    /// For each target the change in noise floors: as it is, and with the declared columns projected out.
    changes: Vec<(usize, Vec<f64>, Vec<f64>)>,
}

/// Every page, and the index.
#[must_use]
pub fn almanac() -> (Vec<Page>, String) {
    let context = Context::new(&standard_run(), None);
    let all: Vec<(&'static dyn Effect, Vec<Signature>)> = library()
        .iter()
        .map(|e| (*e, e.instances(&context).into_iter().filter_map(|i| signature(&context, *e, i)).collect()))
        .collect();
    let pages: Vec<Page> = all.iter().map(|(effect, own)| page(&context, *effect, own, &all)).collect();
    let mut index = String::from(
        "# Effects\n\nWritten by `quadrig effects` from the library itself. Each page has the equation with its source, the parameters with their bounds, what the effect does to every relation of a standard run, and what looks alike there.\n\n| id | what | depends on |\n| --- | --- | --- |\n",
    );
    for (effect, _) in &all {
        let about = effect.about();
        let _ = writeln!(index, "| [{}]({}.md) | {} | {} |", effect.id(), effect.id(), about.title, about.depends_on.join(", "));
    }
    (pages, index)
}

/// 570 KV with 11x4.7 at 11.5 V: eleven levels up and down, six seconds each, at 10 Hz, all meters fitted, a room that warms.
fn standard_run() -> Log {
    let n = 21 * 60;
    let mut log = Log { name: "standard run".into(), ..Log::default() };
    let level = |i: usize| {
        let k = i / 60;
        1000.0 + 100.0 * (if k <= 10 { k } else { 20 - k }) as f64
    };
    // a fixed pattern stands for noise: floors must not be nought
    let ripple = |i: usize, k: usize| (((i * 7919 + k * 104_729) % 1009) as f64 / 504.5 - 1.0) * 1.7;
    let u = |i: usize| (level(i) - 1000.0) / 1000.0;
    let speed =
        |i: usize| if u(i) > 0.0 { 300.0 + 8_800.0 * u(i) - 5_200.0 * u(i).powi(2) + 1_910.0 * u(i).powi(3) } else { 0.0 };
    log.t = (0..n).map(|i| 0.1 * i as f64).collect();
    let mut push =
        |name: &str, of: &dyn Fn(usize) -> f64| log.columns.push(Column { name: name.into(), values: (0..n).map(of).collect() });
    push("pulse_us", &level);
    for (k, name) in ["rpm_beam", "rpm_opto", "rpm_hall", "rpm_encoder"].into_iter().enumerate() {
        push(name, &|i| speed(i) + if u(i) > 0.0 { 0.5 * ripple(i, k) } else { 0.0 });
    }
    let square = |i: usize| (speed(i) / 5810.0).powi(2);
    push("thrust_n", &|i| 5.78 * square(i) + 0.007 * ripple(i, 5));
    push("torque_nm", &|i| 0.104 * square(i) + 0.0003 * ripple(i, 6));
    push("current_a", &|i| 0.2 + 7.15 * square(i) * (speed(i) / 5810.0) + 0.03 * ripple(i, 7));
    push("voltage_v", &|i| 11.5 + 0.01 * ripple(i, 8));
    push("temp_c", &|i| 15.0 + 6.0 * (1.0 - (-(i as f64) / 500.0).exp()) + 0.1 * ripple(i, 9));
    push("thrust_rms_n", &|i| 0.01 + 0.002 * square(i) + 0.0005 * ripple(i, 10));
    log
}

fn norm(v: &[f64]) -> f64 {
    (v.iter().map(|x| x * x).sum::<f64>() / v.len().max(1) as f64).sqrt()
}

fn signature(context: &Context, effect: &'static dyn Effect, instance: Instance) -> Option<Signature> {
    let shape: Vec<f64> = effect.shapes(context, &instance).iter().map(|s| s.starts[s.starts.len() / 2]).collect();
    let placed = [Placed { effect, instance: instance.clone(), shape: shape.clone() }];
    let mut changes = Vec::new();
    for (i, target) in context.targets.iter().enumerate().filter(|(_, t)| instance.touches(t.name)) {
        let plain = TargetDesign::baseline(context, target.name, target.relation);
        let with = design(context, Declared::default(), &placed, target);
        let base = least_squares(&plain, &target.rows, &target.y, target.noise.rms.powi(2))?;
        let predicted = plain.predict(&base, context.len());
        // the declared part through the effect's operators, with the coefficients of the healthy rig, and each amplitude at one
        let coefficients: Vec<f64> = with
            .columns
            .iter()
            .map(|c| if let Label::Base(k) = c.label { base.get(k).copied().unwrap_or(0.0) } else { 0.0 })
            .collect();
        let through: Vec<f64> = with.predict(&coefficients, context.len()).iter().zip(&predicted).map(|(a, b)| a - b).collect();
        let mut change = through;
        for column in with.columns.iter().filter(|c| matches!(c.label, Label::Effect { .. })) {
            let size = norm(&column.values).max(f64::MIN_POSITIVE);
            change.iter_mut().zip(column.values.iter()).for_each(|(c, v)| *c += SIZE * target.noise.rms * v / size);
        }
        change.iter_mut().for_each(|c| *c /= target.noise.rms);
        let rows: Vec<usize> = (0..context.len()).collect();
        let fitted = plain.predict(&least_squares(&plain, &rows, &change, target.noise.rms.powi(2))?, context.len());
        let left: Vec<f64> = change.iter().zip(&fitted).map(|(c, f)| c - f).collect();
        changes.push((i, change, left));
    }
    changes.iter().any(|c| norm(&c.2) > 1e-6).then_some(Signature { instance, shape, changes })
}

/// `unit`: variance that a weight of one stands for.
fn least_squares(design: &TargetDesign, rows: &[usize], y: &[f64], unit: f64) -> Option<Vec<f64>> {
    let mut normal = Normal::new(design.columns.len());
    for (i, v) in rows.iter().zip(y) {
        let row: Vec<f64> = design.columns.iter().map(|c| c.values[*i]).collect();
        normal.add(&row, *v, 1.0);
    }
    design.expect(&mut normal, unit);
    Some(normal.solve()?.coefficients)
}

/// Cosine between two signatures over all channels, with the declared columns projected out.
fn cosine(a: &Signature, b: &Signature) -> f64 {
    let dot = |x: &Signature, y: &Signature| -> f64 {
        x.changes
            .iter()
            .filter_map(|(i, _, u)| {
                y.changes.iter().find(|(j, _, _)| i == j).map(|(_, _, v)| u.iter().zip(v).map(|(p, q)| p * q).sum::<f64>())
            })
            .sum()
    };
    dot(a, b) / (dot(a, a) * dot(b, b)).sqrt().max(f64::MIN_POSITIVE)
}

/// The section on look-alikes: what was taken out on which standard log, the effects with their cosines, and those that are told besides.
pub(crate) fn looks_alike(on: &str, alike: impl Iterator<Item = (f64, &'static str)>, told: &[&str]) -> String {
    let mut alike: Vec<(f64, &str)> = alike.filter(|(c, _)| *c > ALIKE).collect();
    alike.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(b.1)));
    let list: Vec<String> = alike.iter().map(|(c, other)| format!("[{other}]({other}.md) ({c:.2})")).collect();
    let list = if list.is_empty() { "none".to_owned() } else { list.join(", ") };
    let mut text = format!("\n## Looks alike\n\nOn the standard {on}, cosine above {ALIKE}: {list}.\n");
    if !told.is_empty() {
        let _ = write!(text, "\nEasily taken for: {}.\n", told.join(", "));
    }
    text
}

fn page(
    context: &Context,
    effect: &'static dyn Effect,
    own: &[Signature],
    all: &[(&'static dyn Effect, Vec<Signature>)],
) -> Page {
    let about = effect.about();
    let id = effect.id();
    let mut text = format!(
        "# {id}\n\n{}.\n\n```text\n{}\n```\n\nSource: {}.\n\nIn the residual: {}.\n\nDepends on: {}.\n",
        about.title,
        about.equation,
        about.source,
        plain(about.signature),
        about.depends_on.join(", ")
    );
    text.push_str("\n## Parameters\n\nBounds are those of the standard run; times scale with the run's length.\n\n| parameter | unit | from | to |\n| --- | --- | --- | --- |\n");
    let mut seen: Vec<&str> = Vec::new();
    for instance in effect.instances(context) {
        for s in effect.shapes(context, &instance) {
            if !seen.contains(&s.name) {
                seen.push(s.name);
                let _ = writeln!(text, "| {} | {} | {} | {} |", s.name, s.unit, number(s.range.0), number(s.range.1));
            }
        }
        for a in effect.amplitudes(&instance) {
            if !seen.contains(&a.name) {
                seen.push(a.name);
                let _ = writeln!(text, "| {} | {} | fitted | |", a.name, a.unit);
            }
        }
    }
    let alike = all.iter().filter(|(other, _)| other.id() != id).filter_map(|(other, theirs)| {
        let pairs = own.iter().flat_map(|a| theirs.iter().map(move |b| cosine(a, b).abs()));
        pairs.max_by(f64::total_cmp).map(|c| (c, other.id()))
    });
    text.push_str(&looks_alike("run, with the declared polynomials projected out", alike, about.look_alikes));
    let first = own.iter().max_by_key(|s| s.changes.len());
    match first {
        None => text
            .push_str("\n## Signature\n\nThe standard run does not show its mean: it speaks of single readings or of scatter.\n"),
        Some(s) => {
            let shapes = effect.shapes(context, &s.instance);
            let at: Vec<String> =
                shapes.iter().zip(&s.shape).map(|(p, v)| format!("{} = {} {}", p.name, number(*v), p.unit)).collect();
            let _ = write!(
                text,
                "\n## Signature\n\n![what {id} does to each relation](../effects/{id}.svg)\n\nChange of each relation in noise floors of its channel{}{}. Linear amplitudes are scaled to {SIZE} noise floors.\n",
                if at.is_empty() { "" } else { ", at " },
                at.join(", ")
            );
        }
    }
    Page { id, text, figure: figure(context, id, first) }
}

fn figure(context: &Context, id: &str, signature: Option<&Signature>) -> Figure {
    const CLASSES: [&str; 6] = ["a", "b", "c", "d", "e", "f"];
    let layers = signature
        .iter()
        .flat_map(|s| &s.changes)
        .zip(CLASSES)
        .map(|((i, change, _), class)| Layer::Line {
            name: context.targets[*i].name.to_owned(),
            class,
            x: context.t.clone(),
            y: change.clone(),
        })
        .collect();
    Figure {
        id: id.to_owned(),
        title: format!("{id} on the standard run"),
        x_label: "time, s".into(),
        y_label: "change, noise floors".into(),
        layers,
        ..Figure::default()
    }
}
