//! The firmware's own code over the back ends of its peripherals: pulse output, captures, conversions, serial line, watchdog, SPI and
//! delay, each with a plant behind it, all on one virtual clock.

use embedded_hal::delay::DelayNs;
use embedded_hal::pwm::SetDutyCycle;
use embedded_io::{Read, ReadReady, Write};
use esc_pwm::PulseTimer;
use firmware_rig::queue::{CAPACITY, EdgeQueue};
use firmware_rig::{Beside, Config, Delivered, RigConsole, Start};
use frame::calibration::Converted;
use frame::message::{ClockNews, Command, Event, Hello, Message, SettingsNews};
use frame::rig::{CAPTURE_CHANNELS, Fault, RigSample, RigState};
use frame::units::{PulseWidth, Ticks};
use frame::wire::{Decoder, Encoder, MAX_WIRE};
use hal_sim::hal::{CaptureTimer, PulsePin, RigPins, ScanConverter, SerialEnd, SpiPort, VirtualClock, Watchdog};
use hal_sim::imu::{ChipErrors, Motion};
use hal_sim::{Scenario, Truth};
use imu_sensors::{Lis3dh, SensorError, lis3dh};

const BAUD: u32 = 2_000_000;

fn timer() -> PulseTimer {
    PulseTimer::new(84_000_000, 16).unwrap()
}

/// The firmware's console over the back ends: what the flash image does with registers, in the same order.
struct Program {
    console: RigConsole,
    pulse: PulsePin,
    line: SerialEnd,
    captures: CaptureTimer,
    queues: [EdgeQueue; CAPTURE_CHANNELS],
    converter: ScanConverter,
    watchdog: Watchdog,
    now: Ticks,
}

impl Program {
    fn start(pins: &RigPins, line: SerialEnd) -> Self {
        let clock = ClockNews { crystal_hz: 8_000_000, measured_hz: 8_000_000 };
        let news = SettingsNews::Absent;
        let start = Start { reset_cause: pins.reset_cause(), clock, stored: None, news, ended: None };
        let console = RigConsole::start(Ticks(0), Config::thesis_570kv(), &start);
        Self {
            pulse: PulsePin::start(pins, timer(), timer().ticks(PulseWidth::MIN) as u16),
            line,
            captures: CaptureTimer::start(pins),
            queues: Default::default(),
            converter: ScanConverter::start(pins, console.rig().config().sampling_cycles()),
            watchdog: Watchdog::start(pins, 20_000_000),
            now: Ticks(0),
            console,
        }
    }

    /// What the board's timer interrupt does every half millisecond.
    fn half_tick(&mut self) {
        let mut byte = [0];
        while matches!(self.line.read_ready(), Ok(true)) && matches!(self.line.read(&mut byte), Ok(1)) {
            self.console.hear(byte[0]);
        }
        let half = self.console.look(false);
        if half.minimum {
            self.pulse.set_duty_cycle(timer().ticks(PulseWidth::MIN) as u16).unwrap();
        }
        if !half.tick {
            return;
        }
        let over_capture = self.captures.serve(&self.queues);
        let edges = self.queues.each_ref().map(|queue| core::iter::from_fn(|| queue.take()).collect::<Vec<u32>>());
        let counter = self.captures.counter();
        self.now = Ticks(self.now.0 + u64::from(counter.wrapping_sub(self.now.0 as u32)));
        let delivered = Delivered {
            now: self.now,
            edges: edges.each_ref().map(Vec::as_slice),
            over_capture,
            adc: &self.converter.drain(),
            beside: Beside::UNWIRED,
            brown_out: false,
            paused: false,
            stored: None,
            vitals: None,
        };
        let pin = &mut self.pulse;
        self.console.tick(&delivered, |pulse, _| pin.set_duty_cycle(timer().ticks(pulse) as u16).unwrap());
        self.watchdog.feed();
        let _ = self.line.write_all(self.console.queued()); // a cut line hears nothing
        self.console.sent();
    }
}

/// Board, line and an operator at the other end of it.
struct Table {
    pins: RigPins,
    board: Option<Program>,
    board_end: SerialEnd,
    host: SerialEnd,
    encoder: Encoder,
    decoder: Decoder,
    halves: u64,
    state: RigState,
    hellos: Vec<Hello>,
    events: Vec<Event>,
    samples: Vec<(RigSample, Converted, Truth)>,
    calibration: Option<frame::calibration::Calibration>,
}

impl Table {
    fn new() -> Self {
        let clock = VirtualClock::default();
        let pins = RigPins::new(clock.clone(), &Scenario::default());
        let (board_end, host) = SerialEnd::pair(&clock, BAUD);
        let mut table = Self {
            pins,
            board: None,
            board_end,
            host,
            encoder: Encoder::default(),
            decoder: Decoder::default(),
            halves: 0,
            state: RigState::Disarmed,
            hellos: Vec::new(),
            events: Vec::new(),
            samples: Vec::new(),
            calibration: None,
        };
        table.reset();
        table
    }

    /// The program starts (again).
    fn reset(&mut self) {
        self.board = Some(Program::start(&self.pins, self.board_end.clone()));
    }

    fn tell(&mut self, command: Command) {
        let mut wire = [0; MAX_WIRE];
        let count = self.encoder.encode(self.pins.clock().ticks(), &command, &mut wire).unwrap();
        self.host.write_all(&wire[..count]).unwrap();
    }

    /// Half a millisecond of everything; the host passes beeps on and keeps the link alive.
    fn half(&mut self) {
        self.halves += 1;
        self.pins.clock().advance_to(self.halves * 500_000);
        if let Some(board) = &mut self.board {
            board.half_tick();
        }
        while let Some(beep) = self.pins.beep() {
            self.tell(Command::Beep(beep));
        }
        if self.halves.is_multiple_of(400) {
            self.tell(Command::Ping);
        }
        let mut byte = [0];
        while self.host.read_ready().unwrap() {
            self.host.read_exact(&mut byte).unwrap();
            match self.decoder.push::<Message>(byte[0]).map(|r| r.message) {
                Some(Message::Hello(hello)) => self.hellos.push(hello),
                Some(Message::Calibration(calibration)) => self.calibration = Some(calibration),
                Some(Message::Rig(sample)) => {
                    let converted = self.calibration.expect("it comes first").convert(&sample);
                    self.samples.push((sample, converted, self.pins.truth()));
                }
                Some(Message::Event(event)) => {
                    if let Event::State { to, .. } = event {
                        self.state = to;
                    }
                    self.events.push(event);
                }
                _ => {}
            }
        }
    }

    fn pass(&mut self, ms: u64) {
        (0..2 * ms).for_each(|_| self.half());
    }

    fn arm(&mut self) {
        self.pass(200);
        self.tell(Command::Arm);
        self.pass(400);
        assert_eq!(self.state, RigState::ArmHoldMin);
        self.pins.set_power(true);
        self.pass(8_000);
        assert_eq!(self.state, RigState::Armed, "{:?}", self.events);
    }
}

#[test]
fn the_rig_s_program_arms_flies_and_measures_over_the_back_ends() {
    let mut table = Table::new();
    table.arm();
    table.pass(1_000);
    table.tell(Command::Tare);
    table.pass(300);
    table.samples.clear();
    let (step, top) = (PulseWidth::from_us(250), PulseWidth::from_us(1750));
    table.tell(Command::RunStaircase { step, hold_ms: 3_000, top, down: false });
    table.pass(12_200);
    assert!(table.events.iter().any(|e| matches!(e, Event::ScheduleDone { .. })) && table.state == RigState::Armed);
    assert!(table.events.iter().all(|e| !matches!(e, Event::Faults { .. } | Event::Refused(_))), "{:?}", table.events);
    assert_eq!(table.decoder.stats().damaged + table.decoder.stats().missing, 0);
    // settled: no other pulse for 2 s
    let settled = |i: usize| i >= 20 && table.samples[i - 20..i].iter().all(|s| s.0.pulse == table.samples[i].0.pulse);
    let mut levels = std::collections::BTreeMap::new();
    let (mut worst_rpm, mut worst_n) = (0.0f64, 0.0f64);
    for i in (0..table.samples.len()).filter(|i| settled(*i)) {
        let (sample, row, truth) = &table.samples[i];
        if sample.pulse == PulseWidth::MIN {
            continue;
        }
        // the ESC follows what the timer has made of the pulse: whole ticks of a third of a microsecond
        assert!((truth.pulse_us - f64::from(timer().ticks(sample.pulse)) / 3.0).abs() < 1e-3, "{} us", truth.pulse_us);
        for rpm in row.rpm {
            worst_rpm = worst_rpm.max((rpm.expect("all four see it") / truth.plant.rpm - 1.0).abs());
        }
        worst_n = worst_n.max((row.adc[0].expect("it pulls") - truth.plant.thrust_n).abs());
        // 100 ms of scans of five channels at 68 cycles of 21 MHz
        assert!((6_170..=6_180).contains(&sample.adc[0].count), "{}", sample.adc[0].count);
        *levels.entry(sample.pulse.0).or_insert(0u32) += 1;
    }
    println!("speeds within {:.4} %, thrust within {:.1} mN, over {levels:?}", 100.0 * worst_rpm, 1000.0 * worst_n);
    assert_eq!(levels.keys().copied().collect::<Vec<_>>(), [1_250_000, 1_500_000, 1_750_000]);
    assert!(worst_rpm < 1e-3 && worst_n < 0.05);
}

#[test]
fn a_cut_line_and_a_stop_reach_the_pin() {
    for cut in [true, false] {
        let mut table = Table::new();
        table.arm();
        table.tell(Command::SetPulse(PulseWidth::from_us(1400)));
        table.pass(3_000);
        assert!(table.pins.truth().plant.rpm > 2_000.0);
        if cut {
            table.host.cut(true);
        } else {
            table.tell(Command::Stop);
        }
        let begun = table.halves;
        while table.pins.truth().pulse_us > 1_000.5 {
            table.half();
        }
        let ms = (table.halves - begun) as f64 / 2.0;
        println!("{}: minimum after {ms} ms", if cut { "cut line" } else { "stop" });
        let limit = Config::thesis_570kv().limits.link_ms;
        assert!(ms < 42.0 + if cut { f64::from(limit) + 200.0 } else { 0.0 }, "{ms} ms");
        table.pass(20);
        let fault = if cut { Fault::LinkLost } else { Fault::OperatorStop };
        assert!(table.board.as_ref().is_some_and(|b| b.console.rig().faults().contains(fault)));
    }
}

#[test]
fn a_program_that_hangs_is_reset_and_starts_at_minimum() {
    let mut table = Table::new();
    table.arm();
    table.tell(Command::SetPulse(PulseWidth::from_us(1400)));
    table.pass(2_000);
    let hung_ns = table.pins.clock().now_ns();
    table.board = None; // no half tick comes any more
    table.pass(15);
    assert_eq!(table.pins.take_reset(), None);
    table.pass(6);
    let bitten_ns = table.pins.take_reset().expect("20 ms without being fed");
    assert!((19_000_000..=20_000_000).contains(&(bitten_ns - hung_ns)), "{bitten_ns} after {hung_ns}");
    table.reset();
    table.events.clear();
    table.pass(42);
    assert!((table.pins.truth().pulse_us - 1000.0).abs() < 0.5, "minimum within two frames of the reset");
    assert!(table.board.as_ref().is_some_and(|b| b.console.rig().state() == RigState::Disarmed));
    let causes: Vec<u8> = table.hellos.iter().map(|h| h.reset_cause).collect();
    assert_eq!(causes, [0x0E, 0x24], "power-on with brown-out and pin; watchdog with pin");
}

#[test]
fn what_a_program_holds_from_before_its_reset_has_no_effect() {
    let pins = RigPins::new(VirtualClock::default(), &Scenario::default());
    pins.set_power(true);
    let mut pulse = PulsePin::start(&pins, timer(), timer().ticks(PulseWidth::MIN) as u16);
    let mut converter = ScanConverter::start(&pins, 56);
    let mut dog = Watchdog::start(&pins, 20_000_000);
    pins.clock().advance_to(10_000_000);
    assert_eq!(converter.drain()[0].count, 617, "10 ms of 16.19 us");
    pins.clock().advance_to(25_000_000);
    assert_eq!(pins.take_reset(), Some(20_000_000));
    let mut second = ScanConverter::start(&pins, 15);
    pulse.set_duty_cycle_percent(10).unwrap();
    dog.feed();
    pins.clock().advance_to(200_000_000);
    assert_eq!((converter.drain()[0].count, pins.take_reset()), (0, None));
    assert!(second.drain()[0].count < 1024, "175 ms at 6.43 us a scan lap the ring of 1 024");
}

/// A board whose program never comes back after the watchdog's reset: the ESC's signal, once with the pull-down and once without.
#[test]
fn the_pulse_pin_of_a_board_in_reset_is_low_only_where_a_resistor_pulls_it_down() {
    let speed_after_reset = |pulled_down: bool| {
        let pins = RigPins::new(VirtualClock::default(), &Scenario::default());
        if !pulled_down {
            pins.leave_out_pull_down(1_800);
        }
        pins.set_power(true);
        let mut pulse = PulsePin::start(&pins, timer(), timer().ticks(PulseWidth::MIN) as u16);
        pins.clock().advance_to(8_000_000_000);
        pulse.set_duty_cycle(timer().ticks(PulseWidth::from_us(1300)) as u16).unwrap();
        pins.clock().advance_to(10_000_000_000);
        let before = pins.truth().plant.rpm;
        let _dog = Watchdog::start(&pins, 20_000_000);
        pins.clock().advance_to(13_000_000_000); // bitten, and no program starts
        assert!(pins.take_reset().is_some());
        (before, pins.truth().plant.rpm)
    };
    let (before, low) = speed_after_reset(true);
    let (same, floating) = speed_after_reset(false);
    println!("{before:.0} rev/min; after the reset {low:.0} with the pull-down, {floating:.0} without");
    assert!(before > 1_000.0 && before == same, "a driven pin picks nothing up: {before} and {same}");
    assert!(low < before, "no signal: the ESC's own fallback");
    assert!(floating > 1.5 * before, "throttle that nobody asked for");
}

#[test]
fn captures_wait_in_their_queues_and_a_full_one_is_told() {
    let pins = RigPins::new(VirtualClock::default(), &Scenario::default());
    pins.set_power(true);
    let mut pulse = PulsePin::start(&pins, timer(), timer().ticks(PulseWidth::MIN) as u16);
    pins.clock().advance_to(8_000_000_000); // the ESC finds minimum pulses and is ready
    pulse.set_duty_cycle(timer().ticks(PulseWidth::from_us(1500)) as u16).unwrap();
    let mut clock = pins.clock().clone();
    clock.delay_ms(3_000);
    let captures = CaptureTimer::start(&pins);
    let queues: [EdgeQueue; CAPTURE_CHANNELS] = Default::default();
    assert_eq!(captures.serve(&queues), [false; 4]);
    clock.delay_ms(100);
    let rev_s = pins.truth().plant.rpm / 60.0;
    assert!(rev_s > 40.0, "{rev_s}");
    assert_eq!(captures.serve(&queues), [false, false, false, 25.0 * rev_s * 0.1 > CAPACITY as f64]);
    for (queue, marks) in queues.iter().zip([2.0, 1.0, 2.0]) {
        let edges: Vec<u32> = core::iter::from_fn(|| queue.take()).collect();
        assert!((edges.len() as f64 - marks * rev_s * 0.1).abs() <= 1.0, "{} edges", edges.len());
        assert!(edges.windows(2).all(|w| w[0] < w[1]) && edges.iter().all(|e| *e <= captures.counter()));
        assert_eq!(captures.counter(), Ticks::from_ms(100).0 as u32);
    }
}

/// The driver of `firmware-ahrs` over SPI, on a body that turns and is shaken.
#[test]
fn the_test_accelerometer_is_read_over_spi() {
    let motion = Motion {
        start: [0.4, -0.2, 1.0],
        rate: [0.5, -0.3, 0.8],
        shake_m: [0.01, 0.0, 0.02],
        shake_hz: 5.0,
        lever_m: [0.1, 0.0, 0.02],
        ..Motion::LEVEL
    };
    let clock = VirtualClock::default();
    let mut spi = SpiPort::new(clock.clone(), Some(hal_sim::imu::Lis3dh::new(motion, ChipErrors::default(), 1)));
    Lis3dh::on_spi(&mut spi, lis3dh::Config::DEFAULT).configure().unwrap();
    assert_eq!(clock.now_ns(), 3 * 2 * (20 + 800), "three transactions of two bytes");
    for k in 1..400u64 {
        clock.advance_to(k * 2_500_000);
        let words = Lis3dh::on_spi(&mut spi, lis3dh::Config::DEFAULT).read().unwrap();
        let force = motion.force(k * 2_500_000 + 20);
        for (word, (g, sign)) in words.iter().zip(force.iter().zip([1.0, -1.0, -1.0])) {
            let digits = sign * g * f64::from(lis3dh::Range::G16.lsb_per_g());
            assert!((f64::from(*word) - digits).abs() <= 0.51, "{word} for {digits}");
        }
    }
    assert_eq!(spi.chip().map(|c| c.served.len()), Some(399));
    let mut nothing = SpiPort::new(clock, None);
    let refused = Lis3dh::on_spi(&mut nothing, lis3dh::Config::DEFAULT).configure();
    assert_eq!(refused, Err(SensorError::WrongIdentity { expected: 0x33, found: 0xFF }));
}
