//! Settings in the flash of the emulated board: saved by the flash image, there again after a reset, and whole after a supply that fails
//! in the midst of a save.

use frame::message::{Command, Event, Message, Setting, SettingsNews};
use hal_sim::Scenario;
use hal_sim::emulated::Machine;
use hal_sim::emulated::rig::{Action, Heard, Operator, RigRun, rig, rig_on};

/// From one reset to the next, ms; and in it: a new log period is put in force, saved, and the reset comes unless the supply failed.
const CYCLE_MS: u64 = 200;
const CONFIGURE: u64 = 110;
const SAVE: u64 = 120;
const RESET: u64 = 190;

/// In each cycle another log period is saved; the supply fails at the store that the plan says, or the reset key is pressed at the end.
struct Saver {
    plan: Vec<Option<u32>>,
    /// What the board said of its settings, by cycle: at its start, and of the save.
    news: Vec<Vec<SettingsNews>>,
    /// Times of the samples, by cycle, ms.
    samples: Vec<Vec<u64>>,
}

/// Log period that cycle `n` saves, ms: not that of any of the nine before.
fn period(n: usize) -> u16 {
    20 + (n % 10) as u16
}

impl Operator for Saver {
    fn millisecond(&mut self, ms: u64, heard: &[Heard], actions: &mut Vec<Action>) {
        let (cycle, at) = ((ms / CYCLE_MS) as usize, ms % CYCLE_MS);
        self.news.resize(cycle + 1, Vec::new());
        self.samples.resize(cycle + 1, Vec::new());
        for heard in heard {
            match heard {
                Heard::Board(Message::Event(Event::Settings(news))) => self.news[cycle].push(*news),
                // before the new period is put in force: what was loaded
                Heard::Board(Message::Rig(sample)) if at < CONFIGURE => self.samples[cycle].push(sample.at.as_ms()),
                _ => {}
            }
        }
        let Some(fails_at) = self.plan.get(cycle).copied() else { return };
        match at {
            CONFIGURE => actions.push(Action::Send(Command::Configure(Setting::LogPeriodMs(period(cycle))))),
            SAVE => {
                actions.extend(fails_at.map(Action::FailAtStore));
                actions.push(Action::Send(Command::SaveSettings));
            }
            RESET if fails_at.is_none() => actions.push(Action::Reset),
            _ => {}
        }
    }
}

fn save_again_and_again(plan: Vec<Option<u32>>) -> RigRun<Saver> {
    let cycles = plan.len() as u64 + 1;
    let operator = Saver { plan, news: Vec::new(), samples: Vec::new() };
    rig(&Scenario::default(), operator, cycles * CYCLE_MS - 10).unwrap_or_else(|error| panic!("{error}"))
}

/// Spacing of the samples of a cycle, ms.
fn spacing(samples: &[u64]) -> u64 {
    let steps: Vec<u64> = samples.windows(2).map(|w| w[1] - w[0]).collect();
    assert!(!steps.is_empty() && steps.iter().all(|step| *step == steps[0]), "{steps:?}");
    steps[0]
}

/// Whether this emulator keeps what is stored in its flash. `cargo xtask test` builds one that does and says so.
fn can_be_shown() -> bool {
    let keeps = Machine::new().unwrap_or_else(|error| panic!("{error}")).keeps_settings();
    assert!(keeps || std::env::var_os("QUADRIG_EMULATOR_KEEPS_FLASH").is_none(), "this emulator was to keep its flash");
    if !keeps {
        eprintln!("SKIPPED: the emulator as published drops stores to flash; `cargo xtask test` builds one that keeps them");
    }
    keeps
}

#[test]
fn settings_survive_a_reset_and_a_supply_that_fails_in_the_midst_of_a_save() {
    if !can_be_shown() {
        return;
    }
    let whole = save_again_and_again(vec![None; 3]);
    let saved_and_loaded = [SettingsNews::Saved, SettingsNews::Loaded];
    let wanted: Vec<SettingsNews> = std::iter::once(SettingsNews::Absent).chain(saved_and_loaded.repeat(3)).collect();
    assert_eq!(whole.operator.news.concat(), wanted);
    for cycle in 1..4 {
        assert_eq!(
            spacing(&whole.operator.samples[cycle]),
            u64::from(period(cycle - 1)),
            "the saved period is in force after the reset"
        );
    }
    // the first save opens the sector as well
    let stores = (whole.stores - save_again_and_again(vec![None]).stores) / 2;
    println!("{stores} stores a save");
    assert!((4..200).contains(&stores), "{stores}");

    // and now the supply fails at each of them in turn
    let mut plan = vec![None];
    plan.extend((0..stores).map(Some));
    let run = save_again_and_again(plan.clone());
    let news = run.operator.news.concat();
    assert_eq!(news[..2], [SettingsNews::Absent, SettingsNews::Saved]);
    let good = |news: &SettingsNews| matches!(news, SettingsNews::Loaded | SettingsNews::Saved);
    assert!(news[2..].iter().all(good), "never absent, never damaged: {news:?}");
    let mut kept = 20;
    let (mut old, mut new) = (0usize, 0);
    for (cycle, fails_at) in plan.iter().enumerate().skip(1) {
        assert_eq!(spacing(&run.operator.samples[cycle]), kept, "cycle {cycle}");
        let told = run.operator.news[cycle].contains(&SettingsNews::Saved);
        let after = spacing(&run.operator.samples[cycle + 1]);
        let wanted = u64::from(period(cycle));
        assert!(after == kept || after == wanted, "cut at store {fails_at:?}: {after} ms, before {kept}, saved {wanted}");
        assert!(after == wanted || !told, "cut at store {fails_at:?}: told as saved");
        if after == wanted {
            new += 1
        } else {
            old += 1
        }
        kept = after;
    }
    println!("{} cuts: {old} left the old settings, {new} the new ones", old + new);
    assert!(old > stores as usize / 2, "{old} and {new}");
    assert!(run.outcome.accesses.resets.len() > stores as usize / 2, "cuts are resets: {:?}", run.outcome.accesses.resets);
    run.outcome.accesses.only(&[]).unwrap_or_else(|strange| assert!(strange.contains("resets"), "{strange}"));
}

/// What the caches held of an erased sector would be read back in place of what was saved (RM0090 section 3.6.3).
#[test]
fn an_erase_is_followed_by_a_reset_of_the_caches_while_they_are_off() {
    if !can_be_shown() {
        return;
    }
    let machine = Machine::new().unwrap_or_else(|error| panic!("{error}")).with_damaged_settings();
    let operator = Saver { plan: vec![None], news: Vec::new(), samples: Vec::new() };
    let run = rig_on(machine, &Scenario::default(), operator, CYCLE_MS - 20).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(run.operator.news.concat(), [SettingsNews::Damaged, SettingsNews::Saved]);
    println!("{:?}", run.caches);
    assert!(run.caches.erases > 0, "{:?}", run.caches);
    assert!(!run.caches.stale && run.caches.vain == 0, "{:?}", run.caches);
}
