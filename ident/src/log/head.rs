//! The head of a log: a comment line for each key and each event.
//!
//! What it is: values as TOML, each on one line.
//! What can go wrong: a text may hold a line's end, however deep in a table it lies; it is escaped.
//! Units: none.
//! Reference: specification `formats.md`, "Rig log"; TOML 1.0.

/// The comment line of a key and its value: one line, whatever the value.
#[must_use]
pub fn meta_line(key: &str, value: &toml::Value) -> String {
    let bare = !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c));
    let key = if bare { key.to_owned() } else { basic(key) };
    let said = value.to_string();
    // the file would end the comment at a line's end
    format!("# {key} = {}", if said.contains(['\n', '\r']) { on_one_line(value) } else { said })
}

/// A value in which every line's end is escaped, however deep it lies.
fn on_one_line(value: &toml::Value) -> String {
    match value {
        toml::Value::String(text) => basic(text),
        toml::Value::Array(all) => format!("[{}]", all.iter().map(on_one_line).collect::<Vec<_>>().join(", ")),
        toml::Value::Table(table) => {
            let pairs: Vec<String> = table.iter().map(|(k, v)| format!("{} = {}", basic(k), on_one_line(v))).collect();
            format!("{{ {} }}", pairs.join(", "))
        }
        other => other.to_string(),
    }
}

/// A basic string of TOML.
fn basic(text: &str) -> String {
    let escaped = |c: char| match c {
        '\\' => "\\\\".to_owned(),
        '"' => "\\\"".to_owned(),
        '\n' => "\\n".to_owned(),
        '\r' => "\\r".to_owned(),
        '\t' => "\\t".to_owned(),
        c if c.is_control() => format!("\\u{:04X}", u32::from(c)),
        c => c.to_string(),
    };
    format!("\"{}\"", text.chars().map(escaped).collect::<String>())
}

/// The comment line of an event.
#[must_use]
pub fn event_line(text: &str) -> String {
    meta_line("event", &toml::Value::String(text.to_owned()))
}

/// The event that a comment tells, if it tells one.
pub(crate) fn event(comment: &str) -> Option<String> {
    let table = comment.strip_prefix("event").and_then(|_| comment.parse::<toml::Table>().ok())?;
    table.get("event")?.as_str().map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::super::Log;

    /// A text of two lines inside a table of the head, and a key that is no bare one.
    #[test]
    fn a_head_stays_on_its_lines() {
        let text = "# quadrig-log 1\n# source = { \"by hand\" = \"one\\ntwo \\\"three\\\"\", of = [\"a\\r\"] }\n# \"a b\" = 1\nt_s,rpm,thrust_n\n0,1,1\n";
        let log = Log::parse("a.csv", text.as_bytes()).expect("a log");
        let mut written = Vec::new();
        log.write_to(&mut written).expect("memory");
        let again = Log::parse("b.csv", written.as_slice()).expect("what was written");
        assert_eq!(again.meta, log.meta);
        assert_eq!(again.meta.len(), 2);
    }
}
