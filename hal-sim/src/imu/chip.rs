//! Register files of ITG-3200, ADXL345, HMC5883L and, optional on the board, LIS3DH.
//!
//! What it is: identities, defaults, data order and pointer rules of the real chips as a bus sees them: start, bytes, stop. Each keeps
//! a record of what it handed out, so that a test can demand equality word by word.
//! What can go wrong: an unconfigured chip answers with zeros (asleep, idle, wrong range); a read that acknowledges its last byte is
//! counted in [`SensorChip::unfinished`].
//! Units: counts; ns since power-up.
//! Reference: the data sheets named in the drivers of `firmware-ahrs`; addresses and defaults written down here again on purpose, not
//! taken from them.

use super::body::Body;
use super::errors::{ChipErrors, Errors};
use super::hidden::{Hidden, ImuLevers};
use super::motion::G;
use super::to_chip;
use crate::noise::Stream;

/// Which chip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChipKind {
    /// Gyro at 0x68.
    Itg3200,
    /// Accelerometer at 0x53.
    Adxl345,
    /// Magnetometer at 0x1E.
    Hmc5883l,
    /// Test accelerometer at 0x18.
    Lis3dh,
}

impl ChipKind {
    /// The three of the board, in the order of the `present` bits; the test accelerometer is fitted apart.
    pub const ALL: [Self; 3] = [Self::Itg3200, Self::Adxl345, Self::Hmc5883l];

    const fn address(self) -> u8 {
        match self {
            Self::Itg3200 => 0x68,
            Self::Adxl345 => 0x53,
            Self::Hmc5883l => 0x1E,
            Self::Lis3dh => 0x18,
        }
    }

    /// First data register and number of data bytes.
    const fn data(self) -> (u8, u8) {
        match self {
            Self::Itg3200 => (0x1B, 8),
            Self::Adxl345 => (0x32, 6),
            Self::Hmc5883l => (0x03, 6),
            Self::Lis3dh => (0x28, 6),
        }
    }

    fn reset_registers(self) -> [u8; 64] {
        let mut file = [0; 64];
        match self {
            Self::Itg3200 => file[0x00] = 0x69, // bit 0 reads 1 on some chips
            Self::Adxl345 => {
                file[0x00] = 0xE5;
                file[0x2C] = 0x0A;
            }
            Self::Hmc5883l => {
                file[..3].copy_from_slice(&[0x10, 0x20, 0x01]);
                file[0x0A..0x0D].copy_from_slice(b"H43");
            }
            Self::Lis3dh => {
                file[0x0F] = 0x33;
                file[0x20] = 0x07;
            }
        }
        file
    }
}

/// One reading that a chip handed out: when, and its three words in chip axes x, y, z.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Served {
    /// Start of the burst, ns.
    pub at_ns: u64,
    /// Words x, y, z of the chip.
    pub words: [i16; 3],
}

/// A sensor chip on the bus.
#[derive(Debug, Clone)]
pub struct SensorChip {
    kind: ChipKind,
    body: Body,
    errors: Errors,
    own: ChipErrors,
    hidden: Hidden,
    noise: Stream,
    registers: [u8; 64],
    pointer: u8,
    /// Bit 7 of the register's number: the LIS3DH counts on only with it.
    multiple: bool,
    pointer_comes: bool,
    driving: bool,
    /// Everything that it handed out, as far as it keeps it.
    pub served: Vec<Served>,
    /// It keeps nothing of what it hands out: a board that runs for days would fill the memory.
    pub forgetful: bool,
    /// Reads whose last byte was acknowledged, so that the chip still drove the bus at their end.
    pub unfinished: u32,
}

fn rounded(value: f64, limit: f64) -> i16 {
    libm::round(value).clamp(-limit - 1.0, limit) as i16
}

impl SensorChip {
    /// A chip after power-up on a body, with its share of `errors`.
    #[must_use]
    pub fn new(kind: ChipKind, body: impl Into<Body>, errors: &Errors) -> Self {
        Self {
            kind,
            body: body.into(),
            errors: *errors,
            own: errors.of(kind),
            hidden: Hidden::default(),
            noise: errors.stream(kind),
            registers: kind.reset_registers(),
            pointer: 0,
            multiple: false,
            pointer_comes: false,
            driving: false,
            served: Vec::new(),
            forgetful: false,
            unfinished: 0,
        }
    }

    /// The same chip with hidden effects about it.
    #[must_use]
    pub fn with(self, hidden: &Hidden) -> Self {
        Self { hidden: hidden.clone(), ..self }
    }

    /// What acts now, and the temperature of the board, degC.
    fn surroundings(&self, at_ns: u64) -> (ImuLevers, f64) {
        let levers = self.hidden.levers(at_ns, &self.body);
        (levers, self.errors.celsius(at_ns) + levers.warm_k)
    }

    /// Specific force where the chip is, body axes, g.
    fn force(&self, at_ns: u64, levers: &ImuLevers) -> [f64; 3] {
        let (own, carried) = (self.body.force(at_ns), self.body.to_body(at_ns, levers.carried));
        core::array::from_fn(|i| own[i] + (carried[i] + levers.shaken[i]) / G)
    }

    /// Field where the chip is, body axes, gauss, at the instant that the reading is of.
    fn field(&self, at_ns: u64, levers: &ImuLevers) -> [f64; 3] {
        let then = at_ns.saturating_sub((levers.late_s * 1e9) as u64);
        let (own, room) = (self.body.magnetic(then), self.body.to_body(then, levers.room_field));
        let there: [f64; 3] = core::array::from_fn(|i| own[i] + room[i]);
        core::array::from_fn(|i| {
            let induced: f64 = (0..3).map(|j| levers.iron[i][j] * there[j]).sum();
            there[i] + induced + levers.body_field[i]
        })
    }

    /// Which chip it is.
    #[must_use]
    pub fn kind(&self) -> ChipKind {
        self.kind
    }

    /// The words that the chip would measure now in the state that its registers put it into.
    fn measure(&mut self, at_ns: u64) -> [i16; 3] {
        let (levers, celsius) = self.surroundings(at_ns);
        let (force, field) = match self.kind {
            ChipKind::Itg3200 => ([0.0; 3], [0.0; 3]),
            ChipKind::Hmc5883l => ([0.0; 3], self.field(at_ns, &levers)),
            ChipKind::Adxl345 | ChipKind::Lis3dh => (self.force(at_ns, &levers), [0.0; 3]),
        };
        let mut seen = |truth: [f64; 3]| self.own.seen(to_chip(truth), celsius, &mut self.noise);
        let file = &self.registers;
        match self.kind {
            ChipKind::Itg3200 => {
                if file[0x3E] & 0x40 != 0 || file[0x16] >> 3 & 3 != 3 {
                    return [0; 3]; // asleep, or a full scale that the data sheet does not define
                }
                let rate = self.body.rate(at_ns);
                let read = core::array::from_fn(|i| rate[i] + levers.rate[i] + levers.rate_per_k[i] * (celsius - 25.0));
                seen(read).map(|w| rounded(w.to_degrees() * 14.375, 32_767.0))
            }
            ChipKind::Adxl345 => {
                if file[0x2D] & 0x08 == 0 {
                    return [0; 3]; // standby
                }
                let range = file[0x31] & 3;
                let full = file[0x31] & 8 != 0;
                let (per_g, limit) =
                    if full { (256.0, f64::from(512 << range) - 1.0) } else { (256.0 / f64::from(1 << range), 511.0) };
                seen(force).map(|f| rounded(f * per_g, limit))
            }
            ChipKind::Hmc5883l => {
                if file[0x02] & 3 != 0 {
                    return [0; 3]; // idle, or a single measurement that nobody asked for
                }
                let per_gauss = [1370.0, 1090.0, 820.0, 660.0, 440.0, 390.0, 330.0, 230.0][usize::from(file[0x01] >> 5)];
                seen(field).map(|m| {
                    let counts = libm::round(m * per_gauss);
                    if (-2048.0..=2047.0).contains(&counts) { counts as i16 } else { -4096 }
                })
            }
            ChipKind::Lis3dh => {
                let (control, form) = (file[0x20], file[0x23]);
                if control >> 4 == 0 || control & 0x08 != 0 || control & 7 != 7 || form & 0x08 == 0 {
                    return [0; 3]; // powered down, or not the high resolution of all axes
                }
                let mg_per_digit = [1.0, 2.0, 4.0, 12.0][usize::from(form >> 4 & 3)];
                // twelve bits, left justified
                seen(force).map(|f| rounded(f * 1000.0 / mg_per_digit, 2047.0) << 4)
            }
        }
    }

    /// Puts a new reading into the data registers.
    fn latch(&mut self, at_ns: u64) {
        let words = self.measure(at_ns);
        let [x, y, z] = words;
        let bytes: Vec<u8> = match self.kind {
            ChipKind::Itg3200 => {
                // -13 200 at 35 degC, 280 counts a kelvin
                let warm = rounded((self.surroundings(at_ns).1 - 35.0) * 280.0 - 13_200.0, 32_767.0);
                [warm, x, y, z].iter().flat_map(|w: &i16| w.to_be_bytes()).collect()
            }
            ChipKind::Adxl345 | ChipKind::Lis3dh => words.iter().flat_map(|w| w.to_le_bytes()).collect(),
            ChipKind::Hmc5883l => [x, z, y].iter().flat_map(|w| w.to_be_bytes()).collect(),
        };
        let (first, count) = self.kind.data();
        self.registers[usize::from(first)..usize::from(first + count)].copy_from_slice(&bytes);
        if !self.forgetful {
            self.served.push(Served { at_ns, words });
        }
    }

    /// A start or stop came: a chip whose last byte was acknowledged still drives SDA then, and the bus locks up.
    fn interrupted(&mut self) {
        self.unfinished += u32::from(self.driving);
        self.driving = false;
    }

    fn advance_pointer(&mut self) {
        self.pointer = match (self.kind, self.pointer) {
            (ChipKind::Hmc5883l, 0x08) => 0x03,             // data sheet, page 11
            (ChipKind::Lis3dh, at) if !self.multiple => at, // data sheet, section 6.1.1
            (_, last) if last >= 63 => 0,
            (_, at) => at + 1,
        };
    }

    /// A start with an address, for reading or writing; `true` where the chip acknowledges.
    pub fn start(&mut self, address: u8, read: bool, at_ns: u64) -> bool {
        self.interrupted();
        if address != self.kind.address() {
            return false;
        }
        self.pointer_comes = !read;
        if read && self.pointer == self.kind.data().0 {
            self.latch(at_ns);
        }
        true
    }

    /// A byte from the master: the register's number first, then what is written there.
    pub fn write(&mut self, byte: u8) {
        if self.pointer_comes {
            self.pointer = byte & 63;
            self.multiple = byte & 0x80 != 0;
            self.pointer_comes = false;
        } else {
            self.registers[usize::from(self.pointer)] = byte;
            self.advance_pointer();
        }
    }

    /// A byte for the master, which refuses the `last` one.
    pub fn read(&mut self, last: bool) -> u8 {
        self.driving = !last;
        let byte = self.registers[usize::from(self.pointer)];
        self.advance_pointer();
        byte
    }

    /// A stop.
    pub fn stop(&mut self) {
        self.interrupted();
    }
}
