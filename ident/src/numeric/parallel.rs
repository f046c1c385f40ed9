//! Pieces of work that do not wait for each other, on all cores.
//!
//! What it is: threads that take the next piece (a run, a fit) until none is left; the results in the order of the pieces, the same on any number
//! of cores.
//! What can go wrong: a panic in one of them goes on in the caller: no piece is lost silently.
//! Units: none.
//! Reference: `std::thread::scope`.

use std::sync::atomic::{AtomicUsize, Ordering};

/// Cores that work at once.
pub(crate) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// What a function makes of 0 to `n`, in order, on all cores.
pub(crate) fn in_parallel<T: Send>(n: usize, of: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    let threads = cores().min(n.max(1));
    let next = AtomicUsize::new(0);
    let worker = || {
        let take = || Some(next.fetch_add(1, Ordering::Relaxed)).filter(|i| *i < n);
        std::iter::from_fn(take).map(|i| (i, of(i))).collect::<Vec<(usize, T)>>()
    };
    let mut all: Vec<(usize, T)> = std::thread::scope(|scope| {
        let handles: Vec<_> = (0..threads).map(|_| scope.spawn(worker)).collect();
        let made = handles.into_iter().map(|h| h.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        made.flatten().collect()
    });
    all.sort_by_key(|(i, _)| *i);
    all.into_iter().map(|(_, value)| value).collect()
}

#[cfg(test)]
mod tests {
    use super::in_parallel;

    #[test]
    fn results_stand_in_order() {
        assert_eq!(in_parallel(100, &|i| i * i), (0..100).map(|i| i * i).collect::<Vec<_>>());
        assert!(in_parallel(0, &|i| i).is_empty());
    }

    #[test]
    #[should_panic(expected = "run 3")]
    fn a_panic_is_not_swallowed() {
        in_parallel(8, &|i| assert!(i != 3, "run {i}"));
    }
}
