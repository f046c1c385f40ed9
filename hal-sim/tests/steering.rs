//! The IMU board in flight, and the controller on its attitude.
//!
//! What it is: attitude error over the missions of the thesis; take-off, hover, square and landing in gusts; a dead rotor, a lost chip.
//! Reference: specification `flight.md`, "Missions".

use hal_sim::flight::attitude::to_euler;
use hal_sim::flight::{Flying, G, Vector};
use hal_sim::mission::{
    AirframeFile, Catalogue, Chips, Flight, ImuSection, Mission, apart, catalogue_plants, fly_again, fly_whole,
};
use hal_sim::plant::air::SEA_LEVEL_DENSITY;
use std::path::{Path, PathBuf};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/flight").join(name)
}

fn load(name: &str) -> (Mission, AirframeFile) {
    Mission::load(&file(name)).unwrap_or_else(|e| panic!("{e}"))
}

fn flown(mission: &Mission, airframe: &AirframeFile) -> Flight {
    let plants = catalogue_plants(airframe);
    fly_whole(mission, airframe, plants, &Catalogue(airframe), SEA_LEVEL_DENSITY, &mut |_| ()).expect("a vehicle")
}

/// Largest and rms error of tilt and heading between two times, deg.
fn errors(flight: &Flight, from_s: f64, to_s: f64) -> [f64; 4] {
    let within = flight.seen.iter().filter(|(s, _)| (from_s..to_s).contains(&s.t_s));
    let off: Vec<(f64, f64)> = within.map(|(s, truth)| apart(&s.attitude.expect("started"), truth)).collect();
    let most = |of: fn(&(f64, f64)) -> f64| off.iter().map(of).fold(0.0, |m: f64, v| m.max(v.abs())).to_degrees();
    let rms =
        |of: fn(&(f64, f64)) -> f64| (off.iter().map(|o| of(o).powi(2)).sum::<f64>() / off.len() as f64).sqrt().to_degrees();
    [most(|o| o.0), rms(|o| o.0), most(|o| o.1), rms(|o| o.1)]
}

/// A board that has been on for two minutes, three seeds: upright flights leave the tilt within half a degree and the heading within that
/// of the calibration; pitching over to 67 degrees in a curved fall, where the specific force is nowhere near the vertical, costs up to 9 deg.
#[test]
fn the_board_over_the_missions_of_the_thesis() {
    for (name, tilt_deg) in [("takeoff", 0.5), ("hover", 0.5), ("excitation", 9.5), ("landing", 0.5)] {
        let (mut mission, airframe) = load(&format!("{name}.toml"));
        for seed in 1..4 {
            mission.seed = seed;
            let flight = flown(&mission, &airframe);
            let [tilt, tilt_rms, heading, heading_rms] = errors(&flight, 0.0, 1e9);
            println!("{name} {seed}: tilt {tilt:.2} (rms {tilt_rms:.2}), heading {heading:.2} (rms {heading_rms:.2}) deg");
            assert!(tilt < tilt_deg && heading < 5.0);
        }
    }
    // with ideal chips and rotors in balance the steady flights leave next to nothing
    let (mut mission, airframe) = load("takeoff.toml");
    mission.imu = Some(ImuSection { chips: Chips::Ideal, imbalance_gmm: 0.0, blade_pass: 0.0, ..ImuSection::default() });
    let [tilt, _, heading, _] = errors(&flown(&mission, &airframe), 0.0, 1e9);
    println!("ideal: {tilt:.3} {heading:.3}");
    assert!(tilt < 0.2 && heading < 0.3);
}

/// The board run once more over the flight that it has made: natively, the same words at the same instants make the same attitude.
#[test]
fn the_board_again_over_its_flight() {
    let (mut mission, airframe) = load("square.toml");
    mission.duration_s = 6.0;
    mission.imu = Some(ImuSection { rest_s: 2.0, ..ImuSection::default() });
    let plants = catalogue_plants(&airframe);
    let (flight, rig) = fly_again(&mission, &airframe, plants, &Catalogue(&airframe), SEA_LEVEL_DENSITY).expect("a vehicle");
    let run = hal_sim::native::ahrs::run(&rig, 8_001).expect("it runs");
    assert_eq!(run.samples.len(), flight.seen.len());
    for (sample, (seen, _)) in run.samples.iter().zip(&flight.seen) {
        let Some(attitude) = seen.attitude else { continue };
        let q = attitude.quaternion();
        let worst =
            sample.quaternion_q30.iter().zip([q.w, q.i, q.j, q.k]).map(|(a, b)| (f64::from(*a) / 2f64.powi(30) - b).abs());
        let worst = worst.fold(0.0, f64::max);
        // the first transfer of a tick begins some microseconds after it, and the straight line goes on from there
        assert!(worst < 2e-3, "{} s: {worst}", seen.t_s);
    }
}

/// A rotor out of balance by twenty times as much is felt.
#[test]
fn vibration_reaches_the_board() {
    let (mut mission, airframe) = load("takeoff.toml");
    let rates = |imbalance_gmm: f64| {
        mission.imu = Some(ImuSection { chips: Chips::Ideal, imbalance_gmm, rest_s: 1.0, ..ImuSection::default() });
        let flight = flown(&mission, &airframe);
        let flying = flight.seen.iter().filter(|(s, _)| s.t_s > 1.0);
        flying.map(|(s, _)| s.rate.z.abs()).fold(0.0, f64::max).to_degrees()
    };
    let [quiet, loud] = [0.0, 20.0].map(rates);
    println!("yaw rate of the gyro {quiet:.2}, {loud:.2} deg/s");
    // 20 g.mm at 4190 rev/min on arms of 0.3 m: m e w l/Iz of one rotor 4.8 deg/s, of four at the most four times that
    assert!(quiet < 0.3 && (2.0..20.0).contains(&loud));
}

/// Angle of the body axis from the vertical, deg.
fn tilt(f: &Flying) -> f64 {
    (f.motion.attitude * Vector::z()).z.clamp(-1.0, 1.0).acos().to_degrees()
}

/// Take-off, a minute of hover in gusts that reach 3 m/s, a square of 5 m, landing.
#[test]
fn the_square() {
    let (mut mission, airframe) = load("square.toml");
    for seed in 1..6 {
        mission.seed = seed;
        let flight = flown(&mission, &airframe);
        let hover: Vec<&Flying> = flight.rows.iter().filter(|f| (8.0..68.0).contains(&f.t_s)).collect();
        let most = |of: &dyn Fn(&Flying) -> f64| hover.iter().map(|f| of(f)).fold(0.0, f64::max);
        let off = most(&|f| (f.motion.place - Vector::new(0.0, 0.0, -2.0)).norm());
        let (leans, wind) = (most(&tilt), most(&|f| f.wind.norm()));
        let turned = most(&|f| to_euler(&f.motion.attitude)[2].to_degrees().abs());
        let [board_tilt, _, board_heading, _] = errors(&flight, 8.0, 68.0);
        println!(
            "seed {seed}: off by {off:.3} m, tilt {leans:.2}, heading {turned:.2} deg in gusts up to {wind:.2} m/s; board off by {board_tilt:.2} and {board_heading:.2} deg; {:?}",
            flight.events
        );
        assert!(off < 0.5 && turned < 2.0 && board_tilt < 2.0 && board_heading < 2.0);
        // the drag of the strongest gust alone asks for this tilt: 2.1 deg at 3 m/s
        let body = airframe.airframe();
        let asked = (0.5 * SEA_LEVEL_DENSITY * body.drag_area_m2 * wind * wind / (body.mass_kg * G)).atan().to_degrees();
        assert!(leans < asked && (wind > 3.0 || leans < 2.0), "{leans} {asked}");
        for (t, north, east) in [(76.0, 5.0, 0.0), (84.0, 5.0, 5.0), (92.0, 0.0, 5.0), (102.0, 0.0, 0.0)] {
            let f = flight.rows.iter().find(|f| f.t_s >= t).expect("flown so long");
            let off = (f.motion.place - Vector::new(north, east, -2.0)).norm();
            assert!(off < 0.5, "{t} s: {off} m");
        }
        let last = flight.rows.last().expect("rows");
        assert!(flight.events.len() == 1 && flight.events[0].1 == "landed, motors off", "{:?}", flight.events);
        let touched = flight.rows.iter().filter(|f| f.t_s > 103.0 && f.motion.place.z > -0.05).map(|f| f.motion.velocity.norm());
        let hardest = touched.fold(0.0, f64::max);
        assert!(last.motion.place.z > -0.01 && last.motion.velocity.z.abs() < 0.05 && hardest < 1.0, "{hardest} m/s");
        assert!(last.rotors.iter().all(|r| r.rpm < 100.0));
    }
}

/// Over ground at 4000 m, where the air has two thirds of its density: as well held, and down at the end.
#[test]
fn the_square_over_high_ground() {
    let text = std::fs::read_to_string(file("square.toml")).expect("the mission");
    let mission = Mission::parse(&format!("{text}\n[air]\nground_altitude_m = 4000\n"), Path::new("m.toml"));
    let flight = flown(&mission.unwrap_or_else(|e| panic!("{e}")), &AirframeFile::default());
    let hover = flight.rows.iter().filter(|f| (8.0..68.0).contains(&f.t_s));
    let off = hover.map(|f| (f.motion.place - Vector::new(0.0, 0.0, -2.0)).norm()).fold(0.0, f64::max);
    println!("off by {off:.3} m; {:?} {:?}", flight.events, flight.touches);
    assert!(off < 0.4, "{off} m");
    assert!(matches!(&flight.events[..], [(_, how)] if how == "landed, motors off"), "{:?}", flight.events);
    assert!(flight.touches.iter().all(|touch| touch.down_m_s < 1.0) && !flight.touches.is_empty(), "{:?}", flight.touches);
    let last = flight.rows.last().expect("rows");
    assert!(last.motion.place.xy().norm() < 5.0, "{:?}", last.motion.place);
}

fn square_with(failure: &str) -> Flight {
    let text = std::fs::read_to_string(file("square.toml")).expect("the mission");
    let mission = Mission::parse(&format!("{text}\n{failure}"), Path::new("m.toml")).unwrap_or_else(|e| panic!("{e}"));
    flown(&mission, &AirframeFile::default())
}

/// A magnetometer that goes ends the way: down where it is, upright, on the ground within seconds. So with the accelerometer. Without the
/// gyro nothing can be held: motors off.
#[test]
fn a_lost_chip_ends_in_a_descent() {
    for chip in ["magnetometer", "accelerometer"] {
        let flight = square_with(&format!("[[failure]]\nchip = \"{chip}\"\nat_s = 30\n"));
        println!("{chip}: {:?}", flight.events);
        let [(began, why), (ended, how)] = &flight.events[..] else { panic!("{:?}", flight.events) };
        assert!(why.contains("controlled descent") && why.contains(chip) && (30.0..30.5).contains(began), "{why} {began}");
        assert!(how == "landed, motors off" && ended - began < 8.0, "{how} {ended}");
        let falling: Vec<&Flying> = flight.rows.iter().filter(|f| (*began..*ended).contains(&f.t_s)).collect();
        let worst = falling.iter().map(|f| tilt(f)).fold(0.0, f64::max);
        let fastest = falling.iter().map(|f| f.motion.velocity.norm()).fold(0.0, f64::max);
        println!("   tilt {worst:.2} deg, {fastest:.2} m/s, {:?}", flight.rows.last().map(|f| f.motion.place));
        assert!(worst < 6.0 && fastest < 1.2);
    }
    let flight = square_with("[[failure]]\nchip = \"gyro\"\nat_s = 30\n");
    println!("gyro: {:?}", flight.events);
    assert!(flight.events.len() == 1 && flight.events[0].1.contains("gyro is lost") && flight.events[0].0 < 30.5);
}

/// Four rotors of which one stands cannot be held: the motors stop before it has fallen far.
#[test]
fn a_dead_rotor_ends_with_the_motors_off() {
    for rotor in 1..=4 {
        let flight = square_with(&format!("[[failure]]\nrotor = {rotor}\nat_s = 30\n"));
        println!("rotor {rotor}: {:?}", flight.events);
        let [(at, why)] = &flight.events[..] else { panic!("{:?}", flight.events) };
        assert!(why.contains("does not follow") && (30.0..31.0).contains(at), "{why} {at}");
        let last = flight.rows.last().expect("rows");
        assert!(
            last.t_s > at + 2.9 && last.rotors.iter().all(|r| r.rpm < 500.0) && last.motion.place.z > -0.5,
            "{:?}",
            last.motion
        );
    }
}

/// The same mission twice gives the same states and words.
#[test]
fn a_steered_flight_repeats() {
    let (mut mission, airframe) = load("square.toml");
    mission.duration_s = 6.0;
    let once = flown(&mission, &airframe);
    assert_eq!(once, flown(&mission, &airframe));
    mission.seed = 2;
    assert_ne!(once, flown(&mission, &airframe));
}

#[test]
fn refusals_name_the_place() {
    for (text, start, word) in [
        ("[imu]\nrest_s = -1\n", "m.toml:2:10: ", "not below 0"),
        ("[imu]\nchips = \"good\"\n", "m.toml:2:9: ", "calibrated"),
        ("[controller]\nway = []\n", "m.toml:2:7: ", "at least one"),
        ("[controller]\nway = [{ at_s = 2, up_m = 1 }, { at_s = 2, up_m = 1 }]\n", "m.toml:2:41: ", "after 2 s"),
        ("[controller]\n[controller.gains]\nrate = 3\n", "m.toml:3:1: ", "rate_p"),
        ("[[failure]]\nrotor = 5\nat_s = 1\n", "m.toml:2:9: ", "from 1 to 4"),
        ("[[failure]]\nchip = \"compass\"\nat_s = 1\n", "m.toml:2:8: ", "magnetometer"),
        ("[[failure]]\nat_s = 1\n", "m.toml:2:8: ", "a rotor or a chip"),
        ("[[failure]]\nrotor = 1\nchip = \"gyro\"\nat_s = 1\n", "m.toml:4:8: ", "a rotor or a chip"),
        ("[[failure]]\nrotor = 1\nat_s = 0\n", "m.toml:3:8: ", "above 0"),
    ] {
        let said = Mission::parse(text, Path::new("m.toml")).expect_err(text).to_string();
        assert!(said.starts_with(start) && said.contains(word), "{text}: {said}");
    }
}
