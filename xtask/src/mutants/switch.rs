//! The switch of a mutant: the one crate that the copy of the sources has beside the project's own.
//!
//! What it is: `is(n)` says whether mutant `n` is asked for (`MUTANT`), or writes each `n` that is reached into a file (`MUTANTS_REACHED`).
//! It may stand in a `const fn`: what the compiler works out is never broken.
//!
//! What can go wrong: a file that cannot be written; the test then ends.
//!
//! Units: none.
//!
//! Reference: `const_eval_select` of the compiler's own library, which `RUSTC_BOOTSTRAP` opens for this crate alone.
#![feature(core_intrinsics, const_eval_select)]
#![allow(internal_features)]

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

/// Nobody has looked yet which mutant is asked for.
const UNKNOWN: u32 = u32::MAX;
/// None is: what is reached is written down.
const RECORDS: u32 = u32::MAX - 1;
/// More mutants than any package has.
const MOST: usize = 1 << 16;

static ACTIVE: AtomicU32 = AtomicU32::new(UNKNOWN);
static REACHED: [AtomicBool; MOST] = [const { AtomicBool::new(false) }; MOST];
static FILE: OnceLock<File> = OnceLock::new();

/// Whether mutant `n` is asked for.
#[inline(always)]
pub const fn is(n: u32) -> bool {
    core::intrinsics::const_eval_select((n,), never, asked)
}

const fn never(_: u32) -> bool {
    false
}

#[inline(always)]
fn asked(n: u32) -> bool {
    let active = ACTIVE.load(Relaxed);
    active == n || (active >= RECORDS && first(n, active))
}

#[inline(never)]
fn first(n: u32, active: u32) -> bool {
    if active == UNKNOWN {
        let recorded = std::env::var_os("MUTANTS_REACHED");
        let active = std::env::var("MUTANT").ok().and_then(|text| text.parse().ok()).unwrap_or(0);
        if let Some(file) = recorded {
            let file =
                OpenOptions::new().create(true).append(true).open(file).expect("MUTANTS_REACHED: a file that can be written");
            let _ = FILE.set(file);
            ACTIVE.store(RECORDS, Relaxed);
        } else {
            ACTIVE.store(active, Relaxed);
        }
        return asked(n);
    }
    let reached = &REACHED[n as usize];
    if !reached.load(Relaxed)
        && !reached.swap(true, Relaxed)
        && let Some(mut file) = FILE.get()
    {
        file.write_all(format!("{n}\n").as_bytes()).expect("MUTANTS_REACHED: a file that can be written");
    }
    false
}
