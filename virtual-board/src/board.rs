//! What every virtual board can do, and how one is switched on.
//!
//! What it is: [`VirtualBoard`], one call a millisecond; [`switch_on`] makes one from a scenario file, a flash file and an image.
//! What can go wrong: a scenario that is refused, a flash file that is none, a program that was built without the emulator.
//! Units: ms; bytes.
//! Reference: specification `rig.md`, "The operator's side".

use crate::flash_file::FlashFile;
use crate::hand::Hand;
use crate::imu::ImuBoard;
use crate::rig::RigBoard;
use frame::message::Beep;
use hal_sim::scenario::AnyScenario;
use hal_sim::{Scenario, ScenarioError, Truth};
use std::path::{Path, PathBuf};

/// A board and what it is wired to.
pub trait VirtualBoard {
    /// Which board it is.
    fn kind(&self) -> Kind;

    /// The next millisecond: takes the bytes that the host has said, gives those that reach the host.
    ///
    /// # Errors
    /// [`BoardError`] of a settings' file that cannot be written, or of an emulator that gave up.
    fn millisecond(&mut self, said: &[u8]) -> Result<Vec<u8>, BoardError>;

    /// Milliseconds since power-up.
    fn ms(&self) -> u64;

    /// The ESC's next beep pattern that has ended.
    fn beep(&mut self) -> Option<Beep>;

    /// Does what a hand does at the bench.
    ///
    /// # Errors
    /// Why this board's bench has nothing to take hold of.
    fn hand(&mut self, hand: &Hand) -> Result<(), &'static str>;

    /// Whether the ESC's supply is switched on.
    fn is_powered(&self) -> bool;

    /// What meters beside the board's own would show; `None` where there is nothing to measure.
    fn meters(&self) -> Option<Truth>;
}

/// Which board, and how it runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The rig board's firmware, natively.
    Rig,
    /// The IMU board's firmware, natively.
    Imu,
    /// The rig board's flash image on the emulated microcontroller.
    RigImage,
}

impl Kind {
    /// In words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Rig => "rig board, native",
            Self::Imu => "IMU board, native",
            Self::RigImage => "rig board, flash image in the emulator",
        }
    }
}

/// Why there is no board, or no longer one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BoardError {
    /// The scenario was refused.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The settings' file could not be read or written.
    #[error("{file}: cannot be read or written ({source}); expected a file: check name and folder")]
    File {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The settings' file is none.
    #[error(
        "{file}: {found} bytes; expected the settings' sectors of a board, {expected} bytes: name another file, or delete this one"
    )]
    Length {
        /// The file.
        file: PathBuf,
        /// Its length.
        found: usize,
        /// What it should be.
        expected: usize,
    },
    /// This program was built without the emulator.
    #[error(
        "--image: expected a program with the emulator: `cargo run --release --features emulated --ignore-rust-version -- ...` builds a program with it"
    )]
    NoEmulator,
    /// The image is that of a board which the emulator is not wired for.
    #[error("{scenario}: describes the IMU board; expected a scenario of the rig with --image")]
    NoImuImage {
        /// The scenario.
        scenario: PathBuf,
    },
    /// The emulator refused the image, or stopped.
    #[error("{image}: {what}")]
    Emulator {
        /// The image.
        image: PathBuf,
        /// What it said.
        what: String,
    },
}

/// What is to be switched on.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Order {
    /// Scenario file: the rig or the IMU board on its body; without one the demonstration rig.
    pub scenario: Option<PathBuf>,
    /// Where no scenario says which board it is: the IMU board.
    pub imu: bool,
    /// File that keeps the settings' sectors.
    pub flash: Option<PathBuf>,
    /// ELF file of the rig board's flash image.
    pub image: Option<PathBuf>,
}

/// Switches a board on.
///
/// # Errors
/// See [`BoardError`].
pub fn switch_on(order: &Order) -> Result<Box<dyn VirtualBoard>, BoardError> {
    let flash = order.flash.as_deref().map(FlashFile::open).transpose()?;
    let scenario = match &order.scenario {
        Some(path) => AnyScenario::load(path)?,
        None if order.imu => AnyScenario::Imu(Box::default()),
        None => AnyScenario::Rig(Box::default()),
    };
    match (scenario, &order.image) {
        (AnyScenario::Rig(scenario), Some(image)) => on_image(&scenario, image, flash),
        (AnyScenario::Imu(_), Some(_)) => Err(BoardError::NoImuImage { scenario: order.scenario.clone().unwrap_or_default() }),
        (AnyScenario::Rig(scenario), None) => Ok(Box::new(RigBoard::new(&scenario, flash))),
        (AnyScenario::Imu(scenario), None) => Ok(Box::new(ImuBoard::new(&scenario, flash))),
    }
}

#[cfg(feature = "emulated")]
fn on_image(scenario: &Scenario, image: &Path, flash: Option<FlashFile>) -> Result<Box<dyn VirtualBoard>, BoardError> {
    Ok(Box::new(crate::image::ImageBoard::new(scenario, image, flash)?))
}

#[cfg(not(feature = "emulated"))]
fn on_image(_: &Scenario, _: &Path, _: Option<FlashFile>) -> Result<Box<dyn VirtualBoard>, BoardError> {
    Err(BoardError::NoEmulator)
}
