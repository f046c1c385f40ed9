//! The pages on the recorded sets.
//!
//! What it is: for each run declared model, residual, verdict, error before and after on rows that no fit saw, and the figure
//! that convinces; for each rig the causes on its other runs; and the summary over all sets.
//! What can go wrong: nothing; sets of more than eight runs are summed up, with one run shown.
//! Units: as the channels state.
//! Reference: specification `closing-the-loop.md`, "Real measurements".

use super::set::SETS;
use super::{Outcome, Recorded, Tried};
use ident::channel::unit_of;
use ident::close::Closed;
use ident::model::Model;
use ident::report::{Figure, Layer};
use ident::verdict::words::{channel, list, plain, upper};
use ident::verdict::{EffectEntry, Kind, Parameter};
use std::fmt::Write;

/// Runs above which a set is summed up instead of shown run by run.
const MANY: usize = 8;
/// Dots of a cloud in a figure.
const DOTS: usize = 700;

/// Head of the summary table.
const SUMMARY_HEAD: &str = "| set | runs | verdicts | effects named (runs) | causes that hold on another run of the rig |\n| --- | --- | --- | --- | --- |\n";

/// Three significant digits.
pub(crate) fn three(v: f64) -> String {
    if v == 0.0 || !v.is_finite() {
        return format!("{v}");
    }
    let magnitude = v.abs().log10().floor() as i32;
    if !(-4..5).contains(&magnitude) { format!("{v:.2e}") } else { format!("{v:.*}", (2 - magnitude).max(0) as usize) }
}

/// A verdict in a word.
pub(crate) fn word(kind: Kind) -> &'static str {
    match kind {
        Kind::Attributed => "attributed",
        Kind::Unattributed => "unattributed",
        Kind::None => "none",
        Kind::Ambiguous => "ambiguous",
    }
}

fn ids(closed: &Closed) -> String {
    let list: Vec<String> = closed.verdict.effects.iter().map(|e| format!("{} ({})", e.id, e.channels.join(", "))).collect();
    if list.is_empty() { "-".to_owned() } else { list.join("; ") }
}

/// The channel whose held-out error falls most, with its factor.
fn most(closed: &Closed) -> Option<(&String, f64, f64)> {
    let channels = closed.verdict.channels.iter().map(|(n, c)| (n, c.before.heldout_rms, c.after.heldout_rms));
    channels.max_by(|a, b| (a.1 / a.2).total_cmp(&(b.1 / b.2)))
}

/// How the summary page begins.
pub(super) const BEGINNING: &str = "# The loop on recorded data\n\nWritten by `quadrig measured DATA`";

/// The summary page.
pub(crate) fn index(outcomes: &[Outcome]) -> String {
    let mut out = BEGINNING.to_owned();
    out.push_str(
        ", where `DATA/rig` holds logs that nobody here made. Each set has a page with \
         every run's declared model, residual, verdict, error before and after on rows that no fit saw, and the figure that convinces. \
         Nothing on these pages is blind: the sets were at hand while the tool was made.\n\n\
",
    );
    out.push_str(SUMMARY_HEAD);
    for o in outcomes {
        let _ = writeln!(out, "{}", summary(o));
    }
    out.push_str("\nA cause holds on another run where the model corrected on the first predicts it better than the same model refitted without the cause: by 2 % or more, on a channel that the effect touches, one constant a channel apart. A cause that the readings show by themselves (a grid that they lie on) predicts nothing better. It holds where the other run's readings show it too, and is counted apart. An ambiguous verdict stands for what its hypotheses share, those that are a tenth as probable as the first included; what they differ by is left open, and counted apart.\n");
    out.push_str(&super::table::index(outcomes));
    out.push_str(&super::table::together(outcomes));
    let absent: Vec<&str> = SETS
        .iter()
        .filter(|s| outcomes.iter().any(|o| o.set.folder == s.folder && o.runs.is_empty()))
        .map(|s| s.folder)
        .collect();
    if !absent.is_empty() {
        let _ = writeln!(out, "\nAbsent when this page was written: {}.", absent.join(", "));
    }
    for o in outcomes {
        let _ = writeln!(out, "\n## {}\n\n{} [All of it](measured/{}.md).", o.set.folder, o.set.what, o.set.folder);
        if let Some((run, closed, entry)) = telling(o).filter(|_| o.set.figures) {
            let _ = writeln!(
                out,
                "\n![{} on {}](measured/{})\n\n{}: {}.",
                entry.id,
                run.name,
                figure_name(run, entry),
                run.name,
                sentences(&entry.evidence)
            );
            let _ = closed;
        }
    }
    out
}

/// Parameters with their intervals, a line each. A term without a name is said in words; the verdict has its coefficients.
fn parameters(e: &EffectEntry) -> String {
    if e.id == "unknown" {
        let of: Vec<String> = e.depends_on.iter().map(|d| channel(d)).collect();
        return if of.is_empty() {
            "- no correction".to_owned()
        } else {
            format!("- a smooth function of {}, whose coefficients the verdict has", list(&of))
        };
    }
    let told =
        |p: &Parameter| format!("- {} = {} {} ({} to {})", p.name, three(p.value), p.unit, three(p.ci95[0]), three(p.ci95[1]));
    e.parameters.iter().map(told).collect::<Vec<_>>().join("\n")
}

/// Clauses as sentences of their own.
fn sentences(evidence: &str) -> String {
    plain(evidence).split("; ").map(upper).collect::<Vec<_>>().join(". ")
}

/// The row of a set in the summary.
pub(crate) fn summary(o: &Outcome) -> String {
    let mut verdicts: Vec<(&str, usize)> = Vec::new();
    let mut named: Vec<(String, usize)> = Vec::new();
    for run in &o.runs {
        let kind = run.closed.as_ref().map_or("not closed", |c| word(c.verdict.verdict));
        count(&mut verdicts, kind);
        let mut own: Vec<String> = run.closed.iter().flat_map(|c| c.verdict.effects.iter().map(|e| e.id.clone())).collect();
        own.sort_unstable();
        own.dedup();
        own.into_iter().for_each(|id| count(&mut named, id));
    }
    named.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
    let list = |l: Vec<String>| if l.is_empty() { "-".to_owned() } else { l.join(", ") };
    let of = |wanted: &dyn Fn(&Tried) -> bool| -> (usize, usize) {
        let tried: Vec<&Tried> = o.tried.iter().filter(|t| wanted(t)).collect();
        (tried.iter().filter(|t| t.holds()).count(), tried.len())
    };
    let (held, claimed) = of(&|t| t.claimed && t.seen_there.is_none());
    let further =
        [(of(&|t| t.claimed && t.seen_there.is_some()), "by the readings alone"), (of(&|t| !t.claimed), "of what is left open")];
    let further: String =
        further.iter().filter(|((_, all), _)| *all > 0).map(|((held, all), what)| format!("; {held} of {all} {what}")).collect();
    format!(
        "| [{}](measured/{}.md) | {} | {} | {} | {} |",
        o.set.folder,
        o.set.folder,
        o.runs.len(),
        list(verdicts.iter().map(|(k, n)| format!("{n} {k}")).collect()),
        list(named.iter().map(|(k, n)| format!("{k} ({n})")).collect()),
        if o.tried.is_empty() { "one run a rig".to_owned() } else { format!("{held} of {claimed} trials{further}") }
    )
}

fn count<T: PartialEq>(list: &mut Vec<(T, usize)>, item: T) {
    match list.iter_mut().find(|(k, _)| *k == item) {
        Some(entry) => entry.1 += 1,
        None => list.push((item, 1)),
    }
}

/// The page of a set and its figures.
pub(crate) fn set(o: &Outcome) -> (String, Vec<Figure>) {
    let mut out = format!("# {}\n\n{}\n", o.set.folder, o.set.what);
    let mut figures = Vec::new();
    if o.runs.is_empty() {
        out.push_str("\nThe set was absent when this page was written.\n");
        return (out, figures);
    }
    let _ = write!(out, "\n{}{}\n", SUMMARY_HEAD, summary(o).replace("](measured/", "]("));
    if o.runs.len() > MANY {
        overview(&mut out, o);
        if let Some((run, closed, _)) = telling(o) {
            let _ = writeln!(out, "\nOne run in full, the one whose error falls most:");
            self::run(&mut out, &mut figures, run, closed, o.set.figures);
        }
    } else {
        for run in &o.runs {
            match &run.closed {
                Ok(closed) => self::run(&mut out, &mut figures, run, closed, o.set.figures),
                Err(why) => {
                    let _ = writeln!(out, "\n## {}\n\nThe loop cannot be closed: {why}.", run.name);
                }
            }
        }
    }
    crossed(&mut out, o);
    out.push_str(&super::table::pairs(&o.transfer));
    (out, figures)
}

/// The run and effect whose held-out error falls most.
fn telling(o: &Outcome) -> Option<(&Recorded, &Closed, &EffectEntry)> {
    o.runs
        .iter()
        .filter_map(|r| r.closed.as_ref().ok().and_then(|c| c.verdict.effects.first().map(|e| (r, c, e))))
        .filter(|(_, _, e)| e.heldout_error_reduction.is_finite())
        .max_by(|a, b| a.2.heldout_error_reduction.total_cmp(&b.2.heldout_error_reduction))
}

fn overview(out: &mut String, o: &Outcome) {
    out.push_str("\n| run | rows | verdict | effects (channels) | channel that gains most | held-out before | after | factor |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n");
    for run in &o.runs {
        let rows = run.log.as_ref().map_or(0, ident::log::Log::len);
        match &run.closed {
            Err(why) => {
                let _ = writeln!(out, "| {} | {rows} | not closed: {why} | | | | | |", run.name);
            }
            Ok(c) => {
                let gain = most(c).map_or_else(
                    || "| - | - | - | - ".to_owned(),
                    |(n, b, a)| format!("| {n} | {} | {} | {:.2} ", three(b), three(a), b / a),
                );
                let _ = writeln!(out, "| {} | {rows} | {} | {} {gain}|", run.name, word(c.verdict.verdict), ids(c));
            }
        }
    }
}

fn run(out: &mut String, figures: &mut Vec<Figure>, run: &Recorded, closed: &Closed, shown: bool) {
    let v = &closed.verdict;
    let rows = run.log.as_ref().map_or(0, ident::log::Log::len);
    let _ = writeln!(
        out,
        "\n## {}\n\n{rows} rows, {} findings of the import. Verdict: **{}**, {}.\n",
        run.name,
        run.notes,
        word(v.verdict),
        ids(closed)
    );
    out.push_str("Declared:\n\n```text\n");
    for p in closed.declared.polynomials.iter().filter(|p| v.channels.contains_key(&p.channel)) {
        let x = if p.channel.starts_with("rpm") { "kus" } else { "krpm" };
        let terms: Vec<String> = p
            .coefficients
            .iter()
            .enumerate()
            .map(|(k, c)| if k == 0 { three(*c) } else { format!("{} {x}^{k}", three(*c)) })
            .collect();
        let _ = writeln!(out, "{} = {}", p.channel, terms.join(" + "));
    }
    out.push_str("```\n\n| channel | unit | noise floor | rms before | held-out before | held-out after | factor | whiteness p before | after |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
    for (name, c) in &v.channels {
        let (b, a) = (c.before.heldout_rms, c.after.heldout_rms);
        let _ = writeln!(
            out,
            "| {name} | {} | {} | {} | {} | {} | {:.2} | {} | {} |",
            c.unit,
            three(c.noise_floor_rms),
            three(c.before.rms),
            three(b),
            three(a),
            b / a.max(1e-300),
            three(c.before.whiteness_p),
            three(c.after.whiteness_p)
        );
    }
    for e in &v.effects {
        let _ = writeln!(
            out,
            "\n**{}** (p = {:.2}) on {}. {}.\n\n{}",
            e.id,
            e.probability,
            e.channels.join(", "),
            sentences(&e.evidence),
            parameters(e)
        );
    }
    if !v.alternatives.is_empty() {
        let list: Vec<String> = v.alternatives.iter().map(|a| format!("{} ({:.2})", a.ids.join(" + "), a.probability)).collect();
        let _ = writeln!(out, "\nAlternatives: {}.", list.join("; "));
    }
    if let Some(next) = &v.next_experiment {
        let _ = writeln!(out, "\nNext experiment: {}.", next.why);
    }
    for entry in v.effects.iter().take(if shown { 2 } else { 0 }) {
        if let Some(figure) = figure(run, closed, entry) {
            let _ = writeln!(out, "\n![{} on {}]({}.svg)", entry.id, run.name, figure.id);
            figures.push(figure);
        }
    }
}

fn figure_name(run: &Recorded, entry: &EffectEntry) -> String {
    format!("{}-{}-{}.svg", run.name.replace('.', "_"), entry.id, entry.channels.first().map_or("", String::as_str))
}

/// The residual of the effect's first channel before and after, over what the effect depends on where that is a column, else time.
fn figure(run: &Recorded, closed: &Closed, entry: &EffectEntry) -> Option<Figure> {
    let context = &closed.context;
    let target = &context.targets[context.target(entry.channels.first()?)?];
    let as_fitted = |model: &Model| model.predict_at_its_own_supply(context, target.name);
    let (before, after) = (as_fitted(&closed.declared)?, as_fitted(&closed.model)?);
    let named = entry.depends_on.iter().find_map(|d| Some((d.clone(), column(context, d)?)));
    let (label, values) = named.unwrap_or_else(|| ("t_s".to_owned(), context.t.clone()));
    let over_time = label == "t_s";
    let label = if over_time && context.time_is_row { "row".to_owned() } else { label };
    let stride = if over_time { 1 } else { target.rows.len().div_ceil(DOTS).max(1) };
    let rows = || target.rows.iter().zip(&target.y).step_by(stride);
    let x: Vec<f64> = rows().map(|(i, _)| values[*i]).collect();
    let layer = |name: &str, class: &'static str, prediction: &[f64]| {
        let (name, x, y) = (name.to_owned(), x.clone(), rows().map(|(i, y)| y - prediction[*i]).collect());
        if over_time { Layer::Line { name, class, x, y } } else { Layer::Dots { name, class, x, y } }
    };
    let unit = unit_of(&label);
    Some(Figure {
        id: figure_name(run, entry).trim_end_matches(".svg").to_owned(),
        title: format!("{}: {} before and after {}", run.name, target.name, entry.id),
        x_label: if unit.is_empty() { label } else { format!("{label}, {unit}") },
        y_label: format!("measured - predicted, {}", unit_of(target.name)),
        layers: vec![layer("declared", "b", &before), layer("corrected", "a", &after)],
        ..Figure::default()
    })
}

fn column(context: &ident::channel::Context, name: &str) -> Option<Vec<f64>> {
    match name {
        "t_s" => Some(context.t.clone()),
        "rpm" => (!context.rpm.is_empty()).then(|| context.rpm.clone()),
        "pulse_us" => context.pulse.clone(),
        "current_a" => context.current.clone(),
        "temp_c" => context.temperature.clone(),
        "voltage_v" => context.voltage.clone(),
        _ => context.covariates.iter().find(|c| c.0 == name).map(|c| c.1.clone()),
    }
}

fn crossed(out: &mut String, o: &Outcome) {
    if o.tried.is_empty() {
        out.push_str("\n## On other runs\n\nNo rig of this set has a second run.\n");
        if o.runs.len() > 1 {
            common(out, o);
        }
        return;
    }
    out.push_str("\n## On the rig's other runs\n\nThe model corrected on one run predicts the others as it stands but for one constant a channel (tare, supply level), and so does the same model refitted without the effect.\n\n| effect | named on | tried on | channel | error without | with | the verdict stands for it | holds | named there too |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
    for t in &o.tried {
        let yes = |b: bool| if b { "yes" } else { "no" };
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            t.id,
            t.from,
            t.on,
            t.channel,
            three(t.errors.0),
            three(t.errors.1),
            if t.claimed { "yes" } else { "left open" },
            if t.seen_there == Some(true) { "in the readings" } else { yes(t.holds()) },
            yes(t.named_there)
        );
    }
    common(out, o);
}

/// The same effect on the same channel of several runs, found independently, with its parameters.
fn common(out: &mut String, o: &Outcome) {
    let mut keys: Vec<(String, String)> = o
        .runs
        .iter()
        .flat_map(|r| r.closed.iter())
        .flat_map(|c| c.verdict.effects.iter().flat_map(|e| e.channels.iter().map(|channel| (e.id.clone(), channel.clone()))))
        .filter(|(id, _)| id != "unknown")
        .collect();
    keys.sort_unstable();
    keys.dedup();
    if o.runs.len() > MANY || keys.is_empty() {
        return;
    }
    out.push_str(
        "\n## Found independently\n\n| effect | channel | runs | first parameter, run by run |\n| --- | --- | --- | --- |\n",
    );
    for (id, channel) in keys {
        let values: Vec<String> = o
            .runs
            .iter()
            .filter_map(|r| {
                let entry =
                    r.closed.as_ref().ok()?.verdict.effects.iter().find(|e| e.id == id && e.channels.contains(&channel))?;
                let p = entry.parameters.first()?;
                Some(format!("{} = {} {}", p.name, three(p.value), p.unit))
            })
            .collect();
        let _ = writeln!(out, "| {id} | {channel} | {} of {} | {} |", values.len(), o.runs.len(), values.join("; "));
    }
}
