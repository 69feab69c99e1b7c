//! The cells along the rod and the Gauss rule within a cell.
//!
//! An s-stage Gauss rule collocates Y' at the points c_k: Y_k = Y₀ + h Σ a_kl Y'_l, Y₁ = Y₀ + h Σ b_l Y'_l, of order
//! 2s. s = 1 is the midpoint box.

use nalgebra::{Matrix4, Vector3};

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
        rule.a_inverse = std::array::from_fn(|k| std::array::from_fn(|l| inverse[(k, l)]));
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
}

/// One cell: its length and the curvature of the unstressed rod in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// h, m.
    pub length: f64,
    /// κ̂, body frame, 1/m.
    pub kappa_rest: Vector3<f64>,
}

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
}
