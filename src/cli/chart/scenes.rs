//! The built-in scenes: rods whose bases move and whose tips are loaded by closed expressions of time, so that an error
//! is that of the integration alone. Nothing is damped. SI units, z up.

use cosserat_rod::boundary::{Boundary, Drive, Rates, Support};
use cosserat_rod::rod::Rod;
use cosserat_rod::unit::Parameters;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::{PI, TAU};

type Vec3 = Vector3<f64>;

/// A rod and what happens to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scene {
    Rope,
    Wire,
    Pulse,
    Spring,
    Hair,
    Spin,
    Umbilical,
}

/// Radius of the coil of the spring, its rise per radian, and its arc length per radian, m.
fn coil() -> (f64, f64, f64) {
    let (radius, rise) = (0.02, 0.01 / TAU);
    (radius, rise, f64::hypot(radius, rise))
}

impl Scene {
    pub const ALL: [Self; 7] =
        [Self::Rope, Self::Wire, Self::Pulse, Self::Spring, Self::Hair, Self::Spin, Self::Umbilical];

    pub fn name(self) -> &'static str {
        match self {
            Self::Rope => "rope",
            Self::Wire => "wire",
            Self::Pulse => "pulse",
            Self::Spring => "spring",
            Self::Hair => "hair",
            Self::Spin => "spin",
            Self::Umbilical => "umbilical",
        }
    }

    /// In a line.
    pub fn about(self) -> &'static str {
        match self {
            Self::Rope => "a rubber cord, 1 m long and 1 cm thick, is released from the horizontal; 1 s",
            Self::Wire => "a steel wire, 1 m long and 2 mm thick, hangs from a base shaken by 2 cm at 2 Hz; 2 s",
            Self::Pulse => "a pulse of force and moment hits the tip of the hanging rubber cord; 1 s",
            Self::Spring => "a steel coil of four turns, wire 2 mm, is pulled along its axis for 50 ms; 0.2 s",
            Self::Hair => "a hair, 25 cm long, is released from the horizontal; 0.65 s",
            Self::Spin => "the rubber cord hangs from a crank that begins to turn, once a second; 1.5 s",
            Self::Umbilical => "a line, 50 m long, hangs from a ship in waves; 24 s",
        }
    }

    /// What the unit would be told of it.
    pub fn parameters(self) -> Parameters {
        let round = |length: f64, radius: f64, youngs_modulus: f64, shear_modulus: f64, density: f64| Parameters {
            length,
            radius,
            youngs_modulus,
            shear_modulus,
            density,
            gravity: self.gravity(),
            damping_bending: 0.0,
            damping_twist: 0.0,
            start_in_equilibrium: self.starts_at_rest(),
            ..Parameters::default()
        };
        match self {
            Self::Rope | Self::Pulse | Self::Spin => round(1.0, 5e-3, 5e6, 5e6 / 3.0, 1100.0),
            Self::Wire => round(1.0, 1e-3, 2e11, 2e11 / 2.6, 7850.0),
            Self::Spring => {
                let (radius, rise, arc) = coil();
                Parameters {
                    rest_curvature: Vec3::new(0.0, radius, -rise) / (arc * arc),
                    ..round(4.0 * TAU * arc, 1e-3, 2e11, 2e11 / 2.6, 7850.0)
                }
            }
            Self::Hair => round(0.25, (1.5e-9 / PI).sqrt(), 3.89e9, 0.89e9, 1320.0),
            Self::Umbilical => {
                // EI = 100 N m², GJ = 77 N m², 1.2 kg/m
                let radius: f64 = 0.015;
                let (area, second_moment) = (PI * radius.powi(2), PI * radius.powi(4) / 4.0);
                round(50.0, radius, 100.0 / second_moment, 77.0 / (2.0 * second_moment), 1.2 / area)
            }
        }
    }

    pub fn rod(self) -> Rod {
        self.parameters().rod()
    }

    /// s.
    pub fn duration(self) -> f64 {
        match self {
            Self::Rope | Self::Pulse => 1.0,
            Self::Wire => 2.0,
            Self::Spring => 0.2,
            Self::Hair => 0.65,
            Self::Spin => 1.5,
            Self::Umbilical => 24.0,
        }
    }

    /// Whether it begins in equilibrium. A release does not: its reaction jumps, and none is compared.
    pub fn starts_at_rest(self) -> bool {
        !matches!(self, Self::Rope | Self::Hair)
    }

    /// What acts on the rod at a time, and how fast it changes: exact.
    pub fn drive(self, time: f64) -> Drive {
        let base = Support::at_rest(Vec3::zeros(), self.rotation());
        let mut boundary = Boundary::hanging_from(base, self.gravity());
        let mut rates = Rates::default();
        match self {
            Self::Rope | Self::Hair => {}
            Self::Wire => {
                let [x, x_t, x_tt, x_ttt] = sway(time, 2.0 * TAU, 0.5).map(|x| Vec3::x() * (0.02 * x));
                boundary.base = Support { position: x, velocity: x_t, acceleration: x_tt, ..base };
                rates.jerk = x_ttt;
            }
            Self::Pulse => {
                let ([now, rate], [late, late_rate]) = (pulse(time, 0.2), pulse(time - 0.1, 0.2));
                boundary.tip_force = Vec3::new(0.5 * now, 0.3 * late, 0.0);
                boundary.tip_moment = Vec3::z() * (2e-3 * now);
                rates.tip_force = Vec3::new(0.5 * rate, 0.3 * late_rate, 0.0);
                rates.tip_moment = Vec3::z() * (2e-3 * rate);
            }
            Self::Spring => [boundary.tip_force, rates.tip_force] = pulse(time, 0.05).map(|x| -Vec3::z() * x),
            Self::Spin => {
                let onset = 0.5;
                let [v, v_t, v_tt, _] = fade_in(time, onset).map(|x| TAU * x);
                let faded = time.min(onset);
                // ∫ v
                let angle = PI * (faded - onset / PI * (PI * faded / onset).sin()) + TAU * (time - faded);
                let (sin, cos) = angle.sin_cos();
                let (out, along) = (Vec3::new(cos, sin, 0.0) * 0.1, Vec3::new(-sin, cos, 0.0) * 0.1);
                let turned = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
                boundary.base = Support {
                    position: out,
                    rotation: turned * base.rotation,
                    velocity: along * v,
                    angular_velocity: Vec3::z() * v,
                    acceleration: along * v_t - out * (v * v),
                    ..base
                };
                rates.jerk = along * (v_tt - v.powi(3)) - out * (3.0 * v * v_t);
                rates.angular_acceleration = Vec3::z() * v_t;
            }
            Self::Umbilical => {
                let (x, z) = (sway(time, TAU / 8.0, 8.0), sway(time, TAU / 6.0, 8.0));
                let at = |k: usize| Vec3::new(x[k], 0.0, 0.5 * z[k]);
                boundary.base = Support { position: at(0), velocity: at(1), acceleration: at(2), ..base };
                rates.jerk = at(3);
            }
        }
        Drive { boundary, rates }
    }

    fn gravity(self) -> Vec3 {
        if self == Self::Spring { Vec3::zeros() } else { Vec3::z() * -9.81 }
    }

    /// What acts on the rod at a time.
    pub fn boundary(self, time: f64) -> Boundary {
        self.drive(time).boundary
    }

    /// Of the base at the start.
    fn rotation(self) -> Matrix3<f64> {
        match self {
            Self::Rope | Self::Hair => Matrix3::from_columns(&[-Vec3::z(), Vec3::y(), Vec3::x()]),
            Self::Spring => {
                let (radius, rise, arc) = coil();
                let (d_1, d_3) = (-Vec3::x(), Vec3::new(0.0, radius, -rise) / arc);
                Matrix3::from_columns(&[d_1, d_3.cross(&d_1), d_3])
            }
            _ => Matrix3::from_columns(&[-Vec3::x(), Vec3::y(), -Vec3::z()]),
        }
    }
}

/// sin² of half a period, `width` s long, and its rate.
fn pulse(time: f64, width: f64) -> [f64; 2] {
    if !(0.0..width).contains(&time) {
        return [0.0; 2];
    }
    let (sin, cos) = (PI * time / width).sin_cos();
    [sin * sin, TAU / width * sin * cos]
}

/// From 0 to 1 as half a cosine over `onset` s, with three derivatives.
fn fade_in(time: f64, onset: f64) -> [f64; 4] {
    if time >= onset {
        return [1.0, 0.0, 0.0, 0.0];
    }
    let k = PI / onset;
    let (sin, cos) = (k * time).sin_cos();
    [1.0 - cos, k * sin, k * k * cos, -k.powi(3) * sin].map(|x| 0.5 * x)
}

/// A sine of angular frequency `w` that fades in, with three derivatives.
fn sway(time: f64, w: f64, onset: f64) -> [f64; 4] {
    let [r, r_t, r_tt, r_ttt] = fade_in(time, onset);
    let (sin, cos) = (w * time).sin_cos();
    let [s, s_t, s_tt, s_ttt] = [sin, w * cos, -w * w * sin, -w.powi(3) * cos];
    [
        r * s,
        r_t * s + r * s_t,
        r_tt * s + 2.0 * r_t * s_t + r * s_tt,
        r_ttt * s + 3.0 * (r_tt * s_t + r_t * s_tt) + r * s_ttt,
    ]
}
