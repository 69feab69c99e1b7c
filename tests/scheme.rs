//! The one-parameter family of the time scheme on x' = λx, where its order and its spectral radius are known.

mod common;

use common::Case;
use cosserat_rod::alpha::{Rate, Scheme};
use nalgebra::{Complex, Matrix2, Vector3};

/// One step of x' = λx: v = λx at the end of the step, and v is linear in the new x.
fn step(
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

fn rates(auxiliary: Complex<f64>, value: Complex<f64>) -> [Rate; 2] {
    let part = |auxiliary, value| Rate { auxiliary: Vector3::x() * auxiliary, value: Vector3::x() * value };
    [part(auxiliary.re, value.re), part(auxiliary.im, value.im)]
}

/// The errors of x and of the auxiliary rate at t = 1.
fn errors(scheme: &Scheme, auxiliary: Complex<f64>, steps: usize) -> [f64; 2] {
    let lambda = Complex::new(-1.0, 2.0);
    let mut x = Complex::new(1.0, 0.0);
    let mut rate = rates(auxiliary, lambda);
    for _ in 0..steps {
        (x, rate) = step(scheme, lambda, 1.0 / steps as f64, x, &rate);
    }
    let exact = lambda.exp();
    let auxiliary = Complex::new(rate[0].auxiliary.x, rate[1].auxiliary.x);
    [(x - exact).norm(), (auxiliary - lambda * exact).norm()]
}

/// The map from (x, Δt ẋ) to the next, for real λ.
fn amplification(scheme: &Scheme, lambda: f64) -> Matrix2<f64> {
    let column = |x: f64, auxiliary: f64| {
        let start = rates(Complex::from(auxiliary), Complex::from(lambda * x));
        let (x, rate) = step(scheme, Complex::from(lambda), 1.0, Complex::from(x), &start);
        [x.re, rate[0].auxiliary.x]
    };
    let (first, second) = (column(1.0, 0.0), column(0.0, 1.0));
    Matrix2::new(first[0], second[0], first[1], second[1])
}

#[test]
fn the_family_has_its_weights_order_and_spectral_radius() {
    let case = Case::read("c7_gen_alpha_family");
    let family: Vec<Scheme> =
        case.inputs("lambda_inf").into_iter().map(|lambda| Scheme::from_spectral_radius(-lambda)).collect();
    let each = |read: &dyn Fn(&Scheme) -> Vec<f64>| family.iter().flat_map(read).collect::<Vec<_>>();
    case.check("alpha,beta,gamma", &each(&|s| vec![s.alpha, s.beta, s.gamma]));
    case.check("alpha-beta+gamma", &each(&|s| vec![s.alpha - s.beta + s.gamma]));

    let order = |scheme: &Scheme, auxiliary: Complex<f64>, read: usize| {
        (errors(scheme, auxiliary, 640)[read] / errors(scheme, auxiliary, 1280)[read]).log2()
    };
    let (exact, zero) = (Complex::new(-1.0, 2.0), Complex::from(0.0));
    case.check("observed order of x (exact", &each(&|s| vec![order(s, exact, 0)]));
    case.check("observed order of x with zero", &each(&|s| vec![order(s, zero, 0)]));
    case.check("observed order of the stored rate", &each(&|s| vec![order(s, exact, 1)]));

    // both limits are triangular, so that the diagonal holds the eigenvalues, also where they are a defective pair;
    // λΔt = −1e14 is at infinity up to 1e-14
    let far = |scheme: &Scheme| {
        let matrix = amplification(scheme, -1e14);
        assert!(matrix[(0, 1)].abs() < 1e-13, "{matrix}");
        vec![matrix[(0, 0)], matrix[(1, 1)]]
    };
    let near = |scheme: &Scheme| {
        let matrix = amplification(scheme, 0.0);
        assert!(matrix[(1, 0)].abs() < 1e-13, "{matrix}");
        vec![matrix[(0, 0)], matrix[(1, 1)]]
    };
    case.check("eigenvalues of the amplification matrix at infinity", &each(&far));
    case.check("eigenvalues at z=0", &each(&near));
    let radius = |scheme: &Scheme| vec![far(scheme).iter().fold(0.0, |radius: f64, value| radius.max(value.abs()))];
    case.check("spectral radius at infinity", &each(&radius));
}
