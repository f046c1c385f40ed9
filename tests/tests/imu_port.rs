//! `quadrig imu` against the portable IMU board behind a pseudo-terminal.

use firmware_ahrs::console::Asked;
use firmware_ahrs::{Ahrs, AhrsConfig, CommandLine, Console, Inputs, Sampler};
use frame::message::SettingsNews;
use frame::wire::{Encoder, MAX_WIRE};
use frame::{ImuFormat, Message, Ticks};
use hal_sim::clock::VirtualClock;
use hal_sim::imu::{BusFault, ChipKind, Errors, I2cBus, Motion};
use quadrig_tests::call;
use quadrig_tests::desk::Cable;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The board at rest, in real time, until it is told to quit. Its idle loop has no flash here.
fn play(mut cable: Cable, quit: &AtomicBool) {
    let clock = VirtualClock::default();
    let errors = Errors::drawn(4);
    let mut sampler = Sampler::new(I2cBus::new(clock.clone(), &ChipKind::ALL, Motion::LEVEL, &errors, BusFault::None));
    let mut console = Console::new(AhrsConfig::default(), Ahrs::hello(168_000_000, 0, sampler.alive()), None);
    let (mut line, mut encoder) = (CommandLine::new(), Encoder::default());
    let begun = Instant::now();
    for tick in 0u64.. {
        if quit.load(Ordering::Relaxed) {
            return;
        }
        std::thread::sleep(Duration::from_millis(5 * tick).saturating_sub(begun.elapsed()));
        clock.advance_to(5_000_000 * tick);
        let mut bytes = [0; 256];
        let heard = cable.hear(&mut bytes);
        bytes[..heard].iter().for_each(|b| line.take(*b));
        let now = Ticks::from_ms(5 * tick);
        let asked = Asked { heard: line.next_heard(), damaged: line.damaged(), ..Asked::default() };
        let mut say = |format: ImuFormat, message: &Message| {
            if format == ImuFormat::Binary {
                let mut wire = [0; MAX_WIRE];
                let used = encoder.encode(now, message, &mut wire).expect("it fits");
                cable.say(&wire[..used]);
            } else {
                cable.say(firmware_ahrs::text::line(message).expect("a line").as_bytes());
                cable.say(&[0]);
            }
        };
        if tick == 0 {
            console.greet(SettingsNews::Absent, &mut say);
        }
        console.tick(&Inputs { now, readings: sampler.read() }, &asked, &mut say);
    }
}

#[test]
fn the_words_of_the_board_are_those_of_the_command_line() {
    let (cable, port) = Cable::new().expect("a pseudo-terminal");
    let quit = Arc::new(AtomicBool::new(false));
    let board = std::thread::spawn({
        let quit = quit.clone();
        move || play(cable, &quit)
    });
    let folder = tempfile::tempdir().expect("a folder");
    let imu = |words: &[&str]| call(folder.path(), &[&["imu", "--port", &port], words].concat());
    assert!(imu(&["identify"]).succeeded().out.contains("imu board, firmware 0.1.0, sensors gyro accel mag"));
    let said = imu(&["calibrate", "gyro"]).succeeded().out;
    assert!(said.starts_with("ok\ngyro: offset ") && said.contains("readings 200"), "{said}");
    imu(&["send", "calibrated"]).succeeded();
    imu(&["format", "text"]).succeeded();
    imu(&["stream", "off"]).succeeded();
    let said = imu(&["once"]).succeeded().out;
    assert!(said.lines().any(|l| l.starts_with("cal,") && l.split(',').count() == 14), "{said}");
    assert!(imu(&["errors"]).succeeded().out.contains("lost 0,0,0,0"));
    imu(&["calibrate", "mag"]).succeeded();
    imu(&["finish", "now"]).refused(&["finish now", "--help"]);
    imu(&["cancel"]).succeeded();
    imu(&["--patience", "0", "errors"]).refused(&["--patience"]);
    call(folder.path(), &["imu", "--port", "/dev/no-such-port", "errors"]).refused(&["/dev/no-such-port"]);
    quit.store(true, Ordering::Relaxed);
    board.join().expect("the board lives");
}
