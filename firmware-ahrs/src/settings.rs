//! What the board remembers without power: its calibration and its output mode.
//!
//! What it is: [`Settings`] and their content in flash; version and checksum around it are `settings-store`'s.
//! What can go wrong: a calibration with a number that is not finite, or a mode that does not exist, is refused as damaged.
//! Units: those of [`Calibration`].
//! Reference: specification `ahrs.md`, "Calibration": stored with a checksum, versioned, refused when stale or damaged.

use dcm::calibration::{CALIBRATION_WORDS, Calibration};
use frame::{ImuContent, ImuFormat};
use settings_store::Stored;

/// Everything that is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Text or binary.
    pub format: ImuFormat,
    /// Raw, calibrated or both.
    pub content: ImuContent,
    /// The board streams by itself.
    pub stream: bool,
    /// Corrections of the three sensors.
    pub calibration: Calibration,
}

impl Default for Settings {
    /// As the board leaves the factory: frames of raw words, streaming, no correction.
    fn default() -> Self {
        let (format, content) = (ImuFormat::default(), ImuContent::default());
        Self { format, content, stream: true, calibration: Calibration::default() }
    }
}

impl Stored for Settings {
    const VERSION: u8 = 1;

    fn write(&self, content: &mut [u8]) -> Option<usize> {
        let (modes, words) = content.split_first_chunk_mut::<3>()?;
        *modes = [self.format as u8, self.content as u8, u8::from(self.stream)];
        let words = words.get_mut(..4 * CALIBRATION_WORDS)?;
        for (slot, word) in words.chunks_exact_mut(4).zip(self.calibration.to_words()) {
            slot.copy_from_slice(&word.to_le_bytes());
        }
        Some(3 + 4 * CALIBRATION_WORDS)
    }

    fn read(content: &[u8]) -> Option<Self> {
        let (&[format, body, stream], bytes) = content.split_first_chunk::<3>()?;
        if bytes.len() != 4 * CALIBRATION_WORDS {
            return None;
        }
        let mut words = [0; CALIBRATION_WORDS];
        for (word, bytes) in words.iter_mut().zip(bytes.chunks_exact(4)) {
            *word = u32::from_le_bytes(bytes.try_into().ok()?);
        }
        let format = [ImuFormat::Binary, ImuFormat::Text].into_iter().find(|f| *f as u8 == format)?;
        let contents = [ImuContent::Raw, ImuContent::Calibrated, ImuContent::Both];
        let content = contents.into_iter().find(|c| *c as u8 == body)?;
        Some(Self { format, content, stream: stream != 0, calibration: Calibration::from_words(&words)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use settings_store::{MAX_STORED, open, seal};

    #[test]
    fn the_stored_form_comes_back_and_what_is_not_finite_is_refused() {
        let mut settings = Settings { format: ImuFormat::Text, content: ImuContent::Both, stream: false, ..Settings::default() };
        settings.calibration.mag_offset.y = -31.5;
        let mut buffer = [0; MAX_STORED];
        assert_eq!(open(seal(&settings, &mut buffer).unwrap()), Some(settings));
        settings.calibration.accel_matrix.m12 = f32::NAN;
        assert_eq!(open::<Settings>(seal(&settings, &mut buffer).unwrap()), None);
    }

    #[test]
    fn a_mode_that_does_not_exist_is_refused() {
        let mut content = [0; MAX_STORED];
        let used = Settings::default().write(&mut content).unwrap();
        for (at, value) in [(0, 2), (1, 3)] {
            let mut wrong = content;
            wrong[at] = value;
            assert_eq!(Settings::read(&wrong[..used]), None);
        }
        assert_eq!(Settings::read(&content[..used]), Some(Settings::default()));
        assert_eq!(Settings::read(&content[..used - 1]), None);
    }
}
