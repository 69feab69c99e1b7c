//! The sweep against a banded LU with partial pivoting, on the systems of real steps and equilibria.
#![allow(missing_docs)]

#[path = "common/banded.rs"]
mod banded;
#[path = "common/full.rs"]
mod full;
#[path = "common/random.rs"]
mod random;

use banded::{Banded, flat};
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::{Boundary, Held, Support};
use cosserat_rod::mesh::Mesh;
use cosserat_rod::pose::{Row, Section, State, Time, assemble};
use cosserat_rod::rod::Rod;
use cosserat_rod::so3;
use cosserat_rod::stepper::Stepper;
use cosserat_rod::sweep::{Increment, Sweep, System};
use full::{Full, G, Layout, M, N, PHI, W};
use nalgebra::{Vector3, Vector4};
use random::uniform;

/// Length, Young's modulus and the rest.
fn rods() -> [(&'static str, f64, f64, Rod); 3] {
    [
        ("rubber", 1.0, 5e6, Rod::circular(5e-3, 5e6, 5e6 / 3.0, 1100.0)),
        ("hair", 0.25, 3.89e9, Rod::circular(21.85e-6, 3.89e9, 0.89e9, 1320.0)),
        ("steel", 1.0, 2e11, Rod::circular(1e-3, 2e11, 2e11 / 2.6, 7850.0)),
    ]
}

fn horizontal() -> Boundary {
    let laid = so3::from_quaternion(&Vector4::new(0.5f64.sqrt(), 0.0, 0.5f64.sqrt(), 0.0));
    Boundary::hanging_from(Support::at_rest(Vector3::zeros(), laid), Vector3::new(0.0, 0.0, -9.81))
}

fn empty(mesh: &Mesh, rod: &Rod) -> System {
    System::new(mesh.cells.len(), &mesh.rule, rod.is_extensible())
}

/// One quantity of every kind: the unknowns and the equations for Φ, w, n, m and the law stand at these places of a
/// block.
const KINDS: usize = 5;

/// The kinds of the unknowns, number by number.
fn unknown_kinds(layout: &Layout) -> Vec<usize> {
    let cell = |_| [PHI, W, N, M].into_iter().chain((0..layout.stages).flat_map(|_| [PHI, W, N, M, G]));
    (0..layout.cells).flat_map(cell).chain([PHI, W, N, M]).flat_map(|kind| [kind; 3]).collect()
}

/// The kinds of the equations, number by number. Where an end is held, in part, its equations are motions.
fn equation_kinds(layout: &Layout, system: &System) -> Vec<usize> {
    let points = |_| [PHI, W, N, M, G];
    let cell = |_| [N, M].into_iter().chain((0..layout.stages).flat_map(points)).chain([PHI, W]);
    let kinds = [W, PHI].into_iter().chain((0..layout.cells).flat_map(cell)).chain([N, M]);
    let mut kinds: Vec<usize> = kinds.flat_map(|kind| [kind; 3]).collect();
    let tip = kinds.len() - 6;
    for (at, joint) in [(0, &system.base_joint), (tip, &system.tip_joint)] {
        for (i, held) in joint.iter().flat_map(|joint| joint.held).enumerate() {
            kinds[at + i] = match (held, i < 3) {
                (true, true) => W,
                (true, false) => PHI,
                (false, true) => N,
                (false, false) => M,
            };
        }
    }
    kinds
}

/// Largest of `part` over the largest of `whole`, of the worst kind.
fn relative(kinds: &[usize], part: impl Fn(usize) -> f64, whole: impl Fn(usize) -> f64) -> f64 {
    let worst = |kind: usize| {
        let largest =
            |f: &dyn Fn(usize) -> f64| (0..kinds.len()).filter(|i| kinds[*i] == kind).map(f).fold(0.0, f64::max);
        let part = largest(&part);
        if part == 0.0 { 0.0 } else { part / largest(&whole) }
    };
    (0..KINDS).map(worst).fold(0.0, f64::max)
}

/// All unknowns as the sweep leaves them; g, which it keeps to itself, from the law.
fn swept(layout: &Layout, system: &System, sweep: &Sweep) -> Vec<f64> {
    let mut x = vec![Vector3::zeros(); layout.blocks()];
    let mut put = |at: usize, delta: &Increment| {
        (x[at + PHI], x[at + W], x[at + N], x[at + M]) = (delta.phi, delta.w, delta.n, delta.m);
    };
    for (j, node) in sweep.nodes.iter().enumerate() {
        put(layout.node(j), node);
    }
    for (i, delta) in sweep.points.iter().enumerate() {
        put(layout.point(i / layout.stages, i % layout.stages), delta);
    }
    for (i, (point, delta)) in system.points.iter().zip(&sweep.points).enumerate() {
        let (j, k) = (i / layout.stages, i % layout.stages);
        let log = point.spin.try_inverse().unwrap() * (delta.phi - sweep.nodes[j].phi);
        let stress = delta.m - point.law_phi * delta.phi - point.law_log * log - point.e_law;
        x[layout.point(j, k) + G] = point.law_strain.lu().solve(&stress).unwrap();
    }
    flat(&x)
}

/// What one system shows.
#[derive(Clone, Copy, Debug)]
struct Outcome {
    /// |A x − b| of the sweep over |A||x| + |b|.
    residual: f64,
    /// The same of the reference.
    reference_residual: f64,
    /// Difference of the sweep and the reference.
    error: f64,
    /// The residual and the error after the sweep has solved once more, for its own residual.
    refined: [f64; 2],
    /// Difference of the LU without refinement and the reference.
    lu_error: f64,
}

/// The reference is the LU of the equilibrated matrix, refined with residuals of twice the precision: the LU alone, by
/// its partial pivoting, loses up to seven digits more than the sweep where inertia dwarfs the stiffness.
fn compare(mesh: &Mesh, system: &System, sweep: &mut Sweep) -> Outcome {
    sweep.solve(system).unwrap();
    let full = Full::new(system, &mesh.rule);
    let layout = full.layout;
    let mine = swept(&layout, system, sweep);
    let right = flat(&full.right);
    let matrix = Banded::new(&full);

    let mut scaled = Banded::new(&full);
    let (by_row, by_column) = scaled.equilibrate();
    let factors = scaled.factored().unwrap();
    let solve = |right: &[f64]| -> Vec<f64> {
        let scaled: Vec<f64> = right.iter().zip(&by_row).map(|(b, scale)| b * scale).collect();
        factors.solve(&scaled).iter().zip(&by_column).map(|(x, scale)| x * scale).collect()
    };
    let lu = solve(&right);
    let mut reference = lu.clone();
    for _ in 0..2 {
        let correction = solve(&matrix.residual(&reference, &right));
        reference.iter_mut().zip(&correction).for_each(|(x, dx)| *x += dx);
    }

    let (unknowns, equations) = (unknown_kinds(&layout), equation_kinds(&layout, system));
    let residual = |x: &[f64]| {
        let (missed, size) = (matrix.residual(x, &right), matrix.size_of_terms(x));
        relative(&equations, |i| missed[i].abs(), |i| size[i] + right[i].abs())
    };
    let error = |x: &[f64]| relative(&unknowns, |i| (x[i] - reference[i]).abs(), |i| reference[i].abs());
    let missed: Vec<Vector3<f64>> =
        matrix.residual(&mine, &right).chunks_exact(3).map(Vector3::from_column_slice).collect();
    let again = full.with_right(system, &missed);
    sweep.solve(&again).unwrap();
    let refined: Vec<f64> = mine.iter().zip(swept(&layout, &again, sweep)).map(|(x, dx)| x + dx).collect();
    Outcome {
        refined: [residual(&refined), error(&refined)],
        residual: residual(&mine),
        reference_residual: residual(&reference),
        error: error(&mine),
        lu_error: error(&lu),
    }
}

/// The system of the first iteration of a rod's fourth step, or of the bent rod's way to equilibrium.
fn check(name: &str, rod: &Rod, mesh: &Mesh, dt: Option<f64>, row: Row) -> Outcome {
    let boundary = horizontal();
    let mut stepper = Stepper::new(mesh.clone(), rod.clone(), State::at_rest_shape(mesh, &boundary.base));
    let scheme = Scheme::from_spectral_radius(0.0);
    // a bent rod in motion; for statics, of 1 ms
    for _ in 0..3 {
        stepper.step(&boundary, scheme, dt.unwrap_or(1e-3), row).unwrap();
    }
    let time = dt.map_or(Time::Static, |dt| Time::Step { scheme, dt, row });
    let mut system = empty(mesh, rod);
    assemble(mesh, rod, &stepper.state, &stepper.state, &boundary, &time, &mut system);
    let mut sweep = Sweep::new(mesh.cells.len(), &mesh.rule, rod.is_extensible());
    let outcome = compare(mesh, &system, &mut sweep);
    let scene = format!("{name}, {} × {}, {dt:?} s, {row:?}: {outcome:?}", mesh.cells.len(), mesh.rule.stages);
    judge(&scene, rod, mesh, dt.map_or(0.0, |dt| scheme.rate_weight(dt)), &outcome);
    outcome
}

/// The bounds of every comparison; `rate` is ∂v/∂x of the step, 0 for statics.
fn judge(scene: &str, rod: &Rod, mesh: &Mesh, rate: f64, outcome: &Outcome) {
    // The inertia of a cell over its bending stiffness. A cell much longer than the bending wave of a step, 1 ≪ (h/λ)⁴,
    // moves as it is pushed whatever its stiffness, and its moments at the nodes are differences of larger ones:
    // roundings are lost, in the LU as well. Measured: a hundredth of that many in the residual, a twentieth in the
    // solution, all at 1e-5 s on 30 cells and fewer. The sweep's next solve, which is Newton's next iteration, makes
    // them good.
    let h = mesh.length() / mesh.cells.len() as f64;
    let inertia = rod.mass_per_length * rate.powi(2);
    let lost = f64::EPSILON * inertia * h.powi(4) / rod.stiffness.x;
    assert!(outcome.reference_residual < 1e-15, "no reference: {scene}");
    assert!(outcome.residual < 1e-12 + 0.01 * lost, "{scene}");
    assert!(outcome.error < 1e-9 + 0.05 * lost, "{scene}");
    assert!(outcome.refined[0] < 1e-12 && outcome.refined[1] < 1e-9, "{scene}");
}

/// The rod with the shear and stretch of its section.
fn extensible(rod: &Rod, youngs_modulus: f64) -> Rod {
    let area = (rod.stiffness.x / youngs_modulus * 4.0 * std::f64::consts::PI).sqrt();
    let stretch = 1.0 / (youngs_modulus * area);
    // GA κ with G = E/2.6 and κ = 0.9
    let shear = stretch * 2.6 / 0.9;
    Rod { compliance: Vector3::new(shear, shear, stretch), ..rod.clone() }
}

const STEPS: [Option<f64>; 5] = [None, Some(1e-5), Some(1e-3), Some(1.0 / 30.0), Some(1.0)];

/// The three rods, with and without shear and stretch, in both rows.
fn check_all(cells: usize, stages: usize, steps: &[Option<f64>]) {
    for (name, length, youngs_modulus, rod) in rods() {
        let mesh = Mesh::uniform(length, cells, stages, Vector3::zeros());
        for &dt in steps {
            check(name, &rod, &mesh, dt, Row::Positions);
            check(name, &extensible(&rod, youngs_modulus), &mesh, dt, Row::Positions);
            if dt.is_some() {
                check(name, &rod, &mesh, dt, Row::Rotations);
            }
        }
    }
}

#[test]
fn few_cells() {
    for stages in 1..=4 {
        check_all(6, stages, &STEPS);
    }
}

#[test]
fn many_cells() {
    check_all(50, 1, &STEPS);
    check_all(30, 2, &STEPS);
    check_all(20, 3, &STEPS);
    check_all(100, 1, &STEPS[1..3]);
}

#[test]
fn four_hundred_cells() {
    check_all(400, 1, &STEPS[2..4]);
    // where the LU is at its worst: inertia of the acceleration row against the stiffness of a hair
    let (name, length, _, rod) = &rods()[1];
    let mesh = Mesh::uniform(*length, 400, 4, Vector3::zeros());
    check(name, rod, &mesh, None, Row::Positions);
    let outcome = check(name, rod, &mesh, Some(1.0 / 30.0), Row::Rotations);
    // measured: 7e-15 and 7e-7
    assert!(outcome.error < 1e-12 && outcome.lu_error > 1e-9, "the LU needs no refinement any more: {outcome:?}");
}

#[test]
fn ends_held_in_part() {
    let mut seed = 1;
    for (name, length, youngs_modulus, rod) in rods() {
        for (cells, stages, dt, extends) in (0..64).map(|i| (6 + 4 * (i % 3), 1 + i % 4, STEPS[i % 5], i / 4 % 2 == 1))
        {
            let rod = if extends { extensible(&rod, youngs_modulus) } else { rod.clone() };
            // an arc of one radian: a straight rod that cannot stretch, held along its axis, bears any force
            let mesh = Mesh::uniform(length, cells, stages, Vector3::new(0.8, 0.6, 0.3) / length);
            let mut boundary = horizontal();
            let mut stepper = Stepper::new(mesh.clone(), rod.clone(), State::at_rest_shape(&mesh, &boundary.base));
            let scheme = Scheme::from_spectral_radius(0.0);
            for _ in 0..3 {
                stepper.step(&boundary, scheme, dt.unwrap_or(1e-3), Row::Positions).unwrap();
            }
            let mut mix = || -> Held {
                let mut three = || [(); 3].map(|()| uniform(&mut seed) > 0.0);
                Held { translation: three(), rotation: three() }
            };
            let mut held = [mix(), mix()];
            if dt.is_none() {
                // nothing that could move freely
                held[0] = if cells == 6 { Held::PINNED } else { Held::CLAMPED };
                held[1].translation[0] |= cells == 6;
                held[1].rotation = if cells == 6 { [true; 3] } else { held[1].rotation };
            }
            // half a radian and a hundredth of a length away
            let mut support = |section: &Section, held: Held| {
                let mut vector = |size: f64| Vector3::from_fn(|_, _| size * uniform(&mut seed));
                let position = section.position + vector(0.01 * length);
                Support { held, ..Support::at_rest(position, section.rotation * so3::exp(&vector(0.3))) }
            };
            boundary.base = support(&stepper.state.nodes[0], held[0]);
            boundary.tip = support(stepper.state.tip(), held[1]);
            let time = dt.map_or(Time::Static, |dt| Time::Step { scheme, dt, row: Row::Positions });
            let mut system = empty(&mesh, &rod);
            assemble(&mesh, &rod, &stepper.state, &stepper.state, &boundary, &time, &mut system);
            let mut sweep = Sweep::new(cells, &mesh.rule, rod.is_extensible());
            let outcome = compare(&mesh, &system, &mut sweep);
            let scene = format!("{name}, {cells} × {stages}, {dt:?} s, {held:?}, stretches {extends}: {outcome:?}");
            judge(&scene, &rod, &mesh, dt.map_or(0.0, |dt| scheme.rate_weight(dt)), &outcome);
        }
    }
}
