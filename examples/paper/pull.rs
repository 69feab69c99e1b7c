//! Example 6: a hair tress of 25 cm, one guide of keratin and 180 interpolated fibres, is drawn out by its end at
//! constant velocity, to 30 % more than the length of its bounding box, and snaps back.
//!
//! The paper's boundary values hold the section at the tip, λ (d₁₃, d₂₃, d₃₃) being λ e_z in its frame, and no spin.
//! λ = −2.0 has no unit there; its moduli are in CGS, so it is read as 2 cm/s downwards. Chosen here: the tress of
//! `tress.rs` hangs in equilibrium with its tip held where that is without load, until it is drawn.

use crate::draw::{self, Axes, Curve, Eye, Picture, Space};
use crate::report::{self, Example, Numbers};
use crate::scene::{self, Case, DT, Frame, GRAVITY, METHODS, PAPER, Run, Scene, Start, Vec3};
use crate::tress;
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::{Boundary, Support};
use cosserat_rod::pose::State;
use indicatif::ProgressBar;
use plotters::style::text_anchor::HPos;
use std::error::Error;

/// λ, m/s.
const SPEED: f64 = -0.02;
/// Of the length of the bounding box.
const EXTENSION: f64 = 0.3;
/// After the release, s.
const AFTER: f64 = 1.5;

/// The base, the tip of the unloaded tress, and its height.
fn ends() -> (Support, Support, f64) {
    let base = tress::CURL.support(-Vec3::z(), Vec3::y());
    let state = State::at_rest_shape(&tress::mesh(), &base);
    let tip = state.tip();
    (base, Support::at_rest(tip.position, tip.rotation), -tip.position.z)
}

/// When the tip is let go, s.
fn release() -> f64 {
    let (.., height) = ends();
    EXTENSION * height / -SPEED
}

fn scene(scheme: Scheme) -> Scene {
    let (base, tip, _) = ends();
    let release = release();
    let hanging = Boundary::hanging_from(base, -Vec3::z() * GRAVITY);
    let boundary = move |time: f64| match time {
        0.0 => Boundary { tip, ..hanging },
        time if time < release => {
            let (position, velocity) = (tip.position + Vec3::z() * (SPEED * time), Vec3::z() * SPEED);
            Boundary { tip: Support { position, velocity, ..tip }, ..hanging }
        }
        _ => hanging,
    };
    Scene {
        rod: scene::keratin(),
        mesh: tress::mesh(),
        boundary: Box::new(boundary),
        start: Start::Equilibrium,
        scheme,
        dt: DT,
        steps: Scene::steps_in(release + AFTER, DT),
        every: 1,
    }
}

/// The force that draws the tip, N, downwards.
fn pull(frame: &Frame) -> f64 {
    -frame.tip_force.z
}

pub fn run(bar: &ProgressBar) -> Result<Example, Box<dyn Error>> {
    let half = Scheme::from_spectral_radius(0.5);
    let cases: Vec<Case> = METHODS
        .into_iter()
        .zip([draw::ORANGE, draw::GREEN, draw::RED])
        .flat_map(|(method, color)| [(PAPER, Some(color)), (half, None)].map(|(scheme, color)| (method, scheme, color)))
        .map(|(method, scheme, color)| {
            let what = if scheme == half { "ρ∞ = 0.5".to_owned() } else { scene::name(scheme) };
            Case { name: format!("{}, {what}", method.name), method, scene: scene(scheme), color }
        })
        .collect();
    let runs = scene::run_all(&cases, bar)?;

    let (.., height) = ends();
    // the last moment before the release
    let drawn = ((release() / DT).ceil() - 1.0) * DT;
    let mut held = cases[0].scene.rod_at_start()?;
    held.equilibrium(&(cases[0].scene.boundary)(drawn))?;
    let mut numbers = Numbers {
        chosen: vec![
            format!(
                "keratin, 25 cm, curled to radius {} mm and pitch {} cm; drawn by {} cm/s; 100 box cells, Δt = 1/30 s",
                tress::CURL.radius * 1e3,
                tress::CURL.pitch * 1e2,
                -SPEED * 1e2
            ),
            format!("{:.2} cm long without load, let go at {:.2} s", height * 1e2, release()),
            format!("pull before the release in equilibrium: {:.2} µN", -held.state.tip().force.z * 1e6),
        ],
        head: report::head(&[
            "run",
            "pull before the release, µN",
            "length after 0.1 s, cm",
            "at the end, cm",
            "Newton per step",
        ]),
        rows: Vec::new(),
    };
    for (Case { name, .. }, run) in cases.iter().zip(&runs) {
        let length = |time: f64| format!("{:.2}", -run.at(time).tip().z * 1e2);
        let pull = format!("{:.2}", pull(run.at(drawn)) * 1e6);
        numbers.rows.push(vec![name.clone(), pull, length(release() + 0.1), length(release() + AFTER), run.newton()]);
    }

    let shown = &runs[2 * METHODS.len() - 2];
    let picture = Picture::new(1350, "6  Hair tress, drawn out and let go", &numbers.chosen[0], |area| {
        let (_, page) = draw::size(area);
        let times = [0.0, 0.5 * drawn, drawn, drawn + DT, drawn + 2.0 * DT, drawn + 4.0 * DT, drawn + 45.0 * DT];
        shapes(&draw::part(area, (0.0, 0.0), (830.0, page)), shown, &times)?;
        let curves: Vec<Curve> = scene::curves(&cases, &runs, |frame| -frame.tip().z * 1e2);
        let place = |top: f64| draw::part(area, (830.0, top), (520.0, 0.5 * page - 4.0));
        let axes = Axes { y: Some((16.0, 24.0)), ..Axes::linear("length of the tress, cm", "time, s") };
        draw::chart(&place(0.0), axes, &curves)?;
        let axes = Axes { y: Some((-2.0, 4.0)), ..Axes::linear("pull at the tip of a hair, µN", "time, s") };
        draw::chart(&place(0.5 * page), axes, &scene::curves(&cases, &runs, |frame| pull(frame) * 1e6))
    })?;
    Ok(Example { name: "6-pull", picture, numbers })
}

/// The tress at these times, side by side.
fn shapes(area: &draw::Area<'_>, run: &Run, times: &[f64]) -> draw::Fallible {
    let (width, height) = draw::size(area);
    let apart = 0.045;
    let side = |k: usize| Vec3::new(apart * k as f64, 0.0, 0.0);
    let strands: Vec<_> = times
        .iter()
        .enumerate()
        .flat_map(|(k, &time)| {
            let color = draw::time_color(k as f64 / times.len() as f64);
            tress::strands(run.at(time), color, side(k))
        })
        .collect();
    let base = ends().0;
    let clamps: Vec<_> = (0..times.len()).map(|k| (base.position + side(k), base.rotation, 0.01)).collect();
    let eye = Eye { azimuth: -90.0, elevation: 4.0 };
    let inner = draw::part(area, (0.0, 24.0), (width, height - 24.0));
    draw::space(&inner, &Space { eye, strands: &strands, clamps: &clamps, ways: &[], floor: None })?;
    let times: Vec<String> = times.iter().map(|time| format!("{time:.2}")).collect();
    let caption = format!("pose, the paper's scheme, at {} s", times.join(", "));
    draw::text(area, &caption, (26.0, 10.0), 15.0, draw::INK, HPos::Left)
}
