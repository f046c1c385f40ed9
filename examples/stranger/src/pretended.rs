//! What stands in for the board: a bus with three chips, and a PWM channel.

use core::convert::Infallible;
use embedded_hal::i2c::{self, ErrorKind, I2c, NoAcknowledgeSource, Operation};
use embedded_hal::pwm::{self, SetDutyCycle};

/// Registers of the chips, by address.
pub struct Bus([(u8, [u8; 64]); 3]);

/// A gyro at rest, an accelerometer and a magnetometer rolled to the right by thirty degrees, facing north.
pub fn bus() -> Bus {
    let mut chips = [(0x68, [0; 64]), (0x53, [0; 64]), (0x1E, [0; 64])];
    let mut put = |chip: usize, at: usize, bytes: &[u8]| chips[chip].1[at..at + bytes.len()].copy_from_slice(bytes);
    let (sine, cosine) = 30f32.to_radians().sin_cos();
    put(0, 0x00, &[0x68]);
    put(1, 0x00, &[0xE5]);
    for (n, g) in [0.0, -sine, -cosine].into_iter().enumerate() {
        put(1, 0x32 + 2 * n, &((256.0 * g) as i16).to_le_bytes());
    }
    put(2, 0x0A, b"H43");
    // 0.2 G to the north and 0.43 G down; the chip sends x, z, y
    for (n, gauss) in [0.2, 0.43 * cosine, 0.43 * sine].into_iter().enumerate() {
        put(2, 0x03 + 2 * n, &((1090.0 * gauss) as i16).to_be_bytes());
    }
    Bus(chips)
}

impl i2c::ErrorType for Bus {
    type Error = ErrorKind;
}

impl I2c for Bus {
    fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
        let nobody = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);
        let (_, chip) = self.0.iter_mut().find(|(its, _)| *its == address).ok_or(nobody)?;
        let mut at = 0;
        for operation in operations {
            match operation {
                Operation::Write(bytes) => {
                    at = usize::from(bytes[0]);
                    chip[at..at + bytes.len() - 1].copy_from_slice(&bytes[1..]);
                }
                Operation::Read(into) => into.copy_from_slice(&chip[at..at + into.len()]),
            }
        }
        Ok(())
    }
}

/// A PWM channel of 50 Hz with 60 000 steps.
#[derive(Debug, Default)]
pub struct Channel {
    /// What it was set to.
    pub duty: u16,
}

impl pwm::ErrorType for Channel {
    type Error = Infallible;
}

impl SetDutyCycle for Channel {
    fn max_duty_cycle(&self) -> u16 {
        60_000
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        self.duty = duty;
        Ok(())
    }
}
