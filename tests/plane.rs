//! The rod in a plane: references, orders in time and space, the spatial rod beside it, energy, and the honesty of the
//! error estimate.

mod common;

use common::{along_x, fitted_order, ramp};
use cosserat_rod::boundary::{Boundary, Drive, Rates, Support};
use cosserat_rod::energy::Energy;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::plane::Plane;
use cosserat_rod::pose::State;
use cosserat_rod::rod::Rod;
use cosserat_rod::rosenbrock::{RODAS4, RODAS5P, Rosenbrock};
use cosserat_rod::runge_kutta::ESDIRK4;
use cosserat_rod::so3;
use cosserat_rod::stepper::Stepper;
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;
use std::f64::consts::PI;

type Vec3 = Vector3<f64>;

const METHODS: [&Rosenbrock; 2] = [&RODAS4, &RODAS5P];

fn hanging() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vec3::new(-1.0, 1.0, -1.0))
}

/// A drive in the x-z plane whose rates are the derivatives of the rest, by differences of fourth order: smooth enough
/// for every order measured here.
fn with_rates(boundary: impl Fn(f64) -> Boundary, t: f64) -> Drive {
    let step = 2e-4;
    let rate = |of: fn(&Boundary) -> Vec3| {
        let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(|i| of(&boundary(t + i * step)));
        ((c - b) * 8.0 - (d - a)) / (12.0 * step)
    };
    let rates = Rates {
        jerk: rate(|boundary| boundary.base.acceleration),
        angular_acceleration: rate(|boundary| boundary.base.angular_velocity),
        tip_force: rate(|boundary| boundary.tip_force),
        tip_moment: rate(|boundary| boundary.tip_moment),
    };
    Drive { boundary: boundary(t), rates }
}

/// A base that shifts and turns, and loads on the tip, all smooth and beginning at rest.
fn busy(t: f64) -> Boundary {
    let duration = 0.8;
    let [x, v, a] = ramp(t / duration);
    let angle = 0.5 * x;
    let base = Support {
        position: Vec3::new(0.15 * x, 0.0, 0.0),
        velocity: Vec3::new(0.15 * v / duration, 0.0, 0.0),
        acceleration: Vec3::new(0.15 * a / duration.powi(2), 0.0, 0.0),
        angular_velocity: Vec3::y() * (0.5 * v / duration),
        ..Support::at_rest(Vec3::zeros(), so3::exp(&(Vec3::y() * angle)) * hanging())
    };
    Boundary {
        tip_force: Vec3::new(0.1 * x, 0.0, -0.05 * x),
        tip_moment: Vec3::y() * (1e-3 * x),
        ..Boundary::hanging_from(base, Vec3::z() * -9.81)
    }
}

/// The same without anything that turns the base.
fn shifted(t: f64) -> Boundary {
    let boundary = busy(t);
    let base = Support { rotation: hanging(), angular_velocity: Vec3::zeros(), ..boundary.base };
    Boundary { base, ..boundary }
}

fn soft() -> Rod {
    Rod::circular(5e-3, 5e6, 5e6 / 3.0, 1100.0)
}

fn damped() -> Rod {
    Rod { damping: Vec3::new(0.01, 0.01, 0.01), drag: 0.05, tip_inertia: 1e-5, ..soft() }
}

fn weighted() -> Rod {
    Rod { tip_mass: 0.02, tip_inertia: 1e-5, ..soft() }
}

fn started(mesh: &Mesh, rod: &Rod, boundary: impl Fn(f64) -> Boundary, method: &'static Rosenbrock) -> Plane {
    let drive = with_rates(&boundary, 0.0);
    let mut plane = Plane::of(mesh, rod, &drive, method).expect("a plane rod");
    plane.start(&drive).unwrap();
    plane
}

/// Tip position, tip velocity, force and moment on the base.
fn record(plane: &Plane) -> [Vec3; 4] {
    let (tip, (force, moment)) = (plane.tip(), plane.reaction());
    [tip.position, tip.velocity, force, moment]
}

/// The records at every sixth part of `steps` equal steps.
fn run(
    mesh: &Mesh,
    rod: &Rod,
    boundary: impl Fn(f64) -> Boundary + Copy,
    method: &'static Rosenbrock,
    (steps, duration): (usize, f64),
) -> Vec<[Vec3; 4]> {
    let mut plane = started(mesh, rod, boundary, method);
    let h = duration / steps as f64;
    let mut records = Vec::new();
    for i in 0..steps {
        plane.attempt(&|t| with_rates(boundary, i as f64 * h + t), h).unwrap();
        plane.accept();
        if (i + 1) % (steps / 6) == 0 {
            plane.look(1.0, &with_rates(boundary, (i + 1) as f64 * h));
            records.push(record(&plane));
        }
    }
    records
}

/// The largest differences.
fn distance(a: &[[Vec3; 4]], b: &[[Vec3; 4]]) -> [f64; 4] {
    std::array::from_fn(|q| a.iter().zip(b).map(|(a, b)| (a[q] - b[q]).norm()).fold(0.0, f64::max))
}

fn orders(sizes: &[f64], errors: &[[f64; 4]]) -> [f64; 4] {
    std::array::from_fn(|q| fitted_order(sizes, &errors.iter().map(|e| e[q]).collect::<Vec<_>>()))
}

#[test]
fn the_orders_in_time() {
    // straight and at rest: a release would excite the stiffest waves, which no step here follows
    let mesh = Mesh::uniform(1.0, 2, 3, Vec3::zeros());
    let scenes = [
        (soft(), busy as fn(f64) -> Boundary, [[240, 360, 480], [240, 360, 480]]),
        (damped(), busy, [[96, 120, 180], [60, 96, 120]]),
        (weighted(), shifted, [[240, 360, 480], [180, 240, 300]]),
    ];
    for (rod, boundary, counts) in scenes {
        let reference = run(&mesh, &rod, boundary, &RODAS5P, (2400, 0.6));
        for (method, steps) in METHODS.into_iter().zip(counts) {
            let errors = steps.map(|n| distance(&run(&mesh, &rod, boundary, method, (n, 0.6)), &reference));
            let found = orders(&steps.map(|n| 1.0 / n as f64), &errors);
            for (order, error) in found.iter().zip(errors[2]) {
                // steps that are not small yet show the next order, and rounding ends it
                let reached = *order > f64::from(method.order) - 0.4 || error < 5e-9;
                assert!(reached, "{} in time: {found:.2?}, {errors:?}", method.order);
            }
        }
    }
}

#[test]
fn the_orders_in_space() {
    // damped, so that the finest waves are smooth on the coarsest mesh
    let rod = Rod { damping: Vec3::new(0.01, 0.01, 0.01), ..Rod::circular(5e-3, 5e7, 5e7 / 3.0, 1100.0) };
    let mesh = |cells, stages| Mesh::uniform(1.0, cells, stages, Vec3::zeros());
    let reference = run(&mesh(24, 4), &rod, busy, &RODAS5P, (300, 0.6));
    for (stages, cells) in (1..).zip([[30, 40, 60], [16, 20, 32], [10, 12, 16], [6, 8, 10]]) {
        let errors = cells.map(|n| distance(&run(&mesh(n, stages), &rod, busy, &RODAS5P, (300, 0.6)), &reference));
        let found = orders(&cells.map(|n| 1.0 / n as f64), &errors);
        // the higher orders are reached from below: the shortest waves are just resolved
        let expected = 2.0 * stages as f64;
        let reached = found.iter().all(|order| *order > expected - 0.2 * stages as f64);
        assert!(reached, "{stages} stages in space: {found:.2?} {errors:?}");
    }
}

#[test]
fn the_spatial_rod_of_the_same_mesh_goes_where_the_plane_one_goes() {
    let mesh = Mesh::uniform(1.0, 2, 3, Vec3::y() * 0.3);
    // both ways in steps so short that their errors are below the bounds, and not so short that the roundings of the
    // iteration are above them
    let duration = 0.3;
    let (loaded, viscous) = (Rod { tip_mass: 0.02, ..soft() }, Rod { tip_inertia: 0.0, ..damped() });
    let heavy = Rod { tip_mass: 0.02, ..damped() };
    for (rod, boundary, steps) in [
        (soft(), shifted as fn(f64) -> Boundary, 4800),
        (damped(), shifted, 4800),
        (weighted(), shifted, 2400),
        (heavy.clone(), shifted, 4800),
        (soft(), busy, 4800),
        (viscous, busy, 7200),
        (loaded, busy, 4800),
        (heavy, busy, 4800),
    ] {
        let mut stepper = Stepper::new(mesh.clone(), rod.clone(), State::at_rest_shape(&mesh, &boundary(0.0).base));
        stepper.start(&boundary(0.0)).unwrap();
        let dt = duration / steps as f64;
        for i in 0..steps {
            let begin = i as f64 * dt;
            stepper.attempt(&ESDIRK4, &|since| boundary(begin + since), dt, 1e-13).unwrap();
            stepper.accept();
        }
        let state = &stepper.state;
        let base = &state.nodes[0];
        let spatial = [[state.tip().position, state.tip_memory().travel.velocity.value, base.force, base.moment]];
        // a length of 1 m, √(g L), the weight and the force at the tip
        let load = (rod.mass_per_length + rod.tip_mass) * 9.81 + 0.1f64.hypot(0.05);
        let scales = [1.0, 9.81f64.sqrt(), load, load];
        // the tip of the spatial rod turns with a base whose way no stage integrates: what its inertia adds to the
        // reaction is of first order
        let turned = boundary(0.3).base.angular_velocity != Vec3::zeros();
        let reaction = if turned && rod.tip_inertia > 0.0 { 3e-8 } else { 1e-9 };
        for method in METHODS {
            // a derivative left out lowers the order of a plane rod with drag and a body at its tip
            if method.order == 4 && rod.tip_mass * rod.drag > 0.0 {
                continue;
            }
            let plane = run(&mesh, &rod, boundary, method, (steps, duration));
            let found = distance(&spatial, &plane[5..]);
            for ((found, scale), bound) in found.iter().zip(scales).zip([1e-9, 1e-9, reaction, 1e-9]) {
                assert!(found / scale < bound, "order {}, turned: {turned}, {rod:?}: {found:e}", method.order);
            }
        }
    }
}

#[test]
fn energy_balances_to_the_order_in_time() {
    let mesh = Mesh::uniform(1.0, 2, 3, Vec3::y() * 0.3);
    for (rod, boundary) in [(soft(), busy as fn(f64) -> Boundary), (damped(), busy), (weighted(), busy)] {
        for (method, counts) in METHODS.into_iter().zip([[160, 240, 320], [120, 160, 240]]) {
            let imbalance = counts.map(|steps| {
                let mut plane = started(&mesh, &rod, boundary, method);
                let h = 0.6 / steps as f64;
                let start = plane.energy();
                let mut energy = start;
                for i in 0..steps {
                    let at = |t: f64| with_rates(boundary, i as f64 * h + t);
                    let power = plane.power();
                    plane.attempt(&at, h).unwrap();
                    plane.accept();
                    plane.look(0.5, &at(0.5 * h));
                    let middle = plane.power();
                    plane.look(1.0, &at(h));
                    let end = plane.power();
                    let mean = |of: fn(&cosserat_rod::energy::Powers) -> f64| {
                        h / 6.0 * (of(&power) + 4.0 * of(&middle) + of(&end))
                    };
                    energy = Energy {
                        work_base: energy.work_base + mean(|power| power.base),
                        work_tip: energy.work_tip + mean(|power| power.tip),
                        dissipated: energy.dissipated + mean(|power| power.lost),
                        ..plane.energy()
                    };
                }
                energy.residual(&start).abs()
            });
            // of some 0.1 J: the error of the step, or that of Simpson's rule on a power known to the order of the
            // estimate; where the two cancel, a fitted order would say nothing
            let falls = imbalance[2] < 0.3 * imbalance[0] || imbalance[0] < 2e-9;
            assert!(imbalance[2] < 2e-9 && falls, "order {}: {imbalance:?}", method.order);
        }
    }
}

#[test]
fn the_estimate_is_of_the_size_of_the_error() {
    let mesh = Mesh::uniform(1.0, 2, 3, Vec3::zeros());
    for method in METHODS {
        for rod in [soft(), damped()] {
            let h = 0.6 / 40.0;
            let mut plane = started(&mesh, &rod, busy, method);
            let mut ratios = Vec::new();
            for i in 0..40 {
                let at = |t: f64| with_rates(busy, i as f64 * h + t);
                let mut fine = plane.clone();
                for j in 0..10 {
                    let h = h / 10.0;
                    fine.attempt(&|t| at(j as f64 * h + t), h).unwrap();
                    fine.accept();
                }
                let estimate = plane.attempt(&at, h).unwrap();
                plane.accept();
                plane.look(1.0, &at(h));
                fine.look(1.0, &at(h));
                let error = (0..=20).map(|k| (plane.position(k as f64 / 20.0) - fine.position(k as f64 / 20.0)).norm());
                let error = error.fold(0.0, f64::max);
                ratios.push((estimate.position / error, estimate.velocity / error, error));
            }
            // an error that passes zero makes a ratio as large as one likes: the middle one counts, and the least. The
            // estimate is the error of the lower order and exceeds that of the step by 10 or so
            ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
            let (least, middle) = (ratios[0].0, ratios[ratios.len() / 2].0);
            assert!(least > 0.2 && (1.0..50.0).contains(&middle), "order {}: {least:.2} {middle:.2}", method.order);
        }
    }
}

#[test]
fn a_rod_leaves_its_plane_without_a_jump_and_comes_back() {
    let mesh = Mesh::uniform(1.0, 3, 4, Vec3::y() * 0.3);
    for (rod, boundary) in [(damped(), busy as fn(f64) -> Boundary), (weighted(), shifted)] {
        let mut plane = started(&mesh, &rod, boundary, &RODAS4);
        let h = 1e-3;
        for i in 0..300 {
            plane.attempt(&|t| with_rates(boundary, i as f64 * h + t), h).unwrap();
            plane.accept();
        }
        let mut state = State::at_rest_shape(&mesh, &boundary(0.0).base);
        plane.write(&mut state);
        let (force, moment) = plane.reaction();
        let gravity = Vec3::z() * -9.81;
        let (there, here) = (Energy::of(&mesh, &rod, &state, &gravity), plane.energy());
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * (1.0 + b.abs()), "{a} {b}");
        near((state.nodes[0].force - force).norm(), 0.0);
        near((state.nodes[0].moment - moment).norm(), 0.0);
        near(there.kinetic, here.kinetic);
        near(there.elastic, here.elastic);
        near(there.gravity, here.gravity);

        // the spatial rod finds the same accelerations for itself
        let mut stepper = Stepper::new(mesh.clone(), rod.clone(), state.clone());
        if boundary(0.3).base.angular_velocity == Vec3::zeros() {
            stepper.start(&with_rates(boundary, 0.3).boundary).unwrap();
            let largest = state.memory.iter().map(|b| b.spin.acceleration.value.norm()).fold(0.0, f64::max);
            for (a, b) in stepper.state.memory.iter().zip(&state.memory) {
                // β of the step is as exact as the step
                assert!((a.spin.acceleration.value - b.spin.acceleration.value).norm() < 1e-4 * largest);
            }
        }

        let now = with_rates(boundary, 0.3);
        let mut back = Plane::new(&mesh, &rod, &RODAS4);
        assert!(back.enter(&state, &now));
        back.start(&now).unwrap();
        let [position, velocity, force, moment] = distance(&[record(&back)], &[record(&plane)]);
        near(position + velocity, 0.0);
        // again as exact as β
        assert!(force < 1e-4 && moment < 1e-4, "{force} {moment}");

        // out of the plane there is none
        let memory = &mut state.memory[0].spin.velocity;
        memory.value += Vec3::new(1e-3, 0.0, 0.0);
        assert!(!back.enter(&state, &now));
    }
}

fn read(name: &str) -> Value {
    let path = format!("{}/tests/reference/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn vectors(value: &Value) -> Vec<Vec3> {
    let vector = |v: &Value| Vec3::from_fn(|i, _| v[i].as_f64().unwrap());
    value.as_array().unwrap().iter().map(vector).collect()
}

/// The wire on its base: 2 cm at 2 Hz, faded in over half a second.
fn shaken(t: f64) -> Boundary {
    let (amplitude, w, k) = (0.02, 4.0 * PI, 2.0 * PI);
    let (sin, cos) = (w * t).sin_cos();
    let fade = if t < 0.5 {
        [0.5 * (1.0 - (k * t).cos()), 0.5 * k * (k * t).sin(), 0.5 * k * k * (k * t).cos()]
    } else {
        [1.0, 0.0, 0.0]
    };
    let [r, v, a] = fade;
    let base = Support {
        position: Vec3::x() * (amplitude * r * sin),
        velocity: Vec3::x() * (amplitude * (v * sin + r * w * cos)),
        acceleration: Vec3::x() * (amplitude * (a * sin + 2.0 * v * w * cos - r * w * w * sin)),
        ..Support::at_rest(Vec3::zeros(), hanging())
    };
    Boundary::hanging_from(base, Vec3::z() * -9.81)
}

fn released(_: f64) -> Boundary {
    Boundary::hanging_from(Support::at_rest(Vec3::zeros(), along_x()), Vec3::z() * -9.81)
}

#[test]
fn the_references() {
    let wire = Rod::circular(1e-3, 2e11, 2e11 / 2.6, 7850.0);
    for (name, rod, boundary, cells, steps) in
        [("S1", soft(), released as fn(f64) -> Boundary, 12, 2000), ("S2", wire, shaken, 3, 200)]
    {
        let reference = read(name);
        let (times, tips) = (&reference["t"], vectors(&reference["tip"]));
        for method in METHODS {
            let mesh = Mesh::uniform(1.0, cells, 4, Vec3::zeros());
            let mut plane = started(&mesh, &rod, boundary, method);
            let last = times[tips.len() - 1].as_f64().unwrap();
            let h = last / steps as f64;
            let (mut sum, mut i) = (0.0, 1);
            for step in 0..steps {
                let begin = step as f64 * h;
                let at = |t: f64| with_rates(boundary, begin + t);
                plane.attempt(&at, h).unwrap();
                plane.accept();
                while i < tips.len() && times[i].as_f64().unwrap() <= begin + h * (1.0 + 1e-9) {
                    let t = times[i].as_f64().unwrap() - begin;
                    plane.look((t / h).min(1.0), &at(t));
                    sum += (plane.tip().position - tips[i]).norm_squared();
                    i += 1;
                }
            }
            assert_eq!(i, tips.len());
            // S1: the cells, 1.1e-5; S2: the steps, 2.5e-6 at order 4
            let error = (sum / (tips.len() - 1) as f64).sqrt();
            assert!(error < [2e-5, 4e-6][usize::from(name == "S2")], "{name}, order {}: {error:e}", method.order);
        }
    }
}
