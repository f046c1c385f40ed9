//! What the desks of these tests have in common: the rotor's marks, the converter's blocks and the way to a running rig.

use firmware_rig::AdcBlock;
use frame::message::Beep;

/// Ticks of a millisecond.
pub(crate) const MS: u64 = 84_000;
/// Codes of thrust, torque, current, voltage and temperature: 11.5 V, 2 A.
pub(crate) const POWERED: [u16; 5] = [1427, 2048, 372, 2379, 900];
/// The same without the ESC's battery.
pub(crate) const UNPOWERED: [u16; 5] = [1427, 2048, 248, 0, 900];
/// What an ESC with three cells says on its way to ready.
pub(crate) const BEEPS: [Beep; 3] = [Beep::Long, Beep::Cells(3), Beep::Ready];

/// Eight conversions of each channel.
pub(crate) fn blocks(counts: [u16; 5]) -> [AdcBlock; 5] {
    counts.map(|code| {
        let mut block = AdcBlock::default();
        (0..8).for_each(|_| block.push(code));
        block
    })
}

/// Instants (ticks) in the millisecond that ends with `ms` at which a count of marks that rises from `from` to `to` is whole.
pub(crate) fn passes(ms: u64, from: f64, to: f64) -> Vec<u32> {
    let at = |mark: u64| (((ms - 1) as f64 + (mark as f64 - from) / (to - from)) * MS as f64) as u64 as u32;
    (from.floor() as u64 + 1..=to.floor() as u64).map(at).collect()
}
