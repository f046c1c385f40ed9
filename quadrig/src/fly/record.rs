//! A flight as files: the states, and the flight log.
//!
//! What it is: `states.csv` with the twelve states of the thesis and the quaternion; `attitude.csv` with what the IMU board said; `flight.csv`, a `quadrig-flight 1` log with what is
//! really there at the centre of gravity.
//! What can go wrong: nothing.
//! Units: SI, rad; us, rev/min. Earth NED, body FRD.
//! Reference: specification `flight.md`, "Missions" and "Flight log"; Beharie 2013, section 7.1 (the twelve outputs).

use hal_sim::flight::attitude::to_euler;
use hal_sim::flight::{Airframe, Flying, Rotation, Vector};
use hal_sim::mission::Seen;
use ident::log::{Column, Log};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Header of the states.
const STATES: &str = "t_s,north_m,east_m,down_m,u_m_s,v_m_s,w_m_s,roll_rad,pitch_rad,yaw_rad,p_rad_s,q_rad_s,r_rad_s,qw,qx,qy,qz";

/// Velocity in body axes, m/s.
pub(super) fn body_velocity(f: &Flying) -> Vector {
    f.motion.attitude.inverse() * f.motion.velocity
}

/// The states, a row a sample.
pub(super) fn states(rows: &[Flying]) -> String {
    let mut out = format!("{STATES}\n");
    for f in rows {
        let (m, q) = (&f.motion, f.motion.attitude.quaternion());
        let _ = write!(out, "{:.3}", f.t_s); // a string takes everything
        let vectors = [m.place, body_velocity(f), Vector::from(to_euler(&m.attitude)), m.rate];
        for value in vectors.iter().flat_map(|v| v.iter()).chain(&[q.w, q.i, q.j, q.k]) {
            let _ = write!(out, ",{:.9}", if value.abs() < 5e-10 { 0.0 } else { *value });
        }
        out.push('\n');
    }
    out
}

/// What the IMU board said of its attitude, as an attitude log; empty fields before its filter has started.
pub(super) fn attitudes(seen: &[(Seen, Rotation)]) -> String {
    let mut out = String::from("t_s,qw,qx,qy,qz,roll_deg,pitch_deg,yaw_deg\n");
    for (s, _) in seen {
        let _ = write!(out, "{:.3}", s.t_s); // a string takes everything
        match s.attitude {
            Some(attitude) => {
                let (q, angles) = (attitude.quaternion(), to_euler(&attitude).map(f64::to_degrees));
                for v in [q.w, q.i, q.j, q.k].into_iter().chain(angles) {
                    let _ = write!(out, ",{v:.7}");
                }
            }
            None => out.push_str(",,,,,,,"),
        }
        out.push('\n');
    }
    out
}

/// The flight log.
pub(super) fn flight_log(rows: &[Flying], airframe: &Airframe, told: &[(&str, String)]) -> Log {
    let mut log = Log { name: "flight.csv".to_owned(), t: rows.iter().map(|f| f.t_s).collect(), ..Log::default() };
    log.meta = meta(airframe, told);
    let mut push = |name: String, value: &dyn Fn(&Flying) -> f64| {
        log.columns.push(Column { name, values: rows.iter().map(value).collect() });
    };
    let rotors = airframe.rotors.len();
    for i in 0..rotors {
        push(format!("pulse_us_{}", i + 1), &|f| f.pulses_us[i]);
    }
    for i in 0..rotors {
        push(format!("rpm_{}", i + 1), &|f| f.rotors[i].rpm);
    }
    for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
        push(format!("acc_{letter}"), &|f| f.specific_force[axis]);
    }
    for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
        push(format!("gyro_{letter}"), &|f| f.motion.rate[axis]);
    }
    for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
        push(format!("vel_{letter}"), &|f| f.motion.velocity[axis]);
    }
    for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
        push(format!("pos_{letter}"), &|f| f.motion.place[axis]);
    }
    let part = |f: &Flying, i: usize| {
        let q = f.motion.attitude.quaternion();
        [q.w, q.i, q.j, q.k][i]
    };
    for (i, name) in ["qw", "qx", "qy", "qz"].into_iter().enumerate() {
        push(name.to_owned(), &|f| part(f, i));
    }
    // before the first step nothing has been read of the supply; a reading of nothing would pass for one
    let read = |f: &Flying, value: f64| if f.rotors.iter().all(|r| r.voltage_v == 0.0) { f64::NAN } else { value };
    push("voltage_v".to_owned(), &|f| read(f, f.rotors.iter().map(|r| r.voltage_v).sum::<f64>() / rotors as f64));
    push("current_a".to_owned(), &|f| read(f, f.rotors.iter().map(|r| r.current_a).sum()));
    for i in 0..rotors {
        push(format!("thrust_n_{}", i + 1), &|f| f.rotors[i].thrust_n);
    }
    log
}

fn meta(airframe: &Airframe, told: &[(&str, String)]) -> BTreeMap<String, toml::Value> {
    let text = |s: &str| toml::Value::String(s.to_owned());
    let mut meta: BTreeMap<String, toml::Value> = told.iter().map(|(k, v)| ((*k).to_owned(), text(v))).collect();
    let arms: Vec<f64> = airframe.rotors.iter().map(|r| Vector::from(r.place).norm()).collect();
    let arm = arms[0];
    if arms.iter().all(|a| (a - arm).abs() < 1e-9) {
        meta.insert("arm_m".to_owned(), toml::Value::Float(arm));
    }
    let plus = airframe.rotors == Airframe::plus(arm);
    meta.insert("layout".to_owned(), text(if plus { "plus" } else { "own" }));
    meta.insert("mass_kg".to_owned(), toml::Value::Float(airframe.mass_kg));
    let inertia = airframe.inertia_kgm2.map(toml::Value::Float);
    meta.insert("inertia_kgm2".to_owned(), toml::Value::Array(inertia.to_vec()));
    meta
}
