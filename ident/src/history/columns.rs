//! What a channel of one run may have beside the curve of all runs, as columns.
//!
//! What it is: zero, gain and bend; what comes late, by three time constants; what differs between the way up and down; what runs over the
//! run's time and with its temperature.
//! What can go wrong: a column that the run does not excite is left out; of a table of levels nothing that needs time is asked.
//! Units: gain, bend and late shares over one; the others the channel's, of the temperature for each kelvin.
//! Reference: the library's effects (`effects/`), each in its first order.

use super::curve::Curve;
use crate::channel::Context;
use crate::effects::operator::{Course, Lag};
use crate::numeric::order::median;

/// What a column is of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Of {
    /// Reading without load.
    Zero,
    /// Times the curve.
    Gain,
    /// Departure halfway up, over the curve's full value.
    Bend,
    /// Share that comes late, by a fast, a middle and a slow time constant; that time constant, s.
    Late(usize, f64),
    /// Half the distance between the way up and the way down.
    Hysteresis,
    /// Course over the run, from its first to its last second.
    Drift,
    /// With the temperature.
    Warmth,
}

impl Of {
    /// Whether its coefficient is a share of the curve, rather than in the channel's unit.
    pub(super) fn is_share(self) -> bool {
        matches!(self, Self::Gain | Self::Bend | Self::Late(..))
    }
}

/// Time constants of what comes late, s; the first at least as long as the samples ask for.
const LATE_S: [f64; 3] = [0.15, 1.0, 15.0];
/// Samples that the fastest must hold.
const FASTEST: f64 = 1.5;
/// Move of the load that turns its direction, over the top.
const SLACK: f64 = 0.02;
/// Least range of the temperature that says something of it, K (standard deviation): beneath it the last digit of a usual meter, 1/16 K, is what
/// varies. How well a warmth is known beyond that its own error says.
const WARM_K: f64 = 0.1;

/// A column on every row of a log.
pub(super) type Column = (Of, Vec<f64>);

/// The columns of a channel on a run: `x` is its regressor.
pub(super) fn columns(context: &Context, curve: &Curve, x: &[f64]) -> Vec<Column> {
    let f: Vec<f64> = x.iter().map(|x| curve.at(*x)).collect();
    let u: Vec<f64> = x.iter().map(|x| (x / curve.top).clamp(0.0, 1.2)).collect();
    let lens = |u: f64| 4.0 * u * (1.0 - u);
    let mut out = vec![
        (Of::Zero, vec![1.0; x.len()]),
        (Of::Gain, f.clone()),
        (Of::Bend, u.iter().map(|u| lens(*u) * curve.full).collect()),
    ];
    if context.time_is_row || context.is_table() {
        return out;
    }
    let t = &context.t;
    for (k, tau) in LATE_S.into_iter().enumerate() {
        let tau = if k == 0 { tau.max(FASTEST * context.step()) } else { tau };
        out.push((Of::Late(k, tau), late(t, &f, tau)));
    }
    let way = direction(&u);
    out.push((Of::Hysteresis, u.iter().zip(&way).map(|(u, way)| way * lens(u.min(1.0))).collect()));
    let (from, to) = (t[0], t[t.len() - 1]);
    out.push((Of::Drift, t.iter().map(|t| (t - from) / (to - from).max(f64::MIN_POSITIVE) - 0.5).collect()));
    if let Some(warmth) = context.temperature.as_ref().map(|v| smooth(v)) {
        let mean = warmth.iter().sum::<f64>() / warmth.len() as f64;
        let square = warmth.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / warmth.len() as f64;
        if square.sqrt() > WARM_K {
            out.push((Of::Warmth, warmth.iter().map(|v| v - mean).collect()));
        }
    }
    out
}

/// What a first-order lag has not followed yet: the curve jumps between rows.
fn late(t: &[f64], f: &[f64], tau: f64) -> Vec<f64> {
    let followed = Lag::new(t, tau, Course::Jump(0.0)).of(&[f]);
    followed[0].iter().zip(f).map(|(state, f)| state - f).collect()
}

/// Whether the load's last move beyond the slack went up (1) or down (-1); 0 before the first.
fn direction(u: &[f64]) -> Vec<f64> {
    let (mut play, mut way) = (u[0], 0.0);
    u.iter()
        .map(|u| {
            let next = play.clamp(u - SLACK, u + SLACK);
            if next != play {
                way = (next - play).signum();
            }
            play = next;
            way
        })
        .collect()
}

/// A slow channel without its meter's noise: medians of 41 rows.
fn smooth(v: &[f64]) -> Vec<f64> {
    const REACH: usize = 20;
    (0..v.len()).map(|i| median(&mut v[i.saturating_sub(REACH)..(i + REACH + 1).min(v.len())].to_vec())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_direction_is_that_of_the_last_move_beyond_the_slack() {
        let way = direction(&[0.0, 0.1, 0.099, 0.1, 0.2, 0.1, 0.09]);
        assert_eq!(way, [0.0, 1.0, 1.0, 1.0, 1.0, -1.0, -1.0]);
    }

    #[test]
    fn what_is_late_dies_away() {
        let t: Vec<f64> = (0..100).map(|i| 0.1 * f64::from(i)).collect();
        let f: Vec<f64> = (0..100).map(|i| f64::from(u8::from(i >= 10))).collect();
        let late = late(&t, &f, 1.0);
        assert_eq!(late[9], 0.0);
        assert!(late[10] < -0.85 && late[99].abs() < 1e-3, "{} {}", late[10], late[99]);
    }
}
