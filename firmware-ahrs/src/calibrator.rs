//! Calibration on the board, by command.
//!
//! What it is: gyro zero from the first second of rest; accelerometer from rest with each axis up and down, in any order, taken by
//! itself; magnetometer from readings while the user turns the board; its axes from rest in many attitudes. The arithmetic is
//! `dcm::calibration`, the host's.
//! What can go wrong: no rest, positions or directions that are missing, no fit: refused with the reason and its figure; the
//! calibration before stays in force. A new magnetometer calibration undoes the alignment: align after it.
//! Units: rad/s, m/s^2, uT, rad.
//! Reference: specification `ahrs.md`, "Calibration"; Beharie 2013 section 4.2.7 with errata.

use crate::job::{ATTITUDES, Attitudes, Done, Job};
use crate::still::{Second, Still, Watch};
use crate::{Outputs, TICK_HZ};
use dcm::calibration::{Calibration, CalibrationError, Collector, six_positions};
use dcm::{Vec3, unit};
use frame::{ImuCalibrated, ImuRefusal, ImuReport, ImuSensor};

/// Longest wait for a second of rest when the gyro is calibrated, ticks: 20 s.
const PATIENCE: u32 = 20 * TICK_HZ;
/// Field of the earth by which kept readings are spaced, uT.
const FIELD: f32 = 48.0;
/// Share of the force along one axis that makes a position: 18 degrees.
const UPRIGHT: f32 = 0.95;
/// Attitudes nearer to each other than this are one: cosine of 15 degrees.
const NEAR: f32 = 0.966;

/// A report, and the calibration to be put in force with it.
pub type News = (Option<Calibration>, ImuReport);

#[derive(Debug, Clone, PartialEq, Default)]
#[allow(clippy::large_enum_variant)] // there is no heap to put the collector on
enum Doing {
    #[default]
    Nothing,
    Gyro {
        age: u32,
        scatter: f32,
    },
    Positions([Option<Still>; 6]),
    Field(Collector),
    Attitudes(Attitudes),
}

/// The calibration that is under way.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Calibrator {
    doing: Doing,
    watch: Watch,
}

impl Calibrator {
    /// What is being calibrated.
    #[must_use]
    pub fn sensor(&self) -> Option<ImuSensor> {
        match self.doing {
            Doing::Nothing => None,
            Doing::Gyro { .. } => Some(ImuSensor::Gyro),
            Doing::Positions(_) => Some(ImuSensor::Accel),
            Doing::Field(_) => Some(ImuSensor::Mag),
            Doing::Attitudes(_) => Some(ImuSensor::Alignment),
        }
    }

    /// Begins; what was under way is given up.
    pub fn begin(&mut self, sensor: ImuSensor) {
        self.watch = Watch::default();
        self.doing = match sensor {
            ImuSensor::Gyro => Doing::Gyro { age: 0, scatter: 0.0 },
            ImuSensor::Accel => Doing::Positions([None; 6]),
            ImuSensor::Mag => Doing::Field(Collector::new(FIELD)),
            ImuSensor::Alignment => Doing::Attitudes(Attitudes::new()),
        };
    }

    /// Gives up what is under way.
    pub fn cancel(&mut self) {
        self.doing = Doing::Nothing;
    }

    /// Takes one instant; `present` is the calibration in force.
    pub fn take(&mut self, outputs: &Outputs, present: &Calibration) -> Option<News> {
        let second = if self.sensor().is_some() { self.watch.take(&outputs.read) } else { None };
        let news = match (&mut self.doing, second) {
            (Doing::Gyro { .. }, Some(Second::Rest(still))) => Some(gyro(&still, present)),
            (Doing::Gyro { age, scatter }, second) => {
                if let Some(Second::Motion(found)) = second {
                    *scatter = found;
                }
                *age += 1;
                let found = self.watch.readings();
                let why = if *scatter > 0.0 {
                    ImuRefusal::Moving { scatter: *scatter }
                } else {
                    ImuRefusal::TooFew { found, needed: TICK_HZ }
                };
                (*age > PATIENCE).then_some((None, ImuReport::Refused { sensor: ImuSensor::Gyro, why }))
            }
            (Doing::Positions(taken), Some(Second::Rest(still))) => position(taken, &still, present),
            (Doing::Attitudes(pairs), Some(Second::Rest(still))) => attitude(pairs, &still, present),
            (Doing::Field(store), _) => {
                if let Some(field) = &outputs.read.mag {
                    store.add(field);
                }
                None
            }
            _ => None,
        };
        if matches!(news, Some((_, ImuReport::Calibrated(_) | ImuReport::Refused { .. }))) {
            self.cancel();
        }
        news
    }

    /// The user has turned the board enough: work for the idle loop, or why there is none. `None` when nothing is under way.
    pub fn finish(&mut self) -> Option<Result<Job, ImuReport>> {
        match core::mem::take(&mut self.doing) {
            Doing::Nothing => None,
            Doing::Gyro { .. } => {
                let why = ImuRefusal::TooFew { found: self.watch.readings(), needed: TICK_HZ };
                Some(Err(ImuReport::Refused { sensor: ImuSensor::Gyro, why }))
            }
            Doing::Positions(taken) => {
                let index = taken.iter().position(Option::is_none).unwrap_or(0) as u8;
                Some(Err(ImuReport::Refused { sensor: ImuSensor::Accel, why: ImuRefusal::Position { index } }))
            }
            Doing::Field(store) => Some(Ok(Job::Ellipsoid(store))),
            Doing::Attitudes(pairs) => Some(Ok(Job::Alignment(pairs))),
        }
    }
}

/// What the idle loop's fit means; `None` where it was no fit.
#[must_use]
pub fn fitted(done: &Done, present: &Calibration) -> Option<News> {
    let mut calibration = *present;
    Some(match done {
        Done::Ellipsoid(Ok(found), readings) => {
            (calibration.mag_offset, calibration.mag_matrix) = (found.offset, found.matrix);
            let gain = [found.matrix.m11, found.matrix.m22, found.matrix.m33];
            let (offset, sigma) = (found.offset.into(), found.offset_sigma.into());
            let (residual, coverage, readings) = (found.residual, found.coverage, *readings);
            let report = ImuCalibrated { sensor: ImuSensor::Mag, offset, sigma, gain, residual, coverage, readings };
            (Some(calibration), ImuReport::Calibrated(report))
        }
        Done::Alignment(Ok(found), readings) => {
            calibration.mag_matrix = found.matrix * calibration.mag_matrix;
            let (offset, sigma, readings) = (found.angle.into(), found.sigma.into(), *readings);
            let report = ImuCalibrated {
                sensor: ImuSensor::Alignment,
                offset,
                sigma,
                gain: [1.0; 3],
                residual: found.residual,
                coverage: 1.0,
                readings,
            };
            (Some(calibration), ImuReport::Calibrated(report))
        }
        Done::Ellipsoid(Err(why), _) => (None, refused(ImuSensor::Mag, why)),
        Done::Alignment(Err(why), _) => (None, refused(ImuSensor::Alignment, why)),
        Done::Saved(_) | Done::Loaded(..) => return None,
    })
}

fn refused(sensor: ImuSensor, why: &CalibrationError) -> ImuReport {
    let why = match *why {
        CalibrationError::TooFew { found, needed } => ImuRefusal::TooFew { found, needed },
        CalibrationError::Moving { scatter } => ImuRefusal::Moving { scatter },
        CalibrationError::Coverage { found } => ImuRefusal::Coverage { found },
        CalibrationError::Position { index } => ImuRefusal::Position { index },
        _ => ImuRefusal::NoFit,
    };
    ImuReport::Refused { sensor, why }
}

fn gyro(still: &Still, present: &Calibration) -> News {
    let calibration = Calibration { gyro_offset: still.rate, ..*present };
    let report = ImuCalibrated {
        sensor: ImuSensor::Gyro,
        offset: still.rate.into(),
        sigma: still.rate_sigma.into(),
        gain: [1.0; 3],
        residual: still.rate_noise,
        coverage: 1.0,
        readings: still.readings as u16,
    };
    (Some(calibration), ImuReport::Calibrated(report))
}

/// Takes a position where it is a new one; the sixth ends it.
fn position(taken: &mut [Option<Still>; 6], still: &Still, present: &Calibration) -> Option<News> {
    let sensor = ImuSensor::Accel;
    let up = unit(&still.force)?;
    let axis = up.iamax();
    let along = up.get(axis).copied().unwrap_or(0.0);
    let index = 2 * axis + usize::from(along < 0.0);
    let slot = taken.get_mut(index).filter(|slot| slot.is_none() && along.abs() > UPRIGHT)?;
    *slot = Some(*still);
    let count = taken.iter().flatten().count() as u8;
    let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] = taken else {
        return Some((None, ImuReport::Taken { sensor, index: index as u8, count }));
    };
    let all = [*a, *b, *c, *d, *e, *f];
    let sigma = all.iter().fold(0.0f32, |worst, still| worst.max(still.force_sigma));
    Some(match six_positions(&all.map(|still| still.force), sigma) {
        Ok(found) => {
            let (accel_offset, accel_matrix) = (found.offset, found.matrix);
            let report = ImuCalibrated {
                sensor,
                offset: found.offset.into(),
                sigma: found.offset_sigma.into(),
                gain: found.gain.into(),
                residual: found.residual,
                coverage: 1.0,
                readings: 6,
            };
            (Some(Calibration { accel_offset, accel_matrix, ..*present }), ImuReport::Calibrated(report))
        }
        Err(why) => (None, refused(sensor, &why)),
    })
}

/// Takes an attitude where it is a new one.
fn attitude(pairs: &mut Attitudes, still: &Still, present: &Calibration) -> Option<News> {
    let pair = (present.accel(&still.force), present.mag(&still.field?));
    let near = |a: &Vec3, b: &Vec3| unit(a).zip(unit(b)).is_some_and(|(a, b)| a.dot(&b) > NEAR);
    if pairs.iter().any(|(force, field)| near(force, &pair.0) && near(field, &pair.1)) {
        return None;
    }
    pairs.push(pair).ok()?;
    let count = pairs.len().min(ATTITUDES) as u8;
    Some((None, ImuReport::Taken { sensor: ImuSensor::Alignment, index: count - 1, count }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dcm::Mat3;
    use dcm::calibration::Alignment;

    #[test]
    fn every_reason_of_a_fit_is_told_as_it_is() {
        for (why, told) in [
            (CalibrationError::TooFew { found: 3, needed: 8 }, ImuRefusal::TooFew { found: 3, needed: 8 }),
            (CalibrationError::Moving { scatter: 0.5 }, ImuRefusal::Moving { scatter: 0.5 }),
            (CalibrationError::Coverage { found: 0.25 }, ImuRefusal::Coverage { found: 0.25 }),
            (CalibrationError::Position { index: 4 }, ImuRefusal::Position { index: 4 }),
            (CalibrationError::NoFit, ImuRefusal::NoFit),
        ] {
            let news = fitted(&Done::Ellipsoid(Err(why), 0), &Calibration::default());
            assert_eq!(news, Some((None, ImuReport::Refused { sensor: ImuSensor::Mag, why: told })));
        }
    }

    /// First what the iron does is taken out, then the axes are turned.
    #[test]
    fn an_alignment_turns_what_the_iron_was_taken_from() {
        let matrix = Mat3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        let found = Alignment { matrix, angle: Vec3::zeros(), sigma: Vec3::zeros(), residual: 0.0 };
        let mut present = Calibration::default();
        present.mag_matrix.m11 = 2.0;
        let Some((Some(right), _)) = fitted(&Done::Alignment(Ok(found), 9), &present) else { panic!() };
        assert_eq!(right.mag(&Vec3::new(1.0, 3.0, 4.0)), Vec3::new(-3.0, 2.0, 4.0));
    }

    fn at(force: Vec3, field: Vec3) -> Still {
        let none = Vec3::zeros();
        Still { rate: none, rate_sigma: none, rate_noise: 0.0, force, force_sigma: 0.0, field: Some(field), readings: 200 }
    }

    /// An attitude is a new one where the force or the field has turned by more than 15 degrees.
    #[test]
    fn an_attitude_is_taken_once() {
        let mut pairs = Attitudes::new();
        let turned = |degrees: f32| Vec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos());
        let mut taken = |force: f32, field: f32| {
            let news = attitude(&mut pairs, &at(turned(force) * 9.8, turned(field) * 48.0), &Calibration::default());
            news.map(|(_, report)| report)
        };
        let told = |index, count| Some(ImuReport::Taken { sensor: ImuSensor::Alignment, index, count });
        assert_eq!(taken(0.0, 0.0), told(0, 1));
        assert_eq!(taken(0.0, 0.0), None);
        assert_eq!(taken(14.0, -14.0), None);
        assert_eq!(taken(0.0, 17.0), told(1, 2), "another field");
        assert_eq!(taken(-17.0, 0.0), told(2, 3), "another force");
    }

    /// Twenty seconds without a rate, and the next tick says what is missing.
    #[test]
    fn a_gyro_that_gives_nothing_is_refused_after_its_time() {
        let mut calibrator = Calibrator::default();
        calibrator.begin(ImuSensor::Gyro);
        let mut tick = || calibrator.take(&Outputs::default(), &Calibration::default());
        assert!((0..20 * TICK_HZ).all(|_| tick().is_none()));
        let why = ImuRefusal::TooFew { found: 0, needed: 200 };
        assert_eq!(tick(), Some((None, ImuReport::Refused { sensor: ImuSensor::Gyro, why })));
    }
}
