//! The other classical way to solve the boundary value problem of a step: guess κ and n at the base, march to the tip
//! cell by cell, and correct the guess by what the tip misses. The discrete equations are those of the mended rate
//! formulation; their first step, which also starts the rates, is taken by relaxation.
//!
//! The march follows solutions that grow from the base to the tip. With c = ∂ω_t/∂ω of a step and the tension T of the
//! hanging rod, transverse motion obeys EI w'''' − T w'' + ρA c² w = …; a root k of its characteristic equation grows in
//! a cell of length h of the trapezoidal box by (1 + kh/2)/(1 − kh/2), and over the rod by the product of these. At
//! e³⁶ = 1/ε nothing of the guess is left at the tip. Newton on the guess ends before: measured, from about e¹² on.
//! Long rods, thin rods and small steps are the bad ones; at very small ones the box no longer follows what grows.

use crate::scene::GRAVITY;
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::Boundary;
use cosserat_rod::energy::Energy;
use cosserat_rod::formulation::Formulation;
use cosserat_rod::pose::Section;
use cosserat_rod::rate::{Node, Step, Stepper, Unknowns};
use cosserat_rod::rod::Rod;
use cosserat_rod::stepper::{Diverged, Reason, Report, Termination};
use cosserat_rod::sweep::Singular;
use nalgebra::{Complex, SMatrix, SVector, Vector3};

/// Corrections of the guess, and of a node on the march, before it is given up.
const CORRECTIONS: usize = 25;
const NODE_CORRECTIONS: usize = 12;
/// What the tip may miss, and the correction of a node, both relative.
const TOLERANCE: f64 = 1e-8;
const NODE_TOLERANCE: f64 = 1e-13;
/// Correction of a node, relative, below which one that does not halve the one before is rounding.
const ROUNDING: f64 = 1e-9;

/// ln of the growth from which Newton on the guess is lost.
const LARGEST_EXPONENT: f64 = 12.0;

/// ln of the largest growth of a march along `cells` cells.
fn exponent(rod: &Rod, length: f64, cells: usize, c: f64) -> f64 {
    let h = length / cells as f64;
    let (bending, mass) = (rod.stiffness.x, rod.mass_per_length);
    let cell = |j: usize| {
        let tension = Complex::from(mass * GRAVITY * (length - (j as f64 + 0.5) * h));
        let root = (tension * tension - 4.0 * bending * mass * c * c).sqrt();
        let growth = |square: Complex<f64>| {
            let kh = (square / (2.0 * bending)).sqrt() * (0.5 * h);
            ((kh + 1.0) / (-kh + 1.0)).norm().ln()
        };
        growth(tension + root).max(growth(tension - root))
    };
    (0..cells).map(cell).sum()
}

/// The steps, s, at which the growth passes the largest that Newton bears.
pub fn limits(rod: &Rod, length: f64, cells: usize, scheme: &Scheme) -> Vec<f64> {
    const PER_DECADE: i32 = 40;
    let step = |i: i32| 10f64.powf(f64::from(i) / f64::from(PER_DECADE));
    let lost = |i: i32| exponent(rod, length, cells, scheme.rate_weight(step(i))) > LARGEST_EXPONENT;
    (-9 * PER_DECADE..3 * PER_DECADE).filter(|i| lost(*i) != lost(*i + 1)).map(step).collect()
}

/// ∂(x, φ) of a node by the six guesses.
type Sensitivity = SMatrix<f64, 15, 6>;

/// A rod whose steps are solved by shooting.
pub struct Shooting {
    rod: Stepper,
    trial: Vec<Node>,
}

impl Shooting {
    /// Takes over a rod.
    pub fn new(rod: Stepper) -> Self {
        Self { trial: rod.state.nodes.clone(), rod }
    }

    /// From the base with the guess (κ, n) to the tip; what the tip misses and its derivative.
    fn march(
        &mut self,
        step: &Step<'_>,
        boundary: &Boundary,
        guess: &SVector<f64, 6>,
    ) -> Option<(SVector<f64, 6>, SMatrix<f64, 6, 6>)> {
        let (old, rest) = (&self.rod.state.nodes, self.rod.rest());
        let base = &boundary.base;
        let first = &mut self.trial[0];
        first.rotation = base.rotation;
        first.position = base.position;
        first.x.u = base.rotation.tr_mul(&base.velocity);
        first.x.omega = base.rotation.tr_mul(&base.angular_velocity);
        first.x.kappa = guess.fixed_rows::<3>(0).into();
        first.x.n = guess.fixed_rows::<3>(3).into();
        step.update_load(first);
        step.update_rates(&old[0], first);
        step.update_first_slopes(first, &rest[0]);
        let mut sensitivity = Sensitivity::zeros();
        sensitivity.fixed_view_mut::<6, 6>(6, 0).fill_with_identity();
        for j in 0..self.rod.mesh.cells.len() {
            let ds = self.rod.mesh.cells[j].length;
            let (before, after) = self.trial.split_at_mut(j + 1);
            let (before, after) = (&before[j], &mut after[0]);
            after.x = before.x;
            let follow = |after: &mut Node| {
                step.update_orientation(before, after, ds);
                step.update_rates(&old[j + 1], after);
                step.update_slope(before, after, ds);
            };
            follow(after);
            let mut last = f64::INFINITY;
            for correction in 1.. {
                let near = [&rest[j], &rest[j + 1]];
                let mut missing = SVector::<f64, 15>::zeros();
                let rows = step.residual(near, [&old[j], &old[j + 1]], [before, after]);
                missing.fixed_rows_mut::<12>(0).copy_from(&rows);
                let blocks = step.blocks(near, [before, after], ds);
                let inverse = blocks.after.try_inverse()?;
                let delta = -(inverse * missing);
                let mut largest = 0.0f64;
                let mut x = after.x.to_array();
                for (k, v) in x.iter_mut().enumerate() {
                    let change: Vector3<f64> = delta.fixed_rows::<3>(3 * k).into();
                    *v += change;
                    largest = largest.max(change.norm() / (v.norm() + f64::MIN_POSITIVE));
                }
                after.x = Unknowns::from_array(x);
                follow(after);
                if !largest.is_finite() {
                    return None;
                }
                let rounding = largest < ROUNDING && largest > 0.5 * last;
                last = largest;
                if largest < NODE_TOLERANCE || rounding || correction == NODE_CORRECTIONS {
                    sensitivity = -(inverse * blocks.before * sensitivity);
                    break;
                }
            }
        }
        let tip = &self.trial[self.trial.len() - 1];
        let mut missing = SVector::<f64, 6>::zeros();
        missing.fixed_rows_mut::<3>(0).copy_from(&(tip.x.kappa - rest[rest.len() - 1].kappa));
        missing.fixed_rows_mut::<3>(3).copy_from(&tip.x.n);
        Some((missing, sensitivity.fixed_view::<6, 6>(6, 0).into()))
    }
}

impl Formulation for Shooting {
    fn step(&mut self, boundary: &Boundary, scheme: Scheme, dt: f64) -> Result<Report, Diverged> {
        if self.rod.state.dt == 0.0 {
            return self.rod.step(boundary, scheme, dt);
        }
        self.rod.state.rebase(scheme, dt);
        let (rod, options) = (self.rod.rod.clone(), self.rod.options);
        let step = Step { rod: &rod, options: &options, time: scheme, dt, gravity: boundary.gravity };
        let base = self.rod.state.nodes[0].x;
        let mut guess = SVector::<f64, 6>::zeros();
        guess.fixed_rows_mut::<3>(0).copy_from(&base.kappa);
        guess.fixed_rows_mut::<3>(3).copy_from(&base.n);
        let mut residual = f64::INFINITY;
        for iterations in 1..=CORRECTIONS {
            let lost = |residual, reason| Diverged { iterations, residual, reason };
            let marched = self.march(&step, boundary, &guess);
            let (missing, derivative) = marched.ok_or(lost(residual, Reason::NotFinite))?;
            let delta = derivative.lu().solve(&missing).ok_or(lost(residual, Reason::Singular(Singular::Base)))?;
            let part = |from: usize| {
                let of = |v: &SVector<f64, 6>| v.fixed_rows::<3>(from).norm();
                of(&delta) / (of(&guess) + of(&delta)).max(f64::MIN_POSITIVE)
            };
            residual = part(0).max(part(3));
            if !residual.is_finite() {
                return Err(lost(residual, Reason::NotFinite));
            }
            guess -= delta;
            if residual < TOLERANCE {
                let length = self.rod.mesh.length();
                self.march(&step, boundary, &guess).ok_or(lost(residual, Reason::NotFinite))?;
                // the march may be exact and the tip miss all the same: then the guess has no digits left
                let tip = &self.trial[self.trial.len() - 1];
                let weight = rod.mass_per_length * length * boundary.gravity.norm();
                if tip.x.n.norm() > 1e-3 * weight {
                    return Err(lost(tip.x.n.norm() / weight, Reason::TooManyIterations));
                }
                for j in 0..self.rod.mesh.cells.len() {
                    let ds = self.rod.mesh.cells[j].length;
                    let rise = (self.trial[j].rotation.column(2) + self.trial[j + 1].rotation.column(2)) * (0.5 * ds);
                    self.trial[j + 1].position = self.trial[j].position + rise;
                }
                self.rod.state.nodes.copy_from_slice(&self.trial);
                self.rod.state.boundary = *boundary;
                return Ok(Report { iterations, residual, termination: Termination::Newton });
            }
        }
        Err(Diverged { iterations: CORRECTIONS, residual, reason: Reason::TooManyIterations })
    }

    fn nodes(&self) -> usize {
        self.rod.nodes()
    }

    fn section(&self, j: usize) -> Section {
        self.rod.section(j)
    }

    fn energy(&self, gravity: &Vector3<f64>) -> Energy {
        Formulation::energy(&self.rod, gravity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene;
    use crate::stability::scan::MATERIALS;
    use cosserat_rod::rate::Options;

    const SCHEME: Scheme = Scheme::BACKWARD_EULER;

    fn steel(cells: usize) -> Stepper {
        let material = &MATERIALS[2];
        Stepper::new(material.mesh(cells), material.rod(), &scene::horizontal(), Options::MENDED).unwrap()
    }

    /// ln of what 100 cells of steel grow by in a step of `dt`.
    fn exponent_of_steel(dt: f64) -> f64 {
        let material = &MATERIALS[2];
        exponent(&material.rod(), material.length, 100, SCHEME.rate_weight(dt))
    }

    #[test]
    fn the_first_step_is_by_relaxation_and_those_after_it_have_its_solution() {
        let boundary = scene::horizontal();
        let (mut relaxed, mut shot) = (steel(25), Shooting::new(steel(25)));
        for step in 0..50 {
            relaxed.step(&boundary, SCHEME, 1e-2).unwrap();
            shot.step(&boundary, SCHEME, 1e-2).unwrap();
            if step == 0 {
                assert_eq!(shot.rod.state, relaxed.state);
            }
            let largest = |of: &dyn Fn(usize, usize) -> f64, k| (0..26).map(|j| of(j, k)).fold(0.0, f64::max);
            for k in 0..4 {
                let x = |rod: &Stepper, j: usize| rod.state.nodes[j].x.to_array()[k];
                let size = largest(&|j, _| x(&relaxed, j).norm(), k);
                let off = largest(&|j, _| (x(&shot.rod, j) - x(&relaxed, j)).norm(), k);
                // the same equations, the guess solved to 1e-8; measured 2e-9
                assert!(off < TOLERANCE * size, "step {step}, unknown {k}: {off:e} of {size:e}");
            }
        }
    }

    #[test]
    fn the_growth_of_the_march_says_where_it_is_lost() {
        let boundary = scene::horizontal();
        let steps = |dt: f64| {
            let mut shot = Shooting::new(steel(100));
            (0..20).take_while(|_| shot.step(&boundary, SCHEME, dt).is_ok()).count()
        };
        // beyond e³⁶ = 1/ε nothing of the guess is left at the tip
        assert!((exponent_of_steel(1e-4) - 43.0).abs() < 1.0, "{}", exponent_of_steel(1e-4));
        assert_eq!(steps(1e-4), 1);
        assert!((exponent_of_steel(1e-2) - 4.4).abs() < 0.1, "{}", exponent_of_steel(1e-2));
        assert_eq!(steps(1e-2), 20);
    }

    #[test]
    fn the_limits_are_where_the_exponent_passes_its_largest() {
        let material = &MATERIALS[2];
        let found = limits(&material.rod(), material.length, 100, &SCHEME);
        // too small a step for the box to follow what grows, and one so long that it does not grow
        assert_eq!(found.len(), 2, "{found:?}");
        for dt in found {
            // the nearest of 40 a decade
            assert!((exponent_of_steel(dt) / LARGEST_EXPONENT - 1.0).abs() < 0.1, "{dt:e}");
        }
    }
}
