//! The page of a selection: Tables 8 and 9, Figures 6.2 to 6.4 and A.13 to A.30.
//!
//! What it is: maxima of every pair as columns, efficiency against the mass that can hover, endurance and efficiency against
//! resultant force for each battery count, the table, and what is chosen.
//! What can go wrong: pairs without a result are named under the table, with why.
//! Units: N, A, kg, min.
//! Reference: Beharie 2013, section 6.1 and Appendix A.

use super::figure::{Figure, Layer, Mark};
use super::sheet::Sheet;
use crate::sizing::select::{Airframe, Need, Pair, Row, choose};
use crate::verdict::words::list;

/// Colours in the order of the motors.
const CLASSES: [&str; 6] = ["a", "b", "c", "d", "e", "f"];

/// The page of a selection; `from` is where its pairs come from, files with their digests for instance.
#[must_use]
pub fn selection(
    pairs: &[Pair],
    rows: &[Row],
    airframe: &Airframe,
    (need, batteries): (&Need, u32),
    from: &[(&str, String)],
) -> Sheet {
    let chosen = choose(rows, need);
    let mut sheet = Sheet::told(
        "Motor, propeller and battery",
        &match chosen.first() {
            Some(best) => format!(
                "{} is the most efficient of the pairs that give enough ({:.2} N per A). Of {} pairs with a result, {} give at least {:.2} N in total {}with {} x {:.1} A.h.",
                best.pair.name(),
                best.efficiency_n_per_a,
                rows.len(),
                chosen.len(),
                need.total_thrust_n.0,
                if need.full_throttle_min.0 > 0.0 {
                    format!("and last {:.1} min at full throttle ", need.full_throttle_min.0)
                } else {
                    String::new()
                },
                need.batteries,
                airframe.capacity_ah.0
            ),
            None => format!("No pair gives {:.2} N in total under these needs.", need.total_thrust_n.0),
        },
    );
    sheet.soft(&format!("{} pairs, {} with a result", pairs.len(), rows.len()));
    sheet.section("Mass by battery count (Table 8)");
    let masses: Vec<Vec<String>> = (0..=batteries)
        .map(|n| vec![n.to_string(), format!("{:.3}", airframe.mass(n).0), format!("{:.0}", airframe.charge(n).0 * 1000.0)])
        .collect();
    sheet.data("mass", &["batteries", "mass, kg", "charge, mA.h"], &masses, None);
    sheet.section("Performance of each pair (Table 9)");
    table(&mut sheet, rows, &chosen, batteries);
    let missing: Vec<String> = pairs.iter().filter(|p| p.maximum.is_none()).map(Pair::without_result).collect();
    if !missing.is_empty() {
        sheet.say(&format!("No result: {}.", missing.join("; ")));
    }
    let clipped: Vec<String> = pairs.iter().filter(|p| p.clipped).map(Pair::name).collect();
    if !clipped.is_empty() {
        sheet.warn(&format!(
            "The thrust reading stopped following the speed (a clipped load cell, or a stall); its maximum is a lower bound: {}.",
            clipped.join(", ")
        ));
    }
    sheet.section("All pairs (Figures 6.2 to 6.4)");
    sheet.figures(vec![
        columns(rows, "fig-6-2-thrust", "Thrust at full throttle", "thrust of one motor, N", |r| r.total_thrust_n.0 / 4.0),
        columns(rows, "fig-6-3-current", "Current at full throttle", "current of one motor, A", |r| {
            r.pair.maximum.map_or(f64::NAN, |m| m.current_a.0)
        }),
        columns(rows, "fig-6-4-efficiency", "Thrust for each ampere (Eq. 6.1)", "N per A", |r| r.efficiency_n_per_a),
        hover_mass(rows),
    ]);
    sheet.section("Endurance and efficiency against resultant force (Figures A.13 to A.30)");
    let figures = motors(rows).iter().flat_map(|m| (1..=batteries).map(|n| endurance(rows, m, n)).collect::<Vec<_>>()).collect();
    sheet.figures(figures);
    sheet.comes_from(from);
    sheet
}

fn table(sheet: &mut Sheet, rows: &[Row], chosen: &[&Row], batteries: u32) {
    let mut header: Vec<String> =
        ["motor", "propeller", "thrust, N", "current, A", "N per A", "hovers, kg"].map(str::to_owned).to_vec();
    let hovers = |n: u32| rows.iter().any(|r| r.with_batteries.iter().any(|w| w.batteries == n && w.hover_min.is_some()));
    for n in 1..=batteries {
        header.extend([format!("resultant {n}, N"), format!("full throttle {n}, min")]);
        header.extend(hovers(n).then(|| format!("hover {n}, min")));
    }
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|r| {
            let mut row = vec![
                r.pair.motor.clone(),
                r.pair.propeller.clone(),
                format!("{}{:.3}", if r.pair.clipped { ">= " } else { "" }, r.total_thrust_n.0 / 4.0),
                r.pair.maximum.map_or_else(String::new, |m| format!("{:.2}", m.current_a.0)),
                format!("{:.2}", r.efficiency_n_per_a),
                format!("{:.2}", r.hover_mass_kg.0),
            ];
            for w in &r.with_batteries {
                row.extend([tenths(w.resultant_n.0), format!("{:.1}", w.full_throttle_min.0)]);
                let hover = || w.hover_min.map_or_else(|| "-".to_owned(), |m| format!("{:.1}", m.0));
                row.extend(hovers(w.batteries).then(hover));
            }
            row
        })
        .collect();
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    sheet.chosen("pairs", &header, &cells, |i| chosen.iter().any(|c| std::ptr::eq(*c, &rows[i])));
    let without: Vec<String> = (1..=batteries).filter(|n| !hovers(*n)).map(|n| n.to_string()).collect();
    if !without.is_empty() && !rows.is_empty() {
        let with = format!("{} batter{}", list(&without), if without == ["1"] { "y" } else { "ies" });
        sheet.say(&format!(
            "No pair tells how long it hovers with {with} on board: that takes levels below and above the thrust in hover."
        ));
    }
}

/// To a tenth, without a minus before nothing.
#[must_use]
pub fn tenths(value: f64) -> String {
    format!("{:.1}", (10.0 * value).round() / 10.0 + 0.0)
}

fn motors(rows: &[Row]) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for r in rows {
        if !out.contains(&r.pair.motor) {
            out.push(r.pair.motor.clone());
        }
    }
    out
}

/// Propellers as categories, motors as columns.
fn columns(rows: &[Row], id: &str, title: &str, y_label: &str, value: impl Fn(&Row) -> f64) -> Figure {
    let motors = motors(rows);
    let mut categories: Vec<String> = Vec::new();
    for r in rows {
        if !categories.contains(&r.pair.propeller) {
            categories.push(r.pair.propeller.clone());
        }
    }
    let layers = motors
        .iter()
        .enumerate()
        .map(|(k, motor)| Layer::Columns {
            name: motor.clone(),
            class: CLASSES[k % CLASSES.len()],
            place: (k, motors.len()),
            values: rows
                .iter()
                .filter(|r| r.pair.motor == *motor)
                .filter_map(|r| {
                    let slot = categories.iter().position(|c| *c == r.pair.propeller)?;
                    let v = value(r);
                    Some((slot, v, format!("{motor} {}: {v:.3}", r.pair.propeller)))
                })
                .collect(),
        })
        .collect();
    Figure {
        id: id.to_owned(),
        title: title.to_owned(),
        x_label: "propeller".to_owned(),
        y_label: y_label.to_owned(),
        layers,
        categories,
        ..Figure::default()
    }
}

/// Largest mass in hover against efficiency (section 6.1, the grouping that the text calls Table 9).
fn hover_mass(rows: &[Row]) -> Figure {
    let layers = motors(rows)
        .iter()
        .zip(CLASSES.iter().cycle())
        .map(|(motor, class)| Layer::Marks {
            name: motor.clone(),
            class,
            marks: rows
                .iter()
                .filter(|r| r.pair.motor == *motor)
                .map(|r| Mark {
                    x: r.efficiency_n_per_a,
                    y: r.hover_mass_kg.0,
                    error: 0.0,
                    text: format!(
                        "{motor} {}: {:.2} kg, {:.2} N per A",
                        r.pair.propeller, r.hover_mass_kg.0, r.efficiency_n_per_a
                    ),
                })
                .collect(),
        })
        .collect();
    Figure {
        id: "model-mass".to_owned(),
        title: "Largest mass in hover against efficiency".to_owned(),
        x_label: "thrust for each ampere, N per A".to_owned(),
        y_label: "mass, kg".to_owned(),
        layers,
        ..Figure::default()
    }
}

fn endurance(rows: &[Row], motor: &str, batteries: u32) -> Figure {
    let of = |value: &dyn Fn(&Row) -> Option<(f64, String)>| -> Vec<Mark> {
        rows.iter()
            .filter(|r| r.pair.motor == motor)
            .filter_map(|r| {
                let w = r.with_batteries.iter().find(|w| w.batteries == batteries)?;
                let (y, text) = value(r)?;
                Some(Mark {
                    x: w.resultant_n.0,
                    y,
                    error: 0.0,
                    text: format!("{}: {text}, {:.1} N", r.pair.propeller, w.resultant_n.0),
                })
            })
            .collect()
    };
    let minutes = of(&|r| {
        let w = r.with_batteries.iter().find(|w| w.batteries == batteries)?;
        Some((w.full_throttle_min.0, format!("{:.1} min", w.full_throttle_min.0)))
    });
    // one axis: ten times the efficiency lies in the range of the minutes
    let efficiency = of(&|r| Some((10.0 * r.efficiency_n_per_a, format!("{:.2} N per A", r.efficiency_n_per_a))));
    Figure {
        id: format!("endurance-{}-{batteries}", motor.to_lowercase()),
        title: format!("{motor} with {batteries} batter{}", if batteries == 1 { "y" } else { "ies" }),
        x_label: "resultant force at full throttle, N".to_owned(),
        y_label: "min; 10 x N per A".to_owned(),
        layers: vec![
            Layer::Marks { name: "endurance, min".to_owned(), class: "a", marks: minutes },
            Layer::Marks { name: "10 x efficiency, N per A".to_owned(), class: "b", marks: efficiency },
        ],
        ..Figure::default()
    }
}
