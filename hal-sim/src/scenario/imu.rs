//! A run of the IMU board, as a file.
//!
//! What it is: a scenario with a table `[imu]`: how the body moves, which chips are fitted and what each is off by, how long, seed and bus
//! faults; [`ImuScenario::rig`] makes of it what [`crate::native::ahrs`] runs.
//! What can go wrong: a key of the rig, a fault that is none of the bus, more than one of them, a value out of its range: refused with file,
//! line and column.
//! Units: each key carries its own; body axes FRD, earth NED.
//! Reference: `docs/scenario.md`, "The IMU board"; specification `ahrs.md`, "Sensors".

use super::{FaultKind, ScheduledFault};
use crate::imu::{BusFault, ChipErrors, ChipKind, Errors, Hidden, ImuScheduled, Motion};
use crate::native::ahrs::ImuRig;
use crate::number::{not_negative, positive};
use serde::{Deserialize, Deserializer, Serialize, de::Error};

/// Gauss in a microtesla.
const GAUSS_PER_UT: f64 = 0.01;

/// A simulated run of the IMU board.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuScenario {
    /// Title.
    #[serde(default)]
    pub name: String,
    /// Seed of the chips' errors and of their noise.
    #[serde(default = "one")]
    pub seed: u64,
    /// The body and its chips.
    pub imu: ImuSection,
    /// Hidden effects.
    #[serde(default, rename = "effect")]
    pub effects: Vec<ImuScheduled>,
    /// A fault of the bus, its times counted from power-up; one at the most.
    #[serde(default, rename = "fault", deserialize_with = "one_of_the_bus")]
    pub faults: Vec<ScheduledFault>,
}

/// The body and its chips.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImuSection {
    /// Length of the run, s.
    #[serde(deserialize_with = "positive")]
    pub duration_s: f64,
    /// Chips that are fitted.
    pub fitted: Vec<Field>,
    /// Draws the chips' errors from the seed, as far as the data sheets allow; otherwise they are ideal.
    pub drawn_errors: bool,
    /// Temperature of the board at power-up, degC; that of the drawn errors where it is not given.
    pub start_c: Option<f64>,
    /// Temperature that it ends at, degC; likewise.
    pub end_c: Option<f64>,
    /// How the body moves.
    pub body: BodySection,
    /// Errors of the gyro in the place of those drawn, in deg/s.
    pub gyro: ChipSection,
    /// Errors of the accelerometer, in g.
    pub accelerometer: ChipSection,
    /// Errors of the magnetometer, in uT.
    pub magnetometer: ChipSection,
}

/// What a chip senses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Field {
    /// ITG-3200.
    Gyro,
    /// ADXL345.
    Accelerometer,
    /// HMC5883L.
    Magnetometer,
}

/// How the body moves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BodySection {
    /// Roll, pitch and yaw at power-up, deg.
    pub start_deg: [f64; 3],
    /// Constant rate, body axes, deg/s.
    pub rate_deg_s: [f64; 3],
    /// Axis and amplitude of a rocking, body axes, deg.
    pub rock_deg: [f64; 3],
    /// Its frequency, Hz.
    #[serde(deserialize_with = "not_negative")]
    pub rock_hz: f64,
    /// Direction and amplitude of a shaking, earth axes, m.
    pub shake_m: [f64; 3],
    /// Its frequency, Hz.
    #[serde(deserialize_with = "not_negative")]
    pub shake_hz: f64,
    /// Place of the accelerometer from the centre of rotation, body axes, m.
    pub lever_m: [f64; 3],
    /// Turning and rocking pause so long at the beginning of each period, and the period, s; 0 for never.
    pub pause_s: [f64; 2],
    /// Half widths of a slow round through the room, earth axes, m.
    pub walk_m: [f64; 3],
    /// Rounds in a second, Hz.
    #[serde(deserialize_with = "not_negative")]
    pub walk_hz: f64,
    /// Magnetic field, earth axes, uT.
    pub field_ut: [f64; 3],
}

/// Errors of one chip in chip axes; a key that is absent keeps what was drawn, or the ideal chip's.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ChipSection {
    /// Scale and misalignment (magnetometer: soft iron): what the chip sees is this matrix times the truth.
    pub matrix: Option<[[f64; 3]; 3]>,
    /// Bias (magnetometer: hard iron) at 25 degC.
    pub bias: Option<[f64; 3]>,
    /// Its change with the board's temperature, per K.
    pub bias_per_k: Option<[f64; 3]>,
    /// Noise of a reading, rms.
    pub noise: Option<f64>,
}

impl Default for ImuScenario {
    /// A board that lies still and level, its chips off by what the data sheets allow.
    fn default() -> Self {
        Self { name: String::new(), seed: 1, imu: ImuSection::default(), effects: Vec::new(), faults: Vec::new() }
    }
}

impl Default for ImuSection {
    fn default() -> Self {
        Self {
            duration_s: 10.0,
            fitted: vec![Field::Gyro, Field::Accelerometer, Field::Magnetometer],
            drawn_errors: true,
            start_c: None,
            end_c: None,
            body: BodySection::default(),
            gyro: ChipSection::default(),
            accelerometer: ChipSection::default(),
            magnetometer: ChipSection::default(),
        }
    }
}

impl Default for BodySection {
    fn default() -> Self {
        Self {
            start_deg: [0.0; 3],
            rate_deg_s: [0.0; 3],
            rock_deg: [0.0; 3],
            rock_hz: 0.0,
            shake_m: [0.0; 3],
            shake_hz: 0.0,
            lever_m: [0.0; 3],
            pause_s: [0.0; 2],
            walk_m: [0.0; 3],
            walk_hz: 0.0,
            field_ut: Motion::LEVEL.field.map(|gauss| gauss / GAUSS_PER_UT),
        }
    }
}

impl ImuScenario {
    /// What the native run takes.
    #[must_use]
    pub fn rig(&self) -> ImuRig {
        let imu = &self.imu;
        let mut errors =
            if imu.drawn_errors { Errors::drawn(self.seed) } else { Errors { seed: self.seed, ..Errors::default() } };
        errors.start_c = imu.start_c.unwrap_or(errors.start_c);
        errors.end_c = imu.end_c.or(imu.start_c).unwrap_or(errors.end_c);
        let units = [1f64.to_radians(), 1.0, GAUSS_PER_UT];
        for ((chip, given), unit) in errors.chips.iter_mut().zip([imu.gyro, imu.accelerometer, imu.magnetometer]).zip(units) {
            given.replace(chip, unit);
        }
        ImuRig {
            motion: imu.body.motion(),
            aboard: None,
            fitted: imu.fitted.iter().map(|field| ChipKind::ALL[*field as usize]).collect(),
            errors,
            hidden: Hidden::new(&self.effects),
            fault: BusFault::first(&self.faults),
        }
    }

    /// Length of the run, ms.
    #[must_use]
    pub fn milliseconds(&self) -> u64 {
        (self.imu.duration_s * 1000.0 + 0.5) as u64
    }
}

impl BodySection {
    /// The motion in the units of [`Motion`].
    #[must_use]
    pub fn motion(&self) -> Motion {
        Motion {
            start: self.start_deg.map(f64::to_radians),
            rate: self.rate_deg_s.map(f64::to_radians),
            rock: self.rock_deg.map(f64::to_radians),
            rock_hz: self.rock_hz,
            field: self.field_ut.map(|ut| ut * GAUSS_PER_UT),
            shake_m: self.shake_m,
            shake_hz: self.shake_hz,
            lever_m: self.lever_m,
            pause_s: self.pause_s,
            walk_m: self.walk_m,
            walk_hz: self.walk_hz,
        }
    }
}

impl ChipSection {
    /// Puts what is given in the place of `chip`'s errors; `unit` is one of the file's in the chip's own.
    fn replace(&self, chip: &mut ChipErrors, unit: f64) {
        let own = |values: [f64; 3]| values.map(|v| v * unit);
        chip.matrix = self.matrix.unwrap_or(chip.matrix);
        chip.bias = self.bias.map_or(chip.bias, own);
        chip.bias_per_k = self.bias_per_k.map_or(chip.bias_per_k, own);
        chip.noise = self.noise.map_or(chip.noise, |noise| noise * unit);
    }
}

fn one() -> u64 {
    1
}

fn one_of_the_bus<'de, D: Deserializer<'de>>(d: D) -> Result<Vec<ScheduledFault>, D::Error> {
    let faults = Vec::<ScheduledFault>::deserialize(d)?;
    let of_the_bus = |f: &ScheduledFault| matches!(f.kind, FaultKind::I2cNack { .. } | FaultKind::I2cStuck);
    if faults.len() > 1 || !faults.iter().all(of_the_bus) {
        return Err(D::Error::custom(
            "expected one fault at the most, \"i2c_nack\" or \"i2c_stuck\": this file describes the IMU board",
        ));
    }
    Ok(faults)
}

#[cfg(test)]
mod tests {
    use super::super::parsed;
    use super::*;
    use std::path::Path;

    fn parse(text: &str) -> Result<ImuScenario, String> {
        parsed(text, Path::new("imu.toml")).map_err(|e| e.to_string())
    }

    #[test]
    fn what_is_given_takes_the_place_of_what_is_drawn() {
        let plain = parse("seed = 4\n[imu]\n").unwrap().rig();
        assert_eq!(plain.errors, Errors::drawn(4));
        assert_eq!((plain.motion, plain.fault, plain.fitted), (Motion::LEVEL, BusFault::None, ChipKind::ALL.to_vec()));
        let text = "seed = 4\n[imu]\nstart_c = 30\nfitted = [\"gyro\", \"accelerometer\"]\n[imu.gyro]\nbias = [1, 0, -2]\n\
            [imu.magnetometer]\nnoise = 0.5\n[imu.body]\nrate_deg_s = [0, 0, 90]\n[[fault]]\nid = \"i2c_stuck\"\nfrom_s = 1.0\nuntil_s = 2.0\n";
        let rig = parse(text).unwrap().rig();
        let drawn = Errors::drawn(4);
        assert_eq!(rig.errors.chips[0].bias, [1f64, 0.0, -2.0].map(f64::to_radians));
        assert_eq!(rig.errors.chips[0].matrix, drawn.chips[0].matrix);
        assert_eq!((rig.errors.chips[1], rig.errors.chips[2].noise), (drawn.chips[1], 0.005));
        assert_eq!((rig.errors.start_c, rig.errors.end_c), (30.0, 30.0), "a board that is given one temperature keeps it");
        assert_eq!(rig.fitted, [ChipKind::Itg3200, ChipKind::Adxl345]);
        assert_eq!(rig.motion.rate[2], core::f64::consts::FRAC_PI_2);
        assert!(matches!(rig.fault, BusFault::HeldData { from_ns: 1_000_000_000, .. }));
        assert_eq!(parse("[imu]\ndrawn_errors = false\n").unwrap().rig().errors, Errors::default());
    }

    #[test]
    fn what_is_written_reads_back_and_refusals_name_the_place() {
        let scenario = parse("name = \"a\"\n[imu]\nduration_s = 3\n[imu.body]\nrock_deg = [1, 2, 3]\nrock_hz = 0.5\n").unwrap();
        assert_eq!(parse(&toml::to_string(&scenario).unwrap()).unwrap(), scenario);
        let hidden = "[imu]\n[[effect]]\nid = \"channel_delay\"\nfrom_s = 2.0\ndelay_s = 0.03\n";
        let scenario = parse(hidden).unwrap();
        assert_eq!(scenario.effects.first().map(|e| (e.effect.id(), e.from_s)), Some(("channel_delay", Some(2.0))));
        assert_eq!(parse(&toml::to_string(&scenario).unwrap()).unwrap(), scenario);
        for (text, start, word) in [
            ("motor = \"570KV\"\n[imu]\n", "imu.toml:1:1: ", "motor"),
            ("[imu]\nduration_s = 0\n", "imu.toml:2:14: ", "above 0"),
            ("[imu.body]\nrock_hz = -1\n", "imu.toml:2:11: ", "not below 0"),
            ("[imu]\nfitted = [\"compass\"]\n", "imu.toml:2:11: ", "magnetometer"),
            ("[imu]\n[[fault]]\nid = \"link_lost\"\nfrom_s = 0.0\nuntil_s = 1.0\n", "imu.toml:2:1: ", "i2c_nack"),
        ] {
            let message = parse(text).unwrap_err();
            assert!(message.starts_with(start) && message.contains(word) && !message.contains('\n'), "{message}");
        }
    }
}
