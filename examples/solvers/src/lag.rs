//! A run's load, and what a first-order lag makes of it.
//!
//! What it is: a staircase up and down, and the same behind a lag with its derivative.
//! What can go wrong: nothing; a time constant is positive.
//! Units: s.
//! Reference: Beharie 2013, section 5.7 (creep of a load cell).

/// Rows of a run.
pub const ROWS: usize = 6000;
/// Time between rows, s.
pub const STEP: f64 = 0.05;

/// The load: levels of ten seconds, up and down, from 0 to 1.
pub fn load() -> Vec<f64> {
    let level = |row: usize| {
        let k = (row as f64 * STEP / 10.0) as i32;
        let k = k.rem_euclid(20);
        f64::from(if k < 10 { k } else { 20 - k }) / 10.0
    };
    (0..ROWS).map(level).collect()
}

/// The load behind a lag, and its derivative with the logarithm of the time constant.
pub fn lagged(load: &[f64], log_tau: f64) -> (Vec<f64>, Vec<f64>) {
    let tau = log_tau.exp();
    let keep = (-STEP / tau).exp();
    let more = keep * STEP / tau; // d keep / d ln tau
    let (mut y, mut slope) = (load[0], 0.0);
    load.iter()
        .map(|f| {
            slope = keep * slope + more * (y - f);
            y = keep * y + (1.0 - keep) * f;
            (y, slope)
        })
        .unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_is_the_difference() {
        let load = load();
        let at = |l: f64| lagged(&load, l).0;
        let (up, down, slope) = (at(1.0 + 1e-6), at(1.0 - 1e-6), lagged(&load, 1.0).1);
        let off = (0..ROWS).map(|i| ((up[i] - down[i]) / 2e-6 - slope[i]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-6, "{off}");
    }
}
