//! Equilibria and buckling loads against closed forms and converged boundary value solutions.
//!
//! Meshes are the coarsest round numbers whose error stays below a tenth of the tolerance.

mod common;

use common::{Case, along_x, clamped, kirchhoff, tip_angle, unstressed};
use cosserat_rod::boundary::Boundary;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::modes::modes;
use cosserat_rod::rod::Rod;
use cosserat_rod::stepper::Stepper;
use nalgebra::{Matrix3, Vector2, Vector3};
use std::f64::consts::PI;

/// Loads the rod from its unstressed shape.
fn equilibrium(mesh: &Mesh, rod: &Rod, boundary: &Boundary) -> Stepper {
    let mut stepper = unstressed(mesh.clone(), rod.clone(), boundary);
    stepper.equilibrium(boundary).expect("an equilibrium");
    stepper
}

/// The centreline at half the arc length; the cells are equal.
fn middle(stepper: &Stepper) -> Vector3<f64> {
    let (mesh, cells) = (&stepper.mesh, stepper.mesh.cells.len());
    match cells % 2 {
        0 => stepper.state.nodes[cells / 2].position,
        _ => stepper.state.position_within(mesh, &stepper.rod, cells / 2, 0.5),
    }
}

#[test]
fn elastica_under_a_dead_tip_force() {
    let case = Case::read("c1_elastica_dead_tip_force");
    let length = case.input("L");
    let mesh = Mesh::uniform(length, 6, 4, Vector3::zeros());
    let rod = kirchhoff(case.input("EI"), 1.0);
    let (mut u, mut w, mut theta, mut moment) = (vec![], vec![], vec![], vec![]);
    for load in case.inputs("loads_P") {
        let bent = equilibrium(&mesh, &rod, &Boundary { tip_force: Vector3::y() * load, ..clamped(along_x()) });
        let tip = bent.state.tip().position / length;
        u.push(1.0 - tip.x);
        w.push(tip.y);
        theta.push(tip_angle(&bent));
        moment.push(bent.state.nodes[0].moment.z);
    }
    case.check("u_over_L", &u);
    case.check("w_over_L", &w);
    case.check("theta_tip", &theta);
    case.check("root moment", &moment);
}

#[test]
fn cantilever_under_its_own_weight() {
    let case = Case::read("c1_heavy_cantilever_master_curve");
    // at the largest load bending lives in a layer of √(EI/wL) = 0.03 L at the clamp
    let nodes: Vec<f64> = (0..=12).map(|j| case.input("L") * (f64::from(j) / 12.0).powi(2)).collect();
    let mesh = Mesh::graded(&nodes, 4, |_| Vector3::zeros());
    let (mut width, mut drop, mut ratio, mut slope, mut moment) = (vec![], vec![], vec![], vec![], vec![]);
    for weight in case.inputs("weight_per_length_w") {
        let rod = Rod { mass_per_length: weight, ..kirchhoff(case.input("EI"), 1.0) };
        let bent = equilibrium(&mesh, &rod, &Boundary { gravity: -Vector3::y(), ..clamped(along_x()) });
        let tip = bent.state.tip().position;
        width.push(tip.x);
        drop.push(-tip.y);
        ratio.push(-tip.y / tip.x);
        slope.push(-tip_angle(&bent));
        moment.push(-bent.state.nodes[0].moment.z);
    }
    case.check("x_tip", &width);
    case.check("drop of tip", &drop);
    case.check("H/W", &ratio);
    case.check("tip slope", &slope);
    case.check("root moment", &moment);
}

#[test]
fn roll_up_by_a_tip_couple() {
    let case = Case::read("c1_rollup_tip_moment");
    let length = case.input("L");
    let rod = kirchhoff(case.input("EI"), 1.0);
    // constant curvature: the rotation is exact on any mesh, the position an integral of sines over π per cell at most
    let mesh = Mesh::uniform(length, 8, 4, Vector3::zeros());
    let (mut x, mut y, mut theta) = (vec![], vec![], vec![]);
    for couple in case.inputs("tip_couple_over_pi") {
        let tip_moment = Vector3::z() * (couple * PI * case.input("EI") / length);
        let bent = equilibrium(&mesh, &rod, &Boundary { tip_moment, ..clamped(along_x()) });
        let tip = bent.state.tip().position / length;
        x.push(tip.x);
        y.push(tip.y);
        theta.push(tip_angle(&bent));
    }
    case.check("x_tip/L", &x);
    case.check("y_tip/L", &y);
    case.check("tip angle", &theta);
}

/// The 45° arc in the x-y plane, bending towards +y, under a dead force along +z.
fn bend(case: &Case, force: f64) -> Stepper {
    let boundary = Boundary { tip_force: Vector3::z() * force, ..clamped(along_x()) };
    let kappa_rest = along_x().tr_mul(&Vector3::z()) / case.input("arc_radius");
    let mesh = Mesh::uniform(case.input("L"), 3, 4, kappa_rest);
    let stiffness = Vector3::new(case.input("EI1"), case.input("EI2"), case.input("GJ"));
    equilibrium(&mesh, &Rod { stiffness, ..kirchhoff(1.0, 1.0) }, &boundary)
}

#[test]
fn bend_of_45_degrees() {
    let case = Case::read("c2_bend45_600");
    let bent = bend(&case, case.input("F"));
    case.check_vectors("tip position", &[bent.state.tip().position]);
    case.check_vectors("mid-arc position", &[middle(&bent)]);
    case.check_vectors("root internal moment", &[bent.state.nodes[0].moment]);
}

#[test]
fn bend_of_45_degrees_with_the_torsion_constant_of_a_square() {
    let case = Case::read("c2_bend45_true_torsion");
    let bent: Vec<Stepper> = case.inputs("F").into_iter().map(|force| bend(&case, force)).collect();
    let each = |read: fn(&Stepper) -> Vector3<f64>| bent.iter().map(read).collect::<Vec<_>>();
    case.check_vectors("tip position", &each(|bent| bent.state.tip().position));
    case.check_vectors("root moment", &each(|bent| bent.state.nodes[0].moment));
}

#[test]
fn helix_pulled_at_the_free_end_of_its_wire() {
    let case = Case::read("c3_helix_cantilever_dead_force");
    let columns = case.inputs("clamp_frame_columns_d1_d2_d3");
    let kappa_rest = Vector3::from_column_slice(&case.inputs("u0"));
    // |κ̂| h = 1
    let cells = (kappa_rest.norm() * case.input("L")).ceil() as usize;
    let mesh = Mesh::uniform(case.input("L"), cells, 4, kappa_rest);
    let rod = kirchhoff(case.input("EI"), case.input("GJ"));
    let (mut tips, mut middles) = (vec![], vec![]);
    for force in case.inputs("F_z") {
        let boundary = clamped(Matrix3::from_column_slice(&columns));
        let pulled = equilibrium(&mesh, &rod, &Boundary { tip_force: Vector3::z() * force, ..boundary });
        tips.push(pulled.state.tip().position);
        middles.push(middle(&pulled));
    }
    case.check_vectors("tip position", &tips);
    case.check_vectors("mid position", &middles);
}

/// ω² of the first mode of a column straight up along x.
fn first_omega_squared(length: f64, rod: &Rod, boundary: &Boundary) -> f64 {
    let mesh = Mesh::uniform(length, 3, 4, Vector3::zeros());
    let mut column = equilibrium(&mesh, rod, boundary);
    assert_eq!(column.state.tip().position.yz(), Vector2::zeros(), "straight, buckled or not");
    modes(&mut column, boundary, 1).expect("modes")[0].omega_squared
}

/// Where f, nearly linear, changes its sign.
fn sign_change(f: impl Fn(f64) -> f64, mut a: f64, mut b: f64) -> f64 {
    let (mut f_a, mut f_b) = (f(a), f(b));
    for _ in 0..20 {
        let next = b - f_b * (b - a) / (f_b - f_a);
        (a, f_a) = (b, f_b);
        (b, f_b) = (next, f(next));
        // the secant gains more than a factor ten in every step by now
        if (b - a).abs() < 1e-7 * b {
            assert!(f(b * (1.0 - 1e-6)) > 0.0 && f(b * (1.0 + 1e-6)) < 0.0, "stable below, unstable above");
            return b;
        }
    }
    panic!("no sign change found, last at {b}");
}

#[test]
fn column_buckling_under_its_own_weight() {
    let case = Case::read("c4_self_buckling");
    let rod = Rod { mass_per_length: case.input("weight_per_length_w"), ..kirchhoff(case.input("EI"), 1.0) };
    let boundary = Boundary { gravity: -Vector3::x(), ..clamped(along_x()) };
    // over wL³ as ω² L⁴: nearly linear then
    let length = |load: f64| (load * case.input("EI") / case.input("weight_per_length_w")).cbrt();
    let scaled = |load: f64| first_omega_squared(length(load), &rod, &boundary) * length(load).powi(4);
    let load = sign_change(scaled, 1.0, 2.0);
    case.check("(w L^3/EI)_cr", &[load]);
    case.check("L_cr", &[length(load)]);
}

/// The force along a clamped-free column at which its first mode comes to rest.
fn buckling_load(length: f64, rod: &Rod) -> f64 {
    let pushed = |load: f64| Boundary { tip_force: Vector3::x() * -load, ..clamped(along_x()) };
    sign_change(|load| first_omega_squared(length, rod, &pushed(load)), 0.5, 1.0)
}

#[test]
fn clamped_free_column_with_shear_and_compression() {
    let case = Case::read("c4_buckling_shear_extensible");
    let (axial, shear) = (1.0 / case.input("EA"), 1.0 / case.input("GA"));
    let rod = Rod { compliance: Vector3::new(shear, shear, axial), ..kirchhoff(case.input("EI"), 1.0) };
    case.check("P_cr clamped-free", &[buckling_load(case.input("L"), &rod)]);
}
