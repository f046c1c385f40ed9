//! Noise of a sensor, from its own readings.
//!
//! What it is: the level of white noise in second differences over short windows, in which motion and slow drift cancel.
//! What can go wrong: a held or interpolated reading looks quieter than it is; only fresh readings should come in.
//! Units: those of the readings.
//! Reference: the second difference of white noise has six times its variance.

use nalgebra::Vector3;

/// Level of each window of `window` readings: root mean square of one axis.
pub(crate) fn levels(readings: &[Vector3<f64>], window: usize) -> Vec<f64> {
    let second: Vec<f64> = readings.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).norm_squared() / 18.0).collect();
    second.chunks(window.max(1)).map(|c| (c.iter().sum::<f64>() / c.len() as f64).sqrt()).collect()
}

/// The quietest tenth of the windows: the sensor itself.
pub(crate) fn floor(levels: &[f64]) -> f64 {
    quantile(levels, 0.1)
}

/// A quantile of finite values; 0 of none.
pub(crate) fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(((sorted.len() as f64 - 1.0).max(0.0) * share).round() as usize).copied().unwrap_or(0.0)
}

/// Share of a reading's step that is noise, of each axis: the level of one axis alone.
pub(crate) fn axis_level(readings: &[Vector3<f64>], axis: usize) -> f64 {
    let second: Vec<f64> = readings.windows(3).map(|w| (w[0][axis] - 2.0 * w[1][axis] + w[2][axis]).powi(2) / 6.0).collect();
    let levels: Vec<f64> = second.chunks(50).map(|c| (c.iter().sum::<f64>() / c.len() as f64).sqrt()).collect();
    floor(&levels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_noise_is_measured_and_motion_is_not() {
        let mut k = 1u64;
        let mut noise = || {
            k = k.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (k >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        // uniform in [-1, 1]: standard deviation 0.577
        let y: Vec<Vector3<f64>> =
            (0..20_000).map(|i| Vector3::from_fn(|_, _| 50.0 * (f64::from(i) * 0.003).sin() + noise())).collect();
        assert!((quantile(&levels(&y, 100), 0.5) - 0.577).abs() < 0.02);
        assert!((axis_level(&y, 1) - 0.52).abs() < 0.06, "{}", axis_level(&y, 1));
    }
}
