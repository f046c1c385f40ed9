//! `quadrig flash`.
//!
//! What it is: builds a flash image, finds a debug probe, flashes and attaches through probe-rs.
//! What can go wrong: probe-rs is not installed, no probe is there, or it hangs; each gives one line, and nothing is flashed.
//! Units: none.
//! Reference: probe-rs; STM32F405RG.

use crate::Failure;
use clap::ValueEnum;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const CHIP: &str = "STM32F405RGTx";
const TARGET: &str = "thumbv7em-none-eabihf";
/// Longest time that listing the probes may take: without USB some drivers never answer.
const LIST_TIME: Duration = Duration::from_secs(15);

/// Which board.
#[derive(Clone, Copy, ValueEnum)]
enum Board {
    /// The motor rig.
    Rig,
    /// The IMU board.
    Ahrs,
}

/// Arguments.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The board.
    board: Board,
    /// Flash this image instead of building one from the source tree.
    #[arg(long)]
    elf: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    args.elf.as_deref().map_or(Ok(()), is_image)?;
    find_probe()?;
    let elf = match &args.elf {
        Some(elf) => elf.clone(),
        None => build(args.board)?,
    };
    is_image(&elf)?;
    let status = Command::new("probe-rs").args(["run", "--chip", CHIP]).arg(&elf).status().map_err(missing)?;
    if status.success() {
        Ok(())
    } else {
        Err(format!("probe-rs ended with {status}; expected it to flash and attach: what it said stands above").into())
    }
}

/// Refuses what is no image, before anything is asked of a probe.
fn is_image(elf: &Path) -> Result<(), Failure> {
    let said = |what: &str| Err(format!("{}: {what}; expected an ELF file: `cargo xtask image` builds it", elf.display()).into());
    if !elf.is_file() {
        return said("no such image");
    }
    let mut head = [0; 4];
    let read = File::open(elf).and_then(|mut file| file.read_exact(&mut head));
    if read.is_ok() && head == *b"\x7fELF" { Ok(()) } else { said("no image of a board") }
}

fn missing(e: std::io::Error) -> String {
    format!("probe-rs cannot be started ({e}); expected it to be installed: `cargo install probe-rs-tools --locked`")
}

/// Asks probe-rs for its probes, with a bound on the time.
fn find_probe() -> Result<(), Failure> {
    let mut child = Command::new("probe-rs").arg("list").stdout(Stdio::piped()).stderr(Stdio::null()).spawn().map_err(missing)?;
    let begun = Instant::now();
    while child.try_wait()?.is_none() {
        if begun.elapsed() > LIST_TIME {
            child.kill()?;
            return Err(
                format!("probe-rs did not list its probes within {} s; unplug and plug the probe", LIST_TIME.as_secs()).into()
            );
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    let listed = String::from_utf8_lossy(&child.wait_with_output()?.stdout).into_owned();
    if listed.contains("[0]") {
        Ok(())
    } else {
        Err("no debug probe was found; expected an ST-Link, J-Link or CMSIS-DAP probe to the board's SWD port".into())
    }
}

/// Builds the image from the source tree that this program was built from.
fn build(board: Board) -> Result<PathBuf, Failure> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().ok_or("no source tree; expected --elf IMAGE")?;
    let package = match board {
        Board::Rig => "firmware-rig",
        Board::Ahrs => "firmware-ahrs",
    };
    let status = Command::new("cargo")
        .current_dir(root)
        .args([
            "build",
            "--release",
            "--package",
            package,
            "--target",
            TARGET,
            "--target-dir",
            "target/fw",
            "--config",
            ".cargo/image.toml",
        ])
        .status()
        .map_err(|e| format!("cargo cannot be started in {} ({e}); expected cargo, or --elf IMAGE", root.display()))?;
    if !status.success() {
        return Err(
            format!("the image was not built ({status}); expected the target to be there: `cargo xtask setup` adds it").into()
        );
    }
    Ok(root.join("target/fw").join(TARGET).join("release").join(package))
}
