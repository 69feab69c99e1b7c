//! One linear solve along the rod in O(N): elimination from the tip to the base, substitution from the base to the tip.
//! It knows blocks and no rod.
//!
//! The unknowns are increments of the world rotation φ, of an accumulated vector w (position or acceleration), of the
//! force n and of the moment m, at the nodes and at the Gauss points k of every cell. w and n have `V` components, φ and
//! m have `S`: three each in space; two and one in a plane. A cell of length h between the nodes 0 and 1, with residuals
//! e and the collocation matrix a, reads
//!
//! ```text
//! Φ_k = h Σ a_kl g_l − e            φ_k = φ₀ + T_k Φ_k
//! w_k = w₀ + h Σ a_kl w'_l − e      w'_l = E_l φ_l + Q_l n_l
//! n_k = n₁ − h Σ (b_l − a_kl) μ w_l − e
//! p_k = p₁ − h Σ (b_l − a_kl) p'_l − e      p'_l = T_lᵀ m'_l + B_lᵀ g_l + G_l Φ_l + Z_l φ₀
//! m₀ = m₁ − h Σ b_l m'_l − e                m'_l = H_l φ_l + N_l n_l
//! ```
//!
//! and the same sums for Φ, w and n with b_l in place of a_kl (of b_l − a_kl) at node 1 (at node 0). p is the canonical
//! moment, which does work on Φ:
//!
//! ```text
//! p_k = A_k g_k + B_k Φ_k           p₁ = T₁ᵀ m₁ + Y₁ Φ₁ + Z₁ φ₀
//! ```
//!
//! In a conservative rod p_k and p'_k are the derivatives of one function by g_k and Φ_k, hence Bᵀ, and with the weights
//! h b_k the rows of p are symmetric, since b_l a_lk = b_k (b_l − a_kl). m at the points takes part in no balance; its
//! increments are L_k g_k + M_k Φ_k, in whatever axes L and M have. In a plane (S = 1) T = 1 and p = m = A g: the other
//! blocks of p, and those of m, are not read.
//!
//! From the tip to the base the sweep carries (n, m) = P (w, φ) + q; within a cell only the Φ_k (and, where Q ≠ 0, the
//! w'_k) need a solve, and the inextensible or rigid limit does them no harm. With them the strains are
//!
//! ```text
//! h g_k = Σ a⁻¹_kl (Φ_l + e_l)
//! ```
//!
//! and the φ_k are local, so that of the sums of sums only those of the rule itself are left. P and the elimination of
//! the cells depend on the blocks alone ([`Sweep::factorise`]); q and the substitution also on the residuals
//! ([`Sweep::solve_for`]), at a fraction of the cost.
//!
//! An end may be held in some of its V + S coordinates ξ = D (w, φ) and free in the others. At a base like that the held
//! rows of D (w, φ) and the free rows of D⁻ᵀ (n, m), which balance, give (w, φ). A tip with A the held rows of D, t their
//! increments and μ the forces that go with them, obeys
//!
//! ```text
//! (n, m) = P (w, φ) + q + Aᵀ (μ − k (A (w, φ) − t))      A (w, φ) = t
//! ```
//!
//! whatever k, since the bracket behind it vanishes. k decides what the elimination sees, a tip on springs instead of a
//! free one: a free tip is unstable, and at some loads singular, under compression that the held one bears. A (w, φ) is
//! a linear function of μ, which the responses to each of them and to the residuals give.

use crate::mesh::{Gauss, MAX_STAGES};
use nalgebra::{SMatrix, SVector};
use std::array::from_fn;
use std::fmt;

/// w and φ, or n and m.
type Pair<const V: usize, const S: usize> = (SVector<f64, V>, SVector<f64, S>);

/// Most coordinates of an end, V + S.
const COORDINATES: usize = 6;
/// Most unknowns of a cell.
const UNKNOWNS: usize = MAX_STAGES * COORDINATES;
/// Room for a linear function of the unknowns of a cell, of w₀ and of φ₀.
type Row = [f64; UNKNOWNS + COORDINATES];
const ROW: Row = [0.0; UNKNOWNS + COORDINATES];

/// Increments of one node or Gauss point, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Increment<const V: usize = 3, const S: usize = 3> {
    /// Of the accumulated vector.
    pub w: SVector<f64, V>,
    /// Of the rotation: R ← exp(φ̂) R, rad.
    pub phi: SVector<f64, S>,
    /// Of the force, N.
    pub n: SVector<f64, V>,
    /// Of the moment, N·m; of a Gauss point in the axes of its law.
    pub m: SVector<f64, S>,
}

/// The linearised equations at one Gauss point; letters as in the module's head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point<const V: usize = 3, const S: usize = 3> {
    /// T.
    pub spin: SMatrix<f64, S, S>,
    /// E.
    pub w_phi: SMatrix<f64, V, S>,
    /// Q; read only by an extensible sweep.
    pub w_n: SMatrix<f64, V, V>,
    /// H.
    pub m_phi: SMatrix<f64, S, S>,
    /// N.
    pub m_n: SMatrix<f64, S, V>,
    /// A.
    pub p_strain: SMatrix<f64, S, S>,
    /// B.
    pub p_log: SMatrix<f64, S, S>,
    /// G.
    pub slope_log: SMatrix<f64, S, S>,
    /// Z.
    pub slope_phi: SMatrix<f64, S, S>,
    /// L.
    pub law_strain: SMatrix<f64, S, S>,
    /// M.
    pub law_log: SMatrix<f64, S, S>,
}

/// The residuals e at one Gauss point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointResiduals<const V: usize = 3, const S: usize = 3> {
    /// Of Φ.
    pub log: SVector<f64, S>,
    /// Of w.
    pub w: SVector<f64, V>,
    /// Of n.
    pub n: SVector<f64, V>,
    /// Of p.
    pub p: SVector<f64, S>,
}

/// The rest of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellEnds<const S: usize = 3> {
    /// h, m.
    pub length: f64,
    /// T at node 1.
    pub spin: SMatrix<f64, S, S>,
    /// Y₁.
    pub p_log: SMatrix<f64, S, S>,
    /// Z₁.
    pub p_phi: SMatrix<f64, S, S>,
}

/// The residuals e at the nodes of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndResiduals<const V: usize = 3, const S: usize = 3> {
    /// Of Φ at node 1.
    pub log: SVector<f64, S>,
    /// Of w at node 1.
    pub w: SVector<f64, V>,
    /// Of n at node 0.
    pub n: SVector<f64, V>,
    /// Of m at node 0.
    pub m: SVector<f64, S>,
}

/// P of the relation (n, m) = P (w, φ) + q at a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relation<const V: usize = 3, const S: usize = 3> {
    /// ∂n/∂w.
    pub n_w: SMatrix<f64, V, V>,
    /// ∂n/∂φ.
    pub n_phi: SMatrix<f64, V, S>,
    /// ∂m/∂w.
    pub m_w: SMatrix<f64, S, V>,
    /// ∂m/∂φ.
    pub m_phi: SMatrix<f64, S, S>,
}

/// What is held at an end. An end that is not held at all has none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint<const V: usize = 3, const S: usize = 3> {
    /// Which of the coordinates: those of w, those of φ.
    pub held: ([bool; V], [bool; S]),
    /// D of w, a rotation.
    pub by_w: SMatrix<f64, V, V>,
    /// D of φ.
    pub by_phi: SMatrix<f64, S, S>,
    /// D⁻ᵀ of φ.
    pub of_moment: SMatrix<f64, S, S>,
    /// k of w and of φ; read at the tip only.
    pub springs: (f64, f64),
}

/// The right-hand side of a [`System`].
#[derive(Clone, Debug)]
pub struct Residuals<const V: usize = 3, const S: usize = 3> {
    /// At the Gauss points, cell by cell.
    pub points: Vec<PointResiduals<V, S>>,
    /// At the nodes, cell by cell.
    pub cells: Vec<EndResiduals<V, S>>,
    /// w and φ at the base where all is held, else its t; 0 in free coordinates.
    pub base: Pair<V, S>,
    /// q of the free directions there.
    pub base_load: Pair<V, S>,
    /// t of a held tip; 0 in free coordinates.
    pub tip: Pair<V, S>,
    /// q at the tip; of its free directions, where some are held.
    pub tip_load: Pair<V, S>,
}

/// The whole linear system.
#[derive(Clone, Debug)]
pub struct System<const V: usize = 3, const S: usize = 3> {
    /// The Gauss points, cell by cell.
    pub points: Vec<Point<V, S>>,
    /// The cells.
    pub cells: Vec<CellEnds<S>>,
    /// μ.
    pub mass: f64,
    /// Whether Q takes part.
    pub extensible: bool,
    /// The base where not all is held.
    pub base_joint: Option<Joint<V, S>>,
    /// P of the free directions there.
    pub base_load: Relation<V, S>,
    /// P at the tip; of its free directions, where some are held.
    pub tip_load: Relation<V, S>,
    /// What is held at the tip.
    pub tip_joint: Option<Joint<V, S>>,
    /// All that [`Sweep::factorise`] does not read.
    pub residuals: Residuals<V, S>,
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

// no derives: arrays of any length have no default
impl<const V: usize, const S: usize> Default for Increment<V, S> {
    fn default() -> Self {
        Self { w: SVector::zeros(), phi: SVector::zeros(), n: SVector::zeros(), m: SVector::zeros() }
    }
}

impl<const V: usize, const S: usize> Default for Point<V, S> {
    fn default() -> Self {
        Self {
            spin: SMatrix::zeros(),
            w_phi: SMatrix::zeros(),
            w_n: SMatrix::zeros(),
            m_phi: SMatrix::zeros(),
            m_n: SMatrix::zeros(),
            p_strain: SMatrix::zeros(),
            p_log: SMatrix::zeros(),
            slope_log: SMatrix::zeros(),
            slope_phi: SMatrix::zeros(),
            law_strain: SMatrix::zeros(),
            law_log: SMatrix::zeros(),
        }
    }
}

impl<const V: usize, const S: usize> Default for PointResiduals<V, S> {
    fn default() -> Self {
        let (w, phi) = zero();
        Self { log: phi, w, n: w, p: phi }
    }
}

impl<const S: usize> Default for CellEnds<S> {
    fn default() -> Self {
        Self { length: 0.0, spin: SMatrix::zeros(), p_log: SMatrix::zeros(), p_phi: SMatrix::zeros() }
    }
}

impl<const V: usize, const S: usize> Default for EndResiduals<V, S> {
    fn default() -> Self {
        let (w, phi) = zero();
        Self { log: phi, w, n: w, m: phi }
    }
}

impl<const V: usize, const S: usize> Default for Relation<V, S> {
    fn default() -> Self {
        Self { n_w: SMatrix::zeros(), n_phi: SMatrix::zeros(), m_w: SMatrix::zeros(), m_phi: SMatrix::zeros() }
    }
}

fn zero<const V: usize, const S: usize>() -> Pair<V, S> {
    (SVector::zeros(), SVector::zeros())
}

fn component<const V: usize, const S: usize>((w, phi): &Pair<V, S>, i: usize) -> f64 {
    if i < V { w[i] } else { phi[i - V] }
}

fn dot<const V: usize, const S: usize>(a: &Pair<V, S>, b: &Pair<V, S>) -> f64 {
    a.0.dot(&b.0) + a.1.dot(&b.1)
}

impl<const V: usize, const S: usize> Joint<V, S> {
    fn holds(&self, i: usize) -> bool {
        if i < V { self.held.0[i] } else { self.held.1[i - V] }
    }

    /// Row `i` of D.
    fn motion(&self, i: usize) -> Pair<V, S> {
        match i < V {
            true => (self.by_w.row(i).transpose(), SVector::zeros()),
            false => (SVector::zeros(), self.by_phi.row(i - V).transpose()),
        }
    }

    /// Row `i` of D⁻ᵀ.
    fn force(&self, i: usize) -> Pair<V, S> {
        match i < V {
            true => (self.by_w.row(i).transpose(), SVector::zeros()),
            false => (SVector::zeros(), self.of_moment.row(i - V).transpose()),
        }
    }

    fn spring(&self, i: usize) -> f64 {
        if i < V { self.springs.0 } else { self.springs.1 }
    }
}

impl<const V: usize, const S: usize> Relation<V, S> {
    /// Coefficients of w and φ in a · n + b · m.
    fn row(&self, (a, b): &Pair<V, S>) -> Pair<V, S> {
        (self.n_w.tr_mul(a) + self.m_w.tr_mul(b), self.n_phi.tr_mul(a) + self.m_phi.tr_mul(b))
    }

    /// q + P (w, φ).
    #[inline(always)]
    fn at(&self, p: &Pair<V, S>, w: &SVector<f64, V>, phi: &SVector<f64, S>) -> Pair<V, S> {
        let (mut n, mut m) = *p;
        add_product(&mut n, &self.n_w, w);
        add_product(&mut n, &self.n_phi, phi);
        add_product(&mut m, &self.m_w, w);
        add_product(&mut m, &self.m_phi, phi);
        (n, m)
    }
}

/// A maximum would drop what is not a number.
pub(crate) fn larger(largest: f64, x: f64) -> f64 {
    if x <= largest { largest } else { x }
}

impl<const V: usize, const S: usize> Residuals<V, S> {
    /// Room for the residuals of `cells` cells of `rule`.
    pub fn new(cells: usize, rule: &Gauss) -> Self {
        Self {
            points: vec![PointResiduals::default(); cells * rule.stages],
            cells: vec![EndResiduals::default(); cells],
            base: zero(),
            base_load: zero(),
            tip: zero(),
            tip_load: zero(),
        }
    }

    /// Makes it that of as many cells, whose residuals are to be set.
    pub fn resize(&mut self, cells: usize, rule: &Gauss) {
        self.points.resize(cells * rule.stages, PointResiduals::default());
        self.cells.resize(cells, EndResiduals::default());
    }

    /// The largest, scaled.
    pub fn largest(&self, scales: &Scales) -> f64 {
        let size = |w: &SVector<f64, V>, log: &SVector<f64, S>, n: &SVector<f64, V>, m: &SVector<f64, S>| {
            (w.amax() / scales.w).max(log.amax()).max(n.amax() / scales.force).max(m.amax() / scales.moment)
        };
        let points = self.points.iter().map(|point| size(&point.w, &point.log, &point.n, &point.p));
        let cells = self.cells.iter().map(|ends| size(&ends.w, &ends.log, &ends.n, &ends.m));
        let ends = [(&self.base, &self.base_load), (&self.tip, &self.tip_load)];
        let ends = ends.into_iter().map(|((w, phi), (n, m))| size(w, phi, n, m));
        points.chain(cells).chain(ends).fold(0.0, larger)
    }
}

impl<const V: usize, const S: usize> System<V, S> {
    /// Room for a system of `cells` cells of `rule`, with shear and stretch or without.
    pub fn new(cells: usize, rule: &Gauss, extensible: bool) -> Self {
        Self {
            points: vec![Point::default(); cells * rule.stages],
            cells: vec![CellEnds::default(); cells],
            mass: 0.0,
            extensible,
            base_joint: None,
            base_load: Relation::default(),
            tip_load: Relation::default(),
            tip_joint: None,
            residuals: Residuals::new(cells, rule),
        }
    }

    /// Makes it a system of as many cells, which are to be set.
    pub fn resize(&mut self, cells: usize, rule: &Gauss) {
        self.points.resize(cells * rule.stages, Point::default());
        self.cells.resize(cells, CellEnds::default());
        self.residuals.resize(cells, rule);
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

impl std::error::Error for Singular {}

/// The largest increments of a solution.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Largest {
    /// |φ|, rad.
    pub turn: f64,
    /// Of a component of n, N.
    pub force: f64,
    /// Of a component of m, N·m.
    pub moment: f64,
}

impl Largest {
    #[inline(always)]
    fn with<const V: usize, const S: usize>(self, delta: &Increment<V, S>) -> Self {
        Self {
            turn: larger(self.turn, delta.phi.norm()),
            force: larger(self.force, delta.n.amax()),
            moment: larger(self.moment, delta.m.amax()),
        }
    }
}

/// One number for each of the `K` Gauss points of a cell.
type Lanes<const K: usize> = [f64; K];
/// A matrix for each of them, entry by entry.
type Block<const K: usize, const R: usize, const C: usize> = [[Lanes<K>; C]; R];

/// y += A x.
#[inline(always)]
fn add_product<const R: usize, const C: usize>(y: &mut SVector<f64, R>, a: &SMatrix<f64, R, C>, x: &SVector<f64, C>) {
    for i in 0..R {
        for j in 0..C {
            y[i] += a[(i, j)] * x[j];
        }
    }
}

/// y += A x, lane by lane.
#[inline(always)]
fn add_lanes<const K: usize, const R: usize, const C: usize>(
    y: &mut [Lanes<K>; R],
    a: &Block<K, R, C>,
    x: &[Lanes<K>; C],
) {
    for i in 0..R {
        for j in 0..C {
            for k in 0..K {
                y[i][k] += a[i][j][k] * x[j][k];
            }
        }
    }
}

/// y += Aᵀ x, lane by lane.
#[inline(always)]
fn add_transposed_lanes<const K: usize, const R: usize, const C: usize>(
    y: &mut [Lanes<K>; C],
    a: &Block<K, R, C>,
    x: &[Lanes<K>; R],
) {
    for i in 0..C {
        for j in 0..R {
            for k in 0..K {
                y[i][k] += a[j][i][k] * x[j][k];
            }
        }
    }
}

/// A x, lane by lane.
#[inline(always)]
fn times<const K: usize, const R: usize, const C: usize>(a: &Block<K, R, C>, x: &[Lanes<K>; C]) -> [Lanes<K>; R] {
    from_fn(|i| from_fn(|k| (1..C).fold(a[i][0][k] * x[0][k], |sum, j| sum + a[i][j][k] * x[j][k])))
}

/// A B, lane by lane.
#[inline(always)]
fn product<const K: usize, const R: usize, const Q: usize, const C: usize>(
    a: &Block<K, R, Q>,
    b: &Block<K, Q, C>,
) -> Block<K, R, C> {
    from_fn(|i| from_fn(|j| from_fn(|k| (1..Q).fold(a[i][0][k] * b[0][j][k], |sum, q| sum + a[i][q][k] * b[q][j][k]))))
}

/// The blocks of the points of a cell side by side.
#[inline(always)]
fn gather<const K: usize, const R: usize, const C: usize, T>(
    points: &[T; K],
    of: impl Fn(&T) -> &SMatrix<f64, R, C>,
) -> Block<K, R, C> {
    from_fn(|i| from_fn(|j| from_fn(|k| of(&points[k])[(i, j)])))
}

/// The same of vectors.
#[inline(always)]
fn gather_vector<const K: usize, const R: usize, T>(
    points: &[T; K],
    of: impl Fn(&T) -> &SVector<f64, R>,
) -> [Lanes<K>; R] {
    from_fn(|i| from_fn(|k| of(&points[k])[i]))
}

/// The sum of `first` and the `terms` as far as `width`, each with its weight. Its own function so that the compiler
/// knows `row` to be none of them.
#[inline(always)]
fn combine<const L: usize>(
    row: &mut Row,
    width: usize,
    first: Option<(f64, &Row)>,
    weights: [f64; L],
    terms: [&Row; L],
) {
    for c in 0..width {
        let start = match first {
            Some((weight, term)) => weight * term[c] + weights[0] * terms[0][c],
            None => weights[0] * terms[0][c],
        };
        row[c] = (1..L).fold(start, |sum, l| sum + weights[l] * terms[l][c]);
    }
}

/// y += factor x.
#[inline(always)]
fn add_scaled(y: &mut [f64], factor: f64, x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += factor * x;
    }
}

/// The rule of the `K` Gauss points of a cell of length one, and its products. Of matrices the columns: what a point
/// gives to all.
struct Rule<const K: usize> {
    /// a.
    forward: [Lanes<K>; K],
    /// b_l − a_kl.
    backward: [Lanes<K>; K],
    /// a⁻¹.
    slopes: [Lanes<K>; K],
    /// b.
    b: Lanes<K>,
    /// Σ b_k a⁻¹_kl.
    end: Lanes<K>,
    /// Σ (b_l − a_kl) a_lm; by rows k, and last that of node 0.
    twice: [Lanes<K>; K],
    twice_0: Lanes<K>,
    /// Σ (b_l − a_kl).
    rest: Lanes<K>,
}

impl<const K: usize> Rule<K> {
    #[inline(always)]
    fn new(rule: &Gauss) -> Self {
        let Gauss { a, b, a_inverse, .. } = rule;
        let sum = |term: &dyn Fn(usize) -> f64| (0..K).map(term).sum();
        Self {
            forward: from_fn(|l| from_fn(|k| a[k][l])),
            backward: from_fn(|l| from_fn(|k| b[l] - a[k][l])),
            slopes: from_fn(|l| from_fn(|k| a_inverse[k][l])),
            b: from_fn(|l| b[l]),
            end: from_fn(|l| sum(&|k| b[k] * a_inverse[k][l])),
            twice: from_fn(|k| from_fn(|m| sum(&|l| (b[l] - a[k][l]) * a[l][m]))),
            twice_0: from_fn(|m| sum(&|l| b[l] * a[l][m])),
            rest: from_fn(|k| sum(&|l| b[l] - a[k][l])),
        }
    }
}

/// Σ columns_l x_l.
#[inline(always)]
fn spread<const K: usize>(columns: &[Lanes<K>; K], x: &Lanes<K>) -> Lanes<K> {
    from_fn(|k| (1..K).fold(columns[0][k] * x[0], |sum, l| sum + columns[l][k] * x[l]))
}

#[inline(always)]
fn total<const K: usize>(weights: &Lanes<K>, x: &Lanes<K>) -> f64 {
    (1..K).fold(weights[0] * x[0], |sum, l| sum + weights[l] * x[l])
}

/// Sizes of what belongs to a cell of `K` Gauss points, extensible or not.
struct Shape<const V: usize, const S: usize, const K: usize, const X: bool>;

impl<const V: usize, const S: usize, const K: usize, const X: bool> Shape<V, S, K, X> {
    /// Unknowns: component by component of Φ, then, if extensible, of w'; the Gauss points of each side by side.
    const UNKNOWNS: usize = K * if X { V + S } else { S };
    /// Columns of w₀, after those of the unknowns, and of φ₀.
    const W_0: usize = Self::UNKNOWNS;
    const PHI_0: usize = Self::UNKNOWNS + V;
    /// All columns.
    const WHOLE: usize = Self::UNKNOWNS + V + S;
    /// Entries of the points' blocks that a solution needs.
    const BLOCKS: usize = K * (2 * S * (S + V) + if S > 1 { 3 * S * S } else { 0 } + if X { V * V } else { 0 });
    /// Numbers of the factors: L and U, the gain, and what closes the cell.
    const FACTORS: usize = Self::UNKNOWNS * (Self::UNKNOWNS + 2 * (V + S));
}

/// Unknowns, and sizes of blocks and factors.
fn sizes<const V: usize, const S: usize>(stages: usize, extensible: bool) -> (usize, usize, usize) {
    fn of<const V: usize, const S: usize, const K: usize, const X: bool>() -> (usize, usize, usize) {
        (Shape::<V, S, K, X>::UNKNOWNS, Shape::<V, S, K, X>::BLOCKS, Shape::<V, S, K, X>::FACTORS)
    }
    match (stages, extensible) {
        (1, false) => of::<V, S, 1, false>(),
        (2, false) => of::<V, S, 2, false>(),
        (3, false) => of::<V, S, 3, false>(),
        (_, false) => of::<V, S, 4, false>(),
        (1, true) => of::<V, S, 1, true>(),
        (2, true) => of::<V, S, 2, true>(),
        (3, true) => of::<V, S, 3, true>(),
        (_, true) => of::<V, S, 4, true>(),
    }
}

/// Moves `block` into the front of `room`; returns what is left.
#[inline(always)]
fn store<'a, const K: usize, const R: usize, const C: usize>(
    room: &'a mut [f64],
    block: &Block<K, R, C>,
) -> &'a mut [f64] {
    let (front, left) = room.split_at_mut(R * C * K);
    front.copy_from_slice(block.as_flattened().as_flattened());
    left
}

/// The block at the front of `stored`, which becomes what is left.
#[inline(always)]
fn load<'a, const K: usize, const R: usize, const C: usize>(stored: &mut &'a [f64]) -> &'a Block<K, R, C> {
    let (front, left) = stored.split_at(R * C * K);
    *stored = left;
    &front.as_chunks::<K>().0.as_chunks::<C>().0.as_chunks::<R>().0[0]
}

/// The end of a rod that is held in part: what moves there follows from a small system of its own.
#[derive(Clone, Copy, Debug)]
struct End<const V: usize, const S: usize> {
    joint: Joint<V, S>,
    /// Of L and U.
    columns: [[f64; COORDINATES]; COORDINATES],
    order: [u8; COORDINATES],
}

impl<const V: usize, const S: usize> End<V, S> {
    /// `row` of every coordinate.
    fn new(joint: &Joint<V, S>, row: impl Fn(usize) -> [f64; COORDINATES]) -> Option<Self> {
        let (mut rows, mut order): ([_; COORDINATES], _) = (from_fn(row), [0; COORDINATES]);
        factor(&mut rows[..V + S], V + S, &mut order[..V + S])?;
        Some(Self { joint: *joint, columns: from_fn(|j| from_fn(|i| rows[i][j])), order })
    }

    /// x with rows · x + known = 0.
    fn solve(&self, known: impl Fn(usize) -> f64) -> [f64; COORDINATES] {
        let known: [f64; COORDINATES] = from_fn(|i| if i < V + S { -known(i) } else { 0.0 });
        let mut x = [0.0; COORDINATES];
        back_substitute(self.columns.as_flattened(), COORDINATES, &self.order[..V + S], &known, &mut x);
        x
    }
}

/// The larger rows of a cell in the making.
#[derive(Clone, Debug)]
struct Scratch<const S: usize> {
    /// m' at the points.
    m_s: [[Row; S]; MAX_STAGES],
    /// p' there, in space.
    p_s: [[Row; S]; MAX_STAGES],
    /// The equations of the unknowns.
    rows: [Row; UNKNOWNS],
}

/// Storage of the sweep, sized once; factors and solutions allocate nothing.
#[derive(Clone, Debug)]
pub struct Sweep<const V: usize = 3, const S: usize = 3> {
    rule: Gauss,
    extensible: bool,
    mass: f64,
    cells: Vec<CellEnds<S>>,
    /// The points' blocks that a solution needs, cell by cell.
    blocks: Vec<f64>,
    /// The factors of the cells.
    factors: Vec<f64>,
    /// The rows of the pivots, cell by cell.
    order: Vec<u8>,
    /// P at every node.
    relations: Vec<Relation<V, S>>,
    base: Option<End<V, S>>,
    tip: Option<End<V, S>>,
    /// q at every node.
    loads: Vec<Pair<V, S>>,
    /// The unknowns of every cell at w₀ = φ₀ = 0.
    constants: Vec<f64>,
    scratch: Box<Scratch<S>>,
    /// Increments of the nodes after [`Sweep::solve_for`].
    pub nodes: Vec<Increment<V, S>>,
    /// Increments of the Gauss points after [`Sweep::solve_for`].
    pub points: Vec<Increment<V, S>>,
    /// The largest of them.
    pub largest: Largest,
}

impl<const V: usize, const S: usize> Sweep<V, S> {
    /// Storage for `cells` cells of `rule`, with shear and stretch or without.
    pub fn new(cells: usize, rule: &Gauss, extensible: bool) -> Self {
        const { assert!(V + S <= COORDINATES) };
        let (unknowns, blocks, factors) = sizes::<V, S>(rule.stages, extensible);
        Self {
            rule: rule.clone(),
            extensible,
            mass: 0.0,
            cells: vec![CellEnds::default(); cells],
            blocks: vec![0.0; cells * blocks],
            factors: vec![0.0; cells * factors],
            order: vec![0; cells * unknowns],
            relations: vec![Relation::default(); cells + 1],
            base: None,
            tip: None,
            loads: vec![zero(); cells + 1],
            constants: vec![0.0; cells * unknowns],
            scratch: Box::new(Scratch {
                m_s: [[ROW; S]; MAX_STAGES],
                p_s: [[ROW; S]; MAX_STAGES],
                rows: [ROW; UNKNOWNS],
            }),
            nodes: vec![Increment::default(); cells + 1],
            points: vec![Increment::default(); cells * rule.stages],
            largest: Largest::default(),
        }
    }

    /// Makes it the storage for as many cells, to be factorised.
    pub fn resize(&mut self, cells: usize) {
        let (unknowns, blocks, factors) = sizes::<V, S>(self.rule.stages, self.extensible);
        self.cells.resize(cells, CellEnds::default());
        self.blocks.resize(cells * blocks, 0.0);
        self.factors.resize(cells * factors, 0.0);
        self.order.resize(cells * unknowns, 0);
        self.relations.resize(cells + 1, Relation::default());
        self.loads.resize(cells + 1, zero());
        self.constants.resize(cells * unknowns, 0.0);
        self.nodes.resize(cells + 1, Increment::default());
        self.points.resize(cells * self.rule.stages, Increment::default());
    }

    /// Solves `system`; the increments are in [`Sweep::nodes`] and [`Sweep::points`].
    ///
    /// # Errors
    /// [`Singular`] as for [`Sweep::factorise`].
    pub fn solve(&mut self, system: &System<V, S>) -> Result<(), Singular> {
        self.factorise(system)?;
        self.solve_for(&system.residuals);
        Ok(())
    }

    /// From the tip to the base all that the residuals have no part in. The increments are lost.
    ///
    /// # Errors
    /// [`Singular`] names the first cell, seen from the tip, that cannot be solved, or else the end.
    pub fn factorise(&mut self, system: &System<V, S>) -> Result<(), Singular> {
        self.mass = system.mass;
        self.cells.copy_from_slice(&system.cells);
        let mut tip = system.tip_load;
        if let Some(joint) = &system.tip_joint {
            for i in held(joint) {
                let (w, phi) = joint.motion(i);
                tip.n_w -= w * w.transpose() * joint.springs.0;
                tip.m_phi -= phi * phi.transpose() * joint.springs.1;
            }
        }
        self.relations[system.cells.len()] = tip;
        match (self.rule.stages, self.extensible) {
            (1, false) => self.factorise_cells::<1, false>(system)?,
            (2, false) => self.factorise_cells::<2, false>(system)?,
            (3, false) => self.factorise_cells::<3, false>(system)?,
            (_, false) => self.factorise_cells::<4, false>(system)?,
            (1, true) => self.factorise_cells::<1, true>(system)?,
            (2, true) => self.factorise_cells::<2, true>(system)?,
            (3, true) => self.factorise_cells::<3, true>(system)?,
            (_, true) => self.factorise_cells::<4, true>(system)?,
        }
        self.base = match &system.base_joint {
            None => None,
            Some(joint) => {
                let row = |i: usize| {
                    let row = if i >= V + S {
                        zero()
                    } else if joint.holds(i) {
                        joint.motion(i)
                    } else {
                        let force = joint.force(i);
                        let (carried, load) = (self.relations[0].row(&force), system.base_load.row(&force));
                        (carried.0 - load.0, carried.1 - load.1)
                    };
                    from_fn(|j| if j < V + S { component(&row, j) } else { 0.0 })
                };
                Some(End::new(joint, row).ok_or(Singular::Base)?)
            }
        };
        self.tip = match &system.tip_joint {
            None => None,
            Some(joint) => {
                // column by column what each μ moves
                let mut rows: [[f64; COORDINATES]; COORDINATES] = from_fn(|i| from_fn(|j| f64::from(i == j)));
                for j in held(joint) {
                    self.run(None, joint.motion(j));
                    let moved = self.tip_moved();
                    held(joint).for_each(|i| rows[i][j] = dot(&joint.motion(i), &moved));
                }
                Some(End::new(joint, |i| rows[i]).ok_or(Singular::Tip)?)
            }
        };
        Ok(())
    }

    /// Solves the system that was last factorised, without an error, for `residuals`; the increments are in
    /// [`Sweep::nodes`] and [`Sweep::points`].
    pub fn solve_for(&mut self, residuals: &Residuals<V, S>) {
        let Some(tip) = self.tip else { return self.run(Some(residuals), residuals.tip_load) };
        let (joint, t) = (&tip.joint, &residuals.tip);
        let loaded = |load: Pair<V, S>, force: &dyn Fn(usize) -> f64| {
            held(joint).fold(load, |(n, m), i| {
                let (w, phi) = joint.motion(i);
                (n + w * force(i), m + phi * force(i))
            })
        };
        let on_springs = loaded(residuals.tip_load, &|i| joint.spring(i) * component(t, i));
        self.run(Some(residuals), on_springs);
        let moved = self.tip_moved();
        let missing = |i: usize| dot(&joint.motion(i), &moved) - component(t, i);
        let mu = tip.solve(|i| if joint.holds(i) { missing(i) } else { 0.0 });
        self.run(Some(residuals), loaded(on_springs, &|i| mu[i]));
    }

    fn tip_moved(&self) -> Pair<V, S> {
        let Increment { w, phi, .. } = self.nodes[self.cells.len()];
        (w, phi)
    }

    /// From the tip to the base and back with q = `tip_load` at the tip; without residuals, with none.
    fn run(&mut self, residuals: Option<&Residuals<V, S>>, tip_load: Pair<V, S>) {
        self.loads[self.cells.len()] = tip_load;
        match (self.rule.stages, self.extensible) {
            (1, false) => self.run_cells::<1, false>(residuals),
            (2, false) => self.run_cells::<2, false>(residuals),
            (3, false) => self.run_cells::<3, false>(residuals),
            (_, false) => self.run_cells::<4, false>(residuals),
            (1, true) => self.run_cells::<1, true>(residuals),
            (2, true) => self.run_cells::<2, true>(residuals),
            (3, true) => self.run_cells::<3, true>(residuals),
            (_, true) => self.run_cells::<4, true>(residuals),
        }
    }

    /// P at every node and the factors of every cell, of `K` Gauss points, extensible or not.
    fn factorise_cells<const K: usize, const X: bool>(&mut self, system: &System<V, S>) -> Result<(), Singular> {
        let rule = Rule::<K>::new(&self.rule);
        // u is component by component of Φ, then of w'; the Gauss points of each side by side
        let (at_phi, at_w_s) = (|j: usize| j * K, |i: usize| (S + i) * K);
        let Scratch { m_s, p_s, rows } = &mut *self.scratch;
        let (mut n_1, mut m_1, mut p_1, mut n, mut m_0) = ([ROW; V], [ROW; S], [ROW; S], [ROW; V], [ROW; S]);
        let mut gain = [[0.0; COORDINATES]; UNKNOWNS];

        for cell in (0..system.cells.len()).rev() {
            let points = &system.points.as_chunks::<K>().0[cell];
            let CellEnds { length: h, spin: spin_1, p_log: p_1_log, p_phi: p_1_phi } = &system.cells[cell];
            let spin = gather(points, |point| &point.spin);
            let w_phi = gather(points, |point| &point.w_phi);
            let m_n = gather(points, |point| &point.m_n);
            let p_strain = gather(points, |point| &point.p_strain);
            let p_log = gather(points, |point| &point.p_log);
            let room = &mut self.blocks[cell * Shape::<V, S, K, X>::BLOCKS..][..Shape::<V, S, K, X>::BLOCKS];
            let mut room = store(store(store(store(room, &spin), &w_phi), &m_n), &p_strain);
            if S > 1 {
                room = store(store(room, &p_log), &gather(points, |point| &point.law_strain));
                room = store(room, &gather(points, |point| &point.law_log));
            }
            if X {
                store(room, &gather(points, |point| &point.w_n));
            }

            // by Φ: w', and h² μ w'; m' as far as φ has a part in it
            let w_log = product(&w_phi, &spin);
            let m_log = product(&gather(points, |point| &point.m_phi), &spin);
            let per_length = 1.0 / h;
            let inertia = h * h * system.mass;
            let weights: Lanes<K> = from_fn(|m| h * rule.b[m]);

            // (n, m) at node 1
            let tip = &self.relations[cell + 1];
            let driven: Block<K, V, S> = from_fn(|i| from_fn(|j| from_fn(|m| weights[m] * w_log[i][j][m])));
            let by_turn: [[f64; S]; V] = from_fn(|i| from_fn(|j| total(&weights, &w_phi[i][j])));
            let at_end = |row: &mut Row, by_w: [f64; V], by_phi: [f64; S]| {
                for j in 0..S {
                    let turned = (0..S).fold(0.0, |sum, q| sum + by_phi[q] * spin_1[(q, j)]);
                    let mut by_log: Lanes<K> = from_fn(|m| turned * rule.end[m]);
                    let mut by_node = by_phi[j];
                    if !X {
                        for q in 0..V {
                            by_node += by_w[q] * by_turn[q][j];
                            for m in 0..K {
                                by_log[m] += by_w[q] * driven[q][j][m];
                            }
                        }
                    }
                    row[at_phi(j)..][..K].copy_from_slice(&by_log);
                    row[Shape::<V, S, K, X>::PHI_0 + j] = by_node;
                }
                for i in 0..V {
                    row[Shape::<V, S, K, X>::W_0 + i] = by_w[i];
                    if X {
                        for m in 0..K {
                            row[at_w_s(i) + m] = by_w[i] * weights[m];
                        }
                    }
                }
            };
            for i in 0..V {
                at_end(&mut n_1[i], from_fn(|j| tip.n_w[(i, j)]), from_fn(|j| tip.n_phi[(i, j)]));
            }
            for i in 0..S {
                at_end(&mut m_1[i], from_fn(|j| tip.m_w[(i, j)]), from_fn(|j| tip.m_phi[(i, j)]));
            }
            if S > 1 {
                for i in 0..S {
                    let row = &mut p_1[i];
                    combine(row, Shape::<V, S, K, X>::WHOLE, None, from_fn(|q| spin_1[(q, i)]), m_1.each_ref());
                    for j in 0..S {
                        for m in 0..K {
                            row[at_phi(j) + m] += p_1_log[(i, j)] * rule.end[m];
                        }
                        row[Shape::<V, S, K, X>::PHI_0 + j] += p_1_phi[(i, j)];
                    }
                }
            }

            // and from there backwards
            let force = |n: &mut [Row; V], twice: &Lanes<K>, rest: f64| {
                let twice: Lanes<K> = from_fn(|m| inertia * twice[m]);
                for i in 0..V {
                    let (n, n_1) = (&mut n[i], &n_1[i]);
                    if X {
                        n[..Shape::<V, S, K, X>::WHOLE].copy_from_slice(&n_1[..Shape::<V, S, K, X>::WHOLE]);
                        for m in 0..K {
                            n[at_w_s(i) + m] -= twice[m];
                        }
                    } else {
                        n[Shape::<V, S, K, X>::W_0..Shape::<V, S, K, X>::PHI_0]
                            .copy_from_slice(&n_1[Shape::<V, S, K, X>::W_0..Shape::<V, S, K, X>::PHI_0]);
                        for j in 0..S {
                            for m in 0..K {
                                n[at_phi(j) + m] = n_1[at_phi(j) + m] - twice[m] * w_log[i][j][m];
                            }
                            n[Shape::<V, S, K, X>::PHI_0 + j] =
                                n_1[Shape::<V, S, K, X>::PHI_0 + j] - total(&twice, &w_phi[i][j]);
                        }
                    }
                    n[Shape::<V, S, K, X>::W_0 + i] -= h * system.mass * rest;
                }
            };
            for k in 0..K {
                force(&mut n, &rule.twice[k], rule.rest[k]);
                for i in 0..S {
                    let m_s = &mut m_s[k][i];
                    combine(m_s, Shape::<V, S, K, X>::WHOLE, None, from_fn(|q| m_n[i][q][k]), n.each_ref());
                    for j in 0..S {
                        m_s[at_phi(j) + k] += m_log[i][j][k];
                        m_s[Shape::<V, S, K, X>::PHI_0 + j] += points[k].m_phi[(i, j)];
                    }
                }
                if S > 1 {
                    for i in 0..S {
                        let row = &mut p_s[k][i];
                        let weights = from_fn(|q| spin[q][i][k]);
                        combine(row, Shape::<V, S, K, X>::WHOLE, None, weights, m_s[k].each_ref());
                        for j in 0..S {
                            let strain = p_log[j][i][k] * per_length;
                            for m in 0..K {
                                row[at_phi(j) + m] += strain * rule.slopes[m][k];
                            }
                            row[at_phi(j) + k] += points[k].slope_log[(i, j)];
                            row[Shape::<V, S, K, X>::PHI_0 + j] += points[k].slope_phi[(i, j)];
                        }
                    }
                }
                if X {
                    // w' is an unknown of its own
                    for i in 0..V {
                        let row = &mut rows[at_w_s(i) + k];
                        let weights = from_fn(|q| -points[k].w_n[(i, q)]);
                        combine(row, Shape::<V, S, K, X>::WHOLE, None, weights, n.each_ref());
                        row[at_w_s(i) + k] += 1.0;
                        for j in 0..S {
                            row[at_phi(j) + k] -= w_log[i][j][k];
                            row[Shape::<V, S, K, X>::PHI_0 + j] -= w_phi[i][j][k];
                        }
                    }
                }
            }
            // p, by its balance and by the strains
            let (p_1, p_s) = if S > 1 { (&p_1, &*p_s) } else { (&m_1, &*m_s) };
            for i in 0..S {
                for k in 0..K {
                    let row = &mut rows[at_phi(i) + k];
                    let weights: Lanes<K> = from_fn(|l| h * rule.backward[l][k]);
                    let p_1 = Some((-1.0, &p_1[i]));
                    combine(row, Shape::<V, S, K, X>::WHOLE, p_1, weights, from_fn(|l| &p_s[l][i]));
                    for j in 0..S {
                        let strain = p_strain[i][j][k] * per_length;
                        for m in 0..K {
                            row[at_phi(j) + m] += strain * rule.slopes[m][k];
                        }
                        if S > 1 {
                            row[at_phi(j) + k] += p_log[i][j][k];
                        }
                    }
                }
            }
            let order = &mut self.order[cell * Shape::<V, S, K, X>::UNKNOWNS..][..Shape::<V, S, K, X>::UNKNOWNS];
            factor(&mut rows[..Shape::<V, S, K, X>::UNKNOWNS], Shape::<V, S, K, X>::WHOLE, order)
                .ok_or(Singular::Cell(cell))?;

            // u by w₀ and φ₀
            for i in (0..Shape::<V, S, K, X>::UNKNOWNS).rev() {
                let row = &rows[i];
                let mut known: [f64; COORDINATES] =
                    from_fn(|c| if c < V + S { row[Shape::<V, S, K, X>::UNKNOWNS + c] } else { 0.0 });
                for j in i + 1..Shape::<V, S, K, X>::UNKNOWNS {
                    for c in 0..V + S {
                        known[c] += row[j] * gain[j][c];
                    }
                }
                for c in 0..V + S {
                    gain[i][c] = -known[c] * row[i];
                }
            }

            // close the cell
            let n_0 = &mut n;
            force(n_0, &rule.twice_0, 1.0);
            for i in 0..S {
                let m_1 = Some((1.0, &m_1[i]));
                combine(&mut m_0[i], Shape::<V, S, K, X>::WHOLE, m_1, weights.map(|w| -w), from_fn(|l| &m_s[l][i]));
            }
            let closed = |f: &Row| {
                let mut closed: [f64; COORDINATES] =
                    from_fn(|c| if c < V + S { f[Shape::<V, S, K, X>::UNKNOWNS + c] } else { 0.0 });
                for j in 0..Shape::<V, S, K, X>::UNKNOWNS {
                    for c in 0..V + S {
                        closed[c] += f[j] * gain[j][c];
                    }
                }
                closed
            };
            let by_n: [_; V] = from_fn(|i| closed(&n_0[i]));
            let by_m: [_; S] = from_fn(|i| closed(&m_0[i]));
            self.relations[cell] = Relation {
                n_w: SMatrix::from_fn(|i, j| by_n[i][j]),
                n_phi: SMatrix::from_fn(|i, j| by_n[i][V + j]),
                m_w: SMatrix::from_fn(|i, j| by_m[i][j]),
                m_phi: SMatrix::from_fn(|i, j| by_m[i][V + j]),
            };

            let factors = &mut self.factors[cell * Shape::<V, S, K, X>::FACTORS..][..Shape::<V, S, K, X>::FACTORS];
            let (inverse, rest) = factors.split_at_mut(Shape::<V, S, K, X>::UNKNOWNS * Shape::<V, S, K, X>::UNKNOWNS);
            let (gains, closing) = rest.split_at_mut(Shape::<V, S, K, X>::UNKNOWNS * (V + S));
            for (j, column) in inverse.chunks_exact_mut(Shape::<V, S, K, X>::UNKNOWNS).enumerate() {
                for i in 0..Shape::<V, S, K, X>::UNKNOWNS {
                    column[i] = rows[i][j];
                }
            }
            for (c, column) in gains.chunks_exact_mut(Shape::<V, S, K, X>::UNKNOWNS).enumerate() {
                for i in 0..Shape::<V, S, K, X>::UNKNOWNS {
                    column[i] = gain[i][c];
                }
            }
            for (j, column) in closing.chunks_exact_mut(V + S).enumerate() {
                for i in 0..V {
                    column[i] = n_0[i][j];
                }
                for i in 0..S {
                    column[V + i] = m_0[i][j];
                }
            }
        }
        Ok(())
    }

    /// q at every node, w and φ of the base, and the increments.
    fn run_cells<const K: usize, const X: bool>(&mut self, residuals: Option<&Residuals<V, S>>) {
        let rule = Rule::<K>::new(&self.rule);
        let (mut known, mut u) = ([0.0; UNKNOWNS], [0.0; UNKNOWNS]);
        let none = ([PointResiduals::default(); K], EndResiduals::default());
        let of_cell = |cell: usize| match residuals {
            Some(residuals) => (&residuals.points.as_chunks::<K>().0[cell], &residuals.cells[cell]),
            None => (&none.0, &none.1),
        };

        for (cell, CellEnds { length: h, spin: spin_1, p_log: p_1_log, .. }) in self.cells.iter().enumerate().rev() {
            let (e, e_ends) = of_cell(cell);
            let stored = &mut &self.blocks[cell * Shape::<V, S, K, X>::BLOCKS..][..Shape::<V, S, K, X>::BLOCKS];
            let (spin, _w_phi): (&Block<K, S, S>, &Block<K, V, S>) = (load(stored), load(stored));
            let m_n: &Block<K, S, V> = load(stored);
            let p_strain: &Block<K, S, S> = load(stored);

            // all at w₀ = φ₀ = 0 and, so far, u = 0
            let e_log = gather_vector(e, |e| &e.log);
            let e_w = gather_vector(e, |e| &e.w);
            let e_n = gather_vector(e, |e| &e.n);
            let (log_1, mut phi_1) =
                (SVector::from_fn(|i, _| total(&rule.end, &e_log[i]) - e_ends.log[i]), SVector::zeros());
            add_product(&mut phi_1, spin_1, &log_1);
            let (n_1, m_1) = self.relations[cell + 1].at(&self.loads[cell + 1], &-e_ends.w, &phi_1);
            let heavy: [Lanes<K>; V] = e_w.map(|lanes| lanes.map(|e| e * (h * self.mass)));
            let n: [Lanes<K>; V] = from_fn(|i| {
                let sum = spread(&rule.backward, &heavy[i]);
                from_fn(|k| n_1[i] + sum[k] - e_n[i][k])
            });
            let m_s = times(m_n, &n).map(|lanes| lanes.map(|m| m * h));
            let per_length = 1.0 / h;
            let strain = e_log.map(|e| spread(&rule.slopes, &e).map(|g| g * per_length));
            let (mut p_1, mut p_s) = (m_1, m_s);
            if S > 1 {
                let p_log: &Block<K, S, S> = load(stored);
                let _law: [&Block<K, S, S>; 2] = from_fn(|_| load(stored));
                (p_1, p_s) = (spin_1.tr_mul(&m_1), [[0.0; K]; S]);
                add_product(&mut p_1, p_1_log, &log_1);
                add_transposed_lanes(&mut p_s, p_log, &strain.map(|lanes| lanes.map(|g| g * h)));
                add_transposed_lanes(&mut p_s, spin, &m_s);
            }
            let mut p: [Lanes<K>; S] = from_fn(|i| {
                let sum = spread(&rule.backward, &p_s[i]);
                from_fn(|k| sum[k] - p_1[i] + e[k].p[i])
            });
            add_lanes(&mut p, p_strain, &strain);
            for i in 0..S {
                for k in 0..K {
                    known[i * K + k] = -p[i][k];
                }
            }
            if X {
                let w_n: &Block<K, V, V> = load(stored);
                let w_s = times(w_n, &n);
                for i in 0..V {
                    for k in 0..K {
                        known[(S + i) * K + k] = w_s[i][k];
                    }
                }
            }

            let factors = &self.factors[cell * Shape::<V, S, K, X>::FACTORS..][..Shape::<V, S, K, X>::FACTORS];
            let closing = &factors[Shape::<V, S, K, X>::UNKNOWNS * (Shape::<V, S, K, X>::UNKNOWNS + V + S)..];
            let u = &mut self.constants[cell * Shape::<V, S, K, X>::UNKNOWNS..][..Shape::<V, S, K, X>::UNKNOWNS];
            back_substitute(
                factors,
                Shape::<V, S, K, X>::UNKNOWNS,
                &self.order[cell * Shape::<V, S, K, X>::UNKNOWNS..][..Shape::<V, S, K, X>::UNKNOWNS],
                &known,
                u,
            );
            let mut q = [0.0; COORDINATES];
            for i in 0..V {
                q[i] = n_1[i] + total(&rule.b, &heavy[i]) - e_ends.n[i];
            }
            for i in 0..S {
                q[V + i] = m_1[i] - total(&rule.b, &m_s[i]) - e_ends.m[i];
            }
            for (column, u) in closing.chunks_exact(V + S).zip(u) {
                add_scaled(&mut q[..V + S], *u, column);
            }
            self.loads[cell] = (SVector::from_fn(|i, _| q[i]), SVector::from_fn(|i, _| q[V + i]));
        }

        let (w, phi) = match &self.base {
            None => residuals.map_or(zero(), |residuals| residuals.base),
            Some(base) => {
                let (t, load) = residuals.map_or((zero(), zero()), |residuals| (residuals.base, residuals.base_load));
                let q = (self.loads[0].0 - load.0, self.loads[0].1 - load.1);
                let joint = &base.joint;
                let x = base.solve(|i| if joint.holds(i) { -component(&t, i) } else { dot(&joint.force(i), &q) });
                (SVector::from_fn(|i, _| x[i]), SVector::from_fn(|i, _| x[V + i]))
            }
        };
        let (n, m) = self.relations[0].at(&self.loads[0], &w, &phi);
        self.nodes[0] = Increment { w, phi, n, m };
        let mut largest = Largest::default().with(&self.nodes[0]);

        for (cell, CellEnds { length: h, spin: spin_1, .. }) in self.cells.iter().enumerate() {
            let (e, e_ends) = of_cell(cell);
            let stored = &mut &self.blocks[cell * Shape::<V, S, K, X>::BLOCKS..][..Shape::<V, S, K, X>::BLOCKS];
            let (spin, w_phi): (&Block<K, S, S>, &Block<K, V, S>) = (load(stored), load(stored));
            let _m_n: &Block<K, S, V> = load(stored);
            let p_strain: &Block<K, S, S> = load(stored);
            let Increment { w: w_0, phi: phi_0, .. } = self.nodes[cell];

            u[..Shape::<V, S, K, X>::UNKNOWNS].copy_from_slice(
                &self.constants[cell * Shape::<V, S, K, X>::UNKNOWNS..][..Shape::<V, S, K, X>::UNKNOWNS],
            );
            let gains = &self.factors
                [cell * Shape::<V, S, K, X>::FACTORS + Shape::<V, S, K, X>::UNKNOWNS * Shape::<V, S, K, X>::UNKNOWNS..]
                [..Shape::<V, S, K, X>::UNKNOWNS * (V + S)];
            for (c, column) in gains.chunks_exact(Shape::<V, S, K, X>::UNKNOWNS).enumerate() {
                add_scaled(&mut u[..Shape::<V, S, K, X>::UNKNOWNS], if c < V { w_0[c] } else { phi_0[c - V] }, column);
            }
            let log: [Lanes<K>; S] = from_fn(|i| from_fn(|k| u[i * K + k]));
            let e_log = gather_vector(e, |e| &e.log);
            let grown: [Lanes<K>; S] = from_fn(|i| from_fn(|k| log[i][k] + e_log[i][k]));
            let per_length = 1.0 / h;
            let strain = grown.map(|grown| spread(&rule.slopes, &grown).map(|g| g * per_length));
            let mut phi: [Lanes<K>; S] = from_fn(|i| [phi_0[i]; K]);
            add_lanes(&mut phi, spin, &log);
            // by its law: from the balance it would be a difference of larger moments where a cell is soft and heavy
            let m = if S > 1 {
                let _p_log: &Block<K, S, S> = load(stored);
                let [law_strain, law_log]: [&Block<K, S, S>; 2] = from_fn(|_| load(stored));
                let mut m = times(law_strain, &strain);
                add_lanes(&mut m, law_log, &log);
                m
            } else {
                times(p_strain, &strain)
            };

            let w_s = if X { from_fn(|i| from_fn(|k| u[(S + i) * K + k])) } else { times(w_phi, &phi) };
            let w_s = w_s.map(|lanes| lanes.map(|w| w * h));
            let w: [Lanes<K>; V] = from_fn(|i| {
                let sum = spread(&rule.forward, &w_s[i]);
                from_fn(|k| w_0[i] + sum[k] - e[k].w[i])
            });
            let w_1 = SVector::from_fn(|i, _| w_0[i] + total(&rule.b, &w_s[i]) - e_ends.w[i]);
            let mut phi_1 = phi_0;
            add_product(&mut phi_1, spin_1, &SVector::from_fn(|i, _| total(&rule.end, &grown[i]) - e_ends.log[i]));
            let (n_1, m_1) = self.relations[cell + 1].at(&self.loads[cell + 1], &w_1, &phi_1);
            let n: [Lanes<K>; V] = from_fn(|i| {
                let sum = spread(&rule.backward, &w[i].map(|w| w * (h * self.mass)));
                from_fn(|k| n_1[i] - sum[k] - e[k].n[i])
            });
            for (k, point) in self.points[cell * K..][..K].iter_mut().enumerate() {
                *point = Increment {
                    w: SVector::from_fn(|i, _| w[i][k]),
                    phi: SVector::from_fn(|i, _| phi[i][k]),
                    n: SVector::from_fn(|i, _| n[i][k]),
                    m: SVector::from_fn(|i, _| m[i][k]),
                };
                largest = largest.with(point);
            }
            let node = Increment { w: w_1, phi: phi_1, n: n_1, m: m_1 };
            largest = largest.with(&node);
            self.nodes[cell + 1] = node;
        }
        self.largest = largest;
    }
}

/// The held coordinates.
fn held<const V: usize, const S: usize>(joint: &Joint<V, S>) -> impl Iterator<Item = usize> {
    (0..V + S).filter(|i| joint.holds(*i))
}

/// Gaussian elimination with scaled partial pivoting of rows of `width` coefficients, the first of them square: leaves L
/// below the diagonal, the inverse of U's diagonal on it, the rest of U and of the rows behind. `order` tells which row
/// each pivot came from. `None` where a pivot vanishes or is not finite.
#[inline(always)]
fn factor<const N: usize>(rows: &mut [[f64; N]], width: usize, order: &mut [u8]) -> Option<()> {
    let size = rows.len();
    let mut scales = [0.0; UNKNOWNS];
    for (i, row) in rows.iter().enumerate() {
        let larger = |most: f64, x: f64| if x.abs() > most { x.abs() } else { most };
        let (pairs, last) = row[..size].as_chunks::<2>();
        let [even, odd] = pairs.iter().fold([0.0; 2], |[even, odd], [x, y]| [larger(even, *x), larger(odd, *y)]);
        let largest = last.iter().fold(larger(even, odd), |most, x| larger(most, *x));
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        scales[i] = 1.0 / largest;
        order[i] = i as u8;
    }
    let mut pivot_row = [0.0; N];
    for pivot in 0..size {
        let (mut best, mut largest) = (pivot, rows[pivot][pivot].abs() * scales[pivot]);
        for i in pivot + 1..size {
            let magnitude = rows[i][pivot].abs() * scales[i];
            (best, largest) = if magnitude > largest { (i, magnitude) } else { (best, largest) };
        }
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        if best > pivot {
            let (upper, lower) = rows.split_at_mut(best);
            upper[pivot][..width].swap_with_slice(&mut lower[0][..width]);
            scales.swap(pivot, best);
            order.swap(pivot, best);
        }
        let (upper, lower) = rows.split_at_mut(pivot + 1);
        // all columns, those left of the pivot by zero: loops of one length are faster than shorter ones
        pivot_row[..width].copy_from_slice(&upper[pivot][..width]);
        let inverse = 1.0 / pivot_row[pivot];
        pivot_row[..=pivot].fill(0.0);
        for row in lower {
            let factor = row[pivot] * inverse;
            for c in 0..width {
                row[c] -= factor * pivot_row[c];
            }
            row[pivot] = factor;
        }
        upper[pivot][pivot] = inverse;
    }
    Some(())
}

/// x of L U x = `known`, from the columns of L U, `stride` apart.
#[inline(always)]
fn back_substitute(columns: &[f64], stride: usize, order: &[u8], known: &[f64], x: &mut [f64]) {
    let size = order.len();
    let x = &mut x[..size];
    for i in 0..size {
        x[i] = known[usize::from(order[i])];
    }
    for j in 0..size {
        let column = &columns[j * stride..][..size];
        let solved = x[j];
        for i in j + 1..size {
            x[i] -= column[i] * solved;
        }
    }
    for j in (0..size).rev() {
        let column = &columns[j * stride..][..size];
        let solved = x[j] * column[j];
        for i in 0..j {
            x[i] -= column[i] * solved;
        }
        x[j] = solved;
    }
}
