//! A bus that fails, for the tests of every driver.
//!
//! What it is: each transfer of a driver answered by nobody, by a stuck bus or by lost arbitration.
//! What can go wrong: a driver that goes on after a failure, or hides it, fails its test.
//! Units: none.
//! Reference: embedded-hal 1.0, `i2c::ErrorKind`.

use crate::SensorError;
use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
use embedded_hal_mock::eh1::i2c::{Mock, Transaction};
extern crate std;
use core::fmt::Debug;

/// Fails every step of the configuration, then the read, in every way; the driver must say so and touch the bus no further.
pub(crate) fn fails_at_every_step<T: Debug + PartialEq>(
    configuration: &[Transaction],
    burst: &Transaction,
    configure: impl Fn(&mut Mock) -> Result<(), SensorError<ErrorKind>>,
    read: impl Fn(&mut Mock) -> Result<T, SensorError<ErrorKind>>,
) {
    for kind in [ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address), ErrorKind::Bus, ErrorKind::ArbitrationLoss] {
        for (step, last) in configuration.iter().enumerate() {
            let mut script = configuration[..step].to_vec();
            script.push(last.clone().with_error(kind));
            let mut bus = Mock::new(&script);
            assert_eq!(configure(&mut bus), Err(SensorError::Bus(kind)), "step {step}");
            bus.done();
        }
        let mut bus = Mock::new(&[burst.clone().with_error(kind)]);
        assert_eq!(read(&mut bus), Err(SensorError::Bus(kind)));
        bus.done();
    }
}
