//! The rig board's flash image on the emulated microcontroller.
//!
//! What it is: the emulator on a thread of its own, in lock step with this program: it is given the bytes of a millisecond and the deeds of the hands, runs it,
//! and gives back what the board sent. Its time is as virtual as the native board's.
//! What can go wrong: an image that is none, an emulator that gives up ([`BoardError::Emulator`]); an emulator as published drops what is
//! stored in its flash, and a settings' file is refused then.
//! Units: ms.
//! Reference: `hal_sim::emulated`.

use crate::board::{BoardError, Kind, VirtualBoard};
use crate::flash_file::FlashFile;
use crate::hand::Hand;
use frame::message::Beep;
use hal_sim::emulated::Machine;
use hal_sim::emulated::rig::{Action, Heard, Operator, rig_from};
use hal_sim::{Scenario, Truth};
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// The board is on until it is dropped.
const FOR_EVER_MS: u64 = u64::MAX / 2_000_000;
/// Pulse from which on the motor is driven, us: the run begins.
const LIVE_US: f64 = 1000.5;

/// What one millisecond is given.
struct Asked {
    said: Vec<u8>,
    hands: Vec<Action>,
}

/// What it gives.
#[derive(Default)]
struct Given {
    sent: Vec<u8>,
    beeps: Vec<Beep>,
    truth: Truth,
    stored: Option<Vec<u8>>,
}

/// The far side of the lock step, inside the emulator.
struct InStep {
    asked: Receiver<Asked>,
    given: SyncSender<Given>,
    hands: Vec<Action>,
    next: Given,
    /// The pulse that the rig was given last, us; `next` has been handed over before the hands are asked.
    pulse_us: f64,
    begun: bool,
    over: bool,
}

impl Operator for InStep {
    fn line(&mut self, heard: &[u8], say: &mut Vec<u8>) {
        let Ok(Asked { said, hands }) = self.asked.recv() else {
            self.over = true;
            return;
        };
        say.extend(said);
        self.hands = hands;
        self.next.sent.extend_from_slice(heard);
        self.over |= self.given.send(std::mem::take(&mut self.next)).is_err();
    }

    fn millisecond(&mut self, _: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        let beeps = heard.iter().filter_map(|heard| if let Heard::Esc(beep) = heard { Some(*beep) } else { None });
        self.next.beeps.extend(beeps);
        actions.append(&mut self.hands);
        if !self.begun && self.pulse_us > LIVE_US {
            self.begun = true;
            actions.push(Action::StartRun);
        }
    }

    fn see(&mut self, truth: &Truth) {
        self.pulse_us = truth.pulse_us;
        self.next.truth = *truth;
    }

    fn stored(&mut self, sectors: &[u8]) {
        self.next.stored = Some(sectors.to_vec());
    }

    fn keeps_record(&self) -> bool {
        false
    }

    fn is_over(&self) -> bool {
        self.over
    }
}

/// The board.
pub struct ImageBoard {
    image: PathBuf,
    asked: Option<SyncSender<Asked>>,
    given: Receiver<Given>,
    thread: Option<JoinHandle<Option<String>>>,
    file: Option<FlashFile>,
    saves: u32,
    hands: Vec<Action>,
    beeps: VecDeque<Beep>,
    truth: Truth,
    powered: bool,
    ms: u64,
}

/// Whether a file begins as an ELF file does.
fn begins_as_an_image(image: &Path) -> bool {
    let mut magic = [0; 4];
    let read = std::fs::File::open(image).and_then(|mut file| std::io::Read::read_exact(&mut file, &mut magic));
    read.is_ok() && magic == *b"\x7fELF"
}

impl ImageBoard {
    /// The rig of a scenario before the image.
    ///
    /// # Errors
    /// [`BoardError`] when the image is not there, or its settings have no place.
    pub fn new(scenario: &Scenario, image: &Path, mut file: Option<FlashFile>) -> Result<Self, BoardError> {
        let fails = |what: String| BoardError::Emulator { image: image.to_owned(), what };
        std::fs::metadata(image)
            .map_err(|e| fails(format!("cannot be read ({e}); expected a board's ELF file: `cargo xtask image` builds it")))?;
        if !begins_as_an_image(image) {
            return Err(fails(
                "no program of a board; expected its ELF file: `cargo xtask image` builds it and says where".to_owned(),
            ));
        }
        let mut machine = Machine::new().map_err(|e| fails(e.to_string()))?;
        if file.is_some() && !machine.keeps_settings() {
            return Err(fails(
                "this program's emulator drops what is stored in flash; `cargo xtask program` builds one whose emulator keeps it"
                    .to_owned(),
            ));
        }
        if let Some(sectors) = file.as_mut().and_then(FlashFile::take) {
            machine = machine.with_settings(sectors.bytes());
        }
        let (asked, asks) = sync_channel(1);
        let (gives, given) = sync_channel(1);
        let operator = InStep {
            asked: asks,
            given: gives,
            hands: Vec::new(),
            next: Given::default(),
            pulse_us: 0.0,
            begun: false,
            over: false,
        };
        let (scenario, path) = (scenario.clone(), image.to_owned());
        let thread = std::thread::spawn(move || {
            rig_from(&path, machine, &scenario, operator, FOR_EVER_MS).err().map(|error| error.to_string())
        });
        Ok(Self {
            image: image.to_owned(),
            asked: Some(asked),
            given,
            thread: Some(thread),
            file,
            saves: 0,
            hands: Vec::new(),
            beeps: VecDeque::new(),
            truth: Truth::default(),
            powered: false,
            ms: 0,
        })
    }

    /// Why the emulator is gone.
    fn gone(&mut self) -> BoardError {
        let said = self.thread.take().and_then(|thread| thread.join().ok()).flatten();
        BoardError::Emulator { image: self.image.clone(), what: said.unwrap_or_else(|| "the emulator is gone".to_owned()) }
    }
}

impl VirtualBoard for ImageBoard {
    fn kind(&self) -> Kind {
        Kind::RigImage
    }

    fn millisecond(&mut self, said: &[u8]) -> Result<Vec<u8>, BoardError> {
        let ask = Asked { said: said.to_vec(), hands: std::mem::take(&mut self.hands) };
        let sent = self.asked.as_ref().is_some_and(|asked| asked.send(ask).is_ok());
        let given = if sent { self.given.recv().ok() } else { None };
        let Some(given) = given else { return Err(self.gone()) };
        self.ms += 1;
        self.truth = given.truth;
        self.beeps.extend(given.beeps);
        if let (Some(file), Some(sectors)) = (&mut self.file, given.stored) {
            self.saves += 1;
            file.keep(&sectors, self.saves)?;
        }
        Ok(given.sent)
    }

    fn ms(&self) -> u64 {
        self.ms
    }

    fn beep(&mut self) -> Option<Beep> {
        self.beeps.pop_front()
    }

    fn hand(&mut self, hand: &Hand) -> Result<(), &'static str> {
        if let Hand::Power(on) = hand {
            self.powered = *on;
        }
        self.hands.push(match *hand {
            Hand::Power(on) => Action::Power(on),
            Hand::StopLoop { open } => Action::StopKey(open),
            Hand::Hang(mass_g) => Action::Hang(mass_g),
            Hand::Twist(torque_nm) => Action::Twist(torque_nm),
            Hand::Draw(current_a) => Action::Draw(current_a),
            Hand::Supply(voltage_v) => Action::Supply(voltage_v),
            Hand::Plug { plug, out } => Action::Plug { plug, out },
            Hand::Reset => Action::Reset,
        });
        Ok(())
    }

    fn is_powered(&self) -> bool {
        self.powered
    }

    fn meters(&self) -> Option<Truth> {
        Some(self.truth)
    }
}

impl Drop for ImageBoard {
    fn drop(&mut self) {
        self.asked = None; // the emulator hears that nobody asks any more
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
