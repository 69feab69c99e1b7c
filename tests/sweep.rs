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
use cosserat_rod::mesh::{Gauss, Mesh};
use cosserat_rod::pose::{Row, Section, State, Time, assemble};
use cosserat_rod::rod::Rod;
use cosserat_rod::so3;
use cosserat_rod::stepper::Stepper;
use cosserat_rod::sweep::{Increment, Joint, Sweep, System};
use full::{Full, G, Layout, M, N, PHI, W};
use nalgebra::{DMatrix, DVector, Matrix1, Matrix2, RowVector2, SMatrix, Vector1, Vector2, Vector3, Vector4};
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

/// How many kinds of blocks there are.
const KINDS: usize = 5;

/// The kinds of blocks, number by number.
fn by_number(layout: &Layout, kinds: &[usize]) -> Vec<usize> {
    kinds.iter().flat_map(|kind| vec![*kind; layout.size(*kind)]).collect()
}

/// The kinds of the equations, number by number. Where an end is held, in part, its equations are motions.
fn equation_kinds<const V: usize, const S: usize>(layout: &Layout, system: &System<V, S>) -> Vec<usize> {
    let mut kinds = by_number(layout, &layout.kinds_of_equations());
    let tip = kinds.len() - V - S;
    for (at, joint) in [(0, &system.base_joint), (tip, &system.tip_joint)] {
        let held = joint.iter().flat_map(|joint| joint.held.0.into_iter().chain(joint.held.1));
        for (i, held) in held.enumerate() {
            kinds[at + i] = match (held, i < V) {
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
fn swept<const V: usize, const S: usize>(layout: &Layout, system: &System<V, S>, sweep: &Sweep<V, S>) -> Vec<f64> {
    let mut x = vec![DVector::zeros(0); layout.blocks()];
    let mut put = |at: usize, delta: &Increment<V, S>| {
        for (kind, numbers) in
            [(PHI, delta.phi.as_slice()), (W, delta.w.as_slice()), (N, delta.n.as_slice()), (M, delta.m.as_slice())]
        {
            x[at + kind] = DVector::from_column_slice(numbers);
        }
    };
    for (j, node) in sweep.nodes.iter().enumerate() {
        put(layout.node(j), node);
    }
    for (i, delta) in sweep.points.iter().enumerate() {
        put(layout.point(i / layout.stages, i % layout.stages), delta);
    }
    for (i, (point, delta)) in system.points.iter().zip(&sweep.points).enumerate() {
        let (j, k) = (i / layout.stages, i % layout.stages);
        let dense = |matrix: &SMatrix<f64, S, S>| DMatrix::from_column_slice(S, S, matrix.as_slice());
        let log = dense(&point.spin).try_inverse().unwrap() * (delta.phi - sweep.nodes[j].phi);
        let stress = delta.m - dense(&point.law_log) * log;
        let g = dense(&point.law_strain).lu().solve(&stress).unwrap();
        x[layout.point(j, k) + G] = DVector::from_column_slice(g.as_slice());
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
fn compare<const V: usize, const S: usize>(rule: &Gauss, system: &System<V, S>) -> Outcome {
    let mut sweep = Sweep::new(system.cells.len(), rule, system.extensible);
    sweep.solve(system).unwrap();
    let full = Full::new(system, rule);
    let layout = full.layout;
    let mine = swept(&layout, system, &sweep);
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

    let (unknowns, equations) = (by_number(&layout, &layout.unknowns()), equation_kinds(&layout, system));
    let residual = |x: &[f64]| {
        let (missed, size) = (matrix.residual(x, &right), matrix.size_of_terms(x));
        relative(&equations, |i| missed[i].abs(), |i| size[i] + right[i].abs())
    };
    let error = |x: &[f64]| relative(&unknowns, |i| (x[i] - reference[i]).abs(), |i| reference[i].abs());
    let missed = matrix.residual(&mine, &right);
    let rows = layout.places(&layout.kinds_of_equations());
    let missed: Vec<_> = rows.windows(2).map(|row| DVector::from_column_slice(&missed[row[0]..row[1]])).collect();
    let again = full.residuals(system, &missed);
    sweep.solve_for(&again);
    let refined: Vec<f64> = mine.iter().zip(swept(&layout, system, &sweep)).map(|(x, dx)| x + dx).collect();
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
    let outcome = compare(&mesh.rule, &system);
    let scene = format!("{name}, {} × {}, {dt:?} s, {row:?}: {outcome:?}", mesh.cells.len(), mesh.rule.stages);
    judge(&scene, rod, mesh, dt.map_or(0.0, |dt| scheme.rate_weight(dt)), &outcome);
    outcome
}

/// The bounds of every comparison; `rate` is ∂v/∂x of the step, 0 for statics.
fn judge(scene: &str, rod: &Rod, mesh: &Mesh, rate: f64, outcome: &Outcome) {
    // The inertia of a cell over its bending stiffness. A cell much longer than the bending wave of a step, 1 ≪ (h/λ)⁴,
    // moves as it is pushed whatever its stiffness, and its moments at the nodes are differences of larger ones:
    // roundings are lost, in the LU as well. Measured: a hundredth of that many in the residual, a fourteenth in the
    // solution, all at 1e-5 s on 30 cells and fewer. The springs of a held tip lose those of their forces. The sweep's
    // next solve, which is Newton's next iteration, makes them good.
    let h = mesh.length() / mesh.cells.len() as f64;
    let inertia = rod.mass_per_length * rate.powi(2);
    let lost = f64::EPSILON * inertia * h.powi(4) / rod.stiffness.x;
    assert!(outcome.reference_residual < 1e-15, "no reference: {scene}");
    assert!(outcome.residual < 2e-12 + 0.01 * lost, "{scene}");
    assert!(outcome.error < 1e-9 + 0.1 * lost, "{scene}");
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
            let outcome = compare(&mesh.rule, &system);
            let scene = format!("{name}, {cells} × {stages}, {dt:?} s, {held:?}, stretches {extends}: {outcome:?}");
            judge(&scene, &rod, &mesh, dt.map_or(0.0, |dt| scheme.rate_weight(dt)), &outcome);
        }
    }
}

/// A curved rod in a plane, its ends held in part or not, with residuals of all kinds.
fn plane_system(
    cells: usize,
    rule: &Gauss,
    inertia: f64,
    extensible: bool,
    ends: bool,
    seed: &mut u64,
) -> System<2, 1> {
    let mut random = |size: f64| size * uniform(seed);
    let mut system = System::<2, 1>::new(cells, rule, extensible);
    system.mass = inertia;
    for (i, point) in system.points.iter_mut().enumerate() {
        let angle = i as f64 / (cells * rule.stages) as f64;
        let (sin, cos) = angle.sin_cos();
        point.spin = Matrix1::new(1.0);
        // (cos, −sin) turned, and its moments
        point.w_phi = Vector2::new(-sin, -cos);
        point.w_n = Matrix2::new(1e-3, random(1e-4), random(1e-4), 2e-3);
        point.m_phi = Matrix1::new(1e-3 * inertia + random(0.3));
        point.m_n = RowVector2::new(sin, cos);
        (point.p_strain, point.law_strain) = [Matrix1::new(1.0 + random(0.3)); 2].into();
    }
    for ends in &mut system.cells {
        (ends.length, ends.spin) = (1.0 / cells as f64, Matrix1::new(1.0));
    }
    let e = &mut system.residuals;
    for point in &mut e.points {
        let mut pair = || Vector2::from_fn(|_, _| random(1.0));
        (point.w, point.n) = (pair(), pair());
        [point.log, point.p] = [(); 2].map(|()| Vector1::new(random(1.0)));
    }
    for ends in &mut e.cells {
        (ends.w, ends.n) = (Vector2::new(random(1.0), random(1.0)), Vector2::new(random(1.0), random(1.0)));
        (ends.log, ends.m) = (Vector1::new(random(1.0)), Vector1::new(random(1.0)));
    }
    let mut pair = || (Vector2::new(random(1.0), random(1.0)), Vector1::new(random(1.0)));
    (e.base, e.base_load, e.tip, e.tip_load) = (pair(), pair(), pair(), pair());
    if ends {
        let (sin, cos) = random(3.0).sin_cos();
        let by_w = Matrix2::new(cos, sin, -sin, cos);
        let mut joint = |held: ([bool; 2], [bool; 1])| {
            let by_phi = Matrix1::new(1.5 + random(0.3));
            Some(Joint { held, by_w, by_phi, of_moment: by_phi.map(|x| 1.0 / x), springs: (100.0, 100.0) })
        };
        (system.base_joint, system.tip_joint) = (joint(([true, true], [false])), joint(([true, false], [true])));
    }
    system
}

#[test]
fn plane_rods() {
    let mut seed = 7;
    for stages in 1..=4 {
        let rule = Gauss::new(stages);
        for (cells, inertia) in [(1, 1.0), (6, 0.0), (6, 1e2), (30, 1e4), (100, 1.0)] {
            for (extensible, ends) in [(false, false), (true, false), (false, true), (true, true)] {
                let system = plane_system(cells, &rule, inertia, extensible, ends, &mut seed);
                let outcome = compare(&rule, &system);
                let scene = format!("{cells} × {stages}, {inertia}, {extensible}, {ends}: {outcome:?}");
                assert!(outcome.reference_residual < 1e-15, "no reference: {scene}");
                assert!(outcome.residual < 1e-12 && outcome.error < 1e-9, "{scene}");
                assert!(outcome.refined[0] < 1e-12 && outcome.refined[1] < 1e-9, "{scene}");
            }
        }
    }
}
