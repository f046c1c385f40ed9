//! Calibration on simulated sensors whose errors are known: every parameter comes back within its stated interval.

use dcm::calibration::{
    Calibration, CalibrationError, Collector, GyroZero, alignment, ellipsoid, six_positions, three_positions,
};
use dcm::{Mat3, STANDARD_GRAVITY, Vec3, rotate};

/// Deterministic normal noise: Box-Muller on a 64-bit linear congruential generator (Knuth's MMIX constants).
struct Noise(u64);

impl Noise {
    /// Seeds far apart: neighbours of this generator resemble each other.
    fn far(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15))
    }
    fn uniform(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 40) as f32 + 0.5) / (1u64 << 24) as f32
    }
    fn normal(&mut self) -> f32 {
        (-2.0 * self.uniform().ln()).sqrt() * (core::f32::consts::TAU * self.uniform()).cos()
    }
    fn vector(&mut self, sigma: f32) -> Vec3 {
        Vec3::new(self.normal(), self.normal(), self.normal()) * sigma
    }
    fn direction(&mut self) -> Vec3 {
        let v = self.vector(1.0);
        v / v.dot(&v).sqrt()
    }
}

#[test]
fn gyro_zero_and_its_interval() {
    let zero = Vec3::new(-0.05, 0.117, -0.023);
    let (mut inside, runs) = (0, 40);
    for seed in 0..runs {
        let mut noise = Noise::far(seed);
        let mut collected = GyroZero::default();
        for _ in 0..1000 {
            collected.add(&(zero + noise.vector(0.004)));
        }
        let (mean, sigma) = collected.finish(0.01).unwrap();
        inside += (0..3).filter(|i| (mean[*i] - zero[*i]).abs() < 1.96 * sigma[*i]).count();
    }
    println!("gyro: {inside} of 120 inside 95 %");
    assert!((105..=120).contains(&inside), "{inside} of 120 inside 95 %");
    let mut moving = GyroZero::default();
    let mut noise = Noise(1);
    for k in 0..1000 {
        moving.add(&(noise.vector(0.004) + Vec3::new((k as f32 * 0.01).sin(), 0.0, 0.0)));
    }
    assert!(matches!(moving.finish(0.01), Err(CalibrationError::Moving { .. })));
    assert_eq!(GyroZero::default().finish(0.01), Err(CalibrationError::TooFew { found: 0, needed: 100 }));
}

fn six(offset: Vec3, gain: Vec3, noise: &mut Noise, sigma: f32) -> [Vec3; 6] {
    core::array::from_fn(|i| {
        let mut up = Vec3::zeros();
        up[i / 2] = if i % 2 == 0 { STANDARD_GRAVITY } else { -STANDARD_GRAVITY };
        offset + gain.component_mul(&up) + noise.vector(sigma)
    })
}

#[test]
fn six_positions_give_offsets_and_gains_within_their_intervals() {
    let (offset, gain) = (Vec3::new(-6.5, 11.0, -32.0), Vec3::new(27.5, 27.2, 27.2)); // counts, counts per m/s^2
    let mut inside = 0;
    for seed in 0..40 {
        let mut noise = Noise::far(seed);
        let found = six_positions(&six(offset, gain, &mut noise, 0.2), 0.2).unwrap();
        for i in 0..3 {
            inside += usize::from((found.offset[i] - offset[i]).abs() < 1.96 * found.offset_sigma[i]);
            inside += usize::from((found.gain[i] - gain[i]).abs() < 1.96 * found.gain_sigma[i]);
        }
        assert!(found.residual < 0.03);
    }
    println!("six positions: {inside} of 240 inside 95 %");
    assert!((215..=240).contains(&inside), "{inside} of 240 inside 95 %");
}

#[test]
fn a_wrong_position_is_named() {
    let mut readings = six(Vec3::zeros(), Vec3::repeat(26.1), &mut Noise(1), 0.1);
    readings.swap(3, 4);
    assert_eq!(six_positions(&readings, 0.1), Err(CalibrationError::Position { index: 3 }));
    readings[0] = Vec3::repeat(f32::NAN);
    assert!(six_positions(&readings, 0.1).is_err());
}

/// Table 4 lists two readings of each axis at 0 g; (X1 - X2)/2 as printed (4.4) would give their difference, near zero.
#[test]
fn the_three_positions_of_table_4_give_offsets() {
    let (o, g) = (Vec3::new(3.0, -5.0, 8.0), 256.0);
    let readings = [o + Vec3::new(0.5, -0.5, g), o + Vec3::new(g, 0.5, -0.5), o + Vec3::new(-0.5, g, 0.5)];
    let found = three_positions(&readings).unwrap();
    assert!((found - o).abs().max() < 1e-3, "{found}");
    let printed = (readings[0].x - readings[2].x) / 2.0;
    assert!((printed - o.x).abs() > 2.0, "the printed form is wrong");
    assert!(three_positions(&[readings[1], readings[0], readings[2]]).is_err());
}

const SOFT: [f32; 6] = [1.08, 0.95, 0.99, 0.04, -0.03, 0.02];

/// What a magnetometer with iron reads: the inverse of the calibration.
fn magnetometer(field: &Vec3, offset: &Vec3, soft: &Mat3) -> Vec3 {
    soft * field + offset
}

fn soft() -> Mat3 {
    let [xx, yy, zz, xy, xz, yz] = SOFT;
    Mat3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// Shares of offsets and of the matrix' elements that lie within their intervals of 95 %, with these directions; and the least coverage.
fn inside(direction: impl Fn(&mut Noise) -> Vec3) -> (f64, f64, f32) {
    let (offset, soft) = (Vec3::new(-12.0, 30.0, 55.0), soft());
    // matrix times soft is a multiple of one; determinant 1 fixes which
    let det = soft.m11 * (soft.m22 * soft.m33 - soft.m23 * soft.m32) - soft.m12 * (soft.m21 * soft.m33 - soft.m23 * soft.m31)
        + soft.m13 * (soft.m21 * soft.m32 - soft.m22 * soft.m31);
    // Cramer's rule: the rows of the inverse are the cross products of the columns, over the determinant
    let (a, b, c) = (soft.column(0), soft.column(1), soft.column(2));
    let rows = [b.cross(&c), c.cross(&a), a.cross(&b)].map(|r| r.transpose());
    let truth = Mat3::from_rows(&rows) * (det.cbrt() / det);
    let (mut offsets, mut elements, mut covered) = (0, 0, 1.0f32);
    let runs = 200;
    for seed in 0..runs {
        let mut noise = Noise::far(seed);
        let readings: Vec<Vec3> =
            (0..200).map(|_| magnetometer(&(direction(&mut noise) * 48.0), &offset, &soft) + noise.vector(0.3)).collect();
        let found = ellipsoid(&readings).unwrap();
        offsets += (0..3).filter(|i| (found.offset[*i] - offset[*i]).abs() < 1.96 * found.offset_sigma[*i]).count();
        let off = found.matrix - truth;
        let off = [off.m11, off.m22, off.m33, off.m12, off.m13, off.m23];
        elements += off.iter().zip(found.matrix_sigma).filter(|(off, sigma)| off.abs() < 1.96 * sigma).count();
        let product = found.matrix * soft / det.cbrt();
        assert!((product - Mat3::identity()).abs().max() < 0.01, "{product}");
        covered = covered.min(found.coverage);
        assert!(found.residual < 0.5, "{found:?}");
        assert!((found.norm / det.cbrt() - 48.0).abs() < 0.3, "{}", found.norm);
    }
    let share = |inside: usize, of: u64| 100.0 * inside as f64 / of as f64;
    let (offsets, elements) = (share(offsets, 3 * runs), share(elements, 6 * runs));
    println!("inside 95 %: {offsets:.1} % of the offsets, {elements:.1} % of the matrix' elements");
    (offsets, elements, covered)
}

#[test]
fn the_ellipsoid_comes_back_within_its_intervals() {
    let (offsets, elements, covered) = inside(Noise::direction);
    assert!(covered > 0.95, "{covered}");
    assert!((92.0..=98.0).contains(&offsets) && (92.0..=98.0).contains(&elements), "{offsets} {elements}");
}

/// Nearly all readings on one side: less is known of the ellipsoid, and said so.
#[test]
fn readings_on_one_side_have_wider_intervals() {
    let lopsided = |noise: &mut Noise| {
        let d = noise.direction();
        if noise.uniform() < 0.6 { (d * 0.5 + Vec3::z()).normalize() } else { d }
    };
    let (offsets, elements, _) = inside(lopsided);
    assert!((92.0..=98.0).contains(&offsets) && (92.0..=98.0).contains(&elements), "{offsets} {elements}");
}

#[test]
fn poor_coverage_is_refused() {
    let mut noise = Noise(3);
    let some = |keep: fn(&Vec3) -> bool, noise: &mut Noise| -> Vec<Vec3> {
        let all = (0..2000).map(|_| noise.direction()).filter(keep).take(200);
        all.map(|d| magnetometer(&(d * 48.0), &Vec3::new(1.0, 2.0, 3.0), &soft()) + noise_of(&d)).collect()
    };
    // half of the sphere, and a board turned on the table only
    for keep in [|d: &Vec3| d.z > 0.0, |d: &Vec3| d.z.abs() < 0.1] {
        let readings = some(keep, &mut noise);
        assert!(matches!(ellipsoid(&readings), Err(CalibrationError::Coverage { .. })), "{:?}", ellipsoid(&readings));
    }
    assert_eq!(ellipsoid(&[Vec3::x(); 10]), Err(CalibrationError::TooFew { found: 10, needed: 40 }));
    assert!(ellipsoid(&[Vec3::x(); 100]).is_err());
    assert!(ellipsoid(&[Vec3::repeat(f32::NAN); 100]).is_err());
}

/// A little noise that depends on the direction only.
fn noise_of(d: &Vec3) -> Vec3 {
    Noise((d.x.to_bits() as u64) << 32 | d.y.to_bits() as u64).vector(0.2)
}

#[test]
fn the_collector_keeps_few_and_covers_all() {
    let mut noise = Noise(5);
    let mut store = Collector::new(48.0);
    for _ in 0..20_000 {
        store.add(&(noise.direction() * 48.0 + Vec3::new(20.0, -30.0, 10.0)));
    }
    assert!((100..=240).contains(&store.readings().len()), "{}", store.readings().len());
    assert!(ellipsoid(store.readings()).is_ok());
    let mut still = Collector::new(48.0);
    for _ in 0..1000 {
        still.add(&(Vec3::x() * 48.0 + noise.vector(0.3)));
    }
    assert!(still.readings().len() <= 2, "rest adds nothing: {}", still.readings().len());
}

#[test]
fn alignment_comes_back_within_its_interval() {
    let turn = Vec3::new(0.03, -0.02, 0.05);
    let truth = rotate(&Mat3::identity(), &turn, dcm::Increment::Exponential);
    let mut inside = 0;
    for seed in 0..40 {
        let mut noise = Noise::far(seed);
        let pairs: Vec<(Vec3, Vec3)> = (0..60)
            .map(|_| {
                let mut r = Mat3::identity();
                for _ in 0..6 {
                    r = rotate(&r, &(noise.direction() * 0.9), dcm::Increment::Exponential);
                }
                let force = r.transpose() * Vec3::new(0.0, 0.0, -STANDARD_GRAVITY) + noise.vector(0.02);
                let field = truth.transpose() * r.transpose() * Vec3::new(20.0, 0.0, 43.0) + noise.vector(0.2);
                (force, field)
            })
            .collect();
        let found = alignment(&pairs).unwrap();
        inside += (0..3).filter(|i| (found.angle[*i] - turn[*i]).abs() < 1.96 * found.sigma[*i]).count();
        assert!((found.matrix - truth).abs().max() < 0.01);
    }
    println!("alignment: {inside} of 120 inside 95 %");
    assert!(inside >= 105, "{inside} of 120 inside 95 %");
    let flat: Vec<(Vec3, Vec3)> =
        (0..20).map(|k| (Vec3::new(0.0, 0.0, -9.8), Vec3::new((k as f32).cos() * 20.0, (k as f32).sin() * 20.0, 43.0))).collect();
    assert!(alignment(&flat).is_err(), "one tilt only");
}

#[test]
fn a_calibration_survives_its_words_and_makes_readings_right() {
    let mut c = Calibration { gyro_offset: Vec3::new(0.1, 0.2, 0.3), ..Calibration::default() };
    c.mag_offset = Vec3::new(5.0, 6.0, 7.0);
    c.accel_matrix.m12 = 0.25;
    assert_eq!(Calibration::from_words(&c.to_words()), Some(c));
    let mut words = c.to_words();
    words[20] = f32::INFINITY.to_bits();
    assert_eq!(Calibration::from_words(&words), None);
    assert_eq!(c.mag(&Vec3::new(6.0, 8.0, 10.0)), Vec3::new(1.0, 2.0, 3.0));
    assert_eq!(c.gyro(&Vec3::new(0.1, 0.2, 0.3)), Vec3::zeros());
    assert_eq!(c.accel(&Vec3::new(0.0, 4.0, 0.0)), Vec3::new(1.0, 4.0, 0.0));
}
