//! The one-parameter family of the time scheme on x' = λx, where its order and its spectral radius are known.

mod common;
#[path = "common/scalar.rs"]
mod scalar;

use common::Case;
use cosserat_rod::alpha::Scheme;
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
