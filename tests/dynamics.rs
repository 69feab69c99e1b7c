//! Large and small motions against independent solutions.
//!
//! Meshes and steps are the coarsest round numbers whose error stays below a tenth of the tolerance.

mod common;

use common::{Case, along_x, angle, by_poses, by_rates, clamped, kirchhoff, unstressed};
use cosserat_rod::alpha::{Motion, Scheme};
use cosserat_rod::boundary::{Boundary, Support};
use cosserat_rod::formulation::Formulation;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::rate::{self, Options};
use cosserat_rod::rod::Rod;
use nalgebra::{Matrix2, Rotation3, Vector2, Vector3};
use std::f64::consts::{PI, TAU};

/// The spectral radius at infinity of all runs here: what the mesh cannot follow dies out in a few steps.
const RADIUS: f64 = 0.5;

/// Steps of `dt`; `boundary` and `visit` get the time, and `visit` the rod before the first step too.
fn run<F: Formulation>(
    rod: &mut F,
    steps: usize,
    dt: f64,
    boundary: impl Fn(f64) -> Boundary,
    mut visit: impl FnMut(usize, &F),
) {
    visit(0, rod);
    for i in 1..=steps {
        let scheme = Scheme::from_spectral_radius(RADIUS);
        let result = rod.step(&boundary(i as f64 * dt), scheme, dt);
        result.unwrap_or_else(|diverged| panic!("step {i}: {diverged}"));
        visit(i, rod);
    }
}

/// The rate formulation as it is at its best.
fn by_mended_rates(mesh: Mesh, rod: Rod, boundary: &Boundary) -> rate::Stepper {
    by_rates(mesh, rod, boundary, Options::MENDED)
}

/// The inertia of a plane beam without rotary inertia. About its own axis a section must have some, or nothing tells
/// how it starts to spin; plane motion does not feel how much.
fn without_rotary_inertia() -> Vector3<f64> {
    Vector3::z()
}

/// `angle` continued from `last` without a jump by a turn.
fn unwound(angle: f64, last: f64) -> f64 {
    angle + TAU * ((last - angle) / TAU).round()
}

/// A heavy rod released from the horizontal, on `cells` of `stages`, in `steps` from one instant to the next.
fn heavy_rod_released<F: Formulation>(
    begin: fn(Mesh, Rod, &Boundary) -> F,
    (cells, stages): (usize, usize),
    steps: usize,
) {
    let case = Case::read("c6_heavy_rod_release");
    let times = case.inputs("times");
    let dt = times[1] / steps as f64;
    let mesh = Mesh::uniform(case.input("L"), cells, stages, Vector3::zeros());
    let rod = Rod {
        mass_per_length: case.input("rhoA"),
        inertia_per_length: without_rotary_inertia(),
        ..kirchhoff(case.input("EI"), 1.0)
    };
    let boundary = Boundary { gravity: -Vector3::y() * case.input("g"), ..clamped(along_x()) };
    let (mut x, mut y, mut theta) = (vec![], vec![], vec![]);
    let mut last = 0.0;
    run(
        &mut begin(mesh, rod, &boundary),
        steps * (times.len() - 1),
        dt,
        |_| boundary,
        |i, rod| {
            let tip = rod.tip();
            last = unwound(angle(&tip.rotation), last);
            if i % steps == 0 {
                x.push(tip.position.x);
                y.push(tip.position.y);
                theta.push(last);
            }
        },
    );
    case.check("tip x(t)", &x);
    case.check("tip y(t)", &y);
    case.check("tip angle(t)", &theta);
}

#[test]
fn heavy_rod_released_from_the_horizontal() {
    heavy_rod_released(by_poses, (5, 4), 80);
}

#[test]
fn heavy_rod_released_from_the_horizontal_by_rates() {
    heavy_rod_released(by_mended_rates, (120, 1), 120);
}

/// A rod that its base spins up about an axis across it, on `cells` of `stages`, in `steps` per second.
fn spun_up<F: Formulation>(begin: fn(Mesh, Rod, &Boundary) -> F, (cells, stages): (usize, usize), steps: usize) {
    let case = Case::read("c6_spin_up_inextensible");
    let times = case.inputs("times");
    let dt = (times[1] - times[0]) / steps as f64;
    let (length, rotary) = (case.input("L"), case.input("rhoI"));
    let (t_s, omega_s) = (case.input("T_s"), case.input("omega_s"));
    let turn = |t: f64| {
        if t < t_s {
            let period = t_s / TAU;
            omega_s / t_s * (t * t / 2.0 + period * period * ((t / period).cos() - 1.0))
        } else {
            omega_s * (t - t_s / 2.0)
        }
    };
    let rate = |t: f64| if t < t_s { omega_s * (t - (TAU * t / t_s).sin() * t_s / TAU) / t_s } else { omega_s };
    let boundary = |t: f64| {
        let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), turn(t)).into_inner() * along_x();
        let base = Support::at_rest(Vector3::zeros(), rotation);
        Boundary { base: Support { angular_velocity: Vector3::z() * rate(t), ..base }, ..clamped(rotation) }
    };
    let rod = Rod {
        mass_per_length: case.input("rhoA"),
        inertia_per_length: Vector3::new(rotary, rotary, 2.0 * rotary),
        ..kirchhoff(case.input("EI"), case.input("EI"))
    };
    let mut rod = begin(Mesh::uniform(length, cells, stages, Vector3::zeros()), rod, &boundary(0.0));
    let (mut axial, mut transverse, mut rotation) = (vec![], vec![], vec![]);
    let mut peak = (0.0, 0.0f64);
    run(&mut rod, steps * (times.len() - 1), dt, boundary, |i, rod| {
        // the base frame: first axis along the undeformed rod
        let frame = boundary(i as f64 * dt).base.rotation * along_x().transpose();
        let tip = rod.tip();
        let position = frame.tr_mul(&tip.position);
        if position.y.abs() > peak.1.abs() {
            peak = (i as f64 * dt, position.y);
        }
        if i % steps == 0 {
            axial.push(position.x - length);
            transverse.push(position.y);
            rotation.push(angle(&frame.tr_mul(&tip.rotation)));
        }
    });
    case.check("axial tip displacement", &axial);
    case.check("transverse tip displacement", &transverse);
    case.check("tip rotation", &rotation);
    // the time of the peak is that of a sample, there as here
    case.check("peak |u2|", &[peak.0, peak.1]);
}

#[test]
fn spin_up() {
    spun_up(by_poses, (2, 4), 40);
}

#[test]
fn spin_up_by_rates() {
    spun_up(by_mended_rates, (50, 1), 50);
}

/// The steady deflection of a cantilever on a base shaken by 1: w(s) = cosh ks + a (cos ks − cosh ks) + b (sin ks −
/// sinh ks) with w'' = w''' = 0 at s = 1, and its slope.
fn steady_shape(k: f64, s: f64) -> (f64, f64) {
    let free_end = Matrix2::new(-k.cos() - k.cosh(), -k.sin() - k.sinh(), k.sin() - k.sinh(), -k.cos() - k.cosh());
    let [a, b]: [f64; 2] = (free_end.try_inverse().expect("no resonance") * Vector2::new(-k.cosh(), -k.sinh())).into();
    let (x, w) = (k * s, 1.0 - a);
    let deflection = w * x.cosh() + a * x.cos() + b * (x.sin() - x.sinh());
    (deflection, k * (w * x.sinh() - a * x.sin() + b * (x.cos() - x.cosh())))
}

#[test]
fn shaken_base_in_its_steady_state() {
    // without damping all points move in phase, w(s) sin ωt: the run starts straight with the velocities of that
    // motion, and shows the amplitudes a quarter of a period later
    let case = Case::read("c5_base_excitation_tf");
    let (mut tip, mut moment, mut shear) = (vec![], vec![], vec![]);
    for omega in case.inputs("omega") {
        // deflections up to 24 times this, where the motion is linear up to their squares
        let amplitude = 1e-5;
        // the root moment at ω = 10 all but vanishes beside its parts; its tolerance is the tightest
        let steps = 160;
        let dt = PI / 2.0 / omega / steps as f64;
        let boundary = |t: f64| {
            let (sin, cos) = (omega * t).sin_cos();
            let base = Support::at_rest(Vector3::y() * (amplitude * sin), along_x());
            let velocity = Vector3::y() * (amplitude * omega * cos);
            let acceleration = -Vector3::y() * (amplitude * omega * omega * sin);
            Boundary { base: Support { velocity, acceleration, ..base }, ..clamped(along_x()) }
        };
        let mesh = Mesh::uniform(case.input("L"), 6, 4, Vector3::zeros());
        let rod = Rod {
            mass_per_length: case.input("rhoA"),
            inertia_per_length: without_rotary_inertia(),
            ..kirchhoff(case.input("EI"), 1.0)
        };
        let mut stepper = unstressed(mesh, rod, &boundary(0.0));
        let sections: Vec<_> = stepper.state.points.iter().chain(stepper.state.nodes.last()).copied().collect();
        for (memory, section) in stepper.state.memory.iter_mut().zip(sections) {
            let (deflection, slope) = steady_shape(omega.sqrt(), section.position.x);
            let (speed, zero) = (amplitude * omega, Vector3::zeros());
            memory.travel = Motion::starting(Vector3::y() * (speed * deflection), zero, zero);
            let turning = Vector3::z() * (speed * slope);
            memory.spin = Motion::starting(section.rotation.tr_mul(&turning), zero, zero);
        }
        stepper.start(&boundary(0.0)).expect("accelerations at the start");
        run(&mut stepper, steps, dt, boundary, |_, _| ());
        tip.push(stepper.state.tip().position.y / amplitude);
        // m_z = EI w'' and m_s = −r_s × n
        moment.push(stepper.state.nodes[0].moment.z / amplitude);
        shear.push(-stepper.state.nodes[0].force.y / amplitude);
    }
    case.check("tip/base", &tip);
    case.check("EI w''(0)", &moment);
    case.check("EI w'''(0)", &shear);
}
