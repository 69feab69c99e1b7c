//! The rod in space, in Legendre modes of the three curvatures of its sections.
//!
//! κ = κ̂ + Σ P_k q_k a component. Rotations follow from κ by Magnus integrals of order six between the Gauss points,
//! angular velocities are ω = ω_b + A q_t with A = ∫ d_c P_k, and virtual power gives, with W the weights, Ŝ = ρA SᵀWS,
//! ĉ_j = ρA Σ_i w_i S_ij, the bias α = α_b + ∫ ω × (R κ_t) of the angular accelerations and u = α × t + ω × (ω × t),
//! world components throughout,
//!
//! ```text
//! M q_tt = Aᵀ [t × (ĉ (g − a_b) + W F − Ŝ u) − W (J α + ω × J ω)] + A(L)ᵀ M_tip − K q
//! M = Aᵀ X A,  X_jk = Ŝ_jk ((t_j·t_k) 1 − t_k t_jᵀ) + w_j J_j δ_jk
//! ```
//!
//! In body components X has two unknowns a point, (A q_tt) × t = β₁ d₁ + β₂ d₂, and the part along t stands alone.

use crate::dense::{self, Matrix, padded};
use crate::rule::Rule;
use crate::scenes::{Drive, Scene};
use crate::time::Motion;
use nalgebra::{DMatrix, Rotation3, UnitQuaternion, Vector3};

/// Stretches between the points are cut in so many intervals; more change no digit that counts.
const PARTS: usize = 1;
/// Numbers that are worked on together.
const LANES: usize = 8;
/// Square of half an angle up to which the series of [`dense::sinc_cos`] is exact.
const SERIES: f64 = 3.0;

type Three<T> = [T; 3];

/// A rod in space with up to P points and M modes a component; P2 = 2P, M3 = 3M.
pub struct Spatial<const P: usize, const M: usize, const P2: usize, const M3: usize> {
    scene: Scene,
    n: usize,
    modes: usize,
    weights: [f64; P],
    lever: [f64; P],
    /// ρI w_j.
    inertia: [f64; P],
    stiffness: [f64; M3],
    mass: Box<Matrix<P, P>>,
    /// Sᵀ.
    integral: Box<Matrix<P, P>>,
    shapes: Box<Matrix<P, M>>,
    /// d_c P_k and its integral A, by component.
    local: Three<Box<Matrix<P, M3>>>,
    turn: Three<Box<Matrix<P, M3>>>,
    /// β of A, the part of A along t, and that times its inertia.
    beta: Box<Matrix<P2, M3>>,
    along: Box<Matrix<P, M3>>,
    weighted: Box<Matrix<P, M3>>,
    of_points: Box<Matrix<P2, P2>>,
    half: Box<Matrix<P2, M3>>,
    matrix: Box<Matrix<M3, M3>>,
    /// Of the Magnus moments, by mode and interval; the lengths of the intervals; the points at their ends.
    moments: Three<Vec<f64>>,
    intervals: usize,
    lengths: Vec<f64>,
    points: Vec<Option<usize>>,
    /// Of the intervals: α₁, α₂, α₃ by component, then the turn as a quaternion.
    alpha: Three<Three<Vec<f64>>>,
    turns: [Vec<f64>; 4],
    drive: (f64, Drive, [f64; 4]),
    /// d₁, d₂, t by component.
    frame: Three<Three<[f64; P]>>,
    /// u.
    bias: Three<[f64; P]>,
}

fn cross<T: Copy + std::ops::Mul<Output = T> + std::ops::Sub<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn quaternion(drive: &Drive) -> [f64; 4] {
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(drive.rotation));
    [q.w, q.i, q.j, q.k]
}

impl<const P: usize, const M: usize, const P2: usize, const M3: usize> Spatial<P, M, P2, M3> {
    /// The rod of a scene.
    pub fn new(scene: &Scene, rule: &Rule) -> Self {
        let (n, modes) = rule.modes.shape();
        let pieces = rule.intervals(PARTS);
        let intervals = pieces.len().next_multiple_of(LANES);
        let mut moments: Three<Vec<f64>> = std::array::from_fn(|_| vec![0.0; modes * intervals]);
        let mut lengths = vec![0.0; intervals];
        for (m, (rows, _)) in pieces.iter().enumerate() {
            lengths[m] = rows[0].iter().sum();
            for order in 0..3 {
                let by_mode = DMatrix::from_row_slice(1, n, &rows[order]) * &rule.modes;
                for k in 0..modes {
                    moments[order][k * intervals + m] = by_mode[k];
                }
            }
        }
        let stiffness = |c: usize| if c < 2 { scene.bending } else { scene.torsion };
        let of_modes = |i: usize| match i % M {
            k if k < modes => stiffness(i / M) * rule.squares[k],
            _ => 0.0,
        };
        let drive = scene.drive(0.0);
        Self {
            n,
            modes,
            weights: padded(rule.weights.iter().copied(), 0.0),
            lever: padded(rule.lever().iter().map(|c| c * scene.mass_per_length), 0.0),
            inertia: padded(rule.weights.iter().map(|w| w * scene.inertia_per_length), 0.0),
            stiffness: std::array::from_fn(of_modes),
            mass: Matrix::padded(&(rule.double_integral() * scene.mass_per_length)),
            integral: Matrix::padded(&rule.integral.transpose()),
            shapes: Matrix::padded(&rule.modes),
            local: std::array::from_fn(|_| Matrix::zeros()),
            turn: std::array::from_fn(|_| Matrix::zeros()),
            beta: Matrix::zeros(),
            along: Matrix::zeros(),
            weighted: Matrix::zeros(),
            of_points: Matrix::zeros(),
            half: Matrix::zeros(),
            matrix: Matrix::zeros(),
            moments,
            intervals,
            lengths,
            points: pieces.iter().map(|(_, point)| *point).collect(),
            alpha: std::array::from_fn(|_| std::array::from_fn(|_| vec![0.0; intervals])),
            turns: std::array::from_fn(|_| vec![0.0; intervals]),
            drive: (0.0, drive, quaternion(&drive)),
            frame: [[[0.0; P]; 3]; 3],
            bias: [[0.0; P]; 3],
            scene: scene.clone(),
        }
    }

    fn drive(&mut self, t: f64) -> Drive {
        if self.drive.0 != t {
            let drive = self.scene.drive(t);
            // few bases turn
            let turned = if drive.rotation == self.drive.1.rotation { self.drive.2 } else { quaternion(&drive) };
            self.drive = (t, drive, turned);
        }
        self.drive.1
    }

    /// The frames at the points, from κ: R' = R κ^ over an interval is R exp(Ω), with the Magnus series of the reversed
    /// bracket [a, b] = b × a.
    #[inline(never)]
    fn rotate(&mut self, q: &[[f64; M]; 3]) {
        let Self { moments, alpha, turns, intervals, modes, .. } = self;
        let rest = self.scene.kappa_rest;
        for (order, (rows, alpha)) in moments.iter().zip(alpha.iter_mut()).enumerate() {
            let [x, y, z] = alpha;
            for first in (0..*intervals).step_by(LANES) {
                let mut sum = [[0.0; LANES]; 3];
                if order == 0 {
                    // the first moment of a constant is its integral, the others vanish
                    for c in 0..3 {
                        for l in 0..LANES {
                            sum[c][l] = self.lengths[first + l] * rest[c];
                        }
                    }
                }
                for j in 0..*modes {
                    let row: &[f64; LANES] = rows[j * *intervals + first..][..LANES].try_into().expect("lanes");
                    for c in 0..3 {
                        for l in 0..LANES {
                            sum[c][l] = row[l].mul_add(q[c][j], sum[c][l]);
                        }
                    }
                }
                x[first..first + LANES].copy_from_slice(&sum[0]);
                y[first..first + LANES].copy_from_slice(&sum[1]);
                z[first..first + LANES].copy_from_slice(&sum[2]);
            }
        }
        let [a_1, a_2, a_3] = alpha;
        let [w, x, y, z] = turns;
        let mut largest = 0.0f64;
        for first in (0..*intervals).step_by(LANES) {
            let lanes = |v: &Three<Vec<f64>>| -> Three<[f64; LANES]> {
                std::array::from_fn(|c| v[c][first..][..LANES].try_into().expect("lanes"))
            };
            let (one, two, three) = (lanes(a_1), lanes(a_2), lanes(a_3));
            for l in 0..LANES {
                let at = |v: &Three<[f64; LANES]>| [v[0][l], v[1][l], v[2][l]];
                let (one, two, three) = (at(&one), at(&two), at(&three));
                // C₁ = [α₁, α₂], C₂ = −[α₁, 2α₃ + C₁]/60, Ω = α₁ + α₃/12 + [−20α₁ − α₃ + C₁, α₂ + C₂]/240
                let c_1 = cross(two, one);
                let inner: [f64; 3] = std::array::from_fn(|c| 2.0 * three[c] + c_1[c]);
                let c_2 = cross(one, inner).map(|x| x / 60.0);
                let left: [f64; 3] = std::array::from_fn(|c| c_1[c] - 20.0 * one[c] - three[c]);
                let right: [f64; 3] = std::array::from_fn(|c| two[c] + c_2[c]);
                let last = cross(right, left);
                let half: [f64; 3] = std::array::from_fn(|c| 0.5 * (one[c] + three[c] / 12.0 + last[c] / 240.0));
                let square = half[0] * half[0] + half[1] * half[1] + half[2] * half[2];
                let (sinc, cos) = dense::sinc_cos(square);
                largest = largest.max(square);
                w[first + l] = cos;
                x[first + l] = sinc * half[0];
                y[first + l] = sinc * half[1];
                z[first + l] = sinc * half[2];
            }
        }
        // a violent motion on few points: the series does not reach, all angles are too large to be accurate anyway
        if largest >= SERIES {
            for m in 0..*intervals {
                let norm = (w[m] * w[m] + x[m] * x[m] + y[m] * y[m] + z[m] * z[m]).sqrt();
                [w[m], x[m], y[m], z[m]] = [w[m], x[m], y[m], z[m]].map(|x| x / norm);
            }
        }
        let [mut a, mut b, mut c, mut d] = self.drive.2;
        for (m, point) in self.points.iter().enumerate() {
            let (w, x, y, z) = (self.turns[0][m], self.turns[1][m], self.turns[2][m], self.turns[3][m]);
            [a, b, c, d] = [
                a * w - b * x - c * y - d * z,
                a * x + b * w + c * z - d * y,
                a * y - b * z + c * w + d * x,
                a * z + b * y - c * x + d * w,
            ];
            if let Some(i) = *point {
                let [d_1, d_2, t] = &mut self.frame;
                (d_1[0][i], d_1[1][i], d_1[2][i]) =
                    (1.0 - 2.0 * (c * c + d * d), 2.0 * (b * c + a * d), 2.0 * (b * d - a * c));
                (d_2[0][i], d_2[1][i], d_2[2][i]) =
                    (2.0 * (b * c - a * d), 1.0 - 2.0 * (b * b + d * d), 2.0 * (c * d + a * b));
                (t[0][i], t[1][i], t[2][i]) =
                    (2.0 * (b * d + a * c), 2.0 * (c * d - a * b), 1.0 - 2.0 * (b * b + c * c));
            }
        }
    }
}

/// Σ_k row_k x_k for each of the first `n` rows.
#[inline(always)]
fn rows_times<const P: usize, const C: usize>(matrix: &Matrix<P, C>, n: usize, x: &[f64; C]) -> [f64; P] {
    let mut products = [0.0; P];
    for i in 0..n {
        let mut lanes = [0.0; dense::TILE];
        for (row, x) in matrix.0[i].as_chunks::<{ dense::TILE }>().0.iter().zip(x.as_chunks::<{ dense::TILE }>().0) {
            for l in 0..dense::TILE {
                lanes[l] = row[l].mul_add(x[l], lanes[l]);
            }
        }
        products[i] = (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
    }
    products
}

impl<const P: usize, const M: usize, const P2: usize, const M3: usize> Motion for Spatial<P, M, P2, M3> {
    fn start(&self) -> Vec<f64> {
        // with the base, unstressed
        vec![0.0; 2 * M3]
    }

    #[inline(never)]
    fn rates(&mut self, time: f64, y: &[f64], rates: &mut [f64]) {
        let drive = self.drive(time);
        let (y, _) = y.as_chunks::<M3>();
        let (q, q_t) = (&y[0], &y[1]);
        let (by_component, _) = q.as_chunks::<M>();
        self.rotate(by_component.try_into().expect("three components"));
        let (n, frame) = (self.n, &self.frame);

        // A = ∫ d_c P_k
        for x in 0..3 {
            for j in 0..n {
                let (row, _) = self.local[x].0[j].as_chunks_mut::<M>();
                for c in 0..3 {
                    for k in 0..M {
                        row[c][k] = frame[c][x][j] * self.shapes.0[j][k];
                    }
                }
            }
            self.turn[x].0 = [[0.0; M3]; P];
            dense::add_product(&mut self.turn[x], &self.integral, &self.local[x], n, false);
        }
        for i in 0..n {
            let ([d_1, d_2, t], [a_x, a_y, a_z]) = (frame, &self.turn);
            let inertia = 2.0 * self.inertia[i];
            for k in 0..M3 {
                let (x, y, z) = (a_x.0[i][k], a_y.0[i][k], a_z.0[i][k]);
                self.beta.0[i][k] = d_2[0][i] * x + d_2[1][i] * y + d_2[2][i] * z;
                self.beta.0[P + i][k] = -(d_1[0][i] * x + d_1[1][i] * y + d_1[2][i] * z);
                let along = t[0][i] * x + t[1][i] * y + t[2][i] * z;
                self.along.0[i][k] = along;
                self.weighted.0[i][k] = inertia * along;
            }
        }

        // what the velocities alone make of the accelerations
        let spin: Three<[f64; P]> = std::array::from_fn(|x| rows_times(&self.turn[x], n, q_t));
        let slope: Three<[f64; P]> = std::array::from_fn(|x| rows_times(&self.local[x], n, q_t));
        let (base, base_t) = (drive.angular_velocity, drive.angular_acceleration);
        let mut turning = [[0.0; P]; 3];
        for i in 0..n {
            let w = [spin[0][i] + base.x, spin[1][i] + base.y, spin[2][i] + base.z];
            let h = cross(w, [slope[0][i], slope[1][i], slope[2][i]]);
            for c in 0..3 {
                turning[c][i] = h[c];
            }
        }
        let turned = dense::combine(&self.integral, n, [&turning[0], &turning[1], &turning[2]]);
        let mut torque = [[0.0; P]; 3];
        for i in 0..n {
            let w = [spin[0][i] + base.x, spin[1][i] + base.y, spin[2][i] + base.z];
            let t = [frame[2][0][i], frame[2][1][i], frame[2][2][i]];
            let a = [turned[0][i] + base_t.x, turned[1][i] + base_t.y, turned[2][i] + base_t.z];
            let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            let (along, square, accelerated) = (dot(w, t), dot(w, w), dot(a, t));
            let (gyro, sideways) = (cross(w, t), cross(a, t));
            for c in 0..3 {
                self.bias[c][i] = sideways[c] + along * w[c] - square * t[c];
                // J = ρI (1 + t tᵀ), so ω × J ω = ρI (t·ω) ω × t
                torque[c][i] = -self.inertia[i] * (a[c] + accelerated * t[c] + along * gyro[c]);
            }
        }
        let [u_x, u_y, u_z] = dense::combine(&self.mass, n, [&self.bias[0], &self.bias[1], &self.bias[2]]);

        let weight = self.scene.gravity - drive.acceleration;
        let force = drive.tip_force;
        let mut at_points = [0.0; P2];
        let mut twist = [0.0; P];
        for i in 0..n {
            let dot = |c: usize, x: f64, y: f64, z: f64| frame[c][0][i] * x + frame[c][1][i] * y + frame[c][2][i] * z;
            let f_x = self.lever[i] * weight.x + self.weights[i] * force.x - u_x[i];
            let f_y = self.lever[i] * weight.y + self.weights[i] * force.y - u_y[i];
            let f_z = self.lever[i] * weight.z + self.weights[i] * force.z - u_z[i];
            let (m_x, m_y, m_z) = (torque[0][i], torque[1][i], torque[2][i]);
            // β₁ = α·d₂ and β₂ = −α·d₁
            at_points[i] = dot(0, f_x, f_y, f_z) + dot(1, m_x, m_y, m_z);
            at_points[P + i] = dot(1, f_x, f_y, f_z) - dot(0, m_x, m_y, m_z);
            twist[i] = dot(2, m_x, m_y, m_z);
        }
        let [bent] = dense::combine(&self.beta, P2, [&at_points]);
        let [twisted] = dense::combine(&self.along, n, [&twist]);
        let mut right: [f64; M3] = std::array::from_fn(|k| bent[k] + twisted[k] - self.stiffness[k] * q[k]);
        if drive.tip_moment != Vector3::zeros() {
            for x in 0..3 {
                let [tip] = dense::combine(&self.local[x], n, [&self.weights]);
                for k in 0..M3 {
                    right[k] += drive.tip_moment[x] * tip[k];
                }
            }
        }

        for j in 0..n {
            let mass = &self.mass.0[j];
            for a in 0..2 {
                let (x, y, z) = (frame[a][0][j], frame[a][1][j], frame[a][2][j]);
                let (row, _) = self.of_points.0[a * P + j].as_chunks_mut::<P>();
                for b in 0..2 {
                    let d = &frame[b];
                    for k in 0..P {
                        row[b][k] = mass[k] * (x * d[0][k] + y * d[1][k] + z * d[2][k]);
                    }
                }
                row[a][j] += self.inertia[j];
            }
        }
        self.half.0 = [[0.0; M3]; P2];
        dense::add_product(&mut self.half, &self.of_points, &self.beta, P2, false);
        self.matrix.0 = [[0.0; M3]; M3];
        for k in (0..M3).filter(|k| k % M >= self.modes) {
            self.matrix.0[k][k] = 1.0;
        }
        dense::add_product(&mut self.matrix, &self.beta, &self.half, P2, true);
        dense::add_product(&mut self.matrix, &self.along, &self.weighted, n, true);
        dense::solve(&mut self.matrix, &mut right);
        rates[..M3].copy_from_slice(q_t);
        rates[M3..].copy_from_slice(&right);
    }

    fn sample(&mut self, time: f64, y: &[f64]) -> ([f64; 3], [f64; 3]) {
        let mut rates = vec![0.0; y.len()];
        self.rates(time, y, &mut rates);
        let drive = self.drive(time);
        let q_tt: &[f64; M3] = rates[M3..].try_into().expect("padded");
        let beta = rows_times(&self.beta, P2, q_tt);
        let bend: Three<[f64; P]> = std::array::from_fn(|c| {
            let [d_1, d_2] = [&self.frame[0][c], &self.frame[1][c]];
            std::array::from_fn(|i| beta[i] * d_1[i] + beta[P + i] * d_2[i] + self.bias[c][i])
        });
        let along = |weights: &[f64; P], values: &Three<[f64; P]>| {
            Vector3::from_fn(|c, _| (0..self.n).map(|i| weights[i] * values[c][i]).sum::<f64>())
        };
        let tip = drive.position + along(&self.weights, &self.frame[2]);
        let mass = self.scene.mass_per_length * self.scene.length;
        let force = drive.tip_force + (self.scene.gravity - drive.acceleration) * mass - along(&self.lever, &bend);
        (tip.into(), force.into())
    }
}
