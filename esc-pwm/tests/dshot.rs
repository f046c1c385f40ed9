//! DShot: every pulse, every throttle, every word and every damage of a bit.

use esc_pwm::PulseWidth;
use esc_pwm::dshot::{BITS, EscOutput, FRAME_HZ, Frame, FrameTimer, SLOTS, Slot, Throttle};
use esc_pwm::timer::TimerError;

/// Timer clock of the board.
const CLOCK_HZ: u32 = 84_000_000;

fn throttles() -> impl Iterator<Item = Throttle> {
    (0..=u16::MAX).filter_map(Throttle::new)
}

/// Each pulse of the range in steps of a nanosecond, and a margin on both sides.
#[test]
fn a_longer_pulse_is_never_less_throttle_and_only_minimum_is_none() {
    let mut before = Throttle::STOP;
    for ns in 900_000..=2_100_000 {
        let throttle = Throttle::of(PulseWidth(ns));
        assert!(throttle >= before, "{ns} ns");
        assert!(throttle.get() - before.get() <= 1 || before == Throttle::STOP, "{ns} ns leaves a throttle out");
        assert_eq!(throttle == Throttle::STOP, ns <= 1_000_000, "{ns} ns");
        assert_eq!(Throttle::new(throttle.get()), Some(throttle), "{ns} ns is no special command");
        before = throttle;
    }
    let of = |ns| Throttle::of(PulseWidth(ns)).get();
    assert_eq!([0, 1_000_000, 1_000_001, 1_500_000, 2_000_000, u32::MAX].map(of), [0, 0, 48, 1048, 2047, 2047]);
}

#[test]
fn a_throttle_is_the_throttle_of_its_own_pulse() {
    assert_eq!(throttles().count(), 2001);
    for throttle in throttles() {
        assert_eq!(Throttle::of(throttle.pulse()), throttle);
        assert_eq!(throttle.pulse().is_live(), throttle != Throttle::STOP);
    }
    assert_eq!((Throttle::STOP.pulse(), Throttle::HIGHEST.pulse()), (PulseWidth::MIN, PulseWidth::MAX));
    assert_eq!([1, 47, 2048, u16::MAX].map(Throttle::new), [None; 4], "special commands, and more than 11 bits");
}

/// Betaflight's own example is throttle 1046 without a request; the others by hand.
#[test]
fn known_frames() {
    let word = |number, telemetry| Frame { throttle: Throttle::new(number).expect("a throttle"), telemetry }.word();
    assert_eq!(word(1046, false), 0x82c6);
    assert_eq!(word(1046, true), 0x82d7);
    assert_eq!(word(0, false), 0x0000);
    assert_eq!(word(0, true), 0x0011);
    assert_eq!(word(48, false), 0x0606);
    assert_eq!(word(2047, true), 0xffff);
    assert_eq!(word(2047, false), 0xffee);
    assert_eq!(Frame::STOP.word(), 0);
}

#[test]
fn frames_come_back_and_no_damaged_bit_passes() {
    let mut good = 0;
    for throttle in throttles() {
        for telemetry in [false, true] {
            let frame = Frame { throttle, telemetry };
            assert_eq!(Frame::from_word(frame.word()), Some(frame));
            for bit in 0..BITS {
                assert_eq!(Frame::from_word(frame.word() ^ 1 << bit), None, "{throttle:?}, bit {bit}");
            }
            good += 1;
        }
    }
    let words = (0..=u16::MAX).filter(|word| Frame::from_word(*word).is_some()).count();
    assert_eq!(words, good, "no other word is a frame");
}

#[test]
fn the_boards_bits_are_those_of_the_protocol() {
    let slots = |output: EscOutput| {
        let timer = FrameTimer::new(CLOCK_HZ, output.bit_hz().expect("digital")).expect("it divides");
        (timer.bit(), timer.slot(true).high, timer.slot(false).high, timer.pause().map(|slot| slot.period))
    };
    assert_eq!(slots(EscOutput::DShot300), (280, 210, 105, [65_536, 13_984]));
    assert_eq!(slots(EscOutput::DShot600), (140, 105, 53, [65_536, 16_224]), "0.625 us are 52.5 ticks");
    assert_eq!(EscOutput::Pwm.bit_hz(), None);
    let digital: Vec<EscOutput> = EscOutput::ALL.into_iter().filter(|output| output.is_digital()).collect();
    assert_eq!(digital, [EscOutput::DShot300, EscOutput::DShot600]);
}

/// Every word at both rates: read off the line again, in exactly a millisecond.
#[test]
fn every_word_fills_its_millisecond_and_reads_back() {
    for bit_hz in [300_000, 600_000] {
        let timer = FrameTimer::new(CLOCK_HZ, bit_hz).expect("it divides");
        for word in 0..=u16::MAX {
            let slots: Vec<Slot> = timer.slots(word).collect();
            assert_eq!(slots.len(), SLOTS);
            assert_eq!(slots.iter().map(|slot| slot.period).sum::<u32>(), CLOCK_HZ / FRAME_HZ);
            let (bits, pause) = slots.split_at(BITS);
            // an ESC takes what is high for more than half of a bit for a 1
            let read = bits.iter().fold(0, |word, slot| word << 1 | u16::from(2 * u32::from(slot.high) > slot.period));
            assert_eq!(read, word);
            assert!(bits.iter().all(|slot| slot.reload() == (timer.bit() - 1) as u16 && slot.high > 0));
            assert!(pause.iter().all(|slot| slot.high == 0 && slot.period >= timer.bit()));
        }
    }
}

#[test]
fn impossible_clocks_are_refused() {
    let refused = |clock_hz| Err(TimerError::NoExactPeriod { clock_hz });
    for (clock_hz, bit_hz) in [(84_000_001, 300_000), (0, 300_000), (84_000_000, 0), (84_000_000, 8_000), (300_000_000, 300_000)]
    {
        assert_eq!(FrameTimer::new(clock_hz, bit_hz), refused(clock_hz), "{clock_hz} Hz, {bit_hz} bits a second");
    }
    assert_eq!(FrameTimer::new(8_400_000, 600_000), Err(TimerError::TooCoarse { counter_hz: 8_400_000 }));
    assert!(FrameTimer::new(9_600_000, 600_000).is_ok(), "sixteen ticks a bit");
    assert_eq!(FrameTimer::new(9_600_000, 600_000).map(|timer| timer.pause().map(|slot| slot.period)), Ok([9_328, 16]));
}
