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
//!
//! An end may be held in some of six coordinates ξ = D (w, φ) and free in the others. With A the held rows of D, t their
//! increments and μ the forces that go with them, the tip obeys
//!
//! ```text
//! (n, m) = P (w, φ) + p + Aᵀ (μ − k (A (w, φ) − t))      A (w, φ) = t
//! ```
//!
//! whatever k, since the bracket behind it vanishes. k decides what the elimination sees, a tip on springs instead of a
//! free one: a free tip is unstable, and at some loads singular, under compression that the held one bears. The sweep
//! carries the columns of μ along with P and p, and ξ of the tip as a function of (w, φ) as it does (n, m). At the base
//! the held rows of D (w, φ) and the free rows of D⁻ᵀ (n, m), which balance, give (w, φ) there, and then A (w, φ) = t
//! at the tip gives μ.

use crate::mesh::{Gauss, MAX_STAGES};
use nalgebra::{Matrix3, Vector3};
use std::array::from_fn;
use std::fmt;

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

/// What is held at an end. An end that is not held at all has none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Which of the six coordinates: three of w, then three of φ.
    pub held: [bool; 6],
    /// D of w, a rotation.
    pub by_w: Mat3,
    /// D of φ.
    pub by_phi: Mat3,
    /// D⁻ᵀ of φ.
    pub of_moment: Mat3,
    /// t; of the free coordinates without meaning.
    pub correction: (Vec3, Vec3),
    /// k of w and of φ; read at the tip only.
    pub springs: (f64, f64),
}

impl Joint {
    /// Row `i` of D and its t.
    fn motion(&self, i: usize) -> (Vec3, Vec3, f64) {
        match i {
            0..3 => (self.by_w.row(i).transpose(), Vec3::zeros(), self.correction.0[i]),
            _ => (Vec3::zeros(), self.by_phi.row(i - 3).transpose(), self.correction.1[i - 3]),
        }
    }

    /// Row `i` of D⁻ᵀ.
    fn force(&self, i: usize) -> (Vec3, Vec3) {
        match i {
            0..3 => (self.by_w.row(i).transpose(), Vec3::zeros()),
            _ => (Vec3::zeros(), self.of_moment.row(i - 3).transpose()),
        }
    }

    /// The largest t of a held coordinate, of w over `w`.
    fn missing(&self, w: f64) -> f64 {
        let size = |i: usize| if i < 3 { self.motion(i).2.abs() / w } else { self.motion(i).2.abs() };
        (0..6).filter(|i| self.held[*i]).map(size).fold(0.0, larger)
    }
}

/// A maximum would drop what is not a number.
fn larger(largest: f64, x: f64) -> f64 {
    if x <= largest { largest } else { x }
}

/// The columns of μ in a relation: what (n, m), or ξ of the tip, gains by each of them.
type Columns = [(Vec3, Vec3); HELD];

impl Relation {
    /// Coefficients of w, φ and 1 in a · n + b · m.
    fn row(&self, a: &Vec3, b: &Vec3) -> [f64; FREE] {
        let by_w = self.n_w.tr_mul(a) + self.m_w.tr_mul(b);
        let by_phi = self.n_phi.tr_mul(a) + self.m_phi.tr_mul(b);
        [by_w.x, by_w.y, by_w.z, by_phi.x, by_phi.y, by_phi.z, a.dot(&self.n) + b.dot(&self.m)]
    }

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
    /// w and φ at the base, where all is held.
    pub base: (Vec3, Vec3),
    /// The base where not all is held.
    pub base_joint: Option<Joint>,
    /// The relation of the free directions there.
    pub base_load: Relation,
    /// The relation at the tip; of its free directions, where some are held.
    pub tip: Relation,
    /// What is held at the tip.
    pub tip_joint: Option<Joint>,
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
            base_joint: None,
            base_load: Relation::default(),
            tip: Relation::default(),
            tip_joint: None,
        }
    }

    /// The largest residual, scaled.
    pub fn residual(&self, scales: &Scales) -> f64 {
        let size = |w: &Vec3, log: &Vec3, n: &Vec3, m: &Vec3| {
            (w.amax() / scales.w).max(log.amax()).max(n.amax() / scales.force).max(m.amax() / scales.moment)
        };
        let points = self.points.iter().map(|point| size(&point.e_w, &point.e_log, &point.e_n, &point.e_m));
        let cells = self.cells.iter().map(|ends| size(&ends.e_w, &ends.e_log, &ends.e_n, &ends.e_m));
        let loads = size(&self.base.0, &self.base.1, &self.tip.n, &self.tip.m);
        let balance = size(&Vec3::zeros(), &Vec3::zeros(), &self.base_load.n, &self.base_load.m);
        let held = [&self.base_joint, &self.tip_joint].into_iter().flatten().map(|joint| joint.missing(scales.w));
        points.chain(cells).chain(held).chain([balance]).fold(loads, larger)
    }
}

/// Equations without a unique solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Singular {
    /// Of a cell, for its strains; its index from the base.
    Cell(usize),
    /// Of the base, for how it moves where it is free.
    Base,
    /// Of the tip, for the forces that hold it.
    Tip,
}

impl fmt::Display for Singular {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cell(cell) => write!(f, "singular in cell {}", cell + 1),
            Self::Base => write!(f, "singular at the base"),
            Self::Tip => write!(f, "singular at the tip"),
        }
    }
}

/// Three affine functions of the unknowns u of a cell, of w₀ and φ₀ and, if the tip is held, of μ: rows of the `W`
/// coefficients of u, w₀, φ₀, μ and 1, the last `G` of them not u's, so that the inner loops run along them.
#[derive(Clone, Copy)]
struct Affine<const W: usize, const G: usize>([[f64; W]; 3]);

/// Coordinates of an end.
const HELD: usize = 6;
/// Columns of w₀, φ₀ and the constant: the gain of a rod with a free tip.
const FREE: usize = 7;
/// Those of μ as well.
const WHOLE: usize = FREE + HELD;

impl<const W: usize, const G: usize> Affine<W, G> {
    const W_0: usize = W - G;
    const PHI_0: usize = Self::W_0 + 3;
    const MU: usize = Self::W_0 + 6;
    const ONE: usize = W - 1;

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

    /// Adds the columns of μ, where there are any, by `of` the pair.
    #[inline(always)]
    fn add_columns(&mut self, columns: &Columns, of: impl Fn(&(Vec3, Vec3)) -> &Vec3) {
        for c in 0..G - FREE {
            let column = of(&columns[c]);
            for i in 0..3 {
                self.0[i][Self::MU + c] += column[i];
            }
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
    /// What μ adds to them; of a held tip only.
    columns: Vec<Columns>,
    /// u = gain (w₀, φ₀, 1), row by row, cell by cell; with room for the columns of μ.
    gains: Vec<f64>,
    /// w and φ at the base.
    base: (Vec3, Vec3),
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
            columns: vec![Columns::default(); cells + 1],
            gains: vec![0.0; cells * 3 * blocks * WHOLE],
            base: Default::default(),
            scratch: vec![0.0; 3 * blocks * (3 * blocks + WHOLE)],
            nodes: vec![Increment::default(); cells + 1],
            points: vec![Increment::default(); cells * stages],
        }
    }

    /// Solves `system`; the increments are in [`Sweep::nodes`] and [`Sweep::points`].
    ///
    /// # Errors
    /// [`Singular`] names the first cell, seen from the tip, that cannot be solved, or else the end.
    pub fn solve(&mut self, system: &System) -> Result<(), Singular> {
        self.eliminate(system)?;
        self.substitute(system);
        Ok(())
    }

    /// From the tip to the base: P and p at every node, the gain of every cell, and w and φ at the base.
    ///
    /// # Errors
    /// [`Singular`] as for [`Sweep::solve`].
    pub fn eliminate(&mut self, system: &System) -> Result<(), Singular> {
        match &system.tip_joint {
            None => {
                self.eliminate_free(system)?;
                let base = self.at_base(system)?;
                self.base = (Vec3::from_fn(|i, _| base[i][HELD]), Vec3::from_fn(|i, _| base[3 + i][HELD]));
                Ok(())
            }
            Some(joint) => {
                let mut reach = Reach::default();
                self.eliminate_held(system, &mut reach)?;
                let base = self.at_base(system)?;
                let mu = at_tip(joint, &reach, &base)?;
                self.fold(&base, &mu);
                Ok(())
            }
        }
    }

    fn eliminate_free(&mut self, system: &System) -> Result<(), Singular> {
        let none = &mut Reach::default();
        match (self.rule.stages, system.extensible) {
            (1, false) => self.eliminate_cells::<1, { 3 + FREE }, FREE>(system, none),
            (2, false) => self.eliminate_cells::<2, { 6 + FREE }, FREE>(system, none),
            (3, false) => self.eliminate_cells::<3, { 9 + FREE }, FREE>(system, none),
            (_, false) => self.eliminate_cells::<4, { 12 + FREE }, FREE>(system, none),
            (1, true) => self.eliminate_cells::<1, { 6 + FREE }, FREE>(system, none),
            (2, true) => self.eliminate_cells::<2, { 12 + FREE }, FREE>(system, none),
            (3, true) => self.eliminate_cells::<3, { 18 + FREE }, FREE>(system, none),
            (_, true) => self.eliminate_cells::<4, { 24 + FREE }, FREE>(system, none),
        }
    }

    fn eliminate_held(&mut self, system: &System, reach: &mut Reach) -> Result<(), Singular> {
        match (self.rule.stages, system.extensible) {
            (1, false) => self.eliminate_cells::<1, { 3 + WHOLE }, WHOLE>(system, reach),
            (2, false) => self.eliminate_cells::<2, { 6 + WHOLE }, WHOLE>(system, reach),
            (3, false) => self.eliminate_cells::<3, { 9 + WHOLE }, WHOLE>(system, reach),
            (_, false) => self.eliminate_cells::<4, { 12 + WHOLE }, WHOLE>(system, reach),
            (1, true) => self.eliminate_cells::<1, { 6 + WHOLE }, WHOLE>(system, reach),
            (2, true) => self.eliminate_cells::<2, { 12 + WHOLE }, WHOLE>(system, reach),
            (3, true) => self.eliminate_cells::<3, { 18 + WHOLE }, WHOLE>(system, reach),
            (_, true) => self.eliminate_cells::<4, { 24 + WHOLE }, WHOLE>(system, reach),
        }
    }

    /// `S` stages, `W` columns: 3 `S` unknowns, or 6 `S` if extensible, and the `G` of the gain.
    fn eliminate_cells<const S: usize, const W: usize, const G: usize>(
        &mut self,
        system: &System,
        reach: &mut Reach,
    ) -> Result<(), Singular> {
        let (a, b) = (&self.rule.a, &self.rule.b);
        let cells = system.cells.len();
        let size = W - G;
        let extensible = size > 3 * S;
        self.relations[cells] = system.tip;
        if let Some(joint) = &system.tip_joint {
            (self.relations[cells], self.columns[cells]) = on_springs(&system.tip, joint);
            reach.relation = Relation { n_w: joint.by_w, m_phi: joint.by_phi, ..Relation::default() };
        }
        let (gains, _) = self.gains.as_chunks_mut::<G>();
        for cell in (0..cells).rev() {
            let ends = &system.cells[cell];
            let points = &system.points[cell * S..][..S];
            let h = ends.length;

            // A φ + M Φ = A φ₀ + (A T + M) (h Σ weights_l g_l − e), by A and A T + M
            let turned = |by_phi: &Mat3, by_log: &Mat3, weights: &[f64; MAX_STAGES], e: &Vec3| {
                let mut f = Affine::<W, G>::constant(-(by_log * e));
                for l in 0..S {
                    f.add_block(3 * l, &(by_log * (h * weights[l])));
                }
                f.add_block(Affine::<W, G>::PHI_0, by_phi);
                f
            };
            let at = |k: usize, by_phi: &Mat3| turned(by_phi, &(by_phi * points[k].spin), &a[k], &points[k].e_log);
            let at_end = |by_phi: &Mat3| turned(by_phi, &(by_phi * ends.spin), b, &ends.e_log);

            // the accumulated vector
            let driven: [Affine<W, G>; S] = from_fn(|k| at(k, &points[k].w_phi));
            let w_s: [Affine<W, G>; S] = if extensible {
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
                w.add_block(Affine::<W, G>::W_0, &Mat3::identity());
                w.add_sum(from_fn(|l| h * weights[l]), &w_s);
                w
            };
            let w: [Affine<W, G>; S] = from_fn(|k| accumulate(&a[k], &points[k].e_w));
            let w_1 = accumulate(b, &ends.e_w);

            // force and moment, from node 1 backwards
            let tip = &self.relations[cell + 1];
            let related = |by_w: &Mat3, by_phi: &Mat3, constant: &Vec3| {
                let mut f = at_end(by_phi);
                f.add_product(by_w, &w_1);
                f.add_constant(constant);
                f
            };
            let mut n_1 = related(&tip.n_w, &tip.n_phi, &tip.n);
            let mut m_1 = related(&tip.m_w, &tip.m_phi, &tip.m);
            n_1.add_columns(&self.columns[cell + 1], |(n, _)| n);
            m_1.add_columns(&self.columns[cell + 1], |(_, m)| m);
            let backward =
                |f_1: &Affine<W, G>, f_s: &[Affine<W, G>; S], scale: f64, from: &[f64; MAX_STAGES], e: &Vec3| {
                    let mut f = *f_1;
                    f.add_sum(from_fn(|l| -h * scale * (b[l] - from[l])), f_s);
                    f.add_constant(&-e);
                    f
                };
            let origin = [0.0; MAX_STAGES];
            let n: [Affine<W, G>; S] = from_fn(|k| backward(&n_1, &w, system.mass, &a[k], &points[k].e_n));
            let n_0 = backward(&n_1, &w, system.mass, &origin, &ends.e_n);
            let m_s: [Affine<W, G>; S] = from_fn(|k| {
                let mut m_s = at(k, &points[k].m_phi);
                m_s.add_product(&points[k].m_n, &n[k]);
                m_s
            });
            let m_0 = backward(&m_1, &m_s, 1.0, &origin, &ends.e_m);

            // the law at every point, and w' if it is an unknown of its own
            let rows = &mut self.scratch.as_chunks_mut::<W>().0[..size];
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
            let gain = &mut gains[cell * size..][..size];
            solve_rows(rows, gain).ok_or(Singular::Cell(cell))?;

            // close the cell
            let closed = |f: &Affine<W, G>| {
                f.0.map(|row| {
                    let (u, rest) = row.split_at(size);
                    let mut closed: [f64; G] = from_fn(|c| rest[c]);
                    for (u, gain) in u.iter().zip(gain.iter()) {
                        for c in 0..G {
                            closed[c] += u * gain[c];
                        }
                    }
                    closed
                })
            };
            let paired = |n: &Affine<W, G>, m: &Affine<W, G>, columns: &mut Columns| {
                let (n, m) = (closed(n), closed(m));
                let block = |rows: &[[f64; G]; 3], first: usize| Mat3::from_fn(|i, j| rows[i][first + j]);
                let column = |rows: &[[f64; G]; 3], c: usize| Vec3::from_fn(|i, _| rows[i][c]);
                for c in 0..G - FREE {
                    columns[c] = (column(&n, 6 + c), column(&m, 6 + c));
                }
                Relation {
                    n_w: block(&n, 0),
                    n_phi: block(&n, 3),
                    m_w: block(&m, 0),
                    m_phi: block(&m, 3),
                    n: column(&n, G - 1),
                    m: column(&m, G - 1),
                }
            };
            self.relations[cell] = paired(&n_0, &m_0, &mut self.columns[cell]);
            if G > FREE {
                let Reach { relation, columns } = reach;
                let mut w = related(&relation.n_w, &relation.n_phi, &relation.n);
                let mut phi = related(&relation.m_w, &relation.m_phi, &relation.m);
                w.add_columns(columns, |(w, _)| w);
                phi.add_columns(columns, |(_, phi)| phi);
                *relation = paired(&w, &phi, columns);
            }
        }
        Ok(())
    }

    /// w and φ at the base as functions of μ and 1.
    fn at_base(&self, system: &System) -> Result<[[f64; FREE]; HELD], Singular> {
        let mut base = [[0.0; FREE]; HELD];
        let Some(joint) = &system.base_joint else {
            for i in 0..3 {
                (base[i][HELD], base[3 + i][HELD]) = (system.base.0[i], system.base.1[i]);
            }
            return Ok(base);
        };
        let mut rows = [[0.0; WHOLE]; HELD];
        for i in 0..HELD {
            if joint.held[i] {
                let (w, phi, t) = joint.motion(i);
                for j in 0..3 {
                    (rows[i][j], rows[i][3 + j]) = (w[j], phi[j]);
                }
                rows[i][WHOLE - 1] = -t;
            } else {
                let (a, b) = joint.force(i);
                let (carried, load) = (self.relations[0].row(&a, &b), system.base_load.row(&a, &b));
                for j in 0..HELD {
                    rows[i][j] = carried[j] - load[j];
                    if system.tip_joint.is_some() {
                        let (n, m) = &self.columns[0][j];
                        rows[i][HELD + j] = a.dot(n) + b.dot(m);
                    }
                }
                rows[i][WHOLE - 1] = carried[HELD] - load[HELD];
            }
        }
        solve_rows(&mut rows, &mut base).ok_or(Singular::Base)?;
        Ok(base)
    }

    /// Takes the columns of μ into the constants.
    fn fold(&mut self, base: &[[f64; FREE]; HELD], mu: &[f64; HELD]) {
        let sum = |row: &[f64], constant: f64| row.iter().zip(mu).fold(constant, |sum, (x, mu)| sum + x * mu);
        let at = |i: usize| sum(&base[i][..HELD], base[i][HELD]);
        self.base = (Vec3::from_fn(|i, _| at(i)), Vec3::from_fn(|i, _| at(3 + i)));
        for (relation, columns) in self.relations.iter_mut().zip(&self.columns) {
            for ((n, m), mu) in columns.iter().zip(mu) {
                relation.n += n * *mu;
                relation.m += m * *mu;
            }
        }
        // the shorter rows move to the front, each to before where it was
        for row in 0..self.gains.len() / WHOLE {
            let whole: [f64; WHOLE] = from_fn(|c| self.gains[row * WHOLE + c]);
            let folded = &mut self.gains[row * FREE..][..FREE];
            folded[..HELD].copy_from_slice(&whole[..HELD]);
            folded[HELD] = sum(&whole[HELD..WHOLE - 1], whole[WHOLE - 1]);
        }
    }

    /// From the base to the tip: the increments, for the residuals that were eliminated.
    pub fn substitute(&mut self, system: &System) {
        let (a, b) = (&self.rule.a, &self.rule.b);
        let stages = self.rule.stages;
        let size = 3 * self.blocks;
        let (w, phi) = self.base;
        let (gains, _) = self.gains.as_chunks::<FREE>();
        let (n, m) = self.relations[0].at(&w, &phi);
        self.nodes[0] = Increment { w, phi, n, m };
        for (cell, ends) in system.cells.iter().enumerate() {
            let points = &system.points[cell * stages..][..stages];
            let increments = &mut self.points[cell * stages..][..stages];
            let h = ends.length;
            let Increment { w: w_0, phi: phi_0, .. } = self.nodes[cell];
            let gain = &gains[cell * size..][..size];
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

/// The coordinates of the tip's increment as functions of (w, φ), of μ and 1 at a node.
#[derive(Default)]
struct Reach {
    /// Of w in place of n, of φ in place of m.
    relation: Relation,
    columns: Columns,
}

/// The relation at a held tip on its springs, and the columns of μ there.
fn on_springs(load: &Relation, joint: &Joint) -> (Relation, Columns) {
    let (mut relation, mut columns) = (*load, Columns::default());
    for i in (0..HELD).filter(|i| joint.held[*i]) {
        let (w, phi, t) = joint.motion(i);
        relation.n_w -= w * w.transpose() * joint.springs.0;
        relation.n += w * (joint.springs.0 * t);
        relation.m_phi -= phi * phi.transpose() * joint.springs.1;
        relation.m += phi * (joint.springs.1 * t);
        columns[i] = (w, phi);
    }
    (relation, columns)
}

/// μ: what takes the held coordinates of the tip to their t.
fn at_tip(joint: &Joint, reach: &Reach, base: &[[f64; FREE]; HELD]) -> Result<[f64; HELD], Singular> {
    let mut rows = [[0.0; FREE]; HELD];
    for i in 0..HELD {
        if !joint.held[i] {
            rows[i][i] = 1.0;
            continue;
        }
        let unit = |first: usize| Vec3::from_fn(|j, _| f64::from(i == first + j));
        let (of_w, of_phi) = (unit(0), unit(3));
        let by_base = reach.relation.row(&of_w, &of_phi);
        for c in 0..FREE {
            let own = if c < HELD {
                let (w, phi) = &reach.columns[c];
                of_w.dot(w) + of_phi.dot(phi)
            } else {
                by_base[HELD] - joint.motion(i).2
            };
            rows[i][c] = (0..HELD).fold(own, |sum, j| sum + by_base[j] * base[j][c]);
        }
    }
    let mut mu = [[0.0; 1]; HELD];
    solve_rows(&mut rows, &mut mu).ok_or(Singular::Tip)?;
    Ok(mu.map(|[mu]| mu))
}

/// Solves rows · (u, x, 1) = 0 for u = gain (x, 1): Gaussian elimination with scaled partial pivoting.
/// `None` where a pivot vanishes or is not finite.
fn solve_rows<const W: usize, const G: usize>(rows: &mut [[f64; W]], gain: &mut [[f64; G]]) -> Option<()> {
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
        let mut known: [f64; G] = from_fn(|c| row[size + c]);
        for (x, solved) in row[i + 1..].iter().zip(lower) {
            for c in 0..G {
                known[c] += x * solved[c];
            }
        }
        upper[i] = known.map(|known| -known / row[i]);
    }
    Some(())
}
