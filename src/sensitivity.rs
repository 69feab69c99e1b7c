//! Derivatives of the outputs by what acts: along one direction, in the last communication step as it was gone through or,
//! before the first, at the start.
//!
//! With the internal steps and the cells settled ([`Response`]) the outputs are smooth functions of what acts. Their
//! derivative along a direction d is taken from four more passes through the step,
//!
//! ```text
//! y' = (8 (y(+ε) − y(−ε)) − (y(+2ε) − y(−2ε))) / 12 ε          y(ε): the outputs, had x + ε d acted
//! ```
//!
//! which leaves ε⁴ y⁽⁵⁾/30. ε d is a small part of what moves the rod as far as it is long, in the time in which gravity or
//! stiffness do: so ε⁴ is below the roundings that ε divides.

use crate::unit::{Acting, Derivatives, Error, Inputs, Outputs, Response, Tunable, Unit};
use nalgebra::{Vector3, Vector4};

/// Part of what moves the rod as far as it is long.
const SMALL: f64 = 1e-3;
/// Where the passes through the step are, over ε.
const PLACES: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];

/// The outputs in the neighbourhood of the present ones, along a direction.
#[derive(Clone, Debug)]
pub struct Sensitivity {
    near: [Outputs; PLACES.len()],
    /// ε.
    distance: f64,
}

/// A direction along which nothing acts: to be filled with what is to change, in the units of the inputs and parameters.
pub fn nowhere() -> Acting {
    let zero = Vector3::zeros();
    Acting {
        inputs: Inputs {
            base_position: zero,
            base_orientation: Vector4::zeros(),
            base_velocity: zero,
            base_angular_velocity: zero,
            tip_force: zero,
            tip_moment: zero,
            tip_position: zero,
            tip_orientation: Vector4::zeros(),
            tip_velocity: zero,
            tip_angular_velocity: zero,
        },
        derivatives: Derivatives::default(),
        tunable: Tunable::default(),
    }
}

impl Sensitivity {
    /// Of the outputs of `unit` along a `direction`. Orientations count as far as they turn: a quaternion that is only
    /// stretched changes nothing.
    ///
    /// # Errors
    /// [`Error::NoStep`] where there is no step to differentiate in; other [`Error`]s if there is no such step nearby.
    pub fn new(unit: &Unit, direction: &Acting) -> Result<Self, Error> {
        let response = unit.response()?;
        let acting = response.acting();
        let most = size(direction, &acting, &response);
        let distance = if most > 0.0 { SMALL / most } else { 1.0 };
        // far enough along the direction to see whether it leads out of a plane
        let in_plane = response.stays_in_plane(&moved(&acting, distance / SMALL, direction));
        let turned = unit.outputs().tip_orientation;
        let mut near: [Outputs; PLACES.len()] = Default::default();
        for (outputs, place) in near.iter_mut().zip(PLACES) {
            *outputs = response.to(&moved(&acting, place * distance, direction), in_plane)?;
            // a quaternion and its negative are the same rotation
            if outputs.tip_orientation.dot(&turned) < 0.0 {
                outputs.tip_orientation.neg_mut();
            }
        }
        Ok(Self { near, distance })
    }

    /// The derivative of one of the outputs.
    pub fn of(&self, output: impl Fn(&Outputs) -> f64) -> f64 {
        // in pairs, so that what does not change has a derivative of zero
        let [far_below, below, above, far_above] = [0, 1, 2, 3].map(|k| output(&self.near[k]));
        (8.0 * (above - below) - (far_above - far_below)) / (12.0 * self.distance)
    }
}

/// What acts, moved by so many of `direction`.
fn moved(acting: &Acting, distance: f64, direction: &Acting) -> Acting {
    let (from, by) = (&acting.inputs, &direction.inputs);
    let (held, tuned) = (&acting.tunable, &direction.tunable);
    Acting {
        inputs: Inputs {
            base_position: from.base_position + by.base_position * distance,
            base_orientation: from.base_orientation + by.base_orientation * distance,
            base_velocity: from.base_velocity + by.base_velocity * distance,
            base_angular_velocity: from.base_angular_velocity + by.base_angular_velocity * distance,
            tip_force: from.tip_force + by.tip_force * distance,
            tip_moment: from.tip_moment + by.tip_moment * distance,
            tip_position: from.tip_position + by.tip_position * distance,
            tip_orientation: from.tip_orientation + by.tip_orientation * distance,
            tip_velocity: from.tip_velocity + by.tip_velocity * distance,
            tip_angular_velocity: from.tip_angular_velocity + by.tip_angular_velocity * distance,
        },
        derivatives: acting.derivatives.clone(),
        tunable: Tunable {
            gravity: held.gravity + tuned.gravity * distance,
            damping_bending: held.damping_bending + tuned.damping_bending * distance,
            damping_twist: held.damping_twist + tuned.damping_twist * distance,
            damping_drag: held.damping_drag + tuned.damping_drag * distance,
            tip_mode: held.tip_mode,
        },
    }
}

/// How many times `direction`, from what is `acting`, moves the rod as far as it is long, in the time in which gravity or
/// stiffness do. The ends get to their velocity, and to a position that its velocity is derived of, within the step.
fn size(direction: &Acting, acting: &Acting, response: &Response) -> f64 {
    let parameters = response.parameters();
    let (rod, length) = (parameters.rod(), parameters.length);
    let time = parameters.time(&rod);
    let step = response.duration().map_or(time, |duration| duration.min(time));
    let mass = rod.mass_per_length * length + rod.tip_mass;
    let weight = mass * acting.tunable.gravity.norm();
    let force = weight.max(rod.stiffness.max() / (length * length));
    let rate = step / (time * time);
    let turn = |motion: i32| if motion == 1 { (step / time).powi(2) } else { step / time };
    let (base, tip) = (turn(parameters.base_motion), turn(parameters.tip_motion));
    let Acting { inputs, tunable, .. } = direction;
    // a free tip reads none of these, and they may be anything, an orientation of zero among them
    let of_tip = match acting.tunable.tip_mode {
        0 => [0.0; 4],
        _ => [
            inputs.tip_position.norm() / (length * tip),
            inputs.tip_orientation.norm() / (acting.inputs.tip_orientation.norm() * tip),
            inputs.tip_velocity.norm() / (length * rate),
            inputs.tip_angular_velocity.norm() / rate,
        ],
    };
    let of_others = [
        inputs.base_position.norm() / (length * base),
        inputs.base_orientation.norm() / (acting.inputs.base_orientation.norm() * base),
        inputs.base_velocity.norm() / (length * rate),
        inputs.base_angular_velocity.norm() / rate,
        inputs.tip_force.norm() / force,
        inputs.tip_moment.norm() * length / rod.stiffness.min(),
        tunable.gravity.norm() * time * time / length,
        tunable.damping_bending / time,
        tunable.damping_twist / time,
        tunable.damping_drag * length * time / mass,
    ];
    of_others.into_iter().chain(of_tip).fold(0.0, |most, size| f64::max(most, size.abs()))
}
