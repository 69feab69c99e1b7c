//! What most rod codes do instead: an explicit step, on the same cells. Shear and stretch are springs between the nodes,
//! bending and twist between the sections in the middle of the cells; positions and rotations leap over the velocities.
//!
//! The step must resolve the fastest oscillation of the cells, which no motion of the rod shows: at the shortest wave
//! they carry, stretch has ω² = 4 EA/(ρA h²), and shear and rotation have
//!
//! ```text
//! ω² = largest eigenvalue of | 4 GA/(ρA h²)          −2 GA/(h √(ρA ρI)) |
//!                            | −2 GA/(h √(ρA ρI))    (GA + 4 EI/h²)/ρI  |
//! ```
//!
//! and the leap is stable for Δt ω < 2. In a thin rod rotation against shear leads, ω ≈ √(GA/ρI): the thinner the rod,
//! the smaller the step, however few the cells.

// R is the paper's letter
#![allow(non_snake_case)]

use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::Boundary;
use cosserat_rod::energy::Energy;
use cosserat_rod::formulation::Formulation;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::pose::{Section, State};
use cosserat_rod::rod::Rod;
use cosserat_rod::so3;
use cosserat_rod::stepper::{Diverged, Reason, Report, Termination};
use nalgebra::{Matrix3, Vector3};

/// Longest stable step of the cells of length `h`, s.
pub fn longest_step(rod: &Rod, h: f64) -> f64 {
    let rigidity = rod.compliance.map(|c| 1.0 / c);
    let (shear, stretch, bending) = (rigidity.x, rigidity.z, rod.stiffness.x);
    let (mass, inertia) = (rod.mass_per_length, rod.inertia_per_length.x);
    let (transverse, turning) = (4.0 * shear / (mass * h * h), (shear + 4.0 * bending / (h * h)) / inertia);
    let coupling = 2.0 * shear / (h * (mass * inertia).sqrt());
    let mean = 0.5 * (transverse + turning);
    let fastest = mean + (0.25 * (transverse - turning).powi(2) + coupling * coupling).sqrt();
    2.0 / fastest.max(4.0 * stretch / (mass * h * h)).sqrt()
}

/// A rod that shears and stretches, clamped at the base.
pub struct Explicit {
    rod: Rod,
    /// Length of a cell.
    h: f64,
    /// Curvature of the unstressed cells.
    rest: Vec<Vector3<f64>>,
    base: Matrix3<f64>,
    /// Of the nodes, world frame.
    positions: Vec<Vector3<f64>>,
    velocities: Vec<Vector3<f64>>,
    /// Of the middles of the cells; spins in the body frame.
    rotations: Vec<Matrix3<f64>>,
    spins: Vec<Vector3<f64>>,
    /// n of the cells and m of the nodes, world frame.
    forces: Vec<Vector3<f64>>,
    moments: Vec<Vector3<f64>>,
}

impl Explicit {
    /// The unstressed rod at rest, on uniform cells.
    pub fn new(mesh: &Mesh, rod: &Rod, boundary: &Boundary) -> Self {
        let shape = State::at_rest_shape(mesh, &boundary.base);
        let cells = mesh.cells.len();
        let zeros = |count| vec![Vector3::zeros(); count];
        Self {
            rod: rod.clone(),
            h: mesh.length() / cells as f64,
            rest: mesh.cells.iter().map(|cell| cell.kappa_rest).collect(),
            base: boundary.base.rotation,
            positions: shape.nodes.iter().map(|node| node.position).collect(),
            velocities: zeros(cells + 1),
            rotations: shape.points.iter().map(|point| point.rotation).collect(),
            spins: zeros(cells),
            forces: zeros(cells),
            moments: zeros(cells + 1),
        }
    }

    fn drift(&mut self, dt: f64) {
        for (r, u) in self.positions.iter_mut().zip(&self.velocities) {
            *r += u * dt;
        }
        for (R, omega) in self.rotations.iter_mut().zip(&self.spins) {
            *R = so3::orthonormalised(&(*R * so3::exp(&(omega * dt))));
        }
    }

    /// The section before node `j`, the arc length from it, and the rest curvature between them.
    fn before(&self, j: usize) -> (Matrix3<f64>, f64, Vector3<f64>) {
        match j {
            0 => (self.base, 0.5 * self.h, self.rest[0]),
            j => (self.rotations[j - 1], self.h, (self.rest[j - 1] + self.rest[j]) * 0.5),
        }
    }

    fn stress(&mut self) {
        for j in 0..self.rotations.len() {
            let R = self.rotations[j];
            let strain = R.tr_mul(&((self.positions[j + 1] - self.positions[j]) / self.h)) - Vector3::z();
            self.forces[j] = R * strain.component_div(&self.rod.compliance);
            let (before, length, rest) = self.before(j);
            let curvature = so3::log(&before.tr_mul(&R)) / length - rest;
            self.moments[j] = (before + R) * self.rod.stiffness.component_mul(&curvature) * 0.5;
        }
    }

    fn kick(&mut self, boundary: &Boundary, dt: f64) {
        self.stress();
        let cells = self.rotations.len();
        let (mass, inertia) = (self.rod.mass_per_length * self.h, self.rod.inertia_per_length * self.h);
        for j in 1..=cells {
            // the last node has half a cell
            let (ahead, mass) = if j < cells { (self.forces[j], mass) } else { (boundary.tip_force, 0.5 * mass) };
            self.velocities[j] += ((ahead - self.forces[j - 1]) / mass + boundary.gravity) * dt;
        }
        for k in 0..cells {
            let ahead = if k + 1 < cells { self.moments[k + 1] } else { boundary.tip_moment };
            let arm = self.positions[k + 1] - self.positions[k];
            let moment = ahead - self.moments[k] + arm.cross(&self.forces[k]);
            let omega = self.spins[k];
            let torque = self.rotations[k].tr_mul(&moment) - omega.cross(&inertia.component_mul(&omega));
            self.spins[k] += torque.component_div(&inertia) * dt;
        }
    }
}

impl Formulation for Explicit {
    fn step(&mut self, boundary: &Boundary, _: Scheme, dt: f64) -> Result<Report, Diverged> {
        self.drift(0.5 * dt);
        self.kick(boundary, dt);
        self.drift(0.5 * dt);
        self.stress();
        if self.velocities.iter().chain(&self.spins).all(|v| v.iter().all(|x| x.is_finite())) {
            Ok(Report { iterations: 1, residual: 0.0, termination: Termination::Newton })
        } else {
            Err(Diverged { iterations: 1, residual: f64::INFINITY, reason: Reason::NotFinite })
        }
    }

    fn nodes(&self) -> usize {
        self.positions.len()
    }

    fn section(&self, j: usize) -> Section {
        let rotation = if j == 0 { self.base } else { self.rotations[j - 1] };
        let force = self.forces[j.min(self.forces.len() - 1)];
        Section { position: self.positions[j], rotation, force, moment: self.moments[j], ..Section::default() }
    }

    fn energy(&self, gravity: &Vector3<f64>) -> Energy {
        let mut energy = Energy::default();
        let cells = self.rotations.len();
        for j in 0..=cells {
            let mass = self.rod.mass_per_length * if j == 0 || j == cells { 0.5 * self.h } else { self.h };
            energy.kinetic += 0.5 * mass * self.velocities[j].norm_squared();
            energy.gravity -= mass * gravity.dot(&self.positions[j]);
        }
        for j in 0..cells {
            let (omega, R) = (self.spins[j], self.rotations[j]);
            energy.kinetic += 0.5 * self.h * omega.dot(&self.rod.inertia_per_length.component_mul(&omega));
            let n = R.tr_mul(&self.forces[j]);
            energy.elastic += 0.5 * self.h * n.dot(&self.rod.compliance.component_mul(&n));
            let (before, length, rest) = self.before(j);
            let curvature = so3::log(&before.tr_mul(&R)) / length - rest;
            energy.elastic += 0.5 * length * curvature.dot(&self.rod.stiffness.component_mul(&curvature));
        }
        energy
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene;
    use crate::stability::scan::{MATERIALS, Material};

    /// What the rod has gained after 400 steps of `part` of the longest, in units of what it can gain by falling;
    /// infinite where a number overflows.
    fn gain(material: &Material, cells: usize, part: f64) -> f64 {
        let (rod, boundary) = (scene::compliant(&material.rod()), scene::horizontal());
        let mut explicit = Explicit::new(&material.mesh(cells), &rod, &boundary);
        let total = |explicit: &Explicit| explicit.energy(&boundary.gravity).total();
        let start = total(&explicit);
        let dt = part * longest_step(&rod, material.length / cells as f64);
        for _ in 0..400 {
            if explicit.step(&boundary, Scheme::BACKWARD_EULER, dt).is_err() {
                return f64::INFINITY;
            }
        }
        (total(&explicit) - start) / material.weight()
    }

    #[test]
    fn the_longest_step_is_that_of_theory() {
        for material in &MATERIALS {
            for cells in [6, 25] {
                let name = material.name;
                // 2 % above it the fastest oscillation grows by e^0.4 a step
                let (below, above) = (gain(material, cells, 0.98), gain(material, cells, 1.02));
                assert!(below.abs() < 1e-6, "{name}, {cells} cells: {below:e}");
                assert!(above > 1.0 || above.is_nan(), "{name}, {cells} cells: {above:e}");
            }
        }
    }

    #[test]
    fn the_leap_is_second_order_in_energy() {
        // below its longest step the energy of the leap swings about that of the rod, by the square of the step
        let material = &MATERIALS[1];
        let [coarse, fine] = [0.5, 0.25].map(|part| {
            let (rod, boundary) = (scene::compliant(&material.rod()), scene::horizontal());
            let mut explicit = Explicit::new(&material.mesh(6), &rod, &boundary);
            let start = explicit.energy(&boundary.gravity).total();
            let dt = part * longest_step(&rod, material.length / 6.0);
            let mut worst = 0.0f64;
            for _ in 0..(2000.0 / part) as usize {
                explicit.step(&boundary, Scheme::BACKWARD_EULER, dt).unwrap();
                worst = worst.max((explicit.energy(&boundary.gravity).total() - start).abs());
            }
            worst
        });
        assert!((coarse / fine / 4.0 - 1.0).abs() < 0.1, "{coarse:e} {fine:e}");
    }
}
