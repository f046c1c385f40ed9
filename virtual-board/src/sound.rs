//! What an ESC sounds like.
//!
//! What it is: each beep pattern as a person hears it, and what the manual says that it means.
//! What can go wrong: nothing.
//! Units: none.
//! Reference: Beharie 2013 Appendix C.

use frame::message::Beep;

/// The pattern as it is heard.
#[must_use]
pub fn heard(beep: Beep) -> String {
    match beep {
        Beep::Long => "beeeeeeep".to_owned(),
        Beep::Cells(cells) => vec!["beep"; usize::from(cells)].join(" "),
        Beep::Ready => "do re mi".to_owned(),
        Beep::Double => "beep-beep".to_owned(),
        Beep::Programming => "tu-tu-tu tu-tu-tu, on and on".to_owned(),
        Beep::NoSignal => "beep ... beep ... beep ..., without end".to_owned(),
        Beep::SelfTestFailed => "twenty short beeps".to_owned(),
    }
}

/// What it means.
#[must_use]
pub fn meaning(beep: Beep) -> String {
    match beep {
        Beep::Long => "one long beep: minimum throttle recognised".to_owned(),
        Beep::Cells(cells) => format!("{cells} short beeps: the battery's cells"),
        Beep::Ready => "1-2-3: ready".to_owned(),
        Beep::Double => "two beeps: maximum throttle stored".to_owned(),
        Beep::Programming => "the special tone: programming mode".to_owned(),
        Beep::NoSignal => "continuous beeping: no signal".to_owned(),
        Beep::SelfTestFailed => "self-test failed".to_owned(),
    }
}
