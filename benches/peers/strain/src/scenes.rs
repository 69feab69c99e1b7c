//! The seven scenes of the charts: rod, base motion, tip load. SI units, world z up, clamped base, no damping.

use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

type Vec3 = Vector3<f64>;
type Mat3 = Matrix3<f64>;

/// Samples of a scene besides the one at its start.
pub const SAMPLES: usize = 100;

/// What drives the rod at one instant, world frame.
#[derive(Clone, Copy, Debug)]
pub struct Drive {
    /// Base point, m.
    pub position: Vec3,
    /// m/s.
    pub velocity: Vec3,
    /// m/s².
    pub acceleration: Vec3,
    /// Of the base section, body to world.
    pub rotation: Mat3,
    /// rad/s.
    pub angular_velocity: Vec3,
    /// rad/s².
    pub angular_acceleration: Vec3,
    /// Dead force on the tip, N.
    pub tip_force: Vec3,
    /// Dead moment on the tip, N m.
    pub tip_moment: Vec3,
}

/// A rod and how it is moved.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Its name.
    pub name: &'static str,
    /// m.
    pub length: f64,
    /// EI, N m².
    pub bending: f64,
    /// GJ, N m².
    pub torsion: f64,
    /// ρA, kg/m.
    pub mass_per_length: f64,
    /// ρI of bending, kg m; about the tangent it is twice that.
    pub inertia_per_length: f64,
    /// m/s².
    pub gravity: Vec3,
    /// Of the unstressed rod, body frame, 1/m.
    pub kappa_rest: Vec3,
    /// Of the base section at the start.
    pub rotation: Mat3,
    /// s.
    pub duration: f64,
    /// Whether it stays in the x-z plane.
    pub planar: bool,
    /// Whether its reaction is smooth enough to be measured.
    pub reaction: bool,
}

/// The names, in the order of the charts.
pub const NAMES: [&str; 7] = ["rope", "wire", "pulse", "spring", "hair", "spin", "umbilical"];

/// sin² of half a period from `start`, `width` long.
fn pulse(t: f64, start: f64, width: f64) -> f64 {
    let x = (t - start) / width;
    if x > 0.0 && x < 1.0 { (PI * x).sin().powi(2) } else { 0.0 }
}

/// r(t) = (1 − cos(πt/fade))/2, then 1: value, rate, second rate.
fn fade_in(t: f64, fade: f64) -> [f64; 3] {
    if t >= fade {
        return [1.0, 0.0, 0.0];
    }
    let k = PI / fade;
    let (sin, cos) = (k * t).sin_cos();
    [0.5 * (1.0 - cos), 0.5 * k * sin, 0.5 * k * k * cos]
}

/// r(t) sin(ωt): value, rate, second rate.
fn sway(t: f64, w: f64, fade: f64) -> [f64; 3] {
    let [r, v, a] = fade_in(t, fade);
    let (sin, cos) = (w * t).sin_cos();
    [r * sin, v * sin + r * w * cos, a * sin + 2.0 * v * w * cos - r * w * w * sin]
}

impl Scene {
    /// A rod of circular section: radius a in m, E and G in Pa, ρ in kg/m³; hanging, at rest, in gravity.
    fn circular(name: &'static str, length: f64, a: f64, youngs: f64, shear: f64, density: f64, duration: f64) -> Self {
        let (area, second) = (PI * a * a, PI * a.powi(4) / 4.0);
        Self {
            name,
            length,
            bending: youngs * second,
            torsion: shear * 2.0 * second,
            mass_per_length: density * area,
            inertia_per_length: density * second,
            gravity: Vec3::new(0.0, 0.0, -9.81),
            kappa_rest: Vec3::zeros(),
            rotation: Mat3::from_diagonal(&Vec3::new(-1.0, 1.0, -1.0)),
            duration,
            planar: true,
            reaction: true,
        }
    }

    /// The scene of a name.
    pub fn new(name: &str) -> Option<Self> {
        let rubber = |name, duration| Self::circular(name, 1.0, 5e-3, 5e6, 5e6 / 3.0, 1100.0, duration);
        let along_x = Mat3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0);
        Some(match name {
            "rope" => Self { rotation: along_x, reaction: false, ..rubber("rope", 1.0) },
            "wire" => Self::circular("wire", 1.0, 1e-3, 2e11, 2e11 / 2.6, 7850.0, 2.0),
            "pulse" => Self { planar: false, ..rubber("pulse", 1.0) },
            "spring" => {
                let (radius, b) = (0.02, 0.01 / (2.0 * PI));
                let c = f64::hypot(radius, b);
                let (d_1, d_3) = (-Vec3::x(), Vec3::new(0.0, radius, -b) / c);
                Self {
                    gravity: Vec3::zeros(),
                    kappa_rest: Vec3::new(0.0, radius, -b) / (c * c),
                    rotation: Mat3::from_columns(&[d_1, d_3.cross(&d_1), d_3]),
                    planar: false,
                    ..Self::circular("spring", 8.0 * PI * c, 1e-3, 2e11, 2e11 / 2.6, 7850.0, 0.2)
                }
            }
            "hair" => {
                let a = (1.5e-9 / PI).sqrt();
                let rod = Self::circular("hair", 0.25, a, 3.89e9, 0.89e9, 1320.0, 0.65);
                Self { rotation: along_x, reaction: false, ..rod }
            }
            "spin" => Self { planar: false, ..rubber("spin", 1.5) },
            "umbilical" => Self {
                length: 50.0,
                bending: 100.0,
                torsion: 77.0,
                mass_per_length: 1.2,
                inertia_per_length: 1.2 * 0.015f64.powi(2) / 4.0,
                ..rubber("umbilical", 24.0)
            },
            _ => return None,
        })
    }

    /// The drive at the time t.
    pub fn drive(&self, t: f64) -> Drive {
        let zero = Vec3::zeros();
        let mut drive = Drive {
            position: zero,
            velocity: zero,
            acceleration: zero,
            rotation: self.rotation,
            angular_velocity: zero,
            angular_acceleration: zero,
            tip_force: zero,
            tip_moment: zero,
        };
        match self.name {
            "wire" => {
                let x = sway(t, 4.0 * PI, 0.5).map(|x| Vec3::x() * (0.02 * x));
                [drive.position, drive.velocity, drive.acceleration] = x;
            }
            "pulse" => {
                drive.tip_force = Vec3::new(0.5 * pulse(t, 0.0, 0.2), 0.3 * pulse(t, 0.1, 0.2), 0.0);
                drive.tip_moment = Vec3::z() * (2e-3 * pulse(t, 0.0, 0.2));
            }
            "spring" => drive.tip_force = -Vec3::z() * pulse(t, 0.0, 0.05),
            "spin" => {
                let fade = 0.5;
                let [r, r_t, _] = fade_in(t, fade).map(|x| 2.0 * PI * x);
                // ψ = 2π ∫ r
                let psi =
                    if t < fade { PI * (t - fade / PI * (PI * t / fade).sin()) } else { 2.0 * PI * t - PI * fade };
                let (sin, cos) = psi.sin_cos();
                let (out, along) = (Vec3::new(cos, sin, 0.0) * 0.1, Vec3::new(-sin, cos, 0.0) * 0.1);
                drive.position = out;
                drive.velocity = along * r;
                drive.acceleration = along * r_t - out * (r * r);
                drive.rotation = Mat3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0) * self.rotation;
                drive.angular_velocity = Vec3::z() * r;
                drive.angular_acceleration = Vec3::z() * r_t;
            }
            "umbilical" => {
                let (x, z) = (sway(t, 2.0 * PI / 8.0, 8.0), sway(t, 2.0 * PI / 6.0, 8.0));
                let path: [Vec3; 3] = std::array::from_fn(|i| Vec3::new(x[i], 0.0, 0.5 * z[i]));
                [drive.position, drive.velocity, drive.acceleration] = path;
            }
            _ => {}
        }
        drive
    }
}
