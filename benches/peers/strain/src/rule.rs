//! Gauss points along the rod, and integration and differentiation on the polynomials through them.
//!
//! On an element a function is the polynomial through its values at n Gauss points. Curvatures are of fewer Legendre
//! polynomials than there are points, so that what follows from them is integrated well. One element is the global
//! Legendre basis; several let the curvature jump between them.

use nalgebra::DMatrix;

/// Gauss points on one or several elements.
#[derive(Clone, Debug)]
pub struct Rule {
    /// Arc lengths of the points, m.
    pub points: Vec<f64>,
    /// Gauss weights, m.
    pub weights: Vec<f64>,
    /// S: ∫₀^{s_i} f = Σ S_ij f_j.
    pub integral: DMatrix<f64>,
    /// B: the modes' values at the points.
    pub modes: DMatrix<f64>,
    /// ∫ of the squares of the modes, m.
    pub squares: Vec<f64>,
    elements: Vec<Element>,
}

#[derive(Clone, Debug)]
struct Element {
    start: f64,
    length: f64,
    first: usize,
    /// Legendre coefficients from point values.
    coefficients: DMatrix<f64>,
}

/// P_0 … P_n at x.
fn legendre(x: f64, n: usize) -> Vec<f64> {
    let mut p = vec![1.0, x];
    for i in 1..n {
        let next = ((2 * i + 1) as f64 * x * p[i] - i as f64 * p[i - 1]) / (i + 1) as f64;
        p.push(next);
    }
    p
}

/// Points and weights of the n-point Gauss rule on [−1, 1].
fn gauss(n: usize) -> (Vec<f64>, Vec<f64>) {
    let slope = |x: f64, p: &[f64]| n as f64 * (x * p[n] - p[n - 1]) / (x * x - 1.0);
    let root = |i: usize| {
        let guess = -(std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        (0..50).fold(guess, |x, _| {
            let p = legendre(x, n);
            x - p[n] / slope(x, &p)
        })
    };
    let points: Vec<f64> = (0..n).map(root).collect();
    let weight = |&x: &f64| 2.0 / ((1.0 - x * x) * slope(x, &legendre(x, n)).powi(2));
    let weights = points.iter().map(weight).collect();
    (points, weights)
}

impl Rule {
    /// `modes` modes in all on the elements between `cuts` (inner ends, ascending) of [0, length], and `extra` points
    /// more than modes on each.
    pub fn new(length: f64, cuts: &[f64], modes: usize, extra: usize) -> Self {
        let ends: Vec<f64> = [0.0].iter().chain(cuts).chain(&[length]).copied().collect();
        let count = ends.len() - 1;
        let total = modes + count * extra;
        let (mut shapes, mut squares) = (DMatrix::zeros(total, modes), Vec::new());
        let (mut points, mut weights, mut elements) = (Vec::new(), Vec::new(), Vec::new());
        let mut integral = DMatrix::zeros(total, total);
        for e in 0..count {
            let (start, length) = (ends[e], ends[e + 1] - ends[e]);
            let first_mode = e * modes / count;
            let own_modes = (e + 1) * modes / count - first_mode;
            assert!(own_modes > 0, "more elements than modes");
            let (first, n) = (first_mode + e * extra, own_modes + extra);
            let (x, w) = gauss(n);
            let p: Vec<Vec<f64>> = x.iter().map(|&x| legendre(x, n + 1)).collect();
            let coefficients = DMatrix::from_fn(n, n, |k, i| p[i][k] * w[i] * (2 * k + 1) as f64 / 2.0);
            // ∫₋₁ˣ P_k = (P_{k+1} − P_{k−1})/(2k + 1)
            let antiderivative = DMatrix::from_fn(n, n, |i, k| match k {
                0 => x[i] + 1.0,
                k => (p[i][k + 1] - p[i][k - 1]) / (2 * k + 1) as f64,
            });
            for i in 0..n {
                for j in 0..first {
                    integral[(first + i, j)] = weights[j];
                }
            }
            let local = antiderivative * &coefficients * (length / 2.0);
            integral.view_mut((first, first), (n, n)).copy_from(&local);
            for k in 0..own_modes {
                for i in 0..n {
                    shapes[(first + i, first_mode + k)] = p[i][k];
                }
                squares.push(length / (2 * k + 1) as f64);
            }
            points.extend(x.iter().map(|x| start + length * (x + 1.0) / 2.0));
            weights.extend(w.iter().map(|w| w * length / 2.0));
            elements.push(Element { start, length, first, coefficients });
        }
        Self { points, weights, integral, modes: shapes, squares, elements }
    }

    /// Σ_l c_l f(s_l) as weights of the point values of f; all s_l on element `element`.
    fn sample(&self, element: usize, at: &[(f64, f64)]) -> Vec<f64> {
        let Element { start, length, first, coefficients } = &self.elements[element];
        let n = coefficients.nrows();
        let mut row = vec![0.0; self.points.len()];
        for &(s, factor) in at {
            let p = legendre(2.0 * (s - start) / length - 1.0, n);
            for i in 0..n {
                row[first + i] += factor * (0..n).map(|k| p[k] * coefficients[(k, i)]).sum::<f64>();
            }
        }
        row
    }

    /// Short intervals from the base over all points: for each the Magnus moments (α₁, α₂, α₃) of a function as weights
    /// of its values, and the point at the interval's end, if one is there. Every stretch between points is cut in
    /// `parts`.
    pub fn intervals(&self, parts: usize) -> Vec<([Vec<f64>; 3], Option<usize>)> {
        let mut intervals = Vec::new();
        for (e, element) in self.elements.iter().enumerate() {
            let n = element.coefficients.nrows();
            let mut stops: Vec<(f64, Option<usize>)> =
                (element.first..element.first + n).map(|i| (self.points[i], Some(i))).collect();
            if e + 1 < self.elements.len() {
                stops.push((element.start + element.length, None));
            }
            let mut from = element.start;
            for (to, point) in stops {
                let h = (to - from) / parts as f64;
                for part in 0..parts {
                    let middle = from + (part as f64 + 0.5) * h;
                    let reach = 0.15f64.sqrt() * h;
                    let (a, b, c) = (middle - reach, middle, middle + reach);
                    let (first, second) = (15f64.sqrt() * h / 3.0, 10.0 * h / 3.0);
                    let moments = [
                        self.sample(e, &[(b, h)]),
                        self.sample(e, &[(c, first), (a, -first)]),
                        self.sample(e, &[(c, second), (b, -2.0 * second), (a, second)]),
                    ];
                    intervals.push((moments, point.filter(|_| part + 1 == parts)));
                }
                from = to;
            }
        }
        intervals
    }

    /// SᵀWS.
    pub fn double_integral(&self) -> DMatrix<f64> {
        let n = self.points.len();
        let weighted = DMatrix::from_fn(n, n, |i, j| self.weights[i] * self.integral[(i, j)]);
        self.integral.tr_mul(&weighted)
    }

    /// ∫ ∫₀ˢ f = Σ c_j f_j: the c_j.
    pub fn lever(&self) -> Vec<f64> {
        let n = self.points.len();
        (0..n).map(|j| (0..n).map(|i| self.weights[i] * self.integral[(i, j)]).sum()).collect()
    }
}
