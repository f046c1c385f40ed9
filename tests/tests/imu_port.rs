//! `quadrig imu` against the portable IMU board behind a pseudo-terminal.

use hal_sim::scenario::ImuScenario;
use quadrig_tests::call;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use virtual_board::{Cable, ImuBoard, Pace, VirtualBoard};

/// The board at rest, in real time, until it is told to quit.
fn play(mut cable: Cable, quit: &AtomicBool) {
    let mut board = ImuBoard::new(&ImuScenario { seed: 4, ..ImuScenario::default() }, None);
    let mut pace = Pace::new(1.0);
    while !quit.load(Ordering::Relaxed) {
        pace.wait(board.ms() + 1);
        let mut bytes = [0; 256];
        let heard = cable.hear(&mut bytes);
        let sent = board.millisecond(&bytes[..heard]).expect("nothing that could fail");
        if !sent.is_empty() {
            cable.say(&sent);
        }
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
    assert!(imu(&["save"]).succeeded().out.contains("saved"), "its flash keeps it");
    imu(&["send", "calibrated"]).succeeded();
    imu(&["format", "text"]).succeeded();
    imu(&["stream", "off"]).succeeded();
    let said = imu(&["once"]).succeeded().out;
    assert!(said.lines().any(|l| l.starts_with("cal,") && l.split(',').count() == 14), "{said}");
    assert!(imu(&["errors"]).succeeded().out.contains("gyro 0, accel 0, mag 0, test accel 0"));
    imu(&["finish"]).refused(&["\"calibrate mag\" or \"calibrate align\" before \"finish\""]);
    assert!(imu(&["calibrate", "mag"]).succeeded().err.contains("turn it into every direction, then say \"finish\""));
    imu(&["finish", "now"]).refused(&["finish now", "--help"]);
    imu(&["cancel"]).succeeded();
    imu(&["--patience", "0", "errors"]).refused(&["--patience"]);
    call(folder.path(), &["imu", "--port", "/dev/no-such-port", "errors"]).refused(&["/dev/no-such-port"]);
    quit.store(true, Ordering::Relaxed);
    board.join().expect("the board lives");
}
