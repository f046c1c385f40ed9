//! The flash images and their size budgets.
//!
//! What it is: builds both images with `.cargo/image.toml` and reads from the ELF files what they take of the chip.
//!
//! What can go wrong: an image that outgrows `budgets/size.toml`; make it smaller, or move the budget by a visible diff with
//! `cargo xtask image --bless`.
//!
//! Units: bytes.
//!
//! Reference: STM32F405RG, RM0090 section 2.3: 1 MiB flash, 128 KiB SRAM, 64 KiB core-coupled RAM; `memory.x`.

use crate::callgraph;
use crate::place::{BOARD, Place};
use crate::run::{Failure, cargo, run};
use object::elf::SHF_ALLOC;
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind};
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

/// The packages whose binaries are flash images.
pub(crate) const PACKAGES: [&str; 2] = ["firmware-rig", "firmware-ahrs"];
const BUDGETS: &str = "budgets/size.toml";
const RIG_BUDGET: &str = "budgets/rig.toml";
/// 128 KiB SRAM, and 64 KiB core-coupled RAM. RM0090 section 2.3.1.
const SRAM: std::ops::Range<u64> = 0x2000_0000..0x2002_0000;
const CORE_COUPLED: std::ops::Range<u64> = 0x1000_0000..0x1001_0000;
/// Flash of the STM32F405RG. RM0090 section 3.4.
const FLASH_BYTES: u64 = 1024 * 1024;
/// SRAM that static data and stack share. RM0090 section 2.3.1.
const SRAM_BYTES: u64 = 128 * 1024;

/// What an image takes of the chip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Size {
    /// Code, constants and initial values.
    pub(crate) flash: u64,
    /// Static data in SRAM, initialised or not, and buffers that are never initialised.
    pub(crate) ram: u64,
    /// The same in the core-coupled RAM.
    pub(crate) ccm: u64,
}

/// Builds, measures, and compares or blesses.
pub(crate) fn image(place: &Place, bless: bool) -> Result<(), Failure> {
    build(place)?;
    let mut sizes = Vec::new();
    for package in PACKAGES {
        sizes.push((package, measure(&place.images().join(package))?));
    }
    let file = place.root.join(BUDGETS);
    if bless {
        if let Some(folder) = file.parent() {
            std::fs::create_dir_all(folder)?;
        }
        std::fs::write(&file, budget(&sizes))?;
    }
    let text = std::fs::read_to_string(&file)
        .map_err(|error| Failure(format!("{BUDGETS}: {error}; `cargo xtask image --bless` writes it")))?;
    let limits = read_budget(&text)?;
    print!("{}", table(&sizes, &limits));
    compare(&sizes, &limits)?;
    filters(place)?;
    stack(place)?;
    callgraph::quiet(&place.images().join("firmware-rig"), &["TIM4", "TIM2", "TIM1_CC", "USART3"])?;
    callgraph::quiet(&place.images().join("firmware-ahrs"), &["TIM4", "USART1"])
}

/// The rig board's control loop has no way to a panic, and its stack stays within its budget.
fn stack(place: &Place) -> Result<(), Failure> {
    let bound = callgraph::rig(&place.images().join("firmware-rig"))?;
    let text = std::fs::read_to_string(place.root.join(RIG_BUDGET)).map_err(|error| Failure(format!("{RIG_BUDGET}: {error}")))?;
    let table: toml::Table =
        text.parse().map_err(|error: toml::de::Error| Failure(format!("{RIG_BUDGET}: {}", error.message())))?;
    let most = table.get("stack_bytes").and_then(toml::Value::as_integer).and_then(|n| u32::try_from(n).ok());
    let most = most.ok_or_else(|| Failure(format!("{RIG_BUDGET}: stack_bytes: expected a number of bytes")))?;
    if bound > most {
        return Err(Failure(format!("firmware-rig: its stack can reach {bound} bytes, the budget is {most} ({RIG_BUDGET})")));
    }
    Ok(())
}

/// Flash of the attitude filters over the same image without one, against `budgets/ahrs.toml`; their stack, and that no way through
/// them leads to a panic.
fn filters(place: &Place) -> Result<(), Failure> {
    const FILE: &str = "budgets/ahrs.toml";
    let text = std::fs::read_to_string(place.root.join(FILE)).map_err(|error| Failure(format!("{FILE}: {error}")))?;
    let limits: toml::Table = text.parse().map_err(|error: toml::de::Error| Failure(format!("{FILE}: {}", error.message())))?;
    let empty = measure(&place.images().join("cost-empty"))?.flash;
    for filter in ["dcm", "classic"] {
        let image = place.images().join(format!("cost-{filter}"));
        let flash = measure(&image)?.flash - empty;
        let limit = limits.get(filter).and_then(|t| t.get("flash")).and_then(toml::Value::as_integer).unwrap_or(0) as u64;
        // the image does nothing but run the filter: what its main reaches is the filter, in whatever way
        let reach = callgraph::Graph::read(&image)?.reach("main", true)?;
        println!(
            "filter {filter:<8} {flash:>7} bytes of flash over an empty image, budget {limit}; {} functions, {} bytes of stack with its state, no panic",
            reach.functions, reach.stack
        );
        if flash > limit {
            return Err(Failure(format!("filter {filter}: {flash} bytes of flash, the budget is {limit} ({FILE})")));
        }
    }
    Ok(())
}

/// Builds both images.
pub(crate) fn build(place: &Place) -> Result<(), Failure> {
    run(&mut images(place))
}

/// The build command of both images: never in pieces, which come out larger than what is flashed.
pub(crate) fn images(place: &Place) -> Command {
    images_in(place, Path::new("target/fw"))
}

/// The same in another target folder.
pub(crate) fn images_in(place: &Place, target: &Path) -> Command {
    let mut command = cargo(place, &["build", "--config", ".cargo/image.toml", "--release", "--target", BOARD]);
    command.args(PACKAGES.iter().flat_map(|p| ["-p", p])).arg("--target-dir").arg(target).env("CARGO_INCREMENTAL", "0");
    command
}

pub(crate) fn measure(path: &Path) -> Result<Size, Failure> {
    let bytes = std::fs::read(path).map_err(|error| Failure(format!("{}: {error}", path.display())))?;
    let size = size(&bytes).map_err(|error| Failure(format!("{}: {error}", path.display())))?;
    if let Some(end) = stack_end(&bytes).filter(|end| !SRAM.contains(end)) {
        return Err(Failure(format!(
            "{}: the stack ends at {end:#010x}, expected SRAM: what does memory.x put behind .bss?",
            path.display()
        )));
    }
    if size.flash == 0 {
        return Err(Failure(format!("{}: holds nothing for the flash; is it an image of the board?", path.display())));
    }
    Ok(size)
}

/// Where start-up believes the stack to end: it paints from there on, and outside of SRAM it would paint what is no memory.
fn stack_end(bytes: &[u8]) -> Option<u64> {
    let file = object::File::parse(bytes).ok()?;
    file.symbols().find(|symbol| symbol.name() == Ok("_stack_end")).map(|symbol| symbol.address())
}

fn size(bytes: &[u8]) -> Result<Size, object::Error> {
    let file = object::File::parse(bytes)?;
    let mut size = Size { flash: 0, ram: 0, ccm: 0 };
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags, .. } = section.flags() else { continue };
        if !sh_flags.contains(SHF_ALLOC) {
            continue;
        }
        if SRAM.contains(&section.address()) {
            size.ram += section.size();
        } else if CORE_COUPLED.contains(&section.address()) {
            size.ccm += section.size();
        }
        if section.kind() != SectionKind::UninitializedData {
            size.flash += section.size();
        }
    }
    Ok(size)
}

fn budget(sizes: &[(&str, Size)]) -> String {
    let mut text =
        "# Upper limits of the flash images, bytes; `cargo xtask image --bless` writes them from the present sizes plus 2 %.\n"
            .to_owned();
    for (package, size) in sizes {
        let [flash, ram, ccm] = [size.flash, size.ram, size.ccm].map(headroom);
        let _ = write!(text, "\n[{package}]\nflash = {flash}\nram = {ram}\nccm = {ccm}\n");
    }
    text
}

/// Two per cent more, rounded up to 16 bytes.
fn headroom(bytes: u64) -> u64 {
    (bytes * 102).div_ceil(100).next_multiple_of(16)
}

fn read_budget(text: &str) -> Result<Vec<(String, Size)>, Failure> {
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| Failure(format!("{BUDGETS}: {}", error.message())))?;
    let number = |package: &str, key: &str| {
        let value = table.get(package).and_then(|t| t.get(key)).and_then(toml::Value::as_integer);
        value
            .and_then(|v| u64::try_from(v).ok())
            .ok_or_else(|| Failure(format!("{BUDGETS}: [{package}] {key}: expected a number of bytes")))
    };
    let size = |p: &str| -> Result<Size, Failure> {
        Ok(Size { flash: number(p, "flash")?, ram: number(p, "ram")?, ccm: number(p, "ccm")? })
    };
    table.keys().map(|p| Ok((p.clone(), size(p)?))).collect()
}

fn limit(limits: &[(String, Size)], package: &str) -> Option<Size> {
    limits.iter().find(|(p, _)| p == package).map(|(_, s)| *s)
}

fn table(sizes: &[(&str, Size)], limits: &[(String, Size)]) -> String {
    let mut text = format!(
        "{:<14} {:>8} {:>8} {:>6} {:>11} {:>8} {:>11} {:>8} {:>8}\n",
        "image", "flash", "budget", "chip", "static RAM", "budget", "stack room", "CCM", "budget"
    );
    for (package, size) in sizes {
        let most = limit(limits, package).map(|l| [l.flash, l.ram, l.ccm].map(|bytes| bytes.to_string()));
        let [flash, ram, ccm] = most.unwrap_or_else(|| ["none"; 3].map(str::to_owned));
        let share = 100.0 * size.flash as f64 / FLASH_BYTES as f64;
        let room = SRAM_BYTES.saturating_sub(size.ram);
        let _ = writeln!(
            text,
            "{package:<14} {:>8} {flash:>8} {share:>5.1}% {:>11} {ram:>8} {room:>11} {:>8} {ccm:>8}",
            size.flash, size.ram, size.ccm
        );
    }
    text
}

fn compare(sizes: &[(&str, Size)], limits: &[(String, Size)]) -> Result<(), Failure> {
    for (package, size) in sizes {
        let Some(limit) = limit(limits, package) else {
            return Err(Failure(format!("{BUDGETS}: no entry [{package}]; `cargo xtask image --bless` writes it")));
        };
        let kinds =
            [("flash", size.flash, limit.flash), ("static RAM", size.ram, limit.ram), ("core-coupled RAM", size.ccm, limit.ccm)];
        for (what, is, most) in kinds {
            if is > most {
                return Err(Failure(format!("{package}: {is} bytes of {what}, the budget is {most} ({BUDGETS})")));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: [(&str, Size); 2] =
        [("a", Size { flash: 1000, ram: 100, ccm: 40 }), ("b", Size { flash: 2000, ram: 200, ccm: 0 })];

    #[test]
    fn a_blessed_budget_reads_back_with_two_per_cent_of_headroom() {
        let limits = read_budget(&budget(&NOW)).unwrap();
        assert_eq!(limit(&limits, "a"), Some(Size { flash: 1024, ram: 112, ccm: 48 }));
        assert!(compare(&NOW, &limits).is_ok());
    }

    #[test]
    fn growth_beyond_the_budget_is_refused_and_named() {
        let limits = read_budget(&budget(&NOW)).unwrap();
        for (grown, wanted) in [
            (Size { flash: 1025, ram: 100, ccm: 0 }, "a: 1025 bytes of flash"),
            (Size { flash: 1024, ram: 113, ccm: 0 }, "a: 113 bytes of static RAM"),
            (Size { flash: 1024, ram: 112, ccm: 49 }, "a: 49 bytes of core-coupled RAM"),
        ] {
            let failure = compare(&[("a", grown)], &limits).unwrap_err().to_string();
            assert!(failure.contains(wanted), "{failure}");
        }
        assert!(compare(&[("c", NOW[0].1)], &limits).unwrap_err().to_string().contains("no entry [c]"));
    }

    #[test]
    fn a_broken_budget_is_refused() {
        for text in ["[a]\nflash = 1\nram = 1\n", "[a]\nflash = -1\nram = 1\nccm = 0\n", "a = 1\n", "[a\n"] {
            assert!(read_budget(text).is_err(), "{text}");
        }
    }

    /// An ELF file for ARM with one section of each kind, by the ELF specification's field order.
    fn elf() -> Vec<u8> {
        let sections: [(u32, u32, u32, u32); 7] = [
            (0, 0, 0, 0),
            (1, 2 | 4, 0x0800_0000, 300), // code
            (1, 2 | 1, 0x2000_0000, 20),  // initial values: in flash and in RAM
            (8, 2 | 1, 0x2000_0014, 500), // zeroed
            (8, 2 | 1, 0x1000_0000, 64),  // core-coupled
            (1, 0, 0, 9000),              // debug information
            (3, 0, 0, 1),                 // names, all empty
        ];
        let (header, entry) = (52_u32, 40_u32);
        let data = header + entry * sections.len() as u32;
        let mut bytes = vec![0x7F, b'E', b'L', b'F', 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        for half in [2_u16, 40] {
            bytes.extend(half.to_le_bytes());
        }
        for word in [1_u32, 0x0800_0000, 0, header, 0] {
            bytes.extend(word.to_le_bytes());
        }
        for half in [52_u16, 32, 0, 40, sections.len() as u16, sections.len() as u16 - 1] {
            bytes.extend(half.to_le_bytes());
        }
        for (kind, flags, address, size) in sections {
            for word in [0, kind, flags, address, data, size, 0, 0, 4, 0] {
                bytes.extend(word.to_le_bytes());
            }
        }
        bytes.resize(bytes.len() + 9000, 0);
        bytes
    }

    #[test]
    fn sections_are_charged_to_flash_and_ram() {
        assert_eq!(size(&elf()).unwrap(), Size { flash: 320, ram: 520, ccm: 64 });
        assert!(size(b"not an image").is_err());
    }
}
