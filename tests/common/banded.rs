//! A banded LU with partial pivoting: the oracle of the sweep. It knows only numbers.

use crate::full::Full;
use nalgebra::{DMatrix, DVector};

/// A band matrix by rows, with room for the fill of row exchanges.
pub struct Banded {
    size: usize,
    below: usize,
    above: usize,
    rows: Vec<f64>,
}

impl Banded {
    /// The matrix of a system.
    pub fn new(full: &Full) -> Self {
        let Full { layout, entries, .. } = full;
        let rows = layout.places(&layout.kinds_of_equations());
        let columns = layout.places(&layout.unknowns());
        let numbers = |(row, column, block): &(usize, usize, DMatrix<f64>)| {
            let (row, column) = (rows[*row], columns[*column]);
            let number = |(place, x): (usize, &f64)| (row + place % block.nrows(), column + place / block.nrows(), *x);
            block.iter().enumerate().map(number).collect::<Vec<_>>()
        };
        Self::of_numbers(columns[layout.blocks()], &entries.iter().flat_map(numbers).collect::<Vec<_>>())
    }

    /// The matrix of so many rows from the row, column and value of the numbers there are; such at the same place add
    /// up.
    pub fn of_numbers(size: usize, entries: &[(usize, usize, f64)]) -> Self {
        let reach = |distance: &dyn Fn(usize, usize) -> usize| {
            entries.iter().map(|(row, column, _)| distance(*row, *column)).max().unwrap_or(0)
        };
        let below = reach(&|row, column| row.saturating_sub(column));
        let above = reach(&|row, column| column.saturating_sub(row));
        let mut matrix = Self { size, below, above, rows: vec![0.0; size * (2 * below + above + 1)] };
        for (row, column, x) in entries {
            *matrix.at(*row, *column) += x;
        }
        matrix
    }

    fn width(&self) -> usize {
        2 * self.below + self.above + 1
    }

    fn place(&self, i: usize, j: usize) -> usize {
        i * self.width() + self.below + j - i
    }

    fn at(&mut self, i: usize, j: usize) -> &mut f64 {
        let place = self.place(i, j);
        &mut self.rows[place]
    }

    /// Columns of row `i` that may hold a number before the elimination.
    fn columns(&self, i: usize) -> std::ops::Range<usize> {
        i.saturating_sub(self.below)..(i + self.above + 1).min(self.size)
    }

    /// |A| |x|.
    pub fn size_of_terms(&self, x: &[f64]) -> Vec<f64> {
        let row = |i: usize| self.columns(i).map(|j| (self.rows[self.place(i, j)] * x[j]).abs()).sum();
        (0..self.size).map(row).collect()
    }

    /// Scales rows and columns to largest entries of size one by powers of two; returns both scales.
    pub fn equilibrate(&mut self) -> (Vec<f64>, Vec<f64>) {
        let (mut by_row, mut by_column) = (vec![1.0; self.size], vec![1.0; self.size]);
        for _ in 0..3 {
            let mut largest = vec![0.0f64; self.size];
            for i in 0..self.size {
                let most = self.columns(i).map(|j| self.rows[self.place(i, j)].abs()).fold(0.0, f64::max);
                let scale = most.log2().floor().exp2().recip();
                by_row[i] *= scale;
                for j in self.columns(i) {
                    let entry = self.at(i, j);
                    *entry *= scale;
                    largest[j] = largest[j].max(entry.abs());
                }
            }
            let scales: Vec<f64> = largest.iter().map(|most| most.log2().floor().exp2().recip()).collect();
            for i in 0..self.size {
                for j in self.columns(i) {
                    *self.at(i, j) *= scales[j];
                }
            }
            by_column.iter_mut().zip(&scales).for_each(|(total, scale)| *total *= scale);
        }
        (by_row, by_column)
    }

    /// b − A x with products and sums of twice the working precision.
    pub fn residual(&self, x: &[f64], right: &[f64]) -> Vec<f64> {
        let row = |i: usize| {
            let (mut sum, mut rest) = (right[i], 0.0);
            for j in self.columns(i) {
                let a = -self.rows[self.place(i, j)];
                // most of the band is empty, and exact products are slow
                if a == 0.0 {
                    continue;
                }
                let product = a * x[j];
                rest += a.mul_add(x[j], -product);
                // Knuth's exact sum
                let total = sum + product;
                let part = total - sum;
                rest += (sum - (total - part)) + (product - part);
                sum = total;
            }
            sum + rest
        };
        (0..self.size).map(row).collect()
    }

    /// Gaussian elimination, row exchanges as the largest entry of each column asks. `None` where a column has none.
    pub fn factored(mut self) -> Option<Factors> {
        let width = self.width();
        let mut exchanges = vec![0; self.size];
        for pivot in 0..self.size {
            let last_row = (pivot + self.below + 1).min(self.size);
            let length = (pivot + self.below + self.above + 1).min(self.size) - pivot;
            let magnitude = |i: usize| self.rows[self.place(i, pivot)].abs();
            let best =
                (pivot + 1..last_row).fold(pivot, |best, i| if magnitude(i) > magnitude(best) { i } else { best });
            if magnitude(best) == 0.0 {
                return None;
            }
            exchanges[pivot] = best;
            if best != pivot {
                let (here, there) = (self.place(pivot, pivot), self.place(best, pivot));
                let (upper, lower) = self.rows.split_at_mut(best * width);
                upper[here..here + length].swap_with_slice(&mut lower[there - best * width..][..length]);
            }
            let (upper, lower) = self.rows.split_at_mut((pivot + 1) * width);
            let pivot_row = &upper[pivot * width + self.below..][..length];
            for (i, row) in (pivot + 1..last_row).zip(lower.chunks_exact_mut(width)) {
                let row = &mut row[self.below + pivot - i..][..length];
                let factor = row[0] / pivot_row[0];
                row[0] = factor;
                if factor != 0.0 {
                    row[1..].iter_mut().zip(&pivot_row[1..]).for_each(|(mine, theirs)| *mine -= factor * theirs);
                }
            }
        }
        Some(Factors { matrix: self, exchanges })
    }
}

/// L and U, and the row each pivot came from.
pub struct Factors {
    matrix: Banded,
    exchanges: Vec<usize>,
}

impl Factors {
    /// The solution of A x = b.
    pub fn solve(&self, right: &[f64]) -> Vec<f64> {
        let a = &self.matrix;
        let mut x = right.to_vec();
        for pivot in 0..a.size {
            x.swap(pivot, self.exchanges[pivot]);
            for i in pivot + 1..(pivot + a.below + 1).min(a.size) {
                x[i] -= a.rows[a.place(i, pivot)] * x[pivot];
            }
        }
        for i in (0..a.size).rev() {
            let row = &a.rows[a.place(i, i)..];
            let last = (i + a.below + a.above + 1).min(a.size);
            let known: f64 = (i + 1..last).map(|j| row[j - i] * x[j]).sum();
            x[i] = (x[i] - known) / row[0];
        }
        x
    }
}

/// The numbers of a block vector.
pub fn flat(blocks: &[DVector<f64>]) -> Vec<f64> {
    blocks.iter().flat_map(|block| block.iter().copied()).collect()
}
