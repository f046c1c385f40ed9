//! Change points: where one level ends and the next begins.
//!
//! What it is: with a command, its steps, and jumps of the data that no command explains; without one, an optimal partition of the
//! data into lines with their own scatter, from which ramps and settling are left out.
//! What can go wrong: a gap of the command across a step belongs to neither level; coloured noise invites false cuts, so the cost of
//! a cut grows with the correlation time.
//! Units: rows; us for the command.
//! Reference: Killick, Fearnhead & Eckley 2012 (PELT); Hawkins 2001 (mean and variance).

use crate::numeric::order::median;
use crate::signal::settle::line;

/// Smallest step of a command, us.
const COMMAND_STEP: f64 = 0.5;
/// Shortest stretch worth a look, rows.
const SHORTEST: usize = 6;
/// Longest series that is partitioned as it is; longer ones in blocks.
const MOST: usize = 4000;
/// Largest change inside a plateau, as a share of the highest value: more is a ramp.
pub(super) const DRIFT: f64 = 0.02;

/// A stretch in which the rig is held at one level, settling included: rows `[from, to)`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stretch {
    pub(crate) from: usize,
    pub(crate) to: usize,
    /// A piece of one held command, cut where the data jump: it is a level only if it stands still.
    pub(crate) piece: bool,
}

/// The stretches of a run.
pub(crate) fn stretches(command: Option<&[f64]>, guide: &[f64]) -> Vec<Stretch> {
    let top = guide.iter().copied().filter(|v| v.is_finite()).fold(0.0_f64, |m, v| m.max(v.abs()));
    match command.filter(|c| c.iter().any(|v| v.is_finite())) {
        Some(command) => held(command)
            .into_iter()
            .flat_map(|(a, b)| {
                let pieces = jumps(guide, a, b, top);
                let piece = pieces.len() > 1;
                pieces.into_iter().map(move |(from, to)| Stretch { from, to, piece })
            })
            .collect(),
        None => partition(guide, top).into_iter().map(|(from, to)| Stretch { from, to, piece: false }).collect(),
    }
}

/// Stretches of one command value. Missing commands between two equal ones belong to them; between two values, to neither.
pub(super) fn held(command: &[f64]) -> Vec<(usize, usize)> {
    let mut out = Vec::new();
    let mut run: Option<(usize, usize, f64)> = None;
    for (i, v) in command.iter().enumerate().filter(|(_, v)| v.is_finite()) {
        run = match run {
            Some((from, _, level)) if (v - level).abs() <= COMMAND_STEP => Some((from, i + 1, level)),
            other => {
                out.extend(other.map(|(a, b, _)| (a, b)));
                Some((i, i + 1, *v))
            }
        };
    }
    out.extend(run.map(|(a, b, _)| (a, b)));
    out.retain(|(a, b)| b - a >= SHORTEST);
    out
}

/// Cuts a held stretch where the data jump although the command does not: by six standard deviations and a fiftieth of the range,
/// for good on both sides.
fn jumps(guide: &[f64], from: usize, to: usize, top: f64) -> Vec<(usize, usize)> {
    let n = to - from;
    // the first third may be settling
    let head = n / 3;
    if n < 60 {
        return vec![(from, to)];
    }
    let z = &guide[from..to];
    let mut sums = vec![(0.0, 0.0)];
    for v in z {
        let (s, c) = *sums.last().unwrap_or(&(0.0, 0.0));
        sums.push(if v.is_finite() { (s + v, c + 1.0) } else { (s, c) });
    }
    let mean = |a: usize, b: usize| (sums[b].0 - sums[a].0) / (sums[b].1 - sums[a].1);
    let best = (head + 15..n.saturating_sub(15))
        .map(|k| (k, (mean(k, n) - mean(head, k)).abs() * ((k - head) as f64 * (n - k) as f64).sqrt()))
        .filter(|(_, d)| d.is_finite())
        .max_by(|a, b| a.1.total_cmp(&b.1));
    let Some((k, _)) = best else { return vec![(from, to)] };
    let spread = |a: usize, b: usize| -> f64 {
        let m = mean(a, b);
        let mut d: Vec<f64> = z[a..b].iter().filter(|v| v.is_finite()).map(|v| (v - m).abs()).collect();
        1.4826 * median(&mut d)
    };
    let jump = (mean(k, n) - mean(head, k)).abs();
    // a jump, not a slope: the ten rows on either side of the cut already make most of it
    let abrupt = (mean(k, k + 10) - mean(k - 10, k)).abs() > 0.7 * jump;
    if abrupt && jump > DRIFT * top && jump > 6.0 * spread(head, k).max(spread(k, n)) {
        let mut out = jumps(guide, from, from + k, top);
        out.extend(jumps(guide, from + k, to, top));
        return out;
    }
    vec![(from, to)]
}

/// Prefix sums that give the residual of a line over any range at once.
struct Sums {
    y: Vec<f64>,
    xy: Vec<f64>,
    yy: Vec<f64>,
}

impl Sums {
    fn new(z: &[f64]) -> Self {
        let mut sums = Self { y: vec![0.0], xy: vec![0.0], yy: vec![0.0] };
        for (i, v) in z.iter().enumerate() {
            sums.y.push(sums.y[i] + v);
            sums.xy.push(sums.xy[i] + i as f64 * v);
            sums.yy.push(sums.yy[i] + v * v);
        }
        sums
    }

    /// Level at the middle, slope, residual sum of squares over `[a, b)`.
    fn line(&self, a: usize, b: usize) -> (f64, f64, f64) {
        let n = (b - a) as f64;
        let (y, yy) = (self.y[b] - self.y[a], self.yy[b] - self.yy[a]);
        let centre = a as f64 + (n - 1.0) / 2.0;
        let sxx = n * (n * n - 1.0) / 12.0;
        let sxy = self.xy[b] - self.xy[a] - centre * y;
        let slope = if sxx > 0.0 { sxy / sxx } else { 0.0 };
        (y / n, slope, (yy - y * y / n - slope * sxy).max(0.0))
    }
}

/// Optimal partition into lines, each with its own scatter; plateaus are the flat ones.
fn partition(guide: &[f64], top: f64) -> Vec<(usize, usize)> {
    let filled = despiked(guide);
    let block = filled.len().div_ceil(MOST).max(1);
    let z: Vec<f64> = filled.chunks(block).map(|c| c.iter().sum::<f64>() / c.len() as f64).collect();
    if z.len() < 2 * SHORTEST || top <= 0.0 {
        return Vec::new();
    }
    let sums = Sums::new(&z);
    let floor = noise_floor(&z).max(1e-5 * top).powi(2);
    let first = optimal(&sums, z.len(), floor, 1.0);
    let time = correlation_time(&z, &sums, &first);
    let cuts = if time > 1.2 { optimal(&sums, z.len(), floor, time) } else { first };
    let flat: Vec<(usize, usize)> = cuts
        .windows(2)
        .map(|w| (w[0], w[1]))
        .filter(|(a, b)| {
            let (_, slope, _) = sums.line(*a, *b);
            b - a >= SHORTEST && (slope * (b - a) as f64).abs() <= DRIFT * top
        })
        .collect();
    let mut out: Vec<(usize, usize)> =
        merged(&z, &sums, flat, top).into_iter().map(|(a, b)| (a * block, (b * block).min(guide.len()))).collect();
    // a stretch that the partition left to a settling piece belongs to the level behind it
    for k in 0..out.len() {
        let earliest = if k == 0 { 0 } else { out[k - 1].1 };
        let level = sums.line(out[k].0 / block, (out[k].1 / block).max(out[k].0 / block + 1)).0;
        while out[k].0 > earliest && (filled[out[k].0 - 1] - level).abs() < DRIFT * top {
            out[k].0 -= 1;
        }
    }
    out.into_iter().map(|(a, b)| (a, departure(&filled, a, b, 4 * block + 4))).filter(|(a, b)| b - a >= SHORTEST).collect()
}

/// Where a level is left within its last rows: before the first two rows in a row that stand four spreads to one side of its
/// own line, and one row sooner, because the first row of a step hardly moves.
fn departure(z: &[f64], from: usize, to: usize, reach: usize) -> usize {
    let late = to.saturating_sub(reach).max(from + SHORTEST);
    let Some((level, slope, spread)) = line(&z[from..late]) else { return to };
    let centre = from as f64 + ((late - from) as f64 - 1.0) / 2.0;
    let off = |k: usize| (z[k] - level - slope * (k as f64 - centre)) / spread;
    let left = (late..(to + reach).min(z.len().saturating_sub(1)))
        .find(|k| off(*k).abs() > 4.0 && off(*k + 1).abs() > 4.0 && off(*k) * off(*k + 1) > 0.0);
    left.map_or(to, |k| k.min(to)).saturating_sub(1).max(from + 1)
}

/// Joins neighbours that stand at one level with next to nothing between them.
fn merged(z: &[f64], sums: &Sums, flat: Vec<(usize, usize)>, top: f64) -> Vec<(usize, usize)> {
    let mut out: Vec<(usize, usize)> = Vec::new();
    for (a, b) in flat {
        if let Some(last) = out.last_mut() {
            let (before, slope_before, rss) = sums.line(last.0, last.1);
            let (after, slope_after, _) = sums.line(a, b);
            let end = before + slope_before * (last.1 - last.0) as f64 / 2.0;
            let start = after - slope_after * (b - a) as f64 / 2.0;
            let scatter = (rss / (last.1 - last.0) as f64).sqrt();
            let between = z[last.1..a].iter().all(|v| (v - before).abs() < (0.5 * DRIFT * top).max(4.0 * scatter));
            let near = (0.004 * top).max(2.0 * scatter);
            if between && ((end - start).abs() < near || (before - after).abs() < near) {
                last.1 = b;
                continue;
            }
        }
        out.push((a, b));
    }
    out
}

/// PELT over `n` points: boundaries from 0 to n.
fn optimal(sums: &Sums, n: usize, floor: f64, time: f64) -> Vec<usize> {
    let penalty = 4.0 * (n as f64).ln() + 6.0;
    let cost = |a: usize, b: usize| {
        let m = (b - a) as f64;
        m / time * (sums.line(a, b).2 / m + floor).ln()
    };
    let shortest = 3;
    let mut best = vec![f64::INFINITY; n + 1];
    let mut from = vec![0usize; n + 1];
    best[0] = -penalty;
    let mut open: Vec<usize> = vec![0];
    for end in shortest..=n {
        let mut costs: Vec<(usize, f64)> = Vec::with_capacity(open.len());
        for start in open.iter().copied().filter(|s| end - s >= shortest) {
            let c = best[start] + cost(start, end);
            costs.push((start, c));
            if c + penalty < best[end] {
                best[end] = c + penalty;
                from[end] = start;
            }
        }
        open.retain(|s| end - s < shortest || costs.iter().find(|c| c.0 == *s).is_some_and(|c| c.1 <= best[end] + 8.0));
        if best[end].is_finite() {
            open.push(end);
        }
    }
    let mut cuts = vec![n];
    let mut at = n;
    while at > 0 {
        at = from[at];
        cuts.push(at);
    }
    cuts.reverse();
    cuts
}

/// Integrated correlation time of what a partition leaves over, in points.
fn correlation_time(z: &[f64], sums: &Sums, cuts: &[usize]) -> f64 {
    let (mut c0, mut time) = (0.0, 1.0);
    let mut c = [0.0; 20];
    for w in cuts.windows(2).filter(|w| w[1] - w[0] >= 20) {
        let (level, slope, rss) = sums.line(w[0], w[1]);
        let centre = (w[1] - w[0] - 1) as f64 / 2.0;
        let scale = (rss / (w[1] - w[0]) as f64).sqrt().max(1e-12);
        let r: Vec<f64> =
            z[w[0]..w[1]].iter().enumerate().map(|(i, v)| (v - level - slope * (i as f64 - centre)) / scale).collect();
        c0 += r.iter().map(|v| v * v).sum::<f64>();
        for (k, c) in c.iter_mut().enumerate() {
            *c += r.iter().zip(&r[k + 1..]).map(|(a, b)| a * b).sum::<f64>();
        }
    }
    for c in c {
        if c0 <= 0.0 || c / c0 < 0.1 {
            break;
        }
        time += 2.0 * c / c0;
    }
    time.min(15.0)
}

/// Scatter of neighbouring points, robustly.
fn noise_floor(z: &[f64]) -> f64 {
    let mut d: Vec<f64> = z.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    0.25 * 1.4826 * median(&mut d) / std::f64::consts::SQRT_2
}

/// Median of five around each sample, missing ones bridged by the last: spikes of up to two rows go.
fn despiked(guide: &[f64]) -> Vec<f64> {
    let mut last = guide.iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
    let filled: Vec<f64> = guide
        .iter()
        .map(|v| {
            if v.is_finite() {
                last = *v;
            }
            last
        })
        .collect();
    let n = filled.len();
    let mut w = [0.0; 5];
    (0..n)
        .map(|i| {
            let around = &filled[i.saturating_sub(2)..(i + 3).min(n)];
            let w = &mut w[..around.len()];
            w.copy_from_slice(around);
            let m = median(w);
            w.iter_mut().for_each(|v| *v = (*v - m).abs());
            // only what stands far out is replaced: a median of everything would colour the noise
            if (filled[i] - m).abs() > 8.0 * median(w).max(1e-9) { m } else { filled[i] }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_gap_over_a_step_belongs_to_neither_level() {
        let mut command = vec![1100.0; 20];
        command.extend([f64::NAN; 5]);
        command.extend([1200.0; 20]);
        command[7] = f64::NAN;
        assert_eq!(held(&command), [(0, 20), (25, 45)]);
    }

    #[test]
    fn a_jump_without_a_command_is_cut() {
        let guide: Vec<f64> = (0..300).map(|i| if i < 180 { 3000.0 } else { 2700.0 } + (f64::from(i) * 1.7).sin()).collect();
        let at = |from, to, piece| Stretch { from, to, piece };
        assert_eq!(stretches(Some(&[1500.0; 300]), &guide), [at(0, 180, true), at(180, 300, true)]);
        let drifting: Vec<f64> = (0..300).map(|i| 3000.0 - 0.3 * f64::from(i) + (f64::from(i) * 1.7).sin()).collect();
        assert_eq!(stretches(Some(&[1500.0; 300]), &drifting), [at(0, 300, false)]);
    }
}
