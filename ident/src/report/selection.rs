//! The page of a selection: Tables 8 and 9, Figures 6.2 to 6.4 and A.13 to A.30.
//!
//! What it is: maxima of every pair as columns, efficiency against the mass that can hover, endurance and efficiency against
//! resultant force for each battery count, the table, and what is chosen. What would be a lone dot is said in words.
//! What can go wrong: pairs without a result are named under the table, with why.
//! Units: N, A, kg, min.
//! Reference: Beharie 2013, section 6.1 and Appendix A.

use super::figure::{Figure, Layer, Mark};
use super::sheet::Sheet;
use crate::sizing::select::{Airframe, Need, Pair, Row, WithBatteries, choose};
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
    all_pairs(&mut sheet, rows);
    sheet.section("Endurance and efficiency against resultant force (Figures A.13 to A.30)");
    endurances(&mut sheet, rows, batteries);
    sheet.comes_from(from);
    sheet
}

/// Figures over all pairs; one pair alone has none.
fn all_pairs(sheet: &mut Sheet, rows: &[Row]) {
    if let [only] = rows {
        sheet.say(&at_full_throttle(only));
        return;
    }
    sheet.figures(vec![
        columns(rows, "fig-6-2-thrust", "Thrust at full throttle", "thrust of one motor, N", |r| r.total_thrust_n.0 / 4.0),
        columns(rows, "fig-6-3-current", "Current at full throttle", "current of one motor, A", |r| {
            r.pair.maximum.map_or(f64::NAN, |m| m.current_a.0)
        }),
        columns(rows, "fig-6-4-efficiency", "Thrust for each ampere (Eq. 6.1)", "N per A", |r| r.efficiency_n_per_a),
        hover_mass(rows),
    ]);
}

/// A figure for each motor and battery count; of a motor with one propeller its values in words.
fn endurances(sheet: &mut Sheet, rows: &[Row], batteries: u32) {
    let motors = motors(rows);
    for motor in &motors {
        if let [only] = of_motor(rows, motor)[..] {
            only.with_batteries.iter().filter(|w| w.batteries <= batteries).for_each(|w| sheet.say(&lasts(only, w)));
        }
    }
    let drawn = motors.iter().filter(|motor| of_motor(rows, motor).len() > 1);
    sheet.figures(drawn.flat_map(|m| (1..=batteries).map(|n| endurance(rows, m, n)).collect::<Vec<_>>()).collect());
}

/// Rows of one motor.
fn of_motor<'r>(rows: &'r [Row], motor: &str) -> Vec<&'r Row> {
    rows.iter().filter(|r| r.pair.motor == motor).collect()
}

/// What a lone pair does at full throttle.
fn at_full_throttle(row: &Row) -> String {
    let current = row.pair.maximum.map_or_else(String::new, |m| format!(" for {:.2} A", m.current_a.0));
    format!(
        "One pair alone has nothing to be drawn against. At full throttle one motor gives {:.3} N{current}, {:.2} N per A. Four of them hold {:.2} kg in hover.",
        row.total_thrust_n.0 / 4.0,
        row.efficiency_n_per_a,
        row.hover_mass_kg.0
    )
}

/// How long a pair lasts with some batteries, and what it lifts beyond the weight.
fn lasts(row: &Row, with: &WithBatteries) -> String {
    format!(
        "{}, {}: {:.1} min at full throttle, resultant force {} N, {:.2} N per A.",
        row.pair.name(),
        counted(with.batteries),
        with.full_throttle_min.0,
        tenths(with.resultant_n.0),
        row.efficiency_n_per_a
    )
}

/// "1 battery", "2 batteries".
fn counted(batteries: u32) -> String {
    format!("{batteries} batter{}", if batteries == 1 { "y" } else { "ies" })
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
        title: format!("{motor} with {}", counted(batteries)),
        x_label: "resultant force at full throttle, N".to_owned(),
        y_label: "min; 10 x N per A".to_owned(),
        layers: vec![
            Layer::Marks { name: "endurance, min".to_owned(), class: "a", marks: minutes },
            Layer::Marks { name: "10 x efficiency, N per A".to_owned(), class: "b", marks: efficiency },
        ],
        ..Figure::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::quantity::{Kilogram, Minute, Newton};
    use crate::sizing::select::{row, thesis};

    const NEED: Need =
        Need { total_thrust_n: Newton(1.0), batteries: 1, full_throttle_min: Minute(0.0), resultant_n: Newton(-1000.0) };

    /// The page of some of the pairs of one motor.
    fn page(motor: &str, pairs: usize) -> (Sheet, Vec<Row>) {
        let airframe = Airframe { bare_kg: Kilogram(0.774), ..Airframe::default() };
        let pairs: Vec<Pair> = thesis().into_iter().filter(|p| p.motor == motor && p.maximum.is_some()).take(pairs).collect();
        let rows: Vec<Row> = pairs.iter().filter_map(|p| row(p, &airframe, 2)).collect();
        (selection(&pairs, &rows, &airframe, (&NEED, 2), &[]), rows)
    }

    /// A lone dot is no figure: its values are said.
    #[test]
    fn one_pair_is_said_and_not_drawn() {
        let (sheet, rows) = page("570KV", 1);
        let html = sheet.html();
        assert!(sheet.drawn().is_empty() && !html.contains("<figure"), "{:?}", sheet.drawn());
        let only = rows.first().expect("a row");
        assert!(html.contains(&at_full_throttle(only)));
        assert_eq!(html.matches(&format!("<p>{}, ", only.pair.name())).count(), 2, "1 battery, 2 batteries");
        assert!(html.contains(", 1 battery: ") && html.contains(", 2 batteries: "));
    }

    #[test]
    fn two_pairs_are_drawn() {
        let (sheet, _) = page("570KV", 2);
        assert_eq!(sheet.drawn().len(), 6);
        assert!(!sheet.html().contains("One pair alone"));
    }
}
