//! `quadrig rig configure`: a board's whole configuration from a file, and back.
//!
//! What it is: the file goes over in parts, is put in force as a whole, and is stored; or what is in force comes back as a file.
//! What can go wrong: a file that is refused changes nothing; a line that fails in between leaves what was in force; a board that cannot
//! store says so.
//! Units: as in the file.
//! Reference: specification `rig.md`, "Partial rigs are normal".

use super::file;
use crate::Failure;
use crate::board::Board;
use crate::kind::refuse_other;
use crate::replace::put;
use firmware_rig::RigConfig;
use frame::message::{Command, Event, Message, SettingsNews};
use std::path::Path;

/// What is in force on the board.
pub(crate) fn in_force(board: &mut Board) -> Result<RigConfig, Failure> {
    let mut form = Vec::new();
    loop {
        let at = form.len() as u16;
        let part = |m: &Message| match m {
            Message::ConfigPart(part) if part.at == at => Some(*part),
            _ => None,
        };
        let part = board.ask(Command::ConfigRead { at }, |_| {}, part)?;
        form.extend_from_slice(&part.bytes);
        let length = usize::from(part.length);
        if form.len() >= length {
            form.truncate(length);
            return RigConfig::from_form(&form).ok_or_else(|| "the board's configuration is none that this program knows; expected a board with the image of the same release: `quadrig flash rig`".into());
        }
    }
}

/// Sends a configuration, puts it in force and stores it.
pub(crate) fn send(board: &mut Board, config: &RigConfig) -> Result<(), Failure> {
    let mut length = 0;
    for part in config.parts() {
        length = part.length;
        board.obey(Command::ConfigPart(part), |_| {})?;
    }
    board.obey(Command::ConfigApply { length, crc: config.digest() }, |_| {})?;
    save(board)
}

/// Stores what is in force.
pub(crate) fn save(board: &mut Board) -> Result<(), Failure> {
    let news = |m: &Message| match m {
        Message::Event(Event::Settings(news @ (SettingsNews::Saved | SettingsNews::Failed))) => Some(*news),
        _ => None,
    };
    match board.ask(Command::SaveSettings, |_| {}, news)? {
        SettingsNews::Saved => Ok(()),
        _ => Err("the board could not store its configuration; it stays in force until the next reset; expected to store: `quadrig rig save` tries again".into()),
    }
}

/// What is expected of a file.
const CONFIGURATION: &str = "a board's configuration, such as examples/rig/thesis.toml, or a file of `quadrig calibrate`: docs/configuration.md lists the keys";

/// Configures the board from a file. A file without `[calibrated]` leaves the board's own scales; one with nothing else changes these alone.
pub(crate) fn from_file(board: &mut Board, path: &Path) -> Result<u32, Failure> {
    refuse_other(path, CONFIGURATION)?;
    if file::is_scales_alone(path) {
        let found = file::scales(path)?;
        let mut config = in_force(board)?;
        config.calibrated.iter_mut().zip(found).for_each(|(to, found)| *to = found.or(*to));
        send(board, &config)?;
        return Ok(config.digest());
    }
    let (mut config, names_scales) = file::read(path)?;
    if !names_scales {
        config.calibrated = in_force(board)?.calibrated;
    }
    send(board, &config)?;
    Ok(config.digest())
}

/// Writes what is in force into a file, or to standard output.
pub(crate) fn to_file(board: &mut Board, path: Option<&Path>) -> Result<(), Failure> {
    let text = file::text(&in_force(board)?);
    match path {
        Some(path) => put(path, &text),
        None => {
            crate::say::text(&text);
            Ok(())
        }
    }
}
