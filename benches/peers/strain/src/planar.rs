//! The rod in the x-z plane, in Legendre modes of its curvature.
//!
//! The angle of the section at a Gauss point is θ = θ_b + Σ B_jk q_k with the integrals B = S P of the modes. Velocities
//! are v = ∫ n θ_t with t = (cos θ, sin θ), n = (−sin θ, cos θ), so that virtual power gives, with Ŝ = ρA SᵀWS,
//!
//! ```text
//! Bᵀ [Ŝ_jk cos(θ_j − θ_k) + ρI w_j δ_jk] B q_tt
//!     = Bᵀ [n_j·(ĉ_j (g − a_b) + w_j F + Σ_k Ŝ_jk t_k θ_k,t²)] + M B(L) − EI ∫P_k² q_k
//! ```
//!
//! ĉ_j = ρA Σ_i w_i S_ij is the mass beyond j times its weight.

use crate::dense::{self, Matrix, padded};
use crate::rule::Rule;
use crate::scenes::{Drive, Scene};
use crate::time::Motion;
use nalgebra::Vector3;

/// A planar rod with up to P points and M modes.
pub struct Planar<const P: usize, const M: usize> {
    scene: Scene,
    n: usize,
    modes: usize,
    base: f64,
    weights: [f64; P],
    /// ρI w_j.
    inertia: [f64; P],
    lever: [f64; P],
    stiffness: [f64; M],
    /// B by points, and by modes.
    turn: Box<Matrix<P, M>>,
    turn_by_modes: Box<Matrix<M, P>>,
    mass: Box<Matrix<P, P>>,
    of_points: Box<Matrix<P, P>>,
    half: Box<Matrix<P, M>>,
    matrix: Box<Matrix<M, M>>,
    /// B(L).
    tip: [f64; M],
    drive: (f64, Drive),
    /// t and θ_t² t, x and z.
    tangent: [[f64; P]; 2],
    slope: [[f64; P]; 2],
}

impl<const P: usize, const M: usize> Planar<P, M> {
    /// The rod of a scene.
    pub fn new(scene: &Scene, rule: &Rule) -> Self {
        let (n, modes) = rule.modes.shape();
        let tangent = scene.rotation.column(2);
        let turn = &rule.integral * &rule.modes;
        Self {
            n,
            modes,
            base: tangent[2].atan2(tangent[0]),
            weights: padded(rule.weights.iter().copied(), 0.0),
            inertia: padded(rule.weights.iter().map(|w| w * scene.inertia_per_length), 0.0),
            lever: padded(rule.lever().iter().map(|c| c * scene.mass_per_length), 0.0),
            stiffness: padded(rule.squares.iter().map(|square| square * scene.bending), 0.0),
            turn_by_modes: Matrix::padded(&turn.transpose()),
            turn: Matrix::padded(&turn),
            mass: Matrix::padded(&(rule.double_integral() * scene.mass_per_length)),
            of_points: Matrix::zeros(),
            half: Matrix::zeros(),
            matrix: Matrix::zeros(),
            tip: padded((0..modes).map(|k| (0..n).map(|i| rule.weights[i] * rule.modes[(i, k)]).sum()), 0.0),
            drive: (0.0, scene.drive(0.0)),
            tangent: [[0.0; P]; 2],
            slope: [[0.0; P]; 2],
            scene: scene.clone(),
        }
    }

    fn drive(&mut self, t: f64) -> Drive {
        if self.drive.0 != t {
            self.drive = (t, self.scene.drive(t));
        }
        self.drive.1
    }
}

impl<const P: usize, const M: usize> Motion for Planar<P, M> {
    fn start(&self) -> Vec<f64> {
        vec![0.0; 2 * M]
    }

    #[inline(never)]
    fn rates(&mut self, t: f64, y: &[f64], rates: &mut [f64]) {
        let drive = self.drive(t);
        let (y, _) = y.as_chunks::<M>();
        let (q, q_t) = (&y[0], &y[1]);
        let [theta, omega] = dense::combine(&self.turn_by_modes, self.modes, [q, q_t]);
        let (mut cos, mut sin) = ([0.0; P], [0.0; P]);
        let (mut u, mut v) = ([0.0; P], [0.0; P]);
        for i in 0..P {
            (sin[i], cos[i]) = dense::sin_cos(self.base + theta[i]);
            let square = omega[i] * omega[i];
            (u[i], v[i]) = (square * cos[i], square * sin[i]);
        }
        let [turning_x, turning_z] = dense::combine(&self.mass, self.n, [&u, &v]);
        let weight = self.scene.gravity - drive.acceleration;
        let (force, moment) = (drive.tip_force, -drive.tip_moment.y);
        let mut at_points = [0.0; P];
        for i in 0..P {
            let x = self.lever[i] * weight.x + self.weights[i] * force.x + turning_x[i];
            let z = self.lever[i] * weight.z + self.weights[i] * force.z + turning_z[i];
            at_points[i] = cos[i] * z - sin[i] * x;
        }
        let [mut right] = dense::combine(&self.turn, self.n, [&at_points]);
        for k in 0..M {
            right[k] += self.tip[k] * moment - self.stiffness[k] * q[k];
        }
        for j in 0..self.n {
            let (row, mass) = (&mut self.of_points.0[j], &self.mass.0[j]);
            let (c, s) = (cos[j], sin[j]);
            for k in 0..P {
                row[k] = mass[k] * (c * cos[k] + s * sin[k]);
            }
            row[j] += self.inertia[j];
        }
        self.half.0 = [[0.0; M]; P];
        dense::add_product(&mut self.half, &self.of_points, &self.turn, self.n, false);
        self.matrix.0 = [[0.0; M]; M];
        for k in self.modes..M {
            self.matrix.0[k][k] = 1.0;
        }
        dense::add_product(&mut self.matrix, &self.turn, &self.half, self.n, true);
        dense::solve(&mut self.matrix, &mut right);
        rates[..M].copy_from_slice(q_t);
        rates[M..].copy_from_slice(&right);
        self.tangent = [cos, sin];
        self.slope = [u, v];
    }

    fn sample(&mut self, t: f64, y: &[f64]) -> ([f64; 3], [f64; 3]) {
        let mut rates = vec![0.0; y.len()];
        self.rates(t, y, &mut rates);
        let drive = self.drive(t);
        let q_tt: &[f64; M] = rates[M..].try_into().expect("padded");
        let [turning] = dense::combine(&self.turn_by_modes, self.modes, [q_tt]);
        let [cos, sin] = &self.tangent;
        let [u, v] = &self.slope;
        let bend: [[f64; P]; 2] =
            [std::array::from_fn(|i| -turning[i] * sin[i] - u[i]), std::array::from_fn(|i| turning[i] * cos[i] - v[i])];
        let along = |weights: &[f64; P], of: &[[f64; P]; 2]| {
            let sum = |values: &[f64; P]| (0..self.n).map(|i| weights[i] * values[i]).sum::<f64>();
            Vector3::new(sum(&of[0]), 0.0, sum(&of[1]))
        };
        let tip = drive.position + along(&self.weights, &self.tangent);
        let mass = self.scene.mass_per_length * self.scene.length;
        let force = drive.tip_force + (self.scene.gravity - drive.acceleration) * mass - along(&self.lever, &bend);
        (tip.into(), force.into())
    }
}
