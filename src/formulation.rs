//! What both formulations of the rod offer: a step, and what there is to see after it. Charts, examples and tests that
//! set one beside the other are written against it.

use crate::alpha::Scheme;
use crate::boundary::Boundary;
use crate::energy::Energy;
use crate::pose::Section;
use crate::stepper::{Diverged, Report, Stepper};
use nalgebra::Vector3;

/// A rod that can be moved.
pub trait Formulation {
    /// One step of `dt` s to `boundary` with `scheme`.
    ///
    /// # Errors
    /// [`Diverged`]; the state is as before.
    fn step(&mut self, boundary: &Boundary, scheme: Scheme, dt: f64) -> Result<Report, Diverged>;

    /// The number of nodes.
    fn nodes(&self) -> usize;

    /// r, R, n and m at node `j`, counted from the base, world frame.
    fn section(&self, j: usize) -> Section;

    /// Kinetic, elastic and potential energy.
    fn energy(&self, gravity: &Vector3<f64>) -> Energy;

    /// The section at the tip.
    fn tip(&self) -> Section {
        self.section(self.nodes() - 1)
    }
}

/// The pose formulation in its default way, [`Stepper::advance`].
impl Formulation for Stepper {
    fn step(&mut self, boundary: &Boundary, scheme: Scheme, dt: f64) -> Result<Report, Diverged> {
        self.advance(boundary, scheme, dt)
    }

    fn nodes(&self) -> usize {
        self.state.nodes.len()
    }

    fn section(&self, j: usize) -> Section {
        self.state.nodes[j]
    }

    fn energy(&self, gravity: &Vector3<f64>) -> Energy {
        Energy::of(&self.mesh, &self.rod, &self.state, gravity)
    }
}
