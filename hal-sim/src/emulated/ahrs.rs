//! The IMU board on the emulator: three chips on the I2C bus, fed by a body whose motion is known.
//!
//! What it is: register files of ITG-3200, ADXL345 and HMC5883L with the identities, defaults and data order of the real
//! chips. Each keeps a record of what it handed out, so that a test can demand equality word by word.
//! What can go wrong: an unconfigured chip behaves like one (asleep, idle, wrong range), so a driver that skips its
//! configuration is seen. The chips are ideal otherwise: no noise, bias or misalignment.
//! Units: counts; ns since power-up.
//! Reference: the data sheets named in the drivers of `firmware-ahrs`; addresses and defaults written down here again on
//! purpose, not taken from them.

use super::machine::{EmulatedError, Machine, Outcome, Pins, Port, World, firmware, run};
use rigless::{
    chip::{Timeline, i2c},
    snapshot::Store,
};

/// Body axes of FRD and chip axes of a board that lies flat, parts on top: y and z are opposite.
fn to_chip(v: [f64; 3]) -> [f64; 3] {
    [v[0], -v[1], -v[2]]
}

/// A body that turns at a constant rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Roll, pitch and yaw at time 0, rad; the body turns from there.
    pub start: [f64; 3],
    /// Constant rate in body axes, rad/s.
    pub rate: [f64; 3],
    /// Magnetic field, earth NED, gauss.
    pub field: [f64; 3],
}

type Matrix = [[f64; 3]; 3];

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

impl Motion {
    /// Level, at rest, body x to magnetic north, in the field of central Europe.
    pub const LEVEL: Self = Self { start: [0.0; 3], rate: [0.0; 3], field: [0.2, 0.0, 0.44] };

    /// Rotation body to earth at a time, R = Rz Ry Rx exp(rate t).
    #[must_use]
    pub fn attitude(&self, at_ns: u64) -> [[f64; 3]; 3] {
        let [(sf, cf), (st, ct), (sp, cp)] = self.start.map(f64::sin_cos);
        let first = [
            [ct * cp, sf * st * cp - cf * sp, cf * st * cp + sf * sp],
            [ct * sp, sf * st * sp + cf * cp, cf * st * sp - sf * cp],
            [-st, sf * ct, cf * ct],
        ];
        let speed = self.rate.iter().map(|w| w * w).sum::<f64>().sqrt();
        if speed == 0.0 {
            return first;
        }
        let [x, y, z] = self.rate.map(|w| w / speed);
        let (s, c) = (speed * at_ns as f64 * 1e-9).sin_cos();
        let u: Matrix = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
        let uu = product(&u, &u);
        let turn =
            std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j)) + s * u[i][j] + (1.0 - c) * uu[i][j]));
        product(&first, &turn)
    }

    fn to_body(self, at_ns: u64, earth: [f64; 3]) -> [f64; 3] {
        let r = self.attitude(at_ns);
        std::array::from_fn(|j| (0..3).map(|i| r[i][j] * earth[i]).sum())
    }

    /// Specific force in body axes, g: at rest it points up.
    #[must_use]
    pub fn force(&self, at_ns: u64) -> [f64; 3] {
        self.to_body(at_ns, [0.0, 0.0, -1.0])
    }

    /// Field in body axes, gauss.
    #[must_use]
    pub fn magnetic(&self, at_ns: u64) -> [f64; 3] {
        self.to_body(at_ns, self.field)
    }
}

/// Which chip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChipKind {
    /// Gyro at 0x68.
    Itg3200,
    /// Accelerometer at 0x53.
    Adxl345,
    /// Magnetometer at 0x1E.
    Hmc5883l,
}

impl ChipKind {
    /// All three, in the order of the `present` bits.
    pub const ALL: [Self; 3] = [Self::Itg3200, Self::Adxl345, Self::Hmc5883l];

    const fn address(self) -> u8 {
        match self {
            Self::Itg3200 => 0x68,
            Self::Adxl345 => 0x53,
            Self::Hmc5883l => 0x1E,
        }
    }

    /// First data register and number of data bytes.
    const fn data(self) -> (u8, u8) {
        match self {
            Self::Itg3200 => (0x1B, 8),
            Self::Adxl345 => (0x32, 6),
            Self::Hmc5883l => (0x03, 6),
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
#[derive(Debug)]
struct Chip {
    kind: ChipKind,
    motion: Motion,
    registers: [u8; 64],
    pointer: u8,
    pointer_comes: bool,
    served: Vec<Served>,
    driving: bool,
    unfinished: u32,
}

fn rounded(value: f64, limit: f64) -> i16 {
    value.round().clamp(-limit - 1.0, limit) as i16
}

impl Chip {
    fn new(kind: ChipKind, motion: Motion) -> Self {
        Self {
            kind,
            motion,
            registers: kind.reset_registers(),
            pointer: 0,
            pointer_comes: false,
            served: Vec::new(),
            driving: false,
            unfinished: 0,
        }
    }

    /// The words that the chip would measure now in the state that its registers put it into.
    fn measure(&self, at_ns: u64) -> [i16; 3] {
        let file = &self.registers;
        match self.kind {
            ChipKind::Itg3200 => {
                if file[0x3E] & 0x40 != 0 || file[0x16] >> 3 & 3 != 3 {
                    return [0; 3]; // asleep, or a full scale that the data sheet does not define
                }
                to_chip(self.motion.rate).map(|w| rounded(w.to_degrees() * 14.375, 32_767.0))
            }
            ChipKind::Adxl345 => {
                if file[0x2D] & 0x08 == 0 {
                    return [0; 3]; // standby
                }
                let range = file[0x31] & 3;
                let full = file[0x31] & 8 != 0;
                let (per_g, limit) =
                    if full { (256.0, f64::from(512 << range) - 1.0) } else { (256.0 / f64::from(1 << range), 511.0) };
                to_chip(self.motion.force(at_ns)).map(|f| rounded(f * per_g, limit))
            }
            ChipKind::Hmc5883l => {
                if file[0x02] & 3 != 0 {
                    return [0; 3]; // idle, or a single measurement that nobody asked for
                }
                let per_gauss = [1370.0, 1090.0, 820.0, 660.0, 440.0, 390.0, 330.0, 230.0][usize::from(file[0x01] >> 5)];
                to_chip(self.motion.magnetic(at_ns)).map(|m| {
                    let counts = (m * per_gauss).round();
                    if (-2048.0..=2047.0).contains(&counts) { counts as i16 } else { -4096 }
                })
            }
        }
    }

    /// Puts a new reading into the data registers.
    fn latch(&mut self, at_ns: u64) {
        let words = self.measure(at_ns);
        let [x, y, z] = words;
        let bytes: Vec<u8> = match self.kind {
            ChipKind::Itg3200 => [-13_200, x, y, z].iter().flat_map(|w: &i16| w.to_be_bytes()).collect(),
            ChipKind::Adxl345 => words.iter().flat_map(|w| w.to_le_bytes()).collect(),
            ChipKind::Hmc5883l => [x, z, y].iter().flat_map(|w| w.to_be_bytes()).collect(),
        };
        let (first, count) = self.kind.data();
        self.registers[usize::from(first)..usize::from(first + count)].copy_from_slice(&bytes);
        self.served.push(Served { at_ns, words });
    }

    /// A start or stop came: a chip whose last byte was acknowledged still drives SDA then, and the bus locks up.
    fn interrupted(&mut self) {
        self.unfinished += u32::from(self.driving);
        self.driving = false;
    }

    fn advance_pointer(&mut self) {
        self.pointer = match (self.kind, self.pointer) {
            (ChipKind::Hmc5883l, 0x08) => 0x03, // data sheet, page 11
            (_, last) if last >= 63 => 0,
            (_, at) => at + 1,
        };
    }
}

impl Store for Chip {}

impl i2c::Peer for Chip {
    fn start(&mut self, address: u8, read: bool, line: &mut Timeline<'_, '_>) -> bool {
        self.interrupted();
        if address != self.kind.address() {
            return false;
        }
        self.pointer_comes = !read;
        if read && self.pointer == self.kind.data().0 {
            self.latch(line.now().0);
        }
        true
    }

    fn write(&mut self, byte: u8, _: &mut Timeline<'_, '_>) -> bool {
        if self.pointer_comes {
            self.pointer = byte & 63;
            self.pointer_comes = false;
        } else {
            self.registers[usize::from(self.pointer)] = byte;
            self.advance_pointer();
        }
        true
    }

    fn read(&mut self, last: bool, _: &mut Timeline<'_, '_>) -> u8 {
        self.driving = !last;
        let byte = self.registers[usize::from(self.pointer)];
        self.advance_pointer();
        byte
    }

    fn stop(&mut self, _: &mut Timeline<'_, '_>) {
        self.interrupted();
    }
}

/// What goes wrong on the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BusFault {
    /// Nothing.
    #[default]
    None,
    /// One chip is off the bus for a while.
    LoosePlug {
        /// Which of the fitted chips, in their order.
        nth: usize,
        /// When it goes, ns.
        off_ns: u64,
        /// When it comes back, ns.
        back_ns: u64,
    },
    /// A chip holds SDA low until it has seen some clocks.
    HeldData {
        /// When it begins to, ns.
        from_ns: u64,
        /// Rising edges of SCL after which it lets go; 0 for never.
        clocks: u32,
    },
}

/// What happens around the IMU board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ImuWorld {
    fault: BusFault,
    pulled_up: bool,
    held: bool,
    clock_high: bool,
    /// Rising edges of SCL while the data line was held.
    pub clocks_seen: u32,
}

/// Pins of the bus: port B.
const SCL: u8 = 6;
const SDA: u8 = 7;

impl ImuWorld {
    fn hold(&mut self, held: bool, pins: &mut Pins<'_>) {
        self.held = held;
        self.clock_high = pins.level(Port::B, SCL);
        pins.hold_i2c(held);
        pins.drive(Port::B, SDA, !held);
    }
}

impl World for ImuWorld {
    fn wake(&mut self, now_ns: u64, pins: &mut Pins<'_>) -> u64 {
        if !self.pulled_up {
            pins.drive(Port::B, SCL, true);
            pins.drive(Port::B, SDA, true);
            self.pulled_up = true;
        }
        match self.fault {
            BusFault::None => u64::MAX,
            BusFault::LoosePlug { nth, off_ns, back_ns } => {
                pins.unplug(nth, (off_ns..back_ns).contains(&now_ns));
                [off_ns, back_ns].into_iter().find(|at| *at > now_ns).unwrap_or(u64::MAX)
            }
            BusFault::HeldData { from_ns, .. } if now_ns < from_ns => from_ns,
            BusFault::HeldData { .. } => {
                self.hold(true, pins);
                u64::MAX
            }
        }
    }

    fn watches(&self) -> bool {
        self.held
    }

    fn accessed(&mut self, pins: &mut Pins<'_>) {
        let high = pins.level(Port::B, SCL);
        self.clocks_seen += u32::from(high && !self.clock_high);
        self.clock_high = high;
        if matches!(self.fault, BusFault::HeldData { clocks, .. } if clocks > 0 && self.clocks_seen >= clocks) {
            self.hold(false, pins);
        }
    }
}

/// What an IMU run leaves behind.
#[derive(Debug)]
pub struct AhrsRun {
    /// The run itself.
    pub outcome: Outcome<ImuWorld>,
    /// What each chip handed out, in the order of [`ChipKind::ALL`]; empty for a chip that was not fitted.
    pub served: [Vec<Served>; 3],
    /// Reads whose last byte was acknowledged, so that the chip still drove the bus at their end.
    pub unfinished: u32,
}

/// Runs the IMU image for `milliseconds` with the chips in `fitted` on a body that moves as `motion`.
///
/// # Errors
/// [`EmulatedError`] when there is no image or the emulator gives up.
pub fn ahrs(motion: Motion, fitted: &[ChipKind], fault: BusFault, milliseconds: u64) -> Result<AhrsRun, EmulatedError> {
    let elf = firmware("firmware-ahrs")?;
    let mut machine = Machine::new()?;
    for kind in fitted {
        machine.mcu.i2c1.inner.attach(Chip::new(*kind, motion));
    }
    let (outcome, mut machine) = run(&elf, machine, ImuWorld { fault, ..ImuWorld::default() }, milliseconds * 1_000_000)?;
    let mut unfinished = 0;
    let served = ChipKind::ALL.map(|kind| {
        let place = fitted.iter().position(|f| *f == kind);
        let chip = place.and_then(|n| machine.mcu.i2c1.inner.chip_mut::<Chip>(n));
        chip.map_or_else(Vec::new, |chip| {
            unfinished += chip.unfinished;
            std::mem::take(&mut chip.served)
        })
    });
    Ok(AhrsRun { outcome, served, unfinished })
}
