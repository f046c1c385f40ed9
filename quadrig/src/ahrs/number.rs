//! Decimals from text, fast.
//!
//! What it is: a number of at most fifteen digits without exponent is an integer over a power of ten, both exact in a double, so that
//! one division rounds correctly; everything else goes to the general parser.
//! What can go wrong: a word that is no number gives nothing.
//! Units: none.
//! Reference: Clinger, *How to read floating point numbers accurately*, PLDI 1990 (the fast path).

/// Powers of ten that a double holds exactly.
const TENS: [f64; 16] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// The number that a word stands for.
pub(super) fn parse(word: &[u8]) -> Option<f64> {
    plain(word).or_else(|| std::str::from_utf8(word).ok()?.parse().ok())
}

fn plain(word: &[u8]) -> Option<f64> {
    let (negative, digits) = match word {
        [b'-', rest @ ..] => (true, rest),
        _ => (false, word),
    };
    let (mut whole, mut count, mut decimals, mut point) = (0u64, 0usize, 0usize, false);
    for byte in digits {
        match byte {
            b'0'..=b'9' => {
                whole = whole * 10 + u64::from(byte - b'0');
                count += 1;
                decimals += usize::from(point);
                if count > 15 {
                    return None;
                }
            }
            b'.' if !point => point = true,
            _ => return None,
        }
    }
    let value = whole as f64 / TENS.get(decimals).filter(|_| count > 0)?;
    Some(if negative { -value } else { value })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_reads_what_the_general_parser_reads() {
        for word in ["0", "-0", "1", "-1.5", "0.0035", "123456.789012", "-9.80665", ".5", "5.", "1e-3", "-2.5E4", "nan", "inf"] {
            let (fast, general) = (parse(word.as_bytes()), word.parse::<f64>().ok());
            assert_eq!(fast.map(f64::to_bits), general.map(f64::to_bits), "{word}");
        }
        for word in ["", "-", ".", "1.2.3", "1_0", "six", "--1", "123456789.0123456789x"] {
            assert_eq!(parse(word.as_bytes()), None, "{word}");
        }
        let mut k = 1u64;
        for _ in 0..20_000 {
            k = k.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let word = format!("{:.*}", (k >> 60) as usize, (k >> 33) as f64 / 1e4 - 1e5);
            assert_eq!(parse(word.as_bytes()).map(f64::to_bits), word.parse().ok().map(f64::to_bits), "{word}");
        }
    }
}
