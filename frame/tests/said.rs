//! What boards and hosts say, in words and in numbers: each of its own kind, and batches that hold what they say.

use esc_pwm::ArmingEvent;
use frame::esc::EscVerdict;
use frame::imu_command::ImuCommand;
use frame::message::{BURST_PART, Beep, BoardId, BurstPart, Command, CrashCause, Message, SettingsNews, Trial};
use frame::schedule::{BATCH, Segment, SegmentBatch, Shape, Steer};
use frame::units::{PulseWidth, Ticks};
use frame::wire::{Decoder, Encoder, MAX_WIRE};
use std::collections::BTreeSet;

fn different(words: &[&str]) -> bool {
    words.iter().all(|words| !words.is_empty()) && words.iter().collect::<BTreeSet<_>>().len() == words.len()
}

#[test]
fn different_things_have_different_words() {
    assert!(different(&[BoardId::Rig, BoardId::Ahrs].map(BoardId::words)));
    let causes = [CrashCause::HardFault, CrashCause::ClockFailed, CrashCause::NonMaskable, CrashCause::Unexpected(-3)];
    assert!(different(&causes.map(CrashCause::words)));
    use SettingsNews::{Absent, Damaged, Failed, Loaded, Saved};
    assert!(different(&[Absent, Loaded, Damaged, Saved, Failed].map(SettingsNews::words)));
    assert!(different(&[EscVerdict::Nominal, EscVerdict::Silent, EscVerdict::Garbled].map(EscVerdict::words)));
    let commands = [
        Command::Ping,
        Command::Identify,
        Command::Arm,
        Command::CalibrateRange { confirm: 0 },
        Command::Beep(Beep::Long),
        Command::RunSchedule,
        Command::SetPulse(PulseWidth::MIN),
        Command::Stop,
        Command::Tare,
        Command::ClearFaults,
        Command::SaveSettings,
        Command::SelfTest { confirm: 0, trial: Trial::Late },
        Command::Imu(ImuCommand::Once),
        Command::ConfigApply { length: 0, crc: 0 },
        Command::ConfigRead { at: 0 },
        Command::Segments(SegmentBatch::question(0)),
        Command::Steer { segment: 0, how: Steer::GoOn },
        Command::Burst { channel: 0 },
    ];
    assert!(different(&commands.map(|command| command.words())));
}

/// A beep that is taken for another arms an ESC that is not ready.
#[test]
fn each_beep_is_its_own_event() {
    for (beep, event) in [
        (Beep::Long, ArmingEvent::Long),
        (Beep::Cells(3), ArmingEvent::Cells),
        (Beep::Ready, ArmingEvent::Ready),
        (Beep::Double, ArmingEvent::Double),
        (Beep::Programming, ArmingEvent::Programming),
        (Beep::NoSignal, ArmingEvent::NoSignal),
        (Beep::SelfTestFailed, ArmingEvent::SelfTestFailed),
    ] {
        assert_eq!(ArmingEvent::from(beep), event);
    }
}

#[test]
fn a_batch_holds_the_first_eight_and_ends_the_schedule_only_with_all() {
    let list: Vec<Segment> =
        (1..=9).map(|n| Segment { pulse: PulseWidth::from_us(1000 + n), length_ms: n, shape: Shape::Hold }).collect();
    for (count, held, last) in [(0, 0, true), (1, 1, true), (BATCH, BATCH, true), (9, BATCH, false)] {
        let batch = SegmentBatch::of(40, &list[..count]);
        assert_eq!((batch.first, batch.last, batch.segments()), (40, last, Some(&list[..held])), "{count} given");
    }
    assert_eq!(SegmentBatch { count: 9, ..SegmentBatch::of(0, &list) }.segments(), None, "it cannot hold nine");
    let question = SegmentBatch::question(17);
    assert_eq!((question.first, question.last, question.segments()), (17, false, Some(&[][..])));
}

/// A part of a burst carries as many conversions as it is said to, and is the longest message that a board sends.
#[test]
fn a_part_of_a_burst_comes_back_whole() {
    let mut codes = [[0; 32]; BURST_PART / 32];
    codes.as_flattened_mut().iter_mut().zip(4000..).for_each(|(code, n)| *code = n);
    assert_eq!(codes.as_flattened().len(), BURST_PART);
    let part = BurstPart { channel: 3, from: Ticks(7), rate_hz: 61_800.0, length: 9600, at: 96, codes };
    let mut out = [0; MAX_WIRE];
    let n = Encoder::default().encode(Ticks(9), &Message::BurstPart(part), &mut out).unwrap();
    let mut decoder = Decoder::default();
    let got = out[..n].iter().find_map(|byte| decoder.push::<Message>(*byte)).unwrap();
    assert_eq!(got.message, Message::BurstPart(part));
    let Message::BurstPart(back) = got.message else { panic!("{got:?}") };
    assert_eq!(back.codes.as_flattened().to_vec(), (4000..4096).collect::<Vec<u16>>());
}

#[test]
fn a_time_is_84_000_ticks_a_millisecond() {
    assert_eq!((Ticks::from_ms(3), Ticks(3 * 84_000 - 1).as_ms(), Ticks(3 * 84_000).as_ms()), (Ticks(252_000), 2, 3));
    assert_eq!(Ticks(126_000_000).as_s(), 1.5);
    assert_eq!((Ticks(9).since(Ticks(4)), Ticks(4).since(Ticks(9))), (Ticks(5), Ticks(0)));
}

/// The counter of 32 bits turns every 51 s; the time goes on.
#[test]
fn the_time_goes_on_over_a_turn_of_the_counter() {
    let before = Ticks((7 << 32) + u64::from(u32::MAX) - 10);
    assert_eq!(before.counted(u32::MAX - 4).0, before.0 + 6);
    assert_eq!(before.counted(5).0, before.0 + 16);
    assert_eq!(before.counted(u32::MAX - 10), before);
    assert_eq!(before.counted(u32::MAX - 11).0, before.0 + u64::from(u32::MAX));
}

#[test]
fn a_version_is_three_numbers() {
    assert_eq!(frame::version::of(["1", "20", "117"]), [1, 20, 117]);
    assert_eq!(frame::version::of(["256", "x", ""]), [255; 3]);
}
