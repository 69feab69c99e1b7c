//! The model without FMI: parameters and inputs in, one rod advanced by communication steps, outputs out.

use nalgebra::{Vector3, Vector4};
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
    /// Longest internal step, s; 0 = chosen here.
    pub step: f64,
    /// Tolerance of the tip position relative to the length; 0 = from the experiment, else 1e-3.
    pub tolerance: f64,
    /// Spectral radius of the time integrator at infinite frequency, in [0, 1].
    pub spectral_radius: f64,
    /// Start from the static equilibrium instead of the rest shape.
    pub start_in_equilibrium: bool,
}

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

/// Energies and works since the start, J: kinetic + elastic + gravity + dissipated grows by work_base + work_tip.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Energy {
    /// Of the rod and the body at its tip.
    pub kinetic: f64,
    /// Stored in bending, twist and, if extensible, shear and stretch.
    pub elastic: f64,
    /// Potential of gravity, zero at the world origin.
    pub gravity: f64,
    /// Lost in Kelvin-Voigt damping and drag.
    pub dissipated: f64,
    /// Work the base has done on the rod.
    pub work_base: f64,
    /// Work the tip force and moment have done on the rod.
    pub work_tip: f64,
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
    /// Internal steps since the start.
    pub steps: i32,
    /// Newton iterations since the start.
    pub iterations: i32,
    /// Internal steps that had to be tried again since the start.
    pub retries: i32,
    /// Cells in use.
    pub cells: i32,
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
        allowed: &'static str,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAllowed { name, value, allowed } => write!(f, "{name} = {value} is not allowed: {allowed}"),
        }
    }
}

impl std::error::Error for Error {}

/// Something the host should know although the step succeeded; each kind is given once in a run.
#[derive(Clone, Debug, PartialEq)]
pub enum Warning {
    /// `base.position` and `base.velocity` (or orientation and angular velocity) do not belong to one motion.
    PoseAndTwistDisagree {
        /// Names of the two variables.
        names: [&'static str; 2],
        /// How far apart, m or rad.
        distance: f64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PoseAndTwistDisagree { names, distance } => {
                write!(f, "{} and {} disagree by {distance}", names[0], names[1])
            }
        }
    }
}

/// One rod, started and ready to step.
#[derive(Clone, Debug)]
pub struct Unit {
    outputs: Outputs,
}

impl Unit {
    /// Starts a rod. `tolerance` is that of the experiment, if the host gave one.
    ///
    /// # Errors
    /// [`Error`] names the parameter or input that is not allowed.
    pub fn new(parameters: &Parameters, inputs: &Inputs, tolerance: Option<f64>) -> Result<Self, Error> {
        let _ = (inputs, tolerance);
        if !(parameters.length > 0.0) {
            return Err(Error::NotAllowed { name: "length", value: parameters.length, allowed: "finite and > 0" });
        }
        Ok(Self { outputs: Outputs::default() })
    }

    /// Advances by one communication step of `step_size` s, from the inputs at its start.
    ///
    /// # Errors
    /// [`Error`]; the unit is then exactly as before and the call may be repeated.
    pub fn advance(&mut self, inputs: &Inputs, step_size: f64) -> Result<Option<Warning>, Error> {
        self.outputs.tip_position += inputs.base_velocity * step_size;
        self.outputs.steps += 1;
        Ok(None)
    }

    /// Sets gravity from the next step on.
    pub fn set_gravity(&mut self, gravity: Vector3<f64>) {
        let _ = gravity;
    }

    /// The outputs at the present communication point.
    pub fn outputs(&self) -> &Outputs {
        &self.outputs
    }
}
