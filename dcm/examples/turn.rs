//! A body that turns about all three axes, with a gyro that is off by one degree a second: `cargo run --example turn`.

use dcm::{Config, Dcm, Euler, Increment, Mat3, Measurement, STANDARD_GRAVITY, Vec3, rotate};

const DT: f32 = 1.0 / 200.0;

fn main() {
    let gravity = Vec3::new(0.0, 0.0, -STANDARD_GRAVITY); // specific force at rest, north-east-down
    let field = Vec3::new(20.0, 0.0, 43.0); // uT
    let off = Vec3::new(1.0, -1.0, 1.0).map(f32::to_radians);

    let mut truth = Mat3::identity();
    let mut filter = Dcm::new(Config::default());
    for n in 0..=200 * 60 {
        let t = n as f32 * DT;
        // at rest for five seconds, then in motion
        let rate = if t < 5.0 { Vec3::zeros() } else { Vec3::new((0.9 * t).sin(), 0.6 * (0.7 * t).cos(), 0.8 * (0.4 * t).sin()) };
        truth = rotate(&truth, &(rate * DT), Increment::Exponential);
        let measured = Measurement {
            gyro: Some(rate + off),
            accel: Some(truth.transpose() * gravity),
            mag: (n % 3 == 0).then(|| truth.transpose() * field),
        };
        filter.update(DT, &measured);
        if n % 2000 == 0 {
            let Euler { roll, pitch, yaw } = filter.euler();
            let [roll, pitch, yaw] = [roll, pitch, yaw].map(f32::to_degrees);
            let heading = filter.heading_against(&truth).to_degrees();
            println!("{t:>4.0} s: roll {roll:>6.1}, pitch {pitch:>6.1}, yaw {yaw:>6.1} degrees, its heading off by {heading:.2}");
        }
    }
    let bias = filter.bias().map(f32::to_degrees);
    println!("gyro bias found: {:.2} {:.2} {:.2} degrees a second", bias.x, bias.y, bias.z);
    assert!((filter.bias() - off).abs().max() < 0.1f32.to_radians());
    assert!(filter.heading_against(&truth).abs() < 1f32.to_radians());
}
