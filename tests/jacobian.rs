//! Every block and residual of `pose::assemble` against an independent one: the equations of a rod, written slowly with
//! dual numbers, differentiated one unknown at a time.
#![allow(non_snake_case, missing_docs)]

#[path = "common/full.rs"]
mod full;
#[path = "common/random.rs"]
mod random;

use cosserat_rod::alpha::{Motion, Rate, Scheme};
use cosserat_rod::boundary::{Boundary, Held, Support};
use cosserat_rod::mesh::{Cell, Gauss, Mesh};
use cosserat_rod::pose::{Memory, Row, Section, State, Time, assemble};
use cosserat_rod::rod::Rod;
use cosserat_rod::so3;
use cosserat_rod::sweep::{Scales, System};
use full::{Full, G, Layout, M, N, PHI, W};
use nalgebra::{Matrix3, Vector3};
use random::uniform;
use std::array::from_fn;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Both sides are exact: some thousand roundings, of sums of up to four stages and of closed forms at angles above 0.2.
const TOLERANCE: f64 = 1e-12;

/// x + ε x', ε² = 0.
#[derive(Clone, Copy)]
struct Dual(f64, f64);

impl Add for Dual {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self(self.0 + o.0, self.1 + o.1)
    }
}
impl Sub for Dual {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self(self.0 - o.0, self.1 - o.1)
    }
}
impl Mul for Dual {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self(self.0 * o.0, self.1 * o.0 + self.0 * o.1)
    }
}
impl Div for Dual {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        Self(self.0 / o.0, (self.1 * o.0 - self.0 * o.1) / (o.0 * o.0))
    }
}
impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}
impl Dual {
    fn sin(self) -> Self {
        Self(self.0.sin(), self.1 * self.0.cos())
    }
    fn cos(self) -> Self {
        Self(self.0.cos(), -self.1 * self.0.sin())
    }
    fn sqrt(self) -> Self {
        Self(self.0.sqrt(), 0.5 * self.1 / self.0.sqrt())
    }
    fn atan2(self, x: Self) -> Self {
        Self(self.0.atan2(x.0), (self.1 * x.0 - self.0 * x.1) / (self.0 * self.0 + x.0 * x.0))
    }
}

/// A vector of dual numbers.
#[derive(Clone, Copy)]
struct Vec([Dual; 3]);

impl Add for Vec {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self(from_fn(|i| self.0[i] + o.0[i]))
    }
}
impl Sub for Vec {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self(from_fn(|i| self.0[i] - o.0[i]))
    }
}
impl Neg for Vec {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.map(|x| -x))
    }
}
impl Mul<Vec> for f64 {
    type Output = Vec;
    fn mul(self, o: Vec) -> Vec {
        Dual(self, 0.0) * o
    }
}
impl Mul<Vec> for Dual {
    type Output = Vec;
    fn mul(self, o: Vec) -> Vec {
        Vec(o.0.map(|x| self * x))
    }
}
impl Vec {
    fn known(v: &Vector3<f64>) -> Self {
        Self(from_fn(|i| Dual(v[i], 0.0)))
    }
    fn dot(&self, o: &Self) -> Dual {
        self.0[0] * o.0[0] + self.0[1] * o.0[1] + self.0[2] * o.0[2]
    }
    fn cross(&self, o: &Self) -> Self {
        let (a, b) = (&self.0, &o.0);
        Self(from_fn(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]))
    }
    /// diag(d) v.
    fn scaled(&self, d: &Vector3<f64>) -> Self {
        Self(from_fn(|i| Dual(d[i], 0.0) * self.0[i]))
    }
}

/// A matrix of dual numbers, by rows.
#[derive(Clone, Copy)]
struct Mat([Vec; 3]);

impl Mat {
    fn known(m: &Matrix3<f64>) -> Self {
        Self(from_fn(|i| Vec(from_fn(|j| Dual(m[(i, j)], 0.0)))))
    }
    fn transpose(&self) -> Self {
        Self(from_fn(|i| Vec(from_fn(|j| self.0[j].0[i]))))
    }
    fn times(&self, o: &Self) -> Self {
        let columns = o.transpose();
        Self(from_fn(|i| Vec(from_fn(|j| self.0[i].dot(&columns.0[j])))))
    }
}
impl Mul<Vec> for Mat {
    type Output = Vec;
    fn mul(self, v: Vec) -> Vec {
        Vec(from_fn(|i| self.0[i].dot(&v)))
    }
}

/// The rotation vector of a rotation by more than 0 and less than π.
fn log(R: &Mat) -> Vec {
    let at = |i: usize, j: usize| R.0[i].0[j];
    let half = Dual(0.5, 0.0);
    let axial = half * Vec([at(2, 1) - at(1, 2), at(0, 2) - at(2, 0), at(1, 0) - at(0, 1)]);
    let sin = axial.dot(&axial).sqrt();
    let cos = half * (at(0, 0) + at(1, 1) + at(2, 2) - Dual(1.0, 0.0));
    sin.atan2(cos) / sin * axial
}

/// J_r(Φ) v.
fn right_jacobian(phi: &Vec, v: &Vec) -> Vec {
    let one = Dual(1.0, 0.0);
    let square = phi.dot(phi);
    let angle = square.sqrt();
    let once = phi.cross(v);
    let twice = phi.cross(&once);
    *v - (one - angle.cos()) / square * once + (angle - angle.sin()) / (square * angle) * twice
}

/// The gradient by Φ of μ · J_r(Φ) g.
fn by_log(phi: &Vec, mu: &Vec, g: &Vec) -> Vec {
    let (one, two, three) = (Dual(1.0, 0.0), Dual(2.0, 0.0), Dual(3.0, 0.0));
    let square = phi.dot(phi);
    let angle = square.sqrt();
    // of the coefficients of Φ × and of Φ × Φ ×, by the angle
    let twice = (angle - angle.sin()) / (square * angle);
    let once_by_angle = angle.sin() / square - two * (one - angle.cos()) / (square * angle);
    let twice_by_angle = (one - angle.cos()) / (square * angle) - three * twice / angle;
    let v = g.cross(mu);
    let across = mu.dot(phi) * g.dot(phi) - square * mu.dot(g);
    (twice_by_angle * across - once_by_angle * v.dot(phi)) / angle * *phi - (one - angle.cos()) / square * v
        + twice * (mu.dot(phi) * *g + g.dot(phi) * *mu - two * mu.dot(g) * *phi)
}

/// The unknowns of a node or a Gauss point; g at points only, and m there in the axes of the section.
#[derive(Clone, Copy)]
struct Unknowns {
    R: Mat,
    w: Vec,
    n: Vec,
    m: Vec,
    g: Vec,
}

/// What a rod's equations are made of, besides the unknowns.
struct Case {
    mesh: Mesh,
    rod: Rod,
    old: State,
    state: State,
    boundary: Boundary,
    time: Time,
}

impl Case {
    fn row(&self) -> Row {
        match self.time {
            Time::Static => Row::Positions,
            Time::Step { row, .. } => row,
            Time::Stage { .. } => Row::Rotations,
        }
    }

    /// The new rate by eqs 17 and 19.
    fn rate(&self, old: &Rate, increment: Vec) -> Vec {
        let Time::Step { scheme: Scheme { alpha, beta, gamma }, dt, .. } = self.time else {
            return Vec::known(&Vector3::zeros());
        };
        let (v_old, auxiliary_old) = (Vec::known(&old.value), Vec::known(&old.auxiliary));
        let auxiliary = 1.0 / (gamma * dt) * increment - (1.0 - gamma) / gamma * auxiliary_old;
        1.0 / (1.0 - beta) * ((1.0 - alpha) * auxiliary + alpha * auxiliary_old - beta * v_old)
    }

    /// First and second rate.
    fn rates(&self, old: &Motion, increment: Vec) -> (Vec, Vec) {
        let v = self.rate(&old.velocity, increment);
        (v, self.rate(&old.acceleration, v - Vec::known(&old.velocity.value)))
    }

    /// ω and ω_t.
    fn spin(&self, old: &Section, memory: &Memory, R: &Mat) -> (Vec, Vec) {
        self.rates(&memory.spin, log(&Mat::known(&old.rotation).transpose().times(R)))
    }

    /// Rᵀm = K (κ − κ̂ + τ κ_t).
    fn stress(&self, cell: &Cell, memory: &Memory, kappa: Vec) -> Vec {
        let kappa_t = self.rate(&memory.strain.velocity, kappa - Vec::known(&memory.kappa));
        let strain = kappa - Vec::known(&cell.kappa_rest) + kappa_t.scaled(&self.rod.damping);
        strain.scaled(&self.rod.stiffness)
    }

    /// All unknowns of the iterate, in the order of [`Layout`]: nodes and points along the rod.
    fn unknowns(&self) -> std::vec::Vec<Unknowns> {
        let zero = Vec::known(&Vector3::zeros());
        let of = |section: &Section, g: Vec| Unknowns {
            R: Mat::known(&section.rotation),
            w: Vec::known(if self.row() == Row::Rotations { &section.acceleration } else { &section.position }),
            n: Vec::known(&section.force),
            m: Vec::known(&section.moment),
            g,
        };
        let stages = self.mesh.rule.stages;
        let mut all = std::vec::Vec::new();
        for (j, cell) in self.mesh.cells.iter().enumerate() {
            all.push(of(&self.state.nodes[j], zero));
            for k in 0..stages {
                let (section, memory) = (&self.state.points[j * stages + k], &self.old.memory[j * stages + k]);
                // g is no variable of the iterate: it is what fulfils the law, which is affine in κ
                let R = Mat::known(&section.rotation);
                let rest = self.stress(cell, memory, zero);
                let unit = self.stress(cell, memory, Vec([Dual(1.0, 0.0); 3])) - rest;
                let need = R.transpose() * Vec::known(&section.moment) - rest;
                let kappa = Vector3::from_fn(|i, _| need.0[i].0 / unit.0[i].0);
                let phi = log(&Mat::known(&self.state.nodes[j].rotation).transpose().times(&R));
                let phi = Vector3::from_fn(|i, _| phi.0[i].0);
                let J = Matrix3::from_fn(|i, c| {
                    right_jacobian(&Vec::known(&phi), &Vec::known(&Vector3::ith(c, 1.0))).0[i].0
                });
                let g = J.lu().solve(&kappa).expect("J_r is regular below 2π");
                let point = of(section, Vec::known(&g));
                all.push(Unknowns { m: R.transpose() * point.m, ..point });
            }
        }
        all.push(of(self.state.tip(), zero));
        all
    }

    /// The residuals of all equations in the order of [`Full`], the base's rotation left out.
    fn residuals(&self, all: &[Unknowns]) -> std::vec::Vec<Vec> {
        let Self { mesh, rod, old, boundary, .. } = self;
        let Gauss { stages, a, b, .. } = &mesh.rule;
        let stages = *stages;
        let e_3 = Vec::known(&Vector3::z());
        let drag = rod.drag / rod.mass_per_length;
        let gravity = Vec::known(&boundary.gravity);
        let base = match self.row() {
            Row::Rotations => boundary.base.acceleration + boundary.base.velocity * drag,
            Row::Positions => boundary.base.position,
        };
        let mut out = match boundary.base.held {
            Held::CLAMPED => vec![all[0].w - Vec::known(&base), Vec::known(&Vector3::zeros())],
            _ => held(&boundary.base, &all[0], all[0].n, all[0].m).to_vec(),
        };
        let mut u_tip = Vec::known(&boundary.base.velocity);

        for (j, cell) in mesh.cells.iter().enumerate() {
            let h = cell.length;
            let first = j * (stages + 1);
            let (start, end) = (&all[first], &all[first + stages + 1]);
            let points = &all[first + 1..][..stages];
            let (mut w_s, mut n_s, mut m_s, mut p, mut p_s) = (vec![], vec![], vec![], vec![], vec![]);
            let turn = |section: &Unknowns| log(&start.R.transpose().times(&section.R));
            // J_rᵀ(Φ) = J_r(−Φ)
            let canonical =
                |section: &Unknowns, moment: Vec| right_jacobian(&-turn(section), &(section.R.transpose() * moment));
            for (k, point) in points.iter().enumerate() {
                let Unknowns { R, w, n, .. } = point;
                let (section, memory) = (&old.points[j * stages + k], &old.memory[j * stages + k]);
                let (omega, omega_t) = self.spin(section, memory, R);
                let r_s = *R * (e_3 + (R.transpose() * *n).scaled(&rod.compliance));
                let pulled = match self.row() {
                    Row::Rotations => {
                        let u_s = omega.cross(&e_3);
                        w_s.push(*R * (omega.cross(&omega.cross(&e_3)) + omega_t.cross(&e_3) + drag * u_s));
                        u_tip = u_tip + h * b[k] * (*R * u_s);
                        *w
                    }
                    Row::Positions => {
                        w_s.push(r_s);
                        let (u, a) = self.rates(&memory.travel, *w - Vec::known(&section.position));
                        a + drag * u
                    }
                };
                n_s.push(rod.mass_per_length * (pulled - gravity));
                let momentum = omega.scaled(&rod.inertia_per_length);
                let rotary = omega_t.scaled(&rod.inertia_per_length) + omega.cross(&momentum);
                m_s.push(*R * rotary - r_s.cross(n));
                let phi = turn(point);
                let stress = self.stress(cell, memory, right_jacobian(&phi, &point.g));
                p.push(right_jacobian(&-phi, &stress));
                p_s.push(canonical(point, m_s[k]) + by_log(&phi, &stress, &point.g));
            }
            let sum = |weights: &dyn Fn(usize) -> f64, slopes: &dyn Fn(usize) -> Vec| {
                (0..stages).fold(Vec::known(&Vector3::zeros()), |sum, l| sum + h * weights(l) * slopes(l))
            };
            out.push(start.n - (end.n - sum(&|l| b[l], &|l| n_s[l])));
            out.push(start.m - (end.m - sum(&|l| b[l], &|l| m_s[l])));
            for (k, point) in points.iter().enumerate() {
                let memory = &old.memory[j * stages + k];
                out.push(turn(point) - sum(&|l| a[k][l], &|l| points[l].g));
                out.push(point.w - (start.w + sum(&|l| a[k][l], &|l| w_s[l])));
                out.push(point.n - (end.n - sum(&|l| b[l] - a[k][l], &|l| n_s[l])));
                out.push(p[k] - (canonical(end, end.m) - sum(&|l| b[l] - a[k][l], &|l| p_s[l])));
                let kappa = right_jacobian(&turn(point), &point.g);
                out.push(self.stress(cell, memory, kappa) - point.m);
            }
            out.push(turn(end) - sum(&|l| b[l], &|l| points[l].g));
            out.push(end.w - (start.w + sum(&|l| b[l], &|l| w_s[l])));
        }

        let tip = &all[all.len() - 1];
        let (section, memory) = (old.tip(), old.tip_memory());
        let (_, omega_t) = self.spin(section, memory, &tip.R);
        let a_tip = match self.row() {
            // the velocity depends on every section; `assemble` leaves its derivative out, and so does this
            Row::Rotations => tip.w - drag * Vec(u_tip.0.map(|u| Dual(u.0, 0.0))),
            Row::Positions => self.rates(&memory.travel, tip.w - Vec::known(&section.position)).1,
        };
        let force = tip.n - Vec::known(&boundary.tip_force) + rod.tip_mass * (a_tip - gravity);
        let moment = tip.m - Vec::known(&boundary.tip_moment) + rod.tip_inertia * (tip.R * omega_t);
        match boundary.tip.held {
            Held::FREE => out.extend([force, moment]),
            _ => out.extend(held(&boundary.tip, tip, force, moment)),
        }
        out
    }
}

/// What is to vanish at an end with a support, on which `force` and `moment` are left: of each coordinate how far it is
/// away, or what does work on it. The work of m on φ is that of J_r(Φ) Rₛᵀ m on δΦ.
fn held(support: &Support, end: &Unknowns, force: Vec, moment: Vec) -> [Vec; 2] {
    let axes = Mat::known(&support.rotation).transpose();
    let phi = log(&axes.times(&end.R));
    let chosen =
        |held: [bool; 3], motion: Vec, work: Vec| Vec(from_fn(|i| if held[i] { motion.0[i] } else { work.0[i] }));
    [
        chosen(support.held.translation, axes * (end.w - Vec::known(&support.position)), axes * force),
        chosen(support.held.rotation, phi, right_jacobian(&phi, &(axes * moment))),
    ]
}

/// Uniform numbers.
struct Random(u64);

impl Random {
    fn number(&mut self) -> f64 {
        0.5 * (1.0 + uniform(&mut self.0))
    }
    /// Components in [−size, size].
    fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| size * (2.0 * self.number() - 1.0))
    }
    /// Components in [size/2, size].
    fn positive(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| size * (0.5 + 0.5 * self.number()))
    }
    /// A rotation by an angle in [least, most].
    fn rotation(&mut self, least: f64, most: f64) -> Matrix3<f64> {
        let angle = least + (most - least) * self.number();
        so3::exp(&(self.vector(1.0).normalize() * angle))
    }
    fn motion(&mut self, size: f64) -> Motion {
        let mut rate = || Rate { auxiliary: self.vector(size), value: self.vector(size) };
        Motion { velocity: rate(), acceleration: rate(), jerk: self.vector(size) }
    }
    /// Turned from `from` by an angle in [least, most].
    fn section(&mut self, from: &Matrix3<f64>, least: f64, most: f64) -> Section {
        Section {
            position: self.vector(1.0),
            rotation: from * self.rotation(least, most),
            // less than a half turn
            turn: Vector3::zeros(),
            force: self.vector(2.0),
            moment: self.vector(2.0),
            acceleration: self.vector(10.0),
        }
    }
}

/// What a case has switched on.
#[derive(Clone, Copy, Debug)]
struct Switches {
    stages: usize,
    time: Option<(Row, f64, f64)>,
    damped: bool,
    dragged: bool,
    extensible: bool,
    loaded: bool,
    held: bool,
}

/// A rod of two unequal cells anywhere in configuration space: nothing fits, all residuals and strains are large. The
/// angles between node and point and between old and new stay in (0.2, 2.4), where the slow formulas lose no digits.
fn case(random: &mut Random, switches: &Switches) -> Case {
    let Switches { stages, time, damped, dragged, extensible, loaded, held } = *switches;
    let on = |switch: bool| if switch { 1.0 } else { 0.0 };
    let rod = Rod {
        stiffness: random.positive(2.0),
        compliance: random.positive(0.5) * on(extensible),
        mass_per_length: 0.5 + random.number(),
        inertia_per_length: random.positive(0.3),
        damping: random.positive(0.2) * on(damped),
        drag: random.number() * on(dragged),
        tip_mass: 0.7 * on(loaded),
        tip_inertia: 0.4 * on(loaded),
    };
    let cells = [0.4, 0.7].map(|length| Cell { length, kappa_rest: random.vector(2.0) });
    let mesh = Mesh { cells: cells.to_vec(), rule: Gauss::new(stages) };
    let base = Support {
        position: random.vector(1.0),
        rotation: random.rotation(0.0, 3.0),
        velocity: random.vector(1.0),
        angular_velocity: random.vector(1.0),
        acceleration: random.vector(5.0),
        held: Held::CLAMPED,
    };
    let mut state = State::at_rest_shape(&mesh, &base);
    let mut old = state.clone();
    for j in 0..3 {
        state.nodes[j] = match j {
            0 => random.section(&base.rotation, 0.1, 1.0),
            _ => random.section(&state.nodes[j - 1].rotation, 0.2, 2.0),
        };
        old.nodes[j] = random.section(&state.nodes[j].rotation, 0.2, 1.5);
    }
    for i in 0..mesh.points() {
        let from = state.nodes[i / stages].rotation;
        state.points[i] = random.section(&from, 0.2, 2.4);
        old.points[i] = random.section(&state.points[i].rotation, 0.2, 1.5);
    }
    for memory in &mut old.memory {
        *memory = Memory {
            spin: random.motion(3.0),
            travel: random.motion(3.0),
            kappa: random.vector(3.0),
            strain: random.motion(3.0),
        };
    }
    let mut boundary = Boundary {
        tip_force: random.vector(2.0),
        tip_moment: random.vector(2.0),
        ..Boundary::hanging_from(base, random.vector(9.81))
    };
    if held {
        // any mix of both ends; the row of the rotations has clamped bases and tips free to travel
        let positions = !matches!(time, Some((Row::Rotations, ..)));
        let mut mix = || [(); 3].map(|()| random.number() < 0.5);
        let (at_base, at_tip) = ([mix(), mix()], [mix(), mix()]);
        let mut support = |section: &Section, [translation, rotation]: [[bool; 3]; 2]| Support {
            held: Held { translation, rotation },
            ..Support::at_rest(random.vector(1.0), section.rotation * random.rotation(0.2, 2.4))
        };
        if positions {
            boundary.base = support(&state.nodes[0], at_base);
        }
        boundary.tip = support(state.tip(), [if positions { at_tip[0] } else { [false; 3] }, at_tip[1]]);
    }
    let time = match time {
        None => Time::Static,
        Some((row, radius, dt)) => Time::Step { scheme: Scheme::from_spectral_radius(radius), dt, row },
    };
    Case { mesh, rod, old, state, boundary, time }
}

/// Blocks and residuals of one case; differences relative to the largest entry of the block, and of the row where the
/// exact block is zero.
fn check(case: &Case, switches: &Switches) -> f64 {
    let Case { mesh, rod, old, state, boundary, time } = case;
    let mut system = System::new(mesh.cells.len(), &mesh.rule, rod.is_extensible());
    let scales = Scales { w: 1.0, force: 1.0, moment: 1.0 };
    assemble(mesh, rod, old, state, boundary, time, &mut system);
    let reported = system.residuals.largest(&scales);
    let full = Full::new(&system, &mesh.rule);
    let layout: Layout = full.layout;
    let size = layout.blocks();
    let mut claimed = vec![vec![Matrix3::zeros(); size]; size];
    for (row, column, block) in &full.entries {
        claimed[*row][*column] += block;
    }

    let mut worst = 0.0f64;
    let all = case.unknowns();
    let values = case.residuals(&all);
    // −e against the right-hand side; the base's rotation in closed form
    let clamped = boundary.base.held == Held::CLAMPED;
    for row in (0..size).filter(|&row| row != 1 || !clamped) {
        let value = Vector3::from_fn(|i, _| -values[row].0[i].0);
        // the law holds by construction of g: its residual is the rounding of terms of the size of its blocks
        let of_size = value.amax().max(claimed[row].iter().map(|b| b.amax()).fold(0.0, f64::max));
        worst = worst.max((value - &full.right[row]).amax() / of_size);
    }
    let largest = (0..size).map(|row| full.right[row].amax()).fold(0.0, f64::max);
    // what is left on a held end is reported in other axes than those of its equations
    let same = switches.held || (reported - largest).abs() <= 1e-15 * largest;
    assert!(same, "the largest residual is {largest}, not {reported}");
    if clamped {
        let corrected = so3::exp(&system.residuals.base.1) * state.nodes[0].rotation;
        worst = worst.max((corrected - boundary.base.rotation).amax());
    }

    let mut exact = vec![vec![Matrix3::zeros(); size]; size];
    let mut sections = vec![];
    for j in 0..layout.cells {
        sections.push((layout.node(j), 4));
        sections.extend((0..layout.stages).map(|k| (layout.point(j, k), 5)));
    }
    sections.push((layout.node(layout.cells), 4));
    for (s, (first, kinds)) in sections.into_iter().enumerate() {
        for kind in 0..kinds {
            for axis in 0..3 {
                let mut moved = all.clone();
                let unknown = &mut moved[s];
                let unit = Vec(from_fn(|i| Dual(0.0, f64::from(i == axis))));
                match kind {
                    // exp(ε φ̂) R = R + ε φ̂ R
                    PHI => {
                        let columns = unknown.R.transpose();
                        let turned = Mat(columns.0.map(|column| column + unit.cross(&column)));
                        unknown.R = turned.transpose();
                    }
                    W => unknown.w = unknown.w + unit,
                    N => unknown.n = unknown.n + unit,
                    M => unknown.m = unknown.m + unit,
                    G => unknown.g = unknown.g + unit,
                    _ => unreachable!(),
                }
                for (row, residual) in case.residuals(&moved).iter().enumerate() {
                    for i in 0..3 {
                        exact[row][first + kind][(i, axis)] = residual.0[i].1;
                    }
                }
            }
        }
    }
    for row in (0..size).filter(|&row| row != 1 || !clamped) {
        let row_size = exact[row].iter().map(|block| block.amax()).fold(0.0, f64::max);
        for column in 0..size {
            let (exact, claimed) = (&exact[row][column], &claimed[row][column]);
            let of_size = if exact.amax() > 0.0 { exact.amax() } else { row_size };
            let difference = (exact - claimed).amax() / of_size;
            assert!(difference < TOLERANCE, "{switches:?}: equation {row}, unknown {column}:\n{exact}{claimed}");
            worst = worst.max(difference);
        }
    }
    worst
}

#[test]
fn blocks_are_exact_derivatives() {
    let mut random = Random(1);
    let mut worst = 0.0f64;
    for stages in 1..=4 {
        for time in [
            None,
            Some((Row::Rotations, 0.0, 0.1)),
            Some((Row::Rotations, 0.6, 0.3)),
            Some((Row::Positions, 0.0, 0.3)),
            Some((Row::Positions, 0.6, 0.1)),
        ] {
            // nothing, each alone, everything
            for switch in [0, 1, 2, 4, 8, 15, 16, 16, 20, 24, 31, 31] {
                let bit = |i: usize| switch >> i & 1 == 1;
                let switches = Switches {
                    stages,
                    time,
                    damped: bit(0),
                    dragged: bit(1),
                    loaded: bit(2),
                    held: bit(4),
                    // the row of the rotations is that of the inextensible rod
                    extensible: bit(3) && !matches!(time, Some((Row::Rotations, ..))),
                };
                let case = case(&mut random, &switches);
                worst = worst.max(check(&case, &switches));
            }
        }
    }
    assert!(worst < TOLERANCE, "{worst}");
}
