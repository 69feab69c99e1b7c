//! The unit as a host gets it: a communication step is one step of the map, however many it takes inside.

use super::scan::Material;
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::Boundary;
use cosserat_rod::energy::Energy;
use cosserat_rod::formulation::Formulation;
use cosserat_rod::pose::Section;
use cosserat_rod::stepper::{Diverged, Reason, Report, Termination};
use cosserat_rod::unit::{Error, Inputs, Unit};
use nalgebra::Vector3;

/// A rod released from the horizontal, in the steps that the unit chooses.
pub struct Automatic {
    unit: Unit,
    /// What it shows after the last step.
    nodes: Vec<Section>,
    iterations: i32,
}

impl Automatic {
    pub fn new(material: &Material, cells: usize, tolerance: f64) -> Result<Self, Error> {
        let mut unit = Unit::new(&material.parameters(cells), &Inputs::default(), Some(tolerance))?;
        Ok(Self { nodes: unit.stepper().state.nodes.clone(), unit, iterations: 0 })
    }
}

impl Formulation for Automatic {
    fn step(&mut self, _: &Boundary, _: Scheme, dt: f64) -> Result<Report, Diverged> {
        self.unit.advance(&Inputs::default(), dt).map_err(|error| match error {
            Error::Diverged { cause, .. } => cause,
            _ => Diverged { iterations: 0, residual: f64::INFINITY, reason: Reason::NotFinite },
        })?;
        self.nodes.clone_from(&self.unit.stepper().state.nodes);
        let before = std::mem::replace(&mut self.iterations, self.unit.outputs().solver.iterations);
        let iterations = (self.iterations - before) as usize;
        Ok(Report { iterations, residual: 0.0, termination: Termination::Newton })
    }

    fn nodes(&self) -> usize {
        self.nodes.len()
    }

    fn section(&self, j: usize) -> Section {
        self.nodes[j]
    }

    fn energy(&self, _: &Vector3<f64>) -> Energy {
        self.unit.outputs().energy
    }
}
