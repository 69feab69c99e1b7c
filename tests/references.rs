//! Three scenes against reference solutions of a strain-mode code: the scheme's own errors at fixed cells and steps,
//! which the packaged unit is measured by.

mod common;

use common::along_x;
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::{Boundary, Support};
use cosserat_rod::mesh::Mesh;
use cosserat_rod::pose::State;
use cosserat_rod::rod::Rod;
use cosserat_rod::stepper::Stepper;
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;
use std::f64::consts::PI;

type Vec3 = Vector3<f64>;

fn read(name: &str) -> Value {
    let path = format!("{}/tests/reference/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn vectors(value: &Value) -> Vec<Vec3> {
    let vector = |v: &Value| Vec3::from_fn(|i, _| v[i].as_f64().unwrap());
    value.as_array().unwrap().iter().map(vector).collect()
}

/// sin² of half a period from `start`, `width` long.
fn pulse(t: f64, start: f64, width: f64) -> f64 {
    let x = (t - start) / width;
    if x > 0.0 && x < 1.0 { (PI * x).sin().powi(2) } else { 0.0 }
}

/// 0.02 m at 2 Hz, its amplitude faded in over half a second: position, velocity, acceleration.
fn shake(t: f64) -> [f64; 3] {
    let (amplitude, w, fade) = (0.02, 4.0 * PI, 0.5);
    let (sin, cos) = (w * t).sin_cos();
    let [r, v, a] = if t < fade {
        let k = PI / fade;
        [0.5 * (1.0 - (k * t).cos()), 0.5 * k * (k * t).sin(), 0.5 * k * k * (k * t).cos()]
    } else {
        [1.0, 0.0, 0.0]
    };
    [r * sin, v * sin + r * w * cos, a * sin + 2.0 * v * w * cos - r * w * w * sin].map(|x| amplitude * x)
}

fn boundary(scene: &str, t: f64) -> Boundary {
    let zero = Vec3::zeros();
    let hanging = Matrix3::from_diagonal(&Vec3::new(1.0, -1.0, -1.0));
    let base = Support::at_rest(zero, if scene == "S1" { along_x() } else { hanging });
    let mut boundary = Boundary::hanging_from(base, Vec3::z() * -9.81);
    match scene {
        "S2" => {
            let [x, v, a] = shake(t).map(|x| Vec3::x() * x);
            boundary.base = Support { position: x, velocity: v, acceleration: a, ..base };
        }
        "S3" => {
            boundary.tip_force = Vec3::new(0.5 * pulse(t, 0.0, 0.2), 0.3 * pulse(t, 0.1, 0.2), 0.0);
            boundary.tip_moment = Vec3::z() * (2e-3 * pulse(t, 0.0, 0.2));
        }
        _ => {}
    }
    boundary
}

#[test]
fn the_scheme_has_the_errors_that_the_packaged_unit_is_measured_by() {
    let scenes = read("scenes");
    for scene in ["S1", "S2", "S3"] {
        let (setting, reference) = (&scenes[scene], read(scene));
        let number = |name: &str| setting[name].as_f64().unwrap();
        let rod = match scene {
            "S2" => Rod::circular(1e-3, 2e11, 2e11 / 2.6, 7850.0),
            _ => Rod::circular(5e-3, 5e6, 5e6 / 3.0, 1100.0),
        };
        let mesh = Mesh::uniform(1.0, number("cells") as usize, number("stages") as usize, Vec3::zeros());
        let start = boundary(scene, 0.0);
        let state = State::at_rest_shape(&mesh, &start.base);
        let mut stepper = Stepper::new(mesh, rod, state);
        stepper.start(&start).unwrap();

        let dt = number("step");
        let (times, tips) = (&reference["t"], vectors(&reference["tip"]));
        let forces = reference.get("base_force").map(vectors);
        let (mut done, mut tip, mut force) = (0, 0.0, 0.0);
        for (i, expected) in tips.iter().enumerate().skip(1) {
            let steps = (times[i].as_f64().unwrap() / dt).round() as usize;
            for step in done + 1..=steps {
                let scheme = Scheme::from_spectral_radius(0.5);
                stepper.advance(&boundary(scene, step as f64 * dt), scheme, dt).unwrap();
            }
            done = steps;
            tip += (stepper.state.tip().position - expected).norm_squared();
            if let Some(forces) = &forces {
                force += (stepper.state.nodes[0].force - forces[i]).norm_squared();
            }
        }
        let rms = |sum: f64| (sum / (tips.len() - 1) as f64).sqrt();
        // the numbers as noted, to their digits
        assert!((rms(tip) / number("tip") - 1.0).abs() < 0.01, "{scene}, tip: {:e}", rms(tip));
        if forces.is_some() {
            assert!((rms(force) / number("force") - 1.0).abs() < 0.01, "{scene}, force: {:e}", rms(force));
        }
    }
}
