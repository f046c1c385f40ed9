//! The user's commands, typed and framed, to the flash image of the IMU board on the emulated STM32F405; calibration by command, stored
//! in its flash, there again after a reset and after a supply that fails in the midst of a save.
//!
//! Build the image first: `cargo xtask image`

use frame::message::SettingsNews;
use frame::wire::{Decoder, Encoder, MAX_WIRE};
use frame::{Command, Event, ImuCommand, ImuErrors, ImuFormat, ImuReport, ImuSensor, Message, Ticks};
use hal_sim::emulated::Machine;
use hal_sim::emulated::ahrs::{Act, AhrsRun, ChipKind, ahrs_by_script};
use hal_sim::imu::{Errors, Motion};

fn typed(line: &str) -> Act {
    Act::Say(format!("{line}\r\n").into_bytes())
}

fn framed(command: ImuCommand) -> Act {
    let mut wire = [0; MAX_WIRE];
    let used = Encoder::default().encode(Ticks::from_ms(1), &Command::Imu(command), &mut wire).expect("it fits");
    Act::Say(wire[..used].to_vec())
}

fn run(errors: &Errors, script: &[(u64, Act)], milliseconds: u64) -> AhrsRun {
    ahrs_by_script(Motion::LEVEL, &ChipKind::ALL, errors, script, milliseconds).unwrap_or_else(|error| panic!("{error}"))
}

/// Every message with its time of sending, ms since the reset before it.
fn messages(run: &AhrsRun) -> Vec<(u64, Message)> {
    let mut decoder = Decoder::default();
    run.outcome.telemetry.iter().filter_map(|b| decoder.push::<Message>(*b)).map(|r| (r.at.as_ms(), r.message)).collect()
}

fn errors_of(messages: &[(u64, Message)]) -> Vec<ImuErrors> {
    let report = |m: &(u64, Message)| if let Message::ImuReport(ImuReport::Errors(e)) = m.1 { Some(e) } else { None };
    messages.iter().filter_map(report).collect()
}

#[test]
fn every_command_of_the_line_is_obeyed_and_the_tick_keeps_its_time() {
    let script = [
        (100, typed("stream off")),
        (150, typed("once")),
        (200, typed("send both")),
        (210, framed(ImuCommand::Once)),
        (250, typed("format text")),
        (270, typed("once")),
        (290, typed("errors")),
        (310, typed("identify")),
        (330, typed("calibrate mag")),
        (350, typed("finish")),
        (400, typed("nonsense")),
        (450, framed(ImuCommand::Format(ImuFormat::Binary))),
        (460, framed(ImuCommand::Stream(true))),
        (700, framed(ImuCommand::Calibrate(ImuSensor::Accel))),
        (720, framed(ImuCommand::Finish)),
        (750, framed(ImuCommand::Errors)),
    ];
    let run = run(&Errors::default(), &script, 800);
    run.outcome.accesses.only(&[]).unwrap();
    let messages = messages(&run);
    let within = |from: u64, to: u64, kind: fn(&Message) -> bool| {
        messages.iter().filter(|(at, m)| (from..to).contains(at) && kind(m)).count()
    };
    let raw: fn(&Message) -> bool = |m| matches!(m, Message::Imu(_));
    let values: fn(&Message) -> bool = |m| matches!(m, Message::ImuValues(_));
    assert_eq!((within(0, 100, raw), within(0, 200, values)), (19, 0), "as from the factory: raw words");
    assert_eq!((within(110, 150, raw), within(150, 200, raw)), (0, 1), "off, then one on request");
    assert_eq!((within(210, 240, raw), within(210, 240, values)), (1, 1));
    let streamed = (within(500, 700, raw), within(500, 700, values));
    assert_eq!(streamed, (40, 40), "200 Hz of raw and calibrated");

    let text: String = run.outcome.telemetry.iter().map(|b| char::from(*b)).collect();
    // a frame may end, and the zero after it, where a line begins
    let lines = text.lines().filter_map(|l| l.rsplit(|c: char| c != ' ' && !c.is_ascii_graphic()).next());
    let lines: Vec<&str> = lines.filter(|l| l.len() > 1).collect();
    let has = |start: &str| lines.iter().any(|line| line.starts_with(start));
    for start in [
        "ok",
        "cal,0.2",
        "errors: alive 7, lost 0,0,0,0, saturated 0,0,0, stuck ",
        "imu board, firmware 0.1.0, sensors gyro accel mag",
        "mag: refused, 1 readings, 40 are needed",
        "refused: a value is out of range",
    ] {
        assert!(has(start), "no line {start:?}: {lines:#?}");
    }
    let errors = lines.iter().find(|l| l.starts_with("errors: ")).expect("an error report");
    assert!(errors.contains(", unusable 0, damaged 0, unknown 0, tick span "), "{errors}");
    let raw_line = lines.iter().find(|l| l.starts_with("raw,")).expect("a raw line");
    assert_eq!(raw_line.split(',').count(), 14, "{raw_line}");

    let refused =
        messages.iter().any(|(_, m)| matches!(m, Message::ImuReport(ImuReport::Refused { sensor: ImuSensor::Accel, .. })));
    assert!(refused, "no position was taken");
    let errors = errors_of(&messages).pop().expect("an error report");
    assert_eq!((errors.alive, errors.lost, errors.damaged, errors.unknown), (7, [0; 4], 0, 1));
    let nominal = Ticks::from_ms(5).0 as i64;
    let jitter = errors.tick_span.map(|t| (i64::from(t) - nominal) as f64 / 84.0);
    println!(
        "tick at 200 Hz: {:+.2} to {:+.2} us about 5 ms, {} core cycles at most of 840 000",
        jitter[0], jitter[1], errors.tick_cycles
    );
    assert!(jitter.iter().all(|us| us.abs() <= 2.0), "{jitter:?}");
    assert!((20_000..420_000).contains(&errors.tick_cycles), "{}", errors.tick_cycles);
}

/// Whether this emulator keeps what is stored in its flash. `cargo xtask test` builds one that does and says so.
fn keeps_flash() -> bool {
    let keeps = Machine::new().unwrap_or_else(|error| panic!("{error}")).keeps_settings();
    assert!(keeps || std::env::var_os("QUADRIG_EMULATOR_KEEPS_FLASH").is_none(), "this emulator was to keep its flash");
    if !keeps {
        eprintln!("SKIPPED: the emulator as published drops stores to flash; `cargo xtask test` builds one that keeps them");
    }
    keeps
}

/// From one reset to the next after the first save, ms.
const CYCLE: u64 = 100;
const SAVED_AT: u64 = 1400;

#[test]
fn a_calibration_survives_the_reset_and_a_supply_that_fails_in_the_midst_of_a_save() {
    if !keeps_flash() {
        return;
    }
    let mut errors = Errors { seed: 5, ..Errors::default() };
    errors.chips[0].bias = [0.05, -0.117, 0.023]; // chip axes
    errors.chips[0].noise = 0.0066; // 0.38 deg/s
    let mut script =
        vec![(50, typed("send calibrated")), (100, typed("calibrate gyro")), (1300, typed("save")), (SAVED_AT, Act::Reset)];
    // then again and again: the factory's calibration is to be saved, and the supply fails at one store after the other
    let cuts = [0, 1, 3, 10, 25];
    for (n, store) in cuts.into_iter().enumerate() {
        let at = SAVED_AT + CYCLE * n as u64;
        script.extend([(at + 60, typed("reset")), (at + 75, Act::FailAtStore(store)), (at + 76, typed("save"))]);
    }
    let run = run(&errors, &script, SAVED_AT + CYCLE * (cuts.len() as u64 + 1) - 40);
    let messages = messages(&run);
    let calibrated =
        messages.iter().find_map(|(_, m)| if let Message::ImuReport(ImuReport::Calibrated(c)) = m { Some(*c) } else { None });
    let calibrated = calibrated.unwrap_or_else(|| panic!("no calibration: {messages:?}"));
    let off = [0.05 - calibrated.offset[0], 0.117 - calibrated.offset[1], -0.023 - calibrated.offset[2]];
    println!("gyro offset {:?} +- {:?} rad/s", calibrated.offset, calibrated.sigma);
    assert!(off.iter().zip(calibrated.sigma).all(|(off, s)| off.abs() < 3.5 * s), "{off:?} {calibrated:?}");

    let news = messages.iter().filter_map(|(_, m)| if let Message::Event(Event::Settings(n)) = m { Some(*n) } else { None });
    let news: Vec<SettingsNews> = news.collect();
    let mut wanted = vec![SettingsNews::Absent, SettingsNews::Saved];
    wanted.extend([SettingsNews::Loaded; 6]);
    assert_eq!(news, wanted, "loaded at each start: never absent, never damaged");

    // from each start to the typed reset: the calibrated mode and the calibrated zero are in force again
    let starts: Vec<usize> = (0..messages.len()).filter(|i| matches!(messages[*i].1, Message::Hello(_))).collect();
    assert_eq!(starts.len(), 2 + cuts.len());
    for start in &starts[1..] {
        let values = messages[*start..].iter().take_while(|(at, _)| *at < 55);
        let rates: Vec<[f32; 3]> =
            values.filter_map(|(_, m)| if let Message::ImuValues(v) = m { Some(v.gyro) } else { None }).collect();
        assert!(rates.len() >= 5, "{}", rates.len());
        let mean = [0, 1, 2].map(|i| rates.iter().map(|r| r[i]).sum::<f32>() / rates.len() as f32);
        assert!(mean.iter().all(|w| w.abs() < 0.01), "{mean:?}");
    }
    assert!(run.stores > 30, "{} stores", run.stores);
    assert_eq!(run.outcome.accesses.resets.len(), 1 + cuts.len(), "{:?}", run.outcome.accesses.resets);
}

/// The last byte was being read as one too many came: the flag stands, no byte waits, and only reading both registers takes it down.
#[test]
fn an_overrun_without_a_byte_costs_no_more_than_itself() {
    let script = [(200, Act::Overrun), (300, framed(ImuCommand::Errors))];
    let run = run(&Errors::default(), &script, 500);
    let messages = messages(&run);
    let after = messages.iter().filter(|(at, m)| *at > 210 && matches!(m, Message::Imu(_))).count();
    assert!(after > 40, "{after} samples after it, of 58");
    assert_eq!(errors_of(&messages).len(), 1, "and commands are heard");
}
