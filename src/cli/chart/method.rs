//! The ways to integrate a rod, each at many resolutions.

use super::scenes::Scene;
use crate::cli::simulate::Experiment;
use cosserat_rod::alpha::Scheme;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::plane::Plane;
use cosserat_rod::pose::State;
use cosserat_rod::rosenbrock::{RODAS4, RODAS5P, Rosenbrock};
use cosserat_rod::runge_kutta::ESDIRK4;
use cosserat_rod::stepper::Stepper;
use cosserat_rod::unit::Parameters;
use cpu_time::ProcessTime;
use nalgebra::Vector3;
use std::error::Error;
use std::fmt;

type Vec3 = Vector3<f64>;

/// Equal times at which a built-in scene is sampled, besides its start.
pub const SAMPLES: usize = 100;

/// How finely a rod is resolved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// Equal cells.
    Grid { cells: usize, stages: usize, steps: Steps },
    /// Whatever the unit chooses for it.
    Tolerance(f64),
}

/// How finely it is in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Steps {
    /// So many in all.
    Equal(usize),
    /// As long as their error allows.
    To(f64),
}

impl Steps {
    /// The more, the finer; in proportion to their number as far as that is known.
    pub fn fineness(self) -> f64 {
        match self {
            Self::Equal(count) => count as f64,
            // order 4
            Self::To(tolerance) => tolerance.powf(-0.25),
        }
    }
}

impl Resolution {
    /// Whether its steps are longer than those of `count` to the end.
    pub fn is_longer_than(&self, count: usize) -> bool {
        matches!(self, Self::Grid { steps: Steps::Equal(steps), .. } if *steps < count)
    }
}

impl fmt::Display for Resolution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Grid { cells, stages, steps: Steps::Equal(steps) } => {
                write!(f, "cells={cells} stages={stages}, {steps} steps")
            }
            Self::Grid { cells, stages, steps: Steps::To(tolerance) } => {
                write!(f, "cells={cells} stages={stages} tolerance={tolerance:e}")
            }
            Self::Tolerance(tolerance) => write!(f, "tolerance={tolerance:e}"),
        }
    }
}

/// What a run gave.
#[derive(Clone, Default)]
pub struct Run {
    /// In the words of `--set`, after the tolerance where that chose the others.
    pub setting: String,
    /// Of the process for the steps, s.
    pub cpu: f64,
    /// Whether it ended in a plane.
    pub planar: bool,
    pub tip: Vec<Vec3>,
    /// On the base.
    pub reaction: Vec<Vec3>,
}

impl Run {
    /// With a first sample.
    fn from(mut self, (tip, reaction): (Vec3, Vec3)) -> Self {
        self.tip.insert(0, tip);
        self.reaction.insert(0, reaction);
        self
    }

    fn sample(&mut self, tip: &Vec3, reaction: &Vec3) {
        self.tip.push(*tip);
        self.reaction.push(*reaction);
    }
}

type Solve<'a> = Box<dyn Fn(Resolution) -> Result<Run, Box<dyn Error>> + 'a>;

/// A way to integrate a rod. A new one is an entry more in [`of_scene`], and is measured, drawn and compared like the
/// others.
pub struct Method<'a> {
    /// Its name in tables.
    pub code: &'static str,
    /// Whether the unit takes such steps, or the library alone.
    pub of_unit: bool,
    /// All it may be asked for; tolerances from the coarsest on.
    pub resolutions: Vec<Resolution>,
    pub solve: Solve<'a>,
}

/// Those of the built-in scenes, under exact motions and loads: the library on grids, and left to itself as the unit leaves
/// it. The grids of the first give the reference where there is no other.
pub fn of_scene(scene: Scene) -> Vec<Method<'static>> {
    let Parameters { length, rest_curvature, .. } = scene.parameters();
    let cells = cell_counts(length * rest_curvature.norm());
    let to_samples = grids(&cells, &STAGES, refinements(SAMPLES));
    let dense = grids(&cells, &STAGES, LONG_STEPS.map(Steps::Equal).into_iter().chain(refinements(SAMPLES)));
    let on_cells = |code, planar| Method {
        code,
        of_unit: true,
        resolutions: grids(&cells, &STAGES, STEP_TOLERANCES.map(Steps::To).into_iter()),
        solve: Box::new(move |resolution| of_unit_alone(scene, resolution, planar)),
    };
    let planar = |code, method| Method {
        code,
        of_unit: false,
        resolutions: dense.clone(),
        solve: Box::new(move |resolution| of_plane_grid(scene, resolution, method)),
    };
    let mut methods = vec![
        Method {
            code: "cosserat-rod order 2",
            of_unit: true,
            resolutions: to_samples,
            solve: Box::new(move |resolution| of_grid(scene, resolution, generalised_alpha)),
        },
        Method {
            code: "cosserat-rod order 4",
            of_unit: false,
            resolutions: dense.clone(),
            solve: Box::new(move |resolution| of_grid(scene, resolution, fourth_order)),
        },
        on_cells("cosserat-rod on given cells", false),
    ];
    let start = scene.drive(0.0);
    let mesh = Mesh::uniform(length, 1, 1, rest_curvature);
    let whole = [0.0, 0.3, 0.7, 1.0].map(|part| scene.drive(part * scene.duration()));
    if Plane::of(&mesh, &scene.rod(), &start, &RODAS4).is_some_and(|plane| whole.iter().all(|drive| plane.holds(drive)))
    {
        methods.push(on_cells("cosserat-rod plane, on given cells", true));
        methods.push(planar("cosserat-rod plane, order 4", &RODAS4));
        methods.push(planar("cosserat-rod plane, order 5", &RODAS5P));
    }
    methods.push(Method {
        code: "cosserat-rod to a tolerance",
        of_unit: true,
        resolutions: tolerances(&TOLERANCES),
        solve: Box::new(move |resolution| of_unit_alone(scene, resolution, true)),
    });
    methods
}

/// Those of a rod of the user's own: the unit. What is set stays as it is.
pub fn of_unit(experiment: &Experiment) -> Vec<Method<'_>> {
    let given = &experiment.parameters;
    let fixed = |value: i32, otherwise: Vec<usize>| if value > 0 { vec![value as usize] } else { otherwise };
    let cells = fixed(given.cells, cell_counts(given.length * given.rest_curvature.norm()));
    let samples = experiment.steps().max(1);
    let stages = fixed(given.stages, STAGES.to_vec());
    let steps = refinements(samples).take(if given.step > 0.0 { 1 } else { usize::MAX });
    let asked = |otherwise: &[f64]| if given.tolerance > 0.0 { vec![given.tolerance] } else { otherwise.to_vec() };
    let method = |code, resolutions| Method {
        code,
        of_unit: true,
        resolutions,
        solve: Box::new(move |resolution| {
            simulate(experiment, &set(given, resolution, experiment.duration()), resolution)
        }),
    };
    let resolutions = [tolerances(&asked(&TOLERANCES)), grids(&cells, &stages, steps)].concat();
    let mut methods = vec![method("cosserat-rod", resolutions)];
    // a step that is given leaves no other, and no part of the budget to it
    if given.step == 0.0 {
        let steps = asked(&STEP_TOLERANCES).into_iter().map(Steps::To);
        methods.push(method("cosserat-rod on given cells", grids(&cells, &stages, steps)));
    }
    methods
}

/// The parameters of a resolution; equal steps are as given, or as many to the end of `duration`, s.
fn set(given: &Parameters, resolution: Resolution, duration: f64) -> Parameters {
    match resolution {
        Resolution::Grid { cells, stages, steps } => {
            let (step, tolerance) = match steps {
                Steps::Equal(steps) if given.step == 0.0 => (duration / steps as f64, given.tolerance),
                Steps::Equal(_) => (given.step, given.tolerance),
                Steps::To(tolerance) => (0.0, tolerance),
            };
            Parameters { cells: cells as i32, stages: stages as i32, step, tolerance, ..given.clone() }
        }
        Resolution::Tolerance(tolerance) => Parameters { tolerance, ..given.clone() },
    }
}

/// Displacement over the length that an iteration of a stage need not resolve.
const STAGE_ACCURACY: f64 = 1e-7;
/// Steps over a built-in scene that are longer than its samples lie apart, which are then seen within the steps.
const LONG_STEPS: [usize; 5] = [5, 10, 20, 25, 50];
const TOLERANCES: [f64; 5] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
/// Of steps on given cells: the first is as good as none.
const STEP_TOLERANCES: [f64; 11] = [3e-1, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7];
const STAGES: [usize; 4] = [1, 2, 3, 4];
/// Most cells, and twice as many as a wound rod needs at least.
const CELLS: usize = 32;
/// Turn of the rest shape in a cell, rad, up to which the unit takes a mesh.
const CELL_TURN: f64 = 3.0;
/// Most halvings of the interval between samples.
const HALVINGS: u32 = 12;

fn tolerances(values: &[f64]) -> Vec<Resolution> {
    values.iter().copied().map(Resolution::Tolerance).collect()
}

/// 1, 2, 3, 4, 6, 8, 12 …
fn sizes() -> impl Iterator<Item = usize> {
    [1].into_iter().chain((1..).flat_map(|k| [1 << k, 3 << (k - 1)]))
}

/// Of a rod whose rest shape turns by so much, rad.
fn cell_counts(turn: f64) -> Vec<usize> {
    let least = (turn / CELL_TURN).floor() as usize + 1;
    sizes().take_while(|&cells| cells <= CELLS.max(4 * least)).filter(|&cells| cells >= least).collect()
}

/// Steps that end on the samples.
fn refinements(samples: usize) -> impl Iterator<Item = Steps> + Clone {
    (0..=HALVINGS).map(move |halvings| Steps::Equal(samples << halvings))
}

fn grids(cells: &[usize], stages: &[usize], all_steps: impl Iterator<Item = Steps> + Clone) -> Vec<Resolution> {
    let mut grids = Vec::new();
    for &cells in cells {
        for &stages in stages {
            grids.extend(all_steps.clone().map(|steps| Resolution::Grid { cells, stages, steps }));
        }
    }
    grids
}

/// A mesh and a step, as one gives them to the unit.
fn grid(cells: usize, stages: usize, step: f64) -> String {
    format!("cells={cells} stages={stages} step={}", digits(step))
}

/// Four of them that count.
fn digits(value: f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    if (1e-3..1e4).contains(&rounded) { format!("{rounded}") } else { format!("{rounded:e}") }
}

/// A rod of a scene that takes a step, and shows its tip and the force on its base at parts of it.
type Step<R> = fn(&mut R, Scene, f64, f64) -> Result<(), Box<dyn Error>>;
type Show<R> = fn(&mut R, Scene, f64, f64, f64) -> (Vec3, Vec3);

/// A run in equal steps of `rod`, which stands at the start.
fn of_steps<R>(
    scene: Scene,
    setting: String,
    steps: usize,
    rod: &mut R,
    (advance, show): (Step<R>, Show<R>),
) -> Result<Run, Box<dyn Error>> {
    let step = scene.duration() / steps as f64;
    let mut run = Run { setting, ..Run::default() };
    // a step to several samples, or several steps to one
    let (samples, parts) = ((SAMPLES / steps).max(1), (steps / SAMPLES).max(1));
    let clock = ProcessTime::now();
    for k in 0..steps {
        let time = k as f64 * step;
        advance(rod, scene, time, step)?;
        if (k + 1) % parts == 0 {
            for sample in 1..=samples {
                let (tip, force) = show(rod, scene, time, step, sample as f64 / samples as f64);
                run.sample(&tip, &force);
            }
        }
    }
    run.cpu = clock.elapsed().as_secs_f64();
    if run.tip.iter().chain(&run.reaction).any(|sample| !sample.norm().is_finite()) {
        return Err("a number is not finite".into());
    }
    Ok(run)
}

/// A rod of a scene in space, on a grid, at the start; its sample there, and what the grid is called.
fn on_grid(scene: Scene, resolution: Resolution) -> Result<(Stepper, usize, String), Box<dyn Error>> {
    let Resolution::Grid { cells, stages, steps: Steps::Equal(steps) } = resolution else {
        return Err(format!("{resolution} is not a grid of equal steps").into());
    };
    let start = scene.boundary(0.0);
    let Parameters { length, rest_curvature, .. } = scene.parameters();
    let mesh = Mesh::uniform(length, cells, stages, rest_curvature);
    let state = State::at_rest_shape(&mesh, &start.base);
    let mut stepper = Stepper::new(mesh, scene.rod(), state);
    if scene.starts_at_rest() {
        stepper.equilibrium(&start)?;
    }
    stepper.start(&start)?;
    Ok((stepper, steps, grid(cells, stages, scene.duration() / steps as f64)))
}

/// A run of a built-in scene on a grid in space.
fn of_grid(scene: Scene, resolution: Resolution, advance: Step<Stepper>) -> Result<Run, Box<dyn Error>> {
    let (mut stepper, steps, setting) = on_grid(scene, resolution)?;
    let seen = |state: &State| (state.tip().position, state.nodes[0].force);
    let begin = seen(&stepper.state);
    let show: Show<Stepper> = |stepper, scene, time, step, part| {
        let state = match part {
            1.0 => &stepper.state,
            _ => stepper.look(part, &scene.boundary(time + part * step)),
        };
        (state.tip().position, state.nodes[0].force)
    };
    Ok(of_steps(scene, setting, steps, &mut stepper, (advance, show))?.from(begin))
}

/// The same in a plane.
fn of_plane_grid(scene: Scene, resolution: Resolution, method: &'static Rosenbrock) -> Result<Run, Box<dyn Error>> {
    let (stepper, steps, setting) = on_grid(scene, resolution)?;
    let mut plane = Plane::new(&stepper.mesh, &stepper.rod, method);
    let start = scene.drive(0.0);
    if !plane.enter(&stepper.state, &start) {
        return Err("it does not lie in a plane".into());
    }
    plane.start(&start)?;
    let begin = (plane.tip().position, plane.reaction().0);
    let advance: Step<Plane> = |plane, scene, time, step| {
        plane.attempt(&|since| scene.drive(time + since), step)?;
        plane.accept();
        Ok(())
    };
    let show: Show<Plane> = |plane, scene, time, step, part| {
        plane.look(part, &scene.drive(time + part * step));
        (plane.tip().position, plane.reaction().0)
    };
    let run = of_steps(scene, setting, steps, &mut plane, (advance, show))?.from(begin);
    Ok(Run { planar: true, ..run })
}

/// A step of the pose formulation, from `time` on.
fn generalised_alpha(stepper: &mut Stepper, scene: Scene, time: f64, step: f64) -> Result<(), Box<dyn Error>> {
    let scheme = Scheme::from_spectral_radius(scene.parameters().spectral_radius);
    stepper.advance(&scene.boundary(time + step), scheme, step)?;
    Ok(())
}

/// A Runge-Kutta step of the pose formulation, from `time` on.
fn fourth_order(stepper: &mut Stepper, scene: Scene, time: f64, step: f64) -> Result<(), Box<dyn Error>> {
    stepper.attempt(&ESDIRK4, &|since| scene.boundary(time + since), step, STAGE_ACCURACY)?;
    stepper.accept();
    Ok(())
}

/// As the unit moves it, with the samples as communication points; in a plane if it may.
fn of_unit_alone(scene: Scene, resolution: Resolution, planar: bool) -> Result<Run, Box<dyn Error>> {
    let given = Parameters { planar, ..scene.parameters() };
    let parameters = set(&given, resolution, scene.duration());
    let mut rod = parameters.start(&scene.boundary(0.0), parameters.tolerance)?;
    let mut run = Run::default();
    let ends = rod.ends();
    run.sample(&ends.position, &ends.force);
    let interval = scene.duration() / SAMPLES as f64;
    let mut cells = rod.cells();
    let clock = ProcessTime::now();
    for k in 0..SAMPLES {
        let begin = k as f64 * interval;
        rod.advance(&|since| scene.drive(begin + since), interval).map_err(|failed| failed.cause)?;
        let ends = rod.ends();
        run.sample(&ends.position, &ends.force);
        cells = cells.max(rod.cells());
    }
    run.cpu = clock.elapsed().as_secs_f64();
    run.planar = rod.effort().planar;
    run.setting = setting(resolution, &parameters, cells);
    Ok(run)
}

/// A resolution in the words of `--set`; one that was left the cells took `most`.
fn setting(resolution: Resolution, parameters: &Parameters, most: usize) -> String {
    match resolution {
        Resolution::Grid { cells, stages, steps: Steps::Equal(_) } => grid(cells, stages, parameters.step),
        Resolution::Grid { .. } => resolution.to_string(),
        Resolution::Tolerance(_) => format!("{resolution}: cells<={most}"),
    }
}

/// The unit, sampled at its communication points.
fn simulate(experiment: &Experiment, parameters: &Parameters, resolution: Resolution) -> Result<Run, Box<dyn Error>> {
    let mut run = Run::default();
    let (mut clock, mut cells) = (None, 0);
    // it has told its warnings when it ran for its own sake
    experiment.run(parameters, |_, outputs, _| {
        run.sample(&outputs.tip_position, &outputs.base_reaction_force);
        (cells, run.planar) = (outputs.cells.max(cells), outputs.solver.planar);
        let clock = *clock.get_or_insert_with(ProcessTime::now);
        run.cpu = clock.elapsed().as_secs_f64();
        Ok(())
    })?;
    run.setting = setting(resolution, parameters, cells as usize);
    Ok(run)
}
