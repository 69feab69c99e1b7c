//! The first step: ∂_s x and ∂_t x where no history tells them (lines 4 to 6 of Algorithm 1).

use super::Linear;
use super::cell::{A, B, Block, Blocks, C, D, KAPPA, N, OMEGA, PHI, Rows, Step, U, add, rows};
use super::ends::Ends;
use super::node::{Node, Rest, Unknowns, nodal};
use crate::alpha::{Motion, Rate, Scheme};
use crate::mesh::Cell;
use crate::rod::Rod;
use crate::so3::hat;
use crate::sweep::Singular;
use nalgebra::{Matrix3, Vector3};

type Vec3 = Vector3<f64>;
type Mat3 = Matrix3<f64>;

/// Line 4: κ̂ and ∂_s κ̂ at the nodes. What is given, ∂_s κ̂₀, is the difference across the first cell.
pub(super) fn rest(space: &Scheme, cells: &[Cell]) -> Vec<Rest> {
    let kappa = nodal(cells);
    let mut rest = vec![Rest { kappa: kappa[0], kappa_s: (kappa[1] - kappa[0]) / cells[0].length }];
    for (cell, pair) in cells.iter().zip(kappa.windows(2)) {
        let before = rest[rest.len() - 1].kappa_s;
        let kappa_s = space.auxiliary(&before, &(pair[1] - pair[0]), cell.length);
        rest.push(Rest { kappa: pair[1], kappa_s });
    }
    rest
}

/// Line 5: ∂_s x along the rod by eq 20. What is given, ∂_s x₀, is the difference across the first cell.
pub(super) fn slopes(step: &Step, cells: &[Cell], nodes: &mut [Node]) {
    nodes[0].x_s = (nodes[1].x - nodes[0].x) * (1.0 / cells[0].length);
    step.update_slopes(cells, nodes);
}

/// Line 6: ∂_t x = −M̂⁻¹(K̂ ∂_s x + Λ) for u, ω and κ; M̂ has no inverse for n, whose rate is zero.
pub(super) fn rates_as_printed(step: &Step, rest: &[Rest], nodes: &mut [Node]) {
    let Rod { mass_per_length: rho_A, inertia_per_length: rho_I, .. } = step.rod;
    for (node, rest) in nodes.iter_mut().zip(rest) {
        let right = step.stiffness(&node.x_s) + step.lambda(node, rest);
        let of = |first: usize| -right.fixed_rows::<3>(first).into_owned();
        node.x_t = Unknowns { u: of(A) / *rho_A, omega: of(B).component_div(rho_I), kappa: of(C), n: Vec3::zeros() };
        node.v = node.x_t;
    }
}

/// u_t, ω_t and n of a rod that moves as a rigid body with its base (κ_t = 0): eqs 14a, 14b and the time derivative of
/// 14d,
///
/// ```text
/// ρA u_t − n_s − κ × n = f − ρA ω × u
/// ρI ω_t − d₃ × n = m_s + κ × m − ω × ρI ω                0 = u_ts + κ × u_t − ω_t × d₃
/// ```
///
/// linear, and solved along the rod at once. In space they are the θ method with θ = γ_s, to which eqs 18 and 20 come
/// down wherever α_s = β_s. `ends` are those of y = (u_t, ω_t, 0, n), and `solved` and `reduced` take y.
///
/// # Errors
/// [`Singular`] if a cell has no pivot.
pub(super) fn accelerations(
    step: &Step,
    rod: (&[Cell], &[Rest], &[Node]),
    ends: &Ends,
    linear: &mut Linear,
    reduced: &mut [Vec3],
    solved: &mut [Node],
) -> Result<(), Singular> {
    let (cells, rest, nodes) = rod;
    let theta = step.options.space.gamma;
    let last = cells.len();
    // of the unstressed straight rod: y has no κ̂
    let straight = Rest::default();
    solved[last].rotation = nodes[last].rotation;
    reduced.fill(Vec3::zeros());
    ends.fade_in(step.rod, &straight, reduced, solved);
    let columns = ends.tip.columns(step.rod, &straight, &solved[last].x, &solved[last].rotation);
    for (j, cell) in cells.iter().enumerate() {
        let blocks = Blocks {
            before: left(step, &nodes[j], 1.0 - theta, -1.0 / cell.length),
            after: left(step, &nodes[j + 1], theta, 1.0 / cell.length),
        };
        let moment = |j: usize| step.moment(&rest[j], &nodes[j].x.kappa);
        let m_s = (moment(j + 1) - moment(j)) / cell.length;
        let known = right(step, &nodes[j], &rest[j]) * (1.0 - theta)
            + right(step, &nodes[j + 1], &rest[j + 1]) * theta
            + rows(&Vec3::zeros(), &m_s, &Vec3::zeros(), &Vec3::zeros());
        let value = |block: &Block, y: &Node| block.fixed_view::<12, 12>(0, 0) * y.x.flat();
        let missing = known - value(&blocks.before, &solved[j]) - value(&blocks.after, &solved[j + 1]);
        linear.enter(j, &blocks, &columns, &missing);
    }
    linear.solve()?;
    linear.take(reduced, 1.0);
    ends.fade_in(step.rod, &straight, reduced, solved);
    Ok(())
}

/// Takes y as ∂_t x and n of a rod that is about to move, with the rates where steps of `dt` want them: that of κ is
/// zero and about to change by κ_tt = ω_ts − ω_t × κ, those of u and ω are steady (as they are at rest and in uniform
/// rotation).
pub(super) fn take(step: &Step, cells: &[Cell], y: &mut [Node], nodes: &mut [Node]) {
    let zero = Vec3::zeros();
    slopes(step, cells, y);
    for (node, y) in nodes.iter_mut().zip(y) {
        let Unknowns { u: u_t, omega: omega_t, n, .. } = y.x;
        let kappa_tt = y.x_s.omega - omega_t.cross(&node.x.kappa);
        let bending = Motion::starting(zero, kappa_tt, zero);
        let Rate { auxiliary: kappa_t, value } =
            if step.time.is_second_order() { step.time.started(&bending, step.dt).velocity } else { bending.velocity };
        node.x.n = n;
        node.x_t = Unknowns { u: u_t, omega: omega_t, kappa: kappa_t, n: zero };
        node.v = Unknowns { kappa: value, ..node.x_t };
    }
}

/// The left-hand sides by y, with `weight` for its values and `slope` for its differences. The places of κ and φ, which
/// are not asked for, are zero.
fn left(step: &Step, node: &Node, weight: f64, slope: f64) -> Block {
    let Unknowns { kappa, .. } = node.x;
    let Rod { mass_per_length: rho_A, inertia_per_length: rho_I, .. } = step.rod;
    let (one, kappa, d_3) = (Mat3::identity(), hat(&kappa), hat(&Vec3::z()));
    let mut block = Block::zeros();
    add(&mut block, A, U, &(one * (rho_A * weight)));
    add(&mut block, A, N, &(one * -slope - kappa * weight));
    add(&mut block, B, OMEGA, &(Mat3::from_diagonal(rho_I) * weight));
    add(&mut block, B, N, &(d_3 * -weight));
    add(&mut block, C, KAPPA, &(one * f64::from(slope < 0.0)));
    add(&mut block, D, U, &(one * -slope - kappa * weight));
    add(&mut block, D, OMEGA, &(d_3 * -weight));
    add(&mut block, PHI, PHI, &(one * f64::from(slope > 0.0)));
    block
}

/// The right-hand sides at a node, m_s apart.
fn right(step: &Step, node: &Node, rest: &Rest) -> Rows {
    let Unknowns { u, omega, kappa, .. } = node.x;
    let Rod { mass_per_length: rho_A, inertia_per_length: rho_I, drag, .. } = step.rod;
    let m = step.moment(rest, &kappa);
    let zero = Vec3::zeros();
    rows(
        &(node.load - u * *drag - omega.cross(&u) * *rho_A),
        &(kappa.cross(&m) - omega.cross(&rho_I.component_mul(&omega))),
        &zero,
        &zero,
    )
}
