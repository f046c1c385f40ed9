//! Designs made again and again with little changed between them.
//!
//! What it is: how a target's design came about the last time, effect by effect. An effect that stands as it stood, on columns that
//! stand as they stood, is not asked again; where only some columns are new, its operator acts on those alone.
//! What can go wrong: nothing that a design made afresh would not show: columns are the same only when they are one piece of memory.
//! Units: those of the columns.
//! Reference: memoisation, Michie 1968, Nature 218:19.

use crate::channel::Context;
use crate::channel::powers::Values;
use crate::effects::Stage;
use crate::effects::design::{Column, Label, TargetDesign};
use crate::effects::placed::Placed;
use std::sync::Arc;

/// How one target's design came about.
#[derive(Default)]
pub(crate) struct Steps {
    /// The design without effects, which no hypothesis changes.
    plain: Option<TargetDesign>,
    steps: Vec<Step>,
    /// What a declared model's rotor has made of which column.
    turned: Vec<(Values, Values)>,
}

struct Step {
    position: usize,
    placed: Placed,
    before: TargetDesign,
    after: TargetDesign,
}

impl Step {
    fn is_of(&self, position: usize, placed: &Placed) -> bool {
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        self.position == position
            && self.placed.effect.id() == placed.effect.id()
            && self.placed.instance == placed.instance
            && self.placed.shape.len() == placed.shape.len()
            && self.placed.shape.iter().zip(&placed.shape).all(same)
    }
}

impl Steps {
    /// The design without effects as it was `made` when it was first asked for.
    pub(crate) fn plain(&mut self, made: impl FnOnce() -> TargetDesign) -> TargetDesign {
        self.plain.get_or_insert_with(made).clone()
    }

    /// The effects of a hypothesis that touch the design's target, applied in causal order.
    pub(crate) fn apply(&mut self, context: &Context, placed: &[Placed], mut design: TargetDesign) -> TargetDesign {
        let in_a_row = |p: &Placed| matches!(p.stage(), Stage::Output | Stage::Hold) && context.is_table();
        let acts = |i: &usize| placed[*i].instance.touches(design.name) && !in_a_row(&placed[*i]);
        let mut order: Vec<usize> = (0..placed.len()).filter(acts).collect();
        order.sort_by_key(|i| placed[*i].stage());
        let meters = order.partition_point(|i| placed[*i].stage() < Stage::Output);
        let mut last = std::mem::take(&mut self.steps);
        for (k, i) in order.iter().copied().enumerate() {
            if k == meters {
                self.turn(context, placed, &mut design);
            }
            let p = &placed[i];
            let known = last.iter().position(|s| s.is_of(i, p)).map(|k| last.swap_remove(k));
            if let Some(step) = known.as_ref().filter(|s| stands(&s.before, &design)) {
                design = step.after.clone();
                design.mapped.clear();
                self.steps.extend(known);
                continue;
            }
            let before = design.clone();
            design.mapped = known.map_or_else(Vec::new, |s| s.after.mapped);
            let of_before = design.mapped.len();
            p.effect.apply(context, &p.instance, &p.shape, i, &mut design);
            design.mapped.drain(..of_before);
            self.steps.push(Step { position: i, placed: p.clone(), before, after: design.clone() });
            design.mapped.clear();
        }
        if meters == order.len() {
            self.turn(context, placed, &mut design);
        }
        design
    }

    /// What effects do to the rotor goes through the declared model's rotor, as the known part of the design has, before a meter sees it.
    fn turn(&mut self, context: &Context, placed: &[Placed], design: &mut TargetDesign) {
        let rotor = design.rotor.clone();
        let last = std::mem::take(&mut self.turned);
        let reaches = |column: &Column, rotor: &Placed| match column.label {
            Label::Effect { effect, .. } => {
                let measured = |c: &&String| context.target(c).is_some();
                placed.get(effect).is_some_and(|p| rotor.instance.channels.iter().filter(measured).all(|c| p.instance.touches(c)))
            }
            Label::Base(_) => false,
        };
        for operator in rotor.iter() {
            let reached: Vec<Values> = design.columns.iter().filter(|c| reaches(c, operator)).map(|c| c.values.clone()).collect();
            for values in reached {
                let mut known = last.iter().chain(&self.turned);
                let known = known.find(|(before, _)| Arc::ptr_eq(before, &values)).map(|(_, after)| after.clone());
                let after = known.unwrap_or_else(|| {
                    let alone = Column { label: Label::Base(0), values: values.clone() };
                    let mut of_one = TargetDesign { columns: vec![alone], ..TargetDesign::empty(design.name, design.relation) };
                    operator.effect.apply(context, &operator.instance, &operator.shape, 0, &mut of_one);
                    of_one.columns.swap_remove(0).values
                });
                self.turned.push((values.clone(), after.clone()));
                design.columns.iter_mut().filter(|c| Arc::ptr_eq(&c.values, &values)).for_each(|c| c.values = after.clone());
            }
        }
    }
}

/// Whether two designs are one.
fn stands(a: &TargetDesign, b: &TargetDesign) -> bool {
    a.columns.len() == b.columns.len()
        && a.columns.iter().zip(&b.columns).all(|(a, b)| a.label == b.label && Arc::ptr_eq(&a.values, &b.values))
        && a.fixed == b.fixed
        && a.extra_variance == b.extra_variance
}
