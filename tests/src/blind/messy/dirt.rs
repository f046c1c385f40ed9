//! What a logger does to a run: drop-outs with a slow recovery, gaps in time, sparse channels, no command.
//!
//! What it is: a logged run in, the run as it reaches the tool out, and beside it which samples are a reading of nothing.
//! What can go wrong: a gap may take the rows of a whole level.
//! Units: s.
//! Reference: optical and electrical speed probes of RCbenchmark stands; thrust and torque in every n-th row there.

use crate::blind::chance::Chance;
use crate::blind::run::Run;

/// How a rig's logger and probes behave.
#[derive(Debug, Clone, PartialEq)]
pub struct Dirt {
    /// Speed channels that drop out, and the mean time between two drop-outs, s.
    pub drops: Vec<(&'static str, f64)>,
    /// Gaps in time in a run.
    pub gaps: usize,
    /// Thrust and torque stand in every so many rows only.
    pub sparse: usize,
    /// Whether the command is logged.
    pub command: bool,
}

/// Probability that a probe drops out at all.
const DROPS: f64 = 0.3;
/// Probability of gaps, of sparse channels, of no command.
const OTHERS: [f64; 3] = [0.3, 0.35, 0.15];

impl Dirt {
    /// Draws the habits of a rig's logger.
    #[must_use]
    pub fn draw(speeds: &[(&'static str, f64)], k: &mut Chance) -> Self {
        let mut drops = Vec::new();
        for (name, _) in speeds {
            if k.happens(DROPS) {
                drops.push((*name, k.log_between(15.0, 90.0)));
            }
        }
        Self {
            drops,
            gaps: if k.happens(OTHERS[0]) { k.of(&[1, 2, 3]) } else { 0 },
            sparse: if k.happens(OTHERS[1]) { k.of(&[2, 3, 5, 8]) } else { 1 },
            command: !k.happens(OTHERS[2]),
        }
    }

    /// The run as it is logged, and for each column which samples a probe made up.
    #[must_use]
    pub fn onto(&self, mut run: Run, k: &mut Chance) -> (Run, Vec<Vec<bool>>) {
        let rows = run.t.len();
        let mut made_up = vec![vec![false; rows]; run.columns.len()];
        for (name, mean) in &self.drops {
            let Some(c) = run.columns.iter().position(|c| c.0 == *name) else { continue };
            drop_outs(&run.t, &mut run.columns[c].1, &mut made_up[c], *mean, k);
        }
        if self.sparse > 1 {
            let phase = (k.between(0.0, self.sparse as f64)) as usize;
            for (_, y) in run.columns.iter_mut().filter(|c| c.0 == "thrust_n" || c.0 == "torque_nm") {
                (0..rows).filter(|r| !(r + phase).is_multiple_of(self.sparse)).for_each(|r| y[r] = f64::NAN);
            }
        }
        let end = run.t[rows - 1];
        let gaps: Vec<(f64, f64)> = (0..self.gaps)
            .map(|_| {
                let from = k.between(0.1, 0.9) * end;
                (from, from + k.log_between(2.0, 0.08 * end))
            })
            .collect();
        let kept: Vec<bool> = run.t.iter().map(|t| !gaps.iter().any(|g| g.0 <= *t && *t < g.1)).collect();
        let thin = |v: &Vec<f64>| -> Vec<f64> { v.iter().zip(&kept).filter(|p| *p.1).map(|p| *p.0).collect() };
        run.columns.iter_mut().for_each(|c| c.1 = thin(&c.1));
        run.quiet.values_mut().for_each(|y| *y = thin(y));
        made_up.iter_mut().for_each(|m| *m = m.iter().zip(&kept).filter(|p| *p.1).map(|p| *p.0).collect());
        run.t = thin(&run.t);
        if !self.command {
            let c = run.columns.iter().position(|c| c.0 == "pulse_us").expect("every run has its command");
            run.columns.remove(c);
            made_up.remove(c);
        }
        (run, made_up)
    }
}

/// A probe that loses its mark reads nothing, or a share, for one row or up to two seconds, and creeps back.
fn drop_outs(t: &[f64], y: &mut [f64], made_up: &mut [bool], mean: f64, k: &mut Chance) {
    let mut next = -mean * (1.0 - k.between(0.0, 1.0)).ln();
    while next < t[t.len() - 1] {
        let (lasts, back) = (k.log_between(0.02, 2.0), if k.happens(0.6) { k.log_between(0.1, 1.0) } else { 1e-6 });
        let depth = if k.happens(0.4) { 1.0 } else { k.between(0.15, 0.9) };
        for ((t, y), made_up) in t.iter().zip(y.iter_mut()).zip(made_up.iter_mut()).filter(|p| *p.0.0 >= next) {
            let lost = depth * if *t < next + lasts { 1.0 } else { (-(t - next - lasts) / back).exp() };
            if lost < 0.001 {
                break;
            }
            *y = ((*y * (1.0 - lost)) * 10.0).round() / 10.0;
            *made_up = true;
        }
        next += lasts - mean * (1.0 - k.between(0.0, 1.0)).ln();
    }
}
