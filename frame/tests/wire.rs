//! The wire from both ends: what fits, what is counted, and which frame is a new one.

use frame::units::Ticks;
use frame::wire::{Decoder, EncodeError, Encoder, Freshness, LinkStats, MAX_WIRE, Received};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A message of 225 bytes: with header and checksum the longest frame.
type Fullest = ([[u8; 32]; 7], u8);
const FULLEST: Fullest = ([[7; 32]; 7], 9);

fn encoded<T: Serialize>(encoder: &mut Encoder, message: &T) -> Vec<u8> {
    let mut out = [0; MAX_WIRE];
    let n = encoder.encode(Ticks(5), message, &mut out).unwrap();
    out[..n].to_vec()
}

fn heard<T: DeserializeOwned>(decoder: &mut Decoder, bytes: &[u8]) -> Vec<Received<T>> {
    bytes.iter().filter_map(|byte| decoder.push(*byte)).collect()
}

#[test]
fn the_longest_message_fits_and_a_longer_one_costs_nothing() {
    let (mut encoder, mut decoder) = (Encoder::default(), Decoder::default());
    let mut out = [0; MAX_WIRE];
    let longer = encoder.encode(Ticks(0), &(FULLEST, 1u8), &mut out);
    assert_eq!(longer, Err(EncodeError::TooLong));
    assert_eq!(EncodeError::TooLong.to_string(), "the message is longer than a frame");
    let got = heard::<Fullest>(&mut decoder, &encoded(&mut encoder, &FULLEST));
    assert_eq!(got, [Received { sequence: 0, at: Ticks(5), message: FULLEST }], "its number was not used up");
}

/// A host sees from the numbers how many frames it lacks, over the turn of the number too.
#[test]
fn a_gap_counts_the_frames_that_never_came() {
    let (mut encoder, mut decoder) = (Encoder::default(), Decoder::default());
    let mut missing = 0;
    for number in 0..=70_000u32 {
        let bytes = encoded(&mut encoder, &number);
        if number % 1000 > 3 || number == 0 {
            assert_eq!(heard::<u32>(&mut decoder, &bytes)[0].message, number);
        } else {
            missing += 1;
        }
    }
    let stats = decoder.stats();
    assert_eq!((stats.good, stats.missing), (70_001 - missing, missing - 1), "the last was never missed by a later one");
}

/// Empty frames bring a line back into step and are no damage; too much without an end is one damaged frame, whatever its length.
#[test]
fn noise_is_counted_once_and_the_next_frame_is_whole() {
    for length in [1, 20, MAX_WIRE - 1, MAX_WIRE, MAX_WIRE + 1, 2 * MAX_WIRE, 1000] {
        let (mut encoder, mut decoder) = (Encoder::default(), Decoder::default());
        assert!(heard::<u32>(&mut decoder, &[0, 0, 0]).is_empty());
        assert_eq!(decoder.stats(), LinkStats::default());
        let mut noise = vec![0x55; length];
        noise.push(0);
        assert!(heard::<u32>(&mut decoder, &noise).is_empty());
        assert_eq!(heard::<u32>(&mut decoder, &encoded(&mut encoder, &77u32))[0].message, 77);
        assert_eq!(decoder.stats(), LinkStats { good: 1, damaged: 1, ..LinkStats::default() }, "{length} bytes");
    }
}

/// Later is new; at the same time only a number that is ahead, by less than half of the numbers.
#[test]
fn a_frame_is_new_once_and_an_old_one_never() {
    let mut freshness = Freshness::default();
    let mut is_new = |at, sequence| freshness.is_new(Ticks(at), sequence);
    assert!(is_new(100, 65_535), "the first");
    assert!(!is_new(100, 65_535), "the same");
    assert!(!is_new(100, 65_534), "the one before");
    assert!(is_new(100, 0), "the number turns");
    assert!(!is_new(99, 1), "an earlier time, whatever the number");
    assert!(!is_new(100, 1 << 15), "half of the numbers ahead may as well be behind");
    assert!(is_new(100, (1 << 15) - 1));
    assert!(is_new(101, 3), "a later time, whatever the number");
    assert!(!is_new(101, 3));
}
