//! The static equilibrium of a rod between two given ends, found from its rest shape.
//!
//! Held at its tip from the start, a straight rod that cannot stretch yields to nothing. So it is first bent by a dead
//! force on its free tip, towards where the tip is to be, and then its tip is led there while the force is taken away.
//! Where that ends nowhere, or in an equilibrium that is unstable, other ways to pull are tried: each leads to the
//! equilibrium on its side.

use crate::boundary::{Boundary, Support};
use crate::modes;
use crate::so3;
use crate::stepper::{Diverged, Stepper};
use nalgebra::Vector3;

type Vec3 = Vector3<f64>;

/// The force that bends the rod first, over its weight, and over EI/L².
const PULL: (f64, f64) = (0.5, 2.0);
/// How far aside it points where it does, over how far it points to the tip's place.
const ASIDE: f64 = 0.7;
/// How long before the start the ends are where they come from, over the time in which the whole rod moves: their
/// motion is straight for so long, and the difference of two equilibria still has ten digits.
const BEFORE: f64 = 1e-5;

/// Brings the unstressed rod of `stepper`, with the cells it has, to a stable equilibrium under `boundary`, which holds its
/// tip; returns the lowest ω² there, 1/s², which is ≤ 0 if only unstable ones were found. Which one of several it is
/// depends on where the rod hangs without its tip being held.
///
/// # Errors
/// [`Diverged`] of the first way, if no way leads to any; the state is as before.
pub fn hang(stepper: &mut Stepper, boundary: &Boundary) -> Result<f64, Diverged> {
    let begin = stepper.state.clone();
    let mut refused = None;
    let mut unstable = None;
    for pull in pulls(stepper, boundary) {
        stepper.state.copy_from(&begin);
        let loose = Boundary { tip: Support::free(), tip_force: boundary.tip_force + pull, ..*boundary };
        let found = stepper.equilibrium(&loose).and_then(|_| stepper.equilibrium(boundary));
        match found.and_then(|_| modes::modes(stepper, boundary, 1)) {
            Ok(lowest) => {
                let omega_squared = lowest.iter().map(|mode| mode.omega_squared).fold(f64::INFINITY, f64::min);
                if omega_squared > 0.0 {
                    return Ok(omega_squared);
                }
                unstable.get_or_insert(omega_squared);
            }
            Err(diverged) => {
                refused.get_or_insert(diverged);
            }
        }
    }
    stepper.state.copy_from(&begin);
    match (unstable, refused) {
        (None, Some(diverged)) => Err(diverged),
        (unstable, _) => Ok(unstable.unwrap_or_default()),
    }
}

/// The dead forces on the free tip, in the order in which they are tried.
fn pulls(stepper: &Stepper, boundary: &Boundary) -> [Vec3; 6] {
    let Stepper { mesh, rod, .. } = stepper;
    let length = mesh.length();
    let weight = (rod.mass_per_length * length + rod.tip_mass) * boundary.gravity.norm();
    let size = PULL.0 * weight + PULL.1 * rod.stiffness.x.min(rod.stiffness.y) / (length * length);
    let along = (boundary.tip.position - boundary.base.position)
        .try_normalize(1e-9 * length)
        .unwrap_or(boundary.base.rotation.column(0).into_owned());
    // two directions across, whichever the axis
    let across = along.cross(&Vec3::ith(along.iamin(), 1.0)).normalize();
    let other = along.cross(&across);
    let aside = |way: Vec3| (along + way * ASIDE).normalize() * size;
    [along * size, aside(across), aside(-across), aside(other), aside(-other), Vec3::zeros()]
}

/// Sets the velocities of the rod in equilibrium under `boundary` to those of its equilibria as both ends move, where they
/// do not move as one rigid body; whether they do not. `time` is the shortest one in which gravity or stiffness move the
/// whole rod, s.
///
/// # Errors
/// [`Diverged`] if there is no equilibrium as near as that; the state is as before.
pub fn set_in_motion(stepper: &mut Stepper, boundary: &Boundary, time: f64) -> Result<bool, Diverged> {
    let Boundary { base, tip, .. } = boundary;
    let carried = base.angular_velocity.cross(&(tip.position - base.position));
    let apart = (tip.velocity - base.velocity - carried).norm();
    let turning = (tip.angular_velocity - base.angular_velocity).norm();
    // nothing but rounding
    let rounding = |of: f64| 1e-12 * of;
    if apart <= rounding(base.velocity.norm() + carried.norm()) && turning <= rounding(base.angular_velocity.norm()) {
        return Ok(false);
    }
    let begin = stepper.state.clone();
    let ago = BEFORE * time;
    let earlier = |end: &Support| Support {
        position: end.position - end.velocity * ago,
        rotation: so3::exp(&(end.angular_velocity * -ago)) * end.rotation,
        ..*end
    };
    let moved = stepper.relax(&Boundary { base: earlier(base), tip: earlier(tip), ..*boundary });
    match moved.and_then(|_| stepper.drift(boundary, ago)) {
        Ok(_) => Ok(true),
        Err(diverged) => {
            stepper.state.copy_from(&begin);
            Err(diverged)
        }
    }
}
