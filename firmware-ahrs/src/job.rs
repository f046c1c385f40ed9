//! What takes longer than a tick has.
//!
//! What it is: work that the tick hands to the idle loop, flash and least squares, and what comes back.
//! What can go wrong: a board that loses power meanwhile has lost the work, and nothing else.
//! Units: as in the results.
//! Reference: house rule 1: the flash enters as a trait.

use crate::settings::Settings;
use core::ops::Range;
use dcm::Vec3;
use dcm::calibration::{Alignment, CalibrationError, Collector, Ellipsoid, alignment, ellipsoid};
use embedded_storage_async::nor_flash::NorFlash;
use frame::message::SettingsNews;
use heapless::Vec;

/// Attitudes that an alignment takes.
pub const ATTITUDES: usize = 24;
/// Specific force and field at rest.
pub type Attitudes = Vec<(Vec3, Vec3), ATTITUDES>;

/// Work for the idle loop.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::large_enum_variant)] // there is no heap to put the collector on
pub enum Job {
    /// Store these.
    Save(Settings),
    /// Look for what is stored.
    Load,
    /// Fit hard and soft iron.
    Ellipsoid(Collector),
    /// Fit the axes.
    Alignment(Attitudes),
}

/// Its outcome.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Done {
    /// Stored, or not.
    Saved(SettingsNews),
    /// What was found.
    Loaded(Option<Settings>, SettingsNews),
    /// The fit and its readings.
    Ellipsoid(Result<Ellipsoid, CalibrationError>, u16),
    /// The fit and its attitudes.
    Alignment(Result<Alignment, CalibrationError>, u16),
}

impl Job {
    /// Does it. Settings live in `range` of `flash`.
    pub fn run<F: NorFlash>(&self, flash: &mut F, range: Range<u32>) -> Done {
        match self {
            Self::Save(settings) => Done::Saved(settings_store::save(flash, range, settings)),
            Self::Load => {
                let (found, news) = settings_store::load(flash, range);
                Done::Loaded(found, news)
            }
            Self::Ellipsoid(store) => Done::Ellipsoid(ellipsoid(store.readings()), store.readings().len() as u16),
            Self::Alignment(pairs) => Done::Alignment(alignment(pairs), pairs.len() as u16),
        }
    }
}
