//! The model without FMI: parameters and inputs in, one rod advanced by communication steps, outputs out.
//!
//! Between two communication points the base, and a driven tip, follow a path through what the host samples ([`crate::path`]) and the
//! rod is moved to the tolerance ([`crate::integrator`]). What the host may set is checked here, and errors name it.

use crate::alpha::Scheme;
use crate::archive::{self, Archive, Archived, Corrupt, archived};
use crate::boundary::{Boundary, Drive, Rates, Support};
use crate::energy::Energy;
use crate::integrator::{Course, Effort, Ends, Failed, Integrator, Way};
use crate::mesh::{MAX_STAGES, Mesh};
use crate::modes::{self, Mode};
use crate::path::{Given, Onward, Path, Sample, Segment};
use crate::pose::State;
use crate::refine::Refiner;
use crate::rest::RestShape;
use crate::rod::Rod;
use crate::so3;
use crate::span;
use crate::stepper::{Diverged, Stepper};
use nalgebra::{Matrix3, SVector, Vector3, Vector4};
use std::f64::consts::PI;
use std::fmt;

/// Number of stations of the centreline handed out for drawing, base and tip included.
pub const STATIONS: usize = 11;

/// What is fixed before the run starts; every field is one parameter of the unit, in SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// Arc length of the unstressed rod, m.
    pub length: f64,
    /// Radius of the circular section, m.
    pub radius: f64,
    /// Density, kg/m³.
    pub density: f64,
    /// Young's modulus, Pa.
    pub youngs_modulus: f64,
    /// Shear modulus, Pa.
    pub shear_modulus: f64,
    /// Area of the section, m²; 0 = from the radius.
    pub section_area: f64,
    /// Second moments of area about d₁ and d₂, m⁴; 0 = from the radius.
    pub section_second_moment: [f64; 2],
    /// Torsion constant, m⁴; 0 = the sum of the second moments in use.
    pub section_torsion_constant: f64,
    /// Shear correction factor, used when `extensible`.
    pub section_shear_correction: f64,
    /// Curvature and twist of the unstressed rod, added to those of its rest shape, body frame, 1/m.
    pub rest_curvature: Vector3<f64>,
    /// Gravity, world frame, m/s².
    pub gravity: Vector3<f64>,
    /// Kelvin-Voigt time constant of bending, s.
    pub damping_bending: f64,
    /// Kelvin-Voigt time constant of twist, s.
    pub damping_twist: f64,
    /// Linear drag, force per length and velocity, N·s/m².
    pub damping_drag: f64,
    /// Mass of a body at the tip, kg.
    pub tip_mass: f64,
    /// Isotropic inertia of that body about the tip point, kg·m².
    pub tip_inertia: f64,
    /// Shear and stretch of the section on.
    pub extensible: bool,
    /// 0 pose and twist are given, 1 pose only, 2 twist only.
    pub base_motion: i32,
    /// 0 the tip is free and loaded, 1 it is driven; may change between steps.
    pub tip_mode: i32,
    /// As `base_motion`, of a driven tip.
    pub tip_motion: i32,
    /// Cells along the rod; 0 = chosen here.
    pub cells: i32,
    /// Gauss points in a cell, 1 to 4; 0 = chosen here.
    pub stages: i32,
    /// Longest internal step, of generalized-α, s; 0 = steps of order 4, chosen by their error.
    pub step: f64,
    /// Tolerance of the tip position relative to the length; 0 = from the experiment, else 1e-3.
    pub tolerance: f64,
    /// Spectral radius of the time integrator at infinite frequency, in [0, 1].
    pub spectral_radius: f64,
    /// Start from the static equilibrium instead of the rest shape.
    pub start_in_equilibrium: bool,
    /// The rod may be one in a plane, as long as nothing leaves that.
    pub planar: bool,
    /// No inertia and no damping: from one equilibrium to the next.
    pub quasi_static: bool,
    /// The effective mass is among the outputs.
    pub effective_mass: bool,
    /// What is not the same all along the unstressed rod; not to be set by the host.
    pub rest_shape: RestShape,
}

archived!(Parameters {
    length,
    radius,
    density,
    youngs_modulus,
    shear_modulus,
    section_area,
    section_second_moment,
    section_torsion_constant,
    section_shear_correction,
    rest_curvature,
    gravity,
    damping_bending,
    damping_twist,
    damping_drag,
    tip_mass,
    tip_inertia,
    extensible,
    base_motion,
    tip_mode,
    tip_motion,
    cells,
    stages,
    step,
    tolerance,
    spectral_radius,
    start_in_equilibrium,
    planar,
    quasi_static,
    effective_mass,
    rest_shape,
});

impl Default for Parameters {
    /// A soft rubber rod of 1 m.
    fn default() -> Self {
        Self {
            length: 1.0,
            radius: 0.005,
            density: 1100.0,
            youngs_modulus: 5e6,
            shear_modulus: 5e6 / 3.0,
            section_area: 0.0,
            section_second_moment: [0.0; 2],
            section_torsion_constant: 0.0,
            section_shear_correction: 0.9,
            rest_curvature: Vector3::zeros(),
            gravity: Vector3::new(0.0, 0.0, -9.81),
            damping_bending: 0.01,
            damping_twist: 0.01,
            damping_drag: 0.0,
            tip_mass: 0.0,
            tip_inertia: 0.0,
            extensible: false,
            base_motion: 0,
            tip_mode: 0,
            tip_motion: 0,
            cells: 0,
            stages: 0,
            step: 0.0,
            tolerance: 0.0,
            spectral_radius: 0.5,
            start_in_equilibrium: false,
            planar: true,
            quasi_static: false,
            effective_mass: false,
            rest_shape: RestShape::default(),
        }
    }
}

/// The parameters that may change between steps, as [`Parameters`] has them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tunable {
    /// m/s².
    pub gravity: Vector3<f64>,
    /// s.
    pub damping_bending: f64,
    /// s.
    pub damping_twist: f64,
    /// N·s/m².
    pub damping_drag: f64,
    /// 0 or 1.
    pub tip_mode: i32,
}

archived!(Tunable { gravity, damping_bending, damping_twist, damping_drag, tip_mode });

/// What the host gives at every communication point, world frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Inputs {
    /// Position of the base, m.
    pub base_position: Vector3<f64>,
    /// Orientation of the base, quaternion (w, x, y, z), body to world; normalised on use.
    pub base_orientation: Vector4<f64>,
    /// Velocity of the base point, m/s.
    pub base_velocity: Vector3<f64>,
    /// Angular velocity of the base, rad/s.
    pub base_angular_velocity: Vector3<f64>,
    /// Dead force on the tip, N.
    pub tip_force: Vector3<f64>,
    /// Dead moment on the tip, about the tip point, N·m.
    pub tip_moment: Vector3<f64>,
    /// Position of a driven tip, m.
    pub tip_position: Vector3<f64>,
    /// Orientation of a driven tip, as that of the base.
    pub tip_orientation: Vector4<f64>,
    /// Velocity of a driven tip, m/s.
    pub tip_velocity: Vector3<f64>,
    /// Angular velocity of a driven tip, rad/s.
    pub tip_angular_velocity: Vector3<f64>,
}

archived!(Inputs {
    base_position,
    base_orientation,
    base_velocity,
    base_angular_velocity,
    tip_force,
    tip_moment,
    tip_position,
    tip_orientation,
    tip_velocity,
    tip_angular_velocity,
});

impl Default for Inputs {
    /// A base at rest from which the rod leaves along +x, no loads; a driven tip half a metre away that points there as
    /// well.
    fn default() -> Self {
        Self {
            base_position: Vector3::zeros(),
            base_orientation: Vector4::new(0.5f64.sqrt(), 0.0, 0.5f64.sqrt(), 0.0),
            base_velocity: Vector3::zeros(),
            base_angular_velocity: Vector3::zeros(),
            tip_force: Vector3::zeros(),
            tip_moment: Vector3::zeros(),
            tip_position: Vector3::x() * 0.5,
            tip_orientation: Vector4::new(0.5f64.sqrt(), 0.0, 0.5f64.sqrt(), 0.0),
            tip_velocity: Vector3::zeros(),
            tip_angular_velocity: Vector3::zeros(),
        }
    }
}

/// First and second derivatives of the inputs at the beginning of a communication step, in which they are
/// x + x' t + x'' t²/2; NaN where none is given. In a vector of which any is given, the others count as zero.
#[derive(Clone, Debug)]
pub struct Derivatives {
    /// Of order 1.
    pub first: Inputs,
    /// Of order 2.
    pub second: Inputs,
}

archived!(Derivatives { first, second });

impl Default for Derivatives {
    /// None.
    fn default() -> Self {
        let (vector, quaternion) = (Vector3::repeat(f64::NAN), Vector4::repeat(f64::NAN));
        let none = Inputs {
            base_position: vector,
            base_orientation: quaternion,
            base_velocity: vector,
            base_angular_velocity: vector,
            tip_force: vector,
            tip_moment: vector,
            tip_position: vector,
            tip_orientation: quaternion,
            tip_velocity: vector,
            tip_angular_velocity: vector,
        };
        Self { first: none.clone(), second: none }
    }
}

/// A vector and its derivatives, as far as any are given.
type Going<const N: usize> = (SVector<f64, N>, [Option<SVector<f64, N>>; 2]);

impl Derivatives {
    /// Refuses what is infinite.
    ///
    /// # Errors
    /// [`Error::NotAllowed`] names the first input with such a derivative.
    pub fn validate(&self) -> Result<(), Error> {
        let infinite = |inputs: &Inputs| {
            let mut components = inputs.components().chain(inputs.tip_components());
            components.find(|(_, value)| value.is_infinite())
        };
        match infinite(&self.first).or_else(|| infinite(&self.second)) {
            Some((name, value)) => {
                let allowed = Allowed::Such("a finite derivative by time");
                Err(Error::NotAllowed { name, value, allowed })
            }
            None => Ok(()),
        }
    }

    fn of<const N: usize>(&self, vector: fn(&Inputs) -> SVector<f64, N>) -> [Option<SVector<f64, N>>; 2] {
        let given = |inputs: &Inputs| {
            let values = vector(inputs);
            let zero_for_none = |value: f64| if value.is_nan() { 0.0 } else { value };
            values.iter().any(|value| !value.is_nan()).then(|| values.map(zero_for_none))
        };
        let second = given(&self.second);
        [given(&self.first).or(second.map(|_| SVector::zeros())), second]
    }

    /// What the path of the base has to know.
    fn base_onward(&self, inputs: &Inputs) -> Onward {
        Onward {
            position: self.of(|inputs| inputs.base_position),
            rotation: so3::turning(&inputs.base_orientation, self.of(|inputs| inputs.base_orientation)),
            velocity: self.of(|inputs| inputs.base_velocity),
            angular_velocity: self.of(|inputs| inputs.base_angular_velocity),
        }
    }

    /// The same of a driven tip.
    fn tip_onward(&self, inputs: &Inputs) -> Onward {
        Onward {
            position: self.of(|inputs| inputs.tip_position),
            rotation: so3::turning(&inputs.tip_orientation, self.of(|inputs| inputs.tip_orientation)),
            velocity: self.of(|inputs| inputs.tip_velocity),
            angular_velocity: self.of(|inputs| inputs.tip_angular_velocity),
        }
    }
}

/// A vector and its rate `time` s after the beginning of the step.
fn at<const N: usize>((value, [first, second]): &Going<N>, time: f64) -> [SVector<f64, N>; 2] {
    match (first, second) {
        (Some(first), Some(second)) => [value + first * time + second * (0.5 * time * time), first + second * time],
        (Some(first), None) => [value + first * time, *first],
        (None, _) => [*value, SVector::zeros()],
    }
}

/// What the host may read at every communication point, world frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outputs {
    /// Position of the tip, m.
    pub tip_position: Vector3<f64>,
    /// Orientation of the tip, unit quaternion (w, x, y, z), body to world.
    pub tip_orientation: Vector4<f64>,
    /// Velocity of the tip point, m/s.
    pub tip_velocity: Vector3<f64>,
    /// Angular velocity of the tip, rad/s.
    pub tip_angular_velocity: Vector3<f64>,
    /// Force the rod exerts on its base, N.
    pub base_reaction_force: Vector3<f64>,
    /// Moment the rod exerts on its base, about the base point, N·m.
    pub base_reaction_moment: Vector3<f64>,
    /// Force the rod exerts on what drives its tip, N; zero where nothing does.
    pub tip_reaction_force: Vector3<f64>,
    /// Moment the rod exerts on what drives its tip, about the tip point, N·m; zero where nothing does.
    pub tip_reaction_moment: Vector3<f64>,
    /// Points of the centreline at equal arc lengths, first the base, last the tip, m.
    pub stations: [Vector3<f64>; STATIONS],
    /// Energies and works.
    pub energy: Energy,
    /// Rate of `energy.work_base`: what the base does on the rod, W.
    pub power_base: f64,
    /// Rate of `energy.work_tip`, under the load with which the last step ended, W.
    pub power_tip: f64,
    /// Acceleration of the base at the end of the step, m/s².
    pub base_acceleration: Vector3<f64>,
    /// How much of the rod the base feels at once ([`Stepper::effective_mass`]), kg; zero where it is not asked for.
    pub effective_mass: Matrix3<f64>,
    /// Cells in use.
    pub cells: i32,
    /// What it took since the start.
    pub solver: Effort,
}

archived!(Outputs {
    tip_position,
    tip_orientation,
    tip_velocity,
    tip_angular_velocity,
    base_reaction_force,
    base_reaction_moment,
    tip_reaction_force,
    tip_reaction_moment,
    stations,
    energy,
    power_base,
    power_tip,
    base_acceleration,
    effective_mass,
    cells,
    solver
});

/// What a variable may be set to, beyond being finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Allowed {
    /// Every finite value.
    Finite,
    /// Above zero.
    Positive,
    /// Zero and above.
    NonNegative,
    /// Both ends included.
    Between(f64, f64),
    /// A whole number, both ends included.
    Choice(i32, i32),
    /// What the words say.
    Such(&'static str),
}

impl Allowed {
    /// Whether `value` may be set. NaN and infinities never may.
    pub fn contains(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Self::Finite | Self::Such(_) => true,
                Self::Positive => value > 0.0,
                Self::NonNegative => value >= 0.0,
                Self::Between(low, high) => (low..=high).contains(&value),
                Self::Choice(low, high) => (f64::from(low)..=f64::from(high)).contains(&value),
            }
    }

    /// The attribute `min`; that of a positive variable is the bound it must not reach, as FMI knows only closed
    /// ranges.
    pub fn min(self) -> Option<f64> {
        match self {
            Self::Finite | Self::Such(_) => None,
            Self::Positive | Self::NonNegative => Some(0.0),
            Self::Between(low, _) => Some(low),
            Self::Choice(low, _) => Some(low.into()),
        }
    }

    /// The attribute `max`.
    pub fn max(self) -> Option<f64> {
        match self {
            Self::Finite | Self::Such(_) | Self::Positive | Self::NonNegative => None,
            Self::Between(_, high) => Some(high),
            Self::Choice(_, high) => Some(high.into()),
        }
    }
}

impl fmt::Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Finite => write!(f, "finite"),
            Self::Positive => write!(f, "finite and > 0"),
            Self::NonNegative => write!(f, "finite and >= 0"),
            Self::Between(low, high) => write!(f, "from {low} to {high}"),
            Self::Such(words) => write!(f, "{words}"),
            Self::Choice(low, high) => write!(f, "a whole number from {low} to {high}"),
        }
    }
}

/// Why the unit refused; names are those of the unit's variables.
#[derive(Clone, Debug, PartialEq)]
pub enum Error {
    /// A parameter or input has a value that is not allowed.
    NotAllowed {
        /// Name of the variable.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: Allowed,
    },
    /// The rod has no static equilibrium that can be reached from its rest shape.
    NoEquilibrium(Diverged),
    /// The static equilibrium it would start from is unstable.
    UnstableEquilibrium {
        /// The lowest ω², 1/s².
        omega_squared: f64,
    },
    /// No equilibrium with the tip where it is to be driven from can be reached.
    NotHeld(Diverged),
    /// The only equilibria between the two ends that were found are unstable.
    HeldUnstably {
        /// The lowest ω², 1/s².
        omega_squared: f64,
    },
    /// The ends are to be further apart than a rod reaches that does not stretch, or nearly so.
    OutOfReach {
        /// Between the ends, m.
        distance: f64,
        /// Of the rod, m.
        length: f64,
    },
    /// The equations of motion at the start are singular.
    NoStart(Diverged),
    /// There is no step that the outputs could be differentiated in.
    NoStep,
    /// The outputs have no derivatives by time before the first step.
    NoStepYet,
    /// No equilibrium follows the last one: a rod that buckles or snaps is not at rest in between.
    NoEquilibriumNearby {
        /// Time since the start of the communication step, s.
        time: f64,
        /// How the way to the next one ended.
        cause: Diverged,
    },
    /// An internal step diverged however small it was made.
    Diverged {
        /// Time since the start of the communication step, s.
        time: f64,
        /// The smallest internal step tried, s.
        step: f64,
        /// How it ended.
        cause: Diverged,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAllowed { name, value, allowed } => write!(f, "{name} = {value} is not allowed: {allowed}"),
            Self::NoEquilibrium(cause) => {
                write!(f, "start_in_equilibrium: no static equilibrium can be reached from the rest shape ({cause})")
            }
            Self::UnstableEquilibrium { omega_squared } => write!(
                f,
                "start_in_equilibrium: the static equilibrium is unstable (lowest squared frequency {omega_squared:.3e} 1/s2)"
            ),
            Self::NotHeld(cause) => {
                write!(
                    f,
                    "tip.mode = 1: no static equilibrium between the ends can be reached from the rest shape ({cause})"
                )
            }
            Self::HeldUnstably { omega_squared } => write!(
                f,
                "tip.mode = 1: the static equilibria between the ends that were found are unstable (lowest squared frequency \
                 {omega_squared:.3e} 1/s2)"
            ),
            Self::OutOfReach { distance, length } => write!(
                f,
                "the driven tip is {distance:.6} m from the base, too far for a rod with length = {length} m that does not \
                 stretch: bring tip.driven_position nearer to base.position, or set extensible = true"
            ),
            Self::NoStart(cause) => write!(f, "the equations of motion at the start have no solution ({cause})"),
            Self::NoStep => write!(
                f,
                "there is no step to differentiate in: a state was set, or a step has failed, since the last one"
            ),
            Self::NoStepYet => write!(f, "there was no step yet, over which outputs could have changed"),
            Self::NoEquilibriumNearby { time, cause } => write!(
                f,
                "quasi_static: no static equilibrium follows the one at {time:.6} s after the communication point, as \
                 when a rod buckles or snaps ({cause})"
            ),
            Self::Diverged { time, step, cause } => {
                write!(
                    f,
                    "the internal step of {step:.1e} s at {time:.6} s after the communication point failed: {cause}"
                )
            }
        }
    }
}

impl std::error::Error for Error {}

/// Something the host should know although the step succeeded; each kind is given once in a run.
#[derive(Clone, Debug, PartialEq)]
pub enum Warning {
    /// Pose and twist of the base, or of a driven tip, do not belong to one motion.
    PoseAndTwistDisagree {
        /// Which end.
        end: &'static str,
        /// Names of the two variables.
        names: [&'static str; 2],
        /// How far apart they have run.
        distance: f64,
        /// m or rad.
        unit: &'static str,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PoseAndTwistDisagree { end, names: [pose, twist], distance, unit } => write!(
                f,
                "{pose} and the motion that {twist} describes are {distance:.3e} {unit} apart; the {end} follows {twist} and \
                 is led back slowly ({end}.motion = 1 takes the pose alone, 2 the twist alone)"
            ),
        }
    }
}

/// Distance of the sampled pose from the path, as a part of the rod's length or in rad, beyond which pose and twist
/// disagree; half a communication step's motion is allowed on top, since the first steps do not know the acceleration.
const DISAGREEMENT: f64 = 0.02;

/// Distance of the ends over the length from which on a rod that does not stretch and cannot be moved is taken for taut.
const TAUT: f64 = 0.98;

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

/// The outputs as functions of what acts, in the last communication step as it was gone through or, before the first, at
/// the start: number, order and length of the internal steps and cells are settled.
#[derive(Clone, Debug)]
pub struct Response<'a> {
    unit: &'a Unit,
    /// Of a step; there is none of a start.
    course: Option<(Course, &'a Last)>,
}

/// Name and value of a parameter, and what it may be.
type Number = (&'static str, f64, Allowed);

fn allow(mut numbers: impl Iterator<Item = Number>) -> Result<(), Error> {
    match numbers.find(|(_, value, allowed)| !allowed.contains(*value)) {
        Some((name, value, allowed)) => Err(Error::NotAllowed { name, value, allowed }),
        None => Ok(()),
    }
}

impl Tunable {
    fn numbers(&self) -> impl Iterator<Item = Number> + use<> {
        use Allowed::{Choice, Finite, NonNegative};
        let g = self.gravity;
        let numbers = [
            ("gravity[1]", g.x, Finite),
            ("gravity[2]", g.y, Finite),
            ("gravity[3]", g.z, Finite),
            ("damping.bending", self.damping_bending, NonNegative),
            ("damping.twist", self.damping_twist, NonNegative),
            ("damping.drag", self.damping_drag, NonNegative),
            ("tip.mode", f64::from(self.tip_mode), Choice(0, 1)),
        ];
        numbers.into_iter()
    }

    /// The rod with this damping.
    fn damped(&self, rod: Rod) -> Rod {
        let damping = Vector3::new(self.damping_bending, self.damping_bending, self.damping_twist);
        Rod { damping, drag: self.damping_drag, ..rod }
    }
}

impl Parameters {
    /// Whether the effective mass is wanted, and there is inertia.
    fn wants_masses(&self) -> bool {
        self.effective_mass && !self.quasi_static
    }

    /// Those that may change between steps.
    pub fn tunable(&self) -> Tunable {
        let Self { gravity, damping_bending, damping_twist, damping_drag, tip_mode, .. } = *self;
        Tunable { gravity, damping_bending, damping_twist, damping_drag, tip_mode }
    }

    /// The same with others that may change.
    pub fn tuned(&self, tunable: &Tunable) -> Self {
        let Tunable { gravity, damping_bending, damping_twist, damping_drag, tip_mode } = *tunable;
        Self { gravity, damping_bending, damping_twist, damping_drag, tip_mode, ..self.clone() }
    }

    /// The section's numbers as the library takes them.
    pub fn rod(&self) -> Rod {
        let given = |value: f64, otherwise: f64| if value > 0.0 { value } else { otherwise };
        let area = given(self.section_area, PI * self.radius * self.radius);
        let round = PI * self.radius.powi(4) / 4.0;
        let [i_1, i_2] = self.section_second_moment.map(|moment| given(moment, round));
        let torsion = given(self.section_torsion_constant, i_1 + i_2);
        let (e, g, rho) = (self.youngs_modulus, self.shear_modulus, self.density);
        let shear = 1.0 / (self.section_shear_correction * g * area);
        self.tunable().damped(Rod {
            stiffness: Vector3::new(e * i_1, e * i_2, g * torsion),
            compliance: if self.extensible { Vector3::new(shear, shear, 1.0 / (e * area)) } else { Vector3::zeros() },
            mass_per_length: rho * area,
            inertia_per_length: Vector3::new(i_1, i_2, i_1 + i_2) * rho,
            damping: Vector3::zeros(),
            drag: 0.0,
            tip_mass: self.tip_mass,
            tip_inertia: self.tip_inertia,
        })
    }

    /// Every number among the parameters: its name, its value and what it may be.
    fn numbers(&self) -> impl Iterator<Item = Number> + use<> {
        use Allowed::{Between, Choice, Finite, NonNegative, Positive};
        let [i_1, i_2] = self.section_second_moment;
        let kappa = self.rest_curvature;
        let fixed = [
            ("length", self.length, Positive),
            ("radius", self.radius, Positive),
            ("density", self.density, Positive),
            ("youngs_modulus", self.youngs_modulus, Positive),
            ("shear_modulus", self.shear_modulus, Positive),
            ("section.area", self.section_area, NonNegative),
            ("section.second_moment[1]", i_1, NonNegative),
            ("section.second_moment[2]", i_2, NonNegative),
            ("section.torsion_constant", self.section_torsion_constant, NonNegative),
            ("section.shear_correction", self.section_shear_correction, Positive),
            ("rest_curvature[1]", kappa.x, Finite),
            ("rest_curvature[2]", kappa.y, Finite),
            ("rest_curvature[3]", kappa.z, Finite),
            ("tip.mass", self.tip_mass, NonNegative),
            ("tip.inertia", self.tip_inertia, NonNegative),
            ("base.motion", f64::from(self.base_motion), Choice(0, 2)),
            ("tip.motion", f64::from(self.tip_motion), Choice(0, 2)),
            ("cells", f64::from(self.cells), Choice(0, MAX_CELLS)),
            ("stages", f64::from(self.stages), Choice(0, MAX_STAGES as i32)),
            ("step", self.step, NonNegative),
            ("tolerance", self.tolerance, NonNegative),
            ("spectral_radius", self.spectral_radius, Between(0.0, 1.0)),
        ];
        fixed.into_iter().chain(self.tunable().numbers())
    }

    /// What the parameter `name` may be.
    pub fn allowed(name: &str) -> Allowed {
        let mut numbers = Self::default().numbers();
        numbers.find(|(known, ..)| *known == name).map_or(Allowed::Finite, |(_, _, allowed)| allowed)
    }

    /// Refuses what no rod can have.
    ///
    /// # Errors
    /// [`Error::NotAllowed`] names the first parameter.
    pub fn validate(&self) -> Result<(), Error> {
        allow(self.numbers())
    }

    /// The cells to begin with, and what refines them where they are not given.
    ///
    /// # Errors
    /// [`Error::NotAllowed`] if a cell would turn further than its rotation vector reaches.
    fn mesh(&self, rod: &Rod, boundary: &Boundary, tolerance: f64) -> Result<(Mesh, Option<Refiner>), Error> {
        let stages = if self.stages == 0 { MAX_STAGES } else { self.stages as usize };
        let (shape, more) = (&self.rest_shape, &self.rest_curvature);
        let turn = shape.turn(self.length, more);
        if self.cells > 0 {
            let mesh = shape.mesh(self.length, more, self.cells as usize, f64::INFINITY, stages);
            let not_allowed = |allowed| Err(Error::NotAllowed { name: "cells", value: self.cells.into(), allowed });
            if mesh.cells.len() > self.cells as usize {
                return not_allowed(Allowed::Such("0, or at least one for each piece of the rest shape"));
            }
            if mesh.cells.iter().any(|cell| cell.kappa_rest.norm() * cell.length >= MAX_CELL_TURN) {
                return not_allowed(Allowed::Such("as many that the rest curvature turns less than 3 rad in each"));
            }
            return Ok((mesh, None));
        }
        let in_cells = |cells: usize| shape.mesh(self.length, more, cells, COARSEST_TURN, stages);
        if self.extensible || self.step > 0.0 || self.quasi_static {
            let cells = self.cells_enough(rod, boundary, tolerance, ENOUGH);
            let cells = if self.tip_mode == 1 { cells.max(CELLS_BETWEEN_ENDS) } else { cells };
            return Ok((in_cells(cells.max(turn) as usize), None));
        }
        let likely = self.cells_enough(rod, boundary, tolerance, LIKELY);
        let coarsest = in_cells((AT_REST * likely).max(turn / COARSEST_TURN).ceil() as usize);
        let most = likely.max(turn).max(coarsest.cells.len() as f64);
        let refiner = Refiner::new(&coarsest, tolerance, (ROOM * most).max(LEAST_ROOM) as usize);
        // the motion to come is not seen at the start
        let cells = if self.tip_mode == 1 { self.length / self.longest_cell(rod, boundary, tolerance) } else { likely };
        Ok((refiner.start(cells as usize), Some(refiner)))
    }

    /// Equal cells that are right to `tolerance`: `part` of the lengths in which loads bend the rod, at the tolerance
    /// `reference`, and more by the power `grows` of the order below it.
    fn cells_enough(
        &self,
        rod: &Rod,
        boundary: &Boundary,
        tolerance: f64,
        Cells { part, reference, grows }: Cells,
    ) -> f64 {
        // loads bend a rod within (EI/w)^(1/3) of where it is held
        let load = rod.mass_per_length * self.gravity.norm()
            + (rod.tip_mass * self.gravity.norm() + boundary.tip_force.norm()) / self.length;
        let softest = rod.stiffness.min();
        let bends = self.length * (load / softest).cbrt();
        let wound = boundary.tip_moment.norm() * self.length / softest;
        let stages = if self.stages == 0 { MAX_STAGES } else { self.stages as usize };
        let order = 2.0 * stages as f64;
        let few = 2.0 * (1e-3 / tolerance).powf(1.0 / order);
        let cells = part * bends * (reference / tolerance).powf(grows / order);
        cells.max(wound).max(few).ceil().clamp(1.0, MAX_AUTOMATIC_CELLS)
    }

    /// The longest cell of a rod whose tip is held, m: its cells do not choose themselves.
    fn longest_cell(&self, rod: &Rod, boundary: &Boundary, tolerance: f64) -> f64 {
        self.length / self.cells_enough(rod, boundary, tolerance, ENOUGH).max(CELLS_BETWEEN_ENDS)
    }

    /// The shortest time in which gravity or stiffness move the whole rod, s.
    pub fn time(&self, rod: &Rod) -> f64 {
        let mass = rod.mass_per_length * self.length;
        let swing = (self.length / self.gravity.norm()).sqrt();
        let vibration = (mass * self.length.powi(3) / rod.stiffness.x.max(rod.stiffness.y)).sqrt();
        swing.min(vibration)
    }

    /// The longest internal step of generalized-α: as given, or a part of that time.
    fn longest_step(&self, rod: &Rod, tolerance: f64) -> f64 {
        // measured on a rope and on a wire: 1/80 of that time gives 3e-4 to 7e-4 of the length
        if self.step > 0.0 { self.step } else { self.time(rod) / 80.0 * (tolerance / 1e-3).sqrt() }
    }

    /// The rod of allowed parameters, started under `boundary`, to be moved to `tolerance` unless they say otherwise.
    ///
    /// # Errors
    /// [`Error`] names the parameter that is not allowed together with others, or says why there is no start.
    pub fn start(&self, boundary: &Boundary, tolerance: f64) -> Result<Integrator, Error> {
        let (mut stepper, mut refiner) = self.unstressed(boundary, tolerance)?;
        let mut moves = false;
        if self.tip_mode == 1 {
            moves = self.start_between_ends(&mut stepper, boundary)?;
        } else if self.start_in_equilibrium || self.quasi_static {
            let found = match &mut refiner {
                Some(refiner) => {
                    stepper.reserve(refiner.most_cells());
                    refiner.equilibrium(&mut stepper, boundary)
                }
                None => stepper.equilibrium(boundary),
            };
            found.map_err(Error::NoEquilibrium)?;
            let lowest = modes::modes(&mut stepper, boundary, 1).map_err(Error::NoEquilibrium)?;
            if let Some(mode) = lowest.iter().find(|mode| mode.omega_squared <= 0.0) {
                return Err(Error::UnstableEquilibrium { omega_squared: mode.omega_squared });
            }
        }
        let (way, scheme, step) = self.motion(&stepper.rod, tolerance);
        if way != Way::Static {
            stepper.begin(boundary, moves).map_err(Error::NoStart)?;
        }
        Ok(Integrator::new(stepper, refiner, way, scheme, step, boundary))
    }

    /// Leads the tip of the unstressed rod to where `boundary` drives it; whether the ends move other than as one body.
    fn start_between_ends(&self, stepper: &mut Stepper, boundary: &Boundary) -> Result<bool, Error> {
        let distance = (boundary.tip.position - boundary.base.position).norm();
        self.reaches(distance, 1.0)?;
        let cause = |diverged| self.reaches(distance, TAUT).err().unwrap_or(Error::NotHeld(diverged));
        let omega_squared = span::hang(stepper, boundary).map_err(cause)?;
        if omega_squared <= 0.0 {
            return Err(Error::HeldUnstably { omega_squared });
        }
        span::set_in_motion(stepper, boundary, self.time(&stepper.rod)).map_err(cause)
    }

    /// Whether the rod reaches from end to end of `distance`, m, with `part` of its length.
    fn reaches(&self, distance: f64, part: f64) -> Result<(), Error> {
        match self.extensible || distance < part * self.length {
            true => Ok(()),
            false => Err(Error::OutOfReach { distance, length: self.length }),
        }
    }

    /// The same rod where it has not been started.
    fn room(&self, boundary: &Boundary, tolerance: f64) -> Result<Integrator, Error> {
        let (stepper, refiner) = self.unstressed(boundary, tolerance)?;
        let (way, scheme, step) = self.motion(&stepper.rod, tolerance);
        Ok(Integrator::new(stepper, refiner, way, scheme, step, boundary))
    }

    fn unstressed(&self, boundary: &Boundary, tolerance: f64) -> Result<(Stepper, Option<Refiner>), Error> {
        let rod = self.rod();
        let (mesh, refiner) = self.mesh(&rod, boundary, tolerance)?;
        let state = State::at_rest_shape(&mesh, &boundary.base);
        Ok((Stepper::new(mesh, rod, state), refiner))
    }

    fn motion(&self, rod: &Rod, tolerance: f64) -> (Way, Scheme, f64) {
        let scheme = Scheme::from_spectral_radius(self.spectral_radius);
        (self.way(rod, tolerance), scheme, self.longest_step(rod, tolerance))
    }

    fn way(&self, rod: &Rod, tolerance: f64) -> Way {
        match () {
            () if self.quasi_static => Way::Static,
            () if self.step > 0.0 => Way::Equal,
            () => Way::Accurate { tolerance, time: self.time(rod), planar: self.planar },
        }
    }
}

/// A rule for the number of cells.
struct Cells {
    part: f64,
    reference: f64,
    grows: f64,
}

/// Measured on a rope of seven such lengths, five cells of four points are right to 3e-4.
const ENOUGH: Cells = Cells { part: 0.7, reference: 1e-3, grows: 1.0 };
/// Equal cells that just do for a rope and a hair, of 1e-2 to 1e-5: the motion concentrates what is bent.
const LIKELY: Cells = Cells { part: 0.3, reference: 1e-2, grows: 1.8 };
/// Fewest cells of a rod between two ends: it may turn by more than a whole turn on its way, and a cell by less than one.
const CELLS_BETWEEN_ENDS: f64 = 4.0;
/// More cells than any accuracy asks for; beyond it a slip of the host would be answered by the end of its memory.
const MAX_CELLS: i32 = 100_000;
/// Most cells chosen here.
const MAX_AUTOMATIC_CELLS: f64 = 1000.0;
/// Cells of the coarsest mesh over those: what hangs at rest needs few.
const AT_REST: f64 = 0.12;
/// Cells at most, over those that are likely to be needed.
const ROOM: f64 = 4.0;
/// The same of a rod that is likely to need few: a base that turns winds it up, whatever its load.
const LEAST_ROOM: f64 = 64.0;
/// Turn of the rest shape in a cell of the coarsest mesh, rad.
const COARSEST_TURN: f64 = 2.5;
/// Turn of the rest shape in one cell, rad: its rotation vector ends at a full turn, and half of that is left to the
/// motion.
const MAX_CELL_TURN: f64 = 3.0;

impl Inputs {
    /// Refuses what is not a number, and an orientation that is none.
    ///
    /// # Errors
    /// [`Error::NotAllowed`] names the first input.
    pub fn validate(&self) -> Result<(), Error> {
        if let Some((name, value)) = self.components().find(|(_, value)| !value.is_finite()) {
            return Err(Error::NotAllowed { name, value, allowed: Allowed::Finite });
        }
        is_orientation("base.orientation", &self.base_orientation)
    }

    /// Names and values of all its numbers but those that only a driven tip reads.
    fn components(&self) -> impl Iterator<Item = (&'static str, f64)> {
        const POSITION: [&str; 3] = ["base.position[1]", "base.position[2]", "base.position[3]"];
        const VELOCITY: [&str; 3] = ["base.velocity[1]", "base.velocity[2]", "base.velocity[3]"];
        const ANGULAR: [&str; 3] = ["base.angular_velocity[1]", "base.angular_velocity[2]", "base.angular_velocity[3]"];
        const FORCE: [&str; 3] = ["tip.force[1]", "tip.force[2]", "tip.force[3]"];
        const MOMENT: [&str; 3] = ["tip.moment[1]", "tip.moment[2]", "tip.moment[3]"];
        const ORIENTATION: [&str; 4] =
            ["base.orientation[1]", "base.orientation[2]", "base.orientation[3]", "base.orientation[4]"];
        let vectors = [
            (POSITION, &self.base_position),
            (VELOCITY, &self.base_velocity),
            (ANGULAR, &self.base_angular_velocity),
            (FORCE, &self.tip_force),
            (MOMENT, &self.tip_moment),
        ];
        let components = vectors.into_iter().flat_map(|(names, vector)| names.into_iter().zip(vector.iter().copied()));
        components.chain(ORIENTATION.into_iter().zip(self.base_orientation.iter().copied()))
    }

    /// The same for those that only a driven tip reads.
    fn validate_tip(&self) -> Result<(), Error> {
        if let Some((name, value)) = self.tip_components().find(|(_, value)| !value.is_finite()) {
            return Err(Error::NotAllowed { name, value, allowed: Allowed::Finite });
        }
        is_orientation("tip.driven_orientation", &self.tip_orientation)
    }

    fn tip_components(&self) -> impl Iterator<Item = (&'static str, f64)> {
        const NAMES: [[&str; 3]; 3] = [
            ["tip.driven_position[1]", "tip.driven_position[2]", "tip.driven_position[3]"],
            ["tip.driven_velocity[1]", "tip.driven_velocity[2]", "tip.driven_velocity[3]"],
            ["tip.driven_angular_velocity[1]", "tip.driven_angular_velocity[2]", "tip.driven_angular_velocity[3]"],
        ];
        const ORIENTATION: [&str; 4] = [
            "tip.driven_orientation[1]",
            "tip.driven_orientation[2]",
            "tip.driven_orientation[3]",
            "tip.driven_orientation[4]",
        ];
        let vectors = [&self.tip_position, &self.tip_velocity, &self.tip_angular_velocity];
        let components = NAMES.into_iter().flatten().zip(vectors.into_iter().flatten().copied());
        components.chain(ORIENTATION.into_iter().zip(self.tip_orientation.iter().copied()))
    }

    fn tip_sample(&self) -> Sample {
        Sample {
            position: self.tip_position,
            rotation: so3::from_quaternion(&self.tip_orientation.normalize()),
            velocity: self.tip_velocity,
            angular_velocity: self.tip_angular_velocity,
        }
    }

    fn sample(&self) -> Sample {
        Sample {
            position: self.base_position,
            rotation: so3::from_quaternion(&self.base_orientation.normalize()),
            velocity: self.base_velocity,
            angular_velocity: self.base_angular_velocity,
        }
    }
}

fn is_orientation(name: &'static str, quaternion: &Vector4<f64>) -> Result<(), Error> {
    let norm = quaternion.norm();
    match norm > 1e-100 && norm.is_finite() {
        true => Ok(()),
        false => Err(Error::NotAllowed {
            name,
            value: norm,
            allowed: Allowed::Such("a quaternion other than zero, normalised on use"),
        }),
    }
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
        let boundary = Acting::held(inputs, parameters.tunable()).at(&start.paths(inputs));
        let mut unit = Self::of(start, Parameters::start)?;
        unit.read_out(&boundary);
        Ok(unit)
    }

    fn of(
        start: Start,
        begin: impl Fn(&Parameters, &Boundary, f64) -> Result<Integrator, Error>,
    ) -> Result<Self, Error> {
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
        Ok(Self {
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
        })
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
        rates.stations[0] = self.path.base().velocity;
        rates.stations[STATIONS - 1] = now.tip_velocity;
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
        let masses = self.start.parameters.wants_masses();
        self.outputs.read(&mut self.integrator, end, masses);
    }
}

impl Outputs {
    /// What has changed since `before`, per s.
    fn differences(&self, before: &Self, time: f64) -> Self {
        let vector = |of: fn(&Self) -> Vector3<f64>| (of(self) - of(before)) / time;
        let number = |of: fn(&Self) -> f64| (of(self) - of(before)) / time;
        Self {
            tip_position: vector(|o| o.tip_position),
            tip_orientation: (self.tip_orientation - before.tip_orientation) / time,
            tip_velocity: vector(|o| o.tip_velocity),
            tip_angular_velocity: vector(|o| o.tip_angular_velocity),
            base_reaction_force: vector(|o| o.base_reaction_force),
            base_reaction_moment: vector(|o| o.base_reaction_moment),
            tip_reaction_force: vector(|o| o.tip_reaction_force),
            tip_reaction_moment: vector(|o| o.tip_reaction_moment),
            stations: std::array::from_fn(|i| (self.stations[i] - before.stations[i]) / time),
            energy: Energy {
                kinetic: number(|o| o.energy.kinetic),
                elastic: number(|o| o.energy.elastic),
                gravity: number(|o| o.energy.gravity),
                dissipated: number(|o| o.energy.dissipated),
                work_base: number(|o| o.energy.work_base),
                work_tip: number(|o| o.energy.work_tip),
            },
            power_base: number(|o| o.power_base),
            power_tip: number(|o| o.power_tip),
            base_acceleration: vector(|o| o.base_acceleration),
            effective_mass: (self.effective_mass - before.effective_mass) / time,
            cells: 0,
            solver: Effort::default(),
        }
    }

    /// What is to be read of a rod on which this acts at the `end` of a step; its effective mass if `masses` are wanted.
    fn read(&mut self, integrator: &mut Integrator, end: &Boundary, masses: bool) {
        let base = &end.base;
        let Ends { position, rotation, velocity, angular_velocity, force, moment, tip_force, tip_moment } =
            integrator.ends();
        *self = Self {
            tip_position: position,
            tip_orientation: so3::quaternion(&rotation),
            tip_velocity: velocity,
            tip_angular_velocity: angular_velocity,
            base_reaction_force: force,
            base_reaction_moment: moment,
            tip_reaction_force: tip_force,
            tip_reaction_moment: tip_moment,
            energy: *integrator.energy(),
            power_base: -force.dot(&base.velocity) - moment.dot(&base.angular_velocity),
            power_tip: (end.tip_force - tip_force).dot(&velocity)
                + (end.tip_moment - tip_moment).dot(&angular_velocity),
            base_acceleration: base.acceleration,
            cells: integrator.cells() as i32,
            solver: *integrator.effort(),
            ..*self
        };
        integrator.centreline(&mut self.stations);
        if masses {
            // a rod that has moved has accelerations
            self.effective_mass = integrator.in_space().effective_mass().unwrap_or_default();
        }
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

impl Response<'_> {
    /// What acted.
    pub fn acting(&self) -> Acting {
        match &self.course {
            Some((_, last)) => last.acting.clone(),
            None => Acting::held(&self.unit.start.inputs, self.unit.start.parameters.tunable()),
        }
    }

    /// Whether it would be all in a plane, had this acted.
    pub fn stays_in_plane(&self, acting: &Acting) -> bool {
        self.course.as_ref().is_some_and(|(course, Last { paths, duration, .. })| {
            course.stays_in_plane(&acting.along(&paths.segments(acting, *duration)))
        })
    }

    /// The outputs, had this acted, in a plane only if it [would be](Self::stays_in_plane). What counts the work done is as
    /// it was.
    ///
    /// # Errors
    /// [`Error`] as of [`Unit::new`] and [`Unit::advance`].
    pub fn to(&self, acting: &Acting, in_plane: bool) -> Result<Outputs, Error> {
        let Unit { start, outputs, .. } = self.unit;
        let damping = acting.tunable.damped(start.parameters.rod());
        let (mut rod, end) = match &self.course {
            Some((course, Last { paths, duration, acting: held })) => {
                let segments = paths.segments(acting, *duration);
                let other = (acting.tunable != held.tunable).then_some(&damping);
                let rod = course.under(&acting.along(&segments), other, in_plane);
                let rod = rod.map_err(|failed| self.unit.failure(failed, &segments))?;
                (rod, acting.along(&segments)(*duration).boundary)
            }
            None => {
                let boundary = acting.at(&start.paths(&acting.inputs));
                let Parameters { start_in_equilibrium, quasi_static, .. } = start.parameters;
                let mut begin = self.unit.integrator.clone();
                begin.take_damping(&damping);
                let time = start.parameters.time(&damping);
                let rod = begin.restarted(&boundary, start_in_equilibrium || quasi_static, time);
                (rod.map_err(Error::NoStart)?, boundary)
            }
        };
        let mut outputs = outputs.clone();
        let Outputs { solver, cells, .. } = outputs;
        outputs.read(&mut rod, &end, start.parameters.wants_masses());
        Ok(Outputs { solver, cells, ..outputs })
    }

    /// Of the rod.
    pub fn parameters(&self) -> &Parameters {
        &self.unit.start.parameters
    }

    /// Length of the communication step, s; none at the start.
    pub fn duration(&self) -> Option<f64> {
        self.course.as_ref().map(|(_, last)| last.duration)
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
            *self = Some(Box::new(room.map_err(|error| Corrupt::Refused { why: error.to_string() })?));
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
