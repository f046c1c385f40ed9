//! How many names there may be, and which may stand beside which.
//!
//! What it is: a run has few causes of its own, and a channel fewer. What every rig and every logger has is told besides.
//! What can go wrong: a seventh cause of a rig's own is left without a name.
//! Units: none.
//! Reference: specification `closing-the-loop.md`, step 4.

use crate::channel::Context;
use crate::effects::placed::Placed;
use crate::effects::{self, Effect, Estimate, Instance, Shape};
use crate::verdict::Kin;

/// Most effects on one channel, beside what every rig has.
const MOST_ON_A_CHANNEL: usize = 3;
/// Most effects in one hypothesis, over all channels, beside what every rig has.
pub(crate) const MOST_EFFECTS: usize = 6;

/// Whether an instance may join: not twice the same effect on a channel, not too many effects on one channel.
pub(crate) fn may_join(context: &Context, placed: &[Placed], effect: &dyn Effect, instance: &Instance) -> bool {
    instance.channels.iter().all(|c| {
        let there: Vec<&Placed> = placed.iter().filter(|p| p.instance.touches(c)).collect();
        // what is older than the run may have happened once more
        let older = |p: &Placed| {
            p.instance.form != instance.form && [&p.instance.form, &instance.form].iter().any(|f| *f == effects::BEFORE)
        };
        let apart = |p: &&Placed| {
            (p.effect.id() != effect.id() || older(p))
                && !p.effect.never_beside().contains(&effect.id())
                && !effect.never_beside().contains(&p.effect.id())
                && !(effect.follows_supply(instance, c) && p.effect.follows_supply(&p.instance, c))
        };
        let room = effect.is_of_every_rig() || there.iter().filter(|p| takes_a_place(context, p)).count() < MOST_ON_A_CHANNEL;
        room && there.iter().all(apart)
    })
}

/// How many effects there are beside what every rig has.
pub(crate) fn of_this_rig(context: &Context, placed: &[Placed]) -> usize {
    placed.iter().filter(|p| takes_a_place(context, p)).count()
}

/// Whether a name is one of the few that a run or a channel may have. What every rig and every logger has, what single rows hold, and what the
/// readings show by themselves is told besides.
fn takes_a_place(context: &Context, placed: &Placed) -> bool {
    let (effect, instance) = (placed.effect, &placed.instance);
    if effect.is_of_every_rig() || effect.is_of_moments(instance) || placed.is_read_off() {
        return false;
    }
    let of = |(shape, value): (Shape, &f64)| Estimate {
        name: shape.name.into(),
        unit: shape.unit.into(),
        value: *value,
        se: f64::NAN,
    };
    let shapes: Vec<Estimate> = effect.shapes(context, instance).into_iter().zip(&placed.shape).map(of).collect();
    effect.kin(context, instance, &shapes) == Kin::Own
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::by_id;
    use crate::log::{Column, Log};

    /// Four seconds at ten rows a second.
    fn context() -> Context {
        let of = |name: &str, by: f64| Column { name: name.into(), values: (0..40).map(|i| by * f64::from(i)).collect() };
        let columns = vec![of("rpm", 100.0), of("thrust_n", 0.1)];
        Context::new(&Log { t: (0..40).map(|i| 0.1 * f64::from(i)).collect(), columns, ..Log::default() }, Some(1000.0))
    }

    fn placed(id: &str, channels: &[&str], form: &str, shape: &[f64]) -> Placed {
        Placed { effect: by_id(id).expect("in the library"), instance: Instance::new(channels, form), shape: shape.to_vec() }
    }

    /// A filter of half a row is what every logger has; one of ten rows is this one's own, and single absurd rows are no cause.
    #[test]
    fn what_every_logger_has_takes_no_place() {
        let takes = |id: &str, form: &str, shape: &[f64]| takes_a_place(&context(), &placed(id, &["thrust_n"], form, shape));
        assert!(!takes("channel_filter", "first_order", &[0.04]) && takes("channel_filter", "first_order", &[1.0]));
        assert!(!takes("glitch_rows", "", &[]) && takes("zero_drift", "", &[]));
    }

    #[test]
    fn a_current_that_follows_its_voltage_by_one_name_does_not_by_another() {
        let lead = [placed("supply_sag", &["voltage_v", "current_a"], "same_power", &[0.7, 12.0])];
        let joins = |channels: &[&str]| {
            let battery = placed("battery_discharge", channels, "straight", &[0.1]);
            may_join(&context(), &lead, battery.effect, &battery.instance)
        };
        assert!(joins(&["voltage_v"]) && !joins(&["voltage_v", "current_a", "rpm"]));
    }
}
