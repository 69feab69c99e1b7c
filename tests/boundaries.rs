//! Where the methods end, as the stability map of the examples found it: each boundary with the theory behind it, or as
//! the fact that was measured.
//!
//! What never ends is in `stability.rs`, and how the rate formulation drifts and rings in `rate.rs`.

mod common;
#[path = "common/scalar.rs"]
mod scalar;

use common::{along_x, by_poses, by_rates, clamped, hair, rubber};
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::Boundary;
use cosserat_rod::formulation::Formulation;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::pose::Row;
use cosserat_rod::rate::{Options, Orientation};
use nalgebra::{Complex, Vector3};
use scalar::growth;

/// The paper's step, s: none of the rods here resolves its release with it.
const DT: f64 = 1.0 / 30.0;

/// Satisfies the three conditions of section 4.2, α ≤ ½, β ≤ ½ and γ ≥ ½, and not α − β + γ ≥ ½.
const THREE_CONDITIONS: Scheme = Scheme { alpha: 0.0, beta: 0.25, gamma: 0.5 };

/// The same with α such that α − β + γ = ½.
const FOUR_CONDITIONS: Scheme = Scheme { alpha: 0.25, ..THREE_CONDITIONS };

/// Clamped along x, free to fall.
fn released() -> Boundary {
    Boundary { gravity: Vector3::z() * -9.81, ..clamped(along_x()) }
}

fn mesh(length: f64, cells: usize) -> Mesh {
    Mesh::uniform(length, cells, 1, Vector3::zeros())
}

/// Steps done of `steps`.
fn survived(steps: usize, mut step: impl FnMut() -> bool) -> usize {
    (0..steps).take_while(|_| step()).count()
}

#[test]
fn newton_is_lost_on_hair_at_the_papers_step_by_all_but_the_most_damped_schemes_and_never_by_the_units_way() {
    let boundary = released();
    let new = || by_poses(mesh(0.25, 25), hair(), &boundary);
    let by_row = |scheme, row| {
        let mut stepper = new();
        survived(200, || stepper.step(&boundary, scheme, DT, row).is_ok())
    };
    for (row, by_half, by_one) in [(Row::Rotations, 6, 2), (Row::Positions, 30, 17)] {
        for (radius, measured) in [(0.5, by_half), (1.0, by_one)] {
            // as measured, twice: which step it is, rounding may shift
            let steps = by_row(Scheme::from_spectral_radius(radius), row);
            assert!(steps <= 2 * measured, "{row:?}, radius {radius}: {steps} steps");
        }
    }
    for row in [Row::Rotations, Row::Positions] {
        assert_eq!(by_row(Scheme::BACKWARD_EULER, row), 200, "{row:?}");
    }
    assert_eq!(by_row(Scheme::from_spectral_radius(0.0), Row::Positions), 200);
    for radius in [0.0, 0.5, 0.75, 1.0] {
        let mut stepper = new();
        let steps = survived(200, || stepper.advance(&boundary, Scheme::from_spectral_radius(radius), DT).is_ok());
        assert_eq!(steps, 200, "radius {radius}");
    }
}

#[test]
fn a_second_on_hair_needs_orientations_within_newton() {
    // measured: implicit Euler has no share in it, and mending all but the orientations does not help
    let boundary = released();
    let steps = |options, dt| {
        let mut stepper = by_rates(mesh(0.25, 25), hair(), &boundary, options);
        survived(100, || stepper.step(&boundary, Scheme::BACKWARD_EULER, dt).is_ok())
    };
    let lagging = Options { orientation: Orientation::Lagging, ..Options::MENDED };
    for dt in [1.0, 10.0, 100.0] {
        assert_eq!(steps(Options::AS_PRINTED, dt), 0, "{dt} s, as printed");
        assert_eq!(steps(lagging, dt), 0, "{dt} s, mended but for the orientations");
        assert_eq!(steps(Options::MENDED, dt), 100, "{dt} s, mended");
    }
    // the last of the map's steps where the printed algorithm goes through
    assert_eq!(steps(Options::AS_PRINTED, 0.1), 100);
}

/// Eigenvalues λΔt = −k of the paper's test equation, and of an oscillation, from 1e-3 to 1e3.
fn sizes() -> impl Iterator<Item = f64> {
    (-30..=30).map(|i| 10f64.powf(f64::from(i) / 10.0))
}

#[test]
fn three_conditions_are_enough_for_decay_and_not_for_oscillation() {
    let largest = |scheme, z: fn(f64) -> Complex<f64>| sizes().map(|k| growth(&scheme, z(k))).fold(0.0, f64::max);
    let decay = |k: f64| Complex::new(-k, 0.0);
    let oscillation = |k: f64| Complex::new(0.0, k);
    // section 4.2 derives them for real k > 0, and there they hold
    assert!(largest(THREE_CONDITIONS, decay) < 1.0);
    // an oscillation grows by up to 30 % a step, most of all at kΔt = 3, and at every kΔt from what is well resolved on
    assert!((largest(THREE_CONDITIONS, oscillation) - 1.295).abs() < 1e-3);
    for k in sizes() {
        assert!(growth(&THREE_CONDITIONS, oscillation(k)) > 1.0, "{k}");
    }
    // rounding
    assert!(largest(FOUR_CONDITIONS, oscillation) < 1.0 + 1e-12);
}

#[test]
fn with_a_fourth_they_are_enough_for_both_and_without_it_never() {
    let tenths = |from: i32, to: i32| (from..=to).map(|i| 0.1 * f64::from(i));
    for alpha in tenths(-5, 5) {
        for beta in tenths(0, 5) {
            for gamma in tenths(5, 10) {
                let scheme = Scheme { alpha, beta, gamma };
                let bounded = |z: fn(f64) -> Complex<f64>| sizes().all(|k| growth(&scheme, z(k)) < 1.0 + 1e-12);
                assert!(bounded(|k| Complex::new(-k, 0.0)), "{scheme:?}");
                // tenths are no binary numbers
                let fourth = alpha - beta + gamma > 0.5 - 1e-12;
                assert_eq!(bounded(|k| Complex::new(0.0, k)), fourth, "{scheme:?}");
            }
        }
    }
}

/// Energy above that of the start, largest over 100 steps, in units of what rubber can gain by falling; `None` if it is
/// lost.
fn gain<F: Formulation>(mut rod: F, mut step: impl FnMut(&mut F) -> bool) -> Option<f64> {
    let gravity = released().gravity;
    let scale = rubber().mass_per_length * 9.81;
    let start = rod.energy(&gravity).total();
    (0..100).try_fold(0.0f64, |largest, _| {
        let gain = step(&mut rod).then(|| (rod.energy(&gravity).total() - start) / scale)?;
        Some(largest.max(gain))
    })
}

#[test]
fn a_rod_is_an_oscillation() {
    let boundary = released();
    for dt in [1e-4, 1e-3, 1e-2] {
        let [three, four] = [THREE_CONDITIONS, FOUR_CONDITIONS].map(|scheme| {
            let rates = by_rates(mesh(1.0, 25), rubber(), &boundary, Options::MENDED);
            let poses = by_poses(mesh(1.0, 25), rubber(), &boundary);
            [
                gain(rates, |rod| rod.step(&boundary, scheme, dt).is_ok()),
                gain(poses, |rod| rod.step(&boundary, scheme, dt, Row::Rotations).is_ok()),
            ]
        });
        // at up to 1.3 a step: after 19 to 41 of them
        assert_eq!(three, [None, None], "{dt} s");
        // at 10 ms the release is not resolved: 1.4 % by rates, 0.02 % by poses
        assert!(four.iter().all(|gain| gain.is_some_and(|gain| gain < 0.02)), "{dt} s: {four:?}");
    }
}

#[test]
fn steps_of_the_papers_examples_are_those_of_implicit_euler() {
    // v = (1−α)ẋᵢ + αẋᵢ₋₁ with 1−α = γ is (xᵢ − xᵢ₋₁)/Δt, whatever ẋ
    let boundary = released();
    let scheme = Scheme { alpha: 0.3, beta: 0.0, gamma: 0.7 };
    for row in [Row::Rotations, Row::Positions] {
        let mut rods = [(); 2].map(|()| by_poses(mesh(0.25, 25), hair(), &boundary));
        for step in 0..60 {
            for (rod, scheme) in rods.iter_mut().zip([scheme, Scheme::BACKWARD_EULER]) {
                rod.step(&boundary, scheme, DT, row).unwrap();
            }
            // what Newton's tolerance, 1e-8, leaves after the square that follows it
            let off = (rods[0].tip().position - rods[1].tip().position).norm();
            assert!(off < 1e-12, "{row:?}, {step}: {off:e}");
        }
    }
}
