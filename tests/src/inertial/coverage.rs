//! How often a verdict's 95 % intervals hold the truth.
//!
//! What it is: counts by cause and parameter, its axes together, over the logs in which the cause was named.
//! What can go wrong: axes of one log are not independent, so that the printed interval of a share is a little too narrow.
//! Units: shares.
//! Reference: specification `closing-the-loop.md`, "What counts as proof" (90 to 98 %).

use super::{Answer, Tally};
use std::collections::BTreeMap;

/// Counts.
#[derive(Debug, Clone, Default)]
pub struct Coverage {
    tallies: BTreeMap<(String, String), Tally>,
    /// Errors over half widths of the intervals.
    pulls: BTreeMap<(String, String), Vec<f64>>,
}

/// A parameter without its axes.
fn family(name: &str) -> String {
    match name.rsplit_once('_') {
        Some((head, tail)) if !tail.is_empty() && tail.chars().all(|c| "xyz".contains(c)) => head.to_owned(),
        _ => name.to_owned(),
    }
}

impl Coverage {
    /// Adds a verdict that names the cause.
    pub fn add(&mut self, cause: &str, truth: &[(String, f64)], answer: &Answer) {
        for (name, value) in truth {
            let Some((estimate, [low, high])) = answer.parameter(cause, name) else { continue };
            let key = (cause.to_owned(), family(name));
            self.tallies.entry(key.clone()).or_default().add((low..=high).contains(value));
            let half = if *value < estimate { estimate - low } else { high - estimate };
            self.pulls.entry(key).or_default().push((value - estimate).abs() / half.max(1e-300));
        }
    }

    /// Cause, parameter, share inside, and the half width in the place of 1.96 that would hold 95 %.
    pub fn rows(&self) -> impl Iterator<Item = (&str, &str, Tally, f64)> {
        self.tallies.iter().map(|(key, tally)| {
            let mut pulls = self.pulls[key].clone();
            pulls.sort_by(f64::total_cmp);
            let at = ((pulls.len() as f64 * 0.95).ceil() as usize).clamp(1, pulls.len());
            (key.0.as_str(), key.1.as_str(), *tally, pulls[at - 1])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_count_together_and_the_needed_width_is_found() {
        let json: serde_json::Value = serde_json::from_str(
            r#"{"effects": [{"id": "e", "parameters": [{"name": "s_x", "value": 1.0, "ci95": [0.5, 1.5]}, {"name": "s_y", "value": 2.0, "ci95": [1.5, 2.5]}]}]}"#,
        )
        .unwrap();
        let answer = Answer { json, verdict: "attributed".to_owned(), ids: vec!["e".to_owned()] };
        let mut coverage = Coverage::default();
        coverage.add("e", &[("s_x".to_owned(), 1.2), ("s_y".to_owned(), 3.0), ("t0".to_owned(), 1.0)], &answer);
        let rows: Vec<_> = coverage.rows().map(|(c, p, t, w)| (c.to_owned(), p.to_owned(), t.hits, t.of, w)).collect();
        assert_eq!(rows, [("e".to_owned(), "s".to_owned(), 1, 2, 2.0)]);
    }
}
