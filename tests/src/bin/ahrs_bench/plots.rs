//! `cargo xtask ahrs-bench --plots DIR`: how the error runs in each trial.
//!
//! What it is: for each trial a figure of total, heading and inclination error of our default and of the thesis' filter with tuned
//! gains, with the filter's own flags: the field is taken for disturbed (shaded), the body for resting (bar); what the filter has
//! learnt; and one figure for each set that sums its trials up. Of a walk past magnets the course is drawn beside the one that it would
//! take if no field counted as too strong. `index.html` holds them all; `summary.svg` and each trial's figures lie beside it.
//! What can go wrong: the folder cannot be written; errors are drawn only where the benchmark scores.
//! Units: s, degrees.
//! Reference: README of the data, "Protocol".

use super::phones::Phone;
use super::score::{errors, steps};
use super::trial::{Sample, Trial};
use crate::run::Failure;
use dcm::{Classic, ClassicConfig, Config, Dcm, Earth, Mat3, quaternion_of};
use ident::report::{Figure, Layer, Sheet, write_figures};
use std::collections::BTreeMap;
use std::path::Path;

const WHAT: [&str; 3] = ["total", "heading", "inclination"];

/// A filter's errors over a trial; not a number where nothing is scored.
#[derive(Default)]
struct Course {
    ours: [Vec<f64>; 3],
    classic: [Vec<f64>; 3],
    rest: Vec<bool>,
    disturbed: Vec<bool>,
    /// Length of the hard iron that was found, uT, and of the gyro's bias, deg/s.
    learnt: [Vec<f64>; 2],
}

/// Writes the folder.
pub(super) fn plots(folder: &Path, trials: &[Trial], walks: &[Phone]) -> Result<(), Failure> {
    let mut sheet = Sheet::new("Attitude error in each trial of both sets");
    sheet.say("Ours: the one default. Classic: the thesis' algorithm with tuned gains. Errors are drawn where the benchmark scores. Shaded: our filter takes the field for disturbed and holds its heading. Green bar at zero: it takes the body for resting.");
    let every: Vec<&Trial> = trials.iter().chain(walks.iter().map(|p| &p.trial)).collect();
    let courses: Vec<Course> = all(&every, Config::DEFAULT);
    let (broad, phones) = courses.split_at(trials.len());
    let names: Vec<&str> = trials.iter().map(|t| t.name.get(..2).unwrap_or(&t.name)).collect();
    let short: Vec<String> = walks.iter().map(|p| p.trial.name.replace("Thibaud_", "").replace('_', " ")).collect();
    sheet.figures(vec![
        summary("summary", "BROAD trial", &names, broad),
        summary("summary-phones", "trial of the phones", &short.iter().map(String::as_str).collect::<Vec<_>>(), phones),
    ]);
    let past: Vec<&Trial> = walks.iter().filter(|p| p.magnets).map(|p| &p.trial).collect();
    let mut without = Config::DEFAULT;
    without.field.strongest = f32::MAX;
    let mut other = past.iter().map(|t| t.name.as_str()).zip(all(&past, without)).collect::<BTreeMap<_, _>>();
    for (trial, course) in every.iter().zip(&courses) {
        sheet.section(&trial.name);
        let numbers = |errors: &[Vec<f64>; 3]| errors.each_ref().map(|e| format!("{:.2}", rms(e))).to_vec();
        let row = |name: &str, errors: &[Vec<f64>; 3]| [vec![name.to_owned()], numbers(errors)].concat();
        let rows = [row("ours", &course.ours), row("classic", &course.classic)];
        sheet.table(&["root mean square, degrees", "total", "heading", "inclination"], &rows, |_| false);
        let mut figures: Vec<Figure> = (0..3).map(|k| figure(trial, course, k)).collect();
        figures.push(learnt(trial, course));
        figures.extend(other.remove(trial.name.as_str()).map(|o| magnets(trial, course, &o)));
        sheet.figures(figures);
    }
    let fail = |e: std::io::Error| Failure(format!("{}: {e}", folder.display()));
    write_figures(folder, sheet.drawn()).map_err(|(path, e)| Failure(format!("{}: {e}", path.display())))?;
    let page = folder.join("index.html");
    ident::log::write_whole(&page, |out| out.write_all(sheet.html().as_bytes())).map_err(fail)?;
    println!("{} trials drawn, {}", every.len(), page.display());
    Ok(())
}

fn all(trials: &[&Trial], config: Config) -> Vec<Course> {
    std::thread::scope(|scope| {
        let handles: Vec<_> = trials.iter().map(|t| scope.spawn(move || course(&t.samples, config))).collect();
        handles.into_iter().map(super::joined).collect()
    })
}

fn course(samples: &[Sample], config: Config) -> Course {
    let (mut ours, mut classic) = (Dcm::new(config), Classic::new(ClassicConfig::TUNED));
    let mut out = Course::default();
    for (s, dt, measured) in steps(samples) {
        ours.update(dt, &measured);
        classic.update(dt, &measured);
        out.rest.push(ours.flags().rest);
        out.disturbed.push(ours.flags().field_disturbed);
        let long = |v: dcm::Vec3| f64::from(v.dot(&v)).sqrt();
        out.learnt[0].push(long(ours.iron()));
        out.learnt[1].push(long(ours.bias()).to_degrees());
        let off = |matrix: &Mat3| -> [f64; 3] {
            let Some(truth) = s.truth else { return [f64::NAN; 3] };
            let (heading, inclination, total) = errors(quaternion_of(&Earth::Enu.from_ned(matrix)).map(f64::from), truth.q);
            [total, heading, inclination]
        };
        for (k, e) in off(ours.matrix()).into_iter().enumerate() {
            out.ours[k].push(e);
        }
        for (k, e) in off(classic.matrix()).into_iter().enumerate() {
            out.classic[k].push(e);
        }
    }
    out
}

fn rms(errors: &[f64]) -> f64 {
    let scored = errors.iter().filter(|e| e.is_finite());
    let (sum, n) = scored.fold((0.0, 0.0), |(s, n), e| (s + e * e, n + 1.0));
    (sum / f64::max(n, 1.0)).sqrt()
}

/// Stretches over which a flag holds.
fn spans(t: &[f64], flag: &[bool]) -> Vec<(f64, f64)> {
    let mut out: Vec<(f64, f64)> = Vec::new();
    let mut open = None;
    for (t, on) in t.iter().zip(flag) {
        match (open, on) {
            (None, true) => open = Some(*t),
            (Some(from), false) => {
                out.push((from, *t));
                open = None;
            }
            _ => {}
        }
    }
    out.extend(open.zip(t.last()).map(|(from, to)| (from, *to)));
    out
}

fn figure(trial: &Trial, course: &Course, k: usize) -> Figure {
    let t: Vec<f64> = trial.samples.iter().map(|s| s.t).collect();
    let line = |name: &str, class, y: &[f64]| Layer::Line { name: name.to_owned(), class, x: t.clone(), y: y.to_vec() };
    let bar: Vec<f64> = course.rest.iter().map(|r| if *r { 0.0 } else { f64::NAN }).collect();
    Figure {
        id: format!("{}-{}", trial.name, WHAT[k]),
        title: format!("{}: {} error", trial.name.replace('_', " "), WHAT[k]),
        x_label: "time, s".to_owned(),
        y_label: format!("{} error, degrees", WHAT[k]),
        layers: vec![
            Layer::Spans { name: "field disturbed".to_owned(), ranges: spans(&t, &course.disturbed) },
            line("classic", "b", &course.classic[k]),
            line("ours", "a", &course.ours[k]),
            line("rest", "c", &bar),
        ],
        height: 0.0,
        categories: Vec::new(),
        captioned: false,
    }
}

fn of_time(trial: &Trial, what: &str, title: &str, y_label: &str, layers: Vec<(&str, &'static str, &[f64])>) -> Figure {
    let t: Vec<f64> = trial.samples.iter().map(|s| s.t).collect();
    let line = |(name, class, y): (&str, _, &[f64])| Layer::Line { name: name.to_owned(), class, x: t.clone(), y: y.to_vec() };
    Figure {
        id: format!("{}-{what}", trial.name),
        title: format!("{}: {title}", trial.name.replace('_', " ")),
        x_label: "time, s".to_owned(),
        y_label: y_label.to_owned(),
        layers: layers.into_iter().map(line).collect(),
        height: 0.0,
        categories: Vec::new(),
        captioned: false,
    }
}

fn learnt(trial: &Trial, course: &Course) -> Figure {
    let lines = vec![("hard iron, uT", "a", &*course.learnt[0]), ("gyro's bias, deg/s", "b", &*course.learnt[1])];
    of_time(trial, "learnt", "what the filter has learnt", "uT, deg/s", lines)
}

/// The heading's error past magnets, and what it would be if no field were too strong to be believed.
fn magnets(trial: &Trial, course: &Course, without: &Course) -> Figure {
    let lines = vec![("no field is too strong", "b", &*without.ours[1]), ("as it is", "a", &*course.ours[1])];
    of_time(trial, "magnets", "heading past magnets", "heading error, degrees", lines)
}

fn summary(id: &str, what: &str, names: &[&str], courses: &[Course]) -> Figure {
    let columns = |name: &str, class, place, of: &dyn Fn(&Course) -> f64| Layer::Columns {
        name: name.to_owned(),
        class,
        place: (place, 2),
        values: names
            .iter()
            .zip(courses)
            .enumerate()
            .map(|(i, (t, c))| (i, of(c), format!("{t}: {name} {:.2} degrees", of(c))))
            .collect(),
    };
    Figure {
        id: id.to_owned(),
        title: "Total error of each trial, root mean square".to_owned(),
        x_label: what.to_owned(),
        y_label: "degrees".to_owned(),
        layers: vec![columns("ours", "a", 0, &|c| rms(&c.ours[0])), columns("classic, tuned", "b", 1, &|c| rms(&c.classic[0]))],
        height: 0.0,
        categories: names.iter().enumerate().map(|(i, name)| label(i, name, names.len())).collect(),
        captioned: false,
    }
}

/// What stands below a column: its name, or where there are too many the number of every fifth.
fn label(i: usize, name: &str, all: usize) -> String {
    match (all > 20, (i + 1).is_multiple_of(5)) {
        (false, _) => name.to_owned(),
        (true, true) => (i + 1).to_string(),
        (true, false) => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_become_stretches() {
        let t = [0.0, 1.0, 2.0, 3.0, 4.0];
        assert_eq!(spans(&t, &[false, true, true, false, true]), [(1.0, 3.0), (4.0, 4.0)]);
        assert_eq!(rms(&[3.0, f64::NAN, 4.0]), 12.5f64.sqrt());
    }
}
