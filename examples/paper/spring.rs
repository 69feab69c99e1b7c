//! Example 4: a coil spring like one of steel, with low damping, is pulled along its axis and released after 0.1 s; on 6
//! to 100 segments, and with steps from 1e-5 to 100 s.
//!
//! Chosen here: steel wire of radius 0.25 mm in five turns on a radius of 5 cm and a pitch of 2 cm, without gravity; a
//! force of 6 mN at the tip with the moment that shifts it to the axis. A step that is longer than the pull feels it in
//! full.
//!
//! Where a segment turns by more than half a turn, as each of six does here, it is no spring any more, and the pose
//! formulation loses it.
//!
//! The spring swings like a bar that is clamped at one end: ω₁ = (π/2) √(k/m) with k = GJ/(2πa³ n), a the radius of the
//! n coils (Wahl, *Mechanical Springs*, 1963, chapter on surge), which holds for flat coils. The period is measured on
//! the part of the motion that has the shape sin πs/2L.

use crate::draw::{self, Axes, Curve, Eye, Picture, Space, Strand};
use crate::report::{self, Example, Numbers};
use crate::scene::{self, Case, DT, Frame, Helix, METHODS, Method, PAPER, Run, SEGMENTS, Scene, Start, Vec3};
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::Boundary;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::modes::modes;
use indicatif::ProgressBar;
use plotters::style::text_anchor::HPos;
use std::error::Error;
use std::f64::consts::{PI, TAU};

const HELIX: Helix = Helix { radius: 0.05, pitch: 0.02, length: 5.0 * 0.314_796 };
const WIRE: f64 = 0.25e-3;
/// N.
const FORCE: f64 = 0.006;
/// s.
const RELEASE: f64 = 0.1;
const DURATION: f64 = 2.0;
/// Step of the second-order runs, s.
const FINE: f64 = 2.5e-3;
/// Spectral radius of the second-order runs.
const RADIUS: f64 = 0.8;
const SEGMENT_COUNTS: [usize; 5] = [6, 12, 25, 50, SEGMENTS];
const STEPS: [f64; 8] = [1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0];
/// Of a run whose steps are too long or too short for [`DURATION`].
const FEWEST_STEPS: usize = 60;
const MOST_STEPS: usize = 1000;

fn boundary(time: f64, dt: f64) -> Boundary {
    let base = HELIX.support(-Vec3::z(), Vec3::x());
    let free = Boundary::hanging_from(base, Vec3::zeros());
    // at the start of the step that ends at this time; up to rounding
    if time > RELEASE + dt * (1.0 - 1e-6) {
        return free;
    }
    let tip_force = -Vec3::z() * FORCE;
    let (sin, cos) = (TAU * HELIX.turns()).sin_cos();
    // from the axis to the tip, turning about the axis that points down
    let out = Vec3::new(cos, -sin, 0.0) * HELIX.radius;
    Boundary { tip_force, tip_moment: -out.cross(&tip_force), ..free }
}

fn scene(segments: usize, scheme: Scheme, dt: f64) -> Scene {
    let steps = Scene::steps_in(DURATION, dt).clamp(FEWEST_STEPS, MOST_STEPS);
    Scene {
        rod: scene::steel(WIRE),
        mesh: Mesh::uniform(HELIX.length, segments, 1, HELIX.kappa_rest()),
        boundary: Box::new(move |time| boundary(time, dt)),
        start: Start::Unstressed,
        scheme,
        dt,
        steps,
        every: (1.25e-3 / dt).ceil() as usize,
    }
}

/// The part of the displacement along the axis that has the shape of the first mode, m.
fn swing(run: &Run, frame: &Frame) -> f64 {
    let last = frame.centreline.len() - 1;
    let shape = |j: usize| (0.5 * PI * j as f64 / last as f64).sin();
    let down = |j: usize| run.frames[0].centreline[j].z - frame.centreline[j].z;
    let weight = |j: usize| if j == last { 0.5 } else { 1.0 };
    2.0 / last as f64 * (0..=last).map(|j| weight(j) * shape(j) * down(j)).sum::<f64>()
}

/// The mean time between every second zero of the free oscillation, s, if there are at least three before it has died
/// out.
fn period(run: &Run) -> Option<f64> {
    let mut curve = run.curve(|frame| swing(run, frame));
    curve.retain(|(time, _)| *time > RELEASE);
    let largest = curve.iter().map(|(_, swing)| swing.abs()).fold(0.0, f64::max);
    let alive = curve.iter().rposition(|(_, swing)| swing.abs() > 0.01 * largest)?;
    curve.truncate(alive + 1);
    let zeros: Vec<f64> = curve
        .windows(2)
        .filter(|pair| pair[0].1 * pair[1].1 < 0.0)
        .map(|pair| pair[0].0 - pair[0].1 * (pair[1].0 - pair[0].0) / (pair[1].1 - pair[0].1))
        .collect();
    let count = zeros.len();
    (count >= 3).then(|| 2.0 * (zeros[count - 1] - zeros[0]) / (count - 1) as f64)
}

/// The period of the first mode along the axis, s, from the linear modes of the unstressed spring, if it has one
/// among the lowest.
fn period_of_mode(scene: &Scene) -> Result<Option<f64>, Box<dyn Error>> {
    let mut spring = scene.rod_at_start()?;
    let found = modes(&mut spring, &boundary(f64::MAX, DT), 16)?;
    let along = |shape: &[Vec3]| {
        let squares = |k: usize| shape.iter().map(|w| w[k] * w[k]).sum::<f64>();
        squares(2) / (squares(0) + squares(1) + squares(2))
    };
    Ok(found
        .iter()
        .find(|mode| mode.omega_squared > 0.0 && along(&mode.shape) > 0.5)
        .map(|mode| 1.0 / mode.frequency()))
}

fn closed_form() -> f64 {
    let rod = scene::steel(WIRE);
    let stiffness = rod.stiffness.z / (TAU * HELIX.radius.powi(3) * HELIX.turns());
    4.0 * (rod.mass_per_length * HELIX.length / stiffness).sqrt()
}

pub fn run(bar: &ProgressBar) -> Result<Example, Box<dyn Error>> {
    let sharp = Scheme::from_spectral_radius(RADIUS);
    let mut kinds: Vec<(usize, Scheme, f64)> = Vec::new();
    kinds.extend(SEGMENT_COUNTS.map(|segments| (segments, sharp, FINE)));
    kinds.extend(SEGMENT_COUNTS.map(|segments| (segments, PAPER, DT)));
    kinds.extend(STEPS.map(|dt| (SEGMENTS, PAPER, dt)));
    let case = |method: &'static Method| {
        let case = move |&(segments, scheme, dt): &(usize, Scheme, f64)| Case {
            name: String::new(),
            method,
            scene: scene(segments, scheme, dt),
            color: None,
        };
        kinds.iter().map(case)
    };
    let cases: Vec<Case> = METHODS.into_iter().flat_map(case).collect();
    let all = scene::run_all(&cases, bar)?;
    // those of the pose formulation come last
    let runs = &all[(METHODS.len() - 1) * kinds.len()..];

    let mut numbers = Numbers {
        chosen: vec![
            format!(
                "steel wire, radius {} mm, {:.1} turns of radius {} cm, pitch {} cm; {} mN for {RELEASE} s",
                WIRE * 1e3,
                HELIX.turns(),
                HELIX.radius * 1e2,
                HELIX.pitch * 1e2,
                FORCE * 1e3
            ),
            format!("period of a bar of the spring's stiffness and mass, 4 √(m/k): {:.4} s", closed_form()),
            "period and Newton iterations per step:".to_owned(),
        ],
        head: report::head(&["segments", "Δt, s", "scheme", "steps", "mode, s"]),
        rows: Vec::new(),
    };
    for method in METHODS {
        numbers.head.extend([format!("{}, s", method.name), "Newton".to_owned()]);
    }
    for (k, &(segments, scheme, dt)) in kinds.iter().enumerate() {
        let scheme = if scheme == sharp { format!("ρ∞ = {RADIUS}") } else { scene::name(scheme) };
        let step = if dt == DT { "1/30".to_owned() } else { dt.to_string() };
        let cell = |period: Option<f64>| period.map_or("–".to_owned(), |period| format!("{period:.4}"));
        let mode = cell(period_of_mode(&cases[k].scene)?);
        let mut row = vec![segments.to_string(), step, scheme, cases[k].scene.steps.to_string(), mode];
        for run in all[k..].iter().step_by(kinds.len()) {
            row.extend([cell(period(run)), run.newton()]);
        }
        numbers.rows.push(row);
    }

    let picture = Picture::new(1350, "4  Coil spring, pulled and released", &numbers.chosen[0], |area| {
        let (_, height) = draw::size(area);
        for (row, segments) in [SEGMENTS, 25].into_iter().enumerate() {
            let k = SEGMENT_COUNTS.iter().position(|&count| count == segments).unwrap_or(0);
            let top = row as f64 * 0.5 * height;
            shapes(&draw::part(area, (0.0, top), (720.0, 0.5 * height)), &runs[k], segments)?;
        }
        let curve =
            |k: usize, name: &str, color| Curve::new(name, color, runs[k].curve(|frame| swing(&runs[k], frame) * 1e3));
        let upper = [
            curve(4, "100 segments", draw::GREY),
            curve(2, "25", draw::BLUE),
            curve(1, "12", draw::ORANGE),
            curve(0, "6", draw::RED),
        ];
        let title = format!("first mode along the axis, mm: Δt = {FINE} s, ρ∞ = {RADIUS}");
        let place = |top: f64| draw::part(area, (730.0, top), (620.0, 0.5 * height - 4.0));
        draw::chart(&place(0.0), Axes::linear(&title, "time, s"), &upper)?;
        let at = |dt: f64| 10 + STEPS.iter().position(|&step| step == dt).unwrap_or(0);
        let lower = [
            curve(at(1e-3), "1 ms, to 1 s", draw::GREY),
            curve(at(1e-2), "10 ms", draw::GREEN),
            curve(9, "1/30 s", draw::RED),
            curve(at(0.1), "0.1 s", draw::VIOLET),
        ];
        let lower = lower.map(|mut curve| {
            curve.points.retain(|(time, _)| *time <= DURATION);
            curve
        });
        draw::chart(&place(0.5 * height), Axes::linear("the same: 100 segments, (0.3, 0, 0.7)", "time, s"), &lower)
    })?;
    Ok(Example { name: "4-spring", picture, numbers })
}

/// The spring at a few times, side by side.
fn shapes(area: &draw::Area<'_>, run: &Run, segments: usize) -> draw::Fallible {
    const TIMES: [f64; 4] = [0.0, 0.1, 0.2, 0.45];
    let side = |k: usize| Vec3::new(0.14 * k as f64, 0.0, 0.0);
    let strands: Vec<Strand> = TIMES
        .iter()
        .enumerate()
        .map(|(k, &time)| Strand {
            points: run.at(time).centreline.iter().map(|r| r + side(k)).collect(),
            color: draw::time_color(time / TIMES[TIMES.len() - 1]),
            width: 3.4,
            rim: true,
        })
        .collect();
    let base = boundary(0.0, DT).base;
    let clamps: Vec<_> = (0..TIMES.len()).map(|k| (base.position + side(k), base.rotation, 0.008)).collect();
    let eye = Eye { azimuth: -78.0, elevation: 14.0 };
    let (width, height) = draw::size(area);
    let inner = draw::part(area, (0.0, 20.0), (width, height - 20.0));
    draw::space(&inner, &Space { eye, strands: &strands, clamps: &clamps, ways: &[], floor: None })?;
    let times: Vec<String> = TIMES.iter().map(|&time| draw::short(time)).collect();
    let caption = format!("{segments} segments, at {} s", times.join(", "));
    draw::text(area, &caption, (26.0, 10.0), 16.0, draw::INK, HPos::Left)
}
