//! The equations of a node and of a cell: eqs 14 to 20 and 23, and the blocks of the Jacobian (4.3.1).

use super::node::{Node, Rest, Unknowns};
use super::{Balance, Curvature, Options, Orientation};
use crate::alpha::{Rate, Scheme};
use crate::mesh::Cell;
use crate::rod::Rod;
use crate::so3::{self, hat};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

type Vec3 = Vector3<f64>;
type Mat3 = Matrix3<f64>;

/// The unknowns of a node with its rotation increment φ: the largest block.
pub const LARGEST: usize = 15;

/// A block of the Jacobian: rows 14a to 14d and, below them, those of φ; columns u, ω, κ, n and φ. The last three rows
/// and columns are empty where orientations lag.
pub type Block = SMatrix<f64, LARGEST, LARGEST>;

/// The left-hand sides of 14a, 14b, 14c, 14d.
pub type Rows = SVector<f64, 12>;

/// First row of each equation.
pub(super) const A: usize = 0;
pub(super) const B: usize = 3;
pub(super) const C: usize = 6;
pub(super) const D: usize = 9;
/// First row and column of φ.
pub(super) const PHI: usize = 12;
/// First column of each unknown.
pub(super) const U: usize = 0;
pub(super) const OMEGA: usize = 3;
pub(super) const KAPPA: usize = 6;
pub(super) const N: usize = 9;

/// ∂F_j/∂x_j and ∂F_j/∂x_j+1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blocks {
    /// By the node nearer to the base.
    pub before: Block,
    /// By the node nearer to the tip.
    pub after: Block,
}

/// One step in time, as a cell sees it.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// The rod.
    pub rod: &'a Rod,
    /// The way to solve.
    pub options: &'a Options,
    /// (α, β, γ)_t.
    pub time: Scheme,
    /// Δt, s.
    pub dt: f64,
    /// g, m/s², world frame.
    pub gravity: Vec3,
}

pub(super) fn rows(a: &Vec3, b: &Vec3, c: &Vec3, d: &Vec3) -> Rows {
    let mut rows = Rows::zeros();
    for (first, row) in [(A, a), (B, b), (C, c), (D, d)] {
        rows.fixed_rows_mut::<3>(first).copy_from(row);
    }
    rows
}

pub(super) fn add(block: &mut Block, row: usize, column: usize, part: &Mat3) {
    let mut place = block.fixed_view_mut::<3, 3>(row, column);
    place += part;
}

impl Step<'_> {
    /// m = K (κ − κ̂), body frame (eq 11).
    pub fn moment(&self, rest: &Rest, kappa: &Vec3) -> Vec3 {
        self.rod.stiffness.component_mul(&(kappa - rest.kappa))
    }

    /// M̂ ∂_t x, M̂ = diag(ρA, ρA, ρA, ρI₁, ρI₂, ρI₃, 1, 1, 1, 0, 0, 0).
    pub fn mass(&self, x_t: &Unknowns) -> Rows {
        let Rod { mass_per_length: rho_A, inertia_per_length: rho_I, .. } = self.rod;
        rows(&(x_t.u * *rho_A), &rho_I.component_mul(&x_t.omega), &x_t.kappa, &Vec3::zeros())
    }

    /// K̂ ∂_s x, −K̂ = adiag(1, 1, K, 1).
    pub fn stiffness(&self, x_s: &Unknowns) -> Rows {
        let K = &self.rod.stiffness;
        rows(&-x_s.n, &-K.component_mul(&x_s.kappa), &-x_s.omega, &-x_s.u)
    }

    /// Λ: what is left of eqs 14a to 14d; l = 0, and ∂_s m = K (∂_s κ − ∂_s κ̂).
    pub fn lambda(&self, node: &Node, rest: &Rest) -> Rows {
        let Unknowns { u, omega, kappa, n } = node.x;
        let Rod { stiffness: K, mass_per_length: rho_A, inertia_per_length: rho_I, drag, .. } = self.rod;
        let m = self.moment(rest, &kappa);
        let d_3 = Vec3::z();
        let f = node.load - u * *drag;
        rows(
            &(-kappa.cross(&n) + omega.cross(&u) * *rho_A - f),
            &(K.component_mul(&rest.kappa_s) - kappa.cross(&m) - d_3.cross(&n)
                + omega.cross(&rho_I.component_mul(&omega))),
            &omega.cross(&kappa),
            &(-kappa.cross(&u) + omega.cross(&d_3)),
        )
    }

    /// ∂Λ/∂x, and ∂Λ/∂φ for R exp(φ̂), where it does not vanish.
    fn lambda_x(&self, node: &Node, rest: &Rest) -> Block {
        let Unknowns { u, omega, kappa, n } = node.x;
        let Rod { stiffness: K, mass_per_length: rho_A, inertia_per_length: rho_I, drag, .. } = self.rod;
        let m = self.moment(rest, &kappa);
        let d_3 = hat(&Vec3::z());
        let mut block = Block::zeros();
        add(&mut block, A, U, &(hat(&(omega * *rho_A)) + Mat3::from_diagonal_element(*drag)));
        add(&mut block, A, OMEGA, &-hat(&(u * *rho_A)));
        add(&mut block, A, KAPPA, &hat(&n));
        add(&mut block, A, N, &-hat(&kappa));
        add(&mut block, B, OMEGA, &(hat(&omega) * Mat3::from_diagonal(rho_I) - hat(&rho_I.component_mul(&omega))));
        add(&mut block, B, KAPPA, &(hat(&m) - hat(&kappa) * Mat3::from_diagonal(K)));
        add(&mut block, B, N, &-d_3);
        add(&mut block, C, OMEGA, &-hat(&kappa));
        add(&mut block, C, KAPPA, &hat(&omega));
        add(&mut block, D, U, &-hat(&kappa));
        add(&mut block, D, OMEGA, &-d_3);
        add(&mut block, D, KAPPA, &hat(&u));
        if self.options.orientation == Orientation::InNewton {
            // f = RᵀF: ∂f = −φ × f
            add(&mut block, A, PHI, &-hat(&node.load));
        }
        block
    }

    /// Eq 19, and the rate that eq 17 leaves for the balance at tᵢ (line 19).
    pub fn update_rates(&self, old: &Node, new: &mut Node) {
        let dx = new.x - old.x;
        let rate = |old_t: &Vec3, old_v: &Vec3, dx: &Vec3| {
            self.time.rate(&Rate { auxiliary: *old_t, value: *old_v }, dx, self.dt)
        };
        let u = rate(&old.x_t.u, &old.v.u, &dx.u);
        let omega = rate(&old.x_t.omega, &old.v.omega, &dx.omega);
        let kappa = rate(&old.x_t.kappa, &old.v.kappa, &dx.kappa);
        let n = rate(&old.x_t.n, &old.v.n, &dx.n);
        new.x_t = Unknowns { u: u.auxiliary, omega: omega.auxiliary, kappa: kappa.auxiliary, n: n.auxiliary };
        new.v = Unknowns { u: u.value, omega: omega.value, kappa: kappa.value, n: n.value };
    }

    /// ∂_s x of node j+1 from that of node j (eq 20).
    pub fn update_slope(&self, before: &Node, after: &mut Node, ds: f64) {
        let dx = after.x - before.x;
        after.x_s = before.x_s.zip(dx, |x_s, dx| self.options.space.auxiliary(x_s, dx, ds));
    }

    /// ∂_s x of all nodes from that of the first (`compDxDs` of lines 5 and 21).
    pub fn update_slopes(&self, cells: &[Cell], nodes: &mut [Node]) {
        for (j, cell) in cells.iter().enumerate() {
            let (before, after) = (nodes[j], &mut nodes[j + 1]);
            self.update_slope(&before, after, cell.length);
        }
    }

    /// ∂_s x of the first node by eq 15: −K̂⁻¹(M̂ ∂_t x + Λ) (line 20).
    pub fn update_first_slopes(&self, node: &mut Node, rest: &Rest) {
        let x_t = match self.options.balance {
            Balance::Averaged => &node.x_t,
            Balance::AtEnd => &node.v,
        };
        let right = self.mass(x_t) + self.lambda(node, rest);
        let of = |first: usize| right.fixed_rows::<3>(first).into_owned();
        node.x_s = Unknowns { u: of(D), omega: of(C), kappa: of(B).component_div(&self.rod.stiffness), n: of(A) };
    }

    /// Weights of κ_j and κ_j+1 in the curvature that turns node j into node j+1.
    fn curvature_weights(&self) -> (f64, f64) {
        match self.options.curvature {
            Curvature::First => (1.0, 0.0),
            Curvature::Mean => (0.5, 0.5),
        }
    }

    /// κ Δs of eq 23.
    pub fn turn(&self, before: &Unknowns, after: &Unknowns, ds: f64) -> Vec3 {
        let (first, second) = self.curvature_weights();
        (before.kappa * first + after.kappa * second) * ds
    }

    /// Eq 23: R_j+1 = R_j exp(κΔs), and the load in the new frame (lines 16 and 17).
    pub fn update_orientation(&self, before: &Node, after: &mut Node, ds: f64) {
        after.rotation = so3::orthonormalised(&(before.rotation * so3::exp(&self.turn(&before.x, &after.x, ds))));
        self.update_load(after);
    }

    /// f = Rᵀ ρA g (line 17).
    pub fn update_load(&self, node: &mut Node) {
        node.load = node.rotation.tr_mul(&self.gravity) * self.rod.mass_per_length;
    }

    /// The share of the inertia of a node in eq 18.
    fn inertia(&self, old: &Node, new: &Node) -> Rows {
        let Scheme { alpha, beta, .. } = self.time;
        match self.options.balance {
            Balance::Averaged => self.mass(&(new.x_t * (1.0 - alpha) + old.x_t * alpha)),
            // the same average with −β v of the last step: (1−β) v
            Balance::AtEnd => self.mass(&new.v) * (1.0 - beta),
        }
    }

    /// The share of everything else.
    fn remainder(&self, rest: &Rest, old: &Node, new: &Node) -> Rows {
        let beta = self.time.beta;
        let at = |node: &Node| self.stiffness(&node.x_s) + self.lambda(node, rest);
        match self.options.balance {
            Balance::Averaged => at(new) * (1.0 - beta) + at(old) * beta,
            Balance::AtEnd => at(new) * (1.0 - beta),
        }
    }

    /// F_j(x_j, x_j+1): eq 18 for the cell between two nodes.
    pub fn residual(&self, rest: [&Rest; 2], old: [&Node; 2], new: [&Node; 2]) -> Rows {
        let Scheme { alpha, beta, .. } = self.options.space;
        self.inertia(old[1], new[1]) * (1.0 - alpha)
            + self.inertia(old[0], new[0]) * alpha
            + self.remainder(rest[1], old[1], new[1]) * (1.0 - beta)
            + self.remainder(rest[0], old[0], new[0]) * beta
    }

    /// ∂F_j/∂x_j and ∂F_j/∂x_j+1 at fixed ∂_s x_j, of a cell of length Δs; with `Orientation::InNewton` also the rows
    /// and columns of φ.
    pub fn blocks(&self, rest: [&Rest; 2], new: [&Node; 2], ds: f64) -> Blocks {
        let Scheme { alpha, beta, gamma } = self.options.space;
        let weight = (1.0 - self.time.beta) * self.time.rate_weight(self.dt);
        let balance = 1.0 - self.time.beta;
        let mut before = self.lambda_x(new[0], rest[0]) * (balance * beta);
        let mut after = self.lambda_x(new[1], rest[1]) * (balance * (1.0 - beta));

        let Rod { stiffness: K, mass_per_length: rho_A, inertia_per_length: rho_I, .. } = self.rod;
        let one = Mat3::identity();
        let mass = [(A, one * *rho_A), (B, Mat3::from_diagonal(rho_I)), (C, one)];
        for (i, part) in &mass {
            add(&mut before, *i, *i, &(part * (weight * alpha)));
            add(&mut after, *i, *i, &(part * (weight * (1.0 - alpha))));
        }
        let by_slope = balance * (1.0 - beta) / (gamma * ds);
        for (row, column, part) in [(A, N, one), (B, KAPPA, Mat3::from_diagonal(K)), (C, OMEGA, one), (D, U, one)] {
            add(&mut before, row, column, &(part * by_slope));
            add(&mut after, row, column, &(part * -by_slope));
        }

        if self.options.orientation == Orientation::InNewton {
            // eq 23 linearised: φ_j+1 = exp(−κΔs) φ_j + J_r(κΔs) δ(κΔs)
            let turn = self.turn(&new[0].x, &new[1].x, ds);
            let (first, second) = self.curvature_weights();
            let by_kappa = so3::right_jacobian(&turn) * ds;
            add(&mut before, PHI, KAPPA, &(by_kappa * -first));
            add(&mut before, PHI, PHI, &-so3::exp(&-turn));
            add(&mut after, PHI, KAPPA, &(by_kappa * -second));
            add(&mut after, PHI, PHI, &one);
        }
        Blocks { before, after }
    }
}
