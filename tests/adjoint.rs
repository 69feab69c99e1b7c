//! What the virtual power of a rod promises: about an equilibrium under dead forces, bent and twisted in space, the
//! stiffness is symmetric. Then all ω² are real; the rod does not flutter.
#![allow(non_snake_case)]

mod common;

use common::{clamped, rubber, unstressed};
use cosserat_rod::boundary::{Boundary, Held, Support};
use cosserat_rod::mesh::Mesh;
use cosserat_rod::pose::load_with_inertia;
use cosserat_rod::rod::Rod;
use cosserat_rod::so3;
use cosserat_rod::stepper::Stepper;
use nalgebra::{DMatrix, Matrix3, Vector3};

/// M y: momenta of the velocities y of all points and the tip, of position and of rotation, one after another.
fn momenta(stepper: &Stepper, y: &[(Vector3<f64>, Vector3<f64>)]) -> Vec<f64> {
    let Stepper { mesh, rod, state, .. } = stepper;
    let mut all = vec![];
    for (i, (w, phi)) in y.iter().enumerate() {
        let (linear, angular) = match state.points.get(i) {
            Some(point) => {
                let weight = mesh.cells[i / mesh.rule.stages].length * mesh.rule.b[i % mesh.rule.stages];
                let R = &point.rotation;
                let turning = R * rod.inertia_per_length.component_mul(&R.tr_mul(phi));
                (w * (weight * rod.mass_per_length), turning * weight)
            }
            None => (w * rod.tip_mass, phi * rod.tip_inertia),
        };
        all.extend(linear.iter().chain(&angular));
    }
    all
}

/// M K⁻¹ M.
fn dynamic_flexibility(stepper: &mut Stepper, boundary: &Boundary) -> DMatrix<f64> {
    let sections = stepper.mesh.points() + 1;
    let mut matrix = DMatrix::zeros(6 * sections, 6 * sections);
    for column in 0..6 * sections {
        let unit = |i: usize| Vector3::from_fn(|row, _| f64::from(3 * i + row == column));
        let y: Vec<_> = (0..sections).map(|i| (unit(2 * i), unit(2 * i + 1))).collect();
        let (nodes, points) = stepper
            .linear_statics(boundary, |mesh, rod, state, residuals| load_with_inertia(mesh, rod, state, &y, residuals))
            .expect("a stable rod");
        let moved: Vec<_> = points.iter().chain(nodes.last()).map(|delta| (delta.w, delta.phi)).collect();
        matrix.column_mut(column).copy_from_slice(&momenta(stepper, &moved));
    }
    matrix
}

#[test]
fn stiffness_is_symmetric_about_equilibria_in_space() {
    let hanging = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    let round = rubber();
    let flat = Rod { stiffness: round.stiffness.component_mul(&Vector3::new(1.0, 4.0, 1.5)), ..round.clone() };
    // softer than a real section, so that it counts
    let stretching = Rod { compliance: Vector3::new(0.2, 0.3, 0.1), ..round.clone() };
    let laden = Rod { tip_mass: 0.02, tip_inertia: 1e-5, ..round.clone() };
    let curved = Vector3::new(1.5, -0.8, 2.0);
    let dead = Boundary { tip_force: Vector3::new(0.3, 0.18, 0.15), gravity: Vector3::z() * -9.81, ..clamped(hanging) };
    // the tip half a metre up and sideways, held with and without its rotation
    let tip = |held: Held| Boundary {
        tip: Support {
            held,
            ..Support::at_rest(Vector3::new(0.3, 0.2, -0.5), so3::exp(&Vector3::new(0.2, 0.4, 0.1)) * hanging)
        },
        ..dead
    };
    let hinged = |boundary: Boundary| Boundary { base: Support { held: Held::PINNED, ..boundary.base }, ..boundary };
    for stages in 1..=4 {
        for (what, rod, kappa_rest, boundary) in [
            ("round", &round, Vector3::zeros(), dead),
            ("flat, curved and twisted", &flat, curved, dead),
            ("with shear and stretch", &stretching, curved, dead),
            ("with a body", &laden, curved, dead),
            ("clamped at both ends", &flat, curved, tip(Held::CLAMPED)),
            ("hinged at both ends", &flat, curved, hinged(tip(Held::PINNED))),
        ] {
            let mesh = Mesh::uniform(1.0, 5, stages, kappa_rest);
            let mut stepper = unstressed(mesh, rod.clone(), &clamped(hanging));
            stepper.equilibrium(&boundary).unwrap_or_else(|diverged| panic!("{what}, {stages} stages: {diverged}"));
            let matrix = dynamic_flexibility(&mut stepper, &boundary);
            let asymmetry = (&matrix - matrix.transpose()).amax() / matrix.amax();
            println!("{what}, {stages} stages: {asymmetry:.1e}, tip {:?}", stepper.state.tip().position);
            assert!(asymmetry < 1e-12, "{what}, {stages} stages: {asymmetry:.1e}");
        }
    }
}
