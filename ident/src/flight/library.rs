//! The causes of a flight, as the attribution asks for them.
//!
//! What it is: each form of each effect in `effects/` is a candidate, and each nameless function is one; a hypothesis is turned into
//! what acts (`scene`) and from there into columns.
//! What can go wrong: nothing; an effect without a form on this flight is no candidate.
//! Units: those of the channels.
//! Reference: the plan of `attribution`.

use super::columns::{Flight, Sink};
use super::declared::declared;
use super::model::{Added, Coefficient, FlightModel};
use super::nameless::Nameless;
use super::predict::placed;
use super::scene::Scene;
use crate::attribution::columns::{Candidate, Column, Design, Library, Owner, Placed, Prior, UNKNOWN};
use crate::flight::effects::{AirframeEffect, FOLLOWED, Form, library};
use crate::verdict::Scope;
use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

/// What stands behind a candidate.
#[derive(Clone)]
pub enum Kind {
    /// An effect in one of its forms.
    Effect(&'static dyn AirframeEffect, Form),
    /// A function without a name.
    Nameless(Nameless),
}

/// A model that stands behind the causes.
#[derive(Debug, Clone)]
pub struct Base {
    /// Its terms that apply, and the model's entry of each.
    pub terms: Vec<(Placed, Added)>,
    /// The model.
    pub model: FlightModel,
    /// Whether the flight is the model's own.
    pub own: bool,
}

/// Declared amplitude that is each flight's own: the state of charge.
pub(super) const OF_THE_DAY: &str = "voltage";

/// The causes of one flight.
pub struct FlightLibrary<'f> {
    /// The flight.
    pub flight: &'f Flight,
    /// Behind each candidate.
    pub kinds: Vec<Kind>,
    candidates: Vec<Candidate>,
    base: Option<Base>,
    /// Columns that were made: by what alters the scene, and by the term (none for the declared model).
    made: Mutex<BTreeMap<Key, Arc<Vec<Column>>>>,
}

/// What columns depend on: the terms that alter what acts, the term itself, and whether the speeds' column of the voltage is there already.
type Key = (Vec<(usize, Vec<u64>)>, Option<(usize, Vec<u64>)>, bool);

/// Most sets of columns that are kept.
const KEPT: usize = 400;

impl<'f> FlightLibrary<'f> {
    /// Of a flight.
    #[must_use]
    pub fn new(flight: &'f Flight) -> Self {
        let mut out = Self { flight, kinds: Vec::new(), candidates: Vec::new(), base: None, made: Mutex::default() };
        for effect in library() {
            for form in effect.forms(flight) {
                out.candidates.push(Candidate {
                    id: effect.id(),
                    form: form.name.clone(),
                    shapes: form.shapes.clone(),
                    starts: if form.starts.is_empty() { vec![Vec::new()] } else { form.starts.clone() },
                    needs: effect.needs().to_vec(),
                    excludes: effect.excludes(&form),
                });
                out.kinds.push(Kind::Effect(*effect, form));
            }
        }
        for (candidate, nameless) in Nameless::all(flight) {
            out.candidates.push(candidate);
            out.kinds.push(Kind::Nameless(nameless));
        }
        out
    }

    /// Position of a candidate by identifier and form.
    #[must_use]
    pub fn find(&self, id: &str, form: &str) -> Option<usize> {
        self.candidates.iter().position(|c| c.id == id && c.form == form)
    }

    /// Of a flight against a model that stands as it is: what it says is declared, and known.
    #[must_use]
    pub fn against(flight: &'f Flight, model: &FlightModel, own: bool) -> Self {
        let mut out = Self::new(flight);
        out.base = Some(Base { terms: placed(model, &out, own), model: model.clone(), own });
        out
    }

    /// Whether a model stands behind it.
    #[must_use]
    pub fn is_against(&self) -> bool {
        self.base.is_some()
    }

    /// The same causes on another view of the same flight.
    #[must_use]
    pub fn on<'g>(&self, flight: &'g Flight) -> FlightLibrary<'g> {
        FlightLibrary {
            flight,
            kinds: self.kinds.clone(),
            candidates: self.candidates.clone(),
            base: self.base.clone(),
            made: Mutex::default(),
        }
    }

    /// The columns of a model with its coefficients, where `beside` stands beside it.
    #[must_use]
    pub fn told(&self, base: &Base, beside: &[Placed]) -> Vec<(Column, f64)> {
        let terms = base.terms.iter().map(|t| t.0.clone());
        let all: Vec<Placed> = terms.chain(beside.iter().cloned()).collect();
        let scene = OnceCell::new();
        let mut out = valued(&self.columns(&all, None, &scene), &base.model.declared);
        for (place, (_, added)) in base.terms.iter().enumerate() {
            out.extend(valued(&self.columns(&all, Some(place), &scene), &added.amplitude));
        }
        let nameless = base.model.effect.iter().filter(|a| a.id == UNKNOWN && (base.own || a.scope == Scope::Rig));
        for added in nameless {
            let Some(function) = Nameless::told(self.flight, &added.form, &added.knots) else { continue };
            let mut sink = Sink::new(self.flight, scene.get_or_init(|| self.scene(&all)), &[], Owner::Declared);
            function.columns(&mut sink);
            out.extend(sink.done().into_iter().zip(added.amplitude.iter().map(|a| a.value)));
        }
        out
    }

    /// What acts under a hypothesis.
    fn scene(&self, hypothesis: &[Placed]) -> Scene<'f> {
        let mut scene = Scene::declared(&self.flight.record);
        for placed in hypothesis {
            if let Kind::Effect(effect, form) = &self.kinds[placed.candidate]
                && effect.alters()
            {
                effect.alter(self.flight, form, &placed.shape, &mut scene);
            }
        }
        scene.complete();
        scene
    }

    fn alters(&self, placed: &Placed) -> bool {
        matches!(&self.kinds[placed.candidate], Kind::Effect(effect, _) if effect.alters())
    }

    /// Columns of a term, or of the declared model, as the whole hypothesis has them; made once.
    fn columns(&self, hypothesis: &[Placed], place: Option<usize>, scene: &OnceCell<Scene<'f>>) -> Arc<Vec<Column>> {
        let told = |p: &Placed| (p.candidate, p.shape.iter().map(|s| s.to_bits()).collect::<Vec<u64>>());
        let altering = hypothesis.iter().filter(|p| self.alters(p)).map(told).collect();
        let before: Vec<&'static str> =
            hypothesis[..place.unwrap_or(0)].iter().map(|p| self.candidates[p.candidate].id).collect();
        let key = (altering, place.map(|k| told(&hypothesis[k])), before.iter().any(|id| FOLLOWED.contains(id)));
        if let Some(known) = self.made.lock().ok().and_then(|made| made.get(&key).cloned()) {
            return known;
        }
        let scene = scene.get_or_init(|| self.scene(hypothesis));
        let columns = Arc::new(match place {
            None => declared(self.flight, scene),
            Some(place) => self.term(&hypothesis[place], place, &before, scene),
        });
        if let Ok(mut made) = self.made.lock() {
            if made.len() >= KEPT {
                made.clear();
            }
            made.insert(key, columns.clone());
        }
        columns
    }

    fn term(&self, placed: &Placed, place: usize, before: &[&'static str], scene: &Scene<'_>) -> Vec<Column> {
        let mut sink = Sink::new(self.flight, scene, before, Owner::Term(place));
        match &self.kinds[placed.candidate] {
            Kind::Effect(effect, form) => effect.columns(form, &placed.shape, &mut sink),
            Kind::Nameless(nameless) => nameless.columns(&mut sink),
        }
        sink.done()
    }
}

impl Library for FlightLibrary<'_> {
    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    fn design(&self, hypothesis: &[Placed]) -> Design {
        let scene = OnceCell::new();
        let (all, mut columns) = match &self.base {
            None => (hypothesis.to_vec(), self.columns(hypothesis, None, &scene).as_ref().clone()),
            Some(base) => {
                let terms = base.terms.iter().map(|t| t.0.clone());
                (terms.chain(hypothesis.iter().cloned()).collect(), self.told(base, hypothesis).into_iter().map(known).collect())
            }
        };
        let first = all.len() - hypothesis.len();
        for place in 0..hypothesis.len() {
            columns.extend(owned(&self.columns(&all, Some(first + place), &scene), place));
        }
        Design { columns }
    }

    fn addition(&self, hypothesis: &[Placed], extra: &Placed) -> Option<Vec<Column>> {
        if self.alters(extra) {
            return None;
        }
        let base = self.base.iter().flat_map(|b| b.terms.iter().map(|t| t.0.clone()));
        let all: Vec<Placed> = base.chain(hypothesis.iter().cloned()).chain([extra.clone()]).collect();
        Some(owned(&self.columns(&all, Some(all.len() - 1), &OnceCell::new()), hypothesis.len()).collect())
    }
}

/// A column of a model that stands as it is.
fn known((column, value): (Column, f64)) -> Column {
    let prior = if column.name == OF_THE_DAY { column.prior } else { Prior { mean: value, sd: 0.0, sign: 0.0 } };
    Column { owner: Owner::Declared, prior, ..column }
}

/// Columns with the coefficients of a model; the same name stands once for each rotor, in order.
fn valued(columns: &[Column], told: &[Coefficient]) -> Vec<(Column, f64)> {
    let value = |k: usize| {
        if columns[k].is_given() {
            return columns[k].prior.mean;
        }
        let name = columns[k].name;
        let nth = columns[..k].iter().filter(|c| c.name == name).count();
        told.iter().filter(|c| c.name == name).nth(nth).map_or(0.0, |c| c.value)
    };
    columns.iter().enumerate().map(|(k, c)| (c.clone(), value(k))).collect()
}

/// Columns of the term at `place`, wherever it stood when they were made.
fn owned(columns: &[Column], place: usize) -> impl Iterator<Item = Column> {
    columns.iter().map(move |c| Column { owner: Owner::Term(place), ..c.clone() })
}
