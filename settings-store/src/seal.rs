//! The stored form: version, content, checksum.
//!
//! What it is: one byte of version, what the settings write, CRC-32 of both.
//! What can go wrong: any byte that changed, any cut and any other version give nothing.
//! Units: bytes.
//! Reference: CRC-32/ISO-HDLC.

/// Longest stored form, bytes.
pub const MAX_STORED: usize = 464;
const TRAILER: usize = 4;
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Settings that can be stored.
pub trait Stored: Sized + PartialEq {
    /// Version of the content; another one is stale.
    const VERSION: u8;

    /// Writes the content; gives its length, or `None` when it does not fit.
    fn write(&self, content: &mut [u8]) -> Option<usize>;

    /// Reads the content; `None` when it is none or out of range.
    fn read(content: &[u8]) -> Option<Self>;
}

/// The stored form. `None` when it does not fit.
#[must_use]
pub fn seal<'a, T: Stored>(settings: &T, buffer: &'a mut [u8; MAX_STORED]) -> Option<&'a [u8]> {
    let (head, rest) = buffer.split_first_mut()?;
    *head = T::VERSION;
    let room = rest.len().checked_sub(TRAILER)?;
    let used = 1 + settings.write(rest.get_mut(..room)?)?;
    let crc = CRC.checksum(buffer.get(..used)?).to_le_bytes();
    buffer.get_mut(used..used + TRAILER)?.copy_from_slice(&crc);
    buffer.get(..used + TRAILER)
}

/// Settings from their stored form; `None` for another version, a wrong checksum or impossible settings.
#[must_use]
pub fn open<T: Stored>(stored: &[u8]) -> Option<T> {
    let (content, crc) = stored.split_at_checked(stored.len().checked_sub(TRAILER)?)?;
    if CRC.checksum(content).to_le_bytes() != *crc {
        return None;
    }
    let (version, body) = content.split_first()?;
    if *version == T::VERSION { T::read(body) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq)]
    struct Number<const VERSION: u8>(u16);

    impl<const VERSION: u8> Stored for Number<VERSION> {
        const VERSION: u8 = VERSION;
        fn write(&self, content: &mut [u8]) -> Option<usize> {
            content.get_mut(..2)?.copy_from_slice(&self.0.to_le_bytes());
            Some(2)
        }
        fn read(content: &[u8]) -> Option<Self> {
            Some(Self(u16::from_le_bytes(content.try_into().ok()?)))
        }
    }

    #[test]
    fn it_comes_back_and_every_damage_cut_and_other_version_is_refused() {
        let mut buffer = [0; MAX_STORED];
        let stored = seal(&Number::<3>(517), &mut buffer).unwrap();
        assert_eq!((stored.len(), open(stored)), (7, Some(Number::<3>(517))));
        assert_eq!(open::<Number<4>>(stored), None, "stale");
        for cut in 0..7 {
            assert_eq!(open::<Number<3>>(&stored[..cut]), None);
        }
        for bit in 0..7 * 8 {
            let mut broken = [0; 7];
            broken.copy_from_slice(stored);
            broken[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(open::<Number<3>>(&broken), None, "bit {bit}");
        }
    }
}
