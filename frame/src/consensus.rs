//! One speed from four channels, with what each deviates from it.
//!
//! What it is: the median of the channels that trust themselves, and each channel's deviation from it.
//! What can go wrong: with no trustworthy channel there is no consensus; a flagged channel is reported and never averaged in.
//! Units: rev/min; deviations relative.
//! Reference: Beharie 2013, Fig. 5.59 and 5.63 (differences from the reference channel); specification `rig.md`.

use crate::rig::{CAPTURE_CHANNELS, CaptureVerdict};

/// The speed of the channels together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Consensus {
    /// Speed, rev/min.
    pub rpm: f64,
    /// Each channel's deviation from it, relative; `None` for a channel without a number.
    pub deviation: [Option<f64>; CAPTURE_CHANNELS],
    /// Channels that the consensus rests on.
    pub trusted: u8,
}

impl Consensus {
    /// Median of the channels whose verdict is nominal (or that stand still).
    #[must_use]
    pub fn of(rpm: &[Option<f64>; CAPTURE_CHANNELS], verdicts: &[CaptureVerdict; CAPTURE_CHANNELS]) -> Option<Self> {
        let mut sorted = [f64::INFINITY; CAPTURE_CHANNELS];
        let mut trusted = 0u8;
        let good = |v: &CaptureVerdict| matches!(v, CaptureVerdict::Nominal | CaptureVerdict::Stopped);
        let healthy = rpm.iter().zip(verdicts).filter(|(_, v)| good(v)).filter_map(|(r, _)| *r);
        for (slot, value) in sorted.iter_mut().zip(healthy) {
            *slot = value;
            trusted += 1;
        }
        sorted.sort_unstable_by(f64::total_cmp);
        let n = usize::from(trusted);
        let upper = *sorted.get(n / 2).filter(|_| n > 0)?;
        let lower = *sorted.get(n.saturating_sub(1) / 2)?;
        let speed = 0.5 * (lower + upper);
        let deviation = rpm.map(|r| r.filter(|_| speed > 0.0).map(|r| r / speed - 1.0));
        Some(Self { rpm: speed, deviation, trusted })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use CaptureVerdict::{Disagrees, Lost, Missed, Nominal, Stopped};

    #[test]
    fn flagged_channels_are_reported_and_not_averaged() {
        let rpm = [Some(4000.0), Some(4002.0), Some(8000.0), None];
        let all = Consensus::of(&rpm, &[Nominal, Nominal, Disagrees, Lost]).unwrap();
        assert_eq!((all.rpm, all.trusted), (4001.0, 2));
        assert!((all.deviation[2].unwrap() - 0.9995).abs() < 1e-3);
        assert_eq!(all.deviation[3], None);
        assert_eq!(Consensus::of(&rpm, &[Missed, Missed, Disagrees, Lost]), None);
        let one = Consensus::of(&rpm, &[Missed, Nominal, Disagrees, Lost]).unwrap();
        assert_eq!((one.rpm, one.trusted), (4002.0, 1));
        let rest = Consensus::of(&[Some(0.0); 4], &[Stopped; 4]).unwrap();
        assert_eq!((rest.rpm, rest.deviation), (0.0, [None; 4]));
    }

    /// The middle one of three, the mean of the two in the middle of four: a channel that is far off moves neither.
    #[test]
    fn it_is_the_median() {
        let of = |rpm: [f64; 4], verdicts| Consensus::of(&rpm.map(Some), &verdicts).unwrap();
        let three = of([9000.0, 4000.0, 4100.0, 0.0], [Nominal, Nominal, Nominal, Lost]);
        assert_eq!((three.rpm, three.trusted), (4100.0, 3));
        let four = of([9000.0, 4000.0, 4100.0, 4200.0], [Nominal; 4]);
        assert_eq!((four.rpm, four.trusted), (4150.0, 4));
        assert!((four.deviation[1].unwrap() - (4000.0 / 4150.0 - 1.0)).abs() < 1e-12);
        let two = of([0.0, 4000.0, 4100.0, 0.0], [Stopped, Nominal, Missed, Lost]);
        assert_eq!((two.rpm, two.trusted), (2000.0, 2), "a channel that stands is trusted");
    }
}
