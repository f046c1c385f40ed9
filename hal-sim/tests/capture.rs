//! Four honest speed channels: the firmware's capture bank against the sensors' real geometry and jitter, and against one faulty
//! sensor at a time. A hundred seeds each.

use firmware_rig::Config;
use firmware_rig::bank::CaptureBank;
use frame::Consensus;
use frame::rig::{CAPTURE_NAMES, CaptureCode, CaptureVerdict};
use frame::units::Ticks;
use hal_sim::noise::{Source, Stream};
use hal_sim::sensor::{EdgeDetail, Geometry, Tachometers};

const MS: u64 = 84_000;
const SEEDS: u64 = 100;
/// Log period, ms.
const LOG_MS: u64 = 100;
/// When the sensor breaks; every sample after it counts, ms.
const BROKEN_MS: u64 = 1000;

/// What is wrong with one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Wrong {
    Nothing,
    /// The channel falls silent.
    Dead(usize),
    /// Marks are overlooked: a blade that the beam does not see now and then.
    Misses(usize),
    /// A mark is seen twice now and then.
    Doubles(usize),
    /// Reads high by 3 %: a disc or a count of marks that is not what the configuration says.
    Slips(usize),
    /// The second magnet is 20 degrees off.
    CrookedMagnet,
    /// The following blade is twisted: early by up to 8 degrees, growing with the square of the speed.
    Twist,
}

impl Wrong {
    fn channel(self) -> Option<usize> {
        match self {
            Self::Nothing => None,
            Self::Dead(c) | Self::Misses(c) | Self::Doubles(c) | Self::Slips(c) => Some(c),
            Self::CrookedMagnet => Some(2),
            Self::Twist => Some(0),
        }
    }

    /// Verdicts that name this fault.
    fn verdicts(self) -> &'static [CaptureVerdict] {
        use CaptureVerdict::{Alternating, BladeTwist, Disagrees, Doubled, Lost, Missed};
        match self {
            Self::Nothing => &[],
            Self::Dead(_) => &[Lost],
            Self::Misses(_) => &[Missed, Disagrees],
            Self::Doubles(_) => &[Doubled, Disagrees],
            Self::Slips(_) => &[Disagrees],
            Self::CrookedMagnet => &[Alternating],
            Self::Twist => &[BladeTwist],
        }
    }
}

/// Runs a rotor up to `rpm`, waits, breaks something, and gives the samples after that.
fn samples(seed: u64, rpm: f64, wrong: Wrong) -> Vec<[CaptureCode; 4]> {
    let mut geometry = Geometry::default();
    match wrong {
        Wrong::Misses(c) => geometry.miss[c] = if c == 3 { 0.02 } else { 0.15 },
        Wrong::CrookedMagnet => geometry.magnet_error_deg = 20.0,
        _ => {}
    }
    let mut draw = Stream::new(seed, Source::Phase, 5);
    let mut angle = draw.uniform();
    let mut tachometers = Tachometers::new(&geometry, EdgeDetail::Captured, seed, angle);
    let mut bank = CaptureBank::new(&Config::thesis_570kv());
    let mut kept = Vec::new();
    let mut blade = 0u32;
    let mut slipping = Tachometers::new(&geometry, EdgeDetail::Captured, seed, angle);
    let mut other = angle;
    for ms in 1..=2400u64 {
        let speed = rpm * (ms as f64 / 600.0).min(1.0);
        let broken = ms > BROKEN_MS;
        let mut edges: [Vec<u32>; 4] = Default::default();
        for step in 0..10u64 {
            let next = angle + speed / 60.0 * 1e-4;
            tachometers.step(angle, next, speed / 60.0, |channel: u8, rising: bool, fraction: f64| {
                if !rising {
                    return;
                }
                let c = usize::from(channel);
                let mut at = (((ms - 1) * 10 + step) as f64 + fraction) * (MS as f64 / 10.0);
                match wrong {
                    Wrong::Dead(w) if w == c && broken => return,
                    Wrong::Doubles(w) if w == c && broken && draw.uniform() < 0.15 => {
                        let period = 60.0 / speed.max(1.0) / f64::from(Config::thesis_570kv().marks[c]) * 84e6;
                        edges[c].push((at - draw.between(0.2, 0.8) * period) as u64 as u32);
                    }
                    Wrong::Slips(w) if w == c => return, // comes from the other disc
                    Wrong::Twist if c == 0 => {
                        blade += 1;
                        if blade.is_multiple_of(2) {
                            let degrees = 8.0 * (speed / 8000.0).powi(2);
                            at -= degrees / 360.0 * 60.0 / speed.max(1.0) * 84e6;
                        }
                    }
                    _ => {}
                }
                edges[c].push(at as u64 as u32);
            });
            angle = next;
            if let Wrong::Slips(w) = wrong {
                let next = other + speed / 60.0 * 1e-4 * if broken { 1.03 } else { 1.0 };
                slipping.step(other, next, speed / 60.0, |channel: u8, rising: bool, fraction: f64| {
                    if rising && usize::from(channel) == w {
                        edges[w].push(((((ms - 1) * 10 + step) as f64 + fraction) * (MS as f64 / 10.0)) as u64 as u32);
                    }
                });
                other = next;
            }
        }
        bank.take(Ticks(ms * MS), &edges.each_ref().map(Vec::as_slice), &[false; 4]);
        if ms % LOG_MS == 0 {
            let codes = bank.sample(Ticks(ms * MS));
            if ms > BROKEN_MS {
                kept.push(codes);
            }
        }
    }
    kept
}

fn speeds(codes: &[CaptureCode; 4]) -> [Option<f64>; 4] {
    let calibration = Config::thesis_570kv().calibration();
    core::array::from_fn(|c| calibration.speed(c, &codes[c]))
}

fn consensus(codes: &[CaptureCode; 4]) -> Consensus {
    Consensus::of(&speeds(codes), &codes.map(|c| c.verdict)).expect("a consensus")
}

/// A speed of its own for each seed, 1500 to 9000 rev/min.
fn speed_of(seed: u64) -> f64 {
    Stream::new(seed, Source::Phase, 6).between(1500.0, 9000.0)
}

#[test]
fn healthy_channels_agree_within_a_twentieth_of_a_percent_on_a_plateau() {
    let mut worst = [0.0f64; 4];
    for seed in 0..SEEDS {
        let rpm = speed_of(seed);
        let plateau = samples(seed, rpm, Wrong::Nothing);
        assert!(plateau.iter().flatten().all(|c| c.verdict == CaptureVerdict::Nominal), "seed {seed}");
        let mean = |c: usize| plateau.iter().map(|s| speeds(s)[c].expect("a speed")).sum::<f64>() / plateau.len() as f64;
        for (c, worst) in worst.iter_mut().enumerate() {
            *worst = worst.max((mean(c) / rpm - 1.0).abs());
        }
        for sample in &plateau {
            let error = consensus(sample).rpm / rpm - 1.0;
            assert!(error.abs() < 1e-3, "seed {seed}: consensus off by {error}");
        }
    }
    for (name, worst) in CAPTURE_NAMES.iter().zip(worst) {
        println!("{name:>12}: plateau means within {:.4} % of the truth over {SEEDS} seeds", worst * 100.0);
        assert!(worst < 2.5e-4, "{name}: two channels could be {worst} apart each way");
    }
}

/// The angle of the second magnet is told beside the speed, which it does not change; of what stands as it should, next to nothing is.
#[test]
fn the_angle_of_a_crooked_magnet_is_told() {
    let calibration = Config::thesis_570kv().calibration();
    for seed in 0..SEEDS {
        for (wrong, angle) in [(Wrong::CrookedMagnet, 20.0), (Wrong::Nothing, 0.0)] {
            let rpm = speed_of(seed);
            for codes in samples(seed, rpm, wrong) {
                let told: [Option<f64>; 4] = core::array::from_fn(|c| calibration.uneven_deg(c, &codes[c]));
                let [Some(beam), None, Some(hall), None] = told else { panic!("seed {seed}, {wrong:?}: {told:?}") };
                assert!(beam < 2.0, "seed {seed}, {wrong:?}: {beam} deg between blades that stand as they should");
                assert!((hall - angle).abs() < 1.0, "seed {seed}: {hall} deg of {angle}");
            }
        }
    }
}

#[test]
fn the_faulty_channel_is_the_one_that_is_flagged() {
    let mut list = vec![Wrong::CrookedMagnet, Wrong::Twist];
    for channel in 0..4 {
        list.extend([Wrong::Dead(channel), Wrong::Misses(channel), Wrong::Doubles(channel), Wrong::Slips(channel)]);
    }
    for wrong in list {
        let faulty = wrong.channel().expect("a channel");
        let (mut flagged, mut named, mut others, mut worst, mut seen) = (0, 0, 0, 0.0f64, std::collections::BTreeMap::new());
        for seed in 0..SEEDS {
            // twist shows at high speed; that it does not at low speed is another test
            let rpm = if wrong == Wrong::Twist { 6500.0 + 25.0 * seed as f64 } else { speed_of(seed) };
            let after = samples(seed, rpm, wrong);
            let own = after.iter().any(|s| wrong.verdicts().contains(&s[faulty].verdict));
            let foreign = after.iter().any(|s| (0..4).any(|c| c != faulty && s[c].verdict != CaptureVerdict::Nominal));
            let any = after.iter().any(|s| s[faulty].verdict != CaptureVerdict::Nominal);
            if !any || foreign {
                println!(
                    "{wrong:?}, seed {seed}, {rpm:.0} rev/min: {:?}",
                    after.iter().map(|s| s[faulty].verdict).collect::<Vec<_>>()
                );
            }
            flagged += usize::from(any && !foreign);
            named += usize::from(own && !foreign);
            others += usize::from(foreign);
            for sample in &after {
                worst = worst.max((consensus(sample).rpm / rpm - 1.0).abs());
                *seen.entry(format!("{:?}", sample[faulty].verdict)).or_insert(0) += 1;
            }
        }
        println!(
            "{wrong:?}: it alone flagged in {flagged} of {SEEDS}, by its own verdict in {named}, another blamed in {others}, consensus within {:.3} %; {seen:?}",
            worst * 100.0
        );
        assert!(flagged >= 99, "{wrong:?}: {flagged}");
        assert!(named >= 95, "{wrong:?}: {named}");
        assert!(worst < 1e-3, "{wrong:?}: consensus off by {worst}");
    }
}

#[test]
fn a_blade_that_is_straight_at_low_speed_is_not_called_twisted() {
    for seed in 0..20 {
        let after = samples(seed, 2000.0, Wrong::Twist);
        assert!(after.iter().all(|s| s[0].verdict == CaptureVerdict::Nominal), "seed {seed}");
    }
}

/// How marks are missed.
#[derive(Debug, Clone, Copy)]
enum Missing {
    /// Each of so many in turn.
    Every(u32),
    /// That share of them, by chance.
    Share(f64),
}

/// A rotor at `rpm` of which beam and hall, two marks each, both miss marks from the first on: what hall is told, and how many channels the
/// board counts as bad, sample by sample from 0.3 s after the speed was reached.
fn both_miss(seed: u64, rpm: f64, missing: Missing) -> Vec<(CaptureVerdict, u8)> {
    let mut draw = Stream::new(seed, Source::Phase, 7);
    let mut angle = draw.uniform();
    let mut tachometers = Tachometers::new(&Geometry::default(), EdgeDetail::Captured, seed, angle);
    let mut bank = CaptureBank::new(&Config::thesis_570kv());
    let mut passed = [(draw.uniform() * 5.0) as u32, (draw.uniform() * 5.0) as u32];
    let mut told = Vec::new();
    for ms in 1..=3_000u64 {
        let speed = rpm / 60.0 * (ms as f64 / 600.0).min(1.0);
        let mut edges: [Vec<u32>; 4] = Default::default();
        for step in 0..10u64 {
            let next = angle + speed * 1e-4;
            tachometers.step(angle, next, speed, |channel: u8, _: bool, fraction: f64| {
                let c = usize::from(channel);
                if let Some(passed) = [Some(0), None, Some(1), None][c].map(|place: usize| &mut passed[place]) {
                    *passed += 1;
                    let unseen = match missing {
                        Missing::Every(n) => passed.is_multiple_of(n),
                        Missing::Share(share) => draw.uniform() < share,
                    };
                    if unseen {
                        return;
                    }
                }
                edges[c].push(((((ms - 1) * 10 + step) as f64 + fraction) * (MS as f64 / 10.0)) as u64 as u32);
            });
            angle = next;
        }
        bank.take(Ticks(ms * MS), &edges.each_ref().map(Vec::as_slice), &[false; 4]);
        if ms % LOG_MS == 0 {
            let codes = bank.sample(Ticks(ms * MS));
            if ms > 900 {
                told.push((codes[2].verdict, bank.flagged()));
            }
        }
    }
    told
}

/// Missed marks of two are never taken for magnets that are not opposite, and two such channels stop a run: both count as bad for longer
/// than a disagreement must last.
#[test]
fn two_channels_of_two_marks_that_miss_some_are_bad_and_stay_so() {
    use CaptureVerdict::{Disagrees, Doubled, Missed};
    for missing in [Missing::Every(5), Missing::Every(4), Missing::Every(3), Missing::Every(2), Missing::Share(0.2)] {
        for seed in 0..SEEDS {
            let told = both_miss(seed, speed_of(seed), missing);
            let longest = told.split(|(_, bad)| *bad < 2).map(<[_]>::len).max().unwrap_or(0);
            assert!(longest >= 5, "{missing:?}, seed {seed}: two bad channels for {longest} samples: {told:?}");
            // of one in four, two whole periods between two long ones look like a mark seen twice
            let name = |verdict: &CaptureVerdict| match missing {
                Missing::Every(4) => matches!(verdict, Missed | Disagrees | Doubled),
                Missing::Every(_) => matches!(verdict, Missed | Disagrees),
                Missing::Share(_) => true, // by chance each pattern comes once
            };
            assert!(told.iter().all(|(hall, _)| name(hall)), "{missing:?}, seed {seed}: {told:?}");
        }
    }
}
