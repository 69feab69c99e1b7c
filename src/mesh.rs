//! The cells along the rod and the Gauss rule within a cell.
//!
//! An s-stage Gauss rule collocates Y' at the points c_k: Y_k = Y₀ + h Σ a_kl Y'_l, Y₁ = Y₀ + h Σ b_l Y'_l, of order
//! 2s. s = 1 is the midpoint box.

use crate::archive::archived;
use nalgebra::{Matrix4, Vector3};
use std::array::from_fn;

/// Most Gauss points in a cell.
pub const MAX_STAGES: usize = 4;

/// The nodes, weights and collocation matrix of the s-stage Gauss rule on [0, 1]; entries beyond s are zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Gauss {
    /// s.
    pub stages: usize,
    /// c_k.
    pub c: [f64; MAX_STAGES],
    /// b_l.
    pub b: [f64; MAX_STAGES],
    /// a_kl.
    pub a: [[f64; MAX_STAGES]; MAX_STAGES],
    /// The inverse of a: from values relative to the cell's start back to slopes.
    pub a_inverse: [[f64; MAX_STAGES]; MAX_STAGES],
}

impl Gauss {
    /// The rule with 1 to [`MAX_STAGES`] points; other counts are clamped.
    pub fn new(stages: usize) -> Self {
        let stages = stages.clamp(1, MAX_STAGES);
        // roots of the Legendre polynomials on [−1, 1]
        let (inner, outer) = (2.0 / 7.0 * 1.2f64.sqrt(), 3.0 / 7.0);
        let roots: [f64; MAX_STAGES] = match stages {
            1 => [0.0; 4],
            2 => [-(1.0f64 / 3.0).sqrt(), (1.0f64 / 3.0).sqrt(), 0.0, 0.0],
            3 => [-0.6f64.sqrt(), 0.0, 0.6f64.sqrt(), 0.0],
            _ => {
                let (near, far) = ((outer - inner).sqrt(), (outer + inner).sqrt());
                [-far, -near, near, far]
            }
        };
        let mut rule = Self { stages, c: [0.0; 4], b: [0.0; 4], a: [[0.0; 4]; 4], a_inverse: [[0.0; 4]; 4] };
        for k in 0..stages {
            rule.c[k] = 0.5 * (1.0 + roots[k]);
        }
        rule.b = rule.weights(1.0);
        for k in 0..stages {
            rule.a[k] = rule.weights(rule.c[k]);
        }
        // identity beyond s, so that one 4 × 4 inverse serves all; Gauss matrices are regular
        let entry = |i: usize, j: usize| if i < stages && j < stages { rule.a[i][j] } else { f64::from(i == j) };
        let inverse = Matrix4::from_fn(entry).try_inverse().unwrap_or_default();
        rule.a_inverse = from_fn(|k| from_fn(|l| inverse[(k, l)]));
        rule
    }

    /// ∫₀^θ ℓ_l, so that Y(θ) = Y₀ + h Σ weights_l Y'_l on the collocation polynomial.
    pub fn weights(&self, theta: f64) -> [f64; MAX_STAGES] {
        let mut weights = [0.0; MAX_STAGES];
        for l in 0..self.stages {
            // coefficients of ℓ_l in ascending powers, multiplied up factor by factor
            let mut polynomial = [0.0; MAX_STAGES + 1];
            polynomial[0] = 1.0;
            for j in (0..self.stages).filter(|&j| j != l) {
                let scale = 1.0 / (self.c[l] - self.c[j]);
                for power in (0..MAX_STAGES).rev() {
                    let lower = if power == 0 { 0.0 } else { polynomial[power - 1] };
                    polynomial[power] = scale * (lower - self.c[j] * polynomial[power]);
                }
            }
            weights[l] =
                (0..self.stages).rev().fold(0.0, |sum, power| (sum + polynomial[power] / (power + 1) as f64) * theta);
        }
        weights
    }

    /// Weights of the values at the points in that at `theta` of the polynomial through them.
    pub fn through(&self, theta: f64) -> [f64; MAX_STAGES] {
        let others = |k: usize| (0..self.stages).filter(move |&j| j != k);
        from_fn(|k| match k < self.stages {
            true => others(k).map(|j| (theta - self.c[j]) / (self.c[k] - self.c[j])).product(),
            false => 0.0,
        })
    }

    /// What a polynomial that vanishes at the points and is 1 at 0 is at `theta`.
    pub fn beside(&self, theta: f64) -> f64 {
        self.c[..self.stages].iter().map(|c| 1.0 - theta / c).product()
    }
}

/// What values at the points of a cell say of the polynomial through them, and of a cell twice as long.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Weights of its value at 0.
    pub start: [f64; MAX_STAGES],
    /// Weights of its Legendre coefficients.
    pub legendre: [[f64; MAX_STAGES]; MAX_STAGES],
    /// Weights of the points of either half in those of a whole cell, by half, point of the cell, point of the half: the
    /// mean square best approximation. It keeps the integral, and s − 1 moments more.
    pub joined: [[[f64; MAX_STAGES]; MAX_STAGES]; 2],
    /// The error of the rule for a function of length 1, over its derivative of order 2s.
    pub remainder: f64,
}

impl Series {
    /// For cells of a rule.
    pub fn new(rule: &Gauss) -> Self {
        let s = rule.stages;
        let within = |i: usize, j: usize, value: f64| if i.max(j) < s { value } else { 0.0 };
        let coefficient = |n: usize, at: f64| (2 * n + 1) as f64 * legendre(n, at);
        let joined = |half: usize, k: usize, l: usize| {
            let (at, from) = (2.0 * rule.c[k] - 1.0, rule.c[l] + half as f64 - 1.0);
            (0..s).map(|n| 0.5 * coefficient(n, from) * legendre(n, at)).sum::<f64>() * rule.b[l]
        };
        // (s!)⁴ / ((2s + 1) ((2s)!)³)
        let product = |to: usize, power: i32| (1..=to).map(|k| (k as f64).powi(power)).product::<f64>();
        Self {
            start: rule.through(0.0),
            legendre: from_fn(|n| from_fn(|k| within(n, k, coefficient(n, 2.0 * rule.c[k] - 1.0) * rule.b[k]))),
            joined: from_fn(|half| from_fn(|k| from_fn(|l| within(k, l, joined(half, k, l))))),
            remainder: product(s, 4) / ((2 * s + 1) as f64 * product(2 * s, 3)),
        }
    }

    /// The squares of the Legendre coefficients of degrees 0 and 1, and of degrees 2 and 3, summed up by pairs.
    pub fn coefficients(&self, values: &[f64; MAX_STAGES]) -> [f64; 2] {
        let square = |n: usize| (0..MAX_STAGES).map(|k| self.legendre[n][k] * values[k]).sum::<f64>().powi(2);
        [square(0) + square(1), square(2) + square(3)]
    }
}

/// P_n on [−1, 1].
fn legendre(n: usize, x: f64) -> f64 {
    let (mut before, mut last) = (0.0, 1.0);
    for k in 0..n {
        (before, last) = (last, ((2 * k + 1) as f64 * x * last - k as f64 * before) / (k + 1) as f64);
    }
    last
}

/// What the curvatures of new cells are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Curvatures {
    /// Those with which the accelerations stay what they were.
    Settled,
    /// Those that the moments at the first nodes ask for.
    Balanced,
    /// What they were.
    Kept,
}

/// Where a cell of a new mesh lies in the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// It is the cell with this index.
    Same(usize),
    /// The half of a cell next to the base.
    First(usize),
    /// The other half.
    Second(usize),
    /// This cell and the next, of equal length and rest curvature.
    Pair(usize),
}

impl Origin {
    /// The cell of the mesh before, and the fraction of it, at the fraction `theta` of this one.
    pub fn at(self, theta: f64) -> (usize, f64) {
        match self {
            Self::Same(cell) => (cell, theta),
            Self::First(cell) => (cell, 0.5 * theta),
            Self::Second(cell) => (cell, 0.5 + 0.5 * theta),
            Self::Pair(cell) if theta <= 0.5 => (cell, 2.0 * theta),
            Self::Pair(cell) => (cell + 1, 2.0 * theta - 1.0),
        }
    }

    /// The cell itself, from those of the mesh before.
    pub fn cell(self, before: &[Cell]) -> Cell {
        let of = |cell: usize, part: f64| Cell { length: before[cell].length * part, ..before[cell] };
        match self {
            Self::Same(cell) => of(cell, 1.0),
            Self::First(cell) | Self::Second(cell) => of(cell, 0.5),
            Self::Pair(cell) => of(cell, 2.0),
        }
    }
}

/// One cell: its length and the curvature of the unstressed rod in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// h, m.
    pub length: f64,
    /// κ̂, body frame, 1/m.
    pub kappa_rest: Vector3<f64>,
}

archived!(Cell { length, kappa_rest });

/// The cells from the base to the tip, with one rule for all.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// The cells in order of arc length.
    pub cells: Vec<Cell>,
    /// The Gauss rule.
    pub rule: Gauss,
}

impl Mesh {
    /// `cells` equal cells of a rod of constant rest curvature.
    pub fn uniform(length: f64, cells: usize, stages: usize, kappa_rest: Vector3<f64>) -> Self {
        let cell = Cell { length: length / cells as f64, kappa_rest };
        Self { cells: vec![cell; cells], rule: Gauss::new(stages) }
    }

    /// Cells between the arc lengths `nodes` (ascending), with the rest curvature at the middle of each.
    pub fn graded(nodes: &[f64], stages: usize, kappa_rest: impl Fn(f64) -> Vector3<f64>) -> Self {
        let cell = |pair: &[f64]| Cell { length: pair[1] - pair[0], kappa_rest: kappa_rest(0.5 * (pair[0] + pair[1])) };
        Self { cells: nodes.windows(2).map(cell).collect(), rule: Gauss::new(stages) }
    }

    /// Makes the first of several equal cells no longer than `most`, m, and the others longer for it.
    pub fn shorten_first(&mut self, most: f64) {
        let length = self.length();
        let [first, others @ ..] = &mut self.cells[..] else { return };
        if others.is_empty() || first.length <= most {
            return;
        }
        first.length = most;
        let other = (length - most) / others.len() as f64;
        others.iter_mut().for_each(|cell| cell.length = other);
    }

    /// Arc length of the rod, m.
    pub fn length(&self) -> f64 {
        self.cells.iter().map(|cell| cell.length).sum()
    }

    /// Number of Gauss points of all cells.
    pub fn points(&self) -> usize {
        self.cells.len() * self.rule.stages
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_integrates_and_collocates_to_its_degree() {
        for s in 1..=MAX_STAGES {
            let rule = Gauss::new(s);
            for degree in 0..2 * s {
                let sum: f64 = (0..s).map(|l| rule.b[l] * rule.c[l].powi(degree as i32)).sum();
                assert!((sum - 1.0 / (degree + 1) as f64).abs() < 1e-15, "{s} stages, degree {degree}");
            }
            for degree in 0..s {
                for k in 0..s {
                    let sum: f64 = (0..s).map(|l| rule.a[k][l] * rule.c[l].powi(degree as i32)).sum();
                    assert!((sum - rule.c[k].powi(degree as i32 + 1) / (degree + 1) as f64).abs() < 1e-15);
                }
            }
        }
    }

    #[test]
    fn a_first_cell_is_shortened_and_the_rod_is_not() {
        let mut mesh = Mesh::uniform(2.0, 3, 4, Vector3::zeros());
        mesh.shorten_first(1.0);
        assert_eq!(mesh, Mesh::uniform(2.0, 3, 4, Vector3::zeros()));
        mesh.shorten_first(0.5);
        assert_eq!(mesh.cells.iter().map(|cell| cell.length).collect::<Vec<_>>(), [0.5, 0.75, 0.75]);
        let mut whole = Mesh::uniform(2.0, 1, 4, Vector3::zeros());
        whole.shorten_first(0.5);
        assert_eq!(whole.length(), 2.0);
    }

    #[test]
    fn values_at_the_points_continue_and_join_exactly() {
        for s in 1..=MAX_STAGES {
            let rule = Gauss::new(s);
            let series = Series::new(&rule);
            let sum = |weights: &[f64; MAX_STAGES], value: &dyn Fn(f64) -> f64| {
                (0..s).map(|k| weights[k] * value(rule.c[k])).sum::<f64>()
            };
            for degree in 0..s as i32 {
                let power = |x: f64| x.powi(degree);
                assert!((sum(&rule.through(0.3), &power) - power(0.3)).abs() < 1e-14);
                for k in 0..s {
                    // of the halves, as of functions of their own place
                    let halves =
                        [0.0, 1.0].map(|half| sum(&series.joined[half as usize][k], &|c| power(0.5 * (c + half))));
                    assert!((halves[0] + halves[1] - power(rule.c[k])).abs() < 1e-14, "{s} stages, degree {degree}");
                }
            }
            for n in 0..s {
                let coefficient = |m: usize| sum(&series.legendre[m], &|c| legendre(n, 2.0 * c - 1.0));
                assert!((0..s).all(|m| (coefficient(m) - f64::from(m == n)).abs() < 1e-14));
            }
            // x^2s, whose derivative is (2s)!
            let degree = 2 * s as i32;
            let missed = 1.0 / f64::from(degree + 1) - sum(&rule.b, &|c| c.powi(degree));
            let factorial: f64 = (1..=degree).map(f64::from).product();
            assert!((missed / (series.remainder * factorial) - 1.0).abs() < 1e-9, "{s} stages: {missed:e}");
            assert!((rule.beside(0.0) - 1.0).abs() < 1e-15 && rule.beside(rule.c[0]).abs() < 1e-15);
        }
    }
}
