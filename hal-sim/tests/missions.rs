//! The example missions against what the thesis states of its own.
//!
//! What it is: 7.4.1 to 7.4.4 of Beharie 2013 flown on the catalogue's powerplants; each figure with the tolerance that is met, and what
//! the catalogue cannot meet because the stated figures contradict each other.
//! Reference: specification `flight.md`, "Missions"; errata, "Climb"; `docs/mission.md`, "Against the thesis".

use hal_sim::ScenarioError;
use hal_sim::flight::attitude::to_euler;
use hal_sim::flight::{Flying, G};
use hal_sim::mission::{
    AirframeFile, Catalogue, Flight, HOVER_US, HoverPoint, MOST_ROWS, Mission, RotorCurves, catalogue_plants, fly, fly_whole,
    hover, modes,
};
use hal_sim::plant::Propeller;
use hal_sim::plant::air::SEA_LEVEL_DENSITY;
use std::path::{Path, PathBuf};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/flight").join(name)
}

fn flown_by(mission: &Mission, airframe: &AirframeFile) -> Vec<Flying> {
    fly(mission, airframe, catalogue_plants(airframe), SEA_LEVEL_DENSITY, &mut |_| ()).expect("a vehicle")
}

fn whole(text: &str) -> Flight {
    let (mission, airframe) = (parse(text).unwrap_or_else(|e| panic!("{e}")), AirframeFile::default());
    let plants = catalogue_plants(&airframe);
    fly_whole(&mission, &airframe, plants, &Catalogue(&airframe), SEA_LEVEL_DENSITY, &mut |_| ()).expect("a vehicle")
}

fn flown(name: &str) -> Vec<Flying> {
    let (mission, airframe) = Mission::load(&file(name)).unwrap_or_else(|e| panic!("{e}"));
    flown_by(&mission, &airframe)
}

fn hovers(airframe: &AirframeFile) -> HoverPoint {
    hover(&airframe.airframe(), &Catalogue(airframe), 1.0).expect("it hovers")
}

fn upward(rows: &[Flying]) -> (f64, f64) {
    let (first, last) = (&rows[0].motion, &rows[rows.len() - 1].motion);
    (first.place.z - last.place.z, -last.velocity.z)
}

/// The take-off at another pulse on all four.
fn climb(pulse_us: f64, airframe: &AirframeFile) -> (f64, f64) {
    let (mut mission, _) = Mission::load(&file("takeoff.toml")).unwrap_or_else(|e| panic!("{e}"));
    mission.command[0].steps[0].pulse_us = pulse_us;
    upward(&flown_by(&mission, airframe))
}

fn row(rows: &[Flying], t_s: f64) -> &Flying {
    rows.iter().find(|f| f.t_s >= t_s - 1e-9).expect("flown so long")
}

fn close(what: &str, ours: f64, stated: f64, tolerance: f64) {
    println!("{what}: stated {stated}, ours {ours:.4}");
    assert!((ours / stated - 1.0).abs() <= tolerance, "{what}: {ours} is not within {tolerance} of {stated}");
}

/// Level, on the spot, without a rate: what 7.4.1, 7.4.2 and 7.4.4 show.
fn straight(rows: &[Flying]) {
    for f in rows {
        let m = &f.motion;
        assert!(m.place.xy().norm() < 1e-9 && m.rate.norm() < 1e-9 && to_euler(&m.attitude).iter().all(|a| a.abs() < 1e-9));
    }
}

/// Speed and thrust of the hover are the stated ones; the catalogue needs 8.42 % for them where the thesis states 8.36 %.
#[test]
fn hover_point() {
    let airframe = AirframeFile::default();
    let h = hovers(&airframe);
    close("hover speed, rev/min", h.rotor.rpm, 4100.0, 0.005);
    close("hover thrust, N", h.rotor.thrust_n, 2.879, 0.005);
    close("hover duty, %", h.pulse_us / 200.0, 8.36, 0.01);
    // four rotors of 5.779 N over 1.174 kg
    close("thrust to weight", h.thrust_to_weight, 4.0 * 5.779 / 11.513, 0.01);
}

/// The motion about the hover, against flights: the answer of pitch and yaw to the excitation's 2 us, the rotor's lag, and the swing of a
/// vehicle that starts 50 m above the height at which its pulse carries it.
#[test]
fn about_the_hover() {
    let airframe = AirframeFile::default();
    let (body, at) = (airframe.airframe(), hovers(&airframe));
    let m = modes(&body, &at, &Catalogue(&airframe), &Default::default());
    println!("{m:?}");
    close("thrust for a pulse, N/% of duty", m.thrust_per_us * 200.0, 1.59, 0.02);
    assert_eq!((m.coning_rad_s, m.turning_per_us[0]), (0.0, m.turning_per_us[1]));
    close("pitch rate of 2 us for 0.15 s, deg/s", (2.0 * 0.15 * m.turning_per_us[1]).to_degrees(), 2.45, 0.03);
    assert!(m.rotor_lag_s > 0.01 && m.rotor_lag_s < 0.1);
    close("minutes at full throttle, Table 9", HoverPoint::minutes(4.4, 4, at.full.current_a), 9.0, 0.02);
    let text = format!(
        "duration_s = 40\n[start]\nheight_m = 50\n[[command]]\nrotors = [1, 2, 3, 4]\nsteps = [{{ pulse_us = {:.6}, hold_s = 1 }}]\n",
        at.pulse_us
    );
    let rows = flown_by(&parse(&text).unwrap_or_else(|e| panic!("{e}")), &airframe);
    // a swing of 50 m about the ground is a fall of 50 (1 - cos w t) at first, before the drag of its speed counts
    let t = 10.0;
    let fallen = 50.0 + row(&rows, t).motion.place.z;
    close("first fall of the swing, m", fallen, 50.0 * (1.0 - (m.heave_rad_s * t).cos()), 0.05);
}

/// Over ground at 4000 m, and in warm air, the hover is that of the air there: a vehicle that flies with its pulse stays where it is.
#[test]
fn the_hover_is_that_of_the_air_at_the_ground() {
    let airframe = AirframeFile::default();
    let sea = hovers(&airframe);
    for air in ["ground_altitude_m = 4000", "temperature_offset_k = 40", "ground_altitude_m = 2000\ntemperature_offset_k = -30"] {
        let text = format!("duration_s = 5\n[start]\nheight_m = 5\n[air]\n{air}\n");
        let mut mission = parse(&text).unwrap_or_else(|e| panic!("{e}"));
        let share = mission.surroundings().density(5.0) / SEA_LEVEL_DENSITY;
        let h = hover(&airframe.airframe(), &Catalogue(&airframe), share).expect("it hovers");
        println!("{air}: {share:.3} of the density, {:.1} us, thrust to weight {:.2}", h.pulse_us, h.thrust_to_weight);
        assert!(h.pulse_us > sea.pulse_us + 10.0 && h.thrust_to_weight < sea.thrust_to_weight && h.density == share);
        let text =
            format!("{text}[[command]]\nrotors = [1, 2, 3, 4]\nsteps = [{{ pulse_us = {:.6}, hold_s = 5 }}]\n", h.pulse_us);
        mission = parse(&text).unwrap_or_else(|e| panic!("{e}"));
        let (height, speed) = upward(&flown_by(&mission, &airframe));
        assert!(height.abs() < 0.05 && speed.abs() < 0.02, "{height} {speed}");
        // its modes are those of that air too: the lag is taken from where it hovers
        let m = modes(&airframe.airframe(), &h, &Catalogue(&airframe), &mission.surroundings());
        assert!(m.rotor_lag_s > 0.01 && m.rotor_lag_s < 0.1, "{m:?}");
    }
}

/// The climb: 63 m in 20 s at 4.0 m/s follow from a lift of 4 x 1.36 N/% x 0.14 % above the weight (errata, "Climb"). With that lift
/// the catalogue's rotors climb so. At the stated 8.5 % itself they have less, for they hover at 8.42 %.
#[test]
fn take_off() {
    let rows = flown("takeoff.toml");
    straight(&rows);
    let (height, speed) = upward(&rows);
    println!("at 8.50 %: {height:.1} m in 20 s at {speed:.2} m/s; stated 63 m and 4.0 to 4.4 m/s");
    assert!((height - 45.9).abs() < 1.0 && (speed - 3.06).abs() < 0.1, "what docs/mission.md says");
    let airframe = AirframeFile::default();
    let lift_n = |pulse| 4.0 * Catalogue(&airframe).settled(pulse, 1.0).thrust_n;
    let wanted = airframe.airframe().mass_kg * hal_sim::flight::G + 4.0 * 1.36 * 0.14;
    let pulse = (1600..1800).map(f64::from).find(|p| lift_n(*p) >= wanted).expect("enough lift");
    let (height, speed) = climb(pulse, &airframe);
    println!("{pulse} us");
    close("climb with the stated lift, m", height, 63.0, 0.06);
    close("its speed, m/s", speed, 4.0, 0.05);
    // a sphere of the hub's size (drag coefficient 0.47) holds back far too little: the counter-example of the errata
    let sphere = AirframeFile { drag_area_m2: 0.47 * core::f64::consts::PI * 0.08 * 0.08, ..airframe };
    let (height, speed) = climb(pulse, &sphere);
    println!("a sphere: {height:.1} m at {speed:.2} m/s");
    assert!(height > 95.0 && speed > 7.5);
}

/// At the stated 8.36 % the catalogue sinks; at its own hover pulse it stays, but for the 0.6 % of density that 63 m cost.
#[test]
fn hovering() {
    let rows = flown("hover.toml");
    straight(&rows);
    println!("8.36 %: {:?}", upward(&rows));
    assert!(upward(&rows).0 < 0.0);
    let airframe = AirframeFile::default();
    let h = hovers(&airframe);
    let (mut mission, _) = Mission::load(&file("hover.toml")).unwrap_or_else(|e| panic!("{e}"));
    mission.command[0].steps[0].pulse_us = h.pulse_us;
    mission.start.height_m = 0.0;
    mission.air.ground_altitude_m = 0.0;
    let (height, speed) = upward(&flown_by(&mission, &airframe));
    assert!(height.abs() < 0.1 && speed.abs() < 0.01, "{height} {speed}");
}

/// Motor 4 at 8.51 % for 0.15 s: pitch up at about 2.3 deg/s, a small positive yaw rate, no roll at first; to the ground.
#[test]
fn excitation() {
    let rows = flown("excitation.toml");
    let soon = row(&rows, 2.0);
    close("pitch rate, deg/s", soon.motion.rate.y.to_degrees(), 2.3, 0.08);
    let yaw = soon.motion.rate.z.to_degrees();
    println!("yaw rate {yaw:.3} deg/s");
    assert!(yaw > 0.02 && yaw < 0.2);
    assert!(to_euler(&soon.motion.attitude)[0].to_degrees().abs() < 0.01, "no roll at first");
    let last = rows.last().expect("rows");
    println!("on the ground after {:.2} s, {:.1} m behind the start", last.t_s, -last.motion.place.x);
    assert!(last.motion.place.z > -0.5 && last.motion.place.x < -100.0 && last.motion.place.y < -1.0, "a curved path backwards");
}

/// The excitation's yaw against the rotors' drag alone: what k_Q w^2 brings in over the pulse, and the rotors' own momentum, over the inertia.
#[test]
fn the_reaction_of_the_rotors_turns_the_vehicle() {
    let (mut mission, airframe) = Mission::load(&file("excitation.toml")).unwrap_or_else(|e| panic!("{e}"));
    (mission.log_hz, mission.duration_s, mission.imu) = (1000, 2.0, None);
    let rows = flown_by(&mission, &airframe);
    let (body, propeller) = (airframe.airframe(), Propeller::named(&airframe.propeller).expect("a propeller"));
    let w = |f: &Flying, i: usize| f.rotors[i].rpm * core::f64::consts::TAU / 60.0;
    let around = mission.surroundings();
    let drag = |f: &Flying, i: usize| {
        let thinner = around.density(-f.motion.place.z) / propeller.reference_density;
        propeller.torque_coefficient * thinner * w(f, i) * w(f, i)
    };
    let over: Vec<&Flying> = rows.iter().filter(|f| f.t_s > 0.9995).collect();
    let (first, last) = (over[0], over[over.len() - 1]);
    let mut momentum = 0.0;
    for (i, rotor) in body.rotors.iter().enumerate() {
        let brought: f64 = over.windows(2).map(|p| 0.5 * (drag(p[0], i) + drag(p[1], i)) * (p[1].t_s - p[0].t_s)).sum();
        momentum -= rotor.turns * (brought + body.rotor_inertia_kgm2 * (w(last, i) - w(first, i)));
    }
    let (want, got) = (momentum / body.inertia_kgm2[2], last.motion.rate.z - first.motion.rate.z);
    close("yaw rate of the excitation, deg/s, against k_Q", got.to_degrees(), want.to_degrees(), 0.02);
    assert!(want > 0.0);
}

/// A fall from 20 m with the motors off is told with the time and the speed of a fall with drag, before what it bounces:
/// v^2 = vt^2 (1 - exp(-2 g h/vt^2)), t = vt/g arcosh(exp(g h/vt^2)).
#[test]
fn a_touch_is_told_with_its_time_and_speed() {
    let flight = whole(
        "duration_s = 6\n[start]\nheight_m = 20\n[[command]]\nrotors = [1, 2, 3, 4]\nsteps = [{ pulse_us = 1000, hold_s = 6 }]\n",
    );
    let body = AirframeFile::default().airframe();
    let squared = 2.0 * body.mass_kg * G / (SEA_LEVEL_DENSITY * body.drag_area_m2);
    let fallen = G * 20.0 / squared;
    let [touch, ref bounces @ ..] = flight.touches[..] else { panic!("{:?}", flight.touches) };
    assert!(bounces.iter().all(|b| b.down_m_s < 0.2 * touch.down_m_s), "{bounces:?}");
    close("speed of the touch, m/s", touch.down_m_s, (squared * (1.0 - (-2.0 * fallen).exp())).sqrt(), 0.002);
    close("time of the touch, s", touch.t_s, squared.sqrt() / G * fallen.exp().acosh(), 0.002);
    // what takes off touches nothing; what comes down again does, once
    let hop = |hold_s: f64| {
        whole(&format!(
            "duration_s = 6\n[start]\nspun_up = false\n[[command]]\nrotors = [1, 2, 3, 4]\n\
             steps = [{{ pulse_us = 1800, hold_s = {hold_s} }}, {{ pulse_us = 1000, hold_s = 1 }}]\n"
        ))
    };
    assert!(hop(6.0).touches.is_empty());
    assert!(matches!(&hop(1.5).touches[..], [touch, ..] if touch.t_s > 1.5 && touch.down_m_s > 1.0), "{:?}", hop(1.5).touches);
}

/// A vehicle that begins on the ground stands on it from the first row: it feels its weight, and nothing moves before its rotors lift it.
#[test]
fn what_begins_on_the_ground_stands() {
    for (spun_up, pulse_us) in [(false, 1000.0), (true, 1600.0), (true, 1672.0)] {
        let flight = whole(&format!(
            "duration_s = 1\nlog_hz = 1000\n[start]\nspun_up = {spun_up}\n[[command]]\nrotors = [1, 2, 3, 4]\n\
             steps = [{{ pulse_us = {pulse_us}, hold_s = 1 }}]\n"
        ));
        let jolt = flight.rows.iter().map(|f| (f.specific_force.z + G).abs()).fold(0.0, f64::max);
        let moved = flight.rows.iter().map(|f| f.motion.velocity.norm()).fold(0.0, f64::max);
        println!("{pulse_us} us: jolt {jolt:.2e} m/s^2, {moved:.2e} m/s");
        assert!(jolt < 0.01 && moved < 1e-4 && flight.touches.is_empty(), "{pulse_us} us: {jolt} {moved}");
    }
}

/// Straight down to the ground. A lower pulse sinks faster and for a shorter time: the printed sentence of 7.4.4 has it reversed.
#[test]
fn landing() {
    let rows = flown("landing.toml");
    straight(&rows[..rows.len() - 1]);
    let down = |rows: &[Flying]| (rows[rows.len() - 1].t_s, rows[rows.len() - 2].motion.velocity.z);
    let (time, speed) = down(&rows);
    println!("8.25 %: on the ground after {time:.2} s at {speed:.2} m/s");
    assert!(time < 30.0 && speed > 4.0);
    let (mut mission, airframe) = Mission::load(&file("landing.toml")).unwrap_or_else(|e| panic!("{e}"));
    mission.command[0].steps[0].pulse_us = 1630.0;
    let (sooner, faster) = down(&flown_by(&mission, &airframe));
    assert!(sooner < time && faster > speed, "{sooner} {faster}");
}

/// The same mission twice gives the same states, gusts included; another seed blows otherwise.
#[test]
fn a_mission_repeats() {
    let text = "duration_s = 2\n[wind]\nsteady_m_s = [3, 0, 0]\ngust_m_s = 1.0\n";
    let mission =
        |seed: u64| Mission::parse(&format!("seed = {seed}\n{text}"), Path::new("m.toml")).unwrap_or_else(|e| panic!("{e}"));
    let once = flown_by(&mission(1), &AirframeFile::default());
    assert_eq!(once, flown_by(&mission(1), &AirframeFile::default()));
    assert_ne!(once, flown_by(&mission(2), &AirframeFile::default()));
}

fn parse(text: &str) -> Result<Mission, ScenarioError> {
    Mission::parse(text, Path::new("m.toml"))
}

#[test]
fn refusals_name_file_line_and_column() {
    for (text, start, word) in [
        ("seed = 1\nspeed = 3\n", "m.toml:2:1: ", "speed"),
        ("[wind]\ngust_m_s = -1.0\n", "m.toml:2:12: ", "from 0 to 50"),
        ("[wind]\ngust_m_s = nan\n", "m.toml:2:12: ", "gust_m_s"),
        ("[wind]\ngust_length_m = 0\n", "m.toml:2:17: ", "from 0.1"),
        ("[wind]\nsteady_m_s = [0, 500, 0]\n", "m.toml:2:", "from -100 to 100"),
        ("[start]\nheight_m = -5\n", "m.toml:2:12: ", "from 0 to 5000"),
        ("[start]\nheight_m = inf\n", "m.toml:2:12: ", "height_m"),
        ("[start]\nvelocity_m_s = [0, 0, 1e6]\n", "m.toml:2:", "from -100 to 100"),
        ("[start]\nattitude_deg = [0, 400, 0]\n", "m.toml:2:", "from -360 to 360"),
        ("[start]\nheight_m = 0.1\nattitude_deg = [0, 30, 0]\n", "m.toml:2:12: ", "a height of 0.15"),
        ("[air]\nground_altitude_m = 60000\n", "m.toml:2:21: ", "from -500 to 6000"),
        ("[air]\ntemperature_offset_k = -300\n", "m.toml:2:24: ", "from -60 to 60"),
        ("duration_s = 1e9\n", "m.toml:1:14: ", "at most 86400 s"),
        ("log_hz = 1000\nduration_s = 86400\n", "m.toml:2:14: ", "at most 2000000 rows"),
        ("[[command]]\nrotors = []\nsteps = [{ pulse_us = 1700, hold_s = 1 }]\n", "m.toml:2:10: ", "at least one rotor"),
        ("[[command]]\nrotors = [1, 2, 1]\nsteps = [{ pulse_us = 1700, hold_s = 1 }]\n", "m.toml:2:17: ", "found 1 again"),
        ("[[failure]]\nchip = \"gyro\"\nat_s = 1\n", "m.toml:3:8: ", "[imu] or [controller]"),
        (
            "[imu]\n[[failure]]\nchip = \"gyro\"\nat_s = 1\n[[failure]]\nchip = \"magnetometer\"\nat_s = 2\n",
            "m.toml:7:8: ",
            "one chip",
        ),
        ("log_hz = 7\n", "m.toml:1:10: ", "divides 1000"),
        ("[[command]]\nrotors = [1, 5]\nsteps = [{ pulse_us = 1700, hold_s = 1 }]\n", "m.toml:2:14: ", "from 1 to 4"),
        ("[[command]]\nrotors = [1]\nsteps = [{ pulse_us = 2100, hold_s = 1 }]\n", "m.toml:3:", "1000 to 2000"),
        ("[[command]]\nrotors = [1]\nsteps = []\n", "m.toml:3:9: ", "at least one"),
    ] {
        let message = parse(text).expect_err(text).to_string();
        assert!(message.starts_with(start) && message.contains(word) && !message.contains('\n'), "{message}");
    }
}

/// The rows of the board count as well; what is not too long is flown.
#[test]
fn rows_are_counted() {
    let rows = |text: &str| parse(text).unwrap_or_else(|e| panic!("{e}")).rows();
    assert_eq!(rows("duration_s = 100\nlog_hz = 50\n"), 5_000);
    assert_eq!(rows("duration_s = 100\nlog_hz = 50\n[imu]\nrest_s = 10\n"), 5_000 + 200 * 110);
    assert!(parse("duration_s = 86400\nlog_hz = 20\n").is_ok() && MOST_ROWS > 20 * 86_400);
    assert!(parse("duration_s = 86400\nlog_hz = 20\n[imu]\n").is_err());
}

#[test]
fn pulses_step_ramp_and_hold() {
    let m = parse(
        "duration_s = 0\n[[command]]\nrotors = [1, 2]\nsteps = [{ pulse_us = 1500, hold_s = 1 }, { pulse_us = 1600, hold_s = 2, ramp = true }]\n\
         [[command]]\nrotors = [2]\nsteps = [{ pulse_us = 1200, hold_s = 0.5 }]\n",
    )
    .unwrap_or_else(|e| panic!("{e}"));
    assert_eq!([0.0, 1.0, 2.0, 3.0, 9.0].map(|t| m.pulse_us(0, t)), [1500.0, 1500.0, 1550.0, 1600.0, 1600.0]);
    assert_eq!((m.pulse_us(1, 7.0), m.pulse_us(2, 0.0), m.length_s()), (1200.0, HOVER_US, 3.0));
}

/// An airframe file beside the mission: another layout, and a refusal that names that file.
#[test]
fn an_airframe_of_its_own() {
    let folder = std::env::temp_dir().join(format!("quadrig-airframe-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("a file");
    write("m.toml", "airframe = \"a.toml\"\n[[command]]\nrotors = [6]\nsteps = [{ pulse_us = 1700, hold_s = 1 }]\n");
    let rotor = |x: i32, turns: &str| format!("[[rotor]]\nplace_m = [{x}, 0.1, 0]\nturns = \"{turns}\"\n");
    write("a.toml", &(0..6).map(|i| rotor(i, if i % 2 == 0 { "clockwise" } else { "counter_clockwise" })).collect::<String>());
    let (_, airframe) = Mission::load(&folder.join("m.toml")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((airframe.rotors().len(), airframe.rotors()[5].turns), (6, -1.0));
    write("a.toml", &rotor(0, "left"));
    let said = Mission::load(&folder.join("m.toml")).expect_err("a sense").to_string();
    std::fs::remove_dir_all(&folder).expect("gone");
    assert!(said.contains("a.toml:3:9: ") && said.contains("counter_clockwise"), "{said}");
}
