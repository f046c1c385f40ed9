//! All four sensors on one pretended I2C bus: `cargo run --example all_four`.
//!
//! The bus here is a file of registers an address; on a board it is the HAL's.

use embedded_hal::i2c::{ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};
use imu_sensors::{Adxl345, Hmc5883l, Itg3200, Lis3dh, SensorError, adxl345, hmc5883l, itg3200, lis3dh};
use std::collections::BTreeMap;

/// Chips by their address, each with its registers.
struct Bus(BTreeMap<u8, [u8; 64]>);

impl ErrorType for Bus {
    type Error = ErrorKind;
}

impl I2c for Bus {
    fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
        let chip = self.0.get_mut(&address).ok_or(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address))?;
        let mut at = 0;
        for operation in operations {
            match operation {
                Operation::Write(bytes) => {
                    at = usize::from(bytes[0] & 0x3F);
                    chip[at..at + bytes.len() - 1].copy_from_slice(&bytes[1..]);
                }
                Operation::Read(into) => into.copy_from_slice(&chip[at..at + into.len()]),
            }
        }
        Ok(())
    }
}

impl Bus {
    /// A chip with these registers.
    fn put(&mut self, address: u8, registers: &[(usize, &[u8])]) {
        let chip = self.0.entry(address).or_insert([0; 64]);
        for (at, bytes) in registers {
            chip[*at..at + bytes.len()].copy_from_slice(bytes);
        }
    }
}

fn main() -> Result<(), SensorError<ErrorKind>> {
    let mut bus = Bus(BTreeMap::new());
    bus.put(0x68, &[(0x00, &[0x68]), (0x1B, &[0xCC, 0x70, 0x00, 0x73, 0xFF, 0x8D, 0x00, 0x00])]);
    bus.put(0x53, &[(0x00, &[0xE5]), (0x32, &[0x00, 0x00, 0x00, 0x00, 0x00, 0x01])]);
    bus.put(0x1E, &[(0x0A, b"H43"), (0x03, &[0x00, 0xDA, 0x01, 0xD5, 0x00, 0x00])]);

    let mut gyro = Itg3200::new(&mut bus, itg3200::Config::DEFAULT);
    gyro.configure()?;
    let reading = gyro.read()?;
    println!("gyro: {:?} deg/s at {} degC", reading.deg_s(), reading.celsius());

    let mut accel = Adxl345::new(&mut bus, adxl345::Config { range: adxl345::Range::G4, ..adxl345::Config::DEFAULT });
    accel.configure()?;
    println!("accelerometer: {:?} g", adxl345::g(&accel.read()?));

    let range = hmc5883l::Range::Gauss1_3;
    let mut mag = Hmc5883l::new(&mut bus, hmc5883l::Config { range, ..hmc5883l::Config::DEFAULT });
    mag.configure()?;
    println!("magnetometer: {:?} G", range.gauss(&mag.read()?));

    // not plugged in: that is an error of the bus, and configuring again is all it takes once it is there
    let missing = Lis3dh::on_i2c(&mut bus, lis3dh::Address::Low, lis3dh::Config::DEFAULT).configure();
    println!("second accelerometer: {}", missing.expect_err("nothing is there"));
    bus.put(0x18, &[(0x0F, &[0x33]), (0x28, &[0x00, 0x00, 0x00, 0x00, 0x30, 0x05])]);
    let mut second = Lis3dh::on_i2c(&mut bus, lis3dh::Address::Low, lis3dh::Config::DEFAULT);
    second.configure()?;
    println!("second accelerometer: {:?} g", lis3dh::Range::G16.g(&second.read()?));
    Ok(())
}
