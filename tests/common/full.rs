//! The linear system of `sweep::System` written out: every unknown and every equation, in blocks as large as they are.
//!
//! Blocks of unknowns, along the rod: φ, w, n, m of a node, then φ, w, n, m, g of every Gauss point of the cell behind
//! it. Blocks of equations: the two of the base, then cell by cell those for n₀, m₀, for Φ, w, n, p and the law at
//! every point, for Φ₁, w₁, and at the end the two of the tip. Φ is expressed by the rotations: Φ_k = T_k⁻¹ (φ_k − φ₀).

use cosserat_rod::mesh::{Gauss, MAX_STAGES};
use cosserat_rod::sweep::{Joint, Relation, Residuals, System};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// Places of the unknowns of a node or point within it, and kinds: the equations for Φ, w, n, p and the law are of the
/// same.
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
    /// Components of w and of φ.
    pub components: (usize, usize),
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

    /// The kinds of the blocks of unknowns.
    #[allow(dead_code)]
    pub fn unknowns(&self) -> Vec<usize> {
        let cell = |_| [PHI, W, N, M].into_iter().chain((0..self.stages).flat_map(|_| [PHI, W, N, M, G]));
        (0..self.cells).flat_map(cell).chain([PHI, W, N, M]).collect()
    }

    /// The kinds of the blocks of equations.
    pub fn kinds_of_equations(&self) -> Vec<usize> {
        let points = |_| [PHI, W, N, M, G];
        let cell = |_| [N, M].into_iter().chain((0..self.stages).flat_map(points)).chain([PHI, W]);
        [W, PHI].into_iter().chain((0..self.cells).flat_map(cell)).chain([N, M]).collect()
    }

    /// Numbers in a block of that kind.
    pub fn size(&self, kind: usize) -> usize {
        if kind == W || kind == N { self.components.0 } else { self.components.1 }
    }

    /// The places of the first number of each of the blocks and, last, how many there are.
    #[allow(dead_code)]
    pub fn places(&self, kinds: &[usize]) -> Vec<usize> {
        let end = |at: &mut usize, kind: &usize| {
            *at += self.size(*kind);
            Some(*at)
        };
        [0].into_iter().chain(kinds.iter().scan(0, end)).collect()
    }
}

fn block<const R: usize, const C: usize>(block: SMatrix<f64, R, C>) -> DMatrix<f64> {
    DMatrix::from_column_slice(R, C, block.as_slice())
}

fn vector<const R: usize>(vector: SVector<f64, R>) -> DVector<f64> {
    DVector::from_column_slice(vector.as_slice())
}

fn fixed<const R: usize>(vector: &DVector<f64>) -> SVector<f64, R> {
    SVector::from_column_slice(vector.as_slice())
}

/// A x = b.
pub struct Full {
    pub layout: Layout,
    /// Row, column, block.
    pub entries: Vec<(usize, usize, DMatrix<f64>)>,
    pub right: Vec<DVector<f64>>,
}

impl Full {
    pub fn new<const V: usize, const S: usize>(system: &System<V, S>, rule: &Gauss) -> Self {
        let layout = Layout { cells: system.cells.len(), stages: rule.stages, components: (V, S) };
        let (one_w, one_phi) = (SMatrix::<f64, V, V>::identity(), SMatrix::<f64, S, S>::identity());
        let mut entries = Vec::new();
        let mut right: Vec<_> =
            layout.kinds_of_equations().into_iter().map(|kind| DVector::zeros(layout.size(kind))).collect();
        let inverse = |m: &SMatrix<f64, S, S>| {
            let inverse = block(*m).try_inverse().expect("T = R J_r is regular for |Φ| < 2π");
            SMatrix::<f64, S, S>::from_column_slice(inverse.as_slice())
        };

        // the equations of an end that is held in part: coordinate by coordinate its motion or its balance
        let joint = |entries: &mut Vec<_>, row, at, joint: &Joint<V, S>, load: &Relation<V, S>, (w, phi), (n, m)| {
            let held_w = SMatrix::<f64, V, V>::from_fn(|i, j| f64::from(i == j && joint.held.0[i]));
            let held_phi = SMatrix::<f64, S, S>::from_fn(|i, j| f64::from(i == j && joint.held.1[i]));
            let (force, moment) = ((one_w - held_w) * joint.by_w, (one_phi - held_phi) * joint.of_moment);
            entries.extend([
                (row, at + W, block(held_w * joint.by_w - force * load.n_w)),
                (row, at + PHI, block(-force * load.n_phi)),
                (row, at + N, block(force)),
                (row + 1, at + PHI, block(held_phi * joint.by_phi - moment * load.m_phi)),
                (row + 1, at + W, block(-moment * load.m_w)),
                (row + 1, at + M, block(moment)),
            ]);
            (vector(held_w * w + force * n), vector(held_phi * phi + moment * m))
        };

        let e = &system.residuals;
        (right[0], right[1]) = match &system.base_joint {
            Some(base) => joint(&mut entries, 0, 0, base, &system.base_load, e.base, e.base_load),
            None => {
                entries.extend([(0, W, block(one_w)), (1, PHI, block(one_phi))]);
                (vector(e.base.0), vector(e.base.1))
            }
        };

        for (j, ends) in system.cells.iter().enumerate() {
            let h = ends.length;
            let (node_0, node_1) = (layout.node(j), layout.node(j + 1));
            let points = &system.points[j * rule.stages..][..rule.stages];
            let (e, e_ends) = (&e.points[j * rule.stages..][..rule.stages], &e.cells[j]);
            let origin = [0.0; MAX_STAGES];
            let mut row = layout.equations(j);
            let mut next = |residual: DVector<f64>| {
                right[row] = -residual;
                row += 1;
                row - 1
            };
            // n or m at `at`, from node 1 backwards
            let backward = |entries: &mut Vec<_>, row, what, at, from: &[f64; MAX_STAGES]| {
                let one = if what == N { block(one_w) } else { block(one_phi) };
                entries.extend([(row, at + what, one.clone()), (row, node_1 + what, -one)]);
                for (l, point) in points.iter().enumerate() {
                    let (weight, column) = (h * (rule.b[l] - from[l]), layout.point(j, l));
                    if what == N {
                        entries.push((row, column + W, block(one_w * (weight * system.mass))));
                    } else {
                        entries.push((row, column + PHI, block(point.m_phi * weight)));
                        entries.push((row, column + N, block(point.m_n * weight)));
                    }
                }
            };
            // a block times Φ at `at`
            let of_log = |entries: &mut Vec<_>, row, at, spin: &SMatrix<f64, S, S>, by_log: SMatrix<f64, S, S>| {
                let by_turn = by_log * inverse(spin);
                entries.extend([(row, at + PHI, block(by_turn)), (row, node_0 + PHI, block(-by_turn))]);
            };
            // p at a point, from node 1 backwards
            let canonical = |entries: &mut Vec<_>, row, k: usize, from: &[f64; MAX_STAGES]| {
                let point = &points[k];
                entries.push((row, layout.point(j, k) + G, block(point.p_strain)));
                of_log(entries, row, layout.point(j, k), &point.spin, point.p_log);
                entries.push((row, node_1 + M, block(-ends.spin.transpose())));
                entries.push((row, node_0 + PHI, block(-ends.p_phi)));
                of_log(entries, row, node_1, &ends.spin, -ends.p_log);
                for (l, point) in points.iter().enumerate() {
                    let (weight, column) = (h * (rule.b[l] - from[l]), layout.point(j, l));
                    let turned = point.spin.transpose() * weight;
                    entries.push((row, column + PHI, block(turned * point.m_phi)));
                    entries.push((row, column + N, block(turned * point.m_n)));
                    entries.push((row, column + G, block(point.p_log.transpose() * weight)));
                    entries.push((row, node_0 + PHI, block(point.slope_phi * weight)));
                    of_log(entries, row, column, &point.spin, point.slope_log * weight);
                }
            };
            // Φ or w at `at`, from node 0 onwards
            let forward =
                |entries: &mut Vec<_>, row, what, at, spin: &SMatrix<f64, S, S>, weights: &[f64; MAX_STAGES]| {
                    let by_end = if what == W { block(one_w) } else { block(inverse(spin)) };
                    entries.extend([(row, at + what, by_end.clone()), (row, node_0 + what, -by_end)]);
                    for (l, point) in points.iter().enumerate() {
                        let (weight, column) = (-h * weights[l], layout.point(j, l));
                        if what == W {
                            entries.push((row, column + PHI, block(point.w_phi * weight)));
                            if system.extensible {
                                entries.push((row, column + N, block(point.w_n * weight)));
                            }
                        } else {
                            entries.push((row, column + G, block(one_phi * weight)));
                        }
                    }
                };

            backward(&mut entries, next(vector(e_ends.n)), N, node_0, &origin);
            backward(&mut entries, next(vector(e_ends.m)), M, node_0, &origin);
            for (k, point) in points.iter().enumerate() {
                let at = layout.point(j, k);
                forward(&mut entries, next(vector(e[k].log)), PHI, at, &point.spin, &rule.a[k]);
                forward(&mut entries, next(vector(e[k].w)), W, at, &point.spin, &rule.a[k]);
                backward(&mut entries, next(vector(e[k].n)), N, at, &rule.a[k]);
                canonical(&mut entries, next(vector(e[k].p)), k, &rule.a[k]);
                let row = next(vector(SVector::<f64, S>::zeros()));
                of_log(&mut entries, row, at, &point.spin, point.law_log);
                entries.extend([(row, at + G, block(point.law_strain)), (row, at + M, block(-one_phi))]);
            }
            forward(&mut entries, next(vector(e_ends.log)), PHI, node_1, &ends.spin, &rule.b);
            forward(&mut entries, next(vector(e_ends.w)), W, node_1, &ends.spin, &rule.b);
        }

        let (row, tip) = (layout.blocks() - 2, layout.node(layout.cells));
        (right[row], right[row + 1]) = match &system.tip_joint {
            Some(held) => joint(&mut entries, row, tip, held, &system.tip_load, e.tip, e.tip_load),
            None => {
                let Relation { n_w, n_phi, m_w, m_phi } = system.tip_load;
                entries.extend([(row, tip + N, block(one_w)), (row + 1, tip + M, block(one_phi))]);
                entries.extend([(row, tip + W, block(-n_w)), (row, tip + PHI, block(-n_phi))]);
                entries.extend([(row + 1, tip + W, block(-m_w)), (row + 1, tip + PHI, block(-m_phi))]);
                (vector(e.tip_load.0), vector(e.tip_load.1))
            }
        };
        Self { layout, entries, right }
    }

    /// The residuals of `system` with another right-hand side.
    #[allow(dead_code)]
    pub fn residuals<const V: usize, const S: usize>(
        &self,
        system: &System<V, S>,
        right: &[DVector<f64>],
    ) -> Residuals<V, S> {
        let mut e = system.residuals.clone();
        let pair = |row: usize| (fixed(&right[row]), fixed(&right[row + 1]));
        let row = self.layout.blocks() - 2;
        (e.base, e.tip_load) = (pair(0), pair(row));
        for (joint, t, load, row) in [
            (&system.base_joint, &mut e.base, &mut e.base_load, 0),
            (&system.tip_joint, &mut e.tip, &mut e.tip_load, row),
        ] {
            if let Some(joint) = joint {
                // as coordinates of the end, and as forces on them
                let (w, phi) = pair(row);
                (*t, *load) = ((w, phi), (joint.by_w.tr_mul(&w), joint.by_phi.tr_mul(&phi)));
            }
        }
        for (j, ends) in e.cells.iter_mut().enumerate() {
            let mut rows = right[self.layout.equations(j)..].iter();
            let mut next = || rows.next().expect("a row for every equation");
            (ends.n, ends.m) = (-fixed(next()), -fixed(next()));
            for point in &mut e.points[j * self.layout.stages..][..self.layout.stages] {
                (point.log, point.w, point.n) = (-fixed(next()), -fixed(next()), -fixed(next()));
                point.p = -fixed(next());
                // the law has no residual
                next();
            }
            (ends.log, ends.w) = (-fixed(next()), -fixed(next()));
        }
        e
    }
}
