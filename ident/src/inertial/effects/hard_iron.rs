//! `hard_iron`: a magnet that travels with the sensor.
//!
//! What it is: a constant vector in body axes, from the beginning (the calibration does not hold) or from an instant on (something
//! was attached), to the end or to an instant (it was taken off again).
//! What can go wrong: without turning it is one with the earth's field and stays unnamed.
//! Units: uT, s.
//! Reference: Gebre-Egziabher et al., Journal of Aerospace Engineering 19(2), 2006.

use super::super::least::Term;
use super::super::search::{Cause, Instance, Scene, Span};
use super::{AXES, instants};
use nalgebra::{Matrix3, Vector3};

pub(crate) struct HardIron;

/// Least share of what a magnet on board adds that no change of the field in the room adds too: more than half, so that more speaks for the one than
/// for the other.
const OWN: f64 = 0.5;

/// A span with its open ends.
fn span_of([begins, ends]: Span) -> Span {
    [if begins.is_nan() { f64::NEG_INFINITY } else { begins }, if ends.is_nan() { f64::INFINITY } else { ends }]
}

/// Share of the squares of a vector that is constant in body axes which no vector that is constant in earth axes stands for, where all directions
/// are as likely: a constant in earth axes is at best its mean there.
fn own_share(scene: &Scene<'_>, span: Span) -> f64 {
    let [from, until] = span_of(span);
    let rows = scene.to_earth.iter().zip(&scene.recording.t);
    let inside = rows.filter(|(r, t)| r.m11.is_finite() && (from..until).contains(*t));
    let (sum, n) = inside.fold((Matrix3::zeros(), 0.0), |(sum, n), (r, _)| (sum + r, n + 1.0));
    1.0 - (sum / f64::max(n, 1.0)).norm_squared() / 3.0
}

impl Cause for HardIron {
    fn id(&self) -> &'static str {
        "hard_iron"
    }

    fn shapes(&self, scene: &Scene<'_>) -> Vec<f64> {
        std::iter::once(f64::NAN).chain(instants(scene)).collect()
    }

    fn resolution(&self) -> f64 {
        0.1
    }

    fn can_be_told(&self, scene: &Scene<'_>, span: Span) -> bool {
        span.iter().all(|v| v.is_nan()) || own_share(scene, span) >= OWN
    }

    fn may_end(&self) -> bool {
        true
    }

    fn instance<'a>(&self, scene: &Scene<'a>, shape: f64) -> Instance<'a> {
        self.lasting(scene, [shape, f64::NAN])
    }

    fn lasting<'a>(&self, scene: &Scene<'a>, [begins, ends]: Span) -> Instance<'a> {
        let [from, until] = span_of([begins, ends]);
        let t = &scene.recording.t;
        let there = move |i: usize| t[i] >= from && t[i] < until;
        let term = |k: usize| Term {
            support: (from, until),
            ..Term::new(
                &format!("offset_{}", AXES[k]),
                "uT",
                move |i| if there(i) { Vector3::ith(k, 1.0) } else { Vector3::zeros() },
            )
        };
        let always = begins.is_nan() && ends.is_nan();
        Instance {
            id: self.id(),
            depends_on: if always { vec!["attitude"] } else { vec!["attitude", "t_s"] },
            equation: if ends.is_nan() {
                "m += offset, constant in body axes from t0 on"
            } else {
                "m += offset, constant in body axes until t1"
            },
            terms: (0..3).map(term).collect(),
            shape: Some(("t0", "s", begins)),
            flexible: false,
            summary: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::Recording;
    use super::super::super::least::Readings;
    use super::super::super::search::search;
    use super::*;
    use nalgebra::Rotation3;

    /// A body that rests for 20 s, then tumbles; what it reads of a field of 45 uT, and what is added.
    fn flown(added: impl Fn(f64, &Matrix3<f64>) -> Vector3<f64>) -> (Recording, Vec<Matrix3<f64>>, Vec<Vector3<f64>>) {
        let t: Vec<f64> = (0..6000).map(|i| 0.02 * f64::from(i)).collect();
        let earth = Vector3::new(20.0, 0.0, 40.0);
        let turn = |t: &f64| {
            let w = (t - 20.0).max(0.0);
            Rotation3::from_euler_angles(0.7 * w, 1.1 * w, 0.4 * w).into_inner()
        };
        let to_earth: Vec<Matrix3<f64>> = t.iter().map(turn).collect();
        let predicted: Vec<Vector3<f64>> = to_earth.iter().map(|r| r.tr_mul(&earth)).collect();
        let noise = |i: usize, k: usize| 0.3 * (((i * 7919 + k * 104_729) % 1009) as f64 / 504.5 - 1.0);
        let read = |i: usize| predicted[i] + added(t[i], &to_earth[i]) + Vector3::new(noise(i, 0), noise(i, 1), noise(i, 2));
        let mag = (0..t.len()).map(read).collect();
        let gyro = vec![Vector3::zeros(); t.len()];
        (Recording { gyro, mag, t, ..Recording::default() }, to_earth, predicted)
    }

    /// Names, and the begin and end of the first, of what is found of that.
    fn found(added: impl Fn(f64, &Matrix3<f64>) -> Vector3<f64>) -> (Vec<&'static str>, Span) {
        let (recording, to_earth, predicted) = flown(added);
        let t = &recording.t;
        let heard = (t[0], t[t.len() - 1]);
        let scene = Scene { recording: &recording, to_earth: &to_earth, predicted: &predicted, turning: &[], heard };
        let readings = Readings::new(t, &recording.mag, vec![true; t.len()], 0.05, 0.4, 4.0);
        let rows = to_earth.as_slice();
        let axis = |k: usize| Term::new("", "uT", move |i: usize| rows[i].row(k).transpose());
        let base: Vec<Term<'_>> = (0..3).map(axis).collect();
        let causes = super::super::field();
        let outcome = search(&readings, &base, &causes, &scene, 0.1, 0.3).unwrap();
        let span = outcome.found.first().map_or([f64::NAN; 2], |f| [f.instance.shape.map_or(f64::NAN, |s| s.2), f.until]);
        (outcome.found.iter().map(|f| f.instance.id).collect(), span)
    }

    #[test]
    fn a_magnet_that_is_taken_off_again_has_an_end() {
        let magnet = Vector3::new(-3.0, 1.0, 25.0);
        let (ids, [from, until]) = found(|t, _| if (43.3..88.7).contains(&t) { magnet } else { Vector3::zeros() });
        assert_eq!(ids, ["hard_iron"]);
        assert!((from - 43.3).abs() < 0.2 && (until - 88.7).abs() < 0.2, "{from} {until}");
        // one that was there before the log and one that stays have one instant each
        let (ids, [from, until]) = found(|t, _| if t < 71.0 { magnet } else { Vector3::zeros() });
        assert!(ids == ["hard_iron"] && from.is_nan() && (until - 71.0).abs() < 0.2, "{ids:?} {from} {until}");
        let (ids, [from, until]) = found(|t, _| if t >= 71.0 { magnet } else { Vector3::zeros() });
        assert!(ids == ["hard_iron"] && until.is_nan() && (from - 71.0).abs() < 0.2, "{ids:?} {from} {until}");
    }

    /// While a body rests nobody can say whether a magnet is on it or beside it.
    #[test]
    fn a_magnet_beside_a_body_at_rest_is_none_on_board() {
        let (ids, _) =
            found(|t, r| if (6.0..14.0).contains(&t) { r.tr_mul(&Vector3::new(0.0, 0.0, 25.0)) } else { Vector3::zeros() });
        assert!(!ids.contains(&"hard_iron"), "{ids:?}");
    }
}
