//! Example 1: a sine-shaped rod is released under gravity from the horizontal, without damping.
//!
//! The paper's (0.3, 0, 0.7) is implicit Euler, so there is damping, of the scheme: the example shows how much. Chosen
//! here: a rubber rod of 1 m, 5 mm in radius, E = 50 MPa, whose tangent turns by 0.9 cos(4πs/L) rad about the vertical;
//! 2 s of motion. The reference is the same mesh at 1/64 of the step.

use crate::draw::{self, Axes, Eye, Picture, Space, Strand};
use crate::report::{self, Example, Numbers};
use crate::scene::{self, Case, DT, GRAVITY, PAPER, PLAIN, Run, SEGMENTS, Scene, Start, Vec3};
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::{Boundary, Support};
use cosserat_rod::mesh::Mesh;
use indicatif::ProgressBar;
use nalgebra::Matrix3;
use plotters::style::text_anchor::HPos;
use std::error::Error;
use std::f64::consts::TAU;

const LENGTH: f64 = 1.0;
const RADIUS: f64 = 5e-3;
const YOUNG: f64 = 50e6;
/// Largest angle between the rod and its axis, rad.
const SWING: f64 = 0.9;
const WAVES: f64 = 2.0;
const DURATION: f64 = 2.0;
/// The last shape in the picture, s.
const SHOWN: f64 = 0.8;
/// Steps of the reference in one of the paper's.
const FINER: usize = 64;

fn scene(scheme: Scheme, finer: usize) -> Scene {
    let wave = WAVES * TAU / LENGTH;
    let nodes: Vec<f64> = (0..=SEGMENTS).map(|j| LENGTH * j as f64 / SEGMENTS as f64).collect();
    // θ = SWING cos(wave s), about d₂, which is up
    let mesh = Mesh::graded(&nodes, 1, |s| Vec3::new(0.0, -SWING * wave * (wave * s).sin(), 0.0));
    let along = Vec3::new(SWING.cos(), SWING.sin(), 0.0);
    let rotation = Matrix3::from_columns(&[Vec3::z().cross(&along), Vec3::z(), along]);
    let boundary = Boundary::hanging_from(Support::at_rest(Vec3::zeros(), rotation), -Vec3::z() * GRAVITY);
    let dt = DT / finer as f64;
    Scene {
        rod: scene::rubber(RADIUS, YOUNG),
        mesh,
        boundary: Box::new(move |_| boundary),
        start: Start::Unstressed,
        scheme,
        dt,
        steps: Scene::steps_in(DURATION, dt),
        every: finer.div_ceil(8),
    }
}

pub fn run(bar: &ProgressBar) -> Result<Example, Box<dyn Error>> {
    let mut cases = scene::cases(scene, PAPER, FINER);
    for rho in [0.5, 1.0] {
        cases.push(Case {
            name: format!("{}, ρ∞ = {rho}", PLAIN.name),
            method: &PLAIN,
            scene: scene(Scheme::from_spectral_radius(rho), 1),
            color: (rho == 1.0).then_some(draw::VIOLET),
        });
    }
    let runs = scene::run_all(&cases, bar)?;

    // what the fall can give is what lies between the release and the equilibrium
    let first = &cases[0].scene;
    let mut hanging = first.rod_at_start()?;
    hanging.equilibrium(&(first.boundary)(0.0))?;
    let rest = cosserat_rod::formulation::Formulation::energy(&hanging, &(first.boundary)(0.0).gravity).total();
    let released = runs[0].frames[0].energy.total();
    let part = |energy: f64| (energy - rest) / (released - rest);
    let back = first_return(&runs[0]);

    let mut numbers = Numbers {
        chosen: vec![
            format!(
                "rubber, {LENGTH} m, radius {} mm, E = {} MPa; 100 box cells, Δt = 1/30 s",
                RADIUS * 1e3,
                YOUNG / 1e6
            ),
            format!("the rod is back from its first swing at {back:.2} s of the reference"),
        ],
        head: report::head(&["run", "energy kept at the return", "at the end", "tip error RMS, mm", "Newton per step"]),
        rows: Vec::new(),
    };
    for (Case { name, .. }, run) in cases.iter().zip(&runs) {
        let compared: Vec<f64> =
            run.frames.iter().map(|frame| (frame.tip() - runs[0].at(frame.time).tip()).norm_squared()).collect();
        let error = (compared.iter().sum::<f64>() / compared.len() as f64).sqrt();
        let kept = |time: f64| format!("{:.3}", part(run.at(time).energy.total()));
        numbers.rows.push(vec![name.clone(), kept(back), kept(DURATION), format!("{:.1}", error * 1e3), run.newton()]);
    }

    let picture = Picture::new(900, "1  Sine-shaped rod released under gravity", &numbers.chosen[0], |area| {
        let (width, height) = draw::size(area);
        let above = draw::part(area, (0.0, 0.0), (width, 330.0));
        let strands: Vec<Strand> = (0..=8)
            .map(|k| {
                let time = k as f64 * 0.1;
                let points = runs[0].at(time).centreline.clone();
                Strand { points, color: draw::time_color(time / SHOWN), width: 4.0, rim: true }
            })
            .collect();
        let support = (first.boundary)(0.0).base;
        draw::space(
            &above,
            &Space {
                eye: Eye { azimuth: -62.0, elevation: 26.0 },
                strands: &strands,
                clamps: &[(support.position, support.rotation, 0.035)],
                ways: &[],
                floor: Some((0.08, 0.1)),
            },
        )?;
        draw::time_bar(&above, (30.0, 20.0), 170.0, SHOWN)?;
        draw::text(&above, "the reference every 0.1 s", (30.0, 62.0), 14.0, draw::INK, HPos::Left)?;
        let below = draw::part(area, (0.0, 330.0), (width, height - 330.0));
        let curves = scene::curves(&cases, &runs, |frame| part(frame.energy.total()));
        let title = "energy above the equilibrium, as part of that at the release";
        draw::chart(&below, Axes { y: Some((0.0, 1.1)), ..Axes::linear(title, "time, s") }, &curves)
    })?;
    Ok(Example { name: "1-sine", picture, numbers })
}

/// When the rod is highest again after it has been lowest, by the height of its centre of mass.
fn first_return(run: &Run) -> f64 {
    let heights = run.curve(|frame| frame.energy.gravity);
    let turn = |from: usize, sign: f64| {
        (from + 1..heights.len() - 1)
            .find(|&k| sign * (heights[k + 1].1 - heights[k].1) > 0.0)
            .unwrap_or(heights.len() - 1)
    };
    heights[turn(turn(0, 1.0), -1.0)].0
}
