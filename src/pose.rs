//! The pose formulation: r, R, n, m and the acceleration a in the world frame, collocated at the Gauss points of every
//! cell.
//!
//! ```text
//! r_s = R (e₃ + C Rᵀn)          R_s = R κ̂,  κ = κ̂₀ + K⁻¹ Rᵀm          (eqs 1, 11; C = 0: eq 8)
//! n_s = ρA a − f                                                      (eq 5)
//! m_s = R (ρI ω_t + ω × ρI ω) − r_s × n                               (eq 6)
//! a_s = R (ω × (ω × e₃) + ω_t × e₃)                                   (the second time derivative of eq 8)
//! ```
//!
//! ω and ω_t at a Gauss point follow from its new rotation and its history through the time scheme. All of r or a, R, n
//! and m are iterated ('lifted'), so that Newton sees the equations as they stand here and not their composition.
//!
//! Within a cell that begins with R₀ it is Φ = log(R₀ᵀR) that is collocated, Φ_s = J_r⁻¹(Φ) κ = g, and with it not m
//! but what does work on it, the canonical moment p:
//!
//! ```text
//! p = Tᵀ m,  T = R J_r(Φ)           p_s = Tᵀ m_s + Dᵀ Rᵀm,  D = ∂(J_r(Φ) g)/∂Φ
//! ```
//!
//! For smooth solutions this is eq 6 again; m itself is balanced over whole cells. Collocated by a Gauss rule the two
//! are what the virtual power of the cells' strains yields: the rod of the cells is conservative, and its stiffness
//! about an equilibrium symmetric. With m collocated in the world frame it is not, and a rod bent out of a plane
//! flutters: its fastest waves grow by themselves, however small the step.
//!
//! The acceleration has two rows. [`Row::Rotations`] is the one above: the section rotations are then the only
//! variables with a history and the rod is an ordinary differential equation. [`Row::Positions`] takes a from the
//! history of r instead; it is the row of the extensible rod, and for the inextensible one the more forgiving of the
//! two at steps that do not resolve the motion, and the only one that sees where a held tip or a hinged base is.
//!
//! An end with the support rₛ, Rₛ has the coordinates ξ = (Rₛᵀ(r − rₛ), Φ), Φ = log(RₛᵀR). Where ξ is held it vanishes,
//! and the support adds to the loads (n, m) of the end
//!
//! ```text
//! (Rₛ λ, Rₛ J_r⁻¹(Φ) λ')          δΦ = J_r⁻ᵀ(Φ) Rₛᵀ φ
//! ```
//!
//! with λ, λ' zero in the free coordinates: (λ, λ') does the work of a force on ξ.

// one-letter names are the paper's: R, I, J, W are matrices
#![allow(non_snake_case)]

use crate::alpha::{Motion, Rate, Scheme};
use crate::archive::{Archive, Archived, Corrupt, archived};
use crate::boundary::{Boundary, Held, Support};
use crate::mesh::{Gauss, MAX_STAGES, Mesh};
use crate::rod::Rod;
use crate::so3;
use crate::sweep::{
    CellEnds, EndResiduals, Increment, Joint, Point, PointResiduals, Relation, Residuals, Sweep, System,
};
use nalgebra::{Matrix3, Vector3};

type Vec3 = Vector3<f64>;
type Mat3 = Matrix3<f64>;

/// Springs on a held tip over EI/L³ and EI/L. The column on them buckles at a force 79/k EI/L² below that of the held one,
/// 39.5 EI/L² at most; the sweep loses the roundings of k times the way of the tip. Of 1e2 to 1e6, 1e3 is the most that
/// keeps the sweep's residuals as small as with a free tip.
const SPRINGS: f64 = 1e3;
/// The same over |n|/L and |n| L, for rods that carry by their tension more than by their stiffness; 1e2 keep the
/// residuals no longer.
const SPRINGS_OF_FORCE: f64 = 1e1;

/// The unknowns at a node or Gauss point, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// r, m.
    pub position: Vec3,
    /// R.
    pub rotation: Mat3,
    /// Φ: the rotation from the cell's first node (of a node: from the node before it), rad; continuous beyond a half
    /// turn.
    pub turn: Vec3,
    /// n, N: what the part s⁺ exerts on the part s⁻.
    pub force: Vec3,
    /// m, N·m.
    pub moment: Vec3,
    /// a + ν u with the drag per mass ν, m/s²: what the distributed force balances.
    pub acceleration: Vec3,
}

impl Default for Section {
    fn default() -> Self {
        let zero = Vec3::zeros();
        Self { position: zero, rotation: Mat3::identity(), turn: zero, force: zero, moment: zero, acceleration: zero }
    }
}

/// What a Gauss point (or the tip) remembers between steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Memory {
    /// ω, ω_t, body frame.
    pub spin: Motion,
    /// u, a, world frame.
    pub travel: Motion,
    /// κ, body frame, 1/m.
    pub kappa: Vec3,
    /// κ_t, κ_tt, body frame.
    pub strain: Motion,
}

/// The parts of a stage's coordinates that the stages before it give: θ of the rotation exp(θ) since the beginning of
/// the step, θ_t, and κ; body frame. All that a stage asks of the past is here, side by side: of many sections the memory
/// costs more than what is done with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    /// R at the beginning of the step.
    pub rotation: Mat3,
    /// Of θ, rad.
    pub theta: Vec3,
    /// Of θ_t, rad/s.
    pub rate: Vec3,
    /// Of κ, 1/m.
    pub kappa: Vec3,
}

impl Default for Known {
    fn default() -> Self {
        let zero = Vec3::zeros();
        Self { rotation: Mat3::identity(), theta: zero, rate: zero, kappa: zero }
    }
}

/// A rod at one instant, with its history.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// At the N+1 nodes.
    pub nodes: Vec<Section>,
    /// At the Gauss points, cell by cell.
    pub points: Vec<Section>,
    /// Histories of the Gauss points, then of the tip.
    pub memory: Vec<Memory>,
    /// What a stage of a Runge-Kutta step from here knows beforehand, of each of them.
    pub known: Vec<Known>,
    /// What held and loaded the rod then.
    pub boundary: Boundary,
    /// Length of the step that led here, s; 0 at a start.
    pub dt: f64,
    /// Scheme of that step.
    pub scheme: Scheme,
    /// Acceleration row of that step.
    pub row: Row,
}

archived!(Section { position, rotation, turn, force, moment, acceleration });
archived!(Memory { spin, travel, kappa, strain });

/// All but the number of cells: the lists are to be as long as those saved.
impl Archived for State {
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
        // a stage sets what it knows beforehand
        let Self { nodes, points, memory, known: _, boundary, dt, scheme, row } = self;
        nodes.as_mut_slice().visit(archive)?;
        points.as_mut_slice().visit(archive)?;
        memory.as_mut_slice().visit(archive)?;
        boundary.visit(archive)?;
        dt.visit(archive)?;
        scheme.visit(archive)?;
        archive.choose(row, &[Row::Rotations, Row::Positions])
    }
}

/// Where the acceleration of the centreline comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Row {
    /// a_s = (d₃)_tt: from the section rotations.
    Rotations,
    /// From the history of r.
    Positions,
}

/// A section and its history at the old instant.
#[derive(Clone, Copy)]
struct Past<'a> {
    section: &'a Section,
    memory: &'a Memory,
    known: &'a Known,
}

/// How the new instant hangs on the old one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Time {
    /// No inertia, no damping: the static rod.
    Static,
    /// A step of `dt` s.
    Step {
        /// The time scheme.
        scheme: Scheme,
        /// Δt, s.
        dt: f64,
        /// The acceleration row.
        row: Row,
    },
    /// A stage of a Runge-Kutta step, in coordinates θ of the rotations since its beginning:
    /// θ_t = w (θ − known), θ_tt = w (θ_t − known), κ_t = w (κ − known).
    Stage {
        /// w, 1/s.
        weight: f64,
    },
}

impl Time {
    /// ∂v/∂x and ∂a/∂x.
    fn weights(&self) -> (f64, f64) {
        match self {
            Self::Static => (0.0, 0.0),
            Self::Step { scheme, dt, .. } => {
                let weight = scheme.rate_weight(*dt);
                (weight, weight * weight)
            }
            Self::Stage { weight } => (*weight, weight * weight),
        }
    }

    /// The acceleration row; statics has the positions' one, with weight zero.
    pub fn row(&self) -> Row {
        match self {
            Self::Static => Row::Positions,
            Self::Step { row, .. } => *row,
            Self::Stage { .. } => Row::Rotations,
        }
    }

    fn motion(&self, old: &Motion, increment: &Vec3) -> Motion {
        match self {
            Self::Static => Motion::default(),
            Self::Step { scheme, dt, .. } => scheme.motion(old, increment, *dt),
            Self::Stage { .. } => Motion::default(),
        }
    }

    /// J_r at the turn θ since the old instant.
    #[inline(always)]
    fn turned(&self, old: &Past, R: &Mat3) -> so3::Tangent {
        let theta = match self {
            Self::Static => Vec3::zeros(),
            Self::Step { .. } => so3::log(&old.section.rotation.tr_mul(R)),
            Self::Stage { .. } => so3::log(&old.known.rotation.tr_mul(R)),
        };
        so3::Tangent::new(&theta)
    }

    /// ω and ω_t of a section that has turned by θ, where `turned` is.
    #[inline(always)]
    fn spin(&self, old: &Past, turned: &so3::Tangent) -> Motion {
        match self {
            Self::Stage { .. } => {
                let (rate, rate_t) = self.rates_of_turn(old, turned);
                let omega_t = turned.times(&rate_t) + turned.by_log_times(&rate, &rate);
                Motion::starting(turned.times(&rate), omega_t, Vec3::zeros())
            }
            _ => self.motion(&old.memory.spin, turned.log()),
        }
    }

    /// The derivatives of ω and ω_t by φ in the axes of the section; in a stage but for terms of the order of θ ω w in
    /// that of ω_t, small beside w².
    #[inline]
    fn spin_by_turn(&self, old: &Past, turned: &so3::Tangent) -> (Mat3, Mat3) {
        let (v, a) = self.weights();
        let W = turned.inverse();
        match self {
            // of J_r(θ) θ_t and J_r(θ) θ_tt by θ, and J_r W = 1
            Self::Stage { .. } => {
                let (rate, rate_t) = self.rates_of_turn(old, turned);
                let (mut by_turn, mut t_by_turn) = (turned.by_log(&rate) * W, turned.by_log(&rate_t) * W);
                for i in 0..3 {
                    by_turn[(i, i)] += v;
                    t_by_turn[(i, i)] += a;
                }
                (by_turn, t_by_turn)
            }
            _ => (W * v, W * a),
        }
    }

    /// θ_t and θ_tt at a stage.
    #[inline]
    fn rates_of_turn(&self, old: &Past, turned: &so3::Tangent) -> (Vec3, Vec3) {
        let (weight, _) = self.weights();
        let rate = (turned.log() - old.known.theta) * weight;
        (rate, (rate - old.known.rate) * weight)
    }

    /// κ_t = weight κ + offset.
    fn strain_rate(&self, old: &Past) -> (f64, Vec3) {
        match self {
            Self::Static => (0.0, Vec3::zeros()),
            Self::Step { scheme, dt, .. } => {
                let weight = scheme.rate_weight(*dt);
                let Memory { strain, kappa, .. } = old.memory;
                (weight, scheme.rate(&strain.velocity, &Vec3::zeros(), *dt).value - kappa * weight)
            }
            Self::Stage { weight } => (*weight, -old.known.kappa * *weight),
        }
    }
}

impl State {
    /// The unstressed rod on a base, moving with it as one rigid body.
    pub fn at_rest_shape(mesh: &Mesh, base: &Support) -> Self {
        let stages = mesh.rule.stages;
        let mut state = Self {
            nodes: vec![Section::default(); mesh.cells.len() + 1],
            points: vec![Section::default(); mesh.points()],
            memory: vec![Memory::default(); mesh.points() + 1],
            known: vec![Known::default(); mesh.points() + 1],
            boundary: Boundary::hanging_from(*base, Vec3::zeros()),
            dt: 0.0,
            scheme: Scheme::BACKWARD_EULER,
            row: Row::Rotations,
        };
        state.nodes[0].rotation = base.rotation;
        for (j, cell) in mesh.cells.iter().enumerate() {
            let R_0 = state.nodes[j].rotation;
            for k in 0..stages {
                let point = j * stages + k;
                state.points[point].turn = cell.kappa_rest * (cell.length * mesh.rule.c[k]);
                state.points[point].rotation = R_0 * so3::exp(&state.points[point].turn);
                state.memory[point].kappa = cell.kappa_rest;
            }
            state.nodes[j + 1].turn = cell.kappa_rest * cell.length;
            state.nodes[j + 1].rotation = R_0 * so3::exp(&state.nodes[j + 1].turn);
        }
        state.nodes[0].position = base.position;
        // without a force r_s = d₃, whatever the section
        state.accumulate(mesh, |point, _| point.rotation.column(2).into_owned(), |section| &mut section.position);
        state.move_rigidly();
        state
    }

    /// Sets the velocities of all sections to those of a rigid body that moves with the base; accelerations to zero.
    pub fn move_rigidly(&mut self) {
        let Support { position: r_0, velocity: u_0, angular_velocity: w, .. } = self.boundary.base;
        let tip = self.nodes[self.nodes.len() - 1];
        for (memory, section) in self.memory.iter_mut().zip(self.points.iter().chain(std::iter::once(&tip))) {
            let zero = Vec3::zeros();
            memory.spin = Motion::starting(section.rotation.tr_mul(&w), zero, zero);
            memory.travel = Motion::starting(u_0 + w.cross(&(section.position - r_0)), zero, zero);
            memory.strain = Motion::default();
        }
        self.dt = 0.0;
    }

    /// Puts the auxiliary rates where a step of `dt` s with `scheme` wants them: at a start, and where either has
    /// changed.
    pub fn prepare(&mut self, scheme: Scheme, dt: f64) {
        // what is first order anyway is left as it is: α + γ = 1 and β = 0 then is implicit Euler to rounding
        if (scheme, dt) == (self.scheme, self.dt) || !scheme.is_second_order() {
            return;
        }
        let (before, other) = (self.dt, self.scheme);
        let prepared = |motion: &Motion| match before {
            0.0 => scheme.started(motion, dt),
            before => scheme.rebased(motion, &other, before, dt),
        };
        for memory in &mut self.memory {
            memory.spin = prepared(&memory.spin);
            memory.travel = prepared(&memory.travel);
            memory.strain = prepared(&memory.strain);
        }
    }

    /// Whether all numbers of its sections, histories and ends are finite.
    pub(crate) fn is_finite(&self) -> bool {
        let finite = |vector: &Vec3| vector.iter().all(|x| x.is_finite());
        let section = |section: &Section| {
            let Section { position, rotation, turn, force, moment, acceleration } = section;
            let vectors = [position, turn, force, moment, acceleration];
            vectors.into_iter().all(finite) && rotation.iter().all(|x| x.is_finite())
        };
        let memory = |Memory { spin, travel, kappa, strain }: &Memory| {
            finite(kappa) && [spin, travel, strain].into_iter().all(Motion::is_finite)
        };
        let sections = self.nodes.iter().chain(&self.points).all(section);
        self.boundary.is_finite() && sections && self.memory.iter().all(memory)
    }

    /// The section at the tip.
    pub fn tip(&self) -> &Section {
        &self.nodes[self.nodes.len() - 1]
    }

    /// The section that the history `i` belongs to.
    pub(crate) fn remembering(&self, i: usize) -> &Section {
        self.points.get(i).unwrap_or(self.tip())
    }

    /// The past that the history `i` is.
    #[inline(always)]
    fn past(&self, i: usize) -> Past<'_> {
        Past { section: self.remembering(i), memory: &self.memory[i], known: &self.known[i] }
    }

    /// The history of the tip.
    pub fn tip_memory(&self) -> &Memory {
        &self.memory[self.memory.len() - 1]
    }

    /// The centreline at the fraction θ of a cell, on its collocation polynomial.
    pub fn position_within(&self, mesh: &Mesh, rod: &Rod, cell: usize, theta: f64) -> Vec3 {
        let weights = mesh.rule.weights(theta);
        let stages = mesh.rule.stages;
        (0..stages).fold(self.nodes[cell].position, |r, l| {
            r + tangent(rod, &self.points[cell * stages + l]) * (mesh.cells[cell].length * weights[l])
        })
    }

    /// Force and moment of the tip's support on the rod, world frame; none without a support. The reaction of the base
    /// is (n, m) of the first node.
    pub fn tip_reaction(&self, rod: &Rod) -> (Vec3, Vec3) {
        let (tip, memory, boundary) = (self.tip(), self.tip_memory(), &self.boundary);
        if boundary.tip.held == Held::FREE {
            return (Vec3::zeros(), Vec3::zeros());
        }
        let turning = tip.rotation * memory.spin.acceleration.value;
        let body = (memory.travel.acceleration.value - boundary.gravity) * rod.tip_mass;
        (tip.force + body - boundary.tip_force, tip.moment + turning * rod.tip_inertia - boundary.tip_moment)
    }

    /// Integrates r_s along the rod from the base, which is where it is in the directions that are not held.
    pub(crate) fn rebuild_positions(&mut self, mesh: &Mesh, rod: &Rod) {
        let Support { position, rotation: R_s, held, .. } = self.boundary.base;
        let free = Mat3::from_diagonal(&Vec3::from_fn(|i, _| f64::from(!held.translation[i])));
        let away = R_s.tr_mul(&(self.nodes[0].position - position));
        self.nodes[0].position = position + R_s * (free * away);
        self.accumulate(mesh, |point, _| tangent(rod, point), |section| &mut section.position);
    }

    /// Integrates a_s along the rod from the base (the drag's ν u included).
    fn rebuild_accelerations(&mut self, mesh: &Mesh, rod: &Rod) {
        let drag = rod.drag_rate();
        let Support { velocity, acceleration, .. } = self.boundary.base;
        self.nodes[0].acceleration = acceleration + velocity * drag;
        self.accumulate(
            mesh,
            |point, memory| point.rotation * acceleration_slope(&memory.spin, drag),
            |section| &mut section.acceleration,
        );
    }

    fn accumulate(
        &mut self,
        mesh: &Mesh,
        slope: impl Fn(&Section, &Memory) -> Vec3,
        field: impl Fn(&mut Section) -> &mut Vec3,
    ) {
        let Gauss { stages, a, b, .. } = &mesh.rule;
        for (j, cell) in mesh.cells.iter().enumerate() {
            let first = j * stages;
            let start = *field(&mut self.nodes[j]);
            let mut slopes = [Vec3::zeros(); MAX_STAGES];
            for l in 0..*stages {
                slopes[l] = slope(&self.points[first + l], &self.memory[first + l]);
            }
            for k in 0..*stages {
                *field(&mut self.points[first + k]) = integral(start, cell.length, &a[k], &slopes, *stages);
            }
            *field(&mut self.nodes[j + 1]) = integral(start, cell.length, b, &slopes, *stages);
        }
    }

    /// The rotations of the nodes that belong to those of the points.
    pub(crate) fn carry_nodes(&mut self, mesh: &Mesh, base: &Mat3) {
        self.nodes[0].rotation = *base;
        for j in 0..mesh.cells.len() {
            self.carry_node(mesh, j);
        }
    }

    /// The same at the end of cell `j`.
    pub(crate) fn carry_node(&mut self, mesh: &Mesh, j: usize) {
        let Gauss { stages, b, a_inverse, .. } = &mesh.rule;
        let R_0 = self.nodes[j].rotation;
        let mut phi = [Vec3::zeros(); MAX_STAGES];
        for k in 0..*stages {
            let point = &self.points[j * stages + k];
            phi[k] = so3::log_near(&R_0.tr_mul(&point.rotation), &point.turn);
        }
        let mut turn = Vec3::zeros();
        for k in 0..*stages {
            turn += integral(Vec3::zeros(), b[k], &a_inverse[k], &phi, *stages);
        }
        self.nodes[j + 1].rotation = R_0 * so3::exp(&turn);
    }

    /// Makes room for `cells` cells more.
    pub(crate) fn reserve(&mut self, cells: usize, stages: usize) {
        self.nodes.reserve(cells);
        self.points.reserve(cells * stages);
        self.memory.reserve(cells * stages);
        self.known.reserve(cells * stages);
    }

    /// Makes it a state on as many cells, which is to be set.
    pub(crate) fn resize(&mut self, cells: usize, stages: usize) {
        self.nodes.resize(cells + 1, Section::default());
        self.points.resize(cells * stages, Section::default());
        self.memory.resize(cells * stages + 1, Memory::default());
        self.known.resize(cells * stages + 1, Known::default());
    }

    /// Copies all but what a stage knows, without allocating where there is room for as many cells.
    pub fn copy_from(&mut self, other: &Self) {
        self.memory.clone_from(&other.memory);
        self.go_on_from(other);
    }

    /// The same but for what [`Self::settle`] sets: the histories of the points.
    pub(crate) fn go_on_from(&mut self, other: &Self) {
        self.nodes.clone_from(&other.nodes);
        self.points.clone_from(&other.points);
        self.memory.resize(other.memory.len(), Memory::default());
        self.known.resize(other.known.len(), Known::default());
        if let (Some(tip), Some(given)) = (self.memory.last_mut(), other.memory.last()) {
            *tip = *given;
        }
        self.boundary = other.boundary;
        self.dt = other.dt;
        self.scheme = other.scheme;
        self.row = other.row;
    }

    /// Applies μ times the increments of a sweep.
    pub fn apply(&mut self, nodes: &[Increment], points: &[Increment], mu: f64, row: Row) {
        let sections = self.nodes.iter_mut().zip(nodes).chain(self.points.iter_mut().zip(points));
        for (i, (section, delta)) in sections.enumerate() {
            let turn = so3::exp(&(delta.phi * mu));
            // in the axes of the section, as the law has the moment of a point: in the world frame the balance of p is
            // less linear, which some steps in space pay for with an iteration more
            let turned = |x: &Vec3| x.cross(&delta.phi);
            let m = if i < nodes.len() { delta.m + turned(&section.moment) } else { section.rotation * delta.m };
            section.force = turn * (section.force + (delta.n + turned(&section.force)) * mu);
            section.moment = turn * (section.moment + m * mu);
            section.rotation = turn * section.rotation;
            match row {
                Row::Rotations => section.acceleration += delta.w * mu,
                Row::Positions => section.position += delta.w * mu,
            }
        }
    }

    /// Takes the solution of [`assemble_accelerations`] as ω_t, a, n and m.
    pub fn take_accelerations(&mut self, rod: &Rod, nodes: &[Increment], points: &[Increment]) {
        let drag = rod.drag_rate();
        for (section, solved) in self.nodes.iter_mut().zip(nodes).chain(self.points.iter_mut().zip(points)) {
            section.acceleration = solved.w;
            section.force = solved.n;
        }
        for (section, solved) in self.nodes.iter_mut().zip(nodes) {
            section.moment = solved.m;
        }
        let tip = (&self.nodes[self.nodes.len() - 1], &end_of(rod, &self.boundary.tip.held, nodes, points));
        for (memory, (section, solved)) in self.memory.iter_mut().zip(self.points.iter().zip(points).chain([tip])) {
            let (spin, travel) = (&memory.spin.velocity.value, &memory.travel.velocity.value);
            let zero = Vec3::zeros();
            memory.spin = Motion::starting(*spin, section.rotation.tr_mul(&solved.phi), zero);
            memory.travel = Motion::starting(*travel, solved.w - travel * drag, zero);
        }
    }

    /// Takes the solution of [`assemble_jerks`] as ω_tt and a_t.
    pub fn take_jerks(&mut self, rod: &Rod, nodes: &[Increment], points: &[Increment]) {
        let drag = rod.drag_rate();
        let tip = (&self.nodes[self.nodes.len() - 1], &end_of(rod, &self.boundary.tip.held, nodes, points));
        for (memory, (section, solved)) in self.memory.iter_mut().zip(self.points.iter().zip(points).chain([tip])) {
            memory.spin.jerk = section.rotation.tr_mul(&solved.phi);
            memory.travel.jerk = solved.w - memory.travel.acceleration.value * drag;
        }
    }

    /// Makes a converged iterate a state: memories, and what the row in use did not need.
    pub fn settle(&mut self, mesh: &Mesh, rod: &Rod, old: &Self, boundary: &Boundary, time: &Time) {
        self.settle_and_take(mesh, rod, old, boundary, time, |_, _| {});
    }

    /// [`Self::settle`] where `take` gets θ_t, θ_tt and κ_t of every history, of a stage.
    pub(crate) fn settle_and_take(
        &mut self,
        mesh: &Mesh,
        rod: &Rod,
        old: &Self,
        boundary: &Boundary,
        time: &Time,
        take: impl FnMut(usize, [Vec3; 3]),
    ) {
        self.boundary = *boundary;
        for section in self.nodes.iter_mut().chain(self.points.iter_mut()) {
            section.rotation = so3::orthonormalised(&section.rotation);
        }
        self.take_turns(mesh);
        self.take_rates(mesh, rod, old, time, take);
        let drag = rod.drag_rate();
        self.rebuild_positions(mesh, rod);
        match time {
            Time::Static => self.move_rigidly(),
            Time::Stage { .. } => {
                // as at a start: the true rates
                self.dt = 0.0;
                self.rebuild_accelerations(mesh, rod);
                self.rebuild_velocities(mesh);
                self.take_travel(rod);
            }
            Time::Step { scheme, dt, row } => {
                self.dt = *dt;
                self.scheme = *scheme;
                self.row = *row;
                self.rebuild_accelerations(mesh, rod);
                if *row == Row::Rotations {
                    self.rebuild_velocities(mesh);
                }
                for i in 0..self.memory.len() {
                    let (section, past) = (self.remembering(i), &old.memory[i].travel);
                    let increment = section.position - old.remembering(i).position;
                    self.memory[i].travel = match row {
                        Row::Positions => scheme.motion(past, &increment, *dt),
                        Row::Rotations => {
                            let u = self.memory[i].travel.velocity.value;
                            scheme.followed(past, &increment, u, section.acceleration - u * drag, *dt)
                        }
                    };
                }
            }
        }
    }

    /// As much of [`Self::settle_and_take`] as a stage that others follow needs: its rates.
    pub(crate) fn settle_within(
        &mut self,
        mesh: &Mesh,
        rod: &Rod,
        old: &Self,
        boundary: &Boundary,
        time: &Time,
        mut take: impl FnMut(usize, [Vec3; 3]),
    ) {
        self.boundary = *boundary;
        let stages = mesh.rule.stages;
        let mut velocity = boundary.base.velocity;
        for j in 0..mesh.cells.len() {
            for i in j * stages..(j + 1) * stages {
                self.take_rate(i, mesh, rod, old, time, &mut take);
            }
            velocity = self.rebuild_velocity(mesh, j, velocity);
        }
        let tip = self.memory.len() - 1;
        self.take_rate(tip, mesh, rod, old, time, &mut take);
        self.memory[tip].travel.velocity.value = velocity;
    }

    /// ω and ω_t, κ and its rates; `take` as in [`Self::settle_and_take`].
    fn take_rates(&mut self, mesh: &Mesh, rod: &Rod, old: &Self, time: &Time, mut take: impl FnMut(usize, [Vec3; 3])) {
        for i in 0..self.memory.len() {
            self.take_rate(i, mesh, rod, old, time, &mut take);
        }
    }

    /// The same of the history `i`.
    #[inline(always)]
    fn take_rate(
        &mut self,
        i: usize,
        mesh: &Mesh,
        rod: &Rod,
        old: &Self,
        time: &Time,
        take: &mut impl FnMut(usize, [Vec3; 3]),
    ) {
        let past = &old.past(i);
        let turned = time.turned(past, &self.remembering(i).rotation);
        let memory = &mut self.memory[i];
        memory.spin = time.spin(past, &turned);
        if let Some(section) = self.points.get(i) {
            let law = Law::new(rod, &mesh.cells[i / mesh.rule.stages].kappa_rest, time, past);
            memory.kappa = law.kappa(&section.rotation.tr_mul(&section.moment));
            memory.strain = match time {
                Time::Stage { weight } => {
                    Motion::starting((memory.kappa - past.known.kappa) * *weight, Vec3::zeros(), Vec3::zeros())
                }
                _ => time.motion(&past.memory.strain, &(memory.kappa - past.memory.kappa)),
            };
        }
        let (theta_t, theta_tt) = time.rates_of_turn(past, &turned);
        take(i, [theta_t, theta_tt, memory.strain.velocity.value]);
    }

    /// Turns the section that the history `i` belongs to by θ from `begin`, with θ_t and θ_tt, and gives it κ_t; the
    /// section at the tip follows its cell.
    pub(crate) fn turn_history(
        &mut self,
        i: usize,
        begin: &Mat3,
        [theta, theta_t, theta_tt]: [Vec3; 3],
        kappa_t: Vec3,
    ) {
        let map = so3::Tangent::new(&theta);
        let omega_t = map.times(&theta_tt) + map.by_log_times(&theta_t, &theta_t);
        self.memory[i].spin = Motion::starting(map.times(&theta_t), omega_t, Vec3::zeros());
        self.memory[i].strain = Motion::starting(kappa_t, Vec3::zeros(), Vec3::zeros());
        if let Some(point) = self.points.get_mut(i) {
            point.rotation = begin * so3::exp(&theta);
        }
    }

    /// All that follows from the rotations and spins of the points and from what acts: positions and their rates from the
    /// base, n and at the nodes m from the tip, m at the points by its law. For a rod that neither shears nor stretches,
    /// clamped at its base and free at its tip.
    pub(crate) fn balance(&mut self, mesh: &Mesh, rod: &Rod, boundary: &Boundary) {
        let Gauss { stages, a, b, a_inverse, .. } = &mesh.rule;
        self.boundary = *boundary;
        self.dt = 0.0;
        self.carry_nodes(mesh, &boundary.base.rotation);
        self.take_turns(mesh);
        for (j, cell) in mesh.cells.iter().enumerate() {
            let first = j * stages;
            let mut phi = [Vec3::zeros(); MAX_STAGES];
            for k in 0..*stages {
                phi[k] = self.points[first + k].turn;
            }
            for k in 0..*stages {
                let g = integral(Vec3::zeros(), 1.0 / cell.length, &a_inverse[k], &phi, *stages);
                let (point, memory) = (&mut self.points[first + k], &mut self.memory[first + k]);
                memory.kappa = so3::Tangent::new(&phi[k]).times(&g);
                let strain = memory.kappa - cell.kappa_rest + rod.damping.component_mul(&memory.strain.velocity.value);
                point.moment = point.rotation * rod.stiffness.component_mul(&strain);
            }
        }
        self.rebuild_positions(mesh, rod);
        self.rebuild_accelerations(mesh, rod);
        self.rebuild_velocities(mesh);
        self.take_travel(rod);

        let (tip, memory) = (self.tip(), self.tip_memory());
        let turning = tip.rotation * memory.spin.acceleration.value;
        let body = (memory.travel.acceleration.value - boundary.gravity) * rod.tip_mass;
        let (mut n_1, mut m_1) = (boundary.tip_force - body, boundary.tip_moment - turning * rod.tip_inertia);
        for (j, cell) in mesh.cells.iter().enumerate().rev() {
            let first = j * stages;
            (self.nodes[j + 1].force, self.nodes[j + 1].moment) = (n_1, m_1);
            let (mut n_s, mut m_s) = ([Vec3::zeros(); MAX_STAGES], [Vec3::zeros(); MAX_STAGES]);
            for l in 0..*stages {
                n_s[l] = (self.points[first + l].acceleration - boundary.gravity) * rod.mass_per_length;
            }
            for k in 0..*stages {
                let mut rest = [0.0; MAX_STAGES];
                for l in 0..*stages {
                    rest[l] = a[k][l] - b[l];
                }
                let n = integral(n_1, cell.length, &rest, &n_s, *stages);
                let point = &mut self.points[first + k];
                point.force = n;
                m_s[k] = point.rotation * rotary(rod, &self.memory[first + k].spin) - tangent(rod, point).cross(&n);
            }
            n_1 = integral(n_1, -cell.length, b, &n_s, *stages);
            m_1 = integral(m_1, -cell.length, b, &m_s, *stages);
        }
        (self.nodes[0].force, self.nodes[0].moment) = (n_1, m_1);
    }

    /// Φ of all sections.
    fn take_turns(&mut self, mesh: &Mesh) {
        let stages = mesh.rule.stages;
        for j in 0..mesh.cells.len() {
            let R_0 = self.nodes[j].rotation;
            let sections = self.points[j * stages..][..stages].iter_mut().chain([&mut self.nodes[j + 1]]);
            for section in sections {
                section.turn = so3::log_near(&R_0.tr_mul(&section.rotation), &section.turn);
            }
        }
    }

    /// a from what the sections balance, as at a start.
    fn take_travel(&mut self, rod: &Rod) {
        let drag = rod.drag_rate();
        for i in 0..self.memory.len() {
            let u = self.memory[i].travel.velocity.value;
            let a = self.remembering(i).acceleration - u * drag;
            self.memory[i].travel = Motion::starting(u, a, Vec3::zeros());
        }
    }

    /// Integrates u_s = R (ω × e₃) along the rod from the base.
    pub(crate) fn rebuild_velocities(&mut self, mesh: &Mesh) {
        let mut velocity = self.boundary.base.velocity;
        for j in 0..mesh.cells.len() {
            velocity = self.rebuild_velocity(mesh, j, velocity);
        }
        if let Some(tip) = self.memory.last_mut() {
            tip.travel.velocity.value = velocity;
        }
    }

    /// The same through cell `j`, from `start` at its first node; returns that at the second.
    fn rebuild_velocity(&mut self, mesh: &Mesh, j: usize, start: Vec3) -> Vec3 {
        let Gauss { stages, a, b, .. } = &mesh.rule;
        let (first, h) = (j * stages, mesh.cells[j].length);
        let mut slopes = [Vec3::zeros(); MAX_STAGES];
        for l in 0..*stages {
            let omega = self.memory[first + l].spin.velocity.value;
            slopes[l] = self.points[first + l].rotation * omega.cross(&Vec3::z());
        }
        for k in 0..*stages {
            self.memory[first + k].travel.velocity.value = integral(start, h, &a[k], &slopes, *stages);
        }
        integral(start, h, b, &slopes, *stages)
    }
}

/// The solution of a start at the tip. The section there follows its neighbour unless a body makes it a variable of its
/// own, or a support holds it: its extrapolation along the cells would amplify whatever is not smooth at a start.
fn end_of(rod: &Rod, held: &Held, nodes: &[Increment], points: &[Increment]) -> Increment {
    let (tip, last) = (nodes[nodes.len() - 1], points[points.len() - 1]);
    if rod.tip_inertia > 0.0 || held.rotation != Held::FREE.rotation { tip } else { Increment { phi: last.phi, ..tip } }
}

#[inline]
fn integral(start: Vec3, h: f64, weights: &[f64; MAX_STAGES], slopes: &[Vec3; MAX_STAGES], stages: usize) -> Vec3 {
    (0..stages).fold(start, |sum, l| sum + slopes[l] * (h * weights[l]))
}

/// r_s.
#[inline]
fn tangent(rod: &Rod, section: &Section) -> Vec3 {
    let R = &section.rotation;
    if rod.is_extensible() {
        R * (Vec3::z() + rod.compliance.component_mul(&R.tr_mul(&section.force)))
    } else {
        R.column(2).into_owned()
    }
}

/// Rᵀ (a + ν u)_s = ω × (ω × e₃) + ω_t × e₃ + ν ω × e₃.
#[inline]
fn acceleration_slope(spin: &Motion, drag: f64) -> Vec3 {
    let (omega, omega_t) = (spin.velocity.value, spin.acceleration.value);
    let along = omega.cross(&Vec3::z());
    omega.cross(&along) + omega_t.cross(&Vec3::z()) + along * drag
}

/// Rᵀ times the rate of the spin momentum, ρI ω_t + ω × ρI ω.
#[inline]
fn rotary(rod: &Rod, spin: &Motion) -> Vec3 {
    let (omega, rho_i) = (spin.velocity.value, rod.inertia_per_length);
    rho_i.component_mul(&spin.acceleration.value) + omega.cross(&rho_i.component_mul(&omega))
}

/// The law of bending and twist at a point, with the strain rate expressed by the strain:
/// Rᵀm = K_eff (κ − κ_eff), K_eff = K (1 + τ ∂κ_t/∂κ).
struct Law {
    stiffness: Vec3,
    kappa_free: Vec3,
}

impl Law {
    #[inline]
    fn new(rod: &Rod, kappa_rest: &Vec3, time: &Time, old: &Past) -> Self {
        let (weight, offset) = time.strain_rate(old);
        let factor = rod.damping.map(|tau| 1.0 + tau * weight);
        let free = kappa_rest - rod.damping.component_mul(&offset);
        Self { stiffness: rod.stiffness.component_mul(&factor), kappa_free: free.component_div(&factor) }
    }

    #[inline]
    fn kappa(&self, stress: &Vec3) -> Vec3 {
        self.kappa_free + stress.component_div(&self.stiffness)
    }
}

/// What the equations say at one Gauss point of an iterate.
struct Terms {
    law: Law,
    /// Rᵀm.
    stress: Vec3,
    /// J_r at Φ.
    map: so3::Tangent,
    /// g, p and p'.
    g: Vec3,
    p: Vec3,
    p_s: Vec3,
    /// J_r at the turn θ since the old instant.
    turned: so3::Tangent,
    /// ω and ω_t.
    spin: Motion,
    /// r_s, and of w the slope; n_s.
    r_s: Vec3,
    w_s: Vec3,
    n_s: Vec3,
    /// R (ρI ω_t + ω × ρI ω), and m_s.
    rotary: Vec3,
    m_s: Vec3,
}

/// One statement of the equations, for their residuals and for their derivatives.
struct Equations<'a> {
    rod: &'a Rod,
    time: &'a Time,
    gravity: Vec3,
    drag: f64,
    row: Row,
    extensible: bool,
}

impl Equations<'_> {
    /// The unknown that is accumulated.
    #[inline]
    fn accumulated(&self, section: &Section) -> Vec3 {
        match self.row {
            Row::Rotations => section.acceleration,
            Row::Positions => section.position,
        }
    }

    /// At `section` of a cell that begins with `R_0`.
    #[inline(always)]
    fn at(&self, kappa_rest: &Vec3, R_0: &Mat3, section: &Section, past: &Past) -> Terms {
        let Self { rod, time, drag, .. } = self;
        let Section { rotation: R, force: n, moment: m, .. } = section;

        // R_s = R κ̂ as Φ_s = J_r⁻¹(Φ) κ, and the law
        let law = Law::new(rod, kappa_rest, time, past);
        let stress = R.tr_mul(m);
        let map = so3::Tangent::new(&so3::log_near(&R_0.tr_mul(R), &section.turn));
        let g = map.inverse_times(&law.kappa(&stress));

        // ω and ω_t from the history
        let turned = time.turned(past, R);
        let spin = time.spin(past, &turned);

        // a, or its slope
        let r_s = tangent(rod, section);
        let (w_s, distributed) = match self.row {
            Row::Rotations => (R * acceleration_slope(&spin, *drag), section.acceleration),
            Row::Positions => {
                let travel = time.motion(&past.memory.travel, &(section.position - past.section.position));
                (r_s, travel.acceleration.value + travel.velocity.value * *drag)
            }
        };

        // eq 5 and eq 6, and p
        let n_s = (distributed - self.gravity) * rod.mass_per_length;
        let rotary = R * rotary(rod, &spin);
        let m_s = rotary - r_s.cross(n);
        let p = map.transposed_times(&stress);
        let p_s = map.transposed_times(&R.tr_mul(&m_s)) + map.gradient(&stress, &g);
        Terms { law, stress, map, g, p, p_s, turned, spin, r_s, w_s, n_s, rotary, m_s }
    }

    /// The derivatives of what [`Self::at`] says.
    #[inline]
    fn derivatives(&self, R_0: &Mat3, section: &Section, past: &Past, terms: &Terms) -> Point {
        let Self { rod, time, drag, .. } = self;
        let Section { rotation: R, force: n, .. } = section;
        let Terms { law, stress, map, g, turned, spin, r_s, w_s, rotary, m_s, .. } = terms;
        let (omega, e_3) = (spin.velocity.value, Vec3::z());

        // of p and p' as far as the law has a part in them; Tᵀ m' = J_r(Φ) R₀ᵀ m'
        let (J, D) = (map.jacobian(), map.by_log(g));
        let (K_J, K_D) = (so3::rows_scaled(&law.stiffness, &J), so3::rows_scaled(&law.stiffness, &D));
        let spin_map = R * J;

        // of ω and ω_t
        let (by_turn, t_by_turn) = time.spin_by_turn(past, turned);
        let to_body = R.transpose();
        let (omega_phi, omega_t_phi) = (by_turn * to_body, t_by_turn * to_body);

        // of r_s
        let mut r_s_phi = -so3::hat(r_s);
        let (mut w_n, mut m_n) = (Mat3::zeros(), -so3::hat(r_s));
        if self.extensible {
            w_n = so3::columns_scaled(R, &rod.compliance) * to_body;
            r_s_phi += w_n * so3::hat(n);
            m_n += so3::hat_times(n, &w_n);
        }

        // of w'
        let w_phi = match self.row {
            Row::Rotations => {
                let mut by_omega = omega * e_3.transpose() - e_3 * omega.transpose() * 2.0;
                so3::add_hat(&mut by_omega, &(e_3 * -*drag), omega.z);
                R * (by_omega * omega_phi - so3::hat_times(&e_3, &omega_t_phi)) - so3::hat(w_s)
            }
            Row::Positions => r_s_phi,
        };

        // of m'
        let rho_i = rod.inertia_per_length;
        let by_omega = so3::columns_scaled(&so3::hat(&omega), &rho_i) - so3::hat(&rho_i.component_mul(&omega));
        let by_phi = by_omega * omega_phi + so3::rows_scaled(&rho_i, &omega_t_phi);
        Point {
            spin: spin_map,
            w_phi,
            w_n,
            m_phi: R * by_phi - so3::hat(rotary) + so3::hat_times(n, &r_s_phi),
            m_n,
            p_strain: so3::symmetric_product(&J, &K_J),
            p_log: J.tr_mul(&K_D) + map.transposed_by_log(stress),
            slope_log: so3::symmetric_product(&D, &K_D) + map.hessian(stress, g) + map.by_log(&R_0.tr_mul(m_s)),
            slope_phi: -so3::hat_times(m_s, &spin_map).transpose(),
            law_strain: K_J,
            law_log: K_D,
        }
    }
}

impl Equations<'_> {
    fn cells<const K: usize, const BLOCKS: bool>(&self, mesh: &Mesh, old: &State, state: &State, system: &mut System) {
        let Gauss { a, b, .. } = &mesh.rule;
        for (j, cell) in mesh.cells.iter().enumerate() {
            let h = cell.length;
            let (node_0, node_1) = (&state.nodes[j], &state.nodes[j + 1]);
            let first = j * K;
            let points = &state.points[first..][..K];
            let R_0 = &node_0.rotation;
            let zero = [Vec3::zeros(); K];
            let (mut log, mut g, mut w_s, mut n_s, mut m_s, mut p, mut p_s) =
                (zero, zero, zero, zero, zero, zero, zero);
            for k in 0..K {
                let past = &old.past(first + k);
                let terms = self.at(&cell.kappa_rest, R_0, &points[k], past);
                (log[k], g[k], w_s[k], n_s[k]) = (*terms.map.log(), terms.g, terms.w_s, terms.n_s);
                (m_s[k], p[k], p_s[k]) = (terms.m_s, terms.p, terms.p_s);
                if BLOCKS {
                    system.points[first + k] = self.derivatives(R_0, &points[k], past, &terms);
                }
            }
            let log_1 = so3::log_near(&R_0.tr_mul(&node_1.rotation), &node_1.turn);
            let map = so3::Tangent::new(&log_1);
            if BLOCKS {
                let spin = node_1.rotation * map.jacobian();
                system.cells[j] = CellEnds {
                    length: h,
                    spin,
                    p_log: map.by_log(&R_0.tr_mul(&node_1.moment)),
                    p_phi: -so3::hat_times(&node_1.moment, &spin).transpose(),
                };
            }

            let p_1 = map.transposed_times(&node_1.rotation.tr_mul(&node_1.moment));
            let w_0 = self.accumulated(node_0);
            for k in 0..K {
                let forward = a[k].map(|a| h * a);
                let backward: [f64; MAX_STAGES] = std::array::from_fn(|l| h * (a[k][l] - b[l]));
                system.residuals.points[first + k] = PointResiduals {
                    log: log[k] - summed(Vec3::zeros(), &forward, &g),
                    w: self.accumulated(&points[k]) - summed(w_0, &forward, &w_s),
                    n: points[k].force - summed(node_1.force, &backward, &n_s),
                    p: p[k] - summed(p_1, &backward, &p_s),
                };
            }
            let (forward, backward) = (b.map(|b| h * b), b.map(|b| -h * b));
            system.residuals.cells[j] = EndResiduals {
                log: log_1 - summed(Vec3::zeros(), &forward, &g),
                w: self.accumulated(node_1) - summed(w_0, &forward, &w_s),
                n: node_0.force - summed(node_1.force, &backward, &n_s),
                m: node_0.moment - summed(node_1.moment, &backward, &m_s),
            };
        }
    }
}

/// x + Σ weights_l slopes_l.
#[inline(always)]
fn summed<const K: usize>(x: Vec3, weights: &[f64; MAX_STAGES], slopes: &[Vec3; K]) -> Vec3 {
    (0..K).fold(x, |sum, l| sum + slopes[l] * weights[l])
}

/// Residuals and blocks at an iterate.
pub fn assemble(
    mesh: &Mesh,
    rod: &Rod,
    old: &State,
    state: &State,
    boundary: &Boundary,
    time: &Time,
    system: &mut System,
) {
    assemble_parts::<true>(mesh, rod, old, state, boundary, time, system);
}

/// The residuals alone, for factors that are kept.
pub fn assemble_residuals(
    mesh: &Mesh,
    rod: &Rod,
    old: &State,
    state: &State,
    boundary: &Boundary,
    time: &Time,
    system: &mut System,
) {
    assemble_parts::<false>(mesh, rod, old, state, boundary, time, system);
}

/// Of the cells the residuals and, where asked, the blocks; and the ends.
fn assemble_parts<const BLOCKS: bool>(
    mesh: &Mesh,
    rod: &Rod,
    old: &State,
    state: &State,
    boundary: &Boundary,
    time: &Time,
    system: &mut System,
) {
    let (weight_v, weight_a) = time.weights();
    let drag = rod.drag_rate();
    let row = time.row();
    let gravity = boundary.gravity;
    system.mass = match row {
        Row::Rotations => rod.mass_per_length,
        Row::Positions => rod.mass_per_length * (weight_a + drag * weight_v),
    };
    let equations = Equations { rod, time, gravity, drag, row, extensible: system.extensible };
    let accumulated = |section: &Section| equations.accumulated(section);
    match mesh.rule.stages {
        1 => equations.cells::<1, BLOCKS>(mesh, old, state, system),
        2 => equations.cells::<2, BLOCKS>(mesh, old, state, system),
        3 => equations.cells::<3, BLOCKS>(mesh, old, state, system),
        _ => equations.cells::<4, BLOCKS>(mesh, old, state, system),
    }

    // the base is where its path says, or free of load
    let base = &state.nodes[0];
    (system.base_joint, system.base_load) = Default::default();
    let residuals = &mut system.residuals;
    residuals.base_load = Default::default();
    if boundary.base.held == Held::CLAMPED {
        let Support { position: r, rotation: R, velocity: u, acceleration: a, .. } = boundary.base;
        let target = match row {
            Row::Rotations => a + u * drag,
            Row::Positions => r,
        };
        residuals.base = (target - accumulated(base), so3::log(&(R * base.rotation.transpose())));
    } else {
        residuals.base_load = (-base.force, -base.moment);
        let (joint, t) = attach(&boundary.base, base, &mut system.base_load, &mut residuals.base_load);
        (system.base_joint, residuals.base) = (Some(joint), t);
    }

    // the tip carries its loads and the body on it
    let tip = state.tip();
    let past = &old.past(state.points.len());
    system.tip_load = Default::default();
    residuals.tip_load = (boundary.tip_force - tip.force, boundary.tip_moment - tip.moment);
    if rod.tip_mass > 0.0 {
        let (a_tip, by_w) = match row {
            Row::Rotations => (tip.acceleration - tip_velocity(mesh, old, state, boundary, time) * drag, 1.0),
            Row::Positions => {
                (time.motion(&past.memory.travel, &(tip.position - past.section.position)).acceleration.value, weight_a)
            }
        };
        residuals.tip_load.0 += (gravity - a_tip) * rod.tip_mass;
        system.tip_load.n_w = Mat3::from_diagonal_element(-rod.tip_mass * by_w);
    }
    if rod.tip_inertia > 0.0 && *time != Time::Static {
        let R = tip.rotation;
        let turned = time.turned(past, &R);
        let turning = R * time.spin(past, &turned).acceleration.value;
        let W = turned.inverse() * R.transpose();
        residuals.tip_load.1 -= turning * rod.tip_inertia;
        system.tip_load.m_phi = (so3::hat(&turning) - R * W * weight_a) * rod.tip_inertia;
    }
    (system.tip_joint, residuals.tip) = Default::default();
    if boundary.tip.held != Held::FREE {
        let (joint, t) = attach(&boundary.tip, tip, &mut system.tip_load, &mut residuals.tip_load);
        system.tip_joint = Some(Joint { springs: springs(mesh, rod, state), ..joint });
        residuals.tip = t;
    }
}

/// ξ of an end as coordinates of its increments.
fn coordinates(support: &Support, section: &Section) -> (Joint, Vec3) {
    let R_s = &support.rotation;
    let phi = so3::log(&R_s.tr_mul(&section.rotation));
    let joint = Joint {
        held: (support.held.translation, support.held.rotation),
        by_w: R_s.transpose(),
        by_phi: so3::inverse_right_jacobian(&phi).tr_mul(&R_s.transpose()),
        of_moment: so3::right_jacobian(&phi) * R_s.transpose(),
        springs: (0.0, 0.0),
    };
    (joint, phi)
}

/// The joint of an end with its support at an iterate, and t. `load` is what the loads and the inertia of the end exceed
/// its n and m by, and `by_load` its derivative; the support takes from it what it carries.
fn attach(
    support: &Support,
    section: &Section,
    by_load: &mut Relation,
    load: &mut (Vec3, Vec3),
) -> (Joint, (Vec3, Vec3)) {
    let (joint, phi) = coordinates(support, section);
    let (R_s, held) = (&support.rotation, &support.held);
    let of_held = |held: &[bool; 3], xi: &Vec3| Vec3::from_fn(|i, _| if held[i] { xi[i] } else { 0.0 });
    let (force, moment) = (-(joint.by_w * load.0), -(joint.of_moment * load.1));
    // of the whole moment: it is the free part of it that is to vanish, in axes that turn with the section
    let (_, derivative) = so3::rate_of_log(&phi, &moment);
    load.0 += R_s * of_held(&held.translation, &force);
    load.1 += joint.by_phi.tr_mul(&of_held(&held.rotation, &moment));
    by_load.m_phi += R_s * derivative * joint.by_phi;
    let away = R_s.tr_mul(&(support.position - section.position));
    (joint, (of_held(&held.translation, &away), of_held(&held.rotation, &-phi)))
}

/// Springs on a held tip that make the rod on them about as stable as the held one: far stiffer than the rod, and than
/// the forces in it can outweigh.
fn springs(mesh: &Mesh, rod: &Rod, state: &State) -> (f64, f64) {
    let length = mesh.length();
    let force = state.nodes.iter().map(|node| node.force.amax()).fold(0.0, f64::max);
    let stiffness = SPRINGS * rod.stiffness.amax() / length + SPRINGS_OF_FORCE * force * length;
    (stiffness / (length * length), stiffness)
}

/// u at the tip of an iterate, only needed where a body sits on the tip of a rod with drag. Its derivative is left out
/// of the Jacobian (it depends on every section): Newton's rate there is ν Δt instead of quadratic.
fn tip_velocity(mesh: &Mesh, old: &State, state: &State, boundary: &Boundary, time: &Time) -> Vec3 {
    let stages = mesh.rule.stages;
    let mut u = boundary.base.velocity;
    for (i, section) in state.points.iter().enumerate() {
        let past = &old.past(i);
        let omega = time.spin(past, &time.turned(past, &section.rotation)).velocity.value;
        let weight = mesh.cells[i / stages].length * mesh.rule.b[i % stages];
        u += section.rotation * omega.cross(&Vec3::z()) * weight;
    }
    u
}

/// The equations of motion at an instant as linear equations for the accelerations: φ stands for R ω_t, w for a + ν u;
/// the moments at the points are those of the law. Sets these moments in `state`.
///
/// A support has no angular acceleration, and its acceleration no rate, at a start: a motion begins smoothly. What it
/// holds follows it as a rigid body.
pub fn assemble_accelerations(mesh: &Mesh, rod: &Rod, state: &mut State, boundary: &Boundary, system: &mut System) {
    let drag = rod.drag_rate();
    let base = &boundary.base;
    state.nodes[0].acceleration = base.acceleration + base.velocity * drag;
    let stages = mesh.rule.stages;
    for (i, section) in state.points.iter_mut().enumerate() {
        let memory = &state.memory[i];
        let strain =
            memory.kappa - mesh.cells[i / stages].kappa_rest + rod.damping.component_mul(&memory.strain.velocity.value);
        section.moment = section.rotation * rod.stiffness.component_mul(&strain);
    }
    let rates = |i: usize| {
        let (R, spin) = (&state.points[i].rotation, &state.memory[i].spin);
        let still = Motion { velocity: spin.velocity, ..Motion::default() };
        Rates {
            w_s: R * acceleration_slope(&still, drag),
            n_s: -boundary.gravity * rod.mass_per_length,
            m_s: R * rotary(rod, &still),
            carried: Vec3::zeros(),
            stress: R.tr_mul(&state.points[i].moment),
        }
    };
    let held_back = state.tip_memory().travel.velocity.value * drag;
    let tip = (boundary.tip_force + (boundary.gravity + held_back) * rod.tip_mass, boundary.tip_moment);
    assemble_rates(mesh, rod, state, state.nodes[0].acceleration, rates, tip, system);
    // the ends stand still in the axes of their supports
    hold_rates(boundary, state, system, |support, node| {
        let spin = support.angular_velocity;
        let drift = spin.cross(&(state.nodes[node].position - support.position));
        (support.acceleration + spin.cross(&drift) + (support.velocity + drift) * drag, Vec3::zeros())
    });
}

/// The time derivative of those equations: φ stands for R ω_tt, w for the rate of a + ν u. `sweep` holds the
/// accelerations. Sets κ_tt in `state`.
pub fn assemble_jerks(mesh: &Mesh, rod: &Rod, state: &mut State, sweep: &Sweep, system: &mut System) {
    let drag = rod.drag_rate();
    let e_3 = Vec3::z();
    for i in 0..state.points.len() {
        state.memory[i].strain.acceleration = Rate::at_start(strain_acceleration(mesh, state, sweep, i));
    }
    let state = &*state;
    let rates = |i: usize| {
        let (section, spin) = (&state.points[i], &state.memory[i].spin);
        let (R, omega, omega_t) = (&section.rotation, spin.velocity.value, spin.acceleration.value);
        let slope = acceleration_slope(spin, drag);
        let along = omega.cross(&e_3);
        let slope_t = omega_t.cross(&along) + omega.cross(&omega_t.cross(&e_3)) + omega_t.cross(&e_3) * drag;
        let (spun, spun_t) =
            (rod.inertia_per_length.component_mul(&omega), rod.inertia_per_length.component_mul(&omega_t));
        let rotary = spun_t + omega.cross(&spun);
        let rotary_t = omega.cross(&rotary) + omega_t.cross(&spun) + omega.cross(&spun_t);
        let memory = &state.memory[i];
        let Motion { velocity: strain_t, acceleration: strain_tt, .. } = memory.strain;
        let strain_t = strain_t.value + rod.damping.component_mul(&strain_tt.value);
        Rates {
            w_s: R * (omega.cross(&slope) + slope_t),
            n_s: Vec3::zeros(),
            m_s: R * rotary_t - (R * along).cross(&section.force),
            carried: R * omega.cross(&(rotary - e_3.cross(&R.tr_mul(&section.force)))),
            stress: rod.stiffness.component_mul(&strain_t),
        }
    };
    let Boundary { base, tip, .. } = &state.boundary;
    // what a support exerts turns with it
    let (force, moment) = state.tip_reaction(rod);
    let load = (
        state.tip_memory().travel.acceleration.value * (drag * rod.tip_mass) + tip.angular_velocity.cross(&force),
        tip.angular_velocity.cross(&moment),
    );
    assemble_rates(mesh, rod, state, base.acceleration * drag, rates, load, system);
    let stages = mesh.rule.stages;
    for (j, ends) in system.cells.iter().enumerate() {
        // a start moves rigidly: a node as the point before it
        let last = (j + 1) * stages - 1;
        let spin = state.points[last].rotation * state.memory[last].spin.velocity.value;
        let carried = ends.spin.tr_mul(&spin.cross(&state.nodes[j + 1].moment));
        system.residuals.points[j * stages..][..stages].iter_mut().for_each(|point| point.p += carried);
    }
    let Section { force, moment, .. } = &state.nodes[0];
    system.residuals.base_load = (base.angular_velocity.cross(force), base.angular_velocity.cross(moment));
    hold_rates(&state.boundary, state, system, |support, node| {
        let (section, spin) = (&state.nodes[node], support.angular_velocity);
        let drift = spin.cross(&(section.position - support.position));
        let a = section.acceleration - (support.velocity + drift) * drag;
        let a_t = spin.cross(&((a - support.acceleration) * 3.0 - spin.cross(&drift) * 2.0));
        (a_t + a * drag, spin.cross(&sweep.nodes[node].phi))
    });
}

/// Holds the ends of the rates' equations: `rates` gives those of w and φ by support and node, as far as they are held.
fn hold_rates(
    boundary: &Boundary,
    state: &State,
    system: &mut System,
    rates: impl Fn(&Support, usize) -> (Vec3, Vec3),
) {
    let joint = |support: &Support, node: usize| {
        let (joint, _) = coordinates(support, &state.nodes[node]);
        let (w, phi) = rates(support, node);
        (Some(joint), (joint.by_w * w, joint.by_phi * phi))
    };
    (system.base_joint, system.tip_joint) = (None, None);
    if boundary.base.held != Held::CLAMPED {
        (system.base_joint, system.residuals.base) = joint(&boundary.base, 0);
    }
    if boundary.tip.held != Held::FREE {
        (system.tip_joint, system.residuals.tip) = joint(&boundary.tip, state.nodes.len() - 1);
    }
}

/// κ_tt at a point that so far moves rigidly, from the angular accelerations in `sweep`.
fn strain_acceleration(mesh: &Mesh, state: &State, sweep: &Sweep, point: usize) -> Vec3 {
    let stages = mesh.rule.stages;
    let (j, k) = (point / stages, point % stages);
    let log_tt = |i: usize| {
        let Section { rotation: R, turn: phi, .. } = &state.points[i];
        let turn_tt = R.tr_mul(&(sweep.points[i].phi - sweep.nodes[j].phi));
        (*phi, so3::inverse_right_jacobian(phi) * turn_tt)
    };
    let phi_s_tt = (0..stages).fold(Vec3::zeros(), |sum, l| {
        sum + log_tt(j * stages + l).1 * (mesh.rule.a_inverse[k][l] / mesh.cells[j].length)
    });
    let (phi, phi_tt) = log_tt(point);
    let (_, derivative) = so3::rate_of_log(&phi, &state.memory[point].kappa);
    so3::right_jacobian(&phi) * (phi_s_tt - derivative * phi_tt)
}

/// What is known at a point in the equations for accelerations or their rates.
struct Rates {
    /// Of a_s, n_s, m_s.
    w_s: Vec3,
    n_s: Vec3,
    m_s: Vec3,
    /// The part of m_s that only turns it with the section: none of it is in p'.
    carried: Vec3,
    /// Rᵀm, or its rate.
    stress: Vec3,
}

/// The common linear operator: w_s = R (Rᵀφ × e₃) + …, n_s = ρA w + …, m_s = R ρI Rᵀφ − r_s × n + …, m given.
fn assemble_rates(
    mesh: &Mesh,
    rod: &Rod,
    state: &State,
    base: Vec3,
    rates: impl Fn(usize) -> Rates,
    tip: (Vec3, Vec3),
    system: &mut System,
) {
    let stages = mesh.rule.stages;
    let zero = [Vec3::zeros(); MAX_STAGES];
    for j in 0..mesh.cells.len() {
        let first = j * stages;
        let (mut w_s, mut n_s, mut m_s, mut p, mut p_s) = (zero, zero, zero, zero, zero);
        for k in 0..stages {
            let Section { rotation: R, turn, .. } = &state.points[first + k];
            let r_s = tangent(rod, &state.points[first + k]);
            let known = rates(first + k);
            (w_s[k], n_s[k], m_s[k]) = (known.w_s, known.n_s, known.m_s);
            let map = so3::Tangent::new(turn);
            let (J, g) = (map.jacobian(), map.inverse_times(&state.memory[first + k].kappa));
            p[k] = J.tr_mul(&known.stress);
            p_s[k] = J.tr_mul(&R.tr_mul(&(m_s[k] - known.carried))) + map.by_log(&g).tr_mul(&known.stress);
            system.points[first + k] = Point {
                spin: R * J,
                w_phi: -so3::hat(&r_s),
                m_phi: R * Mat3::from_diagonal(&rod.inertia_per_length) * R.transpose(),
                m_n: -so3::hat(&r_s),
                ..Point::default()
            };
        }
        let Section { rotation: R, turn, .. } = &state.nodes[j + 1];
        let spin = R * so3::right_jacobian(turn);
        system.cells[j] = CellEnds { length: mesh.cells[j].length, spin, ..CellEnds::default() };
        set_loads(mesh, j, [&w_s, &n_s, &m_s, &p_s], &mut system.residuals);
        for k in 0..stages {
            system.residuals.points[first + k].p += p[k];
        }
    }
    system.mass = rod.mass_per_length;
    system.base_load = Relation::default();
    system.tip_load = Relation {
        n_w: Mat3::from_diagonal_element(-rod.tip_mass),
        m_phi: Mat3::from_diagonal_element(-rod.tip_inertia),
        ..Relation::default()
    };
    let residuals = &mut system.residuals;
    (residuals.base, residuals.base_load) = ((base, Vec3::zeros()), Default::default());
    (residuals.tip, residuals.tip_load) = (Default::default(), tip);
}

/// Residuals of a cell of a linear problem in which everything is zero but the given w_s, n_s, m_s and p'.
fn set_loads(mesh: &Mesh, j: usize, [w_s, n_s, m_s, p_s]: [&[Vec3; MAX_STAGES]; 4], residuals: &mut Residuals) {
    let Gauss { stages, a, b, .. } = &mesh.rule;
    let h = mesh.cells[j].length;
    let sum = |step: f64, weights: &[f64; MAX_STAGES], slopes| -integral(Vec3::zeros(), step, weights, slopes, *stages);
    for k in 0..*stages {
        let point = &mut residuals.points[j * stages + k];
        let mut rest = [0.0; MAX_STAGES];
        for l in 0..*stages {
            rest[l] = a[k][l] - b[l];
        }
        point.log = Vec3::zeros();
        point.w = sum(h, &a[k], w_s);
        point.n = sum(h, &rest, n_s);
        point.p = sum(h, &rest, p_s);
    }
    let ends = &mut residuals.cells[j];
    ends.log = Vec3::zeros();
    ends.w = sum(h, b, w_s);
    ends.n = sum(-h, b, n_s);
    ends.m = sum(-h, b, m_s);
}

/// Makes `residuals` the inertia of the displacements `y` (position, rotation; of all points, then the
/// tip) vibrating with ω = 1.
pub fn load_with_inertia(mesh: &Mesh, rod: &Rod, state: &State, y: &[(Vec3, Vec3)], residuals: &mut Residuals) {
    let stages = mesh.rule.stages;
    let zero = [Vec3::zeros(); MAX_STAGES];
    for j in 0..mesh.cells.len() {
        let (mut n_s, mut m_s, mut p_s) = (zero, zero, zero);
        for k in 0..stages {
            let i = j * stages + k;
            let Section { rotation: R, turn, .. } = &state.points[i];
            n_s[k] = y[i].0 * -rod.mass_per_length;
            let m_s_body = rod.inertia_per_length.component_mul(&R.tr_mul(&y[i].1)) * -1.0;
            m_s[k] = R * m_s_body;
            p_s[k] = so3::right_jacobian(turn).tr_mul(&m_s_body);
        }
        set_loads(mesh, j, [&zero, &n_s, &m_s, &p_s], residuals);
    }
    let (w, phi) = y[y.len() - 1];
    (residuals.base, residuals.base_load, residuals.tip) = Default::default();
    residuals.tip_load = (w * rod.tip_mass, phi * rod.tip_inertia);
}
