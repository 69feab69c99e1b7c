//! A step allocates nothing, whatever the rod, the row and the way it ends.
#![allow(missing_docs)]
// a global allocator cannot be had otherwise
#![allow(unsafe_code)]

use cosserat_rod::alpha::Scheme;
use cosserat_rod::archive;
use cosserat_rod::boundary::{Boundary, Drive, Held, Rates, Support};
use cosserat_rod::mesh::Mesh;
use cosserat_rod::plane::Plane;
use cosserat_rod::pose::{Row, State};
use cosserat_rod::rate;
use cosserat_rod::refine::Refiner;
use cosserat_rod::rod::Rod;
use cosserat_rod::rosenbrock::{RODAS4, RODAS5P};
use cosserat_rod::runge_kutta::ESDIRK4;
use cosserat_rod::stepper::Stepper;
use cosserat_rod::unit::{Inputs, Parameters, Unit};
use nalgebra::{Matrix3, Rotation3, Vector3};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    /// Allocations of this thread: the harness allocates when it likes in its own.
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is passed on to the system's allocator with the caller's own arguments.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: as above
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above
        unsafe { System.dealloc(pointer, layout) }
    }

    // `realloc` and `alloc_zeroed` come here through `alloc`, by their default bodies
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(work: impl FnOnce()) -> usize {
    let before = ALLOCATIONS.get();
    work();
    ALLOCATIONS.get() - before
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|| drop(std::hint::black_box(vec![0u8; 100]))), 1);
}

#[test]
fn a_step_allocates_nothing() {
    let loaded = Rod { drag: 0.1, tip_mass: 0.01, tip_inertia: 1e-6, ..Rod::circular(5e-3, 5e6, 5e6 / 3.0, 1100.0) };
    let damped = Rod { damping: Vector3::new(0.01, 0.01, 0.01), ..loaded.clone() };
    let extensible = Rod { compliance: Vector3::new(1e-2, 1e-2, 3e-3), ..damped.clone() };
    let boundary = Boundary {
        tip_force: Vector3::new(0.1, 0.0, 0.0),
        tip_moment: Vector3::new(0.0, 0.0, 1e-3),
        ..Boundary::hanging_from(Support::at_rest(Vector3::zeros(), Matrix3::identity()), Vector3::new(9.81, 0.0, 0.0))
    };
    // a hinge at the base, and a tip that slides along the first axis of its support, which stands where the tip of a
    // rod bent by 2 rad is at rest
    let turned = Rotation3::new(Vector3::y() * 2.0);
    let held = Boundary {
        base: Support { held: Held { rotation: [true, false, true], ..Held::CLAMPED }, ..boundary.base },
        tip: Support {
            held: Held { translation: [false, true, true], rotation: [true, false, false] },
            ..Support::at_rest(Vector3::new((1.0 - 2f64.cos()) / 2.0, 0.0, 2f64.sin() / 2.0), *turned.matrix())
        },
        ..boundary
    };
    for stages in 1..=4 {
        for (rod, row, boundary, curvature) in [
            (&loaded, Row::Rotations, boundary, 0.0),
            (&damped, Row::Rotations, boundary, 0.0),
            (&damped, Row::Positions, boundary, 0.0),
            (&extensible, Row::Positions, boundary, 0.0),
            (&damped, Row::Positions, held, 2.0),
            (&extensible, Row::Positions, held, 2.0),
        ] {
            let mesh = Mesh::uniform(1.0, 8, stages, Vector3::new(0.0, curvature, 0.0));
            let state = State::at_rest_shape(&mesh, &boundary.base);
            let mut stepper = Stepper::new(mesh, rod.clone(), state);
            let count = allocations(|| {
                for _ in 0..5 {
                    stepper.step(&boundary, Scheme::from_spectral_radius(0.5), 5e-3, row).unwrap();
                }
                // a step that fails, and with it both ways of iterating
                let absurd = Boundary { tip_force: Vector3::new(1e300, 0.0, 0.0), ..boundary };
                stepper.step(&absurd, Scheme::BACKWARD_EULER, 5e-3, row).unwrap_err();
                stepper.relax(&boundary).ok();
                stepper.start(&boundary).ok();
            });
            assert_eq!(count, 0, "{stages} stages, {row:?}, {rod:?}");
        }
    }
}

#[test]
fn a_step_of_the_rate_formulation_allocates_nothing() {
    let boundary =
        Boundary::hanging_from(Support::at_rest(Vector3::zeros(), Matrix3::identity()), Vector3::new(9.81, 0.0, 0.0));
    for options in [rate::Options::AS_PRINTED, rate::Options::MENDED] {
        let mesh = Mesh::uniform(1.0, 8, 1, Vector3::zeros());
        let rod = Rod::circular(5e-3, 5e6, 5e6 / 3.0, 1100.0);
        let mut stepper = rate::Stepper::new(mesh, rod, &boundary, options).unwrap();
        let count = allocations(|| {
            for _ in 0..5 {
                stepper.step(&boundary, Scheme::from_spectral_radius(0.5), 5e-3).unwrap();
            }
            let absurd = Boundary { tip_force: Vector3::new(1e300, 0.0, 0.0), ..boundary };
            stepper.step(&absurd, Scheme::BACKWARD_EULER, 5e-3).unwrap_err();
        });
        assert_eq!(count, 0, "{options:?}");
    }
}

#[test]
fn a_communication_step_allocates_nothing() {
    let mut unit = Unit::new(&Parameters::default(), &Inputs::default(), None).unwrap();
    let inputs = Inputs { base_velocity: Vector3::new(0.1, 0.0, 0.0), ..Inputs::default() };
    let count = allocations(|| {
        for _ in 0..5 {
            unit.advance(&inputs, 0.01).unwrap();
        }
    });
    assert_eq!(count, 0);
}

#[test]
fn communication_steps_allocate_nothing_whatever_becomes_of_them() {
    // a whip, on cells that change; pushed in its plane, out of it, and back once it is at rest; and no equilibrium
    let whip = Parameters { tolerance: 1e-4, ..Parameters::default() };
    let stiff = Parameters {
        radius: 0.02,
        youngs_modulus: 5e8,
        shear_modulus: 2e8,
        damping_bending: 0.1,
        damping_twist: 0.1,
        gravity: Vector3::zeros(),
        ..Parameters::default()
    };
    let slow = Parameters { quasi_static: true, ..Parameters::default() };
    let push = |direction: Vector3<f64>, size: f64| Inputs { tip_force: direction * size, ..Inputs::default() };
    let (y, z) = (Vector3::y(), Vector3::z());
    type Pushes = Vec<(Inputs, usize)>;
    let drives: [(&str, Parameters, Pushes); 3] = [
        ("whip", whip, vec![(push(z, 0.0), 40), (push(z, 1e300), 1), (push(y, 0.1), 20)]),
        (
            "stiff",
            stiff,
            vec![(push(y, 1.0), 5), (push(z, 1.0), 5), (push(z, 1e150), 1), (push(z, 0.0), 600), (push(y, 1.0), 5)],
        ),
        ("slow", slow, vec![(push(y, 0.1), 10), (push(z, 1e150), 1), (push(y, 0.1), 10)]),
    ];
    for (name, parameters, inputs) in drives {
        let mut unit = Unit::new(&parameters, &Inputs::default(), None).unwrap();
        let (mut cells, mut planes, mut refused) = (0, 0, 0);
        let count = allocations(|| {
            for (inputs, times) in &inputs {
                for _ in 0..*times {
                    let (before, was_planar) = (unit.outputs().cells, unit.outputs().solver.planar);
                    refused += usize::from(unit.advance(inputs, 0.01).is_err());
                    cells += usize::from(unit.outputs().cells != before);
                    planes += usize::from(unit.outputs().solver.planar != was_planar);
                }
            }
        });
        assert_eq!(count, 0, "{name}");
        assert!(refused == 1 && (cells > 0 || name != "whip"), "{name}: {refused} {cells}");
        assert_eq!(
            planes,
            match name {
                "whip" => 2,
                "stiff" => 3,
                _ => 0,
            },
            "{name}"
        );
    }
}

#[test]
fn steps_after_a_load_allocate_nothing() {
    // cells are halved, and the plane is left, in a unit that was made for a state of before that
    let parameters = Parameters { tolerance: 1e-4, ..Parameters::default() };
    let mut unit = Some(Box::new(Unit::new(&parameters, &Inputs::default(), None).unwrap()));
    let pushed = Inputs { tip_force: Vector3::new(0.0, 1.0, 0.0), ..Inputs::default() };
    let still = Inputs::default();
    let run = |unit: &mut Option<Box<Unit>>| {
        let unit = unit.as_mut().unwrap();
        let cells = unit.outputs().cells;
        for i in 0..60 {
            unit.advance(if i < 40 { &still } else { &pushed }, 0.01).unwrap();
        }
        assert!(unit.outputs().cells > cells && !unit.outputs().solver.planar);
    };
    let mut saved = Vec::new();
    archive::save(&mut unit, &mut saved);
    let mut made = None;
    for unit in [&mut unit, &mut made] {
        archive::load(unit, &saved).unwrap();
        assert_eq!(allocations(|| run(unit)), 0);
        archive::load(unit, &saved).unwrap();
        assert_eq!(allocations(|| run(unit)), 0);
    }
}

#[test]
fn a_step_of_order_4_allocates_nothing() {
    let boundary =
        Boundary::hanging_from(Support::at_rest(Vector3::zeros(), Matrix3::identity()), Vector3::new(9.81, 0.0, 0.0));
    let mut stepper = {
        let mesh = Mesh::uniform(1.0, 3, 4, Vector3::zeros());
        let state = State::at_rest_shape(&mesh, &boundary.base);
        Stepper::new(mesh, Rod::circular(5e-3, 5e6, 5e6 / 3.0, 1100.0), state)
    };
    stepper.start(&boundary).unwrap();
    let count = allocations(|| {
        // one whose factors serve, and one that is lost
        stepper.attempt(&ESDIRK4, &|_| boundary, 5e-3, 1e-6).unwrap();
        stepper.accept();
        std::hint::black_box(stepper.look(0.3, &boundary));
        stepper.attempt(&ESDIRK4, &|_| boundary, 10.0, 1e-6).unwrap_err();
    });
    assert_eq!(count, 0);
}

/// A rod with a body at its tip and what acts on it, in a plane.
fn loaded() -> (Rod, Drive) {
    let base = Support::at_rest(Vector3::zeros(), Matrix3::identity());
    let boundary = Boundary {
        tip_force: Vector3::new(0.1, 0.0, 0.0),
        ..Boundary::hanging_from(base, Vector3::new(9.81, 0.0, 0.0))
    };
    let rod = Rod { tip_mass: 0.01, tip_inertia: 1e-6, ..Rod::circular(5e-3, 5e6, 5e6 / 3.0, 1100.0) };
    (rod, Drive { boundary, rates: Rates::default() })
}

#[test]
fn a_plane_rod_allocates_nothing_once_built() {
    let (rod, drive) = loaded();
    for method in [&RODAS4, &RODAS5P] {
        for stages in 1..=4 {
            let mesh = Mesh::uniform(1.0, 3, stages, Vector3::zeros());
            let mut plane = Plane::of(&mesh, &rod, &drive, method).expect("a plane rod");
            let count = allocations(|| {
                plane.start(&drive).unwrap();
                plane.attempt(&|_| drive, 1e-3).unwrap();
                plane.accept();
                plane.look(0.5, &drive);
                std::hint::black_box((plane.tip(), plane.reaction(), plane.position(0.7)));
                std::hint::black_box((plane.energy(), plane.power(), plane.holds(&drive)));
            });
            assert_eq!(count, 0, "{stages} stages");
        }
    }
}

#[test]
fn a_change_of_cells_allocates_nothing() {
    let (rod, drive) = loaded();
    let boundary = drive.boundary;
    for stages in 1..=4 {
        let mesh = Mesh::uniform(1.0, 3, stages, Vector3::zeros());
        // halves all there is, and joins what there is
        let mut refiners = [0.0, f64::INFINITY].map(|tolerance| Refiner::new(&mesh, tolerance, 0.0, 12));
        let mut stepper = Stepper::new(mesh.clone(), rod.clone(), State::at_rest_shape(&mesh, &boundary.base));
        let backup = stepper.state.clone();
        stepper.reserve(12);
        let mut plane = Plane::of(&mesh, &rod, &drive, &RODAS4).expect("a plane rod");
        plane.reserve(12);
        let count = allocations(|| {
            stepper.start(&boundary).unwrap();
            plane.start(&drive).unwrap();
            for refiner in &mut refiners {
                for _ in 0..6 {
                    stepper.attempt(&ESDIRK4, &|_| boundary, 1e-3, 1e-6).unwrap();
                    stepper.accept();
                    plane.attempt(&|_| drive, 1e-3).unwrap();
                    plane.accept();
                    refiner.adapt(&mut stepper, &boundary, true).unwrap();
                    refiner.adapt_plane(&mut plane, &drive, true).unwrap();
                }
            }
            stepper.resume(&mesh, &backup);
        });
        assert_eq!(count, 0, "{stages} stages");
    }
}
