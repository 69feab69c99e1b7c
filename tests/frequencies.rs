//! Natural frequencies, and the forced vibration of the linearised rod, against closed forms and converged
//! eigenproblems.
//!
//! Meshes are the coarsest round numbers whose error stays below a tenth of the tolerance.

mod common;

use common::{Case, along_x, clamped, kirchhoff, unstressed};
use cosserat_rod::boundary::Boundary;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::modes::modes;
use cosserat_rod::pose;
use cosserat_rod::rod::Rod;
use cosserat_rod::stepper::Stepper;
use nalgebra::{DMatrix, DVector, Vector3};
use std::f64::consts::TAU;

/// The first natural frequencies about the equilibrium reached from the unstressed rod, rad/s.
fn frequencies(mesh: &Mesh, rod: &Rod, boundary: &Boundary, count: usize) -> Vec<f64> {
    let mut stepper = unstressed(mesh.clone(), rod.clone(), boundary);
    stepper.equilibrium(boundary).expect("an equilibrium");
    let modes = modes(&mut stepper, boundary, count).expect("modes");
    modes.iter().map(|mode| mode.frequency() * TAU).collect()
}

/// The bending frequencies of a straight round rod. They come in pairs, one for each plane.
fn bending_frequencies(mesh: &Mesh, rod: &Rod, boundary: &Boundary, count: usize) -> Vec<f64> {
    let both = frequencies(mesh, rod, boundary, 2 * count);
    for pair in both.chunks(2) {
        // the planes differ by rounding: half of machine precision, as ω² comes from 1/ω² of all modes at once
        assert!((pair[0] / pair[1] - 1.0).abs() < 1e-8, "{pair:?} is one mode in two planes");
    }
    both.into_iter().step_by(2).collect()
}

#[test]
fn clamped_free_helical_spring() {
    let case = Case::read("c3_spring_frequencies_cf");
    let (bend, twist) = (case.input("rhoI_bend"), case.input("rhoI_twist"));
    let inextensible = Rod {
        mass_per_length: case.input("rhoA"),
        inertia_per_length: Vector3::new(bend, bend, twist),
        ..kirchhoff(case.input("EI"), case.input("GJ"))
    };
    let area = case.input("rhoA") / case.input("rho");
    let shear_modulus = case.input("E") / (2.0 * (1.0 + case.input("nu")));
    let shear = 1.0 / (0.88 * shear_modulus * area);
    let compliance = Vector3::new(shear, shear, 1.0 / (case.input("E") * area));
    let extensible = Rod { compliance, ..inextensible.clone() };

    let kappa_rest = Vector3::new(0.0, case.input("curvature0"), case.input("torsion0"));
    // |κ̂| h = 1
    let cells = (kappa_rest.norm() * case.input("L")).ceil() as usize;
    let mesh = Mesh::uniform(case.input("L"), cells, 4, kappa_rest);
    for (name, rod) in
        [("frequencies, inextensible+rotary inertia", inextensible), ("frequencies, shear k=0.88", extensible)]
    {
        let omega = frequencies(&mesh, &rod, &clamped(along_x()), case.expected(name).len());
        case.check(name, &omega.iter().map(|omega| omega / TAU).collect::<Vec<_>>());
    }
}

#[test]
fn cantilever_in_bending_and_in_torsion() {
    let case = Case::read("c5_cantilever_eb");
    let mesh = Mesh::uniform(case.input("L"), 6, 4, Vector3::zeros());
    let boundary = clamped(along_x());
    // bending and torsion of a straight rod do not couple; the one not looked at is made too stiff to show among the
    // first
    let stiffer = 1e8;
    let rod = Rod {
        mass_per_length: case.input("rhoA"),
        inertia_per_length: Vector3::z() * case.input("rhoJ"),
        ..kirchhoff(case.input("EI"), case.input("GJ"))
    };
    let bending = Rod { stiffness: rod.stiffness.component_mul(&Vector3::new(1.0, 1.0, stiffer)), ..rod.clone() };
    let omega = bending_frequencies(&mesh, &bending, &boundary, 5);
    case.check("omega_n bending", &omega);
    let fourth_power = case.input("rhoA") * case.input("L").powi(4) / case.input("EI");
    case.check("beta_n L", &omega.iter().map(|omega| (omega * omega * fourth_power).powf(0.25)).collect::<Vec<_>>());

    let torsion = Rod { stiffness: rod.stiffness.component_mul(&Vector3::new(stiffer, stiffer, 1.0)), ..rod };
    case.check("omega_n torsion", &frequencies(&mesh, &torsion, &boundary, 4));
}

#[test]
fn timoshenko_cantilever() {
    let case = Case::read("c5_cantilever_timoshenko");
    let mesh = Mesh::uniform(case.input("L"), 6, 4, Vector3::zeros());
    let (rotary, shear) = (case.input("rhoI"), 1.0 / case.input("kGA"));
    // torsion out of the way of the bending modes
    let rod = Rod {
        mass_per_length: case.input("rhoA"),
        inertia_per_length: Vector3::new(rotary, rotary, 2.0 * rotary),
        compliance: Vector3::new(shear, shear, 0.0),
        ..kirchhoff(case.input("EI"), 1e8)
    };
    case.check("first 5 bending frequencies", &bending_frequencies(&mesh, &rod, &clamped(along_x()), 5));
}

#[test]
fn cantilever_hanging_and_standing() {
    let case = Case::read("c5_hanging_cantilever_gravity");
    let mesh = Mesh::uniform(case.input("L"), 6, 4, Vector3::zeros());
    let rod = Rod { mass_per_length: case.input("rhoA"), ..kirchhoff(case.input("EI"), 1.0) };
    let mut omega = vec![];
    for gravity in case.inputs("g") {
        let boundary = Boundary { gravity: Vector3::x() * gravity, ..clamped(along_x()) };
        omega.extend(bending_frequencies(&mesh, &rod, &boundary, 4));
    }
    case.check("first 4 frequencies per g", &omega);
}

#[test]
fn hanging_chain() {
    let case = Case::read("c5_hanging_chain");
    let (length, gravity) = (case.input("L"), case.input("g"));
    // what stiffness is left raises ω: the clamp shortens the chain by the layer √(EI/ρAgL) = 1e-4 L in which it bends,
    // half of which is relative, and the fifth mode bends by itself as much again; together a twentieth of the
    // tolerance
    let stiffness = 1e-8 * case.input("rhoA") * gravity * length.powi(3);
    let rod = Rod { mass_per_length: case.input("rhoA"), ..kirchhoff(stiffness, stiffness) };
    let boundary = Boundary { gravity: Vector3::x() * gravity, ..clamped(along_x()) };
    let mesh = Mesh::uniform(length, 24, 4, Vector3::zeros());
    case.check("omega_n", &bending_frequencies(&mesh, &rod, &boundary, 5));
}

/// K⁻¹ M y for a deflection y of all points and the tip along world y: deflection, and (n, m) at the base.
fn response(stepper: &mut Stepper, boundary: &Boundary, y: &[f64]) -> (DVector<f64>, [Vector3<f64>; 2]) {
    let field: Vec<_> = y.iter().map(|&y| (Vector3::y() * y, Vector3::zeros())).collect();
    let (nodes, points) = stepper
        .linear_statics(boundary, |mesh, rod, state, system| pose::load_with_inertia(mesh, rod, state, &field, system))
        .expect("a stable rod");
    let deflection = points.iter().chain(nodes.last()).map(|delta| delta.w.y);
    (DVector::from_iterator(y.len(), deflection), [nodes[0].n, nodes[0].m])
}

#[test]
fn transfer_functions_of_a_shaken_base() {
    // relative to the base the rod feels the inertia of its own deflection x and of the base's 1: x = ω² K⁻¹M (x + 1)
    let case = Case::read("c5_base_excitation_tf");
    let mesh = Mesh::uniform(case.input("L"), 6, 4, Vector3::zeros());
    let rod = Rod { mass_per_length: case.input("rhoA"), ..kirchhoff(case.input("EI"), 1.0) };
    let boundary = clamped(along_x());
    let mut stepper = unstressed(mesh, rod, &boundary);
    let size = stepper.mesh.points() + 1;
    let mut flexibility = DMatrix::zeros(size, size);
    for column in 0..size {
        let mut unit = vec![0.0; size];
        unit[column] = 1.0;
        flexibility.set_column(column, &response(&mut stepper, &boundary, &unit).0);
    }
    let ones = DVector::from_element(size, 1.0);
    let (mut tip, mut moment, mut shear) = (vec![], vec![], vec![]);
    for omega in case.inputs("omega") {
        let omega2 = omega * omega;
        let stiff = DMatrix::identity(size, size) - &flexibility * omega2;
        let relative = stiff.lu().solve(&(&flexibility * &ones * omega2)).expect("no resonance");
        let (_, [n, m]) = response(&mut stepper, &boundary, (&relative + &ones).as_slice());
        tip.push(relative[size - 1] + 1.0);
        moment.push(m.z * omega2);
        // m_z = EI w'' and m_s = −r_s × n
        shear.push(-n.y * omega2);
    }
    case.check("tip/base", &tip);
    case.check("EI w''(0)", &moment);
    case.check("EI w'''(0)", &shear);
}
