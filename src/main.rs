//! The command line: parse, call, print errors once.

use clap::{Parser, Subcommand};
use cosserat_rod::package;
use std::error::Error;
use std::path::PathBuf;
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
        /// Where to write the FMU.
        #[arg(short, long, default_value = "target/CosseratRod.fmu")]
        output: PathBuf,
    },
}

fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("cosserat: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> Result<(), Box<dyn Error>> {
    match command {
        Command::Package { output } => {
            package::package(&output)?;
            println!("{}", output.display());
            Ok(())
        }
    }
}
