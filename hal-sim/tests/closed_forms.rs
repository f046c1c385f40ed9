//! Plants against closed forms: what they do in time is what the equation says, with nothing fitted. (Steady state and energy of the
//! powerplant stand beside it, in `plant/rig_plant.rs`.)

use hal_sim::plant::beam::BeamMode;
use hal_sim::plant::bridge::BridgeState;
use hal_sim::plant::thermal::ThermalState;
use hal_sim::plant::{Beam, Bridge, Parts, Powerplant, RigPlant, Thermal};
use hal_sim::{PlantState, Scenario};
use std::f64::consts::TAU;

const DT_S: f64 = 1.0e-4;

fn parts() -> Parts {
    Parts { gust: 0.0, ..Scenario::default().parts().plant }
}

fn fly(plant: &mut RigPlant, pulse_us: f64, seconds: f64) -> PlantState {
    (0..(seconds / DT_S) as u32).map(|_| plant.advance(DT_S, pulse_us)).last().expect("steps")
}

/// J w' = -(q w^2 + Q_f) from w_0 takes J / sqrt(q Q_f) atan(w_0 sqrt(q / Q_f)) to rest.
#[test]
fn a_rotor_coasts_to_rest_in_its_time() {
    let p = parts();
    let mut plant = RigPlant::new(p.clone(), 1);
    let w0 = fly(&mut plant, 1700.0, 5.0).rpm * TAU / 60.0;
    let q = p.propeller.torque_coefficient * p.air.density() / p.propeller.reference_density;
    let friction = p.motor.friction_nm();
    let inertia = p.motor.inertia_kgm2 + p.propeller.inertia_kgm2;
    let want = inertia / (q * friction).sqrt() * (w0 * (q / friction).sqrt()).atan();
    let mut steps = 0u32;
    while plant.advance(DT_S, 1000.0).rpm > 0.0 {
        steps += 1;
        assert!(steps < 1_000_000, "it never stops");
    }
    let got = f64::from(steps) * DT_S;
    println!("coasts for {got:.4} s, closed form {want:.4} s");
    assert!((got / want - 1.0).abs() < 1e-3);
}

/// Peaks of a free vibration fall by exp(-2 pi z / sqrt(1 - z^2)) a period, and come every 2 pi / (w sqrt(1 - z^2)).
#[test]
fn a_beam_that_is_let_go_rings_down_by_its_decrement() {
    let beam = Beam { damping_ratio: 0.03, ..Beam::default() };
    let mut mode = BeamMode::new(&beam, DT_S);
    (0..50_000).for_each(|_| {
        mode.step(1.0);
    });
    let swing: Vec<f64> = (0..20_000).map(|_| mode.step(0.0)).collect();
    let peaks: Vec<(usize, f64)> = (1..swing.len() - 1)
        .filter(|i| swing[*i] > swing[i - 1] && swing[*i] >= swing[i + 1] && swing[*i] > 0.01)
        .map(|i| (i, swing[i]))
        .collect();
    let z = beam.damping_ratio;
    let root = (1.0 - z * z).sqrt();
    let periods = (peaks.len() - 1) as f64;
    let (first, last) = (peaks[0], peaks[peaks.len() - 1]);
    let decrement = (first.1 / last.1).ln() / periods;
    let hz = periods / ((last.0 - first.0) as f64 * DT_S);
    println!("{periods} periods, decrement {decrement:.5}, {hz:.3} Hz");
    assert!(periods > 15.0 && (decrement / (TAU * z / root) - 1.0).abs() < 2e-3);
    assert!((hz / (beam.natural_frequency_hz * root) - 1.0).abs() < 2e-3);
}

/// A first-order amplifier passes 1/sqrt(2) of a sine at its corner.
#[test]
fn the_amplifier_has_its_bandwidth() {
    let bridge = Bridge { rise_s: 2.0e-3, fall_s: 2.0e-3, ..Bridge::default() };
    let dt_s = 1.0e-5;
    let corner = 1.0 / bridge.rise_s;
    let mut state = BridgeState::new(bridge, dt_s);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for i in 0..200_000 {
        let v = state.step(0.5 * (corner * dt_s * f64::from(i)).sin(), 0.0, 1.0, bridge.zero_temperature_c);
        if i > 100_000 {
            (low, high) = (low.min(v), high.max(v));
        }
    }
    let passed = 0.5 * (high - low) * bridge.newton_per_volt().abs() / 0.5;
    println!("{passed:.4} of a sine at the corner");
    assert!((passed * 2f64.sqrt() - 1.0).abs() < 5e-3, "{passed}");
}

/// A node that a constant loss warms: T = T_0 + r P (1 - exp(-t/tau)).
#[test]
fn a_warm_rig_approaches_its_end_exponentially() {
    let node = Thermal { rise_k_per_w: 0.5, tau_s: 40.0, ..Thermal::default() };
    let mut state = ThermalState::new(node);
    for ms in 1..=120_000u32 {
        let got = state.step(30.0, 0.0, 1.0e-3);
        if ms % 20_000 == 0 {
            let want = node.ambient_c + 15.0 * (1.0 - (-f64::from(ms) * 1.0e-3 / 40.0).exp());
            assert!((got - want).abs() < 1e-3, "{got} for {want}");
        }
    }
}
