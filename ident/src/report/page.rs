//! The page of a closed loop.
//!
//! What it is: verdict, table before and after, one figure a broken relation, parameters with intervals, the run itself.
//! What can go wrong: nothing; figures of channels that the log lacks are left out.
//! Units: on the axes.
//! Reference: specification `closing-the-loop.md`, step 8.

use super::number;
use super::svg::{Chart, Series, escape};
use crate::close::Closed;
use crate::context::unit_of;
use crate::effects::unknown::variable;
use crate::log::Log;
use crate::verdict::Kind;
use std::fmt::Write;

const STYLE: &str = "
:root{--fg:#1a1a1a;--bg:#fff;--grid:#ddd;--a:#0b62a4;--b:#d1600a;--c:#3a8a3a;--d:#888}
@media(prefers-color-scheme:dark){:root{--fg:#e6e6e6;--bg:#15181c;--grid:#333a42;--a:#6db3f2;--b:#ffa657;--c:#7ecf7e;--d:#8b949e}}
@media print{:root{--fg:#000;--bg:#fff;--grid:#ccc;--a:#0b62a4;--b:#d1600a;--c:#3a8a3a;--d:#777}}
body{font:16px/1.5 system-ui,sans-serif;color:var(--fg);background:var(--bg);max-width:64rem;margin:0 auto;padding:1rem}
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}
.wide{overflow-x:auto}table{border-collapse:collapse}th,td{padding:.2rem .8rem;text-align:right;border-bottom:1px solid var(--grid)}
th:first-child,td:first-child{text-align:left}
svg{width:100%;height:auto;display:block;margin:.6rem 0;break-inside:avoid}
svg text{fill:var(--fg);font:11px system-ui,sans-serif}svg .title{font-size:13px;font-weight:600}
svg .grid{stroke:var(--grid);stroke-width:1}
svg path{fill:none;stroke-width:1.1;stroke-linejoin:round}svg .key{stroke-width:3}
svg .dots{stroke-width:2.6;stroke-linecap:round;opacity:.55}
svg .a{stroke:var(--a)}svg .b{stroke:var(--b)}svg .c{stroke:var(--c)}svg .d{stroke:var(--d)}
code{font-size:.9em}.lead{font-size:1.15rem}
";

/// The report of a closed loop as one self-contained page.
#[must_use]
pub fn closed_loop(log: &Log, closed: &Closed) -> String {
    let v = &closed.verdict;
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>{run}: closing the loop</title><style>{STYLE}</style></head><body>\n<h1>Closing the loop on {run}</h1>\n<p class=\"lead\">{lead}</p>\n",
        run = escape(&v.run),
        lead = escape(&lead(closed)),
    );
    table(&mut out, closed);
    effects(&mut out, closed);
    figures(&mut out, closed);
    overview(&mut out, log, closed);
    out + "</body></html>\n"
}

fn lead(closed: &Closed) -> String {
    let ids: Vec<String> = closed.verdict.effects.iter().map(|e| e.id.clone()).filter(|id| id != "unknown").collect();
    match closed.verdict.verdict {
        Kind::Attributed => format!("Attributed: the declared model lacks {}.", ids.join(" and ")),
        Kind::Ambiguous => format!(
            "Ambiguous: {} explains the residual, and so do others. A next experiment is proposed below.",
            ids.join(" and ")
        ),
        Kind::Unattributed => {
            let variables: Vec<&str> =
                closed.verdict.effects.iter().flat_map(|e| e.depends_on.iter().map(String::as_str)).collect();
            let found = match variables.as_slice() {
                [] => "Nothing that was tried predicts it on rows that it has not seen, so nothing was corrected.".to_owned(),
                on => format!("It depends on {}; an empirical correction was fitted.", on.join(", ")),
            };
            format!("Unattributed: no known effect explains the residual. {found}")
        }
        Kind::None => "Nothing significant is left over.".to_owned(),
    }
}

fn table(out: &mut String, closed: &Closed) {
    out.push_str("<h2>Error before and after</h2><p>Held-out: five time blocks and every second interior level, each predicted by a fit that did not see it.</p><div class=\"wide\"><table><tr><th>channel</th><th>unit</th><th>noise floor</th><th>held-out before</th><th>held-out after</th><th>factor</th><th>rms before</th><th>rms after</th></tr>");
    for (name, c) in &closed.verdict.channels {
        let _ = write!(
            out,
            "<tr><td>{name}</td><td>{}</td><td>{:.5}</td><td>{:.5}</td><td>{:.5}</td><td>{:.2}</td><td>{:.5}</td><td>{:.5}</td></tr>",
            escape(&c.unit),
            c.noise_floor_rms,
            c.before.heldout_rms,
            c.after.heldout_rms,
            c.before.heldout_rms / c.after.heldout_rms.max(1e-300),
            c.before.rms,
            c.after.rms
        );
    }
    out.push_str("</table></div>\n");
    for (channel, reason) in &closed.verdict.channels.not_predicted {
        let _ = writeln!(out, "<p>Not predicted: {channel}, {}.</p>", escape(reason));
    }
    unexplained(out, closed);
    for left_out in &closed.verdict.left_out {
        let _ = writeln!(out, "<p>Left out: {}.</p>", escape(&left_out.to_string()));
    }
    for aside in &closed.verdict.set_aside {
        let _ = writeln!(out, "<p>Set aside: {}.</p>", escape(&aside.to_string()));
    }
    for val in &closed.verdict.validation {
        let _ = write!(
            out,
            "<h2>On {}</h2><div class=\"wide\"><table><tr><th>channel</th><th>before</th><th>after</th></tr>",
            escape(&val.run)
        );
        for (name, b) in &val.channels {
            let _ = write!(out, "<tr><td>{name}</td><td>{:.5}</td><td>{:.5}</td></tr>", b.before, b.after);
        }
        out.push_str("</table></div>\n");
    }
}

/// What is left beside the names.
fn unexplained(out: &mut String, closed: &Closed) {
    if closed.verdict.unexplained.is_empty() {
        return;
    }
    out.push_str("<h2>What is left</h2><div class=\"wide\"><table><tr><th>channel</th><th>noise floors</th><th>looks like</th><th>goes with</th></tr>");
    for u in &closed.verdict.unexplained {
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{:.1}</td><td>{}</td><td>{}</td></tr>",
            escape(&u.channel),
            u.over_floor,
            escape(&u.looks_like),
            escape(&u.depends_on.join(", "))
        );
    }
    out.push_str("</table></div>\n");
}

fn effects(out: &mut String, closed: &Closed) {
    for e in &closed.verdict.effects {
        let _ = write!(
            out,
            "<h2>{} <small>(p = {:.2})</small></h2><p><code>{}</code></p><p>{}.</p><div class=\"wide\"><table><tr><th>parameter</th><th>value</th><th>95 % interval</th><th>unit</th></tr>",
            escape(&e.id),
            e.probability,
            escape(&e.equation),
            escape(&e.evidence)
        );
        for p in &e.parameters {
            let _ = write!(
                out,
                "<tr><td>{}</td><td>{}</td><td>{} to {}</td><td>{}</td></tr>",
                escape(&p.name),
                number(p.value),
                number(p.ci95[0]),
                number(p.ci95[1]),
                escape(&p.unit)
            );
        }
        out.push_str("</table></div>\n");
    }
    if !closed.verdict.alternatives.is_empty() {
        let list: Vec<String> =
            closed.verdict.alternatives.iter().map(|a| format!("{} ({:.3})", a.ids.join(" + "), a.probability)).collect();
        let _ = writeln!(out, "<p>Alternatives: {}.</p>", escape(&list.join(", ")));
    }
    if let Some(next) = &closed.verdict.next_experiment {
        let steps: Vec<String> = next.schedule.iter().map(|s| format!("{} us for {} s", s.pulse_us, s.hold_s)).collect();
        let _ = writeln!(out, "<h2>Next experiment</h2><p>{}</p><p>{}</p>", escape(&next.why), escape(&steps.join(", ")));
    }
}

/// Residual before and after of every channel that an effect touches, over time and over the variable that it depends on.
fn figures(out: &mut String, closed: &Closed) {
    let context = &closed.context;
    out.push_str("<h2>What was left over, and what is left now</h2>\n");
    let touched: Vec<&str> = closed.verdict.effects.iter().flat_map(|e| e.channels.iter().map(String::as_str)).collect();
    for target in context.targets.iter().filter(|t| !t.relation.is_evidence()) {
        if !touched.is_empty() && !touched.contains(&target.name) {
            continue;
        }
        let (Some(before), Some(after)) =
            (closed.declared.predict(context, target.name), closed.model.predict(context, target.name))
        else {
            continue;
        };
        let at = |v: &[f64]| -> Vec<f64> { target.rows.iter().map(|i| v[*i]).collect() };
        let left = |p: &[f64]| -> Vec<f64> { target.rows.iter().zip(&target.y).map(|(i, y)| y - p[*i]).collect() };
        let (r0, r1, t) = (left(&before), left(&after), at(&context.t));
        let unit = unit_of(target.name);
        let pair = |x: &[f64], label: String, dots: bool| {
            let series = vec![
                Series { name: "before", class: "b", x, y: &r0, dots },
                Series { name: "after", class: "a", x, y: &r1, dots },
            ];
            Chart {
                title: format!("{}: residual over {label}", target.name),
                x_label: label,
                y_label: format!("measured - predicted, {unit}"),
                series,
                height: 240.0,
            }
            .svg()
        };
        out.push_str(&pair(&t, time_label(context), false));
        let variables = closed
            .verdict
            .effects
            .iter()
            .filter(|e| e.channels.iter().any(|c| c == target.name))
            .flat_map(|e| e.depends_on.iter());
        let mut shown: Vec<&str> = vec!["t_s"];
        for name in variables {
            if shown.contains(&name.as_str()) {
                continue;
            }
            shown.push(name);
            if let Some(values) = variable(context, name) {
                out.push_str(&pair(&at(&values), axis(name), true));
            }
        }
        let measured = target.y.clone();
        let (p0, p1) = (at(&before), at(&after));
        let series = vec![
            Series { name: "measured", class: "d", x: &t, y: &measured, dots: false },
            Series { name: "declared", class: "b", x: &t, y: &p0, dots: false },
            Series { name: "corrected", class: "a", x: &t, y: &p1, dots: false },
        ];
        out.push_str(
            &Chart {
                title: format!("{} as measured and as predicted", target.name),
                x_label: time_label(context),
                y_label: axis(target.name),
                series,
                height: 240.0,
            }
            .svg(),
        );
    }
}

fn overview(out: &mut String, log: &Log, closed: &Closed) {
    let context = &closed.context;
    out.push_str("<h2>The run</h2>\n");
    let mut draw = |title: &str, names: &[&str]| {
        let classes = ["a", "b", "c", "d"];
        let series: Vec<Series<'_>> = names
            .iter()
            .filter_map(|n| log.column(n).map(|y| (n, y)))
            .zip(classes)
            .map(|((n, y), class)| Series {
                name: n,
                class,
                x: &log.t,
                y,
                dots: y.iter().filter(|v| v.is_nan()).count() * 2 > y.len(),
            })
            .collect();
        if let Some(first) = series.first() {
            let y_label = axis(first.name);
            out.push_str(&Chart { title: title.to_owned(), x_label: time_label(context), y_label, series, height: 200.0 }.svg());
        }
    };
    draw("Command", &["pulse_us"]);
    draw("Speed", &["rpm_beam", "rpm_opto", "rpm_hall", "rpm_encoder"]);
    draw("Speed", &["rpm"]);
    draw("Thrust", &["thrust_n"]);
    draw("Torque", &["torque_nm"]);
    draw("Current", &["current_a"]);
    draw("Supply", &["voltage_v"]);
    draw("Temperature", &["temp_c"]);
}

fn time_label(context: &crate::context::Context) -> String {
    if context.time_is_row { "row".to_owned() } else { "time, s".to_owned() }
}

fn axis(name: &str) -> String {
    let unit = unit_of(name);
    if unit.is_empty() { name.to_owned() } else { format!("{name}, {unit}") }
}
