//! The smooth part of a series, each stretch predicted from its neighbours alone.
//!
//! What it is: a local parabola with a bell of weights, without the stretch that it predicts, so that noise predicts nothing and
//! only what is slow against the stretch comes back.
//! What can go wrong: at gaps and ends fewer neighbours carry the parabola; where they are too few the prediction is zero.
//! Units: those of the series; s.
//! Reference: Fan & Gijbels, *Local Polynomial Modelling*, 1996; leave-out validation, Stone, JRSS B 36, 1974.

use nalgebra::{Matrix3, Vector3};

/// Predictions of a series at its own times; `width_s` is the bell's standard deviation.
pub(crate) fn predict(t: &[f64], y: &[Vector3<f64>], stretch_s: f64, width_s: f64) -> Vec<Vector3<f64>> {
    let stretch = |x: f64| (x / stretch_s).floor() as i64;
    let mut from = 0;
    let mut out = Vec::with_capacity(t.len());
    for (i, now) in t.iter().enumerate() {
        while t[from] < now - 3.0 * width_s {
            from += 1;
        }
        let (mut gram, mut rhs) = (Matrix3::zeros(), Matrix3::zeros());
        for j in (from..t.len()).take_while(|j| t[*j] <= now + 3.0 * width_s) {
            if stretch(t[j]) == stretch(t[i]) {
                continue;
            }
            let x = (t[j] - now) / width_s;
            let powers = Vector3::new(1.0, x, x * x);
            let w = (-0.5 * x * x).exp();
            gram += w * powers * powers.transpose();
            rhs += w * powers * y[j].transpose();
        }
        gram += Matrix3::from_diagonal(&Vector3::new(1e-6, 1e-6, 1e-6));
        let fit = gram.cholesky().map_or(Matrix3::zeros(), |c| c.solve(&rhs));
        out.push(fit.row(0).transpose());
    }
    out
}

/// A series between its times, along straight lines; the ends hold.
pub(crate) fn between(t: &[f64], y: &[Vector3<f64>], at: f64) -> Vector3<f64> {
    let k = t.partition_point(|x| *x <= at);
    match (k.checked_sub(1), t.get(k)) {
        (Some(a), Some(right)) => y[a] + (y[k] - y[a]) * ((at - t[a]) / (right - t[a])),
        (Some(a), None) => y[a],
        (None, Some(_)) => y[0],
        (None, None) => Vector3::zeros(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_waves_come_back_and_noise_does_not() {
        let t: Vec<f64> = (0..2000).map(|i| f64::from(i) * 0.025).collect();
        let wave: Vec<Vector3<f64>> = t.iter().map(|t| Vector3::new((3.0 * t).sin(), (5.0 * t).cos(), 0.0)).collect();
        let back = predict(&t, &wave, 0.05, 0.1);
        let worst = (20..1980).map(|i| (back[i] - wave[i]).norm()).fold(0.0, f64::max);
        assert!(worst < 0.02, "{worst}");
        let mut k = 1u64;
        let noise: Vec<Vector3<f64>> = t
            .iter()
            .map(|_| {
                Vector3::from_fn(|_, _| {
                    k = k.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    (k >> 11) as f64 / (1u64 << 52) as f64 - 1.0
                })
            })
            .collect();
        let back = predict(&t, &noise, 0.05, 0.1);
        let square = |left: &dyn Fn(usize) -> Vector3<f64>| (0..2000).map(|i| left(i).norm_squared()).sum::<f64>();
        assert!(square(&|i| noise[i] - back[i]) > square(&|i| noise[i]), "noise is not predicted");
        assert_eq!(between(&[0.0, 1.0], &[Vector3::zeros(), Vector3::x()], 0.25).x, 0.25);
    }
}
