//! A rig by itself, step by step and a millisecond at once.

use frame::rig::CAPTURE_CHANNELS;
use hal_sim::{Bench, EdgeDetail, Listens, Millisecond, Scenario};

/// The native run's millisecond at once gives what the emulated board's steps give.
#[test]
fn a_millisecond_at_once_is_its_ten_steps() {
    for effect in
        [None, Some("beam_resonance"), Some("spinup_lag"), Some("clock_drift"), Some("loosening_mount"), Some("encoder_drag")]
    {
        let scenario = Scenario::demo(3, effect).unwrap_or_else(|e| panic!("{e}"));
        let bench = || {
            let mut bench = Bench::new(&scenario, None, EdgeDetail::Captured);
            bench.set_power(true);
            bench
        };
        let (mut fast, mut slow) = (bench(), bench());
        let mut out = Millisecond::default();
        let mut turned = 0;
        for ms in 0..12_000u64 {
            let width = if ms < 5_000 { 1_000_000 } else { 1_700_000 };
            for bench in [&mut fast, &mut slow] {
                bench.listen(Listens { esc: true, back_emf: true });
                if ms == 5_500 {
                    bench.start_run();
                }
                if ms % 20 == 2 {
                    bench.pulse(ms * 1_000_000, width);
                }
            }
            fast.millisecond(&mut out);
            slow.advance_to((ms + 1) * 1_000_000);
            let mut edges: [Vec<u32>; CAPTURE_CHANNELS] = Default::default();
            while let Some(edge) = slow.edge_until(u64::MAX) {
                edges[usize::from(edge.channel)].push(edge.at_ticks as u32);
            }
            assert_eq!(out.edges, edges, "{effect:?} {ms} ms");
            let turns = std::iter::from_fn(|| slow.turn_until(u64::MAX));
            turned += out.back_emf.len();
            assert!(turns.filter(|e| e.rising).map(|e| e.at_ticks as u32).eq(out.back_emf.iter().copied()), "{effect:?} {ms} ms");
            let words: Vec<u16> = std::iter::from_fn(|| slow.esc_word((ms + 1) * 1_000_000)).collect();
            assert_eq!(out.esc, words, "{effect:?} {ms} ms");
            assert_eq!(fast.truth(), slow.truth(), "{effect:?} {ms} ms");
            assert_eq!(fast.voltages(), slow.voltages(), "{effect:?} {ms} ms");
        }
        assert!(fast.truth().plant.rpm > 1000.0);
        assert!(turned > 1000, "{turned} electrical turns");
    }
}
