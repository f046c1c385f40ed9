//! The catalogue gives every figure that the thesis states, within 5 % or with the reason why not.
//!
//! `cargo test --release -p hal-sim --test catalogue -- --nocapture` prints by how much each is missed.

use hal_sim::catalogue::{Figure, Pair, pairs, powerplant_figures};
use hal_sim::plant::{Beam, Bridge};

/// Standard gravity, m/s^2.
const G: f64 = 9.806_65;

/// Prints each figure and demands 5 % of those that are not exempt.
fn check(figures: &[Figure]) {
    for f in figures {
        let mark = f.exempt.map_or(String::new(), |why| format!("  exempt: {why}"));
        println!(
            "{:<42} stated {:>10.6}, ours {:>10.6} {:<8} {:+6.2} %{mark}",
            f.what,
            f.stated,
            f.ours,
            f.unit,
            100.0 * f.off()
        );
    }
    let missed: Vec<_> = figures.iter().filter(|f| f.exempt.is_none() && f.off().abs().total_cmp(&0.05).is_gt()).collect();
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
fn powerplant_figures_of_the_errata() {
    let figures = powerplant_figures();
    check(&figures);
    assert!(figures.len() > 55 && figures.iter().filter(|f| f.exempt.is_some()).count() < 20, "{}", figures.len());
}

#[test]
fn load_cell_figures_of_the_errata() {
    let b = Bridge::default();
    let plain = |what: &str, stated, ours, unit| Figure { what: what.to_owned(), stated, ours, unit, exempt: None };
    let amplifier = |grams: f64| b.zero_v + b.volt_per_newton * grams * 1.0e-3 * G;
    // Table 7's section: stress 6 F L/(b h^2), strain over E, deflection 4 F L^3/(b h^3 E), bridge K eps V_in (full bridge)
    let (width, height, e, length, force, excitation) = (0.020, 0.003, 200.0e9, 0.115, 0.8 * G, 11.5);
    let stress = 6.0 * force * length / (width * height * height);
    let signal = b.volt_per_newton * force / 1000.0;
    let count = 3.3 / 4096.0 / b.divider;
    check(&[
        plain("calibration slope", 231.37, 1000.0 / (b.volt_per_newton * G), "g/V"),
        plain("zero of the amplifier", 2.30, b.zero_v, "V"),
        plain("amplifier at -440 g", 0.40, amplifier(-440.0), "V"),
        plain("amplifier at +244 g", 3.35, amplifier(244.0), "V"),
        plain("resolution of 12 bits", 2.68, b.volt_per_newton * 1.0e-3 * G / count, "counts/g"),
        plain("tare on the beam", 244.0, b.tip_mass_kg * 1000.0, "g"),
        plain("stress at 800 g", 30.0e6, stress, "Pa"),
        plain("strain at 800 g", 150.0e-6, stress / e, "1"),
        plain("bridge at 800 g, K = 2", 3.46e-3, signal, "V"),
        plain("bridge at 800 g, K = 2.1", 3.63e-3, signal * 2.1 / 2.0, "V"),
        plain("bridge from the strain", 3.46e-3, 2.0 * stress / e * excitation, "V"),
        plain("deflection at 800 g", 0.44e-3, 4.0 * force * length.powi(3) / (width * height.powi(3) * e), "m"),
        plain("first mode with 244 g", 41.9, Beam::steel(length, 0.244), "Hz"),
        plain("first mode of the default beam", 41.9, Beam::default().natural_frequency_hz, "Hz"),
        plain("its speed, once a revolution", 2510.0, 60.0 * Beam::default().natural_frequency_hz, "rev/min"),
        plain("its speed, at the blade pass", 1255.0, 30.0 * Beam::default().natural_frequency_hz, "rev/min"),
    ]);
}

/// 36 pairs, and 1200 KV cannot turn 12x4.5.
#[test]
fn thirty_six_pairs_of_which_one_does_not_turn() {
    assert_eq!(pairs().count(), 36);
    let idle: Vec<Pair> = pairs().filter(|p| p.settled(1.0).is_none()).collect();
    assert_eq!(idle, [Pair { motor: "1200KV".to_owned(), propeller: "12x4.5" }]);
    for p in pairs() {
        let Some(full) = p.settled(1.0) else {
            println!("{} {}: no result", p.motor, p.propeller);
            continue;
        };
        println!(
            "{:>7} {:<8} {:>5.0} rev/min {:>5.0} g {:>6.2} A",
            p.motor,
            p.propeller,
            full.rpm,
            full.thrust_n * 1000.0 / G,
            full.current_a
        );
    }
}

/// The slope of 1.36 N/% at hover cannot go with the other figures: let the full throttle thrust, k_T and KV each be 5 % off, let the
/// losses lie in the winding, in the leads or in friction as they like. Wherever hover comes out within 5 %, the slope is 6 % too high.
///
/// Speed over full speed x at throttle u of a motor on 11.5 V: (a x^2 + c)(s + (1 - s) u^2) + b x = u, with b = K w/V the back-EMF's
/// share of the supply at full throttle, a and c those that the air's and the friction's current lose, s of it in the winding.
#[test]
fn the_slope_at_hover_contradicts_the_other_figures() {
    let within = |n: i32| (0..=n).map(move |i| 0.95 + 0.1 * f64::from(i) / f64::from(n));
    let quarters = [0.0, 0.25, 0.5, 0.75, 1.0];
    let u: f64 = (8.36 - 5.0) / 5.0;
    let (mut lowest, mut tried) = (f64::MAX, 0);
    for thrust in within(10).map(|f| 5.779 * f) {
        for speed in within(10).map(|f| (thrust / (1.56e-5 * f)).sqrt()) {
            for b in within(10).map(|f| speed * 60.0 / core::f64::consts::TAU / (570.0 * f) / 11.5).filter(|b| *b < 1.0) {
                for (friction, s) in [0.0, 0.05, 0.1, 0.2].into_iter().flat_map(|c| quarters.map(|s| (c, s))) {
                    let (a, c) = ((1.0 - b) * (1.0 - friction), (1.0 - b) * friction);
                    let seen = s + (1.0 - s) * u * u;
                    let x = ((b * b - 4.0 * a * seen * (c * seen - u)).sqrt() - b) / (2.0 * a * seen);
                    let (hover, rpm) = (thrust * x * x, x * speed * 60.0 / core::f64::consts::TAU);
                    if (hover / 2.879 - 1.0).abs() > 0.05 || (rpm / 4100.0 - 1.0).abs() > 0.05 {
                        continue;
                    }
                    tried += 1;
                    let rise = (1.0 - 2.0 * u * (1.0 - s) * (a * x * x + c)) / (b + 2.0 * a * seen * x);
                    lowest = lowest.min(0.2 * thrust * 2.0 * x * rise);
                }
            }
        }
    }
    println!("lowest slope of {tried} motors: {lowest:.4} N/%, {:+.1} % from 1.36", 100.0 * (lowest / 1.36 - 1.0));
    assert!(tried > 1000 && lowest / 1.36 > 1.05, "{tried} {lowest}");
    let ours = powerplant_figures().into_iter().find(|f| f.what == "dT/dduty at hover").expect("the figure");
    assert!(ours.exempt.is_some_and(|why| why.contains("1.444")) && (lowest - 1.444).abs() < 0.001, "{lowest}");
}
