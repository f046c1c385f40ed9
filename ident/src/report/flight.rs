//! The page of a flight's closed loop.
//!
//! What it is: what windows that no fit saw leave over of each channel, handed to the page that every closed loop has; the rotors' speeds
//! together; and what this flight can show.
//! What can go wrong: nothing; channels that the flight lacks have no figure.
//! Units: on the axes.
//! Reference: specification `closing-the-loop.md`, step 8.

use crate::flight::Closed;
use crate::flight::channels::Target;
use crate::flight::effects;
use crate::flight::nameless::Variable;
use crate::flight::scene::Scene;
use crate::flight::windows::LENGTH_S;
use crate::report::closed::{self as parts, Page, Trace};
use crate::report::{Figure, Layer, Origin, Vocabulary};
use crate::verdict::EffectEntry;
use crate::verdict::words::{channel, parameter};
use nalgebra::Vector3;

/// The words of the flight's library.
pub const VOCABULARY: Vocabulary = Vocabulary {
    noun: "vehicle",
    declared: "a rigid body, thrust with the square of each rotor's speed, no drag",
    held_out: "five time blocks",
    figures: "Figures, bars and cards all show rows that no fit saw.",
    about: effects::about,
    clause: |found| effects::said(found).unwrap_or_else(|| parts::bare(found)),
    // a curve is seen in its figure
    parameter: |id, name| if id == "unknown" { String::new() } else { parameter(name) },
    by_floors: false,
};

/// Rotors of one figure: as many lines as the eye tells apart.
const TOGETHER: usize = 4;

/// The report as one self-contained page.
#[must_use]
pub fn page(closed: &Closed, origin: Origin) -> String {
    let v = &closed.verdict;
    let rows = closed.flight.windows.rows();
    let ms = 1000.0
        * LENGTH_S.max(
            closed.flight.windows.bounds.first().map_or(0.0, |(a, b)| closed.flight.record.t[b - 1] - closed.flight.record.t[*a]),
        );
    let traces: Vec<Trace> = (0..closed.predicted.len()).map(|k| trace(closed, k)).collect();
    let (of_rotors, alone): (Vec<Trace>, Vec<Trace>) = traces.iter().cloned().partition(|t| is_rotor(closed, &t.channel));
    let page = Page {
        verdict: v,
        words: VOCABULARY,
        news: origin.model.is_some(),
        origin,
        declared: format!(
            "Declared: thrust with the square of each rotor's speed along -z, reaction torque, a rigid body, speeds that follow their pulses, a constant voltage; no drag. Specific force, rate and field are means over windows of {rows} rows (about {ms:.0} ms), angular acceleration is the slope of the gyro in them; speeds and voltage are told as logged, but for rows in which a rotor coasts with its motor cut."
        ),
        hero: parts::most(v, VOCABULARY, &traces),
        cards: cards(closed, &traces),
        left: parts::rest(v, &alone),
        readings: Vec::new(),
        parameters: Vec::new(),
        speeds: ("The rotors' speeds", speeds(closed, &of_rotors)),
    };
    let mut sheet = parts::begin(&page);
    let every = alone.iter().map(|t| parts::over_time(t, "every", parts::pair(v))).collect();
    sheet.fold("Every channel in figures", |sheet| sheet.figures(every));
    sheet.fold("What this flight can show", |sheet| {
        sheet.say("For each cause: the share of its signal that nothing in the declared model can stand for, and the signal over noise that it would have at its usual size. Where these are not enough a cause of that size stays unnamed; a larger one shows.");
        let shown: Vec<Vec<String>> = closed
            .asked
            .iter()
            .map(|a| {
                let enough = if a.enough { "yes" } else { "no" };
                vec![a.name.clone(), format!("{:.3}", a.angle), format!("{:.1}", a.signal), enough.to_owned()]
            })
            .collect();
        sheet.data("causes", &["cause", "share of its own", "signal over noise", "named at that size"], &shown, None);
    });
    parts::aside(&mut sheet, v);
    sheet.html()
}

/// Whether a channel is the speed of one of several rotors.
fn is_rotor(closed: &Closed, name: &str) -> bool {
    let speeds = closed.flight.channels.targets.iter().filter(|t| matches!(t, Target::Speed(_)));
    speeds.clone().count() > 1 && speeds.map(|t| t.name()).any(|rotor| rotor == name)
}

/// The rotors' speeds together: as measured, and what is left of them before and after.
fn speeds(closed: &Closed, of_rotors: &[Trace]) -> Vec<Figure> {
    let channels = &closed.flight.channels.channels;
    let measured = |t: &Trace| channels.iter().find(|c| c.name == t.channel).map(|c| c.y.clone()).unwrap_or_default();
    let [before, after] = parts::pair(&closed.verdict);
    let mut out = Vec::new();
    for (k, some) in of_rotors.chunks(TOGETHER).enumerate() {
        let figure = |id: &str, title: String, y: &dyn Fn(&Trace) -> Vec<f64>| {
            let line = |(t, class): (&Trace, &'static str)| {
                let (x, y) = parts::lifted(&t.t, &y(t));
                Layer::Line { name: channel(&t.channel), class, x, y }
            };
            parts::thinned(Figure {
                id: if k == 0 { format!("rotors-{id}") } else { format!("rotors-{id}-{}", k + 1) },
                title,
                x_label: "time, s".to_owned(),
                y_label: "rev/min".to_owned(),
                layers: some.iter().zip(["a", "b", "c", "e"]).map(line).collect(),
                ..Figure::default()
            })
        };
        out.push(figure("measured", "Speed of every rotor".to_owned(), &measured));
        out.push(figure("before", format!("Speed left over, every rotor ({before})"), &|t| t.before.clone()));
        if !after.is_empty() {
            out.push(figure("after", format!("Speed left over, every rotor ({after})"), &|t| t.after.clone()));
        }
    }
    out
}

/// Of each effect what its first channel leaves over without it and with it, the channel of which its text tells the error: against the variable
/// that it depends on; over time where the log lacks that.
fn cards(closed: &Closed, traces: &[Trace]) -> Vec<Vec<Figure>> {
    let scene = Scene::declared(&closed.flight.record);
    let card = |(k, e): (usize, &EffectEntry)| {
        let at = traces.iter().position(|t| e.channels.first() == Some(&t.channel))?;
        let id = format!("effect-{}", k + 1);
        // what nothing predicts was not added
        let Some(without) = closed.held_out.without.get(k).and_then(|of| of.get(at)) else {
            return Some(parts::over_time(&traces[at], &id, parts::pair(&closed.verdict)));
        };
        let trace = traces[at].with_before(without.clone());
        let over = e.depends_on.iter().find_map(|name| {
            against(closed, &scene, name, &goes_on(e, name, &trace.channel)).filter(|(_, _, x)| parts::moves(x))
        });
        let over = turning_force(closed, &scene, e, &trace.channel).or(over);
        Some(match over {
            Some((label, unit, x)) => parts::against(&trace, &id, (&label, unit), &x, parts::ALONE),
            None => parts::over_time(&trace, &id, parts::ALONE),
        })
    };
    closed.verdict.effects.iter().enumerate().map(|e| card(e).into_iter().collect()).collect()
}

/// The channel by whose axis a variable of an effect is meant: air along one axis turns the body about the other.
fn goes_on(e: &EffectEntry, variable: &str, channel: &str) -> String {
    let crossed = e.id == "hub_moment" && variable == "vel";
    match channel.rsplit_once('_').filter(|_| crossed) {
        Some((of, "x")) => format!("{of}_y"),
        Some((of, "y")) => format!("{of}_x"),
        _ => channel.to_owned(),
    }
}

/// Of an accelerometer off the centre of gravity: the force that turning makes at the place that was found, along the axis of a channel.
fn turning_force(closed: &Closed, scene: &Scene<'_>, e: &EffectEntry, channel: &str) -> Option<(String, &'static str, Vec<f64>)> {
    if e.id != "lever_arm" {
        return None;
    }
    let size = |name: &str| e.parameter(name).map(|p| p.value);
    let arm = Vector3::new(size("arm_x")?, size("arm_y")?, size("arm_z")?);
    let axis = ["_x", "_y", "_z"].iter().position(|end| channel.ends_with(end))?;
    let windows = &closed.flight.windows;
    let rate = closed.flight.record.rate.as_ref()?;
    let [x, y, z] = [0, 1, 2].map(|k| windows.slope(&rate[k]));
    let swing: Vec<f64> = (0..scene.len()).map(|row| scene.rate_at(row)).map(|w| w.cross(&w.cross(&arm))[axis]).collect();
    let turned = (0..windows.len()).map(|i| Vector3::new(x[i], y[i], z[i]).cross(&arm)[axis]);
    let force = windows.mean(&swing).iter().zip(turned).map(|(swing, turned)| swing + turned).collect();
    Some(("force of turning at the place found".to_owned(), "m/s^2", force))
}

/// What an effect of a channel goes with, its unit, and its mean in each window; `None` where the flight lacks it.
fn against(closed: &Closed, scene: &Scene<'_>, name: &str, of: &str) -> Option<(String, &'static str, Vec<f64>)> {
    let record = &closed.flight.record;
    let mean = |values: &Option<Vec<f64>>| values.as_ref().map(|v| closed.flight.windows.mean(v));
    match name {
        "current_a" => Some((channel(name), "A", mean(&record.current)?)),
        "temp_c" => Some((channel(name), "degC", mean(&record.temperature)?)),
        _ => {
            let variable = Variable::meant(name, of)?;
            let by_command = record.speed.is_empty();
            Some((variable.label(by_command), variable.unit(by_command), variable.values(&closed.flight, scene)?))
        }
    }
}

/// What is left of windows that no fit saw.
fn trace(closed: &Closed, k: usize) -> Trace {
    let c = &closed.flight.channels.channels[k];
    Trace {
        channel: c.name.clone(),
        unit: c.unit.to_string(),
        floor: closed.verdict.channels.get(&c.name).map_or(0.0, |c| c.noise_floor_rms),
        time_label: "time, s".to_owned(),
        t: closed.flight.windows.t.clone(),
        before: closed.held_out.before[k].clone(),
        after: closed.held_out.after[k].clone(),
    }
}

/// Residual of each channel before and after.
#[must_use]
pub fn figures(closed: &Closed) -> Vec<Figure> {
    (0..closed.predicted.len()).map(|k| residual(closed, k)).collect()
}

fn residual(closed: &Closed, channel: usize) -> Figure {
    let (c, t) = (&closed.flight.channels.channels[channel], &closed.flight.windows.t);
    let [before, after] = &closed.predicted[channel];
    // gaps lift the pen
    let gap = 5.0 * crate::numeric::order::usual_step(t);
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
        captioned: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Air along one axis pitches the body about the other; a rate turns it back about its own.
    #[test]
    fn a_hub_moment_is_drawn_against_the_air_that_makes_it() {
        let hub = crate::report::bare_entry("hub_moment");
        assert_eq!(goes_on(&hub, "vel", "ang_acc_x"), "ang_acc_y");
        assert_eq!(goes_on(&hub, "vel", "ang_acc_y"), "ang_acc_x");
        assert_eq!(goes_on(&hub, "gyro", "ang_acc_x"), "ang_acc_x");
        let drag = EffectEntry { id: "rotor_drag".to_owned(), ..hub };
        assert_eq!(goes_on(&drag, "vel", "acc_x"), "acc_x");
    }
}
