//! The STM32F405RG as the IMU board uses it.
//!
//! What it is: the bus, the clock and the serial line under the portable half. The only place with registers.
//!
//! | What | Pin | Peripheral | Settings |
//! |---|---|---|---|
//! | Crystal | PH0, PH1 | HSE, PLL | 8 or 12 MHz, measured ([`safe_start::crystal`]); core 168 MHz, APB1 42 MHz, APB2 84 MHz; the internal oscillator where it cannot be trusted |
//! | Sensors, clock | PB6, AF4, open drain | I2C1 SCL | 400 kHz, pull-ups on the sensor board |
//! | Sensors, data | PB7, AF4, open drain | I2C1 SDA | polled, every wait bounded |
//! | Telemetry out | PA9, AF7 | USART1 TX | 460 800 baud 8N1, one interrupt a byte |
//! | Commands in | PA10, AF7 | USART1 RX | one interrupt a byte |
//! | Timestamp | - | TIM2 | 84 MHz, 32 bits, free running, extended to 64 bits |
//! | Sampling tick | - | TIM4 | 200 Hz update interrupt |
//! | Settings | - | FLASH | sectors 10 and 11, from the idle loop; an erase (1 to 2 s) stops everything |
//! | Watchdog | - | IWDG | 100 ms, fed by the sampling tick |
//! | Log | SWD | RTT | defmt; never on the telemetry line |
//!
//! The line carries 200 samples of at most 71 bytes a second, a third of its capacity (raw and calibrated as text: three quarters),
//! so an interrupt a byte (a few per cent of the core at most) is preferred to DMA: it needs neither static buffers nor unsafe code.
//!
//! What can go wrong: a stuck bus ends in [`bus::BusError::Timeout`] after [`bus::PATIENCE_US`] instead of for ever; a tick
//! that never ends or a lock-up ends in a watchdog reset; a full queue drops whole frames, which the
//! receiver sees as a gap in the sequence.
//!
//! Units: ticks of 84 MHz; bytes.
//!
//! Reference: RM0090 rev 19; DS8626 table 9 (pins).

pub(crate) mod bus;
pub(crate) mod clock;

/// Core clock, Hz.
pub(crate) const CORE_HZ: u32 = 168_000_000;
/// Telemetry line, bit/s.
pub(crate) const BAUD: u32 = 460_800;
/// Outgoing bytes that may wait: about 65 ms of samples.
pub(crate) const OUTGOING: usize = 1024;
/// Incoming bytes that may wait between two ticks (230 arrive at most).
pub(crate) const INCOMING: usize = 256;
