//! The flash image of the IMU board. On the host this is an empty program: build the image with `cargo xtask image`.
//!
//! What it is: the RTIC application: set-up, the 200 Hz sampling task and the serial interrupt. Pins and peripherals are
//! listed in `board/mod.rs`; everything that decides something is in the library.
//!
//! What can go wrong: a panic resets the board; a stalled task lets the watchdog reset it.
//!
//! Units: as in the library.
//!
//! Reference: specification `ahrs.md`, "Board".
#![cfg_attr(target_os = "none", no_std, no_main)]
#![deny(unsafe_code)]
#![cfg_attr(target_os = "none", deny(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing))]

#[cfg(target_os = "none")]
mod board;

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this is a firmware image: build it with `cargo xtask image`");
}

#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    defmt::error!("panic: reset");
    cortex_m::peripheral::SCB::sys_reset()
}

#[cfg(target_os = "none")]
#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use super::board::{BAUD, CORE_HZ, CRYSTAL_HZ, INCOMING, OUTGOING, bus::Bus, clock::Clock};
    use defmt_rtt as _;
    use firmware_ahrs::{Ahrs, AhrsConfig, Inputs, Sampler, TICK_HZ};
    use frame::wire::{Decoder, Encoder, MAX_WIRE};
    use frame::{Command, Hello, Message};
    use heapless::spsc::{Consumer, Producer, Queue};
    use stm32f4xx_hal::{
        ClearFlags, Listen,
        i2c::I2c,
        pac::{Interrupt, TIM4, USART1},
        prelude::*,
        rcc::Config,
        serial::{Rx, Serial, Tx, config::Config as Line},
        timer::{CounterHz, Event, Flag},
        watchdog::IndependentWatchdog,
    };

    /// The sending half of the link: numbers frames and queues their bytes whole or not at all.
    pub struct Link {
        encoder: Encoder,
        bytes: Producer<'static, u8>,
    }

    impl Link {
        fn send(&mut self, at: frame::Ticks, message: &Message) {
            let mut out = [0; MAX_WIRE];
            let Ok(used) = self.encoder.encode(at, message, &mut out) else { return };
            if self.bytes.capacity() - self.bytes.len() < used {
                return; // the receiver sees the gap in the sequence
            }
            for byte in out.iter().take(used) {
                let _ = self.bytes.enqueue(*byte);
            }
            rtic::pend(Interrupt::USART1);
        }
    }

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        ahrs: Ahrs,
        sampler: Sampler<Bus>,
        clock: Clock,
        link: Link,
        hello: Hello,
        commands: Consumer<'static, u8>,
        decoder: Decoder,
        tick: CounterHz<TIM4>,
        watchdog: IndependentWatchdog,
        tx: Tx<USART1>,
        rx: Rx<USART1>,
        outgoing: Consumer<'static, u8>,
        incoming: Producer<'static, u8>,
    }

    #[init(local = [out: Queue<u8, OUTGOING> = Queue::new(), inn: Queue<u8, INCOMING> = Queue::new()])]
    fn init(mut ctx: init::Context) -> (Shared, Local) {
        let mut watchdog = IndependentWatchdog::new(ctx.device.IWDG);
        watchdog.start(100.millis());
        let reset_cause = (ctx.device.RCC.csr().read().bits() >> 24) as u8;
        ctx.device.RCC.csr().modify(|_, w| w.rmvf().set_bit());
        ctx.core.DCB.enable_trace();
        ctx.core.DWT.enable_cycle_counter();

        let mut rcc = ctx.device.RCC.freeze(Config::hse(CRYSTAL_HZ.Hz()).sysclk(CORE_HZ.Hz()));
        let gpioa = ctx.device.GPIOA.split(&mut rcc);
        let gpiob = ctx.device.GPIOB.split(&mut rcc);
        let mut clock = Clock::new(ctx.device.TIM2, &mut rcc);

        let Some(bus) = Bus::new(I2c::new(ctx.device.I2C1, (gpiob.pb6, gpiob.pb7), 400.kHz(), &mut rcc)) else {
            cortex_m::peripheral::SCB::sys_reset() // these are the pins it takes: cannot happen
        };
        let sampler = Sampler::new(bus);
        let hello = Ahrs::hello(CORE_HZ, reset_cause, sampler.alive());
        defmt::info!("boot: {}", hello);

        let line = Line::default().baudrate(BAUD.bps());
        let serial: Serial<USART1> = match Serial::new(ctx.device.USART1, (gpioa.pa9, gpioa.pa10), line, &mut rcc) {
            Ok(serial) => serial,
            Err(_) => cortex_m::peripheral::SCB::sys_reset(), // the rate does not divide: cannot happen with the constants above
        };
        let (tx, mut rx) = serial.split();
        rx.listen();
        let (producer, outgoing) = ctx.local.out.split();
        let (incoming, commands) = ctx.local.inn.split();
        let mut link = Link { encoder: Encoder::default(), bytes: producer };
        link.send(clock.now(), &Message::Hello(hello));

        let mut tick = ctx.device.TIM4.counter_hz(&mut rcc);
        if tick.start(TICK_HZ.Hz()).is_err() {
            cortex_m::peripheral::SCB::sys_reset(); // as above
        }
        tick.listen(Event::Update);

        let ahrs = Ahrs::new(AhrsConfig::default());
        let decoder = Decoder::default();
        let local = Local { ahrs, sampler, clock, link, hello, commands, decoder, tick, watchdog, tx, rx, outgoing, incoming };
        (Shared {}, local)
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            cortex_m::asm::wfi();
        }
    }

    /// Reads the sensors, runs the filter, sends the sample, answers commands, feeds the watchdog.
    #[task(binds = TIM4, priority = 1, local = [ahrs, sampler, clock, link, hello, commands, decoder, tick, watchdog])]
    fn sample(ctx: sample::Context) {
        let sample::LocalResources { ahrs, sampler, clock, link, hello, commands, decoder, tick, watchdog, .. } = ctx.local;
        tick.clear_flags(Flag::Update);
        let now = clock.now();
        let readings = sampler.read();
        let outputs = ahrs.tick(&Inputs { now, readings });
        if let Some(sample) = outputs.sample {
            link.send(now, &Message::Imu(sample));
        }
        while let Some(byte) = commands.dequeue() {
            if let Some(received) = decoder.push::<Command>(byte)
                && received.message == Command::Identify
            {
                hello.present = sampler.alive();
                link.send(now, &Message::Hello(*hello));
            }
        }
        watchdog.feed();
    }

    /// Moves bytes between the line and the queues.
    #[task(binds = USART1, priority = 2, local = [tx, rx, outgoing, incoming])]
    fn serial(ctx: serial::Context) {
        let serial::LocalResources { tx, rx, outgoing, incoming, .. } = ctx.local;
        if rx.is_rx_not_empty()
            && let Ok(byte) = rx.read()
        {
            let _ = incoming.enqueue(byte); // a full queue loses the command; its checksum will say so
        }
        if !outgoing.ready() {
            tx.unlisten();
        } else {
            if tx.is_tx_empty()
                && let Some(byte) = outgoing.dequeue()
            {
                let _ = tx.write(byte);
            }
            tx.listen();
        }
    }
}
