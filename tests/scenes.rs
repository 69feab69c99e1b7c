//! The built-in scenes against themselves.
#![allow(missing_docs)]

#[allow(dead_code)]
#[path = "../src/cli/chart/scenes.rs"]
mod scenes;

use cosserat_rod::boundary::Drive;
use cosserat_rod::so3;
use scenes::Scene;

/// Central differences of what a scene says, against what it says of their rates.
#[test]
fn rates_are_those_of_the_motion() {
    let step = 1e-5;
    for scene in Scene::ALL {
        for k in 0..40 {
            // no instant at which a fade or pulse ends
            let time = scene.duration() * (f64::from(k) + 0.37) / 40.0;
            let [before, after] = [time - step, time + step].map(|time| scene.drive(time).boundary);
            let Drive { boundary, rates } = scene.drive(time);
            let base = boundary.base;
            let turn = so3::log(&(after.base.rotation * before.base.rotation.transpose()));
            let pairs = [
                (after.base.position - before.base.position, base.velocity),
                (after.base.velocity - before.base.velocity, base.acceleration),
                (after.base.acceleration - before.base.acceleration, rates.jerk),
                (turn, base.angular_velocity),
                (after.base.angular_velocity - before.base.angular_velocity, rates.angular_acceleration),
                (after.tip_force - before.tip_force, rates.tip_force),
                (after.tip_moment - before.tip_moment, rates.tip_moment),
            ];
            for (number, (change, rate)) in pairs.into_iter().enumerate() {
                let error = (change / (2.0 * step) - rate).norm();
                assert!(error < 1e-5 * (1.0 + rate.norm()), "{scene:?} at {time} s, rate {number}: {error:.1e}");
            }
        }
    }
}
