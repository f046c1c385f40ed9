//! What a process has cost so far: processor time and memory, from `/proc/self`.

#![allow(dead_code, unreachable_pub)] // each user takes a part of it

/// Largest resident set so far, MB; `None` where the system does not say.
pub fn peak_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1024.0)
}

/// Processor time of all threads so far, user and system, ms (to 10 ms); `None` where the system does not say.
pub fn processor_ms() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // the name in brackets may hold blanks; user and system time are the 12th and 13th field behind it, in hundredths of a second
    let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
    let ticks = |k: usize| fields.get(k)?.parse::<f64>().ok();
    Some(10.0 * (ticks(11)? + ticks(12)?))
}
