//! Two long rods: what the unit is told of a line in waves, and of a helix of 50 turns.

use cosserat_rod::boundary::Boundary;
use cosserat_rod::so3;
use cosserat_rod::unit::{Inputs, Parameters};
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// What a boundary is to the unit.
pub fn inputs(boundary: &Boundary) -> Inputs {
    let base = &boundary.base;
    Inputs {
        base_position: base.position,
        base_orientation: so3::quaternion(&base.rotation),
        base_velocity: base.velocity,
        base_angular_velocity: base.angular_velocity,
        tip_force: boundary.tip_force,
        tip_moment: boundary.tip_moment,
        ..Inputs::default()
    }
}

/// A steel coil of 50 turns, 4 cm wide and 1 cm a turn, wire 2 mm, that falls with its base held.
pub fn helix(cells: i32) -> Parameters {
    let (radius, rise) = (0.02, 0.01 / TAU);
    let arc = f64::hypot(radius, rise);
    Parameters {
        length: 50.0 * TAU * arc,
        radius: 1e-3,
        density: 7850.0,
        youngs_modulus: 2e11,
        shear_modulus: 2e11 / 2.6,
        rest_curvature: Vector3::new(0.0, radius, -rise) / (arc * arc),
        cells,
        stages: 2,
        ..Parameters::default()
    }
}
