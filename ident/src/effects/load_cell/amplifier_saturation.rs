//! `amplifier_saturation`: the bridge amplifier runs into its rail.
//!
//! What it is: thrust_n stands still at `level` wherever the true force is above it.
//! What can go wrong: at a single level above the rail nothing tells it from a polynomial that bends.
//! Units: N.
//! Reference: output swing of instrumentation amplifiers; Beharie 2013, section 4.4 (bridge and amplifier).

use crate::channel::Rail;
use crate::channel::{Context, STANDSTILL, Target};
use crate::effects::design::{Label, TargetDesign};
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage, present};
use std::sync::Arc;

/// See the module.
pub(crate) struct AmplifierSaturation;

impl Effect for AmplifierSaturation {
    fn id(&self) -> &'static str {
        "amplifier_saturation"
    }

    fn about(&self) -> About {
        About {
            title: "Load-cell amplifier saturates",
            equation: "thrust_n = min(thrust_n, level)",
            source: "Beharie 2013, section 4.4",
            depends_on: &["thrust_n"],
            signature: "above one speed the thrust reads one and the same value while torque goes on growing",
            look_alikes: &["stall", "blade_flex"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new("the load cell's amplifier", found.tell("level", |v| format!("saturates at {v}"), "saturates"))
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Input
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        if present(context, &["thrust_n"]).is_empty() { Vec::new() } else { vec![Instance::new(&["thrust_n"], "")] }
    }

    fn shapes(&self, context: &Context, _: &Instance) -> Vec<Shape> {
        let mut shape = crate::effects::rotor::blade_flex::upper_speeds(context, 24);
        let top = context.rpm.iter().copied().fold(1.0, f64::max);
        // a level that is held stands nowhere but at its own speed
        let rail = rail_of(context).map(|r| r.reached);
        shape.range.1 = rail.unwrap_or(0.0).max(0.999 * top);
        shape.starts.extend([0.965 * top, 0.99 * top]);
        shape.starts.extend(rail.filter(|r| (shape.range.0..=shape.range.1).contains(r)));
        vec![Shape { name: "reached_at", ..shape }]
    }

    fn amplitudes(&self, _: &Instance) -> Vec<Amplitude> {
        Vec::new()
    }

    fn seen(&self, context: &Context, _: &Instance) -> f64 {
        rail_of(context).map_or(0.0, |rail| rail.unlikely)
    }

    fn apply(&self, context: &Context, _: &Instance, shape: &[f64], _: usize, design: &mut TargetDesign) {
        let [reached] = shape else { return };
        hold_above(&mut design.fixed, &context.rpm, *reached);
        for column in &mut design.columns {
            if let Label::Base(power) = column.label {
                let at = (reached / 1000.0).powi(power as i32);
                Arc::make_mut(&mut column.values)
                    .iter_mut()
                    .zip(&context.rpm)
                    .filter(|(_, r)| *r > reached)
                    .for_each(|(v, _)| *v = at);
            }
        }
    }

    fn report(&self, context: &Context, _: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        let Some(reached) = fitted.iter().find(|e| e.name == "reached_at").map(|e| e.value) else { return fitted };
        let Some(target) = context.target("thrust_n").map(|k| &context.targets[k]) else { return fitted };
        let beyond = |speed: f64| -> Vec<f64> {
            target.rows.iter().zip(&target.y).filter(|(i, _)| context.rpm[**i] > speed).map(|(_, y)| *y).collect()
        };
        // a little beyond, so that the noise of the speed does not mix in rows below the rail; or where the readings stand still
        let above = Some(beyond(1.005 * reached)).filter(|y| !y.is_empty());
        let above = above.unwrap_or_else(|| beyond(rail_of(context).map_or(reached, |rail| rail.reached.max(reached))));
        let n = above.len() as f64;
        let level = above.iter().sum::<f64>() / n;
        // a rail is hit exactly: what is left is the last digit of the log
        let digit = crate::numeric::order::quantum(&target.y) / 12.0_f64.sqrt();
        let se = ((above.iter().map(|v| (v - level).powi(2)).sum::<f64>()).sqrt() / n).max(digit);
        if level.is_finite() {
            fitted.insert(0, Estimate { name: "level".into(), unit: "N".into(), value: level, se });
        }
        fitted
    }

    fn plausible(&self, context: &Context, _: &Instance, fitted: &[Estimate]) -> bool {
        // some speeds above the rail, apart from each other, or a top reading that repeats to the last digit: otherwise there
        // is nothing to see
        let reached = fitted.iter().find(|e| e.name == "reached_at").map_or(f64::INFINITY, |e| e.value);
        let above: Vec<f64> = context.rpm.iter().copied().filter(|r| *r > reached).collect();
        let top = above.iter().copied().fold(0.0, f64::max);
        let near = rail_of(context).is_none_or(|rail| (reached / rail.reached - 1.0).abs() < NEAR_RAIL);
        above.len() > REPEATED && near && (top > 1.02 * reached || stands_still(context, reached))
    }
}

/// Readings that repeat the largest one of the run to the last digit, from which on there is a rail: a second's worth at the rates of the
/// format's examples.
const REPEATED: usize = 20;
/// Share of the readings below the rail that may repeat the one before: more is a meter that holds, or rounds to more than its noise.
const HELD: f64 = 0.1;
/// Share of the rail's speed by which a fit may say another one: a fifth of the thrust more or less contradicts the readings.
const NEAR_RAIL: f64 = 0.1;

/// The rail of a run, where it has one: most of what is read beyond a speed is the largest reading.
fn rail(context: &Context) -> Option<Rail> {
    let target = &context.targets[context.target("thrust_n")?];
    let is_top = at_top(&target.y);
    let at_the_rail = target.rows.iter().zip(&target.y).filter(|(_, y)| is_top(**y));
    let mut speeds: Vec<f64> = at_the_rail.map(|(row, _)| context.rpm[*row]).collect();
    speeds.sort_by(f64::total_cmp);
    // just beneath, so that rows that stand at this very speed count
    let reached = speeds.get(speeds.len() / 20)?.next_down();
    if reached < STANDSTILL || !stands_still(context, reached) {
        return None;
    }
    let beyond = speeds.iter().filter(|speed| **speed > reached).count();
    Some(Rail { reached, unlikely: if context.against_model { 0.0 } else { beyond as f64 * unlikely_repeat(target) } })
}

/// Evidence, nats, of one reading that repeats another to the last digit: two normal readings differ by less than half a digit. 0 where the
/// meter does so below its largest reading too, or where few readings lie there and nothing is known of it.
fn unlikely_repeat(target: &Target) -> f64 {
    let is_top = at_top(&target.y);
    let top = target.y.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let below = || target.y.windows(2).filter(|w| !is_top(w[0]) && w[0] > 0.5 * top);
    let (count, repeats) = (below().count(), below().filter(|w| w[0] == w[1]).count());
    let digit = crate::numeric::order::quantum(&target.y);
    if count < REPEATED || repeats as f64 > HELD * count as f64 || digit <= 0.0 || target.noise.rms < digit {
        return 0.0;
    }
    (2.0 * std::f64::consts::PI.sqrt() * target.noise.rms / digit).ln()
}

/// The same, read off once a run.
fn rail_of(context: &Context) -> Option<Rail> {
    *context.facts.rail.get_or_init(|| rail(context))
}

/// Whether most readings above a speed are one and the same, the largest of the run.
fn stands_still(context: &Context, reached: f64) -> bool {
    let Some(target) = context.target("thrust_n").map(|k| &context.targets[k]) else { return false };
    let is_top = at_top(&target.y);
    let above = || target.rows.iter().zip(&target.y).filter(|(i, _)| context.rpm[**i] > reached);
    let same = above().filter(|(_, y)| is_top(**y)).count();
    same > REPEATED && same * 2 > above().count()
}

/// Whether a reading is the largest of a run, to the last digit.
fn at_top(y: &[f64]) -> impl Fn(f64) -> bool + use<> {
    let top = y.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    move |y| y >= top - 1e-9 * top.abs()
}

/// Holds a known prediction at its value where the driving quantity reaches `reached`.
pub(crate) fn hold_above(fixed: &mut [f64], driver: &[f64], reached: f64) {
    let at = fixed.iter().zip(driver).filter(|(_, r)| **r <= reached).max_by(|a, b| a.1.total_cmp(b.1)).map(|(v, _)| *v);
    if let Some(at) = at {
        fixed.iter_mut().zip(driver).filter(|(_, r)| **r > reached).for_each(|(v, _)| *v = at);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::Facts;
    use crate::log::{Column, Log};

    /// Visits of eight levels, 80 readings each; `reading` makes of the row and the true thrust what the log says.
    fn context(levels: &[f64; 8], reading: impl Fn(usize, f64) -> f64) -> Context {
        let rows = 4000;
        let rpm: Vec<f64> = (0..rows).map(|i| if i < 60 { 0.0 } else { levels[i / 80 * 5 % 8] }).collect();
        let noise = |i: usize| 0.02 * ((i * 7919 % 1009) as f64 / 1009.0 - 0.5);
        let thrust = rpm.iter().enumerate().map(|(i, r)| reading(i, 1.4e-7 * r * r + noise(i))).collect();
        let columns = [("rpm", rpm), ("thrust_n", thrust)].map(|(name, values)| Column { name: name.into(), values });
        let t = (0..rows).map(|i| 0.05 * i as f64).collect();
        Context::new(&Log { t, columns: columns.into(), ..Log::default() }, Some(1000.0))
    }

    fn seen(context: &Context) -> f64 {
        AmplifierSaturation.seen(context, &Instance::new(&["thrust_n"], ""))
    }

    const EVEN: [f64; 8] = [1000.0, 2000.0, 3000.0, 4000.0, 4500.0, 5000.0, 5500.0, 6000.0];

    #[test]
    fn readings_that_repeat_the_largest_one_speak_for_a_rail() {
        let round = |v: f64, digit: f64| (v / digit).round() * digit;
        let mut rail = context(&EVEN, |_, v| round(v, 0.001).min(4.9));
        assert!(seen(&rail) > 100.0, "{}", seen(&rail));
        rail.against_model = true;
        rail.facts = Facts::default();
        assert!(seen(&rail).abs() < 1e-12, "a model may have the rail already");
    }

    #[test]
    fn what_repeats_the_largest_reading_and_is_no_rail_does_not() {
        let round = |v: f64, digit: f64| (v / digit).round() * digit;
        let few = [0.0, 0.0, 1000.0, 0.0, 1000.0, 0.0, 1000.0, 6000.0];
        let looked_at = [
            ("a coarse display", context(&EVEN, |_, v| round(v, 0.1))),
            ("a coarse display that shows few levels", context(&few, |_, v| round(v, 0.1))),
            ("full scale by chance, at any speed", context(&EVEN, |i, v| if i % 133 == 7 { 20.0 } else { round(v, 0.001) })),
            ("a meter that holds its reading", context(&EVEN, |i, v| round(if i % 4 == 0 { v } else { v - v % 0.5 }, 0.001))),
            ("thrust that rests at nothing", context(&EVEN, |_, v| -round(v, 0.001).max(0.0))),
        ];
        let spoken = looked_at.iter().map(|(what, context)| (*what, seen(context))).filter(|(_, nats)| *nats != 0.0);
        assert_eq!(spoken.collect::<Vec<_>>(), [], "nats of evidence");
    }
}
