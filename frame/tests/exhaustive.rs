//! What holds of clock, stuffing and checksum for everything there is, not for drawn cases.
//!
//! What it is: each property is stated above its test and looked at for all cases; where there are too many (patterns of wrong bits), the
//! checksum is linear, and the patterns of a few bits span the rest (`cargo xtask prove`).
//! What can go wrong: a property that fails names the first case in which it does.
//! Units: ticks, bytes, bits.
//! Reference: Cheshire & Baker 1999 (COBS); Koopman & Chakravarty 2004 (Hamming distances of checksums); RM0090 section 18 (TIM2).

use frame::Ticks;
use frame::message::{Command, Message};
use frame::wire::{Decoder, MAX_FRAME, MAX_WIRE, checksum};

/// Whatever a counter of 32 bits reads, at the instant that follows: it reads that, and is less than one turn later; so the time never goes
/// back, and a turn of the counter costs nothing. Every reading, after instants about each end of the counter and far beyond it.
#[test]
fn the_clock_goes_on_over_every_turn() {
    for then in [u64::from(u32::MAX), (77 << 32) + 123] {
        let wrong = |counter: u32| {
            let now = Ticks(then).counted(counter).0;
            (now as u32 ^ counter) | (now.wrapping_sub(then) >> 32) as u32
        };
        // blocks, which the compiler takes several at a time
        for block in 0..1u32 << 16 {
            let off = (0..1u32 << 16).fold(0, |off, place| off | wrong(block << 16 | place));
            assert_eq!(off, 0, "in block {block} after {then} ticks");
        }
    }
}

/// A frame as it is stuffed.
fn stuffed(plain: &[u8]) -> ([u8; MAX_WIRE], usize) {
    let mut wire = [0; MAX_WIRE];
    let n = cobs::try_encode(plain, &mut wire).expect("it fits");
    (wire, n)
}

fn holds(plain: &[u8]) {
    let (wire, n) = stuffed(plain);
    assert!(n < MAX_WIRE && n <= plain.len() + 2, "{} bytes become {n}", plain.len());
    assert!(wire[..n].iter().all(|byte| *byte != 0), "a zero in {plain:?}");
    let mut back = [0; MAX_WIRE];
    let report = cobs::decode(&wire[..n], &mut back).expect("it is well stuffed");
    assert_eq!(&back[..report.frame_size()], plain);
}

/// Stuffing of every length of a frame, with no zero, nothing but zeros, and zeros at every one and every two of its places: it fits the
/// wire with its delimiter, holds no zero, and comes back.
#[test]
fn every_frame_fits_the_wire_and_comes_back() {
    for length in 0..=MAX_FRAME {
        let mut plain = vec![0; length];
        holds(&plain);
        plain.fill(0xA5);
        holds(&plain);
        // of pairs in one frame the longest has the most; a shorter one is told by its ends
        let firsts: Vec<usize> = if length == MAX_FRAME { (0..length).collect() } else { vec![0, length / 2] };
        for first in firsts.into_iter().filter(|first| *first < length) {
            plain[first] = 0;
            for second in 0..length {
                let kept = plain[second];
                plain[second] = 0;
                holds(&plain);
                plain[second] = kept;
            }
            plain[first] = 0xA5;
        }
    }
}

/// No three bytes that a line brings, and no fewer, are a message or upset the decoder: all 16 843 009 of them, each ended by a delimiter.
#[test]
fn no_three_bytes_are_a_message() {
    for code in 0..1u32 << 24 {
        let bytes = code.to_le_bytes();
        let (mut as_host, mut as_board) = (Decoder::default(), Decoder::default());
        for byte in [bytes[0], bytes[1], bytes[2], 0] {
            assert!(as_host.push::<Message>(byte).is_none() && as_board.push::<Command>(byte).is_none(), "{bytes:?}");
        }
        let stats = as_host.stats();
        assert_eq!((stats.good, stats.foreign), (0, 0), "{bytes:?}");
    }
}

/// What each wrong bit of the longest frame does to the checksum, those of the checksum itself included: for every frame the same, since the
/// checksum of an exclusive or is the exclusive or of the checksums, up to a constant.
fn syndromes() -> Vec<u32> {
    let content = MAX_FRAME - 4;
    let right = checksum(&vec![0; content]);
    let of_content = |bit: usize| {
        let mut bytes = vec![0; content];
        bytes[bit / 8] = 1 << (bit % 8);
        checksum(&bytes) ^ right
    };
    (0..8 * content).map(of_content).chain((0..32).map(|bit| 1 << bit)).collect()
}

/// One, two, three and four wrong bits in the longest frame are never a right checksum.
#[test]
fn four_wrong_bits_are_seen() {
    let all = syndromes();
    let mut ones = all.clone();
    ones.sort_unstable();
    assert!(ones.first() != Some(&0) && ones.windows(2).all(|w| w[0] != w[1]), "one or two bits");
    let mut pairs = Vec::with_capacity(all.len() * all.len() / 2);
    for (k, a) in all.iter().enumerate() {
        pairs.extend(all[..k].iter().map(|b| a ^ b));
    }
    assert!(pairs.iter().all(|pair| ones.binary_search(pair).is_err()), "three bits");
    pairs.sort_unstable();
    assert!(pairs.windows(2).all(|w| w[0] != w[1]), "four bits");
}

/// Wrong bits that lie within 32 of one another, however many: no combination of the 32 syndromes there is none, at any place.
#[test]
fn a_burst_of_32_bits_is_seen() {
    let all = syndromes();
    for (place, burst) in all.windows(32).enumerate() {
        let mut basis: Vec<u32> = Vec::new();
        for syndrome in burst {
            let left = basis.iter().fold(*syndrome, |s, b| s.min(s ^ b));
            assert_ne!(left, 0, "bits from {place} on");
            basis.push(left);
            basis.sort_unstable_by(|a, b| b.cmp(a));
        }
    }
}
