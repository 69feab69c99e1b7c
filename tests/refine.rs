//! Cells that choose themselves: the honesty of their estimate, changes that move nothing, and runs and equilibria that
//! meet their tolerance.

mod common;

use common::along_x;
use cosserat_rod::boundary::{Boundary, Drive, Held, Rates, Support};
use cosserat_rod::energy::Energy;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::plane::Plane;
use cosserat_rod::pose::State;
use cosserat_rod::refine::Refiner;
use cosserat_rod::rod::Rod;
use cosserat_rod::rosenbrock::RODAS4;
use cosserat_rod::runge_kutta::ESDIRK4;
use cosserat_rod::so3;
use cosserat_rod::stepper::Stepper;
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;
use std::f64::consts::PI;

type Vec3 = Vector3<f64>;

fn soft() -> Rod {
    Rod::circular(5e-3, 5e6, 5e6 / 3.0, 1100.0)
}

/// With all that the equations have a term for.
fn laden() -> Rod {
    Rod { damping: Vec3::new(0.01, 0.01, 0.01), tip_mass: 0.02, tip_inertia: 1e-5, drag: 0.02, ..soft() }
}

fn hanging() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vec3::new(-1.0, 1.0, -1.0))
}

fn released() -> Boundary {
    Boundary::hanging_from(Support::at_rest(Vec3::zeros(), along_x()), Vec3::z() * -9.81)
}

fn still(boundary: Boundary) -> Drive {
    Drive { boundary, rates: Rates::default() }
}

/// The hanging cord whose tip a pulse of force and moment hits, out of every plane.
fn struck(time: f64) -> Boundary {
    let pulse = |time: f64| if (0.0..0.2).contains(&time) { (PI * time / 0.2).sin().powi(2) } else { 0.0 };
    Boundary {
        tip_force: Vec3::new(0.5 * pulse(time), 0.3 * pulse(time - 0.1), 0.0),
        tip_moment: Vec3::z() * (2e-3 * pulse(time)),
        ..Boundary::hanging_from(Support::at_rest(Vec3::zeros(), hanging()), Vec3::z() * -9.81)
    }
}

/// Times and tips.
fn reference(name: &str) -> Vec<(f64, Vec3)> {
    let path = format!("{}/tests/reference/{name}.json", env!("CARGO_MANIFEST_DIR"));
    let content: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let vector = |v: &Value| Vec3::from_fn(|i, _| v[i].as_f64().unwrap());
    let (times, tips) = (content["t"].as_array().unwrap(), content["tip"].as_array().unwrap());
    times.iter().zip(tips).map(|(t, tip)| (t.as_f64().unwrap(), vector(tip))).collect()
}

fn root_mean_square(errors: &[f64]) -> f64 {
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
}

/// A plane rod released from the horizontal.
fn falling(mesh: &Mesh, rod: &Rod) -> Plane {
    let drive = still(released());
    let mut plane = Plane::of(mesh, rod, &drive, &RODAS4).expect("a plane rod");
    plane.start(&drive).unwrap();
    plane
}

/// A rod that was struck for `duration`, in steps of 1 ms.
fn after_the_pulse(mesh: &Mesh, rod: &Rod, duration: f64) -> Stepper {
    let state = State::at_rest_shape(mesh, &struck(0.0).base);
    let mut stepper = Stepper::new(mesh.clone(), rod.clone(), state);
    stepper.start(&struck(0.0)).unwrap();
    for i in 0..(duration / 1e-3).round() as usize {
        stepper.attempt(&ESDIRK4, &|t| struck(i as f64 * 1e-3 + t), 1e-3, 1e-9).unwrap();
        stepper.accept();
    }
    stepper
}

#[test]
fn new_cells_bring_little_energy() {
    // a load that has come at once: the moments ask for curvatures that the rod has not been bent to yet
    let tolerance = 1e-3;
    let mesh = Mesh::uniform(1.0, 2, 4, Vec3::zeros());
    let pushed = Boundary { tip_force: Vec3::new(3.0, 0.0, 3.0), ..released() };
    let gain = |before: &Energy, after: &Energy| {
        let large = Energy::large(&soft(), mesh.length(), &pushed.gravity);
        (after.total() - before.total()) / before.scale(large)
    };

    let (mut plane, drive) = (falling(&mesh, &soft()), still(released()));
    for _ in 0..100 {
        plane.attempt(&|_| drive, 2e-3).unwrap();
        plane.accept();
    }
    let drive = still(pushed);
    plane.start(&drive).unwrap();
    plane.look(1.0, &drive);
    let (before, mut refiner) = (plane.energy(), Refiner::new(&mesh, tolerance, 0.0, 64));
    let most = 4.0 * refiner.estimate_plane(&plane);
    assert!(refiner.adapt_plane(&mut plane, &drive, false).unwrap());
    plane.look(1.0, &drive);
    let gained = gain(&before, &plane.energy());
    assert!(gained < most, "in a plane {gained:e} of {most:e}");

    let pushed = Boundary { base: struck(0.0).base, ..pushed };
    let mut stepper = after_the_pulse(&mesh, &soft(), 0.15);
    stepper.accelerate(&pushed).unwrap();
    let energy = |stepper: &Stepper| Energy::of(&stepper.mesh, &stepper.rod, &stepper.state, &pushed.gravity);
    let (before, mut refiner) = (energy(&stepper), Refiner::new(&mesh, tolerance, 0.0, 64));
    let most = 4.0 * refiner.estimate_space(&stepper);
    assert!(refiner.adapt(&mut stepper, &pushed, false).unwrap());
    let gained = gain(&before, &energy(&stepper));
    assert!(gained < most, "in space {gained:e} of {most:e}");
}

#[test]
fn cells_of_a_slow_rod_may_use_up_more() {
    let mesh = Mesh::uniform(1.0, 8, 4, Vec3::zeros());
    let stepper = after_the_pulse(&mesh, &soft(), 0.15);
    let estimate = Refiner::new(&mesh, 1.0, 0.0, 64).estimate_space(&stepper);
    // of which they use up half as much again as others may
    let tolerance = estimate / (1.5 * 0.17);
    assert!(tolerance < 1e-3, "{tolerance:e}");
    let halves = |slow: f64| Refiner::new(&mesh, tolerance, slow, 64).adapt(&mut stepper.clone(), &struck(0.15), false);
    let fastest = stepper.state.nodes.iter().map(|node| node.acceleration.norm()).fold(0.0, f64::max);
    for (slow, halved) in [(0.0, true), (1.4 * fastest, true), (1.6 * fastest, false)] {
        assert_eq!(halves(slow), Ok(halved), "{}", slow / fastest);
    }
}

#[test]
fn the_estimate_is_of_the_size_of_the_error() {
    let near = |error: f64, estimate: f64, what: &str| {
        assert!((error / 10.0..10.0 * error).contains(&estimate), "{what}: {error:.1e}, estimate {estimate:.1e}");
    };
    let tips = reference("S1");
    for (stages, cells) in [(4, 6), (4, 8), (4, 12), (3, 8), (2, 16)] {
        let mesh = Mesh::uniform(1.0, cells, stages, Vec3::zeros());
        let (mut plane, drive) = (falling(&mesh, &soft()), still(released()));
        let mut refiner = Refiner::new(&mesh, 1.0, 0.0, cells);
        let (mut errors, mut estimate) = (Vec::new(), 0.0f64);
        for pair in tips.windows(2) {
            for _ in 0..20 {
                plane.attempt(&|_| drive, (pair[1].0 - pair[0].0) / 20.0).unwrap();
                plane.accept();
            }
            plane.look(1.0, &drive);
            errors.push((plane.tip().position - pair[1].1).norm());
            estimate = estimate.max(refiner.estimate_plane(&plane));
        }
        near(root_mean_square(&errors), estimate, &format!("released, {cells} × {stages}"));
    }
    let tips = reference("S3");
    for cells in [4, 6] {
        let mesh = Mesh::uniform(1.0, cells, 4, Vec3::zeros());
        let mut stepper = after_the_pulse(&mesh, &soft(), 0.0);
        let mut refiner = Refiner::new(&mesh, 1.0, 0.0, cells);
        let (mut errors, mut estimate) = (Vec::new(), 0.0f64);
        for pair in tips.windows(2) {
            let h = (pair[1].0 - pair[0].0) / 4.0;
            for i in 0..4 {
                stepper.attempt(&ESDIRK4, &|t| struck(pair[0].0 + i as f64 * h + t), h, 1e-7).unwrap();
                stepper.accept();
            }
            errors.push((stepper.state.tip().position - pair[1].1).norm());
            estimate = estimate.max(refiner.estimate_space(&stepper));
        }
        near(root_mean_square(&errors), estimate, &format!("struck, {cells} × 4"));
    }
}

#[test]
fn all_around_a_coil_the_errors_of_its_chords_vanish() {
    // four turns, pulled by eight times their weight
    let (radius, rise) = (0.02, 0.01 / (2.0 * PI));
    let arc = f64::hypot(radius, rise);
    let (length, kappa) = (8.0 * PI * arc, Vec3::new(0.0, radius, -rise) / (arc * arc));
    let rod = Rod::circular(1e-3, 2e11, 2e11 / 2.6, 7850.0);
    let tangent = Vec3::new(0.0, radius, rise) / arc;
    let base =
        Support::at_rest(Vec3::zeros(), Matrix3::from_columns(&[-Vec3::x(), tangent.cross(&-Vec3::x()), tangent]));
    let pulled = Boundary { tip_force: -Vec3::z(), ..Boundary::hanging_from(base, Vec3::z() * -9.81) };
    let at_rest = |cells: usize, stages: usize| {
        let mesh = Mesh::uniform(length, cells, stages, kappa);
        let state = State::at_rest_shape(&mesh, &pulled.base);
        let mut stepper = Stepper::new(mesh, rod.clone(), state);
        stepper.equilibrium(&pulled).unwrap();
        stepper
    };
    let exact = at_rest(48, 4).state.tip().position;
    for (cells, stages) in [(11, 2), (16, 2), (11, 3)] {
        let stepper = at_rest(cells, stages);
        let error = (stepper.state.tip().position - exact).norm() / length;
        let estimate = Refiner::new(&stepper.mesh, 1.0, 0.0, cells).estimate_space(&stepper);
        // each by itself, they are 20 to 60 times that
        assert!((0.1 * error..10.0 * error).contains(&estimate), "{cells} × {stages}: {error:.1e}, {estimate:.1e}");
    }
}

/// Tip position and velocity, force on the base, kinetic, elastic and potential energy.
type Record = [Vec3; 4];

fn of_plane(plane: &Plane) -> Record {
    let (tip, Energy { kinetic, elastic, gravity, .. }) = (plane.tip(), plane.energy());
    [tip.position, tip.velocity, plane.reaction().0, Vec3::new(kinetic, elastic, gravity)]
}

fn of_space(stepper: &Stepper) -> Record {
    let Stepper { mesh, rod, state, .. } = stepper;
    let Energy { kinetic, elastic, gravity, .. } = Energy::of(mesh, rod, state, &state.boundary.gravity);
    let velocity = state.tip_memory().travel.velocity.value;
    [state.tip().position, velocity, state.nodes[0].force, Vec3::new(kinetic, elastic, gravity)]
}

fn moved(a: &Record, b: &Record) -> [f64; 4] {
    std::array::from_fn(|q| (a[q] - b[q]).norm() / b[q].norm())
}

/// Halves all cells of a rod, joins them again; what either moves, over its size.
fn changes(record: impl Fn() -> Record, mut adapt: impl FnMut(f64) -> Record) -> [[f64; 4]; 2] {
    let before = record();
    let halved = adapt(0.0);
    let joined = adapt(f64::INFINITY);
    [moved(&halved, &before), moved(&joined, &halved)]
}

#[test]
fn a_change_of_cells_moves_no_more_than_they_leave_open() {
    let drive = still(released());
    for rod in [soft(), laden()] {
        // position and velocity of the tip, the reaction, the energies
        let mut largest = Vec::new();
        for cells in [6, 12] {
            let mesh = Mesh::uniform(1.0, cells, 4, Vec3::zeros());
            let mut plane = falling(&mesh, &rod);
            for _ in 0..600 {
                plane.attempt(&|_| drive, 5e-4).unwrap();
                plane.accept();
            }
            plane.look(1.0, &drive);
            let halved = std::cell::RefCell::new(plane);
            largest.push(changes(
                || of_plane(&halved.borrow()),
                |tolerance| {
                    let plane = &mut *halved.borrow_mut();
                    assert!(Refiner::new(&mesh, tolerance, 0.0, 64).adapt_plane(plane, &drive, true).unwrap());
                    of_plane(plane)
                },
            ));
        }
        for (cells, bounds) in largest.iter().zip([[5e-5, 1e-4, 5e-2, 2e-4], [1e-6, 1e-5, 2e-2, 1e-5]]) {
            for change in cells {
                assert!(change.iter().zip(bounds).all(|(change, bound)| *change < bound), "{cells:?}");
            }
        }
    }
    for rod in [soft(), laden()] {
        let mesh = Mesh::uniform(1.0, 6, 4, Vec3::new(0.2, 0.0, 0.3));
        let stepper = std::cell::RefCell::new(after_the_pulse(&mesh, &rod, 0.25));
        let boundary = struck(0.25);
        let found = changes(
            || of_space(&stepper.borrow()),
            |tolerance| {
                let stepper = &mut *stepper.borrow_mut();
                assert!(Refiner::new(&mesh, tolerance, 0.0, 64).adapt(stepper, &boundary, true).unwrap());
                of_space(stepper)
            },
        );
        for change in &found {
            assert!(change.iter().zip([1e-5, 1e-4, 1e-2, 1e-4]).all(|(change, bound)| *change < bound), "{found:?}");
        }
        assert_eq!(stepper.borrow().mesh, mesh);
    }
}

/// The error of a released cord over its length, its cells at most and the number of changes.
fn fall(tolerance: f64) -> (f64, usize, usize) {
    let coarsest = Mesh::uniform(1.0, 1, 4, Vec3::zeros());
    let mut refiner = Refiner::new(&coarsest, tolerance, 0.0, 48);
    let mut plane = falling(&refiner.start(8), &soft());
    plane.reserve(refiner.most_cells());
    let drive = still(released());
    let allowed = 0.6 * tolerance;
    let (mut next, mut changes, mut cells) = (4e-3, 0, 0);
    let mut errors = Vec::new();
    for pair in reference("S1").windows(2) {
        let mut left = pair[1].0 - pair[0].0;
        while left > 0.0 {
            let parts = (left / next).ceil();
            let h = left / parts;
            let error = plane.attempt(&|_| drive, h).unwrap().position;
            next = h * (0.9 * (error / (allowed * h)).powf(-1.0 / 3.0)).clamp(0.2, 4.0);
            if error > allowed * h {
                continue;
            }
            plane.accept();
            left = if parts == 1.0 { 0.0 } else { left - h };
            changes += usize::from(refiner.adapt_plane(&mut plane, &drive, true).unwrap());
            cells = cells.max(plane.mesh().cells.len());
        }
        plane.look(1.0, &drive);
        errors.push((plane.tip().position - pair[1].1).norm());
    }
    (root_mean_square(&errors), cells, changes)
}

#[test]
fn a_run_meets_its_tolerance_with_few_changes() {
    for (tolerance, most) in [(1e-2, 16), (1e-3, 24), (1e-4, 48)] {
        let (error, cells, changes) = fall(tolerance);
        assert!(error < tolerance && cells <= most && (1..60).contains(&changes), "{error:.1e} {cells} {changes}");
    }
    // and is the same whenever it is made
    assert_eq!(fall(1e-3), fall(1e-3));
}

#[test]
fn a_rod_struck_after_a_rest_changes_its_cells_in_time() {
    let coarsest = Mesh::uniform(1.0, 2, 4, Vec3::zeros());
    let mut refiner = Refiner::new(&coarsest, 1e-3, 0.0, 32);
    let mut stepper = after_the_pulse(&refiner.start(8), &soft(), 0.0);
    for _ in 0..20 {
        stepper.attempt(&ESDIRK4, &|_| struck(0.0), 5e-3, 1e-6).unwrap();
        stepper.accept();
        refiner.adapt(&mut stepper, &struck(0.0), true).unwrap();
    }
    assert_eq!(stepper.mesh, coarsest);
    let (mut errors, mut changes) = (Vec::new(), 0);
    for pair in reference("S3").windows(2) {
        let h = (pair[1].0 - pair[0].0) / 2.0;
        for i in 0..2 {
            let begin = pair[0].0 + i as f64 * h;
            stepper.attempt(&ESDIRK4, &|t| struck(begin + t), h, 1e-6).unwrap();
            stepper.accept();
            changes += usize::from(refiner.adapt(&mut stepper, &struck(begin + h), true).unwrap());
        }
        errors.push((stepper.state.tip().position - pair[1].1).norm());
    }
    let error = root_mean_square(&errors);
    assert!(error < 1e-3 && (1..20).contains(&changes), "{error:.1e}, {changes} changes");
}

#[test]
fn an_equilibrium_finds_its_cells() {
    // a line of 50 m that bends within half a metre of its clamp, which is not plumb
    let radius: f64 = 0.015;
    let second_moment = PI * radius.powi(4) / 4.0;
    let area = PI * radius * radius;
    let line = Rod::circular(radius, 100.0 / second_moment, 77.0 / (2.0 * second_moment), 1.2 / area);
    let leaning = so3::exp(&(Vec3::y() * 0.4)) * hanging();
    let boundary = Boundary {
        tip_force: Vec3::y() * 50.0,
        ..Boundary::hanging_from(Support::at_rest(Vec3::zeros(), leaning), Vec3::z() * -9.81)
    };
    let at_rest = |mesh: &Mesh| Stepper::new(mesh.clone(), line.clone(), State::at_rest_shape(mesh, &boundary.base));
    let graded: Vec<f64> = (0..=100).map(|j| 50.0 * (j as f64 / 100.0).powi(2)).collect();
    let mut fine = at_rest(&Mesh::graded(&graded, 4, |_| Vec3::zeros()));
    fine.equilibrium(&boundary).unwrap();
    for tolerance in [1e-3, 1e-5] {
        let coarsest = Mesh::uniform(50.0, 2, 4, Vec3::zeros());
        let mut refiner = Refiner::new(&coarsest, tolerance, 0.0, 60);
        let mut stepper = at_rest(&coarsest);
        refiner.equilibrium(&mut stepper, &boundary).unwrap();
        let error = (stepper.state.tip().position - fine.state.tip().position).norm() / 50.0;
        let cells = &stepper.mesh.cells;
        assert!(error < tolerance && refiner.estimate_space(&stepper) < tolerance, "{error:.1e}");
        assert!(cells.len() < 30 && cells[0].length < cells[cells.len() - 1].length, "{cells:?}");
    }
}

#[test]
fn cells_of_a_wound_rod_stay_short() {
    let coarsest = Mesh::uniform(1.0, 4, 4, Vec3::new(0.0, 10.0, 2.0));
    let mut refiner = Refiner::new(&coarsest, f64::INFINITY, 0.0, 16);
    let mesh = refiner.start(8);
    let mut stepper = after_the_pulse(&mesh, &soft(), 0.0);
    // of 2.5 rad together
    assert!(!refiner.adapt(&mut stepper, &struck(0.0), true).unwrap());
    assert_eq!(stepper.mesh, mesh);
}

#[test]
fn rods_that_shear_or_are_held_keep_their_cells() {
    let mesh = Mesh::uniform(1.0, 2, 4, Vec3::zeros());
    let extensible = Rod { compliance: Vec3::new(1e-2, 1e-2, 3e-3), ..soft() };
    let sliding = Held { translation: [true, false, false], ..Held::FREE };
    let tip = Support { held: sliding, ..Support::at_rest(Vec3::z() * -1.0, hanging()) };
    for (rod, boundary) in [(extensible, struck(0.0)), (soft(), Boundary { tip, ..struck(0.0) })] {
        let state = State::at_rest_shape(&mesh, &boundary.base);
        let mut stepper = Stepper::new(mesh.clone(), rod, state);
        let mut refiner = Refiner::new(&mesh, 0.0, 0.0, 16);
        refiner.equilibrium(&mut stepper, &boundary).unwrap();
        assert!(!refiner.adapt(&mut stepper, &boundary, true).unwrap());
        assert_eq!(stepper.mesh, mesh);
    }
}

#[test]
fn a_rod_on_other_cells_is_resumed_to_the_last_bit() {
    let coarsest = Mesh::uniform(1.0, 2, 4, Vec3::zeros());
    let mut stepper = after_the_pulse(&coarsest, &soft(), 0.1);
    let (mesh, state) = (stepper.mesh.clone(), stepper.state.clone());
    let mut refiner = Refiner::new(&coarsest, 1e-6, 0.0, 16);
    let backup = refiner.clone();
    let run = |stepper: &mut Stepper, refiner: &mut Refiner| {
        for i in 0..8 {
            let time = 0.1 + i as f64 * 2e-3;
            stepper.attempt(&ESDIRK4, &|t| struck(time + t), 2e-3, 1e-6).unwrap();
            stepper.accept();
            refiner.adapt(stepper, &struck(time + 2e-3), true).unwrap();
        }
        (stepper.mesh.clone(), stepper.state.clone())
    };
    let first = run(&mut stepper, &mut refiner);
    assert!(first.0.cells.len() > 2);
    stepper.resume(&mesh, &state);
    refiner.copy_from(&backup);
    assert!(run(&mut stepper, &mut refiner) == first);
}
