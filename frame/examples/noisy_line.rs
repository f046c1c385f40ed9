//! Samples over a line that damages and loses bytes: `cargo run --example noisy_line`.

use frame::wire::{Decoder, Encoder, MAX_WIRE};
use frame::{Message, RigSample, Ticks};

fn main() {
    let mut encoder = Encoder::default();
    let mut line = Vec::new();
    for n in 0..10 {
        let sample = RigSample { at: Ticks::from_ms(100 * n), ..RigSample::default() };
        let mut wire = [0; MAX_WIRE];
        let length = encoder.encode(sample.at, &Message::Rig(sample), &mut wire).expect("a sample fits");
        line.extend_from_slice(&wire[..length]);
        println!("sample {n} takes {length} bytes on the line");
    }
    let frame = line.len() / 10;
    line[2 * frame + 20] ^= 0x10; // a bit of the third frame turns over
    line.drain(6 * frame + 5..6 * frame + 9); // four bytes of the seventh are lost

    let mut decoder = Decoder::default();
    for byte in line {
        if let Some(received) = decoder.push::<Message>(byte) {
            println!("heard number {} of {} ms", received.sequence, received.at.as_ms());
        }
    }
    let stats = decoder.stats();
    println!("{} good, {} damaged, {} missing", stats.good, stats.damaged, stats.missing);
    assert_eq!((stats.good, stats.damaged, stats.missing), (8, 2, 2));
}
