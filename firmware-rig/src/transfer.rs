//! A configuration that comes over the line in parts.
//!
//! What it is: the parts are gathered until the host says how long the whole is and what its checksum is; only then is it read.
//! What can go wrong: a part that does not follow the one before it, a wrong length or checksum, and a value out of its range give nothing:
//! what was in force stays.
//! Units: bytes.
//! Reference: specification `rig.md`, "Partial rigs are normal"; CRC-32/ISO-HDLC.

use crate::rig_config::{OutOfRange, RigConfig};
use frame::message::{CONFIG_PART, ConfigPart};
use frame::wire::checksum;
use heapless::Vec;
use settings_store::Stored;

/// Longest configuration, bytes.
pub const LONGEST: usize = 448;

/// Parts so far.
#[derive(Debug, Clone, Default)]
pub(crate) struct Incoming {
    parts: Vec<u8, LONGEST>,
}

impl Incoming {
    /// Takes a part; the one at 0 begins anew.
    pub(crate) fn take(&mut self, part: &ConfigPart) -> Result<(), OutOfRange> {
        if part.at == 0 {
            self.parts.clear();
        }
        if usize::from(part.at) != self.parts.len() {
            return Err(OutOfRange);
        }
        self.parts.extend_from_slice(&part.bytes).map_err(|_| OutOfRange)
    }

    /// The whole, if it is one.
    pub(crate) fn finish(&mut self, length: u16, crc: u32) -> Result<RigConfig, OutOfRange> {
        let whole = self.parts.get(..usize::from(length)).ok_or(OutOfRange)?;
        let config = if checksum(whole) == crc { RigConfig::read(whole) } else { None };
        self.parts.clear();
        config.ok_or(OutOfRange)
    }
}

impl RigConfig {
    /// The part of its form that begins at byte `at`; `None` behind its end.
    #[must_use]
    pub fn part(&self, at: u16) -> Option<ConfigPart> {
        let mut content = [0; LONGEST + CONFIG_PART];
        let used = self.write(content.get_mut(..LONGEST)?)?;
        let from = usize::from(at);
        if from >= used {
            return None;
        }
        let mut bytes = [0; CONFIG_PART];
        bytes.copy_from_slice(content.get(from..from + CONFIG_PART)?);
        Some(ConfigPart { at, length: used as u16, bytes })
    }

    /// A configuration from its form; `None` when it is none or a value is out of its range.
    #[must_use]
    pub fn from_form(form: &[u8]) -> Option<Self> {
        Self::read(form)
    }

    /// Its form in parts, with length and checksum: what a host sends.
    pub fn parts(&self) -> impl Iterator<Item = ConfigPart> + '_ {
        (0..LONGEST as u16).step_by(CONFIG_PART).map_while(|at| self.part(at))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    fn config() -> RigConfig {
        RigConfig { log_period_ms: 50, ..RigConfig::of(&Config::thesis_570kv()) }
    }

    fn sent(parts: &[ConfigPart]) -> Result<RigConfig, OutOfRange> {
        let mut incoming = Incoming::default();
        parts.iter().try_for_each(|part| incoming.take(part))?;
        incoming.finish(parts[0].length, config().digest())
    }

    #[test]
    fn what_is_sent_in_parts_arrives_whole_or_not_at_all() {
        let parts: std::vec::Vec<ConfigPart> = config().parts().collect();
        assert!(parts.len() > 3 && parts.len() * CONFIG_PART <= LONGEST, "{} parts", parts.len());
        assert_eq!(sent(&parts), Ok(config()));
        for lost in 0..parts.len() {
            let rest: std::vec::Vec<ConfigPart> = parts.iter().copied().filter(|p| *p != parts[lost]).collect();
            assert_eq!(sent(&rest), Err(OutOfRange), "without part {lost}");
            let mut hurt = parts.clone();
            hurt[lost].bytes[0] ^= 1;
            assert_eq!(sent(&hurt), Err(OutOfRange), "part {lost} damaged");
        }
    }
}
