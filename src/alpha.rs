//! The generalized-α scheme in time: from the increment of a variable to its rates. It knows no rod.
//!
//! In the paper's convention (eqs 17 and 19) α and β weigh the *old* end of the step and γ the new one:
//!
//! ```text
//! (1−α) ẋᵢ + α ẋᵢ₋₁ = (1−β) vᵢ + β vᵢ₋₁          xᵢ = xᵢ₋₁ + Δt [(1−γ) ẋᵢ₋₁ + γ ẋᵢ]
//! ```
//!
//! v is the rate that enters the equations of motion at tᵢ; the auxiliary rate ẋ only carries memory. Applied to x and
//! then to v it yields the acceleration a. Second order needs α − β + γ = ½; the spectral radius at infinite frequency
//! is then max(β/(1−β), (1−γ)/γ), and one parameter ρ∞ = −λ∞ gives all three (Chung and Hulbert 1993; the paper,
//! section 4.2).
//!
//! On a smooth motion the scheme's rates differ from the true ones by a *shift* that depends on Δt,
//!
//! ```text
//! ẋᵢ = v + (½−γ) Δt a + e Δt² ȧ,  e = 1/6 − γ(1−γ)          vᵢ = v + (e + αγ − β/2) Δt² ȧ
//! ```
//!
//! up to O(Δt³). A start, and a change of Δt or of the scheme, put the rates there ([`Scheme::started`],
//! [`Scheme::rebased`]); otherwise the acceleration of whatever is too stiff to follow its own dynamics, and with it
//! the reaction, begins every such step with an error O(Δt) that decays slowly, and never at ρ∞ = 1.

use crate::archive::archived;
use nalgebra::Vector3;

/// The three weights (α, β, γ).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scheme {
    /// Weight of the old auxiliary rate.
    pub alpha: f64,
    /// Weight of the old rate.
    pub beta: f64,
    /// Weight of the new auxiliary rate in the update.
    pub gamma: f64,
}

/// A rate v with its auxiliary rate ẋ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rate {
    /// ẋ.
    pub auxiliary: Vector3<f64>,
    /// v.
    pub value: Vector3<f64>,
}

/// The history of a second-order variable: v and a, their auxiliary rates, and ȧ as the last step saw it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// v, with ẋ.
    pub velocity: Rate,
    /// a, with v̇.
    pub acceleration: Rate,
    /// ȧ, first-order accurate.
    pub jerk: Vector3<f64>,
}

archived!(Scheme { alpha, beta, gamma });
archived!(Rate { auxiliary, value });
archived!(Motion { velocity, acceleration, jerk });

impl Scheme {
    /// Implicit Euler: first order, no memory in the auxiliary rates.
    pub const BACKWARD_EULER: Self = Self { alpha: 0.0, beta: 0.0, gamma: 1.0 };

    /// The second-order member with spectral radius ρ∞ ∈ [0, 1] at infinite frequency (λ∞ = −ρ∞).
    pub fn from_spectral_radius(rho: f64) -> Self {
        Self { alpha: (3.0 * rho - 1.0) / (2.0 * rho + 2.0), beta: rho / (1.0 + rho), gamma: 1.0 / (1.0 + rho) }
    }

    /// Whether α − β + γ = ½, up to rounding.
    pub fn is_second_order(&self) -> bool {
        (self.alpha - self.beta + self.gamma - 0.5).abs() < 1e-12
    }

    /// ∂v/∂x at tᵢ, in 1/s; its square is ∂a/∂x.
    pub fn rate_weight(&self, dt: f64) -> f64 {
        (1.0 - self.alpha) / ((1.0 - self.beta) * self.gamma * dt)
    }

    /// ẋᵢ from xᵢ − xᵢ₋₁ and ẋᵢ₋₁ (eq 19; with arc length in place of time eq 20).
    #[inline]
    pub fn auxiliary(&self, old: &Vector3<f64>, increment: &Vector3<f64>, dt: f64) -> Vector3<f64> {
        increment / (self.gamma * dt) - old * ((1.0 - self.gamma) / self.gamma)
    }

    /// The rates at tᵢ from xᵢ − xᵢ₋₁ and the rates at tᵢ₋₁ (eq 19, then eq 17).
    #[inline]
    pub fn rate(&self, old: &Rate, increment: &Vector3<f64>, dt: f64) -> Rate {
        let Self { alpha, beta, .. } = *self;
        let auxiliary = self.auxiliary(&old.auxiliary, increment, dt);
        let value = (auxiliary * (1.0 - alpha) + old.auxiliary * alpha - old.value * beta) / (1.0 - beta);
        Rate { auxiliary, value }
    }

    /// Both rates at tᵢ: [`Self::rate`] applied twice.
    #[inline]
    pub fn motion(&self, old: &Motion, increment: &Vector3<f64>, dt: f64) -> Motion {
        let velocity = self.rate(&old.velocity, increment, dt);
        let acceleration = self.rate(&old.acceleration, &(velocity.value - old.velocity.value), dt);
        Motion { velocity, acceleration, jerk: (acceleration.value - old.acceleration.value) / dt }
    }

    /// The history of a variable whose v and a at tᵢ come from elsewhere; the auxiliary rates follow eq 19.
    #[inline]
    pub fn followed(
        &self,
        old: &Motion,
        increment: &Vector3<f64>,
        v: Vector3<f64>,
        a: Vector3<f64>,
        dt: f64,
    ) -> Motion {
        Motion {
            velocity: Rate { value: v, ..self.rate(&old.velocity, increment, dt) },
            acceleration: Rate { value: a, ..self.rate(&old.acceleration, &(v - old.velocity.value), dt) },
            jerk: (a - old.acceleration.value) / dt,
        }
    }

    /// The coefficients of Δt a and Δt² ȧ in ẋᵢ, and of Δt² ȧ in vᵢ, on a smooth motion.
    fn shift(&self) -> [f64; 3] {
        let Self { alpha, beta, gamma } = *self;
        let first = 0.5 - gamma;
        let second = 1.0 / 6.0 - gamma * (1.0 - gamma);
        [first, second, second + alpha * gamma - 0.5 * beta]
    }

    /// The true rates at the start of a motion as the history for steps of `dt`.
    pub fn started(&self, motion: &Motion, dt: f64) -> Motion {
        let [first, second, value] = self.shift();
        let Motion { velocity, acceleration, jerk } = *motion;
        let (by, by2) = (acceleration.value * (first * dt), dt * dt);
        Motion {
            velocity: Rate {
                auxiliary: velocity.value + by + jerk * (second * by2),
                value: velocity.value + jerk * (value * by2),
            },
            acceleration: Rate { auxiliary: acceleration.value + jerk * (first * dt), ..acceleration },
            jerk,
        }
    }

    /// The history after steps of `dt` with the scheme `before`, for steps of `new` with this one: the auxiliary rates
    /// move with their shift, in first order. (In second order, rates of what is too stiff to be followed would feed on
    /// themselves where the step changes often.)
    pub fn rebased(&self, motion: &Motion, before: &Self, dt: f64, new: f64) -> Motion {
        let first = self.shift()[0] * new - before.shift()[0] * dt;
        let mut rebased = *motion;
        rebased.velocity.auxiliary += motion.acceleration.value * first;
        rebased.acceleration.auxiliary += motion.jerk * first;
        rebased
    }
}

impl Motion {
    /// Whether all its numbers are.
    pub fn is_finite(&self) -> bool {
        let Self { velocity: v, acceleration: a, jerk } = self;
        let vectors = [&v.auxiliary, &v.value, &a.auxiliary, &a.value, jerk];
        vectors.into_iter().all(|vector| vector.iter().all(|x| x.is_finite()))
    }

    /// The true rates v, a and ȧ at the start of a motion.
    pub fn starting(v: Vector3<f64>, a: Vector3<f64>, jerk: Vector3<f64>) -> Self {
        Self { velocity: Rate::at_start(v), acceleration: Rate::at_start(a), jerk }
    }
}

impl Rate {
    /// The true rate at the start of a motion.
    pub fn at_start(value: Vector3<f64>) -> Self {
        Self { auxiliary: value, value }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backward_euler_needs_no_auxiliary_rates() {
        let junk = Rate { auxiliary: Vector3::new(7.0, -3.0, 1e9), value: Vector3::new(5.0, 5.0, 5.0) };
        let dx = Vector3::new(1.0, 2.0, 3.0);
        let rate = Scheme::BACKWARD_EULER.rate(&junk, &dx, 0.5);
        assert_eq!(rate.value, dx / 0.5);
    }

    #[test]
    fn the_smooth_motion_is_a_fixed_point_to_second_order() {
        // x = t⁴/24 about t = 1: with exact increments v must be right to O(Δt²) and a as well, without a transient
        let error = |rho: f64, dt: f64| {
            let scheme = Scheme::from_spectral_radius(rho);
            let at = |t: f64| Vector3::new(t.powi(3) / 6.0, t.powi(2) / 2.0, t);
            let x = |t: f64| t.powi(4) / 24.0;
            let s = at(1.0);
            let e = Vector3::x();
            let start = Motion::starting(e * s[0], e * s[1], e * s[2]);
            let mut motion = scheme.started(&start, dt);
            let mut worst = 0.0f64;
            for i in 0..5 {
                let t = 1.0 + i as f64 * dt;
                motion = scheme.motion(&motion, &(e * (x(t + dt) - x(t))), dt);
                let exact = at(t + dt);
                worst = worst.max((motion.velocity.value[0] - exact[0]).abs());
                worst = worst.max((motion.acceleration.value[0] - exact[1]).abs());
            }
            worst
        };
        for rho in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let order = (error(rho, 1e-2) / error(rho, 5e-3)).log2();
            assert!((order - 2.0).abs() < 0.1, "radius {rho}: order {order}");
        }
    }
}
