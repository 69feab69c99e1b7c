//! A run of the unit to compare other hosts with, in the files of the FMI cross-check: inputs, results, options.

use crate::fmi2::model::{Experiment, Model};
use crate::fmi2::variables::{self, Variable};
use crate::unit::{self, Unit};

/// Where in the archive the files lie: the inputs, a CSV whose rows hold over the step that begins there; the results, a
/// CSV with a row for each communication point; the options, which are start, end, communication step and tolerance.
const FOLDER: &str = "extra/io.github.cosserat-rod";

/// What moves the rod: a base that sways with velocity v = a sin ωt, and a push on the tip that fades.
const DRIVEN: [&str; 3] = ["base.position[2]", "base.velocity[2]", "tip.force[3]"];

/// Rows whose elements are compared; the cross-check allows ten variables.
const COMPARED: [&str; 4] = ["tip.position", "base.reaction_force", "base.reaction_moment", "energy.elastic"];

/// Position (m), velocity (m/s) and force (N) of [`DRIVEN`] beyond their starts after `time` s.
fn drive(time: f64) -> [f64; 3] {
    let (a, omega) = (0.1, 3.0);
    let push = 0.02 * (1.0 - time / 2.0);
    [a * (1.0 - (omega * time).cos()) / omega, a * (omega * time).sin(), push]
}

/// The three files, each with its name: inputs, results and options. The unit as it is compiled is driven; a rod of its own
/// is left with the inputs that it starts with, as not every one can take this drive.
///
/// # Errors
/// What the unit answers to a step that fails.
pub fn files(model: &Model) -> Result<[(String, String); 3], unit::Error> {
    let known = variables::all();
    let driven: Vec<&Variable> =
        DRIVEN.iter().filter_map(|name| known.iter().find(|variable| variable.to_string() == *name)).collect();
    let compared: Vec<&Variable> =
        COMPARED.iter().flat_map(|name| known.iter().filter(move |variable| variable.row.name == *name)).collect();
    let header = |columns: &[&Variable]| {
        let names: String = columns.iter().map(|column| format!(",{column}")).collect();
        format!("time{names}\n")
    };
    let row = |time: f64, values: &[f64]| {
        let values: String = values.iter().map(|value| format!(",{value:?}")).collect();
        format!("{time:?}{values}\n")
    };

    let Model { name, experiment, parameters, inputs: start, .. } = model;
    let Experiment { stop_time, step_size, tolerance } = *experiment;
    let is_driven = *model == Model::default();
    let (mut parameters, mut now) = (parameters.clone(), start.clone());
    let mut starts = model.starts();
    let from: Vec<f64> = driven.iter().map(|variable| starts(variable).unwrap_or_default()).collect();
    let mut set = |time: f64, now: &mut unit::Inputs| {
        let values: Vec<f64> = match is_driven {
            true => from.iter().zip(drive(time)).map(|(start, change)| start + change).collect(),
            false => from.clone(),
        };
        for (variable, value) in driven.iter().zip(&values) {
            // none of them is a parameter
            variable.set(&mut parameters, now, *value);
        }
        values
    };
    let mut inputs = header(&driven) + &row(0.0, &set(0.0, &mut now));
    let mut unit = Unit::new(&model.parameters, &now, Some(tolerance))?;
    let results_at = |time: f64, unit: &Unit| {
        let value = |variable: &&Variable| variable.computed(unit.outputs()).unwrap_or(f64::NAN);
        row(time, &compared.iter().map(value).collect::<Vec<f64>>())
    };
    let mut results = header(&compared) + &results_at(0.0, &unit);
    let mut time = 0.0;
    for k in 1..=(stop_time / step_size).round() as usize {
        let end = k as f64 * step_size;
        unit.advance(&now, end - time)?;
        time = end;
        inputs += &row(time, &set(time, &mut now));
        results += &results_at(time, &unit);
    }
    let options = format!("StartTime,0.0\nStopTime,{stop_time:?}\nStepSize,{step_size:?}\nRelTol,{tolerance:?}\n");
    let file = |end: &str| format!("{FOLDER}/{name}_{end}");
    Ok([(file("in.csv"), inputs), (file("ref.csv"), results), (file("ref.opt"), options)])
}
