//! The model without FMI: parameters and inputs in, one rod advanced by communication steps, outputs out.
//!
//! Between two communication points the base follows a path through what the host samples ([`crate::path`]) and the
//! rod is moved to the tolerance ([`crate::integrator`]). What the host may set is checked here, and errors name it.

use crate::alpha::Scheme;
use crate::archive::{self, Archive, Archived, Corrupt, archived};
use crate::boundary::{Boundary, Drive, Rates};
use crate::energy::Energy;
use crate::integrator::{Effort, Ends, Failed, Integrator, Way};
use crate::mesh::{MAX_STAGES, Mesh};
use crate::modes::{self, Mode};
use crate::path::{Given, Onward, Path, Sample, Segment};
use crate::pose::State;
use crate::refine::Refiner;
use crate::rod::Rod;
use crate::so3;
use crate::stepper::{Diverged, Stepper};
use nalgebra::{SVector, Vector3, Vector4};
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
    /// Curvature and twist of the unstressed rod, body frame, 1/m.
    pub rest_curvature: Vector3<f64>,
    /// Gravity, world frame, m/s²; may change between steps.
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
    cells,
    stages,
    step,
    tolerance,
    spectral_radius,
    start_in_equilibrium,
    planar,
    quasi_static,
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
            cells: 0,
            stages: 0,
            step: 0.0,
            tolerance: 0.0,
            spectral_radius: 0.5,
            start_in_equilibrium: false,
            planar: true,
            quasi_static: false,
        }
    }
}

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
}

archived!(Inputs { base_position, base_orientation, base_velocity, base_angular_velocity, tip_force, tip_moment });

impl Default for Inputs {
    /// A base at rest from which the rod leaves along +x, no loads.
    fn default() -> Self {
        Self {
            base_position: Vector3::zeros(),
            base_orientation: Vector4::new(0.5f64.sqrt(), 0.0, 0.5f64.sqrt(), 0.0),
            base_velocity: Vector3::zeros(),
            base_angular_velocity: Vector3::zeros(),
            tip_force: Vector3::zeros(),
            tip_moment: Vector3::zeros(),
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
        };
        Self { first: none.clone(), second: none }
    }
}

/// A vector and its derivatives, as far as any are given.
type Course<const N: usize> = (SVector<f64, N>, [Option<SVector<f64, N>>; 2]);

impl Derivatives {
    /// Refuses what is infinite.
    ///
    /// # Errors
    /// [`Error::NotAllowed`] names the first input with such a derivative.
    pub fn validate(&self) -> Result<(), Error> {
        match self.first.components().chain(self.second.components()).find(|(_, value)| value.is_infinite()) {
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
    fn onward(&self, inputs: &Inputs) -> Onward {
        Onward {
            position: self.of(|inputs| inputs.base_position),
            rotation: so3::turning(&inputs.base_orientation, self.of(|inputs| inputs.base_orientation)),
            velocity: self.of(|inputs| inputs.base_velocity),
            angular_velocity: self.of(|inputs| inputs.base_angular_velocity),
        }
    }
}

/// A vector and its rate `time` s after the beginning of the step.
fn at<const N: usize>((value, [first, second]): &Course<N>, time: f64) -> [SVector<f64, N>; 2] {
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
    /// Points of the centreline at equal arc lengths, first the base, last the tip, m.
    pub stations: [Vector3<f64>; STATIONS],
    /// Energies and works.
    pub energy: Energy,
    /// Rate of `energy.work_base`: what the base does on the rod, W.
    pub power_base: f64,
    /// Rate of `energy.work_tip`, under the load with which the last step ended, W.
    pub power_tip: f64,
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
    stations,
    energy,
    power_base,
    power_tip,
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
    /// The equations of motion at the start are singular.
    NoStart(Diverged),
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
            Self::NoStart(cause) => write!(f, "the equations of motion at the start have no solution ({cause})"),
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
    /// Pose and twist of the base do not belong to one motion.
    PoseAndTwistDisagree {
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
            Self::PoseAndTwistDisagree { names: [pose, twist], distance, unit } => write!(
                f,
                "{pose} and the motion that {twist} describes are {distance:.3e} {unit} apart; the base follows {twist} and \
                 is led back slowly (base.motion = 1 takes the pose alone, 2 the twist alone)"
            ),
        }
    }
}

/// Distance of the sampled pose from the path, as a part of the rod's length or in rad, beyond which pose and twist
/// disagree; half a communication step's motion is allowed on top, since the first steps do not know the acceleration.
const DISAGREEMENT: f64 = 0.02;

/// Internal steps in a communication step beyond which the host has asked for something else than it wants.
const MAX_INTERNAL_STEPS: f64 = 1e7;

/// What a rod was started from: it settles all that is fixed, and how much room there is.
#[derive(Clone, Debug, Default)]
struct Start {
    parameters: Parameters,
    inputs: Inputs,
    /// Of the experiment.
    tolerance: Option<f64>,
}

archived!(Start { parameters, inputs, tolerance });

/// One rod, started and ready to step.
#[derive(Clone, Debug)]
pub struct Unit {
    start: Start,
    integrator: Integrator,
    /// Longest internal step, where the host gives it, s.
    step: Option<f64>,
    quasi_static: bool,
    gravity: Vector3<f64>,
    path: Path,
    warned: bool,
    /// What acts at the end of the last step.
    drive: Drive,
    outputs: Outputs,
}

impl Parameters {
    /// The section's numbers as the library takes them.
    pub fn rod(&self) -> Rod {
        let given = |value: f64, otherwise: f64| if value > 0.0 { value } else { otherwise };
        let area = given(self.section_area, PI * self.radius * self.radius);
        let round = PI * self.radius.powi(4) / 4.0;
        let [i_1, i_2] = self.section_second_moment.map(|moment| given(moment, round));
        let torsion = given(self.section_torsion_constant, i_1 + i_2);
        let (e, g, rho) = (self.youngs_modulus, self.shear_modulus, self.density);
        let shear = 1.0 / (self.section_shear_correction * g * area);
        Rod {
            stiffness: Vector3::new(e * i_1, e * i_2, g * torsion),
            compliance: if self.extensible { Vector3::new(shear, shear, 1.0 / (e * area)) } else { Vector3::zeros() },
            mass_per_length: rho * area,
            inertia_per_length: Vector3::new(i_1, i_2, i_1 + i_2) * rho,
            damping: Vector3::new(self.damping_bending, self.damping_bending, self.damping_twist),
            drag: self.damping_drag,
            tip_mass: self.tip_mass,
            tip_inertia: self.tip_inertia,
        }
    }

    /// Every number among the parameters: its name, its value and what it may be.
    fn numbers(&self) -> [(&'static str, f64, Allowed); 27] {
        use Allowed::{Between, Choice, Finite, NonNegative, Positive};
        let [i_1, i_2] = self.section_second_moment;
        let (kappa, g) = (self.rest_curvature, self.gravity);
        [
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
            ("gravity[1]", g.x, Finite),
            ("gravity[2]", g.y, Finite),
            ("gravity[3]", g.z, Finite),
            ("damping.bending", self.damping_bending, NonNegative),
            ("damping.twist", self.damping_twist, NonNegative),
            ("damping.drag", self.damping_drag, NonNegative),
            ("tip.mass", self.tip_mass, NonNegative),
            ("tip.inertia", self.tip_inertia, NonNegative),
            ("base.motion", f64::from(self.base_motion), Choice(0, 2)),
            ("cells", f64::from(self.cells), Choice(0, MAX_CELLS)),
            ("stages", f64::from(self.stages), Choice(0, MAX_STAGES as i32)),
            ("step", self.step, NonNegative),
            ("tolerance", self.tolerance, NonNegative),
            ("spectral_radius", self.spectral_radius, Between(0.0, 1.0)),
        ]
    }

    /// What the parameter `name` may be.
    pub fn allowed(name: &str) -> Allowed {
        let numbers = Self::default().numbers();
        numbers.iter().find(|(known, ..)| *known == name).map_or(Allowed::Finite, |(_, _, allowed)| *allowed)
    }

    /// Refuses what no rod can have.
    ///
    /// # Errors
    /// [`Error::NotAllowed`] names the first parameter.
    pub fn validate(&self) -> Result<(), Error> {
        match self.numbers().into_iter().find(|(_, value, allowed)| !allowed.contains(*value)) {
            Some((name, value, allowed)) => Err(Error::NotAllowed { name, value, allowed }),
            None => Ok(()),
        }
    }

    /// The cells to begin with, and what refines them where they are not given.
    ///
    /// # Errors
    /// [`Error::NotAllowed`] if a cell would turn further than its rotation vector reaches.
    fn mesh(&self, rod: &Rod, boundary: &Boundary, tolerance: f64) -> Result<(Mesh, Option<Refiner>), Error> {
        let stages = if self.stages == 0 { MAX_STAGES } else { self.stages as usize };
        let turn = self.rest_curvature.norm() * self.length;
        let uniform = |cells: usize| Mesh::uniform(self.length, cells, stages, self.rest_curvature);
        if self.cells > 0 {
            if turn >= MAX_CELL_TURN * f64::from(self.cells) {
                let allowed = Allowed::Such("as many that the rest curvature turns less than 3 rad in each");
                return Err(Error::NotAllowed { name: "cells", value: self.cells.into(), allowed });
            }
            return Ok((uniform(self.cells as usize), None));
        }
        // loads bend a rod within (EI/w)^(1/3) of where it is held
        let load = rod.mass_per_length * self.gravity.norm()
            + (rod.tip_mass * self.gravity.norm() + boundary.tip_force.norm()) / self.length;
        let softest = rod.stiffness.min();
        let bends = self.length * (load / softest).cbrt();
        let wound = boundary.tip_moment.norm() * self.length / softest;
        let order = 2.0 * stages as f64;
        let at_least = |cells: f64| {
            let few = 2.0 * (1e-3 / tolerance).powf(1.0 / order);
            cells.max(wound).max(few).ceil().clamp(1.0, MAX_AUTOMATIC_CELLS)
        };
        if self.extensible || self.step > 0.0 || self.quasi_static {
            // measured on a rope of seven such lengths, five cells of four points are right to 3e-4
            let cells = at_least(0.7 * bends * (1e-3 / tolerance).powf(1.0 / order));
            return Ok((uniform(cells.max(turn) as usize), None));
        }
        // equal cells that just do for a rope and a hair, of 1e-2 to 1e-5: the motion concentrates what is bent
        let likely = at_least(0.3 * bends * (1e-2 / tolerance).powf(1.8 / order));
        let coarsest = uniform((AT_REST * likely).max(turn / COARSEST_TURN).ceil() as usize);
        let refiner = Refiner::new(&coarsest, tolerance, (ROOM * likely.max(turn)).max(LEAST_ROOM) as usize);
        // the motion to come is not seen at the start
        Ok((refiner.start(likely as usize), Some(refiner)))
    }

    /// The shortest time in which gravity or stiffness move the whole rod, s.
    fn time(&self, rod: &Rod) -> f64 {
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
        if self.start_in_equilibrium || self.quasi_static {
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
            stepper.start(boundary).map_err(Error::NoStart)?;
        }
        Ok(Integrator::new(stepper, refiner, way, scheme, step, boundary))
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
        let norm = self.base_orientation.norm();
        if !(norm > 1e-100 && norm.is_finite()) {
            return Err(Error::NotAllowed {
                name: "base.orientation",
                value: norm,
                allowed: Allowed::Such("a quaternion other than zero, normalised on use"),
            });
        }
        Ok(())
    }

    /// Names and values of all its numbers.
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

    fn sample(&self) -> Sample {
        Sample {
            position: self.base_position,
            rotation: so3::from_quaternion(&self.base_orientation.normalize()),
            velocity: self.base_velocity,
            angular_velocity: self.base_angular_velocity,
        }
    }
}

impl Unit {
    /// Starts a rod. `tolerance` is that of the experiment, if the host gave one.
    ///
    /// # Errors
    /// [`Error`] names the parameter or input that is not allowed, or says why there is no start.
    pub fn new(parameters: &Parameters, inputs: &Inputs, tolerance: Option<f64>) -> Result<Self, Error> {
        let start = Start { parameters: parameters.clone(), inputs: inputs.clone(), tolerance };
        let mut unit = Self::of(start, Parameters::start)?;
        unit.read_out();
        Ok(unit)
    }

    fn of(
        start: Start,
        begin: impl Fn(&Parameters, &Boundary, f64) -> Result<Integrator, Error>,
    ) -> Result<Self, Error> {
        let Start { parameters, inputs, tolerance } = &start;
        parameters.validate()?;
        inputs.validate()?;
        let given = |value: &f64| value.is_finite() && *value > 0.0;
        let tolerance = Some(parameters.tolerance).filter(given).or(tolerance.filter(given)).unwrap_or(1e-3);
        let path = Path::new(
            match parameters.base_motion {
                0 => Given::PoseAndTwist,
                1 => Given::Pose,
                _ => Given::Twist,
            },
            inputs.sample(),
        );
        let boundary = Boundary {
            tip_force: inputs.tip_force,
            tip_moment: inputs.tip_moment,
            ..Boundary::hanging_from(*path.base(), parameters.gravity)
        };
        Ok(Self {
            integrator: begin(parameters, &boundary, tolerance)?,
            step: (parameters.step > 0.0 || parameters.extensible)
                .then(|| parameters.longest_step(&parameters.rod(), tolerance)),
            quasi_static: parameters.quasi_static,
            gravity: parameters.gravity,
            path,
            warned: false,
            drive: Drive { boundary, rates: Rates::default() },
            outputs: Outputs::default(),
            start,
        })
    }

    /// Advances by one communication step of `step_size` s, from the inputs at its start.
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
        if let Some(step) = self.step.filter(|step| step_size / step > MAX_INTERNAL_STEPS) {
            let allowed = Allowed::Such("0 (automatic), or at least a ten-millionth of the communication step");
            return Err(Error::NotAllowed { name: "step", value: step, allowed });
        }
        let segment = self.path.segment(&inputs.sample(), &derivatives.onward(inputs), step_size);
        let gravity = self.gravity;
        let force = (inputs.tip_force, derivatives.of(|inputs| inputs.tip_force));
        let moment = (inputs.tip_moment, derivatives.of(|inputs| inputs.tip_moment));
        let drive = |time: f64| {
            let (jerk, angular_acceleration) = segment.rates(time);
            let ([tip_force, force_t], [tip_moment, moment_t]) = (at(&force, time), at(&moment, time));
            Drive {
                boundary: Boundary { tip_force, tip_moment, ..Boundary::hanging_from(segment.at(time), gravity) },
                rates: Rates { jerk, angular_acceleration, tip_force: force_t, tip_moment: moment_t },
            }
        };
        let done = self.integrator.advance(&drive, step_size);
        done.map_err(|Failed { time, step, cause }| match self.quasi_static {
            true => Error::NoEquilibriumNearby { time, cause },
            false => Error::Diverged { time, step, cause },
        })?;
        let warning = self.disagreement(&segment, step_size);
        self.drive = drive(step_size);
        self.path = segment.into_path();
        self.read_out();
        Ok(warning)
    }

    fn disagreement(&mut self, segment: &Segment, step_size: f64) -> Option<Warning> {
        let base = self.path.base();
        let length = self.integrator.length();
        let far = segment.distance > DISAGREEMENT * length + 0.5 * step_size * base.velocity.norm();
        let turned = segment.angle > DISAGREEMENT + 0.5 * step_size * base.angular_velocity.norm();
        if self.warned || !(far || turned) {
            return None;
        }
        self.warned = true;
        Some(if far {
            let names = ["base.position", "base.velocity"];
            Warning::PoseAndTwistDisagree { names, distance: segment.distance, unit: "m" }
        } else {
            let names = ["base.orientation", "base.angular_velocity"];
            Warning::PoseAndTwistDisagree { names, distance: segment.angle, unit: "rad" }
        })
    }

    /// Sets gravity from the next step on.
    pub fn set_gravity(&mut self, gravity: Vector3<f64>) {
        self.gravity = gravity;
    }

    /// The outputs at the present communication point.
    pub fn outputs(&self) -> &Outputs {
        &self.outputs
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
        let boundary = Boundary::hanging_from(*self.path.base(), self.gravity);
        modes::modes(self.integrator.in_space(), &boundary, count).map_err(Error::NoEquilibrium)
    }

    fn read_out(&mut self) {
        let (integrator, Boundary { base, tip_force, tip_moment, .. }) = (&self.integrator, &self.drive.boundary);
        let Ends { position, rotation, velocity, angular_velocity, force, moment } = integrator.ends();
        self.outputs = Outputs {
            tip_position: position,
            tip_orientation: so3::quaternion(&rotation),
            tip_velocity: velocity,
            tip_angular_velocity: angular_velocity,
            base_reaction_force: force,
            base_reaction_moment: moment,
            energy: *integrator.energy(),
            power_base: -force.dot(&base.velocity) - moment.dot(&base.angular_velocity),
            power_tip: tip_force.dot(&velocity) + tip_moment.dot(&angular_velocity),
            cells: integrator.cells() as i32,
            solver: *integrator.effort(),
            ..self.outputs
        };
        integrator.centreline(&mut self.outputs.stations);
    }
}

// of a unit that was started alike
archived!(Unit { integrator, gravity, path, warned, drive, outputs } but { start, step, quasi_static });

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
        self.as_deref_mut().map_or(Ok(()), |unit| unit.visit(archive))
    }
}
