//! The state diagram in the documentation is drawn from the table, and is current.
//!
//! `QUADRIG_BLESS=1 cargo test -p esc-pwm --test diagram` writes it anew.

use esc_pwm::arming::{STATES, TABLE};
use esc_pwm::{ArmingEvent, ArmingTimes, Transition, time_out};
use esc_pwm::{Refusals, State};
use std::fmt::Write;
use std::path::Path;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/arming.svg");
const BOX: (i32, i32) = (196, 118);

/// Where each state stands: centre of its box.
fn place(state: State) -> (i32, i32) {
    match state {
        State::Disarmed => (120, 250),
        State::ArmHoldMin => (400, 90),
        State::ArmCells => (660, 90),
        State::ArmReady => (920, 90),
        State::Armed => (1180, 250),
        State::Running => (1180, 520),
        State::CalibrateHoldMax => (400, 355),
        State::CalibrateHoldMin => (790, 355),
        State::ProgrammingEscape => (400, 520),
        State::Faulted => (120, 520),
    }
}

/// States that are led to from so many others that an arrow each would hide the rest: named in the boxes instead.
fn is_sink(state: State) -> bool {
    matches!(state, State::Faulted | State::ProgrammingEscape)
}

/// Rows of one pair of states, in the order of the table, with a guard's number where there is one.
fn label(rows: &[&Transition], guards: &[u16]) -> String {
    let words: Vec<String> = rows
        .iter()
        .map(|row| match guards.iter().position(|g| *g == row.unless) {
            Some(n) => format!("{:?} [{}]", row.on, n + 1),
            None => format!("{:?}", row.on),
        })
        .collect();
    words.join(", ")
}

/// The point where the line from a box's centre towards `to` leaves the box.
fn rim(from: (i32, i32), to: (i32, i32)) -> (f64, f64) {
    let (dx, dy) = (f64::from(to.0 - from.0), f64::from(to.1 - from.1));
    let scale = (f64::from(BOX.0) / 2.0 / dx.abs().max(1e-9)).min(f64::from(BOX.1) / 2.0 / dy.abs().max(1e-9));
    (f64::from(from.0) + dx * scale, f64::from(from.1) + dy * scale)
}

fn text(svg: &mut String, x: f64, y: f64, class: &str, words: &str) {
    let _ = writeln!(svg, r#"<text x="{x:.0}" y="{y:.0}" class="{class}">{words}</text>"#);
}

fn draw_box(svg: &mut String, state: State, guards: &[u16]) {
    let (x, y) = place(state);
    let live = matches!(state, State::Running | State::CalibrateHoldMax);
    let class = if live { "live" } else { "safe" };
    let (left, top) = (x - BOX.0 / 2, y - BOX.1 / 2);
    let _ = writeln!(svg, r#"<rect x="{left}" y="{top}" width="{}" height="{}" rx="10" class="{class}"/>"#, BOX.0, BOX.1);
    let mut line = f64::from(top) + 22.0;
    let mut say = |class: &str, words: String| {
        text(svg, f64::from(x), line, class, &words);
        line += if class == "name" { 18.0 } else { 14.5 };
    };
    say("name", format!("{state:?}"));
    say(
        "small",
        match state {
            State::Running => "pulse: the schedule's".to_owned(),
            State::CalibrateHoldMax => "pulse: MAXIMUM".to_owned(),
            _ => "pulse: minimum".to_owned(),
        },
    );
    if let Some(ms) = time_out(state, &ArmingTimes::default()) {
        say("small", format!("time-out {} s", ms / 1000));
    }
    for sink in [State::ProgrammingEscape, State::Faulted] {
        let rows: Vec<&Transition> = TABLE.iter().filter(|r| r.from == state && r.to == sink && sink != state).collect();
        if rows.is_empty() {
            continue;
        }
        let name = if sink == State::Faulted { "Faulted" } else { "Progr.Escape" };
        let words = label(&rows, guards);
        match words.split_once(", ").filter(|_| words.len() > 22) {
            Some((first, rest)) => {
                say("sink", format!("{name}: {first},"));
                say("sink", rest.to_owned());
            }
            None => say("sink", format!("{name}: {words}")),
        }
    }
    let own: Vec<&Transition> = TABLE.iter().filter(|r| r.from == state && r.to == state).collect();
    if !own.is_empty() {
        say("small", format!("stays: {}", label(&own, guards)));
    }
}

fn diagram() -> String {
    let mut guards: Vec<u16> = TABLE.iter().map(|r| r.unless).filter(|g| *g != 0).collect();
    guards.sort_unstable();
    guards.dedup();
    let mut svg = String::from(
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1300 720" font-family="sans-serif" role="img" aria-label="State diagram of the arming machine">
<!-- drawn from esc_pwm::arming::TABLE by esc-pwm/tests/diagram.rs; do not edit -->
<style>
.page{fill:#fff} .safe{fill:#eef4fb;stroke:#35618f;stroke-width:1.5} .live{fill:#fde7e4;stroke:#b3261e;stroke-width:2.5}
.arrow{fill:none;stroke:#333;stroke-width:1.5;marker-end:url(#tip)} .label{font-size:13px;text-anchor:middle;fill:#111;paint-order:stroke;stroke:#fff;stroke-width:5px}
.name{font-size:15px;font-weight:bold;text-anchor:middle;fill:#111} .small{font-size:11.5px;text-anchor:middle;fill:#333} .sink{font-size:11px;text-anchor:middle;fill:#9c1b13} .note{font-size:13px;fill:#111}
</style>
<defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" orient="auto"><path d="M0 0 10 5 0 10z" fill="#333"/></marker></defs>
<rect class="page" width="1300" height="720"/>
"##,
    );
    for from in STATES {
        for to in STATES {
            let rows: Vec<&Transition> = TABLE.iter().filter(|r| r.from == from && r.to == to).collect();
            if from == to || rows.is_empty() || (is_sink(to) && !is_sink(from)) {
                continue;
            }
            let both = TABLE.iter().any(|r| r.from == to && r.to == from) && !is_sink(from);
            let ((ax, ay), (bx, by)) = (rim(place(from), place(to)), rim(place(to), place(from)));
            let length = (bx - ax).hypot(by - ay).max(1.0);
            let aside = if both { 26.0 } else { 0.0 };
            let (ox, oy) = (-(by - ay) / length * aside, (bx - ax) / length * aside);
            let (mx, my) = ((ax + bx) / 2.0 + ox, (ay + by) / 2.0 + oy);
            let (cx, cy) = (mx + ox, my + oy);
            let _ = writeln!(svg, r#"<path class="arrow" d="M{ax:.1} {ay:.1}Q{cx:.1} {cy:.1} {bx:.1} {by:.1}"/>"#);
            text(&mut svg, mx, my - 6.0, "label", &label(&rows, &guards));
        }
    }
    for state in STATES {
        draw_box(&mut svg, state, &guards);
    }
    text(
        &mut svg,
        20.0,
        590.0,
        "note",
        "From every state: Stop and Trip lead to Faulted (ProgrammingEscape stays, at minimum). Red boxes alone give pulses above minimum.",
    );
    for (n, guard) in guards.iter().enumerate() {
        let words: Vec<&str> = Refusals(*guard).words().collect();
        text(&mut svg, 20.0, 638.0 + 20.0 * n as f64, "note", &format!("[{}] refused when: {}", n + 1, words.join("; ")));
    }
    svg.push_str("</svg>\n");
    svg
}

#[test]
fn every_row_of_the_table_is_in_the_picture() {
    let svg = diagram();
    for event in ArmingEvent::ALL {
        let used = TABLE.iter().filter(|row| row.on == event).count();
        let word = format!("{event:?}");
        let drawn = svg.split(|c: char| !c.is_alphanumeric()).filter(|w| **w == word).count();
        let noted = usize::from(matches!(event, ArmingEvent::Stop | ArmingEvent::Trip)); // the note below the picture
        assert_eq!(drawn, used + noted, "{word}");
    }
}

#[test]
fn the_picture_in_the_documentation_is_current() {
    let svg = diagram();
    if std::env::var_os("QUADRIG_BLESS").is_some() {
        std::fs::write(FILE, &svg).expect("docs/arming.svg can be written");
    }
    let kept = std::fs::read_to_string(Path::new(FILE)).unwrap_or_default();
    assert!(kept == svg, "docs/arming.svg is not what the table says: QUADRIG_BLESS=1 cargo test -p esc-pwm --test diagram");
}
