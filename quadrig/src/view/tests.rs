//! The screen on terminals of several sizes.

use super::draw::{Ink, draw};
use super::glyphs::Glyphs;
use super::keys::{Prompt, Question};
use super::screen::{Course, Live, Recorded, Screen, Tone, Under};
use firmware_rig::{Config, RigConfig};
use frame::calibration::{AdcScale, Calibration};
use frame::esc::{EscCode, EscVerdict};
use frame::message::{Event, Message};
use frame::rig::{AdcCode, AdcVerdict, CaptureCode, CaptureVerdict, Fault, FaultSet, RigSample, RigState};
use frame::units::{PulseWidth, Ticks};
use ident::close::watch::Departure;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use std::time::Duration;

/// A rig that runs at 1300 us, its beam sensor lost.
fn running() -> Screen {
    let mut screen = Screen::new("/dev/ttyUSB0".to_owned());
    screen.configured(&RigConfig::of(&Config::thesis_570kv()));
    let adc = [AdcScale { zero: 100.0, gain: 0.02 }; 5];
    screen.take(&Message::Calibration(Calibration { timer_hz: 84_000_000, marks: [2, 1, 2, 25], adc, pole_pairs: [0; 2] }));
    let turning = CaptureCode { edges: 2, span: 84_000_000 / 50, verdict: CaptureVerdict::Nominal, uneven: 0 };
    let code = AdcCode { sum: 2000, count: 10, rms_q8: 0, verdict: AdcVerdict::Nominal };
    screen.take(&Message::Event(Event::State { from: RigState::Armed, to: RigState::Running, at: Ticks(0) }));
    for s in 0..30u64 {
        let sum = 2000 + 20 * s as u32;
        screen.now = Duration::from_secs(s);
        screen.take(&Message::Rig(RigSample {
            at: Ticks::from_ms(1000 * s),
            pulse: PulseWidth::from_us(1300),
            state: RigState::Running,
            faults: FaultSet::NONE,
            rpm: [CaptureCode { verdict: CaptureVerdict::Lost, ..turning }, turning, turning, turning],
            adc: [AdcCode { sum, ..code }; 5],
            esc: None,
            back_emf: None,
        }));
    }
    screen.course = Some(Course {
        name: "up and down".to_owned(),
        longest_s: 100.0,
        begun: Some(Duration::from_secs(9)),
        ..Course::default()
    });
    screen.recorded = Some(Recorded { file: "run.csv".to_owned(), rows: 300, waiting: false });
    screen
}

fn drawn(screen: &Screen, width: u16, height: u16, glyphs: Glyphs) -> Vec<String> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a test's terminal");
    terminal.draw(|frame| draw(frame, screen, Ink { glyphs, colours: true })).expect("it draws");
    let buffer = terminal.backend().buffer().clone();
    buffer.content().chunks(usize::from(width)).map(|row| row.iter().map(ratatui::buffer::Cell::symbol).collect()).collect()
}

#[test]
fn everything_is_there_at_80_by_24_and_at_120_by_40() {
    for (width, height) in [(80, 24), (120, 40)] {
        let lines = drawn(&running(), width, height, Glyphs::Blocks);
        let text = lines.join("\n");
        #[allow(clippy::print_stdout)] // for whoever runs the test with --nocapture
        {
            println!("{text}");
        }
        let wanted = [
            "/dev/ttyUSB0",
            "REC run.csv 300 rows",
            "RUNNING",
            "SPACE stops",
            "pulse  1300.0 us",
            "30 %",
            "up and down",
            "1:20 left",
            "rpm_beam",
            "LOST",
            "rpm_hall",
            "3000.0",
            "rev/min",
            "thrust_n",
            "voltage_v",
            "temp_c",
            "line: 0 frames good",
            "stop and quit",
            "PgUp",
            "keep clear",
        ];
        for words in wanted {
            assert!(text.contains(words), "{width}x{height}: no {words:?} in\n{text}");
        }
        assert!(lines.iter().any(|l| l.contains("thrust_n") && l.contains('█') && l.contains("-32.6 to 32.6")), "bar and limits");
        assert!(
            lines.iter().any(|l| l.contains("thrust_n") && l.contains('▁') && l.trim_end().ends_with('█')),
            "a trend that rises:\n{text}"
        );
    }
    let wide = drawn(&running(), 120, 40, Glyphs::Blocks).join("\n");
    let limit = Config::thesis_570kv().limits.speed.high.expect("a limit").0;
    assert!(wide.contains("limits") && wide.contains(&format!("{limit:.0}")), "limits where there is room:\n{wide}");
}

#[test]
fn a_second_opinion_stands_under_the_channels_and_says_when_it_fails() {
    let mut screen = running();
    assert_eq!(screen.second, None, "neither is fitted");
    let adc = [AdcScale { zero: 100.0, gain: 0.02 }; 5];
    let pole_pairs = [11; 2];
    screen.take(&Message::Calibration(Calibration { timer_hz: 84_000_000, marks: [2, 1, 2, 25], adc, pole_pairs }));
    let esc = EscCode { temperature: 41, voltage: 1148, current: 1234, charge: 77, speed: 451, ..EscCode::default() };
    let meter = CaptureCode { edges: 33, span: 84_000_000 / 20, verdict: CaptureVerdict::Nominal, uneven: 0 };
    let mut line = |verdict| {
        let esc = Some(EscCode { verdict, ..esc });
        screen.take(&Message::Rig(RigSample { at: Ticks::from_ms(40_000), esc, back_emf: Some(meter), ..RigSample::default() }));
        let lines = drawn(&screen, 80, 24, Glyphs::Blocks);
        lines.into_iter().find(|l| l.starts_with("ESC")).expect("a line of its own").trim_end().to_owned()
    };
    assert_eq!(line(EscVerdict::Nominal), "ESC 4100 rev/min 12.34 A 11.48 V 41 degC 77 mAh; back-EMF 3600.0 rev/min ok");
    assert_eq!(line(EscVerdict::Silent), "ESC: nothing heard; back-EMF 3600.0 rev/min ok");
}

#[test]
fn a_model_shows_its_floors_and_the_row_where_the_run_leaves_it() {
    let mut screen = running();
    screen.channels[4].floors = Some(-12.3);
    screen.under = Some(Under { model: "day.csv".to_owned(), stops: true, floors: 8.0, departure: None });
    let text = drawn(&screen, 80, 24, Glyphs::Blocks).join("\n");
    assert!(text.contains("floors") && text.contains("-12.3") && text.contains("stops the run at 8 noise floors"), "{text}");
    let departure = Departure { channel: "thrust_n", row: 123, t_s: 12.3, floors: -15.0, seen_row: 127, seen_s: 12.9 };
    screen.under = Some(Under { model: "day.csv".to_owned(), stops: true, floors: 8.0, departure: Some(departure) });
    let text = drawn(&screen, 80, 24, Glyphs::Blocks).join("\n");
    assert!(text.contains("LEFT ITS MODEL: thrust_n from row 123 (12.3 s) on"), "{text}");
}

#[test]
fn what_is_wrong_comes_first() {
    let mut screen = running();
    screen.take(&Message::Event(Event::Faults { faults: FaultSet::NONE.with(Fault::Overspeed), at: Ticks(0) }));
    screen.take(&Message::Event(Event::State { from: RigState::Running, to: RigState::Faulted, at: Ticks(0) }));
    let lines = drawn(&screen, 80, 24, Glyphs::Blocks);
    assert!(lines[1].contains("STOPPED") && lines[1].contains("overspeed") && lines[1].contains("SPACE stops"), "{}", lines[1]);
    screen.gone = Some("/dev/ttyUSB0: the port is gone".to_owned());
    screen.recorded = Some(Recorded { file: "run.csv".to_owned(), rows: 300, waiting: true });
    let lines = drawn(&screen, 80, 24, Glyphs::Blocks);
    assert!(lines[1].contains("the port is gone") && lines[0].contains("DISK FULL"), "{}\n{}", lines[0], lines[1]);
}

#[test]
fn any_size_draws_and_shows_the_state() {
    let mut screen = running();
    screen.bench = Some((true, false));
    screen.help = true;
    screen.tell(Tone::Bad, "x".repeat(500));
    for width in [1, 10, 39, 40, 79, 80, 200] {
        for height in [1, 2, 7, 8, 12, 24, 60] {
            for prompt in [None, Some(Prompt { question: Question::Pulse, typed: "12".to_owned() })] {
                screen.prompt = prompt;
                let lines = drawn(&screen, width, height, Glyphs::Plain);
                assert!(height < 2 || width < 40 || lines[1].contains("RUNNING"), "{width}x{height}: {}", lines[1]);
            }
        }
    }
}

#[test]
fn a_terminal_without_blocks_gets_ascii() {
    let lines = drawn(&running(), 100, 30, Glyphs::Plain);
    assert!(lines.iter().all(|l| l.is_ascii()), "{}", lines.join("\n"));
}

#[test]
fn a_watched_simulation_shows_its_controls() {
    let mut screen = running();
    screen.recorded = None;
    screen.live = Some(Live { speed: 4.0, paused: false, share: 0.5 });
    let text = drawn(&screen, 80, 24, Glyphs::Blocks).join("\n");
    assert!(text.contains("50 % done, 4 times the clock") && text.contains("pause") && !text.contains("not recorded"), "{text}");
}
