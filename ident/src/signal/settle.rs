//! How long a step takes to settle.
//!
//! What it is: an exponential approach is fitted to the head of a stretch; rows are dropped until what is left of it moves the
//! mean by less than a fifth of its standard error.
//! What can go wrong: an approach that no exponential describes (hunting) is cut where the running median last stands out;
//! at most six tenths of a stretch are dropped.
//! Units: rows.
//! Reference: first-order step response; Beharie 2013, section 5.7.2 ("allowed to reach steady state").

use crate::numeric::order::median;

/// Largest share of a stretch that may be settling.
const LARGEST: f64 = 0.6;
/// Share of the mean's standard error that the rest of the approach may still move it by.
const REST: f64 = 0.2;

/// Robust line through a stretch: level at its middle, slope a row, spread about it.
///
/// The slope comes from the medians of the outer thirds, which no glitch moves.
pub(crate) fn line(z: &[f64]) -> Option<(f64, f64, f64)> {
    let third = z.len() / 3;
    let finite = |v: &[f64]| -> Vec<f64> { v.iter().copied().filter(|v| v.is_finite()).collect() };
    if z.iter().filter(|v| v.is_finite()).take(3).count() < 3 {
        return None;
    }
    let slope = match (finite(&z[..third]), finite(&z[z.len() - third..])) {
        (mut a, mut b) if a.len() >= 3 && b.len() >= 3 => (median(&mut b) - median(&mut a)) / (z.len() - third) as f64,
        _ => 0.0,
    };
    let centre = (z.len() as f64 - 1.0) / 2.0;
    let mut about: Vec<f64> =
        z.iter().enumerate().filter(|(_, v)| v.is_finite()).map(|(i, v)| v - slope * (i as f64 - centre)).collect();
    let level = median(&mut about);
    let mut off: Vec<f64> = about.iter().map(|v| (v - level).abs()).collect();
    let spread = 1.4826 * median(&mut off);
    // more than half of the samples alike: what nine tenths keep to; beyond that a coarse channel has glitches and no noise
    let spread = if spread > 0.0 {
        spread
    } else {
        let rank = off.len() * 9 / 10;
        *off.select_nth_unstable_by(rank, f64::total_cmp).1
    };
    let spread = spread.max(1e-12 * level.abs()).max(1e-12);
    Some((level, slope, spread))
}

/// Rows at the head of `[from, to)` in which a channel is still on its way.
pub(crate) fn rows(t: &[f64], values: &[f64], from: usize, to: usize) -> usize {
    let z = &values[from..to];
    let n = z.len();
    let Some((level, slope, spread)) = line(&z[n / 2..]) else { return 0 };
    if n < 8 {
        return 0;
    }
    let most = (LARGEST * n as f64) as usize;
    // the line of the settled half, carried back, for a drift; flat where the half is too short to tell
    let slope = if n >= 40 { slope } else { 0.0 };
    let centre = (n / 2) as f64 + ((n - n / 2) as f64 - 1.0) / 2.0;
    let off: Vec<f64> = z.iter().enumerate().map(|(i, v)| v - level - slope * (i as f64 - centre)).collect();
    let spread = spread.max(1e-6 * level.abs()).max(1e-12);
    let visible = last_visible(&off[..most], spread);
    let Some((tau, amplitude)) = approach(&t[from..to], &off, spread, visible) else { return visible };
    // rows until the rest of the approach, averaged, is a fifth of the standard error
    let left = (n - visible).max(4) as f64;
    let step = (t[to - 1] - t[from]) / (n - 1) as f64;
    let allowed = REST * spread / left.sqrt();
    let ratio = amplitude.abs() * tau / step / left / allowed;
    let quiet = if ratio > 1.0 { (tau * ratio.ln() / step).ceil() as usize + 1 } else { 0 };
    quiet.max(visible.min(quiet + 4)).min(most)
}

/// Row after the last at which the median of three stands four spreads out.
fn last_visible(off: &[f64], spread: f64) -> usize {
    let stands_out = |k: usize| {
        let mut around: Vec<f64> =
            off[k.saturating_sub(1)..(k + 2).min(off.len())].iter().copied().filter(|v| v.is_finite()).collect();
        !around.is_empty() && median(&mut around).abs() > 4.0 * spread
    };
    // a gap of quiet rows twice as long as what stood out before ends the approach: later excursions are noise of the level
    let (mut last, mut quiet) = (0, 0);
    for k in 0..off.len() {
        if stands_out(k) {
            last = k + 1;
            quiet = 0;
        } else {
            quiet += 1;
            if quiet > 2 * last.max(3) {
                break;
            }
        }
    }
    last
}

/// Time constant (s) and amplitude of the approach; `None` where there is none worth the name.
fn approach(t: &[f64], off: &[f64], spread: f64, visible: usize) -> Option<(f64, f64)> {
    let n = off.len();
    let step = (t[n - 1] - t[0]) / (n - 1) as f64;
    let window = (3 * visible).max(12).min(n);
    let mut best: Option<(f64, f64, f64, f64)> = None;
    for k in 0..24 {
        let tau = step * 0.3 * (0.25 * n as f64 / 0.3).powf(f64::from(k) / 23.0);
        let (mut ee, mut ey, mut yy) = (0.0, 0.0, 0.0);
        for i in (0..window).filter(|i| off[*i].is_finite()) {
            let e = (-(t[i] - t[0]) / tau).exp();
            // a single glitch must not pose as an approach
            let y = off[i].clamp(-1e4 * spread, 1e4 * spread);
            ee += e * e;
            ey += e * y;
            yy += y * y;
        }
        if ee > 0.0 && best.is_none_or(|b| yy - ey * ey / ee < b.0) {
            best = Some((yy - ey * ey / ee, tau, ey / ee, ee));
        }
    }
    let (_, tau, amplitude, ee) = best?;
    (amplitude.abs() * ee.sqrt() > 4.0 * spread).then_some((tau, amplitude))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_of_ten_rows_has_an_approach_too() {
        let t: Vec<f64> = (0..10).map(f64::from).collect();
        let at: Vec<f64> = t.iter().map(|t| 3000.0 - 300.0 * (-t / 0.5).exp() + 0.1 * (t * 2.39).sin()).collect();
        assert!((2..=6).contains(&rows(&t, &at, 0, 10)), "{}", rows(&t, &at, 0, 10));
    }

    #[test]
    fn a_slow_step_takes_longer_and_a_noisy_level_is_no_step() {
        let t: Vec<f64> = (0..300).map(|i| 0.1 * f64::from(i)).collect();
        let wobble = |i: usize| 2.0 * (i as f64 * 2.39).sin();
        let at =
            |tau: f64| -> Vec<f64> { t.iter().enumerate().map(|(i, t)| 3000.0 - 300.0 * (-t / tau).exp() + wobble(i)).collect() };
        let (fast, slow) = (rows(&t, &at(0.2), 0, 300), rows(&t, &at(1.5), 0, 300));
        assert!((4..30).contains(&fast), "{fast}");
        assert!((50..140).contains(&slow), "{slow}");
        let level: Vec<f64> = (0..300).map(|i| 3000.0 + wobble(i)).collect();
        assert!(rows(&t, &level, 0, 300) < 3);
    }
}
