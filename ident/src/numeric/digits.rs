//! The digits that a model's file writes.
//!
//! What it is: a value to the second digit of its standard error and `GUARD` more, the error itself to three, and what has no error to
//! `PLAIN` significant ones. What is written once is read and written again to the same digits.
//! What can go wrong: an error of zero or one that is not known supports no digit less than all that are kept. One larger than its value would cut
//! digits that predictions need.
//! Units: those of the values.
//! Reference: GUM, clause 7.2.6: two digits of an uncertainty, and further ones of values that are used together, against rounding.

/// Digits beyond the second of the standard error. The coefficients of a polynomial are known far better together than each alone: of a cubic over
/// the usual range of loads the smallest eigenvalue of their correlations is about 1e-6, so that a prediction's standard error may be a thousandth
/// of what each coefficient's own would make it. Four terms, each off by half of a unit that is at most a tenth of its error, are off by at most
/// 0.1 of that together; four digits more make it 1e-5, a hundredth of the prediction's own error.
const GUARD: i32 = 4;
/// Significant digits of a standard error.
const OF_ERROR: usize = 3;
/// Significant digits of what has no standard error.
const PLAIN: usize = 9;

/// A value to the digits that its standard error supports. An error larger than the value says that it is known together with others alone, such as the
/// voltage that a power is told at beside the power's size: it counts as one as large as the value.
pub(crate) fn of_value(value: f64, se: f64) -> f64 {
    let se = of_error(if se > value.abs() { value.abs() } else { se });
    if !(se > 0.0 && se.is_finite() && value.is_finite()) {
        return plain(value);
    }
    // the exponent as it is printed: a logarithm would be off at powers of ten
    let printed = format!("{se:e}");
    let exponent: i32 = printed.rsplit('e').next().and_then(|e| e.parse().ok()).unwrap_or(0);
    match usize::try_from(1 + GUARD - exponent) {
        Ok(places) if places < 300 => read(format!("{value:.places$}"), value),
        // a value of which tens or hundreds are open, and one whose error is next to nothing
        _ => plain(value),
    }
}

/// A standard error.
pub(crate) fn of_error(se: f64) -> f64 {
    significant(se, OF_ERROR)
}

/// A value without one.
pub(crate) fn plain(value: f64) -> f64 {
    significant(value, PLAIN)
}

/// To so many significant digits.
pub(crate) fn significant(value: f64, digits: usize) -> f64 {
    if value.is_finite() { read(format!("{value:.*e}", digits.saturating_sub(1)), value) } else { value }
}

/// A lowest value to four digits, no higher than it is; negative and turned a highest one, no lower.
pub(crate) fn lowest(value: f64) -> f64 {
    let near = significant(value, 4);
    // the last of four digits of the value itself: rounded up to a power of ten it has one place less
    let unit = format!("{value:e}").rsplit('e').next().and_then(|e| e.parse::<i32>().ok()).map_or(0.0, |e| 10f64.powi(e - 3));
    if near > value { significant(near - unit, 4) } else { near }
}

/// A number with five significant digits, as tables print it.
#[must_use]
pub fn number(v: f64) -> String {
    if v == 0.0 {
        return "0".to_owned();
    }
    if v.abs() < 1e-3 || v.abs() >= 1e5 { format!("{v:.4e}") } else { format!("{v:.5}") }
}

fn read(text: String, otherwise: f64) -> f64 {
    // no minus before nothing
    text.parse().map_or(otherwise, |v: f64| if v == 0.0 { 0.0 } else { v })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_has_the_digits_of_its_error() {
        for (value, se, written) in [
            (0.123_456_789_012, 0.001_23, 0.123_456_79),
            (8_437.123_456_789, 31.4, 8_437.123_5),
            (-1.0 / 3.0, 0.0996, -0.333_333_3),
            (-1.0 / 3.0, 0.099_96, -0.333_333),
            (2.0 / 3.0, f64::NAN, 0.666_666_667),
            (2.0 / 3.0, 0.0, 0.666_666_667),
            (1.234_567_890_12e9, 4.0e7, 1.234_567_89e9),
            (1e-9, 1.0, 1e-9),
            // a reference that a size beside it makes up for: a tenth of a volt off is a hundredth of the current
            (15.849_912_3, 610_000.0, 15.849_9),
        ] {
            assert_eq!(of_value(value, se), written, "{value} +- {se}");
        }
        assert_eq!((of_error(0.001_234_9), of_error(0.0)), (0.001_23, 0.0));
        assert_eq!((lowest(-0.512_37), -lowest(-0.512_37), lowest(0.0), lowest(9.999_96)), (-0.512_4, 0.512_4, 0.0, 9.999));
    }

    /// Errors at every power of ten and about it: what was written is written the same again, and no value moves by more than its error allows.
    #[test]
    fn what_was_written_is_written_again() {
        for k in 0..4000 {
            let se = 10f64.powf(-9.0 + f64::from(k) * 0.004);
            let value = 100.0 * se * (f64::from(k) * 2.399).sin();
            let (v, s) = (of_value(value, se), of_error(se));
            assert_eq!((of_value(v, s), of_error(s), lowest(lowest(value))), (v, s, lowest(value)), "{value} +- {se}");
            assert!((v - value).abs() <= 1e-5 * se && (s / se - 1.0).abs() < 0.006, "{value} +- {se}");
            assert!(lowest(value) <= value);
        }
    }

    #[test]
    fn small_numbers_keep_their_digits() {
        assert_eq!(number(6.3e-5), "6.3000e-5");
        assert_eq!(number(0.0), "0");
        assert_eq!(number(1.5), "1.50000");
    }
}
