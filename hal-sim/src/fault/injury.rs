//! What a mishap does to the pins, millisecond by millisecond.
//!
//! What it is: edges that are taken away, added, moved or replaced by another train; codes in the place of an analogue pin's own; what
//! becomes of the host's bytes.
//! What can go wrong: nothing here fails; a channel without marks is left alone.
//! Units: ticks of 84 MHz, counts of 12 bits, ms since the mishap.
//! Reference: specification `rig.md`, "The simulator" (faults).

use super::{Mishap, Plan};
use crate::bench::{Bench, Millisecond};
use crate::noise::{Source, Stream};
use firmware_rig::AdcBlock;

/// Time between two frames of the host that is still normal, ms: the command line and the simulated hosts ping at this rate.
pub const PING_MS: u64 = 200;
/// Ticks of a millisecond.
const MS: f64 = 84_000.0;
/// Edges of an input that screams, in a millisecond: more than the board's queue holds.
const SCREAM: usize = 200;
/// Time between two marks of a rotor that is turned by hand, ms.
const BY_HAND_MS: f64 = 8.0;
/// How long the board stands a channel that reads nothing, ms.
const ANALOGUE_MS: u16 = 100;

/// A mishap at work.
#[derive(Debug, Clone)]
pub struct Injury {
    plan: Plan,
    draw: Stream,
    /// Next edge of a train that replaces a sensor's own, ticks since power-up.
    next: [Option<f64>; 4],
    /// Marks that have passed since the mishap.
    passed: [u32; 4],
    /// Edges that are still to come, ticks modulo 2^32.
    late: [Vec<u32>; 4],
}

impl Injury {
    /// The mishap of a plan.
    #[must_use]
    pub fn new(plan: &Plan) -> Self {
        let draw = Stream::new(plan.seed, Source::Phase, 78);
        Self { plan: *plan, draw, next: [None; 4], passed: [0; 4], late: Default::default() }
    }

    /// What goes wrong.
    #[must_use]
    pub const fn mishap(&self) -> Mishap {
        self.plan.mishap
    }

    /// Marks a revolution of a channel, as configured.
    #[must_use]
    pub fn marks(&self, channel: u8) -> u16 {
        self.plan.config.marks[usize::from(channel)]
    }

    /// Speed that a sensor reads in the place of `rpm`; `None` where its own edges stay.
    #[must_use]
    pub fn train_rpm(&self, channel: u8, rpm: f64) -> Option<f64> {
        let share = self.plan.share;
        let off = 0.04 + 0.02 * share;
        let beyond = 10_000.0 * (1.2 + 0.3 * share);
        match self.plan.mishap {
            Mishap::Skewed { channel: c } if c == channel => Some(rpm * if share < 0.5 { 1.0 + off } else { 1.0 - off }),
            Mishap::TwoSkewed { a, .. } if a == channel => Some(rpm * (1.0 + off)),
            Mishap::TwoSkewed { b, .. } if b == channel => Some(rpm * (1.0 - off)),
            Mishap::Fast { channel: c } if c == channel => Some(beyond),
            Mishap::TwoFast { a, b } if a == channel || b == channel => Some(beyond),
            Mishap::RotorTurns { channel: c } if c == channel => {
                Some(60_000.0 / BY_HAND_MS / f64::from(self.plan.config.marks[usize::from(c)].max(1)))
            }
            _ => None,
        }
    }

    /// Whether the next mark that passes a sensor gives no edge.
    pub fn overlooks(&mut self, channel: u8) -> bool {
        let every = 4 + (3.0 * self.plan.share) as u32;
        match self.plan.mishap {
            Mishap::StuckLine { channel: c } => c == channel,
            Mishap::Misses { channel: c } if c == channel => self.counts(channel, every),
            Mishap::TwoMiss { a, b } if a == channel || b == channel => self.counts(channel, every),
            _ => false,
        }
    }

    /// Counts a mark; every so many in turn is the one.
    fn counts(&mut self, channel: u8, every: u32) -> bool {
        let passed = &mut self.passed[usize::from(channel)];
        *passed += 1;
        passed.is_multiple_of(every)
    }

    /// Code at an analogue pin in the place of its own, `since` ms after the mishap.
    pub fn code(&mut self, channel: u8, since: u64) -> Option<u16> {
        let end = |high: bool| if high { 4095 } else { 0 };
        match self.plan.mishap {
            Mishap::Saturated { channel: c, high } if c == channel => Some(end(high)),
            Mishap::Contact { channel: c } if c == channel => {
                let open = self.contact_ms();
                (since % (open + 20) < open).then_some(0)
            }
            Mishap::FloatingInput { channel: c } if c == channel => Some((self.draw.uniform() * 4096.0) as u16),
            Mishap::Temperature { high } if channel == 4 => Some(if high { 1738 } else { 248 }), // 90 and -30 degC of a TMP36
            _ => None,
        }
    }

    /// How long a loose contact is open, ms: less than any limit of its channel stands.
    fn contact_ms(&self) -> u64 {
        let limits = &self.plan.config.limits;
        let own = match self.plan.mishap {
            Mishap::Contact { channel: 0 } => limits.thrust.ms,
            Mishap::Contact { channel: 1 } if limits.torque.low.is_some() => limits.torque.ms,
            Mishap::Contact { channel: 3 } => limits.voltage.ms,
            Mishap::Contact { channel: 4 } if limits.temperature.low.is_some() => limits.temperature.ms,
            _ => ANALOGUE_MS,
        };
        (f64::from(own.min(ANALOGUE_MS)) * 0.8) as u64
    }

    /// Whether the converter delivers nothing, `since` ms after the mishap.
    #[must_use]
    pub fn converter_rests(&self, since: u64) -> bool {
        match self.plan.mishap {
            Mishap::NoConversions => true,
            Mishap::Gap => since < 1 + (0.9 * f64::from(ANALOGUE_MS) * self.plan.share) as u64,
            _ => false,
        }
    }

    /// What the board's peripherals gathered in millisecond `ms`, injured; the rotor turns at `rpm`.
    pub fn injure(&mut self, ms: u64, since: u64, rpm: f64, gathered: &mut Millisecond) {
        for channel in 0..4u8 {
            self.edges(channel, ms, since, rpm, &mut gathered.edges[usize::from(channel)]);
        }
        for channel in 0..5u8 {
            if let Some(code) = self.code(channel, since) {
                let block = &mut gathered.adc[usize::from(channel)];
                let count = std::mem::take(block).count;
                (0..count).for_each(|_| block.push(code));
            }
        }
        if self.converter_rests(since) {
            gathered.adc = [AdcBlock::default(); 5];
        }
    }

    fn edges(&mut self, channel: u8, ms: u64, since: u64, rpm: f64, edges: &mut Vec<u32>) {
        let n = usize::from(channel);
        if self.plan.mishap.lines() >> n & 1 == 0 {
            return;
        }
        let start = (ms - 1) as f64 * MS;
        let marks = f64::from(self.plan.config.marks[n]);
        if let Some(rpm) = self.train_rpm(channel, rpm) {
            self.replace(n, start, marks * rpm, edges);
            return;
        }
        let period = 60_000.0 * MS / (marks * rpm).max(1.0);
        match self.plan.mishap {
            Mishap::StuckLine { .. } | Mishap::Misses { .. } | Mishap::TwoMiss { .. } => {
                edges.retain(|_| !self.overlooks(channel))
            }
            Mishap::Stray { .. } => {
                let wanted = MS / period * (0.5 + self.plan.share);
                let count = wanted as usize + usize::from(self.draw.uniform() < wanted.fract());
                self.scatter(start, count, edges);
            }
            Mishap::Screams { .. } => self.scatter(start, SCREAM, edges),
            Mishap::Overwritten { .. } if since == 0 => self.scatter(start, SCREAM, edges),
            Mishap::FloatingLine { .. } => {
                let count = (self.draw.uniform() * 300.0) as usize;
                self.scatter(start, count, edges);
            }
            Mishap::Doubles { .. } => {
                let every = 3 + (2.0 * self.plan.share) as u32;
                for edge in edges.clone() {
                    if self.counts(channel, every) {
                        self.late[n].push(edge.wrapping_add((0.4 * period) as u32));
                    }
                }
                self.come_due(n, start, edges);
            }
            Mishap::Uneven { .. } => {
                let behind = ((0.1 + 0.1 * self.plan.share) * period) as u32;
                for edge in std::mem::take(edges) {
                    let moved = if self.counts(channel, 2) { edge.wrapping_add(behind) } else { edge };
                    self.late[n].push(moved);
                }
                self.come_due(n, start, edges);
            }
            _ => {}
        }
    }

    /// Edges of another speed in the place of a sensor's own. The first comes at once, that of a sensor that only reads off a period later.
    fn replace(&mut self, n: usize, start: f64, marks_a_minute: f64, edges: &mut Vec<u32>) {
        edges.clear();
        if marks_a_minute < 1.0 {
            return;
        }
        let period = 60_000.0 * MS / marks_a_minute;
        let off = matches!(self.plan.mishap, Mishap::Skewed { .. } | Mishap::TwoSkewed { .. });
        let mut at = self.next[n].unwrap_or(start + if off { period } else { 0.0 });
        while at < start + MS {
            edges.push(at as u64 as u32);
            at += period;
        }
        self.next[n] = Some(at);
    }

    /// Adds edges anywhere in the millisecond that begins at `start`.
    fn scatter(&mut self, start: f64, count: usize, edges: &mut Vec<u32>) {
        let begin = start as u64 as u32;
        edges.extend((0..count).map(|_| begin.wrapping_add((self.draw.uniform() * MS) as u32)));
        edges.sort_unstable_by_key(|edge| edge.wrapping_sub(begin));
    }

    /// Adds those of the late edges that belong to the millisecond that begins at `start`.
    fn come_due(&mut self, n: usize, start: f64, edges: &mut Vec<u32>) {
        let begin = start as u64 as u32;
        let due = |edge: &u32| edge.wrapping_sub(begin) < MS as u32;
        edges.extend(self.late[n].iter().filter(|e| due(e)));
        self.late[n].retain(|edge| !due(edge));
        edges.sort_unstable_by_key(|edge| edge.wrapping_sub(begin));
    }

    /// What becomes of the host's bytes on their way.
    #[must_use]
    pub fn line(&mut self, mut said: Vec<u8>, heard_back: &[u8]) -> Vec<u8> {
        match self.plan.mishap {
            Mishap::Silence => said.clear(),
            Mishap::CorruptFrames => damage(&mut said),
            Mishap::OneCorrupt if self.passed[0] == 0 && !said.is_empty() => {
                self.passed[0] = 1;
                damage(&mut said);
            }
            Mishap::Partial { front: true } => said.truncate(said.len() / 2),
            Mishap::Partial { front: false } => drop(said.drain(..said.len() / 2)),
            Mishap::Garbage => {
                let count = (self.draw.uniform() * 12.0) as usize;
                said.extend((0..count).map(|_| (self.draw.uniform() * 256.0) as u8));
            }
            Mishap::Echo => said.extend(heard_back),
            _ => {}
        }
        said
    }

    /// Whether the host says nothing, `silent` ms after its last frame.
    #[must_use]
    pub fn host_waits(&self, silent: u64) -> bool {
        match self.plan.mishap {
            Mishap::LateHost => silent < u64::from(self.plan.config.link_ms) - 100,
            _ => silent < PING_MS,
        }
    }
}

/// What hands do to the bench when the mishap of a plan comes.
pub fn by_hand(plan: &Plan, bench: &mut Bench) {
    let share = plan.share;
    match plan.mishap {
        Mishap::Overload { up } => bench.hang(if up { -4000.0 } else { 4000.0 }),
        Mishap::Twist { up } => bench.twist(if up { 0.45 } else { -0.55 }),
        Mishap::OverCurrent => bench.draw(35.0 + 20.0 * share),
        Mishap::NotIdle => bench.draw(2.0 + 5.0 * share),
        Mishap::Supply { high } => bench.set_supply(if high { 13.6 } else { 8.0 } + 0.7 * share),
        Mishap::PowerCut => bench.set_power(false),
        Mishap::Unheard => bench.set_power(true),
        _ => {}
    }
}

/// Damages a frame in its middle.
fn damage(bytes: &mut [u8]) {
    let middle = bytes.len() / 2;
    if let Some(byte) = bytes.get_mut(middle) {
        *byte ^= 0x5a;
    }
}
