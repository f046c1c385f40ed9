//! A seed becomes a vehicle, its instruments, what is hidden, and two flights.
//!
//! What it is: everything about a trial but the tool's answer; the effect is made as large as was drawn.
//! What can go wrong: what cannot be flown, or not be made large enough, is drawn again.
//! Units: sizes in noise floors.
//! Reference: specification `closing-the-loop.md`, "Blind trials".

use super::cause::{Cause, LISTED, UNLISTED};
use super::route::Route;
use super::sense::{Instruments, text};
use super::size::sizes;
use super::vehicle::Vehicle;
use super::world::{Track, flown};
use crate::blind::chance::Chance;

/// Seeds from here on are clean flights.
pub const CLEAN: u64 = 1_000_000_000;
/// Smallest and largest size that is drawn.
const SIZES: (f64, f64) = (3.0, 20.0);
/// Attempts at one seed.
const ATTEMPTS: u64 = 60;

/// What kind of trial it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trial {
    /// Nothing is hidden.
    Clean,
    /// A listed effect (a wind with the drag that it acts through).
    One,
    /// Two listed effects.
    Two,
    /// One that the library does not know.
    Unknown,
}

impl Trial {
    /// Of a seed: of every ten seeds of a half, six hide one effect, two hide two, two hide an unknown one.
    #[must_use]
    pub fn of(seed: u64) -> Self {
        match (seed >= CLEAN, seed / 2 % 10) {
            (true, _) => Self::Clean,
            (_, 3 | 8) => Self::Unknown,
            (_, 1 | 6) => Self::Two,
            _ => Self::One,
        }
    }

    /// In a word.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Clean => "clean",
            Self::One => "one",
            Self::Two => "two",
            Self::Unknown => "unknown",
        }
    }
}

/// A trial.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// Its seed.
    pub seed: u64,
    /// Its kind.
    pub trial: Trial,
    /// The vehicle.
    pub vehicle: Vehicle,
    /// Its instruments.
    pub instruments: Instruments,
    /// What is hidden.
    pub causes: Vec<Cause>,
    /// Size of each cause, and the channel that shows it most.
    pub sizes: Vec<(String, f64)>,
    /// The two flights.
    pub tracks: Vec<Track>,
}

impl Scenario {
    /// Of a seed.
    ///
    /// # Panics
    /// When a seed cannot be flown in [`ATTEMPTS`] ways, which no seed has needed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        (0..ATTEMPTS).find_map(|attempt| Self::attempt(seed, attempt)).expect("a seed that can be flown")
    }

    fn attempt(seed: u64, attempt: u64) -> Option<Self> {
        let mut k = Chance::new(seed, 100 + attempt);
        let trial = Trial::of(seed);
        let vehicle = Vehicle::draw(&mut k);
        let routes = [Route::draw(vehicle.arm, &mut k), Route::draw(vehicle.arm, &mut k)];
        let seconds = routes[0].seconds();
        let causes: Vec<Cause> = hidden(seed).into_iter().map(|id| Cause::draw(id, &vehicle, seconds, &mut k)).collect();
        let instruments = Instruments::draw(&causes, &mut k);
        let mut out = Self { seed, trial, vehicle, instruments, causes, sizes: Vec::new(), tracks: Vec::new() };
        for which in 0..out.causes.len() {
            let wanted = k.log_between(SIZES.0, SIZES.1);
            out.sized(which, wanted, &routes[0], attempt)?;
        }
        for (n, route) in routes.iter().enumerate() {
            // what set in during the first flight is there from the beginning of the second
            let causes = out.causes_of(n);
            out.tracks.push(flown(&out.vehicle, route, &causes, seed, 1000 + 10 * attempt + n as u64)?);
        }
        Some(out)
    }

    /// What is hidden in a flight.
    #[must_use]
    pub fn causes_of(&self, flight: usize) -> Vec<Cause> {
        let later = |c: &Cause| Cause { t0: if flight > 0 { -1.0 } else { c.t0 }, ..c.clone() };
        self.causes.iter().filter(|c| flight == 0 || !is_of_the_day(c)).map(later).collect()
    }

    /// Gives one cause the wanted size, by itself (a wind with its drag).
    fn sized(&mut self, which: usize, wanted: f64, route: &Route, attempt: u64) -> Option<()> {
        let first = self.causes[which].clone();
        let alone = |c: &Cause, all: &[Cause]| -> Vec<Cause> {
            let through = all.iter().filter(|o| first.id == "wind" && o.id != "wind");
            std::iter::once(c.clone()).chain(through.cloned()).collect()
        };
        let mut now = first.clone();
        for _ in 0..4 {
            let causes = alone(&now, &self.causes);
            let track = flown(&self.vehicle, route, &causes, self.seed, 1000 + 10 * attempt)?;
            let all = sizes(&self.vehicle, &causes, &self.instruments, &track);
            let (channel, size) = all.first()?.clone();
            let good = (wanted / size - 1.0).abs() < 0.15 || (now.has_its_size() && size >= SIZES.0);
            if good || now.has_its_size() {
                self.sizes.push((channel, size));
                self.causes[which] = now;
                return good.then_some(());
            }
            now.strength *= (wanted / size).clamp(0.1, 10.0);
            let changed = now.strength / first.strength;
            if changed > first.room() || changed < 1.0 / 300.0 {
                return None;
            }
        }
        None
    }

    /// Text of a flight log.
    #[must_use]
    pub fn log(&self, flight: usize) -> String {
        let causes = self.causes_of(flight);
        text(&self.vehicle, &causes, &self.instruments, &self.tracks[flight], self.seed, 5000 + flight as u64)
    }

    /// True names, joined; a drag that only a wind brought along counts.
    #[must_use]
    pub fn ids(&self) -> Vec<&'static str> {
        self.causes.iter().map(|c| c.id).collect()
    }
}

/// Whether it was one flight's own: a wind, an offset of the day, a sensor that failed on the way.
fn is_of_the_day(c: &Cause) -> bool {
    matches!(c.id, "wind" | "accelerometer_bias" | "gyro_bias") || c.id == "dead_rotor_speed" && c.t0 >= 0.0
}

/// What a seed hides; a wind brings the drag along that it acts through.
#[must_use]
pub fn hidden(seed: u64) -> Vec<&'static str> {
    let mut k = Chance::new(seed, 99);
    let mut ids: Vec<&'static str> = match Trial::of(seed) {
        Trial::Clean => Vec::new(),
        Trial::One => vec![k.of(&LISTED)],
        Trial::Unknown => vec![k.of(&UNLISTED)],
        Trial::Two => {
            let first = k.of(&LISTED);
            let second =
                std::iter::repeat_with(|| k.of(&LISTED)).take(50).find(|s| *s != first && *s != "wind").unwrap_or("rotor_drag");
            vec![first, second]
        }
    };
    let drag = k.of(&["rotor_drag", "body_drag"]);
    if ids.contains(&"wind") && !ids.contains(&drag) {
        ids.insert(0, drag);
    }
    ids
}
