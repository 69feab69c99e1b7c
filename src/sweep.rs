//! One linear solve along the rod in O(N): elimination from the tip to the base, substitution from the base to the tip.
//! It knows blocks and no rod.
//!
//! The unknowns are increments of the world rotation φ, of an accumulated vector w (position or acceleration), of the force
//! n and of the moment m, at the nodes and at the Gauss points k of every cell. A cell of length h between the nodes 0 and
//! 1, with residuals e and the collocation matrix a, reads
//!
//! ```text
//! Φ_k = h Σ a_kl g_l − e            φ_k = φ₀ + T_k Φ_k
//! w_k = w₀ + h Σ a_kl w'_l − e      w'_l = E_l φ_l + Q_l n_l
//! n_k = n₁ − h Σ (b_l − a_kl) μ w_l − e
//! m_k = m₁ − h Σ (b_l − a_kl) m'_l − e      m'_l = H_l φ_l + N_l n_l
//! L_k g_k + M_k Φ_k + X_k φ_k − m_k = −e
//! ```
//!
//! and the same sums with b_l in place of a_kl (of b_l − a_kl) at node 1 (at node 0). From the tip to the base the sweep
//! carries (n, m) = P (w, φ) + p; within a cell only the increments g_l of the strain (and, where Q ≠ 0, w'_l) need a
//! solve, and the inextensible or rigid limit does them no harm.

use crate::mesh::{Gauss, MAX_STAGES};
use nalgebra::{Matrix3, Vector3};
use std::array::from_fn;

type Vec3 = Vector3<f64>;
type Mat3 = Matrix3<f64>;

/// Increments of one node or Gauss point, world frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Increment {
    /// Of the accumulated vector.
    pub w: Vec3,
    /// Of the rotation: R ← exp(φ̂) R, rad.
    pub phi: Vec3,
    /// Of the force, N.
    pub n: Vec3,
    /// Of the moment, N·m.
    pub m: Vec3,
}

/// The linearised equations at one Gauss point; letters as in the module's head.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// T.
    pub spin: Mat3,
    /// E.
    pub w_phi: Mat3,
    /// Q; read only by an extensible sweep.
    pub w_n: Mat3,
    /// H.
    pub m_phi: Mat3,
    /// N.
    pub m_n: Mat3,
    /// L.
    pub law_strain: Mat3,
    /// M.
    pub law_log: Mat3,
    /// X.
    pub law_phi: Mat3,
    /// e of the law.
    pub e_law: Vec3,
    /// e of Φ.
    pub e_log: Vec3,
    /// e of w.
    pub e_w: Vec3,
    /// e of n.
    pub e_n: Vec3,
    /// e of m.
    pub e_m: Vec3,
}

/// The rest of a cell: its length, T at node 1, and the residuals at its nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CellEnds {
    /// h, m.
    pub length: f64,
    /// T at node 1.
    pub spin: Mat3,
    /// e of Φ at node 1.
    pub e_log: Vec3,
    /// e of w at node 1.
    pub e_w: Vec3,
    /// e of n at node 0.
    pub e_n: Vec3,
    /// e of m at node 0.
    pub e_m: Vec3,
}

/// The relation (n, m) = P (w, φ) + p at a node.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Relation {
    /// ∂n/∂w.
    pub n_w: Mat3,
    /// ∂n/∂φ.
    pub n_phi: Mat3,
    /// ∂m/∂w.
    pub m_w: Mat3,
    /// ∂m/∂φ.
    pub m_phi: Mat3,
    /// n at w = φ = 0.
    pub n: Vec3,
    /// m at w = φ = 0.
    pub m: Vec3,
}

impl Relation {
    fn at(&self, w: &Vec3, phi: &Vec3) -> (Vec3, Vec3) {
        (self.n_w * w + self.n_phi * phi + self.n, self.m_w * w + self.m_phi * phi + self.m)
    }
}

/// The whole linear system.
#[derive(Clone, Debug)]
pub struct System {
    /// The Gauss points, cell by cell.
    pub points: Vec<Point>,
    /// The cells.
    pub cells: Vec<CellEnds>,
    /// μ.
    pub mass: f64,
    /// Whether Q takes part.
    pub extensible: bool,
    /// w and φ at the base.
    pub base: (Vec3, Vec3),
    /// The relation at the tip.
    pub tip: Relation,
}

/// A cell's equations for its strains have no unique solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Singular {
    /// Index of the cell from the base.
    pub cell: usize,
}

/// An affine function of a cell's `B` unknown vectors u and of w₀ and φ₀.
#[derive(Clone, Copy)]
struct Affine<const B: usize> {
    u: [Mat3; B],
    w: Mat3,
    phi: Mat3,
    one: Vec3,
}

impl<const B: usize> Affine<B> {
    #[inline(always)]
    fn constant(one: Vec3) -> Self {
        Self { u: [Mat3::zeros(); B], w: Mat3::zeros(), phi: Mat3::zeros(), one }
    }

    #[inline(always)]
    fn add(&mut self, scale: f64, other: &Self) {
        for (mine, theirs) in self.u.iter_mut().zip(&other.u) {
            *mine += theirs * scale;
        }
        self.w += other.w * scale;
        self.phi += other.phi * scale;
        self.one += other.one * scale;
    }

    #[inline(always)]
    fn times(&self, matrix: &Mat3) -> Self {
        Self { u: from_fn(|l| matrix * self.u[l]), w: matrix * self.w, phi: matrix * self.phi, one: matrix * self.one }
    }
}

/// Storage of the sweep, sized once; a solve allocates nothing.
#[derive(Clone, Debug)]
pub struct Sweep {
    rule: Gauss,
    blocks: usize,
    /// (n, m) as a function of (w, φ), at every node.
    relations: Vec<Relation>,
    /// u = gain (w₀, φ₀, 1), row by row, cell by cell.
    gains: Vec<f64>,
    scratch: Vec<f64>,
    /// Increments of the nodes after [`Sweep::solve`].
    pub nodes: Vec<Increment>,
    /// Increments of the Gauss points after [`Sweep::solve`].
    pub points: Vec<Increment>,
}

/// Columns of a gain: w₀, φ₀ and the constant.
const GAIN: usize = 7;

impl Sweep {
    /// Storage for `cells` cells of `rule`, with shear and stretch or without.
    pub fn new(cells: usize, rule: &Gauss, extensible: bool) -> Self {
        let stages = rule.stages;
        let blocks = if extensible { 2 * stages } else { stages };
        Self {
            rule: rule.clone(),
            blocks,
            relations: vec![Relation::default(); cells + 1],
            gains: vec![0.0; cells * 3 * blocks * GAIN],
            scratch: vec![0.0; 3 * blocks * (3 * blocks + GAIN)],
            nodes: vec![Increment::default(); cells + 1],
            points: vec![Increment::default(); cells * stages],
        }
    }

    /// Solves `system`; the increments are in [`Sweep::nodes`] and [`Sweep::points`].
    ///
    /// # Errors
    /// [`Singular`] names the first cell, seen from the tip, that cannot be solved.
    pub fn solve(&mut self, system: &System) -> Result<(), Singular> {
        self.eliminate(system)?;
        self.substitute(system);
        Ok(())
    }

    /// From the tip to the base: P and p at every node, and the gain of every cell.
    ///
    /// # Errors
    /// [`Singular`] as for [`Sweep::solve`].
    pub fn eliminate(&mut self, system: &System) -> Result<(), Singular> {
        match (self.rule.stages, system.extensible) {
            (1, false) => self.eliminate_cells::<1, 1>(system),
            (2, false) => self.eliminate_cells::<2, 2>(system),
            (3, false) => self.eliminate_cells::<3, 3>(system),
            (_, false) => self.eliminate_cells::<4, 4>(system),
            (1, true) => self.eliminate_cells::<1, 2>(system),
            (2, true) => self.eliminate_cells::<2, 4>(system),
            (3, true) => self.eliminate_cells::<3, 6>(system),
            (_, true) => self.eliminate_cells::<4, 8>(system),
        }
    }

    /// `S` stages; `B` is `S`, or 2 `S` if extensible.
    fn eliminate_cells<const S: usize, const B: usize>(&mut self, system: &System) -> Result<(), Singular> {
        let (a, b) = (&self.rule.a, &self.rule.b);
        let cells = system.cells.len();
        self.relations[cells] = system.tip;
        for cell in (0..cells).rev() {
            let ends = &system.cells[cell];
            let points: &[Point; S] = system.points[cell * S..][..S].try_into().unwrap_or_else(|_| unreachable!());
            let h = ends.length;

            // rotations
            let log: [Affine<B>; S] = from_fn(|k| {
                let mut log = Affine::constant(-points[k].e_log);
                for l in 0..S {
                    log.u[l] = Mat3::from_diagonal_element(h * a[k][l]);
                }
                log
            });
            let rotation = |spin: &Mat3, weights: &[f64; MAX_STAGES], e: &Vec3| {
                let mut phi = Affine::constant(-(spin * e));
                for l in 0..S {
                    phi.u[l] = spin * (h * weights[l]);
                }
                phi.phi = Mat3::identity();
                phi
            };
            let phi: [Affine<B>; S] = from_fn(|k| rotation(&points[k].spin, &a[k], &points[k].e_log));
            let phi_1: Affine<B> = rotation(&ends.spin, b, &ends.e_log);

            // the accumulated vector
            let driven: [Affine<B>; S] = from_fn(|k| phi[k].times(&points[k].w_phi));
            let w_s: [Affine<B>; S] = if B == S {
                driven
            } else {
                from_fn(|k| {
                    let mut w_s = Affine::constant(Vec3::zeros());
                    w_s.u[S + k] = Mat3::identity();
                    w_s
                })
            };
            let accumulate = |weights: &[f64; MAX_STAGES], e: &Vec3| {
                let mut w = Affine::constant(-e);
                w.w = Mat3::identity();
                for l in 0..S {
                    w.add(h * weights[l], &w_s[l]);
                }
                w
            };
            let w: [Affine<B>; S] = from_fn(|k| accumulate(&a[k], &points[k].e_w));
            let w_1 = accumulate(b, &ends.e_w);

            // force and moment, from node 1 backwards
            let tip = &self.relations[cell + 1];
            let related = |by_w: &Mat3, by_phi: &Mat3, constant: &Vec3| {
                let mut f = w_1.times(by_w);
                f.add(1.0, &phi_1.times(by_phi));
                f.one += constant;
                f
            };
            let n_1 = related(&tip.n_w, &tip.n_phi, &tip.n);
            let m_1 = related(&tip.m_w, &tip.m_phi, &tip.m);
            let backward = |f_1: &Affine<B>, f_s: &[Affine<B>; S], scale: f64, from: &[f64; MAX_STAGES], e: &Vec3| {
                let mut f = *f_1;
                for l in 0..S {
                    f.add(-h * scale * (b[l] - from[l]), &f_s[l]);
                }
                f.one -= e;
                f
            };
            let origin = [0.0; MAX_STAGES];
            let n: [Affine<B>; S] = from_fn(|k| backward(&n_1, &w, system.mass, &a[k], &points[k].e_n));
            let n_0 = backward(&n_1, &w, system.mass, &origin, &ends.e_n);
            let m_s: [Affine<B>; S] = from_fn(|k| {
                let mut m_s = phi[k].times(&points[k].m_phi);
                m_s.add(1.0, &n[k].times(&points[k].m_n));
                m_s
            });
            let m_0 = backward(&m_1, &m_s, 1.0, &origin, &ends.e_m);

            // the law at every point, and w' if it is an unknown of its own
            let size = 3 * B;
            let width = size + GAIN;
            for k in 0..S {
                let point = &points[k];
                let mut law = log[k].times(&point.law_log);
                law.add(1.0, &phi[k].times(&point.law_phi));
                law.add(-1.0, &backward(&m_1, &m_s, 1.0, &a[k], &point.e_m));
                law.u[k] += point.law_strain;
                law.one += point.e_law;
                store(&mut self.scratch, width, k, &law);
                if B > S {
                    let mut row = w_s[k];
                    row.add(-1.0, &driven[k]);
                    row.add(-1.0, &n[k].times(&point.w_n));
                    store(&mut self.scratch, width, S + k, &row);
                }
            }
            let gain = &mut self.gains[cell * size * GAIN..][..size * GAIN];
            solve_rows(&mut self.scratch, size, gain).ok_or(Singular { cell })?;

            // close the cell
            let closed = |f: &Affine<B>| {
                let (mut by_w, mut by_phi, mut one) = (f.w, f.phi, f.one);
                for (l, u) in f.u.iter().enumerate() {
                    let rows = &gain[3 * l * GAIN..];
                    by_w += u * Mat3::from_fn(|i, j| rows[i * GAIN + j]);
                    by_phi += u * Mat3::from_fn(|i, j| rows[i * GAIN + 3 + j]);
                    one += u * Vec3::from_fn(|i, _| rows[i * GAIN + 6]);
                }
                (by_w, by_phi, one)
            };
            let (n_w, n_phi, n) = closed(&n_0);
            let (m_w, m_phi, m) = closed(&m_0);
            self.relations[cell] = Relation { n_w, n_phi, m_w, m_phi, n, m };
        }
        Ok(())
    }

    /// From the base to the tip: the increments, for the correction `system.base` and the residuals that were eliminated.
    pub fn substitute(&mut self, system: &System) {
        let (a, b) = (&self.rule.a, &self.rule.b);
        let stages = self.rule.stages;
        let size = 3 * self.blocks;
        let (w, phi) = system.base;
        let (n, m) = self.relations[0].at(&w, &phi);
        self.nodes[0] = Increment { w, phi, n, m };
        for (cell, ends) in system.cells.iter().enumerate() {
            let points = &system.points[cell * stages..][..stages];
            let increments = &mut self.points[cell * stages..][..stages];
            let h = ends.length;
            let Increment { w: w_0, phi: phi_0, .. } = self.nodes[cell];
            let gain = &self.gains[cell * size * GAIN..][..size * GAIN];
            let unknown = |block: usize| {
                Vec3::from_fn(|i, _| {
                    let row = &gain[(3 * block + i) * GAIN..][..GAIN];
                    (0..3).fold(row[6], |sum, j| sum + row[j] * w_0[j] + row[3 + j] * phi_0[j])
                })
            };
            let strain: [Vec3; MAX_STAGES] = from_fn(|l| if l < stages { unknown(l) } else { Vec3::zeros() });
            let sum = |from: Vec3, weights: &[f64; MAX_STAGES], slope: &[Vec3; MAX_STAGES]| {
                (0..stages).fold(from, |sum, l| sum + slope[l] * (h * weights[l]))
            };

            let mut w_s = [Vec3::zeros(); MAX_STAGES];
            for (k, point) in points.iter().enumerate() {
                increments[k].phi = phi_0 + point.spin * sum(-point.e_log, &a[k], &strain);
                w_s[k] = if system.extensible { unknown(stages + k) } else { point.w_phi * increments[k].phi };
            }
            let phi_1 = phi_0 + ends.spin * sum(-ends.e_log, b, &strain);
            for (k, point) in points.iter().enumerate() {
                increments[k].w = sum(w_0 - point.e_w, &a[k], &w_s);
            }
            let w_1 = sum(w_0 - ends.e_w, b, &w_s);
            let (n_1, m_1) = self.relations[cell + 1].at(&w_1, &phi_1);

            let rest = |k: usize| -> [f64; MAX_STAGES] { from_fn(|l| a[k][l] - b[l]) };
            let n_s: [Vec3; MAX_STAGES] =
                from_fn(|l| if l < stages { increments[l].w * system.mass } else { Vec3::zeros() });
            let mut m_s = [Vec3::zeros(); MAX_STAGES];
            for (k, point) in points.iter().enumerate() {
                increments[k].n = sum(n_1 - point.e_n, &rest(k), &n_s);
                m_s[k] = point.m_phi * increments[k].phi + point.m_n * increments[k].n;
            }
            for (k, point) in points.iter().enumerate() {
                increments[k].m = sum(m_1 - point.e_m, &rest(k), &m_s);
            }
            self.nodes[cell + 1] = Increment { w: w_1, phi: phi_1, n: n_1, m: m_1 };
        }
    }

    /// The relation (n, m) = P (w, φ) + p at the base: of the reaction to a change of the base's motion.
    pub fn base_relation(&self) -> &Relation {
        &self.relations[0]
    }
}

/// Writes three rows of the cell's equations: the coefficients of u, then those of (w₀, φ₀, 1).
#[inline(always)]
fn store<const B: usize>(rows: &mut [f64], width: usize, block: usize, f: &Affine<B>) {
    for i in 0..3 {
        let row = &mut rows[(3 * block + i) * width..][..width];
        for (l, u) in f.u.iter().enumerate() {
            for j in 0..3 {
                row[3 * l + j] = u[(i, j)];
            }
        }
        for j in 0..3 {
            row[3 * B + j] = f.w[(i, j)];
            row[3 * B + 3 + j] = f.phi[(i, j)];
        }
        row[3 * B + 6] = f.one[i];
    }
}

/// Solves rows · (u, x, 1) = 0 for u = gain (x, 1): Gaussian elimination with scaled partial pivoting.
/// `None` where a pivot vanishes or is not finite.
fn solve_rows(rows: &mut [f64], size: usize, gain: &mut [f64]) -> Option<()> {
    let width = size + GAIN;
    for row in rows.chunks_exact_mut(width).take(size) {
        let largest = row[..size].iter().fold(0.0f64, |max, x| max.max(x.abs()));
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        let scale = 1.0 / largest;
        for x in row {
            *x *= scale;
        }
    }
    for pivot in 0..size {
        let magnitude = |row: usize| rows[row * width + pivot].abs();
        let best = (pivot + 1..size).fold(pivot, |best, row| if magnitude(row) > magnitude(best) { row } else { best });
        if !(magnitude(best) > 0.0 && magnitude(best).is_finite()) {
            return None;
        }
        if best != pivot {
            let (upper, lower) = rows.split_at_mut(best * width);
            upper[pivot * width..][..width].swap_with_slice(&mut lower[..width]);
        }
        let (upper, lower) = rows.split_at_mut((pivot + 1) * width);
        let pivot_row = &upper[pivot * width..];
        let inverse = 1.0 / pivot_row[pivot];
        for row in lower.chunks_exact_mut(width).take(size - pivot - 1) {
            let factor = row[pivot] * inverse;
            for (x, p) in row[pivot + 1..].iter_mut().zip(&pivot_row[pivot + 1..width]) {
                *x -= factor * p;
            }
        }
    }
    for i in (0..size).rev() {
        for column in 0..GAIN {
            let row = &rows[i * width..][..width];
            let known = (i + 1..size).fold(row[size + column], |sum, j| sum + row[j] * gain[j * GAIN + column]);
            gain[i * GAIN + column] = -known / row[i];
        }
    }
    Some(())
}
