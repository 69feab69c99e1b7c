//! The variables of the unit: one row each, from which value references, get and set, units, the model description and
//! its dependencies follow.
//!
//! A row is a scalar, an array, or one array per station of the centreline; [`all`] unrolls the rows into scalar
//! variables, and the value reference of a variable is its place in that list. It is one list for all types, so that a
//! reference taken for the wrong type is noticed.

use crate::unit::{Allowed, Derivatives, Inputs, Outputs, Parameters, STATIONS};
use std::fmt;

/// Type of a variable in the sense of FMI.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `fmi2Real`.
    Real,
    /// `fmi2Integer`.
    Integer,
    /// `fmi2Boolean`.
    Boolean,
    /// `fmi2String`; the unit has none.
    String,
}

impl Kind {
    /// Name of its element in the model description.
    pub fn name(self) -> &'static str {
        match self {
            Self::Real => "Real",
            Self::Integer => "Integer",
            Self::Boolean => "Boolean",
            Self::String => "String",
        }
    }
}

/// Where a variable lives; the second argument is the element of an array, 0 for a scalar.
#[derive(Clone, Copy, Debug)]
pub enum Slot {
    /// Fixed after initialisation.
    Parameter(fn(&mut Parameters, usize) -> &mut f64),
    /// May be set at communication points as well, from where the next step sees it.
    Tunable(fn(&mut Parameters, usize) -> &mut f64),
    /// Fixed after initialisation.
    IntegerParameter(fn(&mut Parameters) -> &mut i32),
    /// May be set at communication points as well, from where the next step sees it.
    TunableInteger(fn(&mut Parameters) -> &mut i32),
    /// Fixed after initialisation.
    BooleanParameter(fn(&mut Parameters) -> &mut bool),
    /// Acts in the step that follows.
    Input(fn(&mut Inputs, usize) -> &mut f64),
    /// Computed.
    Output(fn(&Outputs, usize) -> f64, Initially),
    /// Computed.
    IntegerOutput(fn(&Outputs) -> i32, Initially),
    /// Computed.
    BooleanOutput(fn(&Outputs) -> bool, Initially),
}

/// What the value of an output at the end of initialisation depends on; the names are those of rows.
///
/// Later than that no output depends on the *present* value of any input: an input acts in the `fmi2DoStep` that
/// follows, and a get between a set and that step still answers with the state at the end of the last step. So the
/// outputs of the model structure have no dependencies at all, and a master that closes a loop through the unit finds
/// no algebraic loop at a communication point. This would change with inputs that feed through, such as an
/// acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Initially {
    /// On none: always the same value.
    Constant,
    /// On all parameters and inputs but these.
    AllBut(&'static [&'static str]),
}

impl Initially {
    fn on(self, name: &str) -> bool {
        match self {
            Self::Constant => false,
            Self::AllBut(names) => !names.contains(&name),
        }
    }
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Name, without the index of an array; `[i]` stands for the number of the station.
    pub name: &'static str,
    /// Unit, empty if none; one of those in [`UNITS`].
    pub unit: &'static str,
    /// Names of the elements; empty for a scalar.
    pub components: &'static [&'static str],
    /// How often the row is repeated, once or for every station.
    pub copies: usize,
    /// Where it lives.
    pub slot: Slot,
    /// Meaning, with frame, sign and reference point; `[part]` stands for where the stations lie.
    pub description: &'static str,
}

impl Row {
    fn elements(&self) -> usize {
        self.components.len().max(1) * self.copies
    }

    /// The same with as many stations as a rod with these parameters has.
    pub fn of(&self, parameters: &Parameters) -> Self {
        Self { copies: self.copies.min(parameters.stations.len()), ..*self }
    }

    /// What it means where the stations lie at these parts of the length.
    pub fn meaning(&self, parts: &[f64]) -> String {
        let parts: Vec<String> = parts.iter().map(|part| ((part * 1e4).round() / 1e4).to_string()).collect();
        self.description.replace("[part]", &parts.join(", "))
    }
}

/// Its name with the ranges of its indices: `gravity[1..3]`.
impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name.split_once("[i]") {
            Some((before, after)) => write!(f, "{before}[1..{}]{after}", self.copies)?,
            None => f.write_str(self.name)?,
        }
        if self.components.is_empty() { Ok(()) } else { write!(f, "[1..{}]", self.components.len()) }
    }
}

/// A scalar variable: an element of a row.
#[derive(Clone, Copy, Debug)]
pub struct Variable {
    /// Its row.
    pub row: &'static Row,
    /// Which element of it, from 0.
    pub element: usize,
}

/// The names of this variable are dotted, its indices count from 1.
impl fmt::Display for Variable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.row.name.split_once("[i]") {
            Some((before, after)) => write!(f, "{before}[{}]{after}", self.copy() + 1)?,
            None => f.write_str(self.row.name)?,
        }
        match self.row.components {
            [] => Ok(()),
            names => write!(f, "[{}]", self.element % names.len() + 1),
        }
    }
}

impl Variable {
    /// Its type.
    pub fn kind(&self) -> Kind {
        match self.row.slot {
            Slot::Parameter(_) | Slot::Tunable(_) | Slot::Input(_) | Slot::Output(..) => Kind::Real,
            Slot::IntegerParameter(_) | Slot::TunableInteger(_) | Slot::IntegerOutput(..) => Kind::Integer,
            Slot::BooleanParameter(_) | Slot::BooleanOutput(..) => Kind::Boolean,
        }
    }

    /// Whether it is computed.
    pub fn is_output(&self) -> bool {
        matches!(self.row.slot, Slot::Output(..) | Slot::IntegerOutput(..) | Slot::BooleanOutput(..))
    }

    /// Whether it may be set at communication points.
    pub fn is_settable_while_stepping(&self) -> bool {
        matches!(self.row.slot, Slot::Input(_) | Slot::Tunable(_) | Slot::TunableInteger(_))
    }

    /// What it may be set to.
    pub fn allowed(&self) -> Allowed {
        match self.row.slot {
            Slot::Parameter(_) | Slot::Tunable(_) | Slot::IntegerParameter(_) | Slot::TunableInteger(_) => {
                Parameters::allowed(&self.to_string())
            }
            Slot::BooleanParameter(_) => Allowed::Choice(0, 1),
            Slot::Input(_) | Slot::Output(..) | Slot::IntegerOutput(..) | Slot::BooleanOutput(..) => Allowed::Finite,
        }
    }

    /// Which copy of its row it belongs to, from 0.
    fn copy(&self) -> usize {
        self.element / self.row.components.len().max(1)
    }

    /// Whether a rod with these parameters has it; value references count those that it has not as well.
    pub fn is_of(&self, parameters: &Parameters) -> bool {
        self.copy() < self.row.of(parameters).copies
    }

    /// What it means for a rod that has it, with the component of an array named.
    pub fn description(&self, parameters: &Parameters) -> String {
        let part = parameters.stations.get(self.copy()..=self.copy());
        let meaning = self.row.meaning(part.unwrap_or_default());
        match self.row.components {
            [] => meaning,
            names => format!("{meaning}: {}", names[self.element % names.len()]),
        }
    }

    /// Whether the value of this output at the end of initialisation may depend on `known`.
    pub fn depends_initially_on(&self, known: &Variable) -> bool {
        match self.row.slot {
            Slot::Output(_, initially) | Slot::IntegerOutput(_, initially) | Slot::BooleanOutput(_, initially) => {
                initially.on(known.row.name)
            }
            _ => false,
        }
    }

    /// Its value where it is set, `None` for an output. Every type of the unit fits into an `f64` without loss.
    pub fn given(&self, parameters: &mut Parameters, inputs: &mut Inputs) -> Option<f64> {
        match self.row.slot {
            Slot::Parameter(at) | Slot::Tunable(at) => Some(*at(parameters, self.element)),
            Slot::IntegerParameter(at) | Slot::TunableInteger(at) => Some((*at(parameters)).into()),
            Slot::BooleanParameter(at) => Some(u8::from(*at(parameters)).into()),
            Slot::Input(at) => Some(*at(inputs, self.element)),
            Slot::Output(..) | Slot::IntegerOutput(..) | Slot::BooleanOutput(..) => None,
        }
    }

    /// Its value where it is computed, `None` for a parameter or an input.
    pub fn computed(&self, outputs: &Outputs) -> Option<f64> {
        match self.row.slot {
            Slot::Output(at, _) => Some(at(outputs, self.element)),
            Slot::IntegerOutput(at, _) => Some(at(outputs).into()),
            Slot::BooleanOutput(at, _) => Some(u8::from(at(outputs)).into()),
            _ => None,
        }
    }

    /// Sets a parameter or an input to a value that [`Variable::allowed`] contains; an output stays.
    pub fn set(&self, parameters: &mut Parameters, inputs: &mut Inputs, value: f64) {
        match self.row.slot {
            Slot::Parameter(at) | Slot::Tunable(at) => *at(parameters, self.element) = value,
            // Exact: the value came from an i32, or is 0 or 1.
            Slot::IntegerParameter(at) | Slot::TunableInteger(at) => *at(parameters) = value as i32,
            Slot::BooleanParameter(at) => *at(parameters) = value != 0.0,
            Slot::Input(at) => *at(inputs, self.element) = value,
            Slot::Output(..) | Slot::IntegerOutput(..) | Slot::BooleanOutput(..) => {}
        }
    }

    /// Where its derivative of this order is set; `None` if it has none that can be.
    pub fn input_derivative<'a>(&self, derivatives: &'a mut Derivatives, order: i32) -> Option<&'a mut f64> {
        match (self.row.slot, order) {
            (Slot::Input(at), 1) => Some(at(&mut derivatives.first, self.element)),
            (Slot::Input(at), 2) => Some(at(&mut derivatives.second, self.element)),
            _ => None,
        }
    }
}

/// The scalar variables, each at the place of its value reference.
pub fn all() -> Vec<Variable> {
    ROWS.iter().flat_map(|row| (0..row.elements()).map(move |element| Variable { row, element })).collect()
}

const fn scalar(name: &'static str, unit: &'static str, slot: Slot, description: &'static str) -> Row {
    Row { name, unit, components: &[], copies: 1, slot, description }
}

const fn array(
    name: &'static str,
    unit: &'static str,
    components: &'static [&'static str],
    slot: Slot,
    description: &'static str,
) -> Row {
    Row { name, unit, components, copies: 1, slot, description }
}

const XYZ: &[&str] = &["x", "y", "z"];
const WXYZ: &[&str] = &["w", "x", "y", "z"];
const MATRIX: &[&str] = &["xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"];
const DIRECTORS: &[&str] = &["d1", "d2", "d3"];

/// What only the passage of time makes felt. The shape at the start, and what follows from it, does not depend on it.
const SHAPE: Initially = Initially::AllBut(&[
    "damping.bending",
    "damping.twist",
    "damping.drag",
    "tip.inertia",
    "base.motion",
    "tip.motion",
    "step",
    "spectral_radius",
    "planar",
    "effective_mass",
    "base.velocity",
    "base.angular_velocity",
    "tip.driven_velocity",
    "tip.driven_angular_velocity",
]);
/// Damping and the start in motion reach the accelerations, and these the reaction; only the time steps do not.
const START: Initially = Initially::AllBut(&["step", "spectral_radius", "planar", "effective_mass"]);
/// The same where it is wanted at all.
const MASS: Initially = Initially::AllBut(&["step", "spectral_radius", "planar"]);

use Slot::{
    BooleanOutput, BooleanParameter, Input, IntegerOutput, IntegerParameter, Output, Parameter, Tunable, TunableInteger,
};

/// The table.
#[rustfmt::skip]
pub static ROWS: &[Row] = &[
    scalar("length", "m", Parameter(|p, _| &mut p.length),
        "Arc length of the unstressed rod, > 0"),
    scalar("radius", "m", Parameter(|p, _| &mut p.radius),
        "Radius of the circular section, > 0"),
    scalar("density", "kg/m3", Parameter(|p, _| &mut p.density),
        "Density, > 0"),
    scalar("youngs_modulus", "Pa", Parameter(|p, _| &mut p.youngs_modulus),
        "Young's modulus, > 0"),
    scalar("shear_modulus", "Pa", Parameter(|p, _| &mut p.shear_modulus),
        "Shear modulus, > 0"),
    scalar("section.area", "m2", Parameter(|p, _| &mut p.section_area),
        "Area of the section; 0 = from the radius"),
    array("section.second_moment", "m4", &["about d1", "about d2"],
        Parameter(|p, k| &mut p.section_second_moment[k]),
        "Second moment of area about a principal axis of the section; 0 = from the radius"),
    scalar("section.torsion_constant", "m4", Parameter(|p, _| &mut p.section_torsion_constant),
        "Torsion constant of the section; 0 = sum of the second moments in use"),
    scalar("section.shear_correction", "", Parameter(|p, _| &mut p.section_shear_correction),
        "Shear correction factor, > 0; used when extensible"),
    array("rest_curvature", "1/m", DIRECTORS, Parameter(|p, k| &mut p.rest_curvature[k]),
        "Curvature (about d1, d2) and twist (about d3) of the unstressed rod, body frame, d3 along the rod"),
    array("gravity", "m/s2", XYZ, Tunable(|p, k| &mut p.gravity[k]),
        "Acceleration of gravity, world frame"),
    scalar("damping.bending", "s", Tunable(|p, _| &mut p.damping_bending),
        "Kelvin-Voigt time constant of bending"),
    scalar("damping.twist", "s", Tunable(|p, _| &mut p.damping_twist),
        "Kelvin-Voigt time constant of twist"),
    scalar("damping.drag", "N.s/m2", Tunable(|p, _| &mut p.damping_drag),
        "Linear drag: force per length and velocity, against the velocity in the world frame"),
    scalar("tip.mass", "kg", Parameter(|p, _| &mut p.tip_mass),
        "Mass of a body whose centre is the tip point"),
    scalar("tip.inertia", "kg.m2", Parameter(|p, _| &mut p.tip_inertia),
        "Isotropic inertia of that body about the tip point"),
    scalar("extensible", "", BooleanParameter(|p| &mut p.extensible),
        "Whether the section shears and stretches"),
    scalar("base.motion", "", IntegerParameter(|p| &mut p.base_motion),
        "Which inputs move the base: 0 pose and twist, 1 pose only (twist derived), 2 twist only (pose integrated from the initial one)"),
    scalar("tip.mode", "", TunableInteger(|p| &mut p.tip_mode),
        "What holds the tip: 0 nothing, it is loaded by tip.force and tip.moment; 1 it follows tip.driven_position and so on, and the loads act on it besides. From 0 to 1 it begins with the motion it has and is led to these inputs; from 1 to 0 it is let go. A run that starts with 1 starts from the static equilibrium between the ends"),
    scalar("tip.motion", "", IntegerParameter(|p| &mut p.tip_motion),
        "Which inputs move a driven tip: 0 pose and twist, 1 pose only (twist derived), 2 twist only (pose integrated from the one it begins with)"),
    scalar("cells", "", IntegerParameter(|p| &mut p.cells),
        "Cells along the rod; 0 = chosen by the unit"),
    scalar("stages", "", IntegerParameter(|p| &mut p.stages),
        "Gauss points in a cell, 1 to 4; 0 = chosen by the unit"),
    scalar("step", "s", Parameter(|p, _| &mut p.step),
        "Every communication step is divided into equal generalized-alpha steps not longer than this; 0 = steps of order 4, as long as their error allows"),
    scalar("tolerance", "", Parameter(|p, _| &mut p.tolerance),
        "Tolerance of the tip position relative to the length; 0 = that of the experiment, else 1e-3"),
    scalar("spectral_radius", "", Parameter(|p, _| &mut p.spectral_radius),
        "Spectral radius of the time integrator at infinite frequency: 0 damps most, 1 nothing"),
    scalar("start_in_equilibrium", "", BooleanParameter(|p| &mut p.start_in_equilibrium),
        "Whether the run starts from the static equilibrium under gravity and the initial inputs instead of the rest shape; it does so in any case with a driven tip"),
    scalar("planar", "", BooleanParameter(|p| &mut p.planar),
        "Whether the rod may be computed in a plane as long as it lies and moves in one, and all that acts on it leaves it there"),
    scalar("quasi_static", "", BooleanParameter(|p| &mut p.quasi_static),
        "Whether the rod goes from one static equilibrium to the next, without inertia and damping; it starts from one, and loads go steadily from their last values to the new ones in every communication step"),
    scalar("effective_mass", "", BooleanParameter(|p| &mut p.effective_mass),
        "Whether coupling.effective_mass is computed at every communication point"),

    array("base.position", "m", XYZ, Input(|i, k| &mut i.base_position[k]),
        "Position of the base point, world frame"),
    array("base.orientation", "", WXYZ, Input(|i, k| &mut i.base_orientation[k]),
        "Orientation of the base, quaternion from body to world frame, normalised on use; identity: the rod leaves along world +z"),
    array("base.velocity", "m/s", XYZ, Input(|i, k| &mut i.base_velocity[k]),
        "Velocity of the base point, world frame"),
    array("base.angular_velocity", "rad/s", XYZ, Input(|i, k| &mut i.base_angular_velocity[k]),
        "Angular velocity of the base, world frame"),
    array("tip.force", "N", XYZ, Input(|i, k| &mut i.tip_force[k]),
        "Force exerted on the tip of the rod by its surroundings, world frame"),
    array("tip.moment", "N.m", XYZ, Input(|i, k| &mut i.tip_moment[k]),
        "Moment exerted on the tip of the rod by its surroundings, about the tip point, world frame"),
    array("tip.driven_position", "m", XYZ, Input(|i, k| &mut i.tip_position[k]),
        "Position of a driven tip (tip.mode = 1), world frame"),
    array("tip.driven_orientation", "", WXYZ, Input(|i, k| &mut i.tip_orientation[k]),
        "Orientation of a driven tip, quaternion from body to world frame, normalised on use; the tangent there, d3, points away from the rod"),
    array("tip.driven_velocity", "m/s", XYZ, Input(|i, k| &mut i.tip_velocity[k]),
        "Velocity of a driven tip, world frame"),
    array("tip.driven_angular_velocity", "rad/s", XYZ, Input(|i, k| &mut i.tip_angular_velocity[k]),
        "Angular velocity of a driven tip, world frame"),

    array("tip.position", "m", XYZ, Output(|o, k| o.tip_position[k], SHAPE),
        "Position of the tip point, world frame"),
    array("tip.orientation", "", WXYZ, Output(|o, k| o.tip_orientation[k], SHAPE),
        "Orientation of the tip, unit quaternion from body to world frame"),
    array("tip.velocity", "m/s", XYZ, Output(|o, k| o.tip_velocity[k], START),
        "Velocity of the tip point, world frame"),
    array("tip.angular_velocity", "rad/s", XYZ, Output(|o, k| o.tip_angular_velocity[k], START),
        "Angular velocity of the tip, world frame"),
    array("base.reaction_force", "N", XYZ, Output(|o, k| o.base_reaction_force[k], START),
        "Force the rod exerts on its base, world frame; add it to the forces on the base"),
    array("base.reaction_moment", "N.m", XYZ, Output(|o, k| o.base_reaction_moment[k], START),
        "Moment the rod exerts on its base, about the base point, world frame; add it to the moments on the base"),
    array("tip.reaction_force", "N", XYZ, Output(|o, k| o.tip_reaction_force[k], START),
        "Force the rod, with the body and the load at its tip, exerts on what drives the tip, world frame; add it to the forces there. Zero while tip.mode = 0"),
    array("tip.reaction_moment", "N.m", XYZ, Output(|o, k| o.tip_reaction_moment[k], START),
        "Moment the rod, with the body and the load at its tip, exerts on what drives the tip, about the tip point, world frame; add it to the moments there. Zero while tip.mode = 0"),
    Row { name: "station[i].position", unit: "m", components: XYZ, copies: STATIONS,
        slot: Output(|o, k| o.stations[k / 3][k % 3], SHAPE),
        description: "Position of the centreline at [part] of the length of the unstressed rod from the base, world frame" },
    scalar("energy.kinetic", "J", Output(|o, _| o.energy.kinetic, START),
        "Kinetic energy of the rod and the body at its tip"),
    scalar("energy.elastic", "J", Output(|o, _| o.energy.elastic, SHAPE),
        "Elastic energy"),
    scalar("energy.gravity", "J", Output(|o, _| o.energy.gravity, SHAPE),
        "Potential energy of gravity, zero at the world origin"),
    scalar("energy.dissipated", "J", Output(|o, _| o.energy.dissipated, Initially::Constant),
        "Energy lost in damping and drag since the start"),
    scalar("energy.work_base", "J", Output(|o, _| o.energy.work_base, Initially::Constant),
        "Work the base has done on the rod since the start"),
    scalar("energy.work_tip", "J", Output(|o, _| o.energy.work_tip, Initially::Constant),
        "Work the tip force and moment, and what drives the tip, have done on the rod since the start"),
    scalar("coupling.power_base", "W", Output(|o, _| o.power_base, START),
        "Power that the base puts into the rod, the rate of energy.work_base"),
    scalar("coupling.power_tip", "W", Output(|o, _| o.power_tip, START),
        "Power that the tip force and moment of the step that ends here, and what drives the tip, put into the rod, the rate of energy.work_tip"),
    array("coupling.base_acceleration", "m/s2", XYZ, Output(|o, k| o.base_acceleration[k], Initially::Constant),
        "Acceleration of the base point on its path at the end of the step, world frame"),
    array("coupling.effective_mass", "kg", MATRIX, Output(|o, k| o.effective_mass[(k / 3, k % 3)], MASS),
        "How much of the rod the base feels at once: base.reaction_force changes by minus this times a change of the acceleration of the base point, world frame, row by row; a moment comes with it as little as a force with turning: both bend the rod first; 0 unless the parameter effective_mass is true, and for a rod that is extensible"),
    scalar("solver.steps", "", IntegerOutput(|o| o.solver.steps, Initially::Constant),
        "Internal steps since the start"),
    scalar("solver.iterations", "", IntegerOutput(|o| o.solver.iterations, START),
        "Newton iterations since the start, those of the start included"),
    scalar("solver.retries", "", IntegerOutput(|o| o.solver.retries, Initially::Constant),
        "Internal steps tried again since the start"),
    scalar("solver.cells", "", IntegerOutput(|o| o.cells, START),
        "Cells in use"),
    scalar("solver.order", "", IntegerOutput(|o| o.solver.order, Initially::Constant),
        "Order in time of the last internal step; 0 before the first"),
    scalar("solver.planar", "", BooleanOutput(|o| o.solver.planar, Initially::Constant),
        "Whether the last internal step was in a plane"),
    scalar("solver.step", "s", Output(|o, _| o.solver.step, Initially::Constant),
        "Length of the last internal step"),
    scalar("solver.error_estimate", "", Output(|o, _| o.solver.error + o.solver.space_error, Initially::Constant),
        "Estimated error of the centreline, over the length: sum of those of the internal steps since the start, and the largest of the cells; 0 where the parameters step and cells give them"),
];

/// The units of the table, each with its exponents of kg, m, s and rad.
#[rustfmt::skip]
pub const UNITS: &[(&str, [i32; 4])] = &[
    ("m",      [0, 1, 0, 0]),
    ("m2",     [0, 2, 0, 0]),
    ("m4",     [0, 4, 0, 0]),
    ("1/m",    [0, -1, 0, 0]),
    ("s",      [0, 0, 1, 0]),
    ("m/s",    [0, 1, -1, 0]),
    ("m/s2",   [0, 1, -2, 0]),
    ("rad/s",  [0, 0, -1, 1]),
    ("kg",     [1, 0, 0, 0]),
    ("kg.m2",  [1, 2, 0, 0]),
    ("kg/m3",  [1, -3, 0, 0]),
    ("Pa",     [1, -1, -2, 0]),
    ("N",      [1, 1, -2, 0]),
    ("N.m",    [1, 2, -2, 0]),
    ("N.s/m2", [1, -1, -1, 0]),
    ("J",      [1, 2, -2, 0]),
    ("W",      [1, 2, -3, 0]),
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn names_are_unique_and_units_defined() {
        let variables = all();
        let names: HashSet<String> = variables.iter().map(Variable::to_string).collect();
        assert_eq!(names.len(), variables.len());
        for row in ROWS {
            assert!(row.unit.is_empty() || UNITS.iter().any(|(name, _)| *name == row.unit), "{}", row.unit);
        }
    }

    #[test]
    fn dependencies_name_rows() {
        for row in ROWS {
            let (Output(_, initially) | IntegerOutput(_, initially) | BooleanOutput(_, initially)) = row.slot else {
                continue;
            };
            let Initially::AllBut(names) = initially else { continue };
            for name in names {
                assert!(ROWS.iter().any(|row| row.name == *name), "{name}");
            }
        }
    }

    #[test]
    fn what_is_set_is_read_back_and_reaches_nothing_else() {
        for variable in all().iter().filter(|variable| !variable.is_output()) {
            let (mut parameters, mut inputs) = (Parameters::default(), Inputs::default());
            let value = if variable.given(&mut parameters, &mut inputs) == Some(1.0) { 0.0 } else { 1.0 };
            variable.set(&mut parameters, &mut inputs, value);
            let (mut start, mut rest) = (Parameters::default(), Inputs::default());
            for other in all() {
                let (now, before) = (other.given(&mut parameters, &mut inputs), other.given(&mut start, &mut rest));
                let same_element = other.to_string() == variable.to_string();
                assert_eq!(now != before, same_element, "{variable} and {other}");
            }
            assert_eq!(variable.given(&mut parameters, &mut inputs), Some(value));
        }
    }

    #[test]
    fn the_start_values_are_allowed() {
        for variable in all() {
            if let Some(start) = variable.given(&mut Parameters::default(), &mut Inputs::default()) {
                assert!(variable.allowed().contains(start), "{variable}");
            }
        }
    }
}
