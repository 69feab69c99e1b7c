//! The one-parameter family of the time scheme on x' = λx, where its order and its spectral radius are known; and the
//! Rosenbrock methods on what they integrate exactly.

mod common;
#[path = "common/scalar.rs"]
mod scalar;

use common::Case;
use cosserat_rod::alpha::Scheme;
use cosserat_rod::rosenbrock::{RODAS4, RODAS5P, Rosenbrock};
use nalgebra::Complex;
use scalar::{amplification, rates, step};

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
    let at = |scheme: &Scheme, z: f64| amplification(scheme, Complex::from(z)).map(|entry| entry.re);
    let far = |scheme: &Scheme| {
        let matrix = at(scheme, -1e14);
        assert!(matrix[(0, 1)].abs() < 1e-13, "{matrix}");
        vec![matrix[(0, 0)], matrix[(1, 1)]]
    };
    let near = |scheme: &Scheme| {
        let matrix = at(scheme, 0.0);
        assert!(matrix[(1, 0)].abs() < 1e-13, "{matrix}");
        vec![matrix[(0, 0)], matrix[(1, 1)]]
    };
    case.check("eigenvalues of the amplification matrix at infinity", &each(&far));
    case.check("eigenvalues at z=0", &each(&near));
    let radius = |scheme: &Scheme| vec![far(scheme).iter().fold(0.0, |radius: f64, value| radius.max(value.abs()))];
    case.check("spectral radius at infinity", &each(&radius));
}

/// The end of one step of y' = tᵖ from 0 to 1.
fn quadrature(method: &Rosenbrock, p: i32) -> f64 {
    let mut increments = Vec::<f64>::new();
    for i in 0..method.stages {
        let rate = if p == 1 { method.rates[i] } else { 0.0 };
        let before: f64 = method.c[i].iter().zip(&increments).map(|(c, u)| c * u).sum();
        increments.push(method.gamma * (method.nodes[i].powi(p) + rate + before));
    }
    let [first @ .., last] = &increments[..] else { unreachable!("a method has stages") };
    method.a[method.stages - 1].iter().zip(first).map(|(a, u)| a * u).sum::<f64>() + last
}

/// The end of one step of y' = zy from 1.
fn growth(method: &Rosenbrock, z: f64) -> f64 {
    let mut increments = Vec::<f64>::new();
    let sum = |row: &[f64], increments: &[f64]| row.iter().zip(increments).map(|(a, u)| a * u).sum::<f64>();
    for i in 0..method.stages {
        let (y, before) = (1.0 + sum(method.a[i], &increments), sum(method.c[i], &increments));
        increments.push((z * y + before) / (1.0 / method.gamma - z));
    }
    1.0 + sum(method.a[method.stages - 1], &increments) + increments[method.stages - 1]
}

#[test]
fn the_coefficients_of_the_rosenbrock_methods_are_right_to_their_last_digits() {
    for method in [&RODAS4, &RODAS5P] {
        let order = method.order as i32;
        for p in 0..order {
            // coefficients of size 100, each rounded to 1e-16 of itself
            let integral = quadrature(method, p) * f64::from(p + 1);
            assert!((integral - 1.0).abs() < 1e-13, "order {order}, t^{p}: {integral}");
        }
        let miss = |z: f64| (growth(method, z) - z.exp()).abs() / z.abs().powi(order + 1);
        assert!(miss(-0.1) < 0.01, "order {order}: {}", miss(-0.1));
        // L-stable: nothing is left of what is infinitely fast
        assert!(growth(method, -1e9).abs() < 1e-7, "order {order}: {}", growth(method, -1e9));
    }
}
