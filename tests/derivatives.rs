//! Derivatives by time: inputs that go on by theirs, and how fast the motion then converges in the communication step.

use cosserat_rod::unit::{Derivatives, Inputs, Parameters, Unit};
use nalgebra::Vector3;

type Vec3 = Vector3<f64>;

/// End of the runs, s.
const END: f64 = 0.8;

/// What is given beyond the inputs: derivatives up to this order.
fn inputs(t: f64, order: usize) -> (Inputs, Derivatives) {
    let (x, w) = (0.05, 6.0);
    let (sin, cos) = (w * t).sin_cos();
    let (pull, v) = (0.05, 5.0);
    let load = [pull * (v * t).sin(), pull * v * (v * t).cos(), -pull * v * v * (v * t).sin()];
    let motion = [x * (1.0 - cos), x * w * sin, x * w * w * cos, -x * w * w * w * sin];
    let inputs = Inputs {
        base_position: Vec3::y() * motion[0],
        base_velocity: Vec3::y() * motion[1],
        tip_force: Vec3::x() * load[0],
        ..Inputs::default()
    };
    let mut derivatives = Derivatives::default();
    if order > 0 {
        derivatives.first.base_position = Vec3::y() * motion[1];
        derivatives.first.base_velocity = Vec3::y() * motion[2];
        derivatives.first.tip_force = Vec3::x() * load[1];
    }
    if order > 1 {
        derivatives.second.base_position = Vec3::y() * motion[2];
        derivatives.second.base_velocity = Vec3::y() * motion[3];
        derivatives.second.tip_force = Vec3::x() * load[2];
    }
    (inputs, derivatives)
}

fn tip(motion: i32, order: usize, steps: usize) -> Vec3 {
    let parameters = Parameters { tolerance: 1e-7, base_motion: motion, ..Parameters::default() };
    let h = END / steps as f64;
    let mut unit = Unit::new(&parameters, &inputs(0.0, 0).0, None).unwrap();
    for k in 0..steps {
        let (inputs, derivatives) = inputs(k as f64 * h, order);
        unit.advance_along(&inputs, &derivatives, h).unwrap();
    }
    unit.outputs().tip_position
}

#[test]
fn explore() {
    for motion in [0, 1, 2] {
        let exact = tip(motion, 2, 800);
        for order in [0, 1, 2] {
            let errors: Vec<f64> = [8, 16, 32, 64].map(|n| (tip(motion, order, n) - exact).norm()).to_vec();
            println!("{motion} {order} {errors:?}");
        }
    }
}
