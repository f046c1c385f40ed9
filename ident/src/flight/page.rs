//! The page of a flight's closed loop.
//!
//! What it is: verdict, table before and after, parameters with intervals, what is left, what this flight can show, and the residual of every
//! channel before and after.
//! What can go wrong: nothing; channels that the flight lacks have no figure.
//! Units: on the axes.
//! Reference: specification `closing-the-loop.md`, step 8.

use super::close::Closed;
use super::windows::LENGTH_S;
use crate::report::{Figure, Layer, Sheet, number};
use crate::verdict::Kind;

/// The report as one self-contained page.
#[must_use]
pub fn page(closed: &Closed) -> String {
    let v = &closed.verdict;
    let mut sheet = Sheet::new(&format!("Closing the loop on {}", v.run));
    let ids: Vec<&str> = v.effects.iter().map(|e| e.id.as_str()).filter(|id| *id != "unknown").collect();
    sheet.say(&match v.verdict {
        Kind::Attributed => format!("Attributed: the declared model lacks {}.", ids.join(", ")),
        Kind::Ambiguous => format!("Ambiguous: {} explains the first of it, and so does something else.", ids.join(", ")),
        Kind::Unattributed => "Unattributed: no known effect explains what is left over.".to_owned(),
        Kind::None => "Nothing significant is left over.".to_owned(),
    });
    let rows = closed.flight.windows.rows();
    sheet.say(&format!(
        "Declared: thrust with the square of each rotor's speed along -z, reaction torque, a rigid body, speeds that follow their pulses, a constant voltage; no drag. Specific force, rate and field are means over windows of {rows} rows (about {:.0} ms), angular acceleration is the slope of the gyro in them; speeds and voltage are told as logged. Held-out: stretches of the flight predicted by a fit that did not see them.",
        1000.0 * LENGTH_S.max(closed.flight.windows.bounds.first().map_or(0.0, |(a, b)| closed.flight.record.t[b - 1] - closed.flight.record.t[*a]))
    ));
    errors(&mut sheet, closed);
    for e in &v.effects {
        sheet.section(&format!("{} (p = {:.2})", e.id, e.probability));
        sheet.say(&e.equation);
        sheet.say(&format!("{}.", e.evidence));
        let cells = |p: &crate::verdict::Parameter| {
            vec![p.name.clone(), number(p.value), format!("{} to {}", number(p.ci95[0]), number(p.ci95[1])), p.unit.clone()]
        };
        let rows: Vec<Vec<String>> = e.parameters.iter().map(cells).collect();
        if !rows.is_empty() {
            sheet.table(&["parameter", "value", "95 % interval", "unit"], &rows, |_| false);
        }
    }
    left(&mut sheet, closed);
    if let Some(next) = &v.next_experiment {
        sheet.section("Next flight");
        sheet.say(&next.why);
    }
    sheet.section("What was left over, and what is left now");
    sheet.figures(figures(closed));
    sheet.section("What this flight can show");
    sheet.say("For each cause: the share of its signal that nothing in the declared model can stand for, and the signal over noise that it would have at its usual size. Where these are not enough it is not named, whatever the residual.");
    let shown: Vec<Vec<String>> = closed
        .asked
        .iter()
        .map(|a| {
            vec![
                a.name.clone(),
                format!("{:.3}", a.angle),
                format!("{:.1}", a.signal),
                if a.enough { "yes" } else { "no" }.to_owned(),
            ]
        })
        .collect();
    sheet.table(&["cause", "share of its own", "signal over noise", "can be named"], &shown, |_| false);
    sheet.html()
}

/// Residual of each channel before and after.
#[must_use]
pub fn figures(closed: &Closed) -> Vec<Figure> {
    (0..closed.predicted.len()).map(|k| residual(closed, k)).collect()
}

fn errors(sheet: &mut Sheet, closed: &Closed) {
    sheet.errors(&closed.verdict.channels);
    for (channel, reason) in &closed.verdict.channels.not_predicted {
        sheet.say(&format!("Not predicted: {channel}, {reason}."));
    }
    for v in &closed.verdict.validation {
        sheet.section(&format!("On {}, which took no part", v.run));
        let cells = |(name, b): (&String, &crate::verdict::BeforeAfter)| {
            vec![name.clone(), number(b.before), number(b.after), format!("{:.2}", b.before / b.after.max(1e-300))]
        };
        let rows: Vec<Vec<String>> = v.channels.iter().map(cells).collect();
        sheet.table(&["channel", "before", "after", "factor"], &rows, |_| false);
    }
}

fn left(sheet: &mut Sheet, closed: &Closed) {
    let v = &closed.verdict;
    if !v.unexplained.is_empty() {
        sheet.section("What has no name");
        let cells = |u: &crate::verdict::Unexplained| {
            vec![u.channel.clone(), format!("{:.1}", u.over_floor), u.looks_like.clone(), u.depends_on.join(", ")]
        };
        let rows: Vec<Vec<String>> = v.unexplained.iter().map(cells).collect();
        sheet.table(&["channel", "noise floors", "looks like", "goes with"], &rows, |_| false);
    }
    for aside in &v.set_aside {
        sheet.say(&aside.to_string());
    }
}

fn residual(closed: &Closed, channel: usize) -> Figure {
    let (c, t) = (&closed.flight.channels.channels[channel], &closed.flight.windows.t);
    let [before, after] = &closed.predicted[channel];
    // gaps lift the pen
    let gap = 5.0 * crate::attribution::noise::usual_step(t);
    let line = |name: &str, class, predicted: &[f64]| {
        let (mut x, mut y) = (Vec::new(), Vec::new());
        for i in 0..t.len() {
            if i > 0 && t[i] - t[i - 1] > gap {
                x.push(t[i - 1] + 0.5 * gap);
                y.push(f64::NAN);
            }
            x.push(t[i]);
            y.push(c.y[i] - predicted[i]);
        }
        Layer::Line { name: name.to_owned(), class, x, y }
    };
    Figure {
        id: format!("residual-{}", c.name),
        title: format!("{}: measured - predicted", c.name),
        x_label: "time, s".to_owned(),
        y_label: format!("residual, {}", c.unit),
        layers: vec![line("before", "b", before), line("after", "a", after)],
        height: 260.0,
        categories: Vec::new(),
    }
}
