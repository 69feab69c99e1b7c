//! Example 5: the canonical buckling: the ends of a straight rod are moved towards each other while it bears an axial
//! torque.
//!
//! Chosen here: a rubber rod of 50 cm, 5 mm in radius, E = 50 MPa, without gravity, clamped at both ends; the tip may
//! turn about the axis and bears the dead torque M = 4 EI/L about it, which grows in the first half second; then the
//! tip comes nearer by 5 cm/s. A straight rod that cannot shorten would not yield to that, so it is bent when free of
//! load, by θ = 0.01 sin 2πs/L.
//!
//! A straight rod between such clamps buckles where, with a = M/2EI and b = √(a² + P/EI),
//! 2b (cos aL − cos bL) = (P/EI) L sin bL: small deflections w = y + iz with w = w' = 0 at both ends (Greenhill 1883
//! has other ends). At M = 0 that is 4π² EI/L².
//!
//! Once bent, the turn of the tip divides into twist and writhe. Writhe is Gauss's double integral along the centreline,
//! which has a closed form for polylines (Klenin and Langowski 2000), with the axis as its ends; what is left of link −
//! twist − writhe is the error of the cells.

use crate::draw::{self, Axes, Curve, Eye, Picture, Space, Strand};
use crate::report::{self, Example, Numbers};
use crate::scene::{self, Case, DT, Frame, METHODS, PAPER, Run, SEGMENTS, Scene, Start, Vec3};
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::{Boundary, Held, Support};
use cosserat_rod::mesh::Mesh;
use cosserat_rod::modes::modes;
use cosserat_rod::rod::Rod;
use indicatif::ProgressBar;
use plotters::style::text_anchor::HPos;
use std::error::Error;
use std::f64::consts::{PI, TAU};

const LENGTH: f64 = 0.5;
const RADIUS: f64 = 5e-3;
const YOUNG: f64 = 50e6;
/// M L/EI.
const TORQUE: f64 = 4.0;
/// Largest angle of the unloaded rod with the axis, rad.
const BEND: f64 = 0.01;
/// How long the torque grows, s.
const RISE: f64 = 0.5;
/// m/s.
const SPEED: f64 = 0.05;
const DURATION: f64 = 4.5;
/// A clamp whose section may turn about the axis.
const TURNING: Held = Held { translation: [true; 3], rotation: [true, true, false] };

fn rod() -> Rod {
    scene::rubber(RADIUS, YOUNG)
}

fn mesh() -> Mesh {
    let nodes: Vec<f64> = (0..=SEGMENTS).map(|j| LENGTH * j as f64 / SEGMENTS as f64).collect();
    let wave = TAU / LENGTH;
    Mesh::graded(&nodes, 1, |s| Vec3::new(0.0, BEND * wave * (wave * s).cos(), 0.0))
}

/// The clamps, the one at the tip on its way from where the unloaded rod has it.
fn boundary(unloaded: Vec3, time: f64) -> Boundary {
    let torque = TORQUE * rod().stiffness.x / LENGTH * (time / RISE).min(1.0);
    let approach = (time - RISE).max(0.0) * SPEED;
    let speed = if time > RISE { SPEED } else { 0.0 };
    Boundary {
        tip: Support {
            velocity: -Vec3::x() * speed,
            held: TURNING,
            ..Support::at_rest(unloaded - Vec3::x() * approach, scene::along_x())
        },
        tip_moment: Vec3::x() * torque,
        ..Boundary::hanging_from(Support::at_rest(Vec3::zeros(), scene::along_x()), Vec3::zeros())
    }
}

fn scene(scheme: Scheme) -> Scene {
    let base = Support::at_rest(Vec3::zeros(), scene::along_x());
    let unloaded = cosserat_rod::pose::State::at_rest_shape(&mesh(), &base).tip().position;
    Scene {
        rod: rod(),
        mesh: mesh(),
        boundary: Box::new(move |time| boundary(unloaded, time)),
        start: Start::Unstressed,
        scheme,
        dt: DT,
        steps: Scene::steps_in(DURATION, DT),
        every: 1,
    }
}

/// P L²/EI at which the straight rod buckles under the torque, by the closed form.
fn closed_form(torque: f64) -> f64 {
    let a = 0.5 * torque;
    let f = |load: f64| {
        let b = (a * a + load).sqrt();
        2.0 * b * (a.cos() - b.cos()) - load * b.sin()
    };
    // P = 0 is a root of its own
    let (mut low, mut high) = (0.1, 0.2);
    while f(low) * f(high) > 0.0 {
        (low, high) = (high, high + 0.1);
    }
    bisected(low, high, |load| f(load) * f(low) > 0.0)
}

/// The same, where the first mode of the straight rod comes to rest.
fn by_modes(torque: f64) -> Result<f64, Box<dyn Error>> {
    let (rod, base) = (rod(), Support::at_rest(Vec3::zeros(), scene::along_x()));
    let stiffness = rod.stiffness.x;
    let straight = Mesh::uniform(LENGTH, SEGMENTS, 1, Vec3::zeros());
    let sliding = Held { translation: [true, true, false], ..TURNING };
    let omega_squared = |load: f64| -> Result<f64, Box<dyn Error>> {
        let boundary = Boundary {
            tip: Support { held: sliding, ..Support::at_rest(Vec3::x() * LENGTH, scene::along_x()) },
            tip_force: -Vec3::x() * (load * stiffness / (LENGTH * LENGTH)),
            tip_moment: Vec3::x() * (torque * stiffness / LENGTH),
            ..Boundary::hanging_from(base, Vec3::zeros())
        };
        let state = cosserat_rod::pose::State::at_rest_shape(&straight, &base);
        let mut column = cosserat_rod::stepper::Stepper::new(straight.clone(), rod.clone(), state);
        column.equilibrium(&boundary)?;
        Ok(modes(&mut column, &boundary, 1)?[0].omega_squared)
    };
    let (mut low, mut high) = (0.0, 45.0);
    // to 1e-5, far below the error of the cells
    for _ in 0..22 {
        let middle = 0.5 * (low + high);
        if omega_squared(middle)? > 0.0 { low = middle } else { high = middle }
    }
    Ok(0.5 * (low + high))
}

/// Where `below` ends.
fn bisected(mut low: f64, mut high: f64, below: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if below(middle) { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The writhe of the centreline between two rays along the axis, in turns.
fn writhe(frame: &Frame) -> f64 {
    // long enough: what is left out falls with the square of the distance
    let far = Vec3::x() * (1e3 * LENGTH);
    let mut points = vec![frame.centreline[0] - far];
    points.extend(&frame.centreline);
    points.push(frame.tip() + far);
    let pieces = points.len() - 1;
    let pairs = (0..pieces).flat_map(|i| (i + 2..pieces).map(move |j| (i, j)));
    let solid_angle = |(i, j): (usize, usize)| {
        let (a, b, c, d) = (points[i], points[i + 1], points[j], points[j + 1]);
        let corners =
            [(c - a).cross(&(d - a)), (d - a).cross(&(d - b)), (d - b).cross(&(c - b)), (c - b).cross(&(c - a))];
        let n = corners.map(|corner| corner.try_normalize(1e-14 * LENGTH * LENGTH));
        let [Some(n_1), Some(n_2), Some(n_3), Some(n_4)] = n else { return 0.0 };
        let angle = |x: &Vec3, y: &Vec3| x.dot(y).clamp(-1.0, 1.0).asin();
        let area = angle(&n_1, &n_2) + angle(&n_2, &n_3) + angle(&n_3, &n_4) + angle(&n_4, &n_1);
        area * (d - c).cross(&(b - a)).dot(&(c - a)).signum()
    };
    pairs.map(solid_angle).sum::<f64>() / TAU
}

/// The turn of the tip about the axis, in turns, followed from frame to frame.
fn link(run: &Run) -> Vec<(f64, f64)> {
    let mut turns = 0.0;
    run.curve(|frame| {
        let section = scene::along_x().tr_mul(&frame.rotations[frame.rotations.len() - 1]);
        section[(1, 0)].atan2(section[(0, 0)]) / TAU
    })
    .into_iter()
    .map(|(time, turn)| {
        turns += turn - turns - (turn - turns).round();
        (time, turns)
    })
    .collect()
}

pub fn run(bar: &ProgressBar) -> Result<Example, Box<dyn Error>> {
    let half = Scheme::from_spectral_radius(0.5);
    let cases: Vec<Case> = METHODS
        .into_iter()
        .flat_map(|method| [PAPER, half].map(|scheme| (method, scheme)))
        .map(|(method, scheme)| {
            let what = if scheme == half { "ρ∞ = 0.5".to_owned() } else { scene::name(scheme) };
            Case { name: format!("{}, {what}", method.name), method, scene: scene(scheme), color: None }
        })
        .collect();
    let runs = scene::run_all(&cases, bar)?;

    let unit = rod().stiffness.x / (LENGTH * LENGTH);
    let exact = closed_form(TORQUE);
    let push = |frame: &Frame| -frame.base_force.x / unit;
    let mut numbers = Numbers {
        chosen: vec![
            format!(
                "rubber, 50 cm, radius {} mm, E = {} MPa; M = {TORQUE} EI/L; 100 box cells, Δt = 1/30 s",
                RADIUS * 1e3,
                YOUNG / 1e6
            ),
            format!("P L²/EI at which it buckles: closed form {exact:.3}, first mode at rest {:.3}", by_modes(TORQUE)?),
            format!("without the torque: closed form {:.3}, 4π² = {:.3}", closed_form(0.0), 4.0 * PI * PI),
        ],
        head: report::head(&[
            "run",
            "P L²/EI at 1 % shortening",
            "link at the end",
            "twist",
            "writhe",
            "link − twist − writhe",
            "Newton per step",
        ]),
        rows: Vec::new(),
    };
    for (Case { name, .. }, run) in cases.iter().zip(&runs) {
        let end = &run.frames[run.frames.len() - 1];
        let link = link(run).last().map_or(0.0, |turn| turn.1);
        let (twist, writhe) = (scene::twist(end) / TAU, writhe(end));
        let early = run.at(RISE + 0.01 * LENGTH / SPEED);
        let cell = |x: f64| format!("{x:.4}");
        let mut row = vec![name.clone(), format!("{:.2}", push(early))];
        row.extend([link, twist, writhe, link - twist - writhe].map(cell));
        row.push(run.newton());
        numbers.rows.push(row);
    }

    // the pose formulation with the paper's scheme
    let shown = &runs[2 * METHODS.len() - 2];
    let picture = Picture::new(900, "5  Buckling under an axial torque", &numbers.chosen[0], |area| {
        let (width, height) = draw::size(area);
        let above = draw::part(area, (0.0, 0.0), (width, 350.0));
        let times = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5];
        let strands: Vec<Strand> = times
            .iter()
            .map(|&time| Strand {
                points: shown.at(time).centreline.clone(),
                color: draw::time_color(time / DURATION),
                width: 5.0,
                rim: true,
            })
            .collect();
        let clamps: Vec<_> = [shown.at(0.0).centreline[0], shown.at(0.0).tip(), shown.at(DURATION).tip()]
            .map(|r| (r, scene::along_x(), 0.02))
            .to_vec();
        let eye = Eye { azimuth: -70.0, elevation: 22.0 };
        draw::space(&above, &Space { eye, strands: &strands, clamps: &clamps, ways: &[], floor: Some((0.03, 0.05)) })?;
        draw::time_bar(&above, (30.0, 8.0), 170.0, DURATION)?;
        draw::text(&above, "pose, the paper's scheme, every 0.5 s", (30.0, 50.0), 14.0, draw::INK, HPos::Left)?;
        let half = 0.5 * width;
        let left = draw::part(area, (0.0, 350.0), (half, height - 350.0));
        let curves = [
            Curve::new("closed form", draw::GREY, vec![(0.0, exact), (DURATION, exact)]),
            Curve::new("pose", draw::RED, shown.curve(push)),
        ];
        let axes = Axes { y: Some((-5.0, 1.3 * exact)), ..Axes::linear("axial force, P L²/EI", "time, s") };
        draw::chart(&left, axes, &curves)?;
        let right = draw::part(area, (half, 350.0), (half, height - 350.0));
        let curves = [
            Curve::new("link", draw::GREY, link(shown)),
            Curve::new("twist", draw::GREEN, shown.curve(|frame| scene::twist(frame) / TAU)),
            Curve::new("writhe", draw::BLUE, shown.curve(writhe)),
        ];
        draw::chart(&right, Axes::linear("turns", "time, s"), &curves)
    })?;
    Ok(Example { name: "5-buckling", picture, numbers })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn writhe_of(points: &[[f64; 3]]) -> f64 {
        writhe(&Frame {
            centreline: points.iter().map(|point| Vec3::from(*point) * LENGTH).collect(),
            ..Frame::default()
        })
    }

    #[test]
    fn a_loop_that_all_but_lies_in_a_plane_has_the_writhe_of_its_crossing() {
        let curl = |lift: f64| {
            [[-1.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.4, 0.4, 0.0], [0.0, 0.4, lift], [0.0, -0.4, lift], [1.0, -0.4, lift]]
        };
        // what the two strands miss of a crossing is an angle of the size of lift over the loop
        let lift = 1e-6;
        for (lift, exact) in [(lift, 1.0), (-lift, -1.0)] {
            let writhe = writhe_of(&curl(lift));
            assert!((writhe - exact).abs() < 1e-5, "{writhe}");
        }
    }

    #[test]
    fn a_plane_curve_has_no_writhe() {
        assert_eq!(writhe_of(&[[0.0, 0.0, 0.0], [0.2, 0.3, 0.0], [0.6, -0.4, 0.0], [1.0, 0.1, 0.0]]), 0.0);
    }

    #[test]
    fn writhe_does_not_depend_on_the_scale_and_changes_sign_in_the_mirror() {
        let curve =
            [[0.0, 0.0, 0.0], [0.1, 0.1, 0.0], [0.2, 0.0, 0.1], [0.1, -0.1, 0.1], [0.0, 0.1, 0.2], [0.4, 0.0, 0.0]];
        let (as_is, small) = (writhe_of(&curve), writhe_of(&curve.map(|point| point.map(|x| 0.5 * x))));
        let mirrored = writhe_of(&curve.map(|[x, y, z]| [x, -y, z]));
        // the rays have the same length whatever the scale: they end a thousand lengths away
        assert!((as_is - small).abs() < 1e-6 && (as_is + mirrored).abs() < 1e-12, "{as_is} {small} {mirrored}");
        assert!(as_is.abs() > 0.1, "{as_is}");
    }

    #[test]
    fn without_torque_a_rod_clamped_at_both_ends_buckles_at_eulers_load() {
        assert!((closed_form(0.0) - TAU * TAU).abs() < 1e-9);
    }
}
