//! Offset and drift to milliseconds and parts per million.
//!
//! What it is: the second log as gain times the stand's plus a constant, both through the same smoother, at a clock that is shifted and
//! stretched: weighted least squares from wide smoothing to narrow. Glitches count little (Tukey's biweight).
//! What can go wrong: a minimum that is none, too few samples: no fit. Errors come from 24 pieces of the overlap, so that neither noise nor
//! a sensor's lag has to be known.
//! Units: s; ratio for the drift.
//! Reference: Huber & Ronchetti, "Robust Statistics", 2009; Cameron & Miller 2015 (errors by clusters).

use super::signal::Pair;
use crate::numeric::order::median;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

/// Widths of the smoother, in steps of the slower log, widest first.
const WIDTHS: [f64; 4] = [12.0, 4.0, 1.5, 0.75];
/// Rounds at each width.
const ROUNDS: usize = 12;
/// Pieces of the overlap whose errors are taken as independent.
const PIECES: usize = 24;
/// Tukey's constant.
const TUKEY: f64 = 4.685;
/// Half width of a 95 % interval in standard errors. Pieces are few and their steps differ in size: in simulation the truth scatters 1.6 times as
/// wide as they say, so that Student's 2.07 held it in four cases of five (`two_hundred_clocks`).
const STUDENT: f64 = 3.2;
/// Largest drift that is looked for.
const DRIFT: f64 = 0.003;

/// A fit of one pair.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    /// Added to the second clock at the pivot, s.
    pub(super) offset: f64,
    /// Slowness of the second clock.
    pub(super) drift: f64,
    /// Time of the second clock where the offset holds.
    pub(super) pivot: f64,
    /// What both saw, on the second clock.
    pub(super) span: (f64, f64),
    /// Correlation of the smoothed two.
    pub(super) correlation: f64,
    gain: f64,
    base: f64,
    scale: f64,
    width: f64,
    /// Covariance of offset and drift.
    cov: Matrix2<f64>,
    pieces: Vec<[f64; 3]>,
}

/// A sample in the fit: time from the pivot, residual, derivative by the offset, value of the stand's, weight.
struct Row {
    d: f64,
    residual: f64,
    slope: f64,
    value: f64,
    weight: f64,
}

impl Fit {
    /// Stand time of a time of the second clock.
    pub(super) fn at(&self, t: f64) -> f64 {
        t + self.offset + self.drift * (t - self.pivot)
    }

    /// Share of the variance that is left.
    pub(super) fn left(&self) -> f64 {
        (1.0 - self.correlation * self.correlation).max(1e-9)
    }

    /// Half widths of the 95 % intervals: offset, drift, and the clock at the worse end of the overlap.
    pub(super) fn half_widths(&self) -> (f64, f64, f64) {
        let at = |d: f64| (self.cov[(0, 0)] + 2.0 * d * self.cov[(0, 1)] + d * d * self.cov[(1, 1)]).max(0.0).sqrt();
        let ends = at(self.span.0 - self.pivot).max(at(self.span.1 - self.pivot));
        (STUDENT * at(0.0), STUDENT * self.cov[(1, 1)].max(0.0).sqrt(), STUDENT * ends)
    }

    /// Pieces on the stand's clock.
    pub(super) fn pieces(&self) -> Vec<[f64; 3]> {
        self.pieces.iter().map(|[t, later, se]| [self.at(*t), *later, *se]).collect()
    }

    fn rows(&self, pair: &Pair, smooth: &[(f64, f64)]) -> Vec<Row> {
        let row = |(t, y): &(f64, f64)| {
            let (value, slope) = pair.stand.at(self.at(*t), self.width)?;
            Some(Row {
                d: t - self.pivot,
                residual: y - self.gain * value - self.base,
                slope: self.gain * slope,
                value,
                weight: 1.0,
            })
        };
        smooth.iter().filter_map(row).collect()
    }
}

/// Times at which both are compared, and the second log smoothed there.
fn smoothed(pair: &Pair, offset: f64, width: f64) -> Vec<(f64, f64)> {
    let (a, b) = (&pair.stand, &pair.other);
    let (from, to) = ((a.t[0] - offset).max(b.t[0]), (a.t[a.t.len() - 1] - offset).min(b.t[b.t.len() - 1]));
    let step = 0.5 * a.step.max(b.step).max(width);
    let count = if to > from { ((to - from) / step) as usize } else { 0 };
    (0..count).map(|k| from + (k as f64 + 0.5) * step).filter_map(|t| Some((t, b.at(t, width)?.0))).collect()
}

/// Weights of the rows by their residuals; gives the scale.
fn weigh(rows: &mut [Row]) -> f64 {
    let mut sizes: Vec<f64> = rows.iter().map(|r| r.residual.abs()).collect();
    // most rows lie on levels, where the two agree to the noise: steps would be cut away by that scale
    sizes.sort_unstable_by(f64::total_cmp);
    let scale = (median(&mut sizes.clone()) / 0.6745).max(sizes[sizes.len() * 95 / 100] / 1.96).max(1e-12);
    for r in rows {
        let u = r.residual / (TUKEY * scale);
        r.weight = if u.abs() < 1.0 { (1.0 - u * u).powi(2) } else { 0.0 };
    }
    scale
}

/// Fits a pair from a lag.
pub(super) fn fit(pair: &Pair, lag: f64) -> Option<Fit> {
    let slower = pair.stand.step.max(pair.other.step);
    let first = smoothed(pair, lag, WIDTHS[0] * slower);
    let (from, to) = (first.first()?.0, first.last()?.0);
    let mut fit = Fit {
        offset: lag,
        drift: 0.0,
        pivot: 0.5 * (from + to),
        span: (from, to),
        correlation: 0.0,
        gain: 1.0,
        base: 0.0,
        scale: 0.0,
        width: 0.0,
        cov: Matrix2::zeros(),
        pieces: Vec::new(),
    };
    for width in WIDTHS {
        fit.width = width * slower;
        let smooth = smoothed(pair, fit.offset, fit.width);
        if smooth.len() < 60 {
            return None;
        }
        for _ in 0..ROUNDS {
            let mut rows = fit.rows(pair, &smooth);
            if rows.len() < 60 {
                return None;
            }
            fit.scale = weigh(&mut rows);
            let step = newton(&rows)?;
            let reach = 2.0 * fit.width;
            fit.offset += step[0].clamp(-reach, reach);
            fit.drift = (fit.drift + step[1].clamp(-reach / (to - from), reach / (to - from))).clamp(-DRIFT, DRIFT);
            fit.gain += step[2];
            fit.base += step[3];
            if step[0].abs() < 1e-6 && (step[1] * (to - from)).abs() < 1e-6 {
                break;
            }
        }
    }
    judge(&mut fit, pair)?;
    Some(fit)
}

/// One Gauss-Newton step: offset, drift, gain, base.
fn newton(rows: &[Row]) -> Option<Vector4<f64>> {
    let (mut h, mut g) = (Matrix4::zeros(), Vector4::zeros());
    for r in rows {
        let j = Vector4::new(r.slope, r.slope * r.d, r.value, 1.0);
        h += r.weight * j * j.transpose();
        g += r.weight * r.residual * j;
    }
    h.lu().solve(&g).filter(|s| s.iter().all(|v| v.is_finite()))
}

/// Correlation, errors by pieces, and each piece's own offset.
fn judge(fit: &mut Fit, pair: &Pair) -> Option<()> {
    let smooth = smoothed(pair, fit.offset, fit.width);
    let mut rows = fit.rows(pair, &smooth);
    if rows.len() < 60 {
        return None;
    }
    weigh(&mut rows);
    let (first, last) = (rows.first()?.d, rows.last()?.d);
    fit.span = (fit.pivot + first, fit.pivot + last);
    fit.correlation = correlation(&rows, fit.gain, fit.base);
    // gain and base are the run's: what is left of the slopes once they are taken out decides the clock
    let taken = centred(&rows);
    let mut h = Matrix2::zeros();
    let mut pieces = vec![(Vector2::zeros(), 0.0, 0.0, 0.0); PIECES];
    for (r, slope) in rows.iter().zip(&taken) {
        let j = Vector2::new(*slope, slope * r.d);
        h += r.weight * j * j.transpose();
        let k = (((r.d - first) / (last - first) * PIECES as f64) as usize).min(PIECES - 1);
        let piece = &mut pieces[k];
        piece.0 += r.weight * r.residual * j;
        piece.1 += r.weight * r.residual * slope;
        piece.2 += r.weight * slope * slope;
        piece.3 += r.weight * slope * slope * r.d;
    }
    let inverse = h.try_inverse()?;
    let told = pieces.iter().filter(|p| p.2 > 0.0).count() as f64;
    let meat: Matrix2<f64> = pieces.iter().map(|p| p.0 * p.0.transpose()).sum();
    fit.cov = inverse * meat * inverse * (told / (told - 2.0).max(1.0));
    let total: f64 = pieces.iter().map(|p| p.2).sum();
    let own: Vec<_> = pieces.iter().filter(|p| p.2 > 0.02 * total / PIECES as f64).collect();
    // scatter of the pieces about the joint, for an error of each by what it knows
    let spread = own.iter().map(|p| p.1 * p.1 / p.2).sum::<f64>() / own.len().max(1) as f64;
    // a shift that is added to the clock makes up for a second log that is early
    fit.pieces = own.iter().map(|p| [fit.pivot + p.3 / p.2, -p.1 / p.2, (spread / p.2).sqrt()]).collect();
    Some(())
}

/// Slopes less what gain and base make of them.
fn centred(rows: &[Row]) -> Vec<f64> {
    let (mut n, mut sv, mut ss, mut vv, mut vs) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for r in rows {
        n += r.weight;
        sv += r.weight * r.value;
        ss += r.weight * r.slope;
        vv += r.weight * r.value * r.value;
        vs += r.weight * r.value * r.slope;
    }
    let (mean, slope_mean) = (sv / n, ss / n);
    let k = (vs - n * mean * slope_mean) / (vv - n * mean * mean).max(1e-30);
    rows.iter().map(|r| r.slope - slope_mean - k * (r.value - mean)).collect()
}

fn correlation(rows: &[Row], gain: f64, base: f64) -> f64 {
    let n = rows.len() as f64;
    let y = |r: &Row| r.residual + gain * r.value + base;
    let (mx, my) = (rows.iter().map(|r| r.value).sum::<f64>() / n, rows.iter().map(y).sum::<f64>() / n);
    let of = |f: &dyn Fn(f64, f64) -> f64| rows.iter().map(|r| f(r.value - mx, y(r) - my)).sum::<f64>();
    let (xx, yy, xy) = (of(&|a, _| a * a), of(&|_, b| b * b), of(&|a, b| a * b));
    if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
}

/// How alike another pair is at a joint, how much later its second log is by itself, and the half width of its 95 % interval.
pub(super) fn later(pair: &Pair, joint: &Fit) -> Option<(f64, f64, f64)> {
    let own = fit(pair, joint.offset)?;
    let at = own.at(joint.pivot) - joint.at(joint.pivot);
    (at.abs() < 1.0).then(|| (own.correlation, -at, own.half_widths().0))
}
