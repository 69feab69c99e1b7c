//! Cells that choose themselves: what each contributes to the error of the tip, and halves or pairs of them where that is
//! too much or too little.
//!
//! Collocation at the s Gauss points of a cell makes the law of bending and the balance of moments agree there. Beside
//! them they part by what a polynomial of degree s − 1 cannot follow, seen at the first node, where m is the balance's:
//!
//! ```text
//! δκ₀ = K⁻¹ Rᵀm − (κ − κ̂ + τ κ_t), the latter on the polynomial through the points
//! |δκ|² = |δκ₀|² / (2s + 1)          the mean over the cell of the Legendre polynomial that vanishes at its points
//! ```
//!
//! but, at s = 4, no more than what the coefficients of κ − κ̂ let expect, as they fall.
//!
//! Like every functional of the rod, the tip feels the product of this with what the cell misses of the curvature z by
//! which a force on the tip bends the rod. z is taken to be as rough as κ in the cell, and as large as the moment of the
//! force about a point as far away as the force in the rod lets bending reach. The tangent t, which turns by h κ in the
//! cell, is summed up by the Gauss rule with its remainder c_s. Over the length L,
//!
//! ```text
//! e = Σ h/L C |δκ|² ℓ / |κ − κ̂| + |Σ h/L c_s (h |κ|)^2s t⊥|          ℓ = min(√(EI/|n|), |r_tip − r|, L)
//! ```
//!
//! with the largest curvatures in each cell and t⊥ the part of t across κ: all around a coil the latter sum vanishes, and
//! each cell has its part of what is left. Both fall as h^2s over the rod, as the error does.
//!
//! The curvatures of new cells are those that the moments ask for, κ + δκ, bounded alike, which raises no waves of the
//! order of δκ; where that would bring much energy, in a whip, they are what they were. Two cells are joined by their mean
//! square best approximation. All that leaves the tip and its velocity where they are, to the order of e. Still a change
//! raises some waves, and is the better for being made in time: cells are halved before they have used up what the
//! tolerance allows, and joined long after; a step that leaves too little is taken anew on finer ones.
//!
//! Where a rod in a plane moves slowly its curvatures follow what acts, and those with which the new cells have the
//! accelerations of the old ones raise no waves at all. One iteration finds them; that the rod is slow is seen by its energy,
//! which then changes by the order of e². And what the cells of such a rod miss displaces the tip, and sets nothing in
//! motion: it may be as much more as its accelerations are less than L/T², in the time T in which gravity or stiffness
//! move the whole rod.

// J is a matrix
#![allow(non_snake_case)]

use crate::archive::archived;
use crate::boundary::{Boundary, Drive};
use crate::energy::Energy;
use crate::mesh::{Cell, Curvatures, Gauss, MAX_STAGES, Mesh, Origin, Series};
use crate::plane::{Bending, Plane};
use crate::pose::{Section, State};
use crate::rod::Rod;
use crate::so3;
use crate::stepper::{Diverged, Reason, Report, Stepper, singular};
use crate::sweep::larger;
use nalgebra::Vector3;

type Vec3 = Vector3<f64>;

/// C: the largest estimate in a run then is from half to ten times the error of the tip, of a rope, a hair, a struck cord
/// and one that turns, on 1 to 24 cells; 10 to 20 times that where all error is in a thin layer at the clamp, and less
/// than it for the small waves of a wire below 1e-6.
const CALIBRATION: f64 = 2.0;
/// Part of the tolerance that the cells may use up before those with more than their share of it are halved. With a tenth a
/// hair that whips raises more waves by its changes than it is the more exact.
const SHARE: f64 = 0.17;
/// Tolerance from which on that part grows with its root: the steps then err more than the cells.
const LOOSE: f64 = 1e-3;
/// That part at most: the steps err too.
const MOST_SHARE: f64 = 1.5;
/// How much more the cells of a slow rod may use up. With 9 the tip of a line that hangs from a ship is as good as asked on
/// half as many cells, but the moment on the ship is off by 9 % at 1e-3.
const QUIET: f64 = 3.0;
/// Energy, relative, by which new cells may change that of a slow rod, over the square of what the cells may use up: up to 10
/// in a line that hangs from a ship, 1e3 and more at a release or in a whip.
const SETTLED: f64 = 10.0;
/// Part of its share that a pair of cells must keep below once joined: the waves that a change raises count the more, the
/// less may be amiss.
const JOINED: Share = Share { part: 0.22, power: 0.25 };
/// Times what the cells may use up at which the step that has brought them there is taken back, in space: what a blow does
/// at once to too few cells goes on as a velocity.
const REFUSED: f64 = 1.5;
/// The same in a plane: with less, cells of a rod that whips change in vain; with 4, a cord that begins to whirl has too few.
const REFUSED_IN_PLANE: f64 = 2.5;
/// Energy that cells bring which leave as much less of an error, relative, over that: up to 3 times it where they are due,
/// 100 times and more in a whip.
const BROUGHT: f64 = 4.0;
/// Energy, relative, with which no cells are taken: that of folded ones, whose rates are beyond all bounds.
const WILD: f64 = 0.02;
/// The same where a step needs them: a rod that is wound up at once must have some that bring 5 times what it has.
const WILD_AT_NEED: f64 = 10.0;
/// Estimate, over the tolerance, from which a step needs others: one that winds the rod up comes to 2e3, in a whip it is 0.5.
const NEED: f64 = 17.0;
/// How much more what is missed of the bending of a rod at rest counts than of one in motion: there one sees the cells change.
const AT_REST: f64 = 10.0;
/// Tolerance beyond which shares grow no more: a rod need not be followed, but no energy may come of it.
const ROUGH: f64 = 1e-2;
/// Calls without a change after one: the waves that it has raised are to fade.
const REST: u32 = 4;
/// Part of the error of a cell that is remembered at the next call, lest cells that have a moment's rest be joined.
const MEMORY: f64 = 0.8;
/// Turn of a cell from end to end beyond which it is halved, and up to which two may be joined, rad: a rotation vector
/// ends at a full turn.
const MOST_TURN: [f64; 2] = [4.0, 2.0];
/// Halvings of a cell of the coarsest mesh; more than radius and length of a rod leave a meaning.
const MOST_HALVINGS: u32 = 12;
/// Iterations for the rotation vectors of a cell of given curvature; each gains the turn of the cell in rad, or so.
const MOST_ITERATIONS: usize = 30;

/// A part of a tolerance, that is another of another tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Share {
    /// Of 1e-3.
    pub(crate) part: f64,
    /// Power of the tolerance that it grows with.
    pub(crate) power: f64,
}

impl Share {
    /// Of this tolerance.
    pub(crate) fn of(self, tolerance: f64) -> f64 {
        self.part * (tolerance.min(ROUGH) / 1e-3).powf(self.power)
    }
}

/// What decides on the curvatures of new cells.
#[derive(Clone, Copy, Debug, PartialEq)]
enum By {
    /// The energy that they bring, and that is this at most, relative.
    Energy(f64),
    /// What they are to be.
    Order(Curvatures),
}

/// A change of the cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Of which the new ones come.
    origins: Vec<Origin>,
    curvatures: Curvatures,
}

/// What the cells of a rod contribute to the error of its tip, and which they ought to be.
#[derive(Clone, Debug)]
pub struct Refiner {
    /// Of the position of the tip, over the length.
    tolerance: f64,
    /// Accelerations below which a rod is slow, m/s².
    slow: f64,
    /// How much more the cells may use up, as slow as the rod is.
    quiet: f64,
    most_cells: usize,
    /// Calls since the last change.
    waited: u32,
    /// The coarsest mesh, and the rule.
    coarsest: Vec<Cell>,
    rule: Gauss,
    /// Of the cells, now and lately; the turn of each.
    errors: Vec<f64>,
    lately: Vec<f64>,
    /// Errors of the sums of tangents, each by itself.
    sums: Vec<f64>,
    turns: Vec<f64>,
    /// What the [plane](Plane::looks) has looked at, of which they are.
    seen: Option<u64>,
    /// Halvings of each cell, and its place in its coarsest one in units of the smallest.
    places: Vec<(usize, u32, u32)>,
    /// The next cells, and those of which they come.
    cells: Vec<Cell>,
    origins: Vec<Origin>,
    curvatures: Curvatures,
    series: Series,
    kept: Vec<f64>,
}

archived!(Refiner { waited, lately } but {
    tolerance, slow, quiet, most_cells, coarsest, rule, errors, sums, turns, seen, places, cells, origins, curvatures, series,
    kept
});

impl Refiner {
    /// For rods on `coarsest`, or what becomes of it: none of its cells will be joined, and there will be `most_cells` at
    /// most. `tolerance` is that of the tip's position, over the length; rods with smaller accelerations than `slow`, m/s²,
    /// have fewer.
    ///
    /// A rod at rest may be straight, and tells nothing of what will come: the step that tells is to be
    /// [refused](Self::refuse). Otherwise the first blow to a hanging cord of one cell costs 4e-3 of its length.
    pub fn new(coarsest: &Mesh, tolerance: f64, slow: f64, most_cells: usize) -> Self {
        let most_cells = most_cells.max(coarsest.cells.len());
        let room = || Vec::with_capacity(most_cells);
        Self {
            tolerance,
            slow,
            quiet: 1.0,
            most_cells,
            coarsest: coarsest.cells.clone(),
            waited: REST,
            series: Series::new(&coarsest.rule),
            rule: coarsest.rule.clone(),
            errors: room(),
            sums: room(),
            lately: room(),
            kept: room(),
            turns: room(),
            seen: None,
            places: Vec::with_capacity(most_cells),
            cells: Vec::with_capacity(most_cells),
            origins: Vec::with_capacity(most_cells),
            curvatures: Curvatures::Kept,
        }
    }

    /// Copies what later decisions depend on.
    pub fn copy_from(&mut self, other: &Self) {
        (self.tolerance, self.most_cells, self.waited) = (other.tolerance, other.most_cells, other.waited);
        self.lately.clone_from(&other.lately);
    }

    /// Where [`Self::copy_from`] keeps this one without allocating.
    pub fn kept(&self) -> Self {
        let mut kept = self.clone();
        kept.lately.reserve(self.most_cells);
        kept
    }

    /// The coarsest mesh with all cells halved until there are `cells`: to start from, as many as any rule asks for. In the
    /// first instants of a release nothing is bent yet.
    pub fn start(&self, cells: usize) -> Mesh {
        let mut mesh = Mesh { cells: self.coarsest.clone(), rule: self.rule.clone() };
        while mesh.cells.len() < cells && 2 * mesh.cells.len() <= self.most_cells {
            let halves = |cell: &Cell| [Cell { length: 0.5 * cell.length, ..*cell }; 2];
            mesh.cells = mesh.cells.iter().flat_map(halves).collect();
        }
        mesh
    }

    /// Most cells; a stepper or plane [reserves](Stepper::reserve) as many.
    pub fn most_cells(&self) -> usize {
        self.most_cells
    }

    /// The last change.
    pub fn last_change(&self) -> Change {
        Change { origins: self.origins.clone(), curvatures: self.curvatures }
    }

    /// Changes the cells as [`adapt`](Self::adapt) or [`refuse`](Self::refuse) once did.
    ///
    /// # Errors
    /// [`Diverged`] as of [`Self::adapt`].
    pub fn change_to(&mut self, change: &Change, stepper: &mut Stepper, now: &Boundary) -> Result<(), Diverged> {
        self.set_cells(&change.origins, &stepper.mesh);
        self.change(stepper, now, By::Order(change.curvatures))
    }

    /// The same of a rod in a plane.
    ///
    /// # Errors
    /// [`Diverged`] as of [`Self::adapt_plane`].
    pub fn change_plane_to(&mut self, change: &Change, plane: &mut Plane, now: &Drive) -> Result<(), Diverged> {
        self.set_cells(&change.origins, plane.mesh());
        self.change_plane(plane, now, By::Order(change.curvatures))
    }

    fn set_cells(&mut self, origins: &[Origin], mesh: &Mesh) {
        self.origins.clear();
        self.origins.extend_from_slice(origins);
        self.cells.clear();
        self.cells.extend(origins.iter().map(|origin| origin.cell(&mesh.cells)));
    }

    /// The estimate of the last call of any kind.
    pub fn estimated(&self) -> f64 {
        self.errors.iter().sum()
    }

    /// Estimated error of the tip's position, over the length, that comes of the present cells.
    pub fn estimate_space(&mut self, stepper: &Stepper) -> f64 {
        self.estimate_state(stepper, &stepper.state, 1.0)
    }

    /// Whether the present cells use up more than they may.
    pub fn is_coarse(&mut self, stepper: &Stepper) -> bool {
        self.estimate_space(stepper) > self.allowed()
    }

    /// Of any state of the rod; what is missed `counts` so many times.
    fn estimate_state(&mut self, stepper: &Stepper, state: &State, counts: f64) -> f64 {
        let Stepper { mesh, rod, .. } = stepper;
        let stages = mesh.rule.stages;
        self.estimate(mesh, rod.stiffness.x.min(rod.stiffness.y), counts, |series, j| {
            bending(rod, state, stages, series, j).0
        })
    }

    /// The same of a rod in a plane, as it was last looked at.
    pub fn estimate_plane(&mut self, plane: &Plane) -> f64 {
        // of the end of a step it is asked twice: whether that is good enough, and what is to follow
        if self.seen == Some(plane.looks()) {
            return self.estimated();
        }
        let error = self.estimate(plane.mesh(), plane.stiffness(), 1.0, |series, j| plane.bending(j, series));
        self.seen = Some(plane.looks());
        error
    }

    fn estimate(
        &mut self,
        mesh: &Mesh,
        stiffness: f64,
        counts: f64,
        bending: impl Fn(&Series, usize) -> Bending,
    ) -> f64 {
        let (length, stages) = (mesh.length(), mesh.rule.stages as i32);
        self.seen = None;
        self.errors.clear();
        self.sums.clear();
        self.turns.clear();
        let (mut all, mut fastest) = (Vec3::zeros(), 0.0);
        for (j, Cell { length: h, .. }) in mesh.cells.iter().enumerate() {
            let bending = bending(&self.series, j);
            let Bending { missed, at_points, at_nodes, curvature, tangent, force, acceleration, lever, turn, .. } =
                bending;
            fastest = larger(fastest, acceleration);
            let missed = (missed * missed).min(bending.next(mesh.rule.stages)) / f64::from(2 * stages + 1);
            let arm = length.min(lever).min((stiffness / force).sqrt());
            // nothing is missed of what is not bent
            let bent = if missed == 0.0 { 0.0 } else { missed * arm / larger(at_points, at_nodes) };
            self.errors.push(h / length * CALIBRATION * counts * bent);
            let missed = tangent * (h / length * self.series.remainder * (h * curvature).powi(2 * stages));
            all += missed;
            self.sums.push(missed.norm());
            self.turns.push(turn);
        }
        self.quiet = (self.slow / larger(fastest, f64::MIN_POSITIVE)).clamp(1.0, QUIET);
        let left = all.norm() / larger(self.sums.iter().sum(), f64::MIN_POSITIVE);
        for (error, sum) in self.errors.iter_mut().zip(&self.sums) {
            *error += left * sum;
        }
        self.estimated()
    }

    /// Takes the errors into account; whether it is time to change the cells, and they should.
    fn due(&mut self, mesh: &Mesh, joins: bool) -> bool {
        self.remember(mesh.cells.len());
        self.waited = self.waited.saturating_add(1);
        self.waited > REST && self.plan(mesh, joins)
    }

    fn remember(&mut self, count: usize) {
        if self.lately.len() != count {
            self.lately.clear();
            self.lately.resize(count, 0.0);
        }
        for (lately, error) in self.lately.iter_mut().zip(&self.errors) {
            *lately = larger(*error, MEMORY * *lately);
        }
    }

    /// Whether the cells should change, to `cells` with `origins`.
    fn plan(&mut self, mesh: &Mesh, joins: bool) -> bool {
        let count = mesh.cells.len();
        self.find_places(mesh);
        let allowed = self.allowed() / count as f64;
        let enough = self.lately.iter().sum::<f64>() <= self.allowed();
        let below = JOINED.of(self.tolerance) * allowed;
        // of a cell twice as long
        let growth = 4f64.powi(self.rule.stages as i32);
        let mut room = self.most_cells - count.min(self.most_cells);
        self.origins.clear();
        self.kept.clear();
        let mut j = 0;
        while j < count {
            let (error, (root, level, start)) = (self.lately[j], self.places[j]);
            let halve =
                !((enough || error <= allowed) && self.turns[j] < MOST_TURN[0]) && level < MOST_HALVINGS && room > 0;
            let width = 1 << (MOST_HALVINGS - level);
            let joined = match self.lately.get(j + 1) {
                Some(next) if joins && level > 0 && start % (2 * width) == 0 => {
                    let other = self.places[j + 1];
                    let turn = self.turns[j] + self.turns[j + 1];
                    let error = growth * (error + next);
                    let pair = other == (root, level, start + width) && turn < MOST_TURN[1];
                    (pair && error <= below).then_some(error)
                }
                _ => None,
            };
            if halve {
                room -= 1;
                self.origins.extend([Origin::First(j), Origin::Second(j)]);
                self.kept.extend([0.5 * error / growth; 2]);
            } else if let Some(error) = joined {
                self.origins.push(Origin::Pair(j));
                self.kept.push(error);
                j += 1;
            } else {
                self.origins.push(Origin::Same(j));
                self.kept.push(error);
            }
            j += 1;
        }
        let changes = self.origins.iter().any(|origin| !matches!(origin, Origin::Same(_)));
        if changes {
            self.cells.clear();
            self.cells.extend(self.origins.iter().map(|origin| origin.cell(&mesh.cells)));
        }
        changes
    }

    /// Where the cells lie in the coarsest ones: lengths halve exactly.
    fn find_places(&mut self, mesh: &Mesh) {
        const WHOLE: u32 = 1 << MOST_HALVINGS;
        let (mut root, mut start) = (0, 0);
        self.places.clear();
        for cell in &mesh.cells {
            let width = (cell.length / self.coarsest[root].length * f64::from(WHOLE)).round() as u32;
            self.places.push((root, MOST_HALVINGS - width.max(1).ilog2().min(MOST_HALVINGS), start));
            start = u32::saturating_add(start, width);
            if start >= WHOLE && root + 1 < self.coarsest.len() {
                (root, start) = (root + 1, 0);
            }
        }
    }

    /// Refines and, if it `joins`, coarsens the cells of a rod that neither shears nor stretches, clamped at its base and
    /// free at its tip; whether they have changed. Others keep their cells. `boundary` is what acts now; the accelerations are
    /// consistent with it afterwards, as after [`Stepper::accelerate`], and [`Stepper::previous`] is lost.
    ///
    /// # Errors
    /// [`Diverged`] if the equations of a cell are singular, or new cells would have much more energy; the rod is as before.
    pub fn adapt(&mut self, stepper: &mut Stepper, boundary: &Boundary, joins: bool) -> Result<bool, Diverged> {
        self.estimate_space(stepper);
        let unfit = stepper.rod.is_extensible() || boundary.holds_positions();
        if unfit || !self.due(&stepper.mesh, joins) {
            return Ok(false);
        }
        self.change(stepper, boundary, By::Energy(WILD))?;
        Ok(true)
    }

    /// The same of a rod in a plane; there is no looking back into the last step afterwards.
    ///
    /// # Errors
    /// [`Diverged`] as of [`Self::adapt`]; the rod is as before.
    pub fn adapt_plane(&mut self, plane: &mut Plane, drive: &Drive, joins: bool) -> Result<bool, Diverged> {
        plane.look(1.0, drive);
        self.estimate_plane(plane);
        if !self.due(plane.mesh(), joins) {
            return Ok(false);
        }
        self.change_plane(plane, drive, By::Energy(WILD))?;
        Ok(true)
    }

    /// Halves the cells of a rod as for [`Self::adapt`] until none is longer than `longest`, m, as far as there is room;
    /// whether they have changed. They may bring more energy if the rod `needs` them.
    ///
    /// # Errors
    /// [`Diverged`] if the equations of a cell are singular; the rod then has the cells that it got to.
    pub fn halve(
        &mut self,
        stepper: &mut Stepper,
        boundary: &Boundary,
        longest: f64,
        needs: bool,
    ) -> Result<bool, Diverged> {
        let wild = if needs { WILD_AT_NEED } else { WILD };
        let mut changed = false;
        loop {
            self.estimate_space(stepper);
            // lengths halve exactly, the longest one is rounded
            let is_long = |cell: &Cell| cell.length > longest * (1.0 + 1e-9);
            self.lately.clear();
            self.lately.extend(stepper.mesh.cells.iter().map(|cell| if is_long(cell) { f64::INFINITY } else { 0.0 }));
            let more = self.plan(&stepper.mesh, false);
            self.lately.fill(0.0);
            if !more {
                return Ok(changed);
            }
            self.kept.fill(0.0);
            self.change(stepper, boundary, By::Energy(wild))?;
            changed = true;
        }
    }

    /// Whether the step that `stepper` has attempted ends in errors that its cells ought not to have had: then the present
    /// state has finer ones, under `boundary`, and the step is to be attempted again. Cells that wait at rest for a blow
    /// are few.
    ///
    /// # Errors
    /// [`Diverged`] as of [`Self::adapt`]; the attempt is lost.
    pub fn refuse(&mut self, stepper: &mut Stepper, boundary: &Boundary) -> Result<bool, Diverged> {
        self.estimate_state(stepper, stepper.attempted(), 1.0);
        if !self.refuses(&stepper.mesh, REFUSED) {
            return Ok(false);
        }
        let wild = if self.estimated() > NEED * self.tolerance { WILD_AT_NEED } else { WILD };
        self.change(stepper, boundary, By::Energy(wild))?;
        Ok(true)
    }

    /// The same of a step in a plane that is accepted, and of which the end is seen: it is taken back. `drive` is of the time
    /// since its beginning.
    ///
    /// # Errors
    /// [`Diverged`] as of [`Self::adapt`]; the step is taken back all the same.
    pub fn refuse_plane(&mut self, plane: &mut Plane, drive: &impl Fn(f64) -> Drive) -> Result<bool, Diverged> {
        self.estimate_plane(plane);
        if !self.refuses(plane.mesh(), REFUSED_IN_PLANE) {
            return Ok(false);
        }
        plane.take_back();
        self.change_plane(plane, &drive(0.0), By::Energy(WILD))?;
        Ok(true)
    }

    /// Whether the step whose end is estimated is to be taken back, beyond so many `times` what the cells may use up.
    fn refuses(&mut self, mesh: &Mesh, times: f64) -> bool {
        if self.estimated() <= times * self.allowed() && self.turns.iter().all(|turn| *turn < MOST_TURN[0]) {
            return false;
        }
        self.remember(mesh.cells.len());
        self.plan(mesh, false)
    }

    /// The error that the cells may have, all together.
    fn allowed(&self) -> f64 {
        let share = SHARE * (self.tolerance.clamp(LOOSE, ROUGH) / LOOSE).sqrt();
        (share * self.quiet).min(MOST_SHARE) * self.tolerance
    }

    /// What the curvatures of new cells are, and the energy, relative, that they may bring then: in the order in which that is
    /// tried.
    fn tries(&self, by: By, planar: bool) -> impl Iterator<Item = (Curvatures, f64)> + use<> {
        let tries = match by {
            By::Energy(wild) => {
                let most = larger(self.allowed(), (BROUGHT * self.estimated()).min(SHARE * ROUGH));
                let settled = SETTLED * self.allowed().powi(2);
                let tries = [(Curvatures::Settled, settled), (Curvatures::Balanced, most), (Curvatures::Kept, wild)];
                tries.map(|(curvatures, most)| (curvatures, most.min(wild)))
            }
            By::Order(curvatures) => [(curvatures, f64::INFINITY); 3],
        };
        let settles = planar && self.quiet > 1.0;
        tries.into_iter().skip(usize::from(!settles))
    }

    fn change_plane(&mut self, plane: &mut Plane, drive: &Drive, by: By) -> Result<(), Diverged> {
        plane.look(1.0, drive);
        let energy = plane.energy();
        let (scale, tries) = (energy.scale(plane.large()), self.tries(by, true));
        let Self { cells, origins, series, .. } = self;
        let mut gain = 0.0;
        for (curvatures, most) in tries {
            let fits = |after: &Energy| {
                gain = (after.total() - energy.total()) / scale;
                // what settles may lose no more than it may gain
                let change = if curvatures == Curvatures::Settled { gain.abs() } else { gain };
                change <= most
            };
            if plane.remesh(cells, (origins, series), drive, curvatures, fits).map_err(singular)? {
                self.curvatures = curvatures;
                self.changed();
                return Ok(());
            }
        }
        Err(Diverged { iterations: 0, residual: gain, reason: Reason::Elsewhere })
    }

    /// The static equilibrium under `boundary`, on cells as fine as the tolerance asks for, and as Newton needs.
    ///
    /// # Errors
    /// [`Diverged`] as of [`Stepper::equilibrium`].
    pub fn equilibrium(&mut self, stepper: &mut Stepper, boundary: &Boundary) -> Result<Report, Diverged> {
        let unfit = stepper.rod.is_extensible() || boundary.holds_positions();
        let mut iterations = 0;
        loop {
            let count = stepper.mesh.cells.len();
            let report = stepper.equilibrium(boundary);
            match report {
                Ok(report) => {
                    iterations += report.iterations;
                    // it is the slowest rod of all, and has no more for that
                    self.estimate_state(stepper, &stepper.state, AT_REST * QUIET);
                    self.lately.clone_from(&self.errors);
                    if unfit || !self.plan(&stepper.mesh, false) {
                        return Ok(Report { iterations, ..report });
                    }
                }
                Err(diverged) => {
                    iterations += diverged.iterations;
                    // all cells are too long
                    self.estimate_space(stepper);
                    self.lately.clear();
                    self.lately.resize(count, f64::INFINITY);
                    if unfit || 2 * count > self.most_cells || !self.plan(&stepper.mesh, false) {
                        return Err(Diverged { iterations, ..diverged });
                    }
                    self.kept.fill(0.0);
                }
            }
            // not those that it did not get to: loads go on from them
            let reached = stepper.state.boundary;
            self.change(stepper, &reached, By::Order(Curvatures::Balanced))?;
        }
    }

    fn change(&mut self, stepper: &mut Stepper, boundary: &Boundary, by: By) -> Result<(), Diverged> {
        let Stepper { mesh, rod, state, .. } = &*stepper;
        let gravity = &boundary.gravity;
        let energy = Energy::of(mesh, rod, state, gravity);
        let scale = energy.scale(Energy::large(rod, mesh.length(), gravity));
        let mut tries = self.tries(by, false);
        let Self { cells, origins, series, .. } = self;
        let (mesh, rod, before, state) = stepper.remesh(cells);
        let mut gain = 0.0;
        let taken = tries.find(|(curvatures, most)| {
            transfer((cells, before), (origins, series), (mesh, state), rod, *curvatures);
            gain = (Energy::of(mesh, rod, state, gravity).total() - energy.total()) / scale;
            gain <= *most
        });
        let started = match taken {
            Some((curvatures, _)) => {
                self.curvatures = curvatures;
                stepper.accelerate(boundary)
            }
            None => Err(Diverged { iterations: 0, residual: gain, reason: Reason::Elsewhere }),
        };
        if started.is_err() {
            stepper.undo_remesh(cells);
            return started;
        }
        self.changed();
        Ok(())
    }

    fn changed(&mut self) {
        self.waited = 0;
        std::mem::swap(&mut self.lately, &mut self.kept);
    }
}

/// K⁻¹ Rᵀm.
fn bend(rod: &Rod, section: &Section) -> Vec3 {
    section.rotation.tr_mul(&section.moment).component_div(&rod.stiffness)
}

/// How a cell is bent, and what its curvature misses at the first node as a vector.
fn bending(rod: &Rod, state: &State, stages: usize, series: &Series, cell: usize) -> (Bending, Vec3) {
    let (node, next) = (&state.nodes[cell], &state.nodes[cell + 1]);
    let at_points = lane(stages, |k| bend(rod, &state.points[cell * stages + k]));
    let at_node = bend(rod, node);
    let largest = |vectors: &[Vec3]| vectors.iter().map(Vec3::norm).fold(0.0, larger);
    let kappa = state.memory[cell * stages..][..stages].iter().map(|memory| memory.kappa.norm());
    let middle = cell * stages + stages / 2;
    let (axis, tangent) = (state.memory[middle].kappa.try_normalize(0.0).unwrap_or_default(), Vec3::z());
    let missed = at_node - sum(&series.start, &at_points);
    let bending = Bending {
        missed: missed.norm(),
        coefficients: (0..3).fold([0.0; 2], |[low, high], i| {
            let more = series.coefficients(&at_points.map(|kappa| kappa[i]));
            [low + more[0], high + more[1]]
        }),
        at_points: largest(&at_points),
        at_nodes: largest(&[at_node, bend(rod, next)]),
        curvature: kappa.fold(0.0, larger),
        tangent: state.points[middle].rotation * (tangent - axis * axis.z),
        force: larger(node.force.norm(), next.force.norm()),
        acceleration: larger(node.acceleration.norm(), next.acceleration.norm()),
        lever: (state.tip().position - node.position).norm(),
        turn: next.turn.norm(),
    };
    (bending, missed)
}

type Lane = [Vec3; MAX_STAGES];

/// Σ weights_k x_k.
fn sum(weights: &[f64; MAX_STAGES], x: &Lane) -> Vec3 {
    x.iter().zip(weights).fold(Vec3::zeros(), |sum, (x, weight)| sum + x * *weight)
}

fn lane(stages: usize, value: impl Fn(usize) -> Vec3) -> Lane {
    std::array::from_fn(|k| if k < stages { value(k) } else { Vec3::zeros() })
}

/// What of a cell does not depend on where it is, at its points: the rotation vector from its first node and κ, with their
/// rates.
struct Shape {
    phi: Lane,
    phi_t: Lane,
    kappa: Lane,
    kappa_t: Lane,
}

impl Shape {
    /// Of a cell of `state`, whose first node has the angular velocity `omega`.
    fn of(rule: &Gauss, h: f64, state: &State, cell: usize, omega: &Vec3) -> Self {
        let Gauss { stages, a_inverse, .. } = rule;
        let first = cell * stages;
        let phi = lane(*stages, |k| state.points[first + k].turn);
        let phi_t = lane(*stages, |k| {
            let relative = state.memory[first + k].spin.velocity.value - so3::exp(&phi[k]).tr_mul(omega);
            so3::inverse_right_jacobian(&phi[k]) * relative
        });
        let kappa_t = lane(*stages, |k| {
            let (g, g_t) = (sum(&a_inverse[k], &phi) / h, sum(&a_inverse[k], &phi_t) / h);
            let map = so3::Tangent::new(&phi[k]);
            map.jacobian() * g_t + map.by_log(&g) * phi_t[k]
        });
        Self { phi, phi_t, kappa: lane(*stages, |k| state.memory[first + k].kappa), kappa_t }
    }

    /// Of a cell of length `h` with these curvatures: collocates Φ_s = J_r⁻¹(Φ) κ and its rate.
    fn bent(rule: &Gauss, h: f64, kappa: Lane, kappa_t: Lane) -> Self {
        let mut shape = Self { phi: [Vec3::zeros(); MAX_STAGES], phi_t: [Vec3::zeros(); MAX_STAGES], kappa, kappa_t };
        for _ in 0..MOST_ITERATIONS {
            let maps = shape.phi.map(|phi| so3::Tangent::new(&phi));
            let g = lane(rule.stages, |k| maps[k].inverse_times(&kappa[k]));
            let g_t =
                lane(rule.stages, |k| maps[k].inverse_times(&(kappa_t[k] - maps[k].by_log(&g[k]) * shape.phi_t[k])));
            let phi = lane(rule.stages, |k| sum(&rule.a[k], &g) * h);
            let change = (0..rule.stages).map(|k| (phi[k] - shape.phi[k]).norm()).fold(0.0, larger);
            shape.phi_t = lane(rule.stages, |k| sum(&rule.a[k], &g_t) * h);
            shape.phi = phi;
            if change < 4.0 * f64::EPSILON {
                break;
            }
        }
        shape
    }

    /// Weights of the points at the next node, of what vanishes at the first.
    fn end_weights(rule: &Gauss) -> [f64; MAX_STAGES] {
        std::array::from_fn(|k| (0..rule.stages).map(|l| rule.b[l] * rule.a_inverse[l][k]).sum())
    }

    /// The angular velocity of the next node.
    fn end(&self, rule: &Gauss, omega: &Vec3) -> Vec3 {
        let end = Self::end_weights(rule);
        spin(omega, &sum(&end, &self.phi), &sum(&end, &self.phi_t))
    }

    /// Puts it behind node `cell` with the angular velocity `omega`; the one of the next node.
    fn put(&self, rule: &Gauss, state: &mut State, cell: usize, omega: &Vec3) -> Vec3 {
        let start = state.nodes[cell].rotation;
        for k in 0..rule.stages {
            let i = cell * rule.stages + k;
            let (point, memory) = (&mut state.points[i], &mut state.memory[i]);
            (point.turn, point.rotation) = (self.phi[k], start * so3::exp(&self.phi[k]));
            memory.spin.velocity.value = spin(omega, &self.phi[k], &self.phi_t[k]);
            (memory.kappa, memory.strain.velocity.value) = (self.kappa[k], self.kappa_t[k]);
        }
        let node = &mut state.nodes[cell + 1];
        node.turn = sum(&Self::end_weights(rule), &self.phi);
        node.rotation = start * so3::exp(&node.turn);
        self.end(rule, omega)
    }
}

/// The angular velocity of a section Φ beyond one that has `omega`.
fn spin(omega: &Vec3, phi: &Vec3, phi_t: &Vec3) -> Vec3 {
    so3::right_jacobian(phi) * phi_t + so3::exp(phi).tr_mul(omega)
}

/// Puts the rod on another mesh, with the rates of the curvatures as they were. All but the accelerations follow; those that
/// were settled in a plane are balanced here.
fn transfer(
    before: (&[Cell], &State),
    (origins, series): (&[Origin], &Series),
    (mesh, state): (&Mesh, &mut State),
    rod: &Rod,
    curvatures: Curvatures,
) {
    let (rule, stages, old) = (&mesh.rule, mesh.rule.stages, before.1);
    (state.boundary, state.dt, state.scheme, state.row) = (old.boundary, 0.0, old.scheme, old.row);
    state.nodes[0] = old.nodes[0];
    let spin = old.nodes[0].rotation.tr_mul(&old.boundary.base.angular_velocity);
    let (mut old_spin, mut new_spin) = (spin, spin);
    for (j, origin) in origins.iter().enumerate() {
        let [(first, _), (last, _)] = [origin.at(0.0), origin.at(1.0)];
        let shape_of = |cell: usize, spin: &Vec3| Shape::of(rule, before.0[cell].length, old, cell, spin);
        let shape = shape_of(first, &old_spin);
        let mut passed = shape.end(rule, &old_spin);
        let next = (last != first).then(|| shape_of(last, &passed));
        let shape = match *origin {
            Origin::Same(_) => shape,
            _ => {
                let missed = match curvatures != Curvatures::Kept && next.is_none() {
                    true => {
                        let (bending, missed) = bending(rod, old, stages, series, first);
                        missed * (bending.most(stages) / bending.missed).min(1.0)
                    }
                    false => Vec3::zeros(),
                };
                let at = |k: usize| {
                    if let Some(next) = &next {
                        let [here, there] = series.joined.map(|weights| weights[k]);
                        let joined = |of: fn(&Shape) -> &Lane| sum(&here, of(&shape)) + sum(&there, of(next));
                        return (joined(|shape| &shape.kappa), joined(|shape| &shape.kappa_t));
                    }
                    let (_, theta) = origin.at(rule.c[k]);
                    let through = rule.through(theta);
                    (sum(&through, &shape.kappa) + missed * rule.beside(theta), sum(&through, &shape.kappa_t))
                };
                Shape::bent(rule, mesh.cells[j].length, lane(stages, |k| at(k).0), lane(stages, |k| at(k).1))
            }
        };
        new_spin = shape.put(rule, state, j, &new_spin);
        if let Some(next) = next {
            passed = next.end(rule, &passed);
        }
        if !matches!(origin, Origin::First(_)) {
            old_spin = passed;
        }
    }
    if let Some(tip) = state.memory.last_mut() {
        *tip = *old.tip_memory();
        tip.spin.velocity.value = new_spin;
    }
    state.rebuild_positions(mesh, rod);
    state.rebuild_velocities(mesh);
}
