//! What happens at the two ends of a rod, and what acts on it. Both formulations read it.

use crate::archive::archived;
use nalgebra::{Matrix3, Vector3};

type Vec3 = Vector3<f64>;
type Mat3 = Matrix3<f64>;

/// Which of its six motions a support holds, along and about its own axes d₁, d₂, d₃. The others are free and carry the
/// dead loads only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Held {
    /// Translations along d₁, d₂, d₃.
    pub translation: [bool; 3],
    /// Rotations about d₁, d₂, d₃: the components of log(RₛᵀR) that are to vanish, with Rₛ of the support and R of the
    /// section.
    pub rotation: [bool; 3],
}

archived!(Held { translation, rotation });

impl Held {
    /// All six: a clamp.
    pub const CLAMPED: Self = Self { translation: [true; 3], rotation: [true; 3] };
    /// The translations: a ball joint.
    pub const PINNED: Self = Self { translation: [true; 3], rotation: [false; 3] };
    /// None: a free end.
    pub const FREE: Self = Self { translation: [false; 3], rotation: [false; 3] };
}

/// What holds an end: a rigid body whose motion is given, and what it lets go; at one instant, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// Where it wants the end of the centreline, m.
    pub position: Vec3,
    /// Where it wants the section.
    pub rotation: Mat3,
    /// m/s.
    pub velocity: Vec3,
    /// rad/s.
    pub angular_velocity: Vec3,
    /// m/s².
    pub acceleration: Vec3,
    /// What it holds.
    pub held: Held,
}

archived!(Support { position, rotation, velocity, angular_velocity, acceleration, held });

impl Support {
    /// A clamp at rest.
    pub fn at_rest(position: Vec3, rotation: Mat3) -> Self {
        let zero = Vec3::zeros();
        let held = Held::CLAMPED;
        Self { position, rotation, velocity: zero, angular_velocity: zero, acceleration: zero, held }
    }

    fn is_finite(&self) -> bool {
        let Self { position, rotation, velocity, angular_velocity, acceleration, held: _ } = self;
        let vectors = [position, velocity, angular_velocity, acceleration];
        vectors.into_iter().flatten().chain(rotation).all(|x| x.is_finite())
    }

    /// No support.
    pub fn free() -> Self {
        Self { held: Held::FREE, ..Self::at_rest(Vec3::zeros(), Mat3::identity()) }
    }
}

/// What acts on the rod at one instant, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boundary {
    /// What holds the base.
    pub base: Support,
    /// What holds the tip, if anything.
    pub tip: Support,
    /// Dead force on the tip, N.
    pub tip_force: Vec3,
    /// Dead moment on the tip, N·m.
    pub tip_moment: Vec3,
    /// g, m/s².
    pub gravity: Vec3,
}

/// How fast what acts on the rod changes, world frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rates {
    /// Of the base's acceleration, m/s³.
    pub jerk: Vec3,
    /// Of the base's angular velocity, rad/s².
    pub angular_acceleration: Vec3,
    /// Of the force on the tip, N/s.
    pub tip_force: Vec3,
    /// Of the moment on the tip, N·m/s.
    pub tip_moment: Vec3,
}

/// What acts on the rod at one instant, and how it goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// At this instant.
    pub boundary: Boundary,
    /// From this instant on.
    pub rates: Rates,
}

archived!(Boundary { base, tip, tip_force, tip_moment, gravity });
archived!(Rates { jerk, angular_acceleration, tip_force, tip_moment });
archived!(Drive { boundary, rates });

impl Boundary {
    /// A base, a free tip without loads.
    pub fn hanging_from(base: Support, gravity: Vec3) -> Self {
        Self { base, tip: Support::free(), tip_force: Vec3::zeros(), tip_moment: Vec3::zeros(), gravity }
    }

    /// Whether all its numbers are.
    pub fn is_finite(&self) -> bool {
        let Self { base, tip, tip_force, tip_moment, gravity } = self;
        let vectors = [tip_force, tip_moment, gravity];
        base.is_finite() && tip.is_finite() && vectors.into_iter().flatten().all(|x| x.is_finite())
    }

    /// Whether the positions say more than the rotations: where the base is not a clamp, or a translation of the tip is
    /// held.
    pub fn holds_positions(&self) -> bool {
        self.base.held != Held::CLAMPED || self.tip.held.translation != Held::FREE.translation
    }
}
