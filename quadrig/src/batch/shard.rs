//! Which share of a batch is ours.
//!
//! What it is: the I-th of N shares, from the command line or from the variables that Slurm sets for the tasks of an array.
//! What can go wrong: a share that is none of N; variables of Slurm that are no numbers: refused.
//! Units: none.
//! Reference: slurm.schedmd.com/job_array.html.

use std::fmt;
use std::str::FromStr;

/// A share of a batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shard {
    /// From 0.
    index: usize,
    /// How many there are.
    count: usize,
}

impl Default for Shard {
    fn default() -> Self {
        Self { index: 0, count: 1 }
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wanted = || "expected I/N with I from 1 to N, such as 3/8".to_owned();
        let (i, n) = text.split_once('/').ok_or_else(wanted)?;
        let (i, count): (usize, usize) = (i.trim().parse().map_err(|_| wanted())?, n.trim().parse().map_err(|_| wanted())?);
        if (1..=count).contains(&i) { Ok(Self { index: i - 1, count }) } else { Err(wanted()) }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.count == 1 { Ok(()) } else { write!(f, "share {}/{}: ", self.index + 1, self.count) }
    }
}

impl Shard {
    /// Whether the k-th run is of this share.
    pub(super) fn takes(self, k: usize) -> bool {
        k % self.count == self.index
    }

    /// The share of this task of a Slurm array, where there is one.
    pub(super) fn of_slurm(variable: &dyn Fn(&str) -> Option<String>) -> Result<Option<Self>, String> {
        let Some(id) = variable("SLURM_ARRAY_TASK_ID") else { return Ok(None) };
        let number = |name: &str, text: Option<String>, default: usize| match text {
            Some(text) => text.parse::<usize>().map_err(|_| format!("{name}={text}: expected a number, or --shard I/N")),
            None => Ok(default),
        };
        let id = number("SLURM_ARRAY_TASK_ID", Some(id), 0)?;
        let first = number("SLURM_ARRAY_TASK_MIN", variable("SLURM_ARRAY_TASK_MIN"), 0)?;
        let step = number("SLURM_ARRAY_TASK_STEP", variable("SLURM_ARRAY_TASK_STEP"), 1)?.max(1);
        let last = number("SLURM_ARRAY_TASK_MAX", variable("SLURM_ARRAY_TASK_MAX"), id)?;
        let count = number("SLURM_ARRAY_TASK_COUNT", variable("SLURM_ARRAY_TASK_COUNT"), last.saturating_sub(first) / step + 1)?;
        let index = id.saturating_sub(first) / step;
        // an array with holes (--array=1,5,7) has no share for the runs between
        if id < first || index >= count || last.saturating_sub(first) / step + 1 > count {
            return Err(format!(
                "SLURM_ARRAY_TASK_ID={id} of {count} tasks from {first}: expected an array without holes, or --shard I/N"
            ));
        }
        Ok(Some(Self { index, count }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_told_by_word_and_by_slurm() {
        assert_eq!("3/8".parse(), Ok(Shard { index: 2, count: 8 }));
        for wrong in ["0/3", "4/3", "3", "a/b", "1/0"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
        let of = |set: &[(&str, &str)]| {
            Shard::of_slurm(&|name| {
                set.iter().find(|(n, _)| *n == name.trim_start_matches("SLURM_ARRAY_TASK_")).map(|(_, v)| (*v).to_owned())
            })
        };
        assert_eq!(of(&[]), Ok(None));
        assert_eq!(of(&[("ID", "2"), ("COUNT", "4"), ("MIN", "1"), ("MAX", "4")]), Ok(Some(Shard { index: 1, count: 4 })));
        assert_eq!(of(&[("ID", "20"), ("MIN", "0"), ("MAX", "30"), ("STEP", "10")]), Ok(Some(Shard { index: 2, count: 4 })));
        assert!(of(&[("ID", "7"), ("COUNT", "3"), ("MIN", "1"), ("MAX", "7")]).is_err());
        assert!(of(&[("ID", "x")]).is_err());
        let all: Vec<Shard> = (1..=3).map(|i| format!("{i}/3").parse().unwrap()).collect();
        assert!((0..20).all(|k| all.iter().filter(|s| s.takes(k)).count() == 1));
    }
}
