//! Work and time of one Newton iteration and of whole steps, per cell: `cargo bench --bench step`, or some of its tables:
//! `cargo bench --bench step -- steps rods`.
//!
//! Instructions are counted by callgrind, if it is installed: the program runs itself under it and takes the difference
//! of two runs, so that what is counted is one iteration and nothing else. Times are medians. The rod is of rubber,
//! twisted and bent, on a turning base.
#![allow(missing_docs)]

// the tests use the rest of it
#[allow(dead_code)]
#[path = "../tests/common/banded.rs"]
mod banded;
#[path = "../tests/common/full.rs"]
mod full;
#[path = "../tests/common/long.rs"]
mod long;
// the chart uses the rest of it
#[allow(dead_code)]
#[path = "../src/cli/chart/scenes.rs"]
mod scenes;

use banded::{Banded, flat};
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::{Boundary, Drive, Rates, Support};
use cosserat_rod::fmi2::host::Fmu;
use cosserat_rod::fmi2::variables::Kind;
use cosserat_rod::integrator::Effort;
use cosserat_rod::mesh::{Gauss, Mesh};
use cosserat_rod::package;
use cosserat_rod::plane::Plane;
use cosserat_rod::pose::{Row, State, Time, assemble};
use cosserat_rod::rod::Rod;
use cosserat_rod::rosenbrock::RODAS4;
use cosserat_rod::runge_kutta::ESDIRK4;
use cosserat_rod::so3;
use cosserat_rod::stepper::Stepper;
use cosserat_rod::sweep::{Sweep, System};
use cosserat_rod::unit::{Inputs, Parameters, Unit};
use full::Full;
use long::{helix, inputs};
use nalgebra::{Matrix3, SMatrix, Vector3};
use scenes::Scene;
use std::hint::black_box;
use std::process::Command;
use std::time::Instant;

const CELLS: [usize; 7] = [10, 30, 100, 300, 1000, 3000, 10_000];
const STAGES: [usize; 2] = [1, 4];
const DT: f64 = 5e-3;

/// The parts of an iteration.
const PHASES: [&str; 4] = ["assembly", "factors", "solution", "update"];

/// A rod in the middle of a step, ready for any phase any number of times.
struct Iteration {
    mesh: Mesh,
    rod: Rod,
    boundary: Boundary,
    time: Time,
    old: State,
    trial: State,
    system: System,
    sweep: Sweep,
}

impl Iteration {
    fn new(cells: usize, stages: usize) -> Self {
        let shape = Mesh::uniform(1.0, cells, stages, Vector3::new(1.0, 0.5, 0.2));
        let base = Support {
            angular_velocity: Vector3::new(1.0, 2.0, 3.0),
            ..Support::at_rest(Vector3::zeros(), Matrix3::identity())
        };
        let turned = Support { rotation: so3::exp(&(base.angular_velocity * DT)), ..base };
        let mesh = Mesh::uniform(1.0, cells, stages, Vector3::zeros());
        let system = System::new(cells, &mesh.rule, false);
        Self {
            sweep: Sweep::new(cells, &mesh.rule, false),
            rod: Rod::circular(5e-3, 5e6, 5e6 / 3.0, 1100.0),
            boundary: Boundary::hanging_from(turned, Vector3::new(0.0, 0.0, -9.81)),
            time: Time::Step { scheme: Scheme::from_spectral_radius(0.5), dt: DT, row: Row::Rotations },
            old: State::at_rest_shape(&shape, &base),
            trial: State::at_rest_shape(&shape, &turned),
            mesh,
            system,
        }
    }

    fn run(&mut self, phase: &str) {
        let Self { mesh, rod, boundary, time, old, trial, system, sweep } = self;
        match phase {
            "assembly" => {
                assemble(mesh, rod, old, trial, boundary, time, system);
            }
            "factors" => sweep.factorise(system).expect("the rod's cells are regular"),
            "solution" => sweep.solve_for(&system.residuals),
            // a vanishing part of the increment: the same work, and the state stays
            _ => trial.apply(&sweep.nodes, &sweep.points, 1e-12, Row::Rotations),
        }
        black_box(&mut *self);
    }

    /// Seconds of one run, the median of many.
    fn seconds(&mut self, phase: &str, cells: usize) -> f64 {
        let repetitions = (1000 / cells).max(1);
        let sample = |_| {
            let start = Instant::now();
            for _ in 0..repetitions {
                self.run(phase);
            }
            start.elapsed().as_secs_f64() / repetitions as f64
        };
        median((0..15).map(sample).collect())
    }
}

/// A linear system of no rod in particular, and its sweep.
struct Linear<const V: usize, const S: usize> {
    system: System<V, S>,
    sweep: Sweep<V, S>,
}

impl<const V: usize, const S: usize> Linear<V, S> {
    fn new(cells: usize, stages: usize, extensible: bool) -> Self {
        let rule = Gauss::new(stages);
        let mut system = System::<V, S>::new(cells, &rule, extensible);
        system.mass = 1.0;
        for (i, point) in system.points.iter_mut().enumerate() {
            let angle = 0.1 * i as f64;
            point.spin = SMatrix::from_fn(|i, j| f64::from(i == j) + 0.1 * (angle + (2 * i + j) as f64).sin());
            point.w_phi = SMatrix::from_fn(|i, j| (angle + (3 * i + j) as f64).sin());
            point.w_n = SMatrix::identity() * 1e-3;
            point.m_phi = SMatrix::identity() * 1e-2;
            point.m_n = point.w_phi.transpose();
            (point.p_strain, point.law_strain) = (point.spin.transpose() * point.spin, point.spin);
        }
        for ends in &mut system.cells {
            (ends.length, ends.spin) = (1.0 / cells as f64, SMatrix::identity());
        }
        system.residuals.base.0.fill(1.0);
        system.residuals.tip_load.0.fill(1.0);
        Self { sweep: Sweep::new(cells, &rule, extensible), system }
    }

    /// Runs one part so many times.
    fn count(&mut self, part: &str, times: usize) {
        let Self { system, sweep } = self;
        for _ in 0..times {
            match part {
                "factors" => sweep.factorise(system).expect("regular cells"),
                _ => sweep.solve_for(&system.residuals),
            }
            black_box(&mut *sweep);
        }
    }
}

fn median(mut samples: Vec<f64>) -> f64 {
    samples.sort_by(f64::total_cmp);
    samples[samples.len() / 2]
}

/// Instructions of this program under callgrind with so many iterations.
fn counted(cells: usize, stages: usize, iterations: usize, part: &str, of: &str) -> Option<f64> {
    let output = Command::new("valgrind")
        // long copies and fills in vectors like short ones: a string instruction counts once for every byte
        .env(
            "GLIBC_TUNABLES",
            "glibc.cpu.x86_rep_movsb_threshold=0x40000000:glibc.cpu.x86_rep_stosb_threshold=0x40000000",
        )
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(std::env::current_exe().ok()?)
        .arg("--count")
        .args([cells, stages, iterations].map(|number| number.to_string()))
        .args([part, of])
        .output()
        .ok()?;
    // "==1== Collected : 123"
    let report = String::from_utf8(output.stderr).ok()?;
    let line = report.lines().find(|line| line.contains("Collected"))?;
    line.rsplit(' ').next()?.parse().ok()
}

/// Instructions of one run.
fn instructions(cells: usize, stages: usize, part: &str, of: &str) -> Option<f64> {
    Some(counted(cells, stages, 2, part, of)? - counted(cells, stages, 1, part, of)?)
}

/// Instructions of a further cell.
fn of_further_cell(stages: usize, part: &str, of: &str) -> Option<f64> {
    let (few, many) = (10, 30);
    Some((instructions(many, stages, part, of)? - instructions(few, stages, part, of)?) / (many - few) as f64)
}

/// A rod that can take whole steps of order 4, each of the same work.
enum Whole {
    Space(Box<Stepper>, Boundary),
    Plane(Box<Plane>, Boundary),
}

/// Length of a cell of [`Whole`], m: a rod of more cells is a longer one, in whose cells the same happens.
const CELL: f64 = 0.1;
/// Its steps, s, and the stages of its cells.
const WHOLE_STEP: f64 = 1e-3;
const WHOLE_STAGES: usize = 4;

impl Whole {
    /// A coil of rubber at rest: every stage of a step in space takes one iteration, however many the cells.
    fn new(of: &str, cells: usize) -> Self {
        let rod = Rod::circular(5e-3, 5e6, 5e6 / 3.0, 1100.0);
        let length = CELL * cells as f64;
        let spatial = of == "steps-in-space";
        let kappa = if spatial { Vector3::new(2.0, 0.0, 1.0) } else { Vector3::y() * 2.0 };
        let mesh = Mesh::uniform(length, cells, WHOLE_STAGES, kappa);
        let base = Support::at_rest(Vector3::zeros(), Matrix3::identity());
        let boundary = Boundary::hanging_from(base, Vector3::zeros());
        if spatial {
            let state = State::at_rest_shape(&mesh, &base);
            let mut stepper = Stepper::new(mesh, rod, state);
            stepper.start(&boundary).expect("accelerations");
            Self::Space(Box::new(stepper), boundary)
        } else {
            let drive = Drive { boundary, rates: Rates::default() };
            let mut plane = Plane::of(&mesh, &rod, &drive, &RODAS4).expect("a plane rod");
            plane.start(&drive).expect("accelerations");
            Self::Plane(Box::new(plane), boundary)
        }
    }

    /// One step, and its Newton iterations.
    fn step(&mut self) -> usize {
        match self {
            Self::Space(stepper, boundary) => {
                let attempt = stepper.attempt(&ESDIRK4, &|_| *boundary, WHOLE_STEP, 1e-4).expect("a step");
                stepper.accept();
                attempt.iterations
            }
            Self::Plane(plane, boundary) => {
                let drive = Drive { boundary: *boundary, rates: Rates::default() };
                plane.attempt(&|_| drive, WHOLE_STEP).expect("a step");
                plane.accept();
                0
            }
        }
    }

    /// Seconds of a step, as the mean of some.
    fn seconds(&mut self, cells: usize) -> f64 {
        let repetitions = (300 / cells).max(1);
        let start = Instant::now();
        for _ in 0..repetitions {
            black_box(self.step());
        }
        start.elapsed().as_secs_f64() / repetitions as f64
    }
}

/// Whole steps: instructions and time over the number of cells, and over that of sections, of which the ends have one more
/// than the cells.
fn whole_steps() {
    for (of, what) in [("steps-in-space", "in space, order 4"), ("steps-in-a-plane", "in a plane, RODAS4")] {
        println!("\nOne step {what}, {WHOLE_STAGES} Gauss points in a cell: instructions and time");
        let names = ["per cell", "further cell", "per section", "ns per cell", "iterations"];
        println!("{:>6}{}", "cells", names.map(|name| format!("{name:>14}")).concat());
        let mut rods = CELLS.map(|cells| Whole::new(of, cells));
        let iterations = rods.each_mut().map(Whole::step);
        // in turn, as the speed of a machine changes within a second
        let times = CELLS.map(|_| Vec::new());
        let times = (0..9).fold(times, |mut times, _| {
            for ((rod, cells), times) in rods.iter_mut().zip(CELLS).zip(&mut times) {
                times.push(rod.seconds(cells) / cells as f64);
            }
            times
        });
        let mut before: Option<(usize, f64)> = None;
        for ((cells, times), iterations) in CELLS.into_iter().zip(times).zip(iterations) {
            let time = median(times);
            let work = instructions(cells, WHOLE_STAGES, "step", of);
            let further = before.zip(work).map(|((c, w), work)| (work - w) / (cells - c) as f64);
            before = work.map(|work| (cells, work));
            let per = |count: usize| work.map(|work| work / count as f64);
            let sections = cells * (WHOLE_STAGES + 1) + 1;
            let show = |value: Option<f64>| value.map_or(format!("{:>14}", "-"), |value| format!("{value:>14.0}"));
            let counts = [per(cells), further, per(sections)].map(show).concat();
            println!("{cells:>6}{counts}{:>14.0}{iterations:>14}", time * 1e9);
        }
    }
}

/// A second of two long rods in the steps that the unit chooses: the umbilical in waves, a helix of 50 turns released.
fn long_rods() {
    if let Err(error) = try_long_rods() {
        println!("\nThe long rods were lost: {error}");
    }
}

fn try_long_rods() -> Result<(), cosserat_rod::unit::Error> {
    println!("\nA second of a long rod, left to the unit in communication steps of 20 ms, stages as in the line");
    println!(
        "{:>10} {:>6} {:>7} {:>6} {:>8} {:>10} {:>22}",
        "rod", "cells", "stages", "steps", "retries", "s", "ns per cell and step"
    );
    let umbilical = |cells| (Parameters { cells, ..Scene::Umbilical.parameters() }, "umbilical");
    let helix = |cells| (helix(cells), "helix");
    for (parameters, name) in [10, 100, 1000].map(umbilical).into_iter().chain([150, 300, 600].map(helix)) {
        let at = |time: f64| match name {
            "umbilical" => inputs(&Scene::Umbilical.boundary(time)),
            _ => Inputs::default(),
        };
        let mut unit = Unit::new(&parameters, &at(0.0), None)?;
        let start = Instant::now();
        for i in 0..50 {
            unit.advance(&at(f64::from(i) * 0.02), 0.02)?;
        }
        let time = start.elapsed().as_secs_f64();
        let outputs = unit.outputs();
        let Effort { steps, retries, .. } = outputs.solver;
        let all = f64::from(steps + retries) * f64::from(outputs.cells);
        let (cells, stages) = (parameters.cells, if parameters.stages == 0 { 4 } else { parameters.stages });
        println!("{name:>10} {cells:>6} {stages:>7} {steps:>6} {retries:>8} {time:>10.3} {:>22.0}", time * 1e9 / all);
    }
    Ok(())
}

/// Seconds of the sweep and of the banded LU, factors and solution, on the same system.
fn sweep_and_lu(iteration: &mut Iteration, cells: usize) -> (f64, f64) {
    let sweep = iteration.seconds("factors", cells) + iteration.seconds("solution", cells);
    let full = Full::new(&iteration.system, &iteration.mesh.rule);
    let right = flat(&full.right);
    let sample = |_| {
        let matrix = Banded::new(&full);
        let start = Instant::now();
        black_box(matrix.factored().expect("a regular matrix").solve(&right));
        start.elapsed().as_secs_f64()
    };
    (sweep, median((0..5).map(sample).collect()))
}

/// Seconds of a communication step of the smallest rod at rest: by the library, by `fmi2DoStep`, and by setting the 19
/// inputs, the step and getting 25 outputs. Medians of many, in turn.
fn interface() -> Result<[f64; 3], Box<dyn std::error::Error>> {
    const STEP: f64 = 1e-3;
    let fmu = Fmu::from_library(&package::library()?)?;
    let slave = fmu.instantiate("rod", false)?;
    let integer = |name| fmu.description.reference(name, Kind::Integer);
    slave.set_integer(&[integer("cells")?, integer("stages")?], &[1, 1])?;
    let real = |names: &[&str]| -> Result<Vec<_>, _> {
        let mut all = Vec::new();
        for name in names {
            match name.strip_suffix("orientation") {
                Some(_) => all.extend(fmu.description.array::<4>(name)?),
                None => all.extend(fmu.description.array::<3>(name)?),
            }
        }
        Ok::<_, cosserat_rod::fmi2::host::Error>(all)
    };
    let base = ["base.position", "base.orientation", "base.velocity", "base.angular_velocity"];
    let inputs = real(&[&base[..], &["tip.force", "tip.moment"]].concat())?;
    let tip = ["tip.position", "tip.orientation", "tip.velocity", "tip.angular_velocity"];
    let reaction = ["base.reaction_force", "base.reaction_moment", "station[6].position", "station[11].position"];
    let outputs = real(&[&tip[..], &reaction].concat())?;
    assert_eq!((inputs.len(), outputs.len()), (19, 25));
    let gravity = fmu.description.array::<3>("gravity")?;
    slave.set_real(&gravity, &[0.0; 3])?;
    slave.setup_experiment(0.0, None, None)?;
    slave.enter_initialization_mode()?;
    slave.exit_initialization_mode()?;
    let mut values = [0.0; 19];
    slave.get_real(&inputs, &mut values)?;

    let parameters = Parameters { cells: 1, stages: 1, gravity: Vector3::zeros(), ..Parameters::default() };
    let mut unit = Unit::new(&parameters, &Inputs::default(), None)?;
    let mut results = [Vec::new(), Vec::new(), Vec::new()];
    let (mut time, mut got) = (0.0, [0.0; 25]);
    for _ in 0..2000 {
        let start = Instant::now();
        black_box(unit.advance(&Inputs::default(), STEP)?);
        let library = start.elapsed();
        let start = Instant::now();
        slave.do_step(time, STEP)?;
        let bare = start.elapsed();
        let start = Instant::now();
        slave.set_real(&inputs, &values)?;
        slave.do_step(time + STEP, STEP)?;
        slave.get_real(&outputs, &mut got)?;
        let whole = start.elapsed();
        time += 2.0 * STEP;
        for (result, elapsed) in results.iter_mut().zip([library, bare, whole]) {
            result.push(elapsed.as_secs_f64());
        }
    }
    Ok(results.map(median))
}

/// One Newton iteration: its work and its time, over the number of cells.
fn iterations() {
    for stages in STAGES {
        println!(
            "\nOne Newton iteration with {stages} Gauss point(s) in a cell: instructions per cell, those of a further cell"
        );
        println!(
            "(the difference to the line above: without what the ends of the rod cost), time per cell and its shares"
        );
        let phases = PHASES.map(|phase| format!("{phase:>14}")).concat();
        println!("{:>6} {:>14} {:>14} {:>9}{phases}", "cells", "instructions", "further cell", "ns");
        let mut before: Option<(usize, f64)> = None;
        for cells in CELLS {
            let mut iteration = Iteration::new(cells, stages);
            PHASES.iter().for_each(|phase| iteration.run(phase));
            let times = PHASES.map(|phase| iteration.seconds(phase, cells) / cells as f64);
            let total: f64 = times.iter().sum();
            let shares = times.map(|time| format!("{:>12.0} %", 100.0 * time / total)).concat();

            let work = instructions(cells, stages, "all", "rod");
            let show = |value: Option<f64>| value.map_or("-".to_string(), |value| format!("{value:.1}"));
            let further = before.zip(work).map(|((c, w), work)| (work - w) / (cells - c) as f64);
            before = work.map(|work| (cells, work));
            let per_cell = show(work.map(|work| work / cells as f64));
            println!("{cells:>6} {per_cell:>14} {:>14} {:>9.0}{shares}", show(further), total * 1e9);
        }
    }
}

/// The work of the parts of an iteration, over the stages of a cell.
fn parts() {
    println!("\nInstructions of a further cell");
    println!("{:>20} {:>8} {:>8} {:>8} {:>8}", "stages", 1, 2, 3, 4);
    for (of, part) in [
        ("rod", "assembly"),
        ("space", "factors"),
        ("space", "solution"),
        ("extensible", "factors"),
        ("extensible", "solution"),
        ("plane", "factors"),
        ("plane", "solution"),
    ] {
        let count = |stages| of_further_cell(stages, part, of).map_or("-".to_string(), |count| format!("{count:.0}"));
        let counts = [1, 2, 3, 4].map(|stages| format!(" {:>8}", count(stages))).concat();
        println!("{of:>11} {part:>8}{counts}");
    }
}

/// The sweep beside a general solver.
fn solvers() {
    println!("\nSweep and banded LU with partial pivoting on the same systems, µs");
    println!("{:>6} {:>7} {:>10} {:>10} {:>7}", "stages", "cells", "sweep", "LU", "ratio");
    for stages in STAGES {
        for cells in [10, 100, 400] {
            let mut iteration = Iteration::new(cells, stages);
            PHASES.iter().for_each(|phase| iteration.run(phase));
            let (sweep, lu) = sweep_and_lu(&mut iteration, cells);
            println!("{stages:>6} {cells:>7} {:>10.1} {:>10.1} {:>7.1}", sweep * 1e6, lu * 1e6, lu / sweep);
        }
    }
}

/// What the C interface adds.
fn interfaces() {
    match interface() {
        Ok([library, bare, whole]) => {
            println!("\nA communication step of one box cell at rest, µs");
            println!("library {:.2}, fmi2DoStep {:.2} (+{:.2})", library * 1e6, bare * 1e6, (bare - library) * 1e6);
            println!("set 19 inputs, fmi2DoStep, get 25 outputs {:.2} (+{:.2})", whole * 1e6, (whole - library) * 1e6);
        }
        Err(error) => println!("\nThe C interface was not measured: {error}"),
    }
}

/// Communication steps of one rod, and of a thousand rods in turn: a swinging cord, in its plane and in space.
fn many_rods() {
    const RODS: usize = 1000;
    println!("\nA communication step of 10 ms of a swinging cord, µs: alone, and as one of {RODS} that step in turn");
    for planar in [true, false] {
        let parameters = Parameters { planar, ..Parameters::default() };
        let Ok(unit) = Unit::new(&parameters, &Inputs::default(), None) else { return };
        let seconds = |count: usize| {
            let mut units = vec![unit.clone(); count];
            let sample = |_| {
                let start = Instant::now();
                for unit in &mut units {
                    black_box(unit.advance(&Inputs::default(), 0.01).is_ok());
                }
                start.elapsed().as_secs_f64() / count as f64
            };
            median((0..50).map(sample).collect())
        };
        let (alone, one) = (seconds(1), seconds(RODS));
        let place = if planar { "in its plane" } else { "in space" };
        println!("{place:>14} {:>8.1} {:>8.1} {:>7.2}", alone * 1e6, one * 1e6, one / alone);
    }
}

/// The tables, by name.
const TABLES: [(&str, fn()); 7] = [
    ("iterations", iterations),
    ("steps", whole_steps),
    ("rods", long_rods),
    ("many", many_rods),
    ("parts", parts),
    ("solvers", solvers),
    ("interface", interfaces),
];

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(at) = arguments.iter().position(|argument| argument == "--count") {
        let number = |i: usize| arguments[at + i].parse().expect("a number");
        let (cells, stages, times) = (number(1), number(2), number(3));
        let part = arguments[at + 4].as_str();
        match arguments[at + 5].as_str() {
            "plane" => Linear::<2, 1>::new(cells, stages, false).count(part, times),
            "space" => Linear::<3, 3>::new(cells, stages, false).count(part, times),
            "steps-in-space" | "steps-in-a-plane" => {
                let mut whole = Whole::new(&arguments[at + 5], cells);
                for _ in 0..times {
                    black_box(whole.step());
                }
            }
            "extensible" => Linear::<3, 3>::new(cells, stages, true).count(part, times),
            _ => {
                let mut iteration = Iteration::new(cells, stages);
                for _ in 0..times {
                    PHASES
                        .iter()
                        .filter(|phase| part == "all" || part == **phase)
                        .for_each(|phase| iteration.run(phase));
                }
            }
        }
        return;
    }

    // cargo itself adds `--bench`
    let named: Vec<&str> =
        arguments[1..].iter().map(String::as_str).filter(|argument| !argument.starts_with("--")).collect();
    for name in named.iter().filter(|name| TABLES.iter().all(|(table, _)| table != *name)) {
        eprintln!("no table {name}; there are {}", TABLES.map(|(table, _)| table).join(", "));
    }
    for (name, table) in TABLES {
        if named.is_empty() || named.contains(&name) {
            table();
        }
    }
}
