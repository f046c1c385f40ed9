//! An ESC on a PWM channel of any microcontroller.
//!
//! What it is: [`PulseOutput`], pulses of 1000 to 2000 us over `embedded_hal`'s [`SetDutyCycle`].
//! What can go wrong: a channel whose steps are wider than 1 us, or whose period leaves no room for the longest pulse, is refused
//! ([`OutputError`]); an error of the channel is handed on, and the pulse that was set before goes on.
//! Units: nanoseconds of pulse; Hz.
//! Reference: embedded-hal 1.0, `pwm`; Beharie 2013, section 3.2.

use crate::timer::TimerError;
use crate::units::PulseWidth;
use embedded_hal::pwm::SetDutyCycle;

const NS_PER_S: u64 = 1_000_000_000;
/// Highest rate of pulses, Hz: a period of twice the longest pulse leaves the ESC as long a low level as the pulse was.
const FASTEST_HZ: u32 = 250;

/// Why an output could not be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum OutputError<E> {
    /// The channel cannot give ESC pulses.
    Timer(TimerError),
    /// The channel repeats never, or too often for an ESC.
    Rate {
        /// Periods a second.
        hz: u32,
    },
    /// The channel did not take the minimum pulse.
    Channel(E),
}

impl<E: core::fmt::Debug> core::fmt::Display for OutputError<E> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Timer(error) => error.fmt(f),
            Self::Rate { hz } => write!(f, "the channel repeats {hz} times a second: an ESC takes 1 to {FASTEST_HZ}"),
            Self::Channel(error) => write!(f, "the channel did not take the minimum pulse: {error:?}"),
        }
    }
}

impl<E: core::fmt::Debug> core::error::Error for OutputError<E> {}

/// An ESC on a PWM channel that repeats at a known rate.
#[derive(Debug)]
pub struct PulseOutput<P> {
    channel: P,
    rate_hz: u32,
}

impl<P: SetDutyCycle> PulseOutput<P> {
    /// Takes a channel whose period is one `rate_hz`th of a second, usually 1/50 s, and sets the minimum pulse. Enable the channel afterwards:
    /// its first pulse is then the minimum.
    ///
    /// # Errors
    /// [`OutputError::Rate`] when the channel repeats more often than 250 times a second or never; [`OutputError::Timer`] when its steps are
    /// wider than a microsecond; [`OutputError::Channel`] when it refuses the minimum pulse.
    pub fn new(channel: P, rate_hz: u32) -> Result<Self, OutputError<P::Error>> {
        if rate_hz == 0 || rate_hz > FASTEST_HZ {
            return Err(OutputError::Rate { hz: rate_hz });
        }
        let counter_hz = u32::from(channel.max_duty_cycle()).saturating_mul(rate_hz);
        if counter_hz < 1_000_000 {
            return Err(OutputError::Timer(TimerError::TooCoarse { counter_hz }));
        }
        let mut output = Self { channel, rate_hz };
        output.minimum().map_err(OutputError::Channel)?;
        Ok(output)
    }

    /// Sets the pulse, brought into 1000 to 2000 us first, and says which one the channel gives: the nearest of its steps.
    ///
    /// # Errors
    /// The channel's own; the pulse that was set before goes on.
    pub fn set(&mut self, pulse: PulseWidth) -> Result<PulseWidth, P::Error> {
        let steps_hz = u64::from(self.channel.max_duty_cycle()) * u64::from(self.rate_hz);
        let duty = (u64::from(pulse.clamped().0) * steps_hz + NS_PER_S / 2) / NS_PER_S;
        self.channel.set_duty_cycle(u16::try_from(duty).unwrap_or(u16::MAX))?;
        let ns = (duty * NS_PER_S + steps_hz / 2).checked_div(steps_hz).unwrap_or(0);
        Ok(PulseWidth(u32::try_from(ns).unwrap_or(u32::MAX)))
    }

    /// Sets the minimum pulse. An ESC takes it for a stop; silence it does not.
    ///
    /// # Errors
    /// The channel's own.
    pub fn minimum(&mut self) -> Result<PulseWidth, P::Error> {
        self.set(PulseWidth::MIN)
    }

    /// Gives the channel back, with the pulse that was set last.
    pub fn release(self) -> P {
        self.channel
    }
}
