//! Columns of a recorded log.
//!
//! What it is: the names of the columns, and the cells of a row under them: readings, what the board tells of marks, flags, and on request
//! the raw codes.
//! What can go wrong: what is not known is an empty cell.
//! Units: carried by the names.
//! Reference: specification `formats.md`, "Rig log".

use crate::evidence::{Fitted, flag_columns, raw_codes, raw_columns};
use frame::calibration::{Calibration, Converted};
use frame::message::Hello;
use frame::rig::{ADC_NAMES, CAPTURE_NAMES, RigSample, UNEVEN_NAMES};
use std::fmt::Write;

/// Which columns a log has.
#[derive(Debug, Clone)]
pub(super) struct Columns {
    /// Capture channels with two marks, which tell how unevenly these stand.
    paired: Vec<usize>,
    fitted: Fitted,
    raw: bool,
}

impl Columns {
    /// The columns of a board.
    pub(super) fn of(hello: Option<&Hello>, calibration: &Calibration, raw: bool) -> Self {
        let paired = (0..CAPTURE_NAMES.len()).filter(|i| calibration.marks[*i] == 2).collect();
        Self { paired, fitted: Fitted::of(hello, calibration), raw }
    }

    /// The line that names them.
    pub(super) fn names(&self) -> String {
        let mut names: Vec<String> =
            ["t_s", "pulse_us"].into_iter().chain(CAPTURE_NAMES).chain(ADC_NAMES).map(str::to_owned).collect();
        names.push("thrust_rms_n".to_owned());
        names.extend(self.paired.iter().map(|i| UNEVEN_NAMES[*i].to_owned()));
        names.extend(self.fitted.cross_columns().map(str::to_owned));
        names.extend(flag_columns(&self.fitted));
        if self.raw {
            names.extend(raw_columns(&self.fitted));
        }
        names.join(",") + "\n"
    }

    /// One row. `before` is the sample of the row before it.
    pub(super) fn cells(&self, t_s: f64, sample: &RigSample, values: &Converted, before: Option<&RigSample>) -> String {
        let mut line = format!("{t_s:.4},{:.3}", values.pulse_us);
        let uneven = self.paired.iter().map(|i| &values.uneven_deg[*i]);
        let own = values.rpm.iter().chain(&values.adc).chain([&values.thrust_rms_n]).chain(uneven).copied();
        for value in own.chain(self.fitted.cross(values, sample.esc_is_new(before))) {
            line.push(',');
            if let Some(value) = value.filter(|v| v.is_finite()) {
                let _ = write!(line, "{value:.6}");
            }
        }
        for flag in self.fitted.flags(sample) {
            line.push(',');
            if let Some(flag) = flag {
                let _ = write!(line, "{}", flag.code);
            }
        }
        if self.raw {
            for code in raw_codes(&self.fitted, sample) {
                let _ = write!(line, ",{code}");
            }
        }
        line.push('\n');
        line
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use frame::calibration::AdcScale;
    use frame::esc::{EscCode, EscVerdict};
    use frame::rig::{AdcCode, AdcVerdict, CaptureCode, CaptureVerdict};
    use frame::units::Ticks;
    use ident::log::Log;

    const MARKS: [u16; 4] = [2, 1, 2, 25];

    fn calibration() -> Calibration {
        Calibration { timer_hz: 84_000_000, marks: MARKS, adc: [AdcScale { zero: 0.0, gain: 1.0 }; 5], pole_pairs: [0; 2] }
    }

    fn told(columns: &Columns, samples: &[RigSample]) -> Log {
        let mut text = format!("# quadrig-log 1\n{}", columns.names());
        for (k, sample) in samples.iter().enumerate() {
            let before = k.checked_sub(1).map(|k| &samples[k]);
            text.push_str(&columns.cells(0.1 * k as f64, sample, &calibration().convert(sample), before));
        }
        Log::parse("run.csv", text.as_bytes()).expect("a log")
    }

    fn cells(log: &Log, name: &str) -> Option<Vec<Option<f64>>> {
        log.column(name).map(|v| v.iter().map(|a| a.is_finite().then_some(*a)).collect())
    }

    /// Every value stands under its own name, also where a channel without two marks lies between those that have them.
    #[test]
    fn what_the_board_tells_of_its_marks_stands_under_its_channels_name() {
        let code = |i: usize, uneven: u16| CaptureCode { edges: MARKS[i], span: 840_000, uneven, ..CaptureCode::default() };
        let sample = |uneven: [u16; 4]| RigSample { rpm: std::array::from_fn(|i| code(i, uneven[i])), ..RigSample::default() };
        let columns = Columns::of(None, &calibration(), false);
        let log = told(&columns, &[[1000, 3000, 500, 3000], [1000, 0, 0, 0], [0, 0, 2000, 0]].map(sample));
        assert_eq!(cells(&log, "uneven_beam_deg"), Some(vec![Some(9.0), Some(9.0), None]));
        assert_eq!(cells(&log, "uneven_hall_deg"), Some(vec![Some(4.5), None, Some(18.0)]));
        assert_eq!(
            (cells(&log, "uneven_opto_deg"), cells(&log, "uneven_encoder_deg")),
            (None, None),
            "these have no pair of marks"
        );
        assert_eq!(cells(&log, "rpm_encoder").map(|v| v.len()), Some(3));
    }

    #[test]
    fn the_cross_checks_stand_under_their_names_and_a_frame_of_the_esc_in_one_row() {
        let calibration = Calibration { pole_pairs: [11, 11], ..calibration() };
        let columns = Columns::of(None, &calibration, true);
        let code = EscCode { temperature: 41, voltage: 1148, current: 1234, charge: 77, speed: 451, ..EscCode::default() };
        let sample = |ms: u64, verdict, age_ms| RigSample {
            at: Ticks::from_ms(ms),
            esc: Some(EscCode { verdict, age_ms, ..code }),
            back_emf: Some(CaptureCode { edges: 33, span: 84_000_000 / 20, verdict: CaptureVerdict::Disagrees, uneven: 0 }),
            ..RigSample::default()
        };
        use EscVerdict::{Garbled, Nominal};
        let samples = [sample(100, Nominal, 2), sample(110, Nominal, 12), sample(133, Nominal, 4), sample(500, Garbled, 370)];
        let mut text = format!("# quadrig-log 1\n{}", columns.names());
        for (k, sample) in samples.iter().enumerate() {
            let before = k.checked_sub(1).map(|k| &samples[k]);
            text.push_str(&columns.cells(0.1 * k as f64, sample, &calibration.convert(sample), before));
        }
        let log = Log::parse("run.csv", text.as_bytes()).expect("a log");
        for (name, value) in [
            ("rpm_esc", 4100.0),
            ("current_esc_a", 12.34),
            ("voltage_esc_v", 11.48),
            ("temp_esc_c", 41.0),
            ("charge_esc_mah", 77.0),
        ] {
            assert_eq!(cells(&log, name), Some(vec![Some(value), None, Some(value), None]), "{name}");
        }
        assert_eq!(cells(&log, "rpm_bemf"), Some(vec![Some(3600.0); 4]));
        assert_eq!(cells(&log, "rpm_esc_flag"), Some(vec![None, None, None, Some(22.0)]));
        assert_eq!(cells(&log, "rpm_bemf_flag"), Some(vec![Some(7.0); 4]));
        assert_eq!(cells(&log, "raw_rpm_esc_speed").map(|v| v[0]), Some(Some(451.0)));
        assert_eq!(cells(&log, "raw_rpm_bemf_edges").map(|v| v[0]), Some(Some(33.0)));
        assert!(!Columns::of(None, &self::calibration(), true).names().contains("esc"), "nothing of it where it is not fitted");
    }

    #[test]
    fn flags_and_raw_codes_stand_under_their_channels_and_those_not_fitted_have_none() {
        let hello = Hello { analogue: 0b0_1101, ..crate::evidence::HELLO };
        let mut calibration = calibration();
        calibration.marks[3] = 0;
        let columns = Columns::of(Some(&hello), &calibration, true);
        let mut sample = RigSample::default();
        sample.rpm[0] = CaptureCode { edges: 8, span: 4_000_000, verdict: CaptureVerdict::Doubled, uneven: 0 };
        sample.rpm[1].verdict = CaptureVerdict::Stopped;
        sample.adc[0] = AdcCode { sum: 300_000, count: 100, rms_q8: 512, verdict: AdcVerdict::Saturated };
        sample.adc[3] = AdcCode { sum: 200_001, count: 100, rms_q8: 0, verdict: AdcVerdict::Nominal };
        let log = told(&columns, &[sample]);
        assert_eq!(cells(&log, "rpm_beam_flag"), Some(vec![Some(5.0)]));
        assert_eq!(cells(&log, "rpm_opto_flag"), Some(vec![None]), "a rotor that stands is nominal");
        assert_eq!((cells(&log, "thrust_n_flag"), cells(&log, "voltage_v_flag")), (Some(vec![Some(11.0)]), Some(vec![None])));
        assert_eq!((cells(&log, "torque_nm_flag"), cells(&log, "rpm_encoder_flag")), (None, None), "not fitted");
        assert_eq!(
            (cells(&log, "raw_rpm_beam_edges"), cells(&log, "raw_rpm_beam_span")),
            (Some(vec![Some(8.0)]), Some(vec![Some(4e6)]))
        );
        let raw = ["sum", "count", "rms_q8"].map(|what| cells(&log, &format!("raw_thrust_n_{what}")));
        assert_eq!(raw, [300_000.0, 100.0, 512.0].map(|v| Some(vec![Some(v)])));
        assert_eq!(cells(&log, "raw_voltage_v_sum"), Some(vec![Some(200_001.0)]));
        assert_eq!(cells(&log, "raw_torque_nm_sum"), None);
    }
}
