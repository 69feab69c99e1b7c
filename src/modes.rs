//! Natural frequencies and modes about a static equilibrium, from the blocks of the statics.
//!
//! The sweep solves K x = f along the rod; with f = M y it is the operator K⁻¹M, whose eigenvalues are 1/ω². Its
//! largest ones come from a block Krylov space (several starting vectors, since a round rod has its bending modes in
//! pairs), orthogonal in the kinetic energy. An unstable equilibrium has a mode with ω² < 0, which the same space finds
//! among the largest |1/ω²|.

// R is the paper's letter
#![allow(non_snake_case)]

use crate::boundary::Boundary;
use crate::pose;
use crate::stepper::{Diverged, Stepper};
use crate::sweep::Increment;
use nalgebra::{DMatrix, Vector3};
use std::f64::consts::TAU;

/// Vectors that start the Krylov space: more than the multiplicity of any mode of a rod.
const BLOCK: usize = 4;

/// One mode of small vibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// ω², rad²/s²; negative where the equilibrium is unstable.
    pub omega_squared: f64,
    /// Displacement of the nodes, world frame, base first; the largest component is 1.
    pub shape: Vec<Vector3<f64>>,
    /// Part of the kinetic energy that is in the motion of the centreline; the rest turns the sections. Near 0 for
    /// torsion, whose `shape` says nothing.
    pub travel: f64,
}

impl Mode {
    /// Frequency in Hz; not a number for an unstable mode.
    pub fn frequency(&self) -> f64 {
        self.omega_squared.sqrt() / TAU
    }
}

/// Displacements (position, rotation) of all points, then of the tip.
type Field = Vec<(Vector3<f64>, Vector3<f64>)>;

/// The `count` modes nearest to ω² = 0 (fewer if the mesh has fewer), by ascending ω², about the state of `stepper`,
/// which is to be an equilibrium under `boundary`.
///
/// # Errors
/// [`Diverged`] if the equilibrium is indifferent: its stiffness is singular.
pub fn modes(stepper: &mut Stepper, boundary: &Boundary, count: usize) -> Result<Vec<Mode>, Diverged> {
    let points = stepper.mesh.points();
    // twice the modes wanted, and some steps more for the last of them to converge
    let size = (2 * count + 8 * BLOCK).min(3 * points);
    let mut basis: Vec<Field> = Vec::with_capacity(size);
    let mut images: Vec<Field> = Vec::with_capacity(size);
    let mut shapes: Vec<Vec<Vector3<f64>>> = Vec::with_capacity(size);
    let mut candidates: Vec<Field> = (0..BLOCK).map(|seed| start(points + 1, seed)).collect();

    let mut next = 0;
    while basis.len() < size && next < candidates.len() {
        let mut vector = candidates[next].clone();
        next += 1;
        let before = product(stepper, &vector, &vector).sqrt();
        // twice is enough for orthogonality to rounding
        for _ in 0..2 {
            for other in &basis {
                let along = product(stepper, &vector, other);
                subtract(&mut vector, other, along);
            }
        }
        let norm = product(stepper, &vector, &vector).sqrt();
        // what the space already holds adds nothing
        if norm.is_nan() || norm <= 1e-10 * before {
            continue;
        }
        for (w, phi) in &mut vector {
            *w /= norm;
            *phi /= norm;
        }
        let (image, shape) = apply(stepper, boundary, &vector)?;
        candidates.push(image.clone());
        basis.push(vector);
        images.push(image);
        shapes.push(shape);
    }

    let n = basis.len();
    let projected = DMatrix::from_fn(n, n, |i, j| product(stepper, &basis[i], &images[j]));
    // K is symmetric up to the error of the mesh, and what is not changes an eigenvalue in second order only
    let eigen = ((&projected + projected.transpose()) * 0.5).symmetric_eigen();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&i, &j| eigen.eigenvalues[j].abs().total_cmp(&eigen.eigenvalues[i].abs()));
    let mut modes: Vec<Mode> = order
        .into_iter()
        .take(count)
        .map(|i| {
            let mut shape = vec![Vector3::zeros(); stepper.mesh.cells.len() + 1];
            for (j, other) in shapes.iter().enumerate() {
                for (sum, x) in shape.iter_mut().zip(other) {
                    *sum += x * eigen.eigenvectors[(j, i)];
                }
            }
            let largest = shape.iter().map(Vector3::amax).fold(0.0, f64::max);
            if largest > 0.0 {
                shape.iter_mut().for_each(|x| *x /= largest);
            }
            let mut travel: Field = vec![(Vector3::zeros(), Vector3::zeros()); points + 1];
            for (j, other) in basis.iter().enumerate() {
                for ((sum, _), (x, _)) in travel.iter_mut().zip(other) {
                    *sum += x * eigen.eigenvectors[(j, i)];
                }
            }
            // the whole is 1: the basis is orthonormal in the kinetic energy
            let travel = product(stepper, &travel, &travel);
            Mode { omega_squared: 1.0 / eigen.eigenvalues[i], shape, travel }
        })
        .collect();
    modes.sort_by(|a, b| a.omega_squared.total_cmp(&b.omega_squared));
    Ok(modes)
}

/// A fixed vector without symmetry, so that no mode is missed.
fn start(len: usize, seed: usize) -> Field {
    let mut x = 0.3 + 0.1 * seed as f64;
    let mut next = move || {
        // the logistic map, chaotic at 3.99: no global generator, the same numbers everywhere
        x *= 3.99 * (1.0 - x);
        x - 0.5
    };
    let mut vector = || Vector3::new(next(), next(), next());
    (0..len).map(|_| (vector(), vector())).collect()
}

/// x M y: twice the kinetic energy of the velocities x = y.
fn product(stepper: &Stepper, x: &Field, y: &Field) -> f64 {
    let (mesh, rod) = (&stepper.mesh, &stepper.rod);
    let stages = mesh.rule.stages;
    let mut sum = 0.0;
    for (i, section) in stepper.state.points.iter().enumerate() {
        let weight = mesh.cells[i / stages].length * mesh.rule.b[i % stages];
        let R = &section.rotation;
        let (a, b) = (R.tr_mul(&x[i].1), R.tr_mul(&y[i].1));
        sum += weight * (rod.mass_per_length * x[i].0.dot(&y[i].0) + a.dot(&rod.inertia_per_length.component_mul(&b)));
    }
    let tip = x.len() - 1;
    sum + rod.tip_mass * x[tip].0.dot(&y[tip].0) + rod.tip_inertia * x[tip].1.dot(&y[tip].1)
}

fn subtract(x: &mut Field, y: &Field, factor: f64) {
    for ((w, phi), (w_y, phi_y)) in x.iter_mut().zip(y) {
        *w -= w_y * factor;
        *phi -= phi_y * factor;
    }
}

/// K⁻¹ M y, and the displacement of the nodes that goes with it.
fn apply(stepper: &mut Stepper, boundary: &Boundary, y: &Field) -> Result<(Field, Vec<Vector3<f64>>), Diverged> {
    let (nodes, points) = stepper.linear_statics(boundary, |mesh, rod, state, residuals| {
        pose::load_with_inertia(mesh, rod, state, y, residuals);
    })?;
    let pair = |delta: &Increment| (delta.w, delta.phi);
    let tip = &nodes[nodes.len() - 1];
    Ok((points.iter().chain([tip]).map(pair).collect(), nodes.iter().map(|delta| delta.w).collect()))
}
