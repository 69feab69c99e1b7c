//! Energies of a state, and the works and losses of a step; all by the Gauss rule of the cells.

use crate::archive::archived;
use crate::boundary::Boundary;
use crate::mesh::Mesh;
use crate::pose::State;
use crate::rod::Rod;
use crate::so3;
use nalgebra::Vector3;

/// Energies, and works since the start, J. kinetic + elastic + gravity + dissipated grows by work_base + work_tip, up
/// to the second order of the time scheme.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Of the rod and the body at its tip.
    pub kinetic: f64,
    /// Stored in bending, twist and, if extensible, shear and stretch.
    pub elastic: f64,
    /// Potential of gravity, zero at the world origin.
    pub gravity: f64,
    /// Lost in Kelvin-Voigt damping and drag.
    pub dissipated: f64,
    /// Work the base has done on the rod.
    pub work_base: f64,
    /// Work the tip force and moment, and the support of the tip, have done on the rod.
    pub work_tip: f64,
}

archived!(Energy { kinetic, elastic, gravity, dissipated, work_base, work_tip });

impl Energy {
    /// Energies of a state at the start, where no work has been done.
    pub fn of(mesh: &Mesh, rod: &Rod, state: &State, gravity: &Vector3<f64>) -> Self {
        let mut energy = Self::default();
        let stages = mesh.rule.stages;
        for (i, section) in state.points.iter().enumerate() {
            let cell = &mesh.cells[i / stages];
            let weight = cell.length * mesh.rule.b[i % stages];
            let memory = &state.memory[i];
            let (u, omega) = (memory.travel.velocity.value, memory.spin.velocity.value);
            let strain = memory.kappa - cell.kappa_rest;
            let force = section.rotation.tr_mul(&section.force);
            energy.kinetic += 0.5
                * weight
                * (rod.mass_per_length * u.norm_squared() + omega.dot(&rod.inertia_per_length.component_mul(&omega)));
            energy.elastic += 0.5
                * weight
                * (strain.dot(&rod.stiffness.component_mul(&strain))
                    + force.dot(&rod.compliance.component_mul(&force)));
            energy.gravity -= weight * rod.mass_per_length * gravity.dot(&section.position);
        }
        let memory = state.tip_memory();
        let (u, omega) = (memory.travel.velocity.value, memory.spin.velocity.value);
        energy.kinetic += 0.5 * (rod.tip_mass * u.norm_squared() + rod.tip_inertia * omega.norm_squared());
        energy.gravity -= rod.tip_mass * gravity.dot(&state.tip().position);
        energy
    }

    /// What gravity and bending can give a rod of this length, m, J.
    pub fn large(rod: &Rod, length: f64, gravity: &Vector3<f64>) -> f64 {
        rod.mass_per_length * length * gravity.norm() * length + rod.stiffness.max() / length
    }

    /// What its changes are small beside, where gravity and bending can give the `large` one, J.
    pub fn scale(&self, large: f64) -> f64 {
        large + self.kinetic + self.elastic
    }

    /// Energies after a step from `old` to `new`, with the works and losses of the step added.
    pub fn after(&self, mesh: &Mesh, rod: &Rod, old: &State, new: &State, boundary: &Boundary) -> Self {
        let turn = |from: &nalgebra::Matrix3<f64>, to: &nalgebra::Matrix3<f64>| so3::log(&(to * from.transpose()));
        let (base_old, base_new) = (&old.nodes[0], &new.nodes[0]);
        let base = -0.5 * (base_old.force + base_new.force).dot(&(base_new.position - base_old.position))
            - 0.5 * (base_old.moment + base_new.moment).dot(&turn(&base_old.rotation, &base_new.rotation));
        let (way, turned) = (new.tip().position - old.tip().position, turn(&old.tip().rotation, &new.tip().rotation));
        let ((force_old, moment_old), (force, moment)) = (old.tip_reaction(rod), new.tip_reaction(rod));
        let tip = (boundary.tip_force + 0.5 * (force_old + force)).dot(&way)
            + (boundary.tip_moment + 0.5 * (moment_old + moment)).dot(&turned);
        let lost = 0.5 * new.dt * (losses(mesh, rod, old) + losses(mesh, rod, new));
        self.with(mesh, rod, new, &boundary.gravity, &Powers { base, tip, lost })
    }

    /// Energies of `state`, with the works and losses `work` added to those so far.
    pub fn with(&self, mesh: &Mesh, rod: &Rod, state: &State, gravity: &Vector3<f64>, work: &Powers) -> Self {
        self.worked(work).now(&Self::of(mesh, rod, state, gravity))
    }

    /// With `work` added to the works and losses.
    pub fn worked(&self, work: &Powers) -> Self {
        Self {
            dissipated: self.dissipated + work.lost,
            work_base: self.work_base + work.base,
            work_tip: self.work_tip + work.tip,
            ..*self
        }
    }

    /// With the energies of `present`, but not its works.
    pub fn now(&self, present: &Self) -> Self {
        Self { kinetic: present.kinetic, elastic: present.elastic, gravity: present.gravity, ..*self }
    }

    /// kinetic + elastic + gravity.
    pub fn total(&self) -> f64 {
        self.kinetic + self.elastic + self.gravity
    }

    /// What the balance misses: zero but for the error of the time scheme, and its numerical damping.
    pub fn residual(&self, start: &Self) -> f64 {
        self.total() + self.dissipated - start.total() - self.work_base - self.work_tip
    }
}

/// What is done on the rod and lost in it per time, W; or, summed over a step, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Powers {
    /// By the base.
    pub base: f64,
    /// By the tip's force, moment and support.
    pub tip: f64,
    /// Lost in damping and drag.
    pub lost: f64,
}

impl Powers {
    /// Of a state under `boundary`.
    pub fn of(mesh: &Mesh, rod: &Rod, state: &State, boundary: &Boundary) -> Self {
        let (base, node) = (&boundary.base, &state.nodes[0]);
        let (tip, memory) = (state.tip(), state.tip_memory());
        let (force, moment) = state.tip_reaction(rod);
        let spin = tip.rotation * memory.spin.velocity.value;
        Self {
            base: -node.force.dot(&base.velocity) - node.moment.dot(&base.angular_velocity),
            tip: (boundary.tip_force + force).dot(&memory.travel.velocity.value)
                + (boundary.tip_moment + moment).dot(&spin),
            lost: losses(mesh, rod, state),
        }
    }

    /// For `time` s.
    pub fn times(self, time: f64) -> Self {
        Self { base: self.base * time, tip: self.tip * time, lost: self.lost * time }
    }

    /// And `other` for `time` s.
    pub fn plus(self, other: Self, time: f64) -> Self {
        Self {
            base: self.base + other.base * time,
            tip: self.tip + other.tip * time,
            lost: self.lost + other.lost * time,
        }
    }
}

/// Power lost in damping and drag, W.
fn losses(mesh: &Mesh, rod: &Rod, state: &State) -> f64 {
    let stages = mesh.rule.stages;
    let viscosity = rod.stiffness.component_mul(&rod.damping);
    if viscosity == Vector3::zeros() && rod.drag == 0.0 {
        return 0.0;
    }
    let at = |i: usize| {
        let memory = &state.memory[i];
        let (strain, u) = (memory.strain.velocity.value, memory.travel.velocity.value);
        strain.dot(&viscosity.component_mul(&strain)) + rod.drag * u.norm_squared()
    };
    (0..mesh.points()).map(|i| at(i) * mesh.cells[i / stages].length * mesh.rule.b[i % stages]).sum()
}
