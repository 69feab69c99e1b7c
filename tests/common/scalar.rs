//! The time scheme on x' = λx, where its order and its growth are known.

use cosserat_rod::alpha::{Rate, Scheme};
use nalgebra::{Complex, Matrix2, Vector3};

/// One step of x' = λx: v = λx at the end of the step, and v is linear in the new x.
pub fn step(
    scheme: &Scheme,
    lambda: Complex<f64>,
    dt: f64,
    x: Complex<f64>,
    rate: &[Rate; 2],
) -> (Complex<f64>, [Rate; 2]) {
    // the scheme is real: real and imaginary part go through it one after the other, in the first component
    let at = |i: usize, increment: f64| scheme.rate(&rate[i], &(Vector3::x() * increment), dt);
    let still = Complex::new(at(0, 0.0).value.x, at(1, 0.0).value.x);
    let increment = (lambda * x - still) / (Complex::from(scheme.rate_weight(dt)) - lambda);
    (x + increment, [at(0, increment.re), at(1, increment.im)])
}

/// A rate and its auxiliary rate, real and imaginary part.
pub fn rates(auxiliary: Complex<f64>, value: Complex<f64>) -> [Rate; 2] {
    let part = |auxiliary, value| Rate { auxiliary: Vector3::x() * auxiliary, value: Vector3::x() * value };
    [part(auxiliary.re, value.re), part(auxiliary.im, value.im)]
}

/// The map from (x, Δt ẋ) to the next, at λΔt = `z`.
pub fn amplification(scheme: &Scheme, z: Complex<f64>) -> Matrix2<Complex<f64>> {
    let column = |x: Complex<f64>, auxiliary: Complex<f64>| {
        let (x, rate) = step(scheme, z, 1.0, x, &rates(auxiliary, z * x));
        [x, Complex::new(rate[0].auxiliary.x, rate[1].auxiliary.x)]
    };
    let (zero, one) = (Complex::from(0.0), Complex::from(1.0));
    let (first, second) = (column(one, zero), column(zero, one));
    Matrix2::new(first[0], second[0], first[1], second[1])
}

/// The larger |ζ| of the amplification at λΔt = `z`.
#[allow(dead_code)]
pub fn growth(scheme: &Scheme, z: Complex<f64>) -> f64 {
    let matrix = amplification(scheme, z);
    let half = (matrix[(0, 0)] + matrix[(1, 1)]) * 0.5;
    let root = (half * half - matrix.determinant()).sqrt();
    (half + root).norm().max((half - root).norm())
}
