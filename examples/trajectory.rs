//! The library without FMI: 2 s of the default rod with forces on its tip and a base that moves, as CSV on standard
//! output. A row carries the inputs of the step that ends there and the outputs after it; the first row is the start.
//!
//! The tests drive the packaged unit through foreign importers with the inputs of this table and expect its outputs, bit
//! for bit: numbers are written with as many digits as it takes to read them back unchanged.

use cosserat_rod::fmi2::description::{STEP_SIZE, STOP_TIME};
use cosserat_rod::fmi2::variables::{self, Slot, Variable};
use cosserat_rod::unit::{Inputs, Parameters, Unit};
use std::error::Error;
use std::io::{self, Write};

fn main() -> Result<(), Box<dyn Error>> {
    let variables = variables::all();
    let mut parameters = Parameters::default();
    let mut inputs = Inputs::default();
    // All but the parameters, gravity among them.
    let is_port = |variable: &&Variable| variable.is_output() || matches!(variable.row.slot, Slot::Input(_));
    let columns: Vec<&Variable> = variables.iter().filter(is_port).collect();

    let mut out = io::stdout().lock();
    write!(out, "time")?;
    columns.iter().try_for_each(|variable| write!(out, ",{variable}"))?;
    writeln!(out)?;
    let mut row = |time: f64, inputs: &mut Inputs, unit: &Unit| -> io::Result<()> {
        write!(out, "{time}")?;
        for variable in &columns {
            let value = variable.given(&mut parameters, inputs).or_else(|| variable.computed(unit.outputs()));
            write!(out, ",{}", value.unwrap_or(f64::NAN))?;
        }
        writeln!(out)
    };

    let mut unit = Unit::new(&Parameters::default(), &inputs, None)?;
    let mut time = 0.0;
    row(time, &mut inputs, &unit)?;
    for k in 0..(STOP_TIME / STEP_SIZE).round() as i32 {
        let phase = 3.0 * time;
        inputs.base_velocity.y = 0.1 * phase.sin();
        inputs.base_position.y = 0.1 * (1.0 - phase.cos()) / 3.0;
        inputs.tip_force.z = if k < 20 { 0.02 } else { 0.0 };
        unit.advance(&inputs, STEP_SIZE)?;
        time += STEP_SIZE;
        row(time, &mut inputs, &unit)?;
    }
    Ok(())
}
