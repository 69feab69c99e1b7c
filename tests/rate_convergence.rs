//! Orders of the rate formulation, fitted, against the pose formulation and against itself; the third solutions of
//! `tests/reference`.

mod common;
// every test file takes the part it needs
#[allow(dead_code)]
#[path = "../src/cli/chart/scenes.rs"]
mod scenes;

use common::{along_x, fitted_order, ramp};
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::{Boundary, Support};
use cosserat_rod::formulation::Formulation;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::pose::{Section, State};
use cosserat_rod::rate::{Curvature, Options, Positions, Stepper};
use cosserat_rod::rod::Rod;
use cosserat_rod::stepper;
use nalgebra::Vector3;
use scenes::Scene;
use serde_json::Value;
use std::f64::consts::PI;

type Vec3 = Vector3<f64>;

const DURATION: f64 = 0.4;

/// Smooth motions of a rubber rod of 1 m.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    /// In the plane: without gravity, a force on the tip.
    Planar,
    /// In space: a force and a moment on the tip.
    Pulse,
    /// The same of a helix.
    Helix,
    /// The base moved sideways and back.
    Shaken,
}

impl Motion {
    const ALL: [Self; 4] = [Self::Planar, Self::Pulse, Self::Helix, Self::Shaken];

    fn kappa(self) -> Vec3 {
        if self == Self::Helix { Vec3::new(3.0, 0.0, 1.5) } else { Vec3::zeros() }
    }

    fn boundary(self, t: f64) -> Boundary {
        let pulse = |begin: f64| {
            let x = (t - begin) / 0.3;
            if x > 0.0 && x < 1.0 { (PI * x).sin().powi(6) } else { 0.0 }
        };
        let mut boundary = Boundary::hanging_from(Support::at_rest(Vec3::zeros(), along_x()), Vec3::zeros());
        match self {
            Self::Planar => boundary.tip_force.z = 0.05 * pulse(0.0),
            Self::Pulse | Self::Helix => {
                boundary.tip_force = Vec3::new(0.0, 0.04 * pulse(0.05), 0.05 * pulse(0.0));
                boundary.tip_moment = Vec3::x() * (1e-3 * pulse(0.0));
            }
            Self::Shaken => {
                let (reach, duration) = (0.1, 0.4);
                let [x, v, a] = ramp(t / duration);
                boundary.base.position.z = reach * x;
                boundary.base.velocity.z = reach * v / duration;
                boundary.base.acceleration.z = reach * a / duration.powi(2);
            }
        }
        boundary
    }
}

fn rod() -> Rod {
    Rod::circular(5e-3, 5e7, 5e7 / 3.0, 1100.0)
}

/// Tip position, base force and base moment at 20 instants.
type Record = Vec<[Vec3; 3]>;

/// The times of equal steps, and of steps that are in turn longer and shorter by `uneven` of their mean.
fn times(steps: usize, uneven: f64) -> Vec<f64> {
    let late = |i: usize| if i % 2 == 1 { uneven } else { 0.0 };
    (0..=steps).map(|i| (i as f64 + late(i)) * DURATION / steps as f64).collect()
}

fn record(rod: &mut impl Formulation, motion: Motion, scheme: Scheme, times: &[f64]) -> Record {
    let steps = times.len() - 1;
    let mut record = Vec::new();
    for i in 1..=steps {
        rod.step(&motion.boundary(times[i]), scheme, times[i] - times[i - 1]).unwrap();
        if i % (steps / 20) == 0 {
            let Section { force, moment, .. } = rod.section(0);
            record.push([rod.tip().position, force, moment]);
        }
    }
    record
}

fn rate(motion: Motion, options: Options, scheme: Scheme, steps: usize, cells: usize) -> Record {
    rate_at(&times(steps, 0.0), motion, options, scheme, cells)
}

fn rate_at(times: &[f64], motion: Motion, options: Options, scheme: Scheme, cells: usize) -> Record {
    let mesh = Mesh::uniform(1.0, cells, 1, motion.kappa());
    let mut stepper = Stepper::new(mesh, rod(), &motion.boundary(0.0), options).unwrap();
    record(&mut stepper, motion, scheme, times)
}

fn pose(motion: Motion, scheme: Scheme, steps: usize, cells: usize, stages: usize) -> Record {
    let mesh = Mesh::uniform(1.0, cells, stages, motion.kappa());
    let start = motion.boundary(0.0);
    let state = State::at_rest_shape(&mesh, &start.base);
    let mut stepper = stepper::Stepper::new(mesh, rod(), state);
    stepper.start(&start).unwrap();
    record(&mut stepper, motion, scheme, &times(steps, 0.0))
}

/// Largest differences of two records in their quantities.
fn distance(a: &Record, b: &Record) -> [f64; 3] {
    std::array::from_fn(|q| a.iter().zip(b).map(|(x, y)| (x[q] - y[q]).norm()).fold(0.0, f64::max))
}

/// The fitted orders of the distances of `runs` from `exact`.
fn orders(sizes: &[usize], exact: &Record, run: impl Fn(usize) -> Record) -> [f64; 3] {
    let errors: Vec<[f64; 3]> = sizes.iter().map(|size| distance(&run(*size), exact)).collect();
    let sizes: Vec<f64> = sizes.iter().map(|size| 1.0 / *size as f64).collect();
    std::array::from_fn(|q| fitted_order(&sizes, &errors.iter().map(|error| error[q]).collect::<Vec<_>>()))
}

#[test]
fn second_order_to_the_pose_formulation_in_time_and_space_together() {
    for motion in Motion::ALL {
        let exact = pose(motion, Scheme::from_spectral_radius(0.5), 1280, 6, 4);
        for radius in [0.0, 0.5] {
            let scheme = Scheme::from_spectral_radius(radius);
            // steps as many as cells: 160 of each and less
            let orders = orders(&[80, 120, 160], &exact, |n| rate(motion, Options::MENDED, scheme, n, n));
            // the two errors have either sign, and a force may stand where they cancel
            assert!((orders[0] - 2.0).abs() < 0.1, "{motion:?}, radius {radius}: {orders:.2?}");
            assert!(orders.iter().all(|order| (order - 2.0).abs() < 0.3), "{motion:?}, radius {radius}: {orders:.2?}");
        }
    }
}

#[test]
fn second_order_in_time() {
    for motion in Motion::ALL {
        for radius in [0.0, 0.5] {
            let scheme = Scheme::from_spectral_radius(radius);
            let exact = rate(motion, Options::MENDED, scheme, 960, 40);
            let orders = orders(&[120, 160, 240], &exact, |n| rate(motion, Options::MENDED, scheme, n, 40));
            assert!(orders.iter().all(|order| (order - 2.0).abs() < 0.15), "{motion:?}, radius {radius}: {orders:.2?}");
        }
    }
}

#[test]
fn second_order_where_every_step_is_another() {
    for motion in Motion::ALL {
        for radius in [0.0, 0.5] {
            let scheme = Scheme::from_spectral_radius(radius);
            let exact = rate(motion, Options::MENDED, scheme, 960, 40);
            // a step is three times the one before, or a third of it
            let run = |n| rate_at(&times(n, 0.5), motion, Options::MENDED, scheme, 40);
            let orders = orders(&[120, 160, 240], &exact, run);
            // 1.2 where the auxiliary rates are taken as they are
            assert!(orders.iter().all(|order| (order - 2.0).abs() < 0.25), "{motion:?}, radius {radius}: {orders:.2?}");
        }
    }
}

#[test]
fn second_order_in_space_with_the_mean_curvature_and_first_with_that_of_a_node() {
    for motion in Motion::ALL {
        let scheme = Scheme::from_spectral_radius(0.5);
        for (curvature, expected) in [(Curvature::Mean, 2.0), (Curvature::First, 1.0)] {
            let options = Options { curvature, ..Options::MENDED };
            let exact = rate(motion, Options::MENDED, scheme, 60, 320);
            let orders = orders(&[40, 60, 80], &exact, |n| rate(motion, options, scheme, 60, n));
            // forces know the orientation through the loads of the tip only, as far as it bends
            assert!((orders[0] - expected).abs() < 0.1, "{motion:?}, {curvature:?}: {orders:.2?}");
            assert!(
                orders[1..].iter().all(|order| (order - 2.0).abs() < 0.2),
                "{motion:?}, {curvature:?}: {orders:.2?}"
            );
        }
    }
}

#[test]
fn the_parameters_of_the_papers_examples_are_first_order_and_implicit_euler() {
    let printed = Scheme { alpha: 0.3, beta: 0.0, gamma: 0.7 };
    // line 24 integrates with γ, which makes positions another first-order solution: all but them
    let options = Options { positions: Positions::Rebuilt, ..Options::AS_PRINTED };
    let run = |scheme, n| rate(Motion::Pulse, options, scheme, n, 20);
    let difference = distance(&run(printed, 80), &run(Scheme::BACKWARD_EULER, 80));
    // iterate by iterate the same up to rounding
    assert!(difference.iter().all(|d| *d < 1e-12), "{difference:?}");
    let exact = rate(Motion::Pulse, options, printed, 1920, 20);
    let orders = orders(&[240, 320, 480], &exact, |n| run(printed, n));
    // a reference with a quarter of the finest error: slopes up to 1.2
    assert!(orders.iter().all(|order| (0.8..1.3).contains(order)), "{orders:.2?}");
}

/// RMS distances of the tip and of the force at the base from a reference solution, with 40 cells in steps of 2.5 ms.
fn distance_from_reference(scene: Scene, file: &str) -> (f64, Option<f64>) {
    let path = format!("{}/tests/reference/{file}.json", env!("CARGO_MANIFEST_DIR"));
    let reference: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let vectors = |name: &str| -> Option<Vec<Vec3>> {
        let vector = |v: &Value| Vec3::from_fn(|i, _| v[i].as_f64().unwrap());
        Some(reference[name].as_array()?.iter().map(vector).collect())
    };
    let (dt, mesh) = (2.5e-3, Mesh::uniform(1.0, 40, 1, Vec3::zeros()));
    let mut stepper = Stepper::new(mesh, scene.rod(), &scene.boundary(0.0), Options::MENDED).unwrap();
    let (tips, forces) = (vectors("tip").unwrap(), vectors("base_force"));
    let (mut done, mut tip, mut force) = (0, 0.0, 0.0);
    for (i, expected) in tips.iter().enumerate().skip(1) {
        let steps = (reference["t"][i].as_f64().unwrap() / dt).round() as usize;
        for step in done + 1..=steps {
            stepper.step(&scene.boundary(step as f64 * dt), Scheme::from_spectral_radius(0.5), dt).unwrap();
        }
        done = steps;
        tip += (stepper.tip().position - expected).norm_squared();
        force += forces.as_ref().map_or(0.0, |forces| (stepper.section(0).force - forces[i]).norm_squared());
    }
    let rms = |sum: f64| (sum / (tips.len() - 1) as f64).sqrt();
    (rms(tip), forces.map(|_| rms(force)))
}

#[test]
fn the_third_solutions_are_met() {
    // the numbers as measured, to a tenth
    for (scene, file, tip, force) in [
        (Scene::Rope, "S1", 1.66e-3, None),
        (Scene::Wire, "S2", 2.73e-5, Some(1.29e-4)),
        (Scene::Pulse, "S3", 6.66e-3, None),
    ] {
        let found = distance_from_reference(scene, file);
        assert!((found.0 / tip - 1.0).abs() < 0.1, "{scene:?}: {found:?}");
        assert_eq!(found.1.is_some(), force.is_some());
        assert!(
            found.1.zip(force).is_none_or(|(found, force)| (found / force - 1.0).abs() < 0.1),
            "{scene:?}: {found:?}"
        );
    }
}
