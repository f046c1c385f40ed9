//! Operators on a column over uneven time: moving average, first-order lag, delay.
//!
//! What it is: what slow and late meters do to a signal, exactly for piecewise linear signals.
//! What can go wrong: before the first row the signal is taken to have stood at its first value.
//! Units: seconds.
//! Reference: moving averages through prefix integrals; first-order hold for the lag.

/// Mean over the window that ends at each row.
pub(crate) fn moving_average(t: &[f64], x: &[f64], window: f64) -> Vec<f64> {
    if window <= 0.0 || t.len() < 2 {
        return x.to_vec();
    }
    let mut integral = Vec::with_capacity(t.len());
    let mut sum = 0.0;
    integral.push(0.0);
    for i in 1..t.len() {
        sum += 0.5 * (x[i] + x[i - 1]) * (t[i] - t[i - 1]);
        integral.push(sum);
    }
    let mut j = 0;
    (0..t.len())
        .map(|i| {
            let start = t[i] - window;
            let head = if start < t[0] {
                x[0] * (start - t[0])
            } else {
                while j + 1 < t.len() && t[j + 1] <= start {
                    j += 1;
                }
                let h = start - t[j];
                let slope = if j + 1 < t.len() { (x[j + 1] - x[j]) / (t[j + 1] - t[j]) } else { 0.0 };
                integral[j] + x[j] * h + 0.5 * slope * h * h
            };
            (integral[i] - head) / window
        })
        .collect()
}

/// First-order lag with time constant `tau`, exact for a signal that is linear between rows.
pub(crate) fn first_order(t: &[f64], x: &[f64], tau: f64) -> Vec<f64> {
    first_order_varying(t, x, |_| tau)
}

/// First-order lag whose time constant may differ from row to row.
pub(crate) fn first_order_varying(t: &[f64], x: &[f64], tau: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut out = Vec::with_capacity(t.len());
    let mut state = x.first().copied().unwrap_or(0.0);
    for i in 0..t.len() {
        if i > 0 {
            let tau = tau(i);
            if tau <= 1e-9 {
                state = x[i];
            } else {
                let h = (t[i] - t[i - 1]) / tau;
                let e = (-h).exp();
                // first-order hold: u(s) = x0 + (x1 - x0) s/h
                let ramp = if h > 1e-6 { 1.0 - (1.0 - e) / h } else { h / 2.0 };
                state = e * state + (1.0 - e) * x[i - 1] + ramp * (x[i] - x[i - 1]);
            }
        }
        out.push(state);
    }
    out
}

/// The signal `delay` seconds ago (ahead when negative), linear between rows.
pub(crate) fn delayed(t: &[f64], x: &[f64], delay: f64) -> Vec<f64> {
    delayed_varying(t, x, |_| delay)
}

/// The signal as long ago as `delay` says at each instant.
pub(crate) fn delayed_varying(t: &[f64], x: &[f64], delay: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut j = 0;
    (0..t.len())
        .map(|i| {
            let at = t[i] - delay(t[i]);
            if at <= t[0] {
                return x[0];
            }
            if at >= t[t.len() - 1] {
                return x[x.len() - 1];
            }
            if t[j] > at {
                j = 0;
            }
            while j + 1 < t.len() && t[j + 1] <= at {
                j += 1;
            }
            let u = (at - t[j]) / (t[j + 1] - t[j]);
            x[j] + u * (x[j + 1] - x[j])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> (Vec<f64>, Vec<f64>) {
        let t: Vec<f64> = (0..200).map(|i| f64::from(i) * 0.05 + if i % 3 == 0 { 0.01 } else { 0.0 }).collect();
        let x = t.iter().map(|v| 2.0 * v).collect();
        (t, x)
    }

    #[test]
    fn a_ramp_is_late_by_half_the_window_by_tau_and_by_the_delay() {
        let (t, x) = ramp();
        let i = 180;
        assert!((moving_average(&t, &x, 0.8)[i] - 2.0 * (t[i] - 0.4)).abs() < 1e-9);
        assert!((first_order(&t, &x, 0.3)[i] - 2.0 * (t[i] - 0.3)).abs() < 1e-6);
        assert!((delayed(&t, &x, 0.27)[i] - 2.0 * (t[i] - 0.27)).abs() < 1e-9);
        assert!((delayed(&t, &x, -0.27)[100] - 2.0 * (t[100] + 0.27)).abs() < 1e-9);
    }

    #[test]
    fn a_constant_stays() {
        let (t, _) = ramp();
        let x = vec![3.5; t.len()];
        for y in [moving_average(&t, &x, 1.3), first_order(&t, &x, 0.4), delayed(&t, &x, 0.9)] {
            assert!(y.iter().all(|v| (v - 3.5).abs() < 1e-9));
        }
    }
}
