//! The paper's formulation, as printed and mended: u, ω, κ and n in the frame of the section.
//!
//! # The system
//!
//! x = (u, ω, κ, n) at every node, body components. The directors are the columns of R, with R_s = R κ̂ and R_t = R ω̂
//! (eqs 1 and 2; κ̂ and ω̂ here are matrices), so that ∂_t R_s = ∂_s R_t is the compatibility of eqs 3 and 4. The balances
//! of momentum (eqs 5 and 6), eq 4 and the constraint d₃_t = u_s (eqs 7 and 8), with derivatives in the moving frame
//! (eqs 12 and 13), are
//!
//! ```text
//! ρA u_t = n_s + κ × n − ρA ω × u + f                                  (14a)
//! ρI ω_t = m_s + κ × m + d₃ × n − ω × ρI ω + l                         (14b)
//!    κ_t = ω_s − ω × κ                                                 (14c)
//!      0 = u_s + κ × u − ω × d₃                                        (14d)
//! M̂ x_t + K̂ x_s + Λ = 0                                                (15)
//! ```
//!
//! with m = K(κ − κ̂), κ̂ now of the unstressed rod (eqs 9 and 11), and no law for n (eq 10): it is what keeps the rod from
//! shearing and stretching. f is gravity and drag; nothing here makes an l. κ̂ at the nodes lies on the lines through the
//! middles of the cells.
//!
//! [`Step`] holds the equations of a node and of a cell: eq 18, which averages eq 15 over the step (eqs 16 and 17) and
//! over the cell, with derivatives by eqs 19 and 20; and ∂F_j/∂x_j, ∂F_j/∂x_j+1. The triples (α, β, γ) are
//! [`Scheme`]s, one in time and one in space. [`Ends`] holds the boundary conditions and Ξ, [`Band`] the elimination, and
//! [`Stepper`] Algorithm 1, whose line numbers stand beside the lines.
//!
//! # As printed and mended
//!
//! [`Options::AS_PRINTED`] is Algorithm 1 with the errata below corrected, and [`Options::MENDED`] what it takes to make
//! it second order in time and space, quadratically convergent, and free of drift and ringing. Each switch stands by
//! itself:
//!
//! | as printed | mended | why |
//! |---|---|---|
//! | [`Orientation::Lagging`] | [`Orientation::InNewton`] | loads and boundary values turn with R, which the printed Jacobian does not know |
//! | [`Curvature::First`] | [`Curvature::Mean`] | eq 23 with κ_j alone is first order |
//! | [`Positions::Integrated`] | [`Positions::Rebuilt`] | integrated velocities leave the rod's shape |
//! | [`Balance::Averaged`] | [`Balance::AtEnd`] | n has no rate: averaged, its errors change sign step by step |
//! | [`Start::AsPrinted`] | [`Start::Consistent`] | n⁰ is the reaction to the motion that begins, and no input |
//! | [`Relaxation::Fixed`] | [`Relaxation::Adaptive`] | a fixed μ < 1 gains log₁₀ 1/(1−μ) digits per iteration, and no more |
//!
//! The paper gives neither μ nor ε. With μ = 0.8 and ε = 10⁻⁹ (scaled) hair of 100 cells takes its 14 iterations at
//! Δt = 1/30 s.
//!
//! In both, ∂_s x is taken at the last iterate (lines 20 and 21): through eq 20 F_j depends on every node before it, with
//! weight β_s − (1−β_s)(1−γ_s)/γ_s on ∂_s x_j. The two blocks of a cell are its whole Jacobian where β_s = 1 − γ_s
//! ([`BOX`], or implicit Euler in space); elsewhere Newton converges linearly, or not at all at small Δt. For α_s = β_s,
//! line 20 and eq 18 together make eq 15 hold at every node, and what is left is the θ method with θ = γ_s: second order
//! for γ_s = ½ only.
//!
//! The paper's steps are equal. Where Δt or the scheme changes, the auxiliary rates move with their shift
//! ([`Scheme::rebased`]): taken as they are, they make steps of changing length first order.
//!
//! # Ends
//!
//! The base is clamped to its support and moves with its twist; another base is refused. At the tip each of six
//! components is a known rate of the support or a known dead load. Poses are held through twists only; with
//! [`Positions::Rebuilt`] what a held tip is off at the end of a step is fed back over five steps.
//!
//! # Errata
//!
//! As printed means: with these corrected.
//!
//! 1. Eq 22: x̃ − J⁻¹F; line 13 has the sign right.
//! 2. M̂ has twelve entries: ρA three times.
//! 3. Line 6 inverts M̂, which is singular: no equation has n_t. It is done for the other nine rows, and ∂_t n = 0 as the
//!    text says.
//! 4. Line 17: a dead load F has body components f = RᵀF, so from one iterate to the next, and from node to node, they
//!    change by ΔRᵀ and not by ΔR. And the ΔR of eq 23 leads from node to node; line 17 wants that of an iteration.
//! 5. Section 4.2: α, β, γ ∈ [0, 1], but α = −½ at λ∞ = 0; α ∈ [−½, ½], β ∈ [0, ½], γ ∈ [½, 1].
//! 6. Section 3.1: ρ is no linear density, which is ρA, but a density: ρI would be off by an area otherwise.
//! 7. Section 3.4.1: f(L) in the boundary condition is n(L); and 4.3.1 derives F₁ by κ and n, not by κ and f.
//! 8. Eq 18 couples j−1 and j, eq 21 j and j+1: a shift of the index. Here F_j stands between nodes j and j+1, from 0.
//! 9. Line 10 asks for F(xⁱ) before line 18 has put in the boundary values of tᵢ and line 19 the rates. Lines 15 to 21 run
//!    once before the loop; line 3 is part of that in every step.
//! 10. ∂_s x at a start is an input (4.5) that nothing tells: the difference across the first cell is taken.
//! 11. Section 4.3: J is block-bidiagonal, not tridiagonal, as F_j has x_j and x_j+1 alone; and Ξ is one-to-one only
//!     between vectors with the same boundary values.
//! 12. Section 3.3: n is the contact force, not the contact couple. Section 3.4: the local derivative of d₃ vanishes as
//!     that of any director does, inextensible or not.
//! 13. Line 19: eq 19 wants ∂_t xⁱ⁻¹ as well.

// one-letter names are the paper's: K, M̂, R, F, J are matrices and systems
#![allow(non_snake_case)]

mod band;
mod cell;
mod ends;
mod node;
mod start;

pub use band::{Band, CARRIED, CellRows};
pub use cell::{Block, Blocks, LARGEST, Rows, Step};
pub use ends::{Ends, Tip, TipColumns};
pub use node::{Node, Rest, Unknowns};

use crate::alpha::{Motion, Scheme};
use crate::boundary::{Boundary, Held, Support};
use crate::energy::Energy;
use crate::formulation::Formulation;
use crate::mesh::{Cell, Mesh};
use crate::pose::Section;
use crate::rod::Rod;
use crate::so3;
use crate::stepper::{Diverged, Reason, Report, Termination};
use crate::sweep::Singular;
use cell::{KAPPA, PHI};
use nalgebra::Vector3;
use std::fmt;

type Vec3 = Vector3<f64>;

/// ε of line 10: the largest residual, scaled, of a solution.
const TOLERANCE: f64 = 1e-9;
/// The same in units of the rounding of K κ/Δs.
const ROUNDINGS: f64 = 64.0;
/// Iterations before a step is given up.
const MAX_ITERATIONS: usize = 100;
/// Smallest relaxation of [`Relaxation::Adaptive`].
const LEAST_RELAXATION: f64 = 1.0 / 16.0;
/// Largest turn of a section in one iteration, rad, where Newton knows it: beyond it the linearisation of a rotation
/// means little.
const MAX_ROTATION: f64 = 0.7;
/// Turn of a section in the first step by its initial acceleration alone, rad, up to which the step resolves it.
const RESOLVED_START: f64 = 0.01;
/// Steps over which a held tip is brought back to where its support wants it.
const FEED_STEPS: f64 = 5.0;
/// Times that κ and R of the tip are taken from each other; what is left shrinks by κΔs/2 each time.
const TIP_ITERATIONS: usize = 30;
/// Turn of the tip, rad, that ends them.
const TIP_TOLERANCE: f64 = 1e-15;

/// When orientations, loads and boundary values follow the unknowns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Orientation {
    /// After each iteration, outside the Jacobian (lines 16 to 18): convergence is linear.
    Lagging,
    /// Within the Jacobian: the rotation increment φ_j joins the unknowns of a node, and convergence is quadratic.
    InNewton,
}

/// κ of eq 23.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curvature {
    /// κ_j: first order in Δs.
    First,
    /// (κ_j + κ_j+1)/2: second order.
    Mean,
}

/// How positions are found (line 24).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Positions {
    /// By integrating velocities, node by node: they drift.
    Integrated,
    /// By integrating d₃ from the base, with the curvature of eq 23 constant in a cell.
    Rebuilt,
}

/// At which time the equations hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Balance {
    /// Averaged over the step (eq 17): n rings by −β/(1−β) per step.
    Averaged,
    /// At tᵢ; only rates are averaged.
    AtEnd,
}

/// Where ∂_t x comes from in the first step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// From eq 15 at x⁰ with its n, and ∂_t n = 0 (line 6).
    AsPrinted,
    /// From eqs 14a and 14b with the time derivative of 14d, which give u_t, ω_t and n together. Where a step does not
    /// resolve these accelerations, the first is one of implicit Euler, which asks for none.
    Consistent,
}

/// μ of section 4.3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Relaxation {
    /// The same in each iteration.
    Fixed(f64),
    /// Doubled, up to 1, while the residual falls, and halved when it grows (in the spirit of Gobat 2000); and never a
    /// turn of more than 0.7 rad, where the Jacobian knows it.
    Adaptive,
}

/// What the paper prints, and what may be mended in it; each by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// (α, β, γ)_s.
    pub space: Scheme,
    /// When orientations follow.
    pub orientation: Orientation,
    /// κ of eq 23.
    pub curvature: Curvature,
    /// How positions are found.
    pub positions: Positions,
    /// At which time the equations hold.
    pub balance: Balance,
    /// Where the rates of the first step come from.
    pub start: Start,
    /// μ.
    pub relaxation: Relaxation,
}

/// The trapezoidal rule in space: α = β = γ = ½.
pub const BOX: Scheme = Scheme { alpha: 0.5, beta: 0.5, gamma: 0.5 };

impl Options {
    /// Algorithm 1 line by line.
    pub const AS_PRINTED: Self = Self {
        space: BOX,
        orientation: Orientation::Lagging,
        curvature: Curvature::First,
        positions: Positions::Integrated,
        balance: Balance::Averaged,
        start: Start::AsPrinted,
        relaxation: Relaxation::Fixed(0.8),
    };
    /// All of it mended: second order in time and space, quadratic convergence, no drift, no ringing.
    pub const MENDED: Self = Self {
        space: BOX,
        orientation: Orientation::InNewton,
        curvature: Curvature::Mean,
        positions: Positions::Rebuilt,
        balance: Balance::AtEnd,
        start: Start::Consistent,
        relaxation: Relaxation::Adaptive,
    };
}

/// A rod that this formulation cannot describe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unsupported {
    /// There is no cell.
    NoCells,
    /// Not one section for each node: how many there are, and the nodes.
    Sections(usize, usize),
    /// A base that is not clamped: what it holds. u and ω of the base are given here.
    BaseLetGo(Held),
    /// The rod shears or stretches: its compliance, 1/N. n is the multiplier of a constraint here.
    ShearOrStretch(Vec3),
    /// Kelvin-Voigt damping: its times, s. m is a function of κ here.
    Damping(Vec3),
    /// A body at the tip: its mass, kg, and its inertia, kg·m². n and m of the tip are given here.
    TipBody(f64, f64),
}

impl fmt::Display for Unsupported {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoCells => write!(f, "the mesh has no cell"),
            Self::Sections(given, nodes) => write!(f, "{given} sections for {nodes} nodes"),
            Self::BaseLetGo(held) => write!(f, "a base that is not clamped (it holds {held:?})"),
            Self::ShearOrStretch(c) => write!(f, "a rod that shears or stretches (compliance {c:?} 1/N)"),
            Self::Damping(tau) => write!(f, "a rod with Kelvin-Voigt damping (times {tau:?} s)"),
            Self::TipBody(mass, inertia) => write!(f, "a body at the tip ({mass} kg, {inertia} kg·m²)"),
        }
    }
}

impl std::error::Error for Unsupported {}

/// The rod at one instant; all that a later step depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// At the N+1 nodes, from the base.
    pub nodes: Vec<Node>,
    /// What held it and acted on it.
    pub boundary: Boundary,
    /// Length of the step that led here, s; 0 at a start.
    pub dt: f64,
    /// Scheme of that step.
    pub scheme: Scheme,
}

impl State {
    fn copy_from(&mut self, other: &Self) {
        self.nodes.copy_from_slice(&other.nodes);
        self.boundary = other.boundary;
        self.dt = other.dt;
        self.scheme = other.scheme;
    }

    /// Puts the auxiliary rates where steps of `dt` with `scheme` want them, if those before were others.
    pub fn rebase(&mut self, scheme: Scheme, dt: f64) {
        if (self.scheme, self.dt) == (scheme, dt) {
            return;
        }
        for node in &mut self.nodes {
            node.x_t = node.x_t.zip(node.v_t, |x_t, v_t| {
                let motion = Motion::starting(*x_t, *v_t, Vec3::zeros());
                scheme.rebased(&motion, &self.scheme, self.dt, dt).velocity.auxiliary
            });
        }
        (self.scheme, self.dt) = (scheme, dt);
    }

    fn is_finite(&self) -> bool {
        self.boundary.is_finite() && self.nodes.iter().all(Node::is_finite)
    }

    /// The node at the tip.
    pub fn tip(&self) -> &Node {
        &self.nodes[self.nodes.len() - 1]
    }
}

/// The linear system of an iteration: blocks without the columns of known values, each unknown in a unit of its own.
#[derive(Clone, Debug)]
struct Linear {
    band: Band,
    solution: Vec<f64>,
    /// Units of u, ω, κ, n and φ.
    units: [f64; 5],
    /// Of the six unknowns of the tip, and φ.
    tip_units: [f64; 9],
}

impl Linear {
    fn new(cells: usize, orientation: Orientation) -> Self {
        let size = match orientation {
            Orientation::Lagging => PHI,
            Orientation::InNewton => LARGEST,
        };
        let band = Band::new(cells, size);
        Self { solution: vec![0.0; band.len()], band, units: [1.0; 5], tip_units: [1.0; 9] }
    }

    fn set_units(&mut self, units: [f64; 5], moment: f64, tip: &Tip) {
        let [u, omega, _, n, phi] = units;
        let translation = tip.held.translation.map(|held| if held { n } else { u });
        let rotation = tip.held.rotation.map(|held| if held { moment } else { omega });
        self.units = units;
        self.tip_units = std::array::from_fn(|i| match i {
            0..3 => translation[i],
            3..6 => rotation[i - 3],
            _ => phi,
        });
    }

    /// The unit of unknown `i` of node `j`.
    fn unit(&self, j: usize, i: usize) -> f64 {
        match j {
            0 => self.units[(KAPPA + i) / 3],
            j if j == self.band.cells.len() => self.tip_units[i],
            _ => self.units[i / 3],
        }
    }

    /// Enters the rows of cell `j`: 12×12 (15×15 with φ), of which the first and the last cell lose the six columns of
    /// what their end knows (4.3.1).
    fn enter(&mut self, j: usize, blocks: &Blocks, tip: &TipColumns, right: &Rows) {
        let last = self.band.cells.len() - 1;
        let (near, far) = (self.band.unknowns(j), self.band.unknowns(j + 1));
        let mut before = blocks.before;
        if j == 0 {
            // u and ω of the base, and φ, are known
            let kept = blocks.before.fixed_columns::<CARRIED>(KAPPA).into_owned();
            before.fixed_columns_mut::<CARRIED>(0).copy_from(&kept);
        }
        let mut after = blocks.after;
        if j == last {
            let mut kept = blocks.after.fixed_columns::<PHI>(0) * tip;
            let mut by_phi = kept.fixed_columns_mut::<3>(6);
            by_phi += blocks.after.fixed_columns::<3>(PHI);
            after.fixed_columns_mut::<9>(0).copy_from(&kept);
        }
        for i in 0..near {
            let unit = self.unit(j, i);
            before.column_mut(i).apply(|x| *x *= unit);
        }
        for i in 0..far {
            let unit = self.unit(j + 1, i);
            after.column_mut(i).apply(|x| *x *= unit);
        }
        let rows = &mut self.band.cells[j];
        rows.before = before;
        rows.after = after;
        rows.right[..PHI].copy_from_slice(right.as_slice());
        // orientations are rebuilt by eq 23 and miss nothing
        rows.right[PHI..].fill(0.0);
    }

    fn solve(&mut self) -> Result<(), Singular> {
        self.band.solve(&mut self.solution)
    }

    /// Unknown `i` of node `j`.
    fn at(&self, j: usize, i: usize) -> f64 {
        self.solution[self.band.first(j) + i] * self.unit(j, i)
    }

    fn vector(&self, j: usize, first: usize) -> Vec3 {
        Vec3::new(self.at(j, first), self.at(j, first + 1), self.at(j, first + 2))
    }

    /// The largest turn of a section, where there is one.
    fn largest_turn(&self) -> f64 {
        let last = self.band.cells.len();
        let turn = |j: usize| match self.band.unknowns(j) {
            LARGEST => self.vector(j, PHI).norm(),
            9 if j == last => self.vector(j, 6).norm(),
            _ => 0.0,
        };
        (0..=last).map(turn).fold(0.0, f64::max)
    }

    /// Line 14: x̃ + μ δx̃.
    fn take(&self, reduced: &mut [Vec3], mu: f64) {
        let last = self.band.cells.len();
        for (i, x) in reduced[..2].iter_mut().enumerate() {
            *x += self.vector(0, 3 * i) * mu;
        }
        for (j, x) in (1..last).zip(reduced[2..].chunks_exact_mut(4)) {
            for (i, x) in x.iter_mut().enumerate() {
                *x += self.vector(j, 3 * i) * mu;
            }
        }
        for (i, x) in reduced[4 * last - 2..].iter_mut().enumerate() {
            *x += self.vector(last, 3 * i) * mu;
        }
    }
}

/// A rod on a mesh with the storage to move it; after its construction nothing is allocated.
#[derive(Clone, Debug)]
pub struct Stepper {
    /// The lengths of the cells; the Gauss rule is not used.
    pub mesh: Mesh,
    /// The rod.
    pub rod: Rod,
    /// The way to solve.
    pub options: Options,
    /// The present state.
    pub state: State,
    rest: Vec<Rest>,
    old: State,
    trial: State,
    reduced: Vec<Vec3>,
    linear: Linear,
}

impl Stepper {
    /// The unstressed rod on the base of `boundary`, moving with it as one rigid body; `boundary` acts from now on.
    ///
    /// # Errors
    /// [`Unsupported`].
    pub fn new(mesh: Mesh, rod: Rod, boundary: &Boundary, options: Options) -> Result<Self, Unsupported> {
        Self::with(mesh, rod, boundary, options, |_, node, rest| node.x.kappa = rest.kappa)
    }

    /// A rod whose n and m at the nodes are those of `sections` (its shape follows from m), moving with the base as one
    /// rigid body: an equilibrium of the pose formulation on the same cells, say.
    ///
    /// # Errors
    /// [`Unsupported`].
    pub fn from_sections(
        mesh: Mesh,
        rod: Rod,
        boundary: &Boundary,
        options: Options,
        sections: &[Section],
    ) -> Result<Self, Unsupported> {
        let nodes = mesh.cells.len() + 1;
        if sections.len() != nodes {
            return Err(Unsupported::Sections(sections.len(), nodes));
        }
        let K = rod.stiffness;
        Self::with(mesh, rod, boundary, options, |j, node, rest| {
            let Section { rotation: R, force: n, moment: m, .. } = &sections[j];
            node.x.n = R.tr_mul(n);
            node.x.kappa = R.tr_mul(m).component_div(&K) + rest.kappa;
        })
    }

    fn with(
        mesh: Mesh,
        rod: Rod,
        boundary: &Boundary,
        options: Options,
        fill: impl Fn(usize, &mut Node, &Rest),
    ) -> Result<Self, Unsupported> {
        if mesh.cells.is_empty() {
            return Err(Unsupported::NoCells);
        }
        if boundary.base.held != Held::CLAMPED {
            return Err(Unsupported::BaseLetGo(boundary.base.held));
        }
        if rod.is_extensible() {
            return Err(Unsupported::ShearOrStretch(rod.compliance));
        }
        if rod.damping != Vec3::zeros() {
            return Err(Unsupported::Damping(rod.damping));
        }
        if (rod.tip_mass, rod.tip_inertia) != (0.0, 0.0) {
            return Err(Unsupported::TipBody(rod.tip_mass, rod.tip_inertia));
        }
        let cells = mesh.cells.len();
        let rest = start::rest(&options.space, &mesh.cells);
        let nodes = vec![Node::default(); cells + 1];
        let mut state = State { nodes, boundary: *boundary, dt: 0.0, scheme: Scheme::BACKWARD_EULER };
        for (j, (node, rest)) in state.nodes.iter_mut().zip(&rest).enumerate() {
            fill(j, node, rest);
        }
        let linear = Linear::new(cells, options.orientation);
        let (old, trial, reduced) = (state.clone(), state.clone(), vec![Vec3::zeros(); 4 * cells]);
        let mut stepper = Self { mesh, rod, options, state, rest, old, trial, reduced, linear };
        // dt plays no part in orientations, loads and positions
        let step = step_of(&stepper.rod, &stepper.options, boundary, Scheme::BACKWARD_EULER, 1.0);
        let nodes = &mut stepper.state.nodes;
        orient(&step, &stepper.mesh.cells, &boundary.base, nodes);
        rebuild_positions(&step, &stepper.mesh.cells, &boundary.base, nodes);
        nodes.iter_mut().for_each(|node| node.move_rigidly(&boundary.base));
        Ok(stepper)
    }

    /// The unstressed rod at the nodes.
    pub fn rest(&self) -> &[Rest] {
        &self.rest
    }

    /// One step of `dt` s to `boundary`: Algorithm 1.
    ///
    /// # Errors
    /// [`Diverged`], with [`Reason::BaseLetGo`] where the base of `boundary` is no clamp; the state is as before.
    pub fn step(&mut self, boundary: &Boundary, time: Scheme, dt: f64) -> Result<Report, Diverged> {
        let refused = |reason| Diverged { iterations: 0, residual: f64::INFINITY, reason };
        if boundary.base.held != Held::CLAMPED {
            return Err(refused(Reason::BaseLetGo(boundary.base.held)));
        }
        self.old.copy_from(&self.state);
        // lines 1 to 7; (α, β, γ)_t come from the caller (line 2)
        let time = if self.old.dt == 0.0 {
            self.start(time, dt).map_err(|singular| refused(Reason::Singular(singular)))?
        } else {
            self.old.rebase(time, dt);
            time
        };
        let report = self.relax(boundary, time, dt)?;
        std::mem::swap(&mut self.state, &mut self.trial);
        Ok(report)
    }

    /// Lines 5 and 6, on `old` (lines 3 and 4 came with the rod); the scheme of the first step.
    fn start(&mut self, time: Scheme, dt: f64) -> Result<Scheme, Singular> {
        let Self { mesh, rod, options, rest, old, trial, reduced, linear, .. } = self;
        let boundary = old.boundary;
        let cells = &mesh.cells;
        let mut step = step_of(rod, options, &boundary, time, dt);
        if options.start == Start::Consistent {
            let base = &old.nodes[0];
            let ends = Ends::accelerations(&boundary, base, &old.nodes[cells.len()]);
            let length = mesh.length();
            let fall = boundary.gravity.norm() + boundary.base.acceleration.norm() + f64::MIN_POSITIVE.sqrt();
            let force = rod.mass_per_length * fall * length;
            linear.set_units([fall, fall / length, fall / (length * length), force, 1.0], force * length, &ends.tip);
            start::accelerations(&step, (cells, rest, &old.nodes), &ends, linear, reduced, &mut trial.nodes)?;
            let fastest = trial.nodes.iter().map(|y| y.x.omega.norm()).fold(0.0, f64::max);
            if 0.5 * dt * dt * fastest > RESOLVED_START && time.is_second_order() {
                step.time = Scheme::BACKWARD_EULER;
            }
        }
        match options.start {
            Start::AsPrinted => {
                start::slopes(&step, cells, &mut old.nodes); // line 5
                start::rates_as_printed(&step, rest, &mut old.nodes); // line 6
            }
            Start::Consistent => {
                start::take(&step, cells, &mut trial.nodes, &mut old.nodes); // line 6
                start::slopes(&step, cells, &mut old.nodes); // line 5
            }
        }
        Ok(step.time)
    }

    /// Lines 8 to 25; the result is in `trial`.
    fn relax(&mut self, boundary: &Boundary, time: Scheme, dt: f64) -> Result<Report, Diverged> {
        let Self { mesh, rod, options, rest, old, trial, reduced, linear, .. } = self;
        let (cells, rest) = (mesh.cells.as_slice(), rest.as_slice());
        let step = step_of(rod, options, boundary, time, dt);
        let scales = Scales::new(mesh, rod, old, boundary, time.rate_weight(dt));
        let ends = Ends::new(boundary, old, options, dt);
        linear.set_units(scales.units(), scales.moment, &ends.tip);
        let last = cells.len();

        // line 8: the last configuration is the first guess
        trial.copy_from(old);
        // boundary values, loads and rates of tᵢ, which line 10 asks for before line 18 has come
        ends.fade_out(rod, &rest[last], &trial.nodes, reduced);
        update(&step, cells, rest, &ends, reduced, old, trial);
        let mut k = 0; // line 9
        let (mut mu, mut relaxed) = (1.0f64, false);
        let mut last_residual = f64::INFINITY;
        let residual = loop {
            // line 10: eq 21; the forces of an impulse are far from those before it
            let scales = Scales::new(mesh, rod, trial, boundary, scales.rate);
            let mut residual = 0.0f64;
            for j in 0..last {
                let (before, new) = ([&old.nodes[j], &old.nodes[j + 1]], [&trial.nodes[j], &trial.nodes[j + 1]]);
                let F = step.residual([&rest[j], &rest[j + 1]], before, new);
                residual = scales.residual(&F, residual);
                linear.band.cells[j].right[..PHI].copy_from_slice((-F).as_slice());
            }
            let diverged = |reason| Diverged { iterations: k, residual, reason };
            if !residual.is_finite() {
                return Err(diverged(Reason::NotFinite));
            }
            if residual < scales.tolerance {
                break residual;
            }
            if k == MAX_ITERATIONS {
                return Err(diverged(Reason::TooManyIterations));
            }
            // line 11
            ends.fade_out(rod, &rest[last], &trial.nodes, reduced);
            // line 12, 4.3.1
            let tip = ends.tip.columns(rod, &rest[last], &trial.nodes[last].x, &trial.nodes[last].rotation);
            for (j, cell) in cells.iter().enumerate() {
                let new = [&trial.nodes[j], &trial.nodes[j + 1]];
                let blocks = step.blocks([&rest[j], &rest[j + 1]], new, cell.length);
                let right = linear.band.cells[j].right;
                linear.enter(j, &blocks, &tip, &Rows::from_row_slice(&right[..PHI]));
            }
            // line 13
            linear.solve().map_err(|singular| diverged(Reason::Singular(singular)))?;
            mu = match options.relaxation {
                Relaxation::Fixed(mu) => mu,
                Relaxation::Adaptive if residual > last_residual => (0.5 * mu).max(LEAST_RELAXATION),
                Relaxation::Adaptive => (2.0 * mu).min(1.0),
            };
            let limited = match options.relaxation {
                Relaxation::Fixed(mu) => mu,
                Relaxation::Adaptive => mu.min(MAX_ROTATION / linear.largest_turn().max(MAX_ROTATION)),
            };
            relaxed |= limited < 1.0;
            last_residual = residual;
            // line 14: eq 22, its sign in the right-hand side, with μ
            linear.take(reduced, limited);
            // lines 15 to 21
            update(&step, cells, rest, &ends, reduced, old, trial);
            k += 1; // line 22
        }; // line 23
        // line 24
        match options.positions {
            Positions::Integrated => integrate_positions(&step, old, &boundary.base, &mut trial.nodes),
            Positions::Rebuilt => rebuild_positions(&step, cells, &boundary.base, &mut trial.nodes),
        }
        // line 25: the loads are in the nodes, for the next step
        trial.boundary = *boundary;
        (trial.dt, trial.scheme) = (dt, time);
        for (old, new) in old.nodes.iter().zip(&mut trial.nodes) {
            new.v_t = (new.v - old.v) * (1.0 / dt);
        }
        // not everything has a part in the residual
        if !trial.is_finite() {
            return Err(Diverged { iterations: k, residual, reason: Reason::NotFinite });
        }
        let termination = if relaxed { Termination::Relaxed } else { Termination::Newton };
        Ok(Report { iterations: k, residual, termination })
    }
}

fn step_of<'a>(rod: &'a Rod, options: &'a Options, boundary: &Boundary, time: Scheme, dt: f64) -> Step<'a> {
    Step { rod, options, time, dt, gravity: boundary.gravity }
}

/// Lines 15 to 21 with the unknowns `reduced`.
fn update(step: &Step, cells: &[Cell], rest: &[Rest], ends: &Ends, reduced: &[Vec3], old: &State, new: &mut State) {
    let nodes = new.nodes.as_mut_slice();
    let last = cells.len();
    // line 15
    ends.fade_in(step.rod, &rest[last], reduced, nodes);
    // lines 16, 17
    orient(step, cells, &ends.support, nodes);
    // line 18
    let unknown = [reduced[4 * last - 2], reduced[4 * last - 1]];
    for _ in 0..TIP_ITERATIONS {
        let before = nodes[last].rotation;
        nodes[last].x = ends.tip.fade_in(step.rod, &rest[last], &unknown, &before);
        if step.options.curvature == Curvature::First {
            break;
        }
        // R of the tip hangs on its κ, and κ on R
        let (near, tip) = (nodes[last - 1], &mut nodes[last]);
        step.update_orientation(&near, tip, cells[last - 1].length);
        if (before - tip.rotation).amax() < TIP_TOLERANCE {
            break;
        }
    }
    // line 19
    for (old, new) in old.nodes.iter().zip(nodes.iter_mut()) {
        step.update_rates(old, new);
    }
    // line 20
    step.update_first_slopes(&mut nodes[0], &rest[0]);
    // line 21
    step.update_slopes(cells, nodes);
}

/// Eq 23 from the base, with the loads (lines 16 and 17).
fn orient(step: &Step, cells: &[Cell], base: &Support, nodes: &mut [Node]) {
    nodes[0].rotation = base.rotation;
    step.update_load(&mut nodes[0]);
    for (j, cell) in cells.iter().enumerate() {
        let (before, after) = (nodes[j], &mut nodes[j + 1]);
        step.update_orientation(&before, after, cell.length);
    }
}

/// r_s = d₃ from the base: arcs of constant curvature.
fn rebuild_positions(step: &Step, cells: &[Cell], base: &Support, nodes: &mut [Node]) {
    nodes[0].position = base.position;
    for (j, cell) in cells.iter().enumerate() {
        let (before, after) = (nodes[j], &mut nodes[j + 1]);
        let turn = step.turn(&before.x, &after.x, cell.length);
        // ∫ exp(κ s) ds over the cell is the left Jacobian, the right one of −κΔs
        let chord = so3::right_jacobian(&-turn) * Vec3::z() * cell.length;
        after.position = before.position + before.rotation * chord;
    }
}

/// r_t = R u, by eq 19 as any other rate; the base is where it is.
fn integrate_positions(step: &Step, old: &State, base: &Support, nodes: &mut [Node]) {
    let gamma = step.time.gamma;
    for (old, new) in old.nodes.iter().zip(nodes.iter_mut()) {
        let velocity = |node: &Node| node.rotation * node.x.u;
        new.position = old.position + (velocity(old) * (1.0 - gamma) + velocity(new) * gamma) * step.dt;
    }
    nodes[0].position = base.position;
}

/// Sizes of this step that make residuals comparable.
struct Scales {
    length: f64,
    force: f64,
    moment: f64,
    /// ∂v/∂x, 1/s.
    rate: f64,
    tolerance: f64,
}

impl Scales {
    fn new(mesh: &Mesh, rod: &Rod, state: &State, boundary: &Boundary, rate: f64) -> Self {
        let length = mesh.length();
        let K = rod.stiffness.amax();
        let finest = mesh.cells.iter().fold(f64::INFINITY, |h, cell| h.min(cell.length));
        let carried = |size: fn(&Unknowns) -> f64| state.nodes.iter().map(|node| size(&node.x)).fold(0.0, f64::max);
        let (n, kappa) = (carried(|x| x.n.amax()), carried(|x| x.kappa.amax()));
        let weight = rod.mass_per_length * length * (boundary.gravity.amax() + boundary.base.acceleration.amax());
        let force = n + boundary.tip_force.amax() + weight + 1e-3 * K / (length * length);
        let moment = K * kappa + boundary.tip_moment.amax() + 1e-3 * (K / length + weight * length);
        let rounding = f64::EPSILON * K * (kappa + 1.0 / length) / finest / (moment / length);
        Self { length, force, moment, rate, tolerance: TOLERANCE.max(ROUNDINGS * rounding) }
    }

    /// Units of u, ω, κ, n, φ.
    fn units(&self) -> [f64; 5] {
        [self.length * self.rate, self.rate, 1.0 / self.length, self.force, 1.0]
    }

    /// The larger of `largest` and |F|; NaN if F is.
    fn residual(&self, F: &Rows, largest: f64) -> f64 {
        let Self { length, force, moment, rate, .. } = *self;
        let sizes = [force / length, moment / length, rate / length, rate];
        F.iter().enumerate().fold(largest, |largest, (i, x)| {
            let size = x.abs() / sizes[i / 3];
            if size > largest || size.is_nan() { size } else { largest }
        })
    }
}

impl Formulation for Stepper {
    fn step(&mut self, boundary: &Boundary, scheme: Scheme, dt: f64) -> Result<Report, Diverged> {
        self.step(boundary, scheme, dt)
    }

    fn nodes(&self) -> usize {
        self.state.nodes.len()
    }

    fn section(&self, j: usize) -> Section {
        let node = &self.state.nodes[j];
        let Node { rotation: R, position, x, v, .. } = *node;
        let step = step_of(&self.rod, &self.options, &self.state.boundary, Scheme::BACKWARD_EULER, 1.0);
        let m = step.moment(&self.rest[j], &x.kappa);
        let turn = match j {
            0 => Vec3::zeros(),
            j => step.turn(&self.state.nodes[j - 1].x, &x, self.mesh.cells[j - 1].length),
        };
        Section {
            position,
            rotation: R,
            turn,
            force: R * x.n,
            moment: R * m,
            // eq 12
            acceleration: R * (v.u + x.omega.cross(&x.u) + x.u * self.rod.drag_rate()),
        }
    }

    /// By the trapezoidal rule.
    fn energy(&self, gravity: &Vector3<f64>) -> Energy {
        let Rod { stiffness: K, mass_per_length: rho_A, inertia_per_length: rho_I, .. } = &self.rod;
        let mut energy = Energy::default();
        for (j, cell) in self.mesh.cells.iter().enumerate() {
            for i in [j, j + 1] {
                let Node { x: Unknowns { u, omega, kappa, .. }, position, .. } = &self.state.nodes[i];
                let strain = kappa - self.rest[i].kappa;
                let weight = 0.5 * cell.length;
                let spin = omega.dot(&rho_I.component_mul(omega));
                energy.kinetic += 0.5 * weight * (rho_A * u.norm_squared() + spin);
                energy.elastic += 0.5 * weight * strain.dot(&K.component_mul(&strain));
                energy.gravity -= weight * rho_A * gravity.dot(position);
            }
        }
        energy
    }
}
