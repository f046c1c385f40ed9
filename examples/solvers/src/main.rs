//! Least squares and separable fits: what the engine uses beside what libraries offer.
//!
//! What it is: the same problems solved in each way, timed in turn in one run, with the figures of `docs/solvers.md`.
//! What can go wrong: times differ from machine to machine; the page gives their ratios.
//! Units: microseconds; seconds for time constants.
//! Reference: Bjorck 1996; Golub & Pereyra 2003; O'Leary & Rust 2013.

mod lag;
mod linear;
mod separable;

fn main() {
    linear::compare();
    separable::compare();
}

/// Median time of `rounds` calls, us, and the last result.
fn timed<T>(rounds: usize, mut call: impl FnMut() -> T) -> (f64, T) {
    let mut times = Vec::with_capacity(rounds);
    let mut last = None;
    for _ in 0..rounds.max(1) {
        let start = std::time::Instant::now();
        last = Some(call());
        times.push(1e6 * start.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    (times[times.len() / 2], last.expect("one call at least"))
}
