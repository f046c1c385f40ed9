//! What a designer asks for, on the page of a run.
//!
//! What it is: power, efficiency and coefficients of every plateau as a table (with a CSV of all digits), three figures, and thrust over
//! throttle and voltage.
//! What can go wrong: what is not known is said to be not known, and why.
//! Units: on the axes and in the heads.
//! Reference: `fit::power`, `fit::surface`.

use super::figure::{Figure, Layer, Mark};
use super::sheet::Sheet;
use crate::identify::Identified;
use crate::identify::curves::power::{ASKED, Level, in_doubt};
use crate::identify::curves::surface::Surface;
use crate::numeric::digits::number;

/// Adds the part; `thin` is what the page does with its figures.
pub(super) fn designer(sheet: &mut Sheet, found: &Identified, thin: impl Fn(Figure) -> Figure) {
    if found.levels.is_empty() {
        return;
    }
    let zero = found.zero_words();
    if !zero.is_empty() {
        sheet.say(&format!("{}.", capital(&zero)));
    }
    in_doubt(&found.levels).iter().for_each(|line| sheet.warn(&format!("{}.", capital(line).trim_end_matches('?'))));
    sheet.say("Half widths of 95 % intervals beside the values. In still air a propeller moves nothing forward, so that its propulsive efficiency is 0: the figure of merit says how near it comes to an ideal one.");
    for lack in found.disc.lacks() {
        sheet.say(&format!("{}. What needs it is left empty.", capital(lack)));
    }
    table(sheet, found);
    sheet.figures(figures(&found.levels).into_iter().map(&thin).collect());
    match &found.surface {
        Ok(surface) => {
            let (low, high) = surface.measured;
            sheet.say(&format!(
                "Thrust over throttle and supply voltage, by the motor's constants. The run's levels saw {low:.2} to {high:.2} V; what lies beyond is computed."
            ));
            sheet.figures(vec![thin(drawn(surface))]);
            listed(sheet, surface);
        }
        Err(why) => sheet.say(&format!("Thrust over throttle and voltage: {why}.")),
    }
}

/// Channels that the table of plateaus shows.
const ELSEWHERE: [&str; 4] = ["rpm", "torque_nm", "current_a", "voltage_v"];

/// A value and half of its 95 % interval, to two digits of the latter; `se` is its standard error. One without an error has five digits, a whole
/// number its own.
pub(super) fn paired(value: f64, se: f64) -> String {
    let half = 1.96 * se;
    if !(half.is_finite() && half > 0.0) {
        return if value.fract() == 0.0 { format!("{value}") } else { number(value) };
    }
    let places = (1 - half.log10().floor() as i32).clamp(0, 7) as usize;
    format!("{value:.places$} \u{b1} {half:.places$}")
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

fn table(sheet: &mut Sheet, found: &Identified) {
    // a column that is not known at any level is told above, and takes no room
    let shown = |k: &usize| !ELSEWHERE.contains(&ASKED[*k].name) && found.levels.iter().any(|l| l.figures[*k].is_some());
    let known: Vec<usize> = (0..ASKED.len()).filter(shown).collect();
    let head = |k: &usize| {
        let a = ASKED[*k];
        if a.unit.is_empty() { a.heading.to_owned() } else { format!("{}, {}", a.heading, a.unit) }
    };
    let header: Vec<String> = std::iter::once("plateau".to_owned()).chain(known.iter().map(head)).collect();
    let cell = |level: &Level, k: &usize| level.figures[*k].map_or_else(|| "-".to_owned(), |(v, se)| paired(v, se));
    let rows: Vec<Vec<String>> = found
        .levels
        .iter()
        .map(|l| std::iter::once((l.plateau + 1).to_string()).chain(known.iter().map(|k| cell(l, k))).collect())
        .collect();
    let text = crate::identify::curves::power::csv(&found.plateaus, &found.levels);
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<String>>());
    let raw_head = lines.next().unwrap_or_default();
    let raw: Vec<Vec<String>> = lines.collect();
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let raw_head: Vec<&str> = raw_head.iter().map(String::as_str).collect();
    sheet.data("plateau-figures", &header, &rows, Some((&raw_head, &raw)));
}

/// Power over the pulse (or the speed), thrust for each watt over the thrust, efficiencies over the pulse.
fn figures(levels: &[Level]) -> Vec<Figure> {
    let over = if levels.iter().any(|l| l.of("pulse_us").is_some()) { "pulse_us" } else { "rpm" };
    let marks = |name: &str, x: &str, y: &'static str, class: &'static str| Layer::Marks {
        name: name.to_owned(),
        class,
        marks: levels
            .iter()
            .filter_map(|l| {
                let ((x, _), (y, se)) = (l.of(x)?, l.of(y)?);
                let text = format!("{name}: {} \u{b1} {} at {}", number(y), number(1.96 * se), number(x));
                Some(Mark { x, y, error: 1.96 * se, text })
            })
            .collect(),
    };
    let x_label = if over == "pulse_us" { "pulse, us" } else { "speed, rev/min" };
    // what no level tells has no place in a legend
    let has_marks = |layer: &Layer| !matches!(layer, Layer::Marks { marks, .. } if marks.is_empty());
    let figure = |id: &str, title: &str, x_label: &str, y_label: &str, layers: Vec<Layer>| Figure {
        id: id.into(),
        title: title.into(),
        x_label: x_label.into(),
        y_label: y_label.into(),
        layers: layers.into_iter().filter(has_marks).collect(),
        ..Figure::default()
    };
    vec![
        figure(
            "power",
            "Power in and out",
            x_label,
            "W",
            vec![marks("electrical", over, "electrical_w", "b"), marks("shaft", over, "shaft_w", "a")],
        ),
        figure(
            "thrust-for-power",
            "Thrust for each watt",
            "thrust, N",
            "g/W",
            vec![marks("electrical", "thrust_n", "g_per_w", "b"), marks("shaft", "thrust_n", "g_per_shaft_w", "a")],
        ),
        figure(
            "efficiency",
            "Motor with controller, and propeller",
            x_label,
            "share",
            vec![
                marks("motor and controller", over, "motor_efficiency", "b"),
                marks("figure of merit", over, "figure_of_merit", "a"),
            ],
        ),
    ]
}

/// A line and a band for each voltage.
fn drawn(surface: &Surface) -> Figure {
    let mut layers = Vec::new();
    for ((v, row), class) in surface.voltages.iter().zip(&surface.thrust).zip(["c", "d", "a", "b", "e"]) {
        let x = surface.pulses.clone();
        let name = if surface.is_measured(*v) { format!("{v:.1} V") } else { format!("{v:.1} V, computed") };
        let edge = |sign: f64| row.iter().map(|(thrust, half)| thrust + sign * half).collect::<Vec<f64>>();
        layers.push(Layer::Band { name: String::new(), class, x: x.clone(), lower: edge(-1.0), upper: edge(1.0) });
        layers.push(Layer::Line { name, class, x, y: row.iter().map(|p| p.0).collect() });
    }
    Figure {
        id: "thrust-surface".into(),
        title: "Thrust over throttle and voltage, with 95 % bands".into(),
        x_label: "pulse, us".into(),
        y_label: "thrust, N".into(),
        layers,
        ..Figure::default()
    }
}

fn listed(sheet: &mut Sheet, surface: &Surface) {
    let text = surface.csv();
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<String>>());
    let raw_head = lines.next().unwrap_or_default();
    let raw: Vec<Vec<String>> = lines.collect();
    let header: Vec<String> =
        std::iter::once("pulse, us".to_owned()).chain(surface.voltages.iter().map(|v| format!("N at {v:.1} V"))).collect();
    let rows: Vec<Vec<String>> = (0..surface.pulses.len())
        .step_by(2)
        .map(|k| {
            let cell = |row: &Vec<(f64, f64)>| paired(row[k].0, row[k].1);
            std::iter::once(format!("{:.0}", surface.pulses[k])).chain(surface.thrust.iter().map(cell)).collect()
        })
        .collect();
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let raw_head: Vec<&str> = raw_head.iter().map(String::as_str).collect();
    sheet.data("thrust-surface", &header, &rows, Some((&raw_head, &raw)));
}

#[cfg(test)]
mod tests {
    use super::paired;

    #[test]
    fn a_value_has_the_digits_of_its_error() {
        assert_eq!(paired(617.060_68, 0.0482), "617.061 \u{b1} 0.094");
        assert_eq!(paired(84.7, 12.0), "85 \u{b1} 24");
        assert_eq!(paired(2000.0, 0.0), "2000");
    }
}
