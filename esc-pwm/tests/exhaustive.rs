//! What holds of pulses and frames for every value that there is, not for drawn ones.
//!
//! What it is: each property is stated above its test and looked at for all inputs of the integer arithmetic (`cargo xtask prove`).
//! What can go wrong: a property that fails names the first value at which it does.
//! Units: ns, ticks.
//! Reference: specification `rig.md`, "Pulses"; RM0090 section 18.4; Betaflight, "DSHOT ESC Protocol".

use esc_pwm::dshot::{Frame, Throttle};
use esc_pwm::timer::PulseTimer;
use esc_pwm::units::PulseWidth;

const MHZ: u32 = 1_000_000;

/// Every width of 32 bits becomes a pulse of 1000 to 2000 us, and one that lies there is left alone.
#[test]
fn no_width_leaves_the_range() {
    let wrong = |ns: u32| {
        let pulse = PulseWidth(ns).clamped().0;
        let inside = |ns: u32| (1_000_000..=2_000_000).contains(&ns);
        u32::from(!inside(pulse)) | (u32::from(inside(ns)) * (pulse ^ ns))
    };
    // blocks, which the compiler takes several at a time
    for block in 0..1u32 << 16 {
        let off = (0..1u32 << 16).fold(0, |off, place| off | wrong(block << 16 | place));
        assert_eq!(off, 0, "in block {block}");
    }
}

/// On every clock of whole megahertz up to 400, counters of 16 and of 32 bits: the period is 20 ms exactly, all ticks from minimum to maximum
/// come back from the pulse that they give, and a pulse between is off by half a tick at the most.
#[test]
fn every_tick_of_every_clock_comes_back() {
    for (mhz, bits) in (1..=400).flat_map(|mhz| [(mhz, 16), (mhz, 32)]) {
        let Ok(timer) = PulseTimer::new(mhz * MHZ, bits) else { continue };
        assert_eq!(u64::from(timer.period()) * u64::from(timer.divider()) * 50, u64::from(mhz * MHZ), "{mhz} MHz");
        assert!(bits == 32 || timer.period() <= 1 << 16, "{mhz} MHz");
        let (first, last) = (timer.ticks(PulseWidth::MIN), timer.ticks(PulseWidth::MAX));
        for ticks in first..=last {
            assert_eq!(timer.ticks(timer.pulse(ticks)), ticks, "{ticks} ticks at {mhz} MHz");
        }
        assert!(last < timer.period(), "a pulse ends within its period");
    }
}

/// On the board's timer, for every nanosecond up to 3 ms: never below minimum, never above maximum, never shorter for a longer pulse, and
/// within half a tick of what was asked.
#[test]
fn every_nanosecond_on_the_boards_timer() {
    let timer = PulseTimer::new(84 * MHZ, 16).unwrap();
    let mut before = 3000;
    for ns in 0..=3_000_000 {
        let ticks = timer.ticks(PulseWidth(ns));
        assert!((3000..=6000).contains(&ticks) && ticks >= before && ticks - before <= 1, "{ns} ns gives {ticks} ticks");
        let off = i64::from(timer.pulse(ticks).0) - i64::from(PulseWidth(ns).clamped().0);
        // a tick is 333.3 ns, and the pulse of it is rounded to a whole one
        assert!(off.abs() <= 167, "{ns} ns gives one {off} ns off");
        before = ticks;
    }
}

/// Every pulse of a whole nanosecond means a throttle that is no special command, minimum alone means stop, and a longer one means no less.
#[test]
fn no_pulse_is_a_special_command() {
    let mut before = 0;
    for ns in 0..=3_000_000 {
        let throttle = Throttle::of(PulseWidth(ns)).get();
        assert!(throttle == 0 || (48..=2047).contains(&throttle), "{ns} ns gives {throttle}");
        assert_eq!(throttle == 0, ns <= 1_000_000, "{ns} ns gives {throttle}");
        assert!(throttle >= before, "{ns} ns gives {throttle} after {before}");
        before = throttle;
    }
    assert_eq!(before, 2047);
}

/// Every number of 16 bits: a throttle exactly where it is no special command, and then its pulse means it again.
#[test]
fn every_throttle_comes_back_from_its_pulse() {
    for number in 0..=u16::MAX {
        let throttle = Throttle::new(number);
        assert_eq!(throttle.is_some(), number == 0 || (48..=2047).contains(&number), "{number}");
        if let Some(throttle) = throttle {
            assert_eq!(Throttle::of(throttle.pulse()), throttle, "{number}");
            // in parts of a nanosecond: 1999 steps from minimum to maximum, and the lowest is not taken for a stop
            let off = i64::from(throttle.pulse().0 - 1_000_000) * 1999 - i64::from(number.saturating_sub(48)) * 1_000_000;
            assert!(off.abs() <= 1000 || number == 48, "{number} is off by {off}");
        }
    }
}

/// Every word of 16 bits: a frame comes back as the same word, every word that differs from a frame in one bit is none, and there are
/// exactly as many frames as throttles, with and without a request.
#[test]
fn every_word_is_its_frame_or_none() {
    let frames: Vec<u16> = (0..=u16::MAX).filter(|word| Frame::from_word(*word).is_some()).collect();
    assert_eq!(frames.len(), 2 * 2001);
    for word in frames {
        assert_eq!(Frame::from_word(word).map(Frame::word), Some(word), "{word:#06x}");
        let flipped = (0..16).map(|bit| word ^ 1 << bit).find(|other| Frame::from_word(*other).is_some());
        assert_eq!(flipped, None, "one bit from {word:#06x}");
    }
}
