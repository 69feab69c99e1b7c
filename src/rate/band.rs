//! Gaussian elimination of the block-bidiagonal system of 4.3.1 (eq 21, linearised), from the tip to the base. It knows
//! no rod.
//!
//! The rows of a cell hold the unknowns of its two nodes. Six rows on node j+1 come down from the cells beyond it; with
//! the rows of cell j they are as many as the columns of node j+1 and six more. Eliminating those columns with partial
//! pivoting leaves six rows on node j: the elimination of the band matrix, without an entry outside these panels.

use super::cell::{Block, LARGEST};
use crate::sweep::Singular;

/// Rows that an end gives up, and that are carried from cell to cell.
pub const CARRIED: usize = 6;
/// Rows and columns of the largest panel.
const ROWS: usize = LARGEST + CARRIED;
const COLUMNS: usize = 2 * LARGEST + 1;

/// The rows of a cell; of its blocks the columns that its nodes have.
#[derive(Clone, Debug)]
pub struct CellRows {
    /// By the unknowns of the node nearer to the base.
    pub before: Block,
    /// By those of the node nearer to the tip.
    pub after: Block,
    /// The right-hand side.
    pub right: [f64; LARGEST],
}

/// The system, with the storage to solve it. The base has six unknowns, the tip six less than the nodes between.
#[derive(Clone, Debug)]
pub struct Band {
    /// The rows, cell by cell from the base.
    pub cells: Vec<CellRows>,
    size: usize,
    kept: Vec<[[f64; COLUMNS]; LARGEST]>,
}

impl Band {
    /// Room for `cells` cells with `size` unknowns at the nodes between them (12 or 15).
    pub fn new(cells: usize, size: usize) -> Self {
        let empty = CellRows { before: Block::zeros(), after: Block::zeros(), right: [0.0; LARGEST] };
        Self { cells: vec![empty; cells], size, kept: vec![[[0.0; COLUMNS]; LARGEST]; cells] }
    }

    /// The unknowns of node `j`.
    pub fn unknowns(&self, j: usize) -> usize {
        match j {
            0 => CARRIED,
            j if j == self.cells.len() => self.size - CARRIED,
            _ => self.size,
        }
    }

    /// Where the unknowns of node `j` begin.
    pub fn first(&self, j: usize) -> usize {
        if j == 0 { 0 } else { CARRIED + (j - 1) * self.size }
    }

    /// The number of all unknowns.
    pub fn len(&self) -> usize {
        self.size * self.cells.len()
    }

    /// Whether there is no cell.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Solves into `solution`, which has [`Self::len`] numbers.
    ///
    /// # Errors
    /// [`Singular`] names the first cell, seen from the tip, of which a column has no pivot, or else the base.
    pub fn solve(&mut self, solution: &mut [f64]) -> Result<(), Singular> {
        let cells = self.cells.len();
        let mut panel = [[0.0; COLUMNS]; ROWS];
        let mut carried = [[0.0; LARGEST + 1]; CARRIED];
        for j in (0..cells).rev() {
            let (near, far) = (self.unknowns(j), self.unknowns(j + 1));
            let width = far + near + 1;
            let rows = far + CARRIED;
            let cell = &self.cells[j];
            for i in 0..self.size {
                let row = &mut panel[i];
                for c in 0..far {
                    row[c] = cell.after[(i, c)];
                }
                for c in 0..near {
                    row[far + c] = cell.before[(i, c)];
                }
                row[width - 1] = cell.right[i];
            }
            for i in self.size..rows {
                let (row, from) = (&mut panel[i], &carried[i - self.size]);
                row[..far].copy_from_slice(&from[..far]);
                row[far..width - 1].fill(0.0);
                row[width - 1] = from[far];
            }
            eliminate(&mut panel[..rows], far, width).ok_or(Singular::Cell(j))?;
            self.kept[j][..far].copy_from_slice(&panel[..far]);
            for (to, from) in carried.iter_mut().zip(&panel[far..rows]) {
                to[..=near].copy_from_slice(&from[far..width]);
            }
        }

        for (row, from) in panel.iter_mut().zip(&carried) {
            row[..=CARRIED].copy_from_slice(&from[..=CARRIED]);
        }
        eliminate(&mut panel[..CARRIED], CARRIED, CARRIED + 1).ok_or(Singular::Base)?;
        substitute(&panel[..CARRIED], CARRIED, &[], &mut solution[..CARRIED]);
        for j in 0..cells {
            let (near, far) = (self.unknowns(j), self.unknowns(j + 1));
            let (known, unknown) = solution.split_at_mut(self.first(j + 1));
            let known = &known[known.len() - near..];
            substitute(&self.kept[j][..far], far, known, &mut unknown[..far]);
        }
        Ok(())
    }
}

/// Eliminates the first `columns` columns, rows exchanged so that the largest of each column is its pivot after every
/// row has been scaled to its largest entry. `None` where a column has none.
fn eliminate(rows: &mut [[f64; COLUMNS]], columns: usize, width: usize) -> Option<()> {
    for row in rows.iter_mut() {
        let largest = row[..width - 1].iter().fold(0.0f64, |max, x| max.max(x.abs()));
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        let scale = 1.0 / largest;
        row[..width].iter_mut().for_each(|x| *x *= scale);
    }
    for pivot in 0..columns {
        let magnitude = |row: usize| rows[row][pivot].abs();
        let best =
            (pivot + 1..rows.len()).fold(pivot, |best, row| if magnitude(row) > magnitude(best) { row } else { best });
        if !(magnitude(best) > 0.0 && magnitude(best).is_finite()) {
            return None;
        }
        rows.swap(pivot, best);
        let (upper, lower) = rows.split_at_mut(pivot + 1);
        let pivot_row = &upper[pivot][..width];
        let inverse = 1.0 / pivot_row[pivot];
        for row in lower {
            let factor = row[pivot] * inverse;
            if factor != 0.0 {
                row[pivot + 1..width].iter_mut().zip(&pivot_row[pivot + 1..]).for_each(|(x, y)| *x -= factor * y);
            }
        }
    }
    Some(())
}

/// Solves the eliminated rows for `unknown`.
fn substitute(rows: &[[f64; COLUMNS]], columns: usize, known: &[f64], unknown: &mut [f64]) {
    for i in (0..columns).rev() {
        let row = &rows[i];
        let mut sum = row[columns + known.len()];
        for (x, a) in unknown[i + 1..].iter().zip(&row[i + 1..columns]) {
            sum -= a * x;
        }
        for (x, a) in known.iter().zip(&row[columns..]) {
            sum -= a * x;
        }
        unknown[i] = sum / row[i];
    }
}
