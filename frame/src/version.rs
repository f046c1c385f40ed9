//! The version of a package as the boards tell it.
//!
//! What it is: the three numbers that cargo gives as text, for [`crate::Hello`].
//! What can go wrong: a part that is no number below 256 is told as 255.
//! Units: none.
//! Reference: The Cargo Book, "Environment variables cargo sets for crates".

/// Major, minor and patch as numbers.
///
/// ```
/// const VERSION: [u8; 3] = frame::version::of(["1", "20", "117"]);
/// assert_eq!(VERSION, [1, 20, 117]);
/// assert_eq!(frame::version::of(["256", "x", ""]), [255; 3]);
/// ```
#[must_use]
pub const fn of(parts: [&str; 3]) -> [u8; 3] {
    let [major, minor, patch] = parts;
    [number(major), number(minor), number(patch)]
}

const fn number(text: &str) -> u8 {
    match u8::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => u8::MAX,
    }
}
