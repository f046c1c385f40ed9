//! Numbers as text, fast.
//!
//! What it is: fixed-point decimals; the general formatter takes most of the time of a long log.
//! What can go wrong: beyond 9e9 the general formatter is used.
//! Units: none.
//! Reference: none.

use std::fmt::Write;

/// Appends `value` with `DIGITS` digits after the point, rounded half away from zero.
pub(crate) fn fixed<const DIGITS: u32>(out: &mut String, value: f64) {
    let scale = 10u64.pow(DIGITS);
    let scaled = value.abs() * scale as f64 + 0.5;
    if value.is_nan() || scaled >= 9e18 || value.abs() > 9e9 {
        let _ = write!(out, "{value:.*}", DIGITS as usize);
        return;
    }
    let scaled = scaled as u64;
    if value < 0.0 && scaled != 0 {
        out.push('-');
    }
    let mut digits = [b'0'; 24];
    let mut at = digits.len();
    let (mut whole, mut rest) = (scaled / scale, scaled % scale);
    // two digits a division
    let mut place = DIGITS;
    while place >= 2 {
        at -= 2;
        digits[at..at + 2].copy_from_slice(&PAIRS[rest as usize % 100]);
        (rest, place) = (rest / 100, place - 2);
    }
    if place == 1 {
        at -= 1;
        digits[at] = b'0' + (rest % 10) as u8;
    }
    at -= 1;
    digits[at] = b'.';
    loop {
        at -= 1;
        digits[at] = b'0' + (whole % 10) as u8;
        whole /= 10;
        if whole == 0 {
            break;
        }
    }
    out.push_str(std::str::from_utf8(&digits[at..]).unwrap_or_default());
}

/// 00 to 99.
const PAIRS: [[u8; 2]; 100] = {
    let mut pairs = [[0; 2]; 100];
    let mut k = 0;
    while k < 100 {
        pairs[k] = [b'0' + (k / 10) as u8, b'0' + (k % 10) as u8];
        k += 1;
    }
    pairs
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_writes_what_the_general_formatter_writes() {
        for value in
            [0.0, -0.0, 1.0, -1.0, 0.5, 0.123_456_78, -179.999_994, 12_345.678_9, -0.000_001, 1e-12, 99.999_999_9, 8e9, 1e12]
        {
            let mut text = String::new();
            fixed::<5>(&mut text, value);
            let mut general = format!("{value:.5}");
            if general.trim_matches(['-', '0', '.']).is_empty() {
                general = general.trim_start_matches('-').to_owned();
            }
            assert_eq!(text, general, "{value}");
        }
    }
}
