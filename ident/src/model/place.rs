//! Where a key of a model stands.
//!
//! What it is: line and column of the path that a refusal names (`effect[0].parameter.resistance_ohm`).
//! What can go wrong: a key that is missing has no place of its own; that of the table which lacks it is told.
//! Units: lines and columns from 1.
//! Reference: TOML 1.0.

use toml::de::{DeTable, DeValue};

/// Line and column of the last part of `path` that stands in the text.
pub(super) fn of_key(text: &str, path: &str) -> (usize, usize) {
    of_byte(text, byte_of(text, path).unwrap_or(0))
}

/// Line and column of a byte of `text`.
pub(super) fn of_byte(text: &str, byte: usize) -> (usize, usize) {
    let before = text.get(..byte.min(text.len())).unwrap_or(text);
    (before.matches('\n').count() + 1, before.chars().rev().take_while(|c| *c != '\n').count() + 1)
}

fn byte_of(text: &str, path: &str) -> Option<usize> {
    let root = DeTable::parse(text).ok()?;
    let mut table = root.get_ref();
    let mut at = None;
    for part in path.split('.') {
        let (name, index) = match part.split_once('[') {
            Some((name, index)) => (name, index.strip_suffix(']').and_then(|i| i.parse::<usize>().ok())),
            None => (part, None),
        };
        let Some((key, mut value)) = table.iter().find(|(key, _)| key.get_ref() == name) else { break };
        let mut place = key.span().start;
        if let (Some(index), DeValue::Array(items)) = (index, value.get_ref()) {
            value = items.get(index)?;
            place = value.span().start;
        }
        at = Some(place);
        let DeValue::Table(inner) = value.get_ref() else { break };
        table = inner;
    }
    at
}

#[cfg(test)]
mod tests {
    use super::of_key;

    const TEXT: &str =
        "a = 1\n[channel.rpm]\nc0 = 2\n[[effect]]\nid = \"x\"\n[[effect]]\nid = \"y\"\n  [effect.parameter]\n  tau_s = 3\n";

    #[test]
    fn a_key_is_found_where_it_stands() {
        assert_eq!(of_key(TEXT, "a"), (1, 1));
        assert_eq!(of_key(TEXT, "channel.rpm.c0"), (3, 1));
        assert_eq!(of_key(TEXT, "effect[0].id"), (5, 1));
        assert_eq!(of_key(TEXT, "effect[1].id"), (7, 1));
        assert_eq!(of_key(TEXT, "effect[1].parameter.tau_s"), (9, 3));
    }

    #[test]
    fn a_key_that_is_missing_is_told_at_its_table() {
        assert_eq!(of_key(TEXT, "channel.rpm.c1"), (2, 10));
        assert_eq!(of_key(TEXT, "effect[1].shape"), (6, 1));
        assert_eq!(of_key(TEXT, "start_pulse_us"), (1, 1));
    }
}
