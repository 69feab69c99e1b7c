//! What the model description says the initial outputs depend on, against what they do depend on.

use cosserat_rod::fmi2::host::{Fmu, Slave, fmi2Boolean};
use cosserat_rod::fmi2::variables::{self, Kind, Variable};
use cosserat_rod::package;

fn set(slave: &Slave, reference: usize, kind: Kind, value: f64) {
    let reference = [u32::try_from(reference).unwrap()];
    match kind {
        Kind::Integer => slave.set_integer(&reference, &[value as i32]).unwrap(),
        Kind::Boolean => slave.set_boolean(&reference, &[fmi2Boolean(value as i32)]).unwrap(),
        _ => slave.set_real(&reference, &[value]).unwrap(),
    }
}

fn get(slave: &Slave, reference: usize, kind: Kind) -> f64 {
    let reference = [u32::try_from(reference).unwrap()];
    let (mut integer, mut boolean, mut real) = ([0], [fmi2Boolean(0)], [0.0]);
    match kind {
        Kind::Integer => slave.get_integer(&reference, &mut integer).unwrap(),
        Kind::Boolean => slave.get_boolean(&reference, &mut boolean).unwrap(),
        _ => slave.get_real(&reference, &mut real).unwrap(),
    }
    real[0] + f64::from(integer[0]) + f64::from(boolean[0].0)
}

/// A value of a parameter or input that is allowed and different enough to be felt.
fn other(name: &str, unit: &str, kind: Kind, value: f64) -> f64 {
    match kind {
        Kind::Boolean => 1.0 - value,
        Kind::Integer if name == "cells" => value + 1.0,
        Kind::Integer if name == "tip.mode" => 1.0 - value,
        Kind::Integer => {
            if value == 1.0 {
                2.0
            } else {
                1.0
            }
        }
        _ if value != 0.0 => value * 1.01,
        _ => match unit {
            "m4" => 1e-9,
            "m2" => 1e-4,
            _ => 0.01,
        },
    }
}

/// Rounding is no dependence: a rod started elsewhere has the same orientations but for the last digits.
const ROUNDING: f64 = 1e-7;

#[test]
fn initial_outputs_depend_on_nothing_that_is_not_declared() {
    let fmu = Fmu::from_library(&package::library().unwrap()).unwrap();
    let variables = variables::all();
    let still: &[(&str, f64)] = &[("cells", 4.0), ("stages", 2.0), ("youngs_modulus", 5e7)];
    let moving: &[(&str, f64)] = &[
        ("cells", 4.0),
        ("stages", 2.0),
        ("rest_curvature[1]", 0.5),
        ("rest_curvature[3]", 0.3),
        ("base.velocity[1]", 0.2),
        ("base.angular_velocity[3]", 0.4),
        ("tip.force[2]", 0.01),
        ("tip.mass", 0.01),
    ];
    let driven: &[(&str, f64)] = &[
        ("cells", 4.0),
        ("stages", 2.0),
        ("tip.mode", 1.0),
        ("tip.mass", 0.01),
        ("tip.driven_velocity[2]", 0.2),
        ("tip.driven_angular_velocity[3]", 0.4),
    ];
    for scene in [still, moving, driven] {
        let initialized = |changed: Option<usize>| {
            let slave = fmu.instantiate("rod", false).unwrap();
            slave.enter_initialization_mode().unwrap();
            for (name, value) in scene {
                let variable = &fmu.description.variables[*name];
                set(&slave, variable.reference as usize, variable.kind, *value);
            }
            if let Some(reference) = changed {
                let (variable, kind) = (&variables[reference], variables[reference].kind());
                let value = other(&variable.to_string(), variable.row.unit, kind, get(&slave, reference, kind));
                set(&slave, reference, kind, value);
            }
            slave.exit_initialization_mode().unwrap();
            let value = |(reference, variable): (usize, &Variable)| get(&slave, reference, variable.kind());
            variables.iter().enumerate().map(value).collect::<Vec<f64>>()
        };
        let before = initialized(None);
        for (known, changed) in variables.iter().enumerate().filter(|(_, variable)| !variable.is_output()) {
            let after = initialized(Some(known));
            assert_ne!(after[known], before[known], "{changed}");
            for (unknown, output) in variables.iter().enumerate().filter(|(_, variable)| variable.is_output()) {
                let (old, new) = (before[unknown], after[unknown]);
                let same = (new - old).abs() <= ROUNDING * (1.0 + old.abs());
                assert!(
                    same || output.depends_initially_on(changed),
                    "{output} changes with {changed}: {old} to {new}"
                );
            }
        }
    }
}
