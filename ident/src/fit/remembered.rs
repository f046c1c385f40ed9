//! Refinements that were made before.
//!
//! What it is: the shapes that a search over a group of effects ended at, kept for whoever asks the same again. A group that shares no channel
//! with a new effect is refined anew beside it from the same start, on the same rows, to the same end.
//! What can go wrong: nothing that a search made afresh would not show: what is kept is found by all that the search depends on.
//! Units: none.
//! Reference: memoisation, Michie 1968, Nature 218:19.

use crate::channel::{Context, Question};
use crate::effects::placed::Placed;
use crate::fit::Rows;
use crate::model::Declared;
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};

impl Question {
    /// What the refinement of the effects at the positions of `group` asks, the channels that they move named.
    pub(crate) fn new(
        (context, declared): (&Context, Declared<'_>),
        placed: &[Placed],
        group: &[usize],
        moving: &[&str],
        rows: Rows<'_>,
        evaluations: usize,
    ) -> Self {
        let bits = |p: &Placed| p.shape.iter().map(|v| v.to_bits()).collect();
        let group = group
            .iter()
            .map(|k| &placed[*k])
            .map(|p| (p.effect.id(), p.instance.channels.clone(), p.instance.form.clone(), bits(p)))
            .collect();
        let mut digest = DefaultHasher::new();
        match rows {
            Rows::All => 1.hash(&mut digest),
            Rows::Every(n) => n.hash(&mut digest),
            Rows::Where(mask) => mask.hash(&mut digest),
        }
        for target in context.targets.iter().filter(|t| moving.contains(&t.name)) {
            [&target.y, &target.levelled].into_iter().flatten().for_each(|v| v.to_bits().hash(&mut digest));
        }
        if let Some(model) = declared.model {
            format!("{:?} {:?}", model.polynomials, model.effects).hash(&mut digest);
        }
        Self { group, ground: digest.finish(), scattering: placed.iter().any(|p| p.effect.scatters()), evaluations }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::Remembered;
    use crate::effects::Instance;
    use crate::effects::by_id;
    use crate::log::{Column, Log};

    fn log(shift: f64) -> Log {
        let values = |f: &dyn Fn(f64) -> f64| (0..200).map(|i| f(f64::from(i))).collect::<Vec<f64>>();
        let columns =
            [("pulse_us", values(&|i| 1200.0 + 4.0 * i)), ("rpm", values(&|i| 1000.0 + 30.0 * i + shift * (0.7 * i * i).sin()))];
        let columns = columns.into_iter().map(|(name, values)| Column { name: name.to_owned(), values }).collect();
        Log { t: values(&|i| 0.1 * i), columns, ..Log::default() }
    }

    #[test]
    fn only_the_same_question_is_answered_from_memory() {
        let (context, other) = (Context::new(&log(1.0), Some(1100.0)), Context::new(&log(1.1), Some(1100.0)));
        let placed = |shape: f64| {
            let effect = by_id("channel_delay").expect("in the library");
            vec![Placed { effect, instance: Instance::new(&["rpm"], ""), shape: vec![shape] }]
        };
        let mask = vec![true; 200];
        let ask = |c: &Context, shape: f64, rows: Rows<'_>, n: usize| {
            Question::new((c, Declared::default()), &placed(shape), &[0], &["rpm"], rows, n)
        };
        let asked = || ask(&context, 0.1, Rows::All, 40);
        let differing = [
            ask(&context, 0.2, Rows::All, 40),
            ask(&context, 0.1, Rows::Where(&mask), 40),
            ask(&context, 0.1, Rows::Every(2), 40),
            ask(&context, 0.1, Rows::All, 41),
            ask(&other, 0.1, Rows::All, 40),
        ];
        let memory = Remembered::default();
        assert_eq!(memory.or_found(asked(), || vec![vec![1.0]]), [[1.0]]);
        assert_eq!(memory.or_found(asked(), || vec![vec![2.0]]), [[1.0]], "the same question");
        for question in differing {
            assert_eq!(memory.or_found(question, || vec![vec![3.0]]), [[3.0]]);
        }
        assert_eq!(memory.clone().or_found(asked(), || vec![vec![4.0]]), [[4.0]], "a copy remembers nothing");
    }
}
