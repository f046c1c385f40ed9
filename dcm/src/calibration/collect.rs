//! Readings that cover the sphere evenly.
//!
//! What it is: keeps a reading only where none lies near it, so that a bounded store covers every direction that was seen; and
//! the share of all directions that a set covers.
//! What can go wrong: a full store takes nothing more: it covers the sphere by then.
//! Units: those of the readings.
//! Reference: 24 equal parts of a cube's surface, four to a face.

use crate::Vec3;
use crate::linear::square;

/// Readings that are kept: 12 bytes each.
const ROOM: usize = 240;
/// Distance of the kept ones, as a share of the field: 12 degrees.
const APART: f32 = 0.21;

/// The store.
#[derive(Debug, Clone, PartialEq)]
pub struct Collector {
    kept: [Vec3; ROOM],
    count: usize,
    apart: f32,
}

impl Collector {
    /// An empty store for readings of about `norm` in length.
    #[must_use]
    pub fn new(norm: f32) -> Self {
        Self { kept: [Vec3::zeros(); ROOM], count: 0, apart: APART * norm }
    }

    /// Takes a reading where it is new; says whether it did.
    pub fn add(&mut self, reading: &Vec3) -> bool {
        let near = self.apart * self.apart;
        let new = reading.iter().all(|c| c.is_finite()) && !self.readings().iter().any(|k| square(&(k - reading)) < near);
        match self.kept.get_mut(self.count) {
            Some(slot) if new => {
                *slot = *reading;
                self.count += 1;
                true
            }
            _ => false,
        }
    }

    /// What was kept.
    #[must_use]
    pub fn readings(&self) -> &[Vec3] {
        self.kept.get(..self.count).unwrap_or(&[])
    }
}

/// Share of all directions from the origin that the vectors cover, in 24 equal parts.
pub fn coverage(vectors: impl Iterator<Item = Vec3>) -> f32 {
    let mut seen = 0u32;
    for v in vectors {
        let a = v.map(f32::abs);
        let axis = if a.x >= a.y && a.x >= a.z {
            0
        } else if a.y >= a.z {
            1
        } else {
            2
        };
        let [x, y, z] = [v.x, v.y, v.z].map(|c| u32::from(c < 0.0));
        let (face, b, c) = match axis {
            0 => (x, y, z),
            1 => (2 + y, z, x),
            _ => (4 + z, x, y),
        };
        seen |= 1 << (face * 4 + b * 2 + c);
    }
    seen.count_ones() as f32 / 24.0
}
