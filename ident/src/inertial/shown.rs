//! What convinces of a cause: what it adds to a channel, and the variable that it goes with.
//!
//! What it is: for each cause that was found the axis whose error it takes away most, what it adds there row by row, and the variable of its figure.
//! What can go wrong: a cause that goes with time alone has no variable; its figure is over time.
//! Units: those of the channel; of the variable as it states.
//! Reference: component-plus-residual plots: Larsen & McCleary 1972, Technometrics 14:781.

use super::least::Term;
use super::search::Scene;
use nalgebra::Vector3;

/// Names of the axes.
const AXES: [&str; 3] = ["x", "y", "z"];

/// A variable that a cause goes with.
#[derive(Debug, Clone)]
pub(crate) struct Over {
    pub(crate) name: String,
    pub(crate) unit: &'static str,
    pub(crate) values: Vec<f64>,
}

/// A cause in its figure.
#[derive(Debug, Clone)]
pub(crate) struct Shown {
    pub(crate) id: String,
    /// Axis of which its text tells the error.
    pub(crate) axis: usize,
    /// What it adds there, row by row; not a number where the sensor is not predicted.
    pub(crate) added: Vec<f64>,
    /// Nothing for time.
    pub(crate) over: Option<Over>,
    /// How much of the run its figure shows, s; all of it, or the telling part, where nothing is said.
    pub(crate) seconds: Option<f64>,
}

impl Shown {
    /// Of what a cause adds at each row to an axis.
    pub(crate) fn over_time(id: &str, axis: usize, added: &[Vector3<f64>]) -> Self {
        let added = added.iter().map(|v| v[axis]).collect();
        Self { id: id.to_owned(), axis, added, over: None, seconds: None }
    }

    /// The same of a cause that is linear in its terms; `claimed` are the rows that are predicted.
    pub(crate) fn of(
        (id, axis): (&str, usize),
        terms: &[Term<'_>],
        coefficients: &[f64],
        scene: &Scene<'_>,
        claimed: &[bool],
    ) -> Self {
        let (shown, strongest) = Self::linear((id, axis), terms, coefficients, scene, claimed);
        let over = terms.get(strongest).and_then(|term| over(id, term, shown.axis, scene, claimed));
        Self { over, ..shown }
    }

    /// The same of a correction without a name, which is linear in an axis of rate or specific force, or in time.
    pub(crate) fn of_correction(
        (variable, axis): (&str, usize),
        terms: &[Term<'_>],
        coefficients: &[f64],
        scene: &Scene<'_>,
        claimed: &[bool],
    ) -> Self {
        let (shown, strongest) = Self::linear(("unknown", axis), terms, coefficients, scene, claimed);
        let (name, unit) = if variable == "g" { ("turn rate", "rad/s") } else { ("specific force", "m/s^2") };
        let over = terms.get(strongest).filter(|_| variable != "t").map(|term| Over {
            name: format!("{name} ({})", AXES[goes_with(term).unwrap_or(shown.axis)]),
            unit,
            values: (0..claimed.len()).map(|i| if claimed[i] { (term.value)(i)[shown.axis] } else { f64::NAN }).collect(),
        });
        Self { over, ..shown }
    }

    /// What the terms add, and which of them adds most.
    fn linear(
        (id, axis): (&str, usize),
        terms: &[Term<'_>],
        coefficients: &[f64],
        scene: &Scene<'_>,
        claimed: &[bool],
    ) -> (Self, usize) {
        let t = &scene.recording.t;
        let rows: Vec<usize> = (0..t.len()).filter(|i| claimed[*i]).collect();
        let mut added = vec![Vector3::repeat(f64::NAN); t.len()];
        for i in &rows {
            added[*i] = super::search::predict(terms, coefficients, t[*i], *i);
        }
        let shown = Self::over_time(id, axis, &added);
        let part = |(term, c): (&Term<'_>, &f64)| square(rows.iter().map(|i| c * (term.value)(*i)[shown.axis]));
        let strongest = largest(terms.iter().zip(coefficients).map(part));
        (shown, strongest)
    }
}

/// The variable that a cause goes with on an axis.
fn over(id: &str, term: &Term<'_>, axis: usize, scene: &Scene<'_>, claimed: &[bool]) -> Option<Over> {
    let recording = scene.recording;
    let make = |name: String, unit, value: &dyn Fn(usize) -> f64| {
        let values = (0..claimed.len()).map(|i| if claimed[i] { value(i) } else { f64::NAN }).collect();
        Some(Over { name, unit, values })
    };
    let own = AXES[axis];
    let of = goes_with(term).unwrap_or(axis);
    let letter = AXES[of];
    let always = term.support == (f64::NEG_INFINITY, f64::INFINITY);
    match id {
        // before it was attached, and after it was taken off, nothing was there: over time
        "hard_iron" if always => {
            let heading = |i: usize| scene.to_earth[i].m21.atan2(scene.to_earth[i].m11).to_degrees();
            make("heading".to_owned(), "deg", &heading)
        }
        // the third diagonal entry is what keeps the trace at zero
        "soft_iron" => {
            let of = if axis == 2 && ["s_xx", "s_yy"].contains(&term.name.as_str()) { 2 } else { of };
            make(format!("predicted field ({})", AXES[of]), "uT", &|i| scene.predicted[i][of])
        }
        "channel_delay" => make(format!("change of the field ({own})"), "uT/s", &|i| (term.value)(i)[axis]),
        "current_induced_field" => make("current".to_owned(), "A", &|i| recording.current.get(i).copied().unwrap_or(f64::NAN)),
        "gyro_temperature" => {
            make("temperature".to_owned(), "degC", &|i| recording.temperature.get(i).copied().unwrap_or(f64::NAN))
        }
        "g_sensitivity" => make(format!("specific force ({letter})"), "m/s^2", &|i| recording.accel[i][of]),
        "lever_arm" => make(format!("turning force ({own}) of a 1 m arm along {letter}"), "m/s^2", &|i| (term.value)(i)[axis]),
        _ => None,
    }
}

/// The axis of what a term goes with: the last letter of its name.
fn goes_with(term: &Term<'_>) -> Option<usize> {
    AXES.iter().position(|a| term.name.ends_with(a))
}

fn square(values: impl Iterator<Item = f64>) -> f64 {
    values.filter(|v| v.is_finite()).map(|v| v * v).sum()
}

/// Position of the largest.
pub(crate) fn largest(values: impl Iterator<Item = f64>) -> usize {
    values.enumerate().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0))).map_or(0, |best| best.0)
}

#[cfg(test)]
mod tests {
    use super::super::Recording;
    use super::*;
    use nalgebra::Matrix3;

    fn recording() -> Recording {
        let t: Vec<f64> = (0..200).map(|i| 0.01 * f64::from(i)).collect();
        Recording {
            gyro: t.iter().map(|t| Vector3::new(0.1, t.sin(), 0.0)).collect(),
            accel: t.iter().map(|t| Vector3::new(t.cos(), 2.0, 9.8)).collect(),
            temperature: t.iter().map(|t| 20.0 + t).collect(),
            t,
            ..Recording::default()
        }
    }

    /// What a cause adds to an axis, and of that axis the variable of the term that adds most.
    #[test]
    fn a_cause_is_shown_on_its_axis() {
        let recording = recording();
        let to_earth = vec![Matrix3::identity(); 200];
        let predicted: Vec<Vector3<f64>> = recording.t.iter().map(|t| Vector3::new(20.0, *t, 40.0)).collect();
        let scene = Scene { recording: &recording, to_earth: &to_earth, predicted: &predicted, turning: &[], heard: (0.0, 2.0) };
        let mut claimed = vec![true; 200];
        claimed[0] = false;
        let of =
            |id: (&str, usize), terms: Vec<Term<'_>>, coefficients: &[f64]| Shown::of(id, &terms, coefficients, &scene, &claimed);
        let warm =
            |k: usize| Term::new(["per_kelvin_x", "per_kelvin_y"][k], "rad/s/K", move |i| Vector3::ith(k, 0.01 * i as f64));
        let shown = of(("gyro_temperature", 1), vec![warm(0), warm(1)], &[0.1, -0.3]);
        let over = shown.over.expect("the temperature");
        assert_eq!((shown.axis, over.name.as_str(), over.unit), (1, "temperature", "degC"));
        assert!((shown.added[100] + 0.3).abs() < 1e-12 && (over.values[100] - 21.0).abs() < 1e-12);
        assert!(shown.added[0].is_nan() && over.values[0].is_nan(), "a row that is not predicted");
        let iron = |k: usize| Term::new(["s_xy", "s_zz"][k], "1", |i: usize| Vector3::new(predicted[i].y, 0.0, 0.0));
        let over = of(("soft_iron", 0), vec![iron(0)], &[0.02]).over.expect("the field");
        assert_eq!((over.name.as_str(), over.unit, over.values[150]), ("predicted field (y)", "uT", predicted[150].y));
        // what set in at an instant, and what is a curve over time, are shown over time
        let late = Term { support: (1.0, f64::INFINITY), ..Term::new("offset_x", "uT", |_| Vector3::x()) };
        assert!(of(("hard_iron", 0), vec![late], &[6.0]).over.is_none());
        let always = Term::new("offset_x", "uT", |_| Vector3::x());
        assert_eq!(of(("hard_iron", 0), vec![always], &[6.0]).over.expect("the heading").name, "heading");
        let by_force = Term::new("mx_ax", "uT/(m/s^2)", |i: usize| Vector3::new(recording.accel[i].x, 0.0, 0.0));
        let over = Shown::of_correction(("a", 0), &[by_force], &[0.5], &scene, &claimed).over.expect("the force");
        assert_eq!((over.name.as_str(), over.unit), ("specific force (x)", "m/s^2"));
    }
}
