//! The inputs that fuzzing kept, once each.
//!
//! What it is: every file of `fuzz/seeds/TARGET` through the function of that name.
//! What can go wrong: a panic; the input is named.
//! Units: none.
//! Reference: `fuzz/README.md`.

use quadrig_tests::fuzzed::TARGETS;
use quadrig_tests::{files, root};

#[test]
fn every_kept_input_is_taken_or_refused() {
    for (name, target) in TARGETS {
        let folder = root().join("fuzz/seeds").join(name);
        for file in files(&folder, |_| true) {
            println!("{}", file.display());
            target(&std::fs::read(&file).expect("a seed"));
        }
    }
}
