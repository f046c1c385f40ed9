//! Least squares of a polynomial.
//!
//! What it is: normal equations on a centred and scaled variable, enough for degrees up to three.
//! What can go wrong: fewer distinct abscissae than coefficients: the surplus coefficients come out as zero.
//! Units: those of the arguments.
//! Reference: any textbook on least squares.

/// Coefficients, constant first.
#[must_use]
pub fn polyfit(x: &[f64], y: &[f64], degree: usize) -> Vec<f64> {
    let m = degree + 1;
    let scale = x.iter().fold(1e-12f64, |s, v| s.max(v.abs()));
    let mut a = vec![vec![0.0; m + 1]; m];
    for (u, v) in x.iter().zip(y) {
        let p: Vec<f64> = (0..m).map(|k| (u / scale).powi(k as i32)).collect();
        for i in 0..m {
            for j in 0..m {
                a[i][j] += p[i] * p[j];
            }
            a[i][m] += p[i] * v;
        }
    }
    let tiny = 1e-12 * x.len() as f64;
    for i in 0..m {
        let pivot = (i..m).max_by(|p, q| a[*p][i].abs().total_cmp(&a[*q][i].abs())).unwrap_or(i);
        a.swap(i, pivot);
        if a[i][i].abs() < tiny {
            continue;
        }
        for r in 0..m {
            if r != i {
                let f = a[r][i] / a[i][i];
                let row = a[i].clone();
                a[r].iter_mut().zip(&row).skip(i).for_each(|(v, p)| *v -= f * p);
            }
        }
    }
    (0..m).map(|i| if a[i][i].abs() < tiny { 0.0 } else { a[i][m] / a[i][i] / scale.powi(i as i32) }).collect()
}

/// Root mean square of what a polynomial leaves over.
#[must_use]
pub fn left_over(x: &[f64], y: &[f64], degree: usize) -> f64 {
    let c = polyfit(x, y, degree);
    let sum: f64 = x.iter().zip(y).map(|(u, v)| (v - super::rig::poly(&c, *u)).powi(2)).sum();
    (sum / x.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_cubic_is_recovered() {
        let x: Vec<f64> = (0..40).map(|i| 0.1 * f64::from(i)).collect();
        let y: Vec<f64> = x.iter().map(|v| 1.0 - 2.0 * v + 0.5 * v * v + 0.25 * v * v * v).collect();
        let c = super::polyfit(&x, &y, 3);
        for (got, want) in c.iter().zip([1.0, -2.0, 0.5, 0.25]) {
            assert!((got - want).abs() < 1e-8, "{c:?}");
        }
        assert!(super::left_over(&x, &y, 3) < 1e-9);
    }
}
