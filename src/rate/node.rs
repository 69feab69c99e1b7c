//! What a node of the rate formulation consists of.

use crate::boundary::Support;
use crate::mesh::Cell;
use nalgebra::{Matrix3, SVector, Vector3};
use std::ops::{Add, Mul, Sub};

type Vec3 = Vector3<f64>;

/// x = (u, ω, κ, n) of eq 15 at a node, or a derivative of it; body frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Unknowns {
    /// u, m/s.
    pub u: Vec3,
    /// ω, rad/s.
    pub omega: Vec3,
    /// κ, 1/m.
    pub kappa: Vec3,
    /// n, N.
    pub n: Vec3,
}

impl Unknowns {
    /// The vectors in the order of x.
    pub fn to_array(self) -> [Vec3; 4] {
        [self.u, self.omega, self.kappa, self.n]
    }

    /// From the vectors in the order of x.
    pub fn from_array([u, omega, kappa, n]: [Vec3; 4]) -> Self {
        Self { u, omega, kappa, n }
    }

    /// All numbers in the order of x.
    pub fn flat(&self) -> SVector<f64, 12> {
        let x = self.to_array();
        SVector::from_fn(|i, _| x[i / 3][i % 3])
    }

    /// The same function of each vector of two x.
    #[inline]
    pub(super) fn zip(self, other: Self, f: impl Fn(&Vec3, &Vec3) -> Vec3) -> Self {
        Self {
            u: f(&self.u, &other.u),
            omega: f(&self.omega, &other.omega),
            kappa: f(&self.kappa, &other.kappa),
            n: f(&self.n, &other.n),
        }
    }
}

impl Add for Unknowns {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Unknowns {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul<f64> for Unknowns {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        self.zip(self, |a, _| a * factor)
    }
}

/// A node at one instant, with all that a later step depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// x.
    pub x: Unknowns,
    /// ∂_t x of eq 19: the auxiliary rate.
    pub x_t: Unknowns,
    /// The rate that stands in the equations of motion at this instant (`v` of [`crate::alpha`]).
    pub v: Unknowns,
    /// Its rate as the last step saw it, first-order accurate; 0 at a start.
    pub v_t: Unknowns,
    /// ∂_s x of eq 20.
    pub x_s: Unknowns,
    /// R, body to world.
    pub rotation: Matrix3<f64>,
    /// r, m, world frame.
    pub position: Vec3,
    /// f without drag, N/m, body frame.
    pub load: Vec3,
}

impl Default for Node {
    fn default() -> Self {
        let (x, zero) = (Unknowns::default(), Vec3::zeros());
        Self { x, x_t: x, v: x, v_t: x, x_s: x, rotation: Matrix3::identity(), position: zero, load: zero }
    }
}

impl Node {
    /// Whether all its numbers are.
    pub(super) fn is_finite(&self) -> bool {
        let Self { x, x_t, v, v_t, x_s, rotation, position, load } = self;
        let rates = [x, x_t, v, v_t, x_s].into_iter().flat_map(|x| x.to_array());
        let numbers = rates.chain([*position, *load]).all(|vector| vector.iter().all(|x| x.is_finite()));
        numbers && rotation.iter().all(|x| x.is_finite())
    }

    /// Gives the node the velocities of a rigid body that moves with `base`: the twist of the base, carried to the node.
    pub(super) fn move_rigidly(&mut self, base: &Support) {
        let arm = self.position - base.position;
        self.x.u = self.rotation.tr_mul(&(base.velocity + base.angular_velocity.cross(&arm)));
        self.x.omega = self.rotation.tr_mul(&base.angular_velocity);
    }
}

/// The unstressed rod at a node.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rest {
    /// κ̂, body frame, 1/m.
    pub kappa: Vec3,
    /// ∂_s κ̂ of eq 20, 1/m².
    pub kappa_s: Vec3,
}

/// κ̂ at the nodes from its values at the middles of the cells: on the line through the two nearest, so that the means of
/// a smooth κ̂ stay second order on any mesh.
pub(super) fn nodal(cells: &[Cell]) -> Vec<Vec3> {
    let slope = |j: usize| (cells[j].kappa_rest - cells[j - 1].kappa_rest) / (cells[j].length + cells[j - 1].length);
    let last = cells.len() - 1;
    let at = |j: usize| match j {
        _ if last == 0 => cells[0].kappa_rest,
        0 => cells[0].kappa_rest - slope(1) * cells[0].length,
        j => cells[j - 1].kappa_rest + slope(j.min(last)) * cells[j - 1].length,
    };
    (0..=cells.len()).map(at).collect()
}
