//! Rotations: hat, exp, log, and the tangent map of exp with its derivative.
//!
//! With R(Φ) = exp(Φ̂) and Φ a function of s, the body-frame rate κ = (Rᵀ R_s)^∨ and Φ_s are related by
//!
//! ```text
//! Φ_s = J_r⁻¹(Φ) κ        J_r⁻¹(Φ) = 1 + Φ̂/2 + c(φ) Φ̂²        c = (1 − (φ/2) cot(φ/2)) / φ²
//! κ   = J_r(Φ) Φ_s        J_r(Φ)   = 1 − b(φ) Φ̂ + d(φ) Φ̂²      b = (1 − cos φ)/φ²,  d = (φ − sin φ)/φ³
//! ```
//!
//! (φ = |Φ|; J_r is the right Jacobian of SO(3)). All maps are smooth at Φ = 0 and use series there; J_r⁻¹ ends at φ =
//! 2π, `log` returns |Φ| ≤ π.

use nalgebra::{Matrix3, Vector3, Vector4};
use std::f64::consts::{PI, TAU};

/// Below this φ² the coefficients come from their series: the closed forms lose digits by cancellation there.
const SERIES: f64 = 0.25;

/// The matrix v̂ with v̂ w = v × w.
#[inline]
pub fn hat(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// Adds v̂ + x 1 to a matrix: six sums and three, where those of whole matrices are eighteen.
#[inline]
pub fn add_hat(matrix: &mut Matrix3<f64>, v: &Vector3<f64>, x: f64) {
    let [a, b, c] = &mut matrix.data.0;
    *a = [a[0] + x, a[1] + v.z, a[2] - v.y];
    *b = [b[0] - v.z, b[1] + x, b[2] + v.x];
    *c = [c[0] + v.y, c[1] - v.x, c[2] + x];
}

/// v̂ M.
#[inline]
pub fn hat_times(v: &Vector3<f64>, matrix: &Matrix3<f64>) -> Matrix3<f64> {
    let column = |j: usize| {
        let [x, y, z] = matrix.data.0[j];
        Vector3::new(v.y * z - v.z * y, v.z * x - v.x * z, v.x * y - v.y * x)
    };
    Matrix3::from_columns(&[column(0), column(1), column(2)])
}

/// M diag(d).
#[inline]
pub fn columns_scaled(matrix: &Matrix3<f64>, d: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| matrix[(i, j)] * d[j])
}

/// diag(d) M.
#[inline]
pub fn rows_scaled(d: &Vector3<f64>, matrix: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| d[i] * matrix[(i, j)])
}

/// Aᵀ B where that is symmetric.
#[inline]
pub fn symmetric_product(a: &Matrix3<f64>, b: &Matrix3<f64>) -> Matrix3<f64> {
    let entry = |i: usize, j: usize| a.column(i).dot(&b.column(j));
    let (xy, xz, yz) = (entry(0, 1), entry(0, 2), entry(1, 2));
    Matrix3::new(entry(0, 0), xy, xz, xy, entry(1, 1), yz, xz, yz, entry(2, 2))
}

/// Value of the power series Σ cₙ xⁿ.
#[inline]
fn series<const N: usize>(coefficients: [f64; N], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// sin φ / φ, (1 − cos φ)/φ², (φ − sin φ)/φ³ at φ².
#[inline]
fn exp_coefficients(phi2: f64) -> (f64, f64, f64) {
    if phi2 < SERIES {
        let a =
            [1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0, -1.0 / 39_916_800.0, 1.0 / 6_227_020_800.0];
        let b = [
            0.5,
            -1.0 / 24.0,
            1.0 / 720.0,
            -1.0 / 40_320.0,
            1.0 / 3_628_800.0,
            -1.0 / 479_001_600.0,
            1.0 / 87_178_291_200.0,
        ];
        let d = [
            1.0 / 6.0,
            -1.0 / 120.0,
            1.0 / 5040.0,
            -1.0 / 362_880.0,
            1.0 / 39_916_800.0,
            -1.0 / 6_227_020_800.0,
            1.0 / 1_307_674_368_000.0,
        ];
        (series(a, phi2), series(b, phi2), series(d, phi2))
    } else {
        let phi = phi2.sqrt();
        let (sin, cos) = phi.sin_cos();
        (sin / phi, (1.0 - cos) / phi2, (phi - sin) / (phi2 * phi))
    }
}

/// c(φ) and c'(φ)/φ at φ², from the Bernoulli numbers near 0.
#[inline]
fn inverse_coefficients(phi2: f64) -> (f64, f64) {
    // c = Σ |B₂ₙ| φ²ⁿ⁻² / (2n)!, n ≥ 1
    const C: [f64; 9] = [
        1.0 / 12.0,
        1.0 / 720.0,
        1.0 / 30_240.0,
        1.0 / 1_209_600.0,
        1.0 / 47_900_160.0,
        691.0 / 1_307_674_368_000.0,
        1.0 / 74_724_249_600.0,
        3617.0 / 10_670_622_842_880_000.0,
        43_867.0 / 5_109_094_217_170_944_000.0,
    ];
    if phi2 < SERIES {
        let c = series(C, phi2);
        let mut derivative = [0.0; 8];
        for (n, d) in derivative.iter_mut().enumerate() {
            *d = 2.0 * (n + 1) as f64 * C[n + 1];
        }
        (c, series(derivative, phi2))
    } else {
        let phi = phi2.sqrt();
        let (sin, cos) = (0.5 * phi).sin_cos();
        let cot = cos / sin;
        let c = (1.0 - 0.5 * phi * cot) / phi2;
        // c φ² = 1 − (φ/2) cot(φ/2), differentiated
        let dc = (-0.5 * cot + 0.25 * phi / (sin * sin)) / phi2 - 2.0 * c / phi;
        (c, dc / phi)
    }
}

/// exp(Φ̂), the rotation by the angle |Φ| about Φ (Rodrigues' formula).
#[inline]
pub fn exp(phi: &Vector3<f64>) -> Matrix3<f64> {
    let phi2 = phi.norm_squared();
    let (a, b, _) = exp_coefficients(phi2);
    let mut rotation = phi * phi.transpose() * b;
    let diagonal = 1.0 - b * phi2;
    rotation[(0, 0)] += diagonal;
    rotation[(1, 1)] += diagonal;
    rotation[(2, 2)] += diagonal;
    rotation + hat(&(phi * a))
}

/// Below this x² the rational function of [`arc_sine_rest`] is exact to rounding.
const ARC_SINE: f64 = 0.25;

/// (asin(x)/x − 1)/x² at x²: the rational function of `e_asin.c` in fdlibm, Sun Microsystems 1993, whose relative error
/// is 2⁻⁵⁸.⁷⁵.
#[inline]
fn arc_sine_rest(x2: f64) -> f64 {
    const P: [f64; 6] = [
        0.166_666_666_666_666_66,
        -0.325_565_818_622_400_9,
        0.201_212_532_134_862_93,
        -0.040_055_534_500_679_41,
        0.000_791_534_994_289_814_5,
        3.479_331_075_960_212e-5,
    ];
    const Q: [f64; 5] =
        [1.0, -2.403_394_911_734_414, 2.020_945_760_233_505_7, -0.688_283_971_605_453_3, 0.077_038_150_555_901_94];
    series(P, x2) / series(Q, x2)
}

/// The Φ of least length with exp(Φ̂) = R.
#[inline]
pub fn log(rotation: &Matrix3<f64>) -> Vector3<f64> {
    let r = rotation;
    let axial = Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]) * 0.5; // Φ sin φ/φ
    let cos = 0.5 * (r.trace() - 1.0);
    let sin2 = axial.norm_squared();
    if cos > 0.0 && sin2 < ARC_SINE {
        return axial * (1.0 + sin2 * arc_sine_rest(sin2));
    }
    if cos > -0.8 {
        let x = sin2.sqrt();
        return axial * (x.atan2(cos) / x);
    }
    // near a half turn the axis comes from the quaternion, where it is large
    let q = quaternion(r);
    let v = Vector3::new(q[1], q[2], q[3]);
    let norm = v.norm();
    v * (2.0 * norm.atan2(q[0]) / norm)
}

/// The Φ with exp(Φ̂) = R that is nearest to `reference`, of the two of least length: so Φ stays continuous beyond a
/// half turn.
#[inline]
pub fn log_near(rotation: &Matrix3<f64>, reference: &Vector3<f64>) -> Vector3<f64> {
    let phi = log(rotation);
    // the two are a full turn apart: within a half turn of the reference there is no choice
    if (phi - reference).norm_squared() < PI * PI {
        return phi;
    }
    let angle = phi.norm();
    if angle > 0.0 { phi * (1.0 - TAU / angle) } else { phi }
}

/// J_r(Φ).
#[inline]
pub fn right_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let (_, b, d) = exp_coefficients(phi.norm_squared());
    jacobian(phi, b, d)
}

/// 1 − b Φ̂ + d Φ̂².
#[inline]
fn jacobian(phi: &Vector3<f64>, b: f64, d: f64) -> Matrix3<f64> {
    let mut jacobian = phi * d * phi.transpose();
    add_hat(&mut jacobian, &(phi * -b), 1.0 - d * phi.norm_squared());
    jacobian
}

/// J_r(Φ) and what differentiating it yields, at one Φ.
#[derive(Clone, Copy, Debug)]
pub struct Tangent {
    phi: Vector3<f64>,
    /// b and d, each with its derivative by φ².
    b: [f64; 2],
    d: [f64; 2],
}

/// The coefficients in φ² of the `order`-th derivative by φ² of b (`first` = 2) or d (3), Σ (−φ²)ⁿ / (2n + first)!.
const fn taylor(first: usize, order: usize) -> [f64; 7] {
    let mut derivative = [0.0; 7];
    let (mut n, mut term) = (0, 1.0 / if first == 2 { 2.0 } else { 6.0 });
    while n < 7 + order {
        if n >= order {
            let x = n as f64;
            let powers = [1.0, x, x * (x - 1.0)];
            derivative[n - order] = powers[order] * term;
        }
        term /= -(((2 * n + first + 1) * (2 * n + first + 2)) as f64);
        n += 1;
    }
    derivative
}

impl Tangent {
    /// At Φ.
    #[inline]
    pub fn new(phi: &Vector3<f64>) -> Self {
        const B: [[f64; 7]; 2] = [taylor(2, 0), taylor(2, 1)];
        const D: [[f64; 7]; 2] = [taylor(3, 0), taylor(3, 1)];
        let phi2 = phi.norm_squared();
        let (b, d) = if phi2 < SERIES {
            (B.map(|coefficients| series(coefficients, phi2)), D.map(|coefficients| series(coefficients, phi2)))
        } else {
            let (a, b, d) = exp_coefficients(phi2);
            let half = 0.5 / phi2;
            ([b, (a - 2.0 * b) * half], [d, (b - 3.0 * d) * half])
        };
        Self { phi: *phi, b, d }
    }

    /// The second derivatives of b and d by φ².
    #[inline]
    fn second(&self) -> (f64, f64) {
        const B: [f64; 7] = taylor(2, 2);
        const D: [f64; 7] = taylor(3, 2);
        let phi2 = self.phi.norm_squared();
        if phi2 < SERIES {
            (series(B, phi2), series(D, phi2))
        } else {
            let ([b, b_1], [_, d_1]) = (self.b, self.d);
            let half = 0.5 / phi2;
            let a = 2.0 * (b + b_1 * phi2);
            let a_1 = (phi2.sqrt().cos() - a) * half;
            ((a_1 - 4.0 * b_1) * half, (b_1 - 5.0 * d_1) * half)
        }
    }

    /// Φ.
    #[inline]
    pub fn log(&self) -> &Vector3<f64> {
        &self.phi
    }

    /// J_r(Φ) x.
    #[inline]
    pub fn times(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.mapped(1.0, x)
    }

    /// J_rᵀ(Φ) x.
    #[inline]
    pub fn transposed_times(&self, x: &Vector3<f64>) -> Vector3<f64> {
        // J_rᵀ(Φ) = J_r(−Φ)
        self.mapped(-1.0, x)
    }

    /// x − sign b Φ×x + d Φ×(Φ×x).
    #[inline]
    fn mapped(&self, sign: f64, x: &Vector3<f64>) -> Vector3<f64> {
        let Self { phi, b: [b, _], d: [d, _] } = self;
        let once = phi.cross(x);
        x - once * (sign * b) + phi.cross(&once) * *d
    }

    /// J_r(Φ).
    #[inline]
    pub fn jacobian(&self) -> Matrix3<f64> {
        jacobian(&self.phi, self.b[0], self.d[0])
    }

    /// J_r⁻¹(Φ) x, |Φ| < 2π.
    #[inline]
    pub fn inverse_times(&self, x: &Vector3<f64>) -> Vector3<f64> {
        let Self { phi, b: [b, b_1], .. } = self;
        let once = phi.cross(x);
        // c = −b'/b
        x + once * 0.5 - phi.cross(&once) * (b_1 / b)
    }

    /// J_r⁻¹(Φ), |Φ| < 2π.
    #[inline]
    pub fn inverse(&self) -> Matrix3<f64> {
        let Self { phi, b: [b, b_1], .. } = self;
        jacobian(phi, -0.5, -b_1 / b)
    }

    /// ∂(J_r(Φ) x)/∂Φ.
    #[inline]
    pub fn by_log(&self, x: &Vector3<f64>) -> Matrix3<f64> {
        self.derivative(1.0, x)
    }

    /// ∂(J_r(Φ) x)/∂Φ y.
    #[inline]
    pub fn by_log_times(&self, x: &Vector3<f64>, y: &Vector3<f64>) -> Vector3<f64> {
        let Self { phi, b: [b, b_1], d: [d, d_1] } = self;
        let (once, turned) = (phi.cross(x), y.cross(x));
        let grown = 2.0 * phi.dot(y);
        // of x − b Φ×x + d Φ×(Φ×x)
        phi.cross(&once) * (d_1 * grown) - once * (b_1 * grown) - turned * *b
            + (y.cross(&once) + phi.cross(&turned)) * *d
    }

    /// ∂(J_rᵀ(Φ) x)/∂Φ.
    #[inline]
    pub fn transposed_by_log(&self, x: &Vector3<f64>) -> Matrix3<f64> {
        self.derivative(-1.0, x)
    }

    /// Of x − sign b Φ×x + d Φ×(Φ×x).
    #[inline]
    fn derivative(&self, sign: f64, x: &Vector3<f64>) -> Matrix3<f64> {
        let Self { phi, b: [b, b_1], d: [d, d_1] } = self;
        let once = phi.cross(x);
        let along = phi.cross(&once) * (2.0 * d_1) - once * (2.0 * sign * b_1) - x * *d;
        let mut derivative = along * phi.transpose();
        add_hat(&mut derivative, &(x * (sign * b) - once * *d), d * phi.dot(x));
        derivative
    }

    /// Φ · v and Φ · S Φ of x · J_r(Φ) y = x · y − b Φ · v + d Φ · S Φ, with v and S Φ.
    #[inline]
    fn form(&self, x: &Vector3<f64>, y: &Vector3<f64>) -> (f64, f64, Vector3<f64>, Vector3<f64>) {
        let phi = &self.phi;
        let v = y.cross(x);
        let turned = (y * phi.dot(x) + x * phi.dot(y)) * 0.5 - phi * x.dot(y);
        (phi.dot(&v), phi.dot(&turned), v, turned)
    }

    /// ∂(x · J_r(Φ) y)/∂Φ.
    #[inline]
    pub fn gradient(&self, x: &Vector3<f64>, y: &Vector3<f64>) -> Vector3<f64> {
        let Self { phi, b: [b, b_1], d: [d, d_1] } = self;
        let (by_v, by_s, v, turned) = self.form(x, y);
        turned * (2.0 * d) - v * *b + phi * (2.0 * (d_1 * by_s - b_1 * by_v))
    }

    /// ∂²(x · J_r(Φ) y)/∂Φ².
    #[inline]
    pub fn hessian(&self, x: &Vector3<f64>, y: &Vector3<f64>) -> Matrix3<f64> {
        let Self { phi, b: [_, b_1], d: [d, d_1] } = self;
        let (b_2, d_2) = self.second();
        let (by_v, by_s, v, turned) = self.form(x, y);
        let along = turned * (4.0 * d_1) - v * (2.0 * b_1) + phi * (2.0 * (d_2 * by_s - b_2 * by_v));
        let twice = |i: usize, j: usize| along[i] * phi[j] + along[j] * phi[i] + (x[i] * y[j] + x[j] * y[i]) * d;
        let same = 2.0 * (d_1 * by_s - b_1 * by_v - d * x.dot(y));
        let (xy, xz, yz) = (twice(0, 1), twice(0, 2), twice(1, 2));
        Matrix3::new(twice(0, 0) + same, xy, xz, xy, twice(1, 1) + same, yz, xz, yz, twice(2, 2) + same)
    }
}

/// J_r⁻¹(Φ), |Φ| < 2π.
#[inline]
pub fn inverse_right_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let phi2 = phi.norm_squared();
    let (c, _) = inverse_coefficients(phi2);
    let mut jacobian = phi * phi.transpose() * c + hat(&(phi * 0.5));
    let diagonal = 1.0 - c * phi2;
    jacobian[(0, 0)] += diagonal;
    jacobian[(1, 1)] += diagonal;
    jacobian[(2, 2)] += diagonal;
    jacobian
}

/// Φ_s = J_r⁻¹(Φ) κ and its derivative by Φ at fixed κ.
#[inline]
pub fn rate_of_log(phi: &Vector3<f64>, kappa: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    let (c, dc) = inverse_coefficients(phi.norm_squared());
    let once = phi.cross(kappa);
    let twice = phi.cross(&once);
    let value = kappa + once * 0.5 + twice * c;
    // ∂(Φ×κ) = −κ̂,  ∂(Φ×(Φ×κ)) = −(Φ×κ)^ − Φ̂κ̂,  Φ̂κ̂ = κΦᵀ − (Φ·κ)1
    let dot = phi.dot(kappa) * c;
    let mut derivative = (twice * dc - kappa * c) * phi.transpose() - hat(&(kappa * 0.5 + once * c));
    derivative[(0, 0)] += dot;
    derivative[(1, 1)] += dot;
    derivative[(2, 2)] += dot;
    (value, derivative)
}

/// R with the rounding of many products removed: one Newton step towards RᵀR = 1.
#[inline]
pub fn orthonormalised(rotation: &Matrix3<f64>) -> Matrix3<f64> {
    rotation * (Matrix3::from_diagonal_element(1.5) - rotation.transpose() * rotation * 0.5)
}

/// The rotation of the unit quaternion (w, x, y, z).
pub fn from_quaternion(q: &Vector4<f64>) -> Matrix3<f64> {
    let v = Vector3::new(q[1], q[2], q[3]);
    Matrix3::identity() + hat(&v) * (2.0 * q[0]) + hat(&v) * hat(&v) * 2.0
}

/// Angular velocity and acceleration, in world axes, of the orientation of a quaternion other than zero, normalised on use,
/// from its first two derivatives by time as far as they are given.
pub fn turning(q: &Vector4<f64>, [first, second]: [Option<Vector4<f64>>; 2]) -> [Option<Vector3<f64>>; 2] {
    let per_square = 1.0 / q.norm_squared();
    let vector = |q: &Vector4<f64>| Vector3::new(q[1], q[2], q[3]);
    // twice the vector part of q_t q⁻¹
    let twice = |q_t: &Vector4<f64>| {
        (vector(q_t) * q[0] - vector(q) * q_t[0] - vector(q_t).cross(&vector(q))) * (2.0 * per_square)
    };
    let velocity = first.as_ref().map(twice);
    let acceleration =
        first.zip(second).map(|(first, second)| twice(&second) - twice(&first) * (2.0 * per_square * q.dot(&first)));
    [velocity, acceleration]
}

/// The unit quaternion (w, x, y, z), w ≥ 0, of a rotation (Shepperd's choice of the largest component).
pub fn quaternion(rotation: &Matrix3<f64>) -> Vector4<f64> {
    let r = rotation;
    let trace = r.trace();
    let diagonal = [trace, r[(0, 0)], r[(1, 1)], r[(2, 2)]];
    let largest = (1..4).fold(0, |best, i| if diagonal[i] > diagonal[best] { i } else { best });
    let skew = [r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]];
    let q = match largest {
        0 => Vector4::new(1.0 + trace, skew[0], skew[1], skew[2]),
        i => {
            let (i, j, k) = (i - 1, i % 3, (i + 1) % 3);
            let mut q = Vector4::zeros();
            q[0] = skew[i];
            q[1 + i] = 1.0 + 2.0 * r[(i, i)] - trace;
            q[1 + j] = r[(i, j)] + r[(j, i)];
            q[1 + k] = r[(i, k)] + r[(k, i)];
            q
        }
    };
    let q = q.normalize();
    if q[0] < 0.0 { -q } else { q }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Angles where a branch, a series or the half turn could go wrong.
    const ANGLES: [f64; 14] = [
        0.0,
        1e-300,
        1e-12,
        1e-4,
        0.1,
        0.499_999_999_999,
        0.5,
        0.643,
        1.0,
        2.0,
        2.5,
        3.0,
        std::f64::consts::PI - 1e-6,
        std::f64::consts::PI - 1e-12,
    ];

    fn vectors() -> impl Iterator<Item = Vector3<f64>> {
        let axes =
            [Vector3::x(), -Vector3::y(), Vector3::z(), Vector3::new(0.36, -0.48, 0.8), Vector3::new(-0.6, 0.0, 0.8)];
        ANGLES.iter().flat_map(move |angle| axes.map(|axis| axis * *angle))
    }

    #[test]
    fn exp_is_a_rotation_and_log_its_inverse() {
        for phi in vectors() {
            let rotation = exp(&phi);
            // a few roundings of entries of size 1
            assert!((rotation.transpose() * rotation - Matrix3::identity()).amax() < 1e-15);
            // near the half turn the rotation vector is conditioned like 1/(π − φ) only through its sign: compare
            // rotations
            assert!((exp(&log(&rotation)) - rotation).amax() < 2e-15, "{phi}");
            if phi.norm() < 3.0 {
                assert!((log(&rotation) - phi).norm() <= 4e-15 * (1.0 + phi.norm()), "{phi}");
            }
            let q = quaternion(&rotation);
            assert!((from_quaternion(&q) - rotation).amax() < 1e-15);
        }
    }

    #[test]
    fn products_with_hats_and_diagonals() {
        let (v, matrix) = (Vector3::new(0.3, -0.7, 0.2), Matrix3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0));
        assert!((hat_times(&v, &matrix) - hat(&v) * matrix).amax() < 1e-15);
        let mut sum = matrix;
        add_hat(&mut sum, &v, 0.5);
        assert!((sum - matrix - hat(&v) - Matrix3::identity() * 0.5).amax() < 1e-15);
        assert!((columns_scaled(&matrix, &v) - matrix * Matrix3::from_diagonal(&v)).amax() < 1e-15);
        let scaled = rows_scaled(&v, &matrix);
        assert!((symmetric_product(&matrix, &scaled) - matrix.transpose() * scaled).amax() < 2e-14);
        assert!((rows_scaled(&v, &matrix) - Matrix3::from_diagonal(&v) * matrix).amax() < 1e-15);
    }

    #[test]
    fn log_near_continues_beyond_a_half_turn() {
        let axis = Vector3::new(0.36, -0.48, 0.8);
        let mut phi = Vector3::zeros();
        for i in 0..=600 {
            let angle = f64::from(i) * 0.01;
            phi = log_near(&exp(&(axis * angle)), &phi);
            // sin of the half angle defines the axis: from 5 rad on its rounding is magnified tenfold and more
            assert!((phi - axis * angle).norm() < 1e-12, "{angle}");
        }
    }

    #[test]
    fn jacobians_are_inverse_and_differentiate_exp() {
        let direction = Vector3::new(0.3, -0.7, 0.2);
        for phi in vectors() {
            let product = right_jacobian(&phi) * inverse_right_jacobian(&phi);
            assert!((product - Matrix3::identity()).amax() < 1e-14);
            // exp(Φ)ᵀ exp(Φ + ε e) = exp(ε J_r e) + O(ε²); central difference: O(ε²) = 1e-10
            let eps = 1e-5;
            let forward = log(&(exp(&phi).transpose() * exp(&(phi + direction * eps))));
            let backward = log(&(exp(&phi).transpose() * exp(&(phi - direction * eps))));
            let difference = (forward - backward) / (2.0 * eps);
            assert!((difference - right_jacobian(&phi) * direction).norm() < 1e-9);
        }
    }

    #[test]
    fn the_tangent_map_has_its_derivatives() {
        let (x, y) = (Vector3::new(1.3, -0.4, 2.1), Vector3::new(-0.5, 1.7, 0.6));
        let direction = Vector3::new(0.3, -0.7, 0.2);
        let eps = 1e-5;
        for phi in vectors() {
            let tangent = Tangent::new(&phi);
            assert!((tangent.jacobian() - right_jacobian(&phi)).amax() < 1e-15);
            assert!((tangent.times(&x) - right_jacobian(&phi) * x).norm() < 1e-14);
            assert!((tangent.transposed_times(&x) - right_jacobian(&phi).tr_mul(&x)).norm() < 1e-14);
            assert!((tangent.inverse_times(&x) - inverse_right_jacobian(&phi) * x).norm() < 1e-14);
            assert!((tangent.inverse() - inverse_right_jacobian(&phi)).amax() < 1e-14);
            assert!((tangent.by_log_times(&x, &y) - tangent.by_log(&x) * y).norm() < 1e-14);
            assert!((tangent.gradient(&x, &y) - tangent.by_log(&y).tr_mul(&x)).norm() < 1e-14);
            let difference = |f: &dyn Fn(&Vector3<f64>) -> Vector3<f64>| {
                (f(&(phi + direction * eps)) - f(&(phi - direction * eps))) / (2.0 * eps)
            };
            let by_log = difference(&|phi| right_jacobian(phi) * x);
            assert!((by_log - tangent.by_log(&x) * direction).norm() < 1e-9, "{phi}");
            let by_log = difference(&|phi| right_jacobian(phi).tr_mul(&x));
            assert!((by_log - tangent.transposed_by_log(&x) * direction).norm() < 1e-9, "{phi}");
            let gradient = difference(&|phi| Tangent::new(phi).by_log(&y).tr_mul(&x));
            assert!((gradient - tangent.hessian(&x, &y) * direction).norm() < 1e-9, "{phi}");
        }
        // series and closed form meet
        let at = |phi2: f64| Tangent::new(&(Vector3::new(0.36, -0.48, 0.8) * phi2.sqrt())).hessian(&x, &y);
        assert!((at(SERIES * (1.0 - 1e-15)) - at(SERIES * (1.0 + 1e-15))).amax() < 1e-13);
    }

    #[test]
    fn rate_of_log_has_its_derivative() {
        let kappa = Vector3::new(1.3, -0.4, 2.1);
        let direction = Vector3::new(0.3, -0.7, 0.2);
        for phi in vectors() {
            let (value, derivative) = rate_of_log(&phi, &kappa);
            assert!((value - inverse_right_jacobian(&phi) * kappa).norm() < 1e-14);
            let eps = 1e-5;
            let difference = (rate_of_log(&(phi + direction * eps), &kappa).0
                - rate_of_log(&(phi - direction * eps), &kappa).0)
                / (2.0 * eps);
            assert!((difference - derivative * direction).norm() < 1e-9, "{phi}");
        }
    }
}
