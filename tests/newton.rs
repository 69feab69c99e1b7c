//! Newton converges quadratically, in 3 to 5 iterations a step, on three scenes and whatever hangs on the rod.
#![allow(missing_docs)]

// every test file takes the part it needs
#[allow(dead_code)]
#[path = "../src/cli/chart/scenes.rs"]
mod scenes;

use cosserat_rod::alpha::Scheme;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::pose::{Row, State, Time, assemble};
use cosserat_rod::rod::Rod;
use cosserat_rod::stepper::{Stepper, Termination};
use cosserat_rod::sweep::{Sweep, System};
use nalgebra::Vector3;
use scenes::Scene;
use std::array::from_fn;

/// 60 steps of 2.5 ms: S1 has swung by 0.1 rad, S3 stands at the peak of its force.
const DT: f64 = 2.5e-3;
const STEPS: usize = 60;

/// Drag per mass, 1/s, of the rods with drag.
const DRAG_RATE: f64 = 2.0;

/// The rod of a scene with one thing more; sizes that change its motion visibly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum With {
    Nothing,
    Damping,
    TipBody,
    Drag,
    TipBodyAndDrag,
    ShearAndStretch,
}

impl With {
    const ALL: [Self; 6] =
        [Self::Nothing, Self::Damping, Self::TipBody, Self::Drag, Self::TipBodyAndDrag, Self::ShearAndStretch];

    fn on(&self, rod: Rod) -> Rod {
        let mass = rod.mass_per_length;
        match self {
            Self::Nothing => rod,
            Self::Damping => Rod { damping: Vector3::new(0.01, 0.01, 0.01), ..rod },
            Self::TipBody => Rod { tip_mass: 0.3 * mass, tip_inertia: 1e-4 * mass, ..rod },
            Self::Drag => Rod { drag: DRAG_RATE * mass, ..rod },
            Self::TipBodyAndDrag => Rod { drag: DRAG_RATE * mass, tip_mass: 0.3 * mass, ..rod },
            Self::ShearAndStretch => {
                // EA = 4 EI/a², ρI = ρA a²/4
                let stretch = rod.inertia_per_length.x / (rod.mass_per_length * rod.stiffness.x);
                Rod { compliance: Vector3::new(2.9, 2.9, 1.0) * stretch, ..rod }
            }
        }
    }
}

/// The increments in the full steps of Newton from `time` to `time` + [`DT`]: of rotations in rad, of forces and
/// moments relative to the largest in the rod.
fn increments(stepper: &Stepper, scene: Scene, time: f64, scheme: Scheme, row: Row) -> [f64; 7] {
    let Stepper { mesh, rod, state, .. } = stepper;
    let dt = DT;
    let mut old = state.clone();
    old.prepare(scheme, dt);
    let mut system = System::new(mesh.cells.len(), &mesh.rule, rod.is_extensible());
    let mut sweep = Sweep::new(mesh.cells.len(), &mesh.rule, rod.is_extensible());
    let mut trial = old.clone();
    from_fn(|_| {
        let boundary = scene.boundary(time + dt);
        let step = Time::Step { scheme, dt, row };
        assemble(mesh, rod, &old, &trial, &boundary, &step, &mut system);
        sweep.solve(&system).unwrap();
        trial.apply(&sweep.nodes, &sweep.points, 1.0, row);
        let (mut size, sections) = (0.0f64, trial.nodes.iter().chain(&trial.points));
        let force = sections.clone().map(|s| s.force.amax()).fold(0.0, f64::max);
        let moment = sections.map(|s| s.moment.amax()).fold(0.0, f64::max);
        for delta in sweep.nodes.iter().chain(&sweep.points) {
            size = size.max(delta.phi.norm()).max(delta.n.amax() / force).max(delta.m.amax() / moment);
        }
        size
    })
}

/// Steps one rod through one scene: the iterations of every step, and the largest dₖ₊₁/dₖ² and dₖ₊₁/dₖ of their
/// increments.
fn run(scene: Scene, with: With, row: Row, cells: usize, stages: usize) -> (Vec<usize>, f64, f64) {
    let mesh = Mesh::uniform(1.0, cells, stages, Vector3::zeros());
    let state = State::at_rest_shape(&mesh, &scene.boundary(0.0).base);
    let mut stepper = Stepper::new(mesh, with.on(scene.rod()), state);
    // the consistent start is that of the rod without shear and stretch
    if with != With::ShearAndStretch {
        stepper.start(&scene.boundary(0.0)).unwrap();
    }
    let scheme = Scheme::from_spectral_radius(if with == With::ShearAndStretch { 0.0 } else { 0.5 });
    let (mut iterations, mut quadratic, mut linear) = (vec![], 0.0f64, 0.0f64);
    for step in 0..STEPS {
        let time = step as f64 * DT;
        for pair in increments(&stepper, scene, time, scheme, row)[1..].windows(2) {
            // after the first, which bridges the step; near the solution, and above the rounding of n and m
            if pair[0] < 0.03 && pair[1] > 1e-9 {
                quadratic = quadratic.max(pair[1] / (pair[0] * pair[0]));
            }
            // so near that nothing quadratic is left to see
            if pair[0] < 1e-4 && pair[1] > 1e-9 {
                linear = linear.max(pair[1] / pair[0]);
            }
        }
        let report = stepper.step(&scene.boundary(time + DT), scheme, DT, row).unwrap();
        assert_eq!(report.termination, Termination::Newton, "{scene:?} with {with:?}, step {step}");
        iterations.push(report.iterations);
    }
    (iterations, quadratic, linear)
}

#[test]
fn converges_quadratically_in_few_iterations() {
    for scene in [Scene::Rope, Scene::Wire, Scene::Pulse] {
        for with in With::ALL {
            for row in [Row::Rotations, Row::Positions] {
                if with == With::ShearAndStretch && row == Row::Rotations {
                    continue;
                }
                for (cells, stages) in [(20, 1), (5, 4)] {
                    let what = format!("{scene:?} with {with:?}, {row:?}, {cells} × {stages}");
                    let (iterations, quadratic, linear) = run(scene, with, row, cells, stages);
                    // the last iteration only shows that the one before was good; nothing moves yet in the first steps
                    assert!(iterations.iter().all(|i| (2..=5).contains(i)), "{what}: {iterations:?}");
                    assert!(iterations[10..].iter().all(|i| *i >= 3), "{what}: {iterations:?}");
                    if with == With::TipBodyAndDrag && row == Row::Rotations {
                        // the velocity of the tip is left out of the Jacobian
                        assert!(linear < DRAG_RATE * DT, "{what}: dₖ₊₁ = {linear:.1e} dₖ");
                    } else {
                        // of order one, as the unknowns are scaled: 0.3 at most
                        assert!(quadratic < 1.0, "{what}: dₖ₊₁ = {quadratic:.1e} dₖ²");
                    }
                }
            }
        }
    }
}
