//! One rod, released from the horizontal, by one method: what became of it.

use crate::scene::{self, GRAVITY};
use cosserat_rod::alpha::Scheme;
use cosserat_rod::formulation::Formulation;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::pose::State;
use cosserat_rod::rod::Rod;
use cosserat_rod::stepper::Stepper;
use cosserat_rod::unit::Parameters;
use nalgebra::Vector3;

/// Steps of a run, most.
pub const STEPS: usize = 200;
/// The motion is compared up to here, s: a quarter swing and more, before anything is chaotic.
const COMPARED: f64 = 0.3;
/// Time step of the reference, s.
const FINE: f64 = 2.5e-4;
/// From this step on, s, the undamped motion is not seen and the answer is compared with the rod at rest.
const UNSEEN: f64 = 0.5;
/// Energy above that of the start, in units of what the rod can gain by falling, from which it grows.
const GROWTH: f64 = 0.01;
/// Change of the length of a cell, relative, from which positions have drifted.
const DRIFT: f64 = 0.01;
/// Alternation of the reaction, in units of the weight, from which it rings.
const RINGING: f64 = 0.1;

/// What is released.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    pub name: &'static str,
    /// Of the rod, m.
    pub length: f64,
    /// Of the section, m.
    radius: f64,
    /// Young's and shear modulus, Pa.
    moduli: (f64, f64),
    /// kg/m³.
    density: f64,
}

/// A hair fibre, a rubber cord, a steel wire.
pub const MATERIALS: [Material; 3] = [
    // A = 1.5e-5 cm²
    Material { name: "hair", length: 0.25, radius: 21.85e-6, moduli: (3.89e9, 0.89e9), density: 1320.0 },
    Material { name: "rubber", length: 1.0, radius: 5e-3, moduli: (5e6, 5e6 / 3.0), density: 1100.0 },
    Material { name: "steel", length: 1.0, radius: 1e-3, moduli: (2e11, 2e11 / 2.6), density: 7850.0 },
];

impl Material {
    pub fn rod(&self) -> Rod {
        Rod::circular(self.radius, self.moduli.0, self.moduli.1, self.density)
    }

    /// The same for the unit, not damped, on cells of one stage.
    pub fn parameters(&self, cells: usize) -> Parameters {
        let Self { length, radius, density, moduli: (youngs_modulus, shear_modulus), .. } = *self;
        Parameters {
            length,
            radius,
            density,
            youngs_modulus,
            shear_modulus,
            damping_bending: 0.0,
            damping_twist: 0.0,
            cells: cells as i32,
            stages: 1,
            ..Parameters::default()
        }
    }

    pub fn mesh(&self, cells: usize) -> Mesh {
        Mesh::uniform(self.length, cells, 1, Vector3::zeros())
    }

    /// ρA g L.
    pub fn weight(&self) -> f64 {
        self.rod().mass_per_length * self.length * GRAVITY
    }
}

/// The motion that all are compared with, and the rod at rest.
pub struct Reference {
    tips: Vec<Vector3<f64>>,
    hanging: Vector3<f64>,
}

impl Reference {
    /// By the pose formulation on 10 cells of 4 stages, whose error is far below what the map shows.
    pub fn new(material: &Material) -> Result<Self, Box<dyn std::error::Error + Send + Sync>> {
        let boundary = scene::horizontal();
        let mesh = Mesh::uniform(material.length, 10, 4, Vector3::zeros());
        let state = State::at_rest_shape(&mesh, &boundary.base);
        let mut hanging = Stepper::new(mesh, material.rod(), state);
        let mut falling = hanging.clone();
        falling.start(&boundary)?;
        let mut tips = vec![falling.tip().position];
        for _ in 0..(COMPARED / FINE).round() as usize {
            falling.advance(&boundary, Scheme::from_spectral_radius(0.5), FINE)?;
            tips.push(falling.tip().position);
        }
        hanging.equilibrium(&boundary)?;
        Ok(Self { tips, hanging: hanging.tip().position })
    }

    fn at(&self, time: f64) -> Option<Vector3<f64>> {
        let place = time / FINE;
        let before = place.floor() as usize;
        let (first, second) = (self.tips.get(before)?, self.tips.get(before + 1)?);
        Some(first.lerp(second, place - before as f64))
    }
}

/// What became of a run, the first that applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// The step was not solved, or a number overflowed.
    Lost,
    /// There is more energy than there was.
    Growing,
    /// The positions have left the rod.
    Drifted,
    /// The reaction alternates from step to step.
    Ringing,
    /// None of these.
    Fine,
}

impl Verdict {
    pub const ALL: [Self; 5] = [Self::Fine, Self::Ringing, Self::Drifted, Self::Growing, Self::Lost];

    pub fn name(&self) -> &'static str {
        match self {
            Self::Lost => "lost",
            Self::Growing => "energy grows",
            Self::Drifted => "positions drift",
            Self::Ringing => "reaction rings",
            Self::Fine => "fine",
        }
    }
}

/// The measures of a run.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    pub verdict: Verdict,
    /// Steps done.
    pub steps: usize,
    /// Newton iterations a step.
    pub iterations: f64,
    /// Largest energy above that of the start, in units of weight times length.
    pub growth: f64,
    /// Largest relative change of the length of a cell.
    pub drift: f64,
    /// Alternation of the reaction over the last ten steps, in units of the weight.
    pub ringing: f64,
    /// Of the tip, in units of the length: RMS up to [`COMPARED`], or at rest after steps that do not see the motion.
    pub error: f64,
}

/// Runs a rod for `count` steps.
pub fn run(
    material: &Material,
    reference: &Reference,
    rod: &mut dyn Formulation,
    scheme: Scheme,
    dt: f64,
    count: usize,
) -> Outcome {
    let boundary = scene::horizontal();
    let (length, weight) = (material.length, material.weight());
    let h = length / (rod.nodes() - 1) as f64;
    let start = rod.energy(&boundary.gravity).total();
    let (mut steps, mut iterations) = (0, 0);
    let (mut growth, mut drift) = (0.0f64, 0.0f64);
    let (mut squares, mut compared) = (0.0, 0);
    let mut reactions: Vec<f64> = Vec::with_capacity(count);
    while steps < count {
        let Ok(report) = rod.step(&boundary, scheme, dt) else { break };
        steps += 1;
        iterations += report.iterations;
        for j in 1..rod.nodes() {
            let chord = (rod.section(j).position - rod.section(j - 1).position).norm();
            // a bent cell has a shorter chord: only what is too long is counted, and what is half gone
            drift = drift.max(chord / h - 1.0).max(if chord < 0.5 * h { 1.0 - chord / h } else { 0.0 });
        }
        let energy = rod.energy(&boundary.gravity);
        // positions that have left the rod say nothing of its height: then it counts as hanging
        let gain = if drift > DRIFT {
            energy.total() - energy.gravity - 0.5 * weight * length
        } else {
            energy.total() - start
        };
        // a maximum would forget what is not a number
        growth = if gain.is_nan() { f64::INFINITY } else { growth.max(gain / (weight * length)) };
        if let Some(exact) = reference.at(steps as f64 * dt) {
            squares += (rod.tip().position - exact).norm_squared();
            compared += 1;
        }
        reactions.push(rod.section(0).force.z / weight);
    }
    let error = if dt < UNSEEN && compared > 0 {
        (squares / compared as f64).sqrt() / length
    } else {
        (rod.tip().position - reference.hanging).norm() / length
    };
    let ringing = alternation(&reactions[reactions.len().saturating_sub(10)..]);
    let verdict = if steps < count || !growth.is_finite() {
        Verdict::Lost
    } else if growth > GROWTH {
        Verdict::Growing
    } else if drift > DRIFT {
        Verdict::Drifted
    } else if ringing > RINGING {
        Verdict::Ringing
    } else {
        Verdict::Fine
    };
    Outcome { verdict, steps, iterations: iterations as f64 / steps.max(1) as f64, growth, drift, ringing, error }
}

/// The smallest jump of a series if all its jumps alternate in sign, else 0.
fn alternation(series: &[f64]) -> f64 {
    let jumps: Vec<f64> = series.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if jumps.len() > 2 && jumps.windows(2).all(|pair| pair[0] * pair[1] < 0.0) {
        jumps.iter().fold(f64::INFINITY, |least, jump| least.min(jump.abs()))
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cosserat_rod::boundary::Boundary;
    use cosserat_rod::energy::Energy;
    use cosserat_rod::pose::Section;
    use cosserat_rod::stepper::{Diverged, Reason, Report, Termination};

    #[test]
    fn only_a_series_whose_jumps_all_change_sign_alternates_by_the_smallest_of_them() {
        assert_eq!(alternation(&[0.0, 3.0, 1.0, 2.0]), 1.0);
        assert_eq!(alternation(&[0.0, 3.0, 1.0, 0.5]), 0.0);
        assert_eq!(alternation(&[1.0, 1.0, 1.0, 1.0]), 0.0);
        // three values always do, or not
        assert_eq!(alternation(&[0.0, 1.0, 0.0]), 0.0);
    }

    /// A straight rod of two cells, all of whose measures are given as functions of the steps done.
    #[derive(Clone, Copy)]
    struct Made {
        steps: usize,
        most: usize,
        stretch: fn(usize) -> f64,
        kinetic: fn(usize) -> f64,
        reaction: fn(usize) -> f64,
    }

    const STILL: Made = Made { steps: 0, most: usize::MAX, stretch: |_| 1.0, kinetic: |_| 0.0, reaction: |_| 1.0 };

    impl Formulation for Made {
        fn step(&mut self, _: &Boundary, _: Scheme, _: f64) -> Result<Report, Diverged> {
            if self.steps == self.most {
                return Err(Diverged { iterations: 1, residual: 1.0, reason: Reason::TooManyIterations });
            }
            self.steps += 1;
            Ok(Report { iterations: 3, residual: 0.0, termination: Termination::Newton })
        }

        fn nodes(&self) -> usize {
            3
        }

        fn section(&self, j: usize) -> Section {
            let material = &MATERIALS[1];
            Section {
                position: -Vector3::z() * (0.5 * material.length * j as f64 * (self.stretch)(self.steps)),
                force: Vector3::z() * ((self.reaction)(self.steps) * material.weight()),
                ..Section::default()
            }
        }

        fn energy(&self, _: &Vector3<f64>) -> Energy {
            let scale = MATERIALS[1].weight() * MATERIALS[1].length;
            Energy { kinetic: (self.kinetic)(self.steps) * scale, ..Energy::default() }
        }
    }

    /// What is said of it in steps that do not see the motion, against a rod that hangs as it does.
    fn outcome(mut made: Made) -> Outcome {
        let material = &MATERIALS[1];
        let reference = Reference { tips: Vec::new(), hanging: -Vector3::z() * material.length };
        run(material, &reference, &mut made, Scheme::BACKWARD_EULER, 1.0, STEPS)
    }

    #[test]
    fn every_verdict_is_reached_by_what_it_means() {
        let fine = outcome(STILL);
        assert_eq!((fine.verdict, fine.steps, fine.iterations, fine.error), (Verdict::Fine, STEPS, 3.0, 0.0));

        let lost = outcome(Made { most: 7, ..STILL });
        assert_eq!((lost.verdict, lost.steps), (Verdict::Lost, 7));
        for overflow in
            [|step| if step > 9 { f64::INFINITY } else { 0.0 }, |step| if step == 9 { f64::NAN } else { 0.0 }]
        {
            assert_eq!(outcome(Made { kinetic: overflow, ..STILL }).verdict, Verdict::Lost);
        }

        let growing = outcome(Made { kinetic: |step| 1e-3 * step as f64, ..STILL });
        assert_eq!(growing.verdict, Verdict::Growing);
        // 200 steps of 1e-3
        assert!((growing.growth - 0.2).abs() < 1e-12, "{}", growing.growth);

        let drifted = outcome(Made { stretch: |step| if step == 9 { 1.2 } else { 1.0 }, ..STILL });
        assert_eq!(drifted.verdict, Verdict::Drifted);
        assert!((drifted.drift - 0.2).abs() < 1e-12, "{}", drifted.drift);

        let ringing = outcome(Made { reaction: |step| 1.0 + if step % 2 == 0 { 0.4 } else { -0.4 }, ..STILL });
        assert_eq!(ringing.verdict, Verdict::Ringing);
        assert!((ringing.ringing - 0.8).abs() < 1e-12, "{}", ringing.ringing);
    }

    #[test]
    fn the_reference_is_read_between_its_instants() {
        let tips = vec![Vector3::zeros(), Vector3::x(), Vector3::x() * 3.0];
        let reference = Reference { tips, hanging: Vector3::zeros() };
        assert!((reference.at(1.5 * FINE).unwrap() - Vector3::x() * 2.0).norm() < 1e-12);
        assert_eq!(reference.at(3.0 * FINE), None);
    }
}
