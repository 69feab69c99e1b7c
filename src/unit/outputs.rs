//! What the host may read at every communication point.

use super::parameters::Parameters;
use crate::archive::archived;
use crate::boundary::Boundary;
use crate::energy::Energy;
use crate::integrator::{Effort, Ends, Integrator};
use crate::so3;
use nalgebra::{Matrix3, Vector3, Vector4};

/// Most stations of the centreline that are handed out.
pub const STATIONS: usize = 11;

/// What the host may read at every communication point, world frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outputs {
    /// Position of the tip, m.
    pub tip_position: Vector3<f64>,
    /// Orientation of the tip, unit quaternion (w, x, y, z), body to world.
    pub tip_orientation: Vector4<f64>,
    /// Velocity of the tip point, m/s.
    pub tip_velocity: Vector3<f64>,
    /// Angular velocity of the tip, rad/s.
    pub tip_angular_velocity: Vector3<f64>,
    /// Force the rod exerts on its base, N.
    pub base_reaction_force: Vector3<f64>,
    /// Moment the rod exerts on its base, about the base point, N·m.
    pub base_reaction_moment: Vector3<f64>,
    /// Force the rod exerts on what drives its tip, N; zero where nothing does.
    pub tip_reaction_force: Vector3<f64>,
    /// Moment the rod exerts on what drives its tip, about the tip point, N·m; zero where nothing does.
    pub tip_reaction_moment: Vector3<f64>,
    /// Points of the centreline, where [`Parameters::stations`] says, m; the rest are zero.
    pub stations: [Vector3<f64>; STATIONS],
    /// Energies and works.
    pub energy: Energy,
    /// Rate of `energy.work_base`: what the base does on the rod, W.
    pub power_base: f64,
    /// Rate of `energy.work_tip`, under the load with which the last step ended, W.
    pub power_tip: f64,
    /// Acceleration of the base at the end of the step, m/s².
    pub base_acceleration: Vector3<f64>,
    /// How much of the rod the base feels at once ([`crate::stepper::Stepper::effective_mass`]), kg; zero where it is not
    /// asked for.
    pub effective_mass: Matrix3<f64>,
    /// Cells in use.
    pub cells: i32,
    /// What it took since the start.
    pub solver: Effort,
}

archived!(Outputs {
    tip_position,
    tip_orientation,
    tip_velocity,
    tip_angular_velocity,
    base_reaction_force,
    base_reaction_moment,
    tip_reaction_force,
    tip_reaction_moment,
    stations,
    energy,
    power_base,
    power_tip,
    base_acceleration,
    effective_mass,
    cells,
    solver
});

impl Outputs {
    /// What has changed since `before`, per s.
    pub(super) fn differences(&self, before: &Self, time: f64) -> Self {
        let vector = |of: fn(&Self) -> Vector3<f64>| (of(self) - of(before)) / time;
        let number = |of: fn(&Self) -> f64| (of(self) - of(before)) / time;
        Self {
            tip_position: vector(|o| o.tip_position),
            tip_orientation: (self.tip_orientation - before.tip_orientation) / time,
            tip_velocity: vector(|o| o.tip_velocity),
            tip_angular_velocity: vector(|o| o.tip_angular_velocity),
            base_reaction_force: vector(|o| o.base_reaction_force),
            base_reaction_moment: vector(|o| o.base_reaction_moment),
            tip_reaction_force: vector(|o| o.tip_reaction_force),
            tip_reaction_moment: vector(|o| o.tip_reaction_moment),
            stations: std::array::from_fn(|i| (self.stations[i] - before.stations[i]) / time),
            energy: Energy {
                kinetic: number(|o| o.energy.kinetic),
                elastic: number(|o| o.energy.elastic),
                gravity: number(|o| o.energy.gravity),
                dissipated: number(|o| o.energy.dissipated),
                work_base: number(|o| o.energy.work_base),
                work_tip: number(|o| o.energy.work_tip),
            },
            power_base: number(|o| o.power_base),
            power_tip: number(|o| o.power_tip),
            base_acceleration: vector(|o| o.base_acceleration),
            effective_mass: (self.effective_mass - before.effective_mass) / time,
            cells: 0,
            solver: Effort::default(),
        }
    }

    /// What is to be read of a rod with these parameters on which this acts at the `end` of a step.
    pub(super) fn read(&mut self, integrator: &mut Integrator, end: &Boundary, parameters: &Parameters) {
        let base = &end.base;
        let Ends { position, rotation, velocity, angular_velocity, force, moment, tip_force, tip_moment } =
            integrator.ends();
        *self = Self {
            tip_position: position,
            tip_orientation: so3::quaternion(&rotation),
            tip_velocity: velocity,
            tip_angular_velocity: angular_velocity,
            base_reaction_force: force,
            base_reaction_moment: moment,
            tip_reaction_force: tip_force,
            tip_reaction_moment: tip_moment,
            energy: *integrator.energy(),
            power_base: -force.dot(&base.velocity) - moment.dot(&base.angular_velocity),
            power_tip: (end.tip_force - tip_force).dot(&velocity)
                + (end.tip_moment - tip_moment).dot(&angular_velocity),
            base_acceleration: base.acceleration,
            cells: integrator.cells() as i32,
            solver: *integrator.effort(),
            ..*self
        };
        integrator.centreline(&parameters.stations, &mut self.stations);
        if parameters.wants_masses() {
            // a rod that has moved has accelerations
            self.effective_mass = integrator.in_space().effective_mass().unwrap_or_default();
        }
    }
}
