//! A run of the unit to compare other hosts with, in the files of the FMI cross-check: inputs, results, options.

use crate::fmi2::description::{STEP_SIZE, STOP_TIME, TOLERANCE};
use crate::fmi2::variables::{self, Variable};
use crate::unit::{self, Inputs, Parameters, Unit};

/// Where in the archive the inputs lie: a CSV, whose rows hold over the step that begins there.
pub const INPUTS: &str = "extra/io.github.cosserat-rod/CosseratRod_in.csv";

/// Where in the archive the results lie: a CSV with a row for each communication point.
pub const RESULTS: &str = "extra/io.github.cosserat-rod/CosseratRod_ref.csv";

/// Where in the archive the options lie: start, end, communication step and tolerance.
pub const OPTIONS: &str = "extra/io.github.cosserat-rod/CosseratRod_ref.opt";

/// What moves the rod: a base that sways with velocity v = a sin ωt, and a push on the tip that fades.
const DRIVEN: [&str; 3] = ["base.position[2]", "base.velocity[2]", "tip.force[3]"];

/// Rows whose elements are compared; the cross-check allows ten variables.
const COMPARED: [&str; 4] = ["tip.position", "base.reaction_force", "base.reaction_moment", "energy.elastic"];

/// Position (m), velocity (m/s) and force (N) of [`DRIVEN`] at `time`, s.
fn drive(time: f64) -> [f64; 3] {
    let (a, omega) = (0.1, 3.0);
    let push = 0.02 * (1.0 - time / STOP_TIME);
    [a * (1.0 - (omega * time).cos()) / omega, a * (omega * time).sin(), push]
}

/// The three files, each with its name: inputs, results and options.
///
/// # Errors
/// What the unit answers to a step that fails.
pub fn files() -> Result<[(&'static str, String); 3], unit::Error> {
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

    let (mut parameters, mut now) = (Parameters::default(), Inputs::default());
    let mut set = |time: f64, now: &mut Inputs| {
        let values = drive(time);
        for (variable, value) in driven.iter().zip(values) {
            // none of them is a parameter
            variable.set(&mut parameters, now, value);
        }
        values
    };
    let mut inputs = header(&driven) + &row(0.0, &set(0.0, &mut now));
    let mut unit = Unit::new(&Parameters::default(), &now, None)?;
    let results_at = |time: f64, unit: &Unit| {
        let value = |variable: &&Variable| variable.computed(unit.outputs()).unwrap_or(f64::NAN);
        row(time, &compared.iter().map(value).collect::<Vec<f64>>())
    };
    let mut results = header(&compared) + &results_at(0.0, &unit);
    let mut time = 0.0;
    for k in 1..=(STOP_TIME / STEP_SIZE).round() as usize {
        let end = k as f64 * STEP_SIZE;
        unit.advance(&now, end - time)?;
        time = end;
        inputs += &row(time, &set(time, &mut now));
        results += &results_at(time, &unit);
    }
    let options = format!("StartTime,0.0\nStopTime,{STOP_TIME:?}\nStepSize,{STEP_SIZE:?}\nRelTol,{TOLERANCE:?}\n");
    Ok([(INPUTS, inputs), (RESULTS, results), (OPTIONS, options)])
}
