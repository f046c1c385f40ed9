//! `cargo xtask ahrs-bench --plots DIR`: how the error runs in each trial.
//!
//! What it is: for each trial a figure of total, heading and inclination error of our default and of the thesis' filter with tuned
//! gains, with the filter's own flags: the field is taken for disturbed (shaded), the body for resting (bar); and one figure
//! that sums the trials up. `index.html` holds them all; `summary.svg` and each trial's figures lie beside it.
//! What can go wrong: the folder cannot be written; errors are drawn only where the benchmark scores.
//! Units: s, degrees.
//! Reference: README of the data, "Protocol".

use super::score::errors;
use super::trial::{Sample, Trial};
use crate::run::Failure;
use dcm::{Classic, ClassicConfig, Config, Dcm, Earth, Fresh, Mat3, Measurement, Vec3, quaternion_of};
use ident::report::{Figure, Layer, Sheet, write_figures};
use std::path::Path;

const WHAT: [&str; 3] = ["total", "heading", "inclination"];

/// A filter's errors over a trial; not a number where nothing is scored.
#[derive(Default)]
struct Course {
    ours: [Vec<f64>; 3],
    classic: [Vec<f64>; 3],
    rest: Vec<bool>,
    disturbed: Vec<bool>,
}

/// Writes the folder.
pub(super) fn plots(folder: &Path, trials: &[Trial]) -> Result<(), Failure> {
    let courses: Vec<Course> = std::thread::scope(|scope| {
        let handles: Vec<_> = trials.iter().map(|t| scope.spawn(|| course(&t.samples))).collect();
        handles.into_iter().map(super::joined).collect()
    });
    let mut sheet = Sheet::new("Attitude error in each BROAD trial");
    sheet.say("Ours: the one default. Classic: the thesis' algorithm with tuned gains. Errors are drawn where the benchmark scores. Shaded: our filter takes the field for disturbed and holds its heading. Green bar at zero: it takes the body for resting.");
    sheet.figures(vec![summary(trials, &courses)]);
    for (trial, course) in trials.iter().zip(&courses) {
        sheet.section(&trial.name);
        let numbers = |errors: &[Vec<f64>; 3]| errors.each_ref().map(|e| format!("{:.2}", rms(e))).to_vec();
        let row = |name: &str, errors: &[Vec<f64>; 3]| [vec![name.to_owned()], numbers(errors)].concat();
        let rows = [row("ours", &course.ours), row("classic", &course.classic)];
        sheet.table(&["root mean square, degrees", "total", "heading", "inclination"], &rows, |_| false);
        sheet.figures((0..3).map(|k| figure(trial, course, k)).collect());
    }
    let fail = |e: std::io::Error| Failure(format!("{}: {e}", folder.display()));
    write_figures(folder, sheet.drawn()).map_err(|(path, e)| Failure(format!("{}: {e}", path.display())))?;
    let page = folder.join("index.html");
    ident::log::write_whole(&page, |out| out.write_all(sheet.html().as_bytes())).map_err(fail)?;
    println!("{} trials drawn, {}", trials.len(), page.display());
    Ok(())
}

fn course(samples: &[Sample]) -> Course {
    let (mut ours, mut classic) = (Dcm::new(Config::DEFAULT), Classic::new(ClassicConfig::TUNED));
    let mut out = Course::default();
    let mut fresh = Fresh::default();
    let mut last = samples.first().map_or(0.0, |s| s.t) - samples.get(1).map_or(0.01, |s| s.t - samples[0].t);
    for s in samples {
        let dt = (s.t - last) as f32;
        last = s.t;
        let mag = fresh.take(dt, Some(Vec3::from(s.mag)));
        let measured = Measurement { gyro: Some(Vec3::from(s.gyro)), accel: Some(Vec3::from(s.accel)), mag };
        ours.update(dt, &measured);
        classic.update(dt, &measured);
        out.rest.push(ours.flags().rest);
        out.disturbed.push(ours.flags().field_disturbed);
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
    }
}

fn summary(trials: &[Trial], courses: &[Course]) -> Figure {
    let columns = |name: &str, class, place, of: &dyn Fn(&Course) -> f64| Layer::Columns {
        name: name.to_owned(),
        class,
        place: (place, 2),
        values: trials
            .iter()
            .zip(courses)
            .enumerate()
            .map(|(i, (t, c))| (i, of(c), format!("{}: {name} {:.2} degrees", t.name, of(c))))
            .collect(),
    };
    Figure {
        id: "summary".to_owned(),
        title: "Total error of each trial, root mean square".to_owned(),
        x_label: "BROAD trial".to_owned(),
        y_label: "degrees".to_owned(),
        layers: vec![columns("ours", "a", 0, &|c| rms(&c.ours[0])), columns("classic, tuned", "b", 1, &|c| rms(&c.classic[0]))],
        height: 0.0,
        categories: trials.iter().map(|t| t.name.chars().take(2).collect()).collect(),
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
