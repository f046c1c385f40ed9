//! The IMU board's flash image in flight: the image on the emulated STM32F405 and the portable half natively, on the same flying body.
//!
//! What it is: a take-off under the controller in gusts, rotors that shake; what the board felt in every millisecond is given to the chips of
//! the emulated board; its words and its attitude are held against those of the native run and against the truth.
//! What can go wrong: the two read a chip some microseconds apart, so that a word of a shaking axis differs by what it changes in between.
//! Build the image first: `cargo xtask image`

use frame::wire::Decoder;
use frame::{ImuSample, Message};
use hal_sim::emulated::ahrs::ahrs_with;
use hal_sim::flight::attitude::from_quaternion;
use hal_sim::mission::{AirframeFile, Catalogue, Mission, apart, catalogue_plants, fly_again};
use hal_sim::native::ahrs::run;
use hal_sim::plant::air::SEA_LEVEL_DENSITY;
use std::path::Path;

const MISSION: &str = "duration_s = 4\n[start]\nspun_up = false\n[wind]\ngust_m_s = 1\ngust_length_m = 10\n[imu]\nrest_s = 1.5\nchips = \"ideal\"\n\
    [controller]\nway = [{ at_s = 0.2, up_m = 0 }, { at_s = 2, up_m = 2 }, { at_s = 4, up_m = 2, north_m = 2 }]\n";

#[test]
fn the_image_rides_on_the_flight() {
    let (mission, airframe) = (Mission::parse(MISSION, Path::new("m.toml")).expect("a mission"), AirframeFile::default());
    let plants = catalogue_plants(&airframe);
    let (flight, rig) = fly_again(&mission, &airframe, plants, &Catalogue(&airframe), SEA_LEVEL_DENSITY).expect("a vehicle");
    let length_ms = 5_500;
    let image = ahrs_with(&rig, length_ms).unwrap_or_else(|e| panic!("{e}"));
    image.outcome.accesses.only(&[]).unwrap();
    let mut decoder = Decoder::default();
    let messages = image.outcome.telemetry.iter().filter_map(|b| decoder.push::<Message>(*b)).map(|r| r.message);
    let samples: Vec<ImuSample> = messages.filter_map(|m| if let Message::Imu(s) = m { Some(s) } else { None }).collect();
    let native = run(&rig, length_ms).expect("it runs");
    assert!(samples.len() + 5 > native.samples.len() && samples.len() > 1_080, "{} {}", samples.len(), native.samples.len());

    // the image's clock starts after power-up: where it read, the board's own record says
    let rotation = |s: &ImuSample| from_quaternion(s.quaternion_q30.map(f64::from));
    let (mut against_truth, mut against_native) = (0.0f64, 0.0f64);
    for (sample, served) in samples.iter().zip(&image.served[0]) {
        let t_s = served.at_ns as f64 * 1e-9 - 1.5;
        let nearest =
            flight.seen.iter().enumerate().min_by(|(_, a), (_, b)| (a.0.t_s - t_s).abs().total_cmp(&(b.0.t_s - t_s).abs()));
        let (i, (_, truth)) = nearest.expect("rows");
        if t_s < 0.0 || sample.quaternion_q30 == [0; 4] {
            continue;
        }
        let (tilt, heading) = apart(&rotation(sample), truth);
        against_truth = against_truth.max(tilt.max(heading.abs()));
        let (tilt, heading) = apart(&rotation(sample), &rotation(&native.samples[i.min(native.samples.len() - 1)]));
        against_native = against_native.max(tilt.max(heading.abs()));
    }
    let [truth, native] = [against_truth, against_native].map(f64::to_degrees);
    println!("{} samples; off the truth by {truth:.3} deg, off the native run by {native:.3} deg at the most", samples.len());
    assert!(native < 0.3 && truth < 2.0);
}
