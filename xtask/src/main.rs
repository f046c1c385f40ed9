//! `cargo xtask`: the workshop.
//!
//! What it is: set-up of a bare machine, the two flash images with their size budgets, and the test command that people and CI
//! run alike.
//!
//! What can go wrong: a tool that cannot be had, a step that fails: one line says which, exit status 1; wrong usage is 2.
//!
//! Units: bytes, seconds.
//!
//! Reference: `budgets/`, `.cargo/image.toml`, `.ci/run`.
#![forbid(unsafe_code)]

mod book;
mod callgraph;
mod changed;
mod emulator;
mod errors;
mod folder;
mod fuzz;
mod hazards;
mod image;
mod mutants;
mod peers;
mod place;
mod programs;
mod release;
mod run;
mod setup;
mod strangers;
mod test;
mod thumb;
mod verdict;

use place::Place;
use std::process::ExitCode;

const USAGE: &str = "\
usage: cargo xtask COMMAND

  setup            Rust target of the boards, Python environment of the verdict checker, mdBook
  hazards [LINE]...  breaks each mend of tests/hazards.toml in a copy and sees its test fail
  hazards --page   writes docs/hazards.md
  mutants [PACKAGE|FILE]...  breaks the code in every small way and sees the tests notice; writes docs/mutants.md (budgets/mutants.toml)
  mutants --again [PACKAGE|FILE]...  only what no test noticed the last time, what was not tried, and what changed since
  mutants --page   writes docs/mutants.md anew from the list and from what came of the last runs
  mutants --changed [COMMIT]  only lines that differ from a commit (main); no page
  fuzz [--minutes N] [TARGET]...  each way in from any bytes, with cargo-fuzz on a nightly compiler (fuzz/README.md)
  book             builds docs/ with mdBook into target/book and checks every link of what comes out
  errors           writes docs/errors.md: every refusal of the command line, from the source
  image            build both flash images, print their sizes, compare with budgets/size.toml; the rig's control loop and
                   interrupts reach no panic, and its stack is bounded (budgets/rig.toml)
  program          the command line with the emulator in it, for --image: target/quadrig-emulated
  image --bless    the same, and make the present sizes (with 2 % headroom) the budget
  ahrs-bench [VARIANT]...  the attitude filter on the shared BROAD trials, their stress variants and the phones' trials, with its targets;
                   each trial of the variants that are named
  ahrs-bench --plots DIR  the error over time in each trial, as a page and figures
  ahrs-bench --scan  what both sets say of each constant of the default (docs/ahrs-constants.md)
  ahrs-bench --ablation  what each mechanism of the filter is worth on both sets (docs/ahrs-ablation.md)
  ahrs-bench --vqf  VQF's Rust port on every variant, those included of which nothing is published (fetches it once)
  ahrs-peers       instructions, flash and RAM of other attitude filters beside ours (fetches them once)
  ahrs-causes [N]  what the inertial tracer names on recorded and on N simulated logs a case (docs/ahrs-causes.md)
  prove            what holds of pulses, clock, queue, stuffing and checksum for every value, not for drawn ones
  release          flash images (ELF and HEX), the command line, the book, notes and digests in target/quadrig-VERSION
  release --twice  the same, built again elsewhere to see that it comes out the same
  strangers        packs the crates that serve other programs, builds examples/stranger on the packages and runs it
  test             everything: format, lints, the book, images, the packed crates, tests, emulated boards, verdicts
  test --quick     format, lints and tests of the host, nothing else
  test --programs  every test program, those of the emulated boards included; no lints, no packing, no verdicts
  campaign         the long forms of what the tests try a part of: healthy and broken runs watched, sizes of causes, demonstrations
  test --lints     format and lints, those of the code behind the emulator included (its crates take 140 s of processor time once)
  blind [ARGS]     the blind campaign (docs/blind.md), on messy rigs with --messy; ARGS go to it, --help lists them
  faults [--runs N] [--page FILE]  the fault campaign on the native board (docs/faults.md)
  test --changed [COMMIT]  tests of what differs from a commit (main) and of all that is built on it, nothing else
  test --emulated  the images on emulated boards, nothing else
  test --verdicts  the verdict contract on recorded and simulated logs, nothing else
";

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let place = Place::find();
    let done = match words.as_slice() {
        ["setup"] => setup::target(&place).and_then(|()| setup::python(&place)).and_then(|_| setup::mdbook(&place).map(|_| ())),
        ["image"] => image::image(&place, false),
        ["hazards", "--page"] => hazards::write_page(&place),
        ["hazards", lines @ ..] => hazards::break_each(&place, lines),
        ["mutants", rest @ ..] => mutants::mutants(&place, rest),
        ["errors"] => errors::write(&place),
        ["fuzz", rest @ ..] => fuzz::fuzz(&place, rest),
        ["book"] => book::book(&place),
        ["program"] => emulator::program(&place),
        ["image", "--bless"] => image::image(&place, true),
        ["prove"] => test::proofs(&place),
        ["release"] => release::release(&place, false),
        ["release", "--twice"] => release::release(&place, true),
        ["strangers"] => strangers::strangers(&place),
        ["test"] => test::everything(&place),
        ["test", "--quick"] => test::quick(&place),
        ["test", "--changed"] => test::changed(&place, "main"),
        ["test", "--changed", base] => test::changed(&place, base),
        ["campaign"] => test::campaign(&place),
        ["test", "--programs"] => test::on_host_and_boards(&place),
        ["test", "--lints"] => test::lints(&place),
        ["blind", rest @ ..] => {
            let head = ["run", "--release", "--package", "quadrig-tests", "--bin", "blind", "--"];
            run::run(&mut run::cargo(&place, &[&head, rest].concat()))
        }
        ["faults", rest @ ..] => {
            let head = ["run", "--release", "--package", "quadrig-tests", "--bin", "faults", "--"];
            run::run(&mut run::cargo(&place, &[&head, rest].concat()))
        }
        ["ahrs-bench", "--vqf"] => peers::vqf(&place),
        ["ahrs-peers"] => peers::peers(&place),
        ["ahrs-bench", rest @ ..] => test::ahrs_bench(&place, &[], rest),
        ["ahrs-causes", rest @ ..] => {
            let head = ["run", "--release", "--package", "quadrig-tests", "--bin", "causes", "--"];
            run::run(&mut run::cargo(&place, &[&head, rest].concat()))
        }
        ["test", "--emulated"] => test::on_boards(&place),
        ["test", "--verdicts"] => test::on_logs(&place),
        ["help" | "--help" | "-h"] => {
            print!("{USAGE}");
            return ExitCode::SUCCESS;
        }
        _ => {
            eprint!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("xtask: {failure}");
            ExitCode::from(1)
        }
    }
}
