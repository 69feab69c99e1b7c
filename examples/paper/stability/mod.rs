//! The stability map: a rod released from the horizontal, 200 steps of every size, by every method and scheme, on every
//! mesh and of every material.
//!
//! | method | |
//! |---|---|
//! | rate, as printed | the paper's system and Algorithm 1, the trapezoidal box in space |
//! | rate, mended | the same with its mendings (see `cosserat_rod::rate`) |
//! | pose, a from rotations / positions | the pose formulation with either of its acceleration rows, whatever comes |
//! | pose, the unit's way | the same, each step by the row and scheme that suit it |
//! | shooting | the boundary value problem of the mended steps, from the base to the tip |
//! | the unit by itself | steps of order 4 as its tolerance allows, in communication steps of that size for a second |
//! | explicit | springs and a leap over velocities |
//!
//! The black marks are where theory ends a method: see [`explicit`] and [`shooting`].

pub mod explicit;
mod map;
mod scan;
mod shooting;
mod unit;

use crate::report::{Example, Numbers};
use crate::scene::{self, ByRow, PAPER};
use cosserat_rod::alpha::Scheme;
use cosserat_rod::formulation::Formulation;
use cosserat_rod::pose::{Row, State};
use cosserat_rod::rate::{self, Options};
use cosserat_rod::stepper::Stepper;
use explicit::Explicit;
use indicatif::ProgressBar;
use scan::{MATERIALS, Outcome, Reference, Verdict};
use shooting::Shooting;
use std::error::Error;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use unit::Automatic;

/// Time steps, s.
const TIME_STEPS: [f64; 12] = [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1.0 / 30.0, 0.1, 1.0, 10.0, 100.0];
/// Cells along the rod.
const CELLS: [usize; 3] = [6, 25, 100];
/// Names and weights of the time schemes.
const SCHEMES: [(&str, Scheme); 6] = [
    // the steps of implicit Euler, but for the first as printed
    ("(0.3, 0, 0.7)", PAPER),
    ("λ = 0", Scheme { alpha: -0.5, beta: 0.0, gamma: 1.0 }),
    ("λ = −0.5", Scheme { alpha: 1.0 / 6.0, beta: 1.0 / 3.0, gamma: 2.0 / 3.0 }),
    ("λ = −1", Scheme { alpha: 0.5, beta: 0.5, gamma: 0.5 }),
    ("(0.4, 0, 1)", Scheme { alpha: 0.4, beta: 0.0, gamma: 1.0 }),
    // α ≤ ½, β ≤ ½ and γ ≥ ½ hold, α − β + γ ≥ ½ does not
    ("(0, 0.25, 0.5)", Scheme { alpha: 0.0, beta: 0.25, gamma: 0.5 }),
];

/// Tolerances of the unit by itself.
const TOLERANCES: [(&str, f64); 4] =
    [("tolerance 1e-2", 1e-2), ("tolerance 1e-3", 1e-3), ("tolerance 1e-4", 1e-4), ("tolerance 1e-5", 1e-5)];

type Lost = Box<dyn Error + Send + Sync>;

/// How the rod is moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Method {
    RatePrinted,
    RateMended,
    PoseByRotations,
    PoseByPositions,
    Pose,
    Shooting,
    Unit,
    Explicit,
}

impl Method {
    const ALL: [Self; 8] = [
        Self::RatePrinted,
        Self::RateMended,
        Self::PoseByRotations,
        Self::PoseByPositions,
        Self::Pose,
        Self::Shooting,
        Self::Unit,
        Self::Explicit,
    ];

    fn name(&self) -> &'static str {
        match self {
            Self::RatePrinted => "rate, as printed",
            Self::RateMended => "rate, mended",
            Self::PoseByRotations => "pose, a from rotations",
            Self::PoseByPositions => "pose, a from positions",
            Self::Pose => "pose, the unit's way",
            Self::Unit => "the unit by itself, in its own steps",
            Self::Shooting => "shooting, for the mended rate",
            Self::Explicit => "explicit, with springs",
        }
    }

    /// Indices of the schemes, or tolerances, it is run with.
    fn schemes(&self) -> std::ops::Range<usize> {
        match self {
            Self::Explicit => 0..1,
            Self::Unit => 0..TOLERANCES.len(),
            _ => 0..SCHEMES.len(),
        }
    }

    /// Name of one of them.
    fn scheme(&self, index: usize) -> &'static str {
        match self {
            Self::Explicit => "leapfrog",
            Self::Unit => TOLERANCES[index].0,
            _ => SCHEMES[index].0,
        }
    }

    /// Names of all of them.
    fn heads(&self) -> Vec<&'static str> {
        self.schemes().map(|index| self.scheme(index)).collect()
    }

    /// Steps of a run.
    fn steps(&self, dt: f64) -> usize {
        match self {
            Self::Unit => scan::STEPS.min((1.0 / dt).ceil() as usize),
            _ => scan::STEPS,
        }
    }

    /// The unstressed rod at rest.
    fn begin(&self, case: &Case) -> Result<Box<dyn Formulation>, Lost> {
        let material = &MATERIALS[case.material];
        let boundary = scene::horizontal();
        let mesh = material.mesh(CELLS[case.cells]);
        let by_rates = |options: Options| rate::Stepper::new(mesh.clone(), material.rod(), &boundary, options);
        let by_poses = || {
            let state = State::at_rest_shape(&mesh, &boundary.base);
            let mut stepper = Stepper::new(mesh.clone(), material.rod(), state);
            stepper.start(&boundary).map(|()| stepper)
        };
        Ok(match self {
            Self::RatePrinted => Box::new(by_rates(Options::AS_PRINTED)?),
            Self::RateMended => Box::new(by_rates(Options::MENDED)?),
            Self::PoseByRotations => Box::new(ByRow { stepper: by_poses()?, row: Row::Rotations }),
            Self::PoseByPositions => Box::new(ByRow { stepper: by_poses()?, row: Row::Positions }),
            Self::Pose => Box::new(by_poses()?),
            Self::Unit => Box::new(Automatic::new(material, CELLS[case.cells], TOLERANCES[case.scheme].1)?),
            Self::Shooting => Box::new(Shooting::new(by_rates(Options::MENDED)?)),
            Self::Explicit => Box::new(Explicit::new(&mesh, &scene::compliant(&material.rod()), &boundary)),
        })
    }
}

/// One run, by the places in the lists above.
#[derive(Clone, Copy, Debug)]
struct Case {
    method: Method,
    scheme: usize,
    material: usize,
    cells: usize,
    step: usize,
}

impl Case {
    fn all() -> Vec<Self> {
        let mut cases = Vec::new();
        for method in Method::ALL {
            for scheme in method.schemes() {
                for material in 0..MATERIALS.len() {
                    for cells in 0..CELLS.len() {
                        cases.extend((0..TIME_STEPS.len()).map(|step| Self { method, scheme, material, cells, step }));
                    }
                }
            }
        }
        cases
    }

    fn run(&self, references: &[Reference]) -> Result<Outcome, Lost> {
        let mut rod = self.method.begin(self)?;
        let reference = &references[self.material];
        let (_, scheme) = SCHEMES[self.scheme];
        let dt = TIME_STEPS[self.step];
        let steps = self.method.steps(dt);
        Ok(scan::run(&MATERIALS[self.material], reference, rod.as_mut(), scheme, dt, steps))
    }

    fn record(&self, outcome: &Outcome) -> Vec<String> {
        let number = |x: f64| format!("{x:.3e}");
        vec![
            self.method.name().to_owned(),
            self.method.scheme(self.scheme).to_owned(),
            MATERIALS[self.material].name.to_owned(),
            CELLS[self.cells].to_string(),
            number(TIME_STEPS[self.step]),
            outcome.verdict.name().to_owned(),
            outcome.steps.to_string(),
            format!("{:.1}", outcome.iterations),
            number(outcome.growth),
            number(outcome.drift),
            number(outcome.ringing),
            number(outcome.error),
        ]
    }
}

/// The steps at which theory ends a method on a mesh.
fn limits(method: Method, scheme: usize, material: usize, cells: usize) -> Vec<f64> {
    let (material, cells) = (&MATERIALS[material], CELLS[cells]);
    match method {
        Method::Explicit => {
            vec![explicit::longest_step(&scene::compliant(&material.rod()), material.length / cells as f64)]
        }
        Method::Shooting => shooting::limits(&material.rod(), material.length, cells, &SCHEMES[scheme].1),
        _ => Vec::new(),
    }
}

/// Runs everything, on all cores.
pub fn run(bar: &ProgressBar) -> Result<Example, Box<dyn Error>> {
    let cases = Case::all();
    bar.set_length(cases.len() as u64);
    let references = MATERIALS
        .iter()
        .map(Reference::new)
        .collect::<Result<Vec<_>, Lost>>()
        .map_err(|lost| lost as Box<dyn Error>)?;
    let (next, outcomes) = (AtomicUsize::new(0), Mutex::new(Vec::with_capacity(cases.len())));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some((i, case)) = {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    cases.get(i).map(|case| (i, case))
                } {
                    let outcome = case.run(&references);
                    outcomes.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).push((i, outcome));
                    bar.inc(1);
                }
            });
        }
    });
    let mut outcomes = outcomes.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    outcomes.sort_by_key(|(i, _)| *i);
    let runs = outcomes.into_iter().map(|(i, outcome)| Ok((cases[i], outcome?))).collect::<Result<Vec<_>, Lost>>();
    let runs = runs.map_err(|lost| lost as Box<dyn Error>)?;

    let head = [
        "method",
        "scheme or tolerance",
        "material",
        "cells",
        "time step, s",
        "verdict",
        "steps",
        "iterations per step",
        "energy gained / (weight length)",
        "cell length error",
        "ringing / weight",
        "tip error / length",
    ]
    .map(str::to_owned)
    .to_vec();
    let rows = runs.iter().map(|(case, outcome)| case.record(outcome)).collect();
    Ok(Example {
        name: "stability",
        picture: map::draw(&runs, limits)?,
        numbers: Numbers { chosen: counts(&runs), head, rows },
    })
}

/// How many runs of a method and scheme were fine, in words.
fn counts(runs: &[(Case, Outcome)]) -> Vec<String> {
    let mut lines = Vec::new();
    for method in Method::ALL {
        for scheme in method.schemes() {
            let of = |verdict: Option<Verdict>| {
                let counted = |(case, outcome): &&(Case, Outcome)| {
                    (case.method, case.scheme) == (method, scheme) && verdict.is_none_or(|v| v == outcome.verdict)
                };
                runs.iter().filter(counted).count()
            };
            let words: Vec<String> =
                Verdict::ALL.iter().map(|verdict| format!("{} {}", of(Some(*verdict)), verdict.name())).collect();
            lines.push(format!(
                "{}, {}: of {} runs {}",
                method.name(),
                method.scheme(scheme),
                of(None),
                words.join(", ")
            ));
        }
    }
    lines
}
