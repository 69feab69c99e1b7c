//! A unit that is saved and loaded goes on as if nothing had been: outputs and states bit for bit, in the unit itself, in
//! one that is made for it, and in another process.

use cosserat_rod::archive::{Corrupt, load, save};
use cosserat_rod::fmi2::host::{Fmu, Slave};
use cosserat_rod::fmi2::variables::Kind;
use cosserat_rod::package;
use cosserat_rod::so3;
use cosserat_rod::unit::{Inputs, Outputs, Parameters, Tunable, Unit};
use nalgebra::Vector3;
use std::path::Path;
use std::process::Command;
use std::{env, fs, ptr};

type Vec3 = Vector3<f64>;

/// Where a unit may be saved and loaded.
type Place = Option<Box<Unit>>;

/// Length of a communication step, s.
const STEP: f64 = 0.01;
/// Steps that are compared.
const STEPS: usize = 60;

/// A run that is saved before one of its steps.
struct Scene {
    name: &'static str,
    parameters: Parameters,
    /// What acts in a step.
    inputs: fn(usize) -> Inputs,
    /// None: twenty steps before it is in another model.
    saved_before: Option<usize>,
    /// What acts after the save in the run that is taken back.
    astray: fn(usize) -> Inputs,
}

fn still(_: usize) -> Inputs {
    Inputs::default()
}

/// Along the rod and against its weight: in a plane.
fn shaken(i: usize) -> Inputs {
    Inputs { base_velocity: Vec3::x() * (0.3 * (0.3 * i as f64).sin()), ..Inputs::default() }
}

fn pushed(i: usize) -> Inputs {
    Inputs { tip_force: Vec3::y() * (0.02 * (0.2 * i as f64).sin()), ..shaken(i) }
}

fn lifted(i: usize) -> Inputs {
    Inputs { tip_force: Vec3::z() * (0.03 * (0.2 * i as f64).cos()), ..Inputs::default() }
}

/// Turned and moved, with poses and twists that belong to one motion.
fn turned(i: usize) -> Inputs {
    let (sin, cos) = (2.0 * STEP * i as f64).sin_cos();
    let start = so3::from_quaternion(&Inputs::default().base_orientation);
    let rotation = so3::exp(&(Vec3::z() * (0.6 * (1.0 - cos)))) * start;
    Inputs {
        base_position: Vec3::y() * (0.05 * (1.0 - cos)),
        base_velocity: Vec3::y() * (0.1 * sin),
        base_orientation: so3::quaternion(&rotation),
        base_angular_velocity: Vec3::z() * (1.2 * sin),
        ..Inputs::default()
    }
}

/// Once along z, once along y, and then left to itself: a rod without weight comes to rest, and into a plane again.
fn struck(i: usize) -> Inputs {
    let force = match i {
        0..5 => Vec3::y(),
        5..10 => Vec3::z(),
        _ => Vec3::zeros(),
    };
    Inputs { tip_force: force, ..Inputs::default() }
}

fn weighed_down(_: usize) -> Inputs {
    Inputs { tip_force: -Vec3::z() * 0.05, ..Inputs::default() }
}

fn scenes() -> Vec<Scene> {
    let free = Parameters::default;
    let stiff = || Parameters {
        radius: 0.02,
        youngs_modulus: 5e8,
        shear_modulus: 2e8,
        damping_bending: 0.1,
        damping_twist: 0.1,
        gravity: Vec3::zeros(),
        ..free()
    };
    let body = || Parameters { tip_mass: 0.02, tip_inertia: 1e-5, damping_drag: 0.01, ..free() };
    // upright, and soft across: it buckles sideways, slowly
    let ruler = || Parameters {
        section_second_moment: [1e-11, 1e-9],
        section_torsion_constant: 1e-11,
        youngs_modulus: 1e9,
        shear_modulus: 4e8,
        gravity: Vec3::zeros(),
        ..free()
    };
    type Drive = fn(usize) -> Inputs;
    let scene = |name, parameters, inputs: Drive, saved_before, astray: Drive| Scene {
        name,
        parameters,
        inputs,
        saved_before,
        astray,
    };
    let later = Some(30);
    let whip = |planar| Parameters { tolerance: 1e-4, planar, ..free() };
    vec![
        scene("in a plane", free(), shaken, later, shaken),
        scene("in a plane, which is left", free(), shaken, later, pushed),
        scene("in space", free(), pushed, later, lifted),
        scene("in space by wish", Parameters { planar: false, ..free() }, shaken, later, pushed),
        scene("back in a plane", stiff(), struck, None, pushed),
        scene("buckles", ruler(), weighed_down, None, still),
        scene("released", whip(true), still, Some(3), pushed),
        // the errors of cells that have a moment's rest are remembered
        scene("whipping", Parameters { tolerance: 1e-5, ..free() }, still, Some(5), pushed),
        scene("released in space", whip(false), still, Some(3), pushed),
        scene("equal steps", Parameters { step: 2e-3, ..free() }, pushed, later, lifted),
        scene("steps too long", Parameters { step: 1.0, cells: 5, stages: 2, ..free() }, pushed, later, lifted),
        scene("extensible", Parameters { extensible: true, cells: 4, ..free() }, pushed, later, lifted),
        scene("slow", Parameters { quasi_static: true, ..free() }, pushed, later, lifted),
        scene("with a body", body(), pushed, later, lifted),
        scene("with a body in a plane", body(), shaken, later, pushed),
        scene("from rest", Parameters { start_in_equilibrium: true, ..free() }, turned, later, still),
        scene("pose and twist", free(), turned, later, pushed),
        scene("pose alone", Parameters { base_motion: 1, ..free() }, turned, later, pushed),
        scene("twist alone", Parameters { base_motion: 2, ..free() }, turned, later, pushed),
        scene("at the start", free(), shaken, Some(0), pushed),
        scene("tuned", free(), shaken, later, pushed),
        scene("one given cell", Parameters { cells: 1, stages: 3, ..free() }, pushed, later, lifted),
    ]
}

/// What else acts in a step, where a scene changes it.
fn tunable(scene: &Scene, i: usize) -> Tunable {
    let mut tunable = scene.parameters.tunable();
    if scene.name == "tuned" {
        tunable.gravity.z += 0.1 * i as f64;
        tunable.damping_bending = 0.02 + 0.001 * i as f64;
        tunable.damping_drag = 0.01;
    }
    tunable
}

fn step(unit: &mut Place, inputs: &Inputs, tunable: &Tunable) {
    let unit = unit.as_mut().unwrap();
    unit.tune(tunable).unwrap();
    unit.advance(inputs, STEP).unwrap();
}

fn bytes(unit: &mut Place) -> Vec<u8> {
    let mut bytes = Vec::new();
    save(unit, &mut bytes);
    bytes
}

/// Outputs and states after each of the steps from `first` on.
fn run(scene: &Scene, unit: &mut Place, first: usize) -> Vec<(String, Vec<u8>)> {
    let step = |i: usize| {
        step(unit, &(scene.inputs)(i), &tunable(scene, i));
        (format!("{:?}", unit.as_ref().unwrap().outputs()), bytes(unit))
    };
    (first..first + STEPS).map(step).collect()
}

/// The unit before step `saved_before`; of those that go on until they are in another model, 20 steps before that.
fn begun(scene: &Scene) -> (Place, usize) {
    let started = || Some(Box::new(Unit::new(&scene.parameters, &(scene.inputs)(0), None).unwrap()));
    let mut unit = started();
    let mut planar = |i: usize| {
        step(&mut unit, &(scene.inputs)(i), &tunable(scene, i));
        unit.as_ref().unwrap().outputs().solver.planar
    };
    let first = scene.saved_before.unwrap_or_else(|| {
        let models: Vec<bool> = (0..1000).map(&mut planar).collect();
        let change = (20..1000).find(|i| models[*i] != models[*i - 1]);
        change.unwrap_or_else(|| panic!("{}: nothing happens", scene.name)) - 20
    });
    let mut unit = started();
    for i in 0..first {
        step(&mut unit, &(scene.inputs)(i), &tunable(scene, i));
    }
    (unit, first)
}

/// Asserts that two runs are the same to the bit.
fn same(again: &[(String, Vec<u8>)], once: &[(String, Vec<u8>)], what: &str) {
    for (i, (again, once)) in again.iter().zip(once).enumerate() {
        assert_eq!(again.0, once.0, "{what}, outputs after {i} more steps");
        let differ = again.1.iter().zip(&once.1).position(|(again, once)| again != once);
        assert!(again.1 == once.1, "{what}, state after {i} more steps, byte {differ:?} of {}", once.1.len());
    }
}

#[test]
fn a_rollback_goes_on_bit_for_bit() {
    // scenes in which this happens after the save, and when it is undone
    let (mut entered, mut left, mut refined) = ([0; 2], [0; 2], [0; 2]);
    for scene in &scenes() {
        let (mut unit, first) = begun(scene);
        let name = scene.name;
        let saved = bytes(&mut unit);
        let outputs = |unit: &Place| unit.as_ref().unwrap().outputs().clone();
        let before = outputs(&unit);
        let mut note = |after: &Outputs, undone: usize| {
            let (was, is) = (before.solver.planar, after.solver.planar);
            entered[undone] += usize::from(!was && is && first > 0);
            left[undone] += usize::from(was && !is);
            refined[undone] += usize::from(after.cells > before.cells);
        };
        let once = run(scene, &mut unit, first);
        note(&outputs(&unit), 0);
        // rolled back, twice: after what was done, and after what is to be undone
        for astray in [0, STEPS] {
            for i in first..first + astray {
                step(&mut unit, &(scene.astray)(i), &Tunable { gravity: Vec3::z() * -5.0, ..Tunable::default() });
            }
            note(&outputs(&unit), 1);
            load(&mut unit, &saved).unwrap();
            assert_eq!(outputs(&unit), before, "{name}");
            assert!(bytes(&mut unit) == saved, "{name}");
            same(&run(scene, &mut unit, first), &once, &format!("{name}, in the same unit"));
        }
        // in none, and in one that was started otherwise
        let other = Parameters { length: 0.7, ..Parameters::default() };
        for mut fresh in [None, Some(Box::new(Unit::new(&other, &Inputs::default(), None).unwrap()))] {
            load(&mut fresh, &saved).unwrap();
            assert!(bytes(&mut fresh) == saved, "{name}");
            same(&run(scene, &mut fresh, first), &once, &format!("{name}, in another unit"));
        }
    }
    let all = [entered, left, refined];
    assert!(all.as_flattened().iter().all(|scenes| *scenes > 0), "{all:?}");
}

#[test]
fn cells_that_have_just_changed_rest_after_a_load_too() {
    let whip = Parameters { tolerance: 1e-5, ..Parameters::default() };
    let mut unit: Place = Some(Box::new(Unit::new(&whip, &Inputs::default(), None).unwrap()));
    let mut loaded: Vec<(Place, usize)> = Vec::new();
    let (mut cells, mut changes) = (unit.as_ref().unwrap().outputs().cells, 0);
    for i in 0..400 {
        // steps shorter than those the rod would take, lest the rest be over at the end of one
        let advance = |unit: &mut Place| {
            let unit = unit.as_mut().unwrap();
            unit.advance(&Inputs::default(), 1e-3).unwrap();
            unit.outputs().clone()
        };
        let outputs = advance(&mut unit);
        loaded.retain(|(_, first)| i < first + 20);
        for (other, first) in &mut loaded {
            assert_eq!(advance(other), outputs, "saved after step {first}, step {i}");
        }
        if outputs.cells != cells {
            (cells, changes) = (outputs.cells, changes + 1);
            let mut made = None;
            load(&mut made, &bytes(&mut unit)).unwrap();
            loaded.push((made, i));
        }
    }
    assert!(changes > 5, "{changes}");
}

#[test]
fn a_failed_step_changes_no_bit_of_the_state() {
    let mut failed = 0;
    for scene in &scenes() {
        let (mut unit, first) = begun(scene);
        let saved = bytes(&mut unit);
        for size in [1e3, 1e150] {
            let violent = Inputs { tip_force: Vec3::new(1.0, 2.0, 3.0) * size, ..(scene.inputs)(first) };
            if unit.as_mut().unwrap().advance(&violent, STEP).is_ok() {
                load(&mut unit, &saved).unwrap();
                continue;
            }
            failed += 1;
            assert!(bytes(&mut unit) == saved, "{}", scene.name);
        }
    }
    assert!(failed >= scenes().len(), "{failed}");
}

#[test]
fn what_no_unit_can_be_made_of_is_refused() {
    let mut unit: Place = Some(Box::new(Unit::new(&Parameters::default(), &Inputs::default(), None).unwrap()));
    let mut saved = bytes(&mut unit);
    // the length of the rod
    saved[1..9].copy_from_slice(&(-1f64).to_le_bytes());
    let error = load(&mut unit, &saved).unwrap_err();
    assert!(matches!(error, Corrupt::Refused { .. }) && error.to_string().contains("length = -1"), "{error}");
}

/// The Real outputs over the steps from `first` on, with a push aside that takes the rod out of its plane.
fn go_on(fmu: &Fmu, slave: &Slave, first: i32) -> String {
    let variables = fmu.description.variables.values();
    let outputs = variables.filter(|variable| variable.causality == "output" && variable.kind == Kind::Real);
    let references: Vec<_> = outputs.map(|variable| variable.reference).collect();
    let mut values = vec![0.0; references.len()];
    let push = fmu.description.reference("tip.force[2]", Kind::Real).unwrap();
    let mut bits = String::new();
    for i in first..first + STEPS as i32 {
        slave.set_real(&[push], &[if i % 40 > 30 { 0.02 } else { 0.0 }]).unwrap();
        slave.do_step(STEP * f64::from(i), STEP).unwrap();
        slave.get_real(&references, &mut values).unwrap();
        bits.extend(values.iter().map(|value| format!("{:016x}", value.to_bits())));
    }
    bits
}

#[test]
fn a_state_goes_on_in_another_process() {
    // which is this test again, with a state to go on from
    const STATE: &str = "STATE_TO_GO_ON_FROM";
    const BEFORE: i32 = 20;
    let fmu = Fmu::from_library(&package::library().unwrap()).unwrap();
    let slave = fmu.instantiate("rod", false).unwrap();
    if let Some(path) = env::var_os(STATE) {
        let state = slave.deserialize(&fs::read(path).unwrap()).unwrap();
        slave.set_state(state).unwrap();
        println!("{}", go_on(&fmu, &slave, BEFORE));
        return;
    }
    let length = fmu.description.reference("length", Kind::Real).unwrap();
    slave.set_real(&[length], &[0.8]).unwrap();
    slave.setup_experiment(0.0, None, Some(1e-4)).unwrap();
    slave.enter_initialization_mode().unwrap();
    slave.exit_initialization_mode().unwrap();
    (0..BEFORE).for_each(|i| slave.do_step(STEP * f64::from(i), STEP).unwrap());
    let mut state = ptr::null_mut();
    slave.get_state(&mut state).unwrap();
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("state");
    fs::write(&path, slave.serialize(state).unwrap()).unwrap();
    let here = go_on(&fmu, &slave, BEFORE);
    let output = Command::new(env::current_exe().unwrap())
        .args(["--exact", "a_state_goes_on_in_another_process", "--nocapture"])
        .env(STATE, &path)
        .output()
        .unwrap();
    let there = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && there.contains(&here), "{}", String::from_utf8_lossy(&output.stderr));
    slave.set_state(state).unwrap();
    assert!(go_on(&fmu, &slave, BEFORE) == here);
}
