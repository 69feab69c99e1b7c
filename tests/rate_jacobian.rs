//! The blocks of the rate formulation against the complex step through eqs 14 to 20 and 23 written slowly, and its
//! elimination against a banded LU.
#![allow(non_snake_case, missing_docs)]

// the oracle's other user reads more of it
#[allow(dead_code)]
#[path = "common/banded.rs"]
mod banded;
#[allow(dead_code)]
#[path = "common/full.rs"]
mod full;
#[path = "common/random.rs"]
mod random;

use banded::Banded;
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::{Boundary, Held, Support};
use cosserat_rod::rate::{
    BOX, Balance, Band, CARRIED, Curvature, Ends, LARGEST, Node, Options, Orientation, Rest, Step, Tip, Unknowns,
};
use cosserat_rod::rod::Rod;
use cosserat_rod::so3;
use cosserat_rod::sweep::Singular;
use nalgebra::{Complex, Matrix3, Vector3};
use random::uniform;

type Vec3 = Vector3<f64>;
type Number = Complex<f64>;
type ComplexVec = Vector3<Number>;

/// The step of the derivatives: nothing is subtracted, its square is below every rounding.
const EPSILON: f64 = 1e-40;
/// Some hundred roundings of numbers of size one to ten.
const TOLERANCE: f64 = 1e-12;

/// Uniform numbers in [−1, 1].
struct Random(u64);

impl Random {
    fn number(&mut self) -> f64 {
        uniform(&mut self.0)
    }
    fn vector(&mut self) -> Vec3 {
        Vec3::from_fn(|_, _| self.number())
    }
    fn positive(&mut self) -> Vec3 {
        self.vector().map(|x| 1.0 + 0.5 * x)
    }
    fn unknowns(&mut self) -> Unknowns {
        Unknowns { u: self.vector(), omega: self.vector(), kappa: self.vector(), n: self.vector() }
    }
    fn node(&mut self) -> Node {
        Node {
            x: self.unknowns(),
            x_t: self.unknowns(),
            v: self.unknowns(),
            v_t: self.unknowns(),
            x_s: self.unknowns(),
            rotation: so3::exp(&(self.vector() * 2.0)),
            position: self.vector(),
            load: self.vector(),
        }
    }
    fn rest(&mut self) -> Rest {
        Rest { kappa: self.vector(), kappa_s: self.vector() }
    }
    fn rod(&mut self) -> Rod {
        Rod {
            stiffness: self.positive(),
            mass_per_length: 1.3,
            inertia_per_length: self.positive(),
            drag: 0.4,
            ..Rod::circular(1.0, 1.0, 1.0, 1.0)
        }
    }
    fn held(&mut self) -> Held {
        let mut three = || [self.number() > 0.0, self.number() > 0.0, self.number() > 0.0];
        Held { translation: three(), rotation: three() }
    }
}

fn complex(v: &Vec3) -> ComplexVec {
    v.map(Number::from)
}

fn times(factor: f64, v: &ComplexVec) -> ComplexVec {
    v.map(|x| x * factor)
}

/// The node's unknowns with what may be moved: x and φ.
#[derive(Clone, Copy)]
struct Moved {
    x: [ComplexVec; 4],
    phi: ComplexVec,
}

impl Moved {
    fn of(node: &Node) -> Self {
        Self { x: node.x.to_array().map(|v| complex(&v)), phi: ComplexVec::zeros() }
    }

    fn nudge(&mut self, i: usize) {
        let v = if i < 12 { &mut self.x[i / 3] } else { &mut self.phi };
        v[i % 3].im = EPSILON;
    }
}

/// One cell: its ends before and after the step, ∂_s x of the first end.
struct Case {
    rod: Rod,
    options: Options,
    time: Scheme,
    dt: f64,
    ds: f64,
    rest: [Rest; 2],
    old: [Node; 2],
    new: [Node; 2],
}

impl Case {
    /// What stands at a node in eqs 14a to 14d: the rates, and everything else; each brought to one side.
    fn sides(&self, i: usize, x: &[ComplexVec; 4], x_s: &[ComplexVec; 4], load: &ComplexVec) -> [ComplexVec; 4] {
        let [u, omega, kappa, n] = x;
        let [u_s, omega_s, kappa_s, n_s] = x_s;
        let Rod { stiffness: K, mass_per_length: rho_A, inertia_per_length: rho_I, drag, .. } = &self.rod;
        let (K, rho_I, d_3) = (complex(K), complex(rho_I), complex(&Vec3::z()));
        let m = K.component_mul(&(kappa - complex(&self.rest[i].kappa)));
        let m_s = K.component_mul(&(kappa_s - complex(&self.rest[i].kappa_s)));
        let f = load - times(*drag, u);
        [
            -(n_s + kappa.cross(n) - times(*rho_A, &omega.cross(u)) + f),
            -(m_s + kappa.cross(&m) + d_3.cross(n) - omega.cross(&rho_I.component_mul(omega))),
            -(omega_s - omega.cross(kappa)),
            -(u_s + kappa.cross(u) - omega.cross(&d_3)),
        ]
    }

    fn mass(&self, x_t: &[ComplexVec; 4]) -> [ComplexVec; 4] {
        let rho_I = complex(&self.rod.inertia_per_length);
        let [u_t, omega_t, kappa_t, _] = x_t;
        [times(self.rod.mass_per_length, u_t), rho_I.component_mul(omega_t), *kappa_t, ComplexVec::zeros()]
    }

    /// Eq 18, and the rows of eq 23, at the nodes as moved.
    fn equations(&self, moved: &[Moved; 2]) -> [Number; LARGEST] {
        let Self { time, dt, ds, old, new, .. } = self;
        let space = &self.options.space;
        let of = |x: &Unknowns| x.to_array().map(|v| complex(&v));
        let each = |f: &dyn Fn(usize) -> ComplexVec| std::array::from_fn::<_, 4, _>(f);
        let mut out = [Number::from(0.0); LARGEST];
        for i in 0..2 {
            let (x, x_old, x_t_old, v_old) = (&moved[i].x, of(&old[i].x), of(&old[i].x_t), of(&old[i].v));
            let factor = (1.0 - time.gamma) / time.gamma;
            let x_t = each(&|k| times(1.0 / (time.gamma * dt), &(x[k] - x_old[k])) - times(factor, &x_t_old[k]));
            let x_s = match i {
                0 => of(&new[0].x_s),
                _ => {
                    let (before, factor) = (of(&new[0].x_s), (1.0 - space.gamma) / space.gamma);
                    each(&|k| times(1.0 / (space.gamma * ds), &(x[k] - moved[0].x[k])) - times(factor, &before[k]))
                }
            };
            let load = complex(&new[i].load) - moved[i].phi.cross(&complex(&new[i].load));
            let mut inertia = self.mass(&each(&|k| times(1.0 - time.alpha, &x_t[k]) + times(time.alpha, &x_t_old[k])));
            let mut rest = self.sides(i, x, &x_s, &load).map(|side| times(1.0 - time.beta, &side));
            match self.options.balance {
                Balance::Averaged => {
                    let before = self.sides(i, &x_old, &of(&old[i].x_s), &complex(&old[i].load));
                    rest = each(&|k| rest[k] + times(time.beta, &before[k]));
                }
                Balance::AtEnd => {
                    let before = self.mass(&v_old);
                    inertia = each(&|k| inertia[k] - times(time.beta, &before[k]));
                }
            }
            let (alpha, beta) = if i == 0 { (space.alpha, space.beta) } else { (1.0 - space.alpha, 1.0 - space.beta) };
            for k in 0..12 {
                out[k] += inertia[k / 3][k % 3] * alpha + rest[k / 3][k % 3] * beta;
            }
        }
        let turn = |moved: &[Moved; 2]| {
            let mean = match self.options.curvature {
                Curvature::First => moved[0].x[2],
                Curvature::Mean => times(0.5, &(moved[0].x[2] + moved[1].x[2])),
            };
            times(*ds, &mean)
        };
        // exp(−Φ) exp(φ_j) exp(Φ + δΦ) = exp(φ_j+1) up to ε²
        let turned = rotation(&-turn(&[Moved::of(&new[0]), Moved::of(&new[1])]))
            * (Matrix3::identity() + cross_matrix(&moved[0].phi))
            * rotation(&turn(moved));
        let half = Number::from(0.5);
        for (i, (a, b)) in [(2, 1), (0, 2), (1, 0)].into_iter().enumerate() {
            out[12 + i] = moved[1].phi[i] - (turned[(a, b)] - turned[(b, a)]) * half;
        }
        out
    }
}

fn cross_matrix(v: &ComplexVec) -> Matrix3<Number> {
    let unit = |i: usize| v.cross(&complex(&Vec3::ith(i, 1.0)));
    Matrix3::from_columns(&[unit(0), unit(1), unit(2)])
}

/// Rodrigues' formula.
fn rotation(phi: &ComplexVec) -> Matrix3<Number> {
    let angle = (phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]).sqrt();
    let hat = cross_matrix(phi);
    let (a, b) = (angle.sin() / angle, (Number::from(1.0) - angle.cos()) / (angle * angle));
    Matrix3::identity() + hat.map(|x| x * a) + (hat * hat).map(|x| x * b)
}

fn cases() -> Vec<Case> {
    let mut random = Random(1);
    let mut cases = Vec::new();
    let third = Scheme { alpha: 0.3, beta: 0.1, gamma: 0.7 };
    for space in [BOX, Scheme::BACKWARD_EULER, third] {
        for time in [Scheme::from_spectral_radius(0.5), third] {
            for balance in [Balance::Averaged, Balance::AtEnd] {
                for curvature in [Curvature::First, Curvature::Mean] {
                    for orientation in [Orientation::Lagging, Orientation::InNewton] {
                        let options = Options { space, balance, curvature, orientation, ..Options::MENDED };
                        let rod = random.rod();
                        let rest = [random.rest(), random.rest()];
                        let old = [random.node(), random.node()];
                        let mut new = [random.node(), random.node()];
                        let (dt, ds) = (0.3, 0.7);
                        let step = Step { rod: &rod, options: &options, time, dt, gravity: Vec3::zeros() };
                        let before = new[0];
                        step.update_slope(&before, &mut new[1], ds);
                        for i in 0..2 {
                            step.update_rates(&old[i], &mut new[i]);
                        }
                        cases.push(Case { rod, options, time, dt, ds, rest, old, new });
                    }
                }
            }
        }
    }
    cases
}

#[test]
fn the_blocks_are_the_derivatives_of_the_equations() {
    for case in cases() {
        let Case { rod, options, time, dt, ds, rest, old, new } = &case;
        let step = Step { rod, options, time: *time, dt: *dt, gravity: Vec3::zeros() };
        let (rest, old, new) = ([&rest[0], &rest[1]], [&old[0], &old[1]], [&new[0], &new[1]]);
        let F = step.residual(rest, old, new);
        let blocks = step.blocks(rest, new, *ds);
        let size = if options.orientation == Orientation::Lagging { 12 } else { LARGEST };
        let here = [Moved::of(new[0]), Moved::of(new[1])];
        let exact = case.equations(&here);
        for i in 0..12 {
            assert!((F[i] - exact[i].re).abs() < TOLERANCE * 10.0, "{options:?}, row {i}: {} {}", F[i], exact[i].re);
        }
        for (end, block) in [blocks.before, blocks.after].iter().enumerate() {
            for column in 0..size {
                let mut moved = here;
                moved[end].nudge(column);
                let derivative = case.equations(&moved).map(|x| x.im / EPSILON);
                for row in 0..size {
                    let (mine, exact) = (block[(row, column)], derivative[row]);
                    let wrong = (mine - exact).abs() / (1.0 + exact.abs());
                    assert!(wrong < TOLERANCE, "{options:?}, end {end}, row {row}, column {column}: {mine} {exact}");
                }
            }
            // nothing else is in them
            assert!(size == LARGEST || block.rows(12, 3).amax() + block.columns(12, 3).amax() == 0.0);
        }
    }
}

#[test]
fn the_known_values_of_the_tip_fade_in_and_out_with_their_derivative() {
    let mut random = Random(2);
    for _ in 0..200 {
        let (rod, rest, node, held) = (random.rod(), random.rest(), random.node(), random.held());
        let tip =
            Tip { axes: so3::exp(&random.vector()), held, translation: random.vector(), rotation: random.vector() };
        let unknown = [random.vector(), random.vector()];
        let x = tip.fade_in(&rod, &rest, &unknown, &node.rotation);
        let again = tip.fade_out(&rod, &rest, &x, &node.rotation);
        // products with rotations: a few roundings
        assert!((0..2).all(|i| (again[i] - unknown[i]).amax() < 1e-14), "{held:?}");
        let columns = tip.columns(&rod, &rest, &x, &node.rotation);
        for column in 0..9 {
            // central differences of a function that is smooth in φ and linear in the rest: O(δ²) + O(roundings/δ)
            let delta = 1e-5;
            let at = |sign: f64| {
                let (mut unknown, mut phi) = (unknown, Vec3::zeros());
                if column < 6 {
                    unknown[column / 3][column % 3] += sign * delta;
                } else {
                    phi[column - 6] += sign * delta;
                }
                tip.fade_in(&rod, &rest, &unknown, &(node.rotation * so3::exp(&phi))).flat()
            };
            let difference = (at(1.0) - at(-1.0)) / (2.0 * delta);
            assert!((difference - columns.column(column)).amax() < 1e-9, "{held:?}, column {column}");
        }
    }
}

#[test]
fn the_reduced_vector_has_twelve_numbers_a_cell_and_comes_back() {
    let mut random = Random(3);
    for cells in 1..5 {
        let (rod, rest) = (random.rod(), random.rest());
        let mut nodes: Vec<Node> = (0..=cells).map(|_| random.node()).collect();
        let tip = Tip {
            axes: so3::exp(&random.vector()),
            held: random.held(),
            translation: random.vector(),
            rotation: random.vector(),
        };
        let at_rest = Boundary::hanging_from(Support::at_rest(Vec3::zeros(), Matrix3::identity()), Vec3::zeros());
        let ends = Ends { support: at_rest.base, base_u: random.vector(), base_omega: random.vector(), tip };
        // the conditions are met first, then Ξ⁻¹ ∘ Ξ changes nothing
        let mut reduced = vec![Vec3::zeros(); 4 * cells];
        ends.fade_out(&rod, &rest, &nodes, &mut reduced);
        ends.fade_in(&rod, &rest, &reduced, &mut nodes);
        let met = nodes.clone();
        ends.fade_out(&rod, &rest, &nodes, &mut reduced);
        ends.fade_in(&rod, &rest, &reduced, &mut nodes);
        for (a, b) in nodes.iter().zip(&met) {
            assert!((a.x.flat() - b.x.flat()).amax() < 1e-14);
        }
        for size in [12, LARGEST] {
            let band = Band::new(cells, size);
            assert_eq!(band.len(), size * cells);
            assert_eq!(band.unknowns(0), CARRIED);
            assert_eq!(band.unknowns(cells), size - CARRIED);
            assert!((1..cells).all(|j| band.unknowns(j) == size));
            assert_eq!(band.first(cells) + band.unknowns(cells), band.len());
        }
    }
}

#[test]
fn the_elimination_is_that_of_the_band_matrix() {
    let mut random = Random(4);
    for size in [12, LARGEST] {
        for cells in [1, 2, 3, 30] {
            let mut band = Band::new(cells, size);
            let mut entries = Vec::new();
            let mut right = vec![0.0; size * cells];
            for j in 0..cells {
                let (near, far) = (band.unknowns(j), band.unknowns(j + 1));
                let (near_first, far_first) = (band.first(j), band.first(j + 1));
                for i in 0..size {
                    // rows of different units
                    let unit = 10f64.powf(3.0 * random.number());
                    for c in 0..near {
                        band.cells[j].before[(i, c)] = unit * random.number();
                    }
                    for c in 0..far {
                        band.cells[j].after[(i, c)] = unit * random.number();
                    }
                    band.cells[j].right[i] = unit * random.number();
                    right[size * j + i] = band.cells[j].right[i];
                }
                for i in 0..size {
                    let mut put = |block: &cosserat_rod::rate::Block, columns: usize, first: usize| {
                        entries.extend((0..columns).map(|c| (size * j + i, first + c, block[(i, c)])));
                    };
                    put(&band.cells[j].before, near, near_first);
                    put(&band.cells[j].after, far, far_first);
                }
            }
            let mut solution = vec![0.0; band.len()];
            band.solve(&mut solution).unwrap();
            let matrix = Banded::of_numbers(size * cells, &entries);
            let (residual, terms) = (matrix.residual(&solution, &right), matrix.size_of_terms(&solution));
            let oracle = Banded::of_numbers(size * cells, &entries).factored().unwrap().solve(&right);
            let largest = oracle.iter().fold(0.0f64, |max, x| max.max(x.abs()));
            for i in 0..solution.len() {
                // backward stable: roundings of the terms, as many as the band is wide
                assert!(residual[i].abs() < 1e-12 * terms[i], "{size}, {cells} cells, row {i}");
                // and as near to the oracle as the condition of such random matrices (1e4) lets them
                assert!((solution[i] - oracle[i]).abs() < 1e-9 * largest, "{size}, {cells} cells, unknown {i}");
            }
        }
    }
}

#[test]
fn a_cell_without_a_pivot_is_named() {
    let mut random = Random(5);
    let mut band = Band::new(4, 12);
    for cell in &mut band.cells {
        cell.before = cell.before.map(|_| random.number());
        cell.after = cell.after.map(|_| random.number());
    }
    // an unknown of node 3 that no cell speaks of
    band.cells[2].after.column_mut(5).fill(0.0);
    band.cells[3].before.column_mut(5).fill(0.0);
    let mut solution = vec![0.0; band.len()];
    assert_eq!(band.solve(&mut solution).unwrap_err(), Singular::Cell(2));
}
