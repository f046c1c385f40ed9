//! A queue of captures between the interrupt and the tick.
//!
//! What it is: one producer, one consumer, a fixed ring of atomics: no lock, no `unsafe`, and no panic path (a length that
//! is a constant power of two needs no division).
//! What can go wrong: a full queue refuses the new capture and says so; with two producers or two consumers, captures would
//! be lost or doubled, but memory stays sound.
//! Units: ticks of the capture timer.
//! Reference: Lamport 1983, single-producer single-consumer ring.

use core::sync::atomic::{AtomicU32, Ordering};

/// Captures that a queue holds: a millisecond of them at 128 kHz.
pub const CAPACITY: usize = 128;

/// The queue.
#[derive(Debug)]
pub struct EdgeQueue {
    slots: [AtomicU32; CAPACITY],
    /// Captures ever put in, modulo 2^32.
    put: AtomicU32,
    /// Captures ever taken out, modulo 2^32.
    taken: AtomicU32,
}

impl Default for EdgeQueue {
    fn default() -> Self {
        Self::new()
    }
}

impl EdgeQueue {
    /// Empty.
    #[must_use]
    pub const fn new() -> Self {
        Self { slots: [const { AtomicU32::new(0) }; CAPACITY], put: AtomicU32::new(0), taken: AtomicU32::new(0) }
    }

    fn slot(&self, count: u32) -> Option<&AtomicU32> {
        self.slots.get(count as usize % CAPACITY)
    }

    /// Puts one capture in; `false` when there is no room.
    #[must_use]
    pub fn put(&self, edge: u32) -> bool {
        let put = self.put.load(Ordering::Relaxed);
        if put.wrapping_sub(self.taken.load(Ordering::Acquire)) as usize >= CAPACITY {
            return false;
        }
        if let Some(slot) = self.slot(put) {
            slot.store(edge, Ordering::Relaxed);
        }
        self.put.store(put.wrapping_add(1), Ordering::Release);
        true
    }

    /// Takes the oldest capture out.
    pub fn take(&self) -> Option<u32> {
        let taken = self.taken.load(Ordering::Relaxed);
        if taken == self.put.load(Ordering::Acquire) {
            return None;
        }
        let edge = self.slot(taken)?.load(Ordering::Relaxed);
        self.taken.store(taken.wrapping_add(1), Ordering::Release);
        Some(edge)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    #[test]
    fn holds_its_capacity_and_refuses_more() {
        let queue = EdgeQueue::new();
        for round in 0..3u32 {
            for i in 0..CAPACITY as u32 {
                assert!(queue.put(round * 1000 + i));
            }
            assert!(!queue.put(9));
            let out: Vec<u32> = core::iter::from_fn(|| queue.take()).collect();
            assert_eq!(out, (round * 1000..round * 1000 + CAPACITY as u32).collect::<Vec<_>>());
        }
    }

    /// From every place of the ring and about the turn of its counters, filled to every level: what was put in comes out in order, the one
    /// too many is refused and harms nothing, and then the queue is empty.
    #[test]
    fn every_fill_from_every_place() {
        let capacity = CAPACITY as u32;
        for begin in (0..capacity).chain(u32::MAX - capacity..=u32::MAX) {
            let queue = EdgeQueue { put: AtomicU32::new(begin), taken: AtomicU32::new(begin), ..EdgeQueue::new() };
            for fill in 0..=capacity {
                assert!((0..fill).all(|i| queue.put(!i)), "{fill} from {begin}");
                assert!(fill < capacity || !queue.put(7), "{fill} from {begin}");
                assert!((0..fill).all(|i| queue.take() == Some(!i)), "{fill} from {begin}");
                assert_eq!(queue.take(), None, "{fill} from {begin}");
            }
        }
    }

    #[test]
    fn order_survives_two_threads() {
        let queue = EdgeQueue::new();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for i in 0..100_000 {
                    while !queue.put(i) {
                        std::thread::yield_now();
                    }
                }
            });
            for i in 0..100_000 {
                let edge = loop {
                    match queue.take() {
                        Some(edge) => break edge,
                        None => std::thread::yield_now(),
                    }
                };
                assert_eq!(edge, i);
            }
        });
    }
}
