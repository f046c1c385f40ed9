//! A residual that jumps: one level up to an instant, another from there on.
//!
//! What it is: the instant at which two levels, or two shares of the load, hold most of what is left above the noise.
//! What can go wrong: a residual that wanders far has a best instant, too; what it takes away is held against what the best step takes off a
//! random walk.
//! Units: as the residual; positions count its samples.
//! Reference: Page 1955, Biometrika 42:523 (a change at an unknown point); best step of a random walk: simulated, 19 walks of 20.

/// Share of the squares above the noise that two levels hold: more than the best step takes off a random walk in 19 walks of 20, where 0.4 of its size
/// is left.
const HELD: f64 = 1.0 - 0.4 * 0.4;
/// Least share of the samples on either side: a jump is no stretch at an end of the run.
const SIDE: f64 = 0.02;

/// Where a residual jumps: the first sample behind the instant, and whether the jump grows with the load.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Jump {
    pub(crate) from: usize,
    pub(crate) grows: bool,
}

/// The jump of a residual, if it is one; `load` is that of each sample, `floor` the noise, rms.
pub(crate) fn found(residual: &[f64], load: Option<&[f64]>, floor: f64) -> Option<Jump> {
    let level = split(residual, &vec![1.0; residual.len()], floor);
    let share = load.filter(|load| load.len() == residual.len()).and_then(|load| split(residual, load, floor));
    let of = |split: Option<(usize, f64)>, grows: bool| split.map(|(from, held)| (Jump { from, grows }, held));
    let both = of(level, false).into_iter().chain(of(share, true));
    both.filter(|(_, held)| *held > HELD).max_by(|a, b| a.1.total_cmp(&b.1)).map(|(jump, _)| jump)
}

/// The instant at which a regressor's coefficient changes best, and the share of the squares above the noise that the change takes.
fn split(residual: &[f64], regressor: &[f64], floor: f64) -> Option<(usize, f64)> {
    let n = residual.len();
    let side = ((SIDE * n as f64).ceil() as usize).max(2);
    let sums: Vec<[f64; 2]> = residual
        .iter()
        .zip(regressor)
        .scan([0.0, 0.0], |[product, square], (r, g)| {
            (*product, *square) = (*product + r * g, *square + g * g);
            Some([*product, *square])
        })
        .collect();
    let [product, square] = *sums.last()?;
    let taken = |product: f64, square: f64| if square > 0.0 { product * product / square } else { 0.0 };
    let whole = taken(product, square);
    let left = residual.iter().map(|r| r * r).sum::<f64>() - whole - n as f64 * floor * floor;
    let at = |k: usize| {
        let [before, of_before] = sums[k - 1];
        taken(before, of_before) + taken(product - before, square - of_before) - whole
    };
    let (from, gain) = (side..n.saturating_sub(side)).map(|k| (k, at(k))).max_by(|a, b| a.1.total_cmp(&b.1))?;
    // less than the noise itself has no shape that anybody could see
    (left > n as f64 * floor * floor).then_some((from, gain / left))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(i: usize) -> f64 {
        // uniform, rms 1
        12_f64.sqrt() * ((0.618_034 * (i * i) as f64).fract() - 0.5)
    }

    #[test]
    fn a_jump_is_told_with_its_instant() {
        let load: Vec<f64> = (0..1000).map(|i| 1.0 + ((i / 50) % 10) as f64).collect();
        let level: Vec<f64> = (0..1000).map(|i| noise(i) + if i < 640 { 0.0 } else { 6.0 }).collect();
        let jump = found(&level, Some(&load), 1.0).expect("a jump");
        assert!(jump.from.abs_diff(640) < 3 && !jump.grows, "{jump:?}");
        let share: Vec<f64> = (0..1000).map(|i| noise(i) + if i < 300 { 0.0 } else { 1.5 * load[i] }).collect();
        let jump = found(&share, Some(&load), 1.0).expect("a jump");
        assert!(jump.from.abs_diff(300) < 3 && jump.grows, "{jump:?}");
    }

    #[test]
    fn what_wanders_or_is_noise_is_no_jump() {
        let quiet: Vec<f64> = (0..1000).map(noise).collect();
        assert_eq!(found(&quiet, None, 1.0), None);
        let slope: Vec<f64> = (0..1000).map(|i| 0.02 * (i as f64 - 500.0) + noise(i)).collect();
        assert_eq!(found(&slope, None, 1.0), None);
        let wave: Vec<f64> = (0..1000).map(|i| 10.0 * (0.02 * i as f64).sin() + noise(i)).collect();
        assert_eq!(found(&wave, None, 1.0), None);
        assert_eq!(found(&[], None, 1.0), None);
    }
}
