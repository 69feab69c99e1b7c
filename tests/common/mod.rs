//! What the reference cases share: reading one, laying out a rod, comparing with its own tolerances.

// every test file takes the part it needs
#![allow(dead_code)]

use cosserat_rod::boundary::{Boundary, Support};
use cosserat_rod::mesh::Mesh;
use cosserat_rod::pose::{Section, State};
use cosserat_rod::rate::{self, Options};
use cosserat_rod::rod::Rod;
use cosserat_rod::stepper::Stepper;
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;
use std::f64::consts::PI;

/// A reference case: inputs, and expected values with their tolerances.
pub struct Case {
    id: String,
    content: Value,
}

impl Case {
    /// The case of `tests/reference/<id>.json`.
    pub fn read(id: &str) -> Self {
        let path = format!("{}/tests/reference/{id}.json", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
        let content = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{path}: {error}"));
        Self { id: id.to_owned(), content }
    }

    /// A number among the inputs.
    pub fn input(&self, name: &str) -> f64 {
        self.content["inputs"][name].as_f64().unwrap_or_else(|| panic!("{}: no number {name}", self.id))
    }

    /// Numbers among the inputs; those of nested lists one after another.
    pub fn inputs(&self, name: &str) -> Vec<f64> {
        flattened(&self.content["inputs"][name])
    }

    /// The expected values of the entry whose name begins with `name`; those of nested lists one after another.
    pub fn expected(&self, name: &str) -> Vec<f64> {
        flattened(&self.entry(name)["value"])
    }

    /// Asserts that each number is within the entry's tolerance, a relative one being relative to that number.
    pub fn check(&self, name: &str, computed: &[f64]) {
        let expected = self.expected(name);
        self.compare(name, computed, &expected, |i| expected[i].abs());
    }

    /// As [`Self::check`] for vectors, a relative tolerance being relative to the length of the vector: its direction
    /// is no worse known than its length, and a component may vanish.
    pub fn check_vectors(&self, name: &str, computed: &[Vector3<f64>]) {
        let expected = self.expected(name);
        let components: Vec<f64> = computed.iter().flat_map(|v| v.iter().copied()).collect();
        self.compare(name, &components, &expected, |i| Vector3::from_column_slice(&expected[i / 3 * 3..][..3]).norm());
    }

    fn compare(&self, name: &str, computed: &[f64], expected: &[f64], size: impl Fn(usize) -> f64) {
        assert_eq!(computed.len(), expected.len(), "{}: {name}", self.id);
        let entry = self.entry(name);
        let (mut worst, mut at) = (0.0, 0);
        for i in 0..expected.len() {
            let tolerance = match (entry["tol_abs"].as_f64(), entry["tol_rel"].as_f64()) {
                (Some(absolute), None) => absolute,
                (None, Some(relative)) => relative * size(i),
                _ => panic!("{}: {name}: one tolerance, absolute or relative", self.id),
            };
            let part = (computed[i] - expected[i]).abs() / tolerance;
            if part.is_nan() || part > worst {
                (worst, at) = (part, i);
            }
        }
        println!("{}: {name}: {worst:.1e} of the tolerance", self.id);
        let (computed, expected) = (computed[at], expected[at]);
        assert!(
            // false for what is not a number
            worst <= 1.0,
            "{}: {name}, value {}: {computed} instead of {expected}: {worst:.2} times its tolerance",
            self.id,
            at + 1
        );
    }

    fn entry(&self, name: &str) -> &Value {
        let entries = self.content["expected"].as_array().into_iter().flatten();
        let mut named = entries.filter(|entry| entry["name"].as_str().is_some_and(|full| full.starts_with(name)));
        match (named.next(), named.next()) {
            (Some(entry), None) => entry,
            _ => panic!("{}: no entry, or more than one, begins with {name}", self.id),
        }
    }
}

fn flattened(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(values) => values.iter().flat_map(flattened).collect(),
        _ => vec![value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))],
    }
}

/// R(0) of a rod that leaves its base along +x: d₁ = −z, d₂ = +y, d₃ = +x.
pub fn along_x() -> Matrix3<f64> {
    Matrix3::from_columns(&[-Vector3::z(), Vector3::y(), Vector3::x()])
}

/// A rod of unit mass per length without shear, stretch, damping or rotary inertia.
pub fn kirchhoff(bending: f64, twist: f64) -> Rod {
    Rod {
        stiffness: Vector3::new(bending, bending, twist),
        mass_per_length: 1.0,
        inertia_per_length: Vector3::zeros(),
        ..Rod::circular(1.0, 1.0, 1.0, 1.0)
    }
}

/// A hair fibre, A = 1.5e-5 cm²; 25 cm of it are released.
pub fn hair() -> Rod {
    Rod::circular((1.5e-9 / PI).sqrt(), 3.89e9, 0.89e9, 1320.0)
}

/// A rubber cord of 1 cm; 1 m of it is released.
pub fn rubber() -> Rod {
    Rod::circular(5e-3, 5e6, 5e6 / 3.0, 1100.0)
}

/// A base at rest in the origin, no load, no gravity.
pub fn clamped(rotation: Matrix3<f64>) -> Boundary {
    let zero = Vector3::zeros();
    Boundary::hanging_from(Support::at_rest(zero, rotation), zero)
}

/// The unstressed rod on the base of `boundary`.
pub fn unstressed(mesh: Mesh, rod: Rod, boundary: &Boundary) -> Stepper {
    let state = State::at_rest_shape(&mesh, &boundary.base);
    Stepper::new(mesh, rod, state)
}

/// The same, set to be stepped by the pose formulation.
pub fn by_poses(mesh: Mesh, rod: Rod, boundary: &Boundary) -> Stepper {
    let mut stepper = unstressed(mesh, rod, boundary);
    stepper.start(boundary).expect("accelerations at the start");
    stepper
}

/// The same by the rate formulation.
pub fn by_rates(mesh: Mesh, rod: Rod, boundary: &Boundary, options: Options) -> rate::Stepper {
    rate::Stepper::new(mesh, rod, boundary, options).expect("no shear, stretch, damping or body at the tip")
}

/// Angle of the tangent in the x-y plane, counted from +x; unwound by the caller where it may pass π.
pub fn angle(rotation: &Matrix3<f64>) -> f64 {
    f64::atan2(rotation[(1, 2)], rotation[(0, 2)])
}

/// As [`angle`] at the tip, followed along the rod so that full turns count.
pub fn tip_angle(stepper: &Stepper) -> f64 {
    let nodes = &stepper.state.nodes;
    let turn = |pair: &[Section]| angle(&(pair[1].rotation * pair[0].rotation.transpose() * along_x()));
    angle(&nodes[0].rotation) + nodes.windows(2).map(turn).sum::<f64>()
}

/// The slope of ln y over ln x by least squares: an observed order.
pub fn fitted_order(x: &[f64], y: &[f64]) -> f64 {
    let mean = |values: &[f64]| values.iter().map(|v| v.ln()).sum::<f64>() / values.len() as f64;
    let (x_mean, y_mean) = (mean(x), mean(y));
    let covariance: f64 = x.iter().zip(y).map(|(x, y)| (x.ln() - x_mean) * (y.ln() - y_mean)).sum();
    covariance / x.iter().map(|x| (x.ln() - x_mean).powi(2)).sum::<f64>()
}

/// Polynomial from 0 to 1 whose first four derivatives vanish at both ends, with its first two derivatives.
pub fn ramp(x: f64) -> [f64; 3] {
    if x <= 0.0 {
        return [0.0; 3];
    }
    if x >= 1.0 {
        return [1.0, 0.0, 0.0];
    }
    let y = 1.0 - x;
    let value = x.powi(5) * (126.0 - 420.0 * x + 540.0 * x * x - 315.0 * x.powi(3) + 70.0 * x.powi(4));
    let slope = 630.0 * (x * y).powi(4);
    [value, slope, 2520.0 * (x * y).powi(3) * (1.0 - 2.0 * x)]
}
