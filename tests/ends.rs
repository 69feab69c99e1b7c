//! Rods whose tip is held, in part or wholly, and rods whose base is a hinge: equilibria, buckling loads, motions.
#![allow(missing_docs)]

mod common;

use common::{Case, along_x, clamped, kirchhoff, unstressed};
use cosserat_rod::boundary::{Boundary, Held, Support};
use cosserat_rod::mesh::Mesh;
use cosserat_rod::modes::modes;
use cosserat_rod::rod::Rod;
use nalgebra::Vector3;

type Vec3 = Vector3<f64>;

/// A clamp that slides along the axis.
const GUIDED: Held = Held { translation: [true, true, false], rotation: [true; 3] };
/// A hinge that does not twist.
const HINGED: Held = Held { translation: [true; 3], rotation: [false, false, true] };
/// The same, sliding along the axis.
const SLIDING: Held = Held { translation: [true, true, false], rotation: [false, false, true] };

/// A rod of 1 m along x, held at both ends, pushed by `load`.
fn column(base: Held, tip: Held, load: f64) -> Boundary {
    let here = clamped(along_x());
    Boundary {
        base: Support { held: base, ..here.base },
        tip: Support { held: tip, ..Support::at_rest(Vec3::x(), along_x()) },
        tip_force: Vec3::x() * -load,
        ..here
    }
}

fn straight(cells: usize) -> Mesh {
    Mesh::uniform(1.0, cells, 4, Vec3::zeros())
}

/// ω² of the first mode of the column.
fn first_omega_squared(rod: &Rod, boundary: &Boundary) -> f64 {
    let mut column = unstressed(straight(4), rod.clone(), boundary);
    column.equilibrium(boundary).expect("an equilibrium");
    modes(&mut column, boundary, 1).expect("modes")[0].omega_squared
}

/// The load between `a` and `b` at which the first mode comes to rest, by bisection.
fn buckling_load(rod: &Rod, base: Held, tip: Held, mut a: f64, mut b: f64) -> f64 {
    let stable = |load: f64| first_omega_squared(rod, &column(base, tip, load)) > 0.0;
    assert!(stable(a) && !stable(b), "stable at {a}, unstable at {b}");
    // to 1e-9 of the load: far below every tolerance
    for _ in 0..30 {
        let middle = 0.5 * (a + b);
        if stable(middle) { a = middle } else { b = middle }
    }
    0.5 * (a + b)
}

#[test]
fn the_four_euler_columns() {
    let case = Case::read("c4_euler_columns");
    assert_eq!((case.input("L"), case.input("EI")), (1.0, 1.0));
    let rod = kirchhoff(1.0, 1.0);
    let columns = [
        (Held::CLAMPED, Held::FREE, 2.0, 3.0),
        (HINGED, SLIDING, 9.0, 11.0),
        (Held::CLAMPED, SLIDING, 18.0, 22.0),
        (Held::CLAMPED, GUIDED, 36.0, 42.0),
    ];
    let loads = columns.map(|(base, tip, a, b)| buckling_load(&rod, base, tip, a, b));
    case.check("P_cr", &loads);
}

#[test]
fn a_pinned_column_with_shear_and_compression() {
    let case = Case::read("c4_buckling_shear_extensible");
    let (axial, shear) = (1.0 / case.input("EA"), 1.0 / case.input("GA"));
    let rod = Rod { compliance: Vec3::new(shear, shear, axial), ..kirchhoff(case.input("EI"), 1.0) };
    case.check("P_cr pinned-pinned", &[buckling_load(&rod, HINGED, SLIDING, 8.0, 10.0)]);
}

#[test]
fn both_ends_clamped_and_brought_together() {
    let case = Case::read("c4_clamped_clamped_end_shortening");
    let (length, stiffness) = (case.input("L"), case.input("EI"));
    assert_eq!(length, 1.0);
    let mesh = straight(16);
    let boundary = |shortening: f64, sideways: f64| Boundary {
        tip: Support::at_rest(Vec3::x() * (1.0 - shortening), along_x()),
        gravity: Vec3::y() * sideways,
        ..clamped(along_x())
    };
    let mut rod = unstressed(mesh, kirchhoff(stiffness, 1.0), &boundary(0.0, 0.0));
    // A straight rod that cannot shorten yields to nothing: it is bent sideways while its tip can slide, clamped where it
    // then is, brought to the first shortening, and left to itself.
    let sliding = Boundary { gravity: Vec3::y(), ..column(Held::CLAMPED, GUIDED, 0.0) };
    rod.equilibrium(&sliding).expect("a bent rod");
    let (mut force, mut angle, mut moment, mut deflection) = (vec![], vec![], vec![], vec![]);
    rod.equilibrium(&boundary(0.01, 1.0)).expect("the first shortening, with a disturbance");
    for shortening in case.inputs("end_shortening_D_over_L") {
        rod.equilibrium(&boundary(shortening, 0.0)).expect("the next shortening");
        let state = &rod.state;
        force.push(-state.nodes[0].force.x);
        moment.push(state.nodes[0].moment.z.abs());
        deflection.push(state.nodes[8].position.y);
        // the tangent is steepest where the moment vanishes, at a quarter
        let steepest = &state.nodes[4];
        assert!(steepest.moment.norm() < 1e-6 * state.nodes[0].moment.norm(), "{}", steepest.moment);
        angle.push(common::angle(&steepest.rotation));
        assert!((state.tip().position - Vec3::x() * (1.0 - shortening)).norm() < 1e-14);
    }
    case.check("axial compressive force P", &force);
    case.check("max tangent angle", &angle);
    case.check("end moment magnitude", &moment);
    case.check("mid deflection", &deflection);
}
