//! Settings of both boards in flash: power cuts at every single operation, wear, damage.

use firmware_ahrs::Settings as ImuSettings;
use firmware_rig::rig_config::Calibrated;
use firmware_rig::{Config, RigConfig};
use frame::calibration::AdcScale;
use frame::message::SettingsNews;
use quadrig_tests::chip::{Chip, PAGE};
use settings_store::{Stored, load, save};
use std::fmt::Debug;

const RANGE: std::ops::Range<u32> = 0..2 * PAGE as u32;

/// Settings that differ by a number.
trait Numbered: Stored + Debug + Clone {
    fn number(n: u16) -> Self;
}

impl Numbered for RigConfig {
    fn number(n: u16) -> Self {
        let mut config = Self { log_period_ms: 10 + n % 900, link_ms: 200 + n % 4000, ..Self::of(&Config::thesis_570kv()) };
        // the calibrations come and go with the numbers: a cut must not mix those of one save with the rest of another
        for channel in 0..usize::from(n % 6) {
            let number = f32::from(n);
            config.calibrated[channel] = Some(Calibrated {
                scale: AdcScale { zero: 1400.0 + number, gain: -0.003 - 1e-6 * number },
                zero_sigma: 1e-3 * number,
                gain_sigma: 1e-9 * number,
                residual: 1e-4 * number,
                worst: 2e-4 * number,
                points: n as u8,
                day: n,
            });
        }
        config
    }
}

impl Numbered for ImuSettings {
    fn number(n: u16) -> Self {
        let mut settings = Self::default();
        settings.calibration.gyro_offset.x = f32::from(n) * 1e-4;
        settings.calibration.mag_matrix.m33 = 1.0 + f32::from(n);
        settings
    }
}

#[test]
fn what_is_saved_is_loaded() {
    saved_and_loaded::<RigConfig>();
    saved_and_loaded::<ImuSettings>();
}

fn saved_and_loaded<T: Numbered>() {
    let mut chip = Chip::erased();
    assert_eq!(load::<T, _>(&mut chip, RANGE), (None, SettingsNews::Absent));
    for n in 0..300 {
        assert_eq!(save(&mut chip, RANGE, &T::number(n)), SettingsNews::Saved, "save {n}");
        assert_eq!(load(&mut chip, RANGE), (Some(T::number(n)), SettingsNews::Loaded));
    }
    let [a, b] = chip.erases;
    println!("300 saves: {a} and {b} erases");
    assert!(a + b < 300 / 5 && a.abs_diff(b) <= 1, "wear is spread: {a} and {b}");
}

/// From every age of the store (page crossings included): cut the power after each operation of one save. What is there after
/// the cut is the old settings or the new ones, and the next save works.
#[test]
fn a_power_cut_at_any_operation_loses_nothing() {
    cut_everywhere::<RigConfig>();
    cut_everywhere::<ImuSettings>();
}

fn cut_everywhere<T: Numbered>() {
    let mut chip = Chip::erased();
    let mut cuts = 0;
    for n in 0..80 {
        let before = chip.clone();
        assert_eq!(save(&mut chip, RANGE, &T::number(n)), SettingsNews::Saved);
        let whole = chip.operations - before.operations;
        for cut in 0..whole {
            let mut broken = Chip { left: Some(cut), ..before.clone() };
            let _ = save(&mut broken, RANGE, &T::number(n));
            broken.left = None; // the power comes back
            let (found, news) = load(&mut broken, RANGE);
            let old = (n > 0).then(|| T::number(n - 1));
            assert!(found == old || found == Some(T::number(n)), "save {n}, cut after {cut} of {whole}: {news:?} {found:?}");
            assert_eq!(save(&mut broken, RANGE, &T::number(n + 500)), SettingsNews::Saved, "save {n}, cut after {cut}");
            assert_eq!(load(&mut broken, RANGE).0, Some(T::number(n + 500)));
            cuts += 1;
        }
    }
    println!("{cuts} power cuts");
    assert!(cuts > 1000);
}

#[test]
fn damage_is_never_taken_for_settings() {
    damaged::<RigConfig>();
    damaged::<ImuSettings>();
}

fn damaged<T: Numbered>() {
    let mut chip = Chip::erased();
    (0..3).for_each(|n| assert_eq!(save(&mut chip, RANGE, &T::number(n)), SettingsNews::Saved));
    let valid: Vec<T> = (0..3).map(T::number).collect();
    for at in 0..2 * PAGE {
        for bit in [0, 5] {
            let mut hurt = chip.clone();
            hurt.cells[at] ^= 1 << bit;
            let (found, _) = load::<T, _>(&mut hurt, RANGE);
            assert!(found.as_ref().is_none_or(|f| valid.contains(f)), "byte {at}: {found:?}");
        }
    }
    let mut garbage = chip.clone();
    garbage.cells.fill(0);
    assert_eq!(load::<T, _>(&mut garbage, RANGE).0, None);
    assert_eq!(save(&mut garbage, RANGE, &T::number(9)), SettingsNews::Saved, "erased once, then written");
}

#[test]
fn a_flash_that_cannot_be_written_is_told() {
    let mut chip = Chip { dead: true, ..Chip::erased() };
    assert_eq!(save(&mut chip, RANGE, &RigConfig::number(1)), SettingsNews::Failed);
}
