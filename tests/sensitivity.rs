//! Directional derivatives through the C interface: against differences of whole steps and starts.

use cosserat_rod::fmi2::host::{Error, Fmu, Slave, fmi2Boolean};
use cosserat_rod::fmi2::variables::{self, Kind, Variable};
use cosserat_rod::package;
use std::ptr;

/// Values of Real variables.
type Values<'a> = Vec<(&'a str, f64)>;

struct Scene {
    name: &'static str,
    reals: &'static [(&'static str, f64)],
    integers: &'static [(&'static str, i32)],
    booleans: &'static [&'static str],
    /// Inputs from a time on.
    inputs: fn(f64) -> Values<'static>,
}

/// Length of a communication step, s, and the steps before the one that counts: the rod swings.
const STEP: f64 = 0.01;
const STEPS: i32 = 20;

fn pushed(t: f64) -> Values<'static> {
    vec![("base.velocity[1]", 0.3 * t), ("base.position[1]", 0.15 * t * t), ("tip.force[2]", 0.1)]
}

/// With some drag, for there are derivatives by it on both sides.
const FIXED: Scene = Scene {
    name: "",
    reals: &[("step", 0.002), ("damping.drag", 0.01)],
    integers: &[("cells", 4)],
    booleans: &[],
    inputs: pushed,
};

const SCENES: &[Scene] = &[
    Scene {
        name: "plane",
        inputs: |t| vec![("base.velocity[1]", 0.3 * t), ("base.position[1]", 0.15 * t * t)],
        ..FIXED
    },
    Scene {
        name: "turning, with a body and drag",
        reals: &[("step", 0.002), ("tip.mass", 0.01), ("tip.inertia", 1e-6), ("damping.drag", 0.01)],
        integers: &[("cells", 4), ("base.motion", 2)],
        inputs: |t| vec![("base.velocity[1]", 0.3 * t), ("base.angular_velocity[3]", 2.0 * t), ("tip.force[2]", 0.1)],
        ..FIXED
    },
    Scene { name: "pose", integers: &[("cells", 4), ("base.motion", 1)], ..FIXED },
    Scene { name: "extensible", booleans: &["extensible"], ..FIXED },
    Scene {
        name: "driven",
        integers: &[("cells", 4), ("tip.mode", 1)],
        inputs: |t| vec![("tip.driven_velocity[2]", 0.2 * t), ("tip.driven_position[2]", 0.1 * t * t)],
        ..FIXED
    },
    Scene { name: "quasi-static", reals: &[("damping.drag", 0.01)], booleans: &["quasi_static"], ..FIXED },
];

fn fmu() -> Fmu {
    Fmu::from_library(&package::library().unwrap()).unwrap()
}

/// References of the Real variables that are wanted, with their rows.
fn those(wanted: impl Fn(&Variable) -> bool) -> (Vec<u32>, Vec<Variable>) {
    let all = variables::all().into_iter().enumerate().map(|(place, variable)| (place as u32, variable));
    all.filter(|(_, variable)| variable.kind() == Kind::Real && wanted(variable)).unzip()
}

impl Scene {
    /// In initialization mode.
    fn slave<'a>(&self, fmu: &'a Fmu) -> Slave<'a> {
        let slave = fmu.instantiate("rod", false).unwrap();
        slave.setup_experiment(0.0, None, None).unwrap();
        slave.enter_initialization_mode().unwrap();
        set(&slave, fmu, self.reals);
        for (name, value) in self.integers {
            slave.set_integer(&[fmu.description.reference(name, Kind::Integer).unwrap()], &[*value]).unwrap();
        }
        for name in self.booleans {
            let reference = fmu.description.reference(name, Kind::Boolean).unwrap();
            slave.set_boolean(&[reference], &[fmi2Boolean(1)]).unwrap();
        }
        set(&slave, fmu, &(self.inputs)(0.0));
        slave
    }

    /// Before the step that counts; the time.
    fn run(&self, slave: &Slave, fmu: &Fmu) -> f64 {
        slave.exit_initialization_mode().unwrap();
        let mut time = 0.0;
        for _ in 0..STEPS {
            set(slave, fmu, &(self.inputs)(time));
            slave.do_step(time, STEP).unwrap();
            time += STEP;
        }
        set(slave, fmu, &(self.inputs)(time));
        time
    }
}

fn set(slave: &Slave, fmu: &Fmu, values: &[(&str, f64)]) {
    for (name, value) in values {
        slave.set_real(&[fmu.description.reference(name, Kind::Real).unwrap()], &[*value]).unwrap();
    }
}

fn get(slave: &Slave, references: &[u32]) -> Vec<f64> {
    let mut values = vec![f64::NAN; references.len()];
    slave.get_real(references, &mut values).unwrap();
    values
}

/// Something small for a variable.
fn small(variable: &Variable) -> f64 {
    match variable.row.name {
        "tip.moment" => 1e-6,
        "gravity" | "base.angular_velocity" => 1e-3,
        _ => 1e-4,
    }
}

/// The derivatives of values at 0, from those at ±e and ±2e: what is of third order goes out.
fn difference(e: f64, values: impl Fn(f64) -> Vec<f64>) -> Vec<f64> {
    let [far_below, below, above, far_above] = [-2.0, -1.0, 1.0, 2.0].map(|k| values(k * e));
    let of = |i: usize| (8.0 * (above[i] - below[i]) - (far_above[i] - far_below[i])) / (12.0 * e);
    (0..above.len()).map(of).collect()
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Every vector among the outputs has its derivative by every input and tunable parameter within 1e-5 of the difference. What
/// is far smaller than the effect of others as small is seen through the roundings that the differences have, over that:
/// 1e-8, and more where the stretch is stiff or both ends are held.
fn compare(scene: &str, unknowns: &[Variable], knowns: &[Variable], exact: &[Vec<f64>], differences: &[Vec<f64>]) {
    let mut first = 0;
    while first < unknowns.len() {
        let rounding = match scene {
            "extensible" => 2e-7,
            "driven" => 5e-8,
            _ => 1e-8,
        };
        let row = unknowns[first].row.name;
        let end = first + unknowns[first..].iter().take_while(|variable| variable.row.name == row).count();
        let effect = |known: usize| norm(&differences[known][first..end]) * small(&knowns[known]);
        let largest = (0..knowns.len()).map(effect).fold(0.0, f64::max);
        for (k, known) in knowns.iter().enumerate() {
            let pairs = exact[k][first..end].iter().zip(&differences[k][first..end]);
            let error = norm(&pairs.map(|(x, y)| x - y).collect::<Vec<_>>()) * small(known);
            let allowed = 1e-5 * effect(k) + rounding * largest;
            assert!(error <= allowed, "{scene}: {row} by {known}: {error:.2e} of {:.2e}, {largest:.2e}", effect(k));
        }
        first = end;
    }
}

#[test]
fn derivatives_of_a_step_are_those_of_steps_that_are_taken_back() {
    let fmu = fmu();
    let (known, knowns) = those(Variable::is_settable_while_stepping);
    let (unknown, unknowns) = those(Variable::is_output);
    for scene in SCENES {
        let slave = scene.slave(&fmu);
        let time = scene.run(&slave, &fmu);
        let mut state = ptr::null_mut();
        slave.get_state(&mut state).unwrap();
        let held = get(&slave, &known);
        let step = |k: usize, change: f64| {
            slave.set_state(state).unwrap();
            slave.set_real(&[known[k]], &[held[k] + change]).unwrap();
            slave.do_step(time, STEP).unwrap();
            get(&slave, &unknown)
        };
        let (mut exact, mut differences) = (Vec::new(), Vec::new());
        for (k, variable) in knowns.iter().enumerate() {
            differences.push(difference(small(variable), |change| step(k, change)));
            step(k, 0.0);
            exact.push(slave.directional_derivative(&unknown, &[known[k]], &[1.0]).unwrap());
        }
        compare(scene.name, &unknowns, &knowns, &exact, &differences);
        slave.free_state(&mut state).unwrap();
    }
}

#[test]
fn what_is_not_used_has_no_effect_at_all() {
    let fmu = fmu();
    let unused = |motion: i32| -> &[&str] {
        match motion {
            1 => &["base.velocity", "base.angular_velocity"],
            _ => &["base.position", "base.orientation"],
        }
    };
    let (unknown, _) = those(Variable::is_output);
    for scene in SCENES {
        for (_, motion) in scene.integers.iter().filter(|(name, _)| *name == "base.motion") {
            let slave = scene.slave(&fmu);
            let time = scene.run(&slave, &fmu);
            slave.do_step(time, STEP).unwrap();
            let (known, _) = those(|variable| unused(*motion).contains(&variable.row.name));
            for known in known {
                let derivatives = slave.directional_derivative(&unknown, &[known], &[1.0]).unwrap();
                assert!(derivatives.iter().all(|x| *x == 0.0), "{}: {known}: {derivatives:?}", scene.name);
            }
        }
    }
}

#[test]
fn a_free_tip_does_not_feel_what_would_drive_it() {
    let fmu = fmu();
    let scene = Scene {
        // as hosts leave what they do not use
        reals: &[("step", 0.002), ("tip.driven_orientation[1]", 0.0), ("tip.driven_orientation[3]", 0.0)],
        ..FIXED
    };
    let slave = scene.slave(&fmu);
    let time = scene.run(&slave, &fmu);
    slave.do_step(time, STEP).unwrap();
    let (unknown, _) = those(Variable::is_output);
    let (known, _) = those(|variable| variable.row.name.starts_with("tip.driven"));
    assert_eq!(known.len(), 13);
    for known in known {
        let derivatives = slave.directional_derivative(&unknown, &[known], &[1.0]).unwrap();
        assert!(derivatives.iter().all(|x| *x == 0.0), "{known}: {derivatives:?}");
    }
}

#[test]
fn derivatives_of_a_start_are_those_of_other_starts() {
    let fmu = fmu();
    let (known, knowns) = those(Variable::is_settable_while_stepping);
    let (unknown, unknowns) = those(Variable::is_output);
    let scenes = [
        Scene {
            name: "rest shape",
            reals: &[("rest_curvature[1]", 1.0), ("base.velocity[2]", 0.1), ("damping.drag", 0.01)],
            ..FIXED
        },
        Scene {
            name: "equilibrium",
            reals: &[("youngs_modulus", 5e7), ("damping.drag", 0.01)],
            booleans: &["start_in_equilibrium"],
            ..FIXED
        },
    ];
    for scene in scenes {
        let started = |k: usize, change: f64| {
            let slave = scene.slave(&fmu);
            let held = get(&slave, &[known[k]])[0];
            slave.set_real(&[known[k]], &[held + change]).unwrap();
            get(&slave, &unknown)
        };
        let (mut exact, mut differences) = (Vec::new(), Vec::new());
        for (k, variable) in knowns.iter().enumerate() {
            differences.push(difference(small(variable), |change| started(k, change)));
            let slave = scene.slave(&fmu);
            let derivatives = slave.directional_derivative(&unknown, &[known[k]], &[1.0]).unwrap();
            for (unknown, derivative) in unknowns.iter().zip(&derivatives) {
                assert!(
                    *derivative == 0.0 || unknown.depends_initially_on(variable),
                    "{}: {unknown} by {variable}: {derivative}",
                    scene.name
                );
            }
            // as before the first step
            slave.exit_initialization_mode().unwrap();
            assert_eq!(slave.directional_derivative(&unknown, &[known[k]], &[1.0]).unwrap(), derivatives);
            exact.push(derivatives);
        }
        compare(scene.name, &unknowns, &knowns, &exact, &differences);
    }
}

/// Left to itself the unit decides upon steps and cells from step to step; with those as they were, the derivative says
/// how the motion answers: within the tolerance, as steps that are short enough for all of it do.
#[test]
fn steps_that_are_chosen_have_the_derivatives_of_the_motion() {
    let fmu = fmu();
    let unknown: [u32; 3] = fmu.description.array("tip.position").unwrap();
    let force: [u32; 3] = fmu.description.array("tip.force").unwrap();
    let chosen = Scene { reals: &[("tolerance", 1e-4)], integers: &[], ..FIXED };
    let short = Scene { reals: &[("step", 1e-4)], integers: &[("cells", 16)], ..FIXED };
    for inputs in [SCENES[0].inputs, pushed] {
        let of = |scene: Scene| {
            let scene = Scene { inputs, ..scene };
            let slave = scene.slave(&fmu);
            let time = scene.run(&slave, &fmu);
            slave.do_step(time, STEP).unwrap();
            force.map(|known| slave.directional_derivative(&unknown, &[known], &[1.0]).unwrap())
        };
        let (chosen, short) = (of(Scene { ..chosen }), of(Scene { ..short }));
        for (chosen, short) in chosen.iter().zip(&short) {
            let error: Vec<f64> = chosen.iter().zip(short).map(|(x, y)| x - y).collect();
            // a force that sets in raises waves that the tolerance need not see
            assert!(norm(&error) < 0.05 * norm(short), "{chosen:?} against {short:?}");
        }
    }
}

#[test]
fn directions_add_up_and_nothing_changes() {
    let fmu = fmu();
    let (known, _) = those(|variable| ["base.velocity", "tip.force"].contains(&variable.row.name));
    let unknown: [u32; 3] = fmu.description.array("base.reaction_force").unwrap();
    let direction = [0.3, -1.0, 0.7, 0.2, 0.5, -0.4];
    for scene in [Scene { ..FIXED }, Scene { reals: &[], integers: &[], ..FIXED }] {
        let [slave, other] = [(); 2].map(|()| scene.slave(&fmu));
        let mut time = scene.run(&slave, &fmu);
        scene.run(&other, &fmu);
        for slave in [&slave, &other] {
            slave.do_step(time, STEP).unwrap();
        }
        let along = slave.directional_derivative(&unknown, &known, &direction).unwrap();
        let mut sum = [0.0; 3];
        for (known, part) in known.iter().zip(direction) {
            let column = slave.directional_derivative(&unknown, &[*known], &[1.0]).unwrap();
            (0..3).for_each(|i| sum[i] += column[i] * part);
        }
        // the waves that a force raises at once are as large as the derivative
        let error: Vec<f64> = along.iter().zip(&sum).map(|(x, y)| x - y).collect();
        assert!(norm(&error) < 1e-6 * norm(&sum), "{along:?} and {sum:?}");
        assert!(slave.directional_derivative(&unknown, &[], &[]).unwrap().iter().all(|x| *x == 0.0));
        assert!(slave.directional_derivative(&[], &known, &direction).unwrap().is_empty());

        let (all, _) = those(|_| true);
        for _ in 0..3 {
            assert_eq!(get(&slave, &all), get(&other, &all));
            time += STEP;
            for slave in [&slave, &other] {
                slave.do_step(time, STEP).unwrap();
            }
        }
    }
}

fn refused(answer: Result<Vec<f64>, Error>, words: &[&str]) {
    let text = answer.unwrap_err().to_string();
    assert!(words.iter().all(|word| text.contains(word)), "{text}");
}

#[test]
fn what_cannot_be_differentiated_is_refused_by_name() {
    let fmu = fmu();
    let slave = FIXED.slave(&fmu);
    let time = FIXED.run(&slave, &fmu);
    slave.do_step(time, STEP).unwrap();
    let real = |name: &str| fmu.description.reference(name, Kind::Real).unwrap();
    let (tip, force, length) = (real("tip.position[1]"), real("tip.force[1]"), real("length"));
    let cells = fmu.description.reference("cells", Kind::Integer).unwrap();
    let derivative = |unknown: u32, known: u32, part: f64| slave.directional_derivative(&[unknown], &[known], &[part]);
    refused(derivative(force, force, 1.0), &["tip.force[1]", "outputs"]);
    refused(derivative(tip, length, 1.0), &["length", "inputs and tunable parameters"]);
    refused(derivative(tip, tip, 1.0), &["tip.position[1]", "inputs and tunable parameters"]);
    refused(derivative(tip, cells, 1.0), &["cells", "Integer"]);
    refused(derivative(tip, force, f64::NAN), &["tip.force[1] = NaN", "finite"]);
    refused(derivative(9999, force, 1.0), &["9999"]);
    assert!(derivative(tip, force, 1.0).unwrap()[0] > 0.0);

    // a state knows nothing of the step that led there
    let mut state = ptr::null_mut();
    slave.get_state(&mut state).unwrap();
    assert!(derivative(tip, force, 1.0).unwrap()[0] > 0.0);
    slave.set_state(state).unwrap();
    refused(derivative(tip, force, 1.0), &["no step to differentiate in"]);
    slave.do_step(time + STEP, STEP).unwrap();
    assert!(derivative(tip, force, 1.0).unwrap()[0] > 0.0);
    slave.free_state(&mut state).unwrap();
}
