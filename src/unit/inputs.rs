//! What the host gives at every communication point, and how that goes on until the next.

use super::error::{Allowed, Error};
use crate::archive::archived;
use crate::path::{Onward, Sample};
use crate::so3;
use nalgebra::{SVector, Vector3, Vector4};

/// What the host gives at every communication point, world frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Inputs {
    /// Position of the base, m.
    pub base_position: Vector3<f64>,
    /// Orientation of the base, quaternion (w, x, y, z), body to world; normalised on use.
    pub base_orientation: Vector4<f64>,
    /// Velocity of the base point, m/s.
    pub base_velocity: Vector3<f64>,
    /// Angular velocity of the base, rad/s.
    pub base_angular_velocity: Vector3<f64>,
    /// Dead force on the tip, N.
    pub tip_force: Vector3<f64>,
    /// Dead moment on the tip, about the tip point, N·m.
    pub tip_moment: Vector3<f64>,
    /// Position of a driven tip, m.
    pub tip_position: Vector3<f64>,
    /// Orientation of a driven tip, as that of the base.
    pub tip_orientation: Vector4<f64>,
    /// Velocity of a driven tip, m/s.
    pub tip_velocity: Vector3<f64>,
    /// Angular velocity of a driven tip, rad/s.
    pub tip_angular_velocity: Vector3<f64>,
}

archived!(Inputs {
    base_position,
    base_orientation,
    base_velocity,
    base_angular_velocity,
    tip_force,
    tip_moment,
    tip_position,
    tip_orientation,
    tip_velocity,
    tip_angular_velocity,
});

impl Default for Inputs {
    /// A base at rest from which the rod leaves along +x, no loads; a driven tip half a metre away that points there as
    /// well.
    fn default() -> Self {
        Self {
            base_position: Vector3::zeros(),
            base_orientation: Vector4::new(0.5f64.sqrt(), 0.0, 0.5f64.sqrt(), 0.0),
            base_velocity: Vector3::zeros(),
            base_angular_velocity: Vector3::zeros(),
            tip_force: Vector3::zeros(),
            tip_moment: Vector3::zeros(),
            tip_position: Vector3::x() * 0.5,
            tip_orientation: Vector4::new(0.5f64.sqrt(), 0.0, 0.5f64.sqrt(), 0.0),
            tip_velocity: Vector3::zeros(),
            tip_angular_velocity: Vector3::zeros(),
        }
    }
}

/// First and second derivatives of the inputs at the beginning of a communication step, in which they are
/// x + x' t + x'' t²/2; NaN where none is given. In a vector of which any is given, the others count as zero.
#[derive(Clone, Debug)]
pub struct Derivatives {
    /// Of order 1.
    pub first: Inputs,
    /// Of order 2.
    pub second: Inputs,
}

archived!(Derivatives { first, second });

impl Default for Derivatives {
    /// None.
    fn default() -> Self {
        let (vector, quaternion) = (Vector3::repeat(f64::NAN), Vector4::repeat(f64::NAN));
        let none = Inputs {
            base_position: vector,
            base_orientation: quaternion,
            base_velocity: vector,
            base_angular_velocity: vector,
            tip_force: vector,
            tip_moment: vector,
            tip_position: vector,
            tip_orientation: quaternion,
            tip_velocity: vector,
            tip_angular_velocity: vector,
        };
        Self { first: none.clone(), second: none }
    }
}

/// A vector and its derivatives, as far as any are given.
type Going<const N: usize> = (SVector<f64, N>, [Option<SVector<f64, N>>; 2]);

impl Derivatives {
    /// Refuses what is infinite.
    ///
    /// # Errors
    /// [`Error::NotAllowed`] names the first input with such a derivative.
    pub fn validate(&self) -> Result<(), Error> {
        let infinite = |inputs: &Inputs| {
            let mut components = inputs.components().chain(inputs.tip_components());
            components.find(|(_, value)| value.is_infinite())
        };
        match infinite(&self.first).or_else(|| infinite(&self.second)) {
            Some((name, value)) => {
                let allowed = Allowed::Such("a finite derivative by time");
                Err(Error::NotAllowed { name, value, allowed })
            }
            None => Ok(()),
        }
    }

    pub(super) fn of<const N: usize>(&self, vector: fn(&Inputs) -> SVector<f64, N>) -> [Option<SVector<f64, N>>; 2] {
        let given = |inputs: &Inputs| {
            let values = vector(inputs);
            let zero_for_none = |value: f64| if value.is_nan() { 0.0 } else { value };
            values.iter().any(|value| !value.is_nan()).then(|| values.map(zero_for_none))
        };
        let second = given(&self.second);
        [given(&self.first).or(second.map(|_| SVector::zeros())), second]
    }

    /// What the path of the base has to know.
    pub(super) fn base_onward(&self, inputs: &Inputs) -> Onward {
        Onward {
            position: self.of(|inputs| inputs.base_position),
            rotation: so3::turning(&inputs.base_orientation, self.of(|inputs| inputs.base_orientation)),
            velocity: self.of(|inputs| inputs.base_velocity),
            angular_velocity: self.of(|inputs| inputs.base_angular_velocity),
        }
    }

    /// The same of a driven tip.
    pub(super) fn tip_onward(&self, inputs: &Inputs) -> Onward {
        Onward {
            position: self.of(|inputs| inputs.tip_position),
            rotation: so3::turning(&inputs.tip_orientation, self.of(|inputs| inputs.tip_orientation)),
            velocity: self.of(|inputs| inputs.tip_velocity),
            angular_velocity: self.of(|inputs| inputs.tip_angular_velocity),
        }
    }
}

/// A vector and its rate `time` s after the beginning of the step.
pub(super) fn at<const N: usize>((value, [first, second]): &Going<N>, time: f64) -> [SVector<f64, N>; 2] {
    match (first, second) {
        (Some(first), Some(second)) => [value + first * time + second * (0.5 * time * time), first + second * time],
        (Some(first), None) => [value + first * time, *first],
        (None, _) => [*value, SVector::zeros()],
    }
}

impl Inputs {
    /// Refuses what is not a number, and an orientation that is none.
    ///
    /// # Errors
    /// [`Error::NotAllowed`] names the first input.
    pub fn validate(&self) -> Result<(), Error> {
        if let Some((name, value)) = self.components().find(|(_, value)| !value.is_finite()) {
            return Err(Error::NotAllowed { name, value, allowed: Allowed::Finite });
        }
        is_orientation("base.orientation", &self.base_orientation)
    }

    /// Names and values of all its numbers but those that only a driven tip reads.
    fn components(&self) -> impl Iterator<Item = (&'static str, f64)> {
        const POSITION: [&str; 3] = ["base.position[1]", "base.position[2]", "base.position[3]"];
        const VELOCITY: [&str; 3] = ["base.velocity[1]", "base.velocity[2]", "base.velocity[3]"];
        const ANGULAR: [&str; 3] = ["base.angular_velocity[1]", "base.angular_velocity[2]", "base.angular_velocity[3]"];
        const FORCE: [&str; 3] = ["tip.force[1]", "tip.force[2]", "tip.force[3]"];
        const MOMENT: [&str; 3] = ["tip.moment[1]", "tip.moment[2]", "tip.moment[3]"];
        const ORIENTATION: [&str; 4] =
            ["base.orientation[1]", "base.orientation[2]", "base.orientation[3]", "base.orientation[4]"];
        let vectors = [
            (POSITION, &self.base_position),
            (VELOCITY, &self.base_velocity),
            (ANGULAR, &self.base_angular_velocity),
            (FORCE, &self.tip_force),
            (MOMENT, &self.tip_moment),
        ];
        let components = vectors.into_iter().flat_map(|(names, vector)| names.into_iter().zip(vector.iter().copied()));
        components.chain(ORIENTATION.into_iter().zip(self.base_orientation.iter().copied()))
    }

    /// The same for those that only a driven tip reads.
    pub(super) fn validate_tip(&self) -> Result<(), Error> {
        if let Some((name, value)) = self.tip_components().find(|(_, value)| !value.is_finite()) {
            return Err(Error::NotAllowed { name, value, allowed: Allowed::Finite });
        }
        is_orientation("tip.driven_orientation", &self.tip_orientation)
    }

    fn tip_components(&self) -> impl Iterator<Item = (&'static str, f64)> {
        const NAMES: [[&str; 3]; 3] = [
            ["tip.driven_position[1]", "tip.driven_position[2]", "tip.driven_position[3]"],
            ["tip.driven_velocity[1]", "tip.driven_velocity[2]", "tip.driven_velocity[3]"],
            ["tip.driven_angular_velocity[1]", "tip.driven_angular_velocity[2]", "tip.driven_angular_velocity[3]"],
        ];
        const ORIENTATION: [&str; 4] = [
            "tip.driven_orientation[1]",
            "tip.driven_orientation[2]",
            "tip.driven_orientation[3]",
            "tip.driven_orientation[4]",
        ];
        let vectors = [&self.tip_position, &self.tip_velocity, &self.tip_angular_velocity];
        let components = NAMES.into_iter().flatten().zip(vectors.into_iter().flatten().copied());
        components.chain(ORIENTATION.into_iter().zip(self.tip_orientation.iter().copied()))
    }

    pub(super) fn tip_sample(&self) -> Sample {
        Sample {
            position: self.tip_position,
            rotation: so3::from_quaternion(&self.tip_orientation.normalize()),
            velocity: self.tip_velocity,
            angular_velocity: self.tip_angular_velocity,
        }
    }

    pub(super) fn sample(&self) -> Sample {
        Sample {
            position: self.base_position,
            rotation: so3::from_quaternion(&self.base_orientation.normalize()),
            velocity: self.base_velocity,
            angular_velocity: self.base_angular_velocity,
        }
    }
}

fn is_orientation(name: &'static str, quaternion: &Vector4<f64>) -> Result<(), Error> {
    let norm = quaternion.norm();
    match norm > 1e-100 && norm.is_finite() {
        true => Ok(()),
        false => Err(Error::NotAllowed {
            name,
            value: norm,
            allowed: Allowed::Such("a quaternion other than zero, normalised on use"),
        }),
    }
}
