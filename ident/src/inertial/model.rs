//! The corrected model of an inertial unit, `model.toml` of an attitude log.
//!
//! What it is: for each sensor the declared model's coefficients and those of every cause that was found, enough to predict the
//! recording again row by row from the log alone.
//! What can go wrong: the heading at which the filter started and its drift are the recording's own, so another recording is refused.
//! Units: s, rad, those of the channels.
//! Reference: specification `formats.md`, "Powerplant model" and "Verdict" (claimed figures can be recomputed from the file).

use super::least::Term;
use super::search::{Cause, Scene, predict};
use super::{Filter, InertialError, Recording, field, force, rate, unknown};
use crate::model::ending;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// First key of the format.
pub const FORMAT: &str = crate::model::OF_INERTIAL;

/// The model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InertialModel {
    /// [`FORMAT`].
    pub format: String,
    /// Log that it was identified from.
    pub source: String,
    /// First and last time of that log, s.
    pub span_s: [f64; 2],
    /// Its sensors.
    pub sensor: Vec<Part>,
}

/// What is known of one sensor.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Its channels.
    pub channels: Vec<String>,
    /// Field in earth axes, uT; of the magnetometer alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub earth_ut: Vec<f64>,
    /// Heading of the filter's north at each knot, rad; likewise.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub heading_rad: Vec<f64>,
    /// Coefficients of the declared model.
    pub declared: Vec<f64>,
    /// Width of the bell that predicts smooth accelerations from their neighbours, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub carried_width_s: Option<f64>,
    /// Frequency of the vibration that is predicted, Hz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line_hz: Option<f64>,
    /// Causes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub effect: Vec<Added>,
}

/// A cause, or with the id `unknown` the correction without a name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Added {
    /// Its name.
    pub id: String,
    /// Its shape: an instant or a distance of knots, s; absent where it has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape_s: Option<f64>,
    /// When it ended, s; absent where it lasts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until_s: Option<f64>,
    /// Variable of the correction without a name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variable: Option<String>,
    /// Coefficients of its terms, in the order of the library's.
    pub coefficients: Vec<f64>,
}

/// Predictions of a sensor's three channels, row by row; not a number where it makes no claim.
#[derive(Debug, Clone, PartialEq)]
pub struct Predicted {
    /// Its channels.
    pub channels: Vec<String>,
    /// Row by row.
    pub rows: Vec<Vector3<f64>>,
}

impl InertialModel {
    /// The file's text.
    ///
    /// # Panics
    /// Never: the model is a table of numbers and words.
    #[must_use]
    pub fn to_toml(&self) -> String {
        ending::framed(&toml::to_string(self).expect("a table of numbers and words"))
    }

    /// Reads the file's text; `file` is the name for messages.
    ///
    /// # Errors
    /// [`InertialError::Model`] with the place.
    pub fn parse(file: &str, text: &str) -> Result<Self, InertialError> {
        let refuse = |line: usize, reason: String| InertialError::Model { file: format!("{file}:{line}"), reason };
        if let Some((line, column, reason)) = ending::cut_short(text) {
            return Err(InertialError::Model { file: format!("{file}:{line}:{column}"), reason });
        }
        let model: Self = toml::from_str(text).map_err(|e| {
            let line = e.span().map_or(1, |s| text[..s.start.min(text.len())].matches('\n').count() + 1);
            refuse(line, e.message().lines().next().unwrap_or("not TOML").to_owned())
        })?;
        if model.format != FORMAT {
            return Err(refuse(1, format!("format is {:?}; expected an attitude log's, {FORMAT:?}", model.format)));
        }
        Ok(model)
    }

    /// Predictions of every channel of the recording that the model was made from.
    ///
    /// # Errors
    /// [`InertialError::Other`] for another recording.
    pub fn predict(&self, recording: &Recording, filter: &Filter<'_>) -> Result<Vec<Predicted>, InertialError> {
        let span = super::span(recording);
        if span != self.span_s {
            return Err(InertialError::Other { name: recording.name.clone(), source_name: self.source.clone() });
        }
        let part = |first: &str| self.sensor.iter().find(|p| p.channels.first().is_some_and(|c| c == first));
        let mut attitude = filter(&recording.gyro);
        let mut out = Vec::new();
        if let Some(own) = part("gx") {
            let (rows, corrected) = rate::again(recording, &attitude, own);
            out.push(Predicted { channels: own.channels.clone(), rows });
            if let Some(rates) = corrected {
                attitude = filter(&rates);
            }
        }
        if let Some(own) = part("ax") {
            out.push(Predicted { channels: own.channels.clone(), rows: force::again(recording, &attitude, own) });
        }
        if let Some((own, rows)) = part("mx").and_then(|own| Some((own, field::again(recording, &attitude, own)?))) {
            out.push(Predicted { channels: own.channels.clone(), rows });
        }
        // in the order of the file, which is that of the loop's own predictions
        out.sort_by_key(|p: &Predicted| self.sensor.iter().position(|s| s.channels == p.channels));
        Ok(out)
    }
}

/// Everything linear of a part at the claimed rows, and its causes alone.
pub(crate) fn linear(
    part: &Part,
    base: &[Term<'_>],
    causes: &[Box<dyn Cause>],
    scene: &Scene<'_>,
    channels: [&'static str; 3],
    claimed: &[bool],
) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let terms = |a: &Added| -> Vec<Term<'_>> {
        match (&a.variable, causes.iter().find(|c| c.id() == a.id)) {
            (Some(variable), _) => unknown::terms(variable, scene, channels),
            (None, Some(cause)) => cause.lasting(scene, [a.shape_s, a.until_s].map(|v| v.unwrap_or(f64::NAN))).terms,
            (None, None) => Vec::new(),
        }
    };
    let added: Vec<(Vec<Term<'_>>, &[f64])> = part.effect.iter().map(|a| (terms(a), a.coefficients.as_slice())).collect();
    let t = &scene.recording.t;
    let effect = |i: usize| added.iter().fold(Vector3::zeros(), |sum, (terms, c)| sum + predict(terms, c, t[i], i));
    let alone: Vec<Vector3<f64>> = (0..t.len()).map(effect).collect();
    let row = |i: usize| {
        if claimed[i] { predict(base, &part.declared, t[i], i) + alone[i] } else { Vector3::repeat(f64::NAN) }
    };
    ((0..t.len()).map(row).collect(), alone)
}
