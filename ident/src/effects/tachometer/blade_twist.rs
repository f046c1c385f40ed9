//! `blade_twist`: the light beam over-reads at high speed.
//!
//! What it is: above an onset speed rpm_beam reads too high: the blade twists, and the beam is cut at another place; or, in single
//! readings, by whole cuts more than there are blades.
//! What can go wrong: an onset below the slowest speed of the run is a scale error, not a twist. Readings with a cut too many are those of
//! doubled pulses as well; that all of them lie above one speed is what tells the two apart.
//! Units: rev/min, 1.
//! Reference: Beharie 2013, section 5.7.1, Fig. 5.54-5.55.

use crate::channel::Context;
use crate::effects::design::TargetDesign;
use crate::effects::rotor::blade_flex::upper_speeds;
use crate::effects::tachometer::pulses::{SCATTERED, struck_readings, struck_speeds};
use crate::effects::tachometer::speed_channel::{HINGE, add_hinge, instance, leaves};
use crate::effects::{About, Amplitude, Clause, Effect, EffectEntry, Estimate, Instance, Scope, Shape, Stage};

/// See the module.
pub(crate) struct BladeTwist;

impl Effect for BladeTwist {
    fn id(&self) -> &'static str {
        "blade_twist"
    }

    fn about(&self) -> About {
        About {
            title: "The light beam over-reads at high speed",
            equation: "rpm_beam += slope (rpm - onset) + bend (rpm - onset)^2 / onset above onset, or in scattered samples there whatever they read",
            source: "Beharie 2013, section 5.7.1, Fig. 5.54-5.55",
            depends_on: &["rpm"],
            signature: "rpm_beam leaves the other speed channels upwards above one speed",
            look_alikes: &["double_pulses"],
        }
    }

    fn said(&self, found: &EffectEntry) -> Clause {
        Clause::new(
            "the light beam",
            found.tell("onset", |v| format!("reads too much above {v}"), "reads too much at high speed"),
        )
    }

    fn scope(&self, _: &Instance) -> Scope {
        Scope::Rig
    }

    fn stage(&self) -> Stage {
        Stage::Term
    }

    fn instances(&self, context: &Context) -> Vec<Instance> {
        let forms = ["", SCATTERED].into_iter().filter_map(|form| instance(context, "rpm_beam", form));
        forms.filter(|i| i.form.is_empty() || struck_speeds(context, i).is_some()).collect()
    }

    fn shapes(&self, context: &Context, instance: &Instance) -> Vec<Shape> {
        if instance.form == SCATTERED {
            // read off, not fitted
            let onset = struck_speeds(context, instance).map_or(0.0, |s| s.lowest);
            return vec![Shape { name: "onset", unit: "rpm", range: (onset, onset), starts: vec![onset] }];
        }
        vec![upper_speeds(context, 14)]
    }

    fn amplitudes(&self, instance: &Instance) -> Vec<Amplitude> {
        if instance.form == SCATTERED { Vec::new() } else { HINGE.to_vec() }
    }

    fn apply(&self, context: &Context, instance: &Instance, shape: &[f64], position: usize, design: &mut TargetDesign) {
        let [onset] = shape else { return };
        if instance.form == SCATTERED {
            struck_readings(context, instance, *onset, design);
        } else {
            add_hinge(context, *onset, position, design);
        }
    }

    fn seen(&self, context: &Context, instance: &Instance) -> f64 {
        let speeds = (instance.form == SCATTERED).then(|| struck_speeds(context, instance)).flatten();
        speeds.map_or(0.0, |s| s.unlikely)
    }

    fn report(&self, context: &Context, instance: &Instance, mut fitted: Vec<Estimate>) -> Vec<Estimate> {
        let speeds = (instance.form == SCATTERED).then(|| struck_speeds(context, instance)).flatten();
        for e in fitted.iter_mut().filter(|e| e.name == "onset") {
            e.se = speeds.as_ref().map_or(e.se, |s| s.spacing);
        }
        fitted
    }

    fn plausible(&self, context: &Context, instance: &Instance, fitted: &[Estimate]) -> bool {
        instance.form == SCATTERED || leaves(context, instance, fitted, 1.0)
    }
}
