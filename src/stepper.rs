//! From one state to the next: Newton on the lifted unknowns, for a time step and for statics, and the consistent
//! start.
//!
//! A step never changes the state it starts from; the new one is in [`Stepper::state`] after success only.

// R is the paper's letter
#![allow(non_snake_case)]

use crate::alpha::{Motion, Scheme};
use crate::boundary::{Boundary, Held, Support};
use crate::energy::Powers;
use crate::mesh::{Cell, Mesh};
use crate::pose::{self, Row, Section, State, Time};
use crate::rod::Rod;
use crate::runge_kutta::{self, RungeKutta};
use crate::so3;
use crate::sweep::{Increment, Largest, Residuals, Scales, Singular, Sweep, System, larger};
use nalgebra::{Matrix3, Vector3};
use std::fmt;

/// Newton's iterations before the step is given up; a step that resolves the motion takes 3 to 5.
const MAX_ITERATIONS: usize = 25;
/// The same with relaxation μ = ½, where each iteration gains at most one bit of the residual.
const MAX_RELAXED_ITERATIONS: usize = 60;
/// The same in a stage of a step of order 4, which begins with a good guess or is better taken smaller.
const MAX_STAGE_ITERATIONS: usize = 10;
/// The same from a guess by which all goes on smoothly, which is given up for a nearer one.
const MAX_SMOOTH_ITERATIONS: usize = 5;
/// Largest rotation of a section in one iteration, rad: beyond it the linearisation of a rotation means little.
const MAX_ROTATION: f64 = 0.7;
/// Increment, scaled, after which Newton has converged: the next would be of the order of its square.
const TOLERANCE: f64 = 1e-8;
/// The same in units of the rounding of n and m, for steps and cells so small that rounding exceeds [`TOLERANCE`].
const ROUNDINGS: f64 = 256.0;

/// Bounds of what the iteration of a stage may leave, rad: the roundings, and what Newton still gains from.
const LEFT: (f64, f64) = (1e-13, 1e-3);
/// Part of an increment of Newton's own that it leaves at most: what the Jacobian leaves out, or its square.
const NEWTON_LEAVES: f64 = 1e-2;
/// Iterations in which kept factors must be seen to lead there: beyond them new ones cost less.
const SOON: i32 = 4;
/// Part of the increment before that one with kept factors may have and still be taken.
const WORST_RATE: f64 = 0.7;

/// Turn of a section in a step up to which the step resolves the motion, rad: well below the angles (about 1 rad) where
/// Newton on the accelerations of the rotations begins to fail and energy to grow.
const RESOLVED: f64 = 0.35;
/// The same to come back from steps that did not, lower so that the two do not alternate.
const RESOLVED_AGAIN: f64 = 0.25;
/// Turn of a section in the first step by its initial acceleration alone, up to which that acceleration says how the
/// motion begins.
const RESOLVED_START: f64 = 0.01;
/// Change of the accelerations in a step, relative to them, below which the auxiliary rates may be moved to another
/// scheme.
const SMOOTH: f64 = 0.25;
/// Turn of a section in a step, rad, that no change of its acceleration need be smaller than.
const NEGLIGIBLE: f64 = 1e-6;
/// Part of a step by which the next may differ and still be the same: hosts take the differences of rounded times.
const ROUND_OFF: f64 = 1e-9;
/// Stages before one that its guess goes on from.
const ONWARD: usize = 3;
/// Part of the static loads below which the equilibrium is given up.
const SMALLEST_LOAD_PART: f64 = 1e-4;

/// How an iteration ended well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// Newton iterations, those before a restart included.
    pub iterations: usize,
    /// Largest scaled residual before the last increment.
    pub residual: f64,
    /// What it took.
    pub termination: Termination,
}

/// The ways to converge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Termination {
    /// With full (limited) Newton steps.
    Newton,
    /// With under-relaxation, after full steps failed.
    Relaxed,
}

/// An iteration that did not converge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diverged {
    /// Newton iterations spent.
    pub iterations: usize,
    /// Largest scaled residual at the end.
    pub residual: f64,
    /// Why it ended.
    pub reason: Reason,
}

/// The ways to fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The increments did not become small.
    TooManyIterations,
    /// The linearised equations have no unique solution.
    Singular(Singular),
    /// A number overflowed, or one that was given is not finite.
    NotFinite,
    /// It converged to another solution than the one that follows, of much more energy.
    Elsewhere,
    /// The formulation clamps the base, which is to hold this only.
    BaseLetGo(Held),
}

impl fmt::Display for Diverged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { iterations, residual, reason } = self;
        write!(f, "no convergence after {iterations} iterations, scaled residual {residual:.1e}: ")?;
        match reason {
            Reason::TooManyIterations => write!(f, "too many iterations"),
            Reason::Singular(singular) => write!(f, "{singular}"),
            Reason::NotFinite => write!(f, "a number is not finite"),
            Reason::Elsewhere => write!(f, "to a solution of much more energy only"),
            Reason::BaseLetGo(held) => write!(f, "the base is to be clamped, and holds {held:?}"),
        }
    }
}

impl std::error::Error for Diverged {}

/// A step of a Runge-Kutta method that was computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attempt {
    /// Newton iterations, of all stages.
    pub iterations: usize,
    /// Estimate of its error: how far it moves the centreline, over the length of the rod.
    pub error: f64,
    /// What was done in it, J.
    pub work: Powers,
}

/// Rates of the coordinates θ of a section since the beginning of a step, and of its κ; body frame.
#[derive(Clone, Copy, Debug, Default)]
struct Rates {
    theta_t: Vector3<f64>,
    theta_tt: Vector3<f64>,
    kappa_t: Vector3<f64>,
}

/// n, m and a of a section, which follow from the motion and have no history.
#[derive(Clone, Copy, Debug, Default)]
struct Carried {
    force: Vector3<f64>,
    moment: Vector3<f64>,
    acceleration: Vector3<f64>,
}

/// The factors that one stage of a step of order 4 leaves to the next.
#[derive(Clone, Copy, PartialEq)]
enum Factors {
    /// There are none of this step.
    Missing,
    /// They serve.
    Good,
    /// The rod turns too much from stage to stage.
    Poor,
    /// Every iteration has its own, as a stage was lost with others.
    Unused,
}

/// What a stage begins with, beyond what the stages before give of it.
#[derive(Clone, Copy, PartialEq)]
enum Guess {
    /// All goes on through the last three stages.
    Smooth,
    /// The accelerations go on through the last two, n, m and a are those of the last: less near, and never far.
    Near,
}

/// A rod on a mesh with the storage to move it; after its construction nothing is allocated.
#[derive(Clone, Debug)]
pub struct Stepper {
    /// The mesh.
    pub mesh: Mesh,
    /// The rod.
    pub rod: Rod,
    /// The present state.
    pub state: State,
    old: State,
    trial: State,
    /// Within the last step of order 4.
    seen: State,
    /// Its length, s, and method.
    span: f64,
    method: &'static RungeKutta,
    system: System,
    sweep: Sweep,
    /// The rates of everything that has a history, stage by stage of a step of order 4.
    stages: Vec<Rates>,
    /// What the sections carry at the last stages, of the nodes and then of the points; of stage i at i modulo [`ONWARD`].
    carried: Vec<Carried>,
}

impl Stepper {
    /// A rod in the given state.
    pub fn new(mesh: Mesh, rod: Rod, state: State) -> Self {
        let extensible = rod.is_extensible();
        let system = System::new(mesh.cells.len(), &mesh.rule, extensible);
        let sweep = Sweep::new(mesh.cells.len(), &mesh.rule, extensible);
        let stages = vec![Default::default(); runge_kutta::MAX_STAGES * state.memory.len()];
        let carried = vec![Default::default(); ONWARD * (state.nodes.len() + state.points.len())];
        Self {
            old: state.clone(),
            trial: state.clone(),
            seen: state.clone(),
            span: 0.0,
            method: &runge_kutta::ESDIRK4,
            state,
            mesh,
            rod,
            system,
            sweep,
            stages,
            carried,
        }
    }

    /// Makes room for `cells` cells, so that [`Self::resume`] and [`crate::refine`] allocate nothing up to so many.
    pub fn reserve(&mut self, cells: usize) {
        let count = self.mesh.cells.len();
        let (most, stages) = (cells.max(count), self.mesh.rule.stages);
        self.mesh.cells.reserve(most - count);
        let Self { state, old, trial, seen, .. } = self;
        for state in [state, old, trial, seen] {
            state.reserve(most - count, stages);
        }
        self.resize(most);
        self.resize(count);
    }

    /// Makes `state` on `mesh`, of the same rule, the present one.
    pub fn resume(&mut self, mesh: &Mesh, state: &State) {
        self.take_mesh(&mesh.cells);
        self.state.copy_from(state);
    }

    /// Takes these cells in place of its own; the present state is to be set.
    pub(crate) fn take_mesh(&mut self, cells: &[Cell]) {
        self.mesh.cells.clear();
        self.mesh.cells.extend_from_slice(cells);
        self.state.resize(cells.len(), self.mesh.rule.stages);
        self.resize(cells.len());
    }

    /// Makes room for a step on as many cells.
    fn resize(&mut self, cells: usize) {
        let Self { mesh, system, sweep, stages, carried, .. } = self;
        let points = cells * mesh.rule.stages;
        system.resize(cells, &mesh.rule);
        sweep.resize(cells);
        stages.resize(runge_kutta::MAX_STAGES * (points + 1), Default::default());
        carried.resize(ONWARD * (points + cells + 1), Default::default());
    }

    /// Exchanges the cells; the new mesh, the rod, the present state and the one on the new mesh, which is to be set.
    pub(crate) fn remesh(&mut self, cells: &mut Vec<Cell>) -> (&Mesh, &Rod, &State, &mut State) {
        self.old.copy_from(&self.state);
        std::mem::swap(&mut self.mesh.cells, cells);
        let count = self.mesh.cells.len();
        self.state.resize(count, self.mesh.rule.stages);
        self.resize(count);
        (&self.mesh, &self.rod, &self.old, &mut self.state)
    }

    /// Takes the last exchange of cells back.
    pub(crate) fn undo_remesh(&mut self, cells: &mut Vec<Cell>) {
        std::mem::swap(&mut self.mesh.cells, cells);
        self.state.copy_from(&self.old);
        self.resize(self.mesh.cells.len());
    }

    /// The state before the last step.
    pub fn previous(&self) -> &State {
        // a step swaps the two
        &self.trial
    }

    /// Takes the last step back: the state is the one before it.
    pub(crate) fn take_back(&mut self) {
        std::mem::swap(&mut self.state, &mut self.trial);
    }

    /// One step of `dt` s to `boundary` in the way that suits it.
    ///
    /// A step that resolves the motion uses `scheme` and the accelerations of the section rotations, whose reaction
    /// does not ring. One that would turn a section further than it can follow, or one that Newton loses, uses the
    /// accelerations of the positions with spectral radius 0: there Newton converges at any step size and energy falls.
    /// Such steps begin with implicit Euler, which needs no auxiliary rates, and keep spectral radius 0 until the
    /// accelerations are smooth. A start whose accelerations do not say how the motion begins (damped, released from a
    /// shape out of balance) begins the same way.
    ///
    /// # Errors
    /// [`Diverged`]; the state is as before.
    pub fn advance(&mut self, boundary: &Boundary, scheme: Scheme, dt: f64) -> Result<Report, Diverged> {
        let started = self.state.dt > 0.0;
        let points = &self.state.memory[..self.mesh.points()];
        let most = |size: fn(&Motion) -> f64| points.iter().map(|memory| size(&memory.spin)).fold(0.0, f64::max);
        let turn = dt * most(|spin| spin.velocity.value.norm());
        let floor = Scheme::from_spectral_radius(0.0);
        let of_positions = self.rod.is_extensible() || boundary.holds_positions();
        if of_positions && (started || self.rod.is_extensible()) {
            let scheme = match (started, turn < RESOLVED) {
                (false, _) => Scheme::BACKWARD_EULER,
                (true, true) => scheme,
                (true, false) => floor,
            };
            return self.step(boundary, scheme, dt, Row::Positions);
        }
        // an acceleration counts where it takes part as if it were constant: where the auxiliary rates begin anew
        let acceleration = most(|spin| spin.acceleration.value.norm());
        let bend = 0.5 * dt * dt * acceleration;
        let change = dt * most(|spin| spin.jerk.norm());
        let changes_less = |part: f64| change <= part * acceleration + NEGLIGIBLE / (dt * dt);
        // implicit Euler and spectral radius 0 have the same auxiliary rates
        let same_step = (self.state.dt - dt).abs() <= ROUND_OFF * dt;
        let on_floor = started && same_step && self.state.scheme.gamma == floor.gamma;
        let resolved = match (started, on_floor && self.state.row == Row::Positions) {
            (false, _) => turn < RESOLVED && bend < RESOLVED_START && changes_less(1.0),
            (true, true) => turn + bend < RESOLVED_AGAIN && changes_less(1.0),
            (true, false) if !same_step => turn + bend < RESOLVED,
            (true, false) => turn < RESOLVED,
        };
        let mut lost = 0;
        if resolved {
            let unsmooth = on_floor && scheme.is_second_order() && !changes_less(SMOOTH);
            let scheme = if unsmooth { floor } else { scheme };
            match self.step(boundary, scheme, dt, Row::Rotations) {
                Ok(report) => return Ok(report),
                Err(diverged) => lost = diverged.iterations,
            }
        }
        let scheme = if on_floor { floor } else { Scheme::BACKWARD_EULER };
        self.step(boundary, scheme, dt, Row::Positions)
            .map(|report| Report { iterations: lost + report.iterations, ..report })
            .map_err(|diverged| Diverged { iterations: lost + diverged.iterations, ..diverged })
    }

    /// One step of `dt` s to `boundary` with a given scheme and acceleration row; a rod that shears or stretches, or
    /// whose ends [hold positions](Boundary::holds_positions), has only [`Row::Positions`].
    ///
    /// # Errors
    /// [`Diverged`]; the state is as before.
    pub fn step(&mut self, boundary: &Boundary, scheme: Scheme, dt: f64, row: Row) -> Result<Report, Diverged> {
        let row = if self.rod.is_extensible() || boundary.holds_positions() { Row::Positions } else { row };
        self.old.copy_from(&self.state);
        self.old.prepare(scheme, dt);
        self.solve(boundary, &Time::Step { scheme, dt, row })
    }

    /// The static equilibrium under `boundary`, reached from the present state by Newton.
    ///
    /// # Errors
    /// [`Diverged`]; the state is as before.
    pub fn relax(&mut self, boundary: &Boundary) -> Result<Report, Diverged> {
        self.old.copy_from(&self.state);
        self.solve(boundary, &Time::Static)
    }

    /// The static equilibrium under `boundary`, `dt` s after the present one: as [`Self::relax`], with the differences of
    /// the two as velocities.
    ///
    /// # Errors
    /// [`Diverged`]; the state is as before.
    pub fn drift(&mut self, boundary: &Boundary, dt: f64) -> Result<Report, Diverged> {
        let report = self.relax(boundary)?;
        let Self { state, trial: before, .. } = self;
        let moving = |change: Vector3<f64>| Motion::starting(change / dt, Vector3::zeros(), Vector3::zeros());
        for i in 0..state.memory.len() {
            let (from, to) = (before.remembering(i), state.remembering(i));
            let (turn, way) = (so3::log(&from.rotation.tr_mul(&to.rotation)), to.position - from.position);
            let memory = &mut state.memory[i];
            (memory.spin, memory.travel) = (moving(turn), moving(way));
            memory.strain = moving(memory.kappa - before.memory[i].kappa);
        }
        Ok(report)
    }

    /// Computes a step of `h` s by a method of [`runge_kutta`] under `drive`, what acts as a function of the time since its
    /// beginning; [`Self::accept`] takes it. The present accelerations must be consistent with what acts
    /// ([`Self::accelerate`]). For a rod that neither shears nor stretches, clamped at its base and free at its tip.
    ///
    /// `accuracy` is the displacement of the centreline, over the length, that an iteration need not resolve.
    ///
    /// # Errors
    /// [`Diverged`]; nothing has changed.
    pub fn attempt(
        &mut self,
        method: &'static RungeKutta,
        drive: &impl Fn(f64) -> Boundary,
        h: f64,
        accuracy: f64,
    ) -> Result<Attempt, Diverged> {
        let weight = 1.0 / (method.gamma * h);
        let time = Time::Stage { weight };
        (self.span, self.method) = (h, method);
        self.old.copy_from(&self.state);
        self.trial.go_on_from(&self.state);
        let begin = drive(0.0);
        for m in 0..self.old.memory.len() {
            self.old.known[m].rotation = self.old.remembering(m).rotation;
            let (rates, memory) = (&mut self.stages[m], &self.old.memory[m]);
            // θ = 0: θ_t = ω, θ_tt = ω_t
            *rates = Rates {
                theta_t: memory.spin.velocity.value,
                theta_tt: memory.spin.acceleration.value,
                kappa_t: memory.strain.velocity.value,
            };
        }
        self.take_carried(0);
        let mut work = Powers::of(&self.mesh, &self.rod, &self.old, &begin).times(h * method.weight(0));
        let mut iterations = 0;
        let mut factors = Factors::Missing;
        for i in 1..method.stages {
            let boundary = drive(method.c[i] * h);
            for guess in [Guess::Smooth, Guess::Near] {
                let prepare = |stepper: &mut Self| stepper.prepare_stage(i, h, weight, &boundary, guess);
                match self.stage(prepare, &boundary, &time, accuracy, &mut factors) {
                    Ok(taken) => {
                        iterations += taken;
                        break;
                    }
                    Err(diverged) => {
                        iterations += diverged.iterations;
                        factors = Factors::Unused;
                        if guess == Guess::Near {
                            return Err(Diverged { iterations, ..diverged });
                        }
                    }
                }
            }
            let last = i == method.stages - 1;
            let Self { mesh, rod, old, trial, stages, .. } = self;
            let rates = &mut stages[i * old.memory.len()..];
            let take = |m: usize, [theta_t, theta_tt, kappa_t]: [Vector3<f64>; 3]| {
                rates[m] = Rates { theta_t, theta_tt, kappa_t }
            };
            if last {
                trial.settle_and_take(mesh, rod, old, &boundary, &time, take);
            } else {
                trial.settle_within(mesh, rod, old, &boundary, &time, take);
            }
            self.take_carried(i);
            work = work.plus(Powers::of(&self.mesh, &self.rod, &self.trial, &boundary), h * method.weight(i));
        }
        let error = self.displacement(|j| method.error_weight(j));
        if !(self.trial.is_finite() && error.is_finite()) {
            return Err(Diverged { iterations, residual: error, reason: Reason::NotFinite });
        }
        Ok(Attempt { iterations, error, work })
    }

    /// The end of the attempted step.
    pub fn attempted(&self) -> &State {
        &self.trial
    }

    /// Makes the attempted step the present state.
    pub fn accept(&mut self) {
        std::mem::swap(&mut self.state, &mut self.trial);
    }

    /// The rod at the fraction 0 to 1 of the step of order 4 that was last attempted, under what acts then, consistent with
    /// the equations of motion: positions and velocities to order 4, accelerations and with them n and m to order 3. Good
    /// until the next step or equilibrium; nothing but what is returned has changed.
    pub fn look(&mut self, fraction: f64, boundary: &Boundary) -> &State {
        let Self { mesh, rod, old, stages, seen, span, method, .. } = self;
        seen.copy_from(old);
        let count = old.memory.len();
        for m in 0..count {
            let (first, last) = (&stages[m], &stages[(method.stages - 1) * count + m]);
            let grown = |rate: fn(&Rates) -> Vector3<f64>| {
                let sum = |sum, j| sum + rate(&stages[j * count + m]) * (*span * method.weight(j));
                (0..method.stages).fold(Vector3::zeros(), sum)
            };
            let begin = [Vector3::zeros(), first.theta_t, first.theta_tt];
            let end = [grown(|rates| rates.theta_t), last.theta_t, last.theta_tt];
            let turn = runge_kutta::between(&begin, &end, *span, fraction);
            let strain = runge_kutta::slope_between(
                &grown(|rates| rates.kappa_t),
                [&first.kappa_t, &last.kappa_t],
                *span,
                fraction,
            );
            seen.turn_history(m, &old.remembering(m).rotation, turn, strain);
        }
        seen.balance(mesh, rod, boundary);
        seen
    }

    /// What the stages before stage `i` give of its coordinates, and a guess of it.
    fn prepare_stage(&mut self, i: usize, h: f64, weight: f64, boundary: &Boundary, guess: Guess) {
        let Self { mesh, old, trial, stages, carried, method, .. } = self;
        let (on, carried_on) = match guess {
            Guess::Smooth => (method.onward(i, 3), method.onward(i, 3)),
            Guess::Near => (method.onward(i, 2), method.onward(i, 1)),
        };
        let (count, sections) = (old.memory.len(), old.nodes.len() + old.points.len());
        let last = i.saturating_sub(ONWARD)..i;
        let carry = |section: &mut Section, index: usize| {
            let mut on = Carried::default();
            for j in last.clone() {
                let (carried, weight) = (&carried[j % ONWARD * sections + index], carried_on[j]);
                on.force += carried.force * weight;
                on.moment += carried.moment * weight;
                on.acceleration += carried.acceleration * weight;
            }
            (section.force, section.moment, section.acceleration) = (on.force, on.moment, on.acceleration);
        };
        let (per_cell, nodes) = (mesh.rule.stages, old.nodes.len());
        trial.nodes[0].rotation = boundary.base.rotation;
        carry(&mut trial.nodes[0], 0);
        for m in 0..count {
            let known = &mut old.known[m];
            // θ_t = ω where θ = 0
            (known.theta, known.rate, known.kappa) = (Vector3::zeros(), stages[m].theta_t, old.memory[m].kappa);
            let mut theta_tt = Vector3::zeros();
            for j in 0..i {
                let (rates, a) = (&stages[j * count + m], h * method.a[i][j]);
                known.theta += rates.theta_t * a;
                known.rate += rates.theta_tt * a;
                known.kappa += rates.kappa_t * a;
                theta_tt += rates.theta_tt * on[j];
            }
            let theta = known.theta + (known.rate + theta_tt / weight) / weight;
            if let Some(point) = trial.points.get_mut(m) {
                point.rotation = known.rotation * so3::exp(&theta);
                carry(point, nodes + m);
                if m % per_cell == per_cell - 1 {
                    let cell = m / per_cell;
                    trial.carry_node(mesh, cell);
                    carry(&mut trial.nodes[cell + 1], cell + 1);
                }
            }
        }
    }

    /// Newton from the guess that `prepare` puts in `trial` to the stage, in `trial`.
    ///
    /// Factors are kept as long as they soon lead there: increments that fall by the rate q leave an error of q/(1 − q)
    /// times the last. One that hardly falls is not taken; where the factors were another stage's, Newton then begins
    /// anew from the guess.
    fn stage(
        &mut self,
        prepare: impl Fn(&mut Self),
        boundary: &Boundary,
        time: &Time,
        accuracy: f64,
        factors: &mut Factors,
    ) -> Result<usize, Diverged> {
        prepare(self);
        let (scales, rounding) = scales(&self.mesh, &self.rod, &self.old, boundary, time);
        let target = accuracy.clamp(LEFT.0, LEFT.1);
        let mut keep = *factors == Factors::Good;
        let mut borrowed = keep;
        let mut before = f64::INFINITY;
        let (mut iterations, mut factorised) = (0, 0);
        loop {
            iterations += 1;
            let Self { mesh, rod, system, sweep, old, trial, .. } = self;
            let diverged = |system: &System, reason| {
                Err(Diverged { iterations, residual: system.residuals.largest(&scales), reason })
            };
            if keep {
                pose::assemble_residuals(mesh, rod, old, trial, boundary, time, system);
                sweep.solve_for(&system.residuals);
            } else {
                (factorised, borrowed) = (factorised + 1, false);
                pose::assemble(mesh, rod, old, trial, boundary, time, system);
                if let Err(singular) = sweep.solve(system) {
                    return diverged(system, Reason::Singular(singular));
                }
            }
            let Largest { turn, force, moment } = sweep.largest;
            let size = larger(turn, if force < ROUNDINGS * rounding { 0.0 } else { force / scales.force });
            // 0 where there was none before
            let rate = size / before;
            if keep && !(rate < WORST_RATE && (size + moment).is_finite()) {
                keep = false;
                if borrowed {
                    (borrowed, *factors, before) = (false, Factors::Poor, f64::INFINITY);
                    prepare(self);
                }
                continue;
            }
            if !(size + force + moment).is_finite() {
                return diverged(system, Reason::NotFinite);
            }
            trial.apply(&sweep.nodes, &sweep.points, (MAX_ROTATION / turn).min(1.0), time.row());
            let left = rate / (1.0 - rate) * size;
            let seen = keep && before.is_finite();
            let converged = if seen { left <= target } else { !keep && size * NEWTON_LEAVES <= target };
            if converged {
                if *factors == Factors::Missing {
                    *factors = Factors::Good;
                }
                return Ok(iterations);
            }
            let most = if *factors == Factors::Unused { MAX_STAGE_ITERATIONS } else { MAX_SMOOTH_ITERATIONS };
            if factorised == most {
                return diverged(system, Reason::TooManyIterations);
            }
            let soon = !seen || left * rate.powi(SOON) <= target;
            if borrowed && !soon {
                *factors = Factors::Poor;
            }
            (keep, before) = (soon && *factors != Factors::Unused, size);
        }
    }

    /// What the sections carry at stage `i`, which is in `trial`.
    fn take_carried(&mut self, i: usize) {
        let Self { trial, carried, .. } = self;
        let first = i % ONWARD * (trial.nodes.len() + trial.points.len());
        for (section, carried) in trial.nodes.iter().chain(&trial.points).zip(&mut carried[first..]) {
            let Section { force, moment, acceleration, .. } = *section;
            *carried = Carried { force, moment, acceleration };
        }
    }

    /// What a step of order 2 in the place of the one last attempted would be estimated to err by, as [`Attempt::error`].
    pub fn simple_error(&self) -> f64 {
        self.displacement(|j| self.method.simple_weight(j))
    }

    /// How far the θ_t of the stages of the step last attempted, added up with these weights, move a node, over the length.
    fn displacement(&self, weight: impl Fn(usize) -> f64) -> f64 {
        let Self { mesh, old, stages, method, span: h, .. } = self;
        let mut way = Vector3::zeros();
        let mut most = 0.0f64;
        let per_cell = mesh.rule.stages;
        for (m, section) in old.points.iter().enumerate() {
            let theta = (0..method.stages)
                .fold(Vector3::zeros(), |sum, j| sum + stages[j * old.memory.len() + m].theta_t * (h * weight(j)));
            let length = mesh.cells[m / per_cell].length * mesh.rule.b[m % per_cell];
            way += section.rotation * theta.cross(&Vector3::z()) * length;
            if m % per_cell == per_cell - 1 {
                most = larger(most, way.norm());
            }
        }
        most / mesh.length()
    }

    fn solve(&mut self, boundary: &Boundary, time: &Time) -> Result<Report, Diverged> {
        let full = self.newton(boundary, time, 1.0, MAX_ITERATIONS);
        let result = match full {
            Ok((iterations, residual)) => Ok(Report { iterations, residual, termination: Termination::Newton }),
            Err(first) => match self.newton(boundary, time, 0.5, MAX_RELAXED_ITERATIONS) {
                Ok((iterations, residual)) => Ok(Report {
                    iterations: first.iterations + iterations,
                    residual,
                    termination: Termination::Relaxed,
                }),
                Err(second) => Err(Diverged { iterations: first.iterations + second.iterations, ..second }),
            },
        }?;
        self.trial.settle(&self.mesh, &self.rod, &self.old, boundary, time);
        // the last increment, and what has no part in the residual
        if !self.trial.is_finite() {
            let Report { iterations, residual, .. } = result;
            return Err(Diverged { iterations, residual, reason: Reason::NotFinite });
        }
        std::mem::swap(&mut self.state, &mut self.trial);
        Ok(result)
    }

    /// Newton with relaxation `mu` from the last configuration; the result is in `trial`.
    fn newton(
        &mut self,
        boundary: &Boundary,
        time: &Time,
        relaxation: f64,
        max_iterations: usize,
    ) -> Result<(usize, f64), Diverged> {
        let Self { mesh, rod, system, sweep, old, trial, .. } = self;
        trial.copy_from(old);
        let (scales, rounding) = scales(mesh, rod, old, boundary, time);
        let mut residual = f64::INFINITY;
        for iteration in 1..=max_iterations {
            let diverged = |residual, reason| Diverged { iterations: iteration, residual, reason };
            pose::assemble(mesh, rod, old, trial, boundary, time, system);
            residual = system.residuals.largest(&scales);
            if !residual.is_finite() {
                return Err(diverged(residual, Reason::NotFinite));
            }
            sweep.solve(system).map_err(|s| diverged(residual, Reason::Singular(s)))?;

            let Largest { turn, force, moment } = sweep.largest;
            if !(turn + force + moment).is_finite() {
                return Err(diverged(residual, Reason::NotFinite));
            }
            let limited = relaxation * (MAX_ROTATION / turn).min(1.0);
            let converged = turn < TOLERANCE
                && force < (TOLERANCE * scales.force).max(ROUNDINGS * rounding)
                && moment < (TOLERANCE * scales.moment).max(ROUNDINGS * rounding * mesh.length());
            // the last increment is taken in full: it is small
            trial.apply(&sweep.nodes, &sweep.points, if converged { 1.0 } else { limited }, time.row());
            if converged {
                return Ok((iteration, residual));
            }
        }
        Err(Diverged { iterations: max_iterations, residual, reason: Reason::TooManyIterations })
    }

    /// The static equilibrium under `boundary`: loads and supports go from those of the present state to `boundary` in
    /// as many parts as Newton needs.
    ///
    /// # Errors
    /// [`Diverged`] of the smallest part; the state is as before.
    pub fn equilibrium(&mut self, boundary: &Boundary) -> Result<Report, Diverged> {
        let begin = self.state.clone();
        let (first, last) = (&begin.nodes[0], begin.tip());
        let (mut done, mut part) = (0.0, 1.0);
        let mut iterations = 0;
        loop {
            let share = f64::min(done + part, 1.0);
            let from = &begin.boundary;
            let between = |a: &Vector3<f64>, b: &Vector3<f64>| a * (1.0 - share) + b * share;
            let moved = |from: &Support, section: &Section, to: &Support| {
                // a support that held something else, or nothing, was not on its way to this one
                let (r, R) = match from.held == to.held {
                    true => (&from.position, &from.rotation),
                    false => (&section.position, &section.rotation),
                };
                let turn = so3::log(&R.tr_mul(&to.rotation)) * share;
                Support { position: between(r, &to.position), rotation: R * so3::exp(&turn), ..*to }
            };
            let loaded = if share < 1.0 {
                Boundary {
                    base: moved(&from.base, first, &boundary.base),
                    tip: moved(&from.tip, last, &boundary.tip),
                    tip_force: between(&from.tip_force, &boundary.tip_force),
                    tip_moment: between(&from.tip_moment, &boundary.tip_moment),
                    gravity: between(&from.gravity, &boundary.gravity),
                }
            } else {
                *boundary
            };
            match self.relax(&loaded) {
                Ok(report) => {
                    iterations += report.iterations;
                    done = share;
                    if done == 1.0 {
                        return Ok(Report { iterations, ..report });
                    }
                    part *= 2.0;
                }
                Err(diverged) => {
                    iterations += diverged.iterations;
                    part *= 0.25;
                    if part < SMALLEST_LOAD_PART {
                        self.state = begin;
                        return Err(Diverged { iterations, ..diverged });
                    }
                }
            }
        }
    }

    /// The increments of the static rod about the present state under loads that `load` writes into the residuals.
    ///
    /// # Errors
    /// [`Diverged`] if the stiffness is singular.
    pub fn linear_statics(
        &mut self,
        boundary: &Boundary,
        load: impl Fn(&Mesh, &Rod, &State, &mut Residuals),
    ) -> Result<(&[Increment], &[Increment]), Diverged> {
        let Self { mesh, rod, state, system, sweep, .. } = self;
        pose::assemble(mesh, rod, state, state, boundary, &Time::Static, system);
        load(mesh, rod, state, &mut system.residuals);
        sweep.solve(system).map_err(singular)?;
        Ok((&sweep.nodes, &sweep.points))
    }

    /// Consistent accelerations, and their rates, of the present state with its velocities: what the equations of
    /// motion give for ω_t and a at a start, where no history tells them. A rod that shears or stretches keeps
    /// accelerations of zero (and takes its first step by implicit Euler): its centreline has dynamics of its own.
    ///
    /// # Errors
    /// [`Diverged`] if the equations of a cell are singular; the state is as before.
    pub fn start(&mut self, boundary: &Boundary) -> Result<(), Diverged> {
        if self.rod.is_extensible() {
            return Ok(());
        }
        self.solve_accelerations(boundary)?;
        pose::assemble_jerks(&self.mesh, &self.rod, &mut self.trial, &self.sweep, &mut self.system);
        self.sweep.solve(&self.system).map_err(singular)?;
        self.trial.take_jerks(&self.rod, &self.sweep.nodes, &self.sweep.points);
        std::mem::swap(&mut self.state, &mut self.trial);
        Ok(())
    }

    /// As [`Self::start`], of a rod that `moves` other than as one rigid body: the rates of its accelerations are then not
    /// known, and those that it keeps if it shears or stretches are its own.
    ///
    /// # Errors
    /// [`Diverged`] as of [`Self::start`].
    pub fn begin(&mut self, boundary: &Boundary, moves: bool) -> Result<(), Diverged> {
        match moves {
            true if self.rod.is_extensible() => Ok(()),
            true => self.accelerate(boundary),
            false => self.start(boundary),
        }
    }

    /// Consistent accelerations as [`Self::start`], without their rates: where what acts has jumped.
    ///
    /// # Errors
    /// [`Diverged`] as of [`Self::start`].
    pub fn accelerate(&mut self, boundary: &Boundary) -> Result<(), Diverged> {
        self.solve_accelerations(boundary)?;
        self.trial.dt = 0.0;
        std::mem::swap(&mut self.state, &mut self.trial);
        Ok(())
    }

    /// How much of the rod the base feels at once, kg, world frame: the force on the base is less by this times what the
    /// acceleration of the base is more. Zero for a rod that shears or stretches, whose centreline follows later. It is all
    /// that is felt at once: a base that begins to turn bends the rod first, and what an acceleration does comes without
    /// a moment.
    ///
    /// # Errors
    /// [`Diverged`] as of [`Self::start`]; the state is as before in any case.
    pub fn effective_mass(&mut self) -> Result<Matrix3<f64>, Diverged> {
        let mut mass = Matrix3::zeros();
        if self.rod.is_extensible() {
            return Ok(mass);
        }
        let Self { mesh, rod, state, system, sweep, trial, .. } = self;
        trial.copy_from(state);
        pose::assemble_accelerations(mesh, rod, trial, &state.boundary, system);
        sweep.solve(system).map_err(singular)?;
        let still = sweep.nodes[0].n;
        for i in 0..3 {
            let mut pushed = state.boundary;
            pushed.base.acceleration[i] += 1.0;
            pose::assemble_accelerations(mesh, rod, trial, &pushed, system);
            sweep.solve_for(&system.residuals);
            mass.set_column(i, &(still - sweep.nodes[0].n));
        }
        Ok(mass)
    }

    fn solve_accelerations(&mut self, boundary: &Boundary) -> Result<(), Diverged> {
        self.trial.copy_from(&self.state);
        self.trial.boundary = *boundary;
        pose::assemble_accelerations(&self.mesh, &self.rod, &mut self.trial, boundary, &mut self.system);
        self.sweep.solve(&self.system).map_err(singular)?;
        self.trial.take_accelerations(&self.rod, &self.sweep.nodes, &self.sweep.points);
        Ok(())
    }
}

/// A linear problem without a unique solution.
pub(crate) fn singular(singular: Singular) -> Diverged {
    Diverged { iterations: 1, residual: f64::INFINITY, reason: Reason::Singular(singular) }
}

/// Sizes of forces, moments and accumulated vectors in this step, and the rounding error of a force.
fn scales(mesh: &Mesh, rod: &Rod, old: &State, boundary: &Boundary, time: &Time) -> (Scales, f64) {
    let length = mesh.length();
    let stiffness = rod.stiffness.amax();
    let finest = mesh.cells.iter().fold(f64::INFINITY, |h, cell| h.min(cell.length));
    let carried = |field: fn(&Section) -> Vector3<f64>| old.nodes.iter().map(|n| field(n).amax()).fold(0.0, f64::max);
    let weight = (rod.mass_per_length * length + rod.tip_mass) * boundary.gravity.amax();
    let force = carried(|n| n.force) + boundary.tip_force.amax() + weight + 1e-3 * stiffness / (length * length);
    let moment = carried(|n| n.moment) + boundary.tip_moment.amax() + 1e-3 * (stiffness / length + weight * length);
    let (w, inertia) = match time {
        Time::Static => (length, 0.0),
        Time::Step { scheme, dt, row } => {
            let weight = scheme.rate_weight(*dt).powi(2);
            let inertia = rod.mass_per_length * length * length * weight;
            (if *row == Row::Positions { length } else { length * weight }, inertia)
        }
        Time::Stage { weight } => {
            let weight = weight * weight;
            (length * weight, rod.mass_per_length * length * length * weight)
        }
    };
    let rounding = f64::EPSILON * (stiffness / (finest * finest) + inertia + force);
    (Scales { w, force, moment }, rounding)
}
