//! Derivatives by time: inputs that go on by theirs, and how fast the motion then converges in the communication step; and
//! those of the outputs.

use cosserat_rod::fmi2::host::{Error, Fmu};
use cosserat_rod::fmi2::variables::Kind;
use cosserat_rod::package;
use cosserat_rod::unit::{Derivatives, Inputs, Outputs, Parameters, Unit};
use nalgebra::Vector3;
use std::ptr;

type Vec3 = Vector3<f64>;

/// End of the runs, s.
const END: f64 = 0.8;

/// A base that sways and a tip that is pulled, with derivatives up to `order`.
fn swaying(t: f64, order: usize) -> (Inputs, Derivatives) {
    let (x, w) = (0.05, 6.0);
    let (sin, cos) = (w * t).sin_cos();
    let motion = [x * (1.0 - cos), x * w * sin, x * w * w * cos, -x * w * w * w * sin];
    let (pull, v) = (0.05, 5.0);
    let load = [pull * (v * t).sin(), pull * v * (v * t).cos(), -pull * v * v * (v * t).sin()];
    let inputs = Inputs {
        base_position: Vec3::y() * motion[0],
        base_velocity: Vec3::y() * motion[1],
        tip_force: Vec3::x() * load[0],
        ..Inputs::default()
    };
    let mut derivatives = Derivatives::default();
    for (k, of) in [&mut derivatives.first, &mut derivatives.second].into_iter().enumerate().take(order) {
        of.base_position = Vec3::y() * motion[k + 1];
        of.base_velocity = Vec3::y() * motion[k + 2];
        of.tip_force = Vec3::x() * load[k + 1];
    }
    (inputs, derivatives)
}

fn tip_after(motion: i32, order: usize, steps: usize) -> Vec3 {
    // far below what the communication steps leave
    let parameters = Parameters { tolerance: 1e-7, base_motion: motion, ..Parameters::default() };
    let h = END / steps as f64;
    let mut unit = Unit::new(&parameters, &swaying(0.0, 0).0, None).unwrap();
    for k in 0..steps {
        let (inputs, derivatives) = swaying(k as f64 * h, order);
        unit.advance_along(&inputs, &derivatives, h).unwrap();
    }
    unit.outputs().tip_position
}

#[test]
fn the_motion_gains_an_order_in_the_communication_step_with_every_derivative() {
    for motion in [0, 1, 2] {
        let exact = tip_after(motion, 2, 800);
        let errors = |order: usize| [16, 32, 64].map(|steps| (tip_after(motion, order, steps) - exact).norm());
        let [held, once, twice] = [0, 1, 2].map(errors);
        // over two halvings, from 50 ms
        let slope = |errors: &[f64; 3]| (errors[0] / errors[2]).log2() / 2.0;
        let slopes = [&held, &once, &twice].map(slope);
        assert!(slopes[0] > 0.9 && slopes[1] > 1.8 && slopes[2] > 2.2, "{motion}: {slopes:?}");
        assert!(held[0] > 5.0 * once[0] && once[0] > 2.0 * twice[0], "{motion}: {held:?} {once:?} {twice:?}");
    }
}

/// What is constant is the same in steps of any length, to the tolerance, and of such as a host's rounding makes them.
#[test]
fn communication_steps_do_not_matter_while_nothing_changes() {
    let tolerance = 1e-4;
    for push in [Vec3::zeros(), Vec3::y() * 0.03] {
        let inputs = Inputs { tip_force: push, ..Inputs::default() };
        let end_of = |step: &dyn Fn(usize) -> f64| {
            let parameters = Parameters { tolerance, ..Parameters::default() };
            let mut unit = Unit::new(&parameters, &inputs, None).unwrap();
            let (mut time, mut k) = (0.0, 0);
            while time < 1.0 - 1e-9 {
                let h = step(k).min(1.0 - time);
                unit.advance(&inputs, h).unwrap();
                (time, k) = (time + h, k + 1);
            }
            unit.outputs().tip_position
        };
        let uneven = |k: usize| 0.002 + 0.07 * (0.5 + 0.5 * (7.3 * k as f64 * k as f64).sin());
        let exact = end_of(&|_| 0.01);
        for (name, tip) in [
            ("0.1", end_of(&|_| 0.1)),
            ("0.001", end_of(&|_| 0.001)),
            ("uneven", end_of(&uneven)),
            ("a third", end_of(&|_| 1.0 / 3.0)),
        ] {
            assert!((tip - exact).norm() < tolerance, "{name}: {}", (tip - exact).norm());
        }
    }
}

/// Numbers of some outputs.
type Some = fn(&Outputs) -> Vec<f64>;

#[test]
fn outputs_change_as_their_derivatives_say() {
    // known, to the error of the central difference; and half a step late
    let known: [Some; 3] = [
        |o| o.tip_position.iter().copied().collect(),
        |o| o.tip_orientation.iter().copied().collect(),
        |o| vec![o.energy.work_base, o.energy.work_tip],
    ];
    let late: [Some; 3] = [
        |o| o.tip_velocity.iter().copied().collect(),
        |o| o.base_reaction_force.iter().copied().collect(),
        |o| o.stations[5].iter().copied().collect(),
    ];
    let norm = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>().sqrt();
    for parameters in [
        Parameters::default(),
        Parameters { step: 0.002, ..Parameters::default() },
        Parameters { extensible: true, ..Parameters::default() },
    ] {
        let h = 1e-3;
        let mut unit = Unit::new(&parameters, &swaying(0.0, 0).0, None).unwrap();
        assert!(unit.rates().is_err());
        let (mut outputs, mut rates) = (Vec::new(), Vec::new());
        for k in 0..300 {
            let (inputs, derivatives) = swaying(k as f64 * h, 2);
            unit.advance_along(&inputs, &derivatives, h).unwrap();
            outputs.push(unit.outputs().clone());
            rates.push(unit.rates().unwrap());
        }
        let compare = |of: Some, k: usize, relative: f64| {
            let (before, after, rate) = (of(&outputs[k - 1]), of(&outputs[k + 1]), of(&rates[k]));
            let central: Vec<f64> = after.iter().zip(&before).map(|(a, b)| (a - b) / (2.0 * h)).collect();
            let difference: Vec<f64> = rate.iter().zip(&central).map(|(a, b)| a - b).collect();
            assert!(norm(&difference) < relative * norm(&central), "{k}: {rate:?} {central:?}");
        };
        for k in [150, 290] {
            known.iter().for_each(|of| compare(*of, k, 2e-3));
            late.iter().for_each(|of| compare(*of, k, 0.1));
        }
    }
}

fn refused<T: std::fmt::Debug>(answer: Result<T, Error>, words: &[&str]) {
    let text = answer.unwrap_err().to_string();
    assert!(words.iter().all(|word| text.contains(word)), "{text}");
}

#[test]
fn derivatives_are_given_and_asked_for_through_the_interface() {
    let fmu = Fmu::from_library(&package::library().unwrap()).unwrap();
    let real = |name: &str| fmu.description.reference(name, Kind::Real).unwrap();
    let (force, tip, velocity) = (real("tip.force[2]"), real("tip.position[2]"), real("tip.velocity[2]"));
    let slave = fmu.instantiate("rod", false).unwrap();
    slave.setup_experiment(0.0, None, None).unwrap();
    slave.enter_initialization_mode().unwrap();
    slave.exit_initialization_mode().unwrap();
    refused(slave.output_derivatives(&[tip]), &["no step yet"]);
    let get = |reference: u32| {
        let mut value = [0.0];
        slave.get_real(&[reference], &mut value).unwrap();
        value[0]
    };
    let mut state = ptr::null_mut();
    slave.get_state(&mut state).unwrap();
    let stepped = |rate: Option<f64>| {
        slave.set_state(state).unwrap();
        if let Some(rate) = rate {
            slave.set_input_derivatives(&[force], 1, &[rate]).unwrap();
        }
        slave.do_step(0.0, 0.02).unwrap();
        let first = get(tip);
        slave.do_step(0.02, 0.02).unwrap();
        (first, get(tip))
    };
    let (still, _) = stepped(None);
    let (pulled, then) = stepped(Some(1.0));
    assert!(still.abs() < 1e-12 && pulled > 1e-4, "{still} {pulled}");
    // they lapse: the force is zero again in the step that follows, and the tip goes on with the velocity it has
    assert_eq!(slave.output_derivatives(&[tip]).unwrap(), [get(velocity)]);
    assert!(then > pulled, "{then} {pulled}");

    // those that wait for their step are part of a state
    slave.set_state(state).unwrap();
    slave.set_input_derivatives(&[force], 1, &[1.0]).unwrap();
    let mut waiting = ptr::null_mut();
    slave.get_state(&mut waiting).unwrap();
    slave.set_state(state).unwrap();
    slave.set_state(waiting).unwrap();
    slave.do_step(0.0, 0.02).unwrap();
    assert_eq!(get(tip).to_bits(), pulled.to_bits());

    refused(slave.set_input_derivatives(&[force], 3, &[1.0]), &["order 3", "tip.force[2]", "1 and 2"]);
    refused(slave.set_input_derivatives(&[tip], 1, &[1.0]), &["tip.position[2]", "inputs"]);
    refused(slave.set_input_derivatives(&[force], 1, &[f64::NAN]), &["tip.force[2] = NaN", "finite"]);
    refused(slave.output_derivatives(&[force]), &["tip.force[2]", "outputs"]);
    assert_eq!(get(tip).to_bits(), pulled.to_bits());
    for state in [&mut state, &mut waiting] {
        slave.free_state(state).unwrap();
    }
}
