//! The inextensible, unshearable rod in a plane: an ordinary differential equation in its section angles, integrated by
//! a Rosenbrock method with an error estimate. It has no Newton iteration, and of the equations of [`crate::pose`] only
//! those that a plane leaves; in space both are collocated alike, and differ by the time scheme only.
//!
//! e₁, e₂ span the plane, b = e₁ × e₂ is its normal. A section stands at the angle θ, R = exp(θ b̂) R(θ = 0), and
//!
//! ```text
//! d = cos θ e₁ + sin θ e₂          d⊥ = b × d
//! g_k = Σ a⁻¹_kl (θ_l − θ₀) / h    the curvature about b in a cell, θ₀ the angle of its first node
//! a_s = −ω² d + (β + ν ω) d⊥       a stands for a + ν u with the drag per mass ν, ω = θ_t, β = ω_t
//! n_s = ρA (a − gravity)
//! m_s = ρI β − b · (d × n)
//! G_k = EI (g_k − κ̂ + τ g_t,k) − m_k
//! ```
//!
//! with all integrals by the Gauss rule of the cells: a from the base to the tip, n and m from the loads (and the
//! inertia of the body) at the tip to the base. G(θ, ω, β, t) = 0 is linear in β. With w from [`crate::rosenbrock`] and
//! increments
//!
//! ```text
//! δθ = x      δω = w x − p      δβ = w² x − q̃      q̃ = w p + q
//! ```
//!
//! the equations of a stage are those of [`crate::sweep`] for a plane, in which only the law has residuals; their
//! solution here carries no force and no moment back to the tip, since a stage needs the angles alone.
//!
//! Of the derivatives only one is missing: a body on the tip feels a, not a + ν u, and how u at the tip hangs on the
//! sections is left out, so that a tip mass on a rod with drag lowers the order in time.

use crate::alpha::Motion;
use crate::archive::{Archive, Archived, Corrupt, archived};
use crate::boundary::{Boundary, Drive, Held, Support};
use crate::energy::{Energy, Powers};
use crate::mesh::{self, Curvatures, Gauss, MAX_STAGES, Mesh, Origin, Series};
use crate::pose::{self, Memory, State};
use crate::rod::Rod;
use crate::rosenbrock::Rosenbrock;
use crate::sweep::Singular;
use nalgebra::{Matrix3, Vector3};
use std::array::from_fn;

type Vec3 = Vector3<f64>;
type Mat3 = Matrix3<f64>;

/// Part of a vector that counts as rounding of its other components.
const ROUNDING: f64 = 1e-12;
/// The same of the sections of a rod that has been moved in space.
const STRAY: f64 = 1e-9;
/// Turn of a section within a step up to which its sine and cosine follow from those at the step's beginning, rad.
const SMALL_TURN: f64 = 0.5;

/// One number for each Gauss point of a cell; zero beyond the stages of the rule.
type Lane = [f64; MAX_STAGES];
/// A linear function of the unknowns of a cell, then of w₀ (two components) and φ₀; the last is unused.
type Row = [f64; 8];
/// w, then φ; or n, then m.
type Triple = [f64; 3];
/// A vector and a size of its kind that the rod itself sets.
type Scaled = (Vec3, f64);

#[inline(always)]
fn lane(of: impl FnMut(usize) -> f64) -> Lane {
    from_fn(of)
}

/// Σ columns_l x_l over the `K` points.
#[inline(always)]
fn spread<const K: usize>(columns: &[Lane; MAX_STAGES], x: &Lane) -> Lane {
    let mut sum = lane(|k| columns[0][k] * x[0]);
    for l in 1..K {
        for k in 0..MAX_STAGES {
            sum[k] += columns[l][k] * x[l];
        }
    }
    sum
}

/// In the order in which two lanes add at a time.
#[inline(always)]
fn total(a: &Lane, b: &Lane) -> f64 {
    (a[0] * b[0] + a[2] * b[2]) + (a[1] * b[1] + a[3] * b[3])
}

#[inline(always)]
fn add_scaled<const N: usize>(y: &mut [f64; N], factor: f64, x: &[f64; N]) {
    for k in 0..N {
        y[k] += factor * x[k];
    }
}

/// sin and cos of |x| ≤ [`SMALL_TURN`], their series to the last bit.
#[inline(always)]
fn sin_cos_of_small(x: &Lane) -> (Lane, Lane) {
    const SIN: [f64; 6] =
        [1.0 / 6_227_020_800.0, -1.0 / 39_916_800.0, 1.0 / 362_880.0, -1.0 / 5040.0, 1.0 / 120.0, -1.0 / 6.0];
    const COS: [f64; 7] = [
        -1.0 / 87_178_291_200.0,
        1.0 / 479_001_600.0,
        -1.0 / 3_628_800.0,
        1.0 / 40_320.0,
        -1.0 / 720.0,
        1.0 / 24.0,
        -0.5,
    ];
    let square = x.map(|x| x * x);
    let series = |coefficients: &[f64]| {
        let mut sum = [coefficients[0]; MAX_STAGES];
        for coefficient in &coefficients[1..] {
            for k in 0..MAX_STAGES {
                sum[k] = sum[k] * square[k] + coefficient;
            }
        }
        sum
    };
    let (sin, cos) = (series(&SIN), series(&COS));
    (lane(|k| x[k] + x[k] * (square[k] * sin[k])), lane(|k| 1.0 + square[k] * cos[k]))
}

/// The Gauss rule and its products for a cell of length one; zero beyond its stages.
#[derive(Clone, Debug)]
struct Rule {
    b: Lane,
    /// Columns of a⁻¹.
    slopes: [Lane; MAX_STAGES],
    /// Σ b_k a⁻¹_kl.
    end: Lane,
    /// Rows and columns of b_l − a_kl.
    backward: [Lane; MAX_STAGES],
    backward_columns: [Lane; MAX_STAGES],
    /// Σ (b_l − a_kl), and Σ (b_l − a_kl) a_lm by rows k and by columns m, and Σ b_l a_lm.
    rest: Lane,
    twice: [Lane; MAX_STAGES],
    twice_columns: [Lane; MAX_STAGES],
    twice_0: Lane,
    /// Columns of a.
    forward: [Lane; MAX_STAGES],
}

impl Rule {
    fn new(rule: &Gauss) -> Self {
        let Gauss { stages, a, b, a_inverse, .. } = rule;
        let sum = |term: &dyn Fn(usize) -> f64| (0..*stages).map(term).sum::<f64>();
        let within = |k: usize, value: f64| if k < *stages { value } else { 0.0 };
        let rest = |k: usize, l: usize| within(k, b[l] - a[k][l]);
        let twice = |k: usize, m: usize| sum(&|l| rest(k, l) * a[l][m]);
        Self {
            b: *b,
            slopes: from_fn(|l| lane(|k| within(k.max(l), a_inverse[k][l]))),
            end: lane(|l| within(l, sum(&|k| b[k] * a_inverse[k][l]))),
            backward: from_fn(|k| lane(|l| rest(k, l))),
            backward_columns: from_fn(|l| lane(|k| rest(k, l))),
            rest: lane(|k| sum(&|l| rest(k, l))),
            twice: from_fn(|k| lane(|m| twice(k, m))),
            twice_columns: from_fn(|m| lane(|k| twice(k, m))),
            twice_0: lane(|m| sum(&|l| b[l] * a[l][m])),
            forward: from_fn(|l| lane(|k| a[k][l])),
        }
    }
}

/// The plane and how the sections stand in it.
#[derive(Clone, Copy, Debug)]
struct Frame {
    e: [Vec3; 2],
    normal: Vec3,
    /// b in the body frame.
    axis: Vec3,
    /// [e₁ e₂ b]ᵀ R at θ = 0.
    section: Mat3,
}

impl Frame {
    fn new(normal: Vec3, base: &Mat3) -> Self {
        let e_1 = base.column(2).into_owned();
        let e = [e_1, normal.cross(&e_1)];
        let section = Mat3::from_columns(&[e[0], e[1], normal]).tr_mul(base);
        Self { e, normal, axis: base.tr_mul(&normal), section }
    }

    #[inline(always)]
    fn part(&self, vector: &Vec3) -> [f64; 2] {
        self.e.map(|e| e.dot(vector))
    }

    fn vector(&self, part: [f64; 2]) -> Vec3 {
        self.e[0] * part[0] + self.e[1] * part[1]
    }

    fn rotation(&self, angle: f64) -> Mat3 {
        let (sin, cos) = angle.sin_cos();
        Mat3::from_columns(&[self.vector([cos, sin]), self.vector([-sin, cos]), self.normal]) * self.section
    }

    /// θ of a section, the one next to `near`.
    fn angle(&self, tangent: [f64; 2], near: f64) -> f64 {
        let angle = f64::atan2(tangent[1], tangent[0]);
        let turn = 2.0 * std::f64::consts::PI;
        angle + turn * ((near - angle) / turn).round()
    }
}

/// The rod's numbers in the plane.
#[derive(Clone, Copy, Debug, Default)]
struct Section {
    /// EI about b.
    stiffness: f64,
    /// τ.
    damping: f64,
    /// ρA, ρI about b.
    mass: f64,
    inertia: f64,
    /// ν.
    drag: f64,
    tip_mass: f64,
    tip_inertia: f64,
}

/// A cell.
#[derive(Clone, Copy, Debug)]
struct Cell {
    length: f64,
    /// κ̂ about b.
    rest: f64,
}

/// What acts on the rod at an instant, in the plane.
#[derive(Clone, Copy, Debug, Default)]
struct Ends {
    tangent: [f64; 2],
    angle: f64,
    rate: f64,
    turning: f64,
    velocity: [f64; 2],
    /// a + ν u − gravity.
    acceleration: [f64; 2],
    force: [f64; 2],
    moment: f64,
}

/// How fast that changes.
#[derive(Clone, Copy, Debug, Default)]
struct EndRates {
    /// Of a + ν u.
    acceleration: [f64; 2],
    /// Of the angular acceleration.
    turning: f64,
    force: [f64; 2],
    moment: f64,
}

/// θ, ω and β at the Gauss points of a cell; or what a stage adds to them.
type Points = [Lane; 3];

/// A cell at the beginning of a step, and its part of the factors.
#[derive(Clone, Debug, Default)]
struct Start {
    cos: Lane,
    sin: Lane,
    omega: Lane,
    /// h b E, w by φ.
    along: [Lane; 2],
    /// Φ by the residuals of the law, by p of node 1, by w₀ and φ₀.
    by_law: [Lane; MAX_STAGES],
    by_load: [Lane; 3],
    by_start: [Lane; 3],
    /// p of node 0 by Φ; that of m by the one of n.
    carried: [Lane; 3],
    by_force: [f64; 2],
}

/// A cell in a stage.
#[derive(Clone, Debug, Default)]
struct Stage {
    /// θ from the step's beginning, ω, β; p, q.
    points: Points,
    p: Lane,
    q: Lane,
    cos: Lane,
    sin: Lane,
    /// ρI (β − q̃).
    spin: Lane,
    /// EI (g − κ̂ + τ (g_t − …)).
    law: Lane,
    /// n at the points, and at node 0, beyond that at node 1; of the iterate and of the terms in p and q.
    n: [Lane; 2],
    n_0: [f64; 2],
    source: [Lane; 2],
    source_0: [f64; 2],
    /// The residual of the law, then Φ at w₀ = φ₀ = 0.
    u: Lane,
}

/// How far a step is from the true one, as the method estimates it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Largest displacement of a node, over the rod's length.
    pub position: f64,
    /// The same of the velocities, times the step.
    pub velocity: f64,
}

/// The tip at an instant, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tip {
    /// m.
    pub position: Vec3,
    /// m/s.
    pub velocity: Vec3,
    /// Of the section.
    pub rotation: Mat3,
    /// rad/s.
    pub angular_velocity: Vec3,
}

/// What a motion out of the plane would meet at a Gauss point, in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slice {
    /// Of the rod, by the weight of the point, m.
    pub length: f64,
    /// d.
    pub tangent: [f64; 2],
    /// n, N.
    pub force: [f64; 2],
    /// m, N·m.
    pub moment: f64,
}

/// The rod's numbers out of the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lateral {
    /// EI about d⊥, N·m².
    pub bending: f64,
    /// GJ, N·m².
    pub twist: f64,
    /// ρA, kg/m.
    pub mass: f64,
    /// ρI about d and about d⊥, kg·m.
    pub inertia: [f64; 2],
    /// Of the body at the tip, kg.
    pub tip_mass: f64,
    /// Of the same, kg·m².
    pub tip_inertia: f64,
}

/// The fields of a cell at the instant that is looked at; those of its first node, the rest at the points.
#[derive(Clone, Debug, Default)]
struct Field {
    node: Node,
    cos: Lane,
    sin: Lane,
    position: [Lane; 2],
    velocity: [Lane; 2],
    acceleration: [Lane; 2],
    force: [Lane; 2],
    moment: Lane,
    /// g and its rates.
    strain: Points,
}

/// A node; vectors from that of the base, in the plane.
#[derive(Clone, Copy, Debug, Default)]
struct Node {
    /// θ, ω, β.
    angle: Triple,
    position: [f64; 2],
    velocity: [f64; 2],
    /// a + ν u − gravity.
    acceleration: [f64; 2],
    force: [f64; 2],
    moment: f64,
}

/// A rod in a plane at an instant, as [`Plane::keep`] leaves it.
#[derive(Clone, Debug)]
pub struct Kept {
    cells: Vec<mesh::Cell>,
    points: Vec<Points>,
    frame: Frame,
    section: Section,
    ends: Ends,
    drive: Drive,
}

archived!(Frame { e, normal, axis, section });
archived!(Section { stiffness, damping, mass, inertia, drag, tip_mass, tip_inertia });
archived!(Ends { tangent, angle, rate, turning, velocity, acceleration, force, moment });

impl Archived for Kept {
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
        let Self { cells, points, frame, section, ends, drive } = self;
        cells.visit(archive)?;
        points.resize(cells.len(), Points::default());
        points.as_mut_slice().visit(archive)?;
        frame.visit(archive)?;
        section.visit(archive)?;
        ends.visit(archive)?;
        drive.visit(archive)
    }
}

/// How a cell is bent, as [`crate::refine`] wants to know it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bending {
    /// What the curvature of the law misses at the first node, by the balance of moments, 1/m.
    pub(crate) missed: f64,
    /// As [`Series::coefficients`] has them, of κ − κ̂ of the law, 1/m².
    pub(crate) coefficients: [f64; 2],
    /// Largest |κ − κ̂| of the law at the points, and of the balance at the nodes, 1/m.
    pub(crate) at_points: f64,
    pub(crate) at_nodes: f64,
    /// Largest |κ|, 1/m.
    pub(crate) curvature: f64,
    /// What of the tangent in the middle is across κ.
    pub(crate) tangent: Vec3,
    /// Largest |n|, N.
    pub(crate) force: f64,
    /// Largest |a + ν u| of the nodes, m/s².
    pub(crate) acceleration: f64,
    /// Distance of the tip, m.
    pub(crate) lever: f64,
    /// From end to end, rad.
    pub(crate) turn: f64,
}

impl Bending {
    /// The square of what the coefficients of κ − κ̂ let expect of the next, as they fall, 1/m²: waves that the steps have
    /// not followed are not taken for more. Those of fewer points tell nothing.
    pub(crate) fn next(&self, stages: usize) -> f64 {
        let [low, high] = self.coefficients;
        if stages == MAX_STAGES { high * high / low } else { f64::INFINITY }
    }

    /// The most of what is missed that halves of the cell are to have, 1/m: no more than there is, since at a release moments
    /// are balanced that have not bent the rod yet, and than one expects.
    pub(crate) fn most(&self, stages: usize) -> f64 {
        self.at_points.min(self.next(stages).sqrt())
    }
}

/// A rod in a plane with the storage to move it; after its construction nothing is allocated.
#[derive(Clone, Debug)]
pub struct Plane {
    mesh: Mesh,
    rod: Rod,
    method: &'static Rosenbrock,
    frame: Frame,
    section: Section,
    rule: Rule,
    cells: Vec<Cell>,
    /// The last accepted instant, the one a step before it, the one attempted.
    now: Vec<Points>,
    before: Vec<Points>,
    next: Vec<Points>,
    /// Cell by cell, stage by stage.
    increments: Vec<Points>,
    starts: Vec<Start>,
    stages: Vec<Stage>,
    /// What acts on the rod now, and at the end of the step attempted.
    ends: Ends,
    drive: Drive,
    next_ends: Ends,
    next_drive: Drive,
    fields: Vec<Field>,
    tip: Node,
    /// The instant looked at, and what acts if that is the present.
    looked_at: Boundary,
    looks: u64,
    seen: Option<Drive>,
    look_points: Vec<Points>,
}

/// The rod in the plane with the normal `normal`, if its section and rest curvature let it stay there.
fn section_in(mesh: &Mesh, rod: &Rod, base: &Mat3, normal: &Vec3) -> Option<Section> {
    let axis = base.tr_mul(normal);
    let principal = |numbers: &Vec3| {
        let along = numbers.component_mul(&axis);
        let value = along.dot(&axis);
        ((along - axis * value).amax() <= ROUNDING * value.abs()).then_some(value)
    };
    let curved = |cell: &mesh::Cell| is_parallel(&cell.kappa_rest, &axis, 1.0 / mesh.length());
    let in_plane = axis.z.abs() <= ROUNDING && mesh.cells.iter().all(curved) && !rod.is_extensible();
    let stiffness = principal(&rod.stiffness)?;
    let viscosity = principal(&rod.stiffness.component_mul(&rod.damping))?;
    in_plane.then_some(Section {
        stiffness,
        damping: viscosity / stiffness,
        mass: rod.mass_per_length,
        inertia: principal(&rod.inertia_per_length)?,
        drag: rod.drag_rate(),
        tip_mass: rod.tip_mass,
        tip_inertia: rod.tip_inertia,
    })
}

/// Whether `vector` has no component across `axis` but rounding of its own or of something of size `floor`.
fn is_parallel(vector: &Vec3, axis: &Vec3, floor: f64) -> bool {
    (vector - axis * axis.dot(vector)).norm_squared() <= ROUNDING * ROUNDING * vector.norm_squared().max(floor * floor)
}

/// Whether it has none along `axis`.
fn is_normal(vector: &Vec3, axis: &Vec3, floor: f64) -> bool {
    axis.dot(vector).powi(2) <= ROUNDING * ROUNDING * vector.norm_squared().max(floor * floor)
}

/// The vectors of a drive that lie in the plane and those normal to it, each with a size that is small for this rod.
fn vectors(mesh: &Mesh, rod: &Rod, drive: &Drive) -> ([Scaled; 7], [Scaled; 4]) {
    let Drive { boundary: Boundary { base, tip_force, tip_moment, gravity, .. }, rates } = drive;
    let length = mesh.length();
    let bending = rod.stiffness.xy().amax();
    // the rod's own unit of time, EI and L making the others
    let frequency = (bending / rod.mass_per_length).sqrt() / (length * length);
    let (force, moment) = (bending / (length * length), bending / length);
    let in_plane = [
        (base.velocity, length * frequency),
        (base.acceleration, length * frequency.powi(2)),
        (rates.jerk, length * frequency.powi(3)),
        (*gravity, length * frequency.powi(2)),
        (*tip_force, force),
        (rates.tip_force, force * frequency),
        (base.rotation.column(2).into_owned(), 1.0),
    ];
    let normal = [
        (base.angular_velocity, frequency),
        (rates.angular_acceleration, frequency.powi(2)),
        (*tip_moment, moment),
        (rates.tip_moment, moment * frequency),
    ];
    (in_plane, normal)
}

impl Plane {
    /// Room for the rod on a mesh, in no plane yet: [`Self::enter`] comes next.
    pub fn new(mesh: &Mesh, rod: &Rod, method: &'static Rosenbrock) -> Self {
        let base = Support::at_rest(Vec3::zeros(), Mat3::identity());
        let drive = Drive { boundary: Boundary::hanging_from(base, Vec3::zeros()), rates: Default::default() };
        let count = mesh.cells.len();
        let points = vec![Points::default(); count];
        Self {
            rule: Rule::new(&mesh.rule),
            mesh: mesh.clone(),
            rod: rod.clone(),
            method,
            frame: Frame::new(Vec3::y(), &base.rotation),
            section: Section::default(),
            cells: mesh.cells.iter().map(|cell| Cell { length: cell.length, rest: 0.0 }).collect(),
            now: points.clone(),
            before: points.clone(),
            next: points.clone(),
            look_points: points,
            increments: vec![Points::default(); count * method.stages],
            starts: vec![Start::default(); count],
            stages: vec![Stage::default(); count],
            ends: Ends::default(),
            next_ends: Ends::default(),
            looked_at: drive.boundary,
            looks: 0,
            seen: None,
            drive,
            next_drive: drive,
            fields: vec![Field::default(); count],
            tip: Node::default(),
        }
    }

    /// Takes over a rod in space, at the instant of its last step: in the plane that it lies and moves in, and in which
    /// `drive` leaves it. Whether there is one; without one this is a rod in no plane. The accelerations are those of the
    /// rod in space: [`Self::start`] finds those of the equations.
    pub fn enter(&mut self, state: &State, drive: &Drive) -> bool {
        let base = &drive.boundary.base.rotation;
        let normal = self.normal(state, drive);
        let Some(section) = section_in(&self.mesh, &self.rod, base, &normal) else { return false };
        self.stand_in(Frame::new(normal, base), section);
        self.ends = Ends::default();
        self.holds(drive) && self.take_state(state)
    }

    fn stand_in(&mut self, frame: Frame, section: Section) {
        (self.frame, self.section) = (frame, section);
        for (cell, own) in self.cells.iter_mut().zip(&self.mesh.cells) {
            cell.rest = own.kappa_rest.dot(&frame.axis);
        }
    }

    /// Takes the damping and drag of `rod` for its own.
    pub(crate) fn take_damping(&mut self, rod: &Rod) {
        (self.rod.damping, self.rod.drag) = (rod.damping, rod.drag);
        if let Some(section) = section_in(&self.mesh, &self.rod, &self.drive.boundary.base.rotation, &self.frame.normal)
        {
            self.section = section;
        }
    }

    /// The normal of the only plane that can hold all this; where any can, one with a principal axis of the sections.
    fn normal(&self, state: &State, drive: &Drive) -> Vec3 {
        let Self { mesh, rod, .. } = self;
        let base = &drive.boundary.base.rotation;
        let (in_plane, normal) = vectors(mesh, rod, drive);
        let frequency = normal[0].1;
        let largest = |candidates: &mut dyn Iterator<Item = Scaled>| {
            let bound = |(vector, size): Scaled| (vector.norm() / size, vector);
            candidates
                .map(bound)
                .filter(|(size, _)| *size > ROUNDING)
                .max_by(|a, b| a.0.total_cmp(&b.0))
                .map(|(_, vector)| vector.normalize())
        };
        let bent = mesh.cells.iter().map(|cell| (base * cell.kappa_rest, 1.0 / mesh.length()));
        let turned = state.nodes.windows(2).map(|pair| (pair[0].rotation * pair[1].turn, STRAY / ROUNDING));
        let sections = (0..state.memory.len()).map(|i| state.remembering(i).rotation);
        let moved = sections
            .zip(&state.memory)
            .map(|(rotation, memory)| (rotation * memory.spin.velocity.value, frequency * (STRAY / ROUNDING)));
        let d_3 = base.column(2).into_owned();
        let across = |(vector, size): Scaled| (d_3.cross(&vector) / vector.norm().max(size * ROUNDING), 1.0);
        largest(&mut normal.into_iter().chain(bent).chain(turned).chain(moved))
            .or_else(|| largest(&mut in_plane.into_iter().map(across)))
            .unwrap_or_else(|| base.column(1).into_owned())
    }

    /// The unstressed rod in the plane that all that is given lies in; none if there is no such plane.
    pub fn of(mesh: &Mesh, rod: &Rod, drive: &Drive, method: &'static Rosenbrock) -> Option<Self> {
        let mut plane = Self::new(mesh, rod, method);
        plane.enter(&State::at_rest_shape(mesh, &drive.boundary.base), drive).then_some(plane)
    }

    /// Makes room for `cells` cells, so that [`crate::refine`] allocates nothing up to so many.
    pub fn reserve(&mut self, cells: usize) {
        let count = self.cells.len();
        let most = cells.max(count);
        self.mesh.cells.reserve(most - count);
        self.now.reserve(most - count);
        self.next.reserve(most - count);
        self.resize(most);
        self.resize(count);
    }

    /// Makes room for as many cells, in all but the mesh and the points of the present and the next instant.
    fn resize(&mut self, cells: usize) {
        self.cells.resize(cells, Cell { length: 0.0, rest: 0.0 });
        self.before.resize(cells, Points::default());
        self.look_points.resize(cells, Points::default());
        self.increments.resize(cells * self.method.stages, Points::default());
        self.starts.resize(cells, Start::default());
        self.stages.resize(cells, Stage::default());
        self.fields.resize(cells, Field::default());
    }

    /// Takes these cells in place of its own, for [`Self::enter`] or points of its own to follow.
    pub fn take_mesh(&mut self, cells: &[mesh::Cell]) {
        self.mesh.cells.clear();
        self.mesh.cells.extend_from_slice(cells);
        self.now.resize(cells.len(), Points::default());
        self.next.resize(cells.len(), Points::default());
        self.resize(cells.len());
        for (cell, given) in self.cells.iter_mut().zip(cells) {
            cell.length = given.length;
        }
    }

    /// The cells.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Exchanges the cells for those with these origins in them, and solves for the accelerations as [`Self::start`], if the
    /// energy that the rod then has `fits`; tells whether. The rates of the curvatures are what they were. The rod is one
    /// looked at.
    ///
    /// # Errors
    /// [`Singular`] as of [`Self::start`]; the rod is as before.
    pub(crate) fn remesh(
        &mut self,
        cells: &mut Vec<mesh::Cell>,
        (origins, series): (&[Origin], &Series),
        drive: &Drive,
        curvatures: Curvatures,
        fits: impl FnOnce(&Energy) -> bool,
    ) -> Result<bool, Singular> {
        self.transfer(cells, origins, series, curvatures);
        self.exchange(cells);
        let settles = curvatures == Curvatures::Settled;
        let taken = match settles && self.solve(drive, true).is_err() {
            true => Ok(false),
            false => self.start(drive).map(|()| {
                self.look(1.0, drive);
                fits(&self.energy())
            }),
        };
        if taken != Ok(true) {
            self.exchange(cells);
            self.stand(drive);
        }
        self.next.resize(self.cells.len(), Points::default());
        taken
    }

    /// The points on other cells, in `next`, of the rod as it is looked at.
    fn transfer(&mut self, cells: &[mesh::Cell], origins: &[Origin], series: &Series, curvatures: Curvatures) {
        let mut node = self.fields[0].node.angle;
        self.next.clear();
        for (origin, cell) in origins.iter().zip(cells) {
            let mut strain = Points::default();
            match *origin {
                Origin::Same(old) => strain = self.fields[old].strain,
                Origin::First(old) | Origin::Second(old) => {
                    let stages = self.mesh.rule.stages;
                    let missed = match curvatures {
                        Curvatures::Kept => 0.0,
                        Curvatures::Settled | Curvatures::Balanced => {
                            let bending = self.bending(old, series);
                            let most = bending.most(stages);
                            bending.missed.clamp(-most, most)
                        }
                    };
                    for k in 0..stages {
                        let (_, theta) = origin.at(self.mesh.rule.c[k]);
                        let through = self.mesh.rule.through(theta);
                        for (strain, g) in strain.iter_mut().zip(&self.fields[old].strain) {
                            strain[k] = total(&through, g);
                        }
                        strain[0][k] += self.mesh.rule.beside(theta) * missed;
                    }
                }
                Origin::Pair(old) => {
                    for (half, weights) in series.joined.iter().enumerate() {
                        for (q, strain) in strain.iter_mut().enumerate() {
                            let g = &self.fields[old + half].strain[q];
                            *strain = lane(|k| strain[k] + total(&weights[k], g));
                        }
                    }
                }
            }
            self.next.push(from_fn(|q| {
                let turn = spread::<MAX_STAGES>(&self.rule.forward, &strain[q]);
                lane(|k| if k < self.mesh.rule.stages { node[q] + cell.length * turn[k] } else { 0.0 })
            }));
            for (node, strain) in node.iter_mut().zip(&strain) {
                *node += cell.length * total(&self.rule.b, strain);
            }
        }
    }

    /// Exchanges the cells and the points on them.
    fn exchange(&mut self, cells: &mut Vec<mesh::Cell>) {
        std::mem::swap(&mut self.mesh.cells, cells);
        std::mem::swap(&mut self.now, &mut self.next);
        self.resize(self.mesh.cells.len());
        for (cell, given) in self.cells.iter_mut().zip(&self.mesh.cells) {
            *cell = Cell { length: given.length, rest: given.kappa_rest.dot(&self.frame.axis) };
        }
    }

    /// How a cell is bent at the instant last looked at.
    pub(crate) fn bending(&self, cell: usize, series: &Series) -> Bending {
        let (field, next) = (&self.fields[cell], self.fields.get(cell + 1).map_or(&self.tip, |field| &field.node));
        let per_stiffness = 1.0 / self.section.stiffness;
        let size = |[x, y]: [f64; 2]| (x * x + y * y).sqrt();
        let points = field.moment.map(|m| m * per_stiffness);
        let largest = |numbers: &[f64]| numbers.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let gravity = self.frame.part(&self.looked_at.gravity);
        let accelerated = |node: &Node| size(from_fn(|i| node.acceleration[i] + gravity[i]));
        Bending {
            missed: field.node.moment * per_stiffness - total(&series.start, &points),
            coefficients: series.coefficients(&points),
            at_points: largest(&points),
            at_nodes: largest(&[field.node.moment, next.moment]) * per_stiffness,
            curvature: largest(&field.strain[0]),
            tangent: Vec3::new(field.cos[self.mesh.rule.stages / 2], field.sin[self.mesh.rule.stages / 2], 0.0),
            force: size(field.node.force).max(size(next.force)),
            acceleration: accelerated(&field.node).max(accelerated(next)),
            lever: size(from_fn(|i| self.tip.position[i] - field.node.position[i])),
            turn: (next.angle[0] - field.node.angle[0]).abs(),
        }
    }

    /// As [`Energy::large`], of what acts now.
    pub(crate) fn large(&self) -> f64 {
        Energy::large(&self.rod, self.mesh.length(), &self.looked_at.gravity)
    }

    /// EI about the normal of the plane.
    pub(crate) fn stiffness(&self) -> f64 {
        self.section.stiffness
    }

    /// Whether what acts on the rod leaves it in its plane, clamped at the base and free at the tip.
    pub fn holds(&self, drive: &Drive) -> bool {
        let (in_plane, normal) = vectors(&self.mesh, &self.rod, drive);
        let Boundary { base, tip, .. } = &drive.boundary;
        let b = &self.frame.normal;
        base.held == Held::CLAMPED
            && tip.held == Held::FREE
            && is_parallel(&(base.rotation * self.frame.axis), b, 1.0)
            && in_plane.iter().all(|(vector, size)| is_normal(vector, b, *size))
            && normal.iter().all(|(vector, size)| is_parallel(vector, b, *size))
    }

    #[inline]
    fn ends_of(&self, drive: &Drive, old: &Ends) -> Ends {
        let Boundary { base, tip_force, tip_moment, gravity, .. } = &drive.boundary;
        let (frame, drag) = (&self.frame, self.section.drag);
        let tangent = frame.part(&base.rotation.column(2).into_owned());
        let angle = if tangent == old.tangent { old.angle } else { frame.angle(tangent, old.angle) };
        let (velocity, acceleration, gravity) =
            (frame.part(&base.velocity), frame.part(&base.acceleration), frame.part(gravity));
        Ends {
            tangent,
            angle,
            rate: frame.normal.dot(&base.angular_velocity),
            turning: frame.normal.dot(&drive.rates.angular_acceleration),
            velocity,
            acceleration: from_fn(|i| acceleration[i] + drag * velocity[i] - gravity[i]),
            force: frame.part(tip_force),
            moment: frame.normal.dot(tip_moment),
        }
    }

    /// Solves the equations of motion for the angular accelerations: at a start, and where a load jumps.
    ///
    /// # Errors
    /// [`Singular`] names the first cell, seen from the tip, that cannot be solved.
    pub fn start(&mut self, drive: &Drive) -> Result<(), Singular> {
        self.solve(drive, false)?;
        self.stand(drive);
        Ok(())
    }

    /// Solves the equations of motion for the angular accelerations, or, of a rod that `settles`, in one iteration for the
    /// angles at which it has those that it has.
    fn solve(&mut self, drive: &Drive, settles: bool) -> Result<(), Singular> {
        match self.mesh.rule.stages {
            1 => self.solve_by::<1>(drive, settles),
            2 => self.solve_by::<2>(drive, settles),
            3 => self.solve_by::<3>(drive, settles),
            _ => self.solve_by::<4>(drive, settles),
        }
    }

    /// The present becomes a start.
    fn stand(&mut self, drive: &Drive) {
        (self.ends, self.drive) = (self.ends_of(drive, &self.ends), *drive);
        self.before.copy_from_slice(&self.now);
        self.increments.fill(Points::default());
        self.seen = None;
        self.look(1.0, drive);
    }

    fn solve_by<const K: usize>(&mut self, drive: &Drive, settles: bool) -> Result<(), Singular> {
        let ends = self.ends_of(drive, &self.ends);
        self.begin::<K>();
        for stage in &mut self.stages {
            (stage.p, stage.q) = Default::default();
            if !settles {
                stage.points[2] = Lane::default();
            }
        }
        self.residuals::<K>(&ends, 0.0, 0.0, 0.0);
        self.factorise::<K>(if settles { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] })?;
        self.carry::<K>([0.0; 3]);
        let mut node = [0.0; 3];
        for ((points, start), stage) in self.now.iter_mut().zip(&self.starts).zip(&self.stages) {
            let found = follow::<K>(&self.rule, start, &stage.u, &mut node);
            match settles {
                true => add_scaled(&mut points[0], 1.0, &found),
                false => points[2] = found,
            }
        }
        Ok(())
    }

    /// A step of `h` s under `drive`, a function of the time since the step's beginning; what acts on the rod at its
    /// beginning, and how fast it changes there, hold for the derivative by time. Nothing changes before
    /// [`Self::accept`].
    ///
    /// # Errors
    /// [`Singular`] names the first cell, seen from the tip, that cannot be solved.
    pub fn attempt(&mut self, drive: &impl Fn(f64) -> Drive, h: f64) -> Result<Estimate, Singular> {
        match self.mesh.rule.stages {
            1 => self.attempt_by::<1>(drive, h),
            2 => self.attempt_by::<2>(drive, h),
            3 => self.attempt_by::<3>(drive, h),
            _ => self.attempt_by::<4>(drive, h),
        }
    }

    fn attempt_by<const K: usize>(&mut self, drive: &impl Fn(f64) -> Drive, h: f64) -> Result<Estimate, Singular> {
        let method = self.method;
        let w = 1.0 / (method.gamma * h);
        let mut at_stage = drive(0.0);
        let mut ends = self.ends_of(&at_stage, &self.ends);
        let rates = self.rates_of(&at_stage, drive, h);
        let (rate, turning) = (ends.rate, ends.turning);
        let body_drag = self.section.tip_mass * self.section.drag;
        let a_b = self.frame.part(&at_stage.boundary.base.acceleration);
        let mut node = [0.0; 3];
        self.begin::<K>();
        for i in 0..method.stages {
            if i > 0 && method.nodes[i] != method.nodes[i - 1] {
                at_stage = drive(method.nodes[i] * h);
                ends = self.ends_of(&at_stage, &ends);
            }
            let time = h * method.rates[i];
            let p_0 = time * (w * rate - turning);
            let q_0 = time * (w * w * rate - rates.turning);
            let load = [
                time * (rates.force[0] + body_drag * a_b[0]),
                time * (rates.force[1] + body_drag * a_b[1]),
                time * rates.moment,
            ];
            if i == 0 {
                self.residuals::<K>(&ends, w, p_0, q_0);
                self.factorise::<K>([1.0, w, w * w])?;
                self.carry::<K>(load);
            } else {
                self.next_stage::<K>(i, node, 1.0 / h, &ends, [w, p_0, q_0], load);
            }
            node = [time * rates.acceleration[0], time * rates.acceleration[1], time * rate];
        }
        (self.next_ends, self.next_drive) = (ends, at_stage);
        Ok(self.finish::<K>(h, w, node))
    }

    /// Ends stage `i` − 1, for which the base moves by `node`, and takes stage `i` as far, `load` being what its loads
    /// change by: once to the tip and once back, as of many cells the memory costs more than what is done.
    fn next_stage<const K: usize>(
        &mut self,
        i: usize,
        mut node: Triple,
        per_step: f64,
        ends: &Ends,
        [w, p_0, q_0]: [f64; 3],
        mut load: Triple,
    ) {
        let Self { rule, section, method, cells, now, increments, starts, stages, .. } = self;
        let mut sums = Sums::at_base(rule, section, ends, [w, p_0, q_0]);
        let increments = increments.chunks_exact_mut(method.stages);
        for ((((stage, start), now), cell), increments) in
            stages.iter_mut().zip(&*starts).zip(&*now).zip(&*cells).zip(increments)
        {
            increments[i - 1] = stage.increment::<K>(rule, start, w, &mut node);
            stage.combine(start, now, &increments[..i], method.a[i], method.c[i], per_step);
            sums.pass::<K>(cell, start, now, stage);
        }
        let mut loads = sums.at_tip(ends);
        for (j, ((stage, start), cell)) in stages.iter_mut().zip(&*starts).zip(&*cells).enumerate().rev() {
            loads.pass::<K>(rule, cell, start, stage);
            stage.carry::<K>(start, &mut load, j > 0);
        }
    }

    /// The last stage is the error, and the rest of the step.
    fn finish<const K: usize>(&mut self, h: f64, w: f64, mut node: Triple) -> Estimate {
        let (mut way, mut speed) = ([0.0; 2], [0.0; 2]);
        let mut most = [0.0; 2];
        let last = self.method.stages - 1;
        for (j, cell) in self.cells.iter().enumerate() {
            let (stage, start, now) = (&self.stages[j], &self.starts[j], &self.now[j]);
            let increment = stage.increment::<K>(&self.rule, start, w, &mut node);
            self.increments[j * self.method.stages + last] = increment;
            let next = &mut self.next[j];
            for k in 0..MAX_STAGES {
                next[0][k] = now[0][k] + (stage.points[0][k] + increment[0][k]);
                next[1][k] = stage.points[1][k] + increment[1][k];
                next[2][k] = stage.points[2][k] + increment[2][k];
            }
            let weights = lane(|k| cell.length * self.rule.b[k]);
            let across = [lane(|k| weights[k] * start.sin[k]), lane(|k| weights[k] * start.cos[k])];
            for i in 0..2 {
                way[i] += total(&across[i], &increment[0]);
                speed[i] += total(&across[i], &increment[1]);
            }
            // a maximum would drop what is not a number; the tip has the sum of all, and comes last
            for (most, [x, y]) in most.iter_mut().zip([way, speed]) {
                let square = x * x + y * y;
                *most = if square <= *most { *most } else { square };
            }
        }
        let length: f64 = self.cells.iter().map(|cell| cell.length).sum();
        Estimate { position: most[0].sqrt() / length, velocity: h * most[1].sqrt() / length }
    }

    /// Makes the end of the attempted step the present.
    pub fn accept(&mut self) {
        std::mem::swap(&mut self.before, &mut self.now);
        std::mem::swap(&mut self.now, &mut self.next);
        self.exchange_ends();
    }

    /// Takes [`Self::accept`] back: the beginning of that step is the present again, and its end the attempt. There is no
    /// looking back into the step before.
    pub(crate) fn take_back(&mut self) {
        std::mem::swap(&mut self.now, &mut self.next);
        std::mem::swap(&mut self.before, &mut self.now);
        self.exchange_ends();
    }

    fn exchange_ends(&mut self) {
        std::mem::swap(&mut self.ends, &mut self.next_ends);
        std::mem::swap(&mut self.drive, &mut self.next_drive);
        self.seen = None;
    }

    fn rates_of(&self, now: &Drive, drive: &impl Fn(f64) -> Drive, h: f64) -> EndRates {
        let rates = &now.rates;
        let (jerk, a) = (self.frame.part(&rates.jerk), self.frame.part(&now.boundary.base.acceleration));
        let about = |drive: &Drive| self.frame.normal.dot(&drive.rates.angular_acceleration);
        // the angle at the tip, where a body has inertia, hangs on that of the base, whose third derivative nobody gives
        let turning = match self.section.tip_inertia > 0.0 {
            true => (4.0 * about(&drive(0.5 * h)) - 3.0 * about(now) - about(&drive(h))) / h,
            false => 0.0,
        };
        EndRates {
            acceleration: from_fn(|i| jerk[i] + self.section.drag * a[i]),
            turning,
            force: self.frame.part(&rates.tip_force),
            moment: self.frame.normal.dot(&rates.tip_moment),
        }
    }

    /// Where the step begins is where its first stage stands.
    fn begin<const K: usize>(&mut self) {
        for ((start, stage), points) in self.starts.iter_mut().zip(&mut self.stages).zip(&self.now) {
            for k in 0..K {
                (start.sin[k], start.cos[k]) = points[0][k].sin_cos();
            }
            start.omega = points[1];
            stage.points = [Lane::default(), points[1], points[2]];
            (stage.p, stage.q) = (points[1], points[2]);
            (stage.cos, stage.sin) = (start.cos, start.sin);
        }
    }

    /// −G of the stage, and G_ν p + G_β q̃, of all cells; p₀ and q̃₀ are those of the base.
    fn residuals<const K: usize>(&mut self, ends: &Ends, w: f64, p_0: f64, q_0: f64) {
        let Self { rule, section, cells, stages, starts, now, .. } = self;
        let mut sums = Sums::at_base(rule, section, ends, [w, p_0, q_0]);
        for (((stage, start), now), cell) in stages.iter_mut().zip(&*starts).zip(&*now).zip(&*cells) {
            sums.pass::<K>(cell, start, now, stage);
        }
        let mut loads = sums.at_tip(ends);
        for ((stage, start), cell) in stages.iter_mut().zip(&*starts).zip(&*cells).rev() {
            loads.pass::<K>(rule, cell, start, stage);
        }
    }

    /// Eliminates cell by cell from the tip, with δ(θ, ω, β) = `weights` φ, at the first stage's forces.
    #[inline(always)]
    fn factorise<const K: usize>(&mut self, weights: [f64; 3]) -> Result<(), Singular> {
        let Self { rule, cells, stages, starts, .. } = self;
        let Section { stiffness, damping, mass, inertia, drag, tip_mass, tip_inertia } = self.section;
        let [w_0, w_1, w_2] = weights;
        const W_0: usize = MAX_STAGES;
        const PHI_0: usize = MAX_STAGES + 2;
        // n and m at node 1 by w₁ and φ₁
        let mut tip: [Triple; 3] = [[-tip_mass, 0.0, 0.0], [0.0, -tip_mass, 0.0], [0.0, 0.0, -tip_inertia * w_2]];
        for (j, start) in starts.iter_mut().enumerate().rev() {
            let (stage, h) = (&stages[j], cells[j].length);
            let (cos, sin, omega, beta) = (&start.cos, &start.sin, &stage.points[1], &stage.points[2]);
            let push = lane(|k| w_2 + w_1 * drag - w_0 * omega[k] * omega[k]);
            let pull = lane(|k| w_0 * (beta[k] + drag * omega[k]) + w_1 * 2.0 * omega[k]);
            let slope =
                [lane(|k| -(push[k] * sin[k] + pull[k] * cos[k])), lane(|k| push[k] * cos[k] - pull[k] * sin[k])];
            start.along = from_fn(|i| lane(|k| h * rule.b[k] * slope[i][k]));
            let sums: [f64; 2] = from_fn(|i| start.along[i].iter().sum());

            // n and m of node 1 by the unknowns of this cell
            let end: [Row; 3] = from_fn(|i| {
                let [by_x, by_y, by_phi] = tip[i];
                from_fn(|c| match c {
                    0..MAX_STAGES => by_x * start.along[0][c] + by_y * start.along[1][c] + by_phi * rule.end[c],
                    W_0 => by_x,
                    5 => by_y,
                    PHI_0 => by_x * sums[0] + by_y * sums[1] + by_phi,
                    _ => 0.0,
                })
            });
            let force = |inner: &Lane, rest: f64| -> [Row; 2] {
                from_fn(|i| {
                    let by_slope = h * h * mass;
                    let local = lane(|m| inner[m] * slope[i][m]);
                    from_fn(|c| match c {
                        0..MAX_STAGES => end[i][c] - by_slope * local[c],
                        PHI_0 => end[i][c] - by_slope * local.iter().sum::<f64>(),
                        c if c == W_0 + i => end[i][c] - h * mass * rest,
                        _ => end[i][c],
                    })
                })
            };
            let mut m_s = [Row::default(); K];
            for l in 0..K {
                let n = force(&rule.twice[l], rule.rest[l]);
                let own = w_2 * inertia + w_0 * (cos[l] * stage.n[0][l] + sin[l] * stage.n[1][l]);
                m_s[l] = from_fn(|c| sin[l] * n[0][c] - cos[l] * n[1][c]);
                m_s[l][l] += own;
                m_s[l][PHI_0] += own;
            }
            let per_turn = stiffness * (w_0 + damping * w_1) / h;
            let by_sin = spread::<K>(&rule.backward_columns, sin);
            let by_cos = spread::<K>(&rule.backward_columns, cos);
            // L/h a⁻¹ Φ − m = residual: the matrix, then Φ by residuals, by w₀ and φ₀, by p of node 1
            let mut rows = [[0.0; 2 * MAX_STAGES + 8]; K];
            for k in 0..K {
                let mut m = end[2];
                for l in 0..K {
                    add_scaled(&mut m, -h * rule.backward[k][l], &m_s[l]);
                }
                let row = &mut rows[k];
                for l in 0..K {
                    row[l] = per_turn * rule.slopes[l][k] - m[l];
                }
                row[MAX_STAGES + k] = 1.0;
                row[2 * MAX_STAGES..][..3].copy_from_slice(&m[W_0..PHI_0 + 1]);
                row[2 * MAX_STAGES + 3..][..3].copy_from_slice(&[-h * by_sin[k], h * by_cos[k], 1.0]);
            }
            eliminate(&mut rows).ok_or(Singular::Cell(j))?;
            for k in 0..K {
                for l in 0..K {
                    start.by_law[l][k] = rows[k][MAX_STAGES + l];
                }
                for c in 0..3 {
                    start.by_start[c][k] = rows[k][2 * MAX_STAGES + c];
                    start.by_load[c][k] = rows[k][2 * MAX_STAGES + 3 + c];
                }
            }
            if j == 0 {
                break;
            }

            let [n_x, n_y] = force(&rule.twice_0, 1.0);
            let mut m = end[2];
            for l in 0..K {
                add_scaled(&mut m, -h * rule.b[l], &m_s[l]);
            }
            start.by_force = [-h * total(&rule.b, sin), h * total(&rule.b, cos)];
            for (i, row) in [n_x, n_y, m].iter().enumerate() {
                start.carried[i] = lane(|k| row[k]);
                tip[i] = from_fn(|c| row[W_0 + c] + total(&start.carried[i], &start.by_start[c]));
            }
        }
        Ok(())
    }

    /// From the loads p at the tip to the base what the residuals make of Φ.
    fn carry<const K: usize>(&mut self, mut p: Triple) {
        for (j, (stage, start)) in self.stages.iter_mut().zip(&self.starts).enumerate().rev() {
            stage.carry::<K>(start, &mut p, j > 0);
        }
    }
}

impl Stage {
    /// What the stage adds, from its Φ and the way of the node before the cell, which becomes that of the one behind.
    #[inline(always)]
    fn increment<const K: usize>(&self, rule: &Rule, start: &Start, w: f64, node: &mut Triple) -> Points {
        let x = follow::<K>(rule, start, &self.u, node);
        let v = lane(|k| w * x[k] - self.p[k]);
        [x, v, lane(|k| w * v[k] - self.q[k])]
    }

    /// Puts the sums Σ a U and Σ C U / h of the stages so far where this one begins.
    #[inline(always)]
    fn combine(&mut self, start: &Start, now: &Points, increments: &[Points], a: &[f64], c: &[f64], per_step: f64) {
        let mut points = [Lane::default(), now[1], now[2]];
        let (mut p, mut q) = (Lane::default(), Lane::default());
        for (([x, v, acceleration], a), c) in increments.iter().zip(a).zip(c) {
            let c = c * per_step;
            add_scaled(&mut points[0], *a, x);
            add_scaled(&mut points[1], *a, v);
            add_scaled(&mut points[2], *a, acceleration);
            add_scaled(&mut p, c, x);
            add_scaled(&mut q, c, v);
        }
        self.p = lane(|k| p[k] + points[1][k]);
        self.q = lane(|k| q[k] + points[2][k]);
        let turn = &points[0];
        let (sin, cos) = match turn.iter().all(|x| x.abs() <= SMALL_TURN) {
            true => sin_cos_of_small(turn),
            false => (turn.map(f64::sin), turn.map(f64::cos)),
        };
        self.cos = lane(|k| start.cos[k] * cos[k] - start.sin[k] * sin[k]);
        self.sin = lane(|k| start.sin[k] * cos[k] + start.cos[k] * sin[k]);
        self.points = points;
    }

    /// Φ at w₀ = φ₀ = 0 from the residual of the law and the loads p, which become those of the cell before, if `on`.
    #[inline(always)]
    fn carry<const K: usize>(&mut self, start: &Start, p: &mut Triple, on: bool) {
        let mut u = spread::<K>(&start.by_law, &self.u);
        for i in 0..3 {
            add_scaled(&mut u, p[i], &start.by_load[i]);
        }
        self.u = u;
        if on {
            p[2] += start.by_force[0] * p[0] + start.by_force[1] * p[1];
            for i in 0..3 {
                p[i] += total(&start.carried[i], &u);
            }
        }
    }
}

/// What adds up from the base on.
struct Sums<'a> {
    rule: &'a Rule,
    section: &'a Section,
    w: f64,
    /// a, and of the terms in p and q.
    acceleration: [f64; 2],
    source: [f64; 2],
    /// θ + τ (ω − p), β − q̃.
    bent: f64,
    turning: f64,
    velocity: [f64; 2],
}

impl<'a> Sums<'a> {
    fn at_base(rule: &'a Rule, section: &'a Section, ends: &Ends, [w, p_0, q_0]: [f64; 3]) -> Self {
        Self {
            rule,
            section,
            w,
            acceleration: ends.acceleration,
            source: [0.0; 2],
            bent: ends.angle + section.damping * (ends.rate - p_0),
            turning: ends.turning - q_0,
            velocity: ends.velocity,
        }
    }

    /// From node to node of a cell.
    #[inline(always)]
    fn pass<const K: usize>(&mut self, cell: &Cell, start: &Start, now: &Points, stage: &mut Stage) {
        let Self { rule, section, w, acceleration: a, source, bent, turning, velocity: u } = self;
        let Section { stiffness, damping, mass, inertia, drag, tip_mass, tip_inertia } = **section;
        let w = *w;
        let Cell { length: h, rest } = *cell;
        let [turn, omega, beta] = &stage.points;
        let (cos, sin, p, q) = (&stage.cos, &stage.sin, &stage.p, &stage.q);

        let square = omega.map(|omega| omega * omega);
        let push = lane(|k| beta[k] + drag * omega[k]);
        let a_s = [lane(|k| -(square[k] * cos[k] + push[k] * sin[k])), lane(|k| push[k] * cos[k] - square[k] * sin[k])];
        let push = lane(|k| q[k] + (w + drag) * p[k]);
        let pull = lane(|k| 2.0 * start.omega[k] * p[k]);
        let source_s = [
            lane(|k| -(pull[k] * start.cos[k] + push[k] * start.sin[k])),
            lane(|k| push[k] * start.cos[k] - pull[k] * start.sin[k]),
        ];
        let per_w = -(h * mass);
        let per_slope = per_w * h;
        for i in 0..2 {
            let base = per_w * a[i];
            let inner = spread::<K>(&rule.twice_columns, &a_s[i]);
            stage.n[i] = lane(|k| base * rule.rest[k] + per_slope * inner[k]);
            stage.n_0[i] = base + per_slope * total(&rule.twice_0, &a_s[i]);
            a[i] += h * total(&rule.b, &a_s[i]);
            let base = per_w * source[i];
            let inner = spread::<K>(&rule.twice_columns, &source_s[i]);
            stage.source[i] = lane(|k| base * rule.rest[k] + per_slope * inner[k]);
            stage.source_0[i] = base + per_slope * total(&rule.twice_0, &source_s[i]);
            source[i] += h * total(&rule.b, &source_s[i]);
        }

        let beyond = lane(|k| beta[k] - (w * p[k] + q[k]));
        stage.spin = beyond.map(|beta| inertia * beta);
        let angles = lane(|k| (now[0][k] + turn[k]) + damping * (omega[k] - p[k]) - *bent);
        let per_turn = stiffness / h;
        let strain = spread::<K>(&rule.slopes, &angles);
        stage.law = lane(|k| per_turn * strain[k] - stiffness * rest);
        *bent += total(&rule.end, &angles);
        if tip_inertia > 0.0 {
            *turning += total(&rule.end, &beyond.map(|beta| beta - *turning));
        }
        if tip_mass * drag > 0.0 {
            u[0] -= h * total(&rule.b, &lane(|k| omega[k] * sin[k]));
            u[1] += h * total(&rule.b, &lane(|k| omega[k] * cos[k]));
        }
    }

    fn at_tip(self, ends: &Ends) -> Loads {
        let Self { section, acceleration: a, source, turning, velocity: u, .. } = self;
        let Section { drag, tip_mass, tip_inertia, .. } = *section;
        Loads {
            force: from_fn(|i| ends.force[i] - tip_mass * (a[i] - drag * u[i])),
            source: source.map(|a| -tip_mass * a),
            moment: ends.moment - tip_inertia * turning,
        }
    }
}

/// n, its terms in p and q, and m, from the tip on.
struct Loads {
    force: [f64; 2],
    source: [f64; 2],
    moment: f64,
}

impl Loads {
    /// From node to node of a cell, whose law gets its residual.
    #[inline(always)]
    fn pass<const K: usize>(&mut self, rule: &Rule, cell: &Cell, start: &Start, stage: &mut Stage) {
        let Self { force: n, source, moment: m } = self;
        let h = cell.length;
        for i in 0..2 {
            stage.n[i] = stage.n[i].map(|x| x + n[i]);
            stage.source[i] = stage.source[i].map(|x| x + source[i]);
            n[i] += stage.n_0[i];
            source[i] += stage.source_0[i];
        }
        let m_s = lane(|k| {
            stage.spin[k] - (stage.cos[k] * stage.n[1][k] - stage.sin[k] * stage.n[0][k])
                + (start.cos[k] * stage.source[1][k] - start.sin[k] * stage.source[0][k])
        });
        let inner = spread::<K>(&rule.backward_columns, &m_s);
        stage.u = lane(|k| (*m - stage.law[k]) - h * inner[k]);
        *m -= h * total(&rule.b, &m_s);
    }
}

/// φ at the points of a cell from w₀ and φ₀, which become those of the next.
#[inline(always)]
fn follow<const K: usize>(rule: &Rule, start: &Start, u: &Lane, node: &mut Triple) -> Lane {
    let mut turn = *u;
    for i in 0..3 {
        add_scaled(&mut turn, node[i], &start.by_start[i]);
    }
    let phi = lane(|k| if k < K { turn[k] + node[2] } else { 0.0 });
    node[0] += total(&start.along[0], &phi);
    node[1] += total(&start.along[1], &phi);
    node[2] += total(&rule.end, &turn);
    phi
}

/// Gauss-Jordan elimination with partial pivoting: what stands right of the `K` columns is multiplied by their inverse.
/// `None` where a pivot vanishes or is not finite.
#[inline(always)]
fn eliminate<const K: usize, const N: usize>(rows: &mut [[f64; N]; K]) -> Option<()> {
    for pivot in 0..K {
        let (mut best, mut largest) = (pivot, rows[pivot][pivot].abs());
        for i in pivot + 1..K {
            let size = rows[i][pivot].abs();
            (best, largest) = if size > largest { (i, size) } else { (best, largest) };
        }
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        rows.swap(pivot, best);
        let inverse = 1.0 / rows[pivot][pivot];
        let row = rows[pivot].map(|x| x * inverse);
        for i in 0..K {
            let factor = rows[i][pivot];
            if i != pivot {
                add_scaled(&mut rows[i], -factor, &row);
            }
        }
        rows[pivot] = row;
    }
    Some(())
}

impl Plane {
    /// Looks at the fraction of the last accepted step, 0 to 1, under what acts then; 1 is the present. All that is read
    /// out refers to the instant last looked at. A fraction within the step holds to the order of the estimate, and
    /// until the next attempt.
    pub fn look(&mut self, fraction: f64, drive: &Drive) {
        let present = (fraction == 1.0).then_some(*drive);
        if present.is_some() && present == self.seen {
            return;
        }
        self.seen = present;
        if present.is_some() {
            self.look_points.copy_from_slice(&self.now);
        } else {
            let weights = self.method.extension(fraction);
            let increments = self.increments.chunks_exact(self.method.stages);
            for ((points, before), increments) in self.look_points.iter_mut().zip(&self.before).zip(increments) {
                *points = *before;
                for (weight, increment) in weights.iter().zip(increments) {
                    for q in 0..3 {
                        add_scaled(&mut points[q], *weight, &increment[q]);
                    }
                }
            }
        }
        self.see(drive);
    }

    /// The same of the present, under what acts on it.
    pub fn look_at_present(&mut self) {
        let drive = self.drive;
        self.look(1.0, &drive);
    }

    /// How often something else was looked at.
    pub(crate) fn looks(&self) -> u64 {
        self.looks
    }

    /// Order of its steps.
    pub fn order(&self) -> i32 {
        self.method.order as i32
    }

    fn see(&mut self, drive: &Drive) {
        match self.mesh.rule.stages {
            1 => self.see_by::<1>(drive),
            2 => self.see_by::<2>(drive),
            3 => self.see_by::<3>(drive),
            _ => self.see_by::<4>(drive),
        }
    }

    fn see_by<const K: usize>(&mut self, drive: &Drive) {
        let ends = self.ends_of(drive, &self.ends);
        let Section { stiffness, damping, mass, inertia, drag, tip_mass, tip_inertia } = self.section;
        let rule = &self.rule;
        let mut node = Node {
            angle: [ends.angle, ends.rate, ends.turning],
            velocity: ends.velocity,
            acceleration: ends.acceleration,
            ..Node::default()
        };
        for ((points, cell), field) in self.look_points.iter().zip(&self.cells).zip(&mut self.fields) {
            let [theta, omega, beta] = points;
            let h = cell.length;
            field.node = node;
            for k in 0..K {
                (field.sin[k], field.cos[k]) = theta[k].sin_cos();
            }
            let (cos, sin) = (&field.cos, &field.sin);
            for q in 0..3 {
                let turn = points[q].map(|x| x - node.angle[q]);
                field.strain[q] = spread::<K>(&rule.slopes, &turn).map(|g| g / h);
                node.angle[q] += total(&rule.end, &turn);
            }
            let push = lane(|k| beta[k] + drag * omega[k]);
            let slopes = [
                [lane(|k| cos[k]), lane(|k| sin[k])],
                [lane(|k| -omega[k] * sin[k]), lane(|k| omega[k] * cos[k])],
                [
                    lane(|k| -(omega[k] * omega[k] * cos[k] + push[k] * sin[k])),
                    lane(|k| push[k] * cos[k] - omega[k] * omega[k] * sin[k]),
                ],
            ];
            let sums = [
                (&mut field.position, &mut node.position),
                (&mut field.velocity, &mut node.velocity),
                (&mut field.acceleration, &mut node.acceleration),
            ];
            for ((at_points, at_node), slope) in sums.into_iter().zip(&slopes) {
                for i in 0..2 {
                    at_points[i] = spread::<K>(&rule.forward, &slope[i]).map(|sum| at_node[i] + h * sum);
                    at_node[i] += h * total(&rule.b, &slope[i]);
                }
            }
        }
        node.force = from_fn(|i| ends.force[i] - tip_mass * (node.acceleration[i] - drag * node.velocity[i]));
        node.moment = ends.moment - tip_inertia * node.angle[2];
        self.tip = node;
        let (mut n, mut m) = (node.force, node.moment);
        for ((points, cell), field) in self.look_points.iter().zip(&self.cells).zip(&mut self.fields).rev() {
            let h = cell.length;
            for i in 0..2 {
                let n_s = field.acceleration[i].map(|a| mass * a);
                field.force[i] = spread::<K>(&rule.backward_columns, &n_s).map(|sum| n[i] - h * sum);
                n[i] -= h * total(&rule.b, &n_s);
            }
            let m_s = lane(|k| {
                inertia * points[2][k] - (field.cos[k] * field.force[1][k] - field.sin[k] * field.force[0][k])
            });
            m -= h * total(&rule.b, &m_s);
            field.moment = lane(|k| stiffness * (field.strain[0][k] - cell.rest + damping * field.strain[1][k]));
            (field.node.force, field.node.moment) = (n, m);
        }
        self.looked_at = drive.boundary;
        self.looks = self.looks.wrapping_add(1);
    }

    /// The tip.
    pub fn tip(&self) -> Tip {
        let Node { angle: [angle, rate, _], position, velocity, .. } = self.tip;
        Tip {
            position: self.looked_at.base.position + self.frame.vector(position),
            velocity: self.frame.vector(velocity),
            rotation: self.frame.rotation(angle),
            angular_velocity: self.frame.normal * rate,
        }
    }

    /// Force and moment that the rod exerts on its base, N and N·m, world frame.
    pub fn reaction(&self) -> (Vec3, Vec3) {
        let Node { force, moment, .. } = self.fields[0].node;
        (self.frame.vector(force), self.frame.normal * moment)
    }

    /// The centreline at an arc length, m, world frame.
    pub fn position(&self, arc: f64) -> Vec3 {
        let (mut j, mut left) = (0, arc);
        while j + 1 < self.cells.len() && left > self.cells[j].length {
            left -= self.cells[j].length;
            j += 1;
        }
        self.position_within(j, left / self.cells[j].length)
    }

    /// The centreline at the fraction `theta` of a cell, m, world frame.
    pub fn position_within(&self, cell: usize, theta: f64) -> Vec3 {
        let (Cell { length, .. }, field) = (&self.cells[cell], &self.fields[cell]);
        let weights = self.mesh.rule.weights(theta);
        let [x, y] = field.node.position;
        let way = [x + length * total(&weights, &field.cos), y + length * total(&weights, &field.sin)];
        self.looked_at.base.position + self.frame.vector(way)
    }

    /// The Gauss points from the base to the tip.
    pub fn slices(&self) -> impl DoubleEndedIterator<Item = Slice> + ExactSizeIterator {
        let stages = self.mesh.rule.stages;
        (0..self.mesh.points()).map(move |i| {
            let (field, k) = (&self.fields[i / stages], i % stages);
            Slice {
                length: self.cells[i / stages].length * self.rule.b[k],
                tangent: [field.cos[k], field.sin[k]],
                force: [field.force[0][k], field.force[1][k]],
                moment: field.moment[k],
            }
        })
    }

    /// The rod out of the plane.
    pub fn lateral(&self) -> Lateral {
        let across = Vec3::z().cross(&self.frame.axis);
        let about = |numbers: &Vec3| numbers.component_mul(&across).dot(&across);
        let Rod { stiffness, inertia_per_length, mass_per_length, tip_mass, tip_inertia, .. } = &self.rod;
        Lateral {
            bending: about(stiffness),
            twist: stiffness.z,
            mass: *mass_per_length,
            inertia: [inertia_per_length.z, about(inertia_per_length)],
            tip_mass: *tip_mass,
            tip_inertia: *tip_inertia,
        }
    }

    /// A vector in the plane, in the world frame.
    pub fn in_world(&self, part: [f64; 2]) -> Vec3 {
        self.frame.vector(part)
    }

    /// Whether energy is lost in it, in damping or drag.
    pub fn is_lossy(&self) -> bool {
        self.section.damping > 0.0 || self.section.drag > 0.0
    }

    /// The energies; no works.
    pub fn energy(&self) -> Energy {
        let Section { stiffness, mass, inertia, tip_mass, tip_inertia, .. } = self.section;
        let Support { position: base, .. } = self.looked_at.base;
        let gravity = self.frame.part(&self.looked_at.gravity);
        // the plane need not contain the origin
        let level = self.looked_at.gravity.dot(&base);
        let mut energy = Energy::default();
        for ((points, cell), field) in self.look_points.iter().zip(&self.cells).zip(&self.fields) {
            let weights = lane(|k| cell.length * self.rule.b[k]);
            let ([x, y], [u, v]) = (&field.position, &field.velocity);
            let moving = lane(|k| mass * (u[k] * u[k] + v[k] * v[k]) + inertia * points[1][k] * points[1][k]);
            energy.kinetic += 0.5 * total(&weights, &moving);
            let bent = field.strain[0].map(|g| (g - cell.rest) * (g - cell.rest));
            energy.elastic += 0.5 * stiffness * total(&weights, &bent);
            let depth = lane(|k| level + gravity[0] * x[k] + gravity[1] * y[k]);
            energy.gravity -= mass * total(&weights, &depth);
        }
        let Node { angle: [_, rate, _], position: [x, y], velocity: [u, v], .. } = self.tip;
        energy.kinetic += 0.5 * (tip_mass * (u * u + v * v) + tip_inertia * rate * rate);
        energy.gravity -= tip_mass * (level + gravity[0] * x + gravity[1] * y);
        energy
    }

    /// The powers.
    pub fn power(&self) -> Powers {
        let Section { stiffness, damping, mass, drag, .. } = self.section;
        let base = &self.fields[0].node;
        let force = self.frame.part(&self.looked_at.tip_force);
        let moment = self.frame.normal.dot(&self.looked_at.tip_moment);
        let work = |node: &Node, force: &[f64; 2], moment: f64| {
            force[0] * node.velocity[0] + force[1] * node.velocity[1] + moment * node.angle[1]
        };
        let lost = self.cells.iter().zip(&self.fields).map(|(cell, field)| {
            let ([u, v], rate) = (&field.velocity, &field.strain[1]);
            let loss = lane(|k| stiffness * damping * rate[k] * rate[k] + mass * drag * (u[k] * u[k] + v[k] * v[k]));
            cell.length * total(&self.rule.b, &loss)
        });
        Powers { base: -work(base, &base.force, base.moment), tip: work(&self.tip, &force, moment), lost: lost.sum() }
    }

    /// What acts on the rod at present.
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// Makes `state` the present, as a start of a rod in space on the same mesh. Looks at the present.
    pub fn write(&mut self, state: &mut State) {
        self.look_at_present();
        let Self { frame, mesh, section, drive, .. } = self;
        let base = drive.boundary.base.position;
        let gravity = frame.part(&drive.boundary.gravity);
        let axis = frame.axis;
        let of = |at: f64, before: f64, position: [f64; 2], force: [f64; 2], moment: f64, acceleration: [f64; 2]| {
            pose::Section {
                position: base + frame.vector(position),
                rotation: frame.rotation(at),
                turn: axis * (at - before),
                force: frame.vector(force),
                moment: frame.normal * moment,
                acceleration: frame.vector(from_fn(|i| acceleration[i] + gravity[i])),
            }
        };
        let free = |velocity: [f64; 2], acceleration: [f64; 2]| {
            frame.vector(from_fn(|i| acceleration[i] + gravity[i] - section.drag * velocity[i]))
        };
        let zero = Vec3::zeros();
        (state.boundary, state.dt) = (drive.boundary, 0.0);
        let mut before = self.ends.angle;
        for (j, (field, points)) in self.fields.iter().zip(&self.now).enumerate() {
            let node = &field.node;
            let angle = node.angle[0];
            state.nodes[j] = of(angle, before, node.position, node.force, node.moment, node.acceleration);
            before = angle;
            for k in 0..mesh.rule.stages {
                let i = j * mesh.rule.stages + k;
                let at = |lanes: &[Lane; 2]| [lanes[0][k], lanes[1][k]];
                let (velocity, acceleration) = (at(&field.velocity), at(&field.acceleration));
                state.points[i] =
                    of(points[0][k], angle, at(&field.position), at(&field.force), field.moment[k], acceleration);
                let memory = &mut state.memory[i];
                memory.spin = Motion::starting(axis * points[1][k], axis * points[2][k], zero);
                memory.travel = Motion::starting(frame.vector(velocity), free(velocity, acceleration), zero);
                memory.kappa = axis * field.strain[0][k];
                memory.strain = Motion::starting(axis * field.strain[1][k], axis * field.strain[2][k], zero);
            }
        }
        let Node { angle: [angle, rate, turning], position, velocity, acceleration, force, moment } = self.tip;
        let (node, last) = (self.cells.len(), state.memory.len() - 1);
        state.nodes[node] = of(angle, before, position, force, moment, acceleration);
        state.memory[last] = Memory {
            spin: Motion::starting(axis * rate, axis * turning, zero),
            travel: Motion::starting(frame.vector(velocity), free(velocity, acceleration), zero),
            ..Memory::default()
        };
    }

    /// The present, to be kept in the same place again and again.
    pub fn kept(&self) -> Kept {
        let Self { mesh, now, frame, section, ends, drive, .. } = self;
        let (mut cells, mut points) = (Vec::with_capacity(mesh.cells.capacity()), Vec::with_capacity(now.capacity()));
        cells.clone_from(&mesh.cells);
        points.clone_from(now);
        Kept { cells, points, frame: *frame, section: *section, ends: *ends, drive: *drive }
    }

    /// Copies the present into `kept`, from where [`Self::restore`] takes it.
    pub fn keep(&self, kept: &mut Kept) {
        kept.cells.clone_from(&self.mesh.cells);
        kept.points.clone_from(&self.now);
        (kept.frame, kept.section, kept.ends, kept.drive) = (self.frame, self.section, self.ends, self.drive);
    }

    /// Makes what was kept the present again.
    pub fn restore(&mut self, kept: &Kept) {
        self.take_mesh(&kept.cells);
        self.stand_in(kept.frame, kept.section);
        self.now.clone_from(&kept.points);
        self.ends = kept.ends;
        self.stand(&kept.drive);
    }

    /// Takes the angles of a rod in space and their rates; whether it lies and moves in this plane.
    fn take_state(&mut self, state: &State) -> bool {
        let Self { frame, mesh, .. } = self;
        let drive = Drive { boundary: state.boundary, rates: Default::default() };
        let axis = frame.axis;
        let stays = |vector: &Vec3| (vector - axis * axis.dot(vector)).norm() <= STRAY * vector.norm().max(1.0);
        let sections = state.nodes[1..].iter().chain(&state.points);
        let frequency = vectors(mesh, &self.rod, &drive).1[0].1;
        let moves = |spin: &Vec3| stays(&(spin / frequency));
        if !sections.into_iter().all(|section| stays(&section.turn))
            || !state.memory.iter().all(|memory| moves(&memory.spin.velocity.value))
            || (state.nodes[0].rotation * axis - frame.normal).norm() > STRAY
        {
            return false;
        }
        let tangent = frame.part(&state.nodes[0].rotation.column(2).into_owned());
        let mut angle = frame.angle(tangent, self.ends.angle);
        for (j, points) in self.now.iter_mut().enumerate() {
            for k in 0..mesh.rule.stages {
                let i = j * mesh.rule.stages + k;
                let spin = &state.memory[i].spin;
                points[0][k] = angle + axis.dot(&state.points[i].turn);
                points[1][k] = axis.dot(&spin.velocity.value);
                points[2][k] = axis.dot(&spin.acceleration.value);
            }
            angle += axis.dot(&state.nodes[j + 1].turn);
        }
        self.stand(&drive);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rosenbrock::RODAS4;

    /// Numbers in [−1, 1] that look like chance.
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    fn rod(tip_mass: f64, drag: f64) -> Rod {
        Rod {
            damping: Vec3::new(0.03, 0.03, 0.0),
            tip_mass,
            drag,
            tip_inertia: 2e-3,
            ..Rod::circular(0.02, 1e7, 4e6, 1100.0)
        }
    }

    /// −G at θ, ω, β.
    fn law<const K: usize>(plane: &mut Plane, points: &[Points], ends: &Ends) -> Vec<f64> {
        plane.now.copy_from_slice(points);
        plane.begin::<K>();
        for stage in &mut plane.stages {
            (stage.p, stage.q) = Default::default();
        }
        plane.residuals::<K>(ends, 0.0, 0.0, 0.0);
        plane.stages.iter().flat_map(|stage| stage.u[..K].to_vec()).collect()
    }

    fn moved(points: &[Points], by: &[Points], part: f64) -> Vec<Points> {
        let sum = |a: &Points, b: &Points| from_fn(|q| lane(|k| a[q][k] + part * b[q][k]));
        points.iter().zip(by).map(|(a, b)| sum(a, b)).collect()
    }

    fn ends(random: &mut Random) -> Ends {
        let mut pair = || [random.next(), random.next()];
        let (velocity, acceleration, force) = (pair(), pair().map(|x| 10.0 * x), pair().map(|x| 5.0 * x));
        let mut one = || random.next();
        Ends {
            angle: one(),
            rate: one(),
            turning: one(),
            moment: one(),
            velocity,
            acceleration,
            force,
            ..Ends::default()
        }
    }

    fn ends_moved(a: &Ends, b: &Ends, part: f64) -> Ends {
        let pair = |a: [f64; 2], b: [f64; 2]| from_fn(|i| a[i] + part * b[i]);
        Ends {
            tangent: a.tangent,
            angle: a.angle + part * b.angle,
            rate: a.rate + part * b.rate,
            turning: a.turning + part * b.turning,
            velocity: a.velocity,
            acceleration: pair(a.acceleration, b.acceleration),
            force: pair(a.force, b.force),
            moment: a.moment + part * b.moment,
        }
    }

    /// The derivative of G along a direction, by differences of fourth order.
    fn derivative<const K: usize>(
        plane: &mut Plane,
        points: &[Points],
        at: &Ends,
        by: &[Points],
        ends: &Ends,
    ) -> Vec<f64> {
        let step = 1e-3;
        let mut value = |part: f64| law::<K>(plane, &moved(points, by, part), &ends_moved(at, ends, part));
        let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(|part| value(part * step));
        (0..a.len()).map(|i| -(8.0 * (c[i] - b[i]) - (d[i] - a[i])) / (12.0 * step)).collect()
    }

    fn largest(values: impl Iterator<Item = f64>) -> f64 {
        values.map(f64::abs).fold(0.0, f64::max)
    }

    #[test]
    fn sections_settle_where_the_accelerations_are_theirs() {
        let mesh = Mesh::uniform(1.0, 3, 4, Vec3::zeros());
        let mut base = Support::at_rest(Vec3::zeros(), Mat3::from_diagonal(&Vec3::new(-1.0, 1.0, -1.0)));
        base.acceleration.x = 2.0;
        let drive = Drive {
            boundary: Boundary::hanging_from(base, Vec3::z() * -9.81),
            rates: crate::boundary::Rates::default(),
        };
        let mut plane = Plane::of(&mesh, &rod(0.1, 0.1), &drive, &RODAS4).expect("a plane rod");
        let mut random = Random(5);
        // bent to an arc, and turning
        for (j, points) in plane.now.iter_mut().enumerate() {
            for k in 0..4 {
                points[0][k] += 0.1 * (j as f64 + plane.mesh.rule.c[k]);
                points[1][k] = 0.1 * random.next();
            }
        }
        plane.start(&drive).unwrap();
        let settled = plane.now.clone();
        let way: Vec<Points> = (0..3).map(|_| [lane(|_| random.next()), Lane::default(), Lane::default()]).collect();
        // Newton from there: what is left goes with the square
        let [left, of_half] = [1e-3, 5e-4].map(|size| {
            plane.now = moved(&settled, &way, size);
            plane.solve(&drive, true).unwrap();
            let differences = plane.now.iter().zip(&settled).flat_map(|(a, b)| lane(|k| a[0][k] - b[0][k]));
            largest(differences)
        });
        assert!(left < 3e-5 && (3.8..4.2).contains(&(left / of_half)), "{left:e}, {of_half:e}");
    }

    fn exact<const K: usize>(cells: usize, rod: &Rod) {
        let mut random = Random(K as u64 * 100 + cells as u64);
        let mesh =
            Mesh::graded(&(0..=cells).map(|j| (j as f64 / cells as f64).powf(1.2)).collect::<Vec<_>>(), K, |s| {
                Vec3::y() * (0.5 + s)
            });
        let base = Support::at_rest(Vec3::zeros(), Mat3::identity());
        let drive = Drive { boundary: Boundary::hanging_from(base, Vec3::zeros()), rates: Default::default() };
        let mut plane = Plane::of(&mesh, rod, &drive, &RODAS4).unwrap();
        let points = |random: &mut Random| -> Vec<Points> {
            (0..cells)
                .map(|_| from_fn(|q| lane(|k| if k < K { random.next() * [1.0, 4.0, 30.0][q] } else { 0.0 })))
                .collect()
        };
        let (y, x, sources) = (points(&mut random), points(&mut random), points(&mut random));
        let at = ends(&mut random);
        let w = 20.0;

        // from the derivative along a direction the elimination finds the direction
        let by: Vec<Points> = x.iter().map(|x| [x[0], x[0].map(|x| w * x), x[0].map(|x| w * w * x)]).collect();
        let base = Ends { rate: 0.0, turning: 0.0, velocity: [0.0; 2], ..ends(&mut random) };
        let base = Ends { rate: w * base.angle, turning: w * w * base.angle, ..base };
        let residual = derivative::<K>(&mut plane, &y, &at, &by, &base);
        law::<K>(&mut plane, &y, &at);
        plane.factorise::<K>([1.0, w, w * w]).unwrap();
        for (stage, residual) in plane.stages.iter_mut().zip(residual.chunks(K)) {
            stage.u[..K].copy_from_slice(residual);
        }
        plane.carry::<K>([base.force[0], base.force[1], base.moment]);
        let mut node = [base.acceleration[0], base.acceleration[1], base.angle];
        let mut error = 0.0f64;
        for ((start, stage), x) in plane.starts.iter().zip(&plane.stages).zip(&x) {
            let found = follow::<K>(&plane.rule, start, &stage.u, &mut node);
            error = error.max(largest((0..K).map(|k| found[k] - x[0][k])));
        }
        // the differences are good to 1e-12 of the moments; those of the short cells near the base are stiff
        assert!(error < 1e-8, "{cells} × {K}: {error:e}");

        // and what a stage adds for p and q is the derivative along them
        let before = law::<K>(&mut plane, &y, &at);
        let (p_0, q_0) = (random.next(), random.next());
        for (stage, source) in plane.stages.iter_mut().zip(&sources) {
            (stage.p, stage.q) = (source[1], source[2]);
        }
        plane.residuals::<K>(&at, w, p_0, q_0);
        let found: Vec<f64> = plane.stages.iter().flat_map(|stage| stage.u[..K].to_vec()).collect();
        let by: Vec<Points> =
            sources.iter().map(|[_, p, q]| [Lane::default(), *p, lane(|k| w * p[k] + q[k])]).collect();
        let base = Ends { rate: p_0, turning: q_0, ..Ends::default() };
        let expected = derivative::<K>(&mut plane, &y, &at, &by, &base);
        let size = largest(expected.iter().copied());
        let error = largest((0..found.len()).map(|i| found[i] - before[i] - expected[i])) / size;
        assert!(error < 1e-9, "{cells} × {K}: {error:e}");
    }

    #[test]
    fn the_derivatives_are_exact() {
        for cells in [1, 2, 5] {
            for rod in [rod(0.3, 0.0), rod(0.0, 4.0)] {
                exact::<1>(cells, &rod);
                exact::<2>(cells, &rod);
                exact::<3>(cells, &rod);
                exact::<4>(cells, &rod);
            }
        }
    }

    #[test]
    fn sines_of_small_turns_are_right_to_rounding() {
        let mut random = Random(3);
        for _ in 0..10_000 {
            let x = lane(|_| SMALL_TURN * random.next());
            let (sin, cos) = sin_cos_of_small(&x);
            for k in 0..MAX_STAGES {
                assert!((sin[k] - x[k].sin()).abs() <= f64::EPSILON * x[k].abs());
                assert!((cos[k] - x[k].cos()).abs() <= f64::EPSILON);
            }
        }
    }
}
