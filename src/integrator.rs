//! A rod moved to a tolerance: what model it needs and how long its steps may be, it finds out by itself.
//!
//! What acts on the rod is a function of the time since the beginning of an interval, and steps land on its end. Left to
//! itself the rod takes steps of order 4, as long as their estimated error allows:
//!
//! - in its plane ([`crate::plane`]), as long as it lies and moves in one and all that acts on it leaves it there;
//! - else in space ([`Stepper::attempt`]), where a step that Newton loses is shortened, and the shortest of all taken by
//!   implicit Euler, which damps what it cannot follow; cells that lose that too are halved.
//!
//! Where the length of the steps is given, and for a rod that shears and stretches, they are generalized-α in space. One
//! of those that diverges is halved, and its halves again if need be; if that does not help either, the rod is as it was
//! before the interval. So are those of a rod whose tip is held, and for as long as it is.

use crate::alpha::Scheme;
use crate::archive::{Archive, Archived, Corrupt, archived};
use crate::boundary::{Boundary, Drive, Held};
use crate::energy::{Energy, Powers};
use crate::lateral::Disturbance;
use crate::mesh::Mesh;
use crate::plane::{Kept, Plane, Tip};
use crate::pose::{Row, State};
use crate::refine::{Change, Refiner, Share};
use crate::rod::Rod;
use crate::rosenbrock::{RODAS4, RODAS5P};
use crate::runge_kutta::{ESDIRK4, RungeKutta, TR_BDF2};
use crate::span;
use crate::stepper::{Attempt, Diverged, Reason, Stepper, singular};
use nalgebra::{Matrix3, Vector3};

type Vec3 = Vector3<f64>;

/// Most steps chosen for an interval, in space.
const MAX_CHOSEN_STEPS: f64 = 1000.0;
/// The same in a plane, those that are refused among them, where they cost so little: seconds on the cells of a rod that
/// whips.
const MAX_PLANE_STEPS: u32 = 100_000;
/// Length of the next step over one that Newton has lost.
const LOST: f64 = 0.3;
/// The shortest step of implicit Euler over what was to be the shortest one.
const SHORTEST_FALL: f64 = 1e-3;
/// Halvings of a step before it is given up.
const MAX_HALVINGS: u32 = 12;
/// Part of the step that the estimate would allow which is taken, so that few are refused.
const SAFETY: f64 = 0.9;
/// Bounds of the change from one step to the next.
const CHANGE: (f64, f64) = (0.2, 4.0);

/// Estimated error that a step in space may have. Loosely followed, most of what is estimated are the fast waves that the
/// method damps, and of these the tip feels little.
const SPACE_SHARE: Share = Share { part: 0.026, power: 0.17 };
/// The same in a plane.
const PLANE_SHARE: Share = Share { part: 0.09, power: 0.15 };
/// The same of steps of order 5: what is estimated is of order 4, and further above what they err by.
const FINE_SHARE: Share = Share { part: 0.18, power: 0.15 };
/// Part of the estimated error that the iteration of a step of order 4 may leave: those of many point one way and add up.
/// One of order 2 may leave as much as that.
const ITERATED: f64 = 0.5;
/// Estimated error of steps of order 2 in the time that gravity or stiffness take to move the whole rod, over the tolerance.
const SIMPLE_SHARE: Share = Share { part: 2.4, power: 0.15 };
/// Tolerance below which steps in a plane are of order 5.
const FINE: f64 = 5e-5;
/// The first step over that time: short enough to be accepted, and the next ones follow their error.
const FIRST_STEP: f64 = 1.0 / 80.0;
/// The shortest step of order 4 over the step of generalized-α for the same tolerance, in space.
const SHORTEST_STEP: f64 = 0.1;
/// The same in a plane.
const SHORTEST_PLANE_STEP: f64 = 1e-4;

/// Steps in a plane after which the disturbance out of it is carried on, at the earliest: what buckles takes many more.
const STEPS_UNWATCHED: u32 = 8;
/// The same as a part of the time in which gravity or stiffness move the whole rod: the forces of the shortest waves,
/// which change faster, move a rod that whips by nothing, but would make the disturbance of intervals grow.
const TIME_UNWATCHED: f64 = 0.02;
/// Growth of the disturbance at which the rod leaves the plane. What does not buckle lets it fall: rods that are released,
/// and whip, among others.
const GROWN: f64 = 1e5;
/// Size at which the disturbance begins anew, lest a rod that was quiet for long is quick to buckle unseen.
const FADED: f64 = 0.01;
/// The size that the disturbance had at first, rad; about the roundings of a rod in space.
const ROUNDINGS: f64 = 1e-12;

/// Energy that a step may gain, relative, over the tolerance, in the time that gravity or stiffness take to move the whole
/// rod: those in space that follow the motion gain up to twice that tolerance, those that pass the end of a rotation vector
/// 200 times and more.
const GAIN: f64 = 2.0;

/// Kinetic energy up to which a rod rests, over that of motions as large as the rod with an amplitude of the tolerance.
const AT_REST: f64 = 1e-6;

/// Length of a step in a plane, over the time in which gravity or stiffness move the whole rod, up to which it may gain as
/// much energy as one so long: in a whip the gain goes with its square, and no shorter one would be good enough.
const SUDDEN: f64 = 0.002;

/// Energy, relative, that a step of implicit Euler, which should lose some, gains where it has gone over to another
/// solution.
const WILD: f64 = 0.5;

/// Part of a load or an acceleration by which it may differ and has not jumped: hosts round the time.
const JUMP: f64 = 1e-9;

/// How a rod is to be moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Way {
    /// As accurately as asked; for rods that neither shear nor stretch.
    Accurate {
        /// Of the position of the tip, over the length.
        tolerance: f64,
        /// The shortest time in which gravity or stiffness move the whole rod, s.
        time: f64,
        /// Whether it may be in a plane.
        planar: bool,
    },
    /// By equal steps of generalized-α.
    Equal,
    /// From one equilibrium to the next, without inertia and damping.
    Static,
}

/// An interval that could not be integrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Failed {
    /// Time since the beginning of the interval, s.
    pub time: f64,
    /// The smallest step tried, s.
    pub step: f64,
    /// How it ended.
    pub cause: Diverged,
}

/// The work done since the start, and what is in use.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effort {
    /// Steps.
    pub steps: i32,
    /// Newton iterations.
    pub iterations: i32,
    /// Steps that had to be tried again.
    pub retries: i32,
    /// Order in time of the last step; 0 before the first, and of statics.
    pub order: i32,
    /// Length of the last step, s.
    pub step: f64,
    /// Whether the last step was in a plane.
    pub planar: bool,
    /// Sum of the estimated errors of the steps, of the centreline over the length; none are estimated where the length of
    /// the steps is given.
    pub error: f64,
    /// The largest estimated error of the cells, of the tip over the length; none is where the cells are given.
    pub space_error: f64,
}

/// The ends of the rod, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ends {
    /// Of the tip, m.
    pub position: Vec3,
    /// Of the section at the tip.
    pub rotation: Matrix3<f64>,
    /// Of the tip, m/s.
    pub velocity: Vec3,
    /// Of the section at the tip, rad/s.
    pub angular_velocity: Vec3,
    /// Exerted on the base, N.
    pub force: Vec3,
    /// Exerted on the base, about the base point, N·m.
    pub moment: Vec3,
    /// Exerted on what holds the tip, N; zero where nothing does.
    pub tip_force: Vec3,
    /// Exerted on what holds the tip, about the tip point, N·m.
    pub tip_moment: Vec3,
}

/// How long the steps of a method may be.
#[derive(Clone, Copy, Debug)]
struct Pace {
    /// Error that one may have, over the length.
    allowed: f64,
    /// Order of the method, and power of the step that the part of what is allowed goes with.
    order: i32,
    /// The next one, if its error allows, s.
    next: f64,
    /// The shortest, s: what is faster than that is damped, not followed.
    shortest: f64,
}

// how far it may go is settled at the start, what simple steps are allowed at every one
archived!(Pace { next } but { allowed, order, shortest });
archived!(Effort { steps, iterations, retries, order, step, planar, error, space_error });

impl Pace {
    /// The length of the next step of an interval of which `rest` s are left, and whether it is the last one.
    fn step(&self, rest: f64) -> (f64, bool) {
        let parts = (rest / self.next.max(self.shortest)).ceil().max(1.0);
        (rest / parts, parts == 1.0)
    }

    /// Whether a step of `dt` s with the estimated error `error` is good enough; and sets the next one.
    fn allows(&mut self, dt: f64, error: f64) -> bool {
        self.see(dt, error) <= 1.0
    }

    /// Sets the next step by what one of `dt` s would err by; and tells that as a part of what it may.
    fn see(&mut self, dt: f64, error: f64) -> f64 {
        let part = error / self.allowed;
        self.next = dt * stretch(part, self.order);
        part
    }
}

/// How much longer the next step may be than one with the error `part`, as a part of what is allowed.
fn stretch(part: f64, order: i32) -> f64 {
    if !part.is_finite() {
        return LOST;
    }
    (SAFETY * part.max(1e-12).powf(-1.0 / f64::from(order))).clamp(CHANGE.0, CHANGE.1)
}

/// How a step without an estimate of its error is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// As suits it.
    Fitting,
    /// By implicit Euler and the accelerations of the positions: what cannot be followed rests, whatever the step.
    Damped,
    /// The same, but what seems to have gained much energy is another solution than the one that follows, and not taken.
    Falling,
    /// To the equilibrium at its end.
    Resting,
}

/// What became of a step.
enum Outcome {
    Taken,
    /// A shorter one may do.
    TooLong,
    /// Its cells were not as fine as they ought to be; whether they are now.
    TooCoarse(bool),
}

/// What happened to a rod in an interval.
#[derive(Clone, Debug)]
enum Event {
    /// A step in a plane, of so many s.
    InPlane(f64),
    /// A step in space by a method.
    InSpace(&'static RungeKutta, f64),
    /// One without an estimate of its error.
    Unestimated(f64),
    /// Other cells.
    Cells(Change),
}

/// An interval as it was gone through: what a rod began with, the steps it took, the cells it had. All that follows from
/// estimates and bounds is settled, so that its end is a smooth function of what acts.
#[derive(Clone, Debug)]
pub struct Course {
    begin: Integrator,
    events: Vec<Event>,
    duration: f64,
}

/// A rod that may be in a plane.
#[derive(Clone, Debug)]
struct Planar {
    plane: Plane,
    kept: Kept,
    pace: Pace,
    disturbance: Disturbance,
    /// Time, s, and steps since the disturbance was carried on.
    unwatched: (f64, u32),
    /// The shortest time in which gravity or stiffness move the whole rod, s.
    time: f64,
    /// Pace, disturbance and what is unwatched before the interval.
    before: (Pace, Disturbance, (f64, u32)),
}

impl Planar {
    /// Counts a step of `dt` s, and tells whether the disturbance is to be carried on after it.
    fn is_due(&mut self, dt: f64) -> bool {
        let (time, steps) = &mut self.unwatched;
        *time += dt;
        *steps += 1;
        *steps >= STEPS_UNWATCHED && *time >= TIME_UNWATCHED * self.time
    }

    /// Carries the disturbance on to where the plane looks at, and tells whether the rod would stay in it.
    fn stays(&mut self) -> bool {
        let (time, _) = std::mem::take(&mut self.unwatched);
        if self.disturbance.size() < FADED {
            self.disturbance.begin(&self.plane, 1.0);
        }
        self.disturbance.advance(&self.plane, time, GROWN)
    }
}

/// What a rod was before an interval, besides its state.
#[derive(Clone, Copy, Debug)]
struct Before {
    in_plane: bool,
    pace: Pace,
    simple: Pace,
    energy: Energy,
    effort: Effort,
}

/// A rod and its motion, to a tolerance.
#[derive(Clone, Debug)]
pub struct Integrator {
    stepper: Stepper,
    /// Whether the rod is in its plane; else it is the stepper's.
    in_plane: bool,
    planar: Option<Box<Planar>>,
    way: Way,
    scheme: Scheme,
    /// Longest step of generalized-α, s.
    step: f64,
    /// Of the steps in space whose error chooses their length.
    pace: Pace,
    /// Of steps of order 2, which serve where one reaches the end of the interval.
    simple: Pace,
    /// What gravity and bending can give the rod, J.
    large: f64,
    /// Kinetic energy up to which it rests, over the large one.
    rest: f64,
    /// The tolerance over the time in which gravity or stiffness move the whole rod, 1/s.
    drift: f64,
    /// Error that steps of order 2 may have, over their length, 1/s.
    simple_drift: f64,
    energy: Energy,
    effort: Effort,
    before: Before,
    state_before: State,
    mesh_before: Mesh,
    /// What chooses the cells, now and before the interval.
    refiners: Option<(Refiner, Refiner)>,
    /// What happens, if that is to be known.
    events: Option<Vec<Event>>,
}

impl Integrator {
    /// A rod that goes on from the stepper's state, which was [started](Stepper::start) under `boundary` unless it rests, or
    /// is room for what is to be loaded. Its cells are as fine as the `refiner` wants them while it moves accurately; without
    /// one they stay. `step`, s, and `scheme` are those of generalized-α.
    pub fn new(
        mut stepper: Stepper,
        refiner: Option<Refiner>,
        way: Way,
        scheme: Scheme,
        step: f64,
        boundary: &Boundary,
    ) -> Self {
        let way = if stepper.rod.is_extensible() && way != Way::Static { Way::Equal } else { way };
        let (tolerance, time, planar) = match way {
            Way::Accurate { tolerance, time, planar } => (tolerance, time, planar),
            Way::Equal | Way::Static => (0.0, 0.0, false),
        };
        let pace = |order: i32, share: f64, shortest: f64| Pace {
            allowed: share * tolerance,
            order,
            next: time * FIRST_STEP,
            shortest: shortest * step,
        };
        let Mesh { cells, rule } = &stepper.mesh;
        let (stages, refiner) = (rule.stages, refiner.filter(|_| matches!(way, Way::Accurate { .. })));
        let most = refiner.as_ref().map_or(0, Refiner::most_cells).max(cells.len());
        let mut state_before = stepper.state.clone();
        state_before.reserve(most - cells.len(), stages);
        let mut mesh_before = stepper.mesh.clone();
        mesh_before.cells.reserve(most - cells.len());
        stepper.reserve(most);
        let planar = planar.then(|| {
            let (method, share) = if tolerance < FINE { (&RODAS5P, FINE_SHARE) } else { (&RODAS4, PLANE_SHARE) };
            let mut plane = Plane::new(&stepper.mesh, &stepper.rod, method);
            plane.reserve(most);
            let room = || Disturbance::new(most * stages);
            let (pace, unwatched) = (pace(method.order as i32, share.of(tolerance), SHORTEST_PLANE_STEP), (0.0, 0));
            Box::new(Planar {
                kept: plane.kept(),
                before: (pace, room(), unwatched),
                plane,
                pace,
                disturbance: room(),
                unwatched,
                time,
            })
        });
        let share = SPACE_SHARE.of(tolerance);
        let [simple, pace] = [&TR_BDF2, &ESDIRK4].map(|method| pace(method.order, share, SHORTEST_STEP));
        let energy = Energy::of(&stepper.mesh, &stepper.rod, &stepper.state, &boundary.gravity);
        let effort = Effort::default();
        let large = Energy::large(&stepper.rod, stepper.mesh.length(), &boundary.gravity);
        Self {
            in_plane: false,
            planar,
            way,
            scheme,
            step,
            before: Before { in_plane: false, pace, simple, energy, effort },
            pace,
            simple,
            large,
            rest: AT_REST * tolerance * tolerance,
            drift: tolerance / time,
            simple_drift: SIMPLE_SHARE.of(tolerance) * tolerance / time,
            energy,
            effort,
            state_before,
            mesh_before,
            refiners: refiner.map(|refiner| {
                let kept = refiner.kept();
                (refiner, kept)
            }),
            events: None,
            stepper,
        }
    }

    /// Advances over an interval of `duration` s under `drive`.
    ///
    /// # Errors
    /// [`Failed`]; the rod is then exactly as before.
    pub fn advance(&mut self, drive: &impl Fn(f64) -> Drive, duration: f64) -> Result<(), Failed> {
        self.keep();
        self.go_on(drive, duration)
    }

    /// Makes a rod whose tip was free ready to have it held from now on: in space, and on cells none of which is longer than
    /// `longest`, m, unless they are given. `boundary` is what acted on it so far. [`Self::go_on`] is to follow, or
    /// [`Self::restore`].
    pub fn prepare_to_hold(&mut self, boundary: &Boundary, longest: f64) {
        self.keep();
        if self.way == Way::Static {
            return;
        }
        self.leave_plane();
        if let Some((refiner, _)) = &mut self.refiners {
            // cells that cannot be started stay as they were
            if refiner.halve(&mut self.stepper, boundary, longest, false) == Ok(true) {
                self.see_energy(&boundary.gravity);
            }
        }
    }

    /// As [`Self::advance`], after [`Self::prepare_to_hold`]: what an error takes back begins there.
    ///
    /// # Errors
    /// [`Failed`]; the rod is then exactly as before that.
    pub fn go_on(&mut self, drive: &impl Fn(f64) -> Drive, duration: f64) -> Result<(), Failed> {
        let begin = drive(0.0);
        let done = match self.way {
            Way::Accurate { .. } if begin.boundary.tip.held == Held::FREE => self.follow(drive, &begin, duration),
            Way::Accurate { .. } | Way::Equal => self.catch(&begin.boundary).and_then(|()| self.march(drive, duration)),
            Way::Static => self.drift(drive, duration),
        };
        if done.is_err() {
            self.restore();
        }
        done
    }

    /// Takes the damping and drag of `rod` for its own, as those of a state that belongs to them.
    pub fn take_damping(&mut self, rod: &Rod) {
        let own = &mut self.stepper.rod;
        (own.damping, own.drag) = (rod.damping, rod.drag);
        if let Some(Planar { plane, .. }) = self.planar.as_deref_mut() {
            plane.take_damping(rod);
        }
    }

    /// Takes the damping and drag of `rod` from now on: accelerations follow at once.
    ///
    /// # Errors
    /// [`Diverged`] if the equations of a cell are singular; the rod is as before.
    pub fn damp(&mut self, rod: &Rod) -> Result<(), Diverged> {
        let before = self.stepper.rod.clone();
        self.take_damping(rod);
        let started = match (self.way, self.planar.as_deref_mut()) {
            (Way::Accurate { .. }, Some(Planar { plane, .. })) if self.in_plane => {
                let drive = *plane.drive();
                plane.start(&drive).map_err(singular)
            }
            (Way::Accurate { .. }, _) => {
                let boundary = self.stepper.state.boundary;
                self.stepper.accelerate(&boundary)
            }
            // their histories are of positions and velocities
            (Way::Equal | Way::Static, _) => Ok(()),
        };
        if started.is_err() {
            self.take_damping(&before);
        }
        started
    }

    /// Begins anew in space where the tip's support has come or gone, which changes the accelerations at once.
    fn catch(&mut self, begin: &Boundary) -> Result<(), Failed> {
        self.leave_plane();
        if self.stepper.state.boundary.tip.held == begin.tip.held {
            return Ok(());
        }
        if self.stepper.rod.is_extensible() {
            // its accelerations have a history of their own
            self.stepper.state.boundary.tip = begin.tip;
            return Ok(());
        }
        self.stepper.accelerate(begin).map_err(|cause| Failed { time: 0.0, step: self.step, cause })
    }

    fn leave_plane(&mut self) {
        self.in_space();
        self.in_plane = false;
    }

    fn keep(&mut self) {
        let Self { in_plane, pace, simple, energy, effort, .. } = *self;
        self.before = Before { in_plane, pace, simple, energy, effort };
        if let Some(Planar { pace, disturbance, unwatched, before, .. }) = self.planar.as_deref_mut() {
            (before.0, before.2) = (*pace, *unwatched);
            before.1.copy_from(disturbance);
        }
        match &mut self.planar {
            Some(planar) if in_plane => planar.plane.keep(&mut planar.kept),
            _ => {
                self.mesh_before.cells.clone_from(&self.stepper.mesh.cells);
                self.state_before.copy_from(&self.stepper.state);
            }
        }
        if let Some((now, before)) = &mut self.refiners {
            before.copy_from(now);
        }
    }

    /// Makes the rod what it was before the interval.
    pub fn restore(&mut self) {
        let Before { in_plane, pace, simple, energy, effort } = self.before;
        (self.in_plane, self.pace, self.simple) = (in_plane, pace, simple);
        (self.energy, self.effort) = (energy, effort);
        // a plane that the interval has entered keeps nothing of it
        if let Some(Planar { pace, disturbance, unwatched, before, .. }) = self.planar.as_deref_mut() {
            (*pace, *unwatched) = (before.0, before.2);
            disturbance.copy_from(&before.1);
        }
        match &mut self.planar {
            Some(planar) if in_plane => planar.plane.restore(&planar.kept),
            _ => self.stepper.resume(&self.mesh_before, &self.state_before),
        }
        if let Some((now, before)) = &mut self.refiners {
            now.copy_from(before);
        }
        if let Some(events) = &mut self.events {
            events.clear();
        }
    }

    fn note(&mut self, event: Event) {
        if let Some(events) = &mut self.events {
            events.push(event);
        }
    }

    fn note_cells(&mut self) {
        if let (Some(events), Some((refiner, _))) = (&mut self.events, &self.refiners) {
            events.push(Event::Cells(refiner.last_change()));
        }
    }

    /// An interval in equal steps of generalized-α.
    fn march(&mut self, drive: &impl Fn(f64) -> Drive, duration: f64) -> Result<(), Failed> {
        // a host's round-off does not cost a step
        let steps = (duration / self.step * (1.0 - 1e-9)).ceil().max(1.0);
        let dt = duration / steps;
        let mut i = 0.0;
        while i < steps {
            self.step(drive, Kind::Fitting, i * dt, dt, 0)?;
            i += 1.0;
        }
        Ok(())
    }

    /// An interval in steps of order 4; `begin` is what acts at its beginning.
    fn follow(&mut self, drive: &impl Fn(f64) -> Drive, begin: &Drive, duration: f64) -> Result<(), Failed> {
        let ahead = ahead(drive, duration);
        let ends = [begin, &ahead[1]];
        self.choose(begin, &ahead);
        let planar = self.in_plane;
        let time = if planar { self.follow_in_plane(drive, ends, duration, true) } else { 0.0 };
        let done = self.follow_in_space(drive, time, duration);
        if done.is_err() && planar {
            // better in a plane that it would leave than nowhere
            self.restore();
            self.choose(begin, &ahead);
            if self.in_plane && self.follow_in_plane(drive, ends, duration, false) == duration {
                return Ok(());
            }
        }
        done
    }

    /// Enters or leaves a plane, as all that acts in the interval makes it.
    fn choose(&mut self, begin: &Drive, ahead: &[Drive; 2]) {
        let Some(Planar { plane, disturbance, unwatched, .. }) = self.planar.as_deref_mut() else { return };
        let holds = |plane: &Plane| plane.holds(begin) && ahead.iter().all(|drive| plane.holds(drive));
        let mut entered = false;
        if self.in_plane && !holds(plane) {
            write(plane, &mut self.stepper);
            self.in_plane = false;
        }
        if !self.in_plane {
            plane.take_mesh(&self.stepper.mesh.cells);
            entered = plane.enter(&self.stepper.state, begin) && holds(plane);
            self.in_plane = entered;
            if entered {
                disturbance.begin(plane, 1.0);
                *unwatched = (0.0, 0);
            }
        }
        let Drive { boundary, rates } = plane.drive();
        let jumped = has_jumped(boundary, &begin.boundary)
            || differ(&rates.angular_acceleration, &begin.rates.angular_acceleration);
        if self.in_plane && (entered || jumped) && plane.start(begin).is_err() {
            if !entered {
                write(plane, &mut self.stepper);
            }
            self.in_plane = false;
        }
    }

    /// Follows in the plane as long as the steps need not be too short, and if it is `watched`, as long as the rod would stay
    /// there; returns how far that was, s. Beyond that the rod is in space. `begin` and `end` are what acts at those of the
    /// interval.
    fn follow_in_plane(
        &mut self,
        drive: &impl Fn(f64) -> Drive,
        [begin, end]: [&Drive; 2],
        duration: f64,
        watched: bool,
    ) -> f64 {
        let Some(mut planar) = self.planar.take() else { return 0.0 };
        let works = planar.plane.is_lossy() || acts(begin) || acts(end);
        planar.plane.look(1.0, begin);
        // what pulls the rod may be other than before
        self.energy = self.energy.now(&planar.plane.energy());
        if self.effort.steps > 0 {
            self.adapt_in_plane(&mut planar, begin);
        }
        let (mut time, mut refuses, mut attempts) = (0.0, true, 0);
        while time < duration && self.in_plane {
            let (dt, last) = planar.pace.step(duration - time);
            attempts += 1;
            let at = |since: f64| drive(time + since);
            match self.attempt_in_plane(&mut planar, &at, dt, (works, refuses)) {
                Outcome::Taken => {}
                Outcome::TooCoarse(changed) => {
                    refuses = changed;
                    continue;
                }
                Outcome::TooLong if dt > planar.pace.shortest && attempts < MAX_PLANE_STEPS => continue,
                Outcome::TooLong => {
                    write(&mut planar.plane, &mut self.stepper);
                    self.in_plane = false;
                    continue;
                }
            }
            let due = watched && planar.is_due(dt);
            if !last {
                let now = *planar.plane.drive();
                self.adapt_in_plane(&mut planar, &now);
            }
            time = if last { duration } else { time + dt };
            if due && !planar.stays() {
                write(&mut planar.plane, &mut self.stepper);
                let most = ROUNDINGS * GROWN / planar.time;
                planar.disturbance.disturb(&planar.plane, ROUNDINGS, most, &mut self.stepper.state);
                self.in_plane = false;
            }
        }
        self.planar = Some(planar);
        time
    }

    /// Changes the cells of a rod in a plane, if it is time to. Not at the end of an interval but at the beginning of the
    /// next, when they have a step to settle in: the reaction of new ones, by what they leave of the moments, is off by
    /// several percent at first.
    fn adapt_in_plane(&mut self, planar: &mut Planar, now: &Drive) {
        let joins = self.moves();
        if let Some((refiner, _)) = &mut self.refiners {
            // cells that cannot be started stay as they were
            let changed = refiner.adapt_plane(&mut planar.plane, now, joins) == Ok(true);
            self.effort.space_error = self.effort.space_error.max(refiner.estimated());
            if changed {
                planar.disturbance.go_on(&planar.plane);
                self.energy = self.energy.now(&planar.plane.energy());
                self.note_cells();
            }
        }
    }

    /// The same in space.
    fn adapt_in_space(&mut self, now: &Boundary) {
        let joins = self.moves();
        if let Some((refiner, _)) = &mut self.refiners {
            let changed = refiner.adapt(&mut self.stepper, now, joins) == Ok(true);
            self.effort.space_error = self.effort.space_error.max(refiner.estimated());
            if changed {
                self.see_energy(&now.gravity);
                self.note_cells();
            }
        }
    }

    /// Takes a step of `dt` s in the plane, if its error, its energy and, if it `refuses`, its cells are good enough. `drive`
    /// is what acts since its beginning, and `works` if need be.
    fn attempt_in_plane(
        &mut self,
        planar: &mut Planar,
        drive: &impl Fn(f64) -> Drive,
        dt: f64,
        (works, refuses): (bool, bool),
    ) -> Outcome {
        let Planar { plane, pace, disturbance, time, .. } = planar;
        let error = plane.attempt(drive, dt).map_or(f64::NAN, |estimate| estimate.position);
        if !pace.allows(dt, error) {
            self.effort.retried();
            return Outcome::TooLong;
        }
        let energy = take_in_plane(plane, drive, dt, works, &self.energy);
        if gain(&self.energy, &energy, self.large) > GAIN * self.drift * dt.max(SUDDEN * *time) {
            plane.take_back();
            plane.look(1.0, &drive(0.0));
            pace.next = dt * LOST;
            self.effort.retried();
            return Outcome::TooLong;
        }
        if let Some((refiner, _)) = self.refiners.as_mut().filter(|_| refuses) {
            let refused = refiner.refuse_plane(plane, drive);
            if refused != Ok(false) {
                disturbance.go_on(plane);
                self.energy = self.energy.now(&plane.energy());
                self.effort.retried();
                if refused.is_ok() {
                    self.note_cells();
                }
                return Outcome::TooCoarse(refused.is_ok());
            }
        }
        self.energy = energy;
        self.effort.took(plane.order(), dt, error);
        self.effort.planar = true;
        self.note(Event::InPlane(dt));
        Outcome::Taken
    }

    /// Whether cells that are joined would bring more than waves.
    fn moves(&self) -> bool {
        self.energy.kinetic > self.rest * self.large
    }

    /// Follows in space from `time` on, as long as the error allows; steps of generalized-α take over where they would be
    /// too many.
    fn follow_in_space(&mut self, drive: &impl Fn(f64) -> Drive, mut time: f64, duration: f64) -> Result<(), Failed> {
        if time == 0.0 && self.effort.steps > 0 {
            self.adapt_in_space(&drive(0.0).boundary);
        }
        let shortest = self.pace.shortest.max(duration / MAX_CHOSEN_STEPS);
        let mut refuses = true;
        while time < duration {
            let rest = duration - time;
            let simple = self.simple.next >= rest;
            let mut dt = if simple { rest } else { Pace { shortest, ..self.pace }.step(rest).0 };
            let outcome = match simple {
                true => self.attempt_in_space(&TR_BDF2, drive, (time, dt), (false, refuses)),
                false => self.attempt_in_space(&ESDIRK4, drive, (time, dt), (dt <= shortest, refuses)),
            };
            match outcome {
                Outcome::Taken => {
                    if !simple {
                        let error = self.stepper.simple_error();
                        self.pace_of(&TR_BDF2, dt).see(dt, error);
                    }
                }
                Outcome::TooCoarse(changed) => {
                    refuses = changed;
                    continue;
                }
                Outcome::TooLong if simple || dt > shortest => continue,
                Outcome::TooLong => {
                    self.pace.next = shortest;
                    dt = match self.fall(drive, time, dt, rest) {
                        Ok(dt) => dt,
                        Err(_) if self.halve(&drive(time).boundary) => continue,
                        Err(failed) => return Err(failed),
                    };
                }
            }
            time = if dt == rest { duration } else { time + dt };
            if time < duration {
                self.adapt_in_space(&drive(time).boundary);
            }
        }
        Ok(())
    }

    /// Halves the longest cells of a rod in space that no step brings on, if they are too coarse and there is room; whether
    /// that was so.
    fn halve(&mut self, now: &Boundary) -> bool {
        let Self { stepper, refiners: Some((refiner, _)), .. } = self else { return false };
        let longest = stepper.mesh.cells.iter().map(|cell| cell.length).fold(0.0, f64::max);
        let halved = refiner.is_coarse(stepper) && refiner.halve(stepper, now, 0.5 * longest, true) == Ok(true);
        if halved {
            self.see_energy(&now.gravity);
            self.note_cells();
        }
        halved
    }

    /// Takes a step of implicit Euler from `time` on where one of `shortest` s is not good enough otherwise, in an interval of
    /// which `rest` s are left; returns how long it was.
    fn fall(&mut self, drive: &impl Fn(f64) -> Drive, time: f64, shortest: f64, rest: f64) -> Result<f64, Failed> {
        let (mut dt, mut kind) = (shortest, Kind::Falling);
        loop {
            let Err(failed) = self.step(drive, kind, time, dt, MAX_HALVINGS) else { return Ok(dt) };
            self.effort.iterated(failed.cause.iterations);
            self.effort.retried();
            match kind {
                // a cell bent further than its rotation vector reaches comes back in a long step, and in no short one
                Kind::Falling if dt < rest => dt = (2.0 * dt).min(rest),
                Kind::Falling => kind = Kind::Damped,
                _ if dt <= shortest * SHORTEST_FALL => return Err(failed),
                _ => dt *= 0.5,
            }
        }
    }

    /// Takes a step of `dt` s in space from `time` on, if it is good enough; one that `must` be is, as long as no energy
    /// grows: what it cannot follow may be off, and the estimate tells by how much. Its cells count if it `refuses`.
    fn attempt_in_space(
        &mut self,
        method: &'static RungeKutta,
        drive: &impl Fn(f64) -> Drive,
        (time, dt): (f64, f64),
        (must, refuses): (bool, bool),
    ) -> Outcome {
        let allowed = self.pace_of(method, dt).allowed;
        let accuracy = if method.order == 2 { allowed } else { ITERATED * allowed };
        let Attempt { iterations, error, work } = match self.compute(method, drive, (time, dt), accuracy) {
            Ok(attempt) => attempt,
            Err(diverged) => {
                self.pace_of(method, dt).next = dt * LOST;
                self.effort.iterated(diverged.iterations);
                self.effort.retried();
                return Outcome::TooLong;
            }
        };
        let fits = self.pace_of(method, dt).allows(dt, error);
        self.effort.iterated(iterations);
        let Stepper { mesh, rod, .. } = &self.stepper;
        let state = self.stepper.attempted();
        let energy = self.energy.with(mesh, rod, state, &state.boundary.gravity, &work);
        let grows = gain(&self.energy, &energy, self.large) > GAIN * self.drift * dt;
        if fits && grows {
            self.pace_of(method, dt).next = dt * LOST;
        }
        if grows || !(fits || must) {
            self.effort.retried();
            return Outcome::TooLong;
        }
        if let Some((refiner, _)) = self.refiners.as_mut().filter(|_| refuses) {
            let begin = drive(time).boundary;
            let refused = refiner.refuse(&mut self.stepper, &begin);
            if refused != Ok(false) {
                self.see_energy(&begin.gravity);
                self.effort.retried();
                if refused.is_ok() {
                    self.note_cells();
                }
                return Outcome::TooCoarse(refused.is_ok());
            }
        }
        self.stepper.accept();
        self.energy = energy;
        self.effort.took(method.order, dt, error);
        self.note(Event::InSpace(method, dt));
        Outcome::Taken
    }

    /// The pace of steps by `method`, now that one is to be of `dt` s.
    fn pace_of(&mut self, method: &RungeKutta, dt: f64) -> &mut Pace {
        match method.order {
            2 => {
                self.simple.allowed = self.simple_drift * dt;
                &mut self.simple
            }
            _ => &mut self.pace,
        }
    }

    /// Computes a step of `dt` s in space from `time` on, and what an iteration need not resolve is `accuracy`.
    fn compute(
        &mut self,
        method: &'static RungeKutta,
        drive: &impl Fn(f64) -> Drive,
        (time, dt): (f64, f64),
        accuracy: f64,
    ) -> Result<Attempt, Diverged> {
        let begin = drive(time).boundary;
        let jumped = has_jumped(&self.stepper.state.boundary, &begin);
        let started = if jumped || self.stepper.state.dt > 0.0 { self.stepper.accelerate(&begin) } else { Ok(()) };
        if jumped {
            // gravity may be other than before
            self.see_energy(&begin.gravity);
        }
        let at = |since: f64| drive(time + since).boundary;
        started.and_then(|()| self.stepper.attempt(method, &at, dt, accuracy))
    }

    /// Reads the energies of the rod in space, which other cells or another gravity have changed.
    fn see_energy(&mut self, gravity: &Vec3) {
        let Stepper { mesh, rod, state, .. } = &self.stepper;
        self.energy = self.energy.now(&Energy::of(mesh, rod, state, gravity));
    }

    /// One step from `time`, or its two halves.
    fn step(
        &mut self,
        drive: &impl Fn(f64) -> Drive,
        kind: Kind,
        time: f64,
        dt: f64,
        halvings: u32,
    ) -> Result<(), Failed> {
        let boundary = drive(time + dt).boundary;
        let report = match kind {
            Kind::Fitting => self.stepper.advance(&boundary, self.scheme, dt),
            Kind::Damped | Kind::Falling => self.stepper.step(&boundary, Scheme::BACKWARD_EULER, dt, Row::Positions),
            Kind::Resting => self.stepper.drift(&boundary, dt),
        };
        match report {
            Ok(report) => {
                self.effort.iterated(report.iterations);
                let Stepper { mesh, rod, state, .. } = &self.stepper;
                let before = self.stepper.previous();
                let begin = drive(time).boundary;
                let mean = |from: Vec3, to: Vec3| 0.5 * (from + to);
                let worked = Boundary {
                    tip_force: mean(begin.tip_force, boundary.tip_force),
                    tip_moment: mean(begin.tip_moment, boundary.tip_moment),
                    ..boundary
                };
                let energy = self.energy.after(mesh, rod, before, state, &worked);
                if kind == Kind::Falling && gain(&self.energy, &energy, self.large) > WILD {
                    self.stepper.take_back();
                    let (iterations, residual) = (report.iterations, report.residual);
                    let cause = Diverged { iterations, residual, reason: Reason::Elsewhere };
                    return Err(Failed { time, step: dt, cause });
                }
                self.energy = energy;
                let order = match kind {
                    Kind::Resting => 0,
                    _ if self.stepper.state.scheme.is_second_order() => 2,
                    _ => 1,
                };
                self.effort.took(order, dt, 0.0);
                self.note(Event::Unestimated(dt));
                Ok(())
            }
            Err(cause) if halvings == MAX_HALVINGS => Err(Failed { time, step: dt, cause }),
            Err(cause) => {
                self.effort.retried();
                self.effort.iterated(cause.iterations);
                self.step(drive, kind, time, 0.5 * dt, halvings + 1)?;
                self.step(drive, kind, time + 0.5 * dt, 0.5 * dt, halvings + 1)
            }
        }
    }

    /// An interval from one equilibrium to the next, in which loads and gravity go steadily to what they are to be.
    fn drift(&mut self, drive: &impl Fn(f64) -> Drive, duration: f64) -> Result<(), Failed> {
        let (from, begin) = (self.stepper.state.boundary, drive(0.0).boundary);
        let steady = |time: f64| {
            let Drive { boundary: to, rates } = drive(time);
            let share = time / duration;
            let between = |from: Vec3, to: Vec3| if share < 1.0 { from + (to - from) * share } else { to };
            // what the loads have done since the beginning they do by themselves
            let boundary = Boundary {
                tip_force: between(from.tip_force + (to.tip_force - begin.tip_force), to.tip_force),
                tip_moment: between(from.tip_moment + (to.tip_moment - begin.tip_moment), to.tip_moment),
                gravity: between(from.gravity, to.gravity),
                ..to
            };
            Drive { boundary, rates }
        };
        self.step(&steady, Kind::Resting, 0.0, duration, 0)
    }

    /// The last interval as it was gone through, of this duration and under this drive.
    ///
    /// # Errors
    /// [`Failed`] if duration or drive are others.
    pub fn course(&self, drive: &impl Fn(f64) -> Drive, duration: f64) -> Result<Course, Failed> {
        let mut begin = self.clone();
        begin.restore();
        let mut again = begin.clone();
        again.events = Some(Vec::new());
        again.advance(drive, duration)?;
        Ok(Course { begin, events: again.events.unwrap_or_default(), duration })
    }

    /// The rod started anew under `boundary`, on the cells and with the damping that it has: in equilibrium if it `rests`
    /// or its tip is held, else with its rest shape. `time` is the shortest one in which gravity or stiffness move the whole
    /// rod, s.
    ///
    /// # Errors
    /// [`Diverged`] if there is no such start near the present state.
    pub fn restarted(&self, boundary: &Boundary, rests: bool, time: f64) -> Result<Self, Diverged> {
        let mut rod = self.clone();
        rod.leave_plane();
        let Self { stepper, way, .. } = &mut rod;
        let is_held = boundary.tip.held != Held::FREE;
        if rests || is_held {
            stepper.relax(boundary)?;
        } else {
            stepper.state = State::at_rest_shape(&stepper.mesh, &boundary.base);
        }
        let moves = is_held && span::set_in_motion(stepper, boundary, time)?;
        if *way != Way::Static {
            stepper.begin(boundary, moves)?;
        }
        rod.see_energy(&boundary.gravity);
        Ok(rod)
    }

    /// Goes through a course again, in space: a step in a plane like one of order 4.
    fn repeat(&mut self, events: &[Event], drive: &impl Fn(f64) -> Drive) -> Result<(), Failed> {
        self.leave_plane();
        let mut time = 0.0;
        for event in events {
            match event {
                Event::InPlane(dt) | Event::InSpace(_, dt) => {
                    let method = if let Event::InSpace(method, _) = event { method } else { &ESDIRK4 };
                    self.step_again(method, drive, time, *dt, 0)?;
                    time += dt;
                }
                Event::Unestimated(dt) => {
                    self.step(drive, Kind::Damped, time, *dt, MAX_HALVINGS)?;
                    time += dt;
                }
                Event::Cells(change) => {
                    let Some((refiner, _)) = &mut self.refiners else { continue };
                    let now = drive(time).boundary;
                    let changed = refiner.change_to(change, &mut self.stepper, &now);
                    changed.map_err(|cause| Failed { time, step: 0.0, cause })?;
                    self.see_energy(&now.gravity);
                }
            }
        }
        Ok(())
    }

    /// The same in the plane that the rod stays in.
    fn repeat_in_plane(&mut self, events: &[Event], drive: &impl Fn(f64) -> Drive) -> Result<(), Failed> {
        let Some(Planar { plane, .. }) = self.planar.as_deref_mut() else { return Ok(()) };
        plane.look(1.0, &drive(0.0));
        self.energy = self.energy.now(&plane.energy());
        let mut time = 0.0;
        for event in events {
            match event {
                Event::InPlane(dt) => {
                    let at = |since: f64| drive(time + since);
                    plane.attempt(&at, *dt).map_err(|cause| Failed { time, step: *dt, cause: singular(cause) })?;
                    self.energy = take_in_plane(plane, &at, *dt, true, &self.energy);
                    time += dt;
                }
                Event::Cells(change) => {
                    let Some((refiner, _)) = &mut self.refiners else { continue };
                    let changed = refiner.change_plane_to(change, plane, &drive(time));
                    changed.map_err(|cause| Failed { time, step: 0.0, cause })?;
                    self.energy = self.energy.now(&plane.energy());
                }
                Event::InSpace(..) | Event::Unestimated(_) => {}
            }
        }
        Ok(())
    }

    /// One step of a course from `time`, or its two halves where the like of a step in a plane is too long in space.
    fn step_again(
        &mut self,
        method: &'static RungeKutta,
        drive: &impl Fn(f64) -> Drive,
        time: f64,
        dt: f64,
        halvings: u32,
    ) -> Result<(), Failed> {
        match self.compute(method, drive, (time, dt), 0.0) {
            Ok(Attempt { work, .. }) => {
                let Stepper { mesh, rod, .. } = &self.stepper;
                let state = self.stepper.attempted();
                self.energy = self.energy.with(mesh, rod, state, &state.boundary.gravity, &work);
                self.stepper.accept();
                Ok(())
            }
            Err(cause) if halvings == MAX_HALVINGS => Err(Failed { time, step: dt, cause }),
            Err(_) => {
                self.step_again(method, drive, time, 0.5 * dt, halvings + 1)?;
                self.step_again(method, drive, time + 0.5 * dt, 0.5 * dt, halvings + 1)
            }
        }
    }

    /// The ends of the rod at present.
    pub fn ends(&self) -> Ends {
        if let Some(plane) = self.plane() {
            let (Tip { position, velocity, rotation, angular_velocity }, (force, moment)) =
                (plane.tip(), plane.reaction());
            let (tip_force, tip_moment) = Default::default();
            return Ends { position, rotation, velocity, angular_velocity, force, moment, tip_force, tip_moment };
        }
        let Stepper { state, rod, .. } = &self.stepper;
        let (tip_force, tip_moment) = state.tip_reaction(rod);
        let (tip, memory, base) = (state.tip(), state.tip_memory(), &state.nodes[0]);
        Ends {
            position: tip.position,
            rotation: tip.rotation,
            velocity: memory.travel.velocity.value,
            angular_velocity: tip.rotation * memory.spin.velocity.value,
            force: base.force,
            moment: base.moment,
            tip_force: Vec3::zeros() - tip_force,
            tip_moment: Vec3::zeros() - tip_moment,
        }
    }

    /// Fills `points` with the centreline at these `parts` of the arc length, in any order, m, world frame.
    pub fn centreline(&self, parts: &[f64], points: &mut [Vec3]) {
        let Stepper { mesh, rod, state, .. } = &self.stepper;
        let mesh = self.plane().map_or(mesh, Plane::mesh);
        let (mut cell, mut start) = (0, 0.0);
        for (point, part) in points.iter_mut().zip(parts) {
            let arc = mesh.length() * part;
            if arc < start {
                (cell, start) = (0, 0.0);
            }
            while cell + 1 < mesh.cells.len() && arc > start + mesh.cells[cell].length {
                start += mesh.cells[cell].length;
                cell += 1;
            }
            let fraction = ((arc - start) / mesh.cells[cell].length).min(1.0);
            *point = match self.plane() {
                Some(plane) => plane.position_within(cell, fraction),
                None => state.position_within(mesh, rod, cell, fraction),
            };
        }
    }

    fn plane(&self) -> Option<&Plane> {
        self.planar.as_ref().filter(|_| self.in_plane).map(|planar| &planar.plane)
    }

    /// Its energies at present, and works and losses since the start.
    pub fn energy(&self) -> &Energy {
        &self.energy
    }

    /// What it took so far.
    pub fn effort(&self) -> &Effort {
        &self.effort
    }

    /// The cells along the rod.
    pub fn cells(&self) -> usize {
        self.plane().map_or(&self.stepper.mesh, Plane::mesh).cells.len()
    }

    /// Arc length of the rod, m.
    pub fn length(&self) -> f64 {
        self.plane().map_or(&self.stepper.mesh, Plane::mesh).length()
    }

    /// The rod in space at present, wherever it is.
    pub fn in_space(&mut self) -> &mut Stepper {
        if let Some(Planar { plane, .. }) = self.planar.as_deref_mut().filter(|_| self.in_plane) {
            write(plane, &mut self.stepper);
        }
        &mut self.stepper
    }
}

impl Course {
    /// Whether all of it was in a plane, and would have been under another `drive`.
    pub fn stays_in_plane(&self, drive: &impl Fn(f64) -> Drive) -> bool {
        let in_plane = |event: &Event| matches!(event, Event::InPlane(_) | Event::Cells(_));
        let mut rod = self.begin.clone();
        rod.choose(&drive(0.0), &ahead(drive, self.duration));
        rod.in_plane && self.events.iter().all(in_plane)
    }

    /// The rod at the end of the interval, had it been under another `drive`, with the damping of another rod if there is
    /// one: in a plane, if it is one that it [stays](Self::stays_in_plane) in, else in space, which sees what leads out of it.
    ///
    /// # Errors
    /// [`Failed`] if that is too far from what it was under.
    pub fn under(
        &self,
        drive: &impl Fn(f64) -> Drive,
        damping: Option<&Rod>,
        in_plane: bool,
    ) -> Result<Integrator, Failed> {
        let mut rod = self.begin.clone();
        if let Some(damping) = damping {
            rod.damp(damping).map_err(|cause| Failed { time: 0.0, step: 0.0, cause })?;
        }
        match rod.way {
            Way::Accurate { .. } if drive(0.0).boundary.tip.held == Held::FREE => {
                if in_plane {
                    rod.choose(&drive(0.0), &ahead(drive, self.duration));
                }
                match in_plane && rod.in_plane {
                    true => rod.repeat_in_plane(&self.events, drive)?,
                    false => rod.repeat(&self.events, drive)?,
                }
            }
            // steps of equal length, and none, need nothing settled
            _ => rod.advance(drive, self.duration)?,
        }
        Ok(rod)
    }
}

/// What a step has added to the energy beyond the work that was done in it, relative to it, or to the `large` one, J, that
/// gravity and bending can give.
fn gain(before: &Energy, after: &Energy, large: f64) -> f64 {
    (after.residual(before) - before.residual(before)) / after.scale(large)
}

/// What is kept before an interval, so that a step that fails is undone, is all that decides what follows, for a rod that
/// was started alike. It is loaded from what the present saves in its place.
impl Archived for Integrator {
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
        let loading = archive.is_loading();
        let Self { stepper, in_plane, planar, pace, simple, large, energy, effort, before, refiners, .. } = self;
        let mut now = Before { in_plane: *in_plane, pace: *pace, simple: *simple, energy: *energy, effort: *effort };
        let Before { in_plane, pace, simple, energy, effort } = if loading { before } else { &mut now };
        in_plane.visit(archive)?;
        pace.visit(archive)?;
        simple.visit(archive)?;
        energy.visit(archive)?;
        effort.visit(archive)?;
        // of a length summed up over the cells of the start
        large.visit(archive)?;
        if let Some(Planar { pace, disturbance, unwatched, before, .. }) = planar.as_deref_mut() {
            let (pace, disturbance, unwatched) = match loading {
                true => (&mut before.0, &mut before.1, &mut before.2),
                false => (pace, disturbance, unwatched),
            };
            pace.visit(archive)?;
            disturbance.visit(archive)?;
            unwatched.visit(archive)?;
        }
        match planar.as_deref_mut() {
            Some(Planar { kept, .. }) if *in_plane && loading => kept.visit(archive)?,
            Some(Planar { plane, kept, .. }) if *in_plane => {
                let mut kept = kept.clone();
                plane.keep(&mut kept);
                kept.visit(archive)?;
            }
            _ => {
                let (mesh, state) = match loading {
                    true => (&mut self.mesh_before, &mut self.state_before),
                    false => (&mut stepper.mesh, &mut stepper.state),
                };
                mesh.cells.visit(archive)?;
                state.resize(mesh.cells.len(), mesh.rule.stages);
                state.visit(archive)?;
            }
        }
        if let Some((now, before)) = refiners {
            if loading { before } else { now }.visit(archive)?;
        }
        if loading {
            self.restore();
        }
        Ok(())
    }
}

/// Takes the step of `dt` s that was attempted in a plane; the energy after it, with what worked if anything `works`.
fn take_in_plane(plane: &mut Plane, drive: &impl Fn(f64) -> Drive, dt: f64, works: bool, before: &Energy) -> Energy {
    let begin = if works { plane.power() } else { Powers::default() };
    plane.accept();
    let mut work = Powers::default();
    if works {
        plane.look(0.5, &drive(0.5 * dt));
        let middle = plane.power();
        plane.look_at_present();
        // Simpson's rule
        work = begin.times(dt / 6.0).plus(middle, 4.0 * dt / 6.0).plus(plane.power(), dt / 6.0);
    } else {
        plane.look_at_present();
    }
    before.worked(&work).now(&plane.energy())
}

/// Makes the rod in a plane that of `stepper`.
fn write(plane: &mut Plane, stepper: &mut Stepper) {
    stepper.take_mesh(&plane.mesh().cells);
    plane.write(&mut stepper.state);
}

/// What acts within an interval and at its end: velocities on a smooth path are parabolas, here at least, and three of them
/// tell whether all of it lies in a plane.
fn ahead(drive: &impl Fn(f64) -> Drive, duration: f64) -> [Drive; 2] {
    [drive(0.5 * duration), drive(duration)]
}

/// Whether loads or accelerations of the base are not those that the rod's accelerations belong to.
fn has_jumped(before: &Boundary, now: &Boundary) -> bool {
    let acting = |at: &Boundary| [at.tip_force, at.tip_moment, at.gravity, at.base.acceleration];
    acting(before).iter().zip(&acting(now)).any(|(before, now)| differ(before, now))
}

fn differ(before: &Vec3, now: &Vec3) -> bool {
    (now - before).norm() > JUMP * before.norm().max(now.norm())
}

/// Whether work is done on the ends.
fn acts(drive: &Drive) -> bool {
    let Drive { boundary: Boundary { base, tip_force, tip_moment, .. }, rates } = drive;
    let loads = [*tip_force, *tip_moment, rates.tip_force, rates.tip_moment];
    [base.velocity, base.angular_velocity].iter().chain(&loads).any(|vector| *vector != Vec3::zeros())
}

impl Effort {
    fn iterated(&mut self, iterations: usize) {
        self.iterations = self.iterations.saturating_add(iterations as i32);
    }

    fn retried(&mut self) {
        self.retries = self.retries.saturating_add(1);
    }

    fn took(&mut self, order: i32, dt: f64, error: f64) {
        self.steps = self.steps.saturating_add(1);
        (self.order, self.step, self.planar) = (order, dt, false);
        self.error += error;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_follow_their_error() {
        for order in [2, 4, 5] {
            assert_eq!(stretch(0.0, order), CHANGE.1);
            assert_eq!(stretch(1e30, order), CHANGE.0);
            assert_eq!(stretch(f64::NAN, order), LOST);
            assert!((stretch(1.0, order) - SAFETY).abs() < 1e-15);
        }
    }
}
