//! A flight model on a flight log.
//!
//! What it is: the columns of the model's terms on that log, times the model's coefficients. On another flight than its own what belongs to the
//! vehicle applies; what belonged to one run or one instant does not, but a damaged rotor stays damaged.
//! What can go wrong: a term whose columns the log lacks brings nothing there.
//! Units: those of the channels.
//! Reference: specification `formats.md`, "Scope".

use super::FlightError;
use super::channels::Target;
use super::columns::Flight;
use super::library::{Base, FlightLibrary};
use super::model::{Added, FlightModel};
use super::record::Record;
use crate::attribution::columns::{Column, Design, Placed, UNKNOWN};
use crate::log::Log;
use crate::verdict::Scope;
use std::path::Path;

/// A flight as a model sees it: the model's sizes, and its vehicle where the log does not say.
///
/// # Errors
/// As [`Record::of`].
pub fn seen_by(model: &FlightModel, log: &Log) -> Result<Flight, FlightError> {
    let mut record = Record::of(log)?;
    let own = &mut record.vehicle;
    if own.rotors.is_empty() {
        own.rotors.clone_from(&model.vehicle.rotors);
    }
    own.arm_m = model.vehicle.arm_m;
    own.mass_kg = own.mass_kg.or(model.vehicle.mass_kg);
    own.inertia_kgm2 = model.vehicle.inertia_kgm2;
    Ok(Flight { usual: model.usual, ..Flight::of(record) })
}

/// Whether a log is the one that the model was identified from.
#[must_use]
pub fn is_own(model: &FlightModel, flight: &Flight) -> bool {
    let t = &flight.record.t;
    same_file(&flight.record.name, &model.source) && [t.first(), t.last()] == [model.span_s.first(), model.span_s.last()]
}

/// Whether two names may be of one file: one of them may say more of the path.
fn same_file(a: &str, b: &str) -> bool {
    let (a, b) = (Path::new(a), Path::new(b));
    a.ends_with(b) || b.ends_with(a)
}

/// The terms of a model that apply to a flight: where they stand in its library, and the model's entry.
#[must_use]
pub fn placed(model: &FlightModel, library: &FlightLibrary<'_>, own: bool) -> Vec<(Placed, Added)> {
    let one = |added: &Added| {
        let values: Vec<f64> = added.shape.iter().map(|s| s.value).collect();
        if own || added.scope == Scope::Rig {
            return Some((Placed { candidate: library.find(&added.id, &added.form)?, shape: values }, added.clone()));
        }
        // what an event left behind: the rotor as it was in the end
        let (form, _) = added.form.split_once(" from an instant on").filter(|_| added.id == "rotor_gain")?;
        Some((Placed { candidate: library.find(&added.id, form)?, shape: values[..1].to_vec() }, added.clone()))
    };
    model.effect.iter().filter(|a| a.id != UNKNOWN).filter_map(one).collect()
}

/// The columns of the model on a flight, each with its coefficient; the declared model's first, then those of the terms that apply.
#[must_use]
pub fn columns(model: &FlightModel, library: &FlightLibrary<'_>, own: bool) -> Vec<(Column, f64)> {
    let base = Base { terms: placed(model, library, own), model: model.clone(), own };
    library.told(&base, &[])
}

/// Prediction of each channel of a flight over its windows.
#[must_use]
pub fn over_windows(flight: &Flight, columns: &[(Column, f64)]) -> Vec<Vec<f64>> {
    let design = Design { columns: columns.iter().map(|c| c.0.clone()).collect() };
    let values: Vec<f64> = columns.iter().map(|c| c.1).collect();
    (0..flight.channels.channels.len()).map(|c| design.predict(&values, c, flight.windows.len())).collect()
}

/// Whether a channel is told row by row, as logged, rather than through the filter.
#[must_use]
pub fn is_by_row(target: Target) -> bool {
    matches!(target, Target::Speed(_) | Target::Voltage)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A model of one of two flights that are named alike has more of the path, and its own flight stays its own.
    #[test]
    fn a_file_is_known_by_the_end_of_its_path() {
        assert!(same_file("flight.csv", "flight.csv") && same_file("flight.csv", "calm/flight.csv"));
        assert!(!same_file("gusty/flight.csv", "calm/flight.csv") && !same_file("light.csv", "calm/flight.csv"));
    }
}
