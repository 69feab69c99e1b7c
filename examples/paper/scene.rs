//! A scene: a rod, what holds and loads it, and how it is stepped; and a run of it by one of the methods.

use crate::draw;
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::{Boundary, Support};
use cosserat_rod::energy::Energy;
use cosserat_rod::formulation::Formulation;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::pose::{Row, Section, State};
use cosserat_rod::rate::{self, Options};
use cosserat_rod::rod::Rod;
use cosserat_rod::so3;
use cosserat_rod::stepper::{Diverged, Report, Stepper};
use indicatif::ProgressBar;
use nalgebra::{Complex, Matrix3, Vector3};
use plotters::style::RGBColor;
use std::error::Error;
use std::f64::consts::{PI, TAU};

pub type Vec3 = Vector3<f64>;

/// The paper's, in all examples but one.
pub const SEGMENTS: usize = 100;
/// The paper's Δt, s.
pub const DT: f64 = 1.0 / 30.0;
/// The paper's (α, β, γ) in all examples but one: implicit Euler, for β = 0 and α + γ = 1 always is.
pub const PAPER: Scheme = Scheme { alpha: 0.3, beta: 0.0, gamma: 0.7 };
/// g, m/s².
pub const GRAVITY: f64 = 9.81;

/// One of the paper's experiments.
pub struct Scene {
    pub rod: Rod,
    pub mesh: Mesh,
    /// What acts on it over time, s.
    pub boundary: Box<dyn Fn(f64) -> Boundary>,
    pub start: Start,
    pub scheme: Scheme,
    /// s.
    pub dt: f64,
    pub steps: usize,
    /// A frame is kept every so many steps.
    pub every: usize,
}

/// How the rod is before time 0; at rest in either case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Unstressed.
    Unstressed,
    /// In equilibrium with what acts on it at time 0.
    Equilibrium,
}

impl Scene {
    /// `duration` s in steps of `dt`.
    pub fn steps_in(duration: f64, dt: f64) -> usize {
        (duration / dt).round() as usize
    }

    /// Work it takes, in steps of a cell.
    pub fn work(&self) -> u64 {
        (self.steps * self.mesh.cells.len()) as u64
    }

    /// The rod of the pose formulation before time 0.
    pub fn rod_at_start(&self) -> Result<Stepper, Diverged> {
        let boundary = (self.boundary)(0.0);
        let state = State::at_rest_shape(&self.mesh, &boundary.base);
        let mut stepper = Stepper::new(self.mesh.clone(), self.rod.clone(), state);
        if self.start == Start::Equilibrium {
            stepper.equilibrium(&boundary)?;
        }
        Ok(stepper)
    }

    /// Steps the rod by `method` to the end, or to where the method is lost.
    pub fn run(&self, method: &Method, bar: &ProgressBar) -> Result<Run, Box<dyn Error>> {
        let mut rod = (method.begin)(self)?;
        let mut run = Run { frames: vec![self.frame(&*rod, 0.0)], steps: 0, iterations: 0, lost: None };
        for i in 1..=self.steps {
            let time = i as f64 * self.dt;
            match rod.step(&(self.boundary)(time), self.scheme, self.dt) {
                Ok(report) => run.iterations += report.iterations,
                Err(diverged) => {
                    run.lost = Some(diverged);
                    bar.inc(((self.steps - i + 1) * self.mesh.cells.len()) as u64);
                    break;
                }
            }
            run.steps = i;
            if i % self.every == 0 {
                run.frames.push(self.frame(&*rod, time));
            }
            bar.inc(self.mesh.cells.len() as u64);
        }
        Ok(run)
    }

    fn frame(&self, rod: &dyn Formulation, time: f64) -> Frame {
        let sections: Vec<Section> = (0..rod.nodes()).map(|j| rod.section(j)).collect();
        let gravity = (self.boundary)(time).gravity;
        Frame {
            time,
            centreline: sections.iter().map(|section| section.position).collect(),
            rotations: sections.iter().map(|section| section.rotation).collect(),
            base_force: sections[0].force,
            tip_force: rod.tip().force,
            energy: rod.energy(&gravity),
        }
    }
}

/// The rod at an instant.
#[derive(Default)]
pub struct Frame {
    pub time: f64,
    /// r at the nodes.
    pub centreline: Vec<Vec3>,
    /// R at the nodes.
    pub rotations: Vec<Matrix3<f64>>,
    /// n at the base.
    pub base_force: Vec3,
    /// n at the tip.
    pub tip_force: Vec3,
    pub energy: Energy,
}

impl Frame {
    pub fn tip(&self) -> Vec3 {
        self.centreline[self.centreline.len() - 1]
    }
}

/// ∫κ₃ ds, rad.
pub fn twist(frame: &Frame) -> f64 {
    frame.rotations.windows(2).map(|pair| so3::log(&pair[0].tr_mul(&pair[1])).z).sum()
}

/// What came of a scene.
pub struct Run {
    /// From time 0 on.
    pub frames: Vec<Frame>,
    /// Steps done.
    pub steps: usize,
    /// Newton iterations of all steps.
    pub iterations: usize,
    /// Why it ended early.
    pub lost: Option<Diverged>,
}

impl Run {
    /// The frame nearest to `time`.
    pub fn at(&self, time: f64) -> &Frame {
        let after = self.frames.partition_point(|frame| frame.time < time).min(self.frames.len() - 1);
        let before = after.saturating_sub(1);
        let distance = |k: usize| (self.frames[k].time - time).abs();
        &self.frames[if distance(before) < distance(after) { before } else { after }]
    }

    /// Of the time, a number of every frame.
    pub fn curve(&self, number: impl Fn(&Frame) -> f64) -> Vec<(f64, f64)> {
        self.frames.iter().map(|frame| (frame.time, number(frame))).collect()
    }

    /// Newton iterations per step, and whether it got to the end.
    pub fn newton(&self) -> String {
        let mean = self.iterations as f64 / self.steps.max(1) as f64;
        match self.lost {
            None => format!("{mean:.1}"),
            Some(_) => format!("{mean:.1}, lost in step {}", self.steps + 1),
        }
    }
}

/// A rod before time 0, in one formulation or the other.
type Begun = Result<Box<dyn Formulation>, Box<dyn Error>>;

/// A way to step a rod.
pub struct Method {
    pub name: &'static str,
    /// The rod of a scene before time 0.
    begin: fn(&Scene) -> Begun,
}

/// The unit's way: where a step would not resolve the motion, the scheme gives way to one that always goes through.
pub const POSE: Method = Method {
    name: "pose",
    begin: |scene| {
        let mut stepper = scene.rod_at_start()?;
        stepper.start(&(scene.boundary)(0.0))?;
        Ok(Box::new(stepper))
    },
};

/// The pose formulation with the scheme as it is asked for, whatever comes of it: where the scheme is the subject.
pub const PLAIN: Method = Method {
    name: "pose, no net",
    begin: |scene| {
        let mut stepper = scene.rod_at_start()?;
        stepper.start(&(scene.boundary)(0.0))?;
        Ok(Box::new(ByRow { stepper, row: Row::Rotations }))
    },
};

/// The paper's formulation, line by line.
pub const AS_PRINTED: Method = Method { name: "as printed", begin: |scene| rate_from(scene, Options::AS_PRINTED) };

/// The same with what it takes to be second order, quadratic in Newton, and without drift.
pub const MENDED: Method = Method { name: "mended", begin: |scene| rate_from(scene, Options::MENDED) };

/// The methods that every example is run with.
pub const METHODS: [&Method; 3] = [&AS_PRINTED, &MENDED, &POSE];

fn rate_from(scene: &Scene, options: Options) -> Begun {
    let (mesh, rod, boundary) = (scene.mesh.clone(), scene.rod.clone(), (scene.boundary)(0.0));
    let stepper = match scene.start {
        Start::Unstressed => rate::Stepper::new(mesh, rod, &boundary, options)?,
        Start::Equilibrium => {
            rate::Stepper::from_sections(mesh, rod, &boundary, options, &scene.rod_at_start()?.state.nodes)?
        }
    };
    Ok(Box::new(stepper))
}

/// One scene, one method, and how the run is named and drawn.
pub struct Case {
    pub name: String,
    pub method: &'static Method,
    pub scene: Scene,
    /// `None`: not drawn.
    pub color: Option<RGBColor>,
}

/// A reference with `finer` steps in each of the paper's, then every method with the paper's scheme and with one of
/// second order; `scene` takes the scheme and the steps in one of the paper's.
pub fn cases(scene: impl Fn(Scheme, usize) -> Scene, paper: Scheme, finer: usize) -> Vec<Case> {
    let half = Scheme::from_spectral_radius(0.5);
    let reference = Case {
        name: format!("reference, Δt/{finer}"),
        method: &PLAIN,
        scene: scene(half, finer),
        color: Some(draw::GREY),
    };
    let colors = [(Some(draw::ORANGE), None), (Some(draw::GREEN), None), (Some(draw::RED), Some(draw::BLUE))];
    let pairs = METHODS.into_iter().zip(colors).flat_map(|(method, (first, second))| {
        let case = |what: String, scheme, color| Case {
            name: format!("{}, {what}", method.name),
            method,
            scene: scene(scheme, 1),
            color,
        };
        [case(name(paper), paper, first), case("ρ∞ = 0.5".to_owned(), half, second)]
    });
    std::iter::once(reference).chain(pairs).collect()
}

/// Runs them all, one after the other.
pub fn run_all(cases: &[Case], bar: &ProgressBar) -> Result<Vec<Run>, Box<dyn Error>> {
    bar.set_length(cases.iter().map(|case| case.scene.work()).sum());
    cases.iter().map(|case| case.scene.run(case.method, bar)).collect()
}

/// A number of every frame over time, of every run that is drawn.
pub fn curves(cases: &[Case], runs: &[Run], number: impl Fn(&Frame) -> f64) -> Vec<draw::Curve> {
    let curve = |(case, run): (&Case, &Run)| {
        case.color.map(|color| draw::Curve::new(case.name.clone(), color, run.curve(&number)))
    };
    cases.iter().zip(runs).filter_map(curve).collect()
}

/// The pose formulation with one of its acceleration rows, whatever comes.
pub struct ByRow {
    pub stepper: Stepper,
    pub row: Row,
}

impl Formulation for ByRow {
    fn step(&mut self, boundary: &Boundary, scheme: Scheme, dt: f64) -> Result<Report, Diverged> {
        self.stepper.step(boundary, scheme, dt, self.row)
    }

    fn nodes(&self) -> usize {
        self.stepper.nodes()
    }

    fn section(&self, j: usize) -> Section {
        self.stepper.section(j)
    }

    fn energy(&self, gravity: &Vec3) -> Energy {
        Formulation::energy(&self.stepper, gravity)
    }
}

/// A scheme in the paper's words.
pub fn name(scheme: Scheme) -> String {
    let Scheme { alpha, beta, gamma } = scheme;
    let short = |x: f64| format!("{}", (x * 1e3).round() / 1e3);
    format!("({}, {}, {})", short(alpha), short(beta), short(gamma)).replace('-', "−")
}

/// The larger growth per step |ζ| of an oscillation at ω under a scheme: the roots of
/// (ζ−1)((1−α)ζ+α) = iωΔt ((1−β)ζ+β)(γζ+1−γ), which is eqs 17 and 19 for v = iωx.
pub fn growth(scheme: Scheme, omega_dt: f64) -> f64 {
    let Scheme { alpha, beta, gamma } = scheme;
    let z = Complex::new(0.0, omega_dt);
    let a = Complex::from(1.0 - alpha) - z * ((1.0 - beta) * gamma);
    let b = Complex::from(2.0 * alpha - 1.0) - z * ((1.0 - beta) * (1.0 - gamma) + beta * gamma);
    let c = Complex::from(-alpha) - z * (beta * (1.0 - gamma));
    let root = (b * b - a * c * 4.0).sqrt();
    let size = |sign: f64| ((root * sign - b) / (a * 2.0)).norm();
    size(1.0).max(size(-1.0))
}

/// The shape r = (a cos φ, a sin φ, c φ) about an axis.
#[derive(Clone, Copy)]
pub struct Helix {
    /// a, m.
    pub radius: f64,
    /// 2πc, m.
    pub pitch: f64,
    /// Arc length of the wire, m.
    pub length: f64,
}

impl Helix {
    /// Arc length per rad, m.
    fn per_angle(&self) -> f64 {
        self.radius.hypot(self.pitch / TAU)
    }

    pub fn turns(&self) -> f64 {
        self.length / (TAU * self.per_angle())
    }

    /// κ̂, the same everywhere: d₁ points at the axis.
    pub fn kappa_rest(&self) -> Vec3 {
        Vec3::new(0.0, self.radius, self.pitch / TAU) / self.per_angle().powi(2)
    }

    /// A clamp for its start; the axis leads from the origin along `axis`, and the start is off it towards `out`.
    pub fn support(&self, axis: Vec3, out: Vec3) -> Support {
        let tangent = (axis.cross(&out) * self.radius + axis * (self.pitch / TAU)) / self.per_angle();
        let rotation = Matrix3::from_columns(&[-out, tangent.cross(&-out), tangent]);
        Support::at_rest(out * self.radius, rotation)
    }
}

/// R(0) of a rod that leaves its base along +x, d₂ along +y.
pub fn along_x() -> Matrix3<f64> {
    Matrix3::from_columns(&[-Vec3::z(), Vec3::y(), Vec3::x()])
}

/// Clamped along x, free at the tip, under gravity.
pub fn horizontal() -> Boundary {
    Boundary::hanging_from(Support::at_rest(Vec3::zeros(), along_x()), -Vec3::z() * GRAVITY)
}

/// The same rod with the compliances of its round section to shear and stretch, 1/GA, 1/GA, 1/EA: from K = (EI, EI, 2GI)
/// and ρI/ρA = I/A.
pub fn compliant(rod: &Rod) -> Rod {
    let gyration = rod.inertia_per_length.x / rod.mass_per_length;
    let (stretch, shear) = (gyration / rod.stiffness.x, 2.0 * gyration / rod.stiffness.z);
    Rod { compliance: Vec3::new(shear, shear, stretch), ..rod.clone() }
}

/// Soft rubber, for what the paper leaves open: thick enough to be seen moving.
pub fn rubber(radius: f64, youngs_modulus: f64) -> Rod {
    Rod::circular(radius, youngs_modulus, youngs_modulus / 3.0, 1100.0)
}

/// A hair of keratin, of the section and moduli of the paper's example: A = 1.5e-5 cm².
pub fn keratin() -> Rod {
    Rod::circular((1.5e-9 / PI).sqrt(), 3.89e9, 0.89e9, 1320.0)
}

/// Spring wire.
pub fn steel(radius: f64) -> Rod {
    Rod::circular(radius, 206e9, 79.3e9, 7850.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_has_its_closed_forms() {
        for omega_dt in [1e-3, 0.1, 1.0, 10.0, 1e3] {
            let euler = 1.0 / f64::hypot(1.0, omega_dt);
            // a root of (0.3, 0, 0.7) is that of implicit Euler; the other, −3/7, multiplies what nothing starts
            assert!((growth(PAPER, omega_dt) - euler.max(3.0 / 7.0)).abs() < 1e-12, "{omega_dt}");
            assert!((growth(Scheme::BACKWARD_EULER, omega_dt) - euler).abs() < 1e-12, "{omega_dt}");
            assert!((growth(Scheme::from_spectral_radius(1.0), omega_dt) - 1.0).abs() < 1e-12, "{omega_dt}");
        }
        for radius in [0.3, 0.5, 0.8] {
            // a double root there: what is left of ωΔt enters with its square root
            assert!((growth(Scheme::from_spectral_radius(radius), 1e8) - radius).abs() < 1e-3, "{radius}");
        }
    }

    #[test]
    fn schemes_are_named_in_the_papers_words() {
        assert_eq!(name(Scheme::from_spectral_radius(0.0)), "(−0.5, 0, 1)");
        assert_eq!(name(Scheme::from_spectral_radius(0.5)), "(0.167, 0.333, 0.667)");
    }

    #[test]
    fn a_helix_is_that_of_its_pose_and_curvature() {
        let helix = Helix { radius: 0.03, pitch: 0.02, length: 0.5 };
        let base = helix.support(Vec3::z(), Vec3::x());
        // eq 23 along it, finely: it comes by where the formula says
        let mesh = Mesh::uniform(helix.length, 2000, 1, helix.kappa_rest());
        for node in State::at_rest_shape(&mesh, &base).nodes.iter().step_by(500) {
            let (x, y, z) = (node.position.x, node.position.y, node.position.z);
            let angle = TAU * z / helix.pitch;
            // the midpoint of a cell is off its mean tangent by (κh)²/24 = 3e-6, and that turns with the helix
            let exact = Vec3::new(helix.radius * angle.cos(), helix.radius * angle.sin(), z);
            assert!((Vec3::new(x, y, z) - exact).norm() < 1e-6, "{}", node.position);
        }
        assert!((helix.turns() - helix.length / (TAU * 0.03f64).hypot(0.02)).abs() < 1e-12);
    }

    #[test]
    fn a_run_is_read_at_the_frame_nearest_in_time() {
        let frame = |time| Frame { time, ..Frame::default() };
        let run = Run { frames: [0.0, 1.0, 2.0].map(frame).into(), steps: 2, iterations: 7, lost: None };
        let found = [-1.0, 0.4, 0.6, 1.4, 9.0].map(|time| run.at(time).time);
        assert_eq!(found, [0.0, 0.0, 1.0, 1.0, 2.0]);
        assert_eq!(run.newton(), "3.5");
    }
}
