//! Everything that stands around a tick of the rig: the same shell on the board, in the native run and in the fault campaign.
//!
//! What it is: [`RigConsole`] takes the bytes of the line and what the peripherals delivered, looks for a stop twice a millisecond, calls
//! [`Rig::tick`] with complete inputs, and queues the frames that leave the board. A host only moves bytes and registers.
//! What can go wrong: a full queue drops a whole frame, which the far end sees as a gap in the sequence; what can go wrong with a
//! command stands in [`crate::line`].
//! Units: ticks of the capture timer; bytes.
//! Reference: specification `formats.md`, "Telemetry"; `rig.md`, "Acquisition"; house rule 12 (one shell, many hosts).

use crate::burst::{Burst, Conversions};
use crate::config::Config;
use crate::cross::Beside;
use crate::health::{HealthWatch, Vitals};
use crate::line::CommandLine;
use crate::rig::{Inputs, Rig};
use crate::rig_config::RigConfig;
use crate::sampling::AdcBlock;
use crate::stop::{Half, StopWatch};
use frame::calibration::Calibration;
use frame::message::{ClockNews, Command, Event, Message, SettingsNews, Trial};
use frame::rig::{ADC_CHANNELS, CAPTURE_CHANNELS, Fault, Refusals};
use frame::units::{PulseWidth, Ticks};
use frame::wire::{Encoder, MAX_WIRE};
use heapless::Vec;

/// Bytes that may wait for the line.
pub const QUEUED: usize = 1024;
/// Room in the queue that a part of a burst needs: its own frame, and two that do not wait for it.
const PART_ROOM: usize = 3 * MAX_WIRE;

/// What a board finds when it starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Reset cause: bits 31..24 of RCC_CSR (RM0090 section 7.3.21), shifted down.
    pub reset_cause: u8,
    /// What its clock runs from.
    pub clock: ClockNews,
    /// What was found in flash.
    pub stored: Option<RigConfig>,
    /// And what became of it.
    pub news: SettingsNews,
    /// What ended the program before the reset.
    pub ended: Option<Event>,
}

/// What the peripherals delivered since the last tick. Nothing here has a default: a host that lacks an input has to say so.
#[derive(Debug, Clone, Copy)]
pub struct Delivered<'a> {
    /// 64-bit extended ticks of the capture timer.
    pub now: Ticks,
    /// Raw 32-bit captures since the last tick, a slice a channel, in order.
    pub edges: [&'a [u32]; CAPTURE_CHANNELS],
    /// The channel's over-capture flag was set, or its queue was full.
    pub over_capture: [bool; CAPTURE_CHANNELS],
    /// What the converter delivered since the last tick.
    pub adc: &'a [AdcBlock; ADC_CHANNELS],
    /// What arrived for the cross-checks: the ESC's telemetry, the back-EMF meter.
    pub beside: Beside<'a>,
    /// The voltage detector sees the board's own supply too low.
    pub brown_out: bool,
    /// The board itself held the tick up since the last one (it erased flash, which stops the processor).
    pub paused: bool,
    /// What became of the settings that were given to be stored, once.
    pub stored: Option<SettingsNews>,
    /// What the processor measures of itself; `None` on a host without one.
    pub vitals: Option<Vitals>,
}

/// What the host has to do after a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Orders {
    /// Store the settings in force ([`Rig::settings`]).
    pub store: bool,
    /// Make this trial of the last resort.
    pub trial: Option<Trial>,
    /// What was told, for the host's own log.
    pub event: Option<Event>,
}

/// The board from a reset on.
#[derive(Debug, Clone)]
pub struct RigConsole {
    rig: Rig,
    line: CommandLine,
    stops: StopWatch,
    encoder: Encoder,
    queue: Vec<u8, QUEUED>,
    told: Calibration,
    /// Configuration that was told.
    revision: u8,
    reset_cause: u8,
    health: HealthWatch,
    burst: Burst,
}

impl RigConsole {
    /// The shell after a reset at `now`: who speaks, how its codes are meant, and what it found.
    #[must_use]
    pub fn start(now: Ticks, factory: Config, start: &Start) -> Self {
        let settings = start.stored.unwrap_or_else(|| RigConfig::of(&factory));
        // the rig is large: it is made where it stays
        let mut console = Self {
            told: factory.calibration(), // until it introduces itself, below
            revision: 0,
            rig: Rig::with_settings(factory, settings),
            line: CommandLine::new(),
            stops: StopWatch::default(),
            encoder: Encoder::default(),
            queue: Vec::new(),
            reset_cause: start.reset_cause,
            health: HealthWatch::default(),
            burst: Burst::default(),
        };
        if start.clock.crystal_hz == 0 {
            console.rig.stand(Fault::ClockFailed);
        }
        console.introduce(now);
        console.say(now, &Message::Event(Event::Settings(start.news)));
        console.say(now, &Message::Event(Event::Clock(start.clock)));
        if let Some(ended) = start.ended {
            console.say(now, &Message::Event(ended));
        }
        console
    }

    /// The portable firmware, for reading.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Takes one byte of the line.
    pub fn hear(&mut self, byte: u8) {
        self.line.take(byte);
    }

    /// Called twice a millisecond, after the bytes of the line: whether minimum is to be written to the pulse timer at once, and whether the
    /// tick is due. `open` is the stop loop's pin.
    pub fn look(&mut self, open: bool) -> Half {
        self.stops.half(open, self.line.stop_waits())
    }

    /// Whether the next [`RigConsole::look`] is followed by a control tick: its time and captures are taken first.
    #[must_use]
    pub fn tick_is_next(&self) -> bool {
        self.stops.tick_is_next()
    }

    /// One control tick. `give` takes the pulse for the ESC's next frame, and whether a DShot frame asks for telemetry with
    /// it, before anything is told.
    pub fn tick(&mut self, delivered: &Delivered<'_>, give: impl FnOnce(PulseWidth, bool)) -> Orders {
        let now = delivered.now;
        let (command, line) = self.line.next_command();
        let outputs = self.rig.tick(&Inputs {
            now,
            edges: delivered.edges,
            over_capture: delivered.over_capture,
            adc: delivered.adc,
            beside: delivered.beside,
            command,
            line,
            stop_input: self.stops.take(),
            brown_out: delivered.brown_out,
            paused: delivered.paused,
        });
        give(outputs.pulse, outputs.ask_esc);
        if let Some(channel) = outputs.burst {
            self.burst.begin(channel);
        }
        if let Some(news) = delivered.stored {
            self.say(now, &Message::Event(Event::Settings(news)));
        }
        if let Some(health) = self.health.tick(now, self.frames(), self.rig.esc_counts(), delivered.vitals.as_ref()) {
            self.say(now, &Message::Health(health));
        }
        if let Some(sample) = outputs.sample {
            self.say(now, &Message::Rig(sample));
        }
        if let Some(event) = outputs.event {
            self.say(now, &Message::Event(event));
        }
        if let Some(Command::ConfigRead { at }) = command {
            self.tell_config(now, at);
        }
        if command == Some(Command::Identify) || self.revision != self.rig.revision() {
            self.introduce(now);
        } else if command == Some(Command::Tare) || self.rig.calibration() != self.told {
            self.tell_calibration(now);
        }
        Orders { store: outputs.store, trial: outputs.trial, event: outputs.event }
    }

    /// The analogue channel of which every single conversion is wanted: see [`RigConsole::record`].
    #[must_use]
    pub fn wanted(&self) -> Option<usize> {
        self.burst.wanted()
    }

    /// Called after each tick: takes the conversions of the channel that was [`RigConsole::wanted`] before it into `memory`, and queues a part
    /// of a whole burst when the line has room beside the samples.
    pub fn record(&mut self, now: Ticks, conversions: &Conversions<'_>, memory: &mut [u16]) {
        self.burst.take(now, conversions, memory);
        if self.queue.len() + PART_ROOM > QUEUED {
            return;
        }
        if let Some(part) = self.burst.part(memory) {
            self.say(now, &Message::BurstPart(part));
            self.burst.sent(memory);
        }
    }

    /// Bytes that wait for the line.
    #[must_use]
    pub fn queued(&self) -> &[u8] {
        &self.queue
    }

    /// The waiting bytes are on their way.
    pub fn sent(&mut self) {
        self.queue.clear();
    }

    /// Frames heard: good, damaged, replayed.
    fn frames(&self) -> [u16; 3] {
        let stats = self.line.stats();
        [stats.good as u16, stats.damaged as u16, self.line.replayed() as u16]
    }

    fn introduce(&mut self, now: Ticks) {
        self.revision = self.rig.revision();
        let hello = self.rig.hello(self.reset_cause);
        self.say(now, &Message::Hello(hello));
        self.tell_calibration(now);
    }

    fn tell_config(&mut self, now: Ticks, at: u16) {
        let refused = Message::Event(Event::Refused(Refusals(Refusals::OUT_OF_RANGE)));
        let message = self.rig.settings().part(at).map_or(refused, Message::ConfigPart);
        self.say(now, &message);
    }

    fn tell_calibration(&mut self, now: Ticks) {
        self.told = self.rig.calibration();
        self.say(now, &Message::Calibration(self.told));
    }

    /// Queues one message, whole or not at all.
    fn say(&mut self, now: Ticks, message: &Message) {
        let mut wire = [0; MAX_WIRE];
        if let Ok(used) = self.encoder.encode(now, message, &mut wire)
            && let Some(bytes) = wire.get(..used)
        {
            let _ = self.queue.extend_from_slice(bytes); // full: the far end sees the gap in the sequence
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use frame::rig::RigState;
    use frame::wire::Decoder;

    fn started() -> RigConsole {
        let clock = ClockNews { crystal_hz: 8_000_000, measured_hz: 8_010_000 };
        let start = Start { reset_cause: 0x0E, clock, stored: None, news: SettingsNews::Absent, ended: None };
        RigConsole::start(Ticks(0), Config::thesis_570kv(), &start)
    }

    fn messages(console: &mut RigConsole) -> std::vec::Vec<Message> {
        let mut decoder = Decoder::default();
        let told = console.queued().iter().filter_map(|b| decoder.push(*b)).map(|r| r.message).collect();
        console.sent();
        told
    }

    fn adc() -> [AdcBlock; ADC_CHANNELS] {
        [1427, 2048, 248, 0, 900].map(|code| {
            let mut block = AdcBlock::default();
            (0..8).for_each(|_| block.push(code));
            block
        })
    }

    fn delivered(ms: u64, adc: &[AdcBlock; ADC_CHANNELS]) -> Delivered<'_> {
        Delivered {
            now: Ticks::from_ms(ms),
            edges: [&[]; CAPTURE_CHANNELS],
            over_capture: [false; CAPTURE_CHANNELS],
            adc,
            beside: Beside::UNWIRED,
            brown_out: false,
            paused: false,
            stored: None,
            vitals: None,
        }
    }

    #[test]
    fn after_a_reset_it_says_who_it_is_and_what_it_found() {
        let told = messages(&mut started());
        assert!(matches!(
            told[..],
            [
                Message::Hello(_),
                Message::Calibration(_),
                Message::Event(Event::Settings(SettingsNews::Absent)),
                Message::Event(Event::Clock(_))
            ]
        ));
    }

    #[test]
    fn a_stop_on_the_line_is_minimum_at_the_next_look_and_a_fault_at_the_next_tick() {
        let mut console = started();
        messages(&mut console);
        let mut wire = [0; MAX_WIRE];
        let used = Encoder::default().encode(Ticks(1), &Command::Stop, &mut wire).unwrap();
        assert!(!console.tick_is_next() && !console.look(false).minimum);
        assert!(console.tick_is_next() && console.look(false).tick);
        console.tick(&delivered(1, &adc()), |_, _| ());
        wire[..used].iter().for_each(|b| console.hear(*b));
        assert!(console.look(false).minimum);
        assert!(console.look(false).tick);
        let mut given = None;
        console.tick(&delivered(2, &adc()), |pulse, _| given = Some(pulse));
        assert_eq!(given, Some(PulseWidth::MIN));
        assert!(console.rig().faults().contains(Fault::OperatorStop));
    }

    #[test]
    fn an_open_stop_loop_that_one_look_saw_reaches_the_tick() {
        let mut console = started();
        console.look(false);
        console.look(false);
        console.tick(&delivered(1, &adc()), |_, _| ());
        assert!(console.look(true).minimum, "seen half a millisecond before the tick");
        console.look(false);
        console.tick(&delivered(2, &adc()), |_, _| ());
        assert!(console.rig().faults().contains(Fault::OperatorStop));
    }

    /// Crossed wires, or an adapter that echoes: nothing of its own telemetry is obeyed, least of all as `Arm`.
    #[test]
    fn a_board_that_hears_itself_obeys_nothing() {
        let mut console = started();
        for ms in 1..3_000 {
            for byte in console.queued().to_vec() {
                console.hear(byte);
            }
            console.sent();
            console.tick(&delivered(ms, &adc()), |pulse, _| assert_eq!(pulse, PulseWidth::MIN));
            assert_eq!(console.rig().state(), RigState::Disarmed, "{ms} ms");
        }
    }

    #[test]
    fn a_full_queue_drops_whole_frames() {
        let mut console = started();
        for ms in 1..3_000 {
            console.tick(&delivered(ms, &adc()), |_, _| ());
        }
        assert!(console.queued().len() <= QUEUED);
        assert_eq!(console.queued().last(), Some(&0), "it ends with a frame's end");
    }

    /// Says `command` and ticks on; what is told meanwhile.
    fn answered(console: &mut RigConsole, ms: &mut u64, command: &Command) -> std::vec::Vec<Message> {
        let mut wire = [0; MAX_WIRE];
        let mut host = Encoder::default();
        let used = host.encode(Ticks::from_ms(*ms + 1), command, &mut wire).unwrap();
        wire[..used].iter().for_each(|b| console.hear(*b));
        let mut told = std::vec::Vec::new();
        for _ in 0..5 {
            *ms += 1;
            console.tick(&delivered(*ms, &adc()), |_, _| ());
            told.extend(messages(console));
        }
        told
    }

    fn count(told: &[Message], is: fn(&Message) -> bool) -> usize {
        told.iter().filter(|message| is(message)).count()
    }

    /// A crystal that is not known keeps the rig at minimum until a reset finds a good one; a known one raises nothing.
    #[test]
    fn a_board_without_a_crystal_stands_still() {
        let console = |crystal_hz| {
            let clock = ClockNews { crystal_hz, measured_hz: 0 };
            let ended = Some(Event::Panicked { line: 7, file: [0; 24] });
            let start = Start { reset_cause: 0x0E, clock, stored: None, news: SettingsNews::Absent, ended };
            RigConsole::start(Ticks(0), Config::thesis_570kv(), &start)
        };
        assert!(console(8_000_000).rig().faults().is_empty());
        let (mut failed, mut ms) = (console(0), 0);
        assert!(
            messages(&mut failed).contains(&Message::Event(Event::Panicked { line: 7, file: [0; 24] })),
            "what ended it is told"
        );
        for command in [Command::ClearFaults, Command::Arm] {
            answered(&mut failed, &mut ms, &command);
            assert!(failed.rig().faults().contains(Fault::ClockFailed));
            assert_eq!(failed.rig().state(), RigState::Disarmed, "{command:?}");
        }
    }

    /// The scales come with whoever introduces itself, after a tare and after a change, and not with every tick.
    #[test]
    fn it_introduces_itself_when_asked_and_when_it_is_another() {
        let (mut console, mut ms) = (started(), 0);
        let hellos: fn(&Message) -> bool = |m| matches!(m, Message::Hello(_));
        let scales: fn(&Message) -> bool = |m| matches!(m, Message::Calibration(_));
        messages(&mut console);
        answered(&mut console, &mut ms, &Command::Ping);
        for _ in 0..50 {
            answered(&mut console, &mut ms, &Command::Ping);
        }
        for (command, introduced, scaled) in [
            (Command::Ping, 0, 0),
            (Command::Identify, 1, 1),
            (Command::Tare, 0, 1),
            (Command::Tare, 0, 1),
            (Command::Configure(frame::message::Setting::LogPeriodMs(50)), 1, 1),
            (Command::Ping, 0, 0),
        ] {
            let told = answered(&mut console, &mut ms, &command);
            assert_eq!((count(&told, hellos), count(&told, scales)), (introduced, scaled), "{command:?}");
        }
    }

    /// Part by part a host reads the configuration in force; behind its end there is none.
    #[test]
    fn the_configuration_can_be_read() {
        let (mut console, mut ms) = (started(), 0);
        messages(&mut console);
        let mut form = std::vec::Vec::new();
        loop {
            let told = answered(&mut console, &mut ms, &Command::ConfigRead { at: form.len() as u16 });
            let Some(part) = told.iter().find_map(|m| if let Message::ConfigPart(part) = m { Some(*part) } else { None }) else {
                let refused = Message::Event(Event::Refused(Refusals(Refusals::OUT_OF_RANGE)));
                assert!(told.contains(&refused), "{told:?}");
                break;
            };
            assert_eq!(usize::from(part.at), form.len());
            let rest = usize::from(part.length) - form.len();
            form.extend(part.bytes.iter().take(rest));
        }
        assert_eq!(RigConfig::from_form(&form), Some(console.rig().settings()));
    }

    /// What the host sent in vain stands in the report of every second.
    #[test]
    fn frames_are_counted_good_damaged_and_replayed() {
        let (mut console, mut host) = (started(), Encoder::default());
        let framed = |host: &mut Encoder| {
            let mut wire = [0; MAX_WIRE];
            let used = host.encode(Ticks(1), &Command::Ping, &mut wire).unwrap();
            wire[..used].to_vec()
        };
        let last = (0..3).map(|_| framed(&mut host)).inspect(|frame| frame.iter().for_each(|b| console.hear(*b))).last().unwrap();
        [&last, &last].into_iter().flatten().for_each(|b| console.hear(*b));
        for _ in 0..2 {
            let mut hurt = framed(&mut host);
            hurt[3] ^= 0x55;
            hurt.iter().for_each(|b| console.hear(*b));
        }
        console.tick(&delivered(1, &adc()), |_, _| ());
        let told = messages(&mut console);
        let health = told.iter().find_map(|m| if let Message::Health(health) = m { Some(*health) } else { None }).unwrap();
        assert_eq!(health.frames, [5, 2, 2], "a frame that comes again is whole");
    }

    /// What was handed to the line is not handed to it again.
    #[test]
    fn what_was_sent_is_gone() {
        let mut console = started();
        assert!(!console.queued().is_empty());
        console.sent();
        assert!(console.queued().is_empty());
    }

    /// The conversions of the channel that was asked for leave in parts, and only where samples and answers have room beside them.
    #[test]
    fn a_burst_leaves_beside_the_samples() {
        let (mut console, mut ms, mut memory) = (started(), 0, [0; 96]);
        messages(&mut console);
        assert_eq!(console.wanted(), None);
        answered(&mut console, &mut ms, &Command::Burst { channel: 3 });
        assert_eq!(console.wanted(), Some(3));
        let codes = core::array::from_fn::<u16, 96, _>(|n| n as u16);
        let room = QUEUED - 3 * MAX_WIRE;
        console.queue.resize(room + 1, 1).unwrap();
        let record = |console: &mut RigConsole, memory: &mut [u16]| {
            let before = console.queued().len();
            console.record(Ticks(9), &Conversions { codes: Some(&codes), rate_hz: 61_765.0 }, memory);
            console.queued().len() - before
        };
        assert_eq!(record(&mut console, &mut memory), 0, "no room");
        assert_eq!((console.wanted(), memory), (None, codes), "it is recorded");
        console.queue.truncate(room);
        console.queue.pop();
        console.queue.push(0).unwrap();
        assert!(record(&mut console, &mut memory) > 96, "its part");
        let told = messages(&mut console);
        assert!(matches!(told[..], [Message::BurstPart(part)] if part.codes.as_flattened() == codes && part.channel == 3));
        assert_eq!(record(&mut console, &mut memory), 0, "once");
    }
}
