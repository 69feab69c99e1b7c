//! The boundary conditions (3.4.1), and the map Ξ that fades them out of the unknowns and in again (4.3).
//!
//! At the base u and ω are known. At the tip each of six pairs has one known member: along an axis of the support either
//! the component of u or that of n, about it either that of ω or that of m. What is left is unknown:
//!
//! ```text
//! x̃ = (κ₀, n₀ | x₁ | … | x_N−1 | six of the tip)
//! ```
//!
//! The unknowns of the tip are body components where all or none of a triple are held, and components along the axes of
//! the support where some are; where ω is held the unknown is m, which stands for κ = κ̂ + K⁻¹m.

use super::cell::{KAPPA, N, OMEGA, U};
use super::node::{Node, Rest, Unknowns};
use super::{FEED_STEPS, Options, Positions, State};
use crate::boundary::{Boundary, Held, Support};
use crate::rod::Rod;
use crate::so3::{self, hat};
use nalgebra::{Matrix3, SMatrix, Vector3};

type Vec3 = Vector3<f64>;
type Mat3 = Matrix3<f64>;

/// ∂x_N by the six unknowns of the tip, and by φ.
pub type TipColumns = SMatrix<f64, 12, 9>;

/// The known values at both ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ends {
    /// What holds the base.
    pub support: Support,
    /// u at the base, body frame.
    pub base_u: Vec3,
    /// ω at the base, body frame.
    pub base_omega: Vec3,
    /// At the tip.
    pub tip: Tip,
}

/// The known values at the tip, along the axes of its support.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tip {
    /// The axes, world frame.
    pub axes: Mat3,
    /// Where u and ω are known; elsewhere n and m are.
    pub held: Held,
    /// Components of u or n.
    pub translation: Vec3,
    /// Components of ω or m.
    pub rotation: Vec3,
}

/// How far a triple is held.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Extent {
    None,
    Some,
    All,
}

fn extent(held: &[bool; 3]) -> Extent {
    match held.iter().filter(|held| **held).count() {
        0 => Extent::None,
        3 => Extent::All,
        _ => Extent::Some,
    }
}

/// The rate and the load of a triple, body frame, from what is known (along the axes) and what is not. Q turns body
/// components into those along the axes.
fn joined(held: &[bool; 3], known: &Vec3, unknown: &Vec3, Q: &Mat3) -> (Vec3, Vec3) {
    let pick = |wanted: bool| {
        let along = |i: usize| if held[i] == wanted { known[i] } else { unknown[i] };
        Q.tr_mul(&Vec3::new(along(0), along(1), along(2)))
    };
    match extent(held) {
        Extent::None => (*unknown, Q.tr_mul(known)),
        Extent::All => (Q.tr_mul(known), *unknown),
        Extent::Some => (pick(true), pick(false)),
    }
}

/// The inverse of [`joined`]: what is not known.
fn parted(held: &[bool; 3], rate: &Vec3, load: &Vec3, Q: &Mat3) -> Vec3 {
    let (along_rate, along_load) = (Q * rate, Q * load);
    match extent(held) {
        Extent::None => *rate,
        Extent::All => *load,
        Extent::Some => Vec3::from_fn(|i, _| if held[i] { along_load[i] } else { along_rate[i] }),
    }
}

/// Derivatives of [`joined`] by the unknown triple and by φ: of the rate and of the load.
fn derivatives(held: &[bool; 3], rate: &Vec3, load: &Vec3, Q: &Mat3) -> [(Mat3, Mat3); 2] {
    let extent = extent(held);
    let basis = if extent == Extent::Some { Q.transpose() } else { Mat3::identity() };
    let part = |wanted: bool| {
        let column = |i: usize| if held[i] == wanted { basis.column(i).into_owned() } else { Vec3::zeros() };
        Mat3::from_columns(&[column(0), column(1), column(2)])
    };
    let turned = |v: &Vec3, turns: bool| if turns { hat(v) } else { Mat3::zeros() };
    [(part(false), turned(rate, extent != Extent::None)), (part(true), turned(load, extent != Extent::All))]
}

impl Tip {
    /// What `support` makes known of the rates and loads of a translation and a rotation, world frame.
    fn new(support: &Support, translation: [Vec3; 2], rotation: [Vec3; 2]) -> Self {
        let Support { rotation: axes, held, .. } = *support;
        let pick = |held: &[bool; 3], [rate, load]: [Vec3; 2]| {
            let (rate, load) = (axes.tr_mul(&rate), axes.tr_mul(&load));
            Vec3::from_fn(|i, _| if held[i] { rate[i] } else { load[i] })
        };
        let (translation, rotation) = (pick(&held.translation, translation), pick(&held.rotation, rotation));
        Self { axes, held, translation, rotation }
    }

    fn to_axes(self, rotation: &Mat3) -> Mat3 {
        self.axes.tr_mul(rotation)
    }

    /// Ξ at the tip: its six unknowns.
    pub fn fade_out(&self, rod: &Rod, rest: &Rest, x: &Unknowns, rotation: &Mat3) -> [Vec3; 2] {
        let Q = self.to_axes(rotation);
        let m = rod.stiffness.component_mul(&(x.kappa - rest.kappa));
        [parted(&self.held.translation, &x.u, &x.n, &Q), parted(&self.held.rotation, &x.omega, &m, &Q)]
    }

    /// Ξ⁻¹ at the tip: u, ω, κ and n of a section with orientation R.
    pub fn fade_in(&self, rod: &Rod, rest: &Rest, unknown: &[Vec3; 2], rotation: &Mat3) -> Unknowns {
        let Q = self.to_axes(rotation);
        let (u, n) = joined(&self.held.translation, &self.translation, &unknown[0], &Q);
        let (omega, m) = joined(&self.held.rotation, &self.rotation, &unknown[1], &Q);
        // κ(L) = K⁻¹ m(L) + κ̂(L), n(L) = f(L)
        Unknowns { u, omega, kappa: m.component_div(&rod.stiffness) + rest.kappa, n }
    }

    /// The derivative of [`Self::fade_in`] by the unknowns and by φ, at its value `x`.
    pub fn columns(&self, rod: &Rod, rest: &Rest, x: &Unknowns, rotation: &Mat3) -> TipColumns {
        let Q = self.to_axes(rotation);
        let m = rod.stiffness.component_mul(&(x.kappa - rest.kappa));
        let yielding = Mat3::from_diagonal(&rod.stiffness.map(f64::recip));
        let [u, n] = derivatives(&self.held.translation, &x.u, &x.n, &Q);
        let [omega, m] = derivatives(&self.held.rotation, &x.omega, &m, &Q);
        let mut columns = TipColumns::zeros();
        let mut set = |row, column, part: &Mat3| columns.fixed_view_mut::<3, 3>(row, column).copy_from(part);
        for (row, first, (by_unknown, by_phi)) in
            [(U, 0, u), (N, 0, n), (OMEGA, 3, omega), (KAPPA, 3, (yielding * m.0, yielding * m.1))]
        {
            set(row, first, &by_unknown);
            set(row, 6, &by_phi);
        }
        columns
    }
}

impl Ends {
    /// The known values at tᵢ: twists of the supports, dead loads of the tip. With [`Positions::Rebuilt`] the twist of a
    /// held tip brings it back, over several steps, to where its support wants it.
    pub fn new(boundary: &Boundary, old: &State, options: &Options, dt: f64) -> Self {
        let Boundary { base, tip, .. } = boundary;
        let (mut velocity, mut angular_velocity) = (tip.velocity, tip.angular_velocity);
        let before = &old.boundary.tip;
        if options.positions == Positions::Rebuilt && before.held == tip.held {
            let feed = 1.0 / (FEED_STEPS * dt);
            let Node { position, rotation, .. } = old.tip();
            velocity += (before.position - position) * feed;
            angular_velocity += so3::log(&(before.rotation * rotation.transpose())) * feed;
        }
        Self {
            support: *base,
            base_u: base.rotation.tr_mul(&base.velocity),
            base_omega: base.rotation.tr_mul(&base.angular_velocity),
            tip: Tip::new(tip, [velocity, boundary.tip_force], [angular_velocity, boundary.tip_moment]),
        }
    }

    /// The same for y = (u_t, ω_t, 0, n) at a start, by eq 12. The angular acceleration of the base is zero. A tip whose ω
    /// is held is as one where it is not: m is given at a start, so that 14b says what ω_t is, and nothing is left to
    /// hold it with.
    pub fn accelerations(boundary: &Boundary, base: &Node, tip: &Node) -> Self {
        let zero = Vec3::zeros();
        let Node { x: Unknowns { u, omega, .. }, rotation, .. } = tip;
        let acceleration = boundary.tip.acceleration - rotation * omega.cross(u);
        let held = Held { rotation: Held::FREE.rotation, ..boundary.tip.held };
        let support = Support { held, ..boundary.tip };
        Self {
            support: boundary.base,
            base_u: base.rotation.tr_mul(&boundary.base.acceleration) - base.x.omega.cross(&base.x.u),
            base_omega: zero,
            tip: Tip::new(&support, [acceleration, boundary.tip_force], [zero; 2]),
        }
    }

    /// x̃ = Ξ(x) (line 11): 12 numbers per cell.
    pub fn fade_out(&self, rod: &Rod, rest: &Rest, nodes: &[Node], reduced: &mut [Vec3]) {
        let last = nodes.len() - 1;
        [reduced[0], reduced[1]] = [nodes[0].x.kappa, nodes[0].x.n];
        for (node, to) in nodes[1..last].iter().zip(reduced[2..].chunks_exact_mut(4)) {
            to.copy_from_slice(&node.x.to_array());
        }
        let tip = self.tip.fade_out(rod, rest, &nodes[last].x, &nodes[last].rotation);
        reduced[4 * last - 2..].copy_from_slice(&tip);
    }

    /// x = Ξ⁻¹(x̃) (line 15), with the known values for the present orientation of the tip.
    pub fn fade_in(&self, rod: &Rod, rest: &Rest, reduced: &[Vec3], nodes: &mut [Node]) {
        let last = nodes.len() - 1;
        nodes[0].x = Unknowns { u: self.base_u, omega: self.base_omega, kappa: reduced[0], n: reduced[1] };
        for (node, from) in nodes[1..last].iter_mut().zip(reduced[2..].chunks_exact(4)) {
            node.x = Unknowns { u: from[0], omega: from[1], kappa: from[2], n: from[3] };
        }
        let unknown = [reduced[4 * last - 2], reduced[4 * last - 1]];
        nodes[last].x = self.tip.fade_in(rod, rest, &unknown, &nodes[last].rotation);
    }
}
