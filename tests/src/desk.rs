//! A rig board on a pseudo-terminal: the portable firmware against the bench, in real time.
//!
//! What it is: one thread that plays board and rig behind the master side of a pseudo-terminal; programs open the other side as
//! their serial port.
//! What can go wrong: a machine that is stopped for longer than the link time-out latches faults, here as on the bench.
//! Units: ms of real time.
//! Reference: specification `rig.md`; `formats.md`, "Telemetry".

use firmware_rig::{CommandLine, Inputs, Rig};
use frame::message::{Beep, Command, Message};
use frame::units::{PulseWidth, Ticks};
use frame::wire::{Encoder, MAX_WIRE};
use hal_sim::native::firmware_config;
use hal_sim::{Bench, EdgeDetail, Millisecond, Scenario};
use serialport::{SerialPort, TTYPort};
use std::collections::VecDeque;
use std::io::{Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What the line does to the bytes of the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Line {
    /// Nothing.
    #[default]
    Clean,
    /// Garbage between the frames, and every twentieth byte damaged.
    Noisy,
}

/// A board behind a port.
pub struct Desk {
    /// Name of the port to open.
    pub port: String,
    beeps: Receiver<Beep>,
    power: Arc<AtomicBool>,
    unplug: Arc<AtomicBool>,
    pulses: Arc<Mutex<Vec<PulseWidth>>>,
    thread: Option<JoinHandle<()>>,
    quit: Arc<AtomicBool>,
}

impl Desk {
    /// Switches a board on.
    ///
    /// # Panics
    /// When the system gives no pseudo-terminal.
    #[must_use]
    pub fn new(line: Line) -> Self {
        let (mut master, slave) = TTYPort::pair().expect("a pseudo-terminal");
        let port = slave.name().expect("a name");
        drop(slave); // its lock would keep every other program out
        let flag = || Arc::new(AtomicBool::new(false));
        let (power, unplug, quit) = (flag(), flag(), flag());
        let pulses = Arc::new(Mutex::new(Vec::new()));
        let (sender, beeps) = channel();
        let thread = std::thread::spawn({
            let (power, unplug, quit, pulses) = (power.clone(), unplug.clone(), quit.clone(), pulses.clone());
            move || play(&mut master, line, &power, &unplug, &quit, &pulses, &sender)
        });
        Self { port, beeps, power, unplug, pulses, thread: Some(thread), quit }
    }

    /// Connects the ESC's battery.
    pub fn power_the_esc(&self) {
        self.power.store(true, Ordering::Relaxed);
    }

    /// Pulls the cable: the port goes away.
    pub fn unplug(mut self) {
        self.unplug.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
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
        self.pulses.lock().expect("the board lives").clone()
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
    master: &mut TTYPort,
    line: Line,
    power: &AtomicBool,
    unplug: &AtomicBool,
    quit: &AtomicBool,
    pulses: &Mutex<Vec<PulseWidth>>,
    beeps: &Sender<Beep>,
) {
    let scenario = Scenario::default();
    let mut bench = Bench::new(&scenario, None, EdgeDetail::Captured);
    let mut rig = Rig::new(firmware_config(&scenario));
    let (mut commands, mut encoder, mut gathered) = (CommandLine::new(), Encoder::default(), Millisecond::default());
    let mut out: VecDeque<u8> = VecDeque::new();
    let mut sent = 0u64;
    let mut pulse = PulseWidth::MIN;
    let mut frame = PulseWidth::MIN;
    let begun = Instant::now();
    master.set_timeout(Duration::from_millis(1)).expect("a timeout");
    for ms in 1u64.. {
        if quit.load(Ordering::Relaxed) || unplug.load(Ordering::Relaxed) {
            return;
        }
        let due = Duration::from_millis(ms);
        std::thread::sleep(due.saturating_sub(begun.elapsed()));
        match ms % 20 {
            0 => frame = pulse,
            2 => bench.pulse((ms - 2) * 1_000_000 + u64::from(frame.0), frame.0),
            _ => {}
        }
        bench.set_power(power.load(Ordering::Relaxed));
        bench.millisecond(&mut gathered);
        while let Some((_, beep)) = bench.beep() {
            let _ = beeps.send(beep);
        }
        let mut bytes = [0; 512];
        let waiting = master.bytes_to_read().unwrap_or(0);
        if waiting > 0
            && let Ok(n) = master.read(&mut bytes)
        {
            bytes[..n].iter().for_each(|b| commands.take(*b));
        }
        let (command, news) = commands.next_command();
        let now = Ticks::from_ms(ms);
        let before = rig.calibration();
        let outputs = rig.tick(&Inputs {
            now,
            edges: core::array::from_fn(|i| gathered.edges[i].as_slice()),
            over_capture: [false; 4],
            adc: gathered.adc,
            command,
            line: news,
            stop_input: false,
            brown_out: false,
            paused: false,
        });
        pulse = outputs.pulse;
        pulses.lock().expect("nobody panics with it").push(pulse);
        let identify = command == Some(Command::Identify);
        let told = [
            identify.then(|| Message::Hello(rig.hello(0x08))),
            (identify || rig.calibration() != before).then(|| Message::Calibration(rig.calibration())),
            outputs.sample.map(Message::Rig),
            outputs.event.map(Message::Event),
        ];
        for message in told.into_iter().flatten() {
            let mut wire = [0; MAX_WIRE];
            let used = encoder.encode(now, &message, &mut wire).expect("it fits");
            if line == Line::Noisy && ms % 3 == 0 {
                out.extend([0x55, 0xaa, (ms % 251) as u8, 7]); // runs into the next frame and costs it
            }
            out.extend(&wire[..used]);
        }
        while let Some(byte) = out.pop_front() {
            sent += 1;
            let damaged = line == Line::Noisy && sent.is_multiple_of(997);
            if master.write_all(&[if damaged { byte ^ 0x40 } else { byte }]).is_err() {
                out.clear(); // nobody has the port open: what is sent is lost, as on a cable
            }
        }
    }
}
