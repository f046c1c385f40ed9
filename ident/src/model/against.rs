//! A log held against a declared model.
//!
//! What it is: what the model knows of its own errors, given to the targets of a log: the known part of a residual is no news.
//! What can go wrong: a model without a discrepancy file leaves the targets as they are.
//! Units: the channel's.
//! Reference: model discrepancy, Kennedy & O'Hagan 2001, JRSS B 63:425; specification `closing-the-loop.md`, step 1.

use super::Declared;
use super::course::{self, Counterparts};
use super::leftover::{self, Leftover};
use crate::channel::{Context, Relation, Target};

impl Context {
    /// Where a model is declared: what is sought may be older than the run, and every target is allowed what the model leaves over of
    /// its own run.
    pub(crate) fn against(&mut self, declared: Declared<'_>) {
        let Some(model) = declared.model else { return };
        let classes = leftover::classes(self);
        let alike = leftover::Alike::of(self, &classes);
        let loads: Vec<Vec<f64>> = self.targets.iter().map(|t| self.regressor(t.relation).unwrap_or_default()).collect();
        let speaks_of_air = model.effects.iter().any(|e| e.placed.effect.id() == "air_density");
        self.air = model.air.filter(|_| !speaks_of_air).map_or(0.0, f64::ln);
        self.against_model = true;
        let known = model.course.as_ref().map(|course| (course, course.counterparts(self)));
        let step = self.step();
        let predictions: Vec<Option<Vec<f64>>> =
            self.targets.iter().map(|t| model.predict_at_its_own_supply(self, t.name)).collect();
        for ((target, load), prediction) in self.targets.iter_mut().zip(loads).zip(&predictions) {
            if let Some((_, left)) = model.leftovers.iter().find(|(channel, _)| channel == target.name) {
                let course = known.as_ref().zip(prediction.as_ref()).and_then(|((course, rows), prediction)| {
                    Some(Counterparts { errors: course.of_channel(target.name)?, rows, prediction, step })
                });
                target.allow(left, &load, &classes, &alike, course);
            }
            let expected =
                || prediction.iter().flatten().enumerate().map(|(row, p)| target.as_it_stands(row, *p)).collect::<Vec<f64>>();
            match target.relation {
                Relation::Torque => self.expected_torque = expected(),
                Relation::SpeedFromPulse if self.expected_speed.is_empty() => self.expected_speed = expected(),
                _ => {}
            }
        }
    }
}

impl Target {
    /// Takes what the declared model leaves over of its own run for known, and weighs the samples by how well: `load` and `classes` of
    /// every row of the log, and how often the run repeats each class.
    fn allow(
        &mut self,
        left: &Leftover,
        load: &[f64],
        classes: &[usize],
        alike: &leftover::Alike,
        course: Option<Counterparts<'_>>,
    ) {
        self.known = load.iter().map(|x| left.known(*x)).collect();
        self.usual = left.held();
        let noise = self.noise.rms;
        let ahead = course.map_or_else(Vec::new, |c| course::ahead(c, self, classes));
        let square = |row: usize| {
            let usual = left.variance(load[row], classes[row], alike, noise);
            ahead.get(row).copied().flatten().map_or(usual, |(_, differ)| differ.min(usual))
        };
        for variances in [&mut self.levelled, &mut self.floored] {
            variances.iter_mut().zip(&self.rows).for_each(|(v, row)| *v += square(*row));
        }
        self.trust = (0..load.len()).map(|row| noise / (noise * noise + square(row)).sqrt()).collect();
        self.known.iter_mut().zip(&ahead).for_each(|(known, ahead)| *known = ahead.map_or(*known, |(error, _)| error));
    }
}
