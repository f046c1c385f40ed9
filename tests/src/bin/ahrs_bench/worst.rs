//! The worst trials: none may get worse, and no other one may become one of them.
//!
//! What it is: the largest total errors of each set, and the check that no trial is more than a tenth beyond its own, or beyond the last
//! of them where it is none of them.
//! What can go wrong: a mean hides a trial that has got lost; this does not.
//! Units: degrees.
//! Reference: `cargo xtask ahrs-bench phones`.

/// A trial and its total error.
type Known = (&'static str, f64);

/// The shared BROAD trials as recorded.
pub(super) const BROAD: &[Known] = &[
    ("27_disturbed_phone_vibration_B", 6.9),
    ("08_undisturbed_fast_rotation_with_breaks_A", 3.3),
    ("31_disturbed_stationary_magnet_D", 3.0),
];
/// The phones, their gyro's bias taken off beforehand.
pub(super) const OWN: &[Known] = &[
    ("Thibaud_Nexus5_Dist_AR", 22.8),
    ("Thibaud_Nexus5_Dist_Texting", 14.2),
    ("Thibaud_iPhone5_Dist_BackPocket", 13.4),
    ("Thibaud_Nexus5_Dist_BackPocket", 11.9),
    ("Thibaud_iPhone5_Dist_AR", 11.7),
];
/// The phones, their bias left in.
pub(super) const RAW: &[Known] = &[
    ("Thibaud_iPhone5_Dist_AR", 36.5),
    ("Thibaud_iPhone5_Dist_Phoning", 19.9),
    ("Thibaud_iPhone5_NoDist_Swinging", 17.6),
    ("Thibaud_Nexus5_Dist_Texting", 16.3),
    ("Thibaud_iPhone5_Dist_BackPocket", 15.8),
];

/// Says so where a trial's total error is more than a tenth beyond that of the worst, or beyond its own as one of them.
pub(super) fn grown(set: &str, worst: &[Known], name: &str, total: f64) -> Option<String> {
    let own = worst.iter().find(|(known, _)| *known == name).or(worst.last()).map_or(0.0, |w| w.1);
    (total > 1.1 * own).then(|| format!("{set}, {name}: total {total:.1}, a tenth more than {own}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_trial_may_become_one_of_the_worst() {
        let known = "Thibaud_Nexus5_Dist_AR";
        assert!(grown("", OWN, known, 24.0).is_none() && grown("", OWN, known, 26.0).is_some());
        assert!(grown("", OWN, "another", 12.0).is_none() && grown("", OWN, "another", 13.0).is_some());
    }
}
