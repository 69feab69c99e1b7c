//! The model without FMI: parameters and inputs in, one rod advanced by communication steps, outputs out.
//!
//! Between two communication points the base, and a driven tip, follow a path through what the host samples
//! ([`crate::path`]) and the rod is moved to the tolerance ([`crate::integrator`]). What the host may set is checked here,
//! and errors name it.

mod error;
mod inputs;
mod outputs;
mod parameters;
mod response;

pub use error::{Allowed, Error, Warning};
pub use inputs::{Derivatives, Inputs};
pub use outputs::{Outputs, STATIONS};
pub use parameters::{Parameters, Tunable};
pub use response::Response;

use crate::archive::{self, Archive, Archived, Corrupt, archived};
use crate::boundary::{Boundary, Drive, Rates, Support};
use crate::integrator::{Ends, Failed, Integrator};
use crate::modes::{self, Mode};
use crate::path::{Given, Path, Sample, Segment};
use crate::stepper::Stepper;
use inputs::at;
use nalgebra::Vector4;
use parameters::{TAUT, allow};

/// Distance of the sampled pose from the path, as a part of the rod's length or in rad, beyond which pose and twist
/// disagree; half a communication step's motion is allowed on top, since the first steps do not know the acceleration.
const DISAGREEMENT: f64 = 0.02;

/// Internal steps in a communication step beyond which the host has asked for something else than it wants.
const MAX_INTERNAL_STEPS: f64 = 1e7;

/// An end of the rod with a path, in the words of the warning.
struct End {
    place: usize,
    name: &'static str,
    pose: [&'static str; 2],
    twist: [&'static str; 2],
}

const BASE: End = End {
    place: 0,
    name: "base",
    pose: ["base.position", "base.orientation"],
    twist: ["base.velocity", "base.angular_velocity"],
};
const TIP: End = End {
    place: 1,
    name: "tip",
    pose: ["tip.driven_position", "tip.driven_orientation"],
    twist: ["tip.driven_velocity", "tip.driven_angular_velocity"],
};

/// What a rod was started from: it settles all that is fixed, and how much room there is.
#[derive(Clone, Debug, Default)]
struct Start {
    parameters: Parameters,
    inputs: Inputs,
    /// Of the experiment.
    tolerance: Option<f64>,
}

archived!(Start { parameters, inputs, tolerance });

impl Start {
    /// Paths that begin where these inputs say.
    fn paths(&self, inputs: &Inputs) -> Paths {
        let Parameters { base_motion, tip_mode, .. } = self.parameters;
        Paths {
            base: Path::new(given(base_motion), inputs.sample()),
            tip: (tip_mode == 1).then(|| self.tip_path(inputs)),
        }
    }

    fn tip_path(&self, inputs: &Inputs) -> Path {
        Path::new(given(self.parameters.tip_motion), inputs.tip_sample())
    }
}

/// One rod, started and ready to step.
#[derive(Clone, Debug)]
pub struct Unit {
    start: Start,
    integrator: Integrator,
    /// Longest step of generalized-α, s.
    step: f64,
    /// Whether there are no others, whatever holds the tip.
    steps_equally: bool,
    /// Longest cell of a rod whose tip is held, m.
    longest_cell: f64,
    quasi_static: bool,
    tunable: Tunable,
    path: Path,
    /// Of the tip, of no use where it is free.
    tip_path: Path,
    /// Whether the tip is driven at present.
    driven: bool,
    /// Of the base, and of the tip.
    warned: [bool; 2],
    outputs: Outputs,
    /// The outputs at the start of the last communication step, and its length, s; 0 before the first.
    before: (Outputs, f64),
    /// The last communication step, as long as the integrator knows where it began.
    last: Option<Last>,
}

/// The paths of both ends, of the tip if it is driven.
#[derive(Clone, Debug)]
struct Paths {
    base: Path,
    tip: Option<Path>,
}

/// The same within one communication step.
#[derive(Clone, Debug)]
struct Segments {
    base: Segment,
    tip: Option<Segment>,
}

impl Paths {
    /// Over the next `step` s.
    fn segments(&self, Acting { inputs, derivatives, .. }: &Acting, step: f64) -> Segments {
        let of_tip = |tip: &Path| tip.segment(&inputs.tip_sample(), &derivatives.tip_onward(inputs), step);
        let base = self.base.segment(&inputs.sample(), &derivatives.base_onward(inputs), step);
        Segments { base, tip: self.tip.as_ref().map(of_tip) }
    }
}

impl Segments {
    /// Distance of the ends `time` s after the start of the step, m; 0 where the tip is free.
    fn apart(&self, time: f64) -> f64 {
        let apart = |tip: &Segment| (tip.at(time).position - self.base.at(time).position).norm();
        self.tip.as_ref().map_or(0.0, apart)
    }

    /// The paths at the end of the step.
    fn into_paths(self) -> Paths {
        Paths { base: self.base.into_path(), tip: self.tip.map(Segment::into_path) }
    }
}

/// A communication step: the paths before it, what acted in it, its length in s.
#[derive(Clone, Debug)]
struct Last {
    paths: Paths,
    acting: Acting,
    duration: f64,
}

/// What acts on a rod in a communication step.
#[derive(Clone, Debug)]
pub struct Acting {
    /// The inputs at its beginning.
    pub inputs: Inputs,
    /// How they go on.
    pub derivatives: Derivatives,
    /// What else may change.
    pub tunable: Tunable,
}

/// What `base.motion` and `tip.motion` stand for.
fn given(motion: i32) -> Given {
    match motion {
        0 => Given::PoseAndTwist,
        1 => Given::Pose,
        _ => Given::Twist,
    }
}

impl Unit {
    /// Starts a rod. `tolerance` is that of the experiment, if the host gave one.
    ///
    /// # Errors
    /// [`Error`] names the parameter or input that is not allowed, or says why there is no start.
    pub fn new(parameters: &Parameters, inputs: &Inputs, tolerance: Option<f64>) -> Result<Self, Error> {
        let start = Start { parameters: parameters.clone(), inputs: inputs.clone(), tolerance };
        let (mut unit, boundary) = Self::of(start, Parameters::start)?;
        unit.read_out(&boundary);
        Ok(unit)
    }

    /// A unit of what `begin` makes, and what acts on it then.
    fn of(
        start: Start,
        begin: impl Fn(&Parameters, &Boundary, f64) -> Result<Integrator, Error>,
    ) -> Result<(Self, Boundary), Error> {
        let Start { parameters, inputs, tolerance } = &start;
        parameters.validate()?;
        inputs.validate()?;
        let positive = |value: &f64| value.is_finite() && *value > 0.0;
        let tolerance = Some(parameters.tolerance).filter(positive).or(tolerance.filter(positive)).unwrap_or(1e-3);
        let driven = parameters.tip_mode == 1;
        if driven {
            inputs.validate_tip()?;
        }
        let paths = start.paths(inputs);
        let boundary = Acting::held(inputs, parameters.tunable()).at(&paths);
        let unit = Self {
            integrator: begin(parameters, &boundary, tolerance)?,
            step: parameters.longest_step(&parameters.rod(), tolerance),
            steps_equally: parameters.step > 0.0 || parameters.extensible,
            longest_cell: parameters.longest_cell(&parameters.rod(), &boundary, tolerance),
            quasi_static: parameters.quasi_static,
            tunable: parameters.tunable(),
            tip_path: start.tip_path(inputs),
            path: paths.base,
            driven,
            warned: [false; 2],
            outputs: Outputs::default(),
            before: Default::default(),
            last: None,
            start,
        };
        Ok((unit, boundary))
    }

    /// Advances by one communication step of `step_size` s, from the inputs at its start. A tip that was free and is to be
    /// driven begins with the motion it has, and is led to the inputs; one that was driven and is to be free goes on from it.
    ///
    /// # Errors
    /// [`Error`]; the unit is then exactly as before and the call may be repeated.
    pub fn advance(&mut self, inputs: &Inputs, step_size: f64) -> Result<Option<Warning>, Error> {
        self.advance_along(inputs, &Derivatives::default(), step_size)
    }

    /// The same with inputs that go on by their derivatives.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub fn advance_along(
        &mut self,
        inputs: &Inputs,
        derivatives: &Derivatives,
        step_size: f64,
    ) -> Result<Option<Warning>, Error> {
        inputs.validate()?;
        derivatives.validate()?;
        if !(step_size > 0.0 && step_size.is_finite()) {
            return Err(Error::NotAllowed {
                name: "communication step size",
                value: step_size,
                allowed: Allowed::Positive,
            });
        }
        let is_driven = self.tunable.tip_mode == 1;
        if is_driven {
            inputs.validate_tip()?;
        }
        if (self.steps_equally || is_driven) && step_size / self.step > MAX_INTERNAL_STEPS {
            let allowed = Allowed::Such("0 (automatic), or at least a ten-millionth of the communication step");
            return Err(Error::NotAllowed { name: "step", value: self.step, allowed });
        }
        self.last = None;
        let acting = Acting { inputs: inputs.clone(), derivatives: derivatives.clone(), tunable: self.tunable };
        let catches = is_driven && !self.driven;
        let tip = match (is_driven, catches) {
            (false, _) => None,
            (true, false) => Some(self.tip_path.clone()),
            (true, true) => Some(self.catch(&inputs.tip_sample())),
        };
        let paths = Paths { base: self.path.clone(), tip };
        let segments = paths.segments(&acting, step_size);
        if let Err(error) = self.start.parameters.reaches(segments.apart(step_size), 1.0) {
            if catches {
                self.integrator.restore();
            }
            return Err(error);
        }
        let done = match catches {
            true => self.integrator.go_on(&acting.along(&segments), step_size),
            false => self.integrator.advance(&acting.along(&segments), step_size),
        };
        done.map_err(|failed| self.failure(failed, &segments))?;
        let of_base = self.disagreement(BASE, &segments.base, step_size);
        let of_tip = || segments.tip.as_ref().and_then(|tip| self.disagreement(TIP, tip, step_size));
        let warning = of_base.or_else(of_tip);
        let end = acting.along(&segments)(step_size).boundary;
        let Paths { base, tip } = segments.into_paths();
        self.path = base;
        if let Some(tip) = tip {
            self.tip_path = tip;
        }
        self.driven = is_driven;
        self.last = Some(Last { paths, acting, duration: step_size });
        self.before = (self.outputs.clone(), step_size);
        self.read_out(&end);
        Ok(warning)
    }

    fn failure(&self, Failed { time, step, cause }: Failed, segments: &Segments) -> Error {
        match (self.start.parameters.reaches(segments.apart(time + step), TAUT), self.quasi_static) {
            (Err(error), _) => error,
            (Ok(()), true) => Error::NoEquilibriumNearby { time, cause },
            (Ok(()), false) => Error::Diverged { time, step, cause },
        }
    }

    /// How the outputs respond to what acts, and what acted.
    ///
    /// # Errors
    /// [`Error::NoStep`] where a state was loaded, or a step has failed, since the last step.
    pub fn response(&self) -> Result<Response<'_>, Error> {
        let course = match &self.last {
            None if self.path.has_begun() => return Err(Error::NoStep),
            None => None,
            Some(last) => {
                let Last { paths, acting, duration } = last;
                let segments = paths.segments(acting, *duration);
                let course = self.integrator.course(&acting.along(&segments), *duration);
                Some((course.map_err(|failed| self.failure(failed, &segments))?, last))
            }
        };
        Ok(Response { unit: self, course })
    }

    /// The motion of a tip that is free so far, to be led to `sample`; the rod is ready for it.
    fn catch(&mut self, sample: &Sample) -> Path {
        let boundary = Boundary::hanging_from(*self.path.base(), self.tunable.gravity);
        self.integrator.prepare_to_hold(&boundary, self.longest_cell);
        let Ends { position, rotation, velocity, angular_velocity, .. } = self.integrator.ends();
        let present = Sample { position, rotation, velocity, angular_velocity };
        Path::caught(given(self.start.parameters.tip_motion), &present, sample)
    }

    fn disagreement(&mut self, end: End, segment: &Segment, step_size: f64) -> Option<Warning> {
        let End { place, name, pose, twist } = end;
        let Support { velocity, angular_velocity, .. } = segment.start();
        let length = self.integrator.length();
        let far = segment.distance > DISAGREEMENT * length + 0.5 * step_size * velocity.norm();
        let turned = segment.angle > DISAGREEMENT + 0.5 * step_size * angular_velocity.norm();
        if self.warned[place] || !(far || turned) {
            return None;
        }
        self.warned[place] = true;
        let (k, distance, unit) = if far { (0, segment.distance, "m") } else { (1, segment.angle, "rad") };
        Some(Warning::PoseAndTwistDisagree { end: name, names: [pose[k], twist[k]], distance, unit })
    }

    /// Sets what may change, from the next step on.
    ///
    /// # Errors
    /// [`Error::NotAllowed`] names the first parameter, and [`Error::NoStart`] tells that there are no accelerations with
    /// such damping; nothing has changed.
    pub fn tune(&mut self, tunable: &Tunable) -> Result<(), Error> {
        let before = self.tunable;
        if *tunable == before {
            return Ok(());
        }
        allow(tunable.numbers())?;
        if *tunable != (Tunable { gravity: tunable.gravity, tip_mode: tunable.tip_mode, ..before }) {
            self.last = None;
            let rod = tunable.damped(self.start.parameters.rod());
            self.integrator.damp(&rod).map_err(Error::NoStart)?;
        }
        self.tunable = *tunable;
        Ok(())
    }

    /// The outputs at the present communication point.
    pub fn outputs(&self) -> &Outputs {
        &self.outputs
    }

    /// The derivatives of the outputs by time, in their places: exact where they are known from other outputs, else the
    /// differences over the last communication step, right in its middle. Whatever counts is left out.
    ///
    /// # Errors
    /// [`Error::NoStepYet`] before the first step.
    pub fn rates(&self) -> Result<Outputs, Error> {
        let (before, lasted) = &self.before;
        if *lasted == 0.0 {
            return Err(Error::NoStepYet);
        }
        let now = &self.outputs;
        let mut rates = now.differences(before, *lasted);
        rates.tip_position = now.tip_velocity;
        let (w, q) = (now.tip_angular_velocity, now.tip_orientation);
        let v = q.fixed_rows::<3>(1).into_owned();
        let turned = (w * q[0] + w.cross(&v)) * 0.5;
        rates.tip_orientation = Vector4::new(-0.5 * w.dot(&v), turned.x, turned.y, turned.z);
        for (rate, part) in rates.stations.iter_mut().zip(&self.start.parameters.stations) {
            match *part {
                0.0 => *rate = self.path.base().velocity,
                1.0 => *rate = now.tip_velocity,
                _ => {}
            }
        }
        (rates.energy.work_base, rates.energy.work_tip) = (now.power_base, now.power_tip);
        Ok(rates)
    }

    /// The rod itself, in space.
    pub fn stepper(&mut self) -> &Stepper {
        self.integrator.in_space()
    }

    /// The `count` lowest modes of small vibration about the present state, which is to be an equilibrium.
    ///
    /// # Errors
    /// [`Error::NoEquilibrium`] if its stiffness is singular.
    pub fn modes(&mut self, count: usize) -> Result<Vec<Mode>, Error> {
        let tip = if self.driven { *self.tip_path.base() } else { Support::free() };
        let boundary = Boundary { tip, ..Boundary::hanging_from(*self.path.base(), self.tunable.gravity) };
        modes::modes(self.integrator.in_space(), &boundary, count).map_err(Error::NoEquilibrium)
    }

    fn read_out(&mut self, end: &Boundary) {
        self.outputs.read(&mut self.integrator, end, &self.start.parameters);
    }
}

impl Acting {
    /// Inputs that stay as they are.
    fn held(inputs: &Inputs, tunable: Tunable) -> Self {
        Self { inputs: inputs.clone(), derivatives: Derivatives::default(), tunable }
    }

    /// The same as functions of the time since the beginning of the step, on ends that follow these segments.
    fn along<'a>(&'a self, Segments { base, tip }: &'a Segments) -> impl Fn(f64) -> Drive + 'a {
        let Self { inputs, derivatives, tunable } = self;
        let force = (inputs.tip_force, derivatives.of(|inputs| inputs.tip_force));
        let moment = (inputs.tip_moment, derivatives.of(|inputs| inputs.tip_moment));
        move |time| {
            let (jerk, angular_acceleration) = base.rates(time);
            let ([tip_force, force_t], [tip_moment, moment_t]) = (at(&force, time), at(&moment, time));
            Drive {
                boundary: Boundary {
                    tip: tip.as_ref().map_or(Support::free(), |tip| tip.at(time)),
                    tip_force,
                    tip_moment,
                    ..Boundary::hanging_from(base.at(time), tunable.gravity)
                },
                rates: Rates { jerk, angular_acceleration, tip_force: force_t, tip_moment: moment_t },
            }
        }
    }

    /// The same at the beginning of these paths.
    fn at(&self, Paths { base, tip }: &Paths) -> Boundary {
        Boundary {
            tip: tip.as_ref().map_or(Support::free(), |tip| *tip.base()),
            tip_force: self.inputs.tip_force,
            tip_moment: self.inputs.tip_moment,
            ..Boundary::hanging_from(*base.base(), self.tunable.gravity)
        }
    }
}

// of a unit that was started alike
archived!(Unit { integrator, tunable, path, tip_path, driven, warned, outputs, before } but {
    start, step, steps_equally, longest_cell, quasi_static, last
});

/// A unit is loaded into the one that is there if that was started alike, else into one that is made for it. It goes on bit
/// for bit as the one that was saved.
impl Archived for Option<Box<Unit>> {
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
        let mut is_some = self.is_some();
        is_some.visit(archive)?;
        if !is_some {
            *self = None;
            return Ok(());
        }
        let mut start = self.as_ref().map(|unit| unit.start.clone()).unwrap_or_default();
        start.visit(archive)?;
        let alike = |unit: &mut Box<Unit>| archive::are_same(&mut unit.start, &mut start);
        if archive.is_loading() && !self.as_mut().is_some_and(alike) {
            let room = Unit::of(start, Parameters::room);
            let (unit, _) = room.map_err(|error| Corrupt::Refused { why: error.to_string() })?;
            *self = Some(Box::new(unit));
        }
        let Some(unit) = self.as_deref_mut() else { return Ok(()) };
        unit.visit(archive)?;
        if archive.is_loading() {
            unit.last = None;
            unit.integrator.take_damping(&unit.tunable.damped(unit.start.parameters.rod()));
        }
        Ok(())
    }
}
