//! `quadrig rig` and `quadrig log` against the flash image: the emulated board behind a pseudo-terminal.
//!
//! No step waits for a clock. Each goes on with what the board or its ESC was heard to do, so that neither a slow emulator nor a slow
//! host changes what happens; the board is switched off when the last step is done.

use frame::message::{Beep, Event, Message};
use frame::rig::RigState;
use frame::units::PulseWidth;
use hal_sim::Scenario;
use hal_sim::emulated::rig::{Action, Heard, Operator, rig};
use quadrig_tests::{Said, call, quadrig};
use std::io::Write;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};
use virtual_board::Cable;

/// The board goes off by itself after this time, ms: nobody switched it off.
const AT_MOST_MS: u64 = 120_000;
/// Whoever waits longer than this for the next word of the board waits in vain.
const SILENCE: Duration = Duration::from_secs(60);
/// Pulse of the session, us.
const LIVE_US: u32 = 1200;

/// What the test may do to the bench.
#[derive(Debug, Default)]
struct Switches {
    esc_on: AtomicBool,
    board_off: AtomicBool,
}

/// Carries bytes between the board's serial line and a pseudo-terminal, and holds the emulator back to real time: a millisecond of the
/// board takes no less than one of the clock, and an emulator that was slow does not hurry afterwards.
struct Carrier {
    cable: Cable,
    last: Instant,
    switches: Arc<Switches>,
    /// Everything that is heard.
    news: Sender<Heard>,
}

impl Operator for Carrier {
    fn millisecond(&mut self, _: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        for heard in heard {
            let _ = self.news.send(*heard); // nobody listens after the last step
        }
        actions.push(Action::Power(self.switches.esc_on.load(Ordering::Relaxed)));
        std::thread::sleep(Duration::from_millis(1).saturating_sub(self.last.elapsed()));
        self.last = Instant::now();
    }

    fn line(&mut self, heard: &[u8], say: &mut Vec<u8>) {
        self.cable.say(heard);
        let mut bytes = [0; 256];
        let n = self.cable.hear(&mut bytes);
        say.extend(&bytes[..n]);
    }

    fn is_over(&self) -> bool {
        self.switches.board_off.load(Ordering::Relaxed)
    }
}

/// Waits until something is heard that `wanted` knows; `what` names it if it never comes.
fn until<T>(news: &Receiver<Heard>, what: &str, mut wanted: impl FnMut(&Heard) -> Option<T>) -> Result<T, String> {
    loop {
        let heard = news.recv_timeout(SILENCE).map_err(|error| format!("no {what}: {error}"))?;
        if let Some(found) = wanted(&heard) {
            return Ok(found);
        }
    }
}

fn until_state(news: &Receiver<Heard>, state: RigState) -> Result<(), String> {
    until(news, &format!("{state:?}"), |heard| match heard {
        Heard::Board(Message::Event(Event::State { to, .. })) => match to {
            to if *to == state => Some(Ok(())),
            RigState::Faulted => Some(Err(format!("faulted on the way to {state:?}"))),
            _ => None,
        },
        _ => None,
    })?
}

/// Waits for two samples with that pulse: a frame of the train lies between them.
fn until_pulse(news: &Receiver<Heard>, us: u32) -> Result<(), String> {
    let mut samples = 0;
    until(news, &format!("samples with {us} us"), |heard| {
        samples += u32::from(matches!(heard, Heard::Board(Message::Rig(sample)) if sample.pulse == PulseWidth::from_us(us)));
        (samples == 2).then_some(())
    })
}

/// The operator: connects the battery when the board holds minimum, types what the ESC beeps, sets a pulse, and leaves when it is there.
fn arm_and_turn(news: &Receiver<Heard>, switches: &Switches, mut keys: impl Write) -> Result<(), String> {
    let mut say = |line: &str| writeln!(keys, "{line}").map_err(|error| format!("{line}: {error}"));
    until_state(news, RigState::ArmHoldMin)?;
    switches.esc_on.store(true, Ordering::Relaxed);
    for state in [RigState::ArmCells, RigState::ArmReady, RigState::Armed] {
        let beep = until(news, "beep", |heard| if let Heard::Esc(beep) = heard { Some(*beep) } else { None })?;
        match beep {
            Beep::Long => say("long")?,
            Beep::Cells(n) => say(&format!("cells {n}"))?,
            Beep::Ready => say("ready")?,
            other => return Err(format!("the ESC beeps {other:?}")),
        }
        until_state(news, state)?;
    }
    say(&format!("set {LIVE_US}"))?;
    until_pulse(news, LIVE_US)?;
    say("quit")
}

#[test]
fn the_command_line_speaks_with_the_flash_image() {
    let folder = tempfile::tempdir().expect("a folder");
    let (cable, port) = Cable::new().expect("a pseudo-terminal");
    let _ = quadrig(); // built before the board is on
    let switches = Arc::new(Switches::default());
    let (sender, news) = channel();
    let carrier = Carrier { cable, last: Instant::now(), switches: switches.clone(), news: sender };
    let board =
        std::thread::spawn(move || rig(&Scenario::default(), carrier, AT_MOST_MS).unwrap_or_else(|error| panic!("{error}")));
    until(&news, "word of the board", |_| Some(())).unwrap(); // the emulator translates the image first

    let rig = |words: &[&str]| call(folder.path(), &[&["rig", "--port", &port], words].concat());
    let said = rig(&["identify"]).succeeded();
    assert!(said.out.contains("rig board, firmware"), "{}", said.out);
    rig(&["set", "1300"]).refused(&["not in this state"]);
    rig(&["configure", "link-ms", "5000"]).succeeded(); // a host that is kept waiting for seconds loses nothing here
    rig(&["configure", "log-ms", "50"]).succeeded();
    let said = call(folder.path(), &["log", "--port", &port, "-o", "image.csv", "--seconds", "1"]).succeeded();
    let log = std::fs::read_to_string(folder.path().join("image.csv")).expect("a log");
    assert!(log.starts_with("# quadrig-log 1\n"), "{log:.80}");
    let times = log.lines().filter(|l| !l.starts_with('#')).skip(1).map(|l| l.split(',').next().and_then(|t| t.parse().ok()));
    let times: Vec<f64> = times.collect::<Option<_>>().expect("every row has its time");
    // by the board's clock, so on a slow emulator too: 20 intervals of 50 ms at the least, and what else the last read brought
    assert!(times.len() >= 21, "{} rows; {}", times.len(), said.err);
    assert!(times.windows(2).all(|w| (w[1] - w[0] - 0.05).abs() < 1.0e-3), "{times:?}");

    while news.try_recv().is_ok() {} // what was said so far does not concern the session
    let words = ["rig", "--port", &port, "arm"];
    let mut child = Command::new(quadrig())
        .args(words)
        .current_dir(folder.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("quadrig starts");
    // the keyboard goes away with the operator: the session ends then, if it has not yet
    let done = arm_and_turn(&news, &switches, child.stdin.take().expect("its input"));
    let said = Said::new(&words, child.wait_with_output().expect("it ends"));
    done.unwrap_or_else(|what| panic!("{what}; it said {}{}", said.out, said.err));
    let said = said.succeeded();
    assert!(said.out.contains("Armed: keep clear") && said.out.contains("Running: keep clear"), "{}", said.out);
    rig(&["clear"]).succeeded();
    while news.try_recv().is_ok() {}
    until_pulse(&news, 1000).unwrap();

    switches.board_off.store(true, Ordering::Relaxed);
    let run = board.join().expect("the board did not panic");
    let heights: Vec<u64> = run.pulses.iter().map(|p| p.width_ns / 1000).collect();
    assert!(heights.contains(&u64::from(LIVE_US)) && heights.last() == Some(&1000), "live, then stopped: {heights:?}");
    println!("the board was on for {:.1} s", run.outcome.now_ns as f64 * 1e-9);
    run.outcome.accesses.only(&[]).unwrap();
}
