//! The rod: section, material, and what is attached to its tip.
//!
//! K = diag(EI₁, EI₂, GJ) resists bending and twist, C = diag(1/GA, 1/GA, 1/EA) yields to shear and stretch:
//!
//! ```text
//! Rᵀm = K (κ − κ̂ + τ κ_t)          r_s = R (e₃ + C Rᵀn)
//! ```
//!
//! C = 0 is the Kirchhoff rod of the paper (eq 11 and section 3.2), not a second model. τ are Kelvin-Voigt time
//! constants.

use nalgebra::Vector3;
use std::f64::consts::PI;

/// A uniform rod, in SI units and body-frame components.
#[derive(Clone, Debug, PartialEq)]
pub struct Rod {
    /// K, N·m².
    pub stiffness: Vector3<f64>,
    /// C, 1/N; zero = neither shear nor stretch.
    pub compliance: Vector3<f64>,
    /// ρA, kg/m.
    pub mass_per_length: f64,
    /// ρ(I₁, I₂, I₁ + I₂), kg·m.
    pub inertia_per_length: Vector3<f64>,
    /// τ, s.
    pub damping: Vector3<f64>,
    /// Drag force per length and velocity, N·s/m².
    pub drag: f64,
    /// Mass at the tip, kg.
    pub tip_mass: f64,
    /// Its isotropic inertia about the tip point, kg·m².
    pub tip_inertia: f64,
}

impl Rod {
    /// An undamped Kirchhoff rod of circular section: radius a in m, E and G in Pa, ρ in kg/m³.
    pub fn circular(radius: f64, youngs_modulus: f64, shear_modulus: f64, density: f64) -> Self {
        let area = PI * radius * radius;
        let second_moment = area * radius * radius / 4.0;
        let bending = youngs_modulus * second_moment;
        let inertia = density * second_moment;
        Self {
            stiffness: Vector3::new(bending, bending, shear_modulus * 2.0 * second_moment),
            compliance: Vector3::zeros(),
            mass_per_length: density * area,
            inertia_per_length: Vector3::new(inertia, inertia, 2.0 * inertia),
            damping: Vector3::zeros(),
            drag: 0.0,
            tip_mass: 0.0,
            tip_inertia: 0.0,
        }
    }

    /// Drag per mass, 1/s.
    pub fn drag_rate(&self) -> f64 {
        self.drag / self.mass_per_length
    }

    /// Whether the section shears or stretches.
    pub fn is_extensible(&self) -> bool {
        self.compliance != Vector3::zeros()
    }
}
