//! What is fuzzed: one function a way in, from any bytes.
//!
//! What it is: each takes bytes from outside as its program would and lets them be used. `fuzz/` runs them with a fuzzer; a test runs them on the
//! inputs that the fuzzer kept.
//! What can go wrong: a panic is a defect of what is called. Refusals are what is expected.
//! Units: none.
//! Reference: `fuzz/README.md`.

use crate::chip::{Chip, PAGE};
use firmware_rig::Config;
use firmware_rig::rig_config::RigConfig;
use firmware_rig::{AdcBlock, Beside, Delivered, RigConsole, Start};
use frame::message::{ClockNews, SettingsNews};
use frame::rig::{ADC_CHANNELS, CAPTURE_CHANNELS};
use frame::wire::{Decoder, Encoder, MAX_WIRE};
use frame::{Command, Message, Ticks};
use ident::flight::FlightModel;
use ident::inertial::InertialModel;
use ident::log::Log;
use ident::log::import::{self, Options};
use ident::model::Model;
use settings_store::{load, save};
use std::path::Path;

/// A way in.
pub type Target = fn(&[u8]);

/// All of them, by name.
pub const TARGETS: [(&str, Target); 12] = [
    ("wire", wire),
    ("rig_line", rig_line),
    ("imu_line", imu_line),
    ("settings", settings),
    ("log", log),
    ("flight_log", flight_log),
    ("table", table),
    ("recording", recording),
    ("model", model),
    ("scenario", scenario),
    ("mission", mission),
    ("schedule", schedule),
];

/// What a board sends, decoded by the host; and what the host sends, decoded by a board.
pub fn wire(data: &[u8]) {
    let (mut host, mut board) = (Decoder::default(), Decoder::default());
    for byte in data {
        let _ = host.push::<Message>(*byte);
        let _ = board.push::<Command>(*byte);
    }
    let (host, board) = (host.stats(), board.stats());
    assert!(host.good + host.damaged + host.foreign <= data.len() as u32 && board.good <= data.len() as u32);
}

/// The rig board, a tick every 48 bytes: the bytes as they are, and the commands that they spell, in frames.
pub fn rig_line(data: &[u8]) {
    let start = Start {
        reset_cause: 0,
        clock: ClockNews { crystal_hz: 8_000_000, measured_hz: 8_000_000 },
        stored: None,
        news: SettingsNews::Absent,
        ended: None,
    };
    let mut console = RigConsole::start(Ticks(0), Config::thesis_570kv(), &start);
    let mut encoder = Encoder::default();
    let adc: [AdcBlock; ADC_CHANNELS] = Default::default();
    for (k, part) in data.chunks(48).enumerate() {
        let now = Ticks(84_000 * (k as u64 + 1));
        part.iter().for_each(|byte| console.hear(*byte));
        let mut frame = [0; MAX_WIRE];
        let spelled = postcard::from_bytes::<Command>(part).ok().and_then(|c| encoder.encode(now, &c, &mut frame).ok());
        frame[..spelled.unwrap_or(0)].iter().for_each(|byte| console.hear(*byte));
        let delivered = Delivered {
            now,
            edges: [&[]; CAPTURE_CHANNELS],
            over_capture: [false; CAPTURE_CHANNELS],
            adc: &adc,
            beside: Beside::UNWIRED,
            brown_out: false,
            paused: false,
            stored: None,
            vitals: None,
        };
        let _ = console.look(false);
        let _ = console.tick(&delivered, |pulse, _| assert!((900_000..=2_200_000).contains(&pulse.0), "{pulse:?}"));
        while !console.queued().is_empty() {
            console.sent();
        }
    }
}

/// The IMU board's line: typed words and frames.
pub fn imu_line(data: &[u8]) {
    let mut line = firmware_ahrs::line::CommandLine::new();
    for byte in data {
        line.take(*byte);
        let _ = line.next_heard();
    }
}

/// Two sectors of flash with anything in them: loaded, stored over, and loaded again.
pub fn settings(data: &[u8]) {
    let mut flash = Chip::erased();
    flash.cells.iter_mut().zip(data).for_each(|(cell, byte)| *cell = *byte);
    let range = 0..2 * PAGE as u32;
    let _ = load::<RigConfig, _>(&mut flash, range.clone());
    let (found, _) = load::<firmware_ahrs::Settings, _>(&mut flash, range.clone());
    let own = found.unwrap_or_default();
    if save(&mut flash, range.clone(), &own) == SettingsNews::Saved {
        let (again, _) = load::<firmware_ahrs::Settings, _>(&mut flash, range);
        // by their words, for what is no number is not equal to itself
        assert_eq!(again.map(|s| format!("{s:?}")), Some(format!("{own:?}")), "what was stored is what is loaded");
    }
}

/// A rig log.
pub fn log(data: &[u8]) {
    if let Ok(log) = Log::parse("fuzzed.csv", data) {
        let mut text = Vec::new();
        log.write_to(&mut text).expect("memory takes what is written");
        let again = Log::parse("written.csv", text.as_slice()).expect("what was written is read");
        assert_eq!((again.len(), again.events.len()), (log.len(), log.events.len()));
    }
}

/// A flight log, and another program's text of a flight.
pub fn flight_log(data: &[u8]) {
    let _ = ident::log::flight_log::parse("fuzzed.csv", data);
    let _ = import::flight_from("fuzzed.csv", data);
}

/// Another program's table of a stand or an ESC.
pub fn table(data: &[u8]) {
    let _ = import::import_from("fuzzed.csv", data, &Options::default());
}

/// A flight controller's own recording: ULog, Blackbox.
pub fn recording(data: &[u8]) {
    let file = tempfile::NamedTempFile::with_prefix("fuzzed").expect("a temporary file");
    std::fs::write(file.path(), data).expect("a temporary file is written");
    let _ = import::flight(file.path());
    let _ = import::rotor(file.path(), 1);
}

/// A model of a powerplant, of a vehicle, of an IMU.
pub fn model(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let _ = Model::parse("fuzzed.toml", text);
    let _ = FlightModel::parse("fuzzed.toml", text);
    let _ = InertialModel::parse("fuzzed.toml", text);
}

/// A scenario.
pub fn scenario(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let _ = hal_sim::Scenario::parse(text, Path::new("fuzzed.toml"));
}

/// A mission, and an airframe.
pub fn mission(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let _ = hal_sim::mission::Mission::parse(text, Path::new("fuzzed.toml"));
}

/// A schedule.
pub fn schedule(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let _ = ::schedule::Plan::parse(text, Path::new("fuzzed.toml"));
}
