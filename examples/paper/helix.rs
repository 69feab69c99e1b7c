//! Example 2: a helical rod of 30 cm, highly damped by (0.4, 0, 1), under an end load that changes with time.
//!
//! Chosen here: a rubber rod of radius 1.5 mm, E = 5 MPa, wound on a radius of 1 cm in four turns, without gravity; the
//! load pulls the end of the wire, not the axis, down by F (1 − cos 2πt/T)/2 with F = 20 mN and T = 1 s, for 4 s.
//!
//! The extension under a small load has a closed form, Castigliano's: the tip goes by ∫ m·∂m/∂F / K ds with the moment
//! m = (r(L) − r) × F along the unloaded helix.

use crate::draw::{self, Axes, Eye, Picture, Space, Strand};
use crate::report::{self, Example, Numbers};
use crate::scene::{self, Case, DT, Helix, Run, SEGMENTS, Scene, Start, Vec3};
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::Boundary;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::stepper::Stepper;
use indicatif::ProgressBar;
use plotters::style::text_anchor::HPos;
use std::error::Error;
use std::f64::consts::TAU;

/// The paper's, for this example only.
const DAMPED: Scheme = Scheme { alpha: 0.4, beta: 0.0, gamma: 1.0 };
const HELIX: Helix = Helix { radius: 0.01, pitch: 0.041, length: 0.3 };
const RADIUS: f64 = 1.5e-3;
const YOUNG: f64 = 5e6;
/// N.
const LOAD: f64 = 0.02;
/// s.
const PERIOD: f64 = 1.0;
const DURATION: f64 = 4.0;
/// The run whose shapes are drawn: the pose formulation with the paper's scheme.
const SHOWN: usize = 5;
/// Steps of the reference in one of the paper's.
const FINER: usize = 32;

fn under(load: f64) -> Boundary {
    let base = HELIX.support(-Vec3::z(), Vec3::x());
    Boundary { tip_force: -Vec3::z() * load, ..Boundary::hanging_from(base, Vec3::zeros()) }
}

fn scene(scheme: Scheme, finer: usize) -> Scene {
    let dt = DT / finer as f64;
    Scene {
        rod: scene::rubber(RADIUS, YOUNG),
        mesh: Mesh::uniform(HELIX.length, SEGMENTS, 1, HELIX.kappa_rest()),
        boundary: Box::new(|time| under(0.5 * LOAD * (1.0 - (TAU * time / PERIOD).cos()))),
        start: Start::Unstressed,
        scheme,
        dt,
        steps: Scene::steps_in(DURATION, dt),
        every: finer.div_ceil(8),
    }
}

/// How far a static load takes the tip down from `free`, m.
fn extension(unloaded: &Stepper, load: f64) -> Result<f64, Box<dyn Error>> {
    let mut pulled = unloaded.clone();
    pulled.equilibrium(&under(load))?;
    Ok(unloaded.state.tip().position.z - pulled.state.tip().position.z)
}

/// The same per load, for a small load, by Castigliano, m/N.
fn castigliano(unloaded: &Stepper) -> f64 {
    let tip = unloaded.state.tip().position;
    let at = |point: &cosserat_rod::pose::Section| {
        let moment = point.rotation.tr_mul(&(tip - point.position).cross(&-Vec3::z()));
        moment.component_mul(&moment).component_div(&unloaded.rod.stiffness).sum()
    };
    unloaded.state.points.iter().map(at).sum::<f64>() * unloaded.mesh.length() / unloaded.mesh.points() as f64
}

pub fn run(bar: &ProgressBar) -> Result<Example, Box<dyn Error>> {
    let cases = scene::cases(scene, DAMPED, FINER);
    let runs = scene::run_all(&cases, bar)?;

    let unloaded = cases[0].scene.rod_at_start()?;
    let mean = 0.5 * LOAD;
    let (small, linear) = (1e-3 * mean, castigliano(&unloaded));
    let mut numbers = Numbers {
        chosen: vec![
            format!(
                "rubber, 30 cm of wire of radius {} mm in {:.1} turns, E = {} MPa; 100 box cells, Δt = 1/30 s",
                RADIUS * 1e3,
                HELIX.turns(),
                YOUNG / 1e6
            ),
            format!(
                "compliance at small loads: statics {:.4} m/N, Castigliano's integral {linear:.4} m/N",
                extension(&unloaded, small)? / small
            ),
            format!(
                "extension under the mean load: statics {:.2} mm, linear {:.2} mm",
                extension(&unloaded, mean)? * 1e3,
                linear * mean * 1e3
            ),
        ],
        head: report::head(&["run", "mean extension, last period, mm", "swing, mm", "Newton per step"]),
        rows: vec![vec![
            "quasi-static".to_owned(),
            String::new(),
            format!("{:.2}", extension(&unloaded, LOAD)? * 0.5e3),
            String::new(),
        ]],
    };
    let start = unloaded.state.tip().position.z;
    let down = |run: &Run| run.curve(|frame| (start - frame.tip().z) * 1e3);
    for (Case { name, .. }, run) in cases.iter().zip(&runs) {
        let last: Vec<f64> =
            down(run).into_iter().filter(|(time, _)| *time > DURATION - PERIOD + 1e-9).map(|(_, z)| z).collect();
        let mean = last.iter().sum::<f64>() / last.len() as f64;
        let (low, high) = last.iter().fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(*z), high.max(*z)));
        let cell = |x: f64| if run.lost.is_none() { format!("{x:.2}") } else { "–".to_owned() };
        numbers.rows.push(vec![name.clone(), cell(mean), cell(0.5 * (high - low)), run.newton()]);
    }

    let picture = Picture::new(900, "2  Helical rod under a changing end load", &numbers.chosen[0], |area| {
        let (width, height) = draw::size(area);
        let left = draw::part(area, (0.0, 0.0), (width, 360.0));
        let times: Vec<f64> = (0..=6).map(|k| DURATION - PERIOD + f64::from(k) * PERIOD / 12.0).collect();
        let side = |k: usize| Vec3::new(0.06 * k as f64, 0.0, 0.0);
        let strands: Vec<Strand> = times
            .iter()
            .enumerate()
            .map(|(k, &time)| Strand {
                points: runs[SHOWN].at(time).centreline.iter().map(|r| r + side(k)).collect(),
                color: draw::time_color(k as f64 / 6.0),
                width: 5.0,
                rim: true,
            })
            .collect();
        let base = under(0.0).base;
        let clamps: Vec<_> = (0..times.len()).map(|k| (base.position + side(k), base.rotation, 0.006)).collect();
        let eye = Eye { azimuth: -80.0, elevation: 12.0 };
        draw::space(&left, &Space { eye, strands: &strands, clamps: &clamps, ways: &[], floor: Some((0.01, 0.03)) })?;
        let caption = "the paper's scheme from the smallest to the largest load, every T/12";
        draw::text(&left, caption, (26.0, 6.0), 14.0, draw::INK, HPos::Left)?;
        let below = draw::part(area, (0.0, 372.0), (width, height - 372.0));
        let curves = scene::curves(&cases, &runs, |frame| (start - frame.tip().z) * 1e3);
        let axes = Axes { y: Some((-5.0, 45.0)), ..Axes::linear("extension, mm", "time, s") };
        draw::chart(&below, axes, &curves)
    })?;
    Ok(Example { name: "2-helix", picture, numbers })
}
