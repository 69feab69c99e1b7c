//! `cosserat modes`: natural frequencies of the rod about its static equilibrium.

use cosserat_rod::modes::Mode;
use cosserat_rod::unit::Unit;
use nalgebra::Vector3;
use std::error::Error;
use std::io::{self, Write};
use std::path::PathBuf;

/// Of which rod, and how many.
#[derive(clap::Args)]
pub struct Arguments {
    /// How many frequencies, from the lowest.
    #[arg(short, long, default_value_t = 6, value_parser = clap::value_parser!(u8).range(1..))]
    count: u8,
    /// A rod in a file, as `package` takes it, in place of the unit's own.
    #[arg(long, value_name = "FILE")]
    rod: Option<PathBuf>,
    /// Sets a parameter, or an input the equilibrium is under; arrays by element (gravity[3]=0) or as a whole
    /// (gravity=0,0,0).
    #[arg(short, long, value_name = "NAME=VALUE")]
    set: Vec<String>,
}

/// Below this part of the kinetic energy in the motion of the centreline, a mode is one of twist.
const TWIST: f64 = 0.5;

/// Above this part of the strain of the centreline along itself, a mode is one of stretch.
const STRETCH: f64 = 0.5;

/// Prints the table.
pub fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let (mut parameters, inputs) = super::settings(arguments.rod.as_deref(), &arguments.set)?;
    parameters.start_in_equilibrium = true;
    let count = usize::from(arguments.count);
    let mut unit = Unit::new(&parameters, &inputs, None)?;
    // a cell for every half wave, where the cells are chosen by the unit for the lowest motions only
    if parameters.cells == 0 && unit.outputs().cells < i32::from(arguments.count) {
        parameters.cells = arguments.count.into();
        unit = Unit::new(&parameters, &inputs, None)?;
    }
    let mut out = io::stdout().lock();
    writeln!(out, "about the static equilibrium, damping left out; tip at {}", point(&unit.outputs().tip_position))?;
    writeln!(out, "  no   frequency        period   kind        motion along x, y, z")?;
    writeln!(out, "              Hz             s               of the world, per cent")?;
    let nodes: Vec<Vector3<f64>> = unit.stepper().state.nodes.iter().map(|node| node.position).collect();
    for (k, mode) in unit.modes(count)?.iter().enumerate() {
        let frequency = mode.frequency();
        write!(out, "{:4} {:>11} {:>13}", k + 1, digits(frequency), digits(1.0 / frequency))?;
        if mode.travel < TWIST {
            writeln!(out, "   twist")?;
        } else {
            let [x, y, z] = shares(mode);
            let kind = if stretch(mode, &nodes) < STRETCH { "bending" } else { "stretch" };
            writeln!(out, "   {kind}    {x:5.0} {y:5.0} {z:5.0}")?;
        }
    }
    Ok(())
}

fn point(position: &Vector3<f64>) -> String {
    format!("({:.4}, {:.4}, {:.4}) m", position.x, position.y, position.z)
}

/// Six of them that count.
fn digits(value: f64) -> String {
    let decimals = (5.0 - value.abs().log10().floor()).clamp(0.0, 12.0);
    format!("{value:.*}", decimals as usize)
}

/// How much of the motion is along each world axis, per cent of the squares.
fn shares(mode: &Mode) -> [f64; 3] {
    let sum: Vector3<f64> = mode.shape.iter().map(|at| at.component_mul(at)).sum();
    (sum * (100.0 / sum.sum())).into()
}

/// How much of the difference of motion between neighbouring nodes is along the rod.
fn stretch(mode: &Mode, nodes: &[Vector3<f64>]) -> f64 {
    let (mut along, mut all) = (0.0, 0.0);
    for (ends, motion) in nodes.windows(2).zip(mode.shape.windows(2)) {
        let change = motion[1] - motion[0];
        along += (ends[1] - ends[0]).normalize().dot(&change).powi(2);
        all += change.norm_squared();
    }
    along / all
}
