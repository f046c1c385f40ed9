//! The flying body against closed forms.
//!
//! What it is: free fall, terminal speed, torque-free precession, gyroscopic coupling, energy and angular momentum to the order of the
//! step, loops through the vertical, the ground, and a rotor in flight against the same rotor on the rig.
//! Reference: specification `flight.md`, "The body"; errata 2.12, 2.19-2.20, 2.37.

use hal_sim::flight::attitude::{angle_between, from_euler, to_euler};
use hal_sim::flight::vehicle::Surroundings;
use hal_sim::flight::wind::Blowing;
use hal_sim::flight::{Acting, Airframe, G, Matrix, Motion, RigidBody, Vector, Vehicle};
use hal_sim::plant::air::SEA_LEVEL_DENSITY;
use hal_sim::plant::{PlantBlock, PlantState, Powerplant, RigPlant};
use hal_sim::scenario::{NoiseSection, Scenario};

/// A rotor that gives what it is told.
#[derive(Clone)]
struct Steady(PlantState);

impl Powerplant for Steady {
    fn advance(&mut self, _dt_s: f64, _pulse_us: f64) -> PlantState {
        self.0
    }
}

fn vehicle(airframe: Airframe, rotor: PlantState, start: Motion) -> Vehicle {
    let plants = airframe.rotors.iter().map(|_| Box::new(Steady(rotor)) as Box<dyn Powerplant>).collect();
    let mut made = Vehicle::new(airframe, plants, SEA_LEVEL_DENSITY, Surroundings::default(), start).expect("a body");
    made.spin_up(&[1000.0; 4], 0.002);
    made
}

fn high(up_m: f64) -> Motion {
    Motion { place: Vector::new(0.0, 0.0, -up_m), ..Motion::default() }
}

fn free(body: &RigidBody, from: Motion, step_s: f64, seconds: f64) -> Motion {
    (0..(seconds / step_s).round() as u64).fold(from, |at, _| body.step(&at, step_s, |_, _| Acting::default()))
}

#[test]
fn free_fall() {
    let airframe = Airframe { drag_area_m2: 0.0, ..Airframe::thesis(1e-4) };
    let mut v = vehicle(airframe, PlantState::default(), high(500.0));
    for _ in 0..5_000 {
        v.millisecond(&[]);
    }
    assert!((v.motion().place.z + 500.0 - 0.5 * G * 25.0).abs() < 1e-9, "{}", v.motion().place.z);
    assert!(v.now().specific_force.norm() < 1e-12, "falling, nothing is felt");
}

/// z = vt^2/g ln cosh(g t/vt) with vt = sqrt(2 m g/(rho Cd S)), in air of one density.
#[test]
fn a_fall_through_air_and_its_terminal_speed() {
    let airframe = Airframe::thesis(1e-4);
    let terminal = (2.0 * airframe.mass_kg * G / (SEA_LEVEL_DENSITY * airframe.drag_area_m2)).sqrt();
    let body = airframe.body().unwrap();
    let (k, weight) = (0.5 * SEA_LEVEL_DENSITY * airframe.drag_area_m2, airframe.mass_kg * G);
    let mut m = Motion::default();
    for _ in 0..20_000 {
        m = body.step(&m, 1e-3, |_, at| Acting {
            force: Vector::new(0.0, 0.0, weight) - at.velocity * (k * at.velocity.norm()),
            ..Acting::default()
        });
    }
    let want = terminal * terminal / G * (G * 20.0 / terminal).cosh().ln();
    assert!((m.place.z - want).abs() < 1e-9 * want && (m.velocity.z - terminal).abs() < 1e-6, "{} {want}", m.place.z);
    // and the vehicle: 60 m above sea level the air is that of sea level within 1 %, so the speed within 0.5 %
    let mut v = vehicle(airframe, PlantState::default(), high(200.0));
    for _ in 0..10_000 {
        v.millisecond(&[]);
    }
    assert!((v.motion().velocity.z / terminal - 1.0).abs() < 0.01, "{} {terminal}", v.motion().velocity.z);
}

/// A vehicle that its rotors carry, let go in a steady wind: only the drag of what it is slower than the air moves it, so
/// u = W/(1 + k W t/m) is left of the wind W after t with k = rho Cd S/2. It drifts the way that the wind blows, and as fast in the end.
#[test]
fn a_steady_wind_carries_a_hovering_vehicle_along() {
    let (airframe, blows) = (Airframe::thesis(1e-4), Vector::new(3.0, -4.0, 0.0));
    let rotor = PlantState { rpm: 4000.0, thrust_n: airframe.mass_kg * G / 4.0, ..PlantState::default() };
    let plants = (0..4).map(|_| Box::new(Steady(rotor)) as Box<dyn Powerplant>).collect();
    let around = Surroundings { blowing: Blowing { steady: blows.into(), ..Blowing::default() }, ..Surroundings::default() };
    let pull = 0.5 * around.density(100.0) * airframe.drag_area_m2 / airframe.mass_kg;
    let mut v = Vehicle::new(airframe, plants, SEA_LEVEL_DENSITY, around, high(100.0)).expect("a body");
    v.spin_up(&[1672.0; 4], 0.002);
    let (wind, mut t) = (blows.norm(), 0.0);
    for until in [1.0, 20.0, 600.0] {
        while t < until - 1e-9 {
            v.millisecond(&[1672.0; 4]);
            t = v.t_s();
        }
        let left = 1.0 + pull * wind * t;
        let (speed, way) = (wind - wind / left, wind * t - left.ln() / pull);
        let m = v.motion();
        assert!((m.velocity - blows * (speed / wind)).norm() < 1e-6 * wind, "{t} s: {:?}", m.velocity);
        let there = Vector::new(0.0, 0.0, -100.0) + blows * (way / wind);
        assert!((m.place - there).norm() < 1e-5 * way, "{t} s: {:?} {there:?}", m.place);
    }
    assert!((v.motion().velocity - blows).norm() < 0.01 * wind, "the drift ends as fast as the wind");
}

/// A symmetric top without a moment: its transverse rate turns at (Iz - Ix)/Ix r, and the momentum in space stands still.
#[test]
fn torque_free_precession() {
    let (ix, iz) = (0.0167, 0.0304);
    let body = RigidBody::new(1.0, Matrix::from_diagonal(&Vector::new(ix, ix, iz))).unwrap();
    let from = Motion { attitude: from_euler([0.3, -0.2, 1.0]), rate: Vector::new(1.5, 0.0, 4.0), ..Motion::default() };
    let seconds = 10.0;
    let m = free(&body, from, 1e-3, seconds);
    let turned = (iz - ix) / ix * 4.0 * seconds;
    assert!((m.rate - Vector::new(1.5 * turned.cos(), 1.5 * turned.sin(), 4.0)).norm() < 1e-8, "{:?}", m.rate);
    let (before, after) = (body.angular_momentum(&from, 0.0), body.angular_momentum(&m, 0.0));
    assert!((after - before).norm() < 1e-10, "{before:?} {after:?}");
}

/// Energy, momentum and attitude of an asymmetric tumbling body: half the step, a sixteenth of the error.
#[test]
fn errors_fall_with_the_fourth_power_of_the_step() {
    let inertia = Matrix::new(0.02, 0.001, 0.0, 0.001, 0.05, -0.002, 0.0, -0.002, 0.03);
    let body = RigidBody::new(1.0, inertia).unwrap();
    let from = Motion { rate: Vector::new(6.0, 3.0, -5.0), ..Motion::default() };
    let truth = free(&body, from, 1e-4, 2.0);
    let off = |step_s: f64| {
        let m = free(&body, from, step_s, 2.0);
        let momentum = (body.angular_momentum(&m, 0.0) - body.angular_momentum(&from, 0.0)).norm();
        let energy = (body.kinetic_energy(&m) - body.kinetic_energy(&from)).abs();
        [energy, momentum, angle_between(&m.attitude, &truth.attitude), (m.rate - truth.rate).norm()]
    };
    for (coarse, fine) in off(0.02).iter().zip(off(0.01)) {
        let order = (coarse / fine).log2();
        assert!(order > 3.7, "order {order}: {coarse} {fine}");
    }
    // at the step of a flight
    assert!(off(1e-3).iter().all(|e| *e < 1e-9), "{:?}", off(1e-3));
}

/// A wheel of spin H on a body that no moment acts on: p and q turn at H/I, which the printed signs of 2.19-2.20 turn the other way.
#[test]
fn gyroscopic_coupling() {
    let (i, spin) = (0.0167, 0.02);
    let body = RigidBody::new(1.0, Matrix::from_diagonal_element(i)).unwrap();
    let mut m = Motion { rate: Vector::new(0.1, 0.0, 0.0), ..Motion::default() };
    for _ in 0..1_000 {
        m = body.step(&m, 1e-3, |_, _| Acting { spin, ..Acting::default() });
    }
    let turned: f64 = spin / i;
    assert!((m.rate - Vector::new(0.1 * turned.cos(), 0.1 * turned.sin(), 0.0)).norm() < 1e-10, "{:?}", m.rate);
    let acting = Acting { spin, ..Acting::default() };
    let at_once = body.angular_acceleration(&Vector::new(0.0, 1.0, 0.0), &acting);
    assert!((at_once.x + spin / i).abs() < 1e-12, "M_x = -q H");
}

/// Rotors of one sense stopped: 2 and 4 spin, and a pitching vehicle rolls by their spin.
#[test]
fn the_vehicles_rotors_are_such_wheels() {
    let inertia = 1.0e-4;
    let airframe = Airframe { drag_area_m2: 0.0, ..Airframe::thesis(inertia) };
    let still = PlantState::default();
    let fast = PlantState { rpm: 6000.0, ..still };
    let plants = [still, fast, still, fast].map(|s| Box::new(Steady(s)) as Box<dyn Powerplant>).into();
    let start = Motion { rate: Vector::new(0.0, 0.5, 0.0), ..high(100.0) };
    let mut v = Vehicle::new(airframe.clone(), plants, SEA_LEVEL_DENSITY, Surroundings::default(), start).unwrap();
    v.spin_up(&[1000.0; 4], 0.002);
    let spin = -2.0 * inertia * 6000.0 * core::f64::consts::TAU / 60.0;
    let got = v.now().angular_acceleration.x;
    assert!((got + 0.5 * spin / airframe.inertia_kgm2[0]).abs() < 1e-9 && got > 0.0, "{got}");
}

/// A body that pitches steadily goes through straight up and straight down as through any other attitude.
#[test]
fn loops_have_no_singular_attitude() {
    let body = RigidBody::new(1.0, Matrix::from_diagonal_element(0.02)).unwrap();
    let rate = core::f64::consts::TAU / 4.0;
    let mut m = Motion { rate: Vector::new(0.0, rate, 0.0), attitude: from_euler([0.0, 0.0, 0.5]), ..Motion::default() };
    for ms in 0..12_000u32 {
        m = body.step(&m, 1e-3, |_, _| Acting::default());
        let pitched = from_euler([0.0, 0.0, 0.5]) * from_euler([0.0, rate * f64::from(ms + 1) * 1e-3, 0.0]);
        assert!(angle_between(&m.attitude, &pitched) < 1e-9, "{ms} ms");
    }
    let [roll, pitch, yaw] = to_euler(&m.attitude);
    assert!(roll.abs() < 1e-8 && pitch.abs() < 1e-8 && (yaw - 0.5).abs() < 1e-8);
}

#[test]
fn the_ground_pushes_and_never_pulls() {
    // dropped from 1 m, tilted: it comes to rest level, 2 mm deep
    let start = Motion { attitude: from_euler([0.1, -0.2, 0.0]), ..high(1.0) };
    let mut v = vehicle(Airframe::thesis(1e-4), PlantState::default(), start);
    let mut deepest = 0.0_f64;
    for _ in 0..5_000 {
        v.millisecond(&[]);
        deepest = deepest.max(v.motion().place.z);
    }
    let m = v.motion();
    // without friction a slow turn about the vertical, which the landing on one arm left, goes on
    assert!((m.place.z - 2.0e-3).abs() < 1e-6 && m.velocity.norm() < 1e-6 && m.rate.xy().norm() < 1e-6, "{m:?}");
    assert!(
        v.on_ground() && deepest < 0.1 && angle_between(&m.attitude, &from_euler([0.0, 0.0, to_euler(&m.attitude)[2]])) < 1e-6
    );
    // a lift above the weight takes it off, and nothing holds it back
    let lift = PlantState { rpm: 4000.0, thrust_n: 3.0, ..PlantState::default() };
    let airframe = Airframe { drag_area_m2: 0.0, ..Airframe::thesis(1e-4) };
    let climb = 12.0 / airframe.mass_kg - G;
    let mut v = vehicle(airframe, lift, Motion::default());
    for _ in 0..1_000 {
        v.millisecond(&[]);
    }
    assert!((v.motion().place.z + 0.5 * climb).abs() < 1e-9, "{}", v.motion().place.z);
}

/// The same pulses in flight and on the rig: the same thrust and speed at the height of the rig's air.
#[test]
fn a_rotor_in_flight_is_the_rotor_of_the_rig() {
    let scenario = Scenario { noise: NoiseSection { gust: 0.0, ..NoiseSection::default() }, ..Scenario::default() };
    let plant = || RigPlant::new(scenario.parts().plant, 1);
    let plants = (0..4).map(|_| Box::new(plant()) as Box<dyn Powerplant>).collect();
    let around = Surroundings::default();
    // so heavy that it stays on the ground, 2 mm deep
    let heavy = Airframe { mass_kg: 50.0, ..Airframe::thesis(1e-4) };
    let start = Motion { place: Vector::new(0.0, 0.0, 0.002), ..Motion::default() };
    let density = around.density(-0.002);
    let mut v = Vehicle::new(heavy, plants, density, around, start).unwrap();
    let (mut rig, mut block) = (plant(), PlantBlock::default());
    for ms in 0..2_000u32 {
        let pulse = if ms < 800 { 1672.0 } else { 1500.0 };
        v.millisecond(&[pulse; 4]);
        rig.advance_block(1.0e-4, pulse, &mut block, &mut || ());
        for rotor in &v.now().rotors {
            assert!((rotor.thrust_n - block.last.thrust_n).abs() < 1e-5 * block.last.thrust_n.max(1e-3), "{ms} ms");
            assert!((rotor.rpm - block.last.rpm).abs() < 1e-4 * block.last.rpm.max(1.0), "{ms} ms");
        }
    }
    assert!(block.last.thrust_n > 1.0);
}

/// The density of the flight is that of the height: ISO 2533, and the thrust of a rotor goes with it.
#[test]
fn thrust_thins_with_height() {
    let around = Surroundings { ground_altitude_m: 3000.0, ..Surroundings::default() };
    assert!((around.density(0.0) - 0.909_25).abs() < 2e-4);
    let warm = Surroundings { temperature_offset_k: 15.0, ..Surroundings::default() };
    assert!((warm.density(0.0) / SEA_LEVEL_DENSITY - 288.15 / 303.15).abs() < 1e-4);
}
