//! What is fixed before the run starts, or may be tuned while it lasts; and the start of a rod with it.

use super::error::{Allowed, Error};
use super::outputs::STATIONS;
use crate::alpha::Scheme;
use crate::archive::archived;
use crate::boundary::Boundary;
use crate::integrator::{Integrator, Way};
use crate::mesh::{MAX_STAGES, Mesh};
use crate::modes;
use crate::pose::State;
use crate::refine::Refiner;
use crate::rest::RestShape;
use crate::rod::Rod;
use crate::span;
use crate::stepper::Stepper;
use nalgebra::Vector3;
use std::f64::consts::PI;

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
    /// Where along the unstressed rod the stations lie, as parts of its length, up to [`STATIONS`]; not to be set by the host.
    pub stations: Vec<f64>,
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
    stations,
});

impl Default for Parameters {
    /// A soft rubber rod of 1 m, with stations at equal arc lengths from the base to the tip.
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
            stations: (0..STATIONS).map(|i| i as f64 / (STATIONS - 1) as f64).collect(),
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

/// Distance of the ends over the length from which on a rod that does not stretch and cannot be moved is taken for taut.
pub(super) const TAUT: f64 = 0.98;

/// Name and value of a parameter, and what it may be.
type Number = (&'static str, f64, Allowed);

pub(super) fn allow(mut numbers: impl Iterator<Item = Number>) -> Result<(), Error> {
    match numbers.find(|(_, value, allowed)| !allowed.contains(*value)) {
        Some((name, value, allowed)) => Err(Error::NotAllowed { name, value, allowed }),
        None => Ok(()),
    }
}

impl Tunable {
    pub(super) fn numbers(&self) -> impl Iterator<Item = Number> + use<> {
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
    pub(super) fn damped(&self, rod: Rod) -> Rod {
        let damping = Vector3::new(self.damping_bending, self.damping_bending, self.damping_twist);
        Rod { damping, drag: self.damping_drag, ..rod }
    }
}

impl Parameters {
    /// Whether the effective mass is wanted, and there is inertia.
    pub(super) fn wants_masses(&self) -> bool {
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
    pub(super) fn numbers(&self) -> impl Iterator<Item = Number> + use<> {
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
        allow(self.numbers())?;
        let count = ("stations", self.stations.len() as f64, Allowed::Choice(1, STATIONS as i32));
        let parts = self.stations.iter().map(|part| ("stations", *part, Allowed::Between(0.0, 1.0)));
        allow(std::iter::once(count).chain(parts))
    }

    /// The cells to begin with, and what refines them where they are not given.
    ///
    /// # Errors
    /// [`Error::NotAllowed`] if a cell would turn further than its rotation vector reaches.
    fn mesh(&self, rod: &Rod, boundary: &Boundary, tolerance: f64) -> Result<(Mesh, Option<Refiner>), Error> {
        let (shape, more) = (&self.rest_shape, &self.rest_curvature);
        let turn = shape.turn(self.length, more);
        let stages = self.most_stages();
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
        let in_cells = |cells: usize, stages: usize| shape.mesh(self.length, more, cells, COARSEST_TURN, stages);
        if self.extensible || self.step > 0.0 || self.quasi_static {
            let cells = self.cells_enough(rod, boundary, tolerance, ENOUGH);
            let cells = if self.tip_mode == 1 { cells.max(CELLS_BETWEEN_ENDS) } else { cells };
            return Ok((in_cells(cells.max(turn) as usize, stages), None));
        }
        let likely = self.cells_enough(rod, boundary, tolerance, LIKELY);
        let coiled = turn / COARSEST_TURN;
        // where what the rest shape asks for is more than enough, fewer points may do in some cells more
        let is_coil = self.stages == 0 && self.tip_mode == 0 && coiled > likely;
        let cells = |coil: &Coil| coiled * (coil.reference / tolerance).powf(0.5 / coil.stages as f64).max(1.0);
        let cost = |coil: &Coil| cells(coil) * coil.cost;
        let coil = COILS.iter().filter(|_| is_coil).min_by(|one, other| cost(one).total_cmp(&cost(other)));
        let (cells, stages) = match coil {
            Some(coil) => (cells(coil), coil.stages),
            None => ((AT_REST * likely).max(coiled), stages),
        };
        let mut coarsest = in_cells(cells.ceil() as usize, stages);
        if turn == 0.0 && self.tip_mode == 0 {
            coarsest.shorten_first(self.clamped_length(rod, boundary));
        }
        let most = likely.max(turn).max(coarsest.cells.len() as f64);
        let slow = self.length / self.time_in(rod, if is_coil { self.length / turn } else { self.length }).powi(2);
        let refiner = Refiner::new(&coarsest, tolerance, slow, (ROOM * most).max(LEAST_ROOM) as usize);
        let cells = if self.tip_mode == 1 {
            // the motion to come is not seen at the start
            self.length / self.longest_cell(rod, boundary, tolerance)
        } else if self.start_in_equilibrium {
            likely * (RESTING / tolerance).powf(0.4).min(1.0)
        } else {
            likely
        };
        Ok((refiner.start(cells as usize), Some(refiner)))
    }

    /// Gauss points in a cell, as given or as many as there may be.
    fn most_stages(&self) -> usize {
        if self.stages == 0 { MAX_STAGES } else { self.stages as usize }
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
        let order = 2.0 * self.most_stages() as f64;
        let few = 2.0 * (1e-3 / tolerance).powf(1.0 / order);
        let cells = part * bends * (reference / tolerance).powf(grows / order);
        cells.max(wound).max(few).ceil().clamp(1.0, MAX_AUTOMATIC_CELLS)
    }

    /// The longest cell of a rod whose tip is held, m: its cells do not choose themselves.
    pub(super) fn longest_cell(&self, rod: &Rod, boundary: &Boundary, tolerance: f64) -> f64 {
        self.length / self.cells_enough(rod, boundary, tolerance, ENOUGH).max(CELLS_BETWEEN_ENDS)
    }

    /// The shortest time in which gravity or stiffness move the whole rod, s.
    pub fn time(&self, rod: &Rod) -> f64 {
        self.time_in(rod, self.length)
    }

    /// The same of one that is bent or twisted by what acts as far from it as `lever`, m: the radius of a coil.
    fn time_in(&self, rod: &Rod, lever: f64) -> f64 {
        let mass = rod.mass_per_length * self.length;
        let swing = (self.length / self.gravity.norm()).sqrt();
        let vibration = (mass * self.length * lever.powi(2) / rod.stiffness.x.max(rod.stiffness.y)).sqrt();
        swing.min(vibration)
    }

    /// Length of the cell at the clamp of a rod that hangs, m. A longer one, where the pull bends the rod within much less,
    /// is far from right for the moment on the base; with a shorter one the other cells are as far for the tip.
    fn clamped_length(&self, rod: &Rod, boundary: &Boundary) -> f64 {
        let pull = (rod.mass_per_length * self.length + rod.tip_mass) * self.gravity.norm() + boundary.tip_force.norm();
        let layer = (rod.stiffness.x.min(rod.stiffness.y) / pull).sqrt() / self.length;
        CLAMPED * layer.powf(2.0 / 3.0) * self.length
    }

    /// The longest internal step of generalized-α: as given, or a part of that time.
    pub(super) fn longest_step(&self, rod: &Rod, tolerance: f64) -> f64 {
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
    pub(super) fn reaches(&self, distance: f64, part: f64) -> Result<(), Error> {
        match self.extensible || distance < part * self.length {
            true => Ok(()),
            false => Err(Error::OutOfReach { distance, length: self.length }),
        }
    }

    /// The same rod where it has not been started.
    pub(super) fn room(&self, boundary: &Boundary, tolerance: f64) -> Result<Integrator, Error> {
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

/// A rule for a coil.
struct Coil {
    /// Gauss points in a cell.
    stages: usize,
    /// Time for a cell, over that of one with the most points.
    cost: f64,
    /// Tolerance at which cells of [`COARSEST_TURN`] will do.
    reference: f64,
}

/// Measured on a rope of seven such lengths, five cells of four points are right to 3e-4.
const ENOUGH: Cells = Cells { part: 0.7, reference: 1e-3, grows: 1.0 };
/// Two thirds of the equal cells that just do for a rope and a hair, of 1e-2 to 1e-5: the motion concentrates what is bent.
const LIKELY: Cells = Cells { part: 0.2, reference: 1e-2, grows: 1.8 };
/// Tolerance beyond which a rod at rest begins with fewer than those. Below it the waves that new ones raise count, if it is
/// hit: with half of them the errors of a struck cord are 4 to 6 times the tolerance.
const RESTING: f64 = 1.8e-4;
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
/// First cell, over the length and the power two thirds of the layer at the clamp over it: two cells of a line of 50 m, of
/// which the pull bends 40 cm, are best with a first one of 7 to 10 m.
const CLAMPED: f64 = 4.0;
/// Turn of the rest shape in a cell of the coarsest mesh, rad.
const COARSEST_TURN: f64 = 2.6;
/// As measured on a spring of four turns: at these tolerances such cells use up their share.
const COILS: [Coil; 3] = [
    Coil { stages: 2, cost: 0.34, reference: 8e-4 },
    Coil { stages: 3, cost: 0.54, reference: 4.5e-5 },
    Coil { stages: 4, cost: 1.0, reference: 1.7e-6 },
];
/// Turn of the rest shape in one cell, rad: its rotation vector ends at a full turn, and half of that is left to the
/// motion.
const MAX_CELL_TURN: f64 = 3.0;
