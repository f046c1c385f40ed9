//! A supply that gets nothing back: a rotor that slows down faster than its load brakes it draws what an idle drive draws.
//!
//! What it is: whether a run's readings show current that flows back; and the power into the rotor, held so that no prediction lies below the
//! idle current.
//! What can go wrong: a meter that knows no sign shows nothing that flows back; its readings are predicted all the same.
//! Units: A, rad/s, A.s3/rad2.
//! Reference: freewheeling of a converter whose low side does not switch; regenerative braking (damped light) of one whose low side does.

use crate::context::{Context, Relation, Target};
use crate::design::{Label, TargetDesign};
use crate::noise::median;
use crate::solve::Normal;

/// Rows of a level: fewer are none (three of them must agree for a median of five).
const LEVEL: usize = 5;
/// Readings beyond the level, of its noise's standard deviation: one in three million of a normal distribution.
const BEYOND: f64 = 5.0;

/// The least that a run's supply gives for five rows, A; nothing where current flows back, or was not measured.
pub(super) fn idle(context: &Context) -> Option<f64> {
    let target = &context.targets[context.target("current_a")?];
    let levels = target.y.windows(LEVEL).map(|rows| median(&mut rows.to_vec()));
    let idle = levels.min_by(f64::total_cmp)?;
    let far = BEYOND * target.noise.rms;
    let back = target.y.iter().filter(|y| **y < idle - far).count();
    (idle > -far && 2 * back < LEVEL).then_some(idle)
}

/// What the power into the rotor (`power` for each row, (rad/s)^2/s) makes of the current: no less than what leaves the idle current.
pub(super) fn held(context: &Context, power: Vec<f64>, position: usize, design: &TargetDesign) -> Vec<f64> {
    let of_model = design.told.iter().find(|t| t.label == Label::Effect { effect: position, amplitude: 1 }).map(|t| t.value);
    let (draw, gain, idle) = match of_model {
        Some(gain) => {
            let standing = design.told.iter().find(|t| t.label == Label::Base(0)).map_or(0.0, |t| t.value.max(0.0));
            (design.known(), gain, standing)
        }
        None => match sought(context, &power) {
            Some((draw, gain, idle)) => (Some(draw), gain, idle),
            None => return power,
        },
    };
    let Some(draw) = draw.filter(|_| gain > 0.0) else { return power };
    power.iter().zip(draw).map(|(p, draw)| p.max(((idle - draw) / gain).min(0.0))).collect()
}

/// What a run itself says, where nobody has told: the draw of a held speed on each row, the gain while the rotor speeds up, and the idle current.
fn sought(context: &Context, power: &[f64]) -> Option<(Vec<f64>, f64, f64)> {
    let idle = idle(context)?;
    let target = &context.targets[context.target("current_a")?];
    let powers = context.powers(Relation::Current);
    let terms = |row: usize| powers.iter().take(Relation::Current.degree() + 1).map(move |column| column[row]);
    let mut normal = Normal::new(Relation::Current.degree() + 2);
    for (row, y) in rows(target).filter(|(row, _)| power[*row] >= 0.0) {
        let all: Vec<f64> = terms(row).chain([power[row]]).collect();
        normal.add(&all, y, 1.0);
    }
    let found = (normal.count > 2 * LEVEL).then(|| normal.solve()).flatten()?;
    let (gain, curve) = found.coefficients.split_last()?;
    let draw = (0..power.len()).map(|row| terms(row).zip(curve).map(|(x, c)| x * c).sum()).collect();
    (gain.is_finite() && *gain > 0.0).then_some((draw, *gain, idle))
}

fn rows(target: &Target) -> impl Iterator<Item = (usize, f64)> {
    target.rows.iter().copied().zip(target.y.iter().copied())
}
