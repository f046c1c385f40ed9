//! Bars and trends as characters.
//!
//! What it is: a bar in eighths of a cell, a trend in eight heights; plain ones for terminals that show no others.
//! What can go wrong: nothing; a value beyond the ends lies at the end.
//! Units: share of the width, 0 to 1.
//! Reference: Unicode block elements, U+2581 to U+258F.

/// What a terminal can show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Glyphs {
    /// Block elements.
    Blocks,
    /// ASCII.
    Plain,
}

/// Heights of a trend.
const HEIGHTS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
const PLAIN_HEIGHTS: [char; 8] = ['_', '_', '.', '.', '-', '-', '^', '^'];
/// Parts of a cell, in eighths from the left.
const EIGHTHS: [char; 7] = ['▏', '▎', '▍', '▌', '▋', '▊', '▉'];

impl Glyphs {
    /// What the locale of this process promises.
    pub(crate) fn of_locale() -> Self {
        let set = |name: &str| std::env::var(name).ok().filter(|v| !v.is_empty());
        let locale = set("LC_ALL").or_else(|| set("LC_CTYPE")).or_else(|| set("LANG")).unwrap_or_default().to_lowercase();
        if locale.contains("utf-8") || locale.contains("utf8") { Self::Blocks } else { Self::Plain }
    }

    /// A bar of `width` cells.
    pub(crate) fn bar(self, share: f64, width: usize) -> String {
        let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
        let eighths = (share * 8.0 * width as f64).round() as usize;
        let (full, rest) = (eighths / 8, eighths % 8);
        match self {
            Self::Blocks => {
                let part = rest.checked_sub(1).and_then(|k| EIGHTHS.get(k));
                let filled: String = std::iter::repeat_n('█', full).chain(part.copied()).collect();
                let used = full + usize::from(rest > 0);
                filled + &" ".repeat(width - used)
            }
            Self::Plain => "#".repeat(full + usize::from(rest >= 4)) + &".".repeat(width - full - usize::from(rest >= 4)),
        }
    }

    /// A trend, one character a value; `least` is the smallest range that fills the height.
    pub(crate) fn trend(self, values: &[Option<f64>], least: f64) -> String {
        let known = || values.iter().flatten().copied();
        let (low, high) = known().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let range = (high - low).max(least).max(f64::MIN_POSITIVE);
        let from = low - 0.5 * (range - (high - low)).max(0.0);
        let heights = if self == Self::Blocks { HEIGHTS } else { PLAIN_HEIGHTS };
        let glyph = |v: f64| heights[(((v - from) / range * 8.0) as usize).min(7)];
        values.iter().map(|v| v.map_or(' ', glyph)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_exact_to_an_eighth_and_as_wide_as_asked() {
        assert_eq!(Glyphs::Blocks.bar(0.5, 4), "██  ");
        assert_eq!(Glyphs::Blocks.bar(0.28, 4), "█▏  ");
        assert_eq!(Glyphs::Blocks.bar(7.0, 3), "███");
        assert_eq!(Glyphs::Blocks.bar(f64::NAN, 3), "   ");
        assert_eq!(Glyphs::Plain.bar(0.5, 4), "##..");
        for share in [0.0, 0.01, 0.124, 0.99, 1.0] {
            for glyphs in [Glyphs::Blocks, Glyphs::Plain] {
                assert_eq!(glyphs.bar(share, 11).chars().count(), 11, "{share}");
            }
        }
    }

    #[test]
    fn a_trend_fills_its_height_but_noise_does_not() {
        assert_eq!(Glyphs::Blocks.trend(&[Some(0.0), None, Some(7.0), Some(3.5)], 0.0), "▁ █▅");
        assert_eq!(Glyphs::Blocks.trend(&[Some(5.0), Some(5.1)], 10.0), "▄▅");
        assert_eq!(Glyphs::Plain.trend(&[Some(0.0), Some(1.0)], 0.0), "_^");
    }
}
