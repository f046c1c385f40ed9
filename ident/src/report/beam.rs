//! The page of a beam: the design in figures and the curves of Figures 5.40 to 5.42.
//!
//! What it is: signal, stress, limits, first natural frequency; the resonances that a schedule meets.
//! What can go wrong: nothing.
//! Units: mm, MPa, V, Hz, rev/min on the page.
//! Reference: Beharie 2013, section 5.5.2.1.

use super::figure::{Figure, Layer};
use super::sheet::Sheet;
use crate::log::quantity::{Kilogram, Metre, Newton};
use crate::sizing::beam::{Beam, Crossing};

const CLASSES: [&str; 4] = ["a", "b", "c", "e"];

/// The page of a beam.
#[must_use]
pub fn beam(beam: &Beam, blades: u32, met: &[Crossing]) -> Sheet {
    let mut sheet = Sheet::new("Load-cell beam");
    for c in met {
        sheet.warn(&warning(c));
    }
    sheet.table(&["quantity", "value", "unit"], &figures(beam, blades), |_| false);
    sheet.section("Curves of the design (Figures 5.40 to 5.42)");
    sheet.figures(vec![signal(beam), stress_by_length(beam), stress_by_mass(beam), frequency(beam)]);
    sheet
}

/// One line that says which resonance a run meets.
#[must_use]
pub fn warning(c: &Crossing) -> String {
    let dwells: Vec<String> = c.dwells.iter().map(|s| format!("{:.0}", s.0)).collect();
    let held =
        if dwells.is_empty() { String::new() } else { format!("; levels that stand near it: {} rev/min", dwells.join(", ")) };
    format!("The schedule meets the beam's resonance at {:.0} rev/min ({}){held}.", c.speed_rpm.0, c.cause)
}

/// What the design comes to: quantity, value, unit.
#[must_use]
pub fn figures(beam: &Beam, blades: u32) -> Vec<Vec<String>> {
    let row = |name: &str, value: String, unit: &str| vec![name.to_owned(), value, unit.to_owned()];
    let mut out = vec![
        row("bending stress at the clamp (5.56)", format!("{:.2}", beam.stress().0 / 1e6), "MPa"),
        row("strain", format!("{:.1}", beam.strain() * 1e6), "microstrain"),
        row("safety against yield", format!("{:.2}", beam.safety_reached()), ""),
        row("full bridge (5.53)", format!("{:.3}", beam.bridge_output().0 * 1e3), "mV"),
        row("amplified (5.55)", format!("{:.3}", beam.amplified().0), "V"),
        row("deflection of the tip", format!("{:.3}", beam.deflection().0 * 1e3), "mm"),
        row("longest beam for this load", format!("{:.0}", beam.longest().0 * 1e3), "mm"),
        row("largest load for this length", format!("{:.2}", beam.strongest().0), "N"),
        row("the same as a mass", format!("{:.0}", beam.strongest().carries().0 * 1e3), "g"),
        row("first natural frequency", format!("{:.1}", beam.natural_frequency().0), "Hz"),
    ];
    for c in beam.resonances(blades) {
        out.push(row(&format!("resonance: {}", c.cause), format!("{:.0}", c.speed_rpm.0), "rev/min"));
    }
    out
}

fn grid(from: f64, to: f64) -> Vec<f64> {
    (0..=80).map(|k| from + (to - from) * f64::from(k) / 80.0).collect()
}

fn signal(beam: &Beam) -> Figure {
    let x = grid(100.0, 1000.0);
    let layers = [1.0, 2.0, 3.0, 4.0]
        .into_iter()
        .zip(CLASSES)
        .map(|(h, class)| Layer::Line {
            name: format!("h = {h} mm"),
            class,
            y: x.iter().map(|g| Beam { height_m: Metre(h / 1e3), gain: *g, ..*beam }.amplified().0).collect(),
            x: x.clone(),
        })
        .collect();
    Figure {
        id: "fig-5-40-signal".into(),
        title: "Amplifier output by gain and beam height".into(),
        x_label: "gain".into(),
        y_label: "output at the load, V".into(),
        layers,
        ..Figure::default()
    }
}

fn limit(beam: &Beam) -> [Layer; 2] {
    [
        Layer::Level { y: beam.yield_pa.0 / beam.safety / 1e6, text: format!("yield / {}", beam.safety) },
        Layer::Level { y: beam.yield_pa.0 / 1e6, text: "yield".into() },
    ]
}

fn stress_by_length(beam: &Beam) -> Figure {
    let x = grid(50.0, 500.0);
    let mut layers: Vec<Layer> = [2.0, 3.0, 4.0]
        .into_iter()
        .zip(CLASSES)
        .map(|(h, class)| Layer::Line {
            name: format!("h = {h} mm"),
            class,
            y: x.iter().map(|l| Beam { height_m: Metre(h / 1e3), length_m: Metre(l / 1e3), ..*beam }.stress().0 / 1e6).collect(),
            x: x.clone(),
        })
        .collect();
    layers.extend(limit(beam));
    Figure {
        id: "fig-5-41-stress-length".into(),
        title: "Stress by beam length".into(),
        x_label: "length, mm".into(),
        y_label: "stress, MPa".into(),
        layers,
        ..Figure::default()
    }
}

fn stress_by_mass(beam: &Beam) -> Figure {
    let x = grid(0.0, 2000.0);
    let mut layers: Vec<Layer> = [2.0, 3.0, 4.0]
        .into_iter()
        .zip(CLASSES)
        .map(|(h, class)| Layer::Line {
            name: format!("h = {h} mm"),
            class,
            y: x.iter()
                .map(|m| {
                    Beam { height_m: Metre(h / 1e3), load_n: Newton::weight_of(Kilogram(m / 1e3)), ..*beam }.stress().0 / 1e6
                })
                .collect(),
            x: x.clone(),
        })
        .collect();
    layers.extend(limit(beam));
    Figure {
        id: "fig-5-42-stress-mass".into(),
        title: format!("Stress by load, length {:.0} mm", beam.length_m.0 * 1e3),
        x_label: "load, g".into(),
        y_label: "stress, MPa".into(),
        layers,
        ..Figure::default()
    }
}

fn frequency(beam: &Beam) -> Figure {
    let x = grid(50.0, 450.0);
    let y = x.iter().map(|l| Beam { length_m: Metre(l / 1e3), ..*beam }.natural_frequency().0).collect();
    Figure {
        id: "beam-frequency".into(),
        title: format!("First natural frequency with {:.0} g at the tip", beam.tip_kg.0 * 1e3),
        x_label: "length, mm".into(),
        y_label: "Hz".into(),
        layers: vec![
            Layer::Line { name: String::new(), class: "a", x, y },
            Layer::Rule { x: beam.length_m.0 * 1e3, text: "this beam".into() },
        ],
        ..Figure::default()
    }
}
