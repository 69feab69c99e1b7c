//! One linear solve along the rod in O(N): elimination from the tip to the base, substitution from the base to the tip.
//! It knows blocks and no rod.
//!
//! The unknowns are increments of the world rotation φ, of an accumulated vector w (position or acceleration), of the
//! force n and of the moment m, at the nodes and at the Gauss points k of every cell. A cell of length h between the
//! nodes 0 and 1, with residuals e and the collocation matrix a, reads
//!
//! ```text
//! Φ_k = h Σ a_kl g_l − e            φ_k = φ₀ + T_k Φ_k
//! w_k = w₀ + h Σ a_kl w'_l − e      w'_l = E_l φ_l + Q_l n_l
//! n_k = n₁ − h Σ (b_l − a_kl) μ w_l − e
//! m_k = m₁ − h Σ (b_l − a_kl) m'_l − e      m'_l = H_l φ_l + N_l n_l
//! L_k g_k + M_k Φ_k + X_k φ_k − m_k = −e
//! ```
//!
//! and the same sums with b_l in place of a_kl (of b_l − a_kl) at node 1 (at node 0). From the tip to the base the
//! sweep carries (n, m) = P (w, φ) + p; within a cell only the increments g_l of the strain (and, where Q ≠ 0, w'_l)
//! need a solve, and the inextensible or rigid limit does them no harm.

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

/// Sizes that make residuals and increments numbers of order one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales {
    /// Of w, m or m/s².
    pub w: f64,
    /// Of n, N.
    pub force: f64,
    /// Of m, N·m.
    pub moment: f64,
}

impl System {
    /// Room for a system of `cells` cells of `rule`, with shear and stretch or without.
    pub fn new(cells: usize, rule: &Gauss, extensible: bool) -> Self {
        Self {
            points: vec![Point::default(); cells * rule.stages],
            cells: vec![CellEnds::default(); cells],
            mass: 0.0,
            extensible,
            base: Default::default(),
            tip: Relation::default(),
        }
    }

    /// The largest residual, scaled.
    pub fn residual(&self, scales: &Scales) -> f64 {
        let size = |w: &Vec3, log: &Vec3, n: &Vec3, m: &Vec3| {
            (w.amax() / scales.w).max(log.amax()).max(n.amax() / scales.force).max(m.amax() / scales.moment)
        };
        let points = self.points.iter().map(|point| size(&point.e_w, &point.e_log, &point.e_n, &point.e_m));
        let cells = self.cells.iter().map(|ends| size(&ends.e_w, &ends.e_log, &ends.e_n, &ends.e_m));
        let ends = size(&self.base.0, &self.base.1, &self.tip.n, &self.tip.m);
        // a maximum would drop what is not a number
        points.chain(cells).fold(ends, |largest, x| if x <= largest { largest } else { x })
    }
}

/// A cell's equations for its strains have no unique solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Singular {
    /// Index of the cell from the base.
    pub cell: usize,
}

/// Three affine functions of the unknowns u of a cell and of w₀ and φ₀: rows of the coefficients of u, w₀, φ₀ and 1, so
/// that the inner loops run along them.
#[derive(Clone, Copy)]
struct Affine<const W: usize>([[f64; W]; 3]);

/// Columns of w₀, φ₀ and the constant.
const GAIN: usize = 7;

impl<const W: usize> Affine<W> {
    const W_0: usize = W - GAIN;
    const PHI_0: usize = Self::W_0 + 3;
    const ONE: usize = Self::W_0 + 6;

    #[inline(always)]
    fn constant(one: Vec3) -> Self {
        let mut f = Self([[0.0; W]; 3]);
        for i in 0..3 {
            f.0[i][Self::ONE] = one[i];
        }
        f
    }

    /// Adds `matrix` to the coefficients of the vector at `column`.
    #[inline(always)]
    fn add_block(&mut self, column: usize, matrix: &Mat3) {
        for i in 0..3 {
            for j in 0..3 {
                self.0[i][column + j] += matrix[(i, j)];
            }
        }
    }

    #[inline(always)]
    fn add_constant(&mut self, one: &Vec3) {
        for i in 0..3 {
            self.0[i][Self::ONE] += one[i];
        }
    }

    /// Adds Σ weights_l terms_l.
    #[inline(always)]
    fn add_sum<const S: usize>(&mut self, weights: [f64; S], terms: &[Self; S]) {
        for i in 0..3 {
            for c in 0..W {
                let mut sum = self.0[i][c];
                for l in 0..S {
                    sum += weights[l] * terms[l].0[i][c];
                }
                self.0[i][c] = sum;
            }
        }
    }

    #[inline(always)]
    fn subtract(&mut self, other: &Self) {
        self.add_sum([-1.0], std::array::from_ref(other));
    }

    #[inline(always)]
    fn add_product(&mut self, matrix: &Mat3, other: &Self) {
        let [x, y, z] = &other.0;
        for i in 0..3 {
            let (by_x, by_y, by_z) = (matrix[(i, 0)], matrix[(i, 1)], matrix[(i, 2)]);
            for c in 0..W {
                self.0[i][c] += by_x * x[c] + by_y * y[c] + by_z * z[c];
            }
        }
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
    gains: Vec<[f64; GAIN]>,
    scratch: Vec<f64>,
    /// Increments of the nodes after [`Sweep::solve`].
    pub nodes: Vec<Increment>,
    /// Increments of the Gauss points after [`Sweep::solve`].
    pub points: Vec<Increment>,
}

impl Sweep {
    /// Storage for `cells` cells of `rule`, with shear and stretch or without.
    pub fn new(cells: usize, rule: &Gauss, extensible: bool) -> Self {
        let stages = rule.stages;
        let blocks = if extensible { 2 * stages } else { stages };
        Self {
            rule: rule.clone(),
            blocks,
            relations: vec![Relation::default(); cells + 1],
            gains: vec![[0.0; GAIN]; cells * 3 * blocks],
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
            (1, false) => self.eliminate_cells::<1, { 3 + GAIN }>(system),
            (2, false) => self.eliminate_cells::<2, { 6 + GAIN }>(system),
            (3, false) => self.eliminate_cells::<3, { 9 + GAIN }>(system),
            (_, false) => self.eliminate_cells::<4, { 12 + GAIN }>(system),
            (1, true) => self.eliminate_cells::<1, { 6 + GAIN }>(system),
            (2, true) => self.eliminate_cells::<2, { 12 + GAIN }>(system),
            (3, true) => self.eliminate_cells::<3, { 18 + GAIN }>(system),
            (_, true) => self.eliminate_cells::<4, { 24 + GAIN }>(system),
        }
    }

    /// `S` stages, `W` columns: 3 `S` unknowns, or 6 `S` if extensible, and those of the gain.
    fn eliminate_cells<const S: usize, const W: usize>(&mut self, system: &System) -> Result<(), Singular> {
        let (a, b) = (&self.rule.a, &self.rule.b);
        let cells = system.cells.len();
        let size = W - GAIN;
        let extensible = size > 3 * S;
        self.relations[cells] = system.tip;
        for cell in (0..cells).rev() {
            let ends = &system.cells[cell];
            let points = &system.points[cell * S..][..S];
            let h = ends.length;

            // A φ + M Φ = A φ₀ + (A T + M) (h Σ weights_l g_l − e), by A and A T + M
            let turned = |by_phi: &Mat3, by_log: &Mat3, weights: &[f64; MAX_STAGES], e: &Vec3| {
                let mut f = Affine::<W>::constant(-(by_log * e));
                for l in 0..S {
                    f.add_block(3 * l, &(by_log * (h * weights[l])));
                }
                f.add_block(Affine::<W>::PHI_0, by_phi);
                f
            };
            let at = |k: usize, by_phi: &Mat3| turned(by_phi, &(by_phi * points[k].spin), &a[k], &points[k].e_log);
            let at_end = |by_phi: &Mat3| turned(by_phi, &(by_phi * ends.spin), b, &ends.e_log);

            // the accumulated vector
            let driven: [Affine<W>; S] = from_fn(|k| at(k, &points[k].w_phi));
            let w_s: [Affine<W>; S] = if extensible {
                from_fn(|k| {
                    let mut w_s = Affine::constant(Vec3::zeros());
                    w_s.add_block(3 * (S + k), &Mat3::identity());
                    w_s
                })
            } else {
                driven
            };
            let accumulate = |weights: &[f64; MAX_STAGES], e: &Vec3| {
                let mut w = Affine::constant(-e);
                w.add_block(Affine::<W>::W_0, &Mat3::identity());
                w.add_sum(from_fn(|l| h * weights[l]), &w_s);
                w
            };
            let w: [Affine<W>; S] = from_fn(|k| accumulate(&a[k], &points[k].e_w));
            let w_1 = accumulate(b, &ends.e_w);

            // force and moment, from node 1 backwards
            let tip = &self.relations[cell + 1];
            let related = |by_w: &Mat3, by_phi: &Mat3, constant: &Vec3| {
                let mut f = at_end(by_phi);
                f.add_product(by_w, &w_1);
                f.add_constant(constant);
                f
            };
            let n_1 = related(&tip.n_w, &tip.n_phi, &tip.n);
            let m_1 = related(&tip.m_w, &tip.m_phi, &tip.m);
            let backward = |f_1: &Affine<W>, f_s: &[Affine<W>; S], scale: f64, from: &[f64; MAX_STAGES], e: &Vec3| {
                let mut f = *f_1;
                f.add_sum(from_fn(|l| -h * scale * (b[l] - from[l])), f_s);
                f.add_constant(&-e);
                f
            };
            let origin = [0.0; MAX_STAGES];
            let n: [Affine<W>; S] = from_fn(|k| backward(&n_1, &w, system.mass, &a[k], &points[k].e_n));
            let n_0 = backward(&n_1, &w, system.mass, &origin, &ends.e_n);
            let m_s: [Affine<W>; S] = from_fn(|k| {
                let mut m_s = at(k, &points[k].m_phi);
                m_s.add_product(&points[k].m_n, &n[k]);
                m_s
            });
            let m_0 = backward(&m_1, &m_s, 1.0, &origin, &ends.e_m);

            // the law at every point, and w' if it is an unknown of its own
            let (rows, _) = self.scratch.as_chunks_mut::<W>();
            for k in 0..S {
                let point = &points[k];
                let by_log = point.law_phi * point.spin + point.law_log;
                let mut law = turned(&point.law_phi, &by_log, &a[k], &point.e_log);
                law.subtract(&m_1);
                law.add_sum(from_fn(|l| h * (b[l] - a[k][l])), &m_s);
                law.add_block(3 * k, &point.law_strain);
                law.add_constant(&(point.e_m + point.e_law));
                rows[3 * k..][..3].copy_from_slice(&law.0);
                if extensible {
                    let mut row = w_s[k];
                    row.subtract(&driven[k]);
                    row.add_product(&-point.w_n, &n[k]);
                    rows[3 * (S + k)..][..3].copy_from_slice(&row.0);
                }
            }
            let gain = &mut self.gains[cell * size..][..size];
            solve_rows(rows, gain).ok_or(Singular { cell })?;

            // close the cell
            let closed = |f: &Affine<W>| {
                let rows = f.0.map(|row| {
                    let (u, rest) = row.split_at(size);
                    let mut closed: [f64; GAIN] = from_fn(|c| rest[c]);
                    for (u, gain) in u.iter().zip(gain.iter()) {
                        for c in 0..GAIN {
                            closed[c] += u * gain[c];
                        }
                    }
                    closed
                });
                let block = |first: usize| Mat3::from_fn(|i, j| rows[i][first + j]);
                (block(0), block(3), Vec3::from_fn(|i, _| rows[i][6]))
            };
            let (n_w, n_phi, n) = closed(&n_0);
            let (m_w, m_phi, m) = closed(&m_0);
            self.relations[cell] = Relation { n_w, n_phi, m_w, m_phi, n, m };
        }
        Ok(())
    }

    /// From the base to the tip: the increments, for the correction `system.base` and the residuals that were
    /// eliminated.
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
            let gain = &self.gains[cell * size..][..size];
            let unknown = |block: usize| {
                Vec3::from_fn(|i, _| {
                    let row = &gain[3 * block + i];
                    (0..3).fold(row[6], |sum, j| sum + row[j] * w_0[j] + row[3 + j] * phi_0[j])
                })
            };
            let strain: [Vec3; MAX_STAGES] = from_fn(|l| if l < stages { unknown(l) } else { Vec3::zeros() });
            let sum = |from: Vec3, weights: &[f64; MAX_STAGES], slope: &[Vec3; MAX_STAGES]| {
                (0..stages).fold(from, |sum, l| sum + slope[l] * (h * weights[l]))
            };

            let mut w_s = [Vec3::zeros(); MAX_STAGES];
            for (k, point) in points.iter().enumerate() {
                let log = sum(-point.e_log, &a[k], &strain);
                increments[k].phi = phi_0 + point.spin * log;
                // by its law: from the balance it would be a difference of larger moments where a cell is soft and
                // heavy
                increments[k].m = point.law_strain * strain[k]
                    + point.law_log * log
                    + point.law_phi * increments[k].phi
                    + point.e_law;
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
            for (k, point) in points.iter().enumerate() {
                increments[k].n = sum(n_1 - point.e_n, &rest(k), &n_s);
            }
            self.nodes[cell + 1] = Increment { w: w_1, phi: phi_1, n: n_1, m: m_1 };
        }
    }
}

/// Solves rows · (u, x, 1) = 0 for u = gain (x, 1): Gaussian elimination with scaled partial pivoting.
/// `None` where a pivot vanishes or is not finite.
fn solve_rows<const W: usize>(rows: &mut [[f64; W]], gain: &mut [[f64; GAIN]]) -> Option<()> {
    let size = gain.len();
    for row in rows.iter_mut() {
        let largest = row[..size].iter().fold(0.0f64, |max, x| max.max(x.abs()));
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        let scale = 1.0 / largest;
        row.iter_mut().for_each(|x| *x *= scale);
    }
    for pivot in 0..size {
        let magnitude = |row: usize| rows[row][pivot].abs();
        let best = (pivot + 1..size).fold(pivot, |best, row| if magnitude(row) > magnitude(best) { row } else { best });
        if !(magnitude(best) > 0.0 && magnitude(best).is_finite()) {
            return None;
        }
        rows.swap(pivot, best);
        let (upper, lower) = rows.split_at_mut(pivot + 1);
        let pivot_row = &upper[pivot];
        let inverse = 1.0 / pivot_row[pivot];
        for row in lower {
            let factor = row[pivot] * inverse;
            for c in pivot + 1..W {
                row[c] -= factor * pivot_row[c];
            }
        }
    }
    for i in (0..size).rev() {
        let row = &rows[i];
        let (upper, lower) = gain.split_at_mut(i + 1);
        let mut known: [f64; GAIN] = from_fn(|c| row[size + c]);
        for (x, solved) in row[i + 1..].iter().zip(lower) {
            for c in 0..GAIN {
                known[c] += x * solved[c];
            }
        }
        upper[i] = known.map(|known| -known / row[i]);
    }
    Some(())
}
