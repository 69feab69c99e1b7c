//! The command line: parse, call, print errors once.

mod cli;

use clap::{Parser, Subcommand};
use cosserat_rod::package::{self, rod_file};
use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// One elastic rod as an FMI 2.0 co-simulation unit.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Packages the library and its description as an FMU.
    Package {
        /// A rod of its own name, shape and start values (TOML, see examples/coil_hose.toml); without it, the unit itself.
        #[arg(conflicts_with = "merge")]
        rod: Option<PathBuf>,
        /// Where to write the FMU; without it, to target/ under the name of the model.
        #[arg(short, long)]
        output: Option<PathBuf>,
        /// A library built elsewhere, for this platform or win64; without it, the one built with this program.
        #[arg(long, value_name = "LIBRARY", conflicts_with = "merge")]
        library: Option<PathBuf>,
        /// FMUs of the same model, built on other platforms: writes one with the libraries of all.
        #[arg(long, value_name = "FMU", num_args = 1.., requires = "output")]
        merge: Vec<PathBuf>,
    },
    /// Tells what is in an FMU: model, platforms, capabilities, parameters.
    Info(cli::info::Arguments),
    /// Checks an FMU of FMI 2.0 co-simulation: its archive, its description, and its library by one step.
    Check(cli::check::Arguments),
    /// Packages the unit, shakes it through its C interface, and draws what it did.
    Demo(cli::demo::Arguments),
    /// Runs the rod: a CSV of inputs in, a CSV of outputs out.
    Simulate(cli::simulate::Arguments),
    /// Prints the natural frequencies of the rod about its static equilibrium.
    Modes(cli::modes::Arguments),
    /// Charts error against CPU time, and says which settings to use for which accuracy.
    Chart(cli::chart::Arguments),
}

fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        // who reads only the first lines has what they want
        Err(error) if is_broken_pipe(&*error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("cosserat: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> Result<(), Box<dyn Error>> {
    match command {
        Command::Package { rod, output, library, merge } => {
            let model = rod.as_deref().map(rod_file::read).transpose()?.unwrap_or_default();
            let output = output.unwrap_or_else(|| Path::new("target").join(format!("{}.fmu", model.name)));
            match library {
                _ if !merge.is_empty() => package::merge(&merge, &output)?,
                Some(library) => {
                    if package::package_library(&library, &output, &model)? == package::Checked::Read {
                        eprintln!("cosserat: {} is for another platform and was not run", library.display());
                    }
                }
                None => package::package(&output, &model)?,
            }
            println!("{}", output.display());
            Ok(())
        }
        Command::Info(arguments) => cli::info::run(&arguments),
        Command::Check(arguments) => cli::check::run(&arguments),
        Command::Demo(arguments) => cli::demo::run(&arguments),
        Command::Simulate(arguments) => cli::simulate::run(&arguments),
        Command::Modes(arguments) => cli::modes::run(&arguments),
        Command::Chart(arguments) => cli::chart::run(&arguments),
    }
}

fn is_broken_pipe(error: &(dyn Error + 'static)) -> bool {
    let kind = match (error.downcast_ref::<io::Error>(), error.downcast_ref::<csv::Error>().map(csv::Error::kind)) {
        (Some(error), _) | (_, Some(csv::ErrorKind::Io(error))) => error.kind(),
        _ => return false,
    };
    kind == io::ErrorKind::BrokenPipe
}
