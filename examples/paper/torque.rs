//! Example 3: a straight rod of 45 cm under an end torque that changes with time.
//!
//! Chosen here: a rubber rod of radius 5 mm, E = 50 MPa, without gravity; the torque grows by M (1 − cos πt/T)/2 to
//! M = 0.6π EI/L in T = 3 s and is held for 3 s. Its direction is fixed in space, 60° from the rod, so that it twists and
//! bends. A torque without a force is the same along the rod, so the tangent turns about it at the rate M/EI: the
//! rod at rest is a helix of known shape, its twist (M cos 60°) L/GJ.
//!
//! A torque fixed in space is no conservative load: a rod without damping flutters under any (Nikolai 1928). So do the
//! reference and the second-order schemes; the damping of implicit Euler holds the paper's rod at the equilibrium.

use crate::draw::{self, Axes, Curve, Eye, Picture, Space, Strand};
use crate::report::{self, Example, Numbers};
use crate::scene::{self, Case, DT, PAPER, SEGMENTS, Scene, Start, Vec3};
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::{Boundary, Support};
use cosserat_rod::mesh::Mesh;
use indicatif::ProgressBar;
use nalgebra::Matrix3;
use plotters::style::text_anchor::HPos;
use std::error::Error;
use std::f64::consts::{PI, TAU};

const LENGTH: f64 = 0.45;
const RADIUS: f64 = 5e-3;
const YOUNG: f64 = 50e6;
/// Between the rod and the torque, rad.
const INCLINATION: f64 = PI / 3.0;
/// M L/EI.
const TURN: f64 = 0.3 * TAU;
const RISE: f64 = 3.0;
const DURATION: f64 = 6.0;
/// The run whose shapes are drawn: the pose formulation with the paper's scheme.
const SHOWN: usize = 5;
/// Steps of the reference in one of the paper's.
const FINER: usize = 32;

/// Direction of the torque; the rod begins along x.
fn axis() -> Vec3 {
    Vec3::new(INCLINATION.cos(), 0.0, INCLINATION.sin())
}

/// The part of the full torque at a time.
fn part(time: f64) -> f64 {
    0.5 * (1.0 - (PI * (time / RISE).min(1.0)).cos())
}

fn scene(scheme: Scheme, finer: usize) -> Scene {
    let dt = DT / finer as f64;
    let rod = scene::rubber(RADIUS, YOUNG);
    let torque = axis() * (TURN * rod.stiffness[0] / LENGTH);
    let base = Support::at_rest(Vec3::zeros(), scene::along_x());
    let boundary =
        move |time: f64| Boundary { tip_moment: torque * part(time), ..Boundary::hanging_from(base, Vec3::zeros()) };
    Scene {
        rod,
        mesh: Mesh::uniform(LENGTH, SEGMENTS, 1, Vec3::zeros()),
        boundary: Box::new(boundary),
        start: Start::Unstressed,
        scheme,
        dt,
        steps: Scene::steps_in(DURATION, dt),
        every: finer.div_ceil(8),
    }
}

/// The tip of the helix at rest.
fn tip_at_rest() -> Vec3 {
    let (along, axis) = (Vec3::x(), axis());
    let parallel = axis * axis.dot(&along);
    LENGTH * (parallel + (along - parallel) * (TURN.sin() / TURN) + axis.cross(&along) * ((1.0 - TURN.cos()) / TURN))
}

pub fn run(bar: &ProgressBar) -> Result<Example, Box<dyn Error>> {
    let cases = scene::cases(scene, PAPER, FINER);
    let runs = scene::run_all(&cases, bar)?;

    let stiffness = cases[0].scene.rod.stiffness;
    let quasi_static = move |time: f64| part(time) * TURN * stiffness[0] * INCLINATION.cos() / stiffness[2];
    let mut numbers = Numbers {
        chosen: vec![format!(
            "rubber, 45 cm, radius {} mm, E = {} MPa; torque to {:.3} N·m; 100 box cells, Δt = 1/30 s",
            RADIUS * 1e3,
            YOUNG / 1e6,
            TURN * stiffness[0] / LENGTH
        )],
        head: report::head(&[
            "run",
            "tip twist at the end, rad",
            "M cos 60° L/GJ, rad",
            "tip off the helix, mm",
            "Newton per step",
        ]),
        rows: Vec::new(),
    };
    for (Case { name, .. }, run) in cases.iter().zip(&runs) {
        let end = run.at(DURATION);
        numbers.rows.push(vec![
            name.clone(),
            format!("{:.4}", scene::twist(end)),
            format!("{:.4}", quasi_static(DURATION)),
            format!("{:.2}", (end.tip() - tip_at_rest()).norm() * 1e3),
            run.newton(),
        ]);
    }

    let picture = Picture::new(900, "3  Straight rod under an end torque", &numbers.chosen[0], |area| {
        let (width, height) = draw::size(area);
        let above = draw::part(area, (0.0, 0.0), (width, 360.0));
        let mut strands = Vec::new();
        for k in [0, 6, 9, 12, 15, 20, 30] {
            let time = f64::from(k) * 0.1;
            let frame = runs[SHOWN].at(time);
            let points = frame.centreline.clone();
            strands.push(Strand { points, color: draw::time_color(time / RISE), width: 6.0, rim: true });
            // a stripe painted on it shows the twist
            let stripe = |(r, rotation): (&Vec3, &Matrix3<f64>)| r + rotation.column(0) * RADIUS;
            let points = frame.centreline.iter().zip(&frame.rotations).map(stripe).collect();
            strands.push(Strand { points, color: draw::INK, width: 1.2, rim: false });
        }
        let base = (cases[0].scene.boundary)(0.0).base;
        draw::space(
            &above,
            &Space {
                eye: Eye { azimuth: -60.0, elevation: 20.0 },
                strands: &strands,
                clamps: &[(base.position, base.rotation, 0.02)],
                ways: &[],
                floor: None,
            },
        )?;
        draw::time_bar(&above, (30.0, 8.0), 170.0, RISE)?;
        draw::text(&above, "the paper's scheme, with a painted stripe", (30.0, 50.0), 14.0, draw::INK, HPos::Left)?;
        let below = draw::part(area, (0.0, 360.0), (width, height - 360.0));
        let mut curves = vec![Curve {
            width: 6.0,
            ..Curve::new("quasi-static, M cos 60° L/GJ", draw::PALE, runs[0].curve(|frame| quasi_static(frame.time)))
        }];
        curves.extend(scene::curves(&cases, &runs, scene::twist));
        let axes = Axes { y: Some((-6.0, 6.0)), ..Axes::linear("twist of the tip, rad", "time, s") };
        draw::chart(&below, axes, &curves)
    })?;
    Ok(Example { name: "3-torque", picture, numbers })
}
