//! `cosserat demo`: packages the unit, loads it back out of its archive and drives it through the C interface, as a
//! master does that knows nothing but the model description.
//!
//! The rod hangs from a clamp that holds it level. The clamp begins to shake sideways; later a pulse of force hits the
//! tip.

use super::Progress;
use super::picture::{self, Frame};
use cosserat_rod::fmi2::host::{Fmu, Slave};
use cosserat_rod::fmi2::model::Model;
use cosserat_rod::package;
use cosserat_rod::unit::STATIONS;
use nalgebra::Vector3;
use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Where the picture goes.
#[derive(clap::Args)]
pub struct Arguments {
    /// Where to write the picture, SVG or (where the name ends in .png) PNG.
    #[arg(short, long, default_value = "target/demo.svg")]
    output: PathBuf,
}

const FMU: &str = "target/CosseratRod.fmu";
const UNPACKED: &str = "target/demo";

/// Communication step, s.
const STEP_SIZE: f64 = 0.01;
const STEPS: usize = 400;
/// Between two rows of the table.
const STEPS_PER_ROW: usize = 40;

/// A rod that is stiff enough to stand out from its clamp.
const SETTINGS: [(&str, f64); 2] = [("radius", 0.008), ("youngs_modulus", 2e7)];

/// Amplitude of the shaking along world y, m.
const AMPLITUDE: f64 = 0.08;
/// Its frequency, Hz.
const FREQUENCY: f64 = 0.9;
/// Time it takes to begin, s.
const ONSET: f64 = 1.0;

/// The pulse: largest force, N, begin and duration, s.
const PULSE: Vector3<f64> = Vector3::new(3.0, 0.8, 1.0);
const PULSE_TIME: f64 = 2.0;
const PULSE_DURATION: f64 = 0.25;

/// Displacement and velocity of the base along y.
fn shaking(time: f64) -> (f64, f64) {
    let (sin, cos) = (TAU * FREQUENCY * time).sin_cos();
    let x = (time / ONSET).clamp(0.0, 1.0);
    // four times differentiable where it begins and ends
    let rise = x.powi(5) * (126.0 - x * (420.0 - x * (540.0 - x * (315.0 - x * 70.0))));
    let slope = 630.0 * (x * (1.0 - x)).powi(4) / ONSET;
    (AMPLITUDE * rise * sin, AMPLITUDE * (slope * sin + rise * TAU * FREQUENCY * cos))
}

fn pulse(time: f64) -> Vector3<f64> {
    let x = ((time - PULSE_TIME) / PULSE_DURATION).clamp(0.0, 1.0);
    PULSE * (PI * x).sin().powi(4)
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    package::package(Path::new(FMU), &Model::default())?;
    package::unpack(Path::new(FMU), Path::new(UNPACKED))?;
    let fmu = Fmu::open(Path::new(UNPACKED))?;
    let slave = fmu.instantiate("rod", true)?;
    println!("{FMU}, driven through its C interface");

    let (frames, spent) = drive(&fmu, &slave)?;
    print(&frames)?;
    let simulated = STEP_SIZE * STEPS as f64;
    println!(
        "{simulated} s simulated in {:.3} s: real-time factor {:.1}",
        spent.as_secs_f64(),
        simulated / spent.as_secs_f64()
    );
    slave.log.take().iter().for_each(|line| println!("log: {}", line.text));

    let subtitle = format!("its clamp is shaken sideways, a pulse of force hits the tip at {PULSE_TIME} s");
    picture::draw(&frames, &subtitle)?.write(&arguments.output)?;
    println!("{}", arguments.output.display());
    Ok(())
}

/// The run, and the time spent in the unit.
fn drive(fmu: &Fmu, slave: &Slave<'_>) -> Result<(Vec<Frame>, Duration), Box<dyn Error>> {
    let find = |name: &str| fmu.description.array::<3>(name);
    let (position, velocity, force) = (find("base.position")?, find("base.velocity")?, find("tip.force")?);
    let inputs = [position, velocity, force].concat();
    let real = |name: &str| fmu.description.reference(name, cosserat_rod::fmi2::variables::Kind::Real);
    let mut outputs = Vec::new();
    for k in 1..=STATIONS {
        outputs.extend(find(&format!("station[{k}].position"))?);
    }
    outputs.extend(fmu.description.array::<4>("tip.orientation")?);
    outputs.extend(find("base.reaction_force")?);
    for name in ["kinetic", "elastic", "gravity", "dissipated", "work_base", "work_tip"] {
        outputs.push(real(&format!("energy.{name}"))?);
    }
    let mut values = vec![0.0; outputs.len()];
    let mut frame = |time: f64| -> Result<Frame, Box<dyn Error>> {
        slave.get_real(&outputs, &mut values)?;
        let mut rest = values.iter().copied();
        let mut next = || rest.next().unwrap_or(f64::NAN);
        let mut vector = || Vector3::new(next(), next(), next());
        let mut stations = [Vector3::zeros(); STATIONS];
        stations.fill_with(&mut vector);
        let first = next();
        Ok(Frame {
            time,
            stations,
            tip_orientation: [first, next(), next(), next()],
            reaction: Vector3::new(next(), next(), next()),
            kinetic: next(),
            elastic: next(),
            gravity: next(),
            dissipated: next(),
            work: next() + next(),
        })
    };

    slave.setup_experiment(0.0, Some(STEP_SIZE * STEPS as f64), None)?;
    slave.enter_initialization_mode()?;
    for (name, value) in SETTINGS {
        slave.set_real(&[real(name)?], &[value])?;
    }
    let start = fmu.description.reference("start_in_equilibrium", cosserat_rod::fmi2::variables::Kind::Boolean)?;
    slave.set_boolean(&[start], &[cosserat_rod::fmi2::host::fmi2Boolean(1)])?;
    slave.exit_initialization_mode()?;

    let mut frames = vec![frame(0.0)?];
    let mut progress = Progress::new(STEPS as u64);
    let mut spent = Duration::ZERO;
    let mut time = 0.0;
    for _ in 0..STEPS {
        let ((y, y_t), force) = (shaking(time), pulse(time));
        let begin = Instant::now();
        slave.set_real(&inputs, &[0.0, y, 0.0, 0.0, y_t, 0.0, force.x, force.y, force.z])?;
        slave.do_step(time, STEP_SIZE)?;
        time += STEP_SIZE;
        frames.push(frame(time)?);
        spent += begin.elapsed();
        progress.step();
    }
    slave.terminate()?;
    Ok((frames, spent))
}

fn print(frames: &[Frame]) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out)?;
    writeln!(
        out,
        "  time        tip position           tip orientation               reaction on the base      balance"
    )?;
    writeln!(
        out,
        "     s                   m              w, x, y, z                                  N           mJ"
    )?;
    for frame in frames.iter().step_by(STEPS_PER_ROW) {
        let (tip, [w, x, y, z], force) = (frame.tip(), frame.tip_orientation, frame.reaction);
        write!(out, "{:6.2}", frame.time)?;
        write!(out, "  {:7.3}{:7.3}{:7.3}", tip.x, tip.y, tip.z)?;
        write!(out, "  {w:7.3}{x:7.3}{y:7.3}{z:7.3}")?;
        write!(out, "  {:8.3}{:8.3}{:8.3}", force.x, force.y, force.z)?;
        writeln!(out, "  {:11.3}", 1e3 * (frame.balance() - frames[0].balance()))?;
    }
    writeln!(out)
}
