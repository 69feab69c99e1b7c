//! Three scenes: a rubber rod released from the horizontal (S1), a steel wire on a shaken base (S2), a hanging rubber
//! rod under a spatial pulse at its tip (S3). All are 1 m long.

use cosserat_rod::boundary::{Boundary, Support};
use cosserat_rod::rod::Rod;
use cosserat_rod::so3;
use nalgebra::{Matrix3, Vector3, Vector4};
use std::f64::consts::PI;

/// The scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scene {
    S1,
    S2,
    S3,
}

impl Scene {
    pub fn rod(&self) -> Rod {
        match self {
            Self::S1 | Self::S3 => Rod::circular(5e-3, 5e6, 5e6 / 3.0, 1100.0),
            Self::S2 => Rod::circular(1e-3, 2e11, 2e11 / 2.6, 7850.0),
        }
    }

    fn orientation(&self) -> Matrix3<f64> {
        so3::from_quaternion(&match self {
            Self::S1 => Vector4::new(0.5f64.sqrt(), 0.0, 0.5f64.sqrt(), 0.0),
            Self::S2 | Self::S3 => Vector4::new(0.0, 1.0, 0.0, 0.0),
        })
    }

    /// Base and loads at a time.
    pub fn boundary(&self, time: f64) -> Boundary {
        let mut boundary = Boundary::hanging_from(
            Support::at_rest(Vector3::zeros(), self.orientation()),
            Vector3::new(0.0, 0.0, -9.81),
        );
        match self {
            Self::S1 => {}
            Self::S2 => {
                // 2 cm at 2 Hz, faded in over half a second
                let (amplitude, w, k) = (0.02, 4.0 * PI, 2.0 * PI);
                let (sin, cos) = (w * time).sin_cos();
                let (fade, fade_t, fade_tt) = if time < 0.5 {
                    (0.5 * (1.0 - (k * time).cos()), 0.5 * k * (k * time).sin(), 0.5 * k * k * (k * time).cos())
                } else {
                    (1.0, 0.0, 0.0)
                };
                boundary.base.position.x = amplitude * fade * sin;
                boundary.base.velocity.x = amplitude * (fade_t * sin + fade * w * cos);
                boundary.base.acceleration.x =
                    amplitude * (fade_tt * sin + 2.0 * fade_t * w * cos - fade * w * w * sin);
            }
            Self::S3 => {
                let pulse = |begin: f64| {
                    let x = (time - begin) / 0.2;
                    if (0.0..1.0).contains(&x) { (PI * x).sin().powi(2) } else { 0.0 }
                };
                boundary.tip_force = Vector3::new(0.5 * pulse(0.0), 0.3 * pulse(0.1), 0.0);
                boundary.tip_moment = Vector3::new(0.0, 0.0, 2e-3 * pulse(0.0));
            }
        }
        boundary
    }
}
