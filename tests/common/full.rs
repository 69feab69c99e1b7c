//! The linear system of `sweep::System` written out: every unknown and every equation, in blocks of 3 × 3.
//!
//! Blocks of unknowns, along the rod: φ, w, n, m of a node, then φ, w, n, m, g of every Gauss point of the cell behind
//! it. Blocks of equations: the two of the base, then cell by cell those for n₀, m₀, for Φ, w, n, m and the law at
//! every point, for Φ₁, w₁, and at the end the two of the tip. Φ is expressed by the rotations: Φ_k = T_k⁻¹ (φ_k − φ₀).

use cosserat_rod::mesh::{Gauss, MAX_STAGES};
use cosserat_rod::sweep::{Joint, Relation, System};
use nalgebra::{Matrix3, Vector3};

/// Places of the unknowns of a node or point within it.
pub const PHI: usize = 0;
pub const W: usize = 1;
pub const N: usize = 2;
pub const M: usize = 3;
pub const G: usize = 4;

/// Where the blocks lie.
#[derive(Clone, Copy)]
pub struct Layout {
    pub cells: usize,
    pub stages: usize,
}

impl Layout {
    /// Blocks from one node to the next.
    pub fn stride(&self) -> usize {
        4 + 5 * self.stages
    }

    pub fn blocks(&self) -> usize {
        self.cells * self.stride() + 4
    }

    pub fn node(&self, j: usize) -> usize {
        j * self.stride()
    }

    pub fn point(&self, j: usize, k: usize) -> usize {
        self.node(j) + 4 + 5 * k
    }

    /// The first equation of a cell.
    pub fn equations(&self, j: usize) -> usize {
        2 + self.node(j)
    }
}

/// A x = b.
pub struct Full {
    pub layout: Layout,
    /// Row, column, block.
    pub entries: Vec<(usize, usize, Matrix3<f64>)>,
    pub right: Vec<Vector3<f64>>,
}

impl Full {
    pub fn new(system: &System, rule: &Gauss) -> Self {
        let layout = Layout { cells: system.cells.len(), stages: rule.stages };
        let one = Matrix3::identity();
        let mut entries = Vec::new();
        let mut right = vec![Vector3::zeros(); layout.blocks()];
        let inverse = |m: &Matrix3<f64>| m.try_inverse().expect("T = R J_r is regular for |Φ| < 2π");

        // the six equations of an end that is held in part: coordinate by coordinate its motion or its balance
        let joint = |entries: &mut Vec<_>, row, at, joint: &Joint, load: &Relation| {
            let [a, b, c, d, e, f] = joint.held.map(|held| if held { 1.0 } else { 0.0 });
            let held = [Matrix3::from_diagonal(&[a, b, c].into()), Matrix3::from_diagonal(&[d, e, f].into())];
            let free = held.map(|held| one - held);
            let (force, moment) = (free[0] * joint.by_w, free[1] * joint.of_moment);
            entries.extend([
                (row, at + W, held[0] * joint.by_w - force * load.n_w),
                (row, at + PHI, -force * load.n_phi),
                (row, at + N, force),
                (row + 1, at + PHI, held[1] * joint.by_phi - moment * load.m_phi),
                (row + 1, at + W, -moment * load.m_w),
                (row + 1, at + M, moment),
            ]);
            let (w, phi) = joint.correction;
            (held[0] * w + force * load.n, held[1] * phi + moment * load.m)
        };

        (right[0], right[1]) = match &system.base_joint {
            Some(base) => joint(&mut entries, 0, 0, base, &system.base_load),
            None => {
                entries.extend([(0, W, one), (1, PHI, one)]);
                system.base
            }
        };

        for (j, ends) in system.cells.iter().enumerate() {
            let h = ends.length;
            let (node_0, node_1) = (layout.node(j), layout.node(j + 1));
            let points = &system.points[j * rule.stages..][..rule.stages];
            let origin = [0.0; MAX_STAGES];
            let mut row = layout.equations(j);
            let mut next = |residual: &Vector3<f64>| {
                right[row] = -residual;
                row += 1;
                row - 1
            };
            // n or m at `at`, from node 1 backwards
            let backward = |entries: &mut Vec<_>, row, what, at, from: &[f64; MAX_STAGES]| {
                entries.extend([(row, at + what, one), (row, node_1 + what, -one)]);
                for (l, point) in points.iter().enumerate() {
                    let (weight, column) = (h * (rule.b[l] - from[l]), layout.point(j, l));
                    if what == N {
                        entries.push((row, column + W, one * (weight * system.mass)));
                    } else {
                        entries.push((row, column + PHI, point.m_phi * weight));
                        entries.push((row, column + N, point.m_n * weight));
                    }
                }
            };
            // Φ or w at `at`, from node 0 onwards
            let forward = |entries: &mut Vec<_>, row, what, at, spin: &Matrix3<f64>, weights: &[f64; MAX_STAGES]| {
                let by_end = if what == W { one } else { inverse(spin) };
                entries.extend([(row, at + what, by_end), (row, node_0 + what, -by_end)]);
                for (l, point) in points.iter().enumerate() {
                    let (weight, column) = (-h * weights[l], layout.point(j, l));
                    if what == W {
                        entries.push((row, column + PHI, point.w_phi * weight));
                        if system.extensible {
                            entries.push((row, column + N, point.w_n * weight));
                        }
                    } else {
                        entries.push((row, column + G, one * weight));
                    }
                }
            };

            backward(&mut entries, next(&ends.e_n), N, node_0, &origin);
            backward(&mut entries, next(&ends.e_m), M, node_0, &origin);
            for (k, point) in points.iter().enumerate() {
                let at = layout.point(j, k);
                forward(&mut entries, next(&point.e_log), PHI, at, &point.spin, &rule.a[k]);
                forward(&mut entries, next(&point.e_w), W, at, &point.spin, &rule.a[k]);
                backward(&mut entries, next(&point.e_n), N, at, &rule.a[k]);
                backward(&mut entries, next(&point.e_m), M, at, &rule.a[k]);
                let row = next(&point.e_law);
                let by_turn = point.law_log * inverse(&point.spin);
                entries.extend([
                    (row, at + PHI, point.law_phi + by_turn),
                    (row, node_0 + PHI, -by_turn),
                    (row, at + G, point.law_strain),
                    (row, at + M, -one),
                ]);
            }
            forward(&mut entries, next(&ends.e_log), PHI, node_1, &ends.spin, &rule.b);
            forward(&mut entries, next(&ends.e_w), W, node_1, &ends.spin, &rule.b);
        }

        let (row, tip) = (layout.blocks() - 2, layout.node(layout.cells));
        (right[row], right[row + 1]) = match &system.tip_joint {
            Some(held) => joint(&mut entries, row, tip, held, &system.tip),
            None => {
                let Relation { n_w, n_phi, m_w, m_phi, n, m } = system.tip;
                entries.extend([(row, tip + N, one), (row, tip + W, -n_w), (row, tip + PHI, -n_phi)]);
                entries.extend([(row + 1, tip + M, one), (row + 1, tip + W, -m_w), (row + 1, tip + PHI, -m_phi)]);
                (n, m)
            }
        };
        Self { layout, entries, right }
    }

    /// The same system with another right-hand side.
    #[allow(dead_code)]
    pub fn with_right(&self, system: &System, right: &[Vector3<f64>]) -> System {
        let mut other = system.clone();
        let row = self.layout.blocks() - 2;
        other.base = (right[0], right[1]);
        (other.tip.n, other.tip.m) = (right[row], right[row + 1]);
        for (joint, load, (w, phi)) in [
            (&mut other.base_joint, &mut other.base_load, (right[0], right[1])),
            (&mut other.tip_joint, &mut other.tip, (right[row], right[row + 1])),
        ] {
            if let Some(joint) = joint {
                // as coordinates of the end, and as forces on them
                joint.correction = (w, phi);
                (load.n, load.m) = (joint.by_w.tr_mul(&w), joint.by_phi.tr_mul(&phi));
            }
        }
        for (j, ends) in other.cells.iter_mut().enumerate() {
            let mut rows = right[self.layout.equations(j)..].iter().map(|b| -b);
            let mut next = || rows.next().expect("a row for every equation");
            (ends.e_n, ends.e_m) = (next(), next());
            for point in &mut other.points[j * self.layout.stages..][..self.layout.stages] {
                (point.e_log, point.e_w, point.e_n) = (next(), next(), next());
                (point.e_m, point.e_law) = (next(), next());
            }
            (ends.e_log, ends.e_w) = (next(), next());
        }
        other
    }
}
