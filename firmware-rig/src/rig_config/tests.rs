use super::*;
use crate::transfer::LONGEST;
use frame::esc::{EscCode, EscVerdict};
use frame::message::Message;
use frame::rig::{AdcCode, AdcVerdict, CaptureCode, CaptureVerdict, FaultSet, RigSample, RigState};
use frame::wire::{Encoder, MAX_WIRE};
use proptest::prelude::*;
use settings_store::{MAX_STORED, open, seal};

fn factory() -> RigConfig {
    RigConfig::of(&Config::thesis_570kv())
}

/// Every field at its longest.
fn fullest() -> RigConfig {
    let curve = Some([PulseWidth::MIN, PulseWidth::MAX, PulseWidth::MAX, PulseWidth::MAX, PulseWidth::MAX]);
    let scale = AdcScale { zero: 1.5, gain: -0.1 };
    let both = |ms| Bounds { low: Some(Newton(-1.0)), high: Some(Newton(1.0)), ms };
    let mut full = RigConfig {
        log_period_ms: 1000,
        marks: [100; 4],
        curve,
        slew_ns_per_ms: 1_000_000,
        link_ms: 5000,
        calibrated: [Some(Calibrated {
            scale,
            zero_sigma: 0.1,
            gain_sigma: 0.1,
            residual: 0.1,
            worst: 0.2,
            points: 255,
            day: u16::MAX,
        }); 5],
        output: EscOutput::DShot600,
        esc_telemetry: Some(EscTelemetry { pole_pairs: 100, asked: true }),
        back_emf: 100,
        ..factory()
    };
    full.esc = EscProfile {
        answers: Answers::Silent { hold_ms: 60_000 },
        highest: PulseWidth::MAX,
        hold_min_ms: 600_000,
        cells_ms: 600_000,
        ready_ms: 600_000,
    };
    full.limits.thrust = both(1000);
    full.limits.speed = Bounds { low: Some(RevPerMin(1.0)), high: Some(RevPerMin(2.0)), ms: 10_000 };
    full.limits.torque = Bounds { low: Some(NewtonMetre(1.0)), high: Some(NewtonMetre(2.0)), ms: 10_000 };
    full.limits.current = Bounds { low: Some(Ampere(1.0)), high: Some(Ampere(2.0)), ms: 1_000 };
    full.limits.voltage = Bounds { low: Some(Volt(1.0)), high: Some(Volt(2.0)), ms: 1_000 };
    full.limits.temperature = Bounds { low: Some(Celsius(1.0)), high: Some(Celsius(2.0)), ms: 60_000 };
    full
}

#[test]
fn the_stored_form_comes_back_and_fits() {
    for settings in [factory(), fullest()] {
        assert!(settings.in_range());
        let mut buffer = [0; MAX_STORED];
        let stored = seal(&settings, &mut buffer).expect("it fits");
        assert!(stored.len() <= LONGEST, "{} bytes", stored.len());
        assert_eq!(open(stored), Some(settings));
    }
}

#[test]
fn applied_settings_say_the_same_again() {
    let config = Config::thesis_570kv();
    for changed in [fullest(), RigConfig { log_period_ms: 20, marks: [3, 1, 2, 25], link_ms: 700, ..factory() }] {
        assert_eq!(RigConfig::of(&changed.apply(&config)), changed);
    }
    assert_ne!(fullest().digest(), factory().digest());
}

#[test]
fn impossible_settings_change_nothing() {
    for bad in [
        Setting::LogPeriodMs(0),
        Setting::LogPeriodMs(1001),
        Setting::Marks([101, 1, 1, 1]),
        Setting::Curve(Some([PulseWidth::MAX, PulseWidth::MIN, PulseWidth::MIN, PulseWidth::MIN, PulseWidth::MIN])),
        Setting::SlewNsPerMs(0),
        Setting::SpeedLimit(f32::NAN),
        Setting::CurrentLimit(f32::INFINITY),
        Setting::VoltageLimit(-1000.0),
        Setting::LinkMs(100),
    ] {
        assert_eq!(factory().with(&bad, &factory()), Err(OutOfRange), "{bad:?}");
    }
    let nothing = RigConfig { marks: [0; 4], fitted: [false; 5], ..factory() };
    let mut nonsense = [nothing, factory(), factory(), factory(), factory(), factory(), factory(), factory()];
    nonsense[1].strain.gain = f32::NAN;
    nonsense[2].esc.highest = PulseWidth::MIN;
    nonsense[3].limits.voltage = Bounds { low: Some(Volt(12.0)), high: Some(Volt(11.0)), ms: 100 };
    nonsense[4].current.shunt_ohm = 0.0;
    nonsense[5].esc_telemetry = Some(EscTelemetry { pole_pairs: 0, asked: false });
    nonsense[6].back_emf = 101;
    nonsense[7].esc_telemetry = Some(EscTelemetry { pole_pairs: 11, asked: true }); // pulses cannot ask
    assert!(nonsense.iter().all(|config| !config.in_range()));
}

/// One channel of any kind is a rig, none is not.
#[test]
fn a_rig_measures_something() {
    let with = |marks, fitted| RigConfig { marks, fitted, ..factory() }.in_range();
    let load_cell = [true, false, false, false, false];
    assert!(with([0, 1, 0, 0], [false; 5]) && with([0; 4], load_cell) && with([2, 0, 0, 0], load_cell));
    assert!(!with([0; 4], [false; 5]));
}

/// An ESC that answers nothing is held at full throttle for 2 s or more, and for less than the time-out of the holding.
#[test]
fn a_silent_esc_is_held_long_enough_and_not_too_long() {
    let with = |hold_ms: u16, hold_min_ms: u32| {
        let mut config = factory();
        config.esc.answers = Answers::Silent { hold_ms };
        config.esc.hold_min_ms = hold_min_ms;
        config.in_range()
    };
    assert!(with(2000, 10_000) && with(9999, 10_000));
    assert!(!with(1999, 10_000), "too short to be noticed");
    assert!(!with(10_000, 10_000) && !with(20_000, 10_000), "the time-out would come first");
}

/// Between two limits there is room.
#[test]
fn limits_that_leave_no_room_are_refused() {
    let with = |low, high| {
        let mut config = factory();
        config.limits.voltage = Bounds { low: Some(Volt(low)), high: Some(Volt(high)), ms: 100 };
        config.in_range()
    };
    assert!(with(9.0, 13.0));
    assert!(!with(9.0, 9.0) && !with(13.0, 9.0));
}

/// A scale that was calibrated tells one number for each code, and errors that are lengths.
#[test]
fn a_calibrated_scale_is_a_scale() {
    let good = Calibrated {
        scale: AdcScale { zero: 2048.0, gain: -0.01 },
        zero_sigma: 0.0,
        gain_sigma: 0.1,
        residual: 0.1,
        worst: 0.2,
        points: 5,
        day: 1,
    };
    let possible = |calibrated| RigConfig { calibrated: [None, Some(calibrated), None, None, None], ..factory() }.in_range();
    assert!(possible(good));
    for nonsense in [f32::NAN, f32::INFINITY] {
        assert!(!possible(Calibrated { scale: AdcScale { zero: nonsense, ..good.scale }, ..good }));
        assert!(!possible(Calibrated { scale: AdcScale { gain: nonsense, ..good.scale }, ..good }));
    }
    assert!(!possible(Calibrated { scale: AdcScale { gain: 0.0, ..good.scale }, ..good }), "every code the same");
    for nonsense in [f32::NAN, f32::INFINITY, -0.1] {
        assert!(!possible(Calibrated { zero_sigma: nonsense, ..good }));
        assert!(!possible(Calibrated { gain_sigma: nonsense, ..good }));
        assert!(!possible(Calibrated { residual: nonsense, ..good }));
        assert!(!possible(Calibrated { worst: nonsense, ..good }));
    }
}

/// The arithmetic of the line is that of the codec: no sample is longer than what was reckoned with.
#[test]
fn no_sample_is_longer_than_the_arithmetic_says() {
    let rigs = [
        ([2, 1, 2, 25], [true; 5], (false, false)),
        ([2, 1, 2, 25], [true; 5], (true, true)),
        ([2, 0, 0, 0], [false; 5], (true, false)),
        ([0; 4], [true, false, false, true, false], (false, true)),
    ];
    for (marks, fitted, (telemetry, meter)) in rigs {
        let esc_telemetry = telemetry.then_some(EscTelemetry { pole_pairs: 11, asked: false });
        let config = RigConfig { marks, fitted, esc_telemetry, back_emf: if meter { 11 } else { 0 }, ..factory() };
        let capture =
            CaptureCode { edges: u16::MAX >> 2, span: u32::MAX >> 4, verdict: CaptureVerdict::Disagrees, uneven: 10_000 };
        let code = AdcCode { sum: u32::MAX >> 4, count: u16::MAX >> 2, rms_q8: 2047 * 256, verdict: AdcVerdict::Short };
        let absent = AdcCode { verdict: AdcVerdict::Absent, ..AdcCode::default() };
        let sample = RigSample {
            at: Ticks(1 << 48),
            pulse: PulseWidth::MAX,
            state: RigState::Faulted,
            faults: FaultSet((1 << 21) - 1),
            rpm: marks.map(|m| if m > 0 { capture } else { CaptureCode::default() }),
            adc: fitted.map(|f| if f { code } else { absent }),
            esc: telemetry.then_some(EscCode {
                verdict: EscVerdict::Nominal,
                temperature: u8::MAX,
                voltage: u16::MAX,
                current: u16::MAX,
                charge: u16::MAX,
                speed: u16::MAX,
                age_ms: 250,
            }),
            back_emf: meter.then_some(capture),
        };
        let mut wire = [0; MAX_WIRE];
        let used = Encoder::default().encode(Ticks(1 << 48), &Message::Rig(sample), &mut wire).unwrap();
        assert!(used as u32 <= config.sample_bytes(), "{used} bytes, reckoned {}", config.sample_bytes());
        assert!(used as u32 + 8 > config.sample_bytes(), "{used} bytes, reckoned {}", config.sample_bytes());
    }
}

/// The whole rig a thousand times a second, and room beside it for events, health and a burst.
#[test]
fn a_thousand_samples_a_second_of_every_channel_fit_the_line() {
    let esc_telemetry = Some(EscTelemetry { pole_pairs: 11, asked: false });
    let whole = RigConfig { log_period_ms: 1, ..factory() };
    assert!(whole.in_range() && whole.fitted == [true; 5] && whole.marks.iter().all(|marks| *marks > 0));
    assert!(whole.sample_bytes() * 1000 < LINE_BYTES_S * 2 / 3, "{} bytes a sample", whole.sample_bytes());
    let crossed = RigConfig { esc_telemetry, back_emf: 11, ..whole };
    assert!(crossed.sample_bytes() * 1000 < LINE_BYTES_S * 3 / 4, "{} bytes a sample", crossed.sample_bytes());
}

proptest! {
    /// Any damage of any one byte, and any cut, is noticed.
    #[test]
    fn damage_is_refused(at in 0usize..MAX_STORED, flip in 1u8..=255, cut in 0usize..MAX_STORED) {
        let mut buffer = [0; MAX_STORED];
        let stored = seal(&factory(), &mut buffer).unwrap().to_vec();
        let mut broken = stored.clone();
        broken[at % stored.len()] ^= flip;
        prop_assert_eq!(open::<RigConfig>(&broken), None);
        prop_assert_eq!(open::<RigConfig>(&stored[..cut % stored.len()]), None);
    }
}
