//! What raw codes become, channel by channel: the numbers of each, and nothing where there is no trustworthy code.

use frame::calibration::{AdcScale, Calibration};
use frame::esc::{EscCode, EscVerdict};
use frame::rig::{AdcCode, AdcVerdict, CaptureCode, CaptureVerdict, RigSample};
use frame::units::{PulseWidth, Ticks};

const CALIBRATION: Calibration = Calibration {
    timer_hz: Ticks::HZ,
    marks: [2, 1, 4, 0],
    adc: [
        AdcScale { zero: 1000.0, gain: -0.5 },
        AdcScale { zero: 2048.0, gain: 0.25 },
        AdcScale { zero: 0.0, gain: 2.0 },
        AdcScale { zero: 0.0, gain: 1.0 },
        AdcScale { zero: 900.0, gain: 0.125 },
    ],
    pole_pairs: [7, 8],
};

const CAPTURES: [CaptureVerdict; 10] = [
    CaptureVerdict::Nominal,
    CaptureVerdict::Stopped,
    CaptureVerdict::Lost,
    CaptureVerdict::OverCapture,
    CaptureVerdict::Missed,
    CaptureVerdict::Doubled,
    CaptureVerdict::Alternating,
    CaptureVerdict::Disagrees,
    CaptureVerdict::Absent,
    CaptureVerdict::BladeTwist,
];

/// Twenty edges in a tenth of a second.
fn capture(verdict: CaptureVerdict) -> CaptureCode {
    CaptureCode { edges: 20, span: Ticks::HZ / 10, verdict, uneven: 1000 }
}

fn code(mean: u32, verdict: AdcVerdict) -> AdcCode {
    AdcCode { sum: 8 * mean, count: 8, rms_q8: 512, verdict }
}

#[test]
fn a_speed_is_whole_revolutions_in_their_time() {
    let nominal = capture(CaptureVerdict::Nominal);
    let speeds = [0, 1, 2, 3, 4].map(|channel| CALIBRATION.speed(channel, &nominal));
    assert_eq!(speeds, [Some(6000.0), Some(12_000.0), Some(3000.0), None, None], "by 2, 1 and 4 marks; none fitted; no channel");
    assert_eq!(CALIBRATION.speed(0, &CaptureCode { span: 0, ..nominal }), None, "no time has passed");
    let slower = Calibration { timer_hz: Ticks::HZ / 2, ..CALIBRATION };
    assert_eq!(slower.speed(0, &nominal), Some(3000.0));
}

/// A flagged reading keeps its number beside the flag; one that is no reading has none.
#[test]
fn what_a_verdict_leaves_of_a_speed() {
    for verdict in CAPTURES {
        let expected = match verdict {
            CaptureVerdict::Stopped => Some(0.0),
            CaptureVerdict::Lost | CaptureVerdict::OverCapture | CaptureVerdict::Absent => None,
            _ => Some(6000.0),
        };
        assert_eq!(CALIBRATION.speed(0, &capture(verdict)), expected, "{verdict:?}");
        assert_eq!(CALIBRATION.speed(3, &capture(verdict)), None, "{verdict:?} where nothing is fitted");
    }
}

#[test]
fn two_marks_tell_their_angle_and_no_other_number_does() {
    let nominal = capture(CaptureVerdict::Nominal);
    let angles = [0, 1, 2, 3, 4].map(|channel| CALIBRATION.uneven_deg(channel, &nominal));
    assert_eq!(angles, [Some(9.0), None, None, None, None], "a tenth of the mean period");
    assert_eq!(CALIBRATION.uneven_deg(0, &CaptureCode { uneven: 0, ..nominal }), None, "not known");
}

#[test]
fn a_value_is_the_mean_from_its_zero_by_its_gain() {
    assert_eq!(CALIBRATION.value(0, &code(800, AdcVerdict::Nominal)), Some(100.0));
    assert_eq!(CALIBRATION.value(1, &code(2148, AdcVerdict::Saturated)), Some(25.0));
    assert_eq!(CALIBRATION.value(5, &code(800, AdcVerdict::Nominal)), None, "no channel");
    for verdict in [AdcVerdict::Missing, AdcVerdict::Open, AdcVerdict::Short, AdcVerdict::Absent] {
        assert_eq!(CALIBRATION.value(0, &code(800, verdict)), None, "{verdict:?}");
    }
    for verdict in [AdcVerdict::Nominal, AdcVerdict::Saturated] {
        assert_eq!(CALIBRATION.value(0, &AdcCode { count: 0, ..code(800, verdict) }), None, "no conversion");
    }
}

#[test]
fn only_a_channel_all_of_whose_conversions_sit_at_an_end_is_stuck() {
    for (verdict, stuck) in [
        (AdcVerdict::Nominal, false),
        (AdcVerdict::Saturated, false),
        (AdcVerdict::Missing, false),
        (AdcVerdict::Absent, false),
        (AdcVerdict::Open, true),
        (AdcVerdict::Short, true),
    ] {
        assert_eq!(verdict.is_stuck(), stuck, "{verdict:?}");
    }
}

/// Each column of a log comes from its own code.
#[test]
fn a_sample_is_converted_column_by_column() {
    let esc =
        EscCode { verdict: EscVerdict::Nominal, temperature: 40, voltage: 1150, current: 250, charge: 9, speed: 280, age_ms: 1 };
    let sample = RigSample {
        at: Ticks::from_ms(1500),
        pulse: PulseWidth::from_us(1250),
        rpm: [
            capture(CaptureVerdict::Nominal),
            capture(CaptureVerdict::Missed),
            capture(CaptureVerdict::Lost),
            CaptureCode::default(),
        ],
        adc: [800, 2148, 3, 11, 1100].map(|mean| code(mean, AdcVerdict::Nominal)),
        esc: Some(esc),
        back_emf: Some(capture(CaptureVerdict::Nominal)),
        ..RigSample::default()
    };
    let out = CALIBRATION.convert(&sample);
    assert_eq!((out.t_s, out.pulse_us), (1.5, 1250.0));
    assert_eq!(out.rpm, [Some(6000.0), Some(12_000.0), None, None]);
    assert_eq!(out.uneven_deg, [Some(9.0), None, None, None]);
    assert_eq!(out.adc, [Some(100.0), Some(25.0), Some(6.0), Some(11.0), Some(25.0)]);
    assert_eq!(out.thrust_rms_n, Some(1.0), "two counts; a spread has no sign, whatever way the cell is mounted");
    assert_eq!(out.esc, [Some(4000.0), Some(2.5), Some(11.5), Some(40.0), Some(9.0)]);
    assert_eq!(out.rpm_bemf, Some(1500.0));
    let [_, rest @ ..] = CALIBRATION.adc;
    let [a, b, c, d] = rest;
    let upright = Calibration { adc: [AdcScale { zero: 1000.0, gain: 0.5 }, a, b, c, d], timer_hz: 1000, ..CALIBRATION };
    let other = upright.convert(&RigSample { at: Ticks(2500), ..sample });
    assert_eq!((other.thrust_rms_n, other.t_s), (Some(1.0), 2.5), "a timer of another rate");
    let nothing = CALIBRATION.convert(&RigSample::default());
    assert_eq!((nothing.thrust_rms_n, nothing.esc, nothing.rpm_bemf), (None, [None; 5], None));
}
