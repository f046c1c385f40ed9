use super::*;
use std::path::PathBuf;

fn parsed(text: &str) -> Result<(RigConfig, bool), String> {
    parse(text, Path::new("rig.toml"))
}

fn preset(name: &str) -> RigConfig {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../examples/rig").join(name);
    read(&path).unwrap_or_else(|e| panic!("{e}")).0
}

fn factory() -> RigConfig {
    RigConfig::of(&Config::thesis_570kv())
}

#[test]
fn what_is_written_reads_back_the_same() {
    let mut full = factory();
    full.calibrated[1] = Some(Calibrated {
        scale: AdcScale { zero: 2048.25, gain: -1.234_567e-5 },
        zero_sigma: 0.02,
        gain_sigma: 1e-9,
        residual: 0.001,
        worst: 0.002,
        points: 5,
        day: 20_781,
    });
    full.curve = Some([1000, 1250, 1400, 1700, 2000].map(PulseWidth::from_us));
    full.esc.answers = Answers::Silent { hold_ms: 4_000 };
    full.output = EscOutput::DShot600;
    full.esc_telemetry = Some(EscTelemetry { pole_pairs: 11, asked: true });
    full.back_emf = 7;
    full.limits.torque = Bounds { low: Some(NewtonMetre(-0.1)), high: None, ms: 250 };
    let half = RigConfig { output: EscOutput::DShot300, ..factory() };
    let presets = ["beam-only.toml", "load-cell-only.toml", "esc-telemetry.toml"].map(preset);
    for config in [factory(), full, half].into_iter().chain(presets) {
        let (again, scales) = parsed(&text(&config)).unwrap_or_else(|e| panic!("{e}\n{}", text(&config)));
        assert_eq!(again, config, "{}", text(&config));
        assert!(scales && again.digest() == config.digest());
    }
}

#[test]
fn the_presets_are_what_their_names_say() {
    assert_eq!(preset("thesis.toml"), factory());
    let digital = preset("dshot.toml");
    assert_eq!((digital.output, digital.esc.answers), (EscOutput::DShot600, Answers::LongReady));
    assert_eq!(RigConfig { output: EscOutput::Pwm, esc: factory().esc, ..digital }, factory());
    let fitted = |name: &str| {
        let config = preset(name);
        (config.marks, config.fitted)
    };
    assert_eq!(fitted("beam-only.toml"), ([2, 0, 0, 0], [false; 5]));
    assert_eq!(fitted("load-cell-only.toml"), ([0; 4], [true, false, false, false, false]));
    assert_eq!(fitted("hall-only.toml").0, [0, 0, 2, 0]);
    assert_eq!(fitted("three-blade.toml").0[0], 3);
    let second = preset("esc-telemetry.toml");
    assert_eq!((second.esc_telemetry, second.back_emf), (Some(EscTelemetry { pole_pairs: 11, asked: false }), 11));
    assert_eq!((factory().esc_telemetry, factory().back_emf), (None, 0));
}

#[test]
fn refusals_name_file_line_and_column() {
    let rate = "rate_hz = 10\n[speed]\nbeam = 2\n";
    for (text, start, word) in [
        ("rate_hz = 10\nspeeed = 1\n".to_owned(), "rig.toml:2:1: ", "speeed"),
        ("rate_hz = 7\n".to_owned(), "rig.toml:1:11: ", "divides 1000"),
        ("rate_hz = 10\n".to_owned(), "rig.toml:1:1: ", "nothing is fitted"),
        ("rate_hz = 10\n[speed]\nbeam = 101\n".to_owned(), "rig.toml:3:8: ", "1 to 100"),
        ("rate_hz = 10\n[speed]\nencoder = 102\n".to_owned(), "rig.toml:3:11: ", "multiple of 4"),
        (format!("{rate}[current]\nshunt_ohm = 0.0\ngain = 50\nzero_v = 0.2\n"), "rig.toml:5:13: ", "0.000001"),
        (format!("{rate}[current]\nshunt_ohm = 0.001\n"), "rig.toml:4:1: ", "gain"),
        (format!("{rate}[voltage]\ndivider = nan\n"), "rig.toml:5:11: ", "NaN"),
        (format!("{rate}[limits.voltage_v]\nlow = 12\nhigh = 11\nms = 100\n"), "rig.toml:6:8: ", "above the low one"),
        (format!("{rate}[limits.voltage_v]\nlow = 12\nms = 0\n"), "rig.toml:6:6: ", "whole number"),
        (format!("{rate}[limits.speed_rpm]\nhigh = 1e9\nms = 12\n"), "rig.toml:5:8: ", "30000"),
        (format!("{rate}[esc]\nanswers = \"loud\"\n"), "rig.toml:5:11: ", "long-cells-ready"),
        (format!("{rate}[esc]\noutput = \"dshot1200\"\n"), "rig.toml:5:10: ", "dshot600"),
        (
            format!(
                "{rate}[calibrated.thrust]\nzero_counts = 1\nper_count = 1\nresidual = 0\nworst = 0\npoints = 2\ndate = \"soon\"\n"
            ),
            "rig.toml:10:8: ",
            "2026-01-31",
        ),
        (format!("{rate}[esc_telemetry]\npole_pairs = 0\n"), "rig.toml:5:14: ", "1 to 100"),
        (format!("{rate}[esc_telemetry]\npole_pairs = 7\nasked = true\n"), "rig.toml:6:9: ", "dshot"),
        (format!("{rate}[back_emf]\npole_pairs = 7.5\n"), "rig.toml:5:14: ", "whole number"),
        ("rate_hz = \n".to_owned(), "rig.toml:1:", ""),
    ] {
        let message = parsed(&text).expect_err(&text);
        assert!(message.starts_with(start), "{message}");
        assert!(message.contains(word) && !message.contains('\n'), "{message}");
    }
}

#[test]
fn every_channel_is_sampled_up_to_a_thousand_times_a_second() {
    let whole = text(&factory()).replace("rate_hz = 10", "rate_hz = 1000");
    assert_eq!(parsed(&whole).map(|(c, _)| (c.log_period_ms, c.fitted)), Ok((1, [true; 5])));
}
