//! Why a pair was chosen, and why the others were not.
//!
//! What it is: the needs that a row misses, with the figure and what is needed; the choice in one or two sentences.
//! What can go wrong: nothing; without a pair that meets every need the one that comes nearest is named.
//! Units: N, min, N per A.
//! Reference: Beharie 2013, section 6.1.

use super::{Need, Row};

/// The needs that a row does not meet, in words; none of one that meets all.
#[must_use]
pub fn misses(row: &Row, need: &Need) -> Vec<String> {
    let mut out = Vec::new();
    if row.total_thrust_n < need.total_thrust_n {
        out.push(format!("{:.2} N of {:.2} N in total", row.total_thrust_n.0, need.total_thrust_n.0));
    }
    match row.with_batteries.iter().find(|w| w.batteries == need.batteries) {
        None => out.push(format!("not computed with {} batteries", need.batteries)),
        Some(w) => {
            if w.full_throttle_min < need.full_throttle_min {
                out.push(format!("{:.1} min of {:.1} min at full throttle", w.full_throttle_min.0, need.full_throttle_min.0));
            }
            if w.resultant_n < need.resultant_n {
                out.push(short_of(w.resultant_n.0, need.resultant_n.0));
            }
        }
    }
    out
}

/// What full throttle leaves above the weight, N, against what is needed.
fn short_of(resultant: f64, needed: f64) -> String {
    if resultant >= 0.0 {
        return format!("{resultant:.1} N of {needed:.1} N above the weight");
    }
    let places = if resultant > -0.1 { 2 } else { 1 };
    let above = if needed > 0.0 { format!(", {needed:.1} N above it needed") } else { String::new() };
    format!("full throttle {:.places$} N short of the weight{above}", -resultant)
}

/// A pair's name, and where its figures come from where another row has the same name.
fn named(rows: &[Row], row: &Row) -> String {
    let from = if is_repeated(rows, row) { format!(" ({})", row.pair.source) } else { String::new() };
    format!("{}{from}", row.pair.name())
}

/// Whether another row is of a pair of the same name.
#[must_use]
pub fn is_repeated(rows: &[Row], row: &Row) -> bool {
    let same = |r: &&Row| r.pair.motor == row.pair.motor && r.pair.propeller == row.pair.propeller;
    rows.iter().filter(same).count() > 1
}

/// The choice and its reason.
#[must_use]
pub fn why(rows: &[Row], chosen: &[&Row], need: &Need) -> String {
    let Some(best) = chosen.first() else {
        let nearest = rows.iter().max_by(|a, b| a.total_thrust_n.0.total_cmp(&b.total_thrust_n.0));
        let nearest = nearest
            .map_or_else(String::new, |row| format!("; nearest comes {}: {}", named(rows, row), misses(row, need).join(", ")));
        return format!("choice: none of {} meets every need{nearest}", rows.len());
    };
    let of = if chosen.len() == 1 {
        format!("the only one of {} that meets every need", rows.len())
    } else {
        format!("most thrust for each ampere of the {} that meet every need", chosen.len())
    };
    let runner_up =
        chosen.get(1).map_or_else(String::new, |r| format!("; next {}, {:.2} N per A", named(rows, r), r.efficiency_n_per_a));
    let thrifty = rows
        .iter()
        .filter(|r| r.efficiency_n_per_a > best.efficiency_n_per_a)
        .max_by(|a, b| a.efficiency_n_per_a.total_cmp(&b.efficiency_n_per_a));
    let thrifty = thrifty.map_or_else(String::new, |r| {
        format!("; {} gives {:.2} N per A but {}", named(rows, r), r.efficiency_n_per_a, misses(r, need).join(", "))
    });
    let bound = if best.pair.clipped { "; its thrust reading is clipped, a lower bound" } else { "" };
    format!("choice: {}: {:.2} N per A, {of}{bound}{runner_up}{thrifty}", named(rows, best), best.efficiency_n_per_a)
}

#[cfg(test)]
mod tests {
    use super::super::{Airframe, choose, row, thesis};
    use super::*;
    use crate::log::quantity::{Minute, Newton};

    fn rows() -> Vec<Row> {
        thesis().iter().filter(|p| p.motor == "570KV").filter_map(|p| row(p, &Airframe::default(), 3)).collect()
    }

    #[test]
    fn the_choice_has_its_reasons() {
        let rows = rows();
        let need = Need::default();
        let said = why(&rows, &choose(&rows, &need), &need);
        assert!(said.starts_with("choice: 570KV with 11x4.7: 0.7"), "{said}");
        assert!(
            said.contains("N per A, most thrust for each ampere of the 3 that meet every need; next 570KV with 11x4.5"),
            "{said}"
        );
        assert!(said.contains("570KV with 9x4.5x3 gives 0.94") && said.contains("of 19.62 N in total"), "{said}");
        let patient = Need { full_throttle_min: Minute(8.8), ..need };
        assert!(why(&rows, &choose(&rows, &patient), &patient).contains("the only one of 6 that meets every need"));
    }

    #[test]
    fn what_does_not_lift_itself_falls_short_of_its_weight() {
        assert_eq!(short_of(-4.83, 0.0), "full throttle 4.8 N short of the weight");
        assert_eq!(short_of(-0.04, 0.0), "full throttle 0.04 N short of the weight");
        assert_eq!(short_of(-4.83, 2.0), "full throttle 4.8 N short of the weight, 2.0 N above it needed");
        assert_eq!(short_of(1.5, 2.0), "1.5 N of 2.0 N above the weight");
    }

    #[test]
    fn no_choice_names_what_came_nearest() {
        let rows = rows();
        let need = Need { total_thrust_n: Newton(40.0), ..Need::default() };
        let said = why(&rows, &choose(&rows, &need), &need);
        assert!(said.starts_with("choice: none of 6 meets every need; nearest comes 570KV with 11x4.7: "), "{said}");
        assert!(said.ends_with(" N of 40.00 N in total"), "{said}");
        assert!(misses(&rows[0], &Need { batteries: 9, ..need }).iter().any(|m| m.contains("9 batteries")));
    }
}
