//! Sizes of effects that a rig can have, and onsets within the run.
//!
//! What it is: a range for each key of an `[[effect]]` whose values have an end in physics, and the run's length for what begins in it.
//! What can go wrong: a size outside is refused where it stands, with the range and what was found.
//! Units: those of the key.
//! Reference: docs/scenario.md.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Where, and what was expected.
type Refusal = (usize, String);

/// Values that a key may have.
struct Range {
    keys: &'static [&'static str],
    low: f64,
    high: f64,
    /// The lowest is none of them.
    above: bool,
    words: &'static str,
}

/// A lead of 100 ohm starts no motor; a propeller has no thrust left at -1, and none grows to ten times its own.
const RANGES: [Range; 6] = [
    Range { keys: &["resistance_ohm"], low: 0.0, high: 100.0, above: false, words: "a resistance from 0 to 100 ohm" },
    Range {
        keys: &["thrust_change", "torque_change"],
        low: -1.0,
        high: 10.0,
        above: true,
        words: "a change from above -1 (all of it) to 10",
    },
    Range { keys: &["capacity_ah"], low: 0.0, high: 1000.0, above: true, words: "a charge above 0 and up to 1000 A.h" },
    Range { keys: &["charge", "probability", "slip", "share"], low: 0.0, high: 1.0, above: false, words: "a share from 0 to 1" },
    Range {
        keys: &["tau_s", "tau_up_s", "tau_down_s"],
        low: 0.0,
        high: 86_400.0,
        above: false,
        words: "a time constant from 0 to 86400 s",
    },
    Range {
        keys: &["constant_nm", "viscous_nms", "friction_nm"],
        low: 0.0,
        high: f64::INFINITY,
        above: false,
        words: "a friction not below 0",
    },
];

/// Refuses an effect of a size that nothing has.
pub(super) fn sizes(text: &str) -> Result<(), Refusal> {
    numbers(text, &["effect"], |key, value| {
        let range = RANGES.iter().find(|range| range.keys.contains(&key))?;
        let is_within = value <= range.high && if range.above { value > range.low } else { value >= range.low };
        (!is_within).then(|| range.words.to_owned())
    })
}

/// Refuses a fault that ends before it begins.
pub(super) fn windows(text: &str) -> Result<(), Refusal> {
    let Ok(table) = DeTable::parse(text) else { return Ok(()) };
    let faults = table.get_ref().get("fault").and_then(|list| list.get_ref().as_array());
    let number = |value: &Spanned<DeValue<'_>>| text.get(value.span())?.replace('_', "").parse::<f64>().ok();
    for fault in faults.into_iter().flatten().filter_map(|item| item.get_ref().as_table()) {
        let of = |key: &str| fault.get(key).and_then(|value| Some((value.span().start, number(value)?)));
        if let (Some((_, from)), Some((place, until))) = (of("from_s"), of("until_s"))
            && until <= from
        {
            return Err((place, format!("until_s: expected an end after from_s = {from}, found {until}")));
        }
    }
    Ok(())
}

/// Refuses what begins when a run of `run_s` is over.
pub(super) fn onsets(text: &str, run_s: f64) -> Result<(), Refusal> {
    numbers(text, &["effect", "fault"], |key, value| {
        let is_late = ["t0_s", "from_s"].contains(&key) && value >= run_s;
        is_late.then(|| format!("an onset within the run, before {run_s} s"))
    })
}

/// Asks of each number in the tables of these lists what was expected in its place.
fn numbers(text: &str, lists: &[&str], expected: impl Fn(&str, f64) -> Option<String>) -> Result<(), Refusal> {
    // what is no TOML is refused elsewhere
    let Ok(table) = DeTable::parse(text) else { return Ok(()) };
    let of_list = |name: &str| table.get_ref().get(name).and_then(|list| list.get_ref().as_array());
    let tables = lists.iter().filter_map(|name| of_list(name)).flatten().filter_map(|item| item.get_ref().as_table());
    let wrong = |key: &str, value: &Spanned<DeValue<'_>>| {
        let number = text.get(value.span())?.replace('_', "").parse::<f64>().ok()?;
        Some((value.span().start, format!("{key}: expected {}, found {number}", expected(key, number)?)))
    };
    let all = tables.flat_map(|table| table.iter()).filter_map(|(key, value)| wrong(key.get_ref(), value));
    all.min_by_key(|(place, _)| *place).map_or(Ok(()), Err)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_that_nothing_has_is_refused_where_it_stands() {
        for (text, place, said) in [
            ("resistance_ohm = -0.08", 17, "from 0 to 100 ohm, found -0.08"),
            ("thrust_change = -1.5", 16, "above -1 (all of it) to 10, found -1.5"),
            ("torque_change = -1", 16, "found -1"),
            ("charge = 1.1", 9, "a share from 0 to 1, found 1.1"),
        ] {
            for head in ["[[effect]]\n", "seed = 1\n[[effect]]\nid = \"gain_change\"\n[[effect]]\n"] {
                let (at, reason) = sizes(&format!("{head}{text}\n")).expect_err(text);
                assert!(at == head.len() + place && reason.contains(said), "{at}: {reason}");
            }
        }
        assert_eq!(sizes("[[effect]]\nresistance_ohm = 0\nthrust_change = -0.99\noffset_n = -3\n"), Ok(()));
        assert_eq!(sizes("[supply]\nresistance_ohm = -3\n"), Ok(()), "a section has its own range");
    }

    #[test]
    fn a_fault_that_ends_before_it_begins_is_refused() {
        let text = "[[fault]]\nid = \"link_lost\"\nfrom_s = 5\nuntil_s = 3\n";
        let (place, reason) = windows(text).expect_err("it ends first");
        assert!(text[place..].starts_with('3') && reason == "until_s: expected an end after from_s = 5, found 3", "{reason}");
        assert_eq!(windows("[[fault]]\nfrom_s = 5\nuntil_s = 6\n"), Ok(()));
    }

    #[test]
    fn what_begins_after_the_run_is_refused() {
        let of = |text: &str| onsets(text, 172.0);
        assert_eq!(of("[[effect]]\nt0_s = 171.9\n[[fault]]\nfrom_s = 12\nuntil_s = 4000\n"), Ok(()));
        for text in ["[[effect]]\nt0_s = 4000\n", "[[fault]]\nfrom_s = 4_000.0\n"] {
            let (_, reason) = of(text).expect_err(text);
            assert!(reason.ends_with("expected an onset within the run, before 172 s, found 4000"), "{reason}");
        }
    }
}
