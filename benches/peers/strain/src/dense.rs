//! Small dense linear algebra on rows of fixed length: products, and Cholesky in tiles of 4 × 4.
//!
//! P is the number of unknowns rounded up to tiles; what pads is zero off the diagonal and one on it.

use nalgebra::DMatrix;

/// Side of a tile.
pub const TILE: usize = 4;

/// A matrix of R rows of C numbers.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Matrix<const R: usize, const C: usize>(pub [[f64; C]; R]);

impl<const R: usize, const C: usize> Matrix<R, C> {
    /// Zeros.
    pub fn zeros() -> Box<Self> {
        Box::new(Self([[0.0; C]; R]))
    }

    /// `matrix`, padded by zeros.
    pub fn padded(matrix: &DMatrix<f64>) -> Box<Self> {
        let mut padded = Self::zeros();
        for i in 0..matrix.nrows() {
            for j in 0..matrix.ncols() {
                padded.0[i][j] = matrix[(i, j)];
            }
        }
        padded
    }
}

/// `values`, padded by `rest`.
pub fn padded<const P: usize>(values: impl IntoIterator<Item = f64>, rest: f64) -> [f64; P] {
    let mut array = [rest; P];
    array.iter_mut().zip(values).for_each(|(to, from)| *to = from);
    array
}

/// Σ_j row_j x_j, over the first `n` rows.
#[inline(always)]
pub fn combine<const R: usize, const C: usize, const K: usize>(
    rows: &Matrix<R, C>,
    n: usize,
    x: [&[f64; R]; K],
) -> [[f64; C]; K] {
    let mut sum = [[0.0; C]; K];
    for j in 0..n {
        let row = &rows.0[j];
        for k in 0..K {
            let factor = x[k][j];
            for i in 0..C {
                sum[k][i] = row[i].mul_add(factor, sum[k][i]);
            }
        }
    }
    sum
}

/// Adds Σ_j left_ja right_jb over the first `n` rows j to `sum`_ab; of the tiles left of the diagonal none, if `upper`.
#[inline(always)]
pub fn add_product<const R: usize, const A: usize, const B: usize, const S: usize>(
    sum: &mut Matrix<S, B>,
    left: &Matrix<R, A>,
    right: &Matrix<R, B>,
    n: usize,
    upper: bool,
) {
    for a in (0..A).step_by(TILE) {
        let mut b = if upper { a } else { 0 };
        while b + 2 * TILE <= B {
            tile::<R, A, B, S, { 2 * TILE }>(sum, left, right, n, a, b);
            b += 2 * TILE;
        }
        if b < B {
            tile::<R, A, B, S, TILE>(sum, left, right, n, a, b);
        }
    }
}

#[inline(always)]
fn tile<const R: usize, const A: usize, const B: usize, const S: usize, const W: usize>(
    sum: &mut Matrix<S, B>,
    left: &Matrix<R, A>,
    right: &Matrix<R, B>,
    n: usize,
    a: usize,
    b: usize,
) {
    let mut held = [[0.0; W]; TILE];
    for (left, right) in left.0[..n].iter().zip(&right.0[..n]) {
        let left: &[f64; TILE] = left[a..a + TILE].try_into().expect("a tile");
        let right: &[f64; W] = right[b..b + W].try_into().expect("a tile");
        for r in 0..TILE {
            for l in 0..W {
                held[r][l] = left[r].mul_add(right[l], held[r][l]);
            }
        }
    }
    for r in 0..TILE {
        let to: &mut [f64; W] = (&mut sum.0[a + r][b..b + W]).try_into().expect("a tile");
        for l in 0..W {
            to[l] += held[r][l];
        }
    }
}

/// Solves A x = b in place; A's upper triangle is given and becomes its Cholesky factor. Lower tiles are not read.
#[inline(always)]
pub fn solve<const P: usize>(a: &mut Matrix<P, P>, b: &mut [f64; P]) {
    let a = &mut a.0;
    let mut inverse = [0.0; P];
    for first in (0..P).step_by(TILE) {
        // the four rows of the panel
        for j in first..first + TILE {
            let (above, below) = a.split_at_mut(j);
            let row = &mut below[0];
            for pivot in above[first..].iter() {
                let factor = pivot[j];
                let (mine, theirs) = (&mut row[first..], &pivot[first..]);
                for (mine, theirs) in mine.as_chunks_mut::<TILE>().0.iter_mut().zip(theirs.as_chunks::<TILE>().0) {
                    for l in 0..TILE {
                        mine[l] = theirs[l].mul_add(-factor, mine[l]);
                    }
                }
            }
            let scale = 1.0 / row[j].sqrt();
            inverse[j] = scale;
            for chunk in row[first..].as_chunks_mut::<TILE>().0 {
                for l in 0..TILE {
                    chunk[l] *= scale;
                }
            }
        }
        // what remains, tile row by tile row
        let (done, rest) = a.split_at_mut(first + TILE);
        let [p_0, p_1, p_2, p_3] = &done[first..] else { unreachable!() };
        for (block, rows) in rest.as_chunks_mut::<TILE>().0.iter_mut().enumerate() {
            let i = first + TILE * (block + 1);
            let factor: [[f64; TILE]; TILE] = [p_0, p_1, p_2, p_3].map(|p| [-p[i], -p[i + 1], -p[i + 2], -p[i + 3]]);
            let tiles = |row: &'_ [f64; P]| -> usize { (row.len() - i) / TILE };
            for t in 0..tiles(p_0) {
                let k = i + TILE * t;
                for (r, row) in rows.iter_mut().enumerate() {
                    for l in 0..TILE {
                        let x = p_0[k + l].mul_add(factor[0][r], row[k + l]);
                        let x = p_1[k + l].mul_add(factor[1][r], x);
                        let x = p_2[k + l].mul_add(factor[2][r], x);
                        row[k + l] = p_3[k + l].mul_add(factor[3][r], x);
                    }
                }
            }
        }
    }
    // Uᵀ y = b
    for j in 0..P {
        let y = b[j] * inverse[j];
        b[j] = y;
        let row = &a[j];
        for k in j + 1..P {
            b[k] = row[k].mul_add(-y, b[k]);
        }
    }
    // U x = y
    for j in (0..P).rev() {
        let row = &a[j];
        let mut sum = [0.0; TILE];
        // the tile of the diagonal, then whole ones
        let next = (j / TILE + 1) * TILE;
        let mut rest = b[j];
        for k in j + 1..next {
            rest = row[k].mul_add(-b[k], rest);
        }
        for (r, x) in row[next..].as_chunks::<TILE>().0.iter().zip(b[next..].as_chunks::<TILE>().0) {
            for l in 0..TILE {
                sum[l] = r[l].mul_add(x[l], sum[l]);
            }
        }
        b[j] = (rest - (sum[0] + sum[1]) - (sum[2] + sum[3])) * inverse[j];
    }
}

/// Sine and cosine without branches, to rounding for |x| below 1e5: reduction by multiples of π, then Taylor.
#[inline(always)]
pub fn sin_cos(x: f64) -> (f64, f64) {
    const PI_HIGH: f64 = std::f64::consts::PI;
    const PI_LOW: f64 = 1.224_646_799_147_353_2e-16;
    let turns = (x * std::f64::consts::FRAC_1_PI).round_ties_even();
    let r = turns.mul_add(-PI_LOW, turns.mul_add(-PI_HIGH, x));
    let sign = 1.0 - 2.0 * (turns - 2.0 * (0.5 * turns).floor());
    let z = r * r;
    let (sine, cosine) = sinc_cos(z);
    (sign * r * sine, sign * cosine)
}

/// sin(r)/r and cos(r) from z = r² by Taylor, to rounding for z < 3.
#[inline(always)]
pub fn sinc_cos(z: f64) -> (f64, f64) {
    let (mut sine, mut cosine) = (0.0, 0.0);
    // 1/(2k+1)! and 1/(2k)!
    for k in (0..12).rev() {
        sine = z.mul_add(-sine, ODD[k]);
        cosine = z.mul_add(-cosine, EVEN[k]);
    }
    (sine, cosine)
}

const EVEN: [f64; 12] = inverse_factorials(0);
const ODD: [f64; 12] = inverse_factorials(1);

const fn inverse_factorials(odd: usize) -> [f64; 12] {
    let mut values = [1.0; 12];
    let (mut k, mut factorial) = (1, 1.0);
    while k < 12 {
        let n = 2 * k + odd;
        factorial *= (n * (n - 1)) as f64;
        values[k] = 1.0 / factorial;
        k += 1;
    }
    values
}
