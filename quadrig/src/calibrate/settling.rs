//! A channel on its way to a reading.
//!
//! What it is: the samples of one analogue channel since a known value was put on, until it has settled.
//! What can go wrong: a rig that is not disarmed and at rest; a channel that is flagged, or does not settle in time.
//! Units: counts; time of the port.
//! Reference: specification `rig.md`, "Partial rigs are normal".

use super::channel::Channel;
use super::settle::{FEWEST, LENGTH_S, Reading, Sample, Unusable, reading};
use frame::rig::{CaptureVerdict, RigSample, RigState};
use std::time::Duration;

/// How long a point may take to settle.
const PATIENCE: Duration = Duration::from_secs(20);
/// How long a channel is given that is flagged or at an end of its range.
const STAYS: Duration = Duration::from_secs(3);

/// What came since the value was put on.
#[derive(Debug, Clone)]
pub(super) struct Settling {
    channel: Channel,
    begun: Duration,
    samples: Vec<Sample>,
    why: Unusable,
}

impl Settling {
    /// Begins at `now`.
    pub(super) fn new(channel: Channel, now: Duration) -> Self {
        Self { channel, begun: now, samples: Vec::new(), why: Unusable::Short { samples: 0, seconds: 0.0 } }
    }

    /// Takes a sample.
    pub(super) fn take(&mut self, sample: &RigSample) {
        let code = &sample.adc[self.channel.place()];
        let counts = f64::from(code.sum) / f64::from(code.count.max(1));
        self.samples.push(Sample { t: sample.at.as_s(), counts, flag: code.verdict.flag().map(|flag| flag.words) });
    }

    /// What the channel reads now, counts.
    pub(super) fn counts(&self) -> Option<f64> {
        self.samples.last().map(|last| last.counts)
    }

    /// The reading, or why there will be none; `None` while there is hope.
    pub(super) fn look(&mut self, now: Duration) -> Option<Result<Reading, Unusable>> {
        // the last two seconds, or as much more as holds enough samples
        let last = self.samples.last().map_or(0.0, |last| last.t);
        let from = self.samples.partition_point(|s| s.t <= last - LENGTH_S);
        match reading(&self.samples[from.min(self.samples.len().saturating_sub(FEWEST))..]) {
            Ok(reading) => return Some(Ok(reading)),
            Err(why) => self.why = why,
        }
        let stays = self.why.stays() && now > self.begun + STAYS;
        (stays || now > self.begun + PATIENCE).then_some(Err(self.why))
    }
}

/// Scales are taken with the rig disarmed and the rotor at rest; otherwise, why they are not.
pub(super) fn at_rest(sample: &RigSample) -> Result<(), String> {
    if sample.state != RigState::Disarmed {
        return Err(format!(
            "the rig is {}; expected it disarmed: a channel is calibrated at rest; nothing was stored",
            sample.state.words()
        ));
    }
    let turns =
        |verdict: CaptureVerdict| !matches!(verdict, CaptureVerdict::Stopped | CaptureVerdict::Absent | CaptureVerdict::Lost);
    if sample.rpm.iter().any(|code| turns(code.verdict)) {
        return Err("the rotor turns; expected it at rest; nothing was stored".to_owned());
    }
    Ok(())
}
