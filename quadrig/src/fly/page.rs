//! The page of a flight.
//!
//! What it is: the summary, pulses and margins, the path in three views, and the thesis' figures of displacement, velocity, angle and rate
//! over time, in one self-contained page.
//! What can go wrong: nothing; a wind that does not blow leaves its figure out.
//! Units: on the axes.
//! Reference: Beharie 2013, Figures 7.5 to 7.27; specification `flight.md`, "Missions".

use super::record::body_velocity;
use super::summary::Summary;
use hal_sim::flight::attitude::to_euler;
use hal_sim::flight::{Flying, Rotation};
use hal_sim::mission::{Flight, apart};
use ident::report::{Figure, Layer, Sheet};

/// Colours in the order of the rotors and axes.
const CLASSES: [&str; 6] = ["a", "b", "c", "e", "f", "d"];

/// The page of a flight with its summary; `from` is where it comes from, the mission and the model with their digests.
pub(super) fn page(summary: &Summary, flight: &Flight, from: &[(&str, String)]) -> String {
    let rows = &flight.rows[..];
    let mut sheet = Sheet::told(&format!("Flight: {}", summary.mission), &summary.told());
    sheet.soft(&summary.lead());
    sheet.data("summary", &["of", "what"], &summary.table(), None);
    // the row of the touch itself is a jolt beside which nothing else would show
    let rows = if summary.ends_in_touch { &rows[..rows.len() - 1] } else { rows };
    sheet.section("Pulses and margins");
    sheet.figures(vec![pulses(rows), thrusts(summary, rows), speeds(rows), currents(rows)]);
    sheet.section("Path");
    sheet.say("Three views; each axis has its own scale.");
    let [north, east, up] = [|f: &Flying| f.motion.place.x, |f: &Flying| f.motion.place.y, |f: &Flying| -f.motion.place.z];
    sheet.figures(vec![
        view(rows, "from above", ("east, m", &east), ("north, m", &north)),
        view(rows, "from the east side", ("north, m", &north), ("up, m", &up)),
        view(rows, "from the south side", ("east, m", &east), ("up, m", &up)),
    ]);
    sheet.section("Motion");
    let t = times(rows);
    let course = |id: &str, title: &str, unit: &str, lines: [Axis<'_>; 3]| Figure {
        id: id.to_owned(),
        title: title.to_owned(),
        x_label: "time, s".to_owned(),
        y_label: unit.to_owned(),
        layers: lines.iter().enumerate().map(|(i, (name, of))| line(name, i, &t, rows, of)).collect(),
        ..Figure::default()
    };
    sheet.figures(vec![
        course(
            "place",
            "Displacement (figures 7.6, 7.12, 7.17 and 7.23 of the thesis)",
            "m",
            [("north", &north), ("east", &east), ("up", &up)],
        ),
        course(
            "velocity",
            "Velocity in body axes (figures 7.7, 7.13, 7.18 and 7.24 of the thesis)",
            "m/s",
            [
                ("u, forward", &|f| body_velocity(f).x),
                ("v, right", &|f| body_velocity(f).y),
                ("w, down", &|f| body_velocity(f).z),
            ],
        ),
        course(
            "angles",
            "Angles (figures 7.8, 7.14, 7.19 and 7.25 of the thesis)",
            "deg",
            [("roll", &|f| angle(f, 0)), ("pitch", &|f| angle(f, 1)), ("yaw", &|f| angle(f, 2))],
        ),
        course(
            "rates",
            "Angular rates (figures 7.9, 7.15, 7.20 and 7.26 of the thesis)",
            "deg/s",
            [
                ("p, roll", &|f| f.motion.rate.x.to_degrees()),
                ("q, pitch", &|f| f.motion.rate.y.to_degrees()),
                ("r, yaw", &|f| f.motion.rate.z.to_degrees()),
            ],
        ),
        course(
            "force",
            "Specific force at the centre of gravity",
            "m/s^2",
            [("x", &|f| f.specific_force.x), ("y", &|f| f.specific_force.y), ("z", &|f| f.specific_force.z)],
        ),
    ]);
    if rows.iter().any(|f| f.wind.norm() > 0.0) {
        let wind = course("wind", "Wind", "m/s", [("north", &|f| f.wind.x), ("east", &|f| f.wind.y), ("down", &|f| f.wind.z)]);
        sheet.figures(vec![wind]);
    }
    let board = board(flight);
    if !board.is_empty() {
        sheet.section("The IMU board against the truth");
        sheet.say(
            "Angle between the board's vertical and the true one, and between its heading and the true one, from the start on.",
        );
        sheet.figures(board);
    }
    sheet.comes_from(from);
    sheet.html()
}

/// What the IMU board says beside the truth, and what it is off by.
fn board(flight: &Flight) -> Vec<Figure> {
    let flying: Vec<(f64, Rotation, &Rotation)> =
        flight.seen.iter().filter(|(s, _)| s.t_s >= 0.0).filter_map(|(s, truth)| Some((s.t_s, s.attitude?, truth))).collect();
    if flying.is_empty() {
        return Vec::new();
    }
    let t: Vec<f64> = flying.iter().map(|f| f.0).collect();
    let line = |name: &str, class: &'static str, of: &dyn Fn(&(f64, Rotation, &Rotation)) -> f64| Layer::Line {
        name: name.to_owned(),
        class,
        x: t.clone(),
        y: flying.iter().map(|f| of(f).to_degrees()).collect(),
    };
    let figure = |id: &str, title: &str, layers: Vec<Layer>| Figure {
        id: id.to_owned(),
        title: title.to_owned(),
        x_label: "time, s".to_owned(),
        y_label: "deg".to_owned(),
        layers,
        ..Figure::default()
    };
    let mut figures = vec![figure(
        "board-error",
        "The board is off by",
        vec![line("tilt", "a", &|f| apart(&f.1, f.2).0), line("heading", "b", &|f| apart(&f.1, f.2).1)],
    )];
    for (axis, name) in ["Roll", "Pitch", "Yaw"].into_iter().enumerate() {
        let truth = line("truth", "d", &|f| to_euler(f.2)[axis]);
        let said = line("board", "a", &|f| to_euler(&f.1)[axis]);
        figures.push(figure(
            &format!("board-{}", name.to_lowercase()),
            &format!("{name} by the board and in truth"),
            vec![truth, said],
        ));
    }
    figures
}

fn times(rows: &[Flying]) -> Vec<f64> {
    rows.iter().map(|f| f.t_s).collect()
}

/// An angle of the attitude, deg.
fn angle(f: &Flying, axis: usize) -> f64 {
    to_euler(&f.motion.attitude)[axis].to_degrees()
}

/// A value below what a drawing can tell is nothing: rounding errors of a symmetric flight are no motion.
fn shown(value: f64) -> f64 {
    if value.abs() < 1e-9 { 0.0 } else { value }
}

fn line(name: &str, i: usize, t: &[f64], rows: &[Flying], of: &dyn Fn(&Flying) -> f64) -> Layer {
    let y = rows.iter().map(|f| shown(of(f))).collect();
    Layer::Line { name: name.to_owned(), class: CLASSES[i % CLASSES.len()], x: t.to_vec(), y }
}

/// One line for each rotor; rotors that do the same all the time share one.
fn rotors(id: &str, title: &str, unit: &str, rows: &[Flying], of: &dyn Fn(&Flying, usize) -> f64) -> Figure {
    let t = times(rows);
    let mut groups: Vec<(Vec<usize>, Vec<f64>)> = Vec::new();
    for rotor in 0..rows.first().map_or(0, |f| f.rotors.len()) {
        let y: Vec<f64> = rows.iter().map(|f| of(f, rotor)).collect();
        match groups.iter_mut().find(|(_, known)| *known == y) {
            Some((members, _)) => members.push(rotor + 1),
            None => groups.push((vec![rotor + 1], y)),
        }
    }
    let named = |members: &[usize]| {
        let list: Vec<String> = members.iter().map(ToString::to_string).collect();
        format!("rotor{} {}", if list.len() > 1 { "s" } else { "" }, list.join(", "))
    };
    let layers = groups
        .into_iter()
        .enumerate()
        .map(|(i, (members, y))| Layer::Line { name: named(&members), class: CLASSES[i % CLASSES.len()], x: t.clone(), y })
        .collect();
    let [id, title, y_label] = [id, title, unit].map(str::to_owned);
    Figure { id, title, x_label: "time, s".to_owned(), y_label, layers, ..Figure::default() }
}

fn pulses(rows: &[Flying]) -> Figure {
    rotors("pulses", "Pulses (figures 7.5, 7.11, 7.16 and 7.22 of the thesis)", "duty of 20 ms, %", rows, &|f, i| {
        f.pulses_us[i] / 200.0
    })
}

/// Thrust of each rotor, with its share of the weight and, where it comes near, what full throttle gives.
fn thrusts(summary: &Summary, rows: &[Flying]) -> Figure {
    let mut figure = rotors("thrust", "Thrust of each rotor", "N", rows, &|f, i| f.rotors[i].thrust_n);
    if let Some((at, _)) = &summary.hover {
        figure.layers.push(Layer::Level { y: at.rotor.thrust_n, text: "hover".to_owned() });
        let most = rows.iter().flat_map(|f| &f.rotors).map(|r| r.thrust_n).fold(0.0, f64::max);
        if most > 0.6 * at.full.thrust_n {
            figure.layers.push(Layer::Level { y: at.full.thrust_n, text: "full throttle".to_owned() });
        }
    }
    figure
}

fn speeds(rows: &[Flying]) -> Figure {
    rotors("speeds", "Rotor speed", "rev/min", rows, &|f, i| f.rotors[i].rpm)
}

fn currents(rows: &[Flying]) -> Figure {
    let y: Vec<f64> = rows.iter().map(|f| f.rotors.iter().map(|r| r.current_a).sum()).collect();
    Figure {
        id: "current".to_owned(),
        title: "Current of all rotors".to_owned(),
        x_label: "time, s".to_owned(),
        y_label: "A".to_owned(),
        layers: vec![Layer::Line { name: String::new(), class: "a", x: times(rows), y }],
        ..Figure::default()
    }
}

/// A quantity: its name and where it is read.
type Axis<'a> = (&'a str, &'a dyn Fn(&Flying) -> f64);

/// The path from one side, with its ends marked.
fn view(rows: &[Flying], from: &str, x: Axis<'_>, y: Axis<'_>) -> Figure {
    let along = |of: &dyn Fn(&Flying) -> f64| rows.iter().map(|f| shown(of(f))).collect::<Vec<f64>>();
    let (xs, ys) = (along(x.1), along(y.1));
    let end = |name: &str, class: &'static str, i: usize| Layer::Marks {
        name: name.to_owned(),
        class,
        marks: vec![ident::report::Mark {
            x: xs[i],
            y: ys[i],
            error: 0.0,
            text: format!("{name}, {:.1} s: {:.1}, {:.1}", rows[i].t_s, xs[i], ys[i]),
        }],
    };
    let (first, last) = (end("start", "c", 0), end("end", "b", rows.len() - 1));
    Figure {
        id: format!("path-{}", from.replace(' ', "-")),
        title: format!("Path {from} (figures 7.10, 7.21 and 7.27 of the thesis)"),
        x_label: x.0.to_owned(),
        y_label: y.0.to_owned(),
        layers: vec![Layer::Line { name: String::new(), class: "a", x: xs.clone(), y: ys.clone() }, first, last],
        ..Figure::default()
    }
}
