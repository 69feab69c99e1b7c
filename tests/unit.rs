//! The unit between communication points: what the host samples becomes one smooth motion of the base.

#[path = "common/long.rs"]
mod long;
// the chart uses the rest of it
#[allow(dead_code)]
#[path = "../src/cli/chart/scenes.rs"]
mod scenes;

use cosserat_rod::unit::{Error, Inputs, Outputs, Parameters, Tunable, Unit};
use long::{helix, inputs};
use nalgebra::{Vector3, Vector4};
use scenes::Scene;
use std::f64::consts::TAU;

type Vec3 = Vector3<f64>;

/// A short steel rod: it follows its base like a rigid body, so that its reaction shows the acceleration of the path.
fn stiff() -> Parameters {
    Parameters {
        length: 0.2,
        radius: 0.004,
        density: 7850.0,
        youngs_modulus: 2e11,
        shear_modulus: 8e10,
        gravity: Vec3::zeros(),
        cells: 2,
        stages: 2,
        ..Parameters::default()
    }
}

/// The outputs at the communication points of `steps` steps of `h` s under a position and velocity of the base along y.
fn shake(parameters: &Parameters, h: f64, steps: usize, motion: impl Fn(f64) -> (f64, f64)) -> Vec<Outputs> {
    let inputs = |t: f64| {
        let (x, v) = motion(t);
        Inputs { base_position: Vec3::y() * x, base_velocity: Vec3::y() * v, ..Inputs::default() }
    };
    let mut unit = Unit::new(parameters, &inputs(0.0), None).unwrap();
    let step = |i: usize| {
        unit.advance(&inputs(i as f64 * h), h).unwrap();
        unit.outputs().clone()
    };
    (0..steps).map(step).collect()
}

fn mass(parameters: &Parameters) -> f64 {
    let rod = parameters.rod();
    rod.mass_per_length * parameters.length
}

#[test]
fn a_constant_acceleration_gives_a_reaction_without_a_flip() {
    let (parameters, acceleration) = (Parameters { step: 5e-4, ..stiff() }, 2.0);
    let expected = -mass(&parameters) * acceleration;
    for h in [0.02, 0.01, 0.005] {
        let steps = shake(&parameters, h, (0.4 / h) as usize, |t| (0.5 * acceleration * t * t, acceleration * t));
        for (i, outputs) in steps.iter().enumerate() {
            let reaction = outputs.base_reaction_force.y / expected;
            // the host's velocity tells of the acceleration only at the second point
            assert!(i == 0 || reaction > 0.0, "H = {h}, step {i}: {reaction}");
        }
        // what was missed at first is fed in over 0.1 s and more
        let last = steps[steps.len() - 1].base_reaction_force.y / expected;
        assert!((last - 1.0).abs() < 0.02, "H = {h}: {last}");
    }
}

/// Amplitude that fades in over one period, so that the sine starts smoothly; position and velocity.
fn sine(amplitude: f64, period: f64) -> impl Fn(f64) -> (f64, f64) {
    move |t| {
        let x = t / period;
        let (fade, slope) = if x < 1.0 {
            (x.powi(3) * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * (x * (1.0 - x)).powi(2))
        } else {
            (1.0, 0.0)
        };
        let (sin, cos) = (TAU * x).sin_cos();
        (amplitude * fade * sin, amplitude * (slope * sin + fade * TAU * cos) / period)
    }
}

#[test]
fn the_reaction_to_a_sampled_sine_converges_and_does_not_flip() {
    let period = 0.5;
    let parameters = Parameters { step: 1e-3, ..stiff() };
    let per_period = [20, 40, 80];
    let scale = mass(&parameters) * 0.02 * (TAU / period).powi(2);
    let run = |n: usize| shake(&parameters, period / n as f64, 4 * n, sine(0.02, period));
    let reference = run(640);
    let mut errors = Vec::new();
    for n in per_period {
        let steps = run(n);
        let (mut worst, mut flips) = (0.0f64, 0);
        let mut before = 0.0;
        // from the second period on the amplitude is constant
        for i in n..steps.len() {
            let now = steps[i].base_reaction_force.y;
            let exact = reference[(i + 1) * 640 / n - 1].base_reaction_force.y;
            worst = worst.max((now - exact).abs() / scale);
            flips += usize::from(now * before < 0.0);
            before = now;
        }
        // two zeros a period, in three periods
        assert!(flips <= 6, "{n} steps a period: {flips} changes of sign");
        errors.push(worst);
    }
    assert!(errors[0] < 0.25 && errors[1] < 0.55 * errors[0] && errors[2] < 0.55 * errors[1], "{errors:?}");
}

#[test]
fn positions_rounded_as_in_a_table_do_not_shake_the_reaction() {
    let rounded = |x: f64| (x * 1e6).round() / 1e6;
    let motion = sine(0.02, 0.5);
    for (base_motion, bound) in [(0, 0.005), (1, 0.02)] {
        for h in [0.01, 0.002] {
            let parameters = Parameters { step: 1e-3, base_motion, ..stiff() };
            let scale = mass(&parameters) * 0.02 * (TAU / 0.5f64).powi(2);
            let steps = (1.0 / h) as usize;
            let smooth = shake(&parameters, h, steps, &motion);
            let coarse = shake(&parameters, h, steps, |t| (rounded(motion(t).0), motion(t).1));
            for (a, b) in smooth.iter().zip(&coarse) {
                let difference = (a.base_reaction_force - b.base_reaction_force).norm() / scale;
                assert!(difference < bound, "base.motion {base_motion}, H = {h}: {difference}");
            }
        }
    }
}

#[test]
fn every_base_motion_follows_what_it_is_given() {
    let (period, h) = (0.5, 0.005);
    let motion = sine(0.02, period);
    for base_motion in 0..=2 {
        let parameters = Parameters { step: 1e-3, base_motion, ..stiff() };
        // what is not to be used is wrong on purpose
        let steps = shake(&parameters, h, 300, |t| match base_motion {
            0 => motion(t),
            1 => (motion(t).0, 0.0),
            _ => (0.0, motion(t).1),
        });
        for (i, outputs) in steps.iter().enumerate() {
            let (x, v) = motion((i + 1) as f64 * h);
            let speed = 0.02 * TAU / period;
            // 2 % of the amplitude from extrapolating over a hundredth of a period; the derived twist adds its
            // tracker's delay
            let (part, rate) = if base_motion == 1 { (0.03, 0.08) } else { (0.02, 0.05) };
            assert!(
                (outputs.stations[0].y - x).abs() < part * 0.02,
                "base.motion {base_motion}, step {i}: {}",
                outputs.stations[0].y - x
            );
            assert!((outputs.tip_velocity.y - v).abs() < rate * speed, "base.motion {base_motion}, step {i}");
        }
    }
}

#[test]
fn a_pose_that_contradicts_its_twist_is_warned_of_once_and_followed_slowly() {
    let mut unit = Unit::new(&stiff(), &Inputs::default(), None).unwrap();
    let inputs = Inputs { base_position: Vec3::y() * 0.1, ..Inputs::default() };
    let warnings: Vec<String> =
        (0..200).filter_map(|_| unit.advance(&inputs, 0.01).unwrap()).map(|warning| warning.to_string()).collect();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].contains("base.position") && warnings[0].contains("base.velocity"), "{warnings:?}");
    assert!((unit.outputs().stations[0].y - 0.1).abs() < 1e-3);
}

#[test]
fn a_refused_step_changes_nothing() {
    let parameters = Parameters { step: 0.01, ..Parameters::default() };
    let mut unit = Unit::new(&parameters, &Inputs::default(), None).unwrap();
    unit.advance(&Inputs::default(), 0.05).unwrap();
    let before = format!("{unit:?}");
    let bad = [
        (Inputs { base_position: Vec3::new(f64::NAN, 0.0, 0.0), ..Inputs::default() }, 0.05, "base.position[1]"),
        (Inputs { tip_force: Vec3::new(0.0, 0.0, f64::INFINITY), ..Inputs::default() }, 0.05, "tip.force[3]"),
        (Inputs { base_orientation: Vector4::zeros(), ..Inputs::default() }, 0.05, "base.orientation"),
        (Inputs::default(), 0.0, "step size"),
        (Inputs::default(), 1e8, "step"),
    ];
    for (inputs, step, name) in bad {
        let error = unit.advance(&inputs, step).unwrap_err().to_string();
        assert!(error.contains(name), "{error}");
        assert_eq!(format!("{unit:?}"), before);
    }
    // one that Newton cannot take: a force no step can follow
    let mut repeated = unit.clone();
    let violent = Inputs { tip_force: Vec3::y() * 1e150, ..Inputs::default() };
    assert!(matches!(unit.advance(&violent, 0.05), Err(Error::Diverged { .. })));
    unit.advance(&Inputs::default(), 0.05).unwrap();
    repeated.advance(&Inputs::default(), 0.05).unwrap();
    assert_eq!(unit.outputs(), repeated.outputs());
}

#[test]
fn gravity_that_changes_is_no_gain_of_the_steps() {
    // released from the horizontal, in its plane; at a tenth of its weight it has ten times the energy of its height less
    for part in [0.1, 3.0] {
        let mut unit = Unit::new(&Parameters::default(), &Inputs::default(), None).unwrap();
        let advance = |unit: &mut Unit, steps: usize| {
            for _ in 0..steps {
                unit.advance(&Inputs::default(), 0.02).unwrap();
            }
            unit.outputs().solver
        };
        let before = advance(&mut unit, 10);
        let gravity = Parameters::default().gravity * part;
        unit.tune(&Tunable { gravity, ..Parameters::default().tunable() }).unwrap();
        let after = advance(&mut unit, 5);
        assert!(before.planar && after.planar);
        assert!(after.retries <= before.retries + 2, "{} and {} retries", before.retries, after.retries);
    }
}

#[test]
fn gravity_changes_from_the_next_step_on() {
    let mut unit = Unit::new(&Parameters::default(), &Inputs::default(), None).unwrap();
    unit.tune(&Tunable { gravity: Vec3::z() * 9.81, ..Parameters::default().tunable() }).unwrap();
    for _ in 0..20 {
        unit.advance(&Inputs::default(), 0.01).unwrap();
    }
    assert!(unit.outputs().tip_position.z > 0.1, "{}", unit.outputs().tip_position);
}

#[test]
fn the_effective_mass_is_what_the_base_feels() {
    let hanging = Inputs { base_orientation: Vector4::new(0.0, 1.0, 0.0, 0.0), ..Inputs::default() };
    let parameters =
        Parameters { effective_mass: true, tip_mass: 0.02, start_in_equilibrium: true, ..Parameters::default() };
    let unit = Unit::new(&parameters, &hanging, None).unwrap();
    let weight = unit.outputs().base_reaction_force;
    let mass = unit.outputs().effective_mass;
    // it hangs, and moves along itself as one body, whose weight the base feels; across, it swings
    assert!((mass * Vec3::z() + Vec3::z() * (weight.z / 9.81)).norm() < 1e-9, "{mass} {weight}");
    assert!(mass.m11 > 0.0 && mass.m22 > 0.0 && mass.m11.max(mass.m22) < 0.2 * mass.m33, "{mass}");

    // in a plane and out of it
    for push in [Vec3::zeros(), Vec3::y() * 0.05] {
        let released = Parameters { start_in_equilibrium: false, ..parameters.clone() };
        let inputs = Inputs { tip_force: push, ..Inputs::default() };
        let mut unit = Unit::new(&released, &inputs, None).unwrap();
        for _ in 0..20 {
            unit.advance(&inputs, 0.01).unwrap();
        }
        assert_eq!(unit.outputs().solver.planar, push == Vec3::zeros());
        let mass = unit.outputs().effective_mass;
        let scale = mass.norm();
        assert!((mass - mass.transpose()).norm() < 1e-9 * scale && mass.symmetric_eigenvalues().min() > 0.0, "{mass}");
        for change in [Vec3::x(), Vec3::new(0.3, -2.0, 1.0)] {
            let reaction = |acceleration: Vec3| {
                let mut stepper = unit.clone().stepper().clone();
                let mut boundary = stepper.state.boundary;
                boundary.base.acceleration += acceleration;
                stepper.accelerate(&boundary).unwrap();
                let base = stepper.state.nodes[0];
                (base.force, base.moment)
            };
            let (now, changed) = (reaction(Vec3::zeros()), reaction(change));
            let (felt, moment) = (changed.0 - now.0, changed.1 - now.1);
            assert!((felt + mass * change).norm() < 1e-9 * scale, "{felt} and {}", mass * change);
            // the rod is 1 m long, and bends before it passes a moment on
            assert!(moment.norm() < 1e-9 * scale, "{moment}");
        }
    }
    for without in [
        Parameters::default(),
        Parameters { extensible: true, ..parameters.clone() },
        Parameters { quasi_static: true, ..parameters.clone() },
    ] {
        assert_eq!(Unit::new(&without, &hanging, None).unwrap().outputs().effective_mass.norm(), 0.0);
    }
}

/// Tuned before the first step, a rod moves as one that has always been so.
#[test]
fn damping_changes_from_the_next_step_on() {
    let pushed = Inputs { tip_force: Vec3::y() * 0.05, ..Inputs::default() };
    let chosen = Parameters { tolerance: 1e-5, ..Parameters::default() };
    let equal = Parameters { step: 0.002, ..Parameters::default() };
    for (parameters, inputs) in [(&chosen, Inputs::default()), (&chosen, pushed.clone()), (&equal, pushed)] {
        let damped = Tunable { damping_bending: 0.1, damping_twist: 0.2, damping_drag: 0.05, ..parameters.tunable() };
        let mut tuned = Unit::new(parameters, &inputs, None).unwrap();
        let mut always = Unit::new(&parameters.tuned(&damped), &inputs, None).unwrap();
        let mut never = tuned.clone();
        tuned.tune(&damped).unwrap();
        for _ in 0..30 {
            for unit in [&mut tuned, &mut always, &mut never] {
                unit.advance(&inputs, 0.01).unwrap();
            }
        }
        let tip = |unit: &Unit| unit.outputs().tip_position;
        // at rest and unstressed nothing is damped yet
        assert!((tip(&tuned) - tip(&always)).norm() < 1e-9, "{} and {}", tip(&tuned), tip(&always));
        assert!((tip(&tuned) - tip(&never)).norm() > 0.02, "{} and {}", tip(&tuned), tip(&never));
        // the balance counts what is lost, to the error of the equal steps
        let energy = &tuned.outputs().energy;
        let residual = energy.total() + energy.dissipated - energy.work_base - energy.work_tip;
        assert!(energy.dissipated > 0.01 && residual.abs() < 0.02 * energy.dissipated, "{energy:?}");
    }
    let mut unit = Unit::new(&chosen, &Inputs::default(), None).unwrap();
    let before = format!("{unit:?}");
    let bad = Tunable { damping_twist: -1.0, ..chosen.tunable() };
    let error = unit.tune(&bad).unwrap_err().to_string();
    assert_eq!(error, "damping.twist = -1 is not allowed: finite and >= 0");
    assert_eq!(format!("{unit:?}"), before);
}

#[test]
fn an_equilibrium_stays_and_an_unstable_one_is_refused() {
    let resting = Parameters { start_in_equilibrium: true, ..Parameters::default() };
    for cells in [6, 0] {
        let resting = Parameters { cells, ..resting.clone() };
        let mut unit = Unit::new(&resting, &Inputs::default(), None).unwrap();
        let start = unit.outputs().clone();
        for _ in 0..50 {
            unit.advance(&Inputs::default(), 0.02).unwrap();
        }
        let moved = (unit.outputs().tip_position - start.tip_position).norm();
        assert!(moved < 1e-9, "{cells} cells: {moved}");
        let weight = mass(&resting) * 9.81;
        assert!((unit.outputs().base_reaction_force.z + weight).abs() < 1e-9 * weight);
    }

    // standing on its clamp, this rod is far longer than it can carry (w L³/EI = 346, the limit is 7.84)
    let standing = Inputs { base_orientation: Vector4::new(1.0, 0.0, 0.0, 0.0), ..Inputs::default() };
    let error = Unit::new(&resting, &standing, None).unwrap_err();
    assert!(matches!(error, Error::UnstableEquilibrium { .. }), "{error}");
}

#[test]
fn a_step_that_differs_by_the_rounding_of_a_host_is_the_same_step() {
    // steps that do not resolve the motion: there the way of a step depends on the one before
    let parameters = Parameters { step: 1.0, cells: 5, stages: 2, ..Parameters::default() };
    let tips = |rounding: [f64; 3]| -> Vec<Vec3> {
        let mut unit = Unit::new(&parameters, &Inputs::default(), None).unwrap();
        let step = |i: usize| {
            unit.advance(&Inputs::default(), 1.0 / 32.0 * (1.0 + rounding[i % 3])).unwrap();
            unit.outputs().tip_position
        };
        (0..64).map(step).collect()
    };
    let exact = tips([0.0; 3]);
    let rounded = tips([4e-16, -4e-16, 0.0]);
    for (i, (a, b)) in exact.iter().zip(&rounded).enumerate() {
        assert!((a - b).norm() < 1e-9, "step {i}: {a} and {b}");
    }
}

#[test]
fn a_short_stiff_rod_does_not_take_its_time() {
    let parameters = Parameters { length: 1e-3, ..Parameters::default() };
    let mut unit = Unit::new(&parameters, &Inputs::default(), None).unwrap();
    unit.advance(&Inputs::default(), 0.01).unwrap();
    assert!(unit.outputs().solver.steps <= 1000, "{}", unit.outputs().solver.steps);
}

#[test]
fn long_rods_go_through_a_second() {
    let umbilical = |cells| ("umbilical", Parameters { cells, ..Scene::Umbilical.parameters() });
    let helix = |cells| ("helix", helix(cells));
    for (name, parameters) in [umbilical(10), umbilical(40), helix(150)] {
        let at = |t: f64| if name == "umbilical" { inputs(&Scene::Umbilical.boundary(t)) } else { Inputs::default() };
        let mut unit = Unit::new(&parameters, &at(0.0), None).unwrap();
        for i in 0..50 {
            let done = unit.advance(&at(f64::from(i) * 0.02), 0.02);
            done.unwrap_or_else(|error| panic!("{name}, {} cells, step {i}: {error}", parameters.cells));
        }
        let outputs = unit.outputs();
        let steps = outputs.solver.steps;
        assert!(steps < 1000, "{name}, {} cells: {steps} steps", parameters.cells);
        assert!((outputs.tip_position - at(1.0).base_position).norm() <= parameters.length);
    }
}

/// What tells two units apart: all that they hand out, to the bit.
fn bits(unit: &Unit) -> String {
    format!("{:?}", unit.outputs())
}

#[test]
fn a_base_that_turns_winds_the_rod_up_and_does_not_lose_it() {
    // without weight the rod coils up; 100 rad/s turn a half of the cells that it starts on past a full turn in 0.3 s
    let parameters = Parameters { base_motion: 2, gravity: Vec3::zeros(), ..Parameters::default() };
    for planar in [true, false] {
        for omega in [3.0, 30.0, 100.0] {
            for tolerance in [1e-2, 1e-3] {
                let parameters = Parameters { planar, tolerance, ..parameters.clone() };
                let turning = Inputs { base_angular_velocity: Vec3::y() * omega, ..Inputs::default() };
                let mut unit = Unit::new(&parameters, &Inputs::default(), None).unwrap();
                for i in 0..100 {
                    let done = unit.advance(&turning, 0.01);
                    done.unwrap_or_else(|error| panic!("{omega} rad/s, {tolerance:e}, step {i}: {error}"));
                    assert!(unit.outputs().tip_position.norm() <= parameters.length);
                }
                let Outputs { cells, solver, .. } = unit.outputs();
                assert!(*cells <= 64 && solver.steps < 5000, "{omega} rad/s: {cells} cells, {} steps", solver.steps);
            }
        }
    }
}

#[test]
fn a_rod_that_is_overdamped_buckles_out_of_its_plane_slowly() {
    // without its damping the disturbance grows by 60 powers of ten from one look at it to the next
    let parameters = Parameters {
        radius: 1e-3,
        youngs_modulus: 1e9,
        shear_modulus: 1e9 / 3.0,
        damping_bending: 10.0,
        damping_twist: 10.0,
        damping_drag: 100.0,
        start_in_equilibrium: true,
        tolerance: 1e-5,
        ..Parameters::default()
    };
    let pulled = Inputs { tip_force: Vec3::x() * (10.0 * mass(&parameters) * 9.81), ..Inputs::default() };
    let mut unit = Unit::new(&parameters, &Inputs::default(), None).unwrap();
    for i in 0..40 {
        unit.advance(&pulled, 0.01).unwrap_or_else(|error| panic!("step {i}: {error}"));
    }
    assert!(unit.outputs().tip_position.y.abs() < 1e-6, "{}", unit.outputs().tip_position);
}

#[test]
fn a_step_that_fails_is_not_seen_in_those_after_it() {
    let shaken = |i: usize| Inputs { base_velocity: Vec3::x() * (0.3 * (0.3 * i as f64).sin()), ..Inputs::default() };
    let pushed = |i: usize| Inputs { tip_force: Vec3::y() * (0.02 * (0.2 * i as f64).sin()), ..Inputs::default() };
    let still = |_: usize| Inputs::default();
    let winding = |_: usize| Inputs { base_angular_velocity: Vec3::y() * 30.0, ..Inputs::default() };
    let weightless = Parameters { base_motion: 2, gravity: Vec3::zeros(), ..Parameters::default() };
    let slow = Parameters { quasi_static: true, ..Parameters::default() };
    type Drive<'a> = (&'a str, Parameters, &'a dyn Fn(usize) -> Inputs);
    let drives: [Drive; 5] = [
        ("in a plane", Parameters::default(), &shaken),
        ("in space", Parameters::default(), &pushed),
        ("released", Parameters { tolerance: 1e-4, ..Parameters::default() }, &still),
        ("wound up", weightless, &winding),
        ("slow", slow, &pushed),
    ];
    let violent = [1e150, 1e3].map(|size| Inputs { tip_force: Vec3::z() * size, ..Inputs::default() });
    let spun = [1e4, 1e9, 1e200]
        .map(|size| Inputs { base_angular_velocity: Vec3::new(1.0, 2.0, 3.0) * size, ..Inputs::default() });
    for (name, parameters, inputs) in drives {
        let mut failed = 0;
        let mut unit = Unit::new(&parameters, &inputs(0), None).unwrap();
        for i in 0..50 {
            if i % 20 == 5 {
                for violent in violent.iter().chain(&spun) {
                    let mut repeated = unit.clone();
                    if repeated.advance(violent, 0.05).is_ok() {
                        continue;
                    }
                    failed += 1;
                    assert_eq!(bits(&repeated), bits(&unit), "{name}, step {i}");
                    let mut other = unit.clone();
                    for j in i..i + 50 {
                        other.advance(&inputs(j), 0.01).unwrap();
                        repeated.advance(&inputs(j), 0.01).unwrap();
                        assert_eq!(bits(&repeated), bits(&other), "{name}, step {i} and {j}");
                    }
                }
            }
            unit.advance(&inputs(i), 0.01).unwrap();
        }
        assert!(failed >= 3, "{name}: {failed}");
    }
}

#[test]
fn a_rod_moved_slowly_is_the_same_without_inertia_as_with_it() {
    let wire = Parameters {
        radius: 1e-3,
        youngs_modulus: 2e11,
        shear_modulus: 2e11 / 2.6,
        density: 7850.0,
        ..Parameters::default()
    };
    let swayed = |t: f64| {
        let (sin, cos) = (TAU * 0.05 * t).sin_cos();
        let (angle, rate) = (0.25 * (1.0 - cos), 0.25 * TAU * 0.05 * sin);
        let half = 0.25 * TAU + angle;
        Inputs {
            base_orientation: Vector4::new((0.5 * half).cos(), 0.0, (0.5 * half).sin(), 0.0),
            base_angular_velocity: Vec3::y() * rate,
            ..Inputs::default()
        }
    };
    let weight = mass(&Parameters::default()) * 9.81;
    let loaded = |t: f64| {
        let part = 0.5 * (1.0 - (0.008 * TAU * t).cos());
        Inputs { tip_force: Vec3::new(0.5, 0.2, 0.0) * (weight * part), ..Inputs::default() }
    };
    // drag lets the rope come to rest, and holds it back by a few 1e-4
    let rope = Parameters { damping_bending: 0.05, damping_twist: 0.05, damping_drag: 0.02, ..Parameters::default() };
    type Slow<'a> = (&'a str, Parameters, &'a dyn Fn(f64) -> Inputs, f64);
    let scenes: [Slow; 2] = [("wire", wire, &swayed, 0.05), ("rope", rope, &loaded, 0.1)];
    for (name, parameters, inputs, h) in scenes {
        let full = Parameters { start_in_equilibrium: true, tolerance: 1e-4, ..parameters.clone() };
        let slow = Parameters { quasi_static: true, tolerance: 1e-3, ..parameters };
        let [mut full, mut slow] = [full, slow].map(|p| Unit::new(&p, &inputs(0.0), None).unwrap());
        let start = slow.outputs().energy;
        let (mut work, mut missed) = (0.0f64, 0.0f64);
        for i in 0..250 {
            for unit in [&mut full, &mut slow] {
                unit.advance(&inputs(f64::from(i) * h), h).unwrap();
            }
            let (full, slow) = (full.outputs(), slow.outputs());
            work = work.max(slow.energy.work_base.abs() + slow.energy.work_tip.abs());
            let away = (full.tip_position - slow.tip_position).norm();
            let force = (full.base_reaction_force - slow.base_reaction_force).norm() / full.base_reaction_force.norm();
            let speed = (full.tip_velocity - slow.tip_velocity).norm();
            let balance = slow.energy.residual(&start).abs();
            assert!(away < 1e-3 && force < 5e-3, "{name}, step {i}: tip {away:e}, force {force:e}");
            assert!(speed < 5e-3, "{name}, step {i}: {speed:e}");
            missed = missed.max(balance);
            assert_eq!(slow.energy.dissipated, 0.0);
        }
        // the work of the mean load, and the kinetic energy, which no force has made
        assert!(missed < 2e-3 * work, "{name}: {missed:e} of {work:e}");
    }
}

#[test]
fn a_rod_moved_slowly_through_a_limit_point_is_refused_and_goes_back() {
    // a cord that leans over its base falls to the other side once that has turned far enough
    let parameters = Parameters { quasi_static: true, base_motion: 2, ..Parameters::default() };
    let turning = |omega: f64| Inputs { base_angular_velocity: Vec3::y() * omega, ..Inputs::default() };
    let mut unit = Unit::new(&parameters, &Inputs::default(), None).unwrap();
    let mut turned = 0;
    let error = loop {
        assert!(turned < 200, "it never snaps");
        match unit.advance(&turning(-0.5), 0.1) {
            Ok(_) => turned += 1,
            Err(error) => break error,
        }
    };
    assert!(matches!(error, Error::NoEquilibriumNearby { .. }), "{error}");
    assert!(error.to_string().contains("quasi_static"), "{error}");
    // back, as one that was never refused
    let mut other = Unit::new(&parameters, &Inputs::default(), None).unwrap();
    for _ in 0..turned {
        other.advance(&turning(-0.5), 0.1).unwrap();
    }
    for _ in 0..turned {
        assert_eq!(bits(&unit), bits(&other));
        for unit in [&mut unit, &mut other] {
            unit.advance(&turning(0.5), 0.1).unwrap();
        }
    }
}

#[test]
fn the_powers_are_the_rates_of_the_works() {
    let h = 1e-3;
    let inputs = |t: f64| Inputs {
        base_position: Vec3::new(0.0, 0.02 * (1.0 - (6.0 * t).cos()), 0.0),
        base_velocity: Vec3::new(0.0, 0.12 * (6.0 * t).sin(), 0.0),
        tip_force: Vec3::new(0.0, 0.05, 0.02),
        tip_moment: Vec3::new(1e-3, 0.0, 0.0),
        ..Inputs::default()
    };
    let parameters = Parameters { start_in_equilibrium: true, ..Parameters::default() };
    let mut unit = Unit::new(&parameters, &inputs(0.0), Some(1e-5)).unwrap();
    let (mut base, mut tip, mut largest) = (0.0, 0.0, [0.0f64; 2]);
    for i in 0..300 {
        let before = unit.outputs().clone();
        unit.advance(&inputs(f64::from(i) * h), h).unwrap();
        let now = unit.outputs();
        base += 0.5 * h * (before.power_base + now.power_base);
        tip += 0.5 * h * (before.power_tip + now.power_tip);
        largest = [largest[0].max(now.energy.work_base.abs()), largest[1].max(now.energy.work_tip.abs())];
    }
    let energy = unit.outputs().energy;
    assert!((base - energy.work_base).abs() < 1e-2 * largest[0], "{base} {energy:?}");
    assert!((tip - energy.work_tip).abs() < 1e-2 * largest[1], "{tip} {energy:?}");
}
