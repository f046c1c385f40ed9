//! Whether runs and models are of one rig, by what their heads say.
//!
//! What it is: motor and propeller as the heads name them, capitals and spaces around apart.
//! What can go wrong: a head that names neither passes; so do two rigs with the same motor and propeller.
//! Units: none.
//! Reference: specification `formats.md`, "Rig log" (`motor`, `propeller`).

use toml::Value;

/// What a file says of its rig.
#[derive(Debug, Clone, Copy)]
pub struct Named<'a> {
    /// The file.
    pub file: &'a str,
    /// The motor.
    pub motor: Option<&'a str>,
    /// The propeller.
    pub propeller: Option<&'a str>,
}

impl<'a> Named<'a> {
    /// By the file's head, key by key.
    pub fn by(file: &'a str, head: impl Fn(&str) -> Option<&'a Value>) -> Self {
        let text = |key: &str| head(key).and_then(Value::as_str).map(str::trim);
        Self { file, motor: text("motor"), propeller: text("propeller") }
    }
}

impl super::Log {
    /// What its head says of its rig.
    #[must_use]
    pub fn names(&self) -> Named<'_> {
        Named::by(&self.name, |key| self.meta.get(key))
    }
}

/// Two heads that name different rigs.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{first} and {second} are of different rigs: {why}")]
pub struct OtherRig {
    /// Who names the rig first.
    pub first: String,
    /// Who names another.
    pub second: String,
    /// What they name.
    pub why: String,
}

/// Refuses files that name different motors or propellers.
///
/// # Errors
/// The first two that differ.
pub fn named_alike<'a>(rigs: impl IntoIterator<Item = Named<'a>>) -> Result<(), OtherRig> {
    let rigs: Vec<Named<'a>> = rigs.into_iter().collect();
    alike("motor", rigs.iter().filter_map(|r| Some((r.file, r.motor?))))?;
    alike("propeller", rigs.iter().filter_map(|r| Some((r.file, r.propeller?))))
}

fn alike<'a>(key: &str, mut named: impl Iterator<Item = (&'a str, &'a str)>) -> Result<(), OtherRig> {
    let Some((first, known)) = named.next() else { return Ok(()) };
    match named.find(|(_, own)| own.to_lowercase() != known.to_lowercase()) {
        Some((second, own)) => {
            Err(OtherRig { first: first.into(), second: second.into(), why: format!("{key} \"{known}\" and \"{own}\"") })
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_motor_is_another_rig() {
        let heads = ["motor = '570KV'", "motor = ' 570kv'\npropeller = '11x4.7'", "motor = '1000KV'", ""];
        let [a, b, c, none] = heads.map(|text| text.parse::<toml::Table>().expect("TOML"));
        let [a, b, c, none] =
            [("a", &a), ("b", &b), ("c", &c), ("d", &none)].map(|(file, head)| Named::by(file, |key| head.get(key)));
        assert_eq!(named_alike([a, b, none]), Ok(()));
        let other = named_alike([a, b, c]).expect_err("another motor");
        assert_eq!(other.to_string(), "a and c are of different rigs: motor \"570KV\" and \"1000KV\"");
    }
}
