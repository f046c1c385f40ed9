//! A rig board on a pseudo-terminal: the portable firmware against the bench, in real time.
//!
//! What it is: one thread that holds a virtual board behind the master side of a pseudo-terminal, as `quadrig virtual` does; programs open the
//! other side as their serial port. The cable can be pulled and put back under the same name, with the board switched on all the while.
//! What can go wrong: a machine that is stopped for longer than the link time-out latches faults, here as on the bench; the
//! board's time stands still while its own thread is kept waiting.
//! Units: ms of real time.
//! Reference: specification `rig.md`; `formats.md`, "Telemetry".

use frame::message::{Beep, Message};
use frame::units::{PulseWidth, Ticks};
use frame::wire::Decoder;
use hal_sim::{Scenario, Truth};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;
use virtual_board::{Cable, Hand, Pace, RigBoard, VirtualBoard};

/// What the line does to the bytes of the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Line {
    /// Nothing.
    #[default]
    Clean,
    /// Garbage before a third of the frames, and one byte in [`DAMAGED`] damaged.
    Noisy,
}

/// A noisy line damages one byte in so many.
const DAMAGED: u64 = 397;

/// What the board has done so far.
#[derive(Debug, Default)]
struct Done {
    /// Pulses, one a millisecond.
    pulses: Vec<PulseWidth>,
    /// Samples that left the board whole while a program listened, by the board's time.
    whole: Vec<Ticks>,
    /// What was really there at the end of the last millisecond of each pulse that the ESC followed, by the pulse in us.
    levels: BTreeMap<u32, Truth>,
}

/// What hands are to do at the bench.
#[derive(Debug, Default)]
struct Hands {
    deeds: Vec<Hand>,
    /// Mass in gram, and the part of itself by which its pull swings.
    swinging: Option<(f64, f64)>,
}

/// A board behind a port.
pub struct Desk {
    /// Name of the port to open.
    pub port: String,
    beeps: Receiver<Beep>,
    power: Arc<AtomicBool>,
    cable: Arc<Mutex<Option<Cable>>>,
    done: Arc<Mutex<Done>>,
    hands: Arc<Mutex<Hands>>,
    thread: Option<JoinHandle<()>>,
    quit: Arc<AtomicBool>,
    /// The name is a link that is ours to move.
    link: Option<PathBuf>,
}

/// Lets `link` name the port `name`.
fn name_it(link: &Path, name: &str) {
    let _ = std::fs::remove_file(link);
    std::os::unix::fs::symlink(name, link).expect("a link in the test's own folder");
}

impl Desk {
    /// Switches a board on.
    ///
    /// # Panics
    /// When the system gives no pseudo-terminal.
    #[must_use]
    pub fn new(line: Line) -> Self {
        Self::with_rig(line, Scenario::default())
    }

    /// Switches a board on, as it left the factory, before another rig.
    ///
    /// # Panics
    /// When the system gives no pseudo-terminal.
    #[must_use]
    pub fn with_rig(line: Line, scenario: Scenario) -> Self {
        let (cable, port) = Cable::new().expect("a pseudo-terminal");
        let flag = || Arc::new(AtomicBool::new(false));
        let (power, quit) = (flag(), flag());
        let (cable, done) = (Arc::new(Mutex::new(Some(cable))), Arc::new(Mutex::new(Done::default())));
        let hands = Arc::new(Mutex::new(Hands::default()));
        let (sender, beeps) = channel();
        let thread = std::thread::spawn({
            let (power, quit, cable, done, hands) = (power.clone(), quit.clone(), cable.clone(), done.clone(), hands.clone());
            move || play(line, &scenario, &cable, (&power, &hands), &quit, &done, &sender)
        });
        Self { port, beeps, power, cable, done, hands, thread: Some(thread), quit, link: None }
    }

    /// Switches a board on whose port has a name that stays: `link`, as udev makes them.
    ///
    /// # Panics
    /// When the system gives no pseudo-terminal.
    #[must_use]
    pub fn named(line: Line, link: &Path) -> Self {
        let mut desk = Self::new(line);
        name_it(link, &desk.port);
        desk.port = link.to_string_lossy().into_owned();
        desk.link = Some(link.to_owned());
        desk
    }

    /// Connects the ESC's battery.
    pub fn power_the_esc(&self) {
        self.power.store(true, Ordering::Relaxed);
    }

    /// Pulls the cable: the port goes away, the board stays on.
    ///
    /// # Panics
    /// When the board's thread has panicked.
    pub fn unplug(&self) {
        *self.cable.lock().expect("the board lives") = None;
        if let Some(link) = &self.link {
            let _ = std::fs::remove_file(link);
        }
    }

    /// Puts the cable back. The port has its old name if it was made by [`Desk::named`].
    ///
    /// # Panics
    /// When the system gives no pseudo-terminal, or the board's thread has panicked.
    pub fn plug(&self) {
        let (cable, name) = Cable::new().expect("a pseudo-terminal");
        *self.cable.lock().expect("the board lives") = Some(cable);
        if let Some(link) = &self.link {
            name_it(link, &name);
        }
    }

    /// Does something at the bench.
    ///
    /// # Panics
    /// When the board's thread has panicked.
    pub fn hand(&self, hand: Hand) {
        self.hands.lock().expect("the board lives").deeds.push(hand);
    }

    /// Lets a mass swing on the load cell: its pull goes up and down by a part of itself, once in a second. `None` takes it off.
    ///
    /// # Panics
    /// When the board's thread has panicked.
    pub fn swing(&self, mass: Option<(f64, f64)>) {
        let mut hands = self.hands.lock().expect("the board lives");
        hands.swinging = mass;
        hands.deeds.push(Hand::Hang(0.0));
    }

    /// The next beep of the ESC.
    #[must_use]
    pub fn beep(&self, within: Duration) -> Option<Beep> {
        self.beeps.recv_timeout(within).ok()
    }

    /// Pulses that the board has commanded, one a millisecond.
    ///
    /// # Panics
    /// When the board's thread has panicked.
    #[must_use]
    pub fn pulses(&self) -> Vec<PulseWidth> {
        self.done.lock().expect("the board lives").pulses.clone()
    }

    /// What was really there in the last millisecond in which the ESC followed a pulse of `us`.
    ///
    /// # Panics
    /// When the board's thread has panicked.
    #[must_use]
    pub fn truth_at(&self, us: u32) -> Option<Truth> {
        self.done.lock().expect("the board lives").levels.get(&us).copied()
    }

    /// Times on the board's clock of the samples that left it whole while a program had the port open.
    ///
    /// # Panics
    /// When the board's thread has panicked.
    #[must_use]
    pub fn whole(&self) -> Vec<Ticks> {
        self.done.lock().expect("the board lives").whole.clone()
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        self.quit.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn play(
    line: Line,
    scenario: &Scenario,
    cable: &Mutex<Option<Cable>>,
    (power, hands): (&AtomicBool, &Mutex<Hands>),
    quit: &AtomicBool,
    done: &Mutex<Done>,
    beeps: &Sender<Beep>,
) {
    let mut board = RigBoard::new(scenario, None);
    let mut decoder = Decoder::default();
    let mut spoiler = Spoiler { line, sent: 0, runs_on: false };
    let mut pace = Pace::new(1.0);
    while !quit.load(Ordering::Relaxed) {
        let ms = board.ms() + 1;
        pace.wait(ms);
        board.hand(&Hand::Power(power.load(Ordering::Relaxed))).expect("the rig has a switch");
        let mut wanted = hands.lock().expect("nobody panics with it");
        for hand in wanted.deeds.drain(..) {
            board.hand(&hand).expect("the rig has it");
        }
        if let Some((grams, part)) = wanted.swinging {
            let now = 1.0 + part * (std::f64::consts::TAU * ms as f64 * 1.0e-3).sin();
            board.hand(&Hand::Hang(grams * now)).expect("the rig has a load cell");
        }
        drop(wanted);
        let mut bytes = [0; 512];
        let mut plugged = cable.lock().expect("nobody panics with it");
        let heard = plugged.as_mut().map_or(0, |cable| cable.hear(&mut bytes));
        let sent = board.millisecond(&bytes[..heard]).expect("nothing that could fail");
        while let Some(beep) = board.beep() {
            let _ = beeps.send(beep);
        }
        let truth = board.meters().expect("the rig's truth");
        let mut seen = done.lock().expect("nobody panics with it");
        seen.pulses.push(board.pulse());
        seen.levels.insert(truth.pulse_us.round() as u32, truth);
        drop(seen);
        for frame in sent.split_inclusive(|byte| *byte == 0) {
            let (bytes, whole) = spoiler.spoil(frame, ms);
            let arrived = plugged.as_mut().is_some_and(|cable| cable.say(&bytes));
            let message = frame.iter().find_map(|byte| decoder.push::<Message>(*byte)).map(|received| received.message);
            if let (true, true, Some(Message::Rig(sample))) = (arrived, whole, message) {
                done.lock().expect("nobody panics with it").whole.push(sample.at);
            }
        }
    }
}

/// What a bad line does.
struct Spoiler {
    line: Line,
    sent: u64,
    /// The end of the last frame was damaged: it runs into the next one.
    runs_on: bool,
}

impl Spoiler {
    /// The bytes of a frame as they come out of the line, and whether the frame in them is whole.
    fn spoil(&mut self, frame: &[u8], ms: u64) -> (Vec<u8>, bool) {
        if self.line == Line::Clean {
            return (frame.to_vec(), true);
        }
        let garbage = ms.is_multiple_of(3); // runs into the frame after it and costs it
        let mut bytes = if garbage { vec![0x55, 0xaa, (ms % 251) as u8, 7] } else { Vec::new() };
        let mut whole = !garbage && !self.runs_on;
        self.runs_on = false;
        for byte in frame {
            self.sent += 1;
            let damaged = self.sent.is_multiple_of(DAMAGED);
            whole &= !damaged;
            self.runs_on = damaged;
            bytes.push(if damaged { byte ^ 0x40 } else { *byte });
        }
        (bytes, whole)
    }
}
