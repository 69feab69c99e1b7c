//! What no mesh and no step may break: the choice of frame, rigid motion, a plane of symmetry, the energy balance.

mod common;

use common::{along_x, clamped, fitted_order, ramp, unstressed};
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::{Boundary, Held, Support};
use cosserat_rod::energy::Energy;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::pose::{Row, Section, State};
use cosserat_rod::rod::Rod;
use cosserat_rod::stepper::Stepper;
use nalgebra::{Matrix3, Rotation3, Vector3};
use std::f64::consts::PI;

const LENGTH: f64 = 1.0;

/// A soft rod with all that can be attached to it.
fn furnished() -> Rod {
    Rod {
        damping: Vector3::new(0.02, 0.03, 0.01),
        drag: 0.05,
        tip_mass: 0.02,
        tip_inertia: 1e-6,
        ..Rod::circular(0.005, 5e6, 5e6 / 3.0, 1100.0)
    }
}

/// Its shape without stress: neither straight nor plane.
fn bent_and_twisted(cells: usize, stages: usize) -> Mesh {
    Mesh::uniform(LENGTH, cells, stages, Vector3::new(1.0, -0.5, 2.0))
}

fn turned(by: &Matrix3<f64>, shifted: &Vector3<f64>, boundary: &Boundary) -> Boundary {
    let support = |support: &Support| Support {
        position: by * support.position + shifted,
        rotation: by * support.rotation,
        velocity: by * support.velocity,
        angular_velocity: by * support.angular_velocity,
        acceleration: by * support.acceleration,
        ..*support
    };
    Boundary {
        base: support(&boundary.base),
        tip: support(&boundary.tip),
        tip_force: by * boundary.tip_force,
        tip_moment: by * boundary.tip_moment,
        gravity: by * boundary.gravity,
    }
}

/// A base that starts smoothly into a turn and a shift, under gravity and with a load on the tip.
fn shaken(t: f64) -> Boundary {
    // 1 − cos and its derivatives
    let (phase, rate) = (8.0 * t, 8.0);
    let (x, v, a) = (1.0 - phase.cos(), rate * phase.sin(), rate * rate * phase.cos());
    let (axis, way) = (Vector3::new(0.1, 0.2, -0.3), Vector3::new(0.05, -0.1, 0.05));
    Boundary {
        base: Support {
            position: way * x,
            rotation: Rotation3::new(axis * x).into_inner() * along_x(),
            velocity: way * v,
            angular_velocity: axis * v,
            acceleration: way * a,
            held: Held::CLAMPED,
        },
        tip: Support::free(),
        tip_force: Vector3::new(0.05, 0.1, 0.1),
        tip_moment: Vector3::new(0.005, 0.0, 0.01),
        gravity: Vector3::new(0.0, 0.0, -9.81),
    }
}

/// The rod after steps of `dt` up to `end` from its equilibrium, and the largest miss of its energy balance on the way.
fn run(mesh: &Mesh, rod: &Rod, boundary: impl Fn(f64) -> Boundary, row: Row, end: f64, dt: f64) -> (Stepper, f64) {
    let mut stepper = unstressed(mesh.clone(), rod.clone(), &boundary(0.0));
    stepper.equilibrium(&boundary(0.0)).expect("an equilibrium");
    stepper.start(&boundary(0.0)).expect("accelerations at the start");
    let start = Energy::of(mesh, rod, &stepper.state, &boundary(0.0).gravity);
    let (mut energy, mut missing) = (start, 0.0f64);
    let steps = (end / dt).round() as usize;
    for i in 1..=steps {
        let (old, now) = (stepper.state.clone(), boundary(i as f64 * dt));
        let result = stepper.step(&now, Scheme::from_spectral_radius(0.0), dt, row);
        result.unwrap_or_else(|diverged| panic!("step {i} of {dt} s: {diverged}"));
        energy = energy.after(mesh, rod, &old, &stepper.state, &now);
        missing = missing.max(energy.residual(&start).abs());
    }
    (stepper, missing)
}

#[test]
fn a_turned_and_shifted_scene_has_a_turned_and_shifted_answer() {
    let by = Rotation3::new(Vector3::new(1.0, -2.0, 0.7)).into_inner();
    let shifted = Vector3::new(2.0, -1.0, 3.0);
    let mesh = bent_and_twisted(5, 3);
    let stretching = Rod { compliance: Vector3::new(0.02, 0.02, 0.01), ..furnished() };
    for (rod, row) in
        [(furnished(), Row::Rotations), (furnished(), Row::Positions), (stretching.clone(), Row::Positions)]
    {
        let run = |boundary: &dyn Fn(f64) -> Boundary| {
            let mut stepper = unstressed(mesh.clone(), rod.clone(), &boundary(0.0));
            for i in 1..=30 {
                let result = stepper.step(&boundary(f64::from(i) * 0.01), Scheme::from_spectral_radius(0.5), 0.01, row);
                result.unwrap_or_else(|diverged| panic!("step {i}: {diverged}"));
            }
            stepper.state
        };
        compare(&by, &shifted, &run(&shaken), &run(&|t| turned(&by, &shifted, &shaken(t))), 1e-8);
    }
    for rod in [furnished(), stretching.clone()] {
        let rest = |boundary: &Boundary| {
            let mut stepper = unstressed(mesh.clone(), rod.clone(), boundary);
            stepper.equilibrium(boundary).expect("an equilibrium");
            stepper.state
        };
        let boundary = shaken(0.0);
        compare(&by, &shifted, &rest(&boundary), &rest(&turned(&by, &shifted, &boundary)), 1e-8);
    }
    // with both ends held in part, from where they hang together
    for rod in [furnished(), stretching] {
        let held = |boundary: &Boundary, at: &Section| Boundary {
            base: Support { held: Held { rotation: [false, true, true], ..Held::CLAMPED }, ..boundary.base },
            tip: Support {
                held: Held { translation: [true, false, true], rotation: [false, true, true] },
                ..Support::at_rest(at.position, at.rotation)
            },
            ..*boundary
        };
        let run = |boundary: &dyn Fn(f64) -> Boundary| {
            let mut stepper = unstressed(mesh.clone(), rod.clone(), &boundary(0.0));
            stepper.equilibrium(&boundary(0.0)).expect("an equilibrium");
            let at = *stepper.state.tip();
            stepper.start(&held(&boundary(0.0), &at)).expect("a start");
            for i in 1..=30 {
                let now = held(&boundary(f64::from(i) * 0.002), &at);
                let result = stepper.advance(&now, Scheme::from_spectral_radius(0.5), 0.002);
                result.unwrap_or_else(|diverged| panic!("held, step {i}: {diverged}"));
            }
            stepper.state
        };
        compare(&by, &shifted, &run(&shaken), &run(&|t| turned(&by, &shifted, &shaken(t))), 1e-8);
    }
}

/// The rod is of size one, and its forces and moments are below it. Newton ends with an increment below 1e-8 and an
/// error of the order of its square; how many iterations that takes may depend on the frame.
fn compare(by: &Matrix3<f64>, shifted: &Vector3<f64>, a: &State, b: &State, tolerance: f64) {
    for (a, b) in a.nodes.iter().zip(&b.nodes) {
        assert!((by * a.position + shifted - b.position).norm() < tolerance);
        assert!((by * a.rotation - b.rotation).norm() < tolerance);
        assert!((by * a.force - b.force).norm() < tolerance);
        assert!((by * a.moment - b.moment).norm() < tolerance);
    }
}

#[test]
fn a_rod_that_follows_its_base_is_unstrained() {
    let mesh = bent_and_twisted(6, 2);
    let here = clamped(along_x());
    let mut stepper = unstressed(mesh.clone(), furnished(), &here);
    let (by, shifted) = (Rotation3::new(Vector3::new(0.5, -1.5, 1.0)).into_inner(), Vector3::new(-4.0, 5.0, 1.0));
    let there = turned(&by, &shifted, &here);
    stepper.equilibrium(&there).expect("an equilibrium");
    let moved = State::at_rest_shape(&mesh, &there.base);
    // Newton's error is the square of its last increment, below 1e-16, and rounding that of a sum along the rod
    for (section, other) in stepper.state.nodes.iter().zip(&moved.nodes) {
        assert!((section.position - other.position).norm() < 1e-13);
        assert!((section.rotation - other.rotation).norm() < 1e-13);
        assert!(section.force.norm() < 1e-13 && section.moment.norm() < 1e-13, "{section:?}");
    }
}

#[test]
fn a_rod_in_uniform_motion_is_unstrained() {
    let mesh = bent_and_twisted(6, 2);
    // air at rest would hold it back
    let rod = Rod { drag: 0.0, ..furnished() };
    let velocity = Vector3::new(3.0, -1.0, 2.0);
    let boundary = |t: f64| {
        let base = Support::at_rest(velocity * t, along_x());
        Boundary { base: Support { velocity, ..base }, ..clamped(along_x()) }
    };
    for row in [Row::Rotations, Row::Positions] {
        let (stepper, _) = run(&mesh, &rod, boundary, row, 1.0, 0.05);
        let moved = State::at_rest_shape(&mesh, &boundary(1.0).base);
        for (section, other) in stepper.state.nodes.iter().zip(&moved.nodes) {
            // the rounding of r, 1e-16 m, over Δt² is what Row::Positions makes of it as an acceleration
            assert!((section.position - other.position).norm() < 1e-12);
            assert!(section.force.norm() < 1e-12 && section.moment.norm() < 1e-12, "{section:?}");
        }
    }
}

#[test]
fn plane_motion_stays_plane() {
    // in a plane that is none of the world's, of a rod that is curved in it
    let by = Rotation3::new(Vector3::new(0.3, 1.0, -0.8)).into_inner();
    let normal = by * Vector3::y();
    let mesh = Mesh::uniform(LENGTH, 6, 3, Vector3::new(0.0, 2.0, 0.0));
    let boundary = |t: f64| {
        let swing = Rotation3::new(Vector3::y() * (0.5 * (1.0 - (PI * t).cos()))).into_inner();
        let turning = Vector3::y() * (0.5 * PI * (PI * t).sin());
        let base = Support { angular_velocity: turning, ..Support::at_rest(Vector3::zeros(), swing * along_x()) };
        let plane = Boundary { base, ..shaken(0.0) };
        let tip_force = Vector3::new(0.1, 0.0, 0.1);
        turned(&by, &Vector3::zeros(), &Boundary { tip_force, tip_moment: Vector3::y() * 0.01, ..plane })
    };
    for row in [Row::Rotations, Row::Positions] {
        let (stepper, _) = run(&mesh, &furnished(), boundary, row, 1.0, 0.01);
        for section in &stepper.state.nodes {
            // Row::Positions divides the rounding of r, 1e-16 m, by Δt² for its accelerations
            let off =
                [section.position, section.force, section.rotation.column(2).into_owned()].map(|v| v.dot(&normal));
            let across = section.moment - normal * section.moment.dot(&normal);
            assert!(off.iter().all(|off| off.abs() < 1e-10) && across.norm() < 1e-10, "{off:?} {across}");
        }
    }
}

#[test]
fn the_energy_balance_closes_at_second_order() {
    // from the equilibrium under gravity and a load on the tip, on a base that turns and shifts; Kelvin-Voigt damping,
    // drag and the body on the tip take part; the next order in Δt is what the tolerance of the slope allows for
    let moved = |t: f64| {
        let duration = 0.3;
        let [x, v, a] = ramp(t / duration);
        let (axis, way) = (Vector3::new(0.1, 0.2, -0.3), Vector3::new(0.1, -0.2, 0.1));
        let base = Support {
            position: way * x,
            rotation: Rotation3::new(axis * x).into_inner() * along_x(),
            velocity: way * (v / duration),
            angular_velocity: axis * (v / duration),
            acceleration: way * (a / duration.powi(2)),
            held: Held::CLAMPED,
        };
        Boundary { base, ..shaken(0.0) }
    };
    let mesh = bent_and_twisted(8, 4);
    let steps = [4e-3, 2e-3, 1e-3];
    for row in [Row::Rotations, Row::Positions] {
        let missing = steps.map(|dt| run(&mesh, &furnished(), moved, row, 0.4, dt).1);
        let order = fitted_order(&steps, &missing);
        assert!((order - 2.0).abs() < 0.15, "{row:?}: order {order} of {missing:?}");
    }
}
