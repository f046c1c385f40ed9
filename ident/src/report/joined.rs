//! The joint as a page: what both saw, one above the other, and how the clocks run against each other.
//!
//! What it is: for each joint the deciding channel over the whole run and about its steepest step, and the second clock piece by piece.
//! What can go wrong: nothing; a channel that was left out has no figure.
//! Units: on the axes.
//! Reference: none needed.

use crate::channel::unit_of;
use crate::log::Log;
use crate::log::join::signal::{Signal, pairs};
use crate::log::join::{Joint, Seen};
use crate::numeric::order::median;
use crate::report::{Figure, Layer, Mark, Sheet};
use crate::verdict::words::{channel, heading, list};

impl Joint {
    /// The joint in one line.
    #[must_use]
    pub fn sentence(&self) -> String {
        let by: Vec<String> = self.seen.iter().map(|s| channel(s.channel)).collect();
        format!(
            "offset {:.4} s +- {:.1} ms at {:.1} s of its clock, drift {:.1} +- {:.1} ppm (95 %), by {} over {:.0} s",
            self.offset_s.0,
            1e3 * self.offset_s.1,
            self.pivot_s,
            self.drift_ppm.0,
            self.drift_ppm.1,
            by.join(", "),
            self.overlap_s.1 - self.overlap_s.0
        )
    }
}

/// The page of a run's joints: the stand's log before it was joined, and each other log with its joint.
#[must_use]
pub fn page(stand: &Log, joined: &[(&Log, &Joint)]) -> String {
    let others: Vec<&str> = joined.iter().map(|(log, _)| log.name.as_str()).collect();
    let mut sheet = Sheet::told(
        &format!("Clocks of {}", stand.name),
        &format!("{} and {} are on one clock. {}", stand.name, others.join(", "), lead(joined)),
    );
    for (k, (other, joint)) in joined.iter().enumerate() {
        sheet.section(&other.name);
        sheet.say(&format!("{}.", crate::verdict::words::upper(&joint.sentence())));
        let rows: Vec<Vec<String>> = joint
            .seen
            .iter()
            .map(|s| {
                let later = format!("{:.1} +- {:.1}", 1e3 * s.later_s.0, 1e3 * s.later_s.1);
                vec![channel(s.channel), format!("{:.4}", s.correlation), later]
            })
            .collect();
        sheet.table(&["channel", "correlation", "second log later by, ms"], &rows, |i| i == 0);
        of_sensors(joint).into_iter().chain(of_pieces(joint)).for_each(|told| sheet.say(&told));
        sheet.figures(figures(stand, other, joint, k));
    }
    sheet.say("A sensor that reads late looks like a clock that is late. The first channel's delay is in the offset. The others' are told against it.");
    sheet.html()
}

/// How sure the clocks are: offset and drift together, at the worst time of the run.
fn lead(joined: &[(&Log, &Joint)]) -> String {
    let worst = joined.iter().map(|(_, j)| j.worst_s).fold(0.0, f64::max);
    format!("The offset between the clocks is known to {:.1} ms or better at any time of the run (95 %).", 1e3 * worst)
}

/// What the delays of the two sensors of a channel differ by, where that is more than its own interval; the first channel made the joint.
fn of_sensors(joint: &Joint) -> Option<String> {
    let apart = joint.seen.iter().skip(1).filter(|s| s.later_s.0.abs() > s.later_s.1);
    let said = |s: &Seen| {
        let way = if s.later_s.0 < 0.0 { "earlier" } else { "later" };
        format!("{} {:.1} ms {way}", channel(s.channel), 1e3 * s.later_s.0.abs())
    };
    let all: Vec<String> = apart.map(said).collect();
    let all = (!all.is_empty()).then(|| list(&all))?;
    Some(format!(
        "On the joined clock the second log reads {all} than the stand: by so much the delays of the sensors differ. It is no error of the clocks."
    ))
}

/// What one piece of the run alone knows, beside what all know together.
fn of_pieces(joint: &Joint) -> Option<String> {
    let mut alone: Vec<f64> = joint.pieces.iter().map(|[_, _, se]| 2e3 * se).collect();
    (alone.len() > 1).then(|| {
        format!(
            "The joint rests on {} pieces of the run. One piece alone knows the offset to {:.1} ms (median; two standard errors): by so much they scatter in the figure. All together know it to {:.1} ms (95 %).",
            alone.len(),
            median(&mut alone),
            1e3 * joint.worst_s
        )
    })
}

fn figures(stand: &Log, other: &Log, joint: &Joint, k: usize) -> Vec<Figure> {
    let mut out = Vec::new();
    let pairs = pairs(stand, other);
    if let Some(pair) = joint.seen.first().and_then(|s| pairs.iter().find(|p| p.channel == s.channel)) {
        let b = Signal { t: pair.other.t.iter().map(|t| joint.to_stand(*t)).collect(), ..pair.other.clone() };
        let (from, to) = joint.overlap_s;
        let at = steepest(&pair.stand, &b, joint.overlap_s);
        let near = 12.0 * pair.stand.step.max(pair.other.step);
        let label = format!("{}, {}", channel(pair.channel), unit_of(pair.channel));
        for (id, title, from, to) in [
            ("whole", format!("{} as both saw it", heading(pair.channel)), from, to),
            ("step", format!("{} about its steepest step", heading(pair.channel)), at - near, at + near),
        ] {
            let line = |name: &str, class, s: &Signal| {
                let (x, y) = s.t.iter().zip(&s.v).filter(|(t, _)| (from..=to).contains(*t)).unzip();
                Layer::Line { name: name.to_owned(), class, x, y }
            };
            out.push(Figure {
                id: format!("joint-{id}-{k}"),
                title,
                x_label: "time, s".into(),
                y_label: label.clone(),
                layers: vec![line("the stand", "a", &pair.stand), line("the second log", "b", &b)],
                ..Figure::default()
            });
        }
    }
    let marks = joint.pieces.iter().map(|[t, later, se]| Mark {
        x: *t,
        y: 1e3 * later,
        error: 2e3 * se,
        text: format!("{t:.0} s: {:.1} +- {:.1} ms", 1e3 * later, 2e3 * se),
    });
    out.push(Figure {
        id: format!("joint-pieces-{k}"),
        title: "Each piece of the run alone: how much later than the joint".into(),
        x_label: "time, s".into(),
        y_label: "ms".into(),
        layers: vec![
            Layer::Level { y: 0.0, text: "the joint".into() },
            Layer::Marks { name: "a piece of the run, two standard errors".into(), class: "a", marks: marks.collect() },
        ],
        ..Figure::default()
    });
    out
}

/// Time of the steepest change within a span that both saw: a probe that loses its mark is alone.
fn steepest(a: &Signal, b: &Signal, (from, to): (f64, f64)) -> f64 {
    let width = a.step.max(b.step);
    let slope = |s: &Signal, t: f64| s.at(t, width).map_or(0.0, |(_, slope)| slope);
    let both = |t: f64| {
        let (a, b) = (slope(a, t), slope(b, t));
        if a * b > 0.0 { a.abs().min(b.abs()) } else { 0.0 }
    };
    let inside = a.t.iter().copied().filter(|t| (from..=to).contains(t));
    inside.map(|t| (both(t), t)).max_by(|a, b| a.0.total_cmp(&b.0)).map_or(from, |(_, t)| t)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three figures in milliseconds: how sure the clocks are, how single pieces scatter, how late a sensor is. Each says which it is.
    #[test]
    fn every_figure_says_what_it_is() {
        let joint = Joint {
            offset_s: (5.0, 0.002),
            drift_ppm: (10.0, 20.0),
            pivot_s: 50.0,
            worst_s: 0.0033,
            overlap_s: (0.0, 100.0),
            seen: vec![
                Seen { channel: "rpm", correlation: 0.999, later_s: (0.0, 0.002) },
                Seen { channel: "current_a", correlation: 0.998, later_s: (-0.0413, 0.0183) },
                Seen { channel: "voltage_v", correlation: 0.993, later_s: (0.01, 0.0838) },
            ],
            pieces: vec![[10.0, 0.01, 0.02], [50.0, -0.01, 0.0205], [90.0, 0.0, 0.03]],
        };
        let other = Log { name: "esc.csv".into(), ..Log::default() };
        assert_eq!(
            lead(&[(&other, &joint)]),
            "The offset between the clocks is known to 3.3 ms or better at any time of the run (95 %)."
        );
        let told = of_sensors(&joint).expect("a late sensor");
        assert!(told.contains("the second log reads current 41.3 ms earlier than the stand: by so much the delays"), "{told}");
        let told = of_pieces(&joint).expect("pieces");
        assert!(told.contains("One piece alone knows the offset to 41.0 ms (median; two standard errors)"), "{told}");
        assert!(told.ends_with("All together know it to 3.3 ms (95 %)."), "{told}");
        assert_eq!(of_pieces(&Joint { pieces: Vec::new(), ..joint }), None);
    }
}
