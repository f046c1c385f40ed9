//! The few operations on columns of three numbers that the filter is made of: one copy of each in the image.
//!
//! What it is: sums, products and turns of columns, averages that follow, clamping to a limit.
//! What can go wrong: written out at each place, as an optimiser likes it, the same arithmetic takes three times the flash.
//! Units: those of the input.
//! Reference: budget of flash, `budgets/ahrs.toml`.

/// A vector, or a column of a matrix.
pub(crate) type Column = [f32; 3];

/// No direction.
pub(crate) const ZERO: Column = [0.0; 3];

/// a + k b.
#[inline(never)]
pub(crate) fn add_scaled(a: &Column, b: &Column, k: f32) -> Column {
    let ([ax, ay, az], [bx, by, bz]) = (a, b);
    [ax + k * bx, ay + k * by, az + k * bz]
}

/// k a.
#[inline(never)]
pub(crate) fn scaled([x, y, z]: &Column, k: f32) -> Column {
    [x * k, y * k, z * k]
}

/// Scalar product.
#[inline(never)]
pub(crate) fn dot(a: &Column, b: &Column) -> f32 {
    let ([ax, ay, az], [bx, by, bz]) = (a, b);
    ax * bx + ay * by + az * bz
}

/// Squared length.
pub(crate) fn square(v: &Column) -> f32 {
    dot(v, v)
}

/// Vector product.
#[inline(never)]
pub(crate) fn cross(a: &Column, b: &Column) -> Column {
    let ([ax, ay, az], [bx, by, bz]) = (a, b);
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}

/// Turns every column by the matrix `by`.
#[inline(never)]
pub(crate) fn turn(by: &[Column; 3], columns: &mut [Column]) {
    let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = by;
    for [x, y, z] in columns {
        (*x, *y, *z) = (ax * *x + bx * *y + cx * *z, ay * *x + by * *y + cy * *z, az * *x + bz * *y + cz * *z);
    }
}

/// The averages take the share `k` of what differs; what differs from them afterwards is left in `now`.
#[inline(never)]
pub(crate) fn follow(average: &mut [Column], now: &mut [Column], k: f32) {
    for (average, now) in average.as_flattened_mut().iter_mut().zip(now.as_flattened_mut()) {
        let away = *now - *average;
        *average += away * k;
        *now = away - away * k;
    }
}

/// The smaller one; a number where one is none.
#[inline(never)]
pub(crate) fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Clamps every component to `most` on both sides of zero; says whether one was there or beyond.
#[inline(never)]
pub(crate) fn clamp(v: &mut [f32], most: f32) -> bool {
    let mut reached = false;
    for x in v {
        if x.abs() >= most {
            *x = most.copysign(*x);
            reached = true;
        }
    }
    reached
}
