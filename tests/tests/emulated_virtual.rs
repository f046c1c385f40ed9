//! The flash image as a virtual board: in lock step, with hands at its bench and its settings in a file that the native board reads.

use frame::message::{Beep, Command, Event, Message, Setting, SettingsNews};
use frame::rig::RigState;
use frame::units::{PulseWidth, Ticks};
use frame::wire::{Decoder, Encoder, MAX_WIRE};
use hal_sim::emulated::{Machine, firmware};
use std::path::PathBuf;
use virtual_board::{BoardError, Hand, Kind, Order, VirtualBoard, switch_on};

/// Host of a virtual board.
struct Host {
    board: Box<dyn VirtualBoard>,
    encoder: Encoder,
    decoder: Decoder,
    say: Vec<u8>,
    heard: Vec<Message>,
    beeps: Vec<Beep>,
}

impl Host {
    fn new(order: &Order) -> Self {
        let board = switch_on(order).unwrap_or_else(|e| panic!("{e}"));
        let (encoder, decoder) = (Encoder::default(), Decoder::default());
        Self { board, encoder, decoder, say: Vec::new(), heard: Vec::new(), beeps: Vec::new() }
    }

    fn send(&mut self, command: Command) {
        let mut wire = [0; MAX_WIRE];
        let used = self.encoder.encode(Ticks::from_ms(self.board.ms()), &command, &mut wire).expect("it fits");
        self.say.extend_from_slice(&wire[..used]);
    }

    /// Lets time pass until `wanted` was heard; pings on the way.
    fn until<T>(&mut self, what: &str, ms: u64, mut wanted: impl FnMut(&Message) -> Option<T>) -> T {
        let end = self.board.ms() + ms;
        while self.board.ms() < end {
            if self.board.ms().is_multiple_of(200) {
                self.send(Command::Ping);
            }
            let sent = self.board.millisecond(&std::mem::take(&mut self.say)).unwrap_or_else(|e| panic!("{e}"));
            while let Some(beep) = self.board.beep() {
                self.beeps.push(beep);
                self.send(Command::Beep(beep));
            }
            let messages: Vec<Message> = sent.iter().filter_map(|b| self.decoder.push(*b)).map(|r| r.message).collect();
            self.heard.extend_from_slice(&messages);
            if let Some(found) = messages.iter().find_map(&mut wanted) {
                return found;
            }
        }
        panic!("no {what} within {ms} ms; heard {:?}", self.heard.last());
    }

    fn until_state(&mut self, state: RigState) {
        let reached = |m: &Message| matches!(m, Message::Event(Event::State { to, .. }) if *to == state).then_some(());
        self.until(&format!("{state:?}"), 15_000, reached);
    }

    fn news(&mut self) -> SettingsNews {
        self.until("settings", 3_000, |m| if let Message::Event(Event::Settings(news)) = m { Some(*news) } else { None })
    }
}

fn image() -> PathBuf {
    firmware("firmware-rig").unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn it_arms_turns_and_beeps_under_hands() {
    let mut host = Host::new(&Order { image: Some(image()), ..Order::default() });
    assert_eq!(host.board.kind(), Kind::RigImage);
    host.until("hello", 500, |m| matches!(m, Message::Hello(_)).then_some(()));
    host.send(Command::Arm);
    host.until_state(RigState::ArmHoldMin);
    host.board.hand(&Hand::Power(true)).expect("a switch");
    host.until_state(RigState::Armed);
    assert_eq!(host.beeps, [Beep::Long, Beep::Cells(3), Beep::Ready]);
    host.send(Command::SetPulse(PulseWidth::from_us(1400)));
    let turns =
        |m: &Message| matches!(m, Message::Rig(s) if s.pulse == PulseWidth::from_us(1400) && s.rpm[0].edges > 2).then_some(());
    host.until("a rotor that turns", 3_000, turns);
    let truth = host.board.meters().expect("meters");
    assert!(truth.run_s >= 0.0 && truth.plant.rpm > 500.0, "{truth:?}");
    host.board.hand(&Hand::StopLoop { open: true }).expect("a stop loop");
    host.until_state(RigState::Faulted);
}

/// Whether this emulator keeps what is stored in its flash. `cargo xtask test` builds one that does and says so.
fn keeps() -> bool {
    let keeps = Machine::new().unwrap_or_else(|error| panic!("{error}")).keeps_settings();
    assert!(keeps || std::env::var_os("QUADRIG_EMULATOR_KEEPS_FLASH").is_none(), "this emulator was to keep its flash");
    keeps
}

#[test]
fn what_the_image_stores_the_native_board_loads_and_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("flash.bin");
    let order = |image: Option<PathBuf>| Order { image, flash: Some(file.clone()), ..Order::default() };
    if !keeps() {
        let refused = switch_on(&order(Some(image()))).err().expect("no place for the settings");
        assert!(refused.to_string().contains("cargo xtask program"), "{refused}");
        eprintln!("SKIPPED the rest: the emulator as published drops stores to flash");
        return;
    }
    let store = |image: Option<PathBuf>, before: SettingsNews, link_ms: u16| {
        let mut host = Host::new(&order(image));
        assert_eq!(host.news(), before);
        host.send(Command::Configure(Setting::LinkMs(link_ms)));
        host.until("yes", 500, |m| matches!(m, Message::Event(Event::Accepted)).then_some(()));
        host.send(Command::SaveSettings);
        assert_eq!(host.news(), SettingsNews::Saved);
        host.until("a sample", 300, |m| matches!(m, Message::Rig(_)).then_some(())); // until what was stored lies in the file
        host.send(Command::Identify);
        host.until("hello", 500, |m| if let Message::Hello(hello) = m { Some(hello.config) } else { None })
    };
    let first = store(Some(image()), SettingsNews::Absent, 700);
    let second = store(None, SettingsNews::Loaded, 800);
    assert_ne!(first, second);
    let mut host = Host::new(&order(Some(image())));
    assert_eq!(host.until("hello", 500, |m| if let Message::Hello(hello) = m { Some(hello.config) } else { None }), second);
}

#[test]
fn an_image_that_is_none_is_refused_with_its_name() {
    let order = Order { image: Some("no/such.elf".into()), ..Order::default() };
    let refused = switch_on(&order).err().expect("refused");
    assert!(matches!(refused, BoardError::Emulator { .. }) && refused.to_string().contains("no/such.elf"), "{refused}");
    let folder = tempfile::tempdir().expect("a folder");
    let text = folder.path().join("text.elf");
    std::fs::write(&text, "no image").expect("a file");
    let refused = switch_on(&Order { image: Some(text), ..Order::default() }).err().expect("refused").to_string();
    assert!(refused.contains("text.elf: no program of a board; expected its ELF file"), "{refused}");
    // one that begins as a program and is none
    let broken = folder.path().join("broken.elf");
    std::fs::write(&broken, b"\x7fELF and no more").expect("a file");
    let mut board = switch_on(&Order { image: Some(broken), ..Order::default() }).unwrap_or_else(|e| panic!("{e}"));
    let ended = (0..100).find_map(|_| board.millisecond(&[]).err()).expect("it is told");
    assert!(ended.to_string().contains("broken.elf"), "{ended}");
}
