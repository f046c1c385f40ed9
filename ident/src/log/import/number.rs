//! Numbers as other programs write them: decimal comma, thousands, words for a missing value.
//!
//! What it is: which marks a file uses, from all its cells together, and a cell as a number under these marks.
//! What can go wrong: a file that uses two decimal marks is refused; `1,234` alone is thousands where commas part the fields and 1.234 where
//! semicolons do.
//! Units: none.
//! Reference: Unicode CLDR, number symbols.

use crate::log::FARTHEST;

/// What parts a number's digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Marks {
    /// Before the fraction.
    pub(super) decimal: char,
    /// Between thousands, beside spaces and apostrophes.
    pub(super) group: char,
}

/// Point before the fraction.
pub(super) const POINT: Marks = Marks { decimal: '.', group: ',' };
/// Comma before the fraction.
pub(super) const COMMA: Marks = Marks { decimal: ',', group: '.' };

/// What other programs write where there is no value.
const MISSING: [&str; 18] = [
    "",
    "-",
    "--",
    "---",
    "nan",
    "-nan",
    "inf",
    "-inf",
    "+inf",
    "infinity",
    "-infinity",
    "n/a",
    "na",
    "null",
    "none",
    "#n/a",
    "#div/0!",
    "#value!",
];

/// What a cell holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Cell {
    /// A finite number.
    Number(f64),
    /// Nothing at all.
    Empty,
    /// A word or sign for a missing value.
    Missing,
    /// Something else.
    Text,
}

/// A cell as a number.
pub(super) fn cell(text: &str, marks: Marks) -> Cell {
    let text = text.trim();
    if text.is_empty() {
        return Cell::Empty;
    }
    if text.len() <= 9 && MISSING.contains(&text.to_ascii_lowercase().as_str()) {
        return Cell::Missing;
    }
    // the usual case first
    let plain = marks == POINT && text.bytes().all(|b| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'+' | b'e' | b'E'));
    let parsed = if plain { text.parse().ok() } else { of_marks(text, marks) };
    parsed.filter(|v: &f64| v.is_finite() && v.abs() <= FARTHEST).map_or(Cell::Text, Cell::Number)
}

fn of_marks(text: &str, marks: Marks) -> Option<f64> {
    let text: String = text.chars().map(|c| if c == '\u{2212}' { '-' } else { c }).collect();
    let (mantissa, power) = match text.find(['e', 'E']) {
        Some(at) => (&text[..at], text[at + 1..].parse::<i32>().ok()?),
        None => (text.as_str(), 0),
    };
    let (whole, fraction) = mantissa.split_once(marks.decimal).unwrap_or((mantissa, ""));
    let digits = whole.trim_start_matches(['-', '+']);
    let parts: Vec<&str> = digits.split([marks.group, ' ', '\'', '\u{2019}', '\u{a0}', '\u{202f}']).collect();
    let all_digits = |s: &str| s.bytes().all(|b| b.is_ascii_digit());
    let grouped = parts.len() == 1 || ((1..=3).contains(&parts[0].len()) && parts[1..].iter().all(|p| p.len() == 3));
    let held = parts.iter().all(|p| all_digits(p)) && all_digits(fraction) && digits.len() + fraction.len() > 0;
    let sign = whole.len() - digits.len();
    if !grouped || !held || sign > 1 {
        return None;
    }
    format!("{}{}.{fraction}0e{power}", &whole[..sign], parts.concat()).parse().ok()
}

/// What the cells of a file say of its marks.
#[derive(Debug, Default)]
pub(super) struct Evidence {
    /// Line of the first cell that can only have a decimal comma.
    comma: Option<u64>,
    /// The same of a decimal point.
    point: Option<u64>,
    /// A comma that may be either.
    either: bool,
}

impl Evidence {
    /// Takes a cell of a line into account.
    pub(super) fn add(&mut self, line: u64, text: &str) {
        let text = text.trim();
        let open =
            |c: char| c.is_ascii_digit() || matches!(c, ',' | '.' | '-' | '+' | ' ' | '\'' | '\u{a0}' | '\u{202f}' | 'e' | 'E');
        if !text.contains([',', '.']) || !text.chars().all(open) || !text.contains(|c: char| c.is_ascii_digit()) {
            return;
        }
        let count = |c: char| text.matches(c).count();
        let alone = |marks: Marks| match of_marks(text, Marks { group: '\'', ..marks }) {
            // three digits after a mark may be thousands, unless a nought stands before it
            Some(_) => {
                let (whole, fraction) = text.split_once(marks.decimal).unwrap_or((text, ""));
                let whole = whole.trim_start_matches(['-', '+']);
                Some(fraction.len() == 3 && (1..=3).contains(&whole.len()) && !whole.starts_with('0'))
            }
            None => None,
        };
        match (count(','), count('.')) {
            (1, 0) => match alone(COMMA) {
                Some(true) => self.either = true,
                Some(false) => self.comma = self.comma.or(Some(line)),
                None => {}
            },
            (0, 1) if alone(POINT) == Some(false) => self.point = self.point.or(Some(line)),
            (1.., 1..) if of_marks(text, COMMA).is_some() => self.comma = self.comma.or(Some(line)),
            (1.., 1..) if of_marks(text, POINT).is_some() => self.point = self.point.or(Some(line)),
            _ => {}
        }
    }

    /// The marks of the file, or the lines of two cells that contradict each other.
    pub(super) fn marks(&self, separator: u8) -> Result<Marks, (u64, u64)> {
        match (self.comma, self.point) {
            (Some(a), Some(b)) => Err((a, b)),
            (Some(_), None) => Ok(COMMA),
            (None, Some(_)) => Ok(POINT),
            (None, None) if self.either && separator != b',' => Ok(COMMA),
            (None, None) => Ok(POINT),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_the_field() {
        for (text, marks, wanted) in [
            ("1.5", POINT, Cell::Number(1.5)),
            ("1,5", COMMA, Cell::Number(1.5)),
            ("-1.234,5", COMMA, Cell::Number(-1234.5)),
            ("1,234,567.5", POINT, Cell::Number(1_234_567.5)),
            ("1\u{a0}234,5", COMMA, Cell::Number(1234.5)),
            ("1'234.5", POINT, Cell::Number(1234.5)),
            ("\u{2212}2,5E-3", COMMA, Cell::Number(-0.0025)),
            ("12,34", POINT, Cell::Text),
            ("1.2.3", POINT, Cell::Text),
            ("--5", POINT, Cell::Text),
            ("e5", POINT, Cell::Text),
            ("1e999", POINT, Cell::Text),
            ("-Infinity", POINT, Cell::Missing),
            ("#DIV/0!", POINT, Cell::Missing),
            ("-", COMMA, Cell::Missing),
            (" ", COMMA, Cell::Empty),
            ("off", POINT, Cell::Text),
        ] {
            assert_eq!(cell(text, marks), wanted, "{text}");
        }
    }

    #[test]
    fn all_cells_together_tell_the_marks() {
        let of = |cells: &[&str], separator| {
            let mut evidence = Evidence::default();
            cells.iter().enumerate().for_each(|(k, c)| evidence.add(k as u64 + 2, c));
            evidence.marks(separator)
        };
        assert_eq!(of(&["1,5", "1.234"], b';'), Ok(COMMA));
        assert_eq!(of(&["1.234"], b';'), Ok(POINT));
        assert_eq!(of(&["1,234"], b';'), Ok(COMMA));
        assert_eq!(of(&["1,234"], b','), Ok(POINT));
        assert_eq!(of(&["0,234"], b','), Ok(COMMA));
        assert_eq!(of(&["1,234", "2.5"], b';'), Ok(POINT));
        assert_eq!(of(&["1.234,5"], b';'), Ok(COMMA));
        assert_eq!(of(&["05.11.2019", "17:14:08,9"], b';'), Ok(POINT));
        assert_eq!(of(&["2,5", "2.5"], b';'), Err((2, 3)));
    }
}
