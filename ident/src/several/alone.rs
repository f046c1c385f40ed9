//! The loop closed on each run alone, on all cores.
//!
//! What it is: the first stage of several runs: each run's own verdict, and with them the candidates.
//! What can go wrong: a run on which no channel can be fitted is refused by name; so is a log that is given twice.
//! Units: as the channels.
//! Reference: specification `closing-the-loop.md`.

use super::Run;
use crate::close::close;
use crate::identify::CloseError;
use crate::log::Log;
use crate::numeric::parallel::in_parallel;
use std::sync::Mutex;

/// Why several runs cannot be fitted together.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunsError {
    /// One of them cannot be closed alone.
    #[error(transparent)]
    Close(#[from] CloseError),
    /// The same log twice: a run cannot vouch for itself.
    #[error("{first} and {second} are the same log; expected different runs of one rig: leave one out")]
    Twice {
        /// Name of the one.
        first: String,
        /// Name of the other.
        second: String,
    },
}

/// Closes the loop on each log alone; `progress` hears the share that is done.
///
/// # Errors
/// [`RunsError`] when a log can be closed by nobody, or stands there twice.
pub fn close_each(logs: Vec<Log>, progress: &(dyn Fn(f64) + Sync)) -> Result<Vec<Run>, RunsError> {
    let digests: Vec<String> = logs.iter().map(Log::digest).collect();
    for (i, own) in digests.iter().enumerate() {
        if let Some(j) = digests[..i].iter().position(|d| d == own) {
            return Err(RunsError::Twice { first: logs[j].name.clone(), second: logs[i].name.clone() });
        }
    }
    let shares = Mutex::new(vec![0.0; logs.len()]);
    let of = |i: usize| {
        let mut told = |share: f64| {
            if let Ok(mut shares) = shares.lock() {
                shares[i] = share;
                progress(shares.iter().sum::<f64>() / shares.len() as f64);
            }
        };
        let closed = close(&logs[i], None, &[], &mut told);
        told(1.0);
        closed
    };
    let closed = in_parallel(logs.len(), &of);
    logs.into_iter().zip(closed).map(|(log, closed)| Ok(Run { log, closed: closed? })).collect()
}
