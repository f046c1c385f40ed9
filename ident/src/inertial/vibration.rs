//! `vibration`: what is faster than a body can be carried.
//!
//! What it is: the level of second differences in short windows against the quietest of them, and a line in the averaged spectrum
//! above 15 Hz. A line is predicted by a sinusoid in each window, with the rows that are judged left out; what has no line (knocks,
//! rattling) cannot be predicted, only its level is reported.
//! What can go wrong: above half the sampling rate the frequency is an image of the true one; a vibration of one strength throughout
//! shows only by its line.
//! Units: Hz, m/s^2.
//! Reference: Welch, IEEE Transactions on Audio and Electroacoustics 15(2), 1967.

use super::Recording;
use super::account::{Sensor, by_axis};
use super::noise::{levels, quantile};
use super::search::{NAMED, descending, parameter, reductions};
use super::shown::Shown;
use super::trace::Setting;
use crate::verdict::Scope;
use crate::verdict::{EffectEntry, Kin};
use nalgebra::{Matrix2, Vector2, Vector3};
use std::f64::consts::TAU;

/// Rows of a window of the spectrum, and of one of the sinusoid.
const SPECTRUM: usize = 256;
const WINDOW: usize = 64;
/// Rows of a level.
const LEVEL: usize = 64;
/// Slower than this a body can be carried, Hz.
const LOWEST_HZ: f64 = 15.0;
/// Periods of a line that its figure shows.
const PERIODS: f64 = 30.0;
/// A line stands this far over the median of the spectrum.
const LINE: f64 = 6.0;
/// Share of the error from which on a line is predicted: what changes less counts as no change (specification, "Verdict").
const LEAST_SHARE: f64 = 0.02;
/// Mean square of all windows over that of the quietest, and the same for the loudest twentieth, from which it shakes.
const SHAKES: (f64, f64) = (9.0, 16.0);

/// Names it where it is there; the sensor's prediction takes the line in.
pub(crate) fn shake(recording: &Recording, used: &[bool], setting: &Setting, sensor: &mut Sensor) -> Option<EffectEntry> {
    let rows: Vec<usize> = (0..used.len()).filter(|i| used[*i]).collect();
    let left: Vec<Vector3<f64>> = rows.iter().map(|i| recording.accel[*i] - sensor.corrected[*i]).collect();
    if left.len() < 4 * SPECTRUM {
        return None;
    }
    let steps: Vec<f64> = rows.windows(2).map(|w| recording.t[w[1]] - recording.t[w[0]]).collect();
    let rate = 1.0 / quantile(&steps, 0.5).max(1e-9);
    let level = levels(&left, LEVEL);
    let quiet = quantile(&level, 0.1).max(1e-12);
    let mean = level.iter().map(|l| l * l).sum::<f64>() / level.len() as f64;
    let (all, loud) = (mean / (quiet * quiet), (quantile(&level, 0.95) / quiet).powi(2));
    let (frequency, ratio) = line(&left, rate);
    let has_line = ratio > LINE;
    let shakes = all >= SHAKES.0 && loud >= SHAKES.1;
    if !has_line && !shakes {
        return None;
    }
    let square = |v: &[Vector3<f64>]| v.iter().map(Vector3::norm_squared).sum::<f64>();
    let wave = if has_line { sinusoid(&rows, &left, &recording.t, frequency) } else { vec![Vector3::zeros(); left.len()] };
    let after: Vec<Vector3<f64>> = left.iter().zip(&wave).map(|(l, w)| l - w).collect();
    let reduction = 1.0 - (square(&after) / square(&left).max(1e-300)).sqrt();
    let predicted = has_line && reduction > LEAST_SHARE;
    // a line that removes nothing explains nothing, unless the whole shakes
    if !predicted && !shakes {
        return None;
    }
    let mut added = vec![Vector3::repeat(f64::NAN); used.len()];
    rows.iter().for_each(|i| added[*i] = Vector3::zeros());
    if predicted {
        add(&mut sensor.corrected, &rows, &wave);
        add(&mut added, &rows, &wave);
        sensor.part.line_hz = Some(frequency);
    }
    let seconds = predicted.then(|| PERIODS / frequency);
    // what cannot be predicted is told of the axis that it shakes most
    let flat = |v: &[Vector3<f64>]| -> Vec<f64> { v.iter().flat_map(|v| [v.x, v.y, v.z]).collect() };
    let axes = descending(if predicted { reductions(&flat(&left), &flat(&after)) } else { by_axis(&flat(&left)) });
    sensor.shown.push(Shown { seconds, ..Shown::over_time("vibration", axes[0], &added) });
    let looks = level.len() as f64;
    // a line's own strength: its prediction does not know the noise of the rows that it predicts; second differences would weigh it
    // by its frequency
    let shared = left.iter().zip(&wave).map(|(l, w)| l.dot(w)).sum::<f64>() / (3.0 * left.len() as f64);
    let rms = if has_line { shared.max(0.0).sqrt() } else { (mean - quiet * quiet).max(0.0).sqrt() };
    let mut parameters = vec![
        parameter("rms", rms, "m/s^2", rms / (2.0 * looks).sqrt()),
        parameter("level_ratio", all.sqrt(), "1", all.sqrt() / (2.0 * looks).sqrt()),
    ];
    if has_line {
        parameters.push(parameter("frequency", frequency, "Hz", rate / SPECTRUM as f64 / 3.92));
    }
    let nats = if has_line { nats_of_line(ratio, left.len() / SPECTRUM) } else { nats_of_levels(&level) };
    let line_says = if has_line {
        format!("a line at {frequency:.1} Hz stands {ratio:.0} times over the spectrum")
    } else {
        "no line: its course cannot be predicted, only its strength".to_owned()
    };
    Some(EffectEntry {
        kin: Kin::Own,
        id: "vibration".to_owned(),
        scope: Scope::Run,
        run: None,
        channels: axes.map(|k| setting.channels[k].to_owned()).to_vec(),
        depends_on: vec!["t_s".to_owned()],
        equation: if has_line {
            "f += c cos(2 pi frequency t) + s sin(2 pi frequency t)"
        } else {
            "f += noise of the strength rms"
        }
        .to_owned(),
        probability: 1.0 / (1.0 + (NAMED - nats).exp()),
        parameters,
        heldout_error_reduction: if predicted { reduction } else { 0.0 },
        evidence: format!(
            "above {LOWEST_HZ} Hz the mean strength is {:.1} times that of the quietest tenth, the loudest twentieth {:.1} times; {line_says}",
            all.sqrt(),
            loud.sqrt()
        ),
    })
}

fn add(predicted: &mut [Vector3<f64>], rows: &[usize], wave: &[Vector3<f64>]) {
    for (i, w) in rows.iter().zip(wave) {
        predicted[*i] += w;
    }
}

/// Adds the line of a known frequency to a prediction.
pub(crate) fn add_line(recording: &Recording, used: &[bool], predicted: &mut [Vector3<f64>], frequency: f64) {
    let rows: Vec<usize> = (0..used.len()).filter(|i| used[*i]).collect();
    let left: Vec<Vector3<f64>> = rows.iter().map(|i| recording.accel[*i] - predicted[*i]).collect();
    let wave = sinusoid(&rows, &left, &recording.t, frequency);
    add(predicted, &rows, &wave);
}

/// Evidence for a line, nats: that of a bin whose power, summed over three axes of two quadratures in each window, has another mean than
/// its neighbours', less the choice among all bins.
fn nats_of_line(ratio: f64, windows: usize) -> f64 {
    3.0 * windows as f64 * (ratio - 1.0 - ratio.ln()) - ((SPECTRUM / 2) as f64).ln()
}

/// Evidence for a strength that changes from window to window, nats: a variance for each against one for all, at Schwarz's price.
/// Second differences of neighbours share rows: a third of them counts.
fn nats_of_levels(level: &[f64]) -> f64 {
    let squares: Vec<f64> = level.iter().map(|l| (l * l).max(1e-300)).collect();
    let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    let gain: f64 = squares.iter().map(|s| 0.5 * LEVEL as f64 * (mean / s).ln()).sum();
    gain - 0.5 * level.len() as f64 * (LEVEL as f64).ln()
}

/// The strongest line above [`LOWEST_HZ`] and how far it stands over the median there.
fn line(left: &[Vector3<f64>], rate: f64) -> (f64, f64) {
    let half = SPECTRUM / 2;
    let first = ((LOWEST_HZ / rate * SPECTRUM as f64).ceil() as usize).max(2);
    if first + 8 > half {
        return (0.0, 0.0);
    }
    let windows: Vec<&[Vector3<f64>]> = left.chunks_exact(SPECTRUM).collect();
    let table: Vec<(f64, f64)> = (0..SPECTRUM).map(|k| (TAU * k as f64 / SPECTRUM as f64).sin_cos()).collect();
    let taper: Vec<f64> = (0..SPECTRUM).map(|k| 0.5 - 0.5 * (TAU * (k as f64 + 0.5) / SPECTRUM as f64).cos()).collect();
    let power: Vec<f64> = (first..half)
        .map(|bin| {
            windows
                .iter()
                .map(|w| {
                    let (mut c, mut s) = (Vector3::zeros(), Vector3::zeros());
                    for (k, (v, h)) in w.iter().zip(&taper).enumerate() {
                        let (sin, cos) = table[bin * k % SPECTRUM];
                        c += v * (h * cos);
                        s += v * (h * sin);
                    }
                    c.norm_squared() + s.norm_squared()
                })
                .sum()
        })
        .collect();
    // against the median of the neighbourhood: motion colours the spectrum, a line is narrow
    let stands = |k: usize| {
        let about = &power[k.saturating_sub(12)..(k + 13).min(power.len())];
        power[k] / quantile(about, 0.5).max(1e-300)
    };
    let Some(top) = (0..power.len()).max_by(|a, b| stands(*a).total_cmp(&stands(*b))) else { return (0.0, 0.0) };
    let (a, b, c) = (power[top.saturating_sub(1)].sqrt(), power[top].sqrt(), power[(top + 1).min(power.len() - 1)].sqrt());
    let shift = (0.5 * (a - c) / (a - 2.0 * b + c)).clamp(-0.5, 0.5);
    let shift = if shift.is_finite() { shift } else { 0.0 };
    (rate * ((top + first) as f64 + shift) / SPECTRUM as f64, stands(top))
}

/// A sinusoid in each window; four rows in twenty are predicted by the others.
fn sinusoid(rows: &[usize], left: &[Vector3<f64>], t: &[f64], frequency: f64) -> Vec<Vector3<f64>> {
    let fold = |k: usize| (k / 4) % 5;
    let mut out = vec![Vector3::zeros(); left.len()];
    for start in (0..left.len()).step_by(WINDOW) {
        let end = (start + WINDOW).min(left.len());
        let basis = |k: usize| {
            let (s, c) = (TAU * frequency * (t[rows[k]] - t[rows[start]])).sin_cos();
            Vector2::new(c, s)
        };
        for f in 0..5 {
            let (mut gram, mut rhs) = (Matrix2::identity() * 1e-9, nalgebra::Matrix2x3::zeros());
            for k in (start..end).filter(|k| fold(*k) != f) {
                let b = basis(k);
                gram += b * b.transpose();
                rhs += b * left[k].transpose();
            }
            let fit = gram.cholesky().map_or(nalgebra::Matrix2x3::zeros(), |c| c.solve(&rhs));
            for k in (start..end).filter(|k| fold(*k) == f) {
                out[k] = fit.tr_mul(&basis(k));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_and_predicted() {
        let t: Vec<f64> = (0..4096).map(|i| f64::from(i) / 200.0).collect();
        let left: Vec<Vector3<f64>> = t.iter().map(|t| Vector3::new((TAU * 61.3 * t).sin(), 0.0, 0.3)).collect();
        let (f, ratio) = line(&left, 200.0);
        assert!((f - 61.3).abs() < 0.2 && ratio > LINE, "{f} {ratio}");
        let rows: Vec<usize> = (0..t.len()).collect();
        let wave = sinusoid(&rows, &left, &t, f);
        let worst = (0..4000).map(|i| (wave[i].x - left[i].x).abs()).fold(0.0, f64::max);
        assert!(worst < 0.2, "{worst}");
    }
}
