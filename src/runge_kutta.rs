//! Runge-Kutta methods with implicit stages of one kind. They know numbers and no rod.
//!
//! ```text
//! Yᵢ = y₀ + h Σ_{j≤i} aᵢⱼ Y'ⱼ          a₁₁ = 0, aᵢᵢ = γ          y₁ = Y_s
//! ```
//!
//! The first stage is the beginning of the step, every other one an implicit equation of the kind that one step of
//! implicit Euler solves. The second stage and all later ones are of order 2 in themselves, so that what is too stiff to
//! be followed does not spoil the order of the rest; the last one is the step (stiffly accurate) and the methods are
//! L-stable: what they cannot follow rests. Applied to x' = v and v' = a in turn it gives both rates of a stage from its x,
//!
//! ```text
//! v = w (x − x₀ − h Σ_{j<i} aᵢⱼ vⱼ)      a = w (v − v₀ − h Σ_{j<i} aᵢⱼ aⱼ)      w = 1/(γ h)
//! ```

use nalgebra::Vector3;
use std::f64::consts::SQRT_2;

/// Most stages of a method.
pub const MAX_STAGES: usize = 6;

type Row = [f64; MAX_STAGES];

/// The coefficients of a method; those of stages that it has not are 0.
#[derive(Debug, PartialEq)]
pub struct RungeKutta {
    /// s, the explicit first stage included.
    pub stages: usize,
    /// Order of the step.
    pub order: i32,
    /// γ.
    pub gamma: f64,
    /// aᵢⱼ, j < i.
    pub a: [Row; MAX_STAGES],
    /// cᵢ: where in the step the stages stand.
    pub c: Row,
    /// The weights of an embedded step of another order.
    embedded: Row,
    /// Weights of Y'ⱼ in what a step of [`TR_BDF2`] in its place would be estimated to err by, over h.
    simple: Row,
}

/// Σ (bⱼ − b̂ⱼ) cⱼ² of [`TR_BDF2`].
const CURVED: f64 = (3.0 * SQRT_2 - 4.0) / 3.0;

/// `ESDIRK4(3)6L[2]SA`, of order 4 and, embedded, 3: C. A. Kennedy, M. H. Carpenter: Diagonally Implicit Runge-Kutta
/// Methods for Ordinary Differential Equations, a Review, NASA/TM-2016-219173, table 16.
pub static ESDIRK4: RungeKutta = RungeKutta {
    stages: 6,
    order: 4,
    gamma: 0.25,
    a: [
        [0.0; MAX_STAGES],
        [0.25, 0.0, 0.0, 0.0, 0.0, 0.0],
        [(1.0 - SQRT_2) / 8.0, (1.0 - SQRT_2) / 8.0, 0.0, 0.0, 0.0, 0.0],
        [(5.0 - 7.0 * SQRT_2) / 64.0, (5.0 - 7.0 * SQRT_2) / 64.0, 7.0 * (1.0 + SQRT_2) / 32.0, 0.0, 0.0, 0.0],
        [
            (-13_796.0 - 54_539.0 * SQRT_2) / 125_000.0,
            (-13_796.0 - 54_539.0 * SQRT_2) / 125_000.0,
            (506_605.0 + 132_109.0 * SQRT_2) / 437_500.0,
            166.0 * (-97.0 + 376.0 * SQRT_2) / 109_375.0,
            0.0,
            0.0,
        ],
        [
            (1181.0 - 987.0 * SQRT_2) / 13_782.0,
            (1181.0 - 987.0 * SQRT_2) / 13_782.0,
            47.0 * (-267.0 + 1783.0 * SQRT_2) / 273_343.0,
            -16.0 * (-22_922.0 + 3525.0 * SQRT_2) / 571_953.0,
            -15_625.0 * (97.0 + 376.0 * SQRT_2) / 90_749_876.0,
            0.0,
        ],
    ],
    c: [0.0, 0.5, (2.0 - SQRT_2) / 4.0, 0.625, 1.04, 1.0],
    embedded: [
        -480_923_228_411.0 / 4_982_971_448_372.0,
        -480_923_228_411.0 / 4_982_971_448_372.0,
        6_709_447_293_961.0 / 12_833_189_095_359.0,
        3_513_175_791_894.0 / 6_748_737_351_361.0,
        -498_863_281_070.0 / 6_042_575_550_617.0,
        2_077_005_547_802.0 / 8_945_017_530_137.0,
    ],
    // by the parabola through the first, the fourth and the last, which stand nearly as those of TR-BDF2
    simple: [8.0 / 5.0 * CURVED, 0.0, 0.0, -64.0 / 15.0 * CURVED, 0.0, 8.0 / 3.0 * CURVED],
};

/// TR-BDF2, of order 2 and, embedded, 3: M. E. Hosea, L. F. Shampine: Analysis and implementation of TR-BDF2, Applied
/// Numerical Mathematics 20, 1996.
pub static TR_BDF2: RungeKutta = RungeKutta {
    stages: 3,
    order: 2,
    gamma: 1.0 - SQRT_2 / 2.0,
    a: [
        [0.0; MAX_STAGES],
        [1.0 - SQRT_2 / 2.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [SQRT_2 / 4.0, SQRT_2 / 4.0, 0.0, 0.0, 0.0, 0.0],
        [0.0; MAX_STAGES],
        [0.0; MAX_STAGES],
        [0.0; MAX_STAGES],
    ],
    c: [0.0, 2.0 - SQRT_2, 1.0, 0.0, 0.0, 0.0],
    embedded: [(1.0 - SQRT_2 / 4.0) / 3.0, (1.0 + 3.0 * SQRT_2 / 4.0) / 3.0, (1.0 - SQRT_2 / 2.0) / 3.0, 0.0, 0.0, 0.0],
    simple: [(SQRT_2 - 1.0) / 3.0, -1.0 / 3.0, (2.0 - SQRT_2) / 3.0, 0.0, 0.0, 0.0],
};

impl RungeKutta {
    /// Weight of Y'ⱼ in the step.
    pub fn weight(&self, j: usize) -> f64 {
        if j == self.stages - 1 { self.gamma } else { self.a[self.stages - 1][j] }
    }

    /// Weight of Y'ⱼ in the difference of the step and the embedded one, which estimates the error of the one of lower order.
    pub fn error_weight(&self, j: usize) -> f64 {
        self.weight(j) - self.embedded[j]
    }

    /// Weight of Y'ⱼ in what a step of [`TR_BDF2`] in its place would be estimated to err by, whatever is smooth.
    pub fn simple_weight(&self, j: usize) -> f64 {
        self.simple[j]
    }

    /// Weights of the stages before stage `i` in what goes on from them: the polynomial through the last `count`, or as
    /// many as there are, at cᵢ.
    pub fn onward(&self, i: usize, count: usize) -> [f64; MAX_STAGES] {
        let c = &self.c;
        let mut weights = [0.0; MAX_STAGES];
        let last = i.saturating_sub(count)..i;
        for j in last.clone() {
            weights[j] = last.clone().filter(|k| *k != j).map(|k| (c[i] - c[k]) / (c[j] - c[k])).product();
        }
        weights
    }
}

/// y, y' and y'' at the fraction x of a step of `h` between the same at its ends: the polynomial of degree 5 through them.
pub fn between(begin: &[Vector3<f64>; 3], end: &[Vector3<f64>; 3], h: f64, x: f64) -> [Vector3<f64>; 3] {
    let [y_0, v_0, a_0] = begin;
    let (v_0, a_0) = (v_0 * h, a_0 * (h * h));
    // what the parabola of the beginning misses at the end
    let y = end[0] - y_0 - v_0 - a_0 * 0.5;
    let v = end[1] * h - v_0 - a_0;
    let a = end[2] * (h * h) - a_0;
    let (c_3, c_4, c_5) = (y * 10.0 - v * 4.0 + a * 0.5, v * 7.0 - y * 15.0 - a, y * 6.0 - v * 3.0 + a * 0.5);
    [
        y_0 + (v_0 + (a_0 * 0.5 + (c_3 + (c_4 + c_5 * x) * x) * x) * x) * x,
        (v_0 + (a_0 + (c_3 * 3.0 + (c_4 * 4.0 + c_5 * (5.0 * x)) * x) * x) * x) / h,
        (a_0 + (c_3 * 6.0 + (c_4 * 12.0 + c_5 * (20.0 * x)) * x) * x) / (h * h),
    ]
}

/// y' there, of the polynomial of degree 3 that grows by `growth` with these slopes at its ends.
pub fn slope_between(growth: &Vector3<f64>, [begin, end]: [&Vector3<f64>; 2], h: f64, x: f64) -> Vector3<f64> {
    let mean = growth / h;
    begin + (mean * 3.0 - begin * 2.0 - end) * (2.0 * x) + (begin + end - mean * 2.0) * (3.0 * x * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    const METHODS: [&RungeKutta; 2] = [&ESDIRK4, &TR_BDF2];

    /// A x, with the diagonal.
    fn times(method: &RungeKutta, x: &Row) -> Row {
        let a =
            |i: usize, j: usize| if i == j && (1..method.stages).contains(&i) { method.gamma } else { method.a[i][j] };
        std::array::from_fn(|i| (0..MAX_STAGES).map(|j| a(i, j) * x[j]).sum())
    }

    #[test]
    fn conditions_of_order_hold() {
        for method in METHODS {
            let RungeKutta { stages, order, c, embedded, .. } = method;
            let one: Row = std::array::from_fn(|i| f64::from(i < *stages));
            let by = |x: &Row, y: &Row| -> Row { std::array::from_fn(|i| x[i] * y[i]) };
            let (ac, c2) = (times(method, c), by(c, c));
            // the trees, and of which order they are
            let trees = [
                (1, one, 1.0),
                (2, *c, 2.0),
                (3, c2, 3.0),
                (3, ac, 6.0),
                (4, by(&c2, c), 4.0),
                (4, by(c, &ac), 8.0),
                (4, times(method, &c2), 12.0),
                (4, times(method, &ac), 24.0),
            ];
            for (n, (tree_order, tree, value)) in trees.iter().enumerate() {
                let holds = |weight: &dyn Fn(usize) -> f64| {
                    let sum: f64 = (0..*stages).map(|j| weight(j) * tree[j]).sum();
                    // roundings of coefficients of size 1
                    (sum - 1.0 / value).abs() < 1e-14
                };
                assert_eq!(holds(&|j| method.weight(j)), tree_order <= order, "order {order}, tree {n}");
                assert_eq!(holds(&|j| embedded[j]), *tree_order <= 3, "order {order}, embedded, tree {n}");
            }
            for i in 1..*stages {
                // stages of order 2
                assert!((times(method, &one)[i] - c[i]).abs() < 1e-14 && (ac[i] - 0.5 * c2[i]).abs() < 1e-14, "{i}");
            }
        }
    }

    #[test]
    fn every_step_tells_what_one_of_order_2_would_err_by() {
        for j in 0..3 {
            assert!((TR_BDF2.simple_weight(j) - TR_BDF2.error_weight(j)).abs() < 1e-15, "{j}");
        }
        for method in METHODS {
            let moment =
                |power| (0..method.stages).map(|j| method.simple_weight(j) * method.c[j].powi(power)).sum::<f64>();
            assert!(moment(0).abs() < 1e-15 && moment(1).abs() < 1e-15 && (moment(2) - CURVED).abs() < 1e-15);
        }
    }

    #[test]
    fn between_its_ends_a_step_is_a_polynomial() {
        // y = 1 + 2 t − t² + t³/2 + 3 t⁴ − t⁵ on [0, h]
        let at = |t: f64| {
            let y = 1.0 + t * (2.0 + t * (-1.0 + t * (0.5 + t * (3.0 - t))));
            let y_t = 2.0 + t * (-2.0 + t * (1.5 + t * (12.0 - 5.0 * t)));
            [y, y_t, -2.0 + t * (3.0 + t * (36.0 - 20.0 * t))].map(|x| Vector3::x() * x)
        };
        let h = 0.7;
        for x in [0.0, 0.3, 1.0] {
            let (found, exact) = (between(&at(0.0), &at(h), h, x), at(x * h));
            assert!((0..3).all(|k| (found[k] - exact[k]).norm() < 1e-13), "{x}: {found:?}");
        }
        // y = t³ − t²
        let slope = |t: f64| Vector3::x() * (3.0 * t * t - 2.0 * t);
        let growth = Vector3::x() * (h.powi(3) - h * h);
        for x in [0.0, 0.3, 1.0] {
            let found = slope_between(&growth, [&slope(0.0), &slope(h)], h, x);
            assert!((found - slope(x * h)).norm() < 1e-14, "{x}: {found}");
        }
    }

    #[test]
    fn what_is_smooth_goes_on() {
        for method in METHODS {
            let c = &method.c;
            for i in 1..method.stages {
                for count in 1..=3 {
                    let weights = method.onward(i, count);
                    for degree in 0..i.min(count) as i32 {
                        let sum: f64 = (0..i).map(|j| weights[j] * c[j].powi(degree)).sum();
                        assert!((sum - c[i].powi(degree)).abs() < 1e-13, "stage {i}, degree {degree}");
                    }
                }
            }
        }
    }

    #[test]
    fn they_damp_what_they_cannot_follow_and_nothing_grows() {
        // |R(iy)| of y' = i y: stages by forward substitution in complex numbers
        let factor = |method: &RungeKutta, y: f64| {
            let mut rates = [(0.0, 0.0); MAX_STAGES];
            let mut last = (1.0, 0.0);
            for i in 0..method.stages {
                let mut known = (1.0, 0.0);
                for j in 0..i {
                    known = (known.0 + method.a[i][j] * rates[j].0, known.1 + method.a[i][j] * rates[j].1);
                }
                let d = if i == 0 { 0.0 } else { method.gamma * y };
                // Y = known / (1 − i d)
                let scale = 1.0 / (1.0 + d * d);
                last = ((known.0 - d * known.1) * scale, (known.1 + d * known.0) * scale);
                rates[i] = (-y * last.1, y * last.0);
            }
            f64::hypot(last.0, last.1)
        };
        for method in METHODS {
            for step in 1..2000 {
                let y = 1.02f64.powi(step - 1000);
                assert!(factor(method, y) <= 1.0 + 1e-12, "{y}: {}", factor(method, y));
            }
            assert!(factor(method, 1e8) < 1e-6);
        }
    }
}
